//! What controllers are told, as it is written.

use super::flight::NONE;
use crate::mission::controllers;
use serde::{Deserialize, Deserializer, Serialize, de};
use tumble_formats::log::shortened;
use tumble_formats::place;

/// What `tube`, `lqr`, `mpc` and `original-tube` are told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControlTable {
    /// Largest force along each body axis, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_limit_n: Option<[f64; 3]>,
    /// Largest norm of the torque, N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_limit_n_m: Option<f64>,
    /// With `tube`: largest speed along each axis, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_limit_m_s: Option<f64>,
    /// With `tube`: shares of the believed mass between which the true one is certain to be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_interval_share: Option<[f64; 2]>,
    /// With `tube`: whether the place's keep-in boxes, less the robot's radius, are walls.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub walls: Option<bool>,
    /// With `tube`: largest error of a measured position along each axis, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_error_m: Option<f64>,
    /// With `tube`: largest error of a measured velocity along each axis, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_error_m_s: Option<f64>,
    /// With `tube`: largest force from outside along each axis, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_error_n: Option<f64>,
}

/// What a controller is told of the mass at a time; centre of mass and inertia about it stay as believed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BeliefTable {
    /// Time since the start, s.
    pub time_s: f64,
    /// Estimated mass, kg.
    pub mass_kg: f64,
    /// Its standard deviation, kg.
    pub sigma_kg: f64,
}

/// A name that the registry has, or that of no controller.
pub(super) fn known_controller<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    let asked = Option::<String>::deserialize(deserializer)?;
    if let Some(name) = asked.as_deref().filter(|name| *name != NONE) {
        controllers().check(name).map_err(|mut unknown| {
            unknown.known.push(NONE);
            let near = place::suggestion(name, unknown.known.iter().copied());
            unknown.asked = shortened(name);
            de::Error::custom(format!("{unknown}{near}"))
        })?;
    }
    Ok(asked)
}
