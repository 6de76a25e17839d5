//! Distances against algorithms that share nothing with the ones tested.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use tumble_dynamics::AlignedBox;
use tumble_lie::Pose;
use tumble_lie::nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};
use tumble_planning::collision::*;

/// Seeded draws.
struct Draws(ChaCha8Rng);

impl Draws {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Uniform in [low, high).
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.between(-size, size))
    }

    fn direction(&mut self) -> Vector3<f64> {
        loop {
            let v = self.vector(1.0);
            if v.norm() > 0.1 && v.norm() < 1.0 {
                return v.normalize();
            }
        }
    }

    fn rotation(&mut self) -> UnitQuaternion<f64> {
        loop {
            let q = Quaternion::from(nalgebra_vector4(self));
            if q.norm() > 0.1 && q.norm() < 1.0 {
                return UnitQuaternion::from_quaternion(q);
            }
        }
    }

    /// Semi-axes spread over this ratio, the largest about `size`.
    fn ellipsoid(&mut self, size: f64, ratio: f64, center: Vector3<f64>) -> Ellipsoid {
        let semi_axes = Vector3::from_fn(|_, _| size * self.between(-ratio.ln(), 0.0).exp());
        Ellipsoid::try_new(&Pose::from_parts(Translation3::from(center), self.rotation()), &semi_axes).unwrap()
    }
}

fn nalgebra_vector4(draws: &mut Draws) -> tumble_lie::nalgebra::Vector4<f64> {
    tumble_lie::nalgebra::Vector4::from_fn(|_, _| draws.between(-1.0, 1.0))
}

/// Nearest point of a solid ellipsoid by bisection of the secular equation, in its own axes.
fn project(body: &Ellipsoid, point: &Vector3<f64>) -> Vector3<f64> {
    let axes = body.semi_axes();
    let local = body.factor().tr_mul(&(point - body.center())).component_div(axes);
    if local.component_div(axes).norm_squared() <= 1.0 {
        return *point;
    }
    let (mut low, mut high) = (0.0, axes.max() * local.norm());
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        let sum: f64 = (0..3).map(|i| (axes[i] * local[i] / (middle + axes[i] * axes[i])).powi(2)).sum();
        if sum > 1.0 { low = middle } else { high = middle }
    }
    let on = Vector3::from_fn(|i, _| axes[i] * local[i] / (high + axes[i] * axes[i]));
    body.center() + body.factor() * on
}

fn project_on_box(b: &AlignedBox, point: &Vector3<f64>) -> Vector3<f64> {
    point.sup(&b.lower_world).inf(&b.upper_world)
}

fn in_box(b: &AlignedBox, point: &Vector3<f64>) -> bool {
    (0..3).all(|i| b.lower_world[i] <= point[i] && point[i] <= b.upper_world[i])
}

/// Whether a distance is consistent in itself: unit normal, points of the bodies, bounds in order and close.
fn check_bounds(found: &Distance, scale: f64) {
    assert!((found.normal.norm() - 1.0).abs() < 1e-14, "{found:?}");
    assert!(found.lower_bound_m <= found.distance_m, "{found:?}");
    assert!(found.distance_m - found.lower_bound_m <= 1e-10 * found.distance_m.abs() + 1e-13 * scale, "{found:?}");
    if found.distance_m > 0.0 {
        let apart = (found.point_on_b - found.point_on_a).norm();
        assert!((apart - found.distance_m).abs() <= 1e-13 * scale, "{found:?}");
    }
}

#[test]
fn ellipsoids_apart_agree_with_alternating_projections() {
    let mut draws = Draws::new(1);
    let mut apart = 0;
    for _ in 0..2000 {
        let center = draws.vector(2.0);
        let (a, b) = (draws.ellipsoid(1.0, 5.0, Vector3::zeros()), draws.ellipsoid(1.0, 5.0, center));
        let found = distance(&a, &b);
        if found.distance_m <= 0.02 {
            continue;
        }
        apart += 1;
        check_bounds(&found, 4.0);
        let mut on_b = *b.center();
        let mut on_a = project(&a, &on_b);
        for _ in 0..4000 {
            on_b = project(&b, &on_a);
            on_a = project(&a, &on_b);
        }
        let expected = (on_b - on_a).norm();
        assert!((found.distance_m - expected).abs() < 1e-10 * expected, "{} {expected}", found.distance_m);
    }
    assert!(apart > 500, "{apart}");
}

#[test]
fn boxes_apart_agree_with_alternating_projections() {
    let mut draws = Draws::new(2);
    let mut apart = 0;
    for _ in 0..3000 {
        let a = draws.ellipsoid(1.0, 6.0, Vector3::zeros());
        let center = draws.vector(2.5);
        let mut b = AlignedBox::between(center, center + draws.vector(2.0));
        for axis in 0..3 {
            if draws.between(0.0, 1.0) < 0.15 {
                b.lower_world[axis] = f64::NEG_INFINITY;
            }
            if draws.between(0.0, 1.0) < 0.15 {
                b.upper_world[axis] = f64::INFINITY;
            }
        }
        let found = ellipsoid_to_box(&a, &b);
        if found.distance_m <= 0.02 {
            continue;
        }
        apart += 1;
        check_bounds(&found, 6.0);
        let mut on_a = *a.center();
        let mut on_b = project_on_box(&b, &on_a);
        for _ in 0..3000 {
            on_a = project(&a, &on_b);
            on_b = project_on_box(&b, &on_a);
        }
        let expected = (on_b - on_a).norm();
        assert!((found.distance_m - expected).abs() < 1e-9 * expected, "{} {expected}", found.distance_m);
    }
    assert!(apart > 700, "{apart}");
}

#[test]
fn the_complement_of_boxes_is_what_is_outside() {
    let mut draws = Draws::new(3);
    for _ in 0..40 {
        let boxes: Vec<AlignedBox> = (0..8)
            .map(|_| {
                let corner = draws.vector(1.0).map(|x| (x * 6.0).round() / 6.0);
                let opposite = draws.vector(1.0).map(|x| (x * 6.0).round() / 6.0);
                AlignedBox::between(corner, opposite)
            })
            .collect();
        let outside = keep_in_complement(&boxes);
        for _ in 0..500 {
            let point = draws.vector(1.3);
            let allowed = boxes.iter().any(|b| in_box(b, &point));
            assert_ne!(allowed, outside.iter().any(|b| in_box(b, &point)), "{point:?} {boxes:?}");
        }
    }
}
