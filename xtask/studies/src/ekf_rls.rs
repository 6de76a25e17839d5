//! Problem 5: four parameters by an extended Kalman filter, ten by recursive least squares and by the recursive SDP.

use nalgebra::{Matrix4, SMatrix, SVector, Vector3, Vector4, Vector6};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_identification::estimator::RecursiveEstimator;
use tumble_identification::lie::Wrench;
use tumble_identification::recursive::{
    AccelerationObservation, ExtendedKalmanFilter, LinearObservation, PrincipalBody, PrincipalMotion,
    RecursiveLeastSquares, RecursiveSdp, SquareRootFilter, UnscentedKalmanFilter,
};
use tumble_identification::{BodyScale, InteriorPoint, PseudoInertiaCone};

use crate::Failure;
use crate::bench::{Bench, Goal, numbers};
use crate::dynamics::ch5_body;
use crate::ident_sdp;
use tumble_identification::noise::signed_unit;

const PROBLEM: &str = "ekf_rls";
/// Mass and principal moments behind the frozen data.
const TRUTH: [f64; 4] = [9.5838, 0.1534, 0.1427, 0.1623];
/// Standard deviation of a wrench row of problem 4, and of the prior, as the peers take them.
const ROW_DEVIATION: f64 = 0.02;
const PRIOR_DEVIATION: f64 = 100.0;

pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    if let Some(folder) = &bench.data {
        let path = folder.join("ekf_data.csv");
        let rows = numbers(&path)?;
        let observations = rows
            .iter()
            .map(|row| observation(row).ok_or_else(|| Failure::file(&path, "a row has other than 16 numbers")))
            .collect::<Result<Vec<_>, _>>()?;
        four_parameters(bench, &observations)?;
        return ten_parameters(bench, &ident_sdp::trajectory(folder)?);
    }
    eprintln!("skipped: the frozen data of problem 5 (--data DIR); only updates of random rows are timed");
    let mut generator = ChaCha8Rng::seed_from_u64(5);
    let mut random = || {
        let block = SMatrix::from_fn(|_, _| signed_unit(&mut generator));
        (block, block * ch5_body().to_vector())
    };
    ten_parameters(bench, &(0..600).map(|_| random()).collect())
}

fn failed(error: impl std::fmt::Display) -> Failure {
    Failure::TargetMissed(format!("{PROBLEM}: {error}"))
}

fn observation(row: &[f64]) -> Option<AccelerationObservation> {
    let at = |i: usize| Some(Vector3::new(*row.get(i)?, *row.get(i + 1)?, *row.get(i + 2)?));
    let (linear, angular) = (at(10)?, at(13)?);
    Some(AccelerationObservation {
        rate_body: at(1)?,
        wrench_body: Wrench::new(at(7)?, at(4)?),
        acceleration_body: Vector6::new(angular.x, angular.y, angular.z, linear.x, linear.y, linear.z),
        standard_deviation: Vector6::new(1e-2, 1e-2, 1e-2, 2e-3, 2e-3, 2e-3),
    })
}

fn four_parameters(bench: &Bench, observations: &[AccelerationObservation]) -> Result<(), Failure> {
    let guess = PrincipalBody::try_new(12.0, Vector3::repeat(0.2)).map_err(failed)?;
    let covariance = |diagonal: [f64; 4]| guess.increment_covariance(&Matrix4::from_diagonal(&diagonal.into()));
    let model = PrincipalMotion { drift: covariance([1e-8, 1e-12, 1e-12, 1e-12]).diagonal() };
    let prior = covariance([9.0, 2.5e-3, 2.5e-3, 2.5e-3]);
    let extended = ExtendedKalmanFilter::new(model, guess, prior);
    let quality = quality_of_four(extended, observations)?;
    let goal = Goal::at(200.0, "eigen-cpp handwritten", 299.0);
    let mut filter = extended;
    bench.sweep(PROBLEM, "ekf4", goal, observations.len(), &quality, |i| {
        if i == 0 {
            filter = extended;
        }
        filter.update(&observations[i])
    });
    let unscented = UnscentedKalmanFilter::new(model, guess, prior);
    let quality = quality_of_four(unscented, observations)?;
    let mut filter = unscented;
    bench.sweep(PROBLEM, "ukf4", Goal::default(), observations.len(), &quality, |i| {
        if i == 0 {
            filter = unscented;
        }
        filter.update(&observations[i])
    });
    Ok(())
}

/// Relative errors of the four parameters after the last observation, and the largest in standard deviations.
fn quality_of_four(
    mut filter: impl RecursiveEstimator<4, Observation = AccelerationObservation>,
    observations: &[AccelerationObservation],
) -> Result<[(&'static str, f64); 5], Failure> {
    for observation in observations {
        filter.update(observation).map_err(failed)?;
    }
    let found = filter.finding().map_err(failed)?;
    let error = found.point().copied().unwrap_or_default() - Vector4::from(TRUTH);
    let relative = error.abs().component_div(&Vector4::from(TRUTH));
    let normalised = error.component_div(&found.covariance().map_err(failed)?.diagonal().map(f64::sqrt)).amax();
    Ok([
        ("relerr_m", relative[0]),
        ("relerr_ixx", relative[1]),
        ("relerr_iyy", relative[2]),
        ("relerr_izz", relative[3]),
        ("worst_in_sigma", normalised),
    ])
}

fn ten_parameters(bench: &Bench, rows: &ident_sdp::Rows) -> Result<(), Failure> {
    let observations: Vec<LinearObservation<6, 10>> = rows
        .iter()
        .map(|(regressor, output)| LinearObservation {
            regressor: *regressor,
            output: *output,
            standard_deviation: Vector6::repeat(ROW_DEVIATION),
        })
        .collect();
    let (zero, deviation) = (SVector::<f64, 10>::zeros(), SVector::<f64, 10>::repeat(PRIOR_DEVIATION));
    let covariance = SMatrix::from_diagonal(&deviation.map(|s| s * s));
    let goal = Goal::at(500.0, "eigen-cpp covariance form", 635.0);
    timed(bench, "rls10", goal, RecursiveLeastSquares::new(zero, covariance), &observations)?;
    let goal = Goal::shown("eigen-cpp QR square-root form", 1430.0);
    let filter = SquareRootFilter::try_new(zero, deviation).map_err(failed)?;
    timed(bench, "square_root10", goal, filter, &observations)?;
    let cone = PseudoInertiaCone::with_absolute_floor(BodyScale::try_new(5.0, 0.8).map_err(failed)?, ident_sdp::FLOOR);
    let sdp = RecursiveSdp::try_with_prior(cone, zero, deviation).map_err(failed)?;
    recursive_sdp(bench, &sdp, &observations)
}

fn timed<E>(
    bench: &Bench,
    item: &'static str,
    goal: Goal,
    start: E,
    observations: &[LinearObservation<6, 10>],
) -> Result<(), Failure>
where
    E: RecursiveEstimator<10, Observation = LinearObservation<6, 10>> + Copy,
{
    let mut filter = start;
    for observation in observations {
        filter.update(observation).map_err(failed)?;
    }
    let truth = ch5_body().to_vector();
    let found = filter.finding().map_err(failed)?.point().copied().unwrap_or_default();
    let quality = [("relerr_final", (found - truth).norm() / truth.norm())];
    bench.sweep(PROBLEM, item, goal, observations.len(), &quality, |i| {
        if i == 0 {
            filter = start;
        }
        filter.update(&observations[i])
    });
    Ok(())
}

/// Every update timed by itself: a few of the first ones meet the boundary, and the 99th percentile is about them.
fn recursive_sdp(
    bench: &Bench,
    start: &RecursiveSdp<InteriorPoint, 10, 6>,
    observations: &[LinearObservation<6, 10>],
) -> Result<(), Failure> {
    let (mut filter, mut outside, mut binding) = (*start, 0, 0);
    for observation in observations {
        filter.update(observation).map_err(failed)?;
        outside += u32::from(ident_sdp::smallest_eigenvalue(&filter.parameters()) <= 0.0);
        binding += u32::from(filter.estimate().is_active());
    }
    let truth = ch5_body().to_vector();
    let quality = [
        ("relerr_final", (filter.parameters() - truth).norm() / truth.norm()),
        ("not_a_body", f64::from(outside)),
        ("binding", f64::from(binding)),
    ];
    let goal = Goal::at(4000.0, "clarabel", 268_000.0);
    bench.each(PROBLEM, "recursive_sdp", goal, observations.len(), &quality, |i| {
        if i == 0 {
            filter = *start;
        }
        filter.update(&observations[i])
    });
    Ok(())
}
