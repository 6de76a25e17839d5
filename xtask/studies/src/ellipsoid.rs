//! Problem 10, two ellipsoids: whether they overlap and by what margin, timed on frozen pairs; and the exact test judged on
//! pairs whose gap is known to 30 digits (`cargo xtask study ellipsoid --runs N`).

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_planning::collision::{Ellipsoid, overlap, scaling_margin, separation};
use tumble_planning::lie::Pose;

use crate::Failure;
use crate::arguments::Arguments;
use crate::bench::{Bench, Goal, numbers, quantile};

#[path = "../../../crates/planning/tests/suite/known_gap/mod.rs"]
mod known_gap;

use known_gap::{Table, known, study};

const PROBLEM: &str = "ellipsoid";

fn refused(error: impl std::fmt::Display) -> Failure {
    Failure::BadInput(error.to_string())
}

/// An ellipsoid from semi-axes, centre and quaternion (w first).
fn ellipsoid(numbers: &[f64]) -> Result<Ellipsoid, Failure> {
    let [a, b, c, x, y, z, qw, qx, qy, qz] = *numbers else {
        return Err(Failure::BadInput("an ellipsoid is ten numbers".to_owned()));
    };
    let attitude = UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz));
    Ellipsoid::try_new(&Pose::from_parts(Vector3::new(x, y, z).into(), attitude), &Vector3::new(a, b, c))
        .map_err(refused)
}

/// Times the yes or no and the margin.
pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    const NAMES: [&str; 4] = ["overlap", "separation", "overlap_near_1e-9", "margin"];
    if !NAMES.iter().any(|item| bench.wants(PROBLEM, item)) {
        return Ok(());
    }
    // Pairs at gaps of +-1e-9, the worst that the target names.
    let mut generator = ChaCha8Rng::seed_from_u64(10);
    let near: Vec<(Ellipsoid, Ellipsoid)> = (0..1000)
        .map(|i| known(&mut generator, 30.0, 100.0, if i % 2 == 0 { 1e-9 } else { -1e-9 }))
        .map(|pair| (pair.a, pair.b))
        .collect();
    let goal = Goal { target_ns: Some(300.0), peer: None };
    let quality = worst("worst_pair_ns", &near);
    bench.sweep(PROBLEM, "overlap_near_1e-9", goal, near.len(), &[quality], |i| overlap(&near[i].0, &near[i].1));

    let Some(folder) = bench.data.clone() else {
        eprintln!("skipped: problem 10, no data folder");
        return Ok(());
    };
    let rows = numbers(&folder.join("ellipsoid_pairs.csv"))?;
    let reference = numbers(&folder.join("ellipsoid_ref.csv"))?;
    let pairs: Result<Vec<(Ellipsoid, Ellipsoid)>, Failure> =
        rows.iter().map(|row| Ok((ellipsoid(&row[..10])?, ellipsoid(&row[10..])?))).collect();
    let pairs = pairs?;
    let contact = |i: usize| reference[i][1];
    let wrong = (0..pairs.len()).filter(|i| overlap(&pairs[*i].0, &pairs[*i].1) != (contact(*i) < 1.0)).count();
    let margin_error = (0..pairs.len())
        .map(|i| (scaling_margin(&pairs[i].0, &pairs[i].1).value + 1.0 - contact(i).sqrt()).abs() / contact(i).sqrt())
        .fold(0.0, f64::max);
    let quality = [("wrong", wrong as f64), worst("worst_pair_ns", &pairs)];
    let goal = Goal::at(30.0, "Coal", 1790.0);
    bench.sweep(PROBLEM, "overlap", goal, pairs.len(), &quality, |i| overlap(&pairs[i].0, &pairs[i].1));
    bench.sweep(PROBLEM, "separation", goal, pairs.len(), &[], |i| separation(&pairs[i].0, &pairs[i].1));
    let goal = Goal { target_ns: Some(400.0), peer: None };
    let quality = [("worst_relative_error", margin_error)];
    bench.sweep(PROBLEM, "margin", goal, pairs.len(), &quality, |i| scaling_margin(&pairs[i].0, &pairs[i].1));
    Ok(())
}

/// The slowest pair, each by the quickest of a few batches so that what else the machine does drops out.
fn worst(name: &'static str, pairs: &[(Ellipsoid, Ellipsoid)]) -> (&'static str, f64) {
    const BATCH: u32 = 64;
    let mut times: Vec<f64> = pairs
        .iter()
        .map(|(a, b)| {
            let batch = || {
                let start = std::time::Instant::now();
                for _ in 0..BATCH {
                    std::hint::black_box(overlap(std::hint::black_box(a), std::hint::black_box(b)));
                }
                start.elapsed().as_nanos() as f64 / f64::from(BATCH)
            };
            (0..9).map(|_| batch()).fold(f64::INFINITY, f64::min)
        })
        .collect();
    times.sort_by(f64::total_cmp);
    (name, quantile(&times, 1.0))
}

/// Counts misclassified pairs by decade of their true gap.
pub fn count(arguments: &Arguments) -> Result<(), Failure> {
    let runs = arguments.number("--runs")?.unwrap_or(1_000_000) as u64;
    let seed = arguments.number("--seed")?.unwrap_or(0) as u64;
    let mut mistakes = 0;
    for (axis_ratio, size_ratio, runs) in [(30.0, 100.0, runs), (1000.0, 1000.0, runs / 10)] {
        let table = study(runs, axis_ratio, size_ratio, seed, separation);
        println!("{runs} pairs, semi-axes within {axis_ratio}, sizes within {size_ratio}");
        print(&table);
        let missed: u64 = table.missed_collisions.iter().sum();
        mistakes += table.mistakes_from(1e-12) + missed + table.wrong_planes + table.wrong_points;
    }
    if mistakes > 0 {
        return Err(Failure::TargetMissed(format!("{mistakes} answers are wrong")));
    }
    Ok(())
}

fn print(table: &Table) {
    println!("  gap from      pairs  missed collisions  false alarms");
    for (decade, pairs) in table.pairs.iter().enumerate().filter(|(_, pairs)| **pairs > 0) {
        let (missed, alarms) = (table.missed_collisions[decade], table.false_alarms[decade]);
        println!("  1e-{decade:<5} {pairs:>10} {missed:>18} {alarms:>13}");
    }
    println!(
        "  not certified by the reference {}, planes that do not separate {}, points not in both {}",
        table.unknown, table.wrong_planes, table.wrong_points
    );
}
