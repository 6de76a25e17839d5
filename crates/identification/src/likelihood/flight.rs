//! Maximum likelihood with a model of the sensors in it: wander, filters, gains, biases, delays, scales of thrusters, levels.
//!
//! The multiple shooting of [`MaximumLikelihood`](super::MaximumLikelihood) with nine states of wander in the chain, six of errors of the wrench
//! that last, one mean row per stream and short segment, and the inertial unit's filters applied to the wrench and not to states.
//!
//! Under feedback the motion depends on earlier errors of the wrench. A likelihood of the right errors is unbiased there, one of white errors is
//! not: errors that last, as those of thrusts do, are states of their own, as long as the record is likelier with them.

mod coherent;
mod eliminate;
mod fit;
mod grid;
mod layout;
mod levels;
mod nodes;
mod outcome;
mod screen;
mod stages;
mod sweep;
#[cfg(test)]
mod tests;
mod thrusters;
mod tiles;
mod told;
mod undescribed;
mod unit;
mod weak_form;

pub use levels::FoundLevels;
pub use outcome::{FlightEstimate, FoundDelay, Halves};
pub(crate) use stages::{Place, Stages};
pub use thrusters::{FoundFactor, FoundThrusters, Thrusters};
pub use told::{FlightLikelihood, Plane};

use crate::BodyScale;
use crate::error::IdentificationError;
use crate::estimator::{Estimator, EstimatorError, Finding};
use crate::motion::MotionSample;
use crate::sensing::Sensing;
use crate::units::Units;
use fit::Fit;
use grid::Grid;
use nalgebra::Vector3;
use stages::Joint;

/// Share of the wrench that a search in which all went well explains at least.
const ASTRAY: f64 = 0.5;

impl FlightLikelihood {
    fn samples(&self, step_s: f64) -> usize {
        grid::whole(self.segment_s / step_s).max(1)
    }

    /// Whether a record is taken for one of a body on a table.
    pub(crate) fn is_planar(&self, record: &[MotionSample]) -> bool {
        match self.plane {
            Plane::Planar => true,
            Plane::Free => false,
            Plane::Found => crate::identify::is_in_xy_plane(record),
        }
    }

    /// The most likely body.
    ///
    /// # Errors
    /// [`IdentificationError::ImpossibleSensing`] for sensors or thrusters that cannot be; [`IdentificationError::TooFewSamples`],
    /// [`IdentificationError::TimesNotIncreasing`], [`IdentificationError::NotFinite`], [`IdentificationError::MissingColumn`] (no wrench at
    /// all, or neither attitudes nor rates) for a record that cannot be used;
    /// [`IdentificationError::LikelihoodNotConverged`], [`IdentificationError::Indefinite`].
    pub fn estimate(&self, record: &[MotionSample]) -> Result<FlightEstimate, IdentificationError> {
        self.sensing.check()?;
        let refused = |what: &'static str, value: f64| Err(IdentificationError::ImpossibleSensing { what, value });
        if !(self.segment_s > 0.0 && self.segment_s.is_finite()) {
            return refused("length of a segment, s", self.segment_s);
        }
        if let Some(level) = self.wrench_noise.iter().flatten().find(|level| !(**level > 0.0 && level.is_finite())) {
            return refused("error of the wrench", *level);
        }
        if let Some(thrusters) = self.thrusters.as_ref().filter(|t| t.samples() != record.len()) {
            return Err(IdentificationError::RecordShape {
                rows: thrusters.samples(),
                columns: thrusters.len(),
                expected_rows: record.len(),
                expected_columns: thrusters.len(),
            });
        }
        // What is known of sensors of which nobody said anything is of ordinary ones: a record in other units is taken in ordinary ones.
        if self.sensing == Sensing::default() && self.thrusters.is_none() {
            let units = Units::of_record(record);
            if let Some(scaled) = units.record(record) {
                let told = Self {
                    gravity_world: units.gravity(&self.gravity_world),
                    wrench_noise: self
                        .wrench_noise
                        .map(|[torque, force]| [torque * units.force() * units.length(), force * units.force()]),
                    ..self.clone()
                };
                return Ok(told.estimate_as_told(&scaled)?.in_units(&units.back()));
            }
        }
        self.estimate_as_told(record)
    }

    /// What a publisher of accelerations added to them.
    fn added(&self, record: &[MotionSample]) -> Vector3<f64> {
        let usual = if self.is_planar(record) { Vector3::zeros() } else { self.gravity_world };
        self.sensing.gravity_added_world_m_s2.map_or(usual, Vector3::from)
    }

    fn estimate_as_told(&self, record: &[MotionSample]) -> Result<FlightEstimate, IdentificationError> {
        let mut of = self.clone();
        let freed = of.screened(record, self.is_planar(record))?;
        Ok(of.fitted_from(record, freed)?.0)
    }

    /// The same where some thrusters are free from the start.
    fn fitted_from(
        &self,
        record: &[MotionSample],
        mut freed: Vec<usize>,
    ) -> Result<(FlightEstimate, Joint), IdentificationError> {
        let planar = self.is_planar(record);
        let added = self.added(record);
        let mut of = self.clone();
        // What is spent weighs by the mass, which is then to be found first.
        let mut mass_kg = None;
        loop {
            let fitted = |coarsely: bool| {
                let mut grid = Grid::try_new(record, self.wrench_timing, &added, of.thrusters.as_ref())?;
                if let Some((thrusters, mass_kg)) = of.thrusters.as_ref().zip(mass_kg) {
                    grid.lighten(thrusters, mass_kg);
                }
                let mut fit = Fit::aligned(&of, grid, planar)?;
                if coarsely {
                    fit.run_coarsely()?;
                }
                fit.run()?;
                Ok::<_, IdentificationError>((outcome::of(&mut fit, &freed)?, Joint::of(&fit)))
            };
            // What is left of a wrench that is off by much is taken for noise of everything where levels begin narrow.
            let (found, joint) = match fitted(false) {
                Ok(near) if near.0.explained >= ASTRAY => near,
                Ok(near) => fitted(true).ok().filter(|far| far.0.explained > near.0.explained).unwrap_or(near),
                Err(_) => fitted(true)?,
            };
            let spends = of.thrusters.as_ref().is_some_and(Thrusters::is_spent);
            if spends && mass_kg.is_none() {
                mass_kg = Some(found.parameters.mass);
                of.start = found.parameters;
                continue;
            }
            let suspect = found.thrusters.as_ref().and_then(|found| found.worst(&freed));
            let (Some(suspect), Some(thrusters)) = (suspect, of.thrusters.as_mut()) else {
                return Ok((found, joint));
            };
            if freed.len() >= thrusters.len() / 2 {
                return Ok((found, joint));
            }
            let healthy = thrusters.clone();
            thrusters.free(suspect);
            let told = Self { thrusters: Some(healthy), ..of.clone() };
            if planar && told.weak_form_as_told(record)?.is_some() && !of.leaves_less_than(&told, record)? {
                return Ok((found, joint));
            }
            freed.push(suspect);
            of.start = found.parameters;
        }
    }
}

impl Estimator for FlightLikelihood {
    type Record = [MotionSample];

    fn estimate(&self, record: &[MotionSample]) -> Result<Finding, EstimatorError> {
        let found = FlightLikelihood::estimate(self, record)?;
        let parameters = found.parameters.to_vector();
        let magnitudes = BodyScale::of(&parameters)?.parameter_magnitudes();
        let known = Finding::of_information(found.information, magnitudes);
        Ok(if found.is_determined() { known.at(parameters) } else { known })
    }
}
