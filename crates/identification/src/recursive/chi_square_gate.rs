//! Rejection of observations that the present estimate makes too unlikely, and the way back when the estimate is wrong.

use super::Verdict;
use crate::error::IdentificationError;
use nalgebra::{ComplexField, RealField};

/// Thresholds kept for this many degrees of freedom; more are computed when needed.
const TABLE: usize = 18;
/// Rejections in a row after which the estimate is doubted.
const DEFAULT_PATIENCE: u32 = 5;

/// Accepts an observation when its normalised innovation squared stays below a chi-square quantile.
///
/// # Recovery
/// An estimate that is surer than it should be rejects everything and never learns otherwise. After `patience` rejections
/// in a row (five unless [`with_patience`](Self::with_patience) says else; by chance once in 10¹⁰ at 0.99) the next
/// unlikely observation is therefore accepted, after the covariance of the estimate has been multiplied by
/// nis / degrees of freedom. Repeated as often as needed, it opens the estimate geometrically.
///
/// # Source
/// Thesis (6.31).
///
/// # Deviation
/// The text skips (6.26) and (6.27) on rejection; the covariance update (6.28) is skipped too, and a recovery rule is added
/// (tests `a_rejected_update_changes_nothing`, `the_gate_lets_go_of_a_wrong_belief`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChiSquareGate {
    probability: f64,
    thresholds: [f64; TABLE],
    patience: u32,
    rejections_in_a_row: u32,
}

impl ChiSquareGate {
    /// Gate that accepts good observations with this probability, 0.99 say.
    ///
    /// # Errors
    /// [`IdentificationError::NotAProbability`] unless strictly between zero and one.
    pub fn try_new(probability: f64) -> Result<Self, IdentificationError> {
        if !(probability > 0.0 && probability < 1.0) {
            return Err(IdentificationError::NotAProbability { value: probability });
        }
        let thresholds = core::array::from_fn(|i| chi_square_quantile(probability, i + 1));
        Ok(Self { probability, thresholds, patience: DEFAULT_PATIENCE, rejections_in_a_row: 0 })
    }

    /// The same gate with another number of rejections in a row before the estimate is doubted.
    pub fn with_patience(self, patience: u32) -> Self {
        Self { patience, ..self }
    }

    /// The largest normalised innovation squared that is accepted.
    pub fn threshold(&self, degrees_of_freedom: usize) -> f64 {
        let known = degrees_of_freedom.checked_sub(1).map(|index| self.thresholds.get(index).copied());
        match known {
            None => f64::INFINITY,
            Some(known) => known.unwrap_or_else(|| chi_square_quantile(self.probability, degrees_of_freedom)),
        }
    }

    /// The verdict on one observation, which counts towards the next.
    pub fn judge(&mut self, nis: f64, degrees_of_freedom: usize) -> Verdict {
        let threshold = self.threshold(degrees_of_freedom);
        if nis <= threshold {
            self.rejections_in_a_row = 0;
            Verdict::Accepted
        } else if self.rejections_in_a_row < self.patience {
            self.rejections_in_a_row += 1;
            Verdict::Rejected { threshold }
        } else {
            self.rejections_in_a_row = 0;
            Verdict::Recovered { inflation: nis / degrees_of_freedom as f64 }
        }
    }
}

/// The number that a chi-square variable exceeds with probability `1 - probability`; zero for no degrees of freedom.
///
/// To about twelve digits for probabilities from 1e-9 to 1 - 1e-9.
fn chi_square_quantile(probability: f64, degrees_of_freedom: usize) -> f64 {
    let freedom = degrees_of_freedom as f64;
    if degrees_of_freedom == 0 {
        return 0.0;
    }
    let (mut low, mut high) = (0.0, freedom);
    while distribution(high, freedom) < probability && high < 1e4 * freedom {
        (low, high) = (high, 2.0 * high);
    }
    // Halving only: a hundred terms a step, done once, and nothing that can go astray.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if distribution(middle, freedom) < probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Probability that a chi-square variable stays below `x`: the series of the incomplete gamma function, all terms positive.
fn distribution(x: f64, freedom: f64) -> f64 {
    let (a, half) = (0.5 * freedom, 0.5 * x);
    if half <= 0.0 {
        return 0.0;
    }
    // half^a exp(-half) / Γ(a + 1), by logarithms; Γ from Γ(1/2) or Γ(1) up.
    let mut log_gamma = if freedom % 2.0 == 0.0 { 0.0 } else { 0.5 * ComplexField::ln(f64::pi()) };
    let mut factor = if freedom % 2.0 == 0.0 { 1.0 } else { 0.5 };
    while factor <= a {
        log_gamma += ComplexField::ln(factor);
        factor += 1.0;
    }
    let (mut term, mut sum, mut n) = (1.0, 1.0, 1.0);
    while term > 1e-17 * sum {
        term *= half / (a + n);
        sum += term;
        n += 1.0;
    }
    ComplexField::exp(a * ComplexField::ln(half) - half - log_gamma) * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn golden_quantiles_of_section_f() {
        let golden = [
            6.634_896_601_021,
            9.210_340_371_976,
            11.344_866_730_144,
            13.276_704_135_988,
            15.086_272_469_389,
            16.811_893_829_771,
        ];
        let gate = ChiSquareGate::try_new(0.99).unwrap();
        for (i, expected) in golden.iter().enumerate() {
            assert!((gate.threshold(i + 1) - expected).abs() < 1e-11, "{} {expected}", gate.threshold(i + 1));
        }
    }

    #[test]
    fn quantiles_of_two_degrees_of_freedom_are_logarithms() {
        for probability in [1e-6, 0.1, 0.5, 0.9, 0.999_999] {
            let expected = -2.0 * (1.0_f64 - probability).ln();
            assert!((chi_square_quantile(probability, 2) - expected).abs() < 1e-9 * expected);
        }
        // Beyond the table too, and the median near the mean less two thirds.
        let gate = ChiSquareGate::try_new(0.5).unwrap();
        assert!((gate.threshold(100) - 99.334_129_2).abs() < 1e-6, "{}", gate.threshold(100));
        assert!(gate.threshold(0).is_infinite());
    }

    #[test]
    fn only_probabilities_are_probabilities() {
        for value in [0.0, 1.0, -0.1, f64::NAN] {
            assert!(matches!(ChiSquareGate::try_new(value), Err(IdentificationError::NotAProbability { .. })));
        }
    }

    #[test]
    fn patience_ends() {
        let mut gate = ChiSquareGate::try_new(0.99).unwrap().with_patience(2);
        let threshold = gate.threshold(6);
        assert_eq!(gate.judge(1e3, 6), Verdict::Rejected { threshold });
        assert_eq!(gate.judge(6.0, 6), Verdict::Accepted);
        for _ in 0..2 {
            assert_eq!(gate.judge(1e3, 6), Verdict::Rejected { threshold });
        }
        assert_eq!(gate.judge(1.2e3, 6), Verdict::Recovered { inflation: 200.0 });
        assert_eq!(gate.judge(1e3, 6), Verdict::Rejected { threshold });
    }
}
