//! Axes of a gyroscope that are not those of the body, and what that makes of an inertia.

use nalgebra::{Matrix3, SMatrix, SVector};

/// Rows and columns of the six moments and products, in the order of
/// [`InertialParameters::to_vector`](crate::dynamics::InertialParameters::to_vector).
const MOMENTS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Constant errors of the axes of a gyroscope, which shows `(1 + E) w` of a rate `w`: standard deviations of the elements of `E`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisErrors {
    /// Of the scale of each axis.
    pub scale: f64,
    /// Of the answer of each axis to each other one, rad.
    pub misalignment: f64,
}

impl AxisErrors {
    /// None.
    pub const NONE: Self = Self { scale: 0.0, misalignment: 0.0 };

    /// Covariance that they make of an inertia (kg m^2, about the centre of mass, body axes), in the order `xx, xy, xz, yy, yz, zz`.
    ///
    /// Torques along all axes alike turn the inertia `I`, and least squares finds the symmetric one that turns so by what the gyroscope shows: to
    /// first order the symmetric part of `I (1 - E)`. An attitude that wanders by several times as much tells next to nothing of `E`, so the
    /// filter has no states for it, and the body is by this less certain than the filter believes.
    ///
    /// ```
    /// use tumble_identification::nalgebra::Matrix3;
    /// use tumble_identification::recursive::AxisErrors;
    /// let axes = AxisErrors { scale: 0.0, misalignment: 1e-3 };
    /// let covariance = axes.of_inertia(&Matrix3::from_diagonal_element(0.2));
    /// // two axes that each see a thousandth of the other one: half of it from either
    /// assert!((covariance[(1, 1)].sqrt() - 0.2 * 1e-3 / 2_f64.sqrt()).abs() < 1e-12);
    /// assert_eq!(covariance[(0, 0)], 0.0);
    /// ```
    pub fn of_inertia(&self, inertia_about_com: &Matrix3<f64>) -> SMatrix<f64, 6, 6> {
        let mut covariance = SMatrix::zeros();
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
            let mut error = Matrix3::zeros();
            error[(i, j)] = if i == j { self.scale } else { self.misalignment };
            let found = inertia_about_com * error;
            let found = (found + found.transpose()) * 0.5;
            let found = SVector::<f64, 6>::from_fn(|k, _| found[MOMENTS[k]]);
            covariance += found * found.transpose();
        }
        covariance
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use nalgebra::Vector3;

    /// Six numbers by least squares from turns about many axes, as a gyroscope with such axes shows them.
    fn found_by_least_squares(inertia: &Matrix3<f64>, shown: &Matrix3<f64>) -> SVector<f64, 6> {
        let (mut normal, mut right) = (SMatrix::<f64, 6, 6>::zeros(), SVector::<f64, 6>::zeros());
        for axis in 0..3 {
            let torque = Vector3::ith(axis, 1.0);
            let turn = shown * inertia.try_inverse().unwrap() * torque;
            for row in 0..3 {
                let regressor = SVector::<f64, 6>::from_fn(|k, _| match MOMENTS[k] {
                    (i, j) if i == row => turn[j],
                    (i, j) if j == row => turn[i],
                    _ => 0.0,
                });
                normal += regressor * regressor.transpose();
                right += regressor * torque[row];
            }
        }
        normal.cholesky().unwrap().solve(&right)
    }

    #[test]
    fn an_inertia_is_off_by_what_least_squares_makes_of_the_axes() {
        let inertia = Matrix3::new(0.20, 0.01, -0.01, 0.01, 0.19, 0.005, -0.01, 0.005, 0.21);
        let axes = AxisErrors { scale: 2e-4, misalignment: 5e-4 };
        let truth = found_by_least_squares(&inertia, &Matrix3::identity());
        let mut expected = SMatrix::<f64, 6, 6>::zeros();
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
            let mut shown = Matrix3::identity();
            shown[(i, j)] += if i == j { axes.scale } else { axes.misalignment };
            let error = found_by_least_squares(&inertia, &shown) - truth;
            expected += error * error.transpose();
        }
        let found = axes.of_inertia(&inertia);
        for k in 0..6 {
            assert!((found[(k, k)] / expected[(k, k)]).sqrt().ln().abs() < 0.1, "{k}: {found} {expected}");
        }
        assert!(AxisErrors::NONE.of_inertia(&inertia).iter().all(|x| *x == 0.0));
    }
}
