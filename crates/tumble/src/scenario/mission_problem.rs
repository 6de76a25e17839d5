//! Everything that a mission begins with.

use super::flight::Flight;
use super::plan_local_table::UnknownsName;
use super::planning_problem::PlanningProblem;
use crate::mission::LayerNames;
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{Environment, InertialParameters};
use tumble_identification::Estimate;
use tumble_identification::recursive::{ErringThruster, MotionNoise, SlowErrors, THRUSTERS};
use tumble_identification::sensing::LocalizationLimits;
use tumble_planning::mission::StopLimits;

/// Everything that a mission begins with.
pub struct MissionProblem {
    /// Name of the scenario.
    pub name: String,
    /// Where.
    pub place: WorldPreset,
    /// Whether the robot moves in x, y and yaw only.
    pub planar: bool,
    /// The simulated robot, seeded by the options; its drive asks for nothing.
    pub flight: Flight,
    /// World, body shape, start, goal, limits. Its limits of force and torque are shares of those below unless `[plan]` has its own;
    /// its belief is [`Self::prior`], revision 0.
    pub planning: PlanningProblem,
    /// What the robot is taken for at the start, and how well it is known.
    pub prior: Estimate,
    /// What the robot is in the end, payload included; on the table what of it counts there. During the flight:
    /// [`tumble_astrobee::simulator::AstrobeeSimulator::body`].
    pub truth: InertialParameters<f64>,
    /// When the robot learns of each obstacle of the world, s.
    pub seen_from_s: Vec<f64>,
    /// Largest force along each body axis, N.
    pub force_limit_n: Vector3<f64>,
    /// Largest torque about each body axis, N m.
    pub torque_limit_n_m: Vector3<f64>,
    /// Share of the force that plans may use; the rest is the controller's.
    pub plan_force_share: f64,
    /// Share of the torque that plans may use.
    pub plan_torque_share: f64,
    /// Largest speed of the body origin, norm, m/s.
    pub speed_limit_m_s: f64,
    /// Largest angular rate, norm, rad/s.
    pub rate_limit_rad_s: f64,
    /// Shares of the believed mass between which the true one is taken to be.
    pub mass_interval_share: [f64; 2],
    /// What is not known of the body.
    pub unknowns: UnknownsName,
    /// What information is worth.
    pub weighting: WeightingSettings,
    /// Length of a stretch, s.
    pub stretch_s: f64,
    /// Length of its steps, s.
    pub step_s: f64,
    /// Time between beliefs, s.
    pub belief_period_s: f64,
    /// How long before a stretch begins its planning does, s.
    pub stretch_lead_s: f64,
    /// How long before a new way is flown its planning begins, s.
    pub way_lead_s: f64,
    /// How much planners may compute, and how long that takes.
    pub computing: ComputingSettings,
    /// Distance kept from everything, m: by ways, by stretches of them, and by what is flown.
    pub margins_m: Margins,
    /// What counts as having arrived.
    pub arrival: ArrivalTolerance,
    /// Longest mission, s.
    pub longest_s: f64,
    /// What the estimator takes the noise for.
    pub noise: MotionNoise,
    /// What the estimator takes for errors of the sensors that last.
    pub slow: SlowErrors,
    /// What makes wrenches, and how well it is known.
    pub thrusters: [ErringThruster; THRUSTERS],
    /// Largest rate and acceleration that planners ask for, rad/s and m/s^2, where the localisation survives only so much.
    pub planned_motion: PlannedMotion,
    /// How hard stops brake.
    pub stop: StopLimits,
    /// Stretches that excite at the start pose instead of a flight; zero for a flight.
    pub station_stretches: u32,
    /// What the robot knows of that acts beside its actuators.
    pub environment: Environment,
    /// Layers that are not the usual ones.
    pub layers: LayerNames,
}

/// What information is worth: numbers of the weightings, in the order of the quantities of [`MissionProblem::unknowns`].
#[derive(Clone, Debug, PartialEq)]
pub struct WeightingSettings {
    /// Largest weight of the variance of each quantity, per its SI unit squared.
    pub gamma0: Vec<f64>,
    /// Variance at which each is known well enough.
    pub target_variance: Vec<f64>,
    /// A weight is zero from this multiple of the target on.
    pub alpha: f64,
    /// How soon a weight falls.
    pub beta: f64,
}

/// How much planners may compute, and how long that takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComputingSettings {
    /// Units for a way from rest.
    pub global_units: u64,
    /// Units for a new way in flight.
    pub replan_units: u64,
    /// Units for a stretch.
    pub local_units: u64,
    /// Simulated time that a unit of a way takes, ns.
    pub global_unit_ns: u64,
    /// Simulated time that a unit of a stretch takes, ns.
    pub local_unit_ns: u64,
    /// Largest share by which a computation takes longer, drawn by the seed.
    pub jitter_share: f64,
}

/// What counts as having arrived.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArrivalTolerance {
    /// Distance from the goal, m.
    pub position_m: f64,
    /// Angle from its attitude, rad.
    pub attitude_rad: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Rate, rad/s.
    pub rate_rad_s: f64,
    /// All of these for so long, s.
    pub for_s: f64,
}

impl MissionProblem {
    /// Whether the robot excites at its start pose instead of flying somewhere.
    pub fn station_keeping(&self) -> bool {
        self.station_stretches > 0
    }
}

/// Distances kept from everything, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// By ways.
    pub way: f64,
    /// By stretches, which need room to leave the way.
    pub stretch: f64,
    /// By what is flown; the rest is what planners may be off by.
    pub checked: f64,
}

/// Shares of a mission's margin that stretches and what is flown keep.
const STRETCH_SHARE: f64 = 0.9;
const CHECKED_SHARE: f64 = 0.6;

impl Margins {
    pub(super) fn of(margin_m: f64, slow: &SlowErrors) -> Self {
        let [way, stretch, checked] =
            [1.0, STRETCH_SHARE, CHECKED_SHARE].map(|share| with_wander(share * margin_m, slow));
        Self { way, stretch, checked }
    }
}

/// Largest wander of a localisation while the robot passes something, standard deviations: of passes of 5 s one in four hundred sees more.
const LARGEST_WANDER: f64 = 3.4;

/// A distance together with how far the robot may be from where it believes to be: no estimator tells wander from motion, so that all of a
/// plan is off by it. What the distance is for and the wander have nothing to do with each other.
fn with_wander(distance_m: f64, slow: &SlowErrors) -> f64 {
    libm::hypot(distance_m, LARGEST_WANDER * slow.position.sigma)
}

/// What planners keep within so that the localisation does not lose what it goes by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedMotion {
    /// What it survives; none where nothing is known of that.
    pub survived: Option<LocalizationLimits>,
    /// Largest magnitude of the rate in a plan, rad/s.
    pub rate_rad_s: f64,
    /// Largest magnitude of the acceleration in a plan, m/s^2.
    pub acceleration_m_s2: f64,
}

/// Of what the localisation survives, plans take so much: the rest is for what follows them.
const SURVIVED_SHARE: f64 = 0.8;

impl PlannedMotion {
    pub(super) fn of(survived: Option<LocalizationLimits>) -> Self {
        let LocalizationLimits { rate_rad_s, acceleration_m_s2, .. } = survived.unwrap_or_default();
        Self {
            survived,
            rate_rad_s: SURVIVED_SHARE * rate_rad_s,
            acceleration_m_s2: SURVIVED_SHARE * acceleration_m_s2,
        }
    }

    /// Largest rate about one axis, so that all of them together keep the limit.
    pub fn rate_of_an_axis_rad_s(&self, planar: bool) -> f64 {
        if planar { self.rate_rad_s } else { self.rate_rad_s / libm::sqrt(3.0) }
    }

    /// Largest force along an axis that moves this mass, N, so that all of them together keep the limit.
    pub fn force_of_an_axis_n(&self, mass_kg: f64, planar: bool) -> f64 {
        self.acceleration_m_s2 * mass_kg / libm::sqrt(if planar { 2.0 } else { 3.0 })
    }
}
