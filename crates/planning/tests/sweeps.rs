//! The continuous test against dense sampling by an independent distance.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod sweep_oracle;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use sweep_oracle::{Obstacle, Part, clearance, first_violation, pose};
use tumble_planning::collision::{BodyEllipsoid, BodyShape, CollisionWorld, EllipsoidWorld, MovingObstacle};
use tumble_planning::dynamics::{AlignedBox, ObstacleEllipsoid, World};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{Quaternion, Unit, UnitQuaternion, Vector3};
use tumble_planning::{BodyArc, COEFFICIENTS};

/// An edge with everything around it.
#[derive(Debug)]
struct Case {
    arc: BodyArc,
    parts: Vec<Part>,
    obstacles: Vec<Obstacle>,
    start_s: f64,
    margin_m: f64,
}

struct Draws(ChaCha8Rng);

impl Draws {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.within(-size, size))
    }

    fn one_of(&mut self, count: usize) -> usize {
        usize::try_from(self.0.next_u32()).unwrap() % count
    }

    fn attitude(&mut self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_quaternion(Quaternion::from_parts(self.within(-1.0, 1.0), self.vector(1.0)))
    }

    fn semi_axes(&mut self, largest: f64, ratio: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| largest * libm::pow(ratio, -self.within(0.0, 1.0)))
    }

    fn case(&mut self) -> Case {
        let duration_s = self.within(0.5, 6.0);
        let degree = [1, 2, 2, 3, 5][self.one_of(5)];
        let mut position = [Vector3::zeros(); COEFFICIENTS];
        position[0] = self.vector(1.2);
        for (k, coefficient) in position.iter_mut().enumerate().take(degree + 1).skip(1) {
            *coefficient = self.vector(1.5) / libm::pow(duration_s, k as f64);
        }
        let mut arc = BodyArc {
            duration_s,
            position,
            attitude: self.attitude(),
            axis_body: Unit::new_normalize(self.vector(1.0)),
            angle: [0.0; COEFFICIENTS],
        };
        let is_turning = self.one_of(2) == 0;
        if is_turning {
            for k in 1..=[1, 2, 5][self.one_of(3)] {
                arc.angle[k] = self.within(-2.0, 2.0) / libm::pow(duration_s, k as f64);
            }
        }
        let is_sphere = self.one_of(2) == 0;
        let parts = (0..1 + self.one_of(2))
            .map(|_| Part {
                body_from_part: if self.one_of(2) == 0 {
                    Pose::identity()
                } else {
                    Pose::from_parts(self.vector(0.15).into(), self.attitude())
                },
                semi_axes: if is_sphere { Vector3::repeat(self.within(0.01, 0.25)) } else { self.semi_axes(0.3, 10.0) },
            })
            .collect();
        let obstacles = (0..1 + self.one_of(4))
            .map(|_| match self.one_of(4) {
                0 => Obstacle::Box(AlignedBox::between(self.vector(1.5), self.vector(1.5))),
                kind => {
                    let is_moving = kind == 1;
                    Obstacle::Ellipsoid {
                        ellipsoid: ObstacleEllipsoid {
                            world_from_ellipsoid: Pose::from_parts(self.vector(1.5).into(), self.attitude()),
                            semi_axes: self.semi_axes(1.0, 30.0),
                        },
                        velocity: if is_moving { self.vector(0.5) } else { Vector3::zeros() },
                        acceleration: if is_moving { self.vector(0.1) } else { Vector3::zeros() },
                        from_s: if is_moving && self.one_of(2) == 0 {
                            self.within(0.0, 3.0)
                        } else {
                            f64::NEG_INFINITY
                        },
                        to_s: if is_moving && self.one_of(2) == 0 { self.within(3.0, 6.0) } else { f64::INFINITY },
                    }
                }
            })
            .collect();
        let margin_m = if is_sphere && self.one_of(2) == 0 { self.within(0.0, 0.1) } else { 0.0 };
        Case { arc, parts, obstacles, start_s: self.within(-50.0, 50.0), margin_m }
    }
}

impl Case {
    fn body(&self) -> BodyShape {
        let part = |part: &Part| BodyEllipsoid { body_from_ellipsoid: part.body_from_part, semi_axes: part.semi_axes };
        BodyShape::try_new(self.parts.iter().map(part).collect()).unwrap()
    }

    fn world(&self) -> EllipsoidWorld {
        let mut boxes = World::default();
        let mut moving = Vec::new();
        for obstacle in &self.obstacles {
            match obstacle {
                Obstacle::Box(aligned) => boxes.keep_out.push(*aligned),
                Obstacle::Ellipsoid { ellipsoid, velocity, acceleration, from_s, to_s } => {
                    let mut obstacle = MovingObstacle::at_rest(*ellipsoid)
                        .drifting(*velocity, self.start_s)
                        .present(self.start_s + from_s, self.start_s + to_s);
                    obstacle.displacement[2] = acceleration * 0.5;
                    moving.push(obstacle);
                }
            }
        }
        EllipsoidWorld::new(&boxes).unwrap().with_obstacles(moving).unwrap()
    }

    fn first_contact(&self) -> Option<f64> {
        let found = self.world().first_contact(&self.body(), &self.arc, self.start_s, self.margin_m);
        found.unwrap().map(|contact| contact.time_s)
    }

    fn clearance(&self, time_s: f64) -> f64 {
        let pose = pose(&self.arc, time_s);
        let of = |part| self.obstacles.iter().map(move |obstacle| (part, obstacle));
        let pairs = self.parts.iter().flat_map(of);
        pairs.map(|(part, it)| clearance(part, it, &pose, time_s, self.margin_m)).fold(f64::INFINITY, f64::min)
    }
}

/// Rounding of the oracle: golden section and bisection of numbers of order one.
const TOLERANCE_M: f64 = 1e-11;

#[test]
fn random_edges_have_no_violation_and_every_contact_is_one() {
    let mut draws = Draws(ChaCha8Rng::seed_from_u64(1));
    let (mut free, mut hit) = (0, 0);
    for index in 0..4000 {
        let case = draws.case();
        let found = case.first_contact();
        // What appears about the body is hit at once: up to there, but not there.
        let until_s = found.map_or(case.arc.duration_s, |time_s| time_s * (1.0 - 1e-12));
        let seen = first_violation(&case.parts, &case.obstacles, &case.arc, until_s, 1000, case.margin_m, TOLERANCE_M);
        assert_eq!(seen, None, "edge {index} passes through something: {case:?} said {found:?}");
        if let Some(time_s) = found {
            hit += 1;
            let there = case.clearance(time_s).min(case.clearance(time_s + 1e-9));
            assert!(there < 1e-9, "edge {index}: {there} m at the contact at {time_s}: {case:?}");
        } else {
            free += 1;
        }
    }
    assert!(free > 500 && hit > 500, "{free} {hit}");
}
