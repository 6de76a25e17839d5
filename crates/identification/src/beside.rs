//! What acts beside the logged wrench: the environment, and the turning of stored momentum.

use crate::error::{Column, IdentificationError};
use crate::lie::{LieGroup, Wrench};
use crate::motion::{MotionSample, filled_poses};
use nalgebra::{SVector, Vector3};

/// Steps that differ by less than this fraction are equal.
const EQUAL_STEPS: f64 = 0.01;

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
/// [`IdentificationError::MissingColumn`] where momentum is stored and nothing says how the body turns.
/// # Source
/// Mean of what is smooth: cubic through four samples. Of `h x w`: both change evenly over a step of held motor torques, so
/// that the mean is `mean(h) x mean(w) + (change of h) x (change of w) / 12`.
pub(crate) fn beside(record: &[MotionSample]) -> Result<Option<Vec<UnloggedWrench>>, IdentificationError> {
    let wheels = Turning::of_wheels(record)?;
    Ok(beside_with(record, wheels.as_ref()))
}

/// The same of the environment alone, for estimators that know what stored momentum does to a body that turns.
pub(crate) fn environment(record: &[MotionSample]) -> Option<Vec<UnloggedWrench>> {
    record.iter().any(|sample| sample.besides_body.is_some()).then(|| beside_with(record, None)).flatten()
}

/// Momentum stored at each sample, body axes, N m s; `None` without wheels.
pub(crate) fn stored_momenta(record: &[MotionSample]) -> Option<Vec<Vector3<f64>>> {
    filled(record, |sample| sample.stored_momentum_body)
}

/// What acts beside the logged wrench at each sample, the turning of wheels apart, body axes, about the origin; `None` where nothing is listed.
pub(crate) fn listed_beside(record: &[MotionSample]) -> Option<Vec<Wrench<f64>>> {
    let filled = filled(record, |sample| sample.besides_body.map(|wrench| wrench.to_vector()))?;
    Some(filled.into_iter().map(Wrench::from).collect())
}

/// Telemetry may come more seldom than poses: between two samples that list it, it changes evenly, before the first and after the last it stays.
fn filled<const N: usize>(
    record: &[MotionSample],
    listed: impl Fn(&MotionSample) -> Option<SVector<f64, N>>,
) -> Option<Vec<SVector<f64, N>>> {
    let mut listed = (0..record.len()).filter_map(|i| Some((i, listed(&record[i])?)));
    let mut before = listed.next()?;
    let mut filled = vec![before.1; before.0 + 1];
    for next in listed {
        let seconds = |to: usize| (record[to].time_ns - record[before.0].time_ns) as f64;
        let share = |i: usize| if seconds(next.0) > 0.0 { seconds(i) / seconds(next.0) } else { 1.0 };
        filled.extend((before.0 + 1..=next.0).map(|i| before.1.lerp(&next.1, share(i))));
        before = next;
    }
    filled.resize(record.len(), before.1);
    Some(filled)
}

fn beside_with(record: &[MotionSample], wheels: Option<&Turning>) -> Option<Vec<UnloggedWrench>> {
    if !record.iter().any(MotionSample::has_more_than_logged) {
        return None;
    }
    let last = record.len() - 1;
    let seconds = |i: usize| (record[(i + 1).min(last)].time_ns - record[i.min(last)].time_ns) as f64 * 1e-9;
    let listed = listed_beside(record);
    let smooth = |i: usize| listed.as_ref().map_or_else(Wrench::zero, |listed| listed[i]);
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
        stored_momenta(record).map(|stored| Self::of(record, stored)).transpose()
    }

    fn of(record: &[MotionSample], stored: Vec<Vector3<f64>>) -> Result<Self, IdentificationError> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_listed_more_seldom_changes_evenly_in_between() {
        let row = |time_ns, listed: Option<f64>| MotionSample {
            time_ns,
            stored_momentum_body: listed.map(|x| Vector3::x() * x),
            besides_body: listed.map(|x| Wrench::new(Vector3::y() * x, Vector3::z() * x)),
            ..MotionSample::default()
        };
        let record = [row(0, None), row(10, Some(1.0)), row(20, None), row(50, Some(5.0)), row(60, None)];
        let expected = [1.0, 1.0, 2.0, 5.0, 5.0];
        for (found, x) in stored_momenta(&record).into_iter().flatten().zip(expected) {
            assert!((found - Vector3::x() * x).norm() < 1e-15, "{found} {x}");
        }
        let beside = listed_beside(&record).unwrap_or_default();
        assert_eq!(beside.len(), expected.len());
        for (found, x) in beside.into_iter().zip(expected) {
            assert!((found.torque.y - x).abs() < 1e-15 && (found.force.z - x).abs() < 1e-15, "{found:?} {x}");
        }
        assert!(stored_momenta(&[row(0, None)]).is_none() && listed_beside(&[]).is_none());
    }
}
