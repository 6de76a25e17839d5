//! From cycles of a periodic motion to the body: averaging, fit, selection, estimation, and what is said about bad records.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

use crate::periodic_log::{PeriodicLog, flown, noise, noisy};
use crate::random::Random;
use tumble_identification::dynamics::WrenchBox;
use tumble_identification::fourier::{AttitudeChart, FourierBasis, FourierMotion};
use tumble_identification::harmonics::{
    Cycles, FourierFit, HarmonicEstimator, HarmonicIdentification, HarmonicSettings, HarmonicWarning,
    PeriodicLeastSquares, PeriodicRecord, SelectionRule, average_cycles, identify_periodic, saturated_share,
    select_harmonics,
};
use tumble_identification::lie::{Pose, Wrench};
use tumble_identification::nalgebra::{DMatrix, SVector, Translation3, UnitQuaternion, Vector3};
use tumble_identification::statistics::{coverage_band, mean_square_band, normalized_squared_error};
use tumble_identification::{Column, IdentificationError, MotionSample, Noise, WrenchTiming};

fn log(seed: u64) -> PeriodicLog {
    let mut random = Random::new(seed);
    let motion = random.motion(10.0, 3);
    PeriodicLog::new(motion, random.load())
}

fn settings() -> HarmonicSettings {
    HarmonicSettings { wrench_timing: WrenchTiming::Sampled, ..HarmonicSettings::new(10.0, 3) }
}

fn least_squares() -> HarmonicSettings {
    HarmonicSettings { estimator: HarmonicEstimator::LeastSquares, ..settings() }
}

fn averaged(log: &PeriodicLog, seed: u64) -> Cycles {
    average_cycles(&log.samples(seed), &settings()).unwrap()
}

fn has(found: &HarmonicIdentification, matches: impl Fn(&HarmonicWarning) -> bool) -> bool {
    found.warnings.iter().any(matches)
}

/// Relative errors of mass, centre of mass (m) and inertia about the origin.
fn errors(found: &HarmonicIdentification, log: &PeriodicLog) -> [f64; 3] {
    let (found, truth) = (found.estimate.parameters, log.body);
    [
        (found.mass / truth.mass - 1.0).abs(),
        (found.center_of_mass() - truth.center_of_mass()).norm(),
        (found.inertia_about_origin - truth.inertia_about_origin).norm() / truth.inertia_about_origin.norm(),
    ]
}

/// A record of exact samples of a motion.
fn exact(motion: &FourierMotion, samples: usize) -> PeriodicRecord {
    let basis = motion.basis();
    let times_s: Vec<f64> = (0..samples).map(|i| basis.period_s() * i as f64 / samples as f64).collect();
    PeriodicRecord {
        period_s: basis.period_s(),
        chart: motion.chart(),
        channels: &basis.table(&times_s)[0] * motion.coefficients(),
        wrenches: DMatrix::zeros(samples, 6),
        gravity: Vector3::zeros(),
        wrench_offset_s: 0.0,
        channel_std: vec![0.1; motion.coefficients().ncols()],
        wrench_std: SVector::repeat(1.0),
    }
}

#[test]
fn band_limited_data_return_their_coefficients() {
    let mut random = Random::new(1);
    for (chart, harmonics) in
        [(AttitudeChart::EulerZyx, 3), (AttitudeChart::Quaternion, 7), (AttitudeChart::EulerZyx, 15)]
    {
        for samples in [37, 1000, 1024] {
            let basis = FourierBasis::try_new(10.0, harmonics).unwrap();
            let coefficients =
                DMatrix::from_fn(basis.coefficients(), 3 + chart.channels(), |_, _| random.uniform(-1.0, 1.0));
            let motion = FourierMotion::try_new(basis, chart, coefficients.clone()).unwrap();
            let record = exact(&motion, samples);
            for more in [0, 2] {
                let fit = FourierFit::new(&record, harmonics + more).unwrap();
                let found = fit.motion.coefficients();
                let block = |first: usize, count: usize| found.rows(first, count).into_owned();
                let error = (block(0, harmonics + 1) - coefficients.rows(0, harmonics + 1))
                    .amax()
                    .max((block(harmonics + more + 1, harmonics) - coefficients.rows(harmonics + 1, harmonics)).amax());
                let beyond = block(harmonics + 1, more).amax().max(block(2 * harmonics + more + 1, more).amax());
                assert!(
                    error < 1e-14 && beyond < 1e-13,
                    "{chart:?} {harmonics} {samples} {more}: {error:e} {beyond:e}"
                );
            }
        }
    }
}

#[test]
fn a_series_needs_more_than_two_samples_per_harmonic() {
    let record = exact(&log(2).motion, 8);
    assert!(FourierFit::new(&record, 3).is_ok());
    let refused = Err(IdentificationError::TooManyHarmonics { harmonics: 4, samples: 8 });
    assert_eq!(FourierFit::new(&record, 4).map(|_| ()), refused);
    assert_eq!(FourierFit::new(&record, 0).map(|_| ()), Err(IdentificationError::NoHarmonics));
}

/// The scatter of fitted coefficients is the stated one: 40 fits, every coefficient.
#[test]
fn coefficients_have_the_stated_variance() {
    let motion = log(3).motion;
    let (mut random, record) = (Random::new(4), exact(&motion, 64));
    let (mut sum, runs) = (0.0, 40);
    for _ in 0..runs {
        let mut noisy = record.clone();
        noisy.channels.apply(|value| *value += 0.1 * random.normal());
        let fit = FourierFit::new(&noisy, 3).unwrap();
        sum += (fit.motion.coefficients() - motion.coefficients()).component_div(&fit.coefficient_std).norm_squared();
    }
    let band = mean_square_band(42.0, runs, 0.999);
    assert!(band.contains(sum / runs as f64), "{} not in {band}", sum / runs as f64);
}

#[test]
fn exact_records_give_the_body_back() {
    for (timing, chart, estimator) in [
        (WrenchTiming::Sampled, AttitudeChart::EulerZyx, HarmonicEstimator::LeastSquares),
        (WrenchTiming::Held, AttitudeChart::EulerZyx, HarmonicEstimator::LeastSquares),
        (WrenchTiming::Held, AttitudeChart::EulerZyx, HarmonicEstimator::Likelihood),
    ] {
        let log = PeriodicLog {
            cycles: 3,
            samples_per_cycle: 200,
            noise: Noise::default(),
            timing,
            world_from_start: Pose::from_parts(
                Translation3::new(3.0, -2.0, 7.0),
                UnitQuaternion::new(Vector3::new(0.7, -1.4, 2.0)),
            ),
            gravity_world: Vector3::new(0.2, -0.4, -9.81),
            ..log(5)
        };
        let settings = HarmonicSettings {
            wrench_timing: timing,
            chart,
            estimator,
            world_from_start: log.world_from_start,
            gravity_world: log.gravity_world,
            ..settings()
        };
        let found = identify_periodic(&log.samples(0), &settings).unwrap();
        let errors = errors(&found, &log);
        assert!(errors.iter().all(|error| *error < 1e-9), "{timing:?} {estimator:?} {errors:?}");
        assert_eq!((found.harmonics(), found.cycles_dropped, found.estimator), (3, 0, estimator));
        assert!(found.explained > 1.0 - 1e-12);
        assert_eq!(found.warnings, []);
    }
}

/// A quaternion motion is a series in the quaternion's chart, of any length.
#[test]
fn quaternions_serve_as_coordinates() {
    let mut random = Random::new(6);
    let basis = FourierBasis::try_new(10.0, 2).unwrap();
    let mut coefficients = DMatrix::from_fn(5, 7, |_, _| 0.1 * random.normal());
    coefficients[(0, 6)] = 1.0;
    let log = PeriodicLog {
        motion: FourierMotion::try_new(basis, AttitudeChart::Quaternion, coefficients).unwrap(),
        noise: Noise { position_m: 1e-3, attitude_rad: 1e-3, ..noise() },
        ..log(6)
    };
    let settings = HarmonicSettings { chart: AttitudeChart::Quaternion, ..settings() };
    let found = identify_periodic(&log.samples(0), &settings).unwrap();
    let errors = errors(&found, &log);
    assert!(errors[0] < 1e-3 && errors[1] < 1e-3 && errors[2] < 0.02, "{errors:?} {} harmonics", found.harmonics());
}

/// One hundred seeds: the normalised squared error has the mean ten within the band of one false alarm in a thousand. Counting the noise of
/// the wrench alone, as the print does, the mean would be thousands of times larger.
#[test]
fn covariance_is_honest_about_noise_in_the_motion() {
    let log = PeriodicLog { samples_per_cycle: 200, ..log(7) };
    let truth = log.body.to_vector();
    let (mut honest, mut of_wrench, runs) = (0.0, 0.0, 100);
    for seed in 0..runs {
        let mut record = averaged(&log, seed).record;
        let found = PeriodicLeastSquares::fit(&record, &FourierFit::new(&record, 3).unwrap()).unwrap();
        honest += normalized_squared_error(&(found.parameters - truth), &found.covariance).unwrap();
        record.channel_std.fill(0.0);
        let found = PeriodicLeastSquares::fit(&record, &FourierFit::new(&record, 3).unwrap()).unwrap();
        of_wrench += normalized_squared_error(&(found.parameters - truth), &found.covariance).unwrap();
    }
    let (honest, of_wrench) = (honest / runs as f64, of_wrench / runs as f64);
    let band = mean_square_band(10.0, runs as usize, 0.999);
    println!("NEES {honest:.2} in {band}; of the wrench alone {of_wrench:.0}");
    assert!(band.contains(honest), "{honest} not in {band}");
    assert!(of_wrench > 100.0, "{of_wrench}");
}

/// The likelihood's own covariance through the whole chain, the number of harmonics chosen.
#[test]
fn the_likelihood_is_honest_and_far_better() {
    let log = PeriodicLog { samples_per_cycle: 200, ..log(8) };
    let truth = log.body.to_vector();
    let (mut squares, mut ratio, runs) = (0.0, 0.0, 25);
    for seed in 0..runs {
        let samples = log.samples(seed);
        let likely = identify_periodic(&samples, &settings()).unwrap();
        let plain = identify_periodic(&samples, &least_squares()).unwrap();
        assert_eq!(likely.estimator, HarmonicEstimator::Likelihood);
        let error = likely.estimate.parameters.to_vector() - truth;
        squares += normalized_squared_error(&error, &likely.estimate.covariance).unwrap();
        ratio += errors(&plain, &log)[2] / errors(&likely, &log)[2] / runs as f64;
    }
    let (mean, band) = (squares / runs as f64, mean_square_band(10.0, runs as usize, 0.999));
    assert!(band.contains(mean), "{mean} not in {band}");
    assert!(ratio > 3.0, "{ratio}");
}

#[test]
fn noise_is_found_between_cycles() {
    for cycles in [2, 10] {
        let found = averaged(&PeriodicLog { cycles, ..log(9) }, 3);
        let (expected, tolerance) = (noise(), 5.0 / (2.0 * 1000.0 * 3.0 * (cycles - 1) as f64).sqrt());
        for (found, expected) in [
            (found.noise.position_m, expected.position_m),
            (found.noise.attitude_rad, expected.attitude_rad),
            (found.noise.torque_n_m, expected.torque_n_m),
            (found.noise.force_n, expected.force_n),
        ] {
            assert!((found / expected - 1.0).abs() < tolerance, "{cycles}: {found} {expected}");
        }
        assert!((found.record.wrench_std[5] * (cycles as f64).sqrt() / 0.01 - 1.0).abs() < 0.1);
    }
    let known = Noise { position_m: 0.1, attitude_rad: 0.2, torque_n_m: 0.3, force_n: 0.4, ..Noise::default() };
    let settings = HarmonicSettings { noise: Some(known), dropped_cycles: Some(6), ..settings() };
    let record = average_cycles(&log(9).samples(0), &settings).unwrap().record;
    assert_eq!(record.channel_std, [0.05, 0.05, 0.05, 0.1, 0.1, 0.1]);
    assert_eq!(record.wrench_std, SVector::from([0.15, 0.15, 0.15, 0.2, 0.2, 0.2]));
}

/// Adds a push that dies out: poses and wrench start elsewhere.
fn with_transient(samples: &mut [MotionSample], size_m: f64, time_constant_s: f64) {
    for sample in samples {
        let left = (-(sample.time_ns as f64) * 1e-9 / time_constant_s).exp();
        sample.world_from_body.as_mut().unwrap().translation.vector.x += size_m * left;
    }
}

#[test]
fn a_transient_is_dropped_and_nothing_else() {
    let log = PeriodicLog { samples_per_cycle: 200, ..log(10) };
    for (size_m, time_constant_s, dropped) in [(0.3, 2.0, 1), (1.0, 5.0, 2)] {
        for seed in 0..10 {
            let mut samples = log.samples(seed);
            with_transient(&mut samples, size_m, time_constant_s);
            let found = average_cycles(&samples, &settings()).unwrap();
            assert_eq!((found.dropped, found.used), (dropped, 10 - dropped), "seed {seed}");
            assert!(!found.transient_remains);
        }
    }
    // Nothing to drop: one false alarm in ten thousand.
    let alarms = (0..100).filter(|&seed| averaged(&log, seed).dropped > 0).count();
    assert!(coverage_band(1e-4, 100, 0.999).high * 100.0 >= alarms as f64, "{alarms}");
    // As many as told.
    let mut samples = log.samples(0);
    with_transient(&mut samples, 0.3, 6.0);
    for forced in [0, 5, 8] {
        let found = average_cycles(&samples, &HarmonicSettings { dropped_cycles: Some(forced), ..settings() }).unwrap();
        assert_eq!((found.dropped, found.used, found.transient_remains), (forced, 10 - forced, false));
    }
    // Two always remain, and it is said.
    let samples = &mut samples[..800];
    with_transient(samples, 20.0, 8.0);
    let known = HarmonicSettings { noise: Some(noise()), ..least_squares() };
    let found = identify_periodic(samples, &known).unwrap();
    assert_eq!((found.cycles_used, found.cycles_dropped), (2, 2));
    assert!(has(&found, |w| matches!(w, HarmonicWarning::TransientRemains)));
    assert!(has(&found, |w| matches!(w, HarmonicWarning::TransientDropped { cycles: 2 })));
}

#[test]
fn leakage_is_said() {
    let log = PeriodicLog { samples_per_cycle: 200, ..log(11) };
    let settings = HarmonicSettings { dropped_cycles: Some(0), ..least_squares() };
    let clean =
        (0..50).filter(|&seed| average_cycles(&log.samples(seed), &settings).unwrap().leakage.is_some()).count();
    assert!(clean <= 1, "{clean}");
    // An oscillation of 2 cm between the second and the third harmonic.
    let mut samples = log.samples(0);
    for sample in &mut samples {
        sample.world_from_body.as_mut().unwrap().translation.vector.y +=
            0.02 * (1.6 * sample.time_ns as f64 * 1e-9).sin();
    }
    let found = identify_periodic(&samples, &settings).unwrap();
    let ratio = found.warnings.iter().find_map(|w| match w {
        HarmonicWarning::Leakage { ratio } => Some(*ratio),
        _ => None,
    });
    assert!(ratio.unwrap() > 1.1, "{ratio:?}");
    // The standard deviation counts what the harmonics see.
    assert!(found.record.channel_std[1] > 1.1 * found.record.channel_std[0]);
}

#[test]
fn the_remainder_is_ignored_and_said() {
    let log = PeriodicLog { samples_per_cycle: 200, ..log(12) };
    let samples = log.samples(0);
    let found = identify_periodic(&samples[..777], &least_squares()).unwrap();
    assert_eq!(found.cycles_used + found.cycles_dropped, 3);
    assert!(has(&found, |w| matches!(w, HarmonicWarning::Remainder { samples: 177 })));
    // A motion that starts later: the same cycles.
    let mut late = samples[..40].to_vec();
    late.extend_from_slice(&samples);
    for (i, sample) in late.iter_mut().enumerate() {
        sample.time_ns = 50_000_000 * i as i64;
    }
    let late = average_cycles(&late, &HarmonicSettings { start_s: 2.0, ..settings() }).unwrap();
    assert_eq!(late.record, average_cycles(&samples, &settings()).unwrap().record);
}

#[test]
fn saturation_is_seen_with_and_without_stated_limits() {
    let log = PeriodicLog { cycles: 2, samples_per_cycle: 200, noise: Noise::default(), ..log(13) };
    let mut samples = log.samples(0);
    assert!(saturated_share(&samples, None) < 1e-12);
    let largest = samples.iter().map(|s| s.wrench_body.unwrap().force.x.abs()).fold(0.0, f64::max);
    let limit = 0.6 * largest;
    let mut clipped = 0;
    for sample in &mut samples {
        let force = &mut sample.wrench_body.as_mut().unwrap().force;
        clipped += usize::from(force.x.abs() > limit);
        force.x = force.x.clamp(-limit, limit);
    }
    let truth = clipped as f64 / samples.len() as f64;
    let limits = WrenchBox { torque_limit: Vector3::repeat(1e3), force_limit: Vector3::new(limit, 1e3, 1e3) };
    for limits in [None, Some(&limits)] {
        let share = saturated_share(&samples, limits);
        assert!((share - truth).abs() < 0.02 && truth > 0.1, "{limits:?} {share} {truth}");
    }
}

/// The wrench that acted explains the motion whatever the limits did to it; a short Fourier series does not.
#[test]
fn saturated_records_go_to_the_trajectory_likelihood() {
    let limits = WrenchBox { torque_limit: Vector3::repeat(0.15), force_limit: Vector3::repeat(5.0) };
    let mut random = Random::new(21);
    let (motion, body) = (random.motion(10.0, 3), random.load());
    let start = Pose::from_parts(Translation3::new(1.0, -2.0, 0.5), UnitQuaternion::new(Vector3::new(0.4, -0.9, 1.3)));
    let (samples, saturation) = flown(&motion, &body, &limits, &start, 3.0, (6, 200));
    let samples = noisy(samples, &start, &Noise { torque_n_m: 0.0, force_n: 0.0, ..noise() }, 22);
    let settings = HarmonicSettings { world_from_start: start, ..HarmonicSettings::new(10.0, 3) };
    let error = |found: &HarmonicIdentification| {
        let truth = body.inertia_about_com();
        (found.estimate.parameters.inertia_about_com() - truth).norm() / truth.norm()
    };
    let found = identify_periodic(&samples, &settings).unwrap();
    assert!(saturation > 0.5 && (found.saturation - saturation).abs() < 0.05);
    assert_eq!(found.estimator, HarmonicEstimator::TrajectoryLikelihood);
    assert!(has(&found, |w| matches!(w, HarmonicWarning::TrajectoryLikelihood)));
    assert!(has(&found, |w| matches!(w, HarmonicWarning::Saturated { .. })));
    let kept = HarmonicSettings { largest_saturation: 1.0, estimator: HarmonicEstimator::LeastSquares, ..settings };
    let kept = identify_periodic(&samples, &kept).unwrap();
    assert_eq!(kept.estimator, HarmonicEstimator::LeastSquares);
    assert!(error(&found) < 0.02 && error(&found) < 0.5 * error(&kept), "{} {}", error(&found), error(&kept));
}

/// A robot that does not know its load tracks with many small harmonics: five are too few, and it is seen.
#[test]
fn a_series_that_is_too_short_hands_over() {
    let limits = WrenchBox { torque_limit: Vector3::repeat(1e3), force_limit: Vector3::repeat(1e3) };
    let mut random = Random::new(31);
    let (motion, body) = (random.motion(10.0, 3), random.load());
    let (samples, _) = flown(&motion, &body, &limits, &Pose::identity(), 8.0, (4, 300));
    let samples = noisy(samples, &Pose::identity(), &noise(), 32);
    let settings = HarmonicSettings { dropped_cycles: Some(1), largest_harmonics: 5, ..HarmonicSettings::new(10.0, 3) };
    let handed_over = identify_periodic(&samples, &settings).unwrap();
    assert_eq!(handed_over.estimator, HarmonicEstimator::TrajectoryLikelihood);
    assert!(has(&handed_over, |w| matches!(w, HarmonicWarning::TrajectoryLikelihood)));
    let truth = body.inertia_about_com();
    let error = (handed_over.estimate.parameters.inertia_about_com() - truth).norm() / truth.norm();
    assert!(error < 0.02, "{error}");
}

/// Twenty motions of three harmonics, five each with added ones up to the third (none) to the sixth; the study has two hundred.
/// There the residual of the wrench always finds the limit, the one number per sample of the energy balance in 95 %.
#[test]
fn both_rules_find_the_true_band_limit() {
    for (rule, share) in [(SelectionRule::LeastSquaresResidual, 0.99), (SelectionRule::EnergyBalance, 0.95)] {
        let mut found = 0;
        for case in 0..20 {
            let (mut random, limit) = (Random::new(100 + case), 3 + case as usize % 4);
            let reference = random.motion(10.0, 3);
            let motion = random.with_harmonics(&reference, limit, 0.005);
            let record = averaged(&PeriodicLog::new(motion, random.load()), case).record;
            let (fit, table) = select_harmonics(&record, 3..=10, rule).unwrap();
            assert_eq!(table.len(), 8);
            let least = table.iter().map(|candidate| candidate.residual(rule)).fold(f64::INFINITY, f64::min);
            let chosen = fit.motion.basis().harmonics();
            assert!(table[chosen - 3].residual(rule) <= least);
            found += u8::from(chosen == limit);
        }
        let band = coverage_band(share, 20, 0.98);
        assert!(band.contains(f64::from(found) / 20.0), "{rule:?}: {found} of 20");
    }
}

/// (4.17) to (4.19), corrected: the rate of `m |v_C|^2 / 2 + w^T J_C w / 2` by differences is `[w; v_B]^T gamma pi`. As
/// printed, with accelerations for velocities, it is not.
#[test]
fn power_of_the_wrench_is_the_rate_of_kinetic_energy() {
    let log = log(14);
    let (center, inertia) = (log.body.center_of_mass(), log.body.inertia_about_com());
    let velocity = |at: &tumble_identification::fourier::MotionInstant| {
        at.velocity_origin_body() + at.angular_velocity_body.cross(&center)
    };
    let energy = |time_s: f64| {
        let at = log.motion.at(time_s).unwrap();
        let w = at.angular_velocity_body;
        0.5 * log.body.mass * velocity(&at).norm_squared() + 0.5 * w.dot(&(inertia * w))
    };
    for i in 0..20 {
        let (time_s, step_s) = (0.5 * f64::from(i), 1e-4);
        let at = log.motion.at(time_s).unwrap();
        let wrench = at.regressor() * log.body.to_vector();
        let power = at.angular_velocity_body.dot(&wrench.fixed_rows::<3>(0))
            + at.velocity_origin_body().dot(&wrench.fixed_rows::<3>(3));
        let rate = (energy(time_s + step_s) - energy(time_s - step_s)) / (2.0 * step_s);
        assert!((power - rate).abs() < 1e-6, "{power} {rate}");
        if i > 0 {
            let (w, turning) = (at.angular_velocity_body, at.angular_acceleration_body);
            let printed = log.body.mass * at.acceleration_origin_body().norm_squared()
                + w.dot(&(inertia * turning + w.cross(&(inertia * w))));
            assert!((printed - rate).abs() > 1e-4, "{printed} {rate}");
        }
    }
}

#[test]
fn bad_records_are_refused_with_what_would_do() {
    let log = PeriodicLog { cycles: 3, samples_per_cycle: 200, ..log(15) };
    let samples = log.samples(0);
    let refused = |samples: &[MotionSample], settings: &HarmonicSettings| {
        identify_periodic(samples, settings).map(|_| ()).unwrap_err()
    };
    let with = |change: fn(&mut HarmonicSettings)| {
        let mut settings = settings();
        change(&mut settings);
        settings
    };
    match refused(&samples, &with(|s| s.period_s = 9.98)) {
        IdentificationError::PeriodNotWhole { step_s, nearest_period_s, nearest_step_s, .. } => {
            assert!((step_s - 0.05).abs() < 1e-9 && (nearest_period_s - 10.0).abs() < 1e-9);
            assert!((nearest_step_s - 0.0499).abs() < 1e-9, "{nearest_step_s}");
        }
        other => panic!("{other}"),
    }
    match refused(&samples, &with(|s| s.period_s = 20.0)) {
        IdentificationError::TooFewCycles { cycles, dropped: 0, samples: 600, needed: 800 } => {
            assert!((cycles - 1.5).abs() < 1e-9);
        }
        other => panic!("{other}"),
    }
    let too_few = |error| matches!(error, IdentificationError::TooFewCycles { .. });
    assert!(too_few(refused(&samples, &with(|s| s.dropped_cycles = Some(2)))));
    assert!(too_few(refused(&samples, &with(|s| s.period_s = 1e9))));
    assert!(too_few(refused(&samples, &with(|s| s.start_s = 25.0))));
    for period_s in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = refused(&samples, &HarmonicSettings { period_s, ..settings() });
        assert!(matches!(error, IdentificationError::InvalidPeriod { .. }), "{error}");
    }
    for start_s in [-1.0, 31.0, f64::NAN] {
        let error = refused(&samples, &HarmonicSettings { start_s, ..settings() });
        assert!(matches!(error, IdentificationError::InvalidStart { .. }), "{error}");
    }
    let error = refused(&samples, &with(|s| (s.reference_harmonics, s.largest_harmonics) = (100, 117)));
    assert_eq!(error, IdentificationError::TooManyHarmonics { harmonics: 100, samples: 200 });
    let error = refused(&samples, &with(|s| s.largest_harmonics = 2));
    assert_eq!(error, IdentificationError::HarmonicRange { first: 3, last: 2 });
    assert_eq!(refused(&samples, &with(|s| s.reference_harmonics = 0)), IdentificationError::NoHarmonics);
    let error = refused(&samples, &with(|s| s.noise = Some(Noise { force_n: -1.0, ..noise() })));
    assert_eq!(error, IdentificationError::NotPositive { index: 3, value: -1.0 });
    assert!(matches!(refused(&samples[..2], &settings()), IdentificationError::TooFewSamples { samples: 2, .. }));
    assert!(matches!(refused(&[], &settings()), IdentificationError::TooFewSamples { samples: 0, .. }));

    let mut without = samples.clone();
    without[321].wrench_body = None;
    assert_eq!(refused(&without, &settings()), IdentificationError::WrenchMissing { index: 321 });
    for sample in &mut without {
        sample.wrench_body = None;
    }
    assert_eq!(refused(&without, &settings()), IdentificationError::MissingColumn(Column::Wrench));
    let mut silent = samples.clone();
    for sample in &mut silent {
        sample.wrench_body = Some(Wrench::zero());
    }
    assert!(matches!(refused(&silent, &settings()), IdentificationError::NotExcited { .. }));
    let mut uneven = samples.clone();
    uneven[100].time_ns += 1_000_000;
    assert!(matches!(refused(&uneven, &settings()), IdentificationError::UnequalSteps { index: 100, .. }));
    uneven[100].time_ns = uneven[99].time_ns;
    assert!(matches!(refused(&uneven, &settings()), IdentificationError::TimesNotIncreasing { index: 100 }));
    let mut broken = samples.clone();
    broken[7].world_from_body.as_mut().unwrap().translation.vector.y = f64::NAN;
    assert!(matches!(refused(&broken, &settings()), IdentificationError::NotFinite { row: 7 }));
    // A body that turns on and on about the vertical.
    let mut turning = samples.clone();
    for sample in &mut turning {
        let angle = std::f64::consts::TAU / 10.0 * sample.time_ns as f64 * 1e-9;
        sample.world_from_body.as_mut().unwrap().rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
    }
    assert!(matches!(refused(&turning, &settings()), IdentificationError::NotPeriodic { coordinate: 2, .. }));
    let error = refused(&turning, &with(|s| s.chart = AttitudeChart::Quaternion));
    assert!(matches!(error, IdentificationError::NotPeriodic { .. }), "{error}");
    // Standing still shows nothing.
    let mut still = samples;
    for sample in &mut still {
        sample.world_from_body = Some(Pose::identity());
    }
    assert!(matches!(refused(&still, &settings()), IdentificationError::NotExcited { .. }));
}
