//! Benchmark problem 10, distances: 1000 frozen pairs of ellipsoids with reference distances by another algorithm.

use std::hint::black_box;
use std::time::Instant;

use nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};
use tumble_lie::Pose;
use tumble_planning::collision::{
    Ellipsoid, Sphere, distance, distance_from_hint, ellipsoid_to_box, ellipsoid_to_sphere,
};
use tumble_planning::dynamics::AlignedBox;

use crate::Failure;
use crate::bench::{Bench, Goal, numbers};

const PROBLEM: &str = "ellipsoid-distance";

/// Semi-axes, centre, quaternion (w first).
fn ellipsoid(row: &[f64]) -> Result<Ellipsoid, Failure> {
    let &[a, b, c, x, y, z, w, i, j, k] = row else {
        return Err(Failure::BadInput(format!("an ellipsoid has ten numbers, not {}", row.len())));
    };
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    Ellipsoid::try_new(&Pose::from_parts(Translation3::new(x, y, z), rotation), &Vector3::new(a, b, c))
        .map_err(|error| Failure::BadInput(error.to_string()))
}

/// The slowest pair, each by its fastest of many calls, which takes away what the machine adds; one clock reading included.
fn slowest_ns(pairs: &[(Ellipsoid, Ellipsoid)]) -> f64 {
    let fastest = |(a, b): &(Ellipsoid, Ellipsoid)| {
        let call = |_| {
            let start = Instant::now();
            black_box(distance(black_box(a), black_box(b)));
            start.elapsed().as_nanos() as f64
        };
        (0..50).map(call).fold(f64::INFINITY, f64::min)
    };
    pairs.iter().map(fastest).fold(0.0, f64::max)
}

pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    if !bench.wants(PROBLEM, "") {
        return Ok(());
    }
    let Some(data) = &bench.data else {
        eprintln!("{PROBLEM}: no frozen inputs, skipped");
        return Ok(());
    };
    let (rows, reference) = (numbers(&data.join("ellipsoid_pairs.csv"))?, numbers(&data.join("ellipsoid_ref.csv"))?);
    let mut pairs = Vec::with_capacity(rows.len());
    for row in &rows {
        let (a, b) = row.split_at(10.min(row.len()));
        pairs.push((ellipsoid(a)?, ellipsoid(b)?));
    }
    let (mut sign_errors, mut error, mut gap) = (0.0, 0.0_f64, 0.0_f64);
    for ((a, b), reference) in pairs.iter().zip(&reference) {
        let expected = reference.first().copied().unwrap_or(f64::NAN);
        let found = distance(a, b);
        if (found.distance_m > 0.0) != (expected > 0.0) {
            sign_errors += 1.0;
        } else if expected > 0.0 {
            error = error.max((found.distance_m - expected).abs() / expected);
            gap = gap.max((found.distance_m - found.lower_bound_m) / expected);
        }
    }
    let quality =
        [("pairs", pairs.len() as f64), ("sign_errors", sign_errors), ("max_rel_error", error), ("max_rel_gap", gap)];
    let goal = Goal::at(500.0, "fcl-cpp", 1230.0);
    let (apart, overlapping): (Vec<_>, Vec<_>) =
        pairs.iter().copied().partition(|(a, b)| distance(a, b).distance_m > 0.0);
    bench.sweep(PROBLEM, "distance", goal, pairs.len(), &quality, |i| distance(&pairs[i].0, &pairs[i].1));
    let worst_ns = [("worst_ns", slowest_ns(&pairs))];
    bench.each(PROBLEM, "distance, every call", goal, pairs.len(), &worst_ns, |i| distance(&pairs[i].0, &pairs[i].1));
    let of = |set: &[_]| [("pairs", set.len() as f64)];
    bench.sweep(PROBLEM, "distance, apart", goal, apart.len(), &of(&apart), |i| distance(&apart[i].0, &apart[i].1));
    let count = overlapping.len();
    bench.sweep(PROBLEM, "depth, overlapping", Goal::default(), count, &of(&overlapping), |i| {
        distance(&overlapping[i].0, &overlapping[i].1)
    });
    // A tick of a motion earlier: b stood 10 mm elsewhere.
    let hints: Vec<Vector3<f64>> = apart
        .iter()
        .map(|(a, b)| {
            let shift = Vector3::new(0.006, -0.006, 0.005);
            let found = distance(a, b);
            (found.normal * found.distance_m.max(0.05) + shift).normalize()
        })
        .collect();
    bench.sweep(PROBLEM, "distance from a hint", Goal::default(), apart.len(), &of(&apart), |i| {
        distance_from_hint(&apart[i].0, &apart[i].1, &hints[i])
    });
    bench.sweep(PROBLEM, "ellipsoid to sphere", Goal::default(), pairs.len(), &[], |i| {
        let (a, b) = &pairs[i];
        ellipsoid_to_sphere(a, &Sphere { center: *b.center(), radius_m: 0.1 })
    });
    let boxes: Vec<AlignedBox> = pairs
        .iter()
        .map(|(_, b)| {
            let half = b.half_extent();
            AlignedBox { lower_world: b.center() - half, upper_world: b.center() + half }
        })
        .collect();
    bench.sweep(PROBLEM, "ellipsoid to box", Goal::default(), pairs.len(), &[], |i| {
        ellipsoid_to_box(&pairs[i].0, &boxes[i])
    });
    Ok(())
}
