//! The layers at work: what the coordinator decides is asked for, flown and told.

use super::brake::Braking;
use super::coordinator::Coordinator;
use super::event::{Action, Event, FoundStretch, Standing, StartFrom, TimedEvent};
use super::last_motion::LastMotion;
use super::loop_settings::{LoopSettings, Scene};
use super::motion::{MissionMotion, StopLimits};
use super::office::Office;
use super::plan_request::{Asked, Found, Layer, PlanAnswer, PlanRequest, nanoseconds, seconds};
use super::serve::proof;
use super::stretch::StretchAnswer;
use crate::belief::{ModelBelief, Plan};
use crate::collision::CollisionWorld;
use crate::control::{ControlCommand, ControlRequest, Controller, Fallback, ReferenceMotion};
use crate::error::PlanningError;
use crate::global::Obstruction;
use crate::motion::ArcPath;
use nalgebra::{UnitQuaternion, Vector3};
use std::collections::VecDeque;
use std::sync::Arc;
use tumble_dynamics::{Environment, PoseReference, RigidBodyState, StoredMomentum, WrenchModel};
use tumble_identification::Estimate;
use tumble_identification::estimator::{
    Acted, Doubt, EstimatorError, Finding, InEnvironment, Measurement, StateEstimator,
};
use tumble_identification::recursive::{FlightHealth, Reception, grasp_or_release};
use tumble_lie::{LieGroup, Wrench};

/// Ways that are remembered for the stretches of them that are still to be planned.
const WAYS: usize = 4;

/// A body so many standard deviations heavier than believed still stops where a stop ends.
const HEAVIEST_SIGMAS: f64 = 3.0;

/// Share of its deceleration that a stop is planned with at least, however much else acts.
const LEAST_LEFT: f64 = 0.1;

/// Another way is worth asking for once the controller promises to follow so many times as much as when the last one was.
const FASTER: f64 = 1.1;

/// Looks on; every method does nothing unless written.
///
/// # Example
/// ```
/// use tumble_planning::ModelBelief;
/// use tumble_planning::dynamics::InertialParameters;
/// use tumble_planning::mission::LoopObserver;
///
/// /// The masses that were believed, kg.
/// #[derive(Default)]
/// struct Masses(Vec<f64>);
/// impl LoopObserver for Masses {
///     fn offered(&mut self, _time_ns: i64, belief: &ModelBelief) {
///         self.0.push(belief.parameters().mass);
///     }
/// }
/// let mut masses = Masses::default();
/// masses.offered(0, &ModelBelief::certain(1, InertialParameters::solid_box(9.5, [0.3; 3])));
/// assert_eq!(masses.0, [9.5]);
/// ```
/// Tutorial: [layers of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/custom_robot/own_layers.rs).
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
    /// A stretch is flown from its start on.
    fn follows(&mut self, time_ns: i64, start_ns: i64, stretch: &StretchAnswer, model_revision: u64) {}
    /// A belief was offered.
    fn offered(&mut self, time_ns: i64, belief: &ModelBelief) {}
    /// A measurement was used or not.
    fn received(&mut self, time_ns: i64, reception: &Reception) {}
    /// What the estimator says of the body is none; the last belief stays.
    fn disbelieved(&mut self, time_ns: i64, error: &PlanningError) {}
}

/// Looks at nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoObserver;

impl LoopObserver for NoObserver {}

/// How a mission ended.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum End {
    /// The robot is where it was to be.
    Arrived,
    /// It was not in time.
    OutOfTime,
    /// It never will be: no way leads there.
    NoWay(Obstruction),
    /// Nobody knows any more how it moves: its estimator told no motion for too long.
    NoMotion,
}

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

/// A way, by its request, and what the controller promised to follow when it was asked for.
struct KnownWay {
    request: u64,
    way: Arc<ArcPath>,
    followed_m_s2: [f64; 3],
}

/// Makes a controller for a belief.
type NewController<C> = Box<dyn FnMut(&ModelBelief) -> Result<C, PlanningError> + Send>;

/// RATTLE: coordinator, estimator and controller of one robot, without a planner: whatever the planners are, it may be moved to another
/// thread, and its longest step is estimation and control.
///
/// After each step it is asked what is to be [planned](Self::next_request); [answers](Self::answer) may come early, late, twice or
/// never. Whoever has an [`Office`] has both with [`step_with`](Self::step_with).
pub struct ClosedLoop<W, C, E>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    settings: Arc<LoopSettings<W::Body>>,
    coordinator: Coordinator,
    scene: Arc<Scene<W>>,
    world_revision: u64,
    new_controller: NewController<C>,
    controller: C,
    estimator: InEnvironment<E>,
    /// What was known of the body at first, as the estimator said it, and as planners are told.
    prior: (Finding, ModelBelief),
    belief: Arc<ModelBelief>,
    next_belief_ns: i64,
    disbelieved: u64,
    /// What acted in the last period.
    acted: Acted,
    moved: LastMotion,
    flown: Flown,
    /// Until when the brake is on, s.
    braking_until_s: Option<f64>,
    requests: VecDeque<PlanRequest<W>>,
    answers: VecDeque<PlanAnswer>,
    /// Requests up to this one were made before the computer was off.
    forgotten: u64,
    newest_request: u64,
    ways: VecDeque<KnownWay>,
    /// Of the way that was asked for last: the mass that was believed, and what the controller promised to follow.
    way_mass_kg: f64,
    way_followed_m_s2: [f64; 3],
    found: Option<(u64, FoundStretch, StretchAnswer)>,
    no_way: Option<(u64, Obstruction)>,
    events: VecDeque<Event>,
    actions: Vec<Action>,
    periods: u64,
    time_ns: i64,
    last: Option<ControlCommand>,
    was_braking: bool,
    health: FlightHealth,
    is_known: bool,
    /// Whether the targets were met since something was last doubted: they then stay met a little longer.
    were_met: bool,
    first_way_s: Option<f64>,
    ways_refused: u32,
    end: Option<End>,
}

impl<W, C, E> ClosedLoop<W, C, E>
where
    W: CollisionWorld,
    W::Body: Sized,
    C: Controller,
    E: StateEstimator,
{
    /// At rest where the estimator has the robot, at `start_ns`. `new_controller` makes a controller that counts on nothing but what
    /// a body like the believed one can be at all; it is asked now, and when the body may be anything.
    ///
    /// # Errors
    /// What the controller refuses; an estimator that knows of no body.
    pub fn try_new(
        settings: LoopSettings<W::Body>,
        scene: Scene<W>,
        mut new_controller: impl FnMut(&ModelBelief) -> Result<C, PlanningError> + Send + 'static,
        estimator: E,
        start_ns: i64,
    ) -> Result<Self, PlanningError> {
        let (finding, estimate) = body_of(&estimator)?;
        let prior = ModelBelief { revision: 0, estimate };
        let controller = new_controller(&prior)?;
        let start = motion_of(&estimator, start_ns)?;
        let pose = start.world_from_body;
        Ok(Self {
            coordinator: Coordinator::new(settings.schedule),
            scene: Arc::new(scene),
            world_revision: 0,
            way_mass_kg: prior.parameters().mass,
            way_followed_m_s2: controller.acceleration_m_s2(),
            controller,
            new_controller: Box::new(new_controller),
            belief: Arc::new(prior.clone()),
            prior: (finding, prior),
            next_belief_ns: start_ns + settings.belief_period_ns,
            disbelieved: 0,
            acted: Acted {
                from_ns: start_ns,
                until_ns: start_ns,
                wrench_body: Wrench::zero(),
                stored_body: Vector3::zeros(),
            },
            moved: LastMotion::told(start, start_ns),
            flown: Flown::only(MissionMotion::resting(pose, seconds(start_ns)), 0),
            braking_until_s: None,
            requests: VecDeque::new(),
            answers: VecDeque::new(),
            forgotten: 0,
            newest_request: 0,
            ways: VecDeque::new(),
            found: None,
            no_way: None,
            events: VecDeque::from([Event::Begun]),
            actions: Vec::new(),
            periods: 0,
            time_ns: start_ns,
            last: None,
            was_braking: false,
            health: estimator.health(),
            estimator: InEnvironment::new(estimator, settings.environment.clone()),
            is_known: false,
            were_met: false,
            first_way_s: None,
            ways_refused: 0,
            end: None,
            settings: Arc::new(settings),
        })
    }

    /// The belief that plans are made with.
    pub fn belief(&self) -> &ModelBelief {
        &self.belief
    }

    /// How often what the estimator said of the body was none, and the last belief was kept.
    pub fn disbelieved(&self) -> u64 {
        self.disbelieved
    }

    /// The estimator.
    pub fn estimator(&self) -> &E {
        self.estimator.estimator()
    }

    /// The estimator, for those who know better, or make it worse on purpose.
    pub fn estimator_mut(&mut self) -> &mut E {
        self.estimator.estimator_mut()
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

    /// How the robot moves now, as the loop takes it: as the estimator says, or where that is no motion as the last one goes on.
    pub fn state(&self) -> RigidBodyState<f64> {
        self.motion().0.state()
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

    /// How the mission ended; none before.
    pub fn end(&self) -> Option<&End> {
        self.end.as_ref()
    }

    /// Searches for a way in a row that found none, up to now.
    pub fn ways_refused(&self) -> u32 {
        self.ways_refused
    }

    /// The robot sees another world from now on.
    ///
    /// # Errors
    /// What the world cannot answer.
    pub fn see(&mut self, scene: Scene<W>) -> Result<(), PlanningError> {
        self.scene = Arc::new(scene);
        self.world_revision += 1;
        let contact_ns = self.first_contact()?;
        self.events.push_back(Event::World { revision: self.world_revision, contact_ns });
        Ok(())
    }

    /// When what is being flown would hit something: each motion until the next one begins, the last one for good.
    fn first_contact(&self) -> Result<Option<i64>, PlanningError> {
        let LoopSettings { body, check_margin_m, .. } = &*self.settings;
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
        self.requests.clear();
        self.answers.clear();
        self.forgotten = self.newest_request;
        self.found = None;
        self.events.push_back(Event::Restarted);
    }

    /// What is to be planned; to be asked after each step, until there is nothing.
    pub fn next_request(&mut self) -> Option<PlanRequest<W>> {
        self.requests.pop_front()
    }

    /// An answer, which the next step looks at: early, late, doubled, or to a question long forgotten.
    pub fn answer(&mut self, answer: PlanAnswer) {
        if answer.request > self.forgotten {
            self.answers.push_back(answer);
        }
    }

    /// A step with the answers that an office has ready before it, and its requests handed over after it.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn step_with(
        &mut self,
        office: &mut (impl Office<W> + ?Sized),
        acted: &Acted,
        measurements: &[Measurement],
        observer: &mut dyn LoopObserver,
    ) -> Result<ControlCommand, PlanningError> {
        while let Some(answer) = office.ready(acted.until_ns) {
            self.answer(answer);
        }
        let command = self.step(acted, measurements, observer)?;
        while let Some(request) = self.next_request() {
            office.take(self.time_ns, request);
        }
        Ok(command)
    }

    /// The wrench for the next control period, by what acted in the last one, until now, and by what arrived in it.
    ///
    /// # Errors
    /// What cannot be answered by a fallback: a world or a body that is none.
    pub fn step(
        &mut self,
        acted: &Acted,
        measurements: &[Measurement],
        observer: &mut dyn LoopObserver,
    ) -> Result<ControlCommand, PlanningError> {
        self.sense(acted, measurements, observer);
        self.receive();
        if self.time_ns >= self.next_belief_ns {
            self.next_belief_ns = self.time_ns + self.settings.belief_period_ns;
            self.believe(observer);
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

    fn sense(&mut self, acted: &Acted, measurements: &[Measurement], observer: &mut dyn LoopObserver) {
        self.estimator.acted(acted);
        (self.acted, self.time_ns) = (*acted, acted.until_ns);
        for measurement in measurements {
            observer.begins(Layer::Estimator);
            let reception = self.estimator.measured(measurement);
            observer.ends(Layer::Estimator);
            observer.received(self.time_ns, &reception);
            if matches!(reception, Reception::Relocalised) {
                self.events.push_back(Event::Relocalised);
            }
        }
        let health = self.estimator.health();
        if health.thrust_acquitted != self.health.thrust_acquitted {
            self.events.push_back(Event::ThrustAcquitted(health.thrust_acquitted));
        }
        if health.diverged && !self.health.diverged {
            self.events.push_back(Event::Diverged);
        }
        if health.body_doubtful && !self.health.body_doubtful {
            self.events.push_back(Event::BodyDoubtful);
        }
        if health.thrust_doubtful && !self.health.thrust_doubtful {
            self.events.push_back(Event::ThrustDoubtful);
        }
        self.health = health;
    }

    fn receive(&mut self) {
        while let Some(PlanAnswer { request, world_revision, found, .. }) = self.answers.pop_front() {
            let event = match found {
                Found::Stay(way, model_revision) => {
                    self.ways_refused = 0;
                    self.way_found(request, way, model_revision, world_revision)
                }
                Found::Retreat(_, way, model_revision) => {
                    self.ways_refused += 1;
                    self.way_found(request, way, model_revision, world_revision)
                }
                Found::Way(answer) => match answer.plan {
                    Some(Plan { trajectory, model_revision }) if !trajectory.arcs().is_empty() => {
                        self.ways_refused = 0;
                        self.way_found(request, trajectory, model_revision, world_revision)
                    }
                    _ => {
                        self.ways_refused += 1;
                        match proof(&answer) {
                            Some(obstruction) => {
                                self.no_way = Some((request, obstruction.clone()));
                                Event::WayImpossible { request, world_revision }
                            }
                            None => Event::WayRefused { request },
                        }
                    }
                },
                Found::Stretch(stretch, answer) => {
                    self.found = Some((request, stretch, *answer));
                    Event::StretchFound { request, stretch }
                }
                Found::NoStretch(_) | Found::Failed { is_stretch: true, .. } => Event::StretchRefused { request },
                // a start beyond what can be asked: no way from here
                Found::Failed { is_stretch: false, .. } => Event::WayRefused { request },
            };
            self.events.push_back(event);
        }
    }

    fn way_found(&mut self, request: u64, way: ArcPath, model_revision: u64, world_revision: u64) -> Event {
        if self.ways.len() == WAYS {
            self.ways.pop_front();
        }
        self.ways.push_back(KnownWay { request, way: Arc::new(way), followed_m_s2: self.way_followed_m_s2 });
        Event::WayFound { request, model_revision, world_revision }
    }

    /// What an estimator says is looked at before anybody plans with it; where it is no body, the last belief is kept.
    fn believe(&mut self, observer: &mut dyn LoopObserver) {
        let estimate = match body_of(&self.estimator) {
            Ok((_, estimate)) => estimate,
            Err(error) => {
                self.disbelieved += 1;
                observer.disbelieved(self.time_ns, &error);
                return;
            }
        };
        let known = self.settings.known.as_ref();
        let is_known = known.is_some_and(|targets| targets.are_met(&estimate, self.were_met));
        self.were_met = is_known;
        if is_known != self.is_known {
            self.is_known = is_known;
            self.events.push_back(Event::Known(is_known));
        }
        if !self.settings.feedback {
            return;
        }
        let mass_kg = estimate.parameters.mass;
        let promised = self.controller.acceleration_m_s2();
        let is_faster = promised.iter().zip(self.way_followed_m_s2).all(|(now, then)| *now > FASTER * then);
        let is_other = (mass_kg - self.way_mass_kg).abs() > self.settings.material_change * self.way_mass_kg;
        let revision = self.belief.revision + 1;
        self.belief = Arc::new(ModelBelief { revision, estimate });
        self.events.push_back(Event::Belief { revision, is_material: is_other || is_faster });
    }

    /// How the robot moves by what the estimator says; where that is no motion, as the last one goes on under what acted.
    fn motion(&self) -> (LastMotion, Option<PlanningError>) {
        match motion_of(&self.estimator, self.time_ns) {
            Ok(state) => (LastMotion::told(state, self.time_ns), None),
            Err(error) => {
                let moved = self.moved.carried_on(&self.acted, self.belief.parameters(), &self.environment());
                (moved, Some(error))
            }
        }
    }

    fn standing(&self) -> Standing {
        let time_s = seconds(self.time_ns);
        let (motion, _) = self.motion();
        let state = motion.state();
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
            motion_age_ns: motion.age_ns(self.time_ns),
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
            Action::PlanWay { request, start_ns, from } => self.ask_for_way(request, start_ns, from)?,
            Action::PlanStretch { request, start_ns, way, way_start_ns, ambition } => {
                let way_start_s = seconds(way_start_ns);
                match self.ways.iter().find(|known| known.request == way) {
                    Some(KnownWay { way, .. }) => {
                        let first_way_s = *self.first_way_s.get_or_insert(way_start_s);
                        let elapsed_s = (seconds(start_ns) - first_way_s).max(0.0);
                        let way = Arc::clone(way);
                        self.ask(request, start_ns, Asked::Stretch { way, way_start_ns, ambition, elapsed_s });
                    }
                    None => self.events.push_back(Event::StretchRefused { request }),
                }
            }
            Action::Follow { request } => {
                if let Some((_, found, answer)) = self.found.take_if(|(of, ..)| *of == request) {
                    observer.follows(self.time_ns, found.start_ns, &answer, found.model_revision);
                    self.flown.next.push_back((found.start_ns, answer.motion, found.model_revision));
                    self.flown.advance(self.time_ns);
                }
            }
            Action::Stop => self.stop_from(&self.flown.at(time_s).state)?,
            Action::Brake => self.stop_by_brake()?,
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
                self.estimator.restart(&self.prior.0).map_err(|error| named(&self.estimator, error))?;
                self.were_met = false;
                // nothing may be planned with what was believed before
                self.next_belief_ns = self.time_ns;
            }
            Action::WidenBelief => self.doubt(&Doubt::Body(grasp_or_release())),
            Action::DoubtWrench => {
                self.doubt(&Doubt::Wrench);
                // nothing may be planned with what was taken for another body
                self.next_belief_ns = self.time_ns;
            }
            Action::Finish { has_arrived } => self.end = Some(if has_arrived { End::Arrived } else { End::OutOfTime }),
            Action::GiveUp { request } => {
                let proof = self.no_way.take_if(|(of, _)| *of == request);
                self.end = Some(proof.map_or(End::OutOfTime, |(_, obstruction)| End::NoWay(obstruction)));
            }
            Action::Abandon => self.end = Some(End::NoMotion),
            Action::Note(_) => {}
        }
        Ok(())
    }

    fn doubt(&mut self, doubt: &Doubt) {
        self.were_met = false;
        self.estimator.doubt(doubt);
    }

    /// Where it comes to rest, not where it was.
    fn hold_here(&mut self) -> Result<(), PlanningError> {
        self.stop_from(&self.state())
    }

    /// The gentle stop from a state; where it does not keep clear, the brake from where the robot is.
    fn stop_from(&mut self, state: &RigidBodyState<f64>) -> Result<(), PlanningError> {
        let time_s = seconds(self.time_ns);
        let LoopSettings { body, check_margin_m, .. } = &*self.settings;
        let gentle = MissionMotion::stopping_from(state, time_s, &self.stop_limits());
        let is_clear = gentle.first_contact(&self.scene.world, body, time_s, *check_margin_m)?.is_none();
        (self.flown, self.braking_until_s) = (Flown::only(gentle, self.belief.revision), None);
        if !is_clear {
            self.begin_to_brake();
        }
        Ok(())
    }

    /// The brake from where the robot is, until what is left may be stopped gently.
    fn stop_by_brake(&mut self) -> Result<(), PlanningError> {
        self.hold_here()?;
        self.begin_to_brake();
        Ok(())
    }

    fn begin_to_brake(&mut self) {
        let braking = self.braking(&self.state());
        self.braking_until_s = (!braking.is_soft).then(|| braking.until_s(seconds(self.time_ns)));
    }

    /// What acts besides the actuators; that of the wheels as if their momentum stayed.
    fn environment(&self) -> Environment {
        let environment = self.settings.environment.clone();
        let momentum_body = self.acted.stored_body;
        let is_stored = momentum_body != Vector3::zeros();
        if is_stored { environment.with(StoredMomentum { momentum_body }) } else { environment }
    }

    /// What acts besides the actuators on the body that is believed; none where nothing does.
    fn beside(&self, state: &RigidBodyState<f64>) -> Option<Wrench<f64>> {
        let wheels = StoredMomentum { momentum_body: self.acted.stored_body };
        let acting = (&self.settings.environment, wheels);
        let is_none = self.settings.environment.is_empty() && wheels.momentum_body == Vector3::zeros();
        (!is_none).then(|| acting.wrench_on(self.belief.parameters(), seconds(self.time_ns), state))
    }

    /// As hard as the heaviest body that may be can stop, by what is believed now, with what is left of force and torque beside what
    /// else acts.
    fn stop_limits(&self) -> StopLimits {
        let ([mass_kg, moment], [first_mass_kg, first_moment]) =
            (self.belief.heaviest(HEAVIEST_SIGMAS), self.prior.1.heaviest(HEAVIEST_SIGMAS));
        let StopLimits { acceleration_m_s2, angular_acceleration_rad_s2 } = self.settings.stop;
        let [force, torque] =
            self.beside(&self.state()).map_or([1.0; 2], |acting| self.settings.brake.shares_left(&acting));
        StopLimits {
            acceleration_m_s2: acceleration_m_s2 * first_mass_kg / mass_kg * force.max(LEAST_LEFT),
            angular_acceleration_rad_s2: angular_acceleration_rad_s2 * first_moment / moment * torque.max(LEAST_LEFT),
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

    fn ask_for_way(&mut self, request: u64, start_ns: i64, from: StartFrom) -> Result<(), PlanningError> {
        if from == StartFrom::Estimate {
            self.hold_here()?;
        }
        (self.way_mass_kg, self.way_followed_m_s2) =
            (self.belief.parameters().mass, self.controller.acceleration_m_s2());
        let LoopSettings { schedule, margin_m, check_margin_m, .. } = &*self.settings;
        let asked = if schedule.stretches.is_some() {
            Asked::Stay
        } else if self.ways_refused == 0 {
            // one that asked for more than is promised now does not do any more
            let promised = self.way_followed_m_s2;
            let is_followed =
                |known: &&KnownWay| known.followed_m_s2.iter().zip(promised).all(|(asked, now)| *asked <= now);
            let known = self.ways.back().filter(is_followed).map(|known| Arc::clone(&known.way));
            Asked::Way { known, margin_m: *margin_m }
        } else {
            // a way as near as may be flown is better than none
            Asked::Way { known: None, margin_m: *check_margin_m }
        };
        self.ask(request, start_ns, asked);
        Ok(())
    }

    fn ask(&mut self, request: u64, start_ns: i64, asked: Asked) {
        self.newest_request = self.newest_request.max(request);
        self.requests.push_back(PlanRequest {
            request,
            asked,
            start: self.flown.at(seconds(start_ns)).state,
            start_ns,
            asked_ns: self.time_ns,
            scene: Arc::clone(&self.scene),
            world_revision: self.world_revision,
            belief: Arc::clone(&self.belief),
            environment: self.environment(),
            stop: self.stop_limits(),
            followed_m_s2: self.controller.acceleration_m_s2(),
            settings: Arc::clone(&self.settings),
        });
    }

    /// What to ask of doubted actuators for a wrench, within their limits; `None` where they are not in doubt.
    fn asked_of_doubted(&self, wanted: &Wrench<f64>) -> Option<Wrench<f64>> {
        self.settings.brake.giving_way(wanted, |wrench| self.estimator.compensated(wrench))
    }

    fn control(&mut self, observer: &mut dyn LoopObserver) -> Result<ControlCommand, PlanningError> {
        observer.begins(Layer::Control);
        let (motion, untold) = self.motion();
        if let Some(error) = untold {
            self.disbelieved += 1;
            observer.disbelieved(self.time_ns, &error);
        }
        self.moved = motion;
        let state = motion.state();
        let beside = self.beside(&state);
        let beside = beside.as_ref();
        if let Some(wrench_body) = self.brake(&state)? {
            let held = |acting: &Wrench<f64>| self.settings.brake.within(&(wrench_body - *acting));
            let wrench_body = beside.map_or(wrench_body, held);
            let wrench_body = self.asked_of_doubted(&wrench_body).unwrap_or(wrench_body);
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
        if let Some(acting) = beside {
            command.wrench_body = self.settings.brake.within(&(command.wrench_body - *acting));
        }
        if let Some(asked) = self.asked_of_doubted(&command.wrench_body) {
            command.wrench_body = asked;
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

/// What an estimator knows of the body, as it says it and as planners are told.
fn body_of<E: StateEstimator>(estimator: &E) -> Result<(Finding, Estimate), PlanningError> {
    let body = estimator.finding().and_then(|finding| Ok((finding, Estimate::try_from(&finding)?)));
    body.map_err(|error| named(estimator, error))
}

/// Motion at a time as an estimator says it, if it is one.
fn motion_of<E: StateEstimator>(estimator: &E, time_ns: i64) -> Result<RigidBodyState<f64>, PlanningError> {
    let state = estimator.state_at(time_ns);
    let RigidBodyState { world_from_body: pose, twist_body: twist } = &state;
    let numbers = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
    let twist = twist.to_vector();
    match numbers.chain(twist.iter()).enumerate().find(|(_, number)| !number.is_finite()) {
        None => Ok(state),
        Some((index, &value)) => Err(named(estimator, EstimatorError::Refused { what: "a motion", index, value })),
    }
}

/// The error with the name of whose it is.
fn named<E: StateEstimator>(estimator: &E, error: EstimatorError) -> PlanningError {
    PlanningError::foreign(estimator.name(), error)
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
