//! What information may be worth to the local planner.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

/// How the local planner weighs information.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[non_exhaustive]
#[serde(rename_all = "kebab-case")]
pub enum WeightingChoice {
    /// Algorithm 1 of the thesis: what is still uncertain, by its covariance.
    #[default]
    Covariance,
    /// By the tracking loss that the uncertainty is expected to cost.
    Belief,
    /// Less at a quarter, a half and three quarters of the way.
    Step,
    /// Decaying over the way.
    Exponential,
    /// Always the same.
    Fixed,
    /// Only the mass.
    Mass,
    /// Only the inertia.
    Inertia,
    /// Nothing.
    None,
}
