//! What acts beside the logged wrench: the environment, and the turning of stored momentum.

use crate::error::{Column, IdentificationError};
use crate::lie::{LieGroup, Wrench};
use crate::motion::{MotionSample, filled_poses};
use nalgebra::Vector3;

/// Steps that differ by less than this fraction are equal.
const EQUAL_STEPS: f64 = 0.01;

/// Largest share of the logged torque that may be left out.
const LARGEST_LEFT_OUT: f64 = 1e-3;
/// Mean square roughness of turns over that of rates up to which turns are as good.
const SMOOTH: f64 = 2.0;

/// What acts beside the logged wrench from one sample to the next, body axes of its own time, about the origin.
///
/// It varies within a step also where the logged wrench is held, so that its mean alone is not enough for rows of higher order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct UnloggedWrench {
    /// At the sample.
    pub(crate) here: Wrench<f64>,
    /// Mean over the step.
    pub(crate) mean: Wrench<f64>,
    /// Change over the step, per second.
    pub(crate) slope: Wrench<f64>,
}

/// Step by step; the last sample begins no step and keeps what it has. `None` where nothing acts.
///
/// # Errors
/// [`IdentificationError::MissingColumn`] where only some samples list stored momentum, or nothing says how the body turns.
/// # Source
/// Mean of what is smooth: cubic through four samples. Of `h x w`: both change evenly over a step of held motor torques, so
/// that the mean is `mean(h) x mean(w) + (change of h) x (change of w) / 12`.
pub(crate) fn beside(record: &[MotionSample]) -> Result<Option<Vec<UnloggedWrench>>, IdentificationError> {
    let wheels = Turning::of_wheels(record)?;
    Ok(beside_with(record, wheels.as_ref()))
}

/// The same for an integrator that holds the wrench over a step, or lets it change evenly.
///
/// # Errors
/// As [`beside`]; [`IdentificationError::CoarseSteps`]: the torque `h x w` turns so far within a step that what is left out, its
/// square over twelve, is visible beside the logged torque (where none is logged, beside itself).
pub(crate) fn beside_in_short_steps(
    record: &[MotionSample],
) -> Result<Option<Vec<UnloggedWrench>>, IdentificationError> {
    let wheels = Turning::of_wheels(record)?;
    if let Some(wheels) = &wheels {
        wheels.refuse_coarse_steps(record)?;
    }
    Ok(beside_with(record, wheels.as_ref()))
}

fn beside_with(record: &[MotionSample], wheels: Option<&Turning>) -> Option<Vec<UnloggedWrench>> {
    if !record.iter().any(MotionSample::has_more_than_logged) {
        return None;
    }
    let last = record.len() - 1;
    let seconds = |i: usize| (record[(i + 1).min(last)].time_ns - record[i.min(last)].time_ns) as f64 * 1e-9;
    let smooth = |i: usize| record[i].besides_body.unwrap_or_else(Wrench::zero);
    let here = |i: usize| {
        let turning = wheels.map_or_else(Vector3::zeros, |wheels| wheels.torque(i));
        let smooth = smooth(i);
        Wrench::new(smooth.torque + turning, smooth.force)
    };
    let over_step = |i: usize| {
        if i == last {
            return UnloggedWrench { here: here(i), mean: here(i), slope: Wrench::zero() };
        }
        let step_s = seconds(i);
        let alike = |other: usize| (seconds(other) / step_s - 1.0).abs() < EQUAL_STEPS;
        let (from, to) = (smooth(i), smooth(i + 1));
        let mut mean = if i > 0 && i + 2 <= last && alike(i - 1) && alike(i + 1) {
            ((from + to) * 13.0 - smooth(i - 1) - smooth(i + 2)) * (1.0 / 24.0)
        } else {
            (from + to) * 0.5
        };
        if let Some(wheels) = wheels {
            mean.torque += wheels.mean_torque(i);
        }
        UnloggedWrench { here: here(i), mean, slope: (here(i + 1) - here(i)) * (1.0 / step_s) }
    };
    Some((0..record.len()).map(over_step).collect())
}

/// Stored momentum and the rate that turns it, N m s and rad/s, body axes.
struct Turning {
    stored: Vec<Vector3<f64>>,
    rates: Vec<Vector3<f64>>,
    /// Over the step from each sample to the next.
    mean_rates: Vec<Vector3<f64>>,
}

impl Turning {
    /// `None` without wheels.
    fn of_wheels(record: &[MotionSample]) -> Result<Option<Self>, IdentificationError> {
        let is_stored = record.iter().any(|sample| sample.stored_momentum_body.is_some());
        is_stored.then(|| Self::of(record)).transpose()
    }

    fn refuse_coarse_steps(&self, record: &[MotionSample]) -> Result<(), IdentificationError> {
        let torques: Vec<_> = (0..record.len()).map(|i| self.torque(i)).collect();
        let mean = |squares: &[f64]| squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        let size = mean(&torques.iter().map(Vector3::norm_squared).collect::<Vec<_>>());
        let change = mean(&torques.windows(2).map(|pair| (pair[1] - pair[0]).norm_squared()).collect::<Vec<_>>());
        let wrenches = record.iter().filter_map(|sample| sample.wrench_body);
        let logged = mean(&wrenches.map(|wrench| wrench.torque.norm_squared()).collect::<Vec<_>>());
        let left_out = change / (12.0 * size.max(logged * LARGEST_LEFT_OUT).sqrt());
        let share = left_out / if logged > 0.0 { logged.sqrt() } else { size.sqrt() };
        if share > LARGEST_LEFT_OUT { Err(IdentificationError::CoarseSteps { share }) } else { Ok(()) }
    }

    fn of(record: &[MotionSample]) -> Result<Self, IdentificationError> {
        let stored = record.iter().map(|sample| sample.stored_momentum_body).collect::<Option<Vec<_>>>();
        let stored = stored.ok_or(IdentificationError::MissingColumn(Column::StoredMomentum))?;
        let measured = |i: usize| record.get(i)?.rate_body;
        let (poses, last) = (filled_poses(record), record.len() - 1);
        let turned = |from: usize, to: usize| -> Option<Vector3<f64>> {
            let (poses, step_s) = (poses.as_ref()?, (record[to].time_ns - record[from].time_ns) as f64 * 1e-9);
            let turn: Vector3<f64> = LieGroup::log(&poses[from].rotation.between(&poses[to].rotation));
            (step_s > 0.0).then(|| turn / step_s)
        };
        let seen = |i: usize| measured(i).or_else(|| turned(i.saturating_sub(1), (i + 1).min(last)));
        let between = |i: usize| Some((seen(i)? + seen((i + 1).min(last))?) * 0.5);
        let missing = || IdentificationError::MissingColumn(Column::Rate);
        let rates = (0..=last).map(seen).collect::<Option<_>>().ok_or_else(missing)?;
        let mean_of_rates: Vec<_> = (0..=last).map(between).collect::<Option<_>>().ok_or_else(missing)?;
        // The turn from pose to pose is the mean rate, less what turning about changing axes adds; the mean of two rates is that
        // to second order only. But poses may be much the noisier.
        let turn = |i: usize| {
            let step_s = (record[i + 1].time_ns - record[i].time_ns) as f64 * 1e-9;
            Some(turned(i, i + 1)? - seen(i)?.cross(&seen(i + 1)?) * (step_s / 12.0))
        };
        let turns: Option<Vec<_>> = (0..last).map(turn).chain([seen(last)]).collect();
        let smoother = turns.filter(|turns| roughness(turns) <= SMOOTH * roughness(&mean_of_rates));
        Ok(Self { stored, rates, mean_rates: smoother.unwrap_or(mean_of_rates) })
    }

    fn torque(&self, i: usize) -> Vector3<f64> {
        self.stored[i].cross(&self.rates[i])
    }

    fn mean_torque(&self, i: usize) -> Vector3<f64> {
        let stored = (self.stored[i] + self.stored[i + 1]) * 0.5;
        let changes = (self.stored[i + 1] - self.stored[i]).cross(&(self.rates[i + 1] - self.rates[i]));
        stored.cross(&self.mean_rates[i]) + changes / 12.0
    }
}

/// Mean square of fourth differences, in which little is left of a motion.
fn roughness(values: &[Vector3<f64>]) -> f64 {
    let fourth = |w: &[Vector3<f64>]| (w[0] + w[4] - (w[1] + w[3]) * 4.0 + w[2] * 6.0).norm_squared();
    values.windows(5).map(fourth).sum()
}
