//! The flown controller between its messages, and behind the trait of all controllers.

use super::drive::Follower;
use crate::flight_controller::{ControlOrder, FlightController, Setpoint};
use crate::sensing::{Confidence, LocalizationEstimate};
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{PoseReference, RigidBodyState};
use tumble_lie::Wrench;
use tumble_planning::control::{
    Adoption, ControlCommand, ControlRequest, Controller, Fallback, FallbackReason, ReferenceMotion,
};
use tumble_planning::{ModelBelief, Plan, PlanningError};

/// Latest time that counts in nanoseconds, s.
const LATEST_S: f64 = 9e9;

/// The flown controller between its messages: it computes once for each estimate, which should come at 62.5 Hz.
///
/// As a [`Controller`] it takes each request for a good estimate that is stamped with the time of the request; the same time
/// again is the same estimate, and gets the same wrench. It knows no limits but its own of 100 N.
#[derive(Clone, Debug)]
pub struct FlownController {
    controller: FlightController,
    last_stamp_ns: Option<i64>,
    wrench_body: Wrench<f64>,
    model_revision: u64,
}

impl FlownController {
    /// Before the first estimate.
    pub fn new(controller: FlightController) -> Self {
        Self { controller, last_stamp_ns: None, wrench_body: Wrench::zero(), model_revision: 0 }
    }

    /// The controller itself.
    pub fn controller(&self) -> &FlightController {
        &self.controller
    }

    /// What it asks for at a time, from the newest estimate; without a reference it brakes, then holds.
    pub fn follow(
        &mut self,
        time_ns: i64,
        estimate: &LocalizationEstimate,
        wanted: Option<&PoseReference>,
    ) -> ControlCommand {
        if self.last_stamp_ns != Some(estimate.stamp_ns) {
            self.last_stamp_ns = Some(estimate.stamp_ns);
            let order = wanted.map_or(ControlOrder::Stop, |wanted| {
                let setpoint = setpoint(time_ns, wanted);
                ControlOrder::Follow { current: setpoint, next: setpoint }
            });
            let command = self.controller.step(estimate, &order);
            self.wrench_body = command.wrench_body(&self.controller.body().center_of_mass());
        }
        ControlCommand {
            wrench_body: self.wrench_body,
            model_revision: self.model_revision,
            fallback: wanted.is_none().then_some(Fallback::Braking(FallbackReason::NoReference)),
            mass: None,
        }
    }
}

/// By each estimate as it comes, with its stamp and its confidence.
impl Follower for FlownController {
    fn offer(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        self.adopt(belief)
    }

    fn steer(
        &mut self,
        time_ns: i64,
        estimate: &LocalizationEstimate,
        plan: &Plan<&dyn ReferenceMotion>,
    ) -> Result<ControlCommand, PlanningError> {
        let wanted = plan.trajectory.at(time_ns as f64 * 1e-9);
        Ok(self.follow(time_ns, estimate, Some(&wanted)))
    }
}

impl Controller for FlownController {
    fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        let body = belief.parameters().validated()?;
        let (what, value) = ("the variance of the mass", belief.estimate.covariance[(0, 0)]);
        if !value.is_finite() {
            return Err(PlanningError::NotFinite { what, value });
        }
        if value < 0.0 {
            return Err(PlanningError::Negative { what, value });
        }
        if belief.revision < self.model_revision {
            let (value, lower) = (belief.revision as f64, self.model_revision as f64);
            let what = "the revision of a belief";
            return Err(PlanningError::OutOfRange { what, value, lower, upper: f64::INFINITY });
        }
        self.controller.set_body(body);
        self.model_revision = belief.revision;
        Ok(Adoption::Adopted)
    }

    fn command(&mut self, request: &ControlRequest<'_>) -> Result<ControlCommand, PlanningError> {
        let ControlRequest { time_s, state, plan } = request;
        if time_s.is_nan() || time_s.abs() > LATEST_S {
            let what = "the time of a command";
            return Err(PlanningError::OutOfRange { what, value: *time_s, lower: -LATEST_S, upper: LATEST_S });
        }
        if let Some(value) = first_not_finite(state) {
            return Err(PlanningError::NotFinite { what: "a number of the state", value });
        }
        let wanted = plan.trajectory.at(*time_s);
        let RigidBodyState { world_from_body, twist_body } = state;
        #[allow(clippy::cast_possible_truncation)] // tested above
        let time_ns = libm::round(time_s * 1e9) as i64;
        let estimate = LocalizationEstimate {
            stamp_ns: time_ns,
            arrival_ns: time_ns,
            world_from_body: *world_from_body,
            velocity_origin_world: world_from_body.rotation * twist_body.linear,
            rate_body: twist_body.angular,
            acceleration_origin_body: Vector3::zeros(),
            confidence: Confidence::Good,
        };
        let is_number = first_not_finite(&wanted.state).is_none()
            && wanted.acceleration.acceleration_origin_body.iter().all(|component| component.is_finite())
            && wanted.acceleration.angular_acceleration_body.iter().all(|component| component.is_finite());
        Ok(self.follow(time_ns, &estimate, is_number.then_some(&wanted)))
    }
}

fn first_not_finite(state: &RigidBodyState<f64>) -> Option<f64> {
    let pose = &state.world_from_body;
    let (angular, linear) = (&state.twist_body.angular, &state.twist_body.linear);
    let numbers = pose.rotation.coords.iter().chain(&pose.translation.vector).chain(angular).chain(linear);
    numbers.copied().find(|number| !number.is_finite())
}

/// A reference as the flown controller takes it.
fn setpoint(time_ns: i64, wanted: &PoseReference) -> Setpoint {
    let PoseReference { state: RigidBodyState { world_from_body, twist_body }, acceleration } = wanted;
    let world_from_axes = world_from_body.rotation;
    Setpoint {
        time_ns,
        world_from_body: *world_from_body,
        velocity_world: world_from_axes * twist_body.linear,
        rate_body: twist_body.angular,
        acceleration_world: world_from_axes * acceleration.acceleration_origin_body,
        angular_acceleration_body: acceleration.angular_acceleration_body,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight_modes::{ControlGains, FlightSite};
    use crate::simulator::Reference;
    use crate::worlds::WorldPreset;
    use tumble_dynamics::nalgebra::{Translation3, UnitQuaternion};
    use tumble_dynamics::{BodyAcceleration, FreeFlyer, InertialParameters, Integrator, MuntheKaas4};
    use tumble_lie::{LieGroup, Pose, Twist};

    const PERIOD_S: f64 = 0.016;

    fn flown() -> FlownController {
        FlownController::new(FlightController::new(WorldPreset::Iss.body(), ControlGains::of(FlightSite::Iss)))
    }

    fn state(position: [f64; 3], turn: [f64; 3]) -> RigidBodyState<f64> {
        let rotation = UnitQuaternion::new(Vector3::from(turn));
        RigidBodyState {
            world_from_body: Pose::from_parts(Translation3::from(Vector3::from(position)), rotation),
            twist_body: Twist::new(Vector3::new(0.02, -0.01, 0.03), Vector3::new(0.04, 0.01, -0.02)),
        }
    }

    fn ask(
        controller: &mut dyn Controller,
        time_s: f64,
        state: &RigidBodyState<f64>,
        motion: &dyn ReferenceMotion,
    ) -> Result<ControlCommand, PlanningError> {
        let plan = Plan { trajectory: motion, model_revision: 1 };
        controller.command(&ControlRequest { time_s, state, plan: &plan })
    }

    /// A slow curve with a turn about z.
    fn curve(time_s: f64) -> PoseReference {
        let rotation = UnitQuaternion::new(Vector3::new(0.0, 0.0, 0.05 * time_s));
        let world = |x: f64, y: f64| rotation.inverse() * Vector3::new(x, y, 0.0);
        let (s, c) = (0.2 * time_s).sin_cos();
        PoseReference {
            state: RigidBodyState {
                world_from_body: Pose::from_parts(Translation3::new(0.5 * s, 0.5 - 0.5 * c, 0.0), rotation),
                twist_body: Twist::new(Vector3::new(0.0, 0.0, 0.05), world(0.1 * c, 0.1 * s)),
            },
            acceleration: BodyAcceleration {
                angular_acceleration_body: Vector3::zeros(),
                acceleration_origin_body: world(-0.02 * s, 0.02 * c),
            },
        }
    }

    /// The bare controller fed with messages says the same; asked again at the same time, the same wrench comes and no
    /// integral moves.
    #[test]
    fn behind_the_trait_it_is_the_flown_controller_once_per_time() {
        let (mut wrapped, mut bare) = (flown(), *flown().controller());
        for k in 0..200_i32 {
            let time_s = f64::from(k) * PERIOD_S;
            let measured = state([0.1, 0.2 - 0.001 * f64::from(k), 0.0], [0.1, 0.0, 0.002 * f64::from(k)]);
            let command = ask(&mut wrapped, time_s, &measured, &curve).unwrap();
            let again = ask(&mut wrapped, time_s, &state([9.0; 3], [1.0; 3]), &curve).unwrap();
            assert_eq!(command, again);
            let stamp_ns = i64::from(k) * 16_000_000;
            let estimate = LocalizationEstimate {
                stamp_ns,
                arrival_ns: stamp_ns,
                world_from_body: measured.world_from_body,
                velocity_origin_world: measured.world_from_body.rotation * measured.twist_body.linear,
                rate_body: measured.twist_body.angular,
                acceleration_origin_body: Vector3::zeros(),
                confidence: Confidence::Good,
            };
            let at = setpoint(stamp_ns, &curve(time_s));
            let said = bare.step(&estimate, &ControlOrder::Follow { current: at, next: at });
            let expected = said.wrench_body(&WorldPreset::Iss.body().center_of_mass());
            assert!((command.wrench_body - expected).to_vector().amax() < 1e-15, "{k}");
            assert_eq!((command.model_revision, command.fallback, command.mass), (0, None, None));
        }
    }

    /// A body twice as heavy gets twice the force from the request after its belief on, with that belief's revision.
    #[test]
    fn a_belief_is_adopted_at_once() {
        let mut controller = flown();
        let body = WorldPreset::Iss.body();
        let far = state([0.3, 0.0, 0.1], [0.2, 0.1, 0.0]);
        let hold = Reference::Hold(Pose::identity());
        let first = ask(&mut controller, 0.0, &far, &hold).unwrap();
        let twice = InertialParameters::about_com(2.0 * body.mass, body.center_of_mass(), body.inertia_about_com());
        assert_eq!(controller.adopt(&ModelBelief::certain(5, twice)), Ok(Adoption::Adopted));
        // the same estimate is not looked at again, but it is known what is believed
        let same = ask(&mut controller, 0.0, &far, &hold).unwrap();
        assert_eq!((same.wrench_body, same.model_revision), (first.wrench_body, 5));
        let next = ask(&mut controller, PERIOD_S, &far, &hold).unwrap();
        let share = next.wrench_body.force.norm() / first.wrench_body.force.norm();
        // the integral moved on by a period
        assert!((share - 2.0).abs() < 1e-3, "{share}");
        let mut impossible = ModelBelief::certain(6, twice);
        impossible.estimate.parameters.mass = -1.0;
        assert!(controller.adopt(&impossible).is_err());
        // older than the one in use
        assert!(controller.adopt(&ModelBelief::certain(4, body)).is_err());
        assert_eq!(ask(&mut controller, 2.0 * PERIOD_S, &far, &hold).unwrap().model_revision, 5);
    }

    #[test]
    fn it_follows_the_curve_that_a_plan_describes() {
        let (body, mut controller) = (WorldPreset::Iss.body(), flown());
        let flyer = FreeFlyer::new(body);
        let mut flying = curve(0.0).state;
        let mut worst = (0.0_f64, 0.0_f64);
        for k in 0..2_000_i32 {
            let time_s = f64::from(k) * PERIOD_S;
            let command = ask(&mut controller, time_s, &flying, &curve).unwrap();
            flying = MuntheKaas4.step(&flyer, &flying, &command.wrench_body, time_s, PERIOD_S).unwrap();
            let wanted = curve(time_s + PERIOD_S).state.world_from_body;
            let turn: Vector3<f64> = LieGroup::log(&wanted.between(&flying.world_from_body).rotation);
            let away = (wanted.translation.vector - flying.world_from_body.translation.vector).norm();
            worst = (worst.0.max(away), worst.1.max(turn.norm()));
        }
        assert!(worst.0 < 0.02 && worst.1 < 0.02, "{worst:?}");
    }

    #[test]
    fn what_is_no_number_is_refused_and_no_reference_is_braking() {
        let mut controller = flown();
        let hold = Reference::Hold(Pose::identity());
        let mut moving = state([0.0; 3], [0.0; 3]);
        for time_s in [f64::NAN, f64::INFINITY, 1e10] {
            assert!(ask(&mut controller, time_s, &moving, &hold).is_err());
        }
        let command = ask(&mut controller, 0.0, &moving, &Reference::Path(Vec::new())).unwrap();
        assert_eq!(command.fallback, Some(Fallback::Braking(FallbackReason::NoReference)));
        let along =
            command.wrench_body.force.dot(&(moving.world_from_body.rotation.inverse() * moving.twist_body.linear));
        assert!(along < 0.0, "{along}");
        moving.twist_body.linear.y = f64::NAN;
        assert!(matches!(
            ask(&mut controller, 1.0, &moving, &hold),
            Err(PlanningError::NotFinite { what: "a number of the state", .. })
        ));
    }
}
