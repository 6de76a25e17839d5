//! A number that a log tells.

/// A number and its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// The number.
    pub value: f64,
    /// One standard deviation.
    pub sigma: f64,
}
