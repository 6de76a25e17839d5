//! A chart of ten unconstrained numbers in which every point is a body.

use crate::error::DynamicsError;
use crate::inertia::{InertialParameters, inertia_of_second_moment, second_moment};
use crate::parameter_vector::PARAMETERS;
use tumble_lie::Scalar;
use tumble_lie::nalgebra::{ComplexField, Matrix3, SVector, Vector3};

/// Ten unconstrained coordinates of the strictly consistent bodies.
///
/// `m = exp(log_mass)`, `c = center_of_mass`, and the second moment about the centre of mass is `m U U^T` with
/// `U = [[e^a, s_xy, s_xz], [0, e^b, s_yz], [0, 0, e^d]]`, `(a, b, d) = log_extents`. Smooth, one to one, onto.
///
/// ```
/// use tumble_dynamics::{LogCholesky, nalgebra::SVector};
/// let anything = SVector::<f64, 10>::from_fn(|i, _| (i as f64).sin());
/// assert!(LogCholesky::from_vector(&anything).to_parameters().is_strictly_consistent());
/// ```
/// # Frame
/// Body axes.
/// # Units
/// Logarithms of kg and m; `center_of_mass` and `shears` in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogCholesky<T: Scalar> {
    /// Logarithm of the mass in kg.
    pub log_mass: T,
    /// Centre of mass, m.
    pub center_of_mass: Vector3<T>,
    /// Logarithms of the diagonal of `U` in m.
    pub log_extents: Vector3<T>,
    /// Entries of `U` above the diagonal, `(s_xy, s_xz, s_yz)`, m.
    pub shears: Vector3<T>,
}

impl<T: Scalar> LogCholesky<T> {
    /// The body at this point of the chart.
    pub fn to_parameters(&self) -> InertialParameters<T> {
        let (d, s) = (self.log_extents.map(ComplexField::exp), &self.shears);
        let zero = T::zero();
        let u = Matrix3::new(d.x, s.x, s.y, zero, d.y, s.z, zero, zero, d.z);
        let mass = self.log_mass.exp();
        let inertia_about_com = inertia_of_second_moment(&(u * u.transpose() * mass));
        InertialParameters::about_com(mass, self.center_of_mass, inertia_about_com)
    }

    /// `[log_mass, center_of_mass, log_extents, shears]`.
    pub fn to_vector(&self) -> SVector<T, PARAMETERS> {
        let (c, d, s) = (&self.center_of_mass, &self.log_extents, &self.shears);
        SVector::from([self.log_mass, c.x, c.y, c.z, d.x, d.y, d.z, s.x, s.y, s.z])
    }

    /// Inverse of [`LogCholesky::to_vector`].
    pub fn from_vector(v: &SVector<T, PARAMETERS>) -> Self {
        Self {
            log_mass: v[0],
            center_of_mass: Vector3::new(v[1], v[2], v[3]),
            log_extents: Vector3::new(v[4], v[5], v[6]),
            shears: Vector3::new(v[7], v[8], v[9]),
        }
    }
}

impl LogCholesky<f64> {
    /// The point of the chart where this body lies.
    ///
    /// # Errors
    /// [`DynamicsError::NotRealizable`] where the body is not strictly consistent: a plate, a rod, a point lie at
    /// infinity.
    pub fn try_from_parameters(body: &InertialParameters<f64>) -> Result<Self, DynamicsError> {
        let margin = body.consistency_margin();
        let failure = DynamicsError::NotRealizable { margin };
        if margin.is_nan() || margin <= 0.0 {
            return Err(failure);
        }
        let s = second_moment(&body.inertia_about_com()) / body.mass;
        // backward Cholesky factorisation: U from the last row up
        let u33 = ComplexField::sqrt(s.m33);
        let (u13, u23) = (s.m13 / u33, s.m23 / u33);
        let u22 = ComplexField::sqrt(s.m22 - u23 * u23);
        let u12 = (s.m12 - u13 * u23) / u22;
        let u11 = ComplexField::sqrt(s.m11 - u12 * u12 - u13 * u13);
        let log_extents = Vector3::new(u11, u22, u33).map(ComplexField::ln);
        if !log_extents.iter().all(ComplexField::is_finite) {
            return Err(failure);
        }
        Ok(Self {
            log_mass: ComplexField::ln(body.mass),
            center_of_mass: body.center_of_mass(),
            log_extents,
            shears: Vector3::new(u12, u13, u23),
        })
    }
}
