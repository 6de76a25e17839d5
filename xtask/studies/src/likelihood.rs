//! Cells of the study on maximum likelihood from noisy poses.

use nalgebra::{Matrix3, Vector3};
use tumble_dynamics::InertialParameters;
use tumble_identification::noise::Gaussian;
use tumble_identification::statistics::{
    Band, chi_square_exceedance, chi_square_quantile, coverage_band, normal_quantile, normalized_squared_error,
    rms_ratio_failure,
};
use tumble_identification::{
    FixedLag, FixedLagSettings, LikelihoodEstimate, MaximumLikelihood, MotionSample, Noise as Levels, Nuisance,
    WrenchTiming,
};

use crate::Failure;
use crate::bench::{Bench, Goal};
use crate::flights::{Body, Draws, Errors, Flight, GroupCovariances, Multisine, Noise, fly, free_flyers};
use crate::statistical_tests::{CELL_CHANCE, Progress, Run, Test, honesty_tests, nees_test, pooled_test, rms_test};

/// Wrench noise of each of the free flyers, N m and N.
const WRENCH_NOISE: [(f64, f64); 4] = [(1e-4, 1e-3), (1e-3, 1e-2), (5e-4, 5e-3), (1e-2, 2e-2)];

/// Poses only, of this noise in metres and radians.
fn poses(level: f64, (torque, force): (f64, f64)) -> Noise {
    Noise { torque, force, position: level, attitude: level, ..Noise::default() }
}

/// Rates, velocities and accelerations as well.
fn everything(level: f64, wrench: (f64, f64)) -> Noise {
    let (velocity, rate, acceleration) = (Some(level), Some(level), Some(10.0 * level));
    Noise { velocity, rate, acceleration, ..poses(level, wrench) }
}

fn levels(noise: &Noise) -> Levels {
    Levels {
        torque_n_m: noise.torque,
        force_n: noise.force,
        attitude_rad: noise.attitude,
        position_m: noise.position,
        rate_rad_s: noise.rate.unwrap_or_default(),
        velocity_m_s: noise.velocity.unwrap_or_default(),
        acceleration_m_s2: noise.acceleration.unwrap_or_default(),
    }
}

/// A held multisine flight; motion and noise follow from the seed.
fn flight(body: &Body, noise: &Noise, seconds: f64, seed: u64) -> Flight {
    let mut random = Gaussian::from_seed(seed);
    let excitation = Multisine::random(body, &mut random);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive whole number")]
    let samples = (seconds / body.step_s).round() as usize;
    fly(body, &excitation, WrenchTiming::Held, noise, samples, &mut random)
}

fn estimate(settings: &MaximumLikelihood, record: &[MotionSample], seed: u64) -> Result<LikelihoodEstimate, Failure> {
    settings.estimate(record).map_err(|error| Failure::TargetMissed(format!("seed {seed}: {error}")))
}

/// The joint Cramer-Rao bound: the covariance of the same model at the truth, on the motion without noise.
fn joint_bound(body: &Body, noise: &Noise, seconds: f64, seed: u64) -> Result<GroupCovariances, Failure> {
    let exact = Noise {
        velocity: noise.velocity.map(|_| 0.0),
        rate: noise.rate.map(|_| 0.0),
        acceleration: noise.acceleration.map(|_| 0.0),
        ..Noise::default()
    };
    let settings = MaximumLikelihood {
        noise: Some(levels(noise)),
        robust: false,
        start: body.parameters,
        ..MaximumLikelihood::default()
    };
    let found = estimate(&settings, &flight(body, &exact, seconds, seed).record, seed)?;
    Ok(GroupCovariances::of(&found.covariance, &body.parameters))
}

fn squared_error(found: &LikelihoodEstimate, truth: &InertialParameters<f64>) -> f64 {
    let error = found.parameters.to_vector() - truth.to_vector();
    normalized_squared_error(&error, &found.covariance).unwrap_or(f64::NAN)
}

/// Poses of 1e-3 and 5e-3 (m, rad) alone, 30 s, four bodies, known levels, guesses from a tenth to thirty times the truth.
pub fn noisy_poses(runs: usize, progress: &mut Progress) -> Result<Vec<Test>, Failure> {
    let bodies = free_flyers();
    let mut tests = Vec::new();
    let parts = 2 * bodies.len();
    for (level_index, level) in [1e-3, 5e-3].into_iter().enumerate() {
        for (index, body) in bodies.iter().enumerate() {
            let noise = poses(level, WRENCH_NOISE[index]);
            let (mut all, mut squares, mut failures) = (Vec::new(), Vec::new(), 0);
            for run in 0..runs {
                progress(parts * runs);
                let seed = 10_000_000 + 1_000_000 * (level_index * bodies.len() + index) as u64 + run as u64;
                let factor = 0.1 * 300.0_f64.powf(Gaussian::from_seed(!seed).uniform());
                // A ball about the origin.
                let mean = body.parameters.inertia_about_com().trace() / 3.0;
                let settings = MaximumLikelihood {
                    noise: Some(levels(&noise)),
                    robust: false,
                    start: InertialParameters::about_com(
                        body.parameters.mass * factor,
                        Vector3::zeros(),
                        Matrix3::identity() * (mean * factor),
                    ),
                    ..MaximumLikelihood::default()
                };
                let found = match settings.estimate(&flight(body, &noise, 30.0, seed).record) {
                    Ok(found) => found,
                    Err(error) => {
                        eprintln!("{} {level:.0e}, seed {seed}, guess {factor:.2} x: {error}", body.name);
                        failures += 1;
                        continue;
                    }
                };
                squares.push(squared_error(&found, &body.parameters));
                all.push(Run {
                    errors: Errors::of(&found.parameters.to_vector(), &body.parameters),
                    bound: joint_bound(body, &noise, 30.0, seed)?,
                });
            }
            let label = format!("{} {level:.0e}", body.name);
            tests.push(Test {
                quantity: format!("{label}: failures to converge"),
                value: f64::from(failures),
                limits: Band { low: 0.0, high: 0.0 },
                chance: 0.0,
            });
            tests.push(pooled_test(&label, &all, 1.10, 2 * parts));
            tests.push(nees_test(&label, squares.into_iter(), 10.0, 2 * parts));
        }
    }
    Ok(tests)
}

/// A body like the cubesat, with everything about it drawn anew.
fn fresh_body(seed: u64) -> Body {
    let mut random = Gaussian::from_seed(seed);
    let like = |random: &mut Gaussian, value: f64, spread: f64| value * (1.0 + spread * (2.0 * random.uniform() - 1.0));
    let principal = Vector3::new(0.161, 0.139, 0.172).map(|j| like(&mut random, j, 0.15));
    let turn = random.attitude().to_rotation_matrix();
    let inertia = turn * Matrix3::from_diagonal(&principal) * turn.transpose();
    let center = random.vector(0.03);
    let mass = like(&mut random, 9.41, 0.3);
    Body {
        name: "fresh",
        parameters: InertialParameters::about_com(mass, center, (inertia + inertia.transpose()) * 0.5),
        torque: 0.04,
        force: 0.4,
        step_s: 0.016,
    }
}

/// The realistic log: 62.5 Hz, 120 s, everything measured, fresh bodies; and 60 s of a flat plate. Settings as they come.
pub fn realistic(runs: usize, progress: &mut Progress) -> Result<Vec<Test>, Failure> {
    let mut tests = Vec::new();
    let plate = free_flyers()[1].clone();
    let cubesat = ("fresh body 120 s", 120.0, (1e-4, 1e-3), [1e-3, 1e-4, 1e-3]);
    let flat = ("plate 60 s", 60.0, (1e-3, 1e-2), [4e-3, 6e-4, 6e-3]);
    for (kind, (label, seconds, wrench, targets)) in [cubesat, flat].into_iter().enumerate() {
        let noise = everything(1e-3, wrench);
        let (mut squares, mut variances, mut above, mut expected) = ([0.0; 3], [0.0; 3], [0_usize; 3], [0.0; 3]);
        let mut strangers = 0_usize;
        for run in 0..runs {
            let seed = 30_000_000 + 1_000_000 * kind as u64 + run as u64;
            let body = if kind == 0 { fresh_body(!seed) } else { plate.clone() };
            let settings = MaximumLikelihood::default();
            let found = estimate(&settings, &flight(&body, &noise, seconds, seed).record, seed)?;
            if !found.parameters.is_consistent() {
                return Err(Failure::TargetMissed(format!("{label}, seed {seed}: the estimate is no body")));
            }
            let [inertia, center, mass] = Errors::of(&found.parameters.to_vector(), &body.parameters).norms();
            let size = body.parameters.to_vector().fixed_rows::<6>(4).norm();
            let [j, c, m] = GroupCovariances::of(&found.covariance, &body.parameters).traces();
            let errors = [mass / body.parameters.mass, center, inertia / size];
            let sigmas = [m.sqrt() / body.parameters.mass, c.sqrt(), j.sqrt() / size];
            for group in 0..3 {
                squares[group] += errors[group] * errors[group] / runs as f64;
                variances[group] += sigmas[group] * sigmas[group] / runs as f64;
                above[group] += usize::from(errors[group] > targets[group]);
                // As if all of a group lay in one direction: more often far out than it is.
                expected[group] += chi_square_exceedance(1.0, (targets[group] / sigmas[group]).powi(2)) / runs as f64;
            }
            strangers += usize::from(squared_error(&found, &body.parameters) > chi_square_quantile(10.0, 0.999));
            progress(2 * runs);
        }
        let names = ["mass, relative", "centre of mass, m", "inertia, relative"];
        for group in 0..3 {
            tests.push(Test {
                quantity: format!("{label}: rms {}", names[group]),
                value: squares[group].sqrt(),
                limits: Band { low: 0.0, high: targets[group] },
                chance: rms_ratio_failure(
                    runs as f64,
                    &Band { low: 0.0, high: targets[group] / variances[group].sqrt() },
                ),
            });
            // A motion by chance poor shows less: how many logs may exceed the target follows from their own sigmas.
            tests.push(Test {
                quantity: format!("{label}: share above, {}", names[group]),
                value: above[group] as f64 / runs as f64,
                limits: Band { low: 0.0, high: coverage_band(expected[group], runs, 1.0 - CELL_CHANCE / 4.0).high },
                chance: CELL_CHANCE / 8.0,
            });
        }
        let probability = 1.0 - CELL_CHANCE / 4.0;
        tests.push(Test {
            quantity: format!("{label}: share with NEES above 29.6"),
            value: strangers as f64 / runs as f64,
            limits: Band { low: 0.0, high: coverage_band(0.001, runs, probability).high },
            chance: 0.5 * (1.0 - probability),
        });
    }
    Ok(tests)
}

/// 95 % intervals with the levels of noise estimated: cubesat, poses only, 30 s.
pub fn coverage(runs: usize, progress: &mut Progress) -> Result<Vec<Test>, Failure> {
    let body = &free_flyers()[0];
    let noise = poses(1e-3, WRENCH_NOISE[0]);
    let (mut inside, mut counts) = ([0_usize; 10], Vec::new());
    for run in 0..runs {
        let seed = 50_000_000 + run as u64;
        let found = estimate(&MaximumLikelihood::default(), &flight(body, &noise, 30.0, seed).record, seed)?;
        let error = found.parameters.to_vector() - body.parameters.to_vector();
        let hit = |i: usize| error[i].abs() <= normal_quantile(0.95) * found.covariance[(i, i)].sqrt();
        for (i, hits) in inside.iter_mut().enumerate() {
            *hits += usize::from(hit(i));
        }
        counts.push((0..10).filter(|&i| hit(i)).count() as f64 / 10.0);
        progress(runs);
    }
    let share = |hits: usize| hits as f64 / runs as f64;
    let probability = 1.0 - CELL_CHANCE / 11.0;
    let band = coverage_band(0.95, runs, probability);
    let mut tests: Vec<Test> = tumble_dynamics::PARAMETER_NAMES
        .iter()
        .zip(inside)
        .map(|(name, hits)| Test {
            quantity: format!("95 % interval of {name}"),
            value: share(hits),
            limits: Band { low: band.low.min(0.93), high: band.high.max(0.97) },
            chance: 1.0 - probability,
        })
        .collect();
    // Parameters of one run are correlated: the scatter of the mean share is that seen between runs. Two percent either way at
    // a thousand runs, more where fewer scatter more.
    let mean = counts.iter().sum::<f64>() / runs as f64;
    let variance = counts.iter().map(|share| (share - mean).powi(2)).sum::<f64>() / (runs - 1) as f64;
    let width = 0.02 * (1000.0 / runs as f64).sqrt().max(1.0);
    tests.push(Test {
        quantity: "95 % intervals, all ten".to_owned(),
        value: mean,
        limits: Band { low: 0.95 - width, high: 0.95 + width },
        chance: chi_square_exceedance(1.0, width * width * runs as f64 / variance),
    });
    Ok(tests)
}

/// What a nuisance was, and how the log shows it.
struct Planted {
    nuisance: Nuisance,
    value: f64,
}

/// Applies scales and biases to the log; delays are part of the flight.
fn plant(record: &mut [MotionSample], planted: &[Planted]) {
    for sample in record {
        for Planted { nuisance, value } in planted {
            match nuisance {
                Nuisance::ForceScale(axis) => {
                    if let Some(wrench) = &mut sample.wrench_body {
                        wrench.force[*axis] /= value;
                    }
                }
                Nuisance::AccelerometerScale(axis) => {
                    if let Some(acceleration) = &mut sample.acceleration_origin_body {
                        acceleration[*axis] *= value;
                    }
                }
                _ => {}
            }
        }
    }
}

/// Nuisances estimated beside the body, everything measured: rms errors, NEES, coverage of each.
fn calibrated(
    runs: usize,
    progress: &mut Progress,
    first_seed: u64,
    seconds: f64,
    target: f64,
    draw: &dyn Fn(&mut Gaussian, &mut Noise) -> Vec<Planted>,
) -> Result<Vec<Test>, Failure> {
    let body = &free_flyers()[0];
    let mut found: Vec<(String, Vec<f64>, Vec<f64>, f64)> = Vec::new();
    for run in 0..runs {
        let seed = first_seed + run as u64;
        let mut noise = everything(1e-3, WRENCH_NOISE[0]);
        let planted = draw(&mut Gaussian::from_seed(!seed), &mut noise);
        let mut record = flight(body, &noise, seconds, seed).record;
        // Rows from before the motion began.
        record.drain(..=noise.delay_fifths.div_ceil(5));
        plant(&mut record, &planted);
        let settings = MaximumLikelihood {
            nuisances: planted.iter().map(|planted| planted.nuisance).collect(),
            ..MaximumLikelihood::default()
        };
        for (index, (nuisance, Planted { value, .. })) in
            estimate(&settings, &record, seed)?.nuisances.iter().zip(&planted).enumerate()
        {
            if found.len() <= index {
                found.push((format!("{:?}", nuisance.nuisance), Vec::new(), Vec::new(), 0.0));
            }
            let (_, errors, normalized, variance) = &mut found[index];
            // Not determined counts as missed.
            let (found, std) = nuisance.value.zip(nuisance.std).unwrap_or((f64::NAN, f64::NAN));
            errors.push(found - value);
            normalized.push((found - value) / std);
            *variance += std * std / runs as f64;
        }
        progress(runs);
    }
    let tests_in_cell = 3 * found.len();
    Ok(found
        .iter()
        .flat_map(|(name, errors, normalized, variance)| {
            let mut tests = vec![rms_test(name, errors, variance.sqrt(), target)];
            tests.extend(honesty_tests(name, normalized, tests_in_cell));
            tests
        })
        .collect())
}

/// Delay by likelihood, 30 s.
pub fn delay(runs: usize, progress: &mut Progress) -> Result<Vec<Test>, Failure> {
    calibrated(runs, progress, 60_000_000, 30.0, 3e-4, &|random, noise| {
        // From none to 38 ms.
        noise.delay_fifths = (0..12).filter(|_| random.uniform() < 0.5).count();
        vec![Planted { nuisance: Nuisance::Delay, value: noise.delay_fifths as f64 * 0.016 / 5.0 }]
    })
}

/// Scale of the force along y and z against x, 30 s.
pub fn relative_scale(runs: usize, progress: &mut Progress) -> Result<Vec<Test>, Failure> {
    calibrated(runs, progress, 70_000_000, 30.0, 2e-3, &|random, _| {
        [1, 2].map(|axis| Planted { nuisance: Nuisance::ForceScale(axis), value: (0.1 * random.normal()).exp() }).into()
    })
}

/// Scale of the accelerometer, 120 s.
pub fn accelerometer_scale(runs: usize, progress: &mut Progress) -> Result<Vec<Test>, Failure> {
    calibrated(runs, progress, 80_000_000, 120.0, 8e-3, &|random, _| {
        [0, 1, 2]
            .map(|axis| Planted { nuisance: Nuisance::AccelerometerScale(axis), value: 1.0 + 0.05 * random.normal() })
            .into()
    })
}

const PROBLEM: &str = "likelihood";

/// Whole records and one step of the sliding window: poses alone, levels of noise not given.
pub fn bench(bench: &mut Bench) -> Result<(), Failure> {
    let (body, noise) = (&free_flyers()[0], poses(1e-3, WRENCH_NOISE[0]));
    let records = |rows: usize| flight(body, &noise, rows as f64 * body.step_s, 1).record;
    let sweeps = bench.sweeps;
    for (item, rows, target_ns) in [("poses_600", 600, 20e6), ("poses_20000", 20_000, 500e6)] {
        if bench.wants(PROBLEM, item) {
            let record = records(rows);
            let settings = MaximumLikelihood::default();
            let quality = [("nees", squared_error(&estimate(&settings, &record, 1)?, &body.parameters))];
            // As many rows in all, whatever the length of a record.
            bench.sweeps = (600 * sweeps).div_ceil(rows);
            bench.each(PROBLEM, item, Goal { target_ns: Some(target_ns), peer: None }, 1, &quality, |_| {
                settings.estimate(&record)
            });
        }
    }
    bench.sweeps = sweeps;
    if bench.wants(PROBLEM, "window_step") {
        const BOOTSTRAP: usize = 1000;
        const SEGMENT: usize = 16;
        const STEPS: usize = 10;
        let record = records(BOOTSTRAP + SEGMENT * STEPS * sweeps.div_ceil(10) + SEGMENT);
        let likelihood = MaximumLikelihood { segment_samples: Some(SEGMENT), ..MaximumLikelihood::default() };
        let mut window = FixedLag::new(FixedLagSettings { likelihood, ..FixedLagSettings::default() });
        let mut rows = record.iter();
        for row in rows.by_ref().take(BOOTSTRAP) {
            window.push(*row).map_err(|error| Failure::TargetMissed(format!("{PROBLEM}: {error}")))?;
        }
        let goal = Goal { target_ns: Some(600_000.0), peer: None };
        bench.each(PROBLEM, "window_step", goal, STEPS, &[], |_| {
            rows.by_ref().take(SEGMENT).map(|row| window.push(*row)).filter(|step| matches!(step, Ok(Some(_)))).count()
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_is_what_a_thousand_times_less_noise_makes_a_millionth_of() {
        let body = &free_flyers()[0];
        let noise = poses(1e-3, WRENCH_NOISE[0]);
        let small = poses(1e-6, (1e-7, 1e-6));
        let [large, tiny] = [noise, small].map(|noise| joint_bound(body, &noise, 10.0, 1).unwrap().traces());
        for (large, tiny) in large.iter().zip(tiny) {
            assert!((large / tiny * 1e-6 - 1.0).abs() < 1e-2, "{large} {tiny}");
        }
    }
}
