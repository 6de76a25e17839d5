//! One throw of an object: what was thrown, less the device.

use super::calibration::WheelCalibration;
use super::momentum_balance::{FreeFallEstimate, squared_distance};
use super::regressors::{parallel_axis, parallel_axis_derivative, symmetric_entries, symmetric_matrix, two_bodies};
use super::throw_record::{EndOfFall, ThrowRecord};
use crate::estimator::{Counted, Estimator, EstimatorError, Evidence, Finding, Judge, Verdict};
use crate::{BodyScale, IdentificationError};
use tumble_dynamics::InertialParameters;
use tumble_lie::nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// An inertia moved by more than this to that of a body, squared, in standard deviations and per entry, was none but for noise.
const BEYOND_NOISE: f64 = 4.0;
/// A mean square so many standard deviations above one is not chance.
const BEYOND_CHANCE: f64 = 4.0;

/// What one throw says about the body that was thrown.
///
/// # Frame
/// Body axes of the device; positions from its inertial sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThrowEstimate {
    /// Inertia of device and object about their common centre of mass, wheel at rest included, kg m^2.
    pub total_inertia_about_com: Matrix3<f64>,
    /// Covariance of its `[11, 12, 13, 22, 23, 33]` entries, kg^2 m^4.
    pub total_inertia_covariance: SMatrix<f64, 6, 6>,
    /// Common centre of mass, m.
    pub total_com_m: Vector3<f64>,
    /// Covariance of the common centre of mass, m^2.
    pub total_com_covariance: Matrix3<f64>,
    /// The object alone, where its mass is known.
    pub object: Option<ObjectEstimate>,
    /// Last instant of free fall that was used, s.
    pub end_s: f64,
    /// Why the free fall ends there.
    pub end: EndOfFall,
    /// Averaging windows used.
    pub windows: usize,
    /// Share of what the wheel does to the angular momentum that the inertia explains.
    pub explained: f64,
    /// Whether the numbers may be used: those of the object where its mass is known, else those of device and object.
    pub verdict: Verdict,
}

/// The object without the device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectEstimate {
    /// The object, physically consistent; origin in the inertial sensor.
    pub body: InertialParameters<f64>,
    /// Whether the data asked for an inertia no body has, and the nearest one of a body stands here.
    pub projected: bool,
    /// How far outside of the bodies that can be the data's inertia is, negative, where noise does not explain it; see
    /// [`InertialParameters::consistency_margin`].
    pub outside: Option<f64>,
    /// Covariance of the inertia about the centre of mass, entries `[11, 12, 13, 22, 23, 33]`, kg^2 m^4.
    pub inertia_covariance: SMatrix<f64, 6, 6>,
    /// Covariance of the centre of mass, m^2.
    pub com_covariance: Matrix3<f64>,
    /// Principal inertias, ascending, kg m^2.
    pub principal_inertia: Vector3<f64>,
    /// One sigma of each, kg m^2.
    pub principal_inertia_sigma: Vector3<f64>,
    /// Where those sigmas come from.
    pub budget: ErrorBudget,
    /// Principal axes in the columns, right-handed.
    pub body_from_principal: Matrix3<f64>,
}

/// One sigma of each principal inertia by what it comes from, kg m^2; their squares sum to the whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorBudget {
    /// Noise and residual torque of this throw.
    pub throw: Vector3<f64>,
    /// Device and wheel, by the throws of the calibration.
    pub calibration: Vector3<f64>,
    /// Scale and directions of the gyro's axes, direction of the wheel's; in this throw and in the calibration.
    pub sensor_axes: Vector3<f64>,
    /// Delay of the wheel's telemetry; in this throw and in the calibration.
    pub wheel_delay: Vector3<f64>,
}

/// Identifies what was thrown, the record as it was measured; with its mass also the object without the device.
///
/// # Errors
/// Those of [`FreeFallEstimate::from_throw`]; [`IdentificationError::NotPositive`] for the mass.
pub fn identify_throw(
    record: &ThrowRecord,
    calibration: &WheelCalibration,
    object_mass_kg: Option<f64>,
) -> Result<ThrowEstimate, IdentificationError> {
    let errors = &calibration.sensor_errors;
    let fall = FreeFallEstimate::from_reading(record, errors, &calibration.settings)?;
    let nominal = Reading { fall: fall.stacked().0, device: calibration.stacked() };
    let mut shifted = [nominal; 8];
    for ((reading, shift), changes) in shifted.iter_mut().zip(&errors.shifts).zip(&calibration.by_sensors) {
        if shift.iter().any(|change| *change != 0.0) {
            reading.fall =
                FreeFallEstimate::from_reading(record, &errors.shifted(shift), &calibration.settings)?.stacked().0;
            reading.device += SVector::from(*changes);
        }
    }
    let wheel = calibration.wheel_inertia_kg_m2;
    let wheel_variance = calibration.covariance[9][9];
    let total = nominal.total();
    let object =
        object_mass_kg.map(|mass_kg| without_device(&fall, calibration, mass_kg, &nominal, &shifted)).transpose()?;
    let total_inertia_about_com = symmetric_matrix(&total);
    let total_inertia_covariance = fall.inertia_ratio_covariance * (wheel * wheel)
        + fall.inertia_ratio * fall.inertia_ratio.transpose() * wheel_variance
        + spread(&nominal, &shifted, Reading::total);
    let total_com_covariance =
        fall.lever_arm_covariance + spread(&nominal, &shifted, |reading| reading.fall.fixed_rows::<3>(6).into());
    let of_total =
        (calibration.device_mass_kg, total_inertia_about_com.trace(), &total_inertia_covariance, &total_com_covariance);
    let of_object = object.as_ref().map(|object| {
        let trace = object.body.inertia_about_com().trace();
        (object.body.mass, trace, &object.inertia_covariance, &object.com_covariance)
    });
    let outside = object.as_ref().and_then(|object| object.outside);
    Ok(ThrowEstimate {
        verdict: verdict(of_object.unwrap_or(of_total), outside, &fall, calibration)?,
        total_inertia_about_com,
        total_inertia_covariance,
        total_com_m: fall.lever_arm_m,
        total_com_covariance,
        object,
        end_s: fall.end_s,
        end: fall.end,
        windows: fall.windows,
        explained: fall.explained,
    })
}

/// The verdict on a body of this mass and trace of the inertia, with these covariances of inertia and centre, in units of itself: how much is
/// explained and left, another look at the same fall, the block of the calibration, widths, and whether it is a body but for noise.
fn verdict(
    (mass_kg, trace, inertia, com): (f64, f64, &SMatrix<f64, 6, 6>, &Matrix3<f64>),
    outside: Option<f64>,
    fall: &FreeFallEstimate,
    calibration: &WheelCalibration,
) -> Result<Verdict, IdentificationError> {
    let scale = BodyScale::try_new(mass_kg, (0.5 * trace / mass_kg).max(0.0).sqrt())?;
    let judge = Judge::new(scale);
    // An average of a raised cosine is worth that of half its length: windows that overlap more are no further ones.
    let apart = (2.0 * calibration.settings.window_step_s / calibration.settings.window_s).min(1.0);
    let freedom = (3 * fall.windows).saturating_sub(6).max(1) as f64 * apart;
    let of_inertia = inertia.diagonal() / (mass_kg * scale.length_m() * scale.length_m()).powi(2);
    let of_com = com.diagonal() / scale.length_m().powi(2);
    let counted = Counted {
        rank: 9,
        asked: 9,
        wide: judge.first_wide(of_inertia.iter().chain(&of_com).map(|variance| variance.sqrt())),
        mean_nis: Some(fall.mean_square).filter(|mean| *mean > 1.0 + BEYOND_CHANCE * (2.0 / freedom).sqrt()),
        chi_square: Some(fall.fast_apart.max(calibration.block_apart)),
        margin: outside,
        ..Counted::default()
    };
    Ok(judge.weigh(&counted, &Evidence::of_sums(1.0, 1.0 - fall.explained)))
}

/// What a throw and the calibration say, were the sensors to err in some way.
#[derive(Clone, Copy)]
struct Reading {
    /// `[inertia_ratio; lever_arm]`.
    fall: SVector<f64, 9>,
    /// `[device_inertia_ratio; device_com_m; wheel_inertia_kg_m2]`.
    device: SVector<f64, 10>,
}

impl Reading {
    /// Entries of the inertia of device and object, kg m^2.
    fn total(&self) -> SVector<f64, 6> {
        self.fall.fixed_rows::<6>(0) * self.device[9]
    }

    /// From the device's centre of mass to the object's, m.
    fn offset(&self, offset_by_com: f64) -> Vector3<f64> {
        (self.fall.fixed_rows::<3>(6) - self.device.fixed_rows::<3>(6)) * offset_by_com
    }

    /// Entries of the inertia of the object, kg m^2.
    fn object(&self, reduced_mass_kg: f64, offset_by_com: f64) -> SVector<f64, 6> {
        let ratio = self.fall.fixed_rows::<6>(0) - self.device.fixed_rows::<6>(0);
        ratio * self.device[9] - parallel_axis(&self.offset(offset_by_com)) * reduced_mass_kg
    }
}

/// Covariance of a quantity by independent changes of one sigma each.
fn spread<const N: usize>(
    nominal: &Reading,
    shifted: &[Reading],
    quantity: impl Fn(&Reading) -> SVector<f64, N>,
) -> SMatrix<f64, N, N> {
    let changes = shifted.iter().map(|reading| quantity(reading) - quantity(nominal));
    changes.map(|change| change * change.transpose()).sum()
}

/// Device and object of a throw by [`identify_throw`], as an estimator of nine parameters: the `[11, 12, 13, 22, 23, 33]` entries of the
/// inertia about the common centre of mass, kg m^2, then that centre, m.
///
/// Standard deviations of the principal inertias and of the centre hold (`wheel_throws`); the nine numbers jointly are stated too well
/// for the law `check_coverage`.
#[derive(Debug, Clone, PartialEq)]
pub struct Thrown {
    calibration: WheelCalibration,
}

impl Thrown {
    /// By a device calibrated so.
    pub fn new(calibration: WheelCalibration) -> Self {
        Self { calibration }
    }
}

impl Estimator<9> for Thrown {
    type Record = ThrowRecord;

    fn estimate(&self, record: &ThrowRecord) -> Result<Finding<9>, EstimatorError> {
        let found = identify_throw(record, &self.calibration, None)?;
        let (mut point, mut covariance) = (SVector::<f64, 9>::zeros(), SMatrix::<f64, 9, 9>::zeros());
        point.fixed_rows_mut::<6>(0).copy_from(&symmetric_entries(&found.total_inertia_about_com));
        point.fixed_rows_mut::<3>(6).copy_from(&found.total_com_m);
        covariance.fixed_view_mut::<6, 6>(0, 0).copy_from(&found.total_inertia_covariance);
        covariance.fixed_view_mut::<3, 3>(6, 6).copy_from(&found.total_com_covariance);
        let magnitudes = covariance.diagonal().map(f64::sqrt);
        Finding::of_covariance(point, &covariance, magnitudes)
    }
}

/// `j (X - X_device) - mu (|d|^2 1 - d d^T)`, with `d` from the device's centre of mass to the object's, `mu` the reduced
/// mass: the total less the device less the two parallel-axis terms.
fn without_device(
    fall: &FreeFallEstimate,
    calibration: &WheelCalibration,
    mass_kg: f64,
    nominal: &Reading,
    shifted: &[Reading; 8],
) -> Result<ObjectEstimate, IdentificationError> {
    if !(mass_kg.is_finite() && mass_kg > 0.0) {
        return Err(IdentificationError::NotPositive { index: 0, value: mass_kg });
    }
    let device_com = Vector3::from(calibration.device_com_m);
    let wheel = calibration.wheel_inertia_kg_m2;
    let (reduced_mass_kg, offset_by_com) = two_bodies(calibration.device_mass_kg, mass_kg);
    let offset = nominal.offset(offset_by_com);
    let ratio = fall.inertia_ratio - SVector::from(calibration.device_inertia_ratio);
    let entries = |reading: &Reading| reading.object(reduced_mass_kg, offset_by_com);
    let measured = symmetric_matrix(&entries(nominal));

    // By [X; r] of the throw; by the device's with the opposite sign; by the wheel.
    let (fall_value_covariance, calibration_covariance) =
        (fall.stacked().1, SMatrix::<f64, 10, 10>::from(calibration.covariance));
    let mut by_fall = SMatrix::<f64, 6, 9>::zeros();
    by_fall.fixed_columns_mut::<6>(0).copy_from(&(SMatrix::<f64, 6, 6>::identity() * wheel));
    let by_com = parallel_axis_derivative(&offset) * (-reduced_mass_kg * offset_by_com);
    by_fall.fixed_columns_mut::<3>(6).copy_from(&by_com);
    let mut by_calibration = SMatrix::<f64, 6, 10>::zeros();
    by_calibration.fixed_columns_mut::<9>(0).copy_from(&-by_fall);
    by_calibration.column_mut(9).copy_from(&ratio);
    let (axes, delay) = shifted.split_at(7);
    let parts = [
        by_fall * fall_value_covariance * by_fall.transpose(),
        by_calibration * calibration_covariance * by_calibration.transpose(),
        spread(nominal, axes, entries),
        spread(nominal, delay, entries),
    ];
    let inertia_covariance = parts.iter().sum();

    let about_com = InertialParameters::about_com(mass_kg, Vector3::zeros(), measured);
    let consistent = about_com.nearest_consistent()?;
    let inertia = consistent.inertia_about_com();
    let moved = symmetric_entries(&(inertia - measured));
    let beyond_noise = squared_distance(&moved, &inertia_covariance) > BEYOND_NOISE;
    let com = device_com + offset;
    let device_com_covariance = calibration_covariance.fixed_view::<3, 3>(6, 6).into_owned();
    // r_object = r + (m_device / m) (r - r_device)
    let share = calibration.device_mass_kg / mass_kg;
    let of_object = |reading: &Reading| reading.device.fixed_rows::<3>(6) + reading.offset(offset_by_com);
    let com_covariance = fall.lever_arm_covariance * (1.0 + share).powi(2)
        + device_com_covariance * (share * share)
        + spread(nominal, shifted, of_object);

    let (principal_inertia, body_from_principal) = principal(&inertia);
    let sigma = |covariance: &SMatrix<f64, 6, 6>| {
        Vector3::from_fn(|i, _| {
            let axis = body_from_principal.column(i).into_owned();
            let gradient = symmetric_entries(&(axis * axis.transpose()))
                .component_mul(&SVector::from([1.0, 2.0, 2.0, 1.0, 2.0, 1.0]));
            (covariance * gradient).dot(&gradient).max(0.0).sqrt()
        })
    };
    let [throw, calibration, sensor_axes, wheel_delay] = parts.each_ref().map(sigma);
    Ok(ObjectEstimate {
        body: InertialParameters::about_com(mass_kg, com, inertia),
        projected: !about_com.is_consistent(),
        outside: Some(about_com.consistency_margin()).filter(|margin| *margin < 0.0 && beyond_noise),
        inertia_covariance,
        com_covariance,
        principal_inertia,
        principal_inertia_sigma: sigma(&inertia_covariance),
        budget: ErrorBudget { throw, calibration, sensor_axes, wheel_delay },
        body_from_principal,
    })
}

/// Principal values, ascending, with right-handed axes.
fn principal(inertia: &Matrix3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    let eigen = inertia.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let mut axes = Matrix3::from_columns(&order.map(|i| eigen.eigenvectors.column(i).into_owned()));
    if axes.determinant() < 0.0 {
        axes.neg_mut();
    }
    (Vector3::from(order.map(|i| eigen.eigenvalues[i])), axes)
}
