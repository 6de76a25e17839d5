//! Identification from one throw: a body tumbles in free fall while a wheel inside it spins up and down.
//!
//! In free fall no torque acts about the common centre of mass, so the angular momentum of body and wheel stays where
//! it is, seen from outside:
//!
//! `R(t) (X w(t) + e_z W(t)) = h`,
//!
//! with `R` the attitude, `w` the body rate, `W` the wheel's speed relative to the body about the body's z axis, and `X`
//! the inertia about the common centre of mass, wheel at rest included, *in units of the wheel's inertia* `j`. This is
//! linear in `X` and needs no derivative of a measurement: the attitude is the integrated gyro. Both sides are averaged
//! over short windows; `h` may wander as a residual torque (air, a cable) makes it, and is eliminated exactly.
//! The accelerometer gives the centre of mass: it reads `-(S(dw) + S(w)^2) r`, `r` from the sensor to the common centre
//! of mass.
//!
//! `j` and the device that carries the wheel are learned once ([`calibrate`]): throws of the device alone and of the
//! device with a block of known inertia. [`identify_throw`] then takes the device away from what was thrown.
//!
//! # Frame
//! Body axes of the device, wheel along z; positions from the inertial sensor.
//! # Source
//! T. M. Blaha, M. M. Kuijper, R. Pop, E. J. J. Smeur, "Rapid and Inexpensive Inertia Tensor Estimation from a Single
//! Object Throw", arXiv 2503.13137: the model; estimator and covariance are this crate's.

mod calibration;
mod momentum_balance;
mod regressors;
mod sensor_errors;
mod throw;
mod throw_record;

pub use calibration::{WheelCalibration, calibrate};
pub use momentum_balance::FreeFallEstimate;
pub use regressors::{lever_arm_regressor, momentum_regressor, torque_regressor, wheel_torque};
pub use sensor_errors::{SensorErrors, sensor_axes, wheel_delay};
pub use throw::{ErrorBudget, ObjectEstimate, ThrowEstimate, Thrown, identify_throw};
pub use throw_record::{EndOfFall, ThrowRecord, ThrowSample};

use crate::IdentificationError;

/// How a throw is read; one set for every object. The defaults are those of every figure this project reports.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct ThrowSettings {
    /// Free fall counts from here, s after the wheel starts: before it the speed telemetry of the wheel is not valid.
    pub start_s: f64,
    /// Length of the averaging windows, s: the (raised-cosine) average halves what oscillates at one over this length,
    /// so vibration of the mounting and steps of the wheel's telemetry drop out and the tumbling stays.
    pub window_s: f64,
    /// From one window to the next, s.
    pub window_step_s: f64,
    /// Left out before the end of the record or the landing, s: a hand or a net may already touch.
    pub end_guard_s: f64,
    /// Error of a window's average rate, per axis, rad/s.
    pub rate_sigma_rad_s: f64,
    /// Error of a window's average wheel speed, rad/s.
    pub wheel_sigma_rad_s: f64,
    /// Random walk of the angular momentum in one square root second, in units of the wheel's inertia, rad/s: the
    /// residual torque.
    pub momentum_walk_rad_s: f64,
    /// A rate this large or larger is saturated, rad/s.
    pub gyro_full_scale_rad_s: f64,
    /// A jump of the specific force's size by more than this within [`ThrowSettings::window_s`] is the landing, m/s^2;
    /// resonance with the wheel reaches half the default.
    pub landing_jump_m_s2: f64,
}

impl Default for ThrowSettings {
    fn default() -> Self {
        Self {
            start_s: 0.075,
            window_s: 0.02,
            window_step_s: 0.005,
            end_guard_s: 0.02,
            rate_sigma_rad_s: 4e-3,
            wheel_sigma_rad_s: 2.0,
            momentum_walk_rad_s: 45.0,
            gyro_full_scale_rad_s: 34.8,
            landing_jump_m_s2: 60.0,
        }
    }
}

impl ThrowSettings {
    /// Itself when every number is finite and positive; the start and the guard may be zero, the step from window to
    /// window at least a hundredth of the window.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`] with the component in the order of the fields.
    pub fn validated(self) -> Result<Self, IdentificationError> {
        let fields = [
            self.start_s,
            self.window_s,
            self.window_step_s,
            self.end_guard_s,
            self.rate_sigma_rad_s,
            self.wheel_sigma_rad_s,
            self.momentum_walk_rad_s,
            self.gyro_full_scale_rad_s,
            self.landing_jump_m_s2,
        ];
        for (index, value) in fields.into_iter().enumerate() {
            let may_be_zero = [0, 3].contains(&index);
            let too_small = index == 2 && value < 0.01 * self.window_s;
            if too_small || !(value.is_finite() && (value > 0.0 || may_be_zero && value == 0.0)) {
                return Err(IdentificationError::NotPositive { index, value });
            }
        }
        Ok(self)
    }
}
