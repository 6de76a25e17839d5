//! Tutorial: fly with a controller of your own. Three steps: say what it remembers, say what it answers, check the laws.
//!
//! The controller here adds the integral of the position error to a proportional-derivative law, so that a steady push leaves no
//! error behind; and stops integrating where the thrusters give all they have.
#![allow(clippy::unwrap_used)]

use crate::control_cases::{body, case, cases, held, limits, small};
use tumble_planning::control::{Adoption, ControlCommand, ControlRequest, Controller};
use tumble_planning::dynamics::{
    Actuation, ConstantWorldWrench, FreeFlyer, InertialParameters, PoseTracker, WrenchBox,
};
use tumble_planning::laws::{ControllerPromise, TrackingError, check_controller, other_worlds};
use tumble_planning::lie::{Pose, Wrench};
use tumble_planning::nalgebra::Vector3;
use tumble_planning::{ModelBelief, PlanningError};

// Step 1: what it remembers. Everything that a command depends on besides the request belongs here: no globals, no clock.
#[derive(Clone, Debug)]
struct IntegralController {
    tracker: PoseTracker,
    limits: WrenchBox,
    /// Acceleration per integral of the position error, 1/s^3.
    integral_gain: f64,
    /// Integral of the position error, world axes, m s.
    integral_world: Vector3<f64>,
    /// Time of the last output.
    last_s: Option<f64>,
    /// Revision of the belief in use; zero before the first.
    revision: u64,
}

impl IntegralController {
    fn new(nominal: InertialParameters<f64>, limits: WrenchBox) -> Self {
        let tracker = PoseTracker::critically_damped(FreeFlyer::new(nominal), 1.0, 0.6);
        let integral_world = Vector3::zeros();
        Self { tracker, limits, integral_gain: 0.03, integral_world, last_s: None, revision: 0 }
    }
}

// Step 2: what it answers.
impl Controller for IntegralController {
    // A belief is checked as a whole before anything of it is used: what is refused changes nothing. One that comes late, with a
    // revision older than the one in use, must not bring the old body back.
    fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        let parameters = belief.parameters().validated()?;
        let variance = belief.estimate.covariance[(0, 0)];
        if parameters.mass <= 0.0 {
            return Err(PlanningError::NotPositive { what: "the believed mass", value: parameters.mass });
        }
        if !variance.is_finite() || variance < 0.0 {
            return Err(PlanningError::Negative { what: "the variance of the mass", value: variance });
        }
        if belief.revision < self.revision {
            return Ok(Adoption::Contradicts { kept: self.revision });
        }
        self.tracker.body = FreeFlyer::new(parameters);
        self.revision = belief.revision;
        Ok(Adoption::Adopted)
    }

    // The same here: first look at the numbers, then remember.
    fn command(&mut self, request: &ControlRequest<'_>) -> Result<ControlCommand, PlanningError> {
        let reference = request.plan.trajectory.at(request.time_s);
        let pose = &request.state.world_from_body;
        let error_world = reference.state.world_from_body.translation.vector - pose.translation.vector;
        let passed_s = self.last_s.map_or(0.0, |last_s| (request.time_s - last_s).max(0.0));
        let integral_world = self.integral_world + error_world * passed_s;

        // The tracker works in body axes; the integral is kept in world axes, where a steady push stays what it is.
        let mut pushed = reference;
        let wanted_from_world = reference.state.world_from_body.rotation.inverse();
        pushed.acceleration.acceleration_origin_body += wanted_from_world * integral_world * self.integral_gain;
        let wanted = self.tracker.wrench_body(request.state, &pushed);
        let numbers = wanted.to_vector().sum() + request.time_s + pose.rotation.norm();
        if !numbers.is_finite() {
            return Err(PlanningError::NotFinite { what: "a number of a request", value: numbers });
        }

        let wrench_body = self.limits.realize(&wanted);
        if wrench_body.force == wanted.force {
            self.integral_world = integral_world;
        }
        self.last_s = Some(request.time_s);
        Ok(ControlCommand { wrench_body, model_revision: self.revision, fallback: None, mass: None })
    }
}

// Step 3: the laws. What is promised is up to the controller; a bound that is promised is held against every case that is marked.
#[test]
fn it_keeps_the_laws() {
    let worlds = other_worlds();
    let promise = ControllerPromise {
        limits: limits(),
        tube: Some(TrackingError { position_m: 0.006, ..small() }),
        small: small(),
        settling_s: 30.0,
        overshoot: 1.05,
        other_worlds: &worlds,
        tolerance: 1e-9,
    };
    let new = || IntegralController::new(body(), limits());

    // a steady push: at first an error as large as without the integral, in the end none
    let hold = held(Pose::translation(0.4, 0.1, -0.3));
    let wrench_world = Wrench::new(Vector3::zeros(), Vector3::new(0.008, -0.006, 0.005));
    let steady = ConstantWorldWrench { wrench_world };
    let mut pushed = case("a steady push", &hold);
    (pushed.disturbance, pushed.outputs, pushed.is_promised) = (&steady, 800, true);
    pushed.followed = Some((60.0, TrackingError { position_m: 1e-4, ..small() }));
    check_controller(&new, &[pushed], &promise).unwrap();

    // and the flights that the controllers of this crate fly
    cases(1.0, &mut |cases| check_controller(&new, cases, &promise).unwrap());
}
