//! Kalman filter over data and unknown inputs at once.

use crate::IdentificationError;
use tumble_lie::nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// A Kalman filter whose state holds, beside the response to the data (column zero), the response to one unit of each
/// unknown input.
///
/// # Shape
/// `N` states, `C` columns: one for the data, `C - 1` unknowns. The state is `columns [1; b]`.
#[derive(Debug, Clone, PartialEq)]
pub struct AugmentedKalmanFilter<const N: usize, const C: usize> {
    columns: SMatrix<f64, N, C>,
    covariance: SMatrix<f64, N, N>,
    evidence: Evidence<C>,
}

/// What measurements say about the unknown inputs; evidence of independent records adds up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence<const C: usize> {
    /// Sum of `E^T V^-1 E`, `E` the innovations of all columns, `V` their covariance.
    squares: SMatrix<f64, C, C>,
    /// Sum of the logarithms of the determinants of `V`.
    log_determinant: f64,
    measurements: usize,
}

/// The unknown inputs at the maximum of the likelihood.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearEstimate {
    /// The unknowns, in the order of the columns.
    pub value: DVector<f64>,
    /// Their covariance, everything else known.
    pub covariance: DMatrix<f64>,
    /// Logarithm of the likelihood with the unknowns integrated out (flat prior).
    pub log_likelihood: f64,
    /// Sum of the squared whitened innovations.
    pub squared_innovations: f64,
    /// Scalar measurements less unknowns: what [`LinearEstimate::squared_innovations`] is on average for true noise
    /// levels.
    pub degrees_of_freedom: usize,
}

impl<const N: usize, const C: usize> AugmentedKalmanFilter<N, C> {
    /// Starts at `initial [1; b]`: an initial state that is itself unknown has unit columns and no covariance.
    pub fn new(initial: SMatrix<f64, N, C>, covariance: SMatrix<f64, N, N>) -> Self {
        Self { columns: initial, covariance, evidence: Evidence::default() }
    }

    /// `x -> F x + U [1; b] + noise`.
    pub fn predict(
        &mut self,
        transition: &SMatrix<f64, N, N>,
        inputs: &SMatrix<f64, N, C>,
        process_covariance: &SMatrix<f64, N, N>,
    ) {
        self.columns = transition * self.columns + inputs;
        self.covariance = transition * self.covariance * transition.transpose() + process_covariance;
    }

    /// A scalar measurement `y = h x + noise`; several independent ones at one time are taken one after the other.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`] where neither the state nor the measurement has an error (component 0).
    pub fn measure(&mut self, row: &SMatrix<f64, 1, N>, value: f64, variance: f64) -> Result<(), IdentificationError> {
        self.measure_through(row, &SMatrix::zeros(), value, variance)
    }

    /// A measurement that the inputs reach directly, `y = h x + d [1; b] + noise`.
    ///
    /// # Errors
    /// As [`AugmentedKalmanFilter::measure`].
    pub fn measure_through(
        &mut self,
        row: &SMatrix<f64, 1, N>,
        direct: &SMatrix<f64, 1, C>,
        value: f64,
        variance: f64,
    ) -> Result<(), IdentificationError> {
        let (innovation, spread) = self.innovation(row, direct, value, variance);
        if !(spread.is_finite() && spread > 0.0) {
            return Err(IdentificationError::NotPositive { index: 0, value: spread });
        }
        self.evidence.squares += innovation.transpose() * innovation / spread;
        self.evidence.log_determinant += spread.ln();
        self.evidence.measurements += 1;
        let gain = self.covariance * row.transpose() / spread;
        self.columns += gain * innovation;
        // Joseph's form: the covariance stays one for measurements that are nearly exact.
        let kept = SMatrix::<f64, N, N>::identity() - gain * row;
        self.covariance = kept * self.covariance * kept.transpose() + gain * gain.transpose() * variance;
        Ok(())
    }

    /// How a measurement differs from what is expected, one column each for the data and for the unknowns, and the
    /// variance; nothing is learned from it.
    pub fn innovation(
        &self,
        row: &SMatrix<f64, 1, N>,
        direct: &SMatrix<f64, 1, C>,
        value: f64,
        variance: f64,
    ) -> (SMatrix<f64, 1, C>, f64) {
        let mut innovation = -(row * self.columns + direct);
        innovation[0] += value;
        (innovation, (row * self.covariance * row.transpose())[0] + variance)
    }

    /// What the measurements so far say.
    pub fn evidence(&self) -> &Evidence<C> {
        &self.evidence
    }

    /// Response of the state to the data (column zero) and to one unit of each unknown.
    pub fn columns(&self) -> &SMatrix<f64, N, C> {
        &self.columns
    }
}

impl<const C: usize> Default for Evidence<C> {
    fn default() -> Self {
        Self { squares: SMatrix::zeros(), log_determinant: 0.0, measurements: 0 }
    }
}

impl<const C: usize> core::ops::AddAssign<&Self> for Evidence<C> {
    fn add_assign(&mut self, other: &Self) {
        self.squares += other.squares;
        self.log_determinant += other.log_determinant;
        self.measurements += other.measurements;
    }
}

impl<const C: usize> Evidence<C> {
    /// Adds what is known of one unknown (from zero) beforehand: a Gaussian.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`] for sigma (component: the unknown), also where there is no such unknown.
    pub fn know(&mut self, unknown: usize, value: f64, sigma: f64) -> Result<(), IdentificationError> {
        if unknown + 1 >= C || !(sigma.is_finite() && sigma > 0.0) {
            return Err(IdentificationError::NotPositive { index: unknown, value: sigma });
        }
        let mut innovation = SMatrix::<f64, 1, C>::zeros();
        innovation[0] = value;
        innovation[unknown + 1] = -1.0;
        self.squares += innovation.transpose() * innovation / (sigma * sigma);
        self.log_determinant += 2.0 * sigma.ln();
        self.measurements += 1;
        Ok(())
    }

    /// The unknowns and the likelihood.
    ///
    /// # Errors
    /// [`IdentificationError::NotExcited`] where the measurements leave a combination of the unknowns open.
    pub fn solve(&self) -> Result<LinearEstimate, IdentificationError> {
        let unknowns = C - 1;
        // Scaled to unit diagonal: units drop out of the rank decision.
        let scale = SVector::<f64, C>::from_fn(|i, _| {
            let square = self.squares[(i, i)];
            if square > 0.0 { 1.0 / square.sqrt() } else { 0.0 }
        });
        let information =
            DMatrix::from_fn(unknowns, unknowns, |i, j| scale[i + 1] * self.squares[(i + 1, j + 1)] * scale[j + 1]);
        let right = DVector::from_fn(unknowns, |i, _| -scale[i + 1] * self.squares[(i + 1, 0)]);
        let eigenvalues = information.symmetric_eigenvalues();
        let least = eigenvalues.iter().fold(f64::INFINITY, |least, value| least.min(*value));
        let refused = IdentificationError::NotExcited {
            rank: eigenvalues.iter().filter(|value| **value > RANK_TOLERANCE).count(),
            expected: unknowns,
            smallest_singular_value: least.max(0.0).sqrt(),
        };
        if !(unknowns == 0 || least > RANK_TOLERANCE) {
            return Err(refused);
        }
        let factor = information.cholesky().ok_or(refused)?;
        let scaled = factor.solve(&right);
        let squared_innovations = (self.squares[(0, 0)] - scaled.dot(&right)).max(0.0);
        let inverse = factor.inverse();
        let log_information: f64 =
            (0..unknowns).map(|i| 2.0 * (factor.l_dirty()[(i, i)].ln() - scale[i + 1].ln())).sum();
        let degrees_of_freedom = self.measurements.saturating_sub(unknowns);
        let constant = degrees_of_freedom as f64 * core::f64::consts::TAU.ln();
        Ok(LinearEstimate {
            value: DVector::from_fn(unknowns, |i, _| scale[i + 1] * scaled[i]),
            covariance: DMatrix::from_fn(unknowns, unknowns, |i, j| scale[i + 1] * inverse[(i, j)] * scale[j + 1]),
            log_likelihood: -0.5 * (constant + self.log_determinant + log_information + squared_innovations),
            squared_innovations,
            degrees_of_freedom,
        })
    }
}

/// Relative eigenvalue of the scaled information below which a combination of unknowns counts as open.
const RANK_TOLERANCE: f64 = 1e-14;
