//! One axis: motions between two positions and speeds within a largest acceleration and speed.
//!
//! All motions between two states in a time `T` reach a convex set of displacements, because the controls that respect the
//! limits and both speeds are one. Its ends are reached at full acceleration towards a speed `c` beyond both boundary
//! speeds, a coast at `c`, and full acceleration to the last speed; every displacement between them by the same motion with
//! another `c`. So existence and the motion both follow from one quadratic.

use crate::error::LARGEST;

/// Relative error that a boundary state may carry without being taken for another problem: some roundings.
pub(super) const ROUNDINGS: f64 = 4.0 * f64::EPSILON;

/// How far a boundary speed may lie beyond the limit, relative to it, and still count as on it.
pub(super) const SPEED_TOLERANCE: f64 = 1e-12;

/// The two ends along one axis, and the limits between them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ends {
    /// Positions, m.
    pub position: [f64; 2],
    /// Speeds, m/s.
    pub velocity: [f64; 2],
    /// Largest speed, m/s.
    pub speed: f64,
    /// Largest acceleration, m/s^2.
    pub acceleration: f64,
}

/// A problem that the limits do not rule out at sight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    ends: Ends,
    /// Lower and higher of the two speeds.
    low: f64,
    high: f64,
    /// Least time between the two speeds, s.
    direct_s: f64,
    /// Displacement beyond that of the direct change of speed, m.
    surplus: f64,
    /// What rounding of the ends can change it by, m.
    slack: f64,
    /// What rounding of the ends can change the direct time by, s.
    slack_s: f64,
}

/// Durations in which a motion exists: from `least_s` on, but for the open gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Durations {
    /// The least one, s; infinite where there is none.
    pub least_s: f64,
    /// Speed coasted at, or turned at, in the least time.
    pub least_coast: f64,
    /// Motions exist up to the first of these, and from the second on, s; both infinite without a gap.
    pub gap_s: [f64; 2],
    /// Speed turned at when the gap has ended.
    pub gap_coast: f64,
}

impl Durations {
    pub const NONE: Self = Self { least_s: f64::INFINITY, least_coast: 0.0, gap_s: [f64::INFINITY; 2], gap_coast: 0.0 };

    /// The least feasible duration that is not below `duration_s`.
    #[inline]
    pub fn at_least(&self, duration_s: f64) -> f64 {
        if duration_s <= self.least_s {
            self.least_s
        } else if duration_s > self.gap_s[0] && duration_s < self.gap_s[1] {
            self.gap_s[1]
        } else {
            duration_s
        }
    }
}

/// Full acceleration to a speed, a coast there, full acceleration to the last speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AxisMotion {
    /// The two ends.
    pub position: [f64; 2],
    /// The two ends.
    pub velocity: [f64; 2],
    /// Speed of the coast.
    pub coast: f64,
    /// Accelerations before and after the coast.
    pub acceleration: [f64; 2],
    /// Times at which the coast begins and ends, s.
    pub coast_s: [f64; 2],
    /// Length of the whole, s.
    pub duration_s: f64,
}

impl Axis {
    /// `None` where no duration allows a motion.
    #[inline]
    pub fn new(ends: Ends) -> Option<Self> {
        let Ends { position: [p0, p1], velocity: [v0, v1], speed, acceleration } = ends;
        let fastest = speed * (1.0 + SPEED_TOLERANCE);
        let is_within = v0.abs() <= fastest && v1.abs() <= fastest;
        // What is no number, or squares to none, is no problem with a motion.
        let is_moderate = [p0, p1, v0, v1].iter().all(|number| number.abs() <= LARGEST);
        let is_push = acceleration == 0.0 || (1.0 / LARGEST..=LARGEST).contains(&acceleration);
        if !(is_within && is_moderate && is_push) {
            return None;
        }
        if acceleration > 0.0 {
            let direct_s = (v1 - v0).abs() / acceleration;
            let displacement = 0.5 * (v0 + v1) * direct_s;
            let fastest = v0.abs().max(v1.abs());
            let slack_s = ROUNDINGS * fastest / acceleration;
            let slack = ROUNDINGS * p0.abs().max(p1.abs()) + fastest * slack_s;
            let (low, high) = (v0.min(v1), v0.max(v1));
            let surplus = (p1 - p0) - displacement;
            Some(Self { ends, low, high, direct_s, surplus, slack, slack_s })
        } else {
            let slack = ROUNDINGS * p0.abs().max(p1.abs());
            let surplus = if (p1 - p0).abs() <= slack { 0.0 } else { p1 - p0 };
            let is_drift = v0 - v1 == 0.0 && (surplus == 0.0 || surplus * v0 > 0.0);
            is_drift.then_some(Self { ends, low: v0, high: v0, direct_s: 0.0, surplus, slack, slack_s: 0.0 })
        }
    }

    /// The same seen so that the surplus is positive: the sign of that, and what are then the higher and the lower speed and
    /// the surplus. Without a surplus the motion is its own mirror image, and speeds upwards are the ones with a gap.
    #[inline]
    fn upwards(&self) -> (f64, f64, f64, f64) {
        let is_down = if self.surplus.abs() <= self.slack { self.high < 0.0 } else { self.surplus < 0.0 };
        if is_down { (-1.0, -self.low, -self.high, -self.surplus) } else { (1.0, self.high, self.low, self.surplus) }
    }

    /// In which durations a motion exists.
    #[inline]
    pub fn durations(&self) -> Durations {
        let Ends { speed, acceleration, .. } = self.ends;
        let (sign, high, low, surplus) = self.upwards();
        if acceleration <= 0.0 {
            return self.drift(high, surplus, sign);
        }
        // Where the motion has to stop on its way, the least time jumps as the surplus leaves zero, and gaps may close at a
        // point. So what rounding cannot tell from feasible counts as feasible, at the price of that rounding.
        let sure = (surplus - self.slack).max(0.0);
        // The peak p with p^2 = high^2 + a surplus; its excess over `high` without cancellation.
        let peak = f64::sqrt(high * high + acceleration * sure);
        let (least_coast, beyond_s) = if peak <= speed {
            let excess = if high > 0.0 { acceleration * sure / (high + peak) } else { peak - high };
            (peak, 2.0 * excess / acceleration)
        } else {
            let excess = (speed - high).max(0.0);
            (speed, (sure + excess * excess / acceleration) / speed)
        };
        let least_s = (self.direct_s + (beyond_s - self.slack_s)).max(0.0);
        let mut durations = Durations { least_s, least_coast: sign * least_coast, ..Durations::NONE };
        // Both speeds point along the displacement: to use more time one must slow down, and below rest one comes back.
        if low > 0.0 {
            let given = (surplus + self.slack).max(0.0);
            let turned = low * low - acceleration * given;
            if turned > 0.0 {
                let turn = f64::sqrt(turned);
                let until_s = self.direct_s + 2.0 * given / (low + turn);
                let from_s = self.direct_s + 2.0 * (low + turn) / acceleration;
                if until_s < from_s {
                    durations.gap_s = [until_s.max(durations.least_s), from_s];
                    durations.gap_coast = -sign * turn;
                }
            }
        }
        durations
    }

    /// Durations without any acceleration: one, or all where nothing moves.
    #[cold]
    fn drift(&self, velocity: f64, surplus: f64, sign: f64) -> Durations {
        if velocity == 0.0 {
            return Durations { least_s: 0.0, ..Durations::NONE };
        }
        let least_s = (surplus - self.slack).max(0.0) / velocity;
        let until_s = (surplus + self.slack) / velocity;
        Durations { least_s, least_coast: sign * velocity, gap_s: [until_s, f64::INFINITY], gap_coast: 0.0 }
    }

    /// Least change of velocity of a motion that takes at most `latest_s`; infinite where there is none.
    ///
    /// The coast slows down as the time grows. Either it enters the band between the two speeds, and then their difference
    /// suffices, or it has to be on the other side of rest, and then it only comes nearer to rest.
    #[cfg(feature = "research")]
    #[inline]
    pub fn least_change(&self, durations: &Durations, latest_s: f64) -> f64 {
        let (_, high, low, surplus) = self.upwards();
        let unhurried_s = match surplus {
            surplus if surplus <= self.slack => self.direct_s,
            surplus if high > 0.0 => self.direct_s + surplus / high,
            _ => f64::INFINITY,
        };
        let is_enough = latest_s >= durations.least_s;
        if !is_enough {
            f64::INFINITY
        } else if unhurried_s <= latest_s && unhurried_s.is_finite() {
            high - low
        } else if latest_s.is_finite() {
            self.motion(durations, latest_s).velocity_change()
        } else {
            -high - low
        }
    }

    /// The motion in a duration that exists: of all, the one with the least peak speed and the least impulse. A faster or
    /// slower coast would miss the displacement, and whatever peaks lower stays below the same bang-coast-bang.
    #[inline]
    #[expect(clippy::float_cmp, reason = "these very durations have a known coast")]
    pub fn motion(&self, durations: &Durations, duration_s: f64) -> AxisMotion {
        let Ends { position, velocity: [v0, v1], speed, acceleration } = self.ends;
        let coast = if duration_s == durations.least_s {
            durations.least_coast
        } else if duration_s == durations.gap_s[1] {
            durations.gap_coast
        } else {
            self.coast(duration_s)
        };
        // A boundary speed some roundings beyond the limit is not a reason to break it in between.
        let coast = coast.max(-speed).min(speed);
        let (rise_s, fall_s) = if acceleration > 0.0 {
            ((coast - v0).abs() / acceleration, (v1 - coast).abs() / acceleration)
        } else {
            (0.0, 0.0)
        };
        let begin_s = rise_s.min(duration_s);
        AxisMotion {
            position,
            velocity: [v0, v1],
            coast,
            acceleration: [acceleration.copysign(coast - v0), acceleration.copysign(v1 - coast)],
            coast_s: [begin_s, (duration_s - fall_s).max(begin_s)],
            duration_s,
        }
    }

    /// Speed of the coast in a duration beyond the least.
    #[inline]
    fn coast(&self, duration_s: f64) -> f64 {
        let acceleration = self.ends.acceleration;
        let spare_s = (duration_s - self.direct_s).max(0.0);
        // What rounding alone leaves missing has no root: the farthest speed that the time allows is then the answer.
        let beyond = |missing: f64| {
            let sum = acceleration * spare_s;
            let product = (acceleration * missing).min(0.25 * sum * sum);
            2.0 * product / (sum + f64::sqrt((sum * sum - 4.0 * product).max(0.0)))
        };
        let (below, above) = (self.low * spare_s - self.surplus, self.surplus - self.high * spare_s);
        if acceleration <= 0.0 || spare_s <= 0.0 {
            self.high
        } else if above > 0.0 {
            self.high + beyond(above)
        } else if below > 0.0 {
            self.low - beyond(below)
        } else {
            (self.surplus / spare_s).max(self.low).min(self.high)
        }
    }
}

impl AxisMotion {
    /// Position, speed and acceleration in the piece that begins at `start_s` and ends at `end_s`, at its start. Each phase
    /// counts from the end that it touches, so that both ends are met exactly.
    #[inline]
    pub fn piece(&self, start_s: f64, end_s: f64) -> (f64, f64, f64) {
        let ([p0, p1], [v0, v1]) = (self.position, self.velocity);
        if end_s <= self.coast_s[0] {
            let rate = self.acceleration[0];
            (p0 + (v0 + 0.5 * rate * start_s) * start_s, v0 + rate * start_s, rate)
        } else if start_s >= self.coast_s[1] {
            let rate = self.acceleration[1];
            let left_s = self.duration_s - start_s;
            (p1 - (v1 - 0.5 * rate * left_s) * left_s, v1 - rate * left_s, rate)
        } else {
            let begin_s = self.coast_s[0];
            (p0 + 0.5 * (v0 + self.coast) * begin_s + self.coast * (start_s - begin_s), self.coast, 0.0)
        }
    }

    /// Least and largest position: at the ends, or where the motion turns on its way to the coast and from it.
    #[inline]
    pub fn range(&self) -> [f64; 2] {
        let ([p0, p1], [v0, v1]) = (self.position, self.velocity);
        let mut range = [p0.min(p1), p0.max(p1)];
        let mut include = |turn: f64| range = [range[0].min(turn), range[1].max(turn)];
        if v0 * self.coast <= 0.0 && v0 != 0.0 {
            include(p0 - 0.5 * v0 * v0 / self.acceleration[0]);
        }
        if v1 * self.coast <= 0.0 && v1 != 0.0 {
            include(p1 - 0.5 * v1 * v1 / self.acceleration[1]);
        }
        range
    }

    /// Integral of the acceleration's absolute value, m/s.
    #[inline]
    pub fn velocity_change(&self) -> f64 {
        (self.coast - self.velocity[0]).abs() + (self.velocity[1] - self.coast).abs()
    }
}

/// An end of the displacements reached in a time, and how it changes with the last speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BandEnd {
    /// m.
    pub displacement: f64,
    /// Its derivative with respect to the last speed, s; never negative.
    pub slope_s: f64,
}

/// Least and largest displacement between two speeds in a duration that is not below the least between them.
#[inline]
pub(super) fn band([v0, v1]: [f64; 2], speed: f64, acceleration: f64, duration_s: f64) -> [BandEnd; 2] {
    let end = |sign: f64| {
        let (v0, v1) = (sign * v0, sign * v1);
        if acceleration <= 0.0 {
            return BandEnd { displacement: sign * (v0 * duration_s), slope_s: 0.0 };
        }
        let peak = (0.5 * (acceleration * duration_s + v0 + v1)).min(speed).max(v0).max(v1);
        let rise_s = (peak - v0) / acceleration;
        let fall_s = (peak - v1) / acceleration;
        let coast_s = (duration_s - rise_s - fall_s).max(0.0);
        let displacement = 0.5 * ((v0 + peak) * rise_s + (peak + v1) * fall_s) + peak * coast_s;
        BandEnd { displacement: sign * displacement, slope_s: fall_s }
    };
    [end(-1.0), end(1.0)]
}
