//! The state of one free rigid body, and of any system on a Lie group.

use core::ops::{Add, Index, IndexMut, Mul, Neg, Sub};
use tumble_lie::nalgebra::{SVector, Vector6, convert};
use tumble_lie::{Coordinates, LieGroup, Manifold, Pose, Scalar, Twist};

/// Pose and velocity of a rigid body.
///
/// # Frame
/// `world_from_body` maps body to inertial; the twist is that of the body origin in body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidBodyState<T: Scalar> {
    /// Pose of the body frame in the inertial frame.
    pub world_from_body: Pose<T>,
    /// `[omega; v_origin]`, body axes, rad/s and m/s.
    pub twist_body: Twist<T>,
}

impl<T: Scalar> RigidBodyState<T> {
    /// At the inertial origin, at rest.
    pub fn at_rest() -> Self {
        Self { world_from_body: Pose::identity(), twist_body: Twist::zero() }
    }
}

impl RigidBodyState<f64> {
    /// The same state over another scalar, with zero derivatives.
    pub fn lifted<T: Scalar>(&self) -> RigidBodyState<T> {
        RigidBodyState {
            world_from_body: convert(self.world_from_body),
            twist_body: convert::<Vector6<f64>, Vector6<T>>(self.twist_body.to_vector()).into(),
        }
    }
}

impl<T: Scalar> Manifold for RigidBodyState<T> {
    type Scalar = T;
    /// `[pose increment (angular, linear); twist increment (angular, linear)]`.
    type Tangent = SVector<T, 12>;
    fn oplus(&self, xi: &SVector<T, 12>) -> Self {
        let pose = Vector6::from_fn(|i, _| xi[i]);
        let twist = Vector6::from_fn(|i, _| xi[6 + i]);
        Self { world_from_body: self.world_from_body.oplus(&pose), twist_body: self.twist_body + Twist::from(twist) }
    }
    fn ominus(&self, base: &Self) -> SVector<T, 12> {
        let pose = LieGroup::log(&base.world_from_body.between(&self.world_from_body));
        let twist = (self.twist_body - base.twist_body).to_vector();
        SVector::from_fn(|i, _| if i < 6 { pose[i] } else { twist[i - 6] })
    }
    fn increment_rate(xi: &SVector<T, 12>, velocity: &SVector<T, 12>) -> SVector<T, 12> {
        let pose = Pose::increment_rate(&Vector6::from_fn(|i, _| xi[i]), &Vector6::from_fn(|i, _| velocity[i]));
        SVector::from_fn(|i, _| if i < 6 { pose[i] } else { velocity[i] })
    }
}

/// A state that is a configuration and its velocity: what a Lagrangian system has.
///
/// # Example
/// ```
/// use tumble_dynamics::lie::{Coordinates, LieGroup};
/// use tumble_dynamics::{LagrangianState, RigidBodyState};
///
/// /// The same configuration, twice as fast.
/// fn faster<S: LagrangianState<Scalar = f64>>(state: &S) -> S {
///     S::from_parts(state.configuration(), state.velocity() * 2.0)
/// }
/// let mut state = RigidBodyState::<f64>::at_rest();
/// state.twist_body.linear.x = 0.1;
/// assert_eq!(faster(&state).velocity().euclidean_norm(), 0.2);
/// ```
/// Tutorial: [a Lagrangian of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/dynamics/tests/suite/custom_lagrangian.rs), whose state is a [`GroupState`].
pub trait LagrangianState: Manifold {
    /// The configuration group.
    type Group: LieGroup<Scalar = Self::Scalar>;
    /// From the two halves.
    fn from_parts(configuration: Self::Group, velocity: <Self::Group as LieGroup>::Tangent) -> Self;
    /// The configuration.
    fn configuration(&self) -> Self::Group;
    /// The left-trivialised velocity `g^-1 dg/dt` (body axes for a pose).
    fn velocity(&self) -> <Self::Group as LieGroup>::Tangent;
}

impl<T: Scalar> LagrangianState for RigidBodyState<T> {
    type Group = Pose<T>;
    fn from_parts(world_from_body: Pose<T>, twist_body: Vector6<T>) -> Self {
        Self { world_from_body, twist_body: twist_body.into() }
    }
    fn configuration(&self) -> Pose<T> {
        self.world_from_body
    }
    fn velocity(&self) -> Vector6<T> {
        self.twist_body.to_vector()
    }
}

/// Configuration in any Lie group and left-trivialised velocity.
#[derive(Clone, Copy, Debug)]
pub struct GroupState<G: LieGroup> {
    /// Configuration.
    pub configuration: G,
    /// `g^-1 dg/dt`.
    pub velocity: <G as LieGroup>::Tangent,
}

impl<G: LieGroup> LagrangianState for GroupState<G> {
    type Group = G;
    fn from_parts(configuration: G, velocity: <G as LieGroup>::Tangent) -> Self {
        Self { configuration, velocity }
    }
    fn configuration(&self) -> G {
        self.configuration
    }
    fn velocity(&self) -> <G as LieGroup>::Tangent {
        self.velocity
    }
}

impl<G: LieGroup> Manifold for GroupState<G> {
    type Scalar = <G as LieGroup>::Scalar;
    type Tangent = GroupTangent<G>;
    fn oplus(&self, xi: &GroupTangent<G>) -> Self {
        Self { configuration: self.configuration.oplus(&xi.configuration), velocity: self.velocity + xi.velocity }
    }
    fn ominus(&self, base: &Self) -> GroupTangent<G> {
        GroupTangent {
            configuration: self.configuration.ominus(&base.configuration),
            velocity: self.velocity - base.velocity,
        }
    }
    fn increment_rate(xi: &GroupTangent<G>, velocity: &GroupTangent<G>) -> GroupTangent<G> {
        GroupTangent { configuration: G::increment_rate(&xi.configuration, &velocity.configuration), ..*velocity }
    }
}

/// Increment of a [`GroupState`]: coordinates of the configuration's increment, then of the velocity's.
#[derive(Clone, Copy, Debug)]
pub struct GroupTangent<G: LieGroup> {
    /// Increment of the configuration.
    pub configuration: <G as LieGroup>::Tangent,
    /// Increment of the velocity.
    pub velocity: <G as LieGroup>::Tangent,
}

impl<G: LieGroup> GroupTangent<G> {
    const HALF: usize = <<G as LieGroup>::Tangent as Coordinates<<G as LieGroup>::Scalar>>::DIM;
}
impl<G: LieGroup> Add for GroupTangent<G> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { configuration: self.configuration + other.configuration, velocity: self.velocity + other.velocity }
    }
}
impl<G: LieGroup> Sub for GroupTangent<G> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { configuration: self.configuration - other.configuration, velocity: self.velocity - other.velocity }
    }
}
impl<G: LieGroup> Neg for GroupTangent<G> {
    type Output = Self;
    fn neg(self) -> Self {
        Self { configuration: -self.configuration, velocity: -self.velocity }
    }
}
impl<G: LieGroup> Mul<<G as LieGroup>::Scalar> for GroupTangent<G> {
    type Output = Self;
    fn mul(self, factor: <G as LieGroup>::Scalar) -> Self {
        Self { configuration: self.configuration * factor, velocity: self.velocity * factor }
    }
}
impl<G: LieGroup> Index<usize> for GroupTangent<G> {
    type Output = <G as LieGroup>::Scalar;
    fn index(&self, i: usize) -> &Self::Output {
        if i < Self::HALF { &self.configuration[i] } else { &self.velocity[i - Self::HALF] }
    }
}
impl<G: LieGroup> IndexMut<usize> for GroupTangent<G> {
    fn index_mut(&mut self, i: usize) -> &mut Self::Output {
        if i < Self::HALF { &mut self.configuration[i] } else { &mut self.velocity[i - Self::HALF] }
    }
}
impl<G: LieGroup> Coordinates<<G as LieGroup>::Scalar> for GroupTangent<G> {
    const DIM: usize = 2 * Self::HALF;
    fn from_fn(mut component: impl FnMut(usize) -> <G as LieGroup>::Scalar) -> Self {
        let configuration = <G as LieGroup>::Tangent::from_fn(&mut component);
        Self { configuration, velocity: <G as LieGroup>::Tangent::from_fn(|i| component(Self::HALF + i)) }
    }
}
