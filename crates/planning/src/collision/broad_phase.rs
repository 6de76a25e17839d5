//! Which of many obstacles at rest a query need look at: a tree of boxes.

use nalgebra::Vector3;
use tumble_dynamics::AlignedBox;

/// Most boxes that a leaf holds.
const LEAF: usize = 4;

/// The signed distance of two boxes is not below this.
pub(super) fn box_gap(lower: &Vector3<f64>, upper: &Vector3<f64>, other: &AlignedBox) -> f64 {
    let gap = (lower - other.upper_world).sup(&(other.lower_world - upper));
    let apart = f64::sqrt(gap.sup(&Vector3::zeros()).norm_squared());
    if apart > 0.0 { apart } else { gap.max() }
}

/// Boxes in a balanced binary tree, in preorder: to skip a subtree is to jump.
#[derive(Clone, Debug, Default)]
pub(super) struct BoxTree {
    nodes: Vec<Node>,
    /// Indices of the boxes, leaf after leaf.
    order: Vec<usize>,
}

#[derive(Clone, Debug)]
struct Node {
    bounds: AlignedBox,
    /// The node behind this subtree.
    behind: usize,
    /// The boxes below: a range of the order.
    first: usize,
    end: usize,
    is_leaf: bool,
}

impl BoxTree {
    /// The tree of boxes with these indices.
    pub fn new(boxes: &[(usize, AlignedBox)]) -> Self {
        let mut boxes = boxes.to_vec();
        let mut tree = Self::default();
        if !boxes.is_empty() {
            tree.grow(&mut boxes, 0);
        }
        tree.order = boxes.iter().map(|(index, _)| *index).collect();
        tree
    }

    fn grow(&mut self, boxes: &mut [(usize, AlignedBox)], first: usize) {
        let infinite = Vector3::repeat(f64::INFINITY);
        let nothing = AlignedBox { lower_world: infinite, upper_world: -infinite };
        let bounds = boxes.iter().fold(nothing, |all, (_, one)| AlignedBox {
            lower_world: all.lower_world.inf(&one.lower_world),
            upper_world: all.upper_world.sup(&one.upper_world),
        });
        let (place, is_leaf) = (self.nodes.len(), boxes.len() <= LEAF);
        self.nodes.push(Node { bounds, behind: 0, first, end: first + boxes.len(), is_leaf });
        if !is_leaf {
            let axis = (bounds.upper_world - bounds.lower_world).imax();
            let middle = boxes.len() / 2;
            let center = |one: &AlignedBox| one.lower_world[axis] + one.upper_world[axis];
            boxes.select_nth_unstable_by(middle, |(i, a), (j, b)| center(a).total_cmp(&center(b)).then(i.cmp(j)));
            let (left, right) = boxes.split_at_mut(middle);
            self.grow(left, first);
            self.grow(right, first + middle);
        }
        let behind = self.nodes.len();
        if let Some(node) = self.nodes.get_mut(place) {
            node.behind = behind;
        }
    }

    /// Visits every box whose subtree's gap to the box asked about is at most what the last visit returned (at first:
    /// `limit_m`); a leaf near it comes first, and again in its turn.
    pub fn visit(
        &self,
        lower: &Vector3<f64>,
        upper: &Vector3<f64>,
        mut limit_m: f64,
        nearest_first: bool,
        mut visit: impl FnMut(usize) -> f64,
    ) {
        let mut near = None;
        if nearest_first {
            near = self.near_leaf(lower, upper);
            for index in near.iter().flat_map(|leaf| self.below(*leaf)) {
                limit_m = visit(*index);
            }
        }
        let mut place = 0;
        while let Some(node) = self.nodes.get(place) {
            if box_gap(lower, upper, &node.bounds) > limit_m {
                place = node.behind;
                continue;
            }
            if node.is_leaf && near != Some(place) {
                for index in self.below(place) {
                    limit_m = visit(*index);
                }
            }
            place += 1;
        }
    }

    fn below(&self, place: usize) -> &[usize] {
        self.nodes.get(place).and_then(|node| self.order.get(node.first..node.end)).unwrap_or(&[])
    }

    /// The leaf reached by always going to the nearer side.
    fn near_leaf(&self, lower: &Vector3<f64>, upper: &Vector3<f64>) -> Option<usize> {
        let mut place = 0;
        loop {
            let node = self.nodes.get(place)?;
            if node.is_leaf {
                return Some(place);
            }
            let left = self.nodes.get(place + 1)?;
            let right = self.nodes.get(left.behind)?;
            let is_right = box_gap(lower, upper, &right.bounds) < box_gap(lower, upper, &left.bounds);
            place = if is_right { left.behind } else { place + 1 };
        }
    }
}
