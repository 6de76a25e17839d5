//! Measurements as they arrive, and what is made of each.

use super::flight_motion::whitening;
use crate::estimator::Measurement;
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
const LARGEST_ACCELERATION_M_S2: f64 = 1e4;

impl FlightMeasurement {
    /// A pose alone.
    pub fn of_pose(stamp_ns: i64, world_from_body: Pose<f64>) -> Self {
        Self { stamp_ns, world_from_body, rate_body: None, velocity_origin_world: None }
    }

    /// With the covariances of these levels.
    pub(super) fn with(&self, noise: &crate::recursive::MotionNoise) -> Measurement {
        let of_pose = Measurement::of_pose(self.stamp_ns, &self.world_from_body, noise.attitude_rad, noise.position_m);
        let isotropic = |sigma| move |value| crate::estimator::Gauss::isotropic(value, sigma);
        Measurement {
            rate_body: self.rate_body.map(isotropic(noise.rate_rad_s)),
            velocity_world: self.velocity_origin_world.map(isotropic(noise.velocity_m_s)),
            ..of_pose
        }
    }
}

/// Which quantities are there: attitude, position, rate, velocity, acceleration, one of the user's own.
pub(super) fn kinds(measurement: &Measurement) -> [bool; 6] {
    [
        measurement.attitude.is_some(),
        measurement.position_world.is_some(),
        measurement.rate_body.is_some(),
        measurement.velocity_world.is_some(),
        measurement.acceleration_body.is_some(),
        measurement.other.is_some(),
    ]
}

/// The same with a quaternion of unit length on the one side of the sphere; what is wrong with it otherwise.
pub(super) fn checked(measurement: &Measurement) -> Result<Measurement, &'static str> {
    let usable = |x: &f64, largest: f64| *x == 0.0 || (x.is_normal() && x.abs() <= largest);
    let mut checked = measurement.clone();
    if !kinds(measurement).contains(&true) {
        return Err("nothing was measured");
    }
    if let Some(attitude) = &mut checked.attitude {
        let q = attitude.value.into_inner().coords;
        let length = nalgebra::ComplexField::sqrt(q.norm_squared());
        if !q.iter().all(|x| usable(x, 2.0)) {
            return Err("attitude is not finite");
        }
        if (length - 1.0).abs() > UNIT_TOLERANCE {
            return Err("quaternion is not of unit length");
        }
        // The first component that is not zero is positive: both signs of a quaternion give the same bits.
        let negative = [q.w, q.x, q.y, q.z].into_iter().find(|x| *x != 0.0).is_some_and(|x| x < 0.0);
        let q = if negative { -q } else { q } / length;
        attitude.value =
            nalgebra::Unit::new_unchecked(nalgebra::Quaternion::new(q.w + 0.0, q.x + 0.0, q.y + 0.0, q.z + 0.0));
    }
    let vectors = [
        (&measurement.position_world, LARGEST_POSITION_M, "position is not finite or absurd"),
        (&measurement.rate_body, LARGEST_RATE_RAD_S, "rate is not finite or absurd"),
        (&measurement.velocity_world, LARGEST_VELOCITY_M_S, "velocity is not finite or absurd"),
        (&measurement.acceleration_body, LARGEST_ACCELERATION_M_S2, "acceleration is not finite or absurd"),
    ];
    for (vector, largest, what) in vectors {
        if !vector.iter().flat_map(|seen| seen.value.iter()).all(|x| usable(x, largest)) {
            return Err(what);
        }
    }
    if let Some((_, own)) = &measurement.other
        && !own.value.iter().all(|x| x.is_finite())
    {
        return Err("a quantity of the user's own is not finite");
    }
    let covariances = [
        measurement.attitude.map(|seen| seen.covariance),
        measurement.position_world.map(|seen| seen.covariance),
        measurement.rate_body.map(|seen| seen.covariance),
        measurement.velocity_world.map(|seen| seen.covariance),
        measurement.acceleration_body.map(|seen| seen.covariance),
        measurement.other.as_ref().map(|(_, seen)| seen.covariance),
    ];
    if !covariances.iter().flatten().all(|covariance| whitening(covariance).is_some()) {
        return Err("a covariance is not positive definite");
    }
    Ok(checked)
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
