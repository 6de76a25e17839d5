//! One chart, drawn as SVG: paths of the page itself, so that it appears without script and in print, or a file of its own.

use tumble_dynamics::nalgebra::Vector3;
use tumble_lie::Pose;

use super::text::{coordinate, decade, escaped, number, round_down, tick};
use std::fmt::Write as _;

const WIDTH: f64 = 360.0;
/// Of what is drawn between the axes.
const INNER_HEIGHT: f64 = 168.0;
const LEFT: f64 = 46.0;
const RIGHT: f64 = 10.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = 24.0;
/// More below where the horizontal axis has a name.
const NAME: f64 = 16.0;
/// Classes of the curves, in their order.
pub(crate) const COLORS: [&str; 6] = ["c0", "c1", "c2", "c3", "c4", "c5"];
/// Above a chart in a file of its own: title and legend.
const HEADING: f64 = 42.0;
/// The look of a chart in a file of its own.
const FILE_STYLE: &str = include_str!("file.css");
/// More columns than this are drawn by their least and largest value.
const COLUMNS: usize = 450;

/// Something that is drawn; horizontal places are times unless the chart's axis says otherwise.
pub(crate) enum Layer {
    /// An area inside a closed line.
    Area(&'static str, Vec<[f64; 2]>),
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

/// The horizontal axis.
pub(crate) struct Axis {
    /// What it shows; empty for time, of which the unit says it.
    pub name: String,
    /// SI or other.
    pub unit: String,
    /// From where to where; as far as anything is drawn where it is not said.
    pub range: Option<[f64; 2]>,
}

impl Axis {
    /// Time from zero to an end, s.
    pub(crate) fn time(end_s: f64) -> Self {
        Self { name: String::new(), unit: "s".into(), range: Some([0.0, if end_s > 0.0 { end_s } else { 1.0 }]) }
    }

    /// Time, as far as anything is drawn, s.
    pub(crate) fn seconds() -> Self {
        Self::named("", "s")
    }

    /// Something else, as far as it goes.
    pub(crate) fn named(name: &str, unit: &str) -> Self {
        Self { name: name.into(), unit: unit.into(), range: None }
    }
}

/// A chart.
pub(crate) struct Chart {
    /// Of its element: letters, digits and hyphens.
    pub id: String,
    pub title: String,
    pub unit: String,
    pub axis: Axis,
    pub is_logarithmic: bool,
    /// One scale for both directions: a path.
    pub has_equal_scales: bool,
    /// Whether bands may be cut off where lines would become too flat to read.
    pub cuts_bands: bool,
    pub layers: Vec<Layer>,
    /// Class and text.
    pub legend: Vec<(&'static str, String)>,
    /// What the page's script shows at the time of the playback.
    pub reads: String,
}

impl Chart {
    pub(crate) fn new(id: impl Into<String>, title: impl Into<String>, unit: impl Into<String>, axis: Axis) -> Self {
        Self {
            id: id.into(),
            title: title.into(),
            unit: unit.into(),
            axis,
            is_logarithmic: false,
            has_equal_scales: false,
            cuts_bands: false,
            layers: Vec::new(),
            legend: Vec::new(),
            reads: String::new(),
        }
    }

    /// Curves with their names, in the house's colours.
    pub(crate) fn of_curves(
        id: &str,
        title: &str,
        unit: &str,
        axis: Axis,
        curves: impl IntoIterator<Item = (&'static str, Vec<[f64; 2]>)>,
    ) -> Self {
        let mut chart = Self::new(id, title, unit, axis);
        for (class, (name, points)) in COLORS.into_iter().zip(curves) {
            chart.layers.push(Layer::Line(class, points));
            chart.legend.push((class, name.to_owned()));
        }
        chart
    }

    /// With lines at plus and minus a bound.
    pub(crate) fn within(mut self, bound: Option<f64>, name: &str) -> Self {
        if let Some(bound) = bound.filter(|bound| bound.is_finite()) {
            self.layers.extend([bound, -bound].map(|level| Layer::Level("limit", level)));
            self.legend.push(("limit", name.to_owned()));
        }
        self
    }

    /// The same path, one scale for both directions.
    pub(crate) fn with_equal_scales(mut self) -> Self {
        self.has_equal_scales = true;
        self
    }

    /// The range of values: all that is drawn, with a little room.
    fn range(&self) -> Range {
        let mut range = Range::default();
        for layer in &self.layers {
            match layer {
                Layer::Line(_, points) | Layer::Marks(_, points) | Layer::Area(_, points) => {
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

    /// As far as the horizontal axis goes.
    fn extent(&self) -> Range {
        if let Some([lower, upper]) = self.axis.range {
            return Range { lower, upper };
        }
        let mut range = Range::default();
        for layer in &self.layers {
            match layer {
                Layer::Line(_, points) | Layer::Marks(_, points) | Layer::Area(_, points) => {
                    for point in points {
                        range.include(point[0]);
                    }
                }
                Layer::Band(_, points) => {
                    for point in points {
                        range.include(point[0]);
                    }
                }
                Layer::Moment(_, x) => range.include(*x),
                Layer::Level(..) => {}
            }
        }
        if range.lower < range.upper { range } else { range.padded(0.5) }
    }

    /// A value as it is drawn: not finite where it cannot be.
    fn scaled(&self, value: f64) -> f64 {
        if self.is_logarithmic { if value > 0.0 { libm::log10(value) } else { f64::NAN } } else { value }
    }

    fn frame(&self) -> Frame {
        let (mut x, mut y) = (self.extent(), self.range());
        let width = WIDTH - LEFT - RIGHT;
        let height = if self.has_equal_scales { width } else { INNER_HEIGHT };
        if self.has_equal_scales {
            let half = 0.5 * (x.upper - x.lower).max(y.upper - y.lower);
            for range in [&mut x, &mut y] {
                let middle = 0.5 * (range.lower + range.upper);
                *range = Range { lower: middle - half, upper: middle + half };
            }
        }
        Frame { width, height, x, y }
    }

    /// How high the picture is, px.
    fn height(&self, frame: &Frame) -> f64 {
        TOP + frame.height + BOTTOM + if self.axis.name.is_empty() { 0.0 } else { NAME }
    }

    /// The figure of a page: caption, picture, legend.
    pub(crate) fn write(&self, page: &mut String) {
        let frame = self.frame();
        let (id, title, unit) = (escaped(&self.id), escaped(&self.title), escaped(&self.unit));
        let _ = writeln!(
            page,
            "<figure class=\"plot\" id=\"{id}\"><figcaption><b>{title}</b> <span class=\"unit\">{unit}</span>\
             <output class=\"reading\" data-reads=\"{}\"></output></figcaption>",
            escaped(&self.reads)
        );
        let _ = write!(
            page,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {}\" role=\"img\" tabindex=\"0\" aria-label=\"{}\" \
             data-left=\"{LEFT}\" data-top=\"{TOP}\" data-inner=\"{}\" data-height=\"{}\" data-start=\"{}\" data-end=\"{}\" data-lower=\"{}\" \
             data-upper=\"{}\" data-unit=\"{}\"{}>",
            self.height(&frame),
            escaped(&self.description()),
            frame.width,
            frame.height,
            frame.x.lower,
            frame.x.upper,
            frame.y.lower,
            frame.y.upper,
            escaped(&self.axis.unit),
            if self.is_logarithmic { " data-logarithmic=\"\"" } else { "" },
        );
        self.body(page, &frame);
        page.push_str("</svg>");
        if !self.legend.is_empty() {
            legend(page, &self.legend);
        }
        page.push_str("</figure>\n");
    }

    /// The same as a file of its own.
    pub(crate) fn file(&self) -> String {
        let frame = self.frame();
        let (width, height) = (WIDTH, HEADING + self.height(&frame));
        let mut file = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{}\" height=\"{}\">\n<style>{FILE_STYLE}</style>\n\
             <rect class=\"ground\" width=\"{width}\" height=\"{height}\"/>\n",
            2.0 * width,
            2.0 * height
        );
        let unit = if self.unit.is_empty() { String::new() } else { format!(", {}", escaped(&self.unit)) };
        let _ = writeln!(file, "<text class=\"title\" x=\"10\" y=\"17\">{}{unit}</text>", escaped(&self.title));
        let mut x = 10.0;
        for (class, name) in &self.legend {
            let _ = writeln!(
                file,
                "<g transform=\"translate({x} 24)\">{}<text x=\"26\" y=\"10\">{}</text></g>",
                sample(class),
                escaped(name)
            );
            x += 40.0 + 6.4 * name.chars().count() as f64;
        }
        let _ = write!(file, "<svg y=\"{HEADING}\" width=\"{width}\" height=\"{}\">", self.height(&frame));
        self.body(&mut file, &frame);
        file.push_str("</svg>\n</svg>\n");
        file
    }

    /// Axes, and what lies between them.
    fn body(&self, page: &mut String, frame: &Frame) {
        self.axes(page, frame);
        // A viewport of its own cuts off what lies outside.
        let (width, height) = (frame.width, frame.height);
        let _ = write!(
            page,
            "<svg class=\"inner\" x=\"{LEFT}\" y=\"{TOP}\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             preserveAspectRatio=\"none\" overflow=\"hidden\">"
        );
        for layer in &self.layers {
            self.layer(page, layer, frame);
        }
        let _ = write!(page, "<path class=\"cursor\" d=\"M-9 0V{height}\"/></svg>");
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
        let over = if self.axis.name.is_empty() { "time" } else { &self.axis.name };
        format!("{}{unit}, over {over}{ends}", self.title)
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
        let Range { lower, upper } = frame.x;
        let step = round_down((upper - lower) / 4.5);
        let end = upper + 1e-9 * (upper - lower);
        let mut number = (lower / step - 1e-9).ceil();
        // Few, whatever the range: rounding must not make this endless.
        for _ in 0..16 {
            if number * step > end {
                break;
            }
            let mut x = String::new();
            coordinate(&mut x, LEFT + frame.x(number * step));
            let is_last = (number + 1.0) * step > end;
            let unit = if is_last && !self.axis.unit.is_empty() {
                format!(" {}", escaped(&self.axis.unit))
            } else {
                String::new()
            };
            let _ = write!(page, "<path d=\"M{x} {bottom}v4\"/>");
            let _ = write!(
                page,
                "<text class=\"x\" x=\"{x}\" y=\"{}\">{}{unit}</text>",
                bottom + 17.0,
                tick(number * step, step)
            );
            number += 1.0;
        }
        if !self.axis.name.is_empty() {
            let _ = write!(
                page,
                "<text class=\"x\" x=\"{}\" y=\"{}\">{}</text>",
                LEFT + 0.5 * frame.width,
                bottom + 17.0 + NAME,
                escaped(&self.axis.name)
            );
        }
        page.push_str("</g>");
    }

    fn ticks(&self, frame: &Frame) -> Vec<(f64, String)> {
        let mut ticks = Vec::new();
        let Range { lower, upper } = frame.y;
        let span = upper - lower;
        let step = if self.is_logarithmic { round_down(span / 4.0).max(1.0) } else { round_down(span / 3.5) };
        let mut number = (lower / step).ceil();
        // Few, whatever the range: rounding must not make this endless.
        while number * step <= upper && ticks.len() < 12 {
            let value = number * step;
            #[allow(clippy::cast_possible_truncation)] // at most 308
            let label = if self.is_logarithmic { decade(value as i32) } else { tick(value, step) };
            ticks.push((value, label));
            number += 1.0;
        }
        ticks
    }

    /// The name of the curves of a class, for the page's script.
    fn name_of(&self, class: &str) -> String {
        let named = self.legend.iter().find(|(of, _)| *of == class);
        named.map(|(_, name)| format!(" data-name=\"{}\"", escaped(name))).unwrap_or_default()
    }

    fn layer(&self, page: &mut String, layer: &Layer, frame: &Frame) {
        match layer {
            Layer::Area(class, points) => {
                let _ = write!(page, "<path class=\"{class}\" d=\"");
                frame.path(page, points, true);
                page.push_str("Z\"/>");
            }
            Layer::Band(class, points) => {
                let drawn = |edge: usize| -> Vec<[f64; 2]> {
                    let rows = points.iter().filter(|row| row.iter().all(|value| value.is_finite()));
                    let line: Vec<_> =
                        rows.map(|row| [row[0], self.scaled(row.get(edge).copied().unwrap_or(f64::NAN))]).collect();
                    thinned(&line, frame.x)
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
                let _ = write!(page, "<path class=\"line {class}\"{} d=\"", self.name_of(class));
                for piece in points.split(|point| !point.iter().all(|value| value.is_finite())) {
                    // A path may go to and fro: only one over time has columns.
                    if self.has_equal_scales {
                        frame.path(page, piece, true);
                    } else {
                        frame.path(page, &thinned(piece, frame.x), true);
                    }
                }
                page.push_str("\"/>");
            }
            Layer::Level(class, value) => {
                let mut y = String::new();
                coordinate(&mut y, frame.y(self.scaled(*value)));
                let _ = write!(page, "<path class=\"line {class}\" d=\"M0 {y}h{}\"/>", frame.width);
            }
            Layer::Marks(class, points) => {
                let mut places = String::new();
                for &[t, value] in points {
                    let value = self.scaled(value);
                    if value.is_finite() && t.is_finite() {
                        places.push('M');
                        coordinate(&mut places, frame.x(t));
                        places.push(' ');
                        coordinate(&mut places, frame.y(value));
                        places.push_str("h0");
                    }
                }
                if !places.is_empty() {
                    let _ = write!(page, "<path class=\"mark {class}\"{} d=\"{places}\"/>", self.name_of(class));
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

/// Points of the outline of an ellipsoid.
const OUTLINE: u32 = 72;

/// The shadow of an ellipsoid on the x-y plane of the world: where its surface normal is level.
pub(crate) fn ellipsoid_from_above(world_from_ellipsoid: &Pose<f64>, semi_axes: &Vector3<f64>) -> Vec<[f64; 2]> {
    let rotation = world_from_ellipsoid.rotation;
    let squares = semi_axes.component_mul(semi_axes);
    let point = |index: u32| {
        let angle = std::f64::consts::TAU * f64::from(index) / f64::from(OUTLINE);
        let normal = rotation.inverse() * Vector3::new(angle.cos(), angle.sin(), 0.0);
        let scaled = squares.component_mul(&normal);
        let local = scaled / normal.dot(&scaled).sqrt();
        let world = world_from_ellipsoid.translation.vector + rotation * local;
        [world.x, world.y]
    };
    (0..=OUTLINE).map(point).collect()
}

/// How a class looks, 22 by 12 px.
fn sample(class: &str) -> String {
    if class.contains("band") || class.contains("area") {
        format!("<rect class=\"{class}\" x=\"0\" y=\"1\" width=\"22\" height=\"10\"/>")
    } else if class.starts_with("mark") {
        format!("<path class=\"{class}\" d=\"M11 6h0\"/>")
    } else {
        format!("<path class=\"line {class}\" d=\"M0 6h22\"/>")
    }
}

/// Keys of the curves.
pub(crate) fn legend(page: &mut String, keys: &[(&'static str, String)]) {
    page.push_str("<ul class=\"legend\">");
    for (class, text) in keys {
        let _ = write!(
            page,
            "<li><svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 22 12\" width=\"22\" height=\"12\" aria-hidden=\"true\">\
             {}</svg>{}</li>",
            sample(class),
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
    fn padded(self, least: f64) -> Self {
        if self.lower > self.upper {
            return Self { lower: 0.0, upper: 1.0 };
        }
        let span = self.upper - self.lower;
        let size = self.lower.abs().max(self.upper.abs());
        let room = (0.06 * span).max(least).max(if span <= 1e-9 * size { 0.1 * size } else { 0.0 });
        Self { lower: self.lower - room, upper: self.upper + room }
    }
}

/// From what is measured to places.
struct Frame {
    width: f64,
    height: f64,
    x: Range,
    y: Range,
}

impl Frame {
    fn x(&self, t: f64) -> f64 {
        self.width * (t - self.x.lower) / (self.x.upper - self.x.lower)
    }

    fn y(&self, value: f64) -> f64 {
        // Far outside is as invisible as further outside, and shorter.
        (self.height * (self.y.upper - value) / (self.y.upper - self.y.lower)).clamp(-50.0, self.height + 50.0)
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
fn thinned(points: &[[f64; 2]], over: Range) -> Vec<[f64; 2]> {
    if points.len() <= 2 * COLUMNS {
        return points.to_vec();
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)]
    let column =
        |point: &[f64; 2]| ((point[0] - over.lower) / (over.upper - over.lower) * COLUMNS as f64).max(0.0) as usize;
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
pub(crate) fn steps(points: impl IntoIterator<Item = [f64; 2]>, end_s: f64) -> Vec<[f64; 2]> {
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

    fn drawn(plot: &Chart) -> String {
        let mut page = String::new();
        plot.write(&mut page);
        page
    }

    #[test]
    fn a_line_goes_where_its_values_are() {
        let mut plot = Chart::new("p", "P", "m", Axis::time(10.0));
        plot.layers.push(Layer::Line("c0", vec![[0.0, 0.0], [5.0, 1.0], [10.0, 0.0]]));
        // Width 304, height 168; room of 6 % above and below: 168 * 0.06 / 1.12 = 9.
        let page = drawn(&plot);
        assert!(page.contains("\"M0 159L152 9L304 159\""), "{page}");
    }

    #[test]
    fn decades_are_equally_far_apart() {
        let mut plot = Chart::new("p", "P", "", Axis::time(10.0));
        plot.is_logarithmic = true;
        plot.layers.push(Layer::Line("c0", vec![[0.0, 0.0], [1.0, 1.0], [5.0, 100.0], [10.0, 10000.0]]));
        let page = drawn(&plot);
        // Zero has no place; room of 6 % again.
        assert!(page.contains("\"M30.4 159L152 84L304 9\""), "{page}");
        assert!(page.contains(">10²<"), "{page}");
    }

    #[test]
    fn lines_break_where_there_is_no_value() {
        let mut plot = Chart::new("p", "P", "m", Axis::time(10.0));
        plot.layers.push(Layer::Line("c0", vec![[0.0, 0.0], [4.0, 1.0], [5.0, f64::NAN], [6.0, 1.0], [10.0, 0.0]]));
        let page = drawn(&plot);
        let line = page.split("class=\"line c0\"").nth(1).and_then(|rest| rest.split("/>").next()).unwrap_or("");
        assert_eq!(line.matches('M').count(), 2, "{line}");
    }

    #[test]
    fn nothing_to_draw_is_no_trouble() {
        for layers in
            [vec![], vec![Layer::Line("c0", vec![])], vec![Layer::Band("band", vec![]), Layer::Marks("m", vec![])]]
        {
            let mut plot = Chart::new("p", "P", "m", Axis::time(10.0));
            plot.layers = layers;
            assert!(drawn(&plot).ends_with("</figure>\n"));
        }
        let mut flat = Chart::new("p", "P", "m", Axis::time(10.0));
        flat.layers.push(Layer::Line("c0", vec![[0.0, 1e300], [1.0, 1e300]]));
        assert!(drawn(&flat).len() < 5000);
    }

    #[test]
    fn thinning_keeps_the_extremes() {
        let mut points: Vec<[f64; 2]> = (0..5000_u32).map(|i| [f64::from(i), f64::from(i % 7)]).collect();
        points[2222][1] = 99.0;
        points[3333][1] = -99.0;
        let kept = thinned(&points, Range { lower: 0.0, upper: 5000.0 });
        assert!(kept.len() <= 4 * COLUMNS && kept.contains(&points[2222]) && kept.contains(&points[3333]));
        assert!(kept.is_sorted_by(|a, b| a[0] < b[0]));
    }

    #[test]
    fn steps_are_level() {
        assert_eq!(steps([[0.0, 1.0], [1.0, 1.0], [2.0, 3.0]], 5.0), [[0.0, 1.0], [2.0, 1.0], [2.0, 3.0], [5.0, 3.0]]);
    }

    #[test]
    fn an_ellipsoid_seen_from_above_is_an_ellipse() {
        let pose = Pose::from_parts(
            Vector3::new(1.0, 2.0, 3.0).into(),
            tumble_lie::nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, 0.5),
        );
        for [x, y] in ellipsoid_from_above(&pose, &Vector3::new(0.4, 0.2, 0.9)) {
            let (dx, dy) = (x - 1.0, y - 2.0);
            let (along, across) = (dx * 0.5_f64.cos() + dy * 0.5_f64.sin(), dy * 0.5_f64.cos() - dx * 0.5_f64.sin());
            assert!(((along / 0.4).powi(2) + (across / 0.2).powi(2) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_file_says_what_it_shows() {
        let curves = [("x", vec![[0.0, 0.0], [1.0, 2.0]]), ("y <z>", vec![[0.0, 1.0], [1.0, 0.0]])];
        let file = Chart::of_curves("force", "Force & more", "N", Axis::named("way, m", ""), curves)
            .within(Some(1.5), "limit")
            .file();
        for part in ["Force &amp; more, N", "y &lt;z&gt;", ">limit<", ">way, m<", "class=\"line c1\""] {
            assert!(file.contains(part), "{part}: {file}");
        }
        assert_eq!(file.matches("<svg").count(), file.matches("</svg>").count());
    }
}
