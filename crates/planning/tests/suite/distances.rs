//! Distances against algorithms that share nothing with the ones tested.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::float_cmp, clippy::cast_possible_truncation)]

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_dynamics::AlignedBox;
use tumble_identification::noise::between;
use tumble_lie::Pose;
use tumble_lie::nalgebra::{Point3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3, Vector4};
use tumble_planning::collision::{
    Distance, Ellipsoid, HalfSpace, Sphere, distance, distance_from_hint, ellipsoid_to_box, ellipsoid_to_half_space,
    ellipsoid_to_point, ellipsoid_to_sphere, keep_in_complement, sphere_to_box, sphere_to_half_space, sphere_to_sphere,
};

/// Seeded draws.
struct Draws(ChaCha8Rng);

impl Draws {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Uniform in [low, high).
    fn between(&mut self, low: f64, high: f64) -> f64 {
        between(&mut self.0, low, high)
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
            let q = Quaternion::from(Vector4::from_fn(|_, _| self.between(-1.0, 1.0)));
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

/// From centre to centre so that the supporting planes across `normal` are `gap` apart and the support points opposite each
/// other: the distance is `gap` by construction, whatever the shapes.
fn opposite(a: &Ellipsoid, b: &Ellipsoid, normal: &Vector3<f64>, gap: f64) -> Vector3<f64> {
    (a.support_point(normal) - a.center()) - (b.support_point(&-normal) - b.center()) + normal * gap
}

fn moved(body: &Ellipsoid, by: &Vector3<f64>) -> Ellipsoid {
    posed(body, &Pose::from_parts(Translation3::from(*by), UnitQuaternion::identity()), 1.0)
}

/// The body scaled about the origin, then moved. Its axes are recovered from the factor.
fn posed(body: &Ellipsoid, pose: &Pose<f64>, scale: f64) -> Ellipsoid {
    let mut axes = *body.factor();
    for (mut column, length) in axes.column_iter_mut().zip(body.semi_axes()) {
        column /= *length;
    }
    let rotation = UnitQuaternion::from_matrix(&axes);
    let own = Pose::from_parts(Translation3::from(body.center() * scale), rotation);
    Ellipsoid::try_new(&(pose * own), &(body.semi_axes() * scale)).unwrap()
}

fn slab(a: &Ellipsoid, b: &Ellipsoid, n: &Vector3<f64>) -> f64 {
    n.dot(&(b.center() - a.center())) - a.factor().tr_mul(n).norm() - b.factor().tr_mul(n).norm()
}

fn slab_to_box(a: &Ellipsoid, b: &AlignedBox, n: &Vector3<f64>) -> f64 {
    let side = |i: usize| {
        let bound = if n[i] > 0.0 { b.lower_world[i] } else { b.upper_world[i] };
        if n[i] == 0.0 { 0.0 } else { n[i] * (bound - a.center()[i]) }
    };
    side(0) + side(1) + side(2) - a.factor().tr_mul(n).norm()
}

/// The widest slab over a grid of directions, each of the best ones polished by a pattern search.
fn widest(width: impl Fn(&Vector3<f64>) -> f64) -> f64 {
    const COUNT: i32 = 3000;
    let golden = core::f64::consts::PI * (3.0 - 5_f64.sqrt());
    let on_spiral = |i: i32| {
        let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(COUNT);
        let (sin, cos) = (golden * f64::from(i)).sin_cos();
        Vector3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z)
    };
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().flat_map(|axis| [axis, -axis]);
    let mut directions: Vec<(f64, Vector3<f64>)> =
        (0..COUNT).map(on_spiral).chain(axes).map(|direction| (width(&direction), direction)).collect();
    directions.sort_by(|(x, _), (y, _)| y.total_cmp(x));
    let polish = |start: &Vector3<f64>| {
        let (mut n, mut best, mut step) = (*start, width(start), 0.05);
        while step > 1e-8 {
            let first = n.cross(&if n.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() }).normalize();
            let second = n.cross(&first);
            let around = |k: i32| {
                let (sin, cos) = (f64::from(k) * core::f64::consts::FRAC_PI_8).sin_cos();
                (n + (first * cos + second * sin) * step).normalize()
            };
            match (0..16).map(around).find(|trial| width(trial) > best) {
                Some(trial) => (n, best) = (trial, width(&trial)),
                None => step *= 0.5,
            }
        }
        best
    };
    directions.iter().take(10).map(|(_, direction)| polish(direction)).fold(f64::NEG_INFINITY, f64::max)
}

/// A box, each of whose sides is infinite one time in eight.
fn some_box(draws: &mut Draws, center: Vector3<f64>, size: f64) -> AlignedBox {
    let mut b = AlignedBox::between(center, center + draws.vector(size));
    for axis in 0..3 {
        if draws.between(0.0, 1.0) < 0.125 {
            b.lower_world[axis] = f64::NEG_INFINITY;
        }
        if draws.between(0.0, 1.0) < 0.125 {
            b.upper_world[axis] = f64::INFINITY;
        }
    }
    b
}

/// Needles, plates, near and far, alike and unlike in size: the answer is known by construction.
#[test]
fn distances_known_by_construction() {
    let mut draws = Draws::new(1);
    for ratio in [1.5, 10.0, 100.0, 1000.0] {
        for size in [0.01, 1.0, 100.0] {
            for gap in [1e-9, 1e-6, 1e-3, 0.1, 10.0, 1000.0] {
                for _ in 0..30 {
                    let a = draws.ellipsoid(1.0, ratio, Vector3::zeros());
                    let b = draws.ellipsoid(size, ratio, Vector3::zeros());
                    let normal = draws.direction();
                    let b = moved(&b, &opposite(&a, &b, &normal, gap));
                    let found = distance(&a, &b);
                    let scale = 1.0 + size + gap;
                    check_bounds(&found, scale);
                    assert!((found.distance_m - gap).abs() <= 1e-12 * gap + 1e-14 * scale, "{gap} {ratio} {found:?}");
                    assert!(found.lower_bound_m <= gap + 1e-16 * scale, "{gap} {found:?}");
                    let sideways = (normal + draws.vector(0.3)).normalize();
                    let again = distance_from_hint(&a, &b, &sideways);
                    assert!((again.distance_m - gap).abs() <= 1e-12 * gap + 1e-14 * scale, "{gap} {again:?}");
                }
            }
        }
    }
}

#[test]
fn ellipsoids_apart_agree_with_alternating_projections() {
    let mut draws = Draws::new(2);
    let mut apart = 0;
    while apart < 150 {
        let center = draws.vector(2.0);
        let (a, b) = (draws.ellipsoid(1.0, 5.0, Vector3::zeros()), draws.ellipsoid(1.0, 5.0, center));
        let found = distance(&a, &b);
        if found.distance_m <= 0.2 {
            continue;
        }
        apart += 1;
        check_bounds(&found, 4.0);
        let mut on_a = *a.center();
        for _ in 0..400 {
            on_a = project(&a, &project(&b, &on_a));
        }
        let expected = (project(&b, &on_a) - on_a).norm();
        assert!((found.distance_m - expected).abs() < 1e-10 * expected, "{} {expected}", found.distance_m);
    }
}

/// Where the bodies overlap nothing certifies the depth, so it is compared with a dense search.
#[test]
fn depth_is_the_least_translation_apart() {
    let mut draws = Draws::new(3);
    let mut overlapping = 0;
    while overlapping < 60 {
        let (ratio, size) = (draws.between(1.2, 20.0), draws.between(0.3, 5.0));
        let center = draws.vector(size.max(1.0) * 0.7);
        let (a, b) = (draws.ellipsoid(1.0, ratio, Vector3::zeros()), draws.ellipsoid(size, ratio, center));
        let found = distance(&a, &b);
        if found.distance_m > 0.0 {
            continue;
        }
        overlapping += 1;
        let expected = widest(|n| slab(&a, &b, n));
        assert!((found.distance_m - expected).abs() < 1e-9, "{found:?} {expected}");
        let apart = distance(&a, &moved(&b, &(found.normal * (1e-9 - found.lower_bound_m))));
        assert!(apart.lower_bound_m > 0.0, "{apart:?}");
    }
}

/// The law that a moving body relies on: contact is not jumped over.
#[test]
fn a_distance_changes_by_no_more_than_the_motion() {
    let mut draws = Draws::new(4);
    for _ in 0..40 {
        let (a, b) = (draws.ellipsoid(1.0, 8.0, Vector3::zeros()), draws.ellipsoid(1.5, 8.0, Vector3::zeros()));
        let corner = draws.vector(1.0);
        let volume = some_box(&mut draws, corner, 1.5);
        let half_space = HalfSpace { inward: Unit::new_unchecked(draws.direction()), offset_m: 0.3 };
        let ball = Sphere { center: draws.vector(0.5), radius_m: 0.2 };
        let (from, by) = (draws.vector(3.0), draws.vector(3.0));
        let mut before: Option<[f64; 5]> = None;
        for step in 0..200 {
            let at = moved(&a, &(from + by * (f64::from(step) / 100.0)));
            let now = [
                distance(&at, &b).distance_m,
                ellipsoid_to_box(&at, &volume).distance_m,
                ellipsoid_to_half_space(&at, &half_space).distance_m,
                ellipsoid_to_sphere(&at, &ball).distance_m,
                sphere_to_box(&Sphere { center: *at.center(), radius_m: 0.2 }, &volume).distance_m,
            ];
            for (kind, (now, before)) in now.iter().zip(before.iter().flatten()).enumerate() {
                assert!((now - before).abs() <= by.norm() / 100.0 + 1e-9, "{kind}: {before} then {now}");
            }
            before = Some(now);
        }
    }
}

#[test]
fn distances_move_and_scale_with_the_bodies() {
    let mut draws = Draws::new(5);
    for _ in 0..300 {
        let (center, pose) =
            (draws.vector(2.0), Pose::from_parts(Translation3::from(draws.vector(3.0)), draws.rotation()));
        let (a, b) = (draws.ellipsoid(1.0, 10.0, Vector3::zeros()), draws.ellipsoid(1.0, 10.0, center));
        let scale = draws.between(-3.0, 3.0).exp2().powi(3);
        let (there_a, there_b) = (posed(&a, &pose, scale), posed(&b, &pose, scale));
        let (here, there) = (distance(&a, &b), distance(&there_a, &there_b));
        let error = (there.distance_m - scale * here.distance_m).abs();
        assert!(error < 1e-10 * scale + 1e-14, "{scale} {here:?} {there:?}");
        // Any hint, also one from behind or none.
        for hint in [draws.direction(), -here.normal, Vector3::zeros()] {
            let hinted = distance_from_hint(&a, &b, &hint);
            assert!((hinted.distance_m - here.distance_m).abs() < 1e-11, "{here:?} {hinted:?}");
        }
        let swapped = distance(&b, &a);
        assert!((swapped.distance_m - here.distance_m).abs() < 1e-11, "{here:?} {swapped:?}");
        let point = draws.vector(2.0);
        let here = ellipsoid_to_point(&a, &point).distance_m;
        let there = ellipsoid_to_point(&there_a, &(pose * Point3::from(point * scale)).coords).distance_m;
        assert!((there - scale * here).abs() < 1e-11 * scale + 1e-14, "{scale} {here} {there}");
        if here > 1e-3 {
            let swapped = distance(&a, &b).swapped();
            assert_eq!(swapped.normal, -distance(&a, &b).normal);
        }
    }
}

/// From behind two balls the slope vanishes: a search that starts there stays.
#[test]
fn a_hint_from_behind_is_not_believed() {
    let ball = |x: f64| Ellipsoid::try_new(&Pose::translation(x, 0.0, 0.0), &Vector3::repeat(1.0)).unwrap();
    let found = distance_from_hint(&ball(0.0), &ball(4.0), &-Vector3::x());
    assert!((found.distance_m - 2.0).abs() < 1e-15, "{found:?}");
}

/// Scales 1e-3 to 1e3 without a rotation: every answer of every kind.
#[test]
fn no_hidden_length() {
    let mut draws = Draws::new(6);
    for _ in 0..100 {
        let a = draws.ellipsoid(1.0, 10.0, Vector3::zeros());
        let center = draws.vector(1.5);
        let b = some_box(&mut draws, center, 1.0);
        for scale in [1e-3, 1e-1, 1e3] {
            let scaled_a = posed(&a, &Pose::identity(), scale);
            let scaled_b = AlignedBox { lower_world: b.lower_world * scale, upper_world: b.upper_world * scale };
            let (here, there) =
                (ellipsoid_to_box(&a, &b).distance_m, ellipsoid_to_box(&scaled_a, &scaled_b).distance_m);
            assert!(here == there || (there - scale * here).abs() < 1e-12 * scale, "{scale} {here} {there}");
            let (point, to_point) = (center, ellipsoid_to_point(&a, &center).distance_m);
            let there = ellipsoid_to_point(&scaled_a, &(point * scale)).distance_m;
            assert!((there - scale * to_point).abs() < 1e-12 * scale, "{scale} {to_point} {there}");
        }
    }
}

/// Inside and outside, on planes of symmetry, on the medial disc, at the centre, on the surface.
#[test]
fn points_agree_with_the_nearest_of_the_surface() {
    let mut draws = Draws::new(7);
    for case in 0..400 {
        let mut a = draws.ellipsoid(1.0, 6.0, draws_center());
        if case % 5 == 0 {
            let shared = draws.between(0.2, 1.0);
            let axes = Vector3::new(shared, draws.between(0.2, 1.0), shared);
            a = Ellipsoid::try_new(&Pose::identity(), &axes).unwrap();
        }
        let mut local = draws.vector(1.2);
        for axis in 0..3 {
            if draws.between(0.0, 1.0) < 0.4 {
                local[axis] = if draws.between(0.0, 1.0) < 0.5 { 0.0 } else { draws.between(-1e-9, 1e-9) };
            }
        }
        let point = a.center() + a.factor() * local;
        let found = ellipsoid_to_point(&a, &point);
        check_bounds(&found, 3.0);
        let expected = widest(|n| n.dot(&(point - a.center())) - a.factor().tr_mul(n).norm());
        assert!((found.distance_m - expected).abs() < 1e-9, "{local:?} {found:?} {expected}");
        assert_eq!(local.norm_squared() > 1.0, found.distance_m > 0.0, "{local:?}");
        let ball = Sphere { center: point, radius_m: 0.3 };
        assert!((ellipsoid_to_sphere(&a, &ball).distance_m - (found.distance_m - 0.3)).abs() < 1e-15);
        let round = Ellipsoid::try_new(
            &Pose::from_parts(Translation3::from(point), UnitQuaternion::identity()),
            &Vector3::repeat(0.3),
        );
        let as_pair = distance(&a, &round.unwrap()).distance_m;
        assert!((as_pair - (found.distance_m - 0.3)).abs() < 1e-9, "{as_pair} {found:?}");
    }
}

fn draws_center() -> Vector3<f64> {
    Vector3::new(0.4, -0.3, 0.2)
}

#[test]
fn boxes_apart_agree_with_alternating_projections() {
    let mut draws = Draws::new(8);
    let mut apart = 0;
    while apart < 200 {
        let a = draws.ellipsoid(1.0, 6.0, Vector3::zeros());
        let center = draws.vector(2.5);
        let b = some_box(&mut draws, center, 2.0);
        let found = ellipsoid_to_box(&a, &b);
        if found.distance_m <= 0.2 {
            continue;
        }
        apart += 1;
        check_bounds(&found, 6.0);
        let mut on_b = project_on_box(&b, a.center());
        for _ in 0..400 {
            on_b = project_on_box(&b, &project(&a, &on_b));
        }
        let expected = (on_b - project(&a, &on_b)).norm();
        assert!((found.distance_m - expected).abs() < 1e-10 * expected, "{} {expected}", found.distance_m);
    }
}

#[test]
fn depth_in_a_box_is_the_least_translation_apart() {
    let mut draws = Draws::new(9);
    for case in 0..250 {
        let ratio = [1.5, 4.0, 20.0][case % 3];
        let a = draws.ellipsoid(1.0, ratio, Vector3::zeros());
        let (center, size) = (draws.vector(1.0), [0.3, 1.0, 4.0][case / 3 % 3]);
        let b = AlignedBox::between(center, center + draws.vector(size));
        let found = ellipsoid_to_box(&a, &b);
        let expected = widest(|n| slab_to_box(&a, &b, n));
        assert!((found.distance_m - expected).abs() < 1e-7, "{found:?} {expected}");
        assert!(found.lower_bound_m <= found.distance_m);
        let ball = Sphere { center: *a.center(), radius_m: 0.5 };
        let round = Ellipsoid::try_new(&Pose::identity(), &Vector3::repeat(0.5)).unwrap();
        let (by_sphere, by_ellipsoid) = (sphere_to_box(&ball, &b).distance_m, ellipsoid_to_box(&round, &b).distance_m);
        assert!((by_sphere - by_ellipsoid).abs() < 1e-12, "{by_sphere} {by_ellipsoid}");
    }
}

/// A box without any side is everywhere: no translation leads out of it.
#[test]
fn a_box_without_sides_has_no_outside() {
    let everywhere =
        AlignedBox { lower_world: Vector3::repeat(f64::NEG_INFINITY), upper_world: Vector3::repeat(f64::INFINITY) };
    let a = Ellipsoid::try_new(&Pose::identity(), &Vector3::new(1.0, 2.0, 3.0)).unwrap();
    let ball = Sphere { center: Vector3::zeros(), radius_m: 1.0 };
    for found in [ellipsoid_to_box(&a, &everywhere), sphere_to_box(&ball, &everywhere)] {
        assert_eq!((found.distance_m, found.lower_bound_m), (f64::NEG_INFINITY, f64::NEG_INFINITY));
        assert!((found.normal.norm() - 1.0).abs() < 1e-15);
    }
}

#[test]
fn half_spaces_are_boxes_without_end() {
    let mut draws = Draws::new(10);
    for _ in 0..200 {
        let center = draws.vector(2.0);
        let a = draws.ellipsoid(1.0, 6.0, center);
        let offset_m = draws.between(-2.0, 2.0);
        let wall = HalfSpace { inward: Vector3::y_axis(), offset_m };
        let mut b =
            AlignedBox { lower_world: Vector3::repeat(f64::NEG_INFINITY), upper_world: Vector3::repeat(f64::INFINITY) };
        b.lower_world.y = offset_m;
        let (by_wall, by_box) = (ellipsoid_to_half_space(&a, &wall), ellipsoid_to_box(&a, &b));
        check_bounds(&by_wall, 4.0);
        assert!((by_wall.distance_m - by_box.distance_m).abs() < 1e-14, "{by_wall:?} {by_box:?}");
        assert_eq!(by_wall.normal, by_box.normal);
        let ball = Sphere { center, radius_m: 0.2 };
        let gap = sphere_to_half_space(&ball, &wall).distance_m - sphere_to_box(&ball, &b).distance_m;
        assert!(gap.abs() < 1e-14, "{gap}");
        let other = Sphere { center: draws.vector(2.0), radius_m: 0.7 };
        let gap = sphere_to_sphere(&ball, &other).distance_m - ((other.center - center).norm() - 0.9);
        assert!(gap.abs() < 1e-14, "{gap}");
    }
}

#[test]
fn the_complement_of_boxes_is_what_is_outside() {
    let mut draws = Draws::new(11);
    for _ in 0..40 {
        let mut corner = || draws.vector(1.0).map(|x| (x * 6.0).round() / 6.0);
        let boxes: Vec<AlignedBox> = (0..8).map(|_| AlignedBox::between(corner(), corner())).collect();
        let outside = keep_in_complement(&boxes);
        for _ in 0..500 {
            let point = draws.vector(1.3);
            let allowed = boxes.iter().any(|b| in_box(b, &point));
            assert_ne!(allowed, outside.iter().any(|b| in_box(b, &point)), "{point:?} {boxes:?}");
        }
        for far in [1e6, -1e6] {
            assert!(outside.iter().any(|b| in_box(b, &Vector3::new(0.0, far, 0.0))));
        }
    }
}

/// Two rooms whose door frames differ by rounding: no wall stands between them, and a body may straddle both.
#[test]
fn rooms_that_meet_by_rounding_are_one() {
    for gap in [0.0, 2e-7, -2e-7, 1e-16] {
        let rooms = [
            AlignedBox::between(Vector3::zeros(), Vector3::new(1.0, 1.0, 1.0)),
            AlignedBox::between(Vector3::new(1.0 + gap, 1e-9, 0.0), Vector3::new(2.0, 1.0, 1.0)),
        ];
        let outside = keep_in_complement(&rooms);
        let clearance = |center: Vector3<f64>| {
            let ball = Sphere { center, radius_m: 0.4 };
            outside.iter().map(|b| sphere_to_box(&ball, b).distance_m).fold(f64::INFINITY, f64::min)
        };
        for x in 0..=10 {
            let found = clearance(Vector3::new(0.5 + 0.1 * f64::from(x), 0.5, 0.5));
            assert!((found - 0.1).abs() < 1e-6, "{gap} {x} {found}");
        }
        assert!((clearance(Vector3::new(1.0, 1.0, 0.5)) + 0.4).abs() < 1e-6);
    }
    let apart = [
        AlignedBox::between(Vector3::zeros(), Vector3::repeat(1.0)),
        AlignedBox::between(Vector3::new(1.00001, 0.0, 0.0), Vector3::new(2.0, 1.0, 1.0)),
    ];
    let between = Vector3::new(1.000_005, 0.5, 0.5);
    assert!(keep_in_complement(&apart).iter().any(|b| in_box(b, &between)));
    assert_eq!(keep_in_complement(&[]), []);
    let one = AlignedBox::between(Vector3::zeros(), Vector3::repeat(1.0));
    assert_eq!(keep_in_complement(&[one]).len(), 6);
}
