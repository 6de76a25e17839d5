//! Pictures of studies: curves or bars over a linear axis, values on a logarithmic one.

use std::path::Path;

use plotters::prelude::*;

use crate::Failure;

/// One named curve.
pub struct Curve {
    pub name: String,
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

fn draw_with(
    path: &Path,
    title: &str,
    [x_label, y_label]: [&str; 2],
    scale: Scale,
    curves: &[Curve],
) -> Result<(), Box<dyn std::error::Error>> {
    let logarithmic = scale == Scale::Logarithmic;
    let place = |y: f64| if logarithmic { y.log10() } else { y };
    let drawn: Vec<Vec<(f64, f64)>> = curves
        .iter()
        .map(|curve| {
            let points = curve.points.iter().map(|&(x, y)| (x, place(y)));
            points.filter(|(x, y)| x.is_finite() && y.is_finite()).collect()
        })
        .collect();
    let all = || drawn.iter().flatten();
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
    for ((curve, points), colour) in curves.iter().zip(&drawn).zip(COLOURS.iter().cycle().copied()) {
        chart
            .draw_series(LineSeries::new(points.iter().copied(), &colour))?
            .label(&curve.name)
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour));
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3)).draw()?;
    root.present()?;
    Ok(())
}
