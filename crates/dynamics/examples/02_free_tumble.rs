//! A free tumble keeps its momentum: 100 s of a body thrown with a spin, by two integrators.

use tumble_dynamics::lie::{Twist, Wrench};
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_dynamics::{
    DynamicsError, FreeFlyer, InertialParameters, Integrator, RigidBodyState, RungeKutta4, VariationalFreeFlyer,
    kinetic_energy, spatial_momentum,
};

fn main() -> Result<(), DynamicsError> {
    let body = InertialParameters::about_com(
        9.58,
        Vector3::new(0.05, 0.1, 0.05),
        Matrix3::from_diagonal(&Vector3::new(0.153, 0.143, 0.162)),
    );
    let start = RigidBodyState {
        twist_body: Twist::new(Vector3::new(0.5, 0.8, -0.6), Vector3::new(0.1, 0.0, 0.05)),
        ..RigidBodyState::at_rest()
    };
    let variational = drifts(&VariationalFreeFlyer, body, start)?;
    let classical = drifts(&RungeKutta4, body, start)?;
    println!("after 100 s in steps of 0.1 s     momentum drift   energy error");
    println!("variational, dual quaternions     {:.1e}          {:.1e}", variational.0, variational.1);
    println!("Runge-Kutta of order 4            {:.1e}          {:.1e}", classical.0, classical.1);
    assert!(variational.0 < 1e-11, "the variational integrator keeps the momentum to rounding");
    assert!(classical.0 > 1e-9, "the classical one does not");
    Ok(())
}

/// Relative drift of the spatial momentum and relative energy error.
fn drifts(
    integrator: &impl Integrator<FreeFlyer<f64>>,
    body: InertialParameters<f64>,
    start: RigidBodyState<f64>,
) -> Result<(f64, f64), DynamicsError> {
    let system = FreeFlyer::new(body);
    let mut state = start;
    for k in 0..1000 {
        state = integrator.step(&system, &state, &Wrench::zero(), 0.1 * f64::from(k), 0.1)?;
    }
    let (before, after) = (spatial_momentum(&body, &start), spatial_momentum(&body, &state));
    let momentum = (after - before).to_vector().norm() / before.to_vector().norm();
    let energy = kinetic_energy(&body, &state.twist_body) / kinetic_energy(&body, &start.twist_body) - 1.0;
    Ok((momentum, energy.abs()))
}
