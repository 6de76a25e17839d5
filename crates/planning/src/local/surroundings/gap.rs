//! A part of a body against a solid: the signed distance between them, and how it changes with the motion.

use super::gauge::spread;
use super::hermite::{Segment, evaluate};
use super::turn::{Attitude, Turn};
use crate::collision::{Distance, Ellipsoid, Sphere, distance, ellipsoid_to_box, ellipsoid_to_sphere, sphere_to_box};
use crate::local::model::KINEMATICS;
use nalgebra::{Matrix3, Vector3};
use tumble_dynamics::AlignedBox;

/// A part of a body, in body axes.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Part {
    /// A ball, perhaps of no size.
    Ball(Sphere),
    Ellipsoid(Ellipsoid),
}

/// What is kept off, where it is.
#[derive(Clone, Copy)]
pub(super) enum Solid<'a> {
    /// About its centre.
    Ellipsoid(&'a Ellipsoid),
    Box(&'a AlignedBox),
}

/// A distance, and the place by which it changes.
#[derive(Clone, Copy)]
pub(super) struct Gap {
    pub distance_m: f64,
    /// From the solid to the body, world axes: the change by the body's position.
    pub normal: Vector3<f64>,
    /// The change by the body's attitude: moment of the normal at the nearest point, about the origin, body axes.
    pub moment: Vector3<f64>,
}

impl Part {
    pub fn center(&self) -> &Vector3<f64> {
        match self {
            Self::Ball(sphere) => &sphere.center,
            Self::Ellipsoid(solid) => solid.center(),
        }
    }

    /// Radius of the ball about its centre that holds it, m.
    pub fn radius_m(&self) -> f64 {
        match self {
            Self::Ball(sphere) => sphere.radius_m,
            Self::Ellipsoid(solid) => solid.semi_axes().max(),
        }
    }

    /// Bound of how fast the support function falls behind a straight line, by squared rate of turn and by its change.
    fn unroundness(&self) -> (f64, f64) {
        match self {
            Self::Ball(_) => (0.0, 0.0),
            Self::Ellipsoid(solid) => {
                let (least, largest) = (solid.semi_axes().min(), solid.semi_axes().max());
                (largest * largest / least + largest, largest)
            }
        }
    }
}

impl Solid<'_> {
    /// From its reference point at `center`.
    pub fn gap(&self, part: &Part, center: &Vector3<f64>, position: &Vector3<f64>, attitude: &Matrix3<f64>) -> Gap {
        let offset = position - center + attitude * part.center();
        let (found, witness) = match (part, self) {
            (Part::Ball(ball), Self::Ellipsoid(solid)) => {
                let ball = Sphere { center: offset, ..*ball };
                outward(ellipsoid_to_sphere(&solid.moved_to(Vector3::zeros()), &ball))
            }
            (Part::Ball(ball), Self::Box(aligned)) => {
                outward(sphere_to_box(&Sphere { center: offset, ..*ball }, aligned).swapped())
            }
            (Part::Ellipsoid(part), Self::Ellipsoid(solid)) => {
                outward(distance(&solid.moved_to(Vector3::zeros()), &part.turned_to(attitude, offset)))
            }
            (Part::Ellipsoid(part), Self::Box(aligned)) => {
                outward(ellipsoid_to_box(&part.turned_to(attitude, offset), aligned).swapped())
            }
        };
        let arm = attitude.tr_mul(&(witness - position + center));
        Gap { moment: arm.cross(&attitude.tr_mul(&found.normal)), ..found }
    }

    /// The distance is not below this.
    pub fn ball_gap(
        &self,
        part: &Part,
        center: &Vector3<f64>,
        position: &Vector3<f64>,
        attitude: &Matrix3<f64>,
    ) -> Gap {
        let arm = attitude * part.center();
        let ball = Sphere { center: position - center + arm, radius_m: part.radius_m() };
        let found = match self {
            Self::Ellipsoid(solid) => {
                let apart = f64::sqrt(ball.center.norm_squared());
                let normal = if apart > 0.0 { ball.center / apart } else { Vector3::x() };
                let distance_m = apart - solid.semi_axes().max() - ball.radius_m;
                Gap { distance_m, normal, moment: Vector3::zeros() }
            }
            Self::Box(aligned) => outward(sphere_to_box(&ball, aligned).swapped()).0,
        };
        Gap { moment: part.center().cross(&attitude.tr_mul(&found.normal)), ..found }
    }
}

/// From the distance of a solid to a part: the gap without its moment, and the nearest point of the part.
fn outward(found: Distance) -> (Gap, Vector3<f64>) {
    (Gap { distance_m: found.distance_m, normal: found.normal, moment: Vector3::zeros() }, found.point_on_b)
}

/// A pair on one segment.
pub(super) struct Approach<'a> {
    pub part: &'a Part,
    pub solid: Solid<'a>,
    /// Way of the solid's reference point, in Bernstein form.
    pub way: &'a [Vector3<f64>; 6],
    pub segment: &'a Segment,
    pub turn: &'a Turn,
}

/// The gap at one place of a segment.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub s: f64,
    pub gap: Gap,
    /// Its change by `s`.
    pub slope: f64,
}

/// A gradient by both ends.
pub(super) type Ends = [[f64; KINEMATICS]; 2];

impl Approach<'_> {
    fn place(&self, s: f64, gap: impl Fn(&Vector3<f64>, &Vector3<f64>, &Attitude) -> Gap) -> (Place, Attitude) {
        let [position, velocity, _] = evaluate(&self.segment.points, s);
        let [center, drift, _] = evaluate(self.way, s);
        let attitude = self.turn.at(s);
        let gap = gap(&center, &position, &attitude);
        let slope = gap.normal.dot(&(velocity - drift)) + gap.moment.dot(&attitude.rate);
        (Place { s, gap, slope }, attitude)
    }

    pub fn at(&self, s: f64) -> Place {
        self.with_attitude(s).0
    }

    pub fn with_attitude(&self, s: f64) -> (Place, Attitude) {
        self.place(s, |center, position, attitude| {
            self.solid.gap(self.part, center, position, &attitude.world_from_body)
        })
    }

    /// The same for the balls that hold both: a lower bound.
    pub fn of_balls(&self, s: f64) -> (Place, Attitude) {
        self.place(s, |center, position, attitude| {
            self.solid.ball_gap(self.part, center, position, &attitude.world_from_body)
        })
    }

    /// The gradient of the gap at a fixed `s`.
    pub fn by_ends(&self, place: &Place, attitude: &Attitude) -> Ends {
        let [mut by_start, mut by_end] = [[0.0; KINEMATICS]; 2];
        spread(&self.segment.position(place.s), &place.gap.normal, &mut by_start, &mut by_end);
        self.turn.spread(attitude, &place.gap.moment, &mut by_start, &mut by_end);
        [by_start, by_end]
    }

    /// Bounds of the slope of the gap along the segment, and of how fast that can fall.
    ///
    /// The gap is the widest of the slabs between the two, over all normals; where each of them bends down by no more than this,
    /// so does the widest.
    pub fn bounds(&self) -> (f64, f64) {
        let (mut speed, mut bend) = differences(&self.segment.points);
        let (drift, drift_bend) = differences(self.way);
        speed += drift;
        bend += drift_bend;
        let (rate, rate_change) = differences(&self.turn.points);
        let acceleration = rate_change + rate * rate;
        let arm = f64::sqrt(self.part.center().norm_squared());
        let (by_rate, by_acceleration) = self.part.unroundness();
        speed += (arm + if by_rate > 0.0 { self.part.radius_m() } else { 0.0 }) * rate;
        bend += arm * (rate * rate + acceleration) + by_rate * rate * rate + by_acceleration * acceleration;
        (speed, bend)
    }
}

/// Bounds of the first and second derivative of a curve in Bernstein form.
fn differences<const N: usize>(points: &[Vector3<f64>; N]) -> (f64, f64) {
    let degree = N as f64 - 1.0;
    let (mut first, mut second) = (0.0, 0.0);
    for pair in points.windows(2) {
        if let [a, b] = pair {
            first = f64::max(first, (b - a).norm_squared());
        }
    }
    for triple in points.windows(3) {
        if let [a, b, c] = triple {
            second = f64::max(second, (c - b * 2.0 + a).norm_squared());
        }
    }
    (degree * f64::sqrt(first), degree * (degree - 1.0) * f64::sqrt(second))
}
