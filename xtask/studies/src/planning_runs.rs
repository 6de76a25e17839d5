//! Runs of planners over seeds: one after the other where they are timed, on all cores where they are judged.

use std::time::Duration;

use tumble_planning::collision::EllipsoidWorld;
use tumble_planning::global::{FlightPlanner, GlobalAnswer, GlobalPlanner, Status, Until};

use crate::Failure;
use crate::core_clock::{CoreBudget, CoreClock};
use crate::path_checker::Findings;
use crate::planning_scenes::{Scene, failed};

pub type Planner = dyn GlobalPlanner<EllipsoidWorld>;

pub fn flight_planner() -> Box<Planner> {
    Box::new(FlightPlanner::default())
}

/// One run of a planner.
pub struct Run {
    pub seed: u64,
    pub elapsed: Duration,
    pub status: Status,
    pub cost_s: f64,
    pub bound_s: f64,
    pub units: u64,
    pub edges: usize,
    /// A later plan that was not better than the one before it.
    pub rises: bool,
    plan: Option<tumble_planning::ArcPath>,
    /// What the checker says of the plan; nothing without one.
    pub findings: Findings,
}

impl Run {
    pub fn new(seed: u64, elapsed: Duration, answer: GlobalAnswer) -> Self {
        Self {
            seed,
            elapsed,
            cost_s: answer.cost,
            bound_s: answer.lower_bound,
            units: answer.units,
            edges: answer.tree.len(),
            rises: answer.history.windows(2).any(|pair| pair[1].cost >= pair[0].cost),
            status: answer.status,
            plan: answer.plan.map(|plan| plan.trajectory),
            findings: Findings::default(),
        }
    }

    pub fn is_solved(&self) -> bool {
        self.plan.is_some()
    }

    /// By how much the cost exceeds the bound, as a share of the cost.
    pub fn gap(&self) -> f64 {
        (self.cost_s - self.bound_s) / self.cost_s
    }

    pub fn elapsed_ms(&self) -> f64 {
        1e3 * self.elapsed.as_secs_f64()
    }
}

/// A fresh planner for each of the seeds 1 to `runs`, timed; then every plan is judged.
pub fn timed_runs(
    scene: &Scene,
    runs: usize,
    until: Until,
    limit: Duration,
    planner: &dyn Fn() -> Box<Planner>,
) -> Result<Vec<Run>, Failure> {
    let run = |seed: u64| {
        let mut planner = planner();
        let request = scene.request(seed, until);
        let clock = CoreClock::start();
        let answer = planner.plan(&request, &mut CoreBudget::new(limit)).map_err(failed)?;
        Ok(Run::new(seed, clock.elapsed(), answer))
    };
    let mut runs = (1..=runs as u64).map(run).collect::<Result<Vec<Run>, Failure>>()?;
    judge(scene, &mut runs);
    Ok(runs)
}

/// Has every plan looked at, on all cores.
pub fn judge(scene: &Scene, runs: &mut [Run]) {
    let checker = scene.checker();
    let share = runs.len().div_ceil(cores()).max(1);
    std::thread::scope(|scope| {
        for part in runs.chunks_mut(share) {
            let checker = &checker;
            scope.spawn(move || {
                for run in part {
                    if let Some(path) = &run.plan {
                        run.findings = checker.check(path);
                    }
                }
            });
        }
    });
}

pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

pub fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

pub fn count(runs: &[Run], what: impl Fn(&Run) -> bool) -> f64 {
    runs.iter().filter(|run| what(run)).count() as f64
}

pub fn share(runs: &[Run], what: impl Fn(&Run) -> bool) -> f64 {
    count(runs, what) / runs.len().max(1) as f64
}
