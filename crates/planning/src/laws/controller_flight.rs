//! Flying a controller, and asking it the same again.

use super::free_body::FreeBody;
use super::{LawViolation, broken_unless, require};
use crate::belief::{ModelBelief, Plan};
use crate::control::{Adoption, ControlCommand, ControlRequest, Controller, ReferenceMotion};
use crate::error::PlanningError;
use crate::vectors::largest;
use tumble_dynamics::{InertialParameters, PoseReference, RigidBodyState, WrenchModel};
use tumble_lie::Pose;

/// How far a body is from its reference; or how far it may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackingError {
    /// Distance of the origins, m.
    pub position_m: f64,
    /// Velocity of one origin seen from the other, world axes, m/s.
    pub speed_m_s: f64,
    /// Angle between the attitudes, rad.
    pub angle_rad: f64,
    /// Difference of the angular velocities, rad/s.
    pub rate_rad_s: f64,
}

impl TrackingError {
    /// Of a state from where it should be.
    pub fn of(state: &RigidBodyState<f64>, reference: &PoseReference) -> Self {
        let wanted = &reference.state;
        let (attitude, aim) = (state.world_from_body.rotation, wanted.world_from_body.rotation);
        let position = state.world_from_body.translation.vector - wanted.world_from_body.translation.vector;
        let velocity = attitude * state.twist_body.linear - aim * wanted.twist_body.linear;
        let rate = attitude * state.twist_body.angular - aim * wanted.twist_body.angular;
        Self {
            position_m: position.norm(),
            speed_m_s: velocity.norm(),
            angle_rad: attitude.angle_to(&aim),
            rate_rad_s: rate.norm(),
        }
    }

    fn entries(&self) -> [f64; 4] {
        [self.position_m, self.speed_m_s, self.angle_rad, self.rate_rad_s]
    }

    /// Largest share of a bound that is used up; an error without a bound on it, an infinite one, counts nothing.
    pub fn share_of(&self, bound: &Self) -> f64 {
        let (errors, bounds) = (self.entries(), bound.entries());
        let share = |i: usize| if errors[i] == 0.0 { 0.0 } else { errors[i] / bounds[i] };
        largest(&core::array::from_fn::<_, 4, _>(share))
    }
}

/// From the number of an output and the true state to what is measured of it.
pub type Sensor<'a> = dyn Fn(usize, &RigidBodyState<f64>) -> RigidBodyState<f64> + 'a;

/// A flight: a body, a plan, and what the controller is told on the way.
#[derive(Clone)]
pub struct ControllerCase<'a> {
    /// What it is called in reports.
    pub name: &'static str,
    /// The body that flies; it has extent in every direction.
    pub body: InertialParameters<f64>,
    /// Its state at the start.
    pub start: RigidBodyState<f64>,
    /// Mission time of the start, s.
    pub start_s: f64,
    /// What to follow; numbers at every time.
    pub plan: Plan<&'a dyn ReferenceMotion>,
    /// Beliefs in bodies that can be, revisions growing, and the mission times from which they are offered, growing too.
    pub beliefs: &'a [(f64, ModelBelief)],
    /// What acts besides the controller; `()` for nothing.
    pub disturbance: &'a dyn WrenchModel<f64>,
    /// What is measured of the true state at each output, by the number of the output; the state itself where `None`.
    pub sensor: Option<&'a Sensor<'a>>,
    /// Number of outputs.
    pub outputs: usize,
    /// Time between outputs, s.
    pub step_s: f64,
    /// Time since the start from which the error stays inside a bound.
    pub followed: Option<(f64, TrackingError)>,
    /// Whether the start, the disturbance and the beliefs are such that the promised tube holds.
    pub is_promised: bool,
}

/// One output of a flight, as an observer sees it.
#[derive(Clone, Copy)]
pub struct ControllerStep<'a> {
    /// Number of the output.
    pub output: usize,
    /// What was asked.
    pub request: ControlRequest<'a>,
    /// The true state, which the request's only measures.
    pub state: &'a RigidBodyState<f64>,
    /// Where the body should be.
    pub reference: &'a PoseReference,
    /// The answer.
    pub command: &'a ControlCommand,
    /// Revisions offered since the last output, and what became of them.
    pub offers: &'a [(u64, Adoption)],
    /// How far the true state is from the reference.
    pub error: &'a TrackingError,
}

/// Steps of the simulated body in each output.
const STEPS: u32 = 8;

/// The law that every sound request and belief is answered.
const ANSWERED: &str = "sound requests are answered";

fn refusal(name: &str, error: &PlanningError) -> LawViolation {
    LawViolation {
        law: ANSWERED,
        inputs: name.to_owned(),
        expected: "an answer".to_owned(),
        found: error.to_string(),
        error: f64::INFINITY,
        tolerance: 0.0,
    }
}

/// Flies a case and shows every output to an observer, together with the controller after it.
///
/// # Errors
/// The observer's; "sound requests are answered" where the controller refuses.
pub fn fly_controller<C: Controller + ?Sized>(
    controller: &mut C,
    case: &ControllerCase<'_>,
    observe: &mut dyn FnMut(&C, &ControllerStep<'_>) -> Result<(), LawViolation>,
) -> Result<(), LawViolation> {
    let body = FreeBody::new(&case.body, &case.start);
    require("the case has a body", &case.name, &"a body", &case.body, broken_unless(body.is_some()), 0.0)?;
    let Some(mut body) = body else { return Ok(()) };
    let mut beliefs = case.beliefs.iter().peekable();
    let mut offers = Vec::new();
    let plan = &case.plan;
    for output in 0..case.outputs {
        let time_s = case.start_s + output as f64 * case.step_s;
        offers.clear();
        while let Some((_, belief)) = beliefs.next_if(|(offered_s, _)| *offered_s <= time_s) {
            let adoption = controller.adopt(belief).map_err(|error| refusal(case.name, &error))?;
            offers.push((belief.revision, adoption));
        }
        let state = body.state();
        let measured = case.sensor.map_or(state, |sensor| sensor(output, &state));
        let request = ControlRequest { time_s, state: &measured, plan };
        let command = controller.command(&request).map_err(|error| refusal(case.name, &error))?;
        let reference = plan.trajectory.at(time_s);
        let error = TrackingError::of(&state, &reference);
        let (state, reference, command, offers, error) = (&state, &reference, &command, &offers[..], &error);
        observe(controller, &ControllerStep { output, request, state, reference, command, offers, error })?;
        let short_s = case.step_s / f64::from(STEPS);
        for step in 0..STEPS {
            let disturbance = case.disturbance.wrench_body(time_s + f64::from(step) * short_s, &body.state());
            body.step(&(command.wrench_body + disturbance), short_s);
        }
    }
    Ok(())
}

/// What was asked and answered in a flight.
pub(super) struct Flight {
    pub outputs: Vec<Output>,
}

/// One output of a flight.
#[derive(Clone, Debug)]
pub(super) struct Output {
    pub time_s: f64,
    pub measured: RigidBodyState<f64>,
    pub command: ControlCommand,
    pub offers: Vec<(u64, Adoption)>,
    pub error: TrackingError,
}

impl Flight {
    pub fn of(controller: &mut dyn Controller, case: &ControllerCase<'_>) -> Result<Self, LawViolation> {
        let mut outputs = Vec::new();
        fly_controller(controller, case, &mut |_, step| {
            outputs.push(Output {
                time_s: step.request.time_s,
                measured: *step.request.state,
                command: *step.command,
                offers: step.offers.to_vec(),
                error: *step.error,
            });
            Ok(())
        })?;
        Ok(Self { outputs })
    }

    /// Largest share of a bound that errors use up from a time since the start on.
    pub fn worst(&self, from_s: f64, bound: &TrackingError) -> (f64, Option<&Output>) {
        let start_s = self.outputs.first().map_or(0.0, |output| output.time_s);
        let mut worst = (0.0, None);
        for output in self.outputs.iter().filter(|output| output.time_s - start_s >= from_s) {
            let share = output.error.share_of(bound);
            if share > worst.0 {
                worst = (share, Some(output));
            }
        }
        worst
    }
}

/// A world seen from elsewhere, by another clock.
#[derive(Clone, Copy, Debug)]
pub(super) struct Elsewhere {
    pub there_from_here: Pose<f64>,
    pub later_s: f64,
}

impl Elsewhere {
    pub const fn moved(there_from_here: Pose<f64>) -> Self {
        Self { there_from_here, later_s: 0.0 }
    }

    pub fn later(later_s: f64) -> Self {
        Self { there_from_here: Pose::identity(), later_s }
    }

    fn state(&self, state: &RigidBodyState<f64>) -> RigidBodyState<f64> {
        RigidBodyState { world_from_body: self.there_from_here * state.world_from_body, ..*state }
    }
}

/// A command, and what became of the beliefs offered before.
pub(super) type Answer = (ControlCommand, Vec<(u64, Adoption)>);

/// Offers a flight's beliefs again.
struct Offers<'a> {
    name: &'static str,
    beliefs: core::slice::Iter<'a, (f64, ModelBelief)>,
}

impl<'a> Offers<'a> {
    fn of(case: &ControllerCase<'a>) -> Self {
        Self { name: case.name, beliefs: case.beliefs.iter() }
    }

    fn make(&mut self, controller: &mut dyn Controller, output: &Output) -> Result<Vec<(u64, Adoption)>, LawViolation> {
        let belief = self.beliefs.by_ref().take(output.offers.len());
        belief
            .map(|(_, belief)| {
                let adoption = controller.adopt(belief).map_err(|error| refusal(self.name, &error))?;
                Ok((belief.revision, adoption))
            })
            .collect()
    }
}

/// Asks what was asked in a flight again, seen from elsewhere.
pub(super) fn asked_again(
    controller: &mut dyn Controller,
    case: &ControllerCase<'_>,
    flight: &Flight,
    elsewhere: &Elsewhere,
) -> Result<Vec<Answer>, LawViolation> {
    let mut beliefs = Offers::of(case);
    let mut answers = Vec::new();
    let here = case.plan.trajectory;
    for output in &flight.outputs {
        let offers = beliefs.make(controller, output)?;
        let moved = |time_s: f64| {
            let reference = here.at(time_s - elsewhere.later_s);
            PoseReference { state: elsewhere.state(&reference.state), ..reference }
        };
        let trajectory: &dyn ReferenceMotion = &moved;
        let request = ControlRequest {
            time_s: output.time_s + elsewhere.later_s,
            state: &elsewhere.state(&output.measured),
            plan: &Plan { trajectory, model_revision: case.plan.model_revision },
        };
        answers.push((controller.command(&request).map_err(|error| refusal(case.name, &error))?, offers));
    }
    Ok(answers)
}

/// What is slipped in before a request, the number of the output and the request; whether to go on.
type Slip<'s> = &'s mut dyn FnMut(&mut dyn Controller, usize, &ControlRequest<'_>) -> bool;

/// Asks what was asked in a flight again, with something slipped in before each request, after its beliefs.
pub(super) fn asked_again_with(
    controller: &mut dyn Controller,
    case: &ControllerCase<'_>,
    flight: &Flight,
    slip: Slip<'_>,
) -> Result<Vec<Answer>, LawViolation> {
    let mut beliefs = Offers::of(case);
    let mut answers = Vec::new();
    for (index, output) in flight.outputs.iter().enumerate() {
        let offers = beliefs.make(controller, output)?;
        let request = ControlRequest { time_s: output.time_s, state: &output.measured, plan: &case.plan };
        if !slip(controller, index, &request) {
            break;
        }
        answers.push((controller.command(&request).map_err(|error| refusal(case.name, &error))?, offers));
    }
    Ok(answers)
}
