//! Time to the first plan, over the seeds of problem 7 and of the slalom.
#![allow(clippy::expect_used, missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use std::hint::black_box;
use tumble_planning::collision::{BodyShape, EllipsoidWorld};
use tumble_planning::dynamics::{AlignedBox, InertialParameters, ObstacleEllipsoid, World};
use tumble_planning::global::{
    FlightPlanner, GlobalPlanner, GlobalRequest, GoalRegion, MotionLimits, Objective, Until,
};
use tumble_planning::lie::Pose;
use tumble_planning::{ModelBelief, TranslationState, Units};

#[path = "scenes/jem.rs"]
mod scenes;

fn world(rows: &[scenes::Row]) -> EllipsoidWorld {
    let obstacle = |(center, wxyz, semi_axes): &scenes::Row| {
        let [w, x, y, z] = *wxyz;
        let attitude = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let world_from_ellipsoid = Pose::from_parts(Vector3::from(*center).into(), attitude);
        ObstacleEllipsoid { world_from_ellipsoid, semi_axes: (*semi_axes).into() }
    };
    let obstacles = rows.iter().map(obstacle).collect();
    EllipsoidWorld::new(&World { obstacles, ..World::default() }).expect("a world")
}

fn benches(criterion: &mut Criterion) {
    let level = [1.0, 0.0, 0.0, 0.0];
    let slalom: &[scenes::Row] =
        &[([10.3, -8.5, 4.9], level, [0.5, 0.05, 2.0]), ([11.2, -9.0, 4.9], level, [0.5, 0.05, 2.0])];
    let belief =
        ModelBelief::certain(1, InertialParameters::about_com(9.58, Vector3::zeros(), Matrix3::identity() * 0.15));
    let mut planner = FlightPlanner::default();
    for (name, rows) in [("jem2", scenes::JEM2), ("jem5", scenes::JEM5), ("jem10", scenes::JEM10), ("slalom", slalom)] {
        let is_slalom = name == "slalom";
        let v = Vector3::new;
        let (start, goal, lower_world, upper_world) = if is_slalom {
            (v(10.8, -9.6, 4.8), v(10.8, -7.75, 5.2), v(10.3, -9.8, 4.2), v(11.2, -7.5, 5.3))
        } else {
            (v(0.0, -2.8, 0.0), v(0.0, 2.8, 0.0), v(-0.59, -3.04, -0.69), v(0.59, 3.04, 0.69))
        };
        let (radius_m, speed_m_s, force_n, goal_radius_m, goal_speed_m_s) =
            if is_slalom { (0.15, 0.05, 0.1, 0.2, 0.05) } else { (1e-6, 0.2, 0.45, 0.25, 0.1) };
        let (world, body) = (world(rows), BodyShape::sphere(radius_m).expect("a body"));
        let request = |seed| GlobalRequest {
            world: &world,
            body: &body,
            start: TranslationState::at_rest(start),
            attitude: UnitQuaternion::identity(),
            start_s: 0.0,
            goal: GoalRegion { position: goal, radius_m: goal_radius_m, speed_m_s: goal_speed_m_s, attitude: None },
            limits: MotionLimits {
                position: AlignedBox { lower_world, upper_world },
                speed_m_s: Vector3::repeat(speed_m_s),
                force_n: Vector3::repeat(force_n),
                torque_n_m: Vector3::zeros(),
                rate_rad_s: 0.0,
            },
            belief: &belief,
            objective: Objective::Duration,
            margin_m: 0.0,
            until: Until::FirstPlan,
            seed,
        };
        let mut seed = 0;
        criterion.bench_function(&format!("first_plan_{name}"), |bench| {
            bench.iter(|| {
                seed += 1;
                black_box(planner.plan(&request(seed), &mut Units::new(100_000)))
            });
        });
    }
}

criterion_group!(planner, benches);
criterion_main!(planner);
