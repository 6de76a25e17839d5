//! `study identification`: the long statistics, each figure beside the band in which a correct estimator's lies.
//!
//! To add a cell: a function from the number of runs to its [`Test`]s and a line in [`CELLS`].

use std::fmt::Write as _;
use std::path::Path;

use serde_json::json;
use tumble::output::OutputFolder;
use tumble_identification::Verdict;
use tumble_identification::WrenchTiming;
use tumble_identification::noise::Gaussian;
use tumble_identification::statistics::chance_of_any;
use tumble_identification::synchronize::{Signals, delay};

use crate::Failure;
use crate::arguments::Arguments;
use crate::chapter5::{self, Method};
use crate::flights::{Errors, GROUPS, Multisine, Noise, chapter5_bodies, fly, free_flyers};
use crate::likelihood;
use crate::plot::{self, Curve, Scale};
use crate::statistical_tests::{Progress, Run, Test, honesty_tests, pooled_test, ratio_tests, rms_test};

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
