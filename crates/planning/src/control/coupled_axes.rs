//! Three axes that obstacles tie together.

use nalgebra::Vector3;

/// A half-space that one node of a plan is kept in: `normal . r <= offset`, in the axes of the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisPlane {
    /// What it keeps off.
    pub obstacle: usize,
    /// The segment it belongs to, from node `step - 1` to node `step`.
    pub step: usize,
    /// The node it is kept at.
    pub node: usize,
    /// Unit normal.
    pub normal: Vector3<f64>,
    /// Largest `normal . r`, m.
    pub offset_m: f64,
}
