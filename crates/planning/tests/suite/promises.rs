//! What geometry, steering and bounds of planning promise of any numbers: no panic, no loop without end, and no answer that
//! is not a number. Either the numbers are refused with a typed error, or the answer can be used.

use tumble_planning::collision::{
    BodyEllipsoid, BodyShape, CollisionWorld as _, Distance, Ellipsoid, EllipsoidWorld, HalfSpace, MovingObstacle,
    Separation, Sphere, distance, distance_from_hint, ellipsoid_to_box, ellipsoid_to_half_space, ellipsoid_to_point,
    ellipsoid_to_sphere, keep_in_complement, overlap, scaling_margin, separation, sphere_to_box, sphere_to_half_space,
    sphere_to_sphere,
};
use tumble_planning::dynamics::{AlignedBox, InertialParameters, ObstacleEllipsoid, World};
use tumble_planning::global::{GlobalRequest, GoalRegion, MotionLimits, Objective, RouteBound, Until, diagnose};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{Matrix3, Quaternion, Unit, UnitQuaternion, Vector3};
use tumble_planning::steering::{
    Steering, TranslationLimits, least_time_s, least_time_to_goal_s, least_velocity_change_m_s, slew, steer, steer_in,
    steer_to_goal,
};
use tumble_planning::{ArcPath, BodyArc, COEFFICIENTS, ModelBelief, TranslationState, Units};

/// All promises.
pub const PROMISES: [fn(&[u8]); 6] = [pairs, simple_shapes, worlds, motions, slews, bounds];

/// The fuzz target: the first byte picks what is asked.
pub fn planning_numbers(data: &[u8]) {
    let Some((pick, numbers)) = data.split_first() else { return };
    PROMISES[usize::from(*pick) % PROMISES.len()](numbers);
}

/// Numbers at the edges of what a float can be, and the ordinary ones that go with them.
const SPECIAL: [f64; 32] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    2.0,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    f64::EPSILON,
    5e-324,
    1e300,
    -1e300,
    1e-300,
    1e200,
    1e-200,
    1e100,
    1e-100,
    1e40,
    1e-40,
    1e16,
    1e-16,
    1e9,
    -1e9,
    1e-9,
    3.0,
    -0.1,
    0.1,
    1e-3,
];

/// Numbers made of bytes: mostly moderate, often special, sometimes any.
struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        let taken = self.0.len().min(N);
        let (head, tail) = self.0.split_at(taken);
        bytes[..taken].copy_from_slice(head);
        self.0 = tail;
        bytes
    }

    fn byte(&mut self) -> u8 {
        self.bytes::<1>()[0]
    }

    fn any(&mut self) -> f64 {
        let [pick] = self.bytes();
        match pick {
            0..32 => SPECIAL[usize::from(pick)],
            32..40 => f64::from_le_bytes(self.bytes()),
            // Equal numbers make equal bodies and flat boxes.
            40..80 => f64::from(i16::from(pick) - 60) * 0.125,
            _ => f64::from(i16::from_le_bytes(self.bytes())) / 8192.0,
        }
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.any())
    }

    fn attitude(&mut self) -> UnitQuaternion<f64> {
        if self.byte() < 128 {
            return UnitQuaternion::identity();
        }
        let [x, y, z, w] = [self.any(), self.any(), self.any(), self.any()];
        let quaternion = Quaternion::new(w, x, y, z);
        // Also one that is none: whoever checks must not trust a type.
        if self.byte() < 16 { Unit::new_unchecked(quaternion) } else { UnitQuaternion::new_normalize(quaternion) }
    }

    fn pose(&mut self) -> Pose<f64> {
        let attitude = self.attitude();
        Pose::from_parts(self.vector().into(), attitude)
    }

    fn direction(&mut self) -> Unit<Vector3<f64>> {
        match self.byte() {
            0..16 => Unit::new_unchecked(self.vector()),
            16..96 => Unit::try_new(self.vector(), 1e-3).unwrap_or_else(Vector3::z_axis),
            _ => Vector3::y_axis(),
        }
    }

    fn semi_axes(&mut self) -> Vector3<f64> {
        let sphere = self.byte() < 64;
        let axes = if sphere { Vector3::repeat(self.any()) } else { self.vector() };
        // Mostly positive: bodies that are refused show nothing.
        if self.byte() < 240 { axes.abs() } else { axes }
    }

    fn aligned_box(&mut self) -> AlignedBox {
        let (lower_world, upper_world) = (self.vector(), self.vector());
        if self.byte() < 240 {
            AlignedBox::between(lower_world, upper_world)
        } else {
            AlignedBox { lower_world, upper_world }
        }
    }

    fn state(&mut self) -> TranslationState {
        let position = self.vector();
        let velocity = if self.byte() < 100 { Vector3::zeros() } else { self.vector() };
        TranslationState { position, velocity }
    }

    fn arc(&mut self) -> BodyArc {
        let (start, acceleration) = (self.state(), self.vector());
        let mut arc = BodyArc::accelerated(self.any(), &start, acceleration, self.attitude());
        if self.byte() < 64 {
            arc.position = [(); COEFFICIENTS].map(|()| self.vector());
        }
        if self.byte() < 100 {
            let axis = self.direction();
            let last = usize::from(self.byte()) % COEFFICIENTS;
            let mut angle = [0.0; COEFFICIENTS];
            for coefficient in angle.iter_mut().take(last + 1).skip(1) {
                *coefficient = self.any();
            }
            arc = arc.turning(axis, angle);
        }
        arc
    }

    fn limits(&mut self) -> MotionLimits {
        let position = if self.byte() < 128 {
            AlignedBox { lower_world: Vector3::repeat(-1e9), upper_world: Vector3::repeat(1e9) }
        } else {
            self.aligned_box()
        };
        let mut positive = || self.vector().abs();
        let [speed_m_s, force_n, torque_n_m] = [positive(), positive(), positive()];
        MotionLimits { position, speed_m_s, force_n, torque_n_m, rate_rad_s: self.any() }
    }

    fn goal(&mut self) -> GoalRegion {
        let (position, attitude) = (self.vector(), self.attitude());
        GoalRegion { position, radius_m: self.any().abs(), speed_m_s: self.any().abs(), attitude: Some(attitude) }
    }
}

fn finite<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> bool {
    numbers.into_iter().all(|number| number.is_finite())
}

/// Every number of it can be used, and they agree.
fn is_sound(found: &Distance, what: &str) {
    assert!(finite(&found.normal) && finite(&found.point_on_a) && finite(&found.point_on_b), "{what}: {found:?}");
    assert!(found.distance_m.is_finite() && found.lower_bound_m.is_finite(), "{what}: {found:?}");
    assert!((found.normal.norm_squared() - 1.0).abs() < 1e-9, "{what}: {found:?}");
    let size = found.distance_m.abs() + found.point_on_a.amax() + found.point_on_b.amax();
    assert!(found.lower_bound_m <= found.distance_m + 1e-12 * size, "{what}: {found:?}");
}

/// Distances, overlap and margins of two ellipsoids, where they may be ones.
pub fn pairs(data: &[u8]) {
    let mut numbers = Numbers(data);
    let Ok(a) = Ellipsoid::try_new(&numbers.pose(), &numbers.semi_axes()) else { return };
    let b = if numbers.byte() < 16 { Ok(a) } else { Ellipsoid::try_new(&numbers.pose(), &numbers.semi_axes()) };
    let Ok(b) = b else { return };
    let found = distance(&a, &b);
    is_sound(&found, "distance");
    is_sound(&distance_from_hint(&a, &b, &numbers.vector()), "distance from a hint");
    let size = found.distance_m.abs() + a.semi_axes().max() + b.semi_axes().max();
    let size = size + a.center().amax() + b.center().amax();
    match separation(&a, &b) {
        Separation::Apart(plane) => {
            assert!(finite(&plane.normal) && plane.offset.is_finite(), "{plane:?} {a:?} {b:?}");
            assert!(found.distance_m >= -1e-12 * size, "{found:?} {a:?} {b:?}");
        }
        Separation::Overlapping(point) => {
            assert!(finite(&point), "{point:?} {a:?} {b:?}");
            assert!(found.lower_bound_m <= 1e-12 * size, "{found:?} {a:?} {b:?}");
        }
    }
    assert_eq!(overlap(&a, &b), matches!(separation(&a, &b), Separation::Overlapping(_)));
    let margin = scaling_margin(&a, &b);
    assert!(margin.value >= -1.0 && margin.value.is_finite(), "{} {a:?} {b:?}", margin.value);
    assert!(finite(&margin.gradient) && finite(&margin.hessian), "{} {a:?} {b:?}", margin.value);
}

/// What nobody checked: numbers that can be used are, and what is no number is never free.
fn is_sound_or_not_free(found: &Distance, numbers: &[f64], may_be_used: bool, what: &str) {
    if may_be_used {
        is_sound(found, what);
    } else if numbers.iter().any(|number| number.is_nan()) {
        let is_free = found.distance_m > 0.0 || found.lower_bound_m > 0.0;
        assert!(!is_free, "{what} of no number is free: {found:?}");
    }
}

/// Spheres, points, boxes and half-spaces, which anybody may make of any numbers.
pub fn simple_shapes(data: &[u8]) {
    let mut numbers = Numbers(data);
    let sphere = |numbers: &mut Numbers<'_>| Sphere { center: numbers.vector(), radius_m: numbers.any().abs() };
    let (a, b) = (sphere(&mut numbers), sphere(&mut numbers));
    let half_space = HalfSpace { inward: numbers.direction(), offset_m: numbers.any() };
    let aligned = numbers.aligned_box();
    let of = |sphere: &Sphere| [sphere.center.x, sphere.center.y, sphere.center.z, sphere.radius_m];
    let (of_a, of_b) = (of(&a), of(&b));
    let of_plane = [half_space.inward.x, half_space.inward.y, half_space.inward.z, half_space.offset_m];
    let of_box: Vec<f64> = aligned.lower_world.iter().chain(&aligned.upper_world).copied().collect();
    let can_be_used = |numbers: &[f64]| numbers.iter().all(|number| number.abs() <= 1e20);
    let is_plane = (half_space.inward.norm_squared() - 1.0).abs() < 1e-9 && can_be_used(&of_plane);
    let is_box =
        can_be_used(&of_box) && aligned.lower_world.iter().zip(&aligned.upper_world).all(|(low, up)| low <= up);
    let both = |one: &[f64], other: &[f64]| [one, other].concat();
    let check = is_sound_or_not_free;
    check(&sphere_to_sphere(&a, &b), &both(&of_a, &of_b), can_be_used(&both(&of_a, &of_b)), "spheres");
    let (of_both, is_used) = (both(&of_a, &of_plane), can_be_used(&of_a) && is_plane);
    check(&sphere_to_half_space(&a, &half_space), &of_both, is_used, "sphere and half-space");
    check(&sphere_to_box(&a, &aligned), &of_a, can_be_used(&of_a) && is_box, "sphere and box");
    let Ok(c) = Ellipsoid::try_new(&numbers.pose(), &numbers.semi_axes()) else { return };
    check(&ellipsoid_to_sphere(&c, &b), &of_b, can_be_used(&of_b), "ellipsoid and sphere");
    check(&ellipsoid_to_point(&c, &b.center), &of_b[..3], can_be_used(&of_b[..3]), "ellipsoid and point");
    check(&ellipsoid_to_half_space(&c, &half_space), &of_plane, is_plane, "ellipsoid and half-space");
    check(&ellipsoid_to_box(&c, &aligned), &[], is_box, "ellipsoid and box");
}

/// A world that is one answers every pose and every motion, or says why not.
pub fn worlds(data: &[u8]) {
    let mut numbers = Numbers(data);
    let mut world = World::default();
    let count = |numbers: &mut Numbers<'_>, most: u8| usize::from(numbers.byte() % most);
    for _ in 0..count(&mut numbers, 3) {
        world.keep_out.push(numbers.aligned_box());
    }
    for _ in 0..count(&mut numbers, 3) {
        world.keep_in.push(numbers.aligned_box());
    }
    keep_in_complement(&world.keep_in);
    for _ in 0..count(&mut numbers, 3) {
        world
            .obstacles
            .push(ObstacleEllipsoid { world_from_ellipsoid: numbers.pose(), semi_axes: numbers.semi_axes() });
    }
    let Ok(mut world) = EllipsoidWorld::new(&world) else { return };
    if numbers.byte() < 128 {
        let ellipsoid = ObstacleEllipsoid { world_from_ellipsoid: numbers.pose(), semi_axes: numbers.semi_axes() };
        let mut moving = MovingObstacle::at_rest(ellipsoid).drifting(numbers.vector(), numbers.any());
        if numbers.byte() < 128 {
            moving.displacement = [(); COEFFICIENTS].map(|()| numbers.vector());
        }
        if numbers.byte() < 128 {
            moving = moving.present(numbers.any(), numbers.any());
        }
        world = match world.with_obstacle(moving) {
            Ok(world) => world,
            Err(_) => return,
        };
    }
    let part = |numbers: &mut Numbers<'_>| BodyEllipsoid {
        body_from_ellipsoid: numbers.pose(),
        semi_axes: numbers.semi_axes(),
    };
    let mut parts = vec![part(&mut numbers)];
    if numbers.byte() < 64 {
        parts.push(part(&mut numbers));
    }
    let Ok(body) = BodyShape::try_new(parts) else { return };
    assert!(body.bounding_radius_m().is_finite() && body.inscribed_radius_m().is_finite(), "{body:?}");
    let (pose, time_s) = (numbers.pose(), numbers.any());
    let mut clearances_m = Vec::new();
    let batch = world.clearances(&body, &[pose], time_s, f64::INFINITY, &mut clearances_m);
    match world.clearance(&body, &pose, time_s) {
        Ok(clearance) => {
            assert!(!clearance.distance_m.is_nan(), "{clearance:?}");
            batch.expect("what one query answers many do");
            let size = 1.0 + clearance.distance_m.abs() + pose.translation.vector.amax() + body.bounding_radius_m();
            let difference_m = (clearances_m[0] - clearance.distance_m).abs();
            assert!(
                clearances_m[0].to_bits() == clearance.distance_m.to_bits() || difference_m <= 1e-9 * size,
                "{clearances_m:?} {clearance:?}"
            );
        }
        Err(_) => assert!(batch.is_err()),
    }
    if let Ok(clearance) = world.lasting_clearance(&body, &pose, time_s) {
        assert!(!clearance.distance_m.is_nan(), "{clearance:?}");
    }
    let (arc, margin_m) = (numbers.arc(), numbers.any().abs());
    if let Ok(Some(contact)) = world.first_contact(&body, &arc, time_s, margin_m) {
        assert!(contact.time_s >= 0.0 && contact.time_s <= arc.duration_s, "{contact:?} {arc:?}");
    }
}

fn is_motion(steering: &Steering) {
    assert!(steering.duration_s().is_finite() && steering.duration_s() >= 0.0, "{steering:?}");
    assert!(steering.velocity_change_m_s().is_finite(), "{steering:?}");
    for piece in steering.pieces() {
        let TranslationState { position, velocity } = piece.start;
        assert!(piece.duration_s.is_finite() && piece.duration_s > 0.0, "{steering:?}");
        assert!(finite(position.iter().chain(&velocity).chain(&piece.acceleration_m_s2)), "{steering:?}");
    }
    let path = ArcPath::new(steering.arcs(UnitQuaternion::identity()));
    assert!(path.duration_s().is_finite());
}

/// Every motion between two states is one; every duration is a number.
pub fn motions(data: &[u8]) {
    let mut numbers = Numbers(data);
    let (from, limits) = (numbers.state(), numbers.limits());
    let to = if numbers.byte() < 16 { from } else { numbers.state() };
    let mass_kg = numbers.any().abs();
    let checked = limits.translation(mass_kg);
    // And those that nobody checked.
    let limits = match checked {
        Ok(limits) => limits,
        Err(_) => TranslationLimits {
            position: limits.position,
            speed_m_s: limits.speed_m_s,
            acceleration_m_s2: limits.force_n,
        },
    };
    let least_s = least_time_s(&from, &to, &limits);
    assert!(least_s >= 0.0, "{least_s} {from:?} {to:?} {limits:?}");
    if let Some(steering) = steer(&from, &to, &limits) {
        is_motion(&steering);
        assert!(steering.duration_s() >= least_s * (1.0 - 1e-9));
    }
    let duration_s = numbers.any();
    if let Some(steering) = steer_in(&from, &to, &limits, duration_s) {
        is_motion(&steering);
    }
    let change_m_s = least_velocity_change_m_s(&from, &to, &limits, duration_s);
    assert!(change_m_s >= 0.0, "{change_m_s} {from:?} {to:?} {limits:?} {duration_s}");
    let goal = numbers.goal();
    assert!(least_time_to_goal_s(&from, &goal, &limits) >= 0.0, "{from:?} {goal:?} {limits:?}");
    if let Some(steering) = steer_to_goal(&from, &goal, &limits) {
        is_motion(&steering);
    }
}

/// A turn is one, or none is possible, or the error says which number is wrong.
pub fn slews(data: &[u8]) {
    let mut numbers = Numbers(data);
    let (from, to, limits) = (numbers.attitude(), numbers.attitude(), numbers.limits());
    let mut inertia = Matrix3::from_diagonal(&numbers.vector().abs());
    if numbers.byte() >= 128 {
        let products = numbers.vector();
        for (i, j, product) in [(0, 1, products.x), (0, 2, products.y), (1, 2, products.z)] {
            (inertia[(i, j)], inertia[(j, i)]) = (product, product);
        }
    }
    let Ok(Some(turn)) = slew(&from, &to, &inertia, &limits) else { return };
    let all = [turn.duration_s(), turn.angle_rad(), turn.rate_rad_s(), turn.acceleration_rad_s2()];
    assert!(finite(&all) && all.iter().all(|number| *number >= 0.0), "{turn:?} {inertia:?} {limits:?}");
    for share in [0.0, 0.3, 1.0] {
        let attitude = turn.attitude_at(share * turn.duration_s());
        assert!(finite(&attitude.coords), "{turn:?}");
    }
    let later_s = numbers.any();
    if let Some(slower) = turn.stretched(later_s) {
        assert!(finite(&slower.attitude_at(0.5 * later_s).coords), "{slower:?}");
    }
}

/// What is said of a problem before any search is said in bounded time.
pub fn bounds(data: &[u8]) {
    let mut numbers = Numbers(data);
    let mut world = World::default();
    for _ in 0..numbers.byte() % 3 {
        world.keep_out.push(numbers.aligned_box());
    }
    let Ok(world) = EllipsoidWorld::new(&world) else { return };
    let Ok(body) = BodyShape::sphere(numbers.any().abs()) else { return };
    let mass_kg = if numbers.byte() < 128 { 1.0 } else { numbers.any().abs() };
    let belief = ModelBelief::certain(0, InertialParameters::solid_box(mass_kg, [0.3, 0.2, 0.1]));
    let start = numbers.state();
    let attitude = numbers.attitude();
    let request = GlobalRequest {
        world: &world,
        body: &body,
        start,
        attitude,
        start_s: numbers.any(),
        goal: numbers.goal(),
        limits: numbers.limits(),
        belief: &belief,
        objective: if numbers.byte() < 128 { Objective::Duration } else { Objective::Impulse },
        margin_m: numbers.any(),
        until: Until::FirstPlan,
        seed: 0,
    };
    let _ = diagnose(&request);
    let Ok(mut bound) = RouteBound::new(&request) else { return };
    let mut budget = Units::new(100);
    for _ in 0..3 {
        assert!(bound.least_duration_s() >= 0.0 && bound.lower_bound() >= 0.0, "{request:?}");
        if !matches!(bound.refine(&mut budget), Ok(true)) {
            break;
        }
    }
    assert!(bound.least_duration_s() >= 0.0 && bound.lower_bound() >= 0.0, "{request:?}");
    assert!(bound.free_route().iter().all(finite), "{request:?}");
}
