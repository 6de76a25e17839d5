//! The planner to use: exact edges between states, a first plan from two trees, then better ones for as long as the budget
//! lasts.
//!
//! # Source
//! The trees are those of RRT-Connect (Kuffner and LaValle 2000) over states at rest; shortcuts with exact steering follow
//! Hauser and Ng-Thow-Hing 2010; the tree that makes the whole asymptotically optimal is of this project.

mod chance;
mod connect;
mod explore;
mod flight;
mod improve;
mod search;

use super::{GlobalAnswer, GlobalPlanner, GlobalRequest, Obstruction, Status};
use crate::belief::Plan;
use crate::budget::Budget;
use crate::collision::CollisionWorld;
use crate::error::PlanningError;
use crate::motion::{ArcPath, TranslationState};
use connect::Connect;
use explore::Explore;
use flight::{Flight, Node};
use improve::Improve;
use search::{End, Search};
use tumble_lie::Pose;

/// How the planner searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightPlannerSettings {
    /// A plan whose cost exceeds the lower bound by no more than this share of it counts as optimal. Range: 0 to 1,
    /// default 1e-6.
    pub tolerance: f64,
}

impl Default for FlightPlannerSettings {
    fn default() -> Self {
        Self { tolerance: 1e-6 }
    }
}

/// A kinodynamic planner of motions at rest in attitude: anytime, asymptotically optimal, seeded. It keeps its memory from
/// one request to the next and nothing else.
#[derive(Default)]
pub struct FlightPlanner {
    settings: FlightPlannerSettings,
    connect: Connect,
    improve: Improve,
    explore: Explore,
    flight: Flight,
}

impl FlightPlanner {
    /// A planner with these settings.
    pub fn new(settings: FlightPlannerSettings) -> Self {
        Self { settings, ..Self::default() }
    }

    /// Searches until something ends it.
    fn search<W: CollisionWorld + ?Sized>(&mut self, search: &mut Search<'_, '_, W>, goal: Node) -> End {
        let mut round = || -> Result<(), End> {
            while !self.connect.find(search, goal, 2000, &mut self.flight)? {}
            search.offer(&self.flight)?;
            self.improve.run(search, &mut self.flight, 200)?;
            search.offer(&self.flight)?;
            loop {
                if let Some(best) = &search.best {
                    self.flight.clone_from(best);
                }
                let improved = self.improve.run(search, &mut self.flight, 400);
                search.offer(&self.flight)?;
                improved?;
                if self.connect.find(search, goal, 200, &mut self.flight)? {
                    let improved = self.improve.run(search, &mut self.flight, 200);
                    search.offer(&self.flight)?;
                    improved?;
                }
                if self.explore.run(search, &mut self.flight, 100)? {
                    search.offer(&self.flight)?;
                }
            }
        };
        match round() {
            Ok(()) => End::Stopped,
            Err(end) => end,
        }
    }
}

impl<W: CollisionWorld + ?Sized> GlobalPlanner<W> for FlightPlanner {
    fn plan(&mut self, request: &GlobalRequest<'_, W>, budget: &mut dyn Budget) -> Result<GlobalAnswer, PlanningError> {
        let limits = request.limits.translation(request.belief.parameters().mass)?;
        let mut search = Search::new(request, limits, 0.0, self.settings.tolerance, budget);
        search.lower_bound = search.least_time_to_goal_s(&search.start());
        self.explore.clear();
        let goal = Node {
            translation: TranslationState::at_rest(request.goal.position),
            attitude: request.goal.attitude.unwrap_or(request.attitude),
        };
        if let Some(obstruction) = blocked_at_start(request)? {
            return Ok(answer_without(Status::Infeasible(obstruction)));
        }
        let end = self.search(&mut search, goal);
        let status = match (end, &search.best) {
            (End::Error(error), _) => return Err(error),
            (_, None) => Status::BudgetSpent(search.blockers()),
            (End::Optimal, _) => Status::Optimal,
            (End::Stopped, _) => Status::Feasible,
        };
        let best = search.best.take();
        Ok(GlobalAnswer {
            status,
            cost: best.as_ref().map_or(f64::INFINITY, |best| best.cost),
            plan: best
                .map(|best| Plan { trajectory: ArcPath::new(best.arcs), model_revision: request.belief.revision }),
            lower_bound: search.lower_bound,
            units: search.units,
            history: search.history,
            tree: self.connect.edges().chain(self.explore.edges()).collect(),
        })
    }
}

fn blocked_at_start<W: CollisionWorld + ?Sized>(
    request: &GlobalRequest<'_, W>,
) -> Result<Option<Obstruction>, PlanningError> {
    let pose = Pose::from_parts(request.start.position.into(), request.attitude);
    let clearance = request.world.clearance(request.body, &pose, request.start_s)?;
    Ok(match clearance.nearest {
        Some(blocker) if clearance.distance_m < request.margin_m => {
            Some(Obstruction::StartBlocked { blocker, clearance_m: clearance.distance_m })
        }
        _ => None,
    })
}

fn answer_without(status: Status) -> GlobalAnswer {
    GlobalAnswer {
        status,
        plan: None,
        cost: f64::INFINITY,
        lower_bound: f64::INFINITY,
        units: 0,
        history: Vec::new(),
        tree: Vec::new(),
    }
}
