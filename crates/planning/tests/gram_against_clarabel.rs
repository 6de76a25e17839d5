//! The dual active set against an interior point method, on random programs and on those of tubes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod tube_problems;

use tube_problems::random::RandomProgram;
use tube_problems::{Nominal, NominalLoop, SETTINGS};
use tumble_planning::control::{GramStatus, GramWorkspace, solve_gram_with_clarabel};

/// A study has the larger number.
const ROUNDS: u64 = if cfg!(debug_assertions) { 300 } else { 12_000 };

#[test]
fn random_programs_have_the_same_answer() {
    let (mut solved, mut infeasible, mut active, mut worst) = (0, 0, 0, [0.0_f64; 5]);
    for round in 0..ROUNDS {
        let mut seed = round + 1;
        let n = 1 + (round % 23) as usize;
        let case = RandomProgram::new(&mut seed, n, (3 + round % 7) as usize * n / 2);
        let matrices = &case.matrices;
        let program = matrices.program();
        let mut workspace = GramWorkspace::new(&program);
        let status = program.solve(&case.linear, &case.lower, &case.upper, &SETTINGS, &mut workspace);
        let other = solve_gram_with_clarabel(
            &matrices.hessian,
            &case.linear,
            &matrices.rows,
            &case.lower,
            &case.upper,
            &matrices.equality,
        );
        match status {
            GramStatus::Solved => {
                let x = workspace.solution();
                let Ok(Some(optimum)) = other else {
                    println!("{round} solved, but not by the other: {other:?}");
                    continue;
                };
                let cost = case.cost(x);
                let [gradient, products] = case.optimality(x, workspace.multipliers());
                let errors = [
                    (cost - optimum.cost).abs() / f64::max(1.0, cost.abs()),
                    case.violation(x),
                    gradient,
                    products,
                    case.violation(&optimum.x),
                ];
                worst.iter_mut().zip(errors).for_each(|(worst, error)| *worst = f64::max(*worst, error));
                if errors[..4].iter().any(|error| *error > 1e-9) {
                    println!("{round} n {n} m {} {errors:?} ", case.lower.len());
                }
                solved += 1;
                active += workspace.multipliers().filter(|(_, multiplier)| multiplier.abs() > 1e-6).count();
            }
            GramStatus::Infeasible => {
                if !case.is_proof(workspace.certificate(), workspace.crossed_row()) {
                    println!("{round} n {n} {:?}", case.proof(workspace.certificate()));
                }
                if !matches!(other, Ok(None)) {
                    println!("{round} infeasible, but not by the other: {other:?}");
                }
                infeasible += 1;
            }
            GramStatus::Capped | GramStatus::Numerical => {
                println!("{round} {status:?} n {n} m {} {other:?}", case.lower.len())
            }
        }
    }
    println!("{solved} {infeasible} {active} {worst:?}");
}

/// Cost and violation of 150 steps; what three solvers of others agree on.
#[test]
fn the_frozen_nominal_loop_costs_what_it_must() {
    let nominal = Nominal::new();
    let expected = [0.0237419, 0.0114801, 0.0816027];
    for (support, expected) in nominal.supports.iter().zip(expected) {
        assert!((support - expected).abs() < 5e-8, "{support} {expected}");
    }
    let feedback = nominal.feedback;
    assert!((feedback.x + 2.91367).abs() < 5e-6 && (feedback.y + 7.52974).abs() < 5e-6, "{feedback}");
    let run = |is_warm: bool| {
        let mut run = NominalLoop::new();
        let (mut cost, mut violation, mut iterations) = (0.0, f64::NEG_INFINITY, 0);
        for _ in 0..150 {
            run.solve(is_warm);
            for axis in 0..3 {
                let workspace = &run.workspaces[axis];
                let (one, beyond) = run.nominal.cost_and_violation(axis, run.states[axis], workspace.solution());
                cost += one;
                violation = f64::max(violation, beyond);
                iterations += workspace.iterations();
            }
            run.advance();
        }
        (cost, violation, iterations, run.states)
    };
    let (cost, violation, iterations, states) = run(false);
    println!("{cost} {violation:e} {iterations}");
    assert!((cost / -28549.724834 - 1.0).abs() < 1e-9, "{cost}");
    assert!(violation <= 1e-12, "{violation:e}");
    let (warm_cost, warm_violation, warm_iterations, warm_states) = run(true);
    println!("{warm_cost} {warm_violation:e} {warm_iterations}");
    assert!((warm_cost / cost - 1.0).abs() < 1e-12 && warm_violation <= 1e-12, "{warm_cost} {warm_violation:e}");
    assert!(warm_states.iter().flatten().zip(states.iter().flatten()).all(|(warm, cold)| (warm - cold).abs() < 1e-12));
    assert!(warm_iterations * 3 < iterations, "{warm_iterations} {iterations}");
}
