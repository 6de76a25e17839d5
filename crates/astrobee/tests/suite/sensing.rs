//! What the sensors suffer from: every figure of `docs/sensing.md` and every source of error, by its statistics.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#![allow(clippy::float_cmp, reason = "settings and unchanged numbers are equal to the bit")]

use tumble_astrobee::AstrobeeError;
use tumble_astrobee::propulsion::ImpellerMode;
use tumble_astrobee::sensing::{
    Confidence, FaultSettings, ImuChain, ImuModel, ImuSettings, Interval, Jump, JumpSettings, Localization,
    LocalizationEstimate, LocalizationSettings, PoseErrorSettings, SensingPreset, SensorErrors, TimingSettings,
    TrueMotion,
};
use tumble_dynamics::RigidBodyState;
use tumble_dynamics::nalgebra::{SVector, Translation3, UnitQuaternion, Vector3};
use tumble_identification::synchronize::{Signals, delay, relative_scale};
use tumble_lie::{LieGroup, Pose, Twist};

const MODE: ImpellerMode = ImpellerMode::Nominal;
const MS: i64 = 1_000_000;
const LEVER: [f64; 3] = [0.0247, 0.0183, 0.0094];

/// Turning about one axis by `0.8 sin 1.1 t` while the origin moves on three sines.
fn swing(time_ns: i64) -> TrueMotion {
    let t = time_ns as f64 * 1e-9;
    let axis = Vector3::new(0.48, -0.6, 0.64);
    let (angle, angle_rate, angle_acceleration) =
        (0.8 * libm::sin(1.1 * t), 0.88 * libm::cos(1.1 * t), -0.968 * libm::sin(1.1 * t));
    let (size, speed) = (Vector3::new(0.3, 0.2, 0.25), Vector3::new(0.9, 1.3, 0.7));
    let wave = |of: fn(f64) -> f64| speed.map(|w| of(w * t));
    let rotation: UnitQuaternion<f64> = LieGroup::exp(&(axis * angle));
    let position = size.component_mul(&wave(libm::sin));
    let velocity = size.component_mul(&speed).component_mul(&wave(libm::cos));
    let acceleration = -size.component_mul(&speed).component_mul(&speed).component_mul(&wave(libm::sin));
    TrueMotion {
        time_ns,
        state: RigidBodyState {
            world_from_body: Pose::from_parts(Translation3::from(position), rotation),
            twist_body: Twist { angular: axis * angle_rate, linear: rotation.inverse_transform_vector(&velocity) },
        },
        acceleration_origin_body: rotation.inverse_transform_vector(&acceleration),
        angular_acceleration_body: axis * angle_acceleration,
    }
}

fn at_rest(time_ns: i64) -> TrueMotion {
    TrueMotion {
        time_ns,
        state: RigidBodyState::at_rest(),
        acceleration_origin_body: Vector3::zeros(),
        angular_acceleration_body: Vector3::zeros(),
    }
}

/// The origin accelerates along body axes that do not turn.
fn accelerating(time_ns: i64, acceleration: Vector3<f64>) -> TrueMotion {
    TrueMotion { acceleration_origin_body: acceleration, ..at_rest(time_ns) }
}

fn spinning(time_ns: i64, rate: Vector3<f64>) -> TrueMotion {
    let mut truth = at_rest(time_ns);
    truth.state.twist_body.angular = rate;
    truth
}

/// All estimates in order of arrival, observed every `step_ms` for `seconds`.
fn run(
    settings: &LocalizationSettings,
    seed: u64,
    seconds: i64,
    step_ms: i64,
    truth: impl Fn(i64) -> TrueMotion,
) -> Vec<LocalizationEstimate> {
    let mut localization = Localization::new(settings, seed, MODE).unwrap();
    let mut estimates = Vec::new();
    for time_ns in (0..seconds * 1000 / step_ms).map(|k| k * step_ms * MS) {
        localization.observe(&truth(time_ns));
        while let Some(estimate) = localization.arrived(time_ns) {
            assert!(estimate.arrival_ns <= time_ns);
            estimates.push(estimate);
        }
    }
    while let Some(estimate) = localization.arrived(i64::MAX) {
        estimates.push(estimate);
    }
    assert_eq!(localization.unread(), 0);
    assert!(estimates.is_sorted_by_key(|estimate| estimate.arrival_ns));
    assert!(estimates.iter().all(|estimate| estimate.arrival_ns >= estimate.stamp_ns));
    estimates
}

fn perfect() -> LocalizationSettings {
    LocalizationSettings::perfect()
}

fn with_timing(timing: TimingSettings) -> LocalizationSettings {
    LocalizationSettings { timing, ..perfect() }
}

fn with_faults(faults: FaultSettings) -> LocalizationSettings {
    LocalizationSettings { faults, ..perfect() }
}

fn with_imu(change: impl Fn(&mut ImuSettings)) -> LocalizationSettings {
    let mut settings = perfect();
    change(&mut settings.imu);
    settings
}

fn perfect_timing() -> TimingSettings {
    perfect().timing
}

fn unit(settings: &ImuSettings, seed: u64) -> ImuModel {
    ImuModel::new(settings, Vector3::zeros(), seed)
}

fn mean(samples: impl Iterator<Item = f64> + Clone) -> f64 {
    samples.clone().sum::<f64>() / samples.count() as f64
}

/// Square root of the mean square.
fn rms(samples: impl Iterator<Item = f64> + Clone) -> f64 {
    mean(samples.map(|x| x * x)).sqrt()
}

/// Whether an rms of `samples` independent numbers is within four standard errors of `sigma`.
fn assert_sigma(name: &str, found: f64, sigma: f64, samples: usize) {
    let band = 4.0 / (2.0 * samples as f64).sqrt();
    assert!((found / sigma - 1.0).abs() < band, "{name}: {found:e} for {sigma:e}, band {band:.3}");
}

/// Whether a count of `trials` with `probability` is within four standard errors.
fn assert_share(name: &str, count: usize, probability: f64, trials: usize) {
    let share = count as f64 / trials as f64;
    let band = 4.0 * (probability * (1.0 - probability) / trials as f64).sqrt();
    assert!((share - probability).abs() < band, "{name}: {share} for {probability}, band {band:.4}");
}

fn same_but_times(a: &LocalizationEstimate, b: &LocalizationEstimate) -> bool {
    LocalizationEstimate { stamp_ns: 0, arrival_ns: 0, ..*a }
        == LocalizationEstimate { stamp_ns: 0, arrival_ns: 0, ..*b }
}

mod inertial_unit {
    use super::*;

    /// Against the second difference of the unit's place in the world, which knows no formula of a rotating frame.
    #[test]
    fn it_feels_the_motion_of_its_place() {
        let gravity = Vector3::new(0.3, -0.2, 9.806_65);
        let settings = ImuSettings { lever_arm_body_m: LEVER, ..perfect().imu };
        let mut imu = ImuModel::new(&settings, gravity, 1);
        for k in 1..200 {
            let time_ns = k * 8 * MS;
            let place = |offset_ns: i64| {
                swing(time_ns + offset_ns).state.world_from_body * tumble_dynamics::nalgebra::Point3::from(LEVER)
            };
            let h_ns = 200_000;
            let h = h_ns as f64 * 1e-9;
            let acceleration = ((place(h_ns) - place(0)) - (place(0) - place(-h_ns))) / (h * h);
            let turn = |offset_ns: i64| swing(time_ns + offset_ns).state.world_from_body.rotation;
            let rate: Vector3<f64> = LieGroup::log(&(turn(-h_ns).inverse() * turn(h_ns))) / (2.0 * h);
            let expected = turn(0).inverse_transform_vector(&(acceleration - gravity));
            let sample = imu.measure(&swing(time_ns));
            // 90 degrees about z: the unit's x axis points along the body's y.
            let to_body = |s: Vector3<f64>| Vector3::new(-s.y, s.x, s.z);
            assert!((to_body(sample.specific_force_sensor) - expected).norm() < 1e-6);
            assert!((to_body(sample.rate_sensor) - rate).norm() < 1e-6);
        }
    }

    #[test]
    fn the_flown_chain_leaves_the_angular_acceleration_in() {
        let gravity = [0.0, 0.0, 9.806_65];
        let settings =
            LocalizationSettings { gravity_world_m_s2: gravity, ..with_imu(|imu| imu.lever_arm_body_m = LEVER) };
        let estimates = run(&settings, 1, 4, 16, swing);
        assert_eq!(estimates.len(), 250);
        for estimate in estimates {
            let truth = swing(estimate.stamp_ns);
            let left_in = truth.angular_acceleration_body.cross(&Vector3::from(LEVER));
            let error = estimate.acceleration_origin_body - truth.acceleration_origin_body;
            assert!((error - left_in).norm() < 1e-13, "{error} for {left_in}");
            assert!((estimate.rate_body - truth.state.twist_body.angular).norm() < 1e-15);
        }
    }

    #[test]
    fn the_average_is_that_of_64_taps_on_a_straight_signal() {
        for (interval_ms, per_interval) in [(8_u32, 16_usize), (16, 32)] {
            let settings = with_imu(|imu| {
                imu.moving_average = true;
                imu.sample_interval_ms = interval_ms;
            });
            let mut imu = unit(&settings.imu, 1);
            let mut noise = tumble_identification::noise::Gaussian::from_seed(5);
            let knots: Vec<f64> = (0..40).map(|_| noise.normal()).collect();
            let fine = |tap: usize| {
                let (k, s) = (tap / per_interval, (tap % per_interval) as f64 / per_interval as f64);
                if s == 0.0 { knots[k] } else { knots[k] * (1.0 - s) + knots[k + 1] * s }
            };
            for (k, &knot) in knots.iter().enumerate() {
                let found = imu.measure(&accelerating(0, Vector3::new(0.0, knot, 0.0))).specific_force_sensor.x;
                let newest = k * per_interval;
                if newest >= 64 {
                    let expected = (0..64).map(|tap| fine(newest - tap)).sum::<f64>() / 64.0;
                    assert!((found - expected).abs() < 1e-14, "{interval_ms} ms, {k}: {found} {expected}");
                }
            }
        }
    }

    #[test]
    fn range_and_resolution() {
        let errors = SensorErrors { range: 3.0, resolution: 0.25, ..SensorErrors::none() };
        let settings = with_imu(|imu| (imu.accelerometer, imu.gyro) = (errors, errors));
        let mut imu = unit(&settings.imu, 1);
        for (truth, output) in [(4.0, 3.0), (-100.0, -3.0), (0.13, 0.25), (0.12, 0.0), (-1.1, -1.0), (2.9, 3.0)] {
            let v = Vector3::repeat(truth);
            let mut motion = accelerating(0, v);
            motion.state.twist_body.angular = v;
            let sample = imu.measure(&motion);
            assert_eq!((sample.specific_force_sensor.z, sample.rate_sensor.z), (output, output), "{truth}");
        }
        // The figures of the unit: 3 g and 150 degrees per second.
        let nominal = LocalizationSettings::nominal().imu;
        assert!((nominal.accelerometer.range - 29.419_95).abs() < 1e-12);
        assert!((nominal.gyro.range.to_degrees() - 150.0).abs() < 1e-12);
    }

    /// Errors that one seed draws once: over many seeds they spread as asked.
    #[test]
    fn what_is_drawn_once_per_unit() {
        let seeds = 1000;
        let v = Vector3::new(1.0, 0.0, 0.0);
        let gain = |errors: SensorErrors, axis: usize, force: Vector3<f64>| {
            let settings = with_imu(|imu| (imu.accelerometer, imu.gyro) = (errors, errors));
            (0..seeds)
                .flat_map(|seed| {
                    let mut motion = accelerating(0, force);
                    motion.state.twist_body.angular = force;
                    let sample = unit(&settings.imu, seed).measure(&motion);
                    [sample.specific_force_sensor[axis], sample.rate_sensor[axis]]
                })
                .collect::<Vec<f64>>()
        };
        // Body x lies along the unit's -y.
        let scale = gain(SensorErrors { scale_sigma: 0.01, ..SensorErrors::none() }, 1, v);
        assert_sigma("scale", rms(scale.iter().map(|x| -x - 1.0)), 0.01, scale.len());
        let misaligned = gain(SensorErrors { misalignment_sigma_rad: 0.02, ..SensorErrors::none() }, 0, v);
        assert_sigma("misalignment", rms(misaligned.iter().copied()), 0.02, misaligned.len());
        let biased = gain(SensorErrors { bias_sigma: 0.3, ..SensorErrors::none() }, 2, Vector3::zeros());
        assert_sigma("bias", rms(biased.iter().copied()), 0.3, biased.len());
        // Accelerometer and gyroscope share nothing.
        let correlation = mean(biased.chunks(2).map(|pair| pair[0] * pair[1])) / 0.09;
        assert!(correlation.abs() < 4.0 / (seeds as f64).sqrt(), "{correlation}");
    }

    #[test]
    fn noise_has_its_density() {
        let density = 0.01;
        let errors = SensorErrors { noise_density: density, ..SensorErrors::none() };
        for moving_average in [false, true] {
            let settings = with_imu(|imu| {
                imu.moving_average = moving_average;
                (imu.accelerometer, imu.gyro) = (errors, errors);
            });
            let mut imu = unit(&settings.imu, 3);
            let blocks = 400;
            let samples_per_block = 250;
            let mut means = Vec::new();
            let mut all = Vec::new();
            for _ in 0..blocks {
                let mut sum = Vector3::zeros();
                for _ in 0..samples_per_block {
                    let sample = imu.measure(&at_rest(0));
                    all.push(sample.specific_force_sensor.x);
                    sum += sample.rate_sensor;
                }
                means.extend((sum / f64::from(samples_per_block)).iter().copied());
            }
            // One-sided density: the mean over T has the variance S/(2 T).
            let block_s = 0.008 * f64::from(samples_per_block);
            assert_sigma("mean over 2 s", rms(means.iter().copied()), density / (2.0 * block_s).sqrt(), means.len());
            if !moving_average {
                assert_sigma("one sample", rms(all.iter().copied()), density * 62.5_f64.sqrt(), all.len());
            }
        }
    }

    #[test]
    fn the_slow_bias_walks() {
        let walk = 2e-3;
        let errors = SensorErrors { bias_walk: walk, ..SensorErrors::none() };
        let settings = with_imu(|imu| (imu.accelerometer, imu.gyro) = (errors, errors));
        let (seeds, seconds) = (60, 64);
        let mut ends = Vec::new();
        for seed in 0..seeds {
            let mut imu = unit(&settings.imu, seed);
            for _ in 0..seconds * 125 {
                imu.measure(&at_rest(0));
            }
            let bias = imu.bias();
            ends.extend(bias.accelerometer.iter().chain(&bias.gyro).copied());
        }
        assert_sigma("walk", rms(ends.iter().copied()), walk * 8.0, ends.len());
    }

    #[test]
    fn the_fast_bias_is_a_markov_process() {
        let (sigma, time_s) = (0.02, 0.08);
        let errors = SensorErrors { markov_sigma: sigma, markov_time_s: time_s, ..SensorErrors::none() };
        let settings = with_imu(|imu| imu.gyro = errors);
        let mut imu = unit(&settings.imu, 7);
        let samples: Vec<f64> = (0..100_000).map(|_| imu.measure(&at_rest(0)).rate_sensor.y).collect();
        // Independent once in twice the correlation time.
        assert_sigma("markov", rms(samples.iter().copied()), sigma, 5_000);
        for lag in [1, 5, 10, 20] {
            let covariance = mean(samples.iter().zip(&samples[lag..]).map(|(a, b)| a * b));
            let expected = (-0.008 * lag as f64 / time_s).exp();
            assert!((covariance / (sigma * sigma) - expected).abs() < 0.06, "{lag}: {}", covariance / (sigma * sigma));
        }
    }

    /// The flight software knows the bias at switch-on and follows its walk with a lag.
    #[test]
    fn the_bias_is_removed_but_for_its_drift() {
        let bias = SensorErrors { bias_sigma: 0.1, ..SensorErrors::none() };
        let walking = SensorErrors { bias_walk: 1e-3, ..bias };
        let residual = |errors: SensorErrors, following_s: f64| {
            let settings = with_imu(|imu| {
                (imu.accelerometer, imu.gyro) = (errors, errors);
                imu.bias_following_time_s = following_s;
            });
            rms(run(&settings, 2, 400, 16, at_rest)
                .iter()
                .flat_map(|e| e.acceleration_origin_body.iter().chain(e.rate_body.iter()).copied().collect::<Vec<_>>())
                .collect::<Vec<_>>()
                .iter()
                .copied())
        };
        assert!(residual(bias, 3.25) < 1e-16);
        assert!(residual(walking, 0.0) < 1e-16);
        // Steps of 1e-3 each second, forgotten with 5 s: variance 1e-6 / (1 - exp(-2/5)) averaged over the second.
        let lag = residual(walking, 5.0);
        assert!((lag / (1e-3 * (0.5_f64 * 5.0).sqrt()) - 1.0).abs() < 0.3, "{lag:e}");
        assert!(residual(walking, 50.0) > 1.5 * lag);
    }
}

mod delays {
    use super::*;

    const MASS_KG: f64 = 9.58;

    /// Slow forces, N, of the size the thesis's planner allows.
    fn force(t: f64) -> Vector3<f64> {
        let wave = |a: f64, b: f64, phase: f64| 0.05 * (libm::sin(a * t + phase) + libm::sin(b * t));
        Vector3::new(wave(0.7, 1.3, 0.0), wave(0.5, 1.6, 1.0), wave(0.9, 1.1, 2.0))
    }

    fn seconds(time_ns: i64) -> f64 {
        time_ns as f64 * 1e-9
    }

    /// Force that the controller holds for 16 ms; where it jumps, the mean of both sides.
    fn held(time_ns: i64) -> Vector3<f64> {
        let step = 16 * MS;
        let start = time_ns.div_euclid(step) * step;
        let now = force(seconds(start));
        if start == time_ns { (now + force(seconds(start - step))) * 0.5 } else { now }
    }

    type Input = fn(i64) -> Vector3<f64>;

    fn smooth(time_ns: i64) -> Vector3<f64> {
        force(seconds(time_ns))
    }

    /// Output of the sensors on a motion in which `of` is both acceleration times mass and angular rate.
    fn observed(settings: &LocalizationSettings, seconds: i64, of: Input) -> Vec<LocalizationEstimate> {
        run(settings, 4, seconds, 8, |time_ns| TrueMotion {
            acceleration_origin_body: of(time_ns) / MASS_KG,
            ..spinning(time_ns, of(time_ns))
        })
    }

    /// Delay of acceleration and rate behind the commanded force, by the project's own estimator, ms.
    fn delays_ms(settings: &LocalizationSettings, of: Input) -> [f64; 2] {
        let estimates = observed(settings, 60, of);
        let columns: [fn(&LocalizationEstimate) -> Vector3<f64>; 2] =
            [|e| e.acceleration_origin_body * MASS_KG, |e| e.rate_body];
        columns.map(|column| {
            let signals: Signals<3, 3, 1> = Signals {
                step_s: 0.016,
                input: estimates.iter().map(|e| force(seconds(e.stamp_ns))).collect(),
                input_offset_s: 0.0,
                output: estimates.iter().map(column).collect(),
                covariates: vec![SVector::zeros(); estimates.len()],
                correlation_length: 20,
            };
            1e3 * delay(&signals, 0.4).unwrap().delay_s
        })
    }

    fn assert_delays(name: &str, settings: &LocalizationSettings, of: Input, expected_ms: [f64; 2]) {
        let found = delays_ms(settings, of);
        assert!((found[0] - expected_ms[0]).abs() < 0.5, "{name}, acceleration: {found:?} for {expected_ms:?}");
        assert!((found[1] - expected_ms[1]).abs() < 0.5, "{name}, rate: {found:?} for {expected_ms:?}");
    }

    fn average() -> LocalizationSettings {
        with_imu(|imu| imu.moving_average = true)
    }

    fn filter() -> LocalizationSettings {
        with_imu(|imu| imu.flight_filter = true)
    }

    fn whole_chain() -> LocalizationSettings {
        with_imu(|imu| (imu.moving_average, imu.flight_filter) = (true, true))
    }

    /// Row by row the table of `docs/sensing.md`.
    #[test]
    fn every_part_of_the_delay_is_found_by_the_estimator() {
        assert_delays("nothing", &perfect(), smooth, [0.0, 0.0]);
        assert_delays("held command", &perfect(), held, [8.0, 8.0]);
        assert_delays("average of 64", &average(), smooth, [15.75, 15.75]);
        assert_delays("flight filter", &filter(), smooth, [113.9, 61.0]);
        assert_delays("both", &whole_chain(), smooth, [129.65, 76.75]);
        assert_delays("both, held", &whole_chain(), held, [137.65, 84.75]);
        let mut hidden = perfect();
        hidden.timing.hidden_latency_ms = 16;
        assert_delays("hidden latency", &hidden, smooth, [16.0, 16.0]);
        let mut all = whole_chain();
        all.timing.hidden_latency_ms = 16;
        assert_delays("all", &all, held, [153.65, 100.75]);
    }

    #[test]
    fn at_half_the_rate_the_filter_takes_twice_as_long() {
        let mut settings = filter();
        settings.imu.sample_interval_ms = 16;
        // Low frequencies only: 0.26 Hz is 0.52 Hz to these filters.
        let found = delays_ms(&settings, smooth);
        assert!((found[0] - 227.8).abs() < 2.0 && (found[1] - 122.0).abs() < 2.0, "{found:?}");
    }

    /// The sensors of the thesis's flights, each estimate at its place.
    fn thesis_in_order(hidden_latency_ms: u32) -> LocalizationSettings {
        let mut settings = SensingPreset::ThesisFlight.settings();
        settings.faults = FaultSettings::default();
        settings.timing.arrival_jitter_ms = 0.0;
        settings.timing.hidden_latency_ms = hidden_latency_ms;
        settings
    }

    /// The thesis took the whole-sample maximum of a correlation on one axis, and found ten samples of 16 ms.
    #[test]
    fn the_correlation_of_the_thesis() {
        for (hidden_latency_ms, found_ms) in [(0, 144), (24, 160)] {
            let estimates = observed(&thesis_in_order(hidden_latency_ms), 600, held);
            let correlation = |lag: usize| {
                let pairs = estimates[lag..].iter().zip(&estimates);
                mean(
                    pairs.map(|(later, earlier)| later.acceleration_origin_body.x * force(seconds(earlier.stamp_ns)).x),
                )
            };
            let best = (0..40).max_by(|&a, &b| correlation(a).total_cmp(&correlation(b))).unwrap();
            assert_eq!(best * 16, found_ms, "{hidden_latency_ms}");
        }
    }

    /// (6.13) on what the sensors publish gives back the factors of table 6.5, additive in inverse mass as printed.
    #[test]
    fn golden_scale_anomaly_of_table_6_5() {
        let factors = SensingPreset::ThesisFlight.settings().acceleration_factor;
        assert_eq!(factors, [1.774, 1.0201, 1.2088]);
        let estimates = observed(&thesis_in_order(16), 600, smooth);
        // 145.65 ms are 9 samples and 1.65 ms, which change the scale by less than 1e-5.
        let lag = 9;
        let forces: Vec<_> = estimates.iter().map(|e| force(seconds(e.stamp_ns))).collect();
        let accelerations: Vec<_> = estimates[lag..].iter().map(|e| e.acceleration_origin_body).collect();
        let scales = relative_scale(&forces, &accelerations, 40).unwrap();
        for ((scale, factor), theta) in scales.iter().zip(factors).zip([0.080_793_3, 0.002_098_1, 0.021_795_4]) {
            let sigma = scale.sigma_per_kg;
            assert!(
                (scale.factor(MASS_KG) - factor).abs() < 4.0 * sigma * MASS_KG,
                "{} {factor} {sigma}",
                scale.factor(MASS_KG)
            );
            assert!((scale.excess_per_kg(MASS_KG) - theta).abs() < 4.0 * sigma, "{}", scale.excess_per_kg(MASS_KG));
            assert!(sigma * MASS_KG < 0.02, "{sigma}");
        }
    }
}

mod localization {
    use super::*;

    #[test]
    fn perfect_is_the_truth_at_once() {
        for step_ms in [4, 8, 16] {
            let estimates = run(&perfect(), 1, 4, step_ms, swing);
            assert_eq!(estimates.len(), 250);
            for (k, estimate) in (0_i64..).zip(&estimates) {
                assert_eq!((estimate.stamp_ns, estimate.arrival_ns), (k * 16 * MS, k * 16 * MS));
                let truth = swing(estimate.stamp_ns);
                let pose = truth.state.world_from_body;
                assert_eq!(estimate.world_from_body.translation, pose.translation);
                assert!(estimate.world_from_body.rotation.angle_to(&pose.rotation) < 1e-7);
                assert_eq!(estimate.velocity_origin_world, pose.rotation * truth.state.twist_body.linear);
                assert!((estimate.rate_body - truth.state.twist_body.angular).norm() < 1e-15);
                assert!((estimate.acceleration_origin_body - truth.acceleration_origin_body).norm() < 1e-15);
                assert_eq!(estimate.confidence, Confidence::Good);
            }
        }
    }

    /// With noise and filters on, coarser observation changes nothing but the interpolated samples, by little.
    #[test]
    fn other_steps_of_the_simulator() {
        let reference = run(&LocalizationSettings::nominal(), 1, 20, 8, swing);
        assert_eq!(run(&LocalizationSettings::nominal(), 1, 20, 4, swing), reference);
        let coarse = run(&LocalizationSettings::nominal(), 1, 20, 16, swing);
        assert_eq!(coarse.len(), reference.len());
        // 10 ms do not divide the samples: pose and velocity are interpolated too.
        let uneven = run(&LocalizationSettings::nominal(), 1, 20, 10, swing);
        for (other, tolerance) in [(coarse, 1e-12), (uneven, 2e-5)] {
            for (a, b) in other.iter().zip(&reference) {
                assert_eq!((a.stamp_ns, a.arrival_ns), (b.stamp_ns, b.arrival_ns));
                let gap = a.world_from_body.translation.vector - b.world_from_body.translation.vector;
                assert!(gap.norm() < tolerance * 1e-2, "{gap}");
                assert!((a.velocity_origin_world - b.velocity_origin_world).norm() < tolerance);
                let turned: Vector3<f64> =
                    LieGroup::log(&(a.world_from_body.rotation.inverse() * b.world_from_body.rotation));
                assert!(turned.norm() < tolerance.max(1e-12), "{turned}");
                // One step of the accelerometer, 1.2 mm/s^2, and of the gyroscope, 0.09 mrad/s, at the most.
                assert!((a.acceleration_origin_body - b.acceleration_origin_body).norm() < 1.3e-3);
                assert!((a.rate_body - b.rate_body).norm() < 1e-4);
            }
        }
    }

    #[test]
    fn planar_motion_stays_in_its_plane() {
        let planar = |time_ns: i64| {
            let mut truth = swing(time_ns);
            let t = time_ns as f64 * 1e-9;
            let rotation: UnitQuaternion<f64> = LieGroup::exp(&Vector3::new(0.0, 0.0, 0.5 * t));
            truth.state.world_from_body = Pose::from_parts(Translation3::new(0.1, -0.2, -0.7), rotation);
            truth.state.twist_body = Twist { angular: Vector3::new(0.0, 0.0, 0.5), linear: Vector3::zeros() };
            truth.acceleration_origin_body = Vector3::zeros();
            truth.angular_acceleration_body = Vector3::zeros();
            truth
        };
        let mut settings = LocalizationSettings { gravity_world_m_s2: [0.0, 0.0, 9.806_65], ..perfect() };
        settings.imu =
            ImuSettings { accelerometer: SensorErrors::none(), gyro: SensorErrors::none(), ..ImuSettings::default() };
        for estimate in run(&settings, 1, 10, 16, planar) {
            assert_eq!(estimate.world_from_body.translation.vector, Vector3::new(0.1, -0.2, -0.7));
            assert!((estimate.rate_body - Vector3::new(0.0, 0.0, 0.5)).norm() < 1e-6);
            // Gravity is gone, and so is the centripetal acceleration of the unit.
            assert!(estimate.acceleration_origin_body.norm() < 5e-6, "{}", estimate.acceleration_origin_body);
        }
    }

    #[test]
    fn white_errors_of_pose_and_velocity() {
        let none = perfect().pose;
        let check = |name: &str, pose: PoseErrorSettings, sigma: f64, of: fn(&LocalizationEstimate) -> Vector3<f64>| {
            let estimates = run(&LocalizationSettings { pose, ..perfect() }, 6, 160, 16, at_rest);
            let errors: Vec<Vector3<f64>> = estimates.iter().map(of).collect();
            for axis in 0..3 {
                assert_sigma(name, rms(errors.iter().map(|e| e[axis])), sigma, errors.len());
                let neighbours = mean(errors.windows(2).map(|pair| pair[0][axis] * pair[1][axis])) / (sigma * sigma);
                assert!(neighbours.abs() < 4.0 / (errors.len() as f64).sqrt(), "{name}: {neighbours}");
            }
        };
        check("position", PoseErrorSettings { position_noise_m: 0.01, ..none.clone() }, 0.01, position);
        check("attitude", PoseErrorSettings { attitude_noise_rad: 0.02, ..none.clone() }, 0.02, attitude);
        check("velocity", PoseErrorSettings { velocity_noise_m_s: 0.03, ..none }, 0.03, velocity);
    }

    fn position(estimate: &LocalizationEstimate) -> Vector3<f64> {
        estimate.world_from_body.translation.vector
    }

    fn attitude(estimate: &LocalizationEstimate) -> Vector3<f64> {
        LieGroup::log(&estimate.world_from_body.rotation)
    }

    fn velocity(estimate: &LocalizationEstimate) -> Vector3<f64> {
        estimate.velocity_origin_world
    }

    #[test]
    fn slow_errors_of_pose_and_velocity() {
        let none = PoseErrorSettings { drift_time_s: 0.5, ..perfect().pose };
        let check = |name: &str, pose: PoseErrorSettings, sigma: f64, of: fn(&LocalizationEstimate) -> Vector3<f64>| {
            let estimates = run(&LocalizationSettings { pose, ..perfect() }, 6, 400, 16, at_rest);
            let errors: Vec<Vector3<f64>> = estimates.iter().map(of).collect();
            let all = || errors.iter().flat_map(|e| [e.x, e.y, e.z]);
            // Three axes, independent once in twice the correlation time... of which there are 400.
            assert_sigma(name, rms(all().collect::<Vec<_>>().iter().copied()), sigma, 1200);
            let lag = 31;
            let product: Vec<f64> = errors.iter().zip(&errors[lag..]).map(|(a, b)| a.dot(b) / 3.0).collect();
            let correlation = mean(product.iter().copied()) / (sigma * sigma);
            assert!((correlation - (-0.016 * lag as f64 / 0.5_f64).exp()).abs() < 0.12, "{name}: {correlation}");
        };
        check("position", PoseErrorSettings { position_drift_m: 0.01, ..none.clone() }, 0.01, position);
        check("attitude", PoseErrorSettings { attitude_drift_rad: 0.02, ..none.clone() }, 0.02, attitude);
        check("velocity", PoseErrorSettings { velocity_drift_m_s: 0.03, ..none }, 0.03, velocity);
    }

    #[test]
    fn latency_is_exact() {
        let settings = with_timing(TimingSettings { latency_ms: 123.456_789, ..perfect_timing() });
        let estimates = run(&settings, 1, 10, 16, swing);
        assert_eq!(estimates.len(), 625);
        for (k, estimate) in (0_i64..).zip(estimates) {
            assert_eq!(estimate.stamp_ns, k * 16 * MS);
            assert_eq!(estimate.arrival_ns, k * 16 * MS + 123_456_789);
        }
        let mut localization = Localization::new(&settings, 1, MODE).unwrap();
        localization.observe(&at_rest(0));
        assert!(localization.arrived(123_456_788).is_none());
        assert!(localization.arrived(123_456_789).is_some());
        assert!(localization.arrived(i64::MAX).is_none());
    }

    #[test]
    fn hidden_latency_makes_the_content_old_and_not_the_stamp() {
        let settings = with_timing(TimingSettings { hidden_latency_ms: 200, ..perfect_timing() });
        for estimate in run(&settings, 1, 4, 8, swing) {
            let content = swing((estimate.stamp_ns - 200 * MS).max(0));
            assert_eq!(position(&estimate), content.state.world_from_body.translation.vector);
            assert!((estimate.rate_body - content.state.twist_body.angular).norm() < 1e-15);
            assert!((estimate.acceleration_origin_body - content.acceleration_origin_body).norm() < 1e-15);
            assert_eq!(estimate.arrival_ns, estimate.stamp_ns);
        }
    }

    #[test]
    fn late_poses_are_older_than_the_rates_beside_them() {
        let settings = with_timing(TimingSettings { pose_latency_ms: 62.0, ..perfect_timing() });
        for estimate in run(&settings, 1, 4, 8, swing).into_iter().skip(20) {
            let (then, now) = (swing(estimate.stamp_ns - 62 * MS), swing(estimate.stamp_ns));
            let seen = then.state.world_from_body;
            assert!((position(&estimate) - seen.translation.vector).norm() < 1e-5);
            assert!(estimate.world_from_body.rotation.angle_to(&seen.rotation) < 1e-5);
            assert!((estimate.rate_body - now.state.twist_body.angular).norm() < 1e-15);
        }
    }

    #[test]
    fn jitter_of_arrival_is_exponential_and_reorders() {
        let settings = with_timing(TimingSettings { latency_ms: 20.0, arrival_jitter_ms: 40.0, ..perfect_timing() });
        let estimates = run(&settings, 2, 320, 16, at_rest);
        assert_eq!(estimates.len(), 20_000);
        let extra: Vec<f64> = estimates.iter().map(|e| (e.arrival_ns - e.stamp_ns) as f64 * 1e-6 - 20.0).collect();
        assert!(extra.iter().all(|&x| x >= 0.0));
        let n = extra.len() as f64;
        assert!((mean(extra.iter().copied()) / 40.0 - 1.0).abs() < 4.0 / n.sqrt());
        assert_share("beyond two means", extra.iter().filter(|&&x| x > 80.0).count(), (-2.0_f64).exp(), extra.len());
        // Neighbours change places when the first waits longer by 16 ms: half of exp(-16/40).
        let mut by_stamp = estimates.clone();
        by_stamp.sort_by_key(|e| e.stamp_ns);
        let swapped = by_stamp.windows(2).filter(|pair| pair[0].arrival_ns > pair[1].arrival_ns).count();
        let share = swapped as f64 / n;
        assert!((share - 0.5 * (-0.4_f64).exp()).abs() < 0.015, "{share}");
        assert!(!estimates.is_sorted_by_key(|e| e.stamp_ns));
    }

    #[test]
    fn jitter_of_the_stamp() {
        let settings = with_timing(TimingSettings { latency_ms: 50.0, stamp_jitter_ms: 3.0, ..perfect_timing() });
        let mut estimates = run(&settings, 2, 160, 16, at_rest);
        estimates.sort_by_key(|e| e.arrival_ns);
        let errors: Vec<f64> =
            (0_i64..).zip(&estimates).map(|(k, e)| (e.stamp_ns - k * 16 * MS) as f64 * 1e-6).collect();
        assert_sigma("stamp", rms(errors.iter().copied()), 3.0, errors.len());
        assert!((0_i64..).zip(&estimates).all(|(k, e)| e.arrival_ns == k * 16 * MS + 50 * MS));
    }

    #[test]
    fn losses_alone_and_in_bursts() {
        let total = 50_000;
        let alone = with_faults(FaultSettings { drop_probability: 0.1, ..FaultSettings::default() });
        let kept = run(&alone, 3, 800, 16, at_rest).len();
        assert_share("drops", total - kept, 0.1, total);

        let bursts =
            with_faults(FaultSettings { burst_rate_hz: 0.5, burst_duration_s: 0.5, ..FaultSettings::default() });
        let estimates = run(&bursts, 3, 800, 16, at_rest);
        let gaps: Vec<f64> = estimates
            .windows(2)
            .map(|pair| (pair[1].stamp_ns - pair[0].stamp_ns) as f64 * 1e-9)
            .filter(|&gap| gap > 0.017)
            .collect();
        // One burst every 1 / 0.5 + 0.5 s; its gap is its length and on average one and a half periods.
        let expected = 800.0 / 2.5;
        assert!((gaps.len() as f64 - expected).abs() < 4.0 * expected.sqrt(), "{}", gaps.len());
        let band = 4.0 / (gaps.len() as f64).sqrt();
        assert!((mean(gaps.iter().copied()) / 0.524 - 1.0).abs() < band, "{}", mean(gaps.iter().copied()));
        assert!(gaps.iter().copied().fold(0.0, f64::max) > 1.5);
    }

    #[test]
    fn duplicates_have_their_own_way_to_go() {
        let mut settings = with_faults(FaultSettings { duplicate_probability: 0.2, ..FaultSettings::default() });
        settings.timing.arrival_jitter_ms = 10.0;
        let mut estimates = run(&settings, 3, 160, 16, swing);
        let copies = estimates.len() - 10_000;
        assert_share("duplicates", copies, 0.2, 10_000);
        estimates.sort_by_key(|e| e.stamp_ns);
        let pairs: Vec<_> = estimates.windows(2).filter(|pair| pair[0].stamp_ns == pair[1].stamp_ns).collect();
        assert_eq!(pairs.len(), copies);
        assert!(
            pairs.iter().all(|pair| same_but_times(&pair[0], &pair[1]) && pair[0].arrival_ns != pair[1].arrival_ns)
        );
    }

    #[test]
    fn outages_and_freezes_keep_to_their_schedule() {
        let outage = Interval { start_s: 1.0, duration_s: 0.5 };
        let frozen = Interval { start_s: 2.0, duration_s: 1.0 };
        let settings =
            with_faults(FaultSettings { outages: vec![outage], freezes: vec![frozen], ..FaultSettings::default() });
        let late = 7 * 1_000 * MS;
        // Schedules count from the first observation.
        let estimates = run(&settings, 3, 4, 16, |time_ns| swing(time_ns + late));
        let since_s = |e: &LocalizationEstimate| (e.stamp_ns - late) as f64 * 1e-9;
        assert!(estimates.iter().all(|e| since_s(e) < 1.0 || since_s(e) >= 1.5));
        let clean = run(&perfect(), 3, 4, 16, |time_ns| swing(time_ns + late));
        let silent = clean.iter().filter(|e| since_s(e) >= 1.0 && since_s(e) < 1.5).count();
        assert_eq!(estimates.len() + silent, clean.len());
        let before = estimates.iter().rfind(|e| since_s(e) < 2.0).unwrap();
        let inside: Vec<_> = estimates.iter().filter(|e| since_s(e) >= 2.0 && since_s(e) < 3.0).collect();
        assert_eq!(inside.len(), 63);
        assert!(inside.iter().all(|e| same_but_times(e, before)));
        assert!(inside.windows(2).all(|pair| pair[1].stamp_ns - pair[0].stamp_ns == 16 * MS));
        let after: Vec<_> = estimates.iter().filter(|e| since_s(e) >= 3.0).collect();
        assert!(after.iter().all(|e| clean.contains(e)));
    }

    #[test]
    fn a_scheduled_jump_holds_and_recovers() {
        let jump = Jump {
            start_s: 1.0,
            duration_s: 0.4,
            recovery_s: 0.8,
            position_m: [0.3, -0.4, 0.0],
            attitude_rad: [0.0, 0.0, 0.5],
            velocity_m_s: [0.0, 0.1, 0.0],
            rate_rad_s: [0.2, 0.0, 0.0],
        };
        let faults = FaultSettings { jumps: vec![jump], ..FaultSettings::default() };
        for honest_confidence in [false, true] {
            let settings = LocalizationSettings { honest_confidence, ..with_faults(faults.clone()) };
            for estimate in run(&settings, 3, 4, 16, at_rest) {
                let t = estimate.stamp_ns as f64 * 1e-9;
                let share = if t < 1.0 { 0.0 } else { ((2.2 - t) / 0.8).clamp(0.0, 1.0) };
                assert!((position(&estimate) - Vector3::new(0.3, -0.4, 0.0) * share).norm() < 1e-12, "{t}");
                assert!((attitude(&estimate) - Vector3::new(0.0, 0.0, 0.5) * share).norm() < 1e-12, "{t}");
                assert!((velocity(&estimate).y - 0.1 * share).abs() < 1e-12);
                assert!((estimate.rate_body.x - 0.2 * share).abs() < 1e-12);
                let honest = match share {
                    0.0 => Confidence::Good,
                    1.0 => Confidence::Lost,
                    _ => Confidence::Poor,
                };
                assert_eq!(estimate.confidence, if honest_confidence { honest } else { Confidence::Good });
            }
        }
    }

    #[test]
    fn fast_motion_loses_features() {
        let random_jumps = JumpSettings {
            rate_hz: 2.0,
            rate_threshold_rad_s: 0.4,
            acceleration_threshold_m_s2: 0.1,
            position_m: 0.5,
            attitude_rad: 0.3,
            rate_rad_s: 0.1,
            duration_s: 0.072,
            recovery_s: 0.0,
        };
        let settings = with_faults(FaultSettings { random_jumps, ..FaultSettings::default() });
        let jumped = |truth: &dyn Fn(i64) -> TrueMotion| -> Vec<LocalizationEstimate> {
            run(&settings, 5, 400, 16, truth).into_iter().filter(|e| position(e).norm() > 0.0).collect()
        };
        assert!(jumped(&at_rest).is_empty());
        let rate = |size: f64| move |time_ns: i64| spinning(time_ns, Vector3::new(0.0, size, 0.0));
        let acceleration = |size: f64| move |time_ns: i64| accelerating(time_ns, Vector3::new(size, 0.0, 0.0));
        assert!(jumped(&rate(0.39)).is_empty());
        assert!(jumped(&acceleration(0.09)).is_empty());
        for during in [jumped(&rate(0.41)), jumped(&acceleration(0.11))] {
            // Five estimates each, then on average half a second until the next.
            let starts = 1 + during.windows(2).filter(|pair| position(&pair[0]) != position(&pair[1])).count();
            let expected = 400.0 / (0.5 + 0.08);
            assert!((starts as f64 - expected).abs() < 4.0 * expected.sqrt(), "{starts} for {expected}");
            assert!((during.len() as f64 / starts as f64 - 5.0).abs() < 0.05);
            assert!(during.iter().all(|e| (position(e).norm() - 0.5).abs() < 1e-12));
            assert!(during.iter().all(|e| (attitude(e).norm() - 0.3).abs() < 1e-12));
            let heading = during.iter().map(position).sum::<Vector3<f64>>() / (0.5 * during.len() as f64);
            assert!(heading.norm() < 4.0 / expected.sqrt(), "directions are even: {heading}");
        }
    }

    #[test]
    fn an_impeller_mode_changes_the_filter_in_flight() {
        let settings = with_imu(|imu| imu.flight_filter = true);
        let mut localization = Localization::new(&settings, 1, ImpellerMode::Off).unwrap();
        let mut last = || {
            let mut rate = 0.0;
            for k in 0.. {
                let time_ns = k * 8 * MS;
                localization.observe(&spinning(time_ns, Vector3::repeat(time_ns as f64 * 1e-9)));
                while let Some(estimate) = localization.arrived(time_ns) {
                    rate = estimate.stamp_ns as f64 * 1e-9 - estimate.rate_body.x;
                }
                if k == 250 {
                    localization.set_impeller_mode(ImpellerMode::Quiet);
                    assert!(rate.abs() < 1e-12);
                }
                if k == 1000 {
                    return rate;
                }
            }
            rate
        };
        assert!((last() - 0.061).abs() < 1e-4);
    }

    #[test]
    fn memory_is_bounded_when_nobody_reads() {
        let mut localization = Localization::new(&perfect(), 1, MODE).unwrap();
        for k in 0..100_000 {
            localization.observe(&at_rest(k * 16 * MS));
        }
        let mut read = 0;
        while localization.arrived(i64::MAX).is_some() {
            read += 1;
        }
        assert!(read < 1000);
        assert_eq!(localization.unread() + read, 100_000);
    }

    #[test]
    fn an_observation_that_is_not_later_is_left_out() {
        let mut localization = Localization::new(&perfect(), 1, MODE).unwrap();
        for time_ns in [0, 16 * MS, 16 * MS, 8 * MS, -5, 32 * MS] {
            localization.observe(&swing(time_ns));
        }
        let stamps: Vec<i64> = std::iter::from_fn(|| localization.arrived(i64::MAX)).map(|e| e.stamp_ns).collect();
        assert_eq!(stamps, [0, 16 * MS, 32 * MS]);
    }
}

mod seeds {
    use super::*;

    /// Everything at once.
    fn everything() -> LocalizationSettings {
        let mut settings = LocalizationSettings::thesis_flight();
        settings.timing.stamp_jitter_ms = 1.0;
        settings.faults.duplicate_probability = 0.1;
        settings.imu.accelerometer.bias_sigma = 0.05;
        settings
    }

    fn by_stamp(settings: &LocalizationSettings) -> Vec<LocalizationEstimate> {
        let mut estimates = run(settings, 9, 30, 16, swing);
        estimates.sort_by_key(|e| (e.stamp_ns, e.arrival_ns));
        estimates
    }

    /// What this code gave when it was written: every machine gives the same, and who changes it changes every simulation.
    #[test]
    fn golden_bits_of_a_seed() {
        let mut hash: u64 = 0xcbf2_9ce4_8422_2325;
        let mut feed = |bits: u64| {
            for byte in bits.to_le_bytes() {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
            }
        };
        for e in run(&everything(), 9, 30, 16, swing) {
            feed(e.stamp_ns.cast_unsigned());
            feed(e.arrival_ns.cast_unsigned());
            let pose = e.world_from_body;
            let vectors = [pose.translation.vector, e.velocity_origin_world, e.rate_body, e.acceleration_origin_body];
            vectors.iter().flatten().chain(pose.rotation.coords.iter()).for_each(|x| feed(x.to_bits()));
        }
        assert_eq!(hash, 0x0805_f8b6_a323_cbfb, "{hash:#x}");
    }

    #[test]
    fn a_seed_repeats_and_another_differs() {
        let estimates = run(&everything(), 9, 10, 16, swing);
        assert_eq!(run(&everything(), 9, 10, 16, swing), estimates);
        assert_ne!(run(&everything(), 10, 10, 16, swing), estimates);
    }

    /// Switching one source off changes what it feeds and nothing else.
    #[test]
    fn sources_do_not_share_numbers() {
        let all = by_stamp(&everything());
        let without = |change: fn(&mut LocalizationSettings)| {
            let mut settings = everything();
            change(&mut settings);
            by_stamp(&settings)
        };
        let position = |e: &LocalizationEstimate| e.world_from_body.translation;
        let rotation = |e: &LocalizationEstimate| e.world_from_body.rotation;

        let other = without(|s| (s.pose.position_noise_m, s.pose.position_drift_m) = (0.0, 0.0));
        assert_eq!(other.len(), all.len());
        for (a, b) in other.iter().zip(&all) {
            assert_ne!(position(a), position(b));
            let same = LocalizationEstimate { world_from_body: Pose::from_parts(position(b), rotation(a)), ..*a };
            assert_eq!(same, *b);
        }
        let other = without(|s| (s.pose.attitude_noise_rad, s.pose.attitude_drift_rad) = (0.0, 0.0));
        for (a, b) in other.iter().zip(&all) {
            assert_ne!(rotation(a), rotation(b));
            assert_eq!(
                (position(a), a.velocity_origin_world, a.rate_body),
                (position(b), b.velocity_origin_world, b.rate_body)
            );
            assert_eq!(
                (a.stamp_ns, a.arrival_ns, a.acceleration_origin_body),
                (b.stamp_ns, b.arrival_ns, b.acceleration_origin_body)
            );
        }
        let other = without(|s| s.imu.accelerometer.noise_density = 0.0);
        for (a, b) in other.iter().zip(&all) {
            let same = LocalizationEstimate { acceleration_origin_body: b.acceleration_origin_body, ..*a };
            assert_eq!(same, *b);
        }
        let other = without(|s| s.imu.gyro.markov_sigma = 0.0);
        for (a, b) in other.iter().zip(&all) {
            let same = LocalizationEstimate {
                rate_body: b.rate_body,
                acceleration_origin_body: b.acceleration_origin_body,
                ..*a
            };
            assert_eq!(same, *b);
        }
        // Losing none adds estimates and leaves the others alone.
        let other = without(|s| (s.faults.drop_probability, s.faults.burst_rate_hz) = (0.0, 0.0));
        assert!(other.len() > all.len());
        assert!(all.iter().all(|e| other.contains(e)));
        let other = without(|s| s.faults.duplicate_probability = 0.0);
        assert!(other.len() < all.len());
        assert!(other.iter().all(|e| all.contains(e)));
        let other = without(|s| s.timing.arrival_jitter_ms = 0.0);
        assert_eq!(other.len(), all.len());
        assert!(
            other.iter().zip(&all).filter(|(a, b)| a.stamp_ns == b.stamp_ns && same_but_times(a, b)).count()
                > all.len() * 9 / 10
        );
    }

    #[test]
    fn the_whole_chain_by_hand_is_what_is_published() {
        let settings =
            LocalizationSettings { pose: perfect().pose, timing: perfect_timing(), ..LocalizationSettings::nominal() };
        let mut imu = ImuModel::new(&settings.imu, Vector3::zeros(), 9);
        let mut chain = ImuChain::new(&settings.imu, Vector3::zeros(), MODE);
        let mut published = run(&settings, 9, 4, 8, swing).into_iter();
        for k in 0..500 {
            let truth = swing(k * 8 * MS);
            let sample = imu.measure(&truth);
            // Of the true bias the flight software lags a step of the walk.
            let filtered = chain.update(&sample, &imu.bias());
            if k % 2 == 0 {
                let estimate = published.next().unwrap();
                assert!((estimate.rate_body - filtered.rate_body).norm() < 1e-5);
                let expected = chain.acceleration_origin(&filtered, &truth.state.world_from_body.rotation);
                assert!((estimate.acceleration_origin_body - expected).norm() < 2e-4);
            }
        }
    }
}

mod settings {
    use super::*;

    #[derive(serde::Deserialize)]
    struct Named {
        sensing: SensingPreset,
    }

    #[test]
    fn presets_are_valid_and_survive_a_file() {
        for preset in
            [SensingPreset::Perfect, SensingPreset::Nominal, SensingPreset::ThesisFlight, SensingPreset::Bumble]
        {
            let settings = preset.settings();
            settings.check().unwrap();
            let text = toml::to_string(&settings).unwrap();
            assert_eq!(toml::from_str::<LocalizationSettings>(&text).unwrap(), settings);
        }
        assert_eq!(toml::from_str::<LocalizationSettings>("").unwrap(), LocalizationSettings::nominal());
        let named: Named = toml::from_str("sensing = \"thesis-flight\"").unwrap();
        assert_eq!(named.sensing, SensingPreset::ThesisFlight);
    }

    #[test]
    fn unknown_keys_are_refused_in_every_table() {
        for text in [
            "colour = 1",
            "[imu]\ncolour = 1",
            "[imu.gyro]\ncolour = 1",
            "[pose]\ncolour = 1",
            "[timing]\ncolour = 1",
            "[faults]\ncolour = 1",
            "[faults.random_jumps]\ncolour = 1",
            "[[faults.jumps]]\ncolour = 1",
            "[[faults.outages]]\nstart_s = 1.0\nduration_s = 1.0\ncolour = 1",
        ] {
            let message = toml::from_str::<LocalizationSettings>(text).unwrap_err().to_string();
            assert!(message.contains("colour"), "{text}: {message}");
        }
    }

    /// Every number of the settings, one at a time, far above its range and not a number: refused under its own name.
    #[test]
    fn every_key_is_checked_under_its_own_name() {
        let mut settings = LocalizationSettings::nominal();
        settings.faults.outages.push(Interval { start_s: 0.0, duration_s: 0.0 });
        settings.faults.freezes.push(Interval { start_s: 0.0, duration_s: 0.0 });
        settings.faults.jumps.push(Jump::default());
        let table = toml::Table::try_from(&settings).unwrap();
        let mut paths = Vec::new();
        number_paths(&toml::Value::Table(table.clone()), String::new(), &mut paths);
        assert_eq!(paths.len(), 73, "{paths:?}");
        for path in &paths {
            let of_any_length = ["jitter_ms", ".latency_ms", "pose_latency_ms"];
            let is_integer = path.ends_with("_ms") && !of_any_length.iter().any(|end| path.ends_with(end));
            // Ranges and thresholds have no upper end.
            let open_ended = path.ends_with("range") || path.contains("threshold");
            let bad: Vec<toml::Value> = if is_integer {
                vec![7.into(), 100_000.into()]
            } else if open_ended {
                vec![(-1.0).into(), f64::NAN.into()]
            } else {
                vec![1e9.into(), (-1e9).into(), f64::NAN.into()]
            };
            for value in bad {
                let mut changed = toml::Value::Table(table.clone());
                *place(&mut changed, path) = value.clone();
                let settings: LocalizationSettings = changed.try_into().unwrap();
                match Localization::new(&settings, 1, MODE).map(|_| ()).unwrap_err() {
                    AstrobeeError::SensingOutOfRange { key, .. } => {
                        let plain: String =
                            path.split('.').filter(|part| part.parse::<usize>().is_err()).collect::<Vec<_>>().join(".");
                        assert_eq!(key, plain, "{value}");
                    }
                    other => panic!("{path} = {value}: {other}"),
                }
            }
        }
    }

    fn number_paths(value: &toml::Value, path: String, paths: &mut Vec<String>) {
        let below = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
        match value {
            toml::Value::Table(table) => table.iter().for_each(|(k, v)| number_paths(v, below(k), paths)),
            toml::Value::Array(array) => {
                array.iter().enumerate().for_each(|(k, v)| number_paths(v, below(&k.to_string()), paths));
            }
            toml::Value::Integer(_) | toml::Value::Float(_) => paths.push(path),
            _ => {}
        }
    }

    fn place<'a>(value: &'a mut toml::Value, path: &str) -> &'a mut toml::Value {
        path.split('.').fold(value, |value, part| match value {
            toml::Value::Array(array) => &mut array[part.parse::<usize>().unwrap()],
            toml::Value::Table(table) => &mut table[part],
            _ => panic!("{part}"),
        })
    }

    #[test]
    fn the_message_says_what_is_accepted() {
        let mut settings = LocalizationSettings::nominal();
        settings.timing.publish_interval_ms = 20;
        let error = settings.check().unwrap_err();
        assert_eq!(error.code(), "T025");
        assert_eq!(
            error.to_string(),
            "sensing: `timing.publish_interval_ms` is 20, it must be 8 to 1000, a whole number of `imu.sample_interval_ms`"
        );
    }
}
