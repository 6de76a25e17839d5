//! Maximum likelihood of one averaged period: all coefficients of the motion and the ten parameters at once.

use super::fit::Circle;
use super::joint_information::{BasisTable, JointInformation, WrenchRows};
use super::{FourierFit, PeriodicRecord};
use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::fourier::FourierMotion;
use crate::identify::{constrained, rough_scale};
use crate::jacobi::singular_values;
use crate::weighted_least_squares::WrenchRow;
use crate::{BodyScale, Estimate, RANK_TOLERANCE, SquareRootInformation};
use nalgebra::{DMatrix, SVector};

/// Iterations after which an estimate that still moves is given up.
const MAX_ITERATIONS: usize = 60;
/// A step of this squared length in standard deviations has converged: a thousandth of a sigma.
const SMALL_DECREMENT: f64 = 1e-6;
/// Halvings of one step.
const HALVINGS: i32 = 12;
/// A cost known to this is good enough to compare numbers of harmonics, each of which must gain twelve.
const SCOUTED: f64 = 0.1;
/// Steps after which a number of harmonics is left for the next.
const SCOUT_STEPS: usize = 4;
/// Changes below this fraction of a cost are rounding.
const ROUNDING: f64 = 1e-12;
/// No measurement is taken to be better than this fraction of the root mean square of its kind.
const FLOOR: f64 = 1e-9;
/// A direction counts as shown when no more than this share of its signal is noise of the poses.
const LARGEST_NOISE_SHARE: f64 = 0.1;
/// Samples at which that share is judged, at most about twice as many.
const JUDGED_SAMPLES: usize = 64;

/// The likeliest body and motion of a [`PeriodicRecord`].
#[derive(Clone, Debug, PartialEq)]
pub struct PeriodicLikelihood {
    /// The likeliest body that exists; its covariance is that of the ten parameters with the motion unknown too.
    pub estimate: Estimate,
    /// The likeliest motion.
    pub motion: FourierMotion,
    /// Weighted squares of all residuals, of poses and wrenches.
    pub cost: f64,
    /// Independent residuals less unknowns. The length of a quaternion is neither.
    pub degrees_of_freedom: usize,
    /// The part of the cost at the harmonics of motion and wrench, the wrench's up to twice as many: where noise of many samples is little,
    /// and what no body explains stands out.
    pub harmonic_cost: f64,
    /// Independent residuals there less unknowns.
    pub harmonic_degrees_of_freedom: usize,
    /// Iterations until the step was shorter than a thousandth of a standard deviation.
    pub iterations: usize,
}

impl PeriodicLikelihood {
    /// Cost per degree of freedom: one where noise and number of harmonics are as stated. Without meaning for data that
    /// were said to have no noise.
    pub fn reduced_chi_square(&self) -> f64 {
        self.cost / self.degrees_of_freedom as f64
    }
}

/// Minimises `sum |channels - series|^2 / channel variance + |wrench - gamma(series) pi|^2 / wrench variance` over all
/// coefficients of the motion and the ten parameters pi, these kept physically consistent.
///
/// Starts from least squares on the Fourier fit, which noise in the poses biases; here the wrenches correct the motion.
/// Each step folds the linearised equations into one triangle, eliminates the coefficients, solves for the body inside
/// the cone of consistent ones and is shortened until the cost falls.
///
/// Standard deviations of zero are taken as 1e-9 of the root mean square of their kind.
/// # Errors
/// [`IdentificationError::TooManyHarmonics`], [`IdentificationError::RecordShape`], [`IdentificationError::NotFinite`]
/// naming the sample, also where the fitted quaternion is zero,
/// [`IdentificationError::NotPositive`] for a standard deviation that is negative or NaN,
/// [`IdentificationError::NotExcited`] where the motion, less its noise, does not show all ten parameters,
/// [`IdentificationError::LikelihoodNotConverged`].
/// # Source
/// Thesis (4.6), (4.12), (4.13).
/// # Deviation
/// The thesis keeps the motion of the Fourier fit; its error biases and scatters the parameters
/// (`tests/suite/periodic_likelihood.rs`, `attains_the_bound_where_least_squares_does_not`).
pub fn maximum_likelihood(
    record: &PeriodicRecord,
    harmonics: usize,
) -> Result<PeriodicLikelihood, IdentificationError> {
    let problem = Problem::new(record, harmonics)?;
    let start = problem.least_squares()?;
    problem.settle(start, MAX_ITERATIONS)
}

/// Work of one step of [`maximum_likelihood`], in multiplications: six rows a sample, folded into a triangle of all unknowns.
pub(super) fn step_work(record: &PeriodicRecord, harmonics: usize) -> f64 {
    let unknowns = ((3 + record.chart.channels()) * (2 * harmonics + 1) + 10) as f64;
    6.0 * record.samples() as f64 * unknowns * unknowns
}

/// Refuses where the motion of the Fourier fit, less its noise, does not show all ten parameters: what [`maximum_likelihood`] asks at its
/// end, for the work of one step.
pub(super) fn require_shown(record: &PeriodicRecord, harmonics: usize) -> Result<(), IdentificationError> {
    let problem = Problem::new(record, harmonics)?;
    let guess = problem.least_squares()?;
    let mut information = problem.information(guess.motion.coefficients(), &guess.parameters);
    information.of_body()?;
    problem.require_excited(guess.motion.coefficients(), guess.scale, Some(&information))
}

/// A motion and a body on the way to the likeliest.
#[derive(Clone)]
pub(super) struct Guess {
    motion: FourierMotion,
    parameters: SVector<f64, 10>,
    /// In whose units the parameters are compared, the same all the way.
    scale: BodyScale,
    pub(super) cost: f64,
}

/// What the equations about a guess say.
struct Step {
    /// Along the step, shortened until the cost did not rise; `None` where it always does.
    next: Option<Guess>,
    /// Squared length of the whole step in standard deviations: by so much the cost of a linear problem falls.
    decrement: f64,
    estimate: Estimate,
    information: JointInformation,
}

/// A record, what is constant about it, and what its noise is taken to be.
pub(super) struct Problem {
    /// With standard deviations above their floors.
    record: PeriodicRecord,
    fit: FourierFit,
    /// Weighted squares of what no coefficients explain.
    unexplained: f64,
    /// At the times of the wrenches.
    table: BasisTable,
}

impl Problem {
    pub(super) fn new(record: &PeriodicRecord, harmonics: usize) -> Result<Self, IdentificationError> {
        let (samples, channels) = (record.samples(), 3 + record.chart.channels());
        record.validated()?;
        let mut record = record.clone();
        let floor = |table: &DMatrix<f64>, columns: core::ops::Range<usize>| {
            FLOOR * (table.columns_range(columns).norm_squared() / samples as f64).sqrt().max(FLOOR)
        };
        let channel_floor = [floor(&record.channels, 0..3), floor(&record.channels, 3..channels)];
        for (channel, std) in record.channel_std.iter_mut().enumerate() {
            *std = std.max(channel_floor[usize::from(channel >= 3)]);
        }
        let wrench_floor = [floor(&record.wrenches, 0..3), floor(&record.wrenches, 3..6)];
        for (component, std) in record.wrench_std.iter_mut().enumerate() {
            *std = std.max(wrench_floor[component / 3]);
        }
        let fit = FourierFit::new(&record, harmonics)?;
        let basis = fit.motion.basis();
        let [values, ..] = basis.table(&record.times_s());
        let residuals = &record.channels - values * fit.motion.coefficients();
        let channels = residuals.column_iter().zip(&record.channel_std);
        let unexplained = channels.map(|(residual, std)| residual.norm_squared() / (std * std)).sum();
        let table = record.wrench_table(basis);
        Ok(Self { record, fit, unexplained, table })
    }

    /// The least cost to about a tenth, from the solution of fewer harmonics, where there is one: mostly a step or two. Where it takes
    /// more, a cost that is not yet the least; numbers so far from the data are none to choose.
    pub(super) fn scout(&self, fewer: Option<&Guess>, work: &mut f64) -> Result<Guess, IdentificationError> {
        let mut guess = match fewer {
            Some(fewer) => self.guess(fewer.motion.extended_to(self.harmonics()), fewer.parameters, fewer.scale),
            None => self.least_squares()?,
        };
        for _ in 0..SCOUT_STEPS {
            *work += step_work(&self.record, self.harmonics());
            let Step { next, decrement, .. } = self.step(&guess)?;
            let Some(next) = next else { break };
            // A cost that falls as that of a linear problem is at its least.
            let unexpected = (guess.cost - next.cost - decrement).abs();
            let arrived = unexpected.min(decrement) < SCOUTED.max(ROUNDING * guess.cost);
            guess = next;
            if arrived {
                break;
            }
        }
        Ok(guess)
    }

    /// Cost of a guess per degree of freedom.
    pub(super) fn reduced_chi_square(&self, guess: &Guess) -> f64 {
        guess.cost / self.degrees_of_freedom() as f64
    }

    /// The likeliest motion and body, from a guess.
    pub(super) fn settle(&self, mut guess: Guess, most: usize) -> Result<PeriodicLikelihood, IdentificationError> {
        let mut iterations = 0;
        loop {
            iterations += 1;
            let Step { next, decrement, estimate, information } = self.step(&guess)?;
            let settled = decrement < SMALL_DECREMENT.max(ROUNDING * guess.cost);
            if settled || next.is_none() || iterations == most {
                // Noise in the poses shows a direction that the motion does not, and leads anywhere along it.
                self.require_excited(guess.motion.coefficients(), guess.scale, Some(&information))?;
            }
            match next {
                Some(next) if settled || iterations < most => guess = next,
                _ => return Err(IdentificationError::LikelihoodNotConverged { iterations, decrement }),
            }
            if settled {
                let (harmonic_cost, harmonic_degrees_of_freedom) = self.harmonic_cost(&guess);
                return Ok(PeriodicLikelihood {
                    estimate: Estimate { parameters: InertialParameters::from_vector(&guess.parameters), ..estimate },
                    motion: guess.motion,
                    cost: guess.cost,
                    degrees_of_freedom: self.degrees_of_freedom(),
                    harmonic_cost,
                    harmonic_degrees_of_freedom,
                    iterations,
                });
            }
        }
    }

    /// One step of Gauss and Newton.
    fn step(&self, guess: &Guess) -> Result<Step, IdentificationError> {
        let coefficients = guess.motion.coefficients();
        let mut information = self.information(coefficients, &guess.parameters);
        let estimate = constrained(&information.of_body()?, guess.scale)?;
        let found = estimate.parameters.to_vector();
        let (change, step) = (information.coefficients(&found), found - guess.parameters);
        let decrement = information.squared_length(&change, &step);
        let limit = guess.cost * (1.0 + ROUNDING) + SMALL_DECREMENT;
        let mut next = None;
        for halving in 0..HALVINGS {
            let length = 0.5_f64.powi(halving);
            let (basis, moved) = (*guess.motion.basis(), coefficients + &change * length);
            let motion = FourierMotion::try_new(basis, self.record.chart, moved)?;
            let tried = self.guess(motion, guess.parameters + step * length, guess.scale);
            if tried.cost <= limit {
                next = Some(tried);
                break;
            }
        }
        Ok(Step { next, decrement, estimate, information })
    }

    fn guess(&self, motion: FourierMotion, parameters: SVector<f64, 10>, scale: BodyScale) -> Guess {
        Guess { cost: self.cost(motion.coefficients(), &parameters), motion, parameters, scale }
    }

    fn harmonics(&self) -> usize {
        self.fit.motion.basis().harmonics()
    }

    fn whitened_wrench(&self, sample: usize) -> SVector<f64, 6> {
        self.record.wrench(sample).component_div(&self.record.wrench_std)
    }

    /// A channel holds one number per sample beside three of position and three of rotation, however many the chart has.
    fn degrees_of_freedom(&self) -> usize {
        (12 * self.record.samples()).saturating_sub(6 * self.fit.motion.basis().coefficients() + 10).max(1)
    }

    /// Weighted squares at the harmonics, and how many of them are free: as many coefficients as there are of the poses are unknown.
    fn harmonic_cost(&self, guess: &Guess) -> (f64, usize) {
        let samples = self.record.samples();
        let circle = Circle::new(samples);
        let harmonics = (2 * self.harmonics()).min(samples.saturating_sub(1) / 2);
        let instants = self.table.instants(self.record.chart, guess.motion.coefficients()).enumerate();
        let left: Vec<SVector<f64, 6>> = instants
            .filter_map(|(i, (instant, _))| Some(instant?.regressor() * guess.parameters - self.record.wrench(i)))
            .map(|left| left.component_div(&self.record.wrench_std))
            .collect();
        let mut cost = self.cost_of_poses(guess.motion.coefficients());
        for component in 0..6 {
            let series: Vec<f64> = left.iter().map(|left| left[component]).collect();
            for harmonic in 0..=harmonics {
                let (cosine, sine) = circle.amplitudes(&series, harmonic);
                let variance = if harmonic == 0 { 1.0 } else { 2.0 } / samples as f64;
                cost += (cosine * cosine + sine * sine) / variance;
            }
        }
        (cost, (6 * (2 * harmonics + 1)).saturating_sub(10).max(1))
    }

    fn cost_of_poses(&self, coefficients: &DMatrix<f64>) -> f64 {
        (coefficients - self.fit.motion.coefficients()).component_div(&self.fit.coefficient_std).norm_squared()
    }

    /// Infinite where a quaternion passes through zero.
    fn cost(&self, coefficients: &DMatrix<f64>, parameters: &SVector<f64, 10>) -> f64 {
        let poses = self.cost_of_poses(coefficients);
        let instants = self.table.instants(self.record.chart, coefficients).enumerate();
        let wrenches = instants.map(|(i, (instant, _))| {
            instant.map_or(f64::INFINITY, |instant| {
                let residual = instant.regressor() * parameters - self.record.wrench(i);
                residual.component_div(&self.record.wrench_std).norm_squared()
            })
        });
        self.unexplained + poses + wrenches.sum::<f64>()
    }

    /// The equations about a motion and a body; the unknowns are changes of the coefficients, and the ten parameters.
    fn information(&self, coefficients: &DMatrix<f64>, parameters: &SVector<f64, 10>) -> JointInformation {
        let mut information =
            JointInformation::of_poses(&self.fit.coefficient_std, &(self.fit.motion.coefficients() - coefficients));
        for (i, (instant, functions)) in self.table.instants(self.record.chart, coefficients).enumerate() {
            // Only motions of finite cost come here.
            let Some(instant) = instant else { continue };
            let rows = WrenchRows::new(&instant, parameters, &self.record.wrench_std);
            information.add(&rows, functions, &self.whitened_wrench(i));
        }
        information
    }

    /// The Fourier fit with the consistent body that suits it best.
    fn least_squares(&self) -> Result<Guess, IdentificationError> {
        let instants = self.table.instants(self.record.chart, self.fit.motion.coefficients()).enumerate();
        let rows: Vec<WrenchRow> = instants
            .map(|(index, (instant, _))| {
                let regressor = instant.ok_or(IdentificationError::NotFinite { row: index })?.regressor();
                Ok(WrenchRow { index, regressor, wrench: self.record.wrench(index) })
            })
            .collect::<Result<_, IdentificationError>>()?;
        let scale = rough_scale(&rows)?;
        self.require_excited(self.fit.motion.coefficients(), scale, None)?;
        let information = self.of_known_motion(self.fit.motion.coefficients())?;
        let parameters = constrained(&information, scale)?.parameters.to_vector();
        Ok(self.guess(self.fit.motion.clone(), parameters, BodyScale::of(&parameters)?))
    }

    /// What the wrenches would say of the body if the motion were known.
    fn of_known_motion(&self, coefficients: &DMatrix<f64>) -> Result<SquareRootInformation<10>, IdentificationError> {
        let mut information = SquareRootInformation::new();
        for (i, (instant, _)) in self.table.instants(self.record.chart, coefficients).enumerate() {
            let Some(instant) = instant else { continue };
            let mut regressor = instant.regressor();
            for (row, std) in self.record.wrench_std.iter().enumerate() {
                regressor.row_mut(row).unscale_mut(*std);
            }
            information.update(&regressor, &self.whitened_wrench(i))?;
        }
        Ok(information)
    }

    /// Counts the directions of the ten parameters that a motion shows, above rounding and, where the motion is known as
    /// well as `joint` says, above what is noise in it.
    fn require_excited(
        &self,
        coefficients: &DMatrix<f64>,
        scale: BodyScale,
        joint: Option<&JointInformation>,
    ) -> Result<(), IdentificationError> {
        let magnitudes = scale.parameter_magnitudes();
        let information = self.of_known_motion(coefficients)?;
        let (values, right) = singular_values(information.scaled_factor(&magnitudes));
        let every = self.record.samples() / JUDGED_SAMPLES + 1;
        let noise = |joint: &JointInformation, direction: usize| {
            let body = right.column(direction).component_mul(&magnitudes);
            let instants = self.table.instants(self.record.chart, coefficients).step_by(every);
            let scatter = instants.map(|(instant, functions)| {
                let rows = instant.map(|instant| WrenchRows::new(&instant, &body, &self.record.wrench_std));
                rows.map_or(0.0, |rows| joint.scatter(&rows, functions))
            });
            scatter.sum::<f64>() * every as f64
        };
        let shown = |direction: usize| {
            values[direction] > RANK_TOLERANCE * values[0]
                && joint.is_none_or(|joint| noise(joint, direction) < LARGEST_NOISE_SHARE * values[direction].powi(2))
        };
        let rank = (0..10).filter(|&direction| shown(direction)).count();
        if rank == 10 {
            return Ok(());
        }
        let smallest_singular_value = if values[0] > 0.0 { values[9] / values[0] } else { 0.0 };
        Err(IdentificationError::NotExcited { rank, expected: 10, smallest_singular_value })
    }
}
