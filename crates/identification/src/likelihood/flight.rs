//! Maximum likelihood with a model of the sensors in it: wander, filters, gains, biases, delays, scales of thrusters, levels.
//!
//! The multiple shooting of [`MaximumLikelihood`](super::MaximumLikelihood) with nine states of wander in the chain, one mean row per stream
//! and short segment, and the inertial unit's filters applied to the wrench and not to states.

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
mod unit;
mod weak_form;

pub use outcome::{FlightEstimate, FoundDelay, FoundLevels, Halves};
pub(crate) use stages::{Place, Stages};
pub use thrusters::{FoundFactor, FoundThrusters, Thrusters};

use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::estimator::{Estimator, EstimatorError, Finding};
use crate::motion::MotionSample;
use crate::sensing::Sensing;
use crate::units::Units;
use crate::{BodyScale, WrenchTiming};
use fit::Fit;
use grid::Grid;
use nalgebra::{Matrix3, Vector3};
use stages::Joint;

/// Share of the wrench that a search in which all went well explains at least.
const ASTRAY: f64 = 0.5;
/// Length of a segment where nobody says, s: shorter than what a loop of control takes to answer.
const SEGMENT_S: f64 = 0.128;
/// Fewest segments that anything is made of.
const FEWEST_SEGMENTS: usize = 16;
/// A thruster whose scale is further from one than this, in standard deviations, is a suspect.
const SUSPECT: f64 = 4.0;

/// Whether the body moves in a plane, the xy plane of both the inertial frame and the body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Plane {
    /// Where z, roll and pitch of the record are constant or move by their noise only.
    #[default]
    Found,
    /// It does.
    Planar,
    /// It does not.
    Free,
}

/// Maximum likelihood of the ten parameters from the log of a robot whose sensors wander, filter, lag, and are off in scale and bias.
///
/// Every stream may be missing: what is there is answered at its own bound. Poses may come more seldom than the rest. Where a level, a bias, a
/// gain or a delay is not known it is found, and what is stated is the covariance with all of them unknown.
///
/// Where nothing is said of the sensors and of thrusters, a record whose step, lever arm or wrench is far from those of a robot is taken in
/// units in which they are not.
///
/// # Source
/// The likelihood of thesis (2.4) under a held wrench u with white error e, for segments of M samples. The mean over a segment of what is
/// published, less the model, is white with variance s^2/M and the wander's own part:
/// position, attitude, velocity: mean(h(x) - y) + (w_j + w_(j+1))/2, where w_(j+1) = phi w_j + d n, phi = exp(-T/tau), d = s_w sqrt(1 - phi^2);
/// rate: (1 + K) [w - J^-1 (t_G - c x f_G - n_G)] + b, where G is what the filter still owes of the impulse;
/// acceleration: (1 + K) [f_H/m + a_H x (r - c) + (W_H - tr W_H)(r - c) - w x (w x r)] + b, where H is the filtered wrench and W = w w^T;
/// n is w x J w, and with momentum s in wheels w x (J w + s).
///
/// # Example
/// ```
/// use tumble_identification::{FlightLikelihood, IdentificationError};
/// let error = FlightLikelihood::default().estimate(&[]).unwrap_err();
/// assert!(matches!(error, IdentificationError::TooFewSamples { samples: 0, .. }));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FlightLikelihood {
    /// What the columns of the log are of the true motion.
    pub sensing: Sensing,
    /// When the logged wrench acts.
    pub wrench_timing: WrenchTiming,
    /// Gravitational acceleration, inertial axes, m/s^2; a table that carries the body takes it up.
    pub gravity_world: Vector3<f64>,
    /// Whether the body moves in a plane.
    pub plane: Plane,
    /// Thrusts behind the wrench; none where the wrench is what it says but for white errors.
    pub thrusters: Option<Thrusters>,
    /// White error of the logged wrench per sample and axis, N m and N, where it is known; where not, the wrench may also be off by what moves
    /// with it and leaves no trace, up to 1 % of it.
    pub wrench_noise: Option<[f64; 2]>,
    /// Length of a segment, s, at least a sample: longer gains little, and under feedback it must stay below the loop's own delay.
    pub segment_s: f64,
    /// Body to start from; it need not be near.
    pub start: InertialParameters<f64>,
}

impl Default for FlightLikelihood {
    fn default() -> Self {
        Self {
            sensing: Sensing::default(),
            wrench_timing: WrenchTiming::default(),
            gravity_world: Vector3::zeros(),
            plane: Plane::default(),
            thrusters: None,
            wrench_noise: None,
            segment_s: SEGMENT_S,
            start: InertialParameters::about_com(10.0, Vector3::zeros(), Matrix3::identity() * 0.15),
        }
    }
}

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
            thrusters.free(suspect);
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
