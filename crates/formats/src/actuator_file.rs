//! Actuators as a file: which column of a log commands which thruster, and how well their thrust is known.

use crate::FormatsError;
use crate::text_file::{self, printable};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use tumble_identification::WrenchEffect;
use tumble_lie::Wrench;
use tumble_lie::nalgebra::Vector3;

/// Thrusters that columns of a log command.
///
/// # Units
/// m, N, s; relative errors without unit. Body axes, from the body origin.
#[derive(Clone, Debug, PartialEq)]
pub struct ActuatorFile {
    path: PathBuf,
    thrusters: Vec<Thruster>,
    common: Common,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    thruster: Vec<Thruster>,
    #[serde(default)]
    common: Common,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Thruster {
    column: String,
    position_m: [f64; 3],
    direction: [f64; 3],
    thrust_n: f64,
    #[serde(default = "usual_sigma")]
    thrust_sigma: f64,
}

const fn usual_sigma() -> f64 {
    0.01
}

/// What all thrusters share.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Common {
    scale_sigma: f64,
    sag_sigma: f64,
    delay_s: f64,
    delay_sigma_s: f64,
    rise_s: f64,
}

impl Default for Common {
    fn default() -> Self {
        Self { scale_sigma: 0.0, sag_sigma: 0.1, delay_s: 0.0, delay_sigma_s: 0.2, rise_s: 0.0 }
    }
}

/// What commanded thrusters did, and what may be wrong with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuation {
    /// The wrench over the step that begins at each row, body axes, torque about the body origin, N m and N.
    pub wrench_body: Vec<Wrench<f64>>,
    /// What may be wrong: each thruster's scale by the name of its column, then `common` and `sag`.
    pub effects: Vec<WrenchEffect>,
}

impl ActuatorFile {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`FormatsError::Unreadable`], [`FormatsError::BadToml`] naming the key.
    pub fn read(path: &Path) -> Result<Self, FormatsError> {
        let text = text_file::read(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?;
        Self::parse(&text, path)
    }

    /// From the text of the file `path`.
    ///
    /// # Errors
    /// As [`ActuatorFile::read`].
    ///
    /// # Example
    /// ```
    /// use tumble_formats::actuator_file::ActuatorFile;
    /// let text = r#"
    /// format = 1
    /// [[thruster]]
    /// column = "u_1"
    /// position_m = [0.145, 0.06, 0.0]
    /// direction = [-1.0, 0.0, 0.0]
    /// thrust_n = 0.44
    /// "#;
    /// let file = ActuatorFile::parse(text, "actuators.toml".as_ref())?;
    /// let pushed = file.actuation(&[vec![1.0], vec![0.0]], &[0, 100_000_000]);
    /// assert_eq!(pushed.wrench_body[0].force.x, -0.44);
    /// # Ok::<(), tumble_formats::FormatsError>(())
    /// ```
    pub fn parse(text: &str, path: &Path) -> Result<Self, FormatsError> {
        let bad = |message: String| FormatsError::BadToml { path: path.into(), message };
        let file: File = toml::from_str(text).map_err(|error| bad(printable(&error.to_string())))?;
        if file.format != 1 {
            return Err(bad(format!("`format = {}`; this version reads 1", file.format)));
        }
        if file.thruster.is_empty() {
            return Err(bad("no `[[thruster]]`: name at least one with its column".to_owned()));
        }
        let mut thrusters = file.thruster;
        for (at, thruster) in thrusters.iter_mut().enumerate() {
            let place =
                |key: &str, what: String| bad(format!("thruster {} (`{}`), `{key}`: {what}", at + 1, thruster.column));
            let direction = Vector3::from(thruster.direction);
            let Some(unit) = direction.try_normalize(1e-9).filter(|unit| unit.iter().all(|x| x.is_finite())) else {
                return Err(place("direction", format!("{:?} has no direction", thruster.direction)));
            };
            if !thruster.position_m.iter().all(|x| x.is_finite()) {
                return Err(place("position_m", format!("{:?} is no place", thruster.position_m)));
            }
            if !(thruster.thrust_n > 0.0 && thruster.thrust_n.is_finite()) {
                return Err(place(
                    "thrust_n",
                    format!("{} is no thrust; the direction says where to", thruster.thrust_n),
                ));
            }
            if !(0.0..=10.0).contains(&thruster.thrust_sigma) {
                return Err(place(
                    "thrust_sigma",
                    format!("{} is no relative standard deviation", thruster.thrust_sigma),
                ));
            }
            thruster.direction = unit.into();
        }
        for (index, thruster) in thrusters.iter().enumerate() {
            if thrusters.iter().take(index).any(|other| other.column == thruster.column) {
                return Err(bad(format!("two thrusters have the column `{}`", thruster.column)));
            }
        }
        let Common { scale_sigma, sag_sigma, delay_s, delay_sigma_s, rise_s } = file.common;
        for (key, value, largest) in [
            ("scale_sigma", scale_sigma, 10.0),
            ("sag_sigma", sag_sigma, 1.0),
            ("delay_s", delay_s, 10.0),
            ("delay_sigma_s", delay_sigma_s, 10.0),
            ("rise_s", rise_s, 10.0),
        ] {
            if !(0.0..=largest).contains(&value) {
                return Err(bad(format!("`common.{key}` is {value}; it lies between 0 and {largest}")));
            }
        }
        Ok(Self { path: path.into(), thrusters, common: file.common })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The columns that command the thrusters, in their order.
    pub fn columns(&self) -> Vec<String> {
        self.thrusters.iter().map(|thruster| thruster.column.clone()).collect()
    }

    /// Time from command to thrust, s, and one standard deviation of it.
    pub const fn delay_s(&self) -> (f64, f64) {
        (self.common.delay_s, self.common.delay_sigma_s)
    }

    /// What commands (rows of the thrusters in their order, held until the next row) at these times did. Thrust follows its command with
    /// the rise as a lag of first order; the delay is left to whoever compares with motion.
    pub fn actuation(&self, commands: &[Vec<f64>], times_ns: &[i64]) -> Actuation {
        let count = commands.len().min(times_ns.len());
        let step_s = |row: usize| {
            let end = times_ns.get(row + 1).or_else(|| times_ns.get(row));
            let begin = if row + 1 < times_ns.len() { times_ns.get(row) } else { times_ns.get(row.saturating_sub(1)) };
            end.zip(begin).map_or(0.0, |(end, begin)| (end - begin) as f64 * 1e-9)
        };
        let mut effects: Vec<WrenchEffect> = self
            .thrusters
            .iter()
            .map(|thruster| WrenchEffect::new(thruster.column.clone(), thruster.thrust_sigma))
            .collect();
        let (mut common, mut sag) = (
            WrenchEffect::new("common".into(), self.common.scale_sigma),
            WrenchEffect::new("sag".into(), self.common.sag_sigma),
        );
        let mut wrench_body = Vec::with_capacity(count);
        let mut level = vec![0.0_f64; self.thrusters.len()];
        for (row, command) in commands.iter().take(count).enumerate() {
            // the mean over the step of a lag of first order that began at the last level
            let lag = self.common.rise_s;
            let (left, mean) = match step_s(row) {
                step_s if lag > 0.0 && step_s > 0.0 => {
                    let left = f64::exp(-step_s / lag);
                    (left, (1.0 - left) * lag / step_s)
                }
                _ => (0.0, 0.0),
            };
            let (mut total, mut open) = (Wrench::zero(), 0.0);
            for (((thruster, level), effect), command) in
                self.thrusters.iter().zip(&mut level).zip(&mut effects).zip(command)
            {
                let share = command + (*level - command) * mean;
                *level = command + (*level - command) * left;
                let force = Vector3::from(thruster.direction) * (thruster.thrust_n * share);
                let wrench = Wrench::new(Vector3::from(thruster.position_m).cross(&force), force);
                effect.wrench_body.push(wrench);
                total += wrench;
                open += share;
            }
            common.wrench_body.push(total);
            sag.wrench_body.push(total * -(open - 1.0_f64).max(0.0));
            wrench_body.push(total);
        }
        effects.extend([common, sag].into_iter().filter(|effect| effect.sigma > 0.0));
        Actuation { wrench_body, effects }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &str = "format = 1\n\
        [[thruster]]\ncolumn = \"u_1\"\nposition_m = [0.0, 0.5, 0.0]\ndirection = [2.0, 0.0, 0.0]\nthrust_n = 0.4\n\
        [[thruster]]\ncolumn = \"u_2\"\nposition_m = [0.0, -0.5, 0.0]\ndirection = [1.0, 0.0, 0.0]\nthrust_n = 0.2\nthrust_sigma = 0.1\n";

    fn parsed(text: &str) -> Result<ActuatorFile, FormatsError> {
        ActuatorFile::parse(text, Path::new("actuators.toml"))
    }

    #[test]
    fn thrusts_add_up_and_sag_grows_with_those_open() {
        let file = parsed(&format!("{TWO}[common]\nscale_sigma = 0.05\n")).unwrap();
        let found = file.actuation(&[vec![1.0, 0.0], vec![1.0, 1.0]], &[0, 50_000_000]);
        assert!(
            (found.wrench_body[0].force.x - 0.4).abs() < 1e-15 && (found.wrench_body[0].torque.z + 0.2).abs() < 1e-15
        );
        assert!((found.wrench_body[1].torque.z + 0.1).abs() < 1e-15);
        let names: Vec<&str> = found.effects.iter().map(|effect| effect.name.as_str()).collect();
        assert_eq!(names, ["u_1", "u_2", "common", "sag"]);
        assert_eq!(found.effects[1].sigma, 0.1);
        assert!((found.effects[3].wrench_body[1].force.x + 0.6).abs() < 1e-15);
        assert_eq!(found.effects[3].wrench_body[0].force.x, 0.0);
    }

    #[test]
    fn a_rise_keeps_the_impulse() {
        let file = parsed(&format!("{TWO}[common]\nrise_s = 0.03\n")).unwrap();
        let commands: Vec<Vec<f64>> = (0..40).map(|row| vec![f64::from(u8::from(row == 3)), 0.0]).collect();
        let times: Vec<i64> = (0..40).map(|row| row * 20_000_000).collect();
        let impulse: f64 = file.actuation(&commands, &times).wrench_body.iter().map(|w| w.force.x * 0.02).sum();
        assert!((impulse - 0.4 * 0.02).abs() < 1e-10, "{impulse}");
    }

    #[test]
    fn impossible_values_are_named() {
        for (text, place) in [
            (TWO.replace("format = 1", "format = 2"), "format"),
            (TWO.replace("[2.0, 0.0, 0.0]", "[0.0, 0.0, 0.0]"), "thruster 1 (`u_1`), `direction`"),
            (TWO.replace("thrust_n = 0.2", "thrust_n = -0.2"), "thruster 2 (`u_2`), `thrust_n`"),
            (TWO.replace("thrust_sigma = 0.1", "thrust_sigma = -1.0"), "`thrust_sigma`"),
            (TWO.replace("u_2", "u_1"), "two thrusters have the column `u_1`"),
            (format!("{TWO}[common]\nsag_sigma = 2.0\n"), "common.sag_sigma"),
            (format!("{TWO}[common]\nsagg = 2.0\n"), "sagg"),
            ("format = 1\nthruster = []\n".to_owned(), "no `[[thruster]]`"),
        ] {
            let error = parsed(&text).unwrap_err().to_string();
            assert!(error.contains(place) && error.contains("actuators.toml"), "{error}");
        }
    }
}
