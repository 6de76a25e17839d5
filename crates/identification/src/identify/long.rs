//! A record too long to be taken at once, by likelihood: a batch on its first rows, a sliding window over all of them.

use super::identification::{Identification, NodeResidual};
use super::identify;
use super::likelihood::{Answer, DETERMINED, MANY_OUTLIERS, estimator};
use super::plan::Plan;
use super::settings::{AUTO, MAXIMUM_LIKELIHOOD, Settings};
use super::verdict::verdict;
use super::warning::Warning;
use crate::Observability;
use crate::error::IdentificationError;
use crate::estimator::Evidence;
use crate::likelihood::{FixedLag, FixedLagSettings, FixedLagStep, MaximumLikelihood, Nuisances};
use crate::motion::MotionSample;

/// Rows from which noise levels, start and rank are taken.
const FIRST_ROWS: usize = 20_000;
/// A step longer than this many median steps is a gap.
const GAP: f64 = 1.5;
/// Most residuals that are kept; beyond, every second one is dropped.
const MOST_RESIDUALS: usize = 8192;

/// Identification of a record of any length by likelihood, in constant memory.
///
/// ```text
/// LongRecord::try_new(first rows) -> push(every row, the first ones included) -> finish()
/// ```
pub struct LongRecord {
    settings: Settings,
    /// What the first rows say.
    first: Identification,
    window: FixedLag,
    rows: usize,
    last_ns: Option<i64>,
    gaps: (usize, f64),
    without_wrench: usize,
    rejected: usize,
    /// Sums of squares of the wrench applied and of what is left of it: torque, force.
    applied: (f64, f64),
    left: (f64, f64),
    residuals: Vec<NodeResidual>,
    /// Every so many segments a residual is kept.
    every: usize,
    segments: usize,
}

impl LongRecord {
    /// Rows above which a record is long: the likelihood then slides over it unless another method is asked for.
    pub const LONG: usize = 50_000;

    /// Judges the first rows (20 000 of them are enough). `None` where they are not the likelihood's to answer: another
    /// method asked for or chosen, a direction left free, nuisances to be estimated, a row without a pose, or more that acts than the logged wrench. Such records are identified in
    /// stretches and [`merge`](super::merge)d.
    ///
    /// # Errors
    /// As [`identify`].
    pub fn try_new(first: &[MotionSample], settings: &Settings) -> Result<Option<Self>, IdentificationError> {
        if first.iter().any(|row| row.has_more_than_logged() || row.world_from_body.is_none()) {
            return Ok(None);
        }
        if settings.estimate != Nuisances::default() || ![AUTO, MAXIMUM_LIKELIHOOD].contains(&settings.method) {
            return Ok(None);
        }
        let first = first.get(..FIRST_ROWS).unwrap_or(first);
        let found = identify(first, &Settings { prior: None, ..*settings })?;
        let (MAXIMUM_LIKELIHOOD, Some(estimate)) = (found.method, &found.estimate) else { return Ok(None) };
        let likelihood = MaximumLikelihood {
            noise: Some(found.noise),
            segment_samples: Some(found.lag),
            start: estimate.parameters,
            ..estimator(settings)
        };
        let window = FixedLagSettings {
            likelihood,
            bootstrap_s: f64::INFINITY,
            longest_bootstrap_s: f64::INFINITY,
            ..FixedLagSettings::default()
        };
        let mut long = Self {
            settings: *settings,
            window: FixedLag::new(window),
            rows: 0,
            last_ns: None,
            gaps: (0, 0.0),
            without_wrench: 0,
            rejected: found.samples_rejected,
            applied: (0.0, 0.0),
            left: (0.0, 0.0),
            residuals: Vec::new(),
            every: 1,
            segments: 0,
            first: found,
        };
        for residual in long.first.residuals.split_off(0) {
            long.add_residual(residual, long.first.lag);
        }
        Ok(Some(long))
    }

    /// Takes the next row.
    ///
    /// # Errors
    /// As [`FixedLag::push`].
    pub fn push(&mut self, row: MotionSample) -> Result<(), IdentificationError> {
        let step = self.window.push(row)?;
        if let Some(last_ns) = self.last_ns {
            let step_s = (row.time_ns - last_ns) as f64 * 1e-9;
            if step_s > GAP * self.first.step_s {
                self.gaps = (self.gaps.0 + 1, self.gaps.1.max(step_s));
            }
        }
        self.last_ns = Some(row.time_ns);
        self.rows += 1;
        match row.wrench_body {
            Some(wrench) => {
                self.applied.0 += wrench.torque.norm_squared();
                self.applied.1 += wrench.force.norm_squared();
            }
            None => self.without_wrench += 1,
        }
        if let Some(FixedLagStep { time_ns, innovation: Some(innovation), .. }) = step {
            self.rejected += innovation.rejected;
            let residual = NodeResidual { time_ns, torque: innovation.wrench.torque, force: innovation.wrench.force };
            self.add_residual(residual, self.first.lag);
        }
        Ok(())
    }

    /// What all rows say.
    ///
    /// # Errors
    /// As [`FixedLag::finish`] and [`identify`].
    pub fn finish(self) -> Result<Identification, IdentificationError> {
        let found = self.window.finish()?;
        let plan = Plan::usual(&self.settings)?;
        let Some(Answer { scale, information, estimate, regularised }) = Answer::of(&found, &plan)? else {
            return Err(IdentificationError::NotKnown { largest: DETERMINED });
        };
        let observability = Observability::new(&information, scale);
        let size = |(torque, force): (f64, f64)| torque / scale.length_m().powi(2) + force;
        let applied = size(self.applied);
        let evidence = Evidence::of_sums(applied, size(self.left));
        let explained = evidence.explained().unwrap_or_default();
        let verdict = verdict(&plan, scale, &information, estimate.as_ref(), &evidence, None)?;
        let mut warnings = vec![Warning::SlidingWindow { batch: FIRST_ROWS.min(self.rows), rows: self.rows }];
        if self.gaps.0 > 0 {
            warnings.push(Warning::Gaps { count: self.gaps.0, longest_s: self.gaps.1 });
        }
        if self.without_wrench > 0 {
            warnings.push(Warning::HeldWrenches { samples: self.without_wrench });
        }
        if estimate.is_some_and(|found| found.lmi_active) {
            warnings.push(Warning::ConstraintActive);
        }
        if self.rejected as f64 > MANY_OUTLIERS * self.rows as f64 {
            warnings.push(Warning::ManyOutliers { rejected: self.rejected, rows: self.rows });
        }
        if explained < plan.judge.poor_fit {
            warnings.push(Warning::PoorFit { explained });
        }
        Ok(Identification {
            samples_used: self.rows.saturating_sub(self.rejected),
            samples_rejected: self.rejected,
            rank: 10,
            condition_number: observability.condition_number(),
            null_directions: Vec::new(),
            information,
            scale,
            estimate,
            regularised,
            explained: Some(explained),
            verdict,
            evidence,
            noise: found.noise,
            residuals: self.residuals,
            warnings,
            ..self.first
        })
    }

    fn add_residual(&mut self, residual: NodeResidual, samples: usize) {
        self.left.0 += samples as f64 * residual.torque.norm_squared();
        self.left.1 += samples as f64 * residual.force.norm_squared();
        if self.segments.is_multiple_of(self.every) {
            if self.residuals.len() >= MOST_RESIDUALS {
                let mut kept = false;
                self.residuals.retain(|_| {
                    kept = !kept;
                    kept
                });
                self.every *= 2;
            }
            self.residuals.push(residual);
        }
        self.segments += 1;
    }
}
