//! The likelihood of a log that never ends: the last few segments are free, everything before is one quadratic.

use super::record::{Record, is_finite};
use super::sample::Sample;
use super::segment::{GATE, HUBER, Robust};
use super::stream::{Read, Stream};
use super::{Approach, Fit, LikelihoodEstimate, MaximumLikelihood, SMALL_DECREMENT, eliminated, not_excited, result};
use crate::dynamics::InertialParameters;
use crate::error::{Column, IdentificationError};
use crate::estimator::{EstimatorError, Finding, Outcome, RecursiveEstimator};
use crate::lie::Wrench;
use crate::motion::MotionSample;
use crate::recursive;
use crate::{BodyScale, Noise, SquareRootInformation};
use nalgebra::{SMatrix, SVector, Vector3, Vector6};

/// Rows at which any bootstrap ends.
const MOST_ROWS: usize = 20_000;
/// Fewest rows on which a bootstrap is tried.
const FEWEST_ROWS: usize = 32;
/// Relative uncertainty of mass and inertia, and that of the centre of mass by the radius of gyration, below which the
/// bootstrap has found the body: the errors of linearisation are second order in it.
const DETERMINED: f64 = 0.1;
/// Iterations at the end of the log.
const LAST_ITERATIONS: usize = 10;

/// How [`FixedLag`] works.
#[derive(Clone, Debug, PartialEq)]
pub struct FixedLagSettings {
    /// The likelihood; its noise levels, where not given, are those the bootstrap finds.
    pub likelihood: MaximumLikelihood,
    /// Segments that stay free. One segment and one iteration are the augmented error-state Kalman filter.
    pub segments: usize,
    /// Gauss-Newton iterations for each new segment.
    pub iterations: usize,
    /// Length of the stretch that is estimated as a batch before anything is given out, s.
    pub bootstrap_s: f64,
    /// Up to this the bootstrap is prolonged where it does not determine all ten parameters, s, but not beyond 20 000 rows.
    /// Then a weak prior about the start fills in, the older half of the rows is forgotten, and the bootstrap goes on.
    pub longest_bootstrap_s: f64,
}

impl Default for FixedLagSettings {
    fn default() -> Self {
        Self {
            likelihood: MaximumLikelihood::default(),
            segments: 4,
            iterations: 2,
            bootstrap_s: 3.0,
            longest_bootstrap_s: 60.0,
        }
    }
}

/// What a segment says about the prediction made for it before it was read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Normalised innovation squared, summed over the samples of the segment, outliers included: chi-square with
    /// [`degrees`](Self::degrees) degrees of freedom where model and noise levels hold.
    pub nis: f64,
    /// Numbers measured.
    pub degrees: usize,
    /// Samples that got no weight in the end, by the column that lost most.
    pub rejected: usize,
    /// Mean wrench that the segment asks for beyond the one logged.
    pub wrench: Wrench<f64>,
}

/// The estimate after one more segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedLagStep {
    /// Time of the last row read, ns.
    pub time_ns: i64,
    /// The most likely body that exists.
    pub parameters: InertialParameters<f64>,
    /// Covariance of [`InertialParameters::to_vector`], without the consistency constraint.
    pub covariance: SMatrix<f64, 10, 10>,
    /// One standard deviation of `[ln m, c, J_C (11, 12, 13, 22, 23, 33)]`.
    pub std: SVector<f64, 10>,
    /// Body axis along which the consistency constraint holds the body thick enough; `None` where it is not active.
    pub active_axis: Option<Vector3<f64>>,
    /// The bootstrap does not determine all ten parameters yet: a weak prior about the start is in this estimate, and
    /// nothing is carried over from it.
    pub regularised: bool,
    /// `None` for the bootstrap.
    pub innovation: Option<Innovation>,
}

/// Maximum likelihood in a window that slides over a log of any length, in constant memory.
///
/// The first seconds are estimated as a batch. From then on each segment of samples is predicted, the segments in the
/// window are iterated together, and the oldest is summed up into a quadratic in the state it leads to and the parameters.
///
/// # Source
/// The likelihood of [`MaximumLikelihood`], eliminated forward.
pub struct FixedLag {
    settings: FixedLagSettings,
    phase: Phase,
    last: Option<FixedLagStep>,
}

enum Phase {
    Bootstrap {
        rows: Vec<MotionSample>,
        /// Length at which to try, s.
        next_s: f64,
        /// Rows forgotten.
        forgotten: usize,
    },
    Window(Box<dyn Sliding + Send>),
}

impl FixedLag {
    /// Before the first row.
    #[must_use]
    pub fn new(settings: FixedLagSettings) -> Self {
        let next_s = settings.bootstrap_s;
        Self { settings, phase: Phase::Bootstrap { rows: Vec::new(), next_s, forgotten: 0 }, last: None }
    }

    /// Takes the next row; gives an estimate whenever the bootstrap or a segment is complete.
    ///
    /// Rows are used two late (held wrench) or four late (sampled). The row that completes the bootstrap costs a batch
    /// estimate.
    ///
    /// # Errors
    /// [`IdentificationError::NotFinite`] and [`IdentificationError::TimesNotIncreasing`] for a row that cannot be used; it
    /// is left out, the next may follow; so are [`IdentificationError::WrenchBeside`] for one with stored momentum or an environment,
    /// and [`IdentificationError::MissingColumn`] for one without a pose. The latter also where a longest bootstrap holds no wrench;
    /// [`IdentificationError::LikelihoodNotConverged`]; [`IdentificationError::NeedsWholeRecord`] where a delay or lag is
    /// asked for.
    pub fn push(&mut self, row: MotionSample) -> Result<Option<FixedLagStep>, IdentificationError> {
        let step = self.take(&row)?;
        self.last = step.or(self.last);
        Ok(step)
    }

    fn take(&mut self, row: &MotionSample) -> Result<Option<FixedLagStep>, IdentificationError> {
        if row.has_more_than_logged() {
            return Err(IdentificationError::WrenchBeside);
        }
        if row.world_from_body.is_none() {
            return Err(IdentificationError::MissingColumn(Column::Pose));
        }
        if self.settings.likelihood.nuisances.iter().any(|nuisance| nuisance.is_a_time()) {
            return Err(IdentificationError::NeedsWholeRecord);
        }
        let (rows, next_s, forgotten) = match &mut self.phase {
            Phase::Window(window) => return window.push(row),
            Phase::Bootstrap { rows, next_s, forgotten } => (rows, next_s, forgotten),
        };
        let index = *forgotten + rows.len();
        if !is_finite(row) {
            return Err(IdentificationError::NotFinite { row: index });
        }
        if rows.last().is_some_and(|last| row.time_ns <= last.time_ns) {
            return Err(IdentificationError::TimesNotIncreasing { index });
        }
        rows.push(*row);
        let span_s = (row.time_ns - rows[0].time_ns) as f64 * 1e-9;
        let full = rows.len() >= MOST_ROWS;
        if !full && (span_s < *next_s || rows.len() < FEWEST_ROWS) {
            return Ok(None);
        }
        let limit_s = self.settings.longest_bootstrap_s;
        *next_s = (2.0 * span_s).min(limit_s);
        if let Some((window, step)) = self.settings.bootstrap(rows, *forgotten)? {
            self.phase = Phase::Window(window);
            return Ok(Some(step));
        }
        if !full && span_s < limit_s {
            return Ok(None);
        }
        let step = self.settings.regularised(rows);
        *forgotten += rows.len() / 2;
        rows.drain(..rows.len() / 2);
        step.map(Some)
    }

    /// Noise levels in use; `None` during the bootstrap.
    #[must_use]
    pub fn noise(&self) -> Option<Noise> {
        match &self.phase {
            Phase::Window(window) => Some(window.noise()),
            Phase::Bootstrap { .. } => None,
        }
    }

    /// The estimate from the whole log, its last rows included; from the rows not forgotten where the bootstrap never
    /// determined the parameters.
    ///
    /// # Errors
    /// Those of [`MaximumLikelihood::estimate`]; [`IdentificationError::NotExcited`] where the data do not determine all
    /// ten parameters.
    pub fn finish(self) -> Result<LikelihoodEstimate, IdentificationError> {
        match self.phase {
            Phase::Window(window) => window.finish(),
            Phase::Bootstrap { rows, .. } => self.settings.likelihood.estimate(&rows),
        }
    }
}

/// An observation is a row. Most only fill a segment: they have no degrees of freedom. The density of an innovation is not known, nor
/// is there a gate in front of whole segments; outliers lose their weight inside.
impl RecursiveEstimator for FixedLag {
    type Observation = MotionSample;

    fn update(&mut self, row: &MotionSample) -> Result<Outcome, EstimatorError> {
        let innovation = self.push(*row)?.and_then(|step| step.innovation);
        let (nis, degrees_of_freedom) = innovation.map_or((0.0, 0), |found| (found.nis, found.degrees));
        Ok(Outcome { nis, degrees_of_freedom, log_likelihood: None, gate: recursive::Verdict::Accepted })
    }

    /// Nothing, before the first segment is complete. While a weak prior is in the estimate it is the prior of the finding.
    fn finding(&self) -> Result<Finding, EstimatorError> {
        let scale = BodyScale::of(&self.settings.likelihood.start.to_vector())?;
        let Some(step) = &self.last else {
            return Ok(Finding::of_information(SquareRootInformation::new(), scale.parameter_magnitudes()));
        };
        let point = step.parameters.to_vector();
        let found = Finding::of_covariance(point, &step.covariance, BodyScale::of(&point)?.parameter_magnitudes())?;
        Ok(if step.regularised { found.with_prior(*found.information()) } else { found })
    }
}

impl FixedLagSettings {
    /// The batch estimate of the first rows, ready to slide; `None` where more rows should come first.
    fn bootstrap(&self, rows: &[MotionSample], forgotten: usize) -> Result<Option<Start>, IdentificationError> {
        match self.likelihood.calibration(false).columns() {
            0..=13 => self.bootstrap_with::<32>(rows, forgotten),
            14..=21 => self.bootstrap_with::<40>(rows, forgotten),
            _ => self.bootstrap_with::<56>(rows, forgotten),
        }
    }

    fn bootstrap_with<const W: usize>(
        &self,
        rows: &[MotionSample],
        forgotten: usize,
    ) -> Result<Option<Start>, IdentificationError> {
        let MaximumLikelihood { wrench_timing, robust, .. } = self.likelihood;
        let calibration = self.likelihood.calibration(false);
        let fit = Record::try_new(rows, wrench_timing, robust)
            .and_then(|record| self.likelihood.fit::<W>(record, calibration, None, Approach::Direct));
        let Some(fit) = fit.ok().filter(is_determined) else { return Ok(None) };
        let stream = Stream::after(rows, forgotten, &fit.chain.record, wrench_timing);
        let mut window = Window::<W> { settings: self.clone(), pending: Vec::new(), after_break: false, fit, stream };
        let step = window.step(None)?;
        let complete = window.settle(rows.len() - Stream::late(wrench_timing))?;
        Ok(complete.then(|| -> Start { (Box::new(window), step) }))
    }

    /// The batch estimate with a weak prior, nuisances left alone.
    fn regularised(&self, rows: &[MotionSample]) -> Result<FixedLagStep, IdentificationError> {
        let MaximumLikelihood { wrench_timing, robust, .. } = self.likelihood;
        let (fit, _) = self.likelihood.weakly_held(Record::try_new(rows, wrench_timing, robust)?)?;
        let step = FixedLagStep::of(&fit, rows.last().map_or(0, |row| row.time_ns), None)?;
        Ok(FixedLagStep { regularised: true, ..step })
    }
}

/// A window that has been filled, and what filled it.
type Start = (Box<dyn Sliding + Send>, FixedLagStep);

/// A window of any width.
trait Sliding {
    fn push(&mut self, row: &MotionSample) -> Result<Option<FixedLagStep>, IdentificationError>;
    fn noise(&self) -> Noise;
    fn finish(self: Box<Self>) -> Result<LikelihoodEstimate, IdentificationError>;
}

/// Whether the ten parameters are known well enough to go on linearised.
fn is_determined<const W: usize>(fit: &Fit<W>) -> bool {
    let Some(factor) = fit.schur.information.clone().cholesky() else { return false };
    let variance = factor.inverse().diagonal();
    let inertia = fit.eta.inertia.trace() / 3.0;
    let gyration = (inertia / fit.eta.log_mass.exp()).sqrt();
    variance.iter().take(10).enumerate().all(|(i, variance)| {
        let size = match i {
            0 => 1.0,
            1..=3 => gyration,
            _ => inertia,
        };
        *variance < (DETERMINED * size).powi(2)
    })
}

struct Window<const W: usize> {
    settings: FixedLagSettings,
    fit: Fit<W>,
    stream: Stream,
    /// Samples of the segment that is not complete yet.
    pending: Vec<Sample>,
    /// It comes after a gap that is not bridged.
    after_break: bool,
}

impl<const W: usize> Window<W> {
    /// Leaves of the bootstrap what a window holds; `usable` of its samples will not come again. `false` if too few.
    fn settle(&mut self, usable: usize) -> Result<bool, IdentificationError> {
        let Fit { chain, levels, segment_samples: length, .. } = &mut self.fit;
        let segments = chain.starts.len();
        let is_complete = |j: &usize| {
            let (start, end) = (chain.starts[*j], chain.end(*j));
            end <= usable && (j + 1 < segments || end - start == *length || chain.record.doubt_at(start, 0.0).is_some())
        };
        let complete = (0..segments).take_while(is_complete).count();
        if complete == 0 {
            return Ok(false);
        }
        self.pending.reserve(*length);
        let next = chain.end(complete - 1);
        self.pending.extend_from_slice(&chain.record.samples[next..usable]);
        self.after_break = next < usable && chain.record.breaks.contains(&next);
        chain.truncate(complete);
        if let Some(surplus) = complete.checked_sub(self.settings.segments.max(1)).filter(|surplus| *surplus > 0) {
            chain.marginalize(surplus, levels).map_err(not_excited)?;
        }
        chain.shrink();
        Ok(true)
    }

    fn robust(&self, gate: f64) -> Option<Robust> {
        self.settings.likelihood.robust.then_some(Robust { huber: HUBER, gate })
    }

    fn take(&mut self, read: &Read) -> Result<Option<FixedLagStep>, IdentificationError> {
        let mut step = None;
        if (read.doubt.is_some() || read.after_break) && !self.pending.is_empty() {
            step = Some(self.advance(None)?);
        }
        if self.pending.is_empty() {
            self.after_break = read.after_break;
        }
        self.pending.push(read.sample);
        if read.doubt.is_some() || self.pending.len() >= self.fit.segment_samples {
            step = Some(self.advance(read.doubt)?);
        }
        Ok(step)
    }

    /// Takes the pending samples as the next segment.
    fn advance(&mut self, doubt: Option<Vector6<f64>>) -> Result<FixedLagStep, IdentificationError> {
        let gated = self.robust(GATE);
        let node_window_s = self.settings.likelihood.node_window_s;
        let Fit { chain, eta, calibration, levels, .. } = &mut self.fit;
        chain.push(&self.pending, doubt, self.after_break, (eta, calibration), node_window_s);
        self.pending.clear();
        if chain.starts.len() > self.settings.segments.max(1) {
            chain.sweep_alone(0, eta, calibration, levels, gated);
            chain.marginalize(1, levels).map_err(not_excited)?;
        }
        let mut innovation = None;
        for iteration in 0..self.settings.iterations.max(1) {
            // A prediction across a gap may miss everything: the gate must not shut before the first correction.
            let robust = self.robust(if iteration == 0 { f64::INFINITY } else { GATE });
            let Fit { chain, eta, calibration, levels, .. } = &mut self.fit;
            let newest = chain.starts.len() - 1;
            chain.sweep_first(newest, eta, calibration, levels, robust);
            if iteration == 0 {
                let raw = chain.sweep_alone(newest, eta, calibration, levels, None);
                let after = chain.eliminate(levels).map_err(not_excited)?.least();
                let before = chain.eliminate_first(newest, levels).map_err(not_excited)?.least();
                let measured: usize = chain.groups.iter().map(|&group| raw.counted[group]).sum();
                // A state that nothing predicts takes its share.
                let degrees = (3 * measured).saturating_sub(if self.after_break { 12 } else { 0 });
                innovation = after.zip(before).map(|(after, before)| Innovation {
                    nis: after - before,
                    degrees,
                    rejected: 0,
                    wrench: Wrench::zero(),
                });
            }
            let newest = chain.sweep_alone(newest, eta, calibration, levels, robust);
            if let Some(innovation) = &mut innovation {
                innovation.rejected = newest.rejected.into_iter().max().unwrap_or(0);
            }
            self.iterate()?;
        }
        if let (Some(innovation), Some(noise)) = (&mut innovation, self.fit.chain.noise.last()) {
            innovation.wrench = Wrench::from(Vector6::from(*noise));
        }
        self.step(innovation)
    }

    /// One Gauss-Newton step on the segments as swept; gives its squared length in standard deviations.
    fn iterate(&mut self) -> Result<f64, IdentificationError> {
        let Fit { chain, eta, calibration, levels, schur, identifiability, constrained, .. } = &mut self.fit;
        (*schur, *identifiability) = eliminated(chain, calibration, levels)?;
        let step = eta.step(&schur.information, &schur.gradient).ok_or_else(|| not_converged(f64::NAN))?;
        let decrement = step.step.dot(&(&schur.information * &step.step));
        if !decrement.is_finite() {
            return Err(not_converged(decrement));
        }
        chain.follow(&step);
        *eta = step.next;
        *constrained = step.constrained;
        calibration.advance(step.step.as_slice());
        Ok(decrement)
    }

    fn step(&self, innovation: Option<Innovation>) -> Result<FixedLagStep, IdentificationError> {
        FixedLagStep::of(&self.fit, self.stream.time_ns(), innovation)
    }
}

impl FixedLagStep {
    fn of<const W: usize>(
        fit: &Fit<W>,
        time_ns: i64,
        innovation: Option<Innovation>,
    ) -> Result<Self, IdentificationError> {
        let Fit { eta, schur, constrained, .. } = fit;
        let factor = schur.information.clone().cholesky().ok_or_else(|| not_converged(f64::NAN))?;
        let of_eta = factor.inverse().fixed_view::<10, 10>(0, 0).into_owned();
        let by_eta = eta.parameters_by_eta();
        Ok(Self {
            time_ns,
            parameters: eta.parameters(),
            covariance: by_eta * of_eta * by_eta.transpose(),
            std: of_eta.diagonal().map(f64::sqrt),
            active_axis: constrained.then(|| eta.thinnest_axis()),
            regularised: false,
            innovation,
        })
    }
}

fn not_converged(decrement: f64) -> IdentificationError {
    IdentificationError::LikelihoodNotConverged { iterations: 0, decrement }
}

impl<const W: usize> Sliding for Window<W> {
    fn push(&mut self, row: &MotionSample) -> Result<Option<FixedLagStep>, IdentificationError> {
        let read = self.stream.push(row)?;
        self.take(&read)
    }

    fn noise(&self) -> Noise {
        self.fit.levels.noise(&self.fit.chain.groups)
    }

    fn finish(mut self: Box<Self>) -> Result<LikelihoodEstimate, IdentificationError> {
        while let Some(read) = self.stream.flush() {
            self.take(&read)?;
        }
        if !self.pending.is_empty() {
            self.advance(None)?;
        }
        let robust = self.robust(GATE);
        for _ in 0..LAST_ITERATIONS {
            let Fit { chain, eta, calibration, levels, .. } = &mut self.fit;
            chain.sweep(eta, calibration, levels, robust);
            if self.iterate()? < SMALL_DECREMENT {
                break;
            }
        }
        let Fit { chain, eta, calibration, levels, schur, identifiability, sweep, .. } = &mut self.fit;
        *sweep = chain.sweep(eta, calibration, levels, robust);
        (*schur, *identifiability) = eliminated(chain, calibration, levels)?;
        result(&self.fit)
    }
}
