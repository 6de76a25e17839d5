//! What a filter makes of a doubt of the body or of the wrench, and of what somebody else knows.

use super::erring_thrusters::{Suspect, THRUSTERS};
use super::filtered::{Contradicted, Filtered, Known, Rules, UNKNOWN, WrenchDoubt};
use super::flight_motion::{ACCELERATION_SCALE, BODY, COORDINATES, DRIFT, THRUST, WANDER};
use super::health::Monitor;
use super::moved_map::SETTLING_NS;
use super::settings::WrenchErrors;
use crate::dynamics::LogCholesky;
use crate::lie::Wrench;
use nalgebra::{SMatrix, SVector, Vector6};

/// A localisation that contradicts the motion for longer than this is no jump that comes back: it is the motion that is off.
const LONGEST_JUMP_NS: i64 = 6_000_000_000;
/// What a failed thruster may give, and by how much that changes in a second, as multiples of the thrust that by itself makes one standard deviation of what a
/// wrench in doubt may be off by.
const GIVEN: f64 = 3.5;
const UNSTEADY: f64 = 1.2;
/// Share by which thrusters of its supply, or of a supply that failed, may all give more.
const SHARED: f64 = 0.1;
/// Probability that what is blamed on actuators was a grasp or a release after all, and the body what was learned since.
const GRASPED: f64 = 0.1;
/// Standard deviation of the relative error of a thruster that may be dead, or give half as much again.
const FREED: f64 = 0.5;

impl Filtered {
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
            suspecting.less_certain_of_suspect(rules, GIVEN * GIVEN);
        }
        suspecting
    }

    /// A suspected thruster less steady by a step.
    pub(super) fn unsettle_suspect(&mut self, rules: &Rules, step_s: f64) {
        self.less_certain_of_suspect(rules, UNSTEADY * UNSTEADY * step_s);
    }

    /// Less certain of what a suspected thruster gives, by this multiple of the variance that a wrench in doubt has along it.
    fn less_certain_of_suspect(&mut self, rules: &Rules, multiple: f64) {
        if let Some(Suspect::Thruster(thruster)) = self.suspect {
            let push = rules.settings.wrench.thrusters[thruster].push_body.to_vector();
            let doubted = rules.settings.wrench.doubted().drift;
            let off = |(push, sigma): (&f64, &f64)| if *push == 0.0 { 0.0 } else { push / sigma };
            let per_thrust = push.iter().zip(doubted.iter()).map(off).map(|off| off * off).sum::<f64>();
            let mut drift = self.covariance.fixed_view_mut::<6, 6>(DRIFT, DRIFT);
            drift += push * push.transpose() * (multiple / per_thrust);
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
