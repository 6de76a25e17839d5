//! The filter at one moment: everything that the stream of measurements, taken in order, has made of it.

use super::body_score::{BodyScore, Elsewhere, ScoreLimits};
use super::erring_thrusters::{Suspect, THRUSTERS};
use super::flight_motion::{
    ACCELERATION_BIAS, ACCELERATION_SCALE, ALL_ROWS, BODY, COORDINATES, Covariance, DRIFT, FlightMotion, FlightState,
    Fresh, ROWS, Shown, THRUST, WANDER, back_into_plane,
};
use super::health::{Groups, Monitor, Thresholds};
use super::reception::Reception;
use super::settings::{FlightEstimatorSettings, WrenchErrors};
use super::wrench_history::WrenchHistory;
use crate::dynamics::LogCholesky;
use crate::error::IdentificationError;
use crate::estimator::{Gauss, Measurement};
use crate::lie::{LieGroup, Pose, Wrench};
use crate::recursive::Innovation;
use crate::recursive::belief::{Correction, Rows};
use nalgebra::{ComplexField, Matrix3, SMatrix, SVector, UnitQuaternion, Vector3, Vector6};

/// Longest step of the filter: 32 ms.
const STEP_NS: i64 = 32_000_000;
/// Two poses seen after a jump are the same within so many standard deviations.
const AGREE: f64 = 6.0;
/// Without agreement the motion begins anew after so many times the patience, and the body is in doubt.
const OUT_OF_PATIENCE: f64 = 2.0;
/// A localisation that moved is not to be learned from for so long.
const SETTLING_NS: i64 = 5_000_000_000;
/// One that keeps moving for longer than this is right, and it is the body that is not what is believed.
const LONGEST_SETTLING_NS: i64 = 10_000_000_000;
/// A localisation that contradicts the motion for longer than this is no jump that comes back: it is the motion that is off.
const LONGEST_JUMP_NS: i64 = 6_000_000_000;
/// By how much more likely, as a logarithm, an accelerometer without errors of scale has to become to be believed: two thousand times.
const SANE_LOG_ODDS: f64 = 7.6;
/// Least error of scale that a sane accelerometer is taken to have.
const LEAST_SCALE: f64 = 1e-6;
/// A sensor without a filter shows what acts about its sample, to either side, ns.
const ABOUT_NS: i64 = 1_000_000;
/// How soon the level of a wander is followed, s, by an innovation of at most so many times its variance, and between which factors.
const HEARING_S: f64 = 5.0;
const LOUDEST_SURPRISE: f64 = 10.0;
const LOUDER: [f64; 2] = [0.05, 400.0];
/// No body is heavier than that of the start by more than this, as a logarithm, nor lighter: a hundred times; none is longer by more than ten times.
const MOST_MASS: f64 = 4.6;
const MOST_EXTENT: f64 = 2.3;
/// Force that a failed thruster may give, and by how much it changes in a second, N; share by which those of its supply, or of a supply that failed, may
/// all give more.
const GIVEN_N: f64 = 0.3;
const UNSTEADY_N: f64 = 0.1;
const SHARED: f64 = 0.1;
/// What is known of the body is remembered every so often, s: longer than it takes to doubt it.
const REMEMBERED_S: f64 = 5.0;
/// Probability that what is blamed on actuators was a grasp or a release after all, and the body what was learned since.
const GRASPED: f64 = 0.1;
/// Standard deviation of the relative error of a thruster that may be dead, or give half as much again.
const FREED: f64 = 0.5;
/// Variance of a log-extent whose square is as large as its standard deviation.
const LARGEST_LOG_EXTENT_VARIANCE: f64 = 0.25;

/// What does not change during a flight.
#[derive(Clone, Debug)]
pub(super) struct Rules {
    pub(super) settings: FlightEstimatorSettings,
    pub(super) model: FlightMotion,
    /// The same with a wrench that is in doubt.
    pub(super) doubting: FlightMotion,
    pub(super) thresholds: Thresholds,
    pub(super) score_limits: ScoreLimits,
    /// The body of the start.
    pub(super) first_body: LogCholesky<f64>,
    pub(super) relocalise_after_ns: i64,
    pub(super) lateness_ns: i64,
    pub(super) lead_ns: i64,
    /// Whether measurements say nothing of body and wrench, which are as uncertain as somebody else knows them.
    pub(super) considers_body: bool,
}

/// Unlikely measurements in a row.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Jump {
    /// Since when anything has been unlikely.
    since_ns: i64,
    /// Since when they agree.
    agreeing_since_ns: i64,
    agreeing: u32,
    /// Whether attitude and position are what is compared.
    of: [bool; 2],
    /// What the map seems to have moved by.
    seen_from_expected: Pose<f64>,
}

/// What was last seen of every quantity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Seen {
    attitude: Option<UnitQuaternion<f64>>,
    position: Option<Vector3<f64>>,
    rate: Option<Vector3<f64>>,
    velocity: Option<Vector3<f64>>,
    acceleration: Option<Vector3<f64>>,
}

/// As what a measurement is learned from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Heard {
    pub(super) fresh: Fresh,
    /// How many samples of rate and acceleration one stands for.
    pub(super) samples: [f64; 2],
    /// By how much the wander was louder than stated.
    pub(super) louder: [f64; 3],
}

impl Heard {
    const NOTHING: Self = Self {
        fresh: Fresh { attitude: false, position: false, rate: false, velocity: false, acceleration: false },
        samples: [1.0; 2],
        louder: [1.0; 3],
    };
}

/// The localisation moved a moment ago, and may again.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Unsettled {
    /// Since its first move.
    since_ns: i64,
    until_ns: i64,
}

/// It began anew because it contradicted what was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Contradicted {
    /// Since when, and when last, less than a settling apart.
    since_ns: i64,
    last_ns: i64,
    /// What was believed of the body by then.
    body: LogCholesky<f64>,
}

/// How often measurements of the ordered stream came to which end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct StreamCounts {
    pub(super) used: u64,
    pub(super) gated: u64,
    pub(super) relocalised: u64,
    pub(super) frozen: u64,
}

/// A doubt of the wrench.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct WrenchDoubt {
    /// Whether the body was known by then, to which it is held.
    body_was_known: bool,
}

/// What was known of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Known {
    body: LogCholesky<f64>,
    covariance: SMatrix<f64, 10, 10>,
}

/// The filter at `stamp_ns`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Filtered {
    pub(super) stamp_ns: i64,
    pub(super) measured_ns: i64,
    pub(super) state: FlightState,
    pub(super) covariance: Covariance,
    /// The body about which all is linear, where that is not the estimated one.
    pub(super) about: Option<LogCholesky<f64>>,
    /// By how much the wander of attitude, position and velocity is louder than stated, as factors of its variance.
    louder: [f64; 3],
    /// Whether the accelerometer is believed; while it is not, nothing but its own errors is learned from it.
    pub(super) accelerometer_is_sane: bool,
    /// When rate and acceleration were last learned from, and how many samples of each came since.
    heard: [(i64, u32); 2],
    pub(super) counts: StreamCounts,
    pub(super) monitor: Monitor,
    score: BodyScore,
    /// Whether the last measurement is to be learned from, and as what.
    pub(super) teaches: bool,
    pub(super) lesson: Heard,
    /// Running means of the squared torque and force that were believed to act.
    exerted: [f64; 2],
    /// Logarithm of how likely all innovations were, each as if it lay at its gate at most.
    pub(super) log_likelihood: f64,
    /// Where actuators are thought not to do what they are told.
    wrench_doubt: Option<WrenchDoubt>,
    /// What is taken to have failed where that is tried.
    pub(super) suspect: Option<Suspect>,
    /// The body as it was known last while nothing gave cause for doubt, and before that; and in how long it is kept again, s.
    remembered: [Known; 2],
    remembered_s: f64,
    jump: Option<Jump>,
    contradicted: Option<Contradicted>,
    unsettled: Option<Unsettled>,
    last: Seen,
}

/// A wrench is judged by its mean square over about so long, s.
const EXERTED_S: f64 = 0.5;
/// It is quiet below so many times what it errs by from step to step.
const QUIET: f64 = 4.0;
/// A body whose mass is known no better than to this share has yet to be learned: it is no other one than before.
const UNKNOWN: f64 = 0.1;

impl Filtered {
    pub(super) fn new(rules: &Rules, state: &FlightState, body: &SMatrix<f64, 10, 10>, start_ns: i64) -> Self {
        let settings = &rules.settings;
        let mut covariance = Covariance::zeros();
        let motion = rules.model.motion_variance(&settings.start_deviation);
        covariance.fixed_view_mut::<BODY, BODY>(0, 0).copy_from(&SMatrix::from_diagonal(&motion));
        covariance.fixed_view_mut::<10, 10>(BODY, BODY).copy_from(body);
        for (i, deviation) in rules.model.slow_deviation().iter().enumerate().skip(DRIFT) {
            covariance[(i, i)] = deviation * deviation;
        }
        let slow = &settings.slow;
        Self {
            stamp_ns: start_ns,
            measured_ns: start_ns,
            state: *state,
            about: None,
            louder: [1.0; 3],
            accelerometer_is_sane: slow.doubted_scale <= slow.acceleration_scale,
            heard: [(i64::MIN, 0); 2],
            covariance,
            counts: StreamCounts::default(),
            monitor: if body[(0, 0)] > UNKNOWN * UNKNOWN { Monitor::of_first_body() } else { Monitor::default() },
            score: BodyScore::new(),
            teaches: false,
            lesson: Heard::NOTHING,
            exerted: [0.0; 2],
            log_likelihood: 0.0,
            wrench_doubt: None,
            suspect: None,
            remembered: [Known { body: state.joint.body, covariance: *body }; 2],
            remembered_s: f64::NEG_INFINITY,
            jump: None,
            contradicted: None,
            unsettled: None,
            last: Seen::default(),
        }
    }

    /// The model that is filtered with.
    fn model<'a>(&self, rules: &'a Rules) -> &'a FlightMotion {
        if self.wrench_doubt.is_some() { &rules.doubting } else { &rules.model }
    }

    /// Carries state and covariance on to a time.
    pub(super) fn advance(&mut self, rules: &Rules, history: &WrenchHistory, until_ns: i64) {
        for (from_ns, to_ns) in steps(self.stamp_ns, until_ns) {
            let (believed, step_s) = (history.mean(from_ns, to_ns), (to_ns - from_ns) as f64 * 1e-9);
            // What is not finite never gets here; where a step fails all the same, the motion stays.
            let (model, louder, about) = (self.model(rules), self.louder, self.about);
            let _ = model.predict(&mut self.state, &mut self.covariance, &believed, step_s, about.as_ref(), &louder);
            self.less_certain_of_suspect(rules, UNSTEADY_N * UNSTEADY_N * step_s);
            let share = (step_s / EXERTED_S).min(1.0);
            let Wrench { torque, force } = &believed.wrench;
            for (mean, square) in self.exerted.iter_mut().zip([torque.norm_squared(), force.norm_squared()]) {
                *mean += share * (square - *mean);
            }
        }
        self.stamp_ns = self.stamp_ns.max(until_ns);
    }

    /// The state alone, carried on to a time.
    pub(super) fn state_at(&self, rules: &Rules, history: &WrenchHistory, until_ns: i64) -> FlightState {
        let mut state = self.state;
        for (from_ns, to_ns) in steps(self.stamp_ns, until_ns) {
            let (believed, step_s) = (history.mean(from_ns, to_ns), (to_ns - from_ns) as f64 * 1e-9);
            state = self.model(rules).propagate(&state, &believed, step_s).unwrap_or(state);
        }
        state
    }

    /// Takes a measurement of the present moment.
    pub(super) fn take(&mut self, rules: &Rules, history: &WrenchHistory, measurement: &Measurement) -> Reception {
        // Rows that nobody measured cost time.
        if measurement.other.is_some() {
            self.take_rows::<ALL_ROWS>(rules, history, measurement)
        } else {
            self.take_rows::<ROWS>(rules, history, measurement)
        }
    }

    fn take_rows<const R: usize>(
        &mut self,
        rules: &Rules,
        history: &WrenchHistory,
        measurement: &Measurement,
    ) -> Reception {
        let fresh = self.news(measurement);
        let dt_s = (measurement.stamp_ns - self.measured_ns) as f64 * 1e-9;
        self.measured_ns = measurement.stamp_ns;
        self.remember(measurement);
        self.teaches = false;
        let localised = [fresh.attitude, fresh.position];
        let of_motion = fresh.attitude || fresh.position || fresh.rate || fresh.velocity || fresh.acceleration;
        if !(of_motion || measurement.other.is_some()) {
            self.counts.frozen += 1;
            return Reception::Frozen;
        }
        let (fresh, shown) = self.rested(rules, history, measurement.stamp_ns, fresh);
        let main = Fresh { acceleration: fresh.acceleration && self.accelerometer_is_sane, ..fresh };
        if !(main.attitude || main.position || main.rate || main.velocity || main.acceleration)
            && measurement.other.is_none()
        {
            self.counts.used += 1;
            return Reception::Used { nis: 0.0 };
        }
        let mut rows = self.model(rules).rows::<R>(&self.state, measurement, main, &shown);
        let mut learned = self.covariance;
        let Ok(Correction { mut step, innovation }) = rows.correct(&mut learned) else {
            return Reception::Malformed { what: "innovation is not finite" };
        };
        let groups = Groups::of(&innovation, rules.settings.slow.wanders());
        let [inertial_fits, map_fits] =
            [groups.inertial, groups.localised].map(|group| rules.thresholds.lets_pass(group));
        if inertial_fits {
            self.hear_wander(rules, &innovation, dt_s);
        }
        let nis = innovation.nis;
        let fits = rules.thresholds.lets_pass((nis, innovation.degrees_of_freedom));
        let beyond = (nis - rules.thresholds.gate(innovation.degrees_of_freedom)).max(0.0);
        self.log_likelihood += innovation.log_likelihood() + 0.5 * beyond;
        let is_settled = self.unsettled.is_none_or(|unsettled| measurement.stamp_ns >= unsettled.until_ns);
        if is_settled {
            self.monitor.observe(&rules.thresholds, &innovation, &groups, dt_s);
        }
        let is_part = inertial_fits != map_fits && groups.inertial.1 > 0 && groups.localised.1 > 0;
        if is_part {
            // What inertial sensors say of the body and what a localisation says of its map do not stand or fall together.
            Groups::leave(&mut rows, inertial_fits);
            learned = self.covariance;
            let Ok(correction) = rows.correct(&mut learned) else { return Reception::Gated { nis } };
            step = correction.step;
        }
        if fits || is_part {
            match (is_settled, rules.considers_body) {
                (true, false) if self.is_quiet(rules) || self.is_held() => {
                    self.correct_all_but::<{ DRIFT - BODY }>(rules, &step, &learned);
                }
                (true, false) => self.learn(rules, &step, &learned),
                (true, true) => self.correct_all_but::<{ WANDER - BODY }>(rules, &step, &learned),
                // Of a map that moves nothing but the motion is learned.
                (false, _) => self.correct_all_but::<{ COORDINATES - BODY }>(rules, &step, &learned),
            }
        }
        self.judge_body(rules, dt_s, is_settled);
        if fits || is_part && map_fits {
            self.jump = None;
        }
        if fits {
            self.teaches = is_settled;
            self.lesson = Heard { fresh: main, samples: shown.samples, louder: self.louder };
            self.counts.used += 1;
            if fresh.acceleration && !self.accelerometer_is_sane {
                self.judge_accelerometer(rules, measurement, &shown);
            }
            return Reception::Used { nis };
        }
        if is_part && map_fits {
            self.counts.gated += 1;
            return Reception::Gated { nis };
        }
        self.counts.gated += 1;
        if self.begins_anew(rules, measurement, localised) {
            self.counts.relocalised += 1;
            return Reception::Relocalised;
        }
        Reception::Gated { nis }
    }

    /// Whether next to nothing acts but what a robot that holds its place answers to the noise of its own sensors. Such a wrench goes with
    /// that noise, so that a body which does not obey it seems to be a larger one: nothing is learned of it.
    fn is_quiet(&self, rules: &Rules) -> bool {
        let noise = &rules.settings.noise;
        let limits = [noise.torque_n_m, noise.force_n].map(|sigma| QUIET * sigma);
        self.exerted.iter().zip(limits).all(|(mean, limit)| *mean < limit * limit)
    }

    /// Whether the body is held to what was known of it before the wrench was in doubt: a motion does not tell a body from thrusters of which nothing is
    /// known. One of which next to nothing is known, either, is learned all the same, to be flown with.
    fn is_held(&self) -> bool {
        let is_known = self.covariance[(BODY, BODY)] <= UNKNOWN * UNKNOWN;
        self.wrench_doubt.is_some_and(|doubt| doubt.body_was_known || is_known)
    }

    /// Whether the body is one that can be, and whether what was learned of it still holds: where it seems to lie elsewhere it is less certain.
    /// What was seen while there was something left to learn again, or before and while a map moved, does not count, nor what is seen from when
    /// the wrench is in doubt.
    fn judge_body(&mut self, rules: &Rules, dt_s: f64, is_settled: bool) {
        let (now, first) = (&self.state.joint.body, &rules.first_body);
        let (longer, heavier) = ((now.log_extents - first.log_extents).max(), (now.log_mass - first.log_mass).abs());
        if longer > MOST_EXTENT || heavier > MOST_MASS {
            self.monitor.diverge();
        }
        if !is_settled || self.wrench_doubt.is_some() || !self.monitor.has_learned_the_body() {
            self.score = BodyScore::new();
            return;
        }
        self.remember_body(dt_s);
        if self.score.is_due(dt_s) {
            let mut body = self.covariance.fixed_view_mut::<10, 10>(BODY, BODY);
            if let Some(Elsewhere { more, is_another }) = self.score.judge(&rules.score_limits, &body.clone_owned()) {
                body += more;
                if is_another {
                    self.monitor.accuse_the_body();
                }
            }
        }
    }

    /// Keeps what is known of the body, for when it turns out that the wrench is not what it was: of the last two times the earlier one is older than
    /// the cause of that.
    fn remember_body(&mut self, dt_s: f64) {
        self.remembered_s -= dt_s;
        if self.remembered_s > 0.0 {
            return;
        }
        let covariance = self.covariance.fixed_view::<10, 10>(BODY, BODY).into_owned();
        let known = Known { body: self.state.joint.body, covariance };
        let is_first = self.remembered_s == f64::NEG_INFINITY;
        self.remembered = [known, if is_first { known } else { self.remembered[0] }];
        self.remembered_s = REMEMBERED_S;
    }

    /// Corrects everything, the body included.
    fn learn(&mut self, rules: &Rules, step: &SVector<f64, COORDINATES>, covariance: &Covariance) {
        let body = |covariance: &Covariance| covariance.fixed_view::<10, 10>(BODY, BODY).into_owned();
        self.score.count(&step.fixed_rows::<10>(BODY).into_owned(), &body(&self.covariance), &body(covariance));
        self.correct(rules, step, covariance);
    }

    fn correct(&mut self, rules: &Rules, step: &SVector<f64, COORDINATES>, covariance: &Covariance) {
        let before = self.state.joint.motion;
        self.state = self.state.moved_by(step);
        if rules.settings.planar {
            self.state.joint.motion = back_into_plane(&self.state.joint.motion, &before);
        }
        self.covariance = *covariance;
    }

    /// What of rate and acceleration is to be learned from, and what filtered sensors show of the wrench at this sample.
    fn rested(&mut self, rules: &Rules, history: &WrenchHistory, stamp_ns: i64, fresh: Fresh) -> (Fresh, Shown) {
        let slow = rules.model.slow();
        let mut samples = [1.0; 2];
        let memories = [(fresh.rate, &slow.rate_memory), (fresh.acceleration, &slow.acceleration_memory)];
        let due: [bool; 2] = core::array::from_fn(|k| {
            let ((is_fresh, memory), (before_ns, came)) = (memories[k], &mut self.heard[k]);
            *came = came.saturating_add(u32::from(is_fresh));
            let is_due = is_fresh && memory.as_ref().is_none_or(|memory| memory.is_rested(*before_ns, stamp_ns));
            if is_due {
                samples[k] = f64::from(*came);
                (*before_ns, *came) = (stamp_ns, 0);
            }
            is_due
        });
        let owed = slow.rate_memory.filter(|_| due[0]);
        let acceleration = due[1].then(|| match &slow.acceleration_memory {
            Some(memory) => memory.held(history, stamp_ns),
            None => history.mean(stamp_ns.saturating_sub(ABOUT_NS), stamp_ns.saturating_add(ABOUT_NS)),
        });
        let owed = owed.map(|memory| (memory.held(history, stamp_ns), memory.length_s()));
        (
            Fresh { rate: due[0], acceleration: due[1], ..fresh },
            Shown { owed, acceleration, samples, about: self.about },
        )
    }

    /// Follows the level of each stream's wander: innovations that are larger than stated make it louder, smaller ones quieter. A level that
    /// is gated away instead leaves a body that is too certain.
    fn hear_wander<const R: usize>(&mut self, rules: &Rules, innovation: &Innovation<R>, dt_s: f64) {
        for (k, (louder, error)) in self.louder.iter_mut().zip(rules.settings.slow.wander()).enumerate() {
            let first = [0, 3, 9][k];
            let covariance = innovation.covariance.fixed_view::<3, 3>(first, first).into_owned();
            let seen: Vector3<f64> = innovation.residual.fixed_rows::<3>(first).into_owned();
            let (mut nis, mut freedom) = (0.0, 0.0);
            for i in 0..3 {
                if covariance[(i, i)].is_finite() {
                    nis += seen[i] * seen[i] / covariance[(i, i)];
                    freedom += 1.0;
                }
            }
            if error.sigma > 0.0 && freedom > 0.0 {
                let surprise = nis.min(LOUDEST_SURPRISE * freedom) / freedom - 1.0;
                let factor = 1.0 + surprise * dt_s.clamp(0.0, HEARING_S) / HEARING_S;
                *louder = (*louder * factor).clamp(LOUDER[0], LOUDER[1]);
            }
        }
    }

    /// Learns the errors of a doubted accelerometer, and believes it to be as good as stated once what was seen says so: by how much more
    /// likely no error of scale has become (Savage and Dickey's ratio). One that is not as good stays doubted.
    fn judge_accelerometer(&mut self, rules: &Rules, measurement: &Measurement, shown: &Shown) {
        let alone = Fresh { attitude: false, position: false, rate: false, velocity: false, acceleration: true };
        let rows = self.model(rules).rows::<ROWS>(&self.state, measurement, alone, shown);
        let mut learned = self.covariance;
        let Ok(Correction { mut step, innovation }) = rows.correct(&mut learned) else { return };
        if innovation.nis > rules.thresholds.gate(innovation.degrees_of_freedom) {
            return;
        }
        // All but its own errors stays as certain as it is (Schmidt's filter).
        step.fixed_rows_mut::<ACCELERATION_BIAS>(0).fill(0.0);
        let before = self.covariance.fixed_view::<ACCELERATION_BIAS, ACCELERATION_BIAS>(0, 0);
        learned.fixed_view_mut::<ACCELERATION_BIAS, ACCELERATION_BIAS>(0, 0).copy_from(&before);
        self.correct(rules, &step, &learned);
        let slow = rules.model.slow();
        let found = self.covariance.fixed_view::<3, 3>(ACCELERATION_SCALE, ACCELERATION_SCALE).into_owned();
        let Some(root) = (found / (slow.doubted_scale * slow.doubted_scale)).cholesky() else { return };
        let scale = self.state.acceleration_scale / slow.doubted_scale;
        let surprise = root.solve(&scale).dot(&scale);
        if -ComplexField::ln(root.l_dirty().diagonal().product()) - 0.5 * surprise < SANE_LOG_ODDS {
            return;
        }
        self.believe_accelerometer(rules);
    }

    /// The accelerometer is as good as stated.
    pub(super) fn believe_accelerometer(&mut self, rules: &Rules) {
        if self.accelerometer_is_sane {
            return;
        }
        self.accelerometer_is_sane = true;
        let slow = rules.model.slow();
        let mut rows = Rows::<COORDINATES, 3> {
            sensitivity: SMatrix::zeros(),
            residual: -self.state.acceleration_scale,
            standard_deviation: Vector3::repeat(slow.acceleration_scale.max(LEAST_SCALE)),
        };
        for i in 0..3 {
            rows.sensitivity[(i, ACCELERATION_SCALE + i)] = 1.0;
        }
        let mut learned = self.covariance;
        if let Ok(Correction { step, .. }) = rows.correct(&mut learned) {
            self.correct(rules, &step, &learned);
        }
    }

    /// By the same gain, but the first `CONSIDERED` coordinates from the body on stay what they are, as certain as they are (Schmidt's
    /// filter).
    fn correct_all_but<const CONSIDERED: usize>(
        &mut self,
        rules: &Rules,
        step: &SVector<f64, COORDINATES>,
        covariance: &Covariance,
    ) {
        let (mut step, mut covariance) = (*step, *covariance);
        step.fixed_rows_mut::<CONSIDERED>(BODY).fill(0.0);
        let before = self.covariance.fixed_view::<CONSIDERED, CONSIDERED>(BODY, BODY);
        covariance.fixed_view_mut::<CONSIDERED, CONSIDERED>(BODY, BODY).copy_from(&before);
        self.correct(rules, &step, &covariance);
    }

    /// The channels that do not repeat what was last seen to the bit. A pose is one channel.
    fn news(&self, measurement: &Measurement) -> Fresh {
        let attitude = measurement.attitude.map(|seen| seen.value);
        let position = measurement.position_world.map(|seen| seen.value);
        let moved = [
            attitude.is_some() && attitude != self.last.attitude,
            position.is_some() && position != self.last.position,
        ];
        let pose_moved = moved[0] || moved[1];
        let is_new = |seen: Option<Gauss<Vector3<f64>>>, last: Option<Vector3<f64>>| {
            seen.is_some_and(|seen| last != Some(seen.value))
        };
        Fresh {
            attitude: attitude.is_some() && pose_moved,
            position: position.is_some() && pose_moved,
            rate: is_new(measurement.rate_body, self.last.rate),
            velocity: is_new(measurement.velocity_world, self.last.velocity),
            acceleration: is_new(measurement.acceleration_body, self.last.acceleration),
        }
    }

    fn remember(&mut self, measurement: &Measurement) {
        let last = self.last;
        self.last = Seen {
            attitude: measurement.attitude.map(|seen| seen.value).or(last.attitude),
            position: measurement.position_world.map(|seen| seen.value).or(last.position),
            rate: measurement.rate_body.map(|seen| seen.value).or(last.rate),
            velocity: measurement.velocity_world.map(|seen| seen.value).or(last.velocity),
            acceleration: measurement.acceleration_body.map(|seen| seen.value).or(last.acceleration),
        };
    }

    /// Counts an unlikely measurement; true where there were enough of them and motion begins anew at this one. `localised`: whether
    /// attitude and position were seen.
    fn begins_anew(&mut self, rules: &Rules, measurement: &Measurement, localised: [bool; 2]) -> bool {
        let (now_ns, expected) = (measurement.stamp_ns, self.state.joint.motion.world_from_body);
        let settings = &rules.settings;
        let mut seen = expected;
        let mut deviations = [0.0; 2];
        if let Some(attitude) = &measurement.attitude {
            (seen.rotation, deviations[0]) = (attitude.value, largest_deviation(attitude));
        }
        if let Some(position) = &measurement.position_world {
            (seen.translation, deviations[1]) = (position.value.into(), largest_deviation(position));
        }
        let has_pose = localised.contains(&true);
        let seen_from_expected = seen.compose(&expected.inverse());
        let fresh =
            Jump { since_ns: now_ns, agreeing_since_ns: now_ns, agreeing: 1, of: localised, seen_from_expected };
        let jump = match self.jump {
            None => fresh,
            // A pose that repeats the last one to the bit agrees with nothing, nor does a place with an attitude.
            Some(jump) if !has_pose || (jump.of != localised && jump.of.contains(&true)) => jump,
            Some(jump) => {
                let apart = LieGroup::log(&jump.seen_from_expected.compose(&expected).between(&seen));
                let within = |k: usize| {
                    !localised[k]
                        || apart.fixed_rows::<3>(3 * k).amax() <= AGREE * core::f64::consts::SQRT_2 * deviations[k]
                };
                if jump.of == localised && within(0) && within(1) {
                    Jump { agreeing: jump.agreeing.saturating_add(1), ..jump }
                } else {
                    Jump { since_ns: jump.since_ns, ..fresh }
                }
            }
        };
        self.jump = Some(jump);
        let agreed =
            now_ns - jump.agreeing_since_ns >= rules.relocalise_after_ns && jump.agreeing >= settings.relocalise_count;
        let waited = (now_ns - jump.since_ns) as f64 >= OUT_OF_PATIENCE * rules.relocalise_after_ns as f64;
        // Where nothing but rates was unlikely there is nothing else to begin at.
        let has_begin = has_pose
            || measurement.attitude.is_none()
                && measurement.position_world.is_none()
                && !jump.of.contains(&true)
                && (measurement.rate_body.is_some() || measurement.velocity_world.is_some());
        let agreed = agreed && has_pose;
        if !(agreed || waited) || !has_begin {
            return false;
        }
        let is_the_body = self.keeps_moving(agreed, now_ns);
        self.monitor = self.monitor.doubting(is_the_body);
        self.jump = None;
        self.begin_at(rules, measurement);
        true
    }

    /// Takes note of a localisation that moved; whether it is rather the body that moves otherwise than believed. What moved by
    /// as much at every moment is a map; after it the estimate may glide back, by something else at every moment.
    fn keeps_moving(&mut self, agreed: bool, now_ns: i64) -> bool {
        let before = self.unsettled.filter(|before| now_ns < before.until_ns);
        let since_ns = before.map_or(now_ns, |before| before.since_ns);
        let is_the_body = before.is_none() && !agreed || now_ns - since_ns > LONGEST_SETTLING_NS;
        let until_ns = now_ns.saturating_add(SETTLING_NS);
        self.unsettled = (!is_the_body).then_some(Unsettled { since_ns, until_ns });
        is_the_body
    }

    /// Motion from a measurement, without memory; the body as it is.
    fn begin_at(&mut self, rules: &Rules, measurement: &Measurement) {
        let before = self.covariance.fixed_view::<BODY, BODY>(0, 0).into_owned();
        let (motion, known) =
            rules.model.begun_at(&self.state.joint.motion, &before, measurement, &rules.settings.start_deviation);
        self.state.joint.motion = motion;
        self.covariance.fixed_view_mut::<BODY, COORDINATES>(0, 0).fill(0.0);
        self.covariance.fixed_view_mut::<COORDINATES, BODY>(0, 0).fill(0.0);
        self.covariance.fixed_view_mut::<BODY, BODY>(0, 0).copy_from(&known);
        self.begin_wander(rules);
    }

    /// Of a motion that was just taken from a measurement: that is off by a wander of which no more is known than how large it is.
    fn begin_wander(&mut self, rules: &Rules) {
        self.state.wander = [Vector3::zeros(); 3];
        self.covariance.fixed_view_mut::<9, COORDINATES>(WANDER, 0).fill(0.0);
        self.covariance.fixed_view_mut::<COORDINATES, 9>(0, WANDER).fill(0.0);
        let body_from_world = self.state.joint.motion.world_from_body.rotation.inverse().to_rotation_matrix();
        let turns = [Matrix3::identity(), body_from_world.into_inner(), body_from_world.into_inner()];
        for (k, (error, turn)) in rules.settings.slow.wander().iter().zip(turns).enumerate() {
            let (motion, wander, variance) = ([0, 3, 9][k], WANDER + 3 * k, error.sigma * error.sigma);
            let shared = turn * -variance;
            for i in 0..3 {
                self.covariance[(wander + i, wander + i)] = variance;
                if !(rules.settings.planar && self.covariance[(motion + i, motion + i)] == 0.0) {
                    self.covariance[(motion + i, motion + i)] += variance;
                    for j in 0..3 {
                        self.covariance[(motion + i, wander + j)] = shared[(i, j)];
                        self.covariance[(wander + j, motion + i)] = shared[(i, j)];
                    }
                }
            }
        }
    }

    /// The body less certain by a jump of these deviations, and the wrench as if it were in doubt: which of the two it was, the
    /// measurements tell. So is the motion: until it was noticed it was that of another body.
    pub(super) fn widen(&mut self, rules: &Rules, deviation: &SVector<f64, 10>) {
        self.widen_motion(rules);
        for i in 0..10 {
            self.covariance[(BODY + i, BODY + i)] += deviation[i] * deviation[i];
        }
        self.widen_drift(&rules.settings.wrench.doubted());
        self.widen_errors_of_sensors(rules);
        self.about = None;
        self.monitor = Monitor::of_new_body();
        self.unsettled = None;
    }

    /// A wrench that is in doubt from now on, and the body as it was known before anything was: what was learned since was learned from other forces,
    /// but for the chance that it is another body after all.
    pub(super) fn doubt_wrench(&mut self, rules: &Rules) {
        self.widen_motion(rules);
        let [_, Known { body, covariance }] = self.remembered;
        let just_left = self.contradicted.filter(|contradicted| contradicted.last_ns == self.stamp_ns);
        let other = just_left.map_or(self.state.joint.body, |left| left.body);
        let elsewhere = other.to_vector() - body.to_vector();
        self.wrench_doubt = Some(WrenchDoubt { body_was_known: covariance[(0, 0)] <= UNKNOWN * UNKNOWN });
        self.revise(&body, &(covariance + elsewhere * elsewhere.transpose() * GRASPED));
        self.free_thrusters(rules);
        self.widen_drift(&rules.settings.wrench.doubted());
        self.widen_errors_of_sensors(rules);
        self.monitor = Monitor::of_learning();
    }

    /// The same from the body that was known before a doubt, which may be of what is suspected: a thruster then gives what it gives, whatever it is told,
    /// and those of its supply more or less for that; of a supply all give more or less.
    pub(super) fn suspecting(&self, rules: &Rules, suspect: Option<Suspect>) -> Self {
        let mut suspecting = *self;
        suspecting.widen_motion(rules);
        let [_, Known { body, covariance }] = self.remembered;
        suspecting.revise(&body, &covariance);
        suspecting.widen_errors_of_sensors(rules);
        suspecting.monitor = Monitor::of_learning();
        (suspecting.wrench_doubt, suspecting.suspect, suspecting.log_likelihood) = (None, suspect, 0.0);
        let Some(suspect) = suspect else { return suspecting };
        let thrusters = &rules.settings.wrench.thrusters;
        let supply = suspect.supply(thrusters);
        let those = |k: &usize| thrusters[*k].supply == supply && thrusters[*k].relative > 0.0;
        for (i, j) in (0..THRUSTERS).filter(those).flat_map(|i| (0..THRUSTERS).filter(those).map(move |j| (i, j))) {
            suspecting.covariance[(THRUST + i, THRUST + j)] += SHARED * SHARED;
        }
        if let Suspect::Thruster(thruster) = suspect {
            let k = THRUST + thruster;
            suspecting.state.thrust[thruster] = -1.0;
            suspecting.covariance.fixed_rows_mut::<1>(k).fill(0.0);
            suspecting.covariance.fixed_columns_mut::<1>(k).fill(0.0);
            suspecting.less_certain_of_suspect(rules, GIVEN_N * GIVEN_N);
        }
        suspecting
    }

    /// Less certain of what a suspected thruster gives by this variance, N^2.
    fn less_certain_of_suspect(&mut self, rules: &Rules, variance: f64) {
        if let Some(Suspect::Thruster(thruster)) = self.suspect {
            let push = rules.settings.wrench.thrusters[thruster].push_body.to_vector();
            let mut drift = self.covariance.fixed_view_mut::<6, 6>(DRIFT, DRIFT);
            drift += push * push.transpose() * variance;
        }
    }

    /// What doubted actuators are to be asked for.
    pub(super) fn compensated(&self, rules: &Rules, wanted: &Wrench<f64>) -> Option<Wrench<f64>> {
        self.wrench_doubt.map(|_| self.model(rules).asked(&self.state, wanted))
    }

    /// The body as somebody else knows it; what the motion owes to the body before is forgotten.
    pub(super) fn revise(&mut self, body: &LogCholesky<f64>, covariance: &SMatrix<f64, 10, 10>) {
        (self.state.joint.body, self.about) = (*body, None);
        self.covariance.fixed_view_mut::<10, COORDINATES>(BODY, 0).fill(0.0);
        self.covariance.fixed_view_mut::<COORDINATES, 10>(0, BODY).fill(0.0);
        self.covariance.fixed_view_mut::<10, 10>(BODY, BODY).copy_from(covariance);
    }

    fn widen_motion(&mut self, rules: &Rules) {
        let motion = rules.model.motion_variance(&rules.settings.start_deviation);
        for (i, variance) in motion.iter().enumerate() {
            self.covariance[(i, i)] += variance;
        }
    }

    /// The sensors' errors took blame for what was wrong.
    fn widen_errors_of_sensors(&mut self, rules: &Rules) {
        for (i, deviation) in rules.model.slow_deviation().iter().enumerate().take(ACCELERATION_SCALE).skip(WANDER) {
            self.covariance[(i, i)] += deviation * deviation;
        }
        self.louder = [1.0; 3];
    }

    /// Nothing more is known of thrusters than that each is there.
    fn free_thrusters(&mut self, rules: &Rules) {
        self.state.thrust = SVector::zeros();
        self.covariance.fixed_view_mut::<THRUSTERS, COORDINATES>(THRUST, 0).fill(0.0);
        self.covariance.fixed_view_mut::<COORDINATES, THRUSTERS>(0, THRUST).fill(0.0);
        for (k, thruster) in rules.settings.wrench.thrusters.iter().enumerate() {
            let deviation = if thruster.relative > 0.0 { FREED } else { 0.0 };
            self.covariance[(THRUST + k, THRUST + k)] = deviation * deviation;
        }
    }

    fn widen_drift(&mut self, doubted: &WrenchErrors) {
        for i in 0..6 {
            self.covariance[(DRIFT + i, DRIFT + i)] += doubted.drift[i] * doubted.drift[i];
        }
    }

    /// Another body with its covariance, and the wrench's errors as at the start; the motion as it is, against a localisation that jumped and may come
    /// back, and the wander as loud as stated, so that it explains no jump. A motion that has been contradicted for longer than that is less certain,
    /// and so is one where the wrench is in doubt, which it stays: it was that of other forces.
    pub(super) fn restart(&mut self, rules: &Rules, body: &LogCholesky<f64>, covariance: &SMatrix<f64, 10, 10>) {
        let left = self.state.joint.body;
        (self.state.joint.body, self.about) = (*body, None);
        self.wrench_doubt = self.wrench_doubt.map(|_| WrenchDoubt { body_was_known: false });
        (self.state.drift, self.state.thrust) = (Vector6::zeros(), SVector::zeros());
        let mut fresh = Self::new(rules, &self.state, covariance, self.stamp_ns).covariance;
        // Motion and errors of the sensors stay, and what they have in common.
        let kept = |i: usize| !(BODY..WANDER).contains(&i);
        for (i, j) in (0..COORDINATES).flat_map(|i| (0..COORDINATES).map(move |j| (i, j))) {
            if kept(i) && kept(j) {
                fresh[(i, j)] = self.covariance[(i, j)];
            }
        }
        self.covariance = fresh;
        self.louder = [1.0; 3];
        let again = self.contradicted.filter(|before| self.stamp_ns - before.last_ns < SETTLING_NS);
        let since_ns = again.map_or(self.stamp_ns, |before| before.since_ns);
        self.contradicted = Some(Contradicted { since_ns, last_ns: self.stamp_ns, body: left });
        let is_lost = self.stamp_ns - since_ns > LONGEST_JUMP_NS;
        if self.wrench_doubt.is_some() || is_lost {
            self.widen_motion(rules);
        }
        if self.wrench_doubt.is_some() {
            self.free_thrusters(rules);
            self.widen_drift(&rules.settings.wrench.doubted());
        } else {
            self.jump = None;
        }
        self.monitor = Monitor::of_learning();
    }
}

/// Equal steps from one time to another, none longer than [`STEP_NS`].
pub(super) fn steps(from_ns: i64, until_ns: i64) -> impl Iterator<Item = (i64, i64)> {
    let span = until_ns.saturating_sub(from_ns).max(0);
    let count = span / STEP_NS + i64::from(span % STEP_NS > 0);
    // The product of a span below 2^63 / count and a number of steps; long spans only lose nanoseconds.
    let at = move |i: i64| from_ns + i128_part(span, i, count);
    (0..count).map(move |i| (at(i), at(i + 1)))
}

/// span · i / count, exactly.
fn i128_part(span: i64, i: i64, count: i64) -> i64 {
    i64::try_from(i128::from(span) * i128::from(i) / i128::from(count.max(1))).unwrap_or(span)
}

/// The largest standard deviation of an axis that was measured.
fn largest_deviation<V>(seen: &Gauss<V>) -> f64 {
    let variances = seen.covariance.diagonal();
    ComplexField::sqrt(variances.iter().filter(|variance| variance.is_finite()).fold(0.0, |a, b| f64::max(a, *b)))
}

/// What a prior is in the chart of the filter.
///
/// The chart is linear about a body only where that is far from the edge of what can be, in terms of what is known of it. A squared
/// extent that is less than its standard deviation is taken for that: a prior whose mean is all but impossible is no certain one.
pub(super) fn in_chart(
    prior: &crate::Estimate,
) -> Result<(LogCholesky<f64>, SMatrix<f64, 10, 10>), IdentificationError> {
    let mut body = LogCholesky::try_from_parameters(&prior.parameters)?;
    let mut covariance = chart_covariance(&body, &prior.covariance)?;
    let mut moved = false;
    for (i, log_extent) in body.log_extents.iter_mut().enumerate() {
        let variance = covariance[(4 + i, 4 + i)];
        if variance > LARGEST_LOG_EXTENT_VARIANCE {
            // the square's relative deviation is twice that of the extent
            *log_extent += 0.5 * ComplexField::ln(ComplexField::sqrt(variance / LARGEST_LOG_EXTENT_VARIANCE));
            moved = true;
        }
    }
    if moved {
        covariance = chart_covariance(&body, &prior.covariance)?;
    }
    for (index, variance) in covariance.diagonal().iter().enumerate() {
        if !(*variance >= 0.0 && variance.is_finite()) {
            return Err(IdentificationError::NotPositive { index, value: *variance });
        }
    }
    Ok((body, covariance))
}

fn chart_covariance(
    body: &LogCholesky<f64>,
    covariance: &SMatrix<f64, 10, 10>,
) -> Result<SMatrix<f64, 10, 10>, IdentificationError> {
    let slopes = crate::recursive::joint_motion::parameters_by_chart(body);
    let Some(inverse) = slopes.try_inverse() else { return Err(IdentificationError::NotFinite { row: 0 }) };
    Ok(crate::recursive::belief::symmetric(&(inverse * covariance * inverse.transpose())))
}
