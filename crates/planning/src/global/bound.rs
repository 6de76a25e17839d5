//! A certified lower bound on the cost of every motion from the start to the goal region, and proofs that there is none.
//!
//! Lengths are measured in seconds at full speed: along axis `i` in units of its speed limit, and the longest of the three
//! counts. So the length of a path is no more than its duration, and a cube of edge `h` takes at least `h` to cross along an
//! axis. Cells that certainly lie in collision are blocked. A path cut every `h` steps only between cells that touch, none of
//! them blocked; so where a flood of touching cells needs `n` steps, the path is at least `n - 1` edges long and what the start
//! is away from the faces of its cell. To that comes what is lost in speeding up, in slowing down, and wherever the walls force
//! an axis to turn round.

mod grid;
mod least_time;
mod metric;
mod survey;
mod turning;

use super::diagnosis::check_numbers;
use super::{GlobalRequest, Objective, Obstruction};
use crate::budget::Budget;
use crate::collision::{Blocker, CollisionWorld};
use crate::error::PlanningError;
use crate::motion::TranslationState;
use grid::Grid;
use metric::{Metric, length_s};
use nalgebra::Vector3;
use survey::{Cell, Level, NEVER, Stop, Survey, lasting_clearance};

/// Cells of the first grid.
const FIRST_CELLS: f64 = 1000.0;

/// Whether a way leads to the goal region.
#[derive(Clone, Debug, PartialEq)]
pub enum Reachability {
    /// Neither is proven yet.
    Unknown,
    /// A way of certainly free cells does, past everything that never moves.
    Reachable,
    /// None does.
    Blocked(Obstruction),
}

/// What no motion can beat, refined step by step.
///
/// It holds for motions of the request's body at the request's attitude. For motions that turn, ask for a ball of
/// [`crate::collision::BodyShape::inscribed_radius_m`] instead of the body. Only what lasts counts as a wall
/// ([`CollisionWorld::lasting_clearance`]).
pub struct RouteBound<'r, W: CollisionWorld + ?Sized> {
    request: &'r GlobalRequest<'r, W>,
    metric: Metric,
    best_s: f64,
    reachability: Reachability,
    route: Vec<Vector3<f64>>,
    surveyed: Option<Surveyed>,
}

/// The last complete grid.
#[derive(Debug)]
struct Surveyed {
    level: Level,
    /// Steps from each cell to the nearest that touches the goal region.
    steps_to_goal: Vec<u32>,
}

impl<'r, W: CollisionWorld + ?Sized> RouteBound<'r, W> {
    /// The bound without any wall; [`Self::refine`] looks at those.
    ///
    /// # Errors
    /// Numbers that are not finite or have the wrong sign.
    pub fn new(request: &'r GlobalRequest<'r, W>) -> Result<Self, PlanningError> {
        check_numbers(request)?;
        let metric = Metric::new(request)?;
        let best_s = metric.unhindered_s(&metric.start, &metric.first);
        Ok(Self { request, metric, best_s, reachability: Reachability::Unknown, route: Vec::new(), surveyed: None })
    }

    /// No motion takes less, s; infinite where there certainly is none.
    pub fn least_duration_s(&self) -> f64 {
        self.best_s
    }

    /// No motion costs less, in the units of the request's objective.
    ///
    /// The impulse is at least what changes the start velocity to one that may be arrived with: a slow motion from rest needs
    /// as little as one likes, so walls add nothing.
    pub fn lower_bound(&self) -> f64 {
        match self.request.objective {
            Objective::Duration => self.best_s,
            Objective::Impulse if self.best_s.is_infinite() => f64::INFINITY,
            Objective::Impulse => self.least_impulse_n_s(),
        }
    }

    /// Least of `m |v - w|_1` over arrival velocities `w`, from below: any vector of components within one separates the two.
    fn least_impulse_n_s(&self) -> f64 {
        let mut speeds: [f64; 3] = self.request.start.velocity.map(f64::abs).into();
        speeds.sort_unstable_by(|a, b| b.total_cmp(a));
        let (mut sum, mut best) = (0.0, 0.0_f64);
        for (speed, root) in speeds.iter().zip([1.0, std::f64::consts::SQRT_2, f64::sqrt(3.0)]) {
            sum += speed;
            best = best.max(sum - root * self.request.goal.speed_m_s);
        }
        best * self.request.belief.parameters().mass * (1.0 - 1e-12)
    }

    /// No motion from this state, which lies on a way from the start to the goal, takes less to the goal region, s.
    pub fn least_duration_from_s(&self, state: &TranslationState) -> f64 {
        let metric = &self.metric;
        let first = state.velocity.zip_map(&metric.speed_m_s, |v, limit| if limit > 0.0 { v / limit } else { 0.0 });
        let unhindered_s = metric.unhindered_s(&state.position, &first);
        let Some(surveyed) = &self.surveyed else { return unhindered_s };
        let grid = &surveyed.level.grid;
        match surveyed.steps_to_goal.get(grid.cell_of(&state.position)) {
            Some(&NEVER) => f64::INFINITY,
            Some(&steps) => {
                let length_s = length_s(steps, grid.depth_s(&state.position), grid.edge_s());
                metric.along(length_s, first.amax(), metric.last.max()).max(unhindered_s)
            }
            None => unhindered_s,
        }
    }

    /// What is proven of the goal region.
    pub fn reachability(&self) -> &Reachability {
        &self.reachability
    }

    /// Positions from the start to the goal region between which straight moves are free of what lasts, where they were
    /// found; else empty. Moves from rest to rest along it are a plan that always exists.
    pub fn free_route(&self) -> &[Vector3<f64>] {
        &self.route
    }

    /// Edge of the cells of the last complete grid, s at full speed.
    pub fn edge_s(&self) -> Option<f64> {
        self.surveyed.as_ref().map(|surveyed| surveyed.level.grid.edge_s())
    }

    /// Looks once more with cells of half the edge. False where nothing more can come of it: the answer is known, the
    /// grid would be too large, or the budget is spent. One unit pays for eight queries of the clearance.
    ///
    /// # Errors
    /// What the world cannot answer.
    pub fn refine(&mut self, budget: &mut dyn Budget) -> Result<bool, PlanningError> {
        if matches!(self.reachability, Reachability::Blocked(_)) {
            return Ok(false);
        }
        let (region, speed) = (&self.request.limits.position, &self.metric.speed_m_s);
        let edge_s = match &self.surveyed {
            Some(surveyed) => Some(surveyed.level.grid.edge_s() * 0.5),
            None => Grid::edge_for(region, speed, FIRST_CELLS),
        };
        let Some(grid) = edge_s.and_then(|edge_s| Grid::over(region, speed, &self.metric.start, edge_s)) else {
            return Ok(false);
        };
        match self.survey(grid, budget) {
            Ok(is_more) => Ok(is_more),
            Err(Stop::BudgetSpent) => Ok(false),
            Err(Stop::Failed(error)) => Err(error),
        }
    }

    fn survey(&mut self, grid: Grid, budget: &mut dyn Budget) -> Result<bool, Stop> {
        let metric = self.metric.clone();
        let start = grid.cell_of(&metric.start);
        let goals = grid.touching_ball(&metric.goal, metric.radius_m);
        if goals.is_empty() {
            return Ok(false);
        }
        let coarser = self.surveyed.as_ref().map(|surveyed| &surveyed.level);
        let mut survey = Survey::new(self.request, coarser, grid, budget);
        let steps_from_start = survey.flood(&[start], false)?;
        let nearest = goals.iter().map(|goal| steps_from_start[*goal]).min().unwrap_or(NEVER);
        if nearest == NEVER {
            let obstruction = obstruction(&mut survey, self.request, start, &goals, &steps_from_start)?;
            self.best_s = f64::INFINITY;
            self.reachability = Reachability::Blocked(obstruction);
            return Ok(false);
        }
        let steps_to_goal = survey.flood(&goals, false)?;
        let grid = &survey.level.grid;
        let length_s = length_s(nearest, grid.depth_s(&metric.start), grid.edge_s());
        let along_s = metric.along(length_s, metric.first.amax(), metric.last.max());
        let turning_s = turning::least_time_s(&mut survey, &metric, start, &goals, &steps_from_start, &steps_to_goal)?;
        let mut route = Vec::new();
        if self.route.is_empty() {
            route = free_route(&mut survey, self.request, &metric, start, &goals)?;
        }
        let level = survey.level;
        if !route.is_empty() {
            self.route = route;
            self.reachability = Reachability::Reachable;
        }
        self.best_s = self.best_s.max(along_s).max(turning_s);
        self.surveyed = Some(Surveyed { level, steps_to_goal });
        Ok(true)
    }
}

/// Why no goal cell was reached.
fn obstruction<W: CollisionWorld + ?Sized>(
    survey: &mut Survey<'_, W>,
    request: &GlobalRequest<'_, W>,
    start: usize,
    goals: &[usize],
    reached: &[u32],
) -> Result<Obstruction, Stop> {
    let blocked_at = |position: &Vector3<f64>| -> Result<(f64, Blocker), PlanningError> {
        let (clearance_m, nearest) = lasting_clearance(request, position)?;
        Ok((clearance_m, nearest.unwrap_or(Blocker::KeepIn)))
    };
    if survey.look(start)? == Cell::Blocked {
        let (clearance_m, blocker) = blocked_at(&request.start.position)?;
        return Ok(Obstruction::StartBlocked { blocker, clearance_m });
    }
    for goal in goals {
        if survey.look(*goal)? != Cell::Blocked {
            let blockers = survey.separating_blockers(reached, goals)?;
            return Ok(Obstruction::Enclosed { blockers });
        }
    }
    let (clearance_m, blocker) = blocked_at(&request.goal.position)?;
    Ok(Obstruction::GoalBlocked { blocker, clearance_m })
}

/// A way through cells that are wholly free, as the corners of a path from the start to a point of the goal region; empty
/// where there is none. The way between the centres of two cells that touch stays within the two.
fn free_route<W: CollisionWorld + ?Sized>(
    survey: &mut Survey<'_, W>,
    request: &GlobalRequest<'_, W>,
    metric: &Metric,
    start: usize,
    goals: &[usize],
) -> Result<Vec<Vector3<f64>>, Stop> {
    let steps = survey.flood(&[start], true)?;
    let grid = survey.level.grid.clone();
    let arrival = |goal: usize| {
        let within = &request.limits.position;
        let point = grid.nearest_point(goal, &metric.goal).inf(&within.upper_world).sup(&within.lower_world);
        let is_inside = f64::sqrt((point - metric.goal).norm_squared()) <= metric.radius_m;
        is_inside.then_some(point)
    };
    let reached = goals.iter().filter(|goal| steps[**goal] != NEVER && arrival(**goal).is_some());
    let Some(goal) = reached.min_by_key(|goal| steps[**goal]).copied() else { return Ok(Vec::new()) };
    let mut route: Vec<Vector3<f64>> = arrival(goal).into_iter().collect();
    let mut cell = goal;
    while cell != start {
        push_corner(&mut route, grid.center(cell), grid.half_edges().max());
        let mut before = cell;
        grid.for_neighbours(cell, |neighbour| {
            if steps[neighbour] < steps[before] {
                before = neighbour;
            }
            Ok::<(), Stop>(())
        })?;
        cell = before;
    }
    push_corner(&mut route, metric.start, grid.half_edges().max());
    route.reverse();
    Ok(route)
}

/// Adds a point; the one before it is left out where it lies on the straight way to the new one.
fn push_corner(route: &mut Vec<Vector3<f64>>, point: Vector3<f64>, scale_m: f64) {
    if let [.., before, last] = route.as_slice() {
        let (first, second) = (last - before, point - last);
        if first.cross(&second).amax() <= 1e-12 * scale_m * scale_m && first.dot(&second) > 0.0 {
            route.pop();
        }
    }
    route.push(point);
}
