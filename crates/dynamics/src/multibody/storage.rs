use alloc::vec;
use alloc::vec::Vec;
use core::fmt::Debug;
use core::ops::{Index, IndexMut};

/// How values, one for each joint or one for each pair of joints, are held.
pub trait JointStorage: Copy + Debug + PartialEq + 'static {
    /// One `X` for each joint.
    type Of<X: Copy + Debug + PartialEq>: AsRef<[X]>
        + AsMut<[X]>
        + Index<usize, Output = X>
        + IndexMut<usize>
        + Clone
        + Debug
        + PartialEq;
    /// Rows of one `X` for each pair of joints.
    type Pairs<X: Copy + Debug + PartialEq>: Index<usize, Output = Self::Of<X>>
        + IndexMut<usize>
        + Clone
        + Debug
        + PartialEq;
    /// `count` copies of `value`; a fixed storage knows its count.
    fn filled<X: Copy + Debug + PartialEq>(count: usize, value: X) -> Self::Of<X>;
    /// `count` rows of as many copies of `value`.
    fn pairs<X: Copy + Debug + PartialEq>(count: usize, value: X) -> Self::Pairs<X>;
}

/// Any number of joints, on the heap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dynamic;

/// `J` joints, on the stack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fixed<const J: usize>;

impl JointStorage for Dynamic {
    type Of<X: Copy + Debug + PartialEq> = Vec<X>;
    type Pairs<X: Copy + Debug + PartialEq> = Vec<Vec<X>>;
    fn filled<X: Copy + Debug + PartialEq>(count: usize, value: X) -> Vec<X> {
        vec![value; count]
    }
    fn pairs<X: Copy + Debug + PartialEq>(count: usize, value: X) -> Vec<Vec<X>> {
        vec![vec![value; count]; count]
    }
}

impl<const J: usize> JointStorage for Fixed<J> {
    type Of<X: Copy + Debug + PartialEq> = [X; J];
    type Pairs<X: Copy + Debug + PartialEq> = [[X; J]; J];
    #[inline(always)]
    fn filled<X: Copy + Debug + PartialEq>(_: usize, value: X) -> [X; J] {
        [value; J]
    }
    #[inline(always)]
    fn pairs<X: Copy + Debug + PartialEq>(_: usize, value: X) -> [[X; J]; J] {
        [[value; J]; J]
    }
}
