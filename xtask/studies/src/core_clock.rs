//! Time that a computation takes on one core, whatever else the machine does.

use std::time::{Duration, Instant};

use tumble_planning::Budget;

/// A clock of the calling thread: the time it was on a core where the system tells (Linux), else what went by. One reading
/// takes about 0.01 ms, which the times contain.
pub struct CoreClock {
    start: Instant,
    on_core: Option<Duration>,
}

impl CoreClock {
    pub fn start() -> Self {
        let on_core = time_on_core();
        Self { start: Instant::now(), on_core }
    }

    pub fn elapsed(&self) -> Duration {
        match (self.on_core, time_on_core()) {
            (Some(before), Some(now)) => now.saturating_sub(before),
            _ => self.start.elapsed(),
        }
    }

    /// What this clock tells on this machine.
    pub fn name() -> &'static str {
        if time_on_core().is_some() { "time on a core" } else { "wall time" }
    }
}

fn time_on_core() -> Option<Duration> {
    // The system adds up a thread's time when the thread leaves its core, if only for a moment.
    std::thread::yield_now();
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    text.split_whitespace().next()?.parse().ok().map(Duration::from_nanos)
}

/// Work until this much time on a core went by: the clock that the planners do not have.
pub struct CoreBudget {
    clock: CoreClock,
    limit: Duration,
    /// Since the start, by the cheap clock, which never goes slower: before this the limit is not reached.
    next_look: Duration,
    is_over: bool,
}

impl CoreBudget {
    pub fn new(limit: Duration) -> Self {
        Self { clock: CoreClock::start(), limit, next_look: limit, is_over: limit.is_zero() }
    }
}

impl Budget for CoreBudget {
    fn spend(&mut self, _units: u64) -> bool {
        const LEAST_STEP: Duration = Duration::from_micros(100);
        if !self.is_over && self.clock.start.elapsed() >= self.next_look {
            let left = self.limit.saturating_sub(self.clock.elapsed());
            self.is_over = left.is_zero();
            self.next_look = self.clock.start.elapsed() + left.max(LEAST_STEP);
        }
        !self.is_over
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn work(rounds: u64) {
        for round in 0..rounds {
            std::hint::black_box(round);
        }
    }

    /// Sleep does not count where the system tells; work does, and never more than what went by.
    #[test]
    fn work_counts_and_sleep_does_not() {
        let clock = CoreClock::start();
        std::thread::sleep(Duration::from_millis(50));
        let asleep = clock.elapsed();
        if time_on_core().is_some() {
            assert!(asleep < Duration::from_millis(25), "{asleep:?}");
        }
        let (clock, wall) = (CoreClock::start(), Instant::now());
        while clock.start.elapsed() < Duration::from_millis(50) {
            work(10_000);
        }
        let (worked, went_by) = (clock.elapsed(), wall.elapsed());
        assert!(worked > Duration::from_millis(1) && worked <= went_by + Duration::from_millis(1), "{worked:?}");
    }

    #[test]
    fn a_budget_ends_when_its_time_is_over_and_not_before() {
        let limit = Duration::from_millis(20);
        let (mut budget, clock) = (CoreBudget::new(limit), CoreClock::start());
        while budget.spend(1) {
            work(100);
        }
        let took = clock.elapsed();
        assert!(took >= Duration::from_millis(19) && took < Duration::from_millis(40), "{took:?}");
        assert!(!budget.spend(1));
    }
}
