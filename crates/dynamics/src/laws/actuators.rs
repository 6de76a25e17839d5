//! Laws of actuators and of what they store.

use super::forces::scale;
use crate::actuation::{Actuation, StatefulActuation};
use crate::inertia::InertialParameters;
use crate::laws::{LawViolation, require};
use crate::plant::SimulatedMeasurement;
use crate::system::Plant;
use tumble_lie::nalgebra::{Vector3, Vector6};
use tumble_lie::{Pose, Wrench};

/// The laws of actuators.
///
/// "limits are never exceeded", by any command allocated or any of `commands`; "what lies inside the limits is
/// realised"; "what was realised can be realised again"; "a wrench that is not finite is refused".
///
/// `inside` are wrenches that the machine can give (of reaction wheels: torques without force), `wanted` any wrenches. `excess` is by how much a command or the
/// wrench it gives exceeds the machine's limits (nozzle thrusts not negative, openings at most full); not positive when
/// all hold.
/// # Errors
/// The first broken law.
pub fn check_actuation<A: Actuation>(
    actuation: &A,
    inside: &[Wrench<f64>],
    wanted: &[Wrench<f64>],
    commands: &[<A as Actuation>::Command],
    excess: &dyn Fn(&<A as Actuation>::Command, &Wrench<f64>) -> f64,
    tolerance: f64,
) -> Result<(), LawViolation> {
    check_stateful_actuation(&Held { actuation, inner: &(), hold_s: 1.0 }, inside, wanted, commands, excess, tolerance)
}

/// Actuators at a state of their own, told for how long to hold what they are told.
#[derive(Clone, Copy, Debug)]
pub struct Held<'a, A: StatefulActuation> {
    /// The actuators.
    pub actuation: &'a A,
    /// Their state.
    pub inner: &'a A::Inner,
    /// How long a command is held, s.
    pub hold_s: f64,
}

/// The laws of [`check_actuation`] for actuators with a state.
///
/// # Errors
/// The first broken law.
pub fn check_stateful_actuation<A: StatefulActuation>(
    held: &Held<'_, A>,
    inside: &[Wrench<f64>],
    wanted: &[Wrench<f64>],
    commands: &[A::Command],
    excess: &dyn Fn(&A::Command, &Wrench<f64>) -> f64,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let Held { actuation, inner, hold_s } = *held;
    let realize = |command: &A::Command| actuation.realize_over(inner, command, hold_s);
    let allocate = |law, wrench: &Wrench<f64>| match actuation.allocate_over(inner, wrench, hold_s) {
        Ok(command) => Ok((realize(&command), command)),
        Err(error) => Err(LawViolation {
            law,
            inputs: format!("{wrench:?}"),
            expected: "a command".into(),
            found: format!("{error:?}"),
            error: f64::INFINITY,
            tolerance,
        }),
    };
    let law = "limits are never exceeded";
    for wrench in inside.iter().chain(wanted) {
        let (realized, command) = allocate(law, wrench)?;
        require(law, wrench, &"limits", &(&command, realized), excess(&command, &realized), tolerance)?;
    }
    for command in commands {
        let realized = realize(command);
        // a command may be anything; what comes out may not
        let (_, admissible) = allocate(law, &realized)?;
        require(law, command, &"limits", &realized, excess(&admissible, &realized), tolerance)?;
    }
    let law = "what lies inside the limits is realised";
    for wrench in inside {
        let (realized, _) = allocate(law, wrench)?;
        let error = (realized - *wrench).to_vector().amax() / scale(&[wrench.to_vector()]);
        require(law, wrench, wrench, &realized, error, tolerance)?;
    }
    let law = "what was realised can be realised again";
    for wrench in wanted {
        let (realized, _) = allocate(law, wrench)?;
        let (again, _) = allocate(law, &realized)?;
        let error = (again - realized).to_vector().amax() / scale(&[realized.to_vector()]);
        require(law, wrench, &realized, &again, error, tolerance)?;
    }
    // each component, for a machine may well look at some of them only
    for (component, broken) in (0..6).flat_map(|i| [f64::NAN, f64::INFINITY, f64::NEG_INFINITY].map(|value| (i, value)))
    {
        let broken = Wrench::from(Vector6::from_fn(|row, _| if row == component { broken } else { 0.0 }));
        let outcome = actuation.allocate_over(inner, &broken, hold_s);
        let error = if outcome.is_err() { 0.0 } else { f64::INFINITY };
        require("a wrench that is not finite is refused", &broken, &"an error", &outcome, error, 0.0)?;
    }
    Ok(())
}

/// The laws of actuators that turn a body by storing momentum, and do nothing else.
///
/// "what the body gets the storage gives", whatever is commanded; "the storage never overflows": `excess` of its state,
/// by how much a limit is exceeded, is never positive; "no force". From each of `starts` all `wanted` are held one after
/// the other.
/// # Errors
/// The first broken law.
pub fn check_momentum_storage<A: StatefulActuation>(
    actuation: &A,
    starts: &[A::Inner],
    wanted: &[Wrench<f64>],
    hold_s: f64,
    excess: &dyn Fn(&A::Inner) -> f64,
    tolerance: f64,
) -> Result<(), LawViolation> {
    for start in starts {
        let mut inner = start.clone();
        for wrench in wanted {
            let command = match actuation.allocate_over(&inner, wrench, hold_s) {
                Ok(command) => command,
                Err(error) => {
                    return require("a command", wrench, &"a command", &error, f64::INFINITY, tolerance);
                }
            };
            let realized = actuation.realize_over(&inner, &command, hold_s);
            let next = actuation.advanced(&inner, &command, hold_s);
            let inputs = (&inner, &command);
            require("no force", &inputs, &0.0, &realized.force, realized.force.amax(), 0.0)?;
            let [before, after] =
                [&inner, &next].map(|inner| actuation.stored_momentum_body(inner).unwrap_or_default());
            let (gained, given) = (after - before, -(realized.torque * hold_s));
            let size = before.amax().max(after.amax()).max(given.amax()).max(f64::MIN_POSITIVE);
            let error = (gained - given).amax() / size;
            require("what the body gets the storage gives", &inputs, &given, &gained, error, tolerance)?;
            require("the storage never overflows", &inputs, &"limits", &next, excess(&next), tolerance)?;
            inner = next;
        }
    }
    Ok(())
}

/// The law of a plant that only its own wheels turn, with nothing around it: "total momentum is kept".
///
/// Linear momentum, and angular momentum of body and wheels about the common centre of mass, inertial axes, after each
/// of `wanted`, held for `hold_s`. `tolerance` is relative to the largest momentum stored or turning.
/// # Errors
/// The broken law, or "the plant advances".
pub fn check_total_momentum<P>(
    plant: &mut P,
    body: &InertialParameters<f64>,
    wanted: &[Wrench<f64>],
    hold_s: f64,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    P: Plant<Input = Wrench<f64>, Measurement = SimulatedMeasurement>,
{
    let mut at_start = None;
    let (mut turning, mut moving) = (f64::MIN_POSITIVE, f64::MIN_POSITIVE);
    for wrench in core::iter::once(&Wrench::zero()).chain(wanted) {
        let measured = match plant.advance(wrench, hold_s) {
            Ok(measured) => measured,
            Err(error) => {
                let found = error.to_string();
                return require("the plant advances", wrench, &"a measurement", &found, f64::INFINITY, tolerance);
            }
        };
        let found = total_momentum(body, &measured);
        let expected = *at_start.get_or_insert(found);
        // what changes hands is at least the size of what is compared
        turning = turning.max(found.torque.norm()).max(measured.stored_momentum_body.norm());
        let twist = &measured.state.twist_body;
        moving = moving.max(body.mass * (twist.linear.norm() + twist.angular.cross(&body.center_of_mass()).norm()));
        let difference = found - expected;
        let error = (difference.torque.norm() / turning).max(difference.force.norm() / moving);
        require("total momentum is kept", &(wrench, measured.time_ns), &expected, &found, error, tolerance)?;
    }
    Ok(())
}

/// Angular momentum about the centre of mass and linear momentum of body and wheels, inertial axes.
fn total_momentum(body: &InertialParameters<f64>, measured: &SimulatedMeasurement) -> Wrench<f64> {
    let Pose { rotation, .. } = measured.state.world_from_body;
    let twist = &measured.state.twist_body;
    let com: Vector3<f64> = body.center_of_mass();
    let angular = body.inertia_about_com() * twist.angular + measured.stored_momentum_body;
    let linear = (twist.linear + twist.angular.cross(&com)) * body.mass;
    Wrench::new(rotation * angular, rotation * linear)
}
