//! Whether two ellipsoids overlap, decided with a certificate.
//!
//! # Source
//! Perram and Wertheim, "Statistical mechanics of hard ellipsoids", Journal of Computational Physics 58 (1985).

use super::Ellipsoid;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// A plane `normal . x = offset`. The normal is not of unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Points from the first solid to the second, world axes.
    pub normal: Vector3<f64>,
    /// `normal . x` on the plane.
    pub offset: f64,
}

/// The answer to "do they overlap?", with what proves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Separation {
    /// The first solid lies on the negative side of this plane, the second on the positive side.
    Apart(Plane),
    /// This point lies in both solids, world axes, m.
    Overlapping(Vector3<f64>),
}

/// Whether two solids overlap, and what proves it.
pub fn separation(a: &Ellipsoid, b: &Ellipsoid) -> Separation {
    let between = b.center() - a.center();
    let (shape_a, shape_b) = (a.factor() * a.factor().transpose(), b.factor() * b.factor().transpose());
    let mut share = 0.5;
    let mut best = a.center() + between * 0.5;
    for _ in 0..200 {
        let matrix: Matrix3<f64> = shape_a * (1.0 - share) + shape_b * share;
        let eigen = SymmetricEigen::new(matrix);
        let pulled = eigen.eigenvectors.tr_mul(&between).component_div(&eigen.eigenvalues);
        let normal = eigen.eigenvectors * pulled;
        let (reach_a, reach_b) = (a.support(&normal), b.support(&normal));
        let gap = normal.dot(&between) - reach_a - reach_b;
        if gap > 0.0 {
            return Separation::Apart(Plane { normal, offset: normal.dot(a.center()) + reach_a + 0.5 * gap });
        }
        best = a.center() + shape_a * normal * (1.0 - share);
        if ((1.0 - share) * reach_a).max(share * reach_b) <= 1.0 {
            break;
        }
        share = reach_a / (reach_a + reach_b);
    }
    Separation::Overlapping(best)
}

/// Whether two solids overlap; touching counts.
pub fn overlap(a: &Ellipsoid, b: &Ellipsoid) -> bool {
    matches!(separation(a, b), Separation::Overlapping(_))
}
