//! Throws of a device with a reaction wheel: what `tumble calibrate-wheel` calibrates and `tumble identify --wheel` identifies.

use crate::TumbleError;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use tumble_dynamics::nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_dynamics::{
    FreeFlyer, Gyrostat, GyrostatInput, InertialParameters, Integrator, MechanicalSystem as _, MuntheKaas4,
    RigidBodyState,
};
use tumble_formats::wheel_throw::THROW_COLUMNS;
use tumble_identification::noise::Gaussian;
use tumble_lie::{Pose, Wrench};

const WHEEL_INERTIA_KG_M2: f64 = 1.7e-6;
/// Of device and proof block as `tumble calibrate-wheel` takes them where nothing is said.
const DEVICE_MASS_KG: f64 = 0.10067;
const PROOF: (f64, [f64; 3]) = (0.346, [0.06, 0.07, 0.0302]);
/// Weighed before it is thrown.
pub const OBJECT_MASS_KG: f64 = 0.46;
/// Noise per sample of gyro, rad/s, accelerometer, m/s^2, and wheel, rad/s, one sigma.
const NOISE: [f64; 3] = [0.02, 1.0, 10.0];
const STEP_S: f64 = 5e-4;
const SAMPLES: u32 = 1360;
const FIRST_S: f64 = -0.1;
/// Rates at which things leave the hand, rad/s.
const RATES: [[f64; 3]; 4] = [[8.0, 10.0, -6.0], [-9.0, 5.0, 8.0], [6.0, -11.0, 5.0], [11.0, 7.0, 9.0]];

/// Throws of the device, of the proof block and of an object.
pub struct Thrown {
    /// Names of the files and what they hold, CSV.
    pub files: Vec<(String, String)>,
    /// The object, axes of the device.
    pub object: InertialParameters<f64>,
}

/// Simulates the throws that belong to `seed`: the object and the noise follow from it.
///
/// # Errors
/// [`TumbleError`] where the simulation fails.
pub fn simulate(seed: u64) -> Result<Thrown, TumbleError> {
    let mut noise = Gaussian::from_seed(seed);
    let inertia = Matrix3::new(4.0e-5, 2e-6, -1e-6, 2e-6, 7.0e-5, 3e-6, -1e-6, 3e-6, 8.5e-5);
    let device = InertialParameters::about_com(DEVICE_MASS_KG, Vector3::new(0.004, -0.003, 0.006), inertia);
    let proof = InertialParameters::solid_box(PROOF.0, PROOF.1).transformed_by(&Pose::translation(0.01, -0.002, 0.03));
    let edges = [0.04 + 0.04 * noise.uniform(), 0.1 + 0.1 * noise.uniform(), 0.03 + 0.03 * noise.uniform()];
    let turn = UnitQuaternion::from_scaled_axis(noise.vector(0.3));
    let device_from_object = Pose::from_parts(Vector3::new(0.012, 0.004, 0.06).into(), turn);
    let object = InertialParameters::solid_box(OBJECT_MASS_KG, edges).transformed_by(&device_from_object);
    let mut files = Vec::new();
    for (name, body) in [("cal_device", device), ("cal_proof", device + proof)] {
        for (number, rate) in (1..).zip(RATES) {
            files.push((format!("{name}_{number}.csv"), throw(&body, rate, &mut noise)?));
        }
    }
    files.push(("throw.csv".to_owned(), throw(&(device + object), RATES[0], &mut noise)?));
    Ok(Thrown { files, object })
}

/// Speed of the wheel, rad/s: up and down between 0.16 s and 0.56 s on a slow idle.
fn wheel_rad_s(time_s: f64) -> f64 {
    let phase = TAU * (time_s.clamp(0.16, 0.56) - 0.16) / 0.4;
    -200.0 - 525.0 * (1.0 - phase.cos())
}

/// A throw of a body (wheel excluded, axes and origin those of the inertial sensor), CSV.
fn throw(body: &InertialParameters<f64>, rate: [f64; 3], noise: &mut Gaussian) -> Result<String, TumbleError> {
    let com = body.center_of_mass();
    let held_fast = body.inertia_about_com() + Matrix3::identity() * WHEEL_INERTIA_KG_M2;
    let system = Gyrostat(FreeFlyer::new(InertialParameters::about_com(body.mass, com, held_fast)));
    let mut state = RigidBodyState::at_rest();
    state.twist_body.angular = rate.into();
    let mut text = format!("{}\n", THROW_COLUMNS.join(","));
    for sample in 0..SAMPLES {
        let time_s = FIRST_S + f64::from(sample) * STEP_S;
        let stored = |time_s: f64| Vector3::z() * (WHEEL_INERTIA_KG_M2 * wheel_rad_s(time_s));
        let stored_rate_body = (stored(time_s + STEP_S) - stored(time_s)) / STEP_S;
        let wrench_body = Wrench::new(-stored_rate_body, Vector3::zeros());
        let input = GyrostatInput { wrench_body, stored_body: stored(time_s), stored_rate_body, since_s: time_s };
        let turning = system.vector_field(time_s, &state, &input)?.fixed_rows::<3>(6).into_owned();
        let now = state.twist_body.angular;
        // In free fall the centre of mass feels nothing.
        let felt = -(turning.cross(&com) + now.cross(&now.cross(&com))) + noise.vector(NOISE[1]);
        let seen = now + noise.vector(NOISE[0]);
        let wheel = wheel_rad_s(time_s) + NOISE[2] * noise.normal();
        let _ = write!(text, "{time_s:.4}");
        for number in seen.iter().chain(&felt).chain([&wheel]) {
            let _ = write!(text, ",{number}");
        }
        text.push('\n');
        state = MuntheKaas4.step(&system, &state, &input, time_s, STEP_S)?;
    }
    Ok(text)
}
