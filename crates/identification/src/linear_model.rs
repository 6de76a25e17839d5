//! Models that are linear in their parameters.

use crate::lie::Scalar;
use nalgebra::{SMatrix, SVector};

/// A measurement equation `regressor(sample) * parameters = output(sample)`.
///
/// [`Rows`](crate::estimator::Rows) makes the observations of any recursive estimator of it.
///
/// Laws: `crate::laws::check_linear_model`. Tutorial: [a regressor of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/tests/suite/custom_regressor.rs).
///
/// # Shape
/// `ROWS` equations for each sample, `PARAMS` unknowns.
///
/// # Example
/// ```
/// use tumble_identification::nalgebra::{SMatrix, SVector, Vector2};
/// use tumble_identification::{LinearModel, SquareRootInformation};
///
/// /// Force = mass * acceleration + friction * speed, on one axis.
/// struct Axis;
/// struct Sample {
///     acceleration_m_s2: f64,
///     speed_m_s: f64,
///     force_n: f64,
/// }
/// impl LinearModel<f64, 1, 2> for Axis {
///     type Sample = Sample;
///     fn regressor(&self, sample: &Sample) -> SMatrix<f64, 1, 2> {
///         SMatrix::from([[sample.acceleration_m_s2], [sample.speed_m_s]])
///     }
///     fn output(&self, sample: &Sample) -> SVector<f64, 1> {
///         SVector::from([sample.force_n])
///     }
/// }
/// let mut information = SquareRootInformation::<2>::new();
/// for (acceleration_m_s2, speed_m_s) in [(1.0, 0.0), (0.5, 1.0), (-1.0, 1.5)] {
///     let sample = Sample { acceleration_m_s2, speed_m_s, force_n: 4.0 * acceleration_m_s2 + 0.2 * speed_m_s };
///     information.update(&Axis.regressor(&sample), &Axis.output(&sample))?;
/// }
/// let found = information.solve(&Vector2::new(1.0, 1.0))?;
/// assert!((found - Vector2::new(4.0, 0.2)).norm() < 1e-12);
/// # Ok::<(), tumble_identification::IdentificationError>(())
/// ```
pub trait LinearModel<T: Scalar, const ROWS: usize, const PARAMS: usize> {
    /// What one evaluation needs.
    type Sample;
    /// The matrix that multiplies the parameters.
    fn regressor(&self, sample: &Self::Sample) -> SMatrix<T, ROWS, PARAMS>;
    /// The measured left side.
    fn output(&self, sample: &Self::Sample) -> SVector<T, ROWS>;
}
