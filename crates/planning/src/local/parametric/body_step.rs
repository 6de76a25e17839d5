//! The body in space by other integrators than the one with derivatives by hand.

use super::{BelievedParameters, ParametricInformative, UncertainBody};
use crate::belief::ModelBelief;
use crate::error::PlanningError;
use crate::local::about_com::{body_by_mass_center_and_inertia, sizes_about_com};
use crate::local::knowledge::{QUANTITIES, covariance_about_com};
use crate::local::model::{KINEMATICS, Kinematics};
use nalgebra::{SMatrix, SVector, Vector3, Vector6};
use tumble_dynamics::{
    DynamicsError, FreeFlyerIntegrator, FreeFlyerStep, InertialParameters, MuntheKaas4, PARAMETERS, ParametricModel,
    RigidBodyState, VariationalFreeFlyer,
};
use tumble_lie::{Scalar, Twist, real};

/// A step of a free rigid body between motions given in world axes: [`FreeFlyerStep`] with the state and the coordinates of
/// [`crate::local::RigidBodyModel`], so that settings, references and obstacles mean the same. Any [`FreeFlyerIntegrator`] steps it,
/// the user's own too.
#[derive(Clone, Copy, Debug, Default)]
pub struct BodyStep<I>(pub I);

/// The body in space stepped by the variational integrator: `P` is 4 (mass and moments of inertia about the centre of mass) or
/// 10 (all).
///
/// # Source
/// Thesis 6.1 (future work), (5.17)-(5.20).
pub type VariationalBodyModel<const P: usize> = ParametricInformative<BodyStep<VariationalFreeFlyer>, KINEMATICS, 6, P>;

/// The body in space stepped by the Munthe-Kaas method of fourth order.
pub type MuntheKaasBodyModel<const P: usize> = ParametricInformative<BodyStep<MuntheKaas4>, KINEMATICS, 6, P>;

/// Places of mass and moments of inertia among [`QUANTITIES`].
const PRINCIPAL: [usize; 4] = [0, 4, 7, 9];
const ALL: [usize; PARAMETERS] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9];

/// The body of a belief of which the quantities at these places are unknown.
fn body_with_unknown<const P: usize>(
    belief: &ModelBelief,
    places: [usize; P],
) -> Result<BelievedParameters<SVector<f64, PARAMETERS>, P>, PlanningError> {
    let covariance = covariance_about_com(belief)?;
    let by_quantity = body_by_mass_center_and_inertia(belief.parameters());
    let sizes = sizes_about_com(belief.parameters());
    BelievedParameters::correlated(
        belief.parameters().to_vector(),
        places.map(|place| by_quantity.column(place).into_owned()),
        &SMatrix::from_fn(|i, j| covariance[(places[i], places[j])]),
        &places.map(|place| sizes[place]),
        places.map(|place| QUANTITIES[place]),
    )
}

fn to_body_axes<T: Scalar>(motion: &Kinematics<T>) -> RigidBodyState<T> {
    let Kinematics { world_from_body, velocity_world, rate_body } = *motion;
    let velocity_body = world_from_body.rotation.inverse_transform_vector(&velocity_world);
    RigidBodyState { world_from_body, twist_body: Twist::new(rate_body, velocity_body) }
}

fn to_world_axes<T: Scalar>(state: &RigidBodyState<T>) -> Kinematics<T> {
    let (world_from_body, twist) = (state.world_from_body, state.twist_body);
    let velocity_world = world_from_body.rotation * twist.linear;
    Kinematics { world_from_body, velocity_world, rate_body: twist.angular }
}

/// Position, velocity, twice the vector part of the attitude error's quaternion (the one less than half a turn), rate.
fn residual<T: Scalar>(state: &Kinematics<T>, reference: &Kinematics<T>) -> SVector<T, KINEMATICS> {
    let position = state.world_from_body.translation.vector - reference.world_from_body.translation.vector;
    let error = reference.world_from_body.rotation.inverse() * state.world_from_body.rotation;
    let twice: T = real(if error.w < T::zero() { -2.0 } else { 2.0 });
    let (velocity, rate) = (state.velocity_world - reference.velocity_world, state.rate_body - reference.rate_body);
    let parts = [position, velocity, error.imag() * twice, rate];
    SVector::from_fn(|i, _| parts[i / 3][i % 3])
}

impl<I: FreeFlyerIntegrator + Copy> ParametricModel for BodyStep<I> {
    type State<T: Scalar> = Kinematics<T>;
    type Input<T: Scalar> = Vector6<T>;
    type Parameters<T: Scalar> = SVector<T, PARAMETERS>;
    fn lift<T: Scalar>(state: &Kinematics<f64>) -> Kinematics<T> {
        state.lifted()
    }
    fn step<T: Scalar>(
        &self,
        state: &Kinematics<T>,
        wrench_body: &Vector6<T>,
        parameters: &SVector<T, PARAMETERS>,
        step_s: T,
    ) -> Result<Kinematics<T>, DynamicsError> {
        let end = FreeFlyerStep(self.0).step(&to_body_axes(state), wrench_body, parameters, step_s)?;
        Ok(to_world_axes(&end))
    }
}

macro_rules! uncertain_bodies {
    ($($unknown:literal, $places:ident);*) => {$(
        impl<I: FreeFlyerIntegrator + Copy> UncertainBody<$unknown> for BodyStep<I> {
            /// Where the body is does not matter; how fast it moves does, to the accuracy of the step.
            const FIRST_ACTIVE: usize = 3;
            fn believed(
                &self,
                belief: &ModelBelief,
            ) -> Result<BelievedParameters<SVector<f64, PARAMETERS>, $unknown>, PlanningError> {
                body_with_unknown(belief, $places)
            }
            fn center_of_mass_m(&self, parameters: &SVector<f64, PARAMETERS>) -> f64 {
                f64::sqrt(InertialParameters::from_vector(parameters).center_of_mass().norm_squared())
            }
            fn principal_moments(&self, parameters: &SVector<f64, PARAMETERS>) -> Option<Vector3<f64>> {
                Some(InertialParameters::from_vector(parameters).inertia_about_com().symmetric_eigenvalues())
            }
            fn at_rest(&self) -> Kinematics {
                to_world_axes(&RigidBodyState::at_rest())
            }
            fn kinematics<T: Scalar>(&self, state: &Kinematics<T>) -> Kinematics<T> {
                *state
            }
            fn residual<T: Scalar>(
                &self,
                state: &Kinematics<T>,
                reference: &Kinematics<T>,
            ) -> SVector<T, KINEMATICS> {
                residual(state, reference)
            }
        }
    )*};
}
uncertain_bodies!(4, PRINCIPAL; 10, ALL);
