//! How well a designed motion can show the parameters of a body, before it is flown.

use super::joint_information::{BasisTable, JointInformation, WrenchRows, coefficient_std};
use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::estimator::standard_deviations;
use crate::fourier::{AttitudeChart, FourierMotion};
use crate::jacobi::singular_values;
use crate::{BodyScale, Noise, Observability, SquareRootInformation, StandardDeviations};
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};

/// Noise below this (m, rad, N, N m) is none.
const FLOOR: f64 = 1e-12;
/// Part of an undetermined direction, in units of the body's size, that hides a quantity.
const SMALLEST_PART: f64 = 1e-6;

/// The smallest covariance that an unbiased estimate from averaged cycles can have, the motion being measured too.
#[derive(Clone, Debug, PartialEq)]
pub struct CramerRao {
    /// What the data say about the ten parameters, the coefficients of the motion eliminated.
    pub information: SquareRootInformation<10>,
    /// Directions that the motion shows; those that it does not, in words.
    pub observability: Observability,
    /// Bound on the covariance of [`InertialParameters::to_vector`]; `None` below rank ten.
    pub covariance: Option<SMatrix<f64, 10, 10>>,
    /// Bounds on standard deviations; infinite for what the motion does not show.
    pub std: StandardDeviations,
    /// The same if the poses were exact: what the noise of the wrenches alone costs.
    pub std_of_known_motion: StandardDeviations,
}

/// The Cramér-Rao bound of a motion flown `cycles` times and averaged.
///
/// `noise` is that of one sample: torque, force, attitude and position; rates, velocities and accelerations do not enter.
/// Attitude noise counts as noise of each Euler angle, or half of it of each component of the quaternion, as in a
/// [`PeriodicRecord`](super::PeriodicRecord). Gravity is not counted on.
/// # Errors
/// [`IdentificationError::TooManyHarmonics`]; [`IdentificationError::NotPositive`] for no cycles (index 0) or for noise that
/// is negative or not finite (torque 1, force 2, attitude 3, position 4); [`IdentificationError::NotFinite`] naming the
/// sample at which the quaternion is zero; [`IdentificationError::InvalidScale`] for a body without mass or extent.
/// # Source
/// Thesis (2.15), (2.18), with the coefficients of (4.13) as nuisance parameters.
/// # Deviation
/// The criteria (4.14) and (4.15) take the motion as known; with the poses' noise the bound is a different one
/// (`tests/suite/periodic_likelihood.rs`, `attains_the_bound_where_least_squares_does_not`).
pub fn cramer_rao(
    motion: &FourierMotion,
    body: &InertialParameters<f64>,
    samples_per_cycle: usize,
    cycles: usize,
    noise: &Noise,
) -> Result<CramerRao, IdentificationError> {
    let (basis, parameters) = (motion.basis(), body.to_vector());
    let (harmonics, samples) = (basis.harmonics(), samples_per_cycle);
    if 2 * harmonics >= samples {
        return Err(IdentificationError::TooManyHarmonics { harmonics, samples });
    }
    let stated = [cycles as f64, noise.torque_n_m, noise.force_n, noise.attitude_rad, noise.position_m];
    for (index, value) in stated.into_iter().enumerate() {
        if !value.is_finite() || value < 0.0 || (index == 0 && value == 0.0) {
            return Err(IdentificationError::NotPositive { index, value });
        }
    }
    let averaged = |std: f64| (std / stated[0].sqrt()).max(FLOOR);
    let [torque, force] = [noise.torque_n_m, noise.force_n].map(averaged);
    let wrench_std = SVector::from([torque, torque, torque, force, force, force]);
    let per_coordinate = match motion.chart() {
        AttitudeChart::EulerZyx => 1.0,
        AttitudeChart::Quaternion => 0.5,
    };
    let channel_std: Vec<f64> = (0..3 + motion.chart().channels())
        .map(|channel| averaged(if channel < 3 { noise.position_m } else { per_coordinate * noise.attitude_rad }))
        .collect();
    let std = coefficient_std(basis, samples, &channel_std);
    let mut joint = JointInformation::of_poses(&std, &DMatrix::zeros(std.nrows(), std.ncols()));
    let mut known = SquareRootInformation::new();
    let times_s = (0..samples).map(|i| basis.period_s() * i as f64 / samples as f64);
    let table = BasisTable::new(basis, times_s, Vector3::zeros());
    for (row, (instant, functions)) in table.instants(motion.chart(), motion.coefficients()).enumerate() {
        let instant = instant.ok_or(IdentificationError::NotFinite { row })?;
        let rows = WrenchRows::new(&instant, &parameters, &wrench_std);
        joint.add(&rows, functions, &SVector::zeros());
        known.update(&rows.regressor, &SVector::zeros())?;
    }
    let information = joint.of_body()?;
    let scale = BodyScale::of(&parameters)?;
    let observability = Observability::new(&information, scale);
    let covariance = match observability.rank() {
        10 => Some(information.covariance(&scale.parameter_magnitudes())?),
        _ => None,
    };
    Ok(CramerRao {
        std: bounds(&information, &observability, scale, &parameters),
        std_of_known_motion: bounds(&known, &Observability::new(&known, scale), scale, &parameters),
        covariance,
        observability,
        information,
    })
}

/// Standard deviations from the directions that are determined, infinite where others take part.
fn bounds(
    information: &SquareRootInformation<10>,
    observability: &Observability,
    scale: BodyScale,
    parameters: &SVector<f64, 10>,
) -> StandardDeviations {
    let magnitudes = scale.parameter_magnitudes();
    let (values, right) = singular_values(information.scaled_factor(&magnitudes));
    let spread = |directions: core::ops::Range<usize>, size: &dyn Fn(usize) -> f64| {
        let mut root = SMatrix::<f64, 10, 10>::zeros();
        for direction in directions {
            root.set_column(direction, &(right.column(direction).component_mul(&magnitudes) * size(direction)));
        }
        standard_deviations(parameters, &(root * root.transpose()))
    };
    let shown = spread(0..observability.rank(), &|direction| 1.0 / values[direction]);
    let hidden = spread(observability.rank()..10, &|_| 1.0);
    let or_infinite =
        |shown: f64, hidden: f64, size: f64| if hidden > SMALLEST_PART * size { f64::INFINITY } else { shown };
    let (mass, length) = (scale.mass_kg(), scale.length_m());
    let (c, j) = (shown.center_of_mass_m, shown.inertia_about_com_kg_m2);
    let (hidden_c, hidden_j) = (hidden.center_of_mass_m, hidden.inertia_about_com_kg_m2);
    StandardDeviations {
        mass_kg: or_infinite(shown.mass_kg, hidden.mass_kg, mass),
        center_of_mass_m: Vector3::from_fn(|i, _| or_infinite(c[i], hidden_c[i], length)),
        inertia_about_com_kg_m2: Matrix3::from_fn(|i, k| {
            or_infinite(j[(i, k)], hidden_j[(i, k)], mass * length * length)
        }),
    }
}
