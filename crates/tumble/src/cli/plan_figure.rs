//! Pictures of a plan: seen from above and from the side.

use crate::scenario::PlanningProblem;
use std::fmt::Write as _;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{AlignedBox, ObstacleEllipsoid};
use tumble_lie::Pose;
use tumble_planning::ArcPath;

/// What a picture shows.
#[derive(Clone, Copy)]
pub(super) struct Drawn<'a> {
    pub title: &'a str,
    pub problem: &'a PlanningProblem,
    /// Edges of the search.
    pub tree: &'a [[Vector3<f64>; 2]],
    /// The way that the path follows a part of, if it does.
    pub way: &'a [Vector3<f64>],
    /// Positions along the path; empty where there is none.
    pub path: &'a [Vector3<f64>],
    /// Poses of the body along it.
    pub poses: &'a [Pose<f64>],
    /// When the path ends, s.
    pub end_s: f64,
    /// Where it should end: a point on the way, or the goal.
    pub target: Vector3<f64>,
}

/// From where one looks. To the right is the world's y in both: the long side of the module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum View {
    /// From above, x upwards.
    Top,
    /// Along x, up upwards: z points down.
    Side,
}

/// Points of the outline of an ellipsoid.
const OUTLINE: usize = 360;
/// Points of the path.
const PATH: usize = 600;
/// Outlines of the body along the path.
const BODIES: usize = 13;
/// Most edges of the tree that are drawn.
const MOST_EDGES: usize = 4000;
/// What is drawn around all that moves, m.
const SURROUNDINGS_M: f64 = 0.35;
/// Largest picture without its margins, px.
const LARGEST: (f64, f64) = (1000.0, 520.0);
/// Left, top, right, bottom, px.
const MARGINS: (f64, f64, f64, f64) = (64.0, 64.0, 20.0, 52.0);
/// Narrowest picture, px: what the legend needs.
const NARROWEST_PX: f64 = 960.0;
/// Least distance of two ticks, px.
const TICK_PX: f64 = 70.0;

pub(super) type Point = [f64; 2];

impl View {
    /// Direction of the picture's right and of its up, world axes.
    fn axes(self) -> (Vector3<f64>, Vector3<f64>) {
        match self {
            Self::Top => (Vector3::y(), Vector3::x()),
            Self::Side => (Vector3::y(), -Vector3::z()),
        }
    }

    /// The coordinate that the vertical axis shows, from a height in the picture.
    fn vertical(self, height: f64) -> (&'static str, f64) {
        match self {
            Self::Top => ("x", height),
            Self::Side => ("z", -height),
        }
    }

    fn of(self, point: &Vector3<f64>) -> Point {
        let (right, up) = self.axes();
        [right.dot(point), up.dot(point)]
    }

    fn corners(self, volume: &AlignedBox) -> [Point; 2] {
        let (a, b) = (self.of(&volume.lower_world), self.of(&volume.upper_world));
        [[a[0].min(b[0]), a[1].min(b[1])], [a[0].max(b[0]), a[1].max(b[1])]]
    }

    /// The shadow of an ellipsoid: the points where its surface normal lies in the picture.
    fn outline(self, world_from_ellipsoid: &Pose<f64>, semi_axes: &Vector3<f64>) -> Vec<Point> {
        let (right, up) = self.axes();
        let squares = semi_axes.component_mul(semi_axes);
        let point = |index: usize| {
            let angle = std::f64::consts::TAU * index as f64 / OUTLINE as f64;
            let normal = world_from_ellipsoid.rotation.inverse() * (right * angle.cos() + up * angle.sin());
            let scaled = squares.component_mul(&normal);
            let local = scaled / normal.dot(&scaled).sqrt();
            self.of(&(world_from_ellipsoid.translation.vector + world_from_ellipsoid.rotation * local))
        };
        (0..OUTLINE).map(point).collect()
    }
}

/// World to pixels.
struct Sheet {
    view: View,
    lower: Point,
    upper: Point,
    scale: f64,
    svg: String,
}

impl Sheet {
    fn new(view: View, around: impl Iterator<Item = Point>) -> Self {
        let (mut lower, mut upper) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in around.filter(|point| point.iter().all(|x| x.is_finite())) {
            for axis in 0..2 {
                lower[axis] = lower[axis].min(point[axis] - SURROUNDINGS_M);
                upper[axis] = upper[axis].max(point[axis] + SURROUNDINGS_M);
            }
        }
        let scale = (LARGEST.0 / (upper[0] - lower[0])).min(LARGEST.1 / (upper[1] - lower[1]));
        Self { view, lower, upper, scale, svg: String::new() }
    }

    fn size(&self) -> (f64, f64) {
        ((self.upper[0] - self.lower[0]) * self.scale, (self.upper[1] - self.lower[1]) * self.scale)
    }

    fn pixel(&self, point: &Point) -> (f64, f64) {
        ((point[0] - self.lower[0]) * self.scale, (self.upper[1] - point[1]) * self.scale)
    }

    fn add(&mut self, text: &str) {
        self.svg.push_str(text);
        self.svg.push('\n');
    }

    fn line(&self, points: &[Point]) -> String {
        let mut text = String::new();
        for (index, point) in points.iter().enumerate() {
            let (x, y) = self.pixel(point);
            let _ = write!(text, "{}{x:.2} {y:.2}", if index == 0 { 'M' } else { 'L' });
        }
        text
    }

    fn path(&mut self, data: &str, style: &str) {
        if !data.is_empty() {
            self.add(&format!("<path d=\"{data}\" {style}/>"));
        }
    }

    fn closed(&mut self, points: &[Point], style: &str) {
        let data = self.line(points) + "Z";
        self.path(&data, style);
    }

    fn rectangle(&mut self, volume: &AlignedBox, style: &str) {
        let [a, b] = self.view.corners(volume);
        self.closed(&[a, [b[0], a[1]], b, [a[0], b[1]]], style);
    }

    fn ellipsoid(&mut self, world_from_ellipsoid: &Pose<f64>, semi_axes: &Vector3<f64>, style: &str) {
        let points = self.view.outline(world_from_ellipsoid, semi_axes);
        self.closed(&points, style);
    }

    fn obstacle(&mut self, obstacle: &ObstacleEllipsoid, style: &str) {
        self.ellipsoid(&obstacle.world_from_ellipsoid, &obstacle.semi_axes, style);
    }

    fn dot(&mut self, at: &Vector3<f64>, colour: &str) {
        let (x, y) = self.pixel(&self.view.of(at));
        self.add(&format!("<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"4\" fill=\"{colour}\"/>"));
    }
}

/// Round numbers between two, about as many as there is room for.
pub(super) fn ticks(from: f64, to: f64, scale: f64) -> Vec<f64> {
    let steps = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
    let Some(step) = steps.into_iter().find(|step| step * scale >= TICK_PX) else { return vec![from, to] };
    let first = (from / step).ceil();
    let count = ((to / step).floor() - first).max(0.0);
    // Few, since each takes its room.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let count = count as usize;
    (0..=count).map(|index| (first + index as f64) * step).collect()
}

/// Text that XML takes as it is.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Positions along a path, each arc's ends among them.
pub(super) fn along(path: &ArcPath) -> Vec<Vector3<f64>> {
    let arcs = path.arcs();
    let each = (PATH / arcs.len().max(1)).max(8);
    let positions = |index: usize| {
        let arc = arcs.get(index);
        arc.into_iter().flat_map(move |arc| {
            (0..=each).map(move |i| arc.translation(arc.duration_s * i as f64 / each as f64).0.position)
        })
    };
    (0..arcs.len()).flat_map(positions).collect()
}

/// Poses spread over a path.
pub(super) fn poses(path: &ArcPath) -> Vec<Pose<f64>> {
    let duration_s = path.duration_s();
    let pose = |index: usize| {
        let (arc, time_s) = path.at(duration_s * index as f64 / (BODIES - 1) as f64)?;
        Some(arc.pose(time_s))
    };
    (0..BODIES).filter_map(pose).collect()
}

/// The picture as SVG.
pub(super) fn draw(drawn: &Drawn<'_>, view: View) -> String {
    let Drawn { title, problem, tree, way, path, poses, end_s, target } = *drawn;
    let (start, goal) = (problem.start.position, problem.goal.position);
    let reach = problem.body.bounding_radius_m();
    let lines = [path, way].into_iter().flatten().copied();
    let ends = [start, goal].into_iter().chain(lines).chain(tree.iter().flatten().copied());
    let (right, up) = view.axes();
    let spread = [right, up, -right, -up].map(|direction| direction * reach);
    let around = ends.flat_map(|point| spread.map(|by| view.of(&(point + by))));
    let mut sheet = Sheet::new(view, around);

    for volume in &problem.world.keep_in {
        sheet.rectangle(volume, "class=\"in\"");
    }
    for (index, obstacle) in problem.world.obstacles.iter().enumerate() {
        let motion = problem.obstacle_motions.iter().find(|motion| motion.obstacle == index);
        let Some(motion) = motion else {
            sheet.obstacle(obstacle, "class=\"obstacle\"");
            continue;
        };
        let at = |time_s: f64| {
            let mut moved = *obstacle;
            moved.world_from_ellipsoid.translation.vector = motion.center_at(time_s);
            moved
        };
        let style = if motion.appear_s > 0.0 { "class=\"later\"" } else { "class=\"obstacle\"" };
        sheet.obstacle(&at(motion.appear_s), style);
        if motion.velocity_world != Vector3::zeros() && end_s > motion.appear_s {
            sheet.obstacle(&at(end_s.min(motion.vanish_s)), "class=\"later\"");
        }
    }
    for volume in &problem.world.keep_out {
        sheet.rectangle(volume, "class=\"out\"");
    }
    sheet.rectangle(&problem.limits.position, "class=\"limits\"");

    let every = tree.len().div_ceil(MOST_EDGES).max(1);
    let mut edges = String::new();
    for edge in tree.iter().step_by(every) {
        edges += &sheet.line(&edge.map(|point| view.of(&point)));
    }
    sheet.path(&edges, "class=\"tree\"");
    let goal_pose = Pose::from_parts(goal.into(), problem.goal.attitude.unwrap_or(problem.attitude));
    if problem.goal.radius_m > 0.0 {
        sheet.ellipsoid(&goal_pose, &Vector3::repeat(problem.goal.radius_m), "class=\"goal\"");
    }
    let start_pose = [Pose::from_parts(start.into(), problem.attitude)];
    for pose in if poses.is_empty() { &start_pose } else { poses } {
        for part in problem.body.parts() {
            sheet.ellipsoid(&(pose * part.body_from_ellipsoid), &part.semi_axes, "class=\"body\"");
        }
    }
    for (line, style) in [(way, "class=\"way\""), (path, "class=\"path\"")] {
        let points: Vec<Point> = line.iter().map(|point| view.of(point)).collect();
        let data = sheet.line(&points);
        sheet.path(&data, style);
    }
    sheet.dot(&start, "#dc3220");
    sheet.dot(&target, "#1a8554");
    let searched = match every {
        _ if tree.is_empty() => "",
        1 => ", tree",
        _ => &format!(", every {every}th edge of the tree"),
    };
    let followed = if way.is_empty() { "" } else { " (dashed: the way that it is a part of)" };
    framed(&sheet, title, searched, followed)
}

/// The sheet with axes, title and legend.
fn framed(sheet: &Sheet, title: &str, searched: &str, followed: &str) -> String {
    let (width, height) = sheet.size();
    let (left, top, right, bottom) = MARGINS;
    let (total_px, high_px) = ((left + width + right).max(NARROWEST_PX), top + height + bottom);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{total_px:.0}\" height=\"{high_px:.0}\" viewBox=\"0 0 {total_px:.0} {high_px:.0}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <style>.in{{fill:#fff}}.obstacle{{fill:#000;fill-opacity:.25;stroke:#000;stroke-opacity:.5}}\
         .later{{fill:#000;fill-opacity:.08;stroke:#000;stroke-opacity:.5;stroke-dasharray:4}}\
         .out{{fill:#dc3220;fill-opacity:.25;stroke:#dc3220}}.limits{{fill:none;stroke:#000;stroke-opacity:.4;stroke-dasharray:2 4}}\
         .tree{{fill:none;stroke:#1a8554;stroke-opacity:.35;stroke-width:.7}}.goal{{fill:#1a8554;fill-opacity:.15;stroke:#1a8554}}\
         .body{{fill:none;stroke:#005ab5;stroke-opacity:.35}}.way{{fill:none;stroke:#005ab5;stroke-opacity:.6;stroke-dasharray:6 4}}.path{{fill:none;stroke:#005ab5;stroke-width:2}}</style>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n",
    );
    let _ = writeln!(svg, "<text x=\"{left}\" y=\"22\" font-size=\"15\">{}</text>", escaped(title));
    let _ = writeln!(
        svg,
        "<text x=\"{left}\" y=\"42\"><tspan fill=\"#005ab5\">path and body{followed}</tspan>, <tspan fill=\"#1a8554\">goal region{searched}</tspan>, \
         <tspan fill=\"#dc3220\">start, keep-out</tspan>, <tspan fill=\"#666\">obstacles; dotted: limits of position; grey ground: outside \
         the keep-in volume</tspan></text>"
    );
    let outside = if sheet.svg.contains("class=\"in\"") { "#e4e4e4" } else { "#fff" };
    let _ = writeln!(
        svg,
        "<svg x=\"{left}\" y=\"{top}\" width=\"{width:.2}\" height=\"{height:.2}\">\n<rect width=\"100%\" height=\"100%\" \
         fill=\"{outside}\"/>\n{}<rect width=\"100%\" height=\"100%\" fill=\"none\" stroke=\"#000\"/>\n</svg>",
        sheet.svg
    );
    for value in ticks(sheet.lower[0], sheet.upper[0], sheet.scale) {
        let x = left + sheet.pixel(&[value, 0.0]).0;
        let (foot, label) = (top + height, top + height + 18.0);
        let _ = writeln!(
            svg,
            "<path d=\"M{x:.2} {foot:.2}v5\" stroke=\"#000\"/><text x=\"{x:.2}\" y=\"{label:.2}\" text-anchor=\"middle\">{}</text>",
            rounded(value)
        );
    }
    let mut name = "";
    for value in ticks(sheet.lower[1], sheet.upper[1], sheet.scale) {
        let y = top + sheet.pixel(&[0.0, value]).1;
        let (axis, shown) = sheet.view.vertical(value);
        name = axis;
        let _ = writeln!(
            svg,
            "<path d=\"M{left} {y:.2}h-5\" stroke=\"#000\"/><text x=\"{:.2}\" y=\"{:.2}\" text-anchor=\"end\">{}</text>",
            left - 8.0,
            y + 4.0,
            rounded(shown)
        );
    }
    let from = match sheet.view {
        View::Top => "from above",
        View::Side => "from the side; down is down",
    };
    let _ = writeln!(
        svg,
        "<text x=\"{:.2}\" y=\"{:.2}\" text-anchor=\"middle\">y, m ({from})</text>\n\
         <text transform=\"translate(14 {:.2}) rotate(-90)\" text-anchor=\"middle\">{name}, m</text>\n</svg>",
        left + 0.5 * width,
        top + height + 40.0,
        top + 0.5 * height,
    );
    svg
}

/// A tick's number without the rounding of its making.
pub(super) fn rounded(value: f64) -> f64 {
    let value = (value * 1e6).round() / 1e6;
    if value == 0.0 { 0.0 } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_dynamics::nalgebra::UnitQuaternion;

    #[test]
    fn outlines_are_the_extreme_points_of_the_solid() {
        let rotation = UnitQuaternion::from_euler_angles(0.4, -0.7, 1.1);
        let pose = Pose::from_parts(Vector3::new(1.0, -2.0, 0.5).into(), rotation);
        let semi_axes = Vector3::new(0.3, 0.15, 0.6);
        for view in [View::Top, View::Side] {
            let outline = view.outline(&pose, &semi_axes);
            let (right, up) = view.axes();
            // In every direction of the picture no point of the solid reaches farther, and some point of the outline as far.
            for step in 0..36 {
                let angle = f64::from(step) * 0.17;
                let direction = right * angle.cos() + up * angle.sin();
                let mut farthest = f64::NEG_INFINITY;
                for i in 0..60 {
                    for j in 0..120 {
                        let (a, b) = (f64::from(i) * std::f64::consts::PI / 60.0, f64::from(j) * 0.0524);
                        let unit = Vector3::new(a.sin() * b.cos(), a.sin() * b.sin(), a.cos());
                        let point = pose * tumble_dynamics::nalgebra::Point3::from(unit.component_mul(&semi_axes));
                        farthest = farthest.max(direction.dot(&point.coords));
                    }
                }
                let drawn = outline
                    .iter()
                    .map(|point| angle.cos() * point[0] + angle.sin() * point[1])
                    .fold(f64::NEG_INFINITY, f64::max);
                assert!((drawn - farthest).abs() < 0.002, "{view:?} {step}: {drawn} {farthest}");
            }
        }
    }

    #[test]
    fn ticks_are_round_and_within() {
        let found = ticks(-9.93, -7.2, 300.0);
        assert!(found.iter().all(|tick| (-9.93..=-7.2).contains(tick)), "{found:?}");
        assert_eq!(found.iter().map(|tick| rounded(*tick)).collect::<Vec<_>>(), [-9.5, -9.0, -8.5, -8.0, -7.5]);
        assert_eq!(rounded(-1e-9).to_bits(), 0.0_f64.to_bits(), "no minus zero");
    }
}
