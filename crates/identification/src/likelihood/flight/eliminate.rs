//! Elimination of states and noises, segment by segment from the end, and the pass forward again.
//!
//! The cost of a segment is a quadratic form of its state x, its noises u, the parameters and one. Backwards it becomes one of x, the
//! parameters and one at the segment's start. What does not depend on the state before is not multiplied: wander goes by factors, and
//! parameters of measurements have no part in the flow.
//!
//! # Source
//! Riccati elimination of `MaximumLikelihood`, with the lasting errors of the wrench and nine states of wander beside those of the motion.

#![allow(clippy::needless_range_loop)] // indices are those of the formulas

use super::layout::{ACTING, MOTION, NOISES, ROWS, SLOW, STATES, WRENCH};
use super::tiles::{DEPTH, Rows, TILE, add_product, padded};

// A product takes no more rows than this.
const _: () = assert!(NOISES <= DEPTH && ROWS <= DEPTH && MOTION <= DEPTH);

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

    /// Columns of the flow: motion, lasting errors of the wrench, those of the segment, dynamic parameters, one.
    pub(super) fn flow(self) -> usize {
        ACTING + WRENCH + self.dynamic + 1
    }
}

/// What the slow states do over one segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wandering {
    pub(super) decay: [f64; SLOW],
    pub(super) drive: [f64; SLOW],
    pub(super) sigma: [f64; SLOW],
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
    pub(super) fn new(segments: usize, shape: Shape, wandering: &Wandering, first: [f64; MOTION]) -> Self {
        Self {
            shape,
            rows: vec![0.0; segments * ROWS * shape.width()],
            weights: vec![[0.0; ROWS]; segments],
            flow: vec![0.0; segments * MOTION * shape.flow()],
            errors: vec![[0.0; WRENCH]; segments],
            wandering: *wandering,
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
    ///
    /// Within, the noises come after state, parameters and one, so that what is left of the form begins at its start.
    pub(super) fn eliminate(&mut self, from: usize, to: usize, keep: bool) -> Form {
        let shape = self.shape;
        let (ny, nf, p) = (shape.eliminated(), shape.flow(), shape.parameters);
        let (one, first_noise, wide) = (ny - 1, padded(ny), padded(nf));
        let width = first_noise + padded(NOISES);
        let mut v = vec![0.0; width * width];
        let mut q = vec![0.0; width * width];
        let mut rows = vec![0.0; ROWS * width];
        let mut weighted = vec![0.0; ROWS * width];
        let mut flow = vec![0.0; MOTION * wide];
        let mut motion = vec![0.0; MOTION * first_noise];
        let mut moved = vec![0.0; wide * first_noise];
        let mut turned = vec![0.0; MOTION * wide];
        let mut twice = vec![0.0; wide * wide];
        let mut noises = vec![0.0; NOISES * first_noise];
        let mut less = vec![0.0; NOISES * first_noise];
        let places: Vec<usize> = (0..nf)
            .map(|column| match column {
                c if c < ACTING => c,
                c if c < ACTING + WRENCH => first_noise + c - ACTING,
                c if c + 1 < nf => STATES + c - ACTING - WRENCH,
                _ => one,
            })
            .collect();
        for j in (from..to).rev() {
            q.fill(0.0);
            let mut count = 0;
            for (i, &weight) in self.weights[j].iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
                let (row, at) = (self.row(j, i), count * width);
                let out = &mut rows[at..at + width];
                out[..STATES].copy_from_slice(&row[..STATES]);
                out[STATES..ny].copy_from_slice(&row[STATES + NOISES..]);
                out[first_noise..first_noise + NOISES].copy_from_slice(&row[STATES..STATES + NOISES]);
                for (weighted, x) in weighted[at..at + width].iter_mut().zip(out) {
                    *weighted = weight * *x;
                }
                count += 1;
            }
            let of = |values| Rows { width, values };
            add_product(&mut q, width, of(&weighted[..count * width]), of(&rows[..count * width]), true);
            if j + 1 < to {
                for (out, row) in
                    flow.chunks_exact_mut(wide).zip(self.flow[j * MOTION * nf..(j + 1) * MOTION * nf].chunks_exact(nf))
                {
                    out[..nf].copy_from_slice(row);
                }
                let flow = Rows { width: wide, values: &flow };
                // Of the form after the segment, what the flow makes of the motion's part: once, and on both sides.
                moved.fill(0.0);
                for (out, row) in motion.chunks_exact_mut(first_noise).zip(v.chunks_exact(width)) {
                    out.copy_from_slice(&row[..first_noise]);
                }
                add_product(&mut moved, first_noise, flow, Rows { width: first_noise, values: &motion }, false);
                for (i, turned) in turned.chunks_exact_mut(wide).enumerate() {
                    for (out, row) in turned.iter_mut().zip(moved.chunks_exact(first_noise)) {
                        *out = row[i];
                    }
                }
                twice.fill(0.0);
                add_product(&mut twice, wide, Rows { width: wide, values: &turned }, flow, true);
                for (c, &a) in places.iter().enumerate() {
                    for (more, &b) in twice[c * wide + c..c * wide + nf].iter().zip(&places[c..]) {
                        q[a.min(b) * width + a.max(b)] += more;
                    }
                    let row = &moved[c * first_noise..c * first_noise + ny];
                    for i in 0..SLOW {
                        let (state, noise) = (MOTION + i, first_noise + WRENCH + i);
                        let twice = if a == state { 2.0 } else { 1.0 };
                        q[a.min(state) * width + a.max(state)] += twice * row[state] * self.wandering.decay[i];
                        q[a.min(noise) * width + a.max(noise)] += row[state] * self.wandering.drive[i];
                    }
                    if a < ACTING {
                        for (out, more) in q[a * width + STATES..a * width + ny].iter_mut().zip(&row[STATES..]) {
                            *out += more;
                        }
                    } else {
                        for (b, more) in row.iter().enumerate().skip(STATES) {
                            let twice = if a == b { 2.0 } else { 1.0 };
                            q[a.min(b) * width + a.max(b)] += twice * more;
                        }
                    }
                }
                for i in 0..SLOW {
                    let (state, noise) = (MOTION + i, first_noise + WRENCH + i);
                    let (decay, drive) = (self.wandering.decay[i], self.wandering.drive[i]);
                    let row = &v[state * width..state * width + ny];
                    for k in 0..SLOW {
                        let (other, beside) = (MOTION + k, first_noise + WRENCH + k);
                        let value = v[state.min(other) * width + state.max(other)];
                        q[state * width + beside] += value * decay * self.wandering.drive[k];
                        if k >= i {
                            q[state * width + other] += value * decay * self.wandering.decay[k];
                            q[noise * width + beside] += value * drive * self.wandering.drive[k];
                        }
                    }
                    for (b, value) in row.iter().enumerate().skip(STATES) {
                        q[state * width + b] += value * decay;
                        q[b * width + noise] += value * drive;
                    }
                }
                for a in STATES..=STATES + p {
                    for (out, value) in
                        q[a * width + a..a * width + ny].iter_mut().zip(&v[a * width + a..a * width + ny])
                    {
                        *out += value;
                    }
                }
            }
            for i in 0..NOISES {
                let a = first_noise + i;
                q[a * width + a] += 1.0;
            }
            for (i, error) in self.errors[j].iter().enumerate() {
                q[one * width + first_noise + i] += error;
                q[one * width + one] += error * error;
            }
            if j == from {
                for (i, precision) in self.first.iter().enumerate() {
                    q[i * width + i] += precision;
                }
                for (i, sigma) in self.wandering.sigma.iter().enumerate() {
                    q[(MOTION + i) * width + MOTION + i] += 1.0 / (sigma * sigma);
                }
            }
            // Noises out.
            for (i, out) in noises.chunks_exact_mut(first_noise).enumerate() {
                for (out, row) in out.iter_mut().zip(q.chunks_exact(width)) {
                    *out = row[first_noise + i];
                }
            }
            let factor = &mut self.factors[j];
            for i in 0..NOISES {
                for c in 0..=i {
                    let mut sum = q[(first_noise + c) * width + first_noise + i];
                    for t in 0..c {
                        sum -= factor[i][t] * factor[c][t];
                    }
                    // The noises have unit information of their own: rounding alone makes a pivot smaller.
                    factor[i][c] = if c == i { sum.max(1.0).sqrt() } else { sum / factor[c][c] };
                }
            }
            for i in 0..NOISES {
                let (before, here) = noises.split_at_mut(i * first_noise);
                let here = &mut here[..first_noise];
                accumulate(here, (0..i).map(|t| (-factor[i][t], &before[t * first_noise..(t + 1) * first_noise])));
                scale(here, 1.0 / factor[i][i]);
            }
            for (less, more) in less.iter_mut().zip(&noises) {
                *less = -more;
            }
            let of = |values| Rows { width: first_noise, values };
            add_product(&mut q, width, of(&less), of(&noises), true);
            for r in 1..MOTION {
                for c in 0..r {
                    q[r * width + c] = q[c * width + r];
                }
            }
            core::mem::swap(&mut v, &mut q);
            if keep {
                for i in (0..NOISES).rev() {
                    let (here, after) = noises[i * first_noise..].split_at_mut(first_noise);
                    for t in i + 1..NOISES {
                        let at = (t - i - 1) * first_noise;
                        axpy(here, -factor[t][i], &after[at..at + first_noise]);
                    }
                    scale(here, 1.0 / factor[i][i]);
                }
                let gains = self.gains[j * NOISES * ny..(j + 1) * NOISES * ny].chunks_exact_mut(ny);
                for (gain, noise) in gains.zip(noises.chunks_exact(first_noise)) {
                    gain.copy_from_slice(&noise[..ny]);
                }
            }
        }
        (0..ny * ny).map(|at| (at / ny, at % ny)).map(|(a, b)| v[a.min(b) * width + a.max(b)]).collect()
    }

    /// Sum of the logarithms of the pivots of all noises, as last eliminated: half the logarithm of the determinant of their information.
    pub(super) fn log_pivots(&self) -> f64 {
        self.factors.iter().flat_map(|factor| (0..NOISES).map(|i| factor[i][i].ln())).sum()
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
                for (c, x) in x.iter().enumerate().take(ACTING) {
                    sum += row[c] * x;
                }
                for (c, u) in u.iter().enumerate().take(WRENCH) {
                    sum += row[ACTING + c] * u;
                }
                for (c, step) in step.iter().enumerate().take(nd) {
                    sum += row[ACTING + WRENCH + c] * step;
                }
                next[i] = sum;
            }
            for i in 0..SLOW {
                next[MOTION + i] = self.wandering.decay[i] * x[MOTION + i] + self.wandering.drive[i] * u[WRENCH + i];
            }
            states.push(x);
            noises.push(u);
            x = next;
        }
        (states, noises)
    }

    /// Shares of freedom that states, noises and parameters take of each row, and the posterior variances of the errors of the wrench, those of the
    /// segment and the drives of lasting ones, from the covariance of first state and parameters (symmetric, `STATES + parameters` wide).
    ///
    /// The noises are `u = -K y + e`, where e is of its own covariance S, beside y of state and parameters with covariance C.
    pub(super) fn shares(&self, covariance: &[f64]) -> (Vec<[f64; ROWS]>, Vec<[f64; 2 * WRENCH]>) {
        let shape = self.shape;
        let (n, p, nf) = (STATES + shape.parameters, shape.parameters, shape.flow());
        let (wide, asked, tall) = (padded(n), padded(NOISES + ROWS), padded(MOTION));
        let width = wide + padded(NOISES);
        let mut c = vec![0.0; n * wide];
        for (out, row) in c.chunks_exact_mut(wide).zip(covariance.chunks_exact(n)) {
            out[..n].copy_from_slice(row);
        }
        // Columns: gains, then rows without their part of the noises.
        let mut columns = vec![0.0; n * asked];
        let mut products = vec![0.0; asked * wide];
        // Of what flows, the covariance with y and with the noises, and where each flows to.
        let mut flowing = vec![0.0; (nf - 1) * width];
        let mut flow = vec![0.0; (nf - 1) * tall];
        let mut next = vec![0.0; STATES * width];
        let (mut taken, mut variances) = (Vec::new(), Vec::new());
        let chunked = |sums: &mut [f64], of: usize, left: Rows<'_>, right: Rows<'_>| {
            let both = left.values.chunks(DEPTH * left.width).zip(right.values.chunks(DEPTH * right.width));
            for (a, b) in both {
                add_product(sums, of, Rows { values: a, ..left }, Rows { values: b, ..right }, false);
            }
        };
        for j in 0..self.segments() {
            for (a, out) in columns.chunks_exact_mut(asked).enumerate() {
                for (i, out) in out.iter_mut().enumerate().take(NOISES) {
                    *out = self.gain(j, i)[a];
                }
                let place = if a < STATES { a } else { a + NOISES };
                for (i, out) in out[NOISES..NOISES + ROWS].iter_mut().enumerate() {
                    *out = if self.weights[j][i] == 0.0 { 0.0 } else { self.row(j, i)[place] };
                }
            }
            products.fill(0.0);
            chunked(&mut products, wide, Rows { width: asked, values: &columns }, Rows { width: wide, values: &c });
            let product = |i: usize| &products[i * wide..i * wide + n];
            let inverse = inverse_of(&self.factors[j]);
            let mut noises = inverse;
            for i in 0..NOISES {
                for t in 0..=i {
                    noises[i][t] += dot(product(i), &self.gain(j, t)[..n]);
                    noises[t][i] = noises[i][t];
                }
            }
            let mut share = [0.0; ROWS];
            for (i, share) in share.iter_mut().enumerate() {
                let weight = self.weights[j][i];
                if weight == 0.0 {
                    continue;
                }
                let row = self.row(j, i);
                let by_noise = &row[STATES..STATES + NOISES];
                let beside = |of: &[f64]| {
                    dot(&of[..STATES], &row[..STATES]) + dot(&of[STATES..], &row[STATES + NOISES..row.len() - 1])
                };
                let mut variance = beside(product(NOISES + i));
                for (t, by) in by_noise.iter().enumerate().filter(|(_, by)| **by != 0.0) {
                    let both: f64 = noises[t].iter().zip(by_noise).map(|(a, b)| a * b).sum();
                    variance += by * (both - 2.0 * beside(product(t)));
                }
                *share = weight * variance;
            }
            taken.push(share);
            variances.push(core::array::from_fn(|i| noises[i][i]));
            if j + 1 == self.segments() {
                break;
            }
            let flows = &self.flow[j * MOTION * nf..(j + 1) * MOTION * nf];
            for (column, (out, to)) in flowing.chunks_exact_mut(width).zip(flow.chunks_exact_mut(tall)).enumerate() {
                for (i, to) in to.iter_mut().enumerate().take(MOTION) {
                    *to = flows[i * nf + column];
                }
                if let Some(noise) = column.checked_sub(ACTING).filter(|noise| *noise < WRENCH) {
                    for (out, x) in out.iter_mut().zip(product(noise)) {
                        *out = -x;
                    }
                    out[wide..wide + NOISES].copy_from_slice(&noises[noise]);
                } else {
                    let a = if column < ACTING { column } else { STATES + column - ACTING - WRENCH };
                    out[..n].copy_from_slice(&c[a * wide..a * wide + n]);
                    for (i, out) in out[wide..wide + NOISES].iter_mut().enumerate() {
                        *out = -products[i * wide + a];
                    }
                }
            }
            next.fill(0.0);
            chunked(&mut next, width, Rows { width: tall, values: &flow }, Rows { width, values: &flowing });
            let wandered = |i: usize, at: usize| {
                let (decay, drive) = (self.wandering.decay[i], self.wandering.drive[i]);
                let noise = if at < wide { -products[(WRENCH + i) * wide + at] } else { noises[WRENCH + i][at - wide] };
                let state =
                    if at < wide { c[(MOTION + i) * wide + at] } else { -products[(at - wide) * wide + MOTION + i] };
                decay * state + drive * noise
            };
            for i in 0..SLOW {
                let out = &mut next[(MOTION + i) * width..(MOTION + i + 1) * width];
                for at in (0..n).chain(wide..wide + NOISES) {
                    out[at] = wandered(i, at);
                }
            }
            for (r, from) in next.chunks_exact(width).enumerate() {
                let out = &mut c[r * wide..r * wide + n];
                for (i, out) in out.iter_mut().enumerate().take(MOTION) {
                    let flow = &flows[i * nf..(i + 1) * nf];
                    let (noises, parameters) = (ACTING + WRENCH, &flow[ACTING + WRENCH..nf - 1]);
                    *out = dot(&flow[..ACTING], &from[..ACTING])
                        + dot(&flow[ACTING..noises], &from[wide..wide + WRENCH])
                        + dot(parameters, &from[STATES..STATES + parameters.len()]);
                }
                for i in 0..SLOW {
                    out[MOTION + i] =
                        self.wandering.decay[i] * from[MOTION + i] + self.wandering.drive[i] * from[wide + WRENCH + i];
                }
                out[STATES..].copy_from_slice(&from[STATES..n]);
            }
            for r in 0..STATES {
                for a in STATES..STATES + p {
                    c[a * wide + r] = c[r * wide + a];
                }
                for a in 0..r {
                    let mean = 0.5 * (c[r * wide + a] + c[a * wide + r]);
                    c[r * wide + a] = mean;
                    c[a * wide + r] = mean;
                }
            }
        }
        (taken, variances)
    }
}

/// Inner product, in as many sums as a tile is wide.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((whole, rest), (with, beside)) = (a.as_chunks::<TILE>(), b.as_chunks::<TILE>());
    let mut sums = [0.0; TILE];
    for (a, b) in whole.iter().zip(with) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + rest.iter().zip(beside).map(|(a, b)| a * b).sum::<f64>()
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
