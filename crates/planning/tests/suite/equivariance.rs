//! Scaling mass, length and time by powers of ten scales every answer: no tolerance hides that knows what a metre is.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::float_cmp)]

use tumble_planning::collision::{
    BodyEllipsoid, BodyShape, CollisionWorld as _, Ellipsoid, EllipsoidWorld, HalfSpace, MovingObstacle, Separation,
    Sphere, distance, distance_from_hint, ellipsoid_to_box, ellipsoid_to_half_space, ellipsoid_to_sphere,
    scaling_margin, separation, sphere_to_box,
};
use tumble_planning::dynamics::strategies::{draws, poses};
use tumble_planning::dynamics::{AlignedBox, InertialParameters, ObstacleEllipsoid, World};
use tumble_planning::global::{GlobalRequest, GoalRegion, MotionLimits, Objective, RouteBound, Until, diagnose};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{Matrix3, Vector3};
use tumble_planning::steering::{
    least_time_s, least_time_to_goal_s, least_velocity_change_m_s, slew, steer, steer_to_goal,
};
use tumble_planning::{BodyArc, COEFFICIENTS, ModelBelief, TranslationState, Units};

/// Units of mass, length and time, in those of the scene as it is written.
#[derive(Clone, Copy, Debug)]
struct Scale {
    mass: f64,
    length: f64,
    time: f64,
}

const ONE: Scale = Scale { mass: 1.0, length: 1.0, time: 1.0 };

/// Micrometres to megametres, microseconds to weeks.
fn scales() -> Vec<Scale> {
    let mut scales = Vec::new();
    for (length, time) in [(1e-6, 1e-6), (1e-6, 1e6), (1e-3, 1.0), (1e3, 1e3), (1e6, 1e-6), (1e6, 1e6)] {
        for mass in [1e-6, 1e6] {
            scales.push(Scale { mass, length, time });
        }
    }
    scales
}

impl Scale {
    fn speed(&self) -> f64 {
        self.length / self.time
    }

    fn acceleration(&self) -> f64 {
        self.speed() / self.time
    }

    fn force(&self) -> f64 {
        self.mass * self.acceleration()
    }

    fn pose(&self, pose: &Pose<f64>) -> Pose<f64> {
        Pose::from_parts((pose.translation.vector * self.length).into(), pose.rotation)
    }

    fn aligned_box(&self, lower: Vector3<f64>, upper: Vector3<f64>) -> AlignedBox {
        AlignedBox { lower_world: lower * self.length, upper_world: upper * self.length }
    }

    fn state(&self, position: Vector3<f64>, velocity: Vector3<f64>) -> TranslationState {
        TranslationState { position: position * self.length, velocity: velocity * self.speed() }
    }

    fn limits(&self) -> MotionLimits {
        MotionLimits {
            position: self.aligned_box(Vector3::new(-3.0, -2.0, -1.0), Vector3::new(3.0, 2.0, 1.0)),
            speed_m_s: Vector3::new(0.1, 0.2, 0.1) * self.speed(),
            force_n: Vector3::new(0.2, 0.1, 0.5) * self.force(),
            torque_n_m: Vector3::new(0.015, 0.02, 0.05) * (self.force() * self.length),
            rate_rad_s: 0.1 / self.time,
        }
    }

    fn goal(&self, position: Vector3<f64>, radius: f64, speed: f64) -> GoalRegion {
        GoalRegion {
            position: position * self.length,
            radius_m: radius * self.length,
            speed_m_s: speed * self.speed(),
            attitude: None,
        }
    }
}

/// An answer with the size of what it was computed from; both in the same unit.
struct Answer {
    name: &'static str,
    value: f64,
    /// What the relative tolerance counts from.
    size: f64,
    tolerance: f64,
}

fn answer(name: &'static str, value: f64, size: f64, tolerance: f64) -> Answer {
    Answer { name, value, size, tolerance }
}

/// Every answer in units of the scale agrees with the one at scale one.
fn check(what: impl Fn(Scale) -> Vec<Answer>) {
    let reference = what(ONE);
    assert!(reference.len() >= 3);
    for scale in scales() {
        let found = what(scale);
        assert_eq!(found.len(), reference.len(), "{scale:?}");
        for (index, (found, reference)) in found.iter().zip(&reference).enumerate() {
            let is_same = found.value == reference.value
                || (found.value - reference.value).abs() <= reference.tolerance * reference.size;
            let Answer { name, value, .. } = found;
            assert!(is_same, "{scale:?} {name} ({index}): {value} instead of {}", reference.value);
        }
    }
}

fn semi_axes(i: usize) -> Vector3<f64> {
    [Vector3::new(0.4, 0.1, 0.3), Vector3::new(0.2, 0.9, 0.2), Vector3::repeat(0.3)][i % 3]
}

#[test]
fn distances_and_overlap() {
    let (first, second) = (draws(&poses(0.7), 1, 60), draws(&poses(0.7), 2, 60));
    check(|scale| {
        let mut answers = Vec::new();
        let body =
            |pose: &Pose<f64>, i: usize| Ellipsoid::try_new(&scale.pose(pose), &(semi_axes(i) * scale.length)).unwrap();
        let aligned = scale.aligned_box(Vector3::new(-0.1, -0.5, 0.0), Vector3::new(0.4, 0.2, 0.3));
        let wall = HalfSpace { inward: Vector3::z_axis(), offset_m: 0.2 * scale.length };
        for (i, (first, second)) in first.iter().zip(&second).enumerate() {
            let (a, b) = (body(first, i), body(second, i / 3));
            let sphere = Sphere { center: *b.center(), radius_m: 0.1 * scale.length };
            let mut add = |name, found: f64| answers.push(answer(name, found / scale.length, 1.0, 1e-11));
            let found = distance(&a, &b);
            add("distance", found.distance_m);
            add("lower bound", found.lower_bound_m);
            add("distance from a hint", distance_from_hint(&a, &b, &found.normal).distance_m);
            add("sphere", ellipsoid_to_sphere(&a, &sphere).distance_m);
            add("box", ellipsoid_to_box(&a, &aligned).distance_m);
            add("sphere and box", sphere_to_box(&sphere, &aligned).distance_m);
            add("half-space", ellipsoid_to_half_space(&a, &wall).distance_m);
            let margin = scaling_margin(&a, &b);
            let is_apart = matches!(separation(&a, &b), Separation::Apart(_));
            answers.push(answer("overlap", f64::from(u8::from(is_apart)), 0.0, 0.0));
            answers.push(answer("margin", margin.value, 1.0, 1e-11));
            answers.push(answer("slope of the margin", margin.gradient[0] * scale.length, 10.0, 1e-9));
        }
        answers
    });
}

/// Gaps of a part in `1e10` of the size are told from none at every scale.
#[test]
fn near_contacts() {
    check(|scale| {
        let mut answers = Vec::new();
        for gap in [-1e-6, -1e-10, 1e-10, 1e-6] {
            let at = |x: f64, axes: Vector3<f64>| {
                Ellipsoid::try_new(&Pose::translation(x * scale.length, 0.0, 0.0), &(axes * scale.length)).unwrap()
            };
            let (a, b) = (at(0.0, Vector3::new(0.5, 0.2, 0.3)), at(1.0 + gap, Vector3::new(0.5, 0.1, 0.4)));
            let is_apart = matches!(separation(&a, &b), Separation::Apart(_));
            assert_eq!(is_apart, gap > 0.0);
            answers.push(answer("overlap", f64::from(u8::from(is_apart)), 0.0, 0.0));
            answers.push(answer("gap", distance(&a, &b).distance_m / scale.length, 1.0, 1e-14));
        }
        answers
    });
}

fn world(scale: &Scale) -> EllipsoidWorld {
    let obstacle = |(i, pose): (usize, &Pose<f64>)| ObstacleEllipsoid {
        world_from_ellipsoid: scale.pose(pose),
        semi_axes: semi_axes(i) * (0.5 * scale.length),
    };
    let placed = draws(&poses(2.5), 5, 60);
    let world = World {
        keep_in: vec![scale.aligned_box(Vector3::repeat(-3.0), Vector3::repeat(3.0))],
        keep_out: vec![scale.aligned_box(Vector3::new(1.0, 1.0, -3.0), Vector3::new(1.5, 1.5, 3.0))],
        obstacles: placed.iter().enumerate().map(obstacle).collect(),
    };
    let moving = MovingObstacle::at_rest(world.obstacles[0])
        .drifting(Vector3::new(0.01, 0.0, 0.02) * scale.speed(), 0.5 * scale.time)
        .present(2.0 * scale.time, 6.0 * scale.time);
    EllipsoidWorld::new(&world).unwrap().with_obstacle(moving).unwrap()
}

fn body(scale: &Scale) -> BodyShape {
    let part = |x: f64, semi_axes: Vector3<f64>| BodyEllipsoid {
        body_from_ellipsoid: Pose::translation(x * scale.length, 0.0, 0.0),
        semi_axes: semi_axes * scale.length,
    };
    BodyShape::try_new(vec![part(0.1, Vector3::new(0.2, 0.1, 0.15)), part(-0.1, Vector3::repeat(0.1))]).unwrap()
}

#[test]
fn clearances_and_first_contacts() {
    let placed = draws(&poses(2.0), 6, 60);
    check(|scale| {
        let (world, body) = (world(&scale), body(&scale));
        let mut answers = Vec::new();
        for (i, pose) in placed.iter().enumerate() {
            let pose = scale.pose(pose);
            let time_s = 3.0 * scale.time;
            let clearance = world.clearance(&body, &pose, time_s).unwrap();
            answers.push(answer("clearance", clearance.distance_m / scale.length, 1.0, 1e-11));
            let velocity = Vector3::new(0.3, -0.2, 0.1) * scale.speed();
            let start = TranslationState { position: pose.translation.vector, velocity };
            let acceleration = Vector3::new(-0.01, 0.02, 0.01) * scale.acceleration();
            let arc = BodyArc::accelerated(8.0 * scale.time, &start, acceleration, pose.rotation);
            let mut angle = [0.0; COEFFICIENTS];
            (angle[1], angle[2]) = (0.2 / scale.time, -0.02 / (scale.time * scale.time));
            let arc = if i % 2 == 0 { arc } else { arc.turning(Vector3::y_axis(), angle) };
            let contact = world.first_contact(&body, &arc, scale.time, 0.01 * scale.length).unwrap();
            let contact_s = contact.map_or(f64::INFINITY, |contact| contact.time_s);
            answers.push(answer("first contact", contact_s / scale.time, 1.0, 1e-9));
        }
        let hits = answers.iter().filter(|answer| answer.name == "first contact" && answer.value.is_finite()).count();
        assert!(hits > 10 && hits < 60, "{hits}");
        answers
    });
}

#[test]
fn motions() {
    let ends = draws(&poses(0.9), 7, 61);
    check(|scale| {
        let limits = scale.limits().translation(10.0 * scale.mass).unwrap();
        let mut answers = Vec::new();
        for (i, pair) in ends.windows(2).enumerate() {
            let velocity = if i % 3 == 0 { Vector3::zeros() } else { Vector3::new(0.05, -0.1, 0.02) };
            let from = scale.state(pair[0].translation.vector, velocity);
            let to = scale.state(pair[1].translation.vector, if i % 3 == 1 { velocity } else { Vector3::zeros() });
            let mut add = |name, value: f64, size: f64, tolerance| answers.push(answer(name, value, size, tolerance));
            add("least time", least_time_s(&from, &to, &limits) / scale.time, 10.0, 1e-12);
            let motion = steer(&from, &to, &limits);
            add("motion", motion.map_or(f64::INFINITY, |motion| motion.duration_s()) / scale.time, 10.0, 1e-12);
            let spent = motion.map_or(f64::INFINITY, |motion| motion.velocity_change_m_s());
            add("change of velocity", spent / scale.speed(), 1.0, 1e-11);
            let change = least_velocity_change_m_s(&from, &to, &limits, 60.0 * scale.time);
            add("least change of velocity", change / scale.speed(), 1.0, 1e-11);
            let goal = scale.goal(pair[1].translation.vector, 0.1, 0.03);
            add("least time to a region", least_time_to_goal_s(&from, &goal, &limits) / scale.time, 10.0, 1e-11);
        }
        answers
    });
}

/// A search decides by roundings; units that are powers of two leave those alone, so that nothing at all may differ.
#[test]
fn motions_to_a_region() {
    let ends = draws(&poses(0.9), 9, 101);
    let at = |scale: Scale| -> Vec<Option<f64>> {
        let limits = scale.limits().translation(10.0 * scale.mass).unwrap();
        let motion = |pair: &[Pose<f64>]| {
            let from = scale.state(pair[0].translation.vector, Vector3::new(0.05, -0.1, 0.02));
            let goal = scale.goal(pair[1].translation.vector, 0.1, 0.03);
            steer_to_goal(&from, &goal, &limits).map(|motion| motion.duration_s() / scale.time)
        };
        ends.windows(2).map(motion).collect()
    };
    let reference = at(ONE);
    assert!(reference.iter().flatten().count() > 50);
    let [small, large] = [-10, 10].map(|power| f64::powi(2.0, power));
    for (length, time, mass) in [(small, 1.0, 1.0), (large, 1.0, small), (1.0, small, 1.0), (small, large, large)] {
        assert_eq!(at(Scale { mass, length, time }), reference, "{length} {time} {mass}");
    }
}

#[test]
fn turns() {
    let attitudes = draws(&poses(1.0), 8, 41);
    let inertia = Matrix3::new(0.15, 0.01, 0.0, 0.01, 0.2, 0.02, 0.0, 0.02, 0.16);
    check(|scale| {
        let inertia = inertia * (scale.mass * scale.length * scale.length);
        let turn = |pair: &[Pose<f64>]| {
            let turn = slew(&pair[0].rotation, &pair[1].rotation, &inertia, &scale.limits()).unwrap().unwrap();
            let duration = answer("duration", turn.duration_s() / scale.time, 10.0, 1e-12);
            [duration, answer("rate", turn.rate_rad_s() * scale.time, 0.1, 1e-12)]
        };
        attitudes.windows(2).flat_map(turn).collect()
    });
}

#[test]
fn bounds_and_diagnoses() {
    check(|scale| {
        let world = EllipsoidWorld::new(&World {
            keep_in: Vec::new(),
            // A wall across, with a gap at one side.
            keep_out: vec![scale.aligned_box(Vector3::new(-0.2, -2.0, -1.5), Vector3::new(0.2, 1.2, 1.5))],
            obstacles: Vec::new(),
        });
        let (world, body) = (world.unwrap(), BodyShape::sphere(0.15 * scale.length).unwrap());
        let belief = ModelBelief::certain(0, InertialParameters::solid_box(10.0 * scale.mass, [0.3 * scale.length; 3]));
        let request = |goal: GoalRegion, objective| GlobalRequest {
            world: &world,
            body: &body,
            start: scale.state(Vector3::new(-2.0, 0.0, 0.0), Vector3::new(0.02, 0.0, 0.0)),
            attitude: Pose::<f64>::identity().rotation,
            start_s: 0.0,
            goal,
            limits: scale.limits(),
            belief: &belief,
            objective,
            margin_m: 0.02 * scale.length,
            until: Until::FirstPlan,
            seed: 0,
        };
        let mut answers = Vec::new();
        for (name, objective, unit) in [
            ("least duration", Objective::Duration, scale.time),
            ("least impulse", Objective::Impulse, scale.mass * scale.speed()),
        ] {
            let request = request(scale.goal(Vector3::new(2.0, 0.0, 0.0), 0.05, 0.0), objective);
            assert!(diagnose(&request).unwrap().is_none());
            let mut bound = RouteBound::new(&request).unwrap();
            let mut budget = Units::new(20_000);
            for _ in 0..3 {
                bound.refine(&mut budget).unwrap();
                answers.push(answer(name, bound.lower_bound() / unit, 10.0, 1e-9));
            }
            let corners = bound.free_route().len() as f64;
            answers.push(answer("corners of the free route", corners, 0.0, 0.0));
            // Rounding decides whether a cell needs a query of its own.
            answers.push(answer("units", budget.spent() as f64, 1e4, 1e-2));
        }
        let inside_wall = request(scale.goal(Vector3::zeros(), 0.05, 0.0), Objective::Duration);
        let blocked = diagnose(&inside_wall).unwrap().is_some();
        answers.push(answer("a blocked goal", f64::from(u8::from(blocked)), 0.0, 0.0));
        answers
    });
}
