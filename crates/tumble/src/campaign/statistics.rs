//! Statistics of campaigns: rates, quantiles and medians with intervals.

use std::ops::RangeInclusive;
use tumble_identification::noise::Gaussian;

/// Two-sided 95 % point of the normal distribution.
const Z_95: f64 = 1.959_963_984_540_054;
/// Draws of the bootstrap; fewer where there are very many values.
const DRAWS: usize = 2000;
/// Least draws.
const LEAST_DRAWS: usize = 400;
/// Most numbers drawn for one interval.
const MOST_DRAWN: usize = 20_000_000;

/// Wilson's 95 % interval of a probability that was found `count` times of `of`; `None` of nothing.
///
/// # Source
/// Wilson: Probable inference, J. Am. Stat. Assoc. 22, 1927.
pub fn wilson_95(count: u64, of: u64) -> Option<(f64, f64)> {
    if of == 0 || count > of {
        return None;
    }
    let (n, z2) = (of as f64, Z_95 * Z_95);
    let share = count as f64 / n;
    let middle = (share + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z_95 / (1.0 + z2 / n) * (share * (1.0 - share) / n + z2 / (4.0 * n * n)).sqrt();
    let low = if count == 0 { 0.0 } else { middle - half };
    let high = if count == of { 1.0 } else { middle + half };
    Some((low, high))
}

/// What never happened in `of` independent trials happens, with 95 % confidence, less often than this: 3/n.
///
/// # Source
/// Hanley, Lippman-Hand: If nothing goes wrong, is everything all right?, JAMA 249, 1983.
pub fn bound_of_none_95(of: u64) -> Option<f64> {
    (of > 0).then(|| (3.0 / of as f64).min(1.0))
}

/// Quantile of sorted values, linear between them; `None` of nothing.
///
/// # Source
/// Hyndman, Fan: Sample quantiles in statistical packages, Am. Stat. 50, 1996: definition 7.
pub fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let place = share.clamp(0.0, 1.0) * last as f64;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to the last index
    let below = (place.floor() as usize).min(last);
    let (low, high) = (*sorted.get(below)?, *sorted.get((below + 1).min(last))?);
    let part = place - below as f64;
    // exact where both are equal, infinite ones too
    #[allow(clippy::float_cmp)]
    let is_one = part == 0.0 || low == high;
    Some(if is_one { low } else { low + part * (high - low) })
}

/// Median of values in any order, which are sorted.
pub fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    quantile(values, 0.5)
}

/// 95 % interval of the median: percentiles of the medians of samples drawn with replacement. `None` of fewer than two values.
///
/// # Source
/// Efron, Tibshirani: An Introduction to the Bootstrap, 1993, section 13.3.
pub fn median_interval_95(values: &[f64], seed: u64) -> Option<RangeInclusive<f64>> {
    if values.len() < 2 {
        return None;
    }
    let draws = (MOST_DRAWN / values.len()).clamp(LEAST_DRAWS, DRAWS);
    let mut random = Gaussian::from_seed(seed);
    let mut sample = values.to_vec();
    let mut medians = Vec::with_capacity(draws);
    for _ in 0..draws {
        for drawn in &mut sample {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // below the number of values
            let index = ((random.uniform() * values.len() as f64) as usize).min(values.len() - 1);
            *drawn = values.get(index).copied()?;
        }
        medians.push(unsorted_median(&mut sample)?);
    }
    medians.sort_unstable_by(f64::total_cmp);
    Some(quantile(&medians, 0.025)?..=quantile(&medians, 0.975)?)
}

/// As [`median`], without sorting all.
fn unsorted_median(values: &mut [f64]) -> Option<f64> {
    let half = values.len() / 2;
    if half >= values.len() {
        return None;
    }
    let is_even = values.len().is_multiple_of(2);
    let (below, middle, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    let middle = *middle;
    let other = if is_even { below.iter().copied().max_by(f64::total_cmp)? } else { middle };
    // exact where both are equal, infinite ones too
    #[allow(clippy::float_cmp)]
    let is_one = other == middle;
    Some(if is_one { middle } else { f64::midpoint(other, middle) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-9
    }

    #[test]
    fn wilson_solves_its_quadratic() {
        // The bounds are where the count is 1.96 standard deviations (of the bound itself) from what the bound expects.
        for (count, of) in [(1_u64, 10_u64), (5, 10), (37, 40), (999, 1000), (3, 4)] {
            let (low, high) = wilson_95(count, of).unwrap();
            let (n, x) = (of as f64, count as f64);
            for (bound, sign) in [(low, 1.0), (high, -1.0)] {
                let deviations = (x - n * bound) / (n * bound * (1.0 - bound)).sqrt();
                assert!(near(deviations, sign * 1.959_963_984_540_054), "{count} of {of}: {deviations}");
            }
        }
        // of none the quadratic is linear: z^2 / (n + z^2)
        let z2 = 1.959_963_984_540_054_f64.powi(2);
        assert!(near(wilson_95(0, 10).unwrap().1, z2 / (10.0 + z2)));
        assert_eq!(wilson_95(10, 10).unwrap().1.to_bits(), 1.0_f64.to_bits());
        assert!(wilson_95(0, 0).is_none() && wilson_95(2, 1).is_none());
    }

    #[test]
    fn three_over_n_covers() {
        // Whoever fails more often than 3/n is seen at least once in n trials with 95 % probability.
        for n in [10_u64, 56, 1008, 100_000] {
            let bound = bound_of_none_95(n).unwrap();
            let never = (n as f64 * (-bound).ln_1p()).exp();
            assert!(never < 0.05, "{n}: {never}");
        }
        assert_eq!(bound_of_none_95(0), None);
        assert!(near(bound_of_none_95(2).unwrap(), 1.0));
    }

    #[test]
    fn quantiles_of_known_samples() {
        let values = [1.0, 2.0, 4.0, 8.0];
        for (share, expected) in [(0.0, 1.0), (0.5, 3.0), (0.25, 1.75), (0.95, 7.4), (1.0, 8.0)] {
            assert!(near(quantile(&values, share).unwrap(), expected), "{share}");
        }
        assert_eq!(quantile(&[], 0.5), None);
        assert_eq!(quantile(&[f64::INFINITY; 2], 0.3), Some(f64::INFINITY));
        for n in 1..40 {
            let mut a: Vec<f64> = (0..n).map(|i| f64::from((i * 7919) % 101)).collect();
            let mut b = a.clone();
            assert_eq!(median(&mut a), unsorted_median(&mut b), "{n}");
        }
        assert_eq!(unsorted_median(&mut []), None);
    }

    #[test]
    fn the_interval_of_the_median_covers_it() {
        // 400 samples of 61 normal numbers: the number of intervals that hold the true median is within 4 sigma of 95 %.
        let mut random = Gaussian::from_seed(5);
        let samples = 400_u32;
        let mut covered = 0;
        for sample in 0..samples {
            let values: Vec<f64> = (0..61).map(|_| random.normal()).collect();
            covered += u32::from(median_interval_95(&values, u64::from(sample)).unwrap().contains(&0.0));
        }
        let expected = 0.95 * f64::from(samples);
        assert!((f64::from(covered) - expected).abs() < 4.0 * (expected * 0.05).sqrt(), "{covered}");
        assert!(median_interval_95(&[1.0], 1).is_none());
        assert_eq!(median_interval_95(&[2.0, 2.0], 1), Some(2.0..=2.0));
    }

    #[test]
    fn the_seed_decides_the_interval() {
        let mut random = Gaussian::from_seed(9);
        let values: Vec<f64> = (0..500).map(|_| random.normal()).collect();
        assert_eq!(median_interval_95(&values, 1), median_interval_95(&values, 1));
        assert_ne!(median_interval_95(&values, 1), median_interval_95(&values, 2));
    }
}
