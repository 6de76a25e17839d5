//! `real-data`, set `delft_throws`: wheel-driven throws against bodies of known inertia.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use tumble_astrobee::wheel_throw::{CalibrationBodies, read_throw};
use tumble_identification::IdentificationError;
use tumble_identification::wheel::{
    FreeFallEstimate, ObjectEstimate, SensorErrors, ThrowRecord, ThrowSettings, calibrate, gyro_factor, identify_throw,
    wheel_delay,
};

use crate::Failure;

/// Name of the set and of its folder.
pub const SET: &str = "delft_throws";
/// The device alone.
const DEVICE: &str = "cal_device";
/// Device with the proof block: a calibration throw reported like an object.
const PROOF: &str = "cal_proof";
/// The reference is known to one percent.
const REFERENCE_SIGMA: f64 = 0.01;
/// Mean errors, percent, of plain least squares on these throws (20 Hz zero-phase filter, differentiated rates), of the
/// configurations that have a target.
const PLAIN_MEANS: [(&str, f64); 3] = [("grid_empty", 1.37), ("grid_a", 1.58), ("grid_b", 1.93)];
/// Largest mean error and scatter of the trace, percent; where one is missed, the mean must be below this share of plain
/// least squares'.
const MEAN_TARGET: f64 = 1.5;
const SCATTER_TARGET: f64 = 1.2;
const SHARE_OF_PLAIN: f64 = 0.85;
/// Largest mean error of the proof block, percent.
const PROOF_TARGET: f64 = 0.7;
/// Largest error of a single throw of an object with a target, percent.
const THROW_TARGET: f64 = 4.0;
/// Least share, percent, that two sigma must cover, of any object.
const COVERAGE_TARGET: f64 = 90.0;

/// A configuration's reference: mass, kg, and ascending principal inertias, kg m^2.
struct Reference {
    configuration: String,
    mass_kg: f64,
    principal_inertia: Vector3<f64>,
}

/// One line of the report.
#[allow(clippy::struct_field_names, reason = "the unit belongs in the name")]
struct Summary {
    mean_error_percent: f64,
    max_error_percent: f64,
    trace_scatter_percent: f64,
    coverage_percent: f64,
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
    let (errors, records) = corrected(&records, &settings).map_err(|error| Failure::file(folder, error))?;
    eprintln!(
        "{SET}: wheel recorded {:.2} ms late; gyro reads {:.2} {:.2} {:.2} % low",
        1e3 * errors.wheel_delay_s,
        100.0 * (errors.gyro_factor[0] - 1.0),
        100.0 * (errors.gyro_factor[1] - 1.0),
        100.0 * (errors.gyro_factor[2] - 1.0),
    );
    let of = |configuration: &str| records.get(configuration).map_or(&[][..], Vec::as_slice);
    let calibration = calibrate(of(DEVICE), of(PROOF), bodies.device_mass_kg, &bodies.proof_block(), &settings)
        .map_err(|error| Failure::file(folder, error))?;
    eprintln!(
        "{SET}: wheel inertia {:.4e} kg m^2, one sigma {:.1e}",
        calibration.wheel_inertia_kg_m2,
        calibration.covariance[9][9].sqrt()
    );

    let mut block = bodies.proof_block().inertia_about_com().diagonal();
    block.as_mut_slice().sort_by(f64::total_cmp);
    let proof = Reference { configuration: PROOF.to_owned(), mass_kg: bodies.proof_mass_kg, principal_inertia: block };
    for reference in references.iter().chain([&proof]) {
        let configuration = reference.configuration.as_str();
        let mut objects = Vec::new();
        for throw in of(configuration) {
            match identify_throw(throw, &calibration, Some(reference.mass_kg)) {
                Ok(estimate) => objects.extend(estimate.object),
                Err(error) => missed.push(format!("{configuration}: {error}")),
            }
        }
        let summary = summarize(&objects, reference);
        print_line(configuration, objects.len(), summary.as_ref(), json);
        let plain = PLAIN_MEANS.iter().find(|(name, _)| *name == configuration).map(|(_, mean)| *mean);
        let Some(summary) = summary else {
            if plain.is_some() || configuration == PROOF {
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
        let Some(plain) = plain else {
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

/// The throws that can be read as one, by configuration; the others are misses.
fn records(
    throws: &BTreeMap<String, Vec<PathBuf>>,
    settings: &ThrowSettings,
    missed: &mut Vec<String>,
) -> Result<BTreeMap<String, Vec<ThrowRecord>>, Failure> {
    let mut records: BTreeMap<String, Vec<ThrowRecord>> = BTreeMap::new();
    for (configuration, paths) in throws {
        for path in paths {
            let record = read_throw(path).map_err(|error| Failure::BadInput(error.to_string()))?;
            match FreeFallEstimate::from_throw(&record, settings) {
                Ok(_) => records.entry(configuration.clone()).or_default().push(record),
                Err(error) => missed.push(format!("{}: {error}", path.display())),
            }
        }
    }
    Ok(records)
}

/// The device's sensors by its own throws, none of which says what an object should be: the delay of the wheel's telemetry
/// where the wheel matters most, in the throws of the calibration; the gyro's factors, which many motions must tell apart,
/// in all throws.
fn corrected(
    records: &BTreeMap<String, Vec<ThrowRecord>>,
    settings: &ThrowSettings,
) -> Result<(SensorErrors, BTreeMap<String, Vec<ThrowRecord>>), IdentificationError> {
    let of = |names: &[&str]| -> Vec<&[ThrowRecord]> {
        names.iter().filter_map(|name| records.get(*name)).map(Vec::as_slice).collect()
    };
    let (wheel_delay_s, _) = wheel_delay(&of(&[DEVICE, PROOF]), settings)?;
    let all: Vec<&[ThrowRecord]> = records.values().map(Vec::as_slice).collect();
    let (gyro_factor, _) = gyro_factor(&all, wheel_delay_s, settings)?;
    let errors = SensorErrors { gyro_factor, wheel_delay_s };
    let corrected = records
        .iter()
        .map(|(name, throws)| (name.clone(), throws.iter().map(|throw| throw.corrected(&errors)).collect()))
        .collect();
    Ok((errors, corrected))
}

/// Errors of the throws; `None` without throws.
///
/// The mean error is that of the throws, except for the proof block: a calibration averages its throws, so there it is
/// the error of their average.
fn summarize(objects: &[ObjectEstimate], reference: &Reference) -> Option<Summary> {
    let n = objects.len() as f64;
    let truth = &reference.principal_inertia;
    let percent = |principal: &Vector3<f64>| 100.0 * (principal - truth).norm() / truth.norm();
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

fn print_line(configuration: &str, n: usize, summary: Option<&Summary>, json: bool) {
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
        });
        println!("{line}");
    } else if let (Some(mean), Some(max), Some(scatter), Some(coverage)) = (mean, max, scatter, coverage) {
        println!(
            "{SET}  {configuration:<12} {n:>3} throws  error mean {mean:5.2} % max {max:5.2} %  \
             trace scatter {scatter:5.2} %  two sigma cover {coverage:5.1} %"
        );
    } else {
        println!("{SET}  {configuration:<12}   0 throws");
    }
}

/// Rows of `references.csv`.
fn references(folder: &Path) -> Result<Vec<Reference>, Failure> {
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
fn throws(folder: &Path) -> Result<(BTreeMap<String, Vec<PathBuf>>, usize), Failure> {
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
