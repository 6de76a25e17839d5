//! Estimators in flight: the trait and what they are told.

use super::{EstimatorError, Finding, Measurement};
use crate::dynamics::RigidBodyState;
use crate::lie::Wrench;
use crate::recursive::{FlightHealth, Reception, ReceptionCounts};
use nalgebra::{SVector, Vector3};

/// What is believed to have acted; stored momentum stands in the type, so that nobody with wheels forgets it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acted {
    /// Begin of the span, ns.
    pub from_ns: i64,
    /// End of the span, ns.
    pub until_ns: i64,
    /// External, and the wheels' reaction torque; body axes about the origin.
    pub wrench_body: Wrench<f64>,
    /// Angular momentum of wheels relative to the body, body axes, mean over the span, N m s; zero without. Its change is in the torque,
    /// that it is turned along with the body is not: an estimator adds h x w itself.
    pub stored_body: Vector3<f64>,
}

/// What an estimator is told to doubt.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Doubt {
    /// Something was grasped or released: jumps of the ten `LogCholesky` coordinates.
    Body(SVector<f64, 10>),
    /// Actuators do not do what they are told, which may take back a doubt of the body that came shortly before.
    Wrench,
}

/// Motion and body in flight. `Send`, so that every loop of it is; neither `Clone` nor `Sync`.
///
/// # Example
/// What flies one asks no more than this; here the joint filter sits behind the trait.
/// ```
/// use tumble_identification::dynamics::{InertialParameters, RigidBodyState};
/// use tumble_identification::estimator::{Acted, Measurement, StateEstimator};
/// use tumble_identification::lie::{Pose, Wrench};
/// use tumble_identification::nalgebra::{SMatrix, Vector3};
/// use tumble_identification::recursive::{FlightEstimator, FlightEstimatorSettings};
/// use tumble_identification::{Estimate, StandardDeviations};
///
/// let body = InertialParameters::solid_box(10.0, [0.3, 0.3, 0.3]);
/// let deviations = body.to_vector().map(|x: f64| 0.2 * x.abs() + 0.02);
/// let covariance = SMatrix::from_diagonal(&deviations.map(|s| s * s));
/// let std = StandardDeviations {
///     mass_kg: deviations[0],
///     center_of_mass_m: Vector3::repeat(0.01),
///     inertia_about_com_kg_m2: SMatrix::repeat(0.02),
/// };
/// let prior = Estimate { parameters: body, covariance, std, lmi_active: false };
/// let settings = FlightEstimatorSettings::of_poses(1e-3, 1e-3, 0.1);
/// let mut flying: Box<dyn StateEstimator> =
///     Box::new(FlightEstimator::try_new(settings, RigidBodyState::at_rest(), 0, &prior)?);
/// let push = Wrench::new(Vector3::zeros(), Vector3::x());
/// flying.acted(&Acted { from_ns: 0, until_ns: 100_000_000, wrench_body: push, stored_body: Vector3::zeros() });
/// flying.measured(&Measurement::of_pose(100_000_000, &Pose::translation(5e-4, 0.0, 0.0), 1e-3, 1e-3));
/// assert!((flying.state_at(100_000_000).twist_body.linear.x - 0.01).abs() < 5e-3);
/// assert!(flying.finding()?.point().is_some());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
/// Tutorial: [an estimator in flight of your own, without a pose](https://github.com/tumble-robotics/tumble/blob/main/examples/servicer/src/drifting_pose.rs).
pub trait StateEstimator: Send {
    /// What to call it in messages; the name of its type unless written.
    fn name(&self) -> &'static str {
        core::any::type_name::<Self>()
    }
    /// Hears what is believed to have acted in a span; a later word of the same span replaces an earlier one.
    fn acted(&mut self, acted: &Acted);
    /// Takes a measurement, which may be late, out of order, doubled or absurd.
    fn measured(&mut self, measurement: &Measurement) -> Reception;
    /// Motion at a time, carried on by what acted.
    fn state_at(&self, time_ns: i64) -> RigidBodyState<f64>;
    /// What is known of the ten inertial parameters.
    ///
    /// # Errors
    /// Of the implementation; the flight then goes on with the last belief.
    fn finding(&self) -> Result<Finding, EstimatorError>;
    /// Whether the filter's own account of its errors still holds; always, unless written.
    fn health(&self) -> FlightHealth {
        FlightHealth::default()
    }
    /// Stamp of the newest measurement that was looked at, ns.
    fn newest_stamp_ns(&self) -> i64;
    /// Widens what is known of the body or of the actuators; nothing, unless written.
    fn doubt(&mut self, _doubt: &Doubt) {}
    /// Sets the body back to a prior, the motion kept.
    ///
    /// # Errors
    /// A prior that is none; nothing is changed then.
    fn restart(&mut self, body: &Finding) -> Result<(), EstimatorError>;
    /// What became of the measurements; not counted, unless written.
    fn counts(&self) -> ReceptionCounts {
        ReceptionCounts::default()
    }
    /// What to ask of doubted actuators for a wrench.
    fn compensated(&self, _wrench: &Wrench<f64>) -> Option<Wrench<f64>> {
        None
    }
}

impl<T: StateEstimator + ?Sized> StateEstimator for Box<T> {
    fn name(&self) -> &'static str {
        (**self).name()
    }
    fn acted(&mut self, acted: &Acted) {
        (**self).acted(acted);
    }
    fn measured(&mut self, measurement: &Measurement) -> Reception {
        (**self).measured(measurement)
    }
    fn state_at(&self, time_ns: i64) -> RigidBodyState<f64> {
        (**self).state_at(time_ns)
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        (**self).finding()
    }
    fn health(&self) -> FlightHealth {
        (**self).health()
    }
    fn newest_stamp_ns(&self) -> i64 {
        (**self).newest_stamp_ns()
    }
    fn doubt(&mut self, doubt: &Doubt) {
        (**self).doubt(doubt);
    }
    fn restart(&mut self, body: &Finding) -> Result<(), EstimatorError> {
        (**self).restart(body)
    }
    fn counts(&self) -> ReceptionCounts {
        (**self).counts()
    }
    fn compensated(&self, wrench: &Wrench<f64>) -> Option<Wrench<f64>> {
        (**self).compensated(wrench)
    }
}
