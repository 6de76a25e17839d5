//! Problem 7 and the scenarios of RATTLE: first plans, what becomes of them, and the original planner by its own rules.

use std::path::Path;
use std::time::{Duration, Instant};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use tumble_astrobee::planning_presets::{PrimitiveRules, rattle_goal, rattle_limits, rattle_rrt, rattle_shape};
use tumble_astrobee::worlds::{OBSTACLE_SETS, WorldPreset};
use tumble_dynamics::{AlignedBox, InertialParameters, ObstacleEllipsoid, World};
use tumble_planning::collision::{Blocker, BodyShape, EllipsoidWorld};
use tumble_planning::global::{
    FlightPlanner, FlightPlannerSettings, GlobalAnswer, GlobalPlanner, GlobalRequest, GoalRegion, MotionLimits,
    Objective, Obstruction, Status, Until,
};
use tumble_planning::{Budget, ModelBelief, PlanningError, TranslationState, Units};

use crate::Failure;
use crate::bench::{Bench, Goal, Row, quantile};
use crate::path_checker::{PathChecker, Rules};

const PROBLEM: &str = "rrt";
/// How long a plan is improved in the rows that say so.
const IMPROVED: Duration = Duration::from_millis(100);
/// What a first plan is given.
const FIRST: Duration = Duration::from_secs(5);
/// Units that the primitive planner may spend: more than its iterations use.
const PLENTY: u64 = 10_000_000;

/// Work until a moment: the clock that the planners do not have.
struct Deadline {
    start: Instant,
    limit: Duration,
}

impl Deadline {
    fn after(limit: Duration) -> Self {
        Self { start: Instant::now(), limit }
    }
}

impl Budget for Deadline {
    fn spend(&mut self, _units: u64) -> bool {
        self.start.elapsed() < self.limit
    }
}

/// A problem to plan.
struct Scene {
    name: String,
    /// Of the runs of RATTLE, where they were flown.
    place: Option<WorldPreset>,
    world: World,
    queries: EllipsoidWorld,
    shape: BodyShape,
    belief: ModelBelief,
    start: TranslationState,
    attitude: UnitQuaternion<f64>,
    goal: GoalRegion,
    limits: MotionLimits,
    /// Time of a first plan to reach, and the peer's.
    time_goal: Goal,
}

type Planner = dyn GlobalPlanner<EllipsoidWorld>;

impl Scene {
    fn request(&self, seed: u64, until: Until) -> GlobalRequest<'_, EllipsoidWorld> {
        GlobalRequest {
            world: &self.queries,
            body: &self.shape,
            start: self.start,
            attitude: self.attitude,
            start_s: 0.0,
            goal: self.goal,
            limits: self.limits,
            belief: &self.belief,
            objective: Objective::Duration,
            margin_m: 0.0,
            until,
            seed,
        }
    }

    fn checker(&self) -> PathChecker<'_> {
        PathChecker::new(Rules {
            world: &self.world,
            body: &self.shape,
            parameters: self.belief.parameters(),
            limits: &self.limits,
            start: self.start,
            goal: &self.goal,
            margin_m: 0.0,
        })
    }
}

fn failed(error: PlanningError) -> Failure {
    Failure::TargetMissed(format!("{PROBLEM}: {error}"))
}

pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    let names = |scene: &Scene| bench.wants(PROBLEM, &scene.name);
    let mut scenes = rattle_scenes()?;
    match &bench.data {
        Some(folder) => scenes.extend(frozen_scenes(&folder.join("rrt_scenes.txt"))?),
        None => eprintln!("skipped: the frozen scenes of problem 7 (--data DIR)"),
    }
    for scene in scenes.iter().filter(|scene| names(scene)) {
        compare(bench, scene)?;
    }
    if bench.wants(PROBLEM, "exactly_c") {
        for set in [2, 4] {
            exactly_c(bench, set)?;
        }
    }
    Ok(())
}

fn compare(bench: &Bench, scene: &Scene) -> Result<(), Failure> {
    let flight = || -> Box<Planner> { Box::new(FlightPlanner::new(FlightPlannerSettings::default())) };
    let tries = first_plans(scene, bench.runs, &flight)?;
    report(bench, scene, "", &tries, scene.time_goal);

    // what a plan may cost at best: the best of one long run and of every run below
    let mut best_s = f64::INFINITY;
    if bench.reference > 0 {
        let mut long = Deadline::after(Duration::from_secs(bench.reference as u64));
        best_s = flight().plan(&scene.request(0, Until::BudgetSpent), &mut long).map_err(failed)?.cost;
    }
    improved_plans(bench, scene, best_s, &flight)?;

    let Some(place) = scene.place else { return Ok(()) };
    for (suffix, rules) in [("/original", PrimitiveRules::Original), ("/continuous", PrimitiveRules::Continuous)] {
        let planner = rattle_rrt(place, rules).ok_or_else(|| Failure::BadInput("no preset".to_owned()))?;
        let planner = planner.map_err(failed)?;
        let make = || -> Box<Planner> { Box::new(planner.clone()) };
        let tries = first_plans(scene, bench.runs, &make)?;
        report(bench, scene, suffix, &tries, Goal::default());
    }
    Ok(())
}

/// One run of a planner and what the checker says of it.
struct Try {
    elapsed_ns: f64,
    answer: GlobalAnswer,
    collides: bool,
    breaks_limits: bool,
    /// It jumps, or ends elsewhere than in the goal region.
    is_broken: bool,
    deepest_m: f64,
}

fn first_plans(scene: &Scene, runs: usize, planner: &dyn Fn() -> Box<Planner>) -> Result<Vec<Try>, Failure> {
    let checker = scene.checker();
    (1..=runs as u64)
        .map(|seed| {
            let request = scene.request(seed, Until::FirstPlan);
            let mut planner = planner();
            let mut deadline = Deadline::after(FIRST);
            let start = Instant::now();
            let answer = planner.plan(&request, &mut deadline).map_err(failed)?;
            let elapsed_ns = start.elapsed().as_nanos() as f64;
            Ok(judged(&checker, answer, elapsed_ns))
        })
        .collect()
}

fn judged(checker: &PathChecker<'_>, answer: GlobalAnswer, elapsed_ns: f64) -> Try {
    let findings = answer.plan.as_ref().map(|plan| checker.check(&plan.trajectory)).unwrap_or_default();
    let collides = findings.in_obstacle > 0;
    let is_broken = findings.jumps > 0 || findings.misses_goal;
    let breaks_limits = findings.over_limit > 0;
    Try { elapsed_ns, answer, collides, breaks_limits, is_broken, deepest_m: findings.deepest_m }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

fn share(tries: &[Try], what: impl Fn(&Try) -> bool) -> f64 {
    tries.iter().filter(|one| what(one)).count() as f64 / tries.len().max(1) as f64
}

fn count(tries: &[Try], what: impl Fn(&Try) -> bool) -> f64 {
    tries.iter().filter(|one| what(one)).count() as f64
}

fn report(bench: &Bench, scene: &Scene, suffix: &str, tries: &[Try], goal: Goal) {
    let times = sorted(tries.iter().map(|one| one.elapsed_ns));
    let solved = |one: &&Try| one.answer.plan.is_some();
    let costs = sorted(tries.iter().filter(solved).map(|one| one.answer.cost));
    let units = sorted(tries.iter().map(|one| one.answer.units as f64));
    let nodes = sorted(tries.iter().map(|one| one.answer.tree.len() as f64));
    let quality = vec![
        ("success", share(tries, |one| one.answer.plan.is_some())),
        ("plans_in_collision", count(tries, |one| one.collides)),
        ("plans_over_limits", count(tries, |one| one.breaks_limits)),
        ("plans_broken", count(tries, |one| one.is_broken)),
        ("deepest_m", tries.iter().map(|one| one.deepest_m).fold(0.0, f64::max)),
        ("median_cost_s", quantile(&costs, 0.5)),
        ("median_units", quantile(&units, 0.5)),
        ("median_edges", quantile(&nodes, 0.5)),
    ];
    bench.report(&Row {
        problem: PROBLEM,
        item: format!("{}{suffix}", scene.name).leak(),
        median_ns: quantile(&times, 0.5),
        p99_ns: quantile(&times, 0.99),
        n: tries.len(),
        quality,
        goal,
        calibration_ns: bench.calibrate(),
    });
}

/// The cost after a tenth of a second, beside its bound and the best cost known.
fn improved_plans(
    bench: &Bench,
    scene: &Scene,
    reference_s: f64,
    planner: &dyn Fn() -> Box<Planner>,
) -> Result<(), Failure> {
    let checker = scene.checker();
    let mut tries = Vec::with_capacity(bench.runs);
    for seed in 1..=bench.runs as u64 {
        let request = scene.request(seed, Until::BudgetSpent);
        let mut planner = planner();
        let mut deadline = Deadline::after(IMPROVED);
        let start = Instant::now();
        let answer = planner.plan(&request, &mut deadline).map_err(failed)?;
        let elapsed_ns = start.elapsed().as_nanos() as f64;
        tries.push(judged(&checker, answer, elapsed_ns));
    }
    let costs = sorted(tries.iter().map(|one| one.answer.cost));
    let best_s = costs.first().copied().unwrap_or(f64::INFINITY).min(reference_s);
    let bounds = sorted(tries.iter().map(|one| one.answer.lower_bound));
    let gaps = sorted(tries.iter().map(|one| one.answer.cost / one.answer.lower_bound - 1.0));
    let times = sorted(tries.iter().map(|one| one.elapsed_ns));
    let rises = |one: &Try| one.answer.history.windows(2).any(|pair| pair[1].cost >= pair[0].cost);
    let quality = vec![
        ("success", share(&tries, |one| one.answer.plan.is_some())),
        ("plans_in_collision", count(&tries, |one| one.collides)),
        ("plans_over_limits", count(&tries, |one| one.breaks_limits)),
        ("plans_broken", count(&tries, |one| one.is_broken)),
        ("median_cost_s", quantile(&costs, 0.5)),
        ("worst_cost_s", quantile(&costs, 1.0)),
        ("best_cost_s", best_s),
        ("within_1_percent", share(&tries, |one| one.answer.cost <= 1.01 * best_s)),
        ("median_bound_s", quantile(&bounds, 0.5)),
        ("median_gap", quantile(&gaps, 0.5)),
        ("bounds_above_best", count(&tries, |one| one.answer.lower_bound > best_s * (1.0 + 1e-9))),
        ("rising_costs", count(&tries, rises)),
        ("optimal", share(&tries, |one| one.answer.status == Status::Optimal)),
    ];
    bench.report(&Row {
        problem: PROBLEM,
        item: format!("{}/100ms", scene.name).leak(),
        median_ns: quantile(&times, 0.5),
        p99_ns: quantile(&times, 0.99),
        n: tries.len(),
        quality,
        goal: Goal::default(),
        calibration_ns: bench.calibrate(),
    });
    Ok(())
}

/// The five obstacle sets of both places, from A to the goal region around B.
fn rattle_scenes() -> Result<Vec<Scene>, Failure> {
    let places = [WorldPreset::Granite, WorldPreset::Iss];
    let sets = places.into_iter().flat_map(|place| (0..OBSTACLE_SETS).map(move |set| (place, set)));
    sets.map(|(place, set)| rattle_scene(place, set)).collect()
}

fn rattle_scene(place: WorldPreset, set: u8) -> Result<Scene, Failure> {
    let missing = || Failure::BadInput(format!("{} has no runs", place.name()));
    let (a, b) = (place.pose("A").ok_or_else(missing)?, place.pose("B").ok_or_else(missing)?);
    let obstacles = place.obstacles(set).ok_or_else(missing)?;
    let world = World { obstacles, ..place.volumes() };
    Ok(Scene {
        name: format!("{}_{set}", place.name()),
        place: Some(place),
        queries: EllipsoidWorld::new(&world).map_err(failed)?,
        world,
        shape: rattle_shape().map_err(failed)?,
        belief: ModelBelief::certain(1, place.body()),
        start: TranslationState::at_rest(a.translation.vector),
        attitude: a.rotation,
        goal: rattle_goal(place, &b.translation.vector).ok_or_else(missing)?,
        limits: rattle_limits(place, &a.translation.vector).ok_or_else(missing)?,
        time_goal: Goal { target_ns: Some(1e6), peer: None },
    })
}

/// Problem 7: a point among ellipsoids that were grown by the robot's radius.
fn frozen_scenes(path: &Path) -> Result<Vec<Scene>, Failure> {
    const POINT_RADIUS_M: f64 = 1e-6;
    const MASS_KG: f64 = 9.58;
    let text = std::fs::read_to_string(path).map_err(|error| Failure::file(path, error))?;
    let short = || Failure::file(path, "is cut off");
    let mut words = text.split_whitespace();
    let mut scenes = Vec::new();
    while words.next().is_some() {
        let name = words.next().ok_or_else(short)?.to_owned();
        let number: usize = words.next().and_then(|word| word.parse().ok()).ok_or_else(short)?;
        let obstacles = (0..number)
            .map(|_| {
                let mut next = || words.next().and_then(|word| word.parse::<f64>().ok()).ok_or_else(short);
                let center = Translation3::new(next()?, next()?, next()?);
                let rotation = UnitQuaternion::new_normalize(Quaternion::new(next()?, next()?, next()?, next()?));
                let semi_axes = Vector3::new(next()?, next()?, next()?);
                let world_from_ellipsoid = Isometry3::from_parts(center, rotation);
                Ok(ObstacleEllipsoid { world_from_ellipsoid, semi_axes })
            })
            .collect::<Result<Vec<_>, Failure>>()?;
        let world = World { obstacles, ..World::default() };
        let corner = Vector3::new(0.59, 3.04, 0.69);
        let inertia = nalgebra::Matrix3::identity() * 0.15;
        let peer_ns = match name.as_str() {
            "jem2" => 4.8e6,
            "jem5" => 13.1e6,
            _ => 15.5e6,
        };
        scenes.push(Scene {
            place: None,
            queries: EllipsoidWorld::new(&world).map_err(failed)?,
            world,
            shape: BodyShape::sphere(POINT_RADIUS_M).map_err(failed)?,
            belief: ModelBelief::certain(1, InertialParameters::about_origin(MASS_KG, Vector3::zeros(), inertia)),
            start: TranslationState::at_rest(Vector3::new(0.0, -2.8, 0.0)),
            attitude: UnitQuaternion::identity(),
            goal: GoalRegion { position: Vector3::new(0.0, 2.8, 0.0), radius_m: 0.25, speed_m_s: 0.1, attitude: None },
            limits: MotionLimits {
                position: AlignedBox::between(-corner, corner),
                speed_m_s: Vector3::repeat(0.2),
                force_n: Vector3::repeat(0.45),
                torque_n_m: Vector3::repeat(0.045),
                rate_rad_s: 0.1,
            },
            time_goal: Goal::at(0.5e6, "OMPL control::RRT", peer_ns),
            name,
        });
    }
    Ok(scenes)
}

/// The table's point C itself, at rest, where an obstacle covers it: infeasible, and the obstacle is named.
fn exactly_c(bench: &Bench, set: u8) -> Result<(), Failure> {
    let scene = exactly_c_scene(set)?;
    let mut times = Vec::with_capacity(bench.runs);
    let mut named = 0.0;
    let mut blocker = -1.0;
    for seed in 1..=bench.runs as u64 {
        let request = scene.request(seed, Until::FirstPlan);
        let mut planner = FlightPlanner::new(FlightPlannerSettings::default());
        let start = Instant::now();
        let answer = planner.plan(&request, &mut Units::new(PLENTY)).map_err(failed)?;
        times.push(start.elapsed().as_nanos() as f64);
        if let Status::Infeasible(Obstruction::GoalBlocked { blocker: Blocker::Obstacle(index), .. }) = answer.status {
            named += 1.0;
            blocker = index as f64;
        }
    }
    times.sort_by(f64::total_cmp);
    bench.report(&Row {
        problem: PROBLEM,
        item: format!("exactly_c/{}", scene.name).leak(),
        median_ns: quantile(&times, 0.5),
        p99_ns: quantile(&times, 0.99),
        n: times.len(),
        quality: vec![("infeasible", named / bench.runs as f64), ("obstacle", blocker)],
        goal: Goal::default(),
        calibration_ns: bench.calibrate(),
    });
    Ok(())
}

fn exactly_c_scene(set: u8) -> Result<Scene, Failure> {
    let mut scene = rattle_scene(WorldPreset::Granite, set)?;
    let c = WorldPreset::Granite.pose("C").ok_or_else(|| Failure::BadInput("there is no C".to_owned()))?;
    scene.goal = GoalRegion { position: c.translation.vector, radius_m: 0.0, speed_m_s: 0.0, attitude: None };
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two seeds of every scenario with the planner to use: a plan each, and nothing wrong with it.
    #[test]
    fn every_run_of_rattle_is_planned_without_fault() {
        for scene in rattle_scenes().unwrap() {
            let checker = scene.checker();
            for seed in [1, 2] {
                let request = scene.request(seed, Until::FirstPlan);
                let mut planner = FlightPlanner::new(FlightPlannerSettings::default());
                let answer = planner.plan(&request, &mut Units::new(1_000_000)).unwrap();
                let plan = answer.plan.unwrap_or_else(|| panic!("{}: {:?}", scene.name, answer.status));
                let findings = checker.check(&plan.trajectory);
                assert!(findings.is_clean(), "{} {seed}: {findings:?}", scene.name);
                assert!(answer.lower_bound <= answer.cost);
            }
        }
    }

    /// The original by its own rules flies through things, which the checker sees; the same primitives checked continuously
    /// do not.
    #[test]
    fn the_original_rules_are_unsafe_and_the_continuous_ones_are_not() {
        let mut unsafe_plans = 0;
        for (place, set) in [(WorldPreset::Iss, 1), (WorldPreset::Granite, 1)] {
            let scene = rattle_scene(place, set).unwrap();
            let checker = scene.checker();
            for rules in [PrimitiveRules::Original, PrimitiveRules::Continuous] {
                let planner = rattle_rrt(place, rules).unwrap().unwrap();
                for seed in 1..=6 {
                    let request = scene.request(seed, Until::FirstPlan);
                    let answer = planner.clone().plan(&request, &mut Units::new(PLENTY)).unwrap();
                    let Some(plan) = answer.plan else { continue };
                    let findings = checker.check(&plan.trajectory);
                    match rules {
                        PrimitiveRules::Original => unsafe_plans += usize::from(findings.in_obstacle > 0),
                        PrimitiveRules::Continuous => {
                            assert!(findings.is_clean(), "{} {seed}: {findings:?}", scene.name)
                        }
                    }
                }
            }
        }
        assert!(unsafe_plans > 0);
    }

    #[test]
    fn exactly_c_is_blocked_by_the_obstacle_that_covers_it() {
        for (set, covering) in [(2, 1), (4, 4)] {
            let scene = exactly_c_scene(set).unwrap();
            let mut planner = FlightPlanner::new(FlightPlannerSettings::default());
            let answer = planner.plan(&scene.request(1, Until::FirstPlan), &mut Units::new(PLENTY)).unwrap();
            let Status::Infeasible(Obstruction::GoalBlocked { blocker, clearance_m }) = answer.status else {
                panic!("{:?}", answer.status)
            };
            assert_eq!(blocker, Blocker::Obstacle(covering));
            assert!(clearance_m < 0.0 && answer.plan.is_none());
        }
    }
}
