//! A flight with known inputs, measured with noise, and the estimate of the body from it: what predicted standard deviations
//! are held against. Independent of the planner: the steps are those of `tumble-dynamics`, the derivatives dual numbers.

#![allow(dead_code, missing_docs, clippy::unwrap_used)]

use core::f64::consts::TAU;
use rand_chacha::ChaCha8Rng;
use tumble_identification::noise::unit_interval;
use tumble_planning::dynamics::{
    FreeFlyerStep, InertialParameters, PARAMETERS, ParametricModel, RigidBodyState, RungeKutta4, linearize,
};
use tumble_planning::lie::{LieGroup, skew};
use tumble_planning::local::body_by_principal;
use tumble_planning::nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3, Vector6};

/// Most Gauss-Newton steps.
const ITERATIONS: usize = 50;
/// Most halvings of a step.
const HALVINGS: usize = 30;
/// A step below this share of the standard deviations ends the search.
const SMALL: f64 = 1e-6;

/// Quantities of a body that are to be estimated.
pub trait BodyQuantities<const P: usize> {
    /// The body with these quantities, none where there is no such body.
    fn body(&self, quantities: &SVector<f64, P>) -> Option<InertialParameters<f64>>;
    /// Change of [`InertialParameters::to_vector`] by them.
    fn body_by_quantity(&self, body: &InertialParameters<f64>) -> SMatrix<f64, PARAMETERS, P>;
}

/// Mass and moments of inertia about the centre of mass, which is the origin, as are the axes the principal ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PrincipalBody;

impl BodyQuantities<4> for PrincipalBody {
    fn body(&self, quantities: &SVector<f64, 4>) -> Option<InertialParameters<f64>> {
        let inertia = Matrix3::from_diagonal(&quantities.fixed_rows::<3>(1).into_owned());
        let is_body = quantities.iter().all(|quantity| *quantity > 0.0);
        is_body.then(|| InertialParameters::about_com(quantities[0], Vector3::zeros(), inertia))
    }
    fn body_by_quantity(&self, body: &InertialParameters<f64>) -> SMatrix<f64, PARAMETERS, 4> {
        body_by_principal(body)
    }
}

/// Inputs held for equal steps from a known state, and how the nodes after them are measured.
#[derive(Clone, Debug)]
pub struct MeasuredFlight {
    /// The state at its start.
    pub start: RigidBodyState<f64>,
    /// `[torque; force]`, body axes, one per step.
    pub inputs: Vec<Vector6<f64>>,
    /// Length of a step, s.
    pub step_s: f64,
    /// Standard deviation of the measurement of each coordinate, in the order of [`tumble_planning::local::Kinematics`]' changes; infinite
    /// where there is none.
    pub sigma: [f64; 12],
}

/// One measured node: position and velocity in world axes, attitude, rate in body axes.
pub type Measurement = (Vector3<f64>, Vector3<f64>, UnitQuaternion<f64>, Vector3<f64>);

/// What was estimated from one flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightEstimate<const P: usize> {
    /// The quantities.
    pub quantities: SVector<f64, P>,
    /// Their covariance by the curvature at the estimate.
    pub covariance: SMatrix<f64, P, P>,
}

fn reading(state: &RigidBodyState<f64>) -> Measurement {
    let pose = &state.world_from_body;
    (pose.translation.vector, pose.rotation * state.twist_body.linear, pose.rotation, state.twist_body.angular)
}

fn stacked(parts: &[Vector3<f64>; 4]) -> SVector<f64, 12> {
    SVector::from_iterator(parts.iter().flat_map(|part| part.iter().copied()))
}

/// Change of what is measured by the increment of the state: `[pose (angular, linear); twist (angular, linear)]`, right.
fn reading_by_state(state: &RigidBodyState<f64>) -> SMatrix<f64, 12, 12> {
    let world_from_body = state.world_from_body.rotation.to_rotation_matrix().into_inner();
    let mut by_state = SMatrix::<f64, 12, 12>::zeros();
    by_state.fixed_view_mut::<3, 3>(0, 3).copy_from(&world_from_body);
    by_state.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-world_from_body * skew(&state.twist_body.linear)));
    by_state.fixed_view_mut::<3, 3>(3, 9).copy_from(&world_from_body);
    by_state.fixed_view_mut::<3, 3>(6, 0).copy_from(&Matrix3::identity());
    by_state.fixed_view_mut::<3, 3>(9, 6).copy_from(&Matrix3::identity());
    by_state
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || unit_interval(rng);
    let radius = f64::sqrt(-2.0 * (1.0 - uniform()).ln());
    radius * (TAU * uniform()).cos()
}

/// A draw with this mean and covariance.
pub fn drawn<const P: usize>(
    mean: &SVector<f64, P>,
    covariance: &SMatrix<f64, P, P>,
    rng: &mut ChaCha8Rng,
) -> Option<SVector<f64, P>> {
    let noise = SVector::from_fn(|_, _| normal(rng));
    Some(mean + covariance.cholesky()?.l() * noise)
}

impl MeasuredFlight {
    fn fly(&self, body: &InertialParameters<f64>) -> Option<Vec<RigidBodyState<f64>>> {
        let parameters = body.to_vector();
        let mut state = self.start;
        let step = |input: &Vector6<f64>| {
            state = FreeFlyerStep(RungeKutta4).step(&state, input, &parameters, self.step_s).ok()?;
            Some(state)
        };
        self.inputs.iter().map(step).collect()
    }

    fn weights(&self) -> SVector<f64, 12> {
        SVector::from(self.sigma.map(|sigma| 1.0 / (sigma * sigma)))
    }

    /// Measurements of a flight of this body, with noise.
    pub fn measured(&self, body: &InertialParameters<f64>, rng: &mut ChaCha8Rng) -> Option<Vec<Measurement>> {
        let sigma = self.sigma.map(|sigma| if sigma.is_finite() { sigma } else { 0.0 });
        let mut noise = |first: usize| Vector3::from_fn(|axis, _| sigma[first + axis] * normal(rng));
        let measure = |state: RigidBodyState<f64>| {
            let (position, velocity, attitude, rate) = reading(&state);
            let turned = attitude * UnitQuaternion::new(noise(6));
            (position + noise(0), velocity + noise(3), turned, rate + noise(9))
        };
        Some(self.fly(body)?.into_iter().map(measure).collect())
    }

    /// Half the weighted sum of squares of the residuals.
    fn misfit(&self, body: &InertialParameters<f64>, measured: &[Measurement]) -> Option<f64> {
        let weights = self.weights();
        let states = self.fly(body)?;
        let misfits = states.iter().zip(measured).map(|(state, measured)| {
            let residual = residual(state, measured);
            0.5 * residual.component_mul(&residual).dot(&weights)
        });
        Some(misfits.sum())
    }

    /// Information about the quantities from all nodes, and the gradient of half the weighted sum of squares, negative.
    fn normal_equations<const P: usize>(
        &self,
        body: &InertialParameters<f64>,
        by_quantity: &SMatrix<f64, PARAMETERS, P>,
        measured: Option<&[Measurement]>,
    ) -> Option<(SMatrix<f64, P, P>, SVector<f64, P>)> {
        let weights = SMatrix::<f64, 12, 12>::from_diagonal(&self.weights());
        let mut state = self.start;
        let mut sensitivity = SMatrix::<f64, 12, P>::zeros();
        let (mut information, mut gradient) = (SMatrix::zeros(), SVector::zeros());
        for (node, input) in self.inputs.iter().enumerate() {
            let step = linearize(&FreeFlyerStep(RungeKutta4), &state, input, &body.to_vector(), self.step_s).ok()?;
            let by_state = SMatrix::<f64, 12, 12>::from_columns(&step.by_state);
            let by_parameters = SMatrix::<f64, 12, PARAMETERS>::from_columns(&step.by_parameters);
            sensitivity = by_state * sensitivity + by_parameters * by_quantity;
            state = step.end;
            let by_quantities = reading_by_state(&state) * sensitivity;
            information += by_quantities.transpose() * weights * by_quantities;
            if let Some(measured) = measured {
                gradient += by_quantities.transpose() * weights * residual(&state, measured.get(node)?);
            }
        }
        Some((information, gradient))
    }

    /// Information that the measurements give about the quantities of this body, the prior not included: thesis (6.4).
    pub fn information<const P: usize>(
        &self,
        quantities: &impl BodyQuantities<P>,
        body: &InertialParameters<f64>,
    ) -> Option<SMatrix<f64, P, P>> {
        self.normal_equations(body, &quantities.body_by_quantity(body), None).map(|(information, _)| information)
    }

    /// Batch estimate: damped Gauss-Newton from the prior mean, the prior information added.
    pub fn estimate<const P: usize>(
        &self,
        quantities: &impl BodyQuantities<P>,
        measured: &[Measurement],
        prior_mean: &SVector<f64, P>,
        prior_information: &SMatrix<f64, P, P>,
    ) -> Option<FlightEstimate<P>> {
        let cost = |at: &SVector<f64, P>| -> Option<f64> {
            let off = at - prior_mean;
            let cost = self.misfit(&quantities.body(at)?, measured)? + 0.5 * off.dot(&(prior_information * off));
            cost.is_finite().then_some(cost)
        };
        let mut at = *prior_mean;
        let mut before = cost(&at)?;
        for _ in 0..ITERATIONS {
            let body = quantities.body(&at)?;
            let by_quantity = quantities.body_by_quantity(&body);
            let (information, gradient) = self.normal_equations(&body, &by_quantity, Some(measured))?;
            let covariance = (information + prior_information).cholesky()?.inverse();
            let mut step = covariance * (gradient - prior_information * (at - prior_mean));
            let is_small = (0..P).all(|i| step[i].abs() <= SMALL * f64::sqrt(covariance[(i, i)]));
            if is_small {
                return Some(FlightEstimate { quantities: at + step, covariance });
            }
            let mut halvings = 0;
            let after = loop {
                if let Some(after) = cost(&(at + step)).filter(|after| *after <= before * (1.0 + 1e-12)) {
                    break after;
                }
                halvings += 1;
                if halvings > HALVINGS {
                    return None;
                }
                step *= 0.5;
            };
            at += step;
            before = after;
        }
        None
    }
}

fn residual(state: &RigidBodyState<f64>, measured: &Measurement) -> SVector<f64, 12> {
    let (position, velocity, attitude, rate) = reading(state);
    let turn = LieGroup::log(&(attitude.inverse() * measured.2));
    stacked(&[measured.0 - position, measured.1 - velocity, turn, measured.3 - rate])
}
