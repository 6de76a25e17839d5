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
