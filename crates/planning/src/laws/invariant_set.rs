//! Laws of invariant sets.

use super::{LawViolation, broken_unless, require};
use crate::control::{ConvexSet, Support};
use nalgebra::{SMatrix, SVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_identification::noise::signed_unit;

/// The laws of a set `Z` that errors `e⁺ = A e + w`, `w` in the disturbance `W`, do not leave: in the directions of the normals, both
/// ways, and in `directions` more, drawn with `seed`. For a polytope, its facets' normals suffice.
///
/// "supports are finite and not negative", "the set contains the disturbance", "the set is invariant": `A Z + W` reaches nowhere
/// farther than `Z`, but for a share `tolerance`.
///
/// # Errors
/// The first broken law.
pub fn check_invariant_set<const N: usize>(
    closed_loop: &SMatrix<f64, N, N>,
    disturbance: &impl ConvexSet<N>,
    set: &impl ConvexSet<N>,
    normals: &[SVector<f64, N>],
    seed: u64,
    directions: usize,
    tolerance: f64,
) -> Result<(), LawViolation> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut uniform = || signed_unit(&mut rng);
    // coordinates may have unlike units: in units of the set's width
    let widths = SVector::<f64, N>::from_fn(|axis, _| {
        let mut direction = SVector::<f64, N>::zeros();
        direction[axis] = 1.0;
        set.support(&direction).max(f64::MIN_POSITIVE)
    });
    let drawn: Vec<_> = (0..directions).map(|_| widths.map(|width| uniform() / width)).collect();
    let both_ways = normals.iter().flat_map(|normal| [*normal, -normal]);
    for direction in both_ways.chain(drawn) {
        let (wide, disturbed) = (set.support(&direction), disturbance.support(&direction));
        let law = "supports are finite and not negative";
        let is_support = [wide, disturbed].iter().all(|support| support.is_finite() && *support >= 0.0);
        require(law, &direction, &"supports", &(wide, disturbed), broken_unless(is_support), 0.0)?;
        let excess = |reach: f64| if reach > wide { (reach - wide) / wide } else { 0.0 };
        let law = "the set contains the disturbance";
        require(law, &direction, &wide, &disturbed, excess(disturbed), tolerance)?;
        let after = set.support(&closed_loop.tr_mul(&direction)) + disturbed;
        require("the set is invariant", &direction, &wide, &after, excess(after), tolerance)?;
    }
    Ok(())
}

/// Steps that the sum of the definition is followed for.
const STEPS: usize = 1_000_000;

/// Share of a support that may be lost in rounding.
const ROUNDING: f64 = 1e-12;

/// The laws of supports of `W + A W + A² W + …` with an error asked for, in the given directions.
///
/// "supports are two-sided", "the gap is as asked", "the sum of the definition lies between", "twice the direction is twice the
/// support".
///
/// # Errors
/// The first broken law.
pub fn check_supports<const N: usize>(
    closed_loop: &SMatrix<f64, N, N>,
    disturbance: &impl ConvexSet<N>,
    support: &impl Fn(&SVector<f64, N>, f64) -> Support,
    directions: &[SVector<f64, N>],
    tolerance: f64,
) -> Result<(), LawViolation> {
    for direction in directions {
        let found = support(direction, tolerance);
        let inputs = (direction, tolerance);
        let is_ordered = found.lower >= 0.0 && found.upper >= found.lower && found.upper.is_finite();
        require("supports are two-sided", &inputs, &"lower <= upper", &found, broken_unless(is_ordered), 0.0)?;
        let gap = found.upper - found.lower;
        let allowed = (tolerance + ROUNDING) * found.lower;
        require("the gap is as asked", &inputs, &allowed, &found, gap, allowed)?;
        let (mut sum, mut term) = (0.0, *direction);
        for _ in 0..STEPS {
            sum += disturbance.support(&term);
            term = closed_loop.tr_mul(&term);
            if term.amax() <= 1e-20 * direction.amax() {
                break;
            }
        }
        let outside = (found.lower - sum).max(sum - found.upper);
        let law = "the sum of the definition lies between";
        require(law, &inputs, &sum, &found, outside, ROUNDING * sum)?;
        let twice = support(&(direction * 2.0), tolerance);
        let error = (twice.upper - 2.0 * found.upper).abs().max((twice.lower - 2.0 * found.lower).abs());
        let law = "twice the direction is twice the support";
        require(law, &inputs, &found, &twice, error, ROUNDING * sum)?;
    }
    Ok(())
}
