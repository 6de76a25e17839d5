//! `[plan.local]` as it is written.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use tumble_dynamics::PARAMETERS;

/// `[plan.local]` as it is written.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LocalTable {
    /// Steps of the horizon.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// Length of a step, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_s: Option<f64>,
    /// What is not known of the body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unknowns: Option<UnknownsName>,
    /// What is to be small of the predicted covariance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub criterion: Option<CriterionName>,
    /// How much information weighs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weighting: Option<WeightingName>,
    /// Weight of the variance of each quantity, per SI unit squared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weights: Option<Vec<f64>>,
    /// Standard deviation at which a quantity is known well enough, SI units.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_sigmas: Option<Vec<f64>>,
    /// How much of the mission has passed, as a share of `duration_s`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elapsed_share: Option<f64>,
    /// Whether forces and torques are those that the nozzles give exactly.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nozzles: Option<bool>,
    /// Largest force along each body axis, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_limit_n: Option<[f64; 3]>,
    /// Largest torque about each body axis through the origin, N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_limit_n_m: Option<[f64; 3]>,
    /// Largest speed along each world axis, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_limit_m_s: Option<[f64; 3]>,
    /// Largest rate about each body axis, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_limit_rad_s: Option<[f64; 3]>,
    /// Distance kept from everything, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin_m: Option<f64>,
    /// Whether obstacles are kept off all along; otherwise at the nodes only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on_segments: Option<bool>,
    /// Largest distance of the end from the reference, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub terminal_radius_m: Option<f64>,
    /// Largest speed at the end, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub terminal_speed_m_s: Option<f64>,
    /// Weights of the tracking error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tracking: Option<TrackingTable>,
    /// The same at the end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub terminal: Option<TrackingTable>,
    /// Weights of inputs and accelerations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub effort: Option<EffortTable>,
    /// What is measured, and how well.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measurement: Option<MeasurementTable>,
    /// How well the body is known before.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorTable>,
    /// What else is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nuisances: Option<NuisanceTable>,
}

/// What is not known of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[non_exhaustive]
#[serde(rename_all = "kebab-case")]
pub enum UnknownsName {
    /// Mass and the three moments of inertia.
    Principal,
    /// All ten inertial parameters.
    Full,
    /// On the table: mass and moment of inertia about the vertical.
    Planar,
    /// On the table: mass, centre of mass and moment of inertia about the vertical.
    PlanarCom,
}

impl UnknownsName {
    /// How many quantities.
    pub fn count(self) -> usize {
        match self {
            Self::Principal | Self::PlanarCom => 4,
            Self::Full => PARAMETERS,
            Self::Planar => 2,
        }
    }

    /// Places of the quantities among mass, centre of mass and inertia about it (xx, xy, xz, yy, yz, zz), in the order of the models.
    pub fn places(self) -> &'static [usize] {
        match self {
            UnknownsName::Principal => &[0, 4, 7, 9],
            UnknownsName::Full => &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9],
            UnknownsName::Planar => &[0, 9],
            UnknownsName::PlanarCom => &[0, 9, 1, 2],
        }
    }

    /// Whether they are those of a robot on the table.
    pub fn is_planar(self) -> bool {
        matches!(self, Self::Planar | Self::PlanarCom)
    }
}

/// See [`Criterion`](tumble_planning::local::Criterion).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[non_exhaustive]
#[serde(rename_all = "kebab-case")]
pub enum CriterionName {
    /// Weighted sum of the variances.
    A,
    /// Logarithm of the determinant.
    D,
    /// The largest eigenvalue.
    E,
}

/// How much information weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[non_exhaustive]
#[serde(rename_all = "kebab-case")]
pub enum WeightingName {
    /// Less as the variances come near their targets (Algorithm 1).
    Covariance,
    /// In steps of the mission's time.
    Step,
    /// Exponentially less with the mission's time.
    Exponential,
    /// The weights as they are.
    Fixed,
    /// The mass only.
    Mass,
    /// The moments of inertia only.
    Inertia,
    /// What errors of the model are expected to cost on the way that is left.
    Belief,
    /// Information does not count.
    None,
}

/// Weights of a squared tracking error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackingTable {
    /// Per m^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<f64>,
    /// Per (m/s)^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity: Option<f64>,
    /// Per rad^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude: Option<f64>,
    /// Per (rad/s)^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
}

/// Weights of squared inputs and accelerations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EffortTable {
    /// Per N^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force: Option<f64>,
    /// Per (N m)^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque: Option<f64>,
    /// Per (m/s^2)^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceleration: Option<f64>,
    /// Per (rad/s^2)^2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angular_acceleration: Option<f64>,
}

/// Standard deviations of one measurement per axis; infinite for what is not measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasurementTable {
    /// Of the position, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_sigma_m: Option<f64>,
    /// Of the velocity, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_sigma_m_s: Option<f64>,
    /// Of the attitude, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attitude_sigma_rad: Option<f64>,
    /// Of the rate, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_sigma_rad_s: Option<f64>,
    /// Independent measurements per step.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub samples_per_step: Option<f64>,
}

/// Standard deviations of the believed body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorTable {
    /// Of the mass, kg; or
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_sigma_kg: Option<f64>,
    /// as a share of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_sigma_share: Option<f64>,
    /// Of each coordinate of the centre of mass, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub com_sigma_m: Option<f64>,
    /// Of each entry of the inertia about the centre of mass, kg m^2; or
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_sigma_kg_m2: Option<f64>,
    /// as a share: of a moment of itself, of a product of the geometric mean of its two moments.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_sigma_share: Option<f64>,
}

/// Prior standard deviations of what else is not known, alike for the three axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NuisanceTable {
    /// Of the force's scale along each body axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_scale_sigma: Option<f64>,
    /// Of the torque's scale about each body axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_scale_sigma: Option<f64>,
    /// Of a constant force along each body axis, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_bias_sigma_n: Option<f64>,
    /// Of a constant torque about each body axis, N m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub torque_bias_sigma_n_m: Option<f64>,
}
