//! What the generic variational integrator asks of a system (feature `dual`).

use crate::free_flyer::FreeFlyer;
use crate::inertia::InertialParameters;
use crate::momentum::{discrete_lagrangian, kinetic_energy};
use crate::oscillator::Oscillator;
use crate::pivoted_body::PivotedBody;
use crate::planar::{PlanarBody, PlanarWrench};
use crate::system::MechanicalSystem;
use tumble_lie::nalgebra::{Isometry2, SVector, Translation, UnitQuaternion, Vector1, Vector3, Vector6, convert};
use tumble_lie::{Increment, LieGroup, Pose, Scalar, Twist, Wrench, real};

/// Configuration group of a system over the scalar `T`.
pub type GroupOf<S, T> = <S as DiscreteLagrangian>::Group<T>;
/// Left-trivialised velocity, or momentum, of a system over the scalar `T`.
pub type VelocityOf<S, T> = <GroupOf<S, T> as LieGroup>::Tangent;

/// A mechanical system on a Lie group given by its Lagrangian.
///
/// Written once, generic over the scalar; the integrator takes every derivative it needs by dual numbers.
/// The system's state is any [`crate::LagrangianState`] on the same group.
///
/// # Example
/// ```
/// use tumble_dynamics::lie::{Scalar, real};
/// use tumble_dynamics::nalgebra::{Translation1, Vector1};
/// use tumble_dynamics::{DiscreteLagrangian, DynamicsError, GroupState, GroupTangent, Integrator, MechanicalSystem, Variational};
///
/// /// A mass on a spring, one rad/s; the input is an acceleration, m/s^2.
/// struct Spring;
/// impl MechanicalSystem for Spring {
///     type State = GroupState<Translation1<f64>>;
///     type Input = Vector1<f64>;
///     fn vector_field(&self, _time_s: f64, state: &Self::State, push: &Vector1<f64>)
///         -> Result<GroupTangent<Translation1<f64>>, DynamicsError> {
///         Ok(GroupTangent { configuration: state.velocity, velocity: push - state.configuration.vector })
///     }
/// }
/// impl DiscreteLagrangian for Spring {
///     type Group<T: Scalar> = Translation1<T>;
///     fn lift<T: Scalar>(x: &Translation1<f64>) -> Translation1<T> {
///         Translation1::from(x.vector.map(real))
///     }
///     fn lagrangian<T: Scalar>(&self, x: &Translation1<T>, v: &Vector1<T>) -> T {
///         (v.norm_squared() - x.vector.norm_squared()) * real(0.5)
///     }
///     fn force(&self, _time_s: f64, _x: &Translation1<f64>, _v: &Vector1<f64>, push: &Vector1<f64>) -> Vector1<f64> {
///         *push
///     }
/// }
/// let energy = |state: &GroupState<Translation1<f64>>| {
///     0.5 * (state.velocity.norm_squared() + state.configuration.vector.norm_squared())
/// };
/// let mut state = GroupState { configuration: Translation1::new(1.0), velocity: Vector1::zeros() };
/// for step in 0..1000 {
///     state = Variational.step(&Spring, &state, &Vector1::zeros(), 0.1 * f64::from(step), 0.1)?;
/// }
/// assert!((energy(&state) - 0.5).abs() < 2e-3); // after sixteen swings, with steps of a tenth of a second
/// # Ok::<(), DynamicsError>(())
/// ```
/// Tutorial: [a Lagrangian of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/dynamics/tests/suite/custom_lagrangian.rs).
pub trait DiscreteLagrangian: MechanicalSystem {
    /// Configuration group.
    type Group<T: Scalar>: LieGroup<Scalar = T>;

    /// The same configuration over another scalar.
    fn lift<T: Scalar>(configuration: &GroupOf<Self, f64>) -> GroupOf<Self, T>;

    /// Kinetic minus potential energy at a left-trivialised velocity, J.
    fn lagrangian<T: Scalar>(&self, configuration: &GroupOf<Self, T>, velocity: &VelocityOf<Self, T>) -> T;

    /// Approximate action between two configurations `step_s` apart, J s; not a number outside its domain.
    ///
    /// Unless given: the Lagrangian at the middle of the geodesic, of second order and symmetric.
    fn discrete_lagrangian<T: Scalar>(&self, from: &GroupOf<Self, T>, to: &GroupOf<Self, T>, step_s: T) -> T {
        let increment = LieGroup::log(&from.between(to));
        let middle = from.compose(&<GroupOf<Self, T> as LieGroup>::exp(&(increment * real::<T>(0.5))));
        self.lagrangian(&middle, &(increment * (T::one() / step_s))) * step_s
    }

    /// Left-trivialised force besides the potential's: the held input and what else acts on the system.
    ///
    /// Half of its impulse over a step acts at each end.
    fn force(
        &self,
        time_s: f64,
        configuration: &GroupOf<Self, f64>,
        velocity: &VelocityOf<Self, f64>,
        input: &Self::Input,
    ) -> VelocityOf<Self, f64>;
}

fn lift_parameters<T: Scalar>(body: &InertialParameters<f64>) -> InertialParameters<T> {
    InertialParameters::from_vector(&SVector::from_fn(|i, _| real(body.to_vector()[i])))
}

impl DiscreteLagrangian for FreeFlyer<f64> {
    type Group<T: Scalar> = Pose<T>;
    fn lift<T: Scalar>(world_from_body: &Pose<f64>) -> Pose<T> {
        convert(*world_from_body)
    }
    fn lagrangian<T: Scalar>(&self, _world_from_body: &Pose<T>, twist_body: &Vector6<T>) -> T {
        kinetic_energy(&lift_parameters(self.parameters()), &Twist::from(*twist_body))
    }
    /// `(2/h) [Phi; Psi]^T M [Phi; Psi]`, (5.14).
    fn discrete_lagrangian<T: Scalar>(&self, from: &Pose<T>, to: &Pose<T>, step_s: T) -> T {
        Increment::between(from, to).map_or(real(f64::NAN), |increment| {
            discrete_lagrangian(&lift_parameters(self.parameters()), &increment, step_s)
        })
    }
    fn force(&self, _: f64, _: &Pose<f64>, _: &Vector6<f64>, wrench_body: &Wrench<f64>) -> Vector6<f64> {
        wrench_body.to_vector()
    }
}

impl DiscreteLagrangian for PlanarBody<f64> {
    type Group<T: Scalar> = Isometry2<T>;
    fn lift<T: Scalar>(world_from_body: &Isometry2<f64>) -> Isometry2<T> {
        convert(*world_from_body)
    }
    fn lagrangian<T: Scalar>(&self, _world_from_body: &Isometry2<T>, velocity: &Vector3<T>) -> T {
        PlanarBody::<T> {
            mass: real(self.mass),
            center_of_mass: self.center_of_mass.map(real),
            inertia_about_com: real(self.inertia_about_com),
        }
        .kinetic_energy(velocity)
    }
    fn force(&self, _: f64, _: &Isometry2<f64>, _: &Vector3<f64>, wrench_body: &PlanarWrench<f64>) -> Vector3<f64> {
        Vector3::new(wrench_body.torque, wrench_body.force.x, wrench_body.force.y)
    }
}

impl DiscreteLagrangian for PivotedBody<f64> {
    type Group<T: Scalar> = UnitQuaternion<T>;
    fn lift<T: Scalar>(world_from_body: &UnitQuaternion<f64>) -> UnitQuaternion<T> {
        convert(*world_from_body)
    }
    fn lagrangian<T: Scalar>(&self, world_from_body: &UnitQuaternion<T>, rate_body: &Vector3<T>) -> T {
        let body = PivotedBody::<T> {
            inertia_about_pivot: self.inertia_about_pivot.map(real),
            first_moment: self.first_moment.map(real),
            gravity_world: self.gravity_world.map(real),
        };
        body.kinetic_energy(rate_body) - body.potential_energy(world_from_body)
    }
    fn force(&self, _: f64, _: &UnitQuaternion<f64>, _: &Vector3<f64>, torque_body: &Vector3<f64>) -> Vector3<f64> {
        *torque_body
    }
}

impl DiscreteLagrangian for Oscillator<f64> {
    type Group<T: Scalar> = Translation<T, 1>;
    fn lift<T: Scalar>(position: &Translation<f64, 1>) -> Translation<T, 1> {
        convert(*position)
    }
    fn lagrangian<T: Scalar>(&self, position: &Translation<T, 1>, velocity: &Vector1<T>) -> T {
        let body = Oscillator::<T> { mass_kg: real(self.mass_kg), stiffness_n_per_m: real(self.stiffness_n_per_m) };
        body.kinetic_energy(velocity.x) - body.potential_energy(position.vector.x)
    }
    fn force(&self, _: f64, _: &Translation<f64, 1>, _: &Vector1<f64>, force: &Vector1<f64>) -> Vector1<f64> {
        *force
    }
}
