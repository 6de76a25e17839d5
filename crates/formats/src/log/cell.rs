//! What is read from a cell, and how a message quotes it.

use crate::text_file::printable;

/// Largest accepted difference of a logged quaternion's norm from one; within it the quaternion is normalised.
pub const QUATERNION_NORM_TOLERANCE: f64 = 0.01;

/// A cell as a message may quote it.
pub fn shortened(text: &str) -> String {
    const KEEP: usize = 40;
    let text = printable(text);
    if text.chars().count() <= KEEP { text } else { text.chars().take(KEEP).chain("...".chars()).collect() }
}

/// Seconds for people; never used for differences.
#[allow(clippy::cast_precision_loss)]
pub fn seconds(time_ns: i64) -> f64 {
    time_ns as f64 * 1e-9
}

/// Decimal seconds to nanoseconds without a detour through a float; digits beyond the ninth are rounded.
///
/// `None` for anything that is not a decimal number or does not fit in 64 bits.
pub fn parse_time_ns(text: &str) -> Option<i64> {
    let (mantissa, exponent) = match text.find(['e', 'E']) {
        Some(at) => (text.get(..at)?, text.get(at + 1..)?.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (negative, digits) = match mantissa.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, mantissa.strip_prefix('+').unwrap_or(mantissa)),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    if (whole.is_empty() && fraction.is_empty()) || !whole.bytes().chain(fraction.bytes()).all(|b| b.is_ascii_digit()) {
        return None;
    }
    // value = digits * 10^-scale nanoseconds
    let mut value: i128 = 0;
    let mut scale = i64::try_from(fraction.len()).ok()? - i64::from(exponent) - 9;
    for digit in whole.bytes().chain(fraction.bytes()) {
        if value > i128::MAX / 100 {
            // More than 36 significant digits: the rest is below a nanosecond or beyond 64 bits.
            scale -= 1;
            continue;
        }
        value = value * 10 + i128::from(digit - b'0');
    }
    if value == 0 {
        return Some(0);
    }
    while scale < 0 {
        value = value.checked_mul(10)?;
        scale += 1;
    }
    let mut round_up = false;
    while scale > 0 && value > 0 {
        round_up = value % 10 >= 5;
        value /= 10;
        scale -= 1;
    }
    value += i128::from(round_up && scale == 0);
    i64::try_from(if negative { -value } else { value }).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_exact_to_the_nanosecond() {
        for (text, ns) in [
            ("0", 0),
            ("1700000000.123456789", 1_700_000_000_123_456_789),
            ("-0.5", -500_000_000),
            (".25", 250_000_000),
            ("3.", 3_000_000_000),
            ("1.5e-3", 1_500_000),
            ("1.7e9", 1_700_000_000_000_000_000),
            ("0.0000000005", 1),
            ("0.0000000004999", 0),
            ("0.99999999999999999999999999999999999999999999", 1_000_000_000),
            ("+2", 2_000_000_000),
        ] {
            assert_eq!(parse_time_ns(text), Some(ns), "{text}");
        }
        for text in ["", ".", "-", "1e", "nan", "inf", "1e30", "99999999999", "1,5", "0x10", "1e-", "--1"] {
            assert_eq!(parse_time_ns(text), None, "{text}");
        }
    }
}
