//! Weighted least squares on stacked wrench rows, with a covariance that holds for correlated and noisy rows.

use crate::body_scale::BodyScale;
use crate::error::IdentificationError;
use crate::regressors::{Regressor, newton_euler};
use crate::square_root_information::SquareRootInformation;
use nalgebra::{Matrix6, SMatrix, SVector, Vector3, Vector6};
use std::collections::HashMap;

/// Six equations `regressor * parameters = wrench` about one node of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchRow {
    /// Number of the node's sample; rows are correlated according to the distance of their nodes.
    pub index: usize,
    /// Regressor at the node.
    pub regressor: Regressor<f64>,
    /// Measured right-hand side `[torque; force]`.
    pub wrench: Vector6<f64>,
}

/// What is known about the noise of rows before the fit.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct RowNoise {
    /// Nodes further apart than this have independent noise.
    pub correlation_length: usize,
    /// Variance of each component of the angular acceleration inside a regressor, (rad/s^2)^2.
    pub angular_acceleration_variance: f64,
    /// Variance of each component of the origin's acceleration inside a regressor, (m/s^2)^2.
    pub acceleration_variance: f64,
}

/// Weighted least squares, or its instrumental-variable form, over wrench rows.
///
/// Torque and force rows are weighted with the standard deviations of their own residuals, found by iteration. The
/// covariance does not assume independent rows: the autocovariance of the residual, a 6x6 matrix for every distance up
/// to the correlation length, is estimated and carried through (held wrenches and extrapolation make neighbours share
/// samples: a moving average). Checked by Monte Carlo in `tests/suite/identify_properties.rs`.
///
/// With `instruments` the rows at the next node, whose poses are other poses, stand in for the noisy regressor on the
/// left of the normal equations. Noise that is independent from sample to sample then averages out where plain least
/// squares is attenuated. Whether it is shows by how far the solution moves with the rows `instruments` nodes away.
///
/// # Source
/// Thesis (2.20), (4.12).
///
/// # Deviation
/// The print calls `Sigma^-1` the covariance of the wrench; it is the weight, and Sigma the covariance. The covariance of
/// the estimate does not rest on independent rows, as the print does
/// (`tests/suite/identify_properties.rs`, `covariance_is_honest_under_wrench_noise`).
#[derive(Clone, Debug, PartialEq)]
pub struct WeightedLeastSquares {
    /// Whitened rows, taken as independent.
    pub information: SquareRootInformation<10>,
    /// The solution.
    pub parameters: SVector<f64, 10>,
    /// Its covariance.
    pub covariance: SMatrix<f64, 10, 10>,
    /// By how much the solution moves with instruments so far away that noise which is alike over some samples averages out
    /// too: an error to be expected, where it is more than chance. Zero without instruments.
    pub instrument_shift: SVector<f64, 10>,
    /// What noise in the regressors adds to the information matrix on average; subtract it to see the signal.
    pub noise_information: SMatrix<f64, 10, 10>,
    /// Standard deviation of the torque residual of a row, N m.
    pub torque_residual: f64,
    /// Standard deviation of the force residual of a row, N.
    pub force_residual: f64,
}

/// Rounds of reweighting; the second already changes nothing visible.
const REWEIGHTINGS: usize = 3;
/// Residuals are not believed below this fraction of the wrench: rounding.
const ROUNDING: f64 = 1e-13;

impl WeightedLeastSquares {
    /// Fits all rows. `rows` in ascending order of `index`.
    ///
    /// # Errors
    /// [`IdentificationError::NotExcited`] where the rows do not determine ten parameters, with
    /// [`WeightedLeastSquares::information`] available through [`whitened`].
    pub fn fit(
        rows: &[WrenchRow],
        scale: BodyScale,
        noise: &RowNoise,
        instruments: Option<usize>,
    ) -> Result<Self, IdentificationError> {
        let magnitudes = scale.parameter_magnitudes();
        let (mut torque, mut force) = (scale.length_m(), 1.0);
        let floor = ROUNDING * rms(rows, |row| row.wrench, scale.length_m());
        let mut information = whitened(rows, torque, force)?;
        let mut parameters = information.solve(&magnitudes)?;
        let freedom = (6 * rows.len()) as f64 / (6 * rows.len()).saturating_sub(10).max(1) as f64;
        for _ in 0..REWEIGHTINGS {
            let (t, f) = residual_sums(rows, &parameters);
            let per_group = |sum: f64| (freedom * sum / (3 * rows.len()) as f64).sqrt();
            (torque, force) = (
                per_group(t).max(floor * scale.length_m()).max(f64::MIN_POSITIVE.sqrt()),
                per_group(f).max(floor).max(f64::MIN_POSITIVE.sqrt()),
            );
            information = whitened(rows, torque, force)?;
            parameters = information.solve(&magnitudes)?;
        }
        let weights = weights(torque, force);
        let position: HashMap<usize, usize> = rows.iter().enumerate().map(|(i, row)| (row.index, i)).collect();
        let at = |index: Option<usize>| index.and_then(|index| position.get(&index)).map(|&i| &rows[i].regressor);
        // The left factor of the normal equations for each row: its own regressor, or those of its neighbours.
        let left_with = |apart: Option<usize>| -> Vec<Regressor<f64>> {
            let of_row = |row: &WrenchRow| {
                let Some(apart) = apart else { return scaled(&weights, &row.regressor) };
                let neighbours = [at(row.index.checked_sub(apart)), at(Some(row.index + apart))];
                scaled(&weights, &neighbours.into_iter().flatten().fold(Regressor::zeros(), |sum, other| sum + other))
            };
            rows.iter().map(of_row).collect()
        };
        let to_scaled = SMatrix::<f64, 10, 10>::from_diagonal(&magnitudes);
        let solved = |left: &[Regressor<f64>]| {
            let mut normal = SMatrix::<f64, 10, 10>::zeros();
            let mut moment = SVector::<f64, 10>::zeros();
            for (left, row) in left.iter().zip(rows) {
                normal += left.transpose() * row.regressor;
                moment += left.transpose() * row.wrench;
            }
            let inverse = to_scaled * (to_scaled * normal * to_scaled).try_inverse()? * to_scaled;
            Some((inverse, inverse * moment))
        };
        let not_excited = IdentificationError::Indefinite { parameters: 10 };
        let left = left_with(instruments.map(|_| 1));
        let (inverse, solution) = solved(&left).ok_or(not_excited)?;
        let mut instrument_shift = SVector::zeros();
        if let Some(apart) = instruments {
            parameters = solution;
            if let Some((_, far)) = solved(&left_with(Some(apart))) {
                instrument_shift = far - solution;
            }
        }
        let spread = moment_covariance(rows, &left, &parameters, noise.correlation_length, freedom);
        let covariance = inverse * spread * inverse.transpose();
        let rounding = (magnitudes * ROUNDING).component_mul(&(magnitudes * ROUNDING));
        let covariance = (covariance + covariance.transpose()) * 0.5 + SMatrix::from_diagonal(&rounding);
        let per_row = noise_information(&weights, noise);
        Ok(Self {
            information,
            parameters,
            covariance,
            instrument_shift,
            noise_information: per_row * rows.len() as f64,
            torque_residual: torque,
            force_residual: force,
        })
    }

    /// Expected error of plain least squares from noise inside the regressors: `-(R^T R)^-1 N p`.
    pub fn attenuation(&self, scale: BodyScale) -> SVector<f64, 10> {
        let magnitudes = SMatrix::<f64, 10, 10>::from_diagonal(&scale.parameter_magnitudes());
        let factor = self.information.factor() * magnitudes;
        (factor.transpose() * factor).try_inverse().map_or_else(SVector::zeros, |inverse| {
            -(magnitudes * inverse * magnitudes * self.noise_information * self.parameters)
        })
    }
}

/// Square-root information of rows with these standard deviations of torque and force.
///
/// # Errors
/// [`IdentificationError::NotFinite`].
pub fn whitened(rows: &[WrenchRow], torque: f64, force: f64) -> Result<SquareRootInformation<10>, IdentificationError> {
    let roots = weights(torque, force).map(f64::sqrt);
    let mut information = SquareRootInformation::new();
    for row in rows {
        information.update(&scaled(&roots, &row.regressor), &roots.component_mul(&row.wrench))?;
    }
    Ok(information)
}

/// What noise inside one regressor adds to its weighted normal matrix on average.
///
/// A regressor depends linearly on angular and linear acceleration; that noise in the products of rates is smaller by
/// the turn over one row is neglected.
pub(crate) fn noise_information(weights: &Vector6<f64>, noise: &RowNoise) -> SMatrix<f64, 10, 10> {
    let zero = Vector3::zeros();
    let mut sum = SMatrix::zeros();
    for axis in 0..3 {
        let unit = Vector3::ith(axis, 1.0);
        let angular = newton_euler(&zero, &unit, &zero);
        let linear = newton_euler(&zero, &zero, &unit);
        sum += angular.transpose() * scaled(weights, &angular) * noise.angular_acceleration_variance;
        sum += linear.transpose() * scaled(weights, &linear) * noise.acceleration_variance;
    }
    sum
}

/// Covariance of `sum left^T e` over rows whose residuals `e` are correlated up to `correlation_length`.
fn moment_covariance(
    rows: &[WrenchRow],
    left: &[Regressor<f64>],
    parameters: &SVector<f64, 10>,
    correlation_length: usize,
    freedom: f64,
) -> SMatrix<f64, 10, 10> {
    let residuals: Vec<Vector6<f64>> = rows.iter().map(|row| row.regressor * parameters - row.wrench).collect();
    let near = |i: usize| {
        let index = rows[i].index;
        (i + 1..rows.len())
            .take_while(move |&j| rows[j].index - index <= correlation_length)
            .map(move |j| (j, rows[j].index - index))
    };
    let mut autocovariance = vec![(Matrix6::<f64>::zeros(), 0_usize); correlation_length + 1];
    for i in 0..rows.len() {
        autocovariance[0].0 += residuals[i] * residuals[i].transpose();
        autocovariance[0].1 += 1;
        for (j, distance) in near(i) {
            autocovariance[distance].0 += residuals[i] * residuals[j].transpose();
            autocovariance[distance].1 += 1;
        }
    }
    let autocovariance: Vec<Matrix6<f64>> =
        autocovariance.iter().map(|(sum, count)| sum * (freedom / (*count).max(1) as f64)).collect();
    let spread = |taper: &dyn Fn(usize) -> f64| {
        let mut spread = SMatrix::<f64, 10, 10>::zeros();
        for i in 0..rows.len() {
            let mut others = autocovariance[0] * left[i] * 0.5;
            for (j, distance) in near(i) {
                others += autocovariance[distance] * left[j] * taper(distance);
            }
            spread += left[i].transpose() * others;
        }
        spread + spread.transpose()
    };
    // The truncated sum is right for a moving average, but an estimate of it need not be a covariance; Bartlett's taper
    // always is one, at the price of some bias.
    let truncated = spread(&|_| 1.0);
    let diagonal = truncated.diagonal();
    if diagonal.iter().all(|&d| d > 0.0) {
        let unit = diagonal.map(|d| 1.0 / d.sqrt());
        let correlation = SMatrix::<f64, 10, 10>::from_fn(|i, j| truncated[(i, j)] * unit[i] * unit[j]);
        if correlation.symmetric_eigenvalues().min() > 1e-6 {
            return truncated;
        }
    }
    spread(&|distance| 1.0 - distance as f64 / (correlation_length + 1) as f64)
}

pub(crate) fn weights(torque: f64, force: f64) -> Vector6<f64> {
    let (t, f) = (1.0 / (torque * torque), 1.0 / (force * force));
    Vector6::new(t, t, t, f, f, f)
}

pub(crate) fn scaled(weights: &Vector6<f64>, regressor: &Regressor<f64>) -> Regressor<f64> {
    SMatrix::from_fn(|i, j| weights[i] * regressor[(i, j)])
}

/// Sums of squares of torque and force residuals.
fn residual_sums(rows: &[WrenchRow], parameters: &SVector<f64, 10>) -> (f64, f64) {
    rows.iter().fold((0.0, 0.0), |(torque, force), row| {
        let residual = row.regressor * parameters - row.wrench;
        (torque + residual.fixed_rows::<3>(0).norm_squared(), force + residual.fixed_rows::<3>(3).norm_squared())
    })
}

/// Root mean square of a wrench in force units.
fn rms(rows: &[WrenchRow], wrench: impl Fn(&WrenchRow) -> Vector6<f64>, length_m: f64) -> f64 {
    let sum: f64 = rows
        .iter()
        .map(|row| {
            let w = wrench(row);
            w.fixed_rows::<3>(0).norm_squared() / (length_m * length_m) + w.fixed_rows::<3>(3).norm_squared()
        })
        .sum();
    (sum / (6 * rows.len().max(1)) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Gaussian;

    /// Largest shift of the instruments in standard deviations; the noise of one acceleration is `memory` times the last.
    fn shift(seed: u64, memory: f64) -> f64 {
        let mut dice = Gaussian::from_seed(seed);
        let mut uniform = || 2.0 * dice.uniform() - 1.0;
        let body = SVector::<f64, 10>::from_column_slice(&[9.4, 0.3, -0.2, 0.5, 0.2, 0.0, 0.0, 0.18, 0.0, 0.19]);
        let mut noise = Vector6::<f64>::zeros();
        let rows: Vec<WrenchRow> = (0..4000_usize)
            .map(|index| {
                let wave = |k: usize| (index as f64 * (0.011 + 0.007 * k as f64) + k as f64).sin();
                let triple = |first: usize| Vector3::new(wave(first), wave(first + 1), wave(first + 2));
                let (rate, angular, linear) = (triple(0) * 0.3, triple(3) * 0.1, triple(6) * 0.05);
                noise = noise * memory + Vector6::from_fn(|_, _| uniform()) * (0.05 * (1.0 - memory * memory).sqrt());
                let seen =
                    newton_euler(&rate, &(angular + noise.fixed_rows::<3>(0)), &(linear + noise.fixed_rows::<3>(3)));
                WrenchRow { index, regressor: seen, wrench: newton_euler(&rate, &angular, &linear) * body }
            })
            .collect();
        let scale = BodyScale::try_new(9.0, 0.15).unwrap();
        let row_noise = RowNoise { correlation_length: 24, ..RowNoise::default() };
        let found = WeightedLeastSquares::fit(&rows, scale, &row_noise, Some(12)).unwrap();
        (0..10).map(|i| found.instrument_shift[i].abs() / found.covariance[(i, i)].sqrt()).fold(0.0, f64::max)
    }

    #[test]
    fn instruments_further_away_tell_noise_that_is_alike_from_sample_to_sample() {
        for seed in 1..6 {
            let (white, coloured) = (shift(seed, 0.0), shift(seed, 0.9));
            assert!(white < 3.0 && coloured > 3.0, "{white} {coloured}");
        }
    }
}
