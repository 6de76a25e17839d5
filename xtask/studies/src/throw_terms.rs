//! `study throws`: each configuration of `delft_throws` read with a calibration that its throws had no part in, with every
//! modelled error of the sensors left out in turn, and by plain least squares; then where the sigmas come from, and the angles
//! between the gyro's axes by the throws of one body at a time.

use std::path::Path;

use nalgebra::Vector3;
use tumble_formats::wheel_throw::CalibrationBodies;
use tumble_identification::wheel::{
    ErrorBudget, ObjectEstimate, SensorErrors, ThrowRecord, ThrowSettings, sensor_axes, wheel_delay,
};

use crate::Failure;
use crate::arguments::Arguments;
use crate::plain_throws::PlainDevice;
use crate::throws::{
    self, DEVICE, PROOF, Reference, calibrated, errors_without, objects, of, plain_mean, proof_reference, references,
    summarize,
};

/// What is changed: its name, and how.
type Change = (&'static str, fn(SensorErrors, ThrowSettings) -> (SensorErrors, ThrowSettings));

/// The model as it is, each term of it left out, and other settings of the reading.
const CHANGES: [Change; 9] = [
    ("as modelled", |errors, settings| (errors, settings)),
    ("gyro's axes at right angles", |errors, settings| (SensorErrors { gyro_shear: [0.0; 3], ..errors }, settings)),
    ("gyro's axes of one scale", |errors, settings| (SensorErrors { gyro_factor: [1.0; 3], ..errors }, settings)),
    ("wheel along z", |errors, settings| (SensorErrors { wheel_tilt: [0.0; 2], ..errors }, settings)),
    ("telemetry without delay", |errors, settings| (SensorErrors { wheel_delay_s: 0.0, ..errors }, settings)),
    ("sensors as they read", |_, settings| (SensorErrors::default(), settings)),
    ("windows half as long again", |errors, settings| {
        (errors, ThrowSettings { window_s: 1.5 * settings.window_s, ..settings })
    }),
    ("residual torque halved", |errors, settings| {
        (errors, ThrowSettings { momentum_walk_rad_s: 0.5 * settings.momentum_walk_rad_s, ..settings })
    }),
    ("first and last 25 ms left out", |errors, settings| {
        let (start_s, end_guard_s) = (settings.start_s + 0.025, settings.end_guard_s + 0.025);
        (errors, ThrowSettings { start_s, end_guard_s, ..settings })
    }),
];

/// Runs the study on `--data` (the folder that holds `delft_throws`), else `TUMBLE_DATA`, else `../shared/data`.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let from_environment = std::env::var("TUMBLE_DATA").ok();
    let usual: Vec<&str> = from_environment.as_deref().into_iter().chain(["../shared/data"]).collect();
    let folder = arguments
        .folder("--data", &usual)?
        .map(|folder| folder.join(throws::SET))
        .filter(|folder| folder.is_dir())
        .ok_or_else(|| Failure::BadInput(format!("no folder `{}`: name its parent with --data DIR", throws::SET)))?;
    study(&folder)
}

fn study(folder: &Path) -> Result<(), Failure> {
    let (bodies, settings) = (CalibrationBodies::default(), ThrowSettings::default());
    let mut unread = Vec::new();
    let records = throws::records(&throws::throws(folder)?.0, &settings, &mut unread)?;
    for why in unread {
        eprintln!("not read: {why}");
    }
    let (device, proof) = (of(&records, DEVICE), of(&records, PROOF));
    let mut budgets = Vec::new();
    for reference in references(folder)?.iter().chain([&proof_reference(&bodies)]) {
        let configuration = reference.configuration.as_str();
        let throws = of(&records, configuration);
        if throws.is_empty() {
            continue;
        }
        let errors = errors_without(&records, configuration, &settings)?;
        println!(
            "{configuration}, {} throws, {}",
            throws.len(),
            if configuration == PROOF { "in the calibration" } else { "left out of the calibration" }
        );
        println!("  {:<32}{:>8}{:>8}{:>9}{:>9}   mean of each principal value", "", "mean", "max", "scatter", "cover");
        for (name, change) in CHANGES {
            let (errors, settings) = change(errors, settings);
            let found = objects(&throws, &calibrated(&records, &errors, &bodies, &settings)?, reference.mass_kg);
            print_row(name, &found, reference);
            if name == CHANGES[0].0 {
                budgets.push((configuration.to_owned(), budget(&found)));
            }
        }
        for (name, errors) in [("plain least squares", SensorErrors::default()), ("  on corrected sensors", errors)] {
            let correct =
                |throws: &[ThrowRecord]| throws.iter().map(|throw| throw.corrected(&errors)).collect::<Vec<_>>();
            let plain = PlainDevice::calibrated(&correct(&device), &correct(&proof), &bodies, &settings);
            if let Some(mean) = plain.and_then(|plain| plain_mean(&plain, &correct(&throws), reference)) {
                println!("  {name:<32}{mean:>8.2}");
            }
        }
    }
    println!(
        "one sigma of a principal value, percent of it, root mean square over throws and values, and shares of the variance"
    );
    println!("  {:<12}{:>8}{:>10}{:>14}{:>14}{:>8}", "", "sigma", "throw", "calibration", "sensor axes", "delay");
    for (configuration, [throw, calibration, axes, delay]) in budgets {
        let whole = throw + calibration + axes + delay;
        let [throw, calibration, axes, delay] = [throw, calibration, axes, delay].map(|part| 100.0 * part / whole);
        println!(
            "  {configuration:<12}{:>6.2} %{throw:>8.0} %{calibration:>12.0} %{axes:>12.0} %{delay:>6.0} %",
            100.0 * whole.sqrt()
        );
    }
    println!("angles between the gyro's axes off a right one by the throws of one body alone, percent of a radian");
    let (delay_s, _) = wheel_delay(&[&device, &proof], &settings).map_err(|error| Failure::file(folder, error))?;
    for configuration in records.keys() {
        let errors = sensor_axes(&[&of(&records, configuration)], delay_s, &settings)
            .map_err(|error| Failure::file(folder, error))?;
        let angle =
            |i: usize| format!("{:.2} +- {:.2}", 100.0 * errors.gyro_shear[i], 100.0 * errors.gyro_shear_sigma[i]);
        println!("  {configuration:<12}  xy {:>14}  xz {:>14}  yz {:>14}", angle(0), angle(1), angle(2));
    }
    Ok(())
}

fn print_row(name: &str, found: &[ObjectEstimate], reference: &Reference) {
    let Some(summary) = summarize(found, reference) else {
        println!("  {name:<32}  no throw identified");
        return;
    };
    let sum: Vector3<f64> = found.iter().map(|object| object.principal_inertia).sum();
    let mean =
        (sum / found.len() as f64).component_div(&reference.principal_inertia).map(|ratio| 100.0 * (ratio - 1.0));
    println!(
        "  {name:<32}{:>8.2}{:>8.2}{:>9.2}{:>8.1} %   {:+.2} {:+.2} {:+.2} %",
        summary.mean_error_percent,
        summary.max_error_percent,
        summary.trace_scatter_percent,
        summary.coverage_percent,
        mean.x,
        mean.y,
        mean.z
    );
}

/// Mean square of each part of the sigmas, relative to the principal values.
fn budget(found: &[ObjectEstimate]) -> [f64; 4] {
    let parts: [fn(&ErrorBudget) -> Vector3<f64>; 4] =
        [|of| of.throw, |of| of.calibration, |of| of.sensor_axes, |of| of.wheel_delay];
    parts.map(|part| {
        let square =
            |object: &ObjectEstimate| part(&object.budget).component_div(&object.principal_inertia).norm_squared();
        found.iter().map(square).sum::<f64>() / (3.0 * found.len() as f64)
    })
}
