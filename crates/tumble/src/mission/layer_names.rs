//! Layers of a mission that are not the usual ones, by name.

use serde::{Deserialize, Serialize};

/// Flown unless another is asked for.
pub(super) const ESTIMATOR: &str = "joint";
pub(super) const PLANNER: &str = "flight";
pub(super) const LOCAL_PLANNER: &str = "informative";
pub(super) const CONTROLLER: &str = "tube";

/// Layers asked for by name; those that are not named are the usual ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LayerNames {
    /// Of [`estimators`](super::estimators).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub estimator: Option<&'static str>,
    /// Of [`planners`](super::planners).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planner: Option<&'static str>,
    /// Of [`local_planners`](super::local_planners).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub local_planner: Option<&'static str>,
    /// Of [`controllers`](super::controllers).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub controller: Option<&'static str>,
}

impl LayerNames {
    /// Whether nothing is named.
    pub fn are_usual(&self) -> bool {
        *self == Self::default()
    }

    /// These, and of `others` those that are not named here.
    #[must_use]
    pub fn or(self, others: Self) -> Self {
        Self {
            estimator: self.estimator.or(others.estimator),
            planner: self.planner.or(others.planner),
            local_planner: self.local_planner.or(others.local_planner),
            controller: self.controller.or(others.controller),
        }
    }

    /// These, and the usual ones by name where none is named.
    #[must_use]
    pub fn all(&self) -> Self {
        Self {
            estimator: Some(self.estimator()),
            planner: Some(self.planner()),
            local_planner: Some(self.local_planner()),
            controller: Some(self.controller()),
        }
    }

    /// As a command takes them, each with a space before it; what is not named is left out.
    pub(crate) fn arguments(&self) -> String {
        let Self { estimator, planner, local_planner, controller } = self;
        let options = [
            ("estimator", estimator),
            ("planner", planner),
            ("local-planner", local_planner),
            ("controller", controller),
        ];
        let named = options.into_iter().filter_map(|(option, name)| Some((option, (*name)?)));
        named.flat_map(|(option, name)| [" --", option, " ", name]).collect()
    }

    pub(super) fn estimator(&self) -> &'static str {
        self.estimator.unwrap_or(ESTIMATOR)
    }

    pub(super) fn planner(&self) -> &'static str {
        self.planner.unwrap_or(PLANNER)
    }

    pub(super) fn local_planner(&self) -> &'static str {
        self.local_planner.unwrap_or(LOCAL_PLANNER)
    }

    pub(super) fn controller(&self) -> &'static str {
        self.controller.unwrap_or(CONTROLLER)
    }
}

/// Names as they are written.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WrittenNames<S> {
    /// Of [`estimators`](super::estimators).
    pub estimator: Option<S>,
    /// Of [`planners`](super::planners).
    pub planner: Option<S>,
    /// Of [`local_planners`](super::local_planners).
    pub local_planner: Option<S>,
    /// Of [`controllers`](super::controllers).
    pub controller: Option<S>,
}
