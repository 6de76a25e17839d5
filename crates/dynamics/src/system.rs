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
///
/// # Example
/// ```
/// use tumble_dynamics::{InertialParameters, RigidBody};
///
/// /// A box whose tank empties.
/// struct Satellite {
///     fuel_kg: f64,
/// }
/// impl RigidBody for Satellite {
///     type Scalar = f64;
///     fn inertial_parameters(&self) -> InertialParameters<f64> {
///         InertialParameters::solid_box(280.0 + self.fuel_kg, [1.2, 1.2, 1.5])
///     }
/// }
/// assert_eq!(Satellite { fuel_kg: 20.0 }.inertial_parameters().mass, 300.0);
/// ```
/// Tutorial: [a body of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/dynamics/tests/suite/custom_body.rs).
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
/// [a wrench of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/dynamics/tests/suite/custom_wrench_model.rs).
///
/// # Example
/// ```
/// use tumble_dynamics::lie::{Scalar, Wrench};
/// use tumble_dynamics::nalgebra::Vector3;
/// use tumble_dynamics::{RigidBodyState, WrenchModel};
///
/// /// A spring to the origin of the world, 2 N/m.
/// struct Spring;
/// impl<T: Scalar> WrenchModel<T> for Spring {
///     fn wrench_body(&self, _time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
///         let place = state.world_from_body.translation.vector;
///         Wrench::new(Vector3::zeros(), state.world_from_body.rotation.inverse() * -(place + place))
///     }
/// }
/// let mut state = RigidBodyState::<f64>::at_rest();
/// state.world_from_body.translation.vector.x = 0.5;
/// assert_eq!(Spring.wrench_body(0.0, &state).force.x, -1.0);
/// ```
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
///
/// # Example
/// ```
/// use tumble_dynamics::nalgebra::Vector2;
/// use tumble_dynamics::{DynamicsError, Integrator, MechanicalSystem, RungeKutta4};
///
/// /// A mass on a spring: position (m) and speed (m/s), pushed with an acceleration (m/s^2).
/// struct Spring {
///     frequency_rad_s: f64,
/// }
/// impl MechanicalSystem for Spring {
///     type State = Vector2<f64>;
///     type Input = f64;
///     fn vector_field(&self, _time_s: f64, state: &Vector2<f64>, push: &f64) -> Result<Vector2<f64>, DynamicsError> {
///         Ok(Vector2::new(state.y, push - self.frequency_rad_s.powi(2) * state.x))
///     }
/// }
/// let (spring, mut state) = (Spring { frequency_rad_s: 2.0 }, Vector2::new(1.0, 0.0));
/// for step in 0..100 {
///     state = RungeKutta4.step(&spring, &state, &0.0, f64::from(step) * 0.01, 0.01)?;
/// }
/// assert!((state.x - 2.0_f64.cos()).abs() < 1e-8);
/// # Ok::<(), DynamicsError>(())
/// ```
/// Tutorial: [a system of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/dynamics/tests/suite/custom_system.rs).
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
///
/// # Example
/// Heun's method, for every system at once:
/// ```
/// use tumble_dynamics::lie::{Manifold, Wrench};
/// use tumble_dynamics::nalgebra::Vector3;
/// use tumble_dynamics::{DynamicsError, FreeFlyer, InertialParameters, Integrator, MechanicalSystem, RigidBodyState};
///
/// struct Heun;
/// impl<S: MechanicalSystem<State: Manifold<Scalar = f64>>> Integrator<S> for Heun {
///     fn order(&self) -> u32 {
///         2
///     }
///     fn step(&self, system: &S, state: &S::State, input: &S::Input, time_s: f64, step_s: f64)
///         -> Result<S::State, DynamicsError> {
///         let begin = system.vector_field(time_s, state, input)?;
///         let end = system.vector_field(time_s + step_s, &state.oplus(&(begin * step_s)), input)?;
///         Ok(state.oplus(&((begin + end) * (0.5 * step_s))))
///     }
/// }
/// let body = FreeFlyer::new(InertialParameters::solid_box(10.0, [0.3, 0.3, 0.3]));
/// let push = Wrench::new(Vector3::zeros(), Vector3::new(1.0, 0.0, 0.0));
/// let moved = Heun.step(&body, &RigidBodyState::at_rest(), &push, 0.0, 1.0)?;
/// assert!((moved.world_from_body.translation.x - 0.05).abs() < 1e-12);
/// # Ok::<(), DynamicsError>(())
/// ```
/// Tutorial: [an integrator of your own, and what it keeps](https://github.com/tumble-robotics/tumble/blob/main/crates/dynamics/tests/suite/custom_integrator.rs).
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
///
/// # Example
/// ```
/// use tumble_dynamics::{DynamicsError, Plant};
///
/// /// A tank that a pump fills, l/s; measured is what is in it, l.
/// struct Tank(f64);
/// impl Plant for Tank {
///     type Input = f64;
///     type Measurement = f64;
///     type Error = DynamicsError;
///     fn advance(&mut self, pumped: &f64, duration_s: f64) -> Result<f64, DynamicsError> {
///         self.0 = (self.0 + pumped * duration_s).clamp(0.0, 10.0);
///         Ok(self.0)
///     }
/// }
/// let mut tank = Tank(0.0);
/// assert_eq!(tank.advance(&0.5, 4.0)?, 2.0);
/// assert_eq!(tank.advance(&5.0, 4.0)?, 10.0);
/// # Ok::<(), DynamicsError>(())
/// ```
/// Of bodies [`SimulatedBody`](crate::SimulatedBody) and [`SimulatedGyrostat`](crate::SimulatedGyrostat) are plants. Tutorial: [a satellite with
/// sensors](https://github.com/tumble-robotics/tumble/blob/main/examples/servicer/src/robot.rs).
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
