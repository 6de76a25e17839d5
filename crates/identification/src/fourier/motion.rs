//! A motion of a rigid body whose position and attitude are Fourier series.

use super::attitude::{Attitude, AttitudeChart, RateMap};
use super::basis::FourierBasis;
use crate::dynamics::{BodyAcceleration, PoseReference, RigidBodyState};
use crate::error::IdentificationError;
use crate::lie::{Pose, Twist, skew};
use crate::regressors::{Regressor, newton_euler};
use nalgebra::{DMatrix, DVector, SMatrix, SVector, Translation3, Vector3, Vector4};

/// Channels of a motion at most: three of position, four of attitude.
const CHANNELS: usize = 7;
/// Components of a motion that a body's wrench and energy depend on: angular velocity, angular acceleration, acceleration
/// and velocity of the origin, all in body axes.
pub const MOTION_TERMS: usize = 12;

/// A periodic motion: one Fourier series for each coordinate of position and attitude.
///
/// # Frame
/// Of the pose at time zero of the coordinates' own frame: position of the body origin in its axes, attitude in a chart.
/// # Units
/// m, and rad or the components of a quaternion; the coefficients beyond the first per second.
/// # Source
/// Thesis (4.7), (4.13).
#[derive(Clone, Debug, PartialEq)]
pub struct FourierMotion {
    basis: FourierBasis,
    chart: AttitudeChart,
    coefficients: DMatrix<f64>,
}

impl FourierMotion {
    /// From coefficients with one row per basis function (`[a0, a_1 .. a_n, b_1 .. b_n]`) and the columns `x, y, z`, then
    /// `roll, pitch, yaw` or `q_x, q_y, q_z, q_w`.
    ///
    /// # Errors
    /// [`IdentificationError::CoefficientShape`]; [`IdentificationError::NotFinite`] naming the row.
    pub fn try_new(
        basis: FourierBasis,
        chart: AttitudeChart,
        coefficients: DMatrix<f64>,
    ) -> Result<Self, IdentificationError> {
        let expected = (basis.coefficients(), 3 + chart.channels());
        if coefficients.shape() != expected {
            return Err(IdentificationError::CoefficientShape {
                rows: coefficients.nrows(),
                columns: coefficients.ncols(),
                expected_rows: expected.0,
                expected_columns: expected.1,
            });
        }
        match coefficients.row_iter().position(|row| !row.iter().all(|c| c.is_finite())) {
            Some(row) => Err(IdentificationError::NotFinite { row }),
            None => Ok(Self { basis, chart, coefficients }),
        }
    }

    /// Period and harmonics.
    pub fn basis(&self) -> &FourierBasis {
        &self.basis
    }

    /// Coordinates of the attitude.
    pub fn chart(&self) -> AttitudeChart {
        self.chart
    }

    /// One row per basis function, one column per channel, as [`try_new`](Self::try_new) takes them.
    pub fn coefficients(&self) -> &DMatrix<f64> {
        &self.coefficients
    }

    /// The same motion as a series of so many harmonics, those beyond its own zero; never fewer than it has.
    pub fn extended_to(&self, harmonics: usize) -> Self {
        let (own, basis) = (self.basis.harmonics(), self.basis.extended_to(harmonics));
        let mut coefficients = DMatrix::zeros(basis.coefficients(), self.coefficients.ncols());
        coefficients.rows_mut(0, own + 1).copy_from(&self.coefficients.rows(0, own + 1));
        coefficients.rows_mut(basis.harmonics() + 1, own).copy_from(&self.coefficients.rows(own + 1, own));
        Self { basis, coefficients, ..*self }
    }

    /// The motion at a time, s; `None` where the quaternion passes through zero.
    pub fn at(&self, time_s: f64) -> Option<MotionInstant> {
        let [value, rate, acceleration] =
            self.basis.at(time_s).map(|functions| self.coefficients.tr_mul(&DVector::from_vec(functions)));
        MotionInstant::from_channels(self.chart, value.as_slice(), rate.as_slice(), acceleration.as_slice())
    }
}

/// A motion at one instant.
#[derive(Clone, Copy, Debug)]
pub struct MotionInstant {
    /// Pose in the frame of the motion's coordinates.
    pub world_from_body: Pose<f64>,
    /// Velocity of the body origin, axes of the coordinates.
    pub velocity_origin_world: Vector3<f64>,
    /// Acceleration of the body origin, axes of the coordinates.
    pub acceleration_origin_world: Vector3<f64>,
    /// Angular velocity, body axes.
    pub angular_velocity_body: Vector3<f64>,
    /// Its derivative, body axes.
    pub angular_acceleration_body: Vector3<f64>,
    map: [RateMap; 3],
}

impl MotionInstant {
    /// From channels `[x, y, z, attitude ..]` and their first two derivatives by time; `None` at the quaternion zero.
    /// Channels that are missing count as zero.
    pub fn from_channels(chart: AttitudeChart, value: &[f64], rate: &[f64], acceleration: &[f64]) -> Option<Self> {
        let channel = |channels: &[f64], index: usize| channels.get(index).copied().unwrap_or(0.0);
        let linear = |channels: &[f64]| Vector3::from_fn(|i, _| channel(channels, i));
        let angular = |channels: &[f64]| Vector4::from_fn(|i, _| channel(channels, 3 + i));
        let (angles, rates, accelerations) = (angular(value), angular(rate), angular(acceleration));
        let Attitude { world_from_body, map } = chart.attitude(&angles, &rates, &accelerations)?;
        Some(Self {
            world_from_body: Pose::from_parts(Translation3::from(linear(value)), world_from_body),
            velocity_origin_world: linear(rate),
            acceleration_origin_world: linear(acceleration),
            angular_velocity_body: map[0] * rates,
            angular_acceleration_body: map[0] * accelerations + map[1] * rates,
            map,
        })
    }

    /// Velocity of the body origin, body axes.
    pub fn velocity_origin_body(&self) -> Vector3<f64> {
        self.world_from_body.rotation.inverse_transform_vector(&self.velocity_origin_world)
    }

    /// Inertial acceleration of the body origin, body axes.
    pub fn acceleration_origin_body(&self) -> Vector3<f64> {
        self.world_from_body.rotation.inverse_transform_vector(&self.acceleration_origin_world)
    }

    /// Pose, twist and acceleration for a controller, in the frame in which the motion starts at `world_from_start`.
    pub fn reference(&self, world_from_start: &Pose<f64>) -> PoseReference {
        PoseReference {
            state: RigidBodyState {
                world_from_body: world_from_start * self.world_from_body,
                twist_body: Twist::new(self.angular_velocity_body, self.velocity_origin_body()),
            },
            acceleration: BodyAcceleration {
                angular_acceleration_body: self.angular_acceleration_body,
                acceleration_origin_body: self.acceleration_origin_body(),
            },
        }
    }

    /// The Newton-Euler regressor: wrench per inertial parameter.
    ///
    /// # Source
    /// Thesis (4.8).
    pub fn regressor(&self) -> Regressor<f64> {
        newton_euler(&self.angular_velocity_body, &self.angular_acceleration_body, &self.acceleration_origin_body())
    }

    /// Derivatives of the motion terms `[angular velocity; angular acceleration; acceleration of the origin; velocity of
    /// the origin]`, body axes, by the channels, by their rates and by their second derivatives.
    ///
    /// Of a chart with three coordinates the last column is zero.
    pub fn sensitivities(&self) -> [SMatrix<f64, MOTION_TERMS, CHANNELS>; 3] {
        let [map, first, second] = &self.map;
        let (w, turning) = (skew(&self.angular_velocity_body), skew(&self.angular_acceleration_body));
        let body_from_world = self.world_from_body.rotation.to_rotation_matrix().transpose();
        let zero = SMatrix::<f64, MOTION_TERMS, CHANNELS>::zeros();
        let [mut by_value, mut by_rate, mut by_acceleration] = [zero; 3];
        // A change of coordinates turns the body by map * change, and with it everything seen in body axes.
        by_value.fixed_view_mut::<3, 4>(0, 3).copy_from(&(first + w * map));
        by_value.fixed_view_mut::<3, 4>(3, 3).copy_from(&(second + turning * map + w * first));
        by_value.fixed_view_mut::<3, 4>(6, 3).copy_from(&(skew(&self.acceleration_origin_body()) * map));
        by_value.fixed_view_mut::<3, 4>(9, 3).copy_from(&(skew(&self.velocity_origin_body()) * map));
        by_rate.fixed_view_mut::<3, 4>(0, 3).copy_from(map);
        by_rate.fixed_view_mut::<3, 4>(3, 3).copy_from(&(first * 2.0 + w * map));
        by_rate.fixed_view_mut::<3, 3>(9, 0).copy_from(body_from_world.matrix());
        by_acceleration.fixed_view_mut::<3, 4>(3, 3).copy_from(map);
        by_acceleration.fixed_view_mut::<3, 3>(6, 0).copy_from(body_from_world.matrix());
        [by_value, by_rate, by_acceleration]
    }

    /// Derivatives by the channels, their rates and their second derivatives, from those by the angular velocity, the
    /// angular acceleration and the acceleration of the origin: [`sensitivities`](Self::sensitivities), transposed, times
    /// the latter, for a chart of three coordinates.
    pub(crate) fn pull_back(
        &self,
        by_rate: &Vector3<f64>,
        by_turning: &Vector3<f64>,
        by_a: &Vector3<f64>,
    ) -> [[f64; 6]; 3] {
        let [map, first, second] = &self.map;
        let turn = by_rate.cross(&self.angular_velocity_body)
            + by_turning.cross(&self.angular_acceleration_body)
            + by_a.cross(&self.acceleration_origin_body());
        let spin = by_turning.cross(&self.angular_velocity_body);
        let by_value = map.tr_mul(&turn) + first.tr_mul(&(by_rate + spin)) + second.tr_mul(by_turning);
        let by_first = map.tr_mul(&(by_rate + spin)) + first.tr_mul(by_turning) * 2.0;
        let by_second = map.tr_mul(by_turning);
        let by_linear = self.world_from_body.rotation.transform_vector(by_a);
        [
            [0.0, 0.0, 0.0, by_value.x, by_value.y, by_value.z],
            [0.0, 0.0, 0.0, by_first.x, by_first.y, by_first.z],
            [by_linear.x, by_linear.y, by_linear.z, by_second.x, by_second.y, by_second.z],
        ]
    }

    /// The motion terms that [`sensitivities`](Self::sensitivities) differentiates.
    pub fn terms(&self) -> SVector<f64, MOTION_TERMS> {
        let [w, turning] = [self.angular_velocity_body, self.angular_acceleration_body];
        let [a, v] = [self.acceleration_origin_body(), self.velocity_origin_body()];
        SVector::from_iterator([w, turning, a, v].iter().flat_map(|vector| [vector.x, vector.y, vector.z]))
    }
}

#[cfg(test)]
#[allow(clippy::unreadable_literal)]
mod tests {
    use super::*;
    use crate::lie::EulerZyx;

    fn assert_close(found: &Vector3<f64>, expected: [f64; 3], tolerance: f64) {
        assert!((found - Vector3::from(expected)).amax() < tolerance, "{found} {expected:?}");
    }

    /// Golden rates of the reference equations, section e.
    #[test]
    fn golden_kinematics() {
        let instant = MotionInstant::from_channels(
            AttitudeChart::EulerZyx,
            &[0.0, 0.0, 0.0, 0.3, -0.2, 0.5],
            &[0.0, 0.0, 0.0, 0.2, -0.1, 0.3],
            &[0.05, 0.1, -0.2, -0.1, 0.3, 0.15],
        )
        .unwrap();
        assert_close(&instant.angular_velocity_body, [0.25960079923852, -0.00864480562491, 0.31044002974139], 1e-13);
        let expected = [-0.0407976030455, 0.39037205027897, 0.04782302183485];
        assert_close(&instant.angular_acceleration_body, expected, 1e-13);
        let expected = [0.05025749544619, -0.0023787912685, -0.2235364075572];
        assert_close(&instant.acceleration_origin_body(), expected, 1e-13);
    }

    /// Channels that move quickly, at a time, with their exact derivatives.
    fn channels(chart: AttitudeChart, time_s: f64) -> [Vec<f64>; 3] {
        let count = 3 + chart.channels();
        let at = |order: i32| {
            let channel = |i: usize| {
                let (frequency, phase) = (0.7 + 0.31 * i as f64, 0.9 * i as f64);
                let (sine, cosine) = (frequency * time_s + phase).sin_cos();
                let shape = [0.4 * sine + 0.9, 0.4 * frequency * cosine, -0.4 * frequency * frequency * sine];
                shape[usize::try_from(order).unwrap()]
            };
            (0..count).map(channel).collect()
        };
        [at(0), at(1), at(2)]
    }

    fn instant(chart: AttitudeChart, [value, rate, acceleration]: &[Vec<f64>; 3]) -> MotionInstant {
        MotionInstant::from_channels(chart, value, rate, acceleration).unwrap()
    }

    #[test]
    fn rates_follow_from_the_attitude() {
        for chart in [AttitudeChart::EulerZyx, AttitudeChart::Quaternion] {
            let at = |time_s: f64| instant(chart, &channels(chart, time_s));
            let (time_s, step_s) = (1.3, 1e-4);
            let [before, now, after] = [time_s - step_s, time_s, time_s + step_s].map(at);
            let turn = before.world_from_body.rotation.rotation_to(&after.world_from_body.rotation);
            let turn = now.world_from_body.rotation.inverse_transform_vector(&turn.scaled_axis());
            assert!((turn / (2.0 * step_s) - now.angular_velocity_body).amax() < 1e-7);
            let change = (after.angular_velocity_body - before.angular_velocity_body) / (2.0 * step_s);
            assert!((change - now.angular_acceleration_body).amax() < 1e-7);
        }
    }

    /// Also for quaternions that are not of unit length.
    #[test]
    fn sensitivities_are_central_differences() {
        for chart in [AttitudeChart::EulerZyx, AttitudeChart::Quaternion] {
            let base = channels(chart, 0.4);
            let sensitivities = instant(chart, &base).sensitivities();
            for order in 0..3 {
                for channel in 0..3 + chart.channels() {
                    let moved = |by: f64| {
                        let mut channels = base.clone();
                        channels[order][channel] += by;
                        instant(chart, &channels).terms()
                    };
                    let expected = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                    let error = (sensitivities[order].column(channel) - expected).amax();
                    assert!(error < 1e-8, "{chart:?} order {order} channel {channel}: {error:e}");
                }
            }
        }
    }

    #[test]
    fn pull_back_is_the_transposed_sensitivities() {
        let instant = instant(AttitudeChart::EulerZyx, &channels(AttitudeChart::EulerZyx, 0.4));
        let by = SVector::<f64, MOTION_TERMS>::from_fn(|i, _| if i < 9 { 0.3 - 0.17 * i as f64 } else { 0.0 });
        let part = |i: usize| by.fixed_rows::<3>(i).into_owned();
        let found = instant.pull_back(&part(0), &part(3), &part(6));
        for (found, sensitivity) in found.iter().zip(instant.sensitivities()) {
            let expected = sensitivity.tr_mul(&by);
            for (channel, found) in found.iter().enumerate() {
                assert!((found - expected[channel]).abs() < 1e-14, "{found} {expected}");
            }
        }
    }

    #[test]
    fn both_charts_give_one_motion() {
        let at = |time_s: f64| {
            let angles = [0.3 * time_s.sin(), -0.2 * time_s.cos(), 0.4 * (2.0 * time_s).sin()];
            let rates = [0.3 * time_s.cos(), 0.2 * time_s.sin(), 0.8 * (2.0 * time_s).cos()];
            let accelerations = [-0.3 * time_s.sin(), 0.2 * time_s.cos(), -1.6 * (2.0 * time_s).sin()];
            let channels = |a: [f64; 3]| [0.0, 0.0, 0.0, a[0], a[1], a[2]];
            let (value, rate, acceleration) = (channels(angles), channels(rates), channels(accelerations));
            (MotionInstant::from_channels(AttitudeChart::EulerZyx, &value, &rate, &acceleration).unwrap(), angles)
        };
        let (time_s, step_s) = (0.6, 1e-3);
        let coordinates = |time_s: f64| {
            let (roll, pitch, yaw) = (at(time_s).1[0], at(time_s).1[1], at(time_s).1[2]);
            let rotation = EulerZyx::new(roll, pitch, yaw).to_rotation();
            AttitudeChart::Quaternion.coordinates(&rotation, &Vector4::w())
        };
        let [before, now, after] = [time_s - step_s, time_s, time_s + step_s].map(coordinates);
        let rate = (after - before) / (2.0 * step_s);
        let acceleration = (after - now * 2.0 + before) / (step_s * step_s);
        let pad = |q: Vector4<f64>| [0.0, 0.0, 0.0, q.x, q.y, q.z, q.w];
        let found =
            MotionInstant::from_channels(AttitudeChart::Quaternion, &pad(now), &pad(rate), &pad(acceleration)).unwrap();
        let expected = at(time_s).0;
        assert!((found.terms() - expected.terms()).amax() < 1e-6, "{} {}", found.terms(), expected.terms());
    }

    #[test]
    fn euler_angles_stay_continuous() {
        let near = Vector4::new(3.0, 0.1, -9.3, 0.0);
        let rotation = EulerZyx::new(3.2, 0.1, -9.5).to_rotation();
        let found = AttitudeChart::EulerZyx.coordinates(&rotation, &near);
        assert!((found - Vector4::new(3.2, 0.1, -9.5, 0.0)).amax() < 1e-12, "{found}");
    }

    #[test]
    fn bad_coefficients_are_refused() {
        let basis = FourierBasis::try_new(10.0, 2).unwrap();
        let wrong = FourierMotion::try_new(basis, AttitudeChart::EulerZyx, DMatrix::zeros(5, 7));
        assert!(matches!(wrong, Err(IdentificationError::CoefficientShape { expected_columns: 6, .. })));
        let mut broken = DMatrix::zeros(5, 6);
        broken[(3, 1)] = f64::NAN;
        let wrong = FourierMotion::try_new(basis, AttitudeChart::EulerZyx, broken);
        assert!(matches!(wrong, Err(IdentificationError::NotFinite { row: 3 })));
        let still = FourierMotion::try_new(basis, AttitudeChart::Quaternion, DMatrix::zeros(5, 7)).unwrap();
        assert!(still.at(0.0).is_none());
    }
}
