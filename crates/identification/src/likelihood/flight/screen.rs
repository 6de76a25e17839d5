//! Thrusters that do not do what they are told, found before anything else is searched for.
//!
//! A thruster that is dead leaves so much that a search for the levels takes it for noise: of the wrench, of the wander, of the gyroscope. At
//! levels that are wide from the start and stay as they are the misfit stays a misfit, and of all thrusters the one is sought whose freedom
//! takes most of it away.

use super::fit::Fit;
use super::grid::Grid;
use super::thrusters::{FoundThrusters, SUSPECT};
use super::{FlightLikelihood, outcome};
use crate::error::IdentificationError;
use crate::motion::MotionSample;

/// A suspect is freed here where that takes away this share of all that is left. Less than that a search for the levels survives, and is left to
/// the judgement that follows it; and where something else than thrusters is wrong, no thruster takes so much of it away.
const MOST: f64 = 0.25;
/// Those that are freed have to explain the motion: at levels that are wide far less than one squared standard deviation a row is then left. More
/// is left where something else is wrong too, as on a table that is not even, and who is to blame is then not for this to say.
const EXPLAINED: f64 = 0.5;
/// By so much a suspect takes away more, in squared standard deviations, where it also gives a constant thrust, so that it is believed to.
const CONSTANT_COST: f64 = 2.0 * SUSPECT * SUSPECT;

/// So many of the hypotheses that a linear step ranks first are fitted.
const FITTED: usize = 3;

/// What a fit at wide levels says.
struct Coarse {
    /// What is left, in squared standard deviations, of so many rows.
    cost: f64,
    rows: usize,
    /// Where thrusters are further from what they should be than chance has them: which of them a linear step would take for free, or for stuck, the
    /// best first.
    suspects: Vec<(usize, bool)>,
}

impl FlightLikelihood {
    /// Frees thrusters that do not do what they are told, the worst first; which they are.
    pub(super) fn screened(
        &mut self,
        record: &[MotionSample],
        planar: bool,
    ) -> Result<Vec<usize>, IdentificationError> {
        let told = self.clone();
        let (mut freed, mut left_per_row) = (Vec::new(), 0.0);
        let Some(count) = self.thrusters.as_ref().map(super::Thrusters::len) else { return Ok(freed) };
        let Some(mut here) = self.coarse(record, planar, &freed)? else { return Ok(freed) };
        while freed.len() < count / 2 {
            let mut best: Option<(f64, usize, Self, Coarse)> = None;
            for &(suspect, stuck) in here.suspects.iter().take(FITTED) {
                let (mut of, mut with) = (self.clone(), freed.clone());
                with.push(suspect);
                if let Some(thrusters) = of.thrusters.as_mut() {
                    thrusters.free(suspect);
                    if stuck {
                        thrusters.open(suspect);
                    }
                }
                let Some(found) = of.coarse(record, planar, &with)? else { continue };
                let cost = found.cost + if stuck { CONSTANT_COST } else { 0.0 };
                if best.as_ref().is_none_or(|(lowest, ..)| cost < *lowest) {
                    best = Some((cost, suspect, of, found));
                }
            }
            let best = best.filter(|(cost, ..)| here.cost - cost > MOST * here.cost);
            let Some((left, suspect, of, found)) = best else { break };
            *self = of;
            freed.push(suspect);
            left_per_row = left / found.rows.max(1) as f64;
            here = found;
        }
        if left_per_row > EXPLAINED || planar && !freed.is_empty() && !self.leaves_less_than(&told, record)? {
            *self = told;
            freed.clear();
        }
        Ok(freed)
    }

    /// A fit at wide levels; none where there is no such fit.
    fn coarse(
        &self,
        record: &[MotionSample],
        planar: bool,
        freed: &[usize],
    ) -> Result<Option<Coarse>, IdentificationError> {
        let grid = Grid::try_new(record, self.wrench_timing, &self.added(record), self.thrusters.as_ref())?;
        let mut fit = Fit::aligned(self, grid, planar)?;
        let Ok(cost) = fit.run_coarsely() else { return Ok(None) };
        let Some(covariance) = outcome::covariance(&fit) else { return Ok(None) };
        let found = FoundThrusters::of(&fit, &covariance, freed);
        let is_tense = found.and_then(|found| found.worst(freed)).is_some();
        let suspects = if is_tense { fit.suspects(freed, CONSTANT_COST)? } else { Vec::new() };
        Ok(Some(Coarse { cost, rows: fit.weighing_rows(), suspects }))
    }
}
