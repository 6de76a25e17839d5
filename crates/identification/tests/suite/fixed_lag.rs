//! The sliding window against the batch, against the truth, and on logs with dropouts and spikes.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

use crate::exact_motion::{Multisine, Run, is_consistent};
use crate::random::Random;
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::lie::{LieGroup, Pose, Wrench};
use tumble_identification::nalgebra::{Matrix3, SVector, UnitQuaternion, Vector3};
use tumble_identification::{
    FixedLag, FixedLagSettings, FixedLagStep, IdentificationError, LikelihoodEstimate, LongRecord, MaximumLikelihood,
    MotionSample, Noise, Nuisance, Nuisances, Settings, Verdict, Warning, WrenchTiming, identify, merge,
};

const CUBESAT: Levels = Levels { pose: 1e-3, torque: 1e-4, force: 1e-3 };
const PLATE: Levels = Levels { pose: 1e-3, torque: 1e-3, force: 1e-2 };

/// One standard deviation per sample and axis.
#[derive(Clone, Copy)]
struct Levels {
    pose: f64,
    torque: f64,
    force: f64,
}

impl Levels {
    fn known(self) -> Noise {
        let Self { pose, torque, force } = self;
        Noise { position_m: pose, attitude_rad: pose, torque_n_m: torque, force_n: force, ..Noise::default() }
    }
}

fn body(seed: u64, mass: f64, center: [f64; 3], principal: [f64; 3]) -> InertialParameters<f64> {
    let axes = Random::new(seed).attitude().to_rotation_matrix().into_inner();
    let inertia = axes * Matrix3::from_diagonal(&Vector3::from(principal)) * axes.transpose();
    InertialParameters::about_com(mass, Vector3::from(center), inertia)
}

fn cubesat() -> InertialParameters<f64> {
    body(13, 9.41, [0.031, -0.017, 0.052], [0.161, 0.139, 0.172])
}

/// Flat: the triangle inequality holds with equality.
fn plate() -> InertialParameters<f64> {
    body(14, 6.0, [0.02, 0.03, 0.0], [0.08, 0.11, 0.19])
}

/// Multisine at 62.5 Hz; noisy poses and wrenches.
fn log_of(body: InertialParameters<f64>, held: bool, duration_s: f64, levels: Levels, seed: u64) -> Vec<MotionSample> {
    let mut random = Random::new(seed);
    let signal = Multisine::random(&mut random, 0.04 / 1.7, 0.4 / 1.7, (0.31, 2.83), 3);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(body, &wrench, held);
    run.step_ns = 16_000_000;
    run.substep_s = 4e-3;
    run.samples = (duration_s / 0.016) as usize;
    let mut record = run.record();
    for sample in &mut record {
        let Levels { pose, torque, force } = levels;
        sample.world_from_body.as_mut().unwrap().translation.vector += random.normal3(pose);
        sample.world_from_body.as_mut().unwrap().rotation *=
            <UnitQuaternion<f64> as LieGroup>::exp(&random.normal3(pose));
        sample.wrench_body =
            sample.wrench_body.map(|w| Wrench::new(w.torque + random.normal3(torque), w.force + random.normal3(force)));
        (sample.rate_body, sample.velocity_origin_world, sample.acceleration_origin_body) = (None, None, None);
    }
    record
}

fn log(duration_s: f64, seed: u64) -> Vec<MotionSample> {
    log_of(cubesat(), true, duration_s, CUBESAT, seed)
}

fn settings() -> FixedLagSettings {
    let likelihood =
        MaximumLikelihood { noise: Some(CUBESAT.known()), segment_samples: Some(16), ..MaximumLikelihood::default() };
    FixedLagSettings { likelihood, ..FixedLagSettings::default() }
}

fn slide(settings: FixedLagSettings, record: &[MotionSample]) -> (Vec<FixedLagStep>, LikelihoodEstimate) {
    let mut window = FixedLag::new(settings);
    let steps = record.iter().filter_map(|row| window.push(*row).unwrap()).collect();
    (steps, window.finish().unwrap())
}

/// `[ln m, c, J_C]`.
fn eta(body: &InertialParameters<f64>) -> SVector<f64, 10> {
    let (c, j) = (body.center_of_mass(), body.inertia_about_com());
    let inertia = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|at| j[at]);
    SVector::from_iterator([body.mass.ln(), c.x, c.y, c.z].into_iter().chain(inertia))
}

/// Largest difference in standard deviations.
fn apart(a: &LikelihoodEstimate, b: &LikelihoodEstimate) -> f64 {
    (eta(&a.parameters) - eta(&b.parameters)).component_div(&b.std).amax()
}

/// Mean square error over the batch's variances.
fn error_by_bound(found: &LikelihoodEstimate, batch: &LikelihoodEstimate) -> f64 {
    (eta(&found.parameters) - eta(&cubesat())).component_div(&batch.std).norm_squared() / 10.0
}

fn nees(found: &LikelihoodEstimate, truth: &InertialParameters<f64>) -> f64 {
    let error: SVector<f64, 10> = found.unconstrained - truth.to_vector();
    let scale = found.covariance.diagonal().map(|v| 1.0 / v.sqrt());
    let scaled = error.component_mul(&scale);
    let correlation = found.covariance.map_with_location(|i, j, v| v * scale[i] * scale[j]);
    scaled.dot(&correlation.cholesky().unwrap().solve(&scaled))
}

/// Bands of chi-square with 160 degrees of freedom over 16 runs, 99.9 %.
const RUNS: u64 = 16;
const BAND: (f64, f64) = (6.74, 14.05);

#[test]
fn close_to_the_batch_and_honest() {
    let (mut window_nees, mut filter_nees, mut window_error, mut filter_error) = (0.0, 0.0, 0.0, 0.0);
    let (mut nis, mut degrees) = (0.0, 0.0);
    for seed in 0..RUNS {
        let record = log(60.0, 500 + seed);
        let batch = settings().likelihood.estimate(&record).unwrap();
        let (steps, window) = slide(settings(), &record);
        let (_, filter) = slide(FixedLagSettings { segments: 1, iterations: 1, ..settings() }, &record);
        assert!(apart(&window, &batch) < 0.15, "seed {seed}: {}", apart(&window, &batch));
        window_nees += nees(&window, &cubesat()) / RUNS as f64;
        filter_nees += nees(&filter, &cubesat()) / RUNS as f64;
        window_error += error_by_bound(&window, &batch) / RUNS as f64;
        filter_error += error_by_bound(&filter, &batch) / RUNS as f64;
        for innovation in steps.iter().filter_map(|step| step.innovation) {
            nis += innovation.nis;
            degrees += innovation.degrees as f64;
        }
    }
    assert!(BAND.0 < window_nees && window_nees < BAND.1, "{window_nees}");
    assert!(BAND.0 < filter_nees && filter_nees < BAND.1, "{filter_nees}");
    assert!(window_error.sqrt() < 1.3 && filter_error.sqrt() < 1.3, "{window_error} {filter_error}");
    assert!((nis / degrees - 1.0).abs() < 3.3 * (2.0 / degrees).sqrt(), "{nis} {degrees}");
}

#[test]
fn a_window_over_everything_is_the_batch() {
    for (held, timing) in [(true, WrenchTiming::Held), (false, WrenchTiming::Sampled)] {
        let record = log_of(cubesat(), held, 20.0, CUBESAT, 7);
        let likelihood = MaximumLikelihood { robust: false, wrench_timing: timing, ..settings().likelihood };
        let batch = likelihood.estimate(&record).unwrap();
        let wide = FixedLagSettings { segments: 1000, likelihood, ..settings() };
        let (steps, found) = slide(wide, &record);
        assert!(steps.len() > 50 && apart(&found, &batch) < 1e-6, "{}", apart(&found, &batch));
        assert!((found.cost - batch.cost).abs() < 1e-6 * batch.cost);
    }
}

#[test]
fn every_step_is_a_body() {
    let mut active = 0;
    for seed in 0..4 {
        let record = log_of(plate(), true, 30.0, PLATE, 40 + seed);
        let likelihood = MaximumLikelihood { noise: Some(PLATE.known()), ..MaximumLikelihood::default() };
        let (steps, _) = slide(FixedLagSettings { likelihood, ..FixedLagSettings::default() }, &record);
        assert!(steps.iter().all(|step| is_consistent(&step.parameters)), "seed {seed}");
        active += steps.iter().filter(|step| step.active_axis.is_some()).count();
    }
    assert!(active > 0);
}

#[test]
fn survives_a_dropout() {
    for seed in 0..4 {
        let mut record = log(60.0, 600 + seed);
        record.retain(|row| !(20_000_000_000..22_000_000_000).contains(&row.time_ns));
        let batch = settings().likelihood.estimate(&record).unwrap();
        let (_, window) = slide(settings(), &record);

        assert!(apart(&window, &batch) < 0.15, "{}", apart(&window, &batch));
    }
}

#[test]
fn survives_spikes() {
    let (mut clean_error, mut spiked_error, mut rejected, mut spikes) = (0.0, 0.0, 0_usize, 0_usize);
    for seed in 0..6 {
        let mut record = log(60.0, 700 + seed);
        let batch = settings().likelihood.estimate(&record).unwrap();
        let (_, clean) = slide(settings(), &record);
        let mut random = Random::new(900 + seed);
        for row in &mut record {
            if random.uniform(0.0, 1.0) < 0.01 {
                spikes += 1;
                row.world_from_body.as_mut().unwrap().translation.vector += random.direction() * 10e-3;
                row.world_from_body.as_mut().unwrap().rotation *=
                    <UnitQuaternion<f64> as LieGroup>::exp(&(random.direction() * 10e-3));
            }
        }
        let (steps, spiked) = slide(settings(), &record);
        rejected +=
            steps.iter().filter_map(|step| step.innovation).map(|innovation| innovation.rejected).sum::<usize>();
        clean_error += error_by_bound(&clean, &batch);
        spiked_error += error_by_bound(&spiked, &batch);
    }
    assert!(spiked_error.sqrt() < 1.1 * clean_error.sqrt(), "{spiked_error} {clean_error}");
    // Those of the first seconds were the bootstrap's to reject.
    assert!(rejected.abs_diff(spikes) < spikes / 5, "{rejected} of {spikes}");
}

/// A log that starts with the body at rest and no wrench.
fn late_start(rest_s: f64) -> Vec<MotionSample> {
    let moving = log(40.0, 3);
    let mut random = Random::new(4);
    let mut record: Vec<_> = (0..(rest_s / 0.016) as i64)
        .map(|k| {
            let mut row = moving[0];
            row.time_ns = 16_000_000 * k;
            row.world_from_body = Some(Pose::identity());
            row.world_from_body.as_mut().unwrap().translation.vector += random.normal3(CUBESAT.pose);
            row.world_from_body.as_mut().unwrap().rotation *=
                <UnitQuaternion<f64> as LieGroup>::exp(&random.normal3(CUBESAT.pose));
            row.wrench_body = Some(Wrench::new(random.normal3(CUBESAT.torque), random.normal3(CUBESAT.force)));
            row
        })
        .collect();
    let first = record.len() as i64 * 16_000_000 - moving[0].time_ns;
    record.extend(moving.into_iter().map(|row| MotionSample { time_ns: row.time_ns + first, ..row }));
    record
}

#[test]
fn a_start_at_rest_prolongs_the_bootstrap() {
    let record = late_start(10.0);
    let batch = settings().likelihood.estimate(&record).unwrap();
    let (steps, found) = slide(settings(), &record);
    assert!(steps[0].time_ns > 10_000_000_000 && !steps[0].regularised);
    assert!(apart(&found, &batch) < 0.15);
}

#[test]
fn a_longer_rest_is_bridged_by_a_prior_that_is_not_carried_over() {
    let record = late_start(10.0);
    let batch = settings().likelihood.estimate(&record).unwrap();
    let (steps, found) = slide(FixedLagSettings { longest_bootstrap_s: 5.0, ..settings() }, &record);
    let free = steps.iter().position(|step| !step.regularised).unwrap();
    assert!(steps[0].regularised && steps[0].time_ns < 6_000_000_000 && steps[free].time_ns > 10_000_000_000);
    assert!(steps[free..].iter().all(|step| !step.regularised));
    assert!(steps.iter().all(|step| is_consistent(&step.parameters)));
    assert!(apart(&found, &batch) < 0.5);
}

#[test]
fn a_log_that_says_nothing_is_not_excited() {
    let mut window = FixedLag::new(FixedLagSettings { longest_bootstrap_s: 5.0, ..settings() });
    for row in &late_start(10.0)[..600] {
        window.push(*row).unwrap();
    }
    assert!(matches!(window.finish(), Err(IdentificationError::Indefinite { .. })));
}

#[test]
fn rows_that_cannot_be_used_are_named_and_left_out() {
    let record = log(10.0, 1);
    let mut window = FixedLag::new(settings());
    for (k, row) in record.iter().enumerate() {
        window.push(*row).unwrap();
        if k % 100 == 10 {
            let broken = MotionSample { rate_body: Some(Vector3::new(f64::NAN, 0.0, 0.0)), ..*row };
            assert_eq!(window.push(broken), Err(IdentificationError::NotFinite { row: k + 1 }));
            assert_eq!(window.push(*row), Err(IdentificationError::TimesNotIncreasing { index: k + 1 }));
        }
    }
    let (_, clean) = slide(settings(), &record);
    assert_eq!(window.finish().unwrap(), clean);
}

#[test]
fn a_long_record_is_identified_like_a_short_one() {
    let mut record = log(400.0, 11);
    record.retain(|row| !(360_000_000_000..361_000_000_000).contains(&row.time_ns));
    let whole = identify(&record, &Settings::default()).unwrap();
    let mut long = LongRecord::try_new(&record, &Settings::default()).unwrap().expect("noisy poses");
    for row in &record {
        long.push(*row).unwrap();
    }
    let long = long.finish().unwrap();
    assert_eq!((whole.method, long.method), ("maximum-likelihood", "maximum-likelihood"));
    let (batch, slid) = (whole.estimate.unwrap(), long.estimate.unwrap());
    let scale = batch.covariance.diagonal().map(f64::sqrt);
    let apart = (batch.parameters.to_vector() - slid.parameters.to_vector()).component_div(&scale).amax();
    let sigmas = slid.covariance.diagonal().map(f64::sqrt).component_div(&scale);
    assert!(apart < 0.3, "{apart}");
    assert!(sigmas.iter().all(|ratio| (0.8..1.25).contains(ratio)), "{sigmas}");
    let slides = Warning::SlidingWindow { batch: 20_000, rows: record.len() };
    assert!(long.warnings.contains(&slides), "{:?}", long.warnings);
    assert!(long.warnings.iter().any(|warning| matches!(warning, Warning::Gaps { count: 1, .. })));
    assert_eq!(long.samples_used + long.samples_rejected, record.len());
    assert!((long.explained.unwrap() - whole.explained.unwrap()).abs() < 0.01);
}

#[test]
fn constant_nuisances_slide_along() {
    let nuisances = vec![Nuisance::ForceScale(1), Nuisance::ForceScale(2), Nuisance::BiasForce(0)];
    let truth = [1.08, 0.95, 0.02];
    let (mut squares, runs) = (0.0, 4);
    for seed in 0..runs {
        let mut record = log(60.0, 30 + seed);
        for row in &mut record {
            if let Some(wrench) = &mut row.wrench_body {
                wrench.force.x -= truth[2];
                wrench.force.y /= truth[0];
                wrench.force.z /= truth[1];
            }
        }
        let mut settings = settings();
        settings.likelihood.nuisances.clone_from(&nuisances);
        let batch = settings.likelihood.estimate(&record).unwrap();
        let (_, slid) = slide(settings, &record);
        for ((found, batch), truth) in slid.nuisances.iter().zip(&batch.nuisances).zip(truth) {
            let (value, std) = found.value.zip(found.std).unwrap();
            assert_eq!(found.verdict, Verdict::Identifiable);
            assert!((value - batch.value.unwrap()).abs() < std, "{:?}: {value} {:?}", found.nuisance, batch.value);
            assert!((0.8..1.25).contains(&(std / batch.std.unwrap())), "{:?}", found.nuisance);
            squares += ((value - truth) / std).powi(2);
        }
        assert!(nees(&slid, &cubesat()) < 35.0);
    }
    // 99.9 % of a chi-square of twelve, both ends.
    assert!((1.9..34.6).contains(&squares), "{squares}");
}

#[test]
fn what_moves_the_wrench_in_time_needs_the_whole_record() {
    let record = log(10.0, 1);
    for late in [Nuisance::Delay, Nuisance::ActuatorLag] {
        let mut settings = settings();
        settings.likelihood.nuisances = vec![Nuisance::ForceScale(1), late];
        let refused = FixedLag::new(settings).push(record[0]);
        assert_eq!(refused.unwrap_err(), IdentificationError::NeedsWholeRecord);
    }
    let settings = Settings { estimate: Nuisances::of(&[Nuisance::Delay]), ..Settings::default() };
    assert!(LongRecord::try_new(&record, &settings).unwrap().is_none());
}

#[test]
fn stretches_are_calibrated_together() {
    let delay = Nuisances::of(&[Nuisance::ForceScale(1)]);
    let settings = Settings { method: "maximum-likelihood", estimate: delay, ..Settings::default() };
    let record = log(60.0, 5);
    let whole = identify(&record, &settings).unwrap();
    let mut parts: Vec<_> =
        record.chunks(record.len() / 2 + 1).map(|part| identify(part, &settings).unwrap()).collect();
    let merged = merge(&parts, None).unwrap();
    let (one, all) = (&merged.calibration[0], &whole.calibration[0]);
    let (ratio, apart) = (one.std.unwrap() / all.std.unwrap(), one.value.unwrap() - all.value.unwrap());
    assert!((0.9..1.4).contains(&ratio) && apart.abs() < one.std.unwrap(), "{ratio} {apart}");
    assert!(merged.warnings.contains(&Warning::CalibratedInStretches { stretches: 2 }), "{:?}", merged.warnings);

    // A stretch that says nothing is no reason for silence.
    let mut rest = log(5.0, 6);
    for row in &mut rest {
        row.wrench_body = Some(Wrench::zero());
    }
    parts.push(identify(&rest, &settings).unwrap());
    let merged = merge(&parts, None).unwrap();
    assert!((merged.calibration[0].value.unwrap() - one.value.unwrap()).abs() < 1e-12);
    assert!(merged.warnings.contains(&Warning::NotCalibrated { rows: rest.len() }), "{:?}", merged.warnings);
}

#[test]
fn a_long_record_asked_of_a_regression_is_left_to_it() {
    let settings = Settings { method: "variational4", ..Settings::default() };
    assert!(LongRecord::try_new(&log(10.0, 1), &settings).unwrap().is_none());
}
