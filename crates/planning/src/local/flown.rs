//! How inputs are flown: the same plan in shorter steps, in which the error of integration is gone.

use super::model::{InformativeModel, Kinematics};
use super::shooting::Shooting;
use super::sqp_settings::{FEASIBLE, SqpOutcome};
use super::surroundings::RowSettings;

/// Pieces of a step: an integrator of fourth order errs 256 times less.
const PIECES: usize = 4;
/// How often a plan that is flown into an obstacle keeps off farther.
const FARTHER: usize = 3;

/// Memory of [`Flight::of`].
#[derive(Clone, Debug, Default)]
pub(super) struct Flight {
    motion: Vec<Kinematics>,
    values: Vec<f64>,
}

/// What a plan's inputs do when they are flown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Flown {
    /// Farthest that the motion is from the plan's at its nodes, m.
    pub apart_m: f64,
    /// Least of what keeps off the surroundings; negative where they are hit.
    pub least_row: f64,
}

impl Flight {
    /// Flies the inputs `z`; `None` where there is no such motion.
    pub fn of<M: InformativeModel<X, U, P>, const X: usize, const U: usize, const P: usize>(
        &mut self,
        problem: &Shooting<'_, M, X, U, P>,
        z: &[f64],
    ) -> Option<Flown> {
        let task = &problem.task;
        let (steps, step_s) = (task.settings.steps, task.settings.step_s);
        let piece_s = step_s / PIECES as f64;
        let unaware = [[0.0; X]; P];
        let (mut planned, mut flown) = (task.start.clone(), task.start.clone());
        let mut apart_m = 0.0;
        self.motion.clear();
        for step in 0..steps {
            let input = problem.input(z, step);
            planned = problem.model.step(&planned, &unaware, &input, step_s)?.0;
            for _ in 0..PIECES {
                self.motion.push(problem.model.kinematics(&flown));
                flown = problem.model.step(&flown, &unaware, &input, piece_s)?.0;
            }
            let [one, other] = [&planned, &flown].map(|state| problem.model.kinematics(state).position_world());
            apart_m = f64::max(apart_m, f64::sqrt((one - other).norm_squared()));
        }
        self.motion.push(problem.model.kinematics(&flown));
        // the error of interpolation is of fourth order too
        let shrink = (PIECES * PIECES * PIECES * PIECES) as f64;
        let settings = RowSettings {
            step_s: piece_s,
            interpolation_error_m: task.row_settings.interpolation_error_m / shrink,
            ..task.row_settings
        };
        self.values.clear();
        self.values.resize(task.surroundings.rows(steps * PIECES, &settings), 1.0);
        task.surroundings.values(&self.motion, &settings, &mut self.values);
        let least_row = self.values.iter().fold(f64::INFINITY, |least: f64, value| least.min(*value));
        Some(Flown { apart_m, least_row })
    }
}

/// Flies a plan in shorter steps; where the error of integration brings it into what it should keep off, it keeps off farther
/// by that error and is searched for again. The violation that is left.
pub(super) fn keep_off_when_flown<'a, M: InformativeModel<X, U, P>, const X: usize, const U: usize, const P: usize>(
    problem: &mut Shooting<'a, M, X, U, P>,
    z: &mut [f64],
    mut outcome: SqpOutcome,
    flight: &mut Flight,
    mut search: impl FnMut(&mut Shooting<'a, M, X, U, P>, &mut [f64]) -> SqpOutcome,
) -> (SqpOutcome, f64) {
    let mut violation = 0.0;
    for attempt in 0..=FARTHER {
        let Some(flown) = flight.of(problem, z) else { return (outcome, f64::INFINITY) };
        violation = f64::max(0.0, -flown.least_row);
        if violation <= FEASIBLE || outcome.violation > FEASIBLE || attempt == FARTHER {
            break;
        }
        problem.task.row_settings.interpolation_error_m += 2.0 * flown.apart_m;
        let again = search(problem, z);
        outcome = SqpOutcome { iterations: outcome.iterations + again.iterations, ..again };
    }
    (outcome, violation)
}

#[cfg(test)]
mod tests {
    use super::super::shooting::tests::{inputs, with_terminal_radius};
    use super::*;
    use crate::budget::Units;
    use crate::local::{CondensedProblem, Criterion};
    use crate::local::{SqpSettings, SqpWorkspace, minimise};

    /// With nothing set aside, a plan on whole segments is flown into what it keeps off; then it keeps off farther.
    #[test]
    fn a_plan_that_is_flown_into_an_obstacle_keeps_off_farther() {
        with_terminal_radius(0.8, Criterion::A, |problem| {
            problem.task.row_settings.interpolation_error_m = 0.0;
            let mut z = inputs(1.0);
            let mut workspace = SqpWorkspace::new(problem.unknowns(), problem.rows());
            let mut search = |problem: &mut Shooting<'_, _, 6, 3, 4>, z: &mut [f64]| {
                workspace.forget();
                minimise(problem, z, &SqpSettings::COLD, &mut workspace, &mut Units::new(u64::MAX), 1)
            };
            let outcome = search(problem, &mut z);
            let mut flight = Flight::default();
            let before = flight.of(problem, &z).unwrap();
            assert!(outcome.violation <= FEASIBLE && before.least_row < -FEASIBLE, "{before:?}");
            let (again, violation) = keep_off_when_flown(problem, &mut z, outcome, &mut flight, search);
            let after = flight.of(problem, &z).unwrap();
            assert!(violation <= FEASIBLE && after.least_row >= -FEASIBLE, "{after:?}");
            assert!(again.cost > outcome.cost && again.iterations > outcome.iterations);
        });
    }
}
