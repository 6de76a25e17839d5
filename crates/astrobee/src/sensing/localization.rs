//! What the localisation publishes and when it arrives.

use super::faults::Faults;
use super::imu::{FilteredImu, ImuBias};
use super::settings::nanoseconds;
use super::streams::{Source, stream};
use super::{
    Confidence, ImuChain, ImuModel, LocalizationEstimate, LocalizationSettings, PoseErrorSettings, TimingSettings,
    TrueMotion,
};
use crate::AstrobeeError;
use crate::propulsion::ImpellerMode;
use std::collections::VecDeque;
use tumble_dynamics::RigidBodyState;
use tumble_dynamics::nalgebra::{Translation3, UnitQuaternion, Vector3};
use tumble_identification::noise::Gaussian;
use tumble_lie::{LieGroup, Pose, Twist};

/// Estimates of a moving robot, made from its true motion.
///
/// Pose and velocity are true at the stamp but for their errors and the hidden latency; rate and acceleration carry the delay
/// of the unit's average and of the flight filters, as in the flight software. After construction nothing is allocated.
pub struct Localization {
    imu: ImuModel,
    chain: ImuChain,
    believed_bias: ImuBias,
    bias_gain: f64,
    acceleration_factor: Vector3<f64>,
    pose_errors: PoseErrors,
    timing: Timing,
    faults: Faults,
    /// Every sample as far back as any content may be, newest first.
    history: VecDeque<Content>,
    history_length: usize,
    /// Samples of the hidden latency.
    hidden: usize,
    /// Samples by which poses are older still.
    pose_later: f64,
    previous: Option<TrueMotion>,
    next_sample_ns: i64,
    sample_interval_ns: i64,
    until_publication: u32,
    publish_every: u32,
    last_published: Option<LocalizationEstimate>,
    on_the_way: VecDeque<LocalizationEstimate>,
    capacity: usize,
    unread: u64,
}

/// What one sample knows.
#[derive(Clone, Copy)]
struct Content {
    world_from_body: Pose<f64>,
    velocity_origin_world: Vector3<f64>,
    inertial: FilteredImu,
}

impl Localization {
    /// Sensors with the errors that `seed` draws, filters of the impeller mode.
    ///
    /// # Errors
    /// [`AstrobeeError::SensingOutOfRange`] naming the key.
    pub fn new(settings: &LocalizationSettings, seed: u64, mode: ImpellerMode) -> Result<Self, AstrobeeError> {
        settings.check()?;
        let gravity = Vector3::from(settings.gravity_world_m_s2);
        let imu = ImuModel::new(&settings.imu, gravity, seed);
        let sample_ms = settings.imu.sample_interval_ms;
        let hidden = (settings.timing.hidden_latency_ms / sample_ms) as usize;
        let pose_later = settings.timing.pose_latency_ms / f64::from(sample_ms);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked: at most 1000 / 8")]
        let history_length = hidden + libm::ceil(pose_later) as usize + 1;
        let following = settings.imu.bias_following_time_s;
        let (believed_bias, bias_gain) = match settings.imu.bias_removed {
            false => (ImuBias { accelerometer: Vector3::zeros(), gyro: Vector3::zeros() }, 0.0),
            true if following > 0.0 => (imu.bias(), 1.0 - libm::exp(-settings.imu.step_s() / following)),
            true => (imu.bias(), 1.0),
        };
        let capacity = settings.timing.most_on_the_way();
        Ok(Self {
            believed_bias,
            imu,
            chain: ImuChain::new(&settings.imu, gravity, mode),
            bias_gain,
            acceleration_factor: settings.acceleration_factor.into(),
            pose_errors: PoseErrors::new(&settings.pose, settings.timing.step_s(), seed),
            timing: Timing::new(&settings.timing, seed),
            faults: Faults::new(&settings.faults, settings.honest_confidence, settings.timing.step_s(), seed),
            history: VecDeque::with_capacity(history_length),
            history_length,
            hidden,
            pose_later,
            previous: None,
            next_sample_ns: 0,
            sample_interval_ns: i64::from(sample_ms) * 1_000_000,
            until_publication: 0,
            publish_every: settings.timing.publish_interval_ms / sample_ms,
            last_published: None,
            on_the_way: VecDeque::with_capacity(capacity),
            capacity,
            unread: 0,
        })
    }

    /// Changes the filters to another impeller mode; they start anew.
    pub fn set_impeller_mode(&mut self, mode: ImpellerMode) {
        self.chain.set_impeller_mode(mode);
    }

    /// Takes the truth of one instant; one that is not later than the last is left out.
    ///
    /// The inertial unit samples at its own rate from the first observation on, and every so many of its samples are
    /// published. Between observations the truth is interpolated, so that any step will do: at 16 ms every second sample is
    /// interpolated, at 4 ms every second observation is skipped.
    pub fn observe(&mut self, truth: &TrueMotion) {
        let previous = match self.previous {
            Some(previous) if truth.time_ns <= previous.time_ns => return,
            Some(previous) => previous,
            None => {
                self.next_sample_ns = truth.time_ns;
                self.faults.start(truth.time_ns);
                *truth
            }
        };
        while self.next_sample_ns <= truth.time_ns {
            let sampled = if self.next_sample_ns == truth.time_ns {
                *truth
            } else {
                between(&previous, truth, self.next_sample_ns)
            };
            self.sample(&sampled);
            self.next_sample_ns += self.sample_interval_ns;
        }
        self.previous = Some(*truth);
    }

    /// The next estimate that has arrived by `now_ns`, in order of arrival; call until there is none.
    pub fn arrived(&mut self, now_ns: i64) -> Option<LocalizationEstimate> {
        if self.on_the_way.front()?.arrival_ns > now_ns {
            return None;
        }
        self.on_the_way.pop_front()
    }

    /// Estimates discarded because nobody read: more were on their way than the latencies explain.
    pub fn unread(&self) -> u64 {
        self.unread
    }

    /// One sample of the inertial unit.
    fn sample(&mut self, truth: &TrueMotion) {
        let sample = self.imu.measure(truth);
        let bias = self.imu.bias();
        self.believed_bias.accelerometer += (bias.accelerometer - self.believed_bias.accelerometer) * self.bias_gain;
        self.believed_bias.gyro += (bias.gyro - self.believed_bias.gyro) * self.bias_gain;
        let inertial = self.chain.update(&sample, &self.believed_bias);
        if self.history.len() == self.history_length {
            self.history.pop_back();
        }
        let world_from_body = truth.state.world_from_body;
        self.history.push_front(Content {
            world_from_body,
            velocity_origin_world: world_from_body.rotation * truth.state.twist_body.linear,
            inertial,
        });
        if self.until_publication == 0 {
            self.until_publication = self.publish_every;
            self.publish(truth);
        }
        self.until_publication -= 1;
    }

    /// What is published now: rate and acceleration of one sample, pose and velocity of a time before.
    fn content(&self) -> Option<Content> {
        let oldest = self.history.len().checked_sub(1)?;
        let at = |index: usize| self.history.get(index.min(oldest)).copied();
        let inertial = at(self.hidden)?;
        if self.pose_later == 0.0 {
            return Some(inertial);
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked: at most 1000 / 8")]
        let whole = libm::floor(self.pose_later) as usize;
        let share = self.pose_later - libm::floor(self.pose_later);
        let (newer, older) = (at(self.hidden + whole)?, at(self.hidden + whole + 1)?);
        let turn: Vector3<f64> =
            LieGroup::log(&newer.world_from_body.rotation.between(&older.world_from_body.rotation));
        let turned: UnitQuaternion<f64> = LieGroup::exp(&(turn * share));
        let (from, to) = (newer.world_from_body.translation.vector, older.world_from_body.translation.vector);
        Some(Content {
            world_from_body: Pose::from_parts(
                Translation3::from(from + (to - from) * share),
                newer.world_from_body.rotation * turned,
            ),
            velocity_origin_world: newer.velocity_origin_world
                + (older.velocity_origin_world - newer.velocity_origin_world) * share,
            ..inertial
        })
    }

    fn publish(&mut self, truth: &TrueMotion) {
        let Some(content) = self.content() else { return };
        let fault = self.faults.at(truth);
        let mut estimate = self.estimate(&content);
        (estimate.stamp_ns, estimate.arrival_ns) = self.timing.stamp_and_arrival(truth.time_ns);
        let duplicate_ns = self.timing.arrival_of_duplicate(truth.time_ns).max(estimate.stamp_ns);
        if let Some(jump) = fault.jump {
            jump.apply(&mut estimate);
        }
        estimate.confidence = fault.confidence;
        if let Some(last) = self.last_published.filter(|_| fault.frozen) {
            estimate = LocalizationEstimate { stamp_ns: estimate.stamp_ns, arrival_ns: estimate.arrival_ns, ..last };
        }
        self.last_published = Some(estimate);
        if fault.lost {
            return;
        }
        self.send(estimate);
        if fault.duplicated {
            self.send(LocalizationEstimate { arrival_ns: duplicate_ns, ..estimate });
        }
    }

    /// Content with the errors of pose and velocity; times and confidence are still to come.
    fn estimate(&mut self, content: &Content) -> LocalizationEstimate {
        let error = self.pose_errors.draw();
        let turn: UnitQuaternion<f64> = LieGroup::exp(&error.attitude_body);
        let pose = content.world_from_body;
        let rotation = pose.rotation * turn;
        let acceleration = self.chain.acceleration_origin(&content.inertial, &rotation);
        LocalizationEstimate {
            stamp_ns: 0,
            arrival_ns: 0,
            world_from_body: Pose::from_parts(
                Translation3::from(pose.translation.vector + error.position_world),
                rotation,
            ),
            velocity_origin_world: content.velocity_origin_world + error.velocity_world,
            rate_body: content.inertial.rate_body,
            acceleration_origin_body: acceleration.component_mul(&self.acceleration_factor),
            confidence: Confidence::Good,
        }
    }

    /// Puts an estimate among those on their way, which are in order of arrival; of equal arrivals the first sent is first.
    fn send(&mut self, estimate: LocalizationEstimate) {
        if self.on_the_way.len() == self.capacity {
            self.unread += 1;
            return;
        }
        self.on_the_way.push_back(estimate);
        let mut place = self.on_the_way.len() - 1;
        while place > 0 && self.on_the_way[place - 1].arrival_ns > self.on_the_way[place].arrival_ns {
            self.on_the_way.swap(place - 1, place);
            place -= 1;
        }
    }
}

/// The truth at a time between two instants: position by a cubic with the right velocities, all else straight.
fn between(before: &TrueMotion, after: &TrueMotion, time_ns: i64) -> TrueMotion {
    let span_s = (after.time_ns - before.time_ns) as f64 * 1e-9;
    let s = (time_ns - before.time_ns) as f64 * 1e-9 / span_s;
    let straight = |a: &Vector3<f64>, b: &Vector3<f64>| a * (1.0 - s) + b * s;
    let (first, last) = (&before.state.world_from_body, &after.state.world_from_body);
    let velocity = |motion: &TrueMotion| motion.state.world_from_body.rotation * motion.state.twist_body.linear;
    let (v0, v1) = (velocity(before) * span_s, velocity(after) * span_s);
    let (x0, x1) = (first.translation.vector, last.translation.vector);
    let position =
        x0 + (x1 - x0) * (s * s * (3.0 - 2.0 * s)) + v0 * (s * (1.0 - s) * (1.0 - s)) + v1 * (s * s * (s - 1.0));
    // Both quaternions of a rotation may stand for it.
    let near = if first.rotation.coords.dot(&last.rotation.coords) < 0.0 { -1.0 } else { 1.0 };
    let rotation = UnitQuaternion::new_normalize(
        first.rotation.into_inner() * (1.0 - s) + last.rotation.into_inner() * (near * s),
    );
    let linear = rotation.inverse_transform_vector(&straight(&(v0 / span_s), &(v1 / span_s)));
    TrueMotion {
        time_ns,
        state: RigidBodyState {
            world_from_body: Pose::from_parts(Translation3::from(position), rotation),
            twist_body: Twist {
                angular: straight(&before.state.twist_body.angular, &after.state.twist_body.angular),
                linear,
            },
        },
        acceleration_origin_body: straight(&before.acceleration_origin_body, &after.acceleration_origin_body),
        angular_acceleration_body: straight(&before.angular_acceleration_body, &after.angular_acceleration_body),
    }
}

/// Errors of one estimate.
struct PoseError {
    position_world: Vector3<f64>,
    attitude_body: Vector3<f64>,
    velocity_world: Vector3<f64>,
}

/// White and slow errors of position, attitude and velocity.
struct PoseErrors {
    position: VectorError,
    attitude: VectorError,
    velocity: VectorError,
}

impl PoseErrors {
    fn new(settings: &PoseErrorSettings, step_s: f64, seed: u64) -> Self {
        let decay = libm::exp(-step_s / settings.drift_time_s);
        let error = |noise_sigma, drift_sigma, noise, drift| {
            VectorError::new(noise_sigma, drift_sigma, decay, stream(seed, noise), stream(seed, drift))
        };
        Self {
            position: error(
                settings.position_noise_m,
                settings.position_drift_m,
                Source::PositionNoise,
                Source::PositionDrift,
            ),
            attitude: error(
                settings.attitude_noise_rad,
                settings.attitude_drift_rad,
                Source::AttitudeNoise,
                Source::AttitudeDrift,
            ),
            velocity: error(
                settings.velocity_noise_m_s,
                settings.velocity_drift_m_s,
                Source::VelocityNoise,
                Source::VelocityDrift,
            ),
        }
    }

    fn draw(&mut self) -> PoseError {
        PoseError {
            position_world: self.position.draw(),
            attitude_body: self.attitude.draw(),
            velocity_world: self.velocity.draw(),
        }
    }
}

/// White noise on a first-order Markov process.
struct VectorError {
    noise_sigma: f64,
    noise: Gaussian,
    drift: Vector3<f64>,
    decay: f64,
    drive: f64,
    drive_stream: Gaussian,
}

impl VectorError {
    fn new(noise_sigma: f64, drift_sigma: f64, decay: f64, noise: Gaussian, mut drive_stream: Gaussian) -> Self {
        Self {
            noise_sigma,
            noise,
            drift: drive_stream.vector(drift_sigma),
            decay,
            drive: drift_sigma * libm::sqrt(1.0 - decay * decay),
            drive_stream,
        }
    }

    fn draw(&mut self) -> Vector3<f64> {
        if self.drive > 0.0 {
            self.drift = self.drift * self.decay + self.drive_stream.vector(self.drive);
        }
        if self.noise_sigma > 0.0 { self.drift + self.noise.vector(self.noise_sigma) } else { self.drift }
    }
}

/// When estimates are stamped and when they arrive.
struct Timing {
    latency_ns: i64,
    settings: TimingSettings,
    stamps: Gaussian,
    arrivals: Gaussian,
    duplicates: Gaussian,
}

impl Timing {
    fn new(settings: &TimingSettings, seed: u64) -> Self {
        Self {
            latency_ns: nanoseconds(settings.latency_ms),
            settings: settings.clone(),
            stamps: stream(seed, Source::StampJitter),
            arrivals: stream(seed, Source::ArrivalJitter),
            duplicates: stream(seed, Source::DuplicateArrival),
        }
    }

    fn stamp_and_arrival(&mut self, time_ns: i64) -> (i64, i64) {
        let sigma_ms = self.settings.stamp_jitter_ms;
        let stamp_ns = if sigma_ms > 0.0 {
            time_ns + nanoseconds(self.stamps.normal().clamp(-4.0, 4.0) * sigma_ms)
        } else {
            time_ns
        };
        let arrival_ns = time_ns + self.latency_ns + extra_ns(&mut self.arrivals, self.settings.arrival_jitter_ms);
        (stamp_ns, arrival_ns.max(stamp_ns))
    }

    fn arrival_of_duplicate(&mut self, time_ns: i64) -> i64 {
        time_ns + self.latency_ns + extra_ns(&mut self.duplicates, self.settings.arrival_jitter_ms)
    }
}

/// An exponentially distributed time.
fn extra_ns(stream: &mut Gaussian, mean_ms: f64) -> i64 {
    if mean_ms == 0.0 {
        return 0;
    }
    let wait_ms = -mean_ms * libm::log(1.0 - stream.uniform());
    nanoseconds(wait_ms.min(super::settings::LONGEST_ARRIVAL_JITTER_MS))
}
