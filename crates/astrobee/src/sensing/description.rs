//! What the settings of the simulated sensors say to an estimator.

use super::flight_filter::{accelerometer_coefficients, gyro_coefficients};
use super::imu::average_of_taps;
use super::{ImuSettings, LocalizationSettings, SensorErrors};
use crate::propulsion::ImpellerMode;
use tumble_dynamics::nalgebra::Vector3;
use tumble_identification::IdentificationError;
use tumble_identification::sensing::{
    Delay, InertialErrors, Level, LinearFilter, LocalizationErrors, LocalizationLimits, Sensing, Wander,
};

/// Biases after the flight software has removed what it believes: rad/s and m/s^2.
const BIAS_SIGMA: [f64; 2] = [0.02, 0.05];

/// How well the age of late poses is known, s.
const POSE_DELAY_SIGMA_S: f64 = 0.003;

impl LocalizationSettings {
    /// These sensors as an estimator is told of them: filters, lever arm, errors of scale as they are; levels and biases left to the record,
    /// which may not be from sensors with just these. Stamps are taken to be right: hidden latency is for an estimator to find.
    ///
    /// # Errors
    /// [`IdentificationError::ImpossibleSensing`] for settings that [`check`](Self::check) refuses too.
    pub fn description(&self, mode: ImpellerMode) -> Result<Sensing, IdentificationError> {
        let pose = &self.pose;
        let localized = |slow: f64| LocalizationErrors {
            white: Level::Unknown,
            wander: if slow > 0.0 { Wander::About { sigma: slow, time_s: pose.drift_time_s } } else { Wander::Unknown },
        };
        let gyro = published(&self.imu, gyro_coefficients(mode))?;
        let accelerometer = published(&self.imu, accelerometer_coefficients(mode))?;
        // Of the density per root hertz the part below half the rate of the log, and the noise that is no more than a share of it beside.
        let level = |errors: &SensorErrors, filter: Option<&LinearFilter>| {
            let interval_s = 1e-3 * f64::from(self.timing.publish_interval_ms);
            let white = errors.noise_density * (0.5 / interval_s).sqrt();
            if white > 0.0 && filter.is_some() { Level::About(white) } else { Level::Unknown }
        };
        let triad = |errors: &SensorErrors, filter: Option<LinearFilter>, bias_sigma: f64| InertialErrors {
            white: level(errors, filter.as_ref()),
            filter,
            unknown_filter_s: 0.0,
            scale_sigma: errors.scale_sigma,
            misalignment_sigma: errors.misalignment_sigma_rad,
            bias_sigma,
            delay: Delay::NONE,
        };
        let late = 1e-3 * self.timing.pose_latency_ms;
        let pose_delay = if late > 0.0 { Delay { expected_s: late, sigma_s: POSE_DELAY_SIGMA_S } } else { Delay::NONE };
        let sensing = Sensing {
            position: localized(pose.position_drift_m),
            attitude: localized(pose.attitude_drift_rad),
            velocity: localized(pose.velocity_drift_m_s),
            pose_delay,
            velocity_delay: Some(pose_delay),
            rate: triad(&self.imu.gyro, gyro, BIAS_SIGMA[0]),
            acceleration: triad(&self.imu.accelerometer, accelerometer, BIAS_SIGMA[1]),
            lever_arm_body_m: self.imu.lever_arm_body_m,
            lever_arm_sigma_m: 0.0,
            lever_arm_taken_out_sigma_m: 0.0,
            gravity_added_world_m_s2: Some(self.gravity_world_m_s2),
            doubted_scale_sigma: 1.0,
            localization_limits: self.limits(),
        };
        sensing.check()?;
        Ok(sensing)
    }
}

impl LocalizationSettings {
    /// What the localisation survives; none where nothing jumps.
    fn limits(&self) -> Option<LocalizationLimits> {
        let jumps = &self.faults.random_jumps;
        let has_limit = jumps.rate_threshold_rad_s.is_finite() || jumps.acceleration_threshold_m_s2.is_finite();
        (jumps.rate_hz > 0.0 && has_limit).then_some(LocalizationLimits {
            rate_rad_s: jumps.rate_threshold_rad_s,
            acceleration_m_s2: jumps.acceleration_threshold_m_s2,
            jumps_hz: jumps.rate_hz,
            jump_position_m: jumps.position_m,
            jump_attitude_rad: jumps.attitude_rad,
            jump_rate_rad_s: jumps.rate_rad_s,
        })
    }
}

impl LocalizationSettings {
    /// These sensors as a robot in flight is told of them, which knows its own: as [`description`](Self::description), with levels, wander and
    /// bias as they are set. Levels that are zero are left open.
    ///
    /// # Errors
    /// As [`description`](Self::description).
    pub fn as_stated(&self, mode: ImpellerMode) -> Result<Sensing, IdentificationError> {
        let (pose, imu) = (&self.pose, &self.imu);
        let known = |sigma: f64| if sigma > 0.0 { Level::Known(sigma) } else { Level::Unknown };
        let localized = |white: f64, slow: f64| LocalizationErrors {
            white: known(white),
            wander: Wander::Known { sigma: slow, time_s: pose.drift_time_s },
        };
        let described = self.description(mode)?;
        let is_removed_at_once = imu.bias_removed && imu.bias_following_time_s == 0.0;
        // What stands still, gravity, is seen along all axes of a unit that is out of true.
        let gravity_m_s2 = Vector3::from(self.gravity_world_m_s2).norm();
        let triad = |described: InertialErrors, errors: &SensorErrors, still: f64| {
            // Without a filter a published sample has all of the unit's noise.
            let interval_s = if described.filter.is_some() { self.timing.step_s() } else { imu.step_s() };
            let switched_on = if is_removed_at_once { 0.0 } else { errors.bias_sigma };
            InertialErrors {
                white: known(errors.noise_density * (0.5 / interval_s).sqrt()),
                bias_sigma: switched_on.hypot(still * errors.misalignment_sigma_rad),
                ..described
            }
        };
        Ok(Sensing {
            position: localized(pose.position_noise_m, pose.position_drift_m),
            attitude: localized(pose.attitude_noise_rad, pose.attitude_drift_rad),
            velocity: localized(pose.velocity_noise_m_s, pose.velocity_drift_m_s),
            rate: triad(described.rate, &imu.gyro, 0.0),
            acceleration: triad(described.acceleration, &imu.accelerometer, gravity_m_s2),
            ..described
        })
    }
}

/// Average of the unit and filter of the flight software, one after the other.
pub(super) fn published(
    imu: &ImuSettings,
    coefficients: Option<(Vec<f64>, Vec<f64>)>,
) -> Result<Option<LinearFilter>, IdentificationError> {
    let step_s = imu.step_s();
    let average =
        imu.moving_average.then(|| LinearFilter::try_new(&average_of_taps(step_s), &[1.0], step_s)).transpose()?;
    let flight = coefficients
        .filter(|_| imu.flight_filter)
        .map(|(numerator, denominator)| LinearFilter::try_new(&numerator, &denominator, step_s))
        .transpose()?;
    match (average, flight) {
        (Some(average), Some(flight)) => Ok(Some(average.then(&flight)?)),
        (average, flight) => Ok(average.or(flight)),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ImuBias, ImuChain, ImuModel, SensingPreset, TrueMotion};
    use super::*;
    use tumble_dynamics::RigidBodyState;
    use tumble_lie::Twist;

    /// The described filters give what the simulated unit and the flight software give of the same motion.
    #[test]
    fn described_filters_are_those_of_the_simulated_unit() {
        let mut settings = SensingPreset::Nominal.settings();
        for errors in [&mut settings.imu.gyro, &mut settings.imu.accelerometer] {
            *errors = SensorErrors::none();
        }
        settings.imu.lever_arm_body_m = [0.0; 3];
        for mode in [ImpellerMode::Quiet, ImpellerMode::Nominal, ImpellerMode::Aggressive] {
            let sensing = settings.description(mode).unwrap();
            let mut model = ImuModel::new(&settings.imu, Vector3::zeros(), 1);
            let mut chain = ImuChain::new(&settings.imu, Vector3::zeros(), mode);
            let none = ImuBias { accelerometer: Vector3::zeros(), gyro: Vector3::zeros() };
            let wave = |k: i64, f: f64| (f * k as f64).sin() + (2.7 * f * k as f64).cos();
            let (mut rates, mut forces, mut found) = (Vec::new(), Vec::new(), Vec::new());
            for k in 0..600 {
                let (rate, force) = (Vector3::new(wave(k, 0.05), 0.0, 0.0), Vector3::new(0.0, wave(k, 0.031), 0.0));
                let mut state = RigidBodyState::at_rest();
                state.twist_body = Twist { angular: rate, linear: Vector3::zeros() };
                let truth = TrueMotion {
                    time_ns: 8_000_000 * k,
                    state,
                    acceleration_origin_body: force,
                    angular_acceleration_body: Vector3::zeros(),
                };
                let filtered = chain.update(&model.measure(&truth), &none);
                found.push((filtered.rate_body.x, filtered.specific_force_body.y));
                rates.push(rate.x);
                forces.push(force.y);
            }
            let (gyro, accelerometer) = (sensing.rate.filter.unwrap(), sensing.acceleration.filter.unwrap());
            let (rates, forces) = (gyro.filtered(&rates), accelerometer.filtered(&forces));
            for (k, (rate, force)) in found.iter().enumerate() {
                // The flown coefficients have a gain at rest that differs from one in the ninth digit.
                assert!((rate - rates[k]).abs() < 1e-7 && (force - forces[k]).abs() < 1e-7, "{mode:?} {k}");
            }
        }
    }

    #[test]
    fn delays_are_those_of_the_design() {
        // Group delays of the flight software's own coefficients behind its average of 64 samples, computed apart from this code.
        for mode in [ImpellerMode::Nominal, ImpellerMode::Aggressive] {
            let sensing = SensingPreset::Nominal.settings().description(mode).unwrap();
            let delay = |filter: &Option<LinearFilter>| filter.as_ref().unwrap().delay_samples();
            assert!((delay(&sensing.rate.filter) - 9.5876).abs() < 1e-4);
            assert!((delay(&sensing.acceleration.filter) - 16.2065).abs() < 1e-4);
        }
        let perfect = SensingPreset::Perfect.settings().description(ImpellerMode::Nominal).unwrap();
        assert!(perfect.rate.filter.is_none() && perfect.acceleration.filter.is_none());
    }
}
