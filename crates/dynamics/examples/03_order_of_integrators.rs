//! The order of every integrator, observed: the error of a forced motion against the step.

use tumble_dynamics::lie::{Manifold, Twist, Wrench};
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_dynamics::{
    DynamicsError, FreeFlyer, GaussLegendre4, InertialParameters, Integrator, LieEuler, MuntheKaas4, RigidBodyState,
    RungeKutta4, VariationalFreeFlyer,
};

fn end_of_motion(
    integrator: &dyn Integrator<FreeFlyer<f64>>,
    steps: u32,
) -> Result<RigidBodyState<f64>, DynamicsError> {
    let body = FreeFlyer::new(InertialParameters::about_origin(
        5.0,
        Vector3::new(0.05, 0.1, 0.05),
        Matrix3::new(1.5, 0.1, 0.2, 0.1, 2.0, 0.3, 0.2, 0.3, 3.0),
    ));
    let wrench_body = Wrench::new(Vector3::new(0.4, -0.3, 0.5), Vector3::new(1.0, 0.6, -0.8));
    let mut state = RigidBodyState {
        twist_body: Twist::new(Vector3::new(0.5, 0.8, -0.6), Vector3::new(0.3, -0.2, 0.1)),
        ..RigidBodyState::at_rest()
    };
    let step_s = 4.0 / f64::from(steps);
    for k in 0..steps {
        state = integrator.step(&body, &state, &wrench_body, f64::from(k) * step_s, step_s)?;
    }
    Ok(state)
}

fn main() -> Result<(), DynamicsError> {
    let exact = end_of_motion(&GaussLegendre4, 4000)?;
    let integrators: [(&str, &dyn Integrator<FreeFlyer<f64>>); 5] = [
        ("Lie-Euler", &LieEuler),
        ("variational", &VariationalFreeFlyer),
        ("Runge-Kutta 4", &RungeKutta4),
        ("Munthe-Kaas 4", &MuntheKaas4),
        ("Gauss-Legendre 4", &GaussLegendre4),
    ];
    println!("{:18} error at h = 50, 25, 12.5 ms        order", "");
    for (name, integrator) in integrators {
        let error = |steps| Ok::<f64, DynamicsError>(end_of_motion(integrator, steps)?.ominus(&exact).norm());
        let (coarse, middle, fine) = (error(80)?, error(160)?, error(320)?);
        let order = (middle / fine).log2();
        println!("{name:18} {coarse:9.2e} {middle:9.2e} {fine:9.2e}     {order:.2} (claimed {})", integrator.order());
        assert!((order - f64::from(integrator.order())).abs() < 0.2);
    }
    Ok(())
}
