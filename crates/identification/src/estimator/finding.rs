//! What is known of some parameters.

use super::EstimatorError;
use crate::SquareRootInformation;
use nalgebra::{ComplexField, SMatrix, SVector};

/// Pivots below this share of what they were made of are rounding.
const ROUNDING: f64 = 1e-11;

/// What an estimator knows: information in units of one standard deviation, singular where directions are free; the part of
/// it that was known before; and the point reported, where there is one.
///
/// The point is not always R⁻¹z: a constraint or a robust norm moves it, the information stays that of the data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finding<const P: usize = 10> {
    information: SquareRootInformation<P>,
    prior: SquareRootInformation<P>,
    noise: SMatrix<f64, P, P>,
    surprise: Option<(f64, usize)>,
    /// As it was stated, where it was: what is read of it is that to the bit.
    stated: Option<SMatrix<f64, P, P>>,
    point: Option<SVector<f64, P>>,
    magnitudes: SVector<f64, P>,
}

impl<const P: usize> Finding<P> {
    /// Of whitened rows, which may leave directions free: then there is no point.
    pub fn of_information(information: SquareRootInformation<P>, magnitudes: SVector<f64, P>) -> Self {
        let point = information.solve(&magnitudes).ok();
        Self {
            information,
            prior: SquareRootInformation::new(),
            noise: SMatrix::zeros(),
            surprise: None,
            stated: None,
            point,
            magnitudes,
        }
    }

    /// Of a point with its covariance, whatever way it came about: sandwich, filter, sampling.
    ///
    /// # Errors
    /// Numbers that are not finite, a covariance that is not symmetric or not positive definite: by component and value.
    pub fn of_covariance(
        point: SVector<f64, P>,
        covariance: &SMatrix<f64, P, P>,
        magnitudes: SVector<f64, P>,
    ) -> Result<Self, EstimatorError> {
        let refused = |what, index, value| Err(EstimatorError::Refused { what, index, value });
        if let Some(index) = point.iter().position(|x| !x.is_finite()) {
            return refused("estimate", index, point[index]);
        }
        let scaled = SMatrix::<f64, P, P>::from_fn(|i, j| covariance[(i, j)] / (magnitudes[i] * magnitudes[j]));
        for i in 0..P {
            for j in 0..=i {
                let (a, b) = (scaled[(i, j)], scaled[(j, i)]);
                let size = ComplexField::sqrt((scaled[(i, i)] * scaled[(j, j)]).abs());
                if !((a - b).abs() <= 1e-6 * size && a.is_finite()) {
                    return refused("covariance", i * P + j, covariance[(i, j)]);
                }
            }
        }
        let Some(cholesky) = scaled.cholesky() else {
            let worst = (0..P).min_by(|a, b| scaled[(*a, *a)].total_cmp(&scaled[(*b, *b)])).unwrap_or(0);
            return refused("covariance is indefinite, least variance", worst, covariance[(worst, worst)]);
        };
        let mut factor = SMatrix::<f64, P, P>::identity();
        cholesky.l().solve_lower_triangular_mut(&mut factor);
        for (mut column, magnitude) in factor.column_iter_mut().zip(&magnitudes) {
            column /= *magnitude;
        }
        let information = SquareRootInformation::from_square_root(&factor, &(factor * point))?;
        Ok(Self { stated: Some(*covariance), ..Self::of_information(information, magnitudes).at(point) })
    }

    /// The same, of which this much was known before.
    #[must_use]
    pub fn with_prior(self, prior: SquareRootInformation<P>) -> Self {
        Self { prior, ..self }
    }

    /// The same, of whose information this much is noise in the regressors: it makes every direction look a little excited.
    #[must_use]
    pub fn with_noise(self, noise: SMatrix<f64, P, P>) -> Self {
        Self { noise, ..self }
    }

    /// The same, whose observations were so surprising: sum of normalised innovations squared, and of their degrees of freedom.
    #[must_use]
    pub fn with_surprise(self, nis: f64, degrees_of_freedom: usize) -> Self {
        Self { surprise: Some((nis, degrees_of_freedom)), ..self }
    }

    /// Mean of the innovations squared: one where the model holds; none where nobody counted.
    pub fn surprise(&self) -> Option<f64> {
        self.surprise.filter(|(_, freedom)| *freedom > 0).map(|(nis, freedom)| nis / freedom as f64)
    }

    /// The same with another point: of a constraint, of a robust norm.
    #[must_use]
    pub fn at(self, point: SVector<f64, P>) -> Self {
        Self { point: Some(point), ..self }
    }

    /// The estimate; none where directions are free.
    pub fn point(&self) -> Option<&SVector<f64, P>> {
        self.point.as_ref()
    }

    /// Data and prior.
    pub fn information(&self) -> &SquareRootInformation<P> {
        &self.information
    }

    /// Sizes in which directions are compared.
    pub fn magnitudes(&self) -> &SVector<f64, P> {
        &self.magnitudes
    }

    /// Its covariance.
    ///
    /// # Errors
    /// Where directions are free.
    pub fn covariance(&self) -> Result<SMatrix<f64, P, P>, EstimatorError> {
        self.stated.map_or_else(|| Ok(self.information.covariance(&self.magnitudes)?), Ok)
    }

    /// What the data alone say: RᵀR − R₀ᵀR₀ by a Cholesky that leaves free directions free.
    pub fn data(&self) -> Result<SquareRootInformation<P>, EstimatorError> {
        self.without(&SMatrix::zeros())
    }

    /// The part of it that is no noise: what a verdict counts directions by.
    pub fn signal(&self) -> Result<SquareRootInformation<P>, EstimatorError> {
        self.without(&self.noise)
    }

    fn without(&self, noise: &SMatrix<f64, P, P>) -> Result<SquareRootInformation<P>, EstimatorError> {
        let gram = |of: &SquareRootInformation<P>| {
            let factor = of.factor();
            (factor.transpose() * factor, factor.transpose() * of.rhs())
        };
        let ((all, all_rhs), (known, known_rhs)) = (gram(&self.information), gram(&self.prior));
        let m = &self.magnitudes;
        let mut rest =
            SMatrix::<f64, P, P>::from_fn(|i, j| (all[(i, j)] - known[(i, j)] - noise[(i, j)]) * m[i] * m[j]);
        let mut rhs = (all_rhs - known_rhs).component_mul(m);
        let was = SVector::<f64, P>::from_fn(|i, _| all[(i, i)] * m[i] * m[i]);
        let (mut factor, mut z) = (SMatrix::<f64, P, P>::zeros(), SVector::<f64, P>::zeros());
        for k in 0..P {
            if rest[(k, k)] <= ROUNDING * was[k] {
                continue;
            }
            let root = ComplexField::sqrt(rest[(k, k)]);
            let row = SVector::<f64, P>::from_fn(|j, _| if j < k { 0.0 } else { rest[(k, j)] / root });
            z[k] = rhs[k] / root;
            rest -= row * row.transpose();
            rhs -= row * z[k];
            for j in 0..P {
                factor[(k, j)] = row[j] / m[j];
            }
        }
        Ok(SquareRootInformation::from_square_root(&factor, &z)?)
    }

    /// What two independent records say together; a prior that both began with counts once.
    pub fn merge(&self, other: &Self) -> Result<Self, EstimatorError> {
        let mut information = self.data()?;
        information.merge(&other.data()?);
        let mut prior = self.prior;
        if other.prior != self.prior {
            prior.merge(&other.prior);
        }
        information.merge(&prior);
        let merged = Self::of_information(information, self.magnitudes).with_prior(prior);
        Ok(merged.with_noise(self.noise + other.noise))
    }
}
