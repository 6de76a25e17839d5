//! Flights that every controller here is asked for.

use tumble_planning::control::ReferenceMotion;
use tumble_planning::dynamics::{
    BodyAcceleration, ConstantWorldWrench, InertialParameters, PoseReference, RigidBodyState, WrenchBox,
};
use tumble_planning::laws::{ControllerCase, TrackingError};
use tumble_planning::lie::{Pose, Twist, Wrench};
use tumble_planning::nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};
use tumble_planning::{ModelBelief, Plan};

/// A body whose centre of mass is beside its origin.
pub fn body() -> InertialParameters<f64> {
    let inertia = Matrix3::new(0.15, 0.01, 0.0, 0.01, 0.12, 0.005, 0.0, 0.005, 0.17);
    InertialParameters::about_com(9.5, Vector3::new(0.02, -0.03, 0.01), inertia)
}

pub fn heavier(factor: f64) -> InertialParameters<f64> {
    let body = body();
    InertialParameters {
        mass: factor * body.mass,
        first_moment: body.first_moment * factor,
        inertia_about_origin: body.inertia_about_origin * factor,
    }
}

pub fn belief(revision: u64, body: InertialParameters<f64>, sigma_kg: f64) -> ModelBelief {
    let mut belief = ModelBelief::certain(revision, body);
    belief.estimate.covariance = SMatrix::identity() * 1e-6;
    belief.estimate.covariance[(0, 0)] = sigma_kg * sigma_kg;
    belief
}

pub fn limits() -> WrenchBox {
    WrenchBox { torque_limit: Vector3::new(0.05, 0.06, 0.05), force_limit: Vector3::new(0.3, 0.25, 0.4) }
}

/// Errors at which no limit is felt.
pub fn small() -> TrackingError {
    TrackingError { position_m: 0.02, speed_m_s: f64::INFINITY, angle_rad: 0.05, rate_rad_s: f64::INFINITY }
}

/// A pose held for ever.
pub fn held(world_from_body: Pose<f64>) -> impl Fn(f64) -> PoseReference {
    move |_| PoseReference {
        state: RigidBodyState { world_from_body, twist_body: Twist::zero() },
        acceleration: BodyAcceleration {
            angular_acceleration_body: Vector3::zeros(),
            acceleration_origin_body: Vector3::zeros(),
        },
    }
}

/// From rest to rest in `duration_s` by the polynomial of degree five, turning by `turn_rad` about the vertical meanwhile.
pub fn quintic(from: Vector3<f64>, to: Vector3<f64>, turn_rad: f64, duration_s: f64) -> impl Fn(f64) -> PoseReference {
    move |time_s: f64| {
        let x = (time_s / duration_s).clamp(0.0, 1.0);
        let share = x * x * x * (10.0 + x * (6.0 * x - 15.0));
        let rate = 30.0 * x * x * (1.0 - x) * (1.0 - x) / duration_s;
        let bend = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / (duration_s * duration_s);
        let axis = Vector3::z();
        let attitude = UnitQuaternion::new(axis * (turn_rad * share));
        let body = |world: Vector3<f64>| attitude.inverse() * world;
        PoseReference {
            state: RigidBodyState {
                world_from_body: Pose::from_parts((from + (to - from) * share).into(), attitude),
                twist_body: Twist::new(axis * (turn_rad * rate), body((to - from) * rate)),
            },
            acceleration: BodyAcceleration {
                angular_acceleration_body: axis * (turn_rad * bend),
                acceleration_origin_body: body((to - from) * bend),
            },
        }
    }
}

pub fn at(world_from_body: Pose<f64>) -> RigidBodyState<f64> {
    RigidBodyState { world_from_body, twist_body: Twist::zero() }
}

/// Nothing but what the laws ask of themselves: a pose held, upright, the body known.
pub fn case<'a>(name: &'static str, trajectory: &'a dyn ReferenceMotion) -> ControllerCase<'a> {
    ControllerCase {
        name,
        body: body(),
        start: trajectory.at(0.0).state,
        start_s: 0.0,
        plan: Plan { trajectory, model_revision: 0 },
        beliefs: &[],
        disturbance: &(),
        sensor: None,
        outputs: 200,
        step_s: 0.1,
        followed: None,
        is_promised: false,
    }
}

/// A plan followed by the body that is believed in; one that comes back from far away while beliefs change; one pushed about,
/// seen through a sensor that errs, at outputs that do not fit the steps of decisions. `slack` widens the bounds of errors.
pub fn cases(slack: f64, judge: &mut dyn FnMut(&[ControllerCase<'_>])) {
    let bound = |position_m: f64, angle_rad: f64| TrackingError {
        position_m: slack * position_m,
        angle_rad: slack * angle_rad,
        ..small()
    };
    let plan = quintic(Vector3::new(1.0, -2.0, 0.5), Vector3::new(1.6, -2.4, 0.8), 1.2, 20.0);
    let known = [(0.0, belief(4, body(), 0.1))];
    let mut follows = case("follows", &plan);
    (follows.beliefs, follows.outputs, follows.step_s) = (&known, 1500, 0.016);
    follows.followed = Some((0.0, bound(0.004, 0.01)));

    let pose = Pose::new(Vector3::new(0.4, 0.1, -0.3), Vector3::new(0.3, -0.8, 0.5));
    let hold = held(pose);
    let learnt =
        [(5.0, belief(1, heavier(1.6), 2.0)), (9.0, belief(2, heavier(0.7), 1.0)), (13.0, belief(5, body(), 0.2))];
    let mut far = case("far", &hold);
    (far.start_s, far.beliefs, far.outputs) = (5.0, &learnt, 900);
    far.start.world_from_body = Pose::new(Vector3::new(2.4, -0.9, 0.3), Vector3::new(-0.9, 0.4, 1.0));
    far.followed = Some((70.0, bound(0.005, 0.01)));

    let push = ConstantWorldWrench { wrench_world: Wrench::new(Vector3::zeros(), Vector3::new(0.004, -0.003, 0.002)) };
    let noise = |output: usize, state: &RigidBodyState<f64>| {
        let sign = if output.is_multiple_of(3) { 1.0 } else { -0.5 };
        let mut seen = *state;
        seen.world_from_body.translation.vector.x += 0.001 * sign;
        seen.twist_body.linear.y -= 0.001 * sign;
        seen.twist_body.angular.z += 0.001 * sign;
        seen
    };
    let wrong = [(0.0, belief(7, heavier(1.3), 1.0))];
    let mut pushed = case("pushed", &plan);
    (pushed.beliefs, pushed.disturbance) = (&wrong, &push);
    pushed.sensor = Some(&noise);
    (pushed.step_s, pushed.outputs) = (0.07, 400);
    pushed.followed = Some((0.0, bound(0.1, 0.1)));
    judge(&[follows, far, pushed]);
}
