//! Recursive least squares on the square root of the information.

use super::belief::{check_deviations, measured_only, rows_of};
use super::{ChiSquareGate, Innovation, LinearObservation, RowsOutcome, Verdict};
use crate::error::IdentificationError;
use crate::estimator::{EstimatorError, Finding, Outcome, RecursiveEstimator};
use crate::householder::sqrt;
use crate::square_root_information::SquareRootInformation;
use nalgebra::{SMatrix, SVector};

/// Recursive least squares of `P` constant parameters that never forms a covariance: half the digits are lost nowhere, the
/// prior may be as vague as one likes.
///
/// # Source
/// Thesis (5.32)-(5.34), (A.33).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SquareRootFilter<const P: usize, const ROWS: usize> {
    information: SquareRootInformation<P>,
    parameters: SVector<f64, P>,
    gate: Option<ChiSquareGate>,
    prior: SquareRootInformation<P>,
    magnitudes: SVector<f64, P>,
}

impl<const P: usize, const ROWS: usize> SquareRootFilter<P, ROWS> {
    /// Starts from independent knowledge of every parameter, which may be vague; accepts every observation.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`] unless every standard deviation is positive and finite,
    /// [`IdentificationError::NotFinite`].
    pub fn try_new(mean: SVector<f64, P>, standard_deviation: SVector<f64, P>) -> Result<Self, IdentificationError> {
        if let Some(index) = standard_deviation.iter().position(|s| !s.is_finite()) {
            return Err(IdentificationError::NotPositive { index, value: standard_deviation[index] });
        }
        let mut information = SquareRootInformation::new();
        information.add_prior(&mean, &standard_deviation)?;
        Ok(Self { information, parameters: mean, gate: None, prior: information, magnitudes: standard_deviation })
    }

    /// Starts from what is known, whole covariance and all.
    ///
    /// # Errors
    /// [`EstimatorError::Refused`] where directions are free.
    pub fn knowing(known: &Finding<P>) -> Result<Self, EstimatorError> {
        let Some(parameters) = known.point().copied() else {
            return Err(EstimatorError::Refused { what: "a finding without a point", index: 0, value: f64::NAN });
        };
        let (information, magnitudes) = (*known.information(), *known.magnitudes());
        Ok(Self { information, parameters, gate: None, prior: information, magnitudes })
    }

    /// The same behind a gate.
    pub fn with_gate(self, gate: ChiSquareGate) -> Self {
        Self { gate: Some(gate), ..self }
    }

    /// All that is known: the prior and what was accepted.
    pub fn information(&self) -> &SquareRootInformation<P> {
        &self.information
    }
}

impl<const P: usize, const ROWS: usize> SquareRootFilter<P, ROWS> {
    /// Judges the rows and, unless they are rejected, learns from them.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`], [`IdentificationError::NotFinite`]; nothing is changed then.
    #[inline]
    pub fn update_rows(
        &mut self,
        observation: &LinearObservation<ROWS, P>,
    ) -> Result<RowsOutcome<ROWS>, IdentificationError> {
        let LinearObservation { regressor, output, standard_deviation } = observation;
        check_deviations(standard_deviation)?;
        let residual = output - regressor * self.parameters;
        let weight = standard_deviation.map(|s| 1.0 / s);
        let block = SMatrix::from_fn(|i, j| if weight[i] > 0.0 { weight[i] * regressor[(i, j)] } else { 0.0 });
        let rhs = SVector::from_fn(|i, _| if weight[i] > 0.0 { weight[i] * output[i] } else { 0.0 });
        let mut learned = self.information;
        learned.update(&block, &rhs)?;
        let innovation = self.innovation(&learned, &block, &residual, standard_deviation);
        let verdict = self
            .gate
            .as_mut()
            .map_or(Verdict::Accepted, |gate| gate.judge(innovation.nis, innovation.degrees_of_freedom));
        match verdict {
            Verdict::Accepted => self.information = learned,
            Verdict::Rejected { .. } => return Ok(RowsOutcome { innovation, verdict }),
            Verdict::Recovered { inflation } => {
                self.information.scale(1.0 / sqrt(inflation));
                self.information.update(&block, &rhs)?;
            }
        }
        self.parameters = SVector::from(self.information.back_substitute(self.information.rhs));
        Ok(RowsOutcome { innovation, verdict })
    }

    /// The present estimate.
    pub fn parameters(&self) -> SVector<f64, P> {
        self.parameters
    }

    /// Its covariance.
    pub fn covariance(&self) -> SMatrix<f64, P, P> {
        let inverse = self.information.inverse_factor();
        inverse * inverse.transpose()
    }
}

impl<const P: usize, const ROWS: usize> RecursiveEstimator<P> for SquareRootFilter<P, ROWS> {
    type Observation = LinearObservation<ROWS, P>;

    #[inline]
    fn update(&mut self, observation: &Self::Observation) -> Result<Outcome, EstimatorError> {
        Ok(self.update_rows(observation)?.into())
    }

    fn finding(&self) -> Result<Finding<P>, EstimatorError> {
        let found = Finding::of_information(self.information, self.magnitudes);
        Ok(found.at(self.parameters).with_prior(self.prior))
    }
}

impl<const P: usize, const ROWS: usize> SquareRootFilter<P, ROWS> {
    /// Of a whitened block; `learned` is the information with the block in it.
    fn innovation(
        &self,
        learned: &SquareRootInformation<P>,
        block: &SMatrix<f64, ROWS, P>,
        residual: &SVector<f64, ROWS>,
        standard_deviation: &SVector<f64, ROWS>,
    ) -> Innovation<ROWS> {
        // S = I + (R⁻ᵀ Hᵀ)ᵀ (R⁻ᵀ Hᵀ) in units of the noise; det S is the ratio of the information's determinants.
        let images = rows_of(block).map(|row| self.information.back_substitute_transposed(row));
        let covariance = SMatrix::from_fn(|i, j| {
            if standard_deviation[i] == f64::INFINITY || standard_deviation[j] == f64::INFINITY {
                return if i == j { f64::INFINITY } else { 0.0 };
            }
            let shared: f64 = images[i].iter().zip(&images[j]).map(|(a, b)| a * b).sum();
            standard_deviation[i] * standard_deviation[j] * if i == j { 1.0 + shared } else { shared }
        });
        let mut determinant = 1.0;
        for i in 0..P {
            let growth = learned.factor_rows[i][i] / self.information.factor_rows[i][i];
            determinant *= growth * growth;
        }
        let mut degrees_of_freedom = 0;
        for deviation in standard_deviation.iter().filter(|s| s.is_finite()) {
            determinant *= deviation * deviation;
            degrees_of_freedom += 1;
        }
        Innovation {
            residual: measured_only(residual, standard_deviation),
            covariance,
            // What the observation adds to the sum of squares at the optimum is residualᵀ S⁻¹ residual.
            nis: learned.residual_sum_of_squares() - self.information.residual_sum_of_squares(),
            degrees_of_freedom,
            determinant,
        }
    }
}
