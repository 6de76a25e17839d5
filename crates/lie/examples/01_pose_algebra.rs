//! Poses, increments and Jacobians: how the error of a joint moves the tip of an arm.
//!
//! Run with `cargo run -p tumble-lie --example 01_pose_algebra`.

use tumble_lie::nalgebra::{Vector3, Vector6};
use tumble_lie::{GroupAction, LieGroup, Manifold, Pose};

fn main() {
    // Frames chain by name: world <- base <- joint <- tip.
    let world_from_base = Pose::translation(0.0, 0.0, 0.3);
    let hinge = Vector6::new(0.0, 0.0, 1.0, 0.0, 0.0, 0.0);
    let base_from_joint = |angle_rad: f64| <Pose<f64> as LieGroup>::exp(&(hinge * angle_rad));
    let joint_from_tip = Pose::translation(0.25, 0.0, 0.0);
    let world_from_tip = |angle_rad: f64| world_from_base * base_from_joint(angle_rad) * joint_from_tip;

    let at = world_from_tip(0.7);
    let tip = at.act(&Vector3::zeros());
    println!("tip at ({:.4}, {:.4}, {:.4}) m", tip.x, tip.y, tip.z);

    // The adjoint carries the velocity of the joint to the tip: Ad of tip_from_joint.
    let twist_tip = joint_from_tip.inverse().adjoint() * hinge;
    println!("one radian per second at the joint moves the tip at {:.4} m/s", twist_tip.fixed_rows::<3>(3).norm());

    // The same from a small step: the increment that leads from one pose to the next.
    let step_rad = 1e-6;
    let increment = world_from_tip(0.7 + step_rad).ominus(&at) / step_rad;
    let difference = (increment - twist_tip).norm();
    println!("difference from a numerical step: {difference:.1e}");

    assert!((twist_tip.fixed_rows::<3>(3).norm() - 0.25).abs() < 1e-15);
    assert!((tip - Vector3::new(0.25 * 0.7_f64.cos(), 0.25 * 0.7_f64.sin(), 0.3)).norm() < 1e-15);
    assert!(difference < 1e-9);
}
