//! What is known of the cells of one grid, and floods through those that are not blocked.

use super::grid::Grid;
use crate::budget::Budget;
use crate::collision::{Blocker, CollisionWorld};
use crate::error::PlanningError;
use crate::global::GlobalRequest;
use nalgebra::{Translation3, Vector3};
use tumble_dynamics::AlignedBox;
use tumble_lie::Pose;

/// Not reached.
pub(super) const NEVER: u32 = u32::MAX;
/// Work of one query of the clearance, in visits of a cell.
const QUERY_WORK: u32 = 8;
/// Visits of a cell that are one unit of a budget.
const WORK_PER_UNIT: u32 = 64;

/// Why a survey ended before it was complete.
pub(super) enum Stop {
    /// The budget refused.
    BudgetSpent,
    /// The world failed.
    Failed(PlanningError),
}

impl From<PlanningError> for Stop {
    fn from(error: PlanningError) -> Self {
        Self::Failed(error)
    }
}

/// What is certain of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cell {
    /// Nothing was asked.
    Unseen,
    /// No point of it is free at any time.
    Blocked,
    /// Neither.
    Mixed,
    /// Every point of it is free of what lasts.
    Free,
}

/// The grid with what is known of it.
#[derive(Clone, Debug)]
pub(super) struct Level {
    pub(super) grid: Grid,
    cells: Vec<Cell>,
    /// Between these lies the clearance at the centre of each cell, m.
    clearance_m: Vec<[f64; 2]>,
}

impl Level {
    pub(super) fn new(grid: Grid) -> Self {
        let len = grid.len();
        Self { grid, cells: vec![Cell::Unseen; len], clearance_m: vec![[f64::NEG_INFINITY, f64::INFINITY]; len] }
    }

    /// Between what the clearance at `position` lies, from what is known at the centre of the cell around it.
    fn clearance_near(&self, position: &Vector3<f64>) -> [f64; 2] {
        let cell = self.grid.cell_of(position);
        let away = f64::sqrt((self.grid.center(cell) - position).norm_squared()) * (1.0 + 1e-9);
        let [lower, upper] = self.clearance_m[cell];
        [lower - away, upper + away]
    }
}

/// A level being filled from a world, under a budget.
pub(super) struct Survey<'a, W: CollisionWorld + ?Sized> {
    request: &'a GlobalRequest<'a, W>,
    /// The level before, with larger cells.
    coarser: Option<&'a Level>,
    pub(super) level: Level,
    budget: &'a mut dyn Budget,
    work: u32,
}

impl<'a, W: CollisionWorld + ?Sized> Survey<'a, W> {
    pub(super) fn new(
        request: &'a GlobalRequest<'a, W>,
        coarser: Option<&'a Level>,
        grid: Grid,
        budget: &'a mut dyn Budget,
    ) -> Self {
        Self { request, coarser, level: Level::new(grid), budget, work: 0 }
    }

    /// Pays for work done.
    pub(super) fn pay(&mut self, work: u32) -> Result<(), Stop> {
        self.work += work;
        let units = self.work / WORK_PER_UNIT;
        self.work %= WORK_PER_UNIT;
        if units == 0 || self.budget.spend(u64::from(units)) { Ok(()) } else { Err(Stop::BudgetSpent) }
    }

    /// What is certain of a cell.
    ///
    /// The clearance changes by no more than the origin moves, so the one at the centre tells of all the cell.
    pub(super) fn look(&mut self, cell: usize) -> Result<Cell, Stop> {
        let known = self.level.cells[cell];
        if known != Cell::Unseen {
            return Ok(known);
        }
        let center = self.level.grid.center(cell);
        let half_diagonal_m = self.level.grid.half_diagonal_m();
        let margin_m = self.request.margin_m;
        let judge = |[lower, upper]: [f64; 2]| {
            if upper + half_diagonal_m < margin_m {
                Cell::Blocked
            } else if lower - half_diagonal_m >= margin_m {
                Cell::Free
            } else {
                Cell::Mixed
            }
        };
        let mut clearance_m =
            self.coarser.map_or([f64::NEG_INFINITY, f64::INFINITY], |coarser| coarser.clearance_near(&center));
        let mut judged = judge(clearance_m);
        if judged == Cell::Mixed {
            self.pay(QUERY_WORK)?;
            let distance_m = self.clearance(&center)?.0;
            clearance_m = [distance_m; 2];
            judged = judge(clearance_m);
        }
        self.level.cells[cell] = judged;
        self.level.clearance_m[cell] = clearance_m;
        Ok(judged)
    }

    /// Clearance at a position from what lasts, and what is nearest.
    fn clearance(&self, position: &Vector3<f64>) -> Result<(f64, Option<Blocker>), PlanningError> {
        lasting_clearance(self.request, position)
    }

    /// Least number of steps from the seeds to each cell, through cells that are not blocked; or only through wholly free
    /// ones with their centres inside the position limits.
    pub(super) fn flood(&mut self, seeds: &[usize], only_free: bool) -> Result<Vec<u32>, Stop> {
        let grid = self.level.grid.clone();
        let mut steps = vec![NEVER; grid.len()];
        let mut ring = Vec::new();
        let region = self.request.limits.position;
        let is_open = |cell: usize, state: Cell| match state {
            Cell::Free => !only_free || contains(&region, &grid.center(cell)),
            Cell::Mixed | Cell::Unseen => !only_free,
            Cell::Blocked => false,
        };
        for seed in seeds {
            if is_open(*seed, self.look(*seed)?) && steps[*seed] == NEVER {
                steps[*seed] = 0;
                ring.push(*seed);
            }
        }
        let mut step = 0;
        while !ring.is_empty() {
            step += 1;
            let mut next = Vec::new();
            for cell in ring {
                self.pay(1)?;
                grid.for_neighbours(cell, |neighbour| {
                    if steps[neighbour] == NEVER && is_open(neighbour, self.look(neighbour)?) {
                        steps[neighbour] = step;
                        next.push(neighbour);
                    }
                    Ok::<(), Stop>(())
                })?;
            }
            ring = next;
        }
        Ok(steps)
    }

    /// What separates the cells reached from `goals`: blockers of blocked cells that touch both a reached cell and the part
    /// of the rest that is connected to a goal. Each once, in order.
    pub(super) fn separating_blockers(&mut self, reached: &[u32], goals: &[usize]) -> Result<Vec<Blocker>, Stop> {
        let grid = self.level.grid.clone();
        let mut seen = vec![false; grid.len()];
        let mut stack: Vec<usize> = goals.iter().copied().filter(|goal| reached[*goal] == NEVER).collect();
        let mut blockers = Vec::new();
        for goal in &stack {
            seen[*goal] = true;
        }
        while let Some(cell) = stack.pop() {
            self.pay(1)?;
            let mut touches_reached = false;
            grid.for_neighbours(cell, |neighbour| {
                touches_reached |= reached[neighbour] != NEVER;
                if reached[neighbour] == NEVER && !seen[neighbour] {
                    seen[neighbour] = true;
                    stack.push(neighbour);
                }
                Ok::<(), Stop>(())
            })?;
            if touches_reached && self.look(cell)? == Cell::Blocked {
                self.pay(QUERY_WORK)?;
                blockers.extend(self.clearance(&grid.center(cell))?.1);
            }
        }
        blockers.sort_unstable();
        blockers.dedup();
        Ok(blockers)
    }

    /// Least largest layer along an axis of a way from `start` to a goal; layers count from the lower end, or from the upper
    /// one where `is_downward`. `None` where there is no way.
    pub(super) fn least_highest_layer(
        &mut self,
        start: usize,
        is_goal: &[bool],
        axis: usize,
        is_downward: bool,
    ) -> Result<Option<usize>, Stop> {
        let grid = self.level.grid.clone();
        let layer = |cell: usize| layer_of(&grid, cell, axis, is_downward);
        let mut seen = vec![false; grid.len()];
        let mut waiting = vec![Vec::new(); grid.count(axis)];
        seen[start] = true;
        waiting[layer(start)].push(start);
        for highest in 0..grid.count(axis) {
            while let Some(cell) = waiting[highest].pop() {
                if is_goal[cell] {
                    return Ok(Some(highest));
                }
                self.pay(1)?;
                grid.for_neighbours(cell, |neighbour| {
                    if !seen[neighbour] && self.look(neighbour)? != Cell::Blocked {
                        seen[neighbour] = true;
                        waiting[layer(neighbour).max(highest)].push(neighbour);
                    }
                    Ok::<(), Stop>(())
                })?;
            }
        }
        Ok(None)
    }
}

fn contains(region: &AlignedBox, point: &Vector3<f64>) -> bool {
    (0..3).all(|axis| region.lower_world[axis] <= point[axis] && point[axis] <= region.upper_world[axis])
}

/// Layer of a cell along an axis, from the lower or the upper end.
pub(super) fn layer_of(grid: &Grid, cell: usize, axis: usize, is_downward: bool) -> usize {
    let layer = grid.place(cell)[axis];
    if is_downward { grid.count(axis) - 1 - layer } else { layer }
}

/// Clearance from what lasts at a position and the attitude of the start, and what is nearest.
///
/// # Errors
/// What the world cannot answer.
pub(super) fn lasting_clearance<W: CollisionWorld + ?Sized>(
    request: &GlobalRequest<'_, W>,
    position: &Vector3<f64>,
) -> Result<(f64, Option<Blocker>), PlanningError> {
    let world_from_body = Pose::from_parts(Translation3::from(*position), request.attitude);
    let clearance = request.world.lasting_clearance(request.body, &world_from_body, request.start_s)?;
    Ok((clearance.distance_m, clearance.nearest))
}
