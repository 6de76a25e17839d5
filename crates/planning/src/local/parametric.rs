//! Any parametric model of a moving body as a model to plan for, by hyper-dual numbers (feature `dual`).

mod body_step;

pub use body_step::{BodyStep, MuntheKaasBodyModel, VariationalBodyModel};

use super::model::{Array2, InformativeModel, KINEMATICS, Kinematics, Knowledge, StepDerivatives};
use crate::belief::ModelBelief;
use crate::error::PlanningError;
use core::fmt::Debug;
use nalgebra::{SMatrix, Vector3};
use tumble_dynamics::{ParametricModel, StateTangent};
use tumble_lie::num_dual::{Dual64, HyperDual64};
use tumble_lie::{Coordinates, Manifold, Scalar, real};

/// A [`ParametricModel`] of a moving body of whose parameters `P` combinations are unknown: what [`ParametricInformative`]
/// plans for.
///
/// # Example
/// ```
/// use tumble_planning::dynamics::{DynamicsError, InertialParameters, ParametricModel};
/// use tumble_planning::lie::{Pose, Scalar, real};
/// use tumble_planning::local::{BelievedParameters, InformativeModel, Kinematics, ParametricInformative, UncertainBody};
/// use tumble_planning::local::UnknownParameter;
/// use tumble_planning::nalgebra::{Vector1, Vector2, Vector3};
/// use tumble_planning::{ModelBelief, PlanningError};
///
/// /// A sled on a rail along x: place (m) and speed (m/s), pushed by a force (N); its mass (kg) is the parameter.
/// #[derive(Clone, Debug)]
/// struct Sled;
/// impl ParametricModel for Sled {
///     type State<T: Scalar> = Vector2<T>;
///     type Input<T: Scalar> = Vector1<T>;
///     type Parameters<T: Scalar> = Vector1<T>;
///     fn lift<T: Scalar>(state: &Vector2<f64>) -> Vector2<T> {
///         state.map(real)
///     }
///     fn step<T: Scalar>(&self, state: &Vector2<T>, force: &Vector1<T>, mass: &Vector1<T>, step_s: T)
///         -> Result<Vector2<T>, DynamicsError> {
///         Ok(Vector2::new(state.x + state.y * step_s, state.y + force.x / mass.x * step_s))
///     }
/// }
/// impl UncertainBody<1> for Sled {
///     fn believed(&self, belief: &ModelBelief) -> Result<BelievedParameters<Vector1<f64>, 1>, PlanningError> {
///         let standard_deviation = belief.estimate.std.mass_kg;
///         let mass = UnknownParameter { index: 0, standard_deviation, name: "mass", unit: "kg" };
///         BelievedParameters::independent(Vector1::new(belief.parameters().mass), [mass])
///     }
///     fn at_rest(&self) -> Vector2<f64> {
///         Vector2::zeros()
///     }
///     fn kinematics<T: Scalar>(&self, state: &Vector2<T>) -> Kinematics<T> {
///         let along_x = |value: T| Vector3::new(value, T::zero(), T::zero());
///         Kinematics {
///             world_from_body: Pose::from_parts(along_x(state.x).into(), Default::default()),
///             velocity_world: along_x(state.y),
///             rate_body: Vector3::zeros(),
///         }
///     }
/// }
/// let mut robot = ParametricInformative::<Sled, 2, 1, 1>::new(Sled);
/// robot.adopt(&ModelBelief::vague(1, InertialParameters::solid_box(10.0, [0.3; 3]), [0.1, 0.0, 0.0]))?;
/// let (end, sensitivity) = robot.step(&Vector2::zeros(), &[[0.0; 2]], &[1.0], 1.0).ok_or("no such state")?;
/// assert!((end.y - 0.1).abs() < 1e-12 && (sensitivity[0][1] + 0.01).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
/// Tutorial: [a robot of your own, without a derivative written](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/custom_informative_model.rs).
pub trait UncertainBody<const P: usize>: ParametricModel {
    /// See [`InformativeModel::FIRST_ACTIVE`]; zero is always right.
    const FIRST_ACTIVE: usize = 0;

    /// What the parameters are taken for from now on, and how well they are known. What a [`ModelBelief`] does not hold, such
    /// as a drag coefficient, the model itself must.
    ///
    /// # Errors
    /// A belief that is not such a body, or whose covariance is none.
    fn believed(&self, belief: &ModelBelief) -> Result<BelievedParameters<Self::Parameters<f64>, P>, PlanningError>;

    /// Distance of the centre of mass from the origin, m.
    fn center_of_mass_m(&self, _parameters: &Self::Parameters<f64>) -> f64 {
        0.0
    }

    /// See [`InformativeModel::principal_moments`].
    fn principal_moments(&self, _parameters: &Self::Parameters<f64>) -> Option<Vector3<f64>> {
        None
    }

    /// Some state at rest.
    fn at_rest(&self) -> Self::State<f64>;

    /// The motion of the body in a state.
    fn kinematics<T: Scalar>(&self, state: &Self::State<T>) -> Kinematics<T>;

    /// Tracking error of a state from a reference, in the coordinates of the tracking weights; zero at the reference.
    fn residual<T: Scalar>(
        &self,
        state: &Self::State<T>,
        reference: &Self::State<T>,
    ) -> <Self::State<T> as Manifold>::Tangent {
        state.ominus(reference)
    }
}

/// The parameters of a model as they are believed.
#[derive(Clone, Debug, PartialEq)]
pub struct BelievedParameters<V, const P: usize> {
    /// Their values.
    pub values: V,
    /// Their change by each coordinate of the knowledge.
    pub by_coordinate: [V; P],
    /// How well they are known.
    pub knowledge: Knowledge<P>,
}

/// A parameter of a model that is not known exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnknownParameter {
    /// Its place among the parameters.
    pub index: usize,
    /// Its prior standard deviation; taken for at least a millionth of its value.
    pub standard_deviation: f64,
    /// Its name.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
}

impl<V: Coordinates<f64>, const P: usize> BelievedParameters<V, P> {
    /// Parameters some of which are unknown, independently of one another.
    ///
    /// # Errors
    /// An index that is none; those of [`Knowledge::of_covariance`].
    pub fn independent(values: V, unknown: [UnknownParameter; P]) -> Result<Self, PlanningError> {
        let mut covariance = SMatrix::zeros();
        for (i, UnknownParameter { index, standard_deviation, .. }) in unknown.iter().enumerate() {
            if *index >= V::DIM {
                let (value, upper) = (*index as f64, V::DIM.saturating_sub(1) as f64);
                return Err(PlanningError::OutOfRange { what: "the place of a parameter", value, lower: 0.0, upper });
            }
            covariance[(i, i)] = standard_deviation * standard_deviation;
        }
        let by_quantity = unknown.map(|one| V::from_fn(|i| if i == one.index { 1.0 } else { 0.0 }));
        let names = unknown.map(|one| (one.name, one.unit));
        let sizes = unknown.map(|one| values[one.index]);
        Self::correlated(values, by_quantity, &covariance, &sizes, names)
    }

    /// Parameters that change with unknown quantities, `by_quantity` per unit of each, which have this covariance, sizes, names
    /// and units. The coordinates are the quantities' errors in prior standard deviations.
    ///
    /// # Errors
    /// Those of [`Knowledge::of_covariance`].
    pub fn correlated(
        values: V,
        by_quantity: [V; P],
        covariance: &SMatrix<f64, P, P>,
        sizes: &[f64; P],
        names_and_units: [(&'static str, &'static str); P],
    ) -> Result<Self, PlanningError> {
        let (names, units) = (names_and_units.map(|(name, _)| name), names_and_units.map(|(_, unit)| unit));
        let knowledge = Knowledge::of_covariance(covariance, sizes, names, units)?;
        let scales = knowledge.scales();
        Ok(Self { values, by_coordinate: core::array::from_fn(|c| by_quantity[c] * scales[c]), knowledge })
    }
}

/// Any [`UncertainBody`] as an [`InformativeModel`], with exact derivatives by hyper-dual numbers.
///
/// A step with derivatives takes about `P (X + U)` times twelve times the plain step; models that are planned with often
/// deserve derivatives by hand.
///
/// `X` and `U` are the dimensions of the model's state and input; other numbers do not compile.
#[derive(Clone, Debug)]
pub struct ParametricInformative<M: ParametricModel, const X: usize, const U: usize, const P: usize> {
    model: M,
    believed: Option<Believed<M::Parameters<f64>, U, P>>,
}

#[derive(Clone, Debug)]
struct Believed<V, const U: usize, const P: usize> {
    values: V,
    by_coordinate: [V; P],
    acceleration_by_input: Array2<6, U>,
}

/// Steps over which the acceleration of the resting body is taken, s, and their weights: errors of first and second order in
/// the step cancel.
const SHORT_STEPS: [(f64, f64); 3] = [(1e-3, 1.0 / 3.0), (0.5e-3, -2.0), (0.25e-3, 8.0 / 3.0)];

fn lift<M: ParametricModel, T: Scalar>(state: &M::State<f64>) -> M::State<T> {
    M::lift(state)
}

impl<M, const X: usize, const U: usize, const P: usize> ParametricInformative<M, X, U, P>
where
    M: UncertainBody<P>,
{
    const FITS: () = assert!(
        <StateTangent<M> as Coordinates<f64>>::DIM == X && <M::Input<f64> as Coordinates<f64>>::DIM == U && P > 0,
        "X and U are the dimensions of the model's state and input, and something is unknown"
    );

    /// Plans for this model.
    pub fn new(model: M) -> Self {
        let () = Self::FITS;
        Self { model, believed: None }
    }

    /// The model.
    pub fn model(&self) -> &M {
        &self.model
    }

    /// The model, to be changed; what changes counts when a belief is adopted next.
    pub fn model_mut(&mut self) -> &mut M {
        &mut self.model
    }

    /// Acceleration of the resting body by input: the change of the velocities over a step, extrapolated to no time.
    fn acceleration_at_rest(&self, parameters: &M::Parameters<f64>) -> Result<Array2<6, U>, PlanningError> {
        let rest = self.model.at_rest();
        let start = lift::<M, Dual64>(&rest);
        let values = <M::Parameters<Dual64>>::from_fn(|i| real(parameters[i]));
        let attitude = self.model.kinematics(&rest).world_from_body.rotation;
        let mut by_input = [[0.0; U]; 6];
        for column in 0..U {
            let mut acceleration = [0.0; 6];
            let input = <M::Input<Dual64>>::from_fn(|i| Dual64::new(0.0, if i == column { 1.0 } else { 0.0 }));
            for (step_s, weight) in SHORT_STEPS {
                let end = self.model.step(&start, &input, &values, real(step_s))?;
                let Kinematics { velocity_world, rate_body, .. } = self.model.kinematics(&end);
                let gained = attitude.inverse() * velocity_world.map(|v| v.eps);
                for axis in 0..3 {
                    acceleration[axis] += gained[axis] * weight / step_s;
                    acceleration[3 + axis] += rate_body[axis].eps * weight / step_s;
                }
            }
            set_column(&mut by_input, column, &acceleration);
        }
        Ok(by_input)
    }
}

/// A start of a step that moves along two directions at once.
struct Seeds<'a, M: ParametricModel, const X: usize, const U: usize> {
    model: &'a M,
    state: &'a M::State<f64>,
    input: &'a [f64; U],
    values: &'a M::Parameters<f64>,
    step_s: f64,
}

impl<M: ParametricModel, const X: usize, const U: usize> Seeds<'_, M, X, U> {
    fn end(&self) -> Option<M::State<f64>> {
        let input = <M::Input<f64>>::from_fn(|i| self.input[i]);
        let end = self.model.step(self.state, &input, self.values, self.step_s).ok()?;
        let moved = end.ominus(self.state);
        (0..X).all(|i| moved[i].is_finite()).then_some(end)
    }

    /// Change of the end along one direction of the state, the input and the parameters.
    fn along(
        &self,
        end: &M::State<f64>,
        state: &dyn Fn(usize) -> f64,
        input: &dyn Fn(usize) -> f64,
        parameters: &dyn Fn(usize) -> f64,
    ) -> Option<[f64; X]> {
        let start = lift::<M, Dual64>(self.state).oplus(&Coordinates::from_fn(|i| Dual64::new(0.0, state(i))));
        let input = <M::Input<Dual64>>::from_fn(|i| Dual64::new(self.input[i], input(i)));
        let values = <M::Parameters<Dual64>>::from_fn(|i| Dual64::new(self.values[i], parameters(i)));
        let moved = self.model.step(&start, &input, &values, real(self.step_s)).ok()?;
        let change = moved.ominus(&lift::<M, Dual64>(end));
        Some(core::array::from_fn(|i| change[i].eps))
    }

    /// Changes of the end along a lane; along `phi` of the state and `parameters`; and of the latter along the lane with the
    /// numbers of `phi` held.
    ///
    /// The start moves along the lane first and along `phi` from there. So does the end: the change along `phi` is measured
    /// from where the lane alone has taken it.
    fn mixed(
        &self,
        end: &M::State<f64>,
        lane: usize,
        phi: &[f64; X],
        parameters: &M::Parameters<f64>,
    ) -> Option<([f64; X], [f64; X], [f64; X])> {
        let moves = |i: usize| if i == lane { 1.0 } else { 0.0 };
        let start = lift::<M, HyperDual64>(self.state)
            .oplus(&Coordinates::from_fn(|i| HyperDual64::new(0.0, 0.0, moves(i), 0.0)))
            .oplus(&Coordinates::from_fn(|i| HyperDual64::new(0.0, phi[i], 0.0, 0.0)));
        let input = <M::Input<HyperDual64>>::from_fn(|i| HyperDual64::new(self.input[i], 0.0, moves(X + i), 0.0));
        let values =
            <M::Parameters<HyperDual64>>::from_fn(|i| HyperDual64::new(self.values[i], parameters[i], 0.0, 0.0));
        let moved = self.model.step(&start, &input, &values, real(self.step_s)).ok()?;
        let end = lift::<M, HyperDual64>(end);
        let along_lane = moved.ominus(&end);
        let end = end.oplus(&Coordinates::from_fn(|i| HyperDual64::new(0.0, 0.0, along_lane[i].eps2, 0.0)));
        let along_phi = moved.ominus(&end);
        Some((
            core::array::from_fn(|i| along_lane[i].eps2),
            core::array::from_fn(|i| along_phi[i].eps1),
            core::array::from_fn(|i| along_phi[i].eps1eps2),
        ))
    }
}

fn set_column<const R: usize, const C: usize>(matrix: &mut Array2<R, C>, column: usize, entries: &[f64; R]) {
    for (row, entry) in matrix.iter_mut().zip(entries) {
        if let Some(place) = row.get_mut(column) {
            *place = *entry;
        }
    }
}

impl<M, const X: usize, const U: usize, const P: usize> InformativeModel<X, U, P> for ParametricInformative<M, X, U, P>
where
    M: UncertainBody<P>,
    M::State<f64>: PartialEq,
{
    type State = M::State<f64>;

    const FIRST_ACTIVE: usize = M::FIRST_ACTIVE;

    fn retract(&self, state: &Self::State, change: &[f64; X]) -> Self::State {
        state.oplus(&Coordinates::from_fn(|i| change[i]))
    }

    fn difference(&self, to: &Self::State, from: &Self::State) -> [f64; X] {
        let change = to.ominus(from);
        core::array::from_fn(|i| change[i])
    }

    fn adopt(&mut self, belief: &ModelBelief) -> Result<Knowledge<P>, PlanningError> {
        let BelievedParameters { values, by_coordinate, knowledge } = self.model.believed(belief)?;
        let acceleration_by_input = self.acceleration_at_rest(&values)?;
        self.believed = Some(Believed { values, by_coordinate, acceleration_by_input });
        Ok(knowledge)
    }

    fn residual(&self, state: &Self::State, reference: &Self::State) -> ([f64; X], Array2<X, X>) {
        let residual = self.model.residual(state, reference);
        let (lifted, reference) = (lift::<M, Dual64>(state), lift::<M, Dual64>(reference));
        let mut by_state = [[0.0; X]; X];
        for j in 0..X {
            let moved = lifted.oplus(&Coordinates::from_fn(|i| Dual64::new(0.0, if i == j { 1.0 } else { 0.0 })));
            let change = self.model.residual(&moved, &reference);
            set_column(&mut by_state, j, &core::array::from_fn(|i| change[i].eps));
        }
        (core::array::from_fn(|i| residual[i]), by_state)
    }

    fn kinematics(&self, state: &Self::State) -> Kinematics {
        self.model.kinematics(state)
    }

    fn kinematics_by_state(&self, state: &Self::State) -> Array2<KINEMATICS, X> {
        let lifted = lift::<M, Dual64>(state);
        let from = self.model.kinematics(&lifted);
        let mut by_state = [[0.0; X]; KINEMATICS];
        for j in 0..X {
            let moved = lifted.oplus(&Coordinates::from_fn(|i| Dual64::new(0.0, if i == j { 1.0 } else { 0.0 })));
            let change = self.model.kinematics(&moved).ominus(&from);
            set_column(&mut by_state, j, &core::array::from_fn(|i| change[i].eps));
        }
        by_state
    }

    fn acceleration_by_input(&self) -> Array2<6, U> {
        self.believed.as_ref().map_or([[0.0; U]; 6], |believed| believed.acceleration_by_input)
    }

    fn center_of_mass_m(&self) -> f64 {
        self.believed.as_ref().map_or(0.0, |believed| self.model.center_of_mass_m(&believed.values))
    }

    fn principal_moments(&self) -> Option<Vector3<f64>> {
        self.believed.as_ref().and_then(|believed| self.model.principal_moments(&believed.values))
    }

    fn step(
        &self,
        state: &Self::State,
        sensitivity: &Array2<P, X>,
        input: &[f64; U],
        step_s: f64,
    ) -> Option<(Self::State, Array2<P, X>)> {
        let Believed { values, by_coordinate, .. } = self.believed.as_ref()?;
        let seeds = Seeds { model: &self.model, state, input, values, step_s };
        let end = seeds.end()?;
        let mut after = [[0.0; X]; P];
        for ((after, phi), parameters) in after.iter_mut().zip(sensitivity).zip(by_coordinate) {
            *after = seeds.along(&end, &|i| phi[i], &|_| 0.0, &|i| parameters[i])?;
        }
        Some((end, after))
    }

    fn differentiate(
        &self,
        state: &Self::State,
        sensitivity: &Array2<P, X>,
        input: &[f64; U],
        step_s: f64,
        derivatives: &mut StepDerivatives<X, U, P>,
    ) -> Option<(Self::State, Array2<P, X>)> {
        let Believed { values, by_coordinate, .. } = self.believed.as_ref()?;
        let seeds = Seeds { model: &self.model, state, input, values, step_s };
        let end = seeds.end()?;
        let mut after = [[0.0; X]; P];
        for lane in 0..M::FIRST_ACTIVE.min(X) {
            let moves = |i: usize| if i == lane { 1.0 } else { 0.0 };
            let column = seeds.along(&end, &moves, &|_| 0.0, &|_| 0.0)?;
            set_column(&mut derivatives.by_state, lane, &column);
            for by_state in &mut derivatives.sensitivity_by_state {
                set_column(by_state, lane, &[0.0; X]);
            }
        }
        for lane in M::FIRST_ACTIVE..X + U {
            for (c, (phi, parameters)) in sensitivity.iter().zip(by_coordinate).enumerate() {
                let (along_lane, along_phi, mixed) = seeds.mixed(&end, lane, phi, parameters)?;
                if lane < X {
                    set_column(&mut derivatives.by_state, lane, &along_lane);
                    set_column(&mut derivatives.sensitivity_by_state[c], lane, &mixed);
                } else {
                    set_column(&mut derivatives.by_input, lane - X, &along_lane);
                    set_column(&mut derivatives.sensitivity_by_input[c], lane - X, &mixed);
                }
                after[c] = along_phi;
            }
        }
        Some((end, after))
    }
}
