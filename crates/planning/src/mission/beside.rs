//! What acts besides the actuators, and how much of them it takes to hold against it.

use nalgebra::Vector3;
use tumble_dynamics::{Environment, InertialParameters, RigidBodyState, WrenchModel};
use tumble_lie::{Twist, Wrench};

/// Largest absolute components of what acts at these times, s, and states; body axes, torque about the body origin.
pub(super) fn most_beside(
    environment: &Environment,
    body: &InertialParameters<f64>,
    states: impl IntoIterator<Item = (f64, RigidBodyState<f64>)>,
) -> Wrench<f64> {
    states.into_iter().fold(Wrench::zero(), |most, (time_s, state)| {
        let acting = environment.wrench_on(body, time_s, &state);
        Wrench::new(most.torque.sup(&acting.torque.abs()), most.force.sup(&acting.force.abs()))
    })
}

/// A state, and the same as fast as may be along and about each axis, both ways; speeds along world axes.
pub(super) fn as_fast_as_may_be(
    state: RigidBodyState<f64>,
    speed_m_s: &Vector3<f64>,
    rate_rad_s: f64,
) -> impl Iterator<Item = RigidBodyState<f64>> {
    let body_from_world = state.world_from_body.rotation.inverse();
    let velocities = (0..3).map(|axis| body_from_world * (Vector3::ith(axis, speed_m_s[axis])));
    let rates = (0..3).map(|axis| Vector3::ith(axis, rate_rad_s));
    let fast = velocities.map(|linear| Twist::new(Vector3::zeros(), linear));
    let turning = rates.map(|angular| Twist::new(angular, Vector3::zeros()));
    let twists: Vec<_> = fast.chain(turning).flat_map(|twist| [twist, twist * -1.0]).collect();
    std::iter::once(state).chain(twists.into_iter().map(move |twist_body| RigidBodyState { twist_body, ..state }))
}
