//! Weighted least squares on one averaged period, with a covariance that knows of the noise in the motion.

use super::fit::FourierFit;
use super::joint_information::{BasisTable, WrenchRows};
use super::periodic_record::PeriodicRecord;
use crate::body_scale::BodyScale;
use crate::error::IdentificationError;
use crate::identify::rough_scale;
use crate::square_root_information::SquareRootInformation;
use crate::weighted_least_squares::WrenchRow;
use nalgebra::{SMatrix, SVector};

/// The ten parameters from the regressor of a fitted motion and the averaged wrenches.
///
/// Rows are weighted by the noise of the wrench alone. The noise of the pose is inside the regressor; through the coefficients
/// of the series it is common to all rows, and usually it is what limits the estimate. The covariance holds both to first order.
///
/// It holds neither the harmonics that the motion has and the series lacks nor the bias that noise in a regressor brings. A motion
/// flown by a robot that does not know its load has such harmonics, and the errors are then twice the stated sigmas and more, also
/// where the residual does not show it (`cargo xtask study excitation`); [`maximum_likelihood`](super::maximum_likelihood) holds both.
/// # Source
/// Thesis (4.12), and (4.16) for the residual.
/// # Deviation
/// The covariance of (4.12) counts the noise of the wrench only, a small part of the error here
/// (`covariance_is_honest_about_noise_in_the_motion`).
#[derive(Clone, Debug, PartialEq)]
pub struct PeriodicLeastSquares {
    /// The solution in the order of [`InertialParameters::to_vector`](crate::dynamics::InertialParameters::to_vector); not necessarily a body.
    pub parameters: SVector<f64, 10>,
    /// Its covariance, from the noise of wrench and motion.
    pub covariance: SMatrix<f64, 10, 10>,
    /// Root mean square of the residual over its 6N components, each in units of the noise of the averaged wrench.
    pub normalised_residual: f64,
    /// What the noise of wrench and motion lets expect of it.
    pub expected_residual: f64,
    /// Root mean square of input power less rate of kinetic energy, W.
    pub power_residual_w: f64,
    /// Mass and length in whose units the ten parameters are compared: those of the solution, or rough ones where it has none.
    pub scale: BodyScale,
    /// The two residuals that a body of nothing would leave.
    pub(super) without_body: [f64; 2],
}

impl PeriodicLeastSquares {
    /// Fits the parameters.
    ///
    /// # Errors
    /// [`IdentificationError::NotExcited`] where the motion does not show all ten, or no wrench acts;
    /// [`IdentificationError::NotFinite`]; [`IdentificationError::AttitudeUndefined`]; [`IdentificationError::NotPositive`] for a standard deviation of the wrench.
    pub fn fit(record: &PeriodicRecord, fit: &FourierFit) -> Result<Self, IdentificationError> {
        let solved = Solved::new(record, fit)?;
        let (covariance, expected_residual) = solved.covariance()?;
        require_known(&covariance, solved.estimate.scale)?;
        Ok(Self { covariance, expected_residual, ..solved.estimate })
    }

    /// The same without the covariance, which stays zero: what the selection of harmonics compares.
    pub(super) fn compare(record: &PeriodicRecord, fit: &FourierFit) -> Result<Self, IdentificationError> {
        Ok(Solved::new(record, fit)?.estimate)
    }
}

/// The solution before its covariance.
struct Solved<'a> {
    record: &'a PeriodicRecord,
    fit: &'a FourierFit,
    table: BasisTable,
    information: SquareRootInformation<10>,
    magnitudes: SVector<f64, 10>,
    estimate: PeriodicLeastSquares,
}

impl<'a> Solved<'a> {
    fn new(record: &'a PeriodicRecord, fit: &'a FourierFit) -> Result<Self, IdentificationError> {
        if let Some(index) = (0..6).find(|&i| record.wrench_std[i].is_nan() || record.wrench_std[i] <= 0.0) {
            return Err(IdentificationError::NotPositive { index, value: record.wrench_std[index] });
        }
        let table = record.wrench_table(fit.motion.basis());
        let instants = table.instants(fit.motion.chart(), fit.motion.coefficients()).enumerate();
        let rows = instants.map(|(index, (instant, _))| {
            let regressor =
                instant.ok_or(IdentificationError::AttitudeUndefined { time_s: record.time_s(index) })?.regressor();
            Ok(WrenchRow { index, regressor, wrench: record.wrench(index) })
        });
        let rows = rows.collect::<Result<Vec<_>, IdentificationError>>()?;
        let whiten = record.wrench_std.map(|std| 1.0 / std);
        let mut information = SquareRootInformation::<10>::new();
        for row in &rows {
            let mut regressor = row.regressor;
            for (mut row, factor) in regressor.row_iter_mut().zip(whiten.iter()) {
                row *= *factor;
            }
            information.update(&regressor, &row.wrench.component_mul(&whiten))?;
        }
        let scale = rough_scale(&rows)?;
        let magnitudes = scale.parameter_magnitudes();
        let parameters = information.solve(&magnitudes)?;
        if parameters == SVector::<f64, 10>::zeros() {
            // Without any wrench two scales stay free: that of the mass and that of the inertia about the centre of mass.
            return Err(IdentificationError::NotExcited { rank: 8, expected: 10, smallest_singular_value: 0.0 });
        }
        // Sums of squares of the wrench and of the power: left over, and altogether.
        let (mut left, mut all) = ([0.0; 2], [0.0; 2]);
        let instants = table.instants(fit.motion.chart(), fit.motion.coefficients());
        for (row, instant) in rows.iter().zip(instants.filter_map(|(instant, _)| instant)) {
            let twist = [instant.angular_velocity_body, instant.velocity_origin_body()];
            let squares = |wrench: &SVector<f64, 6>| {
                let power = twist[0].dot(&wrench.fixed_rows::<3>(0)) + twist[1].dot(&wrench.fixed_rows::<3>(3));
                [wrench.component_mul(&whiten).norm_squared() / 6.0, power * power]
            };
            for (sums, wrench) in [(&mut left, row.regressor * parameters - row.wrench), (&mut all, row.wrench)] {
                for (sum, square) in sums.iter_mut().zip(squares(&wrench)) {
                    *sum += square / rows.len() as f64;
                }
            }
        }
        let [normalised_residual, power_residual_w] = left.map(f64::sqrt);
        let estimate = PeriodicLeastSquares {
            parameters,
            covariance: SMatrix::zeros(),
            normalised_residual,
            expected_residual: 1.0,
            power_residual_w,
            scale: BodyScale::of(&parameters).unwrap_or(scale),
            without_body: all.map(f64::sqrt),
        };
        Ok(Self { record, fit, table, information, magnitudes, estimate })
    }

    /// `A + K S K^T` with A the covariance from the noise of the wrench, S that of the coefficients and
    /// `K = -A G^T W d(G p)/d(coefficients)`, summed up sample by sample. And the root mean square of the whitened residual that
    /// this noise makes.
    fn covariance(&self) -> Result<(SMatrix<f64, 10, 10>, f64), IdentificationError> {
        let from_wrench = self.information.covariance(&self.magnitudes)?;
        let motion = &self.fit.motion;
        let channels = 3 + motion.chart().channels();
        let mut noise = 0.0;
        let mut response = vec![SVector::<f64, 10>::zeros(); motion.basis().coefficients() * channels];
        for (instant, functions) in self.table.instants(motion.chart(), motion.coefficients()) {
            let Some(instant) = instant else { continue };
            let rows = WrenchRows::new(&instant, &self.estimate.parameters, &self.record.wrench_std);
            let gain = from_wrench * rows.regressor.transpose();
            let by_channel = rows.by_channel.map(|block| gain * block);
            for (coefficient, response) in response.chunks_exact_mut(channels).enumerate() {
                for (channel, sum) in response.iter_mut().enumerate() {
                    for (block, functions) in by_channel.iter().zip(functions) {
                        *sum += block.column(channel) * functions[coefficient];
                    }
                    let std = self.fit.coefficient_std[(coefficient, channel)];
                    noise += rows.by_coefficient(channel, coefficient, functions).norm_squared() * std * std;
                }
            }
        }
        let mut covariance = from_wrench;
        for (coefficient, responses) in response.chunks_exact(channels).enumerate() {
            for (channel, response) in responses.iter().enumerate() {
                let std = self.fit.coefficient_std[(coefficient, channel)];
                covariance += response * response.transpose() * (std * std);
            }
        }
        let expected_residual = (1.0 + noise / (6 * self.record.samples()) as f64).sqrt();
        Ok(((covariance + covariance.transpose()) * 0.5, expected_residual))
    }
}

/// Refuses where one sigma of a direction is above the body's own scale: noise in the motion passes for motion there.
fn require_known(covariance: &SMatrix<f64, 10, 10>, scale: BodyScale) -> Result<(), IdentificationError> {
    let magnitudes = scale.parameter_magnitudes();
    let like = SMatrix::<f64, 10, 10>::from_fn(|i, j| covariance[(i, j)] / (magnitudes[i] * magnitudes[j]));
    let variances = like.symmetric_eigenvalues();
    let rank = variances.iter().filter(|&&variance| variance < 1.0).count();
    if rank == 10 {
        return Ok(());
    }
    let smallest_singular_value = (variances.min().max(0.0) / variances.max()).sqrt();
    Err(IdentificationError::NotExcited { rank, expected: 10, smallest_singular_value })
}
