//! A body that is no longer the same: something was grasped, released, or broke off.

use super::{ExtendedKalmanFilter, JointMotion, JointState};
use crate::error::IdentificationError;
use crate::estimator::{EstimatorError, Finding, Outcome, RecursiveEstimator};
use nalgebra::{ComplexField, SMatrix, SVector};

/// How a [`ChangeDetector`] watches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChangeSettings {
    /// Updates from one candidate to the next: how finely the onset is told.
    pub spacing: u32,
    /// Mean number of updates between false alarms while the model holds, at least.
    pub updates_between_false_alarms: f64,
}

/// A change that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change<const P: usize> {
    /// Updates since the onset.
    pub updates_ago: u32,
    /// Logarithm of the odds of a change against none, at equal odds before.
    pub evidence: f64,
    /// What was known at the onset: the body before, untouched by what came after.
    pub before: Finding<P>,
    /// What has been learned since, from a widened start: the body after, whose estimator is the detector's
    /// [`current`](ChangeDetector::current) one from now on.
    pub after: Finding<P>,
}

/// What a [`ChangeDetector`] says after an update.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Watch<const P: usize> {
    /// No change, and one would have been seen.
    Quiet,
    /// Nothing to be said: the observations of the window would look the same after a change.
    NotObservable,
    /// The body changed; the estimate is split, and the detector goes on with the new model.
    Changed(Change<P>),
}

/// Watches the innovations of an estimator for a change of its parameters.
///
/// Every few updates a candidate is begun, by a constructor: an estimator like the present one whose parameters are uncertain, as after a
/// change at that moment. No estimator need be `Clone`, and a boxed one is watched as well as a concrete one. From there on each is judged by how well it foresees the observations; the sum of the differences of log
/// likelihood is the evidence for a change then, with the size of the change averaged over rather than maximised. The alarm
/// is raised where the odds of all candidates add up to
/// [`updates_between_false_alarms`](ChangeSettings::updates_between_false_alarms) over [`spacing`](ChangeSettings::spacing).
/// While the model holds, the odds of each candidate are a martingale of mean one, so that their sum grows by one a candidate
/// on average and cannot get there sooner on average. `CANDIDATES` times `spacing` updates is the window.
///
/// # Source
/// The generalised likelihood ratio test on innovations, with a Gaussian prior in place of the maximum:
/// Willsky and Jones (1976). The sum of odds: Shiryaev (1963), Roberts (1966).
#[derive(Debug, Clone)]
pub struct ChangeDetector<E, W, const P: usize, const CANDIDATES: usize> {
    current: E,
    widen: W,
    settings: ChangeSettings,
    candidates: [Option<Candidate<E, P>>; CANDIDATES],
    updates: u32,
    begun: u32,
}

#[derive(Debug, Clone)]
struct Candidate<E, const P: usize> {
    before: Finding<P>,
    after: E,
    start_variance: SVector<f64, P>,
    evidence: f64,
    age: u32,
}

/// A parameter is seen when the window has taken this share of a candidate's variance.
const SEEN: f64 = 0.5;

impl<E, W, const P: usize, const CANDIDATES: usize> ChangeDetector<E, W, P, CANDIDATES>
where
    E: RecursiveEstimator<P>,
    W: Fn(&E, u32) -> Result<E, EstimatorError>,
{
    /// Watches `estimator`; `widen` begins one like it that doubts its parameters, and may take turns between kinds of change by
    /// the number of the candidate.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`] for the settings: spacing (index 0), updates (index 1).
    pub fn try_new(estimator: E, widen: W, settings: ChangeSettings) -> Result<Self, IdentificationError> {
        let values = [f64::from(settings.spacing), settings.updates_between_false_alarms];
        if let Some(index) = values.iter().position(|value| !(*value > 0.0 && value.is_finite())) {
            return Err(IdentificationError::NotPositive { index, value: values[index] });
        }
        let candidates = core::array::from_fn(|_| None);
        Ok(Self { current: estimator, widen, settings, candidates, updates: 0, begun: 0 })
    }

    /// The estimator of the body as it is now.
    pub fn current(&self) -> &E {
        &self.current
    }

    /// Learns from an observation and says whether the body is still the same.
    ///
    /// # Errors
    /// Those of the estimator and of `widen`; an observation that all estimators refuse changes nothing.
    pub fn update(&mut self, observation: &E::Observation) -> Result<(Outcome, Watch<P>), EstimatorError> {
        let outcome = self.current.update(observation)?;
        let (mut odds, mut likeliest): (f64, Option<(usize, f64)>) = (0.0, None);
        for (place, candidate) in self.candidates.iter_mut().enumerate() {
            let Some(candidate) = candidate else { continue };
            let seen = candidate.after.update(observation)?;
            candidate.age += 1;
            // What one of the two finds beyond belief is evidence of neither.
            let both = outcome.is_accepted() && seen.is_accepted();
            if let Some((now, then)) = outcome.log_likelihood.zip(seen.log_likelihood).filter(|_| both) {
                candidate.evidence += then - now;
            }
            odds += ComplexField::exp(candidate.evidence);
            if likeliest.is_none_or(|(_, evidence)| candidate.evidence > evidence) {
                likeliest = Some((place, candidate.evidence));
            }
        }
        let limit = self.settings.updates_between_false_alarms / f64::from(self.settings.spacing);
        let likeliest =
            likeliest.filter(|_| odds >= limit).and_then(|(place, _)| self.candidates.get_mut(place)?.take());
        if let Some(Candidate { before, after, evidence, age, .. }) = likeliest {
            self.candidates.fill_with(|| None);
            self.current = after;
            let after = self.current.finding()?;
            return Ok((outcome, Watch::Changed(Change { updates_ago: age, evidence, before, after })));
        }
        if self.updates.is_multiple_of(self.settings.spacing) {
            let after = (self.widen)(&self.current, self.begun)?;
            self.begun = self.begun.wrapping_add(1);
            let (before, start_variance) = (self.current.finding()?, after.finding()?.covariance()?.diagonal());
            let candidate = Candidate { before, after, start_variance, evidence: 0.0, age: 0 };
            // The free place, else the oldest candidate's.
            let age = |place: &Option<Candidate<E, P>>| place.as_ref().map_or(u32::MAX, |candidate| candidate.age);
            if let Some(place) = self.candidates.iter_mut().max_by_key(|place| age(place)) {
                *place = Some(candidate);
            }
        }
        self.updates = self.updates.wrapping_add(1);
        let watch = if self.visible()?.iter().any(|seen| *seen) { Watch::Quiet } else { Watch::NotObservable };
        Ok((outcome, watch))
    }

    /// Of which parameters a change at the beginning of the window would have been seen by now.
    ///
    /// # Errors
    /// Those of the estimator's finding.
    pub fn visible(&self) -> Result<[bool; P], EstimatorError> {
        match self.candidates.iter().flatten().max_by_key(|candidate| candidate.age) {
            Some(oldest) => {
                let left = oldest.after.finding()?.covariance()?.diagonal();
                Ok(core::array::from_fn(|i| left[i] < (1.0 - SEEN) * oldest.start_variance[i]))
            }
            None => Ok([false; P]),
        }
    }
}

impl ExtendedKalmanFilter<JointMotion, JointState, 22, 15, 10> {
    /// The same filter after a change of the body: each of the ten [`LogCholesky`](crate::dynamics::LogCholesky) coordinates
    /// less certain by a jump of this standard deviation.
    pub fn after_a_jump(&self, standard_deviation: &SVector<f64, 10>) -> Self {
        self.widened_by(&SMatrix::from_diagonal(&standard_deviation.map(|s| s * s)))
    }

    /// The same filter after a change of the mass alone, its logarithm by a jump of this standard deviation, the centre of
    /// mass and the inertia about it as before.
    pub fn after_a_jump_of_mass(&self, standard_deviation: f64) -> Self {
        // The inertia about the centre of mass is proportional to the mass and to the square of the extents.
        let mut jump = SVector::<f64, 10>::zeros();
        jump[0] = 1.0;
        for i in 0..3 {
            jump[4 + i] = -0.5;
            jump[7 + i] = -0.5 * self.state().body.shears[i];
        }
        jump *= standard_deviation;
        self.widened_by(&(jump * jump.transpose()))
    }

    fn widened_by(&self, jump: &SMatrix<f64, 10, 10>) -> Self {
        let mut covariance = *self.state_covariance();
        let mut body = covariance.fixed_view_mut::<10, 10>(12, 12);
        body += jump;
        self.with_state_covariance(covariance)
    }
}
