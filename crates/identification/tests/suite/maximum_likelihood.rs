//! Maximum likelihood on simulated logs: accuracy, honesty, robustness, from any start. Noise levels are never given.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

use crate::exact_motion::{Multisine, Run, errors, is_consistent};
use crate::random::Random;
use argmin::core::{CostFunction, Executor, Gradient, State};
use argmin::solver::conjugategradient::NonlinearConjugateGradient;
use argmin::solver::conjugategradient::beta::PolakRibiere;
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use tumble_identification::dynamics::InertialParameters;
use tumble_identification::lie::{LieGroup, Wrench};
use tumble_identification::nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};
use tumble_identification::{
    Identification, LikelihoodCost, LikelihoodEstimate, MaximumLikelihood, MotionSample, Noise, Nuisance, Nuisances,
    Settings, Warning, WrenchTiming, identify,
};

/// 99.9 % of a chi-square of ten.
const LARGEST_NEES: f64 = 29.6;

/// One standard deviation per sample and axis.
#[derive(Clone, Copy)]
struct Levels {
    pose: f64,
    torque: f64,
    force: f64,
    all_columns: bool,
}

const REALISTIC: Levels = Levels { pose: 1e-3, torque: 1e-4, force: 1e-3, all_columns: false };

fn body(mass: f64, center: [f64; 3], moments: [f64; 3], axes: u64) -> InertialParameters<f64> {
    let axes = Random::new(axes).attitude().to_rotation_matrix().into_inner();
    let inertia = axes * Matrix3::from_diagonal(&Vector3::from(moments)) * axes.transpose();
    InertialParameters::about_com(mass, Vector3::from(center), inertia)
}

fn cubesat(axes: u64) -> InertialParameters<f64> {
    body(9.41, [0.031, -0.017, 0.052], [0.161, 0.139, 0.172], axes)
}

fn plate(axes: u64) -> InertialParameters<f64> {
    body(6.0, [0.02, 0.03, 0.0], [0.08, 0.11, 0.19], axes)
}

/// A multisine at 62.5 Hz.
fn exact(
    body: InertialParameters<f64>,
    duration_s: f64,
    held: bool,
    gravity: Vector3<f64>,
    seed: u64,
) -> Vec<MotionSample> {
    driven(body, [0.028, 0.28], duration_s, held, gravity, seed)
}

/// A multisine of this torque and force.
fn driven(
    body: InertialParameters<f64>,
    [torque, force]: [f64; 2],
    duration_s: f64,
    held: bool,
    gravity: Vector3<f64>,
    seed: u64,
) -> Vec<MotionSample> {
    let signal = Multisine::random(&mut Random::new(seed), torque, force, (0.31, 2.83), 3);
    let wrench = |t: f64| signal.at(t);
    let mut run = Run::new(body, &wrench, held);
    (run.step_ns, run.substep_s, run.samples) = (16_000_000, 4e-3, (duration_s / 0.016) as usize);
    run.gravity_world = gravity;
    run.record()
}

fn add_noise(record: &mut [MotionSample], levels: Levels, seed: u64) {
    let mut random = Random::new(1000 + seed);
    let Levels { pose, torque, force, all_columns } = levels;
    for sample in record {
        sample.world_from_body.as_mut().unwrap().translation.vector += random.normal3(pose);
        sample.world_from_body.as_mut().unwrap().rotation *=
            <UnitQuaternion<f64> as LieGroup>::exp(&random.normal3(pose));
        sample.wrench_body =
            sample.wrench_body.map(|w| Wrench::new(w.torque + random.normal3(torque), w.force + random.normal3(force)));
        if all_columns {
            sample.rate_body = sample.rate_body.map(|w| w + random.normal3(pose));
            sample.velocity_origin_world = sample.velocity_origin_world.map(|v| v + random.normal3(pose));
            sample.acceleration_origin_body = sample.acceleration_origin_body.map(|a| a + random.normal3(10.0 * pose));
        } else {
            (sample.rate_body, sample.velocity_origin_world, sample.acceleration_origin_body) = (None, None, None);
        }
    }
}

fn log(body: InertialParameters<f64>, duration_s: f64, levels: Levels, seed: u64) -> Vec<MotionSample> {
    let mut record = exact(body, duration_s, true, Vector3::zeros(), seed);
    add_noise(&mut record, levels, seed);
    record
}

fn nees(estimate: &SVector<f64, 10>, covariance: &SMatrix<f64, 10, 10>, truth: &InertialParameters<f64>) -> f64 {
    let scale = covariance.diagonal().map(|v| 1.0 / v.sqrt());
    let scaled = (estimate - truth.to_vector()).component_mul(&scale);
    let correlation = covariance.map_with_location(|i, j, v| v * scale[i] * scale[j]);
    scaled.dot(&correlation.cholesky().unwrap().solve(&scaled))
}

fn nees_of(found: &LikelihoodEstimate, truth: &InertialParameters<f64>) -> f64 {
    nees(&found.unconstrained, &found.covariance, truth)
}

fn likelihood() -> MaximumLikelihood {
    MaximumLikelihood::default()
}

#[test]
fn realistic_logs_by_the_default_method() {
    let rough = Levels { torque: 1e-3, force: 1e-2, ..REALISTIC };
    let everything = Levels { all_columns: true, ..REALISTIC };
    for (name, of, duration_s, levels, seeds, bounds) in [
        ("cubesat", cubesat as fn(u64) -> _, 120.0, REALISTIC, 0..3, [1e-3, 1e-4, 1e-3]),
        ("cubesat, all columns", cubesat, 120.0, everything, 3..5, [1e-3, 1e-4, 1e-3]),
        ("plate", plate, 60.0, rough, 5..10, [4e-3, 6e-4, 6e-3]),
    ] {
        for seed in seeds {
            let body = of(seed);
            let found = identify(&log(body, duration_s, levels, 100 + seed), &Settings::default()).unwrap();
            assert_eq!(found.method, "maximum-likelihood");
            let estimate = found.estimate.unwrap();
            let found_errors = errors(&estimate.parameters, &body);
            let information = found.information.solve(&found.scale.parameter_magnitudes()).unwrap();
            let nees = nees(&information, &estimate.covariance, &body);
            println!("{name} {seed}: {found_errors:?} NEES {nees:.1} active {}", estimate.lmi_active);
            assert!(found_errors.iter().zip(&bounds).all(|(e, b)| e < b), "{name} {seed}: {found_errors:?}");
            assert!(nees < LARGEST_NEES && is_consistent(&estimate.parameters), "{name} {seed}: NEES {nees}");
        }
    }
}

/// Mean NEES of 24 runs: 10 +- 3 at 99.9 %. Of 240 intervals of 95 % at least 89 % hold the truth with the same chance.
#[test]
fn covariance_is_honest() {
    for (name, of, levels) in [
        ("cubesat", cubesat as fn(u64) -> _, REALISTIC),
        ("cubesat, 5 mm", cubesat, Levels { pose: 5e-3, ..REALISTIC }),
        ("plate", plate, REALISTIC),
    ] {
        let (mut sum, mut inside, runs) = (0.0, 0, 24);
        for seed in 0..runs {
            let body = of(seed);
            let found = likelihood().estimate(&log(body, 20.0, levels, 300 + seed)).unwrap();
            sum += nees_of(&found, &body);
            let error = found.unconstrained - body.to_vector();
            inside += (0..10).filter(|&i| error[i].abs() < 1.96 * found.covariance[(i, i)].sqrt()).count();
            assert!(is_consistent(&found.parameters));
        }
        let (mean, coverage) = (sum / runs as f64, inside as f64 / (10 * runs) as f64);
        println!("{name}: NEES {mean:.2}, coverage {coverage:.3}");
        assert!((7.0..13.0).contains(&mean), "{name}: NEES {mean}");
        assert!(coverage > 0.89, "{name}: coverage {coverage}");
    }
}

#[test]
fn any_start_leads_to_the_same_estimate() {
    let body = cubesat(1);
    let record = log(body, 20.0, REALISTIC, 1);
    let reference = likelihood().estimate(&record).unwrap();
    for factor in [0.1, 0.3, 3.0, 10.0, 30.0] {
        let start =
            InertialParameters::about_com(10.0 * factor, Vector3::zeros(), Matrix3::identity() * (0.15 * factor));
        let found = MaximumLikelihood { start, ..likelihood() }.estimate(&record).unwrap();
        let change = found.unconstrained - reference.unconstrained;
        let worst = (0..10).map(|i| change[i].abs() / reference.covariance[(i, i)].sqrt()).fold(0.0, f64::max);
        println!("x{factor}: {} iterations, {worst:.1e} sigma", found.iterations.len());
        assert!(worst < 0.05, "x{factor}: {worst} sigma");
    }
}

/// One per cent of poses, and of wrenches, are off by ten standard deviations.
/// First states from such poses are far off, and so good a wrench ties them over seconds: without doubt of the wrench at first
/// there is no optimum, or a wrong one.
#[test]
fn poor_poses_and_a_good_wrench() {
    let levels = Levels { pose: 0.05, torque: 1e-3, force: 1e-2, all_columns: false };
    for seed in 40..46 {
        let body = body(7.0, [0.02, 0.03, 0.0], [0.03, 0.09, 0.11], seed - 40);
        let mut record = driven(body, [0.2, 2.0], 10.0, true, Vector3::zeros(), seed);
        add_noise(&mut record, levels, seed);
        let found = likelihood().estimate(&record).unwrap();
        let nees = nees_of(&found, &body);
        println!("{seed}: NEES {nees:.1}, {} iterations", found.iterations.len());
        assert!(nees < LARGEST_NEES && is_consistent(&found.parameters), "{seed}: NEES {nees}");
    }
}

#[test]
fn spikes_do_little() {
    let (mut clean, mut poses, mut wrenches) = ([0.0; 2], [0.0; 2], [0.0; 2]);
    let runs = 8;
    for seed in 0..runs {
        let body = cubesat(seed);
        let record = log(body, 30.0, REALISTIC, 500 + seed);
        let mut random = Random::new(seed);
        let mut spiked = record.clone();
        for sample in &mut spiked {
            if random.uniform(0.0, 1.0) < 0.01 {
                sample.world_from_body.as_mut().unwrap().translation.vector += random.direction() * 1.7e-2;
            }
            if random.uniform(0.0, 1.0) < 0.01 {
                let turn = random.direction() * 1.7e-2;
                sample.world_from_body.as_mut().unwrap().rotation *= <UnitQuaternion<f64> as LieGroup>::exp(&turn);
            }
        }
        let mut pulsed = record.clone();
        for sample in &mut pulsed {
            if random.uniform(0.0, 1.0) < 0.01 {
                let (torque, force) = (random.direction() * 1.7e-3, random.direction() * 1.7e-2);
                sample.wrench_body = sample.wrench_body.map(|w| Wrench::new(w.torque + torque, w.force + force));
            }
        }
        for (sums, record) in [(&mut clean, &record), (&mut poses, &spiked), (&mut wrenches, &pulsed)] {
            let found = likelihood().estimate(record).unwrap();
            let whitened = nees_of(&found, &body);
            let trace: f64 = found.std.iter().map(|s| s.ln()).sum();
            sums[0] += whitened / runs as f64;
            sums[1] += trace / 10.0 / runs as f64;
        }
    }
    println!("clean {clean:?}, pose spikes {poses:?}, wrench spikes {wrenches:?}");
    for (name, [nees, log_sigma]) in [("clean", clean), ("poses", poses), ("wrenches", wrenches)] {
        // Mean of eight: 10 +- 5.2 at 99.9 %.
        assert!((4.8..15.2).contains(&nees), "{name}: NEES {nees}");
        let inflation = (log_sigma - clean[1]).exp();
        assert!(inflation < 1.15, "{name}: sigma {inflation} times that of the clean log");
    }
}

#[test]
fn true_step_lengths_gaps_and_missing_wrenches() {
    let body = cubesat(2);
    let mut worst: f64 = 0.0;
    for seed in 0..4 {
        let signal = Multisine::random(&mut Random::new(seed), 0.028, 0.28, (0.31, 2.83), 3);
        let wrench = |t: f64| signal.at(t);
        let mut run = Run::new(body, &wrench, true);
        (run.step_ns, run.substep_s, run.samples) = (4_000_000, 4e-3, 10_000);
        // Held in a fast loop and logged in steps of 12 to 20 ms; half a second and one sample in thirty are lost.
        let fast = run.record();
        let mut random = Random::new(70 + seed);
        let (mut record, mut kept, mut k) = (Vec::new(), Vec::new(), 0);
        while k < fast.len() {
            if !(4000..4125).contains(&k) && random.uniform(0.0, 1.0) > 1.0 / 30.0 {
                record.push(fast[k]);
                kept.push(k);
            }
            k += random.uniform(3.0, 6.0) as usize;
        }
        // The wrench over each logged step is what the flight computer averaged.
        for (sample, pair) in record.iter_mut().zip(kept.windows(2)) {
            if pair[1] - pair[0] < 8 {
                let mut sum = Wrench::zero();
                for inner in &fast[pair[0]..pair[1]] {
                    sum += inner.wrench_body.unwrap();
                }
                sample.wrench_body = Some(sum * (1.0 / (pair[1] - pair[0]) as f64));
            }
        }
        add_noise(&mut record, REALISTIC, seed);
        let found = identify(&record, &Settings { method: "maximum-likelihood", ..Settings::default() }).unwrap();
        assert!(found.warnings.iter().any(|w| matches!(w, Warning::Gaps { .. })), "{:?}", found.warnings);
        let estimate = found.estimate.unwrap();
        let nees = nees(&estimate.parameters.to_vector(), &estimate.covariance, &body);
        println!("{:?} NEES {nees:.1}", errors(&estimate.parameters, &body));
        worst = worst.max(nees);
        assert!(errors(&estimate.parameters, &body)[0] < 4e-3);

        for sample in record.iter_mut().step_by(50) {
            sample.wrench_body = None;
        }
        let found = identify(&record, &Settings { method: "maximum-likelihood", ..Settings::default() }).unwrap();
        assert!(found.warnings.contains(&Warning::HeldWrenches { samples: record.len().div_ceil(50) }));
    }
    assert!(worst < LARGEST_NEES, "{worst}");
}

#[test]
fn sampled_wrenches_and_gravity() {
    let runs = 8;
    for (held, gravity) in [(false, Vector3::zeros()), (true, Vector3::new(0.3, -1.2, 0.8))] {
        let mut sum = 0.0;
        for seed in 0..runs {
            let body = cubesat(seed);
            let mut record = exact(body, 20.0, held, gravity, 600 + seed);
            add_noise(&mut record, REALISTIC, 600 + seed);
            let wrench_timing = if held { WrenchTiming::Held } else { WrenchTiming::Sampled };
            let found =
                MaximumLikelihood { wrench_timing, gravity_world: gravity, ..likelihood() }.estimate(&record).unwrap();
            sum += nees_of(&found, &body);
        }
        let mean = sum / runs as f64;
        println!("held {held}: NEES {mean}");
        assert!((4.8..15.2).contains(&mean), "held {held}: NEES {mean}");
    }
}

#[test]
fn scales_and_accelerometer_are_calibrated() {
    let truth = [
        (Nuisance::ForceScale(1), 1.08),
        (Nuisance::ForceScale(2), 0.95),
        (Nuisance::AccelerometerBias(0), 0.02),
        (Nuisance::AccelerometerBias(1), -0.01),
        (Nuisance::AccelerometerBias(2), 0.03),
        (Nuisance::AccelerometerScale(0), 1.05),
        (Nuisance::AccelerometerScale(1), 1.0),
        (Nuisance::AccelerometerScale(2), 0.97),
    ];
    let nuisances: Vec<Nuisance> = truth.iter().map(|(nuisance, _)| *nuisance).collect();
    let (mut sum, mut of_body, runs) = (0.0, 0.0, 6);
    for seed in 0..runs {
        let body = cubesat(seed);
        let mut record = log(body, 40.0, Levels { all_columns: true, ..REALISTIC }, 700 + seed);
        for sample in &mut record {
            sample.wrench_body = sample
                .wrench_body
                .map(|w| Wrench::new(w.torque, w.force.component_div(&Vector3::new(1.0, 1.08, 0.95))));
            sample.acceleration_origin_body = sample
                .acceleration_origin_body
                .map(|a| a.component_mul(&Vector3::new(1.05, 1.0, 0.97)) + Vector3::new(0.02, -0.01, 0.03));
        }
        let found = MaximumLikelihood { nuisances: nuisances.clone(), ..likelihood() }.estimate(&record).unwrap();
        for (estimate, (_, value)) in found.nuisances.iter().zip(&truth) {
            let (found, std) = (estimate.value.unwrap(), estimate.std.unwrap());
            sum += ((found - value) / std).powi(2) / (truth.len() * runs as usize) as f64;
            assert!(std < 0.03);
        }
        of_body += nees_of(&found, &body) / runs as f64;
    }
    println!("nuisances: mean square in sigmas {sum:.2}, NEES of the body {of_body:.1}");
    // Means of 48 and of 6: 99.9 %.
    assert!((0.4..1.8).contains(&sum) && (4.0..16.5).contains(&of_body), "{sum} {of_body}");
}

/// Poses late by less than a step, by one and a half and by many.
#[test]
fn delays_are_found() {
    for (late, runs) in [(1, 4), (6, 4), (25, 4)] {
        let (mut sum, mut of_body) = (0.0, 0.0);
        for seed in 0..runs {
            let body = cubesat(seed);
            let signal = Multisine::random(&mut Random::new(seed), 0.028, 0.28, (0.31, 2.83), 3);
            // Held for four parts of a step.
            let wrench = |t: f64| signal.at((t / 0.016 + 1e-6).floor() * 0.016);
            let mut run = Run::new(body, &wrench, true);
            (run.step_ns, run.substep_s, run.samples) = (4_000_000, 4e-3, 7600);
            let fast = run.record();
            let mut record: Vec<MotionSample> = (7..1900)
                .map(|k| {
                    let MotionSample { time_ns, wrench_body, .. } = fast[4 * k];
                    MotionSample { time_ns, wrench_body, ..fast[4 * k - late] }
                })
                .collect();
            add_noise(&mut record, REALISTIC, 800 + seed);
            let found =
                MaximumLikelihood { nuisances: vec![Nuisance::Delay], ..likelihood() }.estimate(&record).unwrap();
            let error = found.delay_s().unwrap() - 4e-3 * late as f64;
            let std = found.nuisances[0].std.unwrap();
            sum += (error / std).powi(2) / runs as f64;
            of_body += nees_of(&found, &body) / runs as f64;
            assert!(std < 3e-4 && error.abs() < 1e-3, "{late}: {error}");
            if seed == 0 {
                let settings = Settings {
                    method: "maximum-likelihood",
                    estimate: Nuisances::of(&[Nuisance::Delay]),
                    ..Settings::default()
                };
                assert_eq!(identify(&record, &settings).unwrap().delay_s, found.delay_s());
            }
        }
        println!("{late}: mean square in sigmas {sum:.2}, NEES of the body {of_body:.1}");
        // 99.9 % of a chi-square of four over four; 10 +- 7.4.
        assert!(sum < 4.6 && of_body < 17.5, "{late}: {sum} {of_body}");
    }
}

#[test]
fn coloured_noise_is_noticed_and_white_noise_is_not() {
    let coloured = |found: &Identification| {
        found
            .warnings
            .iter()
            .any(|w| matches!(w, Warning::ColouredNoise { sigma_inflation, .. } if *sigma_inflation > 1.2))
    };
    for seed in 0..6 {
        let mut record = log(cubesat(seed), 30.0, REALISTIC, 900 + seed);
        let white = identify(&record, &Settings::default()).unwrap();
        assert!(!coloured(&white) && white.method == "maximum-likelihood", "{seed}: {}", white.method);
        // A localisation whose error wanders: half of it is still there at the next sample.
        let (mut random, mut error) = (Random::new(seed), Vector3::zeros());
        for sample in &mut record {
            error = error * 0.5 + random.normal3(2e-3);
            sample.world_from_body.as_mut().unwrap().translation.vector += error;
        }
        let asked = Settings { method: "maximum-likelihood", ..Settings::default() };
        assert!(coloured(&identify(&record, &asked).unwrap()), "{seed}");
        // Left to itself, the library takes a model of the sensors, which makes it right.
        let found = identify(&record, &Settings::default()).unwrap();
        assert_eq!(found.method, "flight-likelihood", "{seed}");
        let estimate = found.estimate.unwrap();
        let off = (estimate.parameters.mass - cubesat(seed).mass) / estimate.std.mass_kg;
        assert!(found.verdict.is_identified() && off.abs() < 4.0, "{seed}: {off} sigma, {:?}", found.verdict);
    }
}

#[test]
fn a_table_shows_what_planar_motion_can_show() {
    let disc = InertialParameters::about_com(
        11.7,
        Vector3::new(-0.02, 0.045, 0.0),
        Matrix3::from_diagonal(&Vector3::new(0.28, 0.18, 0.31)),
    );
    for seed in 0..6 {
        let signal = Multisine::random(&mut Random::new(40 + seed), 0.03, 0.3, (0.31, 2.83), 3);
        let planar = |t: f64| {
            let w = signal.at(t);
            Wrench::new(Vector3::new(0.0, 0.0, w.torque.z), Vector3::new(w.force.x, w.force.y, 0.0))
        };
        let mut run = Run::new(disc, &planar, true);
        (run.step_ns, run.substep_s, run.samples) = (16_000_000, 4e-3, 2500);
        let mut record = run.record();
        add_noise(&mut record, REALISTIC, 50 + seed);
        let found = identify(&record, &Settings::default()).unwrap();
        assert_eq!(found.method, "flight-likelihood", "{seed}");
        assert!(found.is_on_table() && found.verdict.is_identified(), "{seed}: {:?}", found.verdict);
        let known = found.estimate.or(found.regularised).unwrap();
        let (mass, std) = (known.parameters.mass, known.std.mass_kg);
        println!("{seed}: rank {}, mass {mass:.4} +- {std:.4}", found.rank);
        assert!((mass - 11.7).abs() < 0.01 * 11.7, "{seed}: {mass} +- {std}");
        let axis = known.parameters.inertia_about_com()[(2, 2)];
        assert!((axis - 0.31).abs() < 0.01 * 0.31, "{seed}: {axis}");
        // What is not shown is either named or known to be uncertain.
        let loose = (0..2).all(|i| known.std.inertia_about_com_kg_m2[(i, i)] > 0.005);
        assert!(found.rank < 10 || loose, "{seed}: {:?}", known.std);
    }
}

/// A disc on a table that slopes by so much acceleration along x, 40 s, pushed in the plane by a signal of this seed.
fn on_a_table(slope_m_s2: f64, seed: u64) -> (InertialParameters<f64>, Vec<MotionSample>) {
    let inertia = Matrix3::from_diagonal(&Vector3::new(0.28, 0.18, 0.31));
    let disc = InertialParameters::about_com(11.7, Vector3::new(-0.02, 0.045, 0.0), inertia);
    let signal = Multisine::random(&mut Random::new(seed), 0.03, 0.3, (0.31, 2.83), 3);
    let planar = |t: f64| {
        let w = signal.at(t);
        Wrench::new(Vector3::new(0.0, 0.0, w.torque.z), Vector3::new(w.force.x, w.force.y, 0.0))
    };
    let mut run = Run::new(disc, &planar, true);
    (run.step_ns, run.substep_s, run.samples) = (16_000_000, 4e-3, 2500);
    run.gravity_world = Vector3::x() * slope_m_s2;
    let mut record = run.record();
    add_noise(&mut record, REALISTIC, 70 + seed);
    (disc, record)
}

#[test]
fn the_slope_of_a_table_that_nobody_tells_biases_nothing() {
    for seed in 0..4 {
        let (disc, record) = on_a_table(2e-3, 60 + seed);
        let found = identify(&record, &Settings::default()).unwrap();
        assert!(found.is_on_table() && found.verdict.is_identified(), "{seed}: {:?}", found.verdict);
        let known = found.regularised.unwrap();
        let off = (known.parameters.mass - disc.mass) / known.std.mass_kg;
        println!("{seed}: {:.4} +- {:.4} kg, {off:.2} sigma", known.parameters.mass, known.std.mass_kg);
        assert!(off.abs() < 4.0 && known.std.mass_kg < 0.02 * disc.mass, "{seed}: {off}");
    }
}

#[test]
fn a_table_whose_wrench_is_another_flights_is_not_identified() {
    for seed in 0..4 {
        let (_, mut record) = on_a_table(0.0, 80 + seed);
        let (_, other) = on_a_table(0.0, 90 + seed);
        for (sample, other) in record.iter_mut().zip(other) {
            sample.wrench_body = other.wrench_body;
        }
        let found = identify(&record, &Settings::default()).unwrap();
        assert!(found.is_on_table() && !found.verdict.is_identified(), "{seed}: {:?}", found.verdict);
    }
}

/// What a localisation may wander must not explain away a motion that does not follow its wrench.
#[test]
fn a_flight_whose_wrench_is_another_flights_is_not_identified() {
    for seed in 0..4 {
        let mut record = log(cubesat(seed), 30.0, REALISTIC, 100 + seed);
        let other = log(cubesat(seed), 30.0, REALISTIC, 200 + seed);
        for (sample, other) in record.iter_mut().zip(other) {
            sample.wrench_body = other.wrench_body;
        }
        for method in ["auto", "flight-likelihood"] {
            let found = identify(&record, &Settings { method, ..Settings::default() }).unwrap();
            let mass = found.estimate.map(|estimate| estimate.parameters.mass);
            println!("{seed}, {method}: {}, mass {mass:?}", found.verdict.is_identified());
            assert!(!found.verdict.is_identified(), "{seed}, {method}: {:?}, {mass:?}", found.verdict);
        }
    }
}

#[test]
fn what_the_data_do_not_say_is_left_to_the_regressions() {
    let settings = Settings { method: "maximum-likelihood", ..Settings::default() };
    let body = cubesat(1);
    let mut record = exact(body, 20.0, true, Vector3::zeros(), 1);
    for sample in &mut record {
        sample.wrench_body = Some(Wrench::zero());
    }
    add_noise(&mut record, Levels { torque: 0.0, force: 0.0, ..REALISTIC }, 1);
    let found = identify(&record, &settings).unwrap();
    assert!(found.rank < 10 && found.estimate.is_none() && found.method != "maximum-likelihood");
    assert!(found.warnings.contains(&Warning::ZeroWrench), "{:?}", found.warnings);

    let signal = Multisine::random(&mut Random::new(12), 0.028, 0.28, (0.31, 2.83), 3);
    let torques = |t: f64| Wrench::new(signal.at(t).torque, Vector3::zeros());
    let mut run = Run::new(body, &torques, true);
    (run.step_ns, run.samples) = (16_000_000, 1500);
    let mut record = run.record();
    add_noise(&mut record, REALISTIC, 2);
    let found = identify(&record, &settings).unwrap();
    assert!(found.rank < 10 && found.estimate.is_none(), "{} {:?}", found.rank, found.estimate);
    assert!(!found.warnings.iter().any(|warning| matches!(warning, Warning::NotCalibrated { .. })));

    // The calibration that was asked for goes missing with it, and that is said.
    let estimate = Nuisances::of(&[Nuisance::Delay]);
    let found = identify(&record, &Settings { estimate, ..settings }).unwrap();
    assert!(found.calibration.is_empty());
    assert!(found.warnings.contains(&Warning::NotCalibrated { rows: record.len() }), "{:?}", found.warnings);
}

/// A record with its noise known, and the likelihood from a body that is some per cent off.
fn near_the_truth() -> (MaximumLikelihood, Vec<MotionSample>) {
    let truth = cubesat(3);
    let start = body(9.0, [0.028, -0.015, 0.05], [0.155, 0.134, 0.166], 3);
    let noise = Noise { position_m: 1e-3, attitude_rad: 1e-3, torque_n_m: 1e-4, force_n: 1e-3, ..Noise::default() };
    let settings =
        MaximumLikelihood { noise: Some(noise), robust: false, segment_samples: Some(8), start, ..likelihood() };
    (settings, log(truth, 6.0, REALISTIC, 3))
}

#[test]
fn the_gradient_of_the_cost_function_is_its_derivative() {
    let (likelihood, record) = near_the_truth();
    let cost = likelihood.cost_function(&record).unwrap();
    let at: Vec<f64> = (0..10).map(|i| 0.7 * f64::from(i - 4)).collect();
    let gradient = cost.gradient(&at).unwrap();
    let size = gradient.iter().fold(0.0, |most: f64, entry| most.max(entry.abs()));
    for (i, stated) in gradient.iter().enumerate() {
        let moved = |by: f64| {
            let mut at = at.clone();
            at[i] += by;
            cost.cost(&at).unwrap()
        };
        let slope = (moved(1e-3) - moved(-1e-3)) / 2e-3;
        assert!((slope - stated).abs() < 1e-4 * size, "{i}: {slope} {stated}");
    }
    assert!(cost.cost(&vec![0.0; 9]).unwrap().is_infinite() && cost.gradient(&vec![0.0; 9]).is_err());
    assert!(cost.cost(&vec![1e9; 10]).unwrap().is_infinite() && cost.body(&[1e9; 10]).is_none());
}

/// Two of argmin's solvers end where Gauss-Newton does, within a tenth of a standard deviation.
#[test]
fn solvers_of_argmin_find_the_same_body() {
    let (likelihood, record) = near_the_truth();
    let found = likelihood.estimate(&record).unwrap();
    let cost = || -> LikelihoodCost { likelihood.cost_function(&record).unwrap() };
    let start = vec![0.0; 10];
    let quasi_newton = Executor::new(cost(), LBFGS::new(MoreThuenteLineSearch::new(), 10))
        .configure(|state| state.param(start.clone()).max_iters(12))
        .run()
        .unwrap();
    let conjugate = NonlinearConjugateGradient::new(MoreThuenteLineSearch::new(), PolakRibiere::new());
    let conjugate =
        Executor::new(cost(), conjugate).configure(|state| state.param(start.clone()).max_iters(15)).run().unwrap();
    let best = [quasi_newton.state().get_best_param(), conjugate.state().get_best_param()];
    for best in best {
        let body = cost().body(best.unwrap()).unwrap().to_vector();
        let apart = (body - found.unconstrained).component_div(&found.std).amax();
        assert!(apart < 0.1, "{apart} {body} {}", found.unconstrained);
    }
}
