//! Numbers of samples and steps.

use num_traits::AsPrimitive;

/// A whole number as an index.
pub(super) fn whole_signed(x: f64) -> isize {
    x.as_()
}

/// The nearest whole number, none below zero.
pub(crate) fn whole(x: f64) -> usize {
    x.round().as_()
}
