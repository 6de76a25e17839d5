//! Hot paths allocate nothing: every one of them is called a hundred thousand times under an allocator that counts.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#![allow(
    unsafe_code,
    reason = "an allocator that counts has to implement `GlobalAlloc`; it hands everything to the system's"
)]

use nalgebra::{
    Isometry2, Isometry3, Rotation3, SMatrix, SVector, Translation3, UnitComplex, UnitDualQuaternion, UnitQuaternion,
    Vector2, Vector3,
};
use tumble_identification::dynamics::strategies::body_d;
use tumble_identification::dynamics::strategies::{bodies, draws, poses, twists, wrenches};
use tumble_identification::dynamics::{
    FreeFlyer, GaussLegendre4, InertialParameters, Integrator, LieEuler, LogCholesky, MuntheKaas4, RigidBodyState,
    RungeKutta4, VariationalFreeFlyer,
};
use tumble_identification::estimator::RecursiveEstimator;
use tumble_identification::lie::{Coordinates, GroupAction, Increment, LieGroup, Wrench};
use tumble_identification::recursive::{
    AccelerationObservation, ChangeDetector, ChangeSettings, ChiSquareGate, ExtendedKalmanFilter, FlightEstimator,
    FlightEstimatorSettings, FlightMeasurement, JointMotion, JointObservation, JointState, KalmanFilter,
    LinearObservation, LinearProcess, MotionNoise, PrincipalBody, PrincipalMotion, RecursiveLeastSquares, RecursiveSdp,
    SquareRootFilter, UnscentedKalmanFilter,
};
use tumble_identification::regressors::{
    ObserverFrame, PoseTriple, newton_euler, variational, variational_extrapolated,
};
use tumble_identification::{
    BodyScale, ConstrainedLeastSquares, Estimate, FeasibleSet, InteriorPoint, PseudoInertiaCone, SquareRootInformation,
    StandardDeviations,
};

#[path = "suite/golden/problem4_hard.rs"]
mod problem4_hard;

tumble_identification::lie::counting_allocator!();

const CALLS: usize = 100_000;

/// Different inputs per path; the first round through them is the warm-up.
const INPUTS: usize = 64;

/// How often `calls` calls allocate, after one call on each input.
fn allocations<T>(calls: usize, path: impl FnMut(usize) -> T) -> usize {
    counting::allocations(INPUTS, calls, path)
}

fn assert_none<T>(name: &str, path: impl FnMut(usize) -> T) {
    assert_eq!(allocations(CALLS, path), 0, "{name} allocates");
}

/// All operations of a group on elements near and far from the identity.
fn group<G: LieGroup<Scalar = f64> + GroupAction<P>, P: Copy>(name: &str, points: &[P]) {
    let tangents: Vec<G::Tangent> =
        (0..INPUTS).map(|i| G::Tangent::from_fn(|j| 1.7 * ((7 * i + 3 * j + 1) as f64).sin())).collect();
    let elements: Vec<G> = tangents.iter().map(G::exp).collect();
    let next = |i: usize| (i + 1) % INPUTS;
    let check = |operation: &str, count: usize| assert_eq!(count, 0, "{operation} of {name} allocates");
    check("exp", allocations(CALLS, |i| G::exp(&tangents[i])));
    check("log", allocations(CALLS, |i| elements[i].log()));
    check("compose", allocations(CALLS, |i| elements[i].compose(&elements[next(i)])));
    check("inverse", allocations(CALLS, |i| elements[i].inverse()));
    check("between", allocations(CALLS, |i| elements[i].between(&elements[next(i)])));
    check("interpolate", allocations(CALLS, |i| elements[i].interpolate(&elements[next(i)], 0.3)));
    check("act", allocations(CALLS, |i| elements[i].act(&points[i])));
    check("adjoint", allocations(CALLS, |i| elements[i].adjoint()));
    check("coadjoint", allocations(CALLS, |i| elements[i].coadjoint()));
    check("bracket", allocations(CALLS, |i| G::bracket(&tangents[i], &tangents[next(i)])));
    check("dual bracket", allocations(CALLS, |i| G::dual_bracket(&tangents[i], &tangents[next(i)])));
    check("right Jacobian", allocations(CALLS, |i| G::right_jacobian(&tangents[i])));
    check("its inverse", allocations(CALLS, |i| G::right_jacobian_inverse(&tangents[i])));
    check("left Jacobian", allocations(CALLS, |i| G::left_jacobian(&tangents[i])));
    check("its inverse", allocations(CALLS, |i| G::left_jacobian_inverse(&tangents[i])));
}

#[test]
fn control_an_allocation_is_counted() {
    assert_eq!(allocations(CALLS, Box::new), CALLS);
    // Growth goes through `realloc`.
    assert_eq!(allocations(1, |i| (vec![i], Vec::<usize>::with_capacity(2).reserve(3))), 3);
}

#[test]
fn lie_operations() {
    let in_space: Vec<Vector3<f64>> = (0..INPUTS).map(|i| Vector3::new(i as f64, 1.0, -2.0)).collect();
    let in_plane: Vec<Vector2<f64>> = in_space.iter().map(Vector3::xy).collect();
    group::<UnitQuaternion<f64>, _>("SO(3), unit quaternion", &in_space);
    group::<Rotation3<f64>, _>("SO(3), matrix", &in_space);
    group::<Isometry3<f64>, _>("SE(3)", &in_space);
    group::<UnitDualQuaternion<f64>, _>("SE(3), unit dual quaternion", &in_space);
    group::<Translation3<f64>, _>("R^3", &in_space);
    group::<UnitComplex<f64>, _>("SO(2)", &in_plane);
    group::<Isometry2<f64>, _>("SE(2)", &in_plane);
}

#[test]
fn increment_chart() {
    let poses = draws(&poses(1.0), 1, INPUTS + 1);
    let increments: Vec<Increment<f64>> =
        poses.windows(2).map(|pair| Increment::between(&pair[0], &pair[1]).unwrap()).collect();
    assert_none("Increment::between", |i| Increment::between(&poses[i], &poses[i + 1]).unwrap());
    assert_none("Increment::step", |i| increments[i].step(&poses[i]));
    assert_none("Increment::to_dual_quaternion", |i| increments[i].to_dual_quaternion());
    assert_none("Increment::reversed", |i| increments[i].reversed());
}

fn step(
    name: &str,
    integrator: &impl Integrator<FreeFlyer<f64>>,
    states: &[RigidBodyState<f64>],
    wrenches: &[Wrench<f64>],
) {
    let flyer = FreeFlyer::new(body_d());
    assert_none(name, |i| integrator.step(&flyer, &states[i], &wrenches[i], 0.0, 0.01).unwrap());
}

#[test]
fn dynamics_and_integrator_steps() {
    let flyer = FreeFlyer::new(body_d());
    let (twists, wrenches) = (draws(&twists(1.0, 1.0), 1, INPUTS), draws(&wrenches(1.0, 1.0), 2, INPUTS));
    let accelerations: Vec<_> = (0..INPUTS).map(|i| flyer.forward(&twists[i], &wrenches[i])).collect();
    assert_none("FreeFlyer::forward", |i| flyer.forward(&twists[i], &wrenches[i]));
    assert_none("FreeFlyer::inverse", |i| flyer.inverse(&twists[i], &accelerations[i]));

    let states: Vec<_> =
        twists.iter().map(|twist| RigidBodyState { twist_body: *twist, ..RigidBodyState::at_rest() }).collect();
    step("VariationalFreeFlyer", &VariationalFreeFlyer, &states, &wrenches);
    step("LieEuler", &LieEuler, &states, &wrenches);
    step("RungeKutta4", &RungeKutta4, &states, &wrenches);
    step("MuntheKaas4", &MuntheKaas4, &states, &wrenches);
    step("GaussLegendre4", &GaussLegendre4, &states, &wrenches);
}

#[test]
fn regressors() {
    const STEP_S: f64 = 0.05;
    let (twists, wrenches) = (draws(&twists(1.0, 1.0), 3, INPUTS), draws(&wrenches(1.0, 1.0), 4, INPUTS));
    let flyer = FreeFlyer::new(body_d());
    assert_none("newton_euler", |i| {
        let linear = &twists[(i + 1) % INPUTS].linear;
        newton_euler(&twists[i].angular, &wrenches[i].torque, linear)
    });

    let mut state = RigidBodyState { twist_body: twists[0], ..RigidBodyState::at_rest() };
    let poses: Vec<_> = (0..INPUTS + 6)
        .map(|i| {
            state = VariationalFreeFlyer.step(&flyer, &state, &wrenches[i % INPUTS], 0.0, STEP_S).unwrap();
            state.world_from_body
        })
        .collect();
    let triple = |i: usize, lag: usize| {
        let node = i + 3;
        let step_s = STEP_S * lag as f64;
        let at = [&poses[node - lag], &poses[node], &poses[node + lag]];
        PoseTriple::try_new(at, step_s, step_s, &ObserverFrame::inertial()).unwrap()
    };
    assert_none("variational, order 2, from poses", |i| variational(&triple(i, 1)));
    assert_none("variational, order 4, from poses", |i| variational_extrapolated(&[triple(i, 1), triple(i, 2)]));
    assert_none("variational, order 6, from poses", |i| {
        variational_extrapolated(&[triple(i, 1), triple(i, 2), triple(i, 3)])
    });
}

#[test]
fn square_root_information() {
    let (twists, wrenches) = (draws(&twists(1.0, 1.0), 5, INPUTS), draws(&wrenches(1.0, 1.0), 6, INPUTS));
    let blocks: Vec<SMatrix<f64, 6, 10>> =
        (0..INPUTS).map(|i| newton_euler(&twists[i].angular, &wrenches[i].torque, &wrenches[i].force)).collect();
    let right: Vec<SVector<f64, 6>> = blocks.iter().map(|block| block * body_d().to_vector()).collect();
    let mut information = SquareRootInformation::<10>::new();
    assert_none("SquareRootInformation::update", |i| information.update(&blocks[i], &right[i]).unwrap());

    let scale = BodyScale::of(&body_d().to_vector()).unwrap();
    let other = information;
    let mut sum = SquareRootInformation::<10>::new();
    assert_none("SquareRootInformation::merge", |_| sum.merge(&other));
    assert_none("SquareRootInformation::solve", |_| information.solve(&scale.parameter_magnitudes()).unwrap());
    assert_none("SquareRootInformation::covariance", |_| {
        information.covariance(&scale.parameter_magnitudes()).unwrap()
    });

    let inactive = InteriorPoint::new(PseudoInertiaCone::new(scale));
    assert!(!inactive.solve(&information).unwrap().is_active());
    assert_none("InteriorPoint::solve, inactive", |_| inactive.solve(&information).unwrap());
}

#[test]
fn constrained_solution_where_it_binds() {
    let problems = problem4_hard::problems();
    let solver = InteriorPoint::new(problem4_hard::cone());
    assert!(problems.iter().all(|problem| solver.solve(problem).unwrap().is_active()));
    assert_none("InteriorPoint::solve, binding", |i| solver.solve(&problems[i % problems.len()]).unwrap());
}

#[test]
fn physical_consistency() {
    let bodies = draws(&bodies(), 7, INPUTS);
    let vectors: Vec<_> = bodies.iter().map(InertialParameters::to_vector).collect();
    let cone = PseudoInertiaCone::new(BodyScale::of(&body_d().to_vector()).unwrap());
    assert_none("InertialParameters::consistency_margin", |i| bodies[i].consistency_margin());
    assert_none("PseudoInertiaCone::margin", |i| cone.margin(&vectors[i]));
}

#[test]
fn recursive_estimators() {
    let (twists, wrenches) = (draws(&twists(1.0, 1.0), 8, INPUTS), draws(&wrenches(1.0, 1.0), 9, INPUTS));
    let observations: Vec<LinearObservation<6, 10>> = (0..INPUTS)
        .map(|i| {
            let regressor = newton_euler(&twists[i].angular, &wrenches[i].torque, &wrenches[i].force);
            let output = regressor * body_d().to_vector();
            LinearObservation { regressor, output, standard_deviation: SVector::repeat(0.1) }
        })
        .collect();
    let gate = ChiSquareGate::try_new(0.99).unwrap();
    let cone = PseudoInertiaCone::new(BodyScale::of(&body_d().to_vector()).unwrap());
    let (mean, deviation) = (cone.interior_point(), cone.magnitudes() * 3.0);
    let covariance = SMatrix::from_diagonal(&deviation.map(|s| s * s));
    let mut filter = RecursiveLeastSquares::<10, 6>::new(mean, covariance).with_gate(gate);
    assert_none("RecursiveLeastSquares", |i| filter.update(&observations[i]).unwrap());
    let mut filter = SquareRootFilter::<10, 6>::try_new(mean, deviation).unwrap().with_gate(gate);
    assert_none("SquareRootFilter", |i| filter.update(&observations[i]).unwrap());
    let mut filter = RecursiveSdp::<_, 10, 6>::try_new(cone, 3.0).unwrap().with_gate(gate);
    assert_none("RecursiveSdp", |i| filter.update(&observations[i]).unwrap());
    let process = LinearProcess::random_walk(covariance * 1e-9);
    let mut filter = KalmanFilter::<10, 6>::new(process, mean, covariance).with_gate(gate);
    assert_none("KalmanFilter", |i| filter.update(&observations[i]).unwrap());

    let seen: Vec<AccelerationObservation> = (0..INPUTS)
        .map(|i| AccelerationObservation {
            rate_body: twists[i].angular,
            wrench_body: wrenches[i],
            // A ball has no gyroscopic torque.
            acceleration_body: Wrench::new(wrenches[i].torque / 0.2, wrenches[i].force / 9.0).to_vector(),
            standard_deviation: SVector::repeat(0.1),
        })
        .collect();
    let body = PrincipalBody::try_new(9.0, Vector3::repeat(0.2)).unwrap();
    let (model, covariance) = (PrincipalMotion { drift: SVector::repeat(1e-6) }, SMatrix::identity() * 0.01);
    let mut filter = ExtendedKalmanFilter::new(model, body, covariance).with_gate(gate);
    assert_none("ExtendedKalmanFilter, four parameters", |i| filter.update(&seen[i]).unwrap());
    let mut filter = UnscentedKalmanFilter::new(model, body, covariance).with_gate(gate);
    assert_none("UnscentedKalmanFilter, four parameters", |i| filter.update(&seen[i]).unwrap());
}

#[test]
fn joint_filters_and_the_detector_of_changes() {
    // Each call costs thousands of times what a kernel does.
    const CALLS: usize = 300;
    let wrenches = draws(&wrenches(0.1, 1.0), 10, INPUTS);
    let seen: Vec<JointObservation> = (0..INPUTS)
        .map(|i| JointObservation {
            step_s: 0.016,
            wrench_body: wrenches[i],
            stored_body: Vector3::zeros(),
            world_from_body: Some(Isometry3::identity()),
            rate_body: Some(Vector3::zeros()),
            velocity_origin_world: None,
            acceleration_origin_body: Some((Vector3::zeros(), wrenches[i])),
        })
        .collect();
    let noise = MotionNoise {
        attitude_rad: 1.0,
        position_m: 1.0,
        rate_rad_s: 1.0,
        velocity_m_s: 1.0,
        acceleration_m_s2: 1.0,
        torque_n_m: 0.01,
        force_n: 0.1,
        drift: SVector::zeros(),
    };
    let model = JointMotion { noise, gravity_world: Vector3::new(0.0, 0.0, -0.1) };
    let body = LogCholesky::try_from_parameters(&body_d()).unwrap();
    let state = JointState { motion: RigidBodyState::at_rest(), body };
    let covariance = SMatrix::identity() * 1e-4;
    let gate = ChiSquareGate::try_new(0.99).unwrap();
    let extended = ExtendedKalmanFilter::new(model, state, covariance).with_gate(gate);
    let mut filter = extended;
    assert_eq!(allocations(CALLS, |i| filter.update(&seen[i]).unwrap()), 0, "ExtendedKalmanFilter, joint");
    let mut filter = UnscentedKalmanFilter::new(model, state, covariance).with_gate(gate);
    assert_eq!(allocations(CALLS, |i| filter.update(&seen[i]).unwrap()), 0, "UnscentedKalmanFilter, joint");
    let settings = FlightEstimatorSettings::new(noise);
    let std = StandardDeviations {
        mass_kg: 1.0,
        center_of_mass_m: Vector3::zeros(),
        inertia_about_com_kg_m2: nalgebra::Matrix3::zeros(),
    };
    let prior = Estimate { parameters: body_d(), covariance: SMatrix::identity() * 1e-4, std, lmi_active: false };
    let mut flight = FlightEstimator::try_new(settings, RigidBodyState::at_rest(), 0, &prior).unwrap();
    let mut now_ns = 0;
    let measured = allocations(CALLS, |i| {
        flight.acted(now_ns, now_ns + 16_000_000, &wrenches[i]);
        now_ns += 16_000_000;
        // Some come late.
        let late_ns = if i % 7 == 0 { 160_000_000 } else { 0 };
        flight.measured(&FlightMeasurement {
            stamp_ns: now_ns - late_ns - i64::from(i % 7 == 0),
            world_from_body: Isometry3::identity(),
            rate_body: Some(Vector3::repeat(1e-3 * i as f64)),
            velocity_origin_world: None,
        })
    });
    assert_eq!(measured, 0, "FlightEstimator");
    let settings = ChangeSettings { spacing: 2, updates_between_false_alarms: 1e4 };
    let widen =
        |filter: &ExtendedKalmanFilter<JointMotion, JointState, 22, 15, 10>, _| Ok(filter.after_a_jump_of_mass(0.1));
    let mut detector = ChangeDetector::<_, _, 10, 4>::try_new(extended, widen, settings).unwrap();
    assert_eq!(allocations(CALLS, |i| detector.update(&seen[i]).unwrap()), 0, "ChangeDetector");
}
