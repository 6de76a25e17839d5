//! The filter at one moment: everything that the stream of measurements, taken in order, has made of it.

use super::body_score::{BodyScore, Elsewhere, ScoreLimits};
use super::erring_thrusters::Suspect;
use super::flight_motion::{
    ACCELERATION_BIAS, ACCELERATION_SCALE, ALL_ROWS, BODY, COORDINATES, Covariance, DRIFT, FlightMotion, FlightState,
    Fresh, ROWS, Shown, WANDER, back_into_plane,
};
use super::health::{Groups, Monitor, Thresholds};
use super::reception::Reception;
use super::settings::FlightEstimatorSettings;
use super::wrench_history::WrenchHistory;
use crate::dynamics::LogCholesky;
use crate::error::IdentificationError;
use crate::estimator::{Gauss, Measurement};
use crate::lie::{Pose, Wrench};
use crate::recursive::Innovation;
use crate::recursive::belief::{Correction, Rows};
use nalgebra::{ComplexField, SMatrix, SVector, UnitQuaternion, Vector3};

/// Longest step of the filter: 32 ms.
const STEP_NS: i64 = 32_000_000;
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
/// What is known of the body is remembered every so often, s: longer than it takes to doubt it.
const REMEMBERED_S: f64 = 5.0;
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

/// A doubt of the wrench.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct WrenchDoubt {
    /// Whether the body was known by then, to which it is held.
    pub(super) body_was_known: bool,
}

/// What was known of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Known {
    pub(super) body: LogCholesky<f64>,
    pub(super) covariance: SMatrix<f64, 10, 10>,
}

/// It began anew because it contradicted what was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Contradicted {
    /// Since when, and when last, less than a settling apart.
    pub(super) since_ns: i64,
    pub(super) last_ns: i64,
    /// What was believed of the body by then.
    pub(super) body: LogCholesky<f64>,
}

/// Unlikely measurements in a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Jump {
    /// Since when anything has been unlikely.
    pub(super) since_ns: i64,
    /// Since when they agree.
    pub(super) agreeing_since_ns: i64,
    pub(super) agreeing: u32,
    /// Whether attitude and position are what is compared.
    pub(super) of: [bool; 2],
    /// What the map seems to have moved by.
    pub(super) seen_from_expected: Pose<f64>,
}

/// The localisation moved a moment ago, and may again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unsettled {
    /// Since its first move.
    pub(super) since_ns: i64,
    pub(super) until_ns: i64,
}

/// How often measurements of the ordered stream came to which end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct StreamCounts {
    pub(super) used: u64,
    pub(super) gated: u64,
    pub(super) relocalised: u64,
    pub(super) frozen: u64,
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
    pub(super) louder: [f64; 3],
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
    pub(super) wrench_doubt: Option<WrenchDoubt>,
    /// What is taken to have failed where that is tried.
    pub(super) suspect: Option<Suspect>,
    /// The body as it was known last while nothing gave cause for doubt, and before that; and in how long it is kept again, s.
    pub(super) remembered: [Known; 2],
    pub(super) remembered_s: f64,
    pub(super) jump: Option<Jump>,
    pub(super) contradicted: Option<Contradicted>,
    pub(super) unsettled: Option<Unsettled>,
    last: Seen,
}

/// A wrench is judged by its mean square over about so long, s.
const EXERTED_S: f64 = 0.5;
/// It is quiet below so many times what it errs by from step to step.
const QUIET: f64 = 4.0;
/// A body whose mass is known no better than to this share has yet to be learned: it is no other one than before.
pub(super) const UNKNOWN: f64 = 0.1;

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
    pub(super) fn model<'a>(&self, rules: &'a Rules) -> &'a FlightMotion {
        if self.wrench_doubt.is_some() { &rules.doubting } else { &rules.model }
    }

    /// Carries state and covariance on to a time.
    pub(super) fn advance(&mut self, rules: &Rules, history: &WrenchHistory, until_ns: i64) {
        for (from_ns, to_ns) in steps(self.stamp_ns, until_ns) {
            let (believed, step_s) = (history.mean(from_ns, to_ns), (to_ns - from_ns) as f64 * 1e-9);
            // What is not finite never gets here; where a step fails all the same, the motion stays.
            let (model, louder, about) = (self.model(rules), self.louder, self.about);
            let _ = model.predict(&mut self.state, &mut self.covariance, &believed, step_s, about.as_ref(), &louder);
            self.unsettle_suspect(rules, step_s);
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
