//! Curves of missions, seen from above.

use std::f64::consts::TAU;

use tumble::mission::MissionRecord;

use crate::actuation::curve;
use crate::plot::Curve;

/// Ends a line.
const BREAK: (f64, f64) = (f64::NAN, f64::NAN);
/// Corners of a drawn ellipse.
const CORNERS: u32 = 48;

pub fn path(name: &str, points_m: &[[f64; 3]]) -> Curve {
    curve(name, points_m.iter().map(|[x, y, _]| (*x, *y)))
}

/// Several lines under one name.
pub fn segments<'a>(name: &str, lines: impl Iterator<Item = &'a [[f64; 3]]>) -> Curve {
    curve(name, lines.flat_map(|line| line.iter().map(|[x, y, _]| (*x, *y)).chain([BREAK])))
}

/// Obstacles, grown by the robot's radius.
pub fn outlines(record: &MissionRecord) -> Curve {
    let outline = |solid: &tumble::mission::DrawnEllipsoid| {
        let ([x, y, _], [a, b, _], r) = (solid.center_m, solid.semi_axes_m, record.robot_radius_m);
        let corner = move |k: u32| {
            let angle = TAU * f64::from(k) / f64::from(CORNERS);
            (x + (a + r) * angle.cos(), y + (b + r) * angle.sin())
        };
        (0..=CORNERS).map(corner).chain([BREAK])
    };
    curve("obstacles and the robot's radius", record.obstacles.iter().flat_map(outline))
}
