//! A filter model of any parametric step, its Jacobians by dual numbers (feature `dual`).

use super::extended_kalman::{DifferentiableModel, FilterModel};
use crate::dynamics::{ParametricModel, linearize};
use crate::error::IdentificationError;
use crate::lie::num_dual::Dual64;
use crate::lie::{Coordinates, Manifold, Scalar, real};
use nalgebra::{SMatrix, SVector};

/// What `ROWS` sensors show of a state, written once for every scalar; [`Differentiated`] makes a filter's model of it.
///
/// # Example
/// ```
/// use tumble_identification::dynamics::{FreeFlyerStep, MuntheKaas4, RigidBodyState};
/// use tumble_identification::lie::{Scalar, Twist, real};
/// use tumble_identification::nalgebra::{SVector, Vector1, Vector3};
/// use tumble_identification::recursive::{Differentiated, FilterModel, Shown, StepObservation, WithParameters};
///
/// /// A gyroscope of one axis.
/// struct Gyroscope {
///     axis: Vector3<f64>,
/// }
/// impl Shown<FreeFlyerStep<MuntheKaas4>, 1> for Gyroscope {
///     fn shown<T: Scalar>(&self, state: &RigidBodyState<T>) -> Vector1<T> {
///         Vector1::new(state.twist_body.angular.dot(&self.axis.map(real::<T>)))
///     }
/// }
/// let sensors = Gyroscope { axis: Vector3::z() };
/// let model = Differentiated { model: FreeFlyerStep(MuntheKaas4), sensors, noise_rate: SVector::<f64, 22>::repeat(1e-8) };
/// let mut state = RigidBodyState::at_rest();
/// state.twist_body = Twist::new(Vector3::new(0.1, 0.2, 0.3), Vector3::zeros());
/// let at = WithParameters { state, parameters: SVector::repeat(1.0) };
/// let measured = Vector1::new(0.35);
/// let observation = StepObservation { step_s: 0.1, input: SVector::zeros(), measured, standard_deviation: Vector1::new(1e-3) };
/// assert!((model.residual(&at, &observation).x - 0.05).abs() < 1e-12);
/// ```
/// Tutorial: [models of filters and their laws](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/tests/suite/filter_models.rs).
pub trait Shown<M: ParametricModel, const ROWS: usize> {
    /// The numbers they show.
    fn shown<T: Scalar>(&self, state: &M::State<T>) -> SVector<T, ROWS>;
}

/// State of a [`ParametricModel`] with its parameters.
///
/// # Shape
/// Increments: those of the state, then the `P` parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WithParameters<S, const N: usize, const P: usize> {
    /// State of the model.
    pub state: S,
    /// Its parameters.
    pub parameters: SVector<f64, P>,
}

impl<S: Manifold<Scalar = f64>, const N: usize, const P: usize> WithParameters<S, N, P> {
    /// Coordinates of an increment of the state; a size that does not fit does not compile.
    const STATE: usize = {
        assert!(<S::Tangent as Coordinates<f64>>::DIM + P == N, "N must be the coordinates of the state and of P");
        <S::Tangent as Coordinates<f64>>::DIM
    };

    fn head(xi: &SVector<f64, N>) -> S::Tangent {
        S::Tangent::from_fn(|i| xi[i])
    }

    fn joined(head: &S::Tangent, tail: &SVector<f64, P>) -> SVector<f64, N> {
        SVector::from_fn(|i, _| if i < Self::STATE { head[i] } else { tail[i - Self::STATE] })
    }
}

impl<S: Manifold<Scalar = f64>, const N: usize, const P: usize> Manifold for WithParameters<S, N, P> {
    type Scalar = f64;
    type Tangent = SVector<f64, N>;

    fn oplus(&self, xi: &SVector<f64, N>) -> Self {
        let parameters = self.parameters + SVector::<f64, P>::from_fn(|i, _| xi[Self::STATE + i]);
        Self { state: self.state.oplus(&Self::head(xi)), parameters }
    }

    fn ominus(&self, base: &Self) -> SVector<f64, N> {
        Self::joined(&self.state.ominus(&base.state), &(self.parameters - base.parameters))
    }

    fn increment_rate(xi: &SVector<f64, N>, velocity: &SVector<f64, N>) -> SVector<f64, N> {
        let rate = S::increment_rate(&Self::head(xi), &Self::head(velocity));
        Self::joined(&rate, &SVector::from_fn(|i, _| velocity[Self::STATE + i]))
    }
}

/// A step under a held input and what was measured at its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepObservation<U, const ROWS: usize> {
    /// Time since the last observation, s.
    pub step_s: f64,
    /// Input held over that time.
    pub input: U,
    /// What the sensors showed.
    pub measured: SVector<f64, ROWS>,
    /// Standard deviation of each number; infinite where there was none.
    pub standard_deviation: SVector<f64, ROWS>,
}

/// Any [`ParametricModel`] and what is [`Shown`] of its state as the model of a filter, every Jacobian exact, by dual numbers.
///
/// The parameters are coordinates of the state as they are: nothing keeps them a body. For that see
/// [`JointMotion`](super::JointMotion).
///
/// # Shape
/// `N` coordinates of state and parameters, `ROWS` measured numbers, `P` parameters.
///
/// # Example
/// ```
/// use tumble_identification::dynamics::{FreeFlyerStep, MuntheKaas4, ParametricModel, RigidBodyState};
/// use tumble_identification::lie::Scalar;
/// use tumble_identification::nalgebra::{SVector, Vector6};
/// use tumble_identification::recursive::{Differentiated, Shown};
///
/// /// Gyroscope and velocity in body axes.
/// struct Twist;
/// impl Shown<FreeFlyerStep<MuntheKaas4>, 6> for Twist {
///     fn shown<T: Scalar>(&self, state: &RigidBodyState<T>) -> Vector6<T> {
///         state.twist_body.to_vector()
///     }
/// }
/// let noise_rate = SVector::<f64, 22>::repeat(1e-8);
/// let model = Differentiated { model: FreeFlyerStep(MuntheKaas4), sensors: Twist, noise_rate };
/// # let _ = model;
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Differentiated<M, H, const N: usize> {
    /// The step.
    pub model: M,
    /// The sensors.
    pub sensors: H,
    /// Variance that each coordinate gains in a second.
    pub noise_rate: SVector<f64, N>,
}

impl<M, H, const N: usize, const ROWS: usize, const P: usize> FilterModel<N, ROWS, P> for Differentiated<M, H, N>
where
    M: ParametricModel<Parameters<f64> = SVector<f64, P>>,
    M::State<f64>: Copy,
    H: Shown<M, ROWS>,
{
    type State = WithParameters<M::State<f64>, N, P>;
    type Observation = StepObservation<M::Input<f64>, ROWS>;

    fn propagate(&self, at: &Self::State, observation: &Self::Observation) -> Result<Self::State, IdentificationError> {
        let state = self.model.step(&at.state, &observation.input, &at.parameters, observation.step_s)?;
        Ok(WithParameters { state, ..*at })
    }

    fn process_noise(&self, _at: &Self::State, observation: &Self::Observation) -> SMatrix<f64, N, N> {
        SMatrix::from_diagonal(&(self.noise_rate * observation.step_s.abs()))
    }

    fn residual(&self, at: &Self::State, observation: &Self::Observation) -> SVector<f64, ROWS> {
        observation.measured - self.sensors.shown(&at.state)
    }

    fn standard_deviation(&self, observation: &Self::Observation) -> SVector<f64, ROWS> {
        observation.standard_deviation
    }

    fn parameters(&self, at: &Self::State) -> SVector<f64, P> {
        at.parameters
    }

    fn parameter_jacobian(&self, _at: &Self::State) -> SMatrix<f64, P, N> {
        SMatrix::from_fn(|i, j| if j == i + Self::State::STATE { 1.0 } else { 0.0 })
    }
}

impl<M, H, const N: usize, const ROWS: usize, const P: usize> DifferentiableModel<N, ROWS, P>
    for Differentiated<M, H, N>
where
    M: ParametricModel<Parameters<f64> = SVector<f64, P>>,
    M::State<f64>: Copy,
    H: Shown<M, ROWS>,
{
    /// Not a number where the step has no value, which a filter refuses.
    fn predicted_covariance(
        &self,
        at: &Self::State,
        observation: &Self::Observation,
        covariance: &SMatrix<f64, N, N>,
    ) -> SMatrix<f64, N, N> {
        let found = linearize(&self.model, &at.state, &observation.input, &at.parameters, observation.step_s);
        let Ok(found) = found else { return SMatrix::repeat(f64::NAN) };
        let states = found.by_state.len();
        let transition = SMatrix::<f64, N, N>::from_fn(|i, j| match (i < states, j.checked_sub(states)) {
            (true, None) => found.by_state[j][i],
            (true, Some(j)) => found.by_parameters[j][i],
            (false, _) => f64::from(u8::from(i == j)),
        });
        let predicted = transition * covariance * transition.transpose();
        (predicted + predicted.transpose()) * 0.5 + self.process_noise(at, observation)
    }

    fn sensitivity(&self, at: &Self::State, _observation: &Self::Observation) -> SMatrix<f64, ROWS, N> {
        let mut sensitivity = SMatrix::<f64, ROWS, N>::zeros();
        for j in 0..Self::State::STATE {
            let seed = |i: usize| if i == j { Dual64::new(0.0, 1.0) } else { real(0.0) };
            let moved = M::lift::<Dual64>(&at.state).oplus(&Coordinates::from_fn(seed));
            sensitivity.set_column(j, &self.sensors.shown(&moved).map(|number| number.eps));
        }
        sensitivity
    }
}
