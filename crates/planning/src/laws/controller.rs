//! Laws of controllers. Bodies fly by equations written down here anew: nothing asks the controller's own model.

use super::controller_flight::{
    Answer, ControllerCase, Elsewhere, Flight, Output, TrackingError, asked_again, asked_again_with,
};
use super::controller_requests::{
    Asked, hostile_requests, older_belief, with_hostile_requests, with_impossible_beliefs,
};
use super::{LawViolation, broken_unless, require};
use crate::belief::Plan;
use crate::control::{Adoption, ControlCommand, Controller, Fallback, FallbackReason, ReferenceMotion};
use crate::vectors::largest;
use nalgebra::{UnitQuaternion, Vector3};
use tumble_dynamics::{BodyAcceleration, PoseReference, RigidBodyState, WrenchBox};
use tumble_lie::{Pose, Twist};

/// What a controller promises in every case.
#[derive(Clone, Copy, Debug)]
pub struct ControllerPromise<'a> {
    /// Largest wrench it ever asks for, body axes; infinite where it knows no limit.
    pub limits: WrenchBox,
    /// Bound of the error in all cases that are [promised](ControllerCase::is_promised).
    pub tube: Option<TrackingError>,
    /// A small error: no limit of the wrench is felt while it is put right. Speed and rate are not looked at.
    pub small: TrackingError,
    /// Time within which a small error of a body that is known falls to a twentieth, s.
    pub settling_s: f64,
    /// Largest ratio of the error on the way to the small error at the start.
    pub overshoot: f64,
    /// Poses of other worlds in which it asks for the same; none where walls or limits along world axes are its own.
    pub other_worlds: &'a [Pose<f64>],
    /// By how much wrenches differ that are the same up to rounding, N and N m; and m and rad of a body that keeps still.
    pub tolerance: f64,
}

/// Two worlds to see a controller from that has no place of its own.
pub fn other_worlds() -> [Pose<f64>; 2] {
    [Pose::translation(3.0, -2.0, 1.0), Pose::new(Vector3::new(-1.0, 0.5, 2.0), Vector3::new(0.7, -1.9, 1.1))]
}

/// The laws of controllers; `new` makes one that has not been asked yet.
///
/// Of every flight: "sound requests are answered", "commands are finite and inside the limits", "the command names its belief",
/// "what is kept is what was in use", "the plan is followed" (where the case says so), "the error stays inside the promised
/// tube", "adoption never loses the guarantee" (the same flight with the first belief alone keeps it), "an acceleration that is promised is
/// followed" (along each axis, there and back, from where the case begins).
/// Of a flight asked for again: "the same requests have the same answers", "a turned world turns nothing in body axes",
/// "another clock changes nothing".
/// At the start of every case, with the body believed in: "a reference at rest is kept", "an error does not grow",
/// "an error goes away".
/// Of what cannot be: "hostile numbers do not panic", "numbers that are not finite are refused", "what was refused changes
/// nothing", "impossible beliefs are refused", "a refused belief changes nothing", "an older belief changes nothing".
///
/// # Errors
/// The first broken law.
pub fn check_controller<C: Controller>(
    new: &dyn Fn() -> C,
    cases: &[ControllerCase<'_>],
    promise: &ControllerPromise<'_>,
) -> Result<(), LawViolation> {
    broken_controller_laws(new, cases, promise).into_iter().next().map_or(Ok(()), Err)
}

/// All laws of [`check_controller`] that are broken, each once in each case.
pub fn broken_controller_laws<C: Controller>(
    new: &dyn Fn() -> C,
    cases: &[ControllerCase<'_>],
    promise: &ControllerPromise<'_>,
) -> Vec<LawViolation> {
    let mut broken = Vec::new();
    for case in cases {
        let flight = match Flight::of(&mut new(), case) {
            Ok(flight) => flight,
            Err(violation) => {
                broken.push(violation);
                continue;
            }
        };
        let judge = Judge { new, case, promise, flight };
        let laws = [
            judge.limits(),
            judge.revisions(),
            judge.follows(),
            judge.promised(),
            judge.accelerates(),
            judge.repeats(),
            judge.other_worlds(),
            judge.other_clock(),
            judge.rests(),
            judge.settles(),
            judge.hostile_states(),
            judge.hostile_references(),
            judge.impossible_beliefs(),
            judge.older_belief(),
        ];
        broken.extend(laws.into_iter().filter_map(Result::err));
    }
    broken
}

/// How long a body that is judged speeds up, and how long it slows down, s.
const SPURT_S: f64 = 2.0;

/// From rest, faster and faster along a world axis, then slower and slower, then at rest.
fn there_and_back(first: &Pose<f64>, axis: usize, acceleration_m_s2: f64, time_s: f64) -> PoseReference {
    let (away, slowing) = (time_s.clamp(0.0, SPURT_S), (time_s - SPURT_S).clamp(0.0, SPURT_S));
    let moved = 0.5 * away * away + away * slowing - 0.5 * slowing * slowing;
    let is_moving = (0.0..2.0 * SPURT_S).contains(&time_s);
    let pushes = if is_moving { f64::signum(SPURT_S - time_s) } else { 0.0 };
    let along = Vector3::from_fn(|i, _| if i == axis { acceleration_m_s2 } else { 0.0 });
    let in_body = |world: Vector3<f64>| first.rotation.inverse() * world;
    let position = first.translation.vector + along * moved;
    PoseReference {
        state: RigidBodyState {
            world_from_body: Pose::from_parts(position.into(), first.rotation),
            twist_body: Twist::new(Vector3::zeros(), in_body(along * (away - slowing))),
        },
        acceleration: BodyAcceleration {
            angular_acceleration_body: Vector3::zeros(),
            acceleration_origin_body: in_body(along * pushes),
        },
    }
}

struct Judge<'a, C> {
    new: &'a dyn Fn() -> C,
    case: &'a ControllerCase<'a>,
    promise: &'a ControllerPromise<'a>,
    flight: Flight,
}

/// Largest difference of the wrenches of two answers; infinite where anything else differs.
fn difference(one: &ControlCommand, other: &ControlCommand) -> f64 {
    let is_alike = one.model_revision == other.model_revision && one.fallback.is_some() == other.fallback.is_some();
    let apart = (one.wrench_body - other.wrench_body).to_vector().amax();
    if is_alike && !apart.is_nan() { apart } else { f64::INFINITY }
}

/// The bits of an answer.
fn bits(command: &ControlCommand) -> ([u64; 6], String) {
    let wrench = command.wrench_body.to_vector().map(f64::to_bits);
    (wrench.into(), format!("{:?}", (command.model_revision, command.fallback, command.mass)))
}

/// By what share of a limit a wrench may exceed it.
const ROUNDING: f64 = 1e-12;

/// Whether a wrench is finite and inside limits.
fn is_inside(command: &ControlCommand, limits: &WrenchBox) -> bool {
    let wrench = &command.wrench_body;
    let each = wrench.torque.iter().zip(&limits.torque_limit).chain(wrench.force.iter().zip(&limits.force_limit));
    each.into_iter().all(|(value, limit)| value.is_finite() && value.abs() <= limit * (1.0 + ROUNDING))
}

impl<C: Controller> Judge<'_, C> {
    fn require(
        &self,
        law: &'static str,
        expected: &dyn core::fmt::Debug,
        found: &dyn core::fmt::Debug,
        error: f64,
        tolerance: f64,
    ) -> Result<(), LawViolation> {
        require(law, &self.case.name, expected, found, error, tolerance)
    }

    fn limits(&self) -> Result<(), LawViolation> {
        for output in &self.flight.outputs {
            let holds = is_inside(&output.command, &self.promise.limits);
            let found = (output.time_s, &output.command);
            let law = "commands are finite and inside the limits";
            self.require(law, &self.promise.limits, &found, broken_unless(holds), 0.0)?;
        }
        Ok(())
    }

    fn revisions(&self) -> Result<(), LawViolation> {
        let (mut in_use, mut waiting) = (0, None);
        for output in &self.flight.outputs {
            for (revision, adoption) in &output.offers {
                match adoption {
                    Adoption::Adopted => (in_use, waiting) = (*revision, None),
                    Adoption::Postponed { kept } | Adoption::Contradicts { kept } => {
                        let law = "what is kept is what was in use";
                        self.require(law, &in_use, &(output.time_s, kept), broken_unless(*kept == in_use), 0.0)?;
                        waiting = matches!(adoption, Adoption::Postponed { .. }).then_some(*revision);
                    }
                }
            }
            let named = output.command.model_revision;
            if waiting == Some(named) {
                (in_use, waiting) = (named, None);
            }
            let law = "the command names its belief";
            self.require(law, &in_use, &(output.time_s, named), broken_unless(named == in_use), 0.0)?;
        }
        Ok(())
    }

    fn follows(&self) -> Result<(), LawViolation> {
        let Some((from_s, bound)) = &self.case.followed else { return Ok(()) };
        let (share, worst) = self.flight.worst(*from_s, bound);
        self.require("the plan is followed", bound, &worst, share, 1.0)
    }

    fn promised(&self) -> Result<(), LawViolation> {
        let Some(tube) = &self.promise.tube else { return Ok(()) };
        if !self.case.is_promised {
            return Ok(());
        }
        let first = ControllerCase { beliefs: self.case.beliefs.get(..1).unwrap_or(&[]), ..self.case.clone() };
        let alone = Flight::of(&mut (self.new)(), &first)?;
        let (share, worst) = alone.worst(0.0, tube);
        self.require("the error stays inside the promised tube", tube, &worst, share, 1.0 + ROUNDING)?;
        let law = "adoption never loses the guarantee";
        let (share, worst) = self.flight.worst(0.0, tube);
        self.require(law, tube, &worst, share, 1.0 + ROUNDING)?;
        let lost = |flight: &Flight| flight.outputs.iter().find(|output| has_lost(output)).cloned();
        let (before, after) = (lost(&alone), lost(&self.flight));
        self.require(law, &before, &after, broken_unless(before.is_some() || after.is_none()), 0.0)
    }

    fn accelerates(&self) -> Result<(), LawViolation> {
        let (case, law) = (self.case, "an acceleration that is promised is followed");
        let Some(tube) = self.promise.tube.as_ref().filter(|_| case.is_promised) else { return Ok(()) };
        let first = case.plan.trajectory.at(case.start_s).state.world_from_body;
        for axis in 0..3 {
            let promised = (self.new)().acceleration_m_s2()[axis];
            if promised == f64::INFINITY {
                continue;
            }
            self.require(law, &"no less than none", &promised, broken_unless(promised >= 0.0), 0.0)?;
            let motion = |time_s: f64| there_and_back(&first, axis, promised, time_s - case.start_s);
            let outputs = 3.0 * SPURT_S / case.step_s;
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
            let flown = ControllerCase {
                start: motion(case.start_s).state,
                plan: Plan { trajectory: &motion, model_revision: case.plan.model_revision },
                beliefs: case.beliefs.get(..1).unwrap_or(&[]),
                outputs: outputs as usize + 1,
                ..case.clone()
            };
            let flight = Flight::of(&mut (self.new)(), &flown)?;
            let (share, worst) = flight.worst(0.0, tube);
            self.require(law, &(axis, promised, tube), &worst, share, 1.0 + ROUNDING)?;
            let lost = flight.outputs.iter().find(|output| has_lost(output));
            self.require(law, &(axis, promised), &lost, broken_unless(lost.is_none()), 0.0)?;
        }
        Ok(())
    }

    fn repeats(&self) -> Result<(), LawViolation> {
        for _ in 0..2 {
            let answers = asked_again_with(&mut (self.new)(), self.case, &self.flight, &mut |_, _, _| true)?;
            for (output, (command, offers)) in self.flight.outputs.iter().zip(&answers) {
                let is_same = bits(command) == bits(&output.command) && *offers == output.offers;
                let law = "the same requests have the same answers";
                self.require(law, output, &(command, offers), broken_unless(is_same), 0.0)?;
            }
        }
        Ok(())
    }

    fn seen_from(&self, law: &'static str, elsewhere: &Elsewhere) -> Result<(), LawViolation> {
        let answers = asked_again(&mut (self.new)(), self.case, &self.flight, elsewhere)?;
        for (output, (command, _)) in self.flight.outputs.iter().zip(&answers) {
            let apart = difference(&output.command, command);
            self.require(law, output, &(elsewhere, command), apart, self.promise.tolerance)?;
        }
        Ok(())
    }

    fn other_worlds(&self) -> Result<(), LawViolation> {
        let law = "a turned world turns nothing in body axes";
        self.promise.other_worlds.iter().try_for_each(|pose| self.seen_from(law, &Elsewhere::moved(*pose)))
    }

    fn other_clock(&self) -> Result<(), LawViolation> {
        [0.37, 1000.0]
            .into_iter()
            .try_for_each(|later_s| self.seen_from("another clock changes nothing", &Elsewhere::later(later_s)))
    }

    /// The flight of the body believed in at the start from so far off a pose that is held.
    fn held(&self, offset_m: Vector3<f64>, offset_rad: Vector3<f64>) -> Result<Flight, LawViolation> {
        let case = self.case;
        let world_from_body = case.plan.trajectory.at(case.start_s).state.world_from_body;
        let at_rest = |world_from_body| RigidBodyState { world_from_body, twist_body: Twist::zero() };
        let acceleration = BodyAcceleration {
            angular_acceleration_body: Vector3::zeros(),
            acceleration_origin_body: Vector3::zeros(),
        };
        let reference = PoseReference { state: at_rest(world_from_body), acceleration };
        let motion = |_: f64| reference;
        let trajectory: &dyn ReferenceMotion = &motion;
        let early = case.beliefs.iter().take_while(|(offered_s, _)| *offered_s <= case.start_s).count();
        let beliefs = case.beliefs.get(..early).unwrap_or(&[]);
        let turned = UnitQuaternion::new(offset_rad);
        let position = world_from_body.translation.vector + world_from_body.rotation * offset_m;
        let outputs = 1.5 * self.promise.settling_s / case.step_s;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
        Flight::of(
            &mut (self.new)(),
            &ControllerCase {
                body: beliefs.last().map_or(case.body, |(_, belief)| *belief.parameters()),
                start: at_rest(Pose::from_parts(position.into(), world_from_body.rotation * turned)),
                plan: Plan { trajectory, model_revision: case.plan.model_revision },
                beliefs,
                disturbance: &(),
                sensor: None,
                outputs: outputs as usize + 1,
                ..case.clone()
            },
        )
    }

    fn rests(&self) -> Result<(), LawViolation> {
        let law = "a reference at rest is kept";
        let flight = self.held(Vector3::zeros(), Vector3::zeros())?;
        let tolerance = self.promise.tolerance;
        for output in &flight.outputs {
            let TrackingError { position_m, angle_rad, .. } = output.error;
            let most =
                largest(output.command.wrench_body.to_vector().as_slice()).max(largest(&[position_m, angle_rad]));
            self.require(law, &"nothing", output, most, tolerance)?;
        }
        Ok(())
    }

    fn settles(&self) -> Result<(), LawViolation> {
        let ControllerPromise { small, settling_s, overshoot, .. } = self.promise;
        let looked_at = TrackingError { speed_m_s: f64::INFINITY, rate_rad_s: f64::INFINITY, ..*small };
        for axis in 0..3 {
            let along = |axis: usize| Vector3::from_fn(|i, _| if i == axis { 1.0 } else { 0.0 });
            let offset_m = along(axis) * small.position_m;
            let flight = self.held(offset_m, along((axis + 1) % 3) * small.angle_rad)?;
            let (share, worst) = flight.worst(0.0, &looked_at);
            self.require("an error does not grow", overshoot, &worst, share, *overshoot)?;
            let (share, worst) = flight.worst(*settling_s, &looked_at);
            self.require("an error goes away", &looked_at, &worst, share, 0.05)?;
        }
        Ok(())
    }

    /// Commands after refusals are those that were given without.
    fn unchanged(&self, law: &'static str, answers: &[Answer]) -> Result<(), LawViolation> {
        for (output, (command, _)) in self.flight.outputs.iter().zip(answers) {
            let is_same = bits(command) == bits(&output.command);
            self.require(law, output, command, broken_unless(is_same), 0.0)?;
        }
        Ok(())
    }

    fn hostile_states(&self) -> Result<(), LawViolation> {
        let hostile = hostile_requests();
        let (states, _): (Vec<_>, Vec<_>) = hostile.iter().partition(|request| !request.is_reference());
        let told = with_hostile_requests(&mut (self.new)(), self.case, &self.flight, &states)?;
        for (request, answer) in &told.answers {
            self.no_panic(request, answer)?;
            let is_refused = matches!(answer, Asked::Refused);
            let law = "numbers that are not finite are refused";
            self.require(law, request, answer, broken_unless(is_refused), 0.0)?;
        }
        self.unchanged("what was refused changes nothing", &told.commands)
    }

    fn hostile_references(&self) -> Result<(), LawViolation> {
        let hostile = hostile_requests();
        let references: Vec<_> = hostile.iter().filter(|request| request.is_reference()).collect();
        let told = with_hostile_requests(&mut (self.new)(), self.case, &self.flight, &references)?;
        let mut all_refused = true;
        for (request, answer) in &told.answers {
            self.no_panic(request, answer)?;
            if let Asked::Answered(command) = answer {
                all_refused = false;
                let names_it = matches!(
                    command.fallback,
                    Some(
                        Fallback::Shifted(FallbackReason::NoReference)
                            | Fallback::Restarted(FallbackReason::NoReference)
                            | Fallback::Braking(FallbackReason::NoReference)
                    )
                );
                let holds = names_it && is_inside(command, &self.promise.limits);
                let law = "numbers that are not finite are refused";
                self.require(law, request, command, broken_unless(holds), 0.0)?;
            }
        }
        if all_refused {
            return self.unchanged("what was refused changes nothing", &told.commands);
        }
        let holds = told.commands.iter().all(|(command, _)| is_inside(command, &self.promise.limits));
        let law = "commands are finite and inside the limits";
        self.require(law, &self.promise.limits, &"after hostile references", broken_unless(holds), 0.0)
    }

    fn no_panic(&self, request: &dyn core::fmt::Debug, answer: &Asked) -> Result<(), LawViolation> {
        let holds = !matches!(answer, Asked::Panicked);
        self.require("hostile numbers do not panic", request, answer, broken_unless(holds), 0.0)
    }

    fn impossible_beliefs(&self) -> Result<(), LawViolation> {
        let told = with_impossible_beliefs(&mut (self.new)(), self.case, &self.flight)?;
        for (what, is_refused) in &told.answers {
            let law = "impossible beliefs are refused";
            self.require(law, &"an error", what, broken_unless(*is_refused), 0.0)?;
        }
        self.unchanged("a refused belief changes nothing", &told.commands)
    }

    fn older_belief(&self) -> Result<(), LawViolation> {
        let commands = older_belief(&mut (self.new)(), self.case, &self.flight)?;
        self.unchanged("an older belief changes nothing", &commands)
    }
}

/// Whether a controller says that its guarantee is lost.
fn has_lost(output: &Output) -> bool {
    use FallbackReason::{Infeasible, OutsideTube};
    matches!(
        output.command.fallback,
        Some(Fallback::Restarted(Infeasible | OutsideTube { .. }) | Fallback::Braking(Infeasible | OutsideTube { .. }))
    )
}
