//! Tutorial: bring your own estimator in flight. Three steps: implement, check the laws, hand it to a loop.
//!
//! The one here is the simplest that is right: it keeps all that it was told and filters the whole flight again whenever it is asked. So
//! measurements may come in any order, and a restart is another prior. It is slow, and good enough for a log.

use crate::state_estimator_laws::{settings, short_trial};
use std::collections::BTreeMap;
use tumble_identification::Estimate;
use tumble_identification::dynamics::RigidBodyState;
use tumble_identification::estimator::{Acted, Doubt, EstimatorError, Finding, Gauss, Measurement, StateEstimator};
use tumble_identification::laws::check_state_estimator;
use tumble_identification::nalgebra::Vector3;
use tumble_identification::recursive::{FlightEstimator, FlightHealth, Reception, ReceptionCounts};

// Step 1: implement. What is told is kept by its time, `now` goes through all of it.
struct Replayed {
    start: RigidBodyState<f64>,
    prior: Finding,
    /// Nothing before this is learned from.
    since_ns: i64,
    acted: Vec<Acted>,
    measured: BTreeMap<i64, Measurement>,
    doubts: Vec<Doubt>,
    counts: ReceptionCounts,
}

impl Replayed {
    fn now(&self) -> FlightEstimator {
        let prior = Estimate::try_from(&self.prior).unwrap();
        let mut filter = FlightEstimator::try_new(settings(), self.start, self.since_ns, &prior).unwrap();
        let mut seen = self.measured.range(self.since_ns..).peekable();
        for acted in self.acted.iter().filter(|acted| acted.from_ns >= self.since_ns) {
            StateEstimator::acted(&mut filter, acted);
            while let Some((_, measurement)) = seen.next_if(|(stamp_ns, _)| **stamp_ns <= acted.until_ns) {
                StateEstimator::measured(&mut filter, measurement);
            }
        }
        self.doubts.iter().for_each(|doubt| filter.doubt(doubt));
        filter
    }
}

impl StateEstimator for Replayed {
    fn acted(&mut self, acted: &Acted) {
        if acted.wrench_body.to_vector().iter().all(|x| x.is_finite()) {
            self.acted.push(*acted);
        }
    }
    fn measured(&mut self, measurement: &Measurement) -> Reception {
        let end_ns = self.acted.last().map_or(self.since_ns, |acted| acted.until_ns);
        let values = [measurement.position_world, measurement.rate_body];
        let good = |seen: &Gauss<Vector3<f64>>| {
            seen.value.iter().all(|x| x.is_finite()) && seen.covariance.cholesky().is_some()
        };
        if !(self.since_ns..=end_ns).contains(&measurement.stamp_ns) {
            return Reception::TooOld;
        } else if !values.iter().flatten().all(good) {
            return Reception::Malformed { what: "not a number" };
        } else if self.measured.contains_key(&measurement.stamp_ns) {
            return Reception::Duplicate;
        }
        self.measured.insert(measurement.stamp_ns, measurement.clone());
        self.counts.used += 1;
        Reception::Used { nis: 1.0 }
    }
    fn state_at(&self, time_ns: i64) -> RigidBodyState<f64> {
        StateEstimator::state_at(&self.now(), time_ns)
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        self.now().finding()
    }
    fn health(&self) -> FlightHealth {
        StateEstimator::health(&self.now())
    }
    fn newest_stamp_ns(&self) -> i64 {
        self.measured.last_key_value().map_or(self.since_ns, |(stamp_ns, _)| *stamp_ns)
    }
    fn doubt(&mut self, doubt: &Doubt) {
        self.doubts.push(*doubt);
    }
    fn restart(&mut self, body: &Finding) -> Result<(), EstimatorError> {
        (self.start, self.since_ns) = (self.state_at(self.newest_stamp_ns()), self.newest_stamp_ns());
        self.prior = *body;
        self.doubts.clear();
        Ok(())
    }
    fn counts(&self) -> ReceptionCounts {
        self.counts
    }
}

// Step 2: check the laws, from a constructor.
#[test]
fn it_keeps_the_laws() {
    let begin = |start: &RigidBodyState<f64>, prior: &Finding| -> Result<Box<dyn StateEstimator>, EstimatorError> {
        let (start, prior, counts) = (*start, *prior, ReceptionCounts::default());
        let (acted, measured, doubts) = (Vec::new(), BTreeMap::new(), Vec::new());
        Ok(Box::new(Replayed { start, prior, since_ns: 0, acted, measured, doubts, counts }))
    };
    check_state_estimator(&begin, &short_trial()).unwrap();
}

// Step 3: wherever a loop takes a `StateEstimator`, a box of one may stand.
#[test]
fn a_box_of_one_is_one() {
    fn newest(estimator: impl StateEstimator) -> i64 {
        estimator.newest_stamp_ns()
    }
    let (start, counts) = (RigidBodyState::at_rest(), ReceptionCounts::default());
    let (acted, measured, doubts) = (Vec::new(), BTreeMap::new(), Vec::new());
    let own = Replayed { start, prior: short_trial().prior, since_ns: 7, acted, measured, doubts, counts };
    assert_eq!(newest(Box::new(own) as Box<dyn StateEstimator>), 7);
}
