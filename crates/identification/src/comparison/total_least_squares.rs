//! Least squares where every column is noisy.

use crate::error::IdentificationError;
use crate::jacobi::singular_values;
use crate::square_root_information::{RANK_TOLERANCE, SquareRootInformation};
use nalgebra::{SMatrix, SVector};

/// The parameters for which the smallest change of regressor *and* right-hand side, in units of their noise, makes the rows
/// hold exactly.
///
/// `column_noise` and `output_noise` are the standard deviations of the entries of each column and of the right-hand side, in
/// the units of the rows folded into `information`; only their ratios matter. Consistent where the noise of every entry is
/// independent, which that of a regressor made of poses is not: a method to compare with.
///
/// # Errors
/// [`IdentificationError::NotPositive`] naming the column (`P` for the right-hand side);
/// [`IdentificationError::NotExcited`] where the smallest singular value is not single or the solution lies at infinity.
pub fn total_least_squares<const P: usize, const COLUMNS: usize>(
    information: &SquareRootInformation<P>,
    column_noise: &SVector<f64, P>,
    output_noise: f64,
) -> Result<SVector<f64, P>, IdentificationError> {
    const { assert!(COLUMNS == P + 1, "one column for each parameter and one for the right-hand side") };
    let noise = SVector::<f64, COLUMNS>::from_fn(|i, _| if i < P { column_noise[i] } else { output_noise });
    if let Some((index, &value)) = noise.iter().enumerate().find(|(_, value)| !(value.is_finite() && **value > 0.0)) {
        return Err(IdentificationError::NotPositive { index, value });
    }
    // The triangle of all rows and right-hand sides together.
    let factor = information.factor();
    let stack = SMatrix::<f64, COLUMNS, COLUMNS>::from_fn(|i, j| {
        let entry = match (i < P, j < P) {
            (true, true) => factor[(i, j)],
            (true, false) => information.rhs()[i],
            (false, true) => 0.0,
            (false, false) => information.residual_sum_of_squares().max(0.0).sqrt(),
        };
        entry / noise[j]
    });
    let (values, right) = singular_values(stack);
    let direction = right.column(P);
    let not_excited = IdentificationError::NotExcited {
        rank: P - 1,
        expected: P,
        smallest_singular_value: if values[0] > 0.0 { values[P - 1] / values[0] } else { 0.0 },
    };
    let single = values[P - 1] > RANK_TOLERANCE * values[0] && values[P - 1] > values[P] * (1.0 + RANK_TOLERANCE);
    if !single || direction[P].abs() < RANK_TOLERANCE {
        return Err(not_excited);
    }
    Ok(SVector::from_fn(|i, _| -direction[i] / direction[P] * output_noise / column_noise[i]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Gaussian;

    fn random() -> impl FnMut() -> f64 {
        let mut dice = Gaussian::from_seed(9);
        move || dice.normal()
    }

    #[test]
    fn one_parameter_is_demings_line() {
        // A line through the origin with noise ratio delta = (sigma_y / sigma_x)^2 has this closed form.
        let (x, y) = ([1.0, 2.0, 3.5, 4.0, -1.0], [2.1, 3.7, 7.4, 7.9, -2.3]);
        for (noise_x, noise_y) in [(1.0, 1.0), (0.3, 1.2), (2.0, 0.5)] {
            let mut information = SquareRootInformation::<1>::new();
            for (x, y) in x.iter().zip(y) {
                information.update(&SMatrix::<f64, 1, 1>::new(*x), &SVector::from([y])).unwrap();
            }
            let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let (xx, yy, xy) = (sum(&x, &x), sum(&y, &y), sum(&x, &y));
            let delta = (noise_y / noise_x) * (noise_y / noise_x);
            let difference = yy - delta * xx;
            let expected = (difference + (difference * difference + 4.0 * delta * xy * xy).sqrt()) / (2.0 * xy);
            let found = total_least_squares::<1, 2>(&information, &SVector::from([noise_x]), noise_y).unwrap();
            assert!((found[0] - expected).abs() < 1e-12, "{} {expected}", found[0]);
        }
    }

    #[test]
    fn equals_the_eigenvector_of_the_gram_matrix() {
        let mut noise = random();
        let mut information = SquareRootInformation::<4>::new();
        let mut gram = SMatrix::<f64, 5, 5>::zeros();
        let scale = SVector::from([1.0, 10.0, 0.1, 2.0, 0.5]);
        for _ in 0..30 {
            let row = SMatrix::<f64, 1, 4>::from_fn(|_, _| noise());
            let y = noise();
            information.update(&row, &SVector::from([y])).unwrap();
            let whole = SMatrix::<f64, 1, 5>::from_fn(|_, j| if j < 4 { row[j] } else { y } / scale[j]);
            gram += whole.transpose() * whole;
        }
        let eigen = gram.symmetric_eigen();
        let v = eigen.eigenvectors.column(eigen.eigenvalues.imin());
        let found = total_least_squares::<4, 5>(&information, &scale.fixed_rows::<4>(0).into(), scale[4]).unwrap();
        for i in 0..4 {
            assert!((found[i] + v[i] / v[4] * scale[4] / scale[i]).abs() < 1e-9);
        }
    }

    #[test]
    fn is_consistent_where_least_squares_is_attenuated() {
        let mut noise = random();
        let truth = SVector::from([1.5, -0.7, 0.4]);
        let mut information = SquareRootInformation::<3>::new();
        for k in 0..60_000 {
            let clean = SMatrix::<f64, 1, 3>::from_fn(|_, j| (0.01 * f64::from(k) * (j as f64 + 1.3)).sin());
            let y = (clean * truth)[0] + 0.5 * noise();
            let row = clean.map(|x| x + 0.5 * noise());
            information.update(&row, &SVector::from([y])).unwrap();
        }
        let plain = information.solve(&SVector::repeat(1.0)).unwrap();
        let total = total_least_squares::<3, 4>(&information, &SVector::repeat(0.5), 0.5).unwrap();
        // Attenuation 0.5 / (0.5 + 0.25).
        assert!((plain - truth / 1.5).amax() < 0.02 && (total - truth).amax() < 0.02, "{plain} {total}");
        assert!(matches!(
            total_least_squares::<3, 4>(&information, &SVector::from([0.5, 0.0, 0.5]), 0.5),
            Err(IdentificationError::NotPositive { index: 1, .. })
        ));
        let empty = SquareRootInformation::<3>::new();
        assert!(total_least_squares::<3, 4>(&empty, &SVector::repeat(1.0), 1.0).is_err());
    }
}
