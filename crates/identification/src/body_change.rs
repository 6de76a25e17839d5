//! Whether one body explains a whole record: what a later part says against what the rest says.

use crate::statistics::chi_square_quantile;
use nalgebra::{SMatrix, SVector};

type Matrix10 = SMatrix<f64, 10, 10>;
type Vector10 = SVector<f64, 10>;

/// Chance of a false alarm at one cut.
const FALSE_ALARM: f64 = 1e-8;
/// A direction is compared where both sides hold at least this share of its information.
const SHARED: f64 = 0.02;
/// Places at which a record is cut.
pub(crate) const CUTS: usize = 48;

/// A quadratic `d^T information d / 2 - gradient^T d` in steps of the ten parameters.
#[derive(Clone, Copy)]
pub(crate) struct Quadratic {
    pub(crate) information: Matrix10,
    pub(crate) gradient: Vector10,
}

/// The cut whose two sides differ most, beyond chance.
pub(crate) struct Cut<I> {
    pub(crate) place: I,
    /// Steps to what each side asks for.
    pub(crate) before: Vector10,
    pub(crate) after: Vector10,
}

/// Compares `parts`, what the record says from each place on, with what is left of `whole`.
///
/// Where one body explains all, the gradient of a part is normal with the covariance B - B I⁻¹ B, with B its information
/// and I that of the whole; variances are `inflation` times as large where rows are correlated. `None` where no cut is
/// beyond chance.
///
/// # Source
/// The Lagrange multiplier test for a change at an unknown time: Andrews (1993), as the difference of an efficient and an
/// inefficient estimate: Hausman (1978).
pub(crate) fn likeliest_cut<I>(
    whole: &Quadratic,
    parts: impl Iterator<Item = (I, Quadratic)>,
    inflation: f64,
) -> Option<Cut<I>> {
    let unit = Matrix10::from_diagonal(&whole.information.diagonal().map(|value| 1.0 / value.sqrt()));
    let lower = (unit * whole.information * unit).cholesky()?.l();
    // Steps in which the information of the whole is the identity.
    let whiten = lower.solve_lower_triangular(&unit)?;
    let all = whiten * whole.gradient;
    let thresholds: [f64; 11] =
        core::array::from_fn(|freedom| chi_square_quantile(freedom.max(1) as f64, 1.0 - FALSE_ALARM));
    let mut best: Option<(f64, Cut<I>)> = None;
    for (place, part) in parts {
        let eigen = (whiten * part.information * whiten.transpose()).symmetric_eigen();
        let pull = eigen.eigenvectors.transpose() * whiten * part.gradient;
        let total = eigen.eigenvectors.transpose() * all;
        let (mut statistic, mut freedom) = (0.0, 0);
        let (mut before, mut after) = (Vector10::zeros(), Vector10::zeros());
        for i in 0..10 {
            let share = eigen.eigenvalues[i];
            if share > SHARED && share < 1.0 - SHARED {
                let excess = pull[i] - share * total[i];
                statistic += excess * excess / (share * (1.0 - share));
                freedom += 1;
                (before[i], after[i]) = ((total[i] - pull[i]) / (1.0 - share), pull[i] / share);
            }
        }
        let excess = statistic / inflation - thresholds[freedom];
        if freedom > 0 && excess > best.as_ref().map_or(0.0, |(most, _)| *most) {
            let back = whiten.transpose() * eigen.eigenvectors;
            best = Some((excess, Cut { place, before: back * before, after: back * after }));
        }
    }
    best.map(|(_, cut)| cut)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of unit noise about zero or, from `onset` on, about another point; `noise` says how large it is.
    fn cut(onset: usize, jump: f64, noise: f64) -> Option<Cut<usize>> {
        let (mut seed, rows) = (1_u64, 400);
        let mut uniform = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let zero = Quadratic { information: Matrix10::zeros(), gradient: Vector10::zeros() };
        let mut sums = vec![zero];
        for row in (0..rows).rev() {
            let regressor = Vector10::from_fn(|_, _| uniform());
            let error = 3.0_f64.sqrt() * noise * uniform();
            let output = error + if row >= onset { jump * regressor[0] } else { 0.0 };
            let mut sum = sums[sums.len() - 1];
            sum.information += regressor * regressor.transpose();
            sum.gradient += regressor * output;
            sums.push(sum);
        }
        let whole = sums[rows];
        likeliest_cut(&whole, (1..rows).map(|first| (first, sums[rows - first])), 1.0)
    }

    #[test]
    fn a_jump_is_found_where_it_is_and_of_its_size() {
        let found = cut(250, 2.0, 1.0).unwrap();
        assert!(found.place.abs_diff(250) < 20, "{}", found.place);
        let jump = found.after - found.before;
        assert!((jump[0] - 2.0).abs() < 0.6 && jump.rows(1, 9).amax() < 0.6, "{jump}");
    }

    #[test]
    fn nothing_is_found_in_noise() {
        assert!(cut(400, 0.0, 1.0).is_none());
        // Noise of twice the stated size is a change of everything all the time.
        assert!(cut(400, 0.0, 4.0).is_some());
    }
}
