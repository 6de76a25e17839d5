//! `real-data`, set `astrobee`: time histories of the propulsion hardware, six runs open loop, against NASA's simulation;
//! and what one step of it takes.

use std::path::Path;

use nalgebra::Vector3;
use tumble_astrobee::propulsion::{Impeller, ImpellerMode, PropulsionCommand, PropulsionPlant, PropulsionSettings};

use crate::Failure;
use crate::bench::{Bench, Goal};
use crate::measured::{Measured, columns};

/// Name of the set and of its folder.
pub const SET: &str = "astrobee";
const FILE: &str = "plant_dynamics.csv";

/// Scenario, step, supply, body rate, two impeller bytes, twelve nozzle bytes; then what is compared.
const NAMES: [&str; 46] = [
    "scenario", "k", "volt", "wx", "wy", "wz", "imp_cmd1", "imp_cmd2", "servo1", "servo2", "servo3", "servo4",
    "servo5", "servo6", "servo7", "servo8", "servo9", "servo10", "servo11", "servo12", "N1", "N2", "dtheta1",
    "dtheta2", "dtheta3", "dtheta4", "dtheta5", "dtheta6", "dtheta7", "dtheta8", "dtheta9", "dtheta10", "dtheta11",
    "dtheta12", "tx1", "ty1", "tz1", "fx1", "fy1", "fz1", "tx2", "ty2", "tz2", "fx2", "fy2", "fz2",
];
type Row = [f64; 46];

/// What is compared: its first column of each module, how many follow, and the largest difference allowed.
struct Quantity {
    name: &'static str,
    first: [usize; 2],
    length: usize,
    target: f64,
}

const QUANTITIES: [Quantity; 4] = [
    Quantity { name: "largest difference of impeller speed, rad/s", first: [20, 21], length: 1, target: 5e-3 },
    Quantity { name: "largest difference of flap angle, rad", first: [22, 28], length: 6, target: 1e-5 },
    Quantity { name: "largest difference of torque, N m", first: [34, 40], length: 3, target: 1e-5 },
    Quantity { name: "largest difference of force, N", first: [37, 43], length: 3, target: 1e-5 },
];

/// Runs all scenarios; the targets missed, in words.
#[allow(clippy::float_cmp)] // numbers of runs, read and compared
pub fn run(folder: &Path, json: bool) -> Result<Vec<String>, Failure> {
    let rows: Vec<Row> = columns(&folder.join(FILE), &NAMES)?;
    let mut missed = Vec::new();
    for run in rows.chunk_by(|a, b| a[0] == b[0]) {
        let scenario = run.first().map_or(0.0, |row| row[0]);
        let simulated = simulate(run);
        for Quantity { name, first, length, target } in &QUANTITIES {
            let difference = |(row, own): (&Row, &Row)| {
                first.iter().flat_map(|i| *i..i + length).map(|i| (row[i] - own[i]).abs()).fold(0.0, f64::max)
            };
            let estimate = run.iter().zip(&simulated).map(difference).fold(0.0, f64::max);
            let file = format!("{FILE} {scenario}");
            let (sigma, reference) = (None, None);
            Measured { dataset: SET, file: &file, quantity: name, estimate, sigma, reference }.print(json);
            if estimate.is_nan() || estimate > *target {
                missed.push(format!("{SET}: {file}: {name} {estimate:.2e}, target {target:.0e}"));
            }
        }
    }
    if rows.is_empty() {
        missed.push(format!("{SET}: {FILE} holds no rows"));
    }
    Ok(missed)
}

/// The rows of one run as the plant makes them, each row's command held until the next.
fn simulate(run: &[Row]) -> Vec<Row> {
    let mut plant = PropulsionPlant::new(PropulsionSettings::AS_SIMULATED_UPSTREAM);
    let mut step = 0.0;
    let mut held = run.first();
    let mut simulated = Vec::with_capacity(run.len());
    for row in run {
        while step + 1.0 < row[1] {
            held.map(|row| advance(&mut plant, row));
            step += 1.0;
        }
        let wrenches = advance(&mut plant, row);
        (step, held) = (row[1], Some(row));
        let mut own = *row;
        own[20..22].copy_from_slice(&plant.impellers().each_ref().map(Impeller::speed_rad_s));
        own[22..34].copy_from_slice(&plant.flaps_rad());
        own[34..40].copy_from_slice(wrenches[0].to_vector().as_slice());
        own[40..46].copy_from_slice(wrenches[1].to_vector().as_slice());
        simulated.push(own);
    }
    simulated
}

/// One step under the command of a row; the wrench of each module.
fn advance(plant: &mut PropulsionPlant, row: &Row) -> [tumble_lie::Wrench<f64>; 2] {
    // bytes in the file
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let byte = |column: usize| row[column] as u8;
    let command =
        PropulsionCommand { impeller_speeds: [byte(6), byte(7)], nozzles: std::array::from_fn(|i| byte(8 + i)) };
    plant.settings_mut().supply_v = row[2];
    plant.step(&command, &Vector3::new(row[3], row[4], row[5])).module_wrenches_body
}

/// Benchmark of one step of both modules, the nozzles moving all the time.
#[allow(clippy::unnecessary_wraps)] // the shape of a problem
pub fn bench(bench: &mut Bench) -> Result<(), Failure> {
    let mut plant = PropulsionPlant::spun_up(PropulsionSettings::PHYSICAL, ImpellerMode::Nominal);
    let rate_body = Vector3::new(0.1, -0.05, 0.2);
    let goal = Goal { target_ns: Some(1000.0), peer: None };
    bench.sweep("propulsion", "plant_step", goal, 256, &[], |i| {
        #[allow(clippy::cast_possible_truncation)] // below 256
        let nozzles = std::array::from_fn(|nozzle| ((i + 20 * nozzle) % 256) as u8);
        plant.step(&PropulsionCommand { impeller_speeds: [207; 2], nozzles }, &rate_body)
    });
    Ok(())
}
