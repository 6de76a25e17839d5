//! Laws of recursive estimators and of the gates in front of them.

use super::broken_unless;
use crate::consistency::FeasibleSet;
use crate::error::IdentificationError;
use crate::recursive::{Innovation, Outcome, RecursiveEstimator, Verdict};
use nalgebra::{SMatrix, SVector};
use tumble_lie::laws::{LawViolation, require};

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

/// Laws of a [`RecursiveEstimator`] without a gate, tried by feeding it `observations` from `start` on.
///
/// `tolerance` is relative: to standard deviations before each update, and to the batch.
///
/// # Errors
/// The first broken law: `update succeeds`, `innovation covariance is symmetric positive definite`,
/// `nis is the normalised innovation`, `degrees of freedom are the measured rows`,
/// `determinant is that of the innovation covariance`, `covariance is symmetric positive semidefinite`,
/// `data never add uncertainty`, `estimate is inside the feasible set`, `same observations give the same estimate`,
/// `equals batch`, `order independent`.
pub fn check_recursive_estimator<E, const P: usize, const ROWS: usize>(
    start: &E,
    observations: &[E::Observation],
    promises: &EstimatorPromises<'_, P>,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    E: RecursiveEstimator<P, ROWS> + Clone,
{
    let mut estimator = start.clone();
    inside(promises, &estimator.parameters(), 0)?;
    for (index, observation) in observations.iter().enumerate() {
        let before = estimator.covariance();
        let outcome = succeeded(estimator.update(observation), index)?;
        check_innovation(&outcome.innovation, index, tolerance)?;
        let after = estimator.covariance();
        let law = "covariance is symmetric positive semidefinite";
        let correlation = in_deviations(&after, &after);
        let asymmetry = (after - after.transpose()).amax() / after.amax().max(f64::MIN_POSITIVE);
        let indefinite = -smallest_eigenvalue(&correlation);
        require(law, &index, &"symmetric, >= 0", &after, asymmetry.max(indefinite), tolerance)?;
        if promises.constant_parameters {
            let shrunk = in_deviations(&(before - after), &before);
            let growth = -smallest_eigenvalue(&shrunk);
            require("data never add uncertainty", &index, &before, &after, growth, tolerance)?;
        }
        inside(promises, &estimator.parameters(), index + 1)?;
    }
    let again = fed(start, observations.iter())?;
    let same = again.parameters() == estimator.parameters() && again.covariance() == estimator.covariance();
    let (law, found) = ("same observations give the same estimate", again.parameters());
    require(law, &"all", &estimator.parameters(), &found, broken_unless(same), 0.0)?;
    if let Some((parameters, covariance)) = &promises.batch {
        let compare = |law, estimator: &E, tolerance: f64| {
            let size = parameters.amax().max(f64::MIN_POSITIVE);
            let error = (estimator.parameters() - parameters).amax() / size;
            require(law, &"parameters", parameters, &estimator.parameters(), error, tolerance)?;
            let error = in_deviations(&(estimator.covariance() - covariance), covariance).amax();
            require(law, &"covariance", covariance, &estimator.covariance(), error, tolerance)
        };
        compare("equals batch", &estimator, tolerance)?;
        compare("order independent", &fed(start, observations.iter().rev())?, 2.0 * tolerance)?;
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
pub fn check_gate<E, const P: usize, const ROWS: usize>(
    runs: &mut dyn Iterator<Item = (E, Vec<E::Observation>)>,
    probability: f64,
    band: f64,
    spoiled: &[E::Observation],
) -> Result<(), LawViolation>
where
    E: RecursiveEstimator<P, ROWS>,
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
        let before = estimator.parameters();
        match succeeded(estimator.update(observation), index)?.verdict {
            Verdict::Rejected { .. } => {
                let changed = broken_unless(estimator.parameters() == before);
                let law = "a rejected update changes nothing";
                require(law, &index, &before, &estimator.parameters(), changed, 0.0)?;
            }
            Verdict::Recovered { .. } => recovered = true,
            Verdict::Accepted => {}
        }
    }
    let rule = "an acceptance after rejections in a row";
    require("gate lets go of a wrong belief", &spoiled.len(), &rule, &recovered, broken_unless(recovered), 0.0)
}

/// The same problem in other units: `factors` turn the parameters of `start` into those of `scaled`.
///
/// # Errors
/// The first broken law: `update succeeds`, `nis is free of units`, `the estimate scales with the units`.
pub fn check_unit_equivariance<E, const P: usize, const ROWS: usize>(
    (start, observations): (&E, &[E::Observation]),
    (scaled, scaled_observations): (&E, &[E::Observation]),
    factors: &SVector<f64, P>,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    E: RecursiveEstimator<P, ROWS> + Clone,
{
    let (mut one, mut other) = (start.clone(), scaled.clone());
    for (index, (a, b)) in observations.iter().zip(scaled_observations).enumerate() {
        let a = succeeded(one.update(a), index)?.innovation.nis;
        let b = succeeded(other.update(b), index)?.innovation.nis;
        require("nis is free of units", &index, &a, &b, (a - b).abs(), tolerance * (1.0 + a))?;
        let expected = one.parameters().component_mul(factors);
        let error = (other.parameters() - expected).component_div(factors).amax();
        let law = "the estimate scales with the units";
        require(law, &index, &expected, &other.parameters(), error, tolerance * one.parameters().amax())?;
    }
    Ok(())
}

fn inside<const P: usize>(
    promises: &EstimatorPromises<'_, P>,
    parameters: &SVector<f64, P>,
    updates: usize,
) -> Result<(), LawViolation> {
    let Some(set) = promises.feasible_set else { return Ok(()) };
    let margin = set.margin(parameters);
    let law = "estimate is inside the feasible set";
    require(law, &(updates, parameters), &"a positive margin", &margin, broken_unless(margin > 0.0), 0.0)
}

fn succeeded<const ROWS: usize>(
    outcome: Result<Outcome<ROWS>, IdentificationError>,
    index: usize,
) -> Result<Outcome<ROWS>, LawViolation> {
    outcome.map_err(|error| LawViolation {
        law: "update succeeds",
        inputs: format!("observation {index}"),
        expected: "an outcome".to_owned(),
        found: error.to_string(),
        error: f64::NAN,
        tolerance: 0.0,
    })
}

fn fed<'a, E, const P: usize, const ROWS: usize>(
    start: &E,
    observations: impl Iterator<Item = &'a E::Observation>,
) -> Result<E, LawViolation>
where
    E: RecursiveEstimator<P, ROWS> + Clone,
    E::Observation: 'a,
{
    let mut estimator = start.clone();
    for (index, observation) in observations.enumerate() {
        succeeded(estimator.update(observation), index)?;
    }
    Ok(estimator)
}

fn check_innovation<const ROWS: usize>(
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
        return require(law, &index, &"symmetric, > 0", &s, f64::INFINITY, 0.0);
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
