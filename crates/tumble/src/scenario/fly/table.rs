//! `[fly]` as it is written.

use crate::mission::LayerNames;
use crate::scenario::{PriorTable, UnknownsName};
use serde::{Deserialize, Serialize};

/// `[fly]` as it is written.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlyTable {
    /// What is not known of the body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unknowns: Option<UnknownsName>,
    /// Shares of the believed mass between which the true one is taken to be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_interval_share: Option<[f64; 2]>,
    /// Largest force along each body axis, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_limit_n: Option<[f64; 3]>,
    /// Largest torque about each body axis, N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_limit_n_m: Option<[f64; 3]>,
    /// Share of the force that plans may use.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plan_force_share: Option<f64>,
    /// Share of the torque that plans may use.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plan_torque_share: Option<f64>,
    /// Steps of a stretch.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stretch_steps: Option<usize>,
    /// Their length, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_s: Option<f64>,
    /// Time between beliefs, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub belief_period_s: Option<f64>,
    /// How long before a stretch begins its planning does, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stretch_lead_s: Option<f64>,
    /// How long before a new way is flown its planning begins, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub way_lead_s: Option<f64>,
    /// How hard a stop brakes along the way, m/s^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stop_acceleration_m_s2: Option<f64>,
    /// How hard it brakes the turn, rad/s^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stop_angular_acceleration_rad_s2: Option<f64>,
    /// Stretches that excite at the start pose instead of a flight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub station_stretches: Option<u32>,
    /// Whether the robot is told of `[environment]`; it is unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub knows_environment: Option<bool>,
    /// Estimator, planners and controller by name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layers: Option<LayerNames>,
    /// How well the body is known at the start.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorTable>,
    /// What information is worth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub information: Option<InformationTable>,
    /// What counts as having arrived.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arrival: Option<ArrivalTable>,
    /// What the estimator takes the noise for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub estimator: Option<EstimatorTable>,
    /// How much planners may compute, and how long that takes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub computing: Option<ComputingTable>,
}

/// What information is worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InformationTable {
    /// Weight of each variance, over the square of the quantity's size.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
    /// Standard deviation at which the mass is known well enough, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_mass_kg: Option<f64>,
    /// The same of each coordinate of the centre of mass, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_com_m: Option<f64>,
    /// The same of each entry of the inertia about it, kg m^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_inertia_kg_m2: Option<f64>,
    /// A weight is zero while the variance is below this multiple of its target.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha: Option<f64>,
    /// How soon a weight falls.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beta: Option<f64>,
}

/// What counts as having arrived.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArrivalTable {
    /// Distance from the goal, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_m: Option<f64>,
    /// Angle from its attitude, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude_rad: Option<f64>,
    /// Speed, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_m_s: Option<f64>,
    /// Rate, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_rad_s: Option<f64>,
    /// All of these for so long, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub for_s: Option<f64>,
}

/// One standard deviation per axis and sample of what the estimator takes for noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorTable {
    /// Of a measured attitude, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude_rad: Option<f64>,
    /// Of a measured position, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_m: Option<f64>,
    /// Of a measured angular velocity, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_rad_s: Option<f64>,
    /// Of a measured velocity, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_m_s: Option<f64>,
    /// Of a measured acceleration, m/s^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceleration_m_s2: Option<f64>,
    /// Of the torque held over a period, N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_n_m: Option<f64>,
    /// Of the force held over a period, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_n: Option<f64>,
    /// Of what the body's mass and lengths change by in a second, as a share.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drift: Option<f64>,
}

/// How much planners may compute, and how long that takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComputingTable {
    /// Units for a way from rest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub global_units: Option<u64>,
    /// Units for a new way in flight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub replan_units: Option<u64>,
    /// Units for a stretch.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub local_units: Option<u64>,
    /// Simulated time that a unit of a way takes, ns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub global_unit_ns: Option<u64>,
    /// Simulated time that a unit of a stretch takes, ns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub local_unit_ns: Option<u64>,
    /// Largest share by which a computation takes longer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jitter_share: Option<f64>,
}
