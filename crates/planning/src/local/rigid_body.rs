//! A rigid body moved by a wrench, as the local planner sees it.

mod arrays;
mod parameters;
mod step;
#[cfg(test)]
mod tests;
mod turning;

pub use parameters::{BodyParameters, Nuisance};

use super::model::{Array2, InformativeModel, KINEMATICS, Kinematics, Knowledge, StepDerivatives};
use crate::belief::ModelBelief;
use crate::error::PlanningError;
use arrays::{rotation, times};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use parameters::Believed;
use step::{Start, Step};
use tumble_dynamics::InertialParameters;
use tumble_lie::Manifold;
use tumble_lie::Pose;

/// A free rigid body with `P` unknown parameters: some or all of its inertial parameters, and nuisances.
///
/// One step is the classical Runge-Kutta method with the wrench held, on the centre of mass and the attitude quaternion, which
/// is normalised at the end. Without forces the momentum stays exactly.
/// # Frame
/// Inputs are `[torque; force]` about the body origin in body axes. The origin need not be the centre of mass.
/// # Source
/// Thesis (2.4), (4.1), (6.7), (6.8).
#[derive(Clone, Debug)]
pub struct RigidBodyModel<const P: usize> {
    parameters: BodyParameters,
    nuisances: Vec<(Nuisance, f64)>,
    believed: Option<Believed<P>>,
}

impl RigidBodyModel<4> {
    /// Unknown are the mass and the moments of inertia about the centre of mass; the rest is as believed.
    pub fn principal() -> Self {
        Self { parameters: BodyParameters::Principal, nuisances: Vec::new(), believed: None }
    }
}

impl RigidBodyModel<10> {
    /// All ten inertial parameters are unknown.
    pub fn full() -> Self {
        Self { parameters: BodyParameters::Full, nuisances: Vec::new(), believed: None }
    }
}

impl<const P: usize> RigidBodyModel<P> {
    /// The parameters of the body, then nuisances with their prior standard deviations.
    ///
    /// # Errors
    /// [`PlanningError::WrongCount`] where they are not `P` together; an axis that is none; a standard deviation that is
    /// not positive.
    pub fn with_nuisances(parameters: BodyParameters, nuisances: &[(Nuisance, f64)]) -> Result<Self, PlanningError> {
        parameters::check::<P>(parameters, nuisances)?;
        Ok(Self { parameters, nuisances: nuisances.to_vec(), believed: None })
    }

    /// The body at these coordinates; at zero it is the one believed. Nuisances do not change it.
    ///
    /// # Errors
    /// Where nothing is believed yet, and where no such body exists; with [`BodyParameters::Full`] every body exists.
    pub fn body_at(&self, eta: &[f64; P]) -> Result<InertialParameters<f64>, PlanningError> {
        self.believed.as_ref().ok_or(PlanningError::NoBelief)?.body_at(eta)
    }
}

impl<const P: usize> InformativeModel<12, 6, P> for RigidBodyModel<P> {
    type State = Kinematics;

    const FIRST_ACTIVE: usize = 6;

    fn retract(&self, state: &Kinematics, change: &[f64; 12]) -> Kinematics {
        state.oplus(&(*change).into())
    }

    fn difference(&self, to: &Kinematics, from: &Kinematics) -> [f64; 12] {
        to.ominus(from).into()
    }

    fn adopt(&mut self, belief: &ModelBelief) -> Result<Knowledge<P>, PlanningError> {
        let (believed, knowledge) = Believed::new(belief, self.parameters, &self.nuisances)?;
        self.believed = Some(believed);
        Ok(knowledge)
    }

    fn residual(&self, state: &Kinematics, reference: &Kinematics) -> ([f64; 12], Array2<12, 12>) {
        let position = state.position_world() - reference.position_world();
        let velocity = state.velocity_world - reference.velocity_world;
        let rate = state.rate_body - reference.rate_body;
        let difference =
            reference.world_from_body.rotation.inverse().into_inner() * state.world_from_body.rotation.into_inner();
        // of the two quaternions of an attitude, the one less than half a turn away
        let difference = if difference.w < 0.0 { -difference } else { difference };
        let (w, v) = (difference.w, difference.imag());
        let mut residual = [0.0; 12];
        let mut by_state = [[0.0; 12]; 12];
        for i in 0..3 {
            residual[i] = position[i];
            residual[3 + i] = velocity[i];
            residual[6 + i] = 2.0 * v[i];
            residual[9 + i] = rate[i];
        }
        for (i, row) in by_state.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        let turned = [[w, -v.z, v.y], [v.z, w, -v.x], [-v.y, v.x, w]];
        for (row, turned) in by_state[6..9].iter_mut().zip(turned) {
            row[6..9].copy_from_slice(&turned);
        }
        (residual, by_state)
    }

    fn kinematics(&self, state: &Kinematics) -> Kinematics {
        *state
    }

    fn kinematics_by_state(&self, _state: &Kinematics) -> Array2<KINEMATICS, 12> {
        core::array::from_fn(|i| core::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }))
    }

    fn acceleration_by_input(&self) -> Array2<6, 6> {
        self.believed.as_ref().map_or([[0.0; 6]; 6], |believed| believed.body.acceleration_by_input())
    }

    fn center_of_mass_m(&self) -> f64 {
        self.believed.as_ref().map_or(0.0, |believed| {
            let [x, y, z] = believed.body.center_of_mass;
            f64::sqrt(x * x + y * y + z * z)
        })
    }

    fn principal_moments(&self) -> Option<Vector3<f64>> {
        self.body_at(&[0.0; P]).ok().map(|body| body.inertia_about_com().symmetric_eigenvalues())
    }

    fn step(
        &self,
        state: &Kinematics,
        sensitivity: &Array2<P, 12>,
        input: &[f64; 6],
        step_s: f64,
    ) -> Option<(Kinematics, Array2<P, 12>)> {
        let believed = self.believed.as_ref()?;
        let start = start(state, input, step_s);
        let step = Step::new(&believed.body, &start);
        let mut moved = *sensitivity;
        for (phi, direction) in moved.iter_mut().zip(&believed.directions) {
            *phi = step.sensitivity(direction, phi);
        }
        end(state, &start, &step).map(|end| (end, moved))
    }

    fn differentiate(
        &self,
        state: &Kinematics,
        sensitivity: &Array2<P, 12>,
        input: &[f64; 6],
        step_s: f64,
        derivatives: &mut StepDerivatives<12, 6, P>,
    ) -> Option<(Kinematics, Array2<P, 12>)> {
        let believed = self.believed.as_ref()?;
        let start = start(state, input, step_s);
        let step = Step::new(&believed.body, &start);
        let moved = step.differentiate(&believed.directions, sensitivity, derivatives);
        end(state, &start, &step).map(|end| (end, moved))
    }
}

fn start(state: &Kinematics, input: &[f64; 6], step_s: f64) -> Start {
    let q = &state.world_from_body.rotation;
    let q = [q.w, q.i, q.j, q.k];
    let [t0, t1, t2, f0, f1, f2] = *input;
    let (torque, force) = ([t0, t1, t2], [f0, f1, f2]);
    Start { world_from_body: rotation(&q, &q), rate: state.rate_body.into(), torque, force, step_s }
}

fn end(state: &Kinematics, start: &Start, step: &Step<'_>) -> Option<Kinematics> {
    let [w, i, j, k] = step.attitude();
    let turned = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
    let [position, velocity] = [step.position, step.velocity].map(|way| times(&start.world_from_body, &way));
    let end = Kinematics {
        world_from_body: Pose::from_parts(
            (state.position_world() + state.velocity_world * start.step_s + Vector3::from(position)).into(),
            state.world_from_body.rotation * turned,
        ),
        velocity_world: state.velocity_world + Vector3::from(velocity),
        rate_body: step.rate().into(),
    };
    end.is_finite().then_some(end)
}
