//! `study thruster-faults`: one thruster dead, weak or stuck open among others that are off by a per cent, on a station and on a table:
//! `cargo xtask study thruster-faults [--seeds N] [--first SEED]`.
//!
//! Logs of a minute with poses (1 mm, 1 mrad) and rates (2 mrad/s) at 50 Hz; commands are rows old by 50 ms, which nobody tells.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};
use tumble_dynamics::InertialParameters;
use tumble_identification::lie::Wrench;
use tumble_identification::noise::Gaussian;
use tumble_identification::sensing::{Delay, Level, LocalizationErrors, Sensing, TrueMotion, Wander};
use tumble_identification::{FlightLikelihood, IdentificationError, MotionSample, Thrusters};

use crate::Failure;
use crate::arguments::Arguments;
use crate::targets::Report;

const FIRST_SEED: usize = 301;
const SEEDS: usize = 20;
const THRUSTERS: usize = 12;
const THRUST_N: f64 = 0.1;
const STEP_NS: i64 = 5_000_000;
const STEPS_PER_ROW: usize = 4;
const STEPS: usize = 12_000;
/// Age of the commands when they act, steps.
const LATE: usize = 10;
const OFF: f64 = 0.01;
/// What a thruster gives of its command, and what it gives whatever it is told, as shares of its thrust.
const FAULTS: [(&str, f64, f64); 5] =
    [("healthy", 1.0, 0.0), ("dead", 0.0, 0.0), ("x 0.7", 0.7, 0.0), ("x 0.9", 0.9, 0.0), ("stuck open", 0.0, 1.0)];

fn bad(error: impl std::fmt::Display) -> Failure {
    Failure::BadInput(format!("thruster-faults: {error}"))
}

/// Torque about the origin and force per thrust: four thrusters along each axis in space, along x and y on a table.
fn wrenches(on_table: bool) -> [[f64; 6]; THRUSTERS] {
    let axes = if on_table { 2 } else { 3 };
    core::array::from_fn(|i| {
        let (axis, sign) = (i % axes, if (i / axes) % 2 == 0 { 1.0 } else { -1.0 });
        let side = [0.15, -0.15, 0.11][(i / (2 * axes)) % 3];
        let direction: Vector3<f64> = Vector3::ith(axis, sign);
        let place: Vector3<f64> = Vector3::ith((axis + 1) % axes, side * sign) + Vector3::ith(axis, 0.05 * sign);
        let torque = place.cross(&direction);
        [torque.x, torque.y, torque.z, direction.x, direction.y, direction.z]
    })
}

fn sum(wrenches: &[[f64; 6]; THRUSTERS], thrusts: &[f64; THRUSTERS]) -> Wrench<f64> {
    let part = |c: usize| wrenches.iter().zip(thrusts).map(|(w, thrust)| w[c] * thrust).sum::<f64>();
    Wrench::new(Vector3::new(part(0), part(1), part(2)), Vector3::new(part(3), part(4), part(5)))
}

/// A log, the thrusts that were asked for in each row, and the body.
struct Flown {
    log: Vec<MotionSample>,
    asked: Vec<f64>,
    body: InertialParameters<f64>,
}

fn sensors() -> Sensing {
    let still =
        |white| LocalizationErrors { white: Level::Known(white), wander: Wander::Known { sigma: 0.0, time_s: 10.0 } };
    let mut sensing =
        Sensing { position: still(1e-3), attitude: still(1e-3), velocity: still(1.0), ..Sensing::default() };
    sensing.pose_delay = Delay::NONE;
    for unit in [&mut sensing.rate, &mut sensing.acceleration] {
        (unit.delay, unit.bias_sigma, unit.white) = (Delay::NONE, 0.0, Level::Known(2e-3));
    }
    sensing
}

fn flown(
    seed: u64,
    on_table: bool,
    (factor, constant): (f64, f64),
    faulty: usize,
) -> Result<Flown, IdentificationError> {
    let mut dice = Gaussian::from_seed(seed);
    let wrenches = wrenches(on_table);
    let waves: [[f64; 2]; THRUSTERS] =
        core::array::from_fn(|_| [TAU * (0.05 + 0.25 * dice.uniform()), TAU * dice.uniform()]);
    let mut scales: [f64; THRUSTERS] = core::array::from_fn(|_| 1.0 + OFF * dice.normal());
    scales[faulty] *= factor;
    let center = if on_table { Vector3::new(0.01, -0.006, 0.0) } else { Vector3::new(0.01, -0.006, 0.004) };
    let body = InertialParameters::about_com(10.0, center, Matrix3::from_diagonal(&Vector3::new(0.16, 0.14, 0.18)));
    let row_s = STEP_NS as f64 * 1e-9 * STEPS_PER_ROW as f64;
    let asked_in = |row: usize| -> [f64; THRUSTERS] {
        let wave = |[w, phase]: [f64; 2]| THRUST_N * (0.5 + 0.5 * (w * row as f64 * row_s + phase).sin());
        waves.map(wave)
    };
    let step = core::cell::Cell::new(0_usize);
    let acts = |_: f64| {
        let step = step.replace(step.get() + 1);
        let asked = asked_in(step.saturating_sub(LATE) / STEPS_PER_ROW);
        let mut thrusts: [f64; THRUSTERS] = core::array::from_fn(|i| scales[i] * asked[i]);
        thrusts[faulty] += constant * THRUST_N;
        sum(&wrenches, &thrusts)
    };
    let mut motion = TrueMotion::flown(&body, &acts, STEP_NS, STEPS)?;
    for (step, at) in motion.iter_mut().enumerate() {
        at.wrench_body = sum(&wrenches, &asked_in(step / STEPS_PER_ROW));
    }
    let rows: Vec<usize> = (0..STEPS).step_by(STEPS_PER_ROW).collect();
    let mut log = sensors().publish(&motion, &rows, &Vector3::zeros(), seed)?;
    for sample in &mut log {
        (sample.velocity_origin_world, sample.acceleration_origin_body) = (None, None);
    }
    let asked = (0..rows.len()).flat_map(asked_in).collect();
    Ok(Flown { log, asked, body })
}

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let seeds = arguments.number("--seeds")?.unwrap_or(SEEDS);
    let first = arguments.number("--first")?.unwrap_or(FIRST_SEED);
    let mut report = Report::default();
    report.table.push(format!(
        "{:<10}{:<12}{:>9}{:>10}{:>8}{:>9}{:>9}",
        "place", "thruster", "answered", "accused", "named", "worst z", "rms z"
    ));
    for (place, on_table) in [("station", false), ("table", true)] {
        for (fault, factor, constant) in FAULTS {
            let (mut answered, mut named, mut accused, mut z) = (0.0, 0.0, 0.0, Vec::new());
            for seed in first..first + seeds {
                eprintln!("{place}, {fault}, seed {seed} ...");
                let faulty = seed % THRUSTERS;
                let flight = flown(seed as u64, on_table, (factor, constant), faulty).map_err(bad)?;
                let thrusters =
                    Thrusters::try_new(&wrenches(on_table), &[OFF; THRUSTERS], &flight.asked).map_err(bad)?;
                let told = FlightLikelihood { thrusters: Some(thrusters), ..FlightLikelihood::default() };
                let Ok(found) = told.estimate(&flight.log) else { continue };
                answered += 1.0;
                let suspects = found.thrusters.as_ref().map_or(&[][..], |found| &found.suspects);
                let expected: &[usize] = if fault == "healthy" { &[] } else { &[faulty] };
                named += if expected.iter().all(|one| suspects.contains(one)) { 1.0 } else { 0.0 };
                accused += if suspects.iter().any(|one| !expected.contains(one)) { 1.0 } else { 0.0 };
                z.push(found.error(&flight.body)[0] / found.std()[0]);
            }
            let count = seeds as f64;
            let worst = z.iter().fold(0.0, |worst: f64, z| worst.max(z.abs()));
            let rms = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
            report.table.push(format!(
                "{place:<10}{fault:<12}{answered:>9.0}{accused:>10.0}{named:>8.0}{worst:>9.2}{rms:>9.2}"
            ));
            let name = format!("{place}, {fault}");
            report.at_least(&format!("{name}: share named"), named / count, 0.98);
            report.at_most(&format!("{name}: share that accuses another"), accused / count, 0.01);
            report.at_most(&format!("{name}: worst error of the mass, standard deviations"), worst, 3.5);
        }
    }
    report.finish()
}
