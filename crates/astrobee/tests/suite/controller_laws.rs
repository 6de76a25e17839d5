//! The laws of controllers for the cascade that NASA's robots fly.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use tumble_astrobee::flight_controller::{FORCE_LIMIT_N, FlightController};
use tumble_astrobee::flight_modes::ControlGains;
use tumble_astrobee::simulator::{FlownController, Reference, Waypoint};
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::nalgebra::{SMatrix, Vector3};
use tumble_dynamics::{ConstantWorldWrench, InertialParameters, RigidBodyState, WrenchBox};
use tumble_lie::{Pose, Twist, Wrench};
use tumble_planning::control::ReferenceMotion;
use tumble_planning::laws::{ControllerCase, ControllerPromise, TrackingError, check_controller, other_worlds};
use tumble_planning::{ModelBelief, Plan};

const PLACE: WorldPreset = WorldPreset::Iss;

fn heavier(factor: f64) -> InertialParameters<f64> {
    let body = PLACE.body();
    InertialParameters::about_com(factor * body.mass, body.center_of_mass(), body.inertia_about_com() * factor)
}

fn belief(revision: u64, factor: f64) -> ModelBelief {
    let mut belief = ModelBelief::certain(revision, heavier(factor));
    belief.estimate.covariance = SMatrix::identity() * 1e-4;
    belief
}

fn at(world_from_body: Pose<f64>) -> RigidBodyState<f64> {
    RigidBodyState { world_from_body, twist_body: Twist::zero() }
}

fn case<'a>(name: &'static str, trajectory: &'a dyn ReferenceMotion, outputs: usize) -> ControllerCase<'a> {
    ControllerCase {
        name,
        body: PLACE.body(),
        start: trajectory.at(0.0).state,
        start_s: 0.0,
        plan: Plan { trajectory, model_revision: 0 },
        beliefs: &[],
        disturbance: &(),
        sensor: None,
        outputs,
        step_s: 0.016,
        followed: None,
        is_promised: false,
    }
}

/// One leg followed with a body that is known; a pose reached from afar while beliefs change; one held against a push, seen through
/// a sensor that errs.
#[test]
fn the_flown_cascade() {
    let bound = |position_m, angle_rad| TrackingError {
        position_m,
        angle_rad,
        speed_m_s: f64::INFINITY,
        rate_rad_s: f64::INFINITY,
    };
    let start = PLACE.pose("A").unwrap();
    let end = Pose::from_parts(
        (start.translation.vector + Vector3::new(0.4, 0.5, -0.1)).into(),
        start.rotation * Pose::<f64>::new(Vector3::zeros(), Vector3::new(0.2, -0.1, 0.9)).rotation,
    );
    let way = Reference::Path(vec![
        Waypoint { time_s: 0.0, world_from_body: start },
        Waypoint { time_s: 20.0, world_from_body: end },
    ]);
    let known = [(0.0, belief(3, 1.0))];
    let mut follows = case("follows", &way, 1500);
    follows.beliefs = &known;
    follows.followed = Some((0.0, bound(0.005, 0.01)));

    let hold = Reference::Hold(end);
    let learnt = [(2.0, belief(1, 1.6)), (5.0, belief(2, 0.7)), (9.0, belief(7, 1.0))];
    let mut far = case("far", &hold, 2500);
    (far.start_s, far.beliefs) = (2.0, &learnt);
    far.start = at(start);
    far.followed = Some((35.0, bound(0.002, 0.005)));

    let push = ConstantWorldWrench { wrench_world: Wrench::new(Vector3::zeros(), Vector3::new(0.004, -0.003, 0.002)) };
    let noise = |output: usize, state: &RigidBodyState<f64>| {
        let sign = if output.is_multiple_of(3) { 1.0 } else { -0.5 };
        let mut seen = *state;
        seen.world_from_body.translation.vector.x += 0.001 * sign;
        seen.twist_body.linear.y -= 0.001 * sign;
        seen.twist_body.angular.z += 0.001 * sign;
        seen
    };
    let mut pushed = case("pushed", &hold, 800);
    pushed.disturbance = &push;
    pushed.sensor = Some(&noise);
    pushed.followed = Some((0.0, bound(0.01, 0.05)));

    let worlds = other_worlds();
    let promise = ControllerPromise {
        limits: WrenchBox { torque_limit: Vector3::repeat(f64::INFINITY), force_limit: Vector3::repeat(FORCE_LIMIT_N) },
        tube: None,
        small: bound(0.02, 0.05),
        settling_s: 15.0,
        overshoot: 1.01,
        other_worlds: &worlds,
        tolerance: 1e-9,
    };
    let new = || FlownController::new(FlightController::new(PLACE.body(), ControlGains::of(PLACE.site())));
    check_controller(&new, &[follows, far, pushed], &promise).unwrap_or_else(|violation| panic!("{violation}"));
}
