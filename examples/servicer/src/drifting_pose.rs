//! An estimator in flight without a pose: gyroscope and star tracker for the turn; for the rest one regression over the whole flight.
//!
//! A centre of mass that starts at `p` with `v` is at `p + v t + D / m` after a time `t`, where `D` is the force in world axes
//! integrated twice. The lidar sees the body origin, which lies beside it by `R c`. That is linear in `(p, v, 1/m, c)`: ten unknowns,
//! one row for each number of the lidar, and nothing drifts. Moments of inertia stay what they are believed to be.

use tumble_planning::ModelBelief;
use tumble_planning::dynamics::{InertialParameters, RigidBodyState};
use tumble_planning::identification::estimator::{Acted, EstimatorError, Finding, Measurement, StateEstimator};
use tumble_planning::identification::recursive::Reception;
use tumble_planning::identification::{BodyScale, Estimate, SquareRootInformation, StandardDeviations};
use tumble_planning::lie::{LieGroup, Pose, Twist};
use tumble_planning::nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};

/// See the [module](self).
pub struct DriftingPose {
    body: Estimate,
    scale: BodyScale,
    /// Of `(p, v, 1/m, c)`, and its solution; nothing of `p` and `v` before the first look.
    seen: SquareRootInformation<10>,
    found: SVector<f64, 10>,
    /// The force in world axes integrated twice and once, per newton: m kg and m kg / s.
    pushed: [Vector3<f64>; 2],
    attitude: UnitQuaternion<f64>,
    rate: Vector3<f64>,
    now_ns: i64,
    looked_ns: i64,
}

const SIZES: [f64; 10] = [1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 0.003, 0.1, 0.1, 0.1];

impl DriftingPose {
    /// At rest, believing this of the body.
    ///
    /// # Errors
    /// A body that is none.
    pub fn try_new(start: &RigidBodyState<f64>, body: Estimate) -> Result<Self, EstimatorError> {
        let (place, attitude) = (start.world_from_body.translation.vector, start.world_from_body.rotation);
        let (mass, center) = (body.parameters.mass, body.parameters.center_of_mass());
        let at = place + attitude * center;
        let mean = SVector::from([at.x, at.y, at.z, 0.0, 0.0, 0.0, 1.0 / mass, center.x, center.y, center.z]);
        let (light, beside) = (body.std.mass_kg / (mass * mass), body.std.center_of_mass_m);
        let sigma = [0.02, 0.02, 0.02, 1e-3, 1e-3, 1e-3, light, beside.x, beside.y, beside.z];
        let mut seen = SquareRootInformation::new();
        seen.add_prior(&mean, &SVector::from(sigma))?;
        let (scale, rate) = (BodyScale::of(&body.parameters.to_vector())?, Vector3::zeros());
        let pushed = [Vector3::zeros(); 2];
        Ok(Self { body, scale, seen, found: mean, pushed, attitude, rate, now_ns: 0, looked_ns: 0 })
    }

    /// Rows of the position: what multiplies the unknowns.
    fn rows(&self) -> SMatrix<f64, 3, 10> {
        let mut rows = SMatrix::<f64, 3, 10>::zeros();
        rows.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        rows.fixed_view_mut::<3, 3>(0, 3).fill_diagonal(self.now_ns as f64 * 1e-9);
        rows.fixed_view_mut::<3, 1>(0, 6).copy_from(&self.pushed[0]);
        rows.fixed_view_mut::<3, 3>(0, 7).copy_from(&-self.attitude.to_rotation_matrix().matrix());
        rows
    }
}

impl StateEstimator for DriftingPose {
    fn acted(&mut self, acted: &Acted) {
        let span_s = (acted.until_ns - acted.from_ns) as f64 * 1e-9;
        let half = self.attitude * <UnitQuaternion<f64> as LieGroup>::exp(&(self.rate * (0.5 * span_s)));
        let force = half * acted.wrench_body.force;
        self.pushed[0] += self.pushed[1] * span_s + force * (0.5 * span_s * span_s);
        self.pushed[1] += force * span_s;
        self.attitude *= <UnitQuaternion<f64> as LieGroup>::exp(&(self.rate * span_s));
        self.now_ns = acted.until_ns;
    }
    fn measured(&mut self, measurement: &Measurement) -> Reception {
        if measurement.stamp_ns != self.now_ns {
            return Reception::TooOld; // its sensors are not late
        }
        self.looked_ns = self.now_ns;
        if let Some(gyro) = &measurement.rate_body {
            self.rate = gyro.value;
        }
        if let Some(stars) = &measurement.attitude {
            let away: Vector3<f64> = LieGroup::log(&(self.attitude.inverse() * stars.value));
            self.attitude *= <UnitQuaternion<f64> as LieGroup>::exp(&(away * 0.2));
        }
        let Some(lidar) = &measurement.position_world else { return Reception::Used { nis: 1.0 } };
        let (rows, sigma) = (self.rows(), lidar.covariance.trace().sqrt() / 3.0_f64.sqrt());
        let nis = (lidar.value - rows * self.found).norm_squared() / (sigma * sigma);
        match self.seen.update(&(rows / sigma), &(lidar.value / sigma)).and_then(|()| self.seen.solve(&SIZES.into())) {
            Ok(found) => self.found = found,
            Err(_) => return Reception::Malformed { what: "no position" },
        }
        Reception::Used { nis }
    }
    fn state_at(&self, time_ns: i64) -> RigidBodyState<f64> {
        let ahead_s = (time_ns - self.now_ns) as f64 * 1e-9;
        let rotation = self.attitude * <UnitQuaternion<f64> as LieGroup>::exp(&(self.rate * ahead_s));
        let [center, velocity] =
            [self.found.fixed_rows::<3>(7).into_owned(), self.found.fixed_rows::<3>(3).into_owned()];
        let velocity = velocity + self.pushed[1] * self.found[6] - rotation * self.rate.cross(&center);
        let place = self.rows() * self.found + velocity * ahead_s;
        let twist_body = Twist::new(self.rate, rotation.inverse() * velocity);
        RigidBodyState { world_from_body: Pose::from_parts(place.into(), rotation), twist_body }
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        let (x, spread) = (&self.found, self.seen.covariance(&SIZES.into())?);
        let inertia = self.body.parameters.inertia_about_com();
        let body = InertialParameters::about_com(1.0 / x[6], Vector3::new(x[7], x[8], x[9]), inertia);
        let std = StandardDeviations {
            mass_kg: spread[(6, 6)].sqrt() / (x[6] * x[6]),
            center_of_mass_m: Vector3::from_fn(|i, _| spread[(7 + i, 7 + i)].sqrt()),
            ..self.body.std
        };
        ModelBelief::independent(0, body, std).estimate.to_finding(self.scale)
    }
    fn newest_stamp_ns(&self) -> i64 {
        self.looked_ns
    }
    fn restart(&mut self, body: &Finding) -> Result<(), EstimatorError> {
        self.body = Estimate::try_from(body)?;
        Ok(())
    }
}
