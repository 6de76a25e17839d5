//! Levels of noise and wander from a record.
//!
//! # Source
//! White noise from differences, wander by the likelihood of what a fit leaves.

use super::grid::{ATTITUDE, Grid, POSITION, RATE, Row, STREAMS, VELOCITY};
use crate::lie::LieGroup;
use nalgebra::{UnitQuaternion, Vector3};

/// Standard deviation of a normal variable over the median of its size.
const DEVIATION_OF_MEDIAN: f64 = 1.4826;
/// Sum of the squares of the coefficients of a third difference.
const THIRD_DIFFERENCE: f64 = 20.0;
/// Fewest differences that say something.
const FEWEST: usize = 8;
/// A step of the localisation is a jump beyond so many medians, and what follows is left out for this time, s.
const JUMP: f64 = 8.0;
const AFTER_JUMP_S: f64 = 0.85;

/// Noise and wander found or stated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundLevels {
    /// White noise per sample of position (m), attitude (rad), velocity (m/s), rate (rad/s), acceleration (m/s^2); the last two as the white
    /// noise of the same density at low frequency. Zero where a stream is missing.
    pub white: [f64; 5],
    /// Wander of position, attitude, velocity: standard deviation and time in s. The record tells `2 sigma^2 / time` well, each alone badly.
    pub wander: [(f64, f64); 3],
    /// White error of the logged wrench per sample, N m and N.
    pub wrench: [f64; 2],
    /// Errors of the logged wrench that last, torque and force about the body's axes: the standard deviation of what changes within four seconds,
    /// N m and N; zero where the record is as likely without them.
    pub lasting: [f64; 2],
}

pub(super) fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

fn robust(mut sizes: Vec<f64>) -> Option<f64> {
    if sizes.len() < FEWEST {
        return None;
    }
    median(&mut sizes).map(|m| DEVIATION_OF_MEDIAN * m / THIRD_DIFFERENCE.sqrt())
}

fn turn(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>) -> Vector3<f64> {
    LieGroup::log(&(from.conjugate() * to))
}

/// White noise of one sample of each stream, from third differences along these axes; none where there are too few samples.
pub(super) fn white(rows: &[Row], valid: &[[bool; STREAMS]], axes: &[Vec<usize>; STREAMS]) -> [Option<f64>; STREAMS] {
    core::array::from_fn(|stream| {
        let seen: Vec<&Row> = rows.iter().zip(valid).filter(|(_, valid)| valid[stream]).map(|(row, _)| row).collect();
        let mut sizes = Vec::with_capacity(seen.len() * 3);
        let mut count = |d: Vector3<f64>| sizes.extend(axes[stream].iter().map(|&axis| d[axis].abs()));
        if stream == ATTITUDE {
            let turns: Vec<Vector3<f64>> =
                seen.windows(2).map(|pair| turn(&pair[0].attitude, &pair[1].attitude)).collect();
            turns.windows(3).for_each(|t| count(t[2] - t[1] * 2.0 + t[0]));
        } else {
            let value = |row: &Row| match stream {
                POSITION => row.position,
                VELOCITY => row.velocity,
                RATE => row.rate,
                _ => row.acceleration,
            };
            let third = |w: &[&Row]| value(w[3]) - (value(w[2]) - value(w[1])) * 3.0 - value(w[0]);
            seen.windows(4).for_each(|w| count(third(w)));
        }
        robust(sizes)
    })
}

/// Samples within a jump of the localisation: a step of position or attitude far beyond its neighbours, until it is over.
pub(super) fn jumps(grid: &Grid, valid: &[[bool; STREAMS]]) -> Vec<bool> {
    let mut inside = vec![false; grid.len()];
    let posed: Vec<usize> = (0..grid.len()).filter(|&k| valid[k][POSITION]).collect();
    if posed.len() < 4 * FEWEST {
        return inside;
    }
    let with_velocity = posed.iter().all(|&k| valid[k][VELOCITY]);
    let with_rate = posed.iter().all(|&k| valid[k][RATE]);
    let steps = |of: &dyn Fn(&Row, &Row, f64) -> f64| -> Vec<f64> {
        let step = |pair: &[usize]| {
            let elapsed = grid.times[pair[1]] - grid.times[pair[0]];
            of(&grid.rows[pair[0]], &grid.rows[pair[1]], elapsed) / (elapsed / grid.step_s).max(1.0).sqrt()
        };
        posed.windows(2).map(step).collect()
    };
    let mut kinds = Vec::new();
    if with_velocity {
        kinds.push(steps(&|a, b, dt| (b.position - a.position - a.velocity * dt).norm()));
    }
    if with_rate {
        kinds.push(steps(&|a, b, dt| (turn(&a.attitude, &b.attitude) - (a.rate + b.rate) * (0.5 * dt)).norm()));
    }
    let after = super::grid::whole(AFTER_JUMP_S / grid.step_s);
    for sizes in kinds {
        let Some(usual) = median(&mut sizes.clone()).filter(|usual| *usual > 0.0) else { continue };
        for (i, size) in sizes.iter().enumerate() {
            if *size > JUMP * usual {
                let from = posed[i + 1].saturating_sub(1);
                let to = (posed[i + 1] + after).min(inside.len());
                inside[from..to].fill(true);
            }
        }
    }
    inside
}

/// Means of segments that a wander is fitted to.
pub(super) struct Series<'a> {
    pub(super) values: &'a [Vector3<f64>],
    pub(super) axes: &'a [usize],
    /// Samples in each mean; none where it says nothing.
    pub(super) counts: &'a [f64],
    pub(super) segment_s: f64,
    /// A slope is unknown beside the offset.
    pub(super) with_slope: bool,
}

impl Series<'_> {
    /// Minus twice the logarithm of the likelihood of a Gauss-Markov process beside white noise.
    fn cost(&self, white: f64, sigma: f64, time_s: f64) -> f64 {
        let phi = (-self.segment_s / time_s).exp();
        let drive = sigma * sigma * (1.0 - phi * phi);
        let half = 0.5 * (1.0 + phi);
        let count = self.values.len() as f64;
        // What an offset or a slope may be: far beyond any value.
        let loose = 30.0 * self.values.iter().fold(f64::MIN_POSITIVE, |most, v| most.max(v.amax()));
        let loose = loose * loose + 100.0 * sigma * sigma;
        let mut cost = 0.0;
        for &axis in self.axes {
            let mut x = [0.0_f64; 3];
            let mut p = [[0.0_f64; 3]; 3];
            p[0][0] = sigma * sigma;
            p[1][1] = loose;
            p[2][2] = if self.with_slope { loose } else { 0.0 };
            for (j, (value, samples)) in self.values.iter().zip(self.counts).enumerate() {
                let h = [half, 1.0, j as f64 / count - 0.5];
                let ph: [f64; 3] = core::array::from_fn(|i| p[i][0] * h[0] + p[i][1] * h[1] + p[i][2] * h[2]);
                let spread =
                    h[0] * ph[0] + h[1] * ph[1] + h[2] * ph[2] + drive / 3.0 + white * white / samples.max(1.0);
                let gain = [phi * ph[0] + 0.5 * drive, ph[1], ph[2]];
                let predicted = h[0] * x[0] + h[1] * x[1] + h[2] * x[2];
                x[0] *= phi;
                p[0] = p[0].map(|x| x * phi);
                for row in &mut p {
                    row[0] *= phi;
                }
                p[0][0] += drive;
                if *samples > 0.0 {
                    let innovation = value[axis] - predicted;
                    cost += innovation * innovation / spread + spread.ln();
                    for i in 0..3 {
                        x[i] += gain[i] * innovation / spread;
                        for k in 0..3 {
                            p[i][k] -= gain[i] * gain[k] / spread;
                        }
                    }
                }
            }
        }
        cost
    }

    /// The likeliest wander, from a start; times are about ten seconds, give or take a factor of four and a half.
    pub(super) fn wander(&self, white: f64, start: (f64, f64)) -> (f64, f64) {
        let cost = |z: [f64; 2]| {
            let time = z[1].clamp(-1.0, 7.0);
            let apart = (z[1] - 2.3) / 1.5;
            self.cost(white, z[0].exp(), time.exp()) + 0.5 * apart * apart
        };
        let found = lowest(cost, [start.0.max(1e-12).ln(), start.1.max(1e-3).ln()]);
        (found[0].clamp(-25.0, 7.0).exp(), found[1].clamp(-1.0, 7.0).exp())
    }
}

/// The simplex of Nelder and Mead in two dimensions.
fn lowest(cost: impl Fn([f64; 2]) -> f64, start: [f64; 2]) -> [f64; 2] {
    const EVALUATIONS: usize = 120;
    const CLOSE: f64 = 0.02;
    let judged = |z: [f64; 2]| {
        let value = cost(z);
        (if value.is_finite() { value } else { f64::INFINITY }, z)
    };
    let mut simplex = [judged(start), judged([start[0] + 0.5, start[1]]), judged([start[0], start[1] + 0.5])];
    let along = |a: [f64; 2], b: [f64; 2], t: f64| [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t];
    let mut evaluations = 3;
    while evaluations < EVALUATIONS {
        simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [best, good, worst] = simplex;
        let size = |p: [f64; 2]| (p[0] - best.1[0]).abs().max((p[1] - best.1[1]).abs());
        if worst.0 - best.0 < CLOSE && size(good.1).max(size(worst.1)) < CLOSE {
            break;
        }
        let middle = along(best.1, good.1, 0.5);
        let reflected = judged(along(worst.1, middle, 2.0));
        evaluations += 1;
        if reflected.0 < best.0 {
            let expanded = judged(along(worst.1, middle, 3.0));
            evaluations += 1;
            simplex[2] = if expanded.0 < reflected.0 { expanded } else { reflected };
        } else if reflected.0 < good.0 {
            simplex[2] = reflected;
        } else {
            let contracted = judged(if reflected.0 < worst.0 {
                along(reflected.1, middle, 0.5)
            } else {
                along(worst.1, middle, 0.5)
            });
            evaluations += 1;
            if contracted.0 < worst.0.min(reflected.0) {
                simplex[2] = contracted;
            } else {
                simplex[1] = judged(along(best.1, good.1, 0.5));
                simplex[2] = judged(along(best.1, worst.1, 0.5));
                evaluations += 2;
            }
        }
    }
    simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
    simplex[0].1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Gaussian;

    #[test]
    fn the_simplex_finds_the_bottom_of_a_valley() {
        let found = lowest(|z| (z[0] - 1.0).powi(2) + 10.0 * (z[1] - z[0] * z[0]).powi(2), [-1.0, 2.0]);
        assert!((found[0] - 1.0).abs() < 0.1 && (found[1] - 1.0).abs() < 0.2, "{found:?}");
    }

    #[test]
    fn the_rate_of_a_wander_is_found_beside_noise() {
        let mut dice = Gaussian::from_seed(5);
        let (sigma, time_s, white, h, samples) = (0.02, 10.0_f64, 1e-3, 0.016, 8);
        let phi: f64 = (-h / time_s).exp();
        let drive = sigma * (1.0 - phi * phi).sqrt();
        let mut state = Vector3::from_fn(|_, _| sigma * dice.normal());
        let values: Vec<Vector3<f64>> = (0..900)
            .map(|_| {
                let mut mean = Vector3::zeros();
                for _ in 0..samples {
                    state = state * phi + Vector3::from_fn(|_, _| drive * dice.normal());
                    mean += state + Vector3::from_fn(|_, _| white * dice.normal());
                }
                mean / f64::from(samples)
            })
            .collect();
        let counts = vec![8.0; values.len()];
        let series =
            Series { values: &values, axes: &[0, 1, 2], counts: &counts, segment_s: 8.0 * h, with_slope: true };
        let (s, t) = series.wander(white, (1e-3, 3.0));
        let rate = 2.0 * s * s / t;
        assert!((rate / 8e-5 - 1.0).abs() < 0.1, "{s} {t}: {rate}");
    }
}
