//! Trees as systems that integrators step; derivatives by dual numbers.

use super::inverse_dynamics::GeneralizedForce;
use super::storage::Fixed;
use super::{Link, Multibody};
use crate::differentiate::ParametricModel;
use crate::discrete_lagrangian::DiscreteLagrangian;
use crate::error::DynamicsError;
use crate::free_flyer::BodyAcceleration;
use crate::inertia::InertialParameters;
use crate::integrators::{LieEuler, MuntheKaas4, RungeKutta4};
use crate::parameter_vector::PARAMETERS;
use crate::state::{GroupState, GroupTangent};
use crate::system::{Integrator, MechanicalSystem};
use core::ops::{Add, Index, IndexMut, Mul, Neg, Sub};
use tumble_lie::nalgebra::{SVector, Translation, Vector3, Vector6, convert};
use tumble_lie::{Coordinates, Pose, Product, Scalar, Stacked, Twist, real};

/// Configuration of a tree on a free base: pose of the base, joint positions.
pub type FreeConfiguration<T, const J: usize> = Product<Pose<T>, Translation<T, J>>;
/// Wrench on the base (base axes, about its origin), then forces of the motors.
pub type FreeInput<T, const J: usize> = Stacked<Vector6<T>, SVector<T, J>>;

/// A tree whose base is free, in a uniform gravity field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeMultibody<T: Scalar, const J: usize> {
    /// The tree.
    pub tree: Multibody<T, Fixed<J>>,
    /// Gravity, inertial axes, m/s^2.
    pub gravity_world: Vector3<T>,
}

/// A tree whose base is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedMultibody<T: Scalar, const J: usize> {
    /// The tree.
    pub tree: Multibody<T, Fixed<J>>,
    /// Gravity, base axes, m/s^2.
    pub gravity_base: Vector3<T>,
}

impl<const J: usize> Multibody<f64, Fixed<J>> {
    /// The same tree over another scalar.
    pub fn lifted<T: Scalar>(&self) -> Multibody<T, Fixed<J>> {
        Multibody { base: lifted_body(&self.base), links: self.links.map(|link| link.lifted()) }
    }
}

fn lifted_body<T: Scalar>(body: &InertialParameters<f64>) -> InertialParameters<T> {
    InertialParameters {
        mass: real(body.mass),
        first_moment: body.first_moment.map(real),
        inertia_about_origin: body.inertia_about_origin.map(real),
    }
}

impl Link<f64> {
    fn lifted<T: Scalar>(&self) -> Link<T> {
        Link { parent: self.parent, joint: self.joint.lifted(), body: lifted_body(&self.body) }
    }
}

impl<T: Scalar, const J: usize> MechanicalSystem for FreeMultibody<T, J> {
    type State = GroupState<FreeConfiguration<T, J>>;
    type Input = FreeInput<T, J>;
    fn vector_field(
        &self,
        _time_s: T,
        state: &Self::State,
        input: &Self::Input,
    ) -> Result<GroupTangent<FreeConfiguration<T, J>>, DynamicsError> {
        let twist = Twist::from(state.velocity.first);
        let force = GeneralizedForce { base: input.first.into(), joints: input.second.data.0[0] };
        let positions = &state.configuration.second.vector.data.0[0];
        let mut acceleration =
            self.tree.forward_dynamics(&twist, positions, &state.velocity.second.data.0[0], &force)?;
        acceleration.base.acceleration_origin_body +=
            state.configuration.first.rotation.inverse_transform_vector(&self.gravity_world);
        let base_rate = acceleration.base.twist_rate_body(&twist).to_vector();
        Ok(GroupTangent {
            configuration: state.velocity,
            velocity: Stacked::new(base_rate, SVector::from(acceleration.joints)),
        })
    }
}

impl<T: Scalar, const J: usize> MechanicalSystem for FixedMultibody<T, J> {
    type State = GroupState<Translation<T, J>>;
    /// Forces of the motors.
    type Input = SVector<T, J>;
    fn vector_field(
        &self,
        _time_s: T,
        state: &Self::State,
        input: &Self::Input,
    ) -> Result<GroupTangent<Translation<T, J>>, DynamicsError> {
        let force = GeneralizedForce { joints: input.data.0[0], ..GeneralizedForce::zero(&self.tree) };
        let held = BodyAcceleration {
            angular_acceleration_body: Vector3::zeros(),
            acceleration_origin_body: -self.gravity_base,
        };
        let positions = &state.configuration.vector.data.0[0];
        let rates = &state.velocity.data.0[0];
        let acceleration = self.tree.forward_dynamics_on_base(&Twist::zero(), &held, positions, rates, &force)?;
        Ok(GroupTangent { configuration: state.velocity, velocity: SVector::from(acceleration.joints) })
    }
}

/// The damper's share of the generalised force; springs are in the Lagrangian.
fn damping<const J: usize>(tree: &Multibody<f64, Fixed<J>>, rates: &SVector<f64, J>) -> SVector<f64, J> {
    SVector::from_fn(|i, _| -tree.links[i].joint.damping * rates[i])
}

impl<const J: usize> DiscreteLagrangian for FreeMultibody<f64, J> {
    type Group<T: Scalar> = FreeConfiguration<T, J>;
    fn lift<T: Scalar>(configuration: &FreeConfiguration<f64, J>) -> FreeConfiguration<T, J> {
        Product::new(convert(configuration.first), Translation::from(configuration.second.vector.map(real)))
    }
    fn lagrangian<T: Scalar>(&self, configuration: &FreeConfiguration<T, J>, velocity: &FreeInput<T, J>) -> T {
        let tree = self.tree.lifted::<T>();
        let positions = &configuration.second.vector.data.0[0];
        let kinetic = tree.kinetic_energy(&velocity.first.into(), positions, &velocity.second.data.0[0]);
        let potential = tree.potential_energy(&configuration.first, positions, &self.gravity_world.map(real));
        difference(kinetic, potential)
    }
    fn force(
        &self,
        _: f64,
        _: &FreeConfiguration<f64, J>,
        velocity: &FreeInput<f64, J>,
        input: &FreeInput<f64, J>,
    ) -> FreeInput<f64, J> {
        Stacked::new(input.first, input.second + damping(&self.tree, &velocity.second))
    }
}

impl<const J: usize> DiscreteLagrangian for FixedMultibody<f64, J> {
    type Group<T: Scalar> = Translation<T, J>;
    fn lift<T: Scalar>(positions: &Translation<f64, J>) -> Translation<T, J> {
        Translation::from(positions.vector.map(real))
    }
    fn lagrangian<T: Scalar>(&self, positions: &Translation<T, J>, rates: &SVector<T, J>) -> T {
        let tree = self.tree.lifted::<T>();
        let positions = &positions.vector.data.0[0];
        let kinetic = tree.kinetic_energy(&Twist::zero(), positions, &rates.data.0[0]);
        let potential = tree.potential_energy(&Pose::identity(), positions, &self.gravity_base.map(real));
        difference(kinetic, potential)
    }
    fn force(
        &self,
        _: f64,
        _: &Translation<f64, J>,
        rates: &SVector<f64, J>,
        input: &SVector<f64, J>,
    ) -> SVector<f64, J> {
        input + damping(&self.tree, rates)
    }
}

/// Kinetic minus potential energy; sizes agree by type, so neither is an error.
fn difference<T: Scalar>(kinetic: Result<T, DynamicsError>, potential: Result<T, DynamicsError>) -> T {
    match (kinetic, potential) {
        (Ok(kinetic), Ok(potential)) => kinetic - potential,
        _ => real(f64::NAN),
    }
}

/// The ten parameters of the base and of each link, in the order of [`InertialParameters::to_vector`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointedBodies<T: Scalar, const J: usize> {
    /// The base body.
    pub base: SVector<T, PARAMETERS>,
    /// The links.
    pub links: [SVector<T, PARAMETERS>; J],
}

impl<T: Scalar, const J: usize> JointedBodies<T, J> {
    /// Those of a tree.
    pub fn of(tree: &Multibody<T, Fixed<J>>) -> Self {
        Self { base: tree.base.to_vector(), links: tree.links.map(|link| link.body.to_vector()) }
    }

    fn zip(self, other: &Self, mut combine: impl FnMut(T, T) -> T) -> Self {
        Coordinates::from_fn(|i| combine(self[i], other[i]))
    }
}
impl<T: Scalar, const J: usize> Index<usize> for JointedBodies<T, J> {
    type Output = T;
    fn index(&self, i: usize) -> &T {
        let (body, parameter) = (i / PARAMETERS, i % PARAMETERS);
        if body == 0 { &self.base[parameter] } else { &self.links[body - 1][parameter] }
    }
}
impl<T: Scalar, const J: usize> IndexMut<usize> for JointedBodies<T, J> {
    fn index_mut(&mut self, i: usize) -> &mut T {
        let (body, parameter) = (i / PARAMETERS, i % PARAMETERS);
        if body == 0 { &mut self.base[parameter] } else { &mut self.links[body - 1][parameter] }
    }
}
impl<T: Scalar, const J: usize> Add for JointedBodies<T, J> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.zip(&other, |a, b| a + b)
    }
}
impl<T: Scalar, const J: usize> Sub for JointedBodies<T, J> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.zip(&other, |a, b| a - b)
    }
}
impl<T: Scalar, const J: usize> Neg for JointedBodies<T, J> {
    type Output = Self;
    fn neg(self) -> Self {
        Coordinates::from_fn(|i| -self[i])
    }
}
impl<T: Scalar, const J: usize> Mul<T> for JointedBodies<T, J> {
    type Output = Self;
    fn mul(self, factor: T) -> Self {
        Coordinates::from_fn(|i| self[i] * factor)
    }
}
impl<T: Scalar, const J: usize> Coordinates<T> for JointedBodies<T, J> {
    const DIM: usize = PARAMETERS * (J + 1);
    fn from_fn(mut component: impl FnMut(usize) -> T) -> Self {
        let mut bodies = Self { base: SVector::zeros(), links: [SVector::zeros(); J] };
        for i in 0..Self::DIM {
            bodies[i] = component(i);
        }
        bodies
    }
}

/// One step of a tree on a free base by a given integrator as a [`ParametricModel`]: the parameters are the bodies'.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MultibodyStep<I, const J: usize> {
    /// The tree; its bodies give way to the parameters.
    pub system: FreeMultibody<f64, J>,
    /// What steps it.
    pub integrator: I,
}

macro_rules! multibody_steps {
    ($($integrator:ty),*) => {$(
        impl<const J: usize> ParametricModel for MultibodyStep<$integrator, J> {
            type State<T: Scalar> = GroupState<FreeConfiguration<T, J>>;
            type Input<T: Scalar> = FreeInput<T, J>;
            type Parameters<T: Scalar> = JointedBodies<T, J>;
            fn lift<T: Scalar>(state: &Self::State<f64>) -> Self::State<T> {
                let velocity = Coordinates::from_fn(|i| real(state.velocity[i]));
                GroupState { configuration: FreeMultibody::<f64, J>::lift(&state.configuration), velocity }
            }
            fn step<T: Scalar>(
                &self,
                state: &Self::State<T>,
                input: &Self::Input<T>,
                parameters: &JointedBodies<T, J>,
                step_s: T,
            ) -> Result<Self::State<T>, DynamicsError> {
                let mut tree = self.system.tree.lifted::<T>();
                tree.base = InertialParameters::from_vector(&parameters.base);
                for (link, body) in tree.links.iter_mut().zip(&parameters.links) {
                    link.body = InertialParameters::from_vector(body);
                }
                let system = FreeMultibody { tree, gravity_world: self.system.gravity_world.map(real) };
                self.integrator.step(&system, state, input, T::zero(), step_s)
            }
        }
    )*};
}
multibody_steps!(LieEuler, RungeKutta4, MuntheKaas4);
