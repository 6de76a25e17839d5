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
mod replan;
mod search;
mod settings;

use super::{GlobalAnswer, GlobalPlanner, GlobalRequest, Objective, Status, diagnose};
use crate::belief::Plan;
use crate::budget::Budget;
use crate::collision::{CollisionWorld, EllipsoidWorld};
use crate::error::PlanningError;
use crate::motion::{ArcPath, TranslationState};
use connect::Connect;
use explore::Explore;
use flight::{Flight, Node};
use improve::Improve;
pub use replan::{Replanning, UnderWay};
use search::{End, Search};
pub use settings::FlightPlannerSettings;
use tumble_lie::Pose;

/// Units for one pair of trees before it starts anew.
const TREE_UNITS: u64 = 2000;
/// Units of one round: for another first plan and as many to improve it, for the best plan, and for the tree that fills the
/// space. Most goes to new plans: what improvement ends at depends on where it began.
const CANDIDATE_UNITS: u64 = 1200;
const BEST_UNITS: u64 = 400;
const EXPLORE_UNITS: u64 = 50;
/// Points of the goal region looked at for a free one.
const GOAL_TRIALS: u64 = 64;

/// A kinodynamic planner: anytime, seeded, for least duration asymptotically optimal. The body turns where that may help and
/// the limits allow it, about one axis at a time and from rest to rest. The planner keeps its allocations from one request to
/// the next and nothing else: no answer depends on those before.
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

    /// The planner among ellipsoids and boxes, compiled in this crate for programs that choose their planner at run time.
    pub fn among_ellipsoids(self) -> Box<dyn GlobalPlanner<EllipsoidWorld>> {
        Box::new(self)
    }

    /// Searches until something ends it.
    fn search<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        seeds: &[Node],
    ) -> Result<(), End> {
        // The tree's order is that of time.
        let is_fast = search.request.objective == Objective::Duration;
        if is_in_goal(search, &search.start()) {
            self.flight = Flight::default();
            search.offer(&self.flight)?;
        }
        self.first_plan(search, seeds)?;
        search.offer(&self.flight)?;
        self.improve.run(search, &mut self.flight, CANDIDATE_UNITS)?;
        loop {
            if let Some(best) = &search.best {
                self.flight.clone_from(best);
            }
            self.improve.run(search, &mut self.flight, BEST_UNITS)?;
            let goal = Self::goal(search)?;
            let wait_s = search.draw_wait_s()?;
            if self.connect.find(search, goal, &[], wait_s, CANDIDATE_UNITS, &mut self.flight)? {
                search.offer(&self.flight)?;
                self.improve.run(search, &mut self.flight, CANDIDATE_UNITS)?;
            }
            if is_fast && self.explore.run(search, &mut self.flight, EXPLORE_UNITS)? {
                search.offer(&self.flight)?;
            }
            search.refine_bound(0.2)?;
        }
    }

    /// Looks for any plan: by trees, and by way of cells that are free.
    fn first_plan<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        seeds: &[Node],
    ) -> Result<(), End> {
        let mut wait_s = 0.0;
        loop {
            let arrived = seeds.last().filter(|last| is_in_goal(search, last)).copied();
            let goal = arrived.map_or_else(|| Self::goal(search), Ok)?;
            if self.connect.find(search, goal, seeds, wait_s, TREE_UNITS, &mut self.flight)? {
                return Ok(());
            }
            wait_s = search.draw_wait_s()?;
            search.refine_bound(1.0)?;
            if !search.free_route().is_empty() && self.follow_route(search)? {
                return Ok(());
            }
        }
    }

    /// Flies straight from corner to corner of the free route; false where that is not free at its times.
    fn follow_route<W: CollisionWorld + ?Sized>(&mut self, search: &mut Search<'_, '_, W>) -> Result<bool, End> {
        let flight = &mut self.flight;
        flight.arcs.clear();
        let (mut since, mut since_s) = (0, 0.0);
        let route = search.free_route().to_vec();
        let mut here = search.start();
        for corner in route.iter().skip(1) {
            let next = Node { translation: TranslationState::at_rest(*corner), attitude: here.attitude };
            if !search.append_straight(&here, &next, &mut flight.arcs)? {
                return Ok(false);
            }
            here = next;
            let arcs = flight.arcs.get(since..).unwrap_or_default();
            if !search.is_free(arcs, since_s)? {
                return Ok(false);
            }
            since_s += arcs.iter().map(|arc| arc.duration_s).sum::<f64>();
            since = flight.arcs.len();
        }
        let arrival = Node { attitude: search.request.goal.attitude.unwrap_or(here.attitude), ..here };
        if !search.append_edge(&here, &arrival, &mut flight.arcs)? {
            return Ok(false);
        }
        search.rate(flight);
        Ok(true)
    }

    /// A state at rest in the goal region, its centre where that is free.
    fn goal<W: CollisionWorld + ?Sized>(search: &mut Search<'_, '_, W>) -> Result<Node, End> {
        let request = search.request;
        let mut attitude = request.goal.attitude.unwrap_or(request.attitude);
        let bounds = search.limits.position;
        let mut position = request.goal.position;
        for _ in 0..GOAL_TRIALS {
            let within = position.sup(&bounds.lower_world).inf(&bounds.upper_world);
            let pose = Pose::from_parts(within.into(), attitude);
            let clearance = request.world.clearance(request.body, &pose, request.start_s)?;
            let is_inside = (within - request.goal.position).norm_squared() <= request.goal.radius_m.powi(2);
            if is_inside && clearance.distance_m >= request.margin_m {
                return Ok(Node { translation: TranslationState::at_rest(within), attitude });
            }
            position = request.goal.position + search.chance.in_ball() * request.goal.radius_m;
            attitude = request.goal.attitude.unwrap_or_else(|| search.attitude());
        }
        search.spend(GOAL_TRIALS / 8)?;
        Ok(Node { translation: TranslationState::at_rest(request.goal.position), attitude })
    }
}

/// True for a state that lies in the goal region.
fn is_in_goal<W: CollisionWorld + ?Sized>(search: &Search<'_, '_, W>, node: &Node) -> bool {
    let goal = &search.request.goal;
    let Node { translation: TranslationState { position, velocity }, attitude } = node;
    f64::sqrt((position - goal.position).norm_squared()) <= goal.radius_m
        && f64::sqrt(velocity.norm_squared()) <= goal.speed_m_s
        && goal.attitude.is_none_or(|wanted| wanted == *attitude)
}

impl<W: CollisionWorld + ?Sized> GlobalPlanner<W> for FlightPlanner {
    fn plan(&mut self, request: &GlobalRequest<'_, W>, budget: &mut dyn Budget) -> Result<GlobalAnswer, PlanningError> {
        self.plan_from_seeds(request, &[], budget)
    }

    /// States of the known plan, from the nearest to the start on, are tried first.
    fn plan_anew(
        &mut self,
        request: &GlobalRequest<'_, W>,
        known: &ArcPath,
        budget: &mut dyn Budget,
    ) -> Result<GlobalAnswer, PlanningError> {
        let flight = Flight { arcs: known.arcs().to_vec(), duration_s: known.duration_s(), cost: 0.0 };
        let seeds = flight::states_ahead(&flight, &request.start.position);
        self.plan_from_seeds(request, &seeds, budget)
    }
}

impl FlightPlanner {
    /// Plans with states that a way may lead through.
    fn plan_from_seeds<W: CollisionWorld + ?Sized>(
        &mut self,
        request: &GlobalRequest<'_, W>,
        seeds: &[Node],
        budget: &mut dyn Budget,
    ) -> Result<GlobalAnswer, PlanningError> {
        let mut search = Search::new(request, &self.settings, budget)?;
        self.explore.clear();
        let found = match diagnose(request)? {
            Some(obstruction) => Err(End::Infeasible(obstruction)),
            None => self.search(&mut search, seeds),
        };
        let status = match found {
            Err(End::Error(error)) => return Err(error),
            Err(End::Infeasible(obstruction)) => Status::Infeasible(obstruction),
            Err(End::Optimal) => Status::Optimal,
            Ok(()) | Err(End::Stopped) if search.best.is_some() => Status::Feasible,
            Ok(()) | Err(End::Stopped) => Status::BudgetSpent(search.blockers()),
        };
        let lower_bound = if matches!(status, Status::Infeasible(_)) { f64::INFINITY } else { search.lower_bound() };
        let best = search.best.take();
        Ok(GlobalAnswer {
            status,
            cost: best.as_ref().map_or(f64::INFINITY, |best| best.cost),
            plan: best
                .map(|best| Plan { trajectory: ArcPath::new(best.arcs), model_revision: request.belief.revision }),
            lower_bound,
            units: search.units,
            history: search.history,
            tree: self.connect.edges().chain(self.explore.edges()).collect(),
        })
    }
}
