//! An arm on a free base whose tool holds something: what `tumble identify --model astrobee-arm --payload` identifies.

use crate::TumbleError;
use crate::robots::shipped;
use std::fmt::Write as _;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{DynamicsError, InertialParameters, Multibody};
use tumble_formats::arm::ArmModel;
use tumble_identification::noise::Gaussian;
use tumble_lie::{LieGroup, Manifold, Pose, Twist, Wrench};

/// The embedded arm that is simulated.
pub const ARM: &str = "astrobee-arm";
/// Noise of the logged velocity (m/s) and rate (rad/s) of the base, and of the joints' rates, rad/s, one sigma.
pub const NOISE: [f64; 3] = [1e-4, 1e-4, 1e-5];
/// Momentum of the whole robot about the world's origin: angular, N m s, then linear, N s.
pub const MOMENTUM: [f64; 6] = [0.02, -0.015, 0.02, 0.2, -0.1, 0.15];

const STEP_S: f64 = 0.02;
const STEPS: u32 = 6000;

/// A flight of two minutes and what was held.
pub struct Carried {
    /// The log, CSV.
    pub log: String,
    /// What the tool held, axes of the tool.
    pub payload: InertialParameters<f64>,
}

/// Simulates the flight that belongs to `seed`: payload and noise follow from it.
///
/// # Errors
/// [`TumbleError`] where the arm cannot be simulated.
pub fn simulate(seed: u64) -> Result<Carried, TumbleError> {
    let mut noise = Gaussian::from_seed(seed);
    let edges = [0.1 + 0.2 * noise.uniform(), 0.1 + 0.2 * noise.uniform(), 0.1 + 0.1 * noise.uniform()];
    let tool_from_payload = Pose::from_parts(
        Vector3::new(-0.12, 0.03, 0.05).into(),
        tumble_lie::nalgebra::UnitQuaternion::from_scaled_axis(noise.vector(0.4)),
    );
    let payload = InertialParameters::solid_box(1.0 + 2.0 * noise.uniform(), edges).transformed_by(&tool_from_payload);
    let arm = ArmModel::find(ARM, &shipped())?;
    let [angular_x, angular_y, angular_z, x, y, z] = MOMENTUM;
    let momentum = Wrench::new(Vector3::new(angular_x, angular_y, angular_z), Vector3::new(x, y, z));
    let log = log(&holding(&arm, &payload), &momentum, 1.0, &mut noise)?;
    Ok(Carried { log, payload })
}

/// The arm with something in its tool.
pub fn holding(arm: &ArmModel, payload: &InertialParameters<f64>) -> Multibody<f64> {
    let tree = arm.tree.clone();
    let held = arm.tool.as_ref().and_then(|tool| {
        let body = *tree.body(tool.body)? + payload.transformed_by(&tool.body_from_frame);
        Some((tool.body, body))
    });
    match held {
        Some((index, body)) => tree.with_body(index, body),
        None => tree,
    }
}

/// A log of an arm of two joints that floats with this momentum (torque, force: angular, linear). Its joints swing by `amplitude` times what they
/// usually do.
///
/// # Errors
/// [`DynamicsError`] for a tree of another number of joints.
pub fn log(
    tree: &Multibody<f64>,
    momentum: &Wrench<f64>,
    amplitude: f64,
    noise: &mut Gaussian,
) -> Result<String, DynamicsError> {
    let joints = |time_s: f64| {
        let phases = [0.11 * time_s, 0.13 * time_s + 1.1, 0.37 * time_s, 0.41 * time_s + 0.2];
        let (sin, cos) = (phases.map(f64::sin), phases.map(f64::cos));
        let positions = [0.7 * sin[0] + 0.1 * sin[2], 0.6 * sin[1] + 0.1 * sin[3]];
        let rates = [0.077 * cos[0] + 0.037 * cos[2], 0.078 * cos[1] + 0.041 * cos[3]];
        (positions.map(|position| amplitude * position), rates.map(|rate| amplitude * rate))
    };
    let twist = |world_from_base: &Pose<f64>, time_s: f64| {
        let (positions, rates) = joints(time_s);
        tree.floating_base_twist(&positions, &rates, &momentum.transformed_by(&LieGroup::inverse(world_from_base)))
    };
    let mut text =
        "t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,v_x,v_y,v_z,w_x,w_y,w_z,q1_rad,q2_rad,qd1_rad_s,qd2_rad_s\n".to_owned();
    let mut pose = Pose::identity();
    for step in 0..STEPS {
        let time_s = f64::from(step) * STEP_S;
        let now = twist(&pose, time_s)?;
        if step % 2 == 0 {
            let (positions, rates) = joints(time_s);
            let velocity = pose.rotation * (now.linear + noise.vector(NOISE[0]));
            let rate = now.angular + noise.vector(NOISE[1]);
            let noisy = rates.map(|rate| rate + NOISE[2] * noise.normal());
            let (place, attitude) = (pose.translation.vector, pose.rotation.coords);
            let _ = write!(text, "{time_s:.3}");
            let numbers = place.iter().chain(&attitude).chain(&velocity).chain(&rate).chain(&positions).chain(&noisy);
            numbers.for_each(|number| {
                let _ = write!(text, ",{number}");
            });
            text.push('\n');
        }
        let half: Twist<f64> = twist(&pose.oplus(&(now.to_vector() * (0.5 * STEP_S))), time_s + 0.5 * STEP_S)?;
        pose = pose.oplus(&(half.to_vector() * STEP_S));
    }
    Ok(text)
}
