//! Maximum likelihood in coefficient space and the bound it attains.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

use crate::random::Random;
use std::f64::consts::FRAC_1_SQRT_2;
use tumble_identification::dynamics::strategies::body_d;
use tumble_identification::dynamics::{FreeFlyer, InertialParameters};
use tumble_identification::fourier::{AttitudeChart, FourierBasis, FourierMotion};
use tumble_identification::harmonics::{PeriodicLikelihood, PeriodicRecord, cramer_rao, maximum_likelihood};
use tumble_identification::lie::{EulerZyx, Pose};
use tumble_identification::nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3, Vector4};
use tumble_identification::statistics::{Band, mean_square_band, normalized_squared_error, rms_ratio_band};
use tumble_identification::{BodyScale, IdentificationError, Noise, SquareRootInformation, StandardDeviations};

/// A load of the Space CoBot.
fn load() -> InertialParameters<f64> {
    let inertia = Matrix3::new(0.075, 0.012, -0.008, 0.012, 0.062, 0.015, -0.008, 0.015, 0.081);
    InertialParameters::about_com(7.2, Vector3::new(0.03, -0.02, 0.04), inertia)
}

/// The noise of the thesis's chapter 4, one sample of one cycle.
const NOISE: Noise = Noise {
    torque_n_m: 0.001,
    force_n: 0.01,
    attitude_rad: 0.03,
    position_m: 0.05,
    rate_rad_s: 0.0,
    velocity_m_s: 0.0,
    acceleration_m_s2: 0.0,
};
const NO_NOISE: Noise = Noise { torque_n_m: 0.0, force_n: 0.0, attitude_rad: 0.0, position_m: 0.0, ..NOISE };
const PERIOD_S: f64 = 10.0;

/// Rest to rest within 0.75 m and `angle_rad`; channels that are not `moving` stay zero.
fn excitation(seed: u64, harmonics: usize, angle_rad: f64, moving: [bool; 6]) -> FourierMotion {
    let mut random = Random::new(seed);
    let basis = FourierBasis::try_new(PERIOD_S, harmonics).unwrap();
    let rest = basis.rest_to_rest();
    let mut coefficients = &rest * DMatrix::from_fn(rest.ncols(), 6, |_, _| random.normal());
    let times_s: Vec<f64> = (0..500).map(|i| PERIOD_S * f64::from(i) / 500.0).collect();
    let [values, ..] = basis.table(&times_s);
    for (channel, moves) in moving.into_iter().enumerate() {
        let largest = (&values * coefficients.column(channel)).amax();
        let bound = if channel < 3 { 0.75 } else { angle_rad };
        coefficients.column_mut(channel).scale_mut(if moves { bound / largest } else { 0.0 });
    }
    FourierMotion::try_new(basis, AttitudeChart::EulerZyx, coefficients).unwrap()
}

/// Wrench of a body on a motion by the equations of motion, not by a regressor.
fn wrench(motion: &FourierMotion, body: &InertialParameters<f64>, time_s: f64) -> SVector<f64, 6> {
    let reference = motion.at(time_s).unwrap().reference(&Pose::identity());
    FreeFlyer::new(*body).inverse(&reference.state.twist_body, &reference.acceleration).to_vector()
}

/// One averaged period of `cycles`, with noise.
fn record(
    motion: &FourierMotion,
    body: &InertialParameters<f64>,
    (samples, cycles, wrench_offset_s): (usize, usize, f64),
    noise: &Noise,
    random: &mut Random,
) -> PeriodicRecord {
    let averaged = |std: f64| std / (cycles as f64).sqrt();
    let (t, f) = (averaged(noise.torque_n_m), averaged(noise.force_n));
    let period_s = motion.basis().period_s();
    let count = 3 + motion.chart().channels();
    let channel_std: Vec<f64> =
        (0..count).map(|c| averaged(if c < 3 { noise.position_m } else { noise.attitude_rad })).collect();
    let times_s: Vec<f64> = (0..samples).map(|i| period_s * i as f64 / samples as f64).collect();
    let [values, ..] = motion.basis().table(&times_s);
    let mut channels = values * motion.coefficients();
    let mut wrenches = DMatrix::zeros(samples, 6);
    let wrench_std = SVector::from([t, t, t, f, f, f]);
    for (i, time_s) in times_s.into_iter().enumerate() {
        for (channel, std) in channels.row_mut(i).iter_mut().zip(&channel_std) {
            *channel += std * random.normal();
        }
        let noisy = wrench(motion, body, time_s + wrench_offset_s) + wrench_std.map(|std| std * random.normal());
        wrenches.row_mut(i).copy_from_slice(noisy.as_slice());
    }
    PeriodicRecord {
        period_s,
        chart: motion.chart(),
        channels,
        wrenches,
        gravity: Vector3::zeros(),
        wrench_offset_s,
        channel_std,
        wrench_std,
    }
}

/// Least squares on the Fourier fit of the poses, what the likelihood starts from, written independently of it.
fn least_squares(record: &PeriodicRecord, harmonics: usize) -> SVector<f64, 10> {
    let basis = FourierBasis::try_new(record.period_s, harmonics).unwrap();
    let [values, ..] = basis.table(&record.times_s());
    let fit = values.clone().qr();
    let coefficients = fit.r().solve_upper_triangular(&(fit.q().transpose() * &record.channels)).unwrap();
    let motion = FourierMotion::try_new(basis, record.chart, coefficients).unwrap();
    let mut information = SquareRootInformation::<10>::new();
    for (i, time_s) in record.times_s().into_iter().enumerate() {
        let weights = SMatrix::<f64, 6, 6>::from_diagonal(&record.wrench_std.map(|std| 1.0 / std));
        let regressor = motion.at(time_s + record.wrench_offset_s).unwrap().regressor();
        let wrench = SVector::<f64, 6>::from_fn(|c, _| record.wrenches[(i, c)]);
        information.update(&(weights * regressor), &(weights * wrench)).unwrap();
    }
    information.solve(&BodyScale::try_new(7.0, 0.1).unwrap().parameter_magnitudes()).unwrap()
}

/// Errors of mass, centre of mass and the entries of the inertia about it.
fn errors(found: &SVector<f64, 10>, truth: &InertialParameters<f64>) -> [f64; 3] {
    let found = InertialParameters::from_vector(found);
    [
        (found.mass - truth.mass).powi(2),
        (found.center_of_mass() - truth.center_of_mass()).norm_squared(),
        (found.inertia_about_com() - truth.inertia_about_com()).norm_squared(),
    ]
}

fn variances(std: &StandardDeviations) -> [f64; 3] {
    [std.mass_kg.powi(2), std.center_of_mass_m.norm_squared(), std.inertia_about_com_kg_m2.norm_squared()]
}

fn relative_error(found: &PeriodicLikelihood, truth: &InertialParameters<f64>) -> f64 {
    let magnitudes = BodyScale::of(&truth.to_vector()).unwrap().parameter_magnitudes();
    (found.estimate.parameters.to_vector() - truth.to_vector()).component_div(&magnitudes).amax()
}

#[test]
fn perfect_data_give_the_body_back() {
    for (body, seed) in [(load(), 1), (body_d(), 2)] {
        let motion = excitation(seed, 3, 0.8, [true; 6]);
        let offset_s = 0.5 * PERIOD_S / 200.0;
        let mut random = Random::new(seed);
        let exact = record(&motion, &body, (200, 1, offset_s), &NO_NOISE, &mut random);
        let found = maximum_likelihood(&exact, 3).unwrap();
        assert!(relative_error(&found, &body) < 1e-10, "{:e}", relative_error(&found, &body));
        assert!((found.motion.coefficients() - motion.coefficients()).amax() < 1e-11);
        // Where only one side is exact the other follows.
        for noise in [
            Noise { position_m: 0.01, attitude_rad: 0.01, ..NO_NOISE },
            Noise { force_n: 0.01, torque_n_m: 0.001, ..NO_NOISE },
        ] {
            let half = record(&motion, &body, (200, 1, offset_s), &noise, &mut random);
            let found = maximum_likelihood(&half, 3).unwrap();
            assert!(relative_error(&found, &body) < 2e-2, "{:e}", relative_error(&found, &body));
        }
        // Weighed on the ground: the wrench carries the body as well.
        let gravity = Vector3::new(0.5, -1.0, -9.0);
        let mut weighed = PeriodicRecord { gravity, ..exact.clone() };
        for (i, time_s) in weighed.times_s().into_iter().enumerate() {
            let felt =
                motion.at(time_s + offset_s).unwrap().world_from_body.rotation.inverse_transform_vector(&-gravity);
            let support = [body.first_moment.cross(&felt), felt * body.mass];
            for (component, value) in support.iter().flat_map(|vector| vector.iter()).enumerate() {
                weighed.wrenches[(i, component)] += value;
            }
        }
        let found = maximum_likelihood(&weighed, 3).unwrap();
        assert!(relative_error(&found, &body) < 1e-9, "{:e}", relative_error(&found, &body));
        let late = PeriodicRecord { wrench_offset_s: 0.0, ..exact };
        assert!(relative_error(&maximum_likelihood(&late, 3).unwrap(), &body) > 1e-6);
    }
}

/// The wrench does not depend on the length of a quaternion; the poses do, and keep the equations regular.
#[test]
fn length_of_a_quaternion_is_no_singularity() {
    let basis = FourierBasis::try_new(PERIOD_S, 3).unwrap();
    let mut coefficients = DMatrix::from_fn(7, 7, |j, c| 0.2 * (1.3 + 2.9 * j as f64 + 0.7 * c as f64).sin());
    coefficients[(0, 6)] += 1.2;
    let motion = FourierMotion::try_new(basis, AttitudeChart::Quaternion, coefficients).unwrap();
    let mut random = Random::new(5);
    let exact = record(&motion, &load(), (100, 1, 0.0), &NO_NOISE, &mut random);
    assert!(relative_error(&maximum_likelihood(&exact, 3).unwrap(), &load()) < 1e-10);
    // Noise in all four components, the length's too.
    let (mut sum, runs) = (0.0, 20);
    for _ in 0..runs {
        let found = maximum_likelihood(&record(&motion, &load(), (100, 9, 0.0), &NOISE, &mut random), 3).unwrap();
        let error = found.estimate.parameters.to_vector() - load().to_vector();
        sum += normalized_squared_error(&error, &found.estimate.covariance).unwrap();
    }
    let band = mean_square_band(10.0, runs, 0.9999);
    assert!(band.contains(sum / runs as f64), "{} {band}", sum / runs as f64);
}

/// Both charts see one motion and give one body, and the residuals are as large as stated.
#[test]
fn both_charts_agree() {
    let motion = excitation(3, 2, 0.3, [true; 6]);
    let mut random = Random::new(8);
    let noise = Noise { attitude_rad: 0.003, position_m: 0.005, ..NOISE };
    let euler = record(&motion, &load(), (300, 1, 0.0), &noise, &mut random);
    let mut channels = DMatrix::zeros(300, 7);
    let mut near = Vector4::w();
    for (i, row) in euler.channels.row_iter().enumerate() {
        let angles = EulerZyx::new(row[3], row[4], row[5]);
        near = AttitudeChart::Quaternion.coordinates(&angles.to_rotation(), &near);
        channels.row_mut(i).copy_from_slice(&[row[0], row[1], row[2], near.x, near.y, near.z, near.w]);
    }
    let mut channel_std = vec![noise.attitude_rad / 2.0; 7];
    channel_std[..3].fill(noise.position_m);
    let quaternion = PeriodicRecord { chart: AttitudeChart::Quaternion, channels, channel_std, ..euler.clone() };
    let [by_angles, by_quaternion] =
        [(euler, 2), (quaternion, 8)].map(|(record, harmonics)| maximum_likelihood(&record, harmonics).unwrap());
    let difference = by_angles.estimate.parameters.to_vector() - by_quaternion.estimate.parameters.to_vector();
    // More coefficients, more scatter: not closer than a sigma or two.
    let distance = normalized_squared_error(&difference, &by_quaternion.estimate.covariance).unwrap();
    assert!(distance < 20.0, "{distance}");
    for found in [by_angles, by_quaternion] {
        let freedom = found.degrees_of_freedom as f64;
        let band = mean_square_band(freedom, 1, 0.9999);
        assert!(band.contains(found.cost), "{} of {freedom}: {band}", found.cost);
        assert!((found.reduced_chi_square() - found.cost / freedom).abs() < 1e-12);
    }
}

/// Fifty noise draws on one motion: errors as the bound says, least squares far from it.
#[test]
fn attains_the_bound_where_least_squares_does_not() {
    const RUNS: usize = 50;
    let (body, motion) = (load(), excitation(1, 3, 0.8, [true; 6]));
    let bound = cramer_rao(&motion, &body, 200, 9, &NOISE).unwrap();
    let covariance = bound.covariance.unwrap();
    let mut random = Random::new(11);
    let (mut by_bound, mut by_own, mut cost, mut freedom) = (0.0, 0.0, 0.0, 0);
    let (mut likely, mut linear) = ([0.0; 3], [0.0; 3]);
    for _ in 0..RUNS {
        let record = record(&motion, &body, (200, 9, 0.0), &NOISE, &mut random);
        let found = maximum_likelihood(&record, 3).unwrap();
        assert!(found.iterations <= 8, "{}", found.iterations);
        assert!(found.estimate.parameters.is_consistent());
        let vector = found.estimate.parameters.to_vector();
        by_bound += normalized_squared_error(&(vector - body.to_vector()), &covariance).unwrap() / RUNS as f64;
        by_own +=
            normalized_squared_error(&(vector - body.to_vector()), &found.estimate.covariance).unwrap() / RUNS as f64;
        cost += found.cost;
        freedom += found.degrees_of_freedom;
        for (sums, found) in [(&mut likely, vector), (&mut linear, least_squares(&record, 3))] {
            for (sum, error) in sums.iter_mut().zip(errors(&found, &body)) {
                *sum += error / RUNS as f64;
            }
        }
    }
    let band = mean_square_band(10.0, RUNS, 0.9999);
    assert!(band.contains(by_bound) && band.contains(by_own), "{by_bound} {by_own} {band}");
    let band = mean_square_band(freedom as f64, 1, 0.9999);
    assert!(band.contains(cost), "{cost} {band}");
    // At least one independent component a run.
    let Band { low, high } = rms_ratio_band(RUNS as f64, 0.9999);
    for ((likely, linear), bound) in likely.iter().zip(linear).zip(variances(&bound.std)) {
        let ratio = (likely / bound).sqrt();
        assert!(low < ratio && ratio < high, "{ratio} {low} {high}");
        let gain = (linear / likely).sqrt();
        assert!(gain > 1.3, "{gain}");
    }
    let gains = [1, 2].map(|i| (linear[i] / likely[i]).sqrt());
    assert!(gains.iter().all(|gain| *gain > 8.0), "{gains:?}");
}

/// The information of all data about all unknowns by central differences, inverted whole.
#[test]
fn bound_is_the_corner_of_the_inverse_of_the_whole_information() {
    let samples = 24;
    let body = load().to_vector();
    let mut quaternion = DMatrix::from_fn(5, 7, |j, c| 0.25 * (0.4 + 2.3 * j as f64 + 1.1 * c as f64).sin());
    quaternion[(0, 6)] += 1.0;
    let basis = FourierBasis::try_new(PERIOD_S, 2).unwrap();
    let quaternion = FourierMotion::try_new(basis, AttitudeChart::Quaternion, quaternion).unwrap();
    for motion in [excitation(4, 2, 0.8, [true; 6]), quaternion] {
        let coefficients = motion.coefficients();
        let data = |unknowns: &DVector<f64>| {
            let shape = coefficients.shape();
            let coefficients = DMatrix::from_column_slice(shape.0, shape.1, &unknowns.as_slice()[..coefficients.len()]);
            let body = SVector::<f64, 10>::from_column_slice(&unknowns.as_slice()[coefficients.len()..]);
            let moved = FourierMotion::try_new(*motion.basis(), motion.chart(), coefficients).unwrap();
            let mut data = Vec::new();
            for i in 0..samples {
                let time_s = PERIOD_S * f64::from(i) / f64::from(samples);
                let [functions, ..] = motion.basis().at(time_s);
                let channels = moved.coefficients().tr_mul(&DVector::from_vec(functions));
                let angle = if channels.len() == 7 { 0.5 * NOISE.attitude_rad } else { NOISE.attitude_rad };
                data.extend(channels.iter().enumerate().map(|(c, x)| x / if c < 3 { NOISE.position_m } else { angle }));
                let wrench = wrench(&moved, &InertialParameters::from_vector(&body), time_s);
                data.extend(
                    wrench.iter().enumerate().map(|(c, x)| x / if c < 3 { NOISE.torque_n_m } else { NOISE.force_n }),
                );
            }
            DVector::from_vec(data) * 3.0
        };
        let at = DVector::from_iterator(coefficients.len() + 10, coefficients.iter().chain(body.iter()).copied());
        let columns: Vec<DVector<f64>> = (0..at.len())
            .map(|k| {
                let moved = |by: f64| {
                    let mut at = at.clone();
                    at[k] += by;
                    data(&at)
                };
                (moved(1e-5) - moved(-1e-5)) / 2e-5
            })
            .collect();
        let jacobian = DMatrix::from_columns(&columns);
        let whole = (jacobian.transpose() * &jacobian).cholesky().unwrap().inverse();
        let expected = whole.fixed_view::<10, 10>(at.len() - 10, at.len() - 10);
        let bound = cramer_rao(&motion, &load(), 24, 9, &NOISE).unwrap();
        let found = bound.covariance.unwrap();
        for i in 0..10 {
            for j in 0..10 {
                let size = (expected[(i, i)] * expected[(j, j)]).sqrt();
                assert!((found[(i, j)] - expected[(i, j)]).abs() < 1e-5 * size, "{i} {j}");
            }
        }
        // Knowing the motion is worth something, and can only be.
        for (with, without) in variances(&bound.std_of_known_motion).iter().zip(variances(&bound.std)) {
            assert!(*with < without);
        }
        let exact =
            cramer_rao(&motion, &load(), 24, 9, &Noise { position_m: 0.0, attitude_rad: 0.0, ..NOISE }).unwrap();
        for (exact, known) in variances(&exact.std).iter().zip(variances(&exact.std_of_known_motion)) {
            assert!((exact / known - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn planar_motions_show_seven_and_invent_nothing() {
    let planar = excitation(6, 3, 0.8, [true, true, false, false, false, true]);
    let bound = cramer_rao(&planar, &load(), 200, 9, &NOISE).unwrap();
    assert_eq!((bound.observability.rank(), bound.covariance), (7, None));
    let mut words: Vec<String> = bound.observability.null_directions().iter().map(ToString::to_string).collect();
    words.sort();
    let expected = [
        "inertia J_xx is not excited (no rotation about x)",
        "inertia J_xy is not excited (no rotation about x or y)",
        "inertia J_yy is not excited (no rotation about y)",
    ];
    assert_eq!(words, expected);
    for std in [bound.std, bound.std_of_known_motion] {
        let inertia = std.inertia_about_com_kg_m2;
        let hidden = |i: usize, j: usize| i < 2 && j < 2;
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
            assert_eq!(inertia[(i, j)] == f64::INFINITY, hidden(i, j), "{i} {j}");
        }
        assert!(std.mass_kg < 0.5 && std.center_of_mass_m.amax() < 0.1 && inertia[(2, 2)] < 0.1);
    }
    let mut random = Random::new(1);
    for (noise, samples) in [(NO_NOISE, 200), (NOISE, 200), (NOISE, 1000)] {
        for _ in 0..5 {
            let record = record(&planar, &load(), (samples, 9, 0.0), &noise, &mut random);
            let found = maximum_likelihood(&record, 3);
            assert!(matches!(found, Err(IdentificationError::NotExcited { rank: 7, expected: 10, .. })), "{found:?}");
        }
    }
    let still = excitation(6, 3, 0.8, [false; 6]);
    let found = maximum_likelihood(&record(&still, &load(), (200, 9, 0.0), &NO_NOISE, &mut random), 3);
    assert!(matches!(found, Err(IdentificationError::NotExcited { rank: 0, .. })), "{found:?}");
    assert_eq!(cramer_rao(&still, &load(), 200, 9, &NOISE).unwrap().observability.rank(), 0);
}

/// A plate lies on the boundary of what exists; half of all noise draws fall outside.
#[test]
fn plates_stay_bodies() {
    let plate = InertialParameters::about_com(
        6.0,
        Vector3::new(0.02, 0.01, -0.03),
        Matrix3::from_diagonal(&Vector3::new(0.05, 0.07, 0.12)),
    );
    let motion = excitation(9, 3, 0.8, [true; 6]);
    let (mut random, mut active) = (Random::new(2), 0);
    for _ in 0..12 {
        let found = maximum_likelihood(&record(&motion, &plate, (200, 9, 0.0), &NOISE, &mut random), 3).unwrap();
        assert!(found.estimate.parameters.is_consistent());
        active += usize::from(found.estimate.lmi_active);
        let error = found.estimate.parameters.to_vector() - plate.to_vector();
        assert!(normalized_squared_error(&error, &found.estimate.covariance).unwrap() < 40.0);
    }
    assert!((1..12).contains(&active), "{active}");
}

/// Motion beyond the harmonics fitted shows in the residuals.
#[test]
fn too_few_harmonics_are_seen_in_the_cost() {
    let motion = excitation(2, 4, 0.8, [true; 6]);
    let record = record(&motion, &load(), (200, 9, 0.0), &NOISE, &mut Random::new(3));
    let right = maximum_likelihood(&record, 4).unwrap();
    assert!((right.reduced_chi_square() - 1.0).abs() < 0.15, "{}", right.reduced_chi_square());
    if let Ok(wrong) = maximum_likelihood(&record, 3) {
        assert!(wrong.reduced_chi_square() > 3.0, "{}", wrong.reduced_chi_square());
    }
}

#[test]
fn nonsense_is_refused() {
    let motion = excitation(1, 3, 0.8, [true; 6]);
    let good = record(&motion, &load(), (100, 9, 0.0), &NOISE, &mut Random::new(3));
    let refused = |record: PeriodicRecord, harmonics: usize| maximum_likelihood(&record, harmonics).unwrap_err();
    assert_eq!(refused(good.clone(), 50), IdentificationError::TooManyHarmonics { harmonics: 50, samples: 100 });
    assert_eq!(refused(good.clone(), 0), IdentificationError::NoHarmonics);
    let mut bad = good.clone();
    bad.wrenches[(17, 3)] = f64::NAN;
    assert_eq!(refused(bad, 3), IdentificationError::NotFinite { row: 17 });
    let mut bad = good.clone();
    bad.channel_std[4] = -FRAC_1_SQRT_2;
    assert_eq!(refused(bad, 3), IdentificationError::NotPositive { index: 4, value: -FRAC_1_SQRT_2 });
    let bad = PeriodicRecord { chart: AttitudeChart::Quaternion, ..good.clone() };
    assert!(matches!(refused(bad, 3), IdentificationError::RecordShape { columns: 6, expected_columns: 7, .. }));
    let still = PeriodicRecord {
        chart: AttitudeChart::Quaternion,
        channels: DMatrix::zeros(100, 7),
        channel_std: vec![0.01; 7],
        ..good.clone()
    };
    assert_eq!(refused(still, 3), IdentificationError::NotFinite { row: 0 });
    let bad = PeriodicRecord { wrenches: DMatrix::zeros(99, 6), ..good };
    assert!(matches!(refused(bad, 3), IdentificationError::RecordShape { rows: 99, expected_rows: 100, .. }));
    let bound = |samples, cycles, noise: &Noise| cramer_rao(&motion, &load(), samples, cycles, noise).unwrap_err();
    assert!(matches!(bound(6, 1, &NOISE), IdentificationError::TooManyHarmonics { harmonics: 3, samples: 6 }));
    assert!(matches!(bound(7, 0, &NOISE), IdentificationError::NotPositive { index: 0, .. }));
    let noise = Noise { force_n: f64::NAN, ..NOISE };
    assert!(matches!(bound(7, 1, &noise), IdentificationError::NotPositive { index: 2, .. }));
}
