//! What is known of some parameters.

use super::EstimatorError;
use crate::SquareRootInformation;
use crate::error::IdentificationError;
use crate::jacobi::{singular_values, symmetric_eigen};
use nalgebra::{ComplexField, SMatrix, SVector};

/// What is left of a direction after prior and noise is rounding below this share of it.
const ROUNDING: f64 = 1e-11;

/// What an estimator knows: information in units of one standard deviation, singular where directions are free; the part of
/// it that was known before; and the point reported, where there is one.
///
/// # Shape
/// `P` parameters in the units of the estimator; information in one over these units.
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

/// Asymmetry of a covariance, by the deviations of its two components, that is still rounding.
const SYMMETRIC: f64 = 1e-8;

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
        let deviation = covariance.diagonal().map(|variance| ComplexField::sqrt(variance.max(0.0)));
        if let Some(index) = (0..P).find(|i| !(deviation[*i] > 0.0 && deviation[*i].is_finite())) {
            return refused("covariance", index * P + index, covariance[(index, index)]);
        }
        let correlation = SMatrix::<f64, P, P>::from_fn(|i, j| covariance[(i, j)] / (deviation[i] * deviation[j]));
        for i in 0..P {
            for j in 0..i {
                let (a, b) = (correlation[(i, j)], correlation[(j, i)]);
                let apart = (a - b).abs();
                if apart.is_nan() || apart > SYMMETRIC {
                    return refused("covariance", i * P + j, covariance[(i, j)]);
                }
            }
        }
        let (values, axes) = symmetric_eigen(correlation);
        let (least, most) = (values.imin(), values.max());
        if values[least].is_nan() || values[least] < -SYMMETRIC {
            return refused("covariance is indefinite, least eigenvalue", axes.column(least).iamax(), values[least]);
        }
        let mut factor = SMatrix::<f64, P, P>::zeros();
        for i in 0..P {
            let root = 1.0 / ComplexField::sqrt(values[i].max(f64::EPSILON * most));
            factor.set_row(i, &(axes.column(i) * root).component_div(&deviation).transpose());
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

    /// Sums of the normalised innovations squared and of their degrees of freedom, where they were counted.
    pub fn surprises(&self) -> Option<(f64, usize)> {
        self.surprise
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
    pub fn covariance(&self) -> Result<SMatrix<f64, P, P>, IdentificationError> {
        self.stated.map_or_else(|| self.information.covariance(&self.magnitudes), Ok)
    }

    /// What the data alone say: RᵀR − R₀ᵀR₀ by a Cholesky that leaves free directions free.
    pub fn data(&self) -> Result<SquareRootInformation<P>, IdentificationError> {
        self.without(&SMatrix::zeros())
    }

    /// The part of it that is no noise: what a verdict counts directions by.
    pub fn signal(&self) -> Result<SquareRootInformation<P>, IdentificationError> {
        self.without(&self.noise)
    }

    /// RᵀR less prior and noise. The comparison is made along the directions in which the two sides are conjugate, so that neither the
    /// order of parameters nor their units decide what is left; along a direction in which nothing is left the row is zero.
    fn without(&self, noise: &SMatrix<f64, P, P>) -> Result<SquareRootInformation<P>, IdentificationError> {
        let unit = SMatrix::<f64, P, P>::from_diagonal(&self.magnitudes);
        let (known, everything) = (self.prior.factor() * unit, self.information.factor() * unit);
        let (values, right) = singular_values(everything);
        let weakest = f64::EPSILON * values.max();
        let inverse = values.map(|value| if value > weakest { 1.0 / value } else { 0.0 });
        // Columns in which the whole information is the identity.
        let whitened = right * SMatrix::<f64, P, P>::from_diagonal(&inverse);
        let seen = known * whitened;
        let spent = seen.transpose() * seen + whitened.transpose() * (unit * noise * unit) * whitened;
        let (shares, axes) = symmetric_eigen((spent + spent.transpose()) * 0.5);
        let moment = everything.transpose() * self.information.rhs() - known.transpose() * self.prior.rhs();
        let moment = whitened.transpose() * moment;
        let (mut factor, mut rhs) = (SMatrix::<f64, P, P>::zeros(), SVector::<f64, P>::zeros());
        for i in 0..P {
            let left = 1.0 - shares[i];
            if left <= ROUNDING {
                continue;
            }
            let (root, axis) = (ComplexField::sqrt(left), axes.column(i));
            let row = right * axis.component_mul(&values) * root;
            factor.set_row(i, &row.component_div(&self.magnitudes).transpose());
            rhs[i] = axis.dot(&moment) / root;
        }
        SquareRootInformation::from_square_root(&factor, &rhs)
    }

    /// What two independent records say together; a prior that both began with counts once.
    pub fn merge(&self, other: &Self) -> Result<Self, IdentificationError> {
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
