//! Missions flown stretch by stretch as planned, and what is found on a fine grid of them.

use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};
use tumble_planning::collision::{BodyShape, CollisionWorld, EllipsoidWorld};
use tumble_planning::dynamics::{
    AlignedBox, Environment, InertialParameters, ObstacleEllipsoid, RigidBodyState, World,
};
use tumble_planning::global::{
    FlightPlanner, FlightPlannerSettings, GlobalPlanner, GlobalRequest, GoalRegion, Objective, Until,
};
use tumble_planning::lie::{Pose, Twist};
use tumble_planning::local::{Hull, InformationWeighting, Surroundings, WrenchSet, body_by_mass_center_and_inertia};
use tumble_planning::mission::{
    InformativeStretch, StretchModel, StretchOutcome, StretchPlanner, StretchSettings, StretchTask,
};
use tumble_planning::{ArcPath, ModelBelief, TranslationState, Units};

pub const RADIUS_M: f64 = 0.15;
pub const FORCE_N: f64 = 0.15;
pub const TORQUE_N_M: f64 = 0.02;

pub struct Scene {
    pub world: World,
    pub bounds: AlignedBox,
    pub start: Pose<f64>,
    pub goal: Pose<f64>,
    pub is_planar: bool,
}

fn obstacle((semi_axes, center): ([f64; 3], [f64; 3])) -> ObstacleEllipsoid {
    ObstacleEllipsoid {
        world_from_ellipsoid: Pose::from_parts(Vector3::from(center).into(), UnitQuaternion::identity()),
        semi_axes: semi_axes.into(),
    }
}

fn yawed(position: [f64; 3], degrees: f64) -> Pose<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), degrees.to_radians());
    Pose::from_parts(Vector3::from(position).into(), turn)
}

/// The slalom on the station.
pub fn slalom() -> Scene {
    let walls = [([0.5, 0.05, 2.0], [10.3, -8.5, 4.9]), ([0.5, 0.05, 2.0], [11.2, -9.0, 4.9])];
    Scene {
        world: World { obstacles: walls.map(obstacle).to_vec(), ..World::default() },
        bounds: AlignedBox { lower_world: Vector3::new(10.3, -9.8, 4.2), upper_world: Vector3::new(11.2, -7.5, 5.3) },
        start: yawed([10.8, -9.6, 4.8], -90.0),
        goal: yawed([10.8, -7.75, 5.2], 0.0),
        is_planar: false,
    }
}

/// The room on the table.
pub fn room() -> Scene {
    let walls = [
        ([0.7, 0.1, 5.0], [-0.3, 0.0, 0.0]),
        ([0.2, 0.2, 5.0], [-0.75, -0.3, 0.0]),
        ([0.2, 0.2, 5.0], [0.75, -0.75, 0.0]),
        ([0.2, 0.2, 5.0], [-0.05, -0.8, 0.0]),
    ];
    Scene {
        world: World { obstacles: walls.map(obstacle).to_vec(), ..World::default() },
        bounds: AlignedBox { lower_world: Vector3::new(-0.8, -0.8, -0.76), upper_world: Vector3::new(0.8, 0.8, -0.76) },
        start: yawed([0.0, 0.6, -0.76], -90.0),
        goal: yawed([-0.4, -0.4, -0.76], 0.0),
        is_planar: true,
    }
}

/// A body of which little is known: shares of its mass and inertia, and m.
pub fn belief(mass: f64, center_m: Vector3<f64>, shares: [f64; 3]) -> ModelBelief {
    let moments = Vector3::new(0.153, 0.143, 0.162) * (mass / 9.58);
    ModelBelief::vague(1, InertialParameters::about_com(mass, center_m, Matrix3::from_diagonal(&moments)), shares)
}

pub fn way(scene: &Scene, belief: &ModelBelief, settings: &StretchSettings, units: u64, seed: u64) -> Option<ArcPath> {
    let world = EllipsoidWorld::new(&scene.world).unwrap();
    let body = BodyShape::sphere(RADIUS_M).unwrap();
    let flat = if scene.is_planar { 0.0 } else { 1.0 };
    let request = GlobalRequest {
        world: &world,
        body: &body,
        start: TranslationState::at_rest(scene.start.translation.vector),
        attitude: scene.start.rotation,
        start_s: 0.0,
        goal: GoalRegion::pose(&scene.goal),
        limits: settings.way_limits(
            scene.bounds,
            Vector3::new(1.0, 1.0, flat) * FORCE_N,
            Vector3::new(flat, flat, 1.0) * TORQUE_N_M,
        ),
        belief,
        objective: Objective::Duration,
        margin_m: settings.margin_m + 0.005,
        until: Until::BudgetSpent,
        seed,
    };
    let mut planner = FlightPlanner::new(FlightPlannerSettings::default());
    let answer = planner.plan(&request, &mut Units::new(units)).unwrap();
    answer.plan.map(|plan| plan.trajectory)
}

/// What may be hit, the walls of the room of positions included.
pub fn surroundings(scene: &Scene, margin_m: f64) -> Surroundings {
    let reach = Vector3::repeat(RADIUS_M + margin_m);
    let mut room =
        AlignedBox { lower_world: scene.bounds.lower_world - reach, upper_world: scene.bounds.upper_world + reach };
    if scene.is_planar {
        (room.lower_world.z, room.upper_world.z) = (-10.0, 10.0);
    }
    let world = World { keep_in: vec![room], ..scene.world.clone() };
    Surroundings::of_world(&world, Hull::Shape(BodyShape::sphere(RADIUS_M).unwrap())).unwrap()
}

/// The belief with another covariance of the quantities in these places among mass, centre of mass and inertia about it.
pub fn learned<const P: usize>(
    belief: &ModelBelief,
    places: &[usize; P],
    covariance: &SMatrix<f64, P, P>,
) -> ModelBelief {
    let by_central = body_by_mass_center_and_inertia(belief.parameters());
    let back = by_central.try_inverse().unwrap();
    let mut central = back * belief.estimate.covariance * back.transpose();
    for i in 0..P {
        for j in 0..P {
            central[(places[i], places[j])] = covariance[(i, j)];
        }
    }
    let mut next = belief.clone();
    next.revision += 1;
    next.estimate.covariance = by_central * central * by_central.transpose();
    next
}

/// Time that this thread has had on a core, ms; zero where the system does not tell.
fn cpu_ms() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|first| first.parse::<f64>().ok()).unwrap_or(0.0) * 1e-6
}

/// What a flight came to.
#[derive(Debug, Default)]
pub struct Flown {
    pub refused: bool,
    pub arrived: bool,
    pub stretches: usize,
    pub arrival_s: f64,
    pub way_s: f64,
    pub clearance_m: f64,
    /// Largest of input, speed, rate, in units of their limits.
    pub input: f64,
    pub speed: f64,
    pub rate: f64,
    /// Largest distance of a stretch's end from the way, m, m/s.
    pub end_m: f64,
    pub end_m_s: f64,
    pub core_ms: Vec<f64>,
    pub units: Vec<u64>,
    /// After each stretch, as if all were measured as predicted: sigma of each quantity over that of the start.
    pub sigma: Vec<Vec<f64>>,
    /// Integrals of the absolute forces and torques, N s and N m s.
    pub impulse: [f64; 2],
}

/// Flies a mission stretch by stretch, the belief's covariance as predicted.
#[allow(clippy::too_many_arguments, reason = "all that a mission is")]
pub fn fly<M, const X: usize, const U: usize, const P: usize>(
    model: M,
    scene: &Scene,
    way: &ArcPath,
    belief: &ModelBelief,
    settings: &StretchSettings,
    weighting: Box<dyn InformationWeighting<P>>,
    places: &[usize; P],
    start: RigidBodyState<f64>,
) -> Flown
where
    M: StretchModel<X, U, P> + Clone,
{
    let limit = M::IS_TORQUE.map(|is_torque| if is_torque { TORQUE_N_M } else { FORCE_N });
    let wrench = WrenchSet { limit, half_spaces: Vec::new() };
    let mut planner = InformativeStretch::try_new(model, settings, wrench, weighting).unwrap();
    let around = surroundings(scene, settings.margin_m);
    let world = EllipsoidWorld::new(&scene.world).unwrap();
    let body = BodyShape::sphere(RADIUS_M).unwrap();
    let mut belief = belief.clone();
    let mut flown = Flown { clearance_m: f64::INFINITY, way_s: way.duration_s(), ..Flown::default() };
    let mut start = start;
    let mut start_s = 0.0;
    while flown.stretches < 20 {
        let task = StretchTask {
            start,
            start_s,
            asked_s: start_s,
            way,
            way_start_s: 0.0,
            belief: &belief,
            environment: &Environment::default(),
            surroundings: &around,
            is_informative: true,
            elapsed_s: start_s,
        };
        let mut budget = Units::new(u64::MAX);
        let clock = cpu_ms();
        let answer = planner.plan(&task, &mut budget).unwrap();
        flown.core_ms.push(cpu_ms() - clock);
        flown.units.push(budget.spent());
        let StretchOutcome::Planned(answer) = answer else {
            flown.refused = true;
            return flown;
        };
        let plan = planner.last_plan().unwrap();
        let (model, step_s) = (planner.model(), plan.step_s);
        for input in &plan.inputs {
            for (value, limit) in input.iter().zip(limit) {
                flown.input = flown.input.max(value.abs() / limit);
            }
            for (is_torque, value) in M::IS_TORQUE.into_iter().zip(input) {
                flown.impulse[usize::from(is_torque)] += value.abs() * step_s;
            }
        }
        for part in 0..=8 * plan.inputs.len() {
            let at = answer.motion.state_at(start_s + step_s * part as f64 / 8.0);
            let velocity = at.world_from_body.rotation * at.twist_body.linear;
            let clearance = world.clearance(&body, &at.world_from_body, 0.0).unwrap();
            flown.clearance_m = flown.clearance_m.min(clearance.distance_m);
            flown.speed = flown.speed.max(velocity.amax() / settings.speed.speed_m_s.x);
            flown.rate = flown.rate.max(at.twist_body.angular.amax() / settings.speed.rate_rad_s.x);
        }
        let end = model.kinematics(plan.states.last().unwrap());
        start = answer.motion.state_at(answer.motion.end_s());
        start_s += planner.horizon_s();
        flown.stretches += 1;
        flown.sigma.push(answer.sigma.iter().map(|[before, after]| after / before).collect());
        belief = learned(&belief, places, plan.covariances.last().unwrap());
        if let Some((arc, within)) = way.at(start_s) {
            let on_way = arc.translation(within).0;
            let velocity = if start_s >= way.duration_s() { Vector3::zeros() } else { on_way.velocity };
            flown.end_m = flown.end_m.max((end.position_world() - on_way.position).norm());
            flown.end_m_s = flown.end_m_s.max((end.velocity_world - velocity).norm());
        }
        if let Some(arrival_s) = answer.arrival_s {
            flown.arrival_s = arrival_s;
            flown.arrived = true;
            break;
        }
    }
    flown
}

pub fn at_rest(pose: Pose<f64>) -> RigidBodyState<f64> {
    RigidBodyState { world_from_body: pose, twist_body: Twist::zero() }
}
