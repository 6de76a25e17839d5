//! A flight: a chain of arcs that can be cut and mended.

use crate::motion::{BodyArc, COEFFICIENTS, TranslationState};
use nalgebra::{UnitQuaternion, Vector3};

/// States of the old plan that a new one may lead through.
const SEEDS: usize = 24;
/// Points of a plan among which the one nearest to a position is looked for.
const NEAREST: usize = 96;

/// Where a flight may be cut and joined: a translation in full, an attitude at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Node {
    pub translation: TranslationState,
    pub attitude: UnitQuaternion<f64>,
}

/// A place in a flight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut {
    pub time_s: f64,
    pub node: Node,
    arc: usize,
    within_s: f64,
}

/// A plan in the making.
#[derive(Debug, Default)]
pub(super) struct Flight {
    pub arcs: Vec<BodyArc>,
    pub duration_s: f64,
    pub cost: f64,
}

impl Clone for Flight {
    fn clone(&self) -> Self {
        Self { arcs: self.arcs.clone(), ..*self }
    }

    fn clone_from(&mut self, source: &Self) {
        self.arcs.clone_from(&source.arcs);
        self.duration_s = source.duration_s;
        self.cost = source.cost;
    }
}

impl Flight {
    /// The place `time_s` after the start, or the next one after it at which the attitude rests; `None` past the end.
    pub fn cut(&self, time_s: f64) -> Option<Cut> {
        let mut since_s = 0.0;
        for (index, arc) in self.arcs.iter().enumerate() {
            let within_s = (time_s - since_s).max(0.0);
            let is_resting_start = arc.angle[1] == 0.0 && within_s == 0.0;
            if within_s < arc.duration_s && (arc.is_level() || is_resting_start) {
                let (translation, _) = arc.translation(within_s);
                let node = Node { translation, attitude: arc.attitude };
                return Some(Cut { time_s: since_s + within_s, node, arc: index, within_s });
            }
            since_s += arc.duration_s;
        }
        None
    }

    /// The state at the end.
    pub fn end(&self) -> Option<Node> {
        let arc = self.arcs.last()?;
        let (translation, _) = arc.translation(arc.duration_s);
        Some(Node { translation, attitude: arc.attitude_at(arc.duration_s) })
    }

    /// The arcs between two places, the last one being the end where absent.
    pub fn between(&self, from: &Cut, to: Option<&Cut>) -> impl Iterator<Item = BodyArc> {
        let (last, last_within_s) = to.map_or((self.arcs.len(), 0.0), |to| (to.arc, to.within_s));
        let (first, first_within_s) = (from.arc, from.within_s);
        self.arcs.iter().enumerate().skip(first).take((last + 1).saturating_sub(first)).filter_map(
            move |(index, arc)| {
                let begin_s = if index == first { first_within_s } else { 0.0 };
                let end_s = if index == last { last_within_s } else { arc.duration_s };
                (end_s > begin_s).then(|| part(arc, begin_s, end_s))
            },
        )
    }

    /// Replaces what lies between two places by `middle`.
    pub fn replace(&mut self, from: &Cut, to: Option<&Cut>, middle: &[BodyArc], scratch: &mut Vec<BodyArc>) {
        scratch.clear();
        if let Some(to) = to {
            scratch.extend(self.arcs.get(to.arc).map(|arc| part(arc, to.within_s, arc.duration_s)));
            scratch.extend(self.arcs.iter().skip(to.arc + 1));
        }
        self.arcs.truncate(from.arc + 1);
        if let Some(arc) = self.arcs.last_mut() {
            *arc = part(arc, 0.0, from.within_s);
            if from.within_s <= 0.0 {
                self.arcs.pop();
            }
        }
        self.arcs.extend_from_slice(middle);
        self.arcs.append(scratch);
    }
}

/// The part of an arc between two times of it: all of it, or a part of a level one.
pub(super) fn part(arc: &BodyArc, begin_s: f64, end_s: f64) -> BodyArc {
    if begin_s <= 0.0 {
        return BodyArc { duration_s: end_s, ..*arc };
    }
    let (state, acceleration) = arc.translation(begin_s);
    debug_assert!(arc.position[3..COEFFICIENTS].iter().all(|jerk| jerk.norm_squared() == 0.0));
    BodyArc::accelerated(end_s - begin_s, &state, acceleration, arc.attitude)
}

/// States of a flight behind the one that is nearest to a position, its end included.
pub(super) fn states_ahead(flight: &Flight, position: &Vector3<f64>) -> Vec<Node> {
    let distance = |node: &Node| (node.translation.position - position).norm_squared();
    let at = |share: f64| flight.cut(flight.duration_s * share);
    let nearest = (0..NEAREST)
        .filter_map(|step| at(step as f64 / NEAREST as f64))
        .min_by(|a, b| distance(&a.node).total_cmp(&distance(&b.node)));
    let from_s = nearest.map_or(0.0, |nearest| nearest.time_s);
    states_from(flight, from_s)
}

/// States of a flight from a time on, its end included.
pub(super) fn states_from(flight: &Flight, from_s: f64) -> Vec<Node> {
    let left_s = flight.duration_s - from_s;
    let later = (1..SEEDS).filter_map(|step| flight.cut(from_s + left_s * step as f64 / SEEDS as f64));
    let mut states: Vec<Node> = later.map(|cut| cut.node).chain(flight.end()).collect();
    states.dedup();
    states
}
