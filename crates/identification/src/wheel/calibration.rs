//! The device that carries the wheel: its inertia, its centre of mass, the wheel's inertia.

use super::momentum_balance::{FreeFallEstimate, squared_distance};
use super::regressors::{parallel_axis, parallel_axis_derivative, symmetric_entries, two_bodies};
use super::throw_record::ThrowRecord;
use super::{SensorErrors, ThrowSettings};
use crate::estimator::{Counted, Evidence, Judge, Verdict};
use crate::{BodyScale, IdentificationError};
use tumble_dynamics::InertialParameters;
use tumble_lie::nalgebra::{SMatrix, SVector};

/// What [`calibrate`] learned about a device; written to and read from a calibration file.
///
/// `covariance` is that of `[device_inertia_ratio; device_com_m; wheel_inertia_kg_m2]`.
/// # Frame
/// Body axes of the device, positions from its inertial sensor, wheel along z.
/// # Units
/// As the names say; the inertia ratio is dimensionless.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct WheelCalibration {
    /// Inertia of the wheel about its axis, kg m^2.
    pub wheel_inertia_kg_m2: f64,
    /// Mass of the device, wheel included, kg.
    pub device_mass_kg: f64,
    /// From the inertial sensor to the device's centre of mass, m.
    pub device_com_m: [f64; 3],
    /// `[X11, X12, X13, X22, X23, X33]`: inertia of the device about its centre of mass, wheel at rest included, in units
    /// of the wheel's inertia.
    pub device_inertia_ratio: [f64; 6],
    /// See the type.
    pub covariance: [[f64; 10]; 10],
    /// What each of the [shifts](SensorErrors::shifts) of the sensors' errors changes in the ten numbers of `covariance`,
    /// which does not hold it.
    #[cfg_attr(feature = "serde", serde(default))]
    pub by_sensors: [[f64; 10]; 8],
    /// Squared distance of the block's inertia as the throws show it from the one that was told, in standard deviations and per entry, the
    /// wheel's inertia chosen as well as can be; zero in files of before it was kept.
    #[cfg_attr(feature = "serde", serde(default))]
    pub block_apart: f64,
    /// How the sensors err; taken out of the throws of the calibration, and of those of objects.
    #[cfg_attr(feature = "serde", serde(default))]
    pub sensor_errors: SensorErrors,
    /// How the throws were read, and how those of objects are read.
    pub settings: ThrowSettings,
}

/// Learns a device from throws of it alone and throws of it with a block of known inertia, each kind averaged; the records
/// as they were measured, by sensors that err so ([`SensorErrors::from_throws`]).
///
/// `proof_block` in the device's axes, the origin of no consequence. With `X` the inertia of the common body in units of
/// the wheel's, `d` from one centre of mass to the other and `mu` the reduced mass, the wheel's inertia `j` is the least
/// squares solution of `j (X - X_device) = I_block + mu (|d|^2 1 - d d^T)`.
/// # Errors
/// [`IdentificationError::CalibrationIncomplete`], those of [`FreeFallEstimate::from_throw`],
/// [`IdentificationError::NotPositive`] for the masses (component 0: device, 1: block) and for a wheel inertia (2) that
/// contradicts the block.
pub fn calibrate(
    device: &[ThrowRecord],
    proof: &[ThrowRecord],
    device_mass_kg: f64,
    proof_block: &InertialParameters<f64>,
    sensor_errors: &SensorErrors,
    settings: &ThrowSettings,
) -> Result<WheelCalibration, IdentificationError> {
    if device.is_empty() || proof.is_empty() {
        return Err(IdentificationError::CalibrationIncomplete { device: device.len(), proof: proof.len() });
    }
    for (index, value) in [device_mass_kg, proof_block.mass].into_iter().enumerate() {
        if !(value.is_finite() && value > 0.0) {
            return Err(IdentificationError::NotPositive { index, value });
        }
    }
    let learn = |errors: &SensorErrors| learn(device, proof, device_mass_kg, proof_block, errors, settings);
    let Learned { found, covariance, left, left_covariance, by_wheel } = learn(sensor_errors)?;
    let mut block_covariance = left_covariance;
    let mut by_sensors = [[0.0; 10]; 8];
    for (changes, shift) in by_sensors.iter_mut().zip(&sensor_errors.shifts) {
        if shift.iter().any(|change| *change != 0.0) {
            let shifted = learn(&sensor_errors.shifted(shift))?;
            *changes = (shifted.found - found).into();
            let change = shifted.left - left;
            block_covariance += change * change.transpose();
        }
    }
    Ok(WheelCalibration {
        wheel_inertia_kg_m2: found[9],
        device_mass_kg,
        device_com_m: core::array::from_fn(|i| found[6 + i]),
        device_inertia_ratio: core::array::from_fn(|i| found[i]),
        covariance: covariance.into(),
        by_sensors,
        sensor_errors: *sensor_errors,
        settings: *settings,
        // Another wheel's inertia would change what is left along this: along it everything is possible.
        block_apart: squared_distance(&left, &(block_covariance + by_wheel * by_wheel.transpose())),
    })
}

/// What the throws of a calibration say.
struct Learned {
    /// The ten numbers of a calibration.
    found: SVector<f64, 10>,
    covariance: SMatrix<f64, 10, 10>,
    /// Entries of the block's inertia by the throws less those that were told, kg m^2.
    left: SVector<f64, 6>,
    left_covariance: SMatrix<f64, 6, 6>,
    /// What all of the wheel's inertia gives of the block's, kg m^2.
    by_wheel: SVector<f64, 6>,
}

/// What the throws of a calibration say, the sensors' errors taken as they are said.
fn learn(
    device: &[ThrowRecord],
    proof: &[ThrowRecord],
    device_mass_kg: f64,
    proof_block: &InertialParameters<f64>,
    sensor_errors: &SensorErrors,
    settings: &ThrowSettings,
) -> Result<Learned, IdentificationError> {
    let (device, device_covariance) = average(device, sensor_errors, settings)?;
    let (proof, proof_covariance) = average(proof, sensor_errors, settings)?;

    let (reduced_mass_kg, offset_by_com) = two_bodies(device_mass_kg, proof_block.mass);
    let offset = (proof.fixed_rows::<3>(6) - device.fixed_rows::<3>(6)) * offset_by_com;
    let ratio: SVector<f64, 6> = proof.fixed_rows::<6>(0) - device.fixed_rows::<6>(0);
    let inertia = symmetric_entries(&proof_block.inertia_about_com()) + parallel_axis(&offset) * reduced_mass_kg;
    // Off-diagonal entries stand twice in the matrix.
    let twice = SVector::<f64, 6>::from([1.0, 2.0, 2.0, 1.0, 2.0, 1.0]);
    let norm_squared = ratio.component_mul(&twice).dot(&ratio);
    let wheel_inertia = ratio.component_mul(&twice).dot(&inertia) / norm_squared;
    if !(wheel_inertia.is_finite() && wheel_inertia > 0.0) {
        return Err(IdentificationError::NotPositive { index: 2, value: wheel_inertia });
    }

    // The wheel's inertia by the mean of the proof throws (and, with the other sign, of the device's).
    let by_ratio = (inertia - ratio * (2.0 * wheel_inertia)).component_mul(&twice).transpose() / norm_squared;
    let by_com = ratio.component_mul(&twice).transpose()
        * parallel_axis_derivative(&offset)
        * (reduced_mass_kg * offset_by_com / norm_squared);
    let mut by_proof = SMatrix::<f64, 1, 9>::zeros();
    by_proof.fixed_columns_mut::<6>(0).copy_from(&by_ratio);
    by_proof.fixed_columns_mut::<3>(6).copy_from(&by_com);
    let mut by_device = SMatrix::<f64, 10, 9>::identity();
    by_device.row_mut(9).copy_from(&-by_proof);
    let mut covariance = by_device * device_covariance * by_device.transpose();
    covariance[(9, 9)] += (by_proof * proof_covariance * by_proof.transpose())[0];

    let mut found = SVector::<f64, 10>::zeros();
    found.fixed_rows_mut::<9>(0).copy_from(&device);
    found[9] = wheel_inertia;
    let mut left_by_fall = SMatrix::<f64, 6, 9>::zeros();
    left_by_fall.fixed_columns_mut::<6>(0).copy_from(&(SMatrix::<f64, 6, 6>::identity() * wheel_inertia));
    let by_com = parallel_axis_derivative(&offset) * (-reduced_mass_kg * offset_by_com);
    left_by_fall.fixed_columns_mut::<3>(6).copy_from(&by_com);
    Ok(Learned {
        found,
        covariance,
        left: ratio * wheel_inertia - inertia,
        left_covariance: left_by_fall * (device_covariance + proof_covariance) * left_by_fall.transpose(),
        by_wheel: ratio * wheel_inertia,
    })
}

impl WheelCalibration {
    /// Whether the throws of the calibration agree with the block that was told.
    pub fn verdict(&self) -> Verdict {
        let all = self.covariance.len();
        let counted = Counted { rank: all, asked: all, chi_square: Some(self.block_apart), ..Counted::default() };
        Judge::new(BodyScale::UNIT).weigh(&counted, &Evidence::default())
    }

    /// Itself when its numbers can be those of a device, for calibrations that come from outside.
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`] (component 0: wheel inertia, 1: device mass, 2: a variance or a squared distance, 3 to 5: a gyro's
    /// factor), [`IdentificationError::NotFinite`] (row 0: centre of mass, 1: inertia, 2: covariance, 3: sensors' errors),
    /// those of [`ThrowSettings::validated`].
    pub fn validated(self) -> Result<Self, IdentificationError> {
        let errors = &self.sensor_errors;
        let sensors = [
            &errors.gyro_factor_sigma[..],
            &errors.gyro_shear,
            &errors.gyro_shear_sigma,
            &errors.wheel_tilt,
            &errors.wheel_tilt_sigma,
            &[errors.wheel_delay_s, errors.wheel_delay_sigma_s],
            errors.shifts.as_flattened(),
            self.by_sensors.as_flattened(),
        ]
        .concat();
        let numbers = [&self.device_com_m[..], &self.device_inertia_ratio, self.covariance.as_flattened(), &sensors];
        if let Some(row) = numbers.iter().position(|numbers| numbers.iter().any(|number| !number.is_finite())) {
            return Err(IdentificationError::NotFinite { row });
        }
        let scales = [(0, self.wheel_inertia_kg_m2), (1, self.device_mass_kg)];
        for (index, value) in scales.into_iter().chain((3..).zip(errors.gyro_factor)) {
            if !(value.is_finite() && value > 0.0) {
                return Err(IdentificationError::NotPositive { index, value });
            }
        }
        let squares = (0..10).map(|i| self.covariance[i][i]).chain([self.block_apart]);
        if let Some(value) = squares.into_iter().find(|square| square.is_nan() || *square < 0.0) {
            return Err(IdentificationError::NotPositive { index: 2, value });
        }
        self.settings.validated()?;
        Ok(self)
    }
}

/// Mean and covariance of `[inertia_ratio; lever_arm]` over throws.
fn average(
    throws: &[ThrowRecord],
    sensor_errors: &SensorErrors,
    settings: &ThrowSettings,
) -> Result<(SVector<f64, 9>, SMatrix<f64, 9, 9>), IdentificationError> {
    let (mut mean, mut covariance) = (SVector::zeros(), SMatrix::zeros());
    let share = 1.0 / throws.len() as f64;
    for throw in throws {
        let (value, spread) = FreeFallEstimate::from_reading(throw, sensor_errors, settings)?.stacked();
        mean += value * share;
        covariance += spread * (share * share);
    }
    Ok((mean, covariance))
}

impl WheelCalibration {
    /// The ten numbers of the covariance.
    pub(super) fn stacked(&self) -> SVector<f64, 10> {
        let numbers = [&self.device_inertia_ratio[..], &self.device_com_m, &[self.wheel_inertia_kg_m2]].concat();
        SVector::from_iterator(numbers)
    }
}

impl FreeFallEstimate {
    /// `[inertia_ratio; lever_arm]` and its covariance (the two come from different sensors).
    pub(super) fn stacked(&self) -> (SVector<f64, 9>, SMatrix<f64, 9, 9>) {
        let (mut value, mut covariance) = (SVector::<f64, 9>::zeros(), SMatrix::<f64, 9, 9>::zeros());
        value.fixed_rows_mut::<6>(0).copy_from(&self.inertia_ratio);
        value.fixed_rows_mut::<3>(6).copy_from(&self.lever_arm_m);
        covariance.fixed_view_mut::<6, 6>(0, 0).copy_from(&self.inertia_ratio_covariance);
        covariance.fixed_view_mut::<3, 3>(6, 6).copy_from(&self.lever_arm_covariance);
        (value, covariance)
    }
}
