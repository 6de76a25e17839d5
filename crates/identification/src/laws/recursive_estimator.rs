//! Laws of recursive estimators and of the gates in front of them.

use super::broken_unless;
use crate::consistency::FeasibleSet;
use crate::error::IdentificationError;
use crate::estimator::{EstimatorError, Finding, RecursiveEstimator};
use crate::recursive::{Innovation, RowsOutcome, Verdict};
use nalgebra::{SMatrix, SVector};
use tumble_lie::laws::{LawViolation, require};

/// Begins an estimator: laws try several, and none need be `Clone`.
pub type Begin<'a, E> = &'a dyn Fn() -> Result<E, EstimatorError>;

/// What an estimator promises beyond what all must hold.
#[derive(Clone, Copy)]
pub struct EstimatorPromises<'a, const P: usize> {
    /// The parameters do not drift: an observation never makes anything less certain.
    pub constant_parameters: bool,
    /// The model is linear: parameters and covariance that all observations together give, in any order.
    pub batch: Option<(SVector<f64, P>, SMatrix<f64, P, P>)>,
    /// Every reported estimate lies strictly inside.
    pub feasible_set: Option<&'a dyn FeasibleSet<P>>,
}

/// Laws of a [`RecursiveEstimator`] without a gate, tried by feeding `observations` to what `begin` begins.
///
/// `tolerance` is relative: to standard deviations before each update, and to the batch.
///
/// # Errors
/// The first broken law: `there is a finding at any time`, `a finding of nothing holds no data`, `update succeeds`,
/// `data never add uncertainty`, `estimate is inside the feasible set`, `same observations give the same finding`,
/// `equals batch`, `order independent`.
pub fn check_recursive_estimator<E, const P: usize>(
    begin: Begin<'_, E>,
    observations: &[&E::Observation],
    promises: &EstimatorPromises<'_, P>,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    E: RecursiveEstimator<P>,
{
    let mut estimator = begun(begin)?;
    let start = found(&estimator, 0)?;
    let nothing = start.0.data().map_or(f64::INFINITY, |data| data.scaled_factor(start.0.magnitudes()).amax());
    require("a finding of nothing holds no data", &"no observation", &0.0, &nothing, nothing, tolerance.sqrt())?;
    inside(promises, &start.1, 0)?;
    let mut before = start.2;
    for (index, observation) in observations.iter().enumerate() {
        succeeded(estimator.update(observation), index)?;
        let (_, point, after) = found(&estimator, index + 1)?;
        if promises.constant_parameters {
            let shrunk = in_deviations(&(before - after), &before);
            let growth = -smallest_eigenvalue(&shrunk);
            require("data never add uncertainty", &index, &Short(&before), &Short(&after), growth, tolerance)?;
        }
        inside(promises, &point, index + 1)?;
        before = after;
    }
    let (all, again) = (found(&estimator, observations.len())?, fed(begin, observations.iter())?);
    let (law, same) = ("same observations give the same finding", all.0 == again.0);
    require(law, &"all", &Short(&all.1), &Short(&again.1), broken_unless(same), 0.0)?;
    if let Some((parameters, covariance)) = &promises.batch {
        let compare = |law, found: &Found<P>, tolerance: f64| {
            let size = parameters.amax().max(f64::MIN_POSITIVE);
            let error = (found.1 - parameters).amax() / size;
            require(law, &"parameters", &Short(parameters), &Short(&found.1), error, tolerance)?;
            let error = in_deviations(&(found.2 - covariance), covariance).amax();
            require(law, &"covariance", &Short(covariance), &Short(&found.2), error, tolerance)
        };
        compare("equals batch", &all, tolerance)?;
        compare("order independent", &fed(begin, observations.iter().rev())?, 2.0 * tolerance)?;
    }
    Ok(())
}

/// Laws of the matrices that a concrete filter says with every update: `update` is its `update_rows`.
///
/// # Errors
/// The first broken law: `update succeeds`, `innovation covariance is symmetric positive definite`,
/// `nis is the normalised innovation`, `degrees of freedom are the measured rows`,
/// `determinant is that of the innovation covariance`.
pub fn check_innovation<O, const ROWS: usize>(
    update: &mut dyn FnMut(&O) -> Result<RowsOutcome<ROWS>, IdentificationError>,
    observations: &[O],
    tolerance: f64,
) -> Result<(), LawViolation> {
    for (index, observation) in observations.iter().enumerate() {
        let outcome = succeeded(update(observation).map_err(EstimatorError::from), index)?;
        check_one(&outcome.innovation, index, tolerance)?;
    }
    Ok(())
}

/// Laws of the gate of an estimator, in front of which observations of the model come and then others.
///
/// `runs` starts the estimator of a run at the truth and gives the observations of its model; all runs together must reject
/// `1 - probability` of them, give or take `band`. `spoiled` are observations that the end of the first run must find beyond
/// belief, long enough for it to give in. A rejection leaves the parameters; a filter may predict its covariance on.
///
/// # Errors
/// The first broken law: `update succeeds`, `gate rejects as often as stated`, `a rejected update changes nothing`,
/// `gate lets go of a wrong belief`.
pub fn check_gate<E, const P: usize>(
    runs: &mut dyn Iterator<Item = (E, Vec<E::Observation>)>,
    probability: f64,
    band: f64,
    spoiled: &[E::Observation],
) -> Result<(), LawViolation>
where
    E: RecursiveEstimator<P>,
    E::Observation: Sized,
{
    let (mut rejected, mut total, mut first) = (0_usize, 0_usize, None);
    for (mut estimator, observations) in runs {
        for (index, observation) in observations.iter().enumerate() {
            let outcome = succeeded(estimator.update(observation), index)?;
            rejected += usize::from(!outcome.is_accepted());
            total += 1;
        }
        first.get_or_insert(estimator);
    }
    let (share, expected) = (rejected as f64 / total as f64, 1.0 - probability);
    require("gate rejects as often as stated", &total, &expected, &share, (share - expected).abs(), band)?;
    let Some(mut estimator) = first else { return Ok(()) };
    let mut recovered = false;
    for (index, observation) in spoiled.iter().enumerate() {
        let before = found(&estimator, index)?.1;
        match succeeded(estimator.update(observation), index)?.gate {
            Verdict::Rejected { .. } => {
                let after = found(&estimator, index + 1)?.1;
                let law = "a rejected update changes nothing";
                require(law, &index, &Short(&before), &Short(&after), broken_unless(after == before), 0.0)?;
            }
            Verdict::Recovered { .. } => recovered = true,
            Verdict::Accepted => {}
        }
    }
    let rule = "an acceptance after rejections in a row";
    require("gate lets go of a wrong belief", &spoiled.len(), &rule, &recovered, broken_unless(recovered), 0.0)
}

/// The same problem in other units: an estimator with what it is told.
pub struct Told<'a, E: RecursiveEstimator<P>, const P: usize> {
    /// Begins the estimator.
    pub begin: Begin<'a, E>,
    /// In the order of time.
    pub observations: &'a [&'a E::Observation],
}

/// The same problem in other units: `factors` turn the parameters of `told` into those of `scaled`.
///
/// # Errors
/// The first broken law: `update succeeds`, `nis is free of units`, `the estimate scales with the units`.
pub fn check_unit_equivariance<E, const P: usize>(
    told: &Told<'_, E, P>,
    scaled: &Told<'_, E, P>,
    factors: &SVector<f64, P>,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    E: RecursiveEstimator<P>,
{
    let (mut one, mut other) = (begun(told.begin)?, begun(scaled.begin)?);
    for (index, (a, b)) in told.observations.iter().zip(scaled.observations).enumerate() {
        let a = succeeded(one.update(a), index)?.nis;
        let b = succeeded(other.update(b), index)?.nis;
        require("nis is free of units", &index, &a, &b, (a - b).abs(), tolerance * (1.0 + a))?;
        let (one, other) = (found(&one, index + 1)?.1, found(&other, index + 1)?.1);
        let expected = one.component_mul(factors);
        let error = (other - expected).component_div(factors).amax();
        let law = "the estimate scales with the units";
        require(law, &index, &Short(&expected), &Short(&other), error, tolerance * one.amax())?;
    }
    Ok(())
}

/// A finding, its point and its covariance.
type Found<const P: usize> = (Finding<P>, SVector<f64, P>, SMatrix<f64, P, P>);

fn found<E: RecursiveEstimator<P>, const P: usize>(estimator: &E, updates: usize) -> Result<Found<P>, LawViolation> {
    let law = "there is a finding at any time";
    let missing = |error: &dyn std::fmt::Display| violation(law, format!("after {updates} observations"), error);
    let finding = estimator.finding().map_err(|error| missing(&error))?;
    let covariance = finding.covariance().map_err(|error| missing(&error))?;
    let point = finding.point().copied().ok_or_else(|| missing(&"no point"))?;
    Ok((finding, point, covariance))
}

fn begun<E>(begin: Begin<'_, E>) -> Result<E, LawViolation> {
    begin().map_err(|error| violation("there is a finding at any time", "before any observation".to_owned(), &error))
}

pub(super) fn violation(law: &'static str, inputs: String, found: &dyn std::fmt::Display) -> LawViolation {
    LawViolation {
        law,
        inputs,
        expected: "an answer".to_owned(),
        found: found.to_string(),
        error: f64::NAN,
        tolerance: 0.0,
    }
}

/// Matrices in messages: one line.
pub(super) struct Short<'a, const R: usize, const C: usize>(pub(super) &'a SMatrix<f64, R, C>);

impl<const R: usize, const C: usize> std::fmt::Debug for Short<'_, R, C> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Of a square matrix the diagonal says most.
        let diagonal = R == C && R > 1;
        let count = if diagonal { R } else { R * C };
        let entry = |i: usize| if diagonal { self.0[(i, i)] } else { self.0.as_slice()[i] };
        f.write_str(if diagonal { "diagonal [" } else { "[" })?;
        for i in 0..count.min(10) {
            write!(f, "{}{:.4e}", if i > 0 { ", " } else { "" }, entry(i))?;
        }
        f.write_str("]")
    }
}

fn inside<const P: usize>(
    promises: &EstimatorPromises<'_, P>,
    parameters: &SVector<f64, P>,
    updates: usize,
) -> Result<(), LawViolation> {
    let Some(set) = promises.feasible_set else { return Ok(()) };
    let margin = set.margin(parameters);
    let law = "estimate is inside the feasible set";
    require(law, &(updates, Short(parameters)), &"a positive margin", &margin, broken_unless(margin > 0.0), 0.0)
}

fn succeeded<T>(outcome: Result<T, EstimatorError>, index: usize) -> Result<T, LawViolation> {
    outcome.map_err(|error| violation("update succeeds", format!("observation {index}"), &error))
}

fn fed<'a, E, const P: usize>(
    begin: Begin<'_, E>,
    observations: impl Iterator<Item = &'a &'a E::Observation>,
) -> Result<Found<P>, LawViolation>
where
    E: RecursiveEstimator<P>,
    E::Observation: 'a,
{
    let mut estimator = begun(begin)?;
    let mut updates = 0;
    for (index, observation) in observations.enumerate() {
        succeeded(estimator.update(observation), index)?;
        updates += 1;
    }
    found(&estimator, updates)
}

fn check_one<const ROWS: usize>(
    innovation: &Innovation<ROWS>,
    index: usize,
    tolerance: f64,
) -> Result<(), LawViolation> {
    // Rows that were not measured stand aside: a unit in their place.
    let measured: Vec<usize> = (0..ROWS).filter(|&i| innovation.covariance[(i, i)].is_finite()).collect();
    let s = nalgebra::DMatrix::from_fn(measured.len(), measured.len(), |i, j| {
        innovation.covariance[(measured[i], measured[j])]
    });
    let residual = nalgebra::DVector::from_fn(measured.len(), |i, _| innovation.residual[measured[i]]);
    let law = "innovation covariance is symmetric positive definite";
    let symmetric = (&s - s.transpose()).amax() <= tolerance * s.amax();
    let deviations = s.diagonal().map(f64::sqrt);
    let correlation =
        nalgebra::DMatrix::from_fn(s.nrows(), s.ncols(), |i, j| s[(i, j)] / (deviations[i] * deviations[j]));
    let Some(cholesky) = correlation.cholesky().filter(|_| symmetric) else {
        let diagonal = s.diagonal().iter().copied().collect::<Vec<f64>>();
        return require(law, &index, &"symmetric, > 0", &diagonal, f64::INFINITY, 0.0);
    };
    let scaled = residual.component_div(&deviations);
    let nis = scaled.dot(&cholesky.solve(&scaled));
    let error = (nis - innovation.nis).abs();
    // Half the digits of a correlation near one are gone in its inverse.
    let loose = tolerance.sqrt();
    require("nis is the normalised innovation", &index, &nis, &innovation.nis, error, loose * (1.0 + nis))?;
    let (rows, stated) = (measured.len(), innovation.degrees_of_freedom);
    let law = "degrees of freedom are the measured rows";
    require(law, &index, &rows, &stated, broken_unless(rows == stated), 0.0)?;
    let logarithm = 2.0 * (deviations.map(f64::ln).sum() + cholesky.l_dirty().diagonal().map(f64::ln).sum());
    let (stated, law) = (innovation.determinant.ln(), "determinant is that of the innovation covariance");
    require(law, &index, &logarithm, &stated, (stated - logarithm).abs(), loose * (1.0 + logarithm.abs()))
}

/// `matrix` with rows and columns in units of the standard deviations of `covariance`.
fn in_deviations<const P: usize>(matrix: &SMatrix<f64, P, P>, covariance: &SMatrix<f64, P, P>) -> SMatrix<f64, P, P> {
    let deviation = covariance.diagonal().map(|v| v.max(f64::MIN_POSITIVE).sqrt());
    SMatrix::from_fn(|i, j| matrix[(i, j)] / (deviation[i] * deviation[j]))
}

fn smallest_eigenvalue<const P: usize>(matrix: &SMatrix<f64, P, P>) -> f64 {
    nalgebra::DMatrix::from_fn(P, P, |i, j| 0.5 * (matrix[(i, j)] + matrix[(j, i)])).symmetric_eigenvalues().min()
}
