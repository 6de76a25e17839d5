//! Layers of somebody else's: an estimator, a planner of ways, a planner of stretches, planners in a thread; and what cannot be flown.

use super::{
    GOAL, NOISE_M, PERIOD_S, PLANNED_N, PLANNED_N_M, RADIUS_M, Tug, belief, estimator, flown, fly, planners, room,
    simulated, start, tube, tug,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use tumble_planning::collision::EllipsoidWorld;
use tumble_planning::control::{ReferenceMotion, TubeController};
use tumble_planning::dynamics::{PoseReference, RigidBodyState, World};
use tumble_planning::global::{FlightPlanner, GlobalAnswer, GlobalPlanner, GlobalRequest, Objective, Obstruction};
use tumble_planning::identification::BodyScale;
use tumble_planning::identification::estimator::{Acted, Doubt, EstimatorError, Finding, Measurement, StateEstimator};
use tumble_planning::identification::recursive::{FlightEstimator, FlightHealth, Reception, ReceptionCounts};
use tumble_planning::lie::{LieGroup, Pose, Twist};
use tumble_planning::local::{InformativePlanner, LocalAnswer, LocalPlanner, LocalRequest, RigidBodyModel};
use tumble_planning::mission::{
    Action, End, LoopObserver, NoObserver, Note, Office, PlanAnswer, PlanRequest, StretchAnswer, StretchModel,
    StretchSettings, Thread,
};
use tumble_planning::nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};
use tumble_planning::{ArcPath, Budget, PlanningError};

type Ball = RigidBodyModel<4>;

/// A motion filter with constant gains, which learns nothing of the body.
struct Sluggish {
    stamp_ns: i64,
    /// World axes; the rate in body axes.
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    rotation: UnitQuaternion<f64>,
    rate: Vector3<f64>,
    counts: ReceptionCounts,
    body: Finding,
}

const GAINS: [f64; 2] = [0.3, 0.05];

fn prior() -> Finding {
    let estimate = belief().estimate;
    estimate.to_finding(BodyScale::of(&estimate.parameters.to_vector()).unwrap()).unwrap()
}

impl Sluggish {
    fn new() -> Self {
        let RigidBodyState { world_from_body, .. } = start();
        let (position, rotation) = (world_from_body.translation.vector, world_from_body.rotation);
        let (velocity, rate) = (Vector3::zeros(), Vector3::zeros());
        Self { stamp_ns: 0, position, velocity, rotation, rate, counts: ReceptionCounts::default(), body: prior() }
    }
}

impl StateEstimator for Sluggish {
    fn acted(&mut self, acted: &Acted) {
        let span_s = (acted.until_ns - acted.from_ns) as f64 * 1e-9;
        let body = belief();
        let body = body.parameters();
        self.velocity += self.rotation * acted.wrench_body.force * (span_s / body.mass);
        self.rate += acted.wrench_body.torque * (span_s / body.inertia_about_com()[(0, 0)]);
    }
    fn measured(&mut self, measurement: &Measurement) -> Reception {
        let (Some(attitude), Some(position)) = (&measurement.attitude, &measurement.position_world) else {
            return Reception::Malformed { what: "no pose" };
        };
        let before = self.state_at(measurement.stamp_ns).world_from_body;
        let away = position.value - before.translation.vector;
        let turn: Vector3<f64> = LieGroup::log(&(before.rotation.inverse() * attitude.value));
        self.position = before.translation.vector + away * GAINS[0];
        self.velocity += away * (GAINS[1] / PERIOD_S);
        self.rotation = before.rotation * <UnitQuaternion<f64> as LieGroup>::exp(&(turn * GAINS[0]));
        self.rate += turn * (GAINS[1] / PERIOD_S);
        self.stamp_ns = measurement.stamp_ns;
        Reception::Used { nis: away.norm_squared() / (NOISE_M * NOISE_M) }
    }
    fn state_at(&self, time_ns: i64) -> RigidBodyState<f64> {
        let ahead_s = (time_ns - self.stamp_ns) as f64 * 1e-9;
        let rotation = self.rotation * <UnitQuaternion<f64> as LieGroup>::exp(&(self.rate * ahead_s));
        RigidBodyState {
            world_from_body: Pose::from_parts((self.position + self.velocity * ahead_s).into(), rotation),
            twist_body: Twist::new(self.rate, rotation.inverse() * self.velocity),
        }
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        Ok(self.body)
    }
    fn health(&self) -> FlightHealth {
        FlightHealth::default()
    }
    fn newest_stamp_ns(&self) -> i64 {
        self.stamp_ns
    }
    fn doubt(&mut self, _doubt: &Doubt) {}
    fn restart(&mut self, body: &Finding) -> Result<(), EstimatorError> {
        self.body = *body;
        Ok(())
    }
    fn counts(&self) -> ReceptionCounts {
        self.counts
    }
}

#[test]
fn an_estimator_from_outside_flies() {
    assert!(fly(&mut tug(tube, Sluggish::new(), &room()), &mut simulated(planners()), &mut NoObserver));
}

/// What is wrong with what an estimator says after a while.
#[derive(Clone, Copy, PartialEq)]
enum Lie {
    NotANumber,
    NoCovariance,
    NoBody,
    OwnError,
    NoMotion,
    NoMotionAnyMore,
}

/// When the last of these begins, ns: the tug is on its way.
const SILENT_NS: i64 = 16_000_000_000;

/// The joint filter, with a tongue of its own.
struct Liar(FlightEstimator, Lie, Arc<AtomicUsize>);

#[derive(Debug, thiserror::Error)]
#[error("the pool `{pool}` is empty")]
struct Exhausted {
    pool: String,
}

fn exhausted(pool: usize) -> Exhausted {
    Exhausted { pool: format!("particles {pool}") }
}

impl StateEstimator for Liar {
    fn name(&self) -> &'static str {
        "liar"
    }
    fn acted(&mut self, acted: &Acted) {
        StateEstimator::acted(&mut self.0, acted);
    }
    fn measured(&mut self, measurement: &Measurement) -> Reception {
        StateEstimator::measured(&mut self.0, measurement)
    }
    fn state_at(&self, time_ns: i64) -> RigidBodyState<f64> {
        let mut state = StateEstimator::state_at(&self.0, time_ns);
        // Time and again for a tenth of a second.
        if self.1 == Lie::NoMotion && self.2.load(Ordering::Relaxed) >= 3 && time_ns % 2_000_000_000 < 100_000_000 {
            state.twist_body.angular.y = f64::NAN;
        }
        if self.1 == Lie::NoMotionAnyMore && time_ns >= SILENT_NS {
            state.twist_body.linear.x = f64::NAN;
        }
        state
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        let found = StateEstimator::finding(&self.0)?;
        if self.2.fetch_add(1, Ordering::Relaxed) < 3 {
            return Ok(found);
        }
        let point = *found.point().unwrap();
        match self.1 {
            Lie::NotANumber => Ok(found.at(SVector::repeat(f64::NAN))),
            Lie::NoCovariance => Finding::of_covariance(point, &-SMatrix::identity(), *found.magnitudes()),
            Lie::NoBody => Ok(found.at(-point)),
            Lie::OwnError => Err(EstimatorError::foreign("particles", exhausted(3))),
            Lie::NoMotion | Lie::NoMotionAnyMore => Ok(found),
        }
    }
    fn health(&self) -> FlightHealth {
        StateEstimator::health(&self.0)
    }
    fn newest_stamp_ns(&self) -> i64 {
        StateEstimator::newest_stamp_ns(&self.0)
    }
    fn doubt(&mut self, doubt: &Doubt) {
        StateEstimator::doubt(&mut self.0, doubt);
    }
    fn restart(&mut self, body: &Finding) -> Result<(), EstimatorError> {
        StateEstimator::restart(&mut self.0, body)
    }
    fn counts(&self) -> ReceptionCounts {
        StateEstimator::counts(&self.0)
    }
}

#[derive(Default)]
struct Disbelief(Vec<PlanningError>);

impl LoopObserver for Disbelief {
    fn disbelieved(&mut self, _time_ns: i64, error: &PlanningError) {
        self.0.push(error.clone());
    }
}

/// What is none is refused with the name of whose it is and counted, and the robot arrives with the last belief that was one.
#[test]
fn what_a_liar_says_is_refused_and_the_flight_goes_on() {
    for lie in [Lie::NotANumber, Lie::NoCovariance, Lie::NoBody, Lie::OwnError, Lie::NoMotion] {
        let mut flying = tug(tube, Liar(estimator(), lie, Arc::default()), &room());
        let mut heard = Disbelief::default();
        assert!(fly(&mut flying, &mut simulated(planners()), &mut heard));
        assert!(flying.disbelieved() > 5 && flying.disbelieved() == heard.0.len() as u64);
        assert!(flying.belief().revision == 2 || lie == Lie::NoMotion);
        assert!(flying.belief().parameters().is_strictly_consistent());
        let text = heard.0[0].to_string();
        assert!(text.starts_with("liar: "), "{text}");
        let mut sources = std::iter::successors(std::error::Error::source(&heard.0[0]), |error| error.source());
        assert_eq!(sources.any(<dyn std::error::Error>::is::<Exhausted>), lie == Lie::OwnError, "{text}");
        assert_eq!(text.ends_with("the pool `particles 3` is empty"), lie == Lie::OwnError, "{text}");
    }
}

/// What was answered, and what was to be flown when the estimator fell silent.
#[derive(Default)]
struct Silence(Vec<Action>, Option<PoseReference>);

impl LoopObserver for Silence {
    fn answered(&mut self, _time_ns: i64, action: &Action) {
        self.0.push(*action);
    }
    fn follows(&mut self, _time_ns: i64, start_ns: i64, stretch: &StretchAnswer, _model_revision: u64) {
        if start_ns <= SILENT_NS {
            self.1 = Some(stretch.motion.at(SILENT_NS as f64 * 1e-9));
        }
    }
}

/// A stop needs a motion to follow it by: where none is told it is carried on by what acted, and the mission ends when that rests.
#[test]
fn a_robot_whose_estimator_falls_silent_comes_to_rest_and_says_so() {
    let mut flying = tug(tube, Liar(estimator(), Lie::NoMotionAnyMore, Arc::default()), &room());
    let mut heard = Silence::default();
    let last = flown(&mut flying, &mut simulated(planners()), &mut heard);
    assert_eq!(flying.end(), Some(&End::NoMotion));
    assert!(heard.0.contains(&Action::Note(Note::NoMotion)) && heard.0.contains(&Action::Stop));
    let speeds = |motion: &RigidBodyState<f64>| (motion.twist_body.linear.norm(), motion.twist_body.angular.norm());
    let ((speed, rate), (left, left_rate)) = (speeds(&heard.1.unwrap().state), speeds(&last));
    assert!(speed > 0.05 && left < 0.003, "{speed} and {left} m/s");
    assert!(left_rate < rate.max(0.003), "{rate} and {left_rate} rad/s");
    // A second until it stops, and five of patience.
    assert!(flying.time_ns() - SILENT_NS < 7_000_000_000, "{} ns", flying.time_ns());
}

/// Ways that cost the least impulse, whatever is asked for.
#[derive(Default)]
struct Frugal(FlightPlanner, usize);

impl GlobalPlanner<EllipsoidWorld> for Frugal {
    fn plan(
        &mut self,
        request: &GlobalRequest<'_, EllipsoidWorld>,
        budget: &mut dyn Budget,
    ) -> Result<GlobalAnswer, PlanningError> {
        self.1 += 1;
        let GlobalRequest { world, body, belief, .. } = *request;
        let frugal = GlobalRequest { world, body, belief, objective: Objective::Impulse, ..*request };
        self.0.plan(&frugal, budget)
    }
}

/// Stretches for which information has no weight, whatever is asked for.
struct Incurious(InformativePlanner<Ball, 12, 6, 4>, Arc<AtomicUsize>);

impl LocalPlanner<6, 4> for Incurious {
    type State = <Ball as tumble_planning::local::InformativeModel<12, 6, 4>>::State;

    fn plan(
        &mut self,
        request: &LocalRequest<'_, Self::State, 6, 4>,
        budget: &mut dyn Budget,
    ) -> Result<LocalAnswer<Self::State, 6, 4>, PlanningError> {
        self.1.fetch_add(1, Ordering::Relaxed);
        self.0.plan(&LocalRequest { information: [0.0; 4], ..request.clone() }, budget)
    }
}

#[test]
fn planners_from_outside_fly() {
    let (_, stretches) = planners();
    let settings = StretchSettings::of_poses(super::NOISE_RAD, NOISE_M, PERIOD_S);
    let push = tumble_planning::dynamics::WrenchBox::in_every_axis(PLANNED_N_M, PLANNED_N).into();
    let local = settings.local(&Ball::GROUPS, &Ball::IS_TORQUE, push).unwrap();
    let asked = Arc::new(AtomicUsize::new(0));
    let incurious = Incurious(InformativePlanner::try_new(RigidBodyModel::principal(), local).unwrap(), asked.clone());
    let ways: Box<dyn GlobalPlanner<EllipsoidWorld>> = Box::new(Frugal::default());
    let mut office = simulated((ways, stretches.planned_by(incurious)));
    assert!(fly(&mut tug(tube, estimator(), &room()), &mut office, &mut NoObserver));
    assert!(asked.load(Ordering::Relaxed) > 1);
}

fn is_send<T: Send>(_: &T) {}

/// Planners in a thread of their own; here each answer is waited for a second of the mission after it was asked for.
struct Waiting(Thread<EllipsoidWorld>, std::collections::VecDeque<i64>);

impl Office<EllipsoidWorld> for Waiting {
    fn take(&mut self, now_ns: i64, request: PlanRequest<EllipsoidWorld>) {
        self.1.push_back(now_ns + 1_000_000_000);
        self.0.take(now_ns, request);
    }
    fn ready(&mut self, now_ns: i64) -> Option<PlanAnswer> {
        self.1.front().filter(|due_ns| **due_ns <= now_ns)?;
        self.1.pop_front();
        loop {
            match self.0.ready(now_ns) {
                Some(answer) => return Some(answer),
                None => std::thread::yield_now(),
            }
        }
    }
}

/// The loop may go to another thread, whatever its planners are: these are made where they work, and need not be `Send`.
#[test]
fn planners_work_in_a_thread_of_the_users() {
    let mut flying = tug(tube, Box::new(estimator()) as Box<dyn StateEstimator>, &room());
    is_send(&flying);
    let (office, theirs) = Thread::new();
    let thread = std::thread::spawn(move || theirs.run(planners()));
    let mut office = Waiting(office, std::collections::VecDeque::new());
    assert!(fly(&mut flying, &mut office, &mut NoObserver));
    drop(office);
    thread.join().unwrap();
}

fn walled_in() -> World {
    let mut world = room();
    world.obstacles[1].semi_axes.y = 8.0;
    world
}

/// The proof that no way exists ends the mission at its first answer.
#[test]
fn a_robot_that_is_walled_in_does_not_ask_again() {
    let mut flying: Tug<TubeController, _> = tug(tube, estimator(), &walled_in());
    assert!(!fly(&mut flying, &mut simulated(planners()), &mut NoObserver));
    assert!(matches!(flying.end(), Some(End::NoWay(Obstruction::Enclosed { .. }))), "{:?}", flying.end());
    assert!(flying.time_ns() < 3_000_000_000, "{} ns", flying.time_ns());
    // a goal inside of something
    let mut world = room();
    world.obstacles[1].world_from_ellipsoid = Pose::translation(GOAL.x, GOAL.y, GOAL.z + 0.1 * RADIUS_M);
    let mut flying = tug(tube, estimator(), &world);
    assert!(!fly(&mut flying, &mut simulated(planners()), &mut NoObserver));
    assert!(matches!(flying.end(), Some(End::NoWay(Obstruction::GoalBlocked { .. }))), "{:?}", flying.end());
}

/// A way that is asked for from where it has been proved that there is none must stay a question for a planner that only gave up.
struct GivesUp(FlightPlanner, usize);

impl GlobalPlanner<EllipsoidWorld> for GivesUp {
    fn plan(
        &mut self,
        request: &GlobalRequest<'_, EllipsoidWorld>,
        budget: &mut dyn Budget,
    ) -> Result<GlobalAnswer, PlanningError> {
        self.1 += 1;
        match self.1 {
            1 => Err(PlanningError::foreign("gives up", exhausted(self.1))),
            2 => self.0.plan(request, &mut tumble_planning::Units::new(0)),
            _ => self.0.plan(request, budget),
        }
    }

    fn plan_anew(
        &mut self,
        request: &GlobalRequest<'_, EllipsoidWorld>,
        known: &ArcPath,
        budget: &mut dyn Budget,
    ) -> Result<GlobalAnswer, PlanningError> {
        self.0.plan_anew(request, known, budget)
    }
}

#[test]
fn errors_and_budgets_that_end_are_no_proof() {
    let (ways, stretches) = planners();
    let mut office = simulated((GivesUp(ways, 0), stretches));
    assert!(fly(&mut tug(tube, estimator(), &room()), &mut office, &mut NoObserver));
}
