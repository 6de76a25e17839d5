//! From samples to rows `regressor * parameters = wrench`.

use super::Settings;
use super::timeline::Timeline;
use crate::WrenchTiming;
use crate::error::{Column, IdentificationError};
use crate::lie::{LieGroup, Wrench, rotation_jacobian, skew};
use crate::motion::MotionSample;
use crate::regressors::{Extrapolation, ObserverFrame, PoseTriple, Regressor, variational_extrapolated};
use crate::weighted_least_squares::WrenchRow;
use nalgebra::{Matrix3, SMatrix, Vector3};

/// Which equations tie the motion to the parameters in rows that are linear in them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
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
    /// Samples that take part in a row.
    pub(super) used: usize,
}

enum Skip {
    Unequal,
    Missing,
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
        let mut result =
            Rows { all: Vec::new(), windows: 0, skipped_unequal: 0, skipped_missing: 0, skipped_half_turn: 0, used: 0 };
        let (stride, mut used_until) = (self.stride(), 0);
        for node in reach..timeline.len().saturating_sub(reach) {
            if (node - reach) % stride > 1 {
                continue;
            }
            let (first, last) = (node - reach, node + reach);
            if !timeline.without_gap(first, last) {
                continue;
            }
            result.windows += 1;
            match self.row(record, timeline, node) {
                Ok(row) => {
                    result.all.push(row);
                    result.used += (last + 1).saturating_sub(used_until.max(first));
                    used_until = last + 1;
                }
                Err(Skip::Unequal) => result.skipped_unequal += 1,
                Err(Skip::Missing) => result.skipped_missing += 1,
                Err(Skip::HalfTurn) => result.skipped_half_turn += 1,
            }
        }
        if result.all.is_empty() {
            return Err(self.reason(record, &result));
        }
        Ok(result)
    }

    fn reason(&self, record: &[MotionSample], found: &Rows) -> IdentificationError {
        if !self.wrench_optional && record.iter().all(|sample| sample.wrench_body.is_none()) {
            IdentificationError::MissingColumn(Column::Wrench)
        } else if self.regression == Regression::NewtonEuler && record.iter().all(|sample| sample.rate_body.is_none()) {
            IdentificationError::MissingColumn(Column::Rate)
        } else if self.regression == Regression::NewtonEuler && record.iter().all(|s| s.velocity_origin_world.is_none())
        {
            IdentificationError::MissingColumn(Column::Velocity)
        } else if found.skipped_half_turn > 0 {
            IdentificationError::HalfTurns { windows: found.skipped_half_turn }
        } else {
            IdentificationError::TooFewSamples { samples: record.len(), needed: 2 * self.reach() + 1 }
        }
    }

    fn row(&self, record: &[MotionSample], timeline: &Timeline, node: usize) -> Result<WrenchRow, Skip> {
        let reach = self.reach();
        let window = &record[node - reach..=node + reach];
        if self.regression == Regression::NewtonEuler {
            return self.momentum_row(window, timeline, node);
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
        let wrench = wrenches
            .and_then(|wrenches| self.wrench_timing.node_wrench(&times_s, &wrenches, self.lag, self.extrapolation()))
            .ok_or(Skip::Missing)?;
        Ok(WrenchRow { index: node, regressor, wrench: wrench.to_vector() })
    }

    fn extrapolated<const LAGS: usize>(
        &self,
        record: &[MotionSample],
        timeline: &Timeline,
        node: usize,
    ) -> Result<Regressor<f64>, Skip> {
        let pose = |index: usize| &record[index].world_from_body;
        let (before, after) = (node - self.lag, node + self.lag);
        // An observer that moves with the body keeps the increments, and with them the error, small.
        let travelled = pose(after).translation.vector - pose(before).translation.vector;
        let observer = ObserverFrame {
            velocity_world: travelled / timeline.relative_s(after, before),
            acceleration_world: self.gravity_world,
        };
        let triple = |i: usize| {
            let (before, after) = (node - i * self.lag, node + i * self.lag);
            PoseTriple::try_new(
                [pose(before), pose(node), pose(after)],
                timeline.relative_s(node, before),
                timeline.relative_s(after, node),
                &observer,
            )
        };
        let mut triples = [triple(1).map_err(|_| Skip::HalfTurn)?; LAGS];
        for (i, slot) in triples.iter_mut().enumerate().skip(1) {
            *slot = triple(i + 1).map_err(|_| Skip::HalfTurn)?;
        }
        Ok(variational_extrapolated(&triples))
    }

    /// Newton-Euler integrated over the window: change of momentum = impulse, linear in the parameters, with rates and
    /// velocities at the two ends only and no derivative.
    ///
    /// Described by an observer that moves and falls with the body at the node, about the origin's position there, and
    /// turned into the body axes of the node.
    fn momentum_row(&self, window: &[MotionSample], timeline: &Timeline, node: usize) -> Result<WrenchRow, Skip> {
        let first = node - self.lag;
        let middle = &window[self.lag];
        let (center, center_velocity) =
            (middle.world_from_body.translation.vector, middle.velocity_origin_world.ok_or(Skip::Missing)?);
        let seen = |i: usize| {
            let time_s = timeline.relative_s(first + i, node);
            let moved = (center_velocity + self.gravity_world * (0.5 * time_s)) * time_s;
            (time_s, window[i].world_from_body.translation.vector - center - moved)
        };
        let momentum = |i: usize| {
            let (time_s, position) = seen(i);
            let sample = &window[i];
            let rate = sample.rate_body.ok_or(Skip::Missing)?;
            let velocity =
                sample.velocity_origin_world.ok_or(Skip::Missing)? - center_velocity - self.gravity_world * time_s;
            let rotation = sample.world_from_body.rotation.to_rotation_matrix().into_inner();
            Ok(momentum_regressor(&rotation, &position, &velocity, &rate))
        };
        let (end, last) = (momentum(window.len() - 1)?, window.len() - 1);
        let change = end - momentum(0)?;
        let mut impulse = Wrench::zero();
        for i in 0..last {
            let (time_s, position) = seen(i);
            let (next_s, next_position) = seen(i + 1);
            let step_s = next_s - time_s;
            let (from, to) = (&window[i].world_from_body.rotation, &window[i + 1].world_from_body.rotation);
            let wrench =
                |j: usize| window[j].wrench_body.or(self.wrench_optional.then(Wrench::zero)).ok_or(Skip::Missing);
            impulse += match self.wrench_timing {
                WrenchTiming::Held => {
                    // Mean attitude over the step at constant rate: the left Jacobian of the turn.
                    let turn = LieGroup::log(&from.between(to));
                    let mean = from.to_rotation_matrix().into_inner() * rotation_jacobian(&-turn);
                    let wrench = wrench(i)?;
                    let force = mean * wrench.force;
                    Wrench::new(mean * wrench.torque + ((position + next_position) * 0.5).cross(&force), force) * step_s
                }
                WrenchTiming::Sampled => {
                    let here = |i: usize, position: &Vector3<f64>| {
                        let (rotation, wrench) = (&window[i].world_from_body.rotation, wrench(i)?);
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
        let body_from_world = middle.world_from_body.rotation.inverse().to_rotation_matrix().into_inner();
        let turn = block_diagonal(&body_from_world) / duration_s;
        Ok(WrenchRow { index: node, regressor: turn * change, wrench: turn * impulse.to_vector() })
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
