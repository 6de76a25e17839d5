//! A state estimator where more acts than the actuators give.

use super::{Acted, Doubt, EstimatorError, Finding, Measurement, StateEstimator};
use crate::dynamics::{Environment, InertialParameters, RigidBodyState, WrenchModel};
use crate::lie::Wrench;
use crate::recursive::{FlightHealth, Reception, ReceptionCounts};

/// Time after which the estimator is asked anew what body it is, ns.
const ASKED_EVERY_NS: i64 = 1_000_000_000;

/// Any [`StateEstimator`] that is told what the environment does besides the actuators: gravity gradient, drag.
///
/// The wrench in the middle of each span acted is added to it, on the body and at the state that the estimator believes. The time of the models is that of the stamps, s.
///
/// # Example
/// ```
/// use tumble_identification::dynamics::Environment;
/// use tumble_identification::estimator::{InEnvironment, StateEstimator};
///
/// fn outdoors<E: StateEstimator>(estimator: E, wind: Environment) -> impl StateEstimator {
///     InEnvironment::new(estimator, wind)
/// }
/// ```
#[derive(Clone, Debug)]
pub struct InEnvironment<E> {
    estimator: E,
    environment: Environment,
    body: Option<InertialParameters<f64>>,
    asked_ns: Option<i64>,
}

impl<E: StateEstimator> InEnvironment<E> {
    /// The estimator in this environment.
    pub fn new(estimator: E, environment: Environment) -> Self {
        Self { estimator, environment, body: None, asked_ns: None }
    }

    /// The estimator itself.
    pub fn estimator(&self) -> &E {
        &self.estimator
    }

    /// The same, to be changed.
    pub fn estimator_mut(&mut self) -> &mut E {
        &mut self.estimator
    }

    fn wrench_at(&mut self, time_ns: i64) -> Wrench<f64> {
        if self.asked_ns.is_none_or(|asked_ns| time_ns.saturating_sub(asked_ns) >= ASKED_EVERY_NS) {
            let point = self.estimator.finding().ok().and_then(|found| found.point().copied());
            self.body = point.map(|ten| InertialParameters::from_vector(&ten)).or(self.body);
            self.asked_ns = Some(time_ns);
        }
        let (time_s, state) = (time_ns as f64 * 1e-9, self.estimator.state_at(time_ns));
        match &self.body {
            Some(body) => self.environment.wrench_on(body, time_s, &state),
            None => self.environment.wrench_body(time_s, &state),
        }
    }
}

impl<E: StateEstimator> StateEstimator for InEnvironment<E> {
    fn name(&self) -> &'static str {
        self.estimator.name()
    }
    fn acted(&mut self, acted: &Acted) {
        if self.environment.is_empty() {
            return self.estimator.acted(acted);
        }
        let wrench_body = acted.wrench_body + self.wrench_at(acted.from_ns.midpoint(acted.until_ns));
        self.estimator.acted(&Acted { wrench_body, ..*acted });
    }
    fn measured(&mut self, measurement: &Measurement) -> Reception {
        self.estimator.measured(measurement)
    }
    fn state_at(&self, time_ns: i64) -> RigidBodyState<f64> {
        self.estimator.state_at(time_ns)
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        self.estimator.finding()
    }
    fn health(&self) -> FlightHealth {
        self.estimator.health()
    }
    fn newest_stamp_ns(&self) -> i64 {
        self.estimator.newest_stamp_ns()
    }
    fn counts(&self) -> ReceptionCounts {
        self.estimator.counts()
    }
    fn doubt(&mut self, doubt: &Doubt) {
        self.estimator.doubt(doubt);
    }
    fn restart(&mut self, body: &Finding) -> Result<(), EstimatorError> {
        self.asked_ns = None;
        self.estimator.restart(body)
    }
    fn compensated(&self, wrench: &Wrench<f64>) -> Option<Wrench<f64>> {
        self.estimator.compensated(wrench)
    }
}
