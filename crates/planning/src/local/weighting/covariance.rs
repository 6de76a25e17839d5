//! Weights that follow the belief: thesis Algorithm 1.

use super::{InformationWeighting, WeightingContext, base_weights};
use crate::error::{PlanningError, finite, positive};

/// What happens to a weight at the variance that switches it off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum ShutOff {
    /// `gamma0 exp(-beta v_n / v)` falls from `gamma0 exp(-beta / alpha)` to zero at once: Algorithm 1 as printed.
    #[default]
    Jump,
    /// Lowered and stretched to reach zero there without a jump:
    /// `gamma0 (exp(-beta v_n / v) - exp(-beta / alpha)) / (1 - exp(-beta / alpha))`. Both tend to `gamma0`.
    Continuous,
}

/// Keeps a weight from going on and off with every update of an estimate that wanders about the threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hysteresis {
    /// A weight that is off comes on again only where the variance exceeds the threshold times this factor, at least one.
    pub return_factor: f64,
}

/// Algorithm 1: a weight decays as the variance of its quantity comes near the one that is wanted, and is zero where the
/// variance is at most `alpha` times that.
///
/// With target variance `v_n` and current variance `v`: zero where `v <= alpha v_n`, else `gamma0 exp(-beta v_n / v)`, for
/// each quantity on its own. With beta = 5 and alpha = 2.2 a tenth of `gamma0` is left just above the threshold: the plan
/// jumps there unless [`ShutOff::Continuous`] is chosen.
///
/// ```
/// use tumble_planning::local::{CovarianceWeighting, InformationWeighting, WeightingContext};
/// use tumble_planning::nalgebra::{SMatrix, SVector};
/// let mut weighting = CovarianceWeighting::try_new([10.0, 30.0], [1e-3, 1e-3], 3.0, 2.0).unwrap();
/// let known = SMatrix::<f64, 2, 2>::from_diagonal(&SVector::from([0.01, 2e-3]));
/// let [first, second] = weighting.weights(&WeightingContext::try_new(known, known, 0.0, 1.0).unwrap()).unwrap();
/// assert!((first - 10.0 * f64::exp(-0.2)).abs() < 1e-12 && second == 0.0);
/// ```
/// # Source
/// Thesis 6.2.2, Algorithm 1.
/// # Deviation
/// The listing computes the updated covariance `Sigma_{k+1}` and then tests the variance before the update, `sigma_k`; the
/// caption asks for the latest update, which is used here: the caller passes it in [`WeightingContext`]. `sigma` means
/// variances throughout. `alpha >= 1` is not printed, but below one the target itself would count as not reached
/// (`local::weighting::covariance::tests::golden_value`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CovarianceWeighting<const P: usize> {
    base: [f64; P],
    target_variance: [f64; P],
    alpha: f64,
    beta: f64,
    shut_off: ShutOff,
    return_factor: f64,
    is_off: [bool; P],
}

impl<const P: usize> CovarianceWeighting<P> {
    /// Weights `base` far from the target variances, tolerance `alpha` and rate of decay `beta`: as printed, with its jump and
    /// without memory.
    ///
    /// # Errors
    /// Weights that are negative or not finite; targets or `beta` that are not positive; [`PlanningError::OutOfRange`] for
    /// an `alpha` below one.
    pub fn try_new(base: [f64; P], target_variance: [f64; P], alpha: f64, beta: f64) -> Result<Self, PlanningError> {
        base_weights(&base)?;
        for target in target_variance {
            positive("a target variance", target)?;
        }
        at_least_one("the tolerance alpha", alpha)?;
        positive("the rate of decay beta", beta)?;
        let shut_off = ShutOff::Jump;
        Ok(Self { base, target_variance, alpha, beta, shut_off, return_factor: 1.0, is_off: [false; P] })
    }

    /// For quantities of about these sizes (SI): each is wanted to one part in a hundred, and far from that an information of one
    /// over its square weighs a hundred; alpha and beta of the thesis.
    ///
    /// # Errors
    /// Sizes that are not positive.
    pub fn of_sizes(sizes: [f64; P]) -> Result<Self, PlanningError> {
        let squares = sizes.map(|size| size * size);
        Self::try_new(squares.map(|square| 100.0 / square), squares.map(|square| 1e-4 * square), 2.2, 5.0)
    }

    /// The same with another way of switching off.
    pub fn with_shut_off(self, shut_off: ShutOff) -> Self {
        Self { shut_off, ..self }
    }

    /// The same with memory.
    ///
    /// # Errors
    /// [`PlanningError::OutOfRange`] for a factor below one.
    pub fn with_hysteresis(self, hysteresis: Hysteresis) -> Result<Self, PlanningError> {
        let return_factor = at_least_one("the return factor of a weight", hysteresis.return_factor)?;
        Ok(Self { return_factor, ..self })
    }

    fn weight(&self, base: f64, target: f64, variance: f64) -> f64 {
        let factor = libm::exp(-self.beta * target / variance);
        match self.shut_off {
            ShutOff::Jump => base * factor,
            ShutOff::Continuous => {
                let left = libm::exp(-self.beta / self.alpha);
                base * ((factor - left) / (1.0 - left)).max(0.0)
            }
        }
    }
}

fn at_least_one(what: &'static str, value: f64) -> Result<f64, PlanningError> {
    let upper = f64::INFINITY;
    if finite(what, value)? >= 1.0 {
        Ok(value)
    } else {
        Err(PlanningError::OutOfRange { what, value, lower: 1.0, upper })
    }
}

impl<const P: usize> InformationWeighting<P> for CovarianceWeighting<P> {
    fn weights(&mut self, context: &WeightingContext<P>) -> Result<[f64; P], PlanningError> {
        let variances = context.variances();
        for ((is_off, target), variance) in self.is_off.iter_mut().zip(self.target_variance).zip(variances) {
            let factor = if *is_off { self.return_factor } else { 1.0 };
            *is_off = variance <= self.alpha * target * factor;
        }
        Ok(core::array::from_fn(|i| {
            if self.is_off[i] { 0.0 } else { self.weight(self.base[i], self.target_variance[i], variances[i]) }
        }))
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "the same operations give the same bits")]
mod tests {
    use super::*;
    use nalgebra::{SMatrix, SVector};

    fn known<const P: usize>(variances: [f64; P]) -> WeightingContext<P> {
        let covariance = SMatrix::from_diagonal(&SVector::from(variances));
        WeightingContext::try_new(covariance, covariance, 0.0, 1.0).unwrap()
    }

    const TARGET: [f64; 4] = [1e-3, 0.1, 1e-3, 0.05];

    fn printed() -> CovarianceWeighting<4> {
        CovarianceWeighting::try_new([10.0, 20.0, 30.0, 40.0], TARGET, 3.0, 2.0).unwrap()
    }

    #[test]
    fn golden_value() {
        let weights = printed().weights(&known([0.01, 0.5, 2e-3, 4.0])).unwrap();
        let expected = [8.187_307_530_78, 13.406_400_920_713, 0.0, 39.012_396_481_133];
        for (weight, expected) in weights.iter().zip(expected) {
            assert!((weight - expected).abs() < 1e-11, "{weights:?}");
        }
    }

    /// The jump is `gamma0 exp(-beta / alpha)`; without it the weight leaves zero like the distance to the threshold and
    /// tends to the same value far away.
    #[test]
    fn the_jump_is_where_and_as_large_as_said() {
        let above = |factor: f64| known(TARGET.map(|target| 3.0 * target * factor));
        let (mut jumps, mut goes) = (printed(), printed().with_shut_off(ShutOff::Continuous));
        let left = f64::exp(-2.0 / 3.0);
        let (just, half_way, far) = (above(1.0 + 1e-9), above(2.0), above(1e9));
        assert!((jumps.weights(&just).unwrap()[0] - 10.0 * left).abs() < 1e-7);
        let small = goes.weights(&just).unwrap()[0];
        assert!(small > 0.0 && small < 2e-8, "{small}");
        let between = goes.weights(&half_way).unwrap()[1];
        assert!((between - 20.0 * (f64::exp(-1.0 / 3.0) - left) / (1.0 - left)).abs() < 1e-12);
        for weighting in [&mut jumps, &mut goes] {
            assert!((weighting.weights(&far).unwrap()[3] - 40.0).abs() < 1e-6);
            assert_eq!(weighting.weights(&above(1.0)).unwrap(), [0.0; 4]);
        }
    }

    /// An estimate that wanders by a tenth about the threshold switches once; one that gets much worse switches back.
    #[test]
    fn hysteresis_does_not_chatter() {
        let wander = |i: u32| known(TARGET.map(|target| 3.0 * target * (1.0 - 0.1 * f64::from(i % 2) + 0.05)));
        let switches = |mut weighting: CovarianceWeighting<4>| {
            let on: Vec<bool> = (0..20).map(|i| weighting.weights(&wander(i)).unwrap()[0] > 0.0).collect();
            let back = weighting.weights(&known(TARGET.map(|target| 6.0 * target))).unwrap()[0] > 0.0;
            (on.windows(2).filter(|pair| pair[0] != pair[1]).count(), back)
        };
        assert_eq!(switches(printed()), (19, true));
        assert_eq!(switches(printed().with_hysteresis(Hysteresis { return_factor: 1.5 }).unwrap()), (1, true));
    }

    #[test]
    fn impossible_numbers_are_errors_that_say_so() {
        let new = |base: f64, target: f64, alpha: f64, beta: f64| {
            CovarianceWeighting::try_new([base], [target], alpha, beta).unwrap_err()
        };
        let what = "the tolerance alpha";
        let below = PlanningError::OutOfRange { what, value: 0.9, lower: 1.0, upper: f64::INFINITY };
        assert_eq!(new(1.0, 1.0, 0.9, 1.0), below);
        assert!(matches!(new(1.0, 1.0, f64::NAN, 1.0), PlanningError::NotFinite { .. }));
        assert!(matches!(new(-1.0, 1.0, 2.0, 1.0), PlanningError::Negative { .. }));
        assert!(matches!(new(1.0, 0.0, 2.0, 1.0), PlanningError::NotPositive { .. }));
        assert!(matches!(new(1.0, 1.0, 2.0, 0.0), PlanningError::NotPositive { .. }));
        let forgetful = printed().with_hysteresis(Hysteresis { return_factor: 0.5 });
        assert!(matches!(forgetful, Err(PlanningError::OutOfRange { value: 0.5, .. })));
    }
}
