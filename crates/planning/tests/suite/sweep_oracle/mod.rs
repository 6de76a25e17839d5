//! Slow answers to "do these touch?" that share no code and no algorithm with the crate's, and a sampler of edges.
//!
//! Everything is a convex problem in the space in which one ellipsoid is a ball, solved by plain descent or bisection.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use tumble_identification::noise::between;
use tumble_planning::collision::{BodyEllipsoid, BodyShape, CollisionWorld, EllipsoidWorld, MovingObstacle};
use tumble_planning::dynamics::{AlignedBox, ObstacleEllipsoid, World};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{Matrix3, Quaternion, Unit, UnitQuaternion, Vector3};
use tumble_planning::{BodyArc, COEFFICIENTS};

/// Rounding of the slow answers: golden section and bisection on numbers of order one.
pub const TOLERANCE_M: f64 = 1e-11;

fn power(base: f64, exponent: usize) -> f64 {
    (0..exponent).fold(1.0, |power, _| power * base)
}

/// A part of a body.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    pub body_from_part: Pose<f64>,
    pub semi_axes: Vector3<f64>,
}

/// An obstacle; its ellipsoid stands where it is when the edge begins.
#[derive(Clone, Copy, Debug)]
pub enum Obstacle {
    Ellipsoid {
        ellipsoid: ObstacleEllipsoid,
        velocity: Vector3<f64>,
        acceleration: Vector3<f64>,
        from_s: f64,
        to_s: f64,
    },
    Box(AlignedBox),
}

/// A clearance, or a lower bound of it where it is far from zero.
///
/// Positive: at least so far apart, m. Negative: they overlap, by a measure that vanishes at contact.
pub type Bound = f64;

fn quadric(pose: &Pose<f64>, semi_axes: &Vector3<f64>) -> Matrix3<f64> {
    let rotation = *pose.rotation.to_rotation_matrix().matrix();
    rotation * Matrix3::from_diagonal(&semi_axes.component_mul(semi_axes)) * rotation.transpose()
}

/// The scale at which two ellipsoids with these squared shapes touch, by golden section on the contact function of Perram
/// and Wertheim.
fn ellipsoids(first: &Matrix3<f64>, second: &Matrix3<f64>, offset: &Vector3<f64>, thinnest: f64) -> Bound {
    let at = |s: f64| {
        let mixed = first * (1.0 - s) + second * s;
        mixed.cholesky().map_or(0.0, |mixed| s * (1.0 - s) * offset.dot(&mixed.solve(offset)))
    };
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (0.0, 1.0);
    let (mut left, mut right) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_left, mut at_right) = (at(left), at(right));
    for _ in 0..60 {
        if at_left > at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - golden * (high - low);
            at_left = at(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + golden * (high - low);
            at_right = at(right);
        }
    }
    (f64::max(at_left, at_right).sqrt() - 1.0) * thinnest
}

/// Distance of a point from an ellipsoid, by bisection on the multiplier; minus something inside.
fn point(pose: &Pose<f64>, semi_axes: &Vector3<f64>, point: &Vector3<f64>) -> f64 {
    let y = pose.inverse_transform_point(&(*point).into()).coords;
    let at = |t: f64| y.zip_map(semi_axes, |y, a| y * a / (t + a * a)).norm_squared() - 1.0;
    if at(0.0) <= 0.0 {
        return -semi_axes.min() * (1.0 - (at(0.0) + 1.0).sqrt());
    }
    let (mut low, mut high) = (0.0, y.norm() * semi_axes.max());
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if at(middle) > 0.0 { low = middle } else { high = middle }
    }
    (y - y.zip_map(semi_axes, |y, a| y * a * a / (high + a * a))).norm()
}

/// The point of a box nearest to an ellipsoid's centre as the ellipsoid measures it, by descent one coordinate at a time.
fn boxed(squared: &Matrix3<f64>, center: &Vector3<f64>, aligned: &AlignedBox, thinnest: f64) -> Bound {
    let Some(metric) = squared.try_inverse() else { return 0.0 };
    let (lower, upper) = (aligned.lower_world - center, aligned.upper_world - center);
    let mut x = Vector3::zeros().sup(&lower).inf(&upper);
    for _ in 0..400 {
        let before = x;
        for axis in 0..3 {
            let rest = metric.row(axis).transpose().dot(&x) - metric[(axis, axis)] * x[axis];
            x[axis] = (-rest / metric[(axis, axis)]).max(lower[axis]).min(upper[axis]);
        }
        if (x - before).amax() <= 1e-15 * x.amax() {
            break;
        }
    }
    (x.dot(&(metric * x)).sqrt() - 1.0) * thinnest
}

/// How far a part of a body at a pose, `time_s` into the edge, is from an obstacle, less the margin; a lower bound.
pub fn clearance(part: &Part, obstacle: &Obstacle, pose: &Pose<f64>, time_s: f64, margin_m: f64) -> Bound {
    let placed = pose * part.body_from_part;
    let center = placed.translation.vector;
    let (radius, thinnest) = (part.semi_axes.max(), part.semi_axes.min());
    match obstacle {
        Obstacle::Ellipsoid { ellipsoid, velocity, acceleration, from_s, to_s } => {
            if time_s < *from_s || time_s > *to_s {
                return f64::INFINITY;
            }
            let mut moved = ellipsoid.world_from_ellipsoid;
            moved.translation.vector += (velocity + acceleration * (0.5 * time_s)) * time_s;
            let far = (center - moved.translation.vector).norm() - radius - ellipsoid.semi_axes.max() - margin_m;
            if far > 0.2 * radius {
                return far;
            }
            if radius <= thinnest {
                return point(&moved, &ellipsoid.semi_axes, &center) - radius - margin_m;
            }
            assert!(margin_m <= 0.0, "no independent distance of grown ellipsoids");
            let squares = [quadric(&moved, &ellipsoid.semi_axes), quadric(&placed, &part.semi_axes)];
            let thin = thinnest + ellipsoid.semi_axes.min();
            ellipsoids(&squares[0], &squares[1], &(center - moved.translation.vector), thin)
        }
        Obstacle::Box(aligned) => {
            let outside = center - center.sup(&aligned.lower_world).inf(&aligned.upper_world);
            if radius <= thinnest {
                return outside.norm() - radius - margin_m;
            }
            let far = outside.norm() - radius - margin_m;
            if far > 0.2 * radius {
                return far;
            }
            assert!(margin_m <= 0.0, "no independent distance of grown ellipsoids");
            boxed(&quadric(&placed, &part.semi_axes), &center, aligned, thinnest)
        }
    }
}

/// Position, by powers of the time.
fn position(arc: &BodyArc, time_s: f64) -> Vector3<f64> {
    let mut power = 1.0;
    let mut sum = Vector3::zeros();
    for coefficient in &arc.position {
        sum += coefficient * power;
        power *= time_s;
    }
    sum
}

/// The pose on an arc, from powers of the time and Rodrigues' formula.
pub fn pose(arc: &BodyArc, time_s: f64) -> Pose<f64> {
    let mut power = 1.0;
    let mut angle = 0.0;
    for coefficient in &arc.angle {
        angle += coefficient * power;
        power *= time_s;
    }
    let half = 0.5 * angle;
    let turn = Quaternion::from_parts(half.cos(), arc.axis_body.into_inner() * half.sin());
    let attitude = arc.attitude.into_inner() * turn;
    Pose::from_parts(position(arc, time_s).into(), UnitQuaternion::from_quaternion(attitude))
}

/// The first of `samples` equally spaced times in `[0, until_s]` at which a part is nearer than `-tolerance_m`, by the sum of
/// absolute coefficients as the bound of speed; samples that cannot be so are left out.
pub fn first_violation(
    parts: &[Part],
    obstacles: &[Obstacle],
    arc: &BodyArc,
    until_s: f64,
    samples: usize,
    margin_m: f64,
    tolerance_m: f64,
) -> Option<f64> {
    let mut power = 1.0;
    let (mut speed, mut rate) = (0.0, 0.0);
    for k in 1..arc.position.len() {
        speed += k as f64 * arc.position[k].norm() * power;
        rate += k as f64 * arc.angle[k].abs() * power;
        power *= until_s;
    }
    let step_s = until_s / (samples - 1) as f64;
    let mut first: Option<f64> = None;
    let samples = if until_s > 0.0 { samples } else { 0 };
    for part in parts {
        let reach = part.body_from_part.translation.vector.norm() + part.semi_axes.max();
        for obstacle in obstacles {
            let of_obstacle = match obstacle {
                Obstacle::Ellipsoid { velocity, acceleration, .. } => velocity.norm() + acceleration.norm() * until_s,
                Obstacle::Box(_) => 0.0,
            };
            let per_step = (speed + rate * reach + of_obstacle) * step_s;
            let mut sample = 0;
            while sample < samples {
                let time_s = step_s * sample as f64;
                let mut clear = clearance(part, obstacle, &pose(arc, time_s), time_s, margin_m);
                if let Obstacle::Ellipsoid { from_s, to_s, .. } = obstacle {
                    if time_s > *to_s {
                        break;
                    }
                    if time_s < *from_s {
                        clear = 0.0;
                    }
                }
                if clear < -tolerance_m {
                    first = Some(first.map_or(time_s, |first: f64| first.min(time_s)));
                    break;
                }
                let skipped = (clear.max(0.0) / per_step).min(1e9);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 1e9")]
                let skipped = skipped as usize;
                sample += 1 + skipped;
            }
        }
    }
    first
}

/// An edge with everything around it.
#[derive(Debug)]
pub struct Case {
    pub arc: BodyArc,
    pub parts: Vec<Part>,
    pub obstacles: Vec<Obstacle>,
    pub start_s: f64,
    pub margin_m: f64,
}

/// Random numbers of one seed.
pub struct Draws(ChaCha8Rng);

impl Draws {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        between(&mut self.0, low, high)
    }

    pub fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.within(-size, size))
    }

    pub fn one_of(&mut self, count: usize) -> usize {
        usize::try_from(self.0.next_u32()).unwrap() % count
    }

    pub fn attitude(&mut self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_quaternion(Quaternion::from_parts(self.within(-1.0, 1.0), self.vector(1.0)))
    }

    pub fn semi_axes(&mut self, largest: f64, ratio: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| largest * f64::exp(-self.within(0.0, ratio.ln())))
    }

    pub fn case(&mut self) -> Case {
        let duration_s = self.within(0.5, 6.0);
        let degree = [1, 2, 2, 3, 5][self.one_of(5)];
        let mut position = [Vector3::zeros(); COEFFICIENTS];
        position[0] = self.vector(1.2);
        for (k, coefficient) in position.iter_mut().enumerate().take(degree + 1).skip(1) {
            *coefficient = self.vector(1.5) / power(duration_s, k);
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
                arc.angle[k] = self.within(-2.0, 2.0) / power(duration_s, k);
            }
        }
        let is_sphere = self.one_of(2) == 0;
        let parts = (0..=self.one_of(2))
            .map(|_| Part {
                body_from_part: if self.one_of(2) == 0 {
                    Pose::identity()
                } else {
                    Pose::from_parts(self.vector(0.15).into(), self.attitude())
                },
                semi_axes: if is_sphere { Vector3::repeat(self.within(0.01, 0.25)) } else { self.semi_axes(0.3, 10.0) },
            })
            .collect();
        let obstacles = (0..=self.one_of(4))
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
    pub fn body(&self) -> BodyShape {
        let part = |part: &Part| BodyEllipsoid { body_from_ellipsoid: part.body_from_part, semi_axes: part.semi_axes };
        BodyShape::try_new(self.parts.iter().map(part).collect()).unwrap()
    }

    pub fn world(&self) -> EllipsoidWorld {
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

    pub fn first_contact(&self) -> Option<f64> {
        let found = self.world().first_contact(&self.body(), &self.arc, self.start_s, self.margin_m);
        found.unwrap().map(|contact| contact.time_s)
    }

    pub fn clearance(&self, time_s: f64) -> f64 {
        let pose = pose(&self.arc, time_s);
        let of = |part| self.obstacles.iter().map(move |obstacle| (part, obstacle));
        let pairs = self.parts.iter().flat_map(of);
        pairs.map(|(part, it)| clearance(part, it, &pose, time_s, self.margin_m)).fold(f64::INFINITY, f64::min)
    }
}

/// What dense sampling says of a first contact.
#[derive(Clone, Copy, Debug)]
pub struct Verdict {
    /// The time in question.
    pub contact_s: Option<f64>,
    /// A sample before it, or any where there is none, that is in contact.
    pub violation_s: Option<f64>,
    /// Clearance at the contact, m.
    pub contact_error_m: f64,
}

impl Case {
    pub fn judge(&self, samples: usize) -> Verdict {
        let contact_s = self.first_contact();
        // What appears about the body is hit at once: up to there, but not there, by the rounding of mission times.
        let until_s = contact_s.map_or(self.arc.duration_s, |time_s| time_s - 1e-15 * (self.start_s.abs() + 10.0));
        let violation_s =
            first_violation(&self.parts, &self.obstacles, &self.arc, until_s, samples, self.margin_m, TOLERANCE_M);
        let error = |time_s: f64| self.clearance(time_s).min(self.clearance(time_s + 1e-9));
        Verdict { contact_s, violation_s, contact_error_m: contact_s.map_or(0.0, error) }
    }
}
