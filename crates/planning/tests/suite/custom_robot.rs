//! Tutorial: fly missions with a robot of your own. Four steps: say what it is, what it is taken for, build the loop, close it.
//!
//! The robot here is a tug: a ball that jets push by at most 0.6 N and turn by at most 0.06 N m. It sees where it is, not how fast it
//! is; a pose arrives a control period after it was true. It takes itself for two thirds of what it weighs, and finds out on the way.

use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use tumble_planning::collision::{BodyShape, CollisionWorld, EllipsoidWorld};
use tumble_planning::control::{
    AttitudeController, AttitudeGains, AttitudeLaw, Controller, LqrController, MassInterval, TranslationWeights,
    TubeController, TubeSettings,
};
use tumble_planning::dynamics::{
    AlignedBox, Environment, FreeFlyer, FreeFlyerIn, InertialParameters, MuntheKaas4, ObstacleEllipsoid, Plant,
    RigidBodyState, SimulatedBody, StoredMomentum, World, WrenchBox,
};
use tumble_planning::global::{FlightPlanner, GoalRegion};
use tumble_planning::identification::estimator::{Acted, Measurement, StateEstimator};
use tumble_planning::identification::recursive::{FlightEstimator, FlightEstimatorSettings};
use tumble_planning::lie::{Pose, Wrench};
use tumble_planning::local::{CovarianceWeighting, RigidBodyModel};
use tumble_planning::mission::{
    BrakeLimits, ClosedLoop, ComputingTime, End, InformativeStretch, LoopObserver, LoopSettings, NoObserver, Office,
    Scene, Simulated, StopLimits, StretchPlanner, StretchSettings,
};
use tumble_planning::nalgebra::{UnitQuaternion, Vector3};
use tumble_planning::{ModelBelief, PlanningError, unit_interval};

// Step 1: what it is. Sizes, limits, the body, how it senses, and what stands in its room: two posts in the way.
const PERIOD_NS: i64 = 40_000_000;
const PERIOD_S: f64 = 0.04;
const RADIUS_M: f64 = 0.3;
const FORCE_N: f64 = 0.6;
const TORQUE_N_M: f64 = 0.06;
const GOAL: Vector3<f64> = Vector3::new(0.9, 0.0, 0.0);
const NOISE_M: f64 = 0.001;
const NOISE_RAD: f64 = 0.001;

fn truth() -> InertialParameters<f64> {
    let cube = InertialParameters::solid_box(24.0, [0.4, 0.4, 0.4]);
    InertialParameters::about_com(24.0, Vector3::new(0.02, -0.02, 0.01), cube.inertia_about_com())
}

fn room() -> World {
    let post = |x, y| ObstacleEllipsoid {
        world_from_ellipsoid: Pose::translation(x, y, 0.0),
        semi_axes: Vector3::new(0.15, 0.15, 1.5),
    };
    let walls = AlignedBox::between(Vector3::new(-1.5, -1.0, -0.6), Vector3::new(1.5, 1.0, 0.6));
    World { keep_in: vec![walls], obstacles: vec![post(-0.2, 0.25), post(0.4, -0.6)], ..World::default() }
}

fn start() -> RigidBodyState<f64> {
    RigidBodyState { world_from_body: Pose::translation(-0.8, 0.0, 0.0), ..RigidBodyState::at_rest() }
}

// Step 2: what it is taken for, and how little is known of it.
fn belief() -> ModelBelief {
    ModelBelief::vague(0, InertialParameters::solid_box(16.0, [0.4, 0.4, 0.4]), [0.4, 0.03, 0.4])
}

/// The tube for the translation, a law for the turn: made now, and anew when the body may be anything.
fn tube(belief: &ModelBelief) -> Result<TubeController, PlanningError> {
    let body = belief.parameters();
    let mass = MassInterval::between(0.5 * body.mass, 2.0 * body.mass)?;
    TubeController::try_new(TubeSettings::new(mass, Vector3::repeat(FORCE_N)), None, attitude(body), body)
}

fn attitude(body: &InertialParameters<f64>) -> AttitudeController {
    let gains = AttitudeGains { stiffness_n_m: 0.15, damping_n_m_s: 0.45 };
    AttitudeController { law: AttitudeLaw::Geometric, gains, body: *body, torque_limit_n_m: TORQUE_N_M }
}

// Step 3: the layers. Estimator and planners get the numbers above, and everything else has its usual value.
type Tug<C, E> = ClosedLoop<EllipsoidWorld, C, E>;
type Stretches = InformativeStretch<RigidBodyModel<4>, 12, 6, 4>;

/// Plans push less hard than the controller may.
const PLANNED_N: f64 = 0.5 * FORCE_N;
const PLANNED_N_M: f64 = 0.4 * TORQUE_N_M;

fn estimator() -> FlightEstimator {
    let settings = FlightEstimatorSettings::of_poses(NOISE_RAD, NOISE_M, PERIOD_S);
    FlightEstimator::try_new(settings, start(), 0, &belief().estimate).unwrap()
}

fn planners() -> (FlightPlanner, Stretches) {
    let body = *belief().parameters();
    let (mass, inertia) = (body.mass, body.inertia_about_com()[(0, 0)]);
    // what is worth learning: the mass, and the moments of inertia
    let weighting = CovarianceWeighting::of_sizes([mass, inertia, inertia, inertia]).unwrap();
    let settings = StretchSettings::of_poses(NOISE_RAD, NOISE_M, PERIOD_S);
    let push = WrenchBox::in_every_axis(PLANNED_N_M, PLANNED_N).into();
    let model = RigidBodyModel::principal();
    let stretches = InformativeStretch::try_new(model, &settings, push, Box::new(weighting)).unwrap();
    (FlightPlanner::default(), stretches)
}

fn tug<C: Controller, E: StateEstimator>(
    new_controller: impl FnMut(&ModelBelief) -> Result<C, PlanningError> + Send + 'static,
    estimator: E,
    room: &World,
) -> Tug<C, E> {
    tug_told(Environment::default(), new_controller, estimator, room)
}

/// The same, told what acts on it besides its jets.
fn tug_told<C: Controller, E: StateEstimator>(
    environment: Environment,
    new_controller: impl FnMut(&ModelBelief) -> Result<C, PlanningError> + Send + 'static,
    estimator: E,
    room: &World,
) -> Tug<C, E> {
    let shape = BodyShape::sphere(RADIUS_M).unwrap();
    let origin = AlignedBox::between(Vector3::new(-1.15, -0.65, -0.25), Vector3::new(1.15, 0.65, 0.25));
    let stretches = StretchSettings::of_poses(NOISE_RAD, NOISE_M, PERIOD_S);
    let limits = stretches.way_limits(origin, Vector3::repeat(PLANNED_N), Vector3::repeat(PLANNED_N_M));
    let goal = GoalRegion::pose(&Pose::from_parts(GOAL.into(), UnitQuaternion::new(Vector3::z() * 0.8)));
    let heavy = InertialParameters::solid_box(2.0 * belief().parameters().mass, [0.4; 3]);
    let stop = StopLimits::for_body(&heavy, PLANNED_N, PLANNED_N_M);
    let brake = BrakeLimits { force_n: Vector3::repeat(FORCE_N), torque_n_m: TORQUE_N_M };
    let usual = LoopSettings::new(shape.clone(), goal, limits, stop, brake);
    let settings = LoopSettings { decision_periods: 5, environment, ..usual };
    let scene = Scene::of_world(room, &shape).unwrap();
    ClosedLoop::try_new(settings, scene, new_controller, estimator, 0).unwrap()
}

/// Planners beside the loop, as slow as on a small computer: the same flight is the same to the bit.
fn simulated<G, L: StretchPlanner>(planners: (G, L)) -> Simulated<G, L> {
    Simulated::new(planners, ComputingTime::default())
}

// Step 4: close the loop. What is sensed goes in, a wrench comes out, the plant moves, and what matters is checked, until the mission ends.
fn flown<C: Controller, E: StateEstimator>(
    flying: &mut Tug<C, E>,
    office: &mut impl Office<EllipsoidWorld>,
    observer: &mut impl LoopObserver,
) -> RigidBodyState<f64> {
    flown_among(&Environment::default(), Vector3::zeros(), flying, office, observer)
}

/// The same where more acts, and where a wheel that is never driven stores so much momentum, N m s.
fn flown_among<C: Controller, E: StateEstimator>(
    environment: &Environment,
    stored_body: Vector3<f64>,
    flying: &mut Tug<C, E>,
    office: &mut impl Office<EllipsoidWorld>,
    observer: &mut impl LoopObserver,
) -> RigidBodyState<f64> {
    let environment = environment.clone().with(StoredMomentum { momentum_body: stored_body });
    let body = FreeFlyerIn { body: FreeFlyer::new(truth()), environment };
    let limits = WrenchBox::in_every_axis(TORQUE_N_M, FORCE_N);
    let mut plant = SimulatedBody::try_new(body, MuntheKaas4, limits, start(), PERIOD_S).unwrap();
    let (world, shape) = (EllipsoidWorld::new(&room()).unwrap(), BodyShape::sphere(RADIUS_M).unwrap());
    let mut random = ChaCha8Rng::seed_from_u64(1);
    // the sum of twelve evenly distributed numbers is nearly normal
    let mut noise =
        |sigma: f64| Vector3::from_fn(|_, _| sigma * ((0..12).map(|_| unit_interval(&mut random)).sum::<f64>() - 6.0));
    let (mut wrench_body, mut on_its_way, mut from_ns, mut until_ns) = (Wrench::zero(), Vec::new(), 0, 0);
    while flying.end().is_none() {
        let pose = plant.state().world_from_body;
        let world_from_body = Pose::from_parts(
            (pose.translation.vector + noise(NOISE_M)).into(),
            pose.rotation * UnitQuaternion::new(noise(NOISE_RAD)),
        );
        let measured = Measurement::of_pose(until_ns, &world_from_body, NOISE_RAD, NOISE_M);
        let arrived = std::mem::replace(&mut on_its_way, vec![measured]);
        let acted = Acted { from_ns, until_ns, wrench_body, stored_body };
        let wrench = flying.step_with(office, &acted, &arrived, observer).unwrap().wrench_body;
        assert!(wrench.force.amax() <= FORCE_N + 1e-9 && wrench.torque.amax() <= TORQUE_N_M + 1e-9, "{wrench:?}");
        wrench_body = plant.advance(&wrench, PERIOD_S).unwrap().realized_wrench_body;
        (from_ns, until_ns) = (until_ns, until_ns + PERIOD_NS);
        let clearance = world.clearance(&shape, &plant.state().world_from_body, 0.0).unwrap();
        assert!(clearance.distance_m > 0.0, "contact at {} s", plant.time_s());
    }
    *plant.state()
}

/// Whether it arrives.
fn fly<C: Controller, E: StateEstimator>(
    flying: &mut Tug<C, E>,
    office: &mut impl Office<EllipsoidWorld>,
    observer: &mut impl LoopObserver,
) -> bool {
    let last = flown(flying, office, observer);
    has_arrived(flying, &last)
}

/// Whether it has, where it moves so in the end.
fn has_arrived<C: Controller, E: StateEstimator>(flying: &Tug<C, E>, last: &RigidBodyState<f64>) -> bool {
    flying.end() == Some(&End::Arrived) && (last.world_from_body.translation.vector - GOAL).norm() < 0.03
}

#[test]
fn the_tug_arrives_and_learns_what_it_weighs() {
    let mut flying = tug(tube, estimator(), &room());
    assert!(fly(&mut flying, &mut simulated(planners()), &mut NoObserver));
    let estimate = flying.estimator().estimate();
    let error_kg = (estimate.parameters.mass - truth().mass).abs();
    assert!(error_kg < 3.0 * estimate.std.mass_kg && error_kg < 0.03 * truth().mass, "{error_kg} kg");
}

/// Whatever is behind the trait flies; here feedback that knows of no limit and no doubt.
#[test]
fn another_controller_flies_it_too() {
    let weights = TranslationWeights::default();
    let new = move |belief: &ModelBelief| {
        LqrController::lqr(0.2, &weights, attitude(belief.parameters()), Vector3::repeat(FORCE_N))
    };
    assert!(fly(&mut tug(new, estimator(), &room()), &mut simulated(planners()), &mut NoObserver));
}

#[path = "custom_robot/among.rs"]
mod among;
#[path = "custom_robot/new_ways.rs"]
mod new_ways;
#[path = "custom_robot/own_layers.rs"]
mod own_layers;
#[path = "custom_robot/promised.rs"]
mod promised;
#[path = "custom_robot/retreats.rs"]
mod retreats;
#[path = "custom_robot/same_again.rs"]
mod same_again;
