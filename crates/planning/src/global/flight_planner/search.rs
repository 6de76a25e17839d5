//! One search: the request, what it has spent, what stood in its way, and the best plan so far.

use super::chance::Chance;
use super::flight::{Flight, Node};
use super::settings::FlightPlannerSettings;
use crate::budget::Budget;
use crate::collision::{Blocker, CollisionWorld};
use crate::error::PlanningError;
use crate::global::{
    GlobalRequest, Improvement, MotionLimits, Objective, Obstruction, Reachability, RouteBound, Until,
};
use crate::motion::BodyArc;
use crate::steering::{Slew, Steering, TranslationLimits, least_time_s, least_time_to_goal_s, slew, steer, steer_in};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_dynamics::AlignedBox;

/// Waits are as short as the longest halved so often.
const WAIT_OCTAVES: f64 = 6.0;

/// Why a search stops.
pub(super) enum End {
    /// No budget left, or the first plan was all that was asked for.
    Stopped,
    /// The best plan costs no more than the lower bound, to the tolerance.
    Optimal,
    /// There certainly is no plan.
    Infeasible(Obstruction),
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
    /// True where the body may turn on its way, and where that can make a difference.
    pub may_turn: bool,
    /// Share of the lower bound by which an optimal plan may exceed it.
    tolerance: f64,
    /// Longest duration of a plan of least impulse, s.
    pub longest_s: f64,
    bound: RouteBound<'a, W>,
    /// Units that the next refinement of the bound may take.
    refinement_units: u64,
    pub best: Option<Flight>,
    pub history: Vec<Improvement>,
    blocked: Vec<(Blocker, u64)>,
    pub units: u64,
    /// Where states are drawn from.
    room: AlignedBox,
    inertia_about_com_kg_m2: Matrix3<f64>,
    /// Distance of the centre of mass from the body origin, m.
    offset_m: f64,
    budget: &'a mut dyn Budget,
}

/// A part of a budget, counted.
struct Allowance<'b> {
    budget: &'b mut dyn Budget,
    left: u64,
    spent: u64,
    is_denied: bool,
}

impl Budget for Allowance<'_> {
    fn spend(&mut self, units: u64) -> bool {
        let is_granted = units <= self.left && self.budget.spend(units);
        if is_granted {
            self.left -= units;
            self.spent += units;
        } else {
            self.is_denied = true;
        }
        is_granted
    }
}

/// Share of the acceleration that a turn may take for the centre of mass that goes round the origin; it is slowed to that.
const TURN_SHARE: f64 = 0.8;
/// Turns that are tried for an edge, each with half of the torque of the one before.
const TURN_TRIALS: u32 = 4;
/// Units that the first refinement of the bound may take.
const FIRST_REFINEMENT_UNITS: u64 = 500;
/// Each refinement looks at cells of half the edge.
const REFINEMENT_GROWTH: u64 = 8;

impl<'a, 'r, W: CollisionWorld + ?Sized> Search<'a, 'r, W> {
    /// # Errors
    /// Numbers that are no limits, or not finite.
    pub fn new(
        request: &'a GlobalRequest<'r, W>,
        settings: &FlightPlannerSettings,
        budget: &'a mut dyn Budget,
    ) -> Result<Self, PlanningError> {
        let parameters = request.belief.parameters();
        let mut limits = request.limits.translation(parameters.mass)?;
        // Nothing is drawn where no motion leads.
        for axis in 0..3 {
            let is_resting = limits.acceleration_m_s2[axis] == 0.0 && request.start.velocity[axis] == 0.0;
            if is_resting || limits.speed_m_s[axis] == 0.0 {
                limits.position.lower_world[axis] = request.start.position[axis];
                limits.position.upper_world[axis] = request.start.position[axis];
            }
        }
        let can_turn = request.limits.rate_rad_s > 0.0 && request.limits.torque_n_m.max() > 0.0;
        Ok(Self {
            request,
            limits,
            chance: Chance::new(request.seed),
            is_still: request.world.is_still_from(request.start_s),
            may_turn: can_turn && !request.world.is_round(request.body),
            tolerance: settings.tolerance,
            longest_s: settings.longest_s,
            bound: RouteBound::new(request)?,
            refinement_units: FIRST_REFINEMENT_UNITS,
            best: None,
            history: Vec::new(),
            blocked: Vec::new(),
            units: 0,
            room: room(request, &limits),
            inertia_about_com_kg_m2: parameters.inertia_about_com(),
            offset_m: f64::sqrt(parameters.center_of_mass().norm_squared()),
            budget,
        })
    }

    /// No plan costs less.
    pub fn lower_bound(&self) -> f64 {
        self.bound.lower_bound()
    }

    /// A way along which straight moves from rest to rest are free of what lasts, where one is known.
    pub fn free_route(&self) -> &[Vector3<f64>] {
        self.bound.free_route()
    }

    /// Looks at the walls with finer cells for the lower bound, a proof that there is no way, or a way; only where that takes
    /// no more than `share` of the units spent so far. What a body that turns could pass is no wall.
    pub fn refine_bound(&mut self, share: f64) -> Result<(), End> {
        let wanted = self.refinement_units;
        if self.may_turn || wanted as f64 > share * self.units as f64 {
            return Ok(());
        }
        let mut allowance = Allowance { budget: self.budget, left: wanted, spent: 0, is_denied: false };
        let is_more = self.bound.refine(&mut allowance)?;
        self.units += allowance.spent;
        self.refinement_units = match (allowance.is_denied, is_more) {
            (true, _) => wanted.saturating_mul(2),
            (false, true) => allowance.spent.saturating_mul(REFINEMENT_GROWTH).max(FIRST_REFINEMENT_UNITS),
            (false, false) => u64::MAX,
        };
        if let Reachability::Blocked(obstruction) = self.bound.reachability() {
            return Err(End::Infeasible(obstruction.clone()));
        }
        if self.is_optimal(self.best_cost()) { Err(End::Optimal) } else { Ok(()) }
    }

    /// True for a cost that is as low as the lower bound, to the tolerance.
    pub fn is_optimal(&self, cost: f64) -> bool {
        cost <= self.lower_bound() * (1.0 + self.tolerance)
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
            // an empty sum is minus zero
            Objective::Duration => arcs.iter().map(|arc| arc.duration_s).sum::<f64>() + 0.0,
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

    /// Appends the edge of least duration between two nodes to `arcs`; false where there is none.
    pub fn append_edge(&self, from: &Node, to: &Node, arcs: &mut Vec<BodyArc>) -> Result<bool, End> {
        if from.attitude == to.attitude {
            let Some(steering) = steer(&from.translation, &to.translation, &self.limits) else { return Ok(false) };
            arcs.extend(steering.arcs(from.attitude));
            return Ok(true);
        }
        let Some(turn) = self.slowed_turn(from, to, 1.0)? else { return Ok(false) };
        // What a turn takes of the acceleration is perpendicular to its axis: one about the vertical takes none along it, so that
        // a table has room for it.
        let axis_world = from.attitude * turn.axis_body().into_inner();
        let across_m_s2 = axis_world.iter().zip(&self.limits.acceleration_m_s2);
        let room_m_s2 = across_m_s2
            .filter(|(along, _)| across(**along) > 0.0)
            .map(|(along, limit)| limit / across(*along))
            .fold(f64::INFINITY, f64::min);
        // A fast turn leaves little for the translation, a slow one lasts: the fastest edge is somewhere between.
        let reserve_m_s2 = self.reserve_m_s2(&turn);
        let mut share = f64::min(1.0, TURN_SHARE * room_m_s2 / reserve_m_s2);
        let trials = if reserve_m_s2 > 0.0 { TURN_TRIALS } else { 1 };
        let mut fastest: Option<(Slew, Steering)> = None;
        for _ in 0..trials {
            let turn = if share < 1.0 { self.slowed_turn(from, to, share)? } else { Some(turn) };
            let leg = turn.and_then(|turn| self.turning(from, to, turn, &axis_world));
            match (leg, &fastest) {
                (Some(leg), Some(fastest)) if leg.1.duration_s() >= fastest.1.duration_s() => break,
                (Some(leg), _) => fastest = Some(leg),
                (None, _) => {}
            }
            share *= 0.5;
        }
        let pieces = fastest.as_ref().and_then(|(turn, steering)| turn.along(steering));
        let Some(pieces) = pieces else { return Ok(false) };
        arcs.extend(pieces);
        Ok(true)
    }

    /// The turn between two nodes with a share of the torque; `None` where the body cannot turn so.
    fn slowed_turn(&self, from: &Node, to: &Node, share: f64) -> Result<Option<Slew>, End> {
        let MotionLimits { torque_n_m, rate_rad_s, .. } = self.request.limits;
        let limits = MotionLimits {
            torque_n_m: torque_n_m * share,
            rate_rad_s: rate_rad_s * f64::sqrt(share),
            ..self.request.limits
        };
        Ok(slew(&from.attitude, &to.attitude, &self.inertia_about_com_kg_m2, &limits)?)
    }

    /// The centre of mass goes round the origin; what acceleration that takes at most is not there for the translation.
    fn reserve_m_s2(&self, turn: &Slew) -> f64 {
        self.offset_m * (turn.acceleration_rad_s2() + turn.rate_rad_s() * turn.rate_rad_s())
    }

    /// The fastest edge with this turn, or with one that is slower.
    fn turning(&self, from: &Node, to: &Node, turn: Slew, axis_world: &Vector3<f64>) -> Option<(Slew, Steering)> {
        let reserve_m_s2 = self.reserve_m_s2(&turn);
        let mut limits = self.limits;
        limits.acceleration_m_s2.zip_apply(axis_world, |limit, along| *limit -= reserve_m_s2 * across(along));
        if limits.acceleration_m_s2.min() < 0.0 {
            return None;
        }
        let steering = steer(&from.translation, &to.translation, &limits)?;
        if let Some(turn) = turn.stretched(steering.duration_s()) {
            return Some((turn, steering));
        }
        Some((turn, steer_in(&from.translation, &to.translation, &limits, turn.duration_s())?))
    }

    /// The same stretched in time, at a constant attitude; false also where there is no motion of that duration.
    pub fn append_slowly(&self, from: &Node, to: &Node, stretch: f64, arcs: &mut Vec<BodyArc>) -> Result<bool, End> {
        if stretch <= 1.0 || from.attitude != to.attitude {
            return self.append_edge(from, to, arcs);
        }
        let (from_state, to_state) = (&from.translation, &to.translation);
        let duration_s = stretch * least_time_s(from_state, to_state, &self.limits);
        let Some(steering) = steer_in(from_state, to_state, &self.limits, duration_s) else { return Ok(false) };
        arcs.extend(steering.arcs(from.attitude));
        Ok(true)
    }

    /// Appends a straight move between two nodes at rest of one attitude, or the edge of least duration from one in motion.
    pub fn append_straight(&self, from: &Node, to: &Node, arcs: &mut Vec<BodyArc>) -> Result<bool, End> {
        let way = to.translation.position - from.translation.position;
        let length_m = f64::sqrt(way.norm_squared());
        if from.translation.velocity != Vector3::zeros() || length_m == 0.0 {
            return self.append_edge(from, to, arcs);
        }
        // The axes follow one profile where their limits are as their ways are.
        let direction = way.map(|component| component.abs() / length_m);
        let shared = |limits: &Vector3<f64>| {
            let along = |(limit, part): (&f64, &f64)| if *part > 0.0 { limit / part } else { f64::INFINITY };
            direction * limits.iter().zip(&direction).map(along).fold(f64::INFINITY, f64::min)
        };
        let limits = TranslationLimits {
            position: self.limits.position,
            speed_m_s: shared(&self.limits.speed_m_s),
            acceleration_m_s2: shared(&self.limits.acceleration_m_s2),
        };
        let Some(steering) = steer(&from.translation, &to.translation, &limits) else { return Ok(false) };
        arcs.extend(steering.arcs(from.attitude));
        Ok(true)
    }

    /// Makes a flight of a chain of nodes that runs from its end to its start; false where an edge is missing.
    pub fn assemble(&self, backwards: &[Node], flight: &mut Flight) -> Result<bool, End> {
        flight.arcs.clear();
        for pair in backwards.windows(2).rev() {
            if let [to, from] = pair
                && !self.append_edge(from, to, &mut flight.arcs)?
            {
                return Ok(false);
            }
        }
        self.rate(flight);
        Ok(true)
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

    /// The attitude of a sample: that of the start, or any that the body may turn to; where a body axis has no torque, one
    /// turn away about the others.
    pub fn attitude(&mut self) -> UnitQuaternion<f64> {
        if !(self.may_turn && self.chance.happens(0.5)) {
            return self.request.attitude;
        }
        if self.request.limits.torque_n_m.min() > 0.0 {
            return self.chance.attitude();
        }
        let half_turns = self.chance.in_cube();
        self.request.attitude * UnitQuaternion::from_scaled_axis(self.driven(half_turns) * std::f64::consts::PI)
    }

    /// What of a rotation vector, body axes, lies along axes with torque.
    pub fn driven(&self, rotation: Vector3<f64>) -> Vector3<f64> {
        rotation.zip_map(&self.request.limits.torque_n_m, |part, most| if most > 0.0 { part } else { 0.0 })
    }

    /// A distance between nodes, squared: times at full speed, s^2.
    pub fn squared_distance(&self, from: &Node, to: &Node) -> f64 {
        let way = to.translation.position - from.translation.position;
        let seconds = |way: f64, speed: f64| if speed > 0.0 { way / speed } else { 0.0 };
        let translation = way.zip_map(&self.limits.speed_m_s, seconds).norm_squared();
        if from.attitude == to.attitude {
            return translation;
        }
        // The chord between two quaternions is half the angle, nearly.
        let aligned = from.attitude.coords.dot(&to.attitude.coords).abs();
        translation + 8.0 * (1.0 - aligned) / (self.request.limits.rate_rad_s * self.request.limits.rate_rad_s)
    }

    /// Rest at the start.
    pub fn wait(&self, wait_s: f64) -> BodyArc {
        BodyArc::accelerated(wait_s, &self.request.start, Vector3::zeros(), self.request.attitude)
    }

    /// How long to wait at the start, for what moves or vanishes to make way; zero where that helps nothing or is not free.
    pub fn draw_wait_s(&mut self) -> Result<f64, End> {
        if self.is_still || self.request.start.velocity != Vector3::zeros() || self.chance.happens(0.5) {
            return Ok(0.0);
        }
        let latest_s = self.best.as_ref().map_or(self.longest_s, |best| best.duration_s.min(self.longest_s));
        let wait_s = latest_s * self.chance.scale(WAIT_OCTAVES);
        Ok(if self.is_free(&[self.wait(wait_s)], 0.0)? { wait_s } else { 0.0 })
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
        if self.is_optimal(flight.cost) {
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

/// Sine of the angle between an axis and a unit vector of which `along` is the component on it; nothing where that is rounding.
fn across(along: f64) -> f64 {
    let square = 1.0 - along * along;
    if square > 1e-12 { f64::sqrt(square) } else { 0.0 }
}
