//! Turns from rest to rest about one axis.

use super::synchronise::{PIECES, Steering};
use crate::error::{PlanningError, finite, not_negative};
use crate::global::MotionLimits;
use crate::motion::{BodyArc, COEFFICIENTS, TranslationState};
use nalgebra::{Matrix3, Unit, UnitQuaternion, Vector3};

/// A turn about one axis: constant angular acceleration, a constant rate, the opposite acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slew {
    from: UnitQuaternion<f64>,
    axis_body: Unit<Vector3<f64>>,
    angle_rad: f64,
    rate_rad_s: f64,
    acceleration_rad_s2: f64,
    duration_s: f64,
}

impl Slew {
    /// Length, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Axis of the turn; body axes, the same at the start and at the end.
    pub fn axis_body(&self) -> Unit<Vector3<f64>> {
        self.axis_body
    }

    /// Angle turned, rad; from zero to pi.
    pub fn angle_rad(&self) -> f64 {
        self.angle_rad
    }

    /// Largest rate, rad/s.
    pub fn rate_rad_s(&self) -> f64 {
        self.rate_rad_s
    }

    /// Angular acceleration at the start; its opposite is that at the end; rad/s^2.
    pub fn acceleration_rad_s2(&self) -> f64 {
        self.acceleration_rad_s2
    }

    /// The same turn more slowly, which takes less torque; `None` for a duration below its own.
    pub fn stretched(&self, duration_s: f64) -> Option<Self> {
        if !(duration_s.is_finite() && duration_s >= self.duration_s) {
            return None;
        }
        let factor = if duration_s > 0.0 { self.duration_s / duration_s } else { 1.0 };
        Some(Self {
            rate_rad_s: self.rate_rad_s * factor,
            acceleration_rad_s2: self.acceleration_rad_s2 * factor * factor,
            duration_s,
            ..*self
        })
    }

    /// Times at which the acceleration ends and begins again, s.
    fn coast_s(&self) -> [f64; 2] {
        if self.rate_rad_s > 0.0 {
            let rise_s = (self.rate_rad_s / self.acceleration_rad_s2).min(0.5 * self.duration_s);
            [rise_s, self.duration_s - rise_s]
        } else {
            [0.0, self.duration_s]
        }
    }

    /// Angle, rate and angular acceleration at `time_s` as a stretch that ends at `end_s` has them.
    fn stretch(&self, time_s: f64, end_s: f64) -> (f64, f64, f64) {
        let [rise_s, fall_s] = self.coast_s();
        let (rate, acceleration) = (self.rate_rad_s, self.acceleration_rad_s2);
        let left_s = self.duration_s - time_s;
        if self.rate_rad_s <= 0.0 {
            (0.0, 0.0, 0.0)
        } else if end_s <= rise_s {
            (0.5 * acceleration * time_s * time_s, acceleration * time_s, acceleration)
        } else if time_s >= fall_s {
            (self.angle_rad - 0.5 * acceleration * left_s * left_s, acceleration * left_s, -acceleration)
        } else {
            (rate * (time_s - 0.5 * rise_s), rate, 0.0)
        }
    }

    /// Attitude at `time_s`.
    pub fn attitude_at(&self, time_s: f64) -> UnitQuaternion<f64> {
        let time_s = time_s.clamp(0.0, self.duration_s);
        self.turned(self.stretch(time_s, time_s).0)
    }

    /// Attitude after an angle.
    fn turned(&self, angle_rad: f64) -> UnitQuaternion<f64> {
        self.from * UnitQuaternion::from_axis_angle(&self.axis_body, angle_rad)
    }

    /// The turn together with a translation of the same duration ([`Slew::stretched`], [`super::steer_in`]), cut where either
    /// changes its acceleration; `None` where the durations differ by more than rounding.
    pub fn along<'a>(&'a self, steering: &'a Steering) -> Option<impl Iterator<Item = BodyArc> + 'a> {
        let difference_s = (steering.duration_s() - self.duration_s).abs();
        if difference_s > 1e-12 * self.duration_s {
            return None;
        }
        let cuts = self.coast_s();
        let mut start_s = 0.0;
        let mut piece = 0;
        let mut piece_start_s = 0.0;
        let bound = PIECES + cuts.len();
        Some((0..bound).map_while(move |_| {
            let current = steering.pieces().get(piece)?;
            let is_last = piece + 1 == steering.pieces().len();
            let piece_end_s = if is_last { self.duration_s } else { piece_start_s + current.duration_s };
            let next_cut = cuts.into_iter().filter(|cut| *cut > start_s).fold(f64::INFINITY, f64::min);
            let end_s = piece_end_s.min(next_cut).max(start_s);
            let within_s = start_s - piece_start_s;
            let velocity = current.start.velocity + current.acceleration_m_s2 * within_s;
            let middle = current.start.velocity + current.acceleration_m_s2 * (0.5 * within_s);
            let state = TranslationState { position: current.start.position + middle * within_s, velocity };
            let (angle_rad, rate_rad_s, acceleration_rad_s2) = self.stretch(start_s, end_s);
            let mut angle = [0.0; COEFFICIENTS];
            (angle[1], angle[2]) = (rate_rad_s, 0.5 * acceleration_rad_s2);
            let arc = BodyArc::accelerated(end_s - start_s, &state, current.acceleration_m_s2, self.turned(angle_rad))
                .turning(self.axis_body, angle);
            start_s = end_s;
            if end_s >= piece_end_s {
                piece += 1;
                piece_start_s = piece_end_s;
            }
            Some(arc)
        }))
    }
}

/// Shortest turn from rest to rest about the one axis that leads from one attitude to the other, within the torque box and
/// the limit of rate; `None` where those allow none.
///
/// With `J` the inertia about the centre of mass, `n` the axis, `s` the rate and `a` the angular acceleration, the torque
/// about the centre of mass is `a J n + s^2 n x J n`. Both signs of `a` occur at the full rate, so the largest is
/// `|a (J n)_i| + s^2 |(n x J n)_i|`. For a given full rate the largest acceleration follows, and with it the duration
/// `angle / s + s / a(s)`, which is convex in `s`: its least lies where one component's own duration is least, where two
/// components are at their limits, or at the largest rate. Slower than an arbitrary turn can be, whose axis may move.
///
/// # Frame
/// Inertia and torque in body axes, about the centre of mass: a body whose origin is elsewhere needs a force besides, or
/// turns about its centre of mass.
///
/// # Errors
/// Limits of torque or rate that are negative or not finite; an inertia that is not finite or has no inertia about the axis.
pub fn slew(
    from: &UnitQuaternion<f64>,
    to: &UnitQuaternion<f64>,
    inertia_about_com_kg_m2: &Matrix3<f64>,
    limits: &MotionLimits,
) -> Result<Option<Slew>, PlanningError> {
    for attitude in [from, to] {
        crate::error::attitude(attitude)?;
    }
    for value in &limits.torque_n_m {
        not_negative("the limit of torque", *value)?;
    }
    let fastest = not_negative("the limit of rate", limits.rate_rad_s)?;
    for value in inertia_about_com_kg_m2 {
        finite("the inertia about the centre of mass", *value)?;
    }
    let rest = Slew {
        from: *from,
        axis_body: Vector3::z_axis(),
        angle_rad: 0.0,
        rate_rad_s: 0.0,
        acceleration_rad_s2: 0.0,
        duration_s: 0.0,
    };
    let Some((axis_body, angle_rad)) = (from.inverse() * to).axis_angle() else {
        return Ok(Some(rest));
    };
    let momentum = inertia_about_com_kg_m2 * axis_body.into_inner();
    crate::error::positive("the inertia about the axis of the turn", axis_body.dot(&momentum))?;
    let load = Load { linear: momentum.abs(), centripetal: axis_body.cross(&momentum).abs(), limit: limits.torque_n_m };
    Ok(load.fastest(angle_rad, fastest).map(|(rate_rad_s, acceleration_rad_s2, duration_s)| Slew {
        axis_body,
        angle_rad,
        rate_rad_s,
        acceleration_rad_s2,
        duration_s,
        ..rest
    }))
}

/// Torque per angular acceleration and per squared rate, and its limit; per body axis, absolute values.
struct Load {
    linear: Vector3<f64>,
    centripetal: Vector3<f64>,
    limit: Vector3<f64>,
}

impl Load {
    /// Largest angular acceleration beside a squared rate; negative where the rate alone takes too much.
    fn acceleration(&self, squared_rate: f64) -> f64 {
        let mut largest = f64::INFINITY;
        for axis in 0..3 {
            let left = self.limit[axis] - squared_rate * self.centripetal[axis];
            if self.linear[axis] > 0.0 {
                largest = largest.min(left / self.linear[axis]);
            } else if left < 0.0 {
                return -1.0;
            }
        }
        largest
    }

    /// Rate, acceleration and duration of the fastest trapezoid through an angle.
    fn fastest(&self, angle_rad: f64, largest_rate: f64) -> Option<(f64, f64, f64)> {
        let Self { linear, centripetal, limit } = self;
        // The largest squared rate that the angle leaves time to reach: the triangle.
        let mut most = largest_rate * largest_rate;
        for axis in 0..3 {
            let load = linear[axis] + angle_rad * centripetal[axis];
            if load > 0.0 {
                most = most.min(angle_rad * limit[axis] / load);
            }
        }
        let mut best: Option<(f64, f64, f64)> = None;
        let mut consider = |squared: f64| {
            if !(squared > 0.0 && squared <= most) {
                return;
            }
            let (rate, acceleration) = (f64::sqrt(squared), self.acceleration(squared));
            if acceleration > 0.0 {
                let duration_s = angle_rad / rate + (rate / acceleration).min(angle_rad / rate);
                if best.is_none_or(|(_, _, least_s)| duration_s < least_s) {
                    best = Some((rate, acceleration.max(squared / angle_rad), duration_s));
                }
            }
        };
        consider(most);
        for one in 0..3 {
            // Least of angle / s + s A / (L - s^2 B): with y = s^2 B / L and k = A / (angle B), (1 - y)^2 = k y (1 + y).
            if centripetal[one] > 0.0 {
                let ratio = linear[one] / (angle_rad * centripetal[one]);
                let half = 1.0 + 0.5 * ratio;
                let root = 1.0 / (half + f64::sqrt(half * half - (1.0 - ratio)));
                consider(root * limit[one] / centripetal[one]);
            }
            for other in 0..one {
                let slope = centripetal[one] * linear[other] - centripetal[other] * linear[one];
                consider((limit[one] * linear[other] - limit[other] * linear[one]) / slope);
            }
        }
        best
    }
}
