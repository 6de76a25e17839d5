//! Elimination of states and noises, segment by segment from the end, and the pass forward again.
//!
//! The cost of a segment is a quadratic form of its state x, its noises u, the parameters and one. Backwards it becomes one of x, the
//! parameters and one at the segment's start. What does not depend on the state before is not multiplied: wander goes by factors, and
//! parameters of measurements have no part in the flow.
//!
//! # Source
//! Riccati elimination of `MaximumLikelihood`, with nine states of wander beside those of the motion.

#![allow(clippy::needless_range_loop)] // indices are those of the formulas

use super::layout::{MOTION, NOISES, ROWS, STATES, WANDERS, WRENCH};

/// Sizes of a chain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    /// Free parameters.
    pub(super) parameters: usize,
    /// Of these, in front, those that act on the motion.
    pub(super) dynamic: usize,
}

impl Shape {
    /// State, parameters, one.
    pub(super) fn eliminated(self) -> usize {
        STATES + self.parameters + 1
    }

    /// State, noises, parameters, one.
    pub(super) fn width(self) -> usize {
        STATES + NOISES + self.parameters + 1
    }

    /// Columns of the flow: motion, errors of the wrench, dynamic parameters, one.
    pub(super) fn flow(self) -> usize {
        MOTION + WRENCH + self.dynamic + 1
    }

    /// Where each column of the flow stands among state, noises, parameters, one.
    fn place(self, column: usize) -> usize {
        match column {
            c if c < MOTION => c,
            c if c < MOTION + WRENCH => STATES + c - MOTION,
            c if c + 1 < self.flow() => STATES + NOISES + c - MOTION - WRENCH,
            _ => self.width() - 1,
        }
    }
}

/// Wander over one segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wandering {
    pub(super) decay: [f64; WANDERS],
    pub(super) drive: [f64; WANDERS],
    pub(super) sigma: [f64; WANDERS],
}

/// A linearised chain.
pub(super) struct Chain {
    pub(super) shape: Shape,
    /// Rows of each segment by `Shape::width` columns, noises in units of one sigma.
    pub(super) rows: Vec<f64>,
    /// One over the variances.
    pub(super) weights: Vec<[f64; ROWS]>,
    /// Motion at the end of each segment by `Shape::flow` columns, the last the defect.
    pub(super) flow: Vec<f64>,
    /// Errors of the wrench as they are, in units of one sigma.
    pub(super) errors: Vec<[f64; WRENCH]>,
    pub(super) wandering: Wandering,
    /// Precision of the first motion.
    pub(super) first: [f64; MOTION],
    /// Gains `u = -K [x; parameters; 1]`.
    gains: Vec<f64>,
    /// Factors of the information of the noises.
    factors: Vec<[[f64; NOISES]; NOISES]>,
}

/// Quadratic form of state, parameters and one at the start of a range of segments, full and symmetric.
pub(super) type Form = Vec<f64>;

fn axpy(out: &mut [f64], factor: f64, row: &[f64]) {
    if factor != 0.0 {
        for (o, x) in out.iter_mut().zip(row) {
            *o += factor * x;
        }
    }
}

/// Adds multiples of rows in their order, four at once: what they are added to is then read and written a quarter as often.
fn accumulate<'a>(out: &mut [f64], terms: impl Iterator<Item = (f64, &'a [f64])>) {
    let mut held: [(f64, &[f64]); 4] = [(0.0, &[]); 4];
    let mut count = 0;
    for (factor, row) in terms.filter(|(factor, _)| *factor != 0.0) {
        held[count] = (factor, row);
        count += 1;
        if count == held.len() {
            count = 0;
            let [(f0, r0), (f1, r1), (f2, r2), (f3, r3)] = held;
            for ((((out, x0), x1), x2), x3) in out.iter_mut().zip(r0).zip(r1).zip(r2).zip(r3) {
                *out = *out + f0 * x0 + f1 * x1 + f2 * x2 + f3 * x3;
            }
        }
    }
    for (factor, row) in &held[..count] {
        axpy(out, *factor, row);
    }
}

fn scale(row: &mut [f64], factor: f64) {
    for x in row {
        *x *= factor;
    }
}

impl Chain {
    pub(super) fn new(segments: usize, shape: Shape, wandering: Wandering, first: [f64; MOTION]) -> Self {
        Self {
            shape,
            rows: vec![0.0; segments * ROWS * shape.width()],
            weights: vec![[0.0; ROWS]; segments],
            flow: vec![0.0; segments * MOTION * shape.flow()],
            errors: vec![[0.0; WRENCH]; segments],
            wandering,
            first,
            gains: vec![0.0; segments * NOISES * shape.eliminated()],
            factors: vec![[[0.0; NOISES]; NOISES]; segments],
        }
    }

    pub(super) fn segments(&self) -> usize {
        self.weights.len()
    }

    pub(super) fn row(&self, j: usize, i: usize) -> &[f64] {
        let width = self.shape.width();
        let at = (j * ROWS + i) * width;
        &self.rows[at..at + width]
    }

    pub(super) fn row_mut(&mut self, j: usize, i: usize) -> &mut [f64] {
        let width = self.shape.width();
        let at = (j * ROWS + i) * width;
        &mut self.rows[at..at + width]
    }

    fn gain(&self, j: usize, i: usize) -> &[f64] {
        let width = self.shape.eliminated();
        let at = (j * NOISES + i) * width;
        &self.gains[at..at + width]
    }

    /// The form at the start of segment `from`, of the segments up to `to`; with `keep` the gains stay for the way forward.
    pub(super) fn eliminate(&mut self, from: usize, to: usize, keep: bool) -> Form {
        let shape = self.shape;
        let (ny, nz, nf, p) = (shape.eliminated(), shape.width(), shape.flow(), shape.parameters);
        let mut v = vec![0.0; ny * ny];
        let mut q = vec![0.0; nz * nz];
        let mut b = vec![0.0; ny * nz];
        let mut dense = vec![0.0; nf];
        let mut quy = vec![0.0; NOISES * ny];
        let places: Vec<usize> = (0..nf).map(|c| shape.place(c)).collect();
        for j in (from..to).rev() {
            q.fill(0.0);
            let weights = &self.weights[j];
            for a in 0..nz {
                let measured = (0..ROWS).filter(|i| weights[*i] != 0.0).map(|i| {
                    let row = &self.row(j, i)[a..];
                    (weights[i] * row[0], row)
                });
                accumulate(&mut q[a * nz + a..(a + 1) * nz], measured);
            }
            if j + 1 < to {
                let flow = &self.flow[j * MOTION * nf..(j + 1) * MOTION * nf];
                for r in 0..ny {
                    let vr = &v[r * ny..(r + 1) * ny];
                    let br = &mut b[r * nz..(r + 1) * nz];
                    dense.fill(0.0);
                    accumulate(&mut dense, (0..MOTION).map(|i| (vr[i], &flow[i * nf..(i + 1) * nf])));
                    br.fill(0.0);
                    for (column, &place) in places.iter().enumerate() {
                        br[place] = dense[column];
                    }
                    for i in 0..WANDERS {
                        br[MOTION + i] = vr[MOTION + i] * self.wandering.decay[i];
                        br[STATES + WRENCH + i] = vr[MOTION + i] * self.wandering.drive[i];
                    }
                    for (out, x) in br[STATES + NOISES..].iter_mut().zip(&vr[STATES..]) {
                        *out += x;
                    }
                }
                for (column, &a) in places.iter().enumerate() {
                    let moved = (0..MOTION).map(|i| (flow[i * nf + column], &b[i * nz + a..(i + 1) * nz]));
                    accumulate(&mut q[a * nz + a..(a + 1) * nz], moved);
                }
                for i in 0..WANDERS {
                    let of = (MOTION + i) * nz;
                    for (a, factor) in
                        [(MOTION + i, self.wandering.decay[i]), (STATES + WRENCH + i, self.wandering.drive[i])]
                    {
                        axpy(&mut q[a * nz + a..(a + 1) * nz], factor, &b[of + a..of + nz]);
                    }
                }
                for i in 0..=p {
                    let (a, of) = (STATES + NOISES + i, (STATES + i) * nz);
                    axpy(&mut q[a * nz + a..(a + 1) * nz], 1.0, &b[of + a..of + nz]);
                }
            }
            for i in 0..NOISES {
                let a = STATES + i;
                q[a * nz + a] += 1.0;
            }
            for (i, error) in self.errors[j].iter().enumerate() {
                q[(STATES + i) * nz + nz - 1] += error;
                q[nz * nz - 1] += error * error;
            }
            if j == from {
                for (i, precision) in self.first.iter().enumerate() {
                    q[i * nz + i] += precision;
                }
                for (i, sigma) in self.wandering.sigma.iter().enumerate() {
                    q[(MOTION + i) * nz + MOTION + i] += 1.0 / (sigma * sigma);
                }
            }
            // Noises out.
            for i in 0..NOISES {
                let a = STATES + i;
                let out = &mut quy[i * ny..(i + 1) * ny];
                for (x, out) in out[..STATES].iter_mut().enumerate() {
                    *out = q[x * nz + a];
                }
                out[STATES..].copy_from_slice(&q[a * nz + STATES + NOISES..(a + 1) * nz]);
            }
            let factor = &mut self.factors[j];
            for i in 0..NOISES {
                for c in 0..=i {
                    let mut sum = q[(STATES + c) * nz + STATES + i];
                    for t in 0..c {
                        sum -= factor[i][t] * factor[c][t];
                    }
                    // The noises have unit information of their own: rounding alone makes a pivot smaller.
                    factor[i][c] = if c == i { sum.max(1.0).sqrt() } else { sum / factor[c][c] };
                }
            }
            for i in 0..NOISES {
                let (before, here) = quy.split_at_mut(i * ny);
                let here = &mut here[..ny];
                accumulate(here, (0..i).map(|t| (-factor[i][t], &before[t * ny..(t + 1) * ny])));
                let share = 1.0 / factor[i][i];
                scale(here, share);
            }
            for r in 0..ny {
                let a = if r < STATES { r } else { r + NOISES };
                let out = &mut v[r * ny..(r + 1) * ny];
                for (c, out) in out.iter_mut().enumerate().skip(r) {
                    let at = if c < STATES { c } else { c + NOISES };
                    *out = q[a * nz + at];
                }
                let noises = (0..NOISES).map(|i| {
                    let row = &quy[i * ny + r..(i + 1) * ny];
                    (-row[0], row)
                });
                accumulate(&mut out[r..], noises);
            }
            for r in 0..ny {
                for c in 0..r {
                    v[r * ny + c] = v[c * ny + r];
                }
            }
            if keep {
                for i in (0..NOISES).rev() {
                    let (here, after) = quy[i * ny..].split_at_mut(ny);
                    for t in i + 1..NOISES {
                        let at = (t - i - 1) * ny;
                        axpy(here, -factor[t][i], &after[at..at + ny]);
                    }
                    let share = 1.0 / factor[i][i];
                    scale(here, share);
                }
                let at = j * NOISES * ny;
                self.gains[at..at + NOISES * ny].copy_from_slice(&quy);
            }
        }
        v
    }

    /// States and noises of every segment for a first state and a step of the parameters.
    pub(super) fn forward(&self, first: &[f64; STATES], step: &[f64]) -> (Vec<[f64; STATES]>, Vec<[f64; NOISES]>) {
        let segments = self.segments();
        let (nf, nd) = (self.shape.flow(), self.shape.dynamic);
        let (mut states, mut noises) = (Vec::with_capacity(segments), Vec::with_capacity(segments));
        let mut x = *first;
        for j in 0..segments {
            let mut u = [0.0; NOISES];
            for (i, u) in u.iter_mut().enumerate() {
                let gain = self.gain(j, i);
                let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                *u = -(dot(&gain[..STATES], &x) + dot(&gain[STATES..], step) + gain[gain.len() - 1]);
            }
            let mut next = [0.0; STATES];
            for i in 0..MOTION {
                let row = &self.flow[(j * MOTION + i) * nf..(j * MOTION + i + 1) * nf];
                let mut sum = row[nf - 1];
                for (c, x) in x.iter().enumerate().take(MOTION) {
                    sum += row[c] * x;
                }
                for (c, u) in u.iter().enumerate().take(WRENCH) {
                    sum += row[MOTION + c] * u;
                }
                for (c, step) in step.iter().enumerate().take(nd) {
                    sum += row[MOTION + WRENCH + c] * step;
                }
                next[i] = sum;
            }
            for i in 0..WANDERS {
                next[MOTION + i] = self.wandering.decay[i] * x[MOTION + i] + self.wandering.drive[i] * u[WRENCH + i];
            }
            states.push(x);
            noises.push(u);
            x = next;
        }
        (states, noises)
    }

    /// Shares of freedom that states, noises and parameters take of each row, and the posterior variances of the errors of the wrench,
    /// from the covariance of first state and parameters (symmetric, `STATES + parameters` wide).
    pub(super) fn shares(&self, covariance: &[f64]) -> (Vec<[f64; ROWS]>, Vec<[f64; WRENCH]>) {
        let shape = self.shape;
        let (n, p, nf) = (STATES + shape.parameters, shape.parameters, shape.flow());
        let nz = n + NOISES;
        let mut c = covariance.to_vec();
        let mut kc = vec![0.0; NOISES * n];
        let mut z = vec![0.0; nz * nz];
        let mut product = vec![0.0; nz];
        let mut fz = vec![0.0; n * nz];
        let (mut taken, mut variances) = (Vec::new(), Vec::new());
        for j in 0..self.segments() {
            for i in 0..NOISES {
                let (gain, out) = (self.gain(j, i), &mut kc[i * n..(i + 1) * n]);
                out.fill(0.0);
                accumulate(out, (0..n).map(|a| (gain[a], &c[a * n..(a + 1) * n])));
            }
            let inverse = inverse_of(&self.factors[j]);
            let place = |a: usize| if a < STATES { a } else { a + NOISES };
            for a in 0..n {
                let row = &mut z[place(a) * nz..(place(a) + 1) * nz];
                let from = &c[a * n..(a + 1) * n];
                row[..STATES].copy_from_slice(&from[..STATES]);
                row[STATES + NOISES..].copy_from_slice(&from[STATES..]);
                for i in 0..NOISES {
                    row[STATES + i] = -kc[i * n + a];
                }
            }
            let mut variance = [0.0; WRENCH];
            for i in 0..NOISES {
                let kci = &kc[i * n..(i + 1) * n];
                let row = &mut z[(STATES + i) * nz..(STATES + i + 1) * nz];
                for a in 0..n {
                    row[place(a)] = -kci[a];
                }
                for t in 0..NOISES {
                    let gain = self.gain(j, t);
                    row[STATES + t] = inverse[i][t] + kci.iter().zip(gain).map(|(a, b)| a * b).sum::<f64>();
                }
                if i < WRENCH {
                    variance[i] = row[STATES + i];
                }
            }
            let mut share = [0.0; ROWS];
            for (i, share) in share.iter_mut().enumerate() {
                let weight = self.weights[j][i];
                if weight == 0.0 {
                    continue;
                }
                let row = &self.row(j, i)[..nz];
                product.fill(0.0);
                accumulate(&mut product, row.iter().enumerate().map(|(a, factor)| (*factor, &z[a * nz..(a + 1) * nz])));
                *share = weight * product.iter().zip(row).map(|(a, b)| a * b).sum::<f64>();
            }
            taken.push(share);
            variances.push(variance);
            if j + 1 == self.segments() {
                break;
            }
            let flow = &self.flow[j * MOTION * nf..(j + 1) * MOTION * nf];
            let places: Vec<usize> = (0..nf - 1).map(|column| shape.place(column)).collect();
            for i in 0..MOTION {
                let out = &mut fz[i * nz..(i + 1) * nz];
                out.fill(0.0);
                let moved = places.iter().enumerate();
                accumulate(out, moved.map(|(column, &a)| (flow[i * nf + column], &z[a * nz..(a + 1) * nz])));
            }
            for i in 0..WANDERS {
                let out = &mut fz[(MOTION + i) * nz..(MOTION + i + 1) * nz];
                out.fill(0.0);
                axpy(out, self.wandering.decay[i], &z[(MOTION + i) * nz..(MOTION + i + 1) * nz]);
                let a = STATES + WRENCH + i;
                axpy(out, self.wandering.drive[i], &z[a * nz..(a + 1) * nz]);
            }
            for r in 0..MOTION + WANDERS {
                let from = &fz[r * nz..(r + 1) * nz];
                let out = &mut c[r * n..(r + 1) * n];
                for (i, out) in out.iter_mut().enumerate().take(MOTION) {
                    *out = places.iter().enumerate().map(|(column, &a)| flow[i * nf + column] * from[a]).sum();
                }
                for i in 0..WANDERS {
                    out[MOTION + i] = self.wandering.decay[i] * from[MOTION + i]
                        + self.wandering.drive[i] * from[STATES + WRENCH + i];
                }
                out[STATES..].copy_from_slice(&from[STATES + NOISES..]);
            }
            for r in 0..STATES {
                for a in STATES..STATES + p {
                    c[a * n + r] = c[r * n + a];
                }
                for a in 0..r {
                    let mean = 0.5 * (c[r * n + a] + c[a * n + r]);
                    c[r * n + a] = mean;
                    c[a * n + r] = mean;
                }
            }
        }
        (taken, variances)
    }
}

/// Inverse of `L L^T`.
fn inverse_of(factor: &[[f64; NOISES]; NOISES]) -> [[f64; NOISES]; NOISES] {
    let mut lower = [[0.0; NOISES]; NOISES];
    for c in 0..NOISES {
        lower[c][c] = 1.0 / factor[c][c];
        for i in c + 1..NOISES {
            let sum: f64 = (c..i).map(|t| factor[i][t] * lower[t][c]).sum();
            lower[i][c] = -sum / factor[i][i];
        }
    }
    let mut inverse = [[0.0; NOISES]; NOISES];
    for i in 0..NOISES {
        for c in 0..=i {
            let sum: f64 = (i..NOISES).map(|t| lower[t][i] * lower[t][c]).sum();
            inverse[i][c] = sum;
            inverse[c][i] = sum;
        }
    }
    inverse
}
