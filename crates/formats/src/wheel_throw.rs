//! Files of wheel-driven throws: one CSV per throw, one TOML per calibrated device.

mod error;

pub use error::{THROW_COLUMNS, WheelThrowError};

use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use crate::log::{BoundedRows, ROW_LIMIT_BYTES, line_read, shortened};
use crate::text_file;
use crate::toml_text;
use error::FORMAT;
use serde::{Deserialize, Serialize};
use tumble_dynamics::InertialParameters;
use tumble_identification::IdentificationError;
use tumble_identification::wheel::{
    FreeFallEstimate, SensorErrors, ThrowRecord, ThrowSample, ThrowSettings, WheelCalibration, calibrate,
};
use tumble_lie::nalgebra::Vector3;

/// Longest record read; half a second of free fall never comes near it.
const MAX_SAMPLES: usize = 1_000_000;

/// The bodies of a calibration. The defaults are those of the published throws (`delft_throws`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationBodies {
    /// Mass of the device, wheel included, kg. Default 0.10067.
    pub device_mass_kg: f64,
    /// Mass of the proof block, kg. Default 0.346.
    pub proof_mass_kg: f64,
    /// Sides of the proof block, a homogeneous cuboid, along the device's axes, m. Default 0.0600, 0.0700, 0.0302.
    pub proof_sides_m: [f64; 3],
}

impl Default for CalibrationBodies {
    fn default() -> Self {
        Self { device_mass_kg: 0.10067, proof_mass_kg: 0.346, proof_sides_m: [0.0600, 0.0700, 0.0302] }
    }
}

impl CalibrationBodies {
    /// The proof block about its centre of mass.
    pub fn proof_block(&self) -> InertialParameters<f64> {
        InertialParameters::solid_box(self.proof_mass_kg, self.proof_sides_m)
    }
}

/// What was thrown for a calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum CalibrationKind {
    /// The device alone: files `cal_device*`.
    Device,
    /// The device with the proof block: files `cal_proof*`.
    Proof,
    /// The device with anything else; serves only to learn how the sensors err.
    Other,
}

impl CalibrationKind {
    /// By the beginning of the file name: device or proof block.
    ///
    /// # Errors
    /// [`WheelThrowError::UnknownKind`].
    pub fn of_file(path: &Path) -> Result<Self, WheelThrowError> {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        if name.starts_with("cal_device") {
            Ok(Self::Device)
        } else if name.starts_with("cal_proof") {
            Ok(Self::Proof)
        } else {
            Err(WheelThrowError::UnknownKind { path: path.to_owned() })
        }
    }
}

/// Reads one throw.
///
/// # Errors
/// Every kind of [`WheelThrowError`] that names a CSV file.
pub fn read_throw(path: &Path) -> Result<ThrowRecord, WheelThrowError> {
    let file =
        std::fs::File::open(path).map_err(|source| WheelThrowError::Unreadable { path: path.to_owned(), source })?;
    parse_throw(file, path)
}

/// Reads one throw from `source`; `path` is its name in errors.
///
/// # Errors
/// As [`read_throw`].
pub fn parse_throw(source: impl Read, path: &Path) -> Result<ThrowRecord, WheelThrowError> {
    // numbers need no quotes, and a quote left open would swallow the rest of the file
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .quoting(false)
        .trim(csv::Trim::All)
        .from_reader(BoundedRows::new(BufReader::new(source)));
    let mut next = |row: &mut csv::StringRecord| {
        let found = reader.read_record(row);
        if let Some(line) = reader.get_ref().too_long {
            return Err(WheelThrowError::LineTooLong { path: path.to_owned(), line, limit: ROW_LIMIT_BYTES });
        }
        let found = found.map_err(|source| WheelThrowError::NotATable { path: path.to_owned(), source })?;
        Ok(found.then(|| line_read(&mut reader)))
    };
    let mut headers = csv::StringRecord::new();
    next(&mut headers)?;
    let mut places = [0; THROW_COLUMNS.len()];
    for (place, column) in places.iter_mut().zip(THROW_COLUMNS) {
        let mut found = (0..headers.len()).filter(|i| headers[*i].trim_start_matches('\u{feff}') == column);
        *place = found.next().ok_or_else(|| WheelThrowError::MissingColumn { path: path.to_owned(), column })?;
        if found.next().is_some() {
            return Err(WheelThrowError::DuplicateColumn { path: path.to_owned(), column });
        }
    }

    let mut samples: Vec<ThrowSample> = Vec::new();
    let mut row = csv::StringRecord::new();
    while let Some(line) = next(&mut row)? {
        let mut cells = [0.0; THROW_COLUMNS.len()];
        for ((cell, place), column) in cells.iter_mut().zip(places).zip(THROW_COLUMNS) {
            let text = row.get(place).unwrap_or_default();
            *cell = text.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| {
                WheelThrowError::NotANumber { path: path.to_owned(), line, column, cell: shortened(text) }
            })?;
        }
        let [time_s, wx, wy, wz, ax, ay, az, wheel_speed_rad_s] = cells;
        if samples.last().is_some_and(|last| time_s <= last.time_s) {
            return Err(WheelThrowError::TimesNotIncreasing { path: path.to_owned(), line });
        }
        if samples.len() == MAX_SAMPLES {
            return Err(WheelThrowError::TooLong { path: path.to_owned(), limit: MAX_SAMPLES });
        }
        samples.push(ThrowSample {
            time_s,
            rate_body: Vector3::new(wx, wy, wz),
            specific_force_body: Vector3::new(ax, ay, az),
            wheel_speed_rad_s,
        });
    }
    ThrowRecord::try_new(samples).map_err(|source| WheelThrowError::NotIdentified { path: path.to_owned(), source })
}

/// Reads throws of a device, alone and with the proof block, learns from them and from the others how its sensors err, and
/// calibrates it. Throws of one [other](CalibrationKind::Other) body share their name up to the last underscore. Sensors
/// about which the throws say nothing are taken as they read.
///
/// # Errors
/// Those of [`read_throw`]; [`WheelThrowError::NotIdentified`] names the throw that cannot be used;
/// [`WheelThrowError::NotCalibrated`].
pub fn calibrate_files(
    files: &[(CalibrationKind, PathBuf)],
    bodies: &CalibrationBodies,
    settings: &ThrowSettings,
) -> Result<WheelCalibration, WheelThrowError> {
    let (mut device, mut proof) = (Vec::new(), Vec::new());
    let mut others: BTreeMap<String, Vec<ThrowRecord>> = BTreeMap::new();
    for (kind, path) in files {
        let throw = read_throw(path)?;
        // What is wrong with one throw is said with its name; reading it twice costs milliseconds.
        FreeFallEstimate::from_throw(&throw, settings)
            .map_err(|source| WheelThrowError::NotIdentified { path: path.clone(), source })?;
        match kind {
            CalibrationKind::Device => device.push(throw),
            CalibrationKind::Proof => proof.push(throw),
            CalibrationKind::Other => {
                let name = path.file_stem().unwrap_or_default().to_string_lossy();
                let body = name.rsplit_once('_').map_or(&*name, |(body, _)| body);
                others.entry(body.to_owned()).or_default().push(throw);
            }
        }
    }
    if device.is_empty() || proof.is_empty() {
        return Err(IdentificationError::CalibrationIncomplete { device: device.len(), proof: proof.len() }.into());
    }
    let others: Vec<&[ThrowRecord]> = others.values().map(Vec::as_slice).collect();
    let sensor_errors = match SensorErrors::from_throws(&[&device, &proof], &others, settings) {
        Err(IdentificationError::LikelihoodNotMaximal { .. }) => SensorErrors::default(),
        found => found?,
    };
    Ok(calibrate(&device, &proof, bodies.device_mass_kg, &bodies.proof_block(), &sensor_errors, settings)?)
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CalibrationFile {
    format: u32,
    calibration: WheelCalibration,
}

/// The text of a calibration file.
///
/// # Errors
/// Where a number cannot be written.
pub fn calibration_to_toml(calibration: &WheelCalibration) -> Result<String, toml::ser::Error> {
    toml::to_string(&CalibrationFile { format: FORMAT, calibration: *calibration })
}

/// Reads a calibration file.
///
/// # Errors
/// [`WheelThrowError::Unreadable`], [`WheelThrowError::NotACalibration`], [`WheelThrowError::UnknownFormat`],
/// [`WheelThrowError::NotIdentified`] for numbers no device has.
pub fn read_calibration(path: &Path) -> Result<WheelCalibration, WheelThrowError> {
    let text = text_file::read(path).map_err(|source| WheelThrowError::Unreadable { path: path.to_owned(), source })?;
    let file: CalibrationFile =
        toml_text::read(&text).map_err(|source| WheelThrowError::NotACalibration { path: path.to_owned(), source })?;
    if file.format != FORMAT {
        return Err(WheelThrowError::UnknownFormat { path: path.to_owned(), found: file.format });
    }
    file.calibration.validated().map_err(|source| WheelThrowError::NotIdentified { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "t_s,wx_rad_s,wy_rad_s,wz_rad_s,ax_m_s2,ay_m_s2,az_m_s2,wheel_rad_s";

    /// A file of this text, removed when dropped.
    struct Written(PathBuf);

    impl Written {
        fn new(name: &str, text: &str) -> Self {
            Self(crate::testing::scratch_file(&format!("wheel-throw-{name}"), text))
        }
    }

    impl Drop for Written {
        fn drop(&mut self) {
            drop(std::fs::remove_file(&self.0));
        }
    }

    fn read(name: &str, text: &str) -> Result<ThrowRecord, WheelThrowError> {
        read_throw(&Written::new(name, text).0)
    }

    #[test]
    fn columns_come_in_any_order_with_others_between() {
        let text = "\u{feff}wheel_rad_s, note, t_s,wx_rad_s,wy_rad_s,wz_rad_s,ax_m_s2,ay_m_s2,az_m_s2\r\n\
                    -5,x,0.1,1,2,3,4,5,6\r\n-6,y,0.2,1,2,3,4,5,6.5e0\r\n";
        let record = read("order.csv", text).unwrap();
        let last = record.samples()[1];
        assert_eq!(record.samples().len(), 2);
        assert_eq!((last.time_s, last.wheel_speed_rad_s), (0.2, -6.0));
        assert_eq!(last.rate_body, Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(last.specific_force_body, Vector3::new(4.0, 5.0, 6.5));
    }

    #[test]
    fn faulty_files_are_named_with_line_and_column() {
        let row = "0.1,1,2,3,4,5,6,7";
        let cases = [
            ("empty.csv", String::new(), "line 1: column `t_s` is missing"),
            ("missing.csv", format!("{}\n{row}", HEADER.replace("wz_rad_s", "wz")), "column `wz_rad_s` is missing"),
            ("double.csv", format!("{HEADER},t_s\n{row},0"), "column `t_s` stands twice"),
            ("text.csv", format!("{HEADER}\n{row}\n0.2,1,two,3,4,5,6,7"), "line 3, column `wy_rad_s`: `two`"),
            ("nan.csv", format!("{HEADER}\n0.1,1,2,3,4,NaN,6,7"), "line 2, column `ay_m_s2`: `NaN`"),
            ("inf.csv", format!("{HEADER}\n0.1,1,2,3,4,5,6,inf"), "line 2, column `wheel_rad_s`: `inf`"),
            ("blank.csv", format!("{HEADER}\n0.1,,2,3,4,5,6,7"), "line 2, column `wx_rad_s`: ``"),
            ("back.csv", format!("{HEADER}\n{row}\n0.05,1,2,3,4,5,6,7"), "line 3, column `t_s`"),
            ("again.csv", format!("{HEADER}\n{row}\n{row}"), "line 3, column `t_s`"),
            ("short-row.csv", format!("{HEADER}\n0.1,1,2"), "found record with 3 fields"),
        ];
        for (name, text, said) in cases {
            let message = read(name, &text).unwrap_err().to_string();
            assert!(message.contains(name) && message.contains(said), "{name}: {message}");
        }
        let absent = read_throw(Path::new("no/such/throw.csv")).unwrap_err();
        assert!(matches!(absent, WheelThrowError::Unreadable { .. }), "{absent}");
    }

    #[test]
    fn a_throw_that_cannot_calibrate_is_named() {
        let file = Written::new("cal_device.csv", &format!("{HEADER}\n0.1,1,2,3,4,5,6,7\n"));
        let files = [(CalibrationKind::Device, file.0.clone())];
        let error = calibrate_files(&files, &CalibrationBodies::default(), &ThrowSettings::default()).unwrap_err();
        assert!(error.to_string().contains("cal_device.csv: free fall"), "{error}");
        let none = calibrate_files(&[], &CalibrationBodies::default(), &ThrowSettings::default()).unwrap_err();
        assert!(matches!(none, WheelThrowError::NotCalibrated(IdentificationError::CalibrationIncomplete { .. })));
    }

    #[test]
    fn the_file_name_says_what_was_thrown() {
        let of = |name: &str| CalibrationKind::of_file(Path::new(name));
        assert_eq!(of("some/cal_device_00119.csv").unwrap(), CalibrationKind::Device);
        assert_eq!(of("cal_proof_00122.csv").unwrap(), CalibrationKind::Proof);
        assert!(of("cal_device/grid_a_00133.csv").is_err());
    }

    #[test]
    fn the_default_proof_block_is_the_published_one() {
        let found = CalibrationBodies::default().proof_block().inertia_about_com().diagonal() * (12.0 / 0.346);
        let [x, y, z] = [0.06_f64, 0.07, 0.0302].map(|side| side * side);
        assert!((found - Vector3::new(z + y, z + x, x + y)).amax() < 1e-15);
    }

    #[test]
    fn a_calibration_survives_its_file() {
        let mut covariance = [[0.0; 10]; 10];
        covariance[3][4] = 1.0 / 3.0;
        let calibration = WheelCalibration {
            wheel_inertia_kg_m2: 1.6852e-6,
            device_mass_kg: 0.10067,
            device_com_m: [0.1, -0.2, 1e-17],
            device_inertia_ratio: [26.0, 0.5, -0.25, 44.0, 1.0 / 3.0, 54.0],
            covariance,
            by_sensors: [[1e-9; 10]; 8],
            block_apart: 0.5,
            sensor_errors: SensorErrors {
                gyro_factor: [1.003, 0.997, 1.0],
                gyro_factor_sigma: [1e-3, 2e-3, 1e-3],
                gyro_shear: [-4e-3, 0.0, -1.2e-2],
                gyro_shear_sigma: [1e-3; 3],
                wheel_tilt: [-4e-3, 3e-3],
                wheel_tilt_sigma: [1e-3; 2],
                wheel_delay_s: 2.3e-4,
                wheel_delay_sigma_s: 1e-4,
                shifts: [[1e-3; 9]; 8],
            },
            settings: ThrowSettings::default(),
        };
        let text = calibration_to_toml(&calibration).unwrap();
        assert_eq!(read_calibration(&Written::new("cal.toml", &text).0).unwrap(), calibration);

        // A file from before sensors were corrected: they are taken as they read.
        let (before, rest) = text.split_once("[calibration.sensor_errors]").unwrap();
        let (_, after) = rest.split_once("[calibration.settings]").unwrap();
        let old = format!("{before}[calibration.settings]{after}");
        let expected = WheelCalibration { sensor_errors: SensorErrors::default(), ..calibration };
        assert_eq!(read_calibration(&Written::new("old.toml", &old).0).unwrap(), expected);

        let faulty = |name: &str, from: &str, to: &str| {
            assert!(text.contains(from), "{from} in\n{text}");
            read_calibration(&Written::new(name, &text.replace(from, to)).0).unwrap_err()
        };
        let newer = faulty("newer.toml", "format = 1", "format = 2");
        assert!(matches!(newer, WheelThrowError::UnknownFormat { found: 2, .. }), "{newer}");
        let unknown = faulty("unknown.toml", "device_mass_kg", "device_mass_lb");
        assert!(matches!(unknown, WheelThrowError::NotACalibration { .. }), "{unknown}");
        for (name, from, to) in [
            ("negative.toml", "mass_kg = 0", "mass_kg = -0"),
            ("step.toml", "step_s = 0.005", "step_s = 0.0"),
            ("gyro.toml", "[1.003,", "[-1.003,"),
        ] {
            let error = faulty(name, from, to);
            assert!(matches!(error, WheelThrowError::NotIdentified { .. }), "{error}");
        }
    }
}
