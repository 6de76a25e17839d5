//! Mass, centre of mass and inertia from poses alone: twenty seconds of a body pushed about by its thrusters.

use tumble_identification::dynamics::{
    DynamicsError, FreeFlyer, InertialParameters, Integrator, RigidBodyState, RungeKutta4,
};
use tumble_identification::lie::Wrench;
use tumble_identification::nalgebra::{Matrix3, Vector3};
use tumble_identification::{IdentificationError, MotionSample, Settings, identify};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let truth = InertialParameters::about_com(
        9.58,
        Vector3::new(0.03, -0.02, 0.05),
        Matrix3::new(0.153, 0.004, -0.006, 0.004, 0.143, 0.003, -0.006, 0.003, 0.162),
    );
    let found = identify(&fly(&truth)?, &Settings::default())?;
    let estimate = found.estimate.ok_or(IdentificationError::NoEstimate { rank: found.rank })?;
    let (body, std) = (estimate.parameters, estimate.std);
    println!("{:?}, rank {}, condition number {:.0}", found.method, found.rank, found.condition_number);
    println!("mass           {:.5} +- {:.5} kg     truth {}", body.mass, std.mass_kg, truth.mass);
    let (c, s, t) = (body.center_of_mass(), std.center_of_mass_m, truth.center_of_mass());
    println!("centre of mass ({:.5}, {:.5}, {:.5}) +- {:.5} m  truth {:?}", c.x, c.y, c.z, s.max(), t.as_slice());
    let (j, t) = (body.inertia_about_com(), truth.inertia_about_com());
    println!(
        "inertia        ({:.5}, {:.5}, {:.5}) kg m^2      truth {:?}",
        j.m11,
        j.m22,
        j.m33,
        t.diagonal().as_slice()
    );
    assert!((body.mass - truth.mass).abs() < 5.0 * std.mass_kg && std.mass_kg < 0.02);
    assert!((c - truth.center_of_mass()).norm() < 1e-3 && (j - t).norm() < 1e-3);
    Ok(())
}

/// Poses at 20 Hz with exact positions; every push is known to 5 mN and 0.5 mN m only.
fn fly(body: &InertialParameters<f64>) -> Result<Vec<MotionSample>, DynamicsError> {
    let system = FreeFlyer::new(*body);
    let mut state = RigidBodyState::at_rest();
    (0..400_u32)
        .map(|k| {
            let t = 0.05 * f64::from(k);
            let tone = |rate: f64, phase: f64| (rate * t + phase).sin();
            let torque = Vector3::new(tone(1.3, 0.0), tone(1.7, 1.0), tone(2.1, 2.0)) * 0.03;
            let force = Vector3::new(tone(0.9, 3.0), tone(1.1, 4.0), tone(1.5, 5.0)) * 0.4;
            // A crude source of noise will do for an example.
            let noise = |i: u32| f64::from((k * 6 + i).wrapping_mul(2_654_435_761) >> 8) / f64::from(1_u32 << 23) - 1.0;
            let wrench = Wrench::new(torque, force);
            let sample = MotionSample {
                time_ns: i64::from(k) * 50_000_000,
                world_from_body: Some(state.world_from_body),
                velocity_origin_world: None,
                rate_body: None,
                acceleration_origin_body: None,
                wrench_body: Some(Wrench::new(
                    torque + Vector3::new(noise(0), noise(1), noise(2)) * 5e-4,
                    force + Vector3::new(noise(3), noise(4), noise(5)) * 5e-3,
                )),
                ..MotionSample::default()
            };
            // The flight computer holds the wrench between samples.
            for i in 0..10 {
                state = RungeKutta4.step(&system, &state, &wrench, t + 0.005 * f64::from(i), 0.005)?;
            }
            Ok(sample)
        })
        .collect()
}
