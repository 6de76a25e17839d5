//! The ten parameters as the likelihood sees them, `eta = [ln m, c, J_C]`, and steps that keep them a body.

use super::flow::Body;
use crate::dynamics::InertialParameters;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

/// Row and column of the six entries of a symmetric matrix.
const UPPER: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
/// A step longer than this fraction of mass or mean inertia is taken in their inverses.
const LONG_STEP: f64 = 0.2;
/// Largest fraction by which an inverse may fall in one step.
const LARGEST_FALL: f64 = 0.9;
/// Floors of the second moments of mass: relative to the largest after a long step, to their trace otherwise.
const FLOOR_AFTER_LONG_STEP: f64 = 1e-3;
const FLOOR: f64 = 1e-6;

/// Logarithm of the mass, centre of mass (body axes), inertia about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Coordinates {
    pub(crate) log_mass: f64,
    pub(crate) center: Vector3<f64>,
    pub(crate) inertia: Matrix3<f64>,
}

/// A step of all parameters and how it was taken.
pub(crate) struct ParameterStep {
    pub(crate) next: Coordinates,
    /// The step on which states and noise are to follow.
    pub(crate) step: DVector<f64>,
    /// How far the parameters went; differs from the step where it was a long one.
    pub(crate) moved: DVector<f64>,
    /// The consistency constraint shortened it.
    pub(crate) constrained: bool,
}

impl ParameterStep {
    /// Stays where it is.
    pub(crate) fn none(at: &Coordinates, columns: usize) -> Self {
        Self { next: *at, step: DVector::zeros(columns), moved: DVector::zeros(columns), constrained: false }
    }
}

impl Coordinates {
    pub(crate) fn of(body: &InertialParameters<f64>) -> Self {
        Self { log_mass: body.mass.ln(), center: body.center_of_mass(), inertia: body.inertia_about_com() }
    }

    pub(crate) fn body(&self) -> Body {
        Body::new(self.log_mass.exp(), self.center, self.inertia)
    }

    pub(crate) fn parameters(&self) -> InertialParameters<f64> {
        InertialParameters::about_com(self.log_mass.exp(), self.center, self.inertia)
    }

    /// Sizes of `[ln m, c, J_C]` by the body itself.
    pub(crate) fn sizes(&self) -> SVector<f64, 10> {
        let inertia = self.inertia.trace() / 3.0;
        let length = (1.5 * inertia / self.log_mass.exp()).sqrt();
        SVector::from_fn(|i, _| match i {
            0 => 1.0,
            1..=3 => length,
            _ => 1.5 * inertia,
        })
    }

    /// Derivative of [`InertialParameters::to_vector`] by eta.
    pub(crate) fn parameters_by_eta(&self) -> SMatrix<f64, 10, 10> {
        let (m, c) = (self.log_mass.exp(), self.center);
        let parallel = |a: &Vector3<f64>, b: &Vector3<f64>| {
            Matrix3::identity() * (2.0 * a.dot(b)) - a * b.transpose() - b * a.transpose()
        };
        let column = |i: usize| {
            let (mass, moment, inertia) = match i {
                0 => (m, c * m, parallel(&c, &c) * (0.5 * m)),
                1..=3 => {
                    let axis = Vector3::ith(i - 1, 1.0);
                    (0.0, axis * m, parallel(&c, &axis) * m)
                }
                _ => (0.0, Vector3::zeros(), unit(i - 4)),
            };
            InertialParameters { mass, first_moment: moment, inertia_about_origin: inertia }.to_vector()
        };
        SMatrix::from_columns(&core::array::from_fn::<SVector<f64, 10>, 10, _>(column))
    }

    /// The step that the quadratic `d^T S d / 2 - g^T d` asks for; `None` where S is singular.
    pub(crate) fn step(&self, information: &DMatrix<f64>, gradient: &DVector<f64>) -> Option<ParameterStep> {
        let step = information.clone().cholesky()?.solve(gradient);
        if !step.iter().all(|x| x.is_finite()) {
            return None;
        }
        let longest = step.iter().skip(4).take(6).fold(0.0, |longest: f64, x| longest.max(x.abs()));
        if step[0].abs() > LONG_STEP || longest > LONG_STEP * self.inertia.trace() / 3.0 {
            let next = self.long_step(&step)?;
            let mut moved = step.clone();
            moved.rows_mut(0, 10).copy_from(&next.difference(self));
            return Some(ParameterStep { next, step, moved, constrained: false });
        }
        let next = self.advanced(&step);
        if slack(&next.inertia).symmetric_eigenvalues().min() > 0.0 {
            return Some(ParameterStep { next, moved: step.clone(), step, constrained: false });
        }
        let step = self.constrained_step(information, gradient)?;
        Some(ParameterStep { next: self.advanced(&step), moved: step.clone(), step, constrained: true })
    }

    pub(crate) fn advanced(&self, step: &DVector<f64>) -> Self {
        Self {
            log_mass: self.log_mass + step[0],
            center: self.center + Vector3::new(step[1], step[2], step[3]),
            inertia: self.inertia + symmetric(step.as_slice()),
        }
    }

    #[cfg(feature = "argmin")]
    /// Whether matter can be spread so.
    pub(crate) fn is_body(&self) -> bool {
        slack(&self.inertia).symmetric_eigenvalues().min() > 0.0
    }

    /// The same with mass and inertia grown alike until no moment of inertia about the centre of mass is below this one.
    pub(crate) fn heavier(&self, smallest_moment: f64) -> Self {
        let factor = (smallest_moment / self.inertia.symmetric_eigenvalues().min()).max(1.0);
        Self { log_mass: self.log_mass + factor.ln(), inertia: self.inertia * factor, ..*self }
    }

    /// `self - base` in the order of eta.
    pub(crate) fn difference(&self, base: &Self) -> SVector<f64, 10> {
        let (center, inertia) = (self.center - base.center, self.inertia - base.inertia);
        SVector::from_fn(|i, _| match i {
            0 => self.log_mass - base.log_mass,
            1..=3 => center[i - 1],
            _ => inertia[UPPER[i - 4]],
        })
    }

    /// A step in 1/m and J_C^-1, the coordinates in which one step of the flow is linear.
    fn long_step(&self, step: &DVector<f64>) -> Option<Self> {
        let lower = self.inertia.cholesky()?.unpack();
        let inverse = lower.try_inverse()?;
        let relative = inverse * symmetric(step.as_slice()) * inverse.transpose();
        let eigen = relative.symmetric_eigen();
        let stretch = eigen.eigenvalues.map(|a| 1.0 / (1.0 - a.min(LARGEST_FALL)));
        let frame = lower * eigen.eigenvectors;
        let inertia = frame * Matrix3::from_diagonal(&stretch) * frame.transpose();
        Some(Self {
            log_mass: self.log_mass - (1.0 - step[0].min(LARGEST_FALL)).ln(),
            center: self.center + Vector3::new(step[1], step[2], step[3]),
            inertia: with_floor(&inertia, FLOOR_AFTER_LONG_STEP),
        })
    }

    /// Barrier Newton on `d^T S d / 2 - g^T d` subject to second moments of mass above their floor.
    fn constrained_step(&self, information: &DMatrix<f64>, gradient: &DVector<f64>) -> Option<DVector<f64>> {
        const LAST_WEIGHT: f64 = 1e-7;
        let directions: [Matrix3<f64>; 6] = core::array::from_fn(|k| slack(&unit(k)));
        let inside = |d: &DVector<f64>| slack(&self.advanced(d).inertia).cholesky().is_some();
        let mut d = DVector::zeros(gradient.len());
        let start = with_floor(&self.inertia, 1e-2) - self.inertia;
        for (k, (i, j)) in UPPER.into_iter().enumerate() {
            d[4 + k] = start[(i, j)];
        }
        let mut weight = 1.0;
        for _ in 0..100 {
            let inverse = slack(&self.advanced(&d).inertia).try_inverse()?;
            let scaled = directions.map(|direction| inverse * direction);
            let mut slope = information * &d - gradient;
            let mut hessian = information.clone();
            for a in 0..6 {
                slope[4 + a] -= weight * scaled[a].trace();
                for b in 0..6 {
                    hessian[(4 + a, 4 + b)] += weight * (scaled[a] * scaled[b]).trace();
                }
            }
            let newton = hessian.cholesky()?.solve(&-&slope);
            let mut length = 1.0;
            while !inside(&(&d + &newton * length)) {
                length *= 0.6;
                if length < 1e-12 {
                    return None;
                }
            }
            if length < 1.0 {
                length *= 0.95;
            }
            let decrement = -slope.dot(&newton);
            d += newton * length;
            if decrement < 0.1 * weight.max(1e-9) {
                if weight < LAST_WEIGHT {
                    break;
                }
                weight *= 0.1;
            }
        }
        Some(d)
    }

    /// Body axis along which the body is thinnest: the direction in which a constraint holds it.
    pub(crate) fn thinnest_axis(&self) -> Vector3<f64> {
        let eigen = second_moments(&self.inertia).symmetric_eigen();
        eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned()
    }
}

/// Symmetric matrix of entries four to nine of a step.
fn symmetric(step: &[f64]) -> Matrix3<f64> {
    let mut m = Matrix3::zeros();
    for (&(i, j), &value) in UPPER.iter().zip(&step[4..10]) {
        m[(i, j)] = value;
        m[(j, i)] = value;
    }
    m
}

fn unit(k: usize) -> Matrix3<f64> {
    let mut step = [0.0; 10];
    step[4 + k] = 1.0;
    symmetric(&step)
}

/// `tr(J)/2 I - J`, positive definite exactly for inertias of bodies.
fn second_moments(inertia: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::identity() * (0.5 * inertia.trace()) - inertia
}

/// Second moments above their floor.
fn slack(inertia: &Matrix3<f64>) -> Matrix3<f64> {
    let moments = second_moments(inertia);
    moments - Matrix3::identity() * (FLOOR * moments.trace())
}

/// The inertia with its second moments raised to a fraction of the largest.
fn with_floor(inertia: &Matrix3<f64>, fraction: f64) -> Matrix3<f64> {
    let eigen = second_moments(inertia).symmetric_eigen();
    let floor = fraction * eigen.eigenvalues.max();
    let raised = Matrix3::from_diagonal(&eigen.eigenvalues.map(|x| x.max(floor)));
    let moments = eigen.eigenvectors * raised * eigen.eigenvectors.transpose();
    Matrix3::identity() * moments.trace() - moments
}
