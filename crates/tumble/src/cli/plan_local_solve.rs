//! From a scenario's local problem to the planner's answer, whatever the number of unknowns.

use super::plan_blockers::{moving_obstacles, world_at_rest};
use crate::TumbleError;
use crate::scenario::{LocalProblem, PlanningProblem, UnknownsName, WeightingName};
use std::time::Instant;
use tumble_astrobee::planning_presets::{COVARIANCE_WEIGHTING, EXPONENTIAL_WEIGHTING, STEP_WEIGHTING};
use tumble_dynamics::nalgebra::{SMatrix, SVector, UnitQuaternion, Vector2, Vector3};
use tumble_dynamics::{AlignedBox, BodyAcceleration, FreeFlyer, InertialParameters, PARAMETERS};
use tumble_dynamics::{PoseReference, PoseTracker, RigidBodyState, World};
use tumble_lie::{Twist, Wrench};
use tumble_planning::local::{
    BodyParameters, CostParts, CovarianceWeighting, ExponentialWeighting, FixedWeighting, Guess, Hull,
    InformationWeighting, InformativeModel, Kinematics, Knowledge, LocalAnswer, LocalRequest, LocalSettings,
    LocalStatus, Nuisance, PlanarBodyModel, PlanarState, Reference, RigidBodyModel, StepWeighting, Surroundings,
    TerminalRegion, TrackedMotion, WeightingContext, WrenchSet, body_by_mass_center_and_inertia,
};
use tumble_planning::mission::ChosenModel;
use tumble_planning::{ArcPath, Budget, PlanningError};

/// Weight of a squared standard deviation in units of the quantity's own size.
const RELATIVE_WEIGHT: f64 = 100.0;
/// Standard deviations at which mass (kg), centre of mass (m) and inertia (kg m^2) are known well enough: RATTLE's.
const TARGET_SIGMAS: [f64; 3] = [0.173_205_080_756_887_73, 0.01, 0.01];
/// Residual of the optimality conditions at which the search ends.
const TOLERANCE: f64 = 1e-5;
/// Most iterations.
const ITERATIONS: usize = 300;
/// Least length over which distances to obstacles are measured, m.
const LENGTH_SCALE_M: f64 = 0.1;
/// A ball about the origin whose radius and margin are less than this is a point, m: distances between solids are not followed
/// more closely.
const POINT_M: f64 = 1e-4;
/// What is planned.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub problem: &'a PlanningProblem,
    pub local: &'a LocalProblem,
    /// Where the segment begins.
    pub start: Kinematics,
    /// Where it should end.
    pub target: Kinematics,
    /// The way that it is a part of.
    pub way: &'a ArcPath,
    /// Length of the mission, s.
    pub mission_s: f64,
}

/// One of the quantities that are not known.
#[derive(Clone, Debug)]
pub(super) struct Quantity {
    pub name: &'static str,
    pub unit: &'static str,
    /// What it is believed to be; none for nuisances.
    pub believed: Option<f64>,
    /// Weight of its variance.
    pub weight: f64,
    /// Standard deviation before.
    pub prior_sigma: f64,
    /// The same at each node, as it is predicted; empty without a plan.
    pub sigmas: Vec<f64>,
}

impl Quantity {
    /// What is left at the end.
    pub fn last_sigma(&self) -> Option<f64> {
        self.sigmas.last().copied()
    }

    /// A standard deviation as a share of what is believed; none of what is believed to be zero.
    pub fn relative(&self, sigma: f64) -> Option<f64> {
        self.believed.filter(|value| *value != 0.0).map(|value| sigma / value.abs())
    }
}

/// The planner's answer without its sizes.
#[derive(Clone, Debug)]
pub(super) struct Segment {
    pub status: LocalStatus,
    pub cost: Option<CostParts>,
    pub optimality: f64,
    pub violation: f64,
    pub iterations: usize,
    pub units: u64,
    pub wall_s: f64,
    pub step_s: f64,
    pub model_revision: Option<u64>,
    /// One more than inputs; empty without a plan.
    pub motion: Vec<Kinematics>,
    /// Each held for a step.
    pub inputs: Vec<Wrench<f64>>,
    pub quantities: Vec<Quantity>,
    /// Directions about which the plan tells next to nothing, in prior standard deviations, with the share that is left.
    pub unobservable: Vec<(Vec<f64>, f64)>,
}

impl Segment {
    /// Time of a node, s.
    pub fn time_s(&self, node: usize) -> f64 {
        self.step_s * node as f64
    }

    /// Length, s.
    pub fn duration_s(&self) -> f64 {
        self.time_s(self.inputs.len())
    }
}

/// Plans the segment.
///
/// # Errors
/// [`TumbleError::Planning`] where it cannot be posed.
pub(super) fn solve(task: &Task<'_>, budget: &mut dyn Budget) -> Result<Segment, TumbleError> {
    let nuisances = nuisances(task.local);
    let parameters = match task.local.unknowns {
        UnknownsName::Planar => return on_table(PlanarBodyModel::mass_and_inertia(), task, budget),
        UnknownsName::PlanarCom => return on_table(PlanarBodyModel::full(), task, budget),
        UnknownsName::Principal => BodyParameters::Principal,
        UnknownsName::Full => BodyParameters::Full,
    };
    match parameters.count() + nuisances.len() {
        4 => in_space::<4>(parameters, &nuisances, task, budget),
        7 => in_space::<7>(parameters, &nuisances, task, budget),
        10 => in_space::<10>(parameters, &nuisances, task, budget),
        13 => in_space::<13>(parameters, &nuisances, task, budget),
        16 => in_space::<16>(parameters, &nuisances, task, budget),
        _ => Err(PlanningError::Unsupported { query: "be planned in with so many nuisances" }.into()),
    }
}

/// Three axes of each nuisance that is not known.
fn nuisances(local: &LocalProblem) -> Vec<(Nuisance, f64)> {
    let kinds: [fn(usize) -> Nuisance; 4] =
        [Nuisance::ForceScale, Nuisance::TorqueScale, Nuisance::ForceBias, Nuisance::TorqueBias];
    let each = kinds.into_iter().zip(local.nuisances).filter_map(|(kind, sigma)| Some((kind, sigma?)));
    each.flat_map(|(kind, sigma)| (0..3).map(move |axis| (kind(axis), sigma))).collect()
}

fn in_space<const P: usize>(
    parameters: BodyParameters,
    nuisances: &[(Nuisance, f64)],
    task: &Task<'_>,
    budget: &mut dyn Budget,
) -> Result<Segment, TumbleError>
where
    RigidBodyModel<P>: ChosenModel<12, 6, P, State = Kinematics>,
{
    let local = task.local;
    let model = RigidBodyModel::<P>::with_nuisances(parameters, nuisances)?;
    let [torque, force] = local.effort;
    let groups = [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3];
    let settings = settings(task, groups, [torque, torque, torque, force, force, force], local.wrench.clone());
    let wrench =
        |[tx, ty, tz, fx, fy, fz]: &[f64; 6]| Wrench::new(Vector3::new(*tx, *ty, *tz), Vector3::new(*fx, *fy, *fz));
    plan(model, settings, (task.start, task.target), wrench, task, budget)
}

fn on_table<const P: usize>(
    model: PlanarBodyModel<P>,
    task: &Task<'_>,
    budget: &mut dyn Budget,
) -> Result<Segment, TumbleError>
where
    PlanarBodyModel<P>: ChosenModel<6, 3, P, State = PlanarState>,
{
    let [torque, force] = task.local.effort;
    let WrenchSet { limit: [_, _, tz, fx, fy, _], half_spaces } = &task.local.wrench;
    // What of the half-spaces is left where only the plane's part is asked for.
    let half_spaces = half_spaces.iter().map(|([_, _, tz, fx, fy, _], offset)| ([*tz, *fx, *fy], *offset));
    let wrench_set = WrenchSet { limit: [*tz, *fx, *fy], half_spaces: half_spaces.collect() };
    let settings = settings(task, [0, 0, 1, 1, 2, 3], [torque, force, force], wrench_set);
    let heading = |rotation: &UnitQuaternion<f64>| 2.0 * f64::atan2(rotation.k, rotation.w);
    let at = |motion: &Kinematics, heading_rad: f64| PlanarState {
        position_world: Vector2::new(motion.world_from_body.translation.x, motion.world_from_body.translation.y),
        velocity_world: motion.velocity_world.xy(),
        heading_rad,
        rate_rad_s: motion.rate_body.z,
    };
    let (start, target) = (&task.start, &task.target);
    let from_rad = heading(&start.world_from_body.rotation);
    let turn = start.world_from_body.rotation.inverse() * target.world_from_body.rotation;
    let turn = if turn.w < 0.0 { UnitQuaternion::new_unchecked(-turn.into_inner()) } else { turn };
    let states = (at(start, from_rad), at(target, from_rad + heading(&turn)));
    let wrench =
        |[torque, fx, fy]: &[f64; 3]| Wrench::new(Vector3::new(0.0, 0.0, *torque), Vector3::new(*fx, *fy, 0.0));
    plan(model, settings, states, wrench, task, budget)
}

/// The planner's settings; `groups` says of each coordinate whether it is position, velocity, attitude or rate.
fn settings<const X: usize, const U: usize>(
    task: &Task<'_>,
    groups: [usize; X],
    effort: [f64; U],
    wrench: WrenchSet<U>,
) -> LocalSettings<X, U> {
    let local = task.local;
    let of = |values: [f64; 4]| groups.map(|group| values[group]);
    let information = local.measurement.map(|sigma| local.samples_per_step / (sigma * sigma));
    LocalSettings {
        steps: local.steps,
        step_s: local.step_s,
        tracking: of(local.tracking),
        terminal: of(local.terminal),
        effort,
        acceleration: local.acceleration,
        wrench,
        speed: local.speed,
        measurement: SMatrix::from_diagonal(&SVector::from(of(information))),
        retained: [1.0; X],
        criterion: local.criterion,
        margin_m: hull(task).1,
        length_scale_m: task.problem.body.bounding_radius_m().max(LENGTH_SCALE_M),
        on_segments: local.on_segments,
        tolerance: TOLERANCE,
        iterations: ITERATIONS,
    }
}

/// What may hit something, and the distance kept. What is next to no size is a point with its radius in the margin.
fn hull(task: &Task<'_>) -> (Hull, f64) {
    let (body, margin_m) = (&task.problem.body, task.local.margin_m);
    if let [part] = body.parts() {
        let radius_m = part.semi_axes.max();
        let is_centred = part.body_from_ellipsoid.translation.vector == Vector3::zeros();
        if is_centred && part.semi_axes.min() >= radius_m && margin_m + radius_m <= POINT_M {
            return (Hull::Point, margin_m + radius_m);
        }
    }
    (Hull::Shape(body.clone()), margin_m)
}

/// Obstacles and boxes, the keep-in boxes cut to where the body origin may be: a sphere then keeps its centre there exactly.
///
/// # Errors
/// Those of [`Surroundings`].
fn surroundings(task: &Task<'_>) -> Result<Surroundings, PlanningError> {
    let problem = &lowered(task.problem, height_m(task));
    let World { keep_in, keep_out, obstacles } = world_at_rest(problem);
    let reach = Vector3::repeat(problem.body.bounding_radius_m() + task.local.margin_m);
    let mut allowed = AlignedBox {
        lower_world: problem.limits.position.lower_world - reach,
        upper_world: problem.limits.position.upper_world + reach,
    };
    if problem.place.is_planar() {
        (allowed.lower_world.z, allowed.upper_world.z) = (f64::NEG_INFINITY, f64::INFINITY);
    }
    let keep_in = if keep_in.is_empty() { vec![allowed] } else { keep_in };
    let cut = keep_in.iter().map(|room| AlignedBox {
        lower_world: room.lower_world.sup(&allowed.lower_world),
        upper_world: room.upper_world.inf(&allowed.upper_world),
    });
    let keep_in = cut.filter(|room| (room.upper_world - room.lower_world).min() > 0.0).collect();
    let world = World { keep_in, keep_out, obstacles };
    Surroundings::of_world(&world, hull(task).0)?.with_moving(moving_obstacles(problem))
}

/// Where the plane of a robot on the table is, m: its model moves in the plane z = 0.
fn height_m(task: &Task<'_>) -> f64 {
    if task.problem.place.is_planar() { task.start.world_from_body.translation.z } else { 0.0 }
}

/// The same world with its origin at a height.
fn lowered(problem: &PlanningProblem, height_m: f64) -> PlanningProblem {
    let mut problem = problem.clone();
    for obstacle in &mut problem.world.obstacles {
        obstacle.world_from_ellipsoid.translation.vector.z -= height_m;
    }
    for room in problem.world.keep_in.iter_mut().chain(&mut problem.world.keep_out) {
        room.lower_world.z -= height_m;
        room.upper_world.z -= height_m;
    }
    problem
}

fn plan<M, const X: usize, const U: usize, const P: usize>(
    model: M,
    settings: LocalSettings<X, U>,
    (start, target): (M::State, M::State),
    wrench: impl Fn(&[f64; U]) -> Wrench<f64>,
    task: &Task<'_>,
    budget: &mut dyn Budget,
) -> Result<Segment, TumbleError>
where
    M: ChosenModel<X, U, P> + Clone,
{
    let local = task.local;
    let mut believing = model.clone();
    let knowledge = believing.adopt(&local.belief)?;
    let prior = prior_covariance(&knowledge)?;
    let weights = weights(task, &prior)?;
    let surroundings = surroundings(task)?;
    let terminal = local.terminal_region.map(|(radius_m, speed_m_s)| TerminalRegion {
        position_world: task.target.world_from_body.translation.vector - Vector3::z() * height_m(task),
        radius_m,
        speed_m_s,
    });
    let step_s = settings.step_s;
    let mut planner = model.local_planner(settings)?;
    let request = LocalRequest {
        start: &start,
        start_s: 0.0,
        reference: Reference::Hold(&target),
        terminal,
        belief: &local.belief,
        information: weights,
        reserved: [0.0; U],
        surroundings: &surroundings,
        guess: Guess::Excited,
    };
    let clock = Instant::now();
    let answer = planner.plan(&request, budget)?;
    let wall_s = clock.elapsed().as_secs_f64();
    Ok(segment(&believing, &knowledge, &prior, &weights, &answer, wrench, (step_s, wall_s), task))
}

#[allow(clippy::too_many_arguments, reason = "all that a planner was asked and answered, for any model")]
fn segment<M, const X: usize, const U: usize, const P: usize>(
    model: &M,
    knowledge: &Knowledge<P>,
    prior: &SMatrix<f64, P, P>,
    weights: &[f64; P],
    answer: &LocalAnswer<M::State, U, P>,
    wrench: impl Fn(&[f64; U]) -> Wrench<f64>,
    (step_s, wall_s): (f64, f64),
    task: &Task<'_>,
) -> Segment
where
    M: InformativeModel<X, U, P>,
{
    let local = task.local;
    let central = central(local.belief.parameters());
    let motion = |state: &M::State| {
        let mut motion = model.kinematics(state);
        motion.world_from_body.translation.vector.z += height_m(task);
        motion
    };
    let trajectory = answer.plan.as_ref().map(|plan| &plan.trajectory);
    let nodes = trajectory.map_or(0, |trajectory| trajectory.states.len());
    let quantity = |index: usize| Quantity {
        name: knowledge.names[index],
        unit: knowledge.units[index],
        believed: local.unknowns.places().get(index).map(|place| central[*place]),
        weight: weights[index],
        prior_sigma: f64::sqrt(prior[(index, index)].max(0.0)),
        sigmas: (0..nodes).filter_map(|node| Some(trajectory?.sigma(node)?[index])).collect(),
    };
    Segment {
        status: answer.status,
        cost: answer.cost,
        optimality: answer.optimality,
        violation: answer.violation,
        iterations: answer.iterations,
        units: answer.units,
        wall_s,
        step_s,
        model_revision: answer.plan.as_ref().map(|plan| plan.model_revision),
        motion: trajectory.iter().flat_map(|found| &found.states).map(motion).collect(),
        inputs: trajectory.iter().flat_map(|found| &found.inputs).map(wrench).collect(),
        quantities: (0..P).map(quantity).collect(),
        unobservable: answer.unobservable.iter().map(|(direction, left)| (direction.to_vec(), *left)).collect(),
    }
}

/// # Errors
/// [`PlanningError::NotPositive`] where nothing is known of a direction.
fn prior_covariance<const P: usize>(knowledge: &Knowledge<P>) -> Result<SMatrix<f64, P, P>, PlanningError> {
    let factor = knowledge.information.cholesky();
    let factor =
        factor.ok_or(PlanningError::NotPositive { what: "an eigenvalue of the prior information", value: 0.0 })?;
    let covariance = knowledge.quantities * factor.inverse() * knowledge.quantities.transpose();
    Ok((covariance + covariance.transpose()) * 0.5)
}

/// Mass, centre of mass and inertia about it, in the order of [`InertialParameters::to_vector`].
fn central(body: &InertialParameters<f64>) -> SVector<f64, PARAMETERS> {
    InertialParameters {
        mass: body.mass,
        first_moment: body.center_of_mass(),
        inertia_about_origin: body.inertia_about_com(),
    }
    .to_vector()
}

/// The size against which a deviation of a quantity is large or small.
fn size(body: &InertialParameters<f64>, place: usize) -> f64 {
    let inertia = body.inertia_about_com();
    let moments = |row: usize, column: usize| f64::sqrt(inertia[(row, row)] * inertia[(column, column)]);
    match place {
        0 => body.mass,
        // The radius of gyration.
        1..=3 => f64::sqrt(0.5 * inertia.trace() / body.mass),
        4 => moments(0, 0),
        5 => moments(0, 1),
        6 => moments(0, 2),
        7 => moments(1, 1),
        8 => moments(1, 2),
        _ => moments(2, 2),
    }
}

/// Weight of the variance of each quantity.
fn weights<const P: usize>(task: &Task<'_>, prior: &SMatrix<f64, P, P>) -> Result<[f64; P], PlanningError> {
    let local = task.local;
    let body = local.belief.parameters();
    let places = local.unknowns.places();
    // Nuisances have no weight.
    let written =
        |values: &Option<Vec<f64>>, index: usize| values.as_ref().and_then(|values| values.get(index).copied());
    let mut base = [0.0; P];
    let mut target_variances = [1.0; P];
    for (index, place) in places.iter().copied().enumerate() {
        let counts = match local.weighting {
            WeightingName::Mass => place == 0,
            WeightingName::Inertia => [4, 7, 9].contains(&place),
            WeightingName::None => false,
            _ => true,
        };
        let size = size(body, place);
        let weight = written(&local.weights, index).unwrap_or(RELATIVE_WEIGHT / (size * size));
        let [mass, com, inertia] = TARGET_SIGMAS;
        let target = match place {
            0 => mass,
            1..=3 => com,
            _ => inertia,
        };
        let target = written(&local.target_sigmas, index).unwrap_or(target);
        (base[index], target_variances[index]) = (if counts { weight } else { 0.0 }, target * target);
    }
    let context = WeightingContext::try_new(*prior, *prior, local.elapsed_share * task.mission_s, task.mission_s)?;
    match local.weighting {
        WeightingName::Covariance => {
            let [alpha, beta] = COVARIANCE_WEIGHTING;
            CovarianceWeighting::try_new(base, target_variances, alpha, beta)?.weights(&context)
        }
        WeightingName::Step => StepWeighting::try_new(base, STEP_WEIGHTING.to_vec())?.weights(&context),
        WeightingName::Exponential => {
            let [rate, least] = EXPONENTIAL_WEIGHTING;
            ExponentialWeighting::try_new(base, rate, least)?.weights(&context)
        }
        WeightingName::Belief => belief_weights(task, places),
        WeightingName::Fixed | WeightingName::Mass | WeightingName::Inertia | WeightingName::None => {
            FixedWeighting::try_new(base)?.weights(&context)
        }
    }
}

/// What errors of the quantities are expected to cost on the way that is left after the segment, tracked by a critically damped
/// feedback.
fn belief_weights<const P: usize>(task: &Task<'_>, places: &[usize]) -> Result<[f64; P], PlanningError> {
    let local = task.local;
    let body = local.belief.parameters();
    let all = body_by_mass_center_and_inertia(body);
    let mut by_quantity = SMatrix::<f64, PARAMETERS, P>::zeros();
    for (index, place) in places.iter().enumerate() {
        by_quantity.set_column(index, &all.column(*place));
    }
    let [rotation, position] = local.tracker_rad_s;
    let tracker = PoseTracker::critically_damped(FreeFlyer::new(*body), rotation, position);
    let [p, v, a, w] = local.tracking;
    let tracking = [p, p, p, v, v, v, a, a, a, w, w, w];
    let mission = TrackedMotion::try_new(rest_of_the_way(task), local.step_s, (&tracker).into(), tracking)?;
    let loss = mission.loss(body, &by_quantity, 0)?;
    Ok(loss.weights())
}

/// The middle of each step of the way after the horizon.
fn rest_of_the_way(task: &Task<'_>) -> Vec<PoseReference> {
    let (local, way) = (task.local, task.way);
    let from_s = local.horizon_s();
    let steps = ((way.duration_s() - from_s) / local.step_s).max(0.0).ceil();
    // Way and step are both bounded by the scenario.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "not negative; saturates")]
    let steps = steps as usize;
    let reference = |step: usize| {
        let (arc, within_s) = way.at(from_s + local.step_s * (step as f64 + 0.5))?;
        let (state, acceleration_world) = arc.translation(within_s);
        let pose = arc.pose(within_s);
        let (_, rate, rate_change) = arc.turn(within_s);
        let into_body = pose.rotation.inverse();
        let twist_body = Twist::new(arc.axis_body.into_inner() * rate, into_body * state.velocity);
        let acceleration = BodyAcceleration {
            angular_acceleration_body: arc.axis_body.into_inner() * rate_change,
            acceleration_origin_body: into_body * acceleration_world,
        };
        Some(PoseReference { state: RigidBodyState { world_from_body: pose, twist_body }, acceleration })
    };
    (0..steps).filter_map(reference).collect()
}
