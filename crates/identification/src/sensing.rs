//! What a published pose, velocity, rate or acceleration is of the true motion: noise, wander, filter, gain, bias, place, delay.
//!
//! One description serves simulation and estimation. It names no robot: filters are coefficients, everything else is a number with
//! a standard deviation, so that another robot is another value of [`Sensing`] and not another type.

mod check;
mod filter;
mod published;

pub use check::{Alignment, Contradiction, Found, PoseErrors, SensingCheck, StreamCheck, StreamName, check};
pub use filter::LinearFilter;
pub use published::TrueMotion;

use crate::error::IdentificationError;

/// A standard deviation per sample and axis, and how well it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Level {
    /// The record tells.
    #[default]
    Unknown,
    /// The record tells; the search begins here.
    About(f64),
    /// As stated.
    Known(f64),
}

/// A slow error of first order (Gauss-Markov): its stationary standard deviation and its correlation time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Wander {
    /// The record tells.
    #[default]
    Unknown,
    /// The record tells; the search begins here.
    About {
        /// Standard deviation.
        sigma: f64,
        /// Correlation time, s.
        time_s: f64,
    },
    /// As stated; none where the standard deviation is zero.
    Known {
        /// Standard deviation.
        sigma: f64,
        /// Correlation time, s.
        time_s: f64,
    },
}

/// Age of the content of a stream at its stamp, positive where it shows older motion; filters are not counted in it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Delay {
    /// Expected, s.
    pub expected_s: f64,
    /// One standard deviation of what is expected, s; zero where the stamps are right.
    pub sigma_s: f64,
}

impl Default for Delay {
    fn default() -> Self {
        Self { expected_s: 0.0, sigma_s: 0.3 }
    }
}

impl Delay {
    /// None: stamps are right.
    pub const NONE: Self = Self { expected_s: 0.0, sigma_s: 0.0 };
}

/// Errors of a stream of the localisation: each axis white noise and wander, the wander of streams independent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct LocalizationErrors {
    /// White noise of one sample.
    pub white: Level,
    /// Slow error.
    pub wander: Wander,
}

/// Errors of a triad of the inertial unit.
///
/// # Source
/// published = (1 + K) filter(true) + b + noise, K of scales and misalignments, axis by axis.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct InertialErrors {
    /// Noise of one sample, rad/s or m/s^2, as the white noise that has the same density at low frequency.
    pub white: Level,
    /// What the published series has gone through; none where it is the true one.
    pub filter: Option<LinearFilter>,
    /// How long the answer may be of a filter that nobody describes, or of what [`filter`](Self::filter) leaves out, one standard deviation, s;
    /// zero where there is no more. Its delay counts as [`delay`](Self::delay), its width is found.
    pub unknown_filter_s: f64,
    /// One standard deviation of the error of scale; zero where there is none.
    pub scale_sigma: f64,
    /// One standard deviation of the answer of an axis to another one; zero where there is none.
    pub misalignment_sigma: f64,
    /// One standard deviation of the bias, rad/s or m/s^2; zero where there is none.
    pub bias_sigma: f64,
    /// Age of the content.
    pub delay: Delay,
}

/// Sensors of a robot, as far as the log of its motion shows them.
///
/// # Frame
/// Position and velocity of the body origin: errors along inertial axes. Attitude, rate, acceleration, lever arm: body axes.
/// # Units
/// m, rad, m/s, rad/s, m/s^2, s.
///
/// # Example
/// A robot whose gyroscope is averaged over the last four samples of 4 ms, everything else left to the record:
/// ```
/// use tumble_identification::sensing::{LinearFilter, Sensing};
/// let mut sensing = Sensing::default();
/// sensing.rate.filter = Some(LinearFilter::try_new(&[0.25; 4], &[1.0], 0.004)?);
/// assert!(sensing.check().is_ok());
/// assert_eq!(sensing.rate.filter.unwrap().delay_samples(), 1.5);
/// # Ok::<(), tumble_identification::IdentificationError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Sensing {
    /// Position, m.
    pub position: LocalizationErrors,
    /// Attitude, rad: measured = true exp(error).
    pub attitude: LocalizationErrors,
    /// Velocity, m/s.
    pub velocity: LocalizationErrors,
    /// Age of the poses.
    pub pose_delay: Delay,
    /// Age of the velocities; `None` where they are as old as the poses.
    pub velocity_delay: Option<Delay>,
    /// Angular rate.
    pub rate: InertialErrors,
    /// Acceleration.
    pub acceleration: InertialErrors,
    /// Where the accelerometer sits, from the body origin, m. The publisher takes the centripetal acceleration of that place by its own rate
    /// out, and leaves in what the angular acceleration makes.
    pub lever_arm_body_m: [f64; 3],
    /// One standard deviation of that place, each axis, m; zero where it is as stated.
    pub lever_arm_sigma_m: f64,
    /// One standard deviation, each axis, m, of the place for which the publisher takes it out, about the stated one; zero where it is that.
    /// As large as the lever arm where nothing may be taken out at all.
    pub lever_arm_taken_out_sigma_m: f64,
    /// What the publisher has added for gravity, by the attitude it measured, inertial axes, m/s^2; `None` is the gravity that acts.
    pub gravity_added_world_m_s2: Option<[f64; 3]>,
    /// One standard deviation of the scales of an accelerometer that is not sane; where the record cannot tell it from a sane one,
    /// that of [`InertialErrors::scale_sigma`] holds. Equal to it: never doubted.
    pub doubted_scale_sigma: f64,
    /// How fast a robot may move before its localisation loses what it goes by; `None` where nothing is known of that. Estimators
    /// do without; planners keep within.
    pub localization_limits: Option<LocalizationLimits>,
}

/// What a localisation survives, and what becomes of its poses beyond: cameras lose features in fast turns and pushes, and what is matched
/// then is elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct LocalizationLimits {
    /// Largest magnitude of the angular rate, rad/s; infinite where turns do no harm.
    pub rate_rad_s: f64,
    /// Largest magnitude of the acceleration of the body origin, m/s^2; infinite where pushes do none.
    pub acceleration_m_s2: f64,
    /// Jumps per second while either is exceeded.
    pub jumps_hz: f64,
    /// Size of a jump in position, m.
    pub jump_position_m: f64,
    /// Size of a jump in attitude, rad.
    pub jump_attitude_rad: f64,
    /// Size of a jump in rate, rad/s.
    pub jump_rate_rad_s: f64,
}

impl Default for LocalizationLimits {
    /// None: whatever the motion, nothing jumps.
    fn default() -> Self {
        Self {
            rate_rad_s: f64::INFINITY,
            acceleration_m_s2: f64::INFINITY,
            jumps_hz: 0.0,
            jump_position_m: 0.0,
            jump_attitude_rad: 0.0,
            jump_rate_rad_s: 0.0,
        }
    }
}

impl Default for InertialErrors {
    fn default() -> Self {
        Self {
            white: Level::Unknown,
            filter: None,
            unknown_filter_s: 0.1,
            scale_sigma: 1e-3,
            misalignment_sigma: 1.75e-3,
            bias_sigma: 0.02,
            delay: Delay::default(),
        }
    }
}

impl Default for Sensing {
    /// A robot of which nothing is known but that its inertial unit is a usual one: levels, delays, the width of filters and the lever arm are
    /// found.
    fn default() -> Self {
        Self {
            position: LocalizationErrors::default(),
            attitude: LocalizationErrors::default(),
            velocity: LocalizationErrors::default(),
            pose_delay: Delay::default(),
            velocity_delay: Some(Delay::default()),
            rate: InertialErrors::default(),
            acceleration: InertialErrors { misalignment_sigma: 1.75e-3, bias_sigma: 0.1, ..InertialErrors::default() },
            lever_arm_body_m: [0.0; 3],
            lever_arm_sigma_m: 0.05,
            lever_arm_taken_out_sigma_m: 0.05,
            gravity_added_world_m_s2: None,
            doubted_scale_sigma: 1.0,
            localization_limits: None,
        }
    }
}

impl Level {
    fn stated(self) -> Option<f64> {
        match self {
            Self::Unknown => None,
            Self::About(sigma) | Self::Known(sigma) => Some(sigma),
        }
    }

    pub(crate) fn is_known(self) -> bool {
        matches!(self, Self::Known(_))
    }

    /// What is stated, or else this.
    pub fn or(self, sigma: f64) -> f64 {
        self.stated().unwrap_or(sigma)
    }
}

impl Wander {
    fn stated(self) -> Option<(f64, f64)> {
        match self {
            Self::Unknown => None,
            Self::About { sigma, time_s } | Self::Known { sigma, time_s } => Some((sigma, time_s)),
        }
    }

    pub(crate) fn is_known(self) -> bool {
        matches!(self, Self::Known { .. })
    }

    /// Standard deviation and time, s, as stated, or else these.
    pub fn or(self, sigma: f64, time_s: f64) -> (f64, f64) {
        self.stated().unwrap_or((sigma, time_s))
    }
}

impl Sensing {
    /// Whether such sensors can be.
    ///
    /// # Errors
    /// [`IdentificationError::ImpossibleSensing`] names the first value that cannot.
    pub fn check(&self) -> Result<(), IdentificationError> {
        let refused = |what: &'static str, value: f64| Err(IdentificationError::ImpossibleSensing { what, value });
        let level = |what: &'static str, level: Level| match level {
            Level::About(sigma) | Level::Known(sigma) if !(sigma > 0.0 && sigma.is_finite()) => refused(what, sigma),
            _ => Ok(()),
        };
        let sigma = |what: &'static str, sigma: f64| {
            if sigma >= 0.0 && sigma.is_finite() { Ok(()) } else { refused(what, sigma) }
        };
        // Beyond one a gain has no sign, and beyond a radian axes no names.
        let share =
            |what: &'static str, share: f64| if share <= 1.0 { sigma(what, share) } else { refused(what, share) };
        let slow = |errors: &LocalizationErrors, white: &'static str, slow: &'static str| {
            level(white, errors.white)?;
            match errors.wander.stated() {
                Some((s, _)) if !(s >= 0.0 && s.is_finite()) => refused(slow, s),
                Some((_, time_s)) if !(time_s > 0.0 && time_s.is_finite()) => refused("time of the wander, s", time_s),
                _ => Ok(()),
            }
        };
        let late = |delay: &Delay| {
            if !delay.expected_s.is_finite() || delay.expected_s.abs() > 10.0 {
                return refused("expected delay, s", delay.expected_s);
            }
            sigma("standard deviation of a delay, s", delay.sigma_s)
        };
        slow(&self.position, "white noise of the position, m", "wander of the position, m")?;
        slow(&self.attitude, "white noise of the attitude, rad", "wander of the attitude, rad")?;
        slow(&self.velocity, "white noise of the velocity, m/s", "wander of the velocity, m/s")?;
        late(&self.pose_delay)?;
        self.velocity_delay.as_ref().map_or(Ok(()), late)?;
        for triad in [&self.rate, &self.acceleration] {
            level("noise of the inertial unit", triad.white)?;
            sigma("length of an unknown filter, s", triad.unknown_filter_s)?;
            share("error of scale of the inertial unit", triad.scale_sigma)?;
            share("misalignment of the inertial unit, rad", triad.misalignment_sigma)?;
            sigma("bias of the inertial unit", triad.bias_sigma)?;
            late(&triad.delay)?;
        }
        sigma("standard deviation of the lever arm, m", self.lever_arm_sigma_m)?;
        sigma("standard deviation of the lever arm that is taken out, m", self.lever_arm_taken_out_sigma_m)?;
        sigma("doubted error of scale", self.doubted_scale_sigma)?;
        if let Some(limits) = &self.localization_limits {
            for (what, limit) in [
                ("largest rate that the localisation survives, rad/s", limits.rate_rad_s),
                ("largest acceleration that the localisation survives, m/s^2", limits.acceleration_m_s2),
            ] {
                if limit.is_nan() || limit <= 0.0 {
                    return refused(what, limit);
                }
            }
            sigma("jumps of the localisation per second", limits.jumps_hz)?;
            sigma("jump of the position, m", limits.jump_position_m)?;
            sigma("jump of the attitude, rad", limits.jump_attitude_rad)?;
            sigma("jump of the rate, rad/s", limits.jump_rate_rad_s)?;
        }
        let places = self.lever_arm_body_m.iter().chain(self.gravity_added_world_m_s2.iter().flatten());
        places
            .copied()
            .find(|number| !number.is_finite())
            .map_or(Ok(()), |value| refused("lever arm, m, or gravity, m/s^2", value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_sensors_are_named() {
        assert_eq!(Sensing::default().check(), Ok(()));
        let refused = |change: fn(&mut Sensing)| {
            let mut sensing = Sensing::default();
            change(&mut sensing);
            let error = sensing.check().unwrap_err();
            assert!(matches!(error, IdentificationError::ImpossibleSensing { .. }), "{error}");
            error.to_string()
        };
        assert!(refused(|s| s.position.white = Level::Known(-1.0)).contains("position"));
        assert!(refused(|s| s.velocity.wander = Wander::Known { sigma: 1.0, time_s: 0.0 }).contains("time"));
        assert!(refused(|s| s.rate.bias_sigma = f64::NAN).contains("bias"));
        assert!(refused(|s| s.pose_delay.sigma_s = -0.1).contains("delay"));
        assert!(refused(|s| s.acceleration.scale_sigma = 5.0).contains("scale"));
        assert!(refused(|s| s.rate.misalignment_sigma = 2.0).contains("misalignment"));
        assert!(refused(|s| s.acceleration.delay.expected_s = f64::INFINITY).contains("delay"));
        assert!(refused(|s| s.lever_arm_body_m[1] = f64::NAN).contains("lever"));
    }
}
