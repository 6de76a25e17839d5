//! An ellipsoid somewhere in the world.

use super::BodyEllipsoid;
use crate::error::{PlanningError, pose};
use nalgebra::{Matrix3, Vector3};
use tumble_lie::Pose;

/// A solid ellipsoid, kept in the two forms that every test here uses: its factor `L` (columns are semi-axes as vectors, so
/// that the solid is `center + L s`, `|s| <= 1`) and its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    center: Vector3<f64>,
    factor: Matrix3<f64>,
    semi_axes: Vector3<f64>,
}

impl Ellipsoid {
    /// The ellipsoid with this centre and these axes.
    ///
    /// # Errors
    /// Semi-axes that are not positive, numbers that are not finite, beyond 1e20 m or, for semi-axes, below 1e-20 m; semi-axes that
    /// differ by more than the factor 1e4; an attitude that is none.
    pub fn try_new(world_from_ellipsoid: &Pose<f64>, semi_axes: &Vector3<f64>) -> Result<Self, PlanningError> {
        crate::error::semi_axes("a semi-axis", semi_axes)?;
        pose(world_from_ellipsoid)?;
        Ok(Self::posed(world_from_ellipsoid, semi_axes))
    }

    /// The same without a check, for numbers that were checked before.
    pub(crate) fn posed(world_from_ellipsoid: &Pose<f64>, semi_axes: &Vector3<f64>) -> Self {
        let mut factor = *world_from_ellipsoid.rotation.to_rotation_matrix().matrix();
        for (mut column, semi_axis) in factor.column_iter_mut().zip(semi_axes) {
            column *= *semi_axis;
        }
        Self { center: world_from_ellipsoid.translation.vector, factor, semi_axes: *semi_axes }
    }

    /// A part of a body at a pose of the body.
    pub fn of_body(part: &BodyEllipsoid, world_from_body: &Pose<f64>) -> Self {
        Self::posed(&(world_from_body * part.body_from_ellipsoid), &part.semi_axes)
    }

    /// The same turned about its centre, which is then elsewhere.
    #[inline]
    pub(crate) fn turned_to(&self, rotation: &Matrix3<f64>, center: Vector3<f64>) -> Self {
        Self { center, factor: rotation * self.factor, semi_axes: self.semi_axes }
    }

    /// The same with its centre elsewhere.
    #[inline]
    pub(crate) fn moved_to(&self, center: Vector3<f64>) -> Self {
        Self { center, ..*self }
    }

    /// Its centre, world axes, m.
    pub fn center(&self) -> &Vector3<f64> {
        &self.center
    }

    /// `L`: columns are the semi-axes as vectors, world axes, m.
    pub fn factor(&self) -> &Matrix3<f64> {
        &self.factor
    }

    /// Semi-axes, m.
    pub fn semi_axes(&self) -> &Vector3<f64> {
        &self.semi_axes
    }

    /// How many times larger the solid had to be for its surface to hold `center + offset`; zero at the centre.
    #[inline]
    pub(crate) fn gauge(&self, offset: &Vector3<f64>) -> f64 {
        let squares = self.semi_axes.component_mul(&self.semi_axes);
        f64::sqrt(self.factor.tr_mul(offset).component_div(&squares).norm_squared())
    }

    /// How far the solid reaches along `direction` from its centre: `|L' direction|`.
    #[inline]
    pub fn support(&self, direction: &Vector3<f64>) -> f64 {
        f64::sqrt(self.factor.tr_mul(direction).norm_squared())
    }

    /// The point of the solid that lies farthest along `direction` (not zero).
    #[inline]
    pub fn support_point(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let pulled_back = self.factor.tr_mul(direction);
        self.center + self.factor * (pulled_back / f64::sqrt(pulled_back.norm_squared()))
    }

    /// Half the extent along each world axis, m.
    pub fn half_extent(&self) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| f64::sqrt(self.factor.row(axis).norm_squared()))
    }
}
