//! When a logged wrench acts, and what right-hand side that gives a regressor.

use crate::lie::Wrench;
use crate::regressors::Extrapolation;

/// When the wrench of a row acts.
///
/// Taking the wrong one costs an error of first order in the step: the regressors are centred, a held wrench lags by half
/// a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum WrenchTiming {
    /// Constant in body axes from this row's time to the next row's: what a flight computer applies.
    #[default]
    Held,
    /// A continuous wrench sampled at this row's time.
    Sampled,
}

impl WrenchTiming {
    /// Its name on command lines and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Sampled => "sampled",
        }
    }

    /// The right-hand side that belongs to a variational regressor about the middle sample of a window.
    ///
    /// Sampled: the wrench at the node. Held: the impulse average around the node, that is the wrench weighted by the
    /// triangle that falls to zero at the poses `lag` samples away, `(u_{k-1} + u_k) / 2` for lag 1; several lags are
    /// combined with the coefficients of their regressors.
    ///
    /// `None` unless `times_s` (relative to any origin near the node) and `wrenches` have `2 * lag * reach + 1` entries; the
    /// last held wrench of the window acts after it and is not read.
    ///
    /// # Frame
    /// Body axes, about the body origin; each wrench in the body axes of its own time.
    /// # Source
    /// Discrete impulse of (5.16)-(5.20); for held wrenches the integral of the input against the hat functions of the
    /// discrete action.
    pub fn node_wrench(
        self,
        times_s: &[f64],
        wrenches: &[Wrench<f64>],
        lag: usize,
        extrapolation: Extrapolation,
    ) -> Option<Wrench<f64>> {
        let node = lag * extrapolation.reach();
        if lag == 0 || times_s.len() != 2 * node + 1 || wrenches.len() != times_s.len() {
            return None;
        }
        if self == Self::Sampled {
            return wrenches.get(node).copied();
        }
        let mut sum = Wrench::zero();
        for (coefficient, distance) in extrapolation.coefficients().iter().zip((1..).map(|i| i * lag)) {
            let (first, middle, last) = (times_s[node - distance], times_s[node], times_s[node + distance]);
            let (before_s, after_s) = (middle - first, last - middle);
            // The discrete impulse is the node wrench times the mean step.
            let scale = coefficient * 2.0 / (before_s + after_s);
            for i in node - distance..node {
                let (a, b) = (times_s[i] - first, times_s[i + 1] - first);
                sum += wrenches[i] * (scale * (b - a) * (a + b) * 0.5 / before_s);
            }
            for i in node..node + distance {
                let (a, b) = (last - times_s[i], last - times_s[i + 1]);
                sum += wrenches[i] * (scale * (a - b) * (a + b) * 0.5 / after_s);
            }
        }
        Some(sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn weights(times_s: &[f64], lag: usize, extrapolation: Extrapolation) -> Vec<f64> {
        (0..times_s.len())
            .map(|i| {
                let mut wrenches = vec![Wrench::zero(); times_s.len()];
                wrenches[i] = Wrench::new(Vector3::zeros(), Vector3::new(1.0, 0.0, 0.0));
                WrenchTiming::Held.node_wrench(times_s, &wrenches, lag, extrapolation).unwrap().force.x
            })
            .collect()
    }

    #[test]
    fn held_weights_are_those_of_section_c() {
        let close = |found: Vec<f64>, expected: &[f64]| {
            assert_eq!(found.len(), expected.len());
            for (f, e) in found.iter().zip(expected) {
                assert!((f - e).abs() < 1e-14, "{found:?} {expected:?}");
            }
        };
        let times = |n: usize| (0..n).map(|i| 0.1 * i as f64).collect::<Vec<_>>();
        close(weights(&times(3), 1, Extrapolation::Order2), &[0.5, 0.5, 0.0]);
        close(weights(&times(5), 2, Extrapolation::Order2), &[0.125, 0.375, 0.375, 0.125, 0.0]);
        let (inner, outer) = ((4.0 * 0.5 - 0.375) / 3.0, -0.125 / 3.0);
        close(weights(&times(5), 1, Extrapolation::Order4), &[outer, inner, inner, outer, 0.0]);
        // Steps of different length: the impulse is what acts, whatever the division.
        close(weights(&[0.0, 0.1, 0.3], 1, Extrapolation::Order2), &[1.0 / 3.0, 2.0 / 3.0, 0.0]);
        for extrapolation in [Extrapolation::Order2, Extrapolation::Order4, Extrapolation::Order6] {
            let sum: f64 = weights(&times(6 * extrapolation.reach() + 1), 3, extrapolation).iter().sum();
            assert!((sum - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn sampled_takes_the_node_and_wrong_lengths_give_none() {
        let wrenches: Vec<_> =
            (0..5).map(|i| Wrench::new(Vector3::zeros(), Vector3::new(f64::from(i), 0.0, 0.0))).collect();
        let times = [0.0, 0.1, 0.2, 0.3, 0.4];
        let found = WrenchTiming::Sampled.node_wrench(&times, &wrenches, 1, Extrapolation::Order4).unwrap();
        assert!((found.force.x - 2.0).abs() < 1e-15);
        assert!(WrenchTiming::Sampled.node_wrench(&times, &wrenches, 1, Extrapolation::Order2).is_none());
        assert!(WrenchTiming::Held.node_wrench(&times, &wrenches, 0, Extrapolation::Order2).is_none());
    }
}
