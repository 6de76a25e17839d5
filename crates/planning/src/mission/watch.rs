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
        write!(f, "{:.3} s: {}: {found}, allowed {allowed}", *time_ns as f64 * 1e-9, invariant.name())
    }
}

/// Counts what does not hold.
#[derive(Clone, Debug)]
pub struct InvariantWatch {
    limits: WatchLimits,
    first: Vec<Violation>,
    counts: [u64; Invariant::ALL.len()],
    steps: u64,
    newest_offered: u64,
    newest_adopted: u64,
}

/// Violations of each invariant that are kept with their numbers.
const KEPT: u64 = 16;

impl InvariantWatch {
    /// A watch that has seen nothing.
    pub fn new(limits: WatchLimits) -> Self {
        let counts = [0; Invariant::ALL.len()];
        Self { limits, first: Vec::new(), counts, steps: 0, newest_offered: 0, newest_adopted: 0 }
    }

    /// Looks at one control period; how many invariants did not hold. What is no number holds nowhere.
    pub fn see(&mut self, step: &WatchedStep<'_>) -> u32 {
        let limits = self.limits;
        let mut broken = 0;
        let mut hold = |invariant: Invariant, holds: bool, found: f64, allowed: f64| {
            if !holds {
                broken += 1;
                self.note(&Violation { time_ns: step.time_ns, invariant, found, allowed });
            }
        };
        if let Some(clearance_m) = step.clearance_m {
            hold(Invariant::Clearance, clearance_m >= 0.0, clearance_m, 0.0);
        }
        let (force, limit) = worst_axis(&step.wrench_body.force, &limits.force_n);
        hold(Invariant::Force, force <= limit * (1.0 + limits.rounding), force, limit);
        let (torque, limit) = (step.wrench_body.torque.norm(), limits.torque_norm_n_m);
        hold(Invariant::Torque, torque <= limit * (1.0 + limits.rounding), torque, limit);
        let margin = step.body.consistency_margin();
        hold(Invariant::Body, margin > 0.0, margin, 0.0);
        if let Some(covariance) = step.covariance {
            let pivot = least_pivot(covariance);
            hold(Invariant::Covariance, pivot > 0.0, pivot, 0.0);
        }
        for [x, y, z, w] in step.quaternions_xyzw {
            let norm = libm::sqrt(x * x + y * y + z * z + w * w);
            hold(Invariant::Quaternion, (norm - 1.0).abs() <= limits.unit_tolerance, norm, 1.0);
        }
        let age_s = seconds_between(step.command_ns, step.time_ns);
        hold(Invariant::CommandAge, (0.0..=limits.command_age_s).contains(&age_s), age_s, limits.command_age_s);
        for since_ns in [step.blind_since_ns, step.planless_since_ns].into_iter().flatten() {
            if seconds_between(since_ns, step.time_ns) > limits.rest_within_s {
                let (speed, rate) = (step.speed_m_s, step.rate_rad_s);
                let rests = rate <= limits.rest_rate_rad_s;
                hold(Invariant::SafeState, speed <= limits.rest_speed_m_s, speed, limits.rest_speed_m_s);
                hold(Invariant::SafeState, rests, rate, limits.rest_rate_rad_s);
            }
        }
        broken + self.see_revisions(step)
    }

    fn see_revisions(&mut self, step: &WatchedStep<'_>) -> u32 {
        let mut broken = 0;
        let (offered, named) = (step.offered_revision, step.command_revision);
        for (invariant, older, newer) in [
            (Invariant::OfferedRevision, self.newest_offered, offered),
            (Invariant::CommandRevision, named, offered),
            (Invariant::AdoptedRevision, self.newest_adopted, named),
        ] {
            if older > newer {
                broken += 1;
                let (found, allowed) =
                    if invariant == Invariant::CommandRevision { (older, newer) } else { (newer, older) };
                let (found, allowed) = (found as f64, allowed as f64);
                self.note(&Violation { time_ns: step.time_ns, invariant, found, allowed });
            }
        }
        self.newest_offered = self.newest_offered.max(offered);
        self.newest_adopted = self.newest_adopted.max(named);
        self.steps += 1;
        broken
    }

    fn note(&mut self, violation: &Violation) {
        if let Some(count) = self.counts.get_mut(violation.invariant as usize) {
            *count += 1;
            if *count <= KEPT {
                self.first.push(*violation);
            }
        }
    }

    /// Steps seen.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// How often an invariant did not hold.
    pub fn count(&self, invariant: Invariant) -> u64 {
        self.counts.get(invariant as usize).copied().unwrap_or(0)
    }

    /// The same of all.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// The first violations of each invariant, sixteen of each at most, in order of time.
    pub fn violations(&self) -> &[Violation] {
        &self.first
    }
}

/// From one time to another, s.
fn seconds_between(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

/// The component that is largest as a share of its limit, or is no number, and its limit.
fn worst_axis(vector: &Vector3<f64>, limit: &Vector3<f64>) -> (f64, f64) {
    let mut worst = (0.0, 0.0);
    let mut largest_excess = f64::NEG_INFINITY;
    for (component, bound) in vector.iter().zip(limit) {
        let (size, bound) = (component.abs(), *bound);
        if size.is_nan() {
            return (size, bound);
        }
        // by how much, not by what factor: a limit may be zero or infinite
        let excess = size - bound;
        if excess > largest_excess || largest_excess == f64::NEG_INFINITY {
            (worst, largest_excess) = ((size, bound), excess);
        }
    }
    worst
}

/// The least pivot of a Cholesky factorisation of the correlations: positive where the covariance is positive definite, whatever the
/// units. Rows and columns of zeros, of what is known, are left out; NaN where a number is none or the matrix is not symmetric.
fn least_pivot(covariance: &SMatrix<f64, 10, 10>) -> f64 {
    let sizes = covariance.diagonal().map(libm::sqrt);
    let mut factor = SMatrix::<f64, 10, 10>::zeros();
    let mut least = 1.0_f64;
    for row in 0..10 {
        let is_known = covariance.row(row).iter().chain(covariance.column(row).iter()).all(|entry| *entry == 0.0);
        for column in 0..=row {
            let scale = sizes[row] * sizes[column];
            let (entry, mirrored) = (covariance[(row, column)] / scale, covariance[(column, row)] / scale);
            if is_known || (scale == 0.0 && entry.is_nan() && covariance[(row, column)] == 0.0) {
                continue;
            }
            if !(entry.is_finite() && (entry - mirrored).abs() <= SYMMETRY) {
                return f64::NAN;
            }
            let mut rest = entry;
            for k in 0..column {
                rest -= factor[(row, k)] * factor[(column, k)];
            }
            if row == column {
                least = least.min(rest);
                if rest <= 0.0 || rest.is_nan() {
                    return rest;
                }
                factor[(row, row)] = libm::sqrt(rest);
            } else {
                factor[(row, column)] = rest / factor[(column, column)];
            }
        }
    }
    least
}

/// Largest difference of two correlations that should be the same.
const SYMMETRY: f64 = 1e-6;

#[cfg(test)]
mod tests;
