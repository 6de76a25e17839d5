//! Pictures of a campaign: how errors and clearances are distributed.

use super::CampaignPlan;
use super::row::{Row, column};
use crate::TumbleError;
use crate::figure::{Curve, Figure};
use crate::output::OutputFolder;

/// Curves that a picture holds.
const CURVES: usize = 3;
/// Points of a curve.
const POINTS: usize = 400;

/// File, title, axis, column, factor.
const PICTURES: [(&str, &str, &str, &str, f64); 3] = [
    (
        "clearance.svg",
        "Share of missions that came nearer than this to anything",
        "least clearance, m",
        "min_clearance_m",
        1.0,
    ),
    (
        "tracking_error.svg",
        "Share of missions that tracked better than this",
        "tracking error, root mean square, mm",
        "rms_tracking_all_m",
        1000.0,
    ),
    ("mission_time.svg", "Share of missions that were over sooner", "mission time, s", "mission_s", 1.0),
];

/// Draws distributions, one curve for each of up to three levels of the first factor that varies.
pub(super) fn draw(folder: &OutputFolder, plan: &CampaignPlan, rows: &[Row]) -> Result<(), TumbleError> {
    let levels = plan.drawn_levels();
    let names: Vec<&str> = levels.iter().map(|(name, _)| name.as_str()).take(CURVES).collect();
    let level_of = |row: &Row| {
        let combination = plan.mission(row.number)?.combination;
        levels.iter().position(|(_, members)| members.contains(&combination))
    };
    let of_level: Vec<Option<usize>> = rows.iter().map(level_of).collect();
    for (file, title, x_label, name, factor) in PICTURES {
        let Some(index) = column(name) else { continue };
        let points = |level: usize| {
            let values = rows.iter().zip(&of_level).filter(|(_, of)| **of == Some(level));
            distribution(values.filter_map(|(row, _)| row.number(index)).map(|value| value * factor).collect())
        };
        let curves: Vec<Curve<'_>> =
            names.iter().enumerate().map(|(level, name)| Curve { name, points: points(level) }).collect();
        if curves.iter().all(|curve| curve.points.is_empty()) {
            continue;
        }
        let figure = Figure { title, x_label, y_label: "share of missions", curves, band: None, equal_scales: false };
        figure.draw(&folder.file(file))?;
    }
    Ok(())
}

/// The empirical distribution: steps, thinned where there are very many.
fn distribution(mut values: Vec<f64>) -> Vec<(f64, f64)> {
    values.retain(|value| value.is_finite());
    values.sort_unstable_by(f64::total_cmp);
    let count = values.len();
    let stride = count / POINTS + 1;
    let mut points = Vec::new();
    for (index, value) in values.iter().enumerate() {
        if index % stride == 0 || index + 1 == count {
            let before = points.last().map_or(0.0, |point: &(f64, f64)| point.1);
            points.push((*value, before));
            points.push((*value, (index + 1) as f64 / count as f64));
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distribution_rises_from_nothing_to_one() {
        assert_eq!(distribution(vec![3.0, 1.0, f64::NAN]), [(1.0, 0.0), (1.0, 0.5), (3.0, 0.5), (3.0, 1.0)]);
        let many = distribution((0..10_001).map(f64::from).collect());
        assert!(many.len() <= 2 * POINTS + 2);
        assert_eq!((many.first().copied(), many.last().copied()), (Some((0.0, 0.0)), Some((10_000.0, 1.0))));
        assert!(many.windows(2).all(|pair| pair[0].0 <= pair[1].0 && pair[0].1 <= pair[1].1));
        assert!(distribution(Vec::new()).is_empty());
    }
}
