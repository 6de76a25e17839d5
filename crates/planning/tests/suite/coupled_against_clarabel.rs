//! The coupled program against a general solver that gets all matrices written out.

use crate::fixed_planes;
use crate::general_solver::solve_gram_with_clarabel;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_planning::control::{AxisPlane, AxisProblem, CoupledAxes, GramStatus};
use tumble_planning::nalgebra::Vector2;
use tumble_planning::unit_interval;

/// Matrices and bounds of three axes with planes, from their definitions.
struct Written {
    hessian: Vec<f64>,
    linear: Vec<f64>,
    rows: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    equality: Vec<bool>,
}

fn written(
    problems: &[AxisProblem; 3],
    planes: &[AxisPlane],
    states: &[Vector2<f64>; 3],
    references: &[Vec<Vector2<f64>>; 3],
) -> Written {
    let n: usize = problems.iter().map(AxisProblem::unknowns).sum();
    let mut all = Written {
        hessian: vec![0.0; n * n],
        linear: Vec::new(),
        rows: Vec::new(),
        lower: Vec::new(),
        upper: Vec::new(),
        equality: Vec::new(),
    };
    for (axis, problem) in problems.iter().enumerate() {
        let own = problem.unknowns();
        let first = axis * own;
        for (i, row) in problem.hessian.chunks(own).enumerate() {
            all.hessian[(first + i) * n + first..][..own].copy_from_slice(row);
        }
        let mut linear = vec![0.0; own];
        problem.linear(&references[axis], &mut linear);
        all.linear.extend(linear);
        for row in problem.rows.chunks(own) {
            let mut wide = vec![0.0; n];
            wide[first..][..own].copy_from_slice(row);
            all.rows.extend(wide);
        }
        let (mut lower, mut upper) = (vec![0.0; problem.equality.len()], vec![0.0; problem.equality.len()]);
        problem.bounds(&states[axis], &mut lower, &mut upper);
        all.lower.extend(lower);
        all.upper.extend(upper);
        all.equality.extend(&problem.equality);
    }
    for plane in planes {
        let mut wide = Vec::new();
        let mut upper = plane.offset_m;
        for (axis, problem) in problems.iter().enumerate() {
            let along = plane.normal[axis];
            let [mut position, _] = problem.node_rows(plane.node);
            for entry in &mut position {
                *entry *= along;
            }
            position[problem.scale_index()] += along.abs() * problem.scaled[2];
            upper -= along.abs() * (problem.held[2] + problem.slack[0]);
            wide.extend(position);
        }
        all.rows.extend(wide);
        all.lower.push(f64::NEG_INFINITY);
        all.upper.push(upper);
        all.equality.push(false);
    }
    all
}

#[test]
fn plans_are_those_of_a_general_solver() {
    let problems = fixed_planes::problems();
    let mut coupled = CoupledAxes::try_new(problems.clone()).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(21);
    let mut uniform = |bound: f64| bound * (2.0 * unit_interval(&mut random) - 1.0);
    let (mut solved, mut infeasible, mut worst) = (0, 0, 0.0_f64);
    for round in 0..24_usize {
        // other planes, more or fewer, from one set to the next
        let mut planes = fixed_planes::planes(round as u64);
        planes.truncate(planes.len() - 25 * (round % 7));
        planes.retain(|plane| plane.node.is_multiple_of(1 + round % 2));
        coupled.set_planes(&planes);
        let far = if round.is_multiple_of(3) { 1.0 } else { 0.5 };
        let states = [0.4, 0.6, 0.45].map(|bound| Vector2::new(uniform(far * bound), uniform(0.03 * far)));
        let references = [0.5, 1.2, 0.6].map(|bound| vec![Vector2::new(uniform(bound), 0.0)]);
        let status = coupled.solve(&states, [&references[0], &references[1], &references[2]]);
        let all = written(&problems, &planes, &states, &references);
        let optimum =
            solve_gram_with_clarabel(&all.hessian, &all.linear, &all.rows, &all.lower, &all.upper, &all.equality)
                .unwrap();
        let Some(optimum) = optimum else {
            assert_eq!(status, GramStatus::Infeasible, "{round}");
            infeasible += 1;
            continue;
        };
        assert_eq!(status, GramStatus::Solved, "{round}");
        solved += 1;
        let x: Vec<f64> = coupled
            .plans()
            .iter()
            .flat_map(|plan| {
                [plan.start.x, plan.start.y].into_iter().chain(plan.accelerations.clone()).chain([plan.scale])
            })
            .collect();
        let n = x.len();
        let value = |x: &[f64]| {
            let curved: f64 = all
                .hessian
                .chunks(n)
                .zip(x)
                .map(|(row, xi)| xi * row.iter().zip(x).map(|(h, x)| h * x).sum::<f64>())
                .sum();
            0.5 * curved + all.linear.iter().zip(x).map(|(f, x)| f * x).sum::<f64>()
        };
        worst = worst.max((value(&x) - optimum.cost) / optimum.cost.abs().max(1.0));
        for (row, (lower, upper)) in all.rows.chunks(n).zip(all.lower.iter().zip(&all.upper)) {
            let value: f64 = row.iter().zip(&x).map(|(a, x)| a * x).sum();
            assert!(value <= upper + 1e-9 && value >= lower - 1e-9, "{round}: {lower} {value} {upper}");
        }
    }
    assert!(worst < 1e-9, "{worst}");
    assert!(solved >= 12 && infeasible >= 2, "{solved} {infeasible}");
}
