//! Every law of controllers holds for sound controllers and catches a deliberately broken one, by name, which keeps the others.

use crate::control_cases::{at, belief, body, case, heavier, held, limits, quintic, small};
use core::cell::Cell;
use tumble_planning::control::{
    Adoption, ControlCommand, ControlRequest, Controller, Fallback, FallbackReason, PoseTracking, ReferenceMotion,
};
use tumble_planning::dynamics::{Actuation, ConstantWorldWrench, FreeFlyer, PoseReference, PoseTracker, WrenchBox};
use tumble_planning::laws::{ControllerPromise, LawViolation, TrackingError, broken_controller_laws, other_worlds};
use tumble_planning::lie::{Pose, Wrench};
use tumble_planning::nalgebra::Vector3;
use tumble_planning::{ModelBelief, Plan, PlanningError};

/// A plan followed upright; one that comes back from afar; one pushed about by no more than promised while beliefs change.
fn judged<C: Controller>(new: &dyn Fn() -> C) -> Vec<LawViolation> {
    let within = |position_m| TrackingError { position_m, angle_rad: f64::INFINITY, ..small() };
    let plan = quintic(Vector3::new(1.0, -2.0, 0.5), Vector3::new(1.9, -2.2, 0.7), 0.0, 20.0);
    let known = [(0.0, belief(4, body(), 0.1))];
    let mut follows = case("follows", &plan);
    (follows.beliefs, follows.followed) = (&known, Some((0.0, within(0.004))));

    let hold = held(Pose::translation(0.4, 0.1, -0.3));
    let mut far = case("far", &hold);
    far.start = at(Pose::translation(2.4, -0.9, 0.3));
    (far.outputs, far.followed) = (600, Some((55.0, within(0.005))));

    let push = Wrench::new(Vector3::zeros(), Vector3::new(0.006, -0.006, 0.005));
    let push = ConstantWorldWrench { wrench_world: push };
    let learnt = [(0.0, belief(1, body(), 1.0)), (10.0, belief(2, heavier(1.1), 0.5)), (15.0, belief(3, body(), 0.2))];
    let mut pushed = case("pushed", &hold);
    (pushed.beliefs, pushed.disturbance, pushed.is_promised) = (&learnt, &push, true);

    let worlds = other_worlds();
    let promise = ControllerPromise {
        limits: limits(),
        tube: Some(within(0.004)),
        small: small(),
        settling_s: 20.0,
        overshoot: 1.01,
        other_worlds: &worlds,
        tolerance: 1e-9,
    };
    broken_controller_laws(new, &[follows, far, pushed], &promise)
}

/// Names of the broken laws, each once.
fn names(violations: &[LawViolation]) -> Vec<&'static str> {
    let mut names: Vec<_> = violations.iter().map(|violation| violation.law).collect();
    names.sort_unstable();
    names.dedup();
    names
}

fn tracker() -> PoseTracker {
    PoseTracker::critically_damped(FreeFlyer::new(body()), 1.0, 0.6)
}

fn sound() -> PoseTracking {
    PoseTracking::try_new(tracker(), limits()).unwrap()
}

#[test]
fn a_sound_controller_keeps_every_law() {
    let broken = judged(&sound);
    assert!(broken.is_empty(), "{broken:#?}");
}

/// A sound controller that takes its time to adopt, brakes where the reference is no number, and promises a quarter of what the limits give.
struct Deliberate {
    inner: PoseTracking,
    revision: u64,
    waiting: Option<ModelBelief>,
    asked: u32,
}

impl Deliberate {
    fn new() -> Self {
        Self { inner: sound(), revision: 0, waiting: None, asked: 0 }
    }
}

impl Controller for Deliberate {
    fn acceleration_m_s2(&self) -> [f64; 3] {
        (limits().force_limit * (0.25 / body().mass)).into()
    }

    fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        // whether it can be
        self.inner.clone().adopt(belief)?;
        let newest = self.waiting.as_ref().map_or(self.revision, |waiting| waiting.revision);
        if belief.revision > newest {
            (self.waiting, self.asked) = (Some(belief.clone()), 0);
        }
        Ok(Adoption::Postponed { kept: self.revision })
    }

    fn command(&mut self, request: &ControlRequest<'_>) -> Result<ControlCommand, PlanningError> {
        let nowhere = |_: f64| PoseReference { state: *request.state, ..held(Pose::identity())(0.0) };
        let trajectory: &dyn ReferenceMotion = &nowhere;
        // whether the state can be
        self.inner.command(&ControlRequest { plan: &Plan { trajectory, model_revision: 0 }, ..*request })?;
        self.asked += 1;
        if self.asked > 20
            && let Some(belief) = self.waiting.take()
        {
            self.inner.adopt(&belief)?;
            self.revision = belief.revision;
        }
        Ok(self.inner.command(request).unwrap_or_else(|_| ControlCommand {
            wrench_body: Wrench::new(Vector3::zeros(), request.state.twist_body.linear.map(|v| (-v).clamp(-0.1, 0.1))),
            model_revision: self.revision,
            fallback: Some(Fallback::Braking(FallbackReason::NoReference)),
            mass: None,
        }))
    }
}

#[test]
fn one_that_postpones_and_brakes_keeps_every_law_too() {
    let broken = judged(&Deliberate::new);
    assert!(broken.is_empty(), "{broken:#?}");
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    RefusesFromAfar,
    SaturatesLate,
    ForgetsRevision,
    NamesWhatIsNotKept,
    NoFeedForward,
    Soft,
    SilentAfterAdoption,
    DiffersFromFlightToFlight,
    ForceInWorldAxes,
    SlowSwell,
    Creeps,
    StartsTheWrongWay,
    WrongSignOfDamping,
    SlowRotation,
    PanicsOnNoNumber,
    AnswersNoNumber,
    CountsRefusals,
    SilentAboutReference,
    TakesAnyBody,
    NamesRefusedBelief,
    TakesOlderBelief,
    PromisesTooMuch,
}

/// A sound controller with a fault.
struct Faulty {
    inner: PoseTracking,
    fault: Fault,
    revision: u64,
    adoptions: u32,
    silent_for: u32,
    asked: u32,
    refused: u32,
    flight: u64,
}

thread_local! {
    static FLIGHTS: Cell<u64> = const { Cell::new(0) };
}

impl Faulty {
    fn new(fault: Fault) -> Self {
        let mut tracker = tracker();
        let mut limits = limits();
        match fault {
            Fault::SaturatesLate => {
                limits = WrenchBox { force_limit: limits.force_limit * 1.001, ..limits };
            }
            Fault::Soft => tracker.position_stiffness *= 0.5,
            Fault::SlowRotation => tracker.rotation_stiffness *= 0.15,
            _ => {}
        }
        let flight = FLIGHTS.with(|flights| flights.replace(flights.get() + 1));
        let inner = PoseTracking::try_new(tracker, limits).unwrap();
        Self { inner, fault, revision: 0, adoptions: 0, silent_for: 0, asked: 0, refused: 0, flight }
    }
}

impl Controller for Faulty {
    fn acceleration_m_s2(&self) -> [f64; 3] {
        let times = if self.fault == Fault::PromisesTooMuch { 4.0 } else { f64::INFINITY };
        (limits().force_limit * (times / body().mass)).into()
    }

    fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        let before = self.inner.clone();
        if self.fault == Fault::NamesWhatIsNotKept && belief.revision == 2 {
            return Ok(Adoption::Contradicts { kept: 2 });
        }
        if self.fault == Fault::TakesOlderBelief && belief.revision < self.revision {
            let mut renumbered = belief.clone();
            renumbered.revision = self.revision;
            return self.inner.adopt(&renumbered);
        }
        match self.inner.adopt(belief) {
            Ok(adoption) => {
                self.adoptions += 1;
                if self.adoptions > 1 {
                    self.silent_for = 20;
                }
                if self.fault != Fault::ForgetsRevision || self.adoptions == 1 {
                    self.revision = belief.revision;
                }
                Ok(adoption)
            }
            Err(_) if self.fault == Fault::TakesAnyBody => {
                self.inner = before;
                Ok(Adoption::Adopted)
            }
            Err(error) => {
                if self.fault == Fault::NamesRefusedBelief && belief.revision > self.revision {
                    self.revision = belief.revision;
                }
                Err(error)
            }
        }
    }

    fn command(&mut self, request: &ControlRequest<'_>) -> Result<ControlCommand, PlanningError> {
        let Self { fault, .. } = *self;
        let state = request.state;
        if fault == Fault::RefusesFromAfar && state.world_from_body.translation.x > 2.0 {
            return Err(PlanningError::NoBelief);
        }
        assert!(fault != Fault::PanicsOnNoNumber || !state.twist_body.linear.z.is_nan(), "not a number");
        let unmoved = |time_s: f64| {
            let mut reference = request.plan.trajectory.at(time_s);
            if fault == Fault::NoFeedForward {
                reference.acceleration.acceleration_origin_body *= 0.0;
            }
            if fault == Fault::WrongSignOfDamping {
                let wrong = (reference.state.twist_body.linear - state.twist_body.linear) * -1.5;
                reference.state.twist_body.linear += wrong;
            }
            reference
        };
        let trajectory: &dyn ReferenceMotion = &unmoved;
        let plan = Plan { trajectory, model_revision: request.plan.model_revision };
        let mut command = match self.inner.command(&ControlRequest { plan: &plan, ..*request }) {
            Ok(command) => command,
            Err(_) if fault == Fault::AnswersNoNumber && request.time_s.is_finite() && !finite(request) => {
                ControlCommand {
                    wrench_body: Wrench::zero(),
                    model_revision: self.revision,
                    fallback: None,
                    mass: None,
                }
            }
            Err(_) if fault == Fault::SilentAboutReference && request.time_s.is_finite() && finite(request) => {
                ControlCommand {
                    wrench_body: Wrench::zero(),
                    model_revision: self.revision,
                    fallback: None,
                    mass: None,
                }
            }
            Err(error) => {
                self.refused += 1;
                return Err(error);
            }
        };
        self.asked += 1;
        let wrench = &mut command.wrench_body;
        match fault {
            Fault::SilentAfterAdoption if self.silent_for > 0 => *wrench = Wrench::zero(),
            Fault::DiffersFromFlightToFlight => *wrench = *wrench * (1.0 - 1e-14 * (self.flight % 7) as f64),
            Fault::ForceInWorldAxes => {
                wrench.force = state.world_from_body.rotation * wrench.force;
                *wrench = limits().realize(wrench);
            }
            Fault::SlowSwell => *wrench = *wrench * (1.0 - 0.01 * f64::sin(0.1 * request.time_s).powi(2)),
            Fault::Creeps => wrench.torque.x += 1e-8,
            Fault::StartsTheWrongWay if self.asked <= 5 => *wrench = -*wrench,
            Fault::CountsRefusals => *wrench = *wrench * (1.0 - 1e-6 * f64::from(self.refused)),
            _ => {}
        }
        self.silent_for = self.silent_for.saturating_sub(1);
        command.model_revision = self.revision;
        Ok(command)
    }
}

fn finite(request: &ControlRequest<'_>) -> bool {
    let state = request.state;
    let pose = state.world_from_body;
    let numbers = pose.translation.vector.sum() + pose.rotation.coords.sum() + state.twist_body.to_vector().sum();
    numbers.is_finite()
}

#[test]
fn every_fault_is_caught_by_its_law_and_by_no_other() {
    let same = "the same requests have the same answers";
    let refused = "numbers that are not finite are refused";
    let by_one: [(Fault, &[&str]); 22] = [
        (Fault::RefusesFromAfar, &["sound requests are answered"]),
        (Fault::SaturatesLate, &["commands are finite and inside the limits"]),
        (Fault::ForgetsRevision, &["the command names its belief"]),
        (Fault::NamesWhatIsNotKept, &["what is kept is what was in use"]),
        (Fault::NoFeedForward, &["the plan is followed"]),
        (Fault::Soft, &["the error stays inside the promised tube"]),
        (Fault::SilentAfterAdoption, &["adoption never loses the guarantee"]),
        (
            Fault::DiffersFromFlightToFlight,
            &[
                "a refused belief changes nothing",
                "an older belief changes nothing",
                same,
                "what was refused changes nothing",
            ],
        ),
        (Fault::ForceInWorldAxes, &["a turned world turns nothing in body axes"]),
        (Fault::SlowSwell, &["another clock changes nothing"]),
        (Fault::Creeps, &["a reference at rest is kept"]),
        (Fault::StartsTheWrongWay, &["an error does not grow"]),
        (
            Fault::WrongSignOfDamping,
            &["an error does not grow", "the error stays inside the promised tube", "the plan is followed"],
        ),
        (Fault::SlowRotation, &["an error goes away"]),
        (Fault::PanicsOnNoNumber, &["hostile numbers do not panic"]),
        (Fault::AnswersNoNumber, &[refused]),
        (Fault::SilentAboutReference, &[refused]),
        (Fault::CountsRefusals, &["what was refused changes nothing"]),
        (Fault::TakesAnyBody, &["impossible beliefs are refused"]),
        (Fault::NamesRefusedBelief, &["a refused belief changes nothing"]),
        (Fault::TakesOlderBelief, &["an older belief changes nothing"]),
        (Fault::PromisesTooMuch, &["an acceleration that is promised is followed"]),
    ];
    for (fault, expected) in by_one {
        let found = names(&judged(&|| Faulty::new(fault)));
        println!("{fault:?}: {found:?}");
        assert_eq!(found, expected, "{fault:?}");
    }
}
