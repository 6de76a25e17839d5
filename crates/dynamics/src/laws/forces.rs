//! Laws of free bodies, wrench models and actuators.

use crate::actuation::Actuation;
use crate::free_flyer::BodyAcceleration;
use crate::inertia::InertialParameters;
use crate::laws::{LawViolation, require};
use crate::state::RigidBodyState;
use crate::system::{MechanicalSystem, RigidBody, WrenchModel};
use tumble_lie::nalgebra::{SVector, UnitQuaternion, Vector3, Vector6};
use tumble_lie::{Twist, Wrench};

type State = RigidBodyState<f64>;

/// Largest absolute entry, at least one.
fn scale(vectors: &[Vector6<f64>]) -> f64 {
    vectors.iter().map(Vector6::amax).fold(1.0, f64::max)
}

/// Momentum about the body origin, body axes, written out.
fn momentum(body: &InertialParameters<f64>, twist: &Twist<f64>) -> Wrench<f64> {
    let InertialParameters { mass, first_moment, inertia_about_origin } = body;
    Wrench::new(
        inertia_about_origin * twist.angular + first_moment.cross(&twist.linear),
        twist.linear * *mass + twist.angular.cross(first_moment),
    )
}

/// The laws of a free rigid body moved by a wrench about its origin.
///
/// "the pose moves with the twist"; "power balance": the kinetic energy changes by the power of the wrench;
/// "momentum balance": the rate of the momentum is the wrench (this is Newton-Euler, with the parameters the body
/// claims). `tolerance` is relative to the wrench and the momentum rates.
/// # Errors
/// The first broken law.
pub fn check_system<S>(system: &S, samples: &[(State, Wrench<f64>)], tolerance: f64) -> Result<(), LawViolation>
where
    S: MechanicalSystem<State = State, Input = Wrench<f64>> + RigidBody<Scalar = f64>,
    S::State: tumble_lie::Manifold<Scalar = f64, Tangent = SVector<f64, 12>>,
{
    let body = system.inertial_parameters();
    for sample @ (state, wrench) in samples {
        let twist = &state.twist_body;
        let rate = match system.vector_field(0.0, state, wrench) {
            Ok(rate) => rate,
            Err(error) => {
                return require("the field has a value", sample, &"a rate", &error, f64::INFINITY, tolerance);
            }
        };
        let pose_rate = rate.fixed_rows::<6>(0).into_owned();
        let error = (pose_rate - twist.to_vector()).amax();
        let size = scale(&[twist.to_vector()]);
        require("the pose moves with the twist", sample, twist, &pose_rate, error / size, tolerance)?;

        let twist_rate = Twist::from(rate.fixed_rows::<6>(6).into_owned());
        let (momentum, momentum_rate) = (momentum(&body, twist), momentum(&body, &twist_rate));
        let (w, v) = (&twist.angular, &twist.linear);
        let transport = Wrench::new(w.cross(&momentum.torque) + v.cross(&momentum.force), w.cross(&momentum.force));
        let size = scale(&[wrench.to_vector(), transport.to_vector(), momentum_rate.to_vector()]);
        // M is symmetric: d/dt (1/2 xi M xi) = xi M xi'
        let (power, energy_rate) = (twist.power(wrench), twist.power(&momentum_rate));
        let error = (power - energy_rate).abs() / (size * scale(&[twist.to_vector()]));
        require("power balance", sample, &power, &energy_rate, error, tolerance)?;
        let found = momentum_rate + transport;
        let error = (found - *wrench).to_vector().amax() / size;
        require("momentum balance", sample, wrench, &found, error, tolerance)?;
    }
    Ok(())
}

/// "forward(inverse(a)) = a" and "inverse(forward(w)) = w" for a pair of functions of the twist.
///
/// # Errors
/// The first broken law.
pub fn check_inverse_dynamics(
    forward: impl Fn(&Twist<f64>, &Wrench<f64>) -> BodyAcceleration<f64>,
    inverse: impl Fn(&Twist<f64>, &BodyAcceleration<f64>) -> Wrench<f64>,
    samples: &[(Twist<f64>, Wrench<f64>)],
    tolerance: f64,
) -> Result<(), LawViolation> {
    let flat =
        |a: &BodyAcceleration<f64>| Twist::new(a.angular_acceleration_body, a.acceleration_origin_body).to_vector();
    for sample @ (twist, numbers) in samples {
        let acceleration =
            BodyAcceleration { angular_acceleration_body: numbers.torque, acceleration_origin_body: numbers.force };
        let back = forward(twist, &inverse(twist, &acceleration));
        let turning = twist.to_vector().norm_squared();
        let error = (flat(&back) - flat(&acceleration)).amax() / (scale(&[flat(&acceleration)]) + turning);
        require("forward(inverse(a)) = a", sample, &acceleration, &back, error, tolerance)?;
        let wrench = inverse(twist, &forward(twist, numbers));
        let error = (wrench - *numbers).to_vector().amax() / (scale(&[numbers.to_vector()]) + turning);
        require("inverse(forward(w)) = w", sample, numbers, &wrench, error, tolerance)?;
    }
    Ok(())
}

/// The laws of every wrench model: "finite wrench", "same wrench for q and -q".
///
/// # Errors
/// The first broken law.
pub fn check_wrench_model(model: &dyn WrenchModel<f64>, states: &[State], tolerance: f64) -> Result<(), LawViolation> {
    for (i, state) in states.iter().enumerate() {
        let time_s = i as f64 * 0.37;
        let wrench = model.wrench_body(time_s, state);
        let error = if wrench.to_vector().iter().all(|x| x.is_finite()) { 0.0 } else { f64::INFINITY };
        require("finite wrench", state, &"finite numbers", &wrench, error, 0.0)?;
        let mut turned = *state;
        turned.world_from_body.rotation = UnitQuaternion::new_unchecked(-state.world_from_body.rotation.into_inner());
        let other = model.wrench_body(time_s, &turned);
        let error = (other - wrench).to_vector().amax() / scale(&[wrench.to_vector()]);
        require("same wrench for q and -q", state, &wrench, &other, error, tolerance)?;
    }
    Ok(())
}

/// The law of sums: "models add up".
///
/// # Errors
/// The broken law.
pub fn check_wrench_sum(
    sum: &dyn WrenchModel<f64>,
    parts: &[&dyn WrenchModel<f64>],
    states: &[State],
    tolerance: f64,
) -> Result<(), LawViolation> {
    for (i, state) in states.iter().enumerate() {
        let time_s = i as f64 * 0.37;
        let expected = parts.iter().fold(Wrench::zero(), |sum, part| sum + part.wrench_body(time_s, state));
        let found = sum.wrench_body(time_s, state);
        let error = (found - expected).to_vector().amax() / scale(&[expected.to_vector()]);
        require("models add up", state, &expected, &found, error, tolerance)?;
    }
    Ok(())
}

/// The laws of drag in a medium at rest: "drag vanishes at rest", "drag dissipates", "drag grows with speed".
///
/// # Errors
/// The first broken law.
pub fn check_drag(model: &dyn WrenchModel<f64>, states: &[State], tolerance: f64) -> Result<(), LawViolation> {
    for state in states {
        let at_rest = State { twist_body: Twist::zero(), ..*state };
        let wrench = model.wrench_body(0.0, &at_rest);
        require("drag vanishes at rest", &at_rest, &Wrench::<f64>::zero(), &wrench, wrench.to_vector().amax(), 0.0)?;
        let power = |factor: f64| {
            let state = State { twist_body: state.twist_body * factor, ..*state };
            state.twist_body.power(&model.wrench_body(0.0, &state))
        };
        require("drag dissipates", state, &"negative power", &power(1.0), power(1.0), tolerance)?;
        // the power of a drag that sees the velocity grows at least with its square
        let (slow, fast) = (power(1.0), power(2.0));
        let shortfall = (4.0 * slow.abs() - fast.abs()) / slow.abs().max(1.0);
        require("drag grows with speed", state, &(4.0 * slow), &fast, shortfall, tolerance)?;
    }
    Ok(())
}

/// The laws of uniform gravity: "gravity gives every body its acceleration", "gravity acts at the centre of mass".
///
/// # Errors
/// The first broken law.
pub fn check_gravity(
    model: &dyn WrenchModel<f64>,
    body: &InertialParameters<f64>,
    gravity_world: &Vector3<f64>,
    states: &[State],
    tolerance: f64,
) -> Result<(), LawViolation> {
    for state in states {
        let wrench = model.wrench_body(0.0, state);
        let force_world = state.world_from_body.rotation * wrench.force;
        let expected = gravity_world * body.mass;
        let size = expected.amax().max(1.0);
        let error = (force_world - expected).amax() / size;
        require("gravity gives every body its acceleration", state, &expected, &force_world, error, tolerance)?;
        let torque_about_com = wrench.torque - body.center_of_mass().cross(&wrench.force);
        let error = torque_about_com.amax() / (size * (1.0 + body.center_of_mass().norm()));
        let nothing = Vector3::<f64>::zeros();
        require("gravity acts at the centre of mass", state, &nothing, &torque_about_com, error, tolerance)?;
    }
    Ok(())
}

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
    commands: &[A::Command],
    excess: &dyn Fn(&A::Command, &Wrench<f64>) -> f64,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let allocate = |law, wrench: &Wrench<f64>| match actuation.allocate(wrench) {
        Ok(command) => Ok((actuation.realize(&command), command)),
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
        let realized = actuation.realize(command);
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
        let outcome = actuation.allocate(&broken);
        let error = if outcome.is_err() { 0.0 } else { f64::INFINITY };
        require("a wrench that is not finite is refused", &broken, &"an error", &outcome, error, 0.0)?;
    }
    Ok(())
}
