//! What acts beside the logged wrench: without it a body is biased, with it the truth lies inside its sigmas.
#![allow(clippy::cast_possible_truncation)]

use crate::exact_motion::Multisine;
use crate::random::Random;
use tumble_identification::dynamics::{
    ConstantWorldWrench, Environment, FreeFlyer, FreeFlyerIn, GravityGradient, InertialParameters, Integrator,
    MuntheKaas4, Plant, ReactionWheel, ReactionWheels, RigidBodyState, SimulatedGyrostat, UniformGravity, WrenchBox,
    WrenchModel,
};
use tumble_identification::estimator::{
    Acted, Doubt, Estimator, EstimatorError, Finding, InEnvironment, Measurement, StateEstimator, Verdict,
};
use tumble_identification::harmonics::{HarmonicSettings, identify_periodic};
use tumble_identification::lie::{LieGroup, Twist, Wrench};
use tumble_identification::nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};
use tumble_identification::recursive::{FlightHealth, Reception, ReceptionCounts};
use tumble_identification::{
    Column, FixedLag, FixedLagSettings, Identification, IdentificationError, MotionSample, Pipeline, Problem,
    Regressed, Settings, Warning, identify, identify_in, methods,
};

/// A servicer of 300 kg that is longer than wide.
fn satellite() -> InertialParameters<f64> {
    let inertia = Matrix3::new(60.0, 3.0, -2.0, 3.0, 140.0, 4.0, -2.0, 4.0, 120.0);
    InertialParameters::about_com(300.0, Vector3::new(0.05, -0.08, 0.03), inertia)
}

/// In a low orbit, as seen from a neighbour that falls freely.
fn gravity(body: InertialParameters<f64>) -> GravityGradient<f64> {
    let (mu, center) = (3.986e14, Vector3::<f64>::new(-2.0e6, 3.0e6, -5.6e6));
    let rate: f64 = (mu / center.norm().powi(3)).sqrt();
    let turn_rate = center.cross(&Vector3::new(0.3, 1.0, 0.4)).normalize() * rate;
    GravityGradient::of_point_mass(body, mu, center, turn_rate)
}

const STEP_S: f64 = 1.0;
/// Noise of the logged torque and force, N m and N.
const NOISE: (f64, f64) = (2e-4, 1e-2);
const SEEDS: u64 = 20;
/// Means of the squared distances of as many answers from the truth, in ten dimensions, that chance allows in 999 of 1000 cases
/// each way: chi square of 200 over 20.
const BAND: (f64, f64) = (7.0, 13.7);

fn sample(time_s: f64, state: &RigidBodyState<f64>, wrench: Wrench<f64>, random: &mut Random) -> MotionSample {
    let noise = Wrench::new(random.normal3(NOISE.0), random.normal3(NOISE.1));
    MotionSample {
        time_ns: (time_s * 1e9).round() as i64,
        world_from_body: Some(state.world_from_body),
        velocity_origin_world: Some(state.world_from_body.rotation * state.twist_body.linear),
        rate_body: Some(state.twist_body.angular),
        wrench_body: Some(wrench + noise),
        ..MotionSample::default()
    }
}

/// Slow manoeuvres; the wrench is held over each step and logged with some noise.
fn moved_in(seed: u64, samples: u32, step_s: f64, environment: impl WrenchModel<f64>) -> Vec<MotionSample> {
    let mut random = Random::new(seed);
    let push = Multisine::random(&mut random, 0.012, 0.4, (0.01, 0.05), 4);
    let system = FreeFlyerIn { body: FreeFlyer::new(satellite()), environment };
    let mut state = RigidBodyState::at_rest();
    state.twist_body = Twist::new(Vector3::new(0.001, -0.002, 0.0015), Vector3::zeros());
    (0..samples)
        .map(|k| {
            let time_s = f64::from(k) * step_s;
            let wrench = push.at(time_s + 0.5 * step_s);
            let row = sample(time_s, &state, wrench, &mut random);
            state = MuntheKaas4.step(&system, &state, &wrench, time_s, step_s).unwrap();
            row
        })
        .collect()
}

/// Half an hour.
fn in_orbit(seed: u64) -> Vec<MotionSample> {
    moved_in(seed, 1800, STEP_S, gravity(satellite()))
}

/// With noise in the poses, 0.1 mm and 0.1 mrad, and a tenth of it per second in rates and velocities.
fn seen_with_noise(mut record: Vec<MotionSample>) -> Vec<MotionSample> {
    let mut random = Random::new(100);
    for row in &mut record {
        let pose = row.world_from_body.as_mut().unwrap();
        pose.translation.vector += random.normal3(1e-4);
        pose.rotation *= UnitQuaternion::new(random.normal3(1e-4));
        row.rate_body = row.rate_body.map(|rate| rate + random.normal3(1e-5));
        row.velocity_origin_world = row.velocity_origin_world.map(|velocity| velocity + random.normal3(1e-5));
    }
    record
}

/// Squared distance of the ten from the truth by the stated covariance.
fn chi_square(found: &Identification) -> f64 {
    let estimate = found.estimate.unwrap();
    let error = estimate.parameters.to_vector() - satellite().to_vector();
    // in units of the standard deviations, for the sake of the digits
    let unit = estimate.covariance.diagonal().map(|variance| 1.0 / variance.sqrt());
    let alike = SMatrix::<f64, 10, 10>::from_fn(|i, j| estimate.covariance[(i, j)] * unit[i] * unit[j]);
    let error = error.component_mul(&unit);
    error.dot(&alike.cholesky().unwrap().solve(&error))
}

/// Their mean over all seeds.
fn mean_chi_square(identified: impl Fn(u64) -> Identification) -> f64 {
    (0..SEEDS).map(|seed| chi_square(&identified(seed))).sum::<f64>() / SEEDS as f64
}

#[test]
fn a_satellite_in_a_gravity_gradient_is_identified_with_its_model() {
    let settings = Settings::default();
    // the model begins with a body that is a quarter too heavy and half as long
    let wrong = InertialParameters::solid_box(375.0, [1.2, 1.0, 1.0]);
    let with = mean_chi_square(|seed| identify_in(&in_orbit(seed), &settings, &gravity(wrong)).unwrap());
    assert!(with > BAND.0 && with < BAND.1, "{with}");
    let without = chi_square(&identify(&in_orbit(0), &settings).unwrap());
    assert!(without > 20.0 * BAND.1, "{without}");
    let record = in_orbit(0);
    let found = identify_in(&record, &settings, &gravity(wrong)).unwrap();
    assert_eq!(found.verdict, Verdict::Identified);
    let pipeline = Pipeline::new().acted_on_by(Environment::default().with(gravity(wrong)));
    assert_eq!(pipeline.identify(&record, &settings).unwrap(), found);
}

/// The method asked for answered, or it is a filter that diverged and says that a regression answers.
fn answers_or_says_who_does(found: &Identification, method: &str) -> bool {
    let has_diverged = found.warnings.iter().any(|warning| matches!(warning, Warning::FilterDiverged { .. }));
    method == "auto" || found.method == method || (["ekf", "ukf"].contains(&method) && has_diverged)
}

#[test]
fn every_method_takes_an_environment_and_wheels() {
    let drift = ConstantWorldWrench { wrench_world: Wrench::new(Vector3::y() * 5e-3, Vector3::new(0.1, 0.0, -0.1)) };
    let windy = seen_with_noise(moved_in(1, 1200, 0.25, drift));
    let wheels = seen_with_noise(with_wheels(0, 1200, 0.25));
    for (method, _) in methods().entries() {
        let settings = Settings { method, ..Settings::default() };
        let found = [identify_in(&windy, &settings, &drift), identify(&wheels, &settings)];
        for (found, what) in found.into_iter().zip(["wind", "wheels"]) {
            let found = found.unwrap_or_else(|error| panic!("{method}, {what}: {error}"));
            assert!(answers_or_says_who_does(&found, method), "{method}, {what}: answered by {}", found.method);
            let estimate = found.estimate.unwrap();
            let error = estimate.parameters.to_vector() - satellite().to_vector();
            let sigmas = error.component_div(&estimate.covariance.diagonal().map(f64::sqrt)).amax();
            assert!(sigmas < 5.0 && estimate.std.mass_kg < 2.0, "{method}, {what}: {sigmas} sigmas");
        }
    }
    // told nothing, they do not find that body
    let unaware = identify(&windy, &Settings::default()).unwrap();
    assert!(unaware.estimate.is_none() || chi_square(&unaware) > 20.0 * BAND.1, "{:?}", unaware.verdict);
}

/// The torque of the wheels turns by a tenth within a step, and is that of the motion that is estimated, not of a measured rate.
#[test]
fn wheels_need_no_short_steps() {
    let coarse = seen_with_noise(with_wheels(0, 600, STEP_S));
    for method in ["ekf", "ukf", "maximum-likelihood", "flight-likelihood"] {
        let found = identify(&coarse, &Settings { method, ..Settings::default() }).unwrap();
        let estimate = found.estimate.unwrap();
        let error = estimate.parameters.to_vector() - satellite().to_vector();
        let sigmas = error.component_div(&estimate.covariance.diagonal().map(f64::sqrt)).amax();
        println!("{method}: {sigmas:.1} sigmas, {:.2} kg", estimate.std.mass_kg);
        assert!(found.method == method && sigmas < 5.0, "{method} by {}: {sigmas} sigmas", found.method);
    }
}

#[test]
fn what_sliding_and_periodic_estimators_do_not_take_is_refused() {
    let mut row = with_wheels(1, 1, STEP_S)[0];
    let mut window = FixedLag::new(FixedLagSettings::default());
    assert_eq!(window.push(row).unwrap_err(), IdentificationError::WrenchBeside);
    row.stored_momentum_body = None;
    row.besides_body = Some(Wrench::zero());
    assert_eq!(window.push(row).unwrap_err(), IdentificationError::WrenchBeside);
    let settings = HarmonicSettings::new(18.0, 2);
    let refused = identify_periodic(&with_wheels(1, 200, STEP_S), &settings).unwrap_err();
    assert_eq!(refused, IdentificationError::WrenchBeside);
}

#[test]
fn a_body_that_agrees_with_no_wrench_is_not_called_identified() {
    // told that it falls, it does not
    let body = satellite();
    let falls = UniformGravity { mass: body.mass, first_moment: body.first_moment, gravity_world: Vector3::x() };
    let outcome = identify_in(&in_orbit(3), &Settings::default(), &falls);
    assert!(!matches!(&outcome, Ok(found) if found.verdict == Verdict::Identified), "{outcome:?}");
    let message = IdentificationError::EnvironmentUnsettled { passes: 8, sigmas: 3.0 }.to_string();
    assert!(message.contains("8 passes"), "{message}");
}

/// The same satellite, turned by wheels that hold momentum already.
fn with_wheels(seed: u64, samples: u32, step_s: f64) -> Vec<MotionSample> {
    let mut random = Random::new(seed);
    let push = Multisine::random(&mut random, 0.012, 0.4, (0.01, 0.05), 4);
    let wheel = |axis_body| ReactionWheel { axis_body, largest_torque_n_m: 0.2, largest_momentum_n_m_s: 8.0 };
    let wheels = ReactionWheels::try_new([Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()].map(wheel)).unwrap();
    let nozzles = WrenchBox::in_every_axis(0.0, 1.0);
    let actuation = ((wheels, nozzles), (Vector3::new(2.0, -3.0, 1.0), ()));
    let body = FreeFlyer::new(satellite());
    let mut state = RigidBodyState::at_rest();
    state.twist_body.angular = Vector3::new(0.001, -0.002, 0.0015);
    let mut plant = SimulatedGyrostat::try_new(body, MuntheKaas4, actuation, state, 0.5).unwrap();
    (0..samples)
        .map(|k| {
            let (before, stored) = (*plant.state(), plant.stored_momentum_body());
            let time_s = f64::from(k) * step_s;
            let wanted = push.at(time_s);
            let realized = plant.advance(&wanted, step_s).unwrap().realized_wrench_body;
            MotionSample { stored_momentum_body: Some(stored), ..sample(time_s, &before, realized, &mut random) }
        })
        .collect()
}

#[test]
fn a_satellite_with_wheels_is_identified_by_what_they_hold() {
    let settings = Settings::default();
    let with = mean_chi_square(|seed| identify(&with_wheels(seed, 1800, STEP_S), &settings).unwrap());
    assert!(with > BAND.0 && with < BAND.1, "{with}");
    let record = with_wheels(4, 1800, STEP_S);
    let forgotten: Vec<_> = record.iter().map(|row| MotionSample { stored_momentum_body: None, ..*row }).collect();
    let without = identify(&forgotten, &settings).unwrap();
    assert!(without.estimate.is_none() || chi_square(&without) > 20.0 * BAND.1);
    // every estimator sees the same rows
    let problem = Problem::of(&record, &settings).unwrap();
    let found = Regressed::new(problem).estimate(&record).unwrap();
    let error = (found.point().unwrap() - satellite().to_vector()).component_div(&satellite().to_vector());
    assert!(error[0].abs() < 1e-2 && error[4].abs() < 1e-2, "{error}");
    // wheels may be sampled more seldom
    let seldom = |k: usize, row: &MotionSample| if k % 3 == 1 { row.stored_momentum_body } else { None };
    let mut gap: Vec<_> = record
        .iter()
        .enumerate()
        .map(|(k, row)| MotionSample { stored_momentum_body: seldom(k, row), ..*row })
        .collect();
    let gaps = chi_square(&identify(&gap, &settings).unwrap());
    assert!(gaps < 3.0 * BAND.1, "{gaps}");
    // something must say how the body turns
    for row in &mut gap {
        *row =
            MotionSample { world_from_body: None, rate_body: None, stored_momentum_body: Some(Vector3::x()), ..*row };
    }
    assert_eq!(identify(&gap, &settings), Err(IdentificationError::MissingColumn(Column::Rate)));
}

/// Hears what acted, and believes what it is told to.
struct Listener {
    heard: Vec<Wrench<f64>>,
    body: InertialParameters<f64>,
}

impl StateEstimator for Listener {
    fn acted(&mut self, acted: &Acted) {
        self.heard.push(acted.wrench_body);
    }
    fn measured(&mut self, _: &Measurement) -> Reception {
        Reception::Malformed { what: "deaf" }
    }
    fn state_at(&self, _: i64) -> RigidBodyState<f64> {
        let mut state = RigidBodyState::at_rest();
        state.world_from_body.rotation = LieGroup::exp(&Vector3::new(0.3, -0.4, 0.2));
        state
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        let ten = self.body.to_vector();
        Finding::of_covariance(ten, &SMatrix::identity(), SVector::repeat(1.0))
    }
    fn health(&self) -> FlightHealth {
        FlightHealth::default()
    }
    fn newest_stamp_ns(&self) -> i64 {
        0
    }
    fn doubt(&mut self, _: &Doubt) {}
    fn restart(&mut self, _: &Finding) -> Result<(), EstimatorError> {
        Ok(())
    }
    fn counts(&self) -> ReceptionCounts {
        ReceptionCounts::default()
    }
}

#[test]
fn estimators_in_flight_hear_what_the_environment_does_to_the_body_they_believe_in() {
    let wind = Wrench::new(Vector3::zeros(), Vector3::new(1e-3, 0.0, -2e-3));
    let models = Environment::default()
        .with(gravity(InertialParameters::solid_sphere(1.0, 0.1)))
        .with(ConstantWorldWrench { wrench_world: wind });
    let listener = Listener { heard: Vec::new(), body: satellite() };
    let mut estimator = InEnvironment::new(listener, models);
    let push = Wrench::new(Vector3::x() * 0.1, Vector3::y());
    let acted = |from_ns| Acted { from_ns, until_ns: from_ns + 1, wrench_body: push, stored_body: Vector3::zeros() };
    estimator.acted(&acted(3_000_000_000));
    let state = estimator.state_at(0);
    let expected = push
        + gravity(satellite()).wrench_body(3.0, &state)
        + ConstantWorldWrench { wrench_world: wind }.wrench_body(3.0, &state);
    let heard = estimator.estimator().heard[0];
    assert!((heard - expected).to_vector().amax() < 1e-15, "{heard:?} {expected:?}");
    assert!((heard - push).torque.norm() > 1e-5);
}
