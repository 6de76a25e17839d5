//! What an estimator in flight is told of what was seen.

use crate::dynamics::RigidBodyState;
use crate::lie::{Manifold, Pose};
use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};
use std::sync::Arc;

/// A value with its whole covariance; of an attitude in body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gauss<V> {
    /// What was measured.
    pub value: V,
    /// Its covariance, in the axes of the quantity.
    pub covariance: Matrix3<f64>,
}

impl<V> Gauss<V> {
    /// Errors alike in all directions, of this standard deviation.
    pub fn isotropic(value: V, sigma: f64) -> Self {
        Self { value, covariance: Matrix3::identity() * (sigma * sigma) }
    }
}

/// A measurement of a kind that the library does not know: range, bearing, a star's direction, at most three numbers.
///
/// # Example
/// ```
/// use tumble_identification::dynamics::RigidBodyState;
/// use tumble_identification::estimator::Sensor;
/// use tumble_identification::nalgebra::Vector3;
///
/// /// Distance from a beacon at the origin, m; the other two numbers are none.
/// #[derive(Debug)]
/// struct Range;
/// impl Sensor for Range {
///     fn predicted(&self, state: &RigidBodyState<f64>) -> Vector3<f64> {
///         Vector3::x() * state.world_from_body.translation.vector.norm()
///     }
/// }
/// let mut state = RigidBodyState::at_rest();
/// state.world_from_body.translation.vector = Vector3::new(3.0, 4.0, 0.0);
/// assert_eq!(Range.residual(&(Vector3::x() * 5.5), &state).x, 0.5);
/// ```
/// Tutorial: [a sensor of your own, and a flight by it](https://github.com/tumble-robotics/tumble/blob/main/crates/identification/tests/suite/custom_sensor.rs).
pub trait Sensor: Send + Sync + std::fmt::Debug {
    /// What the sensor would show of this motion, in its own units.
    fn predicted(&self, state: &RigidBodyState<f64>) -> Vector3<f64>;

    /// Measured minus predicted; angles wrap here.
    fn residual(&self, measured: &Vector3<f64>, state: &RigidBodyState<f64>) -> Vector3<f64> {
        measured - self.predicted(state)
    }

    /// Along an increment of the state; by differences unless written.
    fn sensitivity(&self, state: &RigidBodyState<f64>) -> SMatrix<f64, 3, 12> {
        let mut slopes = SMatrix::<f64, 3, 12>::zeros();
        for j in 0..12 {
            let nudge = SVector::<f64, 12>::ith(j, 1e-6);
            let apart = self.predicted(&state.oplus(&nudge)) - self.predicted(&state.oplus(&-nudge));
            slopes.set_column(j, &(apart / 2e-6));
        }
        slopes
    }
}

/// What was measured at one time: all of it may be absent.
#[derive(Clone, Debug, Default)]
pub struct Measurement {
    /// Time at which it was true, ns.
    pub stamp_ns: i64,
    /// Attitude, body to world; covariance of a turn in body axes, rad^2.
    pub attitude: Option<Gauss<UnitQuaternion<f64>>>,
    /// Position of the body origin, world axes, m.
    pub position_world: Option<Gauss<Vector3<f64>>>,
    /// Angular velocity, body axes, rad/s.
    pub rate_body: Option<Gauss<Vector3<f64>>>,
    /// Velocity of the body origin, world axes, m/s.
    pub velocity_world: Option<Gauss<Vector3<f64>>>,
    /// Acceleration of the body origin as an inertial unit at the place that the estimator is told of shows it, without gravity, body
    /// axes, m/s^2.
    pub acceleration_body: Option<Gauss<Vector3<f64>>>,
    /// A quantity of the user's own; components beyond those that it has carry an infinite variance.
    #[allow(clippy::type_complexity)] // a sensor with what it showed
    pub other: Option<(Arc<dyn Sensor>, Gauss<Vector3<f64>>)>,
}

impl Measurement {
    /// A pose, with standard deviations of angle (rad) and position (m) that are alike in all directions.
    pub fn of_pose(stamp_ns: i64, world_from_body: &Pose<f64>, angle_rad: f64, position_m: f64) -> Self {
        Self {
            stamp_ns,
            attitude: Some(Gauss::isotropic(world_from_body.rotation, angle_rad)),
            position_world: Some(Gauss::isotropic(world_from_body.translation.vector, position_m)),
            ..Self::default()
        }
    }
}
