//! Prints a hash of every byte of two tumbles of 200 000 steps, free and under a sinusoidal wrench.
//!
//! The output must not depend on the optimisation level or the processor: `cargo xtask ci --only determinism` runs this
//! program as tests are built and compares with what it printed as users build it.

use tumble_dynamics::lie::{Twist, Wrench};
use tumble_dynamics::nalgebra::{ComplexField, Matrix3, Vector3};
use tumble_dynamics::{DynamicsError, InertialParameters, RigidBodyState, variational_step};

const STEPS: u32 = 200_000;

/// FNV-1a, 64 bits.
fn absorb(hash: u64, number: f64) -> u64 {
    number.to_le_bytes().iter().fold(hash, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

fn tumble(wrench_body: impl Fn(f64) -> Wrench<f64>) -> Result<u64, DynamicsError> {
    let body = InertialParameters::about_origin(
        5.0,
        Vector3::new(0.05, 0.1, 0.05),
        Matrix3::new(1.5, 0.1, 0.2, 0.1, 2.0, 0.3, 0.2, 0.3, 3.0),
    );
    let mut state = RigidBodyState {
        twist_body: Twist::new(Vector3::new(0.5, 0.8, -0.6), Vector3::zeros()),
        ..RigidBodyState::at_rest()
    };
    let mut hash = 0xcbf2_9ce4_8422_2325;
    for k in 0..STEPS {
        state = variational_step(&body, &state, &wrench_body(f64::from(k) * 0.01), 0.01)?;
        let pose = &state.world_from_body;
        let numbers = pose.rotation.coords.iter().chain(pose.translation.vector.iter());
        hash = numbers.copied().chain(state.twist_body.to_vector().iter().copied()).fold(hash, absorb);
    }
    Ok(hash)
}

fn main() -> Result<(), DynamicsError> {
    println!("free   {:016x}", tumble(|_| Wrench::zero())?);
    // Sines through nalgebra's traits, which take them from libm and not from the platform.
    let wave = |phase: f64| Vector3::new(phase, 1.3 * phase + 1.0, 0.7 * phase + 2.0).map(ComplexField::sin);
    println!("driven {:016x}", tumble(|time_s| Wrench::new(wave(time_s) * 0.3, wave(1.7 * time_s) * 0.2))?);
    Ok(())
}
