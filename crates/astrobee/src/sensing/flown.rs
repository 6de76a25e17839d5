//! Sensors as an estimator is told of them, turned into settings that the simulator flies.

use super::description::published;
use super::flight_filter::{accelerometer_coefficients, gyro_coefficients};
use super::{ImuSettings, JumpSettings, LocalizationSettings, SensorErrors};
use crate::AstrobeeError;
use crate::propulsion::ImpellerMode;
use tumble_identification::sensing::{
    Delay, InertialErrors, LinearFilter, LocalizationErrors, LocalizationLimits, Sensing,
};

/// Times, in seconds, and answers of filters that differ by less are the same.
const SAME: f64 = 1e-9;
/// Samples of the answer to an impulse by which filters are compared: what is left of it then is below a thousandth.
const ANSWER: usize = 300;
/// How much older poses may be, s.
const LONGEST_DELAY_S: f64 = 1.0;
/// Keys of settings and of the file they come from.
const KEYS: [(&str, &str); 20] = [
    ("faults.random_jumps.rate_hz", "localization_limits.jumps_hz"),
    ("faults.random_jumps.rate_threshold_rad_s", "localization_limits.rate_rad_s"),
    ("faults.random_jumps.acceleration_threshold_m_s2", "localization_limits.acceleration_m_s2"),
    ("faults.random_jumps.position_m", "localization_limits.jump_position_m"),
    ("faults.random_jumps.attitude_rad", "localization_limits.jump_attitude_rad"),
    ("faults.random_jumps.rate_rad_s", "localization_limits.jump_rate_rad_s"),
    ("imu.lever_arm_body_m", "lever_arm_body_m"),
    ("imu.gyro.scale_sigma", "rate.scale_sigma"),
    ("imu.gyro.misalignment_sigma_rad", "rate.misalignment_sigma"),
    ("imu.gyro.bias_sigma", "rate.bias_sigma"),
    ("imu.accelerometer.scale_sigma", "acceleration.scale_sigma"),
    ("imu.accelerometer.misalignment_sigma_rad", "acceleration.misalignment_sigma"),
    ("imu.accelerometer.bias_sigma", "acceleration.bias_sigma"),
    ("pose.position_noise_m", "position.white"),
    ("pose.attitude_noise_rad", "attitude.white"),
    ("pose.velocity_noise_m_s", "velocity.white"),
    ("pose.position_drift_m", "position.wander.sigma"),
    ("pose.attitude_drift_rad", "attitude.wander.sigma"),
    ("pose.velocity_drift_m_s", "velocity.wander.sigma"),
    ("pose.drift_time_s", "wander.time_s"),
];

/// Sensors with these errors. Levels that are unknown, and what an estimator is told nothing of (latency, losses, jumps), are those of
/// [`LocalizationSettings::nominal`]; delays and the lever arm are as expected. Gravity is the one that the publisher adds.
///
/// # Errors
/// [`AstrobeeError::SensingNotFlown`] and [`AstrobeeError::SensingOutOfRange`] naming the key.
///
/// # Example
/// ```
/// use tumble_astrobee::propulsion::ImpellerMode;
/// use tumble_astrobee::sensing::{LocalizationSettings, SensingPreset};
///
/// let described = SensingPreset::Bumble.settings().description(ImpellerMode::Nominal)?;
/// assert_eq!(LocalizationSettings::try_from(&described)?.timing.pose_latency_ms, 62.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
impl TryFrom<&Sensing> for LocalizationSettings {
    type Error = AstrobeeError;

    fn try_from(sensing: &Sensing) -> Result<Self, AstrobeeError> {
        let mut settings = Self::nominal();
        let publish_s = settings.timing.step_s();
        let Self { imu, pose, timing, .. } = &mut settings;
        find_filters(imu, sensing)?;
        imu.bias_removed = false;
        imu.lever_arm_body_m = sensing.lever_arm_body_m;
        for (errors, told) in [(&mut imu.gyro, &sensing.rate), (&mut imu.accelerometer, &sensing.acceleration)] {
            // The level is that of a published sample; a filter leaves of all samples the slow part.
            let interval_s = if told.filter.is_some() { publish_s } else { 1e-3 * f64::from(imu.sample_interval_ms) };
            *errors = triad(errors, told, interval_s);
        }
        let time_s = wander_time_s(sensing)?.unwrap_or(pose.drift_time_s);
        pose.drift_time_s = time_s;
        for (white, drift, told) in [
            (&mut pose.position_noise_m, &mut pose.position_drift_m, &sensing.position),
            (&mut pose.attitude_noise_rad, &mut pose.attitude_drift_rad, &sensing.attitude),
            (&mut pose.velocity_noise_m_s, &mut pose.velocity_drift_m_s, &sensing.velocity),
        ] {
            *white = told.white.or(*white);
            *drift = told.wander.or(*drift, time_s).0;
        }
        (timing.hidden_latency_ms, timing.pose_latency_ms) = ages_ms(sensing, imu.sample_interval_ms)?;
        if let Some(limits) = &sensing.localization_limits {
            settings.faults.random_jumps = jumps(limits);
        }
        settings.gravity_world_m_s2 = sensing.gravity_added_world_m_s2.unwrap_or_default();
        settings.check().map_err(as_in_the_file)?;
        Ok(settings)
    }
}

/// Time that a jump shows in full and time of its return, s: of the flights that the thesis shows.
const JUMP_S: (f64, f64) = (0.2, 0.5);

fn jumps(limits: &LocalizationLimits) -> JumpSettings {
    JumpSettings {
        rate_hz: limits.jumps_hz,
        rate_threshold_rad_s: limits.rate_rad_s,
        acceleration_threshold_m_s2: limits.acceleration_m_s2,
        position_m: limits.jump_position_m,
        attitude_rad: limits.jump_attitude_rad,
        rate_rad_s: limits.jump_rate_rad_s,
        duration_s: JUMP_S.0,
        recovery_s: JUMP_S.1,
    }
}

fn not_flown(key: &'static str, accepted: &'static str) -> AstrobeeError {
    AstrobeeError::SensingNotFlown { key, accepted }
}

/// The same with the key of the file.
fn as_in_the_file(error: AstrobeeError) -> AstrobeeError {
    match error {
        AstrobeeError::SensingOutOfRange { key, value, lowest, highest, rule } => {
            let key = KEYS.iter().find(|(of_settings, _)| *of_settings == key).map_or(key, |(_, of_file)| of_file);
            AstrobeeError::SensingOutOfRange { key, value, lowest, highest, rule }
        }
        other => other,
    }
}

/// Sets interval and filters to those of a unit that answers as the file says, in whatever mode of the impellers.
fn find_filters(imu: &mut ImuSettings, sensing: &Sensing) -> Result<(), AstrobeeError> {
    for sample_interval_ms in [8, 16] {
        for (moving_average, flight_filter) in [(true, true), (false, false), (true, false), (false, true)] {
            (imu.sample_interval_ms, imu.moving_average, imu.flight_filter) =
                (sample_interval_ms, moving_average, flight_filter);
            if ImpellerMode::ALL.into_iter().any(|mode| answers_alike(imu, mode, sensing)) {
                return Ok(());
            }
        }
    }
    Err(not_flown(
        "rate.filter` and `acceleration.filter",
        "either both stand as `tumble sensing show nominal` (8 ms) or `bumble` (16 ms) prints them, or both are left out",
    ))
}

/// Whether both triads of a unit answer as the file says.
fn answers_alike(imu: &ImuSettings, mode: ImpellerMode, sensing: &Sensing) -> bool {
    let (rate, acceleration) =
        (published(imu, gyro_coefficients(mode)), published(imu, accelerometer_coefficients(mode)));
    let alike = |made: Option<LinearFilter>, told: &Option<LinearFilter>| match (made, told) {
        (None, None) => true,
        (Some(made), Some(told)) => is_same(&made, told),
        _ => false,
    };
    rate.is_ok_and(|made| alike(made, &sensing.rate.filter))
        && acceleration.is_ok_and(|made| alike(made, &sensing.acceleration.filter))
}

/// Whether two filters answer alike to an impulse.
fn is_same(made: &LinearFilter, told: &LinearFilter) -> bool {
    let mut impulse = [0.0; ANSWER];
    impulse[1] = 1.0;
    let [made_answer, told_answer] = [made, told].map(|filter| filter.filtered(&impulse));
    let alike = |(a, b): (&f64, &f64)| (a - b).abs() < SAME;
    (made.step_s() - told.step_s()).abs() < SAME && made_answer.iter().zip(&told_answer).all(alike)
}

/// Errors of three sensing axes: those that the file knows of, no other.
fn triad(nominal: &SensorErrors, told: &InertialErrors, interval_s: f64) -> SensorErrors {
    let per_density = libm::sqrt(0.5 / interval_s);
    SensorErrors {
        scale_sigma: told.scale_sigma,
        misalignment_sigma_rad: told.misalignment_sigma,
        bias_sigma: told.bias_sigma,
        noise_density: told.white.or(nominal.noise_density * per_density) / per_density,
        ..SensorErrors::none()
    }
}

/// The one time of all slow errors that there are, s; none where none is stated.
fn wander_time_s(sensing: &Sensing) -> Result<Option<f64>, AstrobeeError> {
    let stated = |errors: &LocalizationErrors| {
        let (sigma, time_s) = errors.wander.or(0.0, 0.0);
        (sigma > 0.0).then_some(time_s)
    };
    let times_s = [&sensing.position, &sensing.attitude, &sensing.velocity].map(stated);
    let first_s = times_s.into_iter().flatten().next();
    let differs = |time_s: f64| first_s.is_some_and(|first_s| (time_s - first_s).abs() > SAME * first_s);
    if times_s.into_iter().flatten().any(differs) {
        return Err(not_flown("wander.time_s", "one time for `position`, `attitude` and `velocity`"));
    }
    Ok(first_s)
}

/// Age of all content in whole samples, ms, and by how much poses and velocities are older, ms.
fn ages_ms(sensing: &Sensing, sample_interval_ms: u32) -> Result<(u32, f64), AstrobeeError> {
    let inertial_s = sensing.rate.delay.expected_s;
    if (sensing.acceleration.delay.expected_s - inertial_s).abs() > SAME {
        return Err(not_flown("acceleration.delay.expected_s", "the `rate.delay.expected_s`"));
    }
    let is_that = |ms: &u32| ms.is_multiple_of(sample_interval_ms) && (1e-3 * f64::from(*ms) - inertial_s).abs() < SAME;
    let hidden_latency_ms = (0..=1000).find(is_that).ok_or_else(|| {
        not_flown("rate.delay.expected_s", "0 to 1 s in whole samples of the unit (8 ms, of `bumble` 16 ms)")
    })?;
    let poses_s = sensing.pose_delay.expected_s;
    let stated = sensing.velocity_delay.filter(|delay| *delay != Delay::default());
    if stated.is_some_and(|delay| (delay.expected_s - poses_s).abs() > SAME) {
        return Err(not_flown("velocity_delay.expected_s", "the `pose_delay.expected_s`, or no `velocity_delay`"));
    }
    if !(-SAME..=LONGEST_DELAY_S).contains(&(poses_s - inertial_s)) {
        return Err(not_flown("pose_delay.expected_s", "from the `rate.delay.expected_s` to 1 s more"));
    }
    Ok((hidden_latency_ms, (libm::round((poses_s - inertial_s) * 1e9) / 1e6).max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::super::SensingPreset;
    use super::*;
    use tumble_identification::sensing::{Level, Wander};

    fn described(preset: SensingPreset) -> Sensing {
        preset.settings().description(ImpellerMode::Nominal).unwrap()
    }

    #[test]
    fn described_presets_come_back() {
        for preset in [SensingPreset::Nominal, SensingPreset::Bumble] {
            let (flown, preset) = (LocalizationSettings::try_from(&described(preset)).unwrap(), preset.settings());
            let LocalizationSettings { imu, pose, timing, .. } = &flown;
            let nominal = LocalizationSettings::nominal().pose;
            assert_eq!((timing, &pose.position_drift_m), (&preset.timing, &preset.pose.position_drift_m));
            assert_eq!(
                (pose.drift_time_s, pose.attitude_noise_rad),
                (preset.pose.drift_time_s, nominal.attitude_noise_rad)
            );
            assert_eq!(
                (imu.sample_interval_ms, imu.lever_arm_body_m),
                (preset.imu.sample_interval_ms, preset.imu.lever_arm_body_m)
            );
            assert!(imu.moving_average && imu.flight_filter && !imu.bias_removed);
            for (flown, preset) in [(imu.gyro, preset.imu.gyro), (imu.accelerometer, preset.imu.accelerometer)] {
                assert!((flown.noise_density / preset.noise_density - 1.0).abs() < 1e-12);
                assert_eq!(
                    (flown.scale_sigma, flown.misalignment_sigma_rad),
                    (preset.scale_sigma, preset.misalignment_sigma_rad)
                );
                assert!(flown.bias_sigma > 0.0 && flown.resolution == 0.0);
            }
        }
    }

    #[test]
    fn what_the_localisation_survives_comes_back() {
        let thesis = described(SensingPreset::ThesisFlight);
        let limits = thesis.localization_limits.unwrap();
        assert_eq!((limits.rate_rad_s, limits.acceleration_m_s2, limits.jumps_hz), (0.15, 0.03, 0.2));
        let flown = LocalizationSettings::try_from(&thesis).unwrap();
        assert_eq!(flown.faults.random_jumps, SensingPreset::ThesisFlight.settings().faults.random_jumps);
        assert_eq!(described(SensingPreset::Nominal).localization_limits, None);
        let impossible = LocalizationLimits { jumps_hz: 1e3, ..limits };
        let refused = LocalizationSettings::try_from(&Sensing { localization_limits: Some(impossible), ..thesis });
        assert!(refused.unwrap_err().to_string().contains("localization_limits.jumps_hz"));
    }

    #[test]
    fn what_is_stated_is_flown() {
        let mut sensing = described(SensingPreset::Nominal);
        (sensing.rate.filter, sensing.acceleration.filter) = (None, None);
        sensing.rate.white = Level::Known(0.01);
        sensing.position.white = Level::About(0.003);
        sensing.attitude.wander = Wander::Known { sigma: 0.0, time_s: 77.0 };
        (sensing.rate.delay.expected_s, sensing.acceleration.delay.expected_s) = (0.048, 0.048);
        sensing.pose_delay = Delay { expected_s: 0.148, sigma_s: 0.1 };
        sensing.velocity_delay = None;
        sensing.gravity_added_world_m_s2 = Some([0.0, 0.0, 9.8]);
        let settings = LocalizationSettings::try_from(&sensing).unwrap();
        assert!(!settings.imu.moving_average && !settings.imu.flight_filter);
        assert!((settings.imu.gyro.noise_density * libm::sqrt(0.5 / 0.008) - 0.01).abs() < 1e-15);
        assert_eq!((settings.pose.position_noise_m, settings.pose.attitude_drift_rad), (0.003, 0.0));
        assert!((settings.pose.drift_time_s - 10.0).abs() < 1e-12);
        assert_eq!((settings.timing.hidden_latency_ms, settings.timing.pose_latency_ms), (48, 100.0));
        assert_eq!(Some(settings.gravity_world_m_s2), sensing.gravity_added_world_m_s2);
    }

    type Change = fn(&mut Sensing);

    #[test]
    fn what_cannot_be_flown_names_the_key_and_what_can() {
        let refused = |change: Change| {
            let mut sensing = described(SensingPreset::Nominal);
            change(&mut sensing);
            LocalizationSettings::try_from(&sensing).unwrap_err().to_string()
        };
        let cases: [(Change, &str, &str); 9] = [
            (|s| s.rate.filter = None, "`rate.filter`", "left out"),
            (|s| s.rate.filter = LinearFilter::try_new(&[0.5, 0.5], &[1.0], 0.008).ok(), "`rate.filter`", "nominal"),
            (|s| s.attitude.wander = Wander::Known { sigma: 0.01, time_s: 3.0 }, "`wander.time_s`", "one time"),
            (|s| s.velocity_delay = Some(Delay { expected_s: 0.1, sigma_s: 0.0 }), "`velocity_delay.", "`pose_delay."),
            (|s| s.acceleration.delay.expected_s = 0.1, "`acceleration.delay.", "`rate.delay."),
            (|s| (s.rate.delay.expected_s, s.acceleration.delay.expected_s) = (0.01, 0.01), "`rate.delay.", "8 ms"),
            (|s| s.pose_delay.expected_s = -0.1, "`velocity_delay.", "pose_delay"),
            (|s| (s.pose_delay.expected_s, s.velocity_delay) = (-0.1, None), "`pose_delay.", "1 s more"),
            (|s| s.rate.scale_sigma = 0.7, "`rate.scale_sigma`", "0 to 0.5"),
        ];
        for (change, key, accepted) in cases {
            let message = refused(change);
            assert!(message.contains(key) && message.contains(accepted), "{message}");
        }
    }
}
