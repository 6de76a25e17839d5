//! The set of physically consistent bodies as a linear matrix inequality.

use super::{Barrier, FeasibleSet};
use crate::body_scale::BodyScale;
use crate::jacobi::symmetric_eigenvalues;
use nalgebra::{Matrix4, SMatrix, SVector};

/// Relative floor of the pseudo-inertia when none is asked for.
pub(crate) const DEFAULT_RELATIVE_FLOOR: f64 = 1e-6;

/// Bodies whose pseudo-inertia P(p) = [½ tr(J) I − J, h; hᵀ, m] exceeds a floor: P(p) ≥ floor.
///
/// P(p) > 0 holds exactly for bodies made of mass: m > 0 and the triangle inequalities on the principal inertias about
/// the centre of mass. The floor keeps estimates strictly consistent.
///
/// # Shape
/// Parameters in Newton-Euler order `[m, hx, hy, hz, J11, J12, J13, J22, J23, J33]`, J about the body origin.
///
/// # Source
/// Thesis (5.35)-(5.38).
///
/// # Deviation
/// (5.38) prints the inertia about the centre of mass inside Σ; beside the first moment it must be the inertia about the
/// same point, the origin (test `accepts_the_sphere_that_the_printed_form_rejects`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PseudoInertiaCone {
    scale: BodyScale,
    /// Diagonal of the floor: three entries kg m², one kg.
    floor: [f64; 4],
}

impl PseudoInertiaCone {
    /// Bodies of about this size, P(p) ≥ 1e-6 · diag(mℓ², mℓ², mℓ², m).
    pub fn new(scale: BodyScale) -> Self {
        Self::with_relative_floor(scale, DEFAULT_RELATIVE_FLOOR)
    }

    /// P(p) ≥ fraction · diag(mℓ², mℓ², mℓ², m): the same fraction in every system of units. Zero gives the closed cone.
    pub fn with_relative_floor(scale: BodyScale, fraction: f64) -> Self {
        let mass = fraction * scale.mass_kg();
        let moment = mass * scale.length_m() * scale.length_m();
        Self { scale, floor: [moment, moment, moment, mass] }
    }

    /// P(p) ≥ ε I with ε in SI units (kg m² and kg alike), as the thesis and its peers ask for.
    pub fn with_absolute_floor(scale: BodyScale, epsilon: f64) -> Self {
        Self { scale, floor: [epsilon; 4] }
    }

    /// Characteristic size that margins and starting points are relative to.
    pub fn scale(&self) -> BodyScale {
        self.scale
    }

    /// P(p), rows `[x, y, z, 1]`.
    pub fn pseudo_inertia(p: &SVector<f64, 10>) -> Matrix4<f64> {
        let half_trace = 0.5 * (p[4] + p[7] + p[9]);
        Matrix4::new(
            half_trace - p[4],
            -p[5],
            -p[6],
            p[1],
            -p[5],
            half_trace - p[7],
            -p[8],
            p[2],
            -p[6],
            -p[8],
            half_trace - p[9],
            p[3],
            p[1],
            p[2],
            p[3],
            p[0],
        )
    }

    /// Parameters of a symmetric pseudo-inertia; inverse of [`pseudo_inertia`](Self::pseudo_inertia).
    pub fn parameters(matrix: &Matrix4<f64>) -> SVector<f64, 10> {
        let p = matrix;
        SVector::from([
            p[(3, 3)],
            p[(0, 3)],
            p[(1, 3)],
            p[(2, 3)],
            p[(1, 1)] + p[(2, 2)],
            -p[(0, 1)],
            -p[(0, 2)],
            p[(0, 0)] + p[(2, 2)],
            -p[(1, 2)],
            p[(0, 0)] + p[(1, 1)],
        ])
    }

    /// Parameters on the floor itself.
    pub(crate) fn floor_parameters(&self) -> SVector<f64, 10> {
        Self::parameters(&Matrix4::from_diagonal(&self.floor.into()))
    }

    /// D⁻¹ (P(p) − floor) D⁻¹ with D = diag(ℓ√m, ℓ√m, ℓ√m, √m): free of units.
    pub(crate) fn normalized(&self, parameters: &SVector<f64, 10>) -> Matrix4<f64> {
        let (m, l) = (self.scale.mass_kg(), self.scale.length_m());
        let mut matrix = Self::pseudo_inertia(parameters);
        for i in 0..4 {
            matrix[(i, i)] -= self.floor[i];
            for j in 0..4 {
                let size = m * if i < 3 { l } else { 1.0 } * if j < 3 { l } else { 1.0 };
                matrix[(i, j)] /= size;
            }
        }
        matrix
    }
}

impl FeasibleSet<10> for PseudoInertiaCone {
    /// Smallest eigenvalue of D⁻¹ (P(p) − floor) D⁻¹.
    fn margin(&self, parameters: &SVector<f64, 10>) -> f64 {
        symmetric_eigenvalues(self.normalized(parameters)).min()
    }

    /// −log det of D⁻¹ (P(p) − floor) D⁻¹.
    fn barrier(&self, parameters: &SVector<f64, 10>) -> Option<Barrier<10>> {
        let cholesky = self.normalized(parameters).cholesky()?;
        let inverse = cholesky.inverse();
        let lower = cholesky.l_dirty();
        let value = -2.0 * (0..4).map(|i| nalgebra::ComplexField::ln(lower[(i, i)])).sum::<f64>();
        // inverse · ∂P/∂p_k, whose traces are the derivatives.
        let unfloored = Self { floor: [0.0; 4], ..*self };
        let directions: [Matrix4<f64>; 10] = core::array::from_fn(|k| {
            let mut unit = SVector::<f64, 10>::zeros();
            unit[k] = 1.0;
            inverse * unfloored.normalized(&unit)
        });
        let gradient = SVector::from_fn(|k, _| -directions[k].trace());
        let hessian = SMatrix::from_fn(|k, l| directions[k].component_mul(&directions[l].transpose()).sum());
        Some(Barrier { value, gradient, hessian })
    }

    fn barrier_parameter(&self) -> f64 {
        4.0
    }

    /// The floor plus a uniform ball of the characteristic mass and radius of gyration.
    fn interior_point(&self) -> SVector<f64, 10> {
        let (m, l) = (self.scale.mass_kg(), self.scale.length_m());
        let moment = m * l * l / 3.0;
        self.floor_parameters() + Self::parameters(&Matrix4::from_diagonal(&[moment, moment, moment, m].into()))
    }

    fn magnitudes(&self) -> SVector<f64, 10> {
        self.scale.parameter_magnitudes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::strategies::body_d;

    #[test]
    fn golden_pseudo_inertia_of_body_d() {
        let expected =
            Matrix4::new(1.75, -0.1, -0.2, 0.25, -0.1, 1.25, -0.3, 0.5, -0.2, -0.3, 0.25, 0.25, 0.25, 0.5, 0.25, 5.0);
        let p = PseudoInertiaCone::pseudo_inertia(&body_d().to_vector());
        assert!((p - expected).amax() < 1e-15);
        assert!((PseudoInertiaCone::parameters(&p) - body_d().to_vector()).amax() < 1e-15);
        assert!((p.determinant() - 1.1825).abs() < 1e-11);
        let mut eigenvalues = p.symmetric_eigenvalues();
        eigenvalues.as_mut_slice().sort_by(f64::total_cmp);
        let golden = [0.102_070_790_361, 1.280_656_678_201, 1.777_241_986_597, 5.090_030_544_841];
        for (value, golden) in eigenvalues.iter().zip(golden) {
            assert!((value - golden).abs() < 1e-11, "{value} {golden}");
        }
    }

    #[test]
    fn accepts_the_sphere_that_the_printed_form_rejects() {
        let (m, r, c) = (2.0, 0.1, 0.1);
        let j = 0.4 * m * r * r;
        let sphere = SVector::from([m, m * c, 0.0, 0.0, j, 0.0, 0.0, j + m * c * c, 0.0, j + m * c * c]);
        let smallest = |p: &SVector<f64, 10>| PseudoInertiaCone::pseudo_inertia(p).symmetric_eigenvalues().min();
        assert!((smallest(&sphere) - 3.96e-3).abs() < 5e-6, "{}", smallest(&sphere));
        let printed = SVector::from([m, m * c, 0.0, 0.0, j, 0.0, 0.0, j, 0.0, j]);
        assert!((smallest(&printed) + 1.58e-2).abs() < 5e-5, "{}", smallest(&printed));
    }

    #[test]
    fn floors_are_what_they_say() {
        let scale = BodyScale::try_new(4.0, 0.5).unwrap();
        let relative = PseudoInertiaCone::with_relative_floor(scale, 1e-3);
        let absolute = PseudoInertiaCone::with_absolute_floor(scale, 1e-3);
        let at = |floor: [f64; 4]| PseudoInertiaCone::parameters(&Matrix4::from_diagonal(&floor.into()));
        assert!(relative.margin(&at([1e-3, 1e-3, 1e-3, 4e-3])).abs() < 1e-15);
        assert!(absolute.margin(&at([1e-3; 4])).abs() < 1e-15);
    }
}
