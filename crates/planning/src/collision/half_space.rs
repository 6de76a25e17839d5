//! Half-spaces: walls without an end.

use super::distance::Distance;
use super::{Ellipsoid, Sphere};
use nalgebra::{Unit, Vector3};

/// Everything on one side of a plane: all `x` with `inward . x >= offset_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// From the plane into the solid, world axes.
    pub inward: Unit<Vector3<f64>>,
    /// Distance of the plane from the origin along it, m.
    pub offset_m: f64,
}

impl HalfSpace {
    fn to(self, center: &Vector3<f64>, height: f64, reach: Vector3<f64>) -> Distance {
        let normal = self.inward.into_inner();
        let along = normal.dot(center);
        let distance_m = self.offset_m - along - height;
        let point_on_a = center + reach;
        // The rounding of the product is that of its terms.
        let terms = normal.component_mul(center).abs().sum();
        Distance {
            distance_m,
            lower_bound_m: distance_m - 8.0 * f64::EPSILON * (self.offset_m.abs() + terms + height),
            normal,
            point_on_a,
            point_on_b: point_on_a + normal * distance_m,
        }
    }
}

/// Signed distance of an ellipsoid and a half-space, inside as well.
pub fn ellipsoid_to_half_space(a: &Ellipsoid, b: &HalfSpace) -> Distance {
    let pulled_back = a.factor().tr_mul(&b.inward);
    let height = f64::sqrt(pulled_back.norm_squared());
    b.to(a.center(), height, a.factor() * (pulled_back / height))
}

/// Signed distance of a sphere and a half-space, inside as well.
pub fn sphere_to_half_space(a: &Sphere, b: &HalfSpace) -> Distance {
    b.to(&a.center, a.radius_m, b.inward.into_inner() * a.radius_m)
}
