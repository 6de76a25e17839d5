//! Numbers of 106 bits, for what 53 cannot decide.
//!
//! Only additions, multiplications, divisions and roots that IEEE 754 defines to the last bit, so that every machine gets
//! the same; no fused operation.
//!
//! # Source
//! Dekker, "A floating-point technique for extending the available precision", Numerische Mathematik 18 (1971).

use std::ops::{Add, Div, Mul, Sub};

/// What the contact function is computed in.
pub(super) trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Twenty roundings: bounds the error of every sum of products here, relative to the size of its terms.
    const ROUNDING: f64;

    /// A number exactly.
    fn exact(value: f64) -> Self;

    /// The nearest `f64`.
    fn nearest(self) -> f64;

    /// The difference of two numbers, as good as the kind allows.
    fn difference(left: f64, right: f64) -> Self;

    /// Square root.
    fn root(self) -> Self;
}

impl Real for f64 {
    const ROUNDING: f64 = 10.0 * f64::EPSILON;

    #[inline(always)]
    fn exact(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn nearest(self) -> f64 {
        self
    }

    #[inline(always)]
    fn difference(left: f64, right: f64) -> Self {
        left - right
    }

    #[inline(always)]
    fn root(self) -> Self {
        f64::sqrt(self)
    }
}

/// An unevaluated sum `high + low` with `high` nearest to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct DoubleDouble {
    high: f64,
    low: f64,
}

impl DoubleDouble {
    /// `left + right` exactly.
    fn sum(left: f64, right: f64) -> Self {
        let high = left + right;
        let of_right = high - left;
        Self { high, low: (left - (high - of_right)) + (right - of_right) }
    }

    /// `large + small` exactly, where `large` is zero or not the smaller.
    fn ordered_sum(large: f64, small: f64) -> Self {
        let high = large + small;
        Self { high, low: small - (high - large) }
    }

    /// `left * right` exactly, short of overflow and underflow.
    fn product(left: f64, right: f64) -> Self {
        let high = left * right;
        let ((left_high, left_low), (right_high, right_low)) = (split(left), split(right));
        let low =
            left_low * right_low - (((high - left_high * right_high) - left_low * right_high) - left_high * right_low);
        Self { high, low }
    }
}

/// A number as the sum of two of 26 bits, whose products are exact.
fn split(value: f64) -> (f64, f64) {
    const SPLITTER: f64 = 134_217_729.0; // 2^27 + 1
    let scaled = SPLITTER * value;
    let high = scaled - (scaled - value);
    (high, value - high)
}

impl Add for DoubleDouble {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (high, low) = (Self::sum(self.high, other.high), Self::sum(self.low, other.low));
        let first = Self::ordered_sum(high.high, high.low + low.high);
        Self::ordered_sum(first.high, first.low + low.low)
    }
}

impl Sub for DoubleDouble {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + Self { high: -other.high, low: -other.low }
    }
}

impl Mul for DoubleDouble {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let product = Self::product(self.high, other.high);
        Self::ordered_sum(product.high, product.low + (self.high * other.low + self.low * other.high))
    }
}

impl Div for DoubleDouble {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * Self::exact(first);
        let second = rest.high / other.high;
        let rest = rest - other * Self::exact(second);
        Self::ordered_sum(first, second) + Self::exact(rest.high / other.high)
    }
}

impl Real for DoubleDouble {
    /// Each operation errs by less than 2^-102; this leaves a factor of 12.
    const ROUNDING: f64 = 10.0 * f64::EPSILON * f64::EPSILON;

    fn exact(value: f64) -> Self {
        Self { high: value, low: 0.0 }
    }

    fn nearest(self) -> f64 {
        self.high
    }

    fn difference(left: f64, right: f64) -> Self {
        Self::sum(left, -right)
    }

    fn root(self) -> Self {
        let first = f64::sqrt(self.high);
        // Zero has no reciprocal; what is negative or no number stays one.
        if first == 0.0 {
            return Self::exact(0.0);
        }
        let rest = self - Self::product(first, first);
        Self::ordered_sum(first, rest.high / (2.0 * first))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: DoubleDouble, high: f64, low: f64) -> bool {
        let error = found - DoubleDouble { high, low };
        error.high.abs() <= 1e-30 * high.abs()
    }

    // The constants were split by decimal arithmetic of 60 digits.
    #[test]
    fn operations_hold_thirty_digits() {
        let third = DoubleDouble::exact(1.0) / DoubleDouble::exact(3.0);
        assert!(near(third, 0.333_333_333_333_333_3, 1.850_371_707_708_594e-17));
        let root = DoubleDouble::exact(2.0).root();
        assert!(near(root, std::f64::consts::SQRT_2, -9.667_293_313_452_913e-17));
        assert!(near(root * root, 2.0, 0.0));
        assert!(near((third + root) - root, third.high, third.low));
        let one = DoubleDouble::difference(1.0, 1e-30);
        assert_eq!((one.high, one.low), (1.0, -1e-30));
        assert!(((DoubleDouble::exact(1.0) - one).high - 1e-30).abs() < 1e-45);
        assert!(DoubleDouble::exact(0.0).root().nearest().abs() < f64::MIN_POSITIVE);
    }

    #[test]
    fn products_are_exact() {
        // Two numbers of 53 bits.
        let product = DoubleDouble::product(7_205_759_403_792_793.0, 8_106_479_329_266_893.0);
        let exact = 7_205_759_403_792_793_i128 * 8_106_479_329_266_893_i128;
        #[allow(clippy::cast_possible_truncation)]
        let found = product.high as i128 + product.low as i128;
        assert_eq!(found, exact);
    }
}
