//! First states of segments from the measured poses alone.

use super::flow::State;
use super::record::Record;
use crate::lie::{LieGroup, rotation_jacobian};
use nalgebra::{Matrix4, SMatrix, UnitQuaternion, Vector3};

/// Cubic least squares of position and rotation vector over `window_s` on each side of each node.
pub(super) fn from_poses(record: &Record, starts: &[usize], window_s: f64, center: &Vector3<f64>) -> Vec<State> {
    let reach = super::rounding::whole(window_s / record.median_step_s).max(4);
    starts.iter().map(|&node| from_window(record, node, reach, center)).collect()
}

/// The window holds `2 reach + 1` samples, moved inside the node's stretch at its ends.
fn from_window(record: &Record, node: usize, reach: usize, center: &Vector3<f64>) -> State {
    let samples = &record.samples;
    let stretch = record.stretch(node);
    let here = &samples[node];
    let first = node.saturating_sub(reach).min(stretch.end.saturating_sub(2 * reach + 1)).max(stretch.start);
    let end = (node + reach + 1).max(first + 2 * reach + 1).min(stretch.end);
    let unit = (samples[end - 1].time_s - samples[first].time_s).max(record.median_step_s);
    let (mut normal, mut moment) = (Matrix4::<f64>::zeros(), SMatrix::<f64, 4, 6>::zeros());
    for sample in &samples[first..end] {
        let t = (sample.time_s - here.time_s) / unit;
        let powers = [1.0, t, t * t, t * t * t];
        let turn = LieGroup::log(&(here.world_from_body.conjugate() * sample.world_from_body));
        let offset = sample.position - here.position;
        let values = [offset.x, offset.y, offset.z, turn.x, turn.y, turn.z];
        for (i, a) in powers.iter().enumerate() {
            for (j, b) in powers.iter().enumerate() {
                normal[(i, j)] += a * b;
            }
            for (j, value) in values.iter().enumerate() {
                moment[(i, j)] += a * value;
            }
        }
    }
    let fit = normal.cholesky().map_or_else(SMatrix::zeros, |factor| factor.solve(&moment));
    let at =
        |row: usize, column: usize| Vector3::new(fit[(row, column)], fit[(row, column + 1)], fit[(row, column + 2)]);
    let turn = at(0, 3);
    let world_from_body = here.world_from_body * <UnitQuaternion<f64> as LieGroup>::exp(&turn);
    let rate = rotation_jacobian(&turn) * at(1, 3) / unit;
    State {
        world_from_body,
        rate,
        center: here.position + at(0, 0) + world_from_body * center,
        velocity: at(1, 0) / unit + world_from_body * rate.cross(center),
    }
}
