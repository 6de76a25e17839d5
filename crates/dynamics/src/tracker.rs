//! Following a reference pose with a fixed model (`f64`: a decision).

use crate::free_flyer::{BodyAcceleration, FreeFlyer};
use crate::state::RigidBodyState;
use tumble_lie::{LieGroup, Wrench};

/// Where the body should be, and how it should move, at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseReference {
    /// Wanted pose and twist, in the axes of the wanted body frame.
    pub state: RigidBodyState<f64>,
    /// Wanted acceleration, in the axes of the wanted body frame.
    pub acceleration: BodyAcceleration<f64>,
}

/// Proportional-derivative tracking with feed-forward of a nominal body; no belief, no limits.
///
/// The error of the body obeys `e'' + damping e' + stiffness e = 0` when the nominal body is the true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseTracker {
    /// Nominal body.
    pub body: FreeFlyer<f64>,
    /// Angular acceleration per rotation error, 1/s^2.
    pub rotation_stiffness: f64,
    /// Angular acceleration per angular velocity error, 1/s.
    pub rotation_damping: f64,
    /// Acceleration per position error, 1/s^2.
    pub position_stiffness: f64,
    /// Acceleration per velocity error, 1/s.
    pub position_damping: f64,
}

impl PoseTracker {
    /// Critically damped with the given natural frequencies of rotation and position, rad/s.
    pub fn critically_damped(body: FreeFlyer<f64>, rotation_rad_s: f64, position_rad_s: f64) -> Self {
        Self {
            body,
            rotation_stiffness: rotation_rad_s * rotation_rad_s,
            rotation_damping: 2.0 * rotation_rad_s,
            position_stiffness: position_rad_s * position_rad_s,
            position_damping: 2.0 * position_rad_s,
        }
    }

    /// The wrench to ask for, body axes, torque about the body origin.
    pub fn wrench_body(&self, state: &RigidBodyState<f64>, reference: &PoseReference) -> Wrench<f64> {
        let body_from_world = state.world_from_body.rotation.inverse();
        let body_from_wanted = body_from_world * reference.state.world_from_body.rotation;
        let wanted_angular_velocity = body_from_wanted * reference.state.twist_body.angular;
        let angular_velocity = &state.twist_body.angular;
        let rotation_error = LieGroup::log(&body_from_wanted);
        let position_error = body_from_world
            * (reference.state.world_from_body.translation.vector - state.world_from_body.translation.vector);
        let velocity_error = body_from_wanted * reference.state.twist_body.linear - state.twist_body.linear;
        // the wanted rate is carried into axes that themselves turn
        let angular_acceleration_body = body_from_wanted * reference.acceleration.angular_acceleration_body
            - angular_velocity.cross(&wanted_angular_velocity)
            + rotation_error * self.rotation_stiffness
            + (wanted_angular_velocity - angular_velocity) * self.rotation_damping;
        let acceleration_origin_body = body_from_wanted * reference.acceleration.acceleration_origin_body
            + position_error * self.position_stiffness
            + velocity_error * self.position_damping;
        let acceleration = BodyAcceleration { angular_acceleration_body, acceleration_origin_body };
        self.body.inverse(&state.twist_body, &acceleration)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{InertialParameters, Integrator, MuntheKaas4};
    use tumble_lie::nalgebra::{Matrix3, Translation3, UnitQuaternion, Vector3};
    use tumble_lie::{Pose, Twist};

    fn body() -> FreeFlyer<f64> {
        let inertia = Matrix3::new(1.5, 0.1, 0.2, 0.1, 2.0, 0.3, 0.2, 0.3, 3.0);
        FreeFlyer::new(InertialParameters::about_origin(5.0, Vector3::new(0.05, 0.1, 0.05), inertia))
    }

    /// A circle of 2 m flown while turning about an inclined axis at a rate that swells.
    fn reference(time_s: f64) -> PoseReference {
        let (axis, rate) = (Vector3::new(0.6, 0.0, 0.8), 0.3);
        let angle = 0.4 * time_s + 0.2 * time_s.sin();
        let rotation = UnitQuaternion::new(axis * angle);
        let (s, c) = (rate * time_s).sin_cos();
        let world = |v: Vector3<f64>| rotation.inverse() * v;
        PoseReference {
            state: RigidBodyState {
                world_from_body: Pose::from_parts(Translation3::new(2.0 * c, 2.0 * s, 0.0), rotation),
                twist_body: Twist::new(
                    axis * (0.4 + 0.2 * time_s.cos()),
                    world(Vector3::new(-s, c, 0.0) * (2.0 * rate)),
                ),
            },
            acceleration: BodyAcceleration {
                angular_acceleration_body: axis * (-0.2 * time_s.sin()),
                acceleration_origin_body: world(Vector3::new(-c, -s, 0.0) * (2.0 * rate * rate)),
            },
        }
    }

    /// Largest pose error (rad, m) over the second half of ten seconds, wrench held over steps.
    fn late_error(tracker: &PoseTracker, start: RigidBodyState<f64>, step_s: f64) -> f64 {
        let (mut state, mut worst) = (start, 0.0_f64);
        let steps = (10.0 / step_s).round();
        let mut step = 0.0;
        while step < steps {
            let wrench = tracker.wrench_body(&state, &reference(step * step_s));
            state = MuntheKaas4.step(&body(), &state, &wrench, 0.0, step_s).unwrap();
            step += 1.0;
            if step > 0.5 * steps {
                let wanted = reference(step * step_s).state.world_from_body;
                worst = worst.max(LieGroup::log(&wanted.between(&state.world_from_body)).amax());
            }
        }
        worst
    }

    #[test]
    fn feed_forward_of_the_true_body_leaves_only_the_error_of_holding() {
        let tracker = PoseTracker::critically_damped(body(), 2.0, 2.0);
        let start = reference(0.0).state;
        let (coarse, fine) = (late_error(&tracker, start, 0.02), late_error(&tracker, start, 0.01));
        assert!(fine < 5e-3 && (1.7..2.3).contains(&(coarse / fine)), "{coarse} {fine}");
    }

    #[test]
    fn comes_back_from_half_a_turn_and_metres_away() {
        let tracker = PoseTracker::critically_damped(body(), 3.0, 3.0);
        let turned = UnitQuaternion::new(Vector3::new(-1.9, 1.6, 1.2));
        let start = RigidBodyState {
            world_from_body: Pose::from_parts(Translation3::new(-3.0, 1.0, 4.0), turned),
            twist_body: Twist::new(Vector3::new(0.5, -1.0, 0.3), Vector3::new(0.2, 0.4, -0.6)),
        };
        let on_track = late_error(&tracker, reference(0.0).state, 0.01);
        assert!(late_error(&tracker, start, 0.01) < on_track + 1e-3);
    }

    #[test]
    fn at_the_reference_it_asks_for_the_inverse_dynamics() {
        let tracker = PoseTracker::critically_damped(body(), 1.0, 1.0);
        let reference = reference(1.3);
        let expected = body().inverse(&reference.state.twist_body, &reference.acceleration);
        let found = tracker.wrench_body(&reference.state, &reference);
        assert!((found - expected).to_vector().amax() < 1e-14);
    }
}
