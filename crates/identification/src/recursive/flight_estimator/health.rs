//! Whether the filter's own account of its errors is still true.

/// The filter's health.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightHealth {
    /// Running mean of the normalised innovation squared per degree of freedom: one where the model holds.
    pub mean_nis: f64,
    /// The running mean above which it is called diverged.
    pub alarm_above: f64,
    /// The running mean left its chi-square band and has not come back well inside: see
    /// [`restart`](super::FlightEstimator::restart).
    pub diverged: bool,
    /// Innovations have been one-sided for long: the body is no longer what it was, see
    /// [`body_changed`](super::FlightEstimator::body_changed).
    pub body_doubtful: bool,
}
