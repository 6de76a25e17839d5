//! A discrete linear filter, as a publisher runs it.

use crate::error::IdentificationError;

/// Longest answer to an impulse that is looked at, samples.
const LONGEST_ANSWER: usize = 4000;

/// A stable discrete linear system of unit gain at rest: y_k = sum b_i x_(k-i) - sum a_i y_(k-i), a_0 = 1, in steps of its own.
///
/// Its first input is taken to have lasted for ever.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "Coefficients", into = "Coefficients")
)]
pub struct LinearFilter {
    numerator: Vec<f64>,
    denominator: Vec<f64>,
    step_s: f64,
}

/// As it stands in a file.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Coefficients {
    numerator: Vec<f64>,
    denominator: Vec<f64>,
    step_s: f64,
}

#[cfg(feature = "serde")]
impl TryFrom<Coefficients> for LinearFilter {
    type Error = IdentificationError;

    fn try_from(told: Coefficients) -> Result<Self, IdentificationError> {
        Self::try_new(&told.numerator, &told.denominator, told.step_s)
    }
}

#[cfg(feature = "serde")]
impl From<LinearFilter> for Coefficients {
    fn from(filter: LinearFilter) -> Self {
        Self { numerator: filter.numerator, denominator: filter.denominator, step_s: filter.step_s }
    }
}

impl LinearFilter {
    /// Of coefficients, newest sample first, at one sample per `step_s`. Both are divided by `denominator[0]`, and the numerator by what
    /// the gain at rest is.
    ///
    /// # Errors
    /// [`IdentificationError::ImpossibleSensing`] for a step that is not positive, no coefficients, one that is not finite, a gain of zero at
    /// rest, a filter that is not stable.
    pub fn try_new(numerator: &[f64], denominator: &[f64], step_s: f64) -> Result<Self, IdentificationError> {
        let refused = |what: &'static str, value: f64| Err(IdentificationError::ImpossibleSensing { what, value });
        if !(step_s > 0.0 && step_s.is_finite()) {
            return refused("step of a filter, s", step_s);
        }
        if let Some(value) = numerator.iter().chain(denominator).find(|value| !value.is_finite()) {
            return refused("coefficient of a filter", *value);
        }
        let Some(&leading) = denominator.first().filter(|leading| **leading != 0.0) else {
            return refused("leading coefficient of a filter's denominator", 0.0);
        };
        let denominator: Vec<f64> = denominator.iter().map(|a| a / leading).collect();
        let radius = largest_reflection(&denominator);
        if radius >= 1.0 || radius.is_nan() {
            return refused("reflection coefficient of a filter that is not stable", radius);
        }
        let gain = numerator.iter().sum::<f64>() / leading / denominator.iter().sum::<f64>();
        if gain == 0.0 || !gain.is_finite() {
            return refused("gain of a filter at rest", gain);
        }
        Ok(Self { numerator: numerator.iter().map(|b| b / leading / gain).collect(), denominator, step_s })
    }

    /// This filter, then `other`.
    ///
    /// # Errors
    /// As [`try_new`](Self::try_new); steps that differ.
    pub fn then(&self, other: &Self) -> Result<Self, IdentificationError> {
        if (self.step_s - other.step_s).abs() > 1e-9 * self.step_s {
            return Err(IdentificationError::ImpossibleSensing {
                what: "step of the second filter, s",
                value: other.step_s,
            });
        }
        let product = |a: &[f64], b: &[f64]| {
            let mut out = vec![0.0; a.len() + b.len() - 1];
            for (i, x) in a.iter().enumerate() {
                for (j, y) in b.iter().enumerate() {
                    out[i + j] += x * y;
                }
            }
            out
        };
        Self::try_new(
            &product(&self.numerator, &other.numerator),
            &product(&self.denominator, &other.denominator),
            self.step_s,
        )
    }

    /// Time between its samples, s.
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// Delay of slow signals, samples.
    pub fn delay_samples(&self) -> f64 {
        let delay = |c: &[f64]| c.iter().enumerate().map(|(i, c)| i as f64 * c).sum::<f64>() / c.iter().sum::<f64>();
        delay(&self.numerator) - delay(&self.denominator)
    }

    /// The filtered series; its first value has lasted for ever.
    pub fn filtered(&self, input: &[f64]) -> Vec<f64> {
        let first = input.first().copied().unwrap_or_default();
        let mut output = Vec::with_capacity(input.len());
        for k in 0..input.len() {
            let mut y = 0.0;
            for (i, b) in self.numerator.iter().enumerate() {
                y += b * if k >= i { input[k - i] } else { first };
            }
            for (i, a) in self.denominator.iter().enumerate().skip(1) {
                y -= a * if k >= i { output[k - i] } else { first };
            }
            output.push(y);
        }
        output
    }

    /// Density at low frequency over the density of the mean of `block` published samples, one of `every` steps published, for white
    /// noise before the filter: what the filter hides from a short block.
    ///
    /// # Source
    /// rho_M = S(0) / S_M: S(0) the density at zero frequency of filtered white noise, S_M that of the mean of M published samples times M.
    pub fn density_ratio(&self, every: usize, block: usize) -> f64 {
        let (every, block) = (every.max(1), block.max(1));
        let mut impulse = vec![0.0; LONGEST_ANSWER];
        impulse[1] = 1.0;
        let answer = self.filtered(&impulse);
        let mut of_block = vec![0.0; LONGEST_ANSWER + every * block];
        for m in 0..block {
            for (sum, y) in of_block[every * m..].iter_mut().zip(&answer) {
                *sum += y / block as f64;
            }
        }
        let power: f64 = of_block.iter().map(|y| y * y).sum();
        1.0 / ((every * block) as f64 * power)
    }
}

/// Largest reflection coefficient of a denominator: below one where all poles lie in the unit circle.
///
/// # Source
/// Schur and Cohn's test by Levinson's recursion backwards.
fn largest_reflection(denominator: &[f64]) -> f64 {
    let mut a = denominator.to_vec();
    let mut largest: f64 = 0.0;
    while a.len() > 1 {
        let last = a.len() - 1;
        let k = a[last];
        largest = largest.max(k.abs());
        if largest >= 1.0 || k.is_nan() {
            return if k.is_nan() { f64::NAN } else { largest };
        }
        let scale = 1.0 - k * k;
        a = (0..last).map(|i| (a[i] - k * a[last - i]) / scale).collect();
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients of a unit that averages 64 samples of 0.5 ms and two low passes.
    fn filters() -> (LinearFilter, LinearFilter) {
        let mut average = [0.0; 5];
        for tap in 0..64 {
            for (sample, weight) in average.iter_mut().enumerate() {
                *weight += (1.0 - (f64::from(tap) / 16.0 - sample as f64).abs()).max(0.0) / 64.0;
            }
        }
        let average = LinearFilter::try_new(&average, &[1.0], 0.008).unwrap();
        let (s, t) = (3.999_637_218_2, 6.998_911_654_6);
        let poles = [1.0, -2.698_687_669_5, 2.441_079_708_5, -0.739_426_572];
        let slow = LinearFilter::try_new(&[1.0, s, t, t, s, 1.0], &poles, 0.008).unwrap();
        let s = 1.999_637_218_2;
        let fast = LinearFilter::try_new(&[1.0, s, s, 1.0], &[1.0, -0.859_528_560_4], 0.008).unwrap();
        (average.then(&slow).unwrap(), average.then(&fast).unwrap())
    }

    #[test]
    fn delays_and_densities_are_those_of_the_design() {
        let (accelerometer, gyro) = filters();
        assert!((accelerometer.delay_samples() - 16.2065).abs() < 1e-4, "{}", accelerometer.delay_samples());
        assert!((gyro.delay_samples() - 9.5876).abs() < 1e-4, "{}", gyro.delay_samples());
        for (block, a, g) in [(4, 2.684, 2.506), (8, 1.552, 1.642), (16, 1.160, 1.271), (32, 1.078, 1.120)] {
            let (found_a, found_g) = (accelerometer.density_ratio(2, block), gyro.density_ratio(2, block));
            assert!((found_a - a).abs() < 1e-3 && (found_g - g).abs() < 1e-3, "{block}: {found_a} {found_g}");
        }
        // At rest nothing changes, from the first sample on.
        assert!(gyro.filtered(&[3.0; 50]).iter().all(|y| (y - 3.0).abs() < 1e-12));
        // A ramp comes late by the delay.
        let ramp: Vec<f64> = (0..2000).map(f64::from).collect();
        let late = accelerometer.filtered(&ramp);
        assert!((1999.0 - late[1999] - accelerometer.delay_samples()).abs() < 1e-6);
    }

    #[test]
    fn filters_that_cannot_be_are_refused() {
        let new = LinearFilter::try_new;
        assert!(new(&[1.0], &[1.0, -1.01], 0.01).is_err() && new(&[1.0], &[1.0, -0.99], 0.01).is_ok());
        assert!(new(&[1.0, -1.0], &[1.0], 0.01).is_err() && new(&[1.0], &[1.0], 0.0).is_err());
        assert!(
            new(&[], &[1.0], 0.01).is_err()
                && new(&[1.0], &[], 0.01).is_err()
                && new(&[f64::NAN], &[1.0], 0.01).is_err()
        );
        let (slow, fast) = (new(&[1.0], &[1.0, -0.9], 0.01).unwrap(), new(&[1.0], &[1.0], 0.02).unwrap());
        assert!(slow.then(&fast).is_err());
    }
}
