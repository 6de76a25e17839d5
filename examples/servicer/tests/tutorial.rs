//! The servicer under the laws, in `identify`, and in flight.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use servicer::cauchy::Cauchy;
use servicer::cautious::Cautious;
use servicer::dogleg::Dogleg;
use servicer::drifting_pose::DriftingPose;
use servicer::robot::{
    GYRO_RAD_S, LIDAR_M, LIMITS, PERIOD_NS, PERIOD_S, RADIUS_M, STARS_RAD, Servicer, actuators, belief, truth,
};
use tumble_planning::collision::{BodyShape, CollisionWorld, EllipsoidWorld};
use tumble_planning::control::{
    AttitudeController, AttitudeGains, AttitudeLaw, MassInterval, TubeController, TubeSettings,
};
use tumble_planning::dynamics::laws::{Held, check_momentum_storage, check_stateful_actuation, check_total_momentum};
use tumble_planning::dynamics::strategies::{draws, wrenches};
use tumble_planning::dynamics::{
    AlignedBox, FreeFlyer, InertialParameters, MuntheKaas4, ObstacleEllipsoid, Plant, RigidBodyState,
};
use tumble_planning::dynamics::{SimulatedGyrostat, StatefulActuation, World, WrenchBox};
use tumble_planning::global::{GlobalRequest, GoalRegion, MotionLimits, Objective, Until};
use tumble_planning::identification::estimator::{Acted, Estimator, EstimatorError, Finding, StateEstimator, Verdict};
use tumble_planning::identification::laws::{
    Case, EstimatorPromises, StateTrial, check_estimator, check_recursive_estimator, check_state_estimator,
};
use tumble_planning::identification::recursive::{
    FlightEstimatorSettings, MotionNoise, TwoStageEstimator, WindowRows, WrenchErrors,
};
use tumble_planning::identification::{BodyScale, Estimate, MotionSample, Pipeline, Problem, Settings, methods};
use tumble_planning::laws::{Expectation, PlannerCase, PlannerChecks, check_global_planner};
use tumble_planning::lie::{Pose, Wrench};
use tumble_planning::local::{CovarianceWeighting, RigidBodyModel};
use tumble_planning::mission::{
    BrakeLimits, ClosedLoop, ComputingTime, End, InformativeStretch, LoopSettings, NoObserver, Scene, Schedule,
    Simulated, StopLimits, StretchSettings,
};
use tumble_planning::nalgebra::{SMatrix, SVector, Translation3, UnitQuaternion, Vector3};
use tumble_planning::{ModelBelief, PlanningError, TranslationState};

type Any = Box<dyn Estimator<Record = [MotionSample]> + Send + Sync>;

// ---------------------------------------------------------------------------------------------- actuators

/// What lies inside the limits of the wheels is realised, no limit is passed, and momentum only moves between body and wheels.
#[test]
fn its_wheels_keep_the_laws() {
    let (wheels, _) = actuators().unwrap();
    let (empty, drawn) = (SVector::default(), draws(&wrenches(0.05, 0.0), 3, 40));
    let commands: Vec<_> =
        drawn.iter().map(|turn| wheels.allocate_over(&empty, turn, PERIOD_S).unwrap() * 10.0).collect();
    let excess = |torques: &SVector<f64, 4>, _: &Wrench<f64>| torques.amax() - 0.2;
    let held = Held { actuation: &wheels, inner: &empty, hold_s: PERIOD_S };
    let hard: Vec<_> = drawn.iter().map(|turn| *turn * 100.0).collect();
    check_stateful_actuation(&held, &drawn, &hard, &commands, &excess, 1e-9).unwrap();
    let overflow = |momenta: &SVector<f64, 4>| momenta.amax() - 4.0;
    check_momentum_storage(&wheels, &[empty, SVector::repeat(3.9)], &hard, PERIOD_S, &overflow, 1e-9).unwrap();
}

/// Nothing outside turns it where only its wheels do.
#[test]
fn momentum_is_kept() {
    let (wheels, _) = actuators().unwrap();
    let state = RigidBodyState::at_rest();
    let actuation = (wheels, SVector::repeat(1.0));
    let mut plant =
        SimulatedGyrostat::try_new(FreeFlyer::new(truth()), MuntheKaas4, actuation, state, PERIOD_S).unwrap();
    check_total_momentum(&mut plant, &truth(), &draws(&wrenches(0.3, 0.0), 4, 100), 1.0, 1e-9).unwrap();
}

// ---------------------------------------------------------------------------------------------- identification

/// Two minutes of pushes, every pose as it is; the wheels tell what they hold.
fn record(seed: u64, spoiled: bool) -> Vec<MotionSample> {
    let mut robot = Servicer::try_new(truth(), RigidBodyState::at_rest(), seed).unwrap();
    let mut record: Vec<MotionSample> = Vec::new();
    for k in 0..1200_u32 {
        let tone = |period_s: f64, phase: f64| {
            (std::f64::consts::TAU * f64::from(k) * PERIOD_S / period_s + phase + seed as f64).sin()
        };
        let force = Vector3::new(tone(17.0, 0.0), tone(13.0, 1.0), tone(19.0, 2.0)) * 5.0;
        let torque = Vector3::new(tone(7.0, 3.0), tone(9.0, 4.0), tone(11.0, 5.0)) * 2.0;
        let (pose, stored) = (robot.state().world_from_body, robot.stored_momentum_body());
        let told = robot.advance(&Wrench::new(torque, force), PERIOD_S).unwrap();
        let mut felt = told.acted.wrench_body;
        if spoiled && k % 40 == 7 {
            felt.force += Vector3::new(3.0, -4.0, 2.0); // a valve that reported and did not open
        }
        record.push(MotionSample {
            time_ns: i64::from(k) * PERIOD_NS,
            world_from_body: Some(pose),
            wrench_body: Some(felt),
            stored_momentum_body: Some(stored),
            ..MotionSample::default()
        });
    }
    record
}

/// The same with poses within 10 um and 10 urad: a likelihood needs noise, and rows are told of none.
fn seen(record: &[MotionSample]) -> Vec<MotionSample> {
    let seen = |(k, sample): (u32, &MotionSample)| {
        let noise = |axis: u32| f64::from((k * 6 + axis).wrapping_mul(2_654_435_761) % 4096) / 2048.0 - 1.0;
        let error = |first: u32| Vector3::new(noise(first), noise(first + 1), noise(first + 2)) * 1e-5;
        let pose = sample.world_from_body.map(|pose| {
            let turn = UnitQuaternion::from_scaled_axis(error(3));
            Pose::from_parts(Translation3::from(pose.translation.vector + error(0)), pose.rotation * turn)
        });
        MotionSample { world_from_body: pose, ..*sample }
    };
    (0..).zip(record).map(seen).collect()
}

fn settings(method: &'static str) -> Settings {
    Settings { method, ..Settings::default() }
}

#[test]
fn its_estimator_works_in_identify_beside_all_others() {
    let pipeline = Pipeline::new().with(
        "cauchy",
        "Least squares in which a row counts the less the farther it is off",
        |problem| Ok(Box::new(Cauchy { problem: *problem, half: 2.0 })),
    );
    let (clean, spoiled) = (record(1, false), record(2, true));
    let mass = |record: &[MotionSample], method| {
        pipeline.identify(record, &settings(method)).unwrap().estimate.unwrap().parameters.mass
    };
    let found = pipeline.identify(&clean, &settings("cauchy")).unwrap();
    println!("cauchy: {:?}, {:.3} kg", found.verdict, found.estimate.unwrap().parameters.mass);
    assert_eq!(found.verdict, Verdict::Identified);
    let (robust, plain) = (mass(&spoiled, "cauchy"), mass(&spoiled, "variational4"));
    println!("stuck valves: {robust:.3} kg with it, {plain:.3} kg with least squares");
    assert!((robust - 300.0).abs() < 0.5 * (plain - 300.0).abs());

    // All in one list: whatever asks for an estimator takes any of them.
    let clean = seen(&clean);
    let problem = Problem::of(&clean, &settings("auto")).unwrap();
    let mut all: Vec<(&str, Any)> = vec![("cauchy", Box::new(Cauchy { problem, half: 2.0 }))];
    for name in ["variational4", "rls", "recursive-sdp", "ekf", "maximum-likelihood"] {
        all.push((name, methods().make(name, &problem).unwrap()));
    }
    for (name, estimator) in &all {
        let mass = estimator.estimate(&clean).unwrap().point().unwrap()[0];
        println!("{name}: {mass:.3} kg");
        assert!((mass / 300.0 - 1.0).abs() < 0.02, "{name}: {mass}");
    }
}

#[test]
fn its_estimator_keeps_the_laws() {
    let make = |record: &[MotionSample]| -> Result<Any, _> {
        Ok(Box::new(Cauchy { problem: Problem::of(record, &settings("auto"))?, half: 2.0 }))
    };
    let mut whole = record(3, false);
    for (k, sample) in whole.iter_mut().enumerate() {
        // a crude source of noise will do
        let noise = |i: usize| ((k * 6 + i).wrapping_mul(2_654_435_761) % 4096) as f64 / 2048.0 - 1.0;
        let error = Wrench::new(Vector3::from_fn(|i, _| noise(i)) * 0.02, Vector3::from_fn(|i, _| noise(3 + i)) * 0.05);
        sample.wrench_body = sample.wrench_body.map(|felt| felt + error);
    }
    let (first, second) = whole.split_at(600);
    let scale = Problem::of(&whole, &settings("auto")).unwrap().scale;
    let case = Case {
        record: &whole[..],
        halves: Some([first, second]),
        exact: None,
        truth: truth().to_vector(),
        magnitudes: scale.parameter_magnitudes(),
        sigmas: 5.0,
        retold: &[],
    };
    check_estimator(&make, &case).unwrap();
}

// ---------------------------------------------------------------------------------------------- planning

fn station() -> World {
    let mast = ObstacleEllipsoid {
        world_from_ellipsoid: Pose::translation(0.2, 0.1, 0.0),
        semi_axes: Vector3::new(0.3, 0.3, 3.0),
    };
    let room = AlignedBox::between(Vector3::new(-5.0, -4.0, -3.0), Vector3::new(5.0, 4.0, 3.0));
    World { keep_in: vec![room], obstacles: vec![mast], ..World::default() }
}

const START: Vector3<f64> = Vector3::new(-2.0, 0.0, 0.0);
const GOAL: Vector3<f64> = Vector3::new(2.0, 0.0, 0.0);

#[test]
fn its_planner_keeps_the_laws() {
    let (world, body, belief) =
        (EllipsoidWorld::new(&station()).unwrap(), BodyShape::sphere(RADIUS_M).unwrap(), belief());
    let case = |start: Vector3<f64>, goal: Vector3<f64>, expectation| PlannerCase {
        request: GlobalRequest {
            world: &world,
            body: &body,
            start: TranslationState::at_rest(start),
            attitude: UnitQuaternion::identity(),
            start_s: 0.0,
            goal: GoalRegion { position: goal, radius_m: 0.0, speed_m_s: 0.0, attitude: None },
            limits: MotionLimits {
                position: AlignedBox::between(Vector3::new(-3.8, -2.8, -1.8), Vector3::new(3.8, 2.8, 1.8)),
                speed_m_s: Vector3::repeat(0.1),
                force_n: Vector3::repeat(3.0),
                torque_n_m: Vector3::zeros(),
                rate_rad_s: 0.0,
            },
            belief: &belief,
            objective: Objective::Duration,
            margin_m: 0.05,
            until: Until::BudgetSpent,
            seed: 1,
        },
        expectation,
        units: 1000,
    };
    let cases = [
        case(START, GOAL, Expectation::Solvable),
        case(START, Vector3::new(-2.0, 1.5, 0.5), Expectation::Solvable),
        case(START, Vector3::new(0.2, 0.1, 0.0), Expectation::Unsolvable),
    ];
    let checks = PlannerChecks { samples_per_arc: 20, tolerance: 1e-9, relative_tolerance: 1e-9 };
    check_global_planner(&|| Dogleg, &cases, &checks).unwrap();
}

// ---------------------------------------------------------------------------------------------- flight

fn attitude(body: &InertialParameters<f64>) -> AttitudeController {
    let gains = AttitudeGains { stiffness_n_m: 8.0, damping_n_m_s: 40.0 };
    AttitudeController { law: AttitudeLaw::Geometric, gains, body: *body, torque_limit_n_m: LIMITS.1 }
}

/// Flies from one side of the mast to the other; how many kilograms it is off at the end, and by how many it thinks that it may be.
fn fly(estimator: Box<dyn StateEstimator>) -> (f64, f64) {
    let (belief, shape) = (belief(), BodyShape::sphere(RADIUS_M).unwrap());
    let (mass, inertia) = (belief.parameters().mass, belief.parameters().inertia_about_com()[(0, 0)]);
    let (planned_n, planned_n_m) = (0.5 * LIMITS.0, 0.4 * LIMITS.1);
    let stretches = StretchSettings::default();
    let origin = AlignedBox::between(Vector3::new(-3.8, -2.8, -1.8), Vector3::new(3.8, 2.8, 1.8));
    let limits = stretches.way_limits(origin, Vector3::repeat(planned_n), Vector3::repeat(planned_n_m));
    let heavy = InertialParameters::solid_box(1.5 * mass, [1.2, 1.2, 1.5]);
    let stop = StopLimits::for_body(&heavy, planned_n, planned_n_m);
    let brake = BrakeLimits { force_n: Vector3::repeat(LIMITS.0), torque_n_m: LIMITS.1 };
    let goal = GoalRegion { position: GOAL, radius_m: 0.0, speed_m_s: 0.0, attitude: None };
    // Four metres with 300 kg take longer than the five minutes that a schedule allows by itself.
    let schedule = Schedule { longest_ns: 600_000_000_000, ..Schedule::default() };
    let settings =
        LoopSettings { decision_periods: 5, schedule, ..LoopSettings::new(shape.clone(), goal, limits, stop, brake) };
    let scene = Scene::of_world(&station(), &shape).unwrap();
    let controller = |belief: &ModelBelief| -> Result<TubeController, PlanningError> {
        let body = belief.parameters();
        let mass = MassInterval::between(0.5 * body.mass, 2.0 * body.mass)?;
        TubeController::try_new(TubeSettings::new(mass, Vector3::repeat(LIMITS.0)), None, attitude(body), body)
    };
    let mut flying = ClosedLoop::try_new(settings, scene, controller, estimator, 0).unwrap();
    let weighting = CovarianceWeighting::of_sizes([mass, inertia, inertia, inertia]).unwrap();
    let push = WrenchBox::in_every_axis(planned_n_m, planned_n).into();
    let model = RigidBodyModel::<4>::principal();
    let local = InformativeStretch::try_new(model, &stretches, push, Box::new(weighting)).unwrap();
    let mut planners = Simulated::new((Dogleg, local), ComputingTime::default());

    let start =
        RigidBodyState { world_from_body: Pose::translation(START.x, START.y, START.z), ..RigidBodyState::at_rest() };
    let mut robot = Servicer::try_new(truth(), start, 5).unwrap();
    let world = EllipsoidWorld::new(&station()).unwrap();
    let mut acted = Acted { from_ns: 0, until_ns: 0, wrench_body: Wrench::zero(), stored_body: Vector3::zeros() };
    let mut measurements = Vec::new();
    while flying.end().is_none() && acted.until_ns < 600_000_000_000 {
        let command = flying.step_with(&mut planners, &acted, &measurements, &mut NoObserver).unwrap();
        let told = robot.advance(&command.wrench_body, PERIOD_S).unwrap();
        (acted, measurements) = (told.acted, told.measurements);
        let clearance = world.clearance(&shape, &robot.state().world_from_body, 0.0).unwrap();
        assert!(clearance.distance_m > 0.0, "contact after {} s", acted.until_ns / 1_000_000_000);
    }
    let left_m = (robot.state().world_from_body.translation.vector - GOAL).norm();
    println!("{:?} after {:.0} s, {left_m:.3} m from the goal", flying.end(), acted.until_ns as f64 * 1e-9);
    assert_eq!(flying.end(), Some(&End::Arrived));
    assert!(left_m < 0.05);
    let found = flying.estimator().finding().unwrap();
    (found.point().unwrap()[0] - truth().mass, found.covariance().unwrap()[(0, 0)].sqrt())
}

#[test]
fn its_estimator_flies() {
    let start =
        RigidBodyState { world_from_body: Pose::translation(START.x, START.y, START.z), ..RigidBodyState::at_rest() };
    let (off_kg, sigma_kg) = fly(Box::new(DriftingPose::try_new(&start, belief().estimate).unwrap()));
    println!("off by {off_kg:.2} kg, one sigma {sigma_kg:.2} kg");
    assert!(off_kg.abs() < 5.0 * sigma_kg && off_kg.abs() < 6.0);
}

/// Noise of the sensors, of nozzles that err by a percent, and of a body that stays the same.
fn motion_filter() -> FlightEstimatorSettings {
    let noise = MotionNoise {
        attitude_rad: STARS_RAD[1],
        position_m: LIDAR_M,
        rate_rad_s: GYRO_RAD_S,
        velocity_m_s: 1.0,
        acceleration_m_s2: 1.0,
        torque_n_m: 0.02,
        force_n: 0.05,
        drift: SVector::repeat(1e-6),
    };
    let usual = FlightEstimatorSettings::new(noise);
    let drift = Wrench::new(Vector3::repeat(2e-3), Vector3::repeat(5e-3)).to_vector();
    FlightEstimatorSettings { wrench: WrenchErrors { drift, period_s: PERIOD_S, ..usual.wrench }, ..usual }
}

/// On the shipped filter of the motion, which takes gyroscope, star tracker and lidar each in its own time, and wheels.
#[test]
fn its_second_stage_flies() {
    let start =
        RigidBodyState { world_from_body: Pose::translation(START.x, START.y, START.z), ..RigidBodyState::at_rest() };
    let begin = Box::new(|known: &Finding| Ok(Cautious::new(known)));
    let estimator = TwoStageEstimator::try_new(motion_filter(), start, 0, &prior(), begin).unwrap();
    let (off_kg, sigma_kg) = fly(Box::new(estimator));
    println!("off by {off_kg:.2} kg, one sigma {sigma_kg:.2} kg");
    assert!(off_kg.abs() < 4.0 * sigma_kg && off_kg.abs() < 6.0);
}

fn prior() -> Finding {
    let prior = belief().estimate;
    prior.to_finding(BodyScale::of(&prior.parameters.to_vector()).unwrap()).unwrap()
}

/// Half a minute of pushes about every axis, on which the laws try an estimator.
fn trial() -> StateTrial {
    StateTrial {
        body: truth(),
        prior: prior(),
        period_ns: PERIOD_NS,
        periods: 300,
        lateness: 0,
        wrench: [1.0, 5.0],
        stored_body: Vector3::new(1.0, -2.0, 1.0),
        deviation: [1e-4, 1e-3, 1e-5, 1e-3],
        within: 0.01,
    }
}

/// Windows as the filter of the motion tells them, some of them far off.
#[test]
fn its_second_stage_keeps_the_laws() {
    let truth = truth().to_vector();
    let windows: Vec<WindowRows> = (0..40_usize)
        .map(|k| {
            let noise = |i: usize| ((k * 110 + i).wrapping_mul(2_654_435_761) % 4096) as f64 / 2048.0 - 1.0;
            let regressor = SMatrix::<f64, 10, 10>::from_fn(|i, j| noise(10 * i + j) / prior().magnitudes()[j]);
            let off = if k % 7 == 3 { 30.0 } else { 1.0 };
            let output = regressor * truth + SVector::<f64, 10>::from_fn(|i, _| off * noise(100 + i));
            WindowRows { regressor, output, standard_deviation: SVector::repeat(1.0) }
        })
        .collect();
    let promises = EstimatorPromises { constant_parameters: true, batch: None, feasible_set: None };
    let all: Vec<&WindowRows> = windows.iter().collect();
    check_recursive_estimator(&|| Ok(Cautious::new(&prior())), &all, &promises, 1e-9).unwrap();
}

/// On the shipped filter of the motion it is an estimator in flight, and keeps the laws of those too.
#[test]
fn its_second_stage_keeps_the_laws_of_flight() {
    let begin = |start: &RigidBodyState<f64>, prior: &Finding| -> Result<Box<dyn StateEstimator>, EstimatorError> {
        let second = Box::new(|known: &Finding| Ok(Cautious::new(known)));
        Ok(Box::new(TwoStageEstimator::try_new(motion_filter(), *start, 0, prior, second)?))
    };
    check_state_estimator(&begin, &trial()).unwrap();
}

/// The laws say what the other is not: it learns no moments of inertia, and does not claim to.
#[test]
fn the_laws_say_what_its_estimator_is_not() {
    let begin = |start: &RigidBodyState<f64>, prior: &_| {
        Ok(Box::new(DriftingPose::try_new(start, Estimate::try_from(prior)?)?) as Box<dyn StateEstimator>)
    };
    let broken = check_state_estimator(&begin, &trial()).unwrap_err();
    println!("{broken}");
    assert_eq!(broken.law, "exact data lead to the truth");
}
