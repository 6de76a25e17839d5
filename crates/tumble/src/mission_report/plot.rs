//! One plot over time, drawn as SVG: paths of the page itself, so that it appears without script and in print.

use super::text::{coordinate, decade, escaped, number, round_down, tick};
use std::fmt::Write as _;

const WIDTH: f64 = 360.0;
const HEIGHT: f64 = 200.0;
const LEFT: f64 = 46.0;
const RIGHT: f64 = 10.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = 24.0;
/// More columns than this are drawn by their least and largest value.
const COLUMNS: usize = 450;

/// Something that is drawn.
pub(super) enum Layer {
    /// Time, lower and upper edge.
    Band(&'static str, Vec<[f64; 3]>),
    /// Time and value; not finite where the line is broken.
    Line(&'static str, Vec<[f64; 2]>),
    /// A value for all times.
    Level(&'static str, f64),
    /// Single points.
    Marks(&'static str, Vec<[f64; 2]>),
    /// A time.
    Moment(&'static str, f64),
}

/// A plot.
pub(super) struct Plot {
    /// Of its element: letters, digits and hyphens.
    pub id: String,
    pub title: String,
    pub unit: String,
    pub is_logarithmic: bool,
    /// Whether bands may be cut off where lines would become too flat to read.
    pub cuts_bands: bool,
    pub layers: Vec<Layer>,
    /// Class and text.
    pub legend: Vec<(&'static str, String)>,
    /// What the page's script shows at the time of the playback.
    pub reads: String,
}

impl Plot {
    pub(super) fn new(id: impl Into<String>, title: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            id: id.into(),
            title: title.into(),
            unit: unit.into(),
            is_logarithmic: false,
            cuts_bands: false,
            layers: Vec::new(),
            legend: Vec::new(),
            reads: String::new(),
        }
    }

    /// The range of values: all that is drawn, with a little room.
    fn range(&self) -> (f64, f64) {
        let mut range = Range::default();
        for layer in &self.layers {
            match layer {
                Layer::Line(_, points) | Layer::Marks(_, points) => {
                    for point in points {
                        range.include(self.scaled(point[1]));
                    }
                }
                Layer::Level(_, value) => range.include(self.scaled(*value)),
                Layer::Band(..) | Layer::Moment(..) => {}
            }
        }
        let lines = range;
        for layer in &self.layers {
            if let Layer::Band(_, points) = layer {
                for point in points {
                    range.include(self.scaled(point[1]));
                    range.include(self.scaled(point[2]));
                }
            }
        }
        if self.cuts_bands && lines.lower < lines.upper {
            let room = 0.4 * (lines.upper - lines.lower);
            range.lower = range.lower.max(lines.lower - room);
            range.upper = range.upper.min(lines.upper + room);
        }
        range.padded(if self.is_logarithmic { 0.15 } else { 1e-12 })
    }

    /// A value as it is drawn: not finite where it cannot be.
    fn scaled(&self, value: f64) -> f64 {
        if self.is_logarithmic { if value > 0.0 { libm::log10(value) } else { f64::NAN } } else { value }
    }

    /// The figure, over the time of the whole mission.
    pub(super) fn write(&self, page: &mut String, end_s: f64) {
        let (inner_width, inner_height) = (WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
        let end_s = if end_s > 0.0 { end_s } else { 1.0 };
        let (lower, upper) = self.range();
        let frame = Frame { width: inner_width, height: inner_height, end_s, lower, upper };
        let (id, title, unit) = (escaped(&self.id), escaped(&self.title), escaped(&self.unit));
        let _ = writeln!(
            page,
            "<figure class=\"plot\" id=\"{id}\"><figcaption><b>{title}</b> <span class=\"unit\">{unit}</span>\
             <output class=\"reading\" data-reads=\"{}\"></output></figcaption>",
            escaped(&self.reads)
        );
        let _ = write!(
            page,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{}\" \
             data-left=\"{LEFT}\" data-inner=\"{inner_width}\" data-end=\"{end_s}\">",
            escaped(&self.description())
        );
        self.axes(page, &frame);
        // A viewport of its own cuts off what lies outside.
        let _ = write!(
            page,
            "<svg x=\"{LEFT}\" y=\"{TOP}\" width=\"{inner_width}\" height=\"{inner_height}\" overflow=\"hidden\">"
        );
        for layer in &self.layers {
            self.layer(page, layer, &frame);
        }
        let _ =
            writeln!(page, "<line class=\"cursor\" x1=\"-9\" x2=\"-9\" y1=\"0\" y2=\"{inner_height}\"/></svg></svg>");
        if !self.legend.is_empty() {
            legend(page, &self.legend);
        }
        page.push_str("</figure>\n");
    }

    /// For those who cannot see it.
    fn description(&self) -> String {
        let line =
            self.layers.iter().find_map(|layer| if let Layer::Line(_, points) = layer { Some(points) } else { None });
        let mut finite = line.into_iter().flatten().map(|point| point[1]).filter(|value| value.is_finite());
        let first = finite.next();
        let ends = first.map(|first| (first, finite.next_back().unwrap_or(first)));
        let ends = ends.map(|(a, b)| format!(": from {} to {}", number(a, 3), number(b, 3))).unwrap_or_default();
        let unit = if self.unit.is_empty() { String::new() } else { format!(", {}", self.unit) };
        format!("{}{unit}, over time{ends}", self.title)
    }

    fn axes(&self, page: &mut String, frame: &Frame) {
        page.push_str("<g class=\"axes\">");
        let bottom = TOP + frame.height;
        for (value, label) in self.ticks(frame) {
            let mut y = String::new();
            coordinate(&mut y, TOP + frame.y(value));
            let _ = write!(page, "<path d=\"M{LEFT} {y}h{}\"/>", frame.width);
            let _ = write!(page, "<text class=\"y\" x=\"{}\" y=\"{y}\" dy=\".32em\">{label}</text>", LEFT - 6.0);
        }
        let step = round_down(frame.end_s / 4.5);
        let mut number = 0.0;
        while number * step <= frame.end_s * (1.0 + 1e-9) {
            let mut x = String::new();
            coordinate(&mut x, LEFT + frame.x(number * step));
            let is_last = (number + 1.0) * step > frame.end_s * (1.0 + 1e-9);
            let unit = if is_last { " s" } else { "" };
            let _ = write!(page, "<path d=\"M{x} {bottom}v4\"/>");
            let _ = write!(
                page,
                "<text class=\"x\" x=\"{x}\" y=\"{}\">{}{unit}</text>",
                bottom + 17.0,
                tick(number * step, step)
            );
            number += 1.0;
        }
        page.push_str("</g>");
    }

    fn ticks(&self, frame: &Frame) -> Vec<(f64, String)> {
        let mut ticks = Vec::new();
        let span = frame.upper - frame.lower;
        let step = if self.is_logarithmic { round_down(span / 4.0).max(1.0) } else { round_down(span / 3.5) };
        let mut number = (frame.lower / step).ceil();
        // Few, whatever the range: rounding must not make this endless.
        while number * step <= frame.upper && ticks.len() < 12 {
            let value = number * step;
            #[allow(clippy::cast_possible_truncation)] // at most 308
            let label = if self.is_logarithmic { decade(value as i32) } else { tick(value, step) };
            ticks.push((value, label));
            number += 1.0;
        }
        ticks
    }

    fn layer(&self, page: &mut String, layer: &Layer, frame: &Frame) {
        match layer {
            Layer::Band(class, points) => {
                let drawn = |edge: usize| -> Vec<[f64; 2]> {
                    let rows = points.iter().filter(|row| row.iter().all(|value| value.is_finite()));
                    let line: Vec<_> =
                        rows.map(|row| [row[0], self.scaled(row.get(edge).copied().unwrap_or(f64::NAN))]).collect();
                    thinned(&line, frame.end_s)
                };
                let (upper, mut lower) = (drawn(2), drawn(1));
                lower.reverse();
                if !upper.is_empty() {
                    let _ = write!(page, "<path class=\"{class}\" d=\"");
                    frame.path(page, &upper, true);
                    frame.path(page, &lower, false);
                    page.push_str("Z\"/>");
                }
            }
            Layer::Line(class, points) => {
                let points: Vec<_> = points.iter().map(|&[t, value]| [t, self.scaled(value)]).collect();
                let _ = write!(page, "<path class=\"line {class}\" d=\"");
                for piece in points.split(|point| !point.iter().all(|value| value.is_finite())) {
                    frame.path(page, &thinned(piece, frame.end_s), true);
                }
                page.push_str("\"/>");
            }
            Layer::Level(class, value) => {
                let mut y = String::new();
                coordinate(&mut y, frame.y(self.scaled(*value)));
                let _ = write!(page, "<path class=\"line {class}\" d=\"M0 {y}h{}\"/>", frame.width);
            }
            Layer::Marks(class, points) => {
                for &[t, value] in points {
                    let value = self.scaled(value);
                    if value.is_finite() && t.is_finite() {
                        let (mut x, mut y) = (String::new(), String::new());
                        coordinate(&mut x, frame.x(t));
                        coordinate(&mut y, frame.y(value));
                        let _ = write!(page, "<circle class=\"mark {class}\" cx=\"{x}\" cy=\"{y}\" r=\"3.2\"/>");
                    }
                }
            }
            Layer::Moment(class, t) => {
                let mut x = String::new();
                coordinate(&mut x, frame.x(*t));
                let _ = write!(page, "<path class=\"line {class}\" d=\"M{x} 0v{}\"/>", frame.height);
            }
        }
    }
}

/// Keys of the curves.
pub(super) fn legend(page: &mut String, keys: &[(&'static str, String)]) {
    page.push_str("<ul class=\"legend\">");
    for (class, text) in keys {
        let sample = if class.contains("band") {
            format!("<rect class=\"{class}\" x=\"0\" y=\"1\" width=\"22\" height=\"10\"/>")
        } else if class.starts_with("mark") {
            format!("<circle class=\"{class}\" cx=\"11\" cy=\"6\" r=\"3.6\"/>")
        } else {
            format!("<path class=\"line {class}\" d=\"M0 6h22\"/>")
        };
        let _ = write!(
            page,
            "<li><svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 22 12\" width=\"22\" height=\"12\" aria-hidden=\"true\">\
             {sample}</svg>{}</li>",
            escaped(text)
        );
    }
    page.push_str("</ul>\n");
}

#[derive(Clone, Copy)]
struct Range {
    lower: f64,
    upper: f64,
}

impl Default for Range {
    fn default() -> Self {
        Self { lower: f64::INFINITY, upper: f64::NEG_INFINITY }
    }
}

impl Range {
    fn include(&mut self, value: f64) {
        if value.is_finite() {
            self.lower = self.lower.min(value);
            self.upper = self.upper.max(value);
        }
    }

    /// With room at both ends, and at least so much in all.
    fn padded(self, least: f64) -> (f64, f64) {
        if self.lower > self.upper {
            return (0.0, 1.0);
        }
        let span = self.upper - self.lower;
        let size = self.lower.abs().max(self.upper.abs());
        let room = (0.06 * span).max(least).max(if span <= 1e-9 * size { 0.1 * size } else { 0.0 });
        (self.lower - room, self.upper + room)
    }
}

/// From times and values to places.
struct Frame {
    width: f64,
    height: f64,
    end_s: f64,
    lower: f64,
    upper: f64,
}

impl Frame {
    fn x(&self, t: f64) -> f64 {
        self.width * t / self.end_s
    }

    fn y(&self, value: f64) -> f64 {
        // Far outside is as invisible as further outside, and shorter.
        (self.height * (self.upper - value) / (self.upper - self.lower)).clamp(-50.0, self.height + 50.0)
    }

    fn path(&self, page: &mut String, points: &[[f64; 2]], is_new: bool) {
        let mut command = if is_new { 'M' } else { 'L' };
        for &[t, value] in points {
            page.push(command);
            coordinate(page, self.x(t));
            page.push(' ');
            coordinate(page, self.y(value));
            command = 'L';
        }
    }
}

/// A line of many points, as it looks: of each column its first, least, largest and last value.
fn thinned(points: &[[f64; 2]], end_s: f64) -> Vec<[f64; 2]> {
    if points.len() <= 2 * COLUMNS {
        return points.to_vec();
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
    let column = |point: &[f64; 2]| (point[0] / end_s * COLUMNS as f64).max(0.0) as usize;
    let mut kept = Vec::with_capacity(4 * COLUMNS);
    for group in points.chunk_by(|a, b| column(a) == column(b)) {
        let place = |better: fn(f64, f64) -> bool| {
            let mut best = 0;
            for (index, point) in group.iter().enumerate() {
                if group.get(best).is_some_and(|least| better(point[1], least[1])) {
                    best = index;
                }
            }
            best
        };
        let mut chosen = [0, place(|a, b| a < b), place(|a, b| a > b), group.len() - 1];
        chosen.sort_unstable();
        let mut last = None;
        for index in chosen {
            if last.replace(index) != Some(index) {
                kept.extend(group.get(index));
            }
        }
    }
    kept
}

/// Two points for each step, so that a line goes on level until its value changes.
pub(super) fn steps(points: impl IntoIterator<Item = [f64; 2]>, end_s: f64) -> Vec<[f64; 2]> {
    let mut line: Vec<[f64; 2]> = Vec::new();
    for [t, value] in points {
        if let Some(&[_, before]) = line.last() {
            if before.to_bits() == value.to_bits() {
                continue;
            }
            line.push([t, before]);
        }
        line.push([t, value]);
    }
    if let Some(&[t, value]) = line.last()
        && t < end_s
    {
        line.push([end_s, value]);
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(plot: &Plot) -> String {
        let mut page = String::new();
        plot.write(&mut page, 10.0);
        page
    }

    #[test]
    fn a_line_goes_where_its_values_are() {
        let mut plot = Plot::new("p", "P", "m");
        plot.layers.push(Layer::Line("c0", vec![[0.0, 0.0], [5.0, 1.0], [10.0, 0.0]]));
        // Width 304, height 168; room of 6 % above and below: 168 * 0.06 / 1.12 = 9.
        let page = drawn(&plot);
        assert!(page.contains("\"M0 159L152 9L304 159\""), "{page}");
    }

    #[test]
    fn decades_are_equally_far_apart() {
        let mut plot = Plot::new("p", "P", "");
        plot.is_logarithmic = true;
        plot.layers.push(Layer::Line("c0", vec![[0.0, 0.0], [1.0, 1.0], [5.0, 100.0], [10.0, 10000.0]]));
        let page = drawn(&plot);
        // Zero has no place; room of 6 % again.
        assert!(page.contains("\"M30.4 159L152 84L304 9\""), "{page}");
        assert!(page.contains(">10²<"), "{page}");
    }

    #[test]
    fn lines_break_where_there_is_no_value() {
        let mut plot = Plot::new("p", "P", "m");
        plot.layers.push(Layer::Line("c0", vec![[0.0, 0.0], [4.0, 1.0], [5.0, f64::NAN], [6.0, 1.0], [10.0, 0.0]]));
        assert_eq!(drawn(&plot).matches('M').count() - drawn(&plot).matches("<path d=\"M").count(), 2);
    }

    #[test]
    fn nothing_to_draw_is_no_trouble() {
        for layers in
            [vec![], vec![Layer::Line("c0", vec![])], vec![Layer::Band("band", vec![]), Layer::Marks("m", vec![])]]
        {
            let mut plot = Plot::new("p", "P", "m");
            plot.layers = layers;
            assert!(drawn(&plot).ends_with("</figure>\n"));
        }
        let mut flat = Plot::new("p", "P", "m");
        flat.layers.push(Layer::Line("c0", vec![[0.0, 1e300], [1.0, 1e300]]));
        assert!(drawn(&flat).len() < 5000);
    }

    #[test]
    fn thinning_keeps_the_extremes() {
        let mut points: Vec<[f64; 2]> = (0..5000_u32).map(|i| [f64::from(i), f64::from(i % 7)]).collect();
        points[2222][1] = 99.0;
        points[3333][1] = -99.0;
        let kept = thinned(&points, 5000.0);
        assert!(kept.len() <= 4 * COLUMNS && kept.contains(&points[2222]) && kept.contains(&points[3333]));
        assert!(kept.is_sorted_by(|a, b| a[0] < b[0]));
    }

    #[test]
    fn steps_are_level() {
        assert_eq!(steps([[0.0, 1.0], [1.0, 1.0], [2.0, 3.0]], 5.0), [[0.0, 1.0], [2.0, 1.0], [2.0, 3.0], [5.0, 3.0]]);
    }
}
