//! Zero, denormal, huge, infinite and no numbers, in every place where a number goes in: what the fuzz target promises, on
//! random bytes.

use crate::promises::{PROMISES, planning_numbers};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use tumble_planning::collision::{BodyShape, CollisionWorld as _, Ellipsoid, EllipsoidWorld};
use tumble_planning::dynamics::{ObstacleEllipsoid, World};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{Quaternion, Unit, UnitQuaternion, Vector3};
use tumble_planning::steering::slew;
use tumble_planning::{BodyArc, PlanningError, TranslationState};

/// Inputs of each promise, each of which asks about ten things: 10 000, or what the environment's `HOSTILE_INPUTS` says.
fn runs() -> u64 {
    std::env::var("HOSTILE_INPUTS").ok().and_then(|text| text.parse().ok()).unwrap_or(10_000)
}

fn random_bytes_keep_the_promise(promise: fn(&[u8]), runs: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut bytes = [0; 600];
    for run in 0..runs {
        random.fill_bytes(&mut bytes);
        // Inputs with few special numbers pass the checks more often.
        let rarity = random.next_u32() % 4;
        for byte in &mut bytes {
            let is_special = *byte < 40;
            if is_special && rarity > 0 && !u32::from(*byte).is_multiple_of(8 * rarity) {
                *byte += 40;
            }
        }
        let is_kept = std::panic::catch_unwind(|| promise(&bytes)).is_ok();
        assert!(is_kept, "run {run} breaks the promise; its bytes are a seed for the fuzz target: {bytes:?}");
    }
}

/// The seeds of the fuzz target, and whatever a fuzzer found once.
fn seeds() -> Vec<Vec<u8>> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/seeds/planning");
    std::fs::read_dir(folder).unwrap().map(|file| std::fs::read(file.unwrap().path()).unwrap()).collect()
}

#[test]
fn every_seed_keeps_the_promise() {
    assert!(seeds().len() >= PROMISES.len());
    seeds().iter().for_each(|seed| planning_numbers(seed));
}

/// Cut at every byte, and with every byte replaced.
#[test]
fn damaged_seeds_keep_the_promise() {
    for mut seed in seeds() {
        seed.truncate(2000);
        for at in 0..seed.len() {
            planning_numbers(&seed[..at]);
            let original = seed[at];
            for value in [0, 0xff, original.wrapping_mul(37).wrapping_add(101)] {
                seed[at] = value;
                planning_numbers(&seed);
            }
            seed[at] = original;
        }
    }
}

#[test]
fn pairs_of_ellipsoids() {
    random_bytes_keep_the_promise(PROMISES[0], runs());
}

#[test]
fn spheres_boxes_and_half_spaces() {
    random_bytes_keep_the_promise(PROMISES[1], runs());
}

#[test]
fn worlds() {
    random_bytes_keep_the_promise(PROMISES[2], runs());
}

#[test]
fn motions() {
    random_bytes_keep_the_promise(PROMISES[3], runs());
}

#[test]
fn turns() {
    random_bytes_keep_the_promise(PROMISES[4], runs());
}

#[test]
fn bounds() {
    random_bytes_keep_the_promise(PROMISES[5], runs() / 10);
}

/// Too thin for the squares of both semi-axes: refused, where the margin once said that solids apart have one centre.
#[test]
fn needles_are_refused() {
    let at = |ratio: f64| Ellipsoid::try_new(&Pose::identity(), &Vector3::new(ratio, 1.0, 1.0));
    assert!(at(9_999.0).is_ok());
    for ratio in [1e5, 1e-5, 1e12] {
        assert!(matches!(at(ratio), Err(PlanningError::TooUnlike { .. })), "{ratio}");
    }
    assert!(matches!(at(1e-30), Err(PlanningError::OutOfRange { .. })));
    assert!(matches!(at(0.0), Err(PlanningError::NotPositive { .. })));
}

/// A type does not make an attitude one.
#[test]
fn what_is_no_attitude_is_refused() {
    for coordinates in [Quaternion::new(2.0, 0.0, 0.0, 0.0), Quaternion::new(0.0, 0.0, 0.0, 0.0)] {
        let attitude = Unit::new_unchecked(coordinates);
        let pose = Pose::from_parts(Vector3::zeros().into(), attitude);
        assert!(matches!(Ellipsoid::try_new(&pose, &Vector3::repeat(1.0)), Err(PlanningError::OutOfRange { .. })));
        let world = EllipsoidWorld::new(&World::default()).unwrap();
        let body = BodyShape::sphere(1.0).unwrap();
        assert!(world.clearance(&body, &pose, 0.0).is_err());
        let arc = BodyArc::accelerated(1.0, &TranslationState::at_rest(Vector3::zeros()), Vector3::zeros(), attitude);
        assert!(world.first_contact(&body, &arc, 0.0, 0.0).is_err());
        let limits = tumble_planning::global::MotionLimits {
            position: tumble_planning::dynamics::AlignedBox::between(Vector3::zeros(), Vector3::repeat(1.0)),
            speed_m_s: Vector3::repeat(1.0),
            force_n: Vector3::repeat(1.0),
            torque_n_m: Vector3::repeat(1.0),
            rate_rad_s: 1.0,
        };
        let inertia = tumble_planning::nalgebra::Matrix3::identity();
        assert!(slew(&attitude, &UnitQuaternion::identity(), &inertia, &limits).is_err());
    }
}

/// Ten thousand obstacles, all in one place, and a body among them: one answer, at once.
#[test]
fn ten_thousand_obstacles_in_one_place() {
    let obstacle = ObstacleEllipsoid { world_from_ellipsoid: Pose::identity(), semi_axes: Vector3::new(0.3, 0.2, 0.1) };
    let world = World { obstacles: vec![obstacle; 10_000], ..World::default() };
    let world = EllipsoidWorld::new(&world).unwrap();
    let body = BodyShape::sphere(0.1).unwrap();
    for x in [0.0, 0.39, 0.41, 7.0] {
        let clearance = world.clearance(&body, &Pose::translation(x, 0.0, 0.0), 0.0).unwrap();
        assert_eq!(clearance.distance_m < 0.0, x < 0.4, "{x}");
        let start = TranslationState { position: Vector3::new(x, 0.0, 0.0), velocity: Vector3::zeros() };
        let arc = BodyArc::accelerated(0.0, &start, Vector3::zeros(), UnitQuaternion::identity());
        assert_eq!(world.first_contact(&body, &arc, 0.0, 0.0).unwrap().is_some(), x < 0.4, "{x}");
    }
}
