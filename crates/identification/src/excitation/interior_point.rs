//! A primal-dual interior-point method that never leaves the limits.
//!
//! Slacks are computed, not carried: every iterate is strictly feasible, so stopping early costs optimality only. The
//! barrier's part of the Hessian is exact; the rest, the Lagrangian's, is a damped BFGS approximation.

use super::limit_samples::Limits;
use super::objective::Channels;
use nalgebra::{DMatrix, DVector};

/// Factor from one barrier to the next.
const BARRIER_STEP: f64 = 0.2;
/// Squared Newton step, in units of the barrier and of the root of the number of limits, at which it is time for the next.
const CENTERED: f64 = 0.2;
/// Share of the way to the nearest limit that a step may go.
const TO_THE_LIMIT: f64 = 0.99;

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
    pub const FINE: Self = Self { first: 0.2, last: 1e-4, iterations: 300 };
}

/// Goes down from a strictly feasible start. `None` where the cost does not exist there.
pub(super) fn minimize(
    limits: &mut Limits<'_>,
    mut cost_and_gradient: impl FnMut(&[Channels], &mut [Channels]) -> Option<f64>,
    start: &[f64],
    effort: Effort,
) -> Option<Minimum> {
    let numbers = limits.numbers();
    let mut by_free = vec![[0.0; 6]; limits.free()];
    let mut free = vec![[0.0; 6]; limits.free()];
    let mut evaluate = |limits: &Limits<'_>, scaled: &[f64], gradient: &mut DVector<f64>| -> Option<f64> {
        limits.free_numbers(scaled, &mut free);
        let cost = cost_and_gradient(&free, &mut by_free)?;
        gradient.fill(0.0);
        limits.add_scaled_gradient(&by_free, gradient.as_mut_slice());
        Some(cost).filter(|cost| cost.is_finite() && gradient.iter().all(|g| g.is_finite()))
    };
    let mut z = DVector::from_column_slice(start);
    let (mut slacks, mut trial_slacks, mut changes) = (Vec::new(), Vec::new(), Vec::new());
    if !limits.slacks(z.as_slice(), &mut slacks) {
        return None;
    }
    limits.linearize();
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
        limits.changes(direction.as_slice(), &mut changes);
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
        if limits.are_curved() {
            limits.add_gradients(&multipliers, true, &mut difference);
            limits.linearize();
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
    use crate::excitation::limit_samples::tests::problem;

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
