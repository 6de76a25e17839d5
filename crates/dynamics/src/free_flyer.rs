//! One free rigid body: Newton-Euler, forward and inverse, about an arbitrary body point.

use crate::error::DynamicsError;
use crate::inertia::InertialParameters;
use crate::state::RigidBodyState;
use crate::system::{MechanicalSystem, RigidBody, WrenchModel};
use tumble_lie::nalgebra::{ComplexField, Matrix3, SVector, Vector3};
use tumble_lie::{Scalar, Twist, Wrench};

/// Second-order motion of a body: what an ideal gyroscope differentiates and an ideal accelerometer reads.
///
/// The linear half is the *inertial* acceleration of the origin; the component rate of the body-axes velocity
/// (`twist_rate_body`) differs from it by `omega x v`.
/// # Frame
/// Body axes.
/// # Units
/// rad/s^2, m/s^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyAcceleration<T: Scalar> {
    /// Rate of the angular velocity, rad/s^2.
    pub angular_acceleration_body: Vector3<T>,
    /// Inertial acceleration of the body origin resolved in body axes, `R^T d2l/dt2`, m/s^2.
    pub acceleration_origin_body: Vector3<T>,
}

impl<T: Scalar> BodyAcceleration<T> {
    /// From the component rate of `twist_body`.
    #[inline]
    pub fn from_twist_rate_body(twist_body: &Twist<T>, twist_rate_body: &Twist<T>) -> Self {
        Self {
            angular_acceleration_body: twist_rate_body.angular,
            acceleration_origin_body: twist_rate_body.linear + twist_body.angular.cross(&twist_body.linear),
        }
    }

    /// The component rate of `twist_body`: what a state vector integrates.
    #[inline]
    pub fn twist_rate_body(&self, twist_body: &Twist<T>) -> Twist<T> {
        Twist::new(
            self.angular_acceleration_body,
            self.acceleration_origin_body - twist_body.angular.cross(&twist_body.linear),
        )
    }
}

/// A free rigid body moved by a wrench about its body origin.
///
/// ```
/// use tumble_dynamics::{FreeFlyer, InertialParameters, lie::{Twist, Wrench}, nalgebra::{Matrix3, Vector3}};
/// let cube = InertialParameters::<f64>::about_com(2.0, Vector3::new(0.1, 0.0, 0.0), Matrix3::identity() * 0.5);
/// let push = Wrench::new(Vector3::zeros(), Vector3::new(0.0, 1.0, 0.0)); // at the origin, beside the centre of mass
/// let acceleration = FreeFlyer::new(cube).forward(&Twist::zero(), &push);
/// assert!((acceleration.angular_acceleration_body.z + 0.2).abs() < 1e-15);
/// assert!((acceleration.acceleration_origin_body.y - 0.52).abs() < 1e-15);
/// ```
/// # Frame
/// Everything in body axes, torque about the body origin, which need not be the centre of mass.
/// # Source
/// Thesis (2.4), (4.1).
/// # Deviation
/// The text after (2.7) calls `[w'; v']` the velocity of the generalised coordinates; it is their acceleration, and `v'`
/// is the inertial acceleration of the origin in body axes (`tests/suite/planted_defects_bodies.rs`,
/// `defects_of_inverse_dynamics_are_caught_by_name`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeFlyer<T: Scalar> {
    parameters: InertialParameters<T>,
    center_of_mass: Vector3<T>,
    mass_inverse: T,
    inertia_about_com: Matrix3<T>,
    inertia_about_com_inverse: Matrix3<T>,
}

impl<T: Scalar> FreeFlyer<T> {
    /// The body with these parameters; prepares what every forward step needs.
    ///
    /// A body without inertia (a point, a rod) can be made and inverted, but `forward` has no finite value for it.
    pub fn new(parameters: InertialParameters<T>) -> Self {
        let inertia_about_com = parameters.inertia_about_com();
        Self {
            parameters,
            center_of_mass: parameters.center_of_mass(),
            mass_inverse: T::one() / parameters.mass,
            inertia_about_com,
            inertia_about_com_inverse: inverse_of_symmetric(&inertia_about_com),
        }
    }

    /// The ten parameters.
    #[inline]
    pub fn parameters(&self) -> &InertialParameters<T> {
        &self.parameters
    }

    /// Wrench that gives this acceleration.
    ///
    /// # Source
    /// Thesis (4.1): `tau = J w' + w x J w + h x a`, `f = m a + w' x h + w x (w x h)`.
    #[inline]
    pub fn inverse(&self, twist_body: &Twist<T>, acceleration: &BodyAcceleration<T>) -> Wrench<T> {
        let InertialParameters { mass, first_moment, inertia_about_origin } = &self.parameters;
        let (w, a) = (&twist_body.angular, &acceleration.acceleration_origin_body);
        let w_rate = &acceleration.angular_acceleration_body;
        Wrench::new(
            inertia_about_origin * w_rate + w.cross(&(inertia_about_origin * w)) + first_moment.cross(a),
            a * *mass + w_rate.cross(first_moment) + w.cross(&w.cross(first_moment)),
        )
    }

    /// Acceleration that this wrench gives.
    ///
    /// Solved about the centre of mass, where rotation and translation separate.
    #[inline]
    pub fn forward(&self, twist_body: &Twist<T>, wrench_body: &Wrench<T>) -> BodyAcceleration<T> {
        let (w, c) = (&twist_body.angular, &self.center_of_mass);
        let torque_about_com = wrench_body.torque - c.cross(&wrench_body.force);
        let w_rate = self.inertia_about_com_inverse * (torque_about_com - w.cross(&(self.inertia_about_com * w)));
        BodyAcceleration {
            angular_acceleration_body: w_rate,
            acceleration_origin_body: wrench_body.force * self.mass_inverse - w_rate.cross(c) - w.cross(&w.cross(c)),
        }
    }
}

/// Adjugate over determinant of a symmetric 3x3 matrix; not finite where it is singular.
#[inline]
pub(crate) fn inverse_of_symmetric<T: Scalar>(m: &Matrix3<T>) -> Matrix3<T> {
    let (a11, a12, a13) = (m.m22 * m.m33 - m.m23 * m.m23, m.m13 * m.m23 - m.m12 * m.m33, m.m12 * m.m23 - m.m13 * m.m22);
    let (a22, a23, a33) = (m.m11 * m.m33 - m.m13 * m.m13, m.m12 * m.m13 - m.m11 * m.m23, m.m11 * m.m22 - m.m12 * m.m12);
    let determinant = m.m11 * a11 + m.m12 * a12 + m.m13 * a13;
    Matrix3::new(a11, a12, a13, a12, a22, a23, a13, a23, a33) / determinant
}

impl<T: Scalar> RigidBody for FreeFlyer<T> {
    type Scalar = T;
    fn inertial_parameters(&self) -> InertialParameters<T> {
        self.parameters
    }
}

/// Pose rate (the twist) above twist rate; an error where the acceleration is not finite.
fn state_rate<T: Scalar>(twist_body: &Twist<T>, twist_rate_body: &Twist<T>) -> Result<SVector<T, 12>, DynamicsError> {
    let (pose, twist) = (twist_body.to_vector(), twist_rate_body.to_vector());
    let rate = SVector::<T, 12>::from_fn(|i, _| if i < 6 { pose[i] } else { twist[i - 6] });
    if rate.iter().all(ComplexField::is_finite) { Ok(rate) } else { Err(DynamicsError::NotFinite) }
}

impl<T: Scalar> MechanicalSystem for FreeFlyer<T> {
    type State = RigidBodyState<T>;
    /// Wrench in body axes, torque about the body origin.
    type Input = Wrench<T>;
    #[inline]
    fn vector_field(
        &self,
        _time_s: T,
        state: &RigidBodyState<T>,
        wrench_body: &Wrench<T>,
    ) -> Result<SVector<T, 12>, DynamicsError> {
        let twist = &state.twist_body;
        state_rate(twist, &self.forward(twist, wrench_body).twist_rate_body(twist))
    }
}

/// A free body in an environment: the wrench models act besides the input wrench.
///
/// `environment` is anything that is a [`WrenchModel`]: one model, an array or a pair of models, a slice of
/// `&dyn WrenchModel`.
#[derive(Clone, Copy, Debug)]
pub struct FreeFlyerIn<T: Scalar, E> {
    /// The body.
    pub body: FreeFlyer<T>,
    /// What acts on it besides the input.
    pub environment: E,
}

impl<T: Scalar, E> RigidBody for FreeFlyerIn<T, E> {
    type Scalar = T;
    fn inertial_parameters(&self) -> InertialParameters<T> {
        self.body.parameters
    }
}

impl<T: Scalar, E: WrenchModel<T>> MechanicalSystem for FreeFlyerIn<T, E> {
    type State = RigidBodyState<T>;
    /// Wrench in body axes, torque about the body origin, besides the environment's.
    type Input = Wrench<T>;
    fn vector_field(
        &self,
        time_s: T,
        state: &RigidBodyState<T>,
        wrench_body: &Wrench<T>,
    ) -> Result<SVector<T, 12>, DynamicsError> {
        let total = *wrench_body + self.environment.wrench_body(time_s, state);
        self.body.vector_field(time_s, state, &total)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategies::body_d;

    #[test]
    fn golden_wrench_of_body_d() {
        let twist = Twist::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(7.0, -3.0, 2.0));
        let acceleration = BodyAcceleration {
            angular_acceleration_body: Vector3::new(0.1, 0.4, -0.3),
            acceleration_origin_body: Vector3::new(0.25, -0.15, 0.35),
        };
        let body = FreeFlyer::new(body_d());
        let wrench = body.inverse(&twist, &acceleration);
        let golden = SVector::from([0.1525, 0.51, -0.8825, 1.435, -1.06, 1.655]);
        assert!((wrench.to_vector() - golden).amax() < 1e-14, "{wrench:?}");
        let back = body.forward(&twist, &wrench);
        assert!((back.angular_acceleration_body - acceleration.angular_acceleration_body).amax() < 1e-14);
        assert!((back.acceleration_origin_body - acceleration.acceleration_origin_body).amax() < 1e-14);
    }

    #[test]
    fn a_torque_free_body_keeps_its_velocity_at_the_centre_of_mass() {
        let parameters = body_d();
        let state = RigidBodyState {
            twist_body: Twist::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.7, -0.3, 0.2)),
            ..RigidBodyState::at_rest()
        };
        let rate = FreeFlyer::new(parameters).vector_field(0.0, &state, &Wrench::zero()).unwrap();
        let (w, w_rate) = (state.twist_body.angular, Vector3::new(rate[6], rate[7], rate[8]));
        let velocity_rate = Vector3::new(rate[9], rate[10], rate[11]);
        let c = parameters.center_of_mass();
        let velocity_com = state.twist_body.linear + w.cross(&c);
        // d/dt (R (v + w x c)) = 0
        assert!((velocity_rate + w_rate.cross(&c) + w.cross(&velocity_com)).amax() < 1e-15);
    }

    #[test]
    fn the_motion_of_a_body_without_inertia_is_an_error() {
        let point = InertialParameters::about_com(1.0, Vector3::new(0.1, 0.0, 0.0), Matrix3::zeros());
        let field = FreeFlyer::new(point).vector_field(0.0, &RigidBodyState::at_rest(), &Wrench::zero());
        assert_eq!(field, Err(DynamicsError::NotFinite));
    }
}
