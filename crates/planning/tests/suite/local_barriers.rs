//! Rows of a local plan against its surroundings: values by dense sampling, gradients by differences.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_identification::noise::signed_unit;
use tumble_planning::collision::{
    Blocker, BodyEllipsoid, BodyShape, CollisionWorld, EllipsoidWorld, MovingObstacle, sphere_to_box,
};
use tumble_planning::dynamics::{AlignedBox, ObstacleEllipsoid, World};
use tumble_planning::lie::Pose;
use tumble_planning::local::{Hull, KINEMATICS, Kinematics, MotionBounds, MotionRow, RowSettings, Surroundings};
use tumble_planning::nalgebra::{UnitQuaternion, Vector3};

struct Draw(ChaCha8Rng);

impl Draw {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn within(&mut self, half: f64) -> f64 {
        half * signed_unit(&mut self.0)
    }

    fn vector(&mut self, half: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.within(half))
    }

    fn attitude(&mut self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(self.vector(2.0))
    }

    fn ellipsoid(&mut self, reach: f64) -> ObstacleEllipsoid {
        let translation = self.vector(reach);
        let semi_axes = Vector3::from_fn(|_, _| 0.2 + self.within(0.12));
        ObstacleEllipsoid { world_from_ellipsoid: Pose::from_parts(translation.into(), self.attitude()), semi_axes }
    }

    fn node(&mut self, reach: f64, speed: f64) -> Kinematics {
        Kinematics {
            world_from_body: Pose::from_parts(self.vector(reach).into(), self.attitude()),
            velocity_world: self.vector(speed),
            rate_body: self.vector(0.3),
        }
    }
}

fn blank() -> MotionRow {
    MotionRow { node: 0, value: f64::NAN, by_start: [0.0; KINEMATICS], by_end: [0.0; KINEMATICS], contact: None }
}

fn settings(on_segments: bool, step_s: f64) -> RowSettings {
    RowSettings { start_s: 3.0, step_s, margin_m: 0.0, interpolation_error_m: 0.0, length_scale_m: 0.1, on_segments }
}

fn linearized(surroundings: &Surroundings, motion: &[Kinematics], settings: &RowSettings) -> Vec<MotionRow> {
    let mut rows = vec![blank(); surroundings.rows(motion.len() - 1, settings)];
    surroundings.linearize(motion, settings, &mut rows);
    rows
}

fn values(surroundings: &Surroundings, motion: &[Kinematics], settings: &RowSettings) -> Vec<f64> {
    let mut values = vec![f64::NAN; surroundings.rows(motion.len() - 1, settings)];
    surroundings.values(motion, settings, &mut values);
    values
}

/// A node changed along one coordinate.
fn changed(node: &Kinematics, coordinate: usize, by: f64) -> Kinematics {
    let mut change = [0.0; KINEMATICS];
    change[coordinate] = by;
    let [px, py, pz, vx, vy, vz, tx, ty, tz, wx, wy, wz] = change;
    let mut node = *node;
    node.world_from_body.translation.vector += Vector3::new(px, py, pz);
    node.velocity_world += Vector3::new(vx, vy, vz);
    node.world_from_body.rotation *= UnitQuaternion::from_scaled_axis(Vector3::new(tx, ty, tz));
    node.rate_body += Vector3::new(wx, wy, wz);
    node
}

/// The cubic through the positions and velocities of two nodes, in powers of `s`, written down anew.
fn cubic(ends: &[Kinematics], step_s: f64, s: f64) -> Vector3<f64> {
    let [a, b] = [0, 1].map(|i: usize| ends[i].world_from_body.translation.vector);
    let [u, v] = [0, 1].map(|i: usize| ends[i].velocity_world * step_s);
    let d = b - a;
    a + (u + ((d * 3.0 - u * 2.0 - v) + (u + v - d * 2.0) * s) * s) * s
}

fn quadratic(obstacle: &ObstacleEllipsoid, point: &Vector3<f64>) -> f64 {
    let local = obstacle.world_from_ellipsoid.inverse_transform_point(&(*point).into()).coords;
    (0..3).map(|i| (local[i] / obstacle.semi_axes[i]).powi(2)).sum::<f64>() - 1.0
}

/// Gradients by central differences of the values, at kinks of `s` left out by the caller.
fn assert_gradients(
    surroundings: &Surroundings,
    motion: &[Kinematics],
    settings: &RowSettings,
    step: f64,
    tolerance: f64,
) {
    let rows = linearized(surroundings, motion, settings);
    for (row, value) in rows.iter().zip(values(surroundings, motion, settings)) {
        assert!(row.value.to_bits() == value.to_bits(), "{} against {value}", row.value);
    }
    for node in 0..motion.len() {
        for coordinate in 0..KINEMATICS {
            let at = |by: f64| {
                let mut motion = motion.to_vec();
                motion[node] = changed(&motion[node], coordinate, by);
                values(surroundings, &motion, settings)
            };
            let (plus, minus) = (at(step), at(-step));
            for (index, row) in rows.iter().enumerate() {
                let difference = (plus[index] - minus[index]) / (2.0 * step);
                let mut gradient = 0.0;
                if row.node == node {
                    gradient += row.by_start[coordinate];
                }
                if row.node + 1 == node {
                    gradient += row.by_end[coordinate];
                }
                assert!(
                    (difference - gradient).abs() < tolerance * (1.0 + gradient.abs()),
                    "row {index} of node {}, node {node} coordinate {coordinate}: {gradient} against {difference}; {row:?}",
                    row.node
                );
            }
        }
    }
}

#[test]
fn rows_at_nodes_are_the_quadratic_forms() {
    let mut draw = Draw::new(1);
    for _ in 0..200 {
        let world = World { obstacles: vec![draw.ellipsoid(0.5), draw.ellipsoid(0.5)], ..World::default() };
        let surroundings = Surroundings::of_world(&world, Hull::Point).unwrap();
        let motion: Vec<_> = (0..4).map(|_| draw.node(0.6, 0.2)).collect();
        let settings = settings(false, 0.5);
        assert_eq!(surroundings.rows(3, &settings), 6);
        let values = values(&surroundings, &motion, &settings);
        for (index, value) in values.iter().enumerate() {
            let (obstacle, node) = (index / 3, index % 3 + 1);
            let exact = quadratic(&world.obstacles[obstacle], &motion[node].world_from_body.translation.vector);
            assert!((value - exact).abs() < 1e-13 * (1.0 + exact.abs()), "{value} against {exact}");
            assert_eq!(surroundings.blocker(index, 3, &settings), Some(Blocker::Obstacle(obstacle)));
        }
        assert_eq!(surroundings.blocker(6, 3, &settings), None);
        assert_gradients(&surroundings, &motion, &settings, 1e-6, 1e-7);
    }
}

/// The frozen numbers: obstacle of an axis-aligned attitude, computed as there, to the last bit.
#[test]
fn an_aligned_obstacle_has_the_value_of_the_formula() {
    let (center, axes) = (Vector3::new(0.45, 0.12, 0.10), Vector3::new(0.25, 0.20, 0.20));
    let obstacle = ObstacleEllipsoid { world_from_ellipsoid: Pose::translation(0.45, 0.12, 0.10), semi_axes: axes };
    let world = World { obstacles: vec![obstacle], ..World::default() };
    let surroundings = Surroundings::of_world(&world, Hull::Point).unwrap();
    let mut draw = Draw::new(2);
    for _ in 0..100 {
        let motion = [draw.node(1.0, 0.2), draw.node(1.0, 0.2)];
        let seen = (motion[1].world_from_body.translation.vector - center).component_div(&axes);
        let frozen = seen.x * seen.x + seen.y * seen.y + seen.z * seen.z - 1.0;
        let value = values(&surroundings, &motion, &settings(false, 0.5))[0];
        assert!((value - frozen).abs() <= 4.0 * f64::EPSILON * (1.0 + frozen), "{value} against {frozen}");
    }
}

/// Long, fast and wild segments, whose distance has up to three minima, against a fine grid.
#[test]
fn the_least_on_a_segment_is_found() {
    let mut draw = Draw::new(3);
    let (mut inside, mut several) = (0, 0);
    for trial in 0..600 {
        let still = MovingObstacle::at_rest(draw.ellipsoid(0.3));
        let mut moving = MovingObstacle::at_rest(draw.ellipsoid(0.3));
        for (power, coefficient) in moving.displacement.iter_mut().enumerate().skip(1) {
            *coefficient = draw.vector(0.2 / (1u64 << power) as f64);
        }
        moving.since_s = 2.5;
        let surroundings = Surroundings::none().with_moving([still, moving]).unwrap();
        let step_s = if trial % 2 == 0 { 0.5 } else { 2.0 };
        let speed = if trial % 3 == 0 { 3.0 } else { 0.3 };
        let motion = [draw.node(0.6, speed), draw.node(0.6, speed)];
        let settings = settings(true, step_s);
        let rows = linearized(&surroundings, &motion, &settings);
        assert_eq!(rows.len(), 4);
        for (row, obstacle) in [(&rows[1], still), (&rows[3], moving)] {
            let count = 10_000;
            let at = |i: usize| {
                let s = i as f64 / count as f64;
                let mut solid = obstacle.ellipsoid;
                let since = settings.start_s + step_s * s - obstacle.since_s;
                for (power, coefficient) in obstacle.displacement.iter().enumerate() {
                    solid.world_from_ellipsoid.translation.vector +=
                        coefficient * (0..power).fold(1.0, |product, _| product * since);
                }
                quadratic(&solid, &cubic(&motion, step_s, s))
            };
            let sampled: Vec<f64> = (0..=count).map(at).collect();
            let least = sampled.iter().copied().fold(f64::INFINITY, f64::min);
            let minima = sampled.windows(3).filter(|w| w[1] < w[0] && w[1] <= w[2]).count();
            several += usize::from(minima > 1);
            let coarse = 1e-6 * (1.0 + speed * speed * step_s * step_s * 100.0);
            assert!(row.value <= least + 1e-12 && row.value > least - coarse, "{} against {least}", row.value);
            if let Some(contact) = row.contact {
                inside += 1;
                assert!(contact.curvature > 0.0);
            }
        }
    }
    assert!(inside > 200 && several > 50, "{inside} {several}");
}

#[test]
fn gradients_on_segments_are_those_of_the_least() {
    let mut draw = Draw::new(4);
    for _ in 0..60 {
        let still = MovingObstacle::at_rest(draw.ellipsoid(0.4));
        let moving = MovingObstacle::at_rest(draw.ellipsoid(0.4)).drifting(draw.vector(0.2), 1.0);
        let surroundings = Surroundings::none().with_moving([still, moving]).unwrap();
        let motion: Vec<_> = (0..4).map(|_| draw.node(0.7, 0.2)).collect();
        let settings = RowSettings { margin_m: 0.02, interpolation_error_m: 1e-3, ..settings(true, 0.5) };
        assert_gradients(&surroundings, &motion, &settings, 1e-6, 2e-5);
    }
}

/// Along a line in the space of motions the least bends as the fixed place does, less what the moving place takes off.
#[test]
fn the_moving_contact_bends_the_row_as_stated() {
    let mut draw = Draw::new(5);
    let mut tried = 0;
    while tried < 100 {
        let obstacle = draw.ellipsoid(0.1);
        let surroundings = Surroundings::none().with_moving([MovingObstacle::at_rest(obstacle)]).unwrap();
        let motion = [draw.node(0.7, 0.2), draw.node(0.7, 0.2)];
        let settings = settings(true, 0.5);
        let row = &linearized(&surroundings, &motion, &settings)[1];
        let Some(contact) = row.contact else { continue };
        if contact.curvature < 0.1 {
            continue;
        }
        tried += 1;
        let along: [[f64; 6]; 2] = [0; 2].map(|_| [0; 6].map(|_| draw.within(1.0)));
        let moved = |by: f64| {
            let mut motion = motion;
            for (node, along) in motion.iter_mut().zip(&along) {
                for (coordinate, along) in along.iter().enumerate() {
                    *node = changed(node, coordinate, by * along);
                }
            }
            motion
        };
        // The place of least distance, by a fine search.
        let value_at = |motion: &[Kinematics], s: f64| quadratic(&obstacle, &cubic(motion, 0.5, s));
        let (mut from, mut to) = (0.0, 1.0);
        let coarse = (0..=1000)
            .map(|i| f64::from(i) / 1000.0)
            .min_by(|a, b| value_at(&motion, *a).total_cmp(&value_at(&motion, *b)))
            .unwrap();
        (from, to) = (f64::max(from, coarse - 1e-3), f64::min(to, coarse + 1e-3));
        for _ in 0..100 {
            let (a, b) = (from + (to - from) / 3.0, to - (to - from) / 3.0);
            if value_at(&motion, a) < value_at(&motion, b) { to = b } else { from = a }
        }
        let place = 0.5 * (from + to);
        let step = 1e-4;
        let second = |f: &dyn Fn(f64) -> f64| (f(step) - 2.0 * f(0.0) + f(-step)) / (step * step);
        let bend_of_least = second(&|by| values(&surroundings, &moved(by), &settings)[1]);
        let bend_of_place = second(&|by| value_at(&moved(by), place));
        let dot = |gradient: &[f64; KINEMATICS], along: &[f64; 6]| -> f64 {
            gradient.iter().zip(along).map(|(a, b)| a * b).sum()
        };
        let b = dot(&contact.by_start, &along[0]) + dot(&contact.by_end, &along[1]);
        let stated = -b * b / contact.curvature;
        let measured = bend_of_least - bend_of_place;
        assert!((measured - stated).abs() < 1e-2 * (1.0 + stated.abs()), "{measured} against {stated}");
    }
}

/// A point with a row of at least zero is at least the margin away, on every side.
#[test]
fn a_margin_is_kept() {
    use tumble_planning::collision::{Ellipsoid, ellipsoid_to_point};
    let mut draw = Draw::new(6);
    let mut tight = f64::INFINITY;
    for _ in 0..2000 {
        let obstacle = draw.ellipsoid(0.1);
        let solid = Ellipsoid::try_new(&obstacle.world_from_ellipsoid, &obstacle.semi_axes).unwrap();
        let margin_m = 0.1 + draw.within(0.1);
        let surroundings = Surroundings::none().with_moving([MovingObstacle::at_rest(obstacle)]).unwrap();
        let settings = RowSettings { margin_m, ..settings(false, 0.5) };
        // On the surface of the row, along a random ray.
        let direction = draw.vector(1.0);
        let at = |factor: f64| {
            let mut node = draw_node_at(solid.center() + direction * factor);
            node.velocity_world = Vector3::zeros();
            node
        };
        let value = |factor: f64| values(&surroundings, &[at(factor), at(factor)], &settings)[0];
        let (mut low, mut high) = (0.0, 100.0);
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if value(middle) < 0.0 { low = middle } else { high = middle }
        }
        let distance_m = ellipsoid_to_point(&solid, &(solid.center() + direction * high)).distance_m;
        assert!(distance_m >= margin_m - 1e-9, "{distance_m} of {margin_m}");
        tight = tight.min(distance_m - margin_m);
    }
    assert!(tight < 1e-4, "no tighter than {tight}");
}

fn draw_node_at(position: Vector3<f64>) -> Kinematics {
    Kinematics {
        world_from_body: Pose::from_parts(position.into(), UnitQuaternion::identity()),
        velocity_world: Vector3::zeros(),
        rate_body: Vector3::zeros(),
    }
}

#[test]
fn what_is_there_for_a_time_counts_for_whole_segments() {
    let solid = ObstacleEllipsoid { world_from_ellipsoid: Pose::identity(), semi_axes: Vector3::repeat(0.2) };
    // Nodes at 3, 3.5, ..., 5.
    let obstacle = MovingObstacle::at_rest(solid).present(3.7, 4.1);
    let surroundings = Surroundings::none().with_moving([obstacle]).unwrap();
    let motion = [draw_node_at(Vector3::zeros()); 5];
    let at_nodes = values(&surroundings, &motion, &settings(false, 0.5));
    assert_eq!(at_nodes.iter().map(|value| *value < 0.0).collect::<Vec<_>>(), [false, true, false, false]);
    let on_segments = values(&surroundings, &motion, &settings(true, 0.5));
    let is_hit: Vec<_> = on_segments.iter().skip(1).step_by(2).map(|value| *value < 0.0).collect();
    assert_eq!(is_hit, [false, true, true, false]);
}

#[test]
fn a_body_at_rest_has_rows_at_once() {
    let mut draw = Draw::new(7);
    for _ in 0..1000 {
        let surroundings = Surroundings::none().with_moving([MovingObstacle::at_rest(draw.ellipsoid(0.1))]).unwrap();
        let mut node = draw.node(0.7, 0.0);
        node.velocity_world = draw.vector(1e-17);
        let rows = linearized(&surroundings, &[node, node, node], &settings(true, 0.5));
        assert!(rows.iter().all(|row| (row.value - rows[0].value).abs() < 1e-13));
    }
}

/// The pose on a segment, written down anew: rotation vector and position are cubics in powers of `s`.
fn pose_between(ends: &[Kinematics], step_s: f64, s: f64) -> Pose<f64> {
    use tumble_planning::lie::rotation_jacobian_inverse;
    let [a, b] = [0, 1].map(|i: usize| ends[i].world_from_body.rotation);
    let phi = (a.inverse() * b).scaled_axis();
    let (u, v) = (ends[0].rate_body * step_s, rotation_jacobian_inverse(&phi) * ends[1].rate_body * step_s);
    let turned = (u + ((phi * 3.0 - u * 2.0 - v) + (u + v - phi * 2.0) * s) * s) * s;
    Pose::from_parts(cubic(ends, step_s, s).into(), a * UnitQuaternion::from_scaled_axis(turned))
}

fn bodies(draw: &mut Draw) -> Vec<Hull> {
    let part = |draw: &mut Draw, semi_axes: Vector3<f64>| BodyEllipsoid {
        body_from_ellipsoid: Pose::from_parts(draw.vector(0.2).into(), draw.attitude()),
        semi_axes,
    };
    let long = part(draw, Vector3::new(0.3, 0.1, 0.08));
    let ball = part(draw, Vector3::repeat(0.12));
    let flat = part(draw, Vector3::new(0.2, 0.2, 0.07));
    let shape = |parts: Vec<BodyEllipsoid>| Hull::Shape(BodyShape::try_new(parts).unwrap());
    vec![Hull::Point, Hull::Shape(BodyShape::sphere(0.15).unwrap()), shape(vec![long]), shape(vec![ball, flat])]
}

fn room(draw: &mut Draw) -> World {
    let side = Vector3::new(0.9, 0.8, 0.7);
    let corner = draw.vector(0.5);
    World {
        keep_in: vec![AlignedBox { lower_world: -side, upper_world: side }],
        keep_out: vec![AlignedBox { lower_world: corner, upper_world: corner + Vector3::repeat(0.2) }],
        obstacles: vec![draw.ellipsoid(0.6)],
    }
}

/// A motion of small steps, as plans have.
fn short_motion(draw: &mut Draw, nodes: usize, step_s: f64) -> Vec<Kinematics> {
    let mut motion = vec![draw.node(0.5, 0.15)];
    for _ in 1..nodes {
        let last = motion[motion.len() - 1];
        let mut next = last;
        next.velocity_world += draw.vector(0.05);
        next.rate_body += draw.vector(0.15);
        let mean = (last.velocity_world + next.velocity_world) * 0.5;
        next.world_from_body.translation.vector += mean * step_s + draw.vector(0.003);
        next.world_from_body.rotation *=
            UnitQuaternion::from_scaled_axis((last.rate_body + next.rate_body) * (0.5 * step_s) + draw.vector(0.01));
        motion.push(next);
    }
    motion
}

#[test]
fn shapes_have_their_clearance_at_nodes() {
    let mut draw = Draw::new(8);
    for _ in 0..60 {
        let world = room(&mut draw);
        let queries = EllipsoidWorld::new(&world).unwrap();
        for hull in bodies(&mut draw) {
            let Hull::Shape(shape) = &hull else { continue };
            let surroundings = Surroundings::of_world(&world, hull.clone()).unwrap();
            let motion = short_motion(&mut draw, 3, 0.5);
            let settings = settings(false, 0.5);
            let rows = linearized(&surroundings, &motion, &settings);
            for (node, kinematics) in motion.iter().enumerate().skip(1) {
                let exact = queries.clearance(shape, &kinematics.world_from_body, 0.0).unwrap();
                let near = |row: &&MotionRow| row.node + 1 == node;
                let least = rows.iter().filter(near).map(|row| row.value).fold(f64::INFINITY, f64::min);
                // Where it overlaps, a depth is the best of several local minima.
                assert!((least * 0.1 - exact.distance_m).abs() < 1e-9, "{least} against {exact:?}");
            }
        }
    }
}

#[test]
fn gradients_of_shapes_at_nodes_are_those_of_the_distance() {
    let mut draw = Draw::new(9);
    for _ in 0..25 {
        let world = room(&mut draw);
        for hull in bodies(&mut draw) {
            let moving = MovingObstacle::at_rest(draw.ellipsoid(0.8)).drifting(draw.vector(0.1), 2.0);
            let surroundings = Surroundings::of_world(&world, hull).unwrap().with_moving([moving]).unwrap();
            let motion = short_motion(&mut draw, 3, 0.5);
            assert_gradients(&surroundings, &motion, &settings(false, 0.5), 1e-6, 1e-4);
        }
    }
}

#[test]
fn gradients_of_shapes_on_segments_are_those_of_the_least() {
    let mut draw = Draw::new(10);
    let mut contacts = 0;
    for _ in 0..25 {
        let world = room(&mut draw);
        for hull in bodies(&mut draw) {
            let moving = MovingObstacle::at_rest(draw.ellipsoid(0.8)).drifting(draw.vector(0.1), 2.0);
            let surroundings = Surroundings::of_world(&world, hull).unwrap().with_moving([moving]).unwrap();
            let motion = short_motion(&mut draw, 3, 0.5);
            // With so large a scale nothing counts by its ball.
            let settings = RowSettings { length_scale_m: 1.0, ..settings(true, 0.5) };
            assert_gradients(&surroundings, &motion, &settings, 1e-6, 1e-4);
            contacts += linearized(&surroundings, &motion, &settings).iter().filter(|r| r.contact.is_some()).count();
        }
    }
    assert!(contacts > 100, "{contacts}");
}

/// What a row says is never more than what is found on a fine grid, and a thousandth less; of wild segments somewhat more.
#[test]
fn the_least_gap_on_a_segment_is_found() {
    let mut draw = Draw::new(11);
    let mut inside = 0;
    for trial in 0..40 {
        for hull in bodies(&mut draw) {
            let is_still = trial % 2 == 0;
            let mut obstacle = MovingObstacle::at_rest(draw.ellipsoid(0.5));
            if !is_still {
                obstacle.displacement[1] = draw.vector(0.2);
                obstacle.displacement[2] = draw.vector(0.1);
                obstacle.since_s = 3.1;
            }
            let Hull::Shape(shape) = &hull else { continue };
            let is_wild = trial % 3 == 0;
            let step_s = if is_wild { 2.0 } else { 0.5 };
            let motion = if is_wild {
                vec![draw.node(0.9, 0.5), draw.node(0.9, 0.5)]
            } else {
                short_motion(&mut draw, 2, step_s)
            };
            let settings = RowSettings { margin_m: 0.01, interpolation_error_m: 0.002, ..settings(true, step_s) };
            let surroundings = Surroundings::of_world(&World::default(), hull.clone()).unwrap();
            let surroundings = surroundings.with_moving([obstacle]).unwrap();
            let queries = EllipsoidWorld::new(&World::default()).unwrap().with_obstacle(obstacle).unwrap();
            let rows = linearized(&surroundings, &motion, &settings);
            let least_row = rows.iter().skip(1).step_by(2).map(|row| row.value).fold(f64::INFINITY, f64::min);
            let count = 2000;
            let mut least = f64::INFINITY;
            for i in 0..=count {
                let s = f64::from(i) / f64::from(count);
                let pose = pose_between(&motion, step_s, s);
                least = least.min(queries.clearance(shape, &pose, 3.0 + step_s * s).unwrap().distance_m);
            }
            let exact = (least - 0.012) / 0.1;
            assert!(least_row <= exact + 1e-9, "{least_row} against {exact}");
            if exact > 0.0 && least_row < 4.0 {
                let short = if is_wild { 0.3 } else { 1.1e-3 };
                assert!(least_row > exact - short, "{least_row} against {exact}");
            }
            inside += rows.iter().filter(|row| row.contact.is_some()).count();
        }
    }
    assert!(inside > 20, "{inside}");
}

#[test]
fn what_is_far_has_a_lower_bound() {
    let mut draw = Draw::new(12);
    for _ in 0..50 {
        for hull in bodies(&mut draw) {
            let world = World { obstacles: vec![draw.ellipsoid(3.0)], ..room(&mut draw) };
            let surroundings = Surroundings::of_world(&world, hull).unwrap();
            let motion = short_motion(&mut draw, 2, 0.5);
            let near = settings(true, 0.5);
            // A scale of length so small that everything is far, and one so large that nothing is.
            let [fine, coarse] = [1e-4, 10.0].map(|length_scale_m| {
                let settings = RowSettings { length_scale_m, ..near };
                values(&surroundings, &motion, &settings).iter().map(|value| value * length_scale_m).collect::<Vec<_>>()
            });
            for (fine, coarse) in fine.iter().zip(&coarse) {
                // The coarse search leaves a thousandth of its scale.
                assert!(*fine <= coarse + 0.011, "{fine} against {coarse}");
            }
        }
    }
}

/// The gap of a rigid body that moves under constant body wrenches, integrated finely, from what rows take it to do.
#[test]
fn the_interpolation_is_as_near_as_stated() {
    let mut draw = Draw::new(13);
    let inertia = Vector3::new(0.10, 0.16, 0.19);
    let (mut largest, mut smallest) = (0.0_f64, f64::INFINITY);
    for trial in 0..300 {
        let step_s = if trial % 2 == 0 { 0.5 } else { 1.0 };
        let (force, torque) = (draw.vector(0.1), draw.vector(0.05));
        let mut rate: Vector3<f64> = draw.vector(0.5);
        let mut attitude = draw.attitude();
        let (mut position, mut velocity) = (draw.vector(1.0), draw.vector(0.2));
        let count = 2000;
        let fine = step_s / f64::from(count);
        let (mut fastest, mut hardest) = (0.0_f64, 0.0_f64);
        let mut poses = Vec::new();
        let node = |position: Vector3<f64>, attitude, velocity, rate| Kinematics {
            world_from_body: Pose::from_parts(position.into(), attitude),
            velocity_world: velocity,
            rate_body: rate,
        };
        let start = node(position, attitude, velocity, rate);
        for i in 0..=count {
            poses.push(Pose::from_parts(position.into(), attitude));
            let change = |w: &Vector3<f64>| (torque - w.cross(&inertia.component_mul(w))).component_div(&inertia);
            fastest = fastest.max(rate.norm());
            hardest = hardest.max(torque.component_div(&inertia).norm());
            if i == count {
                break;
            }
            // The midpoint rule: its error at this step is far below what is measured.
            let middle_rate = rate + change(&rate) * (0.5 * fine);
            let middle_attitude = attitude * UnitQuaternion::from_scaled_axis(rate * (0.5 * fine));
            let acceleration = middle_attitude * force;
            position += (velocity + acceleration * (0.5 * fine)) * fine;
            velocity += acceleration * fine;
            attitude *= UnitQuaternion::from_scaled_axis(middle_rate * fine);
            rate += change(&middle_rate) * fine;
        }
        let ends = [start, node(position, attitude, velocity, rate)];
        let arm = draw.vector(0.3);
        let shape = BodyShape::sphere(arm.norm()).unwrap();
        let surroundings = Surroundings::of_world(&World::default(), Hull::Shape(shape)).unwrap();
        let bounds = MotionBounds {
            acceleration_m_s2: force.norm(),
            rate_rad_s: fastest,
            angular_acceleration_rad_s2: hardest,
            center_of_mass_m: 0.0,
        };
        let bound = surroundings.interpolation_error_m(step_s, &bounds);
        let error = poses.iter().enumerate().map(|(i, pose)| {
            let taken = pose_between(&ends, step_s, i as f64 / f64::from(count));
            (pose.transform_point(&arm.into()) - taken.transform_point(&arm.into())).norm()
        });
        let ratio = error.fold(0.0, f64::max) / bound;
        (largest, smallest) = (largest.max(ratio), smallest.min(ratio));
    }
    assert!(largest < 1.0 && largest > 0.1, "{smallest} to {largest} of the bound");
}

#[test]
fn a_ball_has_the_distance_of_its_centre() {
    let mut draw = Draw::new(14);
    let world = room(&mut draw);
    let surroundings = Surroundings::of_world(&world, Hull::Shape(BodyShape::sphere(0.15).unwrap())).unwrap();
    let motion = short_motion(&mut draw, 2, 0.5);
    let row = &linearized(&surroundings, &motion, &settings(false, 0.5))[0];
    let center = motion[1].world_from_body.translation.vector;
    let exact = sphere_to_box(&tumble_planning::collision::Sphere { center, radius_m: 0.15 }, &world.keep_out[0]);
    assert!((row.value * 0.1 - exact.distance_m).abs() < 1e-15);
    assert!(row.by_end[6..9].iter().all(|moment| moment.abs() < 1e-15));
    assert_eq!(surroundings.blocker(0, 1, &settings(false, 0.5)), Some(Blocker::KeepOut(0)));
    assert_eq!(surroundings.blocker(1, 1, &settings(false, 0.5)), Some(Blocker::KeepIn));
}

/// With the place of least distance found to rounding, another way, the gradient is that of a square form there: a central
/// difference of any step is exact.
#[test]
fn gradients_of_points_are_exact() {
    let mut draw = Draw::new(15);
    let mut inside = 0;
    for _ in 0..300 {
        let obstacle = draw.ellipsoid(0.2);
        let surroundings = Surroundings::none().with_moving([MovingObstacle::at_rest(obstacle)]).unwrap();
        let motion = [draw.node(0.6, 0.3), draw.node(0.6, 0.3)];
        let row = linearized(&surroundings, &motion, &settings(true, 0.5))[1];
        let value_at = |motion: &[Kinematics], s: f64| quadratic(&obstacle, &cubic(motion, 0.5, s));
        // Any sixth-degree polynomial has the slope of its central differences of sixth order, to rounding, with large steps.
        let slope = |s: f64| {
            let at = |k: f64| value_at(&motion, s + 0.2 * k);
            (0.75 * (at(1.0) - at(-1.0)) - 0.15 * (at(2.0) - at(-2.0)) + (at(3.0) - at(-3.0)) / 60.0) / 0.2
        };
        let place = match row.contact {
            None if value_at(&motion, 0.0) < value_at(&motion, 1.0) => 0.0,
            None => 1.0,
            Some(_) => {
                inside += 1;
                let coarse = (0..=100).map(|i| f64::from(i) / 100.0);
                let coarse = coarse.min_by(|a, b| value_at(&motion, *a).total_cmp(&value_at(&motion, *b))).unwrap();
                let (mut from, mut to) = (coarse - 0.01, coarse + 0.01);
                for _ in 0..60 {
                    let middle = 0.5 * (from + to);
                    if slope(middle) < 0.0 { from = middle } else { to = middle }
                }
                0.5 * (from + to)
            }
        };
        assert!((row.value - value_at(&motion, place)).abs() < 1e-11 * (1.0 + row.value.abs()));
        for end in 0..2 {
            for coordinate in 0..6 {
                let at = |by: f64| {
                    let mut motion = motion;
                    motion[end] = changed(&motion[end], coordinate, by);
                    value_at(&motion, place)
                };
                let exact = 0.5 * (at(1.0) - at(-1.0));
                let stated = [row.by_start, row.by_end][end][coordinate];
                assert!((stated - exact).abs() < 1e-9 * (1.0 + exact.abs()), "{stated} against {exact}");
            }
        }
    }
    assert!(inside > 50, "{inside}");
}

/// Obstacles and motion turned and moved together: the same rows, with gradients by world coordinates turned.
#[test]
fn rows_do_not_depend_on_the_frame() {
    let mut draw = Draw::new(16);
    for _ in 0..40 {
        for hull in bodies(&mut draw) {
            let change = Pose::from_parts(draw.vector(1.0).into(), draw.attitude());
            let obstacle = draw.ellipsoid(0.5);
            let velocity = draw.vector(0.1);
            let motion = short_motion(&mut draw, 3, 0.5);
            let rows_in = |change: &Pose<f64>| {
                let turn = change.rotation;
                let mut solid = obstacle;
                solid.world_from_ellipsoid = change * solid.world_from_ellipsoid;
                let moving = MovingObstacle::at_rest(solid).drifting(turn * velocity, 2.0);
                let none = World::default();
                let surroundings = Surroundings::of_world(&none, hull.clone()).unwrap().with_moving([moving]).unwrap();
                let motion: Vec<_> = motion
                    .iter()
                    .map(|node| Kinematics {
                        world_from_body: change * node.world_from_body,
                        velocity_world: turn * node.velocity_world,
                        rate_body: node.rate_body,
                    })
                    .collect();
                linearized(&surroundings, &motion, &settings(true, 0.5))
            };
            for (row, turned) in rows_in(&Pose::identity()).iter().zip(rows_in(&change)) {
                assert!((row.value - turned.value).abs() < 1e-9 * (1.0 + row.value.abs()));
                for (gradient, turned) in [(row.by_start, turned.by_start), (row.by_end, turned.by_end)] {
                    for block in 0..4 {
                        let [old, new] =
                            [gradient, turned].map(|g| Vector3::new(g[3 * block], g[3 * block + 1], g[3 * block + 2]));
                        let old = if block < 2 { change.rotation * old } else { old };
                        assert!((old - new).norm() < 1e-5 * (1.0 + old.norm()), "{old} against {new}");
                    }
                }
            }
        }
    }
}

#[test]
fn hostile_numbers_are_errors_or_rows() {
    let mut draw = Draw::new(17);
    let solid = draw.ellipsoid(0.2);
    let mut bad = MovingObstacle::at_rest(solid);
    bad.ellipsoid.semi_axes.y = 0.0;
    assert!(Surroundings::none().with_moving([MovingObstacle::at_rest(solid), bad]).is_err());
    let world = World { obstacles: vec![bad.ellipsoid], ..World::default() };
    assert!(Surroundings::of_world(&world, Hull::Point).is_err());
    assert!(Surroundings::none().with_moving([MovingObstacle::at_rest(solid).present(2.0, 1.0)]).is_err());
    let mut flying = MovingObstacle::at_rest(solid);
    flying.displacement[3].x = f64::NAN;
    assert!(Surroundings::none().with_moving([flying]).is_err());
    // Motions that are none: whatever the values, they come, in finite time.
    for hull in bodies(&mut draw) {
        let surroundings = Surroundings::of_world(&room(&mut draw), hull).unwrap();
        for hostile in [f64::NAN, f64::INFINITY, 1e300, -1e19, 1e-300] {
            let mut motion = short_motion(&mut draw, 3, 0.5);
            motion[1].world_from_body.translation.vector.y = hostile;
            motion[2].velocity_world.x = hostile;
            motion[2].rate_body.x = hostile;
            let _ = values(&surroundings, &motion, &settings(true, 0.5));
            let rows = linearized(&surroundings, &motion, &settings(true, 0.5));
            assert!(rows.iter().all(|row| row.node < 2));
            assert!(rows.iter().any(|row| !row.value.is_nan()) || !hostile.is_finite() || hostile > 1e299);
        }
    }
}
