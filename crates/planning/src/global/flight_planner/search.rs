//! One search: the request, what it has spent, what stood in its way, and the best plan so far.

use super::chance::Chance;
use super::flight::{Flight, Node};
use crate::budget::Budget;
use crate::collision::{Blocker, CollisionWorld};
use crate::error::PlanningError;
use crate::global::{GlobalRequest, Improvement, Objective, Until};
use crate::motion::BodyArc;
use crate::steering::{TranslationLimits, least_time_to_goal_s, steer};

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
        least_time_to_goal_s(&from.translation, &self.request.goal, &self.limits)
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
