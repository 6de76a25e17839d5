//! What an estimator does to the state that a controller sees: how far it is off, and by how much it corrects itself.

use super::riccati::discrete_lqr;
use crate::error::{PlanningError, not_negative, positive};
use nalgebra::{Matrix2, SMatrix};
use tumble_identification::recursive::GaussMarkov;

/// Largest count of measurements between two decisions.
const MOST_BETWEEN: f64 = 1e4;
/// Least variance of a measurement: one without an error would leave nothing to filter.
const LEAST_VARIANCE: f64 = 1e-18;

/// One axis of a localisation, and what moves the body beside what is commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisSensing {
    /// Time between two measurements, s.
    pub period_s: f64,
    /// Age of a measurement when it arrives, s.
    pub age_s: f64,
    /// White error of a measured position, m, and of a measured velocity, m/s.
    pub white: [f64; 2],
    /// Wander of the measured position, m.
    pub position_wander: GaussMarkov,
    /// Wander of the measured velocity, m/s.
    pub velocity_wander: GaussMarkov,
    /// White acceleration that is not commanded: variance of the velocity that it makes in a second, m^2/s^3.
    pub white_m2_s3: f64,
    /// Slow acceleration that is not commanded, m/s^2.
    pub drift: GaussMarkov,
}

/// Position and velocity of one axis as a filter says them.
///
/// A loop that is closed by an estimate does not see how far that is off: it follows, and only what the estimate is corrected by disturbs it.
/// Both are covariances of position and velocity, m and m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimateNoise {
    /// Of the corrections between two decisions; white, where the filter is right.
    pub corrections: Matrix2<f64>,
    /// Of the error.
    pub error: Matrix2<f64>,
}

/// What the tube is built for in place of the errors of measurement: so many deviations of what the corrections of an estimator make of the distance
/// from the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corrections {
    /// [`EstimateNoise::corrections`].
    pub covariance: Matrix2<f64>,
    /// Standard deviations of the distance from the plan that the tube holds.
    pub sigmas: f64,
    /// Share of what the feedback may ask for within the tube, against corrections and what pushes from outside, that plans leave it, 0 to 1; where it asks
    /// for more than there is, it gets less, and comes back a little later.
    pub reserved: f64,
}

impl AxisSensing {
    /// What a Kalman filter that knows all of this leaves, in the steady state, for decisions every `step_s`.
    ///
    /// # Errors
    /// [`PlanningError::NotPositive`] times, numbers that are negative or none, and what no filter settles on.
    ///
    /// # Source
    /// With the covariance `P` of the filtered state, its motion `A` and what comes to it, `Q`, over a step: `x+ - A x` has the covariance
    /// `A P A' + Q - P`, and its values at different decisions are independent.
    pub fn filtered(&self, step_s: f64) -> Result<EstimateNoise, PlanningError> {
        let period_s = positive("the time between measurements", self.period_s)?;
        let between = (positive("the time between decisions", step_s)? / period_s).round().clamp(1.0, MOST_BETWEEN);
        let age_s = not_negative("the age of a measurement", self.age_s)?;
        let (motion, noise) = self.step(period_s)?;
        let mut seen = SMatrix::<f64, 2, 5>::zeros();
        (seen[(0, 0)], seen[(0, 3)], seen[(1, 1)], seen[(1, 4)]) = (1.0, 1.0, 1.0, 1.0);
        let variance =
            |sigma| not_negative("the error of a measurement", sigma).map(|sigma| (sigma * sigma).max(LEAST_VARIANCE));
        let [position, velocity] = self.white;
        let white = Matrix2::new(variance(position)?, 0.0, 0.0, variance(velocity)?);
        // by duality: the cost of the regulator of the transposed system is the covariance before a measurement
        let (_, before) = discrete_lqr(&motion.transpose(), &seen.transpose(), &noise, &white)?;
        let explained =
            before * seen.transpose() * inverse(&(seen * before * seen.transpose() + white))? * seen * before;
        let after = before - explained;
        let mut covariance = after;
        let mut count = 0.0;
        while count < between {
            covariance = motion * covariance * motion.transpose() + noise;
            count += 1.0;
        }
        let (aged, aging) = if age_s > 0.0 { self.step(age_s)? } else { (SMatrix::identity(), SMatrix::zeros()) };
        let corrections = aged * (covariance - after) * aged.transpose();
        let error = aged * after * aged.transpose() + aging;
        let of_motion = |matrix: &SMatrix<f64, 5, 5>| matrix.fixed_view::<2, 2>(0, 0).into_owned();
        Ok(EstimateNoise { corrections: of_motion(&corrections), error: of_motion(&error) })
    }

    /// Position, velocity, slow acceleration and the two wanders over a time, and the covariance of what comes to them.
    fn step(&self, time_s: f64) -> Result<(SMatrix<f64, 5, 5>, SMatrix<f64, 5, 5>), PlanningError> {
        let white = not_negative("the white acceleration", self.white_m2_s3)?;
        let mut motion = SMatrix::<f64, 5, 5>::identity();
        let mut noise = SMatrix::<f64, 5, 5>::zeros();
        (motion[(0, 1)], motion[(0, 2)], motion[(1, 2)]) = (time_s, 0.5 * time_s * time_s, time_s);
        noise[(0, 0)] = white * time_s * time_s * time_s / 3.0;
        (noise[(0, 1)], noise[(1, 0)]) = (white * time_s * time_s / 2.0, white * time_s * time_s / 2.0);
        noise[(1, 1)] = white * time_s;
        for (i, slow) in [(2, self.drift), (3, self.position_wander), (4, self.velocity_wander)] {
            let sigma = not_negative("the deviation of a slow error", slow.sigma)?;
            let decay = libm::exp(-time_s / positive("the correlation time of a slow error", slow.time_s)?);
            motion[(i, i)] = if sigma > 0.0 { decay } else { 0.0 };
            noise[(i, i)] = sigma * sigma * (1.0 - decay * decay);
        }
        Ok((motion, noise))
    }
}

fn inverse(matrix: &Matrix2<f64>) -> Result<Matrix2<f64>, PlanningError> {
    matrix.try_inverse().ok_or(PlanningError::NotPositive { what: "the variance of a measurement", value: 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::{AxisGain, AxisTemplate, SymmetricBox, TubeDisturbance};

    /// White errors of 2 mm and 1 mm/s, 10 mN of white force at 62.5 Hz, 2 mN that drift over 10 s, 9.58 kg.
    fn white() -> AxisSensing {
        let mass_kg = 9.58;
        AxisSensing {
            period_s: 0.016,
            age_s: 0.0,
            white: [2e-3, 1e-3],
            position_wander: GaussMarkov::NONE,
            velocity_wander: GaussMarkov::NONE,
            white_m2_s3: (0.01 / mass_kg) * (0.01 / mass_kg) * 0.016,
            drift: GaussMarkov { sigma: 0.002 / mass_kg, time_s: 10.0 },
        }
    }

    fn deviations(covariance: &Matrix2<f64>) -> [f64; 2] {
        [f64::sqrt(covariance.m11), f64::sqrt(covariance.m22)]
    }

    /// Against a filter in another language: 0.18 mm, 0.151 mm/s, corrected by 0.078 mm, 0.086 mm/s; with a wander of 2 cm 17.1 mm, 1.40 mm/s.
    #[test]
    fn a_filter_leaves_what_an_independent_one_does() {
        let noise = white().filtered(12.0 * 0.016).unwrap();
        let ([position, velocity], [by_position, by_velocity]) =
            (deviations(&noise.error), deviations(&noise.corrections));
        assert!((position - 0.18e-3).abs() < 0.005e-3 && (velocity - 0.151e-3).abs() < 0.0005e-3, "{noise:?}");
        assert!((by_position - 0.078e-3).abs() < 0.0005e-3 && (by_velocity - 0.086e-3).abs() < 0.0005e-3, "{noise:?}");
        let wandering = AxisSensing {
            white: [1e-3, 2e-3],
            position_wander: GaussMarkov { sigma: 0.02, time_s: 10.0 },
            velocity_wander: GaussMarkov { sigma: 0.002, time_s: 10.0 },
            ..white()
        };
        let [position, velocity] = deviations(&wandering.filtered(12.0 * 0.016).unwrap().error);
        assert!((position - 17.1e-3).abs() < 0.05e-3 && (velocity - 1.40e-3).abs() < 0.005e-3, "{position} {velocity}");
    }

    /// Half-widths of the position from the study that this is built by.
    #[test]
    fn corrections_ask_for_a_twelfth_of_what_two_errors_in_a_box_do() {
        let gain = AxisGain { step_s: 12.0 * 0.016, ..AxisGain::default() };
        let covariance = white().filtered(gain.step_s).unwrap().corrections;
        let corrected = AxisTemplate::with_corrections(gain, &Corrections { covariance, sigmas: 4.93, reserved: 1.0 });
        let errors = TubeDisturbance { position_m: 3e-4, velocity_m_s: 1.5e-4, force_n: 0.0, acceleration_m_s2: 0.0 };
        let boxed = AxisTemplate::try_new(gain, &SymmetricBox(errors.of_measurement(gain.step_s))).unwrap();
        let corrected = corrected.unwrap();
        assert!((corrected.unmatched[2] - 2.5e-3).abs() < 0.1e-3, "{corrected:?}");
        assert!((corrected.unmatched_input() - 1.2e-3).abs() < 0.05e-3, "{corrected:?}");
        assert!(
            (boxed.unmatched[2] - 31e-3).abs() < 0.5e-3 && (boxed.unmatched_input() - 2.5e-3).abs() < 0.05e-3,
            "{boxed:?}"
        );
    }

    #[test]
    fn an_older_measurement_is_off_by_more_and_what_is_no_number_is_refused() {
        let now = white().filtered(0.2).unwrap();
        let later = AxisSensing { age_s: 0.1, ..white() }.filtered(0.2).unwrap();
        assert!(later.error.m11 > now.error.m11 && later.error.m22 > now.error.m22);
        assert!(later.corrections.m11 > now.corrections.m11);
        // the slow acceleration it takes along is corrected too
        assert!(later.corrections.m22 > 0.99 * now.corrections.m22);
        let drift = |sigma, time_s| AxisSensing { drift: GaussMarkov { sigma, time_s }, ..white() };
        let refused = [
            AxisSensing { period_s: 0.0, ..white() },
            AxisSensing { age_s: -0.1, ..white() },
            AxisSensing { white: [f64::NAN, 1e-3], ..white() },
            AxisSensing { white_m2_s3: -1.0, ..white() },
            drift(-1.0, 1.0),
            drift(1e-3, 0.0),
            drift(f64::INFINITY, 1.0),
        ];
        for (i, sensing) in refused.iter().enumerate() {
            assert!(sensing.filtered(0.2).is_err(), "{i}: {sensing:?}");
        }
        assert!(white().filtered(f64::NAN).is_err());
    }
}
