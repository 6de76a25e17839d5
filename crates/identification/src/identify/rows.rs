//! From samples to rows `regressor * parameters = wrench`.

use super::settings::Settings;
use super::timeline::Timeline;
use crate::WrenchTiming;
use crate::beside::{UnloggedWrench, beside};
use crate::error::{Column, IdentificationError};
use crate::lie::{LieGroup, Wrench, rotation_jacobian, skew};
use crate::motion::MotionSample;
use crate::regressors::{Extrapolation, ObserverFrame, PoseTriple, Regressor, variational_extrapolated};
use crate::weighted_least_squares::WrenchRow;
use nalgebra::{Matrix3, Rotation3, SMatrix, Vector3, Vector6};

/// Which equations tie the motion to the parameters in rows that are linear in them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Regression {
    /// Newton-Euler with measured velocities and rates, in integral (momentum) form.
    NewtonEuler,
    /// Variational regressor of order 2, poses only.
    Variational,
    /// Extrapolated variational regressor of order 4, poses only.
    #[default]
    Variational4,
    /// Extrapolated variational regressor of order 6, poses only.
    Variational6,
}

/// How rows are formed.
#[derive(Clone, Copy)]
pub(super) struct Scheme {
    pub(super) regression: Regression,
    pub(super) lag: usize,
    pub(super) wrench_timing: WrenchTiming,
    pub(super) gravity_world: Vector3<f64>,
    /// Rows without any wrench are wanted (a plan, not a log).
    pub(super) wrench_optional: bool,
}

/// All rows of a record and what was left out.
pub(super) struct Rows {
    pub(super) all: Vec<WrenchRow>,
    pub(super) windows: usize,
    pub(super) skipped_unequal: usize,
    pub(super) skipped_missing: usize,
    pub(super) skipped_half_turn: usize,
    /// Of those that miss something, those that miss a pose.
    pub(super) without_pose: usize,
    /// Samples that take part in a row.
    pub(super) used: usize,
}

enum Skip {
    Unequal,
    Missing,
    Pose,
    HalfTurn,
}

impl Scheme {
    pub(super) fn new(settings: &Settings, regression: Regression, lag: usize) -> Self {
        Self {
            regression,
            lag: lag.max(1),
            wrench_timing: settings.wrench_timing,
            gravity_world: settings.gravity_world,
            wrench_optional: false,
        }
    }

    fn extrapolation(&self) -> Extrapolation {
        match self.regression {
            Regression::Variational4 => Extrapolation::Order4,
            Regression::Variational6 => Extrapolation::Order6,
            _ => Extrapolation::Order2,
        }
    }

    /// Order of the error in the step.
    pub(super) fn order(&self) -> i32 {
        match (self.regression, self.wrench_timing) {
            // Jumps of a held wrench limit what smoothness can give.
            (Regression::Variational4, WrenchTiming::Sampled) => 4,
            (Regression::Variational6, WrenchTiming::Sampled) => 6,
            _ => 2,
        }
    }

    /// Samples on each side of the node.
    pub(super) fn reach(&self) -> usize {
        match self.regression {
            Regression::NewtonEuler => self.lag,
            _ => self.lag * self.extrapolation().reach(),
        }
    }

    /// Neighbouring nodes of which one row in `stride` pairs is formed: more would overlap almost entirely.
    pub(super) fn stride(&self) -> usize {
        (self.lag / 4).max(1)
    }

    /// Nodes from a row to those whose rows, other poses of nearly the same motion, tell whether the noise of neighbouring
    /// samples is alike. `None` where a row needs no instruments.
    pub(super) fn instruments(&self) -> Option<usize> {
        (self.lag > 1).then(|| (self.lag / 2).max(1))
    }

    /// Variance gain from one sample of noise to the second difference (pose methods) or difference (Newton-Euler)
    /// in a row, times the step to the fourth or second power.
    pub(super) fn noise_gain(&self) -> f64 {
        let lag = self.lag as f64;
        if self.regression == Regression::NewtonEuler {
            return 2.0 / (4.0 * lag * lag);
        }
        let (mut middle, mut sides) = (0.0, 0.0);
        for (i, c) in (1_u8..).zip(self.extrapolation().coefficients()) {
            let weight = c / f64::from(i * i);
            middle += 2.0 * weight;
            sides += 2.0 * weight * weight;
        }
        (middle * middle + sides) / lag.powi(4)
    }

    /// Sum of squared weights of the wrench samples in one right-hand side.
    pub(super) fn wrench_gain(&self) -> f64 {
        let samples = 2 * self.reach() + 1;
        if self.regression == Regression::NewtonEuler {
            return 1.0 / (samples - 1) as f64;
        }
        let times: Vec<f64> = (0..samples).map(|i| i as f64).collect();
        let mut wrenches = vec![Wrench::zero(); samples];
        let mut sum = 0.0;
        for i in 0..samples {
            wrenches[i].force.x = 1.0;
            let weight = self.wrench_timing.node_wrench(&times, &wrenches, self.lag, self.extrapolation());
            wrenches[i].force.x = 0.0;
            sum += weight.map_or(0.0, |w| w.force.x * w.force.x);
        }
        sum
    }

    /// # Errors
    /// Where the whole record gives not one row.
    pub(super) fn rows(&self, record: &[MotionSample], timeline: &Timeline) -> Result<Rows, IdentificationError> {
        let reach = self.reach();
        let mut result = Rows {
            all: Vec::new(),
            windows: 0,
            skipped_unequal: 0,
            skipped_missing: 0,
            skipped_half_turn: 0,
            without_pose: 0,
            used: 0,
        };
        let (stride, mut used_until) = (self.stride(), 0);
        let beside = beside(record)?;
        let source = Source { record, timeline, beside: beside.as_deref() };
        for node in reach..timeline.len().saturating_sub(reach) {
            if (node - reach) % stride > 1 {
                continue;
            }
            let (first, last) = (node - reach, node + reach);
            if !timeline.without_gap(first, last) {
                continue;
            }
            result.windows += 1;
            match self.row(&source, node) {
                Ok(row) => {
                    result.all.push(row);
                    result.used += (last + 1).saturating_sub(used_until.max(first));
                    used_until = last + 1;
                }
                Err(Skip::Unequal) => result.skipped_unequal += 1,
                Err(Skip::Missing) => result.skipped_missing += 1,
                Err(Skip::Pose) => {
                    result.skipped_missing += 1;
                    result.without_pose += 1;
                }
                Err(Skip::HalfTurn) => result.skipped_half_turn += 1,
            }
        }
        if result.all.is_empty() {
            return Err(self.reason(record, &result));
        }
        Ok(result)
    }

    fn reason(&self, record: &[MotionSample], found: &Rows) -> IdentificationError {
        let poseless = record.iter().all(|sample| sample.world_from_body.is_none());
        if !self.wrench_optional && record.iter().all(|sample| sample.wrench_body.is_none()) {
            IdentificationError::MissingColumn(Column::Wrench)
        } else if poseless && (self.regression != Regression::NewtonEuler || self.gravity_world != Vector3::zeros()) {
            IdentificationError::MissingColumn(Column::Pose)
        } else if self.regression == Regression::NewtonEuler && record.iter().all(|sample| sample.rate_body.is_none()) {
            IdentificationError::MissingColumn(Column::Rate)
        } else if poseless && record.iter().all(|sample| sample.acceleration_origin_body.is_none()) {
            IdentificationError::MissingColumn(Column::Acceleration)
        } else if self.regression == Regression::NewtonEuler
            && !poseless
            && record.iter().all(|s| s.velocity_origin_world.is_none())
        {
            IdentificationError::MissingColumn(Column::Velocity)
        } else if found.skipped_half_turn > 0 {
            IdentificationError::HalfTurns { windows: found.skipped_half_turn }
        } else {
            IdentificationError::TooFewSamples { samples: record.len(), needed: 2 * self.reach() + 1 }
        }
    }

    fn row(&self, source: &Source<'_>, node: usize) -> Result<WrenchRow, Skip> {
        let Source { record, timeline, beside } = *source;
        let reach = self.reach();
        let window = &record[node - reach..=node + reach];
        if self.regression == Regression::NewtonEuler {
            return self.momentum_row(source, window, node);
        }
        if !timeline.equal_steps(node - reach, node + reach) {
            return Err(Skip::Unequal);
        }
        let regressor = match self.extrapolation() {
            Extrapolation::Order2 => self.extrapolated::<1>(record, timeline, node)?,
            Extrapolation::Order4 => self.extrapolated::<2>(record, timeline, node)?,
            Extrapolation::Order6 => self.extrapolated::<3>(record, timeline, node)?,
        };
        let times_s: Vec<f64> = (node - reach..=node + reach).map(|i| timeline.relative_s(i, node)).collect();
        // The last held wrench acts after the window: it may be missing.
        let wrenches: Option<Vec<Wrench<f64>>> = window
            .iter()
            .enumerate()
            .map(|(i, sample)| match self.wrench_timing {
                WrenchTiming::Held if i == 2 * reach => Some(Wrench::zero()),
                WrenchTiming::Sampled if i != reach => Some(Wrench::zero()),
                _ => sample.wrench_body.or(self.wrench_optional.then(Wrench::zero)),
            })
            .collect();
        let mut wrench = wrenches
            .and_then(|wrenches| self.wrench_timing.node_wrench(&times_s, &wrenches, self.lag, self.extrapolation()))
            .ok_or(Skip::Missing)?;
        if let Some(beside) = beside {
            wrench += self.beside_node(&beside[node - reach..=node + reach], &times_s);
        }
        Ok(WrenchRow { index: node, regressor, wrench: wrench.to_vector() })
    }

    /// What acts beside at the node, as [`WrenchTiming::node_wrench`] weighs it, but not held over the steps.
    fn beside_node(&self, beside: &[UnloggedWrench], times_s: &[f64]) -> Wrench<f64> {
        let node = self.reach();
        if self.wrench_timing == WrenchTiming::Sampled {
            return beside[node].here;
        }
        let mut sum = Wrench::zero();
        for (coefficient, distance) in self.extrapolation().coefficients().iter().zip((1..).map(|i| i * self.lag)) {
            let (first, middle, last) = (times_s[node - distance], times_s[node], times_s[node + distance]);
            let (before_s, after_s) = (middle - first, last - middle);
            let scale = coefficient * 2.0 / (before_s + after_s);
            for (i, UnloggedWrench { mean, slope, .. }) in beside[node - distance..node + distance].iter().enumerate() {
                let (from, to) = (times_s[node - distance + i], times_s[node - distance + i + 1]);
                let (step_s, halfway) = (to - from, 0.5 * (from + to));
                // The hat in the middle of the step, and its slope.
                let (hat, rise) = if i < distance {
                    ((halfway - first) / before_s, 1.0 / before_s)
                } else {
                    ((last - halfway) / after_s, -1.0 / after_s)
                };
                sum += *mean * (scale * step_s * hat) + *slope * (scale * step_s.powi(3) / 12.0 * rise);
            }
        }
        sum
    }

    fn extrapolated<const LAGS: usize>(
        &self,
        record: &[MotionSample],
        timeline: &Timeline,
        node: usize,
    ) -> Result<Regressor<f64>, Skip> {
        let pose = |index: usize| record[index].world_from_body.as_ref().ok_or(Skip::Pose);
        let (before, after) = (node - self.lag, node + self.lag);
        // An observer that moves with the body keeps the increments, and with them the error, small.
        let travelled = pose(after)?.translation.vector - pose(before)?.translation.vector;
        let observer = ObserverFrame {
            velocity_world: travelled / timeline.relative_s(after, before),
            acceleration_world: self.gravity_world,
        };
        let triple = |i: usize| {
            let (before, after) = (node - i * self.lag, node + i * self.lag);
            PoseTriple::try_new(
                [pose(before)?, pose(node)?, pose(after)?],
                timeline.relative_s(node, before),
                timeline.relative_s(after, node),
                &observer,
            )
            .map_err(|_| Skip::HalfTurn)
        };
        let mut triples = [triple(1)?; LAGS];
        for (i, slot) in triples.iter_mut().enumerate().skip(1) {
            *slot = triple(i + 1)?;
        }
        Ok(variational_extrapolated(&triples))
    }

    /// Newton-Euler integrated over the window: change of momentum = impulse, linear in the parameters, with rates and
    /// velocities at the two ends only and no derivative.
    ///
    /// Described by an observer that moves and falls with the body at the node, about the origin's position there, and
    /// turned into the body axes of the node.
    fn momentum_row(&self, source: &Source<'_>, window: &[MotionSample], node: usize) -> Result<WrenchRow, Skip> {
        let timeline = source.timeline;
        let Some(poses) = window.iter().map(|sample| sample.world_from_body).collect::<Option<Vec<_>>>() else {
            return self.row_of_accelerations(source, window, node);
        };
        let first = node - self.lag;
        let center_velocity = window[self.lag].velocity_origin_world.ok_or(Skip::Missing)?;
        let center = poses[self.lag].translation.vector;
        let seen = |i: usize| {
            let time_s = timeline.relative_s(first + i, node);
            let moved = (center_velocity + self.gravity_world * (0.5 * time_s)) * time_s;
            (time_s, poses[i].translation.vector - center - moved)
        };
        let momentum = |i: usize| {
            let (time_s, position) = seen(i);
            let sample = &window[i];
            let rate = sample.rate_body.ok_or(Skip::Missing)?;
            let velocity =
                sample.velocity_origin_world.ok_or(Skip::Missing)? - center_velocity - self.gravity_world * time_s;
            let rotation = poses[i].rotation.to_rotation_matrix().into_inner();
            Ok(momentum_regressor(&rotation, &position, &velocity, &rate))
        };
        let (end, last) = (momentum(window.len() - 1)?, window.len() - 1);
        let change = end - momentum(0)?;
        let mut impulse = Wrench::zero();
        for i in 0..last {
            let (time_s, position) = seen(i);
            let (next_s, next_position) = seen(i + 1);
            let step_s = next_s - time_s;
            let (from, to) = (&poses[i].rotation, &poses[i + 1].rotation);
            let wrench = |j: usize| {
                let logged = window[j].wrench_body.or(self.wrench_optional.then(Wrench::zero)).ok_or(Skip::Missing)?;
                Ok(source.with_beside(logged, first + j, self.wrench_timing))
            };
            impulse += match self.wrench_timing {
                WrenchTiming::Held => {
                    // Mean attitude over the step at constant rate: the left Jacobian of the turn.
                    let turn = LieGroup::log(&from.between(to));
                    let mean = from.to_rotation_matrix().into_inner() * rotation_jacobian(&-turn);
                    let wrench = wrench(i)? + source.turned_slope(first + i, &turn, step_s);
                    let force = mean * wrench.force;
                    Wrench::new(mean * wrench.torque + ((position + next_position) * 0.5).cross(&force), force) * step_s
                }
                WrenchTiming::Sampled => {
                    let here = |i: usize, position: &Vector3<f64>| {
                        let (rotation, wrench) = (&poses[i].rotation, wrench(i)?);
                        let force = rotation * wrench.force;
                        Ok(Wrench::new(rotation * wrench.torque + position.cross(&force), force))
                    };
                    // Simpson's rule over pairs of steps; windows have an even number of steps.
                    let weight = step_s / 3.0;
                    let (inner, outer) = (2.0 * weight, weight);
                    let (a, b) = if i % 2 == 0 { (outer, inner) } else { (inner, outer) };
                    here(i, &position)? * a + here(i + 1, &next_position)? * b
                }
            };
        }
        let duration_s = timeline.relative_s(first + last, first);
        let body_from_world = poses[self.lag].rotation.inverse().to_rotation_matrix().into_inner();
        let turn = block_diagonal(&body_from_world) / duration_s;
        Ok(WrenchRow { index: node, regressor: turn * change, wrench: turn * impulse.to_vector() })
    }

    /// The same without any pose: rates turn the axes along, accelerations say what the origin does, and nothing may fall.
    ///
    /// `(R (w x h))' + m R a = R f`, `(R J w)' + R (h x a) = R tau`, integrated over the window in the axes of its node.
    fn row_of_accelerations(
        &self,
        source: &Source<'_>,
        window: &[MotionSample],
        node: usize,
    ) -> Result<WrenchRow, Skip> {
        let timeline = source.timeline;
        if self.gravity_world != Vector3::zeros() {
            return Err(Skip::Pose);
        }
        let (first, last) = (node - self.lag, window.len() - 1);
        let rates: Vec<_> = window.iter().map(|s| s.rate_body.ok_or(Skip::Pose)).collect::<Result<_, _>>()?;
        let step_s = |i: usize| timeline.relative_s(first + i + 1, first + i);
        // Axes of each sample in those of the first.
        let mut axes = vec![Matrix3::identity(); window.len()];
        let turns: Vec<Vector3<f64>> = (0..last).map(|i| (rates[i] + rates[i + 1]) * (0.5 * step_s(i))).collect();
        for i in 0..last {
            axes[i + 1] = axes[i] * Rotation3::new(turns[i]).into_inner();
        }
        // Regressor and right-hand side of the integrands at sample i, turned by `axes`.
        let acting = |i: usize, axes: &Matrix3<f64>| {
            let acceleration = window[i].acceleration_origin_body.ok_or(Skip::Pose)?;
            let wrench = window[i].wrench_body.or(self.wrench_optional.then(Wrench::zero)).ok_or(Skip::Missing)?;
            let wrench = source.with_beside(wrench, first + i, self.wrench_timing);
            let mut regressor = Regressor::zeros();
            regressor.fixed_view_mut::<3, 1>(3, 0).copy_from(&(axes * acceleration));
            regressor.fixed_view_mut::<3, 3>(0, 1).copy_from(&(axes * -skew(&acceleration)));
            Ok((regressor, block_diagonal(axes) * wrench.to_vector()))
        };
        let turning = |i: usize| momentum_regressor(&axes[i], &Vector3::zeros(), &Vector3::zeros(), &rates[i]);
        let (mut change, mut impulse) = (turning(last) - turning(0), Vector6::zeros());
        for i in 0..last {
            let step_s = step_s(i);
            match self.wrench_timing {
                WrenchTiming::Held => {
                    let mean = axes[i] * rotation_jacobian(&-turns[i]);
                    let (regressor, wrench) = acting(i, &mean)?;
                    let turned = block_diagonal(&mean) * source.turned_slope(first + i, &turns[i], step_s).to_vector();
                    change += regressor * step_s;
                    impulse += (wrench + turned) * step_s;
                    // Under a held wrench the acceleration changes by what turning adds, `w x (w x c)`.
                    let centripetal = |i: usize| skew(&rates[i]) * skew(&rates[i]);
                    let more = mean * (centripetal(i + 1) - centripetal(i)) * (-0.5 * step_s);
                    let mut of_first_moment = change.fixed_view_mut::<3, 3>(3, 1);
                    of_first_moment += more;
                }
                WrenchTiming::Sampled => {
                    // Simpson's rule over pairs of steps; windows have an even number of steps.
                    let weight = step_s / 3.0;
                    let (a, b) = if i % 2 == 0 { (weight, 2.0 * weight) } else { (2.0 * weight, weight) };
                    for (i, weight) in [(i, a), (i + 1, b)] {
                        let (regressor, wrench) = acting(i, &axes[i])?;
                        change += regressor * weight;
                        impulse += wrench * weight;
                    }
                }
            }
        }
        let turn = block_diagonal(&axes[self.lag].transpose()) / timeline.relative_s(first + last, first);
        Ok(WrenchRow { index: node, regressor: turn * change, wrench: turn * impulse })
    }
}

/// What rows are made of.
struct Source<'a> {
    record: &'a [MotionSample],
    timeline: &'a Timeline,
    beside: Option<&'a [UnloggedWrench]>,
}

impl Source<'_> {
    /// What the change of that which acts beside adds to its mean in axes that turn meanwhile.
    fn turned_slope(&self, sample: usize, turn: &Vector3<f64>, step_s: f64) -> Wrench<f64> {
        let Some(beside) = self.beside.and_then(|beside| beside.get(sample)) else { return Wrench::zero() };
        let turned = turn * (step_s / 12.0);
        Wrench::new(turned.cross(&beside.slope.torque), turned.cross(&beside.slope.force))
    }

    /// All that acts: at a sample, or in the mean over the step that begins with it.
    fn with_beside(&self, logged: Wrench<f64>, sample: usize, timing: WrenchTiming) -> Wrench<f64> {
        let Some(beside) = self.beside.and_then(|beside| beside.get(sample)) else { return logged };
        logged
            + match timing {
                WrenchTiming::Held => beside.mean,
                WrenchTiming::Sampled => beside.here,
            }
    }
}

/// Angular momentum about the observer's origin and linear momentum, observer axes, as a linear function of the body.
///
/// # Source
/// Equations of thesis 3.2 about a fixed point instead of the centre of mass, which would not be linear.
fn momentum_regressor(
    rotation: &Matrix3<f64>,
    position: &Vector3<f64>,
    velocity: &Vector3<f64>,
    rate: &Vector3<f64>,
) -> Regressor<f64> {
    let mut regressor = Regressor::zeros();
    let turned = rotation * skew(rate);
    regressor.fixed_view_mut::<3, 1>(0, 0).copy_from(&position.cross(velocity));
    regressor.fixed_view_mut::<3, 1>(3, 0).copy_from(velocity);
    regressor.fixed_view_mut::<3, 3>(0, 1).copy_from(&(skew(position) * turned - skew(velocity) * rotation));
    regressor.fixed_view_mut::<3, 3>(3, 1).copy_from(&turned);
    let (w, o) = (rate, 0.0);
    let inertia = SMatrix::<f64, 3, 6>::new(w.x, w.y, w.z, o, o, o, o, w.x, o, w.y, w.z, o, o, o, w.x, o, w.y, w.z);
    regressor.fixed_view_mut::<3, 6>(0, 4).copy_from(&(rotation * inertia));
    regressor
}

fn block_diagonal(rotation: &Matrix3<f64>) -> SMatrix<f64, 6, 6> {
    let mut m = SMatrix::<f64, 6, 6>::zeros();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation);
    m.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation);
    m
}
