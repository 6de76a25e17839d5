//! Three axes that start and end together.

use super::TranslationLimits;
use super::axis::{Axis, AxisMotion, Durations, Ends};
use crate::error::LARGEST;
use crate::motion::{BodyArc, TranslationState};
use nalgebra::{UnitQuaternion, Vector3};

/// Largest number of pieces: each of three axes changes its acceleration at most twice.
pub const PIECES: usize = 7;

/// A stretch of constant acceleration; world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Length, s; positive.
    pub duration_s: f64,
    /// State at its start.
    pub start: TranslationState,
    /// Acceleration, m/s^2.
    pub acceleration_m_s2: Vector3<f64>,
}

/// A motion from one state to another: at most [`PIECES`] pieces of constant acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steering {
    duration_s: f64,
    velocity_change_m_s: f64,
    pieces: [Piece; PIECES],
    count: usize,
}

impl Steering {
    /// Length of the motion, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Integral of the sum of the acceleration's absolute components, m/s; times the mass it is the impulse, N s.
    pub fn velocity_change_m_s(&self) -> f64 {
        self.velocity_change_m_s
    }

    /// The pieces in their order; none where the two states are the same.
    pub fn pieces(&self) -> &[Piece] {
        self.pieces.get(..self.count).unwrap_or(&self.pieces)
    }

    /// The pieces at a constant attitude.
    pub fn arcs(&self, attitude: UnitQuaternion<f64>) -> impl Iterator<Item = BodyArc> + '_ {
        let arc = move |piece: &Piece| {
            BodyArc::accelerated(piece.duration_s, &piece.start, piece.acceleration_m_s2, attitude)
        };
        self.pieces().iter().map(arc)
    }
}

/// The problem along each axis with its feasible durations.
pub(super) type Axes = ([Axis; 3], [Durations; 3]);

/// Splits a problem into its axes; `None` where one of them has no motion at all.
#[inline]
pub(super) fn axes(from: &TranslationState, to: &TranslationState, limits: &TranslationLimits) -> Option<Axes> {
    let axis = |index: usize| {
        Axis::new(Ends {
            position: [from.position[index], to.position[index]],
            velocity: [from.velocity[index], to.velocity[index]],
            speed: limits.speed_m_s[index],
            acceleration: limits.acceleration_m_s2[index],
        })
    };
    let [x, y, z] = [axis(0)?, axis(1)?, axis(2)?];
    Some(([x, y, z], [x.durations(), y.durations(), z.durations()]))
}

/// The least duration from `duration_s` on that all allow; infinite where there is none. Each has one gap at most, so as many
/// rounds as there are suffice after the first.
#[inline]
pub(super) fn common<const N: usize>(durations: &[Durations; N], duration_s: f64) -> f64 {
    let raise = |duration_s: f64, durations: &Durations| durations.at_least(duration_s);
    let mut raised_s = durations.iter().fold(duration_s, raise);
    for _ in 0..N {
        let next_s = durations.iter().fold(raised_s, raise);
        if next_s <= raised_s {
            break;
        }
        raised_s = next_s;
    }
    raised_s
}

/// Least duration of a motion between two states within the limits of speed and acceleration, s; infinite where there is
/// none. The position box is not looked at.
#[inline]
pub fn least_time_s(from: &TranslationState, to: &TranslationState, limits: &TranslationLimits) -> f64 {
    axes(from, to, limits).map_or(f64::INFINITY, |(_, durations)| common(&durations, 0.0))
}

/// The motion of least duration between two states within all limits; `None` where there is none of any duration.
///
/// Whoever leaves the box in the least time leaves it in any: the turns that a motion cannot avoid only become more with
/// more time.
pub fn steer(from: &TranslationState, to: &TranslationState, limits: &TranslationLimits) -> Option<Steering> {
    let axes = axes(from, to, limits)?;
    synchronised(&axes, common(&axes.1, 0.0), limits)
}

/// A motion of exactly this duration between two states within all limits, on each axis of least peak speed and least
/// impulse; `None` where there is none.
pub fn steer_in(
    from: &TranslationState,
    to: &TranslationState,
    limits: &TranslationLimits,
    duration_s: f64,
) -> Option<Steering> {
    let axes = axes(from, to, limits)?;
    if common(&axes.1, duration_s) <= duration_s { synchronised(&axes, duration_s, limits) } else { None }
}

/// The axes' motions in a duration that all allow, merged.
#[inline]
fn synchronised((axes, durations): &Axes, duration_s: f64, limits: &TranslationLimits) -> Option<Steering> {
    let is_moderate = duration_s <= LARGEST;
    if !is_moderate {
        return None;
    }
    let motion = |index: usize| axes[index].motion(&durations[index], duration_s);
    let motions = [motion(0), motion(1), motion(2)];
    let (lower, upper) = (&limits.position.lower_world, &limits.position.upper_world);
    for ((motion, lower), upper) in motions.iter().zip(lower).zip(upper) {
        let range = motion.range();
        if !(range[0] >= *lower && range[1] <= *upper) {
            return None;
        }
    }
    Some(merge(&motions, duration_s))
}

/// One list of pieces from three.
#[inline]
fn merge(motions: &[AxisMotion; 3], duration_s: f64) -> Steering {
    let [x, y, z] = motions;
    let mut ends = [x.coast_s[0], x.coast_s[1], y.coast_s[0], y.coast_s[1], z.coast_s[0], z.coast_s[1], duration_s];
    sort(&mut ends);
    let rest = Piece {
        duration_s: 0.0,
        start: TranslationState::at_rest(Vector3::zeros()),
        acceleration_m_s2: Vector3::zeros(),
    };
    let mut pieces = [rest; PIECES];
    let mut count = 0;
    let mut start_s = 0.0;
    for end_s in ends {
        if end_s > start_s {
            let [x, y, z] = [x.piece(start_s, end_s), y.piece(start_s, end_s), z.piece(start_s, end_s)];
            if let Some(piece) = pieces.get_mut(count) {
                *piece = Piece {
                    duration_s: end_s - start_s,
                    start: TranslationState {
                        position: Vector3::new(x.0, y.0, z.0),
                        velocity: Vector3::new(x.1, y.1, z.1),
                    },
                    acceleration_m_s2: Vector3::new(x.2, y.2, z.2),
                };
                count += 1;
            }
            start_s = end_s;
        }
    }
    let velocity_change_m_s = motions.iter().map(AxisMotion::velocity_change).sum();
    Steering { duration_s, velocity_change_m_s, pieces, count }
}

/// Sorts by insertion: the least of all is the fastest for seven numbers in three sorted pairs.
#[inline]
fn sort(values: &mut [f64; PIECES]) {
    for end in 1..PIECES {
        let mut index = end;
        while index > 0 && values[index] < values[index - 1] {
            values.swap(index, index - 1);
            index -= 1;
        }
    }
}
