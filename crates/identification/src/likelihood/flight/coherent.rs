//! Errors of the wrench that move with the wrench itself.
//!
//! What thrusters are off by is made of the commands as the wrench is. It repeats with the motion, and the part of it that looks like another
//! body leaves no trace in what is left: gains of the wrench that are symmetric do, as those of thrusters mostly are. How large they may be
//! is taken from the parts that leave one: each gain may be as large as all of these together.

use super::fit::{Fit, solved};
use super::layout::{BODY, LOG_MASS};
use super::outcome::sizes;
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
        let errors: Vec<SVector<f64, AXES>> = fit.wrench_errors().map(SVector::from).collect();
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

/// Takes from the information of the body what gains of the wrench leave of it, where they may be as large as the errors that show; what that
/// adds to the covariance.
pub(super) fn widen(fit: &Fit<'_>, of_body: &mut DMatrix<f64>) -> Result<Option<DMatrix<f64>>, IdentificationError> {
    let Some(Sizes { wrench, mut errors, constant }) = Sizes::of(fit) else { return Ok(None) };
    let body = fit.coordinates();
    let length = sizes(&body)[LOG_MASS + 1];
    // A thruster makes force as well as torque, also where only the torque is seen well enough.
    errors[1] = errors[1].max(errors[0] / length).min(wrench[1]);
    let share = |part: usize| if wrench[part] > 0.0 { errors[part] / wrench[part] } else { 0.0 };
    let is_told = fit.of.thrusters.is_some() || fit.of.wrench_noise.is_some();
    if is_told && share(0).max(share(1)) < NEGLIGIBLE {
        return Ok(None);
    }
    let (information, gradient, free) = fit.with_gains()?;
    let gains = fit.layout.slope();
    let last = gains + AXES * (AXES + 1);
    let place = |keep: &dyn Fn(usize) -> bool| -> Vec<usize> { (0..free.len()).filter(|i| keep(free[*i])).collect() };
    let of_body_at = place(&|column| column < BODY);
    let gain_at = place(&|column| (gains..last).contains(&column));
    let rest_at = place(&|column| column >= BODY && !(gains..last).contains(&column));
    let block = |rows: &[usize], columns: &[usize]| {
        DMatrix::from_fn(rows.len(), columns.len(), |i, j| information[(rows[i], columns[j])])
    };
    let (rest, across) = (block(&rest_at, &rest_at), block(&rest_at, &gain_at));
    let refused = || IdentificationError::Indefinite { parameters: free.len() };
    let sizes = sizes(&body);
    // By a share of one.
    let usual = |column: usize| {
        let (from, to) = ((column - gains) / AXES, (column - gains) % AXES);
        match from {
            AXES => wrench[to / 3],
            from if wrench[from / 3] > 0.0 => wrench[to / 3] / wrench[from / 3],
            _ => 0.0,
        }
    };
    let possible = if is_told {
        0.0
    } else {
        let others: Vec<usize> = of_body_at.iter().chain(&rest_at).copied().collect();
        let n = others.len();
        let joint = DMatrix::from_fn(n, n, |i, j| {
            let (a, b) = (others[i], others[j]);
            let floor = if i == j && free[a] < BODY { 1e-6 / sizes[free[a]].powi(2) } else { 0.0 };
            information[(a, b)] + floor
        });
        let across = DMatrix::from_fn(n, gain_at.len() + 1, |i, j| match gain_at.get(j) {
            Some(gain) => information[(others[i], *gain)] * usual(free[*gain]),
            None => gradient[others[i]],
        });
        let gone = solved(&joint, &across).ok_or_else(refused)?;
        let scaled = DMatrix::from_fn(gain_at.len(), gain_at.len() + 1, |i, j| {
            let by = usual(free[gain_at[i]]);
            match gain_at.get(j) {
                Some(gain) => information[(gain_at[i], *gain)] * by * usual(free[*gain]),
                None => gradient[gain_at[i]] * by,
            }
        }) - across.columns(0, gain_at.len()).transpose() * gone;
        let k = gain_at.len();
        possible_share(&scaled.columns(0, k).into_owned(), &scaled.column(k).into_owned())
    };
    if possible.max(share(0)).max(share(1)) < NEGLIGIBLE {
        return Ok(None);
    }
    let cross = if rest_at.is_empty() {
        block(&of_body_at, &gain_at)
    } else {
        block(&of_body_at, &gain_at) - block(&of_body_at, &rest_at) * solved(&rest, &across).ok_or_else(refused)?
    };
    let seen = |column: usize| {
        let (from, to) = ((column - gains) / AXES, (column - gains) % AXES);
        match from {
            AXES => constant[to].abs(),
            from if wrench[from / 3] > 0.0 => errors[to / 3] / wrench[from / 3],
            _ => 0.0,
        }
    };
    let deviation = |column: usize| seen(column).max(possible * usual(column));
    let scaled = DMatrix::from_fn(cross.nrows(), cross.ncols(), |i, j| cross[(i, j)] * deviation(free[gain_at[j]]));
    // Of the body only what the record says anything of is known: as much is added as bodies differ by at most.
    let n = of_body_at.len();
    let floored = DMatrix::from_fn(n, n, |i, j| {
        of_body[(i, j)] + if i == j { 1e-6 / sizes[free[of_body_at[i]]].powi(2) } else { 0.0 }
    });
    let known = solved(&floored, &scaled).ok_or_else(refused)?;
    let inner = DMatrix::identity(gain_at.len(), gain_at.len()) + scaled.transpose() * &known;
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
