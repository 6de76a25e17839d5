use alloc::vec;
use alloc::vec::Vec;
use core::fmt::Debug;
use core::ops::{Index, IndexMut};

/// How values, one for each joint or one for each pair of joints, are held.
///
/// # Example
/// ```
/// use tumble_dynamics::{Dynamic, Fixed, JointStorage};
///
/// /// Sum of one number for each of three joints, however they are held.
/// fn total<S: JointStorage>() -> f64 {
///     S::filled(3, 0.5).as_ref().iter().sum()
/// }
/// assert_eq!(total::<Dynamic>(), 1.5);
/// assert_eq!(total::<Fixed<3>>(), 1.5); // on the stack
/// ```
/// Tutorial: [an arm of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/dynamics/tests/suite/custom_arm.rs).
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
