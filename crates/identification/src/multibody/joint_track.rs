//! Joint logs as samples of a tree, smoothed, with accelerations.

use super::local_fit::LocalFit;
use super::tree_sample::{TreeAcceleration, TreeSample};
use crate::dynamics::BodyAcceleration;
use crate::error::IdentificationError;
use crate::lie::{Pose, Twist};
use nalgebra::{Vector3, Vector6};

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
    /// Whether motors pass through the window of the motion. Least squares with currents as regressors wants both sides alike;
    /// errors in variables want the noise of each row by itself.
    pub smooth_motors: bool,
}

impl JointTrack {
    /// Samples of an arm on a fixed base at the logged times; local polynomials fit positions and rates, and give accelerations.
    ///
    /// The window is the one in which the parameters suffer least. Rows at ends and gaps, where no full
    /// window fits, are left out.
    /// # Errors
    /// [`IdentificationError::NotFinite`] for a number that is not finite or a time that does not grow;
    /// [`IdentificationError::TooFewSamples`] where no stretch without a gap holds a window.
    pub fn on_fixed_base(&self, gravity_base: &Vector3<f64>) -> Result<Vec<TreeSample>, IdentificationError> {
        let count = self.times_s.len();
        let lists = || self.positions.iter().chain(self.rates.iter().flatten()).chain(&self.motors);
        let broken = lists().chain([&self.times_s]).find_map(|list| {
            if list.len() == count { list.iter().position(|x| !x.is_finite()) } else { Some(list.len().min(count)) }
        });
        if let Some(row) = broken {
            return Err(IdentificationError::NotFinite { row });
        }
        let (differentiated, order) = self.rates.as_ref().map_or((&self.positions, 2), |rates| (rates, 1));
        let signals: Vec<&[f64]> = differentiated.iter().map(Vec::as_slice).collect();
        let fit = LocalFit::choose(&self.times_s, &signals, order)?;
        let held =
            BodyAcceleration { angular_acceleration_body: Vector3::zeros(), acceleration_origin_body: -gravity_base };
        let motors = |centre: usize, weights: &[f64]| {
            let value =
                |list: &Vec<f64>| if self.smooth_motors { fit.sum(centre, weights, list) } else { list[centre] };
            self.motors.iter().map(value).collect()
        };
        let sample = |centre: usize| {
            let weights = [0, 1, 2].map(|derivative| fit.weights(centre, derivative));
            let fitted = |lists: &[Vec<f64>], derivative: usize| -> Vec<f64> {
                lists.iter().map(|list| fit.sum(centre, &weights[derivative], list)).collect()
            };
            TreeSample {
                time_s: self.times_s[centre],
                world_from_base: Pose::identity(),
                base_twist: Twist::zero(),
                positions: fitted(&self.positions, 0),
                rates: fitted(differentiated, order - 1),
                accelerations: Some(TreeAcceleration { base: held, joints: fitted(differentiated, order) }),
                motors: (!self.motors.is_empty()).then(|| motors(centre, &weights[0])),
                base_wrench: None,
            }
        };
        Ok(fit.centres().map(sample).collect())
    }
}

/// Samples of a free tree with the accelerations that the torque form needs: derivatives of local polynomials on twist and
/// joint rates, in the window in which the parameters suffer least. Rows at ends and gaps, where no full window fits, are left
/// out.
///
/// # Errors
/// [`IdentificationError::NotFinite`] for a time that does not grow; [`IdentificationError::TooFewSamples`] where no stretch
/// without a gap holds a window.
pub fn with_accelerations(
    samples: &[TreeSample],
    gravity_world: &Vector3<f64>,
) -> Result<Vec<TreeSample>, IdentificationError> {
    let times_s: Vec<f64> = samples.iter().map(|sample| sample.time_s).collect();
    let joints = samples.first().map_or(0, |sample| sample.rates.len());
    if let Some(row) = samples.iter().position(|sample| sample.rates.len() != joints) {
        return Err(IdentificationError::NotFinite { row });
    }
    let of_twist = |k: usize| samples.iter().map(|sample| sample.base_twist.to_vector()[k]).collect::<Vec<f64>>();
    let of_joint = |joint: usize| samples.iter().map(|sample| sample.rates[joint]).collect::<Vec<f64>>();
    let signals: Vec<Vec<f64>> = (0..6).map(of_twist).chain((0..joints).map(of_joint)).collect();
    let lists: Vec<&[f64]> = signals.iter().map(Vec::as_slice).collect();
    let fit = LocalFit::choose(&times_s, &lists, 1)?;
    let at_centre = |centre: usize| {
        let mut sample = samples[centre].clone();
        let weights = fit.weights(centre, 1);
        let rate = |signal: &[f64]| fit.sum(centre, &weights, signal);
        let twist_rate = Twist::from(Vector6::from_fn(|k, _| rate(lists[k])));
        let mut base = BodyAcceleration::from_twist_rate_body(&sample.base_twist, &twist_rate);
        base.acceleration_origin_body -= sample.world_from_base.rotation.inverse_transform_vector(gravity_world);
        let joints = lists[6..].iter().map(|signal| rate(signal)).collect();
        sample.accelerations = Some(TreeAcceleration { base, joints });
        sample
    };
    Ok(fit.centres().map(at_centre).collect())
}
