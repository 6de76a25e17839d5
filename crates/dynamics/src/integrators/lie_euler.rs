use crate::error::DynamicsError;
use crate::system::{Integrator, MechanicalSystem, ScalarOf};
use tumble_lie::Manifold;

/// The explicit Euler method on a manifold: `x_{k+1} = x_k ⊕ h f(x_k)`.
#[derive(Clone, Copy, Debug, Default)]
pub struct LieEuler;

impl<S: MechanicalSystem> Integrator<S> for LieEuler {
    fn order(&self) -> u32 {
        1
    }
    #[inline]
    fn step(
        &self,
        system: &S,
        state: &S::State,
        input: &S::Input,
        time_s: ScalarOf<S>,
        step_s: ScalarOf<S>,
    ) -> Result<S::State, DynamicsError> {
        Ok(state.oplus(&(system.vector_field(time_s, state, input)? * step_s)))
    }
}
