//! Whether thrust explains a doubt better than another body: each thruster and each supply is suspected in turn.

use super::erring_thrusters::Suspect;
use super::filtered::{Filtered, Rules};
use super::first_lessons::Pass;
use super::wrench_history::WrenchHistory;
use crate::dynamics::LogCholesky;
use crate::estimator::Measurement;

/// When suspects are tried after a doubt, s, and by how much likelier, as a logarithm, measurements have to be under one of them than under what is believed
/// and under nothing that failed before thrust is doubted: another body has hardly been learned after four seconds.
const TRIALS: [(f64, f64); 3] = [(4.0, 60.0), (6.0, 8.0), (9.0, 8.0)];
/// Before thrust is doubted the pass of what is believed is gone through again, this often at most and as long as the logarithm grows by this: far from the
/// body that all is linear about measurements look unlikely under any body.
const MOST_REPEATED: usize = 4;
const GAINED: f64 = 1.0;
/// By how much less likely than what is believed each suspect has to be, as a logarithm, for thrust to be acquitted.
const ACQUITTED: f64 = 4.0;
/// By how much likelier they have to be under one suspect than under any other before that one is named.
const NAMED: f64 = 20.0;

/// Suspects since a doubt of the body or of the wrench.
///
/// A thruster that fails moves the robot as another body would, but only where it is told to push. So what was seen since the doubt is filtered
/// again from the body that was known before: once as it is believed now, once as if nothing had failed, and once for each suspect with nothing known
/// of this one alone. What may be anything makes measurements less likely, and so is believed only where it has to be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Suspects {
    /// `None` where there is none, or it is settled.
    doubted: Option<Doubted>,
    /// Trials so far.
    trials: usize,
    trial: Option<Trial>,
    /// Whether thrust explains what was seen better than a body.
    pub(super) is_thrust: bool,
    /// Whether no thrust of any one thruster or supply explains it nearly as well.
    pub(super) is_acquitted: bool,
    /// The only one that does.
    pub(super) named: Option<Suspect>,
}

/// The filters before and after a doubt.
#[derive(Clone, Copy, Debug)]
struct Doubted {
    before: Filtered,
    after: Filtered,
}

/// All suspects on their way through the first so many measurements.
#[derive(Clone, Copy, Debug)]
struct Trial {
    of: usize,
    /// What was believed since the doubt, to begin with.
    start: Filtered,
    pass: Pass,
    /// The body that the pass of what is believed came to.
    body: LogCholesky<f64>,
    /// How often that pass was gone through again about this body, and whether that still makes measurements likelier.
    repeated: usize,
    gains: bool,
    /// By how much likelier a suspect has to be.
    margin: f64,
    /// Passes before this one: the first is of what is believed, the second of nothing that failed, all others are of suspects.
    place: usize,
    /// Logarithms of the likelihood: of the first two; of the likeliest suspect; of the next one.
    acquitted: f64,
    best: (f64, Option<Suspect>),
    second: f64,
}

impl Suspects {
    pub(super) const NONE: Self =
        Self { doubted: None, trials: 0, trial: None, is_thrust: false, is_acquitted: false, named: None };

    /// Of a doubt that turned one filter into another.
    pub(super) fn begin(&mut self, before: &Filtered, after: &Filtered) {
        *self = Self { doubted: Some(Doubted { before: *before, after: *after }), ..Self::NONE };
    }

    /// What the doubt began with is no more.
    pub(super) fn end(&mut self) {
        (self.doubted, self.trials, self.trial) = (None, 0, None);
    }

    /// Goes on through measurements since the doubt, by as much work as is left.
    pub(super) fn go_on(
        &mut self,
        rules: &Rules,
        history: &WrenchHistory,
        measurements: &[Measurement],
        work: &mut usize,
        now: &Filtered,
    ) {
        let Some(Doubted { before, after }) = &self.doubted else { return };
        if self.trial.is_none() {
            let is_whole = history.complete_since_ns() <= before.stamp_ns;
            let Some((tried_s, margin)) = TRIALS.get(self.trials).filter(|_| is_whole) else {
                self.end();
                return;
            };
            if (now.stamp_ns.saturating_sub(after.stamp_ns) as f64) < tried_s * 1e9 {
                return;
            }
            self.trials += 1;
            self.trial = Some(Trial::new(after, now, measurements.len(), *margin));
        }
        let Some(trial) = &mut self.trial else { return };
        while trial.pass.go_on(rules, history, &measurements[..trial.of], work) {
            trial.weigh();
            let mut passes = core::iter::once(None).chain(Suspect::all(&rules.settings.wrench.thrusters).map(Some));
            if let Some(suspect) = passes.nth(trial.place) {
                let start = before.suspecting(rules, suspect);
                let about = start.state.joint.body;
                trial.pass = Pass::about(&start, &about);
                trial.place += 1;
                continue;
            }
            let (best, suspect) = trial.best;
            let is_thrust = best - trial.acquitted > trial.margin;
            if is_thrust && trial.gains && trial.repeated < MOST_REPEATED {
                trial.pass = Pass::about(&trial.start, &trial.body);
                trial.repeated += 1;
                continue;
            }
            self.is_acquitted = best - trial.acquitted < -ACQUITTED;
            if is_thrust {
                (self.is_thrust, self.doubted) = (true, None);
                self.named = suspect.filter(|_| best - trial.second > NAMED);
            }
            self.trial = None;
            return;
        }
    }
}

impl Trial {
    /// Begins with what is believed since the doubt, about the body of now.
    fn new(after: &Filtered, now: &Filtered, of: usize, margin: f64) -> Self {
        let mut start = *after;
        start.log_likelihood = 0.0;
        let pass = Pass::about(&start, &now.state.joint.body);
        let unlikely = f64::NEG_INFINITY;
        Self {
            of,
            start,
            pass,
            body: now.state.joint.body,
            repeated: 0,
            gains: true,
            margin,
            place: 0,
            acquitted: unlikely,
            best: (unlikely, None),
            second: unlikely,
        }
    }

    /// Takes note of a pass that has come to its end.
    fn weigh(&mut self) {
        let (likelihood, (best, _)) = (self.pass.filtered.log_likelihood, self.best);
        if self.place == 0 || self.repeated > 0 {
            self.gains = likelihood > self.acquitted + GAINED;
            self.body = self.pass.filtered.state.joint.body;
        }
        if self.place < 2 || self.repeated > 0 {
            self.acquitted = self.acquitted.max(likelihood);
        } else if likelihood > best {
            (self.best, self.second) = ((likelihood, self.pass.filtered.suspect), best);
        } else {
            self.second = self.second.max(likelihood);
        }
    }
}
