//! Pictures: SVG files that open anywhere, in one house style.

use crate::error::AstrobeeError;
use plotters::prelude::*;
use std::path::Path;

/// One named curve.
pub struct Curve<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Points (x, y); points that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

const COLOURS: [RGBColor; 3] = [RGBColor(0, 90, 181), RGBColor(220, 50, 32), RGBColor(26, 133, 84)];
const SIZE: (u32, u32) = (900, 360);

/// Draws up to three curves against time, with an optional band of +- `band` around zero.
///
/// # Errors
/// [`AstrobeeError::Plot`].
pub fn draw(path: &Path, title: &str, y_label: &str, curves: &[Curve], band: Option<f64>) -> Result<(), AstrobeeError> {
    draw_with(path, title, y_label, curves, band)
        .map_err(|error| AstrobeeError::Plot { path: path.into(), message: error.to_string() })
}

fn draw_with(
    path: &Path,
    title: &str,
    y_label: &str,
    curves: &[Curve],
    band: Option<f64>,
) -> Result<(), Box<dyn std::error::Error>> {
    let finite = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
    let points = || curves.iter().flat_map(|c| c.points.iter()).filter(finite);
    let (mut low, mut high) = points().fold((0.0_f64, 0.0_f64), |(l, h), p| (l.min(p.1), h.max(p.1)));
    if let Some(band) = band.filter(|b| b.is_finite()) {
        (low, high) = (low.min(-1.3 * band), high.max(1.3 * band));
    }
    if high <= low {
        (low, high) = (-1.0, 1.0);
    }
    let pad = 0.05 * (high - low);
    let start = points().map(|p| p.0).fold(f64::INFINITY, f64::min);
    let end = points().map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
    let (start, end) = if start < end { (start, end) } else { (0.0, 1.0) };

    let root = SVGBackend::new(path, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 20))
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(80)
        .build_cartesian_2d(start..end, (low - pad)..(high + pad))?;
    chart
        .configure_mesh()
        .x_desc("time since the first sample, s")
        .y_desc(y_label)
        .light_line_style(WHITE)
        .y_label_formatter(&|y| format!("{y:.2e}"))
        .draw()?;
    if let Some(band) = band.filter(|b| b.is_finite()) {
        chart.draw_series(std::iter::once(Rectangle::new(
            [(start, -band), (end, band)],
            RGBColor(0, 0, 0).mix(0.08).filled(),
        )))?;
    }
    for (curve, colour) in curves.iter().zip(COLOURS) {
        chart
            .draw_series(LineSeries::new(curve.points.iter().filter(finite).copied(), &colour))?
            .label(curve.name)
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour));
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3)).draw()?;
    root.present()?;
    Ok(())
}
