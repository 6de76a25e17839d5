//! What a log says of its own sensors: levels, ages, biases and gains of its streams, each with a standard deviation.
//!
//! No body is needed, no wrench either: streams are held against each other. Poses are held against the integrated rate, positions
//! against accelerations (integrated twice) and velocities (integrated once), the rate against the wrench that turns the body.
//!
//! # Source
//! Robust least squares of overlapping increments over several spans; standard deviations from the scatter of the scores between blocks
//! of time, so that residuals may be correlated. Of each number the span counts that tells it best. White noise from third differences of
//! what is left, slow errors by likelihood.

mod against;
mod attitude;
mod found;
mod gravity;
mod levels;
mod regression;
#[cfg(test)]
mod tests;
mod translation;
mod turned;

pub use against::Contradiction;
pub use found::Found;

use crate::error::IdentificationError;
use crate::lie::LieGroup;
use crate::motion::MotionSample;
use crate::synchronize::{Signals, delay};
use crate::wrench_timing::WrenchTiming;
use attitude::{Attitude, Poses};
use levels::{Levels, Slow, Stream, Wander, white};
use nalgebra::{SVector, UnitQuaternion, Vector3};
use regression::MOST_LEFT;
use translation::{Acceleration, View};
use turned::{Turned, series};

/// Spans of increments, s.
const SPANS_S: [f64; 4] = [0.2, 0.5, 1.0, 2.0];
/// Spans of second differences, s.
const SECOND_SPANS_S: [f64; 4] = [0.4, 0.8, 1.6, 3.2];
/// More poses than these are thinned for increments.
const MOST_POSES: usize = 4000;
/// More rows than these are not held against the wrench.
const MOST_ROWS: usize = 20_000;
/// Largest age against the wrench that is looked for, s.
const LARGEST_AGE_S: f64 = 0.5;
/// Fewest poses that say something.
const FEWEST_POSES: usize = 40;

/// A stream of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StreamName {
    /// Position and attitude.
    Pose,
    /// Velocity of the body origin.
    Velocity,
    /// Angular rate.
    Rate,
    /// Acceleration of the body origin.
    Acceleration,
    /// Wrench.
    Wrench,
}

impl StreamName {
    /// As files and options write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pose => "pose",
            Self::Velocity => "velocity",
            Self::Rate => "rate",
            Self::Acceleration => "acceleration",
            Self::Wrench => "wrench",
        }
    }
}

/// Errors of the poses; what the log cannot tell is absent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseErrors {
    /// White noise of the position, m, each axis.
    pub position_white_m: Option<Found>,
    /// Slow error of the position, m, each axis: zero with the largest that would not show as standard deviation where none shows.
    pub position_wander_m: Option<Found>,
    /// Its correlation time, s.
    pub position_wander_time_s: Option<Found>,
    /// White noise of the attitude, rad, each axis.
    pub attitude_white_rad: Option<Found>,
    /// Slow error of the attitude and of the integrated rate together, rad, each axis; zero as for the position.
    pub attitude_wander_rad: Option<Found>,
    /// Its correlation time, s.
    pub attitude_wander_time_s: Option<Found>,
}

impl PoseErrors {
    /// Correlation time of the slow errors of both, as one process would have it: the mean, weighted by what each is known to.
    pub fn wander_time_s(&self) -> Option<Found> {
        let weighted = |f: &Found| (f.value / f.sigma.powi(2), 1.0 / f.sigma.powi(2));
        let both = [self.position_wander_time_s, self.attitude_wander_time_s];
        let (sum, weight) = both.iter().flatten().map(weighted).fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        (weight > 0.0).then(|| Found { value: sum / weight, sigma: weight.sqrt().recip() })
    }
}

/// What the log tells of one stream; what it cannot tell is absent.
///
/// # Units
/// Those of the stream (rad/s, m/s, m/s^2), s.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamCheck {
    /// Which.
    pub stream: StreamName,
    /// Samples of it.
    pub samples: usize,
    /// Median time between them, s.
    pub interval_s: f64,
    /// Age of its content at its stamp against that of [`SensingCheck::reference`], s: positive where it shows older motion. Filters
    /// count in it.
    pub offset_s: Option<Found>,
    /// White noise of one sample, each axis.
    pub white: Option<Found>,
    /// Slow error, each axis.
    pub wander: Option<Found>,
    /// Its correlation time, s.
    pub wander_time_s: Option<Found>,
    /// Bias, axes of the rate.
    pub bias: Option<[Option<Found>; 3]>,
    /// Measured over true, each axis.
    pub gain: Option<[Option<Found>; 3]>,
}

/// How axes of poses and of rates lie to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// From axes of the rate to axes of the pose.
    pub pose_from_rate: UnitQuaternion<f64>,
    /// One standard deviation about each axis of the rate, rad.
    pub sigma_rad: [f64; 3],
}

/// What a log says of its sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct SensingCheck {
    /// Errors of the poses; absent without poses.
    pub pose: Option<PoseErrors>,
    /// Streams that the log holds.
    pub streams: Vec<StreamCheck>,
    /// Whose clock ages are counted by: the rate's, else the wrench's.
    pub reference: Option<StreamName>,
    /// How the axes lie, where the log tells.
    pub alignment: Option<Alignment>,
    /// Where the accelerometer sits, from the origin of the poses, axes of the rate, m: by what the angular acceleration makes there and
    /// is still in.
    pub lever_arm_m: Option<[Found; 3]>,
    /// Gravity that the publisher of the accelerations added along the inertial z axis, m/s^2, by what errors of its attitude make of it.
    pub gravity_added_m_s2: Option<Found>,
    /// Error of each attitude against the corrected and integrated rate: time since the first row, s, and rotation vector in inertial
    /// axes, rad, from where it stood at the first.
    pub attitude_errors: Vec<(f64, Vector3<f64>)>,
}

impl SensingCheck {
    /// Whether any age, level, bias or gain could be told.
    pub fn tells(&self) -> bool {
        self.streams.iter().any(|s| {
            let any = |three: &Option<[Option<Found>; 3]>| three.iter().flatten().any(Option::is_some);
            let aged = Some(s.stream) != self.reference && s.offset_s.is_some();
            aged || s.white.is_some() || any(&s.bias) || any(&s.gain)
        }) || self.pose.is_some_and(|p| p.position_white_m.is_some() || p.attitude_white_rad.is_some())
    }

    /// A stream of the log.
    pub fn stream(&self, name: StreamName) -> Option<&StreamCheck> {
        self.streams.iter().find(|s| s.stream == name)
    }
}

/// What a log says of its sensors.
///
/// Streams may be missing or sparse, steps uneven, motion planar. Numbers that do not stand out from the noise are absent.
///
/// # Frame
/// As [`MotionSample`]. Axes of poses and rates may differ by a fixed rotation, which is found.
/// # Errors
/// [`IdentificationError::TooFewSamples`] for a record of fewer than two rows.
/// # Example
/// ```
/// use tumble_identification::MotionSample;
/// use tumble_identification::WrenchTiming;
/// use tumble_identification::lie::{LieGroup, Pose};
/// use tumble_identification::nalgebra::{Translation3, UnitQuaternion, Vector3};
/// use tumble_identification::sensing::{StreamName, check};
///
/// // A body that swings about all axes; its poses show the motion of 30 ms ago.
/// let rate = |t: f64| Vector3::new(0.3 * t.sin(), 0.2 * (1.3 * t).cos(), 0.25 * (0.7 * t + 1.0).sin());
/// let (h, mut turned, mut past) = (0.01, UnitQuaternion::identity(), Vec::new());
/// let record: Vec<MotionSample> = (0..4000)
///     .map(|k| {
///         let t = h * k as f64;
///         past.push(turned);
///         turned *= <UnitQuaternion<f64> as LieGroup>::exp(&(rate(t + 0.5 * h) * h));
///         let jitter = Vector3::from_fn(|i, _| 1e-4 * (f64::from(k) * (12.9 + i as f64)).sin());
///         let seen = past[past.len().saturating_sub(4)] * UnitQuaternion::from_scaled_axis(jitter);
///         MotionSample {
///             time_ns: 10_000_000 * i64::from(k),
///             world_from_body: Some(Pose::from_parts(Translation3::identity(), seen)),
///             rate_body: Some(rate(t)),
///             ..MotionSample::default()
///         }
///     })
///     .collect();
/// let found = check(&record, WrenchTiming::Held)?;
/// let age = found.stream(StreamName::Pose).and_then(|s| s.offset_s).unwrap();
/// assert!((age.value - 0.03).abs() < 1e-3, "{age:?}");
/// # Ok::<(), tumble_identification::IdentificationError>(())
/// ```
pub fn check(record: &[MotionSample], timing: WrenchTiming) -> Result<SensingCheck, IdentificationError> {
    if record.len() < 2 {
        return Err(IdentificationError::TooFewSamples { samples: record.len(), needed: 2 });
    }
    let has = |of: fn(&MotionSample) -> bool| record.iter().filter(|row| of(row)).count();
    let counts = [
        (StreamName::Pose, has(|r| r.world_from_body.is_some())),
        (StreamName::Velocity, has(|r| r.velocity_origin_world.is_some())),
        (StreamName::Rate, has(|r| r.rate_body.is_some())),
        (StreamName::Acceleration, has(|r| r.acceleration_origin_body.is_some())),
        (StreamName::Wrench, has(|r| r.wrench_body.is_some())),
    ];
    let present = |name: StreamName| counts.iter().any(|(n, count)| *n == name && *count > 1);
    let reference = [StreamName::Rate, StreamName::Wrench].into_iter().find(|name| present(*name));
    let streams = counts.into_iter().filter(|(_, n)| *n > 1).map(|(stream, samples)| blank(record, stream, samples));
    let mut found = SensingCheck {
        pose: None,
        streams: streams.collect(),
        reference,
        alignment: None,
        lever_arm_m: None,
        gravity_added_m_s2: None,
        attitude_errors: Vec::new(),
    };
    if let Some(name) = reference {
        found.set(name, |s| s.offset_s = Some(Found { value: 0.0, sigma: 0.0 }));
    }
    let against_wrench = of_wrench(record, timing, reference);
    match reference {
        Some(StreamName::Rate) => found.set(StreamName::Wrench, |s| {
            s.offset_s = against_wrench.map(|found| Found { value: -found.value, sigma: found.sigma });
        }),
        _ => found.set(StreamName::Pose, |s| s.offset_s = against_wrench),
    }
    found.set(StreamName::Rate, |s| s.white = white(&series(record, |row| row.rate_body).1));
    found.set(StreamName::Acceleration, |s| s.white = white(&series(record, |row| row.acceleration_origin_body).1));
    let of_velocity = white(&series(record, |row| row.velocity_origin_world).1);
    found.set(StreamName::Velocity, |s| s.white = of_velocity);
    of_poses(record, &mut found);
    Ok(found)
}

impl SensingCheck {
    fn set(&mut self, name: StreamName, change: impl FnOnce(&mut StreamCheck)) {
        if let Some(stream) = self.streams.iter_mut().find(|s| s.stream == name) {
            change(stream);
        }
    }
}

fn blank(record: &[MotionSample], stream: StreamName, samples: usize) -> StreamCheck {
    let (times, _) = series(record, |row| match stream {
        StreamName::Pose => row.world_from_body.map(|_| ()),
        StreamName::Velocity => row.velocity_origin_world.map(|_| ()),
        StreamName::Rate => row.rate_body.map(|_| ()),
        StreamName::Acceleration => row.acceleration_origin_body.map(|_| ()),
        StreamName::Wrench => row.wrench_body.map(|_| ()),
    });
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    StreamCheck {
        stream,
        samples,
        interval_s: levels::median(&mut steps).unwrap_or_default(),
        offset_s: None,
        white: None,
        wander: None,
        wander_time_s: None,
        bias: None,
        gain: None,
    }
}

/// Age of what the rate shows, or without a rate of what the poses show, behind the wrench.
fn of_wrench(record: &[MotionSample], timing: WrenchTiming, reference: Option<StreamName>) -> Option<Found> {
    let with_rate = reference == Some(StreamName::Rate);
    let rows: Vec<MotionSample> = record
        .iter()
        .take(MOST_ROWS)
        .map(|row| MotionSample {
            acceleration_origin_body: None,
            velocity_origin_world: with_rate.then(Vector3::zeros),
            rate_body: row.rate_body.filter(|_| with_rate),
            world_from_body: if with_rate { Some(crate::lie::Pose::identity()) } else { row.world_from_body },
            ..*row
        })
        .collect();
    if rows.iter().all(|row| row.wrench_body.is_none()) {
        return None;
    }
    let all = Signals::from_record(&rows, timing, &Vector3::zeros()).ok()?;
    let turning = Signals {
        step_s: all.step_s,
        input: all.input,
        input_offset_s: all.input_offset_s,
        output: all.output.iter().map(|o| SVector::from([o[0], o[1], o[2]])).collect(),
        covariates: all.covariates,
        correlation_length: all.correlation_length,
    };
    let found = delay(&turning, LARGEST_AGE_S).ok()?;
    (found.verdict == crate::Verdict::Identifiable && found.sigma_s < 0.1 && found.left < MOST_LEFT)
        .then_some(Found { value: found.delay_s, sigma: found.sigma_s })
}

/// Sum of two independent numbers.
fn sum(a: Option<Found>, b: Option<Found>) -> Option<Found> {
    let (a, b) = (a?, b?);
    Some(Found { value: a.value + b.value, sigma: a.sigma.hypot(b.sigma) })
}

/// Measured over true, of the part of the measured that is too much.
fn gain(scale: Option<Found>) -> Option<Found> {
    scale.map(|k| {
        let gain = 1.0 / (1.0 - k.value);
        Found { value: gain, sigma: k.sigma * gain * gain }
    })
}

/// What poses tell, of themselves and of the streams beside them.
fn of_poses(record: &[MotionSample], found: &mut SensingCheck) {
    let (times, poses) = series(record, |row| row.world_from_body);
    if times.len() < FEWEST_POSES {
        return;
    }
    let attitudes: Vec<UnitQuaternion<f64>> = poses.iter().map(|p| p.rotation).collect();
    let positions: Vec<Vector3<f64>> = poses.iter().map(|p| p.translation.vector).collect();
    let every = times.len().div_ceil(MOST_POSES);
    let thin: Vec<usize> = (0..times.len()).step_by(every).collect();
    let (few_times, few_attitudes, few_positions): (Vec<f64>, Vec<_>, Vec<_>) = (
        thin.iter().map(|i| times[*i]).collect(),
        thin.iter().map(|i| attitudes[*i]).collect(),
        thin.iter().map(|i| positions[*i]).collect(),
    );
    let step = levels::median(&mut few_times.windows(2).map(|p| p[1] - p[0]).collect::<Vec<_>>()).unwrap_or(1.0);
    let usable = |all: [f64; 4]| all.into_iter().filter(|s| *s > 0.8 * step).collect::<Vec<_>>();
    let (first, second) = (usable(SPANS_S), usable(SECOND_SPANS_S));
    let few = Poses { times: &few_times, attitudes: &few_attitudes };
    let raw = Turned::new(record, |w| *w);
    let attitude = raw.as_ref().and_then(|raw| Attitude::of(&few, raw, &first));
    let turned = attitude.as_ref().and_then(|a| Turned::new(record, |w| a.corrected(w)));
    let turning = attitude.as_ref().zip(turned.as_ref());
    let mut errors = PoseErrors::default();
    if let Some((attitude, turned)) = turning {
        turned_against(&Poses { times: &times, attitudes: &attitudes }, (attitude, turned), found, &mut errors);
    } else {
        let mut whole = Vector3::zeros();
        let turns = attitudes.windows(2).map(|pair| {
            let by: Vector3<f64> = LieGroup::log(&(pair[0].conjugate() * pair[1]));
            whole += by;
            whole
        });
        errors.attitude_white_rad = white(&turns.collect::<Vec<_>>());
    }
    found.gravity_added_m_s2 = turning.and_then(|(attitude, turned)| gravity::added(record, attitude, turned));
    let view = View { poses: few, positions: &few_positions, turning };
    let pose_age = found.stream(StreamName::Pose).and_then(|s| s.offset_s);
    let velocity_later = view.velocity(record, &first);
    found.set(StreamName::Velocity, |s| s.offset_s = sum(pose_age, velocity_later));
    errors.position_white_m = white(&positions);
    if let Some(acceleration) = view.acceleration(record, &second) {
        let later_s = velocity_later.map_or(0.0, |later| later.value);
        moved_against(record, (&view, &acceleration, later_s), found, &mut errors);
    }
    found.pose = Some(errors);
}

/// Numbers of the attitude against the rate.
fn turned_against(
    poses: &Poses<'_>,
    (attitude, turned): (&Attitude, &Turned),
    found: &mut SensingCheck,
    errors: &mut PoseErrors,
) {
    let (times, drift) = attitude.drift(poses, turned);
    errors.attitude_white_rad = white(&drift);
    let rate = found.stream(StreamName::Rate);
    let density = rate.and_then(|s| s.white.map(|w| w.value * s.interval_s.sqrt())).unwrap_or(0.0);
    if let Some(level) = errors.attitude_white_rad {
        let slow = Slow {
            stream: Stream { times: &times, values: &drift, white: level.value },
            derivative: None,
            double: false,
            constant: 0.0,
            density: Some(density),
        };
        if let Some(Levels { stream: Wander { sigma, time_s }, .. }) = slow.found() {
            (errors.attitude_wander_rad, errors.attitude_wander_time_s) = (sigma, time_s);
        }
    }
    let span_s = times.last().zip(times.first()).map_or(0.0, |(last, first)| last - first);
    let slope = errors
        .attitude_wander_rad
        .zip(errors.attitude_wander_time_s)
        .map_or(0.0, |(s, time)| s.value * (24.0 * time.value.min(0.25 * span_s) / span_s.powi(3)).sqrt());
    found.attitude_errors = times.into_iter().zip(drift).collect();
    found.set(StreamName::Pose, |s| s.offset_s = attitude.age);
    found.set(StreamName::Rate, |s| {
        // What a slow error looks like over the whole log, a bias does.
        s.bias = Some(attitude.bias.map(|b| b.map(|b| Found { sigma: b.sigma.hypot(slope), ..b })));
        s.gain = Some(attitude.scale.map(gain));
    });
    if let [Some(x), Some(y), Some(z)] = attitude.misalignment {
        let sigma_rad = [x.sigma, y.sigma, z.sigma];
        found.alignment = Some(Alignment { pose_from_rate: attitude.pose_from_rate, sigma_rad });
    }
}

/// Numbers of the position against the acceleration.
fn moved_against(
    record: &[MotionSample],
    (view, acceleration, velocity_later_s): (&View<'_>, &Acceleration, f64),
    found: &mut SensingCheck,
    errors: &mut PoseErrors,
) {
    let pose_age = found.stream(StreamName::Pose).and_then(|s| s.offset_s);
    let beyond = view.beyond(record, acceleration, velocity_later_s);
    if let Some(level) = white(&beyond.positions.1) {
        errors.position_white_m = Some(level);
    }
    let of_velocity = found.stream(StreamName::Velocity).and_then(|s| s.white);
    let slow = Slow {
        stream: Stream {
            times: &beyond.positions.0,
            values: &beyond.positions.1,
            white: errors.position_white_m.map_or(0.0, |w| w.value),
        },
        derivative: of_velocity.filter(|_| !beyond.velocities.0.is_empty()).map(|w| Stream {
            times: &beyond.velocities.0,
            values: &beyond.velocities.1,
            white: w.value,
        }),
        double: true,
        constant: acceleration.bias.iter().flatten().fold(1e-5, |most, b| most.max(b.sigma)),
        density: None,
    };
    let levels = slow.found();
    if let Some(levels) = &levels {
        (errors.position_wander_m, errors.position_wander_time_s) = (levels.stream.sigma, levels.stream.time_s);
    }
    found.set(StreamName::Acceleration, |s| {
        s.offset_s = sum(pose_age, acceleration.later);
        s.bias = Some(acceleration.bias);
        s.gain = Some(acceleration.scale.map(gain));
    });
    if let Some(Wander { sigma, time_s }) = levels.and_then(|l| l.derivative) {
        found.set(StreamName::Velocity, |s| (s.wander, s.wander_time_s) = (sigma, time_s));
    }
    if let [Some(x), Some(y), Some(z)] = acceleration.lever {
        found.lever_arm_m = Some([x, y, z]);
    }
}
