//! One search: the request, what it has spent, what stood in its way, and the best plan so far.

use super::chance::Chance;
use super::flight::{Flight, Node};
use crate::budget::Budget;
use crate::collision::{Blocker, CollisionWorld};
use crate::error::PlanningError;
use crate::global::{GlobalRequest, Improvement, Objective, Until};
use crate::motion::BodyArc;
use crate::steering::{TranslationLimits, steer};
use nalgebra::Vector3;
use tumble_dynamics::AlignedBox;

/// Why a search stops.
pub(super) enum End {
    /// No budget left, or the first plan was all that was asked for.
    Stopped,
    /// The best plan costs no more than the lower bound, to the tolerance.
    Optimal,
    /// The world could not answer.
    Error(PlanningError),
}

impl From<PlanningError> for End {
    fn from(error: PlanningError) -> Self {
        Self::Error(error)
    }
}

pub(super) struct Search<'a, 'r, W: CollisionWorld + ?Sized> {
    pub request: &'a GlobalRequest<'r, W>,
    pub limits: TranslationLimits,
    pub chance: Chance,
    /// True where no time matters to the world.
    pub is_still: bool,
    pub lower_bound: f64,
    /// Share of the lower bound by which an optimal plan may exceed it.
    pub tolerance: f64,
    pub best: Option<Flight>,
    pub history: Vec<Improvement>,
    pub blocked: Vec<(Blocker, u64)>,
    pub units: u64,
    /// Where states are drawn from.
    room: AlignedBox,
    budget: &'a mut dyn Budget,
}

impl<'a, 'r, W: CollisionWorld + ?Sized> Search<'a, 'r, W> {
    pub fn new(
        request: &'a GlobalRequest<'r, W>,
        limits: TranslationLimits,
        lower_bound: f64,
        tolerance: f64,
        budget: &'a mut dyn Budget,
    ) -> Self {
        Self {
            request,
            limits,
            chance: Chance::new(request.seed),
            is_still: request.world.is_still_from(request.start_s),
            lower_bound,
            tolerance,
            best: None,
            history: Vec::new(),
            blocked: Vec::new(),
            units: 0,
            room: room(request, &limits),
            budget,
        }
    }

    /// Takes units from the budget.
    pub fn spend(&mut self, units: u64) -> Result<(), End> {
        if !self.budget.spend(units) {
            return Err(End::Stopped);
        }
        self.units += units;
        Ok(())
    }

    pub fn start(&self) -> Node {
        Node { translation: self.request.start, attitude: self.request.attitude }
    }

    /// Cost of the best plan; infinite while there is none.
    pub fn best_cost(&self) -> f64 {
        self.best.as_ref().map_or(f64::INFINITY, |best| best.cost)
    }

    /// What an arc adds to the cost.
    pub fn cost(&self, arcs: &[BodyArc]) -> f64 {
        match self.request.objective {
            Objective::Duration => arcs.iter().map(|arc| arc.duration_s).sum(),
            Objective::Impulse => {
                let mass_kg = self.request.belief.parameters().mass;
                mass_kg * arcs.iter().map(|arc| 2.0 * arc.position[2].abs().sum() * arc.duration_s).sum::<f64>()
            }
        }
    }

    /// Least time from a node to the goal, whatever stands between.
    pub fn least_time_to_goal_s(&self, from: &Node) -> f64 {
        let goal = &self.request.goal;
        let way = (goal.position - from.translation.position).abs().add_scalar(-goal.radius_m);
        way.component_div(&self.limits.speed_m_s).max().max(0.0)
    }

    /// Appends the edge between two nodes to `arcs`; false where there is none.
    pub fn append_edge(&self, from: &Node, to: &Node, arcs: &mut Vec<BodyArc>) -> bool {
        if from.attitude != to.attitude {
            return false;
        }
        let Some(steering) = steer(&from.translation, &to.translation, &self.limits) else { return false };
        arcs.extend(steering.arcs(from.attitude));
        true
    }

    /// Makes a flight of a chain of nodes that runs from its end to its start; false where an edge is missing.
    pub fn assemble(&self, backwards: &[Node], flight: &mut Flight) -> bool {
        flight.arcs.clear();
        for pair in backwards.windows(2).rev() {
            if let [to, from] = pair
                && !self.append_edge(from, to, &mut flight.arcs)
            {
                return false;
            }
        }
        self.rate(flight);
        true
    }

    /// Sets a flight's duration and cost by its arcs.
    pub fn rate(&self, flight: &mut Flight) {
        flight.duration_s = flight.arcs.iter().map(|arc| arc.duration_s).sum();
        flight.cost = self.cost(&flight.arcs);
    }

    /// A position within the limits, uniform; where they are infinite, about start and goal.
    pub fn position(&mut self) -> Vector3<f64> {
        let room = self.room;
        let chance = &mut self.chance;
        room.lower_world.zip_map(&room.upper_world, |lower, upper| lower + (upper - lower) * chance.uniform())
    }

    /// First time since their start at which the arcs, flown from `start_s` after the start of the plan, hit anything.
    pub fn first_contact_s(&mut self, arcs: &[BodyArc], start_s: f64) -> Result<Option<f64>, End> {
        self.spend(1)?;
        let mut since_s = 0.0;
        for arc in arcs {
            let mission_s = self.request.start_s + start_s + since_s;
            let contact = self.request.world.first_contact(self.request.body, arc, mission_s, self.request.margin_m)?;
            if let Some(contact) = contact {
                self.count(contact.blocker);
                return Ok(Some(since_s + contact.time_s));
            }
            since_s += arc.duration_s;
        }
        Ok(None)
    }

    pub fn is_free(&mut self, arcs: &[BodyArc], start_s: f64) -> Result<bool, End> {
        Ok(self.first_contact_s(arcs, start_s)?.is_none())
    }

    fn count(&mut self, blocker: Blocker) {
        match self.blocked.iter_mut().find(|(known, _)| *known == blocker) {
            Some((_, times)) => *times += 1,
            None => self.blocked.push((blocker, 1)),
        }
    }

    /// What was hit, most often first.
    pub fn blockers(&self) -> Vec<Blocker> {
        let mut blocked = self.blocked.clone();
        blocked.sort_by_key(|(blocker, times)| (u64::MAX - times, *blocker));
        blocked.into_iter().map(|(blocker, _)| blocker).collect()
    }

    /// Takes a plan that was checked, where it is better than the best.
    pub fn offer(&mut self, flight: &Flight) -> Result<(), End> {
        if flight.cost >= self.best_cost() {
            return Ok(());
        }
        match &mut self.best {
            Some(best) => best.clone_from(flight),
            None => self.best = Some(flight.clone()),
        }
        self.history.push(Improvement { units: self.units, cost: flight.cost });
        if flight.cost <= self.lower_bound * (1.0 + self.tolerance) {
            return Err(End::Optimal);
        }
        if self.request.until == Until::FirstPlan { Err(End::Stopped) } else { Ok(()) }
    }
}

/// The box of the limits; sides that are infinite lie as far beyond start and goal as these are apart.
fn room<W: CollisionWorld + ?Sized>(request: &GlobalRequest<'_, W>, limits: &TranslationLimits) -> AlignedBox {
    let (start, goal) = (request.start.position, request.goal.position);
    let beyond = f64::sqrt((goal - start).norm_squared()) + 2.0 * request.world.reach_m(request.body);
    let (lower, upper) = (limits.position.lower_world, limits.position.upper_world);
    let near = |side: f64, near: f64| if side.is_finite() { side } else { near };
    AlignedBox {
        lower_world: lower.zip_map(&start.inf(&goal), |side, least| near(side, least - beyond)),
        upper_world: upper.zip_map(&start.sup(&goal), |side, largest| near(side, largest + beyond)),
    }
}
