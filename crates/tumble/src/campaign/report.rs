//! A campaign as text.

use super::analysis::{Analysis, Comparison, GroupSummary, Rate, Spread};
use super::row::PARAMETERS;
use std::fmt::Write as _;

/// Most comparisons that are printed; `summary.json` holds all.
const MOST_COMPARISONS: usize = 12;

/// Tables of rates, quantiles, parameters and differences.
pub fn table(analysis: &Analysis) -> String {
    let mut text = String::new();
    let all = &analysis.all;
    let _ = writeln!(
        text,
        "{} missions: {} flown, {} errors, {} panics; campaign seed {}",
        all.missions, all.flown, all.errors, all.panics, analysis.seed
    );
    let mut groups: Vec<&GroupSummary> = analysis.combinations.iter().collect();
    if groups.len() > 1 {
        groups.push(all);
    }
    let width = groups.iter().map(|group| group.label.chars().count()).max().unwrap_or(0).max(12);
    rates(&mut text, &groups, width);
    if all.flown > 0 {
        honesty(&mut text, &groups, width);
        spreads(&mut text, &groups, width);
        parameters(&mut text, &groups, width);
        comparisons(&mut text, &analysis.comparisons);
    }
    text
}

fn rates(text: &mut String, groups: &[&GroupSummary], width: usize) {
    let _ = writeln!(text, "\nhow often, with 95 % intervals (never in n missions: below 3/n)");
    let _ = writeln!(
        text,
        "{:<width$}  {:<30}{:<30}{:<30}{:<30}{:<30}",
        "", "arrived", "collisions", "limit violations", "with fallbacks", "in doubt at the end"
    );
    for group in groups {
        let _ = write!(text, "{:<width$}", group.label);
        for (rate, gap) in [
            (&group.arrived, "  "),
            (&group.collisions, ""),
            (&group.violations, ""),
            (&group.fallbacks, ""),
            (&group.doubted, ""),
        ] {
            let _ = write!(text, "{gap}{:<30}", shown_rate(rate));
        }
        end_line(text);
    }
}

/// What was doubted, and what plans promised.
fn honesty(text: &mut String, groups: &[&GroupSummary], width: usize) {
    let _ = writeln!(
        text,
        "\nhow often something was doubted (false alarms where the robot is healthy), and what plans promised to teach"
    );
    let _ = writeln!(
        text,
        "{:<width$}  {:<10}{:<10}{:<10}{:<12}{:<30}",
        "", "hours", "body", "map", "actuators", "promised sigma kept"
    );
    for group in groups {
        let [body, map, actuators] = group.alarms;
        let _ =
            write!(text, "{:<width$}  {:<10}{body:<10}{map:<10}{actuators:<12}", group.label, digits(group.flown_h));
        let _ = write!(text, "{:<30}", shown_rate(&group.promises_kept));
        end_line(text);
    }
}

/// A count, of how many, and the 95 % interval of its share.
pub(super) fn shown_rate(rate: &Rate) -> String {
    let of = format!("{}/{}", rate.count, rate.of);
    match (rate.bound_of_none, rate.low, rate.high) {
        (Some(bound), ..) => format!("{of} (below {:.3} %)", 100.0 * bound),
        (None, Some(low), Some(high)) => format!("{of} ({:.2} to {:.2} %)", 100.0 * low, 100.0 * high),
        _ => of,
    }
}

fn spreads(text: &mut String, groups: &[&GroupSummary], width: usize) {
    let _ = writeln!(text, "\nmedian / 95 % are below (clearance: median / least)");
    let names = [
        "clearance m",
        "time s",
        "impulse N s",
        "tracking mm",
        "last leg mm",
        "mass error %",
        "inertia error %",
        "CoM error mm",
    ];
    let _ = write!(text, "{:<width$}", "");
    for name in names {
        let _ = write!(text, "  {name:<16}");
    }
    end_line(text);
    for group in groups {
        let _ = write!(text, "{:<width$}", group.label);
        let clearance = group.min_clearance_m.map(|spread| (spread.median, spread.min, 1.0));
        let upper = |spread: Option<Spread>, factor| spread.map(|spread| (spread.median, spread.p95, factor));
        for pair in [
            clearance,
            upper(group.mission_s, 1.0),
            upper(group.impulse_n_s, 1.0),
            upper(group.rms_tracking_all_m, 1000.0),
            upper(group.rms_tracking_last_leg_m, 1000.0),
            upper(group.mass_error_percent, 1.0),
            upper(group.inertia_error_percent, 1.0),
            upper(group.com_error_mm, 1.0),
        ] {
            let shown = pair
                .map_or("-".to_owned(), |(a, b, factor)| format!("{} / {}", digits(a * factor), digits(b * factor)));
            let _ = write!(text, "  {shown:<16}");
        }
        end_line(text);
    }
}

fn parameters(text: &mut String, groups: &[&GroupSummary], width: usize) {
    let _ = writeln!(text, "\nshare of missions with the error within twice the stated standard deviation, %");
    let _ = write!(text, "{:<width$}", "");
    for name in PARAMETERS {
        let _ = write!(text, "  {name:<10}");
    }
    end_line(text);
    for group in groups {
        let _ = write!(text, "{:<width$}", group.label);
        for parameter in &group.parameters {
            let rate = parameter.within_2_sigma;
            let share = if rate.of == 0 {
                "-".to_owned()
            } else {
                format!("{:.1}", 100.0 * rate.count as f64 / rate.of as f64)
            };
            let _ = write!(text, "  {share:<10}");
        }
        end_line(text);
    }
}

fn comparisons(text: &mut String, comparisons: &[Comparison]) {
    for comparison in comparisons.iter().take(MOST_COMPARISONS) {
        let _ = writeln!(
            text,
            "\n{} against {}: median difference over {} seeds that both flew, with 95 % interval",
            comparison.other, comparison.baseline, comparison.pairs
        );
        for difference in &comparison.differences {
            let interval = match (difference.low, difference.high) {
                (Some(low), Some(high)) => format!("{} to {}", digits(low), digits(high)),
                _ => "no interval".to_owned(),
            };
            let _ = writeln!(
                text,
                "  {:<26}{:<12}({interval}); medians {} and {}",
                difference.quantity,
                digits(difference.median),
                digits(difference.other_median),
                digits(difference.baseline_median)
            );
        }
    }
    if comparisons.len() > MOST_COMPARISONS {
        let _ = writeln!(text, "\n{} more comparisons stand in summary.json", comparisons.len() - MOST_COMPARISONS);
    }
}

/// Three significant digits.
fn digits(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    if !(1e-3..1e5).contains(&magnitude) {
        return format!("{value:.2e}");
    }
    #[allow(clippy::cast_possible_truncation)] // -3 to 4
    let decimals = (2 - magnitude.log10().floor() as i32).clamp(0, 6);
    format!("{value:.*}", usize::try_from(decimals).unwrap_or(0))
}

/// Ends a line without spaces at its end.
fn end_line(text: &mut String) {
    text.truncate(text.trim_end_matches(' ').len());
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_three_digits() {
        let cases = [
            (0.0, "0"),
            (1234.5, "1234"),
            (12.345, "12.3"),
            (0.123_45, "0.123"),
            (-0.004_567, "-0.00457"),
            (1.2e-7, "1.20e-7"),
        ];
        for (value, expected) in cases {
            assert_eq!(digits(value), expected);
        }
    }

    #[test]
    fn never_is_said_with_its_bound() {
        assert_eq!(shown_rate(&Rate::new(0, 1000)), "0/1000 (below 0.300 %)");
        assert_eq!(shown_rate(&Rate::new(1000, 1000)), "1000/1000 (99.62 to 100.00 %)");
        assert_eq!(shown_rate(&Rate::new(0, 0)), "0/0");
    }
}
