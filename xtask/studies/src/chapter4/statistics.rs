//! What is made of many errors: medians, ranks, the paired t-test, the thesis's normalisation.

use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::plot::quantile;

/// The middle of numbers in any order; those that are none are left out.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| !value.is_nan()).collect();
    sorted.sort_by(f64::total_cmp);
    quantile(&sorted, 0.5)
}

/// Paired t-test of the mean of differences against zero.
#[derive(Clone, Copy, Debug)]
pub struct PairedT {
    pub mean: f64,
    pub t: f64,
    pub degrees: usize,
    /// How often chance alone gives so small a t: small speaks for a mean below zero.
    pub p_less: f64,
}

/// `None` below two pairs, or where all differences are equal.
pub fn paired_t(differences: &[f64]) -> Option<PairedT> {
    let n = differences.len() as f64;
    let degrees = differences.len().checked_sub(1)?;
    let mean = differences.iter().sum::<f64>() / n;
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / degrees as f64;
    let t = mean / (variance / n).sqrt();
    let law = StudentsT::new(0.0, 1.0, degrees as f64).ok()?;
    t.is_finite().then(|| PairedT { mean, t, degrees, p_less: law.cdf(t) })
}

/// Errors on the scale from the smallest to the largest of them.
///
/// # Source
/// Thesis (4.21).
pub fn normalized(errors: &[f64]) -> Vec<f64> {
    let (low, high) = errors.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)));
    errors.iter().map(|error| if high > low { (error - low) / (high - low) } else { 0.0 }).collect()
}

/// Spearman's rank correlation; ties share their mean rank.
pub fn rank_correlation(a: &[f64], b: &[f64]) -> f64 {
    let ranks = |values: &[f64]| -> Vec<f64> {
        // Half of those that are not larger and half of those that are smaller.
        let below = |x: &f64| values.iter().map(|y| f64::from(u8::from(y < x)) + f64::from(u8::from(y <= x))).sum();
        values.iter().map(below).collect()
    };
    let (a, b) = (ranks(a), ranks(b));
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (mean_a, mean_b) = (mean(&a), mean(&b));
    let product = |x: &[f64], mean_x: f64, y: &[f64], mean_y: f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - mean_x) * (y - mean_y)).sum()
    };
    product(&a, mean_a, &b, mean_b) / (product(&a, mean_a, &a, mean_a) * product(&b, mean_b, &b, mean_b)).sqrt()
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact cases")]
mod tests {
    use super::*;

    /// Student's sleep data (1908), extra hours of ten patients under two drugs: t = -4.0621 with 9 degrees of freedom,
    /// two-sided p = 0.002833, mean difference -1.58.
    #[test]
    fn students_own_example() {
        let first = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0];
        let second = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4];
        let differences: Vec<f64> = first.iter().zip(second).map(|(a, b)| a - b).collect();
        let test = paired_t(&differences).unwrap();
        assert_eq!(test.degrees, 9);
        assert!((test.mean + 1.58).abs() < 1e-12 && (test.t + 4.0621).abs() < 5e-5, "{test:?}");
        assert!((test.p_less - 0.5 * 0.002_833).abs() < 5e-7, "{test:?}");
        let other: Vec<f64> = differences.iter().map(|d| -d).collect();
        assert!((paired_t(&other).unwrap().p_less - (1.0 - test.p_less)).abs() < 1e-12);
        assert!(paired_t(&[1.0]).is_none() && paired_t(&[]).is_none() && paired_t(&[2.0, 2.0]).is_none());
    }

    #[test]
    fn the_median_takes_any_order() {
        assert_eq!(median(&[7.0, 1.0, 5.0, f64::NAN, 3.0]), 4.0);
        assert!(median(&[]).is_nan());
    }

    #[test]
    fn normalisation_runs_from_zero_to_one_in_the_same_order() {
        assert_eq!(normalized(&[3.0, 1.0, 2.0, 5.0]), [0.5, 0.0, 0.25, 1.0]);
        assert_eq!(normalized(&[2.0, 2.0]), [0.0, 0.0]);
    }

    #[test]
    fn ranks_see_order_only() {
        let rising = [1.0, 2.0, 3.0, 4.0];
        assert!((rank_correlation(&rising, &rising.map(f64::exp)) - 1.0).abs() < 1e-12);
        assert!((rank_correlation(&rising, &rising.map(|x| -x)) + 1.0).abs() < 1e-12);
        // Sum of squared rank differences 2: 1 - 6 * 2 / (4 * 15).
        assert!((rank_correlation(&rising, &[1.0, 3.0, 2.0, 4.0]) - 0.8).abs() < 1e-12);
    }
}
