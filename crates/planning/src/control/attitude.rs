//! Torque that turns a body to a wanted attitude.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_dynamics::{InertialParameters, PoseReference, RigidBodyState};

/// How stiffly attitude errors are answered.
///
/// The feedback is `-stiffness vec(q_e) - damping w_e`: `q_e` turns the body from the wanted attitude to its own, with a scalar part that
/// is not negative, and `w_e` is what its angular velocity has too much. For a small angle `vec(q_e)` is half of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeGains {
    /// Torque per unit of `vec(q_e)`, N m.
    pub stiffness_n_m: f64,
    /// Torque per angular velocity, N m s.
    pub damping_n_m_s: f64,
}

impl AttitudeGains {
    /// `stiffness / damping`: the feedback is the damping times `-(w_e + corner vec(q_e))`, 1/s.
    pub fn corner_per_s(&self) -> f64 {
        self.stiffness_n_m / self.damping_n_m_s
    }
}

/// What an [`AttitudeController`] answers besides errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum AttitudeLaw {
    /// Nothing: proportional-derivative feedback alone, as flown.
    Feedback,
    /// What the believed body needs to follow the reference: `J a_d + w x J w + c x f`.
    Geometric,
}

/// Attitude feedback on the group of rotations; a pure function.
///
/// # Frame
/// Body axes; torque about the body origin.
/// # Source
/// Thesis 2.4.2 (the flown law).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeController {
    /// Which law.
    pub law: AttitudeLaw,
    /// Its feedback.
    pub gains: AttitudeGains,
    /// The body as believed; [`AttitudeLaw::Feedback`] does not use it.
    pub body: InertialParameters<f64>,
    /// Largest norm of the torque, N m.
    pub torque_limit_n_m: f64,
}

/// What an [`AttitudeController`] asks for, and why; body axes, torques about the body origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeTorque {
    /// What to apply: the sum of the other two, shortened to the limit, N m.
    pub torque_n_m: Vector3<f64>,
    /// The answer to the errors, N m.
    pub feedback_n_m: Vector3<f64>,
    /// What the reference and the force need, N m.
    pub feed_forward_n_m: Vector3<f64>,
    /// Whether the limit shortened it.
    pub is_limited: bool,
}

impl AttitudeController {
    /// The torque to apply together with a force through the body origin. Not finite where an input is not.
    ///
    /// The force counts for [`AttitudeLaw::Geometric`] only, which asks for the torque about the origin that leaves none of the force's
    /// about the believed centre of mass.
    pub fn torque_body(
        &self,
        state: &RigidBodyState<f64>,
        reference: &PoseReference,
        force_body_n: &Vector3<f64>,
    ) -> AttitudeTorque {
        let error = AttitudeError::between(state, reference);
        let feedback_n_m = -error.vector * self.gains.stiffness_n_m - error.angular_velocity * self.gains.damping_n_m_s;
        let feed_forward_n_m = match self.law {
            AttitudeLaw::Feedback => Vector3::zeros(),
            AttitudeLaw::Geometric => self.feed_forward(state, reference, &error, force_body_n),
        };
        let wanted = feedback_n_m + feed_forward_n_m;
        let norm = f64::sqrt(wanted.norm_squared());
        let is_limited = norm > self.torque_limit_n_m;
        let torque_n_m = if is_limited { wanted * (self.torque_limit_n_m / norm) } else { wanted };
        AttitudeTorque { torque_n_m, feedback_n_m, feed_forward_n_m, is_limited }
    }

    fn feed_forward(
        &self,
        state: &RigidBodyState<f64>,
        reference: &PoseReference,
        error: &AttitudeError,
        force_body_n: &Vector3<f64>,
    ) -> Vector3<f64> {
        let inertia: Matrix3<f64> = self.body.inertia_about_com();
        let angular_velocity = &state.twist_body.angular;
        let wanted_angular_velocity = angular_velocity - error.angular_velocity;
        // the wanted rate is carried into axes that themselves turn
        let acceleration = error.body_from_wanted * reference.acceleration.angular_acceleration_body
            - angular_velocity.cross(&wanted_angular_velocity);
        inertia * acceleration
            + angular_velocity.cross(&(inertia * angular_velocity))
            + self.body.center_of_mass().cross(force_body_n)
    }
}

/// How far an attitude is from the wanted one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeError {
    /// Vector part of the rotation from the wanted attitude to the actual one, its scalar part not negative; the same in both axes.
    pub vector: Vector3<f64>,
    /// Actual minus wanted angular velocity, body axes, rad/s.
    pub angular_velocity: Vector3<f64>,
    /// Takes the axes of the wanted body to those of the actual one.
    body_from_wanted: UnitQuaternion<f64>,
}

impl AttitudeError {
    /// Of a state against a reference.
    pub fn between(state: &RigidBodyState<f64>, reference: &PoseReference) -> Self {
        let body_from_wanted = state.world_from_body.rotation.inverse() * reference.state.world_from_body.rotation;
        let sign = if body_from_wanted.w < 0.0 { 1.0 } else { -1.0 };
        Self {
            vector: body_from_wanted.imag() * sign,
            angular_velocity: state.twist_body.angular - body_from_wanted * reference.state.twist_body.angular,
            body_from_wanted,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_dynamics::{BodyAcceleration, FreeFlyer};
    use tumble_lie::nalgebra::{Quaternion, Translation3};
    use tumble_lie::{Pose, Twist, Wrench};

    const GAINS: AttitudeGains = AttitudeGains { stiffness_n_m: 0.1, damping_n_m_s: 0.2 };

    fn body() -> InertialParameters<f64> {
        let inertia = Matrix3::new(0.15, 0.01, 0.02, 0.01, 0.2, -0.03, 0.02, -0.03, 0.25);
        InertialParameters::about_com(9.0, Vector3::new(0.05, -0.1, 0.02), inertia)
    }

    fn controller(law: AttitudeLaw) -> AttitudeController {
        AttitudeController { law, gains: GAINS, body: body(), torque_limit_n_m: f64::INFINITY }
    }

    fn turned(rotation: Vector3<f64>, rate: Vector3<f64>) -> RigidBodyState<f64> {
        RigidBodyState {
            world_from_body: Pose::from_parts(Translation3::new(1.0, 2.0, 3.0), UnitQuaternion::new(rotation)),
            twist_body: Twist::new(rate, Vector3::new(0.1, -0.2, 0.05)),
        }
    }

    fn reference(rotation: Vector3<f64>, rate: Vector3<f64>, acceleration: Vector3<f64>) -> PoseReference {
        let acceleration_origin_body = Vector3::new(0.01, 0.02, -0.01);
        let acceleration = BodyAcceleration { angular_acceleration_body: acceleration, acceleration_origin_body };
        PoseReference { state: turned(rotation, rate), acceleration }
    }

    fn zero() -> Vector3<f64> {
        Vector3::zeros()
    }

    #[test]
    fn the_feedback_is_the_flown_one() {
        let state = turned(Vector3::new(0.4, 0.0, 0.0), Vector3::new(0.0, 0.03, 0.0));
        let wanted = reference(Vector3::new(0.1, 0.0, 0.0), Vector3::new(0.0, 0.0, 0.02), zero());
        let found = controller(AttitudeLaw::Feedback).torque_body(&state, &wanted, &Vector3::x());
        // turned too far about x by 0.3: the wanted rate about z has parts along y and z of the body
        let rate = Vector3::new(0.0, 0.03 - 0.02 * f64::sin(0.3), -0.02 * f64::cos(0.3));
        let expected = Vector3::new(-0.1 * f64::sin(0.15), 0.0, 0.0) - rate * 0.2;
        assert!((found.torque_n_m - expected).amax() < 1e-15, "{} {expected}", found.torque_n_m);
        assert!(found.feed_forward_n_m == zero() && found.feedback_n_m == found.torque_n_m && !found.is_limited);
    }

    #[test]
    fn the_other_cover_of_an_attitude_asks_for_the_same() {
        let (mut state, wanted) =
            (turned(Vector3::new(0.4, 0.1, -0.2), zero()), reference(Vector3::x(), zero(), zero()));
        let one = controller(AttitudeLaw::Geometric).torque_body(&state, &wanted, &zero());
        let Quaternion { coords } = *state.world_from_body.rotation;
        state.world_from_body.rotation = UnitQuaternion::new_unchecked(Quaternion { coords: -coords });
        let other = controller(AttitudeLaw::Geometric).torque_body(&state, &wanted, &zero());
        assert!((one.torque_n_m - other.torque_n_m).amax() < 1e-16);
        // the shorter way round
        let far = turned(Vector3::new(3.5, 0.0, 0.0), zero());
        let back = controller(AttitudeLaw::Feedback).torque_body(&far, &reference(zero(), zero(), zero()), &zero());
        assert!((back.torque_n_m.x - 0.1 * f64::sin(1.75)).abs() < 1e-15);
    }

    #[test]
    fn the_limit_shortens_and_does_not_turn() {
        let state = turned(Vector3::new(0.4, 0.1, -0.2), Vector3::new(0.1, 0.0, -0.3));
        let wanted = reference(zero(), zero(), zero());
        let free = controller(AttitudeLaw::Geometric).torque_body(&state, &wanted, &Vector3::x());
        let limited = AttitudeController { torque_limit_n_m: 0.015, ..controller(AttitudeLaw::Geometric) };
        let found = limited.torque_body(&state, &wanted, &Vector3::x());
        assert!(found.is_limited && (found.torque_n_m.norm() - 0.015).abs() < 1e-17);
        assert!(
            found.torque_n_m.cross(&free.torque_n_m).amax() < 1e-17 && found.torque_n_m.dot(&free.torque_n_m) > 0.0
        );
    }

    #[test]
    fn at_the_reference_it_asks_for_the_inverse_dynamics_about_the_origin() {
        let wanted =
            reference(Vector3::new(0.3, -0.8, 0.5), Vector3::new(0.2, 0.1, -0.3), Vector3::new(0.01, 0.02, -0.03));
        let wrench = FreeFlyer::new(body()).inverse(&wanted.state.twist_body, &wanted.acceleration);
        let found = controller(AttitudeLaw::Geometric).torque_body(&wanted.state, &wanted, &wrench.force);
        assert!((found.torque_n_m - wrench.torque).amax() < 1e-16, "{} {}", found.torque_n_m, wrench.torque);
    }

    #[test]
    fn a_force_through_the_origin_turns_nothing() {
        let state = turned(zero(), zero());
        let force = Vector3::new(0.3, -0.1, 0.2);
        let torque = controller(AttitudeLaw::Geometric).torque_body(&state, &reference(zero(), zero(), zero()), &force);
        let push = Wrench::new(torque.torque_n_m, force);
        assert!(FreeFlyer::new(body()).forward(&state.twist_body, &push).angular_acceleration_body.amax() < 1e-16);
        let bare = Wrench::new(zero(), force);
        assert!(FreeFlyer::new(body()).forward(&state.twist_body, &bare).angular_acceleration_body.amax() > 0.1);
    }

    /// Off the reference, without feedback, the error of the rate stays as it is: by finite differences of both motions.
    #[test]
    fn feed_forward_keeps_the_error_of_the_rate_of_the_true_body() {
        let gains = AttitudeGains { stiffness_n_m: 0.0, damping_n_m_s: 0.0 };
        let controller = AttitudeController { gains, ..controller(AttitudeLaw::Geometric) };
        let (rate, acceleration) = (Vector3::new(0.3, 0.2, -0.4), Vector3::new(0.05, -0.02, 0.04));
        let wanted = reference(Vector3::new(0.3, -0.8, 0.5), rate, acceleration);
        let state = turned(Vector3::new(0.7, -0.1, 0.9), Vector3::new(-0.2, 0.5, 0.1));
        let force = Vector3::new(0.3, -0.1, 0.2);
        let torque = controller.torque_body(&state, &wanted, &force).torque_n_m;
        let moved = FreeFlyer::new(body()).forward(&state.twist_body, &Wrench::new(torque, force));
        let error_after = |time_s: f64| {
            let after = |state: &RigidBodyState<f64>, acceleration: Vector3<f64>| {
                let mean = state.twist_body.angular + acceleration * (0.5 * time_s);
                let rotation = state.world_from_body.rotation * UnitQuaternion::new(mean * time_s);
                let mut after = *state;
                after.world_from_body.rotation = rotation;
                after.twist_body.angular += acceleration * time_s;
                after
            };
            let mut later = wanted;
            later.state = after(&wanted.state, acceleration);
            AttitudeError::between(&after(&state, moved.angular_acceleration_body), &later).angular_velocity
        };
        let slope = (error_after(1e-4) - error_after(-1e-4)) / 2e-4;
        assert!(slope.amax() < 1e-7, "{slope}");
    }
}
