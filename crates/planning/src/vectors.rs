//! Products and sums of long vectors, in an order of summation that vectorises and never changes.

const LANES: usize = 8;

/// Product of two vectors of one length.
#[inline]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_lanes, a_rest) = a.as_chunks::<LANES>();
    let (b_lanes, b_rest) = b.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (a, b) in a_lanes.iter().zip(b_lanes) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7])) + rest
}

/// Adds `factor` times a vector.
#[inline]
pub(crate) fn add_scaled(sum: &mut [f64], factor: f64, x: &[f64]) {
    for (sum, x) in sum.iter_mut().zip(x) {
        *sum += factor * x;
    }
}

/// Largest absolute entry; infinite where an entry is no number.
#[inline]
pub(crate) fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |most, x| {
        if x.abs() > most {
            x.abs()
        } else if x.is_nan() {
            f64::INFINITY
        } else {
            most
        }
    })
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "the same operations give the same bits")]
mod tests {
    use super::*;

    #[test]
    fn products_and_sums_are_those_of_the_definition() {
        for length in [0, 1, 7, 8, 9, 31] {
            let a: Vec<f64> = (0..length).map(|i| f64::from(i) - 3.0).collect();
            let b: Vec<f64> = (0..length).map(|i| 2.0 * f64::from(i) + 1.0).collect();
            let expected: f64 = (0..length).map(|i| (f64::from(i) - 3.0) * (2.0 * f64::from(i) + 1.0)).sum();
            assert_eq!(dot(&a, &b), expected);
            let mut sum = a.clone();
            add_scaled(&mut sum, 0.5, &b);
            assert!(sum.iter().zip(&a).zip(&b).all(|((sum, a), b)| *sum == a + 0.5 * b));
        }
        assert_eq!(largest(&[1.0, -3.0, 2.0]), 3.0);
        assert_eq!(largest(&[1.0, f64::NAN, 2.0]), f64::INFINITY);
    }
}
