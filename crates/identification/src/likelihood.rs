//! Maximum likelihood from noisy poses and noisy wrenches: multiple shooting with states and wrench noise eliminated.
//!
//! All scalars are `f64`, standard-library mathematics: this is estimation after the fact.

mod calibration;
mod chain;
mod coordinates;
mod elimination;
mod flow;
mod nodes;
mod noise;
mod segment;

pub use calibration::Nuisance;

use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::motion::MotionSample;
use crate::{Noise, WrenchTiming};
use calibration::Calibration;
use chain::{Chain, Sweep};
use coordinates::Coordinates;
use elimination::{Indefinite, Schur};
use flow::Input;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use noise::Levels;
use segment::{MEASUREMENTS, PARAMETERS, Robust, Sample};

/// Iterations after which an estimate that still moves is given up.
const MAX_ITERATIONS: usize = 30;
/// A step whose squared length in standard deviations is below this has converged: a hundredth of a sigma.
const SMALL_DECREMENT: f64 = 1e-4;
/// Largest component of a node's step at convergence (rad, rad/s, m, m/s).
const SMALL_STEP: f64 = 1e-3;
/// Samples of the longest segment.
const LONGEST_SEGMENT: usize = 16;
/// Fewest samples that are tried.
const FEWEST_SAMPLES: usize = 8;

/// Maximum likelihood of the ten parameters from poses and wrenches that are both noisy; rates, velocities and
/// accelerations are used where present.
///
/// The record is cut into segments. Attitude, rate, centre of mass and velocity at each segment's start and one constant
/// error of the wrench over each segment are unknowns beside the ten parameters; they are eliminated segment by segment.
/// Gauss-Newton converges from a sphere of 10 kg: with the motion taken from the poses, one step of the flow is linear in
/// 1/m and the inverse inertia.
///
/// # Source
/// The likelihood of the model of thesis (2.4) with a held wrench; consistency as (5.35)-(5.38), about the centre of mass.
#[derive(Clone, Debug, PartialEq)]
pub struct MaximumLikelihood {
    /// When the logged wrench acts.
    pub wrench_timing: WrenchTiming,
    /// Gravitational acceleration, inertial axes, m/s^2.
    pub gravity_world: Vector3<f64>,
    /// Noise of one sample and axis where it is known; `None` estimates all levels.
    pub noise: Option<Noise>,
    /// What to estimate beside the ten parameters.
    pub nuisances: Vec<Nuisance>,
    /// Whether outliers among the measurements lose their weight.
    pub robust: bool,
    /// Samples in a segment; `None` chooses from the noise found.
    pub segment_samples: Option<usize>,
    /// Poses within this time of a segment's start give its first guess, s.
    pub node_window_s: f64,
    /// Body to start from.
    pub start: InertialParameters<f64>,
}

impl Default for MaximumLikelihood {
    fn default() -> Self {
        Self {
            wrench_timing: WrenchTiming::default(),
            gravity_world: Vector3::zeros(),
            noise: None,
            nuisances: Vec::new(),
            robust: true,
            segment_samples: None,
            node_window_s: 0.6,
            start: InertialParameters::about_com(10.0, Vector3::zeros(), Matrix3::identity() * 0.15),
        }
    }
}

/// One Gauss-Newton iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iteration {
    /// Weighted squares of all residuals before the step.
    pub cost: f64,
    /// Squared length of the parameter step in standard deviations.
    pub decrement: f64,
    /// Largest component by which a segment's end misses the next one's start (rad, rad/s, m, m/s).
    pub largest_defect: f64,
}

/// Value found for a nuisance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NuisanceEstimate {
    /// Which.
    pub nuisance: Nuisance,
    /// Its value.
    pub value: f64,
    /// One standard deviation.
    pub std: f64,
}

/// What [`MaximumLikelihood::estimate`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct LikelihoodEstimate {
    /// The most likely body that exists.
    pub parameters: InertialParameters<f64>,
    /// Most likely parameters if they need not be a body, to first order about [`parameters`](Self::parameters); in the
    /// order of [`InertialParameters::to_vector`].
    pub unconstrained: SVector<f64, 10>,
    /// Covariance of the ten parameters in that order, without the consistency constraint.
    pub covariance: SMatrix<f64, 10, 10>,
    /// One standard deviation of `[ln m, c, J_C (11, 12, 13, 22, 23, 33)]`.
    pub std: SVector<f64, 10>,
    /// Body axis along which the consistency constraint holds the body thick enough; `None` where it is not active.
    pub active_axis: Option<Vector3<f64>>,
    /// The nuisances asked for.
    pub nuisances: Vec<NuisanceEstimate>,
    /// Noise levels used.
    pub noise: Noise,
    /// Weighted squares of all residuals.
    pub cost: f64,
    /// What each iteration did.
    pub iterations: Vec<Iteration>,
    /// Samples in a segment.
    pub segment_samples: usize,
}

impl MaximumLikelihood {
    /// The most likely body for a record.
    ///
    /// # Errors
    /// [`IdentificationError::TooFewSamples`], [`IdentificationError::TimesNotIncreasing`],
    /// [`IdentificationError::MissingColumn`], [`IdentificationError::NotFinite`] for a record that cannot be used;
    /// [`IdentificationError::NotExcited`] where it does not determine the parameters asked for;
    /// [`IdentificationError::LikelihoodNotConverged`].
    pub fn estimate(&self, record: &[MotionSample]) -> Result<LikelihoodEstimate, IdentificationError> {
        let samples = self.samples(record)?;
        match Calibration::new(&self.nuisances).columns() {
            0..=13 => self.run::<32>(&samples),
            14..=21 => self.run::<40>(&samples),
            _ => self.run::<56>(&samples),
        }
    }

    /// The record as the likelihood reads it.
    fn samples(&self, record: &[MotionSample]) -> Result<Vec<Sample>, IdentificationError> {
        use crate::error::Column;
        if record.len() < FEWEST_SAMPLES {
            return Err(IdentificationError::TooFewSamples { samples: record.len(), needed: FEWEST_SAMPLES });
        }
        if let Some(index) = record.windows(2).position(|pair| pair[1].time_ns <= pair[0].time_ns) {
            return Err(IdentificationError::TimesNotIncreasing { index: index + 1 });
        }
        if let Some(row) = record.iter().position(|sample| !is_finite(sample)) {
            return Err(IdentificationError::NotFinite { row });
        }
        // Held until another one is logged; before the first, the first.
        let mut held = record
            .iter()
            .find_map(|sample| sample.wrench_body)
            .ok_or(IdentificationError::MissingColumn(Column::Wrench))?;
        let since = |k: usize| (record[k].time_ns - record[0].time_ns) as f64 * 1e-9;
        let mut samples: Vec<Sample> = Vec::with_capacity(record.len());
        for (k, sample) in record.iter().enumerate() {
            held = sample.wrench_body.unwrap_or(held);
            let next = (k + 1).min(record.len() - 1);
            samples.push(Sample {
                time_s: since(k),
                step_s: (record[next].time_ns - sample.time_ns) as f64 * 1e-9,
                input: Input { torque: held.torque, force: held.force, ..Input::default() },
                position: sample.world_from_body.translation.vector,
                world_from_body: sample.world_from_body.rotation,
                velocity: sample.velocity_origin_world,
                rate: sample.rate_body,
                acceleration: sample.acceleration_origin_body,
            });
        }
        Ok(samples)
    }

    fn run<const W: usize>(&self, samples: &[Sample]) -> Result<LikelihoodEstimate, IdentificationError> {
        let mut levels = Levels::of(&self.noise.unwrap_or_default());
        let length = self.segment_samples.unwrap_or(LONGEST_SEGMENT).max(1);
        let step_s = median_step_s(samples);
        let mut eta = Coordinates::of(&self.start);
        let mut calibration = Calibration::new(&self.nuisances);
        let starts: Vec<usize> = (0..samples.len()).step_by(length).collect();
        let nodes = nodes::from_poses(samples, &starts, self.node_window_s, step_s, &eta.center);
        let mut chain = Chain::<W>::new(samples, self.gravity_world, starts, nodes, &calibration);
        let mut iterations: Vec<Iteration> = Vec::new();
        let mut constrained = false;
        loop {
            let robust = self.robust.then_some(Robust { huber: 2.5, gate: f64::INFINITY });
            let sweep = chain.sweep(&eta, &calibration, &levels, robust);
            let schur = chain.eliminate(&levels).map_err(not_excited)?;
            let step = eta.step(&schur.information, &schur.gradient).ok_or(not_excited(Indefinite))?;
            let decrement = step.step.dot(&(&schur.information * &step.step));
            let largest_step = chain.follow(&schur, &step);
            eta = step.next;
            constrained = step.constrained;
            calibration.advance(step.step.as_slice());
            iterations.push(Iteration { cost: cost(&sweep, &levels), decrement, largest_defect: sweep.largest_defect });
            if decrement < SMALL_DECREMENT && largest_step < SMALL_STEP {
                break;
            }
            if !decrement.is_finite() || iterations.len() >= MAX_ITERATIONS {
                return Err(IdentificationError::LikelihoodNotConverged { iterations: iterations.len(), decrement });
            }
        }
        let robust = self.robust.then_some(Robust { huber: 2.5, gate: f64::INFINITY });
        let sweep = chain.sweep(&eta, &calibration, &levels, robust);
        let schur = chain.eliminate(&levels).map_err(not_excited)?;
        self.result(&chain, &eta, &calibration, &levels, cost(&sweep, &levels), &schur, iterations, constrained)
    }

    fn result<const W: usize>(
        &self,
        chain: &Chain<'_, W>,
        eta: &Coordinates,
        calibration: &Calibration,
        levels: &Levels,
        cost: f64,
        schur: &Schur<W>,
        iterations: Vec<Iteration>,
        constrained: bool,
    ) -> Result<LikelihoodEstimate, IdentificationError> {
        let factor = schur.information.clone().cholesky().ok_or(not_excited(Indefinite))?;
        let covariance = factor.inverse();
        let by_eta = eta.parameters_by_eta();
        let body = covariance.fixed_view::<10, 10>(0, 0).into_owned();
        let pull = factor.solve(&schur.gradient);
        let parameters = eta.parameters();
        let nuisance = |&nuisance: &Nuisance| {
            let column = calibration.lane(nuisance)? - PARAMETERS;
            let std = covariance[(column, column)].sqrt();
            Some(NuisanceEstimate { nuisance, value: calibration.value(nuisance), std })
        };
        Ok(LikelihoodEstimate {
            parameters,
            unconstrained: parameters.to_vector() + by_eta * pull.fixed_rows::<10>(0),
            covariance: by_eta * body * by_eta.transpose(),
            std: body.diagonal().map(f64::sqrt),
            active_axis: constrained.then(|| eta.thinnest_axis()),
            nuisances: self.nuisances.iter().filter_map(nuisance).collect(),
            noise: levels.noise(&chain.groups),
            cost,
            iterations,
            segment_samples: chain.starts.get(1).map_or(1, |second| *second),
        })
    }
}

/// Weighted squares of all residuals, those of the wrench noise included.
fn cost(sweep: &Sweep, levels: &Levels) -> f64 {
    let measured: f64 = (0..MEASUREMENTS).map(|g| sweep.tally.squares[g] / levels.measurements[g].powi(2)).sum();
    measured + sweep.noise_squares.iter().sum::<f64>()
}

fn not_excited(_: Indefinite) -> IdentificationError {
    IdentificationError::NotExcited { rank: 9, expected: 10, smallest_singular_value: 0.0 }
}

fn is_finite(sample: &MotionSample) -> bool {
    let pose = &sample.world_from_body;
    let vectors = [sample.velocity_origin_world, sample.rate_body, sample.acceleration_origin_body];
    let wrench = sample.wrench_body.map(|w| w.torque + w.force);
    let all = |v: &Vector3<f64>| v.iter().all(|x| x.is_finite());
    all(&pose.translation.vector)
        && pose.rotation.coords.iter().all(|x| x.is_finite())
        && vectors.into_iter().chain([wrench]).flatten().all(|v| all(&v))
}

fn median_step_s(samples: &[Sample]) -> f64 {
    let mut steps: Vec<f64> = samples[..samples.len() - 1].iter().map(|sample| sample.step_s).collect();
    let middle = steps.len() / 2;
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod golden;
