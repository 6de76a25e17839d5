//! Functions of the rotation angle: the one home of series, and the reason why no other file branches on an angle.
//!
//! Every function takes `s = theta^2` (or the scalar part of a quaternion), of which it is analytic: no square root, no
//! division and no branch near zero, so values and derivatives (dual numbers) are right there without a special case.
//! Rotations up to half a turn use one polynomial each, exact to rounding and built from additions and multiplications
//! only, which give equal bytes on every processor; longer rotation vectors use the closed forms.

use crate::scalar::{Scalar, real};

mod tables;

/// End of the interval of `s` the polynomials cover, slightly more than `pi^2`.
const END: f64 = 10.0;

/// The polynomials whose coefficients are the columns of `table`, at `x`; even and odd powers in parallel.
#[inline(always)]
fn polynomials<T: Scalar, const M: usize, const N: usize>(x: T, table: &[[f64; M]; N]) -> [T; M] {
    let x2 = x * x;
    let (mut even, mut odd) = ([T::zero(); M], [T::zero(); M]);
    for pair in table.chunks(2).rev() {
        if let [first, rest @ ..] = pair {
            for (sum, c) in even.iter_mut().zip(first) {
                *sum = *sum * x2 + real(*c);
            }
            for (sum, c) in odd.iter_mut().zip(rest.iter().flatten()) {
                *sum = *sum * x2 + real(*c);
            }
        }
    }
    for (sum, odd) in even.iter_mut().zip(odd) {
        *sum += odd * x;
    }
    even
}

/// Functions of half the rotation angle `theta`, from `s = theta^2`.
#[derive(Clone, Copy, Debug)]
pub struct HalfAngle<T> {
    /// `sin(theta/2) / (theta/2)`
    pub sinc: T,
    /// `cos(theta/2)`
    pub cos: T,
    /// Derivative of `sinc` with respect to `s`.
    pub sinc_rate: T,
}

/// `sin(theta/2) / (theta/2)` and its companions.
#[inline(always)]
pub fn half_angle<T: Scalar>(s: T) -> HalfAngle<T> {
    if s <= real(END) {
        let [sinc, cos, sinc_rate] = polynomials(s, &tables::HALF_ANGLE);
        HalfAngle { sinc, cos, sinc_rate }
    } else {
        let half = s.sqrt() * real(0.5);
        let (sin, cos) = half.sin_cos();
        let sinc = sin / half;
        HalfAngle { sinc, cos, sinc_rate: (cos - sinc) / (s * real(2.0)) }
    }
}

/// Coefficients of the Jacobian of the exponential of rotations, from `s = theta^2`.
#[derive(Clone, Copy, Debug)]
pub struct Jacobian<T> {
    /// `(1 - cos(theta)) / theta^2`
    pub a: T,
    /// `(theta - sin(theta)) / theta^3`
    pub b: T,
    /// Derivative of `a` with respect to `s`.
    pub a_rate: T,
    /// Derivative of `b` with respect to `s`.
    pub b_rate: T,
}

/// The coefficients of the Jacobian.
#[inline(always)]
pub fn jacobian<T: Scalar>(s: T) -> Jacobian<T> {
    if s <= real(END) {
        let [a, b, a_rate, b_rate] = polynomials(s, &tables::JACOBIAN);
        Jacobian { a, b, a_rate, b_rate }
    } else {
        let theta = s.sqrt();
        let (sin, cos) = theta.sin_cos();
        let sinc = sin / theta;
        let half = real::<T>(0.5);
        let (a, b) = ((T::one() - cos) / s, (T::one() - sinc) / s);
        Jacobian { a, b, a_rate: (sinc * half - a) / s, b_rate: ((a - b) * half - b) / s }
    }
}

/// Coefficient of the inverse Jacobian of the exponential of rotations, from `s = theta^2`.
#[derive(Clone, Copy, Debug)]
pub struct InverseJacobian<T> {
    /// `(1 - (theta/2) cot(theta/2)) / theta^2`
    pub c: T,
    /// Derivative of `c` with respect to `s`.
    pub c_rate: T,
}

/// The coefficient of the inverse Jacobian, which does not exist at whole turns.
#[inline(always)]
pub fn inverse_jacobian<T: Scalar>(s: T) -> InverseJacobian<T> {
    if s <= real(END) {
        let [c, c_rate] = polynomials(s, &tables::INVERSE_JACOBIAN);
        InverseJacobian { c, c_rate }
    } else {
        let half_theta = s.sqrt() * real(0.5);
        let (sin, cos) = half_theta.sin_cos();
        let ratio = half_theta / sin;
        let u = ratio * cos;
        let c = (T::one() - u) / s;
        // d/ds of h cot h with h = theta/2 is (h cot h - h^2 / sin^2 h) / (2 s)
        InverseJacobian { c, c_rate: ((ratio * ratio - u) / (s * real(2.0)) - c) / s }
    }
}

/// Coefficients of the logarithm of the unit quaternion with scalar part `cos(h) >= 0`, `h` half the angle.
#[derive(Clone, Copy, Debug)]
pub struct Logarithm<T> {
    /// `h / sin(h)`
    pub g: T,
    /// `(1 - h cot(h)) / (2 h)^2`: [`InverseJacobian::c`] of the rotation.
    pub c: T,
}

/// The coefficients of the logarithm, from `cos(h)` in `0..=1`.
#[inline(always)]
pub fn logarithm<T: Scalar>(cos: T) -> Logarithm<T> {
    let [g, c] = polynomials(T::one() - cos, &tables::LOGARITHM);
    Logarithm { g, c }
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // exact at zero
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// `sum (-1)^k s^k / (2k + first)!` and its derivative, summed from the smallest term.
    fn taylor(s: f64, first: u32) -> (f64, f64) {
        let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
        (0..40).rev().fold((0.0, 0.0), |(value, rate), k| {
            let c = if k % 2 == 0 { 1.0 } else { -1.0 } / factorial(2 * k + first);
            let n = k.cast_signed();
            let rate_term = if k == 0 { 0.0 } else { f64::from(k) * c * s.powi(n - 1) };
            (value + c * s.powi(n), rate + rate_term)
        })
    }

    /// Polynomials against Taylor sums, closed forms against both, on both sides of the end of the interval.
    #[test]
    fn functions_equal_their_taylor_series() {
        for k in 0..=480 {
            let s = f64::from(k) * 0.025;
            let (h, j) = (half_angle(s), jacobian(s));
            let tolerance = 2e-15;
            assert_relative_eq!(h.sinc, taylor(s / 4.0, 1).0, epsilon = tolerance);
            assert_relative_eq!(h.cos, taylor(s / 4.0, 0).0, epsilon = tolerance);
            assert_relative_eq!(h.sinc_rate, taylor(s / 4.0, 1).1 / 4.0, epsilon = tolerance);
            assert_relative_eq!(j.a, taylor(s, 2).0, epsilon = tolerance);
            assert_relative_eq!(j.b, taylor(s, 3).0, epsilon = tolerance);
            assert_relative_eq!(j.a_rate, taylor(s, 2).1, epsilon = tolerance);
            assert_relative_eq!(j.b_rate, taylor(s, 3).1, epsilon = tolerance);
        }
    }

    /// The inverse coefficient satisfies its defining identity
    /// `(1 - s c) sinc(t/2) = cos(t/2)`, and its rate the derivative of that identity.
    #[test]
    fn inverse_coefficient_solves_its_identity() {
        for k in 0..=480 {
            let s = f64::from(k) * 0.025;
            let (h, InverseJacobian { c, c_rate }) = (half_angle(s), inverse_jacobian(s));
            assert_relative_eq!((1.0 - s * c) * h.sinc, h.cos, epsilon = 2e-15);
            // d cos(t/2) / ds = -sinc(t/2) / 8
            let rate = -(c + s * c_rate) * h.sinc + (1.0 - s * c) * h.sinc_rate;
            assert_relative_eq!(rate, -h.sinc / 8.0, epsilon = 2e-15);
        }
        assert_eq!(inverse_jacobian(0.0_f64).c, 1.0 / 12.0);
        assert_eq!(inverse_jacobian(0.0_f64).c_rate, 1.0 / 720.0);
    }

    #[test]
    fn logarithm_equals_the_arc_cosine() {
        for k in 0..=1000 {
            let cos = f64::from(k) / 1000.0;
            let h = cos.acos();
            let Logarithm { g, c } = logarithm(cos);
            assert_relative_eq!(g * (1.0 - cos * cos).sqrt(), h, epsilon = 1e-15);
            assert_relative_eq!(c, inverse_jacobian(4.0 * h * h).c, epsilon = 1e-16);
        }
        assert_eq!(logarithm(1.0_f64).g, 1.0);
    }
}
