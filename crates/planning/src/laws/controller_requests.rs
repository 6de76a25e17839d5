//! What controllers must refuse, slipped into flights.

use super::LawViolation;
use super::controller_flight::{Answer, ControllerCase, Flight, asked_again_with};
use super::local_requests::absurd_beliefs;
use crate::belief::{ModelBelief, Plan};
use crate::control::{ControlCommand, ControlRequest, Controller, ReferenceMotion};
use nalgebra::{Quaternion, SMatrix, UnitQuaternion};
use std::panic::{AssertUnwindSafe, catch_unwind};
use tumble_dynamics::{PoseReference, RigidBodyState};

/// A number in a request that is none, or not one of the attitude's.
#[derive(Clone, Copy, Debug)]
pub(super) enum Hostile {
    Time(f64),
    Position(f64),
    Attitude(f64),
    Velocity(f64),
    Rate(f64),
    ReferencePosition(f64),
    ReferenceAttitude(f64),
    ReferenceVelocity(f64),
    ReferenceAcceleration(f64),
    ReferenceAngularAcceleration(f64),
}

impl Hostile {
    pub const fn is_reference(&self) -> bool {
        matches!(
            self,
            Self::ReferencePosition(_)
                | Self::ReferenceAttitude(_)
                | Self::ReferenceVelocity(_)
                | Self::ReferenceAcceleration(_)
                | Self::ReferenceAngularAcceleration(_)
        )
    }

    fn spoil(&self, state: &mut RigidBodyState<f64>) {
        match *self {
            Self::Position(value) | Self::ReferencePosition(value) => {
                state.world_from_body.translation.vector.y = value;
            }
            Self::Attitude(value) | Self::ReferenceAttitude(value) => {
                let spoilt = Quaternion::new(1.0, value, 0.0, 0.0);
                state.world_from_body.rotation = UnitQuaternion::new_unchecked(spoilt);
            }
            Self::Velocity(value) | Self::ReferenceVelocity(value) => state.twist_body.linear.z = value,
            Self::Rate(value) => state.twist_body.angular.x = value,
            _ => {}
        }
    }
}

/// Every number once, as each of what is not finite.
pub(super) fn hostile_requests() -> Vec<Hostile> {
    use Hostile::{
        Attitude, Position, Rate, ReferenceAcceleration, ReferenceAngularAcceleration, ReferenceAttitude,
        ReferencePosition, ReferenceVelocity, Time, Velocity,
    };
    let makers = [
        Time,
        Position,
        Attitude,
        Velocity,
        Rate,
        ReferencePosition,
        ReferenceAttitude,
        ReferenceVelocity,
        ReferenceAcceleration,
        ReferenceAngularAcceleration,
    ];
    let values = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    makers.into_iter().flat_map(|make| values.map(make)).collect()
}

/// What became of a request that cannot be.
#[derive(Clone, Debug)]
pub(super) enum Asked {
    Refused,
    Answered(ControlCommand),
    Panicked,
}

/// What became of requests slipped in, and the answers to the sound ones.
pub(super) struct Told<A> {
    pub answers: Vec<A>,
    pub commands: Vec<Answer>,
}

/// One of the requests before each of the flight's, in turn.
pub(super) fn with_hostile_requests<'h>(
    controller: &mut dyn Controller,
    case: &ControllerCase<'_>,
    flight: &Flight,
    hostile: &[&'h Hostile],
) -> Result<Told<(&'h Hostile, Asked)>, LawViolation> {
    let mut answers = Vec::new();
    let commands = asked_again_with(controller, case, flight, &mut |controller, index, sound| {
        let Some(request) = index.checked_rem(hostile.len()).and_then(|index| hostile.get(index)) else { return true };
        let answer = ask(controller, sound, request);
        let goes_on = !matches!(answer, Asked::Panicked);
        answers.push((*request, answer));
        goes_on
    })?;
    Ok(Told { answers, commands })
}

fn ask(controller: &mut dyn Controller, sound: &ControlRequest<'_>, hostile: &Hostile) -> Asked {
    let mut state = *sound.state;
    let mut time_s = sound.time_s;
    if let Hostile::Time(value) = *hostile {
        time_s = value;
    }
    if !hostile.is_reference() {
        hostile.spoil(&mut state);
    }
    let spoilt = |time_s: f64| {
        let mut reference: PoseReference = sound.plan.trajectory.at(time_s);
        if hostile.is_reference() {
            hostile.spoil(&mut reference.state);
        }
        match *hostile {
            Hostile::ReferenceAcceleration(value) => reference.acceleration.acceleration_origin_body.x = value,
            Hostile::ReferenceAngularAcceleration(value) => reference.acceleration.angular_acceleration_body.y = value,
            _ => {}
        }
        reference
    };
    let trajectory: &dyn ReferenceMotion = &spoilt;
    let plan = Plan { trajectory, model_revision: sound.plan.model_revision };
    let request = ControlRequest { time_s, state: &state, plan: &plan };
    match catch_unwind(AssertUnwindSafe(|| controller.command(&request))) {
        Ok(Ok(command)) => Asked::Answered(command),
        Ok(Err(_)) => Asked::Refused,
        Err(_) => Asked::Panicked,
    }
}

/// A belief to begin from, newer than all of a case.
fn newer(case: &ControllerCase<'_>) -> ModelBelief {
    let last = case.beliefs.last().map(|(_, belief)| belief);
    let mut belief = last.cloned().unwrap_or_else(|| ModelBelief::certain(0, case.body));
    belief.revision += 1;
    // a variance that is zero stays possible when its sign is changed
    belief.estimate.covariance += SMatrix::identity();
    belief
}

/// One belief that cannot be before each request, in turn; of each, whether it was an error.
pub(super) fn with_impossible_beliefs(
    controller: &mut dyn Controller,
    case: &ControllerCase<'_>,
    flight: &Flight,
) -> Result<Told<(&'static str, bool)>, LawViolation> {
    let absurd = absurd_beliefs(&newer(case));
    let mut answers = Vec::new();
    let commands = asked_again_with(controller, case, flight, &mut |controller, index, _| {
        if let Some((what, belief)) = index.checked_rem(absurd.len()).and_then(|index| absurd.get(index)) {
            let outcome = catch_unwind(AssertUnwindSafe(|| controller.adopt(belief)));
            let panicked = outcome.is_err();
            answers.push((*what, matches!(outcome, Ok(Err(_)))));
            return !panicked;
        }
        true
    })?;
    Ok(Told { answers, commands })
}

/// The answers of a flight in which the belief before the one in use comes again, in a heavier body, before each request.
pub(super) fn older_belief(
    controller: &mut dyn Controller,
    case: &ControllerCase<'_>,
    flight: &Flight,
) -> Result<Vec<Answer>, LawViolation> {
    asked_again_with(controller, case, flight, &mut |controller, index, _| {
        let in_use = flight.outputs.get(index).map_or(0, |output| output.command.model_revision);
        if let Some(revision) = in_use.checked_sub(1) {
            let mut belief = newer(case);
            belief.revision = revision;
            belief.estimate.parameters.mass *= 1.5;
            belief.estimate.parameters.first_moment *= 1.5;
            belief.estimate.parameters.inertia_about_origin *= 1.5;
            // whatever it says: what counts are its commands
            let _ = controller.adopt(&belief);
        }
        true
    })
}
