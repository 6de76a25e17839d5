//! Measurements as they arrive, and what is made of each.

use crate::lie::Pose;
use nalgebra::Vector3;

/// Where the body was seen at one moment.
///
/// # Frame
/// As in [`MotionSample`](crate::MotionSample): rate in body axes, velocity of the body origin in inertial axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightMeasurement {
    /// Time of the content, ns.
    pub stamp_ns: i64,
    /// Measured pose.
    pub world_from_body: Pose<f64>,
    /// Measured angular velocity, rad/s.
    pub rate_body: Option<Vector3<f64>>,
    /// Measured velocity of the origin, m/s.
    pub velocity_origin_world: Option<Vector3<f64>>,
}

/// A quaternion this far from unit length is not one, m and rad/s beyond these sizes are not a flight.
const UNIT_TOLERANCE: f64 = 1e-3;
const LARGEST_POSITION_M: f64 = 1e6;
const LARGEST_RATE_RAD_S: f64 = 1e3;
const LARGEST_VELOCITY_M_S: f64 = 1e4;

impl FlightMeasurement {
    /// A pose alone.
    pub fn of_pose(stamp_ns: i64, world_from_body: Pose<f64>) -> Self {
        Self { stamp_ns, world_from_body, rate_body: None, velocity_origin_world: None }
    }

    /// The same with a quaternion of unit length on the one side of the sphere; what is wrong with it otherwise.
    pub(super) fn checked(&self) -> Result<Self, &'static str> {
        let usable = |x: f64, largest: f64| x == 0.0 || (x.is_normal() && x.abs() <= largest);
        let q = self.world_from_body.rotation.into_inner().coords;
        let length = nalgebra::ComplexField::sqrt(q.norm_squared());
        if !q.iter().all(|x| usable(*x, 2.0)) {
            return Err("attitude is not finite");
        }
        if (length - 1.0).abs() > UNIT_TOLERANCE {
            return Err("quaternion is not of unit length");
        }
        if !self.world_from_body.translation.vector.iter().all(|x| usable(*x, LARGEST_POSITION_M)) {
            return Err("position is not finite or absurd");
        }
        if !self.rate_body.iter().flatten().all(|x| usable(*x, LARGEST_RATE_RAD_S)) {
            return Err("rate is not finite or absurd");
        }
        if !self.velocity_origin_world.iter().flatten().all(|x| usable(*x, LARGEST_VELOCITY_M_S)) {
            return Err("velocity is not finite or absurd");
        }
        // The first component that is not zero is positive: both signs of a quaternion give the same bits.
        let negative = [q.w, q.x, q.y, q.z].into_iter().find(|x| *x != 0.0).is_some_and(|x| x < 0.0);
        let q = if negative { -q } else { q } / length;
        let mut checked = *self;
        checked.world_from_body.rotation =
            nalgebra::Unit::new_unchecked(nalgebra::Quaternion::new(q.w + 0.0, q.x + 0.0, q.y + 0.0, q.z + 0.0));
        Ok(checked)
    }
}

/// What was made of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Reception {
    /// It entered the estimate.
    Used {
        /// Normalised innovation squared.
        nis: f64,
    },
    /// Too unlikely; the filter flies on without it.
    Gated {
        /// Normalised innovation squared.
        nis: f64,
    },
    /// The last of several unlikely ones that agree: pose and velocity begin anew there, the body is kept.
    Relocalised,
    /// Every channel repeats the last measurement to the bit: nothing new.
    Frozen,
    /// Older than what is kept, or than the start.
    TooOld,
    /// Of this stamp there is one already.
    Duplicate,
    /// Later than anything that has been acted.
    FromTheFuture,
    /// Not a measurement.
    Malformed {
        /// What is wrong with it.
        what: &'static str,
    },
}

/// How many measurements came to which end.
///
/// # Shape
/// The first four are of the stream in the order of its stamps, and so do not depend on the order of arrival.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReceptionCounts {
    /// [`Reception::Used`].
    pub used: u64,
    /// [`Reception::Gated`].
    pub gated: u64,
    /// [`Reception::Relocalised`].
    pub relocalised: u64,
    /// [`Reception::Frozen`].
    pub frozen: u64,
    /// [`Reception::TooOld`].
    pub too_old: u64,
    /// [`Reception::Duplicate`].
    pub duplicate: u64,
    /// [`Reception::FromTheFuture`].
    pub from_the_future: u64,
    /// [`Reception::Malformed`].
    pub malformed: u64,
    /// Arrived after a later one and entered by filtering again from its stamp on.
    pub replayed: u64,
}
