//! Tutorial: your own wrench model.
//!
//! Implement [`WrenchModel`] for your type, run `check_wrench_model`, then add it to others and step a body in it.

use tumble_dynamics::laws::{WrenchNature, check_wrench_model, check_wrench_sum};
use tumble_dynamics::lie::{Pose, Scalar, Wrench};
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::strategies::{draws, states};
use tumble_dynamics::{
    FreeFlyer, FreeFlyerIn, InertialParameters, Integrator, LinearDrag, MuntheKaas4, RigidBodyState, WrenchModel,
    kinetic_energy,
};

/// An elastic tether from a point of the world to a point of the body, slack length zero.
struct Tether<T: Scalar> {
    anchor_world: Vector3<T>,
    attachment_body: Vector3<T>,
    stiffness_n_m: T,
}

impl<T: Scalar> Tether<T> {
    /// From attachment to anchor, body axes.
    fn pull_body(&self, state: &RigidBodyState<T>) -> Vector3<T> {
        let pose = &state.world_from_body;
        let anchor_body = pose.rotation.inverse() * (self.anchor_world - pose.translation.vector);
        (anchor_body - self.attachment_body) * self.stiffness_n_m
    }
}

// Generic over the scalar, so that derivatives flow through it; `f64` alone would do as well.
impl<T: Scalar> WrenchModel<T> for Tether<T> {
    fn wrench_body(&self, _time_s: T, state: &RigidBodyState<T>) -> Wrench<T> {
        let force = self.pull_body(state);
        Wrench::new(self.attachment_body.cross(&force), force) // torque about the body origin
    }
}

fn tether() -> Tether<f64> {
    Tether {
        anchor_world: Vector3::new(0.5, 0.0, 1.0),
        attachment_body: Vector3::new(0.1, 0.15, 0.0),
        stiffness_n_m: 2.0,
    }
}

/// Air that damps motion.
fn air() -> LinearDrag<f64> {
    LinearDrag {
        center_of_pressure: Vector3::zeros(),
        force_coefficient: 0.05,
        torque_coefficient: 0.002,
        medium_velocity_world: Vector3::zeros(),
    }
}

/// Elastic energy of the tether.
fn elastic_energy(state: &RigidBodyState<f64>) -> f64 {
    let stretch = tether().pull_body(state).norm() / tether().stiffness_n_m;
    0.5 * tether().stiffness_n_m * stretch * stretch
}

/// Kinetic energy and the elastic energy of the tether.
fn energy(body: &InertialParameters<f64>, state: &RigidBodyState<f64>) -> f64 {
    kinetic_energy(body, &state.twist_body) + elastic_energy(state)
}

#[test]
fn it_obeys_the_laws() {
    let states = draws(&states(), 1, 200);
    // displace the world: the anchor goes with it
    let in_world = |world: &Pose<f64>| -> Box<dyn WrenchModel<f64>> {
        let anchor_world = world.transform_point(&tether().anchor_world.into()).coords;
        Box::new(Tether { anchor_world, ..tether() })
    };
    // and what the wrench does is what the tether loses
    let elastic_j = |_: f64, state: &RigidBodyState<f64>| elastic_energy(state);
    let nature = WrenchNature::Potential { energy_j: &elastic_j, width_m: 0.01 };
    check_wrench_model(&in_world, nature, &states, 1e-8).unwrap();
    check_wrench_sum(&(tether(), air()), &[&tether(), &air()], &states, 1e-12).unwrap();
}

#[test]
fn a_tethered_body_keeps_its_energy_and_loses_it_in_air() {
    let parameters = InertialParameters::solid_box(9.5, [0.3, 0.3, 0.3]);
    let body = FreeFlyer::new(parameters);
    let start = RigidBodyState::at_rest();
    let swing = |environment: &dyn WrenchModel<f64>| {
        let system = FreeFlyerIn { body, environment };
        let mut state = start;
        for step in 0..2_000 {
            let time_s = f64::from(step) * 0.01;
            state = MuntheKaas4.step(&system, &state, &Wrench::zero(), time_s, 0.01).unwrap();
        }
        energy(&parameters, &state)
    };
    let before = energy(&parameters, &start);
    assert!((swing(&tether()) - before).abs() < 1e-6 * before);
    // models of different types, summed as trait objects
    let both: [&dyn WrenchModel<f64>; 2] = [&tether(), &air()];
    let after = swing(&both);
    assert!(after > 0.5 * before && after < 0.99 * before, "{after} of {before}");
}
