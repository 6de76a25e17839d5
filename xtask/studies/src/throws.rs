//! `real-data`, set `delft_throws`: wheel-driven throws against bodies of known inertia.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use tumble_formats::wheel_throw::{CalibrationBodies, CalibrationKind, calibrate_files, read_throw};
use tumble_identification::wheel::{
    FreeFallEstimate, ObjectEstimate, SensorErrors, ThrowRecord, ThrowSettings, WheelCalibration, calibrate,
    identify_throw,
};

use crate::Failure;
use crate::plain_throws::PlainDevice;

/// Name of the set and of its folder.
pub const SET: &str = "delft_throws";
/// The device alone.
pub const DEVICE: &str = "cal_device";
/// Device with the proof block: a calibration throw reported like an object.
pub const PROOF: &str = "cal_proof";
/// The reference is known to one percent.
const REFERENCE_SIGMA: f64 = 0.01;
/// The configurations that have a target.
const TARGETED: [&str; 3] = ["grid_empty", "grid_a", "grid_b"];
/// Largest mean error and scatter of the trace, percent; where one is missed, the mean must be below this share of that of
/// plain least squares on the same throws.
const MEAN_TARGET: f64 = 1.5;
const SCATTER_TARGET: f64 = 1.2;
const SHARE_OF_PLAIN: f64 = 0.85;
/// Largest mean error of the proof block, percent.
const PROOF_TARGET: f64 = 0.7;
/// Largest error of a single throw of an object with a target, percent.
const THROW_TARGET: f64 = 4.0;
/// Least share, percent, that two sigma must cover, of any object.
const COVERAGE_TARGET: f64 = 90.0;
/// Largest mean error and least coverage, percent, of a configuration whose throws had no part in the calibration.
const LEFT_OUT_MEAN_TARGET: f64 = 1.6;
const LEFT_OUT_COVERAGE_TARGET: f64 = 93.0;

/// A configuration's reference: mass, kg, and ascending principal inertias, kg m^2.
pub struct Reference {
    pub configuration: String,
    pub mass_kg: f64,
    pub principal_inertia: Vector3<f64>,
}

/// One line of the report.
#[allow(clippy::struct_field_names, reason = "the unit belongs in the name")]
pub struct Summary {
    pub mean_error_percent: f64,
    pub max_error_percent: f64,
    pub trace_scatter_percent: f64,
    pub coverage_percent: f64,
}

/// Processes the throws in `folder`, prints one line per configuration; the targets missed, in words.
pub fn run(folder: &Path, json: bool) -> Result<Vec<String>, Failure> {
    let references = references(folder)?;
    let (throws, skipped) = throws(folder)?;
    if skipped > 0 {
        eprintln!("{SET}: {skipped} throws of the index have no file, skipped");
    }
    let bodies = CalibrationBodies::default();
    let settings = ThrowSettings::default();
    let mut missed = Vec::new();
    let records = records(&throws, &settings, &mut missed)?;
    // As `tumble calibrate-wheel` does it with `--throws`.
    let files: Vec<(CalibrationKind, PathBuf)> = records
        .iter()
        .flat_map(|(configuration, throws)| {
            let kind = match configuration.as_str() {
                DEVICE => CalibrationKind::Device,
                PROOF => CalibrationKind::Proof,
                _ => CalibrationKind::Other,
            };
            throws.iter().map(move |(path, _)| (kind, path.clone()))
        })
        .collect();
    let calibration = calibrate_files(&files, &bodies, &settings).map_err(|error| Failure::file(folder, error))?;
    print_sensors(&calibration.sensor_errors);
    eprintln!(
        "{SET}: wheel inertia {:.4e} kg m^2, one sigma {:.1e}",
        calibration.wheel_inertia_kg_m2,
        calibration.covariance[9][9].sqrt()
    );

    let plain_device = PlainDevice::calibrated(&of(&records, DEVICE), &of(&records, PROOF), &bodies, &settings);
    let proof = proof_reference(&bodies);
    for reference in references.iter().chain([&proof]) {
        let configuration = reference.configuration.as_str();
        let mut objects = Vec::new();
        let throws = of(&records, configuration);
        for throw in &throws {
            match identify_throw(throw, &calibration, Some(reference.mass_kg)) {
                Ok(estimate) => objects.extend(estimate.object),
                Err(error) => missed.push(format!("{configuration}: {error}")),
            }
        }
        let summary = summarize(&objects, reference);
        let plain = plain_device.as_ref().and_then(|device| plain_mean(device, &throws, reference));
        let targeted = TARGETED.contains(&configuration);
        let left_out = left_out(&records, reference, &bodies, &settings)?;
        if let Some(left_out) = left_out.as_ref().filter(|_| targeted) {
            missed.extend(left_out_missed(configuration, left_out, plain));
        }
        print_line(configuration, objects.len(), summary.as_ref(), left_out.as_ref(), plain, json);
        let Some(summary) = summary else {
            if targeted || configuration == PROOF {
                missed.push(format!("{configuration}: no throw"));
            }
            continue;
        };
        let (mean, scatter) = (summary.mean_error_percent, summary.trace_scatter_percent);
        if summary.coverage_percent < COVERAGE_TARGET {
            let coverage = summary.coverage_percent;
            missed.push(format!("{configuration}: two sigma cover {coverage:.1} %, target {COVERAGE_TARGET} %"));
        }
        if configuration == PROOF && mean > PROOF_TARGET {
            missed.push(format!("{configuration}: mean error {mean:.2} %, target {PROOF_TARGET} %"));
        }
        let Some(plain) = plain.filter(|_| targeted) else {
            continue;
        };
        if mean > MEAN_TARGET || scatter > SCATTER_TARGET {
            let wheel = 100.0 * calibration.covariance[9][9].sqrt() / calibration.wheel_inertia_kg_m2;
            eprintln!(
                "{SET}: {configuration}: {:.0} % below plain least squares; budget: scatter of the throws {scatter:.1} %, \
                 wheel inertia {wheel:.1} %, reference {:.0} %",
                100.0 * (1.0 - mean / plain),
                100.0 * REFERENCE_SIGMA
            );
            if mean > SHARE_OF_PLAIN * plain {
                missed.push(format!(
                    "{configuration}: mean error {mean:.2} %, scatter {scatter:.2} %, targets {MEAN_TARGET} % and \
                     {SCATTER_TARGET} %, or a mean error of {:.2} %",
                    SHARE_OF_PLAIN * plain
                ));
            }
        }
        if summary.max_error_percent > THROW_TARGET {
            let max = summary.max_error_percent;
            missed.push(format!("{configuration}: a throw with error {max:.2} %, target {THROW_TARGET} %"));
        }
    }
    Ok(missed)
}

/// The proof block as a configuration.
pub fn proof_reference(bodies: &CalibrationBodies) -> Reference {
    let mut principal_inertia = bodies.proof_block().inertia_about_com().diagonal();
    principal_inertia.as_mut_slice().sort_by(f64::total_cmp);
    Reference { configuration: PROOF.to_owned(), mass_kg: bodies.proof_mass_kg, principal_inertia }
}

/// How the sensors err, on standard error.
fn print_sensors(errors: &SensorErrors) {
    let percent = |value: f64, sigma: f64| format!("{:.2} +- {:.2} %", 100.0 * value, 100.0 * sigma);
    eprintln!(
        "{SET}: wheel recorded {:.2} +- {:.2} ms late",
        1e3 * errors.wheel_delay_s,
        1e3 * errors.wheel_delay_sigma_s
    );
    for (axis, (factor, sigma)) in ["x", "y", "z"].iter().zip(errors.gyro_factor.iter().zip(errors.gyro_factor_sigma)) {
        eprintln!("{SET}: gyro {axis} reads {} low", percent(factor - 1.0, sigma));
    }
    for (pair, (shear, sigma)) in ["xy", "xz", "yz"].iter().zip(errors.gyro_shear.iter().zip(errors.gyro_shear_sigma)) {
        eprintln!("{SET}: gyro axes {pair} off the right angle by {} of a radian", percent(*shear, sigma));
    }
    for (axis, (tilt, sigma)) in ["x", "y"].iter().zip(errors.wheel_tilt.iter().zip(errors.wheel_tilt_sigma)) {
        eprintln!("{SET}: wheel tilted towards {axis} by {} of a radian", percent(*tilt, sigma));
    }
}

/// The throws of one configuration.
pub fn of(records: &BTreeMap<String, Vec<Throw>>, configuration: &str) -> Vec<ThrowRecord> {
    records.get(configuration).into_iter().flatten().map(|(_, record)| record.clone()).collect()
}

/// How the sensors err by all throws but those of `configuration`; the device and the proof block calibrate and stay.
pub fn errors_without(
    records: &BTreeMap<String, Vec<Throw>>,
    configuration: &str,
    settings: &ThrowSettings,
) -> Result<SensorErrors, Failure> {
    let others: Vec<Vec<ThrowRecord>> = records
        .keys()
        .filter(|name| ![DEVICE, PROOF, configuration].contains(&name.as_str()))
        .map(|name| of(records, name))
        .collect();
    let others: Vec<&[ThrowRecord]> = others.iter().map(Vec::as_slice).collect();
    SensorErrors::from_throws(&[&of(records, DEVICE), &of(records, PROOF)], &others, settings)
        .map_err(|error| Failure::BadInput(format!("without {configuration}: {error}")))
}

/// The device's calibration with sensors that err so.
pub fn calibrated(
    records: &BTreeMap<String, Vec<Throw>>,
    errors: &SensorErrors,
    bodies: &CalibrationBodies,
    settings: &ThrowSettings,
) -> Result<WheelCalibration, Failure> {
    let (device, proof) = (of(records, DEVICE), of(records, PROOF));
    calibrate(&device, &proof, bodies.device_mass_kg, &bodies.proof_block(), errors, settings)
        .map_err(|error| Failure::BadInput(error.to_string()))
}

/// A configuration read with a calibration that its throws had no part in; `None` without throws and for the proof block,
/// without which there is no calibration.
fn left_out(
    records: &BTreeMap<String, Vec<Throw>>,
    reference: &Reference,
    bodies: &CalibrationBodies,
    settings: &ThrowSettings,
) -> Result<Option<Summary>, Failure> {
    let configuration = reference.configuration.as_str();
    if configuration == PROOF || !records.contains_key(configuration) {
        return Ok(None);
    }
    let calibration = calibrated(records, &errors_without(records, configuration, settings)?, bodies, settings)?;
    Ok(summarize(&objects(&of(records, configuration), &calibration, reference.mass_kg), reference))
}

/// The objects of the throws that can be identified.
pub fn objects(throws: &[ThrowRecord], calibration: &WheelCalibration, mass_kg: f64) -> Vec<ObjectEstimate> {
    let found = throws.iter().filter_map(|throw| identify_throw(throw, calibration, Some(mass_kg)).ok());
    found.filter_map(|estimate| estimate.object).collect()
}

/// What a configuration left out of the calibration misses.
fn left_out_missed(configuration: &str, left_out: &Summary, plain: Option<f64>) -> Vec<String> {
    let (mean, coverage) = (left_out.mean_error_percent, left_out.coverage_percent);
    let mut missed = Vec::new();
    if mean > LEFT_OUT_MEAN_TARGET {
        missed.push(format!("{configuration} left out: mean error {mean:.2} %, target {LEFT_OUT_MEAN_TARGET} %"));
    }
    if coverage < LEFT_OUT_COVERAGE_TARGET {
        missed.push(format!(
            "{configuration} left out: two sigma cover {coverage:.1} %, target {LEFT_OUT_COVERAGE_TARGET} %"
        ));
    }
    if let Some(plain) = plain.filter(|plain| mean > *plain) {
        missed.push(format!("{configuration} left out: mean error {mean:.2} %, plain least squares {plain:.2} %"));
    }
    missed
}

/// Error of principal inertias, percent.
fn error_percent(principal: &Vector3<f64>, truth: &Vector3<f64>) -> f64 {
    100.0 * (principal - truth).norm() / truth.norm()
}

/// A throw and its file.
pub type Throw = (PathBuf, ThrowRecord);

/// The throws that can be read as one, by configuration; the others are misses.
pub fn records(
    throws: &BTreeMap<String, Vec<PathBuf>>,
    settings: &ThrowSettings,
    missed: &mut Vec<String>,
) -> Result<BTreeMap<String, Vec<Throw>>, Failure> {
    let mut records: BTreeMap<String, Vec<Throw>> = BTreeMap::new();
    for (configuration, paths) in throws {
        for path in paths {
            let record = read_throw(path).map_err(|error| Failure::BadInput(error.to_string()))?;
            match FreeFallEstimate::from_throw(&record, settings) {
                Ok(_) => records.entry(configuration.clone()).or_default().push((path.clone(), record)),
                Err(error) => missed.push(format!("{}: {error}", path.display())),
            }
        }
    }
    Ok(records)
}

/// Errors of the throws; `None` without throws.
///
/// The mean error is that of the throws, except for the proof block: a calibration averages its throws, so there it is
/// the error of their average.
pub fn summarize(objects: &[ObjectEstimate], reference: &Reference) -> Option<Summary> {
    let n = objects.len() as f64;
    let truth = &reference.principal_inertia;
    let percent = |principal: &Vector3<f64>| error_percent(principal, truth);
    let errors: Vec<f64> = objects.iter().map(|object| percent(&object.principal_inertia)).collect();
    let max_error_percent = errors.iter().copied().reduce(f64::max)?;
    let mean_error_percent = if reference.configuration == PROOF {
        let inertias = objects.iter().map(|object| object.body.inertia_about_com());
        let mut principal = (inertias.sum::<nalgebra::Matrix3<f64>>() / n).symmetric_eigenvalues();
        principal.as_mut_slice().sort_by(f64::total_cmp);
        let of_throws = errors.iter().sum::<f64>() / n;
        eprintln!("{SET}: {PROOF}: mean error is that of the average of the throws; {of_throws:.2} % throw by throw");
        percent(&principal)
    } else {
        errors.iter().sum::<f64>() / n
    };
    let traces: Vec<f64> = objects.iter().map(|object| object.principal_inertia.sum()).collect();
    let mean_trace = traces.iter().sum::<f64>() / n;
    let variance = traces.iter().map(|trace| (trace - mean_trace).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let covered = objects.iter().flat_map(|object| (0..3).map(move |axis| (object, axis))).filter(|(object, axis)| {
        let (error, sigma) = (object.principal_inertia[*axis] - truth[*axis], object.principal_inertia_sigma[*axis]);
        error.abs() <= 2.0 * sigma.hypot(REFERENCE_SIGMA * truth[*axis])
    });
    Some(Summary {
        mean_error_percent,
        max_error_percent,
        trace_scatter_percent: 100.0 * variance.sqrt() / mean_trace,
        coverage_percent: 100.0 * covered.count() as f64 / (3.0 * n),
    })
}

/// Mean error, percent, of plain least squares on the throws.
pub fn plain_mean(device: &PlainDevice, throws: &[ThrowRecord], reference: &Reference) -> Option<f64> {
    let errors = throws
        .iter()
        .map(|throw| {
            let principal = device.principal_inertia(throw, reference.mass_kg)?;
            Some(error_percent(&principal, &reference.principal_inertia))
        })
        .collect::<Option<Vec<f64>>>()?;
    (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64)
}

fn print_line(
    configuration: &str,
    n: usize,
    summary: Option<&Summary>,
    left_out: Option<&Summary>,
    plain: Option<f64>,
    json: bool,
) {
    let [mean, max, scatter, coverage] = summary.map_or([None; 4], |summary| {
        [
            Some(summary.mean_error_percent),
            Some(summary.max_error_percent),
            Some(summary.trace_scatter_percent),
            Some(summary.coverage_percent),
        ]
    });
    if json {
        let line = serde_json::json!({
            "dataset": SET,
            "configuration": configuration,
            "n": n,
            "mean_error_percent": mean,
            "max_error_percent": max,
            "trace_scatter_percent": scatter,
            "coverage_2sigma_percent": coverage,
            "left_out_mean_error_percent": left_out.map(|left_out| left_out.mean_error_percent),
            "left_out_coverage_2sigma_percent": left_out.map(|left_out| left_out.coverage_percent),
            "plain_mean_error_percent": plain,
        });
        println!("{line}");
    } else if let (Some(mean), Some(max), Some(scatter), Some(coverage)) = (mean, max, scatter, coverage) {
        println!(
            "{SET}  {configuration:<12} {n:>3} throws  error mean {mean:5.2} % max {max:5.2} %  \
             trace scatter {scatter:5.2} %  two sigma cover {coverage:5.1} %{}{}",
            left_out.map_or(String::new(), |left_out| format!(
                "  left out of the calibration mean {:5.2} % cover {:5.1} %",
                left_out.mean_error_percent, left_out.coverage_percent
            )),
            plain.map_or(String::new(), |plain| format!("  plain least squares mean {plain:5.2} %"))
        );
    } else {
        println!("{SET}  {configuration:<12}   0 throws");
    }
}

/// Rows of `references.csv`.
pub fn references(folder: &Path) -> Result<Vec<Reference>, Failure> {
    let path = folder.join("references.csv");
    let table = table(&path)?;
    let wanted = ["mass_kg", "principal_inertia_1_kg_m2", "principal_inertia_2_kg_m2", "principal_inertia_3_kg_m2"];
    table
        .iter()
        .map(|row| {
            let text = |column: &str| {
                row.get(column).ok_or_else(|| Failure::file(&path, format!("column `{column}` is missing")))
            };
            let mut numbers = [0.0; 4];
            for (number, column) in numbers.iter_mut().zip(wanted) {
                let cell = text(column)?;
                *number =
                    cell.parse().ok().filter(|value: &f64| *value > 0.0 && value.is_finite()).ok_or_else(|| {
                        Failure::file(&path, format!("column `{column}`: `{cell}` is not a positive number"))
                    })?;
            }
            let [mass_kg, mut principal @ ..] = numbers;
            principal.sort_by(f64::total_cmp);
            Ok(Reference {
                configuration: text("configuration")?.clone(),
                mass_kg,
                principal_inertia: Vector3::from(principal),
            })
        })
        .collect()
}

/// Files by configuration: that of the index, else the name before the last underscore; and how many files of the index
/// are not there.
pub fn throws(folder: &Path) -> Result<(BTreeMap<String, Vec<PathBuf>>, usize), Failure> {
    let index = folder.join("index.csv");
    let indexed: BTreeMap<String, String> = if index.is_file() {
        let rows = table(&index)?.into_iter();
        rows.filter_map(|mut row| Some((row.remove("file")?, row.remove("configuration")?))).collect()
    } else {
        BTreeMap::new()
    };
    let skipped = indexed.keys().filter(|file| !folder.join(file).is_file()).count();
    let entries = std::fs::read_dir(folder).map_err(|error| Failure::file(folder, error))?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.sort();
    let mut throws: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for path in files.into_iter().filter(|path| path.extension().is_some_and(|extension| extension == "csv")) {
        let [name, stem] =
            [path.file_name(), path.file_stem()].map(|part| part.map(|part| part.to_string_lossy().into_owned()));
        let configuration = name
            .and_then(|name| indexed.get(&name).cloned())
            .or_else(|| stem.and_then(|stem| stem.rsplit_once('_').map(|(configuration, _)| configuration.to_owned())));
        if let Some(configuration) = configuration {
            throws.entry(configuration).or_default().push(path);
        }
    }
    Ok((throws, skipped))
}

/// A plain comma-separated table, rows as maps from column to cell.
fn table(path: &Path) -> Result<Vec<BTreeMap<String, String>>, Failure> {
    let text = std::fs::read_to_string(path).map_err(|error| Failure::file(path, error))?;
    let mut lines = text.lines().filter(|line| !line.trim().is_empty());
    let columns: Vec<&str> = lines.next().unwrap_or_default().split(',').map(str::trim).collect();
    Ok(lines
        .map(|line| {
            columns
                .iter()
                .map(|column| (*column).to_owned())
                .zip(line.split(',').map(|cell| cell.trim().to_owned()))
                .collect()
        })
        .collect())
}
