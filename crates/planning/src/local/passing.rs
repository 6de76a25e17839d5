//! On which sides obstacles can be passed: ways to begin searches with.
//!
//! The straight way and each obstacle that blocks it leave several sides on which to pass, and with them as many local minima of
//! a plan's cost. A search that begins on one side mostly stays there, so a plan begins once on each.

use super::model::Kinematics;
use super::surroundings::{Hull, Surroundings};
use crate::collision::Blocker;
use nalgebra::{Unit, Vector3};

/// Most ways.
pub const MOST_WAYS: usize = 6;

/// A way from start to goal, smooth, at rest at its end, that swerves aside at up to two times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassingWay {
    start: Vector3<f64>,
    velocity: Vector3<f64>,
    end: Vector3<f64>,
    horizon_s: f64,
    swerves: [Swerve; 2],
}

/// Sideways and back.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Swerve {
    /// Farthest aside, world axes, m.
    offset: Vector3<f64>,
    /// When, since the start, s.
    time_s: f64,
}

impl PassingWay {
    /// Position and acceleration at a time since the start, world axes, m and m/s^2.
    pub fn at(&self, time_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (h, s) = (self.horizon_s, (time_s / self.horizon_s).clamp(0.0, 1.0));
        // The quintic that starts with the velocity and ends at rest, without acceleration at both ends.
        let (gone, coast) = (self.end - self.start, self.velocity * h);
        let mut position = self.start
            + gone * (s * s * s * (10.0 + s * (-15.0 + s * 6.0)))
            + coast * (s + s * s * s * (-6.0 + s * (8.0 - s * 3.0)));
        let mut acceleration =
            gone * (s * (60.0 + s * (-180.0 + s * 120.0))) + coast * (s * (-36.0 + s * (96.0 - s * 60.0)));
        acceleration /= h * h;
        for swerve in &self.swerves {
            let (there_s, back_s) = (swerve.time_s, h - swerve.time_s);
            let (along, length_s) =
                if time_s < there_s { (time_s / there_s, there_s) } else { ((h - time_s) / back_s, back_s) };
            let (angle, rate) = (core::f64::consts::PI * along, core::f64::consts::PI / length_s);
            position += swerve.offset * (0.5 - 0.5 * libm::cos(angle));
            acceleration += swerve.offset * (0.5 * rate * rate * libm::cos(angle));
        }
        (position, acceleration)
    }
}

/// The ways found, the most promising first; none where nothing blocks the straight way.
#[derive(Clone, Debug, PartialEq)]
pub struct PassingWays {
    ways: [PassingWay; MOST_WAYS],
    count: usize,
}

impl PassingWays {
    /// The ways.
    pub fn as_slice(&self) -> &[PassingWay] {
        self.ways.get(..self.count).unwrap_or(&self.ways)
    }
}

/// What a body starts with, where it should go, and what it can.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing<'a> {
    /// Start.
    pub start: &'a Kinematics,
    /// Mission time of the start, s.
    pub start_s: f64,
    /// Goal, world axes, m.
    pub goal_world: Vector3<f64>,
    /// Time for the way, s.
    pub horizon_s: f64,
    /// Acceleration with which the way may be planned, m/s^2.
    pub acceleration_m_s2: f64,
    /// Distance kept, m.
    pub margin_m: f64,
    /// The normal of the plane in which alone the body moves, if it does, world axes.
    pub plane_normal: Option<Unit<Vector3<f64>>>,
}

/// An obstacle across the straight way.
#[derive(Clone, Copy)]
struct Block {
    time_s: f64,
    /// How far the way must be moved to the side on which that is least, m.
    depth_m: f64,
    /// Sides, the most promising first.
    offsets: [Vector3<f64>; SIDES],
    sides: usize,
}

/// Sides of one obstacle.
const SIDES: usize = 4;
/// Directions around the way that are looked at for the nearest side.
const DIRECTIONS: usize = 24;
/// Times at which an obstacle is looked for abeam.
const TIMES: usize = 48;
/// How much farther than needed a way swerves.
const GENEROUS: f64 = 1.1;
/// Sides in space from the nearest one, in directions: past a round obstacle on a straight way no side is a class of its own, but
/// a sixth of a turn to either side of the nearest one what else is around tells them apart; and the far side.
const TURNS: [usize; SIDES] = [DIRECTIONS / 6, DIRECTIONS - DIRECTIONS / 6, DIRECTIONS / 2, 0];

/// Ways past the one or two obstacles that block the straight way most, one for each choice of sides.
pub fn passing_ways(crossing: &Crossing<'_>, surroundings: &Surroundings) -> PassingWays {
    let start = crossing.start.world_from_body.translation.vector;
    let (velocity, horizon_s) = (crossing.start.velocity_world, crossing.horizon_s);
    // As far as the acceleration carries: the way's own peaks at 5.8 times distance over squared time.
    let farthest_m = crossing.acceleration_m_s2 * horizon_s * horizon_s / 5.8;
    let wanted = crossing.goal_world - start;
    let wanted_m = f64::sqrt(wanted.norm_squared());
    let end = start + wanted * f64::min(1.0, farthest_m / wanted_m.max(f64::MIN_POSITIVE));
    let none = Swerve { offset: Vector3::zeros(), time_s: 0.5 * horizon_s };
    let straight = PassingWay { start, velocity, end, horizon_s, swerves: [none; 2] };
    let mut found = PassingWays { ways: [straight; MOST_WAYS], count: 0 };

    let [first, second] = blocks(crossing, surroundings, &straight);
    let Some(first) = first else { return found };
    let place = |time_s: f64| f64::clamp(time_s, 0.25 * horizon_s, 0.75 * horizon_s);
    let mut add = |swerves: [Swerve; 2]| {
        if let Some(way) = found.ways.get_mut(found.count) {
            way.swerves = swerves;
            found.count += 1;
        }
    };
    match second {
        None => {
            for offset in first.offsets.iter().take(first.sides) {
                add([Swerve { offset: *offset, time_s: place(first.time_s) }, none]);
            }
        }
        Some(second) => {
            // All of the two best sides of each, then the others of the one that blocks most.
            let pairs = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)];
            for (i, j) in pairs.into_iter().filter(|(i, j)| *i < first.sides && *j < second.sides) {
                add([
                    Swerve { offset: first.offsets[i], time_s: place(first.time_s) },
                    Swerve { offset: second.offsets[j], time_s: place(second.time_s) },
                ]);
            }
        }
    }
    found
}

/// The two that block most.
fn blocks(crossing: &Crossing<'_>, surroundings: &Surroundings, straight: &PassingWay) -> [Option<Block>; 2] {
    let mut most: [Option<Block>; 2] = [None; 2];
    let along = straight.end - straight.start;
    let Some(along) = Unit::try_new(along, 1e-9) else { return most };
    let across = match &crossing.plane_normal {
        Some(normal) => normal.cross(&along),
        // The world axis most across the way.
        None => along.cross(&Vector3::ith(along.iamin(), 1.0)),
    };
    let Some(across) = Unit::try_new(across, 1e-9) else { return most };
    let other = along.cross(&across);
    let radius_m = crossing.margin_m
        + match surroundings.hull() {
            Hull::Point => 0.0,
            Hull::Shape(shape) => shape.bounding_radius_m(),
        };
    for (index, (blocker, _)) in surroundings.barriers().iter().enumerate() {
        if *blocker == Blocker::KeepIn {
            continue;
        }
        let Some(time_s) = abeam(crossing, surroundings, index, straight, &along) else { continue };
        let (position, _) = straight.at(time_s);
        // How far aside the way must go in each direction.
        let direction = |turn: usize| {
            let angle = core::f64::consts::TAU * turn as f64 / DIRECTIONS as f64;
            across.into_inner() * libm::cos(angle) + other * libm::sin(angle)
        };
        let aside_m = |normal: &Vector3<f64>| {
            surroundings.support(index, normal, crossing.start_s + time_s) - normal.dot(&position) + radius_m
        };
        let step = if crossing.plane_normal.is_some() { DIRECTIONS / 2 } else { 1 };
        let mut nearest = (0, f64::INFINITY);
        for turn in (0..DIRECTIONS).step_by(step) {
            let depth_m = aside_m(&direction(turn));
            if depth_m < nearest.1 {
                nearest = (turn, depth_m);
            }
        }
        if nearest.1 <= 0.0 {
            continue;
        }
        let turns = if crossing.plane_normal.is_some() { [0, DIRECTIONS / 2, 0, 0] } else { TURNS };
        let mut normals = turns.map(|turn| direction((nearest.0 + turn) % DIRECTIONS));
        if crossing.plane_normal.is_none() && aside_m(&normals[1]) < aside_m(&normals[0]) {
            normals.swap(0, 1);
        }
        let offsets = normals.map(|normal| normal * (GENEROUS * f64::max(0.0, aside_m(&normal))));
        let sides = if crossing.plane_normal.is_some() { 2 } else { SIDES };
        let block = Block { time_s, depth_m: nearest.1, offsets, sides };
        let is_deeper = |than: &Option<Block>| than.is_none_or(|than| than.depth_m < block.depth_m);
        if is_deeper(&most[0]) {
            most = [Some(block), most[0]];
        } else if is_deeper(&most[1]) {
            most[1] = Some(block);
        }
    }
    most
}

/// When the straight way passes the middle of a barrier, since the start, while that is there.
fn abeam(
    crossing: &Crossing<'_>,
    surroundings: &Surroundings,
    index: usize,
    straight: &PassingWay,
    along: &Vector3<f64>,
) -> Option<f64> {
    let ahead_m = |time_s: f64| {
        let (from_s, backward) = (crossing.start_s + time_s, -along);
        let (front, back) =
            (surroundings.support(index, &backward, from_s), surroundings.support(index, along, from_s));
        0.5 * (back - front) - along.dot(&straight.at(time_s).0)
    };
    let mut before = (0.0, ahead_m(0.0));
    for step in 1..=TIMES {
        let time_s = crossing.horizon_s * step as f64 / TIMES as f64;
        let here = (time_s, ahead_m(time_s));
        if before.1 >= 0.0 && here.1 < 0.0 {
            let passed_s = before.0 + (here.0 - before.0) * before.1 / (before.1 - here.1);
            let mission_s = crossing.start_s + passed_s;
            return surroundings.is_present(index, mission_s).then_some(passed_s);
        }
        before = here;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::MovingObstacle;
    use crate::local::surroundings::{RowSettings, Surroundings};
    use nalgebra::UnitQuaternion;
    use tumble_dynamics::{AlignedBox, ObstacleEllipsoid, World};
    use tumble_lie::Pose;

    fn at_rest(position: Vector3<f64>) -> Kinematics {
        Kinematics {
            world_from_body: Pose::from_parts(position.into(), UnitQuaternion::identity()),
            velocity_world: Vector3::zeros(),
            rate_body: Vector3::zeros(),
        }
    }

    fn crossing(start: &Kinematics) -> Crossing<'_> {
        Crossing {
            start,
            start_s: 5.0,
            goal_world: Vector3::new(0.9, 0.4, 0.2),
            horizon_s: 12.0,
            acceleration_m_s2: 0.05,
            margin_m: 0.0,
            plane_normal: None,
        }
    }

    fn ellipsoid(center: [f64; 3], semi_axes: [f64; 3]) -> MovingObstacle {
        let [x, y, z] = center;
        MovingObstacle::at_rest(ObstacleEllipsoid {
            world_from_ellipsoid: Pose::translation(x, y, z),
            semi_axes: semi_axes.into(),
        })
    }

    /// The two obstacles of the frozen problem: the first blocks.
    fn two() -> Surroundings {
        let obstacles =
            [ellipsoid([0.45, 0.12, 0.10], [0.25, 0.20, 0.20]), ellipsoid([0.70, 0.50, 0.0], [0.2, 0.2, 0.25])];
        Surroundings::none().with_moving(obstacles).unwrap()
    }

    #[test]
    fn a_way_begins_as_the_body_does_and_its_acceleration_is_that_of_its_position() {
        let mut start = at_rest(Vector3::new(0.1, -0.2, 0.0));
        start.velocity_world = Vector3::new(0.05, 0.02, -0.03);
        let found = passing_ways(&crossing(&start), &two());
        assert!(!found.as_slice().is_empty());
        for way in found.as_slice() {
            let step = 1e-3;
            let at = |time_s: f64| way.at(time_s).0;
            assert!((at(0.0) - start.world_from_body.translation.vector).norm() < 1e-15);
            assert!(((at(step) - at(0.0)) / step - start.velocity_world).norm() < 1e-3);
            assert!((at(12.0) - Vector3::new(0.9, 0.4, 0.2)).norm() < 1e-12);
            assert!(((at(12.0) - at(12.0 - step)) / step).norm() < 1e-3);
            for i in 1..120 {
                let time_s = 0.1 * f64::from(i);
                let second = (at(time_s + step) - at(time_s) * 2.0 + at(time_s - step)) / (step * step);
                let swerve_s = way.swerves[0].time_s;
                if (time_s - swerve_s).abs() > 2.0 * step {
                    assert!((way.at(time_s).1 - second).norm() < 1e-6, "{time_s}");
                }
            }
        }
    }

    /// Each way is free of what blocks, on a side of its own; the two best classes of the frozen problem lie below and above.
    #[test]
    fn ways_pass_on_different_sides() {
        let (start, surroundings) = (at_rest(Vector3::zeros()), two());
        let found = passing_ways(&crossing(&start), &surroundings);
        assert_eq!(found.as_slice().len(), 4);
        let abeam = found.as_slice().iter().map(|way| way.at(5.65).0).collect::<Vec<_>>();
        let line = Vector3::new(0.9, 0.4, 0.2) * (abeam[0].x / 0.9);
        let aside: Vec<_> = abeam.iter().map(|p| (p - line).z).collect();
        assert!(aside[0] * aside[1] < 0.0, "one above and one below: {aside:?}");
        for (i, a) in abeam.iter().enumerate() {
            for b in &abeam[..i] {
                assert!((a - b).norm() > 0.1, "{abeam:?}");
            }
        }
        let settings = RowSettings {
            start_s: 5.0,
            step_s: 0.5,
            margin_m: 0.0,
            interpolation_error_m: 0.0,
            length_scale_m: 0.1,
            on_segments: false,
        };
        for way in found.as_slice() {
            let motion: Vec<_> = (0..=24).map(|k| at_rest(way.at(0.5 * f64::from(k)).0)).collect();
            let mut values = vec![0.0; 48];
            surroundings.values(&motion, &settings, &mut values);
            // Of the obstacle that blocks; that the other is met now and then the search sees to.
            assert!(values[..24].iter().all(|value| *value > -0.1), "{values:?}");
        }
    }

    #[test]
    fn nothing_in_the_way_gives_no_ways() {
        let start = at_rest(Vector3::zeros());
        assert!(passing_ways(&crossing(&start), &Surroundings::none()).as_slice().is_empty());
        let beside = Surroundings::none().with_moving([ellipsoid([0.45, 1.2, 0.1], [0.25; 3])]).unwrap();
        assert!(passing_ways(&crossing(&start), &beside).as_slice().is_empty());
        let behind = Surroundings::none().with_moving([ellipsoid([-0.9, -0.4, -0.2], [0.25; 3])]).unwrap();
        assert!(passing_ways(&crossing(&start), &behind).as_slice().is_empty());
        let gone = ellipsoid([0.45, 0.2, 0.1], [0.2; 3]).present(0.0, 6.0);
        let gone = Surroundings::none().with_moving([gone]).unwrap();
        assert!(passing_ways(&crossing(&start), &gone).as_slice().is_empty());
        let here = Crossing { goal_world: Vector3::zeros(), ..crossing(&start) };
        assert!(passing_ways(&here, &two()).as_slice().is_empty());
    }

    /// What drifts across the way blocks it when it gets there, not where it began.
    #[test]
    fn a_drifting_obstacle_blocks_where_it_is_met() {
        let start = at_rest(Vector3::zeros());
        // At mission time 11, in the middle of the way.
        let drifting = ellipsoid([0.45, 0.2 - 0.66, 0.1], [0.2; 3]).drifting(Vector3::new(0.0, 0.11, 0.0), 5.0);
        let found = passing_ways(&crossing(&start), &Surroundings::none().with_moving([drifting]).unwrap());
        assert_eq!(found.as_slice().len(), 4);
        let early = ellipsoid([0.45, 0.2, 0.1], [0.2; 3]).drifting(Vector3::new(0.0, 0.11, 0.0), 5.0);
        assert!(
            passing_ways(&crossing(&start), &Surroundings::none().with_moving([early]).unwrap()).as_slice().is_empty()
        );
    }

    #[test]
    fn in_a_plane_there_are_two_sides() {
        let start = at_rest(Vector3::zeros());
        let column = World {
            keep_out: vec![AlignedBox {
                lower_world: Vector3::new(0.3, -0.1, -1.0),
                upper_world: Vector3::new(0.5, 0.2, 1.0),
            }],
            keep_in: vec![AlignedBox { lower_world: Vector3::repeat(-2.0), upper_world: Vector3::repeat(2.0) }],
            ..World::default()
        };
        let surroundings = Surroundings::of_world(&column, Hull::Point).unwrap();
        let plane = Crossing {
            goal_world: Vector3::new(0.9, 0.0, 0.0),
            plane_normal: Some(Vector3::z_axis()),
            ..crossing(&start)
        };
        let found = passing_ways(&plane, &surroundings);
        assert_eq!(found.as_slice().len(), 2);
        let swerves: Vec<_> = found.as_slice().iter().map(|way| way.swerves[0].offset).collect();
        // The nearer side first, each as far as the side reaches and a tenth more.
        assert!((swerves[0] - Vector3::new(0.0, -0.11, 0.0)).norm() < 1e-12, "{swerves:?}");
        assert!((swerves[1] - Vector3::new(0.0, 0.22, 0.0)).norm() < 1e-12, "{swerves:?}");
    }

    #[test]
    fn two_that_block_give_every_pair_of_sides() {
        let start = at_rest(Vector3::zeros());
        let obstacles = [ellipsoid([0.3, 0.05, 0.0], [0.1; 3]), ellipsoid([0.6, -0.05, 0.0], [0.1; 3])];
        let surroundings = Surroundings::none().with_moving(obstacles).unwrap();
        let plane = Crossing {
            goal_world: Vector3::new(0.9, 0.0, 0.0),
            plane_normal: Some(Vector3::z_axis()),
            ..crossing(&start)
        };
        assert_eq!(passing_ways(&plane, &surroundings).as_slice().len(), 4);
        let space = Crossing { plane_normal: None, ..plane };
        assert_eq!(passing_ways(&space, &surroundings).as_slice().len(), MOST_WAYS);
    }
}
