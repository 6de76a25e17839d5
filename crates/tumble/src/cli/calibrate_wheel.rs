//! `tumble calibrate-wheel` and `tumble identify --wheel`.

use super::{Outcome, print};
use crate::output::write_file;
use crate::{TumbleError, report};
use clap::Args;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use tumble_dynamics::nalgebra::{Matrix3, SMatrix, Vector3};
use tumble_formats::FormatsError;
use tumble_formats::body_file::rows;
use tumble_formats::wheel_throw::{
    CalibrationBodies, CalibrationKind, calibrate_files, calibration_to_toml, read_calibration, read_throw,
};
use tumble_identification::estimator::Verdict;
use tumble_identification::wheel::{
    ErrorBudget, ObjectEstimate, SensorErrors, ThrowEstimate, ThrowSettings, identify_throw as identify,
};

/// Options of `tumble calibrate-wheel`.
#[derive(Args)]
pub struct CalibrateWheelArgs {
    /// Throws named `cal_device*` (the device alone) and `cal_proof*` (with the proof block).
    #[arg(value_name = "THROW")]
    throws: Vec<PathBuf>,
    /// Throws of the device alone, whatever their names.
    #[arg(long, value_name = "THROW", num_args = 1..)]
    device: Vec<PathBuf>,
    /// Throws of the device with the proof block, whatever their names.
    #[arg(long, value_name = "THROW", num_args = 1..)]
    proof: Vec<PathBuf>,
    /// Throws of other bodies, which only help to learn how the sensors err; those of one body share their name up to the
    /// last underscore.
    #[arg(long = "throws", value_name = "THROW", num_args = 1..)]
    others: Vec<PathBuf>,
    /// Mass of the device, kg.
    #[arg(long, value_name = "KG", default_value_t = CalibrationBodies::default().device_mass_kg)]
    device_mass: f64,
    /// Mass of the proof block, kg.
    #[arg(long, value_name = "KG", default_value_t = CalibrationBodies::default().proof_mass_kg)]
    proof_mass: f64,
    /// Sides of the proof block along the device's axes, m.
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', num_args = 3, default_value = "0.0600,0.0700,0.0302")]
    proof_sides: Vec<f64>,
    /// Calibration file to write (TOML).
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Replace the calibration file if it exists.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for bad input.
pub fn run(args: &CalibrateWheelArgs) -> Result<Outcome, TumbleError> {
    let mut files = Vec::new();
    for path in &args.throws {
        files.push((CalibrationKind::of_file(path)?, path.clone()));
    }
    files.extend(args.device.iter().map(|path| (CalibrationKind::Device, path.clone())));
    files.extend(args.proof.iter().map(|path| (CalibrationKind::Proof, path.clone())));
    files.extend(args.others.iter().map(|path| (CalibrationKind::Other, path.clone())));
    let positive =
        [args.device_mass, args.proof_mass].iter().chain(&args.proof_sides).all(|x| *x > 0.0 && x.is_finite());
    let &[x, y, z] = args.proof_sides.as_slice() else {
        return Err(TumbleError::BadOption { message: "`--proof-sides` takes three lengths".to_owned() });
    };
    if !positive {
        return Err(TumbleError::BadOption { message: "masses and sides are positive numbers".to_owned() });
    }
    let bodies = CalibrationBodies {
        device_mass_kg: args.device_mass,
        proof_mass_kg: args.proof_mass,
        proof_sides_m: [x, y, z],
    };
    let calibration = calibrate_files(&files, &bodies, &ThrowSettings::default())?;
    let text = calibration_to_toml(&calibration)
        .map_err(|error| FormatsError::BadToml { path: args.out.clone(), message: error.to_string() })?;
    write_file(&args.out, text.as_bytes(), args.force)?;
    let verdict = calibration.verdict();
    let count = |kind| files.iter().filter(|(k, _)| *k == kind).count();
    print(&format!(
        "{} device throws, {} proof throws, {} others\n{}  wheel inertia {:.4e} kg m^2, 1 sigma {:.1e}\nverdict: {}\nwrote {}\n",
        count(CalibrationKind::Device),
        count(CalibrationKind::Proof),
        count(CalibrationKind::Other),
        sensors(&calibration.sensor_errors),
        calibration.wheel_inertia_kg_m2,
        calibration.covariance[9][9].sqrt(),
        report::said(verdict, "the throws agree with the block".to_owned(), "the wheel's inertia"),
        args.out.display()
    ))?;
    Ok(if verdict.is_identified() { Outcome::Achieved } else { Outcome::NotAchieved })
}

/// How the sensors err, for the eye.
fn sensors(errors: &SensorErrors) -> String {
    if *errors == SensorErrors::default() {
        return "  sensors: the throws do not say how they err; taken as they read\n".to_owned();
    }
    let mut text = format!(
        "  wheel speed {:.3} ms late, 1 sigma {:.3}\n",
        1e3 * errors.wheel_delay_s,
        1e3 * errors.wheel_delay_sigma_s
    );
    for (axis, (factor, sigma)) in ["x", "y", "z"].iter().zip(errors.gyro_factor.iter().zip(errors.gyro_factor_sigma)) {
        let _ = writeln!(text, "  gyro {axis} times {factor:.5}, 1 sigma {sigma:.5}");
    }
    for (pair, (shear, sigma)) in ["xy", "xz", "yz"].iter().zip(errors.gyro_shear.iter().zip(errors.gyro_shear_sigma)) {
        let _ = writeln!(text, "  gyro axes {pair} off the right angle by {shear:.5} rad, 1 sigma {sigma:.5}");
    }
    for (axis, (tilt, sigma)) in ["x", "y"].iter().zip(errors.wheel_tilt.iter().zip(errors.wheel_tilt_sigma)) {
        let _ = writeln!(text, "  wheel tilted towards {axis} by {tilt:.5} rad, 1 sigma {sigma:.5}");
    }
    text
}

/// An object this many times lighter or heavier than the device cannot be told from nothing, or from a wall.
const LARGEST_MASS_RATIO: f64 = 1e3;

/// Identifies one throw: what was thrown, and with `mass_kg` the object without the device.
///
/// # Errors
/// [`TumbleError`] for bad input; a throw that cannot answer is [`Outcome::NotAchieved`].
pub fn identify_throw(
    throw: &Path,
    calibration: &Path,
    mass_kg: Option<f64>,
    as_json: bool,
) -> Result<Outcome, TumbleError> {
    let calibration = read_calibration(calibration)?;
    let sensible = calibration.device_mass_kg / LARGEST_MASS_RATIO..=calibration.device_mass_kg * LARGEST_MASS_RATIO;
    if let Some(mass_kg) = mass_kg.filter(|mass_kg| !sensible.contains(mass_kg)) {
        return Err(TumbleError::BadOption {
            message: format!(
                "`--mass {mass_kg}`: the object's mass in kg, between {:.1e} and {:.1e} for this device",
                sensible.start(),
                sensible.end()
            ),
        });
    }
    let record = read_throw(throw)?;
    let found = match identify(&record, &calibration, mass_kg) {
        Ok(found) => found,
        Err(error) if Verdict::of_refusal(&error).is_some() => {
            tell_line!("{}: {error}", throw.display());
            return Ok(Outcome::NotAchieved);
        }
        Err(error) => return Err(error.into()),
    };
    if as_json {
        print(&format!("{}\n", json(&found, record.samples().len(), mass_kg)))?;
    } else {
        print(&table(throw, &found))?;
    }
    Ok(if found.verdict.is_identified() { Outcome::Achieved } else { Outcome::NotAchieved })
}

/// The inertia that the result is about: of the object where its mass is known, else of device and object.
fn subject(found: &ThrowEstimate) -> (&'static str, Matrix3<f64>, SMatrix<f64, 6, 6>, Vector3<f64>, Matrix3<f64>) {
    match &found.object {
        Some(object) => (
            "object",
            object.body.inertia_about_com(),
            object.inertia_covariance,
            object.body.center_of_mass(),
            object.com_covariance,
        ),
        None => (
            "device and object",
            found.total_inertia_about_com,
            found.total_inertia_covariance,
            found.total_com_m,
            found.total_com_covariance,
        ),
    }
}

/// Standard deviations of a symmetric matrix from the covariance of its entries `[11, 12, 13, 22, 23, 33]`.
fn entry_std(covariance: &SMatrix<f64, 6, 6>) -> Matrix3<f64> {
    let s = covariance.diagonal().map(f64::sqrt);
    Matrix3::new(s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5])
}

fn table(throw: &Path, found: &ThrowEstimate) -> String {
    let (name, inertia, covariance, com, com_covariance) = subject(found);
    let std = entry_std(&covariance);
    let mut text = format!(
        "{}: {name}\n  free fall used to {:.3} s, {} windows\n\n  {:<18}{:>14}{:>12}  unit\n",
        throw.display(),
        found.end_s,
        found.windows,
        "quantity",
        "estimate",
        "1 sigma"
    );
    for (i, axis) in ["x", "y", "z"].into_iter().enumerate() {
        let sigma = com_covariance[(i, i)].sqrt();
        let _ = writeln!(text, "  centre of mass {axis:<3}{:>14.5}{sigma:>12.5}  m", com[i]);
    }
    for (entry, i, j) in [("xx", 0, 0), ("yy", 1, 1), ("zz", 2, 2), ("xy", 0, 1), ("xz", 0, 2), ("yz", 1, 2)] {
        let _ = writeln!(text, "  inertia {entry:<10}{:>14.4e}{:>12.1e}  kg m^2", inertia[(i, j)], std[(i, j)]);
    }
    if let Some(object) = &found.object {
        for i in 0..3 {
            let _ = writeln!(
                text,
                "  principal {:<8}{:>14.4e}{:>12.1e}  kg m^2",
                i + 1,
                object.principal_inertia[i],
                object.principal_inertia_sigma[i]
            );
        }
        text.push_str(&budget(object));
    }
    let identified = match found.object {
        Some(_) => "inertia and centre of mass of the object identified",
        None => "inertia of device and object together identified; --mass KG takes the device away",
    };
    let said = report::said(found.verdict, identified.to_owned(), "a quantity");
    let _ = writeln!(
        text,
        "\nverdict: {said}\n  the inertia explains {:.3} % of what the wheel does to the angular momentum",
        100.0 * found.explained
    );
    if found.object.as_ref().is_some_and(|object| object.projected) {
        let _ = writeln!(
            text,
            "  the data ask for an inertia that no body of this mass has; the nearest one stands above. Check --mass, the calibration and the \
             sign of the wheel speed"
        );
    }
    let _ = writeln!(
        text,
        "  the centre of mass is measured from the inertial sensor, in device axes; a throw does not tell the mass"
    );
    text
}

/// The parts of an object's sigmas.
fn parts(object: &ObjectEstimate) -> [(&'static str, &'static str, Vector3<f64>); 4] {
    let ErrorBudget { throw, calibration, sensor_axes, wheel_delay } = object.budget;
    [
        ("throw", "this throw: noise and residual torque", throw),
        ("calibration", "device and wheel, by the calibration", calibration),
        ("sensor_axes", "axes of the gyro and of the wheel", sensor_axes),
        ("wheel_delay", "delay of the wheel's telemetry", wheel_delay),
    ]
}

/// Where the sigmas of the principal inertias come from, in shares of their variance.
fn budget(object: &ObjectEstimate) -> String {
    let mut text = format!("\n  {:<40}{:>8}{:>8}{:>8}\n", "share of the variance of principal", 1, 2, 3);
    for (_, name, sigma) in parts(object) {
        let share = shares(&sigma, &object.principal_inertia_sigma);
        let _ = writeln!(text, "  {name:<40}{:>6.0} %{:>6.0} %{:>6.0} %", share.x, share.y, share.z);
    }
    text
}

/// Shares of the variance, percent.
fn shares(part: &Vector3<f64>, whole: &Vector3<f64>) -> Vector3<f64> {
    part.zip_map(whole, |part, whole| if whole > 0.0 { 100.0 * (part / whole).powi(2) } else { 0.0 })
}

fn json(found: &ThrowEstimate, samples: usize, mass_kg: Option<f64>) -> String {
    let (name, inertia, covariance, com, com_covariance) = subject(found);
    serde_json::json!({
        "format": 1,
        "method": "wheel-throw",
        "subject": name,
        "identified": found.verdict.is_identified(),
        "doubt": report::doubted(found.verdict),
        "explained": found.explained,
        "samples_used": samples,
        "mass_kg": mass_kg,
        "com_m": <[f64; 3]>::from(com),
        "inertia_about_com_kg_m2": rows(&inertia),
        "principal_inertia_kg_m2": found.object.as_ref().map(|o| <[f64; 3]>::from(o.principal_inertia)),
        "std": {
            "mass_kg": null,
            "com_m": <[f64; 3]>::from(com_covariance.diagonal().map(f64::sqrt)),
            "inertia_about_com_kg_m2": rows(&entry_std(&covariance)),
            "principal_inertia_kg_m2": found.object.as_ref().map(|o| <[f64; 3]>::from(o.principal_inertia_sigma)),
        },
        "variance_share_percent": found.object.as_ref().map(|object| {
            let share = |sigma: &Vector3<f64>| <[f64; 3]>::from(shares(sigma, &object.principal_inertia_sigma));
            parts(object).iter().map(|(key, _, sigma)| ((*key).to_owned(), share(sigma).into())).collect::<serde_json::Map<_, _>>()
        }),
        "total": {
            "com_m": <[f64; 3]>::from(found.total_com_m),
            "inertia_about_com_kg_m2": rows(&found.total_inertia_about_com),
        },
        "free_fall_end_s": found.end_s,
        "projected": found.object.as_ref().map(|o| o.projected),
        "warnings": [],
    })
    .to_string()
}
