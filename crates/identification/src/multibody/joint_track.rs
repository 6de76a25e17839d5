//! Joint logs as samples of a tree: equal steps, smoothed, with accelerations.

use super::tree_sample::{TreeAcceleration, TreeSample};
use crate::dynamics::BodyAcceleration;
use crate::error::IdentificationError;
use crate::lie::{Pose, Twist};
use crate::savitzky_golay::SavitzkyGolay;
use nalgebra::Vector3;

/// What a fixed arm logs: one list a joint, one number a row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointTrack {
    /// Times, increasing, s.
    pub times_s: Vec<f64>,
    /// Positions, rad or m.
    pub positions: Vec<Vec<f64>>,
    /// Rates, rad/s or m/s; from the positions unless logged.
    pub rates: Option<Vec<Vec<f64>>>,
    /// Forces or currents of the motors.
    pub motors: Vec<Vec<f64>>,
}

impl JointTrack {
    /// Samples of an arm on a fixed base, a mean step apart; `smoothing` fits positions and rates, and gives accelerations.
    ///
    /// Motors are interpolated, not smoothed. The ends, where no full window fits, are left out.
    /// # Errors
    /// [`IdentificationError::NotFinite`] for a number that is not finite or a time that does not grow;
    /// [`IdentificationError::TooFewSamples`] with less than a window.
    pub fn on_fixed_base(
        &self,
        gravity_base: &Vector3<f64>,
        smoothing: &SavitzkyGolay,
    ) -> Result<Vec<TreeSample>, IdentificationError> {
        let count = self.times_s.len();
        let lists = || self.positions.iter().chain(self.rates.iter().flatten()).chain(&self.motors);
        let broken = lists().chain([&self.times_s]).find_map(|list| {
            if list.len() == count { list.iter().position(|x| !x.is_finite()) } else { Some(list.len().min(count)) }
        });
        if let Some(row) = broken.or_else(|| self.times_s.windows(2).position(|pair| pair[1] <= pair[0])) {
            return Err(IdentificationError::NotFinite { row });
        }
        let half = smoothing.half_window();
        let (Some(first), Some(last)) = (self.times_s.first(), self.times_s.last()) else {
            return Err(IdentificationError::TooFewSamples { samples: count, needed: 2 * half + 1 });
        };
        if count < 2 * half + 1 {
            return Err(IdentificationError::TooFewSamples { samples: count, needed: 2 * half + 1 });
        }
        let step_s = (last - first) / (count - 1) as f64;
        let even = |list: &Vec<f64>| self.evenly(list, step_s);
        let weights = [(0, 1.0), (1, step_s), (2, step_s * step_s)].map(|(derivative, scale)| {
            smoothing.weights(derivative, 0.0).iter().map(|w| w / scale).collect::<Vec<f64>>()
        });
        let fitted = |list: &[f64], derivative: usize| -> Vec<f64> {
            let sum = |window: &[f64]| window.iter().zip(&weights[derivative]).map(|(x, w)| x * w).sum();
            list.windows(2 * half + 1).map(sum).collect()
        };
        let positions: Vec<Vec<f64>> = self.positions.iter().map(even).collect();
        let smooth: Vec<Vec<f64>> = positions.iter().map(|list| fitted(list, 0)).collect();
        let (rates, accelerations): (Vec<Vec<f64>>, Vec<Vec<f64>>) = match &self.rates {
            Some(rates) => rates.iter().map(even).map(|list| (fitted(&list, 0), fitted(&list, 1))).unzip(),
            None => positions.iter().map(|list| (fitted(list, 1), fitted(list, 2))).unzip(),
        };
        let motors: Vec<Vec<f64>> = self.motors.iter().map(even).collect();
        let held =
            BodyAcceleration { angular_acceleration_body: Vector3::zeros(), acceleration_origin_body: -gravity_base };
        let at = |lists: &[Vec<f64>], k: usize| lists.iter().map(|list| list[k]).collect::<Vec<f64>>();
        let sample = |k: usize| TreeSample {
            time_s: first + (k + half) as f64 * step_s,
            world_from_base: Pose::identity(),
            base_twist: Twist::zero(),
            positions: at(&smooth, k),
            rates: at(&rates, k),
            accelerations: Some(TreeAcceleration { base: held, joints: at(&accelerations, k) }),
            motors: (!motors.is_empty()).then(|| at(&motors, k + half)),
            base_wrench: None,
        };
        Ok((0..count - 2 * half).map(sample).collect())
    }

    /// Values at equal steps, linearly between rows.
    fn evenly(&self, list: &[f64], step_s: f64) -> Vec<f64> {
        let mut row = 0;
        let times = &self.times_s;
        (0..times.len())
            .map(|k| {
                let time_s = times[0] + k as f64 * step_s;
                while row + 2 < times.len() && times[row + 1] < time_s {
                    row += 1;
                }
                let share = ((time_s - times[row]) / (times[row + 1] - times[row])).clamp(0.0, 1.0);
                list[row] + (list[row + 1] - list[row]) * share
            })
            .collect()
    }
}

/// Samples of a free tree with the accelerations that the torque form needs: the derivatives of `smoothing` on twist and
/// joint rates. The ends, where no full window fits, are left out.
///
/// # Errors
/// [`IdentificationError::TooFewSamples`] with less than a window; [`IdentificationError::UnequalSteps`] where a step
/// differs from the mean one by more than 1 %.
pub fn with_accelerations(
    samples: &[TreeSample],
    gravity_world: &Vector3<f64>,
    smoothing: &SavitzkyGolay,
) -> Result<Vec<TreeSample>, IdentificationError> {
    let half = smoothing.half_window();
    let (needed, count) = (2 * half + 1, samples.len());
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return Err(IdentificationError::TooFewSamples { samples: count, needed });
    };
    if count < needed {
        return Err(IdentificationError::TooFewSamples { samples: count, needed });
    }
    let typical_s = (last.time_s - first.time_s) / (count - 1) as f64;
    let uneven = |pair: &[TreeSample]| ((pair[1].time_s - pair[0].time_s) / typical_s - 1.0).abs() > 0.01;
    if let Some(before) = samples.windows(2).position(uneven) {
        let step_s = samples[before + 1].time_s - samples[before].time_s;
        return Err(IdentificationError::UnequalSteps { index: before + 1, step_s, typical_s });
    }
    let weights: Vec<f64> = smoothing.weights(1, 0.0).iter().map(|weight| weight / typical_s).collect();
    let at_centre = |window: &[TreeSample]| {
        let mut sample = window[half].clone();
        let weighted = || window.iter().zip(&weights);
        let twist_rate = weighted().fold(Twist::zero(), |sum, (sample, weight)| sum + sample.base_twist * *weight);
        let joints = (0..sample.rates.len())
            .map(|joint| weighted().map(|(sample, weight)| sample.rates[joint] * weight).sum())
            .collect();
        let mut base = BodyAcceleration::from_twist_rate_body(&sample.base_twist, &twist_rate);
        base.acceleration_origin_body -= sample.world_from_base.rotation.inverse_transform_vector(gravity_world);
        sample.accelerations = Some(TreeAcceleration { base, joints });
        sample
    };
    Ok(samples.windows(needed).map(at_centre).collect())
}
