//! What throws say about the sensors themselves: scale of the gyro's axes, delay of the wheel's telemetry.

use super::ThrowSettings;
use super::momentum_balance::{REWEIGHTINGS, solve, whitened_momentum, windows};
use super::throw_record::{ThrowRecord, ThrowSample};
use crate::IdentificationError;
use tumble_lie::nalgebra::{DMatrix, SMatrix, SVector};

/// Scale of a gyro's axis as its maker states it: one standard deviation.
const GYRO_FACTOR_SIGMA: f64 = 0.01;
const GYRO_FACTOR_STEP: f64 = 2e-3;
const WHEEL_DELAY_STEP_S: f64 = 2e-4;
/// Newton steps before the search gives up; from a perfect sensor a few suffice.
const NEWTON_STEPS: usize = 30;
/// Longest step of the search, in steps of the differences.
const LONGEST_STEP: f64 = 3.0;
/// The search ends with a step below this, in the same unit.
const CLOSE: f64 = 0.02;
/// Curvature that counts as none.
const FLAT: f64 = 1e-6;

/// How a device's sensors err, with one standard deviation each.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct SensorErrors {
    /// What the rate about each axis is in units of the reading.
    pub gyro_factor: [f64; 3],
    /// One sigma of the factors; zero where they were not estimated.
    pub gyro_factor_sigma: [f64; 3],
    /// How much later than the rates the wheel's speed is recorded, s.
    pub wheel_delay_s: f64,
    /// One sigma of the delay, s; zero where it was not estimated.
    pub wheel_delay_sigma_s: f64,
}

impl Default for SensorErrors {
    /// Sensors without errors.
    fn default() -> Self {
        Self { gyro_factor: [1.0; 3], gyro_factor_sigma: [0.0; 3], wheel_delay_s: 0.0, wheel_delay_sigma_s: 0.0 }
    }
}

impl SensorErrors {
    /// What the throws of a device say about its sensors: the [`wheel_delay`] by the throws of the calibration, where the
    /// wheel matters most; the [`gyro_factor`], which many motions must tell apart, by those and all `others`. The throws of
    /// one entry are throws of one body; nothing else is known about it.
    ///
    /// # Errors
    /// Those of [`wheel_delay`] and [`gyro_factor`].
    pub fn from_throws(
        calibration: &[&[ThrowRecord]],
        others: &[&[ThrowRecord]],
        settings: &ThrowSettings,
    ) -> Result<Self, IdentificationError> {
        let (wheel_delay_s, wheel_delay_sigma_s) = wheel_delay(calibration, settings)?;
        let (gyro_factor, covariance) = gyro_factor(&[calibration, others].concat(), wheel_delay_s, settings)?;
        let gyro_factor_sigma = covariance.diagonal().map(f64::sqrt).into();
        Ok(Self { gyro_factor, gyro_factor_sigma, wheel_delay_s, wheel_delay_sigma_s })
    }
}

impl ThrowRecord {
    /// The record of a device without these errors; the wheel's speed linear between samples, held beyond the record.
    pub fn corrected(&self, errors: &SensorErrors) -> Self {
        let samples = self.samples();
        let last = samples.len().saturating_sub(1);
        let wheel_speed = |time_s: f64| {
            let after = samples.partition_point(|sample| sample.time_s <= time_s).clamp(1.min(last), last);
            let [from, to] = [after.saturating_sub(1), after].map(|k| &samples[k]);
            let span_s = to.time_s - from.time_s;
            let share = if span_s > 0.0 { ((time_s - from.time_s) / span_s).clamp(0.0, 1.0) } else { 0.0 };
            from.wheel_speed_rad_s * (1.0 - share) + to.wheel_speed_rad_s * share
        };
        let factor = SVector::from(errors.gyro_factor);
        let correct = |sample: &ThrowSample| ThrowSample {
            rate_body: sample.rate_body.component_mul(&factor),
            wheel_speed_rad_s: wheel_speed(sample.time_s + errors.wheel_delay_s),
            ..*sample
        };
        Self::of_valid(samples.iter().map(correct).collect())
    }
}

/// Delay of the wheel's telemetry (s) and its standard deviation, by maximum likelihood of the momentum balance; nothing
/// about the inertias is known but that the throws of one entry of `bodies` are throws of one body.
///
/// # Errors
/// Those of [`super::FreeFallEstimate::from_throw`], [`IdentificationError::LikelihoodNotMaximal`].
pub fn wheel_delay(bodies: &[&[ThrowRecord]], settings: &ThrowSettings) -> Result<(f64, f64), IdentificationError> {
    let (delay, variance) = newton(SVector::from([0.0]), |delay: &SVector<f64, 1>| {
        let wheel_delay_s = delay[0] * WHEEL_DELAY_STEP_S;
        misfit(bodies, &SensorErrors { wheel_delay_s, ..SensorErrors::default() }, settings)
    })?;
    Ok((delay[0] * WHEEL_DELAY_STEP_S, variance[0].sqrt() * WHEEL_DELAY_STEP_S))
}

/// Factors of the gyro's axes relative to each other and their covariance, as [`wheel_delay`] does it, the delay known;
/// every axis beforehand good to one percent. The factors' mean is one: what is common to all axes a throw hardly shows.
///
/// # Errors
/// Those of [`super::FreeFallEstimate::from_throw`], [`IdentificationError::LikelihoodNotMaximal`].
pub fn gyro_factor(
    bodies: &[&[ThrowRecord]],
    wheel_delay_s: f64,
    settings: &ThrowSettings,
) -> Result<([f64; 3], SMatrix<f64, 3, 3>), IdentificationError> {
    let relative = SMatrix::<f64, 3, 2>::new(1.0, 0.0, 0.0, 1.0, -1.0, -1.0) * GYRO_FACTOR_STEP;
    let factor = |scaled: &SVector<f64, 2>| (relative * scaled).map(|change| 1.0 + change).into();
    let (scaled, covariance) = newton(SVector::zeros(), |scaled: &SVector<f64, 2>| {
        let prior = 0.5 * (relative * scaled / GYRO_FACTOR_SIGMA).norm_squared();
        let errors = SensorErrors { gyro_factor: factor(scaled), wheel_delay_s, ..SensorErrors::default() };
        Ok(prior + misfit(bodies, &errors, settings)?)
    })?;
    Ok((factor(&scaled), relative * covariance * relative.transpose()))
}

/// Minus the logarithm of the likelihood, the level of the noise at its best; windows that overlap count once.
fn misfit(
    bodies: &[&[ThrowRecord]],
    errors: &SensorErrors,
    settings: &ThrowSettings,
) -> Result<f64, IdentificationError> {
    let (mut squares, mut count) = (0.0, 0.0);
    for body in bodies {
        let throws = body
            .iter()
            .map(|throw| {
                let corrected = throw.corrected(errors);
                Ok(windows(&corrected.free_fall(settings)?, settings))
            })
            .collect::<Result<Vec<_>, IdentificationError>>()?;
        let rows = |inertia_ratio: &SVector<f64, 6>| -> Vec<_> {
            throws.iter().flat_map(|windows| whitened_momentum(windows, inertia_ratio, settings)).collect()
        };
        let mut inertia_ratio = SVector::zeros();
        for _ in 0..REWEIGHTINGS {
            inertia_ratio = solve(&rows(&inertia_ratio))?;
        }
        for row in rows(&inertia_ratio) {
            squares += (row.column(6) - row.fixed_columns::<6>(0) * inertia_ratio).norm_squared();
            count += 3.0;
        }
    }
    if count == 0.0 {
        return Ok(0.0);
    }
    let overlap = (settings.window_s / settings.window_step_s).max(1.0);
    Ok(0.5 * count / overlap * (squares / count).ln())
}

/// Newton's method on differences over one; the minimum and the inverse of the curvature there.
fn newton<const P: usize>(
    start: SVector<f64, P>,
    cost: impl Fn(&SVector<f64, P>) -> Result<f64, IdentificationError>,
) -> Result<(SVector<f64, P>, SMatrix<f64, P, P>), IdentificationError> {
    let unit = |axis: usize| SVector::<f64, P>::from_fn(|i, _| if i == axis { 1.0 } else { 0.0 });
    let mut at = start;
    let mut promise = 0.0;
    for _ in 0..NEWTON_STEPS {
        let here = cost(&at)?;
        let mut ahead = [[0.0; 2]; P];
        for (axis, costs) in ahead.iter_mut().enumerate() {
            *costs = [cost(&(at + unit(axis)))?, cost(&(at - unit(axis)))?];
        }
        let gradient = SVector::<f64, P>::from_fn(|i, _| 0.5 * (ahead[i][0] - ahead[i][1]));
        let mut curvature = SMatrix::<f64, P, P>::zeros();
        for i in 0..P {
            curvature[(i, i)] = ahead[i][0] + ahead[i][1] - 2.0 * here;
            for j in 0..i {
                let both = unit(i) + unit(j);
                let corners = cost(&(at + both))? + cost(&(at - both))? + 2.0 * here;
                let mixed = 0.5 * (corners - ahead[i][0] - ahead[i][1] - ahead[j][0] - ahead[j][1]);
                curvature[(i, j)] = mixed;
                curvature[(j, i)] = mixed;
            }
        }
        // Far from the minimum a logarithm curves down: uphill and downhill are then told by the size of the curvature.
        let eigen = DMatrix::from_column_slice(P, P, curvature.as_slice()).symmetric_eigen();
        let axes = SMatrix::<f64, P, P>::from_column_slice(eigen.eigenvectors.as_slice());
        let sizes = SVector::<f64, P>::from_iterator(eigen.eigenvalues.iter().map(|value| value.abs().max(FLAT)));
        let step = axes * (axes.transpose() * gradient).component_div(&sizes);
        at -= step * (LONGEST_STEP / step.amax().max(LONGEST_STEP));
        if step.amax() < CLOSE && eigen.eigenvalues.iter().all(|value| *value > FLAT) {
            let inverse = SMatrix::<f64, P, P>::from_diagonal(&sizes.map(|size| 1.0 / size));
            return Ok((at, axes * inverse * axes.transpose()));
        }
        promise = gradient.dot(&step);
    }
    Err(IdentificationError::LikelihoodNotMaximal { iterations: NEWTON_STEPS, promise })
}
