//! One thing that goes wrong, and what it may do.

use std::collections::BTreeMap;
use tumble_astrobee::AstrobeeError;
use tumble_astrobee::propulsion::Damage;
use tumble_astrobee::sensing::LocalizationEstimate;
use tumble_astrobee::simulator::{AstrobeeSimulator, BodyStep};
use tumble_dynamics::WrenchBox;
use tumble_lie::Wrench;

/// What reaches the plant in one control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlantChange {
    /// Wrench really asked of the plant: the flight software knows of this.
    pub wanted: Wrench<f64>,
    /// What of the propulsion is broken: it does not know of that.
    pub damage: Damage,
    /// How the body changes before the step.
    pub body: Option<BodyStep>,
}

impl PlantChange {
    /// A wrench, and nothing wrong.
    pub fn asking(wanted: Wrench<f64>) -> Self {
        Self { wanted, damage: Damage::NONE, body: None }
    }

    /// Breaks the simulator as described; the caller then advances it with [`Self::wanted`].
    ///
    /// # Errors
    /// A body that cannot be.
    pub fn apply(&self, simulator: &mut AstrobeeSimulator) -> Result<(), AstrobeeError> {
        simulator.set_damage(self.damage);
        if let Some(step) = &self.body {
            simulator.step_body(step)?;
        }
        Ok(())
    }
}

/// What becomes of a request to a planner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum PlannerFault {
    /// It is answered.
    #[default]
    None,
    /// The answer takes longer.
    Late {
        /// Factor on the time it takes.
        factor: f64,
    },
    /// Nobody answers.
    NoAnswer,
    /// The planner says that it has none.
    Refused,
    /// The planner dies.
    Panicked,
}

/// As the closed loop sees it: a planner that died never answers.
impl From<PlannerFault> for tumble_planning::mission::PlannerFault {
    fn from(fault: PlannerFault) -> Self {
        match fault {
            PlannerFault::None => Self::None,
            PlannerFault::Late { factor } => Self::Late(factor),
            PlannerFault::NoAnswer | PlannerFault::Panicked => Self::NoAnswer,
            PlannerFault::Refused => Self::Refused,
        }
    }
}

/// What is done to the estimator's belief.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sabotage {
    /// Factor on the believed mass.
    pub mass_factor: f64,
    /// Factor on the believed inertia.
    pub inertia_factor: f64,
    /// Factor on the covariance.
    pub covariance_factor: f64,
}

/// An obstacle that shows up at the last moment; who flies places it on the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LateObstacle {
    /// When it shows up, s; no earlier.
    pub appears_s: f64,
    /// How long before the robot would touch it, s.
    pub notice_s: f64,
}

/// Counted names.
pub type Counts = BTreeMap<String, u64>;

/// A count among the others; names may be counted by several.
pub(super) fn add(counts: &mut Counts, name: &str, count: u64) {
    *counts.entry(name.to_owned()).or_default() += count;
}

/// Something that goes wrong. By default nothing does.
///
/// # Example
/// ```
/// use tumble::mission::{Fault, Faults, PlantChange};
/// use tumble_dynamics::lie::Wrench;
///
/// /// Half of the force is lost from a time on.
/// struct Weak {
///     from_ns: i64,
/// }
/// impl Fault for Weak {
///     fn act(&mut self, time_ns: i64, change: &mut PlantChange) {
///         if time_ns >= self.from_ns {
///             change.wanted.force *= 0.5;
///         }
///     }
/// }
/// let mut faults = Faults::of(vec![Box::new(Weak { from_ns: 1_000_000_000 })]);
/// let wanted = Wrench::new([0.0, 0.0, 0.0].into(), [0.4, 0.0, 0.0].into());
/// assert_eq!(faults.before_step(0, &wanted).wanted, wanted);
/// assert_eq!(faults.before_step(2_000_000_000, &wanted).wanted.force.x, 0.2);
/// ```
/// Tutorial: [measurements that are lost](https://github.com/tumble-robotics/tumble/blob/main/crates/tumble/src/mission/faults/losses.rs).
pub trait Fault {
    /// Told before the flight that the robot is on a table.
    fn in_plane(&mut self) {}

    /// Told before the flight what the robot keeps its wrench within.
    fn limited_to(&mut self, limits: &WrenchBox) {
        let _ = limits;
    }

    /// Changes what has arrived in the control period that ends at `time_ns`: lets it pass, holds it back, adds to it.
    fn pass(&mut self, time_ns: i64, stream: &mut Vec<LocalizationEstimate>) {
        let _ = (time_ns, stream);
    }

    /// Changes what reaches the plant in the control period that begins at `time_ns`.
    fn act(&mut self, time_ns: i64, change: &mut PlantChange) {
        let _ = (time_ns, change);
    }

    /// What becomes of a request to a planner.
    fn planner(&mut self, time_ns: i64, request: u64) -> PlannerFault {
        let _ = (time_ns, request);
        PlannerFault::None
    }

    /// Whether the computer starts anew now.
    fn restart_due(&mut self, time_ns: i64) -> bool {
        let _ = time_ns;
        false
    }

    /// What is done to the estimator now.
    fn sabotage(&mut self, time_ns: i64) -> Option<Sabotage> {
        let _ = time_ns;
        None
    }

    /// An obstacle that shows up late.
    fn late_obstacle(&self) -> Option<LateObstacle> {
        None
    }

    /// Adds what it has done so far.
    fn count(&self, counts: &mut Counts) {
        let _ = counts;
    }
}
