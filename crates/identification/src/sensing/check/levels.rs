//! White and slow errors of what a fit leaves.
//!
//! # Source
//! White noise from third differences over one and two steps, which tells it from a random walk; slow errors by the likelihood of a
//! Gauss-Markov process in a small Kalman filter, whose offset and drift are unknown.

use super::found::Found;
use nalgebra::{SMatrix, SVector, Vector3};

/// Standard deviation of a normal variable over the median of its size.
const DEVIATION_OF_MEDIAN: f64 = 1.4826;
/// Sum of the squares of the coefficients of a third difference.
const THIRD_DIFFERENCE: f64 = 20.0;
/// Fewest differences that say something.
const FEWEST: usize = 24;
/// Stretches whose scatter gives the standard deviation of a level.
const STRETCHES: usize = 12;
/// Beyond this ratio of third differences over two steps and over one, motion is seen and not noise: a random walk gives 2.
const MOTION: f64 = 4.0;
/// Below this share of all fast noise, white noise is not told from slow errors.
const SEPARATE: f64 = 0.25;
/// Standard deviations by which slow errors must show to be taken from all fast noise.
const SHOWS: f64 = 1.5;
/// Width of the cells whose means are one row of the filter, s.
const CELL_S: f64 = 0.25;
/// Correlation times are no shorter than this many cells.
const FASTEST: f64 = 2.0;
/// Logarithm of the expected correlation time, s, and one standard deviation of it.
const LN_TIME: (f64, f64) = (2.3, 1.5);
/// By how much minus twice the logarithm of the likelihood must fall for a slow error to be there.
const THERE: f64 = 9.0;

pub(super) fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// White noise of one sample: its standard deviation along the axes that were measured.
pub(super) fn white(values: &[Vector3<f64>]) -> Option<Found> {
    let axes = measured(values);
    let (apart, together) = third_differences(values, &axes)?;
    // Where slow errors are nearly all there is, what a sample gains on its neighbours stands for the white part, and may be all slow.
    if apart < SEPARATE * together {
        let value = together.sqrt();
        return Some(Found { value, sigma: 0.5 * value });
    }
    let parts: Vec<(f64, f64)> = (0..STRETCHES)
        .filter_map(|i| {
            let stretch = i * values.len() / STRETCHES..(i + 1) * values.len() / STRETCHES;
            third_differences(&values[stretch], &axes)
        })
        .collect();
    if parts.len() < STRETCHES / 2 {
        return None;
    }
    let n = parts.len() as f64;
    let scatter = |of: fn(&(f64, f64)) -> f64| {
        let mean = parts.iter().map(of).sum::<f64>() / n;
        // Of Student's distribution, because few stretches tell their own scatter poorly.
        (parts.iter().map(|v| (of(v) - mean).powi(2)).sum::<f64>() / (n * (n - 3.0))).sqrt()
    };
    let found = |variance: f64, sigma: f64| Found { value: variance.sqrt(), sigma: 0.5 * sigma / variance.sqrt() };
    let sigma = scatter(|v| v.0);
    // Slow errors that do not show are none, but for what they may be.
    Some(if together - apart < SHOWS * sigma {
        let white = found(together, scatter(|v| v.1));
        Found { sigma: white.sigma.hypot(0.5 * (together.sqrt() - apart.sqrt())), ..white }
    } else {
        found(apart, sigma)
    })
}

/// Variance of white noise, without a random walk and with it; `None` where motion shows.
fn third_differences(values: &[Vector3<f64>], axes: &[usize]) -> Option<(f64, f64)> {
    let over = |steps: usize| {
        let mut sizes = Vec::with_capacity(3 * values.len());
        for w in values.windows(3 * steps + 1) {
            let d = w[3 * steps] - (w[2 * steps] - w[steps]) * 3.0 - w[0];
            sizes.extend(axes.iter().map(|&a| d[a].abs()));
        }
        (sizes.len() >= FEWEST).then(|| median(&mut sizes)).flatten().map(|m| (DEVIATION_OF_MEDIAN * m).powi(2))
    };
    let (one, two) = (over(1)?, over(2)?);
    (one > 0.0 && two < MOTION * one).then_some(((2.0 * one - two) / THIRD_DIFFERENCE, one / THIRD_DIFFERENCE))
}

/// Axes along which the values change.
pub(super) fn measured(values: &[Vector3<f64>]) -> Vec<usize> {
    let first = values.first().copied().unwrap_or_default();
    (0..3).filter(|&a| values.iter().any(|v| (v[a] - first[a]).abs() > 1e-12 * first[a].abs().max(1e-3))).collect()
}

/// What is left of a stream: an unknown start, drift and noise, beside its white and slow error.
pub(super) struct Stream<'a> {
    pub(super) times: &'a [f64],
    pub(super) values: &'a [Vector3<f64>],
    /// White noise of one sample.
    pub(super) white: f64,
}

/// One stream that drifts as the integral of noise, or one as the double integral and beside it, perhaps, its derivative.
pub(super) struct Slow<'a> {
    pub(super) stream: Stream<'a>,
    /// The derivative of the first, with errors of its own.
    pub(super) derivative: Option<Stream<'a>>,
    /// Whether the drift is a double integral.
    pub(super) double: bool,
    /// One standard deviation of a constant part of the drift's derivative, unit per s, or per s^2 where it is double.
    pub(super) constant: f64,
    /// Root of the density of the noise that drives the drift; `None` where it is to be found.
    pub(super) density: Option<f64>,
}

/// Slow errors found.
#[derive(Clone, Copy)]
pub(super) struct Wander {
    pub(super) sigma: Option<Found>,
    pub(super) time_s: Option<Found>,
}

/// What was found: of the stream and of its derivative.
pub(super) struct Levels {
    pub(super) stream: Wander,
    pub(super) derivative: Option<Wander>,
}

/// Means of cells.
struct Cells {
    span_s: f64,
    rows: Vec<[Option<Mean>; 2]>,
    axes: Vec<usize>,
}

/// Of the samples of a cell: their mean, the mean of their times after the middle of the cell, s, and how many they are.
#[derive(Clone, Copy)]
struct Mean {
    value: Vector3<f64>,
    after_s: f64,
    samples: f64,
}

type State = SVector<f64, 5>;

impl Slow<'_> {
    fn cells(&self) -> Option<Cells> {
        let times = self.stream.times;
        let (first, last) = (*times.first()?, *times.last()?);
        let step = (last - first) / (times.len() as f64 - 1.0).max(1.0);
        let span_s = CELL_S.max(1.5 * step);
        let count = num_traits::AsPrimitive::<usize>::as_(((last - first) / span_s).floor());
        if count < 40 {
            return None;
        }
        let mut rows = vec![[None; 2]; count];
        for (at, stream) in [Some(&self.stream), self.derivative.as_ref()].into_iter().flatten().enumerate() {
            for (time, value) in stream.times.iter().zip(stream.values) {
                let place = (time - first) / span_s;
                let Some(row) = rows.get_mut(num_traits::AsPrimitive::<usize>::as_(place.max(0.0))) else { continue };
                let mean = row[at].get_or_insert(Mean { value: Vector3::zeros(), after_s: 0.0, samples: 0.0 });
                mean.samples += 1.0;
                mean.value += (value - mean.value) / mean.samples;
                mean.after_s += ((place.fract() - 0.5) * span_s - mean.after_s) / mean.samples;
            }
        }
        Some(Cells { span_s, rows, axes: measured(self.stream.values) })
    }

    /// Minus twice the logarithm of the likelihood. `z`: logarithms of the slow error and its time, of the density, of the derivative's slow
    /// error and its time.
    fn cost(&self, cells: &Cells, z: &[f64]) -> f64 {
        let h = cells.span_s;
        let (s, tau) = (z[0].exp(), z[1].clamp(-1.0, 7.0).exp());
        let density = self.density.unwrap_or_else(|| z[2].exp());
        let (s2, tau2) = if z.len() > 4 { (z[3].exp(), z[4].clamp(-1.0, 7.0).exp()) } else { (0.0, 1.0) };
        let (phi, phi2) = ((-h / tau).exp(), (-h / tau2).exp());
        let mut f = SMatrix::<f64, 5, 5>::identity();
        let mut q = SMatrix::<f64, 5, 5>::zeros();
        if self.double {
            f[(0, 1)] = h;
            f[(0, 2)] = 0.5 * h * h;
            f[(1, 2)] = h;
            let d = density * density;
            q[(0, 0)] = d * h.powi(3) / 3.0;
            q[(0, 1)] = d * h * h / 2.0;
            q[(1, 0)] = q[(0, 1)];
            q[(1, 1)] = d * h;
        } else {
            f[(0, 2)] = h;
            q[(0, 0)] = density * density * h;
        }
        f[(3, 3)] = phi;
        f[(4, 4)] = phi2;
        let (drive, drive2) = (s * s * (1.0 - phi * phi), s2 * s2 * (1.0 - phi2 * phi2));
        q[(3, 3)] = drive;
        q[(4, 4)] = drive2;
        let size = self.stream.values.iter().fold(f64::MIN_POSITIVE, |most, v| most.max(v.amax()));
        let loose = (30.0 * size).powi(2) + 100.0 * s * s;
        let mut p = SMatrix::<f64, 5, 5>::from_diagonal(&State::from([
            loose,
            if self.double { loose } else { 0.0 },
            self.constant * self.constant,
            s * s,
            s2 * s2,
        ]));
        let mut x = [State::zeros(); 3];
        let mut cost = 0.0;
        let seen = |which: usize, t: f64| match (which, self.double) {
            (0, true) => State::from([1.0, t, 0.5 * t * t, 1.0, 0.0]),
            (0, false) => State::from([1.0, 0.0, t, 1.0, 0.0]),
            _ => State::from([0.0, 1.0, t, 0.0, 1.0]),
        };
        let whites = [self.stream.white, self.derivative.as_ref().map_or(0.0, |d| d.white)];
        for row in &cells.rows {
            for (which, mean) in row.iter().enumerate() {
                let Some(Mean { value: mean, after_s, samples: n }) = mean else { continue };
                let seen = seen(which, *after_s);
                // The mean of a process over a cell differs from its value in the middle by a twelfth of what it gains, at most.
                let within = if which == 0 { drive } else { drive2 } / 12.0 * (1.0 - 1.0 / n);
                let ph = p * seen;
                let spread = seen.dot(&ph) + whites[which].powi(2) / n + within + 1e-18;
                for &axis in &cells.axes {
                    let innovation = mean[axis] - seen.dot(&x[axis]);
                    cost += innovation * innovation / spread + spread.ln();
                    x[axis] += ph * (innovation / spread);
                }
                p -= ph * ph.transpose() / spread;
            }
            for state in &mut x {
                *state = f * *state;
            }
            p = f * p * f.transpose() + q;
        }
        let apart = |ln: f64| ((ln - LN_TIME.0) / LN_TIME.1).powi(2);
        cost + apart(z[1]) + if z.len() > 4 { apart(z[4]) } else { 0.0 }
    }

    pub(super) fn found(&self) -> Option<Levels> {
        let cells = self.cells()?;
        if cells.axes.is_empty() {
            return None;
        }
        let size = spread(self.stream.values).max(1e-9);
        let start_density = self.density.unwrap_or(1e-3).max(1e-9).ln();
        let mut start = vec![(0.5 * size).min(30.0 * self.stream.white.max(1e-9)).ln(), 1.5, start_density];
        if let Some(derivative) = &self.derivative {
            start.extend([derivative.white.max(1e-9).ln(), 1.5]);
        }
        let free: Vec<usize> = (0..start.len()).filter(|i| *i != 2 || self.density.is_none()).collect();
        let cost = |z: &[f64]| {
            let cost = self.cost(&cells, z);
            if cost.is_finite() { cost } else { f64::INFINITY }
        };
        let best = simplex(&cost, &start, &free);
        let sigmas = curvature(&cost, &best, &free);
        let level = |at: usize| self.wander(&cost, &best, &sigmas, (at, &free, cells.span_s));
        Some(Levels { stream: level(0), derivative: self.derivative.as_ref().map(|_| level(3)) })
    }

    /// A slow error and its time; none where the likelihood does without.
    fn wander(
        &self,
        cost: &impl Fn(&[f64]) -> f64,
        best: &[f64],
        sigmas: &[f64],
        at: (usize, &[usize], f64),
    ) -> Wander {
        let (at, free, span_s) = at;
        let without = |ln: f64| {
            let mut z = best.to_vec();
            (z[at], z[at + 1]) = (ln, LN_TIME.0);
            let others: Vec<usize> = free.iter().copied().filter(|i| *i != at && *i != at + 1).collect();
            let z = if others.is_empty() { z } else { simplex(cost, &z, &others) };
            cost(&z)
        };
        let nothing = without(-30.0);
        if nothing - cost(best) < THERE {
            let white = if at == 0 { self.stream.white } else { self.derivative.as_ref().map_or(0.0, |d| d.white) };
            let mut ln = (0.01 * white.max(1e-9)).ln();
            while without(ln) < nothing + 1.0 && ln < 3.0 {
                ln += 0.3;
            }
            return Wander { sigma: Some(Found { value: 0.0, sigma: ln.exp() }), time_s: None };
        }
        // What changes within cells is no slow error.
        if best[at + 1].exp() < FASTEST * span_s {
            return Wander { sigma: None, time_s: None };
        }
        let known =
            |i: usize| (sigmas[i] < 1.0).then(|| Found { value: best[i].exp(), sigma: best[i].exp() * sigmas[i] });
        Wander { sigma: known(at), time_s: known(at + 1) }
    }
}

/// Standard deviation of values about their mean, the axes together.
pub(super) fn spread(values: &[Vector3<f64>]) -> f64 {
    let axes = measured(values);
    let n = (values.len() as f64).max(1.0);
    let mean: Vector3<f64> = values.iter().sum::<Vector3<f64>>() / n;
    let squares: f64 = values.iter().map(|v| axes.iter().map(|&a| (v[a] - mean[a]).powi(2)).sum::<f64>()).sum();
    (squares / (n * (axes.len() as f64).max(1.0))).sqrt()
}

/// Standard deviations from the second derivatives of minus twice the logarithm of a likelihood; infinite where there is no bottom.
fn curvature(cost: &impl Fn(&[f64]) -> f64, best: &[f64], free: &[usize]) -> Vec<f64> {
    const STEP: f64 = 0.1;
    let n = free.len();
    let at = |moves: &[(usize, f64)]| {
        let mut z = best.to_vec();
        for (i, by) in moves {
            z[free[*i]] += by;
        }
        cost(&z)
    };
    let hessian = nalgebra::DMatrix::from_fn(n, n, |i, k| {
        if i == k {
            (at(&[(i, STEP)]) + at(&[(i, -STEP)]) - 2.0 * at(&[])) / (STEP * STEP)
        } else {
            (at(&[(i, STEP), (k, STEP)]) - at(&[(i, STEP), (k, -STEP)]) - at(&[(i, -STEP), (k, STEP)])
                + at(&[(i, -STEP), (k, -STEP)]))
                / (4.0 * STEP * STEP)
        }
    });
    let mut sigmas = vec![f64::INFINITY; best.len()];
    if let Some(factor) = hessian.clone().cholesky() {
        let covariance = factor.inverse() * 2.0;
        for (k, i) in free.iter().enumerate() {
            sigmas[*i] = covariance[(k, k)].max(0.0).sqrt();
        }
    }
    sigmas
}

/// The simplex of Nelder and Mead over the free coordinates.
fn simplex(cost: &impl Fn(&[f64]) -> f64, start: &[f64], free: &[usize]) -> Vec<f64> {
    const CLOSE: f64 = 1e-3;
    let judged = |z: Vec<f64>| (cost(&z), z);
    let mut points = vec![judged(start.to_vec())];
    for i in free {
        let mut z = start.to_vec();
        z[*i] += 1.0;
        points.push(judged(z));
    }
    let n = free.len();
    for _ in 0..120 * n {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        if points[n].0 - points[0].0 < CLOSE {
            break;
        }
        let mut middle = vec![0.0; start.len()];
        for (_, z) in &points[..n] {
            for (m, z) in middle.iter_mut().zip(z) {
                *m += z / n as f64;
            }
        }
        let along = |t: f64| middle.iter().zip(&points[n].1).map(|(m, w)| m + (m - w) * t).collect::<Vec<f64>>();
        let reflected = judged(along(1.0));
        if reflected.0 < points[0].0 {
            let expanded = judged(along(2.0));
            points[n] = if expanded.0 < reflected.0 { expanded } else { reflected };
        } else if reflected.0 < points[n - 1].0 {
            points[n] = reflected;
        } else {
            let contracted = judged(along(if reflected.0 < points[n].0 { 0.5 } else { -0.5 }));
            if contracted.0 < points[n].0.min(reflected.0) {
                points[n] = contracted;
            } else {
                let best = points[0].1.clone();
                for point in &mut points[1..] {
                    *point = judged(point.1.iter().zip(&best).map(|(z, b)| 0.5 * (z + b)).collect());
                }
            }
        }
    }
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points.swap_remove(0).1
}
