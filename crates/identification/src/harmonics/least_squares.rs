//! Weighted least squares on one averaged period, with a covariance that knows of the noise in the motion.

use super::fit::FourierFit;
use super::periodic_record::PeriodicRecord;
use crate::body_scale::BodyScale;
use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::fourier::{MOTION_TERMS, MotionInstant};
use crate::lie::skew;
use crate::square_root_information::SquareRootInformation;
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector};

/// The ten parameters from the regressor of a fitted motion and the averaged wrenches.
///
/// Rows are weighted by the noise of the wrench alone. The noise of the pose is inside the regressor; through the coefficients
/// of the series it is common to all rows, and usually it is what limits the estimate. The covariance holds both to first order.
/// # Source
/// Thesis (4.12), and (4.16) for the residual.
/// # Deviation
/// The covariance of (4.12) counts the noise of the wrench only, a small part of the error here
/// (`covariance_is_honest_about_noise_in_the_motion`).
#[derive(Clone, Debug, PartialEq)]
pub struct PeriodicLeastSquares {
    /// The solution in the order of [`InertialParameters::to_vector`]; not necessarily a body.
    pub parameters: SVector<f64, 10>,
    /// Its covariance, from the noise of wrench and motion.
    pub covariance: SMatrix<f64, 10, 10>,
    /// Wrench by the solution less wrench measured, one sample per row: `[torque; force]`.
    pub residuals: DMatrix<f64>,
    /// Root mean square of the residual over its 6N components, each in units of the noise of the averaged wrench.
    pub normalised_residual: f64,
    /// Root mean square of input power less rate of kinetic energy, W.
    pub power_residual_w: f64,
}

impl PeriodicLeastSquares {
    /// Fits the parameters.
    ///
    /// # Errors
    /// [`IdentificationError::NotExcited`] where the motion does not show all ten, or no wrench acts;
    /// [`IdentificationError::NotFinite`]; [`IdentificationError::NotPositive`] for a standard deviation of the wrench.
    pub fn fit(record: &PeriodicRecord, fit: &FourierFit) -> Result<Self, IdentificationError> {
        let solved = Solved::new(record, fit)?;
        let covariance = solved.covariance(record, fit)?;
        Ok(Self { covariance, ..solved.estimate })
    }

    /// The same without the covariance, which stays zero: what the selection of harmonics compares.
    pub(super) fn compare(record: &PeriodicRecord, fit: &FourierFit) -> Result<Self, IdentificationError> {
        Ok(Solved::new(record, fit)?.estimate)
    }
}

/// The solution before its covariance.
struct Solved {
    estimate: PeriodicLeastSquares,
    instants: Vec<MotionInstant>,
    information: SquareRootInformation<10>,
    magnitudes: SVector<f64, 10>,
    /// One over the variance of each component of the averaged wrench.
    weights: SVector<f64, 6>,
}

impl Solved {
    fn new(record: &PeriodicRecord, fit: &FourierFit) -> Result<Self, IdentificationError> {
        if let Some(index) = (0..6).find(|&i| record.wrench_std[i].is_nan() || record.wrench_std[i] <= 0.0) {
            return Err(IdentificationError::NotPositive { index, value: record.wrench_std[index] });
        }
        let instants = record.felt_motion(&fit.motion)?;
        let magnitudes = rough_scale(record, &instants)?.parameter_magnitudes();
        let whiten = record.wrench_std.map(|std| 1.0 / std);
        let mut information = SquareRootInformation::<10>::new();
        for (i, instant) in instants.iter().enumerate() {
            let mut regressor = instant.regressor();
            for (mut row, factor) in regressor.row_iter_mut().zip(whiten.iter()) {
                row *= *factor;
            }
            information.update(&regressor, &record.wrench(i).component_mul(&whiten))?;
        }
        let parameters = information.solve(&magnitudes)?;
        let mut residuals = DMatrix::zeros(instants.len(), 6);
        let (mut squares, mut power_squares) = (0.0, 0.0);
        for (i, instant) in instants.iter().enumerate() {
            let residual = instant.regressor() * parameters - record.wrench(i);
            squares += residual.component_mul(&whiten).norm_squared();
            let power = instant.angular_velocity_body.dot(&residual.fixed_rows::<3>(0))
                + instant.velocity_origin_body().dot(&residual.fixed_rows::<3>(3));
            power_squares += power * power;
            residuals.set_row(i, &residual.transpose());
        }
        let samples = instants.len() as f64;
        let estimate = PeriodicLeastSquares {
            parameters,
            covariance: SMatrix::zeros(),
            residuals,
            normalised_residual: (squares / (6.0 * samples)).sqrt(),
            power_residual_w: (power_squares / samples).sqrt(),
        };
        Ok(Self { estimate, instants, information, magnitudes, weights: whiten.component_mul(&whiten) })
    }

    /// `A + K S K^T` with A the covariance from the noise of the wrench, S that of the coefficients and
    /// `K = -A G^T W d(G p)/d(coefficients)`, summed up sample by sample.
    fn covariance(
        &self,
        record: &PeriodicRecord,
        fit: &FourierFit,
    ) -> Result<SMatrix<f64, 10, 10>, IdentificationError> {
        let from_wrench = self.information.covariance(&self.magnitudes)?;
        let basis = fit.motion.basis();
        let times_s: Vec<f64> = record.times_s().iter().map(|time_s| time_s + record.wrench_offset_s).collect();
        let tables = basis.table(&times_s);
        let channels = record.channels.ncols();
        let mut response = vec![SVector::<f64, 10>::zeros(); basis.coefficients() * channels];
        for (i, instant) in self.instants.iter().enumerate() {
            let mut weighted = instant.regressor();
            for (mut row, weight) in weighted.row_iter_mut().zip(self.weights.iter()) {
                row *= *weight;
            }
            let gain = from_wrench * weighted.transpose() * wrench_by_motion(&self.estimate.parameters, instant);
            let [by_value, by_rate, by_acceleration] = instant.sensitivities().map(|sensitivity| gain * sensitivity);
            for (coefficient, response) in response.chunks_exact_mut(channels).enumerate() {
                let [value, rate, acceleration] =
                    [&tables[0], &tables[1], &tables[2]].map(|table| table[(i, coefficient)]);
                for (channel, sum) in response.iter_mut().enumerate() {
                    *sum += by_value.column(channel) * value
                        + by_rate.column(channel) * rate
                        + by_acceleration.column(channel) * acceleration;
                }
            }
        }
        let mut covariance = from_wrench;
        for (coefficient, responses) in response.chunks_exact(channels).enumerate() {
            for (channel, response) in responses.iter().enumerate() {
                let std = fit.coefficient_std[(coefficient, channel)];
                covariance += response * response.transpose() * (std * std);
            }
        }
        Ok((covariance + covariance.transpose()) * 0.5)
    }
}

/// Derivative of the wrench of a body by the motion terms `[angular velocity; angular acceleration; acceleration of the origin;
/// velocity of the origin]`, body axes.
///
/// # Source
/// The derivative of thesis (4.8) times the parameters.
pub(super) fn wrench_by_motion(
    parameters: &SVector<f64, 10>,
    instant: &MotionInstant,
) -> SMatrix<f64, 6, MOTION_TERMS> {
    let body = InertialParameters::from_vector(parameters);
    let (inertia, moment) = (body.inertia_about_origin, body.first_moment);
    let rate = instant.angular_velocity_body;
    let mut derivative = SMatrix::<f64, 6, MOTION_TERMS>::zeros();
    let mut set = |row: usize, column: usize, block: Matrix3<f64>| {
        derivative.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
    };
    set(0, 0, skew(&rate) * inertia - skew(&(inertia * rate)));
    set(0, 3, inertia);
    set(0, 6, skew(&moment));
    set(3, 0, -skew(&rate.cross(&moment)) - skew(&rate) * skew(&moment));
    set(3, 3, -skew(&moment));
    set(3, 6, Matrix3::identity() * body.mass);
    derivative
}

/// Mass and length from the sizes of wrench and acceleration, to compare directions by before the body is known.
fn rough_scale(record: &PeriodicRecord, instants: &[MotionInstant]) -> Result<BodyScale, IdentificationError> {
    let mut squares = [0.0; 4];
    for (i, instant) in instants.iter().enumerate() {
        let wrench = record.wrench(i);
        squares[0] += wrench.fixed_rows::<3>(0).norm_squared();
        squares[1] += wrench.fixed_rows::<3>(3).norm_squared();
        squares[2] += instant.angular_acceleration_body.norm_squared();
        squares[3] += instant.acceleration_origin_body().norm_squared();
    }
    let [torque, force, angular, linear] = squares.map(f64::sqrt);
    let mass_kg = force / linear;
    BodyScale::try_new(mass_kg, (torque / angular / mass_kg).sqrt()).map_err(|_| IdentificationError::NotExcited {
        rank: 8,
        expected: 10,
        smallest_singular_value: 0.0,
    })
}
