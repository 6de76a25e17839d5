//! Whether a body is identified: by numbers that the judge computes itself.

use super::{EstimatorError, Finding};
use crate::recursive::LinearObservation;
use crate::{BodyScale, FeasibleSet, Observability, PseudoInertiaCone};
use nalgebra::{ComplexField, SVector};

/// What became of an identification.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Verdict {
    /// The numbers may be used.
    Identified,
    /// They exist, and one thing speaks against them.
    Doubtful(Why),
    /// The data leave directions free; displayed, each says so in words.
    NotDetermined {
        /// What is seen and what not.
        seen: Observability,
    },
    /// No body explains the record.
    NoBodyExplains {
        /// Share of the wrench that the best one explains.
        share: f64,
    },
}

/// What speaks against numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Why {
    /// A standard deviation is wide beside the body itself.
    Wide {
        /// Which of the ten.
        parameter: usize,
        /// In units of the body's size.
        relative: f64,
    },
    /// Another way to the same parameters comes to others.
    Disagrees {
        /// Squared distance in joint standard deviations, per parameter.
        chi_square: f64,
    },
    /// It sees all where the second finding leaves directions free: linearised once too boldly, or truly better; nothing confirms it.
    Alone {
        /// Directions that the second finding sees.
        rank: usize,
    },
    /// Its own observations surprised it.
    Surprised {
        /// Mean normalised innovation squared; one where the model holds.
        mean_nis: f64,
    },
    /// They are no body.
    NoBody {
        /// Signed distance from the cone.
        margin: f64,
    },
}

/// Levels of the verdict.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judge {
    /// Size of the body.
    pub scale: BodyScale,
    /// Least share of the wrench that a body must explain.
    pub poor_fit: f64,
    /// Widest standard deviation in units of the body's size.
    pub known: f64,
    /// Largest squared distance per parameter from another finding.
    pub chi_square: f64,
    /// Largest mean of the innovations squared.
    pub mean_nis: f64,
}

/// What a record says of a point, whoever found it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evidence {
    wrench: f64,
    left: f64,
    rows: usize,
}

impl Evidence {
    /// Counts a row; rows are those of the library, the same for every candidate.
    pub fn count(&mut self, row: &LinearObservation<6, 10>, point: &SVector<f64, 10>, length_m: f64) {
        let left = row.output - row.regressor * point;
        for i in 0..6 {
            let unit = if i < 3 { 1.0 / length_m } else { 1.0 };
            self.wrench += row.output[i] * row.output[i] * unit * unit;
            self.left += left[i] * left[i] * unit * unit;
        }
        self.rows += 6;
    }

    /// Share of the wrench's mean square that the point explains; none where there was no wrench.
    pub fn explained(&self) -> Option<f64> {
        (self.wrench > 0.0).then(|| 1.0 - self.left / self.wrench)
    }
}

impl Judge {
    /// The usual levels.
    pub fn new(scale: BodyScale) -> Self {
        Self { scale, poor_fit: 0.5, known: 1.0, chi_square: 4.0, mean_nis: 1.2 }
    }

    fn seen(&self, found: &Finding<10>) -> Result<Observability, EstimatorError> {
        let data = found.signal()?;
        let strongest = Observability::new(&data, self.scale).singular_values()[0];
        let tolerance = if strongest > 0.0 { (1.0 / (self.known * strongest)).min(1.0) } else { 1.0 };
        Ok(Observability::with_tolerance(&data, self.scale, tolerance))
    }

    /// The verdict on a finding, beside evidence of the record and perhaps another finding of the same.
    ///
    /// # Errors
    /// A finding that is none.
    pub fn judge(
        &self,
        found: &Finding<10>,
        evidence: &Evidence,
        other: Option<&Finding<10>>,
    ) -> Result<Verdict, EstimatorError> {
        // In units of one sigma and of the body a direction is seen where its singular value exceeds one; a prior sees nothing.
        let seen = self.seen(found)?;
        let (Some(point), 10) = (found.point(), seen.rank()) else { return Ok(Verdict::NotDetermined { seen }) };
        if let Some(share) = evidence.explained().filter(|share| *share < self.poor_fit) {
            return Ok(Verdict::NoBodyExplains { share });
        }
        let margin = PseudoInertiaCone::new(self.scale).margin(point);
        if margin <= 0.0 {
            return Ok(Verdict::Doubtful(Why::NoBody { margin }));
        }
        let (covariance, sizes) = (found.covariance()?, self.scale.parameter_magnitudes());
        for parameter in 0..10 {
            let relative = ComplexField::sqrt(covariance[(parameter, parameter)]) / sizes[parameter];
            if !(relative < self.known) {
                return Ok(Verdict::Doubtful(Why::Wide { parameter, relative }));
            }
        }
        if let Some(mean_nis) = found.surprise().filter(|mean| *mean > self.mean_nis) {
            return Ok(Verdict::Doubtful(Why::Surprised { mean_nis }));
        }
        let rank = other.map_or(Ok(10), |other| self.seen(other).map(|seen| seen.rank()))?;
        if rank < 10 {
            return Ok(Verdict::Doubtful(Why::Alone { rank }));
        }
        if let Some((other, there)) = other.and_then(|other| Some((other, other.point()?))) {
            let apart = point - there;
            let joint = covariance + other.covariance()?;
            let chi_square = joint.cholesky().map_or(f64::INFINITY, |c| apart.dot(&c.solve(&apart)) / 10.0);
            if chi_square > self.chi_square {
                return Ok(Verdict::Doubtful(Why::Disagrees { chi_square }));
            }
        }
        Ok(Verdict::Identified)
    }
}
