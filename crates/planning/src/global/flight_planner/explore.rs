//! Asymptotic optimality: one tree of states in motion, each new one behind the best parent that a free edge reaches.
//!
//! A sample takes the cheapest of all parents whose edge is free. So whatever chain of small balls follows an optimal
//! motion, a sample in the next ball costs no more than the best one in the ball before and the edge between them: as
//! samples fill the balls, the cost of the last tends to the optimum. Samples and parents that cannot lead to a better plan,
//! by the least times from the start and to the goal, are left out.

use super::flight::{Flight, Node};
use super::improve::{within_goal, within_limits};
use super::search::{End, Search};
use crate::collision::CollisionWorld;
use crate::motion::{BodyArc, TranslationState};
use crate::steering::least_time_s;
use nalgebra::Vector3;

/// Parents looked at that count as one unit.
const PARENTS_PER_UNIT: usize = 100;
/// Samples refused that count as one unit.
const REFUSED_PER_UNIT: u32 = 30;

struct Branch {
    node: Node,
    parent: Option<usize>,
    at_s: f64,
    /// Least time from here to the goal, s.
    to_goal_s: f64,
}

/// The tree; kept for its memory.
#[derive(Default)]
pub(super) struct Explore {
    branches: Vec<Branch>,
    candidates: Vec<(f64, usize)>,
    arcs: Vec<BodyArc>,
}

impl Explore {
    pub fn clear(&mut self) {
        self.branches.clear();
    }

    /// Spends `units` on growing the tree; leaves a flight better than the best in `flight`, and says whether it did.
    pub fn run<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        flight: &mut Flight,
        units: u64,
    ) -> Result<bool, End> {
        if self.branches.is_empty() {
            let node = search.start();
            self.branches.push(Branch { node, parent: None, at_s: 0.0, to_goal_s: search.least_time_to_goal_s(&node) });
        }
        let last = search.units.saturating_add(units);
        let mut refused = 0;
        while search.units < last {
            let before = search.units;
            if let Some((node, to_goal_s)) = Self::sample(search)
                && let Some(index) = self.insert(search, &node, to_goal_s)?
                && self.arrives(search, index, flight)?
            {
                return Ok(true);
            }
            if search.units == before {
                refused += 1;
                if refused % REFUSED_PER_UNIT == 0 {
                    search.spend(1)?;
                }
            }
        }
        Ok(false)
    }

    /// A state that may lie on a better plan than the best one, with its least time to the goal.
    fn sample<W: CollisionWorld + ?Sized>(search: &mut Search<'_, '_, W>) -> Option<(Node, f64)> {
        let speed = search.limits.speed_m_s;
        let velocity = search.chance.in_cube().component_mul(&speed);
        let position = search.position();
        let translation = within_limits(&TranslationState { position, velocity }, &search.limits);
        let node = Node { translation, attitude: search.attitude() };
        let to_goal_s = search.least_time_to_goal_s(&node);
        let from_start_s = least_time_s(&search.request.start, &node.translation, &search.limits);
        (from_start_s + to_goal_s < search.best_cost()).then_some((node, to_goal_s))
    }

    /// Adds a state behind its best parent, where it has one.
    fn insert<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        node: &Node,
        to_goal_s: f64,
    ) -> Result<Option<usize>, End> {
        let latest_s = search.best_cost() - to_goal_s;
        let speed = search.limits.speed_m_s;
        self.candidates.clear();
        for (index, branch) in self.branches.iter().enumerate() {
            let way = node.translation.position - branch.node.translation.position;
            if branch.at_s + way.abs().zip_map(&speed, |way, speed| if way > 0.0 { way / speed } else { 0.0 }).max()
                >= latest_s
            {
                continue;
            }
            let at_s = branch.at_s + least_time_s(&branch.node.translation, &node.translation, &search.limits);
            if at_s < latest_s {
                self.candidates.push((at_s, index));
            }
        }
        search.spend((self.branches.len() / PARENTS_PER_UNIT) as u64)?;
        self.candidates.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, parent) in &self.candidates {
            let Some(branch) = self.branches.get(*parent) else { continue };
            self.arcs.clear();
            if search.append_edge(&branch.node, node, &mut self.arcs)? && search.is_free(&self.arcs, branch.at_s)? {
                let at_s = branch.at_s + self.arcs.iter().map(|arc| arc.duration_s).sum::<f64>();
                self.branches.push(Branch { node: *node, parent: Some(*parent), at_s, to_goal_s });
                return Ok(Some(self.branches.len() - 1));
            }
        }
        Ok(None)
    }

    /// Tries the edge from a new branch into the goal region.
    fn arrives<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        index: usize,
        flight: &mut Flight,
    ) -> Result<bool, End> {
        let Some(branch) = self.branches.get(index) else { return Ok(false) };
        if branch.at_s + branch.to_goal_s >= search.best_cost() {
            return Ok(false);
        }
        let goal = &search.request.goal;
        let drawn = TranslationState {
            position: goal.position + search.chance.in_cube() * (2.0 * goal.radius_m),
            velocity: search.chance.in_cube() * (2.0 * goal.speed_m_s),
        };
        let attitude = goal.attitude.unwrap_or(branch.node.attitude);
        let arrival = Node { translation: within_goal(&drawn, goal, &search.limits), attitude };
        self.arcs.clear();
        if !search.append_edge(&branch.node, &arrival, &mut self.arcs)? {
            return Ok(false);
        }
        let duration_s: f64 = self.arcs.iter().map(|arc| arc.duration_s).sum();
        if branch.at_s + duration_s >= search.best_cost() || !search.is_free(&self.arcs, branch.at_s)? {
            return Ok(false);
        }
        let mut chain = vec![arrival];
        let mut next = Some(index);
        while let Some(branch) = next.and_then(|index| self.branches.get(index)) {
            chain.push(branch.node);
            next = branch.parent;
        }
        search.assemble(&chain, flight)
    }

    /// The tree's edges, for drawing.
    pub fn edges(&self) -> impl Iterator<Item = [Vector3<f64>; 2]> {
        self.branches.iter().filter_map(|branch| {
            let parent = self.branches.get(branch.parent?)?;
            Some([parent.node.translation.position, branch.node.translation.position])
        })
    }
}
