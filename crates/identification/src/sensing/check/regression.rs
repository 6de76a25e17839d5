//! Least squares of overlapping increments: robust, with standard deviations that hold for correlated residuals.

use super::levels::median;
use nalgebra::{DMatrix, DVector, Vector3};
use num_traits::AsPrimitive;

/// Rounds of reweighting.
const ROUNDS: usize = 5;
/// Degrees of freedom of Student's distribution that residuals are weighted by.
const STUDENT: f64 = 4.0;
/// Standard deviation of a normal variable over the median of its size.
const DEVIATION_OF_MEDIAN: f64 = 1.4826;
/// Share of what one stream shows that another may leave where it tells an age, a gain or a lever: a controller that holds a body makes it follow the
/// errors of what is measured, which then look like motion of another time.
pub(super) const MOST_LEFT: f64 = 0.1;
/// Residuals of an axis below this share of the largest axis are no measurement.
const EXACT: f64 = 1e-9;

/// Pairs of times about `span_s` apart, by their places; each time begins one pair at most.
pub(super) fn spans(times: &[f64], span_s: f64) -> Vec<(usize, usize)> {
    let mut pairs = Vec::with_capacity(times.len());
    let mut j = 0;
    for (i, from) in times.iter().enumerate() {
        while j < times.len() && times[j] - from < 0.9 * span_s {
            j += 1;
        }
        if j < times.len() && j > i && times[j] - from < 1.6 * span_s {
            pairs.push((i, j));
        }
    }
    pairs
}

/// Rows of three axes: what is left, and how it changes with each parameter.
pub(super) struct Rows {
    parameters: usize,
    times: Vec<f64>,
    residuals: Vec<Vector3<f64>>,
    design: Vec<Vector3<f64>>,
    seen: Vec<Vector3<f64>>,
}

/// The best step from where the rows were made.
pub(super) struct Solution {
    pub(super) step: DVector<f64>,
    pub(super) sigma: DVector<f64>,
    /// Robust scale of the residuals of each axis; zero where it was not measured.
    pub(super) scale: Vector3<f64>,
    /// How much wider the first parameter's standard deviation is than with independent residuals.
    pub(super) widening: f64,
    /// The rows explain what was seen, so that they do not answer to its errors.
    pub(super) explains: bool,
}

impl Rows {
    pub(super) fn new(parameters: usize) -> Self {
        Self { parameters, times: Vec::new(), residuals: Vec::new(), design: Vec::new(), seen: Vec::new() }
    }

    /// A row at a time: what was seen, and what is left of it, which is these changes times the step, and noise.
    pub(super) fn push(&mut self, time_s: f64, seen: Vector3<f64>, residual: Vector3<f64>, changes: &[Vector3<f64>]) {
        self.times.push(time_s);
        self.seen.push(seen);
        self.residuals.push(residual);
        self.design.extend_from_slice(changes);
    }

    pub(super) fn len(&self) -> usize {
        self.times.len()
    }

    /// The misfit of the rows as they are.
    pub(super) fn misfit(&self, scale: &Vector3<f64>) -> f64 {
        robust(&self.residuals, scale)
    }

    /// The misfit after a step.
    pub(super) fn misfit_after(&self, step: &DVector<f64>, scale: &Vector3<f64>) -> f64 {
        robust(&self.left(step), scale)
    }

    /// The best step, each parameter held to zero by a standard deviation; residuals are independent between blocks of this length.
    /// `None` for too few rows.
    pub(super) fn solve(&self, priors: &[f64], block_s: f64) -> Option<Solution> {
        let p = self.parameters;
        if self.len() < 2 * p {
            return None;
        }
        let mut step = DVector::zeros(p);
        let mut found = None;
        for _ in 0..ROUNDS {
            let left = self.left(&step);
            let scale = scales(&left);
            let sums = self.sums(&left, &scale, &step, priors, block_s);
            let inverse = sums.normal.clone().cholesky()?.inverse();
            step += &inverse * &sums.gradient;
            found = Some((sums, inverse, scale));
        }
        let (sums, inverse, scale) = found?;
        let spread = &inverse * &sums.scatter * &inverse;
        // The scatter of one parameter's scores is itself known poorly from few blocks: never below that of all parameters together.
        let together = (&inverse * &sums.scatter).trace() / p as f64;
        let sigma = DVector::from_fn(p, |i, _| spread[(i, i)].max(together.max(1.0) * inverse[(i, i)]).sqrt());
        let explains = self.share_left(&step, &scale) < MOST_LEFT;
        let widening = (sigma[0] / inverse[(0, 0)].sqrt()).max(1.0);
        Some(Solution { step, sigma, scale, widening, explains })
    }

    /// Share of what was seen to vary that is left over, axes counted by their noise.
    fn share_left(&self, step: &DVector<f64>, scale: &Vector3<f64>) -> f64 {
        let n = self.len() as f64;
        let mean = self.seen.iter().fold(Vector3::zeros(), |sum: Vector3<f64>, seen| sum + seen / n);
        let unit = scale.map(|s| if s > 0.0 { 1.0 / s } else { 0.0 });
        let power = |of: Vector3<f64>| of.component_mul(&unit).norm_squared();
        let left: f64 = self.left(step).into_iter().map(power).sum();
        left / self.seen.iter().map(|seen| power(seen - mean)).sum::<f64>().max(f64::MIN_POSITIVE)
    }

    fn left(&self, step: &DVector<f64>) -> Vec<Vector3<f64>> {
        let p = self.parameters;
        let rows = self.residuals.iter().zip(self.design.chunks_exact(p));
        rows.map(|(e, x)| x.iter().zip(step.iter()).fold(*e, |left, (x, s)| left - x * *s)).collect()
    }

    fn sums(
        &self,
        left: &[Vector3<f64>],
        scale: &Vector3<f64>,
        step: &DVector<f64>,
        priors: &[f64],
        block_s: f64,
    ) -> Sums {
        let p = self.parameters;
        // Its lower triangle, row by row.
        let mut normal = vec![0.0; p * p];
        let mut row = vec![0.0; p];
        let mut scatter = DMatrix::zeros(p, p);
        let mut gradient = DVector::zeros(p);
        let mut block = DVector::<f64>::zeros(p);
        let (mut within, mut blocks) = (0_i64, 0.0);
        let (mut weights, mut slopes) = (0.0, 0.0);
        let first = self.times.first().copied().unwrap_or_default();
        for ((e, x), time) in left.iter().zip(self.design.chunks_exact(p)).zip(&self.times) {
            let at: i64 = ((time - first) / block_s).floor().as_();
            if at != within {
                scatter.ger(1.0, &block, &block, 1.0);
                block.fill(0.0);
                within = at;
                blocks += 1.0;
            }
            for axis in 0..3 {
                if scale[axis] <= 0.0 {
                    continue;
                }
                let unit = (e[axis] / scale[axis]).powi(2) / STUDENT;
                let weight = 1.0 / (1.0 + unit);
                weights += weight;
                slopes += (1.0 - unit) * weight * weight;
                let weight = weight / scale[axis].powi(2);
                for (entry, x) in row.iter_mut().zip(x) {
                    *entry = x[axis];
                }
                for (i, entry) in row.iter().enumerate() {
                    let weighted = weight * entry;
                    block[i] += weighted * e[axis];
                    gradient[i] += weighted * e[axis];
                    for (sum, other) in normal[i * p..=i * p + i].iter_mut().zip(&row) {
                        *sum += weighted * other;
                    }
                }
            }
        }
        scatter.ger(1.0, &block, &block, 1.0);
        blocks += 1.0;
        let mut normal = DMatrix::from_fn(p, p, |i, k| normal[i.max(k) * p + i.min(k)]);
        let curvature = if weights > 0.0 { (slopes / weights).clamp(0.2, 1.0) } else { 1.0 };
        normal *= curvature;
        // Few blocks see too little of their own scatter.
        scatter *= 1.0 + (p as f64 + 1.0) / blocks;
        for (i, prior) in priors.iter().enumerate() {
            let tight = 1.0 / (prior * prior);
            normal[(i, i)] += tight;
            scatter[(i, i)] += tight;
            gradient[i] -= tight * step[i];
        }
        Sums { normal, scatter, gradient }
    }
}

struct Sums {
    normal: DMatrix<f64>,
    scatter: DMatrix<f64>,
    gradient: DVector<f64>,
}

/// Minus twice the logarithm of the likelihood of Student's distribution, but for a constant.
fn robust(residuals: &[Vector3<f64>], scale: &Vector3<f64>) -> f64 {
    let unit = |e: &Vector3<f64>, a: usize| if scale[a] > 0.0 { (e[a] / scale[a]).powi(2) } else { 0.0 };
    let one = |e: &Vector3<f64>| (0..3).map(|a| (STUDENT + 1.0) * (1.0 + unit(e, a) / STUDENT).ln()).sum::<f64>();
    residuals.iter().map(one).sum()
}

/// Robust scale of each axis; zero where an axis was not measured.
fn scales(left: &[Vector3<f64>]) -> Vector3<f64> {
    let of = |axis: usize| {
        let mut sizes: Vec<f64> = left.iter().map(|e| e[axis].abs()).collect();
        DEVIATION_OF_MEDIAN * median(&mut sizes).unwrap_or_default()
    };
    let scale = Vector3::from_fn(|axis, _| of(axis));
    let most = scale.max();
    scale.map(|s| if s > EXACT * most { s } else { 0.0 })
}
