//! What a filter of the rate that nobody describes does beyond its delay and the bend of its answer.
//!
//! Of such a filter the delay and the second moment of its answer are estimated. What is left of its gain is of the fourth order in frequency; it
//! makes every moment of inertia larger or smaller by the same share, and no row shows it.

use super::fit::Fit;
use super::layout::BODY;
use nalgebra::{DMatrix, DVector, Vector3};

/// The share by which moments of inertia may be off, over the square of that by which the second moment corrects the rate. Of a simulated robot that is held
/// in its place, whose rates are averaged over 16 ms and filtered to a quarter of a second, they are too large by 0.8 of that (eight flights, 0.6 to 1.2).
const BEYOND: f64 = 3.0;
/// Less than this share of a variance is neglected.
const NEGLIGIBLE: f64 = 0.01;

/// Takes from the information of the body what such a filter leaves of it, and adds it to what widens the covariance.
pub(super) fn widen(
    fit: &Fit<'_>,
    covariance: &DMatrix<f64>,
    of_body: &mut DMatrix<f64>,
    widened: Option<DMatrix<f64>>,
) -> Option<DMatrix<f64>> {
    let Some(share) = share(fit, covariance) else { return widened };
    let j = fit.coordinates().inertia;
    let inertia = [j.m11, j.m12, j.m13, j.m22, j.m23, j.m33];
    let of = |column: usize| column.checked_sub(BODY - inertia.len()).and_then(|place| inertia.get(place));
    let body = fit.free.iter().copied().filter(|column| *column < BODY);
    let off: Vec<f64> = body.map(|column| of(column).map_or(0.0, |moment| share * moment)).collect();
    let off = DVector::from_vec(off);
    let along = &*of_body * &off;
    let known = off.dot(&along);
    if known.is_nan() || known < NEGLIGIBLE {
        return widened;
    }
    *of_body -= &along * along.transpose() / (1.0 + known);
    let added = &off * off.transpose();
    Some(widened.map_or(added.clone(), |widened| widened + added))
}

/// By how much moments of inertia may be off; none where no filter is searched for.
fn share(fit: &Fit<'_>, covariance: &DMatrix<f64>) -> Option<f64> {
    let column = fit.column_of(fit.layout.spread())?;
    let moment_s2 = fit.eta[fit.layout.spread()].powi(2) + covariance[(column, column)].max(0.0);
    let (rates, reach) = (fit.published_rates(), (fit.samples / 2).max(1));
    let mean = rates.iter().sum::<Vector3<f64>>() / rates.len().max(1) as f64;
    let (mut bent, mut moved) = (0.0, 0.0);
    for k in reach..rates.len().saturating_sub(reach) {
        let half_s = 0.5 * (fit.grid.times[k + reach] - fit.grid.times[k - reach]);
        bent += ((rates[k + reach] - rates[k] * 2.0 + rates[k - reach]) / (half_s * half_s)).norm_squared();
        moved += (rates[k] - mean).norm_squared();
    }
    (moved > 0.0).then(|| BEYOND * moment_s2 * bent / moved)
}
