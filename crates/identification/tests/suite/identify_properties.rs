//! `identify` as a user meets it: fresh bodies, clocks, frames and noise; what it says when it cannot know.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

use crate::exact_motion::{Multisine, Run, errors, is_consistent};
use crate::random::Random;
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::dynamics::strategies::body_d;
use tumble_identification::estimator::{Evidence, Verdict, Why};
use tumble_identification::lie::{LieGroup, Pose, Wrench};
use tumble_identification::nalgebra::{Matrix3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3};
use tumble_identification::{
    BodyScale, Column, Estimate, FlightLikelihood, Identification, IdentificationError, MotionSample, Pipeline, Plane,
    Prediction, Prior, Settings, Warning, WrenchTiming, identify, merge, predict, validate,
};

/// Mass 0.05 to 500 kg, centre of mass to 0.5 m, ratio of principal inertias to 50, any axes.
fn fresh_body(random: &mut Random) -> InertialParameters<f64> {
    let mass = random.magnitude(0.05, 500.0);
    let length = random.magnitude(0.1, 1.0) * mass.powf(1.0 / 3.0) / 2.0;
    // Second moments of mass with a spread of fifty bound the ratio of inertias by fifty too.
    let moments = Vector3::from_fn(|_, _| random.magnitude(1.0 / 50.0, 1.0)) * (mass * length * length);
    let inertia = Matrix3::from_diagonal(&(Vector3::repeat(moments.sum()) - moments));
    let axes = random.attitude().to_rotation_matrix().into_inner();
    let center = random.direction() * random.uniform(0.0, 0.5);
    InertialParameters::about_com(mass, center, axes * inertia * axes.transpose())
}

struct Scenario {
    body: InertialParameters<f64>,
    record: Vec<MotionSample>,
    settings: Settings,
    step_s: f64,
}

/// A tumbling body somewhere within 100 m of the origin on a clock that counts from 1970.
fn scenario(seed: u64) -> Scenario {
    let mut random = Random::new(seed);
    let body = fresh_body(&mut random);
    let rate_hz = random.magnitude(5.0, 1000.0);
    let step_ns = (1e9 / rate_hz).round() as i64;
    let step_s = step_ns as f64 * 1e-9;
    let held = seed.is_multiple_of(2);
    // Accelerations of a third of a metre and of a radian per second squared, torque about the centre of mass.
    let smallest = body.inertia_about_com().symmetric_eigenvalues().min();
    let force = 0.3 * body.mass;
    let torque = 0.6 * smallest;
    let signal = Multisine::random(&mut random, torque, force, (0.5, 3.0), 4);
    let center = body.center_of_mass();
    let wrench = move |t: f64| {
        let w = signal.at(t);
        Wrench::new(w.torque + center.cross(&w.force), w.force)
    };
    let mut run = Run::new(body, &wrench, held);
    run.step_ns = step_ns;
    run.samples = ((20.0 / step_s) as usize).clamp(200, 4000);
    run.substep_s = 5e-3;
    run.start_ns = 1_700_000_000_123_456_789;
    run.start = Pose::from_parts(Translation3::from(random.direction() * 100.0), random.attitude());
    run.velocity_world = random.normal3(0.3);
    run.rate_body = random.normal3(0.2);
    if seed.is_multiple_of(3) {
        run.gravity_world = random.direction() * 1.6;
    }
    let settings = Settings { wrench_timing: timing(held), gravity_world: run.gravity_world, ..Settings::default() };
    Scenario { body, record: run.record(), settings, step_s }
}

fn poses_only(record: &mut [MotionSample]) {
    for sample in record {
        (sample.velocity_origin_world, sample.rate_body, sample.acceleration_origin_body) = (None, None, None);
    }
}

fn check_consistent(found: &Identification) {
    for estimate in [found.estimate, found.regularised].into_iter().flatten() {
        assert!(is_consistent(&estimate.parameters), "{:?}", estimate.parameters);
        assert!(estimate.covariance.symmetric_eigenvalues().min() >= -1e-12 * estimate.covariance.amax());
    }
}

fn noisy_wrench(record: &mut [MotionSample], random: &mut Random, torque: f64, force: f64) {
    for sample in record {
        sample.wrench_body =
            sample.wrench_body.map(|w| Wrench::new(w.torque + random.normal3(torque), w.force + random.normal3(force)));
    }
}

/// Normalised error squared: ten on average where the covariance is honest.
fn nees(estimate: &Estimate, truth: &InertialParameters<f64>) -> f64 {
    let error = estimate.parameters.to_vector() - truth.to_vector();
    let size = BodyScale::of(&truth.to_vector()).unwrap().parameter_magnitudes();
    let scaled = SMatrix::<f64, 10, 10>::from_fn(|i, j| estimate.covariance[(i, j)] / (size[i] * size[j]));
    let error = error.component_div(&size);
    (error.transpose() * scaled.try_inverse().unwrap() * error).x
}

/// Without noise only discretisation is left, of fourth order in the step.
#[test]
fn fresh_bodies_are_recovered() {
    for seed in 0..60 {
        let Scenario { body, mut record, settings, step_s } = scenario(seed);
        poses_only(&mut record);
        let found = identify(&record, &settings).unwrap();
        check_consistent(&found);
        assert_eq!(found.rank, 10, "seed {seed}: {:?}", found.null_directions);
        let estimate = found.estimate.unwrap();
        let [mass, center, inertia] = errors(&estimate.parameters, &body);
        let fourth = step_s.powi(4);
        println!("{seed}: {:.0} Hz, {:.2} kg: {mass:.1e} {center:.1e} m {inertia:.1e}", 1.0 / step_s, body.mass);
        assert!(mass < 1e-9 + 2.0 * fourth, "seed {seed}: mass {mass:e} at step {step_s}");
        assert!(center < 1e-9 + 0.5 * fourth, "seed {seed}: centre of mass {center:e} m at step {step_s}");
        assert!(inertia < 1e-8 + 100.0 * fourth, "seed {seed}: inertia {inertia:e} at step {step_s}");
    }
}

/// Forty draws: the mean of the normalised error squared lies within 10 +- 3 sqrt(20 / 40), its three-sigma band.
#[test]
fn covariance_is_honest_under_wrench_noise() {
    for held in [false, true] {
        for method in ["variational", "variational4", "variational6", "newton-euler"] {
            let (mut sum, mut inside) = (0.0, 0);
            for seed in 0..40 {
                let mut random = Random::new(1000 + seed);
                let signal = Multisine::random(&mut random, 0.5, 1.2, (0.5, 1.2), 2);
                let wrench = |t: f64| signal.at(t);
                let mut run = Run::new(body_d(), &wrench, held);
                (run.samples, run.substep_s) = (601, 1e-2);
                let mut record = run.record();
                noisy_wrench(&mut record, &mut random, 4.5e-3, 4.5e-3);
                let found = identify(&record, &Settings { method, wrench_timing: timing(held), ..Settings::default() })
                    .unwrap();
                check_consistent(&found);
                let estimate = found.estimate.unwrap();
                sum += nees(&estimate, &body_d());
                let error = estimate.parameters.to_vector() - body_d().to_vector();
                inside += (0..10).filter(|&i| error[i].abs() < 1.96 * estimate.covariance[(i, i)].sqrt()).count();
                if method != "newton-euler" {
                    assert!((found.noise.force_n / 4.5e-3 - 1.0).abs() < 0.1, "{:?}", found.noise);
                }
            }
            let (mean, coverage) = (sum / 40.0, inside as f64 / 400.0);
            println!("held {held} {method:?}: NEES {mean:.2}, coverage of 95 % intervals {coverage:.3}");
            assert!((7.9..12.1).contains(&mean), "held {held} {method:?}: NEES {mean}");
            assert!(coverage > 0.91, "held {held} {method:?}: coverage {coverage}");
        }
    }
}

/// Eighty bodies: the three-sigma band of the mean is 10 +- 1.5. Discretisation at low rates is part of the covariance
/// and makes it cautious, so the lower side is left open by as much again.
#[test]
fn covariance_is_honest_on_fresh_bodies() {
    let (mut sum, mut count) = (0.0, 0.0);
    for seed in 100..180 {
        let Scenario { body, mut record, settings, .. } = scenario(seed);
        poses_only(&mut record);
        let smallest = body.inertia_about_com().symmetric_eigenvalues().min();
        let (torque, force) = (0.006 * smallest, 0.003 * body.mass);
        noisy_wrench(&mut record, &mut Random::new(seed), torque, force);
        let found = identify(&record, &settings).unwrap();
        check_consistent(&found);
        let Some(estimate) = found.estimate else { continue };
        if !estimate.lmi_active {
            sum += nees(&estimate, &body);
            count += 1.0;
        }
    }
    println!("fresh bodies: NEES {} over {count}", sum / count);
    assert!(count > 60.0 && (7.0..11.5).contains(&(sum / count)), "NEES {} over {count}", sum / count);
}

fn cubesat_record(seed: u64, samples: usize) -> (InertialParameters<f64>, Vec<MotionSample>) {
    let body = InertialParameters::about_com(
        9.41,
        Vector3::new(0.031, -0.017, 0.052),
        Matrix3::new(0.153, 0.004, -0.006, 0.004, 0.143, 0.003, -0.006, 0.003, 0.162),
    );
    let mut random = Random::new(seed);
    let signal = Multisine::random(&mut random, 0.028, 0.28, (0.3, 2.8), 8);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(body, &wrench, true);
    (run.step_ns, run.samples, run.substep_s) = (16_000_000, samples, 0.016);
    let mut record = run.record();
    for s in &mut record {
        s.world_from_body.as_mut().unwrap().translation.vector += random.normal3(1e-3);
        s.world_from_body.as_mut().unwrap().rotation *= <UnitQuaternion<f64> as LieGroup>::exp(&random.normal3(1e-3));
        s.rate_body = s.rate_body.map(|w| w + random.normal3(1e-3));
        s.velocity_origin_world = s.velocity_origin_world.map(|v| v + random.normal3(1e-3));
    }
    noisy_wrench(&mut record, &mut random, 1e-4, 1e-3);
    (body, record)
}

/// Poses of a millimetre and a milliradian at 62.5 Hz: plain pose-only regression gives a mass near zero. It must not be
/// believed; a longer lag with instruments does better, and the likelihood, which is the default there, does well.
#[test]
fn noisy_poses_are_noticed_and_answered() {
    let (body, record) = cubesat_record(50, 3000);
    let mut poses = record.clone();
    poses_only(&mut poses);
    let plain = identify(&poses, &Settings { lag: Some(1), method: "variational", ..Settings::default() }).unwrap();
    assert!(plain.estimate.is_none() && plain.rank < 10, "{:?}", plain.estimate);
    let noisy = |found: &Identification| found.warnings.iter().any(|w| matches!(w, Warning::NoisyPoses { .. }));
    assert!(noisy(&plain), "{:?}", plain.warnings);

    let found = identify(&poses, &Settings { method: "variational4", ..Settings::default() }).unwrap();
    check_consistent(&found);
    assert!(found.lag > 8 && noisy(&found), "{:?}", found.warnings);
    assert!((found.noise.position_m / 1e-3 - 1.0).abs() < 0.1 && (found.noise.attitude_rad / 1e-3 - 1.0).abs() < 0.1);
    let estimate = found.estimate.unwrap();
    println!("lag {}: {:?} NEES {}", found.lag, errors(&estimate.parameters, &body), nees(&estimate, &body));
    assert!(errors(&estimate.parameters, &body)[0] < 0.05 && nees(&estimate, &body) < 60.0);

    for (name, record) in [("poses", &poses), ("all columns", &record)] {
        let found = identify(record, &Settings::default()).unwrap();
        assert_eq!(found.method, "maximum-likelihood");
        check_consistent(&found);
        let estimate = found.estimate.unwrap();
        let [mass, center, inertia] = errors(&estimate.parameters, &body);
        println!("{name}: {mass:.1e} {center:.1e} {inertia:.1e} NEES {}", nees(&estimate, &body));
        assert!(mass < 2e-3 && center < 2e-4 && inertia < 2e-3);
        // 99.9 % of a chi-square of ten.
        assert!(nees(&estimate, &body) < 29.6 && !noisy(&found));
        assert!((found.noise.position_m / 1e-3 - 1.0).abs() < 0.05);
        assert!((found.noise.attitude_rad / 1e-3 - 1.0).abs() < 0.05);
        assert!(found.explained.is_some_and(|share| share > 0.99), "{:?}", found.explained);
        assert_eq!(found.samples_used + found.samples_rejected, record.len());

        let (fitted, held_out) = record.split_at(record.len() / 2);
        let found = identify(fitted, &Settings::default()).unwrap();
        println!(
            "{:?} {:?} {} NEES {}",
            found.noise,
            errors(&found.estimate.unwrap().parameters, &body),
            found.lag,
            nees(&found.estimate.unwrap(), &body)
        );
        let validation = validate(&found, held_out, &Settings::default()).unwrap();
        println!("{validation:?}");
        assert!(validation.normalised_rms < 1.7 && validation.wrench.unwrap().explained > 0.99, "{validation:?}");
        let mut wrong = found.clone();
        if let Some(estimate) = &mut wrong.estimate {
            estimate.parameters.mass *= 1.05;
        }
        assert!(validate(&wrong, held_out, &Settings::default()).unwrap().normalised_rms > 3.0);
    }
}

fn record_d(held: bool) -> Vec<MotionSample> {
    let signal = Multisine::random(&mut Random::new(3), 0.5, 1.2, (0.5, 1.2), 2);
    let wrench = |t: f64| signal.at(t);
    Run::new(body_d(), &wrench, held).record()
}

fn timing(held: bool) -> WrenchTiming {
    if held { WrenchTiming::Held } else { WrenchTiming::Sampled }
}

#[test]
fn malformed_records_are_refused_with_numbers() {
    let record = record_d(true);
    let settings = Settings::default();
    assert_eq!(identify(&[], &settings), Err(IdentificationError::TooFewSamples { samples: 0, needed: 3 }));
    let mut repeated = record.clone();
    repeated[7].time_ns = repeated[6].time_ns;
    assert_eq!(identify(&repeated, &settings), Err(IdentificationError::TimesNotIncreasing { index: 7 }));
    let mut without = record.clone();
    for sample in &mut without {
        sample.wrench_body = None;
    }
    assert_eq!(identify(&without, &settings), Err(IdentificationError::MissingColumn(Column::Wrench)));
    let mut without = record.clone();
    poses_only(&mut without);
    let newton_euler = Settings { method: "newton-euler", ..settings };
    assert_eq!(identify(&without, &newton_euler), Err(IdentificationError::MissingColumn(Column::Rate)));
    let mut poisoned = record.clone();
    poisoned[9].wrench_body = Some(Wrench::new(Vector3::repeat(f64::NAN), Vector3::zeros()));
    assert!(matches!(identify(&poisoned, &settings), Err(IdentificationError::NotFinite { .. })));
    let mut poisoned = record;
    poisoned[9].world_from_body.as_mut().unwrap().translation.vector.x = f64::INFINITY;
    assert!(matches!(identify(&poisoned, &settings), Err(IdentificationError::NotFinite { .. })));
}

#[test]
fn what_the_data_do_not_say_is_not_invented() {
    // Three samples: fewer rows than parameters.
    let record = record_d(true);
    let found = identify(&record[..3], &Settings::default()).unwrap();
    assert!(found.rank < 10 && found.estimate.is_none() && found.regularised.is_some());
    assert!(found.warnings.iter().any(|w| matches!(w, Warning::FewRows { .. })));
    check_consistent(&found);

    // No motion and no wrench.
    let mut still = record.clone();
    for sample in &mut still {
        sample.world_from_body = Some(Pose::identity());
        sample.wrench_body = Some(Wrench::zero());
    }
    let found = identify(&still, &Settings::default()).unwrap();
    assert!(
        found.rank == 0 && found.estimate.is_none() && found.warnings.contains(&Warning::ZeroWrench),
        "{}",
        found.rank
    );
    check_consistent(&found);

    // Free tumbling: the scales of mass and inertia stay open.
    let nothing = |_: f64| Wrench::zero();
    let mut run = Run::new(body_d(), &nothing, true);
    run.rate_body = Vector3::new(0.6, -0.9, 0.7);
    let found = identify(&run.record(), &Settings::default()).unwrap();
    assert!(
        found.rank == 8 && found.estimate.is_none() && found.warnings.contains(&Warning::ZeroWrench),
        "{}",
        found.rank
    );
    println!("free tumbling: {:?}", found.null_directions);
    assert!(
        found.null_directions.iter().any(|words| words.to_string().contains("common factor")),
        "{:?}",
        found.null_directions
    );
    check_consistent(&found);

    // Planar motion about z shows J33, J13, J23, the mass and the first moment, and nothing of the other inertias.
    let signal = Multisine::random(&mut Random::new(8), 0.5, 1.2, (0.5, 1.2), 2);
    let disc = InertialParameters::about_com(
        5.0,
        Vector3::new(0.1, 0.05, 0.0),
        Matrix3::from_diagonal(&Vector3::new(1.0, 1.5, 2.0)),
    );
    let planar = |t: f64| {
        let w = signal.at(t);
        Wrench::new(Vector3::new(0.0, 0.0, w.torque.z), Vector3::new(w.force.x, w.force.y, 0.0))
    };
    let record = Run::new(disc, &planar, true).record();
    // On a table: four numbers are all there is to know, and they are known.
    let held = identify(&record, &Settings::default()).unwrap();
    assert!(held.is_on_table() && held.verdict.is_identified() && held.estimate.is_none());
    assert_eq!(held.determined(), [true, true, true, false, false, false, true, false, false, false]);
    let known = held.regularised.unwrap().parameters;
    assert!((known.mass - 5.0).abs() < 0.01, "{}", known.mass);
    assert!((known.inertia_about_com()[(2, 2)] - 2.0).abs() < 0.01, "{}", known.inertia_about_com());
    // Of a free body the same motion shows more.
    let free = Pipeline::new().flown_with(FlightLikelihood { plane: Plane::Free, ..FlightLikelihood::default() });
    let found = free.identify(&record, &Settings::default()).unwrap();
    println!("planar: rank {} {:?}", found.rank, found.null_directions);
    assert!(found.rank < 10 && found.estimate.is_none() && found.null_directions.len() == 10 - found.rank);
    assert!(found.condition_number.is_infinite());
    // Each free direction comes with the motion that would show it, and it turns about another axis than z.
    let remedies: Vec<String> = found
        .warnings
        .iter()
        .filter_map(|w| match w {
            Warning::WeakExcitation { direction, std } if std.is_infinite() => Some(direction.remedy.to_string()),
            _ => None,
        })
        .collect();
    assert_eq!(remedies.len(), 10 - found.rank);
    assert!(remedies.iter().all(|words| words.contains("body x") || words.contains("body y")), "{remedies:?}");
    let regularised = found.regularised.unwrap();
    assert!((regularised.parameters.mass - 5.0).abs() < 0.05, "{}", regularised.parameters.mass);
    check_consistent(&found);
    // What no half of the record shows is said once of the whole.
    let halves = record.chunks(record.len().div_ceil(2));
    let halves: Vec<_> = halves.map(|half| free.identify(half, &Settings::default()).unwrap()).collect();
    let whole = merge(&halves, None).unwrap();
    let unseen =
        |found: &Identification| found.warnings.iter().filter(|w| matches!(w, Warning::WeakExcitation { .. })).count();
    assert!(halves.iter().all(|half| unseen(half) > 0) && whole.rank < 10);
    assert_eq!(unseen(&whole), 10 - whole.rank);
    // Halves of a body on a table are one of a body on a table.
    let halves = record.chunks(record.len().div_ceil(2));
    let halves: Vec<_> = halves.map(|half| identify(half, &Settings::default()).unwrap()).collect();
    let whole = merge(&halves, None).unwrap();
    assert!(halves.iter().chain([&whole]).all(Identification::is_on_table));
    assert_eq!(halves.iter().map(|half| half.verdict.is_identified()).collect::<Vec<_>>(), [true; 2]);
    assert_eq!(whole.verdict, Verdict::Identified);

    // The same with a prior asked for.
    let prior = Prior { mean: disc, standard_deviation: disc.to_vector().map(|x| 0.1 * x.abs() + 0.01) };
    let found =
        identify(&Run::new(disc, &planar, true).record(), &Settings { prior: Some(prior), ..Settings::default() })
            .unwrap();
    assert!(found.rank < 10 && errors(&found.estimate.unwrap().parameters, &disc)[2] < 0.02);
}

#[test]
fn gaps_and_unequal_steps_are_counted() {
    let whole = record_d(true);
    let mut gapped = whole.clone();
    gapped.drain(60..80);
    let found = identify(&gapped, &Settings::default()).unwrap();
    assert!(found.warnings.iter().any(|w| matches!(w, Warning::Gaps { count: 1, .. })), "{:?}", found.warnings);
    assert!(errors(&found.estimate.unwrap().parameters, &body_d())[0] < 1e-4);

    // Every third sample two milliseconds late: no window of five has equal steps.
    let jitter: Vec<_> = whole
        .iter()
        .enumerate()
        .map(|(k, s)| MotionSample { time_ns: s.time_ns + if k % 3 == 0 { 2_000_000 } else { 0 }, ..*s })
        .collect();
    // Rates and velocities do not ask for equal steps; poses alone do.
    let found = identify(&jitter, &Settings::default()).unwrap();
    assert_eq!(found.method, "newton-euler");
    let (mut jitter, mut half) = (jitter, whole);
    poses_only(&mut jitter);
    poses_only(&mut half);
    let regression = Settings { method: "variational4", ..Settings::default() };
    assert!(matches!(identify(&jitter, &regression), Err(IdentificationError::TooFewSamples { .. })));
    half[..150].copy_from_slice(&jitter[..150]);
    for record in [&jitter, &half] {
        let found = identify(record, &Settings::default()).unwrap();
        assert_eq!(found.method, "maximum-likelihood");
        assert!(errors(&found.estimate.unwrap().parameters, &body_d())[0] < 1e-2);
    }
    let found = identify(&half, &regression).unwrap();
    let warning = found.warnings.iter().find(|w| matches!(w, Warning::UnequalSteps { .. })).unwrap();
    assert!(warning.to_string().contains("maximum-likelihood"), "{warning}");
}

#[test]
fn prediction_and_validation_agree_with_what_happens() {
    for held in [true, false] {
        let settings = Settings { wrench_timing: timing(held), ..Settings::default() };
        let exact = record_d(held);
        let predicted = predict(&exact, &settings, (2e-3, 5e-3)).unwrap();
        assert_eq!((predicted.rank, predicted.rows), (10, 6 * (exact.len() - 4)));
        let mut noisy = exact.clone();
        noisy_wrench(&mut noisy, &mut Random::new(17), 2e-3, 5e-3);
        let (fitted, held_out) = noisy.split_at(140);
        let found = identify(&noisy, &settings).unwrap();
        let ratio = found.estimate.unwrap().std.mass_kg / predicted.std.unwrap().mass_kg;
        assert!((0.75..1.35).contains(&ratio), "held {held}: {ratio}");
        let found = identify(fitted, &settings).unwrap();
        let validation = validate(&found, held_out, &settings).unwrap();
        assert!(
            (0.7..1.4).contains(&validation.normalised_rms) && validation.wrench.unwrap().explained > 0.9,
            "{validation:?}"
        );
        // A wrong body is caught.
        let mut wrong = found.clone();
        if let Some(estimate) = &mut wrong.estimate {
            estimate.parameters.mass *= 1.2;
        }
        assert!(validate(&wrong, held_out, &settings).unwrap().normalised_rms > 3.0);
    }
    // A plan without wrenches can be judged too.
    let mut plan = record_d(true);
    for sample in &mut plan {
        sample.wrench_body = None;
    }
    let predicted = predict(&plan, &Settings::default(), (2e-3, 5e-3)).unwrap();
    assert!(predicted.rank == 10 && predicted.covariance.is_some() && predicted.std.is_none());
}

#[test]
fn noise_is_not_taken_for_motion() {
    let mut random = Random::new(23);
    let seen = |record: &[MotionSample]| predict(record, &Settings::default(), (2e-3, 5e-3)).unwrap();
    let mut shaken = |sample: &MotionSample| {
        let mut pose = sample.world_from_body.unwrap();
        pose.translation.vector += random.normal3(1e-3);
        pose.rotation *= UnitQuaternion::from_scaled_axis(random.normal3(1e-3));
        MotionSample { world_from_body: Some(pose), wrench_body: None, ..MotionSample::default() }
    };
    let at_rest: Vec<MotionSample> = (0..1500)
        .map(|k| {
            let pose = Pose::identity();
            MotionSample {
                time_ns: k * 20_000_000,
                ..shaken(&MotionSample { world_from_body: Some(pose), ..MotionSample::default() })
            }
        })
        .collect();
    let found = seen(&at_rest);
    assert_eq!((found.rank, found.covariance), (0, None), "{found:?}");
    assert!((found.noise.position_m / 1e-3 - 1.0).abs() < 0.1 && (found.noise.attitude_rad / 1e-3 - 1.0).abs() < 0.1);

    let signal = Multisine::random(&mut Random::new(8), 0.5, 1.2, (0.5, 1.2), 3);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(body_d(), &wrench, true);
    run.samples = 3000;
    let moved = run.record();
    let (exact, noisy): (Vec<_>, Vec<_>) = moved
        .iter()
        .map(|sample| {
            let motion = MotionSample {
                time_ns: sample.time_ns,
                world_from_body: sample.world_from_body,
                ..MotionSample::default()
            };
            (motion, MotionSample { time_ns: sample.time_ns, ..shaken(sample) })
        })
        .unzip();
    let (exact, noisy) = (seen(&exact), seen(&noisy));
    println!("lag {}, {}; share {:.1e}, {:.1e}", exact.lag, noisy.lag, exact.noise_share, noisy.noise_share);
    assert_eq!((exact.rank, exact.lag, noisy.rank), (10, 1, 10));
    assert!(noisy.lag > 4 && noisy.noise_share < 0.1);
    let mass = |found: &Prediction| found.covariance.unwrap()[(0, 0)].sqrt();
    assert!(mass(&noisy) > 1.5 * mass(&exact), "{} {}", mass(&noisy), mass(&exact));
}

#[test]
fn the_parts_of_a_long_record_add_up_to_the_whole() {
    let signal = Multisine::random(&mut Random::new(8), 0.5, 1.2, (0.5, 1.2), 3);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(body_d(), &wrench, true);
    run.samples = 3000;
    let mut record = run.record();
    noisy_wrench(&mut record, &mut Random::new(9), 1e-2, 1e-1);
    let settings = Settings::default();
    let whole = identify(&record, &settings).unwrap();
    // The last part has no wrench at all: it must not pull the parameters towards zero.
    let mut parts: Vec<Identification> = record.chunks(1000).map(|part| identify(part, &settings).unwrap()).collect();
    let mut silent = record[..1000].to_vec();
    for sample in &mut silent {
        sample.wrench_body = Some(Wrench::zero());
    }
    parts.push(identify(&silent, &settings).unwrap());
    let merged = merge(&parts, None).unwrap();
    check_consistent(&merged);
    assert_eq!(merged.rank, 10);
    assert_eq!(merged.samples_used, parts.iter().map(|p| p.samples_used).sum::<usize>());
    assert!(!merged.warnings.contains(&Warning::ZeroWrench));
    // What speaks against one part speaks against the whole.
    let doubted = |doubt: fn(&mut Evidence)| {
        let mut parts = parts.clone();
        doubt(&mut parts[1].evidence);
        merge(&parts, None).unwrap().verdict
    };
    assert_eq!(merged.verdict, Verdict::Identified);
    assert_eq!(doubted(|evidence| evidence.feedback = 0.4), Verdict::Doubtful(Why::Feedback { share: 0.4 }));
    assert_eq!(doubted(|evidence| evidence.halves = 9.0), Verdict::Doubtful(Why::Disagrees { chi_square: 9.0 }));
    let (whole, merged) = (whole.estimate.unwrap(), merged.estimate.unwrap());
    let (a, b) = (whole.parameters.to_vector(), merged.parameters.to_vector());
    for i in 0..10 {
        let (sigma, other) = (whole.covariance[(i, i)].sqrt(), merged.covariance[(i, i)].sqrt());
        // The parts weigh by their own noise estimates: alike, not equal.
        assert!((a[i] - b[i]).abs() < sigma, "{i}: {} {} sigma {sigma}", a[i], b[i]);
        assert!((other / sigma - 1.0).abs() < 0.3, "{i}: sigma {sigma} {other}");
    }
    assert!(matches!(merge(&[], None), Err(IdentificationError::TooFewSamples { .. })));
}

#[test]
fn torques_alone_tell_the_inertia_and_never_the_mass() {
    for (torque_noise, force_noise) in [(0.0, 0.0), (1e-4, 1e-3)] {
        let signal = Multisine::random(&mut Random::new(12), 0.5, 1.2, (0.5, 1.2), 3);
        let wrench = |t: f64| Wrench::new(signal.at(t).torque, Vector3::zeros());
        let mut record = Run::new(body_d(), &wrench, true).record();
        noisy_wrench(&mut record, &mut Random::new(13), torque_noise, force_noise);
        let found = identify(&record, &Settings::default()).unwrap();
        assert!(found.rank == 9 && found.estimate.is_none(), "{} {:?}", found.rank, found.estimate);
        assert!(found.warnings.contains(&Warning::SilentForce), "{:?}", found.warnings);
        check_consistent(&found);
        // With the mass told, the rest follows.
        let mut standard_deviation = SVector::from_element(f64::INFINITY);
        standard_deviation[0] = 0.05;
        let prior = Some(Prior { mean: body_d(), standard_deviation });
        let told = identify(&record, &Settings { prior, ..Settings::default() }).unwrap();
        let estimate = told.estimate.unwrap();
        let mass_error = (estimate.parameters.mass - body_d().mass).abs();
        assert!(mass_error < 0.05, "mass off by {mass_error}, told to 0.05");
        let inertia = (estimate.parameters.inertia_about_com() - body_d().inertia_about_com()).amax();
        assert!(inertia < 0.02 * body_d().inertia_about_com().amax(), "inertia off by {inertia}");
    }
}

#[test]
fn a_wrench_of_the_wrong_sign_is_a_poor_fit() {
    let mut record = record_d(true);
    for sample in &mut record {
        sample.wrench_body = sample.wrench_body.map(|w| -w);
    }
    let found = identify(&record, &Settings::default()).unwrap();
    check_consistent(&found);
    assert!(found.explained.is_some_and(|share| share < 0.1), "{:?}", found.explained);
    assert!(found.warnings.iter().any(|w| matches!(w, Warning::PoorFit { .. })), "{:?}", found.warnings);
}
