//! `--estimator`, `--planner`, `--local-planner`, `--controller` of the commands that fly missions.

use crate::TumbleError;
use crate::mission::{self, LayerNames, WrittenNames};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use tumble_identification::Registry;
use tumble_planning::PlanningError;

/// Layers by name; those that are not named are the scenario's, or else the usual ones.
#[derive(Args)]
pub(super) struct FlownLayers {
    /// What knows motion and body in flight, instead of the scenario's [usual: joint].
    #[arg(long, value_name = "NAME", value_parser = possible(&mission::estimators()))]
    estimator: Option<String>,
    /// What plans ways [usual: flight].
    #[arg(long, value_name = "NAME", value_parser = possible(&mission::planners()))]
    planner: Option<String>,
    /// What plans stretches of them [usual: informative].
    #[arg(long, value_name = "NAME", value_parser = possible(&mission::local_planners()))]
    local_planner: Option<String>,
    /// What follows them [usual: tube].
    #[arg(long, value_name = "NAME", value_parser = possible(&mission::controllers()))]
    controller: Option<String>,
}

impl FlownLayers {
    /// The names as the registries have them.
    pub(super) fn names(&self) -> Result<LayerNames, TumbleError> {
        let names = WrittenNames {
            estimator: self.estimator.as_deref(),
            planner: self.planner.as_deref(),
            local_planner: self.local_planner.as_deref(),
            controller: self.controller.as_deref(),
        };
        LayerNames::of(&names).map_err(|unknown| TumbleError::Planning(unknown.into()))
    }
}

/// The names of a registry, with a sentence on each for the help.
pub(super) fn possible<C, T: ?Sized>(registry: &Registry<C, T, PlanningError>) -> PossibleValuesParser {
    registry.entries().map(|(name, sentence)| PossibleValue::new(name).help(sentence)).collect::<Vec<_>>().into()
}
