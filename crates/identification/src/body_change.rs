//! Whether one body explains a whole record: what a later part says against what the rest says.

use crate::statistics::chi_square_quantile;
use nalgebra::{SMatrix, SVector};

type Matrix10 = SMatrix<f64, 10, 10>;
type Vector10 = SVector<f64, 10>;

/// Chance of a false alarm at one cut.
const FALSE_ALARM: f64 = 1e-8;
/// A direction is compared where both sides hold at least this share of its information.
const SHARED: f64 = 0.02;
/// Fewer pairs of neighbouring stretches than this say nothing of how well such agree.
const FEWEST_PAIRS: usize = 8;
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
    /// Covariance of `after - before` in the directions that both sides show, widened by the inflation.
    pub(crate) covariance: Matrix10,
}

/// Compares `parts`, what the record says from each place on (the latest place first or last), with what is left of `whole`.
///
/// Where one body explains all, the gradient of a part is normal with the covariance B - B I⁻¹ B, with B its information
/// and I that of the whole. Variances are `inflation` times as large where rows are correlated, and larger where errors of
/// the model make neighbouring stretches of the record disagree more than that: see [`disagreement`]. `None` where no cut
/// is beyond chance.
///
/// # Source
/// The Lagrange multiplier test for a change at an unknown time: Andrews (1993), as the difference of an efficient and an
/// inefficient estimate: Hausman (1978).
pub(crate) fn likeliest_cut<I: Copy>(
    whole: &Quadratic,
    parts: impl Iterator<Item = (I, Quadratic)>,
    inflation: f64,
) -> Option<Cut<I>> {
    let parts: Vec<(I, Quadratic)> = parts.collect();
    let inflation = inflation.max(disagreement(whole, &parts));
    let whiten = Whitened::of(whole)?;
    let thresholds: [f64; 11] =
        core::array::from_fn(|freedom| chi_square_quantile(freedom.max(1) as f64, 1.0 - FALSE_ALARM));
    let mut best: Option<(f64, Cut<I>)> = None;
    for (place, part) in parts {
        let sides = whiten.sides(&part);
        let excess = sides.statistic / inflation - thresholds[sides.freedom];
        if sides.freedom > 0 && excess > best.as_ref().map_or(0.0, |(most, _)| *most) {
            let Sides { back, before, after, variance, .. } = sides;
            let covariance = back * Matrix10::from_diagonal(&(variance * inflation)) * back.transpose();
            best = Some((excess, Cut { place, before: back * before, after: back * after, covariance }));
        }
    }
    best.map(|(_, cut)| cut)
}

/// By how much neighbouring stretches of the record disagree, as a multiple of what chance lets them.
///
/// Coloured noise and errors of the model make any two stretches disagree; a change of the body only those on its two
/// sides. Pairs of stretches of several lengths are compared; the median over the pairs of one length hardly feels a
/// change or two, and the largest of these medians counts.
fn disagreement<I>(whole: &Quadratic, parts: &[(I, Quadratic)]) -> f64 {
    // Tails of the record from the shortest to the whole.
    let mut tails: Vec<&Quadratic> = parts.iter().map(|(_, part)| part).collect();
    if tails.first().zip(tails.last()).is_some_and(|(a, b)| a.information.trace() > b.information.trace()) {
        tails.reverse();
    }
    tails.push(whole);
    let median = |length: usize| {
        let pair = |i: usize| {
            let both = *tails[i] - **tails.get(i.checked_sub(2 * length)?)?;
            let later = *tails[i - length] - *tails[i - 2 * length];
            let sides = Whitened::of(&both)?.sides(&later);
            (sides.freedom > 0).then(|| sides.statistic / chi_square_quantile(sides.freedom as f64, 0.5))
        };
        let mut ratios: Vec<f64> = (2 * length..tails.len()).filter_map(pair).collect();
        let middle = ratios.len() / 2;
        (ratios.len() >= FEWEST_PAIRS).then(|| *ratios.select_nth_unstable_by(middle, f64::total_cmp).1)
    };
    let shortest = tails.len().div_ceil(CUTS);
    [1, 2, 4].into_iter().filter_map(|length| median(length * shortest)).fold(1.0, f64::max)
}

impl core::ops::Sub for Quadratic {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self { information: self.information - other.information, gradient: self.gradient - other.gradient }
    }
}

/// A quadratic in steps in which its information is the identity.
struct Whitened {
    whiten: Matrix10,
    gradient: Vector10,
}

/// A stretch cut in two.
struct Sides {
    /// Squared difference of the two sides in units of its variance, over the directions that both show, and their number.
    statistic: f64,
    freedom: usize,
    /// Steps to what each side asks for and variance of their difference; times `back` in the ten parameters.
    before: Vector10,
    after: Vector10,
    variance: Vector10,
    back: Matrix10,
}

impl Whitened {
    fn of(whole: &Quadratic) -> Option<Self> {
        let unit = Matrix10::from_diagonal(&whole.information.diagonal().map(|value| 1.0 / value.sqrt()));
        let lower = (unit * whole.information * unit).cholesky()?.l();
        let whiten = lower.solve_lower_triangular(&unit)?;
        Some(Self { whiten, gradient: whiten * whole.gradient })
    }

    /// Compares `part` with the rest.
    fn sides(&self, part: &Quadratic) -> Sides {
        let whiten = &self.whiten;
        let eigen = (whiten * part.information * whiten.transpose()).symmetric_eigen();
        let pull = eigen.eigenvectors.transpose() * whiten * part.gradient;
        let total = eigen.eigenvectors.transpose() * self.gradient;
        let (mut statistic, mut freedom) = (0.0, 0);
        let (mut before, mut after, mut variance) = (Vector10::zeros(), Vector10::zeros(), Vector10::zeros());
        for i in 0..10 {
            let share = eigen.eigenvalues[i];
            if share > SHARED && share < 1.0 - SHARED {
                let excess = pull[i] - share * total[i];
                variance[i] = 1.0 / (share * (1.0 - share));
                statistic += excess * excess * variance[i];
                freedom += 1;
                (before[i], after[i]) = ((total[i] - pull[i]) / (1.0 - share), pull[i] / share);
            }
        }
        let back = whiten.transpose() * eigen.eigenvectors;
        Sides { statistic, freedom, before, after, variance, back }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Gaussian;

    /// Rows of unit noise about zero or, from `onset` on, about another point; `noise` says how large it is.
    fn cut(onset: usize, jump: f64, noise: f64) -> Option<Cut<usize>> {
        let (mut dice, rows) = (Gaussian::from_seed(1), 400);
        let mut uniform = || 2.0 * dice.uniform() - 1.0;
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
        // Noise of a multiple of the stated size makes all stretches disagree, and is not a change.
        assert!(cut(400, 0.0, 4.0).is_none());
    }

    #[test]
    fn a_jump_is_found_in_noise_larger_than_stated_and_its_deviation_says_how_well() {
        let found = cut(250, 8.0, 4.0).unwrap();
        let (jump, deviation) = (found.after[0] - found.before[0], found.covariance[(0, 0)].sqrt());
        assert!((jump - 8.0).abs() < 4.0 * deviation, "{jump} {deviation}");
        // Four times the deviation that unit noise leaves: rows of variance 1/3 on both sides of the cut.
        let white = (3.0 / 250.0 + 3.0 / 150.0_f64).sqrt();
        assert!((2.0..8.0).contains(&(deviation / white)), "{deviation} {white}");
    }
}
