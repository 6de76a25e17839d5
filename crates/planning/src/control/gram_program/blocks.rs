//! Several programs side by side, tied together by rows that are combinations of their rows.
//!
//! Curvature and rows of the blocks never change; products of joint rows are sums of products of the blocks' rows. So joint rows
//! can be replaced at any time without a factorisation.

use super::search::{self, Programmed};
use super::{GramProgram, GramSettings, GramStatus, GramWorkspace};

/// Blocks tied together.
const BLOCKS: usize = 3;
/// Combinations of the rows of a block that a joint row may have.
const TERMS: usize = 2;

/// What a joint row takes from one block: so much of each of these rows, as they were given.
pub(in crate::control) type JointPart = [(usize, f64); TERMS];

/// A joint row, its factors of the scaled rows of the blocks.
#[derive(Clone, Debug)]
struct JointRow {
    parts: [JointPart; BLOCKS],
    scale: f64,
}

/// The rows of the blocks one block after the other, then the joint ones.
#[derive(Clone, Debug)]
pub(in crate::control) struct BlockProgram {
    blocks: [GramProgram; BLOCKS],
    first_unknowns: [usize; BLOCKS],
    first_rows: [usize; BLOCKS],
    own_rows: usize,
    joint: Vec<JointRow>,
    fingerprint: u64,
}

/// Where a row is.
enum Place<'a> {
    Block(usize, usize),
    Joint(&'a JointRow),
}

impl BlockProgram {
    /// Without joint rows yet, but with memory for some.
    pub fn new(blocks: [GramProgram; BLOCKS], room: usize) -> Self {
        let (mut first_unknowns, mut first_rows) = ([0; BLOCKS], [0; BLOCKS]);
        let (mut unknowns, mut own_rows) = (0, 0);
        for (block, (first_unknown, first_row)) in blocks.iter().zip(first_unknowns.iter_mut().zip(&mut first_rows)) {
            (*first_unknown, *first_row) = (unknowns, own_rows);
            unknowns += block.unknowns();
            own_rows += block.rows();
        }
        let mut program =
            Self { blocks, first_unknowns, first_rows, own_rows, joint: Vec::with_capacity(room), fingerprint: 0 };
        program.set_joint(core::iter::empty());
        program
    }

    /// A workspace for it, with memory for as many joint rows.
    pub fn workspace(&self) -> GramWorkspace {
        let rows = [Programmed::rows(self), self.padded_rows()];
        let room = self.padded_rows() + self.joint.capacity();
        GramWorkspace::with_room([Programmed::unknowns(self), self.room()], rows, room)
    }

    /// Index of the first unknown of each block.
    pub fn first_unknowns(&self) -> [usize; BLOCKS] {
        self.first_unknowns
    }

    /// Index of the first row of each block.
    pub fn first_rows(&self) -> [usize; BLOCKS] {
        self.first_rows
    }

    /// Rows of the blocks; joint rows follow.
    pub fn own_rows(&self) -> usize {
        self.own_rows
    }

    /// Replaces the joint rows.
    pub fn set_joint(&mut self, rows: impl Iterator<Item = [JointPart; BLOCKS]>) {
        self.joint.clear();
        let mix = |hash: u64, bits: u64| (hash ^ bits).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(23);
        let mut hash = self.blocks.iter().fold(0xcbf2_9ce4_8422_2325, |hash, block| mix(hash, block.fingerprint));
        for mut parts in rows {
            let mut square = 0.0;
            for (part, block) in parts.iter_mut().zip(&self.blocks) {
                for (row, factor) in part.iter_mut() {
                    hash = mix(mix(hash, *row as u64), factor.to_bits());
                    *factor /= Programmed::scale(block, *row);
                }
                square += products(block, part, part);
            }
            let scale = if square > 0.0 { 1.0 / f64::sqrt(square) } else { 1.0 };
            for (_, factor) in parts.iter_mut().flatten() {
                *factor *= scale;
            }
            self.joint.push(JointRow { parts, scale });
        }
        self.fingerprint = hash;
    }

    /// Makes a workspace fit, and moves what it knows of each row to the row that `new` says.
    pub fn fit(&self, workspace: &mut GramWorkspace, new: impl FnMut(usize) -> Option<usize>) {
        workspace.resize(Programmed::rows(self), self.padded_rows());
        workspace.shift_rows(new);
    }

    /// See [`GramProgram::solve`].
    pub fn solve(
        &self,
        linear: &[f64],
        lower: &[f64],
        upper: &[f64],
        settings: &GramSettings,
        workspace: &mut GramWorkspace,
    ) -> GramStatus {
        search::solve(self, linear, [lower, upper], settings, workspace)
    }

    fn place(&self, row: usize) -> Place<'_> {
        if let Some(joint) = row.checked_sub(self.own_rows) {
            return Place::Joint(&self.joint[joint]);
        }
        let block = self.first_rows.iter().rposition(|first| *first <= row).unwrap_or(0);
        Place::Block(block, row - self.first_rows[block])
    }

    /// The last block writes whole panels.
    fn padded_rows(&self) -> usize {
        let last = self.first_rows[BLOCKS - 1] + self.blocks[BLOCKS - 1].by_panels.padded_rows();
        last.max(self.own_rows + self.joint.len())
    }
}

/// Product in the inverse curvature of what two joint rows take from a block.
fn products(block: &GramProgram, left: &JointPart, right: &JointPart) -> f64 {
    let mut sum = 0.0;
    for (row, factor) in left {
        for (other, other_factor) in right {
            sum += factor * other_factor * block.product(*row, *other);
        }
    }
    sum
}

impl Programmed for BlockProgram {
    fn rows(&self) -> usize {
        self.own_rows + self.joint.len()
    }

    fn unknowns(&self) -> usize {
        self.first_unknowns[BLOCKS - 1] + self.blocks[BLOCKS - 1].unknowns
    }

    fn room(&self) -> usize {
        self.first_unknowns[BLOCKS - 1] + self.blocks[BLOCKS - 1].room()
    }

    fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    fn equations(&self) -> impl Iterator<Item = usize> {
        let each = self.blocks.iter().zip(self.first_rows);
        each.flat_map(|(block, first)| block.equations().map(move |row| first + row))
    }

    fn is_equation(&self, row: usize) -> bool {
        match self.place(row) {
            Place::Block(block, row) => self.blocks[block].is_equation(row),
            Place::Joint(_) => false,
        }
    }

    fn scale(&self, row: usize) -> f64 {
        match self.place(row) {
            Place::Block(block, row) => self.blocks[block].scale(row),
            Place::Joint(joint) => joint.scale,
        }
    }

    fn product(&self, row: usize, other: usize) -> f64 {
        let mixed = |joint: &JointRow, block: usize, row: usize| {
            let of_block = &self.blocks[block];
            joint.parts[block].iter().map(|(of_joint, factor)| factor * of_block.product(*of_joint, row)).sum()
        };
        match (self.place(row), self.place(other)) {
            (Place::Block(block, row), Place::Block(of_other, other)) => {
                if block == of_other {
                    self.blocks[block].product(row, other)
                } else {
                    0.0
                }
            }
            (Place::Joint(joint), Place::Block(block, row)) | (Place::Block(block, row), Place::Joint(joint)) => {
                mixed(joint, block, row)
            }
            (Place::Joint(left), Place::Joint(right)) => {
                let parts = left.parts.iter().zip(&right.parts).zip(&self.blocks);
                parts.map(|((left, right), block)| products(block, left, right)).sum()
            }
        }
    }

    fn value(&self, row: usize, x: &[f64]) -> f64 {
        match self.place(row) {
            Place::Block(block, row) => self.blocks[block].value(row, &x[self.first_unknowns[block]..]),
            Place::Joint(joint) => {
                let each = joint.parts.iter().zip(&self.blocks).zip(self.first_unknowns);
                each.map(|((part, block), first)| {
                    part.iter().map(|(row, factor)| factor * block.value(*row, &x[first..])).sum::<f64>()
                })
                .sum()
            }
        }
    }

    fn values(&self, x: &[f64], values: &mut [f64]) {
        for (block, (unknown, row)) in self.blocks.iter().zip(self.first_unknowns.into_iter().zip(self.first_rows)) {
            // what a block writes beyond its rows is overwritten by the next
            block.by_panels.times(&x[unknown..], &mut values[row..]);
        }
        let (own, joint_values) = values.split_at_mut(self.own_rows);
        for (value, joint) in joint_values.iter_mut().zip(&self.joint) {
            let mut sum = 0.0;
            for (part, first) in joint.parts.iter().zip(self.first_rows) {
                for (row, factor) in part {
                    sum += factor * own[first + row];
                }
            }
            *value = sum;
        }
    }

    fn add_column(&self, row: usize, factor: f64, x: &mut [f64]) {
        match self.place(row) {
            Place::Block(block, row) => {
                self.blocks[block].add_column(row, factor, &mut x[self.first_unknowns[block]..]);
            }
            Place::Joint(joint) => {
                for ((part, block), first) in joint.parts.iter().zip(&self.blocks).zip(self.first_unknowns) {
                    for (row, share) in part {
                        block.add_column(*row, factor * share, &mut x[first..]);
                    }
                }
            }
        }
    }

    fn add_normal(&self, row: usize, factor: f64, x: &mut [f64]) {
        match self.place(row) {
            Place::Block(block, row) => {
                self.blocks[block].add_normal(row, factor, &mut x[self.first_unknowns[block]..]);
            }
            Place::Joint(joint) => {
                for ((part, block), first) in joint.parts.iter().zip(&self.blocks).zip(self.first_unknowns) {
                    for (row, share) in part {
                        block.add_normal(*row, factor * share, &mut x[first..]);
                    }
                }
            }
        }
    }

    fn times_inverse(&self, x: &[f64], product: &mut [f64]) {
        for (block, first) in self.blocks.iter().zip(self.first_unknowns) {
            block.times_inverse(&x[first..], &mut product[first..]);
        }
    }

    fn times_hessian(&self, x: &[f64], product: &mut [f64]) {
        for (block, first) in self.blocks.iter().zip(self.first_unknowns) {
            block.times_hessian(&x[first..], &mut product[first..]);
        }
    }
}
