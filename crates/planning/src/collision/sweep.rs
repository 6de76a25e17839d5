//! When a moving part of a body first meets an obstacle: certified by planes.
//!
//! A plane with the unit normal `n` keeps part and obstacle apart by `n . (part - obstacle) - h_obstacle(n) - h_part(n)`, with
//! the support functions `h`. At a constant attitude that is a polynomial in time, exactly; of a turning part it has a
//! polynomial below it. So one plane, found at one time, proves a whole stretch of time free: most often all of it. The plane
//! is the best one at the time where it was found, hence the stretch that it proves ends short of the contact only by the
//! square of the time to it, and stepping from one plane to the next converges as Newton's method does, never passing it.

use super::obstacle::{Solid, unit};
use super::polynomial::{about, bernstein, range, stays_positive};
use super::{BodyEllipsoid, Ellipsoid};
use crate::motion::{BodyArc, COEFFICIENTS};
use nalgebra::{Matrix3, Vector3};

/// A clearance below this part of the lengths that enter it counts as contact.
const CONTACT: f64 = 1e-13;

/// What is proven free keeps this part of [`CONTACT`]: far more than all rounding.
const SLACK: f64 = 0.5;

/// Most planes tried per part and obstacle; a motion that needs more is reported as a contact where the proof ends.
const PLANES: usize = 200;

/// Most stretches left over between proven ones; further ones are met again on the way.
const STRETCHES: usize = 16;

/// A part of a body along an arc.
#[derive(Clone, Debug)]
pub(super) struct MovingPart<'a> {
    /// Position of the part's centre; of the body origin where the part turns.
    pub path: [Vector3<f64>; COEFFICIENTS],
    /// Half the extent along each world axis about the path, at any time.
    pub half_extent: Vector3<f64>,
    /// Least and largest coordinates on the whole arc, or beyond.
    pub swept: (Vector3<f64>, Vector3<f64>),
    shape: Shape<'a>,
}

#[derive(Clone, Debug)]
enum Shape<'a> {
    Sphere { radius_m: f64 },
    Level { solid: Ellipsoid },
    Turning { part: &'a BodyEllipsoid, arc: &'a BodyArc, solid: Ellipsoid },
}

/// Index of the last coefficient that is not zero.
pub(super) fn degree(path: &[Vector3<f64>; COEFFICIENTS]) -> usize {
    path.iter().rposition(|coefficient| *coefficient != Vector3::zeros()).unwrap_or(0)
}

impl<'a> MovingPart<'a> {
    /// A part of a body that moves along `arc`.
    pub fn new(part: &'a BodyEllipsoid, arc: &'a BodyArc) -> Self {
        let mut path = arc.position;
        let offset = &part.body_from_ellipsoid.translation.vector;
        let is_ball = part.semi_axes.min() >= part.semi_axes.max();
        let is_level = arc.is_level() || (is_ball && *offset == Vector3::zeros());
        let (shape, half_extent) = if is_level {
            let solid = Ellipsoid::of_body(part, &arc.pose(0.0));
            path[0] = *solid.center();
            if is_ball {
                let radius_m = part.semi_axes.x;
                (Shape::Sphere { radius_m }, Vector3::repeat(radius_m))
            } else {
                (Shape::Level { solid }, solid.half_extent())
            }
        } else {
            let reach_m = f64::sqrt(offset.norm_squared()) + part.semi_axes.max();
            let solid = Ellipsoid::posed(&part.body_from_ellipsoid, &part.semi_axes);
            let shape = Shape::Turning { part, arc, solid };
            (shape, Vector3::repeat(reach_m))
        };
        let (lower, upper) = path_box(&path, degree(&path), arc.duration_s);
        Self { path, half_extent, swept: (lower - half_extent, upper + half_extent), shape }
    }
}

/// Least and largest coordinates of a path from 0 to `duration_s`, or beyond.
pub(super) fn path_box(
    path: &[Vector3<f64>; COEFFICIENTS],
    degree: usize,
    duration_s: f64,
) -> (Vector3<f64>, Vector3<f64>) {
    let (mut lower, mut upper) = (Vector3::zeros(), Vector3::zeros());
    for axis in 0..3 {
        let (least, largest) = range(&path.map(|coefficient| coefficient[axis]), degree, duration_s);
        lower[axis] = least;
        upper[axis] = largest;
    }
    (lower, upper)
}

/// The distance between a part and an obstacle in time.
struct Approach<'a> {
    part: &'a MovingPart<'a>,
    solid: &'a Solid,
    /// Path of the part relative to the obstacle's reference point.
    path: [Vector3<f64>; COEFFICIENTS],
    degree: usize,
    margin_m: f64,
    contact_m: f64,
}

/// An attitude of the body, as a rotation matrix.
type Attitude = Option<Matrix3<f64>>;

/// A stretch of time that a plane proves free, or none where the best plane shows a contact.
type Proven = Option<(f64, f64)>;

/// First time in `[from_s, to_s]` at which `part` comes nearer than `margin_m` to `solid`; `None` where it certainly does not.
///
/// `path` is the part's path relative to the solid's reference point, `scale_m` bounds the coordinates from which it was found.
pub(super) fn first_contact(
    part: &MovingPart<'_>,
    solid: &Solid,
    path: &[Vector3<f64>; COEFFICIENTS],
    scale_m: f64,
    margin_m: f64,
    (from_s, to_s): (f64, f64),
) -> Option<f64> {
    let degree = degree(path);
    let mut power = 1.0;
    let mut lengths_m = scale_m + margin_m + part.half_extent.amax() + solid.reach_m();
    for coefficient in path {
        lengths_m += coefficient.amax() * power;
        power *= to_s;
    }
    let approach = Approach { part, solid, path: *path, degree, margin_m, contact_m: CONTACT * lengths_m };
    approach.first_contact(from_s, to_s)
}

impl Approach<'_> {
    fn first_contact(&self, from_s: f64, to_s: f64) -> Option<f64> {
        // One cheap plane, where the centres are nearest as the obstacle measures it.
        let nearest_s = self.nearest_s(from_s, to_s);
        let (mut proven_s, mut open_s) = (from_s, to_s);
        let (relative, attitude) = self.relative(nearest_s);
        let offset = self.solid.offset(&relative);
        let guess = unit(&self.solid.measured(&offset, self.part.half_extent.min()));
        if let Some((first, last)) = self.proves(&guess, &attitude, nearest_s, from_s, to_s) {
            if first <= from_s && last >= to_s {
                return None;
            }
            if first <= from_s {
                proven_s = last;
            } else if last >= to_s {
                open_s = first;
            }
        }
        self.search(guess, proven_s, open_s)
    }

    /// Goes forwards from what is proven free, a plane at its end and a plane half-way to the end of the open stretch in turn.
    fn search(&self, guess: Vector3<f64>, mut proven_s: f64, mut open_s: f64) -> Option<f64> {
        // The last plane's normal, which the next one's is near.
        let mut normal = guess;
        // Open stretches (begin, end) beyond what a plane half-way proved; the next one last.
        let mut later = [(0.0, 0.0); STRETCHES];
        let mut waiting = 0_usize;
        let mut is_hit_at_end = false;
        for _ in 0..PLANES {
            let begin_s = proven_s;
            let Some((_, last)) = self.best_proves(&mut normal, begin_s, begin_s, open_s) else {
                return Some(begin_s);
            };
            proven_s = last;
            // On the way to a known contact a plane ahead is worth its price only where this one does not get on.
            if proven_s < open_s && !(is_hit_at_end && proven_s - begin_s >= 0.5 * (open_s - begin_s)) {
                let ahead_s = 0.5 * (proven_s + open_s);
                match self.best_proves(&mut normal, ahead_s, proven_s, open_s) {
                    None => {
                        open_s = ahead_s;
                        is_hit_at_end = true;
                    }
                    Some((first, last)) if first <= proven_s => proven_s = last,
                    Some(_) if is_hit_at_end => {}
                    Some((first, last)) if last >= open_s => open_s = first,
                    Some((first, last)) => {
                        if let Some(slot) = later.get_mut(waiting) {
                            *slot = (last, open_s);
                            waiting += 1;
                            open_s = first;
                        }
                    }
                }
            }
            if proven_s >= open_s {
                if is_hit_at_end {
                    return Some(open_s);
                }
                waiting = waiting.checked_sub(1)?;
                (proven_s, open_s) = *later.get(waiting)?;
            }
        }
        Some(proven_s)
    }

    /// The part's centre as seen from the obstacle, and the attitude of a turning body.
    fn relative(&self, time_s: f64) -> (Vector3<f64>, Attitude) {
        let origin = evaluate(&self.path, self.degree, time_s);
        match &self.part.shape {
            Shape::Sphere { .. } | Shape::Level { .. } => (origin, None),
            Shape::Turning { part, arc, .. } => {
                let attitude = *arc.attitude_at(time_s).to_rotation_matrix().matrix();
                (origin + attitude * part.body_from_ellipsoid.translation.vector, Some(attitude))
            }
        }
    }

    /// About the time in the interval at which the path is nearest to the obstacle, as the obstacle measures distance.
    fn nearest_s(&self, from_s: f64, to_s: f64) -> f64 {
        let growth_m = self.part.half_extent.min();
        let mut time_s = 0.5 * (from_s + to_s);
        for _ in 0..3 {
            let [at, velocity, half_acceleration, ..] = about(&self.path, self.degree, time_s);
            let uphill = self.solid.measured(&self.solid.offset(&at), growth_m);
            let bend = velocity.dot(&self.solid.measured(&velocity, growth_m)) + 2.0 * half_acceleration.dot(&uphill);
            if bend.is_nan() || bend <= 0.0 {
                break;
            }
            let moved_s = (time_s - velocity.dot(&uphill) / bend).clamp(from_s, to_s);
            let is_settled = f64::abs(moved_s - time_s) <= 1e-2 * (to_s - from_s);
            time_s = moved_s;
            if is_settled {
                break;
            }
        }
        time_s
    }

    /// What the best plane at a time, or nearly the best, proves free of `[from_s, to_s]`; none where there is a contact at that
    /// time. The normal is that of a plane near it, and then that of this one.
    fn best_proves(&self, normal: &mut Vector3<f64>, time_s: f64, from_s: f64, to_s: f64) -> Proven {
        let (relative, attitude) = self.relative(time_s);
        *normal = match (&self.part.shape, &attitude) {
            (Shape::Sphere { .. }, _) => self.solid.normal_to_point(&relative),
            (Shape::Turning { solid, .. }, Some(attitude)) => {
                self.solid.normal_to(&solid.turned_to(attitude, relative), Some(normal), self.margin_m)?
            }
            (Shape::Level { solid } | Shape::Turning { solid, .. }, _) => {
                self.solid.normal_to(&solid.moved_to(relative), Some(normal), self.margin_m)?
            }
        };
        self.proves(normal, &attitude, time_s, from_s, to_s)
    }

    /// The part of `[from_s, to_s]` about `time_s` that the plane with this normal, placed at `time_s`, proves free; none
    /// where it does not keep the two apart even there.
    fn proves(&self, normal: &Vector3<f64>, attitude: &Attitude, time_s: f64, from_s: f64, to_s: f64) -> Proven {
        let along = self.path.map(|coefficient| normal.dot(&coefficient));
        let mut clearance = about(&along, self.degree, time_s);
        let kept_m = self.margin_m + self.solid.support(normal);
        let mut degree = self.degree;
        match &self.part.shape {
            Shape::Sphere { radius_m } => clearance[0] -= kept_m + radius_m,
            Shape::Level { solid } => clearance[0] -= kept_m + solid.support(normal),
            Shape::Turning { part, arc, solid } => {
                clearance[0] -= kept_m;
                let seen = attitude.map_or(*normal, |attitude| attitude.tr_mul(normal));
                let turning = (*part, *arc, solid.factor());
                let turn_degree = turning_below(&mut clearance, &seen, turning, (time_s, from_s, to_s));
                degree = degree.max(turn_degree);
            }
        }
        // What is not a number is a contact.
        let is_apart = clearance[0] > self.contact_m;
        if !is_apart {
            return None;
        }
        clearance[0] -= SLACK * self.contact_m;
        let last = time_s + stays_positive(&clearance, degree, to_s - time_s);
        let first = if from_s < time_s {
            for coefficient in clearance.iter_mut().skip(1).step_by(2) {
                *coefficient = -*coefficient;
            }
            time_s - stays_positive(&clearance, degree, time_s - from_s)
        } else {
            from_s
        };
        Some((first, last))
    }
}

/// Value of a path.
fn evaluate(path: &[Vector3<f64>; COEFFICIENTS], degree: usize, time_s: f64) -> Vector3<f64> {
    path.iter().take(degree + 1).rev().fold(Vector3::zeros(), |value, coefficient| value * time_s + coefficient)
}

/// Adds to the plane's clearance, in powers of the time since `time_s`, what a turning part contributes, or less, from the normal
/// as `seen` in body axes at that time. Returns the degree of what was added.
///
/// In body axes the normal `m` turns about the axis by minus the angle, so that the part contributes
/// `f(angle) = offset . m - sqrt(Q)`, `Q = |L' m|^2`, where `offset . m` and `Q` are a constant plus terms in sine and cosine of
/// the angle, `Q` also of its double. Hence a bound `M` of `-f''`, and `f(0) + f'(0) d - M d^2 / 2` lies below `f`.
fn turning_below(
    clearance: &mut [f64; COEFFICIENTS],
    seen: &Vector3<f64>,
    (part, arc, factor): (&BodyEllipsoid, &BodyArc, &Matrix3<f64>),
    (time_s, from_s, to_s): (f64, f64, f64),
) -> usize {
    let (axis, offset) = (arc.axis_body.into_inner(), &part.body_from_ellipsoid.translation.vector);
    let fixed = axis * axis.dot(seen);
    let turned = seen - fixed;
    let slope = seen.cross(&axis);
    let [fixed_axes, turned_axes, slope_axes] = [fixed, turned, slope].map(|part| factor.tr_mul(&part));
    // Q = even + a cos + b sin + c cos double + d sin double
    let (a, b) = (2.0 * fixed_axes.dot(&turned_axes), 2.0 * fixed_axes.dot(&slope_axes));
    let (turned_squared, slope_squared) = (turned_axes.norm_squared(), slope_axes.norm_squared());
    let (c, d) = (0.5 * (turned_squared - slope_squared), turned_axes.dot(&slope_axes));
    let even = fixed_axes.norm_squared() + 0.5 * (turned_squared + slope_squared);
    let (single, double) = (f64::sqrt(a * a + b * b), f64::sqrt(c * c + d * d));
    let thinnest = part.semi_axes.min();
    let least_support = f64::sqrt(f64::max(even - single - double, thinnest * thinnest));
    let support = f64::sqrt((fixed_axes + turned_axes).norm_squared());
    let lever = f64::sqrt(offset.dot(&turned) * offset.dot(&turned) + offset.dot(&slope) * offset.dot(&slope));
    let bend = 0.5 * (single + 4.0 * double) / least_support + lever;
    let rise = offset.dot(&slope) - 0.5 * (b + 2.0 * d) / support;

    let angle_degree = arc.angle.iter().rposition(|coefficient| *coefficient != 0.0).unwrap_or(0);
    let angle = about(&arc.angle, angle_degree, time_s);
    let rate_rad_s = fastest(&angle, from_s - time_s, to_s - time_s);
    clearance[0] += offset.dot(seen) - support;
    for (clearance, angle) in clearance.iter_mut().zip(&angle).skip(1) {
        *clearance += rise * angle;
    }
    clearance[2] -= 0.5 * bend * rate_rad_s * rate_rad_s;
    angle_degree.max(2)
}

/// Largest rate of an angle from the time `begin` to `end`, or beyond.
fn fastest(angle: &[f64; COEFFICIENTS], begin: f64, end: f64) -> f64 {
    let [_, first, second, third, fourth, fifth] = *angle;
    let rate = [first, 2.0 * second, 3.0 * third, 4.0 * fourth, 5.0 * fifth, 0.0];
    bernstein(&about(&rate, COEFFICIENTS - 1, begin), end - begin)
        .iter()
        .fold(0.0, |rate, point| f64::max(rate, point.abs()))
}
