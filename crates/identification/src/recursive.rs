//! Estimators that take one observation at a time: fixed size, no allocation, every update judged by its innovation.
//!
//! | use it when | estimator |
//! |---|---|
//! | the model is linear and well scaled | [`RecursiveLeastSquares`] |
//! | the model is linear and the prior weak | [`SquareRootFilter`] |
//! | ten numbers must be a body after every update | [`RecursiveSdp`] |
//! | linear parameters drift, or a linear state is wanted | [`KalmanFilter`] |
//! | the model is not linear | [`ExtendedKalmanFilter`], [`UnscentedKalmanFilter`] with a [`FilterModel`] |
//!
//! All of them, and [`FixedLag`](crate::FixedLag), are a [`RecursiveEstimator`](crate::estimator::RecursiveEstimator);
//! [`Constrained`](crate::estimator::Constrained) puts any of them under any constraint. Their own `update_rows` gives the matrices of the
//! innovation too. [`ChangeDetector`] watches any of them for a body that is no longer the same. The models here: [`PrincipalMotion`], mass and principal moments from accelerations; [`JointMotion`], motion and ten
//! parameters from poses and what else is measured. All scalars are `f64`: decisions are made here.

mod belief;
mod change_detection;
mod chi_square_gate;
#[cfg(feature = "dual")]
mod differentiated;
mod extended_kalman;
#[cfg(feature = "std")]
mod flight_estimator;
#[cfg(feature = "research")]
mod inverse_inertia;
mod joint_motion;
mod kalman;
mod knowledge;
mod least_squares;
mod linear_observation;
mod principal_body;
mod sdp;
mod square_root_filter;
mod unscented_kalman;

pub use change_detection::{Change, ChangeDetector, ChangeSettings, Watch};
pub use chi_square_gate::ChiSquareGate;
#[cfg(feature = "dual")]
pub use differentiated::{Differentiated, Shown, StepObservation, WithParameters};
pub use extended_kalman::{DifferentiableModel, ExtendedKalmanFilter, FilterModel};
#[cfg(feature = "std")]
pub use flight_estimator::{
    AxisErrors, BeginStage, BodyStage, ErringThruster, FilterMemory, FlightEstimator, FlightEstimatorSettings,
    FlightHealth, FlightMeasurement, GaussMarkov, LearningTargets, Reception, ReceptionCounts, SlowErrors, Suspect,
    THRUSTERS, TwoStageEstimator, WindowRows, WrenchErrors, grasp_or_release,
};
#[cfg(feature = "research")]
pub use inverse_inertia::{InverseInertia, InverseInertiaSample};
pub use joint_motion::{JointMotion, JointObservation, JointState, MotionNoise};
pub use kalman::{KalmanFilter, LinearProcess};
pub use least_squares::RecursiveLeastSquares;
pub use linear_observation::LinearObservation;
pub use principal_body::{AccelerationObservation, PrincipalBody, PrincipalMotion};
pub use sdp::RecursiveSdp;
pub use square_root_filter::SquareRootFilter;
pub use unscented_kalman::UnscentedKalmanFilter;

use nalgebra::{ComplexField, SMatrix, SVector};

/// What an observation said that had not been expected.
///
/// # Source
/// Thesis (6.29)-(6.31).
///
/// # Deviation
/// (6.30) prints the expectation of the pair, it is that of the product g gᵀ (test `golden_update_of_section_f`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation<const ROWS: usize> {
    /// Observed minus expected, before the update; zero in rows that were not measured.
    pub residual: SVector<f64, ROWS>,
    /// Its covariance S; infinite on the diagonal in rows that were not measured.
    pub covariance: SMatrix<f64, ROWS, ROWS>,
    /// Normalised innovation squared, residualᵀ S⁻¹ residual: chi-square distributed where the model holds.
    pub nis: f64,
    /// Number of rows measured, the degrees of freedom of `nis`.
    pub degrees_of_freedom: usize,
    /// Determinant of S over the measured rows.
    pub determinant: f64,
}

impl<const ROWS: usize> Innovation<ROWS> {
    /// Logarithm of the probability density of this residual.
    pub fn log_likelihood(&self) -> f64 {
        let normalisation = ComplexField::ln(self.determinant)
            + self.degrees_of_freedom as f64 * ComplexField::ln(core::f64::consts::TAU);
        -0.5 * (self.nis + normalisation)
    }
}

/// What an update did, with the matrices of its rows; [`Outcome`](crate::estimator::Outcome) is the part without them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RowsOutcome<const ROWS: usize> {
    /// What was unexpected in the observation.
    pub innovation: Innovation<ROWS>,
    /// What was made of it.
    pub verdict: Verdict,
}

impl<const ROWS: usize> RowsOutcome<ROWS> {
    /// Whether the observation entered the estimate.
    pub fn is_accepted(&self) -> bool {
        !matches!(self.verdict, Verdict::Rejected { .. })
    }
}

/// What a [`ChiSquareGate`] decides. Expected outcomes, not errors.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Verdict {
    /// The observation entered the estimate.
    Accepted,
    /// Too unlikely: estimate and covariance are as before.
    Rejected {
        /// The largest normalised innovation squared that would have been accepted.
        threshold: f64,
    },
    /// Unlikely once too often: the estimate is in doubt, not the observation. The covariance was multiplied by
    /// `inflation` and the observation accepted.
    Recovered {
        /// Factor on the covariance before the update.
        inflation: f64,
    },
}
