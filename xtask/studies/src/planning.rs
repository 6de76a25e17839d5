//! The claims on the planner at scale: `cargo xtask study planning --runs SEEDS --reference-units N [--only SCENE]`.
//!
//! One JSON object per line on stdout as results come in; a table and every target on stderr at the end.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::time::Duration;

use serde_json::{Value, json};
use tumble_astrobee::planning_presets::{PrimitiveRules, rattle_rrt};
use tumble_planning::Units;
use tumble_planning::collision::Blocker;
use tumble_planning::global::{Obstruction, Status, Until};

use crate::Failure;
use crate::arguments::Arguments;
use crate::bench::{Calibration, quantile};
use crate::core_clock::CoreClock;
use crate::planning_runs::{Planner, Run, cores, count, flight_planner, judge, share, sorted, timed_runs};
use crate::planning_scenes::{PEERS, Scene, exactly_c_scene, failed, frozen_scenes, gap_scene, rattle_scenes};
use crate::targets::Report;

/// What a first plan is given.
const FIRST: Duration = Duration::from_secs(5);
/// How long plans are improved.
const IMPROVED: Duration = Duration::from_millis(100);
const LONG: Duration = Duration::from_secs(1);
/// The scene whose gap after [`LONG`] is claimed, and over how many seeds, for it takes a second each.
const LONG_SCENE: &str = "jem10";
const LONG_RUNS: usize = 50;
/// Long runs that make a reference.
const REFERENCE_SEEDS: u64 = 2;
/// Units that what ends by itself may spend: more than it needs.
const PLENTY: u64 = 10_000_000;
/// Bounds and costs are sums of many rounded numbers.
const ROUNDING: f64 = 1e-9;

/// What the calibration says now, as a multiple of the idle machine's.
fn load() -> f64 {
    Calibration::default().load()
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let runs = arguments.number("--runs")?.unwrap_or(100).max(1);
    let reference_units = arguments.number("--reference-units")?.unwrap_or(1_000_000) as u64;
    let only = arguments.value("--only").unwrap_or_default();
    let mut scenes = rattle_scenes()?;
    scenes.extend(frozen_scenes()?);
    scenes.push(gap_scene()?);
    scenes.retain(|scene| scene.name.contains(only));
    println!(
        "{}",
        json!({"block": "settings", "runs": runs, "reference_units": reference_units, "clock": CoreClock::name()})
    );

    let references = references(&scenes, reference_units)?;
    let mut report = Report::default();
    for (scene, reference) in scenes.iter().zip(&references) {
        flights(scene, reference, runs, &mut report)?;
    }
    for scene in &scenes {
        originals(scene, runs, &mut report)?;
    }
    for (set, covering) in [(2, 1), (4, 4)] {
        let scene = exactly_c_scene(set)?;
        if scene.name.contains(only) {
            exactly_c(&scene, covering, runs, &mut report)?;
        }
    }
    let sphere = gap_scene()?.within_bounding_sphere()?;
    if sphere.name.contains(only) {
        gap_sphere(&sphere, &mut report)?;
    }
    if report.targets.is_empty() {
        return Err(Failure::BadInput("no scene is called so".to_owned()));
    }
    report.finish()
}

/// Long runs of every scene, on all cores: nothing is timed.
fn references(scenes: &[Scene], units: u64) -> Result<Vec<Vec<Run>>, Failure> {
    let jobs = (0..scenes.len()).flat_map(|index| (0..REFERENCE_SEEDS).map(move |seed| (index, seed)));
    let waiting: Mutex<VecDeque<(usize, u64)>> = Mutex::new(jobs.collect());
    let done = Mutex::new(Vec::new());
    let lost = || Failure::TargetMissed("planning: a long run ended badly".to_owned());
    std::thread::scope(|scope| {
        for _ in 0..cores() {
            scope.spawn(|| {
                loop {
                    let job = waiting.lock().ok().and_then(|mut waiting| waiting.pop_front());
                    let Some((index, seed)) = job else { break };
                    // seeds that the timed runs do not use
                    let request = scenes[index].request(u64::MAX - seed, Until::BudgetSpent);
                    let clock = CoreClock::start();
                    let answer = flight_planner().plan(&request, &mut Units::new(units)).map_err(failed);
                    let run = answer.map(|answer| Run::new(seed, clock.elapsed(), answer));
                    if let Ok(mut done) = done.lock() {
                        done.push((index, run));
                    }
                }
            });
        }
    });
    let mut references: Vec<Vec<Run>> = scenes.iter().map(|_| Vec::new()).collect();
    for (index, run) in done.into_inner().map_err(|_| lost())? {
        references[index].push(run?);
    }
    for (scene, runs) in scenes.iter().zip(&mut references) {
        judge(scene, runs);
    }
    Ok(references)
}

fn violations(runs: &[Run]) -> f64 {
    count(runs, |run| !run.findings.is_clean())
}

/// First plans and improved plans of the planner to use.
fn flights(scene: &Scene, reference: &[Run], runs: usize, report: &mut Report) -> Result<(), Failure> {
    let name = &scene.name;
    let before = load();
    let first = timed_runs(scene, runs, Until::FirstPlan, FIRST, &flight_planner)?;
    let improved = timed_runs(scene, runs, Until::BudgetSpent, IMPROVED, &flight_planner)?;
    let is_long = name == LONG_SCENE;
    let long_runs = if is_long { runs.min(LONG_RUNS) } else { 0 };
    let long = timed_runs(scene, long_runs, Until::BudgetSpent, LONG, &flight_planner)?;
    let after = load();

    let all = || reference.iter().chain(&first).chain(&improved).chain(&long);
    let best_s = all().map(|run| run.cost_s).fold(f64::INFINITY, f64::min);
    let best_bound_s = all().map(|run| run.bound_s).fold(0.0, f64::max);
    let times = sorted(first.iter().map(Run::elapsed_ms));
    let costs = sorted(improved.iter().map(|run| run.cost_s));
    let success = share(&first, Run::is_solved).min(share(&improved, Run::is_solved));
    let within = share(&improved, |run| run.cost_s <= 1.01 * best_s);
    let median_gap = |runs: &[Run]| quantile(&sorted(runs.iter().map(Run::gap)), 0.5);
    let broken = [reference, &first, &improved, &long].into_iter().map(violations).sum::<f64>();
    let above = all().filter(|run| run.bound_s > best_s * (1.0 + ROUNDING)).count() as f64;
    let rising = all().filter(|run| run.rises).count() as f64;
    let (median_ms, p99_ms) = (quantile(&times, 0.5), quantile(&times, 0.99));
    println!(
        "{}",
        json!({
            "block": "scene", "scene": name, "seeds": runs, "success": success,
            "first_median_ms": median_ms, "first_p99_ms": p99_ms, "first_longest_ms": quantile(&times, 1.0),
            "first_median_cost_s": quantile(&sorted(first.iter().map(|run| run.cost_s)), 0.5),
            "first_median_units": quantile(&sorted(first.iter().map(|run| run.units as f64)), 0.5),
            "improved_ms": 1e3 * IMPROVED.as_secs_f64(),
            "improved_longest_ms": quantile(&sorted(improved.iter().map(Run::elapsed_ms)), 1.0),
            "within_1_percent": within, "improved_median_cost_s": quantile(&costs, 0.5),
            "improved_p95_cost_s": quantile(&costs, 0.95), "improved_worst_cost_s": quantile(&costs, 1.0),
            "improved_worst_seed": improved.iter().max_by(|a, b| a.cost_s.total_cmp(&b.cost_s)).map(|run| run.seed),
            "improved_median_gap": median_gap(&improved), "optimal": share(&improved, |run| run.status == Status::Optimal),
            "long_seeds": long.len(), "long_median_gap": if is_long { json!(median_gap(&long)) } else { Value::Null },
            "best_cost_s": best_s, "best_bound_s": best_bound_s,
            "reference_cost_s": reference.iter().map(|run| run.cost_s).collect::<Vec<_>>(),
            "reference_seconds": reference.iter().map(|run| run.elapsed.as_secs_f64()).collect::<Vec<_>>(),
            "violations": broken, "bounds_above_best": above, "rising_costs": rising,
            "load_before": before, "load_after": after,
        })
    );
    if report.table.is_empty() {
        report.table.push(format!(
            "{:<10} {:>5} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>6} {:>6} {:>5}",
            "scene",
            "seeds",
            "success",
            "first ms",
            "p99 ms",
            "100ms s",
            "worst s",
            "best s",
            "bound s",
            "1 %",
            "broken",
            "load"
        ));
    }
    report.table.push(format!(
        "{name:<10} {runs:>5} {:>7.1}% {median_ms:>8.3} {p99_ms:>8.3} {:>8.3} {:>8.3} {best_s:>8.3} {best_bound_s:>8.3} {:>5.1}% \
         {broken:>6} {:>5.2}",
        100.0 * success,
        quantile(&costs, 0.5),
        quantile(&costs, 1.0),
        100.0 * within,
        before.max(after),
    ));

    let peer = PEERS.iter().find(|(peer, ..)| peer == name);
    report.at_least(&format!("{name}: share of seeds solved"), success, 1.0);
    if name == "iss-gap" {
        report.at_most(&format!("{name}: 99th percentile of first plans, ms"), p99_ms, 50.0);
    } else {
        let most = if peer.is_some() { 0.5 } else { 1.0 };
        report.at_most(&format!("{name}: median of first plans, ms"), median_ms, most);
        report.at_most(&format!("{name}: 99th percentile of first plans, ms"), p99_ms, 10.0);
        report.at_least(&format!("{name}: share within 1 % of the best known after 100 ms"), within, 0.95);
    }
    if let Some((_, _, path_s)) = peer {
        report.at_most(
            &format!("{name}: longest plan after 100 ms, s, beside every peer's"),
            quantile(&costs, 1.0),
            *path_s,
        );
    }
    if is_long {
        report.at_most(&format!("{name}: median gap after 1 s"), median_gap(&long), 0.15);
    }
    report.none(&format!("{name}: plans that the checker faults"), broken);
    report.none(&format!("{name}: bounds above the best cost known"), above);
    report.none(&format!("{name}: runs whose cost does not fall"), rising);
    Ok(())
}

/// The thesis's planner by its own rules and with whole edges checked: shown for comparison.
fn originals(scene: &Scene, runs: usize, report: &mut Report) -> Result<(), Failure> {
    let Some(place) = scene.place else { return Ok(()) };
    for (rules, named) in [(PrimitiveRules::Original, "original"), (PrimitiveRules::Continuous, "continuous")] {
        let planner = rattle_rrt(place, rules).ok_or_else(|| Failure::BadInput("no preset".to_owned()))?;
        let planner = planner.map_err(failed)?;
        let make = || -> Box<Planner> { Box::new(planner.clone()) };
        let before = load();
        let tries = timed_runs(scene, runs, Until::FirstPlan, FIRST, &make)?;
        let times = sorted(tries.iter().map(Run::elapsed_ms));
        let costs = sorted(tries.iter().filter(|run| run.is_solved()).map(|run| run.cost_s));
        let success = share(&tries, Run::is_solved);
        let through = count(&tries, |run| run.findings.in_obstacle > 0);
        let deepest_m = tries.iter().map(|run| run.findings.deepest_m).fold(0.0, f64::max);
        let over = count(&tries, |run| run.findings.over_limit > 0);
        println!(
            "{}",
            json!({
                "block": "primitive_rrt", "rules": named, "scene": scene.name, "seeds": runs, "success": success,
                "first_median_ms": quantile(&times, 0.5), "first_p99_ms": quantile(&times, 0.99),
                "plans_in_obstacles": through, "deepest_m": deepest_m, "plans_over_limits": over,
                "median_cost_s": quantile(&costs, 0.5), "load_before": before, "load_after": load(),
            })
        );
        report.table.push(format!(
            "{:<10} primitives, {named}: {:.1} % solved, {through} of {runs} plans go through something, {deepest_m:.4} m deep at \
             most, {over} break limits; median {:.2} ms, {:.1} s",
            scene.name,
            100.0 * success,
            quantile(&times, 0.5),
            quantile(&costs, 0.5),
        ));
        if rules == PrimitiveRules::Continuous {
            report.none(
                &format!("{}: plans of continuously checked primitives that go through something", scene.name),
                through,
            );
        }
    }
    Ok(())
}

/// Infeasible, and the obstacle is named.
fn exactly_c(scene: &Scene, covering: usize, runs: usize, report: &mut Report) -> Result<(), Failure> {
    let before = load();
    let tries = timed_runs(scene, runs, Until::FirstPlan, FIRST, &flight_planner)?;
    let is_named = |run: &Run| matches!(run.status, Status::Infeasible(Obstruction::GoalBlocked { blocker: Blocker::Obstacle(index), .. }) if index == covering);
    let named = share(&tries, is_named);
    let times = sorted(tries.iter().map(Run::elapsed_ms));
    println!(
        "{}",
        json!({
            "block": "exactly_c", "scene": scene.name, "seeds": runs, "infeasible_and_named": named, "obstacle": covering,
            "median_ms": quantile(&times, 0.5), "load_before": before,
        })
    );
    report.at_least(&format!("{}: share infeasible, obstacle {covering} named", scene.name), named, 1.0);
    Ok(())
}

/// The bounding sphere of what must turn: a proof that it cannot pass.
fn gap_sphere(scene: &Scene, report: &mut Report) -> Result<(), Failure> {
    let clock = CoreClock::start();
    let request = scene.request(1, Until::FirstPlan);
    let answer = flight_planner().plan(&request, &mut Units::new(PLENTY)).map_err(failed)?;
    let elapsed_ms = 1e3 * clock.elapsed().as_secs_f64();
    let is_proven =
        matches!(&answer.status, Status::Infeasible(Obstruction::Enclosed { blockers }) if !blockers.is_empty());
    let status = format!("{:?}", answer.status);
    println!(
        "{}",
        json!({
            "block": "gap_sphere", "scene": scene.name, "radius_m": scene.shape.bounding_radius_m(), "status": status,
            "units": answer.units, "ms": elapsed_ms,
        })
    );
    report.target(format!("{}: proven to be enclosed", scene.name), is_proven, status);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planning_scenes::rattle_scene;
    use crate::targets::Target;
    use tumble_astrobee::worlds::WorldPreset;

    #[test]
    fn the_bounding_sphere_is_proven_not_to_pass() {
        let mut report = Report::default();
        gap_sphere(&gap_scene().unwrap().within_bounding_sphere().unwrap(), &mut report).unwrap();
        report.finish().unwrap();
    }

    #[test]
    fn exactly_c_is_blocked_by_the_obstacle_that_covers_it() {
        for (set, covering) in [(2, 1), (4, 4)] {
            let mut report = Report::default();
            exactly_c(&exactly_c_scene(set).unwrap(), covering, 1, &mut report).unwrap();
            exactly_c(&rattle_scene(WorldPreset::Granite, set).unwrap(), covering, 1, &mut report).unwrap();
            let met: Vec<bool> = report.targets.iter().map(Target::is_met).collect();
            assert_eq!(met, [true, false]);
        }
    }
}
