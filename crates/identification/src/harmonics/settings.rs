//! How a record of a periodic motion is read.

use super::selection::SelectionRule;
use crate::dynamics::WrenchBox;
use crate::fourier::AttitudeChart;
use crate::lie::Pose;
use crate::{Noise, WrenchTiming};
use nalgebra::Vector3;

/// Harmonics tried beyond those of the reference unless told otherwise.
const HARMONICS_BEYOND: usize = 17;
/// Share of time at a limit beyond which the motion counts as no short Fourier series.
const SATURATED: f64 = 0.01;

/// What turns an averaged period, or the record behind it, into parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum HarmonicEstimator {
    /// Weighted least squares with the regressor of the fitted motion: the thesis's.
    LeastSquares,
    /// Maximum likelihood of coefficients and parameters together: far more accurate where the noise of the poses limits. Where
    /// the wrench asks for more harmonics than the series has, the trajectory likelihood answers.
    #[default]
    Likelihood,
    /// [`identify`](crate::identify()) with `maximum-likelihood` on the whole record, sample by sample, with the wrench that acted; needs no
    /// periodic motion.
    TrajectoryLikelihood,
}

/// How [`identify_periodic`](super::identify_periodic) works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HarmonicSettings {
    /// Period of the motion, s.
    pub period_s: f64,
    /// Time from the first sample to the start of the first cycle, s; taken at the nearest sample.
    pub start_s: f64,
    /// Pose in whose frame the motion's coordinates are. A motion designed in Euler angles is band-limited in this frame only.
    pub world_from_start: Pose<f64>,
    /// Coordinates of the attitude.
    pub chart: AttitudeChart,
    /// When the logged wrench acts.
    pub wrench_timing: WrenchTiming,
    /// Gravitational acceleration, inertial axes, m/s^2.
    pub gravity_world: Vector3<f64>,
    /// Harmonics of the reference motion: the fewest tried.
    pub reference_harmonics: usize,
    /// The most harmonics tried, where the sampling allows so many.
    pub largest_harmonics: usize,
    /// What least squares chooses the number of harmonics by; the likelihoods have their own, see [`likeliest_harmonics`](super::likeliest_harmonics).
    pub selection: SelectionRule,
    /// Leading cycles to leave out; `None` finds the transient.
    pub dropped_cycles: Option<usize>,
    /// Noise of one sample where it is known (position, attitude, torque, force); `None` takes the scatter between cycles.
    pub noise: Option<Noise>,
    /// Limits of the actuators where they are known; `None` looks for them.
    pub limits: Option<WrenchBox>,
    /// Share of time at a limit above which the trajectory likelihood takes over; one leaves the estimator as asked for.
    pub largest_saturation: f64,
    /// What estimates the parameters.
    pub estimator: HarmonicEstimator,
}

impl HarmonicSettings {
    /// For a reference motion of this period with this many harmonics; up to seventeen more are tried.
    pub fn new(period_s: f64, reference_harmonics: usize) -> Self {
        Self {
            period_s,
            start_s: 0.0,
            world_from_start: Pose::identity(),
            chart: AttitudeChart::default(),
            wrench_timing: WrenchTiming::default(),
            gravity_world: Vector3::zeros(),
            reference_harmonics,
            largest_harmonics: reference_harmonics + HARMONICS_BEYOND,
            selection: SelectionRule::default(),
            dropped_cycles: None,
            noise: None,
            limits: None,
            largest_saturation: SATURATED,
            estimator: HarmonicEstimator::default(),
        }
    }
}
