//! Noise of measured poses, rates and velocities, from differences so high that no motion is left in them.

use super::rows::{Regression, Scheme};
use super::settings::Settings;
use super::timeline::Timeline;
use crate::lie::Wrench;
use crate::motion::{MotionSample, Noise};
use crate::weighted_least_squares::RowNoise;
use nalgebra::{Matrix6, Vector3, Vector6};

/// Fewer differences than this say nothing.
const FEWEST: usize = 24;
/// Median of the absolute value of a standard normal variable.
const MEDIAN_OF_NORMAL: f64 = 0.674_489_750_196_082;

/// One standard deviation of each measured quantity, per sample and axis.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SampleNoise {
    pub(super) attitude_rad: f64,
    pub(super) position_m: f64,
    pub(super) rate_rad_s: f64,
    pub(super) velocity_m_s: f64,
    /// Of a record without any pose only.
    pub(super) acceleration_m_s2: f64,
}

impl SampleNoise {
    /// The same with noise of the wrench, N m and N.
    pub(super) fn with_wrench(&self, torque_n_m: f64, force_n: f64) -> Noise {
        let Self { attitude_rad, position_m, rate_rad_s, velocity_m_s, acceleration_m_s2 } = *self;
        Noise { torque_n_m, force_n, attitude_rad, position_m, rate_rad_s, velocity_m_s, acceleration_m_s2 }
    }

    pub(super) fn estimate(record: &[MotionSample], timeline: &Timeline, settings: &Settings) -> Self {
        let step_s = timeline.median_step_s();
        let mut noise = Self::default();
        // Second differences of poses; four more differences make six, whose squared coefficients add up to 924.
        let mut scheme = Scheme::new(settings, Regression::Variational, 1);
        scheme.wrench_optional = record.iter().all(|sample| sample.wrench_body.is_none());
        let wrench = |sample: &MotionSample| {
            let none = scheme.wrench_optional.then(Wrench::zero);
            sample.wrench_body.or(none).map(|wrench| wrench.to_vector())
        };
        if let Ok(rows) = scheme.rows(record, timeline) {
            let series: Vec<_> = rows
                .all
                .iter()
                .map(|row| {
                    let h = &row.regressor;
                    let acceleration = Vector6::new(h[(0, 4)], h[(1, 7)], h[(2, 9)], h[(3, 0)], h[(4, 0)], h[(5, 0)]);
                    (row.index, acceleration, row.wrench)
                })
                .collect();
            let (angular, linear) = unexplained(&series);
            let gain = 924.0_f64.sqrt() / (step_s * step_s);
            (noise.attitude_rad, noise.position_m) = (angular / gain, linear / gain);
        }
        // First differences of rates and velocities; four more make five: 252.
        let series: Vec<_> = (0..timeline.len() - 1)
            .filter(|&i| timeline.equal_steps(i, i + 1))
            .filter_map(|i| {
                let (a, b) = (&record[i], &record[i + 1]);
                let rate = b.rate_body? - a.rate_body?;
                let velocity = b.velocity_origin_world? - a.velocity_origin_world?;
                let seen: Vector3<f64> = a.world_from_body?.rotation.inverse_transform_vector(&velocity);
                let change = Vector6::new(rate.x, rate.y, rate.z, seen.x, seen.y, seen.z);
                Some((i, change, wrench(a)?))
            })
            .collect();
        let (angular, linear) = unexplained(&series);
        (noise.rate_rad_s, noise.velocity_m_s) = (angular / 252.0_f64.sqrt(), linear / 252.0_f64.sqrt());
        if record.iter().all(|sample| sample.world_from_body.is_none()) {
            noise.of_accelerations(record, timeline);
        }
        noise
    }

    /// Of rates and accelerations, where nothing else was seen.
    fn of_accelerations(&mut self, record: &[MotionSample], timeline: &Timeline) {
        let series: Vec<_> = (0..timeline.len() - 1)
            .filter(|&i| timeline.equal_steps(i, i + 1))
            .filter_map(|i| {
                let (a, b) = (&record[i], &record[i + 1]);
                let (rate, seen) = (b.rate_body? - a.rate_body?, a.acceleration_origin_body?);
                let change = Vector6::new(rate.x, rate.y, rate.z, seen.x, seen.y, seen.z);
                Some((i, change, a.wrench_body?.to_vector()))
            })
            .collect();
        let (angular, linear) = unexplained(&series);
        // The rates are differenced five times, the accelerations four: 70.
        (self.rate_rad_s, self.acceleration_m_s2) = (angular / 252.0_f64.sqrt(), linear / 70.0_f64.sqrt());
    }

    /// What this noise does to the rows of a scheme.
    pub(super) fn of_rows(&self, scheme: &Scheme, step_s: f64) -> RowNoise {
        let (angular, linear, steps) = match scheme.regression {
            Regression::NewtonEuler => (self.rate_rad_s, self.velocity_m_s, step_s),
            _ => (self.attitude_rad, self.position_m, step_s * step_s),
        };
        let gain = scheme.noise_gain() / (steps * steps);
        let samples = (2 * scheme.reach()) as f64;
        let of_mean_acceleration = match scheme.regression {
            Regression::NewtonEuler => self.acceleration_m_s2 * self.acceleration_m_s2 / samples,
            _ => 0.0,
        };
        RowNoise {
            correlation_length: 2 * scheme.reach(),
            angular_acceleration_variance: angular * angular * gain,
            acceleration_variance: linear * linear * gain + of_mean_acceleration,
        }
    }
}

/// Sample, motion `[angular; linear]`, wrench.
type Response = (usize, Vector6<f64>, Vector6<f64>);

/// Robust standard deviation (angular, linear) of fourth differences, less what differences of the wrench explain.
///
/// The wrench is the input, measured well: regressing the motion on it is not attenuated by noise in the motion.
fn unexplained(series: &[Response]) -> (f64, f64) {
    let difference = |window: &[Response]| match window {
        [a, b, c, d, e] if e.0 - a.0 == 4 => {
            let fourth = |f: fn(&Response) -> Vector6<f64>| f(a) - f(b) * 4.0 + f(c) * 6.0 - f(d) * 4.0 + f(e);
            Some((fourth(|row| row.1), fourth(|row| row.2)))
        }
        _ => None,
    };
    let differences: Vec<_> = series.windows(5).filter_map(difference).collect();
    if differences.len() < FEWEST {
        return (0.0, 0.0);
    }
    let (mut cross, mut input) = (Matrix6::zeros(), Matrix6::zeros());
    for (motion, wrench) in &differences {
        cross += motion * wrench.transpose();
        input += wrench * wrench.transpose();
    }
    let ridge = 1e-12 * input.trace();
    let response = (input + Matrix6::identity() * ridge).try_inverse().map_or_else(Matrix6::zeros, |i| cross * i);
    let (mut angular, mut linear) = (Vec::new(), Vec::new());
    for (motion, wrench) in &differences {
        let left = motion - response * wrench;
        angular.extend(left.iter().take(3).map(|x| x.abs()));
        linear.extend(left.iter().skip(3).map(|x| x.abs()));
    }
    (median(&mut angular) / MEDIAN_OF_NORMAL, median(&mut linear) / MEDIAN_OF_NORMAL)
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
