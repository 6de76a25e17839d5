//! Levels and gates from what a step left.

use super::super::grid::{ACCELERATION, RATE, VELOCITY};
use super::super::layout::{ACTING, NOISES, ROWS, STATES, WRENCH};
use super::super::levels::{Series, median};
use super::{COLOURS, DRIFT, Fit, GATE, LARGEST_COLOUR, MEDIAN_CHI_SQUARE, WANDER_GATE, WRENCH_CHANGE};
use nalgebra::Vector3;

impl Fit<'_> {
    /// Levels, then gates where asked for, from what the last step left; the largest factors by which a level of the measurements changed, and
    /// one of the wrench.
    pub(super) fn take_levels(&mut self, states: &[[f64; STATES]], noises: &[[f64; NOISES]], gate: bool) -> [f64; 2] {
        let sensing = &self.of.sensing;
        let segment_s = self.samples as f64 * self.grid.step_s;
        let errors = [&sensing.position, &sensing.attitude, &sensing.velocity];
        let (mut change, mut of_wrench) = (1.0_f64, 1.0_f64);
        for (stream, errors) in errors.into_iter().enumerate() {
            if self.counts.iter().all(|counts| counts[stream] == 0.0) {
                continue;
            }
            if !errors.wander.is_known() {
                let values: Vec<Vector3<f64>> = self
                    .left
                    .iter()
                    .map(|r| Vector3::new(r[3 * stream], r[3 * stream + 1], r[3 * stream + 2]))
                    .collect();
                let counts: Vec<f64> = self.counts.iter().map(|counts| counts[stream]).collect();
                let series = Series {
                    values: &values,
                    axes: &self.axes[stream],
                    counts: &counts,
                    segment_s,
                    with_slope: stream != VELOCITY,
                };
                self.levels.wander[stream] = series.wander(self.levels.white[stream], self.levels.wander[stream]);
            }
            if let (false, Some(raw)) = (errors.white.is_known(), self.raw[stream]) {
                let (sigma, time_s) = self.levels.wander[stream];
                let slow = 0.6 * sigma * sigma / time_s * self.grid.step_s * self.spacing[stream];
                self.levels.white[stream] = (raw * raw - slow).max(0.01 * raw * raw).sqrt();
            }
        }
        let with_wander = self.residuals_of_wander(states, noises);
        let covariance = self.joint_covariance();
        let (taken, variances) = match &covariance {
            Some(covariance) => self.chain.shares(covariance),
            None => (vec![[0.0; ROWS]; self.segments], vec![[0.0; 2 * WRENCH]; self.segments]),
        };
        for (i, known) in [(RATE, sensing.rate.white.is_known()), (ACCELERATION, sensing.acceleration.white.is_known())]
        {
            let ratio = self.ratio_of(i, &with_wander);
            let channels: Vec<usize> = self.axes[i].iter().map(|axis| 3 * i + axis).collect();
            let sums = |counted: &dyn Fn(usize) -> bool| {
                let (mut squares, mut count, mut share) = (0.0, 0.0, 0.0);
                for j in 0..self.segments {
                    for &channel in &channels {
                        let weight = self.chain.weights[j][channel];
                        if weight > 0.0 {
                            share += taken[j][channel];
                            if counted(j) {
                                count += 1.0;
                                squares += with_wander[j][channel].powi(2) * weight;
                            }
                        }
                    }
                }
                (ratio * squares, count, share)
            };
            let (squares, count, share) = sums(&|_| true);
            self.taken[i] = share;
            if count == 0.0 {
                continue;
            }
            let mut factor = squares / (count - share).max(1.0);
            // Outliers by the level that most rows show.
            let size = |j: usize| {
                let sum = channels.iter().map(|&c| with_wander[j][c].powi(2) * self.chain.weights[j][c]).sum::<f64>();
                ratio * sum
            };
            let mut sizes: Vec<f64> = (0..self.segments).map(size).filter(|size| *size > 0.0).collect();
            let usual = median(&mut sizes).unwrap_or(0.0) / MEDIAN_CHI_SQUARE[channels.len() - 1];
            let limit = usual * GATE * GATE * channels.len() as f64 / 1.5;
            let out: Vec<usize> = (0..self.segments).filter(|&j| size(j) > limit).collect();
            if gate && !out.is_empty() {
                let (squares, count, share) = sums(&|j| size(j) <= limit);
                factor = squares / (count - share).max(1.0);
                for j in out {
                    self.counts[j][i] = 0.0;
                }
            }
            if !known && factor > 0.0 {
                let level = (self.levels.white[i] * factor.sqrt()).min(self.largest[i]).max(self.smallest[i]);
                let by = level / self.levels.white[i];
                change = change.max(by).max(1.0 / by);
                self.levels.white[i] = level;
            }
        }
        if self.of.wrench_noise.is_none() {
            let count = (3 * self.segments) as f64;
            let is_near = self.decrement < DRIFT;
            // Of errors, or of drives of them, by those that the record shows anything of: the fewer these are the slower that converges. Longer changes
            // make up for it near rest; farther away they lead astray.
            let factor = |squares: f64, places: core::ops::Range<usize>| {
                let redundant = count - variances.iter().flat_map(|v| &v[places.clone()]).sum::<f64>();
                let factor = (squares / redundant.max(1e-9)).clamp(WRENCH_CHANGE.0, WRENCH_CHANGE.1);
                let shown = if is_near { (redundant / count).clamp(0.0, 1.0) } else { 1.0 };
                factor.powf(1.0 / (1.0 + shown))
            };
            let mut white = self.levels.wrench;
            for (part, of_part) in white.iter_mut().enumerate() {
                let (range, drives) = (3 * part..3 * part + 3, WRENCH + 3 * part..WRENCH + 3 * part + 3);
                let squares = |of: &mut dyn Iterator<Item = &f64>| of.map(|e| e * e).sum::<f64>();
                let of_segment =
                    factor(squares(&mut self.errors.iter().flat_map(|e| &e[range.clone()])), range.clone());
                let lasting = factor(squares(&mut noises.iter().flat_map(|u| &u[drives.clone()])), drives.clone());
                let floor = self.floors[part];
                let mut take = |level: &mut f64, factor: f64| {
                    let before = *level;
                    *level = (before * factor).max(floor);
                    of_wrench = of_wrench.max(*level / before).max(before / *level);
                };
                if self.levels.lasting[part] > 0.0 {
                    take(&mut self.levels.lasting[part], lasting);
                }
                take(of_part, of_segment);
            }
            self.take_white_wrench(white);
        }
        for stream in 0..3 {
            let channels: Vec<usize> = self.axes[stream].iter().map(|axis| 2 * WRENCH + 3 * stream + axis).collect();
            let limit = WANDER_GATE * WANDER_GATE * channels.len() as f64 / 1.5;
            for (j, noises) in noises.iter().enumerate() {
                let sum: f64 = channels.iter().map(|&c| noises[c] * noises[c]).sum();
                if gate && sum > limit {
                    for j in [j, j + 1] {
                        if let Some(counts) = self.counts.get_mut(j) {
                            counts[stream] = 0.0;
                        }
                    }
                }
            }
        }
        [change, of_wrench]
    }

    /// Levels of white errors of the wrench; the errors, which are in their units, stay what they are.
    pub(super) fn take_white_wrench(&mut self, levels: [f64; 2]) {
        let by = [levels[0] / self.levels.wrench[0], levels[1] / self.levels.wrench[1]];
        for error in &mut self.errors {
            for (i, error) in error.iter_mut().enumerate() {
                *error /= by[i / 3];
            }
        }
        self.levels.wrench = levels;
    }

    /// Density at low frequency over that of a segment's mean: of the filter, and where that is not all told by what is left of the rows.
    fn ratio_of(&self, stream: usize, left: &[[f64; ROWS]]) -> f64 {
        let sensing = &self.of.sensing;
        let errors = if stream == RATE { &sensing.rate } else { &sensing.acceleration };
        let told = self.ratio[stream - RATE];
        if errors.unknown_filter_s == 0.0 {
            return told;
        }
        let (mut alone, mut beside) = (0.0, [0.0; COLOURS]);
        for axis in &self.axes[stream] {
            let channel = 3 * stream + axis;
            let value = |j: usize| left[j][channel] * self.chain.weights[j][channel].sqrt();
            for j in 0..self.segments {
                alone += value(j) * value(j);
                for (distance, sum) in beside.iter_mut().enumerate() {
                    if j + distance + 1 < self.segments {
                        *sum += value(j) * value(j + distance + 1);
                    }
                }
            }
        }
        let colour = if alone > 0.0 { 1.0 + 2.0 * beside.iter().sum::<f64>() / alone } else { 1.0 };
        colour.clamp(told, LARGEST_COLOUR)
    }

    /// Residuals after the last step, wander taken out too.
    pub(super) fn residuals_of_wander(&self, states: &[[f64; STATES]], noises: &[[f64; NOISES]]) -> Vec<[f64; ROWS]> {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        self.left
            .iter()
            .enumerate()
            .map(|(j, left)| {
                core::array::from_fn(|i| {
                    let row = self.chain.row(j, i);
                    left[i]
                        + dot(&row[ACTING..STATES], &states[j][ACTING..])
                        + dot(&row[STATES + 2 * WRENCH..STATES + NOISES], &noises[j][2 * WRENCH..])
                })
            })
            .collect()
    }
}
