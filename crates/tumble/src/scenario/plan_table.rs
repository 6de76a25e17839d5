//! What a planner keeps within, as it is written.

use super::plan_local_table::LocalTable;
use serde::{Deserialize, Serialize};

/// What a planner keeps within, as it is written.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanTable {
    /// Largest force along each world axis, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_limit_n: Option<[f64; 3]>,
    /// Largest speed along each world axis, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_limit_m_s: Option<[f64; 3]>,
    /// Least coordinates of the body origin, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_lower_m: Option<[f64; 3]>,
    /// Its largest coordinates, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_upper_m: Option<[f64; 3]>,
    /// How far from the goal is near enough, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal_radius_m: Option<f64>,
    /// How fast one may be there, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal_speed_m_s: Option<f64>,
    /// Whether to arrive with the attitude of the goal; yes unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal_attitude: Option<bool>,
    /// Distance kept from everything, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin_m: Option<f64>,
    /// Largest torque about each body axis, N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_limit_n_m: Option<[f64; 3]>,
    /// Largest turning rate, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_limit_rad_s: Option<f64>,
    /// Ellipsoids that stand for the robot.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub body: Vec<PlanBodyTable>,
    /// One segment, planned for progress and information.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub local: Option<LocalTable>,
}

/// An ellipsoid of the body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanBodyTable {
    /// Semi-axes, m.
    pub semi_axes_m: [f64; 3],
    /// Centre, body axes, m; the body origin unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub center_m: Option<[f64; 3]>,
    /// Axes to body, scalar last; along the body's axes unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quaternion_xyzw: Option<[f64; 4]>,
}
