//! Laws of wrench models.

use super::forces::scale;
use crate::inertia::InertialParameters;
use crate::laws::{LawViolation, require};
use crate::state::RigidBodyState;
use crate::system::WrenchModel;
use std::boxed::Box;
use tumble_lie::nalgebra::{SVector, UnitQuaternion, Vector3, Vector6};
use tumble_lie::{Manifold, Pose, Twist, Wrench};

type State = RigidBodyState<f64>;

/// What kind of wrench a model claims to give: what tells its sign.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub enum WrenchNature<'a> {
    /// Takes energy from the body, whatever it does: drag in a medium at rest.
    Dissipates,
    /// Does the work that a potential loses: gravity, a spring. It may depend on time, not on velocity.
    Potential {
        /// The potential of a state, J.
        energy_j: &'a dyn Fn(f64, &State) -> f64,
        /// Way over which the potential is nearly linear, m; a difference quotient goes this far, and as many rad.
        width_m: f64,
    },
    /// Neither: a push, a wind.
    Any,
}

/// The model in a world that is displaced as a whole, everything in it with it: sun, wind, anchor.
///
/// Of the identity it is the model itself.
pub type WrenchModelIn<'a> = dyn Fn(&Pose<f64>) -> Box<dyn WrenchModel<f64>> + 'a;

/// The laws of every wrench model.
///
/// "finite wrench"; "same wrench for q and -q"; "nothing depends on where the world stands": a body displaced with all
/// that is around it feels the same; "affine in the body" of [`WrenchModel::wrench_on`]; and of its
/// [`WrenchNature`] "dissipates" (no positive power), or "does the work that the potential loses" (`tolerance` not below
/// 1e-8) and "a potential does not see velocity".
///
/// `tolerance` is relative to the largest torque and force over all `states`.
/// # Errors
/// The first broken law.
pub fn check_wrench_model(
    model_in: &WrenchModelIn<'_>,
    nature: WrenchNature<'_>,
    states: &[State],
    tolerance: f64,
) -> Result<(), LawViolation> {
    let model = model_in(&Pose::identity());
    let at = |i: usize| i as f64 * 0.37;
    let wrenches: Vec<_> = states.iter().enumerate().map(|(i, state)| model.wrench_body(at(i), state)).collect();
    for (state, wrench) in states.iter().zip(&wrenches) {
        let error = if wrench.to_vector().iter().all(|x| x.is_finite()) { 0.0 } else { f64::INFINITY };
        require("finite wrench", state, &"finite numbers", wrench, error, 0.0)?;
    }
    let size = Size::of(&wrenches);
    for (i, (state, wrench)) in states.iter().zip(&wrenches).enumerate() {
        let mut turned = *state;
        turned.world_from_body.rotation = UnitQuaternion::new_unchecked(-state.world_from_body.rotation.into_inner());
        let other = model.wrench_body(at(i), &turned);
        let error = size.error(&(other - *wrench));
        require("same wrench for q and -q", state, wrench, &other, error, tolerance)?;

        let displacement = states[(i + 1) % states.len()].world_from_body;
        let displaced = State { world_from_body: displacement * state.world_from_body, ..*state };
        let other = model_in(&displacement).wrench_body(at(i), &displaced);
        let error = size.error(&(other - *wrench));
        require("nothing depends on where the world stands", state, wrench, &other, error, tolerance)?;
        check_affine(&*model, at(i), state, tolerance)?;
        match nature {
            WrenchNature::Any => {}
            WrenchNature::Dissipates => {
                let power = state.twist_body.power(wrench);
                let terms = state.twist_body.to_vector().abs().dot(&wrench.to_vector().abs());
                let error = if power > 0.0 { power / terms } else { 0.0 };
                require("dissipates", state, &"no positive power", &power, error, tolerance)?;
            }
            WrenchNature::Potential { energy_j, width_m } => {
                let still = State { twist_body: Twist::zero(), ..*state };
                let other = model.wrench_body(at(i), &still);
                let error = size.error(&(other - *wrench));
                require("a potential does not see velocity", state, wrench, &other, error, tolerance)?;
                let lost = work(&|state| energy_j(at(i), state), state, width_m);
                let error = size.error(&(lost - *wrench));
                require("does the work that the potential loses", state, &lost, wrench, error, tolerance)?;
            }
        }
    }
    Ok(())
}

/// Largest torque and force of a model.
struct Size {
    torque: f64,
    force: f64,
}

impl Size {
    fn of(wrenches: &[Wrench<f64>]) -> Self {
        let largest = |part: fn(&Wrench<f64>) -> f64| wrenches.iter().map(part).fold(0.0, f64::max);
        Self { torque: largest(|w| w.torque.amax()), force: largest(|w| w.force.amax()) }
    }

    fn error(&self, difference: &Wrench<f64>) -> f64 {
        let part = |difference: f64, size: f64| if difference == 0.0 { 0.0 } else { difference / size };
        let nan = difference.to_vector().iter().any(|x| x.is_nan());
        let torque = part(difference.torque.amax(), self.torque);
        if nan { f64::NAN } else { torque.max(part(difference.force.amax(), self.force)) }
    }
}

/// Minus the slope of a potential along increments of the pose, body axes.
fn work(energy_j: &dyn Fn(&State) -> f64, state: &State, width_m: f64) -> Wrench<f64> {
    let slope = |i: usize| {
        let at = |amount: f64| {
            let increment = SVector::<f64, 12>::from_fn(|k, _| if k == i { amount * width_m } else { 0.0 });
            energy_j(&state.oplus(&increment))
        };
        (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * width_m)
    };
    Wrench::from(-Vector6::from_fn(|i, _| slope(i)))
}

/// "affine in the body".
fn check_affine(model: &dyn WrenchModel<f64>, time_s: f64, state: &State, tolerance: f64) -> Result<(), LawViolation> {
    let (nothing, per_parameter) = model.wrench_regressor(time_s, state);
    let body = InertialParameters::about_com(
        3.0,
        Vector3::new(0.1, -0.2, 0.3),
        tumble_lie::nalgebra::Matrix3::new(0.7, 0.1, -0.05, 0.1, 0.8, 0.02, -0.05, 0.02, 0.9),
    );
    let expected = nothing + Wrench::from(per_parameter * body.to_vector());
    let found = model.wrench_on(&body, time_s, state);
    let error = Size::of(&[expected, found]).error(&(found - expected));
    require("affine in the body", state, &expected, &found, error, tolerance)
}

/// "gravity of a body is that of all its points": a model against the sum over clouds of points in its field.
///
/// `acceleration_world` is the acceleration of a point at a time and place (inertial axes), for instance that of a point
/// mass less that of the point which falls freely. `tolerance` is relative, and holds what the model leaves out.
/// # Errors
/// The broken law.
pub fn check_gravity_of_points(
    model: &dyn WrenchModel<f64>,
    acceleration_world: &dyn Fn(f64, &Vector3<f64>) -> Vector3<f64>,
    clouds: &[Vec<(f64, Vector3<f64>)>],
    states: &[State],
    tolerance: f64,
) -> Result<(), LawViolation> {
    let cases: Vec<_> = clouds.iter().zip(states.iter().cycle()).enumerate().collect();
    let sum = |i: usize, points: &[(f64, Vector3<f64>)], state: &State| {
        points.iter().fold(Wrench::zero(), |sum, (mass, place)| {
            let there = state.world_from_body.transform_point(&(*place).into()).coords;
            let pull = acceleration_world(i as f64 * 0.37, &there) * *mass;
            let force = state.world_from_body.rotation.inverse() * pull;
            sum + Wrench::new(place.cross(&force), force)
        })
    };
    let expected: Vec<_> = cases.iter().map(|(i, (points, state))| sum(*i, points, state)).collect();
    let size = Size::of(&expected);
    for ((i, (points, state)), expected) in cases.iter().zip(&expected) {
        let body = InertialParameters::from_points(points);
        let found = model.wrench_on(&body, *i as f64 * 0.37, state);
        let error = size.error(&(found - *expected));
        let inputs = (&body, state);
        require("gravity of a body is that of all its points", &inputs, expected, &found, error, tolerance)?;
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
