//! Collision queries: the time of edges and poses, and a million edges judged by dense sampling.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_planning::collision::{BodyEllipsoid, BodyShape, CollisionWorld, EllipsoidWorld};
use tumble_planning::dynamics::{AlignedBox, ObstacleEllipsoid, World};
use tumble_planning::lie::Pose;
use tumble_planning::{BodyArc, TranslationState};

use crate::Failure;
use crate::arguments::Arguments;
use crate::bench::{Bench, Goal};
use tumble_identification::noise::signed_unit;

#[path = "../../../crates/planning/tests/suite/sweep_oracle/mod.rs"]
#[expect(clippy::unwrap_used, reason = "shared with the tests, where it is allowed")]
mod oracle;

const PROBLEM: &str = "sweep";

fn vector(generator: &mut ChaCha8Rng, size: Vector3<f64>) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| size[axis] * signed_unit(generator))
}

fn attitude(generator: &mut ChaCha8Rng) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::from_parts(
        signed_unit(generator),
        vector(generator, Vector3::repeat(1.0)),
    ))
}

/// A module of 1.6 x 6.4 x 1.6 m per ten obstacles, with walls.
fn world(generator: &mut ChaCha8Rng, obstacles: usize) -> (World, Vector3<f64>) {
    let half = Vector3::new(0.8, 3.2, 0.8) * f64::cbrt(obstacles as f64 / 10.0);
    let obstacle = |generator: &mut ChaCha8Rng| ObstacleEllipsoid {
        world_from_ellipsoid: Pose::from_parts(vector(generator, half).into(), attitude(generator)),
        semi_axes: Vector3::from_fn(|_, _| 0.25 + 0.2 * signed_unit(generator)),
    };
    let obstacles = (0..obstacles).map(|_| obstacle(generator)).collect();
    (World { keep_in: vec![AlignedBox::between(-half, half)], keep_out: Vec::new(), obstacles }, half)
}

/// Accelerated edges that start where nothing is touched.
fn edges(
    generator: &mut ChaCha8Rng,
    world: &EllipsoidWorld,
    body: &BodyShape,
    half: Vector3<f64>,
    turns: bool,
    degree: usize,
) -> Result<Vec<BodyArc>, Failure> {
    let mut edges = Vec::new();
    while edges.len() < 512 {
        let start =
            TranslationState { position: vector(generator, half), velocity: vector(generator, Vector3::repeat(0.05)) };
        let mut arc = BodyArc::accelerated(8.0, &start, vector(generator, Vector3::repeat(0.01)), attitude(generator));
        for power in 3..=degree {
            arc.position[power] = vector(generator, Vector3::repeat(0.3 * 8.0_f64.powf(-(power as f64))));
        }
        if turns {
            arc.angle[1] = 0.2 * signed_unit(generator);
        }
        let clearance =
            world.clearance(body, &arc.pose(0.0), 0.0).map_err(|error| Failure::BadInput(error.to_string()))?;
        if clearance.distance_m > 0.0 {
            edges.push(arc);
        }
    }
    Ok(edges)
}

pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    let failure = |error: tumble_planning::PlanningError| Failure::BadInput(error.to_string());
    let sphere = BodyShape::sphere(0.15).map_err(failure)?;
    let payload = BodyShape::try_new(vec![BodyEllipsoid {
        body_from_ellipsoid: Pose::identity(),
        semi_axes: Vector3::new(0.3, 0.15, 0.15),
    }])
    .map_err(failure)?;
    let edge_cases: [(&str, &BodyShape, usize, bool, usize); 7] = [
        ("edge_sphere_10", &sphere, 10, false, 2),
        ("edge_sphere_quintic_10", &sphere, 10, false, 5),
        ("edge_ellipsoid_level_10", &payload, 10, false, 2),
        ("edge_ellipsoid_turning_10", &payload, 10, true, 2),
        ("edge_sphere_100", &sphere, 100, false, 2),
        ("edge_sphere_1000", &sphere, 1000, false, 2),
        ("edge_sphere_10000", &sphere, 10_000, false, 2),
    ];
    for (item, body, obstacles, turns, degree) in edge_cases {
        if !bench.wants(PROBLEM, item) {
            continue;
        }
        let mut generator = ChaCha8Rng::seed_from_u64(7);
        let (data, half) = world(&mut generator, obstacles);
        let world = EllipsoidWorld::new(&data).map_err(failure)?;
        let edges = edges(&mut generator, &world, body, half, turns, degree)?;
        let goal = Goal { target_ns: (obstacles == 10).then_some(5000.0), peer: None };
        let free = edges.iter().filter(|edge| matches!(world.first_contact(body, edge, 0.0, 0.0), Ok(None))).count();
        let quality = [("free", free as f64 / edges.len() as f64)];
        bench.sweep(PROBLEM, item, goal, edges.len(), &quality, |i| world.first_contact(body, &edges[i], 0.0, 0.0));
        if item == "edge_sphere_10" {
            batches(bench, &mut generator, &world, body, half);
        }
        let item = match item {
            "edge_sphere_10" => "clearance_sphere_10",
            "edge_ellipsoid_turning_10" => "clearance_ellipsoid_10",
            "edge_sphere_1000" => "clearance_sphere_1000",
            "edge_sphere_10000" => "clearance_sphere_10000",
            _ => continue,
        };
        bench.sweep(PROBLEM, item, Goal::default(), edges.len(), &[], |i| {
            world.clearance(body, &edges[i].pose(0.0), 0.0)
        });
    }
    Ok(())
}

/// A thousand poses per call: a million in 50 ms are 50 us.
fn batches(bench: &Bench, generator: &mut ChaCha8Rng, world: &EllipsoidWorld, body: &BodyShape, half: Vector3<f64>) {
    let mut pose = || Pose::from_parts(vector(generator, half).into(), attitude(generator));
    let poses: Vec<Vec<Pose<f64>>> = (0..8).map(|_| (0..1000).map(|_| pose()).collect()).collect();
    let mut found = Vec::with_capacity(1000);
    for (item, limit_m) in [("batch_clearances_1000", f64::INFINITY), ("batch_contacts_1000", 0.0)] {
        let goal = Goal { target_ns: Some(50_000.0), peer: None };
        bench.sweep(PROBLEM, item, goal, poses.len(), &[], |i| {
            world.clearances(body, &poses[i], 0.0, limit_m, &mut found)
        });
    }
}

/// Judges random edges by dense sampling.
pub fn study(arguments: &Arguments) -> Result<(), Failure> {
    let runs = arguments.number("--runs")?.unwrap_or(1_000_000);
    let samples = arguments.number("--samples")?.unwrap_or(10_000);
    let seed = arguments.number("--seed")?.unwrap_or(1);
    let mut draws = oracle::Draws::new(seed as u64);
    let (mut contacts, mut violations, mut false_contacts, mut worst_m) = (0_usize, 0_usize, 0_usize, 0.0_f64);
    for index in 0..runs {
        let case = draws.case();
        let verdict = case.judge(samples);
        contacts += usize::from(verdict.contact_s.is_some());
        worst_m = worst_m.max(verdict.contact_error_m);
        if verdict.violation_s.is_some() {
            violations += 1;
            println!("violation {index}: {verdict:?} {case:?}");
        }
        if verdict.contact_error_m > 1e-9 {
            false_contacts += 1;
            println!("false contact {index}: {verdict:?} {case:?}");
        }
    }
    println!(
        "edges {runs}, samples of each {samples}: contacts {contacts}, violations {violations}, contacts farther than 1e-9 m: \
         {false_contacts}, farthest contact {worst_m:.1e} m"
    );
    if violations + false_contacts > 0 {
        return Err(Failure::TargetMissed(format!("{violations} violations, {false_contacts} false contacts")));
    }
    Ok(())
}
