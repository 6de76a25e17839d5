//! How much work a planner may do.

/// Work that may still be done. An anytime algorithm asks before each piece of work and ends, with the best it has, when
/// told to. Nothing in this crate reads a clock: a budget that does is the caller's.
///
/// # Example
/// ```
/// use tumble_planning::Budget;
///
/// /// Ends when another thread says so.
/// struct UntilTold<'a>(&'a std::sync::atomic::AtomicBool);
/// impl Budget for UntilTold<'_> {
///     fn spend(&mut self, _units: u64) -> bool {
///         !self.0.load(std::sync::atomic::Ordering::Relaxed)
///     }
/// }
/// let is_over = std::sync::atomic::AtomicBool::new(false);
/// let mut budget = UntilTold(&is_over);
/// assert!(budget.spend(100));
/// is_over.store(true, std::sync::atomic::Ordering::Relaxed);
/// assert!(!budget.spend(1));
/// ```
/// Tutorial: [a budget that looks at the clock](https://github.com/tumble-robotics/tumble/blob/main/crates/tumble/src/cli/plan_budget.rs).
pub trait Budget {
    /// Asks for `units` of work; one unit is about one continuous collision check of one edge. False: end now; whoever asks on
    /// after that must be refused again.
    fn spend(&mut self, units: u64) -> bool;
}

/// A fixed number of units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Units {
    left: u64,
    spent: u64,
}

impl Units {
    /// A budget of `units`.
    pub fn new(units: u64) -> Self {
        Self { left: units, spent: 0 }
    }

    /// Units granted so far.
    pub fn spent(&self) -> u64 {
        self.spent
    }
}

impl Budget for Units {
    fn spend(&mut self, units: u64) -> bool {
        let is_granted = units <= self.left;
        if is_granted {
            self.left -= units;
            self.spent += units;
        } else {
            self.left = 0;
        }
        is_granted
    }
}
