//! The tube that takes an error of the mass for a disturbance in a box: what it leaves of the force, and why that is nothing.

use super::riccati::discrete_lqr;
use super::{ConvexSet, MinimalInvariantSet, Polygon, SymmetricBox, Zonotope};
use crate::error::{PlanningError, not_negative, positive};
use nalgebra::{Matrix1, Matrix2, Vector2};

/// How closely supports are computed, as a share of themselves.
const TOLERANCE: f64 = 1e-9;

/// One axis of a body whose error from a nominal motion is fed back as a force, under a disturbance in a box.
///
/// The nominal motion may use the force limit less the largest feedback inside the smallest invariant set. With the box that an
/// unknown mass needs, there is nothing left at half the mass, whatever the gain: a body of mass `m-` planned with mass `m` is
/// disturbed by `b u (m / m- - 1)`, `b` what a force of one does, and a steady one must in the end be cancelled one to one, so
/// that the feedback reaches `u (m / m- - 1)` at least, which is `u` at half the mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdditiveTube {
    gain: Vector2<f64>,
    closed_loop: Matrix2<f64>,
    disturbance: SymmetricBox<2>,
    force_limit_n: f64,
}

/// The motion of a body over a step, and what a force of one newton adds.
pub(super) fn force_model(mass_kg: f64, step_s: f64) -> (Matrix2<f64>, Vector2<f64>) {
    let input = Vector2::new(0.5 * step_s * step_s / mass_kg, step_s / mass_kg);
    (Matrix2::new(1.0, step_s, 0.0, 1.0), input)
}

/// Force per error of position (N/m) and velocity (N s/m) that costs least in the long run by these weights of position, velocity and
/// force.
///
/// # Errors
/// A mass, step or weight that is not positive.
pub fn force_gain(mass_kg: f64, step_s: f64, weights: [f64; 3]) -> Result<Vector2<f64>, PlanningError> {
    positive("the mass", mass_kg)?;
    positive("the step of a tube", step_s)?;
    let [position, velocity, force] = weights;
    for weight in weights {
        positive("a weight of a feedback", weight)?;
    }
    let (a, b) = force_model(mass_kg, step_s);
    let state = Matrix2::from_diagonal(&Vector2::new(position, velocity));
    Ok(discrete_lqr(&a, &b, &state, &Matrix1::new(force))?.0.transpose())
}

/// The box that holds what the largest force does in a step to a body of another mass and not to one of this.
///
/// # Errors
/// A number that is not positive.
pub fn mass_disturbance(
    mass_kg: f64,
    other_kg: f64,
    step_s: f64,
    force_limit_n: f64,
) -> Result<SymmetricBox<2>, PlanningError> {
    for (what, value) in [("the mass", mass_kg), ("the other mass", other_kg), ("the step of a tube", step_s)] {
        positive(what, value)?;
    }
    positive("the force limit", force_limit_n)?;
    let apart = force_limit_n * (1.0 / other_kg - 1.0 / mass_kg).abs();
    Ok(SymmetricBox(Vector2::new(0.5 * step_s * step_s, step_s) * apart))
}

impl AdditiveTube {
    /// For a body of this mass with this feedback (N/m, N s/m; negative) every `step_s`.
    ///
    /// # Errors
    /// [`PlanningError::NotContractive`]; a number that is not positive, or a width that is negative.
    pub fn try_new(
        mass_kg: f64,
        step_s: f64,
        gain: Vector2<f64>,
        disturbance: SymmetricBox<2>,
        force_limit_n: f64,
    ) -> Result<Self, PlanningError> {
        positive("the mass", mass_kg)?;
        positive("the step of a tube", step_s)?;
        positive("the force limit", force_limit_n)?;
        for width in &disturbance.0 {
            not_negative("a width of a disturbance", *width)?;
        }
        let (a, b) = force_model(mass_kg, step_s);
        let closed_loop = a + b * gain.transpose();
        MinimalInvariantSet::try_new(closed_loop, disturbance)?;
        Ok(Self { gain, closed_loop, disturbance, force_limit_n })
    }

    /// Force per error of position (N/m) and velocity (N s/m).
    pub fn gain(&self) -> &Vector2<f64> {
        &self.gain
    }

    /// What an error becomes in a step.
    pub fn closed_loop(&self) -> &Matrix2<f64> {
        &self.closed_loop
    }

    /// What is added to an error in a step.
    pub fn disturbance(&self) -> &SymmetricBox<2> {
        &self.disturbance
    }

    /// Largest errors of position (m) and velocity (m/s), certainly not exceeded.
    ///
    /// # Errors
    /// Those of [`MinimalInvariantSet::try_new`], which [`Self::try_new`] has seen.
    pub fn largest_errors(&self) -> Result<Vector2<f64>, PlanningError> {
        let set = MinimalInvariantSet::try_new(self.closed_loop, self.disturbance)?;
        Ok(set.supports(&Matrix2::identity(), TOLERANCE))
    }

    /// What is left of the force for the nominal motion, N; where it is not positive, there is no tube.
    ///
    /// # Errors
    /// Those of [`MinimalInvariantSet::try_new`], which [`Self::try_new`] has seen.
    pub fn force_left_n(&self) -> Result<f64, PlanningError> {
        let set = MinimalInvariantSet::try_new(self.closed_loop, self.disturbance)?;
        Ok(self.force_limit_n - set.support(&self.gain, TOLERANCE).upper)
    }

    /// The sum of the first terms of the smallest invariant set, divided by `|1 - alpha|` whether or not `alpha` is below one.
    pub fn truncated(&self, terms: usize) -> TruncatedSet {
        let mut generators = Vec::with_capacity(2 * terms);
        let mut columns = Zonotope::<2, 2>(self.disturbance.zonotope().0);
        for _ in 0..terms {
            generators.extend([columns.0.column(0).into_owned(), columns.0.column(1).into_owned()]);
            columns.0 = self.closed_loop * columns.0;
        }
        // the least alpha with A^terms W inside alpha W
        let reach = Vector2::new(columns.support(&Vector2::x()), columns.support(&Vector2::y()));
        let alpha = reach.component_div(&self.disturbance.0).max();
        for generator in &mut generators {
            *generator /= (1.0 - alpha).abs();
        }
        TruncatedSet { alpha, generators }
    }

    /// What a set of errors leaves of the force, N.
    pub fn force_left_by_n(&self, errors: &impl ConvexSet<2>) -> f64 {
        self.force_limit_n - errors.support(&self.gain)
    }
}

/// A sum of few terms, which is invariant only where `alpha` is below one.
#[derive(Clone, Debug, PartialEq)]
pub struct TruncatedSet {
    /// Share of the disturbance that what is left out would fit into.
    pub alpha: f64,
    /// Position (m) and velocity (m/s); the set is the sum of each taken from minus once to plus once.
    pub generators: Vec<Vector2<f64>>,
}

impl TruncatedSet {
    /// By its corners.
    pub fn polygon(&self) -> Polygon {
        Polygon::of_generators(self.generators.iter().copied())
    }
}

impl ConvexSet<2> for TruncatedSet {
    fn support(&self, direction: &Vector2<f64>) -> f64 {
        self.generators.iter().map(|generator| generator.dot(direction).abs()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_half_the_mass_no_gain_leaves_any_force() {
        let (mass_kg, limit) = (9.58, 0.15);
        let mut tried = 0;
        for i in 1..40 {
            for j in 1..40 {
                for step_s in [0.2, 1.0] {
                    let gain = -Vector2::new(0.2 * f64::from(i), 0.5 * f64::from(j)) / step_s;
                    let disturbance = mass_disturbance(mass_kg, 0.5 * mass_kg, step_s, limit).unwrap();
                    let Ok(tube) = AdditiveTube::try_new(mass_kg, step_s, gain, disturbance, limit) else { continue };
                    tried += 1;
                    assert!(tube.force_left_n().unwrap() <= 1e-9, "{gain} {step_s}");
                }
            }
        }
        assert!(tried > 1000, "{tried}");
    }

    #[test]
    fn the_share_left_by_a_mass_interval() {
        // of the two sets of weights, by an independent computation
        let (mass_kg, limit) = (9.58, 0.15);
        for (part, first, second) in [
            (0.1, 0.824, 0.809),
            (0.2, 0.604, 0.571),
            (0.3, 0.321, 0.265),
            (0.4, -0.056, -0.144),
            (0.5, -0.584, -0.716),
        ] {
            for (weights, expected) in [([5.0, 10.0, 2.0], first), ([5.0, 2.0, 0.5], second)] {
                let gain = force_gain(mass_kg, 1.0, weights).unwrap();
                let disturbance = mass_disturbance(mass_kg, (1.0 - part) * mass_kg, 1.0, limit).unwrap();
                let tube = AdditiveTube::try_new(mass_kg, 1.0, gain, disturbance, limit).unwrap();
                let share = tube.force_left_n().unwrap() / limit;
                assert!((share - expected).abs() < 5.1e-4, "{part} {weights:?}: {share}");
            }
        }
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let nothing = SymmetricBox(Vector2::zeros());
        let gain = Vector2::new(-1.0, -5.0);
        assert!(AdditiveTube::try_new(9.58, 1.0, gain, nothing, 0.15).is_ok());
        assert!(AdditiveTube::try_new(9.58, 1.0, -gain, nothing, 0.15).is_err());
        assert!(AdditiveTube::try_new(9.58, 1.0, gain, SymmetricBox(Vector2::new(-1.0, 0.0)), 0.15).is_err());
        for number in [0.0, -1.0, f64::NAN] {
            assert!(AdditiveTube::try_new(number, 1.0, gain, nothing, 0.15).is_err());
            assert!(AdditiveTube::try_new(9.58, 1.0, gain, nothing, number).is_err());
            assert!(force_gain(number, 1.0, [1.0; 3]).is_err() && force_gain(1.0, 1.0, [1.0, 1.0, number]).is_err());
            assert!(mass_disturbance(1.0, number, 1.0, 0.1).is_err());
        }
    }
}
