//! The likelihood as a problem of argmin, for optimisers of one's own (feature `argmin`).

use super::calibration::Calibration;
use super::chain::Chain;
use super::coordinates::{Coordinates, ParameterStep};
use super::drive::Passage;
use super::elimination::{Indefinite, Schur};
use super::noise::Levels;
use super::record::Record;
use super::{MAX_ITERATIONS, MaximumLikelihood, nodes, not_excited, segment_length};
use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::motion::MotionSample;
use argmin::core::{CostFunction, Error, Gradient};
use nalgebra::{DVector, SMatrix, SVector, Vector3};

/// Largest component of a node's step at which the states count as found (rad, rad/s, m, m/s).
const SETTLED: f64 = 1e-8;

/// Half the weighted squares of all residuals of a record, as a function of the ten parameters: states and errors of the
/// wrench are found for each body as it is.
///
/// It is minus the logarithm of the likelihood but for a constant, with the noise as stated (or found from differences where
/// it is not), without nuisances and with the full weight of every sample. Its gradient is exact.
///
/// # Shape
/// Ten unknowns: how far the parameters are from [`MaximumLikelihood::start`], in a basis in which the record's information
/// about that body is the identity. A step of one is about a standard deviation.
///
/// A vector that is no body, or of another length, costs infinity.
pub struct LikelihoodCost {
    record: Record,
    gravity_world: Vector3<f64>,
    levels: Levels,
    node_window_s: f64,
    starts: Vec<usize>,
    start: Coordinates,
    /// Steps of the coordinates by those of the unknowns.
    basis: SMatrix<f64, 10, 10>,
}

impl MaximumLikelihood {
    /// The cost whose minimum [`estimate`](Self::estimate) finds, to be minimised by other means.
    ///
    /// # Errors
    /// As [`estimate`](Self::estimate), of the start.
    pub fn cost_function(&self, record: &[MotionSample]) -> Result<LikelihoodCost, IdentificationError> {
        let record = Record::try_new(record, self.wrench_timing, false)?;
        let levels = self.noise.as_ref().map_or_else(|| Levels::from_differences(&record).0, Levels::of);
        let start = Coordinates::of(&self.start);
        let length = self.segment_samples.unwrap_or_else(|| segment_length(&levels, &start, record.median_step_s));
        let starts = record.segments(length.max(1), &Passage::default());
        let basis = SMatrix::identity();
        let node_window_s = self.node_window_s;
        let mut cost =
            LikelihoodCost { record, gravity_world: self.gravity_world, levels, node_window_s, starts, start, basis };
        let information = cost.eliminated(&start)?.information.fixed_view::<10, 10>(0, 0).into_owned();
        let upper = information.cholesky().ok_or(not_excited(Indefinite))?.l().transpose();
        cost.basis = upper.try_inverse().ok_or(not_excited(Indefinite))?;
        Ok(cost)
    }
}

impl LikelihoodCost {
    /// The body of these unknowns; `None` where they are none or not ten.
    pub fn body(&self, unknowns: &[f64]) -> Option<InertialParameters<f64>> {
        Some(self.coordinates(unknowns)?.parameters())
    }

    fn coordinates(&self, unknowns: &[f64]) -> Option<Coordinates> {
        let unknowns: &[f64; 10] = unknowns.try_into().ok()?;
        let step = self.basis * SVector::from(*unknowns);
        Some(self.start.advanced(&DVector::from_column_slice(step.as_slice()))).filter(Coordinates::is_body)
    }

    /// The quadratic in the parameters about a body, states and errors of the wrench found.
    fn eliminated(&self, eta: &Coordinates) -> Result<Schur, IdentificationError> {
        let calibration = Calibration::new(&[], &[]);
        let nodes = nodes::from_poses(&self.record, &self.starts, self.node_window_s, &eta.center);
        let starts = self.starts.clone();
        let mut chain = Chain::<32>::new(self.record.clone(), self.gravity_world, starts, nodes, &calibration);
        let mut decrement = f64::INFINITY;
        for _ in 0..MAX_ITERATIONS {
            chain.sweep(eta, &calibration, &self.levels, None);
            let schur = chain.eliminate(&self.levels).map_err(not_excited)?;
            decrement = chain.follow(&ParameterStep::none(eta, schur.gradient.len()));
            if decrement < SETTLED {
                return Ok(schur);
            }
        }
        Err(IdentificationError::LikelihoodNotConverged { iterations: MAX_ITERATIONS, decrement })
    }
}

impl CostFunction for LikelihoodCost {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, unknowns: &Vec<f64>) -> Result<f64, Error> {
        let found = self.coordinates(unknowns).and_then(|eta| self.eliminated(&eta).ok());
        Ok(found.map_or(f64::INFINITY, |schur| 0.5 * schur.constant))
    }
}

impl Gradient for LikelihoodCost {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, unknowns: &Vec<f64>) -> Result<Vec<f64>, Error> {
        let eta = self.coordinates(unknowns).ok_or(not_excited(Indefinite))?;
        let schur = self.eliminated(&eta)?;
        Ok((self.basis.transpose() * -schur.gradient.fixed_rows::<10>(0)).as_slice().to_vec())
    }
}
