//! What a mechanical system is, and what steps it.

use crate::error::DynamicsError;
use crate::inertia::InertialParameters;
use crate::parameter_vector::PARAMETERS;
use crate::state::RigidBodyState;
use tumble_lie::nalgebra::{SMatrix, SVector};
use tumble_lie::{Manifold, Scalar, Wrench};

/// Scalar type of a system.
pub type ScalarOf<S> = <<S as MechanicalSystem>::State as Manifold>::Scalar;
/// Tangent vector of a system's state.
pub type TangentOf<S> = <<S as MechanicalSystem>::State as Manifold>::Tangent;

/// Anything that has the inertial parameters of one rigid body.
pub trait RigidBody {
    /// Scalar type.
    type Scalar: Scalar;
    /// The ten parameters, about the body origin.
    fn inertial_parameters(&self) -> InertialParameters<Self::Scalar>;
}

impl<T: Scalar> RigidBody for InertialParameters<T> {
    type Scalar = T;
    fn inertial_parameters(&self) -> Self {
        *self
    }
}

/// A wrench that depends on time and state: gravity, drag, a bias, a user's own. Models add up.
///
/// Laws (feature `testing`): [`check_wrench_model`](crate::laws::check_wrench_model). Tutorial:
/// `tests/custom_wrench_model.rs`.
pub trait WrenchModel<T: Scalar> {
    /// Wrench on the body, body axes, torque about the body origin.
    fn wrench_body(&self, time_s: T, state: &RigidBodyState<T>) -> Wrench<T>;

    /// The wrench on another body, for models that act on every part of it, as gravity does; affine in its parameters.
    ///
    /// Whoever looks for the body asks this. What acts on a surface or an attachment is the same for every body, which is
    /// what is provided.
    fn wrench_on(&self, _body: &InertialParameters<T>, time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        self.wrench_body(time_s, state)
    }

    /// What acts on a body of no mass, and what each of the ten parameters adds to it, of
    /// [`wrench_on`](Self::wrench_on).
    ///
    /// # Shape
    /// `[torque; force]` by [`InertialParameters::to_vector`].
    fn wrench_regressor(&self, time_s: T, state: &RigidBodyState<T>) -> (Wrench<T>, SMatrix<T, 6, PARAMETERS>) {
        let on = |unit: &SVector<T, PARAMETERS>| {
            self.wrench_on(&InertialParameters::from_vector(unit), time_s, state).to_vector()
        };
        let nothing = on(&SVector::zeros());
        let mut regressor = SMatrix::<T, 6, PARAMETERS>::zeros();
        for (j, mut column) in regressor.column_iter_mut().enumerate() {
            column.copy_from(&(on(&SVector::from_fn(|i, _| if i == j { T::one() } else { T::zero() })) - nothing));
        }
        (nothing.into(), regressor)
    }
}

/// A system of ordinary differential equations on a manifold.
pub trait MechanicalSystem {
    /// State.
    type State: Manifold;
    /// Input, held over a step.
    type Input;
    /// The right-trivialised velocity of the state: `state.oplus(vector_field * dt)` to first order.
    ///
    /// # Errors
    /// [`DynamicsError`] where the field has no value.
    fn vector_field(
        &self,
        time_s: ScalarOf<Self>,
        state: &Self::State,
        input: &Self::Input,
    ) -> Result<TangentOf<Self>, DynamicsError>;
}

/// One step of a mechanical system.
pub trait Integrator<S: MechanicalSystem> {
    /// Claimed global order.
    fn order(&self) -> u32;
    /// The state `step_s` later, the input held. A negative step goes back.
    ///
    /// # Errors
    /// [`DynamicsError`] where the system has no value or the step does not converge.
    fn step(
        &self,
        system: &S,
        state: &S::State,
        input: &S::Input,
        time_s: ScalarOf<S>,
        step_s: ScalarOf<S>,
    ) -> Result<S::State, DynamicsError>;
}

/// Something that takes inputs and gives measurements: a simulator, a replayed log, hardware.
pub trait Plant {
    /// Input held while time advances.
    type Input;
    /// What is measured at the end.
    type Measurement;
    /// What can go wrong.
    type Error: core::error::Error;
    /// Holds `input` for `duration_s`, then measures.
    ///
    /// # Errors
    /// The plant's own.
    fn advance(&mut self, input: &Self::Input, duration_s: f64) -> Result<Self::Measurement, Self::Error>;
}
