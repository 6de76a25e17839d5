//! Momentum balance of a tree, linear in the unknown parameters (3.2).
//!
//! Momentum is bilinear: `h = A(pi) zeta = Y(zeta) pi`, and it is the velocity `zeta` that is measured with noise, so noise
//! is in the regressor. The rows are those of the Gauss-Helmert model: whitened with `A Sigma A^T`, the regressor taken
//! at the fitted velocity, which the balance at the last estimate gives. At convergence the estimate is that of maximum
//! likelihood; plain least squares would be drawn towards zero.

use super::tree_part::TreePart;
use super::tree_sample::TreeSample;
use crate::dynamics::{Multibody, PARAMETERS};
use crate::error::IdentificationError;
use crate::lie::{LieGroup, Pose, Twist, Wrench};
use nalgebra::{DMatrix, DVector, Matrix6, SMatrix, Vector6};

/// One-sigma noise of measured velocities, per sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityNoise {
    /// Gyroscope, rad/s.
    pub base_rate_rad_s: f64,
    /// Velocity of the base origin, m/s.
    pub base_velocity_m_s: f64,
    /// Joint rates, rad/s or m/s.
    pub joint_rate: f64,
}

/// One sample's balance at the last estimate.
pub(super) struct MomentumRows {
    /// Whitened coefficients of the unknown numbers, ten for each part.
    pub regressor: DMatrix<f64>,
    /// Whitened coefficients of an unknown constant momentum.
    pub constant: Matrix6<f64>,
    /// Whitened right side.
    pub right: Vector6<f64>,
    /// Whitened residual of the last estimate.
    pub residual: Vector6<f64>,
}

/// `A`: momentum about the inertial origin per unit of generalised velocity, inertial axes.
fn momentum_jacobian(
    tree: &Multibody<f64>,
    world_from_base: &Pose<f64>,
    positions: &[f64],
) -> Result<DMatrix<f64>, IdentificationError> {
    let mass_matrix = tree.mass_matrix(positions)?;
    let carry: Matrix6<f64> = world_from_base.coadjoint();
    let mut jacobian = DMatrix::zeros(6, 6 + tree.joints());
    jacobian.fixed_view_mut::<6, 6>(0, 0).copy_from(&(carry * mass_matrix.composite.spatial_inertia()));
    for (joint, column) in mass_matrix.coupling.iter().enumerate() {
        jacobian.column_mut(6 + joint).copy_from(&(carry * column));
    }
    Ok(jacobian)
}

/// The six rows of one sample; `estimate` is the tree with the last numbers, `momentum` what it should have now, both
/// about the origin of `world_from_base`.
pub(super) fn momentum_rows(
    estimate: &Multibody<f64>,
    (parts, numbers): (&[TreePart], &[f64]),
    grasped: bool,
    sample: &TreeSample,
    (world_from_base, noise): (&Pose<f64>, &VelocityNoise),
    momentum: &Wrench<f64>,
    at_fitted_velocity: bool,
) -> Result<MomentumRows, IdentificationError> {
    let joints = estimate.joints();
    let jacobian = momentum_jacobian(estimate, world_from_base, &sample.positions)?;
    let variance = DVector::from_fn(6 + joints, |i, _| {
        let sigma = match i {
            0..3 => noise.base_rate_rad_s,
            3..6 => noise.base_velocity_m_s,
            _ => noise.joint_rate,
        };
        sigma * sigma
    });
    let twist = sample.base_twist.to_vector();
    let velocity = DVector::from_iterator(6 + joints, twist.iter().chain(&sample.rates).copied());
    let residual: Vector6<f64> = Vector6::from_iterator((&jacobian * &velocity).iter().copied()) - momentum.to_vector();

    let mut spread = jacobian.clone();
    for (mut column, variance) in spread.column_iter_mut().zip(variance.iter()) {
        column *= *variance;
    }
    let covariance = &spread * jacobian.transpose();
    let covariance: Matrix6<f64> = covariance.fixed_view::<6, 6>(0, 0).into_owned();
    let not_excited = IdentificationError::Indefinite { parameters: 6 };
    let factor = covariance.cholesky().ok_or(not_excited)?;
    let correction = spread.transpose() * DVector::from_column_slice(factor.solve(&residual).as_slice());
    let fitted = if at_fitted_velocity { velocity - correction } else { velocity };

    let fitted_twist = Twist::from(Vector6::from_iterator(fitted.iter().take(6).copied()));
    let fitted_rates: Vec<f64> = fitted.iter().skip(6).copied().collect();
    let regressor = estimate.momentum_regressor(world_from_base, &fitted_twist, &sample.positions, &fitted_rates)?;
    let mut coefficients = DMatrix::zeros(6, PARAMETERS * parts.len());
    for (k, part) in parts.iter().enumerate().filter(|(_, part)| part.whole || grasped) {
        if let Some(block) = regressor.body(part.body) {
            let block: SMatrix<f64, 6, PARAMETERS> = block * part.body_from_part_parameters();
            coefficients.fixed_view_mut::<6, PARAMETERS>(0, PARAMETERS * k).copy_from(&block);
        }
    }
    let right = &coefficients * DVector::from_column_slice(numbers) - DVector::from_column_slice(residual.as_slice());
    let lower = factor.l();
    let whiten = |m: &DMatrix<f64>| lower.solve_lower_triangular(m);
    let singular = || IdentificationError::Indefinite { parameters: 6 };
    let right_white = whiten(&DMatrix::from_column_slice(6, 1, right.as_slice())).ok_or_else(singular)?;
    let residual_white = lower.solve_lower_triangular(&residual).ok_or_else(singular)?;
    Ok(MomentumRows {
        regressor: whiten(&coefficients).ok_or_else(singular)?,
        constant: lower.solve_lower_triangular(&-Matrix6::identity()).ok_or_else(singular)?,
        right: Vector6::from_column_slice(right_white.as_slice()),
        residual: residual_white,
    })
}
