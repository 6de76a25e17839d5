//! Whether the parts of a tree are identified: by numbers counted here, weighed by the judge of bodies.

use super::finding::{DynEstimator, DynFinding};
use super::layout::BODY;
use super::torque_rows::{Drive, JointNuisance};
use super::tree_estimator::{Regressors, TreeEstimate, TreeEstimator, TreeRecord};
use super::tree_part::known_part;
use crate::body_scale::BodyScale;
use crate::error::IdentificationError;
use crate::estimator::{Counted, EstimatorError, Evidence, Finding, Judge, Verdict};
use nalgebra::DMatrix;

/// A mean square of residuals so many standard deviations above one is not chance.
const BEYOND_CHANCE: f64 = 6.0;
/// Fewer stretches of dependent errors than so many for each number say too little of its variance to compare halves by.
const STRETCHES_PER_NUMBER: f64 = 5.0;
/// What a joint has that nobody may have told, and no payload looks like. A rotor looks like the bodies it turns.
const UNTOLD: [JointNuisance; 3] =
    [JointNuisance::ViscousFriction, JointNuisance::CoulombFriction, JointNuisance::Offset];

impl TreeEstimator {
    /// Whether what was identified of these records may be used: the payloads among the parts, where there are any, else all that the
    /// records tell apart of the others.
    ///
    /// Counted are the share of the motors' forces that is explained; what is left, where its noise was told; the widths in units of the
    /// bodies; the two halves of the records against each other; and a second finding, whose joints rub and whose motors have gains that
    /// nobody told.
    ///
    /// # Errors
    /// As [`identify`](Self::identify) for records that are none; [`EstimatorError::Refused`] for an estimate that is none.
    pub fn verdict(&self, records: &[TreeRecord], found: &TreeEstimate) -> Result<Verdict, EstimatorError> {
        let own = found.finding()?;
        let (mut evidence, mean_nis) = self.residuals(records, found)?;
        let payloads: Vec<usize> = (0..self.parts.len()).filter(|part| !self.parts[*part].whole).collect();
        let judge = Judge::new(BodyScale::UNIT);
        let all = 0..BODY * self.parts.len();
        let asked = match (payloads.first(), payloads.last()) {
            (Some(first), Some(last)) => BODY * first..BODY * (last + 1),
            _ => all,
        };
        let findings = |of: &Self, records: &[TreeRecord]| of.estimate(records).ok();
        if let Some([first, second]) = self.halves(records, asked.len()) {
            let halves = findings(self, &first).zip(findings(self, &second));
            let apart = halves.and_then(|(first, second)| first.distance(&second, asked.clone()));
            evidence.halves = apart.filter(|apart| *apart > judge.chi_square).unwrap_or(0.0);
        }
        let other = self.freer().and_then(|freer| findings(&freer, records));
        let chi_square = other.and_then(|other| own.distance(&other, asked.clone()));
        if payloads.is_empty() {
            let variances = own.variances(asked.clone());
            let rank = variances.iter().filter(|variance| **variance < judge.known * judge.known).count();
            // Where links of a tree cannot be told apart by any motion, only what can is asked for.
            let asked = if variances.is_empty() { asked.len() } else { variances.len() };
            return Ok(judge.weigh(&Counted { rank, asked, mean_nis, chi_square, ..Counted::default() }, &evidence));
        }
        for part in payloads {
            let counted = count(part, found, &own, &judge)?;
            let verdict = judge.weigh(&Counted { mean_nis, chi_square, ..counted }, &evidence);
            if !verdict.is_identified() {
                return Ok(verdict);
            }
        }
        Ok(Verdict::Identified)
    }

    /// The motors' forces and what is left of them; and the mean square of what is left of all rows whose noise was told, where it is not
    /// chance.
    fn residuals(
        &self,
        records: &[TreeRecord],
        found: &TreeEstimate,
    ) -> Result<(Evidence, Option<f64>), IdentificationError> {
        let (mut given, mut left) = (0.0, 0.0);
        let (mut squares, mut told) = (0.0, 0_usize);
        let noise_told = !self.is_plain() && self.torque.as_ref().is_none_or(|torque| torque.std.is_some());
        let regressors = if self.is_plain() { Regressors::Measured } else { Regressors::Fitted };
        let (known, layout) = (known_part(&self.tree, &self.parts), self.layout(records)?);
        let at = (&found.links.unknowns, regressors);
        self.each_instant(&known, &layout, records, at, &found.motor_std, &mut |rows| {
            for (row, joint) in rows.joints.iter().enumerate() {
                let square = rows.residual[row] * rows.residual[row];
                if joint.is_some() {
                    given += rows.given[row] * rows.given[row];
                    left += square;
                }
                if joint.is_none() || noise_told {
                    squares += square;
                    told += 1;
                }
            }
            Ok(())
        })?;
        let freedom = told.saturating_sub(found.base.rank()) as f64;
        let chance = freedom + BEYOND_CHANCE * (2.0 * freedom).sqrt();
        Ok((Evidence::of_sums(given, left), (squares > chance && freedom > 0.0).then(|| squares / freedom)))
    }

    /// Both halves of each record, where both can be compared.
    fn halves(&self, records: &[TreeRecord], numbers: usize) -> Option<[Vec<TreeRecord>; 2]> {
        let pushed = records.iter().flat_map(|record| &record.samples).any(|sample| sample.base_wrench.is_some());
        // What is told of the momentum is that at the start.
        if pushed && self.momentum.is_some_and(|form| form.known.is_some()) {
            return None;
        }
        let seconds = |record: &TreeRecord| {
            record.samples.first().zip(record.samples.last()).map_or(0.0, |(first, last)| last.time_s - first.time_s)
        };
        let seconds: f64 = records.iter().map(seconds).sum();
        if seconds < self.dependence_s * STRETCHES_PER_NUMBER * numbers as f64 {
            return None;
        }
        let cut = |second: bool| {
            let part = |record: &TreeRecord| {
                let (first, rest) = record.samples.split_at(record.samples.len() / 2);
                TreeRecord { samples: if second { rest } else { first }.to_vec(), grasped: record.grasped }
            };
            records.iter().map(part).collect()
        };
        Some([cut(false), cut(true)])
    }

    /// The same with friction and gains that nobody told; `None` where all are asked for, or none are used.
    fn freer(&self) -> Option<Self> {
        let torque = self.torque.as_ref().filter(|_| !self.is_plain())?;
        let mut freer = torque.clone();
        freer.nuisances.extend(UNTOLD.into_iter().filter(|nuisance| !torque.nuisances.contains(nuisance)));
        // Where links are asked for, a factor of all torques is one of all masses.
        if self.parts.iter().all(|part| !part.whole) {
            let joints = self.tree.joints();
            let gain = match &torque.drive {
                Drive::Force => vec![1.0; joints],
                Drive::Current { gain, .. } => gain.clone(),
            };
            freer.drive = Drive::Current { gain, std: vec![f64::INFINITY; joints] };
        }
        (freer != *torque).then(|| Self { torque: Some(freer), ..self.clone() })
    }
}

/// What is counted of one part by itself.
fn count(part: usize, found: &TreeEstimate, own: &DynFinding, judge: &Judge) -> Result<Counted, EstimatorError> {
    let column = found.base.layout().body_column(part);
    let point = own.point().fixed_rows::<BODY>(column).into_owned();
    let ten = DMatrix::from_fn(BODY, own.point().len(), |i, j| f64::from(u8::from(j == column + i)));
    let Some(covariance) = found.covariance_of(&ten)? else {
        let variances = own.variances(column..column + BODY);
        let rank = variances.iter().filter(|variance| **variance < judge.known * judge.known).count();
        return Ok(Counted { rank, asked: BODY, ..Counted::default() });
    };
    let sizes = BodyScale::of(&point)?.parameter_magnitudes();
    let covariance = covariance.fixed_view::<BODY, BODY>(0, 0).into_owned();
    // Of the cone that the estimate was kept in: another scale has another floor.
    let margin = found.links.margins.get(part).copied().unwrap_or(f64::NAN);
    Ok(judge.count(&Finding::of_covariance(point, &covariance, sizes)?, &sizes, None, |_| margin)?)
}
