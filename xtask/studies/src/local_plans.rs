//! The claims on the information-aware local planner, times aside: `cargo xtask study local-plans --runs N`.
//!
//! One JSON object per line on stdout as results come in; every target on stderr at the end.

use serde_json::json;
use tumble_planning::local::{Guess, RigidBodyModel};

use crate::Failure;
use crate::arguments::Arguments;
use crate::bench::quantile;
use crate::local_cases::{LocalCase, LocalRun, Xorshift, documented_start};
use crate::local_checker::{FINER, LocalTask};
use crate::local_tasks::{GOAL, frozen_task};
use crate::planning_runs::sorted;
use crate::targets::Report;

/// The prototype's seed of random scenarios.
const SCENARIOS: u64 = 12_345_678_901;
const STARTS: u64 = 88_172_645_463_325_252;
/// The hold task: the factor of all weights, and the best of 20 random starts of the prototype.
const HOLD: [(f64, f64); 3] = [(1.0, 0.413_53), (0.1, 0.113_56), (0.01, 0.021_90)];
/// The sweep of weights: the factor, and the relative sigma of Ixx that the prototype found, %.
const SWEEP: [(f64, f64); 6] = [(0.0, 33.0), (0.1, 5.3), (1.0, 3.0), (10.0, 1.65), (100.0, 0.84), (1000.0, 0.45)];

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let runs = arguments.number("--runs")?.unwrap_or(1000).max(1);
    let mut report = Report::default();
    for on_segments in [false, true] {
        frozen(on_segments, &mut report)?;
        scenarios(on_segments, runs, &mut report)?;
    }
    hold(&mut report)?;
    sweep(&mut report)?;
    report.finish()
}

fn place(on_segments: bool) -> &'static str {
    if on_segments { "segments" } else { "nodes" }
}

/// Problem 8 from the documented start and from random ones.
fn frozen(on_segments: bool, report: &mut Report) -> Result<(), Failure> {
    let case = LocalCase::new(frozen_task(), 24, on_segments)?;
    let mut planner = case.planner(RigidBodyModel::principal(), 1e-4)?;
    let start = documented_start(&case.task.wrench, case.steps());
    let first = case.run(&mut planner, Guess::Inputs(&start))?;
    let mut planner = case.planner(RigidBodyModel::principal(), 1e-6)?;
    let mut chance = Xorshift(STARTS);
    let run = |_| case.run(&mut planner, Guess::Inputs(&chance.inputs(&case.task.wrench, case.steps(), 0.5)));
    let runs = (0..200).map(run).collect::<Result<Vec<_>, Failure>>()?;
    let costs = sorted(runs.iter().map(LocalRun::cost));
    let name = place(on_segments);
    let found = |run: &LocalRun<4>| run.findings.as_ref().map(|findings| (findings.node_margin, findings.fine_margin));
    let at_frozen_steps = first.findings.as_ref().map(|findings| findings.cost.total());
    println!(
        "{}",
        json!({
            "block": "problem 8", "obstacles": name, "cost": first.cost(), "optimality": first.optimality,
            "cost_by_planner": first.planned_cost, "cost_at_frozen_steps": at_frozen_steps,
            "iterations": first.iterations, "ms": first.elapsed_ms(), "margins": found(&first),
            "random_least": costs.first(), "random_largest": costs.last(),
            "largest_state_error": runs.iter().map(|run| run.apart).fold(0.0, f64::max),
            "largest_cost_error": runs.iter().map(|run| run.cost_error).fold(0.0, f64::max),
        })
    );
    let most = if on_segments { 10.7180 } else { 10.7030 };
    report.at_most(&format!("problem 8, {name}, cost from the documented start"), first.cost(), most);
    let kept = if first.is_kept(on_segments) && first.is_converged { 0.0 } else { 1.0 };
    report.none(&format!("problem 8, {name}, documented start: unconverged or broken"), kept);
    let stuck = runs.iter().filter(|run| !run.is_converged || run.optimality > 1e-6).count() as f64;
    report.none(&format!("problem 8, {name}, random starts not at 1e-6"), stuck);
    let broken = runs.iter().filter(|run| !run.is_kept(on_segments)).count() as f64;
    report.none(&format!("problem 8, {name}, random starts without a plan that keeps the limits"), broken);
    if on_segments {
        let mut planner = case.planner(RigidBodyModel::principal(), 1e-4)?;
        let sides = case.run(&mut planner, Guess::Excited)?;
        let best = sorted(runs.iter().take(20).map(LocalRun::cost)).first().copied().unwrap_or(f64::NAN);
        report.at_most("problem 8, segments, one start per side: cost over the best of 20", sides.cost() / best, 1.001);
    } else {
        report.at_most("problem 8, nodes, random starts, largest cost", quantile(&costs, 1.0), 10.7482);
    }
    Ok(())
}

/// The prototype's random scenarios: start, goal, attitude, velocity, rate and first inputs.
fn scenarios(on_segments: bool, runs: usize, report: &mut Report) -> Result<(), Failure> {
    let case = LocalCase::new(frozen_task(), 24, on_segments)?;
    let mut planner = case.planner(RigidBodyModel::principal(), 1e-6)?;
    let mut chance = Xorshift(SCENARIOS);
    let mut done: Vec<LocalRun<4>> = Vec::with_capacity(runs);
    while done.len() < runs {
        let (mut start, mut goal) = ([0.0; 13], [0.0; 3]);
        start[3] = 1.0;
        for axis in 0..3 {
            start[axis] = 0.45 + 0.6 * chance.next();
            goal[axis] = 0.45 + 0.6 * chance.next();
            start[7 + axis] = 0.05 * chance.next();
            start[10 + axis] = 0.1 * chance.next();
            start[4 + axis] = 0.3 * chance.next();
        }
        let norm = start[3..7].iter().map(|x| x * x).sum::<f64>().sqrt();
        start[3..7].iter_mut().for_each(|x| *x /= norm);
        let is_near = |point: &[f64], least: f64| {
            case.task.obstacles.iter().any(|(center, semi_axes)| {
                (0..3).map(|i| ((point[i] - center[i]) / semi_axes[i]).powi(2)).sum::<f64>() < least
            })
        };
        if is_near(&start, 1.3) || is_near(&goal, 1.1) {
            continue;
        }
        let inputs = chance.inputs(&case.task.wrench, case.steps(), 0.3);
        let drawn = case.moved(start, goal);
        let run = drawn.run(&mut planner, Guess::Inputs(&inputs))?;
        if !run.is_converged || run.is_broken(on_segments) {
            let margin = run.findings.as_ref().map(|findings| findings.fine_margin);
            println!(
                "{}",
                json!({
                    "block": "draw", "obstacles": place(on_segments), "index": done.len(), "optimality": run.optimality,
                    "iterations": run.iterations, "broken": run.is_broken(on_segments), "margin": margin,
                    "integration_error_m": integration_error_m(&drawn, &run),
                })
            );
        }
        done.push(run);
    }
    let name = place(on_segments);
    let times = sorted(done.iter().map(LocalRun::elapsed_ms));
    let steps = sorted(done.iter().map(|run| run.iterations as f64));
    let converged = done.iter().filter(|run| run.is_converged && run.optimality <= 1e-6).count() as f64;
    let without = done.iter().filter(|run| run.findings.is_none()).count();
    let broken = done.iter().filter(|run| run.is_broken(on_segments)).count() as f64;
    println!(
        "{}",
        json!({
            "block": "scenarios", "obstacles": name, "runs": runs, "converged": converged, "without_plan": without,
            "broken": broken, "median_ms": quantile(&times, 0.5), "p95_ms": quantile(&times, 0.95),
            "max_ms": quantile(&times, 1.0), "median_iterations": quantile(&steps, 0.5),
            "p95_iterations": quantile(&steps, 0.95), "most_iterations": quantile(&steps, 1.0),
        })
    );
    report.at_least(&format!("random scenarios, {name}, share at 1e-6 within 200"), converged / runs as f64, 0.995);
    report.none(&format!("random scenarios, {name}, plans that break a limit"), broken);
    Ok(())
}

/// Largest distance at the nodes between the motion by one integration step per input and by the finer ones.
fn integration_error_m(case: &LocalCase<4>, run: &LocalRun<4>) -> Option<f64> {
    let findings = run.findings.as_ref()?;
    let finer = LocalTask { step_s: case.task.step_s / FINER as f64, ..case.task.clone() };
    let held: Vec<[f64; 6]> = run.inputs.iter().flat_map(|input| std::iter::repeat_n(*input, FINER)).collect();
    let finer = finer.judge(&held);
    let apart = findings.nodes.iter().zip(finer.nodes.iter().step_by(FINER));
    let apart = apart.map(|(one, other)| (0..3).map(|i| (one[i] - other[i]).powi(2)).sum::<f64>());
    Some(apart.fold(0.0, f64::max).sqrt())
}

/// At the goal at rest, from inputs of zero: a stationary point that tells nothing.
fn hold(report: &mut Report) -> Result<(), Failure> {
    let mut task = frozen_task();
    task.start[..3].copy_from_slice(&GOAL);
    for (factor, prototype) in HOLD {
        let case = LocalCase::new(task.clone(), 24, false)?.weighted(factor);
        let mut planner = case.planner(RigidBodyModel::principal(), 1e-6)?;
        let zero = vec![[0.0; 6]; case.steps()];
        let run = case.run(&mut planner, Guess::Inputs(&zero))?;
        let mut chance = Xorshift(STARTS);
        let mut best = f64::INFINITY;
        for _ in 0..20 {
            let inputs = chance.inputs(&case.task.wrench, case.steps(), 0.3);
            best = best.min(case.run(&mut planner, Guess::Inputs(&inputs))?.cost());
        }
        println!(
            "{}",
            json!({
                "block": "hold", "weights": factor, "cost": run.cost(), "best_of_20": best, "prototype": prototype,
                "iterations": run.iterations, "optimality": run.optimality, "ms": run.elapsed_ms(),
            })
        );
        let over = run.cost() / best.min(prototype);
        report.at_most(&format!("hold, weights x {factor}, cost over the best of 20"), over, 1.001);
    }
    Ok(())
}

/// What more weight buys, and what it costs.
fn sweep(report: &mut Report) -> Result<(), Failure> {
    let mut last = f64::INFINITY;
    let (mut rising, mut stuck) = (0.0, 0.0);
    for (factor, prototype) in SWEEP {
        let case = LocalCase::new(frozen_task(), 24, false)?.weighted(factor);
        let mut planner = case.planner(RigidBodyModel::principal(), 1e-6)?;
        let start = documented_start(&case.task.wrench, case.steps());
        let run = case.run(&mut planner, Guess::Inputs(&start))?;
        let Some(findings) = &run.findings else {
            stuck += 1.0;
            continue;
        };
        let cost = &findings.fine_cost;
        let inertia = [4, 7, 9].map(|place| case.task.parameters[place]);
        let relative: Vec<f64> = cost.sigma.iter().skip(1).zip(inertia).map(|(sigma, i)| 100.0 * sigma / i).collect();
        let variance: f64 = (0..4).map(|i| frozen_task().information_weights[i] * cost.sigma[i].powi(2)).sum();
        println!(
            "{}",
            json!({
                "block": "sweep", "weights": factor, "tracking_and_effort": cost.tracking_and_effort,
                "relative_sigma_percent": relative, "prototype_percent": prototype, "iterations": run.iterations,
                "optimality": run.optimality, "converged": run.is_converged, "ms": run.elapsed_ms(),
            })
        );
        rising += f64::from(u8::from(variance > last * (1.0 + 1e-6)));
        stuck += f64::from(u8::from(!run.is_converged));
        last = variance;
    }
    report.none("sweep of weights, more weight told less", rising);
    report.none("sweep of weights, not converged", stuck);
    Ok(())
}
