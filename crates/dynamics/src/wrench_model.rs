//! Wrenches from the environment, and their sums.
//!
//! A model is anything with [`WrenchModel`]; pairs, arrays, slices and references of models are models again.

use crate::inertia::InertialParameters;
use crate::state::RigidBodyState;
use crate::system::WrenchModel;
use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use tumble_lie::nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_lie::{LieGroup, Scalar, Wrench, real};

/// Nothing acts.
impl<T: Scalar> WrenchModel<T> for () {
    fn wrench_body(&self, _time_s: T, _state: &RigidBodyState<T>) -> Wrench<T> {
        Wrench::zero()
    }
}

impl<T: Scalar, M: WrenchModel<T> + ?Sized> WrenchModel<T> for &M {
    fn wrench_body(&self, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        (**self).wrench_body(time_s, state)
    }
    fn wrench_on(&self, body: &InertialParameters<T>, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        (**self).wrench_on(body, time_s, state)
    }
}

impl<T: Scalar, M: WrenchModel<T> + ?Sized> WrenchModel<T> for Box<M> {
    fn wrench_body(&self, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        (**self).wrench_body(time_s, state)
    }
    fn wrench_on(&self, body: &InertialParameters<T>, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        (**self).wrench_on(body, time_s, state)
    }
}

impl<T: Scalar, M: WrenchModel<T> + ?Sized> WrenchModel<T> for Arc<M> {
    fn wrench_body(&self, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        (**self).wrench_body(time_s, state)
    }
    fn wrench_on(&self, body: &InertialParameters<T>, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        (**self).wrench_on(body, time_s, state)
    }
}

/// The sum of both.
impl<T: Scalar, A: WrenchModel<T>, B: WrenchModel<T>> WrenchModel<T> for (A, B) {
    fn wrench_body(&self, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        self.0.wrench_body(time_s, state) + self.1.wrench_body(time_s, state)
    }
    fn wrench_on(&self, body: &InertialParameters<T>, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        self.0.wrench_on(body, time_s, state) + self.1.wrench_on(body, time_s, state)
    }
}

/// The sum of all, for example of `&dyn WrenchModel<T>`.
impl<T: Scalar, M: WrenchModel<T>> WrenchModel<T> for [M] {
    fn wrench_body(&self, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        self.iter().fold(Wrench::zero(), |sum, model| sum + model.wrench_body(time_s, state))
    }
    fn wrench_on(&self, body: &InertialParameters<T>, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        self.iter().fold(Wrench::zero(), |sum, model| sum + model.wrench_on(body, time_s, state))
    }
}

/// The sum of all.
impl<T: Scalar, M: WrenchModel<T>, const N: usize> WrenchModel<T> for [M; N] {
    fn wrench_body(&self, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        self.as_slice().wrench_body(time_s, state)
    }
    fn wrench_on(&self, body: &InertialParameters<T>, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        self.as_slice().wrench_on(body, time_s, state)
    }
}

/// All that acts on a body beside what its actuators give, to be handed around: nothing until something is added.
///
/// The time of its models is that of whoever asks: estimators and identification ask for the seconds of their stamps.
///
/// ```
/// use tumble_dynamics::lie::Wrench;
/// use tumble_dynamics::{ConstantBodyWrench, Environment, RigidBodyState, WrenchModel, nalgebra::Vector3};
/// let leak = ConstantBodyWrench { wrench_body: Wrench::new(Vector3::zeros(), Vector3::x() * 1e-3) };
/// let environment = Environment::default().with(leak);
/// assert_eq!(environment.wrench_body(0.0, &RigidBodyState::at_rest()).force.x, 1e-3);
/// ```
#[derive(Clone, Default)]
pub struct Environment {
    models: Vec<Arc<dyn WrenchModel<f64> + Send + Sync>>,
}

impl Environment {
    /// One more.
    #[must_use]
    pub fn with(mut self, model: impl WrenchModel<f64> + Send + Sync + 'static) -> Self {
        self.models.push(Arc::new(model));
        self
    }

    /// Whether nothing acts.
    pub fn is_empty(&self) -> bool {
        self.models.is_empty()
    }
}

impl core::fmt::Debug for Environment {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Environment({} models)", self.models.len())
    }
}

impl WrenchModel<f64> for Environment {
    fn wrench_body(&self, time_s: f64, state: &RigidBodyState<f64>) -> Wrench<f64> {
        self.models.as_slice().wrench_body(time_s, state)
    }
    fn wrench_on(&self, body: &InertialParameters<f64>, time_s: f64, state: &RigidBodyState<f64>) -> Wrench<f64> {
        self.models.as_slice().wrench_on(body, time_s, state)
    }
}

/// A closure `(time_s, state) -> wrench in body axes` as a model.
///
/// ```
/// use tumble_dynamics::{RigidBodyState, WrenchFn, WrenchModel, lie::Wrench, nalgebra::Vector3};
/// let pulse = WrenchFn(|time_s: f64, _: &RigidBodyState<f64>| {
///     Wrench::new(Vector3::zeros(), Vector3::new(if time_s < 1.0 { 0.5 } else { 0.0 }, 0.0, 0.0))
/// });
/// assert_eq!(pulse.wrench_body(0.2, &RigidBodyState::at_rest()).force.x, 0.5);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct WrenchFn<F>(pub F);

impl<T: Scalar, F: Fn(T, &RigidBodyState<T>) -> Wrench<T>> WrenchModel<T> for WrenchFn<F> {
    fn wrench_body(&self, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        (self.0)(time_s, state)
    }
}

/// A wrench fixed in the body: a thruster that leaks, a cable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantBodyWrench<T: Scalar> {
    /// Body axes, torque about the body origin.
    pub wrench_body: Wrench<T>,
}

impl<T: Scalar> WrenchModel<T> for ConstantBodyWrench<T> {
    fn wrench_body(&self, _time_s: T, _state: &RigidBodyState<T>) -> Wrench<T> {
        self.wrench_body
    }
}

/// The torque `h x w` on a body that turns along the momentum stored in its wheels.
///
/// ```
/// use tumble_dynamics::nalgebra::Vector3;
/// use tumble_dynamics::{RigidBodyState, StoredMomentum, WrenchModel};
/// let wheel = StoredMomentum { momentum_body: Vector3::z() * 2.0 };
/// let mut state = RigidBodyState::at_rest();
/// state.twist_body.angular.x = 0.1;
/// assert_eq!(wheel.wrench_body(0.0, &state).torque, Vector3::y() * 0.2);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredMomentum<T: Scalar> {
    /// Body axes, N m s, relative to the body.
    pub momentum_body: Vector3<T>,
}

impl<T: Scalar> WrenchModel<T> for StoredMomentum<T> {
    fn wrench_body(&self, _time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        Wrench::new(self.momentum_body.cross(&state.twist_body.angular), Vector3::zeros())
    }
}

/// A force and torque of constant direction in the inertial frame, acting at the body origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantWorldWrench<T: Scalar> {
    /// Inertial axes, torque about the body origin.
    pub wrench_world: Wrench<T>,
}

impl<T: Scalar> WrenchModel<T> for ConstantWorldWrench<T> {
    fn wrench_body(&self, _time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        let body_from_world = state.world_from_body.rotation.inverse();
        Wrench::new(body_from_world * self.wrench_world.torque, body_from_world * self.wrench_world.force)
    }
}

/// Uniform gravity; acts at the centre of mass, hence torque `h x g` about the body origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UniformGravity<T: Scalar> {
    /// Mass of the body, kg.
    pub mass: T,
    /// First moment `m c` of the body, body axes, kg m.
    pub first_moment: Vector3<T>,
    /// Acceleration of free fall, inertial axes, m/s^2.
    pub gravity_world: Vector3<T>,
}

impl<T: Scalar> WrenchModel<T> for UniformGravity<T> {
    fn wrench_body(&self, _time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        let gravity_body = state.world_from_body.rotation.inverse() * self.gravity_world;
        Wrench::new(self.first_moment.cross(&gravity_body), gravity_body * self.mass)
    }
    fn wrench_on(&self, body: &InertialParameters<T>, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        Self { mass: body.mass, first_moment: body.first_moment, ..*self }.wrench_body(time_s, state)
    }
}

/// Gravity that differs from place to place, seen from a point that falls freely: what turns and drives apart bodies in
/// orbit.
///
/// Near the reference point the field is linear, `a(x) = G (x - x0)`; force and torque are then exact, whatever the shape
/// of the body: `f = m a(x_B) + G h`, `tau = h x a(x_B) + integral of r x G r dm`. About the centre of mass, in the field
/// of a far point mass, this is the familiar `3 mu/r^3 u x J u`.
///
/// The world axes must not turn; those of the orbit do, and [`turn_rate_world`](Self::turn_rate_world) turns the field
/// with them.
///
/// ```
/// use tumble_dynamics::nalgebra::Vector3;
/// use tumble_dynamics::{GravityGradient, InertialParameters, RigidBodyState, WrenchModel, lie::Pose};
/// let satellite = InertialParameters::solid_box(300.0, [3.0, 1.0, 1.0]);
/// let (mu, below) = (3.986e14, Vector3::new(0.0, 0.0, -7.0e6)); // the earth, from a satellite at the reference point
/// let gravity = GravityGradient::of_point_mass(satellite, mu, below, Vector3::zeros());
/// let mut state = RigidBodyState::at_rest();
/// state.world_from_body = Pose::rotation(Vector3::y() * 0.3); // the long axis a little off the horizon
/// assert!(gravity.wrench_body(0.0, &state).torque.y > 0.0); // is turned towards the vertical
/// ```
/// # Frame
/// World axes for the field, body axes for the wrench.
/// # Source
/// Hughes: Spacecraft Attitude Dynamics, section 8.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GravityGradient<T: Scalar> {
    /// The body it acts on.
    pub body: InertialParameters<T>,
    /// Gradient of the acceleration at time zero, inertial axes, 1/s^2; symmetric.
    pub gradient_world: Matrix3<T>,
    /// The point that falls freely, m.
    pub reference_world: Vector3<T>,
    /// Angular velocity of the field, inertial axes, rad/s: the orbit's, or zero.
    pub turn_rate_world: Vector3<T>,
}

impl<T: Scalar> GravityGradient<T> {
    /// Of a point mass with gravitational parameter `mu` (m^3/s^2) at `center_world` (m), as seen from the world's origin,
    /// which falls freely.
    ///
    /// `G = mu/r^3 (3 u u^T - 1)`.
    pub fn of_point_mass(
        body: InertialParameters<T>,
        mu: T,
        center_world: Vector3<T>,
        turn_rate_world: Vector3<T>,
    ) -> Self {
        let distance = center_world.norm();
        let up = center_world / distance;
        let gradient = up * up.transpose() * real::<T>(3.0) - Matrix3::identity();
        Self {
            body,
            gradient_world: gradient * (mu / (distance * distance * distance)),
            reference_world: Vector3::zeros(),
            turn_rate_world,
        }
    }
}

impl<T: Scalar> WrenchModel<T> for GravityGradient<T> {
    fn wrench_body(&self, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        self.wrench_on(&self.body, time_s, state)
    }
    fn wrench_on(&self, body: &InertialParameters<T>, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        let turned: UnitQuaternion<T> = LieGroup::exp(&(self.turn_rate_world * time_s));
        let field_from_body = turned.inverse() * state.world_from_body.rotation;
        let axes = field_from_body.to_rotation_matrix().into_inner();
        let gradient = axes.transpose() * self.gradient_world * axes;
        let place = state.world_from_body.translation.vector - self.reference_world;
        let acceleration = gradient * (state.world_from_body.rotation.inverse() * place);
        let InertialParameters { mass, first_moment, inertia_about_origin } = body;
        // integral of r x G r dm; the trace of the inertia drops out, for G is symmetric
        let product = inertia_about_origin * gradient;
        let turning = Vector3::new(product.m32 - product.m23, product.m13 - product.m31, product.m21 - product.m12);
        Wrench::new(first_moment.cross(&acceleration) + turning, acceleration * *mass + gradient * first_moment)
    }
}

/// Velocity through a medium of the body point at `point`, body axes.
fn velocity_through_medium<T: Scalar>(
    state: &RigidBodyState<T>,
    point: &Vector3<T>,
    medium_velocity_world: &Vector3<T>,
) -> Vector3<T> {
    let medium_velocity_body = state.world_from_body.rotation.inverse() * medium_velocity_world;
    state.twist_body.linear + state.twist_body.angular.cross(point) - medium_velocity_body
}

/// Drag proportional to velocity: slow motion in a viscous medium, an air bearing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearDrag<T: Scalar> {
    /// Where the force acts, body axes, m.
    pub center_of_pressure: Vector3<T>,
    /// Force per velocity of that point through the medium, N s/m.
    pub force_coefficient: T,
    /// Torque per angular velocity, N m s/rad.
    pub torque_coefficient: T,
    /// Velocity of the medium, inertial axes, m/s.
    pub medium_velocity_world: Vector3<T>,
}

impl<T: Scalar> WrenchModel<T> for LinearDrag<T> {
    fn wrench_body(&self, _time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        let velocity = velocity_through_medium(state, &self.center_of_pressure, &self.medium_velocity_world);
        let force = velocity * -self.force_coefficient;
        let torque = state.twist_body.angular * -self.torque_coefficient;
        Wrench::new(torque + self.center_of_pressure.cross(&force), force)
    }
}

/// Drag proportional to the square of velocity: fast motion in air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadraticDrag<T: Scalar> {
    /// Where the force acts, body axes, m.
    pub center_of_pressure: Vector3<T>,
    /// Force per squared velocity of that point through the medium, `1/2 rho C_d A`, N s^2/m^2.
    pub force_coefficient: T,
    /// Torque per squared angular velocity, N m s^2/rad^2.
    pub torque_coefficient: T,
    /// Velocity of the medium, inertial axes, m/s.
    pub medium_velocity_world: Vector3<T>,
}

/// `|v| v`, with the right derivative (zero) at zero.
fn signed_square<T: Scalar>(v: &Vector3<T>) -> Vector3<T> {
    let square = v.norm_squared();
    if square > T::zero() { v * square.sqrt() } else { v * T::zero() }
}

impl<T: Scalar> WrenchModel<T> for QuadraticDrag<T> {
    fn wrench_body(&self, _time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        let velocity = velocity_through_medium(state, &self.center_of_pressure, &self.medium_velocity_world);
        let force = signed_square(&velocity) * -self.force_coefficient;
        let torque = signed_square(&state.twist_body.angular) * -self.torque_coefficient;
        Wrench::new(torque + self.center_of_pressure.cross(&force), force)
    }
}

#[cfg(test)]
#[cfg(feature = "dual")]
mod tests {
    use super::*;
    use num_dual::Dual64;
    use tumble_lie::nalgebra::{ComplexField, Vector6};

    #[test]
    fn the_derivative_of_quadratic_drag_at_rest_is_zero_not_nan() {
        let drag = QuadraticDrag::<Dual64> {
            center_of_pressure: Vector3::new(0.1, 0.2, 0.3).map(Dual64::from),
            force_coefficient: 0.4.into(),
            torque_coefficient: 0.5.into(),
            medium_velocity_world: Vector3::zeros(),
        };
        let mut state = RigidBodyState::<Dual64>::at_rest();
        let mut velocity = Vector6::zeros();
        velocity[4] = Dual64::new(0.0, 1.0);
        state.twist_body = velocity.into();
        let wrench = drag.wrench_body(Dual64::from(0.0), &state).to_vector();
        assert!(wrench.iter().all(|component| component.re == 0.0 && component.eps == 0.0), "{wrench:?}");
        // and right off rest: d(|v| v)/dv = 2 |v|
        velocity[4] = Dual64::new(-3.0, 1.0);
        state.twist_body = velocity.into();
        let force = drag.wrench_body(Dual64::from(0.0), &state).force.y;
        assert!((force.re - 0.4 * 9.0).abs() < 1e-14 && (force.eps + 0.4 * 6.0).abs() < 1e-14);
        assert!(force.is_finite());
    }
}
