//! What the sensors suffer from, as scenarios write it.

use crate::AstrobeeError;
use core::f64::consts::PI;
use serde::{Deserialize, Serialize};

/// Everything about localisation and inertial unit; a key that is left out has its [`SensingPreset::Nominal`] value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LocalizationSettings {
    /// Gravity, inertial axes, m/s^2: zero on the station, `[0, 0, 9.80665]` above the granite table (z is down); each at most 20.
    pub gravity_world_m_s2: [f64; 3],
    /// Factor per body axis on the published linear acceleration, 0.1 to 10: the anomaly of table 6.5 is `[1.774, 1.0201, 1.2088]`.
    pub acceleration_factor: [f64; 3],
    /// Whether jumps show in the confidence: the flight software publishes "good" whatever happens.
    pub honest_confidence: bool,
    /// The inertial unit and its filters.
    pub imu: ImuSettings,
    /// Errors of pose and velocity.
    pub pose: PoseErrorSettings,
    /// When estimates are stamped and when they arrive.
    pub timing: TimingSettings,
    /// What goes wrong.
    pub faults: FaultSettings,
}

/// The inertial unit and what the flight software does with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImuSettings {
    /// Time between samples, ms: 8 in flight, 16 in NASA's simulation; nothing else.
    pub sample_interval_ms: u32,
    /// Place of the unit in body axes, m; each within 1.
    pub lever_arm_body_m: [f64; 3],
    /// Whether the unit averages its last 64 samples at 2000 Hz.
    pub moving_average: bool,
    /// Whether the flight software filters by impeller mode.
    pub flight_filter: bool,
    /// Whether the flight software estimates the bias and removes it; else all of it is published.
    pub bias_removed: bool,
    /// Time in which the bias estimate of the flight software follows the true bias, s, 0 (bias always known) to 1000.
    pub bias_following_time_s: f64,
    /// Errors of the accelerometer; unit of signal m/s^2.
    pub accelerometer: SensorErrors,
    /// Errors of the gyroscope; unit of signal rad/s.
    pub gyro: SensorErrors,
}

/// Errors of three sensing axes; `U` is the unit of the signal. None is negative.
///
/// A table of these stands for itself: a key that is left out is an error that is not there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorErrors {
    /// Largest magnitude on an axis, `U`, above 0; `inf` does not clip.
    pub range: f64,
    /// Step of the output, `U`; 0 does not round.
    pub resolution: f64,
    /// Standard deviation of the factor's error per axis, at most 0.5.
    pub scale_sigma: f64,
    /// Standard deviation of the angle between each axis and each other one's right place, rad, at most 0.5.
    pub misalignment_sigma_rad: f64,
    /// White noise, `U/sqrt(Hz)` (one-sided density).
    pub noise_density: f64,
    /// Standard deviation of the bias at switch-on, `U`.
    pub bias_sigma: f64,
    /// Random walk of the bias, `U/sqrt(s)`.
    pub bias_walk: f64,
    /// Standard deviation of the fast part of the bias, a first-order Markov process, `U`.
    pub markov_sigma: f64,
    /// Its correlation time, s, 0.001 to 1000.
    pub markov_time_s: f64,
}

/// Errors of pose and velocity; standard deviations per axis, none negative.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PoseErrorSettings {
    /// White noise of the position, m, at most 1.
    pub position_noise_m: f64,
    /// White noise of the attitude, rad, at most 1.
    pub attitude_noise_rad: f64,
    /// White noise of the velocity, m/s, at most 1.
    pub velocity_noise_m_s: f64,
    /// Slow error of the position, m, at most 1.
    pub position_drift_m: f64,
    /// Slow error of the attitude, rad, at most 1.
    pub attitude_drift_rad: f64,
    /// Slow error of the velocity, m/s, at most 1.
    pub velocity_drift_m_s: f64,
    /// Correlation time of the slow errors, s, 0.1 to 10000: a random walk that updates from the map pull back.
    pub drift_time_s: f64,
}

/// When estimates are stamped and when they arrive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TimingSettings {
    /// Time between estimates, ms: a whole number of IMU samples, at most 1000.
    pub publish_interval_ms: u32,
    /// From stamp to arrival at the least, ms, at most 2000.
    pub latency_ms: f64,
    /// Mean of the exponentially distributed time that comes on top, ms, at most 200; cut at 1000 ms.
    pub arrival_jitter_ms: f64,
    /// Standard deviation of the stamp about the time it should say, ms, at most 50; cut at four of them.
    pub stamp_jitter_ms: f64,
    /// Age of the content at its stamp, ms: a whole number of IMU samples, at most 1000.
    pub hidden_latency_ms: u32,
    /// Age of pose and velocity beyond that of rate and acceleration, ms, at most 1000.
    pub pose_latency_ms: f64,
}

/// What goes wrong.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FaultSettings {
    /// Probability that an estimate is lost, 0 to 1.
    pub drop_probability: f64,
    /// Bursts of losses per second, at most 10.
    pub burst_rate_hz: f64,
    /// Mean duration of a burst, s, at most 60; exponentially distributed.
    pub burst_duration_s: f64,
    /// Probability that an estimate is sent twice, 0 to 1; the second copy has its own way to go.
    pub duplicate_probability: f64,
    /// Intervals without estimates.
    pub outages: Vec<Interval>,
    /// Intervals in which only the stamp changes.
    pub freezes: Vec<Interval>,
    /// Jumps at random.
    pub random_jumps: JumpSettings,
    /// Jumps at given times.
    pub jumps: Vec<Jump>,
}

/// From `start_s` for `duration_s`, in seconds from the time of the first observation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interval {
    /// Start, s, 0 or later.
    pub start_s: f64,
    /// Length, s, 0 or more.
    pub duration_s: f64,
}

/// A jump of the estimate: full size for `duration_s`, then back in a straight line within `recovery_s`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Jump {
    /// Start, s from the time of the first observation, 0 or later.
    pub start_s: f64,
    /// Time at full size, s, 0 or more.
    pub duration_s: f64,
    /// Time of the return, s, 0 or more.
    pub recovery_s: f64,
    /// Change of the position, inertial axes, m; each within 100.
    pub position_m: [f64; 3],
    /// Change of the attitude as rotation vector in inertial axes, rad; each within pi.
    pub attitude_rad: [f64; 3],
    /// Change of the velocity, inertial axes, m/s; each within 10.
    pub velocity_m_s: [f64; 3],
    /// Change of the angular rate, body axes, rad/s; each within 10.
    pub rate_rad_s: [f64; 3],
}

/// Loss of visual features by fast motion, and the jumps that follow.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct JumpSettings {
    /// Jumps per second while a threshold is exceeded and none is under way, at most 100; 0 is never.
    pub rate_hz: f64,
    /// Threshold of the magnitude of the true angular rate, rad/s, 0 or more; `inf` is never exceeded.
    pub rate_threshold_rad_s: f64,
    /// Threshold of the magnitude of the true acceleration of the origin, m/s^2, 0 or more; `inf` is never exceeded.
    pub acceleration_threshold_m_s2: f64,
    /// Size in position, m, in a random direction, at most 100.
    pub position_m: f64,
    /// Size in attitude, rad, about a random axis, at most pi.
    pub attitude_rad: f64,
    /// Size in angular rate, rad/s, in a random direction, at most 10.
    pub rate_rad_s: f64,
    /// Time at full size, s, 0 to 600.
    pub duration_s: f64,
    /// Time of the return, s, 0 to 600.
    pub recovery_s: f64,
}

/// Settings with a name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum SensingPreset {
    /// The truth at 62.5 Hz, at once: no noise, no filter, no delay.
    Perfect,
    /// White noise and nothing else, late but stamped right.
    Ideal,
    /// A healthy flight.
    #[default]
    Nominal,
    /// The flights of the thesis: scale anomaly, delay, losses, jumps under fast motion.
    ThesisFlight,
    /// Bumble as it flew on the station: the unit at 16 ms, its lever arm, poses 62 ms late.
    Bumble,
}

impl SensingPreset {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Perfect, Self::Ideal, Self::Nominal, Self::ThesisFlight, Self::Bumble];

    /// Its name in scenarios and options.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Perfect => "perfect",
            Self::Ideal => "ideal",
            Self::Nominal => "nominal",
            Self::ThesisFlight => "thesis-flight",
            Self::Bumble => "bumble",
        }
    }

    /// What the name stands for.
    pub fn settings(self) -> LocalizationSettings {
        match self {
            Self::Perfect => LocalizationSettings::perfect(),
            Self::Ideal => LocalizationSettings::ideal(),
            Self::Nominal => LocalizationSettings::nominal(),
            Self::ThesisFlight => LocalizationSettings::thesis_flight(),
            Self::Bumble => LocalizationSettings::bumble(),
        }
    }
}

/// Degree, rad.
const DEG: f64 = PI / 180.0;
/// Thousandth of the standard gravity, m/s^2.
const MILLI_G: f64 = 9.806_65e-3;

impl Default for SensorErrors {
    fn default() -> Self {
        Self::none()
    }
}

impl SensorErrors {
    /// None.
    pub fn none() -> Self {
        Self {
            range: f64::INFINITY,
            resolution: 0.0,
            scale_sigma: 0.0,
            misalignment_sigma_rad: 0.0,
            noise_density: 0.0,
            bias_sigma: 0.0,
            bias_walk: 0.0,
            markov_sigma: 0.0,
            markov_time_s: 1.0,
        }
    }

    /// Epson M-G362PDC1 as NASA models it: accelerometer.
    pub fn epson_accelerometer() -> Self {
        Self {
            range: 3000.0 * MILLI_G,
            resolution: 0.125 * MILLI_G,
            scale_sigma: 1e-3,
            misalignment_sigma_rad: 0.03 * DEG,
            noise_density: 0.1 * MILLI_G,
            bias_sigma: 0.0,
            // sqrt(3 / 540)
            bias_walk: 0.074_535_599_249_993 * 0.04 * MILLI_G,
            markov_sigma: 1.5 * 0.1 * MILLI_G,
            markov_time_s: 0.08,
        }
    }

    /// Epson M-G362PDC1 as NASA models it: gyroscope.
    pub fn epson_gyro() -> Self {
        let stability = 3.0 * DEG / 3600.0;
        Self {
            range: 150.0 * DEG,
            resolution: 0.005 * DEG,
            scale_sigma: 1e-3,
            misalignment_sigma_rad: 0.1 * DEG,
            noise_density: 0.002 * DEG,
            bias_sigma: 0.1 * DEG,
            // sqrt(3 / 500)
            bias_walk: 0.077_459_666_924_148 * 1.25 * stability,
            markov_sigma: 2.2 * stability,
            markov_time_s: 0.04,
        }
    }
}

impl Default for ImuSettings {
    fn default() -> Self {
        Self {
            sample_interval_ms: 8,
            lever_arm_body_m: [0.0247, 0.0183, 0.0094],
            moving_average: true,
            flight_filter: true,
            bias_removed: true,
            bias_following_time_s: 3.25,
            accelerometer: SensorErrors::epson_accelerometer(),
            gyro: SensorErrors::epson_gyro(),
        }
    }
}

impl Default for PoseErrorSettings {
    fn default() -> Self {
        Self {
            position_noise_m: 1e-3,
            attitude_noise_rad: 1e-3,
            velocity_noise_m_s: 2e-3,
            position_drift_m: 0.02,
            attitude_drift_rad: 0.01,
            velocity_drift_m_s: 2e-3,
            drift_time_s: 10.0,
        }
    }
}

impl Default for TimingSettings {
    fn default() -> Self {
        Self {
            publish_interval_ms: 16,
            latency_ms: 5.0,
            arrival_jitter_ms: 2.0,
            stamp_jitter_ms: 0.0,
            hidden_latency_ms: 0,
            pose_latency_ms: 0.0,
        }
    }
}

impl Default for LocalizationSettings {
    fn default() -> Self {
        Self::nominal()
    }
}

impl LocalizationSettings {
    /// The truth at 62.5 Hz, at once.
    pub fn perfect() -> Self {
        Self {
            imu: ImuSettings {
                moving_average: false,
                flight_filter: false,
                bias_following_time_s: 0.0,
                lever_arm_body_m: [0.0; 3],
                accelerometer: SensorErrors::none(),
                gyro: SensorErrors::none(),
                ..ImuSettings::default()
            },
            pose: PoseErrorSettings {
                position_noise_m: 0.0,
                attitude_noise_rad: 0.0,
                velocity_noise_m_s: 0.0,
                position_drift_m: 0.0,
                attitude_drift_rad: 0.0,
                velocity_drift_m_s: 0.0,
                drift_time_s: 10.0,
            },
            timing: TimingSettings { latency_ms: 0.0, arrival_jitter_ms: 0.0, ..TimingSettings::default() },
            ..Self::nominal()
        }
    }

    /// White noise at 62.5 Hz of poses, velocities and an inertial unit without filters, a tenth of a second late but stamped right: what
    /// no robot has.
    pub fn ideal() -> Self {
        let white = |noise_density| SensorErrors { noise_density, ..SensorErrors::none() };
        let perfect = Self::perfect();
        Self {
            imu: ImuSettings { accelerometer: white(1e-3), gyro: white(1.25e-4), ..perfect.imu },
            pose: PoseErrorSettings {
                position_noise_m: 0.002,
                attitude_noise_rad: 0.004,
                velocity_noise_m_s: 0.001,
                ..perfect.pose
            },
            timing: TimingSettings { latency_ms: 100.0, arrival_jitter_ms: 10.0, ..perfect.timing },
            ..perfect
        }
    }

    /// A healthy flight on the station.
    pub fn nominal() -> Self {
        Self {
            gravity_world_m_s2: [0.0; 3],
            acceleration_factor: [1.0; 3],
            honest_confidence: false,
            imu: ImuSettings::default(),
            pose: PoseErrorSettings::default(),
            timing: TimingSettings::default(),
            faults: FaultSettings::default(),
        }
    }

    /// What the thesis reports of its flights (6.5.1 to 6.5.4): the scale anomaly of table 6.5, late and lost messages, jumps
    /// under fast motion.
    ///
    /// Sizes that the thesis shows in pictures only are read off in order of magnitude. Of its 0.16 s between force and
    /// acceleration the sensors explain 0.13 s; nothing is added for the rest, which the flaps have their share in.
    pub fn thesis_flight() -> Self {
        Self {
            acceleration_factor: [1.774, 1.0201, 1.2088],
            timing: TimingSettings { latency_ms: 20.0, arrival_jitter_ms: 40.0, ..TimingSettings::default() },
            faults: FaultSettings {
                drop_probability: 0.1,
                burst_rate_hz: 0.1,
                burst_duration_s: 0.3,
                random_jumps: JumpSettings {
                    rate_hz: 0.2,
                    rate_threshold_rad_s: 0.15,
                    acceleration_threshold_m_s2: 0.03,
                    position_m: 0.05,
                    attitude_rad: 0.05,
                    rate_rad_s: 0.05,
                    duration_s: 0.2,
                    recovery_s: 0.5,
                },
                ..FaultSettings::default()
            },
            ..Self::nominal()
        }
    }

    /// Bumble on the station, as far as a recorded flight tells: the topic of the unit comes every 16 ms, its filters run at that rate with
    /// the coefficients of 8 ms, poses show motion that is 62 ms older than the rate's, their attitude wanders by 10 mrad within
    /// seconds. What the recording does not tell is that of [`nominal`](Self::nominal).
    pub fn bumble() -> Self {
        Self {
            imu: ImuSettings {
                sample_interval_ms: 16,
                lever_arm_body_m: [0.0386, 0.0247, -0.010_16],
                ..ImuSettings::default()
            },
            pose: PoseErrorSettings { attitude_noise_rad: 5e-4, drift_time_s: 3.0, ..PoseErrorSettings::default() },
            timing: TimingSettings { pose_latency_ms: 62.0, ..TimingSettings::default() },
            ..Self::nominal()
        }
    }

    /// Whether every value lies in its range.
    ///
    /// # Errors
    /// [`AstrobeeError::SensingOutOfRange`] naming the key.
    pub fn check(&self) -> Result<(), AstrobeeError> {
        vector("gravity_world_m_s2", self.gravity_world_m_s2, -20.0, 20.0)?;
        vector("acceleration_factor", self.acceleration_factor, 0.1, 10.0)?;
        self.imu.check()?;
        self.pose.check()?;
        self.timing.check(self.imu.sample_interval_ms)?;
        self.faults.check()
    }
}

impl ImuSettings {
    /// Time between samples, s.
    pub(super) fn step_s(&self) -> f64 {
        1e-3 * f64::from(self.sample_interval_ms)
    }

    fn check(&self) -> Result<(), AstrobeeError> {
        if self.sample_interval_ms != 8 && self.sample_interval_ms != 16 {
            return Err(AstrobeeError::SensingOutOfRange {
                key: "imu.sample_interval_ms",
                value: f64::from(self.sample_interval_ms),
                lowest: 8.0,
                highest: 16.0,
                rule: " and nothing in between",
            });
        }
        vector("imu.lever_arm_body_m", self.lever_arm_body_m, -1.0, 1.0)?;
        within("imu.bias_following_time_s", self.bias_following_time_s, 0.0, 1000.0)?;
        for (errors, keys) in [(&self.accelerometer, &ACCELEROMETER_KEYS), (&self.gyro, &GYRO_KEYS)] {
            let [range, resolution, scale, misalignment, noise, bias, walk, markov, markov_time] = *keys;
            within(range, errors.range, f64::MIN_POSITIVE, f64::INFINITY)?;
            within(resolution, errors.resolution, 0.0, LARGEST_ERROR)?;
            within(scale, errors.scale_sigma, 0.0, 0.5)?;
            within(misalignment, errors.misalignment_sigma_rad, 0.0, 0.5)?;
            within(noise, errors.noise_density, 0.0, LARGEST_ERROR)?;
            within(bias, errors.bias_sigma, 0.0, LARGEST_ERROR)?;
            within(walk, errors.bias_walk, 0.0, LARGEST_ERROR)?;
            within(markov, errors.markov_sigma, 0.0, LARGEST_ERROR)?;
            within(markov_time, errors.markov_time_s, 1e-3, 1000.0)?;
        }
        Ok(())
    }
}

impl PoseErrorSettings {
    fn check(&self) -> Result<(), AstrobeeError> {
        within("pose.position_noise_m", self.position_noise_m, 0.0, 1.0)?;
        within("pose.attitude_noise_rad", self.attitude_noise_rad, 0.0, 1.0)?;
        within("pose.velocity_noise_m_s", self.velocity_noise_m_s, 0.0, 1.0)?;
        within("pose.position_drift_m", self.position_drift_m, 0.0, 1.0)?;
        within("pose.attitude_drift_rad", self.attitude_drift_rad, 0.0, 1.0)?;
        within("pose.velocity_drift_m_s", self.velocity_drift_m_s, 0.0, 1.0)?;
        within("pose.drift_time_s", self.drift_time_s, 0.1, 1e4)
    }
}

impl TimingSettings {
    /// Time between estimates, s.
    pub(super) fn step_s(&self) -> f64 {
        1e-3 * f64::from(self.publish_interval_ms)
    }

    /// Estimates that can be on their way at once, each sent twice, where the reader asks at least once a second.
    pub(super) fn most_on_the_way(&self) -> usize {
        let longest_ms = self.latency_ms + LONGEST_ARRIVAL_JITTER_MS + 1000.0;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked: at most 4000 / 8")]
        let at_once = (longest_ms / f64::from(self.publish_interval_ms)) as usize;
        2 * (at_once + 2)
    }

    fn check(&self, sample_interval_ms: u32) -> Result<(), AstrobeeError> {
        let whole = |key, value: u32, lowest: u32| {
            if value >= lowest && value <= 1000 && value.is_multiple_of(sample_interval_ms) {
                return Ok(());
            }
            Err(AstrobeeError::SensingOutOfRange {
                key,
                value: f64::from(value),
                lowest: f64::from(lowest),
                highest: 1000.0,
                rule: ", a whole number of `imu.sample_interval_ms`",
            })
        };
        whole("timing.publish_interval_ms", self.publish_interval_ms, sample_interval_ms)?;
        whole("timing.hidden_latency_ms", self.hidden_latency_ms, 0)?;
        within("timing.latency_ms", self.latency_ms, 0.0, 2000.0)?;
        within("timing.pose_latency_ms", self.pose_latency_ms, 0.0, 1000.0)?;
        within("timing.arrival_jitter_ms", self.arrival_jitter_ms, 0.0, 200.0)?;
        within("timing.stamp_jitter_ms", self.stamp_jitter_ms, 0.0, 50.0)
    }
}

impl FaultSettings {
    fn check(&self) -> Result<(), AstrobeeError> {
        within("faults.drop_probability", self.drop_probability, 0.0, 1.0)?;
        within("faults.burst_rate_hz", self.burst_rate_hz, 0.0, 10.0)?;
        within("faults.burst_duration_s", self.burst_duration_s, 0.0, 60.0)?;
        within("faults.duplicate_probability", self.duplicate_probability, 0.0, 1.0)?;
        for interval in &self.outages {
            within("faults.outages.start_s", interval.start_s, 0.0, LONGEST_S)?;
            within("faults.outages.duration_s", interval.duration_s, 0.0, LONGEST_S)?;
        }
        for interval in &self.freezes {
            within("faults.freezes.start_s", interval.start_s, 0.0, LONGEST_S)?;
            within("faults.freezes.duration_s", interval.duration_s, 0.0, LONGEST_S)?;
        }
        for jump in &self.jumps {
            within("faults.jumps.start_s", jump.start_s, 0.0, LONGEST_S)?;
            within("faults.jumps.duration_s", jump.duration_s, 0.0, LONGEST_S)?;
            within("faults.jumps.recovery_s", jump.recovery_s, 0.0, LONGEST_S)?;
            vector("faults.jumps.position_m", jump.position_m, -100.0, 100.0)?;
            vector("faults.jumps.attitude_rad", jump.attitude_rad, -PI, PI)?;
            vector("faults.jumps.velocity_m_s", jump.velocity_m_s, -10.0, 10.0)?;
            vector("faults.jumps.rate_rad_s", jump.rate_rad_s, -10.0, 10.0)?;
        }
        let random = &self.random_jumps;
        within("faults.random_jumps.rate_hz", random.rate_hz, 0.0, 100.0)?;
        within("faults.random_jumps.rate_threshold_rad_s", random.rate_threshold_rad_s, 0.0, f64::INFINITY)?;
        within(
            "faults.random_jumps.acceleration_threshold_m_s2",
            random.acceleration_threshold_m_s2,
            0.0,
            f64::INFINITY,
        )?;
        within("faults.random_jumps.position_m", random.position_m, 0.0, 100.0)?;
        within("faults.random_jumps.attitude_rad", random.attitude_rad, 0.0, PI)?;
        within("faults.random_jumps.rate_rad_s", random.rate_rad_s, 0.0, 10.0)?;
        within("faults.random_jumps.duration_s", random.duration_s, 0.0, 600.0)?;
        within("faults.random_jumps.recovery_s", random.recovery_s, 0.0, 600.0)
    }
}

impl Default for JumpSettings {
    fn default() -> Self {
        Self {
            rate_hz: 0.0,
            rate_threshold_rad_s: f64::INFINITY,
            acceleration_threshold_m_s2: f64::INFINITY,
            position_m: 0.0,
            attitude_rad: 0.0,
            rate_rad_s: 0.0,
            duration_s: 0.0,
            recovery_s: 0.0,
        }
    }
}

/// Jitter of the arrival is cut here, ms.
pub(super) const LONGEST_ARRIVAL_JITTER_MS: f64 = 1000.0;
/// Largest accepted error of a sensor, in the unit of its signal.
const LARGEST_ERROR: f64 = 100.0;
/// Latest accepted time in a schedule, s: a month.
const LONGEST_S: f64 = 2_678_400.0;

const ACCELEROMETER_KEYS: [&str; 9] = [
    "imu.accelerometer.range",
    "imu.accelerometer.resolution",
    "imu.accelerometer.scale_sigma",
    "imu.accelerometer.misalignment_sigma_rad",
    "imu.accelerometer.noise_density",
    "imu.accelerometer.bias_sigma",
    "imu.accelerometer.bias_walk",
    "imu.accelerometer.markov_sigma",
    "imu.accelerometer.markov_time_s",
];
const GYRO_KEYS: [&str; 9] = [
    "imu.gyro.range",
    "imu.gyro.resolution",
    "imu.gyro.scale_sigma",
    "imu.gyro.misalignment_sigma_rad",
    "imu.gyro.noise_density",
    "imu.gyro.bias_sigma",
    "imu.gyro.bias_walk",
    "imu.gyro.markov_sigma",
    "imu.gyro.markov_time_s",
];

/// Whether a value lies in its range; not a number does not.
fn within(key: &'static str, value: f64, lowest: f64, highest: f64) -> Result<(), AstrobeeError> {
    if value >= lowest && value <= highest {
        return Ok(());
    }
    Err(AstrobeeError::SensingOutOfRange { key, value, lowest, highest, rule: "" })
}

fn vector(key: &'static str, values: [f64; 3], lowest: f64, highest: f64) -> Result<(), AstrobeeError> {
    values.into_iter().try_for_each(|value| within(key, value, lowest, highest))
}

/// Milliseconds to the nearest nanosecond.
#[allow(clippy::cast_possible_truncation, reason = "the cast saturates")]
pub(super) fn nanoseconds(ms: f64) -> i64 {
    libm::round(ms * 1e6) as i64
}
