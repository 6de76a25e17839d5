//! The four-parameter linear model of chapter 6: accelerations from the inverses of mass and principal moments.

use crate::lie::{Scalar, Wrench};
use crate::linear_model::LinearModel;
use nalgebra::{SMatrix, SVector, Vector6};

/// One instant: wrench and accelerations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseInertiaSample<T: Scalar> {
    /// Wrench about the centre of mass, body axes.
    pub wrench: Wrench<T>,
    /// `[angular; linear]` acceleration, body axes, of the centre of mass.
    pub acceleration: Vector6<T>,
}

/// `[angular; linear acceleration] = regressor(wrench) * [1/m, 1/Ixx, 1/Iyy, 1/Izz]`.
///
/// Neglects the gyroscopic torque, the offset of the centre of mass and the products of inertia: fit for a slow body described
/// about its centre of mass in its principal axes. [`PrincipalBody`](super::PrincipalBody) keeps the gyroscopic torque.
/// The inverse of a noisy estimate is biased upwards by its relative variance; to first order σ(m) = m² σ(1/m).
///
/// # Shape
/// 6x4, rows `[angular; linear]`.
/// # Frame
/// Principal body axes, about the centre of mass.
/// # Source
/// Thesis (6.23)-(6.25).
/// # Deviation
/// The print puts the linear rows first.
#[derive(Clone, Copy, Debug, Default)]
pub struct InverseInertia;

impl<T: Scalar> LinearModel<T, 6, 4> for InverseInertia {
    type Sample = InverseInertiaSample<T>;

    fn regressor(&self, sample: &Self::Sample) -> SMatrix<T, 6, 4> {
        let (t, f, o) = (&sample.wrench.torque, &sample.wrench.force, T::zero());
        SMatrix::from([[o, o, o, f.x, f.y, f.z], [t.x, o, o, o, o, o], [o, t.y, o, o, o, o], [o, o, t.z, o, o, o]])
    }

    fn output(&self, sample: &Self::Sample) -> SVector<T, 6> {
        sample.acceleration
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recursive::{ChiSquareGate, LinearObservation, RecursiveLeastSquares, Verdict};
    use nalgebra::{Vector3, Vector4};

    /// Linear rows first in the reference, as printed; last here.
    fn golden() -> (RecursiveLeastSquares<4, 6>, LinearObservation<6, 4>) {
        let sample = InverseInertiaSample {
            wrench: Wrench::new(Vector3::new(0.02, -0.01, 0.03), Vector3::new(0.1, -0.05, 0.08)),
            acceleration: Vector6::new(0.131, -0.069, 0.185, 0.0105, -0.0052, 0.0083),
        };
        let observation = LinearObservation {
            regressor: InverseInertia.regressor(&sample),
            output: InverseInertia.output(&sample),
            standard_deviation: Vector6::new(0.02, 0.02, 0.02, 0.01, 0.01, 0.01),
        };
        let covariance = SMatrix::from_diagonal(&Vector4::new(0.01, 4.0, 4.0, 4.0));
        (RecursiveLeastSquares::new(Vector4::new(0.08, 5.0, 5.0, 5.0), covariance), observation)
    }

    #[test]
    fn golden_update_of_section_f() {
        let (mut estimator, observation) = golden();
        let outcome = estimator.update_rows(&observation).unwrap();
        assert!((outcome.innovation.nis - 1.277_143_944_636_678_4).abs() < 1e-13);
        assert_eq!((outcome.innovation.degrees_of_freedom, outcome.verdict), (6, Verdict::Accepted));
        let expected = Vector4::new(0.095_986_159_169_550_2, 6.24, 5.95, 6.05);
        assert!((estimator.parameters() - expected).amax() < 1e-13);
        let expected = Vector4::new(0.003_460_207_612_456_75, 0.8, 2.0, 0.4);
        assert!((estimator.covariance().diagonal() - expected).amax() < 1e-14);
        // E[g gᵀ] = H P Hᵀ + R, the first force row: 0.1² 0.01 + 1e-4.
        assert!((outcome.innovation.covariance[(3, 3)] - 2e-4).abs() < 1e-17);
        let density = outcome.innovation.covariance.determinant();
        assert!((outcome.innovation.determinant - density).abs() < 1e-12 * density);
    }

    #[test]
    fn a_rejected_update_changes_nothing() {
        let (estimator, mut observation) = golden();
        let mut gated = estimator.with_gate(ChiSquareGate::try_new(0.99).unwrap());
        observation.output[4] += 1.0;
        let outcome = gated.update_rows(&observation).unwrap();
        assert_eq!(
            outcome.verdict,
            Verdict::Rejected { threshold: ChiSquareGate::try_new(0.99).unwrap().threshold(6) }
        );
        assert_eq!((gated.parameters(), gated.covariance()), (estimator.parameters(), estimator.covariance()));
    }

    #[test]
    fn printed_gain_of_the_appendix_diverges() {
        let (mut estimator, observation) = golden();
        let h = observation.regressor;
        let r = SMatrix::<f64, 6, 6>::from_diagonal(&observation.standard_deviation.map(|s| s * s));
        let (mut printed, mut p) = (estimator.parameters(), estimator.covariance());
        for _ in 0..30 {
            estimator.update_rows(&observation).unwrap();
            // (A.36) solved for the P of (A.35), K with the weight instead of its inverse.
            let s = (h * p * h.transpose() + r.try_inverse().unwrap()).try_inverse().unwrap();
            let next = p - p * h.transpose() * s * h * p;
            let k = next * h.transpose() * (h * p * h.transpose() + r.try_inverse().unwrap());
            (printed, p) = (printed + k * (observation.output - h * printed), next);
        }
        let information = h.transpose() * r.try_inverse().unwrap() * h;
        let best = information.try_inverse().unwrap() * h.transpose() * r.try_inverse().unwrap() * observation.output;
        assert!((estimator.parameters() - best).component_div(&best).amax() < 0.05);
        assert!(printed.amax() > 1e6, "{printed}");
    }
}
