//! What is learned first is learned about a wrong body: it is learned again when a better one is known.

use super::filtered::{Filtered, Rules, steps};
use super::wrench_history::WrenchHistory;
use crate::dynamics::LogCholesky;
use crate::estimator::Measurement;

/// Measurements kept since the filter last began: more than half a minute at 62.5 Hz.
pub(super) const KEPT: usize = 2560;
/// First time after which everything is filtered again, s, and the factor to the next one.
pub(super) const FIRST_S: f64 = 2.0;
pub(super) const FACTOR: f64 = 1.5;
/// Every time has its end: what is known by then is linear enough. Last time, s.
pub(super) const LAST_S: f64 = 40.0;
/// A pass begins at this part of its time, so that it has caught up by then.
const EARLY: f64 = 0.95;
/// Steps and measurements of a pass that one call may take: a third of a millisecond.
const WORK: usize = 96;

/// All settled measurements since the body was last made uncertain, and when to go through them again.
///
/// A Kalman filter that begins far off takes its first derivatives at the wrong body and is then surer than it should be, for
/// good. So at times that grow geometrically all measurements are filtered again from the start on, with all derivatives at
/// the body known by then: each pass is one Gauss-Newton step of the most likely body, and its covariance is the one that
/// belongs there. A pass is spread over calls, since no control period may take as long as all of it; meanwhile the filter goes on as it is,
/// and is replaced at that time, or when the pass has caught up.
#[derive(Clone, Debug)]
pub(super) struct FirstLessons {
    start: Filtered,
    measurements: Vec<Measurement>,
    next_s: f64,
    full: bool,
    pass: Option<Pass>,
}

/// A pass under way.
#[derive(Clone, Debug)]
struct Pass {
    filtered: Filtered,
    /// The first measurement that it has not taken.
    next: usize,
    about: LogCholesky<f64>,
    /// When the filter is replaced, s.
    due_s: f64,
}

impl FirstLessons {
    pub(super) fn new(start: &Filtered) -> Self {
        Self { start: *start, measurements: Vec::with_capacity(KEPT), next_s: FIRST_S, full: false, pass: None }
    }

    /// Begins anew at this filter, whose body has just become uncertain.
    pub(super) fn begin_at(&mut self, start: &Filtered) {
        self.start = *start;
        self.measurements.clear();
        (self.next_s, self.full, self.pass) = (FIRST_S, false, None);
    }

    /// Keeps a measurement that nothing will come before any more.
    pub(super) fn keep(&mut self, measurement: &Measurement) {
        if self.full || (self.next_s > LAST_S && self.pass.is_none()) {
            return;
        }
        if self.measurements.len() == KEPT {
            (self.full, self.pass) = (true, None);
            return;
        }
        self.measurements.push(measurement.clone());
    }

    /// Goes through everything again where it is time, about the body of `settled`, by a bounded amount of work; the filter at the last
    /// measurement kept, when the pass has come there.
    pub(super) fn work(&mut self, rules: &Rules, history: &WrenchHistory, settled: &Filtered) -> Option<Filtered> {
        if history.complete_since_ns() > self.start.stamp_ns {
            self.pass = None;
            return None;
        }
        let since_s = settled.stamp_ns.saturating_sub(self.start.stamp_ns) as f64 * 1e-9;
        if self.pass.is_none() && self.are_due(since_s) {
            let (about, due_s) = (settled.state.joint.body, self.next_s);
            self.pass = Some(Pass { filtered: self.start, next: 0, about, due_s });
            self.next_s *= FACTOR;
        }
        let pass = self.pass.as_mut()?;
        let (mut work, first) = (0, pass.next);
        while let Some(measurement) = self.measurements.get(pass.next) {
            work += 1 + steps(pass.filtered.stamp_ns, measurement.stamp_ns).count();
            if work > WORK && pass.next > first {
                return None;
            }
            pass.filtered.advance(rules, history, measurement.stamp_ns, Some(&pass.about));
            pass.filtered.take(rules, measurement);
            pass.next += 1;
        }
        self.pass.take_if(|pass| since_s >= pass.due_s).map(|pass| pass.filtered)
    }

    fn are_due(&self, since_s: f64) -> bool {
        !self.full && self.next_s <= LAST_S && since_s >= EARLY * self.next_s && !self.measurements.is_empty()
    }
}
