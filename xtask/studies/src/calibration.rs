//! `study calibration`: delay, relative scales, accelerometer scale and actuator lag by maximum likelihood, many runs each.

#[path = "../../../crates/identification/tests/suite/faulty_log/mod.rs"]
#[allow(clippy::unwrap_used)]
mod faulty_log;

use std::io::Write as _;

use faulty_log::{Faulty, judged};
use nalgebra::Vector3;
use tumble_identification::{MaximumLikelihood, Nuisance};

use crate::Failure;
use crate::arguments::Arguments;

/// First seed; run `i` of every cell has this plus `i`.
const SEED: u64 = 20_000;
/// Two-sided 99.9 % of a normal variable.
const WIDE: f64 = 3.2905;
/// And 95 %.
const NARROW: f64 = 1.95996;

/// One claim: what is wrong with the logs, what is estimated, which of it is judged, and the largest rms error.
struct Cell {
    name: &'static str,
    faulty: Faulty,
    estimated: Vec<Nuisance>,
    judged: Vec<Nuisance>,
    target: f64,
}

fn cells() -> Vec<Cell> {
    let delay = |name, delay_s| Cell {
        name,
        faulty: Faulty { delay_s, ..Faulty::sound(30.0) },
        estimated: vec![Nuisance::Delay],
        judged: vec![Nuisance::Delay],
        target: 0.3e-3,
    };
    let lagging = Faulty { lag_s: 0.1, band_hz: 1.6, all_columns: true, ..Faulty::sound(30.0) };
    let relative = vec![Nuisance::ForceScale(1), Nuisance::ForceScale(2)];
    let scales = (0..3).map(Nuisance::AccelerometerScale).collect::<Vec<_>>();
    let accelerometer = (0..3).map(Nuisance::AccelerometerBias).chain(scales.clone()).collect();
    vec![
        delay("delay 3 ms", 0.003),
        delay("delay 24 ms", 0.024),
        delay("delay 100 ms", 0.1),
        Cell {
            name: "force scale relative to x",
            faulty: Faulty { force_scale: Vector3::new(1.0, 1.08, 0.95), all_columns: true, ..Faulty::sound(30.0) },
            estimated: relative.clone(),
            judged: relative,
            target: 2e-3,
        },
        Cell {
            name: "accelerometer scale",
            faulty: Faulty {
                accelerometer_bias: Vector3::new(0.02, -0.01, 0.03),
                accelerometer_scale: Vector3::new(1.05, 1.0, 0.97),
                all_columns: true,
                ..Faulty::sound(120.0)
            },
            estimated: accelerometer,
            judged: scales,
            target: 8e-3,
        },
        Cell {
            name: "lag",
            faulty: lagging.clone(),
            estimated: vec![Nuisance::ActuatorLag],
            judged: vec![Nuisance::ActuatorLag],
            target: 2e-3,
        },
        Cell {
            name: "lag beside a delay",
            faulty: Faulty { delay_s: 0.03, ..lagging },
            estimated: vec![Nuisance::ActuatorLag, Nuisance::Delay],
            judged: vec![Nuisance::ActuatorLag],
            target: 2e-3,
        },
    ]
}

/// Runs every cell, or the one named by `--only`; prints each figure beside the band of a correct estimator.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let runs = arguments.number("--runs")?.unwrap_or(200) as u64;
    let mut missed = Vec::new();
    for cell in cells() {
        if arguments.value("--only").is_some_and(|only| !cell.name.contains(only)) {
            continue;
        }
        if !passes(&cell, runs)? {
            missed.push(cell.name);
        }
    }
    if missed.is_empty() { Ok(()) } else { Err(Failure::TargetMissed(missed.join(", "))) }
}

fn passes(cell: &Cell, runs: u64) -> Result<bool, Failure> {
    let (mut squares, mut normal, mut inside, mut unknown) = (0.0, 0.0, 0.0, 0);
    for run in 0..runs {
        eprint!("\r{}: {} of {runs} ", cell.name, run + 1);
        let _ = std::io::stderr().flush();
        let estimator = MaximumLikelihood { nuisances: cell.estimated.clone(), ..MaximumLikelihood::default() };
        let found = estimator
            .estimate(&cell.faulty.record(SEED + run))
            .map_err(|error| Failure::TargetMissed(format!("{}, seed {}: {error}", cell.name, SEED + run)))?;
        for &nuisance in &cell.judged {
            let (error, std) = judged(&found, nuisance, cell.faulty.truth(nuisance));
            if error.is_nan() {
                unknown += 1;
                continue;
            }
            squares += error * error;
            normal += (error / std).powi(2);
            inside += if (error / std).abs() < NARROW { 1.0 } else { 0.0 };
        }
    }
    eprintln!();
    let count = runs as f64 * cell.judged.len() as f64 - f64::from(unknown);
    let (rms, nees, coverage) = ((squares / count).sqrt(), normal / count, inside / count);
    // Chi-square by Wilson and Hilferty, binomial by the normal distribution; axes of one run counted as one.
    let independent = runs as f64;
    let bound = |z: f64| (1.0 - 2.0 / (9.0 * independent) + z * (2.0 / (9.0 * independent)).sqrt()).powi(3);
    let spread = WIDE * (0.95 * 0.05 / independent).sqrt();
    let (low, high) = (0.93_f64.min(0.95 - spread), 0.97_f64.max(0.95 + spread).min(1.0));
    println!(
        "{:<26} rms {rms:.2e} (<= {:.1e})  NEES {nees:.3} ({:.3}..{:.3})  95 % intervals {coverage:.3} ({low:.3}..{high:.3})  \
         not determined {unknown}",
        cell.name,
        cell.target,
        bound(-WIDE),
        bound(WIDE),
    );
    Ok(unknown == 0
        && rms <= cell.target
        && (bound(-WIDE)..bound(WIDE)).contains(&nees)
        && (low..=high).contains(&coverage))
}
