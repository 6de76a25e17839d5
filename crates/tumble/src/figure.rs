//! Pictures: SVG files that open anywhere, in one house style.

use crate::TumbleError;
use plotters::prelude::*;
use std::path::Path;

/// One named curve.
pub struct Curve<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Points (x, y); points that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

/// What a picture shows: up to three curves.
pub struct Figure<'a> {
    /// Above the picture.
    pub title: &'a str,
    /// Below the horizontal axis, with unit.
    pub x_label: &'a str,
    /// Beside the vertical axis, with unit.
    pub y_label: &'a str,
    /// What is drawn.
    pub curves: Vec<Curve<'a>>,
    /// A grey band of this half-width around zero.
    pub band: Option<f64>,
    /// One scale for both axes: a path.
    pub equal_scales: bool,
}

/// The horizontal axis of everything measured.
pub const SINCE_START: &str = "time since the first sample, s";

const COLOURS: [RGBColor; 3] = [RGBColor(0, 90, 181), RGBColor(220, 50, 32), RGBColor(26, 133, 84)];
const SIZE: (u32, u32) = (900, 360);
const SQUARE: (u32, u32) = (560, 560);

impl Figure<'_> {
    /// Draws the picture as SVG.
    ///
    /// # Errors
    /// [`TumbleError::Plot`].
    pub fn draw(&self, path: &Path) -> Result<(), TumbleError> {
        self.draw_with_outlines(path, &[])
    }

    /// Draws the picture as SVG above filled grey outlines, which it makes room for.
    ///
    /// # Errors
    /// [`TumbleError::Plot`].
    pub fn draw_with_outlines(&self, path: &Path, outlines: &[Vec<(f64, f64)>]) -> Result<(), TumbleError> {
        self.try_draw(path, outlines)
            .map_err(|error| TumbleError::Plot { path: path.into(), message: error.to_string() })
    }

    fn try_draw(&self, path: &Path, outlines: &[Vec<(f64, f64)>]) -> Result<(), Box<dyn std::error::Error>> {
        let finite = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
        let curves = self.curves.iter().map(|curve| &curve.points);
        let points = || curves.clone().chain(outlines).flatten().filter(finite);
        let band = self.band.filter(|b| b.is_finite());
        let (mut low, mut high) = points().fold((0.0_f64, 0.0_f64), |(l, h), p| (l.min(p.1), h.max(p.1)));
        if let Some(band) = band {
            (low, high) = (low.min(-1.3 * band), high.max(1.3 * band));
        }
        if high <= low {
            (low, high) = (-1.0, 1.0);
        }
        let start = points().map(|p| p.0).fold(f64::INFINITY, f64::min);
        let end = points().map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
        let (mut start, mut end) = if start < end { (start, end) } else { (0.0, 1.0) };
        if self.equal_scales {
            (low, high) = (low.min(start), high.max(end));
            (start, end) = (low, high);
        }
        let pad = 0.05 * (high - low);

        let root = SVGBackend::new(path, if self.equal_scales { SQUARE } else { SIZE }).into_drawing_area();
        root.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&root)
            .caption(self.title, ("sans-serif", 20))
            .margin(10)
            .x_label_area_size(40)
            .y_label_area_size(80)
            .build_cartesian_2d(start..end, (low - pad)..(high + pad))?;
        chart
            .configure_mesh()
            .x_desc(self.x_label)
            .y_desc(self.y_label)
            .light_line_style(WHITE)
            // Zero comes out of the ticks as rounding.
            .y_label_formatter(&|y| format!("{:.2e}", if y.abs() < 1e-9 * (high - low) { 0.0 } else { *y }))
            .draw()?;
        if let Some(band) = band {
            chart.draw_series(std::iter::once(Rectangle::new(
                [(start, -band), (end, band)],
                RGBColor(0, 0, 0).mix(0.08).filled(),
            )))?;
        }
        for outline in outlines {
            chart.draw_series(std::iter::once(Polygon::new(outline.clone(), RGBColor(0, 0, 0).mix(0.2).filled())))?;
        }
        for (curve, colour) in self.curves.iter().zip(COLOURS) {
            chart
                .draw_series(LineSeries::new(curve.points.iter().filter(finite).copied(), &colour))?
                .label(curve.name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour));
        }
        chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3)).draw()?;
        root.present()?;
        Ok(())
    }
}
