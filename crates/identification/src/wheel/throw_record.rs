//! One throw as it was measured, and the part of it that is free fall.

use super::ThrowSettings;
use crate::IdentificationError;
use tumble_lie::nalgebra::Vector3;

/// Fewest samples a window may hold; fewer and its average says nothing about vibration.
const SAMPLES_PER_WINDOW: usize = 8;
/// Fewest windows of a free fall: twice the unknowns, in rows.
const WINDOWS: usize = 6;
/// The wheel moves if its speed spans this many of its standard deviations.
const WHEEL_SPAN_SIGMAS: f64 = 25.0;

/// What the device measured at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThrowSample {
    /// Time since the wheel started, s.
    pub time_s: f64,
    /// Angular velocity, body axes, rad/s.
    pub rate_body: Vector3<f64>,
    /// What the accelerometer reads, body axes, m/s^2.
    pub specific_force_body: Vector3<f64>,
    /// Speed of the wheel relative to the body about the body's z axis, rad/s.
    pub wheel_speed_rad_s: f64,
}

/// One throw: finite samples at increasing times.
#[derive(Debug, Clone, PartialEq)]
pub struct ThrowRecord {
    samples: Vec<ThrowSample>,
}

/// Why the free fall of a record ends where it does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum EndOfFall {
    /// The record ends first.
    Record,
    /// The accelerometer jumps: the body lands.
    Landing,
}

/// The samples of the free fall.
#[derive(Debug, Clone, Copy)]
pub(super) struct FreeFall<'a> {
    pub(super) samples: &'a [ThrowSample],
    pub(super) end: EndOfFall,
}

impl ThrowRecord {
    /// A record of these samples.
    ///
    /// # Errors
    /// [`IdentificationError::NotFinite`], [`IdentificationError::TimesNotIncreasing`].
    pub fn try_new(samples: Vec<ThrowSample>) -> Result<Self, IdentificationError> {
        let is_finite = |sample: &ThrowSample| {
            let sum = sample.rate_body.sum() + sample.specific_force_body.sum();
            (sum + sample.time_s + sample.wheel_speed_rad_s).is_finite()
        };
        if let Some(row) = samples.iter().position(|sample| !is_finite(sample)) {
            return Err(IdentificationError::NotFinite { row });
        }
        if let Some(index) = samples.windows(2).position(|pair| pair[1].time_s <= pair[0].time_s) {
            return Err(IdentificationError::TimesNotIncreasing { index: index + 1 });
        }
        Ok(Self { samples })
    }

    /// A record of samples known to be finite and in order.
    pub(super) fn of_valid(samples: Vec<ThrowSample>) -> Self {
        Self { samples }
    }

    /// The samples.
    pub fn samples(&self) -> &[ThrowSample] {
        &self.samples
    }

    /// From the start of free fall to the landing or the end of the record, less the guard.
    pub(super) fn free_fall(&self, settings: &ThrowSettings) -> Result<FreeFall<'_>, IdentificationError> {
        let start = self.samples.partition_point(|sample| sample.time_s < settings.start_s);
        let fall = &self.samples[start..];
        let landing = landing(fall, settings);
        let end_s = landing.or(fall.last().map(|last| last.time_s)).unwrap_or(settings.start_s) - settings.end_guard_s;
        let fall = &fall[..fall.partition_point(|sample| sample.time_s <= end_s)];

        let (begin_s, needed_s) = (fall.first().map_or(end_s, |first| first.time_s), minimum_fall_s(settings));
        let windows = ((end_s - begin_s) / settings.window_s).max(0.0);
        if end_s - begin_s < needed_s || (fall.len() as f64) < windows * SAMPLES_PER_WINDOW as f64 {
            return Err(IdentificationError::FallTooShort {
                fall_s: (end_s - begin_s).max(0.0),
                samples: fall.len(),
                needed_s,
                needed_samples: SAMPLES_PER_WINDOW * WINDOWS,
            });
        }
        if let Some(gap) = fall.windows(2).find(|pair| pair[1].time_s - pair[0].time_s > 0.5 * settings.window_s) {
            let gap_s = gap[1].time_s - gap[0].time_s;
            return Err(IdentificationError::GapInFall { time_s: gap[0].time_s, gap_s });
        }
        if let Some(sample) = fall.iter().find(|sample| sample.rate_body.amax() >= settings.gyro_full_scale_rad_s) {
            return Err(IdentificationError::GyroSaturated {
                time_s: sample.time_s,
                rate_rad_s: sample.rate_body.amax(),
                full_scale_rad_s: settings.gyro_full_scale_rad_s,
            });
        }
        let speeds = fall.iter().map(|sample| sample.wheel_speed_rad_s);
        let (low, high) = speeds.fold((f64::MAX, f64::MIN), |(low, high), speed| (low.min(speed), high.max(speed)));
        let needed_rad_s = WHEEL_SPAN_SIGMAS * settings.wheel_sigma_rad_s;
        if high - low < needed_rad_s {
            return Err(IdentificationError::WheelNotSpinning { span_rad_s: high - low, needed_rad_s });
        }
        Ok(FreeFall { samples: fall, end: if landing.is_some() { EndOfFall::Landing } else { EndOfFall::Record } })
    }
}

/// Shortest free fall worth reading, s.
fn minimum_fall_s(settings: &ThrowSettings) -> f64 {
    settings.window_s + (WINDOWS - 1) as f64 * settings.window_s.max(settings.window_step_s)
}

/// Time of the first sample whose specific force differs in size from the mean over the window before it by more than a
/// tumbling body's can.
fn landing(fall: &[ThrowSample], settings: &ThrowSettings) -> Option<f64> {
    let (mut first, mut sum) = (0, 0.0);
    for (last, sample) in fall.iter().enumerate() {
        while fall[first].time_s < sample.time_s - settings.window_s {
            sum -= fall[first].specific_force_body.norm();
            first += 1;
        }
        let size = sample.specific_force_body.norm();
        if last > first && (size - sum / (last - first) as f64).abs() > settings.landing_jump_m_s2 {
            return Some(sample.time_s);
        }
        sum += size;
    }
    None
}
