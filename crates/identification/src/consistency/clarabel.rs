//! The same problem handed to Clarabel's semidefinite cone (feature `clarabel-sdp`).
//!
//! Independent of [`InteriorPoint`](super::InteriorPoint): it works on RᵀR in the ten parameters themselves. The
//! feature brings Clarabel's cone only; the final binary must link BLAS and LAPACK symbols of its own choice.

use super::{ConstrainedEstimate, ConstrainedLeastSquares, FeasibleSet, PseudoInertiaCone, pulled_inside};
use crate::error::IdentificationError;
use crate::square_root_information::SquareRootInformation;
use ::clarabel::algebra::CscMatrix;
use ::clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SupportedConeT};
use nalgebra::{SMatrix, SVector};

/// Constrained least squares over the pseudo-inertia cone by a general conic solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClarabelSdp {
    cone: PseudoInertiaCone,
    tolerance: f64,
    form: Form,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Form {
    Quadratic,
    Epigraph,
}

impl ClarabelSdp {
    /// Quadratic objective ½|R p − z|² over the cone, all of Clarabel's tolerances set to `tolerance`.
    pub fn new(cone: PseudoInertiaCone, tolerance: f64) -> Self {
        Self { cone, tolerance, form: Form::Quadratic }
    }

    /// The thesis's form: minimise s subject to [s, (R p − z)ᵀ; R p − z, I] ≥ 0 and the cone.
    ///
    /// # Source
    /// Thesis (2.29) and 5.3.2. Slower and less accurate than the quadratic objective; kept for comparison.
    pub fn epigraph(cone: PseudoInertiaCone, tolerance: f64) -> Self {
        Self { cone, tolerance, form: Form::Epigraph }
    }

    fn settings(&self) -> DefaultSettings<f64> {
        DefaultSettings {
            verbose: false,
            max_threads: 1,
            tol_gap_abs: self.tolerance,
            tol_gap_rel: self.tolerance,
            tol_feas: self.tolerance,
            ..DefaultSettings::default()
        }
    }
}

impl ConstrainedLeastSquares<10> for ClarabelSdp {
    fn solve(&self, information: &SquareRootInformation<10>) -> Result<ConstrainedEstimate<10>, IdentificationError> {
        let magnitudes = self.cone.magnitudes();
        information.require_full_rank(&magnitudes)?;
        let factor = information.scaled_factor(&magnitudes);
        let rhs = information.rhs();
        let scale = factor.norm();
        let cone_offset = triangle(&self.cone.normalized(&SVector::zeros()));
        let cone_columns: Vec<_> = (0..10)
            .map(|k| {
                let mut unit = SVector::<f64, 10>::zeros();
                unit[k] = magnitudes[k];
                triangle(&self.cone.normalized(&unit)).into_iter().zip(&cone_offset).map(|(a, b)| a - b).collect()
            })
            .collect::<Vec<Vec<f64>>>();
        let mut solver = match self.form {
            Form::Quadratic => {
                let hessian = factor.transpose() * factor / (scale * scale);
                let linear = -(factor.transpose() * rhs) / (scale * scale);
                let objective = sparse(10, 10, |i, j| if i <= j { hessian[(i, j)] } else { 0.0 });
                let constraint = sparse(10, 10, |i, j| -cone_columns[j][i]);
                let cones = [SupportedConeT::PSDTriangleConeT(4)];
                DefaultSolver::new(&objective, linear.as_slice(), &constraint, &cone_offset, &cones, self.settings())
            }
            Form::Epigraph => {
                // Unknowns (p, s); rows of the 11×11 block, then those of the cone.
                let block = |corner: f64, border: &SVector<f64, 10>, body: f64| {
                    let mut m = SMatrix::<f64, 11, 11>::identity() * body;
                    m[(0, 0)] = corner;
                    m.fixed_view_mut::<10, 1>(1, 0).copy_from(border);
                    m.fixed_view_mut::<1, 10>(0, 1).copy_from(&border.transpose());
                    triangle(&m)
                };
                let columns: Vec<Vec<f64>> = (0..11)
                    .map(|k| {
                        let (mut column, cone) = if k < 10 {
                            (block(0.0, &(factor.column(k) / scale), 0.0), cone_columns[k].clone())
                        } else {
                            (block(1.0, &SVector::zeros(), 0.0), vec![0.0; 10])
                        };
                        column.extend(cone);
                        column
                    })
                    .collect();
                let mut offset = block(0.0, &(-rhs / scale), 1.0);
                offset.extend(&cone_offset);
                let constraint = sparse(offset.len(), 11, |i, j| -columns[j][i]);
                let mut linear = [0.0; 11];
                linear[10] = 1.0;
                let cones = [SupportedConeT::PSDTriangleConeT(11), SupportedConeT::PSDTriangleConeT(4)];
                DefaultSolver::new(&CscMatrix::zeros((11, 11)), &linear, &constraint, &offset, &cones, self.settings())
            }
        }
        .map_err(|_| IdentificationError::NotConverged {
            iterations: 0,
            duality_gap: f64::INFINITY,
            tolerance: self.tolerance,
        })?;
        solver.solve();
        let duality_gap = (solver.info.cost_primal - solver.info.cost_dual).abs() * scale * scale;
        let iterations = solver.solution.iterations as usize;
        if solver.solution.x.iter().any(|x| !x.is_finite()) {
            return Err(IdentificationError::NotConverged { iterations, duality_gap, tolerance: self.tolerance });
        }
        let scaled = SVector::<f64, 10>::from_column_slice(&solver.solution.x[..10]);
        let (parameters, margin) = pulled_inside(&self.cone, scaled.component_mul(&magnitudes));
        let objective = information.objective(&parameters);
        Ok(ConstrainedEstimate { parameters, margin, objective, duality_gap, iterations })
    }
}

/// Upper triangle column by column, off-diagonals times √2, as Clarabel wants it.
fn triangle<const N: usize>(m: &SMatrix<f64, N, N>) -> Vec<f64> {
    (0..N)
        .flat_map(|j| (0..=j).map(move |i| (i, j)))
        .map(|(i, j)| if i == j { m[(i, j)] } else { core::f64::consts::SQRT_2 * m[(i, j)] })
        .collect()
}

fn sparse(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> CscMatrix<f64> {
    let (mut starts, mut indices, mut values) = (vec![0], Vec::new(), Vec::new());
    for j in 0..columns {
        for i in 0..rows {
            let value = entry(i, j);
            if value != 0.0 {
                indices.push(i);
                values.push(value);
            }
        }
        starts.push(indices.len());
    }
    CscMatrix::new(rows, columns, starts, indices, values)
}
