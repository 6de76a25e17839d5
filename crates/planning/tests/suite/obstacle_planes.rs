//! What a plane promises, point by point: whoever keeps it at both ends of a segment touches nothing in between.

use crate::obstacle_loop::{Random, body, tracked_body};
use tumble_planning::collision::{CollisionWorld as _, EllipsoidWorld, MovingObstacle};
use tumble_planning::control::{EndAttitude, NominalPath, ObstaclePlane, ObstaclePlanes, Reach, barriers_of};
use tumble_planning::dynamics::{AlignedBox, ObstacleEllipsoid, World};
use tumble_planning::lie::Pose;
use tumble_planning::local::Barrier;
use tumble_planning::nalgebra::{UnitQuaternion, Vector2, Vector3};

const STEP_S: f64 = 0.5;

/// Everything is within reach.
const FAR: Reach = Reach {
    states: [Vector2::new(0.0, 0.0); 3],
    tubes: [Vector2::new(100.0, 0.0); 3],
    accelerations_m_s2: Vector3::new(0.0, 0.0, 0.0),
};

struct Scene {
    barriers: Vec<Barrier>,
    world: EllipsoidWorld,
}

fn scene(random: &mut Random, kind: u64) -> Scene {
    if kind.is_multiple_of(3) {
        let lower = random.vector(0.5);
        let aligned = AlignedBox { lower_world: lower, upper_world: lower + random.vector(0.3).abs() };
        let world = World { keep_out: vec![aligned], ..World::default() };
        return Scene { barriers: barriers_of(&world), world: EllipsoidWorld::new(&world).unwrap() };
    }
    let pose = Pose::from_parts(random.vector(0.5).into(), random.attitude());
    let semi_axes = Vector3::from_fn(|_, _| random.between(0.05, 0.4));
    let mut obstacle = MovingObstacle::at_rest(ObstacleEllipsoid { world_from_ellipsoid: pose, semi_axes });
    if kind % 3 == 1 {
        obstacle = obstacle.drifting(random.vector(0.2), 0.7);
        (obstacle.displacement[2], obstacle.displacement[4]) = (random.vector(0.1), random.vector(0.05));
    }
    let world = EllipsoidWorld::new(&World::default()).unwrap().with_obstacle(obstacle).unwrap();
    Scene { barriers: vec![Barrier::Ellipsoid(obstacle)], world }
}

/// A motion of four nodes somewhere, turning at a rate about an axis.
struct Way {
    positions: Vec<Vector3<f64>>,
    attitudes: Vec<UnitQuaternion<f64>>,
    rate_world: Vector3<f64>,
}

impl Way {
    fn new(random: &mut Random, rate_rad_s: f64) -> Self {
        let rate_world = random.direction().into_inner() * rate_rad_s;
        let (start, velocity, first) = (random.vector(1.5), random.vector(0.2), random.attitude());
        Self {
            positions: (0..4).map(|k| start + velocity * f64::from(k)).collect(),
            attitudes: (0..4)
                .map(|k| UnitQuaternion::from_scaled_axis(rate_world * (STEP_S * f64::from(k))) * first)
                .collect(),
            rate_world,
        }
    }

    fn path(&self, attitude_error_rad: f64, end: EndAttitude) -> NominalPath<'_> {
        NominalPath {
            start_s: 0.3,
            step_s: STEP_S,
            positions: &self.positions,
            tube_m: Vector3::repeat(0.01),
            world_from_axes: UnitQuaternion::identity(),
            attitudes: &self.attitudes,
            turn_rad_s: self.rate_world.norm(),
            end,
            attitude_error_rad,
        }
    }
}

/// A place on a plane.
fn on_plane(random: &mut Random, plane: &ObstaclePlane, near: &Vector3<f64>) -> Vector3<f64> {
    let place = near + random.vector(0.4);
    place + plane.normal_world * (plane.offset_m - plane.normal_world.dot(&place))
}

#[test]
fn whoever_keeps_a_plane_at_both_ends_touches_nothing_in_between() {
    let (mut random, body) = (Random::new(11), body());
    let mut least_m = f64::INFINITY;
    for kind in 0..90 {
        let scene = scene(&mut random, kind);
        let rate_rad_s = random.between(0.0, 0.8);
        let way = Way::new(&mut random, rate_rad_s);
        let error_rad = random.between(0.0, 0.3);
        let mut planes = ObstaclePlanes::try_new(&body, &tracked_body(), &scene.barriers, 3).unwrap();
        let path = way.path(error_rad, EndAttitude::Any);
        planes.update(&path, &FAR).unwrap();
        assert_eq!(planes.planes().count(), 3);
        for plane in planes.planes() {
            for _ in 0..12 {
                let ends = [0, 1].map(|_| on_plane(&mut random, plane, &way.positions[plane.step]));
                let error = UnitQuaternion::from_axis_angle(&random.direction(), error_rad);
                for part in 0..=6 {
                    let share = f64::from(part) / 6.0;
                    let since_s = STEP_S * ((plane.step - 1) as f64 + share);
                    let turned = UnitQuaternion::from_scaled_axis(way.rate_world * since_s) * way.attitudes[0];
                    let attitude = if plane.step == 3 { random.attitude() } else { error * turned };
                    let place = ends[0].lerp(&ends[1], share);
                    let pose = Pose::from_parts((place - attitude * tracked_body()).into(), attitude);
                    let clearance = scene.world.clearance(&body, &pose, path.start_s + since_s).unwrap();
                    least_m = least_m.min(clearance.distance_m);
                    assert!(clearance.distance_m > -1e-9, "{kind} {plane:?} {clearance:?}");
                }
            }
        }
    }
    assert!(least_m < 0.05, "{least_m}");
}

/// Without turn and error a plane leaves no room: across it, at the right place, the body touches.
#[test]
fn a_plane_is_no_farther_than_it_must_be() {
    let (mut random, body) = (Random::new(12), body());
    let mut judged = 0;
    for kind in 0..60 {
        let scene = scene(&mut random, 3 * kind + 2);
        let way = Way::new(&mut random, 0.0);
        let mut planes = ObstaclePlanes::try_new(&body, &tracked_body(), &scene.barriers, 3).unwrap();
        let update = planes.update(&way.path(0.0, EndAttitude::Held), &FAR).unwrap();
        if update.cut > 0 {
            continue;
        }
        let Barrier::Ellipsoid(obstacle) = &scene.barriers[0] else { continue };
        let solid = tumble_planning::collision::Ellipsoid::try_new(
            &obstacle.ellipsoid.world_from_ellipsoid,
            &obstacle.ellipsoid.semi_axes,
        )
        .unwrap();
        for plane in planes.planes() {
            let attitude = way.attitudes[0];
            // the points that meet
            let of_obstacle = solid.support_point(&-plane.normal_world);
            let about = Pose::from_parts((-(attitude * tracked_body())).into(), attitude);
            let parts = body.parts().iter().map(|part| tumble_planning::collision::Ellipsoid::of_body(part, &about));
            let of_body = parts.map(|part| part.support_point(&plane.normal_world)).fold(
                Vector3::repeat(0.0),
                |farthest, point| {
                    let is_farther = point.dot(&plane.normal_world) > farthest.dot(&plane.normal_world);
                    if is_farther { point } else { farthest }
                },
            );
            let place = of_obstacle - of_body;
            assert!((plane.normal_world.dot(&place) - plane.offset_m).abs() < 1e-9);
            let pose = Pose::from_parts((place - attitude * tracked_body()).into(), attitude);
            let clearance = scene.world.clearance(&body, &pose, 0.0).unwrap();
            assert!(clearance.distance_m.abs() < 1e-6, "{clearance:?}");
            judged += 1;
        }
    }
    assert!(judged > 60, "{judged}");
}

#[test]
fn planes_follow_the_plan_and_what_cuts_them_is_said() {
    let body = body();
    let ball = ObstacleEllipsoid { world_from_ellipsoid: Pose::identity(), semi_axes: Vector3::repeat(0.2) };
    let barriers = [Barrier::Ellipsoid(MovingObstacle::at_rest(ball))];
    let mut planes = ObstaclePlanes::try_new(&body, &tracked_body(), &barriers, 3).unwrap();
    let mut random = Random::new(13);
    let mut way = Way::new(&mut random, 0.0);
    way.positions = vec![Vector3::new(-0.8, 0.0, 0.0); 4];
    let first = planes.update(&way.path(0.0, EndAttitude::Held), &FAR).unwrap();
    assert_eq!((first.replaced, first.kept, first.cut), (3, 0, 0));
    let normals: Vec<_> = planes.planes().map(|plane| plane.normal_world).collect();
    assert!(normals.iter().all(|normal| normal.x > 0.9));
    planes.advance();
    assert!(planes.planes().map(|plane| plane.step).eq([1, 2, 3]));
    // as near as the first planes allow: none is cut
    let room_m = |plane: &ObstaclePlane| {
        plane.offset_m - plane.normal_world.dot(&way.positions[0]) - 0.01 * plane.normal_world.abs().sum()
    };
    let nearest = planes.planes().map(room_m).fold(f64::INFINITY, f64::min);
    way.positions = vec![way.positions[0] + normals[0] * nearest; 4];
    let touching = planes.update(&way.path(0.0, EndAttitude::Held), &FAR).unwrap();
    assert!(touching.cut == 0 && touching.replaced + touching.kept == 3, "{touching:?}");
    // inside the obstacle there is no plane that could be kept
    way.positions = vec![Vector3::new(0.1, 0.0, 0.0); 4];
    let second = planes.update(&way.path(0.0, EndAttitude::Held), &FAR).unwrap();
    assert!((second.cut, second.replaced) == (3, 0) && second.excess_m > 0.2, "{second:?}");
    // numbers that are none, or too few
    assert!(planes.update(&way.path(f64::NAN, EndAttitude::Held), &FAR).is_err());
    way.positions.pop();
    assert!(planes.update(&way.path(0.0, EndAttitude::Held), &FAR).is_err());
}

/// Rows that are left out bound nothing: no place within reach is beyond them.
#[test]
fn rows_left_out_cannot_be_reached() {
    let (mut random, body) = (Random::new(14), body());
    let (mut left_out, mut there) = (0, 0);
    for kind in 0..60 {
        let scene = scene(&mut random, kind);
        let way = Way::new(&mut random, 0.2);
        let axes = random.attitude();
        let path = NominalPath { world_from_axes: axes, ..way.path(0.1, EndAttitude::Any) };
        let here = path.positions[0];
        let reach = Reach {
            states: [0, 1, 2].map(|i| Vector2::new(here[i], random.between(-0.1, 0.1))),
            tubes: [Vector2::new(0.03, 0.01); 3],
            accelerations_m_s2: Vector3::repeat(0.2),
        };
        let mut planes = ObstaclePlanes::try_new(&body, &tracked_body(), &scene.barriers, 3).unwrap();
        planes.update(&path, &reach).unwrap();
        let mut rows = Vec::new();
        planes.rows(&path, &reach, &mut rows);
        there += rows.len();
        for row in &rows {
            assert!((row.normal.norm() - 1.0).abs() < 1e-12 && (row.node == row.step || row.node + 1 == row.step));
        }
        let mut everything = Vec::new();
        planes.rows(&path, &FAR, &mut everything);
        for row in everything.iter().filter(|row| !rows.contains(row)) {
            left_out += 1;
            for draw in 0..20 {
                let time_s = STEP_S * row.node as f64;
                let place = Vector3::from_fn(|i, _| {
                    // the first time straight towards the plane
                    let mut most = |bound: f64| {
                        if draw == 0 { bound * row.normal[i].signum() } else { random.between(-bound, bound) }
                    };
                    let state = reach.states[i];
                    let (start, speed) = (state.x + most(0.03), state.y + most(0.01));
                    start + time_s * (speed + 0.5 * time_s * most(0.2)) + most(0.03)
                });
                assert!(row.normal.dot(&place) <= row.offset_m + 1e-12);
            }
        }
    }
    assert!(left_out > 5 && there > 5, "{left_out} {there}");
}
