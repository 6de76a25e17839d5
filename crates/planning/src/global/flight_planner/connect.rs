//! The first plan: two trees of states at rest, one from the start and one from the goal, that grow towards each other.

use super::flight::{Flight, Node};
use super::search::{End, Search};
use crate::collision::CollisionWorld;
use crate::motion::{BodyArc, COEFFICIENTS, TranslationState};
use crate::steering::least_time_s;
use nalgebra::Vector3;

/// An edge stopped short goes this share of the way to the contact.
const SHARE_BEFORE_CONTACT: f64 = 0.9;
/// An edge shorter than this share of the one that was tried is not worth a node.
const LEAST_STEP: f64 = 1e-3;

#[derive(Clone, Copy, PartialEq)]
enum Side {
    Start,
    Goal,
}

#[derive(Clone, Copy)]
struct Branch {
    node: Node,
    /// Towards the root.
    parent: Option<usize>,
    /// Time since the start of the plan; in the goal's tree a guess.
    at_s: f64,
}

/// What an extension came to.
enum Growth {
    Reached(usize),
    Advanced(usize),
    Trapped,
}

/// The two trees; kept between searches for their memory.
#[derive(Default)]
pub(super) struct Connect {
    start: Vec<Branch>,
    goal: Vec<Branch>,
    arcs: Vec<BodyArc>,
}

impl Connect {
    /// Looks for a flight from the start to `goal` and leaves it in `flight`; false where `most_units` did not suffice.
    /// States in `seeds`, in their order on the way, join the trees first as far as edges between them are free. The flight
    /// begins with a wait of `wait_s` at the start, which was found free.
    pub fn find<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        goal: Node,
        seeds: &[Node],
        wait_s: f64,
        most_units: u64,
        flight: &mut Flight,
    ) -> Result<bool, End> {
        let last = search.units.saturating_add(most_units);
        let start = search.start();
        self.start.clear();
        self.goal.clear();
        self.start.push(Branch { node: start, parent: None, at_s: wait_s });
        self.goal.push(Branch { node: goal, parent: None, at_s: wait_s + travel_s(search, &start, &goal) });
        let mut side = Side::Start;
        let mut target = self.plant(search, goal, seeds)?;
        loop {
            if let Growth::Reached(index) | Growth::Advanced(index) = self.extend(search, side, &target)?
                && self.joins(search, side, index, flight)?
            {
                return Ok(true);
            }
            if search.units >= last {
                return Ok(false);
            }
            side = if side == Side::Start { Side::Goal } else { Side::Start };
            target = sample(search);
        }
    }

    /// Grows both trees along the seeds; the outermost state of the goal's tree comes back.
    fn plant<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        goal: Node,
        seeds: &[Node],
    ) -> Result<Node, End> {
        let mut outermost = goal;
        for seed in seeds.iter().rev() {
            if !self.continues(search, Side::Goal, seed)? {
                break;
            }
            outermost = *seed;
        }
        for seed in seeds {
            if *seed == outermost || !self.continues(search, Side::Start, seed)? {
                break;
            }
        }
        Ok(outermost)
    }

    /// Adds a state behind the last branch of a tree; false where the edge is not free.
    fn continues<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        side: Side,
        node: &Node,
    ) -> Result<bool, End> {
        let Some((parent, branch)) = self.tree(side).iter().copied().enumerate().next_back() else { return Ok(false) };
        let is_free = self.edge(search, side, &branch, node)?.is_none();
        if is_free {
            self.push(search, side, parent, node);
        }
        Ok(is_free)
    }

    /// Lets the other tree follow to a new branch; true where they have met in a flight.
    fn joins<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        side: Side,
        index: usize,
        flight: &mut Flight,
    ) -> Result<bool, End> {
        let other = if side == Side::Start { Side::Goal } else { Side::Start };
        let Some(node) = self.tree(side).get(index).map(|branch| branch.node) else { return Ok(false) };
        match self.extend(search, other, &node)? {
            Growth::Reached(met) => {
                let (start, goal) = if side == Side::Start { (index, met) } else { (met, index) };
                self.assemble(search, start, goal, flight)
            }
            Growth::Advanced(_) | Growth::Trapped => Ok(false),
        }
    }

    fn tree(&mut self, side: Side) -> &mut Vec<Branch> {
        match side {
            Side::Start => &mut self.start,
            Side::Goal => &mut self.goal,
        }
    }

    /// Grows a tree towards `target`, as far as nothing is hit.
    fn extend<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        side: Side,
        target: &Node,
    ) -> Result<Growth, End> {
        let mut nearest = None;
        let mut least = f64::INFINITY;
        for (index, branch) in self.tree(side).iter().enumerate() {
            let square = search.squared_distance(&branch.node, target);
            if square < least {
                least = square;
                nearest = Some((index, *branch));
            }
        }
        let Some((parent, branch)) = nearest else { return Ok(Growth::Trapped) };
        let Some(contact) = self.edge(search, side, &branch, target)? else {
            return Ok(Growth::Reached(self.push(search, side, parent, target)));
        };
        let Some(short) = contact.short else { return Ok(Growth::Trapped) };
        let whole = search.squared_distance(&branch.node, target);
        if search.squared_distance(&branch.node, &short) <= LEAST_STEP * LEAST_STEP * whole {
            return Ok(Growth::Trapped);
        }
        Ok(match self.edge(search, side, &branch, &short)? {
            None => Growth::Advanced(self.push(search, side, parent, &short)),
            Some(_) => Growth::Trapped,
        })
    }

    /// Checks the edge between a branch and a new node; `None` where it is free.
    fn edge<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        side: Side,
        branch: &Branch,
        target: &Node,
    ) -> Result<Option<Blocked>, End> {
        let arcs = &mut self.arcs;
        arcs.clear();
        let (from, to) = match side {
            Side::Start => (&branch.node, target),
            Side::Goal => (target, &branch.node),
        };
        if !search.append_edge(from, to, arcs)? {
            search.spend(1)?;
            return Ok(Some(Blocked { short: None }));
        }
        let duration_s: f64 = arcs.iter().map(|arc| arc.duration_s).sum();
        let start_s = match side {
            Side::Start => branch.at_s,
            Side::Goal => (branch.at_s - duration_s).max(0.0),
        };
        // Backwards, the contact nearest to the branch comes first.
        let is_reversed = side == Side::Goal && search.is_still;
        if is_reversed {
            reverse(arcs);
        }
        let Some(contact_s) = search.first_contact_s(arcs, start_s)? else { return Ok(None) };
        let is_usable = side == Side::Start || is_reversed;
        let short = if is_usable { short_of(&branch.node, arcs, contact_s) } else { None };
        Ok(Some(Blocked { short }))
    }

    fn push<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &Search<'_, '_, W>,
        side: Side,
        parent: usize,
        node: &Node,
    ) -> usize {
        let duration_s: f64 = self.arcs.iter().map(|arc| arc.duration_s).sum();
        let tree = self.tree(side);
        let parent_at_s = tree.get(parent).map_or(0.0, |branch| branch.at_s);
        let at_s = match side {
            Side::Start => parent_at_s + duration_s,
            Side::Goal => (parent_at_s - duration_s).max(travel_s(search, &search.start(), node)),
        };
        tree.push(Branch { node: *node, parent: Some(parent), at_s });
        tree.len() - 1
    }

    /// Makes a flight of two branches that hold the same node. Where time matters, the part from the goal's tree is checked
    /// again at its times, and what is free of it joins the start's tree.
    fn assemble<W: CollisionWorld + ?Sized>(
        &mut self,
        search: &mut Search<'_, '_, W>,
        start: usize,
        goal: usize,
        flight: &mut Flight,
    ) -> Result<bool, End> {
        let mut joint = start;
        let mut next = self.goal.get(goal).and_then(|branch| branch.parent);
        while let Some(branch) = next.and_then(|index| self.goal.get(index)).copied() {
            let Some(from) = self.start.get(joint).copied() else { return Ok(false) };
            self.arcs.clear();
            if !search.append_edge(&from.node, &branch.node, &mut self.arcs)? {
                return Ok(false);
            }
            if !search.is_still && !search.is_free(&self.arcs, from.at_s)? {
                return Ok(false);
            }
            joint = self.push(search, Side::Start, joint, &branch.node);
            next = branch.parent;
        }
        let mut chain = Vec::new();
        let mut index = Some(joint);
        while let Some(branch) = index.and_then(|index| self.start.get(index)) {
            chain.push(branch.node);
            index = branch.parent;
        }
        let is_whole = search.assemble(&chain, flight)?;
        if let Some(root) = self.start.first().filter(|root| is_whole && root.at_s > 0.0) {
            flight.arcs.insert(0, search.wait(root.at_s));
            search.rate(flight);
        }
        Ok(is_whole)
    }

    /// The edges of both trees, for drawing.
    pub fn edges(&self) -> impl Iterator<Item = [Vector3<f64>; 2]> {
        [&self.start, &self.goal].into_iter().flat_map(|tree| {
            tree.iter().filter_map(|branch| {
                let parent = tree.get(branch.parent?)?;
                Some([parent.node.translation.position, branch.node.translation.position])
            })
        })
    }
}

/// An edge that is not free, and a node short of where it is hit.
struct Blocked {
    short: Option<Node>,
}

/// Least time from one node to another, whatever stands between.
fn travel_s<W: CollisionWorld + ?Sized>(search: &Search<'_, '_, W>, from: &Node, to: &Node) -> f64 {
    least_time_s(&from.translation, &to.translation, &search.limits)
}

/// A state at rest, anywhere within the limits.
fn sample<W: CollisionWorld + ?Sized>(search: &mut Search<'_, '_, W>) -> Node {
    Node { translation: TranslationState::at_rest(search.position()), attitude: search.attitude() }
}

/// At rest between a node and where the arcs from it lead in `contact_s`.
fn short_of(node: &Node, arcs: &[BodyArc], contact_s: f64) -> Option<Node> {
    let mut time_s = contact_s;
    for arc in arcs {
        if time_s <= arc.duration_s {
            let way = arc.translation(time_s).0.position - node.translation.position;
            let translation = TranslationState::at_rest(node.translation.position + way * SHARE_BEFORE_CONTACT);
            let attitude = if arc.is_level() {
                arc.attitude
            } else {
                node.attitude.slerp(&arc.attitude_at(time_s), SHARE_BEFORE_CONTACT)
            };
            return Some(Node { translation, attitude });
        }
        time_s -= arc.duration_s;
    }
    None
}

/// The same motion flown backwards; translation and angle are quadratic in time.
fn reverse(arcs: &mut [BodyArc]) {
    arcs.reverse();
    for arc in arcs {
        let (end, acceleration) = arc.translation(arc.duration_s);
        let start = TranslationState { position: end.position, velocity: -end.velocity };
        let (_, rate, _) = arc.turn(arc.duration_s);
        let mut angle = [0.0; COEFFICIENTS];
        (angle[1], angle[2]) = (-rate, arc.angle[2]);
        let attitude = arc.attitude_at(arc.duration_s);
        *arc = BodyArc::accelerated(arc.duration_s, &start, acceleration, attitude).turning(arc.axis_body, angle);
    }
}
