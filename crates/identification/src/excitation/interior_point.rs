//! A primal-dual interior-point method that never leaves the limits.
//!
//! Slacks are computed, not carried: every iterate is strictly feasible, so stopping early costs optimality only. The
//! barrier's part of the Hessian is exact; the rest, the Lagrangian's, is a damped BFGS approximation.

use super::limits::ChannelLimits;
use super::objective::{Channels, RestTable, channels, instant};
use super::problem::ExcitationProblem;
use crate::lie::skew;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3, Vector6};

/// Factor from one barrier to the next.
const BARRIER_STEP: f64 = 0.2;
/// Squared Newton step, in units of the barrier and of the root of the number of limits, at which it is time for the next.
const CENTERED: f64 = 0.2;
/// Share of the way to the nearest limit that a step may go.
const TO_THE_LIMIT: f64 = 0.99;

/// What stands for an infinite bound beside a finite one, in units of the latter: no step changes the distance to it.
const NO_LIMIT: f64 = 1e50;

/// Two-sided linear limits on one channel's numbers: `lower <= row . numbers <= upper`.
struct ChannelRows {
    /// In the order of the problem's channels.
    rows: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

/// One-sided limits on the wrench at the samples of the limits.
struct WrenchRows<'a> {
    limits: &'a super::limits::WrenchLimits,
    /// Rows of the wrench by all numbers, six for each sample.
    jacobian: DMatrix<f64>,
    wrenches: Vec<Vector6<f64>>,
}

/// The limits as functions of scaled numbers, in which each channel's limits are about a unit sphere.
pub(super) struct Limits<'a> {
    free: usize,
    moving: Vec<usize>,
    /// From scaled to free numbers of each moving channel.
    scaling: Vec<DMatrix<f64>>,
    channels: Vec<ChannelRows>,
    table: RestTable,
    wrench: Option<WrenchRows<'a>>,
    scratch: Vec<Channels>,
}

impl<'a> Limits<'a> {
    /// Limits at equal steps of a period.
    pub fn new<const P: usize>(problem: &'a ExcitationProblem<P>, samples: usize) -> Self {
        let table = RestTable::new(&problem.basis, samples);
        let free = problem.basis.coefficients() - 3;
        let moving: Vec<usize> = problem.channels.iter().map(|(channel, _)| *channel as usize).collect();
        let (scaling, channels) = problem.channels.iter().map(|(_, limits)| channel_rows(&table, free, limits)).unzip();
        let wrench = problem.wrench_limits.as_ref().map(|limits| WrenchRows {
            limits,
            jacobian: DMatrix::zeros(6 * samples, free * moving.len()),
            wrenches: vec![Vector6::zeros(); samples],
        });
        Self { free, moving, scaling, channels, table, wrench, scratch: vec![[0.0; 6]; free] }
    }

    /// Number of scaled numbers.
    pub fn numbers(&self) -> usize {
        self.free * self.moving.len()
    }

    fn count(&self) -> usize {
        let linear: usize = self.channels.iter().map(|channel| 2 * channel.lower.len()).sum();
        linear + self.wrench.as_ref().map_or(0, |wrench| wrench.wrenches.len() * wrench.limits.half_spaces().len())
    }

    /// Free numbers of every channel from scaled ones.
    pub fn free_numbers(&self, scaled: &[f64], free: &mut [Channels]) {
        let parts = scaled.chunks_exact(self.free).zip(&self.scaling).zip(&self.moving);
        for ((scaled, scaling), &channel) in parts {
            for (row, free) in free.iter_mut().enumerate() {
                free[channel] = scaling.row(row).iter().zip(scaled).map(|(a, b)| a * b).sum();
            }
        }
    }

    /// A gradient by scaled numbers from one by free numbers.
    fn scaled_gradient(&self, free: &[Channels], scaled: &mut [f64]) {
        let parts = scaled.chunks_exact_mut(self.free).zip(&self.scaling).zip(&self.moving);
        for ((scaled, scaling), &channel) in parts {
            for (column, scaled) in scaled.iter_mut().enumerate() {
                *scaled = scaling.column(column).iter().zip(free).map(|(a, free)| a * free[channel]).sum();
            }
        }
    }

    /// Free numbers of a channel.
    pub fn free(&self) -> usize {
        self.free
    }

    /// Brings each channel's numbers to where the largest share of its limits is this; then all, for the wrench.
    pub fn shrink(&mut self, scaled: &mut [f64], share: f64) {
        for (channel, numbers) in self.channels.iter().zip(scaled.chunks_exact_mut(self.free)) {
            let mut largest = f64::MIN_POSITIVE;
            let bounds = channel.lower.iter().zip(&channel.upper);
            for (row, (lower, upper)) in channel.rows.chunks_exact(self.free).zip(bounds) {
                let value: f64 = row.iter().zip(numbers.iter()).map(|(a, b)| a * b).sum();
                largest = largest.max(value / upper).max(value / lower);
            }
            for number in numbers {
                *number *= share / largest;
            }
        }
        let mut slacks = Vec::new();
        for _ in 0..60 {
            if self.wrench.is_none() || self.slacks(scaled, &mut slacks) {
                return;
            }
            for number in scaled.iter_mut() {
                *number *= 0.8;
            }
        }
    }

    /// Distances to all limits, positive inside; `false` where one is not.
    pub fn slacks(&mut self, scaled: &[f64], slacks: &mut Vec<f64>) -> bool {
        slacks.clear();
        for (channel, numbers) in self.channels.iter().zip(scaled.chunks_exact(self.free)) {
            let bounds = channel.lower.iter().zip(&channel.upper);
            for (row, (lower, upper)) in channel.rows.chunks_exact(self.free).zip(bounds) {
                let value: f64 = row.iter().zip(numbers).map(|(a, b)| a * b).sum();
                slacks.push(value - lower);
                slacks.push(upper - value);
            }
        }
        if self.wrench.is_some() {
            let mut free = core::mem::take(&mut self.scratch);
            self.free_numbers(scaled, &mut free);
            if let Some(wrench) = &mut self.wrench {
                for (functions, found) in self.table.samples().zip(&mut wrench.wrenches) {
                    let Some(instant) = instant(&channels(functions, &free)) else { return false };
                    *found = instant.regressor() * wrench.limits.parameters();
                    let half_spaces = wrench.limits.half_spaces().iter();
                    slacks.extend(half_spaces.map(|(normal, bound)| bound - normal.dot(found)));
                }
            }
            self.scratch = free;
        }
        slacks.iter().all(|&slack| slack > 0.0)
    }

    /// Derivatives of the wrenches where the slacks were computed last.
    fn linearize(&mut self, scaled: &[f64]) {
        let mut free = core::mem::take(&mut self.scratch);
        self.free_numbers(scaled, &mut free);
        if let Some(wrench) = &mut self.wrench {
            let parameters = wrench.limits.parameters();
            for (sample, functions) in self.table.samples().enumerate() {
                let Some(instant) = instant(&channels(functions, &free)) else { continue };
                let by_terms = wrench_by_terms(parameters, &instant.angular_velocity_body);
                let by_channels = instant.sensitivities().map(|terms| by_terms * terms.fixed_rows::<9>(0));
                let columns = self.moving.iter().zip(&self.scaling).enumerate();
                for (part, (&channel, scaling)) in columns {
                    for number in 0..self.free {
                        let mut column = Vector6::zeros();
                        for (function, scale) in functions.iter().zip(scaling.column(number).iter()) {
                            for (by, function) in by_channels.iter().zip(function) {
                                column += by.column(channel) * (function * scale);
                            }
                        }
                        let at = (6 * sample, part * self.free + number);
                        wrench.jacobian.fixed_view_mut::<6, 1>(at.0, at.1).copy_from(&column);
                    }
                }
            }
        }
        self.scratch = free;
    }

    /// Adds `sum_j factor_j grad slack_j` to a gradient; of the wrench limits only, if asked.
    fn add_gradients(&self, factors: &[f64], wrench_only: bool, gradient: &mut DVector<f64>) {
        let mut factors = factors.iter();
        for (part, channel) in self.channels.iter().enumerate() {
            for row in channel.rows.chunks_exact(self.free) {
                let (Some(lower), Some(upper)) = (factors.next(), factors.next()) else { return };
                if !wrench_only {
                    for (number, value) in row.iter().enumerate() {
                        gradient[part * self.free + number] += (lower - upper) * value;
                    }
                }
            }
        }
        if let Some(wrench) = &self.wrench {
            for sample in 0..wrench.wrenches.len() {
                let mut force = Vector6::zeros();
                for ((normal, _), factor) in wrench.limits.half_spaces().iter().zip(&mut factors) {
                    force += normal * *factor;
                }
                gradient.gemv_tr(-1.0, &wrench.jacobian.fixed_rows::<6>(6 * sample), &force, 1.0);
            }
        }
    }

    /// Adds `sum_j weight_j grad slack_j grad slack_j^T`, lower triangle.
    fn add_products(&self, weights: &[f64], hessian: &mut DMatrix<f64>) {
        let mut weights = weights.iter();
        let mut block = vec![0.0; self.free * self.free];
        for (part, channel) in self.channels.iter().enumerate() {
            block.fill(0.0);
            for row in channel.rows.chunks_exact(self.free) {
                let (Some(lower), Some(upper)) = (weights.next(), weights.next()) else { return };
                for (column, right) in block.chunks_exact_mut(self.free).zip(row) {
                    let scaled = (lower + upper) * right;
                    for (entry, left) in column.iter_mut().zip(row) {
                        *entry += scaled * left;
                    }
                }
            }
            let start = part * self.free;
            for (column, block) in block.chunks_exact(self.free).enumerate() {
                for (row, entry) in block.iter().enumerate().skip(column) {
                    hessian[(start + row, start + column)] += entry;
                }
            }
        }
        if let Some(wrench) = &self.wrench {
            for sample in 0..wrench.wrenches.len() {
                let mut middle = SMatrix::<f64, 6, 6>::zeros();
                for ((normal, _), weight) in wrench.limits.half_spaces().iter().zip(&mut weights) {
                    middle.ger(*weight, normal, normal, 1.0);
                }
                let jacobian = wrench.jacobian.fixed_rows::<6>(6 * sample);
                for j in 0..self.numbers() {
                    let right = middle * jacobian.column(j);
                    for i in j..self.numbers() {
                        hessian[(i, j)] += jacobian.column(i).dot(&right);
                    }
                }
            }
        }
    }

    /// Changes of the slacks along a direction.
    fn changes(&self, direction: &DVector<f64>, changes: &mut Vec<f64>) {
        changes.clear();
        for (channel, numbers) in self.channels.iter().zip(direction.as_slice().chunks_exact(self.free)) {
            for row in channel.rows.chunks_exact(self.free) {
                let value: f64 = row.iter().zip(numbers).map(|(a, b)| a * b).sum();
                changes.extend([value, -value]);
            }
        }
        if let Some(wrench) = &self.wrench {
            for sample in 0..wrench.wrenches.len() {
                let change = wrench.jacobian.fixed_rows::<6>(6 * sample) * direction;
                changes.extend(wrench.limits.half_spaces().iter().map(|(normal, _)| -normal.dot(&change)));
            }
        }
    }
}

/// Scaling and rows of one channel: limits of half-width one.
fn channel_rows(table: &RestTable, free: usize, limits: &ChannelLimits) -> (DMatrix<f64>, ChannelRows) {
    let mut rows = ChannelRows { rows: Vec::new(), lower: Vec::new(), upper: Vec::new() };
    let mut gram = DMatrix::zeros(free, free);
    // At time zero nothing moves.
    for functions in table.samples().skip(1) {
        for (order, [lower, upper]) in limits.intervals().into_iter().enumerate() {
            if lower.is_infinite() && upper.is_infinite() {
                continue;
            }
            let half =
                if lower.is_infinite() || upper.is_infinite() { upper.min(-lower) } else { 0.5 * (upper - lower) };
            let row = DVector::from_iterator(free, functions.iter().map(|function| function[order] / half));
            gram.ger(1.0, &row, &row, 1.0);
            rows.rows.extend(row.iter());
            rows.lower.push((lower / half).max(-NO_LIMIT));
            rows.upper.push((upper / half).min(NO_LIMIT));
        }
    }
    gram /= rows.lower.len().max(1) as f64;
    // The rows span all numbers: more samples than coefficients, and at least one limit.
    let scaling = gram
        .cholesky()
        .and_then(|cholesky| cholesky.unpack().transpose().try_inverse())
        .unwrap_or_else(|| DMatrix::identity(free, free));
    let count = rows.lower.len();
    let scaled = DMatrix::from_row_slice(count, free, &rows.rows) * &scaling;
    rows.rows = scaled.transpose().as_slice().to_vec();
    (scaling, rows)
}

/// The wrench by `[angular velocity; angular acceleration; acceleration of the origin]`.
fn wrench_by_terms(p: &SVector<f64, 10>, w: &Vector3<f64>) -> SMatrix<f64, 6, 9> {
    let h = Vector3::new(p[1], p[2], p[3]);
    let inertia = Matrix3::new(p[4], p[5], p[6], p[5], p[7], p[8], p[6], p[8], p[9]);
    let mut by = SMatrix::<f64, 6, 9>::zeros();
    by.fixed_view_mut::<3, 3>(0, 0).copy_from(&(skew(w) * inertia - skew(&(inertia * w))));
    by.fixed_view_mut::<3, 3>(0, 3).copy_from(&inertia);
    by.fixed_view_mut::<3, 3>(0, 6).copy_from(&skew(&h));
    by.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-(skew(w) * skew(&h)) - skew(&w.cross(&h))));
    by.fixed_view_mut::<3, 3>(3, 3).copy_from(&-skew(&h));
    by.fixed_view_mut::<3, 3>(3, 6).fill_diagonal(p[0]);
    by
}

/// Where a minimisation ended.
pub(super) struct Minimum {
    pub cost: f64,
    pub scaled: Vec<f64>,
}

/// How far down to go: barrier terms, of the promised decrease at the start, at the beginning and at the end.
#[derive(Clone, Copy)]
pub(super) struct Effort {
    first: f64,
    last: f64,
    iterations: usize,
}

impl Effort {
    /// Along the middle of the feasible motions to the neighbourhood of a minimum.
    pub const ROUGH: Self = Self { first: 1.0, last: 0.2, iterations: 60 };
    /// From there to the minimum.
    pub const FINE: Self = Self { first: 0.2, last: 5e-4, iterations: 300 };
}

/// Goes down from a strictly feasible start. `None` where the cost does not exist there.
pub(super) fn minimize(
    limits: &mut Limits<'_>,
    mut cost_and_gradient: impl FnMut(&[Channels], &mut [Channels]) -> Option<f64>,
    start: &[f64],
    effort: Effort,
) -> Option<Minimum> {
    let numbers = limits.numbers();
    let mut by_free = vec![[0.0; 6]; limits.free];
    let mut free = vec![[0.0; 6]; limits.free];
    let mut evaluate = |limits: &Limits<'_>, scaled: &[f64], gradient: &mut DVector<f64>| -> Option<f64> {
        limits.free_numbers(scaled, &mut free);
        let cost = cost_and_gradient(&free, &mut by_free)?;
        limits.scaled_gradient(&by_free, gradient.as_mut_slice());
        Some(cost).filter(|cost| cost.is_finite() && gradient.iter().all(|g| g.is_finite()))
    };
    let mut z = DVector::from_column_slice(start);
    let (mut slacks, mut trial_slacks, mut changes) = (Vec::new(), Vec::new(), Vec::new());
    if !limits.slacks(z.as_slice(), &mut slacks) {
        return None;
    }
    limits.linearize(z.as_slice());
    let mut gradient = DVector::zeros(numbers);
    let mut trial_gradient = DVector::zeros(numbers);
    let mut cost = evaluate(limits, z.as_slice(), &mut gradient)?;
    let count = limits.count() as f64;
    // The promised decrease of a motion grown to twice the size; all barrier terms together weigh a share of it.
    let reference = gradient.dot(&z).abs().max(1e-3 * cost.abs()).max(f64::MIN_POSITIVE);
    let mut barrier = effort.first * reference / count;
    let least = effort.last * reference / count;
    let mut multipliers: Vec<f64> = slacks.iter().map(|slack| barrier / slack).collect();
    let mut hessian = DMatrix::identity(numbers, numbers) * (gradient.norm() / z.norm().max(1e-3));
    let mut fresh = true;
    let mut weights = vec![0.0; slacks.len()];
    let mut iterations = 0;
    while iterations < effort.iterations {
        iterations += 1;
        // Newton direction of the barrier function, multipliers eliminated.
        for ((weight, multiplier), slack) in weights.iter_mut().zip(&multipliers).zip(&slacks) {
            *weight = multiplier / slack;
        }
        let mut system = hessian.clone();
        limits.add_products(&weights, &mut system);
        for (weight, slack) in weights.iter_mut().zip(&slacks) {
            *weight = -barrier / slack;
        }
        let mut slope = gradient.clone();
        limits.add_gradients(&weights, false, &mut slope);
        let Some(cholesky) = system.cholesky() else {
            hessian = DMatrix::identity(numbers, numbers) * gradient.norm().max(1e-6);
            if fresh {
                break;
            }
            fresh = true;
            continue;
        };
        let direction = -cholesky.solve(&slope);
        let decrement = -slope.dot(&direction);
        if decrement < CENTERED * barrier * count.sqrt() {
            if barrier <= least {
                break;
            }
            barrier = (BARRIER_STEP * barrier).max(least);
            continue;
        }
        limits.changes(&direction, &mut changes);
        let mut longest: f64 = 1.0;
        let mut longest_dual: f64 = 1.0;
        for ((slack, change), multiplier) in slacks.iter().zip(&changes).zip(&multipliers) {
            if *change < 0.0 {
                longest = longest.min(-TO_THE_LIMIT * slack / change);
            }
            let step = (barrier - multiplier * change) / slack - multiplier;
            if step < 0.0 {
                longest_dual = longest_dual.min(-TO_THE_LIMIT * multiplier / step);
            }
        }
        // Backtracking on the barrier function.
        let mut length = longest;
        let mut accepted = None;
        for _ in 0..25 {
            let trial = &z + &direction * length;
            if limits.slacks(trial.as_slice(), &mut trial_slacks)
                && let Some(trial_cost) = evaluate(limits, trial.as_slice(), &mut trial_gradient)
            {
                let change = trial_cost - cost - barrier * log_growth(&slacks, &trial_slacks);
                if change <= -1e-4 * length * decrement {
                    accepted = Some((trial, trial_cost));
                    break;
                }
            }
            length *= 0.4;
        }
        let Some((trial, trial_cost)) = accepted else {
            if fresh {
                if barrier <= least {
                    break;
                }
                barrier = (BARRIER_STEP * barrier).max(least);
            }
            fresh = true;
            hessian = DMatrix::identity(numbers, numbers) * (gradient.norm() / z.norm().max(1e-3));
            continue;
        };
        for (((multiplier, change), slack), trial) in
            multipliers.iter_mut().zip(&changes).zip(&slacks).zip(&trial_slacks)
        {
            let step = (barrier - *multiplier * change) / slack - *multiplier;
            *multiplier = (*multiplier + longest_dual * step).clamp(1e-3 * barrier / trial, 1e3 * barrier / trial);
        }
        // Gradients of the Lagrangian before and after, with the new multipliers; what is linear cancels.
        let mut difference = -&gradient;
        if limits.wrench.is_some() {
            limits.add_gradients(&multipliers, true, &mut difference);
            limits.linearize(trial.as_slice());
            for (weight, multiplier) in weights.iter_mut().zip(&multipliers) {
                *weight = -multiplier;
            }
            limits.add_gradients(&weights, true, &mut difference);
        }
        difference += &trial_gradient;
        let step = &trial - &z;
        update(&mut hessian, &step, difference, fresh);
        fresh = false;
        z = trial;
        cost = trial_cost;
        core::mem::swap(&mut gradient, &mut trial_gradient);
        core::mem::swap(&mut slacks, &mut trial_slacks);
    }
    Some(Minimum { cost, scaled: z.as_slice().to_vec() })
}

/// Sum of the logarithms of the ratios; one logarithm for several, few enough that no product overflows.
fn log_growth(before: &[f64], after: &[f64]) -> f64 {
    const TOGETHER: usize = 8;
    let growth = |(before, after): (&[f64], &[f64])| {
        before.iter().zip(after).map(|(before, after)| after / before).product::<f64>().ln()
    };
    before.chunks(TOGETHER).zip(after.chunks(TOGETHER)).map(growth).sum()
}

/// Damped BFGS: stays positive definite whatever the cost's curvature.
fn update(hessian: &mut DMatrix<f64>, step: &DVector<f64>, mut difference: DVector<f64>, fresh: bool) {
    let curvature = step.dot(&difference);
    if fresh && curvature > 0.0 {
        let scale = difference.norm_squared() / curvature;
        *hessian = DMatrix::identity(step.len(), step.len()) * scale;
    }
    let along = &*hessian * step;
    let expected = step.dot(&along);
    if expected.is_nan() || expected <= 0.0 {
        return;
    }
    if curvature < 0.2 * expected {
        let share = 0.8 * expected / (expected - curvature);
        difference = difference * share + &along * (1.0 - share);
    }
    let curvature = step.dot(&difference);
    hessian.ger(-1.0 / expected, &along, &along, 1.0);
    hessian.ger(1.0 / curvature, &difference, &difference, 1.0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::InertialParameters;
    use crate::excitation::{SpaceExcitation, WrenchLimits};
    use crate::fourier::FourierBasis;

    fn problem() -> SpaceExcitation {
        let basis = FourierBasis::try_new(8.0, 3).unwrap();
        let mut limits = [ChannelLimits::symmetric(0.3, 0.2, 0.15); 6];
        limits[1] = ChannelLimits { lower: -0.1, upper: 0.4, rate: f64::INFINITY, acceleration: 0.3 };
        limits[4] = ChannelLimits { upper: f64::INFINITY, ..ChannelLimits::symmetric(0.5, 0.4, f64::INFINITY) };
        let inertia = Matrix3::new(0.3, 0.02, -0.03, 0.02, 0.25, 0.01, -0.03, 0.01, 0.4);
        let body = InertialParameters::about_origin(7.0, Vector3::new(0.05, -0.02, 0.03), inertia);
        let normal = |seed: f64| Vector6::from_fn(|i, _| (seed + 1.7 * i as f64).sin());
        let half_spaces = vec![(normal(0.3), 0.9), (normal(2.0), 1.3)];
        SpaceExcitation::try_new(basis, &limits, 20)
            .unwrap()
            .with_wrench_limits(WrenchLimits::try_new(&body, half_spaces).unwrap())
    }

    #[test]
    fn changes_of_slacks_are_central_differences() {
        let problem = problem();
        let mut limits = Limits::new(&problem, 24);
        let numbers = limits.numbers();
        let at = DVector::from_fn(numbers, |i, _| 0.4 * (1.3 * i as f64).cos());
        let direction = DVector::from_fn(numbers, |i, _| (0.7 * i as f64).sin());
        let mut slacks = |step: f64| {
            let mut found = Vec::new();
            limits.slacks((&at + &direction * step).as_slice(), &mut found);
            found
        };
        let (before, after) = (slacks(-1e-5), slacks(1e-5));
        let mut changes = Vec::new();
        limits.linearize(at.as_slice());
        limits.changes(&direction, &mut changes);
        assert_eq!((changes.len(), before.len()), (limits.count(), limits.count()));
        // Gradients and products are of the same rows.
        let factors: Vec<f64> = (0..changes.len()).map(|i| (0.2 * i as f64).cos()).collect();
        let mut gradient = DVector::zeros(numbers);
        limits.add_gradients(&factors, false, &mut gradient);
        let mut products = DMatrix::zeros(numbers, numbers);
        limits.add_products(&factors, &mut products);
        products.fill_upper_triangle_with_lower_triangle();
        let (mut along, mut twice) = (0.0, 0.0);
        for (i, change) in changes.iter().enumerate() {
            let expected = (after[i] - before[i]) / 2e-5;
            if before[i] < 1e-3 * NO_LIMIT {
                assert!((change - expected).abs() < 1e-9, "{i}: {change} {expected}");
            }
            along += factors[i] * change;
            twice += factors[i] * change * change;
        }
        assert!((gradient.dot(&direction) - along).abs() < 1e-10 * along.abs().max(1.0));
        assert!((direction.dot(&(products * &direction)) - twice).abs() < 1e-10 * twice.abs().max(1.0));
    }

    #[test]
    fn logarithms_taken_together() {
        let before: Vec<f64> = (0..21).map(|i| 1.0 + f64::from(i)).collect();
        let after: Vec<f64> = before.iter().map(|x| x * x + 0.3).collect();
        let expected: f64 = before.iter().zip(&after).map(|(before, after)| (after / before).ln()).sum();
        assert!((log_growth(&before, &after) - expected).abs() < 1e-12);
    }

    /// A cost whose minimum is inside all limits is followed there, up to what the last barrier pushes it aside.
    #[test]
    fn goes_to_the_minimum_of_a_quadratic() {
        let problem = problem();
        let mut limits = Limits::new(&problem, 24);
        // A target well inside: reached; the gradient by free numbers vanishes there.
        let target: Vec<f64> = (0..limits.numbers()).map(|i| 0.05 * (1.0 + i as f64).sin()).collect();
        let mut free_target = vec![[0.0; 6]; limits.free()];
        limits.free_numbers(&target, &mut free_target);
        let quadratic = |free: &[Channels], gradient: &mut [Channels]| {
            let mut cost = 0.0;
            for ((free, target), gradient) in free.iter().zip(&free_target).zip(gradient) {
                for ((free, target), gradient) in free.iter().zip(target).zip(gradient) {
                    *gradient = free - target;
                    cost += 0.5 * *gradient * *gradient;
                }
            }
            Some(cost)
        };
        let start: Vec<f64> = target.iter().rev().map(|x| -0.9 * x).collect();
        let found = minimize(&mut limits, quadratic, &start, Effort::FINE).unwrap();
        let initial = {
            let (mut free, mut gradient) = (vec![[0.0; 6]; limits.free()], vec![[0.0; 6]; limits.free()]);
            limits.free_numbers(&start, &mut free);
            quadratic(&free, &mut gradient).unwrap()
        };
        assert!(found.cost < 1e-2 * initial, "{} {initial}", found.cost);
    }
}
