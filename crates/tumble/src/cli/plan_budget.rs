//! How long `tumble plan` searches.

use crate::TumbleError;
use std::time::{Duration, Instant};
use tumble_planning::Budget;

/// Units granted unless said otherwise.
const BUDGET_UNITS: u64 = 100_000;
/// Longest search, s.
const LONGEST_S: f64 = 86_400.0;

/// A budget of units or of time, and when how much of it was spent.
pub(super) struct WatchedBudget {
    units: Option<u64>,
    time: Option<Duration>,
    pub clock: Instant,
    spent: u64,
    /// Units and time, s; each at one part in sixty-four more units than the one before.
    marks: Vec<(u64, f64)>,
    /// Whether more was asked for than is granted.
    pub is_over: bool,
}

impl WatchedBudget {
    pub fn new(units: Option<u64>, time: Option<Duration>) -> Self {
        Self { units, time, clock: Instant::now(), spent: 0, marks: Vec::new(), is_over: false }
    }

    /// When so many units were spent, s.
    pub fn time_of(&self, units: u64) -> Option<f64> {
        self.marks.iter().find(|(spent, _)| *spent >= units).or(self.marks.last()).map(|(_, time_s)| *time_s)
    }
}

impl Budget for WatchedBudget {
    fn spend(&mut self, units: u64) -> bool {
        let spent = self.spent.saturating_add(units);
        self.is_over |= self.units.is_some_and(|most| spent > most);
        self.is_over |= self.time.is_some_and(|most| self.clock.elapsed() >= most);
        if self.is_over {
            return false;
        }
        self.spent = spent;
        if self.marks.last().is_none_or(|(marked, _)| spent > marked + marked / 64) {
            self.marks.push((spent, self.clock.elapsed().as_secs_f64()));
        }
        true
    }
}

/// The budget that the options ask for.
///
/// # Errors
/// [`TumbleError::BadOption`].
pub(super) fn budget(units: Option<u64>, time_limit_s: Option<f64>) -> Result<WatchedBudget, TumbleError> {
    let refused = |message: String| Err(TumbleError::BadOption { message });
    match (time_limit_s, units) {
        (Some(limit_s), _) if limit_s > 0.0 && limit_s <= LONGEST_S => {
            Ok(WatchedBudget::new(None, Some(Duration::from_secs_f64(limit_s))))
        }
        (Some(limit_s), _) => refused(format!("`--time-limit {limit_s}`: more than 0 s and at most {LONGEST_S} s")),
        (None, Some(0)) => refused("`--budget 0`: at least one unit".to_owned()),
        (None, units) => Ok(WatchedBudget::new(Some(units.unwrap_or(BUDGET_UNITS)), None)),
    }
}
