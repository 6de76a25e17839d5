use crate::error::DynamicsError;
use crate::system::{Integrator, MechanicalSystem, ScalarOf};
use tumble_lie::{Manifold, real};

/// The Runge-Kutta-Munthe-Kaas method of order 4.
///
/// The classical method applied to the increment `xi(t)` in `x(t) = x_k ⊕ xi(t)`, whose rate is
/// [`Manifold::increment_rate`]; one increment is applied at the end.
/// # Source
/// Munthe-Kaas: High order Runge-Kutta methods on manifolds (1999).
#[derive(Clone, Copy, Debug, Default)]
pub struct MuntheKaas4;

impl<S: MechanicalSystem> Integrator<S> for MuntheKaas4 {
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
        let half_step_s = step_s * real(0.5);
        let slope = |at_s, xi| {
            Ok::<_, DynamicsError>(S::State::increment_rate(&xi, &system.vector_field(at_s, &state.oplus(&xi), input)?))
        };
        let k1 = system.vector_field(time_s, state, input)?;
        let k2 = slope(time_s + half_step_s, k1 * half_step_s)?;
        let k3 = slope(time_s + half_step_s, k2 * half_step_s)?;
        let k4 = slope(time_s + step_s, k3 * step_s)?;
        Ok(state.oplus(&((k1 + (k2 + k3) * real(2.0) + k4) * (step_s / real(6.0)))))
    }
}
