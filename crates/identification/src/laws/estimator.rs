//! Laws of estimators of a whole record.

use super::broken_unless;
use super::recursive_estimator::{Short, violation};
use crate::estimator::{Estimator, EstimatorError, Finding};
use nalgebra::{SMatrix, SVector};
use tumble_lie::laws::{LawViolation, require};

/// Makes an estimator for a record: its problem, scale and noise are those of that record.
pub type Make<'a, R, const P: usize> =
    &'a dyn Fn(&R) -> Result<Box<dyn Estimator<P, Record = R> + Send + Sync>, EstimatorError>;

/// The same motion told otherwise: from another frame, in other units.
pub struct Retold<'a, R: ?Sized, const P: usize> {
    /// What must not matter: "the frame", "the unit of mass".
    pub what: &'static str,
    /// The record told so.
    pub record: &'a R,
    /// From the parameters of the one to those of the other.
    pub map: SMatrix<f64, P, P>,
    /// Largest difference that is still rounding, in standard deviations.
    pub tolerance: f64,
}

/// What is known of a record.
pub struct Case<'a, R: ?Sized, const P: usize> {
    /// A record with noise that determines everything.
    pub record: &'a R,
    /// It cut in two that share nothing; none where a part of a record is none.
    pub halves: Option<[&'a R; 2]>,
    /// The same motion without noise, and the largest error on it in units of the truth's magnitudes.
    pub exact: Option<(&'a R, f64)>,
    /// The parameters behind all of them.
    pub truth: SVector<f64, P>,
    /// Their sizes.
    pub magnitudes: SVector<f64, P>,
    /// Deviations from the truth that are still chance, in standard deviations of each parameter.
    pub sigmas: f64,
    /// The record told otherwise.
    pub retold: &'a [Retold<'a, R, P>],
}

/// Laws of an [`Estimator`].
///
/// # Errors
/// The first broken law: `a good record is answered`, `same record, same finding`, `the truth is inside the stated sigmas`,
/// `exact data give the truth`, `frames and units do not matter`, `halves together know no more than the whole`,
/// `halves together say what the whole says`.
pub fn check_estimator<R: ?Sized, const P: usize>(
    make: Make<'_, R, P>,
    case: &Case<'_, R, P>,
) -> Result<(), LawViolation> {
    let whole = answered(make, case.record, "the whole")?;
    let again = answered(make, case.record, "the whole")?;
    let same = broken_unless(whole.0 == again.0);
    require("same record, same finding", &"the whole", &Short(&whole.1), &Short(&again.1), same, 0.0)?;
    let (_, point, known) = whole;
    let deviation = known.diagonal().map(f64::sqrt);
    let apart = (point - case.truth).component_div(&deviation).amax();
    let law = "the truth is inside the stated sigmas";
    require(law, &"worst of all, in sigmas", &Short(&case.truth), &Short(&point), apart, case.sigmas)?;
    if let Some((record, tolerance)) = case.exact {
        let found = answered(make, record, "exact data")?.1;
        let error = (found - case.truth).component_div(&case.magnitudes).amax();
        require("exact data give the truth", &"exact data", &Short(&case.truth), &Short(&found), error, tolerance)?;
    }
    for told in case.retold {
        let found = answered(make, told.record, told.what)?;
        let expected = told.map * point;
        let expected_deviation = (told.map * known * told.map.transpose()).diagonal().map(f64::sqrt);
        let apart = (found.1 - expected).component_div(&expected_deviation).amax();
        let law = "frames and units do not matter";
        require(law, &told.what, &Short(&expected), &Short(&found.1), apart, told.tolerance)?;
        let ratio =
            found.2.diagonal().map(f64::sqrt).component_div(&expected_deviation).map(|r| (r - 1.0).abs()).amax();
        let said = found.2.diagonal().map(f64::sqrt);
        require(
            law,
            &(told.what, "sigmas"),
            &Short(&expected_deviation),
            &Short(&said),
            ratio,
            told.tolerance.max(0.01),
        )?;
    }
    let Some(halves) = case.halves else { return Ok(()) };
    let [first, second] = halves.map(|half| answered(make, half, "a half"));
    let merged = first?.0.merge(&second?.0).map_err(|error| violation(ANSWERED, "halves".to_owned(), &error))?;
    let (_, there, together) = determined(merged, "halves together")?;
    let law = "halves together know no more than the whole";
    let gain = known.diagonal().component_div(&together.diagonal()).amax();
    let (one, other) = (deviation, together.diagonal().map(f64::sqrt));
    require(law, &"variances", &Short(&one), &Short(&other), gain, MUCH_MORE)?;
    let joint = (known.diagonal() + together.diagonal()).map(f64::sqrt);
    let apart = (point - there).component_div(&joint).amax();
    let law = "halves together say what the whole says";
    require(law, &"worst of all, in sigmas", &Short(&point), &Short(&there), apart, case.sigmas)
}

/// Ratio of variances above which halves claim what the whole does not know.
const MUCH_MORE: f64 = 1.0 / 0.6;
pub(super) const ANSWERED: &str = "a good record is answered";

/// Whether stated covariances hold: the mean of squared normalised errors over `runs` records and `P` parameters lies in `band`.
///
/// # Errors
/// `a good record is answered`, `errors are as large as stated`.
pub fn check_coverage<R: ?Sized, const P: usize>(
    make: Make<'_, R, P>,
    runs: &mut dyn Iterator<Item = (Box<R>, SVector<f64, P>)>,
    band: (f64, f64),
) -> Result<(), LawViolation> {
    let (mut sum, mut count) = (0.0, 0.0);
    for (record, truth) in runs {
        let (_, point, covariance) = answered(make, &record, "a run")?;
        let unit = covariance.diagonal().map(f64::sqrt);
        let correlation = SMatrix::<f64, P, P>::from_fn(|i, j| covariance[(i, j)] / (unit[i] * unit[j]));
        let error = (point - truth).component_div(&unit);
        sum += correlation.cholesky().map_or(f64::INFINITY, |factor| error.dot(&factor.solve(&error)));
        count += P as f64;
    }
    let mean = sum / count;
    let outside = broken_unless(band.0 <= mean && mean <= band.1);
    require("errors are as large as stated", &(count, "squared errors"), &band, &mean, outside, 0.0)
}

/// A finding, its point and its covariance.
type Known<const P: usize> = (Finding<P>, SVector<f64, P>, SMatrix<f64, P, P>);

fn answered<R: ?Sized, const P: usize>(make: Make<'_, R, P>, record: &R, of: &str) -> Result<Known<P>, LawViolation> {
    let found = make(record).and_then(|estimator| estimator.estimate(record));
    determined(found.map_err(|error| violation(ANSWERED, of.to_owned(), &error))?, of)
}

fn determined<const P: usize>(found: Finding<P>, of: &str) -> Result<Known<P>, LawViolation> {
    let covariance = found.covariance().map_err(|error| violation(ANSWERED, of.to_owned(), &error))?;
    let point = found.point().copied().ok_or_else(|| violation(ANSWERED, of.to_owned(), &"no point"))?;
    Ok((found, point, covariance))
}
