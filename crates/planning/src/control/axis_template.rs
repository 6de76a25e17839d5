//! An invariant set of one axis with few faces, so that it can stand in a quadratic program and be scaled there.

use super::small_matrix::solve;
use super::{ConvexSet, Corrections, Strips, SymmetricBox, Zonotope};
use crate::error::{PlanningError, finite, not_negative, positive};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// Feedback of one axis in units of acceleration: `-stiffness * position - damping * velocity`, held for a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisGain {
    /// 1/s².
    pub stiffness: f64,
    /// 1/s.
    pub damping: f64,
    /// Between two decisions, s.
    pub step_s: f64,
}

/// Well damped at 5 Hz: a stiffer one has a thinner tube and passes on more of the noise.
impl Default for AxisGain {
    fn default() -> Self {
        Self { stiffness: 0.25, damping: 2.0, step_s: 0.2 }
    }
}

impl AxisGain {
    /// Error of position and velocity after a step, of that before.
    pub fn closed_loop(&self) -> Matrix2<f64> {
        Matrix2::new(1.0, self.step_s, 0.0, 1.0) + self.input() * self.feedback().transpose()
    }

    /// Position and velocity that an acceleration of one makes in a step.
    pub fn input(&self) -> Vector2<f64> {
        Vector2::new(0.5 * self.step_s * self.step_s, self.step_s)
    }

    /// The row `K` of the feedback `K e`.
    pub fn feedback(&self) -> Vector2<f64> {
        Vector2::new(-self.stiffness, -self.damping)
    }

    /// What an acceleration of at most 1 m/s² that was not asked for does in a step.
    pub fn matched_disturbance(&self) -> Zonotope<2, 1> {
        Zonotope(self.input())
    }
}

/// Pairs of faces in [`AxisTemplate`].
pub const TEMPLATE_ROWS: usize = 5;

/// Bounds are this much wider than the fixed point, so that invariance holds strictly and rounding cannot spoil it.
const INFLATION: f64 = 1e-9;

/// Rounds of the fixed point; each one's result is invariant, so that the last may be the best so far.
const ROUNDS: usize = 40;

/// Doublings of a sum over all steps: closed loops that take longer than `2^40` of them are refused before.
const DOUBLINGS: usize = 40;

/// Least difference between the two eigenvalues, which then have two eigenvectors.
const LEAST_GAP: f64 = 1e-6;

/// Faces of an error set of one axis, with the bounds that make it invariant.
///
/// For every `scale >= 0` the set `|normals e| <= scale matched + unmatched` is invariant under
/// `e⁺ = A e + b d + w`, `|d| <= scale`, `w` in the disturbance given: it is the sum of the sets of the two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisTemplate {
    /// The gain it is for.
    pub gain: AxisGain,
    /// Unit normals: the two left eigenvectors of the closed loop, position, velocity, feedback.
    pub normals: [Vector2<f64>; TEMPLATE_ROWS],
    /// Bounds along the normals per 1 m/s² of matched disturbance.
    pub matched: [f64; TEMPLATE_ROWS],
    /// Bounds along the normals for the other disturbance.
    pub unmatched: [f64; TEMPLATE_ROWS],
    /// Share of the feedback's acceleration against the other disturbance that plans leave it: all of it, unless that is a probability.
    pub reserved: f64,
}

impl AxisTemplate {
    /// The same for a loop that is closed by an estimate which corrects itself: bounds for the matched disturbance, and beside it so many
    /// deviations of the distance from the plan that the corrections make in the steady state. A probability, and no set that nothing leaves.
    ///
    /// # Errors
    /// Those of [`Self::try_new`]; [`PlanningError::NotPositive`] deviations, a covariance that is none.
    ///
    /// # Source
    /// `X = A X A' + C` with the covariance `C` of the corrections; the bound along `n` is `sigmas sqrt(n' X n)`.
    pub fn with_corrections(gain: AxisGain, corrections: &Corrections) -> Result<Self, PlanningError> {
        let template = Self::try_new(gain, &SymmetricBox(Vector2::zeros()))?;
        let sigmas = positive("the deviations of corrections", corrections.sigmas)?;
        let (mut power, mut settled) = (gain.closed_loop(), corrections.covariance);
        for _ in 0..DOUBLINGS {
            settled += power * settled * power.transpose();
            power *= power;
        }
        let mut unmatched = [0.0; TEMPLATE_ROWS];
        for (bound, normal) in unmatched.iter_mut().zip(&template.normals) {
            let variance = not_negative("the variance of corrections", normal.dot(&(settled * normal)))?;
            *bound = sigmas * f64::sqrt(variance);
        }
        let reserved = not_negative("the share that plans leave the feedback", corrections.reserved)?;
        if reserved > 1.0 {
            let what = "the share that plans leave the feedback";
            return Err(PlanningError::OutOfRange { what, value: reserved, lower: 0.0, upper: 1.0 });
        }
        Ok(Self { unmatched, reserved, ..template })
    }

    /// The least bounds for a gain and a disturbance of position and velocity over a step.
    ///
    /// # Errors
    /// [`PlanningError::NotFinite`], [`PlanningError::NotPositive`] step, [`PlanningError::NotContractive`];
    /// [`PlanningError::Oscillating`] where the closed loop has not two different real eigenvalues: no polygon of few faces is near
    /// to the least set then.
    pub fn try_new(gain: AxisGain, disturbance: &impl ConvexSet<2>) -> Result<Self, PlanningError> {
        finite("the stiffness of an axis", gain.stiffness)?;
        finite("the damping of an axis", gain.damping)?;
        positive("the step of an axis", gain.step_s)?;
        let closed_loop = gain.closed_loop();
        let half_trace = 0.5 * (closed_loop.m11 + closed_loop.m22);
        let half_difference = 0.5 * (closed_loop.m11 - closed_loop.m22);
        let discriminant = half_difference * half_difference + closed_loop.m12 * closed_loop.m21;
        let spectral_radius = if discriminant > 0.0 {
            half_trace.abs() + f64::sqrt(discriminant)
        } else {
            f64::sqrt(closed_loop.determinant().abs())
        };
        if spectral_radius >= 1.0 || spectral_radius.is_nan() {
            return Err(PlanningError::NotContractive { spectral_radius });
        }
        if discriminant <= 0.25 * LEAST_GAP * LEAST_GAP {
            return Err(PlanningError::Oscillating { discriminant });
        }
        let root = f64::sqrt(discriminant);
        let eigenvalues = [half_trace + root, half_trace - root];
        // l'A = s l'; with a21 = 0 there would be the eigenvalue one
        let left = eigenvalues.map(|value| Vector2::new(closed_loop.m21, value - closed_loop.m11));
        let normals = [left[0], left[1], Vector2::x(), Vector2::y(), gain.feedback()].map(unit);
        let faces = Faces::new(&normals, &closed_loop);
        let supports = |set: &dyn Fn(&Vector2<f64>) -> f64| normals.map(|normal| set(&normal).max(set(&-normal)));
        let matched = gain.matched_disturbance();
        let unmatched = supports(&|normal| disturbance.support(normal));
        for support in unmatched {
            finite("the reach of a disturbance", support)?;
        }
        Ok(Self {
            gain,
            normals,
            matched: faces.invariant_bounds(&eigenvalues, &supports(&|normal| matched.support(normal))),
            unmatched: faces.invariant_bounds(&eigenvalues, &unmatched),
            reserved: 1.0,
        })
    }

    /// Bounds along the normals at a scale, m/s², of the matched disturbance.
    pub fn bounds(&self, scale: f64) -> [f64; TEMPLATE_ROWS] {
        core::array::from_fn(|row| scale * self.matched[row] + self.unmatched[row])
    }

    /// The set at a scale, m/s², of the matched disturbance.
    pub fn set(&self, scale: f64) -> Strips<TEMPLATE_ROWS> {
        Strips { normals: self.normals, bounds: self.bounds(scale) }
    }

    /// Largest acceleration of the feedback per 1 m/s² of matched disturbance; never below one.
    pub fn matched_input(&self) -> f64 {
        self.matched[4] * self.feedback_length()
    }

    /// Largest acceleration of the feedback that the other disturbance alone calls for, m/s².
    pub fn unmatched_input(&self) -> f64 {
        self.unmatched[4] * self.feedback_length()
    }

    fn feedback_length(&self) -> f64 {
        f64::sqrt(self.gain.feedback().norm_squared())
    }
}

/// Pairs of faces.
const PAIRS: [(usize, usize); 10] = [(0, 1), (0, 2), (0, 3), (0, 4), (1, 2), (1, 3), (1, 4), (2, 3), (2, 4), (3, 4)];

/// Rows after the eigenvectors.
const OTHERS: usize = TEMPLATE_ROWS - 2;

/// How directions are made of pairs of normals: the support of `|normals e| <= bounds` is the least, over the pairs, of the sum
/// of their bounds times these. (The linear program dual to the support has a solution at a vertex, with two numbers not zero.)
type Shares = [[(f64, f64); PAIRS.len()]; TEMPLATE_ROWS];

struct Faces {
    /// Of the normals.
    own: Shares,
    /// Of the normals a step earlier.
    earlier: Shares,
}

impl Faces {
    fn new(normals: &[Vector2<f64>; TEMPLATE_ROWS], closed_loop: &Matrix2<f64>) -> Self {
        let shares = |direction: &Vector2<f64>| {
            PAIRS.map(|(j, k)| {
                let determinant = normals[j].perp(&normals[k]);
                let share = |x: f64| if determinant == 0.0 { f64::INFINITY } else { (x / determinant).abs() };
                (share(direction.perp(&normals[k])), share(normals[j].perp(direction)))
            })
        };
        let earlier = normals.map(|normal| closed_loop.tr_mul(&normal));
        Self { own: normals.each_ref().map(shares), earlier: earlier.each_ref().map(shares) }
    }

    /// The pair that bounds a direction best, and the bound.
    fn best(shares: &[(f64, f64); PAIRS.len()], bounds: &[f64; TEMPLATE_ROWS]) -> (usize, f64) {
        let mut best = (0, f64::INFINITY);
        for (pair, ((j, k), (of_j, of_k))) in PAIRS.iter().zip(shares).enumerate() {
            let bound = of_j * bounds[*j] + of_k * bounds[*k];
            if bound < best.1 {
                best = (pair, bound);
            }
        }
        best
    }

    /// Least bounds `c` with `c = support(A' normal) + disturbed`, from above: the parallelogram of the eigenvectors is invariant,
    /// and so is each round's result. A round solves for the bounds with the pairs that are best now, and chooses the pairs anew.
    fn invariant_bounds(&self, eigenvalues: &[f64; 2], disturbed: &[f64; TEMPLATE_ROWS]) -> [f64; TEMPLATE_ROWS] {
        let mut bounds = [0.0; TEMPLATE_ROWS];
        for row in 0..2 {
            bounds[row] = disturbed[row] / (1.0 - eigenvalues[row].abs());
        }
        for row in 2..TEMPLATE_ROWS {
            let (of_0, of_1) = self.earlier[row][0];
            bounds[row] = of_0 * bounds[0] + of_1 * bounds[1] + disturbed[row];
        }
        for _ in 0..ROUNDS {
            let next = self.solved(&bounds, disturbed).unwrap_or_else(|| self.stepped(&bounds, disturbed));
            let is_settled = (2..TEMPLATE_ROWS).all(|row| next[row] >= bounds[row] * (1.0 - 1e-15));
            if is_settled {
                break;
            }
            bounds = next;
        }
        self.own.map(|shares| Self::best(&shares, &bounds).1 * (1.0 + INFLATION))
    }

    fn stepped(&self, bounds: &[f64; TEMPLATE_ROWS], disturbed: &[f64; TEMPLATE_ROWS]) -> [f64; TEMPLATE_ROWS] {
        let mut next = *bounds;
        for row in 2..TEMPLATE_ROWS {
            next[row] = bounds[row].min(Self::best(&self.earlier[row], bounds).1 + disturbed[row]);
        }
        next
    }

    /// The bounds with the pairs that are best now, where these are better and invariant.
    fn solved(&self, bounds: &[f64; TEMPLATE_ROWS], disturbed: &[f64; TEMPLATE_ROWS]) -> Option<[f64; TEMPLATE_ROWS]> {
        let (mut matrix, mut right) = (Matrix3::identity(), Vector3::zeros());
        for row in 0..OTHERS {
            let shares = &self.earlier[row + 2];
            let (pair, _) = Self::best(shares, bounds);
            let ((j, k), (of_j, of_k)) = (PAIRS[pair], shares[pair]);
            right[row] = disturbed[row + 2];
            for (face, share) in [(j, of_j), (k, of_k)] {
                if face < 2 {
                    right[row] += share * bounds[face];
                } else {
                    matrix[(row, face - 2)] -= share;
                }
            }
        }
        let solution = solve(matrix, right)?;
        let mut next = *bounds;
        next[2..].copy_from_slice(solution.as_slice());
        let is_better = (2..TEMPLATE_ROWS).all(|row| next[row] <= bounds[row] * (1.0 + 1e-13) && next[row] >= 0.0);
        let is_invariant = (2..TEMPLATE_ROWS)
            .all(|row| Self::best(&self.earlier[row], &next).1 + disturbed[row] <= next[row] * (1.0 + 1e-13));
        (is_better && is_invariant).then_some(next)
    }
}

fn unit(vector: Vector2<f64>) -> Vector2<f64> {
    vector / f64::sqrt(vector.norm_squared())
}

#[cfg(test)]
#[cfg(feature = "testing")]
mod tests {
    use super::*;
    use crate::control::{MinimalInvariantSet, MinkowskiSum, Polygon, SymmetricBox, SymmetricEllipsoid};
    use crate::laws::check_invariant_set;
    use crate::unit_interval;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    const NOISE: SymmetricBox<2> = SymmetricBox(Vector2::new(1e-4, 2e-4));

    /// The fixed point from below, by corners.
    fn upward(template: &AxisTemplate, disturbance: &impl ConvexSet<2>) -> [f64; TEMPLATE_ROWS] {
        let closed_loop = template.gain.closed_loop();
        let set = MinimalInvariantSet::try_new(closed_loop, disturbance).unwrap();
        let mut bounds = template.normals.map(|normal| set.support(&normal, 1e-12).lower);
        loop {
            let polygon = Polygon::of_strips(&Strips { normals: template.normals, bounds });
            let next = template
                .normals
                .map(|normal| polygon.support(&closed_loop.tr_mul(&normal)) + disturbance.support(&normal));
            let is_settled = (0..TEMPLATE_ROWS).all(|row| next[row] <= bounds[row] * (1.0 + 1e-12));
            bounds = core::array::from_fn(|row| next[row].max(bounds[row]));
            if is_settled {
                let polygon = Polygon::of_strips(&Strips { normals: template.normals, bounds });
                return template.normals.map(|normal| polygon.support(&normal));
            }
        }
    }

    fn check(template: &AxisTemplate, noise: &(impl ConvexSet<2> + Copy)) {
        let closed_loop = template.gain.closed_loop();
        for scale in [0.0, 1e-3, 0.02, 5.0] {
            let matched = Zonotope(template.gain.input() * scale);
            let (disturbance, set) = (MinkowskiSum(matched, *noise), template.set(scale));
            check_invariant_set(&closed_loop, &disturbance, &set, &template.normals, 1, 50, 0.0).unwrap();
            let polygon = Polygon::of_strips(&set);
            check_invariant_set(&closed_loop, &disturbance, &polygon, &polygon.normals(), 1, 50, 1e-12).unwrap();
            // it is no larger than what is in it by more than was added on purpose
            for (normal, bound) in template.normals.iter().zip(template.bounds(scale)) {
                assert!(polygon.support(normal) >= bound * (1.0 - 1e-12));
            }
        }
    }

    #[test]
    fn the_default_gain() {
        let template = AxisTemplate::try_new(AxisGain::default(), &NOISE).unwrap();
        assert!((template.matched_input() - 1.1235).abs() < 5e-5, "{}", template.matched_input());
        assert!((template.matched[2] - 4.0).abs() < 5e-3 && (template.matched[3] - 1.0).abs() < 5e-3, "{template:?}");
        let [_, _, position_m, velocity_m_s, _] = template.unmatched;
        assert!((position_m - 7.2e-3).abs() < 5e-5 && (velocity_m_s - 1.4e-3).abs() < 5e-5, "{template:?}");
        let input = upward(&template, &NOISE)[4] * f64::sqrt(template.gain.feedback().norm_squared());
        assert!((template.unmatched_input() / input - 1.0).abs() < 2e-9);
        check(&template, &NOISE);
    }

    #[test]
    fn the_bounds_are_the_least_of_the_iteration_from_below() {
        for (stiffness, damping, step_s) in
            [(0.25, 2.0, 0.2), (0.5, 2.5, 0.2), (1.0, 4.0, 0.2), (0.25, 8.0, 0.2), (0.2, 1.0, 1.0), (0.25, 1.1, 0.05)]
        {
            let gain = AxisGain { stiffness, damping, step_s };
            let round = SymmetricEllipsoid(Matrix2::new(1e-8, -1e-9, -1e-9, 4e-8));
            let template = AxisTemplate::try_new(gain, &round).unwrap();
            for (found, expected) in template.matched.iter().zip(upward(&template, &gain.matched_disturbance())) {
                assert!((found / expected - 1.0).abs() < 2e-9, "{gain:?} {found} {expected}");
            }
            for (found, expected) in template.unmatched.iter().zip(upward(&template, &round)) {
                assert!((found / expected - 1.0).abs() < 2e-9, "{gain:?} {found} {expected}");
            }
            check(&template, &round);
        }
    }

    #[test]
    fn a_disturbance_to_one_side_is_contained() {
        #[derive(Clone, Copy)]
        struct Shifted(SymmetricBox<2>, Vector2<f64>);
        impl ConvexSet<2> for Shifted {
            fn support(&self, direction: &Vector2<f64>) -> f64 {
                self.0.support(direction) + self.1.dot(direction)
            }
        }
        for shift in [Vector2::new(1e-4, -1e-4), Vector2::new(-5e-5, 2e-4)] {
            let shifted = Shifted(NOISE, shift);
            let template = AxisTemplate::try_new(AxisGain::default(), &shifted).unwrap();
            let closed_loop = template.gain.closed_loop();
            check_invariant_set(&closed_loop, &shifted, &template.set(0.0), &template.normals, 1, 50, 0.0).unwrap();
        }
    }

    #[test]
    fn the_first_normals_are_left_eigenvectors() {
        let template = AxisTemplate::try_new(AxisGain::default(), &NOISE).unwrap();
        for normal in &template.normals[..2] {
            let earlier = AxisGain::default().closed_loop().tr_mul(normal);
            assert!(earlier.perp(normal).abs() < 1e-15 && (normal.norm() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn gains_without_a_template_are_refused() {
        let refused = |stiffness, damping, step_s| {
            AxisTemplate::try_new(AxisGain { stiffness, damping, step_s }, &NOISE).unwrap_err()
        };
        assert!(matches!(refused(0.304, 0.786, 0.2), PlanningError::Oscillating { .. }));
        assert!(
            matches!(refused(0.25, -0.1, 0.2), PlanningError::NotContractive { spectral_radius } if spectral_radius > 1.0)
        );
        assert!(matches!(refused(0.0, 2.0, 0.2), PlanningError::NotContractive { .. }));
        assert!(matches!(refused(0.25, 20.0, 0.2), PlanningError::NotContractive { .. }));
        assert!(matches!(refused(0.25, 2.0, 0.0), PlanningError::NotPositive { .. }));
        assert!(matches!(refused(f64::NAN, 2.0, 0.2), PlanningError::NotFinite { .. }));
        let endless = SymmetricBox(Vector2::new(f64::INFINITY, 0.0));
        assert!(matches!(AxisTemplate::try_new(AxisGain::default(), &endless), Err(PlanningError::NotFinite { .. })));
    }

    /// A loop under corrections drawn anew at each decision: along each normal the share beyond two deviations is that of a normal number.
    #[test]
    fn bounds_for_corrections_are_so_many_deviations() {
        const DECISIONS: u32 = 2_000_000;
        let gain = AxisGain::default();
        let covariance = Matrix2::new(6e-9, 2e-9, 2e-9, 7e-9);
        let corrections = Corrections { covariance, sigmas: 2.0, reserved: 0.5 };
        let template = AxisTemplate::with_corrections(gain, &corrections).unwrap();
        let (closed_loop, factor) = (gain.closed_loop(), covariance.cholesky().unwrap().l());
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut normal = || (0..12).map(|_| unit_interval(&mut random)).sum::<f64>() - 6.0;
        let (mut error, mut beyond) = (Vector2::zeros(), [0_u32; TEMPLATE_ROWS]);
        for _ in 0..DECISIONS {
            error = closed_loop * error + factor * Vector2::from_fn(|_, _| normal());
            for ((normal, bound), count) in template.normals.iter().zip(template.unmatched).zip(&mut beyond) {
                *count += u32::from(normal.dot(&error).abs() > bound);
            }
        }
        // errors last for forty decisions, so that so many are fifty thousand looks
        for count in beyond {
            let share = f64::from(count) / f64::from(DECISIONS);
            assert!((share - 0.0455).abs() < 0.004, "{beyond:?}");
        }
        let refused =
            |changed: Corrections| assert!(AxisTemplate::with_corrections(gain, &changed).is_err(), "{changed:?}");
        refused(Corrections { covariance: -covariance, ..corrections });
        refused(Corrections { covariance: covariance * f64::NAN, ..corrections });
        for number in [-1.0, f64::NAN, f64::INFINITY] {
            refused(Corrections { sigmas: number, ..corrections });
            refused(Corrections { reserved: number, ..corrections });
        }
        refused(Corrections { sigmas: 0.0, ..corrections });
        refused(Corrections { reserved: 1.01, ..corrections });
    }

    #[test]
    fn no_disturbance_needs_no_room() {
        let template = AxisTemplate::try_new(AxisGain::default(), &SymmetricBox(Vector2::zeros())).unwrap();
        assert!(template.unmatched.iter().all(|bound| bound.abs() <= 0.0));
    }
}
