//! What is learned first is learned about a wrong body: it is learned again when a better one is known.

use super::filtered::{Filtered, Rules};
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

/// All settled measurements since the body was last made uncertain, and when to go through them again.
///
/// A Kalman filter that begins far off takes its first derivatives at the wrong body and is then surer than it should be, for
/// good. So at times that grow geometrically all measurements are filtered again from the start on, with all derivatives at
/// the body known by then: each pass is one Gauss-Newton step of the most likely body, and its covariance is the one that
/// belongs there.
#[derive(Clone, Debug)]
pub(super) struct FirstLessons {
    start: Filtered,
    measurements: Vec<Measurement>,
    next_s: f64,
    full: bool,
}

impl FirstLessons {
    pub(super) fn new(start: &Filtered) -> Self {
        Self { start: *start, measurements: Vec::with_capacity(KEPT), next_s: FIRST_S, full: false }
    }

    /// Begins anew at this filter, whose body has just become uncertain.
    pub(super) fn begin_at(&mut self, start: &Filtered) {
        self.start = *start;
        self.measurements.clear();
        (self.next_s, self.full) = (FIRST_S, false);
    }

    /// Keeps a measurement that nothing will come before any more.
    pub(super) fn keep(&mut self, measurement: &Measurement) {
        if self.next_s > LAST_S || self.full {
            return;
        }
        if self.measurements.len() == KEPT {
            self.full = true;
            return;
        }
        self.measurements.push(measurement.clone());
    }

    /// Whether it is time to go through everything again.
    pub(super) fn are_due(&self, settled_ns: i64, history: &WrenchHistory) -> bool {
        !self.full
            && self.next_s <= LAST_S
            && (settled_ns.saturating_sub(self.start.stamp_ns)) as f64 * 1e-9 >= self.next_s
            && history.complete_since_ns() <= self.start.stamp_ns
            && !self.measurements.is_empty()
    }

    /// The filter at the end of another pass about this body.
    pub(super) fn again(&mut self, rules: &Rules, history: &WrenchHistory, about: &LogCholesky<f64>) -> Filtered {
        self.next_s *= FACTOR;
        let mut filtered = self.start;
        for measurement in &self.measurements {
            filtered.advance(rules, history, measurement.stamp_ns, Some(about));
            filtered.take(rules, history, measurement, Some(about));
        }
        filtered
    }
}
