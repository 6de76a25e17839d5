//! How far an attitude can stray, proved.
//!
//! # The loop
//! `q_e` is the turn from the wanted attitude to the actual one, `w_e` the angular velocity too much, body axes. With
//! `corner = stiffness / damping` and `s = w_e + corner vec(q_e)` the feedback is `-damping s`, whatever the errors. About the centre of mass
//! `J s' = -damping late(s) + w` with `w = d + corner J vec(q_e)' + (J a)' s of the reference + (w x J w)' s`: `late` samples, holds, delays and
//! lags; `w` collects what is not linear in `s`.
//!
//! # The proof
//! Say `|s| <= S` up to now, and `S < corner`. All at once:
//! 1. `d/dt 2 (1 - eta) = vec(q_e) . w_e = vec(q_e) . s - corner |vec(q_e)|^2 <= |vec(q_e)| (S - corner |vec(q_e)|)`: from within
//!    `|vec(q_e)| <= S / corner` it never leaves. Exact on the group; no angle is small.
//! 2. `|w_e| <= |s| + corner |vec(q_e)| <= 2 S`, and `|vec(q_e)'| <= |w_e| / 2 <= S`, since the map from `w_e` to twice `vec(q_e)'` has norm one.
//! 3. `|w x M w| = |w x (M - m I) w| <= (half the spread of M) |w|^2`, `m` the middle of its extreme eigenvalues.
//! 4. So `|w| <= a0 + a1 S + a2 S^2`: `a0` the disturbance and what the reference and noise leave at rest, `a1 = corner J_M` and what the
//!    turning of the reference adds, `a2 = 4 x` the half spread that nothing compensates.
//! 5. `J` is constant and symmetric, so along its axes `J s' = -damping late(s) + w` is three scalar loops. For a unit push their answers at the
//!    instants of measurement are `k_j`, and `|s| <= |w| sum of max over j of |k_j| = gain |w| / damping`. Continuously `k_j = exp(-damping t / j) / j`
//!    and `gain = 1 + ln(J_M / J_m) / e`; sampled and late it is summed up numerically, with bounds for the inertias between those looked
//!    at (`s_j - s_i` answers the difference of their rates, a contraction) and for the tail.
//! 6. Between instants `s` moves by at most `step / 2 (damping |s| + |w|) / J_m`.
//!
//! Together `S <= f(S)`, a parabola. Where `f` has a fixed point below `corner` with a slope below one, `f(S') < S'` just above it: the first
//! instant with `|s| = S'` would have `|s| <= f(S') < S'`, so there is none. The certificate is the least fixed point.
//!
//! # Deviation
//! The design bounds the gain by `sqrt(J_M / J_m)` from the level sets of `s . J s`, which knows neither sampling nor lag and is never less than
//! `1 + ln(J_M / J_m) / e`; and multiplies `a2` by that root once more, which step 3 does without.

use super::attitude::{AttitudeGains, AttitudeLaw};
use super::inertia_interval::InertiaInterval;
use super::peak_gain::{AttitudeTiming, PeakGain};
use crate::error::{PlanningError, not_negative, positive};
use nalgebra::ComplexField;

/// How a reference turns at most, in the axes of the wanted body; it was still before it began.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct ReferenceTurning {
    /// Angular velocity, rad/s.
    pub rate_rad_s: f64,
    /// Its derivative, rad/s^2.
    pub acceleration_rad_s2: f64,
    /// The derivative of that, rad/s^3; matters where feed-forward comes late.
    pub jerk_rad_s3: f64,
}

/// How wrong the measured attitude and angular velocity are at most.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct AttitudeNoise {
    /// Angle, rad.
    pub angle_rad: f64,
    /// Norm, rad/s.
    pub rate_rad_s: f64,
}

/// What an attitude loop meets, besides its body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeConditions {
    /// What is fed forward.
    pub law: AttitudeLaw,
    /// When commands act.
    pub timing: AttitudeTiming,
    /// What is followed.
    pub turning: ReferenceTurning,
    /// What is measured.
    pub noise: AttitudeNoise,
}

impl AttitudeConditions {
    /// A reference at rest, exact measurement, continuous control.
    pub fn ideal(law: AttitudeLaw) -> Self {
        let (turning, noise) = (ReferenceTurning::default(), AttitudeNoise::default());
        Self { law, timing: AttitudeTiming::CONTINUOUS, turning, noise }
    }
}

/// The torque there is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueBudget {
    /// Largest norm, N m.
    pub limit_n_m: f64,
    /// What of it feed-forward may take, N m.
    pub feed_forward_n_m: f64,
}

/// Why an attitude loop has no certificate.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AttitudeRefusal {
    /// A number that cannot be.
    #[error(transparent)]
    Invalid(#[from] PlanningError),
    /// The damping acts too late for the least inertia, or dies out too slowly to be summed up.
    #[error("the damping acts too late: the loop is not shown to be stable for every inertia of the interval")]
    Unstable,
    /// The stiffness overwhelms the damping, however small the disturbance.
    #[error(
        "a damping of {damping_n_m_s} N m s is too little for the stiffness and the inertias: more than {needed_n_m_s} is needed"
    )]
    DampingTooSmall {
        /// What there is, N m s.
        damping_n_m_s: f64,
        /// What the stiffness in proportion to it takes, N m s.
        needed_n_m_s: f64,
    },
    /// The disturbance is so large that the terms of second order outgrow the damping.
    #[error("a disturbance of {disturbance_n_m} N m is beyond the {largest_n_m} N m that errors stay bounded for")]
    DisturbanceTooLarge {
        /// Everything that acts at rest, N m.
        disturbance_n_m: f64,
        /// Largest sum for which the fixed point exists, N m.
        largest_n_m: f64,
    },
    /// The error may reach half a turn.
    #[error("the error may reach half a turn: the bound on the vector part of its quaternion is {vector}")]
    HalfTurn {
        /// The bound, which would have to be below one.
        vector: f64,
    },
    /// Feedback and feed-forward together may exceed the limit.
    #[error("{needed_n_m} N m may be asked for, of {limit_n_m} N m")]
    Saturation {
        /// What may be asked for, N m.
        needed_n_m: f64,
        /// What there is, N m.
        limit_n_m: f64,
    },
}

/// An attitude loop whose errors may be bounded: everything that does not depend on the disturbance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeLoop {
    gains: AttitudeGains,
    inertia: InertiaInterval,
    /// At the instants of measurement, per `1 / damping`.
    peak: PeakGain,
    /// Between them over at them.
    between: f64,
    /// What acts without a disturbance, N m.
    at_rest: f64,
    /// Of it, what noise adds to commands, N m.
    noise: f64,
    /// Noise of the attitude, rad.
    noise_angle: f64,
    /// Torque per `S`, N m s.
    linear: f64,
    /// Torque per `S^2`, N m s^2.
    quadratic: f64,
}

/// Bounds that hold for ever, from every admitted start, under every disturbance up to the one named; norms, body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AttitudeCertificate {
    /// The disturbance, N m.
    pub disturbance_n_m: f64,
    /// Of the vector part of the attitude error.
    pub vector: f64,
    /// The angle of it, rad.
    pub angle_rad: f64,
    /// Of the error of the angular velocity, rad/s.
    pub rate_rad_s: f64,
    /// Of `w_e + corner vec(q_e)`, at all times, rad/s.
    pub combined_rad_s: f64,
    /// The same at the beginning, with the actuator at rest and the vector part within its bound, rad/s.
    pub start_rad_s: f64,
    /// Of the error of the angular acceleration, rad/s^2.
    pub acceleration_rad_s2: f64,
    /// Of the feedback torque, N m.
    pub feedback_n_m: f64,
    /// How many times its static share a disturbance can move the loop.
    pub gain: f64,
}

impl AttitudeLoop {
    /// Of gains, where the inertia is, and what is met.
    ///
    /// # Errors
    /// [`AttitudeRefusal::Invalid`], [`AttitudeRefusal::Unstable`], [`AttitudeRefusal::DampingTooSmall`].
    pub fn try_new(
        gains: AttitudeGains,
        inertia: InertiaInterval,
        conditions: &AttitudeConditions,
    ) -> Result<Self, AttitudeRefusal> {
        let stiffness = positive("the stiffness of the attitude", gains.stiffness_n_m)?;
        let damping = positive("the damping of the attitude", gains.damping_n_m_s)?;
        let AttitudeConditions { law, timing, turning, noise } = conditions;
        let delay = not_negative("the delay of the actuator", timing.delay_s)?;
        let lag = not_negative("the lag of the actuator", timing.lag_s)?;
        if not_negative("the step of the control", timing.step_s)? == 0.0 && delay + lag > 0.0 {
            positive("the step of the control", timing.step_s)?;
        }
        let rate = not_negative("the rate of the reference", turning.rate_rad_s)?;
        let acceleration = not_negative("the acceleration of the reference", turning.acceleration_rad_s2)?;
        let jerk = not_negative("the jerk of the reference", turning.jerk_rad_s3)?;
        let angle = not_negative("the noise of the attitude", noise.angle_rad)?;
        let rate_noise = not_negative("the noise of the angular velocity", noise.rate_rad_s)?;

        let peak = PeakGain::of(damping, &inertia, timing).ok_or(AttitudeRefusal::Unstable)?;
        let step_share = 0.5 * timing.step_s * damping / inertia.least_kg_m2();
        let between = 1.0 + step_share * (1.0 + 1.0 / peak.gain);
        let (largest, corner) = (inertia.largest_kg_m2(), gains.corner_per_s());
        // a turn by `angle` moves unit quaternions by at most half of it and unit vectors by at most the whole
        let noise_torque = stiffness * 0.5 * angle + damping * (rate_noise + angle * rate);
        let (spread, at_rest, linear) = match law {
            AttitudeLaw::Feedback => {
                (inertia.half_spread(), largest * acceleration + noise_torque, 2.0 * largest * rate)
            }
            AttitudeLaw::Geometric => {
                let (age, believed) = (timing.age_s(), inertia.believed_largest());
                let both = inertia.half_spread() + inertia.believed_half_spread();
                // what is fed forward late and depends on the errors themselves is credited with nothing
                let (spread, turned) = if age > 0.0 {
                    (both, largest + believed)
                } else {
                    (both.min(inertia.error_kg_m2()), inertia.error_kg_m2())
                };
                let fed_noise = believed * (angle * acceleration + rate * rate_noise + angle * rate * rate)
                    + inertia.believed_half_spread() * (2.0 * rate * rate_noise + rate_noise * rate_noise);
                let fed_noise_slope = believed * 2.0 * angle * rate + inertia.believed_half_spread() * 4.0 * rate_noise;
                (
                    spread,
                    inertia.error_kg_m2() * acceleration + believed * age * jerk + noise_torque + fed_noise,
                    believed * age * 2.0 * acceleration + 2.0 * turned * rate + fed_noise_slope,
                )
            }
        };
        let attitude_loop = Self {
            gains,
            inertia,
            peak,
            between,
            at_rest: at_rest + spread * rate * rate,
            noise: noise_torque,
            noise_angle: angle,
            linear: linear + corner * largest + 4.0 * spread * rate,
            quadratic: 4.0 * spread,
        };
        if attitude_loop.reserve() > 0.0 {
            return Ok(attitude_loop);
        }
        let needed_n_m_s = attitude_loop.linear * peak.gain * between;
        Err(AttitudeRefusal::DampingTooSmall { damping_n_m_s: damping, needed_n_m_s })
    }

    /// The bounds under a disturbance: the norm of every torque about the centre of mass that is neither commanded nor named in the
    /// conditions, such as `(c_believed - c) x f`, N m.
    ///
    /// # Errors
    /// Every [`AttitudeRefusal`].
    pub fn certify(&self, disturbance_n_m: f64, budget: &TorqueBudget) -> Result<AttitudeCertificate, AttitudeRefusal> {
        let disturbance_n_m = not_negative("the disturbance torque", disturbance_n_m)?;
        let limit_n_m = positive("the torque limit", budget.limit_n_m)?;
        let feed_forward = not_negative("the feed-forward torque", budget.feed_forward_n_m)?;
        let constant = self.at_rest + disturbance_n_m;
        let reserve = self.reserve();
        let discriminant = reserve * reserve - 4.0 * constant * self.quadratic;
        if !(discriminant > 0.0) {
            let largest_n_m = 0.25 * reserve * reserve / self.quadratic;
            return Err(AttitudeRefusal::DisturbanceTooLarge { disturbance_n_m: constant, largest_n_m });
        }
        let combined_rad_s = 2.0 * constant / (reserve + f64::sqrt(discriminant));
        let vector = combined_rad_s / self.gains.corner_per_s();
        // the sign of a measured quaternion is told from its scalar part
        if !(vector < 1.0 && f64::sqrt(1.0 - vector * vector) > 0.5 * self.noise_angle) {
            return Err(AttitudeRefusal::HalfTurn { vector });
        }
        let damping = self.gains.damping_n_m_s;
        let measured = combined_rad_s / self.between;
        let feedback_n_m = damping * measured + self.noise;
        let needed_n_m = feedback_n_m + feed_forward;
        if !(needed_n_m <= limit_n_m) {
            return Err(AttitudeRefusal::Saturation { needed_n_m, limit_n_m });
        }
        let torque = damping * measured / self.peak.gain;
        Ok(AttitudeCertificate {
            disturbance_n_m,
            vector,
            angle_rad: 2.0 * ComplexField::asin(vector),
            rate_rad_s: 2.0 * combined_rad_s,
            combined_rad_s,
            start_rad_s: self.peak.start * torque / damping,
            acceleration_rad_s2: (damping * measured + torque) / self.inertia.least_kg_m2(),
            feedback_n_m,
            gain: self.peak.gain,
        })
    }

    /// Largest disturbance that is certified with this torque; `None` where not even none is, N m.
    pub fn largest_disturbance_n_m(&self, budget: &TorqueBudget) -> Option<f64> {
        let left = budget.limit_n_m - budget.feed_forward_n_m - self.noise;
        let upright = f64::sqrt((1.0 - 0.25 * self.noise_angle * self.noise_angle).max(0.0));
        // where the torque, half a turn, or the terms of second order end it
        let by_torque = left / self.gains.damping_n_m_s * self.between;
        let by_turn = self.gains.corner_per_s() * upright;
        let by_order = 0.5 * self.reserve() / self.quadratic;
        let combined = by_torque.min(by_turn).min(by_order) * (1.0 - 1e-9);
        let largest = (self.reserve() - self.quadratic * combined) * combined - self.at_rest;
        (combined > 0.0 && largest >= 0.0).then_some(largest)
    }

    /// Largest force whose torque about the true centre of mass, when the believed one is off by at most this, is certified together with
    /// another disturbance, N; zero where nothing is.
    pub fn force_allowed_n(
        &self,
        budget: &TorqueBudget,
        other_disturbance_n_m: f64,
        center_of_mass_error_m: f64,
    ) -> f64 {
        let left = self.largest_disturbance_n_m(budget).unwrap_or(0.0) - other_disturbance_n_m;
        if left > 0.0 { left / center_of_mass_error_m.max(0.0) } else { 0.0 }
    }

    /// What the damping has left per `S`, N m s.
    fn reserve(&self) -> f64 {
        self.gains.damping_n_m_s / (self.peak.gain * self.between) - self.linear
    }
}

impl AttitudeCertificate {
    /// The bounds of a loop under a disturbance: [`AttitudeLoop::try_new`], then [`AttitudeLoop::certify`].
    ///
    /// # Errors
    /// Every [`AttitudeRefusal`].
    pub fn try_new(
        gains: AttitudeGains,
        inertia: InertiaInterval,
        disturbance_n_m: f64,
        budget: &TorqueBudget,
        conditions: &AttitudeConditions,
    ) -> Result<Self, AttitudeRefusal> {
        AttitudeLoop::try_new(gains, inertia, conditions)?.certify(disturbance_n_m, budget)
    }
}
