//! What a flight estimator is told about sensors, thrust and its own patience.

use super::super::MotionNoise;
use super::erring_thrusters::{ErringThruster, THRUSTERS};
use super::slow_errors::SlowErrors;
use crate::Estimate;
use crate::error::IdentificationError;
use nalgebra::{ComplexField, SVector, Vector6};

/// Errors of the believed wrench, per axis, torque before force, body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchErrors {
    /// Standard deviation of the slow additive part, N m and N.
    pub drift: Vector6<f64>,
    /// Its correlation time, s.
    pub drift_time_s: f64,
    /// The thrusters, each of which errs by a constant share: thrust that is everywhere larger than on paper, forces that act beside the line where they
    /// are believed since those of a pair differ, and that act where a body should only turn.
    pub thrusters: [ErringThruster; THRUSTERS],
    /// What a wrench in doubt may be off by, as a multiple of the drift.
    pub doubted: f64,
    /// How long a wrench is held to which the white noise of [`MotionNoise`] belongs, s; over other times it averages.
    pub period_s: f64,
}

/// How long a wrench in doubt stays off by the same, s: an actuator that does not obey is off by what it is told.
const DOUBTED_S: f64 = 3.0;

impl WrenchErrors {
    /// Of actuators that do not do what they are told: the drift is `doubted` times as large, and changes within seconds.
    #[must_use]
    pub fn doubted(&self) -> Self {
        Self { drift: self.drift * self.doubted, drift_time_s: f64::min(DOUBTED_S, self.drift_time_s), ..*self }
    }

    /// Thrusters in opposite pairs, `arm_m` to either side of the middle, that err independently, each axis in each sense by
    /// `relative` of one / √`pushing`: as if so many shared its force. What drifts, and how long a wrench is held, as it is.
    #[must_use]
    pub fn of_thrusters(self, relative: f64, pushing: u32, arm_m: f64) -> Self {
        let each = relative * ComplexField::sqrt(2.0 / f64::from(pushing.max(1)));
        Self { thrusters: ErringThruster::in_pairs(each, arm_m), ..self }
    }
}

/// Settings of a [`FlightEstimator`](super::FlightEstimator).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightEstimatorSettings {
    /// Noise of the measurements, of the wrench from step to step, and drift of the body.
    pub noise: MotionNoise,
    /// Slow errors of the believed wrench.
    pub wrench: WrenchErrors,
    /// Slow errors of the sensors.
    pub slow: SlowErrors,
    /// Motion in the plane z = const only: x, y and the turn about z are filtered, the rest stays as it starts.
    pub planar: bool,
    /// Standard deviation of the start per axis: attitude rad, position m, rate rad/s, velocity m/s.
    pub start_deviation: [f64; 4],
    /// Probability with which a good measurement passes the gate.
    pub gate_probability: f64,
    /// Gated measurements that agree for so long are believed instead of the motion, s.
    pub relocalise_after_s: f64,
    /// At least so many of them.
    pub relocalise_count: u32,
    /// Measurements older than this when they arrive are not used, s.
    pub lateness_s: f64,
    /// Measurements this far ahead of the last believed wrench are still used, s.
    pub lead_s: f64,
    /// Time constant of the running means that judge health and the body, s.
    pub health_time_s: f64,
    /// Probability that a running mean of a good filter stays below its alarm at one moment.
    pub alarm_probability: f64,
}

impl FlightEstimatorSettings {
    /// Usual patience around these noise levels: thrusters in pairs 0.2 m apart, each known to 1 %, 0.2 mN m and 2 mN of slow
    /// drift.
    pub fn new(noise: MotionNoise) -> Self {
        let (torque, force) = (2e-4, 2e-3);
        Self {
            noise,
            wrench: WrenchErrors {
                drift: Vector6::new(torque, torque, torque, force, force, force),
                drift_time_s: 30.0,
                thrusters: [ErringThruster::NONE; THRUSTERS],
                doubted: 100.0,
                period_s: 0.016,
            }
            .of_thrusters(0.01, 2, 0.1),
            slow: SlowErrors::NONE,
            planar: false,
            start_deviation: [0.02, 0.01, 0.01, 0.01],
            gate_probability: 0.999_99,
            relocalise_after_s: 0.5,
            relocalise_count: 3,
            lateness_s: 1.0,
            lead_s: 0.02,
            health_time_s: 1.0,
            alarm_probability: 1.0 - 1e-8,
        }
    }

    /// For a robot that sees where it is and not how fast it is, whose wrench is held for `period_s`: noise of the poses, of the wrench
    /// 0.1 mN m and 1 mN, and a body that keeps its parameters.
    pub fn of_poses(attitude_rad: f64, position_m: f64, period_s: f64) -> Self {
        let unused = 1.0;
        let noise = MotionNoise {
            attitude_rad,
            position_m,
            rate_rad_s: unused,
            velocity_m_s: unused,
            acceleration_m_s2: unused,
            torque_n_m: 1e-4,
            force_n: 1e-3,
            drift: SVector::repeat(1e-6),
        };
        let usual = Self::new(noise);
        Self { wrench: WrenchErrors { period_s, ..usual.wrench }, ..usual }
    }

    /// Refuses what is not positive and finite, and probabilities that are none.
    pub(super) fn check(&self) -> Result<(), IdentificationError> {
        let noise = &self.noise;
        let [a, p, r, v] = self.start_deviation;
        let positive = [
            noise.attitude_rad,
            noise.position_m,
            noise.rate_rad_s,
            noise.velocity_m_s,
            self.wrench.drift_time_s,
            self.wrench.period_s,
            a,
            p,
            r,
            v,
            self.lateness_s,
            self.relocalise_after_s,
            self.health_time_s,
        ];
        if let Some(index) = positive.iter().position(|value| !(*value > 0.0 && value.is_finite())) {
            return Err(IdentificationError::NotPositive { index, value: positive[index] });
        }
        let rest = [noise.torque_n_m, noise.force_n, self.lead_s, self.wrench.doubted];
        let rest = rest.iter().chain(noise.drift.iter()).chain(self.wrench.drift.iter());
        for (index, value) in rest.enumerate() {
            if !(*value >= 0.0 && value.is_finite()) {
                return Err(IdentificationError::NotPositive { index: positive.len() + index, value: *value });
            }
        }
        for thruster in &self.wrench.thrusters {
            thruster.check()?;
        }
        self.slow.check()?;
        for value in [self.gate_probability, self.alarm_probability] {
            if !(value > 0.0 && value < 1.0) {
                return Err(IdentificationError::NotAProbability { value });
            }
        }
        Ok(())
    }
}

/// How well a body is to be known before excitation may end: one standard deviation of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearningTargets {
    /// Of the mass, as a part of the mass.
    pub mass: f64,
    /// Of the centre of mass along any body axis, m.
    pub center_of_mass_m: f64,
    /// Of each moment of inertia about the centre of mass, as a part of it.
    pub inertia: f64,
    /// Whether the flight is in the plane z = const: only what is seen there can be known, c_x, c_y and I_zz.
    pub planar: bool,
}

/// Once known well enough, a body stays so until an interval is this much wider than its target.
const STAYS_KNOWN: f64 = 1.25;

impl LearningTargets {
    /// Whether every interval is inside its target; where they `were` until now, each may be a quarter wider.
    pub fn are_met(&self, body: &Estimate, were: bool) -> bool {
        let allowance = if were { STAYS_KNOWN } else { 1.0 };
        let (inertia, std) = (body.parameters.inertia_about_com(), &body.std);
        let (centers, moments) = if self.planar { (0..2, 2..3) } else { (0..3, 0..3) };
        std.mass_kg <= allowance * self.mass * body.parameters.mass
            && centers.into_iter().all(|i| std.center_of_mass_m[i] <= allowance * self.center_of_mass_m)
            && moments
                .into_iter()
                .all(|i| std.inertia_about_com_kg_m2[(i, i)] <= allowance * self.inertia * inertia[(i, i)])
    }
}

/// A jump of the body: standard deviation of each of the ten [`LogCholesky`](crate::dynamics::LogCholesky) coordinates.
///
/// Half the logarithm of the mass, 10 cm, 0.5 in the logarithm of the extents, 4 cm in the shears: a grasp of up to the own mass,
/// at arm's length.
pub fn grasp_or_release() -> SVector<f64, 10> {
    SVector::from([0.5, 0.1, 0.1, 0.1, 0.5, 0.5, 0.5, 0.04, 0.04, 0.04])
}
