//! The inertial unit, and what the flight software makes of it.

use super::streams::{Source, TriadSources, stream};
use super::{AccelerometerFilter, GyroFilter, ImuSettings, SensorErrors, TrueMotion};
use crate::propulsion::ImpellerMode;
use core::f64::consts::FRAC_1_SQRT_2;
use tumble_dynamics::nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use tumble_identification::noise::Gaussian;

/// Samples per second inside the unit.
const INTERNAL_RATE_HZ: f64 = 2000.0;
/// Samples that the unit averages.
const TAPS: u32 = 64;
/// The slow bias walks in steps of this length, s.
const WALK_STEP_S: f64 = 1.0;

/// What the inertial unit sends.
///
/// # Frame
/// Axes of the unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample {
    /// Time of the sample, ns.
    pub time_ns: i64,
    /// Acceleration less gravity, at the unit, m/s^2.
    pub specific_force_sensor: Vector3<f64>,
    /// Angular rate, rad/s.
    pub rate_sensor: Vector3<f64>,
}

/// Slow bias of both triads.
///
/// # Frame
/// Axes of the unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuBias {
    /// Accelerometer, m/s^2.
    pub accelerometer: Vector3<f64>,
    /// Gyroscope, rad/s.
    pub gyro: Vector3<f64>,
}

/// The unit's axes in the body: 90 degrees about z.
fn body_from_sensor() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2))
}

/// The inertial unit: place, range, scale, misalignment, bias, noise, average of 64 samples, resolution.
///
/// # Deviation
/// The unit averages samples 0.5 ms apart; here the signal between two output samples is taken as straight, for which the
/// weights are exact (test `the_average_is_that_of_64_taps_on_a_straight_signal`). White noise keeps its density at low
/// frequencies. Non-linearity counts as an error of scale; temperature and the gyroscope's answer to acceleration are left out.
pub struct ImuModel {
    lever_arm_body: Vector3<f64>,
    gravity_world: Vector3<f64>,
    accelerometer: Triad,
    gyro: Triad,
}

impl ImuModel {
    /// A unit with the errors that `seed` draws.
    pub fn new(settings: &ImuSettings, gravity_world: Vector3<f64>, seed: u64) -> Self {
        Self {
            lever_arm_body: settings.lever_arm_body_m.into(),
            gravity_world,
            accelerometer: Triad::new(&settings.accelerometer, settings, seed, &Source::ACCELEROMETER),
            gyro: Triad::new(&settings.gyro, settings, seed, &Source::GYRO),
        }
    }

    /// The sample at the time of `truth`, which lies one sample interval after the last.
    pub fn measure(&mut self, truth: &TrueMotion) -> ImuSample {
        let rate = truth.state.twist_body.angular;
        let r = self.lever_arm_body;
        let turning = truth.angular_acceleration_body.cross(&r) + rate.cross(&rate.cross(&r));
        let attitude = truth.state.world_from_body.rotation;
        let gravity_body = attitude.inverse_transform_vector(&self.gravity_world);
        let to_sensor = |body: Vector3<f64>| body_from_sensor().inverse_transform_vector(&body);
        let specific_force = truth.acceleration_origin_body + turning - gravity_body;
        ImuSample {
            time_ns: truth.time_ns,
            specific_force_sensor: self.accelerometer.measure(to_sensor(specific_force)),
            rate_sensor: self.gyro.measure(to_sensor(rate)),
        }
    }

    /// The slow bias now.
    pub fn bias(&self) -> ImuBias {
        ImuBias { accelerometer: self.accelerometer.bias, gyro: self.gyro.bias }
    }
}

/// Three sensing axes.
struct Triad {
    errors: SensorErrors,
    /// Scale and misalignment.
    gain: Matrix3<f64>,
    noise_sigma: f64,
    noise: Gaussian,
    bias: Vector3<f64>,
    walk: Gaussian,
    walk_every: u32,
    samples: u32,
    fast_bias: Vector3<f64>,
    fast_decay: f64,
    fast_drive: f64,
    fast: Gaussian,
    average: Option<MovingAverage>,
}

impl Triad {
    fn new(errors: &SensorErrors, settings: &ImuSettings, seed: u64, sources: &TriadSources) -> Self {
        let step_s = settings.step_s();
        let scale = stream(seed, sources.scale).vector(errors.scale_sigma);
        let mut misalignment = stream(seed, sources.misalignment);
        let gain = Matrix3::from_fn(|row, column| {
            if row == column { 1.0 + scale[row] } else { misalignment.normal() * errors.misalignment_sigma_rad }
        });
        let mut fast = stream(seed, sources.fast);
        let decay = libm::exp(-step_s / errors.markov_time_s);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 62 and 125")]
        let walk_every = (WALK_STEP_S / step_s) as u32;
        Self {
            errors: *errors,
            gain,
            noise_sigma: errors.noise_density * libm::sqrt(0.5 / step_s),
            noise: stream(seed, sources.noise),
            bias: stream(seed, sources.bias).vector(errors.bias_sigma),
            walk: stream(seed, sources.walk),
            walk_every,
            samples: 0,
            fast_bias: fast.vector(errors.markov_sigma),
            fast_decay: decay,
            fast_drive: errors.markov_sigma * libm::sqrt(1.0 - decay * decay),
            fast,
            average: settings.moving_average.then(|| MovingAverage::new(step_s)),
        }
    }

    fn measure(&mut self, truth: Vector3<f64>) -> Vector3<f64> {
        self.samples += 1;
        if self.samples == self.walk_every {
            self.samples = 0;
            self.bias += self.walk.vector(self.errors.bias_walk * libm::sqrt(WALK_STEP_S));
        }
        // A source that is off draws nothing: it has its stream for itself.
        if self.errors.markov_sigma > 0.0 {
            self.fast_bias = self.fast_bias * self.fast_decay + self.fast.vector(self.fast_drive);
        }
        let mut signal = self.gain * truth + self.bias + self.fast_bias;
        if self.noise_sigma > 0.0 {
            signal += self.noise.vector(self.noise_sigma);
        }
        signal = signal.map(|x| x.clamp(-self.errors.range, self.errors.range));
        if let Some(average) = &mut self.average {
            signal = average.update(signal);
        }
        if self.errors.resolution > 0.0 {
            signal = signal.map(|x| libm::round(x / self.errors.resolution) * self.errors.resolution);
        }
        signal
    }
}

/// Weights of the output samples in the mean of the last 64 internal ones.
pub(super) fn average_of_taps(step_s: f64) -> [f64; 5] {
    let mut weights = [0.0; 5];
    for tap in 0..TAPS {
        let age = f64::from(tap) / (INTERNAL_RATE_HZ * step_s);
        for (sample, weight) in weights.iter_mut().enumerate() {
            *weight += (1.0 - (age - sample as f64).abs()).max(0.0) / f64::from(TAPS);
        }
    }
    weights
}

/// Mean of the last 64 internal samples of a signal that is straight between the samples seen.
struct MovingAverage {
    weights: [f64; 5],
    past: Option<[Vector3<f64>; 4]>,
}

impl MovingAverage {
    fn new(step_s: f64) -> Self {
        Self { weights: average_of_taps(step_s), past: None }
    }

    fn update(&mut self, input: Vector3<f64>) -> Vector3<f64> {
        let [a, b, c, d] = self.past.unwrap_or([input; 4]);
        let [w0, w1, w2, w3, w4] = self.weights;
        self.past = Some([input, a, b, c]);
        input * w0 + a * w1 + b * w2 + c * w3 + d * w4
    }
}

/// What the filters of the flight software give, bias removed.
///
/// # Frame
/// Body axes, at the place of the unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilteredImu {
    /// Acceleration less gravity, m/s^2.
    pub specific_force_body: Vector3<f64>,
    /// Angular rate, rad/s.
    pub rate_body: Vector3<f64>,
}

/// The flight software's way from samples of the unit to acceleration and rate of the body.
///
/// Filter by impeller mode, removal of bias, rotation to body axes; then gravity and the centripetal part of the lever arm
/// are taken out. As flown, the part from angular acceleration stays in: `acceleration_origin` is off by `alpha x r`.
pub struct ImuChain {
    accelerometer: Option<AccelerometerFilter>,
    gyro: Option<GyroFilter>,
    lever_arm_body: Vector3<f64>,
    gravity_world: Vector3<f64>,
}

impl ImuChain {
    /// The chain of an impeller mode.
    pub fn new(settings: &ImuSettings, gravity_world: Vector3<f64>, mode: ImpellerMode) -> Self {
        Self {
            accelerometer: settings.flight_filter.then(|| AccelerometerFilter::new(mode)),
            gyro: settings.flight_filter.then(|| GyroFilter::new(mode)),
            lever_arm_body: settings.lever_arm_body_m.into(),
            gravity_world,
        }
    }

    /// Changes the filters to another impeller mode; they start anew.
    pub fn set_impeller_mode(&mut self, mode: ImpellerMode) {
        self.accelerometer = self.accelerometer.is_some().then(|| AccelerometerFilter::new(mode));
        self.gyro = self.gyro.is_some().then(|| GyroFilter::new(mode));
    }

    /// Filters the next sample and removes what is believed to be the bias.
    pub fn update(&mut self, sample: &ImuSample, believed: &ImuBias) -> FilteredImu {
        let force = sample.specific_force_sensor;
        let force = self.accelerometer.as_mut().map_or(force, |filter| filter.update(force));
        let rate = sample.rate_sensor;
        let rate = self.gyro.as_mut().map_or(rate, |filter| filter.update(rate));
        FilteredImu {
            specific_force_body: body_from_sensor() * (force - believed.accelerometer),
            rate_body: body_from_sensor() * (rate - believed.gyro),
        }
    }

    /// Acceleration of the body origin without gravity, body axes, as far as the flight software removes the lever arm.
    pub fn acceleration_origin(&self, filtered: &FilteredImu, world_from_body: &UnitQuaternion<f64>) -> Vector3<f64> {
        let rate = filtered.rate_body;
        let gravity_body = world_from_body.inverse_transform_vector(&self.gravity_world);
        filtered.specific_force_body + gravity_body - rate.cross(&rate.cross(&self.lever_arm_body))
    }
}
