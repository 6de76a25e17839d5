//! The ten inertial parameters of a rigid body and what makes them physical.
//!
//! Generic over the scalar, except where a verdict is given (`f64`).

use crate::error::DynamicsError;
use crate::parameter_vector::PARAMETERS;
use tumble_lie::nalgebra::{Isometry3, Matrix3, Matrix4, Matrix6, SVector, Vector3};
use tumble_lie::{Scalar, real, skew};

/// Mass, first moment and inertia of a rigid body about the origin of its body frame.
///
/// Bodies in one frame add and subtract (see [`InertialParameters::with_payload`]); a mass distribution with these
/// numbers exists exactly when [`InertialParameters::is_consistent`].
///
/// With feature `serde` a body is written as people write it, about its centre of mass: `mass_kg`, `com_m` and
/// `inertia_about_com_kg_m2` (three rows); a body that is read must be consistent.
/// # Frame
/// Body axes; the origin is any body-fixed point, not necessarily the centre of mass.
/// # Units
/// kg, kg m, kg m^2.
/// # Source
/// Thesis (4.9).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertialParameters<T: Scalar> {
    /// Mass, kg.
    pub mass: T,
    /// First moment `m c`, kg m.
    pub first_moment: Vector3<T>,
    /// Inertia tensor about the body origin (off-diagonals are minus the products of inertia), kg m^2.
    pub inertia_about_origin: Matrix3<T>,
}

impl<T: Scalar> InertialParameters<T> {
    /// From mass, centre of mass (body axes) and inertia about the body origin.
    pub fn about_origin(mass: T, center_of_mass: Vector3<T>, inertia_about_origin: Matrix3<T>) -> Self {
        Self { mass, first_moment: center_of_mass * mass, inertia_about_origin }
    }

    /// From mass, centre of mass (body axes) and inertia about the centre of mass (body axes).
    ///
    /// # Source
    /// Thesis (2.6).
    pub fn about_com(mass: T, center_of_mass: Vector3<T>, inertia_about_com: Matrix3<T>) -> Self {
        Self::about_origin(mass, center_of_mass, inertia_about_com + point_inertia(mass, &center_of_mass))
    }

    /// Centre of mass, body axes, m. Not finite for a massless body.
    pub fn center_of_mass(&self) -> Vector3<T> {
        self.first_moment / self.mass
    }

    /// Inertia about the centre of mass, body axes, kg m^2.
    pub fn inertia_about_com(&self) -> Matrix3<T> {
        self.inertia_about_origin - point_inertia(self.mass, &self.center_of_mass())
    }

    /// The packing order of the Newton-Euler regressor, `[m, h_x, h_y, h_z, J11, J12, J13, J22, J23, J33]`.
    ///
    /// Other orders: [`ParameterOrder`](crate::ParameterOrder).
    /// # Source
    /// Thesis (4.9).
    #[inline]
    pub fn to_vector(&self) -> SVector<T, PARAMETERS> {
        let (h, j) = (&self.first_moment, &self.inertia_about_origin);
        SVector::from([self.mass, h.x, h.y, h.z, j.m11, j.m12, j.m13, j.m22, j.m23, j.m33])
    }

    /// Inverse of [`InertialParameters::to_vector`].
    #[inline]
    pub fn from_vector(p: &SVector<T, PARAMETERS>) -> Self {
        Self {
            mass: p[0],
            first_moment: Vector3::new(p[1], p[2], p[3]),
            inertia_about_origin: Matrix3::new(p[4], p[5], p[6], p[5], p[7], p[8], p[6], p[8], p[9]),
        }
    }

    /// `M` with kinetic energy `1/2 twist^T M twist` and spatial momentum `M twist`.
    ///
    /// # Shape
    /// 6x6, `[[J, S(h)], [-S(h), m I]]`, order `[angular; linear]`, about the body origin.
    /// # Source
    /// Thesis (2.8), (5.10), (5.11).
    pub fn spatial_inertia(&self) -> Matrix6<T> {
        let coupling = skew(&self.first_moment);
        let mut m = Matrix6::from_diagonal_element(self.mass);
        m.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.inertia_about_origin);
        m.fixed_view_mut::<3, 3>(0, 3).copy_from(&coupling);
        m.fixed_view_mut::<3, 3>(3, 0).copy_from(&-coupling);
        m
    }

    /// The same body described in frame `a`, from its description in frame `b`.
    ///
    /// Changes the origin (parallel axes) and the axes at once.
    #[must_use]
    pub fn transformed_by(&self, a_from_b: &Isometry3<T>) -> Self {
        let (r, t) = (a_from_b.rotation.to_rotation_matrix().into_inner(), &a_from_b.translation.vector);
        let h = r * self.first_moment;
        let cross = h * t.transpose();
        let shift = Matrix3::identity() * (h.dot(t) * real(2.0)) - cross - cross.transpose();
        Self {
            mass: self.mass,
            first_moment: h + t * self.mass,
            inertia_about_origin: symmetric(&(r * self.inertia_about_origin * r.transpose()))
                + shift
                + point_inertia(self.mass, t),
        }
    }
}

/// The mean of a matrix and its transpose.
pub(crate) fn symmetric<T: Scalar>(m: &Matrix3<T>) -> Matrix3<T> {
    (m + m.transpose()) * real::<T>(0.5)
}

/// `m (|c|^2 I - c c^T)`: inertia about the origin of a point mass at `position`.
pub(crate) fn point_inertia<T: Scalar>(mass: T, position: &Vector3<T>) -> Matrix3<T> {
    (Matrix3::identity() * position.norm_squared() - position * position.transpose()) * mass
}

/// Second moment `integral of x x^T dm` of a body with this inertia about the same point: `1/2 tr(J) I - J`.
pub(crate) fn second_moment<T: Scalar>(inertia: &Matrix3<T>) -> Matrix3<T> {
    Matrix3::identity() * (inertia.trace() * real(0.5)) - inertia
}

/// Inverse of [`second_moment`]: `tr(Sigma) I - Sigma`.
pub(crate) fn inertia_of_second_moment<T: Scalar>(second_moment: &Matrix3<T>) -> Matrix3<T> {
    Matrix3::identity() * second_moment.trace() - second_moment
}

/// The pseudo-inertia `[[1/2 tr(J) I - J, m c], [m c^T, m]]`, J about the origin: the integral of `[x; 1][x; 1]^T dm`.
///
/// Linear in the parameters; a body exists exactly when it is positive semidefinite.
/// # Source
/// Thesis (5.36)-(5.38).
/// # Deviation
/// (5.38) prints the inertia about the centre of mass; only the one about the origin is linear in the parameters and
/// agrees with the definition (`tests/suite/planted_defects_bodies.rs`).
pub fn pseudo_inertia<T: Scalar>(p: &InertialParameters<T>) -> Matrix4<T> {
    let (s, h) = (second_moment(&p.inertia_about_origin), &p.first_moment);
    Matrix4::new(
        s.m11, s.m12, s.m13, h.x, //
        s.m12, s.m22, s.m23, h.y, //
        s.m13, s.m23, s.m33, h.z, //
        h.x, h.y, h.z, p.mass,
    )
}

/// Inverse of [`pseudo_inertia`]; reads the upper triangle.
pub fn from_pseudo_inertia<T: Scalar>(p: &Matrix4<T>) -> InertialParameters<T> {
    let s = Matrix3::new(p.m11, p.m12, p.m13, p.m12, p.m22, p.m23, p.m13, p.m23, p.m33);
    InertialParameters {
        mass: p.m44,
        first_moment: Vector3::new(p.m14, p.m24, p.m34),
        inertia_about_origin: inertia_of_second_moment(&s),
    }
}

impl InertialParameters<f64> {
    /// How far inside the set of existing bodies, from 1/3 (a uniform sphere) over 0 (a plate, a rod, a point) to -1.
    ///
    /// The smallest eigenvalue of the pseudo-inertia about the centre of mass in the body's own units (its mass, its
    /// root mean square radius): `lambda_min(Sigma_C) / sum |lambda(Sigma_C)|`, `Sigma_C = 1/2 tr(J_C) I - J_C`, and -1
    /// for a negative mass. Scaling mass, length or time does not change it, nor does the place of the origin.
    /// An eigenvalue below the rounding of the ten numbers (16 units in the last place of the largest entry of the
    /// inertia about the origin) counts as zero. NaN when a parameter is not finite.
    /// # Source
    /// Thesis (5.35): the Schur complement of `m` in [`pseudo_inertia`] is `Sigma_C`.
    pub fn consistency_margin(&self) -> f64 {
        let size = self.inertia_about_origin.amax();
        let sum = self.mass + self.first_moment.sum() + self.inertia_about_origin.sum();
        if !(sum.is_finite() && size.is_finite()) {
            return f64::NAN;
        }
        let massless_with_moment = self.mass == 0.0 && self.first_moment != Vector3::zeros();
        if self.mass < 0.0 || massless_with_moment {
            return -1.0;
        }
        if size == 0.0 {
            return if self.first_moment == Vector3::zeros() { 0.0 } else { -1.0 };
        }
        let mut second_moment_about_com = second_moment(&(self.inertia_about_origin / size));
        if self.mass > 0.0 {
            second_moment_about_com -= (self.first_moment / size) * self.center_of_mass().transpose();
        }
        let eigenvalues = second_moment_about_com
            .symmetric_eigenvalues()
            .map(|value| if value.abs() <= 16.0 * f64::EPSILON { 0.0 } else { value });
        let sum_of_magnitudes = eigenvalues.map(f64::abs).sum();
        if sum_of_magnitudes == 0.0 { 0.0 } else { eigenvalues.min() / sum_of_magnitudes }
    }

    /// Whether a body with these parameters exists, plates, rods and points included (closed set).
    pub fn is_consistent(&self) -> bool {
        self.consistency_margin() >= 0.0
    }

    /// Whether a body with these parameters exists and has extent in every direction (open set).
    pub fn is_strictly_consistent(&self) -> bool {
        self.consistency_margin() > 0.0
    }

    /// Itself when [`InertialParameters::is_consistent`] and its inertia is symmetric.
    ///
    /// # Errors
    /// [`DynamicsError::NotRealizable`], [`DynamicsError::AsymmetricInertia`], [`DynamicsError::NotFinite`].
    pub fn validated(self) -> Result<Self, DynamicsError> {
        let margin = self.consistency_margin();
        if margin.is_nan() {
            return Err(DynamicsError::NotFinite);
        }
        let inertia = &self.inertia_about_origin;
        let difference = (inertia - inertia.transpose()).amax();
        if difference > 1e-9 * inertia.amax() {
            return Err(DynamicsError::AsymmetricInertia { difference });
        }
        if margin < 0.0 {
            return Err(DynamicsError::NotRealizable { margin });
        }
        Ok(self)
    }
}

/// A body as people write it.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenBody {
    mass_kg: f64,
    com_m: [f64; 3],
    inertia_about_com_kg_m2: [[f64; 3]; 3],
}

#[cfg(feature = "serde")]
impl serde::Serialize for InertialParameters<f64> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let body = WrittenBody {
            mass_kg: self.mass,
            com_m: self.center_of_mass().into(),
            inertia_about_com_kg_m2: self.inertia_about_com().transpose().into(),
        };
        serde::Serialize::serialize(&body, serializer)
    }
}

#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for InertialParameters<f64> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let body = <WrittenBody as serde::Deserialize>::deserialize(deserializer)?;
        let inertia = Matrix3::from(body.inertia_about_com_kg_m2).transpose();
        Self::about_com(body.mass_kg, body.com_m.into(), inertia).validated().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategies::body_d;

    #[test]
    fn golden_inertia_about_com_of_body_d() {
        let golden = Matrix3::new(1.4375, 0.125, 0.2125, 0.125, 1.975, 0.325, 0.2125, 0.325, 2.9375);
        assert!((body_d().inertia_about_com() - golden).amax() < 1e-15);
    }

    #[test]
    fn golden_pseudo_inertia_of_body_d() {
        let p = pseudo_inertia(&body_d());
        let golden =
            Matrix4::new(1.75, -0.1, -0.2, 0.25, -0.1, 1.25, -0.3, 0.5, -0.2, -0.3, 0.25, 0.25, 0.25, 0.5, 0.25, 5.0);
        assert!((p - golden).amax() < 1e-15);
        assert!((p.determinant() - 1.1825).abs() < 1e-11);
        let mut eigenvalues: [f64; 4] = p.symmetric_eigenvalues().into();
        eigenvalues.sort_by(f64::total_cmp);
        let golden = [0.102_070_790_361, 1.280_656_678_201, 1.777_241_986_597, 5.090_030_544_841];
        for (found, expected) in eigenvalues.iter().zip(golden) {
            assert!((found - expected).abs() < 1e-11, "{found} {expected}");
        }
        assert!((from_pseudo_inertia(&p).to_vector() - body_d().to_vector()).amax() < 1e-15);
    }

    #[test]
    fn golden_sphere_that_the_printed_form_rejects() {
        let inertia = Matrix3::<f64>::identity() * (0.4 * 2.0 * 0.01);
        let sphere = InertialParameters::<f64>::about_com(2.0, Vector3::new(0.1, 0.0, 0.0), inertia);
        assert!((pseudo_inertia(&sphere).symmetric_eigenvalues().min() - 3.96e-3).abs() < 1e-5);
        assert!((sphere.consistency_margin() - 1.0 / 3.0).abs() < 1e-14);
        let mut printed = pseudo_inertia(&sphere);
        printed.fixed_view_mut::<3, 3>(0, 0).copy_from(&second_moment(&inertia));
        assert!((printed.symmetric_eigenvalues().min() + 1.58e-2).abs() < 1e-4);
    }

    #[test]
    fn spatial_inertia_gives_the_energy_of_the_moving_points() {
        let points = [(1.0, Vector3::new(0.3, -0.1, 0.2)), (2.5, Vector3::new(-0.4, 0.6, 0.1))];
        let body: InertialParameters<f64> = InertialParameters::from_points(&points);
        let (w, v) = (Vector3::new(0.3, -0.7, 0.4), Vector3::new(1.0, 0.2, -0.3));
        let twist = tumble_lie::Twist::new(w, v).to_vector();
        let energy: f64 = points.iter().map(|(m, x)| 0.5 * m * (v + w.cross(x)).norm_squared()).sum();
        assert!((0.5 * twist.dot(&(body.spatial_inertia() * twist)) - energy).abs() < 1e-14);
    }

    #[test]
    fn what_validation_refuses() {
        let mut body = body_d();
        assert_eq!(body.validated(), Ok(body));
        body.inertia_about_origin.m12 += 1e-3;
        assert!(matches!(body.validated(), Err(DynamicsError::AsymmetricInertia { .. })));
        body = body_d();
        body.inertia_about_origin.m33 = 9.0;
        assert!(matches!(body.validated(), Err(DynamicsError::NotRealizable { margin }) if margin < 0.0));
        body.mass = f64::NAN;
        assert_eq!(body.validated(), Err(DynamicsError::NotFinite));
        body.mass = -5.0;
        assert!(
            matches!(body.validated(), Err(DynamicsError::NotRealizable { margin }) if (margin + 1.0).abs() < 1e-15)
        );
        let moment_without_mass = InertialParameters { mass: 0.0, ..body_d() };
        assert!(!moment_without_mass.is_consistent());
    }

    #[test]
    fn a_body_far_from_its_origin_is_judged_as_near_it() {
        for offset in [0.0, 1.0, 1e3, 1e5] {
            let place = Vector3::new(offset, -2.0 * offset, 0.5 * offset);
            let inertia = Matrix3::from_diagonal(&Vector3::new(1.0, 1.2, 1.5));
            let body = InertialParameters::about_com(2.0, place, inertia);
            let error = (body.consistency_margin() - 0.35 / 1.85).abs();
            assert!(error < 1e-15 * (1.0 + offset) * (1.0 + offset) * 20.0, "{offset} {error}");
        }
    }

    #[cfg(feature = "serde")]
    #[test]
    fn a_body_is_written_about_its_centre_of_mass_and_read_only_if_it_exists() {
        let text = serde_json::to_string(&body_d()).unwrap();
        assert!(text.starts_with(r#"{"mass_kg":5.0,"com_m":[0.05,0.1,0.05],"inertia_about_com_kg_m2":[["#), "{text}");
        let back: InertialParameters<f64> = serde_json::from_str(&text).unwrap();
        assert!((back.to_vector() - body_d().to_vector()).amax() < 1e-15);
        // rows and columns are told apart by the symmetry test
        let read = |text: &str| serde_json::from_str::<InertialParameters<f64>>(text).unwrap_err().to_string();
        let lopsided = r#"{"mass_kg":1,"com_m":[0,0,0],"inertia_about_com_kg_m2":[[1,0.5,0],[0,1,0],[0,0,1]]}"#;
        assert!(read(lopsided).contains("not symmetric"), "{}", read(lopsided));
        let impossible = r#"{"mass_kg":1,"com_m":[0,0,0],"inertia_about_com_kg_m2":[[1,0,0],[0,1,0],[0,0,3]]}"#;
        assert!(read(impossible).contains("no body has these"), "{}", read(impossible));
        assert!(read(r#"{"mass_kg":1,"com":[0,0,0]}"#).contains("unknown field"));
    }
}
