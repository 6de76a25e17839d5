//! What is learned first is learned about a wrong body: it is learned again when a better one is known.

use super::filtered::{Filtered, Rules, steps};
use super::health::LAST_S;
use super::reception::Reception;
use super::wrench_history::WrenchHistory;
use crate::dynamics::LogCholesky;
use crate::estimator::Measurement;
use nalgebra::{Cholesky, SMatrix, SVector};

/// Measurements kept since the filter last began: more than half a minute at 62.5 Hz.
pub(super) const KEPT: usize = 2560;
/// So many more while those are gone through.
const MEANWHILE: usize = 1280;
/// First time after which everything is filtered again, s, and the factor to the next one.
pub(super) const FIRST_S: f64 = 2.0;
pub(super) const FACTOR: f64 = 1.5;
/// The body of the start is learned again sooner where it is far off the one that all is linear about, by this factor from one time to the next.
const SOONEST_FACTOR: f64 = 1.2;
/// A linear answer errs by a part of what is known where the body has moved by more than this, in logarithms.
const FAR_OFF: f64 = 0.05;
/// Mass and extents in the chart.
pub(super) const LOGARITHMS: [usize; 4] = [0, 4, 5, 6];
/// At each of them so many passes at most, until one moves the body by no more than this, in its chart, and by how much at most the next
/// one is about another body.
const PASSES: usize = 5;
const NEAR: f64 = 0.02;
const LARGEST_STEP: f64 = 0.5;
/// So many changes from pass to pass tell where the next one is to be.
const REMEMBERED: usize = 3;
/// One in so many measurements may be left out.
const FEW: usize = 20;
/// Steps of the filter, and those that the rows of a measurement are worth, in one control period.
pub(super) const WORK: usize = 128;
const WORK_OF_ROWS: usize = 2;

/// All settled measurements since the body was last made uncertain, and when to go through them again.
///
/// A Kalman filter that begins far off takes its first derivatives at the wrong body and is then surer than it should be, for
/// good. So at times that grow geometrically all measurements are filtered again from the start on, with all derivatives at
/// the body known by then: each pass is one Gauss-Newton step of the most likely body, and its covariance is the one that
/// belongs there. Where the body has moved far from the one that the last pass was linear about, it is not waited for the next of those times. A part of
/// it is done in each control period, so that none takes long; meanwhile what was known before is what is known.
#[derive(Clone, Debug)]
pub(super) struct FirstLessons {
    start: Filtered,
    measurements: Vec<Measurement>,
    next_s: f64,
    soonest_s: f64,
    /// Whether the body was near the one that all is linear about when it was to be learned again: what leads it away later is no first lesson.
    is_found: bool,
    full: bool,
    again: Option<Again>,
}

impl FirstLessons {
    pub(super) fn new(start: &Filtered) -> Self {
        let measurements = Vec::with_capacity(KEPT + MEANWHILE);
        Self {
            start: *start,
            measurements,
            next_s: FIRST_S,
            soonest_s: FIRST_S,
            is_found: false,
            full: false,
            again: None,
        }
    }

    /// Begins anew at this filter, whose body has just become uncertain. What is believed of another body in its first seconds leads passes astray that
    /// are about it: these keep to their times.
    pub(super) fn begin_at(&mut self, start: &Filtered) {
        self.start = *start;
        self.measurements.clear();
        (self.next_s, self.soonest_s, self.again) = (FIRST_S, f64::INFINITY, None);
        (self.is_found, self.full) = (false, false);
    }

    /// What was measured since.
    pub(super) fn measurements(&self) -> &[Measurement] {
        &self.measurements
    }

    /// Keeps a measurement that nothing will come before any more.
    pub(super) fn keep(&mut self, measurement: &Measurement) {
        if self.full || self.next_s > LAST_S && self.again.is_none() {
            return;
        }
        let most = if self.again.is_some() { KEPT + MEANWHILE } else { KEPT };
        if self.measurements.len() >= most {
            (self.full, self.again) = (true, None);
            return;
        }
        self.measurements.push(measurement.clone());
    }

    /// Whether everything is being gone through again, or is to be because the body of now is far off the one that it is linear about.
    pub(super) fn are_underway(&self, now: &Filtered) -> bool {
        self.again.is_some() || !self.full && self.next_s <= LAST_S && self.is_far_off(now)
    }

    /// Whether it is time to go through everything again.
    fn are_due(&self, now: &Filtered) -> bool {
        if self.next_s > LAST_S || self.measurements.is_empty() {
            return false;
        }
        let since_s = self.since_s(now);
        since_s >= self.next_s || since_s >= self.soonest_s && self.is_far_off(now)
    }

    /// Whether the body of now is still to be found, and so far from the one that it is linear about that a linear answer errs.
    fn is_far_off(&self, now: &Filtered) -> bool {
        if self.is_found {
            return false;
        }
        let about = now.about.as_ref().unwrap_or(&self.start.state.joint.body).to_vector();
        let step = now.state.joint.body.to_vector() - about;
        LOGARITHMS.into_iter().any(|i| step[i].abs() > FAR_OFF)
    }

    /// How long ago it began, s.
    fn since_s(&self, now: &Filtered) -> f64 {
        now.stamp_ns.saturating_sub(self.start.stamp_ns) as f64 * 1e-9
    }

    /// Goes on with what is to be learned again, up to the filter of now: the filter of now by all that was learned again, once that has
    /// come to its end.
    ///
    /// The first pass is about the body of now, and that may have gone astray where a step of its inertia shows next to nothing and the next
    /// one leads farther still: passes are tried again from the body of the start. Where nothing wanders this is seen by measurements that are
    /// left out, more than a few, and those passes are taken that leave out less. Of a localisation that wanders some are left out whatever the
    /// body: there passes that find no end have gone astray, those are taken that come to one, else those under which the measurements are
    /// likelier.
    ///
    /// An accelerometer that is believed by now is believed from the start on: what it showed while it was doubted is not lost.
    pub(super) fn learned(
        &mut self,
        rules: &Rules,
        history: &WrenchHistory,
        now: &Filtered,
        work: &mut usize,
    ) -> Option<Filtered> {
        if self.full || history.complete_since_ns() > self.start.stamp_ns {
            self.again = None;
            return None;
        }
        if self.again.is_none() {
            if !self.are_due(now) {
                return None;
            }
            let since_s = self.since_s(now);
            if since_s >= self.next_s {
                self.next_s *= FACTOR;
                self.is_found |= !self.is_far_off(now);
            }
            self.soonest_s = self.soonest_s.max(since_s * SOONEST_FACTOR);
            if now.accelerometer_is_sane {
                self.start.believe_accelerometer(rules);
            }
            self.again = Some(Again::from(&self.start, &now.state.joint.body, self.measurements.len()));
        }
        let again = self.again.as_mut()?;
        while again.is_searching() {
            if !again.pass.go_on(rules, history, &self.measurements[..again.of], work) {
                return None;
            }
            again.next_pass(rules.settings.slow.wanders(), &self.start);
        }
        // What came while it was gone through.
        if !again.pass.go_on(rules, history, &self.measurements, work) {
            return None;
        }
        let mut learned = self.again.take()?.pass.filtered;
        learned.advance(rules, history, now.stamp_ns);
        Some(learned)
    }
}

/// Passes on their way through the first so many measurements.
#[derive(Clone, Copy, Debug)]
struct Again {
    of: usize,
    pass: Pass,
    mixing: Mixing,
    passes: usize,
    /// What the passes from the body of now came to, where those from the body of the start are on their way.
    found: Option<Pass>,
    ended: bool,
}

impl Again {
    fn from(start: &Filtered, about: &LogCholesky<f64>, of: usize) -> Self {
        Self { of, pass: Pass::about(start, about), mixing: Mixing::default(), passes: 1, found: None, ended: false }
    }

    fn is_searching(&self) -> bool {
        !self.ended
    }

    /// From a pass that has come to its end to the next one, or to the best.
    fn next_pass(&mut self, wanders: bool, start: &Filtered) {
        let about = self.pass.linear_about();
        let step = self.pass.filtered.state.joint.body.to_vector() - about.to_vector();
        let size = step.amax();
        self.pass.is_settled = size <= NEAR;
        if self.passes < PASSES && !size.is_nan() && !self.pass.is_settled {
            self.passes += 1;
            let step = self.mixing.step(&about.to_vector(), &step);
            let next = about.to_vector() + step * f64::min(1.0, LARGEST_STEP / step.amax());
            self.pass = Pass::about(start, &LogCholesky::from_vector(&next));
            return;
        }
        let Some(found) = self.found else {
            let is_astray = if wanders { !self.pass.is_settled } else { self.pass.left_out * FEW > self.of };
            if is_astray {
                let from_start = Self::from(start, &start.state.joint.body, self.of);
                *self = Self { found: Some(self.pass), ..from_start };
            } else {
                self.ended = true;
            }
            return;
        };
        let from_start = &self.pass;
        let is_better = if !wanders {
            from_start.left_out < found.left_out
        } else if from_start.is_settled {
            true
        } else {
            from_start.filtered.log_likelihood > found.filtered.log_likelihood
        };
        if !is_better {
            self.pass = found;
        }
        self.ended = true;
    }
}

/// Where the next pass is to be linear, from what became of those before: Anderson's mixing.
///
/// The body that a pass finds is the start of the next one, and would go to and fro for ever where a motion shows some of the body only: what
/// the rest is to be, so that the shown is right and the prior least offended, is linear in the chart to first order only. Of what has come so
/// far follows how the step depends on the body, and where there is none. Passes that leave out other measurements do not compare, and what
/// seems to follow from them may lie anywhere: no step is longer than the one that its pass found.
#[derive(Clone, Copy, Debug, Default)]
struct Mixing {
    changes: usize,
    last: Option<[SVector<f64, 10>; 2]>,
    /// Changes of body and step from each pass to the next.
    bodies: SMatrix<f64, 10, REMEMBERED>,
    steps: SMatrix<f64, 10, REMEMBERED>,
}

impl Mixing {
    /// The step to the body of the next pass, from the body of this one and the step that it found.
    fn step(&mut self, body: &SVector<f64, 10>, step: &SVector<f64, 10>) -> SVector<f64, 10> {
        if let Some([last_body, last_step]) = self.last.replace([*body, *step]) {
            let column = self.changes % REMEMBERED;
            self.bodies.set_column(column, &(body - last_body));
            self.steps.set_column(column, &(step - last_step));
            self.changes += 1;
        }
        let square = self.steps.tr_mul(&self.steps);
        // Columns that are still empty, or nearly another one, count for nothing.
        let square = square + SMatrix::identity() * (1e-6 * square.trace() + f64::MIN_POSITIVE);
        let Some(root) = Cholesky::new(square) else { return *step };
        let mixed = step - (self.bodies + self.steps) * root.solve(&self.steps.tr_mul(step));
        mixed * f64::min(1.0, step.amax() / mixed.amax())
    }
}

/// A pass through the measurements, linear about one body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pass {
    pub(super) filtered: Filtered,
    /// The first measurement that it has not taken.
    next: usize,
    /// Measurements that were not learned from.
    left_out: usize,
    /// Whether a further one would be about nearly the same body.
    is_settled: bool,
}

impl Pass {
    pub(super) fn about(start: &Filtered, about: &LogCholesky<f64>) -> Self {
        let mut filtered = *start;
        filtered.about = Some(*about);
        Self { filtered, next: 0, left_out: 0, is_settled: false }
    }

    /// The body that all is linear about.
    fn linear_about(&self) -> LogCholesky<f64> {
        self.filtered.about.unwrap_or(self.filtered.state.joint.body)
    }

    /// Takes measurements as long as there is work left; whether it has taken all.
    pub(super) fn go_on(
        &mut self,
        rules: &Rules,
        history: &WrenchHistory,
        measurements: &[Measurement],
        work: &mut usize,
    ) -> bool {
        while let Some(measurement) = measurements.get(self.next) {
            let steps = steps(self.filtered.stamp_ns, measurement.stamp_ns).count();
            if *work < WORK && WORK_OF_ROWS + steps > *work {
                return false;
            }
            *work = work.saturating_sub(WORK_OF_ROWS + steps);
            self.filtered.advance(rules, history, measurement.stamp_ns);
            let reception = self.filtered.take(rules, history, measurement);
            self.left_out += usize::from(matches!(reception, Reception::Gated { .. } | Reception::Relocalised));
            self.next += 1;
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimator() -> super::super::FlightEstimator {
        use crate::dynamics::{InertialParameters, RigidBodyState};
        use crate::estimator::standard_deviations;
        use nalgebra::{Matrix3, Vector3};

        let parameters = InertialParameters::about_com(10.0, Vector3::zeros(), Matrix3::from_diagonal_element(0.2));
        let covariance = SMatrix::from_diagonal(&SVector::from_fn(|i, _| [1.0, 1e-3][usize::from(i > 0)]));
        let std = standard_deviations(&parameters.to_vector(), &covariance);
        let prior = crate::Estimate { parameters, covariance, std, lmi_active: false };
        let settings = super::super::FlightEstimatorSettings::of_poses(1e-4, 1e-4, 0.016);
        super::super::FlightEstimator::try_new(settings, RigidBodyState::at_rest(), 0, &prior).unwrap()
    }

    /// The body of the start waits for the next time where it is near the one that all is linear about; another one waits in any case.
    #[test]
    fn a_body_far_from_what_all_is_linear_about_is_learned_again_before_its_time() {
        let start = *estimator().newest();
        let due = |of_start: bool, at_ms: i64, more_mass: f64| {
            let mut lessons = FirstLessons::new(&start);
            if !of_start {
                lessons.begin_at(&start);
            }
            lessons.keep(&Measurement::default());
            lessons.next_s = FACTOR * FIRST_S;
            let mut now = start;
            now.stamp_ns = at_ms * 1_000_000;
            now.state.joint.body.log_mass += more_mass;
            (lessons.are_due(&now), lessons.are_underway(&now))
        };
        assert_eq!(due(true, 2500, 1.2 * FAR_OFF), (true, true));
        assert_eq!(due(true, 2500, 0.8 * FAR_OFF), (false, false));
        assert_eq!(due(true, 1500, 1.2 * FAR_OFF), (false, true));
        assert_eq!(due(false, 2500, 1.2 * FAR_OFF), (false, true));
        assert_eq!(due(false, 3500, 0.0), (true, false));
    }

    /// A body that was near what all is linear about when its time came is found: what leads it away is nothing to be learned from the beginning.
    #[test]
    fn a_body_that_was_found_is_not_still_to_be_found() {
        let estimator = estimator();
        let start = *estimator.newest();
        for (more_mass, is_found) in [(0.8 * FAR_OFF, true), (1.2 * FAR_OFF, false)] {
            let mut lessons = FirstLessons::new(&start);
            lessons.keep(&Measurement::default());
            let mut now = start;
            now.stamp_ns = 2_500_000_000;
            now.state.joint.body.log_mass += more_mass;
            assert!(lessons.learned(&estimator.rules, &estimator.history, &now, &mut WORK.clone()).is_some());
            now.state.joint.body.log_mass = start.state.joint.body.log_mass + 1.2 * FAR_OFF;
            assert_eq!(lessons.are_underway(&now), !is_found);
        }
    }

    /// Passes that go to and fro ever farther, in two directions at different rates, and one that creeps: five of them find the end.
    #[test]
    fn passes_that_overshoot_find_their_end() {
        let end = SVector::<f64, 10>::from_fn(|i, _| 0.1 * i as f64);
        let rate = SVector::<f64, 10>::from_fn(|i, _| match i {
            0..3 => -1.5,
            3..6 => -0.7,
            _ => 0.2,
        });
        let (mut body, mut mixing, mut sizes) = (SVector::<f64, 10>::zeros(), Mixing::default(), Vec::new());
        for _ in 0..PASSES {
            let step = (end - body).component_mul(&(SVector::repeat(1.0) - rate));
            sizes.push(step.amax());
            body += mixing.step(&body, &step);
        }
        assert!((end - body).amax() < 1e-3 * end.amax(), "{sizes:?} {}", end - body);
    }

    /// A pass that left out other measurements than the one before seems to say that the end is a hundred times as far.
    #[test]
    fn no_step_is_longer_than_the_pass_found() {
        let mut mixing = Mixing::default();
        let (body, step) = (SVector::<f64, 10>::zeros(), SVector::<f64, 10>::repeat(0.1));
        let body = body + mixing.step(&body, &step);
        let next = mixing.step(&body, &(step * 0.99));
        assert!(next.amax() <= 0.099 * (1.0 + 1e-12), "{next}");
    }

    #[test]
    fn a_first_step_and_the_same_one_again_are_taken_as_they_are() {
        let (body, step) = (SVector::<f64, 10>::zeros(), SVector::<f64, 10>::repeat(0.1));
        let mut mixing = Mixing::default();
        for _ in 0..PASSES {
            assert_eq!(mixing.step(&body, &step), step);
        }
        assert_eq!(Mixing::default().step(&body, &body), body);
    }
}
