//! Whether what is learned of the body keeps pulling it to one side.

use super::settings::grasp_or_release;
use crate::error::IdentificationError;
use crate::recursive::ChiSquareGate;
use nalgebra::{Cholesky, ComplexField, Const, SMatrix, SVector};

type Vector = SVector<f64, 10>;
type Matrix = SMatrix<f64, 10, 10>;

/// Corrections are summed over so long, s, during which the body's covariance hardly changes.
const BLOCK_S: f64 = 0.5;
/// For how long corrections are remembered, s: the time constant of an exponential.
const MEMORY_S: f64 = 30.0;
/// Of a direction that the remembered time shows less than this share of what is known, next to nothing is said.
const LEAST_SHARE: f64 = 1e-3;
/// Probability with which a body that has not changed passes at one moment: as one that is known as well as believed, and as the same one.
const PASSES: [f64; 2] = [0.9999, 0.999_999];
/// Twice within so long, s, it is another one as well.
const AGAIN_S: f64 = 30.0;

/// The score of the body: the gradient of the log likelihood of what was measured lately, at the body that is believed.
///
/// Innovations of a filter whose body is right are white, so that its corrections of the body are independent, and the variance of each is
/// what it takes off the body's covariance. A body that is no longer what was learned is corrected to the same side by all of them, each
/// time by too little. No single innovation need be unlikely then, nor their mean other than zero: the wrench changes its sign.
///
/// # Source
/// Rao's score test with the information of the innovations, forgotten exponentially; the mean of the corrections of a Kalman filter as
/// evidence of a jump: Willsky and Jones (1976).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BodyScore {
    /// Sum of the corrections of a block, and of what they took off the covariance.
    moved: Vector,
    learned: Matrix,
    block_s: f64,
    /// For how long a body that lies elsewhere is another one, s.
    suspect_s: f64,
    gradient: Vector,
    /// Variance of the gradient.
    information: Matrix,
}

/// Levels of the square of a normalised score, by its degrees of freedom.
#[derive(Clone, Debug)]
pub(super) struct ScoreLimits([[f64; 11]; 2]);

impl ScoreLimits {
    pub(super) fn try_new() -> Result<Self, IdentificationError> {
        let mut limits = [[0.0; 11]; 2];
        for (limits, probability) in limits.iter_mut().zip(PASSES) {
            let gate = ChiSquareGate::try_new(probability)?;
            *limits = core::array::from_fn(|freedom| gate.threshold(freedom));
        }
        Ok(Self(limits))
    }

    /// Between whole numbers of degrees of freedom, linearly.
    fn at(&self, freedom: f64) -> [f64; 2] {
        let freedom = freedom.clamp(1.0, 10.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // one to ten
        let below = freedom as usize;
        let part = freedom - below as f64;
        self.0.map(|limits| limits[below] + part * (limits[(below + 1).min(10)] - limits[below]))
    }
}

/// A body that seems to lie elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Elsewhere {
    /// What is to be added to its covariance: nowhere more than by a grasp.
    pub(super) more: Matrix,
    /// It is another one than was learned.
    pub(super) is_another: bool,
}

impl BodyScore {
    pub(super) fn new() -> Self {
        let (none, nothing) = (Vector::zeros(), Matrix::zeros());
        Self { moved: none, learned: nothing, block_s: 0.0, suspect_s: 0.0, gradient: none, information: nothing }
    }

    /// Counts a correction, by the body's covariance before and after it.
    pub(super) fn count(&mut self, step: &Vector, before: &Matrix, after: &Matrix) {
        self.moved += step;
        self.learned += before - after;
    }

    /// Time passes; whether a block has ended.
    pub(super) fn is_due(&mut self, dt_s: f64) -> bool {
        self.block_s += dt_s.max(0.0);
        self.block_s >= BLOCK_S
    }

    /// At the end of a block, of a body with this covariance. Once it lies elsewhere, and is less certain, the score begins anew.
    pub(super) fn judge(&mut self, limits: &ScoreLimits, covariance: &Matrix) -> Option<Elsewhere> {
        self.suspect_s -= self.block_s;
        let block = core::mem::replace(self, Self { suspect_s: self.suspect_s, ..Self::new() });
        let root = Cholesky::<f64, Const<10>>::new(covariance + block.learned)?;
        let keep = ComplexField::exp(-block.block_s / MEMORY_S);
        let half = root.solve(&block.learned);
        let gradient = block.gradient * keep + root.solve(&block.moved);
        let information = block.information * (keep * keep) + root.solve(&half.transpose());
        // In units of what is known, so that all ten directions are alike.
        let scale = root.l();
        let mut shares = scale.tr_mul(&information) * scale;
        for i in 0..10 {
            shares[(i, i)] += LEAST_SHARE;
        }
        let shares = Cholesky::<f64, Const<10>>::new(shares)?;
        let freedom = 10.0 - LEAST_SHARE * shares.inverse().trace();
        let score = scale.tr_mul(&gradient);
        let away = shares.solve(&score);
        let square = away.dot(&score);
        let [elsewhere, another] = limits.at(freedom);
        if square <= elsewhere {
            (self.gradient, self.information) = (gradient, information);
            return None;
        }
        let is_another = square > another || self.suspect_s > 0.0;
        self.suspect_s = AGAIN_S;
        // By as much as it seems to be away in that direction, and by as much in the mean of all: where to is told but roughly.
        let seems = scale * away;
        let more = seems * seems.transpose() + covariance * (away.norm_squared() / freedom);
        let jump = grasp_or_release();
        let part = (0..10).map(|i| jump[i] * jump[i] / more[(i, i)]).fold(1.0, f64::min);
        Some(Elsewhere { more: more * part, is_another })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Gaussian;

    /// Measurements that show ten numbers, each time along another direction of the first `shown`, filtered for two minutes; after one of
    /// them the numbers are others, by so many standard deviations in some direction. When the score said so, s, and whether they are
    /// others altogether.
    fn said(seed: u64, shown: usize, jump: f64) -> Vec<(f64, bool)> {
        const STEP_S: f64 = 0.032;
        let (mut dice, limits) = (Gaussian::from_seed(seed), ScoreLimits::try_new().unwrap());
        let mut covariance = Matrix::identity();
        let mut truth = Vector::from_fn(|_, _| dice.normal());
        let (mut believed, mut score, mut said) = (Vector::zeros(), BodyScore::new(), vec![]);
        for k in 0..3750 {
            if k == 1875 {
                let towards = Vector::from_fn(|i, _| if i < shown { dice.normal() } else { 0.0 }).normalize();
                truth += Vector::from_fn(|i, _| jump * towards[i] * f64::sqrt(covariance[(i, i)]));
            }
            let along = Vector::from_fn(|i, _| if i < shown { dice.normal() } else { 0.0 });
            let gain = covariance * along / (along.dot(&(covariance * along)) + 4.0);
            let step = gain * ((truth - believed).dot(&along) + 2.0 * dice.normal());
            let after = covariance - gain * (covariance * along).transpose();
            score.count(&step, &covariance, &after);
            (believed, covariance) = (believed + step, after);
            if score.is_due(STEP_S)
                && let Some(Elsewhere { more, is_another }) = score.judge(&limits, &covariance)
            {
                covariance += more;
                said.push((STEP_S * f64::from(k), is_another));
            }
        }
        said
    }

    #[test]
    fn numbers_that_stay_are_not_suspected() {
        // Twenty and more independent looks each, one in ten thousand too many: one or two in all.
        for shown in [10, 4] {
            let suspected: Vec<_> =
                (0..300).map(|seed| said(seed, shown, 0.0)).filter(|said| !said.is_empty()).collect();
            assert!(suspected.len() <= 4, "{shown}: {suspected:?}");
        }
    }

    #[test]
    fn numbers_that_jump_are_suspected_soon_although_no_measurement_is_unlikely() {
        let after = |said: &[(f64, bool)], must_be_others: bool| {
            said.iter().any(|(at_s, is_another)| (60.0..90.0).contains(at_s) && (*is_another || !must_be_others))
        };
        for shown in [10, 4] {
            let flights: Vec<_> = (0..100).map(|seed| said(seed, shown, 14.0)).collect();
            assert!(flights.iter().filter(|said| after(said, false)).count() >= 95, "{shown}");
            // Farther off, they are not less certain but others.
            let others = (0..100).filter(|seed| after(&said(*seed, shown, 60.0), true)).count();
            assert!(others >= 95, "{shown}: {others}");
        }
    }
}
