//! Many poses of a body at once.
//!
//! For the offset `d` of a sphere's centre from an ellipsoid's, let `z` be `d` in the space where the ellipsoid is a unit ball
//! and `w` its pull-back, the direction of the gradient there. The plane across `w` lies `(z . z - |z|) / |w|` before the
//! centre: a lower bound of the signed distance. The surface point on the line to the centre gives the upper bound
//! `|d| (1 - 1 / |z|)`, or zero inside. Obstacles are bounded side by side; what the bounds leave open is asked exactly.

use super::world::{Entry, PosedPart, box_gap};
use super::{BodyShape, EllipsoidWorld, Sphere};
use crate::error::{PlanningError, finite};
use nalgebra::Vector3;
use tumble_lie::Pose;

/// Ellipsoids side by side.
const LANES: usize = 16;

/// Share of the distance between centres by which the bounds are widened: more than their rounding.
const ROUNDING: f64 = 1e-12;

/// What the bounds need of several ellipsoids, number by number; unused lanes are far away.
struct Lanes {
    count: usize,
    center: [[f64; LANES]; 3],
    /// Takes an offset to the space where the ellipsoid is a unit ball; row after row.
    to_ball: [[f64; LANES]; 9],
}

/// Bounds of the distance of a point from each lane.
struct Bounds {
    lower_m: [f64; LANES],
    upper_m: [f64; LANES],
}

impl Lanes {
    fn new(entries: &[Option<&Entry>; LANES], time_s: f64) -> Self {
        let count = entries.iter().flatten().count();
        let mut lanes = Self { count, center: [[0.0; LANES]; 3], to_ball: [[0.0; LANES]; 9] };
        for (lane, entry) in entries.iter().flatten().enumerate() {
            let (Some(to_ball), center) = (entry.solid.to_ball(), entry.reference_at(time_s)) else { continue };
            for (lanes, coordinate) in lanes.center.iter_mut().zip(&center) {
                lanes[lane] = *coordinate;
            }
            for (lanes, number) in lanes.to_ball.iter_mut().zip(to_ball.transpose().iter()) {
                lanes[lane] = *number;
            }
        }
        lanes
    }

    #[inline]
    #[expect(
        clippy::needless_range_loop,
        reason = "thirteen arrays side by side: the loop becomes vector instructions"
    )]
    fn bounds(&self, point: &Vector3<f64>) -> Bounds {
        let mut bounds = Bounds { lower_m: [f64::INFINITY; LANES], upper_m: [f64::INFINITY; LANES] };
        let lanes = if self.count <= LANES / 2 { LANES / 2 } else { LANES };
        let m = &self.to_ball;
        for lane in 0..lanes {
            let x = point.x - self.center[0][lane];
            let y = point.y - self.center[1][lane];
            let z = point.z - self.center[2][lane];
            let u = m[0][lane] * x + m[1][lane] * y + m[2][lane] * z;
            let v = m[3][lane] * x + m[4][lane] * y + m[5][lane] * z;
            let w = m[6][lane] * x + m[7][lane] * y + m[8][lane] * z;
            let squared = u * u + v * v + w * w;
            let length = f64::sqrt(squared);
            let back_x = m[0][lane] * u + m[3][lane] * v + m[6][lane] * w;
            let back_y = m[1][lane] * u + m[4][lane] * v + m[7][lane] * w;
            let back_z = m[2][lane] * u + m[5][lane] * v + m[8][lane] * w;
            let back = f64::sqrt(back_x * back_x + back_y * back_y + back_z * back_z);
            let apart = f64::sqrt(x * x + y * y + z * z);
            bounds.lower_m[lane] = (squared - length) / back - ROUNDING * apart;
            // At the centre itself the quotient is not a number, and zero the bound.
            bounds.upper_m[lane] = f64::max(0.0, apart - apart / length) + ROUNDING * apart;
        }
        bounds
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
        finite("the mission time", time_s)?;
        for pose in poses {
            let numbers = pose.translation.vector.sum() + pose.rotation.coords.sum();
            finite("the sum of a pose's numbers", numbers)?;
        }
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
        for (pose, clearance_m) in poses.iter().zip(clearances_m.iter_mut()) {
            let sphere = Sphere { center: center(pose), radius_m };
            for entry in boxes {
                let gap_m = box_gap(&sphere.center, &sphere.center, &entry.extent) - radius_m;
                if gap_m < *clearance_m {
                    *clearance_m = clearance_m.min(entry.solid.distance_to_sphere(&sphere));
                }
            }
        }
        let mut present = ellipsoids.iter().filter(|entry| entry.is_present(time_s));
        loop {
            let entries: [Option<&Entry>; LANES] = core::array::from_fn(|_| present.next());
            let lanes = Lanes::new(&entries, time_s);
            if lanes.count == 0 {
                return;
            }
            for (pose, clearance_m) in poses.iter().zip(clearances_m.iter_mut()) {
                let center = center(pose);
                let bounds = lanes.bounds(&center);
                let upper_m = bounds.upper_m.iter().take(lanes.count).fold(f64::INFINITY, |least, m| least.min(*m));
                let worth_m = f64::min(*clearance_m + radius_m, upper_m);
                for (entry, lower_m) in entries.iter().flatten().zip(&bounds.lower_m) {
                    // What is not a number, at the centre itself, is worth asking.
                    let is_beyond = *lower_m > worth_m;
                    if !is_beyond {
                        let relative = Sphere { center: center - entry.reference_at(time_s), radius_m };
                        *clearance_m = clearance_m.min(entry.solid.distance_to_sphere(&relative));
                    }
                }
            }
        }
    }
}
