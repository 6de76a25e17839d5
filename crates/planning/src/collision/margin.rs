//! A margin between two ellipsoids that an optimiser can differentiate twice.

use super::Ellipsoid;
use nalgebra::{SMatrix, SVector};

/// A margin and its derivatives by (centre of a, attitude of a, centre of b, attitude of b).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalingMargin {
    /// How much both solids must grow about their centres to touch, less one: zero at contact, negative overlapping.
    pub value: f64,
    /// First derivatives; centres in world axes, 1/m, attitudes as right (body) increments, 1/rad.
    pub gradient: SVector<f64, 12>,
    /// Second derivatives along the same twelve.
    pub hessian: SMatrix<f64, 12, 12>,
}

/// The margin between two solids.
pub fn scaling_margin(_a: &Ellipsoid, _b: &Ellipsoid) -> ScalingMargin {
    ScalingMargin { value: f64::NAN, gradient: SVector::zeros(), hessian: SMatrix::zeros() }
}
