//! A budget that remembers.

use crate::budget::Budget;

/// Grants units and remembers what was granted.
pub(super) struct Account {
    left: u64,
    pub granted: u64,
    pub refused: bool,
    /// How often anything was asked for after a refusal.
    pub asks_on: u64,
}

impl Account {
    pub fn of(units: u64) -> Self {
        Self { left: units, granted: 0, refused: false, asks_on: 0 }
    }
}

impl Budget for Account {
    fn spend(&mut self, units: u64) -> bool {
        if self.refused {
            self.asks_on += 1;
            return false;
        }
        self.refused = units > self.left;
        if !self.refused {
            self.left -= units;
            self.granted += units;
        }
        !self.refused
    }
}
