//! Pictures of studies: curves, points with a heat, boxes; values on a linear or a logarithmic axis.

use std::path::Path;

use plotters::prelude::*;

use crate::Failure;

/// One named curve.
pub struct Curve {
    pub name: String,
    /// A point whose x is not a number ends a line, and the next one begins another.
    pub points: Vec<(f64, f64)>,
}

/// How values are drawn.
#[derive(Clone, Copy, PartialEq)]
pub enum Scale {
    Linear,
    Logarithmic,
}

const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 90, 181),
    RGBColor(220, 50, 32),
    RGBColor(26, 133, 84),
    RGBColor(150, 90, 200),
    RGBColor(230, 150, 0),
    RGBColor(90, 90, 90),
];

/// Draws the curves into an SVG file.
pub fn draw(path: &Path, title: &str, labels: [&str; 2], scale: Scale, curves: &[Curve]) -> Result<(), Failure> {
    draw_with(path, title, labels, scale, curves).map_err(|error| Failure::file(path, error))
}

/// The lines of a curve: what has no place on the axes is left out.
fn lines(points: &[(f64, f64)], place: impl Fn(f64) -> f64) -> Vec<Vec<(f64, f64)>> {
    let line = |points: &[(f64, f64)]| -> Vec<(f64, f64)> {
        let points = points.iter().map(|&(x, y)| (x, place(y)));
        points.filter(|(x, y)| x.is_finite() && y.is_finite()).collect()
    };
    points.split(|(x, _)| x.is_nan()).map(line).collect()
}

fn draw_with(
    path: &Path,
    title: &str,
    [x_label, y_label]: [&str; 2],
    scale: Scale,
    curves: &[Curve],
) -> Result<(), Box<dyn std::error::Error>> {
    let logarithmic = scale == Scale::Logarithmic;
    let place = |y: f64| if logarithmic { y.log10() } else { y };
    let drawn: Vec<Vec<Vec<(f64, f64)>>> = curves.iter().map(|curve| lines(&curve.points, place)).collect();
    let all = || drawn.iter().flatten().flatten();
    let (left, right) = all().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, r), p| (l.min(p.0), r.max(p.0)));
    let (low, high) = all().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.1), h.max(p.1)));
    if left >= right || low > high {
        return Err("nothing to draw".into());
    }
    let pad = (0.05 * (high - low)).max(1e-12);
    let root = SVGBackend::new(path, (900, 420)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 20))
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(80)
        .build_cartesian_2d(left..right, (low - pad)..(high + pad))?;
    chart
        .configure_mesh()
        .x_desc(x_label)
        .y_desc(y_label)
        .light_line_style(WHITE)
        .y_label_formatter(&|y| if logarithmic { format!("{:.1e}", 10.0_f64.powf(*y)) } else { format!("{y:.3}") })
        .draw()?;
    for ((curve, lines), colour) in curves.iter().zip(&drawn).zip(COLOURS.iter().cycle().copied()) {
        let lines = lines.iter().map(|points| PathElement::new(points.clone(), colour));
        chart
            .draw_series(lines)?
            .label(&curve.name)
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour));
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3)).draw()?;
    root.present()?;
    Ok(())
}

/// A point whose colour says a third number.
#[derive(Clone, Copy)]
pub struct Point {
    pub x: f64,
    pub y: f64,
    pub heat: f64,
}

/// What a panel shows.
pub enum Marks {
    Curves(Vec<Curve>),
    Points {
        /// What the colours say.
        heat: &'static str,
        points: Vec<Point>,
    },
    /// Quartiles, whiskers to the farthest value within one and a half times the distance of the quartiles, the rest as points.
    Boxes(Vec<(String, Vec<f64>)>),
}

/// One coordinate system of several in a picture.
pub struct Panel<'a> {
    /// Of x and y.
    pub labels: [&'a str; 2],
    pub scale: Scale,
    pub marks: Marks,
}

/// Draws panels side by side into an SVG file.
pub fn panels(path: &Path, title: &str, panels: &[Panel]) -> Result<(), Failure> {
    panels_with(path, title, panels).map_err(|error| Failure::file(path, error))
}

type Boxed<T> = Result<T, Box<dyn std::error::Error>>;

fn panels_with(path: &Path, title: &str, panels: &[Panel]) -> Boxed<()> {
    let width = if panels.len() == 1 { 900 } else { 1200 };
    let root = SVGBackend::new(path, (width, 420)).into_drawing_area();
    root.fill(&WHITE)?;
    let root = root.titled(title, ("sans-serif", 20))?;
    for (area, panel) in root.split_evenly((1, panels.len())).iter().zip(panels) {
        draw_panel(area, panel)?;
    }
    root.present()?;
    Ok(())
}

/// From blue for the least heat over yellow to red for the most.
fn heat_colour(heat: f64, [least, most]: [f64; 2]) -> RGBColor {
    let part = if most > least { (heat - least) / (most - least) } else { 0.0 };
    let stops = [(0.0, 90.0, 181.0), (240.0, 190.0, 40.0), (200.0, 30.0, 30.0)];
    let (from, to, way) =
        if part < 0.5 { (stops[0], stops[1], 2.0 * part) } else { (stops[1], stops[2], 2.0 * part - 1.0) };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 255")]
    let mix = |a: f64, b: f64| (a + way * (b - a)) as u8;
    RGBColor(mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
}

fn draw_panel(area: &DrawingArea<SVGBackend, plotters::coord::Shift>, panel: &Panel) -> Boxed<()> {
    let logarithmic = panel.scale == Scale::Logarithmic;
    let place = |y: f64| if logarithmic { y.log10() } else { y };
    let points: Vec<(f64, f64)> = match &panel.marks {
        Marks::Curves(curves) => curves.iter().flat_map(|curve| curve.points.iter().copied()).collect(),
        Marks::Points { points, .. } => points.iter().map(|point| (point.x, point.y)).collect(),
        Marks::Boxes(boxes) => boxes
            .iter()
            .enumerate()
            .flat_map(|(i, (_, values))| values.iter().flat_map(move |y| [(i as f64 - 0.5, *y), (i as f64 + 0.5, *y)]))
            .collect(),
    };
    let all = || points.iter().map(|(x, y)| (*x, place(*y))).filter(|(x, y)| x.is_finite() && y.is_finite());
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        let pad = (0.05 * (high - low)).max(1e-9);
        if low <= high { (low - pad)..(high + pad) } else { 0.0..1.0 }
    };
    let (x_range, y_range) = (range(&mut all().map(|p| p.0)), range(&mut all().map(|p| p.1)));
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .x_label_area_size(40)
        .y_label_area_size(70)
        .build_cartesian_2d(x_range, y_range)?;
    let names: &[(String, Vec<f64>)] = if let Marks::Boxes(boxes) = &panel.marks { boxes } else { &[] };
    let x_label = |x: &f64| match names {
        [] => format!("{x:.0}"),
        names => {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small whole number")]
            let name = names.get(x.round().max(0.0) as usize);
            name.filter(|_| *x > -0.5 && (x - x.round()).abs() < 1e-6)
                .map_or_else(String::new, |(name, _)| name.clone())
        }
    };
    chart
        .configure_mesh()
        .x_desc(panel.labels[0])
        .y_desc(panel.labels[1])
        .x_labels(if names.is_empty() { 8 } else { names.len() + 2 })
        .x_label_formatter(&x_label)
        .light_line_style(WHITE)
        .y_label_formatter(&|y| if logarithmic { format!("{:.1e}", 10.0_f64.powf(*y)) } else { format!("{y:.2}") })
        .draw()?;
    match &panel.marks {
        Marks::Curves(curves) => {
            for (curve, colour) in curves.iter().zip(COLOURS.iter().cycle()) {
                let points = || curve.points.iter().map(|(x, y)| (*x, place(*y))).filter(|(_, y)| y.is_finite());
                chart.draw_series(LineSeries::new(points(), colour))?;
                chart.draw_series(points().map(|point| Circle::new(point, 3, colour.filled())))?;
            }
        }
        Marks::Points { heat, points } => {
            let heats = points.iter().map(|point| point.heat);
            let ends = heats.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], x| [l.min(x), h.max(x)]);
            let drawn = points.iter().filter(|point| place(point.y).is_finite());
            chart.draw_series(
                drawn.map(|p| Circle::new((p.x, place(p.y)), 3, heat_colour(p.heat, ends).mix(0.8).filled())),
            )?;
            for value in [ends[0], 0.5 * (ends[0] + ends[1]), ends[1]] {
                let colour = heat_colour(value, ends);
                let none = std::iter::empty::<Circle<(f64, f64), i32>>();
                chart
                    .draw_series(none)?
                    .label(format!("{heat} {value:.0}"))
                    .legend(move |(x, y)| Circle::new((x + 9, y), 4, colour.filled()));
            }
            chart
                .configure_series_labels()
                .position(SeriesLabelPosition::UpperLeft)
                .background_style(WHITE.mix(0.8))
                .border_style(BLACK.mix(0.3))
                .draw()?;
        }
        Marks::Boxes(boxes) => {
            for ((i, (_, values)), colour) in boxes.iter().enumerate().zip(COLOURS.iter().cycle()) {
                let mut values: Vec<f64> = values.iter().map(|y| place(*y)).filter(|y| y.is_finite()).collect();
                values.sort_by(f64::total_cmp);
                let Some((whiskers, [low, middle, high])) = box_of(&values) else { continue };
                let x = i as f64;
                let line = |points: Vec<(f64, f64)>| PathElement::new(points, colour.stroke_width(2));
                chart.draw_series([Rectangle::new([(x - 0.25, low), (x + 0.25, high)], colour.mix(0.3).filled())])?;
                chart.draw_series([
                    line(vec![(x - 0.25, middle), (x + 0.25, middle)]),
                    line(vec![(x, whiskers[0]), (x, low)]),
                    line(vec![(x, high), (x, whiskers[1])]),
                ])?;
                let outside = values.iter().filter(|y| **y < whiskers[0] || **y > whiskers[1]);
                chart.draw_series(outside.map(|y| Circle::new((x, *y), 3, colour)))?;
            }
        }
    }
    Ok(())
}

/// Ends of the whiskers and quartiles of sorted values.
fn box_of(sorted: &[f64]) -> Option<([f64; 2], [f64; 3])> {
    let quartiles @ [low, _, high] = [0.25, 0.5, 0.75].map(|share| quantile(sorted, share));
    let reach = 1.5 * (high - low);
    let whiskers = [
        *sorted.iter().find(|value| **value >= low - reach)?,
        *sorted.iter().rev().find(|value| **value <= high + reach)?,
    ];
    Some((whiskers, quartiles))
}

/// A quantile of sorted numbers, between the two nearest by their distance; not a number where there are none.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = share * last as f64;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between zero and the last index")]
    let below = place.floor() as usize;
    let (low, high) = (sorted[below], sorted[(below + 1).min(last)]);
    let part = place - place.floor();
    // Also between two infinities, whose difference is no number.
    if part == 0.0 || low >= high { low } else { low + part * (high - low) }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact cases")]
mod tests {
    use super::*;

    #[test]
    fn quartiles_by_hand() {
        let sorted = [1.0, 2.0, 3.0, 5.0, 7.0, 9.0];
        assert_eq!([0.0, 0.25, 0.5, 0.75, 1.0].map(|q| quantile(&sorted, q)), [1.0, 2.25, 4.0, 6.5, 9.0]);
        assert!(quantile(&[], 0.5).is_nan());
        assert_eq!(quantile(&[2.0, 4.0, f64::INFINITY], 0.5), 4.0);
        assert_eq!(quantile(&[f64::INFINITY, f64::INFINITY], 0.5), f64::INFINITY);
    }

    #[test]
    fn a_curve_breaks_where_x_is_no_number() {
        let points = [(0.0, 1.0), (1.0, f64::NAN), (2.0, 3.0), (f64::NAN, 0.0), (4.0, 5.0)];
        assert_eq!(lines(&points, |y| y), [vec![(0.0, 1.0), (2.0, 3.0)], vec![(4.0, 5.0)]]);
    }

    #[test]
    fn whiskers_stop_before_what_lies_far_off() {
        let sorted = [1.0, 2.0, 3.0, 4.0, 5.0, 20.0];
        assert_eq!(box_of(&sorted), Some(([1.0, 5.0], [2.25, 3.5, 4.75])));
        assert_eq!(box_of(&[]), None);
    }

    #[test]
    fn heat_runs_from_blue_to_red() {
        let colours = [0.0, 1.0, 2.0].map(|heat| heat_colour(heat, [0.0, 2.0]));
        assert_eq!(colours, [RGBColor(0, 90, 181), RGBColor(240, 190, 40), RGBColor(200, 30, 30)]);
        assert_eq!(heat_colour(3.0, [3.0, 3.0]), RGBColor(0, 90, 181));
    }
}
