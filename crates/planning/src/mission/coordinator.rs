//! Who does what when: a state machine without geometry, clock or planner.

use super::event::{Action, Ambition, Event, FoundStretch, Note, Standing, StartFrom, TimedEvent};
use crate::control::Adoption;

/// Times and limits by which the coordinator decides, ns, m, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    /// From asking for a way to its start, where the robot rests.
    pub way_lead_ns: i64,
    /// From asking for a stretch to its start.
    pub stretch_lead_ns: i64,
    /// Least time that a second attempt at a stretch needs.
    pub retry_lead_ns: i64,
    /// From a failure to the next attempt.
    pub pause_ns: i64,
    /// How long after the time that it was asked for an answer is still waited for at rest; and there, after the age below, for an estimator
    /// that tells no motion.
    pub patience_ns: i64,
    /// Age of the newest measurement, or of the last motion that the estimator told, beyond which the robot stops.
    pub blind_after_ns: i64,
    /// Distance and angle from what is flown beyond which a plan has lost its meaning.
    pub astray: (f64, f64),
    /// How long the robot must be at its goal.
    pub dwell_ns: i64,
    /// How long after the end of the last stretch the robot may take to get there.
    pub settle_ns: i64,
    /// When the mission is given up.
    pub longest_ns: i64,
    /// Contradicted beliefs in a row after which the controller begins anew.
    pub contradictions: u32,
    /// Time after which a belief that is not used is offered again.
    pub offer_again_ns: i64,
    /// Time within which doubts of the body are one, and those that come again doubts of the actuators.
    pub doubt_ns: i64,
    /// Stretches after which a mission that only learns is over; `None` where there is a goal.
    pub stretches: Option<u32>,
}

impl Default for Schedule {
    fn default() -> Self {
        const SECOND: i64 = 1_000_000_000;
        Self {
            way_lead_ns: SECOND,
            stretch_lead_ns: 7 * SECOND,
            retry_lead_ns: 2 * SECOND,
            pause_ns: 2 * SECOND,
            patience_ns: 5 * SECOND,
            blind_after_ns: SECOND,
            astray: (0.15, 0.35),
            dwell_ns: 2 * SECOND,
            settle_ns: 12 * SECOND,
            longest_ns: 300 * SECOND,
            contradictions: 3,
            offer_again_ns: 4 * SECOND,
            doubt_ns: 30 * SECOND,
            stretches: None,
        }
    }
}

/// What the robot is doing.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Before the first event.
    Idle,
    /// Stopping or at rest; from then on a way is asked for.
    Resting { ask_from_ns: i64, from: StartFrom },
    /// At rest, a way is being planned.
    AwaitingWay,
    /// At rest, the first stretch of a way is being planned; what it was asked as.
    AwaitingFirst,
    /// Along stretches.
    Flying(FoundStretch),
    /// Over.
    Done,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Asked {
    request: u64,
    start_ns: i64,
    ambition: Ambition,
    world_revision: u64,
}

/// Decides; see the [module](super).
///
/// Every request has a number, and only the newest of its kind is answered to. A stretch is flown only if it came before its start,
/// keeps clear with the stop after it, and was checked in the present world. Beliefs only ever get newer, and each is offered to the
/// controller until it, or a newer one, is used.
///
/// # Source
/// Thesis 6.3; what it repairs: `Phase` has no state in which a plan is flown beyond its end, and no message can set a revision back.
#[allow(clippy::struct_excessive_bools)] // each says something else, all combinations occur
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinator {
    schedule: Schedule,
    now_ns: i64,
    begun_ns: i64,
    phase: Phase,
    requests: u64,
    way: Option<Asked>,
    stretch: Option<Asked>,
    /// The newest way, by its request, and when it begins.
    flown_way: Option<(u64, i64)>,
    way_is_stale: bool,
    world_revision: u64,
    newest: u64,
    offered_ns: i64,
    contradictions: u32,
    wants_new_controller: bool,
    /// A stop that was planned for another body is to be planned anew with the next belief.
    stops_anew: bool,
    is_known: bool,
    is_blind: bool,
    doubted_ns: i64,
    actuators_disagree: bool,
    /// Thrust is no reason for the last doubt of the body.
    is_thrust_acquitted: bool,
    arrived_since_ns: Option<i64>,
    flown: u32,
}

impl Coordinator {
    /// Before the mission.
    pub fn new(schedule: Schedule) -> Self {
        Self {
            schedule,
            now_ns: i64::MIN,
            begun_ns: 0,
            phase: Phase::Idle,
            requests: 0,
            way: None,
            stretch: None,
            flown_way: None,
            way_is_stale: false,
            world_revision: 0,
            newest: 0,
            offered_ns: i64::MIN,
            contradictions: 0,
            wants_new_controller: false,
            stops_anew: false,
            is_known: false,
            is_blind: false,
            doubted_ns: i64::MIN,
            actuators_disagree: false,
            is_thrust_acquitted: false,
            arrived_since_ns: None,
            flown: 0,
        }
    }

    /// Newest belief that was heard of.
    pub fn newest_revision(&self) -> u64 {
        self.newest
    }

    /// Whether the mission is over.
    pub fn is_done(&self) -> bool {
        self.phase == Phase::Done
    }

    /// Answers an event; the same events give the same answers.
    pub fn handle(&mut self, timed: &TimedEvent, actions: &mut Vec<Action>) {
        if timed.time_ns < self.now_ns {
            // an answer may still be the one that is waited for; everything else is told again
            if !matches!(timed.event, Event::Belief { .. }) {
                actions.push(Action::Note(Note::Stale));
                return;
            }
        }
        self.now_ns = self.now_ns.max(timed.time_ns);
        if self.phase == Phase::Done {
            return;
        }
        match timed.event {
            Event::Begun => self.begin(actions),
            Event::Tick(standing) => self.tick(&standing, actions),
            Event::Belief { revision, is_material } => self.believe(revision, is_material, actions),
            Event::Offered { revision, adoption } => self.offered(revision, adoption, actions),
            Event::Known(is_known) => self.is_known = is_known,
            Event::WayFound { request, world_revision, .. } => self.way_found(request, world_revision, actions),
            Event::WayRefused { request } => self.way_refused(request, actions),
            Event::WayImpossible { request, world_revision } => self.no_way(request, world_revision, actions),
            Event::StretchFound { request, stretch } => self.stretch_found(request, stretch, actions),
            Event::StretchRefused { request } => self.stretch_refused(request, actions),
            Event::World { revision, contact_ns } => self.world(revision, contact_ns, actions),
            Event::Relocalised => self.hold_here(Note::Astray, actions),
            Event::Braking => self.braking(actions),
            Event::Diverged => {
                actions.extend([Action::Note(Note::Diverged), Action::ResetEstimator]);
                // Another body was tried, and it explains the motion no better; unless thrust does so still less.
                if self.is_doubted_again() {
                    if core::mem::take(&mut self.is_thrust_acquitted) {
                        actions.push(Action::WidenBelief);
                    } else {
                        self.doubt_actuators(actions);
                    }
                }
                self.wants_new_controller = true;
                self.stop_by(Action::Brake, actions);
            }
            Event::BodyDoubtful => self.doubt(actions),
            Event::ThrustAcquitted(acquitted) => self.is_thrust_acquitted = acquitted && !self.actuators_disagree,
            Event::ThrustDoubtful => {
                self.is_thrust_acquitted = false;
                actions.push(Action::Note(Note::ActuatorsDisagree));
                self.doubt_actuators(actions);
            }
            Event::Restarted => {
                self.wants_new_controller = true;
                self.hold_here(Note::Restarted, actions);
            }
        }
    }

    /// Whether the body was doubted a short while ago.
    fn is_doubted_again(&self) -> bool {
        self.now_ns < self.doubted_ns.saturating_add(self.schedule.doubt_ns)
    }

    /// Once and for good.
    fn doubt_actuators(&mut self, actions: &mut Vec<Action>) {
        if !self.actuators_disagree {
            (self.actuators_disagree, self.stops_anew) = (true, true);
            actions.push(Action::DoubtWrench);
        }
    }

    /// A body does not change twice within seconds: the second time it is the actuators, and after that it is known; unless no thrust explains what was
    /// seen: then the body was learned wrongly.
    fn doubt(&mut self, actions: &mut Vec<Action>) {
        let is_acquitted = core::mem::take(&mut self.is_thrust_acquitted);
        if self.is_doubted_again() && !is_acquitted {
            actions.push(Action::Note(Note::ActuatorsDisagree));
            self.doubt_actuators(actions);
            return;
        }
        if !self.is_doubted_again() {
            self.doubted_ns = self.now_ns;
        }
        actions.extend([Action::Note(Note::BodyDoubtful), Action::WidenBelief]);
        self.wants_new_controller = true;
        self.stop(actions);
    }

    fn begin(&mut self, actions: &mut Vec<Action>) {
        if self.phase != Phase::Idle {
            actions.push(Action::Note(Note::Stale));
            return;
        }
        self.begun_ns = self.now_ns;
        self.ask_for_way(self.now_ns + self.schedule.way_lead_ns, StartFrom::Reference, actions);
        self.phase = Phase::AwaitingWay;
    }

    fn next_request(&mut self) -> u64 {
        self.requests += 1;
        self.requests
    }

    fn ask_for_way(&mut self, start_ns: i64, from: StartFrom, actions: &mut Vec<Action>) {
        let request = self.next_request();
        let world_revision = self.world_revision;
        self.way = Some(Asked { request, start_ns, ambition: Ambition::Informative, world_revision });
        self.way_is_stale = false;
        actions.push(Action::PlanWay { request, start_ns, from });
    }

    fn ask_for_stretch(&mut self, start_ns: i64, ambition: Ambition, actions: &mut Vec<Action>) {
        let Some((way, way_start_ns)) = self.flown_way else { return };
        let request = self.next_request();
        let world_revision = self.world_revision;
        self.stretch = Some(Asked { request, start_ns, ambition, world_revision });
        actions.push(Action::PlanStretch { request, start_ns, way, way_start_ns, ambition });
    }

    fn first_ambition(&self) -> Ambition {
        if self.is_known { Ambition::Plain } else { Ambition::Informative }
    }

    fn rest(&mut self, from: StartFrom, pause_ns: i64) {
        (self.way, self.stretch, self.flown_way) = (None, None, None);
        self.arrived_since_ns = None;
        self.phase = Phase::Resting { ask_from_ns: self.now_ns + pause_ns, from };
    }

    /// Leaves what is being flown by a stop; a stop that is being flown may be one that does not do any more.
    fn stop(&mut self, actions: &mut Vec<Action>) {
        self.stop_by(Action::Stop, actions);
    }

    fn stop_by(&mut self, action: Action, actions: &mut Vec<Action>) {
        if matches!(self.phase, Phase::Idle) {
            return;
        }
        if matches!(self.phase, Phase::Flying(_) | Phase::Resting { .. }) {
            actions.push(action);
        }
        self.rest(StartFrom::Reference, 0);
    }

    fn hold_here(&mut self, note: Note, actions: &mut Vec<Action>) {
        if matches!(self.phase, Phase::Idle) {
            return;
        }
        actions.extend([Action::Note(note), Action::HoldHere]);
        self.rest(StartFrom::Estimate, self.schedule.pause_ns);
    }

    fn braking(&mut self, actions: &mut Vec<Action>) {
        if matches!(self.phase, Phase::Flying(_)) {
            self.hold_here(Note::Astray, actions);
        }
    }

    fn believe(&mut self, revision: u64, is_material: bool, actions: &mut Vec<Action>) {
        if revision <= self.newest {
            actions.push(Action::Note(Note::Stale));
            return;
        }
        self.newest = revision;
        self.way_is_stale |= is_material;
        if std::mem::take(&mut self.stops_anew) && matches!(self.phase, Phase::Resting { .. }) {
            self.stop(actions);
        }
        self.offer(actions);
    }

    fn offer(&mut self, actions: &mut Vec<Action>) {
        self.offered_ns = self.now_ns;
        actions.push(Action::Offer { revision: self.newest });
    }

    fn offered(&mut self, revision: u64, adoption: Adoption, actions: &mut Vec<Action>) {
        if !matches!(adoption, Adoption::Contradicts { .. }) {
            self.contradictions = 0;
            return;
        }
        actions.push(Action::Note(Note::Contradiction { revision }));
        self.contradictions += 1;
        if self.contradictions >= self.schedule.contradictions && !self.wants_new_controller {
            self.wants_new_controller = true;
            self.stop(actions);
        }
    }

    fn tick(&mut self, standing: &Standing, actions: &mut Vec<Action>) {
        if self.phase == Phase::Idle {
            return;
        }
        if self.now_ns - self.begun_ns > self.schedule.longest_ns {
            actions.push(Action::Note(Note::OutOfTime));
            self.finish(false, actions);
            return;
        }
        if standing.used_revision < self.newest && self.now_ns - self.offered_ns >= self.schedule.offer_again_ns {
            self.offer(actions);
        }
        if self.look(standing, actions) {
            return;
        }
        match self.phase {
            Phase::Resting { ask_from_ns, from } => {
                if self.now_ns >= ask_from_ns && self.now_ns >= standing.rest_ns {
                    self.leave(from, actions);
                }
            }
            Phase::Flying(stretch) => self.fly(stretch, standing, actions),
            Phase::AwaitingWay => self.lose_patience(self.way, actions),
            Phase::AwaitingFirst => self.lose_patience(self.stretch, actions),
            Phase::Idle | Phase::Done => {}
        }
    }

    /// A planner that does not answer may be dead: it is asked again.
    fn lose_patience(&mut self, asked: Option<Asked>, actions: &mut Vec<Action>) {
        if let Some(asked) =
            asked.filter(|asked| self.now_ns > asked.start_ns.saturating_add(self.schedule.patience_ns))
        {
            actions.push(Action::Note(Note::Unanswered { request: asked.request }));
            self.rest(StartFrom::Reference, 0);
        }
    }

    /// Whether the robot cannot go on because it does not see, or is not where it should be.
    fn look(&mut self, standing: &Standing, actions: &mut Vec<Action>) -> bool {
        let Schedule { blind_after_ns, patience_ns, .. } = self.schedule;
        let is_untold = standing.motion_age_ns > blind_after_ns;
        let is_blind = is_untold || standing.state_age_ns > blind_after_ns;
        if is_blind != self.is_blind {
            self.is_blind = is_blind;
            actions.push(Action::Note(match (is_untold, is_blind) {
                (true, _) => Note::NoMotion,
                (false, true) => Note::Blind,
                (false, false) => Note::Seeing,
            }));
            self.stop(actions);
        }
        if is_blind {
            // measurements may come back; what is no number stays none
            let is_lost = standing.motion_age_ns > blind_after_ns.saturating_add(patience_ns);
            if is_lost && self.now_ns >= standing.rest_ns {
                self.end(true, actions);
                actions.push(Action::Abandon);
            }
            return true;
        }
        let (distance_m, angle_rad) = self.schedule.astray;
        // what is no number is astray as well
        let is_near = standing.deviation_m <= distance_m && standing.deviation_rad <= angle_rad;
        if !is_near && !matches!(self.phase, Phase::Resting { from: StartFrom::Estimate, .. }) {
            self.hold_here(Note::Astray, actions);
            return true;
        }
        false
    }

    /// From rest.
    fn leave(&mut self, from: StartFrom, actions: &mut Vec<Action>) {
        if self.wants_new_controller {
            self.wants_new_controller = false;
            self.contradictions = 0;
            actions.push(Action::RenewController);
            if self.newest > 0 {
                self.offer(actions);
            }
        }
        self.ask_for_way(self.now_ns + self.schedule.way_lead_ns, from, actions);
        self.phase = Phase::AwaitingWay;
    }

    fn fly(&mut self, stretch: FoundStretch, standing: &Standing, actions: &mut Vec<Action>) {
        if stretch.is_last {
            self.arrive(stretch, standing, actions);
            return;
        }
        let is_over = self.schedule.stretches.is_some_and(|most| self.flown >= most || self.is_known);
        if is_over {
            if self.now_ns >= standing.rest_ns {
                self.finish(true, actions);
            }
            return;
        }
        if self.now_ns >= stretch.end_ns {
            // the stop after it is being flown already
            actions.push(Action::Note(Note::RanOut));
            self.rest(StartFrom::Reference, 0);
            return;
        }
        if self.now_ns < stretch.start_ns {
            return;
        }
        let is_due = self.now_ns >= stretch.end_ns - self.schedule.stretch_lead_ns;
        if self.way_is_stale && self.way.is_none() && self.stretch.is_none() && !is_due {
            self.ask_for_way(stretch.end_ns, StartFrom::Reference, actions);
        } else if is_due && self.stretch.is_none() && self.way.is_none() {
            self.ask_for_stretch(stretch.end_ns, self.first_ambition(), actions);
        }
        if is_due && self.way.is_some() && self.now_ns >= stretch.end_ns - self.schedule.stretch_lead_ns / 2 {
            // the old way must do, if there is one
            self.way = None;
        }
    }

    fn arrive(&mut self, stretch: FoundStretch, standing: &Standing, actions: &mut Vec<Action>) {
        if self.now_ns < stretch.end_ns {
            return;
        }
        if !standing.is_at_goal {
            self.arrived_since_ns = None;
            let settle_ns = if stretch.is_to_goal { self.schedule.settle_ns } else { 0 };
            if self.now_ns >= stretch.end_ns + settle_ns {
                self.rest(StartFrom::Reference, 0);
            }
            return;
        }
        let since_ns = *self.arrived_since_ns.get_or_insert(self.now_ns);
        if self.now_ns - since_ns >= self.schedule.dwell_ns {
            self.finish(true, actions);
        }
    }

    fn finish(&mut self, has_arrived: bool, actions: &mut Vec<Action>) {
        self.end(!has_arrived, actions);
        actions.push(Action::Finish { has_arrived });
    }

    fn end(&mut self, by_stop: bool, actions: &mut Vec<Action>) {
        if matches!(self.phase, Phase::Flying(_)) && by_stop {
            actions.push(Action::Stop);
        }
        self.phase = Phase::Done;
    }

    fn way_found(&mut self, request: u64, world_revision: u64, actions: &mut Vec<Action>) {
        let Some(asked) = self.way.filter(|asked| asked.request == request) else {
            actions.push(Action::Note(Note::Unasked { request }));
            return;
        };
        self.way = None;
        if world_revision != self.world_revision {
            actions.push(Action::Note(Note::Unsafe { request }));
            self.way_is_stale = true;
            if self.phase == Phase::AwaitingWay {
                self.rest(StartFrom::Reference, 0);
            }
            return;
        }
        match self.phase {
            Phase::AwaitingWay => {
                // at rest a way begins when its first stretch can
                let start_ns = self.now_ns + self.schedule.retry_lead_ns;
                self.flown_way = Some((request, start_ns));
                self.ask_for_stretch(start_ns, self.first_ambition(), actions);
                self.phase = Phase::AwaitingFirst;
            }
            Phase::Flying(stretch) if asked.start_ns == stretch.end_ns => {
                // its first stretch is asked for when it is due: what is learned until then is planned with
                self.flown_way = Some((request, asked.start_ns));
                self.stretch = None;
            }
            _ => actions.push(Action::Note(Note::TooLate { request })),
        }
    }

    fn way_refused(&mut self, request: u64, actions: &mut Vec<Action>) {
        let Some(_) = self.way.filter(|asked| asked.request == request) else {
            actions.push(Action::Note(Note::Unasked { request }));
            return;
        };
        self.way = None;
        actions.push(Action::Note(Note::Refused { request }));
        if self.phase == Phase::AwaitingWay {
            self.rest(StartFrom::Reference, self.schedule.pause_ns);
        }
    }

    /// What does not exist need not be asked for again, unless the world has changed since.
    fn no_way(&mut self, request: u64, world_revision: u64, actions: &mut Vec<Action>) {
        let is_wanted = self.way.is_some_and(|asked| asked.request == request);
        if is_wanted && world_revision == self.world_revision {
            self.end(true, actions);
            actions.push(Action::GiveUp { request });
        } else {
            self.way_refused(request, actions);
        }
    }

    fn stretch_found(&mut self, request: u64, stretch: FoundStretch, actions: &mut Vec<Action>) {
        let Some(asked) = self.stretch.filter(|asked| asked.request == request) else {
            actions.push(Action::Note(Note::Unasked { request }));
            return;
        };
        let is_late = self.now_ns > stretch.start_ns || stretch.start_ns != asked.start_ns;
        let is_safe = stretch.is_clear && stretch.world_revision == self.world_revision;
        if is_late || !is_safe {
            let note = if is_late { Note::TooLate { request } } else { Note::Unsafe { request } };
            actions.push(Action::Note(note));
            self.attempt_again(&asked, actions);
            return;
        }
        self.stretch = None;
        actions.push(Action::Follow { request });
        self.flown += 1;
        self.arrived_since_ns = None;
        self.phase = Phase::Flying(stretch);
    }

    fn stretch_refused(&mut self, request: u64, actions: &mut Vec<Action>) {
        let Some(asked) = self.stretch.filter(|asked| asked.request == request) else {
            actions.push(Action::Note(Note::Unasked { request }));
            return;
        };
        actions.push(Action::Note(Note::Refused { request }));
        self.attempt_again(&asked, actions);
    }

    /// With less ambition, while there is time; else the stop after what is being flown is flown.
    fn attempt_again(&mut self, asked: &Asked, actions: &mut Vec<Action>) {
        self.stretch = None;
        let is_first = self.phase == Phase::AwaitingFirst;
        let next = match asked.ambition {
            Ambition::Informative => Some(Ambition::Plain),
            Ambition::Plain if is_first => Some(Ambition::AlongWay),
            Ambition::Plain | Ambition::AlongWay => None,
        };
        let has_time = asked.start_ns - self.now_ns >= self.schedule.retry_lead_ns;
        match next {
            Some(ambition) if is_first => {
                // nothing moves: the start can wait
                let start_ns = self.now_ns + self.schedule.retry_lead_ns;
                self.flown_way = self.flown_way.map(|(way, _)| (way, start_ns));
                self.ask_for_stretch(start_ns, ambition, actions);
            }
            Some(ambition) if has_time => self.ask_for_stretch(asked.start_ns, ambition, actions),
            _ if is_first => self.rest(StartFrom::Reference, self.schedule.pause_ns),
            _ => {
                // too late or to no avail: the next way begins where the stop ends
                self.flown_way = None;
            }
        }
    }

    fn world(&mut self, revision: u64, contact_ns: Option<i64>, actions: &mut Vec<Action>) {
        if revision <= self.world_revision {
            actions.push(Action::Note(Note::Stale));
            return;
        }
        self.world_revision = revision;
        self.way_is_stale = true;
        if contact_ns.is_some() {
            actions.push(Action::Note(Note::Obstacle));
            self.stop(actions);
            return;
        }
        // what is being planned is planned in a world that is no more
        (self.way, self.stretch) = (None, None);
        if matches!(self.phase, Phase::AwaitingWay | Phase::AwaitingFirst) {
            self.rest(StartFrom::Reference, 0);
        }
    }
}
