//! What of the propulsion is broken.

/// What of the propulsion is broken; nothing by default. The robot does not know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damage {
    /// Factor on every thrust.
    pub thrust_factor: f64,
    /// Nozzles that do not obey: the share of their travel at which they stand, 0 closed, 1 open; in the order of
    /// [`constants::NOZZLES`](super::constants::NOZZLES).
    pub stuck: [Option<f64>; 12],
    /// Modules whose impeller is told to stop, starboard first: it slows down by 200 rpm/s.
    pub impeller_off: [bool; 2],
    /// Factor on the voltage of the supply.
    pub supply_factor: f64,
}

impl Damage {
    /// All is well.
    pub const NONE: Self = Self { thrust_factor: 1.0, stuck: [None; 12], impeller_off: [false; 2], supply_factor: 1.0 };
}

impl Default for Damage {
    fn default() -> Self {
        Self::NONE
    }
}
