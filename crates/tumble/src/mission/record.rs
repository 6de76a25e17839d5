//! What is known of a mission when it is over. Everything here follows from scenario and options: no clock, no machine.

use super::layer_names::LayerNames;
use super::options::FlyOptions;
use serde::{Deserialize, Serialize};

/// `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MissionSummary {
    /// Version of the format: 1.
    pub format: u32,
    /// Name of the scenario.
    pub scenario: String,
    /// All random numbers follow from it.
    pub seed: u64,
    /// The options.
    pub options: FlyOptions,
    /// Every layer that flew, by name; files of before they were always named have none.
    #[serde(default)]
    pub layers: LayerNames,
    /// Whether the robot came to rest at its goal.
    pub arrived: bool,
    /// Why it never will, where that was proved: no way leads to the goal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_way: Option<String>,
    /// When it did, or when the flight was ended, s.
    pub mission_s: f64,
    /// Least distance between the robot's sphere and anything, m; negative after a collision; `None` where nothing is around.
    pub min_clearance_m: Option<f64>,
    /// Control periods in which force, torque, speed or rate were beyond their limits.
    pub limit_violations: u64,
    /// Integral of the force's magnitude, N s.
    pub impulse_n_s: f64,
    /// Integral of the torque's magnitude, N m s.
    pub angular_impulse_n_m_s: f64,
    /// Distance from what was to be flown.
    pub rms_tracking_m: TrackingRms,
    /// The ten parameters: mass, centre of mass, inertia about it.
    pub parameters: Vec<ParameterRow>,
    /// Plans of the whole way beyond the first.
    pub replans: u64,
    /// Beliefs that planners and controller were offered.
    pub belief_revisions: u64,
    /// Where the controller left its main road.
    pub fallbacks: Vec<FallbackRow>,
    /// What went wrong on purpose, and how often.
    pub faults: std::collections::BTreeMap<String, u64>,
    /// When the weight of each parameter that had one went to zero for good, s, by its name in [`Self::parameters`].
    pub information_shut_off_s: std::collections::BTreeMap<String, f64>,
    /// What a reader should know.
    pub warnings: Vec<String>,
    /// What the robot doubted, by what it knows itself, in the order in which it began; files of before there was such a list have none.
    #[serde(default)]
    pub doubts: Vec<DoubtRow>,
    /// How long the robot moved faster than its localisation survives, s; nothing where no limit is known.
    #[serde(default)]
    pub beyond_localization_s: f64,
    /// What stretches promised to teach; files of before they were counted have none.
    #[serde(default)]
    pub promises: Promises,
}

/// Standard deviations that stretches promised for their ends, over those stated then: one for each parameter of each stretch flown to
/// its end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Promises {
    /// How many there were.
    pub made: u64,
    /// Those within [`PROMISED`].
    pub kept: u64,
}

/// A promise is kept where it is between so many times what is stated later.
pub const PROMISED: std::ops::RangeInclusive<f64> = 0.7..=1.4;

/// What is doubted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[non_exhaustive]
#[serde(rename_all = "kebab-case")]
pub enum DoubtOf {
    /// Mass, centre of mass, inertia.
    Body,
    /// Where the localisation says the robot is.
    Map,
    /// Whether thrust is what is asked for.
    Actuators,
}

impl DoubtOf {
    /// As files write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Body => "body",
            Self::Map => "map",
            Self::Actuators => "actuators",
        }
    }
}

/// A spell of doubt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DoubtRow {
    /// What is doubted.
    pub what: DoubtOf,
    /// When there was first cause for it, s.
    pub since_s: f64,
    /// When it was lifted, s; `None` where it still stands at the end.
    pub until_s: Option<f64>,
    /// Why, in words.
    pub text: String,
}

/// What a mission comes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MissionVerdict {
    /// It arrived as it should.
    Accomplished,
    /// It did, but a doubt stands.
    Doubted,
    /// It did not.
    NotAccomplished,
}

/// A warning that begins so is no remark: the mission is not as it should be.
pub const BROKEN_INVARIANT: &str = "did not hold: ";
/// The warning of a mission that ended because its estimator told no motion any more.
pub(super) const NO_MOTION: &str =
    "the estimator told no motion any more: the robot was stopped, and the mission given up";
/// A warning that begins so says why what happened could not be prevented by whoever flies.
pub const UNAVOIDABLE: &str = "unavoidable: ";

impl MissionSummary {
    /// What should never happen, whatever goes wrong: a contact, a limit passed, something that did not hold.
    pub fn unsafe_because(&self) -> Option<String> {
        if let Some(clearance_m) = self.min_clearance_m.filter(|clearance_m| clearance_m.is_nan() || *clearance_m < 0.0)
        {
            return Some(format!("the robot hit something, {:.3} m deep", -clearance_m));
        }
        if self.limit_violations > 0 {
            return Some(format!("limits were passed in {} control periods", self.limit_violations));
        }
        self.warnings.iter().find(|warning| warning.starts_with(BROKEN_INVARIANT)).cloned()
    }

    /// What is doubted at the end, each once, in the order of [`DoubtOf`].
    pub fn standing_doubts(&self) -> Vec<DoubtOf> {
        let mut standing: Vec<DoubtOf> =
            self.doubts.iter().filter(|doubt| doubt.until_s.is_none()).map(|doubt| doubt.what).collect();
        standing.sort_unstable();
        standing.dedup();
        standing
    }

    /// What it comes to.
    pub fn verdict(&self) -> MissionVerdict {
        if !self.arrived || self.unsafe_because().is_some() {
            MissionVerdict::NotAccomplished
        } else if self.standing_doubts().is_empty() {
            MissionVerdict::Accomplished
        } else {
            MissionVerdict::Doubted
        }
    }

    /// Why it could not be prevented, where that is known.
    pub fn unavoidable(&self) -> Option<&str> {
        self.warnings.iter().find(|warning| warning.starts_with(UNAVOIDABLE)).map(String::as_str)
    }
}

/// Root mean square distances, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackingRms {
    /// Of the whole flight.
    pub all: f64,
    /// Of its last quarter.
    pub last_leg: f64,
}

/// A parameter and what became of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterRow {
    /// `mass`, `com_x` ..., `inertia_xx`, `inertia_xy` ...: about the centre of mass.
    pub name: String,
    /// SI.
    pub unit: String,
    /// What it was.
    pub truth: f64,
    /// What it was taken for at the start.
    pub initial: f64,
    /// What it was taken for in the end.
    pub estimate: f64,
    /// With this standard deviation.
    pub sigma: f64,
}

/// A spell in which the controller was off its main road.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FallbackRow {
    /// When it began, s.
    pub t_s: f64,
    /// Why.
    pub reason: String,
}

/// A mission for the reader: what `report.html` holds, sampled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MissionRecord {
    /// In numbers.
    pub summary: MissionSummary,
    /// The whole scenario, TOML: with the options of the summary it redoes the flight.
    pub scenario_toml: String,
    /// Version of the program.
    pub version: String,
    /// Radius of the sphere that stands for the robot, m.
    pub robot_radius_m: f64,
    /// On a table.
    pub planar: bool,
    /// Body origin at the goal, world axes, m.
    pub goal_m: [f64; 3],
    /// Where the robot may be.
    pub keep_in: Vec<DrawnBox>,
    /// Where it may not.
    pub keep_out: Vec<DrawnBox>,
    /// What it may hit.
    pub obstacles: Vec<DrawnEllipsoid>,
    /// What the robot holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub payload: Option<DrawnPayload>,
    /// Over time, about five rows a second.
    pub series: Series,
    /// Plans of the whole way.
    pub ways: Vec<WayRow>,
    /// Plans of stretches, those flown.
    pub stretches: Vec<StretchRow>,
    /// Each revision of the belief.
    pub beliefs: Vec<BeliefRow>,
    /// What happened.
    pub events: Vec<MissionEvent>,
}

/// Columns of equal length. Arrays are x, y, z.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// Mission time, s.
    pub t_s: Vec<f64>,
    /// True position of the body origin, m.
    pub position_m: Vec<[f64; 3]>,
    /// True attitude, x y z w.
    pub quaternion_xyzw: Vec<[f64; 4]>,
    /// Wanted position, m.
    pub wanted_position_m: Vec<[f64; 3]>,
    /// Wanted attitude, x y z w.
    pub wanted_quaternion_xyzw: Vec<[f64; 4]>,
    /// Position as the robot believes it, m.
    pub believed_position_m: Vec<[f64; 3]>,
    /// True distance from the wanted position, m.
    pub tracking_error_m: Vec<f64>,
    /// True angle from the wanted attitude, rad.
    pub attitude_error_rad: Vec<f64>,
    /// Half-widths of the tube along its axes (the world's), m; zero without one.
    pub tube_m: Vec<[f64; 3]>,
    /// Force that acted, body axes, N.
    pub force_n: Vec<[f64; 3]>,
    /// Torque that acted, body axes, N m.
    pub torque_n_m: Vec<[f64; 3]>,
    /// Least distance between the robot's sphere and anything, m; `None` where nothing is around.
    pub clearance_m: Vec<Option<f64>>,
    /// What the estimator takes each parameter for, in the order of [`MissionSummary::parameters`].
    pub estimate: Vec<[f64; 10]>,
    /// Its standard deviation.
    pub sigma: Vec<[f64; 10]>,
    /// Revision of the belief that the controller used.
    pub belief_revision: Vec<u64>,
    /// Number of the stretch that was flown; zero for none.
    pub plan_revision: Vec<u64>,
    /// Largest force along each body axis, N; of all rows.
    pub force_limit_n: [f64; 3],
    /// Largest torque about each body axis, N m; of all rows.
    pub torque_limit_n_m: [f64; 3],
}

/// A plan of the whole way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WayRow {
    /// When it was adopted, s.
    pub t_s: f64,
    /// Revision of the belief used.
    pub model_revision: u64,
    /// Points of it, m.
    pub points_m: Vec<[f64; 3]>,
    /// Edges of the search tree, thinned to at most 2000, m.
    pub tree_m: Vec<[[f64; 3]; 2]>,
}

/// A plan of a stretch.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StretchRow {
    /// Its number.
    pub plan_revision: u64,
    /// When it begins, s.
    pub start_s: f64,
    /// When it ends and stopping would begin, s.
    pub end_s: f64,
    /// Revision of the belief used.
    pub model_revision: u64,
    /// Points of it, m, the stop after it included.
    pub points_m: Vec<[f64; 3]>,
    /// Names of the quantities whose information has a weight, as in [`MissionSummary::parameters`] those that are parameters.
    pub quantities: Vec<String>,
    /// Weight of each.
    pub weights: Vec<f64>,
    /// Standard deviation of each at its start and as predicted at its end.
    pub sigma: Vec<[f64; 2]>,
    /// Standard deviation of each that the estimator stated at its end; empty where it was not flown so far.
    #[serde(default)]
    pub stated: Vec<f64>,
    /// Information about each that the stretch is expected to gather: the gain of `1/sigma^2`.
    pub information: Vec<f64>,
}

/// A revision of the belief.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BeliefRow {
    /// When it was offered, s.
    pub t_s: f64,
    /// Its number.
    pub revision: u64,
    /// When the controller began to use it, s; `None` where it never did.
    pub used_from_s: Option<f64>,
    /// The parameters.
    pub estimate: [f64; 10],
    /// Their standard deviations.
    pub sigma: [f64; 10],
}

/// What happened.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MissionEvent {
    /// When, s.
    pub t_s: f64,
    /// A word for the kind.
    pub kind: String,
    /// In words.
    pub text: String,
}

/// A box with its sides along the world's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DrawnBox {
    /// Least corner, m.
    pub lower_m: [f64; 3],
    /// Largest corner, m.
    pub upper_m: [f64; 3],
}

/// An ellipsoid and when it is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DrawnEllipsoid {
    /// Centre at time zero, m.
    pub center_m: [f64; 3],
    /// Velocity of the centre, m/s.
    pub velocity_m_s: [f64; 3],
    /// Axes to world, x y z w.
    pub quaternion_xyzw: [f64; 4],
    /// Semi-axes, m.
    pub semi_axes_m: [f64; 3],
    /// When the robot can see it, s: `[from, until]`; an infinite `until` is written as `null`.
    #[serde(with = "for_ever")]
    pub seen_s: [f64; 2],
}

/// What the robot holds: nothing is known of its shape, so that it is the solid box of its mass and inertia.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DrawnPayload {
    /// Centre of the box, axes of the robot, m.
    pub center_m: [f64; 3],
    /// Axes of the box to those of the robot, x y z w.
    pub quaternion_xyzw: [f64; 4],
    /// Its edges, m.
    pub edges_m: [f64; 3],
    /// When it is held, s: `[from, until]`; an infinite `until` is written as `null`.
    #[serde(with = "for_ever")]
    pub held_s: [f64; 2],
}

/// A span of time whose end may be infinite, which JSON has no number for.
mod for_ever {
    use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer};

    pub fn serialize<S: Serializer>([from, until]: &[f64; 2], serializer: S) -> Result<S::Ok, S::Error> {
        (from, (*until < f64::INFINITY).then_some(until)).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 2], D::Error> {
        let (from, until) = <(f64, Option<f64>)>::deserialize(deserializer)?;
        Ok([from, until.unwrap_or(f64::INFINITY)])
    }
}
