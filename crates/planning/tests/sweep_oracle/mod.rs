//! Slow answers to "do these touch?" that share no code and no algorithm with the crate's, and a sampler of edges.
//!
//! Everything is a convex problem in the space in which one ellipsoid is a ball, solved by plain descent or bisection.

use tumble_planning::BodyArc;
use tumble_planning::dynamics::{AlignedBox, ObstacleEllipsoid};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{Matrix3, Vector3};

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
    let turn = tumble_planning::nalgebra::Quaternion::from_parts(half.cos(), arc.axis_body.into_inner() * half.sin());
    let attitude = arc.attitude.into_inner() * turn;
    Pose::from_parts(position(arc, time_s).into(), tumble_planning::nalgebra::UnitQuaternion::from_quaternion(attitude))
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
