//! The rows of each segment and its flow, about the present point.

use super::super::super::flow::Body;
use super::super::grid::{ACCELERATION, RATE};
use super::super::layout::{ACTING, BODY, DELAYS, MOTION, NOISES, ROWS, STATES, WANDERS, WRENCH};
use super::Fit;
use nalgebra::{Matrix3, Vector3};

impl Fit<'_> {
    pub(super) fn assemble(&mut self, body: &Body) {
        let (layout, free) = (self.layout, &self.free);
        let (p, nd) = (free.len(), self.chain.shape.dynamic);
        let last = STATES + NOISES + p;
        let width = self.sweep.width;
        let root = (self.samples as f64).sqrt();
        let unit_noise: [f64; WRENCH] = core::array::from_fn(|i| self.levels.wrench[i / 3] / root);
        let lasting: [f64; WRENCH] = core::array::from_fn(|i| self.levels.lasting[i / 3]);
        let at = |parameter: usize| free.iter().position(|c| *c == parameter).map(|i| STATES + NOISES + i);
        let gain_places: [[Option<usize>; 9]; 2] =
            [layout.rate_gain(), layout.acceleration_gain()].map(|from| core::array::from_fn(|i| at(from + i)));
        let bias_places: [[Option<usize>; 3]; 2] =
            [layout.rate_bias(), layout.acceleration_bias()].map(|from| core::array::from_fn(|i| at(from + i)));
        let delay_of = |i: usize| if i == 1 && self.of.sensing.velocity_delay.is_none() { 0 } else { i };
        let delay_places: [Option<usize>; DELAYS] = core::array::from_fn(|i| at(layout.delay() + delay_of(i)));
        let gravity_place = at(layout.gravity());
        let spread_places: [Option<usize>; 2] = core::array::from_fn(|i| at(layout.spread() + i));
        let lever_places: [[Option<usize>; 3]; 2] =
            [layout.lever(), layout.lever_taken_out()].map(|from| core::array::from_fn(|i| at(from + i)));
        let spreads: [f64; 2] = core::array::from_fn(|i| self.eta[layout.spread() + i]);
        let gains: [Matrix3<f64>; 2] = [layout.rate_gain(), layout.acceleration_gain()]
            .map(|from| Matrix3::from_row_slice(&self.eta[from..from + 9]) + Matrix3::identity());
        let delays: [f64; DELAYS] = core::array::from_fn(|i| self.eta[layout.delay() + delay_of(i)]);
        let gravity = self.eta[layout.gravity()];
        let wandering = self.chain.wandering;
        // The acceleration of each row, where a delay wants its slope or an unknown filter its bend.
        let n = layout.thrusters;
        let mut by_scale = vec![Vector3::zeros(); n];
        let sloped_too = delay_places[3].is_some() || spread_places[1].is_some();
        let accelerations: Vec<Vector3<f64>> = if sloped_too {
            (0..self.grid.len())
                .map(|k| self.unit.acceleration(body, &self.eta, k, &self.rows[k].rate_beside, &mut by_scale).value)
                .collect()
        } else {
            Vec::new()
        };
        let used = self.segments * self.samples;
        let slope = |series: &[Vector3<f64>], k: usize| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(used - 1));
            (series[b] - series[a]) / (self.grid.times[b] - self.grid.times[a]).max(f64::MIN_POSITIVE)
        };
        // Over a segment, so that steps between segments that do not meet yet are not what bends.
        let reach = (self.samples / 2).max(1);
        let bend = |series: &[Vector3<f64>], k: usize| {
            if k < reach || k + reach >= used {
                return Vector3::zeros();
            }
            let half_s = 0.5 * (self.grid.times[k + reach] - self.grid.times[k - reach]);
            (series[k + reach] - series[k] * 2.0 + series[k - reach]) / (half_s * half_s)
        };
        for j in 0..self.segments {
            let means = &self.sweep.means[j * width..(j + 1) * width];
            let ends = &self.sweep.ends[j * width..(j + 1) * width];
            let (residual, late) = (&self.sweep.residual[j], &self.sweep.late[j]);
            let counts = &self.counts[j];
            // Flow.
            let nf = self.chain.shape.flow();
            for i in 0..MOTION {
                let out = &mut self.chain.flow[(j * MOTION + i) * nf..(j * MOTION + i + 1) * nf];
                for (out, end) in out.iter_mut().zip(&ends[..MOTION]) {
                    *out = end[i];
                }
                for (c, (lasting, noise)) in lasting.iter().zip(unit_noise).enumerate() {
                    out[MOTION + c] = ends[MOTION + c][i] * lasting;
                    out[ACTING + c] = ends[MOTION + c][i] * noise;
                }
                for (c, &column) in free.iter().take(nd).enumerate() {
                    out[ACTING + WRENCH + c] = ends[MOTION + WRENCH + column][i];
                }
                out[nf - 1] = self.sweep.defects[j][i];
            }
            // Rows of the localisation, and the rate before its gain.
            let mut dense = vec![[0.0; MOTION]; last + 1];
            dense[..MOTION].copy_from_slice(&means[..MOTION]);
            for c in 0..WRENCH {
                dense[MOTION + c] = means[MOTION + c].map(|x| x * lasting[c]);
                dense[STATES + c] = means[MOTION + c].map(|x| x * unit_noise[c]);
            }
            for (c, &column) in free.iter().take(nd).enumerate() {
                let mut value = means[MOTION + WRENCH + column];
                let lag = match column {
                    c if c < BODY => self.sweep.lag_by_body[j][c],
                    c if c < BODY + n => self.sweep.lag_by_scale[j * n + c - BODY],
                    _ => Vector3::zeros(),
                };
                for i in 0..3 {
                    value[9 + i] += lag[i];
                }
                dense[STATES + NOISES + c] = value;
            }
            dense[last] = *residual;
            for i in 0..WANDERS {
                dense[ACTING + i][i] = 0.5 * (1.0 + wandering.decay[WRENCH + i]);
                dense[STATES + 2 * WRENCH + i][i] = 0.5 * wandering.drive[WRENCH + i];
                let stream = usize::from(i >= 6);
                if let Some(place) = delay_places[stream] {
                    dense[place][i] = late[i];
                    dense[last][i] += delays[stream] * late[i];
                }
            }
            let range = j * self.samples..(j + 1) * self.samples;
            for i in 0..9 {
                let row = self.chain.row_mut(j, i);
                for (out, column) in row.iter_mut().zip(&dense) {
                    *out = column[i];
                }
            }
            // The rate through its gain.
            let mut rate: Vec<Vector3<f64>> =
                dense.iter().map(|column| gains[0] * Vector3::new(column[9], column[10], column[11])).collect();
            let mean_rate = self.sweep.rate_mean[j];
            let bias = |from: usize| Vector3::new(self.eta[from], self.eta[from + 1], self.eta[from + 2]);
            if counts[RATE] > 0.0 {
                let plain = Vector3::new(residual[9], residual[10], residual[11]);
                rate[last] = plain + (gains[0] - Matrix3::identity()) * mean_rate + bias(layout.rate_bias());
                if let Some(place) = delay_places[2] {
                    let mut sum = Vector3::zeros();
                    for k in range.clone().filter(|&k| self.valid[k][RATE]) {
                        sum -= slope(&self.sweep.published, k);
                    }
                    rate[place] = sum / self.grid_count(j, RATE);
                    let all = rate[place] * delays[2];
                    rate[last] += all;
                }
                if let Some(place) = spread_places[0] {
                    let mut sum = Vector3::zeros();
                    for k in range.clone().filter(|&k| self.valid[k][RATE]) {
                        sum += bend(&self.sweep.published, k);
                    }
                    rate[place] = sum / self.grid_count(j, RATE);
                    let all = rate[place] * spreads[0];
                    rate[last] += all;
                }
                measured_gain(&mut rate, &gain_places[0], &bias_places[0], &mean_rate);
            }
            for i in 0..3 {
                let row = self.chain.row_mut(j, 9 + i);
                for (out, column) in row.iter_mut().zip(&rate) {
                    *out = column[i];
                }
            }
            // The acceleration.
            let mut columns = vec![Vector3::zeros(); last + 1];
            if counts[ACCELERATION] > 0.0 {
                let (mut mean, mut measured, mut upward) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
                let mut by_body = nalgebra::SMatrix::<f64, 3, 10>::zeros();
                let mut by_lever = [Matrix3::zeros(); 2];
                let mut scales = vec![Vector3::zeros(); n];
                let (mut sloped, mut bent) = (Vector3::zeros(), Vector3::zeros());
                for k in range.filter(|&k| self.valid[k][ACCELERATION]) {
                    let row = &self.rows[k];
                    let found = self.unit.acceleration(body, &self.eta, k, &row.rate_beside, &mut by_scale);
                    mean += found.value;
                    by_body += found.by_body;
                    for (sum, by) in by_lever.iter_mut().zip(&found.by_lever) {
                        *sum += by;
                    }
                    measured += row.acceleration;
                    upward += row.upward_beside;
                    for (sum, x) in scales.iter_mut().zip(&by_scale) {
                        *sum += x;
                    }
                    if delay_places[3].is_some() {
                        sloped -= slope(&accelerations, k);
                    }
                    if spread_places[1].is_some() {
                        bent += bend(&accelerations, k);
                    }
                }
                let share = 1.0 / self.grid_count(j, ACCELERATION);
                mean *= share;
                for (c, &column) in free.iter().take(nd).enumerate() {
                    let plain = match column {
                        c if c < BODY => by_body.column(c).into_owned(),
                        c if c < BODY + n => scales[c - BODY],
                        _ => Vector3::zeros(),
                    };
                    columns[STATES + NOISES + c] = gains[1] * plain * share;
                }
                columns[last] = gains[1] * mean + bias(layout.acceleration_bias()) - measured * share;
                if let Some(place) = delay_places[3] {
                    columns[place] = sloped * share;
                    columns[last] += sloped * (share * delays[3]);
                }
                for (places, by) in lever_places.iter().zip(&by_lever) {
                    for (axis, place) in places.iter().enumerate() {
                        if let Some(place) = place {
                            columns[*place] = gains[1] * by.column(axis) * share;
                        }
                    }
                }
                if let Some(place) = spread_places[1] {
                    columns[place] = bent * share;
                    columns[last] += bent * (share * spreads[1]);
                }
                if let Some(place) = gravity_place {
                    columns[place] = -upward * share;
                    columns[last] -= upward * (share * gravity);
                }
                measured_gain(&mut columns, &gain_places[1], &bias_places[1], &mean);
            }
            for i in 0..3 {
                let row = self.chain.row_mut(j, 12 + i);
                for (out, column) in row.iter_mut().zip(&columns) {
                    *out = column[i];
                }
            }
            let mut weights = [0.0; ROWS];
            for (stream, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0.0) {
                let white = self.levels.white[stream];
                for &axis in &self.axes[stream] {
                    let i = 3 * stream + axis;
                    let drive = if i < WANDERS { wandering.drive[WRENCH + i] } else { 0.0 };
                    weights[i] = 1.0 / (white * white / count + drive * drive / 12.0);
                }
            }
            self.chain.weights[j] = weights;
        }
    }

    /// Rows of a stream within a segment, gated or not.
    fn grid_count(&self, j: usize, stream: usize) -> f64 {
        let range = j * self.samples..(j + 1) * self.samples;
        self.valid[range].iter().filter(|valid| valid[stream]).count().max(1) as f64
    }
}

/// Columns of gain and bias of a triad, whose mean value before them is `mean`.
fn measured_gain(
    columns: &mut [Vector3<f64>],
    gains: &[Option<usize>; 9],
    biases: &[Option<usize>; 3],
    mean: &Vector3<f64>,
) {
    for i in 0..3 {
        for c in 0..3 {
            if let Some(place) = gains[3 * i + c] {
                columns[place][i] += mean[c];
            }
        }
        if let Some(place) = biases[i] {
            columns[place][i] += 1.0;
        }
    }
}
