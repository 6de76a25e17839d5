//! Predicted standard deviations against those of an estimator's errors over many noisy flights.

use crate::measured_flight::{BodyQuantities, MeasuredFlight, PrincipalBody, drawn};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_planning::dynamics::{InertialParameters, RigidBodyState};
use tumble_planning::nalgebra::{Matrix4, SMatrix, SVector, Vector4, Vector6};

/// The body, the limits `[torque; force]` and the prior standard deviations of problem 8.
const BODY: [f64; 4] = [9.5838, 0.1534, 0.1427, 0.1623];
const LIMIT: [f64; 6] = [0.045, 0.022, 0.026, 0.452, 0.216, 0.257];
const PRIOR_SIGMA: [f64; 4] = [1.0, 0.05, 0.05, 0.05];

/// Twelve seconds of torques and forces without structure, `0.6 sin(1 + 1.7 i)` of the limits: torques of all steps first.
fn flight() -> MeasuredFlight {
    let share = |index: usize| 0.6 * (1.0 + 1.7 * index as f64).sin();
    let input = |step: usize| Vector6::from_fn(|i, _| LIMIT[i] * share(72 * (i / 3) + 3 * step + i % 3));
    let unmeasured = [f64::INFINITY; 3];
    let sigma: Vec<f64> = [unmeasured, [0.005; 3], unmeasured, [0.005; 3]].concat();
    MeasuredFlight {
        start: RigidBodyState::at_rest(),
        inputs: (0..24).map(input).collect(),
        step_s: 0.5,
        sigma: sigma.try_into().unwrap(),
    }
}

fn body() -> InertialParameters<f64> {
    PrincipalBody.body(&Vector4::from(BODY)).unwrap()
}

/// Checkpoint of another program, with the quaternion integrated raw: information in units of the prior.
#[test]
#[allow(clippy::unreadable_literal, reason = "as the other program printed them")]
fn the_information_is_that_of_the_checkpoint() {
    let rows = [
        [2.742109093, 0.0, 0.0, 0.0],
        [-0.2811713857, 332.9859898, 0.0, 0.0],
        [0.01039636556, -44.93926378, 313.3137905, 0.0],
        [0.2600010641, -11.54040929, 38.09379302, 116.4089206],
    ];
    let information: Matrix4<f64> = flight().information(&PrincipalBody, &body()).unwrap();
    for i in 0..4 {
        for j in 0..=i {
            let found = information[(i, j)] * PRIOR_SIGMA[i] * PRIOR_SIGMA[j] + f64::from(u8::from(i == j));
            assert!((found - rows[i][j]).abs() < 1e-6 * 333.0, "{i} {j}: {found}");
        }
    }
}

/// 200 flights, the estimator's prior mean drawn about the true body: each standard deviation within 20 % (four standard errors)
/// of the predicted one, the mean normalised squared error within four of its own of 4. Noise of twice the variance would be out.
#[test]
fn predicted_sigmas_are_those_of_the_errors() {
    const RUNS: usize = 200;
    let (flight, truth) = (flight(), Vector4::from(BODY));
    let prior = Matrix4::from_diagonal(&Vector4::from(PRIOR_SIGMA.map(|sigma| sigma * sigma)));
    let prior_information = prior.try_inverse().unwrap();
    let information: Matrix4<f64> = flight.information(&PrincipalBody, &body()).unwrap();
    let predicted = (prior_information + information).try_inverse().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let (mut squares, mut normalised) = (Vector4::zeros(), 0.0);
    for _ in 0..RUNS {
        let measured = flight.measured(&body(), &mut rng).unwrap();
        // no body beyond: half a percent of the draws
        let mean = loop {
            let mean = drawn(&truth, &prior, &mut rng).unwrap();
            if mean.min() > 0.02 {
                break mean;
            }
        };
        let estimate = flight.estimate(&PrincipalBody, &measured, &mean, &prior_information).unwrap();
        let error = estimate.quantities - truth;
        squares += error.component_mul(&error);
        normalised += error.dot(&(estimate.covariance.try_inverse().unwrap() * error));
    }
    for i in 0..4 {
        let ratio = f64::sqrt(squares[i] / RUNS as f64 / predicted[(i, i)]);
        println!("quantity {i}: predicted {:.5}, ratio {ratio:.4}", predicted[(i, i)].sqrt());
        assert!((ratio - 1.0).abs() < 0.2, "{i}: {ratio}");
    }
    let mean = normalised / RUNS as f64;
    println!("normalised squared error {mean:.3}");
    assert!((mean - 4.0).abs() < 4.0 * f64::sqrt(8.0 / RUNS as f64), "{mean}");
}

#[test]
fn draws_have_the_covariance_asked_for() {
    let root = SMatrix::<f64, 3, 3>::new(1.0, 0.0, 0.0, 0.5, 2.0, 0.0, -0.3, 0.7, 0.4);
    let (covariance, mean) = (root * root.transpose(), SVector::from([1.0, 2.0, 3.0]));
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let draws: Vec<_> = (0..20_000).map(|_| drawn(&mean, &covariance, &mut rng).unwrap() - mean).collect();
    let sample = draws.iter().map(|draw| draw * draw.transpose()).sum::<SMatrix<f64, 3, 3>>() / 20_000.0;
    let whitened = root.try_inverse().unwrap() * sample * root.try_inverse().unwrap().transpose();
    assert!((whitened - SMatrix::identity()).amax() < 4.0 * f64::sqrt(2.0 / 20_000.0), "{whitened}");
}
