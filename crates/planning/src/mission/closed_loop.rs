//! The layers at work: what the coordinator asks for is planned, flown and told.

use super::brake::{BrakeLimits, Braking};
use super::coordinator::{Coordinator, Schedule};
use super::event::{Action, Ambition, Event, FoundStretch, Standing, StartFrom, TimedEvent};
use super::motion::{MissionMotion, StopLimits};
use super::stretch::{StretchAnswer, StretchPlanner, StretchRefusal, StretchTask};
use crate::belief::{ModelBelief, Plan};
use crate::budget::Units;
use crate::collision::{BodyShape, CollisionWorld, EllipsoidWorld};
use crate::control::{ControlCommand, ControlRequest, Controller, Fallback, ReferenceMotion};
use crate::error::PlanningError;
use crate::global::{GlobalAnswer, GlobalPlanner, GlobalRequest, GoalRegion, MotionLimits, Objective, Until};
use crate::local::{Hull, Surroundings};
use crate::motion::{ArcPath, BodyArc, TranslationState};
use nalgebra::{UnitQuaternion, Vector3};
use std::collections::VecDeque;
use tumble_dynamics::{PoseReference, RigidBodyState, World};
use tumble_identification::Estimate;
use tumble_identification::IdentificationError;
use tumble_identification::recursive::{
    FlightEstimator, FlightHealth, FlightMeasurement, LearningTargets, Reception, grasp_or_release,
};
use tumble_lie::{LieGroup, Wrench};

/// Ways that are remembered for the stretches of them that are still to be planned.
const WAYS: usize = 4;

/// Share of the clearance at its start that a way may keep.
const START_SHARE: f64 = 0.95;

/// A body so many standard deviations heavier than believed still stops where a stop ends.
const HEAVIEST_SIGMAS: f64 = 3.0;

/// What is around the robot, as far as it knows.
#[derive(Clone, Debug)]
pub struct Scene<W> {
    /// For ways and checks.
    pub world: W,
    /// The same for stretches.
    pub surroundings: Surroundings,
}

impl Scene<EllipsoidWorld> {
    /// Walls and solids at rest, for a body of this shape.
    ///
    /// # Errors
    /// A world that cannot be.
    pub fn of_world(world: &World, body: &BodyShape) -> Result<Self, PlanningError> {
        let surroundings = Surroundings::of_world(world, Hull::Shape(body.clone()))?;
        Ok(Self { world: EllipsoidWorld::new(world)?, surroundings })
    }
}

/// When the robot is where it was to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtGoal {
    /// Distance from the goal, m.
    pub distance_m: f64,
    /// Angle from its attitude, rad.
    pub angle_rad: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Rate, rad/s.
    pub rate_rad_s: f64,
}

impl Default for AtGoal {
    /// Two centimetres, three degrees, and hardly a motion.
    fn default() -> Self {
        Self { distance_m: 0.02, angle_rad: 0.05, speed_m_s: 0.005, rate_rad_s: 0.01 }
    }
}

/// How long planning takes: a function of the work done and of chance, not of the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComputingTime {
    /// Of a unit of a way's budget, ns.
    pub way_unit_ns: i64,
    /// Of a unit of a stretch's budget, ns.
    pub stretch_unit_ns: i64,
    /// Every time is up to this share longer.
    pub jitter: f64,
}

impl Default for ComputingTime {
    /// Of a small computer: a second for twenty thousand units.
    fn default() -> Self {
        Self { way_unit_ns: 50_000, stretch_unit_ns: 50_000, jitter: 0.3 }
    }
}

/// What a closed loop is told about its mission.
#[derive(Clone, Debug)]
pub struct LoopSettings<B> {
    /// Times and limits of the decisions.
    pub schedule: Schedule,
    /// Control periods between decisions.
    pub decision_periods: u64,
    /// Time between two beliefs, ns.
    pub belief_period_ns: i64,
    /// Whether beliefs reach planners and controller.
    pub feedback: bool,
    /// What moves.
    pub body: B,
    /// Where to; ignored where only stretches are counted.
    pub goal: GoalRegion,
    /// When that is reached.
    pub at_goal: AtGoal,
    /// What a way keeps within.
    pub limits: MotionLimits,
    /// What is least of a way.
    pub objective: Objective,
    /// Distance kept by ways and stretches, m.
    pub margin_m: f64,
    /// Distance below which a stretch is not flown, m; less than the margin.
    pub check_margin_m: f64,
    /// How stops brake as long as no more is known of the body than at first; when it is known to be lighter than it might have
    /// been, they brake harder.
    pub stop: StopLimits,
    /// What the brake may use where such a stop would hit something.
    pub brake: BrakeLimits,
    /// Budget of the first way, and of one after a search in vain.
    pub way_units: u64,
    /// Budget of a new way in flight.
    pub new_way_units: u64,
    /// Budget of a stretch.
    pub stretch_units: u64,
    /// How long that takes.
    pub computing: ComputingTime,
    /// When the body is known well enough, so that information has no more weight; never where absent.
    pub known: Option<LearningTargets>,
    /// Relative change of the mass that asks for another way.
    pub material_change: f64,
    /// All chance follows from it.
    pub seed: u64,
}

impl<B> LoopSettings<B> {
    /// The usual times, margins and budgets for a body of some decimetres that flies to a goal with some centimetres per second,
    /// decides at every twelfth control period and learns as it flies.
    ///
    /// A way takes a second to plan, a stretch about as long; 4.5 cm are planned for around everything, and what is flown keeps 2.7.
    /// Times of the decisions are those of [`Schedule::default`].
    pub fn new(body: B, goal: GoalRegion, limits: MotionLimits, (stop, brake): (StopLimits, BrakeLimits)) -> Self {
        Self {
            schedule: Schedule::default(),
            decision_periods: 12,
            belief_period_ns: 2_000_000_000,
            feedback: true,
            body,
            goal,
            at_goal: AtGoal::default(),
            limits,
            objective: Objective::Duration,
            margin_m: 0.045,
            check_margin_m: 0.027,
            stop,
            brake,
            way_units: 20_000,
            new_way_units: 1_200,
            stretch_units: 25_600,
            computing: ComputingTime::default(),
            known: None,
            material_change: 0.15,
            seed: 1,
        }
    }
}

/// What happens to a plan between asking and answering.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PlannerFault {
    /// Nothing.
    #[default]
    None,
    /// It takes so many times as long.
    Late(f64),
    /// It never comes.
    NoAnswer,
    /// It says that there is none.
    Refused,
}

/// A layer, for those who measure what it costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Layer {
    /// The first way, and a way after a search in vain.
    Way,
    /// A new way in flight.
    NewWay,
    /// Stretches.
    Stretch,
    /// Control: once a control period.
    Control,
    /// Estimation: once a measurement.
    Estimator,
}

/// Looks on; every method does nothing unless written.
#[allow(unused_variables)]
pub trait LoopObserver {
    /// A layer begins to work.
    fn begins(&mut self, layer: Layer) {}
    /// It is done.
    fn ends(&mut self, layer: Layer) {}
    /// The coordinator heard of something.
    fn heard(&mut self, event: &TimedEvent) {}
    /// It answered.
    fn answered(&mut self, time_ns: i64, action: &Action) {}
    /// A way was planned.
    fn planned_way(&mut self, time_ns: i64, request: u64, answer: &GlobalAnswer) {}
    /// A planner holds a request for none.
    fn refused(&mut self, time_ns: i64, request: u64, error: &PlanningError) {}
    /// A stretch is flown from its start on.
    fn follows(&mut self, time_ns: i64, start_ns: i64, stretch: &StretchAnswer, model_revision: u64) {}
    /// A belief was offered.
    fn offered(&mut self, time_ns: i64, belief: &ModelBelief) {}
    /// A measurement was used or not.
    fn received(&mut self, time_ns: i64, reception: &Reception) {}
    /// What happens to this request.
    fn planner_fault(&mut self, request: u64) -> PlannerFault {
        PlannerFault::None
    }
}

/// Looks at nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoObserver;

impl LoopObserver for NoObserver {}

/// Makes a controller that counts on nothing but what the body can be at all.
pub type ControllerFactory<C> = Box<dyn FnMut(&ModelBelief) -> Result<C, PlanningError>>;

/// What is flown: a motion, and from their starts on those that follow.
#[derive(Clone, Debug)]
struct Flown {
    now: MissionMotion,
    model_revision: u64,
    next: VecDeque<(i64, MissionMotion, u64)>,
}

impl Flown {
    fn only(motion: MissionMotion, model_revision: u64) -> Self {
        Self { now: motion, model_revision, next: VecDeque::new() }
    }

    fn motion(&self, time_s: f64) -> &MissionMotion {
        let begun = self.next.iter().rev().find(|(start_ns, ..)| time_s >= seconds(*start_ns));
        begun.map_or(&self.now, |(_, motion, _)| motion)
    }

    fn advance(&mut self, time_ns: i64) {
        while self.next.front().is_some_and(|(start_ns, ..)| *start_ns <= time_ns)
            && let Some((_, next, revision)) = self.next.pop_front()
        {
            (self.now, self.model_revision) = (next, revision);
        }
    }

    fn rest_s(&self) -> f64 {
        self.next.back().map_or(self.now.rest_s(), |(_, next, _)| next.rest_s())
    }
}

impl ReferenceMotion for Flown {
    fn at(&self, time_s: f64) -> PoseReference {
        self.motion(time_s).at(time_s)
    }
}

/// A plan on its way to the coordinator.
enum Answer {
    Way { request: u64, way: Option<(ArcPath, u64)>, world_revision: u64 },
    Stretch { request: u64, found: Option<Box<(FoundStretch, StretchAnswer)>> },
}

/// What the robot senses in a control period.
#[derive(Clone, Copy, Debug)]
pub struct Sensed<'a> {
    /// Now, the end of the period, ns.
    pub time_ns: i64,
    /// The wrench believed to have acted in it, after saturation; body axes about the origin.
    pub acted: Wrench<f64>,
    /// What arrived in it.
    pub measurements: &'a [FlightMeasurement],
}

/// RATTLE: coordinator, estimator, planners and controller of one robot.
pub struct ClosedLoop<W, G, C>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    settings: LoopSettings<W::Body>,
    coordinator: Coordinator,
    scene: Scene<W>,
    world_revision: u64,
    way_planner: G,
    stretch_planner: Box<dyn StretchPlanner>,
    new_controller: ControllerFactory<C>,
    controller: C,
    estimator: FlightEstimator,
    prior: ModelBelief,
    belief: ModelBelief,
    next_belief_ns: i64,
    flown: Flown,
    /// Until when the brake is on, s.
    braking_until_s: Option<f64>,
    answers: VecDeque<(i64, Answer)>,
    ways: VecDeque<(u64, ArcPath, u64)>,
    way_mass_kg: f64,
    found: Option<(u64, FoundStretch, StretchAnswer)>,
    events: VecDeque<Event>,
    actions: Vec<Action>,
    periods: u64,
    time_ns: i64,
    last: Option<ControlCommand>,
    was_braking: bool,
    health: FlightHealth,
    is_known: bool,
    first_way_s: Option<f64>,
    ways_refused: u32,
    finished: Option<bool>,
}

impl<W, G, C> ClosedLoop<W, G, C>
where
    W: CollisionWorld,
    W::Body: Sized,
    G: GlobalPlanner<W>,
    C: Controller,
{
    /// At rest where the estimator has the robot, at `start_ns`.
    ///
    /// # Errors
    /// What the controller refuses.
    pub fn try_new(
        settings: LoopSettings<W::Body>,
        scene: Scene<W>,
        planners: (G, Box<dyn StretchPlanner>),
        mut new_controller: impl FnMut(&ModelBelief) -> Result<C, PlanningError> + 'static,
        estimator: FlightEstimator,
        start_ns: i64,
    ) -> Result<Self, PlanningError> {
        let prior = ModelBelief { revision: 0, estimate: estimator.estimate() };
        let pose = estimator.state_at(start_ns).world_from_body;
        Ok(Self {
            coordinator: Coordinator::new(settings.schedule),
            scene,
            world_revision: 0,
            way_planner: planners.0,
            stretch_planner: planners.1,
            controller: new_controller(&prior)?,
            new_controller: Box::new(new_controller),
            way_mass_kg: prior.parameters().mass,
            belief: prior.clone(),
            prior,
            next_belief_ns: start_ns + settings.belief_period_ns,
            flown: Flown::only(MissionMotion::resting(pose, seconds(start_ns)), 0),
            braking_until_s: None,
            answers: VecDeque::new(),
            ways: VecDeque::new(),
            found: None,
            events: VecDeque::from([Event::Begun]),
            actions: Vec::new(),
            periods: 0,
            time_ns: start_ns,
            last: None,
            was_braking: false,
            health: estimator.health(),
            estimator,
            is_known: false,
            first_way_s: None,
            ways_refused: 0,
            finished: None,
            settings,
        })
    }

    /// The belief that plans are made with.
    pub fn belief(&self) -> &ModelBelief {
        &self.belief
    }

    /// The estimator.
    pub fn estimator(&self) -> &FlightEstimator {
        &self.estimator
    }

    /// The controller.
    pub fn controller(&self) -> &C {
        &self.controller
    }

    /// The newest command.
    pub fn command(&self) -> Option<&ControlCommand> {
        self.last.as_ref()
    }

    /// The newest belief that was heard of, and used or not.
    pub fn newest_revision(&self) -> u64 {
        self.coordinator.newest_revision()
    }

    /// What is being flown, at a time.
    pub fn reference(&self, time_s: f64) -> PoseReference {
        self.flown.at(time_s)
    }

    /// When the newest command was computed, ns.
    pub fn time_ns(&self) -> i64 {
        self.time_ns
    }

    /// When what is being flown comes to rest, ns.
    pub fn rests_from_ns(&self) -> i64 {
        nanoseconds(self.flown.rest_s())
    }

    /// Whether the mission is over, and the robot where it was to be.
    pub fn finished(&self) -> Option<bool> {
        self.finished
    }

    /// The robot sees another world from now on.
    ///
    /// # Errors
    /// What the world cannot answer.
    pub fn see(&mut self, scene: Scene<W>) -> Result<(), PlanningError> {
        self.scene = scene;
        self.world_revision += 1;
        let contact_ns = self.first_contact()?;
        self.events.push_back(Event::World { revision: self.world_revision, contact_ns });
        Ok(())
    }

    /// When what is being flown would hit something: each motion until the next one begins, the last one for good.
    fn first_contact(&self) -> Result<Option<i64>, PlanningError> {
        let LoopSettings { body, check_margin_m, .. } = &self.settings;
        let now_s = seconds(self.time_ns);
        let motions = std::iter::once(&self.flown.now).chain(self.flown.next.iter().map(|(_, motion, _)| motion));
        let ends = self.flown.next.iter().map(|(start_ns, ..)| seconds(*start_ns)).chain([f64::INFINITY]);
        for (motion, end_s) in motions.zip(ends) {
            let from_s = now_s.max(motion.start_s());
            let contact_s = motion.first_contact(&self.scene.world, body, from_s, *check_margin_m)?;
            if let Some(contact_s) = contact_s.filter(|contact_s| *contact_s < end_s) {
                return Ok(Some(nanoseconds(contact_s)));
            }
        }
        Ok(None)
    }

    /// The computer was off for a moment: what was on its way is lost, the belief is not.
    pub fn restart(&mut self) {
        self.answers.clear();
        self.found = None;
        self.events.push_back(Event::Restarted);
    }

    /// Overwrites what the estimator takes the body for, as a fault would.
    ///
    /// # Errors
    /// An estimate that is none.
    pub fn mislead(&mut self, estimate: &Estimate) -> Result<(), IdentificationError> {
        self.estimator.restart(estimate)
    }

    /// The wrench for the next control period.
    ///
    /// # Errors
    /// What cannot be answered by a fallback: a world or a body that is none.
    pub fn step(
        &mut self,
        sensed: &Sensed<'_>,
        observer: &mut dyn LoopObserver,
    ) -> Result<ControlCommand, PlanningError> {
        self.sense(sensed, observer);
        self.receive();
        if self.time_ns >= self.next_belief_ns {
            self.next_belief_ns = self.time_ns + self.settings.belief_period_ns;
            self.believe();
        }
        self.flown.advance(self.time_ns);
        let is_decision = self.periods.is_multiple_of(self.settings.decision_periods.max(1));
        if is_decision {
            let standing = self.standing();
            self.events.push_back(Event::Tick(standing));
        }
        self.periods += 1;
        self.coordinate(observer)?;
        self.control(observer)
    }

    fn sense(&mut self, sensed: &Sensed<'_>, observer: &mut dyn LoopObserver) {
        self.estimator.acted(self.time_ns, sensed.time_ns, &sensed.acted);
        self.time_ns = sensed.time_ns;
        for measurement in sensed.measurements {
            observer.begins(Layer::Estimator);
            let reception = self.estimator.measured(measurement);
            observer.ends(Layer::Estimator);
            observer.received(self.time_ns, &reception);
            if matches!(reception, Reception::Relocalised) {
                self.events.push_back(Event::Relocalised);
            }
        }
        let health = self.estimator.health();
        if health.diverged && !self.health.diverged {
            self.events.push_back(Event::Diverged);
        }
        if health.body_doubtful && !self.health.body_doubtful {
            self.events.push_back(Event::BodyDoubtful);
        }
        self.health = health;
    }

    /// Answers whose time has come.
    fn receive(&mut self) {
        while let Some(at) = self.answers.iter().position(|(due_ns, _)| *due_ns <= self.time_ns)
            && let Some((_, answer)) = self.answers.remove(at)
        {
            match answer {
                Answer::Way { request, way: Some((way, model_revision)), world_revision } => {
                    if self.ways.len() == WAYS {
                        self.ways.pop_front();
                    }
                    self.ways.push_back((request, way, model_revision));
                    self.events.push_back(Event::WayFound { request, model_revision, world_revision });
                }
                Answer::Way { request, way: None, .. } => self.events.push_back(Event::WayRefused { request }),
                Answer::Stretch { request, found: Some(found) } => {
                    let (stretch, answer) = *found;
                    self.found = Some((request, stretch, answer));
                    self.events.push_back(Event::StretchFound { request, stretch });
                }
                Answer::Stretch { request, found: None } => self.events.push_back(Event::StretchRefused { request }),
            }
        }
    }

    fn believe(&mut self) {
        let Self { settings, estimator, .. } = self;
        let is_known = settings.known.as_ref().is_some_and(|known| estimator.is_known_well_enough(known));
        if is_known != self.is_known {
            self.is_known = is_known;
            self.events.push_back(Event::Known(is_known));
        }
        if !self.settings.feedback {
            return;
        }
        let estimate = self.estimator.estimate();
        let mass_kg = estimate.parameters.mass;
        let is_material = (mass_kg - self.way_mass_kg).abs() > self.settings.material_change * self.way_mass_kg;
        let revision = self.belief.revision + 1;
        self.belief = ModelBelief { revision, estimate };
        self.events.push_back(Event::Belief { revision, is_material });
    }

    fn standing(&self) -> Standing {
        let time_s = seconds(self.time_ns);
        let state = self.estimator.state_at(self.time_ns);
        let wanted = self.flown.at(time_s).state;
        let (pose, goal) = (state.world_from_body, &self.settings.goal);
        let turned = |to: &UnitQuaternion<f64>| angle(&pose.rotation, to);
        let near = &self.settings.at_goal;
        let is_at_goal = distance(&pose.translation.vector, &goal.position) <= near.distance_m
            && goal.attitude.is_none_or(|attitude| turned(&attitude) <= near.angle_rad)
            && length(&state.twist_body.linear) <= near.speed_m_s
            && length(&state.twist_body.angular) <= near.rate_rad_s;
        Standing {
            state_age_ns: self.time_ns - self.estimator.newest_stamp_ns(),
            deviation_m: distance(&pose.translation.vector, &wanted.world_from_body.translation.vector),
            deviation_rad: turned(&wanted.world_from_body.rotation),
            rest_ns: nanoseconds(self.flown.rest_s()),
            is_at_goal,
            used_revision: self.last.map_or(0, |command| command.model_revision),
        }
    }

    /// Tells the coordinator all that happened, and does what it says, until nothing is left.
    fn coordinate(&mut self, observer: &mut dyn LoopObserver) -> Result<(), PlanningError> {
        while let Some(event) = self.events.pop_front() {
            let timed = TimedEvent { time_ns: self.time_ns, event };
            observer.heard(&timed);
            let mut actions = std::mem::take(&mut self.actions);
            self.coordinator.handle(&timed, &mut actions);
            for action in actions.drain(..) {
                observer.answered(self.time_ns, &action);
                self.act(action, observer)?;
            }
            self.actions = actions;
        }
        Ok(())
    }

    fn act(&mut self, action: Action, observer: &mut dyn LoopObserver) -> Result<(), PlanningError> {
        let time_s = seconds(self.time_ns);
        match action {
            Action::PlanWay { request, start_ns, from } => self.plan_way(request, start_ns, from, observer)?,
            Action::PlanStretch { request, start_ns, way, way_start_ns, ambition } => {
                self.plan_stretch((request, start_ns), (way, way_start_ns), ambition, observer)?;
            }
            Action::Follow { request } => {
                if let Some((_, found, answer)) = self.found.take_if(|(of, ..)| *of == request) {
                    observer.follows(self.time_ns, found.start_ns, &answer, found.model_revision);
                    self.flown.next.push_back((found.start_ns, answer.motion, found.model_revision));
                    self.flown.advance(self.time_ns);
                }
            }
            Action::Stop => self.stop_from(&self.flown.at(time_s).state)?,
            Action::HoldHere => self.hold_here()?,
            Action::Offer { .. } => {
                observer.offered(self.time_ns, &self.belief);
                let adoption = self.controller.adopt(&self.belief)?;
                self.events.push_back(Event::Offered { revision: self.belief.revision, adoption });
            }
            Action::RenewController => {
                self.controller = (self.new_controller)(&self.belief)?;
            }
            Action::ResetEstimator => {
                self.estimator.restart(&self.prior.estimate)?;
                // nothing may be planned with what was believed before
                self.next_belief_ns = self.time_ns;
            }
            Action::WidenBelief => self.estimator.body_changed(&grasp_or_release()),
            Action::DoubtWrench => self.estimator.wrench_doubtful(),
            Action::Finish { has_arrived } => self.finished = Some(has_arrived),
            Action::Note(_) => {}
        }
        Ok(())
    }

    /// Where it comes to rest, not where it was.
    fn hold_here(&mut self) -> Result<(), PlanningError> {
        self.stop_from(&self.estimator.state_at(self.time_ns))
    }

    /// The gentle stop from a state; where it does not keep clear, the brake from where the robot is.
    fn stop_from(&mut self, state: &RigidBodyState<f64>) -> Result<(), PlanningError> {
        let time_s = seconds(self.time_ns);
        let LoopSettings { body, check_margin_m, .. } = &self.settings;
        let gentle = MissionMotion::stopping_from(state, time_s, &self.stop_limits());
        let is_clear = gentle.first_contact(&self.scene.world, body, time_s, *check_margin_m)?.is_none();
        self.flown = Flown::only(gentle, self.belief.revision);
        let braking = self.braking(&self.estimator.state_at(self.time_ns));
        self.braking_until_s = (!is_clear && !braking.is_soft).then(|| braking.until_s(time_s));
        Ok(())
    }

    /// As hard as the heaviest body that may be can stop, by what is believed now.
    fn stop_limits(&self) -> StopLimits {
        let ([mass_kg, moment], [first_mass_kg, first_moment]) =
            (self.belief.heaviest(HEAVIEST_SIGMAS), self.prior.heaviest(HEAVIEST_SIGMAS));
        let StopLimits { acceleration_m_s2, angular_acceleration_rad_s2 } = self.settings.stop;
        StopLimits {
            acceleration_m_s2: acceleration_m_s2 * first_mass_kg / mass_kg,
            angular_acceleration_rad_s2: angular_acceleration_rad_s2 * first_moment / moment,
        }
    }

    fn braking(&self, state: &RigidBodyState<f64>) -> Braking {
        self.settings.brake.braking(self.belief.parameters(), &state.twist_body)
    }

    /// The brake's wrench, which makes what is flown anew from where the robot is; none where it is off, or no longer needed: then
    /// what is left is stopped as ever.
    fn brake(&mut self, state: &RigidBodyState<f64>) -> Result<Option<Wrench<f64>>, PlanningError> {
        let Some(until_s) = self.braking_until_s else { return Ok(None) };
        let (time_s, braking) = (seconds(self.time_ns), self.braking(state));
        if braking.is_soft || time_s >= until_s {
            self.stop_from(state)?;
            return Ok(None);
        }
        self.flown = Flown::only(braking.motion(state, time_s), self.belief.revision);
        Ok(Some(braking.wrench_body))
    }

    fn plan_way(
        &mut self,
        request: u64,
        start_ns: i64,
        from: StartFrom,
        observer: &mut dyn LoopObserver,
    ) -> Result<(), PlanningError> {
        if from == StartFrom::Estimate {
            self.hold_here()?;
        }
        let start_s = seconds(start_ns);
        let start = self.flown.at(start_s).state;
        let pose = start.world_from_body;
        self.way_mass_kg = self.belief.parameters().mass;
        let world_revision = self.world_revision;
        if self.settings.schedule.stretches.is_some() {
            let here = TranslationState::at_rest(pose.translation.vector);
            let horizon_s = self.stretch_planner.horizon_s();
            let resting = BodyArc::accelerated(horizon_s * 1e3, &here, Vector3::zeros(), pose.rotation);
            let way = Some((ArcPath::new([resting]), self.belief.revision));
            self.answers.push_back((self.time_ns, Answer::Way { request, way, world_revision }));
            return Ok(());
        }
        // what was flown may end nearer to something, or farther out, than a way should be planned; and a way as near as
        // may be flown is better than none
        let clearance = self.scene.world.clearance(&self.settings.body, &pose, start_s)?;
        let asked_m = if self.ways_refused == 0 { self.settings.margin_m } else { self.settings.check_margin_m };
        let margin_m = asked_m.min(START_SHARE * clearance.distance_m).max(0.0);
        let mut limits = self.settings.limits;
        limits.position.lower_world = limits.position.lower_world.inf(&pose.translation.vector);
        limits.position.upper_world = limits.position.upper_world.sup(&pose.translation.vector);
        let velocity = pose.rotation * start.twist_body.linear;
        limits.speed_m_s = limits.speed_m_s.sup(&velocity.abs());
        let asked = GlobalRequest {
            world: &self.scene.world,
            body: &self.settings.body,
            start: TranslationState { position: pose.translation.vector, velocity },
            attitude: pose.rotation,
            start_s,
            goal: self.settings.goal,
            limits,
            belief: &self.belief,
            objective: self.settings.objective,
            margin_m,
            until: Until::BudgetSpent,
            seed: draw(self.settings.seed, request),
        };
        let known = self.ways.back().filter(|_| self.ways_refused == 0);
        let layer = if known.is_some() { Layer::NewWay } else { Layer::Way };
        observer.begins(layer);
        let answer = match known {
            Some((_, known, _)) => {
                self.way_planner.plan_anew(&asked, known, &mut Units::new(self.settings.new_way_units))
            }
            None => self.way_planner.plan(&asked, &mut Units::new(self.settings.way_units)),
        };
        observer.ends(layer);
        let (way, units) = match answer {
            Ok(answer) => {
                observer.planned_way(self.time_ns, request, &answer);
                let found = answer.plan.filter(|plan| !plan.trajectory.arcs().is_empty());
                self.ways_refused = if found.is_some() { 0 } else { self.ways_refused + 1 };
                (found.map(|plan| (plan.trajectory, plan.model_revision)), answer.units)
            }
            // a start beyond what can be asked: no way from here
            Err(error) => {
                observer.refused(self.time_ns, request, &error);
                (None, 0)
            }
        };
        let fault = observer.planner_fault(request);
        let way = way.filter(|_| fault != PlannerFault::Refused);
        let took_ns = self.took(request, units, self.settings.computing.way_unit_ns, fault);
        if fault != PlannerFault::NoAnswer {
            self.answers.push_back((self.time_ns + took_ns, Answer::Way { request, way, world_revision }));
        }
        Ok(())
    }

    fn plan_stretch(
        &mut self,
        (request, start_ns): (u64, i64),
        (way, way_start_ns): (u64, i64),
        ambition: Ambition,
        observer: &mut dyn LoopObserver,
    ) -> Result<(), PlanningError> {
        let start_s = seconds(start_ns);
        let horizon_s = self.stretch_planner.horizon_s();
        let Some((_, path, _)) = self.ways.iter().find(|(of, ..)| *of == way) else {
            self.events.push_back(Event::StretchRefused { request });
            return Ok(());
        };
        let way_start_s = seconds(way_start_ns);
        let first_way_s = *self.first_way_s.get_or_insert(way_start_s);
        let mut units = Units::new(self.settings.stretch_units);
        let answer: Result<Result<StretchAnswer, StretchRefusal>, PlanningError> = if ambition == Ambition::AlongWay {
            let until_s = (start_s + horizon_s).min(way_start_s + path.duration_s());
            Ok(Ok(StretchAnswer::along_way(path, way_start_s, start_s, until_s)))
        } else {
            let task = StretchTask {
                start: self.flown.at(start_s).state,
                start_s,
                way: path,
                way_start_s,
                belief: &self.belief,
                surroundings: &self.scene.surroundings,
                is_informative: ambition == Ambition::Informative,
                elapsed_s: (start_s - first_way_s).max(0.0),
            };
            observer.begins(Layer::Stretch);
            let answer = self.stretch_planner.plan(&task, &mut units);
            observer.ends(Layer::Stretch);
            answer
        };
        let fault = observer.planner_fault(request);
        let found = match answer {
            Ok(Ok(answer)) if fault != PlannerFault::Refused => Some(Box::new(self.checked(start_ns, answer)?)),
            Err(error) => {
                observer.refused(self.time_ns, request, &error);
                None
            }
            Ok(_) => None,
        };
        let took_ns = self.took(request, units.spent(), self.settings.computing.stretch_unit_ns, fault);
        if fault != PlannerFault::NoAnswer {
            self.answers.push_back((self.time_ns + took_ns, Answer::Stretch { request, found }));
        }
        Ok(())
    }

    /// With the stop after it, and whether both keep clear.
    fn checked(
        &self,
        start_ns: i64,
        mut answer: StretchAnswer,
    ) -> Result<(FoundStretch, StretchAnswer), PlanningError> {
        answer.motion = answer.motion.with_stop(&self.stop_limits());
        let contact = answer.motion.first_contact(
            &self.scene.world,
            &self.settings.body,
            seconds(start_ns),
            self.settings.check_margin_m,
        )?;
        let position = &self.settings.limits.position;
        let slack = Vector3::repeat(self.settings.margin_m - self.settings.check_margin_m);
        let (lower, upper) = (position.lower_world - slack, position.upper_world + slack);
        let is_inside = |point: &Vector3<f64>| point.sup(&lower) == *point && point.inf(&upper) == *point;
        let found = FoundStretch {
            start_ns,
            // the last one is over when it has arrived
            end_ns: nanoseconds(answer.arrival_s.unwrap_or(answer.motion.end_s())),
            model_revision: self.belief.revision,
            world_revision: self.world_revision,
            is_last: answer.is_last,
            is_clear: contact.is_none() && answer.motion.points(1.0).iter().all(is_inside),
        };
        Ok((found, answer))
    }

    fn took(&self, request: u64, units: u64, unit_ns: i64, fault: PlannerFault) -> i64 {
        let chance = (draw(self.settings.seed ^ 0x7469_6d65, request) >> 11) as f64 / (1_u64 << 53) as f64;
        let longer = 1.0 + self.settings.computing.jitter * chance;
        let factor = if let PlannerFault::Late(factor) = fault { factor } else { 1.0 };
        #[allow(clippy::cast_possible_truncation)] // saturates
        let took_ns = (units as f64 * unit_ns as f64 * longer * factor) as i64;
        took_ns.max(0)
    }

    fn control(&mut self, observer: &mut dyn LoopObserver) -> Result<ControlCommand, PlanningError> {
        observer.begins(Layer::Control);
        let state = self.estimator.state_at(self.time_ns);
        if let Some(wrench_body) = self.brake(&state)? {
            // the belief it names is that of the controller, which takes over again
            let unnamed = ControlCommand { wrench_body, model_revision: 0, fallback: None, mass: None };
            let command = ControlCommand { wrench_body, fallback: None, ..self.last.unwrap_or(unnamed) };
            observer.ends(Layer::Control);
            self.last = Some(command);
            return Ok(command);
        }
        let trajectory: &dyn ReferenceMotion = &self.flown;
        let plan = Plan { trajectory, model_revision: self.flown.model_revision };
        let request = ControlRequest { time_s: seconds(self.time_ns), state: &state, plan: &plan };
        let mut command = self.controller.command(&request)?;
        if let Some(asked) = self.estimator.compensated(&command.wrench_body) {
            command.wrench_body = self.settings.brake.within(&asked);
        }
        observer.ends(Layer::Control);
        let is_braking = matches!(command.fallback, Some(Fallback::Braking(_)));
        if is_braking && !self.was_braking {
            self.events.push_back(Event::Braking);
        }
        self.was_braking = is_braking;
        self.last = Some(command);
        Ok(command)
    }
}

/// Seconds of a mission time.
fn seconds(time_ns: i64) -> f64 {
    time_ns as f64 * 1e-9
}

/// The nearest nanosecond.
fn nanoseconds(time_s: f64) -> i64 {
    #[allow(clippy::cast_possible_truncation)] // saturates, far beyond any mission
    let time_ns = nalgebra::ComplexField::round(time_s * 1e9) as i64;
    time_ns
}

fn length(vector: &Vector3<f64>) -> f64 {
    f64::sqrt(vector.norm_squared())
}

fn distance(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    length(&(a - b))
}

fn angle(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    let turn: Vector3<f64> = LieGroup::log(&(a.inverse() * b));
    length(&turn)
}

/// A number that follows from two, and looks like chance.
fn draw(seed: u64, number: u64) -> u64 {
    let mut mixed = seed.wrapping_add(number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}
