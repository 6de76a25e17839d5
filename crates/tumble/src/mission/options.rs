//! What one may choose about a mission, beside its scenario.

use super::layer_names::LayerNames;
use super::weighting::WeightingChoice;
use clap::ValueEnum;
use serde::{Deserialize, Serialize};

/// Options of `tumble fly`: with the scenario they decide everything.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlyOptions {
    /// All random numbers follow from it.
    pub seed: u64,
    /// What information is worth.
    pub weighting: WeightingChoice,
    /// Whether estimates reach planners and controller.
    pub feedback: bool,
    /// What the robot is taken for at the start.
    pub model: ModelChoice,
    /// What goes wrong.
    pub fault: Option<FaultChoice>,
    /// Layers that are not the scenario's.
    #[serde(default, skip_serializing_if = "LayerNames::are_usual")]
    pub layers: LayerNames,
}

/// What the robot is taken for before it learns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[non_exhaustive]
#[serde(rename_all = "kebab-case")]
pub enum ModelChoice {
    /// What the scenario says.
    #[default]
    Scenario,
    /// What it is, payload included.
    True,
    /// The original's light guess: 5 kg.
    Low,
    /// Its heavy guess: 20 kg.
    High,
    /// The robot with the payload as it is in the thesis's table 6.2.
    Payload,
}

/// A kind of fault and how bad it is: `NAME:SEVERITY`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultChoice {
    /// What.
    pub name: FaultName,
    /// 1 to 3.
    pub severity: u8,
}

/// What can go wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[non_exhaustive]
#[serde(rename_all = "kebab-case")]
pub enum FaultName {
    /// Estimates are lost.
    Drop,
    /// They arrive late.
    Delay,
    /// They arrive twice and out of order.
    Duplicate,
    /// The clock of their stamps steps.
    Clock,
    /// Numbers that are none.
    Malformed,
    /// The same over and over.
    Frozen,
    /// The localisation is somewhere else at once.
    Jump,
    /// Less force than there should be.
    Saturation,
    /// A nozzle that does not obey.
    Nozzle,
    /// The supply sags; the computer starts anew.
    Power,
    /// The body changes.
    MassStep,
    /// The estimator is sure of what is wrong.
    Divergence,
    /// Planners are late, or have no answer.
    Planner,
    /// An obstacle shows up at the last moment.
    LateObstacle,
}
