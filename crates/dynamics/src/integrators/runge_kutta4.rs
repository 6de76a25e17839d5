use crate::error::DynamicsError;
use crate::system::{Integrator, MechanicalSystem, ScalarOf};
use tumble_lie::{Manifold, real};

/// The classical Runge-Kutta method of order 4, in its commutator-free form on manifolds.
///
/// On a vector space it is the classical method, term for term. On a Lie group adding the four slopes of the
/// classical method in one exponential has order 2 only; two exponentials, of the early and of the late slopes,
/// restore order 4 without brackets or Jacobians, so that any [`Manifold`] qualifies.
/// # Source
/// Celledoni, Marthinsen, Owren: Commutator-free Lie group methods (2003), the fourth-order method.
#[derive(Clone, Copy, Debug, Default)]
pub struct RungeKutta4;

impl<S: MechanicalSystem> Integrator<S> for RungeKutta4 {
    fn order(&self) -> u32 {
        4
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
        let half = real::<ScalarOf<S>>(0.5);
        let (middle_s, end_s) = (time_s + step_s * half, time_s + step_s);
        let twelfth = step_s / real(12.0);

        let k1 = system.vector_field(time_s, state, input)?;
        let x2 = state.oplus(&(k1 * (step_s * half)));
        let k2 = system.vector_field(middle_s, &x2, input)?;
        let x3 = state.oplus(&(k2 * (step_s * half)));
        let k3 = system.vector_field(middle_s, &x3, input)?;
        let x4 = x2.oplus(&((k3 - k1 * half) * step_s));
        let k4 = system.vector_field(end_s, &x4, input)?;

        let (middle, three) = ((k2 + k3) * real(2.0), real(3.0));
        Ok(state.oplus(&((k1 * three + middle - k4) * twelfth)).oplus(&((k4 * three + middle - k1) * twelfth)))
    }
}
