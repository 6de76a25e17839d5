//! Where the body is with respect to volumes and obstacles, and the events that follow.

use std::fmt;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{AlignedBox, ObstacleEllipsoid, World};

/// What a body touches or has left; all clear by default.
///
/// The body is a sphere against keep-out boxes and obstacles and its origin against keep-in boxes and the table's edge.
/// Against an ellipsoid the test is approximate: the semi-axes grow by the radius, which is exact along the axes
/// and lets the sphere come a little too near in between.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(clippy::struct_excessive_bools)] // each stands for a limit of its own
pub struct Surroundings {
    /// The origin is in no keep-in box.
    pub outside_keep_in: bool,
    /// The origin is beyond the edge of the table.
    pub off_table: bool,
    /// The first keep-out box touched.
    pub keep_out: Option<usize>,
    /// The first obstacle touched.
    pub obstacle: Option<usize>,
    /// The origin moves faster than it should; looked at by the simulator only.
    pub too_fast: bool,
    /// The body turns faster than it should; looked at by the simulator only.
    pub turning_too_fast: bool,
}

/// An obstacle that moves, or is not there all the time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObstacleMotion {
    /// Which one of the world.
    pub obstacle: usize,
    /// Its centre at time zero, m.
    pub center_world: Vector3<f64>,
    /// Velocity of the centre, m/s.
    pub velocity_world: Vector3<f64>,
    /// When it appears, s.
    pub appear_s: f64,
    /// When it vanishes, s.
    pub vanish_s: f64,
}

impl ObstacleMotion {
    /// Whether it is there at a time.
    pub fn is_there(&self, time_s: f64) -> bool {
        self.appear_s <= time_s && time_s < self.vanish_s
    }

    /// Where its centre is at a time.
    pub fn center_at(&self, time_s: f64) -> Vector3<f64> {
        self.center_world + self.velocity_world * time_s
    }
}

/// Something that happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// The origin left the keep-in boxes.
    LeftKeepIn,
    /// It is inside again.
    BackInKeepIn,
    /// The origin passed the edge of the table.
    LeftTable,
    /// It is above the table again.
    BackOnTable,
    /// The robot's sphere reached into a keep-out box.
    EnteredKeepOut {
        /// Which one, from zero.
        index: usize,
    },
    /// It is clear of keep-out boxes again.
    LeftKeepOut,
    /// The robot's sphere reached into an obstacle; a real one would have been hit.
    HitObstacle {
        /// Which one, from zero.
        index: usize,
    },
    /// It is clear of obstacles again.
    LeftObstacle,
    /// The speed limit was passed.
    TooFast,
    /// The speed is within its limit again.
    SlowAgain,
    /// The limit of the angular rate was passed.
    TurningTooFast,
    /// The angular rate is within its limit again.
    TurningSlowlyAgain,
    /// A payload was taken hold of.
    PayloadAttached,
    /// The payload was let go.
    PayloadReleased,
}

impl Event {
    /// Whether it should not have happened.
    pub fn is_violation(self) -> bool {
        matches!(
            self,
            Self::LeftKeepIn
                | Self::LeftTable
                | Self::EnteredKeepOut { .. }
                | Self::HitObstacle { .. }
                | Self::TooFast
                | Self::TurningTooFast
        )
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LeftKeepIn => write!(f, "left the keep-in volume"),
            Self::BackInKeepIn => write!(f, "back in the keep-in volume"),
            Self::LeftTable => write!(f, "left the table"),
            Self::BackOnTable => write!(f, "back on the table"),
            Self::EnteredKeepOut { index } => write!(f, "entered keep-out box {index}"),
            Self::LeftKeepOut => write!(f, "clear of keep-out boxes"),
            Self::HitObstacle { index } => write!(f, "hit obstacle {index}"),
            Self::LeftObstacle => write!(f, "clear of obstacles"),
            Self::TooFast => write!(f, "faster than the limit"),
            Self::SlowAgain => write!(f, "within the speed limit again"),
            Self::TurningTooFast => write!(f, "turning faster than the limit"),
            Self::TurningSlowlyAgain => write!(f, "turning within the limit again"),
            Self::PayloadAttached => write!(f, "payload attached"),
            Self::PayloadReleased => write!(f, "payload released"),
        }
    }
}

/// An event and its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimedEvent {
    /// Time since the start, ns.
    pub time_ns: i64,
    /// What happened.
    pub event: Event,
}

impl Surroundings {
    /// Around a robot with its origin at `position_world`.
    pub fn of(world: &World, table_half_width_m: Option<f64>, position_world: &Vector3<f64>, radius_m: f64) -> Self {
        Self::among(world, |_| true, table_half_width_m, position_world, radius_m)
    }

    /// The same where only some of the world's obstacles are there.
    pub fn among(
        world: &World,
        is_there: impl Fn(usize) -> bool,
        table_half_width_m: Option<f64>,
        position_world: &Vector3<f64>,
        radius_m: f64,
    ) -> Self {
        let p = position_world;
        let mut obstacles = world.obstacles.iter().enumerate();
        Self {
            outside_keep_in: !world.keep_in.is_empty() && !world.keep_in.iter().any(|b| distance(b, p) <= 0.0),
            off_table: table_half_width_m.is_some_and(|half| p.x.abs().max(p.y.abs()) > half),
            keep_out: world.keep_out.iter().position(|b| distance(b, p) <= radius_m),
            obstacle: obstacles
                .find(|(index, obstacle)| is_there(*index) && touches(obstacle, p, radius_m))
                .map(|(index, _)| index),
            ..Self::default()
        }
    }

    /// What is not as it should be.
    pub fn events_of(around: &Self) -> impl Iterator<Item = Event> {
        Self::changes(&Self::default(), around).into_iter().flatten()
    }

    /// What turned `before` into `after`, in no more than one event for each field.
    pub(super) fn changes(before: &Self, after: &Self) -> [Option<Event>; 6] {
        let flag = |was: bool, is: bool, left: Event, back: Event| match (was, is) {
            (false, true) => Some(left),
            (true, false) => Some(back),
            _ => None,
        };
        let index = |was: Option<usize>, is: Option<usize>, entered: fn(usize) -> Event, clear: Event| match is {
            Some(index) if was != is => Some(entered(index)),
            None if was.is_some() => Some(clear),
            _ => None,
        };
        [
            flag(before.outside_keep_in, after.outside_keep_in, Event::LeftKeepIn, Event::BackInKeepIn),
            flag(before.off_table, after.off_table, Event::LeftTable, Event::BackOnTable),
            index(before.keep_out, after.keep_out, |index| Event::EnteredKeepOut { index }, Event::LeftKeepOut),
            index(before.obstacle, after.obstacle, |index| Event::HitObstacle { index }, Event::LeftObstacle),
            flag(before.too_fast, after.too_fast, Event::TooFast, Event::SlowAgain),
            flag(before.turning_too_fast, after.turning_too_fast, Event::TurningTooFast, Event::TurningSlowlyAgain),
        ]
    }
}

/// From a point to a box, zero inside, m.
fn distance(b: &AlignedBox, point: &Vector3<f64>) -> f64 {
    let beyond = (b.lower_world - point).sup(&(point - b.upper_world)).sup(&Vector3::zeros());
    beyond.norm()
}

/// Whether the sphere reaches into the ellipsoid, its semi-axes grown by the radius.
fn touches(obstacle: &ObstacleEllipsoid, point: &Vector3<f64>, radius_m: f64) -> bool {
    let local = obstacle.world_from_ellipsoid.inverse_transform_point(&(*point).into()).coords;
    local.component_div(&obstacle.semi_axes.add_scalar(radius_m)).norm_squared() < 1.0
}
