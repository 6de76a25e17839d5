//! What goes wrong: losses, frozen outputs, duplicates and jumps.

use super::settings::nanoseconds;
use super::streams::{Source, stream};
use super::{Confidence, FaultSettings, Interval, Jump, LocalizationEstimate, TrueMotion};
use tumble_dynamics::nalgebra::{UnitQuaternion, Vector3};
use tumble_identification::noise::Gaussian;
use tumble_lie::LieGroup;

/// What happens to one estimate.
pub(super) struct Fault {
    pub lost: bool,
    pub frozen: bool,
    pub duplicated: bool,
    pub jump: Option<Offset>,
    pub confidence: Confidence,
}

/// Change of an estimate.
#[derive(Clone, Copy, Default)]
pub(super) struct Offset {
    position_world: Vector3<f64>,
    attitude_world: Vector3<f64>,
    velocity_world: Vector3<f64>,
    rate_body: Vector3<f64>,
}

impl Offset {
    fn add(&mut self, jump: &Jump, share: f64) {
        self.position_world += Vector3::from(jump.position_m) * share;
        self.attitude_world += Vector3::from(jump.attitude_rad) * share;
        self.velocity_world += Vector3::from(jump.velocity_m_s) * share;
        self.rate_body += Vector3::from(jump.rate_rad_s) * share;
    }

    pub(super) fn apply(&self, estimate: &mut LocalizationEstimate) {
        let turn: UnitQuaternion<f64> = LieGroup::exp(&self.attitude_world);
        let pose = &mut estimate.world_from_body;
        pose.translation.vector += self.position_world;
        pose.rotation = turn * pose.rotation;
        estimate.velocity_origin_world += self.velocity_world;
        estimate.rate_body += self.rate_body;
    }
}

/// Draws and schedules what goes wrong.
pub(super) struct Faults {
    settings: FaultSettings,
    honest_confidence: bool,
    start_ns: i64,
    burst_probability: f64,
    burst_until_ns: i64,
    jump_probability: f64,
    random_jump: Option<Jump>,
    drops: Gaussian,
    bursts: Gaussian,
    duplicates: Gaussian,
    jumps: Gaussian,
}

impl Faults {
    pub(super) fn new(settings: &FaultSettings, honest_confidence: bool, step_s: f64, seed: u64) -> Self {
        let within_step = |rate_hz: f64| 1.0 - libm::exp(-rate_hz * step_s);
        Self {
            settings: settings.clone(),
            honest_confidence,
            start_ns: 0,
            burst_probability: within_step(settings.burst_rate_hz),
            burst_until_ns: i64::MIN,
            jump_probability: within_step(settings.random_jumps.rate_hz),
            random_jump: None,
            drops: stream(seed, Source::Drops),
            bursts: stream(seed, Source::Bursts),
            duplicates: stream(seed, Source::Duplicates),
            jumps: stream(seed, Source::Jumps),
        }
    }

    /// The time from which schedules count.
    pub(super) fn start(&mut self, time_ns: i64) {
        self.start_ns = time_ns;
    }

    /// What happens to the estimate of this instant.
    pub(super) fn at(&mut self, truth: &TrueMotion) -> Fault {
        let elapsed_s = (truth.time_ns - self.start_ns) as f64 * 1e-9;
        let within = |intervals: &[Interval]| {
            intervals.iter().any(|i| elapsed_s >= i.start_s && elapsed_s < i.start_s + i.duration_s)
        };
        let dropped = self.dropped(truth.time_ns);
        let duplicated = self.settings.duplicate_probability > 0.0
            && self.duplicates.uniform() < self.settings.duplicate_probability;
        self.draw_jump(truth, elapsed_s);
        let mut offset = Offset::default();
        let mut largest_share: f64 = 0.0;
        for jump in self.settings.jumps.iter().chain(&self.random_jump) {
            let share = jump.share(elapsed_s);
            if share > 0.0 {
                offset.add(jump, share);
                largest_share = largest_share.max(share);
            }
        }
        let confidence = if !self.honest_confidence || largest_share == 0.0 {
            Confidence::Good
        } else if largest_share < 1.0 {
            Confidence::Poor
        } else {
            Confidence::Lost
        };
        Fault {
            lost: dropped || within(&self.settings.outages),
            frozen: within(&self.settings.freezes),
            duplicated,
            jump: (largest_share > 0.0).then_some(offset),
            confidence,
        }
    }

    fn dropped(&mut self, time_ns: i64) -> bool {
        if self.burst_probability > 0.0 {
            let (begins, length) = (self.bursts.uniform(), self.bursts.uniform());
            if time_ns >= self.burst_until_ns && begins < self.burst_probability {
                let length_s = -self.settings.burst_duration_s * libm::log(1.0 - length);
                self.burst_until_ns = time_ns + nanoseconds(1e3 * length_s);
            }
        }
        let alone = self.settings.drop_probability > 0.0 && self.drops.uniform() < self.settings.drop_probability;
        alone || time_ns < self.burst_until_ns
    }

    /// Starts a jump while the motion is too fast and none is under way.
    fn draw_jump(&mut self, truth: &TrueMotion, elapsed_s: f64) {
        if self.jump_probability == 0.0 {
            return;
        }
        let settings = &self.settings.random_jumps;
        let chance = self.jumps.uniform();
        let under_way = self.random_jump.is_some_and(|jump| jump.share(elapsed_s) > 0.0);
        let too_fast = truth.state.twist_body.angular.norm() > settings.rate_threshold_rad_s
            || truth.acceleration_origin_body.norm() > settings.acceleration_threshold_m_s2;
        if under_way || !too_fast || chance >= self.jump_probability {
            return;
        }
        let mut directed = |size: f64| (self.jumps.vector(1.0).normalize() * size).into();
        self.random_jump = Some(Jump {
            start_s: elapsed_s,
            duration_s: settings.duration_s,
            recovery_s: settings.recovery_s,
            position_m: directed(settings.position_m),
            attitude_rad: directed(settings.attitude_rad),
            velocity_m_s: [0.0; 3],
            rate_rad_s: directed(settings.rate_rad_s),
        });
    }
}

impl Jump {
    /// How much of it shows: one for its duration, then falling to zero in a straight line.
    fn share(&self, elapsed_s: f64) -> f64 {
        let since_s = elapsed_s - self.start_s;
        if since_s < 0.0 {
            0.0
        } else if since_s < self.duration_s {
            1.0
        } else if since_s < self.duration_s + self.recovery_s {
            (self.duration_s + self.recovery_s - since_s) / self.recovery_s
        } else {
            0.0
        }
    }
}
