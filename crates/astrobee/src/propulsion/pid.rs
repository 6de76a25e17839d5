//! The controller that both motors of a module have.

use super::constants::CONTROL_PERIOD_S;

/// Proportional, integral and high-pass gains, and the largest output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PidGains {
    pub proportional: f64,
    pub integral: f64,
    pub derivative: f64,
    /// Largest output either way, V.
    pub limit_v: f64,
}

/// A proportional-integral controller with a high-pass in place of the derivative; nothing keeps it from winding up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pid {
    /// Integral of the error.
    pub integral: f64,
    /// What the high-pass has let go of: follows the scaled error with a time constant of about 1 s.
    pub high_pass: f64,
}

impl Pid {
    /// Voltage for this error; then the states move on by one period.
    pub(super) fn step(&mut self, gains: &PidGains, error: f64) -> f64 {
        let derivative = gains.derivative * error - self.high_pass;
        let output = gains.proportional * error + gains.integral * self.integral + derivative;
        self.high_pass += CONTROL_PERIOD_S * derivative;
        self.integral += CONTROL_PERIOD_S * error;
        output.clamp(-gains.limit_v, gains.limit_v)
    }
}
