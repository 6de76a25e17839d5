//! A simulated flight with unknown cargo: what `tumble identify --demo` identifies.

pub mod arm;
pub mod throw;

use std::f64::consts::TAU;
use tumble_dynamics::nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};
use tumble_dynamics::{DynamicsError, FreeFlyer, InertialParameters, Integrator, MuntheKaas4, RigidBodyState};
use tumble_identification::MotionSample;
use tumble_identification::noise::Gaussian;
use tumble_lie::{LieGroup, Wrench};

/// Sample time of the flight, s (62.5 Hz, the robot's control rate).
pub const STEP_S: f64 = 0.016;
/// Samples of the flight.
const SAMPLES: u32 = 3750;
/// Length of the flight, s.
pub const DURATION_S: f64 = SAMPLES as f64 * STEP_S;
/// Noise of the logged wrench per sample, one sigma, N m and N.
pub const WRENCH_NOISE: (f64, f64) = (1e-4, 1e-3);
/// Noise of the logged poses per sample, one sigma, rad and m.
pub const POSE_NOISE: (f64, f64) = (1e-3, 1e-3);
/// Integration steps per sample: the fourth-order error is then far below the noise.
const SUBSTEPS: u32 = 4;

/// A flight and the body that flew it.
pub struct Demo {
    /// What the robot logged.
    pub record: Vec<MotionSample>,
    /// What it really carried.
    pub truth: InertialParameters<f64>,
}

/// The robot (thesis table 6.4) with its cargo held at the perching arm.
fn body_with_cargo(noise: &mut Gaussian) -> InertialParameters<f64> {
    let robot = InertialParameters::about_com(
        9.5838,
        Vector3::zeros(),
        Matrix3::from_diagonal(&Vector3::new(0.1534, 0.1427, 0.1623)),
    );
    let edges = [0.15 + 0.15 * noise.uniform(), 0.1 + 0.2 * noise.uniform(), 0.1 + 0.1 * noise.uniform()];
    let cargo = InertialParameters::solid_box(1.5 + 3.0 * noise.uniform(), edges);
    let robot_from_cargo = Isometry3::from_parts(
        Vector3::new(-0.1, -0.25, 0.05).into(),
        <UnitQuaternion<f64> as LieGroup>::exp(&noise.vector(0.4)),
    );
    robot.with_payload(&cargo, &robot_from_cargo)
}

/// Simulates the flight that belongs to `seed`: cargo, excitation and noise all follow from it.
///
/// # Errors
/// [`DynamicsError`] if the simulation fails.
pub fn simulate(seed: u64) -> Result<Demo, DynamicsError> {
    let mut noise = Gaussian::from_seed(seed);
    let truth = body_with_cargo(&mut noise);
    let flyer = FreeFlyer::new(truth);
    let excitation = Multisine::new(&mut noise);
    let mut state = RigidBodyState::at_rest();
    let mut record = Vec::new();
    for k in 0..SAMPLES {
        let time_s = f64::from(k) * STEP_S;
        let wrench = excitation.wrench(time_s);
        let measured_rotation =
            state.world_from_body.rotation * <UnitQuaternion<f64> as LieGroup>::exp(&noise.vector(POSE_NOISE.0));
        let measured_position = state.world_from_body.translation.vector + noise.vector(POSE_NOISE.1);
        record.push(MotionSample {
            time_ns: i64::from(k) * 16_000_000,
            world_from_body: Some(Isometry3::from_parts(measured_position.into(), measured_rotation)),
            velocity_origin_world: None,
            rate_body: None,
            acceleration_origin_body: None,
            wrench_body: Some(Wrench::new(
                wrench.torque + noise.vector(WRENCH_NOISE.0),
                wrench.force + noise.vector(WRENCH_NOISE.1),
            )),
            ..MotionSample::default()
        });
        for i in 0..SUBSTEPS {
            let substep_s = STEP_S / f64::from(SUBSTEPS);
            state = MuntheKaas4.step(&flyer, &state, &wrench, time_s + f64::from(i) * substep_s, substep_s)?;
        }
    }
    Ok(Demo { record, truth })
}

/// A sum of sines per axis within the robot's force and torque limits.
struct Multisine {
    /// Per axis (torque, then force): amplitude of each tone.
    amplitude: [f64; 6],
    /// Per axis: (angular frequency, phase) of each tone.
    tones: [[(f64, f64); TONES]; 6],
}

const TONES: usize = 4;

impl Multisine {
    fn new(noise: &mut Gaussian) -> Self {
        let limits = [0.03, 0.02, 0.02, 0.4, 0.2, 0.2];
        let tones = std::array::from_fn(|axis| {
            std::array::from_fn(|tone| {
                // Distinct frequencies 0.04 to 0.43 Hz over all axes and tones.
                let hz = 0.04 + 0.016 * (tone * 6 + axis) as f64;
                (TAU * hz, TAU * noise.uniform())
            })
        });
        Self { amplitude: limits.map(|limit| limit / TONES as f64), tones }
    }

    fn wrench(&self, time_s: f64) -> Wrench<f64> {
        let axis = |i: usize| {
            let sum: f64 = self.tones[i].iter().map(|(omega, phase)| libm::sin(omega * time_s + phase)).sum();
            self.amplitude[i] * sum
        };
        Wrench::new(Vector3::new(axis(0), axis(1), axis(2)), Vector3::new(axis(3), axis(4), axis(5)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_seed_one_flight() {
        let (a, b, c) = (simulate(5).unwrap(), simulate(5).unwrap(), simulate(6).unwrap());
        assert_eq!(a.record, b.record);
        assert_ne!(a.truth, c.truth);
        assert!(a.truth.is_strictly_consistent());
    }
}
