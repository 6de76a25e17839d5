//! The conditions of a plan as rows, and what their multipliers add to the curvature.

use super::{Shooting, StateRow, Workspace, dot, weighted_square};
use crate::local::curvature::small::{accumulate, transpose_times};
use crate::local::model::{Array2, InformativeModel, KINEMATICS, Kinematics};
use crate::local::problem::CondensedProblem;
use crate::local::stages::Stages;

impl<M: InformativeModel<X, U, P>, const X: usize, const U: usize, const P: usize> Shooting<'_, M, X, U, P> {
    /// Values of all rows but those of the barriers.
    pub(super) fn plain_rows(&self, z: &[f64], kinematics: &[Kinematics], values: &mut [f64]) {
        let settings = self.task.settings;
        let half_spaces = &settings.wrench.half_spaces;
        let mut values = values.iter_mut();
        for k in 0..settings.steps {
            let input = self.input(z, k);
            for ((normal, offset), value) in half_spaces.iter().zip(&mut values) {
                *value = 1.0 - dot(normal, &input) / offset;
            }
        }
        for motion in kinematics.iter().skip(1) {
            let coordinates = [motion.velocity_world, motion.rate_body];
            for (coordinate, limit) in &self.task.speed_limits {
                // 3 to 5: velocity; 9 to 11: rate
                let speed = coordinates[usize::from(*coordinate >= 9)][coordinate % 3] / limit;
                for (sign, value) in [-1.0, 1.0].into_iter().zip(&mut values) {
                    *value = 1.0 + sign * speed;
                }
            }
        }
        if let (Some(region), Some(motion)) = (&self.task.terminal, kinematics.last()) {
            let away = motion.world_from_body.translation.vector - region.position_world;
            let ratios = [
                away.norm_squared() / (region.radius_m * region.radius_m),
                motion.velocity_world.norm_squared() / (region.speed_m_s * region.speed_m_s),
            ];
            for (ratio, value) in ratios.into_iter().zip(&mut values) {
                *value = 1.0 - ratio;
            }
        }
    }

    /// Gradients of the rows of nodes and barriers by the states.
    pub(super) fn linearize_rows(&mut self) {
        let settings = self.task.settings;
        let input_rows = self.input_rows();
        let Workspace { current, kinematics_by_state, state_rows, motion_rows, row_values, .. } = &mut *self.workspace;
        for (jacobian, state) in kinematics_by_state.iter_mut().zip(&current.states) {
            *jacobian = self.model.kinematics_by_state(state);
        }
        let mut rows = state_rows.iter_mut();
        let zero = [0.0; X];
        for (node, jacobian) in kinematics_by_state.iter().enumerate().skip(1) {
            for (coordinate, limit) in &self.task.speed_limits {
                for (sign, row) in [-1.0, 1.0].into_iter().zip(&mut rows) {
                    let by_start = jacobian[*coordinate].map(|entry| sign * entry / limit);
                    *row = StateRow { node, by_start, by_end: zero };
                }
            }
        }
        let last = (kinematics_by_state.last(), current.kinematics.last());
        if let (Some(region), (Some(jacobian), Some(motion))) = (&self.task.terminal, last) {
            let away = motion.world_from_body.translation.vector - region.position_world;
            let vectors = [
                away * (-2.0 / (region.radius_m * region.radius_m)),
                motion.velocity_world * (-2.0 / (region.speed_m_s * region.speed_m_s)),
            ];
            for ((vector, first), row) in vectors.iter().zip([0, 3]).zip(&mut rows) {
                let mut by_start = zero;
                for (axis, factor) in vector.iter().enumerate() {
                    accumulate(*factor, &jacobian[first + axis], &mut by_start);
                }
                *row = StateRow { node: settings.steps, by_start, by_end: zero };
            }
        }
        self.task.surroundings.linearize(&current.kinematics, &self.task.row_settings, motion_rows);
        let barrier_start = row_values.len() - motion_rows.len();
        for (value, row) in row_values[barrier_start..].iter_mut().zip(motion_rows.iter()) {
            *value = row.value;
        }
        for ((row, motion), place) in motion_rows.iter().map(|row| (row.node, row)).zip(&mut rows) {
            let pull = |by: &[f64; KINEMATICS], node: usize| {
                kinematics_by_state.get(node).map_or(zero, |jacobian| transpose_times(jacobian, by))
            };
            *place =
                StateRow { node: row, by_start: pull(&motion.by_start, row), by_end: pull(&motion.by_end, row + 1) };
        }
        debug_assert_eq!(input_rows + state_rows.len(), row_values.len());
    }

    /// What the terminal rows' multipliers add to the curvature of the last node.
    pub(super) fn add_terminal_curvature(&mut self, multipliers: &[f64]) {
        let steps = self.task.settings.steps;
        let first = self.barrier_rows_start().saturating_sub(2);
        let Workspace { stages, kinematics_by_state, terminal_curvature, .. } = &mut *self.workspace;
        let Some(last) = stages.state_curvature.get_mut(steps - 1) else { return };
        *last = *terminal_curvature;
        let (Some(region), Some(jacobian)) = (&self.task.terminal, kinematics_by_state.get(steps)) else { return };
        let squares = [region.radius_m, region.speed_m_s].map(|size| size * size);
        for (index, square) in squares.into_iter().enumerate() {
            let weight = 2.0 * multipliers.get(first + index).copied().unwrap_or(0.0) / square;
            if weight > 0.0 {
                let rows: Array2<3, X> = core::array::from_fn(|axis| jacobian[3 * index + axis]);
                for (sums, added) in last.iter_mut().zip(weighted_square(&[weight; 3], &rows)) {
                    accumulate(1.0, &added, sums);
                }
            }
        }
    }

    /// Gradient of a row of two neighbouring nodes, from its last node back to the start.
    pub(super) fn sweep_back(stages: &Stages<X, U>, row: &StateRow<X>, factor: f64, gradient: &mut [f64]) {
        let mut adjoint = row.by_end.map(|entry| factor * entry);
        let last = if row.by_end.iter().any(|entry| *entry != 0.0) { row.node + 1 } else { row.node };
        for k in (0..last.min(stages.by_state.len())).rev() {
            if k + 1 == row.node {
                accumulate(factor, &row.by_start, &mut adjoint);
            }
            let by_input = transpose_times(&stages.by_input[k], &adjoint);
            for (sum, entry) in gradient[k * U..(k + 1) * U].iter_mut().zip(by_input) {
                *sum += entry;
            }
            adjoint = transpose_times(&stages.by_state[k], &adjoint);
        }
    }

    /// What moving contacts add to the curvature, as columns.
    pub(super) fn append_contacts(&mut self, multipliers: &[f64]) {
        let unknowns = self.unknowns();
        let start = self.barrier_rows_start();
        let Workspace { stages, motion_rows, kinematics_by_state, contacts, .. } = &mut *self.workspace;
        let mut room = *contacts;
        for (row, multiplier) in motion_rows.iter().zip(multipliers.iter().skip(start)) {
            let Some(contact) = row.contact.filter(|_| *multiplier > 0.0 && room > 0) else { continue };
            room -= 1;
            let Some((first, second)) = kinematics_by_state.get(row.node).zip(kinematics_by_state.get(row.node + 1))
            else {
                continue;
            };
            let bend = StateRow {
                node: row.node,
                by_start: transpose_times(first, &contact.by_start),
                by_end: transpose_times(second, &contact.by_end),
            };
            let place = stages.arrow.len();
            let mut arrow = core::mem::take(&mut stages.arrow);
            arrow.resize(place + unknowns, 0.0);
            Self::sweep_back(stages, &bend, f64::sqrt(multiplier / contact.curvature), &mut arrow[place..]);
            stages.arrow = arrow;
        }
    }
}
