//! Zero, denormal, huge, infinite and no numbers, in every place where a number goes in: what the fuzz targets promise, on
//! random bytes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../../../fuzz/src/planning.rs"]
mod promises;

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// Each promise on so many inputs.
const RUNS: u64 = 30_000;

fn on_random_bytes(name: &str, seed: u64, promise: fn(&[u8])) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let runs = std::env::var("HOSTILE_RUNS").ok().and_then(|runs| runs.parse().ok()).unwrap_or(RUNS);
    let mut bytes = [0; 600];
    let (mut failed, mut slowest, mut slow) = (0, 0.0, 0);
    for run in 0..runs {
        random.fill_bytes(&mut bytes);
        // Inputs with few special numbers pass the checks more often.
        let mild = random.next_u32() % 4;
        if mild > 0 {
            for byte in &mut bytes {
                if *byte < 40 && !(u32::from(*byte)).is_multiple_of(mild * 8) {
                    *byte += 40;
                }
            }
        }
        let t = std::time::Instant::now();
        if std::panic::catch_unwind(|| promise(&bytes)).is_err() {
            failed += 1;
            println!("{name} fails in run {run}");
            if failed >= 12 {
                break;
            }
        }
        let t = t.elapsed().as_secs_f64();
        if t > slowest {
            slowest = t;
            slow = run;
        }
    }
    println!("{name}: {failed} failed, slowest {slowest:.4} s run {slow}");
    assert_eq!(failed, 0, "{name}");
}

#[test]
fn pairs_of_ellipsoids() {
    on_random_bytes("pairs", 1, promises::pairs);
}

#[test]
fn spheres_boxes_and_half_spaces() {
    on_random_bytes("simple shapes", 2, promises::simple_shapes);
}

#[test]
fn worlds_of_anything() {
    on_random_bytes("worlds", 3, promises::worlds);
}

#[test]
fn motions_between_any_states() {
    on_random_bytes("motions", 4, promises::motions);
}

#[test]
fn turns_of_any_body() {
    on_random_bytes("slews", 5, promises::slews);
}

#[test]
fn bounds_of_any_problem() {
    on_random_bytes("bounds", 6, promises::bounds);
}
