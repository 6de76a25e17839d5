//! Where the segments begin, straight from the record.

use super::super::flow::State;
use super::grid::{Grid, POSITION, RATE, VELOCITY};
use crate::lie::LieGroup;
use nalgebra::{UnitQuaternion, Vector3};

/// Poses within this time either way give a rate or a velocity that was not measured, s.
const WINDOW_S: f64 = 0.3;

/// The first state of each segment: attitude and position as published, rate and velocity too or else the slope of these.
pub(super) fn start(grid: &Grid, samples: usize, segments: usize, planar: bool) -> Vec<State> {
    let reach = super::grid::whole(WINDOW_S / grid.step_s).max(2);
    let slope = |k: usize, value: &dyn Fn(usize) -> Vector3<f64>| {
        let (from, to) = (k.saturating_sub(reach), (k + reach).min(grid.len() - 1));
        let seen = || (from..=to).filter(|&i| grid.valid[i][POSITION]);
        let count = seen().count().max(1) as f64;
        let middle = seen().map(|i| grid.times[i]).sum::<f64>() / count;
        let (mut sum, mut square) = (Vector3::zeros(), 0.0);
        for i in seen() {
            let t = grid.times[i] - middle;
            sum += value(i) * t;
            square += t * t;
        }
        if square > 0.0 { sum / square } else { Vector3::zeros() }
    };
    let height = grid.guess[0].translation.vector.z;
    (0..segments)
        .map(|j| {
            let k = j * samples;
            let pose = grid.guess[k];
            let rate = if grid.valid[k][RATE] {
                grid.rows[k].rate
            } else {
                let turned =
                    |i: usize| -> Vector3<f64> { LieGroup::log(&(pose.rotation.conjugate() * grid.guess[i].rotation)) };
                slope(k, &turned)
            };
            let velocity = if grid.valid[k][VELOCITY] {
                grid.rows[k].velocity
            } else {
                slope(k, &|i: usize| grid.guess[i].translation.vector)
            };
            let mut state = State { world_from_body: pose.rotation, rate, center: pose.translation.vector, velocity };
            if planar {
                let turned = pose.rotation.transform_vector(&Vector3::x());
                let yaw = turned.y.atan2(turned.x);
                state.world_from_body = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
                (state.rate.x, state.rate.y) = (0.0, 0.0);
                (state.center.z, state.velocity.z) = (height, 0.0);
            }
            state
        })
        .collect()
}

/// Rates at the rows: as published, else those of the segments' starts in straight lines.
pub(super) fn rates(grid: &Grid, nodes: &[State], samples: usize) -> Vec<Vector3<f64>> {
    (0..grid.len())
        .map(|k| {
            if grid.valid[k][RATE] {
                return grid.rows[k].rate;
            }
            let j = (k / samples).min(nodes.len() - 1);
            let next = nodes[(j + 1).min(nodes.len() - 1)].rate;
            let along = (k - j * samples) as f64 / samples as f64;
            nodes[j].rate + (next - nodes[j].rate) * along.min(1.0)
        })
        .collect()
}
