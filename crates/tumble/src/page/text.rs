//! Text and numbers as a page may hold them.

use std::fmt::Write as _;

/// Text of the record inside an element or a quoted attribute. What neither HTML nor XML allows becomes U+FFFD.
pub(crate) fn escaped(text: &str) -> String {
    let mut page = String::with_capacity(text.len() + 16);
    for character in text.chars() {
        match character {
            '&' => page.push_str("&amp;"),
            '<' => page.push_str("&lt;"),
            '>' => page.push_str("&gt;"),
            '"' => page.push_str("&quot;"),
            '\'' => page.push_str("&#39;"),
            // Marks that turn the direction of what follows, after which a page says something else than its bytes do.
            '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{2028}' | '\u{2029}' | '\u{fffe}' | '\u{ffff}' => {
                page.push('\u{fffd}');
            }
            control if control.is_control() && control != '\n' && control != '\t' => page.push('\u{fffd}'),
            other => page.push(other),
        }
    }
    page
}

/// The exponent of ten of a finite number that is not zero.
fn exponent(value: f64) -> i32 {
    format!("{value:e}").rsplit_once('e').and_then(|(_, digits)| digits.parse().ok()).unwrap_or(0)
}

/// A power of ten, correctly rounded.
pub(crate) fn power_of_ten(exponent: i32) -> f64 {
    format!("1e{exponent}").parse().unwrap_or(1.0)
}

/// The largest of 1, 2 and 5 times a power of ten that is at most `value`; one where there is none.
pub(crate) fn round_down(value: f64) -> f64 {
    if !(value.is_finite() && value > 0.0) {
        return 1.0;
    }
    let unit = power_of_ten(exponent(value));
    let factor = [5.0, 2.0].into_iter().find(|factor| factor * unit <= value * (1.0 + 1e-9)).unwrap_or(1.0);
    factor * unit
}

fn superscript(number: i32) -> String {
    let digit = |character| match character {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        other => char::from_u32('⁰' as u32 + u32::from(other as u8 - b'0')).unwrap_or(other),
    };
    number.to_string().chars().map(digit).collect()
}

/// A power of ten in print.
pub(crate) fn decade(exponent: i32) -> String {
    format!("10{}", superscript(exponent))
}

/// A number with so many digits that count.
pub(crate) fn number(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let scientific = format!("{value:.*e}", digits.saturating_sub(1));
    let (mantissa, power) = scientific.rsplit_once('e').unwrap_or((&scientific, "0"));
    let power: i32 = power.parse().unwrap_or(0);
    let text = if value == 0.0 {
        "0".into()
    } else if (-4..6).contains(&power) {
        let decimals = i32::try_from(digits).unwrap_or(3) - 1 - power;
        format!("{value:.*}", usize::try_from(decimals).unwrap_or(0))
    } else {
        format!("{mantissa}×{}", decade(power))
    };
    text.replace('-', "\u{2212}")
}

/// An estimate and its standard deviation, both to two digits of the latter.
pub(crate) fn with_sigma(value: f64, sigma: f64) -> (String, String) {
    if !(sigma.is_finite() && sigma > 0.0) {
        return (number(value, 5), "–".into());
    }
    let decimals = usize::try_from(1 - exponent(sigma)).unwrap_or(0);
    if decimals > 8 {
        return (number(value, 5), number(sigma, 2));
    }
    let [value, sigma] = [value, sigma].map(|number| format!("{number:.decimals$}").replace('-', "\u{2212}"));
    (value, sigma)
}

/// A number with so many decimals, its trailing zeros left out.
pub(crate) fn coordinate(page: &mut String, value: f64) {
    let start = page.len();
    let _ = write!(page, "{value:.1}");
    if page.ends_with(".0") {
        page.truncate(page.len() - 2);
    }
    if page.get(start..) == Some("-0") {
        page.truncate(start);
        page.push('0');
    }
}

/// A number with the decimals that ticks of this distance need.
pub(crate) fn tick(value: f64, step: f64) -> String {
    let decimals = usize::try_from(-exponent(step)).unwrap_or(0);
    let text = format!("{value:.decimals$}");
    let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
    if is_zero { "0".into() } else { text.replace('-', "\u{2212}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        let cases = [(0.0, "0"), (11.6, "11.6"), (-0.0021, "−0.00210"), (1.0e9, "1.00×10⁹"), (2.5e-7, "2.50×10⁻⁷")];
        for (value, text) in cases {
            assert_eq!(number(value, 3), text);
        }
        assert_eq!(number(f64::NAN, 3), "–");
        assert_eq!(number(9.996, 3), "10.0");
        assert_eq!((tick(-0.2, 0.1), tick(1e-17, 0.1), tick(20.0, 10.0)), ("−0.2".into(), "0".into(), "20".into()));
    }

    #[test]
    fn an_estimate_has_the_digits_of_its_sigma() {
        assert_eq!(with_sigma(-9.581_234, 0.002_34), ("−9.5812".into(), "0.0023".into()));
        assert_eq!(with_sigma(123.456, 12.0), ("123".into(), "12".into()));
        assert_eq!(with_sigma(1.5, f64::NAN), ("1.5000".into(), "–".into()));
        assert_eq!(with_sigma(1.5e-9, 2.0e-12), ("1.5000×10⁻⁹".into(), "2.0×10⁻¹²".into()));
    }

    #[test]
    fn steps_are_round() {
        for (value, step) in
            [(0.7, 0.5), (1.0, 1.0), (4.9, 2.0), (30.0, 20.0), (0.05, 0.05), (f64::NAN, 1.0), (0.0, 1.0)]
        {
            assert!((round_down(value) - step).abs() < 1e-12, "{value}");
        }
    }

    #[test]
    fn no_text_leaves_its_element() {
        assert_eq!(escaped("a<b>&\"'"), "a&lt;b&gt;&amp;&quot;&#39;");
        assert_eq!(escaped("a\u{202e}b\u{0}c\nd"), "a\u{fffd}b\u{fffd}c\nd");
    }

    #[test]
    fn coordinates_are_short() {
        let mut page = String::new();
        for value in [1.0, -0.04, 2.25, -3.06] {
            coordinate(&mut page, value);
            page.push(' ');
        }
        assert_eq!(page, "1 0 2.2 -3.1 ");
    }
}
