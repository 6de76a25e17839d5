//! An estimator from outside in the place of ours.

use tumble_identification::estimator::{Estimator, EstimatorError};
use tumble_identification::{MotionSample, Problem};

/// An estimator from outside, by its name.
pub struct OwnEstimator {
    /// What the result calls its method.
    pub name: &'static str,
    /// Makes it for the problem that a record poses.
    pub make: MakeEstimator,
}

/// An estimator of records, made for the problem that one poses.
pub type MakeEstimator = Box<
    dyn Fn(&Problem) -> Result<Box<dyn Estimator<Record = [MotionSample]> + Send + Sync>, EstimatorError> + Send + Sync,
>;
