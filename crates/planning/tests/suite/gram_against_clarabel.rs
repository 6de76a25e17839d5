//! The dual active set against an interior point method, on random programs and on those of tubes.

use crate::general_solver::solve_gram_with_clarabel;
use crate::tube_problems::coupled::CoupledLoop;
use crate::tube_problems::random::RandomProgram;
use crate::tube_problems::{Matrices, Nominal, NominalLoop, SETTINGS, STEPS, uniform};
use tumble_planning::control::{
    AxisGain, AxisLimits, AxisProblem, AxisRequest, AxisTemplate, GramProgram, GramStatus, GramWorkspace, MassInterval,
    SymmetricBox, Terminal, TubeDisturbance, TubeWeights,
};
use tumble_planning::nalgebra::Vector2;

/// A study has the larger number.
const ROUNDS: usize = if cfg!(debug_assertions) { 300 } else { 12_000 };

/// How the two compared so far.
#[derive(Debug, Default)]
struct Comparison {
    solved: usize,
    infeasible: usize,
    /// Programs that the other one could not end.
    open: usize,
    active: usize,
    /// Of cost, rows, gradient and bounds.
    worst: [f64; 4],
}

impl Comparison {
    fn compare(&mut self, name: usize, case: &RandomProgram, program: &GramProgram, workspace: &mut GramWorkspace) {
        let Matrices { hessian, rows, equality } = &case.matrices;
        let status = program.solve(&case.linear, &case.lower, &case.upper, &SETTINGS, workspace);
        let other = solve_gram_with_clarabel(hessian, &case.linear, rows, &case.lower, &case.upper, equality);
        match status {
            GramStatus::Solved => {
                let x = workspace.solution();
                let cost = case.cost(x);
                let [gradient, distance] = case.optimality(x, workspace.multipliers());
                let cost_error = match &other {
                    Ok(Some(optimum)) => (cost - optimum.cost).abs() / f64::max(1.0, cost.abs()),
                    Ok(None) => panic!("{name} is solved, but infeasible for the other"),
                    Err(_) => 0.0,
                };
                let errors = [cost_error, case.violation(x), gradient, distance];
                assert!(errors.iter().all(|error| *error <= 1e-9), "{name}: {errors:?}");
                self.worst.iter_mut().zip(errors).for_each(|(worst, error)| *worst = f64::max(*worst, error));
                self.solved += 1;
                self.active += workspace.multipliers().filter(|(_, multiplier)| multiplier.abs() > 1e-6).count();
            }
            GramStatus::Infeasible => {
                assert!(case.is_proof(workspace.certificate(), workspace.crossed_row()), "{name}");
                assert!(!matches!(other, Ok(Some(_))), "{name} is infeasible, but not for the other");
                self.infeasible += 1;
            }
            _ => panic!("{name}: {status:?}"),
        }
        self.open += usize::from(other.is_err());
    }
}

#[test]
fn random_programs_have_the_same_answer() {
    let mut comparison = Comparison::default();
    for round in 0..ROUNDS {
        let mut seed = round as u64 + 1;
        let n = 1 + round % 23;
        let case = RandomProgram::new(&mut seed, n, (3 + round % 7) * n / 2);
        let program = case.matrices.program();
        comparison.compare(round, &case, &program, &mut GramWorkspace::new(&program));
    }
    println!("{comparison:?}");
    let Comparison { solved, infeasible, open, active, .. } = comparison;
    assert!(solved > ROUNDS / 2 && infeasible > ROUNDS / 10 && active > 5 * ROUNDS && open <= 1 + ROUNDS / 1000);
}

fn axis_problem(terminal: Terminal) -> AxisProblem {
    let template = AxisTemplate::try_new(AxisGain::default(), &SymmetricBox(Vector2::new(1e-4, 2e-4))).unwrap();
    let disturbance = TubeDisturbance { position_m: 0.0, velocity_m_s: 0.0, force_n: 0.0, acceleration_m_s2: 0.0 };
    AxisProblem::try_new(&AxisRequest {
        template: &template,
        mass: MassInterval::between(4.8, 14.4).unwrap(),
        limits: AxisLimits { force_n: 0.15, speed_m_s: 0.05, walls_m: [-0.45, 0.45] },
        shortfall: 0.0,
        disturbance,
        weights: TubeWeights::DEFAULT,
        steps: STEPS,
        terminal,
    })
    .unwrap()
}

/// One workspace for all, so that each begins with what was active in another.
#[test]
fn tubes_of_an_axis_have_the_same_answer_at_random_states() {
    let mut seed = 7;
    for terminal in [Terminal::StopSet, Terminal::Rest] {
        let mut comparison = Comparison::default();
        let problem = axis_problem(terminal);
        let (n, m) = (problem.unknowns(), problem.equality.len());
        let matrices = Matrices {
            hessian: problem.hessian.clone(),
            rows: problem.rows.clone(),
            equality: problem.equality.clone(),
        };
        let program = matrices.program();
        let mut workspace = GramWorkspace::new(&program);
        let mut case = RandomProgram { matrices, linear: vec![0.0; n], lower: vec![0.0; m], upper: vec![0.0; m] };
        for round in 0..ROUNDS / 6 {
            let mut next = |size: f64| size * uniform(&mut seed);
            let (state, goal) = (Vector2::new(next(0.45), next(0.05)), Vector2::new(next(0.6), 0.0));
            problem.linear(&[goal], &mut case.linear);
            problem.bounds(&state, &mut case.lower, &mut case.upper);
            comparison.compare(round, &case, &program, &mut workspace);
        }
        println!("{comparison:?}");
        assert!(comparison.solved > 40 && comparison.infeasible > 0 && comparison.open <= comparison.solved / 100);
    }
}

#[test]
fn coupled_tubes_stay_where_they_must_and_have_the_same_answer() {
    let mut comparison = Comparison::default();
    let mut run = CoupledLoop::new();
    assert_eq!((run.program.unknowns(), run.program.rows()), (84, 736));
    let mut most = 0;
    for mission in 0..if cfg!(debug_assertions) { 3 } else { 30 } {
        run.restart();
        for step in 0..100 {
            run.write();
            if step % 40 == 0 {
                let (linear, lower, upper) = (run.linear.clone(), run.lower.clone(), run.upper.clone());
                let case = RandomProgram { matrices: run.coupled.matrices.clone(), linear, lower, upper };
                comparison.compare(mission, &case, &run.program, &mut run.workspace);
            } else {
                assert_eq!(run.solve(), GramStatus::Solved);
            }
            most = most.max(run.workspace.iterations());
            let [force, plane] = run.advance();
            assert!(force < 1e-9 && plane < 1e-9, "{mission}, {step}: {force} {plane}");
        }
    }
    println!("{comparison:?} {most}");
    assert!(comparison.solved >= 9 && most < 400, "{most}");
}

/// Cost and violation of 150 steps; what three solvers of others agree on.
#[test]
fn the_frozen_nominal_loop_costs_what_it_must() {
    let nominal = Nominal::new();
    let expected = [0.023_741_9, 0.011_480_1, 0.081_602_7];
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
    assert!((cost / -28_549.724_834 - 1.0).abs() < 1e-9, "{cost}");
    assert!(violation <= 1e-12, "{violation:e}");
    let (warm_cost, warm_violation, warm_iterations, warm_states) = run(true);
    assert!((warm_cost / cost - 1.0).abs() < 1e-12 && warm_violation <= 1e-12, "{warm_cost} {warm_violation:e}");
    assert!(warm_states.iter().flatten().zip(states.iter().flatten()).all(|(warm, cold)| (warm - cold).abs() < 1e-12));
    assert!(warm_iterations * 3 < iterations, "{warm_iterations} {iterations}");
}
