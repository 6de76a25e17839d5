//! Pictures of a local plan over time: panels one below the other.

use super::plan_figure::{escaped, rounded, ticks};
use super::plan_local_solve::Segment;
use std::fmt::Write as _;
use tumble_dynamics::nalgebra::Vector3;

/// Size of a panel without its margins, px.
const PANEL: (f64, f64) = (820.0, 130.0);
/// Left, between panels, right, px.
const MARGINS: (f64, f64, f64) = (96.0, 34.0, 110.0);
/// Above the first panel and below the last, px.
const ENDS: (f64, f64) = (40.0, 44.0);
/// Ticks of a vertical axis, about.
const TICKS: f64 = 4.0;
const COLOURS: [&str; 4] = ["#005ab5", "#dc3220", "#1a8554", "#8b5a00"];

/// A named line.
struct Line {
    name: &'static str,
    points: Vec<(f64, f64)>,
}

/// One pair of axes.
struct Panel {
    label: String,
    lines: Vec<Line>,
    /// Values that are not passed.
    limits: Vec<f64>,
    /// A value to compare with.
    level: Option<f64>,
}

impl Panel {
    /// Lowest and highest value shown.
    fn range(&self) -> (f64, f64) {
        let points = self.lines.iter().flat_map(|line| line.points.iter().map(|(_, y)| *y));
        let values = points.chain(self.limits.iter().copied()).chain(self.level).chain([0.0]);
        let (low, high) = values
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        let room = if high > low { 0.06 * (high - low) } else { 1e-9 };
        (low - room, high + room)
    }
}

/// Attitude as a turn from the start, rate and speed.
pub(super) fn motion_over_time(title: &str, segment: &Segment) -> String {
    let over = |value: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        (0..segment.motion.len()).map(|node| (segment.time_s(node), value(node))).collect()
    };
    let axes = |of: &dyn Fn(usize) -> Vector3<f64>| -> Vec<Line> {
        let line = |(axis, name)| Line { name, points: over(&|node| of(node)[axis]) };
        [(0, "x"), (1, "y"), (2, "z")].map(line).into()
    };
    let first = segment.motion.first().map(|motion| motion.world_from_body.rotation);
    let turned = |node: usize| {
        let now = segment.motion[node].world_from_body.rotation;
        first.map_or_else(Vector3::zeros, |first| (first.inverse() * now).scaled_axis())
    };
    let panel =
        |label: &str, lines: Vec<Line>| Panel { label: label.to_owned(), lines, limits: Vec::new(), level: None };
    let panels = [
        panel("turn from the start, rad", axes(&turned)),
        panel("rate (body axes), rad/s", axes(&|node| segment.motion[node].rate_body)),
        panel("velocity (world axes), m/s", axes(&|node| segment.motion[node].velocity_world)),
        panel("position - start, m", {
            let from = segment.motion.first().map(|motion| motion.world_from_body.translation.vector);
            axes(&|node| segment.motion[node].world_from_body.translation.vector - from.unwrap_or_default())
        }),
    ];
    drawn(title, segment.duration_s(), &panels)
}

/// Forces and torques with their limits.
pub(super) fn inputs_over_time(title: &str, segment: &Segment, limit: &[f64; 6]) -> String {
    let names = ["torque x, N m", "torque y, N m", "torque z, N m", "force x, N", "force y, N", "force z, N"];
    let panel = |index: usize| {
        let step = |(step, wrench): (usize, &tumble_lie::Wrench<f64>)| {
            let value = wrench.to_vector()[index];
            [(segment.time_s(step), value), (segment.time_s(step + 1), value)]
        };
        let points = segment.inputs.iter().enumerate().flat_map(step).collect();
        Panel {
            label: names[index].to_owned(),
            lines: vec![Line { name: "", points }],
            limits: vec![limit[index], -limit[index]],
            level: None,
        }
    };
    drawn(title, segment.duration_s(), &[3, 4, 5, 0, 1, 2].map(panel))
}

/// Standard deviation of each quantity, and what it was before.
pub(super) fn sigmas_over_time(title: &str, segment: &Segment) -> String {
    let panels: Vec<Panel> = segment
        .quantities
        .iter()
        .map(|quantity| {
            let points = quantity.sigmas.iter().enumerate().map(|(node, sigma)| (segment.time_s(node), *sigma));
            let unit = if quantity.unit.is_empty() { String::new() } else { format!(", {}", quantity.unit) };
            Panel {
                label: format!("sigma of {}{unit}", quantity.name),
                lines: vec![Line { name: "", points: points.collect() }],
                limits: Vec::new(),
                level: Some(quantity.prior_sigma),
            }
        })
        .collect();
    drawn(title, segment.duration_s(), &panels)
}

/// The picture as SVG.
fn drawn(title: &str, end_s: f64, panels: &[Panel]) -> String {
    let (left, between, right) = MARGINS;
    let (top, bottom) = ENDS;
    let (width, height) = PANEL;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.0}\" height=\"{:.0}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <style>.limit{{fill:none;stroke:#dc3220;stroke-dasharray:5 3}}.level{{fill:none;stroke:#000;stroke-opacity:.5;\
         stroke-dasharray:2 3}}.zero{{fill:none;stroke:#000;stroke-opacity:.2}}.line{{fill:none;stroke-width:1.6}}</style>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <text x=\"{left}\" y=\"22\" font-size=\"15\">{}</text>\n",
        left + width + right,
        top + (height + between) * panels.len() as f64 - between + bottom,
        escaped(title),
    );
    let end_s = if end_s > 0.0 { end_s } else { 1.0 };
    for (index, panel) in panels.iter().enumerate() {
        let origin = top + (height + between) * index as f64;
        push_panel(&mut svg, panel, origin, end_s);
    }
    let foot = top + (height + between) * panels.len() as f64 - between;
    for value in ticks(0.0, end_s, width / end_s) {
        let x = left + value / end_s * width;
        let _ = writeln!(
            svg,
            "<text x=\"{x:.2}\" y=\"{:.2}\" text-anchor=\"middle\">{}</text>",
            foot + 18.0,
            rounded(value)
        );
    }
    let (x, y) = (left + 0.5 * width, foot + 36.0);
    let _ = writeln!(svg, "<text x=\"{x:.2}\" y=\"{y:.2}\" text-anchor=\"middle\">time, s</text>\n</svg>");
    svg
}

fn push_panel(svg: &mut String, panel: &Panel, origin: f64, end_s: f64) {
    let (left, ..) = MARGINS;
    let (width, height) = PANEL;
    let (low, high) = panel.range();
    let x = |time_s: f64| left + time_s / end_s * width;
    let y = |value: f64| origin + (high - value) / (high - low) * height;
    let _ = writeln!(
        svg,
        "<rect x=\"{left}\" y=\"{origin:.2}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"#000\" stroke-opacity=\".6\"/>\n\
         <text x=\"{:.2}\" y=\"{:.2}\">{}</text>",
        left + 4.0,
        origin - 6.0,
        escaped(&panel.label)
    );
    let step = nice_step((high - low) / TICKS);
    let mut value = (low / step).ceil() * step;
    while value <= high {
        let at = y(value);
        let _ = writeln!(
            svg,
            "<path d=\"M{left} {at:.2}h-5\" stroke=\"#000\"/><text x=\"{:.2}\" y=\"{:.2}\" text-anchor=\"end\">{}</text>",
            left - 8.0,
            at + 4.0,
            short(value, step)
        );
        value += step;
    }
    let mut level = |value: f64, class: &str| {
        let _ = writeln!(svg, "<path d=\"M{left} {:.2}h{width}\" class=\"{class}\"/>", y(value));
    };
    level(0.0, "zero");
    panel.limits.iter().for_each(|limit| level(*limit, "limit"));
    panel.level.iter().for_each(|prior| level(*prior, "level"));
    for (index, (line, colour)) in panel.lines.iter().zip(COLOURS).enumerate() {
        let mut data = String::new();
        for (at, (time_s, value)) in line.points.iter().enumerate() {
            let _ = write!(data, "{}{:.2} {:.2}", if at == 0 { 'M' } else { 'L' }, x(*time_s), y(*value));
        }
        let _ = writeln!(svg, "<path d=\"{data}\" class=\"line\" stroke=\"{colour}\"/>");
        if !line.name.is_empty() {
            let (at_x, at_y) = (left + width + 10.0, origin + 16.0 + 16.0 * index as f64);
            let _ = writeln!(svg, "<text x=\"{at_x:.2}\" y=\"{at_y:.2}\" fill=\"{colour}\">{}</text>", line.name);
        }
    }
}

/// 1, 2 or 5 times a power of ten, not below a value.
fn nice_step(least: f64) -> f64 {
    let power = libm::pow(10.0, libm::floor(libm::log10(least)));
    [1.0, 2.0, 5.0].into_iter().map(|factor| factor * power).find(|step| *step >= least).unwrap_or(10.0 * power)
}

/// A tick's number with the digits that its step asks for.
fn short(value: f64, step: f64) -> String {
    let value = if value.abs() < 1e-6 * step { 0.0 } else { value };
    if (1e-3..1e4).contains(&step) {
        let digits = (-libm::floor(libm::log10(step))).max(0.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few digits")]
        return format!("{value:.*}", digits as usize);
    }
    if value == 0.0 { "0".to_owned() } else { format!("{value:.1e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_of_ticks_are_round_and_numbers_short() {
        for (least, step) in [(0.9, 1.0), (1.1, 2.0), (0.021, 0.05), (6.0e-5, 1e-4), (1.0, 1.0), (5.1, 10.0)] {
            assert!((nice_step(least) / step - 1.0).abs() < 1e-12, "{least}: {}", nice_step(least));
        }
        assert_eq!(short(0.1 + 0.2, 0.1), "0.3");
        assert_eq!(short(-1e-19, 0.1), "0.0");
        assert_eq!(short(2e-5, 1e-5), "2.0e-5");
        assert_eq!(short(20.0, 10.0), "20");
    }
}
