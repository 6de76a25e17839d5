//! What throws say about the sensors themselves: scale and directions of the gyro's axes, direction of the wheel's axis,
//! delay of the wheel's telemetry.

use super::ThrowSettings;
use super::momentum_balance::{FreeFallEstimate, REWEIGHTINGS, solve, whitened_momentum, windows};
use super::throw_record::{ThrowRecord, ThrowSample};
use crate::IdentificationError;
use tumble_lie::nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Vector3};

/// Scale and direction of a sensor's axis as its maker states them, direction of the wheel's as it is mounted: one
/// standard deviation, rad for directions.
const AXIS_SIGMA: f64 = 0.01;
/// Difference over which derivatives are taken, and the unit of the search.
const AXIS_STEP: f64 = 2e-3;
const WHEEL_DELAY_STEP_S: f64 = 2e-4;
/// Gauss-Newton steps before the search gives up; from perfect sensors a few suffice.
const SEARCH_STEPS: usize = 30;
/// Longest step of the search, in steps of the differences.
const LONGEST_STEP: f64 = 10.0;
/// The search ends with a step below this, in the same unit.
const CLOSE: f64 = 0.02;
/// Independent numbers of [`sensor_axes`]: two factors, three shears, two tilts.
const AXES: usize = 7;

/// How a device's sensors err, with one standard deviation each.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct SensorErrors {
    /// What the rate about each axis is in units of the reading.
    pub gyro_factor: [f64; 3],
    /// One sigma of the factors; zero where they were not estimated.
    pub gyro_factor_sigma: [f64; 3],
    /// How far the gyro's axes are from right angles, rad: what the rate about x gains with the readings of y and z, and
    /// the rate about y with that of z.
    pub gyro_shear: [f64; 3],
    /// One sigma of the shears; zero where they were not estimated.
    pub gyro_shear_sigma: [f64; 3],
    /// Components of the wheel's axis along x and y of the inertial sensor, rad.
    pub wheel_tilt: [f64; 2],
    /// One sigma of the tilts; zero where they were not estimated.
    pub wheel_tilt_sigma: [f64; 2],
    /// How much later than the rates the wheel's speed is recorded, s.
    pub wheel_delay_s: f64,
    /// One sigma of the delay, s; zero where it was not estimated.
    pub wheel_delay_sigma_s: f64,
    /// Independent changes of one sigma each, in rows, that together make up how uncertain these errors are; the columns
    /// in the order `gyro_factor`, `gyro_shear`, `wheel_tilt`, `wheel_delay_s`. The last row is the delay's.
    pub shifts: [[f64; 9]; 8],
}

impl FreeFallEstimate {
    /// Reads one throw as it was measured by sensors that err so.
    pub(super) fn from_reading(
        record: &ThrowRecord,
        errors: &SensorErrors,
        settings: &ThrowSettings,
    ) -> Result<Self, IdentificationError> {
        // A gyro saturates by its reading, not by the rate.
        record.free_fall(&settings.validated()?)?;
        Self::from_throw(&record.corrected(errors), settings)
    }
}

impl Default for SensorErrors {
    /// Sensors without errors.
    fn default() -> Self {
        Self {
            gyro_factor: [1.0; 3],
            gyro_factor_sigma: [0.0; 3],
            gyro_shear: [0.0; 3],
            gyro_shear_sigma: [0.0; 3],
            wheel_tilt: [0.0; 2],
            wheel_tilt_sigma: [0.0; 2],
            wheel_delay_s: 0.0,
            wheel_delay_sigma_s: 0.0,
            shifts: [[0.0; 9]; 8],
        }
    }
}

impl SensorErrors {
    /// What the throws of a device say about its sensors: the [`wheel_delay`] by the throws of the calibration, where the
    /// wheel matters most; the [`sensor_axes`], which many motions must tell apart, by those and all `others`. The throws of
    /// one entry are throws of one body; nothing else is known about it.
    ///
    /// # Errors
    /// Those of [`wheel_delay`] and [`sensor_axes`].
    pub fn from_throws(
        calibration: &[&[ThrowRecord]],
        others: &[&[ThrowRecord]],
        settings: &ThrowSettings,
    ) -> Result<Self, IdentificationError> {
        let (wheel_delay_s, wheel_delay_sigma_s) = wheel_delay(calibration, settings)?;
        let mut errors = sensor_axes(&[calibration, others].concat(), wheel_delay_s, settings)?;
        errors.wheel_delay_sigma_s = wheel_delay_sigma_s;
        errors.shifts[7][8] = wheel_delay_sigma_s;
        Ok(errors)
    }

    /// These errors changed by one of [`SensorErrors::shifts`].
    pub(super) fn shifted(&self, shift: &[f64; 9]) -> Self {
        let [f0, f1, f2, s0, s1, s2, t0, t1, delay_s] = *shift;
        let plus = |of: [f64; 3], by: [f64; 3]| core::array::from_fn(|i| of[i] + by[i]);
        Self {
            gyro_factor: plus(self.gyro_factor, [f0, f1, f2]),
            gyro_shear: plus(self.gyro_shear, [s0, s1, s2]),
            wheel_tilt: [self.wheel_tilt[0] + t0, self.wheel_tilt[1] + t1],
            wheel_delay_s: self.wheel_delay_s + delay_s,
            ..*self
        }
    }
}

impl ThrowRecord {
    /// The record of a device without these errors, in axes whose z is the wheel's; the wheel's speed linear between
    /// samples, held beyond the record.
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
        let ([x, y, z], [xy, xz, yz]) = (errors.gyro_factor, errors.gyro_shear);
        let [tilt_x, tilt_y] = errors.wheel_tilt;
        let wheel_from_sensor = *Rotation3::from_scaled_axis(Vector3::new(tilt_y, -tilt_x, 0.0)).matrix();
        let rate_from_reading = wheel_from_sensor * Matrix3::new(x, xy, xz, 0.0, y, yz, 0.0, 0.0, z);
        let correct = |sample: &ThrowSample| ThrowSample {
            rate_body: rate_from_reading * sample.rate_body,
            specific_force_body: wheel_from_sensor * sample.specific_force_body,
            wheel_speed_rad_s: wheel_speed(sample.time_s + errors.wheel_delay_s),
            ..*sample
        };
        Self::of_valid(samples.iter().map(correct).collect())
    }
}

/// Delay of the wheel's telemetry (s) and its standard deviation, by maximum likelihood of the momentum balance; nothing
/// about the inertias is known but that the throws of one entry of `bodies` are throws of one body. How much the balance
/// of a body is off the throws say themselves, body by body.
///
/// # Errors
/// Those of [`super::FreeFallEstimate::from_throw`], [`IdentificationError::LikelihoodNotMaximal`].
pub fn wheel_delay(bodies: &[&[ThrowRecord]], settings: &ThrowSettings) -> Result<(f64, f64), IdentificationError> {
    let errors = |delay: &SVector<f64, 1>| SensorErrors {
        wheel_delay_s: delay[0] * WHEEL_DELAY_STEP_S,
        ..SensorErrors::default()
    };
    let (delay, variance) = search(bodies, errors, &SMatrix::zeros(), settings)?;
    Ok((delay[0] * WHEEL_DELAY_STEP_S, variance[0].sqrt() * WHEEL_DELAY_STEP_S))
}

/// Factors of the gyro's axes relative to each other, the angles between them, and the tilt of the wheel's axis, as
/// [`wheel_delay`] does it, the delay known; every number beforehand good to one percent. The factors' mean is one: what
/// is common to all axes a throw hardly shows.
///
/// # Errors
/// Those of [`super::FreeFallEstimate::from_throw`], [`IdentificationError::LikelihoodNotMaximal`].
pub fn sensor_axes(
    bodies: &[&[ThrowRecord]],
    wheel_delay_s: f64,
    settings: &ThrowSettings,
) -> Result<SensorErrors, IdentificationError> {
    let mut by_axes = SMatrix::<f64, 9, AXES>::zeros();
    by_axes.fixed_view_mut::<3, 2>(0, 0).copy_from(&SMatrix::<f64, 3, 2>::new(1.0, 0.0, 0.0, 1.0, -1.0, -1.0));
    by_axes.fixed_view_mut::<5, 5>(3, 2).fill_with_identity();
    by_axes *= AXIS_STEP;
    let known = SensorErrors { wheel_delay_s, ..SensorErrors::default() };
    let prior = by_axes.transpose() * by_axes / AXIS_SIGMA.powi(2);
    let errors = |scaled: &SVector<f64, AXES>| known.shifted(&(by_axes * scaled).into());
    let (scaled, covariance) = search(bodies, errors, &prior, settings)?;

    let unsettled = IdentificationError::LikelihoodNotMaximal { iterations: SEARCH_STEPS, promise: 0.0 };
    let shifts = by_axes * covariance.cholesky().ok_or(unsettled)?.l();
    let sigma: [f64; 9] = core::array::from_fn(|i| shifts.row(i).norm());
    let [f0, f1, f2, s0, s1, s2, t0, t1, _] = sigma;
    let mut found = errors(&scaled);
    found.gyro_factor_sigma = [f0, f1, f2];
    found.gyro_shear_sigma = [s0, s1, s2];
    found.wheel_tilt_sigma = [t0, t1];
    for (shift, column) in found.shifts.iter_mut().zip(shifts.column_iter()) {
        *shift = core::array::from_fn(|i| column[i]);
    }
    Ok(found)
}

/// The rows of the momentum balance of one body's throws, were the sensors to err so.
struct Body<'a> {
    throws: &'a [ThrowRecord],
    settings: &'a ThrowSettings,
}

impl Body<'_> {
    fn rows(
        &self,
        errors: &SensorErrors,
        inertia_ratio: &SVector<f64, 6>,
    ) -> Result<Vec<SMatrix<f64, 3, 7>>, IdentificationError> {
        let mut rows = Vec::new();
        for throw in self.throws {
            let corrected = throw.corrected(errors);
            let windows = windows(&corrected.free_fall(self.settings)?, self.settings);
            rows.extend(whitened_momentum(&windows, inertia_ratio, self.settings));
        }
        Ok(rows)
    }

    /// Adds the body's information about `P` numbers and the gradient of its misfit by them, the body's inertia
    /// eliminated and the level of its residuals at its best; windows that overlap count once.
    fn add_to<const P: usize>(
        &self,
        at: &SVector<f64, P>,
        errors: &impl Fn(&SVector<f64, P>) -> SensorErrors,
        information: &mut SMatrix<f64, P, P>,
        gradient: &mut SVector<f64, P>,
    ) -> Result<(), IdentificationError> {
        let mut inertia_ratio = SVector::zeros();
        for _ in 0..REWEIGHTINGS {
            inertia_ratio = solve(&self.rows(&errors(at), &inertia_ratio)?)?;
        }
        let here = self.rows(&errors(at), &inertia_ratio)?;
        let residual = |row: &SMatrix<f64, 3, 7>| row.fixed_columns::<6>(0) * inertia_ratio - row.column(6);
        let residuals: Vec<Vector3<f64>> = here.iter().map(residual).collect();
        let mut slopes = vec![SMatrix::<f64, 3, P>::zeros(); here.len()];
        for axis in 0..P {
            let ahead = at + SVector::<f64, P>::from_fn(|i, _| if i == axis { 1.0 } else { 0.0 });
            for ((slope, row), residual_here) in
                slopes.iter_mut().zip(&self.rows(&errors(&ahead), &inertia_ratio)?).zip(&residuals)
            {
                slope.set_column(axis, &(residual(row) - residual_here));
            }
        }

        let (mut of_inertia, mut crossed) = (SMatrix::<f64, 6, 6>::zeros(), SMatrix::<f64, 6, P>::zeros());
        let (mut own, mut by_inertia) = (SMatrix::<f64, P, P>::zeros(), SVector::<f64, 6>::zeros());
        let (mut by_own, mut squares) = (SVector::<f64, P>::zeros(), 0.0);
        for ((row, slope), residual) in here.iter().zip(&slopes).zip(&residuals) {
            let regressor = row.fixed_columns::<6>(0);
            of_inertia += regressor.transpose() * regressor;
            crossed += regressor.transpose() * slope;
            own += slope.transpose() * slope;
            by_inertia += regressor.transpose() * residual;
            by_own += slope.transpose() * residual;
            squares += residual.norm_squared();
        }
        let Some(eliminated) = of_inertia.cholesky().filter(|_| squares > 0.0) else {
            return Ok(());
        };
        let overlap = (self.settings.window_s / self.settings.window_step_s).max(1.0);
        let weight = 3.0 * here.len() as f64 / (squares * overlap);
        *information += (own - crossed.transpose() * eliminated.solve(&crossed)) * weight;
        *gradient += (by_own - crossed.transpose() * eliminated.solve(&by_inertia)) * weight;
        Ok(())
    }
}

/// Gauss-Newton from zero on differences over one; the maximum and the inverse of the information there.
fn search<const P: usize>(
    bodies: &[&[ThrowRecord]],
    errors: impl Fn(&SVector<f64, P>) -> SensorErrors,
    prior: &SMatrix<f64, P, P>,
    settings: &ThrowSettings,
) -> Result<(SVector<f64, P>, SMatrix<f64, P, P>), IdentificationError> {
    let mut at = SVector::<f64, P>::zeros();
    let mut promise = 0.0;
    for _ in 0..SEARCH_STEPS {
        let (mut information, mut gradient) = (*prior, prior * at);
        for &throws in bodies {
            Body { throws, settings }.add_to(&at, &errors, &mut information, &mut gradient)?;
        }
        let Some(covariance) = information.cholesky().map(|factor| factor.inverse()) else {
            break;
        };
        let step = covariance * gradient;
        at -= step * (LONGEST_STEP / step.amax().max(LONGEST_STEP));
        if step.amax() < CLOSE {
            return Ok((at, covariance));
        }
        promise = gradient.dot(&step);
    }
    Err(IdentificationError::LikelihoodNotMaximal { iterations: SEARCH_STEPS, promise })
}
