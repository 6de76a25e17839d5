//! Inertial parameters of uniform solids, centred on the origin with their symmetry axis along z, and of point clouds.
//!
//! Place them with [`InertialParameters::transformed_by`]; build others by adding and subtracting these.

use crate::inertia::{InertialParameters, inertia_of_second_moment, point_inertia};
use tumble_lie::nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use tumble_lie::{Pose, Scalar, real};

impl<T: Scalar> InertialParameters<T> {
    /// Centred, with the given mean squares of the coordinates.
    fn centred(mass: T, mean_squares: Vector3<T>) -> Self {
        let second_moment = Matrix3::from_diagonal(&(mean_squares * mass));
        Self::about_origin(mass, Vector3::zeros(), inertia_of_second_moment(&second_moment))
    }

    /// Solid ellipsoid with the given semi-axes, m.
    pub fn solid_ellipsoid(mass: T, semi_axes: [T; 3]) -> Self {
        Self::centred(mass, Vector3::from(semi_axes).map(|a| a * a * real(0.2)))
    }

    /// Solid sphere.
    pub fn solid_sphere(mass: T, radius: T) -> Self {
        Self::solid_ellipsoid(mass, [radius; 3])
    }

    /// Sphere with a concentric spherical cavity; a thin shell where the radii are equal.
    pub fn hollow_sphere(mass: T, inner_radius: T, outer_radius: T) -> Self {
        let (r, q) = (outer_radius, inner_radius / outer_radius);
        // (1 - q^5) / (1 - q^3) without the 0/0 of a thin shell
        let ratio = (T::one() + q * (T::one() + q * (T::one() + q * (T::one() + q)))) / (T::one() + q * (T::one() + q));
        Self::centred(mass, Vector3::repeat(r * r * ratio * real(0.2)))
    }

    /// Solid box with the given edge lengths, m.
    pub fn solid_box(mass: T, edges: [T; 3]) -> Self {
        Self::centred(mass, Vector3::from(edges).map(|a| a * a / real(12.0)))
    }

    /// The solid box of the same mass, centre of mass and inertia: where its centre and axes are, and the lengths of its edges, m. An edge is zero
    /// where the body is flatter than any box. A body without mass is none: its numbers are not finite.
    ///
    /// # Frame
    /// The pose takes coordinates of the box to those of the body.
    ///
    /// # Example
    /// ```
    /// use tumble_dynamics::InertialParameters;
    /// use tumble_lie::Pose;
    ///
    /// let cargo = InertialParameters::solid_box(3.0, [0.1, 0.2, 0.3]).transformed_by(&Pose::translation(1.0, 0.0, 0.0));
    /// let (body_from_box, mut edges_m) = cargo.as_box();
    /// edges_m.sort_by(f64::total_cmp);
    /// assert!((body_from_box.translation.x - 1.0).abs() < 1e-12 && (edges_m[2] - 0.3).abs() < 1e-12);
    /// ```
    pub fn as_box(&self) -> (Pose<T>, [T; 3]) {
        let eigen = self.inertia_about_com().symmetric_eigen();
        let mut axes = eigen.eigenvectors;
        if axes.determinant() < T::zero() {
            axes.neg_mut();
        }
        let (half, rotation) = (eigen.eigenvalues.sum() * real(0.5), Rotation3::from_matrix_unchecked(axes));
        let edges =
            eigen.eigenvalues.map(|moment| (real::<T>(12.0) * (half - moment) / self.mass).max(T::zero()).sqrt());
        (Pose::from_parts(self.center_of_mass().into(), UnitQuaternion::from_rotation_matrix(&rotation)), edges.into())
    }

    /// Box with a concentric box-shaped cavity of smaller volume.
    pub fn hollow_box(mass: T, inner_edges: [T; 3], outer_edges: [T; 3]) -> Self {
        let volume = |edges: [T; 3]| edges[0] * edges[1] * edges[2];
        let density = mass / (volume(outer_edges) - volume(inner_edges));
        Self::solid_box(density * volume(outer_edges), outer_edges)
            - Self::solid_box(density * volume(inner_edges), inner_edges)
    }

    /// Solid cylinder along z.
    pub fn solid_cylinder(mass: T, radius: T, height: T) -> Self {
        Self::hollow_cylinder(mass, T::zero(), radius, height)
    }

    /// Cylinder along z with a concentric bore; a thin tube where the radii are equal, a ring where the height is zero.
    pub fn hollow_cylinder(mass: T, inner_radius: T, outer_radius: T, height: T) -> Self {
        let across = (inner_radius * inner_radius + outer_radius * outer_radius) * real(0.25);
        Self::centred(mass, Vector3::new(across, across, height * height / real(12.0)))
    }

    /// Thin disc across z.
    pub fn thin_disc(mass: T, radius: T) -> Self {
        Self::solid_cylinder(mass, radius, T::zero())
    }

    /// Thin rectangular plate across z with the given edge lengths along x and y, m.
    pub fn thin_plate(mass: T, edges: [T; 2]) -> Self {
        Self::solid_box(mass, [edges[0], edges[1], T::zero()])
    }

    /// Thin rod along z.
    pub fn thin_rod(mass: T, length: T) -> Self {
        Self::solid_box(mass, [T::zero(), T::zero(), length])
    }

    /// Point mass, body axes.
    pub fn point(mass: T, position: Vector3<T>) -> Self {
        Self::about_origin(mass, position, point_inertia(mass, &position))
    }

    /// Rigid cloud of point masses (mass, position in body axes).
    pub fn from_points(points: &[(T, Vector3<T>)]) -> Self {
        let nothing = Self::point(T::zero(), Vector3::zeros());
        points.iter().fold(nothing, |sum, (mass, position)| sum + Self::point(*mass, *position))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Principal moments of inertia, x, y, z.
    fn moments(body: &InertialParameters<f64>) -> [f64; 3] {
        body.inertia_about_com().diagonal().into()
    }

    fn assert_close(found: [f64; 3], expected: [f64; 3]) {
        for (f, e) in found.iter().zip(expected) {
            assert!((f - e).abs() < 1e-14, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn textbook_moments() {
        type Body = InertialParameters<f64>;
        assert_close(moments(&Body::solid_sphere(3.0, 0.5)), [0.4 * 3.0 * 0.25; 3]);
        assert_close(moments(&Body::hollow_sphere(3.0, 0.0, 0.5)), [0.4 * 3.0 * 0.25; 3]);
        assert_close(moments(&Body::hollow_sphere(3.0, 0.5, 0.5)), [2.0 / 3.0 * 3.0 * 0.25; 3]);
        assert_close(moments(&Body::solid_box(12.0, [1.0, 2.0, 3.0])), [13.0, 10.0, 5.0]);
        assert_close(moments(&Body::solid_cylinder(4.0, 1.0, 3.0)), [4.0, 4.0, 2.0]);
        assert_close(moments(&Body::hollow_cylinder(4.0, 1.0, 1.0, 3.0)), [5.0, 5.0, 4.0]);
        assert_close(moments(&Body::thin_disc(4.0, 1.0)), [1.0, 1.0, 2.0]);
        assert_close(moments(&Body::thin_plate(12.0, [1.0, 2.0])), [4.0, 1.0, 5.0]);
        assert_close(moments(&Body::thin_rod(12.0, 2.0)), [4.0, 4.0, 0.0]);
        assert_close(moments(&Body::solid_ellipsoid(5.0, [1.0, 2.0, 3.0])), [13.0, 10.0, 5.0]);
    }

    #[test]
    fn a_body_is_the_box_that_it_is_drawn_as() {
        let turn = UnitQuaternion::from_euler_angles(0.3, -0.8, 1.1);
        let pose = Pose::from_parts(Vector3::new(0.2, -0.1, 0.4).into(), turn);
        let body = InertialParameters::solid_box(3.0, [0.1, 0.25, 0.3]).transformed_by(&pose);
        let (body_from_box, edges): (Pose<f64>, _) = body.as_box();
        let again = InertialParameters::solid_box(3.0, edges).transformed_by(&body_from_box);
        assert!((again.to_vector() - body.to_vector()).amax() < 1e-14);
        let determinant: f64 = body_from_box.rotation.to_rotation_matrix().matrix().determinant();
        assert!((determinant - 1.0).abs() < 1e-12);
        // A rod is a box without width, a point one without edges; flatter than a disc is none.
        let mut rod = InertialParameters::thin_rod(2.0, 0.5).as_box().1;
        rod.sort_by(f64::total_cmp);
        assert!(rod[1].abs() < 1e-7 && (rod[2] - 0.5).abs() < 1e-12, "{rod:?}");
        assert_close(InertialParameters::point(2.0, Vector3::x()).as_box().1, [0.0; 3]);
        let flat =
            InertialParameters::about_com(1.0, Vector3::zeros(), Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 2.5)));
        assert!(flat.as_box().1.iter().all(|edge| *edge >= 0.0));
    }

    #[test]
    fn hollow_bodies_are_differences_of_solid_ones() {
        type Body = InertialParameters<f64>;
        let shell = Body::solid_sphere(8.0, 2.0) - Body::solid_sphere(1.0, 1.0);
        assert_close(moments(&Body::hollow_sphere(7.0, 1.0, 2.0)), moments(&shell));
        let tube = Body::solid_cylinder(4.0, 2.0, 3.0) - Body::solid_cylinder(1.0, 1.0, 3.0);
        assert_close(moments(&Body::hollow_cylinder(3.0, 1.0, 2.0, 3.0)), moments(&tube));
        // a box open on two sides is two pairs of slabs
        let frame = Body::hollow_box(3.0, [1.0, 1.0, 1.0], [2.0, 2.0, 1.0]);
        let slabs: Body = [(2.0, [2.0, 0.5, 1.0], [0.0, 0.75, 0.0]), (1.0, [0.5, 1.0, 1.0], [0.75, 0.0, 0.0])]
            .iter()
            .map(|&(mass, edges, place)| {
                let half = Body::solid_box(mass / 2.0, edges);
                let [x, y, z] = place;
                let pose = tumble_lie::Pose::translation(x, y, z);
                half.transformed_by(&pose) + half.transformed_by(&pose.inverse())
            })
            .fold(Body::from_points(&[]), |sum, part| sum + part);
        assert_close(moments(&frame), moments(&slabs));
        assert!((frame.mass - 3.0).abs() < 1e-15);
    }
}
