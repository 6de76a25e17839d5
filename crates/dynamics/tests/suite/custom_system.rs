//! Tutorial: bring your own system of differential equations.
//!
//! A [`MechanicalSystem`] is a state that is a `Manifold` and a vector field; every integrator of the crate then steps
//! it. States in R^n are plain `SVector`s; other manifolds say how an increment is applied.

use tumble_dynamics::laws::{ModelSample, check_order, check_parametric_model};
use tumble_dynamics::lie::Scalar;
use tumble_dynamics::nalgebra::{Vector1, Vector2};
use tumble_dynamics::{
    DynamicsError, GaussLegendre4, Integrator, LieEuler, MechanicalSystem, MuntheKaas4, ParametricModel, RungeKutta4,
};

/// A damped pendulum driven by a torque; the state is angle (rad) and rate (rad/s).
struct Pendulum<T> {
    length_m: T,
    damping_per_s: T,
}

impl<T: Scalar> MechanicalSystem for Pendulum<T> {
    type State = Vector2<T>;
    /// Angular acceleration given by the drive, rad/s^2.
    type Input = T;
    fn vector_field(&self, _time_s: T, state: &Vector2<T>, drive: &T) -> Result<Vector2<T>, DynamicsError> {
        let gravity: T = tumble_dynamics::lie::real(9.81);
        let acceleration = *drive - gravity / self.length_m * state.x.sin() - self.damping_per_s * state.y;
        if acceleration.is_finite() { Ok(Vector2::new(state.y, acceleration)) } else { Err(DynamicsError::NotFinite) }
    }
}

#[test]
fn every_integrator_steps_it_with_its_order() {
    let pendulum = Pendulum { length_m: 1.5, damping_per_s: 0.2 };
    let start = Vector2::new(1.0, 0.5);
    check_order(&LieEuler, &pendulum, &start, &0.3, 0.01, 50, 0.2).unwrap();
    check_order(&RungeKutta4, &pendulum, &start, &0.3, 0.1, 10, 0.2).unwrap();
    check_order(&MuntheKaas4, &pendulum, &start, &0.3, 0.1, 10, 0.2).unwrap();
    check_order(&GaussLegendre4, &pendulum, &start, &0.3, 0.1, 10, 0.2).unwrap();
}

#[test]
fn where_the_field_has_no_value_the_step_is_an_error() {
    let pendulum = Pendulum { length_m: 0.0, damping_per_s: 0.2 };
    assert_eq!(RungeKutta4.step(&pendulum, &Vector2::new(1.0, 0.0), &0.0, 0.0, 0.1), Err(DynamicsError::NotFinite));
}

/// One step as a function of its parameters, for exact sensitivities.
#[derive(Debug)]
struct PendulumStep;

impl ParametricModel for PendulumStep {
    type State<T: Scalar> = Vector2<T>;
    type Input<T: Scalar> = Vector1<T>;
    /// Length (m), damping (1/s).
    type Parameters<T: Scalar> = Vector2<T>;
    fn lift<T: Scalar>(state: &Vector2<f64>) -> Vector2<T> {
        state.map(tumble_dynamics::lie::real)
    }
    fn step<T: Scalar>(
        &self,
        state: &Vector2<T>,
        drive: &Vector1<T>,
        parameters: &Vector2<T>,
        step_s: T,
    ) -> Result<Vector2<T>, DynamicsError> {
        let pendulum = Pendulum { length_m: parameters.x, damping_per_s: parameters.y };
        RungeKutta4.step(&pendulum, state, &drive.x, T::zero(), step_s)
    }
}

#[test]
fn its_sensitivities_are_exact() {
    let sample = ModelSample {
        state: Vector2::new(1.0, 0.5),
        input: Vector1::new(0.3),
        input_size: Vector1::new(1.0),
        parameters: Vector2::new(1.5, 0.2),
        parameter_size: Vector2::new(0.1, 0.1),
        step_s: 0.1,
    };
    check_parametric_model(&PendulumStep, &sample, 1e-9).unwrap();
}
