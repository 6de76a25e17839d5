//! Finite differences of measured velocities and rates: the baselines that the pose-only regressors are compared with.

use super::{Regressor, newton_euler};
use crate::lie::{Pose, Wrench};
use nalgebra::Vector3;

/// What a finite difference needs at each sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateSample {
    /// Pose of the body frame in the inertial frame.
    pub world_from_body: Pose<f64>,
    /// Velocity of the body origin, inertial axes, m/s.
    pub velocity_origin_world: Vector3<f64>,
    /// Angular velocity, body axes, rad/s.
    pub rate_body: Vector3<f64>,
    /// Wrench sampled at this instant, body axes.
    pub wrench_body: Wrench<f64>,
}

/// Which samples are differenced, and where rates and wrench are taken.
///
/// Section 5.4 of the thesis does not say which one it uses; the ratio of its table 5.1 depends on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FiniteDifference {
    /// `(x_{k+1} - x_k) / h` with rate, attitude and wrench at k; inertial velocity is differenced. Order 1.
    Forward,
    /// As `Forward`, but the body components of velocity are differenced and `omega x v` is added. Order 1.
    ForwardBody,
    /// `(x_{k+1} - x_k) / h` with the mean of both samples' rates and wrenches and the mean of both accelerations seen in
    /// either attitude. Order 2.
    Midpoint,
    /// `(x_{k+1} - x_{k-1}) / 2h` with everything else at k. Order 2.
    Central,
    /// `(x_{k-2} - 8 x_{k-1} + 8 x_{k+1} - x_{k+2}) / 12h` with everything else at k. Order 4.
    FivePoint,
}

impl FiniteDifference {
    /// Samples one row needs.
    pub const fn samples(self) -> usize {
        match self {
            Self::Forward | Self::ForwardBody | Self::Midpoint => 2,
            Self::Central => 3,
            Self::FivePoint => 5,
        }
    }

    /// The Newton-Euler regressor and the wrench it belongs to; `None` unless `window` has as many samples as
    /// [`samples`](Self::samples) says.
    pub fn regressor(self, window: &[StateSample], step_s: f64) -> Option<(Regressor<f64>, Wrench<f64>)> {
        let at = |sample: &StateSample, rate_derivative: Vector3<f64>, acceleration_world: Vector3<f64>| {
            let acceleration = sample.world_from_body.rotation.inverse_transform_vector(&acceleration_world);
            (newton_euler(&sample.rate_body, &rate_derivative, &acceleration), sample.wrench_body)
        };
        let (rate, velocity) = (|s: &StateSample| s.rate_body, |s: &StateSample| s.velocity_origin_world);
        match (self, window) {
            (Self::Forward, [a, b]) => Some(at(a, (rate(b) - rate(a)) / step_s, (velocity(b) - velocity(a)) / step_s)),
            (Self::ForwardBody, [a, b]) => {
                let body = |s: &StateSample| s.world_from_body.rotation.inverse_transform_vector(&velocity(s));
                let acceleration = (body(b) - body(a)) / step_s + rate(a).cross(&body(a));
                Some((newton_euler(&rate(a), &((rate(b) - rate(a)) / step_s), &acceleration), a.wrench_body))
            }
            (Self::Midpoint, [a, b]) => {
                let acceleration_world = (velocity(b) - velocity(a)) / step_s;
                let seen_from =
                    |s: &StateSample| s.world_from_body.rotation.inverse_transform_vector(&acceleration_world);
                let regressor = newton_euler(
                    &((rate(a) + rate(b)) * 0.5),
                    &((rate(b) - rate(a)) / step_s),
                    &((seen_from(a) + seen_from(b)) * 0.5),
                );
                Some((regressor, (a.wrench_body + b.wrench_body) * 0.5))
            }
            (Self::Central, [a, k, b]) => {
                let span = 2.0 * step_s;
                Some(at(k, (rate(b) - rate(a)) / span, (velocity(b) - velocity(a)) / span))
            }
            (Self::FivePoint, [a, b, k, c, d]) => {
                let span = 12.0 * step_s;
                let difference = |x: &dyn Fn(&StateSample) -> Vector3<f64>| (x(a) - x(d) + (x(c) - x(b)) * 8.0) / span;
                Some(at(k, difference(&rate), difference(&velocity)))
            }
            _ => None,
        }
    }
}
