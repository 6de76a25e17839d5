//! Motions in a plane.

use crate::lie::{Pose, Wrench};
use crate::motion::MotionSample;
use nalgebra::{Matrix3, Vector3};

/// Root mean squares of a motion in a plane: tilt and lift of a robot on a table are no larger than what its localisation
/// wanders, and its turn is larger than that.
const LARGEST_TILT_RAD: f64 = 0.02;
const LARGEST_LIFT_M: f64 = 0.05;
const SMALLEST_TURN_RAD: f64 = 0.04;
/// Share of a wrench that may stand out of the plane that it lies in, and what a localisation may wander then, root mean squares.
const CONFINED: f64 = 1e-3;
const WIDEST_TILT_RAD: f64 = 0.1;
const WIDEST_LIFT_M: f64 = 0.2;
/// Cosine of the largest tilt of a plane that counts as the xy plane.
const UPRIGHT: f64 = 0.99;

/// The normal of the plane to which a motion is confined within what localisation wanders; `None` for a free motion, and for one
/// that does not turn.
pub(super) fn planar_motion(record: &[MotionSample]) -> Option<Vector3<f64>> {
    let poses = || record.iter().filter_map(|sample| sample.world_from_body.as_ref());
    let first = poses().next()?;
    let turns = |pose: &Pose<f64>| {
        let turn = (pose.rotation * first.rotation.inverse()).into_inner();
        turn.imag() * (2.0 * turn.w.signum())
    };
    let count = poses().count() as f64;
    let spread = |values: &dyn Fn(&Pose<f64>) -> Vector3<f64>| -> Matrix3<f64> {
        let mean = poses().map(values).sum::<Vector3<f64>>() / count;
        poses().map(|pose| values(pose) - mean).map(|apart| apart * apart.transpose()).sum::<Matrix3<f64>>() / count
    };
    let (turning, moving) = (spread(&turns), spread(&|pose: &Pose<f64>| pose.translation.vector));
    let eigen = turning.symmetric_eigen();
    let largest = eigen.eigenvalues.imax();
    let normal: Vector3<f64> = eigen.eigenvectors.column(largest).into_owned();
    let about = eigen.eigenvalues[largest].sqrt();
    let tilt = (turning.trace() - eigen.eigenvalues[largest]).max(0.0).sqrt();
    let along = normal.dot(&(moving * normal)).max(0.0).sqrt();
    let across = (moving.trace() - along * along).max(0.0).sqrt();
    let planar = tilt < LARGEST_TILT_RAD.min(about / 4.0) && along < LARGEST_LIFT_M.min(across);
    // A turn of less is no motion.
    let moves = about > SMALLEST_TURN_RAD;
    (planar && moves).then(|| if normal.sum() < 0.0 { -normal } else { normal })
}

/// Whether a motion is confined to the xy plane within what localisation wanders, a wider wander where the logged wrench lies in the plane.
pub(crate) fn is_in_xy_plane(record: &[MotionSample]) -> bool {
    if planar_motion(record).is_some_and(|normal| normal.z.abs() > UPRIGHT) {
        return true;
    }
    let (mut inside, mut across) = (0.0, 0.0);
    for Wrench { torque, force } in record.iter().filter_map(|sample| sample.wrench_body) {
        inside += force.x * force.x + force.y * force.y + torque.z * torque.z;
        across += force.z * force.z + torque.x * torque.x + torque.y * torque.y;
    }
    let poses = || record.iter().filter_map(|sample| sample.world_from_body.as_ref());
    let count = poses().count().max(1) as f64;
    let height = poses().map(|pose| pose.translation.z).sum::<f64>() / count;
    let (mut tilt, mut lift) = (0.0, 0.0);
    for pose in poses() {
        let up = pose.rotation.transform_vector(&Vector3::z());
        tilt += up.x * up.x + up.y * up.y;
        lift += (pose.translation.z - height).powi(2);
    }
    let is_confined = inside > 0.0 && across <= (CONFINED * CONFINED) * inside;
    is_confined
        && poses().next().is_some()
        && (tilt / count).sqrt() < WIDEST_TILT_RAD
        && (lift / count).sqrt() < WIDEST_LIFT_M
}
