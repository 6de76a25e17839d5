//! How far an attitude can stray, proved.
//!
//! # The loop
//! `q_e` is the turn from the wanted attitude to the actual one, `w_e` the angular velocity too much, body axes. With
//! `corner = stiffness / damping` and `s = w_e + corner vec(q_e)` the feedback is `-damping s`, whatever the errors. About the centre of mass
//! `J s' = -damping late(s) + w`: `late` samples, holds, delays and lags, and `w` is everything else, namely the disturbance, what noise adds
//! to commands, `corner J vec(q_e)'`, and what feed-forward leaves of `J a_d` and `w x J w`. Force and torque of one command are equally
//! late, so `c x f` is as good as the believed centre of mass.
//!
//! # The proof
//! Say `|s| <= S` up to now, and `S < corner`. All at once:
//! 1. `d/dt 2 (1 - eta) = vec(q_e) . w_e = vec(q_e) . s - corner |vec(q_e)|^2 <= |vec(q_e)| (S - corner |vec(q_e)|)`: from within
//!    `|vec(q_e)| <= S / corner` it never leaves. Exact on the group; no angle is small.
//! 2. `|w_e| <= |s| + corner |vec(q_e)| <= 2 S`, and `|vec(q_e)'| <= |w_e| / 2 <= S`, since the map from `w_e` to twice `vec(q_e)'` has norm one.
//! 3. `|v x M v| = |v x (M - m I) v| <= (half the spread of M) |v|^2` for an angular velocity `v`, `m` the middle of the extreme eigenvalues;
//!    `|v|` is at most `2 S` and the rate of the reference.
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
//! # Why not level sets
//! Those of `s . J s` give `sqrt(J_M / J_m)` for the gain, which is never less than `1 + ln(J_M / J_m) / e`, and know neither sampling nor lag.

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
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
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
    /// What the damping has left per `S`, N m s; positive.
    reserve: f64,
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
        positive("the stiffness of the attitude", gains.stiffness_n_m)?;
        let damping = positive("the damping of the attitude", gains.damping_n_m_s)?;
        let AttitudeConditions { timing, turning, noise, .. } = conditions;
        let delay = not_negative("the delay of the actuator", timing.delay_s)?;
        let lag = not_negative("the lag of the actuator", timing.lag_s)?;
        if not_negative("the step of the control", timing.step_s)? == 0.0 && delay + lag > 0.0 {
            positive("the step of the control", timing.step_s)?;
        }
        not_negative("the rate of the reference", turning.rate_rad_s)?;
        not_negative("the acceleration of the reference", turning.acceleration_rad_s2)?;
        not_negative("the jerk of the reference", turning.jerk_rad_s3)?;
        let noise_angle = not_negative("the noise of the attitude", noise.angle_rad)?;
        not_negative("the noise of the angular velocity", noise.rate_rad_s)?;

        let Unanswered { at_rest, linear, quadratic, noise } = Unanswered::of(gains, &inertia, conditions);
        let refused = |needed_n_m_s| AttitudeRefusal::DampingTooSmall { damping_n_m_s: damping, needed_n_m_s };
        // no gain is below one: a lasting torque must at last be met one to one
        if damping <= linear {
            return Err(refused(linear));
        }
        let peak = PeakGain::of(damping, &inertia, timing).ok_or(AttitudeRefusal::Unstable)?;
        let step_share = 0.5 * timing.step_s * damping / inertia.least_kg_m2();
        let between = 1.0 + step_share * (1.0 + 1.0 / peak.gain);
        let reserve = damping / (peak.gain * between) - linear;
        if reserve <= 0.0 {
            return Err(refused(linear * peak.gain * between));
        }
        Ok(Self { gains, inertia, peak, between, at_rest, noise, noise_angle, reserve, quadratic })
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
        let discriminant = self.reserve * self.reserve - 4.0 * constant * self.quadratic;
        if discriminant <= 0.0 {
            let largest_n_m = 0.25 * self.reserve * self.reserve / self.quadratic;
            return Err(AttitudeRefusal::DisturbanceTooLarge { disturbance_n_m: constant, largest_n_m });
        }
        let combined_rad_s = 2.0 * constant / (self.reserve + f64::sqrt(discriminant));
        let vector = combined_rad_s / self.gains.corner_per_s();
        // the sign of a measured quaternion is told from its scalar part
        if vector >= 1.0 || f64::sqrt(1.0 - vector * vector) <= 0.5 * self.noise_angle {
            return Err(AttitudeRefusal::HalfTurn { vector });
        }
        let damping = self.gains.damping_n_m_s;
        let measured = combined_rad_s / self.between;
        let feedback_n_m = damping * measured + self.noise;
        let needed_n_m = feedback_n_m + feed_forward;
        if needed_n_m > limit_n_m {
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
        if !left.is_finite() {
            return None;
        }
        let upright = f64::sqrt((1.0 - 0.25 * self.noise_angle * self.noise_angle).max(0.0));
        // where the torque, half a turn, or the terms of second order end it
        let by_torque = left / self.gains.damping_n_m_s * self.between;
        let by_turn = self.gains.corner_per_s() * upright;
        // near a double root rounding of the discriminant counts as its square root
        let by_order = 0.5 * self.reserve / self.quadratic * (1.0 - 1e-6);
        let combined = by_torque.min(by_turn).min(by_order) * (1.0 - 1e-9);
        let largest = (self.reserve - self.quadratic * combined) * combined - self.at_rest;
        (combined > 0.0 && largest >= 0.0).then_some(largest)
    }

    /// Largest force whose torque about the true centre of mass, when the believed one is off by at most this, is certified together with
    /// another disturbance, N; zero where nothing is, infinite where nothing is uncertain.
    pub fn force_allowed_n(
        &self,
        budget: &TorqueBudget,
        other_disturbance_n_m: f64,
        center_of_mass_error_m: f64,
    ) -> f64 {
        let left = self.largest_disturbance_n_m(budget).unwrap_or(0.0) - other_disturbance_n_m;
        if left > 0.0 && center_of_mass_error_m >= 0.0 { left / center_of_mass_error_m } else { 0.0 }
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

/// The torque that no feedback answers: `at_rest + linear S + quadratic S^2` bounds it.
struct Unanswered {
    at_rest: f64,
    linear: f64,
    quadratic: f64,
    /// The part of `at_rest` that noise adds to the feedback.
    noise: f64,
}

impl Unanswered {
    fn of(gains: AttitudeGains, inertia: &InertiaInterval, conditions: &AttitudeConditions) -> Self {
        let AttitudeConditions { law, timing, turning, noise } = conditions;
        let ReferenceTurning { rate_rad_s: rate, acceleration_rad_s2: acceleration, jerk_rad_s3: jerk } = *turning;
        let AttitudeNoise { angle_rad: angle, rate_rad_s: rate_noise } = *noise;
        let (largest, error) = (inertia.largest_kg_m2(), inertia.error_kg_m2());
        // a turn by `angle` moves unit quaternions by at most half of it and unit vectors by at most the whole
        let noise = gains.stiffness_n_m * 0.5 * angle + gains.damping_n_m_s * (rate_noise + angle * rate);
        let (spread, at_rest, linear) = match law {
            AttitudeLaw::Feedback => (inertia.half_spread(), largest * acceleration, 2.0 * largest * rate),
            AttitudeLaw::Geometric => {
                let (age, believed, believed_spread) =
                    (timing.age_s(), inertia.believed_largest(), inertia.believed_half_spread());
                let both = inertia.half_spread() + believed_spread;
                // what is fed forward late and depends on the errors themselves is credited with nothing
                let (spread, turned) = if age > 0.0 { (both, largest + believed) } else { (both.min(error), error) };
                let late = believed * age * jerk;
                let noisy = believed * (angle * acceleration + rate * rate_noise + angle * rate * rate)
                    + believed_spread * (2.0 * rate * rate_noise + rate_noise * rate_noise);
                let late_slope = 2.0 * believed * age * acceleration;
                let noisy_slope = 2.0 * believed * angle * rate + 4.0 * believed_spread * rate_noise;
                (spread, error * acceleration + late + noisy, 2.0 * turned * rate + late_slope + noisy_slope)
            }
        };
        // the rate itself is at most `2 S` and that of the reference
        Self {
            at_rest: at_rest + noise + spread * rate * rate,
            linear: linear + gains.corner_per_s() * largest + 4.0 * spread * rate,
            quadratic: 4.0 * spread,
            noise,
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact by construction")]
mod tests {
    use super::*;

    /// Stiffness, damping, least and largest moment of inertia.
    type Case = (f64, f64, f64, f64);

    const FLOWN: Case = (0.1, 0.2, 0.143, 0.162);
    const FLOWN_HALF_UNSURE: Case = (0.1, 0.2, 0.0715, 0.243);
    const HALF_UNSURE: Case = (0.15, 0.4, 0.0715, 0.243);
    const CARGO_KNOWN: Case = (0.15, 0.4, 0.38, 0.4);
    const CARGO: Case = (0.15, 0.6, 0.15, 0.45);
    const PLENTY: TorqueBudget = TorqueBudget { limit_n_m: 1.0, feed_forward_n_m: 0.0 };
    const SAMPLED: AttitudeTiming = AttitudeTiming { step_s: 0.016, delay_s: 0.0, lag_s: 0.0 };
    const SLOW: AttitudeTiming = AttitudeTiming { step_s: 0.016, delay_s: 0.0, lag_s: 0.18 };

    fn parts(case: Case) -> (AttitudeGains, InertiaInterval) {
        let gains = AttitudeGains { stiffness_n_m: case.0, damping_n_m_s: case.1 };
        (gains, InertiaInterval::between(case.2, case.3).unwrap())
    }

    fn conditions(law: AttitudeLaw, timing: AttitudeTiming) -> AttitudeConditions {
        AttitudeConditions { timing, ..AttitudeConditions::ideal(law) }
    }

    fn loop_of(case: Case, conditions: &AttitudeConditions) -> Result<AttitudeLoop, AttitudeRefusal> {
        let (gains, inertia) = parts(case);
        AttitudeLoop::try_new(gains, inertia, conditions)
    }

    fn feedback(case: Case, timing: AttitudeTiming) -> Result<AttitudeLoop, AttitudeRefusal> {
        loop_of(case, &conditions(AttitudeLaw::Feedback, timing))
    }

    /// Least fixed point by iteration from below; `None` where it runs away.
    fn fixed_point(of: impl Fn(f64) -> f64) -> Option<f64> {
        let mut value = 0.0;
        for _ in 0..100_000 {
            let next = of(value);
            if next > 10.0 {
                return None;
            }
            if (next - value).abs() <= 1e-16 {
                break;
            }
            value = next;
        }
        Some(value)
    }

    /// The design's table, by the design's fixed point; ours beside it, by iteration of the parabola and as pinned.
    #[test]
    fn the_table_of_the_design_and_what_is_proved_instead() {
        for (case, disturbance, designed, designed_torque, ours, ours_torque) in [
            (FLOWN, 0.002, 0.0377, 0.0038, 0.0365, 0.0037),
            (FLOWN, 0.005, 0.0953, 0.0095, 0.0922, 0.0092),
            (HALF_UNSURE, 0.002, 0.0464, 0.0070, 0.0295, 0.0044),
            (CARGO_KNOWN, 0.002, 0.0223, 0.0033, 0.0220, 0.0033),
            (CARGO, 0.002, 0.0356, 0.0053, 0.0257, 0.0039),
        ] {
            let (stiffness, damping, least, largest) = case;
            let (corner, root) = (stiffness / damping, f64::sqrt(largest / least));
            let by_level_sets =
                |s: f64| root / damping * (disturbance + corner * largest * s + 2.0 * root * (largest - least) * s * s);
            let level = fixed_point(by_level_sets).unwrap();
            assert!((level / corner - designed).abs() < 5.1e-5 && (damping * level - designed_torque).abs() < 5.1e-5);
            let gain = 1.0 + f64::ln(largest / least) / core::f64::consts::E;
            let by_peak_gain =
                |s: f64| gain / damping * (disturbance + corner * largest * s + 2.0 * (largest - least) * s * s);
            let expected = fixed_point(by_peak_gain).unwrap();
            let found = feedback(case, AttitudeTiming::CONTINUOUS).unwrap().certify(disturbance, &PLENTY).unwrap();
            assert!((found.combined_rad_s - expected).abs() < 1e-12, "{found:?} {expected}");
            assert!(
                (found.vector - ours).abs() < 5.1e-5 && (found.feedback_n_m - ours_torque).abs() < 5.1e-5,
                "{found:?}"
            );
            assert!((found.vector * corner - expected).abs() < 1e-12 && found.rate_rad_s == 2.0 * found.combined_rad_s);
            assert!((f64::sin(0.5 * found.angle_rad) - found.vector).abs() < 1e-15);
            // a lasting torque is a case: no bound is below its answer
            assert!(found.vector < designed && found.vector > disturbance / stiffness);
        }
    }

    /// The geometric law's products of rates are credited with nothing where they come late, and with the error of the belief else.
    #[test]
    fn what_the_gyroscopic_terms_leave() {
        let (gains, inertia) = parts(HALF_UNSURE);
        let geometric = |timing| conditions(AttitudeLaw::Geometric, timing);
        let late = AttitudeLoop::try_new(gains, inertia, &geometric(SAMPLED)).unwrap();
        assert!((late.quadratic - 4.0 * (0.243 - 0.0715)).abs() < 1e-15);
        let pure = feedback(HALF_UNSURE, SAMPLED).unwrap();
        assert!((pure.quadratic - 2.0 * (0.243 - 0.0715)).abs() < 1e-15);
        let belief =
            crate::ModelBelief::certain(1, tumble_dynamics::InertialParameters::solid_box(9.0, [0.3, 0.3, 0.3]));
        let known =
            InertiaInterval::believed(&belief, 3.0, &InertiaInterval::between(0.01, 1.0).unwrap()).unwrap().unwrap();
        let known = AttitudeLoop::try_new(gains, known, &geometric(AttitudeTiming::CONTINUOUS)).unwrap();
        assert!(known.quadratic < 1e-15);
        assert!(known.largest_disturbance_n_m(&PLENTY).is_some());
    }

    #[test]
    fn the_flown_gains_need_an_inertia_that_is_known() {
        for law in [AttitudeLaw::Feedback, AttitudeLaw::Geometric] {
            for timing in [AttitudeTiming::CONTINUOUS, SAMPLED, SLOW] {
                let known = loop_of(FLOWN, &conditions(law, timing)).unwrap();
                for disturbance in [0.0005, 0.002, 0.005] {
                    assert!(known.certify(disturbance, &PLENTY).is_ok());
                    let (gains, inertia) = parts(FLOWN_HALF_UNSURE);
                    let refusal =
                        AttitudeCertificate::try_new(gains, inertia, disturbance, &PLENTY, &conditions(law, timing));
                    let is_for_damping = matches!(refusal, Err(AttitudeRefusal::DampingTooSmall { .. }));
                    let is_for_size = matches!(refusal, Err(AttitudeRefusal::DisturbanceTooLarge { .. }));
                    assert!(if timing == SLOW { is_for_damping } else { is_for_size }, "{refusal:?}");
                }
            }
        }
    }

    #[test]
    fn every_refusal_names_its_reason_at_its_boundary() {
        // D <= gain k / D J_M, continuously and with one inertia: a gain of one
        let exact = |damping| feedback((0.1, damping, 0.2, 0.2), AttitudeTiming::CONTINUOUS);
        let critical = f64::sqrt(0.1 * 0.2);
        assert!(exact(1.001 * critical).is_ok());
        let refused = exact(0.999 * critical);
        assert!(matches!(refused, Err(AttitudeRefusal::DampingTooSmall { .. })), "{refused:?}");
        let unsure = |damping| feedback((0.1, damping, 0.1, 0.2), AttitudeTiming::CONTINUOUS);
        let critical = critical * f64::sqrt(1.0 + f64::ln(2.0) / core::f64::consts::E);
        assert!(unsure(1.001 * critical).is_ok());
        assert!(matches!(unsure(0.999 * critical), Err(AttitudeRefusal::DampingTooSmall { .. })));
        // half a turn: one inertia makes the parabola a line, `S = d / (D - k / D J)`
        let round = feedback((0.1, 0.4, 0.2, 0.2), AttitudeTiming::CONTINUOUS).unwrap();
        let half_turn = 0.25 * (0.4 - 0.05);
        assert!(round.certify(0.999 * half_turn, &PLENTY).is_ok());
        assert!(matches!(round.certify(1.001 * half_turn, &PLENTY), Err(AttitudeRefusal::HalfTurn { .. })));
        // saturation: the same line
        let budget = TorqueBudget { limit_n_m: 0.015, feed_forward_n_m: 0.003 };
        let most = 0.012 * (0.4 - 0.05) / 0.4;
        assert!(round.certify(0.999 * most, &budget).is_ok());
        assert!(matches!(round.certify(1.001 * most, &budget), Err(AttitudeRefusal::Saturation { .. })));
        // terms of second order
        let wide = feedback(HALF_UNSURE, AttitudeTiming::CONTINUOUS).unwrap();
        let Err(AttitudeRefusal::DisturbanceTooLarge { largest_n_m, .. }) = wide.certify(1.0, &PLENTY) else {
            panic!("certified");
        };
        assert!(wide.certify(0.999 * largest_n_m, &PLENTY).is_ok());
        assert!(wide.certify(1.001 * largest_n_m, &PLENTY).is_err());
        let gain = 1.0 + f64::ln(0.243 / 0.0715) / core::f64::consts::E;
        let reserve = 0.4 / gain - 0.375 * 0.243;
        assert!((largest_n_m - reserve * reserve / (8.0 * (0.243 - 0.0715))).abs() < 1e-12);
        // a delay that rings
        let late = AttitudeTiming { delay_s: 0.5, ..SAMPLED };
        assert!(matches!(feedback(HALF_UNSURE, late), Err(AttitudeRefusal::Unstable)));
        // numbers that cannot be
        let unsampled = AttitudeTiming { lag_s: 0.1, ..AttitudeTiming::CONTINUOUS };
        assert!(matches!(feedback(FLOWN, unsampled), Err(AttitudeRefusal::Invalid(_))));
        assert!(matches!(feedback((0.0, 0.2, 0.1, 0.2), SAMPLED), Err(AttitudeRefusal::Invalid(_))));
        assert!(matches!(wide.certify(f64::NAN, &PLENTY), Err(AttitudeRefusal::Invalid(_))));
        let mut spoilt = conditions(AttitudeLaw::Geometric, SAMPLED);
        spoilt.noise.rate_rad_s = f64::NAN;
        assert!(matches!(loop_of(FLOWN, &spoilt), Err(AttitudeRefusal::Invalid(_))));
    }

    #[test]
    fn the_largest_disturbance_is_just_certified() {
        for case in [FLOWN, HALF_UNSURE, CARGO_KNOWN, CARGO] {
            for timing in [AttitudeTiming::CONTINUOUS, SAMPLED, SLOW] {
                for limit_n_m in [0.015, 0.05, 0.5] {
                    let budget = TorqueBudget { limit_n_m, feed_forward_n_m: 0.003 };
                    let noise = AttitudeNoise { angle_rad: 0.004, rate_rad_s: 0.001 };
                    let met = AttitudeConditions { noise, ..conditions(AttitudeLaw::Geometric, timing) };
                    let attitude_loop = loop_of(case, &met).unwrap();
                    let largest = attitude_loop.largest_disturbance_n_m(&budget).unwrap();
                    assert!(attitude_loop.certify(largest, &budget).is_ok(), "{case:?} {timing:?} {largest}");
                    assert!(attitude_loop.certify(largest * (1.0 + 1e-6), &budget).is_err(), "{case:?} {timing:?}");
                }
            }
        }
        let attitude_loop = feedback(FLOWN, SAMPLED).unwrap();
        let spent = TorqueBudget { limit_n_m: 0.015, feed_forward_n_m: 0.015 };
        assert_eq!(attitude_loop.largest_disturbance_n_m(&spent), None);
        let unknown = TorqueBudget { limit_n_m: f64::NAN, feed_forward_n_m: 0.0 };
        assert_eq!(attitude_loop.largest_disturbance_n_m(&unknown), None);
        assert_eq!(attitude_loop.force_allowed_n(&unknown, 0.0, 0.1), 0.0);
    }

    /// The design's force cap, from its fixed point, and ours, which is a little larger.
    #[test]
    fn the_force_allowed_while_the_centre_of_mass_is_unsure() {
        let budget = TorqueBudget { limit_n_m: 0.015, feed_forward_n_m: 0.003 };
        let attitude_loop = feedback(FLOWN, AttitudeTiming::CONTINUOUS).unwrap();
        let largest = attitude_loop.largest_disturbance_n_m(&budget).unwrap();
        assert!((largest - 0.006_48).abs() < 1e-5, "{largest}");
        for (error_m, designed) in [(0.15, 0.038), (0.05, 0.115), (0.01, 0.58)] {
            let force = attitude_loop.force_allowed_n(&budget, 0.0005, error_m);
            assert!((force * error_m - (largest - 0.0005)).abs() < 1e-15);
            assert!(force > designed && force < 1.06 * designed, "{force} {designed}");
        }
        assert_eq!(attitude_loop.force_allowed_n(&budget, 0.1, 0.1), 0.0);
        assert_eq!(attitude_loop.force_allowed_n(&budget, 0.0, 0.0), f64::INFINITY);
        assert_eq!(attitude_loop.force_allowed_n(&budget, 0.0, f64::NAN), 0.0);
    }

    /// Gain, admitted start and the growth between instants by another program for the same sums.
    #[test]
    fn golden_gains_of_late_loops() {
        for (case, delay_s, lag_s, gain, start, between) in [
            (FLOWN, 0.0, 0.0, 1.0536, 1.0, 1.021_81),
            (FLOWN, 0.0, 0.1, 1.0616, 0.8601, 1.021_73),
            (FLOWN, 0.08, 0.1, 1.0702, 0.7283, 1.021_64),
            (HALF_UNSURE, 0.0, 0.0, 1.4745, 1.0, 1.075_11),
            (HALF_UNSURE, 0.0, 0.18, 2.0250, 0.9061, 1.066_86),
            (HALF_UNSURE, 0.08, 0.1, 2.5141, 1.0, 1.062_56),
            (HALF_UNSURE, 0.1, 0.0, 1.7563, 0.8216, 1.070_24),
            (CARGO, 0.0, 0.18, 1.6802, 0.6545, 1.051_05),
        ] {
            let timing = AttitudeTiming { delay_s, lag_s, ..SAMPLED };
            let found = feedback(case, timing).unwrap().certify(1e-4, &PLENTY).unwrap();
            assert!((found.gain - gain).abs() < 2e-4, "{case:?} {timing:?} {found:?}");
            let measured = found.feedback_n_m / case.1;
            assert!((found.combined_rad_s / measured - between).abs() < 2e-5, "{case:?} {timing:?} {found:?}");
            assert!(
                (found.start_rad_s / (measured / found.gain) - start).abs() < 2e-4,
                "{case:?} {timing:?} {found:?}"
            );
        }
    }

    #[test]
    fn worse_conditions_give_no_smaller_bounds() {
        let base = conditions(AttitudeLaw::Geometric, SAMPLED);
        let bound = |case: Case, met: &AttitudeConditions| loop_of(case, met).unwrap().certify(0.001, &PLENTY).unwrap();
        let least = bound(HALF_UNSURE, &base);
        let turning = |rate, acceleration, jerk| AttitudeConditions {
            turning: ReferenceTurning { rate_rad_s: rate, acceleration_rad_s2: acceleration, jerk_rad_s3: jerk },
            ..base
        };
        let noisy =
            |angle_rad, rate_rad_s| AttitudeConditions { noise: AttitudeNoise { angle_rad, rate_rad_s }, ..base };
        let timed =
            |delay_s, lag_s| AttitudeConditions { timing: AttitudeTiming { delay_s, lag_s, ..SAMPLED }, ..base };
        for worse in [
            turning(0.01, 0.0, 0.0),
            turning(0.0, 0.01, 0.0),
            turning(0.0, 0.0, 0.01),
            noisy(0.004, 0.0),
            noisy(0.0, 0.001),
            timed(0.05, 0.0),
            timed(0.0, 0.05),
        ] {
            let found = bound(HALF_UNSURE, &worse);
            assert!(found.vector > least.vector && found.feedback_n_m > least.feedback_n_m, "{worse:?}");
        }
        let (stiffness, damping, small, large) = HALF_UNSURE;
        for narrower in [(stiffness, damping, 1.2 * small, large), (stiffness, damping, small, 0.8 * large)] {
            assert!(bound(narrower, &base).vector < least.vector);
        }
    }
}
