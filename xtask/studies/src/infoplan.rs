//! Problem 8, the information-aware local plan: cold and warm, obstacles at the nodes and on whole segments, longer horizons and
//! ten unknown parameters. Costs and violations are the judge's.

use tumble_planning::local::{Guess, RigidBodyModel};

use crate::Failure;
use crate::bench::{Bench, Goal, Row, quantile};
use crate::local_cases::{LocalCase, LocalRun, Planner, Xorshift, documented_start};
use crate::local_tasks::{frozen_task, ten_parameter_task};
use crate::planning_runs::sorted;

const PROBLEM: &str = "infoplan";
/// Repetitions of what is one plan each time.
const COLD: usize = 21;
const DRAWS: usize = 200;
/// Where the start of a warm plan may be, m.
const MOVED_M: f64 = 0.01;
const SEED: u64 = 88_172_645_463_325_252;

/// Targets of a configuration, ms: cold from one start, warm at 1e-3 and 1e-4.
struct Targets {
    name: &'static str,
    cold_ms: f64,
    warm_ms: [Option<f64>; 3],
}

pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    if !bench.wants(PROBLEM, "") && !NAMES.iter().any(|name| bench.wants(PROBLEM, name)) {
        return Ok(());
    }
    let warm_ms = |rough: f64, usual: f64| [Some(rough), Some(usual), None];
    for (on_segments, targets) in [
        (false, Targets { name: "nodes", cold_ms: 25.0, warm_ms: [None, Some(5.0), None] }),
        (true, Targets { name: "segments", cold_ms: 25.0, warm_ms: [None, Some(6.0), None] }),
    ] {
        let case = LocalCase::new(frozen_task(), 24, on_segments)?;
        cold_and_warm(bench, &case, RigidBodyModel::principal, &targets)?;
        random_starts(bench, &case, targets.name)?;
        if on_segments {
            passing_sides(bench, &case)?;
        }
    }
    let mut task = frozen_task();
    task.step_s = 0.3;
    let case = LocalCase::new(task, 40, true)?;
    let targets = Targets { name: "long", cold_ms: 60.0, warm_ms: warm_ms(8.0, 12.0) };
    cold_and_warm(bench, &case, RigidBodyModel::principal, &targets)?;
    let case = LocalCase::new(ten_parameter_task(0.3), 40, true)?;
    let targets = Targets { name: "ten", cold_ms: 150.0, warm_ms: warm_ms(30.0, 30.0) };
    cold_and_warm(bench, &case, RigidBodyModel::full, &targets)
}

const NAMES: [&str; 4] = ["nodes", "segments", "long", "ten"];

/// What the judge found of many runs.
fn qualities<const P: usize>(runs: &[LocalRun<P>], on_segments: bool) -> Vec<(&'static str, f64)> {
    let count = |what: &dyn Fn(&LocalRun<P>) -> bool| runs.iter().filter(|run| what(run)).count() as f64;
    let worst = |what: &dyn Fn(&LocalRun<P>) -> f64| runs.iter().map(what).fold(f64::NEG_INFINITY, f64::max);
    let times = sorted(runs.iter().map(LocalRun::elapsed_ms));
    let steps = sorted(runs.iter().map(|run| run.iterations as f64));
    let inside = runs.iter().filter_map(|run| run.findings.as_ref()).map(|findings| findings.inside as f64).sum();
    vec![
        ("converged", count(&|run| run.is_converged) / runs.len() as f64),
        ("plans", count(&|run| run.findings.is_some())),
        ("plans_broken", count(&|run| run.is_broken(on_segments))),
        ("points_inside_on_finer_grid", inside),
        (
            "least_node_margin",
            -worst(&|run| run.findings.as_ref().map_or(f64::NEG_INFINITY, |found| -found.node_margin)),
        ),
        ("largest_goal_error_m", worst(&|run| run.findings.as_ref().map_or(f64::NAN, |found| found.goal_error_m))),
        ("largest_cost", worst(&LocalRun::cost)),
        ("largest_optimality", worst(&|run| run.optimality)),
        ("median_iterations", quantile(&steps, 0.5)),
        ("most_iterations", quantile(&steps, 1.0)),
        ("p95_ms", quantile(&times, 0.95)),
        ("max_ms", quantile(&times, 1.0)),
        ("largest_state_error", worst(&|run| run.apart)),
        ("largest_cost_error", worst(&|run| run.cost_error)),
    ]
}

#[allow(clippy::too_many_arguments, reason = "one for each column of the line")]
fn report<const P: usize>(
    bench: &Bench,
    item: String,
    target_ms: Option<f64>,
    peer: Option<(&'static str, f64)>,
    case: &LocalCase<P>,
    calibration_ns: f64,
    runs: &[LocalRun<P>],
    more: &[(&'static str, f64)],
) {
    let times = sorted(runs.iter().map(|run| 1e6 * run.elapsed_ms()));
    let mut quality = qualities(runs, case.on_segments());
    quality.extend_from_slice(more);
    bench.report(&Row {
        problem: PROBLEM,
        item: item.leak(),
        median_ns: quantile(&times, 0.5),
        p99_ns: quantile(&times, 0.99),
        n: runs.len(),
        quality,
        goal: Goal { target_ns: target_ms.map(|ms| 1e6 * ms), peer: peer.map(|(name, ms)| (name, 1e6 * ms)) },
        calibration_ns,
    });
}

/// Plans from the documented start, then from moved starts with the first plan for a guess.
fn cold_and_warm<const P: usize>(
    bench: &Bench,
    case: &LocalCase<P>,
    model: impl Fn() -> RigidBodyModel<P>,
    targets: &Targets,
) -> Result<(), Failure> {
    let Targets { name, cold_ms, warm_ms } = targets;
    let start = documented_start(&case.task.wrench, case.steps());
    let guess = Guess::Inputs(&start);
    let is_frozen = case.steps() == 24;
    let item = format!("{name}/cold");
    if bench.wants(PROBLEM, &item) {
        let calibration_ns = bench.calibrate();
        let mut planner = case.planner(model(), 1e-4)?;
        let runs = (0..COLD).map(|_| case.run(&mut planner, guess)).collect::<Result<Vec<_>, _>>()?;
        let peer = is_frozen.then_some(("Fatrop", 3920.0));
        report(bench, item, Some(*cold_ms), peer, case, calibration_ns, &runs, &[]);
    }
    let items = ["1e-3", "1e-4", "1e-6"].map(|tolerance| format!("{name}/warm_{tolerance}"));
    if !items.iter().any(|item| bench.wants(PROBLEM, item)) {
        return Ok(());
    }
    let base = case.run(&mut case.planner(model(), 1e-6)?, guess)?;
    for ((item, tolerance), target_ms) in items.into_iter().zip([1e-3, 1e-4, 1e-6]).zip(warm_ms) {
        if bench.wants(PROBLEM, &item) {
            let calibration_ns = bench.calibrate();
            let mut planner = case.planner(model(), tolerance)?;
            let mut reference = case.planner(model(), 1e-7)?;
            let mut chance = Xorshift(SEED);
            let (mut runs, mut gap) = (Vec::new(), 0.0_f64);
            for _ in 0..DRAWS {
                let mut moved = case.task.start;
                for coordinate in &mut moved[..3] {
                    *coordinate += MOVED_M * chance.next();
                }
                let moved = case.moved(moved, case.task.goal);
                let run = moved.run(&mut planner, Guess::Near(&base.inputs))?;
                gap = gap.max(run.cost() - moved.run(&mut reference, Guess::Near(&base.inputs))?.cost());
                runs.push(run);
            }
            let peer = is_frozen.then_some(("CasADi + IPOPT", 368.0));
            report(bench, item, *target_ms, peer, case, calibration_ns, &runs, &[("largest_cost_gap", gap)]);
        }
    }
    Ok(())
}

fn from_random<const P: usize>(
    case: &LocalCase<P>,
    planner: &mut Planner<P>,
    share: f64,
    count: usize,
) -> Result<Vec<LocalRun<P>>, Failure> {
    let mut chance = Xorshift(SEED);
    let run = |_| {
        let inputs = chance.inputs(&case.task.wrench, case.steps(), share);
        case.run(planner, Guess::Inputs(&inputs))
    };
    (0..count).map(run).collect()
}

fn random_starts(bench: &Bench, case: &LocalCase<4>, name: &str) -> Result<(), Failure> {
    for (suffix, share) in [("half", 0.5), ("full", 1.0)] {
        let item = format!("{name}/random_{suffix}");
        if bench.wants(PROBLEM, &item) {
            let calibration_ns = bench.calibrate();
            let mut planner = case.planner(RigidBodyModel::principal(), 1e-6)?;
            let runs = from_random(case, &mut planner, share, DRAWS)?;
            let least = runs.iter().map(LocalRun::cost).fold(f64::INFINITY, f64::min);
            report(bench, item, Some(50.0), None, case, calibration_ns, &runs, &[("least_cost", least)]);
        }
    }
    Ok(())
}

/// One start for each side on which the obstacles can be passed.
fn passing_sides(bench: &Bench, case: &LocalCase<4>) -> Result<(), Failure> {
    let item = "segments/sides".to_owned();
    if bench.wants(PROBLEM, &item) {
        let calibration_ns = bench.calibrate();
        let mut planner = case.planner(RigidBodyModel::principal(), 1e-6)?;
        let best = from_random(case, &mut planner, 0.5, 20)?.iter().map(LocalRun::cost).fold(f64::INFINITY, f64::min);
        let mut planner = case.planner(RigidBodyModel::principal(), 1e-4)?;
        let runs = (0..COLD).map(|_| case.run(&mut planner, Guess::Excited)).collect::<Result<Vec<_>, _>>()?;
        let excess = runs.iter().map(LocalRun::cost).fold(f64::NEG_INFINITY, f64::max) / best - 1.0;
        let more = [("best_of_20", best), ("excess_over_best_of_20", excess)];
        report(bench, item, Some(50.0), None, case, calibration_ns, &runs, &more);
    }
    Ok(())
}
