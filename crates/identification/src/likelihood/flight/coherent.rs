//! Errors of the wrench that move with the wrench itself.
//!
//! What thrusters are off by is made of the commands as the wrench is. It repeats with the motion, and the part of it that looks like another
//! body leaves no trace in what is left: gains of the wrench that are symmetric do, as those of thrusters mostly are. How large they may be
//! is taken from the parts that leave one: each gain may be as large as all of these together.

use super::fit::{Fit, solved};
use super::layout::{BODY, LOG_MASS};
use super::thrusters::AXES;
use crate::error::IdentificationError;
use nalgebra::{DMatrix, DVector, SMatrix, SVector, Vector3};

/// Share of the wrench below which its errors are of no consequence.
const NEGLIGIBLE: f64 = 1e-4;

/// Largest share of the wrench that its errors are where nobody says what it is made of: thrusts are hardly known better.
const USUAL: f64 = 0.01;
/// Shares are looked at over four decades, so many to a decade.
const PER_DECADE: i32 = 8;
const SHARES: i32 = 4 * PER_DECADE + 1;
/// A share counts as possible up to so much of minus twice the logarithm of the likelihood above the least.
const POSSIBLE: f64 = 4.0;

/// Root mean squares of torque and force along an axis that anything acts along.
struct Sizes {
    /// The wrench about its mean.
    wrench: [f64; 2],
    /// What of its errors is constant or linear in it.
    errors: [f64; 2],
    constant: SVector<f64, AXES>,
}

impl Sizes {
    fn of(fit: &Fit<'_>) -> Option<Self> {
        let errors: Vec<SVector<f64, AXES>> = fit.all_wrench_errors().map(SVector::from).collect();
        let wrenches: Vec<SVector<f64, AXES>> = (0..errors.len())
            .map(|j| {
                let rows = j * fit.samples..(j + 1) * fit.samples;
                let sum = |of: &[Vector3<f64>]| of.get(rows.clone()).unwrap_or_default().iter().sum::<Vector3<f64>>();
                let (torque, force) = (sum(&fit.grid.torque), sum(&fit.grid.force));
                SVector::<f64, AXES>::from_iterator(torque.iter().chain(force.iter()).copied()) / fit.samples as f64
            })
            .collect();
        let mean = |of: &[SVector<f64, AXES>]| of.iter().sum::<SVector<f64, AXES>>() / of.len() as f64;
        let (constant, middle) = (mean(&errors), mean(&wrenches));
        let (mut square, mut cross) = (SMatrix::<f64, AXES, AXES>::zeros(), SMatrix::<f64, AXES, AXES>::zeros());
        for (error, wrench) in errors.iter().zip(&wrenches) {
            let about = wrench - middle;
            square += about * about.transpose();
            cross += about * (error - constant).transpose();
        }
        let count = errors.len() as f64;
        let acting: Vec<usize> = (0..AXES).filter(|axis| square[(*axis, *axis)] > 0.0).collect();
        let n = acting.len();
        let scatter = DMatrix::from_fn(n, n, |i, j| square[(acting[i], acting[j])] / count);
        let beside = DMatrix::from_fn(n, AXES, |i, j| cross[(acting[i], j)] / count);
        let gains = solved(&scatter, &beside)?;
        let explained = gains.transpose() * &beside;
        let rms = |part: usize, of: &dyn Fn(usize) -> f64| {
            let axes: Vec<usize> = acting.iter().copied().filter(|axis| axis / 3 == part).collect();
            (axes.iter().map(|axis| of(*axis).max(0.0)).sum::<f64>() / axes.len().max(1) as f64).sqrt()
        };
        Some(Self {
            wrench: core::array::from_fn(|part| rms(part, &|axis| square[(axis, axis)] / count)),
            errors: core::array::from_fn(|part| rms(part, &|axis| explained[(axis, axis)] + constant[axis].powi(2))),
            constant,
        })
    }
}

/// The largest share that gains may be of without contradicting the record, from what it says of them with all else unknown, by a share of one:
/// information and gradient.
fn possible_share(information: &DMatrix<f64>, gradient: &DVector<f64>) -> f64 {
    let eigen = ((information + information.transpose()) * 0.5).symmetric_eigen();
    let along = eigen.eigenvectors.transpose() * gradient;
    // Minus twice the logarithm of the likelihood of normal gains of this share, against that of none.
    let cost = |share: f64| {
        let square = share * share;
        let terms = eigen.eigenvalues.iter().zip(along.iter()).map(|(value, along)| {
            let seen = square * value.max(0.0);
            seen.ln_1p() - square * along * along / (1.0 + seen)
        });
        terms.sum::<f64>()
    };
    let shares: Vec<f64> =
        (0..SHARES).map(|step| USUAL * 10.0_f64.powf(-f64::from(step) / f64::from(PER_DECADE))).collect();
    let least = shares.iter().map(|share| cost(*share)).fold(0.0, f64::min);
    shares.into_iter().find(|share| cost(*share) < least + POSSIBLE).unwrap_or(0.0)
}

/// Information and, in one more column, its gradient, without so many parameters in front, of which nothing is known beside.
fn without_first(said: &DMatrix<f64>, gone: usize) -> Option<DMatrix<f64>> {
    let left = said.nrows() - gone;
    if gone == 0 {
        return Some(said.clone());
    }
    let across = said.view((0, gone), (gone, left + 1));
    let taken = solved(&said.view((0, 0), (gone, gone)).into_owned(), &across.into_owned())?;
    Some(said.view((gone, gone), (left, left + 1)) - across.columns(0, left).transpose() * taken)
}

/// Takes from the information of the body what gains of the wrench leave of it, where they may be as large as the errors that show, or as those
/// that would not; what that adds to the covariance.
pub(super) fn widen(fit: &Fit<'_>, of_body: &mut DMatrix<f64>) -> Result<Option<DMatrix<f64>>, IdentificationError> {
    let Some(Sizes { wrench, mut errors, constant }) = Sizes::of(fit) else { return Ok(None) };
    let body = fit.coordinates();
    let sizes = body.sizes();
    // A thruster makes force as well as torque, also where only the torque is seen well enough.
    errors[1] = errors[1].max(errors[0] / sizes[LOG_MASS + 1]).min(wrench[1]);
    let share = |part: usize| if wrench[part] > 0.0 { errors[part] / wrench[part] } else { 0.0 };
    let shown = share(0).max(share(1));
    let is_told = fit.of.thrusters.is_some() || fit.of.wrench_noise.is_some();
    if is_told && shown < NEGLIGIBLE {
        return Ok(None);
    }
    let (said, free) = fit.with_gains()?;
    let first = fit.layout.slope();
    let gains = first..first + AXES * (AXES + 1);
    let place = |keep: &dyn Fn(usize) -> bool| -> Vec<usize> { (0..free.len()).filter(|i| keep(free[*i])).collect() };
    let of_body_at = place(&|column| column < BODY);
    let gain_at = place(&|column| gains.contains(&column));
    let rest_at = place(&|column| column >= BODY && !gains.contains(&column));
    let order: Vec<usize> = rest_at.iter().chain(&of_body_at).chain(&gain_at).copied().collect();
    let ordered = DMatrix::from_fn(order.len(), order.len() + 1, |i, j| {
        said[(order[i], order.get(j).map_or(free.len(), |j| *j))]
    });
    let refused = || IdentificationError::Indefinite { parameters: free.len() };
    let (n, k) = (of_body_at.len(), gain_at.len());
    let body_and_gains = without_first(&ordered, rest_at.len()).ok_or_else(refused)?;
    // Of the body only what the record says anything of is known: as much is added as bodies differ by at most.
    let floor = |i: usize| 1e-6 / sizes[free[of_body_at[i]]].powi(2);
    // Of a gain, or the constant: standard deviation by the errors that show, and by a share of one.
    let deviations = |gain: usize| {
        let (from, to) = ((free[gain_at[gain]] - first) / AXES, (free[gain_at[gain]] - first) % AXES / 3);
        match from {
            AXES => (constant[(free[gain_at[gain]] - first) % AXES].abs(), wrench[to]),
            from if wrench[from / 3] > 0.0 => (errors[to] / wrench[from / 3], wrench[to] / wrench[from / 3]),
            _ => (0.0, 0.0),
        }
    };
    let possible = if is_told {
        0.0
    } else {
        let mut floored = body_and_gains.clone();
        (0..n).for_each(|i| floored[(i, i)] += floor(i));
        let of_gains = without_first(&floored, n).ok_or_else(refused)?;
        let by = |gain: usize| deviations(gain).1;
        possible_share(
            &DMatrix::from_fn(k, k, |i, j| of_gains[(i, j)] * by(i) * by(j)),
            &DVector::from_fn(k, |i, _| of_gains[(i, k)] * by(i)),
        )
    };
    if possible.max(shown) < NEGLIGIBLE {
        return Ok(None);
    }
    let scaled = DMatrix::from_fn(n, k, |i, j| {
        let (shown, usual) = deviations(j);
        body_and_gains[(i, n + j)] * shown.max(possible * usual)
    });
    let floored = DMatrix::from_fn(n, n, |i, j| of_body[(i, j)] + if i == j { floor(i) } else { 0.0 });
    let known = solved(&floored, &scaled).ok_or_else(refused)?;
    let inner = DMatrix::identity(k, k) + scaled.transpose() * &known;
    let taken = solved(&inner, &scaled.transpose()).ok_or_else(refused)?;
    let left = &*of_body - &scaled * taken;
    *of_body = (&left + left.transpose()) * 0.5;
    Ok(Some(&known * known.transpose()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_as_large_as_what_is_seen_of_it_allows() {
        let share = |seen: f64, along: f64| {
            let information = DMatrix::from_diagonal(&DVector::from_vec(vec![seen; 6]));
            possible_share(&information, &DVector::from_vec(vec![along; 6]))
        };
        // Nothing leaves a trace: as large as is usual.
        assert!((share(0.0, 0.0) / USUAL - 1.0).abs() < 1e-12);
        // Traces of a hundred thousandth would show, and none does.
        assert!(share(1e10, 0.0) < 1.5e-5);
        // Traces of two parts in a thousand do show.
        let found = share(1e10, 1e10 * 2e-3);
        assert!((1e-3..USUAL).contains(&found), "{found}");
    }
}
