use crate::convergence::Rest;
use crate::error::DynamicsError;
use crate::system::{Integrator, MechanicalSystem, ScalarOf, TangentOf};
use tumble_lie::{Manifold, real, value};

/// The implicit Gauss-Legendre method of order 4 (two stages), symmetric on every manifold.
///
/// Works on the increment from the middle of the step: with the middle point as base the equations do not change when
/// the direction of time does, so a step of `-h` undoes a step of `h` to rounding. (With the start as base
/// the order is the same but the symmetry is lost.) Solved by fixed-point iteration until rounding stops it, which
/// needs no tolerance and hence no unit of measurement.
/// # Source
/// Hairer, Lubich, Wanner: Geometric Numerical Integration, II.1.3 and IV.8.
#[derive(Clone, Copy, Debug, Default)]
pub struct GaussLegendre4;

/// Fixed-point iterations after which a step counts as too long.
const MAX_ITERATIONS: u32 = 100;

impl<S: MechanicalSystem> Integrator<S> for GaussLegendre4 {
    fn order(&self) -> u32 {
        4
    }
    fn step(
        &self,
        system: &S,
        state: &S::State,
        input: &S::Input,
        time_s: ScalarOf<S>,
        step_s: ScalarOf<S>,
    ) -> Result<S::State, DynamicsError> {
        let quarter_step_s = step_s * real(0.25);
        let offset_s = step_s * real(0.288_675_134_594_812_9); // sqrt(3) / 6
        let middle_s = time_s + step_s * real(0.5);
        let stage = |at_s, middle: &S::State, xi: TangentOf<S>| {
            let velocity = system.vector_field(at_s, &middle.oplus(&xi), input)?;
            Ok::<_, DynamicsError>(S::State::increment_rate(&xi, &velocity))
        };
        let start = system.vector_field(time_s, state, input)?;
        let (mut early, mut late) = (start, start);
        let (mut early_rest, mut late_rest) = (Rest::new(), Rest::new());
        for _ in 0..MAX_ITERATIONS {
            let middle = state.oplus(&((early + late) * quarter_step_s));
            let next_early = stage(middle_s - offset_s, &middle, -(late * offset_s))?;
            let next_late = stage(middle_s + offset_s, &middle, early * offset_s)?;
            let early_rested = early_rest.reached(&early, &next_early);
            let late_rested = late_rest.reached(&late, &next_late);
            (early, late) = (next_early, next_late);
            if early_rested && late_rested {
                let half_increment = (early + late) * quarter_step_s;
                return Ok(state.oplus(&half_increment).oplus(&half_increment));
            }
        }
        Err(DynamicsError::StepNotConverged {
            step_s: value(step_s),
            residual: value(early_rest.last_change()).max(value(late_rest.last_change())),
            iterations: MAX_ITERATIONS,
        })
    }
}
