//! Motions that planners make and collision checks follow: exact polynomials, nothing sampled.

use nalgebra::{Unit, UnitQuaternion, Vector3};
use tumble_lie::Pose;

/// Largest number of coefficients of a polynomial in time: degree 5.
pub const COEFFICIENTS: usize = 6;

/// One stretch of a body's motion: the position of its origin is a polynomial in time, its attitude turns about one axis by
/// a polynomial angle.
///
/// # Frame
/// Positions in world axes. The axis is the same in body and in world axes turned by the attitude at the start, because a
/// turn leaves its own axis alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyArc {
    /// Length, s; not negative.
    pub duration_s: f64,
    /// Coefficients of the position in powers of the time since the start, m / s^k.
    pub position: [Vector3<f64>; COEFFICIENTS],
    /// Attitude at the start, `world_from_body`.
    pub attitude: UnitQuaternion<f64>,
    /// Axis of the turn, body axes.
    pub axis_body: Unit<Vector3<f64>>,
    /// Coefficients of the angle in powers of the time since the start, rad / s^k; the first is zero.
    pub angle: [f64; COEFFICIENTS],
}

/// Value of a polynomial and of its first two derivatives.
fn polynomial<const N: usize>(
    coefficients: &[Vector3<f64>; N],
    time_s: f64,
) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
    let zero = Vector3::zeros();
    coefficients.iter().rev().fold((zero, zero, zero), |(value, slope, bend), coefficient| {
        (value * time_s + coefficient, slope * time_s + value, bend * time_s + slope * 2.0)
    })
}

impl BodyArc {
    /// Constant acceleration at a constant attitude.
    pub fn accelerated(
        duration_s: f64,
        start: &TranslationState,
        acceleration_world: Vector3<f64>,
        attitude: UnitQuaternion<f64>,
    ) -> Self {
        let mut position = [Vector3::zeros(); COEFFICIENTS];
        position[..3].copy_from_slice(&[start.position, start.velocity, acceleration_world * 0.5]);
        Self { duration_s, position, attitude, axis_body: Vector3::z_axis(), angle: [0.0; COEFFICIENTS] }
    }

    /// The same translation with a turn by `angle` (coefficients in powers of time) about `axis_body`.
    pub fn turning(mut self, axis_body: Unit<Vector3<f64>>, angle: [f64; COEFFICIENTS]) -> Self {
        self.axis_body = axis_body;
        self.angle = angle;
        self
    }

    /// Position and velocity of the origin, and its acceleration, `time_s` after the start; world axes.
    pub fn translation(&self, time_s: f64) -> (TranslationState, Vector3<f64>) {
        let (position, velocity, acceleration) = polynomial(&self.position, time_s);
        (TranslationState { position, velocity }, acceleration)
    }

    /// Angle turned since the start, its rate and the rate of that; rad, rad/s, rad/s^2.
    pub fn turn(&self, time_s: f64) -> (f64, f64, f64) {
        self.angle.iter().rev().fold((0.0, 0.0, 0.0), |(value, slope, bend), coefficient| {
            (value * time_s + coefficient, slope * time_s + value, bend * time_s + slope * 2.0)
        })
    }

    /// True where the attitude stays what it is.
    pub fn is_level(&self) -> bool {
        self.angle.iter().all(|coefficient| *coefficient == 0.0)
    }

    /// Attitude `time_s` after the start, `world_from_body`.
    pub fn attitude_at(&self, time_s: f64) -> UnitQuaternion<f64> {
        if self.is_level() {
            return self.attitude;
        }
        self.attitude * UnitQuaternion::from_axis_angle(&self.axis_body, self.turn(time_s).0)
    }

    /// Pose `time_s` after the start, `world_from_body`.
    pub fn pose(&self, time_s: f64) -> Pose<f64> {
        Pose::from_parts(self.translation(time_s).0.position.into(), self.attitude_at(time_s))
    }
}

/// Position and velocity of the body origin, world axes, m and m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TranslationState {
    /// Position, m.
    pub position: Vector3<f64>,
    /// Velocity, m/s.
    pub velocity: Vector3<f64>,
}

impl TranslationState {
    /// At rest there.
    pub fn at_rest(position: Vector3<f64>) -> Self {
        Self { position, velocity: Vector3::zeros() }
    }
}

/// A whole motion: arcs one after the other, each beginning where the last one ended.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct ArcPath {
    arcs: Vec<BodyArc>,
}

impl ArcPath {
    /// These arcs in their order; arcs of no length are left out.
    pub fn new(arcs: impl IntoIterator<Item = BodyArc>) -> Self {
        Self { arcs: arcs.into_iter().filter(|arc| arc.duration_s > 0.0).collect() }
    }

    /// The arcs.
    pub fn arcs(&self) -> &[BodyArc] {
        &self.arcs
    }

    /// Length, s.
    pub fn duration_s(&self) -> f64 {
        // An empty sum is minus zero.
        self.arcs.iter().map(|arc| arc.duration_s).sum::<f64>() + 0.0
    }

    /// The arc that holds the time `time_s` since the start of the path, s, and the time within it, for
    /// [`BodyArc::pose`] and [`BodyArc::translation`]. Outside the path the start or the end; `None` for a path without arcs.
    pub fn at(&self, time_s: f64) -> Option<(&BodyArc, f64)> {
        let last = self.arcs.len().checked_sub(1)?;
        let mut within = time_s.max(0.0);
        for (index, arc) in self.arcs.iter().enumerate() {
            if within <= arc.duration_s || index == last {
                return Some((arc, within.min(arc.duration_s)));
            }
            within -= arc.duration_s;
        }
        None
    }
}
