//! Pairs of ellipsoids: the exact test, its certificates and the margin, against arithmetic of 106 bits of the tests' own.
#![allow(missing_docs)]

mod known_gap;

use known_gap::{
    Table, attitude, contact_function, direction, gap_along, holds, known, solid, study, unit, vector, wide_matrix,
    wide_vector,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_planning::collision::{Ellipsoid, Plane, Separation, overlap, separation};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{UnitQuaternion, Vector3};

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
        let size = 10.0_f64.powf(2.0 * unit(&mut generator) - 1.0);
        let center = direction(&mut generator) * (unit(&mut generator) * (1.0 + size));
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
        for exponent in [-400, -300, -100, -10, 10, 100, 300, 400] {
            let unit_of_length = 2.0_f64.powi(exponent);
            let scaled = |solid: &Ellipsoid| {
                let axes = solid.semi_axes();
                let mut rotation = *solid.factor();
                for (mut column, axis) in rotation.column_iter_mut().zip(axes) {
                    column /= *axis;
                }
                let center = solid.center() * unit_of_length;
                let pose = Pose::from_parts(center.into(), UnitQuaternion::from_matrix(&rotation));
                Ellipsoid::try_new(&pose, &(axes * unit_of_length)).unwrap()
            };
            assert_eq!(overlap(&scaled(&pair.a), &scaled(&pair.b)), pair.gap < 0.0, "2^{exponent}");
        }
    }
    let ball = |x: f64, radius: f64| {
        let pose = Pose::from_parts(Vector3::new(x, 0.0, 0.0).into(), UnitQuaternion::identity());
        Ellipsoid::try_new(&pose, &Vector3::repeat(radius)).unwrap()
    };
    assert!(!overlap(&ball(-1e308, 1.0), &ball(1e308, 1e300)));
    assert!(!overlap(&ball(0.0, 1e-300), &ball(1.0, 1e-300)));
    assert!(!overlap(&ball(0.0, 1e-300), &ball(1e-299, 1e-300)));
    assert!(overlap(&ball(0.0, f64::MIN_POSITIVE), &ball(0.0, f64::MIN_POSITIVE)));
    assert!(overlap(&ball(0.0, f64::MAX), &ball(1e308, 1e-300)));
}

/// A rigid motion of the scene rounds it, by less than these gaps.
#[test]
fn the_answer_moves_with_the_scene() {
    let mut generator = ChaCha8Rng::seed_from_u64(7);
    for run in 0..2000 {
        let gap = if run % 2 == 0 { 1e-7 } else { -1e-7 };
        let pair = known(&mut generator, 30.0, 100.0, gap);
        let motion = Pose::from_parts(vector(&mut generator).into(), attitude(&mut generator));
        let moved = |solid: &Ellipsoid| {
            let axes = solid.semi_axes();
            let mut rotation = *solid.factor();
            for (mut column, axis) in rotation.column_iter_mut().zip(axes) {
                column /= *axis;
            }
            let pose = Pose::from_parts((*solid.center()).into(), UnitQuaternion::from_matrix(&rotation));
            Ellipsoid::try_new(&(motion * pose), axes).unwrap()
        };
        assert_eq!(overlap(&moved(&pair.a), &moved(&pair.b)), pair.gap < 0.0);
    }
}
