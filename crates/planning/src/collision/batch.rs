//! Many poses of a body at once.
//!
//! For the offset `d` of a sphere's centre from an ellipsoid's, let `z` be `d` in the space where the ellipsoid is a unit ball
//! and `w` its pull-back, the direction of the gradient there. The plane across `w` lies `(z . z - |z|) / |w|` before the
//! centre: a lower bound of the signed distance. The surface point on the line to the centre gives the upper bound
//! `|d| (1 - 1 / |z|)`, or zero inside. Poses are bounded side by side, and what the bounds leave open is solved side by side:
//! plain arrays and loops without branches, which become vector instructions.

use super::world::{Entry, PosedPart};
use super::{BodyShape, EllipsoidWorld, Sphere};
use crate::error::{PlanningError, moderate, pose};
use nalgebra::Vector3;
use tumble_dynamics::AlignedBox;
use tumble_lie::Pose;

/// Poses side by side.
const LANES: usize = 8;

/// Ellipsoids per pass over the poses.
const BLOCK: usize = 16;

/// Share of the distance between centres by which the bounds are widened: more than their rounding.
const ROUNDING: f64 = 1e-12;

/// Newton steps before a pair is asked by itself.
const STEPS: usize = 12;

/// A number for each of the poses side by side.
type Row = [f64; LANES];

/// Coordinates of the centres of spheres.
type Points = [Row; 3];

/// What an ellipsoid's bounds need.
#[derive(Clone, Copy, Default)]
struct Shape<'a> {
    entry: Option<&'a Entry>,
    center: [f64; 3],
    /// Takes an offset to the space where the ellipsoid is a unit ball; row after row.
    to_ball: [f64; 9],
    semi_axes: [f64; 3],
}

/// Of the ellipsoid with the least lower bound: that bound, `z . z` and `d . d`.
struct Nearest {
    lower_m: Row,
    squared: Row,
    apart_squared: Row,
}

/// Lowers each number to the distance of the point from a box.
#[inline]
fn lower_to_box(distances_m: &mut Row, points: &Points, aligned: &AlignedBox) {
    let [x, y, z] = [0, 1, 2]
        .map(|axis| points[axis].map(|at| f64::max(aligned.lower_world[axis] - at, at - aligned.upper_world[axis])));
    for lane in 0..LANES {
        let (outside_x, outside_y, outside_z) = (x[lane].max(0.0), y[lane].max(0.0), z[lane].max(0.0));
        let outside = f64::sqrt(outside_x * outside_x + outside_y * outside_y + outside_z * outside_z);
        let inside = x[lane].max(y[lane]).max(z[lane]).min(0.0);
        distances_m[lane] = distances_m[lane].min(outside + inside);
    }
}

impl<'a> Shape<'a> {
    fn new(entry: &'a Entry, time_s: f64) -> Self {
        let mut shape = Self { entry: Some(entry), center: entry.reference_at(time_s).into(), ..Self::default() };
        if let Some((to_ball, semi_axes)) = entry.solid.to_ball() {
            for (number, entry) in shape.to_ball.iter_mut().zip(to_ball.transpose().iter()) {
                *number = *entry;
            }
            shape.semi_axes = semi_axes.into();
        }
        shape
    }

    #[inline]
    fn image(&self, x: f64, y: f64, z: f64) -> [f64; 3] {
        let m = &self.to_ball;
        [m[0] * x + m[1] * y + m[2] * z, m[3] * x + m[4] * y + m[5] * z, m[6] * x + m[7] * y + m[8] * z]
    }

    /// Lower bounds of the distance of each point.
    #[inline]
    fn lower_m(&self, points: &Points, nearest: &mut Nearest) -> Row {
        let mut bounds = [0.0; LANES];
        let m = &self.to_ball;
        for lane in 0..LANES {
            let (x, y, z) =
                (points[0][lane] - self.center[0], points[1][lane] - self.center[1], points[2][lane] - self.center[2]);
            let [u, v, w] = self.image(x, y, z);
            let squared = u * u + v * v + w * w;
            let back_x = m[0] * u + m[3] * v + m[6] * w;
            let back_y = m[1] * u + m[4] * v + m[7] * w;
            let back_z = m[2] * u + m[5] * v + m[8] * w;
            let back = f64::sqrt(back_x * back_x + back_y * back_y + back_z * back_z);
            let rounding_m = ROUNDING * (x.abs() + y.abs() + z.abs());
            let lower_m = (squared - f64::sqrt(squared)) / back - rounding_m;
            bounds[lane] = lower_m;
            let is_nearest = lower_m < nearest.lower_m[lane];
            nearest.lower_m[lane] = if is_nearest { lower_m } else { nearest.lower_m[lane] };
            nearest.squared[lane] = if is_nearest { squared } else { nearest.squared[lane] };
            let apart_squared = x * x + y * y + z * z;
            nearest.apart_squared[lane] = if is_nearest { apart_squared } else { nearest.apart_squared[lane] };
        }
        bounds
    }
}

/// Pairs of a point and an ellipsoid whose distance is asked.
#[derive(Default)]
struct Open<'a> {
    count: usize,
    /// Which pose.
    place: [usize; LANES],
    entry: [Option<&'a Entry>; LANES],
    /// The point in the ellipsoid's axes.
    local: [Row; 3],
    semi_axes: [Row; 3],
}

impl<'a> Open<'a> {
    /// Adds a pair; there must be room.
    #[inline]
    fn push(&mut self, place: usize, shape: &Shape<'a>, point: [f64; 3]) {
        let lane = self.count;
        if lane >= LANES {
            return;
        }
        let c = &shape.center;
        let image = shape.image(point[0] - c[0], point[1] - c[1], point[2] - c[2]);
        for (row, (image, semi_axis)) in self.local.iter_mut().zip(image.iter().zip(&shape.semi_axes)) {
            row[lane] = image * semi_axis;
        }
        for (row, semi_axis) in self.semi_axes.iter_mut().zip(&shape.semi_axes) {
            row[lane] = *semi_axis;
        }
        (self.place[lane], self.entry[lane]) = (place, shape.entry);
        self.count = lane + 1;
    }

    /// Distance of each point from its ellipsoid, by the secular equation as [`super::ellipsoid_to_sphere`] solves it; not a
    /// number where these steps do not suffice.
    #[inline]
    #[expect(clippy::needless_range_loop, reason = "arrays side by side: the loops become vector instructions")]
    fn solve(&self) -> Row {
        let (mut excess, mut weights) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        let (mut root, mut inverse, mut ratio) = ([0.0; LANES], [[0.0; LANES]; 3], [0.0; LANES]);
        for lane in 0..LANES {
            let [a, b, c] = [0, 1, 2].map(|axis| self.semi_axes[axis][lane]);
            let least = a.min(b).min(c);
            let mut at_least = 0.0;
            let (mut squares, mut largest) = (0.0, 0.0);
            for axis in 0..3 {
                let semi_axis = self.semi_axes[axis][lane];
                let weight = semi_axis * self.local[axis][lane].abs();
                let over = (semi_axis - least) * (semi_axis + least);
                at_least = f64::max(at_least, weight - over);
                squares += weight * weight;
                largest = f64::max(largest, over);
                (excess[axis][lane], weights[axis][lane]) = (over, weight);
            }
            root[lane] = f64::max(at_least, f64::sqrt(squares) - largest);
        }
        for _ in 0..STEPS {
            let mut worst = 0.0;
            for lane in 0..LANES {
                let (mut sum, mut slope) = (0.0, 0.0);
                for axis in 0..3 {
                    let inverted = 1.0 / (root[lane] + excess[axis][lane]);
                    let term = weights[axis][lane] * inverted;
                    sum += term * term;
                    slope += term * term * inverted;
                    inverse[axis][lane] = inverted;
                }
                ratio[lane] = f64::sqrt(sum);
                let step = sum * (ratio[lane] - 1.0) / slope;
                root[lane] += if step > 0.0 { step } else { 0.0 };
            }
            for ratio in ratio {
                worst = f64::max(worst, ratio);
            }
            if worst < 1.0 + 1e-9 {
                break;
            }
        }
        let mut distances_m = [0.0; LANES];
        for lane in 0..LANES {
            let (mut squares, mut along, mut height) = (0.0, 0.0, 0.0);
            for axis in 0..3 {
                let (local, semi_axis) = (self.local[axis][lane], self.semi_axes[axis][lane]);
                let normal = local * inverse[axis][lane];
                squares += normal * normal;
                along += normal * local;
                height += normal * normal * semi_axis * semi_axis;
            }
            let width_m = (along - f64::sqrt(height)) / f64::sqrt(squares);
            // The plane's error is the square of this.
            distances_m[lane] = if (ratio[lane] - 1.0).abs() < 1e-9 { width_m } else { f64::NAN };
        }
        distances_m
    }

    /// Lowers the clearances of the poses in question, and empties.
    fn settle(
        &mut self,
        poses: &[Pose<f64>],
        center: impl Fn(&Pose<f64>) -> Vector3<f64>,
        time_s: f64,
        radius_m: f64,
        clearances_m: &mut [f64],
    ) {
        let distances_m = self.solve();
        for ((place, entry), distance_m) in self.place.iter().zip(&self.entry).zip(&distances_m).take(self.count) {
            let (Some(clearance_m), Some(pose), Some(entry)) = (clearances_m.get_mut(*place), poses.get(*place), entry)
            else {
                continue;
            };
            *clearance_m = clearance_m.min(if distance_m.is_nan() {
                let relative = Sphere { center: center(pose) - entry.reference_at(time_s), radius_m };
                entry.solid.distance_to_sphere(&relative)
            } else {
                distance_m - radius_m
            });
        }
        self.count = 0;
    }
}

impl EllipsoidWorld {
    /// Signed clearance of each pose at one time, m, or `limit_m` where that is less: what [`CollisionWorld::clearance`](super::CollisionWorld::clearance) says
    /// pose by pose, several times as fast for bodies of spheres. The lower the limit the faster: who only asks for contacts
    /// passes the margin.
    ///
    /// # Shape
    /// `clearances_m` is emptied and filled: no allocation once it is large enough.
    ///
    /// # Errors
    /// Numbers that are not finite.
    pub fn clearances(
        &self,
        body: &BodyShape,
        poses: &[Pose<f64>],
        time_s: f64,
        limit_m: f64,
        clearances_m: &mut Vec<f64>,
    ) -> Result<(), PlanningError> {
        moderate("the mission time", time_s)?;
        for one in poses {
            pose(one)?;
        }
        self.check_moved(time_s, time_s)?;
        clearances_m.clear();
        clearances_m.resize(poses.len(), limit_m);
        for part in body.parts() {
            let radius_m = part.semi_axes.max();
            if part.semi_axes.min() < radius_m {
                for (pose, clearance_m) in poses.iter().zip(clearances_m.iter_mut()) {
                    let part = PosedPart::new(part, pose);
                    let nearest = self.nearest_to(&part, time_s, *clearance_m, |entry| entry.is_present(time_s));
                    *clearance_m = nearest.map_or(*clearance_m, |(distance_m, _)| distance_m);
                }
            } else {
                let offset = part.body_from_ellipsoid.translation.vector;
                let center = |pose: &Pose<f64>| {
                    let origin = pose.translation.vector;
                    if offset == Vector3::zeros() { origin } else { origin + pose.rotation * offset }
                };
                self.sphere_clearances(center, radius_m, poses, time_s, clearances_m);
            }
        }
        Ok(())
    }

    /// Lowers each number to the clearance of a sphere about the centre of the pose, where that is less.
    fn sphere_clearances(
        &self,
        center: impl Fn(&Pose<f64>) -> Vector3<f64>,
        radius_m: f64,
        poses: &[Pose<f64>],
        time_s: f64,
        clearances_m: &mut [f64],
    ) {
        let (boxes, ellipsoids) = self.boxes_and_ellipsoids();
        for (poses, clearances_m) in poses.chunks(LANES).zip(clearances_m.chunks_mut(LANES)) {
            let (points, mut distances_m) = side_by_side(&center, poses, clearances_m, radius_m);
            for entry in boxes {
                lower_to_box(&mut distances_m, &points, &entry.extent);
            }
            for (clearance_m, distance_m) in clearances_m.iter_mut().zip(&distances_m) {
                *clearance_m = clearance_m.min(distance_m - radius_m);
            }
        }
        let mut present = ellipsoids.iter().filter(|entry| entry.is_present(time_s));
        let mut open = Open::default();
        loop {
            let (mut shapes, mut count) = ([Shape::default(); BLOCK], 0);
            for (shape, entry) in shapes.iter_mut().zip(&mut present) {
                *shape = Shape::new(entry, time_s);
                count += 1;
            }
            if count == 0 {
                return;
            }
            let shapes = shapes.get(..count).unwrap_or(&[]);
            for (chunk, of_chunk) in poses.chunks(LANES).enumerate() {
                let first = chunk * LANES;
                let known_m = clearances_m.get(first..).unwrap_or(&[]);
                let (points, limits_m) = side_by_side(&center, of_chunk, known_m, radius_m);
                let (lower_m, limits_m) = bounds(shapes, &points, &limits_m);
                for (shape, lower_m) in shapes.iter().zip(&lower_m) {
                    for lane in 0..of_chunk.len().min(LANES) {
                        // What is not a number, at the centre itself, is worth asking.
                        let is_beyond = lower_m[lane] > limits_m[lane];
                        if !is_beyond {
                            open.push(first + lane, shape, [points[0][lane], points[1][lane], points[2][lane]]);
                            if open.count == LANES {
                                open.settle(poses, &center, time_s, radius_m, clearances_m);
                            }
                        }
                    }
                }
            }
            open.settle(poses, &center, time_s, radius_m, clearances_m);
        }
    }
}

/// The centres of up to [`LANES`] poses, and the distance of each centre beyond which nothing counts.
#[inline]
fn side_by_side(
    center: impl Fn(&Pose<f64>) -> Vector3<f64>,
    poses: &[Pose<f64>],
    clearances_m: &[f64],
    radius_m: f64,
) -> (Points, Row) {
    let (mut points, mut limits_m) = ([[0.0; LANES]; 3], [f64::NEG_INFINITY; LANES]);
    for (lane, (pose, clearance_m)) in poses.iter().zip(clearances_m).enumerate().take(LANES) {
        let center = center(pose);
        for (row, coordinate) in points.iter_mut().zip(&center) {
            row[lane] = *coordinate;
        }
        limits_m[lane] = clearance_m + radius_m;
    }
    (points, limits_m)
}

/// Lower bounds of the distance of each point from each shape, and what the nearest shape's upper bound makes of the limits.
#[inline]
fn bounds(shapes: &[Shape<'_>], points: &Points, limits_m: &Row) -> ([Row; BLOCK], Row) {
    let far = [f64::INFINITY; LANES];
    let mut nearest = Nearest { lower_m: far, squared: far, apart_squared: far };
    let mut lower_m = [far; BLOCK];
    for (shape, lower_m) in shapes.iter().zip(&mut lower_m) {
        *lower_m = shape.lower_m(points, &mut nearest);
    }
    let mut limits_m = *limits_m;
    for (limit_m, (squared, apart_squared)) in
        limits_m.iter_mut().zip(nearest.squared.iter().zip(&nearest.apart_squared))
    {
        let apart_m = f64::sqrt(*apart_squared);
        let upper_m = f64::max(0.0, apart_m - apart_m / f64::sqrt(*squared));
        *limit_m = f64::min(*limit_m, upper_m) + ROUNDING * apart_m;
    }
    (lower_m, limits_m)
}
