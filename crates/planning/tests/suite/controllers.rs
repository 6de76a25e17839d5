//! What the simple controllers do, held against other ways to say it.
#![allow(clippy::float_cmp, reason = "the same operations give the same bits")]

use crate::control_cases::{at, belief, body, heavier, held, limits};
use tumble_planning::control::{
    Adoption, AttitudeController, AttitudeGains, AttitudeLaw, Cascade, ControlRequest, Controller, LqrController,
    OriginalDisturbance, OriginalErrors, OriginalSettings, OriginalTubeController, OriginalWeights, PoseTracking,
    ReferenceMotion, TranslationDecision, TranslationLaw, TranslationRequest, TranslationWeights, original_disturbance,
};
use tumble_planning::dynamics::{BodyAcceleration, FreeFlyer, PoseReference, PoseTracker, RigidBodyState, WrenchBox};
use tumble_planning::lie::{Pose, Twist};
use tumble_planning::nalgebra::{UnitQuaternion, Vector3};
use tumble_planning::{ModelBelief, Plan, PlanningError};

fn attitude(law: AttitudeLaw) -> AttitudeController {
    let gains = AttitudeGains { stiffness_n_m: 0.3, damping_n_m_s: 0.3 };
    AttitudeController { law, gains, body: body(), torque_limit_n_m: 0.05 }
}

/// Turning about an inclined axis at a growing rate, on a parabola through the origin at time zero.
fn turning(time_s: f64) -> PoseReference {
    let (axis, acceleration_world) = (Vector3::new(0.6, 0.0, 0.8), Vector3::new(0.004, -0.006, 0.003));
    let attitude = UnitQuaternion::new(axis * (0.08 * time_s + 0.01 * time_s * time_s));
    let velocity = acceleration_world * time_s;
    let body = |world: Vector3<f64>| attitude.inverse() * world;
    PoseReference {
        state: RigidBodyState {
            world_from_body: Pose::from_parts((velocity * (0.5 * time_s)).into(), attitude),
            twist_body: Twist::new(axis * (0.08 + 0.02 * time_s), body(velocity)),
        },
        acceleration: BodyAcceleration {
            angular_acceleration_body: axis * 0.02,
            acceleration_origin_body: body(acceleration_world),
        },
    }
}

#[test]
fn pose_tracking_is_the_tracker_of_the_believed_body_cut_at_the_limits() {
    let tracker = PoseTracker::critically_damped(FreeFlyer::new(body()), 1.0, 0.6);
    let mut controller = PoseTracking::try_new(tracker, limits()).unwrap();
    let hold = held(Pose::identity());
    let plan = Plan { trajectory: &hold as &dyn ReferenceMotion, model_revision: 0 };
    let near = at(Pose::translation(0.01, -0.02, 0.03));
    let far = at(Pose::translation(5.0, -0.02, -7.0));
    let request = |state| ControlRequest { time_s: 0.0, state, plan: &plan };
    let command = controller.command(&request(&near)).unwrap();
    assert_eq!(command.wrench_body, tracker.wrench_body(&near, &hold(0.0)));
    assert_eq!((command.model_revision, command.fallback), (0, None));
    let cut = controller.command(&request(&far)).unwrap().wrench_body.force;
    assert_eq!([cut.x, cut.z], [-limits().force_limit.x, limits().force_limit.z]);
    assert!(PoseTracking::unlimited(tracker).unwrap().command(&request(&far)).unwrap().wrench_body.force.x < -10.0);

    assert_eq!(controller.adopt(&belief(3, heavier(2.0), 1.0)).unwrap(), Adoption::Adopted);
    let command = controller.command(&request(&near)).unwrap();
    let heavy = PoseTracker { body: FreeFlyer::new(heavier(2.0)), ..tracker };
    assert_eq!((command.wrench_body, command.model_revision), (heavy.wrench_body(&near, &hold(0.0)), 3));
    let late = controller.adopt(&belief(2, body(), 1.0));
    assert!(matches!(late, Err(PlanningError::OutOfRange { lower: 3.0, .. })), "{late:?}");
    assert_eq!(controller.command(&request(&near)).unwrap().model_revision, 3);
}

#[test]
fn limits_and_gains_that_cannot_be_are_refused() {
    let tracker = PoseTracker::critically_damped(FreeFlyer::new(body()), 1.0, 0.6);
    for value in [0.0, -1.0, f64::NAN] {
        let force_limit = Vector3::new(1.0, value, 1.0);
        assert!(PoseTracking::try_new(tracker, WrenchBox { force_limit, ..limits() }).is_err(), "{value}");
        assert!(
            Cascade::try_new(Counter::default(), attitude(AttitudeLaw::Geometric), force_limit).is_err(),
            "{value}"
        );
    }
    assert!(PoseTracking::unlimited(PoseTracker { position_damping: -0.1, ..tracker }).is_err());
    let mut impossible = body();
    impossible.mass = 0.0;
    assert!(PoseTracking::unlimited(PoseTracker { body: FreeFlyer::new(impossible), ..tracker }).is_err());
    let nobody = AttitudeController { body: impossible, ..attitude(AttitudeLaw::Geometric) };
    assert!(Cascade::try_new(Counter::default(), nobody, Vector3::repeat(1.0)).is_err());
}

/// A law that counts its decisions: the n-th is a force of n hundredths of a newton along the world's x axis.
#[derive(Default)]
struct Counter {
    decisions: u32,
    masses: Vec<f64>,
}

impl TranslationLaw for Counter {
    fn step_s(&self) -> f64 {
        0.2
    }
    fn decide(&mut self, request: &TranslationRequest<'_>) -> Result<TranslationDecision, PlanningError> {
        self.decisions += 1;
        self.masses.push(request.body.parameters().mass);
        let force_world = Vector3::x() * (0.01 * f64::from(self.decisions));
        Ok(TranslationDecision { force_world, fallback: None })
    }
}

#[test]
fn a_decision_is_held_along_world_axes_and_made_on_its_grid() {
    let mut controller =
        Cascade::try_new(Counter::default(), attitude(AttitudeLaw::Feedback), Vector3::repeat(1.0)).unwrap();
    let hold = held(Pose::identity());
    let plan = Plan { trajectory: &hold as &dyn ReferenceMotion, model_revision: 0 };
    // 62.5 outputs in a second do not fit five decisions
    for output in 0..500_u32 {
        let time_s = 3.0 + 0.016 * f64::from(output);
        let attitude = UnitQuaternion::new(Vector3::new(0.3, -0.2, 0.5) * (0.1 * f64::from(output)));
        let state = at(Pose::from_parts(Vector3::zeros().into(), attitude));
        let command = controller.command(&ControlRequest { time_s, state: &state, plan: &plan }).unwrap();
        let force_world = attitude * command.wrench_body.force;
        let due = output * 16 / 200 + 1;
        assert!((force_world - Vector3::x() * (0.01 * f64::from(due))).amax() < 1e-15, "{output}");
    }
    assert_eq!(controller.law().decisions, 40);
    // a belief is decided with at once; the clock that goes back begins a new grid
    let ask = |controller: &mut Cascade<Counter>, time_s| {
        controller.command(&ControlRequest { time_s, state: &at(Pose::identity()), plan: &plan }).unwrap();
        controller.law().decisions
    };
    assert_eq!(ask(&mut controller, 11.0 - 0.001), 40);
    controller.adopt(&belief(1, heavier(2.0), 1.0)).unwrap();
    assert_eq!(ask(&mut controller, 11.0 - 0.0005), 41);
    assert_eq!(controller.law().masses.last(), Some(&(2.0 * body().mass)));
    assert_eq!([ask(&mut controller, 11.1), ask(&mut controller, 5.0), ask(&mut controller, 5.1)], [41, 42, 42]);
    assert_eq!([ask(&mut controller, 5.2), ask(&mut controller, 9.0), ask(&mut controller, 9.19)], [43, 44, 44]);
}

#[test]
fn on_its_reference_the_cascade_asks_for_the_inverse_dynamics() {
    let weights = TranslationWeights::default();
    let cascade = LqrController::lqr(0.2, &weights, attitude(AttitudeLaw::Geometric), limits().force_limit);
    let mut controller = cascade.unwrap();
    let plan = Plan { trajectory: &turning as &dyn ReferenceMotion, model_revision: 0 };
    let reference = turning(0.7);
    let command = controller.command(&ControlRequest { time_s: 0.7, state: &reference.state, plan: &plan }).unwrap();
    let expected = FreeFlyer::new(body()).inverse(&reference.state.twist_body, &reference.acceleration);
    let apart = (command.wrench_body - expected).to_vector().amax();
    assert!(apart < 1e-14 && expected.force.amax() > 0.05 && expected.torque.amax() > 1e-3, "{apart:e} {expected:?}");
}

#[test]
fn the_original_learns_its_set_and_never_its_mass() {
    let ask = |disturbance, beliefs: &[ModelBelief]| {
        let weights = OriginalWeights::PERMISSIVE;
        let settings = OriginalSettings { weights, disturbance, ..OriginalSettings::default() };
        let mut controller = OriginalTubeController::original(&settings, body()).unwrap();
        for belief in beliefs {
            controller.adopt(belief).unwrap();
        }
        let hold = held(Pose::identity());
        let plan = Plan { trajectory: &hold as &dyn ReferenceMotion, model_revision: 0 };
        let off = at(Pose::translation(-0.05, 0.0, 0.02));
        let command = controller.command(&ControlRequest { time_s: 0.0, state: &off, plan: &plan }).unwrap();
        (command.wrench_body, controller.law().errors().clone())
    };
    let heavy = [belief(1, heavier(1.2), 1.0)];
    assert_eq!(ask(OriginalDisturbance::Stored, &heavy), ask(OriginalDisturbance::Stored, &[]));
    let (before, stored) = ask(OriginalDisturbance::OfBelief, &[]);
    let (after, learnt) = ask(OriginalDisturbance::OfBelief, &heavy);
    let disturbance = original_disturbance(1.2 * 9.5, 1.0, 0.15).unwrap();
    let expected = OriginalErrors::of_box(1.2 * 9.5, OriginalWeights::PERMISSIVE.ancillary, disturbance, 0.15).unwrap();
    assert_eq!(learnt, expected);
    assert!(stored.is_stored && !learnt.is_stored && after != before);
}
