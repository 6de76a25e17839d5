//! Conditions on a motion as rows `c >= 0` with their gradients.

use super::model::KINEMATICS;

/// A condition that a motion keeps where `value >= 0`, between two neighbouring nodes or at one of them; scaled so that one is
/// its natural size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionRow {
    /// The node at the start of the segment.
    pub node: usize,
    /// `c` at the current motion.
    pub value: f64,
    /// Change of `c` by the kinematics at the start of the segment, in the order of [`super::Kinematics`]' changes.
    pub by_start: [f64; KINEMATICS],
    /// The same at its end.
    pub by_end: [f64; KINEMATICS],
    /// Where the least distance lies inside the segment, it moves along with the motion, which bends `c` downwards.
    pub contact: Option<MovingContact>,
}

/// How the place of least distance moves on a segment: `c` bends by `-(b x)^2 / curvature` for a change `x` of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingContact {
    /// `b`: change of `dc/ds` by the kinematics at the start, `s` from 0 to 1 along the segment.
    pub by_start: [f64; KINEMATICS],
    /// The same at the end.
    pub by_end: [f64; KINEMATICS],
    /// `d^2 c / ds^2`, positive.
    pub curvature: f64,
}
