//! The kinodynamic RRT of the thesis: a tree of motion primitives.

use super::{GlobalAnswer, GlobalPlanner, GlobalRequest, Improvement, Objective, RouteBound, Status, diagnose};
use crate::belief::Plan;
use crate::budget::Budget;
use crate::collision::{Blocker, CollisionWorld};
use crate::error::{PlanningError, finite, positive};
use crate::kinodynamic::BodyMotion;
use crate::motion::{ArcPath, BodyArc, TranslationState};
use crate::unit_interval;
use nalgebra::{UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::collections::BTreeMap;
use tumble_dynamics::InertialParameters;

/// What is checked of an edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum EdgeCheck {
    /// The whole motion, continuously.
    #[default]
    Continuous,
    /// Its end state only, as the original does. **Unsafe**: an edge may pass through obstacles and limits; for comparison.
    EndState,
}

/// How the tree grows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveRrtSettings {
    /// Share of samples that are the goal's centre, at rest.
    pub goal_bias: f64,
    /// Most samples drawn.
    pub iterations: u64,
    /// Weight of the distance of positions, per m, in the metric that chooses a primitive and tests for the goal.
    pub position_weight: f64,
    /// Weight of the difference of velocities, per m/s, in the same metric.
    pub velocity_weight: f64,
    /// Largest such distance from the goal's centre at rest, on top of the goal region's own limits; may be infinite.
    pub goal_tolerance: f64,
    /// What is checked of an edge.
    pub edge_check: EdgeCheck,
}

/// The thesis's planner: draw a state, take the node nearest to it (unweighted), try every primitive from there, keep the
/// edge that ends nearest to the draw (weighted). The first node in the goal region ends the search; a node from which no
/// primitive is possible is not tried again.
///
/// It turns nothing into better plans: `Until::BudgetSpent` ends at the first plan as well.
///
/// # Source
/// Thesis 6.2.1; numbers and rules of its code are a preset elsewhere.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimitiveRrt<M> {
    model: M,
    settings: PrimitiveRrtSettings,
}

struct Node<S> {
    state: S,
    parent: usize,
    primitive: usize,
    time_s: f64,
}

/// What one search is about, and what it has counted so far.
struct Search<'a, 'w, W: CollisionWorld + ?Sized, M> {
    request: &'a GlobalRequest<'w, W>,
    model: M,
    settings: PrimitiveRrtSettings,
    parameters: &'a InertialParameters<f64>,
    /// Of the free space.
    lower_bound: f64,
    blocked: BTreeMap<Blocker, u64>,
    units: u64,
}

impl<M> PrimitiveRrt<M> {
    /// A planner for this model.
    ///
    /// # Errors
    /// Weights and tolerances that are not positive, a bias outside [0, 1].
    pub fn try_new(model: M, settings: PrimitiveRrtSettings) -> Result<Self, PlanningError> {
        if !(0.0..=1.0).contains(&settings.goal_bias) {
            return Err(PlanningError::OutOfRange {
                what: "the goal bias",
                value: settings.goal_bias,
                lower: 0.0,
                upper: 1.0,
            });
        }
        positive("the weight of positions", settings.position_weight)?;
        if settings.velocity_weight != 0.0 {
            positive("the weight of velocities", settings.velocity_weight)?;
        }
        if settings.goal_tolerance != f64::INFINITY {
            positive("the goal tolerance", settings.goal_tolerance)?;
        }
        Ok(Self { model, settings })
    }

    /// The rules it goes by.
    pub fn settings(&self) -> &PrimitiveRrtSettings {
        &self.settings
    }
}

impl<M, W> GlobalPlanner<W> for PrimitiveRrt<M>
where
    M: BodyMotion<Parameters = InertialParameters<f64>>,
    W: CollisionWorld + ?Sized,
{
    fn plan(&mut self, request: &GlobalRequest<'_, W>, budget: &mut dyn Budget) -> Result<GlobalAnswer, PlanningError> {
        let parameters = request.belief.parameters();
        finite("the start time", request.start_s)?;
        if let Some(obstruction) = diagnose(request)? {
            return Ok(GlobalAnswer {
                status: Status::Infeasible(obstruction),
                plan: None,
                cost: f64::INFINITY,
                lower_bound: f64::INFINITY,
                units: 0,
                history: Vec::new(),
                tree: Vec::new(),
            });
        }
        let mut search = Search {
            request,
            model: self.model.within(&request.limits, &request.attitude)?,
            settings: self.settings,
            parameters,
            lower_bound: RouteBound::new(request)?.lower_bound(),
            blocked: BTreeMap::new(),
            units: 0,
        };
        let mut nodes =
            vec![Node { state: search.model.state_at(&request.start), parent: 0, primitive: 0, time_s: 0.0 }];
        let is_there = search.is_goal(&request.start) && search.is_goal_attitude(&request.attitude);
        let found = if is_there { Some(0) } else { search.grow(&mut nodes, budget)? };
        Ok(search.answer(&nodes, found))
    }
}

impl<W: CollisionWorld + ?Sized, M: BodyMotion<Parameters = InertialParameters<f64>>> Search<'_, '_, W, M> {
    /// The weighted metric.
    fn weighted(&self, from: &TranslationState, to: &TranslationState) -> f64 {
        let away = f64::sqrt((to.position - from.position).norm_squared());
        let faster = f64::sqrt((to.velocity - from.velocity).norm_squared());
        self.settings.position_weight * away + self.settings.velocity_weight * faster
    }

    fn is_goal(&self, state: &TranslationState) -> bool {
        let goal = &self.request.goal;
        (state.position - goal.position).norm_squared() <= goal.radius_m * goal.radius_m
            && state.velocity.norm_squared() <= goal.speed_m_s * goal.speed_m_s
            && self.weighted(state, &TranslationState::at_rest(goal.position)) <= self.settings.goal_tolerance
    }

    /// Grows the tree; the index of the node in the goal region, `None` where iterations or budget ended first.
    fn grow(
        &mut self,
        nodes: &mut Vec<Node<M::State>>,
        budget: &mut dyn Budget,
    ) -> Result<Option<usize>, PlanningError> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.request.seed);
        let mut open = vec![0];
        let goal = self.model.state_at(&TranslationState::at_rest(self.request.goal.position));
        for _ in 0..self.settings.iterations {
            let is_biased = unit_interval(&mut rng) < self.settings.goal_bias;
            let drawn = if is_biased { goal.clone() } else { self.model.sample(&mut rng) };
            let Some(place) = self.nearest(nodes, &open, &drawn) else { return Ok(None) };
            let parent = open[place];
            let drawn = self.model.translation(&drawn);
            let mut best: Option<(f64, Node<M::State>)> = None;
            for primitive in 0..self.model.primitives().len() {
                if !budget.spend(1) {
                    return Ok(None);
                }
                self.units += 1;
                if let Some(child) = self.child(nodes, parent, primitive)? {
                    let distance = self.weighted(&self.model.translation(&child.state), &drawn);
                    if best.as_ref().is_none_or(|(least, _)| distance < *least) {
                        best = Some((distance, child));
                    }
                }
            }
            let Some((_, child)) = best else {
                open.swap_remove(place);
                continue;
            };
            let index = nodes.len();
            let is_goal = self.is_goal(&self.model.translation(&child.state));
            open.push(index);
            nodes.push(child);
            let arc = self.arc_to(nodes, index);
            if is_goal && self.is_goal_attitude(&arc.attitude_at(arc.duration_s)) {
                return Ok(Some(index));
            }
        }
        Ok(None)
    }

    /// Where in `open` the node nearest to a state stands.
    fn nearest(&self, nodes: &[Node<M::State>], open: &[usize], drawn: &M::State) -> Option<usize> {
        let mut best = None;
        let mut least = f64::INFINITY;
        for (place, index) in open.iter().enumerate() {
            let distance = self.model.distance(&nodes[*index].state, drawn);
            if distance < least {
                (best, least) = (Some(place), distance);
            }
        }
        best
    }

    /// The end of a primitive from a node, where the edge is possible.
    fn child(
        &mut self,
        nodes: &[Node<M::State>],
        parent: usize,
        primitive: usize,
    ) -> Result<Option<Node<M::State>>, PlanningError> {
        let from = &nodes[parent];
        let edge = &self.model.primitives()[primitive];
        let state = self.model.propagate(&from.state, &edge.input, self.parameters, edge.duration_s);
        let arc = self.model.arc(&from.state, &edge.input, self.parameters, edge.duration_s);
        if !self.model.contains(&state) {
            return Ok(None);
        }
        let start_s = self.request.start_s + from.time_s;
        let time_s = from.time_s + edge.duration_s;
        let GlobalRequest { world, body, margin_m, .. } = self.request;
        let blocker = match self.settings.edge_check {
            EdgeCheck::Continuous => {
                if !self.model.contains_arc(&arc) {
                    return Ok(None);
                }
                world.first_contact(body, &arc, start_s, *margin_m)?.map(|contact| contact.blocker)
            }
            EdgeCheck::EndState => {
                let end = arc.pose(arc.duration_s);
                let clearance = world.clearance(body, &end, self.request.start_s + time_s)?;
                clearance.nearest.filter(|_| clearance.distance_m < *margin_m)
            }
        };
        if let Some(blocker) = blocker {
            *self.blocked.entry(blocker).or_default() += 1;
            return Ok(None);
        }
        Ok(Some(Node { state, parent, primitive, time_s }))
    }

    fn arc_to(&self, nodes: &[Node<M::State>], index: usize) -> BodyArc {
        let node = &nodes[index];
        let edge = &self.model.primitives()[node.primitive];
        self.model.arc(&nodes[node.parent].state, &edge.input, self.parameters, edge.duration_s)
    }

    fn is_goal_attitude(&self, attitude: &UnitQuaternion<f64>) -> bool {
        const SAME_RAD: f64 = 1e-9;
        self.request.goal.attitude.is_none_or(|goal| attitude.angle_to(&goal) <= SAME_RAD)
    }

    fn answer(mut self, nodes: &[Node<M::State>], found: Option<usize>) -> GlobalAnswer {
        let tree = (1..nodes.len())
            .map(|index| {
                [nodes[nodes[index].parent].state.clone(), nodes[index].state.clone()]
                    .map(|state| self.model.translation(&state).position)
            })
            .collect();
        let Some(mut index) = found else {
            let mut blockers: Vec<(Blocker, u64)> = core::mem::take(&mut self.blocked).into_iter().collect();
            blockers.sort_by_key(|(_, count)| core::cmp::Reverse(*count));
            return GlobalAnswer {
                status: Status::BudgetSpent(blockers.into_iter().map(|(blocker, _)| blocker).collect()),
                plan: None,
                cost: f64::INFINITY,
                lower_bound: self.lower_bound,
                units: self.units,
                history: Vec::new(),
                tree,
            };
        };
        let mut arcs = Vec::new();
        while index != 0 {
            arcs.push(self.arc_to(nodes, index));
            index = nodes[index].parent;
        }
        arcs.reverse();
        let path = ArcPath::new(arcs);
        let cost = match self.request.objective {
            Objective::Duration => path.duration_s(),
            Objective::Impulse => path.arcs().iter().map(|arc| arc_impulse_n_s(arc, self.parameters.mass)).sum(),
        };
        GlobalAnswer {
            status: if self.lower_bound >= cost { Status::Optimal } else { Status::Feasible },
            plan: Some(Plan { trajectory: path, model_revision: self.request.belief.revision }),
            cost,
            lower_bound: self.lower_bound,
            units: self.units,
            history: vec![Improvement { units: self.units, cost }],
            tree,
        }
    }
}

/// `m` times the sum over the axes of how far the velocity goes up and down, N s; exact where no acceleration changes its
/// sign within one of 64 parts of the arc.
fn arc_impulse_n_s(arc: &BodyArc, mass_kg: f64) -> f64 {
    const PARTS: u32 = 64;
    let velocity = |part: u32| arc.translation(arc.duration_s * f64::from(part) / f64::from(PARTS)).0.velocity;
    let change = |part: u32| (velocity(part + 1) - velocity(part)).abs();
    (0..PARTS).map(change).sum::<Vector3<f64>>().sum() * mass_kg
}
