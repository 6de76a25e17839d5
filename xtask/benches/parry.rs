//! The same queries of a world of parry's shapes and of the world of ellipsoids: a ball among twenty balls and boxes,
//! each time a thousand poses, or a hundred motions; and a capsule among a mesh of 1280 triangles.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::hint::black_box;
use tumble_identification::noise::signed_unit;
use tumble_planning::collision::{BodyShape, CollisionWorld, EllipsoidWorld, ParryBody, ParryWorld};
use tumble_planning::dynamics::{AlignedBox, ObstacleEllipsoid, World};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{UnitQuaternion, Vector3};
use tumble_planning::parry3d_f64::shape::{Ball, SharedShape};
use tumble_planning::{BodyArc, TranslationState};

fn vector(generator: &mut ChaCha8Rng, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| signed_unit(generator) * size)
}

fn queries<W: CollisionWorld>(criterion: &mut Criterion, name: &str, world: &W, body: &W::Body) {
    let mut generator = ChaCha8Rng::seed_from_u64(2);
    let poses: Vec<Pose<f64>> = (0..1000)
        .map(|_| {
            let attitude = UnitQuaternion::from_scaled_axis(vector(&mut generator, 1.5));
            Pose::from_parts(vector(&mut generator, 3.0).into(), attitude)
        })
        .collect();
    let arcs: Vec<BodyArc> = (0..100)
        .map(|_| {
            let (from, to) = (vector(&mut generator, 3.0), vector(&mut generator, 3.0));
            let state = TranslationState { position: from, velocity: (to - from) / 10.0 };
            BodyArc::accelerated(10.0, &state, Vector3::zeros(), UnitQuaternion::identity())
        })
        .collect();
    let mut group = criterion.benchmark_group(name);
    group.throughput(Throughput::Elements(1000)).bench_function("clearance", |bencher| {
        bencher.iter(|| {
            black_box(&poses).iter().map(|pose| world.clearance(body, pose, 0.0).unwrap().distance_m).sum::<f64>()
        });
    });
    group.throughput(Throughput::Elements(100)).bench_function("first_contact", |bencher| {
        bencher.iter(|| {
            let is_free = |arc: &&BodyArc| world.first_contact(body, arc, 0.0, 0.0).unwrap().is_none();
            black_box(&arcs).iter().filter(is_free).count()
        });
    });
    group.finish();
}

fn parry(criterion: &mut Criterion) {
    let mut generator = ChaCha8Rng::seed_from_u64(1);
    let (mut world, mut placed) = (World::default(), Vec::new());
    for index in 0..20 {
        let (center, half) = (vector(&mut generator, 3.0), vector(&mut generator, 0.4).abs() + Vector3::repeat(0.1));
        let at = Pose::from_parts(center.into(), UnitQuaternion::identity());
        if index % 2 == 0 {
            world.keep_out.push(AlignedBox { lower_world: center - half, upper_world: center + half });
            placed.push((at, SharedShape::cuboid(half.x, half.y, half.z)));
        } else {
            let semi_axes = Vector3::repeat(half.x);
            world.obstacles.push(ObstacleEllipsoid { world_from_ellipsoid: at, semi_axes });
            placed.push((at, SharedShape::ball(half.x)));
        }
    }
    queries(criterion, "ellipsoids", &EllipsoidWorld::new(&world).unwrap(), &BodyShape::sphere(0.2).unwrap());
    let ball = ParryBody::try_new(&[(Pose::identity(), SharedShape::ball(0.2))]).unwrap();
    queries(criterion, "parry", &ParryWorld::new(&placed).unwrap(), &ball);
    let (vertices, triangles) = Ball::new(1.5).to_trimesh(32, 21);
    let mesh = SharedShape::trimesh(vertices, triangles).unwrap();
    let capsule = ParryBody::try_new(&[(Pose::identity(), SharedShape::capsule_x(0.3, 0.1))]).unwrap();
    queries(criterion, "mesh", &ParryWorld::new(&[(Pose::identity(), mesh)]).unwrap(), &capsule);
}

criterion_group!(benches, parry);
criterion_main!(benches);
