//! Whether an estimator's own account of its errors is true: consistency, coverage, whiteness, and the bands in which a
//! correct estimator's figures lie.

use crate::error::IdentificationError;
use core::fmt;
use nalgebra::{SMatrix, SVector};
use statrs::distribution::{Beta, Binomial, ChiSquared, ContinuousCDF, DiscreteCDF, Normal};

/// An interval of accepted values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Band {
    /// Whether `value` lies inside; not a number lies nowhere.
    pub fn contains(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}

impl fmt::Display for Band {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} to {:.3}", self.low, self.high)
    }
}

/// Shares of chance below and above a two-sided band of this probability.
fn tails(probability: f64) -> (f64, f64) {
    let outside = 0.5 * (1.0 - probability.clamp(0.0, 1.0));
    (outside, 1.0 - outside)
}

/// A chi-square law; the degrees of freedom may be any positive number.
fn chi_square(degrees_of_freedom: f64) -> Option<ChiSquared> {
    ChiSquared::new(degrees_of_freedom).ok().filter(|_| degrees_of_freedom.is_finite())
}

/// The value a chi-square number stays below with this probability; not a number for degrees of freedom that are not
/// positive.
pub fn chi_square_quantile(degrees_of_freedom: f64, probability: f64) -> f64 {
    chi_square(degrees_of_freedom).map_or(f64::NAN, |law| law.inverse_cdf(probability.clamp(0.0, 1.0)))
}

/// The chance that a chi-square number exceeds `value`.
pub fn chi_square_exceedance(degrees_of_freedom: f64, value: f64) -> f64 {
    chi_square(degrees_of_freedom).map_or(f64::NAN, |law| law.sf(value.max(0.0)))
}

/// Where the mean of `runs` normalised squared errors (NEES) or innovations (NIS) of `degrees_of_freedom` each lies with this
/// probability, for a consistent estimator and independent runs.
pub fn mean_square_band(degrees_of_freedom: f64, runs: usize, probability: f64) -> Band {
    let (n, (low, high)) = (runs as f64, tails(probability));
    let quantile = |p| chi_square_quantile(degrees_of_freedom * n, p) / n;
    Band { low: quantile(low), high: quantile(high) }
}

/// Normalised estimation error squared `e^T P^-1 e`; `None` where the covariance is not positive definite.
pub fn normalized_squared_error<const N: usize>(
    error: &SVector<f64, N>,
    covariance: &SMatrix<f64, N, N>,
) -> Option<f64> {
    // In units of the own deviations, so that no mixture of units is taken for a singular matrix.
    let unit = covariance.diagonal().map(|variance| 1.0 / variance.sqrt());
    let correlation = SMatrix::<f64, N, N>::from_fn(|i, j| covariance[(i, j)] * unit[i] * unit[j]);
    let scaled = error.component_mul(&unit);
    correlation.cholesky().map(|factor| scaled.dot(&factor.solve(&scaled))).filter(|value| value.is_finite())
}

/// Where the ratio of a root-mean-square error to the root-mean-square bound lies with this probability, for an estimator
/// that attains the bound.
///
/// `degrees_of_freedom` as [`effective_degrees_of_freedom`] counts them: runs times components, fewer where one component or
/// one run dominates.
pub fn rms_ratio_band(degrees_of_freedom: f64, probability: f64) -> Band {
    let (low, high) = tails(probability);
    let quantile = |p| (chi_square_quantile(degrees_of_freedom, p) / degrees_of_freedom).sqrt();
    Band { low: quantile(low), high: quantile(high) }
}

/// The chance that such a ratio falls outside a band, for an estimator that attains the bound.
pub fn rms_ratio_failure(degrees_of_freedom: f64, band: &Band) -> f64 {
    let above = |ratio: f64| chi_square_exceedance(degrees_of_freedom, degrees_of_freedom * ratio * ratio);
    1.0 - above(band.low.max(0.0)) + above(band.high)
}

/// Degrees of freedom of a sum of squared errors with these covariances, one for each independent run: that of the
/// chi-square law with the same mean and variance, `(sum tr P)^2 / sum tr P^2` (Satterthwaite).
pub fn effective_degrees_of_freedom<'a, const N: usize>(
    covariances: impl IntoIterator<Item = &'a SMatrix<f64, N, N>>,
) -> f64 {
    let (trace, square) = covariances.into_iter().fold((0.0, 0.0), |(trace, square), covariance| {
        (trace + covariance.trace(), square + covariance.norm_squared())
    });
    trace * trace / square
}

/// Where the share of intervals that hold the truth lies with at least this probability, when each does with probability
/// `nominal`, independently, `trials` times.
pub fn coverage_band(nominal: f64, trials: usize, probability: f64) -> Band {
    let Ok(law) = Binomial::new(nominal, trials as u64) else { return Band { low: f64::NAN, high: f64::NAN } };
    let (low, high) = tails(probability);
    // Smallest counts that are not in either tail.
    let count = |p: f64| law.inverse_cdf(p) as f64 / trials as f64;
    Band { low: count(low), high: count(high) }
}

/// Confidence interval of a probability from `hits` in `trials`, never narrower than it says (Clopper-Pearson).
pub fn clopper_pearson(hits: usize, trials: usize, probability: f64) -> Band {
    let (low, high) = tails(probability);
    let (k, n) = (hits.min(trials) as f64, trials as f64);
    let quantile = |a: f64, b: f64, p: f64| Beta::new(a, b).map_or(f64::NAN, |law| law.inverse_cdf(p));
    Band {
        low: if k > 0.0 { quantile(k, n - k + 1.0, low) } else { 0.0 },
        high: if k < n { quantile(k + 1.0, n - k, high) } else { 1.0 },
    }
}

/// The chance that at least one of several independent tests fails a correct estimator.
pub fn chance_of_any(failures: impl IntoIterator<Item = f64>) -> f64 {
    // Sums of logarithms keep chances far below the machine precision.
    -failures.into_iter().map(|chance| (-chance.clamp(0.0, 1.0)).ln_1p()).sum::<f64>().exp_m1()
}

/// Half the width of a two-sided interval, in standard deviations of a normal number: 1.96 for 95 %.
pub fn normal_quantile(probability: f64) -> f64 {
    Normal::standard().inverse_cdf(tails(probability).1)
}

/// Autocorrelation at distances 1 to `largest` of a series about its mean; zero for a constant one.
pub fn autocorrelation(series: &[f64], largest: usize) -> Vec<f64> {
    let mean = series.iter().sum::<f64>() / series.len().max(1) as f64;
    let centred: Vec<f64> = series.iter().map(|x| x - mean).collect();
    let product = |lag: usize| centred.iter().zip(centred.get(lag..).unwrap_or(&[])).map(|(a, b)| a * b).sum::<f64>();
    let power = product(0);
    (1..=largest).map(|lag| if power > 0.0 { product(lag) / power } else { 0.0 }).collect()
}

/// What the residuals of a fit say about the noise: white, or not.
#[derive(Clone, Debug, PartialEq)]
pub struct Whiteness {
    /// Portmanteau statistic of Ljung and Box, summed over the channels.
    pub statistic: f64,
    /// Its degrees of freedom where the residuals are white.
    pub degrees_of_freedom: f64,
    /// The chance of a statistic at least as large then.
    pub p_value: f64,
    /// Autocorrelation at each distance from one, mean over the channels.
    pub autocorrelation: Vec<f64>,
}

impl Whiteness {
    /// Judges channels of equal sampling over distances 1 to `distances`, of residuals after `fitted` parameters in all.
    ///
    /// # Errors
    /// [`IdentificationError::TooFewSamples`] where a channel is not longer than twice the distance;
    /// [`IdentificationError::NotFinite`] naming the sample.
    pub fn of(channels: &[&[f64]], distances: usize, fitted: usize) -> Result<Self, IdentificationError> {
        let (mut statistic, mut mean) = (0.0, vec![0.0; distances]);
        for channel in channels {
            let needed = 2 * distances + 1;
            if channel.len() < needed {
                return Err(IdentificationError::TooFewSamples { samples: channel.len(), needed });
            }
            if let Some(row) = channel.iter().position(|x| !x.is_finite()) {
                return Err(IdentificationError::NotFinite { row });
            }
            let n = channel.len() as f64;
            for (k, (rho, mean)) in autocorrelation(channel, distances).iter().zip(&mut mean).enumerate() {
                statistic += n * (n + 2.0) * rho * rho / (n - (k + 1) as f64);
                *mean += rho / channels.len() as f64;
            }
        }
        let degrees_of_freedom = (channels.len() * distances).saturating_sub(fitted).max(1) as f64;
        Ok(Self {
            statistic,
            degrees_of_freedom,
            p_value: chi_square_exceedance(degrees_of_freedom, statistic),
            autocorrelation: mean,
        })
    }

    /// Whether the residuals pass for white where a false alarm may come with this probability.
    pub fn is_white(&self, false_alarm: f64) -> bool {
        self.p_value >= false_alarm
    }

    /// By how much standard deviations that assume white noise are too small for slow motion: the root of
    /// `1 + 2 sum rho`; below one where neighbours cancel.
    pub fn sigma_inflation(&self) -> f64 {
        (1.0 + 2.0 * self.autocorrelation.iter().sum::<f64>()).max(0.0).sqrt()
    }
}

impl fmt::Display for Whiteness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_white(0.01) {
            return write!(f, "residuals pass for white (p = {:.2})", self.p_value);
        }
        let neighbour = self.autocorrelation.first().copied().unwrap_or_default();
        write!(
            f,
            "residuals are coloured (p = {:.1e}, correlation of neighbours {neighbour:+.2}): \
             deviations that assume white noise are off by {:.2}",
            self.p_value,
            self.sigma_inflation()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Gaussian;

    fn close(found: f64, expected: f64, relative: f64) {
        assert!((found - expected).abs() <= relative * expected.abs(), "{found} {expected}");
    }

    /// Quantiles of `reference/equations.md` f and of any printed table.
    #[test]
    fn chi_square_tables() {
        let gate = [
            6.634_896_601_021,
            9.210_340_371_976,
            11.344_866_730_144,
            13.276_704_135_988,
            15.086_272_469_389,
            16.811_893_829_771,
        ];
        for (dof, expected) in (1..).zip(gate) {
            close(chi_square_quantile(f64::from(dof), 0.99), expected, 1e-11);
            close(chi_square_exceedance(f64::from(dof), expected), 0.01, 1e-10);
        }
        // Five digits as printed.
        close(chi_square_quantile(10.0, 0.95), 18.307, 2e-5);
        close(chi_square_quantile(10.0, 0.999), 29.588, 2e-5);
        close(chi_square_quantile(100.0, 0.05), 77.929, 2e-5);
        // Large and even: the exceedance is a sum of Poisson's law, exactly.
        for pairs in [500_u32, 5_000, 30_000] {
            for p in [0.0005, 0.5, 0.9995] {
                let half = 0.5 * chi_square_quantile(f64::from(2 * pairs), p);
                let mut log_term = -half;
                let mut sum = 0.0;
                for i in 1..=pairs {
                    sum += log_term.exp();
                    log_term += (half / f64::from(i)).ln();
                }
                close(sum, 1.0 - p, 1e-7);
            }
        }
        assert!(chi_square_quantile(0.0, 0.5).is_nan() && chi_square_quantile(f64::NAN, 0.5).is_nan());
        close(normal_quantile(0.95), 1.959_963_985, 1e-9);
        close(normal_quantile(0.999), 3.290_526_731, 1e-9);
    }

    #[test]
    fn mean_square_band_of_forty_runs() {
        // Bar-Shalom, Li and Kirubarajan, section 5.4.2: 50 runs of two states, 95 %.
        let band = mean_square_band(2.0, 50, 0.95);
        close(band.low, 1.484, 1e-3);
        close(band.high, 2.591, 1e-3);
        let band = mean_square_band(10.0, 40, 0.95);
        close(band.low, 8.66, 1e-3);
        close(band.high, 11.43, 1e-3);
    }

    #[test]
    fn proportions() {
        // Clopper and Pearson's closed forms at the ends, and a published case.
        let none = clopper_pearson(0, 10, 0.95);
        assert!(none.low.abs() < f64::MIN_POSITIVE);
        close(none.high, 1.0 - 0.025_f64.powf(0.1), 1e-10);
        let all = clopper_pearson(10, 10, 0.95);
        assert!((all.high - 1.0).abs() < f64::EPSILON);
        close(all.low, 0.025_f64.powf(0.1), 1e-10);
        let half = clopper_pearson(5, 10, 0.95);
        close(half.low, 0.187_086, 1e-5);
        close(half.high, 0.812_914, 1e-5);
        // The band holds the stated probability and no smaller one around it does.
        for (nominal, trials) in [(0.95, 1000_u16), (0.95, 40), (0.5, 9)] {
            let law = |k: usize| {
                let ln = |n: f64| statrs::function::gamma::ln_gamma(n + 1.0);
                let (n, k) = (f64::from(trials), k as f64);
                (ln(n) - ln(k) - ln(n - k) + k * f64::ln(nominal) + (n - k) * f64::ln(1.0 - nominal)).exp()
            };
            let band = coverage_band(nominal, trials.into(), 0.999);
            let all = usize::from(trials);
            let count = |share: f64| (0..=all).find(|k| (*k as f64 - share * f64::from(trials)).abs() < 0.5).unwrap();
            let counts = [count(band.low), count(band.high)];
            let below: f64 = (0..counts[0]).map(law).sum();
            let above: f64 = (counts[1] + 1..=all).map(law).sum();
            assert!(below <= 0.0005 && above <= 0.0005, "{below} {above}");
            assert!(below + law(counts[0]) > 0.0005 && above + law(counts[1]) > 0.0005 - 1e-12);
        }
    }

    #[test]
    fn ratio_bands() {
        // One number: the half-normal law. 95 % of |z| lie between 0.0313 and 2.2414.
        let band = rms_ratio_band(1.0, 0.95);
        close(band.low, 0.031_338, 1e-4);
        close(band.high, 2.241_403, 1e-6);
        // Many: normal with deviation 1 / sqrt(2 nu).
        let band = rms_ratio_band(3000.0, 0.999);
        close(band.high - band.low, 2.0 * 3.290_5 / 6000.0_f64.sqrt(), 1e-3);
        close(rms_ratio_failure(3000.0, &band), 0.001, 1e-6);
        // Three equal components count three, one dominant component one, unequal runs less than their number.
        let equal = [SMatrix::<f64, 3, 3>::identity(); 5];
        close(effective_degrees_of_freedom(&equal), 15.0, 1e-14);
        let single = [SMatrix::<f64, 3, 3>::from_diagonal(&SVector::from([1.0, 1e-9, 1e-9])); 5];
        close(effective_degrees_of_freedom(&single), 5.0, 1e-6);
        close(
            effective_degrees_of_freedom(&[SMatrix::<f64, 1, 1>::new(3.0), SMatrix::<f64, 1, 1>::new(1.0)]),
            1.6,
            1e-12,
        );
        close(chance_of_any([0.001; 9]), 1.0 - 0.999_f64.powi(9), 1e-12);
        close(chance_of_any([1e-20, 1e-20]), 2e-20, 1e-12);
    }

    #[test]
    fn normalised_error_by_hand_and_without_units() {
        // P = [2, 1; 1, 2], P^-1 = [2, -1; -1, 2] / 3.
        let covariance = SMatrix::<f64, 2, 2>::new(2.0, 1.0, 1.0, 2.0);
        let error = SVector::from([1.0, -2.0]);
        close(normalized_squared_error(&error, &covariance).unwrap(), (2.0 + 4.0 + 8.0) / 3.0, 1e-14);
        let units = SMatrix::<f64, 2, 2>::from_diagonal(&SVector::from([1e6, 1e-7]));
        close(normalized_squared_error(&(units * error), &(units * covariance * units)).unwrap(), 14.0 / 3.0, 1e-12);
        assert!(normalized_squared_error(&error, &SMatrix::<f64, 2, 2>::new(1.0, 2.0, 2.0, 1.0)).is_none());
    }

    #[test]
    fn portmanteau_by_hand() {
        // Mean 0, sum of squares 10: rho_1 = (2 + 0 + 0 + 2) / 10, rho_2 = (0 - 1 + 0) / 10.
        let series = [-2.0, -1.0, 0.0, 1.0, 2.0];
        let rho = autocorrelation(&series, 2);
        close(rho[0], 0.4, 1e-14);
        close(rho[1], -0.1, 1e-14);
        let found = Whiteness::of(&[&series], 2, 0).unwrap();
        close(found.statistic, 5.0 * 7.0 * (0.16 / 4.0 + 0.01 / 3.0), 1e-14);
        // Two degrees of freedom: the exceedance is exp(-Q / 2).
        close(found.p_value, (-found.statistic / 2.0).exp(), 1e-12);
        assert!(Whiteness::of(&[&series], 3, 0).is_err() && Whiteness::of(&[&[f64::NAN; 9]], 2, 0).is_err());
    }

    #[test]
    fn white_noise_rarely_alarms_and_coloured_noise_always() {
        let mut dice = Gaussian::from_seed(5);
        let mut normal = || dice.normal();
        let (mut alarms, mut missed, mut inflation) = (0, 0, 0.0);
        for _ in 0..1000 {
            let white: Vec<Vec<f64>> = (0..3).map(|_| (0..400).map(|_| normal()).collect()).collect();
            let channels: Vec<&[f64]> = white.iter().map(Vec::as_slice).collect();
            alarms += usize::from(!Whiteness::of(&channels, 10, 0).unwrap().is_white(0.05));
            let mut state = 0.0;
            let coloured: Vec<f64> = white
                .concat()
                .iter()
                .map(|x| {
                    state = 0.5 * state + x;
                    state
                })
                .collect();
            let found = Whiteness::of(&[&coloured], 10, 0).unwrap();
            missed += usize::from(found.is_white(0.01));
            inflation += found.sigma_inflation() / 1000.0;
        }
        let band = coverage_band(0.05, 1000, 0.999);
        assert!(band.contains(alarms as f64 / 1000.0), "{alarms} {band}");
        assert_eq!(missed, 0);
        // First-order: sqrt((1 + 0.5) / (1 - 0.5)).
        close(inflation, 3.0_f64.sqrt(), 0.02);
    }
}
