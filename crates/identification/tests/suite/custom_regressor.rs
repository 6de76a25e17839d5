//! Tutorial: bring your own regressor. Three steps: implement, check the laws, estimate.
//!
//! The example is a body on an air table: mass, first moment in the plane and inertia about the vertical. Below it the
//! crate's own regressors pass the same laws, and four known mistakes fail them by name.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)]

use crate::random::Random;
use tumble_identification::dynamics::{
    BodyAcceleration, FreeFlyer, InertialParameters, momentum_at_end, momentum_at_start,
};
use tumble_identification::laws::check_linear_model;
use tumble_identification::lie::laws::LawViolation;
use tumble_identification::lie::{Increment, Twist, Wrench, skew};
use tumble_identification::nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use tumble_identification::regressors::{
    NewtonEuler, NewtonEulerSample, PoseTriple, Variational, VariationalSample, newton_euler, variational,
};
use tumble_identification::{LinearModel, SquareRootInformation};

// Step 1: say what a sample is, which matrix multiplies the parameters, and what they should give.
struct AirTable;

struct TableSample {
    rate: f64,
    rate_derivative: f64,
    acceleration: [f64; 2],
    /// Torque about the vertical and force in the plane.
    wrench: [f64; 3],
}

impl LinearModel<f64, 3, 4> for AirTable {
    type Sample = TableSample;
    /// Parameters `[m, h_x, h_y, J_zz]`.
    fn regressor(&self, s: &TableSample) -> SMatrix<f64, 3, 4> {
        let ([ax, ay], w2, d) = (s.acceleration, s.rate * s.rate, s.rate_derivative);
        SMatrix::<f64, 3, 4>::from_row_slice(&[0.0, ay, -ax, d, ax, -w2, -d, 0.0, ay, d, -w2, 0.0])
    }
    fn output(&self, s: &TableSample) -> SVector<f64, 3> {
        SVector::from(s.wrench)
    }
}

#[test]
fn a_regressor_of_yours() {
    let mut random = Random::new(1);
    let truth = SVector::<f64, 4>::new(18.9, 0.4, -0.2, 0.31);
    // Rigid-body kinematics, written without any regressor: force moves the centre of mass, torque turns the body.
    let inverse = |s: &TableSample, p: &SVector<f64, 4>| {
        let (a, h) = (Vector3::new(s.acceleration[0], s.acceleration[1], 0.0), Vector3::new(p[1], p[2], 0.0));
        let (w, d) = (Vector3::new(0.0, 0.0, s.rate), Vector3::new(0.0, 0.0, s.rate_derivative));
        let force = a * p[0] + d.cross(&h) + w.cross(&w.cross(&h));
        SVector::<f64, 3>::new(p[3] * s.rate_derivative + h.cross(&a).z, force.x, force.y)
    };
    let samples: Vec<_> = (0..30)
        .map(|_| {
            let mut sample = TableSample {
                rate: random.normal(),
                rate_derivative: random.normal(),
                acceleration: [random.normal(), random.normal()],
                wrench: [0.0; 3],
            };
            sample.wrench = inverse(&sample, &truth).into();
            sample
        })
        .collect();
    let bodies: Vec<_> = (0..5).map(|_| SVector::<f64, 4>::from_fn(|_, _| random.normal())).collect();

    // Step 2: the laws.
    check_linear_model(&AirTable, &samples, &bodies, inverse, 1e-12).unwrap();

    // Step 3: estimate.
    let mut information = SquareRootInformation::<4>::new();
    for sample in &samples {
        information.update(&AirTable.regressor(sample), &AirTable.output(sample)).unwrap();
    }
    let found = information.solve(&SVector::<f64, 4>::new(10.0, 1.0, 1.0, 1.0)).unwrap();
    assert!((found - truth).amax() < 1e-12);
}

fn bodies(random: &mut Random) -> Vec<SVector<f64, 10>> {
    (0..6).map(|_| SVector::from_fn(|_, _| random.normal())).collect()
}

/// Motion with velocity, so that a regressor which forgets a velocity term can be caught.
struct Moving {
    twist: Twist<f64>,
    acceleration: BodyAcceleration<f64>,
}

fn moving(random: &mut Random) -> Vec<Moving> {
    let mut vector = || random.normal3(1.0);
    (0..40)
        .map(|_| Moving {
            twist: Twist::new(vector(), vector()),
            acceleration: BodyAcceleration { angular_acceleration_body: vector(), acceleration_origin_body: vector() },
        })
        .collect()
}

fn inverse_dynamics(sample: &Moving, parameters: &SVector<f64, 10>) -> SVector<f64, 6> {
    FreeFlyer::new(InertialParameters::from_vector(parameters)).inverse(&sample.twist, &sample.acceleration).to_vector()
}

/// A Newton-Euler regressor with a mistake to be named.
struct Faulty(fn(&Moving) -> SMatrix<f64, 6, 10>);

impl LinearModel<f64, 6, 10> for Faulty {
    type Sample = Moving;
    fn regressor(&self, sample: &Moving) -> SMatrix<f64, 6, 10> {
        (self.0)(sample)
    }
    fn output(&self, _: &Moving) -> SVector<f64, 6> {
        SVector::zeros()
    }
}

fn right(s: &Moving) -> SMatrix<f64, 6, 10> {
    let a = &s.acceleration;
    newton_euler(&s.twist.angular, &a.angular_acceleration_body, &a.acceleration_origin_body)
}

fn fails_as_inverse_dynamics<T>(result: Result<T, LawViolation>) {
    let law = result.err().expect("the mistake was not noticed").law;
    assert_eq!(law, "regressor times parameters is the inverse dynamics");
}

#[test]
fn newton_euler_obeys_the_laws_and_mistakes_do_not() {
    let mut random = Random::new(2);
    let (samples, bodies) = (moving(&mut random), bodies(&mut random));
    let check = |model: &Faulty| check_linear_model(model, &samples, &bodies, inverse_dynamics, 1e-13);
    check(&Faulty(right)).unwrap();
    fails_as_inverse_dynamics(check(&Faulty(|s| {
        // S(c) with the other sign: torque of the first moment.
        let mut regressor = right(s);
        let flipped = -regressor.fixed_view::<3, 3>(0, 1);
        regressor.fixed_view_mut::<3, 3>(0, 1).copy_from(&flipped);
        regressor
    })));
    fails_as_inverse_dynamics(check(&Faulty(|s| {
        // vdot read as the derivative of body components: omega x v is missing.
        let a = &s.acceleration;
        let components = a.acceleration_origin_body - s.twist.angular.cross(&s.twist.linear);
        newton_euler(&s.twist.angular, &a.angular_acceleration_body, &components)
    })));
    fails_as_inverse_dynamics(check(&Faulty(|s| {
        // Force above torque.
        let regressor = right(s);
        SMatrix::from_fn(|i, j| regressor[((i + 3) % 6, j)])
    })));
    let poor = &samples[..1];
    let law = check_linear_model(&Faulty(right), poor, &bodies, inverse_dynamics, 1e-13).unwrap_err().law;
    assert_eq!(law, "a rich motion determines every parameter");
    let law = check_linear_model(&Faulty(right), &samples, &bodies[..0], inverse_dynamics, 1e-13);
    law.unwrap();
    let crooked = |s: &Moving, p: &SVector<f64, 10>| {
        let wrench = inverse_dynamics(s, p);
        // Agrees for the bodies tried, not for their sums.
        if bodies.contains(p) { wrench } else { wrench * (1.0 + 0.1 * p[0]) }
    };
    let law = check_linear_model(&Faulty(right), &samples, &bodies, crooked, 1e-13).unwrap_err().law;
    assert_eq!(law, "inverse dynamics is linear in the parameters");
}

#[test]
fn the_crates_models_obey_the_laws() {
    let mut random = Random::new(3);
    let bodies = bodies(&mut random);
    let samples: Vec<_> = moving(&mut random)
        .iter()
        .map(|s| NewtonEulerSample {
            rate: s.twist.angular,
            rate_derivative: s.acceleration.angular_acceleration_body,
            acceleration_origin: s.acceleration.acceleration_origin_body,
            wrench: Wrench::zero(),
        })
        .collect();
    let inverse = |s: &NewtonEulerSample<f64>, p: &SVector<f64, 10>| {
        let moving = Moving {
            twist: Twist::new(s.rate, Vector3::zeros()),
            acceleration: BodyAcceleration {
                angular_acceleration_body: s.rate_derivative,
                acceleration_origin_body: s.acceleration_origin,
            },
        };
        inverse_dynamics(&moving, p)
    };
    check_linear_model(&NewtonEuler, &samples, &bodies, inverse, 1e-13).unwrap();
}

/// Impulse from the discrete momenta of `dynamics`, derived from the discrete Lagrangian: no regressor involved.
fn discrete_inverse_dynamics<const LAGS: usize>(
    sample: &VariationalSample<f64, LAGS>,
    parameters: &SVector<f64, 10>,
) -> SVector<f64, 6> {
    let body = InertialParameters::from_vector(parameters);
    let weights: &[f64] = match LAGS {
        1 => &[1.0],
        2 => &[4.0 / 3.0, -1.0 / 3.0],
        _ => &[1.5, -0.6, 0.1],
    };
    let mut sum = SVector::zeros();
    for (triple, weight) in sample.triples.iter().zip(weights) {
        let start = momentum_at_start(&body, &triple.after, triple.step_after_s);
        let end = momentum_at_end(&body, &triple.before, triple.step_before_s);
        let mean_step_s = 0.5 * (triple.step_before_s + triple.step_after_s);
        sum += (start - end).to_vector() * (weight / mean_step_s);
    }
    sum
}

fn variational_samples<const LAGS: usize>(random: &mut Random) -> Vec<VariationalSample<f64, LAGS>> {
    let mut triple = || PoseTriple {
        before: Increment::try_new(random.normal3(0.2), random.normal3(0.3)).unwrap(),
        after: Increment::try_new(random.normal3(0.2), random.normal3(0.3)).unwrap(),
        step_before_s: 0.2,
        step_after_s: 0.25,
    };
    (0..40).map(|_| VariationalSample { triples: std::array::from_fn(|_| triple()), wrench: Wrench::zero() }).collect()
}

/// The coupling block as (5.24) prints it.
struct Printed;

impl LinearModel<f64, 6, 10> for Printed {
    type Sample = VariationalSample<f64, 1>;
    fn regressor(&self, sample: &Self::Sample) -> SMatrix<f64, 6, 10> {
        let [t] = &sample.triples;
        let block = |x: &Increment<f64>, sign: f64, step_s: f64| {
            let turn = Matrix3::identity() * x.f_a0() + skew(&x.phi()) * sign;
            let travel = Matrix3::identity() * x.f_b0() + skew(&x.psi()) * sign;
            (travel - turn) * skew(&x.phi()) * (4.0 / (step_s * (t.step_before_s + t.step_after_s)))
        };
        let wrong = block(&t.after, 1.0, t.step_after_s) - block(&t.before, -1.0, t.step_before_s);
        let mut regressor = variational(t);
        regressor.fixed_view_mut::<3, 3>(0, 1).copy_from(&wrong);
        regressor
    }
    fn output(&self, sample: &Self::Sample) -> SVector<f64, 6> {
        sample.wrench.to_vector()
    }
}

#[test]
fn variational_regressors_obey_the_laws_and_the_printed_one_does_not() {
    let mut random = Random::new(4);
    let bodies = bodies(&mut random);
    let samples = variational_samples::<1>(&mut random);
    check_linear_model(&Variational::<1>, &samples, &bodies, discrete_inverse_dynamics, 1e-12).unwrap();
    fails_as_inverse_dynamics(check_linear_model(&Printed, &samples, &bodies, discrete_inverse_dynamics, 1e-12));
    let samples = variational_samples::<2>(&mut random);
    check_linear_model(&Variational::<2>, &samples, &bodies, discrete_inverse_dynamics, 1e-12).unwrap();
    let samples = variational_samples::<3>(&mut random);
    check_linear_model(&Variational::<3>, &samples, &bodies, discrete_inverse_dynamics, 1e-12).unwrap();
}
