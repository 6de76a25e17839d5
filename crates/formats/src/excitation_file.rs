//! `excitation.toml`: a designed motion with all that flies it, identifies from its log, and designs it again.

use crate::FormatsError;
use crate::body_file::BodyFile;
use crate::log::QUATERNION_NORM_TOLERANCE;
use crate::text_file;
use crate::toml_text;
use serde::{Deserialize, Serialize};
use std::path::Path;
use tumble_dynamics::nalgebra::DMatrix;
use tumble_identification::excitation::samples_per_period;
use tumble_identification::fourier::{AttitudeChart, FourierBasis, FourierMotion};
use tumble_lie::Pose;

/// The only version of the format.
const FORMAT: u32 = 1;

/// A designed motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExcitationFile {
    /// Version of the format: 1.
    pub format: u32,
    /// Period, s.
    pub period_s: f64,
    /// Harmonics of each channel.
    pub harmonics: usize,
    /// Cycles to fly.
    pub cycles: usize,
    /// Samples and control steps per second.
    pub rate_hz: f64,
    /// Where the motion starts; the coefficients are in this frame. To be set to where the robot really started.
    pub start: StartTable,
    /// Fourier coefficients `[a0, a_1 .. a_n, b_1 .. b_n]` of each channel.
    pub coefficients: Coefficients,
    /// What the motion was not to exceed; `inf` where there was no limit.
    pub limits: LimitsTable,
    /// Noise expected in the log, one sigma per sample and axis.
    pub noise: NoiseTable,
    /// The body it was designed for, and that the tracker takes the robot for.
    pub body: BodyFile,
    /// How it was designed.
    pub design: DesignTable,
}

/// A pose in the axes of the log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartTable {
    /// Position of the body origin, m.
    pub position_m: [f64; 3],
    /// Attitude, Hamilton, body to inertial, scalar last.
    pub quaternion_xyzw: [f64; 4],
}

/// Channels: position of the body origin in m, Euler angles in rad, in the frame in which the motion starts at zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coefficients {
    /// Position along x.
    pub x: Vec<f64>,
    /// Position along y.
    pub y: Vec<f64>,
    /// Position along z.
    pub z: Vec<f64>,
    /// Angle about x, the last of the three turns.
    pub roll: Vec<f64>,
    /// Angle about y.
    pub pitch: Vec<f64>,
    /// Angle about z, the first.
    pub yaw: Vec<f64>,
}

/// Limits, one for all channels of a kind except where three numbers stand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitsTable {
    /// Largest distance from the start along each axis, m.
    pub position_m: [f64; 3],
    /// Largest Euler angle, rad.
    pub angle_rad: f64,
    /// Largest velocity along each axis, m/s.
    pub speed_m_s: f64,
    /// Largest rate of each Euler angle, rad/s.
    pub angular_rate_rad_s: f64,
    /// Largest acceleration along each axis, m/s^2.
    pub acceleration_m_s2: f64,
    /// Largest second derivative of each Euler angle, rad/s^2.
    pub angular_acceleration_rad_s2: f64,
    /// Largest force of the actuators along each body axis, N.
    pub force_n: f64,
    /// Largest torque about each body axis, N m.
    pub torque_n_m: f64,
    /// Whether the design kept clear of the limits of force and torque.
    pub wrench_in_design: bool,
}

/// One sigma of what a log will hold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseTable {
    /// Of each axis of the position, m.
    pub position_m: f64,
    /// Of each axis of the rotation, rad.
    pub attitude_rad: f64,
    /// Of each axis of the force, N.
    pub force_n: f64,
    /// Of each axis of the torque, N m.
    pub torque_n_m: f64,
}

/// How a motion was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DesignTable {
    /// Name of the criterion, as `tumble excite --criterion` takes it.
    pub criterion: String,
    /// Random starts.
    pub starts: usize,
    /// Their seed.
    pub seed: u64,
    /// Whether only x, y and yaw move.
    pub planar: bool,
    /// Cost reached.
    pub cost: f64,
}

impl Coefficients {
    /// The columns of a motion in Euler angles.
    pub fn of(motion: &FourierMotion) -> Self {
        let column = |i: usize| motion.coefficients().column(i).iter().copied().collect();
        Self { x: column(0), y: column(1), z: column(2), roll: column(3), pitch: column(4), yaw: column(5) }
    }

    fn columns(&self) -> [(&'static str, &[f64]); 6] {
        [
            ("x", &self.x),
            ("y", &self.y),
            ("z", &self.z),
            ("roll", &self.roll),
            ("pitch", &self.pitch),
            ("yaw", &self.yaw),
        ]
    }
}

impl ExcitationFile {
    /// The motion.
    ///
    /// # Errors
    /// [`FormatsError::BadExcitation`] naming `path` and the key.
    pub fn motion(&self, path: &Path) -> Result<FourierMotion, FormatsError> {
        let bad = |message: String| FormatsError::BadExcitation { path: path.into(), message };
        // Before anything is made of that size.
        let needed = self.harmonics.saturating_mul(2).saturating_add(1);
        for (name, column) in self.coefficients.columns() {
            if column.len() != needed {
                return Err(bad(format!(
                    "`coefficients.{name}` has {} numbers; {} harmonics need {needed}",
                    column.len(),
                    self.harmonics,
                )));
            }
        }
        let basis = FourierBasis::try_new(self.period_s, self.harmonics).map_err(|error| bad(error.to_string()))?;
        let mut coefficients = DMatrix::zeros(basis.coefficients(), 6);
        for (i, (name, column)) in self.coefficients.columns().into_iter().enumerate() {
            if !column.iter().all(|c| c.is_finite()) {
                return Err(bad(format!("`coefficients.{name}` holds a number that is not finite")));
            }
            coefficients.column_mut(i).copy_from_slice(column);
        }
        FourierMotion::try_new(basis, AttitudeChart::EulerZyx, coefficients).map_err(|error| bad(error.to_string()))
    }

    /// Pose of the frame of the coefficients in the axes of the log.
    ///
    /// # Errors
    /// [`FormatsError::BadExcitation`] naming `path` and the key.
    pub fn world_from_start(&self, path: &Path) -> Result<Pose<f64>, FormatsError> {
        let bad = |message: &str| FormatsError::BadExcitation { path: path.into(), message: message.to_owned() };
        let [x, y, z, w] = self.start.quaternion_xyzw;
        let rotation = tumble_lie::from_xyzw(x, y, z, w, QUATERNION_NORM_TOLERANCE)
            .map_err(|_| bad("`start.quaternion_xyzw` is not of norm one"))?;
        if !self.start.position_m.iter().all(|p| p.is_finite()) {
            return Err(bad("`start.position_m` holds a number that is not finite"));
        }
        Ok(Pose::from_parts(self.start.position_m.into(), rotation))
    }

    /// The text of the file.
    ///
    /// # Errors
    /// [`FormatsError::BadExcitation`] naming `path`.
    pub fn to_toml(&self, path: &Path) -> Result<String, FormatsError> {
        toml::to_string(self)
            .map_err(|error| FormatsError::BadExcitation { path: path.into(), message: error.to_string() })
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`FormatsError`] naming the file and the key.
    pub fn read(path: &Path) -> Result<Self, FormatsError> {
        let text = text_file::read(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?;
        Self::parse(&text, path)
    }

    /// Checks the text of the file `path`.
    ///
    /// # Errors
    /// As [`ExcitationFile::read`].
    pub fn parse(text: &str, path: &Path) -> Result<Self, FormatsError> {
        let bad = |message: String| FormatsError::BadExcitation { path: path.into(), message };
        let file: Self = toml_text::read(text).map_err(|error| bad(error.to_string()))?;
        if file.format != FORMAT {
            return Err(bad(format!("`format` is {}; this program reads {FORMAT}", file.format)));
        }
        let NoiseTable { position_m, attitude_rad, force_n, torque_n_m } = file.noise;
        let limits = file.limits;
        for (key, value) in [
            ("rate_hz", file.rate_hz),
            ("noise.position_m", position_m),
            ("noise.attitude_rad", attitude_rad),
            ("noise.force_n", force_n),
            ("noise.torque_n_m", torque_n_m),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(bad(format!("`{key}` is {value}; it is positive and finite")));
            }
        }
        for (key, value) in [("limits.force_n", limits.force_n), ("limits.torque_n_m", limits.torque_n_m)] {
            if value.is_nan() || value <= 0.0 {
                return Err(bad(format!("`{key}` is {value}; a limit is positive, or inf")));
            }
        }
        if file.cycles == 0 {
            return Err(bad("`cycles` is 0; a flight has cycles".to_owned()));
        }
        file.motion(path)?;
        samples_per_period(file.period_s, 1.0 / file.rate_hz)
            .map_err(|error| bad(format!("`period_s`, `rate_hz`: {error}")))?;
        file.world_from_start(path)?;
        file.body.to_parameters(path)?;
        Ok(file)
    }

    /// The first version of the format, of a motion.
    pub fn new(
        motion: &FourierMotion,
        (cycles, rate_hz): (usize, f64),
        limits: LimitsTable,
        noise: NoiseTable,
        body: BodyFile,
        design: DesignTable,
    ) -> Self {
        Self {
            format: FORMAT,
            period_s: motion.basis().period_s(),
            harmonics: motion.basis().harmonics(),
            cycles,
            rate_hz,
            start: StartTable { position_m: [0.0; 3], quaternion_xyzw: [0.0, 0.0, 0.0, 1.0] },
            coefficients: Coefficients::of(motion),
            limits,
            noise,
            body,
            design,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn file() -> ExcitationFile {
        let basis = FourierBasis::try_new(10.0, 3).unwrap();
        let free = DMatrix::from_fn(4, 6, |row, column| 0.1 / (1.0 + 3.0 * row as f64 + 2.0 * column as f64));
        let motion = FourierMotion::try_new(basis, AttitudeChart::EulerZyx, basis.rest_to_rest() * free).unwrap();
        let limits = LimitsTable {
            position_m: [0.75; 3],
            angle_rad: 0.8,
            speed_m_s: f64::INFINITY,
            angular_rate_rad_s: 0.8,
            acceleration_m_s2: 0.5,
            angular_acceleration_rad_s2: 0.8,
            force_n: 4.0,
            torque_n_m: 0.3,
            wrench_in_design: true,
        };
        let noise = NoiseTable { position_m: 0.05, attitude_rad: 0.03, force_n: 0.01, torque_n_m: 0.001 };
        let design = DesignTable { criterion: "d".to_owned(), starts: 3, seed: 1, planar: false, cost: -31.5 };
        ExcitationFile::new(
            &motion,
            (10, 100.0),
            limits,
            noise,
            BodyFile::from(&tumble_dynamics::InertialParameters::solid_box(6.047, [0.3, 0.2, 0.25])),
            design,
        )
    }

    fn written(name: &str, text: &str) -> std::path::PathBuf {
        crate::testing::scratch_file(&format!("excitation-{name}.toml"), text)
    }

    #[test]
    fn the_file_gives_the_same_motion_to_the_last_bit() {
        let file = file();
        let path = written("round-trip", &file.to_toml(Path::new("x")).unwrap());
        let back = ExcitationFile::read(&path).unwrap();
        fs::remove_file(&path).unwrap();
        assert_eq!(back, file);
        assert_eq!(back.motion(&path).unwrap(), file.motion(&path).unwrap());
    }

    #[test]
    fn what_is_wrong_is_named() {
        let good = file().to_toml(Path::new("x")).unwrap();
        for (name, from, to, expected) in [
            ("format", "format = 1", "format = 2", "`format` is 2"),
            ("harmonics", "harmonics = 3", "harmonics = 4", "`coefficients.x` has 7 numbers"),
            ("huge harmonics", "harmonics = 3", "harmonics = 999999999999", "`coefficients.x` has 7 numbers"),
            ("no harmonics", "harmonics = 3", "harmonics = 0", "`coefficients.x` has 7 numbers"),
            ("period", "period_s = 10.0", "period_s = -1.0", "-1"),
            ("long period", "period_s = 10.0", "period_s = 1e300", "`rate_hz`"),
            ("no cycles", "cycles = 10", "cycles = 0", "`cycles`"),
            ("high rate", "rate_hz = 100.0", "rate_hz = 1e12", "`rate_hz`"),
            ("rate", "rate_hz = 100.0", "rate_hz = nan", "`rate_hz`"),
            ("noise", "attitude_rad = 0.03", "attitude_rad = 0.0", "`noise.attitude_rad`"),
            ("limit", "force_n = 4.0", "force_n = -4.0", "`limits.force_n`"),
            ("key", "cycles = 10", "cycle = 10", "cycle"),
            ("start", "[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.0, 1.0, 1.0]", "`start.quaternion_xyzw`"),
            ("body", "mass_kg = 6.047", "mass_kg = -1.0", "no body"),
        ] {
            assert!(good.contains(from), "{from} not in {good}");
            let path = written(name, &good.replacen(from, to, 1));
            let message = ExcitationFile::read(&path).unwrap_err().to_string();
            fs::remove_file(&path).unwrap();
            assert!(message.contains(expected), "{name}: {message}");
        }
    }
}
