//! What the simulator keeps: momentum, the plane, time; what it says and what it refuses.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use tumble_astrobee::propulsion::{ImpellerMode, PropulsionSettings};
use tumble_astrobee::sensing::{Localization, SensingPreset};
use tumble_astrobee::simulator::{
    Actuators, AstrobeeSimulator, CONTROL_PERIOD_S, Event, Grasp, PayloadMotion, SimulatorError, SimulatorSettings,
};
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::nalgebra::{Isometry2, Matrix3, UnitComplex, UnitQuaternion, Vector2, Vector3};
use tumble_dynamics::{
    AlignedBox, Environment, FreeFlyer, FreeFlyerIn, GravityGradient, GroupState, InertialParameters, Integrator,
    LinearDrag, MuntheKaas4, ObstacleEllipsoid, PlanarBody, PlanarWrench, Plant, ReactionWheel, ReactionWheels,
    RigidBodyState, SimulatedGyrostat, StatefulDrive, WrenchBox, spatial_momentum,
};
use tumble_identification::noise::Gaussian;
use tumble_lie::{LieGroup, Pose, Twist, Wrench};

fn state(position: [f64; 3], turn: [f64; 3], rate: [f64; 3], velocity: [f64; 3]) -> RigidBodyState<f64> {
    let rotation = <UnitQuaternion<f64> as LieGroup>::exp(&Vector3::from(turn));
    RigidBodyState {
        world_from_body: Pose::from_parts(Vector3::from(position).into(), rotation),
        twist_body: Twist::new(Vector3::from(rate), Vector3::from(velocity)),
    }
}

fn tumbling() -> RigidBodyState<f64> {
    state([0.3, -0.2, 0.5], [0.4, -0.9, 0.2], [0.31, -0.22, 0.47], [0.02, 0.015, -0.03])
}

fn wrench(torque: [f64; 3], force: [f64; 3]) -> Wrench<f64> {
    Wrench::new(Vector3::from(torque), Vector3::from(force))
}

fn grasp() -> Grasp {
    let inertia = Matrix3::new(0.02, 0.003, -0.001, 0.003, 0.03, 0.002, -0.001, 0.002, 0.025);
    Grasp {
        payload: InertialParameters::about_com(3.1, Vector3::new(0.02, -0.05, 0.01), inertia),
        robot_from_payload: state([-0.3, 0.1, 0.05], [0.3, 0.5, -0.7], [0.0; 3], [0.0; 3]).world_from_body,
    }
}

fn difference(a: &Wrench<f64>, b: &Wrench<f64>) -> f64 {
    (*a - *b).to_vector().amax()
}

#[test]
fn momentum_is_kept_over_a_hundred_thousand_steps() {
    let mut robot = AstrobeeSimulator::try_new(SimulatorSettings::ideal(WorldPreset::Open, tumbling())).unwrap();
    let before = robot.spatial_momentum();
    for _ in 0..1000 {
        // A hundred periods of two steps each.
        robot.advance(&Wrench::zero(), 50.0 * CONTROL_PERIOD_S).unwrap();
    }
    let drift = difference(&robot.spatial_momentum(), &before);
    assert!(drift < 1e-10, "{drift:e}");
    assert_eq!(robot.time_ns(), 800_000_000_000);
    assert!((robot.state().world_from_body.rotation.norm() - 1.0).abs() < 1e-12);
}

#[test]
fn it_follows_a_fourth_order_integrator_under_changing_wrenches() {
    let body = WorldPreset::Open.body();
    let mut robot = AstrobeeSimulator::try_new(SimulatorSettings::ideal(WorldPreset::Open, tumbling())).unwrap();
    let (flyer, mut exact) = (FreeFlyer::new(body), tumbling());
    for k in 0..1000 {
        let phase = 0.02 * f64::from(k);
        let push = wrench([0.01 * phase.sin(), 0.02, -0.01 * phase.cos()], [0.3, 0.2 * phase.sin(), -0.1]);
        robot.advance(&push, CONTROL_PERIOD_S).unwrap();
        for _ in 0..4 {
            exact = MuntheKaas4.step(&flyer, &exact, &push, 0.0, CONTROL_PERIOD_S / 4.0).unwrap();
        }
    }
    let error = exact.world_from_body.inv_mul(&robot.state().world_from_body);
    let (distance, angle) = (error.translation.vector.norm(), error.rotation.angle());
    // Second order at 8 ms over 16 s in which the body travels metres and turns several times.
    assert!(distance < 1e-3 && angle < 1e-3, "{distance:e} {angle:e}");
}

/// In a wind, under a gradient that goes round, turned by wheels that spin: as a gyrostat in the same environment goes.
#[test]
fn it_follows_a_fourth_order_integrator_among_what_else_acts() {
    let mut settings = SimulatorSettings::ideal(WorldPreset::Open, tumbling());
    let air = LinearDrag {
        center_of_pressure: Vector3::new(0.05, -0.02, 0.03),
        force_coefficient: 0.3,
        torque_coefficient: 0.01,
        medium_velocity_world: Vector3::new(0.2, -0.1, 0.05),
    };
    let gravity = GravityGradient::of_point_mass(settings.body, 0.01, Vector3::new(0.6, 0.0, 0.8), Vector3::y() * 0.1);
    let wheel = |axis_body| ReactionWheel { axis_body, largest_torque_n_m: 0.1, largest_momentum_n_m_s: 1.0 };
    let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
    let wheels = ReactionWheels::try_new(axes.map(wheel)).unwrap();
    let stored = Vector3::new(0.2, -0.1, 0.15);
    settings.environment = Environment::default().with(air).with(gravity);
    settings.actuators = Actuators::Other(Box::new(StatefulDrive::new(wheels, stored)));
    let system = FreeFlyerIn { body: FreeFlyer::new(settings.body), environment: (air, gravity) };
    let mut robot = AstrobeeSimulator::try_new(settings).unwrap();
    let mut exact =
        SimulatedGyrostat::try_new(system, MuntheKaas4, (wheels, stored), tumbling(), CONTROL_PERIOD_S / 4.0).unwrap();
    for k in 0..1000 {
        let phase = 0.02 * f64::from(k);
        let turn = wrench([0.01 * phase.sin(), 0.02, -0.01 * phase.cos()], [0.0; 3]);
        let measured = robot.advance(&turn, CONTROL_PERIOD_S).unwrap();
        let after = exact.advance(&turn, CONTROL_PERIOD_S).unwrap();
        assert!((measured.stored_momentum_body[1] - after.stored_momentum_body).amax() < 1e-12);
        // of wheels the robot is told what their motors did, and not what turning them did
        assert!(difference(&measured.believed_wrench_body, &after.realized_wrench_body) < 1e-12);
    }
    let error = exact.state().world_from_body.inv_mul(&robot.state().world_from_body);
    let (distance, angle) = (error.translation.vector.norm(), error.rotation.angle());
    assert!(distance < 1e-4 && angle < 1e-3, "{distance:e} {angle:e}");
}

#[test]
fn momentum_is_kept_through_grasp_and_release() {
    for (place, start) in [
        (WorldPreset::Open, tumbling()),
        (WorldPreset::Granite, state([0.1, -0.2, -0.7], [0.0, 0.0, 0.8], [0.0, 0.0, 0.4], [0.05, -0.03, 0.0])),
    ] {
        let mut robot = AstrobeeSimulator::try_new(SimulatorSettings::ideal(place, start)).unwrap();
        let alone = robot.spatial_momentum();
        // At rest it brings no momentum of its own, so the robot's is everybody's.
        robot.attach(grasp(), PayloadMotion::AtRest).unwrap();
        let held = robot.spatial_momentum();
        assert!(difference(&held, &alone) < 1e-12, "{place:?} {:e}", difference(&held, &alone));
        assert!((robot.state().twist_body - start.twist_body).to_vector().amax() > 1e-3);
        assert_eq!(robot.state().world_from_body, start.world_from_body);
        assert!((robot.body().mass - place.body().mass - 3.1).abs() < 1e-12);

        robot.advance(&Wrench::zero(), 100.0 * CONTROL_PERIOD_S).unwrap();
        assert!(difference(&robot.spatial_momentum(), &held) < 1e-12);

        let twist = robot.state().twist_body;
        let released = robot.release().unwrap();
        let planar_only = |momentum: Wrench<f64>| {
            if place.is_planar() {
                wrench([0.0, 0.0, momentum.torque.z], [momentum.force.x, momentum.force.y, 0.0])
            } else {
                momentum
            }
        };
        let apart =
            planar_only(spatial_momentum(&released.payload, &released.state)) + planar_only(robot.spatial_momentum());
        assert!(difference(&apart, &planar_only(held)) < 1e-12, "{place:?}");
        assert_eq!(robot.state().twist_body, twist, "the robot does not feel the release");
        let events: Vec<Event> = robot.events().iter().map(|event| event.event).collect();
        assert!(events.ends_with(&[Event::PayloadAttached, Event::PayloadReleased]));
    }
}

#[test]
fn a_payload_that_moves_with_the_robot_brings_its_own_momentum() {
    let mut robot = AstrobeeSimulator::try_new(SimulatorSettings::ideal(WorldPreset::Open, tumbling())).unwrap();
    let grasp = grasp();
    let before = robot.spatial_momentum();
    // The velocity of a body fixed to the robot, from the pose and the twist by hand.
    let to_payload = grasp.robot_from_payload;
    let rate = tumbling().twist_body.angular;
    let velocity = tumbling().twist_body.linear + rate.cross(&to_payload.translation.vector);
    let payload = RigidBodyState {
        world_from_body: tumbling().world_from_body * to_payload,
        twist_body: Twist::new(to_payload.rotation.inverse() * rate, to_payload.rotation.inverse() * velocity),
    };
    let brought = spatial_momentum(&grasp.payload, &payload);
    robot.attach(grasp, PayloadMotion::WithRobot).unwrap();
    assert!(difference(&robot.spatial_momentum(), &(before + brought)) < 1e-12);
    assert_eq!(robot.state().twist_body, tumbling().twist_body);
    assert_eq!(robot.attach(grasp, PayloadMotion::AtRest), Err(SimulatorError::PayloadHeld));
    robot.release().unwrap();
    assert_eq!(robot.release(), Err(SimulatorError::NoPayload));
}

#[test]
fn on_the_table_nothing_leaves_the_plane_and_the_motion_is_that_of_a_planar_body() {
    let start = state([0.0, 0.0, -0.7], [0.0, 0.0, 0.3], [0.0, 0.0, 0.2], [0.01, 0.0, 0.0]);
    let mut settings = SimulatorSettings::ideal(WorldPreset::Granite, start);
    settings.body = WorldPreset::Granite.body().with_payload(&grasp().payload, &grasp().robot_from_payload);
    let body = settings.body;
    let mut robot = AstrobeeSimulator::try_new(settings).unwrap();
    let com = body.center_of_mass();
    let planar = PlanarBody {
        mass: body.mass,
        inertia_about_com: body.inertia_about_com().m33,
        center_of_mass: Vector2::new(com.x, com.y),
    };
    let mut exact = GroupState {
        configuration: Isometry2::from_parts(Vector2::zeros().into(), UnitComplex::new(0.3)),
        velocity: Vector3::new(0.2, 0.01, 0.0),
    };
    let mut random = Gaussian::from_seed(4);
    for k in 0..50_000_u32 {
        let push = Wrench::new(random.vector(0.02), random.vector(0.2));
        let measured = robot.advance(&push, CONTROL_PERIOD_S).unwrap();
        let pose = &measured.end.state.world_from_body;
        let twist = &measured.end.state.twist_body;
        assert_eq!(pose.translation.z.to_bits(), (-0.7_f64).to_bits());
        for zero in [pose.rotation.i, pose.rotation.j, twist.angular.x, twist.angular.y, twist.linear.z] {
            assert!(zero == 0.0, "step {k}: {zero:e}");
        }
        if k < 500 {
            let push = PlanarWrench { torque: push.torque.z, force: Vector2::new(push.force.x, push.force.y) };
            exact = MuntheKaas4.step(&planar, &exact, &push, 0.0, CONTROL_PERIOD_S).unwrap();
            let found = pose.translation.vector.xy() - exact.configuration.translation.vector;
            let turned = 2.0 * pose.rotation.k.atan2(pose.rotation.w) - exact.configuration.rotation.angle();
            assert!(found.norm() < 1e-4 && turned.sin().abs() < 1e-4, "step {k}: {found} {turned}");
        }
    }
}

#[test]
fn a_leaning_start_on_the_table_and_odd_durations_are_refused() {
    for start in [
        state([0.0, 0.0, -0.7], [0.01, 0.0, 0.0], [0.0; 3], [0.0; 3]),
        state([0.0, 0.0, -0.7], [0.0; 3], [0.0, 0.1, 0.0], [0.0; 3]),
        state([0.0, 0.0, -0.7], [0.0; 3], [0.0; 3], [0.0, 0.0, 0.1]),
    ] {
        let refused = AstrobeeSimulator::try_new(SimulatorSettings::ideal(WorldPreset::Granite, start));
        assert!(matches!(refused.err(), Some(SimulatorError::OutOfPlane { .. })));
    }
    let mut robot = AstrobeeSimulator::try_new(SimulatorSettings::ideal(WorldPreset::Open, tumbling())).unwrap();
    for duration_s in [0.0, -0.016, 0.01, 0.02, f64::NAN, f64::INFINITY] {
        assert!(robot.advance(&Wrench::zero(), duration_s).is_err(), "{duration_s}");
    }
    assert!(robot.advance(&wrench([f64::NAN; 3], [0.0; 3]), CONTROL_PERIOD_S).is_err());
    assert_eq!((robot.time_ns(), robot.state()), (0, &tumbling()));
}

#[test]
fn walls_obstacles_and_limits_are_events_and_nothing_stops_the_body() {
    let mut settings =
        SimulatorSettings::ideal(WorldPreset::Open, state([0.0; 3], [0.0; 3], [0.0; 3], [0.5, 0.0, 0.0]));
    settings.world.keep_in = vec![AlignedBox::between(Vector3::repeat(-1.0), Vector3::new(3.0, 1.0, 1.0))];
    settings.world.keep_out = vec![AlignedBox::between(Vector3::new(2.0, 0.1, -1.0), Vector3::new(2.2, 1.0, 1.0))];
    settings.world.obstacles = vec![ObstacleEllipsoid {
        world_from_ellipsoid: Pose::translation(1.0, 0.0, 0.0),
        semi_axes: Vector3::new(0.1, 0.5, 0.5),
    }];
    settings.table_half_width_m = Some(2.5);
    settings.speed_limit_m_s = 0.4;
    let mut robot = AstrobeeSimulator::try_new(settings).unwrap();
    robot.advance(&Wrench::zero(), 500.0 * CONTROL_PERIOD_S).unwrap();
    let found: Vec<(f64, Event)> = robot.events().iter().map(|e| (e.time_ns as f64 * 0.5e-9, e.event)).collect();
    // Where the origin is (0.5 m/s) when each happens: the sphere has a radius of 0.15 m and its centre is 0.1 m beside the box.
    let beside = (0.15_f64 * 0.15 - 0.1 * 0.1).sqrt();
    let expected = [
        (0.0, Event::TooFast),
        (0.75, Event::HitObstacle { index: 0 }),
        (1.25, Event::LeftObstacle),
        (2.0 - beside, Event::EnteredKeepOut { index: 0 }),
        (2.2 + beside, Event::LeftKeepOut),
        (2.5, Event::LeftTable),
        (3.0, Event::LeftKeepIn),
    ];
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for ((at, event), (expected_at, expected_event)) in found.iter().zip(expected) {
        assert_eq!(*event, expected_event);
        assert!((at - expected_at).abs() < 0.0091, "{event:?} at {at} m, not {expected_at} m");
    }
    assert!((robot.state().world_from_body.translation.x - 4.0).abs() < 1e-9);
}

/// The robot with hardware, drag and nominal sensors.
fn complete(seed: u64) -> AstrobeeSimulator {
    let start = RigidBodyState { world_from_body: WorldPreset::Iss.pose("A").unwrap(), ..RigidBodyState::at_rest() };
    let mut settings = SimulatorSettings::ideal(WorldPreset::Iss, start);
    let mode = ImpellerMode::Nominal;
    settings.drag = Some(tumble_astrobee::air_drag::air_drag());
    settings.actuators = Actuators::hardware(mode, settings.body.center_of_mass(), PropulsionSettings::PHYSICAL);
    settings.sensors = Some(Localization::new(&SensingPreset::Nominal.settings(), seed, mode).unwrap());
    AstrobeeSimulator::try_new(settings).unwrap()
}

#[test]
fn a_row_pairs_pose_acceleration_and_wrench_of_one_instant() {
    let mut settings = SimulatorSettings::ideal(WorldPreset::Open, tumbling());
    let perfect = SensingPreset::Perfect.settings();
    settings.sensors = Some(Localization::new(&perfect, 1, ImpellerMode::Nominal).unwrap());
    let flyer = FreeFlyer::new(settings.body);
    settings.actuators =
        Actuators::Limited(WrenchBox { torque_limit: Vector3::repeat(0.01), force_limit: Vector3::repeat(0.1) });
    let mut robot = AstrobeeSimulator::try_new(settings).unwrap();
    for k in 0..20 {
        let asked = wrench([0.02, 0.001 * f64::from(k), 0.0], [0.05, -0.3, 0.01 * f64::from(k)]);
        let measured = robot.advance(&asked, CONTROL_PERIOD_S).unwrap();
        assert!(measured.saturated);
        assert_eq!(measured.believed_wrench_body, measured.realized_wrench_body);
        assert!((measured.realized_wrench_body.force.y + 0.1).abs() < 1e-15);
        let estimate = robot.estimates()[0];
        assert_eq!(estimate.stamp_ns, 16_000_000 * i64::from(k));
        let pose = measured.start.state.world_from_body;
        assert!((estimate.world_from_body.inv_mul(&pose).translation.vector).norm() < 1e-12);
        let acting = flyer.forward(&measured.start.state.twist_body, &measured.realized_wrench_body);
        let error = estimate.acceleration_origin_body - acting.acceleration_origin_body;
        assert!(error.norm() < 1e-12, "step {k}: {error}");
    }
}

#[test]
fn hardware_gives_what_is_wanted_in_the_long_run() {
    let mut robot = complete(3);
    let wanted = wrench([0.005, 0.004, -0.003], [0.1, 0.05, -0.04]);
    for _ in 0..125 {
        robot.advance(&wanted, CONTROL_PERIOD_S).unwrap();
    }
    let measured = robot.advance(&wanted, CONTROL_PERIOD_S).unwrap();
    let force = (measured.realized_wrench_body.force - wanted.force).norm();
    let torque = (measured.realized_wrench_body.torque - wanted.torque).norm();
    // One module leaks less than the allocation believes: 5 %.
    assert!(force < 0.1 * wanted.force.norm() && torque < 2e-3, "{force} {torque}");
    assert!((measured.believed_wrench_body.force - measured.realized_wrench_body.force).norm() < 5e-3);
    assert!(!measured.saturated);
}
