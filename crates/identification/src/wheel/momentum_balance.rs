//! Inertia in units of the wheel's and centre of mass from one free fall, with covariance.

use super::ThrowSettings;
use super::regressors::{lever_arm_regressor, momentum_regressor, symmetric_matrix};
use super::throw_record::{EndOfFall, FreeFall, ThrowRecord, ThrowSample};
use crate::IdentificationError;
use tumble_lie::LieGroup;
use tumble_lie::nalgebra::{DMatrix, Matrix3, Rotation3, SMatrix, SVector, Vector3};

/// Passes over the momentum balance; each weights the rate errors with the inertia of the one before.
pub(super) const REWEIGHTINGS: usize = 3;
/// Relative eigenvalue of the scaled information below which a direction counts as not excited.
const RANK_TOLERANCE: f64 = 1e-12;
/// Root mean square rate that a tumbling body has about each axis, in standard deviations of the rate.
const RATE_SIGMAS: f64 = 25.0;
/// A residual torque so many times as large is what a second look at the momentum reckons with.
const FAST: f64 = 4.0;
/// Stretches of the fall that the covariance leaves out in turn.
const BLOCKS: usize = 12;

/// What one throw says by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeFallEstimate {
    /// `[X11, X12, X13, X22, X23, X33]`: inertia about the common centre of mass, wheel at rest included, in units of
    /// the wheel's inertia.
    pub inertia_ratio: SVector<f64, 6>,
    /// Covariance of the inertia ratio.
    pub inertia_ratio_covariance: SMatrix<f64, 6, 6>,
    /// From the inertial sensor to the common centre of mass, body axes, m.
    pub lever_arm_m: Vector3<f64>,
    /// Covariance of the lever arm, m^2.
    pub lever_arm_covariance: Matrix3<f64>,
    /// Last instant used, s.
    pub end_s: f64,
    /// Why the free fall ends there.
    pub end: EndOfFall,
    /// Windows averaged.
    pub windows: usize,
    /// Share of what the wheel does to the angular momentum that the inertia explains.
    pub explained: f64,
    /// Mean square of what is left of it, in units of the errors that the settings state.
    pub mean_square: f64,
    /// Squared distance, in joint standard deviations and per entry, of the inertia by what changes fast in the momentum alone.
    pub fast_apart: f64,
}

/// Both balances averaged over one window.
pub(super) struct Window {
    time_s: f64,
    /// `[R L(w) | -R e_z W]`, inertial axes: regressor and output of the angular momentum.
    momentum: SMatrix<f64, 3, 7>,
    world_from_body: Matrix3<f64>,
    /// `[-(S(dw) + S(w)^2) | a]`, body axes.
    lever_arm: SMatrix<f64, 3, 4>,
}

impl FreeFallEstimate {
    /// Reads one throw.
    ///
    /// # Errors
    /// [`IdentificationError::FallTooShort`], [`IdentificationError::GapInFall`],
    /// [`IdentificationError::GyroSaturated`], [`IdentificationError::WheelNotSpinning`],
    /// [`IdentificationError::NotExcited`] where the motion leaves a part of the inertia or of the lever arm open.
    pub fn from_throw(record: &ThrowRecord, settings: &ThrowSettings) -> Result<Self, IdentificationError> {
        let fall = record.free_fall(&settings.validated()?)?;
        check_tumbling(&fall, settings)?;
        let windows = windows(&fall, settings);

        let mut inertia_ratio = SVector::zeros();
        for _ in 0..REWEIGHTINGS {
            inertia_ratio = solve(&whitened_momentum(&windows, &inertia_ratio, settings))?;
        }
        let rows = whitened_momentum(&windows, &inertia_ratio, settings);
        let inertia_ratio_covariance = covariance(&rows)?;
        let left = |row: &SMatrix<f64, 3, 7>| row.fixed_columns::<6>(0) * inertia_ratio - row.column(6);
        let left: f64 = rows.iter().map(|row| left(row).norm_squared()).sum();
        let applied: f64 = rows.iter().map(|row| row.column(6).norm_squared()).sum();
        let lever_arm_rows: Vec<_> = windows.iter().map(|window| window.lever_arm).collect();
        let lever_arm_m = solve(&lever_arm_rows)?;
        Ok(Self {
            inertia_ratio,
            inertia_ratio_covariance,
            lever_arm_m,
            lever_arm_covariance: covariance(&lever_arm_rows)?,
            end_s: fall.samples.last().map_or(0.0, |last| last.time_s),
            end: fall.end,
            windows: windows.len(),
            explained: 1.0 - left / applied,
            mean_square: left / (3 * rows.len()).saturating_sub(6).max(1) as f64,
            fast_apart: fast_apart(&windows, (&inertia_ratio, &inertia_ratio_covariance), settings)?,
        })
    }
}

/// How far off the inertia is by what changes so fast that no torque explains it: the same by a model that holds, another by most that
/// does not.
fn fast_apart(
    windows: &[Window],
    (inertia_ratio, own): (&SVector<f64, 6>, &SMatrix<f64, 6, 6>),
    settings: &ThrowSettings,
) -> Result<f64, IdentificationError> {
    let walk = FAST * settings.momentum_walk_rad_s;
    let fast = whitened_momentum(windows, inertia_ratio, &ThrowSettings { momentum_walk_rad_s: walk, ..*settings });
    let apart = solve(&fast)? - inertia_ratio;
    Ok(squared_distance(&apart, &(own + covariance(&fast)?)))
}

/// Squared length of a vector in standard deviations, for each of its entries; infinite where the covariance is none.
pub(super) fn squared_distance<const N: usize>(apart: &SVector<f64, N>, covariance: &SMatrix<f64, N, N>) -> f64 {
    let scale = covariance.diagonal().map(|variance| if variance > 0.0 { 1.0 / variance.sqrt() } else { 0.0 });
    let correlation = SMatrix::<f64, N, N>::from_fn(|i, j| scale[i] * covariance[(i, j)] * scale[j]);
    let apart = apart.component_mul(&scale);
    correlation.cholesky().map_or(f64::INFINITY, |factor| apart.dot(&factor.solve(&apart)) / N as f64)
}

/// Refuses a motion whose rates stay in a plane or on a line but for their errors: a covariance cannot tell errors in the
/// regressor from motion. Rates that span one, two, three directions determine three, five, six entries of the inertia.
fn check_tumbling(fall: &FreeFall<'_>, settings: &ThrowSettings) -> Result<(), IdentificationError> {
    let outer = |sum, sample: &ThrowSample| sum + sample.rate_body * sample.rate_body.transpose();
    let mean_square = fall.samples.iter().fold(Matrix3::zeros(), outer) / fall.samples.len() as f64;
    let rates = mean_square.symmetric_eigenvalues().map(|square| square.max(0.0).sqrt());
    let directions = rates.iter().filter(|rate| **rate > RATE_SIGMAS * settings.rate_sigma_rad_s).count();
    match [0, 3, 5].get(directions) {
        Some(&rank) => Err(IdentificationError::NotExcited {
            rank,
            expected: 6,
            smallest_singular_value: if rates.max() > 0.0 { rates.min() / rates.max() } else { 0.0 },
        }),
        None => Ok(()),
    }
}

/// Raised-cosine averages of both balances along the fall.
pub(super) fn windows(fall: &FreeFall<'_>, settings: &ThrowSettings) -> Vec<Window> {
    let samples = fall.samples;
    let mut attitudes = Vec::with_capacity(samples.len());
    let mut attitude = Rotation3::identity();
    attitudes.push(attitude);
    for pair in samples.windows(2) {
        // Fourth order for a rate linear in time: mean rate and the commutator of the Magnus expansion.
        let step_s = pair[1].time_s - pair[0].time_s;
        let (from, to) = (&pair[0].rate_body, &pair[1].rate_body);
        let increment = (from + to) * (0.5 * step_s) + from.cross(to) * (step_s * step_s / 12.0);
        attitude *= <Rotation3<f64> as LieGroup>::exp(&increment);
        attitudes.push(attitude);
    }

    let (first_s, last_s) = (samples[0].time_s, samples[samples.len() - 1].time_s);
    let half_s = 0.5 * settings.window_s;
    let next = |center_s: &f64| Some(center_s + settings.window_step_s);
    core::iter::successors(Some(first_s + half_s), next)
        .take_while(|center_s| center_s + half_s <= last_s)
        .map(|center_s| {
            let mut window = Window {
                time_s: center_s,
                momentum: SMatrix::zeros(),
                world_from_body: Matrix3::zeros(),
                lever_arm: SMatrix::zeros(),
            };
            // The window averages a quantity between its neighbours' samples, so a central difference exists.
            let begin = samples.partition_point(|sample| sample.time_s < center_s - half_s).max(1);
            let end = samples.partition_point(|sample| sample.time_s <= center_s + half_s).min(samples.len() - 1);
            let mut total = 0.0;
            for k in begin..end {
                let (sample, attitude) = (&samples[k], attitudes[k].matrix());
                let span_s = samples[k + 1].time_s - samples[k - 1].time_s;
                let rate_derivative = (samples[k + 1].rate_body - samples[k - 1].rate_body) / span_s;
                let phase = (sample.time_s - center_s) / settings.window_s * core::f64::consts::TAU;
                let weight = (1.0 + phase.cos()) * span_s;
                let mut momentum = SMatrix::<f64, 3, 7>::zeros();
                momentum.fixed_columns_mut::<6>(0).copy_from(&momentum_regressor(&sample.rate_body));
                momentum[(2, 6)] = -sample.wheel_speed_rad_s;
                window.momentum += attitude * momentum * weight;
                let lever_arm = lever_arm_regressor(&sample.rate_body, &rate_derivative);
                window.lever_arm += lever_arm.insert_column(3, 0.0) * weight;
                let mut read = window.lever_arm.column_mut(3);
                read += sample.specific_force_body * weight;
                if sample.time_s <= center_s {
                    window.world_from_body = *attitude;
                }
                total += weight;
            }
            window.momentum /= total;
            window.lever_arm /= total;
            window
        })
        .collect()
}

/// `[A | y]` with unit errors: the innovations of a random walk (the angular momentum `h`) seen through
/// `A X - h = y + noise`, applied to every column at once; `h` starts unknown and so costs the first window.
///
/// # Source
/// de Jong, "The diffuse Kalman filter", Annals of Statistics 19 (1991).
pub(super) fn whitened_momentum(
    windows: &[Window],
    inertia_ratio: &SVector<f64, 6>,
    settings: &ThrowSettings,
) -> Vec<SMatrix<f64, 3, 7>> {
    let rate_error = symmetric_matrix(inertia_ratio) * settings.rate_sigma_rad_s;
    let wheel_error = Vector3::z() * settings.wheel_sigma_rad_s;
    // Without an inertia yet, the wheel's error on every axis keeps the balance regular.
    let floor = Matrix3::identity() * (1e-2 * settings.wheel_sigma_rad_s).powi(2);
    let noise_body = rate_error * rate_error.transpose() + wheel_error * wheel_error.transpose() + floor;
    let mut momentum = SMatrix::<f64, 3, 7>::zeros();
    let mut spread = Matrix3::zeros();
    let mut before_s = 0.0;
    let mut rows = Vec::with_capacity(windows.len());
    for (index, window) in windows.iter().enumerate() {
        let noise = window.world_from_body * noise_body * window.world_from_body.transpose();
        if index == 0 {
            (momentum, spread) = (window.momentum, noise);
        } else {
            spread += Matrix3::identity() * settings.momentum_walk_rad_s.powi(2) * (window.time_s - before_s);
            let innovation = window.momentum - momentum;
            if let Some(factor) = (spread + noise).cholesky() {
                rows.push(factor.l().solve_lower_triangular(&innovation).unwrap_or(innovation));
                let gain_transposed = factor.solve(&spread);
                momentum += gain_transposed.transpose() * innovation;
                let posterior = spread - gain_transposed.transpose() * spread;
                spread = (posterior + posterior.transpose()) * 0.5;
            }
        }
        before_s = window.time_s;
    }
    rows
}

/// Information of the unknowns, `sum A^T A`.
fn information<const N: usize, const M: usize>(rows: &[SMatrix<f64, 3, M>]) -> SMatrix<f64, N, N> {
    rows.iter().fold(SMatrix::zeros(), |sum, row| {
        let regressor = row.fixed_columns::<N>(0);
        sum + regressor.transpose() * regressor
    })
}

/// Inverse of an information matrix, unless a direction of it is empty.
fn inverse_information<const N: usize>(
    information: &SMatrix<f64, N, N>,
) -> Result<SMatrix<f64, N, N>, IdentificationError> {
    let scale = information.diagonal().map(|entry| if entry > 0.0 { 1.0 / entry.sqrt() } else { 0.0 });
    let scaled = SMatrix::<f64, N, N>::from_fn(|i, j| scale[i] * information[(i, j)] * scale[j]);
    // The eigenvalues of the scaled matrix sum to N, so its smallest eigenvalue is relative.
    let eigenvalues = DMatrix::from_column_slice(N, N, scaled.as_slice()).symmetric_eigenvalues();
    let rank = eigenvalues.iter().filter(|value| **value > RANK_TOLERANCE).count();
    let refused = IdentificationError::NotExcited {
        rank,
        expected: N,
        smallest_singular_value: eigenvalues.iter().fold(f64::MAX, |least, value| least.min(*value)).max(0.0).sqrt(),
    };
    if rank < N {
        return Err(refused);
    }
    let inverse = scaled.cholesky().ok_or(refused)?.inverse();
    Ok(SMatrix::from_fn(|i, j| scale[i] * inverse[(i, j)] * scale[j]))
}

/// Least squares of `[A | y]`.
pub(super) fn solve<const N: usize, const M: usize>(
    rows: &[SMatrix<f64, 3, M>],
) -> Result<SVector<f64, N>, IdentificationError> {
    let output = rows
        .iter()
        .fold(SVector::<f64, N>::zeros(), |sum, row| sum + row.fixed_columns::<N>(0).transpose() * row.column(N));
    Ok(inverse_information(&information(rows))? * output)
}

/// Covariance of [`solve`] that assumes nothing about the errors but that they are forgotten within a block: the spread
/// of the estimates that each leave out one of [`BLOCKS`] stretches of the fall.
///
/// # Source
/// The delete-block jackknife: Kuensch, "The jackknife and the bootstrap for general stationary observations", Annals of
/// Statistics 17 (1989).
fn covariance<const N: usize, const M: usize>(
    rows: &[SMatrix<f64, 3, M>],
) -> Result<SMatrix<f64, N, N>, IdentificationError> {
    let block = rows.len().div_ceil(BLOCKS).max(1);
    let mut estimates: Vec<SVector<f64, N>> = Vec::with_capacity(BLOCKS);
    for start in (0..rows.len()).step_by(block) {
        let kept = [&rows[..start], &rows[(start + block).min(rows.len())..]].concat();
        estimates.push(solve(&kept)?);
    }
    let count = estimates.len() as f64;
    let mean = estimates.iter().sum::<SVector<f64, N>>() / count;
    let outer = |sum, estimate: &SVector<f64, N>| sum + (estimate - mean) * (estimate - mean).transpose();
    Ok(estimates.iter().fold(SMatrix::zeros(), outer) * ((count - 1.0) / count))
}
