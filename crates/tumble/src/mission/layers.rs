//! The layers of a mission, built from its problem.

use super::weighting::WeightingChoice;
use crate::scenario::{ComputingSettings, MissionProblem, UnknownsName};
use tumble_astrobee::control_presets::{self, ControlLimits};
use tumble_astrobee::planning_presets::{EXPONENTIAL_WEIGHTING, STEP_WEIGHTING};
use tumble_astrobee::simulator::CONTROL_PERIOD_S;
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::nalgebra::{UnitQuaternion, Vector3, Vector6};
use tumble_dynamics::{AlignedBox, InertialParameters, RigidBodyState, World};
use tumble_identification::recursive::{
    FlightEstimator, FlightEstimatorSettings, GaussMarkov, LearningTargets, WrenchErrors,
};
use tumble_lie::LieGroup;
use tumble_planning::collision::{BodyShape, EllipsoidWorld, MovingObstacle};
use tumble_planning::control::{
    AttitudeController, AttitudeGains, AttitudeLaw, AttitudeSpan, AxisSensing, Corrections, TrackedPoint,
    TubeController, TubeDisturbance, TubeSettings,
};
use tumble_planning::local::{
    CovarianceWeighting, ExponentialWeighting, FixedWeighting, Hull, InformationWeighting, PlanarBodyModel,
    RigidBodyModel, SpeedLimits, StepWeighting, Surroundings, WrenchSet,
};
use tumble_planning::mission::{
    AtGoal, BrakeLimits, ChosenModel, ComputingTime, ExpectedLoss, LoopSettings, Scene, Schedule, StretchPlanner,
    StretchSettings,
};
use tumble_planning::{ModelBelief, PlanningError};

/// Deviations of an estimate's corrections, and of its errors, that a tube is built for: of a mission of four hundred decisions along three axes one in
/// five hundred sees more.
const NOISE_SIGMAS: f64 = 4.8;
/// Standard deviations of `1 / m` that are certain: a few dozen beliefs are nested in a mission, and all are to hold.
const MASS_SIGMAS: f64 = 4.5;
/// Shares of what the feedback may ask for against these, and forces from outside, that plans leave it, the first that leaves enough of the force to them,
/// and what is enough.
const RESERVED: [f64; 4] = [0.5, 0.3, 0.15, 0.05];
const LEAST_SHARE: f64 = 0.2;
/// Slow errors of the believed wrench beside those of its nozzles, N m and N: drag, and what of servos and impellers is not in the thrust that is
/// believed.
const DRIFT: [f64; 2] = [1.5e-5, 2e-4];
/// So many times that of a wrench in doubt: 5 mN m and 70 mN, half a nozzle.
const DOUBTED: f64 = 350.0;
/// Largest force from outside along an axis, N: drag, and nozzles that are not as on paper.
const FORCE_FROM_OUTSIDE_N: f64 = 0.004;
/// Farthest that a stretch's attitude leaves those between start and goal, rad.
const WANDERS_RAD: f64 = 0.35;
/// Relative change of the mass that asks for another way.
const MATERIAL: f64 = 0.15;
/// A stretch may be so much faster than the way, to leave it and come back.
const FASTER: f64 = 1.15;
/// Natural frequencies of rotation and position of what follows a way, for what deviations from it cost, rad/s.
pub(super) const TRACKER_RAD_S: [f64; 2] = [0.6, 0.5];
/// Largest moment of inertia and mass that the usual weights of a stretch and gains of the attitude are for, kg m^2 and kg.
const LARGEST_USUAL: [f64; 2] = [2.0, 60.0];
/// Moment of inertia whose usual gains a larger body has in proportion, kg m^2.
const OF_GAINS_KG_M2: f64 = 0.2;
/// Share of the rate limit that plans use.
const RATE_SHARE: f64 = 0.6;

/// Whole nanoseconds.
fn nanoseconds(time_s: f64) -> i64 {
    crate::flight_log::nanoseconds(time_s)
}

/// What is around the robot, as far as it knows at a time; `extra` are obstacles that no scenario has.
///
/// # Errors
/// Those of the planner: a world that cannot be.
pub fn scene(
    problem: &MissionProblem,
    time_s: f64,
    extra: &[MovingObstacle],
) -> Result<Scene<EllipsoidWorld>, PlanningError> {
    let planning = &problem.planning;
    let is_seen = |index: &usize| problem.seen_from_s.get(*index).is_none_or(|from_s| *from_s <= time_s);
    let motion_of = |index: usize| planning.obstacle_motions.iter().find(|motion| motion.obstacle == index);
    let (mut still, mut moving) = (Vec::new(), Vec::new());
    for (index, obstacle) in planning.world.obstacles.iter().enumerate().filter(|(index, _)| is_seen(index)) {
        match motion_of(index) {
            None => still.push(*obstacle),
            Some(motion) => moving.push(
                MovingObstacle::at_rest(*obstacle)
                    .drifting(motion.velocity_world, 0.0)
                    .present(motion.appear_s, motion.vanish_s),
            ),
        }
    }
    moving.extend_from_slice(extra);
    let world = World { obstacles: still, ..planning.world.clone() };
    let collision = EllipsoidWorld::new(&world)?.with_obstacles(moving.iter().copied())?;
    Ok(Scene { world: collision, surroundings: surroundings(problem, world, moving)? })
}

/// The same for stretches: the keep-in boxes cut to where the body origin may be.
fn surroundings(
    problem: &MissionProblem,
    mut world: World,
    moving: Vec<MovingObstacle>,
) -> Result<Surroundings, PlanningError> {
    let planning = &problem.planning;
    let reach = Vector3::repeat(planning.body.bounding_radius_m() + problem.margins_m.way);
    let position = &planning.limits.position;
    let mut allowed =
        AlignedBox { lower_world: position.lower_world - reach, upper_world: position.upper_world + reach };
    if problem.planar {
        (allowed.lower_world.z, allowed.upper_world.z) = (f64::NEG_INFINITY, f64::INFINITY);
    }
    let rooms = if world.keep_in.is_empty() { vec![allowed] } else { world.keep_in };
    let cut = rooms.iter().map(|room| AlignedBox {
        lower_world: room.lower_world.sup(&allowed.lower_world),
        upper_world: room.upper_world.inf(&allowed.upper_world),
    });
    world.keep_in = cut.filter(|room| (room.upper_world - room.lower_world).min() > 0.0).collect();
    Surroundings::of_world(&world, Hull::Shape(planning.body.clone()))?.with_moving(moving)
}

/// Steps of a stretch.
fn steps(problem: &MissionProblem) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a length that was checked
    let steps = libm::round(problem.stretch_s / problem.step_s) as usize;
    steps.max(1)
}

/// What moves the measured position, velocity, attitude and rate beside the body and its inputs: variance per second.
///
/// * A wander of deviation s and time T is a random walk of 2 s^2/T as long as the time looked at is short.
/// * A velocity also changes by what nobody knows of the force, a rate by what nobody knows of the torque. What lasts of either counts as
///   much as white noise that is as large at the frequency at which stretches excite, twice in their length.
/// * An accelerometer sees a change of velocity whether or not the localisation does: their two answers are one of less variance, and
///   what pushes the body is in both.
fn wander_per_s(problem: &MissionProblem) -> [f64; 4] {
    let FlightEstimatorSettings { noise, wrench, slow, .. } = estimator_settings(problem);
    let body = &problem.prior.parameters;
    let walk = |error: &GaussMarkov| 2.0 * error.sigma * error.sigma / error.time_s;
    let excited_rad_s = 2.0 * core::f64::consts::TAU / problem.stretch_s;
    let unknown = |white: f64, drift: f64| {
        let lasting = 2.0 * drift * drift / wrench.drift_time_s / (excited_rad_s * excited_rad_s);
        white * white * wrench.period_s + lasting
    };
    let inertia = body.inertia_about_com().diagonal().min();
    let pushed = unknown(noise.force_n, wrench.drift[3]) / (body.mass * body.mass);
    let turned = unknown(noise.torque_n_m, wrench.drift[0]) / (inertia * inertia);
    let localised = walk(&slow.velocity) + pushed;
    let accelerated = noise.acceleration_m_s2 * noise.acceleration_m_s2 * CONTROL_PERIOD_S + pushed;
    let velocity = if localised > 0.0 { localised * accelerated / (localised + accelerated) } else { 0.0 };
    [walk(&slow.position), velocity, walk(&slow.attitude), turned + slow.rate_bias_walk * slow.rate_bias_walk]
}

/// Mean moment of inertia about the centre of mass, kg m^2.
fn moment(body: &InertialParameters<f64>) -> f64 {
    body.inertia_about_com().trace() / 3.0
}

/// Gains of the attitude for a body as believed.
pub(super) fn attitude_gains(place: WorldPreset, body: &InertialParameters<f64>) -> AttitudeGains {
    let usual = control_presets::rattle_attitude_gains(place);
    let times = if moment(body) > LARGEST_USUAL[0] { moment(body) / OF_GAINS_KG_M2 } else { 1.0 };
    AttitudeGains { stiffness_n_m: times * usual.stiffness_n_m, damping_n_m_s: times * usual.damping_n_m_s }
}

/// Weights of squared torque and force: what a body of the size that [`StretchSettings`] are for is accelerated by costs the same of a larger one.
fn effort(body: &InertialParameters<f64>) -> [f64; 2] {
    let size = [moment(body), body.mass];
    [0, 1].map(|k| (LARGEST_USUAL[k] / size[k]).min(1.0).powi(2))
}

/// The planner of stretches.
///
/// # Errors
/// Settings that are none.
pub fn stretch_planner(
    problem: &MissionProblem,
    choice: WeightingChoice,
) -> Result<Box<dyn StretchPlanner>, PlanningError> {
    let usual = StretchSettings::default();
    let motion = &problem.planned_motion;
    let most_rad_s = f64::min(RATE_SHARE * problem.rate_limit_rad_s, motion.rate_of_an_axis_rad_s(problem.planar));
    let rate_rad_s = usual.speed.rate_rad_s.map(|usual| usual.min(most_rad_s));
    let settings = StretchSettings {
        steps: steps(problem),
        step_s: problem.step_s,
        speed: SpeedLimits { speed_m_s: problem.planning.limits.speed_m_s * FASTER, rate_rad_s },
        measurement_sigma: [
            problem.noise.position_m,
            problem.noise.velocity_m_s,
            problem.noise.attitude_rad,
            problem.noise.rate_rad_s,
        ],
        samples_per_step: problem.step_s / CONTROL_PERIOD_S,
        wander_per_s: wander_per_s(problem),
        thrusters: problem.thrusters,
        rate_axes: problem.slow.rate_axes,
        margin_m: problem.margins_m.stretch,
        effort: effort(&problem.prior.parameters),
        ..usual
    };
    let torque = problem.torque_limit_n_m * problem.plan_torque_share;
    let most_n = motion.force_of_an_axis_n(problem.prior.parameters.mass, problem.planar);
    let force = problem.force_limit_n.map(|limit| f64::min(limit * problem.plan_force_share, most_n));
    let in_space =
        || WrenchSet { limit: [torque.x, torque.y, torque.z, force.x, force.y, force.z], half_spaces: Vec::new() };
    let height_m = problem.planning.start.position.z;
    let on_table = || WrenchSet { limit: [torque.z, force.x, force.y], half_spaces: Vec::new() };
    Ok(match problem.unknowns {
        UnknownsName::Principal => {
            boxed(RigidBodyModel::principal(), &settings, in_space(), problem, choice, &[1, 2, 3])?
        }
        UnknownsName::Full => {
            boxed(RigidBodyModel::full(), &settings, in_space(), problem, choice, &[4, 5, 6, 7, 8, 9])?
        }
        UnknownsName::Planar => {
            let model = PlanarBodyModel::mass_and_inertia().at_height(height_m);
            boxed(model, &settings, on_table(), problem, choice, &[1])?
        }
        UnknownsName::PlanarCom => {
            let model = PlanarBodyModel::full().at_height(height_m);
            boxed(model, &settings, on_table(), problem, choice, &[1])?
        }
    })
}

/// A planner of stretches for a model, `inertia` the places of the moments of inertia among its quantities.
fn boxed<M, const X: usize, const U: usize, const P: usize>(
    model: M,
    settings: &StretchSettings,
    wrench: WrenchSet<U>,
    problem: &MissionProblem,
    choice: WeightingChoice,
    inertia: &[usize],
) -> Result<Box<dyn StretchPlanner>, PlanningError>
where
    M: ChosenModel<X, U, P>,
{
    let places = problem.unknowns.places();
    let expected_loss = (choice == WeightingChoice::Belief).then(|| ExpectedLoss {
        tracker_rad_s: TRACKER_RAD_S,
        tracking: settings.tracking,
        places: std::array::from_fn(|index| places.get(index).copied().unwrap_or(usize::MAX)),
    });
    model.stretch_planner(settings, wrench, weighting::<P>(problem, choice, inertia)?, expected_loss)
}

fn weighting<const P: usize>(
    problem: &MissionProblem,
    choice: WeightingChoice,
    inertia: &[usize],
) -> Result<Box<dyn InformationWeighting<P>>, PlanningError> {
    let each = |values: &[f64]| std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0));
    let base: [f64; P] = each(&problem.weighting.gamma0);
    let only = |kept: &[usize]| std::array::from_fn(|i| if kept.contains(&i) { base[i] } else { 0.0 });
    Ok(match choice {
        WeightingChoice::Covariance => Box::new(CovarianceWeighting::try_new(
            base,
            each(&problem.weighting.target_variance),
            problem.weighting.alpha,
            problem.weighting.beta,
        )?),
        WeightingChoice::Step => Box::new(StepWeighting::try_new(base, STEP_WEIGHTING.to_vec())?),
        WeightingChoice::Exponential => {
            let [rate, least] = EXPONENTIAL_WEIGHTING;
            Box::new(ExponentialWeighting::try_new(base, rate, least)?)
        }
        WeightingChoice::Fixed => Box::new(FixedWeighting::try_new(base)?),
        WeightingChoice::Mass => Box::new(FixedWeighting::try_new(only(&[0]))?),
        WeightingChoice::Inertia => Box::new(FixedWeighting::try_new(only(inertia))?),
        // by expected loss nothing of this is asked
        WeightingChoice::Belief | WeightingChoice::None => Box::new(FixedWeighting::try_new([0.0; P])?),
    })
}

/// What makes the tube controller: at first, and anew when the body may be anything.
pub fn tube_controllers(
    problem: &MissionProblem,
) -> impl FnMut(&ModelBelief) -> Result<TubeController, PlanningError> + Send + use<> {
    let limits = ControlLimits { force_n: problem.force_limit_n, torque_n_m: problem.torque_limit_n_m.min() };
    let share = problem.mass_interval_share;
    let place = problem.place;
    let first = problem.planning.attitude;
    let last = problem.planning.goal.attitude.unwrap_or(first);
    let turn: Vector3<f64> = LieGroup::log(&(first.inverse() * last));
    let middle: UnitQuaternion<f64> = LieGroup::exp(&(turn * 0.5));
    let near = AttitudeSpan::Near {
        axes_from_body: first * middle,
        angle_rad: 0.5 * f64::sqrt(turn.norm_squared()) + WANDERS_RAD,
    };
    let left = |span: &AttitudeSpan| span.inner_box(&limits.force_n).min();
    let attitudes = if left(&near) > left(&AttitudeSpan::Any) { near } else { AttitudeSpan::Any };
    let told = estimator_settings(problem);
    let speed_m_s = problem.planning.limits.speed_m_s.max();
    move |belief: &ModelBelief| {
        let body = belief.parameters();
        let attitude = AttitudeController {
            law: AttitudeLaw::Geometric,
            gains: attitude_gains(place, body),
            body: *body,
            torque_limit_n_m: limits.torque_n_m,
        };
        let mass = control_presets::mass_interval(body.mass, share)?;
        let tube = TubeSettings { sigmas: MASS_SIGMAS, ..control_presets::tube_settings(mass, &limits, attitudes) };
        let noise = axis_sensing(&told, mass.least_kg()).filtered(tube.gain.step_s)?;
        let [position_m, velocity_m_s] = [noise.error.m11, noise.error.m22].map(|of| NOISE_SIGMAS * f64::sqrt(of));
        let of = |reserved: f64| {
            let settings = TubeSettings {
                // what the estimate moves by of itself is no speed of the robot
                speed_m_s: 2.0 * (speed_m_s + velocity_m_s),
                corrections: Some(Corrections { covariance: noise.corrections, sigmas: NOISE_SIGMAS, reserved }),
                disturbance: TubeDisturbance {
                    position_m,
                    velocity_m_s,
                    force_n: FORCE_FROM_OUTSIDE_N,
                    acceleration_m_s2: 0.0,
                },
                point: TrackedPoint::BelievedCenterOfMass,
                ..tube
            };
            TubeController::try_new(settings, None, attitude, body)
        };
        let leaves_enough = |tube: &Result<TubeController, PlanningError>| {
            let problem = tube.as_ref().ok().map(|controller| controller.tube().problem(0));
            problem.is_some_and(|axis| axis.acceleration_m_s2 >= LEAST_SHARE * axis.force_n / axis.center_kg)
        };
        // where they would take next to all the force the feedback gets less than it asks for more often
        RESERVED.into_iter().map(of).find(leaves_enough).unwrap_or_else(|| of(0.0))
    }
}

/// An axis of the localisation, and what pushes a body of this mass that is not commanded.
fn axis_sensing(told: &FlightEstimatorSettings, mass_kg: f64) -> AxisSensing {
    let FlightEstimatorSettings { noise, wrench, slow, .. } = told;
    let [age_ns, ..] = slow.age_ns;
    let white_m_s2 = noise.force_n / mass_kg;
    AxisSensing {
        period_s: CONTROL_PERIOD_S,
        age_s: age_ns as f64 * 1e-9,
        white: [noise.position_m, noise.velocity_m_s],
        position_wander: slow.position,
        velocity_wander: slow.velocity,
        white_m2_s3: white_m_s2 * white_m_s2 * wrench.period_s,
        drift: GaussMarkov { sigma: wrench.drift[3] / mass_kg, time_s: wrench.drift_time_s },
    }
}

/// What estimators in flight are told of sensors and thrust.
pub(super) fn estimator_settings(problem: &MissionProblem) -> FlightEstimatorSettings {
    let usual = FlightEstimatorSettings::new(problem.noise);
    let [torque, force] = DRIFT;
    let drift = Vector6::new(torque, torque, torque, force, force, force);
    let wrench = WrenchErrors { drift, thrusters: problem.thrusters, doubted: DOUBTED, ..usual.wrench };
    FlightEstimatorSettings { planar: problem.planar, slow: problem.slow, wrench, ..usual }
}

/// The estimator, at the start.
///
/// # Errors
/// Noise that is none, a prior that is none.
pub fn estimator(problem: &MissionProblem) -> Result<FlightEstimator, PlanningError> {
    let state: RigidBodyState<f64> = *problem.flight.simulator.state();
    Ok(FlightEstimator::try_new(
        estimator_settings(problem),
        state,
        problem.flight.simulator.time_ns(),
        &problem.prior,
    )?)
}

/// What a planner may take beyond all that it is expected to, ns.
fn patience_ns(computing: &ComputingSettings) -> i64 {
    let way_ns = computing.global_units.saturating_mul(computing.global_unit_ns);
    let stretch_ns = computing.local_units.saturating_mul(computing.local_unit_ns);
    let longest_ns = i64::try_from(way_ns.max(stretch_ns)).unwrap_or(i64::MAX);
    longest_ns.saturating_mul(4).max(Schedule::default().patience_ns)
}

/// What the closed loop is told.
pub fn loop_settings(problem: &MissionProblem, feedback: bool, seed: u64) -> LoopSettings<BodyShape> {
    let computing = &problem.computing;
    let stretches = problem.station_keeping().then_some(problem.station_stretches);
    LoopSettings {
        schedule: Schedule {
            way_lead_ns: nanoseconds(problem.way_lead_s),
            stretch_lead_ns: nanoseconds(problem.stretch_lead_s),
            dwell_ns: nanoseconds(problem.arrival.for_s),
            longest_ns: nanoseconds(problem.longest_s),
            patience_ns: patience_ns(computing),
            stretches,
            ..Schedule::default()
        },
        decision_periods: u64::from(control_presets::OUTPUTS_PER_DECISION),
        belief_period_ns: nanoseconds(problem.belief_period_s),
        feedback,
        at_goal: AtGoal {
            distance_m: problem.arrival.position_m,
            angle_rad: problem.arrival.attitude_rad,
            speed_m_s: problem.arrival.speed_m_s,
            rate_rad_s: problem.arrival.rate_rad_s,
        },
        margin_m: problem.margins_m.way,
        check_margin_m: problem.margins_m.checked,
        way_units: computing.global_units,
        new_way_units: computing.replan_units,
        stretch_units: computing.local_units,
        known: stretches.map(|_| LearningTargets {
            mass: 0.01,
            center_of_mass_m: 0.003,
            inertia: 0.03,
            planar: problem.planar,
        }),
        environment: problem.environment.clone(),
        material_change: MATERIAL,
        seed,
        ..LoopSettings::new(
            problem.planning.body.clone(),
            problem.planning.goal,
            problem.planning.limits,
            problem.stop,
            BrakeLimits { force_n: problem.force_limit_n, torque_n_m: problem.torque_limit_n_m.min() },
        )
    }
}

/// How long planners take.
pub fn computing_time(problem: &MissionProblem) -> ComputingTime {
    let signed = |value: u64| i64::try_from(value).unwrap_or(i64::MAX);
    ComputingTime {
        way_unit_ns: signed(problem.computing.global_unit_ns),
        stretch_unit_ns: signed(problem.computing.local_unit_ns),
        jitter: problem.computing.jitter_share,
    }
}
