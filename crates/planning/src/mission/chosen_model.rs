//! Planners for the models that a program chooses while it runs.

use super::expected_loss::ExpectedLoss;
use super::informative_stretch::InformativeStretch;
use super::stretch::StretchPlanner;
use super::stretch_model::StretchModel;
use super::stretch_settings::StretchSettings;
use crate::error::PlanningError;
use crate::local::{
    InformationWeighting, InformativePlanner, LocalPlanner, LocalSettings, PlanarBodyModel, RigidBodyModel, WrenchSet,
};

/// A model whose planners this crate compiles: a program that chooses among them by name, and its tests, need not do so again.
/// For a model of one's own, box an [`InformativePlanner`] or an [`InformativeStretch`].
///
/// # Example
/// ```
/// use tumble_planning::local::{FixedWeighting, PlanarBodyModel, WrenchSet};
/// use tumble_planning::mission::{ChosenModel, StretchPlanner, StretchSettings};
///
/// let wrench = WrenchSet { limit: [0.02, 0.4, 0.4], half_spaces: Vec::new() }; // N m, N
/// let weighting = Box::new(FixedWeighting::try_new([1.0, 1.0])?);
/// let model = PlanarBodyModel::mass_and_inertia();
/// let settings = StretchSettings::default();
/// let planner: Box<dyn StretchPlanner> = model.stretch_planner(&settings, wrench, weighting, None)?;
/// assert_eq!(planner.horizon_s(), settings.steps as f64 * settings.step_s);
/// # Ok::<(), tumble_planning::PlanningError>(())
/// ```
/// Tutorial: [a model of your own, which needs none of this](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/custom_informative_model.rs).
pub trait ChosenModel<const X: usize, const U: usize, const P: usize>: StretchModel<X, U, P> {
    /// The informative planner.
    ///
    /// # Errors
    /// Those of [`InformativePlanner::try_new`].
    fn local_planner(
        self,
        settings: LocalSettings<X, U>,
    ) -> Result<Box<dyn LocalPlanner<U, P, State = Self::State>>, PlanningError>;

    /// The planner of stretches; where an expected loss is given, it decides the weights and not the weighting.
    ///
    /// # Errors
    /// Those of [`InformativeStretch::try_new`].
    fn stretch_planner(
        self,
        settings: &StretchSettings,
        wrench: WrenchSet<U>,
        weighting: Box<dyn InformationWeighting<P>>,
        expected_loss: Option<ExpectedLoss<P>>,
    ) -> Result<Box<dyn StretchPlanner>, PlanningError>;
}

macro_rules! chosen_model {
    ($($model:ty, $states:literal, $inputs:literal, $quantities:literal;)*) => { $(
        impl ChosenModel<$states, $inputs, $quantities> for $model {
            fn local_planner(
                self,
                settings: LocalSettings<$states, $inputs>,
            ) -> Result<Box<dyn LocalPlanner<$inputs, $quantities, State = Self::State>>, PlanningError> {
                Ok(Box::new(InformativePlanner::try_new(self, settings)?))
            }

            fn stretch_planner(
                self,
                settings: &StretchSettings,
                wrench: WrenchSet<$inputs>,
                weighting: Box<dyn InformationWeighting<$quantities>>,
                expected_loss: Option<ExpectedLoss<$quantities>>,
            ) -> Result<Box<dyn StretchPlanner>, PlanningError> {
                let planner = InformativeStretch::try_new(self, settings, wrench, weighting)?;
                Ok(Box::new(match expected_loss {
                    Some(expected_loss) => planner.weighted_by_loss(expected_loss),
                    None => planner,
                }))
            }
        }
    )* };
}

chosen_model! {
    RigidBodyModel<4>, 12, 6, 4;
    RigidBodyModel<7>, 12, 6, 7;
    RigidBodyModel<10>, 12, 6, 10;
    RigidBodyModel<13>, 12, 6, 13;
    RigidBodyModel<16>, 12, 6, 16;
    PlanarBodyModel<2>, 6, 3, 2;
    PlanarBodyModel<4>, 6, 3, 4;
}
