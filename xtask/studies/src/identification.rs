//! `study identification`: the long statistics, each figure beside the band in which a correct estimator's lies.
//!
//! To add a cell: a function from the number of runs to its [`Test`]s and a line in [`CELLS`].

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::SMatrix;
use serde_json::json;
use tumble::output::OutputFolder;
use tumble_identification::Verdict;
use tumble_identification::WrenchTiming;
use tumble_identification::noise::Gaussian;
use tumble_identification::statistics::{
    Band, chance_of_any, coverage_band, effective_degrees_of_freedom, mean_square_band, normal_quantile,
    rms_ratio_band, rms_ratio_failure,
};
use tumble_identification::synchronize::{Signals, delay};

use crate::Failure;
use crate::arguments::Arguments;
use crate::chapter5::{self, Method};
use crate::flights::{Errors, GROUPS, GroupCovariances, Multisine, Noise, chapter5_bodies, fly, free_flyers};
use crate::likelihood;
use crate::plot::{self, Curve, Scale};

/// The chance with which a correct estimator may fail one cell.
pub const CELL_CHANCE: f64 = 0.001;

/// One figure of a cell and where it must lie.
pub struct Test {
    pub quantity: String,
    pub value: f64,
    pub limits: Band,
    /// The chance that a correct estimator's figure lies outside.
    pub chance: f64,
}

impl Test {
    fn passes(&self) -> bool {
        self.limits.contains(self.value)
    }
}

/// Told after each run how many there are in all.
pub type Progress<'a> = dyn FnMut(usize) + 'a;

/// A cell: its name, its number of runs, and what it finds in the runs of the seeds `0..runs`.
struct Cell {
    name: &'static str,
    runs: usize,
    tests: fn(usize, &mut Progress) -> Result<Vec<Test>, Failure>,
}

const CELLS: &[Cell] = &[
    Cell { name: "chapter5 order 4", runs: 1000, tests: chapter5_order4 },
    Cell { name: "delay by correlation", runs: 200, tests: delay_by_correlation },
    Cell { name: "noisy poses", runs: 500, tests: likelihood::noisy_poses },
    Cell { name: "realistic log", runs: 100, tests: likelihood::realistic },
    Cell { name: "coverage", runs: 1000, tests: likelihood::coverage },
    Cell { name: "delay by likelihood", runs: 200, tests: likelihood::delay },
    Cell { name: "relative force scale", runs: 200, tests: likelihood::relative_scale },
    Cell { name: "accelerometer scale", runs: 200, tests: likelihood::accelerometer_scale },
];

/// Errors of one run and the bound that belongs to its motion.
pub struct Run {
    pub errors: Errors,
    pub bound: GroupCovariances,
}

/// Root-mean-square error over root-mean-square bound of each group: at most `target`, not below its band under one.
pub fn ratio_tests(label: &str, runs: &[Run], target: f64, tests_in_cell: usize) -> Vec<Test> {
    let sum = |of: &dyn Fn(&Run) -> f64| runs.iter().map(of).sum::<f64>();
    let freedoms = [
        effective_degrees_of_freedom(runs.iter().map(|run| &run.bound.inertia)),
        effective_degrees_of_freedom(runs.iter().map(|run| &run.bound.center_of_mass)),
        effective_degrees_of_freedom(runs.iter().map(|run| &run.bound.mass)),
    ];
    (0..GROUPS.len())
        .map(|group| {
            let value = (sum(&|run| run.errors.norms()[group].powi(2)) / sum(&|run| run.bound.traces()[group])).sqrt();
            let band = rms_ratio_band(freedoms[group], 1.0 - CELL_CHANCE / tests_in_cell as f64);
            let limits = Band { low: band.low, high: band.high.max(target) };
            Test {
                quantity: format!("{label}: {} rms / bound", GROUPS[group]),
                value,
                limits,
                chance: rms_ratio_failure(freedoms[group], &limits),
            }
        })
        .collect()
}

/// All groups of all runs together, each error in units of its own run's bound: at most `target`.
pub fn pooled_test(label: &str, runs: &[Run], target: f64, tests_in_cell: usize) -> Test {
    let n = (runs.len() * GROUPS.len()) as f64;
    let (mut square, mut deviation) = (0.0, 0.0);
    for run in runs {
        for (norm, trace) in run.errors.norms().iter().zip(run.bound.traces()) {
            square += norm * norm / trace / n;
        }
    }
    // Groups of one run are correlated; at worst fully, when their deviations add.
    let one = |freedom: f64| (2.0 / freedom).sqrt() / GROUPS.len() as f64;
    deviation += one(relative_freedom(runs.iter().map(|run| &run.bound.inertia)));
    deviation += one(relative_freedom(runs.iter().map(|run| &run.bound.center_of_mass)));
    deviation += one(runs.len() as f64);
    let freedom = 2.0 / (deviation * deviation);
    let band = rms_ratio_band(freedom, 1.0 - CELL_CHANCE / tests_in_cell as f64);
    let limits = Band { low: 0.0, high: band.high.max(target) };
    Test {
        quantity: format!("{label}: pooled rms / bound"),
        value: square.sqrt(),
        limits,
        chance: rms_ratio_failure(freedom, &limits),
    }
}

/// Degrees of freedom of a sum of squares each in units of its own expectation.
fn relative_freedom<'a, const N: usize>(covariances: impl Iterator<Item = &'a SMatrix<f64, N, N>>) -> f64 {
    let (mut runs, mut sum) = (0.0, 0.0);
    for covariance in covariances {
        runs += 1.0;
        sum += covariance.norm_squared() / (covariance.trace() * covariance.trace());
    }
    runs * runs / sum
}

/// Errors of one number in units of their own deviations: their mean square in its band, and their 95 % intervals.
pub fn honesty_tests(label: &str, normalized: &[f64], tests_in_cell: usize) -> Vec<Test> {
    let n = normalized.len();
    let probability = 1.0 - CELL_CHANCE / tests_in_cell as f64;
    let inside = normalized.iter().filter(|error| error.abs() <= normal_quantile(0.95)).count();
    vec![
        nees_test(label, normalized.iter().map(|error| error * error), 1.0, tests_in_cell),
        Test {
            quantity: format!("{label}: coverage of 95 % intervals"),
            value: inside as f64 / n as f64,
            limits: coverage_band(0.95, n, probability),
            chance: 1.0 - probability,
        },
    ]
}

/// Normalised squared errors of `dimension` parameters each: their mean in its band.
pub fn nees_test(label: &str, squares: impl Iterator<Item = f64>, dimension: f64, tests_in_cell: usize) -> Test {
    let squares: Vec<f64> = squares.collect();
    let probability = 1.0 - CELL_CHANCE / tests_in_cell as f64;
    Test {
        quantity: format!("{label}: mean NEES"),
        value: squares.iter().sum::<f64>() / squares.len() as f64,
        limits: mean_square_band(dimension, squares.len(), probability),
        chance: 1.0 - probability,
    }
}

/// Runs from which on the target of an rms error is taken as it is; fewer scatter more.
const FULL_RUNS: f64 = 200.0;

/// The rms of errors: at most `target`, for an estimator whose errors have the deviation `sigma` it states.
pub fn rms_test(label: &str, errors: &[f64], sigma: f64, target: f64) -> Test {
    let n = errors.len() as f64;
    let scatter = |n: f64| rms_ratio_band(n, 1.0 - CELL_CHANCE).high;
    let high = target * (scatter(n) / scatter(FULL_RUNS)).max(1.0);
    Test {
        quantity: format!("{label}: rms error"),
        value: (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt(),
        limits: Band { low: 0.0, high },
        chance: rms_ratio_failure(n, &Band { low: 0.0, high: high / sigma }),
    }
}

/// Chapter 5's bodies and noise, the variational regressor of order 4.
fn chapter5_order4(runs: usize, progress: &mut Progress) -> Result<Vec<Test>, Failure> {
    let bodies = chapter5_bodies();
    let tests_in_cell = bodies.len() * GROUPS.len() + 1;
    let (mut tests, mut all) = (Vec::new(), Vec::new());
    for (index, body) in bodies.iter().enumerate() {
        let mut of_body = Vec::new();
        for run in 0..runs {
            // Seeds of their own: bodies that share draws would fail and pass together.
            let flight = chapter5::thesis_flight(body, 1_000_000 * (index as u64 + 1) + run as u64);
            let found = chapter5::fit(&flight, Method::Order4, flight.record.len())?;
            let bound = chapter5::bound(&flight, flight.record.len())?;
            of_body.push(Run { errors: Errors::of(&found, &flight.truth), bound });
            progress(bodies.len() * runs);
        }
        tests.extend(ratio_tests(&format!("body {}", body.name), &of_body, 1.15, tests_in_cell));
        all.extend(of_body);
    }
    tests.push(pooled_test("all bodies", &all, 1.10, tests_in_cell));
    Ok(tests)
}

/// The delay of a 30 s log with rates and accelerations, by correlation alone: no body is estimated.
fn delay_by_correlation(runs: usize, progress: &mut Progress) -> Result<Vec<Test>, Failure> {
    let body = &free_flyers()[0];
    let (mut errors, mut normalized, mut variance) = (Vec::new(), Vec::new(), 0.0);
    for run in 0..runs {
        let mut random = Gaussian::from_seed(70_000 + run as u64);
        let excitation = Multisine::random(body, &mut random);
        // From none to 38 ms.
        let delay_fifths = run % 13;
        let noise = Noise {
            torque: 1e-4,
            force: 1e-3,
            position: 1e-3,
            attitude: 1e-3,
            velocity: Some(1e-3),
            rate: Some(1e-3),
            acceleration: Some(1e-2),
            delay_fifths,
            ..Noise::default()
        };
        let flight = fly(body, &excitation, WrenchTiming::Held, &noise, 1875, &mut random);
        let signals = Signals::from_record(&flight.record, WrenchTiming::Held, &nalgebra::Vector3::zeros())
            .map_err(|error| Failure::BadInput(error.to_string()))?;
        let found = delay(&signals, 0.2).map_err(|error| Failure::BadInput(error.to_string()))?;
        if found.verdict != Verdict::Identifiable {
            return Err(Failure::TargetMissed(format!("seed {run}: the delay is {}", found.verdict)));
        }
        let error = found.delay_s - delay_fifths as f64 / 5.0 * body.step_s;
        errors.push(error);
        normalized.push(error / found.sigma_s);
        variance += found.sigma_s * found.sigma_s / runs as f64;
        progress(runs);
    }
    let mut tests = vec![rms_test("delay, s", &errors, variance.sqrt(), 3e-4)];
    tests.extend(honesty_tests("delay", &normalized, 3));
    Ok(tests)
}

/// Runs the cells whose name holds `--cells`.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let wanted = arguments.value("--cells").unwrap_or_default();
    let out = arguments.value("--out").map(Path::new);
    if let Some(out) = out {
        OutputFolder::check_place(out, false).map_err(|error| Failure::BadInput(error.to_string()))?;
    }
    let cells: Vec<&Cell> = CELLS.iter().filter(|cell| cell.name.contains(wanted)).collect();
    if cells.is_empty() {
        let names: Vec<&str> = CELLS.iter().map(|cell| cell.name).collect();
        return Err(Failure::BadInput(format!("no cell is called `{wanted}`: {}", names.join(", "))));
    }
    let asked = arguments.number("--runs")?;
    let (mut results, mut broken) = (Vec::new(), Vec::new());
    for cell in cells {
        let runs = asked.unwrap_or(cell.runs).max(2);
        let (mut done, mut told) = (0, 0);
        let mut progress = |all: usize| {
            done += 1;
            if 10 * done / all > told {
                told = 10 * done / all;
                eprintln!("{}: {} of {all}", cell.name, done);
            }
        };
        let tests = match (cell.tests)(runs, &mut progress) {
            Ok(tests) => tests,
            Err(Failure::TargetMissed(reason)) => {
                println!("MISS {}: {reason}", cell.name);
                broken.push(format!("{}: {reason}", cell.name));
                continue;
            }
            Err(failure) => return Err(failure),
        };
        for test in &tests {
            println!(
                "{} {:<22} {:<40} {:>10.3e}  in {:.3e} to {:.3e}",
                if test.passes() { "ok  " } else { "MISS" },
                cell.name,
                test.quantity,
                test.value,
                test.limits.low,
                test.limits.high
            );
        }
        results.push((cell.name, runs, tests));
    }
    let chance = chance_of_any(results.iter().flat_map(|(.., tests)| tests.iter().map(|test| test.chance)));
    println!("a correct estimator fails this study by chance with probability {chance:.2e}");
    if let Some(out) = out {
        write(out, &results, chance)?;
    }
    let missed: Vec<String> = results
        .iter()
        .flat_map(|(name, _, tests)| {
            tests.iter().filter(|test| !test.passes()).map(move |test| format!("{name}: {}", test.quantity))
        })
        .chain(broken)
        .collect();
    if missed.is_empty() { Ok(()) } else { Err(Failure::TargetMissed(missed.join("\n"))) }
}

fn write(out: &Path, results: &[(&str, usize, Vec<Test>)], chance: f64) -> Result<(), Failure> {
    let failed = |error: tumble::TumbleError| Failure::BadInput(error.to_string());
    let folder = OutputFolder::create(out, false).map_err(failed)?;
    let mut text = String::from("cell,runs,quantity,value,low,high,chance,passes\n");
    let mut curves = ["value", "low", "high"].map(|name| Curve { name: name.to_owned(), points: Vec::new() });
    for (name, runs, tests) in results {
        for test in tests {
            let _ = writeln!(
                text,
                "{name},{runs},\"{}\",{:.6e},{:.6e},{:.6e},{:.2e},{}",
                test.quantity,
                test.value,
                test.limits.low,
                test.limits.high,
                test.chance,
                test.passes()
            );
            // Each figure in units of the upper end of its band.
            let x = curves[0].points.len() as f64;
            for (curve, y) in curves.iter_mut().zip([test.value, test.limits.low, test.limits.high]) {
                curve.points.push((x, y / test.limits.high));
            }
        }
    }
    folder.write("identification.csv", &text).map_err(failed)?;
    plot::draw(
        &folder.file("identification.svg"),
        "Figures of the study in their bands",
        ["test, in the order of the table", "value over upper limit"],
        Scale::Linear,
        &curves,
    )?;
    let configuration = json!({
        "cells": results.iter().map(|(name, runs, _)| json!({ "name": name, "runs": runs })).collect::<Vec<_>>(),
        "chance_of_a_correct_estimator_to_fail": chance,
    });
    folder.write("run.json", &crate::run_record("study identification", &configuration)).map_err(failed)?;
    eprintln!("written: {}", folder.finish().map_err(failed)?.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SVector;

    /// Runs of an imaginary estimator whose errors have `excess` times the deviation of the bound.
    fn imaginary(runs: usize, excess: f64) -> Vec<Run> {
        let mut random = Gaussian::from_seed(3);
        let body = chapter5_bodies()[0].parameters;
        (0..runs)
            .map(|_| {
                let factor = SMatrix::<f64, 10, 10>::from_fn(|_, _| 1e-4 * random.normal());
                let covariance = factor * factor.transpose();
                let noise = SVector::<f64, 10>::from_fn(|_, _| random.normal());
                let found = body.to_vector() + factor * noise * excess;
                Run { errors: Errors::of(&found, &body), bound: GroupCovariances::of(&covariance, &body) }
            })
            .collect()
    }

    #[test]
    fn an_efficient_estimator_passes_and_others_do_not() {
        for (excess, expected) in [(1.0, true), (0.7, false), (1.6, false)] {
            let runs = imaginary(300, excess);
            let tests = ratio_tests("imaginary", &runs, 1.15, 4);
            assert_eq!(tests.iter().all(Test::passes), expected, "{excess}");
            assert!(tests.iter().all(|test| test.chance > 0.0 && test.chance < CELL_CHANCE), "{excess}");
        }
        assert!(pooled_test("imaginary", &imaginary(300, 1.0), 1.10, 4).passes());
        assert!(!pooled_test("imaginary", &imaginary(300, 1.2), 1.10, 4).passes());
    }

    #[test]
    fn the_covariance_of_the_centre_of_mass_is_that_of_its_errors() {
        let runs = imaginary(2000, 1.0);
        let mean = |of: &dyn Fn(&Run) -> f64| runs.iter().map(of).sum::<f64>() / runs.len() as f64;
        let ratio = mean(&|run| run.errors.norms()[1].powi(2) / run.bound.traces()[1]);
        let freedom = relative_freedom(runs.iter().map(|run| &run.bound.center_of_mass));
        assert!(rms_ratio_band(freedom, 0.999).contains(ratio.sqrt()), "{ratio}");
    }

    #[test]
    fn over_confident_and_timid_deviations_are_seen() {
        let mut random = Gaussian::from_seed(4);
        for (scale, expected) in [(1.0, true), (1.4, false), (0.6, false)] {
            let normalized: Vec<f64> = (0..500).map(|_| scale * random.normal()).collect();
            assert_eq!(honesty_tests("x", &normalized, 2).iter().all(Test::passes), expected, "{scale}");
        }
    }

    /// The first cell, small: bands are those of its own number of runs.
    #[test]
    fn a_small_study_passes() {
        let mut runs = 0;
        let tests = chapter5_order4(12, &mut |_| runs += 1).unwrap();
        assert_eq!((runs, tests.len()), (48, 13));
        for test in tests {
            assert!(test.passes(), "{} {} {}", test.quantity, test.value, test.limits);
        }
    }
}
