//! Tutorial: your own body with your own equations of motion.
//!
//! Implement [`RigidBody`] (what it weighs) and [`MechanicalSystem`] (how it moves), run `check_system`, then use any
//! integrator.

use tumble_dynamics::laws::{InertiaOperations, InertiaSamples, check_inertia, check_system};
use tumble_dynamics::lie::{Twist, Wrench};
use tumble_dynamics::nalgebra::{Matrix3, SVector, Vector3};
use tumble_dynamics::strategies::{clouds, draws, judged_bodies, poses, states, wrenches};
use tumble_dynamics::{
    DynamicsError, InertialParameters, Integrator, MechanicalSystem, MuntheKaas4, RigidBody, RigidBodyState,
    kinetic_energy,
};

/// A jack: three crossed dumbbells. Its frame lies at the centre, along the bars, so Euler's equations are scalar.
struct Jack {
    /// Mass of each of the six balls, kg.
    ball_kg: f64,
    /// Half lengths of the bars, m.
    arms_m: Vector3<f64>,
}

impl Jack {
    fn mass_kg(&self) -> f64 {
        6.0 * self.ball_kg
    }
    fn principal_moments(&self) -> Vector3<f64> {
        let squares = self.arms_m.component_mul(&self.arms_m);
        squares.map(|own| 2.0 * self.ball_kg * (squares.sum() - own))
    }
}

impl RigidBody for Jack {
    type Scalar = f64;
    fn inertial_parameters(&self) -> InertialParameters<f64> {
        let inertia = Matrix3::from_diagonal(&self.principal_moments());
        InertialParameters::about_com(self.mass_kg(), Vector3::zeros(), inertia)
    }
}

impl MechanicalSystem for Jack {
    type State = RigidBodyState<f64>;
    type Input = Wrench<f64>;

    fn vector_field(
        &self,
        _time_s: f64,
        state: &RigidBodyState<f64>,
        wrench: &Wrench<f64>,
    ) -> Result<SVector<f64, 12>, DynamicsError> {
        let Twist { angular: w, linear: v } = state.twist_body;
        let j = self.principal_moments();
        let angular = Vector3::new(
            (wrench.torque.x + (j.y - j.z) * w.y * w.z) / j.x,
            (wrench.torque.y + (j.z - j.x) * w.z * w.x) / j.y,
            (wrench.torque.z + (j.x - j.y) * w.x * w.y) / j.z,
        );
        let linear = wrench.force / self.mass_kg() - w.cross(&v); // components in axes that turn
        let mut rate = SVector::<f64, 12>::zeros();
        rate.fixed_rows_mut::<6>(0).copy_from(&state.twist_body.to_vector());
        rate.fixed_rows_mut::<6>(6).copy_from(&Twist::new(angular, linear).to_vector());
        Ok(rate)
    }
}

fn jack() -> Jack {
    Jack { ball_kg: 0.2, arms_m: Vector3::new(0.3, 0.2, 0.1) }
}

#[test]
fn it_obeys_the_laws() {
    let samples: Vec<_> = draws(&states(), 1, 200).into_iter().zip(draws(&wrenches(1.0, 1.0), 2, 200)).collect();
    check_system(&jack(), &samples, 1e-12).unwrap();
}

#[test]
fn its_parameters_are_those_of_its_balls() {
    let balls: Vec<_> = [Vector3::x() * 0.3, Vector3::y() * 0.2, Vector3::z() * 0.1]
        .into_iter()
        .flat_map(|place| [(0.2, place), (0.2, -place)])
        .collect();
    let expected = InertialParameters::from_points(&balls).to_vector();
    assert!((jack().inertial_parameters().to_vector() - expected).amax() < 1e-15);
    // your own inertia code enters the laws of inertia operation by operation
    let mine =
        InertiaOperations { transformed_by: |body, a_from_b| body.transformed_by(a_from_b), ..Default::default() };
    let samples = InertiaSamples {
        clouds: draws(&clouds(6), 3, 20),
        candidates: draws(&judged_bodies(), 4, 20).iter().map(|body| body.parameters).collect(),
        poses: draws(&poses(2.0), 5, 4),
    };
    check_inertia(&mine, &samples, 1e-10).unwrap();
}

#[test]
fn any_integrator_moves_it() {
    let mut state = RigidBodyState::at_rest();
    state.twist_body.angular = Vector3::new(0.01, 2.0, 0.01); // about the middle axis: it will flip
    let energy = |state: &RigidBodyState<f64>| kinetic_energy(&jack().inertial_parameters(), &state.twist_body);
    let before = energy(&state);
    let mut slowest = f64::INFINITY;
    for _ in 0..4_000 {
        state = MuntheKaas4.step(&jack(), &state, &Wrench::zero(), 0.0, 0.005).unwrap();
        slowest = slowest.min(state.twist_body.angular.y);
    }
    assert!((energy(&state) - before).abs() < 1e-9 * before);
    assert!(slowest < -1.9, "the middle axis is unstable: {slowest}");
}
