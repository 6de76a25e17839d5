//! Hot paths allocate nothing: every one of them is called thousands of times under an allocator that counts.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#![allow(
    unsafe_code,
    reason = "an allocator that counts has to implement `GlobalAlloc`; it hands everything to the system's"
)]

#[path = "suite/fixed_planes/mod.rs"]
mod fixed_planes;
#[path = "suite/tube_problems/mod.rs"]
mod tube_problems;

use tumble_planning::collision::{
    BodyEllipsoid, BodyShape, CollisionWorld as _, Ellipsoid, EllipsoidWorld, HalfSpace, MovingObstacle, Sphere,
    conservative_first_contact, distance, distance_from_hint, ellipsoid_to_box, ellipsoid_to_half_space,
    ellipsoid_to_sphere, overlap, scaling_margin, separation, sphere_to_box, sphere_to_half_space, sphere_to_sphere,
};
use tumble_planning::control::{
    AttitudeController, AttitudeGains, AttitudeLaw, AttitudeSpan, AxisGain, AxisTemplate, ControlRequest, Controller,
    CoupledAxes, EndAttitude, GramStatus, GramWorkspace, LinearMpcSettings, LqrController, MassInterval,
    MinimalInvariantSet, NominalPath, ObstaclePlanes, OriginalSettings, OriginalTubeController, PlainMpcController,
    ReferenceMotion, SymmetricBox, Terminal, TrackedPoint, TranslationWeights, TubeController, TubeDisturbance,
    TubeSettings, TubeWeights, discrete_lqr,
};
use tumble_planning::dynamics::strategies::{draws, poses};
use tumble_planning::dynamics::{
    AlignedBox, BodyAcceleration, InertialParameters, ObstacleEllipsoid, PoseReference, RigidBodyState, World,
};
use tumble_planning::global::{GoalRegion, MotionLimits};
use tumble_planning::lie::Pose;
use tumble_planning::local::{
    Barrier, Criterion, Crossing, Curvature, Factorisation, Guess, Hull, InformativePlanner, KINEMATICS, Kinematics,
    LocalPlanner as _, LocalRequest, LocalSettings, MotionRow, Reference, RigidBodyModel, RowSettings, SpeedLimits,
    Stages, Surroundings, WrenchSet, passing_ways,
};
use tumble_planning::nalgebra::{Matrix1, Matrix2, Matrix3, SMatrix, UnitQuaternion, Vector2, Vector3};
use tumble_planning::steering::{
    least_time_s, least_time_to_goal_s, least_velocity_change_m_s, slew, steer, steer_in, steer_to_goal,
};
use tumble_planning::{BodyArc, ModelBelief, Plan, TranslationState, Units};

tumble_planning::lie::counting_allocator!();

const CALLS: usize = 10_000;

/// Different inputs per path; the first round through them is the warm-up.
const INPUTS: usize = 64;

/// How often `calls` calls allocate, after one call on each input.
fn allocations<T>(calls: usize, path: impl FnMut(usize) -> T) -> usize {
    counting::allocations(INPUTS, calls, path)
}

fn assert_none<T>(name: &str, path: impl FnMut(usize) -> T) {
    assert_eq!(allocations(CALLS, path), 0, "{name} allocates");
}

#[test]
fn control_an_allocation_is_counted() {
    assert_eq!(allocations(CALLS, Box::new), CALLS);
    // Growth goes through `realloc`.
    assert_eq!(allocations(1, |i| (vec![i], Vec::<usize>::with_capacity(2).reserve(3))), 3);
}

/// Semi-axes of a thin, a long and a round one in turn.
fn semi_axes(i: usize) -> Vector3<f64> {
    [Vector3::new(0.4, 0.1, 0.3), Vector3::new(0.2, 0.9, 0.2), Vector3::repeat(0.3)][i % 3]
}

/// Some of them overlap, some pairs are apart, some touch.
fn ellipsoids(seed: u64) -> Vec<Ellipsoid> {
    let posed = |(i, pose)| Ellipsoid::try_new(pose, &semi_axes(i)).unwrap();
    draws(&poses(0.6), seed, INPUTS).iter().enumerate().map(posed).collect()
}

#[test]
fn pairs_of_ellipsoids() {
    let (a, b) = (ellipsoids(1), ellipsoids(2));
    let kinds = (0..INPUTS).filter(|i| overlap(&a[*i], &b[*i])).count();
    assert!((1..INPUTS).contains(&kinds), "{kinds}");
    assert_none("separation", |i| separation(&a[i], &b[i]));
    assert_none("overlap", |i| overlap(&a[i], &b[i]));
    assert_none("scaling_margin", |i| scaling_margin(&a[i], &b[i]));
    assert_none("distance", |i| distance(&a[i], &b[i]));
    let hints: Vec<_> = (0..INPUTS).map(|i| distance(&a[i], &b[i]).normal).collect();
    assert_none("distance_from_hint", |i| distance_from_hint(&a[i], &b[i], &hints[(i / 2) * 2]));
    // Pairs that 53 bits cannot decide.
    let touching: Vec<_> = (0..INPUTS)
        .map(|i| {
            let beyond = Pose::translation(semi_axes(i).x + semi_axes(i + 1).x, 0.0, 0.0);
            let at = |pose: &Pose<f64>, i: usize| Ellipsoid::try_new(pose, &semi_axes(i)).unwrap();
            (at(&Pose::identity(), i), at(&beyond, i + 1))
        })
        .collect();
    assert_none("separation at contact", |i| separation(&touching[i].0, &touching[i].1));
    assert_none("distance at contact", |i| distance(&touching[i].0, &touching[i].1));
}

#[test]
fn simple_shapes() {
    let a = ellipsoids(3);
    let spheres: Vec<_> = draws(&poses(0.6), 4, INPUTS)
        .iter()
        .map(|pose| Sphere { center: pose.translation.vector, radius_m: 0.2 })
        .collect();
    let aligned = AlignedBox::between(Vector3::new(-0.1, -0.5, 0.0), Vector3::new(0.4, f64::INFINITY, 0.3));
    let half_space = HalfSpace { inward: Vector3::z_axis(), offset_m: 0.2 };
    assert_none("ellipsoid_to_sphere", |i| ellipsoid_to_sphere(&a[i], &spheres[i]));
    assert_none("ellipsoid_to_box", |i| ellipsoid_to_box(&a[i], &aligned));
    assert_none("ellipsoid_to_half_space", |i| ellipsoid_to_half_space(&a[i], &half_space));
    assert_none("sphere_to_sphere", |i| sphere_to_sphere(&spheres[i], &spheres[(i + 1) % INPUTS]));
    assert_none("sphere_to_box", |i| sphere_to_box(&spheres[i], &aligned));
    assert_none("sphere_to_half_space", |i| sphere_to_half_space(&spheres[i], &half_space));
}

/// So many obstacles that they are kept in a tree, one that moves, walls and a keep-out box.
fn world() -> EllipsoidWorld {
    let obstacles = draws(&poses(4.0), 5, 60);
    let ellipsoid = |(i, pose): (usize, &Pose<f64>)| ObstacleEllipsoid {
        world_from_ellipsoid: *pose,
        semi_axes: semi_axes(i) * 0.5,
    };
    let world = World {
        keep_in: vec![AlignedBox::between(Vector3::repeat(-4.0), Vector3::repeat(4.0))],
        keep_out: vec![AlignedBox::between(Vector3::repeat(2.0), Vector3::repeat(2.5))],
        obstacles: obstacles.iter().enumerate().map(ellipsoid).collect(),
    };
    let moving = MovingObstacle::at_rest(world.obstacles[0]).drifting(Vector3::new(0.01, 0.0, 0.02), 0.0);
    EllipsoidWorld::new(&world).unwrap().with_obstacle(moving.present(2.0, 40.0)).unwrap()
}

fn bodies() -> [BodyShape; 2] {
    let part = |x: f64, semi_axes| BodyEllipsoid { body_from_ellipsoid: Pose::translation(x, 0.0, 0.0), semi_axes };
    let two = vec![part(0.1, Vector3::new(0.2, 0.1, 0.15)), part(-0.1, Vector3::repeat(0.1))];
    [BodyShape::sphere(0.2).unwrap(), BodyShape::try_new(two).unwrap()]
}

#[test]
fn worlds() {
    const MARGIN_M: f64 = 0.01;
    let (world, bodies) = (world(), bodies());
    let poses = draws(&poses(3.0), 6, INPUTS);
    let arcs: Vec<_> = poses
        .iter()
        .enumerate()
        .map(|(i, pose)| {
            let start =
                TranslationState { position: pose.translation.vector, velocity: Vector3::new(0.1, -0.05, 0.02) };
            let arc = BodyArc::accelerated(8.0, &start, Vector3::new(-0.01, 0.02, 0.0), pose.rotation);
            if i % 2 == 0 { arc } else { arc.turning(Vector3::y_axis(), [0.0, 0.1, 0.01, 0.0, 0.0, 0.0]) }
        })
        .collect();
    let hits = (0..INPUTS).filter(|i| world.first_contact(&bodies[1], &arcs[*i], 1.0, MARGIN_M).unwrap().is_some());
    assert!((1..INPUTS).contains(&hits.count()));
    for body in &bodies {
        assert_none("clearance", |i| world.clearance(body, &poses[i], 3.0).unwrap());
        assert_none("lasting_clearance", |i| world.lasting_clearance(body, &poses[i], 3.0).unwrap());
        assert_none("first_contact", |i| world.first_contact(body, &arcs[i], 1.0, MARGIN_M).unwrap());
        let mut clearances_m = Vec::with_capacity(INPUTS);
        assert_none("clearances", |_| world.clearances(body, &poses, 3.0, 1.0, &mut clearances_m).unwrap());
    }
    let count = allocations(CALLS / 10, |i| {
        conservative_first_contact(&world, &bodies[0], &arcs[i], 1.0, MARGIN_M, 1e-6).unwrap()
    });
    assert_eq!(count, 0, "conservative_first_contact allocates");
}

#[test]
fn motions() {
    let limits = MotionLimits {
        position: AlignedBox::between(Vector3::repeat(-4.0), Vector3::repeat(4.0)),
        speed_m_s: Vector3::new(0.1, 0.2, 0.1),
        force_n: Vector3::new(0.2, 0.1, 0.5),
        torque_n_m: Vector3::new(0.015, 0.02, 0.05),
        rate_rad_s: 0.1,
    };
    let translation = limits.translation(10.0).unwrap();
    let poses = draws(&poses(2.0), 7, INPUTS);
    let states: Vec<_> = poses
        .iter()
        .map(|pose| TranslationState {
            position: pose.translation.vector,
            velocity: pose.translation.vector.component_mul(&translation.speed_m_s) / 3.0,
        })
        .collect();
    let to = |i: usize| &states[(i + 1) % INPUTS];
    assert!((0..INPUTS).filter(|i| steer(&states[*i], to(*i), &translation).is_some()).count() > INPUTS / 2);
    assert_none("least_time_s", |i| least_time_s(&states[i], to(i), &translation));
    assert_none("steer", |i| steer(&states[i], to(i), &translation));
    assert_none("steer_in", |i| steer_in(&states[i], to(i), &translation, 100.0));
    assert_none("least_velocity_change_m_s", |i| least_velocity_change_m_s(&states[i], to(i), &translation, 100.0));
    let goal = |i: usize| GoalRegion { position: to(i).position, radius_m: 0.1, speed_m_s: 0.03, attitude: None };
    assert_none("least_time_to_goal_s", |i| least_time_to_goal_s(&states[i], &goal(i), &translation));
    assert_none("steer_to_goal", |i| steer_to_goal(&states[i], &goal(i), &translation));
    let attitude = |i: usize| poses[i % INPUTS].rotation;
    let inertia = Matrix3::new(0.15, 0.01, 0.0, 0.01, 0.2, 0.02, 0.0, 0.02, 0.16);
    assert_none("slew", |i| slew(&attitude(i), &attitude(i + 1), &inertia, &limits).unwrap());
    assert_none("arcs of a motion", |i| {
        let steering = steer(&states[i], to(i), &translation)?;
        Some(steering.arcs(UnitQuaternion::identity()).map(|arc| arc.pose(0.1).translation.x).sum::<f64>())
    });
}

#[test]
fn curvature_of_a_local_plan() {
    let (steps, columns) = (12, 10);
    let mut stages = Stages::<12, 6>::new(steps, columns);
    for step in 0..steps {
        (0..12).for_each(|i| stages.by_state[step][i][i] = 1.0);
        (0..6).for_each(|i| {
            stages.by_input[step][i][i] = 0.3;
            stages.input_curvature[step][i][i] = 0.1;
        });
    }
    stages.arrow.extend((0..columns * steps * 6).map(|i| f64::sin(i as f64)));
    let (mut x, mut product) = (vec![1.0; steps * 6], vec![0.0; steps * 6]);
    for route in [Factorisation::Riccati, Factorisation::Dense] {
        let mut curvature = Curvature::new(route, steps, columns);
        let before = counting::ALLOCATIONS.get();
        for call in 0..10 {
            assert!(curvature.factorise(&stages, 0.1 * f64::from(call)));
            curvature.times(&stages, &x, &mut product);
            curvature.solve(&stages, &mut x);
        }
        assert_eq!(counting::ALLOCATIONS.get(), before, "{route:?} allocates");
    }
}

#[test]
fn rows_of_surroundings_and_ways_past_them() {
    let poses = draws(&poses(1.0), 71, INPUTS);
    let part = |x: f64| BodyEllipsoid {
        body_from_ellipsoid: Pose::translation(x, 0.1, 0.0),
        semi_axes: Vector3::new(0.3, 0.2, 0.1),
    };
    let shape = BodyShape::try_new(vec![part(0.1), part(-0.1)]).unwrap();
    let solid = ObstacleEllipsoid {
        world_from_ellipsoid: Pose::translation(0.5, 0.0, 0.1),
        semi_axes: Vector3::new(0.3, 0.2, 0.4),
    };
    let side = Vector3::new(3.0, 2.0, 2.0);
    let world = World {
        keep_in: vec![AlignedBox { lower_world: -side, upper_world: side }],
        keep_out: vec![AlignedBox { lower_world: Vector3::repeat(1.0), upper_world: Vector3::repeat(1.5) }],
        obstacles: vec![solid],
    };
    let moving = MovingObstacle::at_rest(solid).drifting(Vector3::new(0.1, 0.0, 0.0), 0.0);
    for hull in [Hull::Point, Hull::Shape(shape)] {
        let surroundings = Surroundings::of_world(&world, hull).unwrap().with_moving([moving]).unwrap();
        let settings = RowSettings {
            start_s: 0.0,
            step_s: 0.5,
            margin_m: 0.01,
            interpolation_error_m: 1e-4,
            length_scale_m: 0.1,
            on_segments: true,
        };
        let count = surroundings.rows(2, &settings);
        let empty =
            MotionRow { node: 0, value: 0.0, by_start: [0.0; KINEMATICS], by_end: [0.0; KINEMATICS], contact: None };
        let (mut values, mut rows) = (vec![0.0; count], vec![empty; count]);
        let motion = |i: usize| {
            [0, 1, 2].map(|k| Kinematics {
                world_from_body: poses[(i + k) % INPUTS],
                velocity_world: Vector3::new(0.1, 0.0, 0.05),
                rate_body: Vector3::new(0.1, 0.2, 0.05),
            })
        };
        let made = allocations(CALLS / 100, |i| {
            surroundings.values(&motion(i % INPUTS), &settings, &mut values);
            surroundings.linearize(&motion(i % INPUTS), &settings, &mut rows);
        });
        assert_eq!(made, 0);
        let made = allocations(CALLS / 100, |i| {
            let crossing = Crossing {
                start: &motion(i % INPUTS)[0],
                start_s: 0.0,
                goal_world: Vector3::new(1.0, 0.0, 0.0),
                horizon_s: 10.0,
                acceleration_m_s2: 0.1,
                margin_m: 0.0,
                plane_normal: None,
            };
            passing_ways(&crossing, &surroundings)
        });
        assert_eq!(made, 0);
    }
}

/// A plan allocates its request's memory and its answer, its iterations nothing: 50 of them as often as 5.
#[test]
fn iterations_of_a_local_plan() {
    let steps = 12;
    let mut belief = ModelBelief::certain(1, InertialParameters::solid_box(9.5, [0.3; 3]));
    belief.estimate.covariance = SMatrix::identity() * 1e-3;
    let solid = ObstacleEllipsoid {
        world_from_ellipsoid: Pose::translation(0.4, 0.05, 0.0),
        semi_axes: Vector3::new(0.1, 0.15, 0.2),
    };
    let world = World { obstacles: vec![solid], ..World::default() };
    let surroundings = Surroundings::of_world(&world, Hull::Point).unwrap();
    let (start, goal) = (Kinematics::at_rest(Pose::identity()), Kinematics::at_rest(Pose::translation(0.8, 0.1, 0.0)));
    let guess = vec![[0.01, -0.01, 0.01, 0.2, -0.1, 0.05]; steps];
    let made = |iterations: usize| {
        let settings = LocalSettings {
            steps,
            step_s: 0.5,
            tracking: [1.0; 12],
            terminal: [5.0; 12],
            effort: [1.0; 6],
            acceleration: [0.1; 2],
            wrench: WrenchSet {
                limit: [0.03, 0.03, 0.03, 0.8, 0.4, 0.4],
                half_spaces: vec![([0.0, 0.0, 0.0, 1.0, 1.0, 0.0], 0.9)],
            },
            speed: SpeedLimits { speed_m_s: Vector3::repeat(0.15), rate_rad_s: Vector3::repeat(0.3) },
            measurement: SMatrix::identity() * 1e4,
            retained: [1.0; 12],
            criterion: Criterion::A,
            margin_m: 0.02,
            length_scale_m: 0.1,
            on_segments: true,
            tolerance: 1e-14, // beyond rounding: as many iterations as allowed
            iterations,
        };
        let mut planner = InformativePlanner::try_new(RigidBodyModel::<4>::principal(), settings).unwrap();
        let request = LocalRequest {
            start: &start,
            start_s: 0.0,
            reference: Reference::Hold(&goal),
            terminal: None,
            belief: &belief,
            information: [10.0, 1e4, 1e4, 1e4],
            reserved: [0.0; 6],
            surroundings: &surroundings,
            guess: Guess::Inputs(&guess),
        };
        let mut plan = || planner.plan(&request, &mut Units::new(u64::MAX)).unwrap();
        assert!(plan().plan.is_some(), "{iterations}");
        let before = counting::ALLOCATIONS.get();
        let answer = plan();
        (answer.iterations, counting::ALLOCATIONS.get() - before)
    };
    let ((few, of_few), (many, of_many)) = (made(8), made(60));
    assert!(few == 8 && many >= 30, "{few} {many}");
    assert_eq!(of_few, of_many);
}

/// Warm, cold, with another active set, without a solution, and with nothing that is a number.
#[test]
fn solves_of_a_gram_program() {
    let mut run = tube_problems::NominalLoop::new();
    let mut step = |call: usize| {
        if call == 0 {
            run.restart();
        }
        run.solve(!call.is_multiple_of(3));
        run.advance();
        run.states
    };
    assert!((0..INPUTS).map(&mut step).all(|states| states.iter().flatten().all(|x| x.is_finite())));
    assert_eq!(allocations(CALLS / 10, step), 0);

    let program = tube_problems::Nominal::new().matrices.program();
    let mut workspace = GramWorkspace::new(&program);
    let linear: Vec<Vec<f64>> =
        (0..INPUTS).map(|i| (0..program.unknowns()).map(|j| 30.0 * f64::sin((i * j) as f64)).collect()).collect();
    let mut kinds = [0; 3];
    let made = allocations(CALLS / 10, |i| {
        let mut upper = [0.2; 75];
        let mut lower = [-0.2; 75];
        match i % 8 {
            0 => (lower[70], upper[20]) = (0.19, 0.01), // velocities that the inputs cannot reach
            1 => upper[3] = f64::NAN,
            _ => {}
        }
        let status = program.solve(&linear[i], &lower, &upper, &tube_problems::SETTINGS, &mut workspace);
        kinds[match status {
            GramStatus::Solved => 0,
            GramStatus::Infeasible => 1,
            _ => 2,
        }] += 1;
        workspace.solution()[0]
    });
    assert_eq!(made, 0);
    assert!(kinds.iter().all(|count| *count > 0), "{kinds:?}");
}

#[test]
fn commands_of_the_simple_controllers() {
    let body = InertialParameters::solid_box(9.5, [0.3, 0.25, 0.35]);
    let attitude = AttitudeController {
        law: AttitudeLaw::Geometric,
        gains: AttitudeGains { stiffness_n_m: 0.3, damping_n_m_s: 0.3 },
        body,
        torque_limit_n_m: 0.05,
    };
    let limit = Vector3::repeat(0.05);
    let reference = PoseReference {
        state: RigidBodyState::at_rest(),
        acceleration: BodyAcceleration {
            angular_acceleration_body: Vector3::zeros(),
            acceleration_origin_body: Vector3::zeros(),
        },
    };
    let hold = |_: f64| reference;
    let plan = Plan { trajectory: &hold as &dyn ReferenceMotion, model_revision: 0 };
    let at = |world_from_body| RigidBodyState { world_from_body, ..RigidBodyState::at_rest() };
    let states: Vec<_> = draws(&poses(0.3), 9, INPUTS).into_iter().map(at).collect();
    let mut lqr = LqrController::lqr(0.2, &TranslationWeights::default(), attitude, limit).unwrap();
    let mut mpc = PlainMpcController::plain_mpc(&LinearMpcSettings::default(), attitude, limit).unwrap();
    let mut original = OriginalTubeController::original(&OriginalSettings::default(), body).unwrap();
    let controllers: [(&str, &mut dyn Controller); 3] =
        [("lqr", &mut lqr), ("plain mpc", &mut mpc), ("original tube", &mut original)];
    for (name, controller) in controllers {
        let mut time_s = 0.0;
        let count = allocations(2_000, |i| {
            time_s += 0.1;
            controller.command(&ControlRequest { time_s, state: &states[i % INPUTS], plan: &plan }).unwrap()
        });
        assert_eq!(count, 0, "{name}");
    }
}

/// Decisions and outputs of the tube controller, once its buffers are full; adopting a belief builds a new tube and may allocate.
#[test]
fn commands_of_the_tube_controller() {
    let body = InertialParameters::solid_box(9.5, [0.3, 0.25, 0.35]);
    let attitude = AttitudeController {
        law: AttitudeLaw::Geometric,
        gains: AttitudeGains { stiffness_n_m: 0.3, damping_n_m_s: 0.3 },
        body,
        torque_limit_n_m: 0.05,
    };
    let settings = TubeSettings {
        gain: AxisGain::default(),
        steps: 25,
        weights: TubeWeights::DEFAULT,
        terminal: Terminal::StopSet,
        speed_m_s: 0.1,
        walls_m: [[-2.0, 2.0]; 3],
        force_limit_n: Vector3::repeat(0.2),
        attitudes: AttitudeSpan::Any,
        turned_by_rad: 0.01,
        disturbance: TubeDisturbance { position_m: 0.0, velocity_m_s: 1e-4, force_n: 0.0, acceleration_m_s2: 0.0 },
        corrections: None,
        mass: MassInterval::between(6.0, 12.0).unwrap(),
        sigmas: 3.0,
        world_from_axes: UnitQuaternion::identity(),
        point: TrackedPoint::Origin,
    };
    let mut controller = TubeController::try_new(settings, None, attitude, &body).unwrap();
    let goal = |_: f64| PoseReference {
        state: RigidBodyState { world_from_body: Pose::translation(1.9, -1.0, 0.5), ..RigidBodyState::at_rest() },
        acceleration: BodyAcceleration {
            angular_acceleration_body: Vector3::zeros(),
            acceleration_origin_body: Vector3::zeros(),
        },
    };
    let plan = Plan { trajectory: &goal as &dyn ReferenceMotion, model_revision: 0 };
    let mut state = RigidBodyState::at_rest();
    let mut time_s = 0.0;
    let mut output = |_: usize| {
        let command = controller.command(&ControlRequest { time_s, state: &state, plan: &plan }).unwrap();
        state.world_from_body.translation.vector += state.twist_body.linear * 0.05;
        state.twist_body.linear += command.wrench_body.force * (0.05 / 9.5);
        time_s += 0.05;
        command
    };
    for call in 0..200 {
        output(call);
    }
    assert_eq!(allocations(2_000, output), 0);
    assert!(controller.counts().decisions > 500 && controller.counts().braking == 0);
}

#[test]
fn invariant_sets() {
    let gain = AxisGain::default();
    let disturbance = SymmetricBox(Vector2::new(1e-4, 2e-4));
    let set = MinimalInvariantSet::try_new(gain.closed_loop(), disturbance).unwrap();
    let directions: Vec<_> = (0..INPUTS).map(|i| Matrix2::new(1.0, i as f64, -0.5, 0.3)).collect();
    assert_none("supports", |i| set.supports(&directions[i], 1e-6));
    let gains: Vec<_> = (0..INPUTS).map(|i| AxisGain { damping: 2.0 + 0.01 * i as f64, ..gain }).collect();
    assert_none("MinimalInvariantSet", |i| MinimalInvariantSet::try_new(gains[i].closed_loop(), disturbance));
    assert_none("AxisTemplate", |i| AxisTemplate::try_new(gains[i], &disturbance));
    let weight = Matrix2::identity();
    assert_none("discrete_lqr", |i| discrete_lqr(&gains[i].closed_loop(), &gain.input(), &weight, &Matrix1::new(1.0)));
}

#[test]
fn coupled_axes_and_their_planes() {
    let mut axes = CoupledAxes::try_new(fixed_planes::problems()).unwrap();
    let ball = |x: f64, speed_m_s: f64| {
        let pose = Pose::from_parts(Vector3::new(x, 0.1, 0.0).into(), UnitQuaternion::identity());
        let ball = ObstacleEllipsoid { world_from_ellipsoid: pose, semi_axes: Vector3::new(0.1, 0.2, 0.15) };
        Barrier::Ellipsoid(MovingObstacle::at_rest(ball).drifting(Vector3::y() * speed_m_s, 0.0))
    };
    let wall = AlignedBox { lower_world: Vector3::repeat(0.3), upper_world: Vector3::repeat(0.6) };
    let barriers = [ball(-0.45, 0.0), ball(0.45, 0.003), Barrier::Box(wall)];
    let body = BodyShape::sphere(0.1).unwrap();
    let steps = fixed_planes::STEPS;
    let mut planes = ObstaclePlanes::try_new(&body, &Vector3::zeros(), &barriers, steps).unwrap();
    let attitudes = vec![UnitQuaternion::identity(); steps + 1];
    let (mut positions, mut rows) = (Vec::with_capacity(steps + 1), Vec::with_capacity(6 * steps));
    let mut states = [Vector2::zeros(); 3];
    let (mut solved, mut most_rows) = (0, 0);
    let step = |call: usize| {
        let references = [[Vector2::new(0.4, 0.0)], [Vector2::new(-0.2, 0.0)], [Vector2::new(0.1, 0.0)]];
        if call == 0 {
            states = [Vector2::zeros(); 3];
            axes.begin(&states);
            planes.forget();
        }
        axes.positions(&mut positions);
        let path = NominalPath {
            start_s: 0.2 * call as f64,
            step_s: 0.2,
            positions: &positions,
            tube_m: axes.tube_m(),
            world_from_axes: UnitQuaternion::identity(),
            attitudes: &attitudes,
            turn_rad_s: 0.01,
            end: EndAttitude::Any,
            attitude_error_rad: 0.02,
        };
        let reach = axes.reach(&states);
        planes.update(&path, &reach).unwrap();
        planes.rows(&path, &reach, &mut rows);
        most_rows = most_rows.max(rows.len());
        axes.set_planes(&rows);
        let [x, y, z] = &references;
        solved += usize::from(axes.solve(&states, [x, y, z]) == GramStatus::Solved);
        axes.advance();
        planes.advance();
        for (state, plan) in states.iter_mut().zip(axes.plans()) {
            *state = plan.start;
        }
    };
    assert_eq!(allocations(CALLS / 20, step), 0);
    assert!(solved > CALLS / 25 && most_rows > 10, "{solved} {most_rows}");
}
