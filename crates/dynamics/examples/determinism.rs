//! A long free tumble, hashed: the same bytes on every processor and at every optimisation level.
//!
//! `cargo xtask ci --only determinism` builds this three ways and compares what it prints.

use tumble_dynamics::lie::{Pose, Twist, Wrench};
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_dynamics::{
    DynamicsError, FreeFlyer, InertialParameters, Integrator, MuntheKaas4, RigidBodyState, VariationalFreeFlyer,
    spatial_momentum,
};

const STEPS: usize = 200_000;
const STEP_S: f64 = 0.01;

fn main() -> Result<(), DynamicsError> {
    let body = FreeFlyer::new(InertialParameters::about_origin(
        5.0,
        Vector3::new(0.05, 0.10, 0.05),
        Matrix3::new(1.5, 0.1, 0.2, 0.1, 2.0, 0.3, 0.2, 0.3, 3.0),
    ));
    let (hash, drift) = tumble(&body, &VariationalFreeFlyer)?;
    println!("variational   {hash:016x}, momentum lost {drift:e}");
    assert!(drift < 1e-9, "the variational integrator keeps the spatial momentum");
    let (hash, drift) = tumble(&body, &MuntheKaas4)?;
    println!("munthe-kaas 4 {hash:016x}, momentum lost {drift:e}");
    Ok(())
}

/// FNV-1a over the bits of every state, and the share of the spatial momentum lost on the way.
fn tumble(body: &FreeFlyer<f64>, integrator: &impl Integrator<FreeFlyer<f64>>) -> Result<(u64, f64), DynamicsError> {
    let mut state = RigidBodyState {
        world_from_body: Pose::identity(),
        twist_body: Twist::new(Vector3::new(0.5, 0.8, -0.6), Vector3::zeros()),
    };
    let start = spatial_momentum(body.parameters(), &state).to_vector();
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for _ in 0..STEPS {
        state = integrator.step(body, &state, &Wrench::zero(), 0.0, STEP_S)?;
        let (rotation, position) = (state.world_from_body.rotation.coords, state.world_from_body.translation.vector);
        let numbers = rotation.iter().chain(&position).chain(&state.twist_body.angular).chain(&state.twist_body.linear);
        for byte in numbers.flat_map(|number| number.to_bits().to_le_bytes()) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    let drift = (spatial_momentum(body.parameters(), &state).to_vector() - start).norm() / start.norm();
    Ok((hash, drift))
}
