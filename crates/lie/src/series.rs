//! Entire functions of the squared angle: the one home of small-angle code.
//!
//! Every function takes `s = theta^2` and branches on `s`, so that values and derivatives are right on both sides
//! and no square root is taken near zero.

use crate::scalar::{Scalar, real};

/// Below this squared angle the Taylor polynomials are used; they are exact to rounding there.
const SMALL: f64 = 1.0;

#[inline(always)]
fn horner<T: Scalar, const N: usize>(s: T, coefficients: &[f64; N]) -> T {
    let mut value = T::zero();
    for c in coefficients.iter().rev() {
        value = value * s + real(*c);
    }
    value
}

const SINC: [f64; 10] = alternating_factorials(1);
const VERSINE: [f64; 10] = alternating_factorials(2);
const THIRD: [f64; 10] = alternating_factorials(3);
/// Taylor coefficients of `(1 - (theta/2) cot(theta/2)) / theta^2` in `theta^2`: `|B_{2k+2}| / (2k+2)!`.
const COTANGENT: [f64; 12] = [
    1.0 / 12.0,
    1.0 / 720.0,
    1.0 / 30_240.0,
    1.0 / 1_209_600.0,
    1.0 / 47_900_160.0,
    691.0 / 1_307_674_368_000.0,
    1.0 / 74_724_249_600.0,
    3617.0 / 10_670_622_842_880_000.0,
    43867.0 / 5_109_094_217_170_944_000.0,
    174_611.0 / 802_857_662_698_291_200_000.0,
    77_683.0 / 14_101_100_039_391_805_440_000.0,
    236_364_091.0 / 1_693_824_136_731_743_669_452_800_000.0,
];

/// `(-1)^k / (2k + first)!`
const fn alternating_factorials(first: usize) -> [f64; 10] {
    let mut coefficients = [0.0; 10];
    let mut k = 0;
    while k < 10 {
        let mut factorial = 1.0;
        let mut n = 2;
        while n <= 2 * k + first {
            factorial *= n as f64;
            n += 1;
        }
        coefficients[k] = if k % 2 == 0 { 1.0 / factorial } else { -1.0 / factorial };
        k += 1;
    }
    coefficients
}

const fn derivative<const N: usize, const M: usize>(coefficients: &[f64; N]) -> [f64; M] {
    let mut result = [0.0; M];
    let mut k = 0;
    while k < M {
        result[k] = (k + 1) as f64 * coefficients[k + 1];
        k += 1;
    }
    result
}
const VERSINE_RATE: [f64; 9] = derivative(&VERSINE);
const THIRD_RATE: [f64; 9] = derivative(&THIRD);
const COTANGENT_RATE: [f64; 11] = derivative(&COTANGENT);

/// `(sin(theta) / theta, cos(theta))`.
#[inline(always)]
pub fn sinc_cos<T: Scalar>(s: T) -> (T, T) {
    if s < real(SMALL) {
        let versine = horner(s, &VERSINE);
        (horner(s, &SINC), T::one() - s * versine)
    } else {
        let theta = s.sqrt();
        let (sin, cos) = theta.sin_cos();
        (sin / theta, cos)
    }
}

/// `((1 - cos)/theta^2, (theta - sin)/theta^3)`: coefficients of the Jacobian of the exponential of rotations.
#[inline(always)]
pub fn jacobian<T: Scalar>(s: T) -> (T, T) {
    if s < real(SMALL) {
        (horner(s, &VERSINE), horner(s, &THIRD))
    } else {
        let theta = s.sqrt();
        let (sin, cos) = theta.sin_cos();
        ((T::one() - cos) / s, (T::one() - sin / theta) / s)
    }
}

/// The two coefficients of [`jacobian`], then their derivatives with respect to `s`.
#[inline(always)]
pub fn jacobian_with_rates<T: Scalar>(s: T) -> ((T, T), (T, T)) {
    if s < real(SMALL) {
        ((horner(s, &VERSINE), horner(s, &THIRD)), (horner(s, &VERSINE_RATE), horner(s, &THIRD_RATE)))
    } else {
        let half = real::<T>(0.5);
        let theta = s.sqrt();
        let (sin, cos) = theta.sin_cos();
        let per_s = T::one() / s;
        let sinc = sin / theta;
        let (a, b) = ((T::one() - cos) * per_s, (T::one() - sinc) * per_s);
        let sinc_rate = (cos - sinc) * per_s * half;
        ((a, b), ((sinc * half - a) * per_s, -(sinc_rate + b) * per_s))
    }
}

/// `(1 - (theta/2) cot(theta/2)) / theta^2`: coefficient of the inverse Jacobian; then its derivative with respect to `s`.
#[inline(always)]
pub fn inverse_jacobian_with_rate<T: Scalar>(s: T) -> (T, T) {
    if s < real(SMALL) {
        (horner(s, &COTANGENT), horner(s, &COTANGENT_RATE))
    } else {
        let half = real::<T>(0.5);
        let half_theta = s.sqrt() * half;
        let (sin, cos) = half_theta.sin_cos();
        let per_sin = T::one() / sin;
        let u = half_theta * cos * per_sin;
        let per_s = T::one() / s;
        // d/ds of h cot h with h = theta/2: (h cot h - h^2 / sin^2 h) / (2 s)
        let ratio = half_theta * per_sin;
        let u_rate = (u - ratio * ratio) * per_s * half;
        let c = (T::one() - u) * per_s;
        (c, -(u_rate + c) * per_s)
    }
}
