//! Exact derivatives of one step with respect to state, input and parameters (feature `dual`).

use crate::error::DynamicsError;
use crate::free_flyer::FreeFlyer;
use crate::inertia::InertialParameters;
use crate::integrators::{GaussLegendre4, LieEuler, MuntheKaas4, RungeKutta4};
use crate::parameter_vector::PARAMETERS;
use crate::state::RigidBodyState;
use crate::system::Integrator;
use crate::variational_free_flyer::VariationalFreeFlyer;
use num_dual::Dual64;
use tumble_lie::nalgebra::{SVector, Vector6};
use tumble_lie::{Coordinates, Manifold, Scalar, Wrench, real};

/// A step that depends on parameters, written once for every scalar.
///
/// # Example
/// ```
/// use tumble_dynamics::lie::{Scalar, real};
/// use tumble_dynamics::nalgebra::{Vector1, Vector2};
/// use tumble_dynamics::{DynamicsError, ParametricModel, linearize};
///
/// /// A mass (the parameter, kg) that a force (N) pushes along a line: position (m) and speed (m/s).
/// #[derive(Debug)]
/// struct Cart;
/// impl ParametricModel for Cart {
///     type State<T: Scalar> = Vector2<T>;
///     type Input<T: Scalar> = Vector1<T>;
///     type Parameters<T: Scalar> = Vector1<T>;
///     fn lift<T: Scalar>(state: &Vector2<f64>) -> Vector2<T> {
///         state.map(real)
///     }
///     fn step<T: Scalar>(&self, state: &Vector2<T>, force: &Vector1<T>, mass: &Vector1<T>, step_s: T)
///         -> Result<Vector2<T>, DynamicsError> {
///         let acceleration = force.x / mass.x;
///         Ok(Vector2::new(state.x + state.y * step_s, state.y + acceleration * step_s))
///     }
/// }
/// let step = linearize(&Cart, &Vector2::zeros(), &Vector1::new(3.0), &Vector1::new(2.0), 0.1)?;
/// assert!((step.by_parameters[0].y + 3.0 / 4.0 * 0.1).abs() < 1e-15); // -F / m^2 dt
/// # Ok::<(), DynamicsError>(())
/// ```
/// Tutorial: [a system of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/dynamics/tests/suite/custom_system.rs), which differentiates its steps.
pub trait ParametricModel {
    /// State.
    type State<T: Scalar>: Manifold<Scalar = T>;
    /// Input held over the step.
    type Input<T: Scalar>: Coordinates<T>;
    /// Parameters.
    type Parameters<T: Scalar>: Coordinates<T>;
    /// The same state over another scalar.
    fn lift<T: Scalar>(state: &Self::State<f64>) -> Self::State<T>;
    /// The state `step_s` later.
    ///
    /// # Errors
    /// [`DynamicsError`] where the step has no value.
    fn step<T: Scalar>(
        &self,
        state: &Self::State<T>,
        input: &Self::Input<T>,
        parameters: &Self::Parameters<T>,
        step_s: T,
    ) -> Result<Self::State<T>, DynamicsError>;
}

/// Increment of a model's state.
pub type StateTangent<M> = <<M as ParametricModel>::State<f64> as Manifold>::Tangent;

/// The end of a step and its first derivatives.
///
/// Columns: entry `j` of each list is the change of the end state, as an increment at the end, per unit of coordinate
/// `j` of the increment of the start state, of the input, of the parameters.
#[derive(Clone, Debug)]
pub struct StepLinearization<M: ParametricModel> {
    /// End of the step.
    pub end: M::State<f64>,
    /// One column per coordinate of the state's increment.
    pub by_state: Vec<StateTangent<M>>,
    /// One column per coordinate of the input.
    pub by_input: Vec<StateTangent<M>>,
    /// One column per parameter.
    pub by_parameters: Vec<StateTangent<M>>,
}

/// Value and exact first derivatives of one step, by dual numbers.
///
/// # Errors
/// Those of the step.
/// # Source
/// The matrices of the sensitivity recursion, thesis (6.8).
pub fn linearize<M: ParametricModel>(
    model: &M,
    state: &M::State<f64>,
    input: &M::Input<f64>,
    parameters: &M::Parameters<f64>,
    step_s: f64,
) -> Result<StepLinearization<M>, DynamicsError> {
    let end = model.step(state, input, parameters, step_s)?;
    // Derivative along coordinate `j` of the stacked [state; input; parameters].
    let column = |j: usize| -> Result<StateTangent<M>, DynamicsError> {
        let seed = |i: usize| if i == j { Dual64::new(0.0, 1.0) } else { real(0.0) };
        let start = M::lift::<Dual64>(state).oplus(&Coordinates::from_fn(seed));
        let input_start = state_dimension::<M>();
        let parameters_start = input_start + M::Input::<f64>::DIM;
        let input = M::Input::<Dual64>::from_fn(|i| real::<Dual64>(input[i]) + seed(input_start + i));
        let parameters =
            M::Parameters::<Dual64>::from_fn(|i| real::<Dual64>(parameters[i]) + seed(parameters_start + i));
        let moved = model.step(&start, &input, &parameters, real(step_s))?.ominus(&M::lift(&end));
        Ok(Coordinates::from_fn(|i| moved[i].eps))
    };
    let (states, inputs) = (state_dimension::<M>(), M::Input::<f64>::DIM);
    let columns = |range: core::ops::Range<usize>| range.map(column).collect::<Result<Vec<_>, _>>();
    Ok(StepLinearization {
        by_state: columns(0..states)?,
        by_input: columns(states..states + inputs)?,
        by_parameters: columns(states + inputs..states + inputs + M::Parameters::<f64>::DIM)?,
        end,
    })
}

fn state_dimension<M: ParametricModel>() -> usize {
    <StateTangent<M> as Coordinates<f64>>::DIM
}

/// One step of a free body by a given integrator as a [`ParametricModel`]: the input is the held wrench
/// `[torque; force]` in body axes, the parameters are those of [`InertialParameters::to_vector`].
#[derive(Clone, Copy, Debug, Default)]
pub struct FreeFlyerStep<I>(pub I);

/// An integrator of a free body for every scalar at once: what steps that are differentiated ask for, since no bound says "an
/// [`Integrator`] of `FreeFlyer<T>` for every `T`".
///
/// Anything that is one by a generic implementation needs a single line. It then reaches filters
/// (`identification::recursive::Differentiated`) and local planners (`planning::local::BodyStep`).
///
/// # Frame
/// As in [`FreeFlyer`]: the wrench in body axes about the body origin, N m and N.
///
/// # Example
/// ```
/// use tumble_dynamics::lie::{Manifold, Scalar, Wrench};
/// use tumble_dynamics::{
///     DynamicsError, FreeFlyer, FreeFlyerIntegrator, FreeFlyerStep, InertialParameters, MechanicalSystem, RigidBodyState,
///     linearize, nalgebra::Vector6,
/// };
///
/// struct Euler;
/// impl FreeFlyerIntegrator for Euler {
///     fn step_free<T: Scalar>(&self, body: &FreeFlyer<T>, state: &RigidBodyState<T>, wrench: &Wrench<T>, step_s: T)
///         -> Result<RigidBodyState<T>, DynamicsError> {
///         Ok(state.oplus(&(body.vector_field(T::zero(), state, wrench)? * step_s)))
///     }
/// }
/// let body = InertialParameters::solid_box(2.0, [0.3, 0.3, 0.3]).to_vector();
/// let push = Vector6::new(0.0, 0.0, 0.0, 3.0, 0.0, 0.0);
/// let step = linearize(&FreeFlyerStep(Euler), &RigidBodyState::at_rest(), &push, &body, 0.1)?;
/// assert!((step.by_parameters[0][9] + 3.0 / 4.0 * 0.1).abs() < 1e-15); // of the speed along x by the mass: -F / m^2 dt
/// # Ok::<(), DynamicsError>(())
/// ```
/// Tutorial: [an integrator of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/dynamics/tests/suite/custom_integrator.rs).
pub trait FreeFlyerIntegrator {
    /// The state `step_s` later, the wrench held.
    ///
    /// # Errors
    /// [`DynamicsError`] where the step does not converge or the body is none.
    fn step_free<T: Scalar>(
        &self,
        body: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench_body: &Wrench<T>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError>;
}

macro_rules! free_flyer_integrators {
    ($($integrator:ty),*) => {$(
        impl FreeFlyerIntegrator for $integrator {
            fn step_free<T: Scalar>(
                &self,
                body: &FreeFlyer<T>,
                state: &RigidBodyState<T>,
                wrench_body: &Wrench<T>,
                step_s: T,
            ) -> Result<RigidBodyState<T>, DynamicsError> {
                self.step(body, state, wrench_body, T::zero(), step_s)
            }
        }
    )*};
}
free_flyer_integrators!(LieEuler, RungeKutta4, MuntheKaas4, GaussLegendre4, VariationalFreeFlyer);

impl<I: FreeFlyerIntegrator> ParametricModel for FreeFlyerStep<I> {
    type State<T: Scalar> = RigidBodyState<T>;
    type Input<T: Scalar> = Vector6<T>;
    type Parameters<T: Scalar> = SVector<T, PARAMETERS>;
    fn lift<T: Scalar>(state: &RigidBodyState<f64>) -> RigidBodyState<T> {
        state.lifted()
    }
    fn step<T: Scalar>(
        &self,
        state: &RigidBodyState<T>,
        wrench_body: &Vector6<T>,
        parameters: &SVector<T, PARAMETERS>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        let body = FreeFlyer::new(InertialParameters::from_vector(parameters));
        self.0.step_free(&body, state, &(*wrench_body).into(), step_s)
    }
}
