//! Force allocation of Astrobee and its inverse: all vectors of the flown software (`real-data`, set `astrobee`), and timing.

use std::path::Path;

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_astrobee::propulsion::constants::{FLAP_TRAVEL_RAD, NOZZLE_COUNTS, NOZZLES, Nozzle};
use tumble_astrobee::propulsion::nozzle::thrusts_of_wrench;
use tumble_astrobee::propulsion::{
    Allocation, AreaTable, ForceAllocation, ImpellerMode, InverseAllocation, Module, QuantizedAllocation, blower,
};
use tumble_dynamics::Actuation as _;
use tumble_lie::Wrench;

use crate::Failure;
use crate::bench::{Bench, Goal};
use crate::measured::{Measured, columns};
use tumble_identification::noise::signed_unit;

/// Name of the set and of its folder.
pub const SET: &str = "astrobee";
const VECTORS: &str = "fam_vectors.csv";
const STATIC: &str = "plant_static.csv";
/// The simulation's tuning factor, in its thrusts and wrenches.
const SIMULATION_FACTOR: f64 = 1.25;
/// What the vectors' description allows between 32-bit and 64-bit arithmetic.
const THRUST_TOLERANCE: f64 = 5e-6;
const WRENCH: [&str; 10] = ["mode", "fx", "fy", "fz", "tx", "ty", "tz", "comx", "comy", "comz"];

const PROBLEM: &str = "allocation";

/// One figure and the bounds it has to keep.
struct Figure {
    file: &'static str,
    quantity: String,
    value: f64,
    at_least: f64,
    at_most: f64,
}

impl Figure {
    fn at_most(file: &'static str, quantity: impl Into<String>, value: f64, bound: f64) -> Self {
        Self { file, quantity: quantity.into(), value, at_least: f64::NEG_INFINITY, at_most: bound }
    }
}

/// Processes the vectors in `folder`; the targets missed, in words.
pub fn real_data(folder: &Path, json: bool) -> Result<Vec<String>, Failure> {
    let mut figures = vectors(&folder.join(VECTORS))?;
    figures.extend(thrusts(&folder.join(STATIC))?);
    let mut missed = Vec::new();
    for Figure { file, quantity, value, at_least, at_most } in figures {
        Measured { dataset: SET, file, quantity: &quantity, estimate: value, sigma: None, reference: None }.print(json);
        // NaN misses too
        if !(at_least..=at_most).contains(&value) {
            missed.push(format!("{SET}, {file}: {quantity} is {value:e}, wanted {at_least:e} to {at_most:e}"));
        }
    }
    Ok(missed)
}

/// The columns of one name, numbered from one.
fn numbered<const N: usize>(path: &Path, prefix: &str) -> Result<Vec<[f64; N]>, Failure> {
    let names: [String; N] = core::array::from_fn(|i| format!("{prefix}{}", i + 1));
    columns(path, &names.each_ref().map(String::as_str))
}

/// Which rows are of the family `extreme`, whose 32-bit numbers are less precise.
fn extreme(path: &Path) -> Result<Vec<bool>, Failure> {
    let text = std::fs::read_to_string(path).map_err(|error| Failure::file(path, error))?;
    Ok(text.lines().skip(1).filter(|line| !line.trim().is_empty()).map(|line| line.contains(",extreme,")).collect())
}

fn largest(differences: impl IntoIterator<Item = f64>) -> f64 {
    // a NaN must not get lost
    differences.into_iter().fold(0.0, |a, b| if a >= b { a } else { b })
}

fn difference<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    largest(a.iter().zip(b).map(|(a, b)| (a - b).abs()))
}

/// What the steepest count of the widest nozzle gives, N, under the pressure with all others shut.
fn thrust_of_a_count_n(mode: ImpellerMode) -> f64 {
    let pressure_pa = blower::pressure_pa(mode.speed_rad_s(), blower::pressure_coefficient_of_thrust(0.0));
    let thrust = |nozzle: &Nozzle| {
        let area_m2 = nozzle.area_m2(FLAP_TRAVEL_RAD) - nozzle.area_m2(FLAP_TRAVEL_RAD * (1.0 - 1.0 / NOZZLE_COUNTS));
        nozzle.thrust_n(area_m2, pressure_pa)
    };
    largest(NOZZLES.iter().map(thrust))
}

/// Everything in `fam_vectors.csv`.
fn vectors(path: &Path) -> Result<Vec<Figure>, Failure> {
    let wanted = columns(path, &WRENCH)?;
    let is_extreme = extreme(path)?;
    let mut steps: Vec<(ForceAllocation, Wrench<f64>, Allocation)> = Vec::with_capacity(wanted.len());
    for [mode, fx, fy, fz, tx, ty, tz, x, y, z] in &wanted {
        let mode = ImpellerMode::ALL.into_iter().find(|known| (f64::from(known.number()) - mode).abs() < 0.5);
        let mode = mode.ok_or_else(|| Failure::file(path, "a mode that is none"))?;
        let allocation = ForceAllocation::new(mode, Vector3::new(*x, *y, *z));
        let about_com = Wrench::new(Vector3::new(*tx, *ty, *tz), Vector3::new(*fx, *fy, *fz));
        let wrench = allocation.about_origin(&about_com);
        let step = allocation.allocate_steps(&wrench).map_err(|error| Failure::file(path, error))?;
        steps.push((allocation, wrench, step));
    }
    let thrusts: Vec<[f64; 12]> = numbered(path, "thr")?;
    let size = |row: usize| largest(thrusts[row].iter().map(|thrust| thrust.abs())).max(f64::MIN_POSITIVE);
    let over = |pick: &dyn Fn(usize) -> f64, rows: &dyn Fn(usize) -> bool| {
        largest((0..steps.len()).filter(|row| rows(*row)).map(pick))
    };
    let (all, ordinary) = (|_: usize| true, |row: usize| !is_extreme[row]);
    let flown = |row: usize| steps[row].0.mode != ImpellerMode::Off;

    let raw: Vec<[f64; 12]> = numbered(path, "raw")?;
    let (cdp, dp): (Vec<[f64; 2]>, Vec<[f64; 2]>) = (numbered(path, "cdp")?, numbered(path, "dp")?);
    let (dtheta, servof): (Vec<[f64; 12]>, Vec<[f64; 12]>) = (numbered(path, "dtheta")?, numbered(path, "servof")?);
    let (servo, impellers): (Vec<[f64; 12]>, Vec<[f64; 2]>) = (numbered(path, "servo")?, numbered(path, "imp")?);
    let raw_error = |row: usize| difference(&raw[row], &thrusts_of_wrench(&steps[row].1)) / size(row);
    let thrust_error = |row: usize| difference(&thrusts[row], &steps[row].2.thrusts_n) / size(row);
    let bytes = |row: usize| steps[row].2.bytes.nozzles.map(f64::from);
    let equal = |row: usize| (0..12).filter(|i| (servo[row][*i] - bytes(row)[*i]).abs() < 0.5).count();
    let in_flown = (0..steps.len()).filter(|row| flown(*row));
    let (count, same) = in_flown.fold((0, 0), |(count, same), row| (count + 12, same + equal(row)));
    let off = |row: usize| {
        let (allocation, _, step) = &steps[row];
        let given = [allocation.realize(&step.flaps), QuantizedAllocation(*allocation).realize(&step.bytes)];
        largest(given.map(|wrench| wrench.to_vector().amax()))
    };
    let round_trip = |row: usize| {
        let (allocation, wrench, step) = &steps[row];
        (allocation.realize(&step.flaps) - *wrench).to_vector().amax()
    };
    let in_bytes = |row: usize| {
        let (allocation, wrench, step) = &steps[row];
        let given = QuantizedAllocation(*allocation).realize(&step.bytes);
        (given.force - wrench.force).amax() / thrust_of_a_count_n(allocation.mode)
    };
    let thesis_table = |row: usize| {
        let (allocation, _, step) = &steps[row];
        let inverse = InverseAllocation { table: AreaTable::Thesis, ..allocation.inverse };
        let cut = ForceAllocation { inverse, ..*allocation };
        (cut.realize(&step.flaps).force - allocation.realize(&step.flaps).force).amax()
    };
    let counts = |row: usize| difference(&servof[row], &steps[row].2.counts);
    let angles = |row: usize| difference(&dtheta[row], &steps[row].2.flaps.openings_rad);
    let file = VECTORS;
    let exact = |row: usize| flown(row) && steps[row].2.limits.is_exact();
    let number = |rows: &dyn Fn(usize) -> bool| (0..steps.len()).filter(|row| rows(*row)).count() as f64;
    Ok(vec![
        Figure::at_most(file, "signed thrust, relative to the row's largest", over(&raw_error, &all), THRUST_TOLERANCE),
        Figure::at_most(file, "thrust, relative to the row's largest", over(&thrust_error, &all), THRUST_TOLERANCE),
        Figure::at_most(
            file,
            "pressure coefficient",
            over(&|row| difference(&cdp[row], &steps[row].2.pressure_coefficients), &all),
            1e-6,
        ),
        Figure::at_most(
            file,
            "pressure, Pa",
            over(&|row| difference(&dp[row], &steps[row].2.pressures_pa), &all),
            1e-3,
        ),
        Figure::at_most(file, "flap angle, rad", over(&angles, &ordinary), 1e-4),
        Figure::at_most(file, "flap angle, extreme, rad", over(&angles, &all), 1e-3),
        Figure::at_most(file, "counts before truncation", over(&counts, &ordinary), 0.02),
        Figure::at_most(file, "counts before truncation, extreme", over(&counts, &all), 0.3),
        Figure::at_most(file, "bytes", over(&|row| difference(&servo[row], &bytes(row)), &all), 1.0),
        Figure {
            file,
            quantity: format!("share of {count} bytes equal, modes 1 to 3"),
            value: same as f64 / f64::from(count),
            at_least: 0.999,
            at_most: 1.0,
        },
        Figure::at_most(
            file,
            "impeller bytes",
            over(&|row| difference(&impellers[row], &steps[row].2.bytes.impeller_speeds.map(f64::from)), &all),
            0.0,
        ),
        Figure::at_most(file, "wrench given with impellers off", over(&off, &|row| !flown(row)), 0.0),
        Figure {
            file,
            quantity: "rows within every limit".to_owned(),
            value: number(&exact),
            at_least: 500.0,
            at_most: f64::INFINITY,
        },
        Figure::at_most(file, "round trip of these, N and N m", over(&round_trip, &exact), 1e-9),
        Figure::at_most(file, "the same in bytes, thrusts of one count", over(&in_bytes, &exact), 1.0),
        Figure {
            file,
            quantity: "force that the thesis's table adds, N".to_owned(),
            value: over(&thesis_table, &all),
            at_least: 0.060,
            at_most: 0.062,
        },
    ])
}

/// Everything in `plant_static.csv`.
fn thrusts(path: &Path) -> Result<Vec<Figure>, Failure> {
    let rows = columns(path, &["pm", "N", "cdp", "dp", "fx", "fy", "fz", "tx", "ty", "tz"])?;
    let openings: Vec<[f64; 6]> = numbered(path, "dtheta")?;
    let simulated: Vec<[f64; 6]> = numbered(path, "thrust_sim")?;
    let mut errors = [0.0; 4];
    for (([pm, n, cdp, dp, fx, fy, fz, tx, ty, tz], openings_rad), thrusts_n) in
        rows.iter().zip(&openings).zip(&simulated)
    {
        let module = if *pm < 1.5 { Module::Starboard } else { Module::Port };
        let flow = InverseAllocation::default().module(module, *n, openings_rad);
        let physical = thrusts_n.map(|thrust| thrust / SIMULATION_FACTOR);
        let wrench = Wrench::new(Vector3::new(*tx, *ty, *tz), Vector3::new(*fx, *fy, *fz)) * (1.0 / SIMULATION_FACTOR);
        let found = [
            difference(&flow.thrusts_n, &physical),
            (module.wrench_of_thrusts(&flow.thrusts_n) - wrench).to_vector().amax(),
            (flow.pressure_coefficient - cdp).abs(),
            (flow.pressure_pa - dp).abs(),
        ];
        for (worst, error) in errors.iter_mut().zip(found) {
            *worst = largest([*worst, error]);
        }
    }
    let quantities = ["thrust, N", "wrench, N and N m", "pressure coefficient", "pressure, Pa"];
    let bounds = [1e-6, 1e-6, 1e-6, 1e-3];
    let figures = quantities.into_iter().zip(errors).zip(bounds);
    Ok(figures.map(|((quantity, error), bound)| Figure::at_most(STATIC, quantity, error, bound)).collect())
}

/// Times both directions.
pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    const COUNT: usize = 256;
    let mut generator = ChaCha8Rng::seed_from_u64(11);
    let com = Vector3::new(0.003_713_818, -0.000_326_347, -0.002_532_192);
    let allocation = ForceAllocation::new(ImpellerMode::Nominal, com);
    let mut draw = |size: f64| Vector3::from_fn(|_, _| size * signed_unit(&mut generator));
    let wrenches: Vec<Wrench<f64>> = (0..COUNT).map(|_| Wrench::new(draw(0.003), draw(0.03))).collect();
    let refused = |error: tumble_dynamics::DynamicsError| Failure::BadInput(error.to_string());
    let steps: Result<Vec<Allocation>, _> = wrenches.iter().map(|wrench| allocation.allocate_steps(wrench)).collect();
    let steps = steps.map_err(refused)?;
    let exact = |i: &usize| steps[*i].limits.is_exact();
    let error = |i: usize| (allocation.realize(&steps[i].flaps) - wrenches[i]).to_vector().amax();
    let quality = [("round_trip", largest((0..COUNT).filter(exact).map(error)))];
    let quantized = QuantizedAllocation(allocation);
    let goal = |target_ns: f64| Goal { target_ns: Some(target_ns), peer: None };
    bench.sweep(PROBLEM, "allocate", goal(1000.0), COUNT, &quality, |i| allocation.allocate(&wrenches[i]));
    bench.sweep(PROBLEM, "allocate_bytes", goal(1000.0), COUNT, &[], |i| quantized.allocate(&wrenches[i]));
    bench.sweep(PROBLEM, "realize", goal(500.0), COUNT, &quality, |i| allocation.realize(&steps[i].flaps));
    bench.sweep(PROBLEM, "realize_bytes", goal(500.0), COUNT, &[], |i| quantized.realize(&steps[i].bytes));
    Ok(())
}
