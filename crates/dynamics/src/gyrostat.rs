//! A body with momentum that turns within it.

use crate::error::DynamicsError;
use crate::inertia::InertialParameters;
use crate::state::RigidBodyState;
use crate::system::{MechanicalSystem, RigidBody};
use tumble_lie::nalgebra::{SVector, Vector3};
use tumble_lie::{Manifold, Scalar, Wrench};

/// Any system moved by a wrench, with wheels spinning in it: a gyrostat.
///
/// The stored momentum turns with the body, which costs the torque `h x w`: what the body does not feel as motor torque
/// it feels as precession. The system's inertia is that with the wheels held fast.
/// # Source
/// Hughes: Spacecraft Attitude Dynamics, chapter 3: `J w' + w x (J w + h) = -h' + tau`.
#[derive(Clone, Copy, Debug)]
pub struct Gyrostat<S>(pub S);

/// What is held over a step of a [`Gyrostat`].
///
/// # Frame
/// Body axes, torque about the body origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GyrostatInput<T: Scalar> {
    /// Wrench on the body: from outside, and what the motors of the wheels give, which is minus `stored_rate_body`.
    pub wrench_body: Wrench<T>,
    /// Momentum relative to the body at `since_s`, N m s.
    pub stored_body: Vector3<T>,
    /// What the motors add to it, N m.
    pub stored_rate_body: Vector3<T>,
    /// Time at which `stored_body` was stored, s.
    pub since_s: T,
}

impl<T: Scalar> GyrostatInput<T> {
    /// Momentum relative to the body, body axes, N m s.
    pub fn stored_at(&self, time_s: T) -> Vector3<T> {
        self.stored_body + self.stored_rate_body * (time_s - self.since_s)
    }
}

impl<S: RigidBody> RigidBody for Gyrostat<S> {
    type Scalar = S::Scalar;
    fn inertial_parameters(&self) -> InertialParameters<S::Scalar> {
        self.0.inertial_parameters()
    }
}

impl<T: Scalar, S> MechanicalSystem for Gyrostat<S>
where
    S: MechanicalSystem<State = RigidBodyState<T>, Input = Wrench<T>>,
    RigidBodyState<T>: Manifold<Scalar = T, Tangent = SVector<T, 12>>,
{
    type State = RigidBodyState<T>;
    type Input = GyrostatInput<T>;
    fn vector_field(
        &self,
        time_s: T,
        state: &RigidBodyState<T>,
        input: &GyrostatInput<T>,
    ) -> Result<SVector<T, 12>, DynamicsError> {
        let mut wrench = input.wrench_body;
        wrench.torque += input.stored_at(time_s).cross(&state.twist_body.angular);
        self.0.vector_field(time_s, state, &wrench)
    }
}
