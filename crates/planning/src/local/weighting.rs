//! How much a plan should pay for knowledge.

mod belief;
mod covariance;
mod fixed;
mod schedule;

pub use belief::BeliefWeighting;
pub use covariance::{CovarianceWeighting, Hysteresis, ShutOff};
pub use fixed::FixedWeighting;
pub use schedule::{ExponentialWeighting, StepWeighting};

use crate::error::{PlanningError, not_negative, positive};
use nalgebra::SMatrix;

/// What is known when weights are asked for: checked numbers.
///
/// # Units
/// Covariances in squared units of the quantities.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightingContext<const P: usize> {
    covariance: SMatrix<f64, P, P>,
    initial_covariance: SMatrix<f64, P, P>,
    elapsed_s: f64,
    duration_s: f64,
}

fn variances_of<const P: usize>(covariance: &SMatrix<f64, P, P>) -> [f64; P] {
    core::array::from_fn(|i| covariance[(i, i)])
}

fn symmetric<const P: usize>(covariance: &SMatrix<f64, P, P>) -> Result<(), PlanningError> {
    for variance in variances_of(covariance) {
        not_negative("a variance of the belief", variance)?;
    }
    for i in 0..P {
        for j in 0..i {
            let (lower, upper) = (covariance[(i, j)], covariance[(j, i)]);
            let size = f64::sqrt(covariance[(i, i)]) * f64::sqrt(covariance[(j, j)]);
            let bound = size * (1.0 + 1e-6);
            let what = "a covariance of the belief";
            crate::error::finite(what, lower)?;
            crate::error::finite(what, upper)?;
            if lower.abs() > bound {
                return Err(PlanningError::OutOfRange { what, value: lower, lower: -bound, upper: bound });
            }
            if (lower - upper).abs() > 1e-9 * size {
                return Err(PlanningError::Asymmetric { what });
            }
        }
    }
    Ok(())
}

impl<const P: usize> WeightingContext<P> {
    /// The belief after its newest update and at the start of the mission; how long the mission has run, and how long it will.
    ///
    /// # Errors
    /// Covariances that are none; a time that is negative or not finite, a mission without length.
    pub fn try_new(
        covariance: SMatrix<f64, P, P>,
        initial_covariance: SMatrix<f64, P, P>,
        elapsed_s: f64,
        duration_s: f64,
    ) -> Result<Self, PlanningError> {
        symmetric(&covariance)?;
        symmetric(&initial_covariance)?;
        not_negative("the elapsed time", elapsed_s)?;
        positive("the duration of the mission", duration_s)?;
        Ok(Self { covariance, initial_covariance, elapsed_s, duration_s })
    }

    /// Covariance of the quantities after the newest update.
    pub fn covariance(&self) -> &SMatrix<f64, P, P> {
        &self.covariance
    }

    /// Variance of each quantity after the newest update.
    pub fn variances(&self) -> [f64; P] {
        variances_of(&self.covariance)
    }

    /// Covariance of the quantities at the start of the mission.
    pub fn initial_covariance(&self) -> &SMatrix<f64, P, P> {
        &self.initial_covariance
    }

    /// Time since the start of the mission, s.
    pub fn elapsed_s(&self) -> f64 {
        self.elapsed_s
    }

    /// Length of the mission, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Share of the mission that has passed; beyond one when it takes longer.
    pub fn elapsed_share(&self) -> f64 {
        self.elapsed_s / self.duration_s
    }
}

/// Says before each plan how much the predicted variance of each quantity weighs: [`super::LocalRequest::information`].
///
/// # Units
/// Cost per squared unit of the quantity.
/// # Laws
/// `laws::check_information_weighting`.
/// # Source
/// Thesis 6.2.2, `Gamma` of (6.9).
///
/// # Example
/// ```
/// use tumble_planning::PlanningError;
/// use tumble_planning::local::{InformationWeighting, WeightingContext};
/// use tumble_planning::nalgebra::SMatrix;
///
/// /// Pays while a quantity is not known to a tenth of what was known at the start.
/// struct UntilTenth;
/// impl<const P: usize> InformationWeighting<P> for UntilTenth {
///     fn weights(&mut self, context: &WeightingContext<P>) -> Result<[f64; P], PlanningError> {
///         let (now, first) = (context.variances(), context.initial_covariance().diagonal());
///         Ok(core::array::from_fn(|i| if now[i] > 0.01 * first[i] { 1.0 } else { 0.0 }))
///     }
/// }
/// let now = SMatrix::<f64, 2, 2>::from([[0.5, 0.0], [0.0, 0.001]]);
/// let context = WeightingContext::try_new(now, SMatrix::identity(), 10.0, 60.0)?;
/// assert_eq!(UntilTenth.weights(&context)?, [1.0, 0.0]);
/// # Ok::<(), PlanningError>(())
/// ```
/// Tutorial: [fixed weights](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/src/local/weighting/fixed.rs).
pub trait InformationWeighting<const P: usize> {
    /// The weights for the next plan, finite and not negative; a weighting may remember what it answered before.
    ///
    /// # Errors
    /// Where the weighting cannot be computed for this belief.
    fn weights(&mut self, context: &WeightingContext<P>) -> Result<[f64; P], PlanningError>;
}

/// Checks the weights that a schedule scales.
fn base_weights<const P: usize>(base: &[f64; P]) -> Result<(), PlanningError> {
    base.iter().try_for_each(|weight| not_negative("an information weight", *weight).map(|_| ()))
}
