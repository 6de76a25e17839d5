//! Pairs of ellipsoids: the exact test, its certificates and the margin, against arithmetic of 106 bits of the tests' own.
#![allow(missing_docs, clippy::unwrap_used)]

use crate::known_gap::{
    Table, Wide, attitude, contact_function, direction, gap_along, holds, known, less, pose, product, solid, study,
    vector, wide_matrix, wide_vector,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_identification::noise::{signed_unit, unit_interval};
use tumble_planning::collision::{Ellipsoid, Plane, Separation, overlap, scaling_margin, separation};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

/// The same solid after a motion of the scene.
fn moved(solid: &Ellipsoid, motion: &Pose<f64>) -> Ellipsoid {
    Ellipsoid::try_new(&(motion * pose(solid)), solid.semi_axes()).unwrap()
}

/// The same solid in another unit of length.
fn in_unit(solid: &Ellipsoid, unit_of_length: f64) -> Ellipsoid {
    let mut scaled = pose(solid);
    scaled.translation.vector *= unit_of_length;
    Ellipsoid::try_new(&scaled, &(solid.semi_axes() * unit_of_length)).unwrap()
}

fn assert_clean(table: &Table, gap: f64) {
    assert_eq!(table.mistakes_from(gap), 0, "{table:?}");
    assert_eq!(table.missed_collisions.iter().sum::<u64>(), 0, "{table:?}");
    assert_eq!((table.wrong_planes, table.wrong_points), (0, 0), "{table:?}");
}

#[test]
fn nothing_is_misclassified_down_to_a_gap_of_1e_12() {
    let table = study(100_000, 30.0, 100.0, 1, separation);
    assert_clean(&table, 1e-12);
    assert!(table.unknown < 1000, "{table:?}");
    assert!(table.pairs[1..=12].iter().all(|pairs| *pairs > 1000), "{table:?}");
}

#[test]
fn ratios_to_a_thousand() {
    assert_clean(&study(20_000, 1000.0, 1000.0, 2, separation), 1e-12);
}

/// The study sees what it is there to see: the contact function in plain `f64` without error bounds.
#[test]
fn the_study_catches_a_careless_test() {
    let careless = |a: &Ellipsoid, b: &Ellipsoid| {
        let between = b.center() - a.center();
        let shape = |solid: &Ellipsoid| solid.factor() * solid.factor().transpose();
        let mut share = 0.5;
        let mut normal = between;
        for _ in 0..100 {
            let matrix = shape(a) * (1.0 - share) + shape(b) * share;
            normal = matrix.try_inverse().unwrap() * between;
            let (reach_a, reach_b) = (a.support(&normal), b.support(&normal));
            share = 0.5 * share + 0.5 * reach_a / (reach_a + reach_b);
        }
        if share * (1.0 - share) * normal.dot(&between) > 1.0 {
            Separation::Apart(Plane { normal, offset: 0.0 })
        } else {
            Separation::Overlapping(*a.center())
        }
    };
    let table = study(4_000, 30.0, 100.0, 3, careless);
    assert!(table.mistakes_from(1e-12) > 0, "{table:?}");
    assert!(table.missed_collisions.iter().sum::<u64>() > 0 && table.wrong_points > 0, "{table:?}");
}

/// Pairs that were not constructed, against the contact function by its definition.
#[test]
fn random_pairs_agree_with_the_definition() {
    let mut generator = ChaCha8Rng::seed_from_u64(4);
    let (mut apart, mut overlapping) = (0, 0);
    for _ in 0..1000 {
        let a = solid(&mut generator, Vector3::zeros(), 1.0, 30.0);
        let size = 10.0_f64.powf(2.0 * unit_interval(&mut generator) - 1.0);
        let center = direction(&mut generator) * (unit_interval(&mut generator) * (1.0 + size));
        let b = solid(&mut generator, center, size, 30.0);
        let value = contact_function(&wide_matrix(a.factor()), &wide_matrix(b.factor()), &wide_vector(&center)).0;
        match separation(&a, &b) {
            Separation::Apart(plane) => {
                assert!(value > 1.0 && gap_along(&a, &b, &plane.normal) > 0.0);
                apart += 1;
            }
            Separation::Overlapping(point) => {
                assert!(value < 1.0 && holds(&a, &point) && holds(&b, &point), "{value}");
                overlapping += 1;
            }
        }
        assert_eq!(overlap(&a, &b), value < 1.0);
        assert_eq!(overlap(&b, &a), value < 1.0);
    }
    assert!(apart > 200 && overlapping > 200, "{apart} {overlapping}");
}

#[test]
fn nested_concentric_equal_and_inwardly_touching_overlap() {
    let mut generator = ChaCha8Rng::seed_from_u64(5);
    for _ in 0..2000 {
        let center = vector(&mut generator) * 10.0;
        let a = solid(&mut generator, center, 1.0, 100.0);
        let concentric = solid(&mut generator, center, 0.3, 100.0);
        // Deep inside, astride the surface, and inside but touching it there.
        let inside = a.factor() * direction(&mut generator);
        let tiny = solid(&mut generator, center + inside * 0.5, 1e-5, 30.0);
        let at_surface = solid(&mut generator, center + inside * 0.999, 1e-4, 1.0);
        let sphere = |at: Vector3<f64>, radius| {
            Ellipsoid::try_new(&Pose::from_parts(at.into(), UnitQuaternion::identity()), &Vector3::repeat(radius))
        };
        let inner = sphere(center + Vector3::x() * 0.75, 0.25).unwrap();
        let outer = sphere(center, 1.0).unwrap();
        for (one, other) in
            [(&a, &a), (&a, &concentric), (&a, &tiny), (&a, &at_surface), (&outer, &inner), (&outer, &outer)]
        {
            for found in [separation(one, other), separation(other, one)] {
                let Separation::Overlapping(point) = found else { panic!("{one:?} {other:?} {found:?}") };
                assert!(holds(one, &point) && holds(other, &point), "{one:?} {other:?} {point:?}");
            }
        }
    }
}

/// Exact contact counts as overlapping; one bit more is apart.
#[test]
fn spheres_on_an_axis_are_decided_to_the_last_bit() {
    let sphere = |x: f64, radius: f64| {
        let pose = Pose::from_parts(Vector3::new(x, 0.0, 0.0).into(), UnitQuaternion::identity());
        Ellipsoid::try_new(&pose, &Vector3::repeat(radius)).unwrap()
    };
    for radius in [0.25, 0.1, 0.7, 3.0] {
        let a = sphere(0.0, 1.0);
        // 1 + radius is rounded; the answer is that of the rounded number, compared exactly.
        let touching = 1.0 + radius;
        let error = (touching - 1.0) - radius;
        assert_eq!(overlap(&a, &sphere(touching, radius)), error <= 0.0, "{radius}");
        assert!(!overlap(&a, &sphere(touching.next_up(), radius)));
        assert!(overlap(&a, &sphere(touching.next_down(), radius)));
    }
}

/// Lengths that no robot has: the answer stays right or on the safe side, and nothing is lost to overflow.
#[test]
fn any_unit_of_length_serves() {
    let mut generator = ChaCha8Rng::seed_from_u64(6);
    for run in 0..2000 {
        let gap = if run % 2 == 0 { 1e-9 } else { -1e-9 };
        let pair = known(&mut generator, 30.0, 100.0, gap);
        for exponent in [-50, -30, -10, 10, 30, 50] {
            let unit_of_length = 2.0_f64.powi(exponent);
            let scaled = |solid: &Ellipsoid| in_unit(solid, unit_of_length);
            assert_eq!(overlap(&scaled(&pair.a), &scaled(&pair.b)), pair.gap < 0.0, "2^{exponent}");
        }
    }
    let ball = |x: f64, radius: f64| {
        let pose = Pose::from_parts(Vector3::new(x, 0.0, 0.0).into(), UnitQuaternion::identity());
        Ellipsoid::try_new(&pose, &Vector3::repeat(radius)).unwrap()
    };
    assert!(!overlap(&ball(-1e20, 1.0), &ball(1e20, 1e19)));
    assert!(!overlap(&ball(0.0, 1e-20), &ball(1.0, 1e-20)));
    assert!(!overlap(&ball(0.0, 1e-20), &ball(1e-19, 1e-20)));
    assert!(overlap(&ball(0.0, 1e-20), &ball(0.0, 1e-20)));
    assert!(overlap(&ball(0.0, 1e20), &ball(9e19, 1e-20)));
}

/// A rigid motion of the scene rounds it, by less than these gaps.
#[test]
fn the_answer_moves_with_the_scene() {
    let mut generator = ChaCha8Rng::seed_from_u64(7);
    for run in 0..2000 {
        let gap = if run % 2 == 0 { 1e-7 } else { -1e-7 };
        let pair = known(&mut generator, 30.0, 100.0, gap);
        let motion = Pose::from_parts(vector(&mut generator).into(), attitude(&mut generator));
        assert_eq!(overlap(&moved(&pair.a, &motion), &moved(&pair.b, &motion)), pair.gap < 0.0);
    }
}

/// `sqrt` of the contact function after a move along the twelve: by definition, in 106 bits.
fn moved_growth(a: &Ellipsoid, b: &Ellipsoid, along: &SVector<f64, 12>, step: f64) -> Wide {
    let turned = |solid: &Ellipsoid, first: usize| {
        let axes = wide_vector(solid.semi_axes());
        let zero = Wide::from(0.0);
        let [x, y, z] = [0, 1, 2].map(|i| Wide::from(step) * along[first + i].into());
        let cross = [[zero, zero - z, y], [z, zero, zero - x], [zero - y, x, zero]];
        // exp to the eighth power of a step below 1e-3.
        let mut turn = wide_matrix(&Matrix3::identity());
        for power in (1..=8).rev() {
            let next = product(&cross, &turn);
            let share = Wide::from(f64::from(power)).reciprocal();
            let one = wide_matrix(&Matrix3::identity());
            turn = [0, 1, 2].map(|i| [0, 1, 2].map(|j| one[i][j] + share * next[i][j]));
        }
        let unstretched = wide_matrix(solid.factor()).map(|row| [0, 1, 2].map(|j| row[j] * axes[j].reciprocal()));
        product(&unstretched, &turn).map(|row| [0, 1, 2].map(|j| row[j] * axes[j]))
    };
    let between = less(&wide_vector(b.center()), &wide_vector(a.center()));
    let between = [0, 1, 2].map(|i| {
        let (of_a, of_b) = (Wide::from(step) * along[i].into(), Wide::from(step) * along[6 + i].into());
        between[i] + (of_b - of_a)
    });
    contact_function(&turned(a, 3), &turned(b, 9), &between).root()
}

/// Value, slope and bend along a line, by central differences of fourth order.
fn differences(a: &Ellipsoid, b: &Ellipsoid, along: &SVector<f64, 12>, step: f64) -> [f64; 3] {
    let [far_left, left, here, right, far_right] =
        [-2.0, -1.0, 0.0, 1.0, 2.0].map(|steps| moved_growth(a, b, along, steps * step));
    let odd = (far_left - far_right) + Wide::from(8.0) * (right - left);
    let even = Wide::from(16.0) * (right + left) - (far_left + far_right) - Wide::from(30.0) * here;
    [(here - Wide::from(1.0)).0, odd.0 / (12.0 * step), even.0 / (12.0 * step * step)]
}

/// How far the margin is from the differences along random lines, in shares of the size of each derivative.
fn margin_error(generator: &mut ChaCha8Rng, a: &Ellipsoid, b: &Ellipsoid, lines: usize, step: f64) -> f64 {
    let margin = scaling_margin(a, b);
    let mut worst: f64 = 0.0;
    for _ in 0..lines {
        let along = SVector::<f64, 12>::from_fn(|_, _| signed_unit(generator));
        let [value, slope, bend] = differences(a, b, &along, step);
        let errors = [
            (margin.value - value) / (1.0 + value),
            (margin.gradient.dot(&along) - slope) / margin.gradient.norm(),
            (along.dot(&(margin.hessian * along)) - bend) / margin.hessian.norm(),
        ];
        worst = errors.iter().fold(worst, |worst, error| worst.max(error.abs()));
    }
    worst
}

/// Quadratic forms along random lines determine the symmetric matrix: far, near contact, deep.
#[test]
fn margin_and_derivatives_agree_with_differences() {
    let mut generator = ChaCha8Rng::seed_from_u64(8);
    for gap in [3.0, 0.3, 1e-3, 1e-9, 0.0, -1e-9, -1e-3, -0.3, -0.9, -0.999] {
        for axis_ratio in [1.0, 3.0, 10.0] {
            let pair = known(&mut generator, axis_ratio, 10.0, gap);
            let error = margin_error(&mut generator, &pair.a, &pair.b, 6, 1e-5 * (1.0 + gap));
            assert!(error < 1e-9, "{error:e} at a gap of {gap} and a ratio of {axis_ratio}");
        }
    }
}

#[test]
fn the_whole_hessian_agrees_with_differences() {
    let mut generator = ChaCha8Rng::seed_from_u64(9);
    let pair = known(&mut generator, 3.0, 2.0, -0.2);
    let margin = scaling_margin(&pair.a, &pair.b);
    assert_eq!(margin.hessian, margin.hessian.transpose());
    let unit_vector = |i: usize| SVector::<f64, 12>::from_fn(|row, _| if row == i { 1.0 } else { 0.0 });
    for i in 0..12 {
        let [_, slope, _] = differences(&pair.a, &pair.b, &unit_vector(i), 1e-5);
        assert!((margin.gradient[i] - slope).abs() < 1e-11, "{i}");
        for j in 0..=i {
            let [_, _, plus] = differences(&pair.a, &pair.b, &(unit_vector(i) + unit_vector(j)), 1e-5);
            let [_, _, minus] = differences(&pair.a, &pair.b, &(unit_vector(i) - unit_vector(j)), 1e-5);
            let mixed = 0.25 * (plus - minus);
            assert!((margin.hessian[(i, j)] - mixed).abs() < 1e-10, "{i} {j}: {} {mixed}", margin.hessian[(i, j)]);
        }
    }
}

/// The signs of the margin and of the exact test are the same where the margin is not rounding.
#[test]
fn the_margin_changes_sign_at_contact() {
    let mut generator = ChaCha8Rng::seed_from_u64(10);
    for run in 0..20_000 {
        let size = 10.0_f64.powf(-10.0 * unit_interval(&mut generator));
        let pair = known(&mut generator, 30.0, 100.0, if run % 2 == 0 { size } else { -size });
        let margin = scaling_margin(&pair.a, &pair.b);
        assert_eq!(margin.value <= 0.0, overlap(&pair.a, &pair.b));
        assert!((margin.value - pair.gap).abs() < 1e-10 * (1.0 + pair.gap), "{} {}", margin.value, pair.gap);
    }
}

#[test]
fn the_margin_knows_neither_order_nor_unit_nor_place() {
    let mut generator = ChaCha8Rng::seed_from_u64(11);
    for run in 0..500 {
        let pair = known(&mut generator, 10.0, 10.0, if run % 2 == 0 { 0.1 } else { -0.6 });
        let margin = scaling_margin(&pair.a, &pair.b);
        let swapped = scaling_margin(&pair.b, &pair.a);
        let other = |i: usize| (i + 6) % 12;
        let swapped_gradient = SVector::<f64, 12>::from_fn(|i, _| swapped.gradient[other(i)]);
        let swapped_hessian = SMatrix::<f64, 12, 12>::from_fn(|i, j| swapped.hessian[(other(i), other(j))]);
        let near = |left: f64, right: f64, size: f64| assert!((left - right).abs() <= 1e-11 * size, "{left} {right}");
        near(margin.value, swapped.value, 1.0);
        near((margin.gradient - swapped_gradient).norm(), 0.0, margin.gradient.norm());
        near((margin.hessian - swapped_hessian).norm(), 0.0, margin.hessian.norm());

        for unit_of_length in [1e-3, 1e3] {
            let scaled = |solid: &Ellipsoid| in_unit(solid, unit_of_length);
            let found = scaling_margin(&scaled(&pair.a), &scaled(&pair.b));
            // Entries by a centre are per length.
            let size = |i: usize| if i % 6 < 3 { unit_of_length } else { 1.0 };
            let gradient = SVector::<f64, 12>::from_fn(|i, _| found.gradient[i] * size(i));
            let hessian = SMatrix::<f64, 12, 12>::from_fn(|i, j| found.hessian[(i, j)] * size(i) * size(j));
            near(margin.value, found.value, 1.0);
            near((margin.gradient - gradient).norm(), 0.0, margin.gradient.norm());
            near((margin.hessian - hessian).norm(), 0.0, margin.hessian.norm());
        }

        let turn = attitude(&mut generator);
        let motion = Pose::from_parts(vector(&mut generator).into(), turn);
        let found = scaling_margin(&moved(&pair.a, &motion), &moved(&pair.b, &motion));
        let mut turned = SMatrix::<f64, 12, 12>::identity();
        for first in [0, 6] {
            turned.fixed_view_mut::<3, 3>(first, first).copy_from(turn.to_rotation_matrix().matrix());
        }
        near(margin.value, found.value, 1.0);
        near((turned * margin.gradient - found.gradient).norm(), 0.0, margin.gradient.norm());
        near((turned * margin.hessian * turned.transpose() - found.hessian).norm(), 0.0, margin.hessian.norm());

        // A motion of the whole scene changes nothing: centres and the moments about the world's origin add up to zero.
        let force: Vector3<f64> = margin.gradient.fixed_rows::<3>(0) + margin.gradient.fixed_rows::<3>(6);
        near(force.norm(), 0.0, margin.gradient.norm());
    }
}

#[test]
fn the_margin_is_finite_to_the_very_centre() {
    let mut generator = ChaCha8Rng::seed_from_u64(12);
    let a = solid(&mut generator, Vector3::zeros(), 1.0, 5.0);
    for exponent in [-1, -10, -50, -59, -61, -70, -100, -150, -160, -170, -300] {
        let b = solid(&mut generator, Vector3::new(0.3, -0.5, 0.8) * 10.0_f64.powi(exponent), 0.5, 5.0);
        let margin = scaling_margin(&a, &b);
        assert!(margin.hessian.iter().chain(&margin.gradient).all(|entry| entry.is_finite()), "1e{exponent}");
        assert!(margin.value >= -1.0 && margin.value < 0.0);
        // A norm of the centres' distance grows along it as fast as it is large.
        let along = margin.gradient.fixed_rows::<3>(6).dot(b.center());
        assert!((along - (margin.value + 1.0)).abs() < 1e-13, "1e{exponent}");
        if exponent >= -50 {
            assert!(margin.gradient.norm() > 0.1);
        }
    }
    let b = solid(&mut generator, Vector3::zeros(), 0.5, 5.0);
    let margin = scaling_margin(&a, &b);
    let derivatives = margin.gradient.amax() + margin.hessian.amax();
    assert!((margin.value + 1.0).abs() + derivatives < f64::MIN_POSITIVE);
}

#[test]
fn margin_of_spheres_is_that_of_their_radii() {
    let sphere = |x: f64, radius: f64| {
        let pose = Pose::from_parts(Vector3::new(x, 0.0, 0.0).into(), UnitQuaternion::identity());
        Ellipsoid::try_new(&pose, &Vector3::repeat(radius)).unwrap()
    };
    let margin = scaling_margin(&sphere(1.0, 0.5), &sphere(4.0, 1.5));
    assert!((margin.value - 0.5).abs() < 1e-15);
    assert!((margin.gradient[0] + 0.5).abs() < 1e-15 && (margin.gradient[6] - 0.5).abs() < 1e-15);
    // |d| / 2 bends across the line of centres by 1 / (2 |d|), and attitudes do nothing.
    assert!((margin.hessian[(7, 7)] - 1.0 / 6.0).abs() < 1e-15 && margin.hessian[(6, 6)].abs() < 1e-15);
    let by_attitudes = margin.hessian.fixed_columns::<3>(3).amax() + margin.hessian.fixed_columns::<3>(9).amax();
    assert!(by_attitudes < f64::MIN_POSITIVE);
}
