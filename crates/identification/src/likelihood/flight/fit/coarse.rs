//! A fit at levels that are as wide as what is sought, none of them searched for.

use super::super::FlightLikelihood;
use super::super::layout::BODY;
use super::{Fit, WRENCH_FLOOR, indefinite, solved};
use crate::error::IdentificationError;
use nalgebra::DMatrix;

/// Error of one sample of the wrench as a share of its root mean square: a thruster that is dead or stuck is off for seconds, and over these it
/// counts as much more than it does in a sample.
const WIDE: f64 = 0.1;
/// Sweeps at most, and the squared length of the last step in standard deviations.
const SWEEPS: usize = 12;
const AT_REST: f64 = 1.0;

impl Fit<'_> {
    /// Fits all but the levels; minus twice the logarithm of the likelihood there, but for what levels alone say.
    pub(in super::super) fn run_coarsely(&mut self) -> Result<f64, IdentificationError> {
        if self.of.wrench_noise.is_none() {
            self.levels.wrench = core::array::from_fn(|part| WIDE * self.floors[part] / WRENCH_FLOOR[part]);
        }
        for sweep in 0..SWEEPS {
            self.sweeps = sweep + 1;
            self.linearise();
            let (states, noises) = self.step()?;
            self.advance(&states, &noises);
            let moved = sweep > 0 && self.move_streams();
            if !moved && sweep > 1 && self.decrement < AT_REST {
                break;
            }
        }
        self.linearise();
        Ok(self.likelihood().ok_or(indefinite(self.free.len()))?.cost)
    }

    /// Which thrusters, taken for free (`false`) or stuck (`true`), would leave least here by a step that is linear, the best first; `stuck_cost` is
    /// what a constant thrust has to take away more.
    pub(in super::super) fn suspects(
        &self,
        freed: &[usize],
        stuck_cost: f64,
    ) -> Result<Vec<(usize, bool)>, IdentificationError> {
        let Some(told) = self.of.thrusters.as_ref() else { return Ok(Vec::new()) };
        let all = told.all_suspect();
        let of = FlightLikelihood { thrusters: Some(all), ..self.of.clone() };
        let mut wide = self.beside(&of, |_| vec![1.0])?;
        let (information, gradient) = wide.says()?;
        // Free parameters of this fit as the wide one has them, and their priors.
        let known: Vec<(usize, f64)> = self
            .free
            .iter()
            .zip(&self.prior)
            .filter_map(|(column, prior)| Some((wide.column_of(self.place_in(&wide, *column))?, *prior)))
            .collect();
        let pull = |i: usize, prior: f64| prior * (wide.eta[wide.free[i]] - wide.mean[wide.free[i]]);
        // Cost after a step of these parameters alone, less that of this point without priors.
        let left = |columns: &[(usize, f64)]| {
            let n = columns.len();
            let joint = DMatrix::from_fn(n, n, |i, j| {
                let prior = if i == j { columns[i].1 } else { 0.0 };
                information[(columns[i].0, columns[j].0)] + prior
            });
            let right = DMatrix::from_fn(n, 1, |i, _| gradient[columns[i].0] + pull(columns[i].0, columns[i].1));
            let held: f64 = columns
                .iter()
                .filter(|(_, prior)| *prior > 0.0)
                .map(|(i, prior)| pull(*i, *prior).powi(2) / prior)
                .sum();
            solved(&joint, &right).map(|step| held - right.dot(&step))
        };
        let mut ranked = Vec::new();
        for suspect in (0..told.len()).filter(|suspect| !freed.contains(suspect)) {
            let at = |parameter: usize| wide.column_of(BODY + parameter).map(|i| (i, wide.prior[i]));
            let scale = at(suspect);
            let mut columns: Vec<(usize, f64)> = known
                .iter()
                .copied()
                .filter(|(i, _)| scale.is_none_or(|(scale, _)| scale != *i))
                .chain(scale)
                .collect();
            if let Some(cost) = left(&columns) {
                ranked.push((cost, suspect, false));
            }
            let constant = of.thrusters.as_ref().and_then(|all| at(all.constant_of(suspect)?));
            columns.extend(constant);
            if let (Some(cost), Some(_)) = (left(&columns), constant) {
                ranked.push((cost + stuck_cost, suspect, true));
            }
        }
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(ranked.into_iter().map(|(_, suspect, stuck)| (suspect, stuck)).collect())
    }

    /// Rows that weigh anything.
    pub(in super::super) fn weighing_rows(&self) -> usize {
        self.chain.weights.iter().flatten().filter(|weight| **weight > 0.0).count()
    }
}
