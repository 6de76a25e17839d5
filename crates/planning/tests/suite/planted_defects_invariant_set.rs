//! Every law of invariant sets catches a deliberately broken set, by name; among them are the two that flew.

use tumble_planning::PlanningError;
use tumble_planning::control::{
    AxisGain, AxisTemplate, ConvexSet, MinimalInvariantSet, Polygon, RakovicSet, Strips, Support, SymmetricBox,
    SymmetricEllipsoid, Zonotope, discrete_lqr,
};
use tumble_planning::laws::{check_invariant_set, check_supports};
use tumble_planning::nalgebra::{Matrix1, Matrix2, RowVector2, Vector2};

const MASS_KG: f64 = 9.58;

fn drift(step_s: f64) -> Matrix2<f64> {
    Matrix2::new(1.0, step_s, 0.0, 1.0)
}

/// Position and velocity that a force of 1 N makes in a step.
fn by_force(step_s: f64) -> Vector2<f64> {
    Vector2::new(0.5 * step_s * step_s, step_s) / MASS_KG
}

/// The regulator of the weights of position, velocity and force, held for a second.
fn regulated(position: f64, velocity: f64, force: f64) -> Matrix2<f64> {
    let weight = Matrix2::from_diagonal(&Vector2::new(position, velocity));
    let (gain, _) = discrete_lqr(&drift(1.0), &by_force(1.0), &weight, &Matrix1::new(force)).unwrap();
    drift(1.0) + by_force(1.0) * gain
}

fn sum_of_two_terms(closed_loop: &Matrix2<f64>, disturbance: &SymmetricBox<2>, alpha: f64) -> Polygon {
    let columns = disturbance.zonotope().0 / (1.0 - alpha).abs();
    let after = closed_loop * columns;
    Polygon::of_generators([columns.column(0), columns.column(1), after.column(0), after.column(1)].map(Into::into))
}

/// What a set that is said to be invariant breaks.
fn broken(closed_loop: &Matrix2<f64>, disturbance: &impl ConvexSet<2>, set: &Polygon) -> Option<&'static str> {
    check_invariant_set(closed_loop, disturbance, set, &set.normals(), 1, 200, 1e-9).err().map(|error| error.law)
}

#[test]
fn the_flown_sum_of_two_terms_is_not_invariant() {
    let disturbance = SymmetricBox(Vector2::new(0.02, 0.002));
    let normals = [Vector2::x(), Vector2::y()];
    // weights; what is left out after two terms; half-widths made of it; how far a step leads out; half-widths needed
    for (weights, alpha, flown, ratio, needed) in [
        ([5.0, 10.0, 2.0], 1.858, [0.0469, 0.00627], 1.638, [0.1047, 0.0266]),
        ([5.0, 2.0, 0.5], 2.69, [0.023, 0.0042], 1.96, [0.074, 0.026]),
    ] {
        let closed_loop = regulated(weights[0], weights[1], weights[2]);
        let refusal = RakovicSet::with_terms(closed_loop, disturbance, &normals, 2);
        let Err(PlanningError::OutOfRange { value, .. }) = refusal else { panic!("{refusal:?}") };
        assert!((value / alpha - 1.0).abs() < 2e-3, "{value}");
        let set = sum_of_two_terms(&closed_loop, &disturbance, value);
        for axis in 0..2 {
            assert!((set.support(&normals[axis]) / flown[axis] - 1.0).abs() < 2e-2, "{}", set.support(&normals[axis]));
            let exact = MinimalInvariantSet::try_new(closed_loop, disturbance).unwrap().support(&normals[axis], 1e-9);
            assert!((exact.upper / needed[axis] - 1.0).abs() < 8e-3, "{exact:?}");
        }
        let found = set.invariance_ratio(&closed_loop, &disturbance);
        assert!((found / ratio - 1.0).abs() < 3e-3, "{found}");
        // it holds the disturbance, and only invariance is missing
        assert_eq!(broken(&closed_loop, &disturbance, &set), Some("the set is invariant"));
        // with as many terms as it takes, nothing is
        let generators =
            RakovicSet::with_terms(closed_loop, disturbance.zonotope(), &normals, 12).unwrap().generators();
        assert_eq!(broken(&closed_loop, &disturbance, &Polygon::of_generators(generators)), None);
    }
}

/// Of the polygon that was stored for when no set could be computed, its half-widths and its largest feedback are known.
fn stored() -> (RowVector2<f64>, Strips<3>) {
    let gain = RowVector2::new(-1.1594, -4.9716);
    let normals = [Vector2::x(), Vector2::y(), gain.transpose()];
    (gain, Strips { normals, bounds: [0.0185, 0.0132, 0.15 - 0.0704] })
}

#[test]
fn the_stored_polygon_is_left_without_any_disturbance() {
    let (gain, largest) = stored();
    let none = SymmetricBox(Vector2::zeros());
    for step_s in [1.0, 0.2] {
        let closed_loop = drift(step_s) + by_force(step_s) * gain;
        // the largest set with these supports
        let polygon = Polygon::of_strips(&largest);
        assert!(polygon.invariance_ratio(&closed_loop, &none) > 1.1);
        assert_eq!(broken(&closed_loop, &none, &polygon), Some("the set is invariant"));

        // and any other: where its feedback is largest it has a point of this triangle, whose corners all leave the box in one and the
        // same step and at the same side, so that every point between them does
        let corners: Vec<_> =
            polygon.vertices().iter().filter(|corner| -(gain * **corner).x > 0.0796 - 1e-12).collect();
        let beyond = Vector2::new(0.0185, 0.0132);
        assert!(corners.len() == 2 && -(gain * beyond).x > 0.0796);
        let mut points = [*corners[0], *corners[1], beyond];
        let leaves_together = (0..40).any(|_| {
            points = points.map(|point| closed_loop * point);
            points.iter().all(|point| point.x > 1.05 * 0.0185)
        });
        assert!(leaves_together, "{step_s}");
    }
}

#[test]
fn sets_that_are_nearly_invariant_are_caught() {
    let gain = AxisGain::default();
    let disturbance = SymmetricBox(Vector2::new(1e-4, 2e-4));
    let template = AxisTemplate::try_new(gain, &disturbance).unwrap();
    let closed_loop = gain.closed_loop();
    let check = |closed_loop: &Matrix2<f64>, set: &dyn Fn(&Vector2<f64>) -> f64| {
        struct Set<'a>(&'a dyn Fn(&Vector2<f64>) -> f64);
        impl ConvexSet<2> for Set<'_> {
            fn support(&self, direction: &Vector2<f64>) -> f64 {
                (self.0)(direction)
            }
        }
        let outcome = check_invariant_set(closed_loop, &disturbance, &Set(set), &template.normals, 1, 100, 1e-12);
        outcome.err().map(|error| error.law)
    };
    let sound = template.set(0.0);
    assert_eq!(check(&closed_loop, &|d| sound.support(d)), None);
    assert_eq!(check(&closed_loop, &|d| sound.support(d) * (1.0 - 3e-9)), Some("the set is invariant"));
    // decided at another rate
    let slower = AxisGain { step_s: 1.0, ..gain }.closed_loop();
    assert_eq!(check(&slower, &|d| sound.support(d)), Some("the set is invariant"));
    // round, and as wide along the axes
    let semi_axes = Vector2::new(template.unmatched[2], template.unmatched[3]);
    let round = SymmetricEllipsoid(Matrix2::from_diagonal(&semi_axes.component_mul(&semi_axes)));
    assert_eq!(check(&closed_loop, &|d| round.support(d)), Some("the set is invariant"));
    assert_eq!(check(&closed_loop, &|d| 0.5 * disturbance.support(d)), Some("the set contains the disturbance"));
    assert_eq!(check(&closed_loop, &|d| d.x), Some("supports are finite and not negative"));
    assert_eq!(check(&closed_loop, &|_| f64::INFINITY), Some("supports are finite and not negative"));
}

#[test]
fn supports_that_promise_too_much_are_caught() {
    let closed_loop = AxisGain::default().closed_loop();
    let disturbance = Zonotope(AxisGain::default().input());
    let set = MinimalInvariantSet::try_new(closed_loop, disturbance).unwrap();
    let directions = [Vector2::x(), Vector2::y(), Vector2::new(-0.3, 1.0)];
    let check = |support: &dyn Fn(&Vector2<f64>, f64) -> Support| {
        let outcome = check_supports(&closed_loop, &disturbance, &|d, t| support(d, t), &directions, 1e-6);
        outcome.err().map(|error| error.law)
    };
    let sound = |d: &Vector2<f64>, tolerance| set.support(d, tolerance);
    assert_eq!(check(&sound), None);
    let swapped = |d: &Vector2<f64>, tolerance| {
        let Support { upper, lower, terms } = sound(d, tolerance);
        Support { upper: lower, lower: upper, terms }
    };
    assert_eq!(check(&swapped), Some("supports are two-sided"));
    assert_eq!(check(&|d, tolerance| sound(d, 100.0 * tolerance)), Some("the gap is as asked"));
    // the tail forgotten
    let partial = |d: &Vector2<f64>, tolerance| {
        let found = sound(d, tolerance);
        Support { upper: found.lower, ..found }
    };
    assert_eq!(check(&partial), Some("the sum of the definition lies between"));
    let absolute = |d: &Vector2<f64>, tolerance| {
        let found = sound(d, 0.1 * tolerance);
        Support { upper: found.upper + 1e-8, ..found }
    };
    assert_eq!(check(&absolute), Some("twice the direction is twice the support"));
}
