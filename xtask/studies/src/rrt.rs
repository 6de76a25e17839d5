//! Problem 7 and the scenarios of RATTLE: first plans beside the peers', and the original planner by its own rules.

use std::time::Duration;

use tumble_astrobee::planning_presets::{PrimitiveRules, rattle_rrt};
use tumble_planning::global::Until;

use crate::Failure;
use crate::bench::{Bench, Goal, Row, quantile};
use crate::planning_runs::{Planner, Run, count, flight_planner, share, sorted, timed_runs};
use crate::planning_scenes::{PEERS, Scene, failed, frozen_scenes, gap_scene, rattle_scenes};

const PROBLEM: &str = "rrt";
/// What a first plan is given.
const FIRST: Duration = Duration::from_secs(5);

pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    let mut scenes = rattle_scenes()?;
    scenes.extend(frozen_scenes()?);
    scenes.push(gap_scene()?);
    for scene in scenes.iter().filter(|scene| bench.wants(PROBLEM, &scene.name)) {
        compare(bench, scene)?;
    }
    Ok(())
}

fn compare(bench: &Bench, scene: &Scene) -> Result<(), Failure> {
    let goal = match PEERS.iter().find(|(name, ..)| *name == scene.name) {
        Some((_, peer_ms, _)) => Goal::at(0.5e6, "OMPL control::RRT", 1e6 * peer_ms),
        None if scene.place.is_some() => Goal { target_ns: Some(1e6), peer: None },
        None => Goal { target_ns: Some(50e6), peer: None },
    };
    report(bench, scene, "", goal, &flight_planner)?;
    let Some(place) = scene.place else { return Ok(()) };
    for (suffix, rules) in [("/original", PrimitiveRules::Original), ("/continuous", PrimitiveRules::Continuous)] {
        let planner = rattle_rrt(place, rules).ok_or_else(|| Failure::BadInput("no preset".to_owned()))?;
        let planner = planner.map_err(failed)?;
        report(bench, scene, suffix, Goal::default(), &|| -> Box<Planner> { Box::new(planner.clone()) })?;
    }
    Ok(())
}

fn report(
    bench: &Bench,
    scene: &Scene,
    suffix: &str,
    goal: Goal,
    planner: &dyn Fn() -> Box<Planner>,
) -> Result<(), Failure> {
    let calibration_ns = bench.calibrate();
    let runs = timed_runs(scene, bench.runs, Until::FirstPlan, FIRST, planner)?;
    let times = sorted(runs.iter().map(|run| run.elapsed.as_nanos() as f64));
    let costs = sorted(runs.iter().filter(|run| run.is_solved()).map(|run| run.cost_s));
    let units = sorted(runs.iter().map(|run| run.units as f64));
    let edges = sorted(runs.iter().map(|run| run.edges as f64));
    let quality = vec![
        ("success", share(&runs, Run::is_solved)),
        ("plans_in_collision", count(&runs, |run| run.findings.in_obstacle > 0)),
        ("plans_over_limits", count(&runs, |run| run.findings.over_limit > 0)),
        ("plans_broken", count(&runs, |run| run.findings.jumps > 0 || run.findings.misses_goal)),
        ("deepest_m", runs.iter().map(|run| run.findings.deepest_m).fold(0.0, f64::max)),
        ("median_cost_s", quantile(&costs, 0.5)),
        ("median_units", quantile(&units, 0.5)),
        ("median_edges", quantile(&edges, 0.5)),
    ];
    bench.report(&Row {
        problem: PROBLEM,
        item: format!("{}{suffix}", scene.name).leak(),
        median_ns: quantile(&times, 0.5),
        p99_ns: quantile(&times, 0.99),
        n: runs.len(),
        quality,
        goal,
        calibration_ns,
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Vector3};
    use tumble_astrobee::worlds::WorldPreset;
    use tumble_dynamics::ObstacleEllipsoid;
    use tumble_planning::global::{FlightPlanner, GlobalPlanner};
    use tumble_planning::{ArcPath, BodyArc, Units};

    use crate::path_checker::{Findings, Sampling};
    use crate::planning_scenes::rattle_scene;

    /// For tests: more than the planners need, and looked at every centimetre or so.
    const UNITS: u64 = 200_000;
    const COARSE: Sampling = Sampling { step_s: 0.05, least: 1000 };

    fn first_plan(scene: &Scene, seed: u64) -> ArcPath {
        let request = scene.request(seed, Until::FirstPlan);
        let answer = FlightPlanner::default().plan(&request, &mut Units::new(UNITS)).unwrap();
        assert!(answer.lower_bound <= answer.cost);
        answer.plan.unwrap_or_else(|| panic!("{}: {:?}", scene.name, answer.status)).trajectory
    }

    /// A seed of every scenario with the planner to use: a plan each, and nothing wrong with it.
    #[test]
    fn every_run_of_rattle_is_planned_without_fault() {
        for (seed, scene) in (1..).zip(rattle_scenes().unwrap()) {
            let findings = scene.checker().sampled(COARSE).check(&first_plan(&scene, seed));
            assert!(findings.is_clean(), "{} {seed}: {findings:?}", scene.name);
        }
    }

    fn map(path: &ArcPath, change: impl FnMut(BodyArc) -> BodyArc) -> ArcPath {
        ArcPath::new(path.arcs().iter().copied().map(change))
    }

    /// A real plan, and each way in which it could be wrong.
    #[test]
    fn faults_planted_in_a_plan_are_all_counted() {
        for (place, set) in [(WorldPreset::Iss, 1), (WorldPreset::Granite, 1)] {
            let scene = rattle_scene(place, set).unwrap();
            let path = first_plan(&scene, 3);
            let check = |scene: &Scene, path: &ArcPath| scene.checker().sampled(COARSE).check(path);
            assert!(check(&scene, &path).is_clean());
            let is_only = |findings: Findings, what: &dyn Fn(&Findings) -> bool| {
                assert!(what(&findings) && findings.in_obstacle == 0, "{findings:?}");
            };

            let whole = path.arcs();
            let longest =
                (0..whole.len()).max_by(|a, b| whole[*a].duration_s.total_cmp(&whole[*b].duration_s)).unwrap();
            let without = whole.iter().enumerate().filter(|(index, _)| *index != longest).map(|(_, arc)| *arc);
            assert!(check(&scene, &ArcPath::new(without)).jumps > 0);
            is_only(check(&scene, &ArcPath::new(whole[..1].iter().copied())), &|f| f.misses_goal);

            // flown in 98 % of the time: the same way, too fast and too hard
            let hurried = map(&path, |mut arc| {
                arc.duration_s *= 0.98;
                for (power, coefficient) in (0..).zip(&mut arc.position) {
                    *coefficient /= 0.98_f64.powi(power);
                }
                arc
            });
            is_only(check(&scene, &hurried), &|f| f.over_limit > 0);
            let mut slow = rattle_scene(place, set).unwrap();
            slow.limits.speed_m_s *= 0.98;
            is_only(check(&slow, &path), &|f| f.over_limit > 0);
            let mut weak = rattle_scene(place, set).unwrap();
            weak.limits.force_n *= 0.98;
            is_only(check(&weak, &path), &|f| f.over_limit > 0);

            // a millimetre beyond the box
            let mut narrow = rattle_scene(place, set).unwrap();
            let reached = (0..1000).map(|i| path.duration_s() * f64::from(i) / 999.0);
            let reached = reached.map(|time_s| place_at(whole, time_s).x).fold(f64::NEG_INFINITY, f64::max);
            narrow.limits.position.upper_world.x = reached - 1e-3;
            is_only(check(&narrow, &path), &|f| f.over_limit > 0);

            // a sheet of 0.1 mm across the way, which no arc begins or ends in
            let mut sheet = rattle_scene(place, set).unwrap();
            let middle = place_at(whole, 0.5 * path.duration_s());
            let onward = place_at(whole, 0.5 * path.duration_s() + 0.1) - middle;
            let along = nalgebra::UnitQuaternion::rotation_between(&Vector3::x(), &onward).unwrap();
            sheet.world.obstacles.push(ObstacleEllipsoid {
                world_from_ellipsoid: Isometry3::from_parts(middle.into(), along),
                semi_axes: Vector3::new(5e-5, 0.05, 0.05),
            });
            let findings = check(&sheet, &path);
            assert!(findings.in_obstacle > 0 && findings.deepest_m > 0.1, "{findings:?}");
        }
    }

    fn place_at(arcs: &[BodyArc], time_s: f64) -> Vector3<f64> {
        let mut since_s = time_s;
        for arc in arcs {
            if since_s <= arc.duration_s {
                return arc.translation(since_s).0.position;
            }
            since_s -= arc.duration_s;
        }
        arcs.last().map(|arc| arc.translation(arc.duration_s).0.position).unwrap()
    }

    /// The original by its own rules flies through things, which the checker sees; the same primitives checked continuously
    /// do not.
    #[test]
    fn the_original_rules_are_unsafe_and_the_continuous_ones_are_not() {
        let mut unsafe_plans = 0;
        for (place, set) in [(WorldPreset::Iss, 1), (WorldPreset::Granite, 1)] {
            let scene = rattle_scene(place, set).unwrap();
            let checker = scene.checker().sampled(COARSE);
            for rules in [PrimitiveRules::Original, PrimitiveRules::Continuous] {
                let planner = rattle_rrt(place, rules).unwrap().unwrap();
                for seed in 1..=6 {
                    let request = scene.request(seed, Until::FirstPlan);
                    let answer = planner.clone().plan(&request, &mut Units::new(10_000_000)).unwrap();
                    let Some(plan) = answer.plan else { continue };
                    let findings = checker.check(&plan.trajectory);
                    match rules {
                        PrimitiveRules::Original => unsafe_plans += usize::from(findings.in_obstacle > 0),
                        _ => {
                            assert!(findings.is_clean(), "{} {seed}: {findings:?}", scene.name);
                        }
                    }
                }
            }
        }
        assert!(unsafe_plans > 0);
    }
}
