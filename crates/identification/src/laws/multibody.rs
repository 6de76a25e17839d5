//! Laws of what is said of trees of bodies: rank and words, and the answers of a solver.

use super::broken_unless;
use crate::consistency::{FeasibleSet, PseudoInertiaCone};
use crate::error::IdentificationError;
use crate::estimator::{Estimator, EstimatorError, Finding};
use crate::multibody::{BaseParameters, DynEstimator, LinkInformation, LinkPrior, LinksEstimate};
use nalgebra::{DMatrix, DVector, Matrix4, SMatrix, SVector};
use tumble_lie::laws::{LawViolation, require};

/// Laws of [`BaseParameters`] said of `information`, with `tolerance` relative to the strongest direction.
///
/// # Errors
/// The first broken law: `rank is that of the data`, `indistinguishable changes are all there are`,
/// `no measurement notices an indistinguishable change`, `base parameters do not see an indistinguishable change`.
pub fn check_base_parameters(
    base: &BaseParameters,
    information: &LinkInformation,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let magnitudes = base.layout().magnitudes();
    let mut scaled = information.factor().clone();
    for (mut column, size) in scaled.column_iter_mut().zip(magnitudes.iter()) {
        column *= *size;
    }
    let values = scaled.clone().singular_values();
    let strongest = values.max();
    let rank = values.iter().filter(|&&value| value > tolerance * strongest).count();
    let told = broken_unless(rank == base.rank());
    require("rank is that of the data", &values, &rank, &base.rank(), told, 0.0)?;
    let changes = base.indistinguishable_changes();
    let all = broken_unless(changes.len() + rank == magnitudes.len());
    require("indistinguishable changes are all there are", &values, &rank, &changes.len(), all, 0.0)?;
    for change in changes {
        let like_units = change.change().component_div(&magnitudes);
        let noticed = (&scaled * &like_units).norm() / (strongest * like_units.norm()).max(f64::MIN_POSITIVE);
        let law = "no measurement notices an indistinguishable change";
        require(law, &change.to_string(), &0.0, &noticed, noticed, tolerance)?;
        for parameter in base.base_parameters() {
            let factors = parameter.factors().component_mul(&magnitudes);
            let seen = factors.dot(&like_units).abs() / (factors.norm() * like_units.norm());
            let law = "base parameters do not see an indistinguishable change";
            require(law, &(parameter.to_string(), change.to_string()), &0.0, &seen, seen, tolerance)?;
        }
    }
    Ok(())
}

/// A [`DynEstimator`] of a tree whose data determine all `P` unknowns, as an [`Estimator`]: what the laws of those take.
#[derive(Clone, Copy, Debug)]
pub struct Determined<E>(pub E);

impl<E: DynEstimator, const P: usize> Estimator<P> for Determined<E> {
    type Record = E::Record;

    /// # Errors
    /// [`IdentificationError::UnknownCount`] for other than `P` unknowns, [`IdentificationError::Indefinite`] where one of them is left free.
    fn estimate(&self, record: &E::Record) -> Result<Finding<P>, EstimatorError> {
        let found = self.0.estimate(record)?;
        let covariance = found.covariance_of(&DMatrix::identity(P, P))?;
        let covariance = covariance.ok_or(IdentificationError::Indefinite { parameters: P })?;
        let entries = |v: &DVector<f64>| SVector::<f64, P>::from_fn(|i, _| v[i]);
        let covariance = SMatrix::<f64, P, P>::from_fn(|i, j| covariance[(i, j)]);
        Finding::of_covariance(entries(found.point()), &covariance, entries(found.magnitudes()))
    }
}

/// Laws of a solver of [`ConsistentLinks`](crate::multibody::ConsistentLinks)' problem with this floor.
///
/// That the data's misfit is least is certified without a solver: its gradient must be a multiplier of the constraints, in
/// the dual cone and zero where they do not bind, and the prior must have no part in it. `tolerance` is in half chi-squares for each magnitude of an unknown.
///
/// # Errors
/// The first broken law: `solver succeeds`, `every body is made of mass`, `nuisances keep their bounds`,
/// `misfit is that of the unknowns`, `no consistent change fits better`, `the prior decides what the data leave`.
pub fn check_links_solver(
    solver: &dyn Fn(&BaseParameters, &LinkPrior) -> Result<LinksEstimate, IdentificationError>,
    base: &BaseParameters,
    prior: &LinkPrior,
    relative_floor: f64,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let layout = base.layout();
    let estimate = match solver(base, prior) {
        Ok(estimate) => estimate,
        Err(error) => return require("solver succeeds", layout, &"an estimate", &error, f64::NAN, 0.0),
    };
    let unknowns = &estimate.unknowns;
    let magnitudes = layout.magnitudes();
    let scaled = unknowns.component_div(&magnitudes);
    let gradient = base.misfit_gradient(&scaled);
    for (index, body) in layout.bodies().iter().enumerate() {
        let column = layout.body_column(index);
        let ten = |v: &DVector<f64>| SVector::<f64, 10>::from_fn(|k, _| v[column + k]);
        let cone = PseudoInertiaCone::with_relative_floor(body.scale, relative_floor);
        let margin = cone.margin(&ten(unknowns));
        require("every body is made of mass", &body.name, &"a positive margin", &margin, -margin, 0.0)?;
        let multiplier = adjoint(&ten(&gradient));
        let smallest = multiplier.symmetric_eigenvalues().min();
        require("no consistent change fits better", &body.name, &"at least 0", &smallest, -smallest, tolerance)?;
        let push = multiplier.dot(&cone.normalized(&ten(unknowns))).abs();
        require("no consistent change fits better", &body.name, &0.0, &push, push, tolerance)?;
    }
    for (index, nuisance) in layout.nuisances().iter().enumerate() {
        let column = layout.nuisance_column(index);
        let slope = gradient[column];
        let law = "no consistent change fits better";
        if let Some(bound) = nuisance.lower_bound {
            let value = unknowns[column];
            require("nuisances keep their bounds", &nuisance.name, &bound, &value, bound - value, 0.0)?;
            require(law, &nuisance.name, &"at least 0", &slope, -slope, tolerance)?;
            let push = (slope * (value - bound) / nuisance.magnitude).abs();
            require(law, &nuisance.name, &0.0, &push, push, tolerance)?;
        } else {
            require(law, &nuisance.name, &0.0, &slope, slope.abs(), tolerance)?;
        }
    }
    let misfit = base.scaled_misfit(&scaled);
    let off = (misfit - estimate.misfit).abs();
    let rounding = tolerance * (1.0 + misfit);
    require("misfit is that of the unknowns", unknowns, &misfit, &estimate.misfit, off, rounding)?;
    if !estimate.is_active() {
        let left = prior.conditional_misfit(base, &scaled);
        require("the prior decides what the data leave", unknowns, &0.0, &left, left, tolerance)?;
    }
    Ok(())
}

/// Z with ⟨Z, D⁻¹ P(p) D⁻¹⟩ = gradient · p for every p in like units, over [x, y, z, 1].
fn adjoint(g: &SVector<f64, 10>) -> Matrix4<f64> {
    let (xx, yy, zz) = (g[7] + g[9], g[4] + g[9], g[4] + g[7]);
    let half = 0.5;
    Matrix4::new(
        xx,
        -half * g[5],
        -half * g[6],
        half * g[1],
        -half * g[5],
        yy,
        -half * g[8],
        half * g[2],
        -half * g[6],
        -half * g[8],
        zz,
        half * g[3],
        half * g[1],
        half * g[2],
        half * g[3],
        g[0],
    )
}
