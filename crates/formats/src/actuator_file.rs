//! Actuators as a file: which column of a log commands which thruster, where it sits and what it may be off by.

use crate::FormatsError;
use crate::text_file::{self, printable};
use crate::toml_text;
use serde::{Deserialize, Serialize};
use std::path::Path;
use tumble_identification::actuators::{Actuator, Actuators, CommonErrors};

/// Standard deviation of a thrust of which nothing is said.
const THRUST_SIGMA: f64 = 0.01;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    #[serde(default)]
    thruster: Vec<Thruster>,
    #[serde(default)]
    common: Common,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Thruster {
    column: String,
    position_m: [f64; 3],
    direction: [f64; 3],
    thrust_n: f64,
    thrust_sigma: Option<f64>,
}

#[derive(Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Common {
    scale_sigma: f64,
    sag_sigma: f64,
    delay_s: f64,
    delay_sigma_s: f64,
    rise_s: f64,
    mass_flow_kg_per_n_s: f64,
}

/// What a file says.
#[derive(Clone, Debug, PartialEq)]
pub struct ActuatorFile {
    /// Columns of the log, one for each actuator: commands from zero to one, held until the next row.
    pub columns: Vec<String>,
    /// The actuators in the same order.
    pub actuators: Actuators,
}

/// Reads and checks a file.
///
/// # Errors
/// [`FormatsError::Unreadable`], [`FormatsError::BadToml`] naming the key.
pub fn read(path: &Path) -> Result<ActuatorFile, FormatsError> {
    let text = text_file::read(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?;
    parse(&text, path)
}

/// From the text of the file `path`.
///
/// # Errors
/// As [`read`].
///
/// # Example
/// ```
/// let text = "format = 1
/// [[thruster]]
/// column = 'u_1'
/// position_m = [0.145, 0.06, 0.0]
/// direction = [-1.0, 0.0, 0.0]
/// thrust_n = 0.4415
/// [common]
/// sag_sigma = 0.1
/// ";
/// let file = tumble_formats::actuator_file::parse(text, "actuators.toml".as_ref())?;
/// assert_eq!(file.columns, ["u_1"]);
/// assert_eq!(file.actuators.actuators[0].thrust_sigma, 0.01);
/// # Ok::<(), tumble_formats::FormatsError>(())
/// ```
pub fn parse(text: &str, path: &Path) -> Result<ActuatorFile, FormatsError> {
    let bad = |message: String| FormatsError::BadToml { path: path.into(), message };
    let file: File = toml_text::read(text).map_err(|error| bad(error.to_string()))?;
    if file.format != 1 {
        return Err(bad(format!("`format = {}`; this version reads 1", file.format)));
    }
    let columns: Vec<String> = file.thruster.iter().map(|thruster| thruster.column.clone()).collect();
    if let Some(twice) =
        columns.iter().enumerate().find(|(i, name)| columns.iter().take(*i).any(|other| other == *name))
    {
        return Err(bad(format!("two thrusters have the column `{}`", printable(twice.1))));
    }
    let of = |thruster: &Thruster| Actuator {
        position_m: thruster.position_m,
        direction: thruster.direction,
        thrust_n: thruster.thrust_n,
        thrust_sigma: thruster.thrust_sigma.unwrap_or(THRUST_SIGMA),
    };
    let common = CommonErrors {
        scale_sigma: file.common.scale_sigma,
        sag_sigma: file.common.sag_sigma,
        delay_s: file.common.delay_s,
        delay_sigma_s: file.common.delay_sigma_s,
        rise_s: file.common.rise_s,
        mass_flow_kg_per_n_s: file.common.mass_flow_kg_per_n_s,
    };
    let actuators = Actuators { actuators: file.thruster.iter().map(of).collect(), common };
    actuators.check().map_err(|error| bad(error.to_string()))?;
    Ok(ActuatorFile { columns, actuators })
}

/// The text of a file with every key.
///
/// # Errors
/// [`FormatsError::BadToml`] for numbers that TOML cannot hold.
pub fn text(told: &ActuatorFile, path: &Path) -> Result<String, FormatsError> {
    let of = |(column, actuator): (&String, &Actuator)| Thruster {
        column: column.clone(),
        position_m: actuator.position_m,
        direction: actuator.direction,
        thrust_n: actuator.thrust_n,
        thrust_sigma: Some(actuator.thrust_sigma),
    };
    let common = &told.actuators.common;
    let file = File {
        format: 1,
        thruster: told.columns.iter().zip(&told.actuators.actuators).map(of).collect(),
        common: Common {
            scale_sigma: common.scale_sigma,
            sag_sigma: common.sag_sigma,
            delay_s: common.delay_s,
            delay_sigma_s: common.delay_sigma_s,
            rise_s: common.rise_s,
            mass_flow_kg_per_n_s: common.mass_flow_kg_per_n_s,
        },
    };
    toml::to_string(&file).map_err(|error| FormatsError::BadToml { path: path.into(), message: error.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        parse(text, Path::new("actuators.toml")).unwrap_err().to_string()
    }

    #[test]
    fn a_written_file_reads_back() {
        let nozzle = |x: f64| Actuator {
            position_m: [x, -0.1, 0.2],
            direction: [0.0, -1.0, 0.0],
            thrust_n: 0.1 + x,
            thrust_sigma: 0.0,
        };
        let common = CommonErrors { scale_sigma: 0.1, delay_s: 0.3, rise_s: 0.02, ..CommonErrors::default() };
        let told = ActuatorFile {
            columns: vec!["u 1".to_owned(), "u\"2".to_owned()],
            actuators: Actuators { actuators: vec![nozzle(0.1), nozzle(1.0 / 3.0)], common },
        };
        let path = Path::new("actuators.toml");
        assert_eq!(parse(&text(&told, path).unwrap(), path).unwrap(), told);
    }

    #[test]
    fn impossible_values_are_named() {
        let one =
            "format = 1\n[[thruster]]\ncolumn = 'u'\nposition_m = [0, 0.1, 0]\ndirection = [1, 0, 0]\nthrust_n = ";
        assert!(refused(&format!("{one}-0.4\n")).contains("thrust"));
        assert!(refused(&format!("{one}0.4\nthrust = 1\n")).contains("`thrust`"));
        assert!(refused(&format!("{one}0.4\n[common]\nsag_sigma = -0.1\n")).contains("sag"));
        assert!(refused(&format!("{one}0.4\n{}0.4\n", &one[11..])).contains("`u`"));
        assert!(refused("format = 1\n").contains("number of thrusters"));
        assert!(
            refused(&one.replace("format = 1", "format = 2").replace("thrust_n = ", "thrust_n = 1")).contains("format")
        );
        assert!(
            refused(&format!("{one}0.4\n").replace("[0, 0.1, 0]", "[0, 0.1, 0, 5]")).contains("position_m` holds 4")
        );
    }
}
