//! A mission, flown.

use super::assembly::{AstrobeeLoop, MissionPlanners, closed_loop};
use super::doubts::DoubtWatch;
use super::faults::{Faults, LateObstacle, Sabotage};
use super::hooks::{FlownPeriod, MissionHooks};
use super::invariants;
use super::layers::{estimator_settings, scene};
use super::options::FlyOptions;
use super::record::{
    BROKEN_INVARIANT, BeliefRow, DrawnBox, DrawnEllipsoid, DrawnPayload, FallbackRow, MissionEvent, MissionRecord,
    MissionSummary, NO_MOTION, PROMISED, ParameterRow, Promises, Series, StretchRow, TrackingRms, UNAVOIDABLE, WayRow,
};
use crate::TumbleError;
use crate::scenario::{Margins, MissionProblem, ScenarioSource};
use std::collections::BTreeMap;
use tumble_astrobee::sensing::LocalizationEstimate;
use tumble_astrobee::simulator::{
    CONTROL_PERIOD_NS, CONTROL_PERIOD_S, ControlAccount, FallbackSpell, SimulatorMeasurement,
};
use tumble_dynamics::nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_dynamics::{AlignedBox, InertialParameters, ObstacleEllipsoid, World, WrenchBox};
use tumble_identification::estimator::{Acted, Gauss, Measurement, StateEstimator};
use tumble_identification::recursive::MotionNoise;
use tumble_identification::{BodyScale, Estimate};
use tumble_lie::{LieGroup, Pose, Wrench};
use tumble_planning::collision::{CollisionWorld, EllipsoidWorld, MovingObstacle};
use tumble_planning::control::ControlCommand;
use tumble_planning::global::GlobalAnswer;
use tumble_planning::mission::{
    Action, Asked, End, Event, Found, InvariantWatch, Layer, LoopObserver, Office, PlanAnswer, PlanRequest,
    PlannerFault, StretchAnswer, TimedEvent,
};
use tumble_planning::{ModelBelief, PlanningError};

/// Control periods between two rows of the series.
const BETWEEN_ROWS: u64 = 12;
/// Points of a way, and edges of a tree, that are kept for pictures.
const WAY_POINTS: u32 = 200;
const TREE_EDGES: usize = 2000;
/// Time between two points of a stretch, s.
const STRETCH_POINT_S: f64 = 0.6;
/// Radius of an obstacle that shows up late, m.
const LATE_RADIUS_M: f64 = 0.15;
/// The ten parameters, and their units.
pub(super) const PARAMETERS: [(&str, &str); 10] = [
    ("mass", "kg"),
    ("com_x", "m"),
    ("com_y", "m"),
    ("com_z", "m"),
    ("inertia_xx", "kg m^2"),
    ("inertia_yy", "kg m^2"),
    ("inertia_zz", "kg m^2"),
    ("inertia_xy", "kg m^2"),
    ("inertia_xz", "kg m^2"),
    ("inertia_yz", "kg m^2"),
];

/// Mass, centre of mass, inertia about it: xx, yy, zz, xy, xz, yz.
fn ten(body: &InertialParameters<f64>) -> [f64; 10] {
    let (com, inertia) = (body.center_of_mass(), body.inertia_about_com());
    [
        body.mass,
        com.x,
        com.y,
        com.z,
        inertia[(0, 0)],
        inertia[(1, 1)],
        inertia[(2, 2)],
        inertia[(0, 1)],
        inertia[(0, 2)],
        inertia[(1, 2)],
    ]
}

impl MissionSummary {
    /// The body that flew, as it was in the end; on a table the part of it that moves in the plane.
    pub fn body_at_end(&self) -> InertialParameters<f64> {
        let truth = |name: &str| self.parameters.iter().find(|row| row.name == name).map_or(0.0, |row| row.truth);
        let [mass, x, y, z, xx, yy, zz, xy, xz, yz] = PARAMETERS.map(|(name, _)| truth(name));
        InertialParameters::about_com(mass, Vector3::new(x, y, z), Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz))
    }
}

fn ten_sigma(estimate: &Estimate) -> [f64; 10] {
    let (com, inertia) = (estimate.std.center_of_mass_m, estimate.std.inertia_about_com_kg_m2);
    [
        estimate.std.mass_kg,
        com.x,
        com.y,
        com.z,
        inertia[(0, 0)],
        inertia[(1, 1)],
        inertia[(2, 2)],
        inertia[(0, 1)],
        inertia[(0, 2)],
        inertia[(1, 2)],
    ]
}

/// A planner's quantity by its name among [`PARAMETERS`].
fn parameter_name(quantity: &str) -> String {
    match quantity.strip_prefix("center_of_mass_") {
        Some(axis) => format!("com_{axis}"),
        None => quantity.to_owned(),
    }
}

fn seconds(time_ns: i64) -> f64 {
    time_ns as f64 * 1e-9
}

fn array(vector: &Vector3<f64>) -> [f64; 3] {
    (*vector).into()
}

fn xyzw(rotation: &UnitQuaternion<f64>) -> [f64; 4] {
    [rotation.i, rotation.j, rotation.k, rotation.w]
}

/// Writes down what the loop says.
struct Notes<'a> {
    hooks: &'a mut dyn MissionHooks,
    ways: Vec<WayRow>,
    stretches: Vec<StretchRow>,
    beliefs: Vec<BeliefRow>,
    events: Vec<MissionEvent>,
    /// Requests of this control period, and how many events had happened when each was made.
    asked: Vec<(u64, usize)>,
    shut_off: BTreeMap<String, Option<f64>>,
    faults: Faults,
    doubts: DoubtWatch,
    too_late: Option<TooLate>,
    /// The obstacle of a fault, as it is drawn.
    showed_up: Option<DrawnEllipsoid>,
    /// The first stretch that was flown after its time.
    expired: Option<String>,
}

impl Notes<'_> {
    fn note(&mut self, time_ns: i64, kind: &str, text: String) {
        self.events.push(MissionEvent { t_s: seconds(time_ns), kind: kind.to_owned(), text });
    }

    /// What a planner says stands where it was asked, among what happened in the same control period.
    fn note_answer(&mut self, time_ns: i64, request: u64, kind: &str, text: String) {
        let asked = self.asked.iter().position(|(of, _)| *of == request);
        let place = asked.map_or(self.events.len(), |index| self.asked.swap_remove(index).1);
        self.events.insert(place, MissionEvent { t_s: seconds(time_ns), kind: kind.to_owned(), text });
        for (_, later) in self.asked.iter_mut().filter(|(_, later)| *later >= place) {
            *later += 1;
        }
    }

    /// Has a request planned, looks at the answer, and sends it on its way.
    fn plan(&mut self, time_ns: i64, planners: &mut MissionPlanners, request: &PlanRequest<EllipsoidWorld>) {
        if let Some(layer) = request.layer() {
            self.hooks.begins(layer);
        }
        let answer: PlanAnswer = planners.serve(request);
        if let Some(layer) = request.layer() {
            self.hooks.ends(layer);
        }
        match &answer.found {
            Found::Way(answer) => self.planned_way(time_ns, request.request, answer),
            Found::Retreat(answer, path, _) => {
                let text = format!(
                    "no way was found: {}; {:.1} s to where more room is left",
                    answer.status,
                    path.duration_s()
                );
                self.note_answer(time_ns, request.request, "way", text);
            }
            Found::Failed { error, .. } => {
                let text = format!("request {} cannot be planned: {error}", request.request);
                self.note_answer(time_ns, request.request, "planner", text);
            }
            _ => {}
        }
        let fault = match request.asked {
            Asked::Stay => PlannerFault::None,
            _ => self.faults.planner(request.request).into(),
        };
        planners.post(time_ns, request, answer, fault);
    }

    fn planned_way(&mut self, time_ns: i64, request: u64, answer: &GlobalAnswer) {
        let Some(plan) = &answer.plan else {
            self.note_answer(time_ns, request, "way", format!("no way was found: {}", answer.status));
            return;
        };
        let path = &plan.trajectory;
        let duration_s = path.duration_s();
        let point = |k: u32| {
            let at = path.at(duration_s * f64::from(k) / f64::from(WAY_POINTS));
            at.map(|(arc, within_s)| array(&arc.pose(within_s).translation.vector))
        };
        let every = answer.tree.len() / TREE_EDGES + 1;
        let edge = |edge: &[Vector3<f64>; 2]| [array(&edge[0]), array(&edge[1])];
        self.ways.push(WayRow {
            t_s: seconds(time_ns),
            model_revision: plan.model_revision,
            points_m: (0..=WAY_POINTS).filter_map(point).collect(),
            tree_m: answer.tree.iter().step_by(every).map(edge).collect(),
        });
        self.note_answer(
            time_ns,
            request,
            "way",
            format!("a way of {duration_s:.1} s, belief {}", plan.model_revision),
        );
    }
}

impl LoopObserver for Notes<'_> {
    fn begins(&mut self, layer: Layer) {
        self.hooks.begins(layer);
    }

    fn ends(&mut self, layer: Layer) {
        self.hooks.ends(layer);
    }

    fn heard(&mut self, event: &TimedEvent) {
        self.hooks.heard(event);
        self.doubts.heard(seconds(event.time_ns), &event.event);
        let said = match event.event {
            Event::World { contact_ns, .. } => match contact_ns {
                Some(at_ns) => format!("the world changed; contact ahead at {:.1} s", seconds(at_ns)),
                None => "the world changed; nothing in the way of what is flown".to_owned(),
            },
            Event::Relocalised => "the localisation moved for good".to_owned(),
            Event::Diverged => "the estimator contradicts its measurements".to_owned(),
            Event::BodyDoubtful => "the body is another than it was".to_owned(),
            Event::ThrustDoubtful => "thrust explains the motion better than another body".to_owned(),
            Event::Braking => "the controller brakes".to_owned(),
            Event::Restarted => "the computer started anew".to_owned(),
            Event::Known(true) => "the body is known as well as asked for".to_owned(),
            _ => return,
        };
        self.note(event.time_ns, "event", said);
    }

    fn answered(&mut self, time_ns: i64, action: &Action) {
        self.hooks.answered(time_ns, action);
        self.doubts.answered(seconds(time_ns), action);
        if let Action::PlanWay { request, .. } | Action::PlanStretch { request, .. } = action {
            self.asked.push((*request, self.events.len()));
        }
        let (kind, said) = match action {
            Action::Note(note) => ("coordinator", note.to_string()),
            Action::Stop => ("coordinator", "stop".to_owned()),
            Action::Brake => ("coordinator", "brake".to_owned()),
            Action::HoldHere => ("coordinator", "hold where the robot is".to_owned()),
            Action::RenewController => ("coordinator", "a new controller".to_owned()),
            Action::ResetEstimator => ("coordinator", "the estimator begins anew".to_owned()),
            Action::WidenBelief => ("coordinator", "less is believed of the body".to_owned()),
            Action::DoubtWrench => ("coordinator", "less is believed of the thrust".to_owned()),
            Action::Finish { has_arrived: true } => ("coordinator", "arrived".to_owned()),
            Action::Finish { has_arrived: false } => ("coordinator", "given up".to_owned()),
            Action::GiveUp { .. } => ("coordinator", "given up: there is no way".to_owned()),
            Action::Abandon => ("coordinator", "given up: nobody knows how the robot moves".to_owned()),
            _ => return,
        };
        self.note(time_ns, kind, said);
    }

    fn follows(&mut self, time_ns: i64, start_ns: i64, stretch: &StretchAnswer, model_revision: u64) {
        if start_ns < time_ns {
            let (at_s, late_s) = (seconds(time_ns), seconds(time_ns - start_ns));
            self.expired
                .get_or_insert_with(|| format!("{BROKEN_INVARIANT}{at_s:.3} s: a plan {late_s} s old was flown"));
        }
        let information = stretch.sigma.iter().map(|[before, after]| 1.0 / (after * after) - 1.0 / (before * before));
        let quantities: Vec<String> = stretch.quantities.iter().map(|name| parameter_name(name)).collect();
        for (name, weight) in quantities.iter().zip(&stretch.weights) {
            if *weight > 0.0 {
                self.shut_off.insert(name.clone(), None);
            } else if let Some(since) = self.shut_off.get_mut(name) {
                since.get_or_insert(seconds(time_ns));
            }
        }
        self.stretches.push(StretchRow {
            plan_revision: self.stretches.len() as u64 + 1,
            start_s: seconds(start_ns),
            end_s: stretch.motion.end_s(),
            model_revision,
            points_m: stretch.motion.points(STRETCH_POINT_S).iter().map(array).collect(),
            quantities,
            weights: stretch.weights.clone(),
            sigma: stretch.sigma.clone(),
            stated: Vec::new(),
            information: information.collect(),
        });
    }

    fn disbelieved(&mut self, time_ns: i64, error: &PlanningError) {
        self.note(time_ns, "estimator", format!("the last belief is kept: {error}"));
    }

    fn offered(&mut self, time_ns: i64, belief: &ModelBelief) {
        if self.beliefs.last().is_none_or(|last| last.revision < belief.revision) {
            self.beliefs.push(BeliefRow {
                t_s: seconds(time_ns),
                revision: belief.revision,
                used_from_s: None,
                estimate: ten(belief.parameters()),
                sigma: ten_sigma(&belief.estimate),
            });
        }
    }
}

/// What is added up while flying.
struct Sums {
    watch: InvariantWatch,
    series: Series,
    violations: u64,
    beyond_localization: u64,
    impulse_n_s: f64,
    angular_impulse_n_m_s: f64,
    /// Time and squared distance from what is flown.
    squares: Vec<(f64, f64)>,
    min_clearance_m: Option<f64>,
    account: ControlAccount,
}

/// Flies a mission: the same source and options give the same record.
///
/// # Errors
/// Scenarios that are no mission; what stops the simulator; what the hooks refuse.
pub fn fly(
    source: &ScenarioSource,
    options: &FlyOptions,
    hooks: &mut dyn MissionHooks,
) -> Result<MissionRecord, TumbleError> {
    let mut problem = source.mission(options)?;
    let (mut flying, mut planners) = closed_loop(&problem, options)?;
    let limits = WrenchBox { torque_limit: problem.torque_limit_n_m, force_limit: problem.force_limit_n };
    let mut faults = Faults::new(options.fault, options.seed, problem.longest_s).limited_to(limits);
    if problem.planar {
        faults = faults.in_plane();
    }
    let mut late = faults.late_obstacle();
    let mut extra = Vec::new();
    let mut judge = scene(&problem, f64::INFINITY, &[]).map_err(TumbleError::Planning)?.world;
    let mut appearing: Vec<f64> = problem.seen_from_s.iter().copied().filter(|from_s| *from_s > 0.0).collect();
    appearing.sort_by(f64::total_cmp);
    let mut notes = Notes {
        hooks,
        ways: Vec::new(),
        stretches: Vec::new(),
        beliefs: Vec::new(),
        events: Vec::new(),
        asked: Vec::new(),
        shut_off: BTreeMap::new(),
        faults,
        doubts: DoubtWatch::new(
            seconds(problem.flight.simulator.time_ns()),
            estimator_settings(&problem).gate_probability,
        ),
        too_late: None,
        showed_up: None,
        expired: None,
    };
    let mut sums = Sums::watched_by(invariants::watch(&problem));
    sums.series.force_limit_n = array(&problem.force_limit_n);
    sums.series.torque_limit_n_m = array(&problem.torque_limit_n_m);
    let (mut arrived, mut heard) = (Vec::<Measurement>::new(), Vec::new());
    let start_ns = problem.flight.simulator.time_ns();
    let mut acted =
        Acted { from_ns: start_ns, until_ns: start_ns, wrench_body: Wrench::zero(), stored_body: Vector3::zeros() };
    let mut periods = 0;
    while flying.end().is_none() {
        let time_ns = problem.flight.simulator.time_ns();
        let time_s = seconds(time_ns);
        if appearing.first().is_some_and(|from_s| *from_s <= time_s) {
            appearing.retain(|from_s| *from_s > time_s);
            let seen = scene(&problem, time_s, &extra).map_err(TumbleError::Planning)?;
            flying.see(seen).map_err(TumbleError::Planning)?;
        }
        if let Some(obstacle) = late.take_if(|late| late.appears_s <= time_s)
            && let Some(obstacle) = in_the_way(&flying, &problem, &obstacle, time_s)
        {
            notes.too_late = too_late(&problem, &obstacle, time_s);
            notes.showed_up =
                Some(DrawnEllipsoid { seen_s: [time_s, f64::INFINITY], ..drawn_ellipsoid(&obstacle.ellipsoid) });
            extra.push(obstacle);
            judge = scene(&problem, f64::INFINITY, &extra).map_err(TumbleError::Planning)?.world;
            let seen = scene(&problem, time_s, &extra).map_err(TumbleError::Planning)?;
            flying.see(seen).map_err(TumbleError::Planning)?;
        }
        if notes.faults.restart_due(time_ns) {
            flying.restart();
        }
        if let Some(sabotage) = notes.faults.sabotage(time_ns) {
            sabotaged(&mut flying, &sabotage).map_err(TumbleError::Planning)?;
        }
        while let Some(answer) = Office::<EllipsoidWorld>::ready(&mut planners, time_ns) {
            flying.answer(answer);
        }
        let command = flying.step(&acted, &arrived, &mut notes).map_err(TumbleError::Planning)?;
        while let Some(request) = flying.next_request() {
            notes.plan(time_ns, &mut planners, &request);
        }
        notes.asked.clear();
        let estimate = believed(&flying);
        let body = (ten(&estimate.parameters), ten_sigma(&estimate));
        let estimator = flying.estimator();
        notes.doubts.see(time_s, &estimator.health(), &estimator.counts(), &body);
        let clearance_m = sums.look(&problem, &flying, &judge, &estimate, periods)?;
        let is_over = invariants::look(&mut sums.watch, &problem, &flying, &command, &estimate, clearance_m);
        sums.violations += u64::from(is_over);
        sums.account.commanded(time_ns, &command);
        mark_used(&mut notes.beliefs, &command, time_s);
        let change = notes.faults.before_step(time_ns, &command.wrench_body);
        change.apply(&mut problem.flight.simulator)?;
        let measured = problem.flight.push(&change.wanted)?;
        let simulator = &problem.flight.simulator;
        let [stored_before, stored_after] = measured.stored_momentum_body;
        acted = Acted {
            from_ns: time_ns,
            until_ns: simulator.time_ns(),
            wrench_body: measured.believed_wrench_body,
            stored_body: (stored_before + stored_after) * 0.5,
        };
        notes.faults.measurements(simulator.time_ns(), simulator.estimates(), &mut heard);
        arrived.clear();
        arrived.extend(heard.iter().map(|estimate| measurement(estimate, &problem.noise)));
        sums.acted(&problem, &measured, periods);
        notes.hooks.period(&FlownPeriod {
            measured: &measured,
            estimates: &heard,
            estimate: body,
            belief: &estimate,
            plan_revision: plan_at(&notes.stretches, time_s),
            belief_revision: command.model_revision,
        })?;
        if periods.is_multiple_of(125) {
            notes.hooks.progress(time_s, problem.longest_s);
        }
        periods += 1;
    }
    sums.series.plan_revision = sums.series.t_s.iter().map(|t_s| plan_at(&notes.stretches, *t_s)).collect();
    record(source, options, &problem, &flying, (sums, notes))
}

/// An obstacle that the robot would touch so long after it shows up; none where the robot goes nowhere.
fn in_the_way(
    flying: &AstrobeeLoop,
    problem: &MissionProblem,
    late: &LateObstacle,
    time_s: f64,
) -> Option<MovingObstacle> {
    let reach_m = problem.planning.body.bounding_radius_m() + LATE_RADIUS_M;
    let position = |time_s: f64| flying.reference(time_s).state.world_from_body.translation.vector;
    let touching = position(time_s + late.notice_s);
    let ahead = position(time_s + late.notice_s + 0.1) - touching;
    let direction = ahead.try_normalize(1e-6)?;
    let center = touching + direction * reach_m;
    let ellipsoid = ObstacleEllipsoid {
        world_from_ellipsoid: Pose::from_parts(center.into(), UnitQuaternion::identity()),
        semi_axes: Vector3::repeat(LATE_RADIUS_M),
    };
    Some(MovingObstacle::at_rest(ellipsoid).present(time_s, f64::INFINITY))
}

/// At rest, seen from the start on.
fn drawn_ellipsoid(solid: &ObstacleEllipsoid) -> DrawnEllipsoid {
    DrawnEllipsoid {
        center_m: array(&solid.world_from_ellipsoid.translation.vector),
        velocity_m_s: [0.0; 3],
        quaternion_xyzw: xyzw(&solid.world_from_ellipsoid.rotation),
        semi_axes_m: array(&solid.semi_axes),
        seen_s: [0.0, f64::INFINITY],
    }
}

/// What the robot holds some time of the mission.
fn drawn_payload(source: &ScenarioSource) -> Result<Option<DrawnPayload>, TumbleError> {
    let (Some(grasp), Some(table)) = (source.drawn_grasp()?, &source.scenario.payload) else { return Ok(None) };
    let (payload_from_box, edges_m) = grasp.payload.as_box();
    let robot_from_box = grasp.robot_from_payload * payload_from_box;
    Ok(Some(DrawnPayload {
        center_m: array(&robot_from_box.translation.vector),
        quaternion_xyzw: xyzw(&robot_from_box.rotation),
        edges_m,
        held_s: [table.attach_s, table.release_s.unwrap_or(f64::INFINITY)],
    }))
}

/// A contact that nothing prevents.
struct TooLate {
    /// How deep it is at least, m.
    depth_m: f64,
    reason: String,
}

/// What passes from seeing something to full thrust, s: a period of control, and flaps that turn.
const REACTION_S: f64 = 0.1;

/// That the robot, pushed as hard as nozzles and limits allow as soon as it can react, comes to rest on its line only beyond an obstacle's
/// surface; none where it does before.
fn too_late(problem: &MissionProblem, obstacle: &MovingObstacle, time_s: f64) -> Option<TooLate> {
    let simulator = &problem.flight.simulator;
    let (state, body) = (simulator.state(), simulator.body());
    let (pose, center) = (&state.world_from_body, body.center_of_mass());
    let to_obstacle = obstacle.ellipsoid.world_from_ellipsoid.translation.vector - pose.translation.vector;
    let gap_m = to_obstacle.norm() - LATE_RADIUS_M - problem.planning.body.bounding_radius_m();
    let ahead_body = pose.rotation.inverse() * to_obstacle.normalize();
    let closing_m_s = state.twist_body.linear.dot(&ahead_body).max(0.0);
    // as hard as one can push against this direction and no other
    let shares = ahead_body.iter().zip(&problem.force_limit_n).filter(|(share, _)| share.abs() > 1e-6);
    let limit_n = shares.map(|(share, limit)| limit / share.abs()).fold(f64::INFINITY, f64::min);
    let force_n = simulator.largest_force_n(&-ahead_body, &center, limit_n);
    let braking_m = closing_m_s * (REACTION_S + closing_m_s * body.mass / (2.0 * force_n));
    (braking_m > gap_m).then(|| TooLate {
        depth_m: braking_m - gap_m,
        reason: format!(
            "{UNAVOIDABLE}at {time_s:.1} s something showed up {gap_m:.3} m ahead, and to stop from {closing_m_s:.3} m/s with \
             {force_n:.2} N after {REACTION_S} s takes {braking_m:.3} m"
        ),
    })
}

impl TooLate {
    /// Why a contact was no fault of the robot; none where it is deeper than it had to be, by more than a margin that is there for
    /// what the robot does not do exactly.
    fn excuse(self, clearance_m: f64, margin_m: f64) -> Option<String> {
        (clearance_m + self.depth_m + margin_m >= 0.0).then_some(self.reason)
    }
}

/// What the estimator takes the body for; where it says nothing that can be, what is planned with.
fn believed(flying: &AstrobeeLoop) -> Estimate {
    let found = flying.estimator().finding().and_then(|found| Estimate::try_from(&found));
    found.unwrap_or(flying.belief().estimate)
}

/// Makes the estimator sure of what is wrong.
fn sabotaged(flying: &mut AstrobeeLoop, sabotage: &Sabotage) -> Result<(), PlanningError> {
    let estimate = believed(flying);
    let body = &estimate.parameters;
    let inertia = body.inertia_about_com() * sabotage.inertia_factor;
    let parameters = InertialParameters::about_com(body.mass * sabotage.mass_factor, body.center_of_mass(), inertia);
    let misled = Estimate { parameters, covariance: estimate.covariance * sabotage.covariance_factor, ..estimate };
    let scale = BodyScale::of(&parameters.to_vector())?;
    Ok(flying.estimator_mut().restart(&misled.to_finding(scale)?)?)
}

/// A message of the localisation as the loop's estimator takes it, with the noise that a mission takes its sensors for.
pub fn measurement(estimate: &LocalizationEstimate, noise: &MotionNoise) -> Measurement {
    Measurement {
        rate_body: Some(Gauss::isotropic(estimate.rate_body, noise.rate_rad_s)),
        velocity_world: Some(Gauss::isotropic(estimate.velocity_origin_world, noise.velocity_m_s)),
        acceleration_body: Some(Gauss::isotropic(estimate.acceleration_origin_body, noise.acceleration_m_s2)),
        ..Measurement::of_pose(estimate.stamp_ns, &estimate.world_from_body, noise.attitude_rad, noise.position_m)
    }
}

fn plan_at(stretches: &[StretchRow], time_s: f64) -> u64 {
    stretches.iter().rev().find(|stretch| stretch.start_s <= time_s).map_or(0, |stretch| stretch.plan_revision)
}

fn mark_used(beliefs: &mut [BeliefRow], command: &ControlCommand, time_s: f64) {
    if let Some(used) = beliefs.iter_mut().find(|belief| belief.revision == command.model_revision) {
        used.used_from_s.get_or_insert(time_s);
    }
}

impl Sums {
    fn watched_by(watch: InvariantWatch) -> Self {
        Self {
            watch,
            series: Series::default(),
            violations: 0,
            beyond_localization: 0,
            impulse_n_s: 0.0,
            angular_impulse_n_m_s: 0.0,
            squares: Vec::new(),
            min_clearance_m: None,
            account: ControlAccount::with_decisions(BETWEEN_ROWS.cast_signed() * CONTROL_PERIOD_NS),
        }
    }

    fn look(
        &mut self,
        problem: &MissionProblem,
        flying: &AstrobeeLoop,
        judge: &EllipsoidWorld,
        estimate: &Estimate,
        periods: u64,
    ) -> Result<Option<f64>, TumbleError> {
        let simulator = &problem.flight.simulator;
        let (state, time_s) = (simulator.state(), seconds(simulator.time_ns()));
        let pose = &state.world_from_body;
        let clearance = judge.clearance(&problem.planning.body, pose, time_s).map_err(TumbleError::Planning)?;
        let clearance_m = clearance.distance_m.is_finite().then_some(clearance.distance_m);
        if let Some(clearance_m) = clearance_m {
            self.min_clearance_m = Some(self.min_clearance_m.map_or(clearance_m, |least| least.min(clearance_m)));
        }
        let (speed, rate) = (state.twist_body.linear.norm(), state.twist_body.angular.norm());
        let is_over = speed > problem.speed_limit_m_s || rate > problem.rate_limit_rad_s;
        self.violations += u64::from(is_over);
        let wanted = flying.reference(time_s).state.world_from_body;
        let error_m = (pose.translation.vector - wanted.translation.vector).norm();
        self.squares.push((time_s, error_m * error_m));
        if !periods.is_multiple_of(BETWEEN_ROWS) {
            return Ok(clearance_m);
        }
        let turn: Vector3<f64> = LieGroup::log(&(wanted.rotation.inverse() * pose.rotation));
        let believed = flying.state().world_from_body;
        let series = &mut self.series;
        series.t_s.push(time_s);
        series.position_m.push(array(&pose.translation.vector));
        series.quaternion_xyzw.push(xyzw(&pose.rotation));
        series.wanted_position_m.push(array(&wanted.translation.vector));
        series.wanted_quaternion_xyzw.push(xyzw(&wanted.rotation));
        series.believed_position_m.push(array(&believed.translation.vector));
        series.tracking_error_m.push(error_m);
        series.attitude_error_rad.push(turn.norm());
        series.tube_m.push(flying.controller().tube_m());
        series.clearance_m.push(clearance_m);
        series.estimate.push(ten(&estimate.parameters));
        series.sigma.push(ten_sigma(estimate));
        series.belief_revision.push(flying.command().map_or(0, |command| command.model_revision));
        Ok(clearance_m)
    }

    fn acted(&mut self, problem: &MissionProblem, measured: &SimulatorMeasurement, periods: u64) {
        let Wrench { torque, force } = &measured.realized_wrench_body;
        if let Some(survived) = &problem.planned_motion.survived {
            let simulator = &problem.flight.simulator;
            let acceleration = force.norm() / simulator.body().mass;
            let is_beyond = simulator.state().twist_body.angular.norm() > survived.rate_rad_s
                || acceleration > survived.acceleration_m_s2;
            self.beyond_localization += u64::from(is_beyond);
        }
        self.impulse_n_s += force.norm() * CONTROL_PERIOD_S;
        self.angular_impulse_n_m_s += torque.norm() * CONTROL_PERIOD_S;
        if periods.is_multiple_of(BETWEEN_ROWS) {
            self.series.force_n.push(array(force));
            self.series.torque_n_m.push(array(torque));
        }
    }

    fn rms_since(&self, from_s: f64) -> f64 {
        let since = self.squares.iter().filter(|(time_s, _)| *time_s >= from_s);
        let (count, sum) = since.fold((0_u32, 0.0), |(count, sum), (_, square)| (count + 1, sum + square));
        if count == 0 { 0.0 } else { libm::sqrt(sum / f64::from(count)) }
    }
}

/// Writes beside what stretches promised what the estimator stated at their ends, and counts.
fn compare_promises(stretches: &mut [StretchRow], series: &Series) -> Promises {
    let mut promises = Promises::default();
    let ends: Vec<Option<f64>> = stretches.iter().skip(1).map(|next| Some(next.start_s)).chain([None]).collect();
    for (stretch, replaced_s) in stretches.iter_mut().zip(ends) {
        let end_s = stretch.end_s;
        if replaced_s.is_some_and(|replaced_s| replaced_s < end_s - CONTROL_PERIOD_S) {
            continue;
        }
        let row = series.t_s.partition_point(|time_s| *time_s < end_s);
        let Some(sigma) = series.t_s.get(row).and_then(|_| series.sigma.get(row)) else { continue };
        let place = |name: &String| PARAMETERS.iter().position(|(parameter, _)| parameter == name);
        let Some(places) = stretch.quantities.iter().map(place).collect::<Option<Vec<usize>>>() else { continue };
        stretch.stated = places.iter().map(|place| sigma[*place]).collect();
        for (stated, [_, promised]) in stretch.stated.iter().zip(&stretch.sigma) {
            promises.made += 1;
            promises.kept += u64::from(PROMISED.contains(&(promised / stated)));
        }
    }
    promises
}

fn fallback_row(spell: &FallbackSpell) -> FallbackRow {
    FallbackRow { t_s: seconds(spell.from_ns), reason: spell.fallback.to_string() }
}

/// Why a robot that ran out of time was waiting.
fn in_vain(flying: &AstrobeeLoop, margins: &Margins) -> Option<String> {
    let searches = flying.ways_refused();
    (flying.end() == Some(&End::OutOfTime) && searches > 0).then(|| {
        let Margins { way, checked, .. } = margins;
        format!(
            "in its last {searches} searches the robot found no way to the goal that keeps {way:.3} m from everything, nor one that keeps \
             {checked:.3} m, which margin_m and the wander of its localisation ask for"
        )
    })
}

fn record(
    source: &ScenarioSource,
    options: &FlyOptions,
    problem: &MissionProblem,
    flying: &AstrobeeLoop,
    (sums, notes): (Sums, Notes<'_>),
) -> Result<MissionRecord, TumbleError> {
    let mission_s = seconds(problem.flight.simulator.time_ns());
    let estimate = believed(flying);
    let truth = problem.flight.simulator.body();
    let truth = if problem.planar { tumble_astrobee::simulator::planar_part(&truth) } else { truth };
    let columns = [ten(&truth), ten(&problem.prior.parameters), ten(&estimate.parameters), ten_sigma(&estimate)];
    let row = |(index, (name, unit)): (usize, &(&str, &str))| ParameterRow {
        name: (*name).to_owned(),
        unit: (*unit).to_owned(),
        truth: columns[0][index],
        initial: columns[1][index],
        estimate: columns[2][index],
        sigma: columns[3][index],
    };
    let Notes {
        mut ways,
        mut stretches,
        beliefs,
        mut events,
        shut_off,
        faults,
        doubts,
        too_late,
        showed_up,
        expired,
        ..
    } = notes;
    let promises = compare_promises(&mut stretches, &sums.series);
    for event in problem.flight.simulator.events() {
        let kind = if event.event.is_violation() { "violation" } else { "simulator" };
        let text = event.event.to_string();
        events.push(MissionEvent { t_s: seconds(event.time_ns), kind: kind.to_owned(), text });
    }
    events.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
    if let Some((_, earlier)) = ways.split_last_mut() {
        // one tree is enough to look at
        earlier.iter_mut().skip(1).for_each(|way| way.tree_m.clear());
    }
    let counts = flying.estimator().counts();
    let mut warnings = invariants::warnings(&sums.watch);
    warnings.extend(expired);
    let clearance_m = sums.min_clearance_m.unwrap_or(f64::INFINITY);
    warnings.extend(too_late.and_then(|too_late| too_late.excuse(clearance_m, problem.margins_m.checked)));
    if counts.gated > 0 {
        warnings.push(format!("{} measurements did not fit what was expected and were not used", counts.gated));
    }
    warnings.extend(in_vain(flying, &problem.margins_m));
    warnings.extend((flying.end() == Some(&End::NoMotion)).then(|| NO_MOTION.to_owned()));
    let summary = MissionSummary {
        format: 1,
        scenario: source.scenario.name.clone(),
        seed: options.seed,
        options: *options,
        layers: problem.layers.all(),
        arrived: flying.end() == Some(&End::Arrived),
        no_way: match flying.end() {
            Some(End::NoWay(obstruction)) => Some(obstruction.to_string()),
            _ => None,
        },
        mission_s,
        min_clearance_m: sums.min_clearance_m,
        limit_violations: sums.violations,
        impulse_n_s: sums.impulse_n_s,
        angular_impulse_n_m_s: sums.angular_impulse_n_m_s,
        rms_tracking_m: TrackingRms { all: sums.rms_since(0.0), last_leg: sums.rms_since(0.75 * mission_s) },
        parameters: PARAMETERS.iter().enumerate().map(row).collect(),
        replans: (ways.len() as u64).saturating_sub(1),
        belief_revisions: beliefs.len() as u64,
        fallbacks: sums.account.fallbacks().iter().map(fallback_row).collect(),
        faults: faults.counts(),
        information_shut_off_s: shut_off.into_iter().filter_map(|(name, at)| Some((name, at?))).collect(),
        warnings,
        doubts: doubts.finish(),
        beyond_localization_s: sums.beyond_localization as f64 * CONTROL_PERIOD_S,
        promises,
    };
    let World { keep_in, keep_out, obstacles } = &problem.planning.world;
    let drawn =
        |aligned: &AlignedBox| DrawnBox { lower_m: array(&aligned.lower_world), upper_m: array(&aligned.upper_world) };
    let ellipsoid = |(index, solid): (usize, &ObstacleEllipsoid)| {
        let motion = problem.planning.obstacle_motions.iter().find(|motion| motion.obstacle == index);
        let seen_s = problem.seen_from_s.get(index).copied().unwrap_or(0.0);
        DrawnEllipsoid {
            velocity_m_s: motion.map_or([0.0; 3], |motion| array(&motion.velocity_world)),
            seen_s: [seen_s, motion.map_or(1e9, |motion| motion.vanish_s.min(1e9))],
            ..drawn_ellipsoid(solid)
        }
    };
    Ok(MissionRecord {
        summary,
        scenario_toml: source.without_drive().to_toml()?,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        robot_radius_m: problem.planning.body.bounding_radius_m(),
        planar: problem.planar,
        goal_m: array(&problem.planning.goal.position),
        keep_in: keep_in.iter().map(drawn).collect(),
        keep_out: keep_out.iter().map(drawn).collect(),
        obstacles: obstacles.iter().enumerate().map(ellipsoid).chain(showed_up).collect(),
        payload: drawn_payload(source)?,
        series: sums.series,
        ways,
        stretches,
        beliefs,
        events,
    })
}
