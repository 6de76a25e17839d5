//! What goes wrong in a mission, on purpose: one seed decides when and how.
//!
//! A [`Fault`] is a small type that does one thing wrong. [`Faults`] holds those of a mission; between localisation and estimator
//! it changes what arrives, before each step it changes the wrench and the plant, and it is asked whether a planner answers. All
//! begin after the first ten to fifteen seconds (a quarter of a short flight) and are over by 60 % of the flight, but for damage that
//! stays: nozzles and the body.

mod choice;
mod contents;
mod decisions;
mod losses;
mod machine;
mod plant;
mod replay;
#[cfg(test)]
mod tests;
mod window;

pub use choice::FaultChoiceError;
pub use replay::replay_line;
pub use tumble_astrobee::simulator::BodyStep;

use super::options::{FaultChoice, FaultName};
use std::collections::BTreeMap;
use tumble_astrobee::AstrobeeError;
use tumble_astrobee::propulsion::Damage;
use tumble_astrobee::sensing::LocalizationEstimate;
use tumble_astrobee::simulator::AstrobeeSimulator;
use tumble_dynamics::WrenchBox;
use tumble_identification::noise::{Gaussian, spread};
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
fn add(counts: &mut Counts, name: &str, count: u64) {
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

/// All that goes wrong in one mission; the same seed does the same to the bit.
///
/// ```
/// use tumble::mission::{Faults, PlannerFault};
/// use tumble_dynamics::lie::Wrench;
/// let mut faults = Faults::new(Some("saturation:3".parse()?), 7, 100.0);
/// let wanted = Wrench::new([0.01, 0.0, 0.0].into(), [0.1, 0.0, 0.0].into());
/// // all is well at first
/// assert_eq!(faults.before_step(0, &wanted).wanted, wanted);
/// // and when the 5 s have come that begin between 10 and 15 s after the start, nothing is left of the wrench
/// assert_eq!(faults.before_step(15_000_000_000, &wanted).wanted, Wrench::zero());
/// assert_eq!(faults.counts().get("wrenches-cut"), Some(&1));
/// assert_eq!(faults.planner(1), PlannerFault::None);
/// # Ok::<(), tumble::mission::FaultChoiceError>(())
/// ```
#[allow(clippy::struct_field_names)] // the faults of the faults
pub struct Faults {
    faults: Vec<Box<dyn Fault>>,
    time_ns: i64,
    heard: Vec<LocalizationEstimate>,
    newest: Option<LocalizationEstimate>,
}

/// The fault of a choice, with random numbers of its own.
fn fault(choice: FaultChoice, seed: u64, duration_s: f64) -> Box<dyn Fault> {
    let FaultChoice { name, severity } = choice;
    let random = Gaussian::from_seed(spread(spread(seed ^ FAULTS) ^ (name as u64)));
    match name {
        FaultName::Drop => Box::new(losses::Drop::new(severity, random, duration_s)),
        FaultName::Delay => Box::new(losses::Delay::new(severity, random, duration_s)),
        FaultName::Duplicate => Box::new(losses::Duplicate::new(severity, random, duration_s)),
        FaultName::Clock => Box::new(contents::Clock::new(severity, random, duration_s)),
        FaultName::Malformed => Box::new(contents::Malformed::new(severity, random, duration_s)),
        FaultName::Frozen => Box::new(contents::Frozen::new(severity, random, duration_s)),
        FaultName::Jump => Box::new(contents::Jump::new(severity, random, duration_s)),
        FaultName::Saturation => Box::new(machine::Saturation::new(severity, random, duration_s)),
        FaultName::Nozzle => Box::new(machine::Nozzle::new(severity, random, duration_s)),
        FaultName::Power => Box::new(machine::Power::new(severity, random, duration_s)),
        FaultName::MassStep => Box::new(machine::MassStep::new(severity, random, duration_s)),
        FaultName::Divergence => Box::new(decisions::Divergence::new(severity, random, duration_s)),
        FaultName::Planner => Box::new(decisions::Planner::new(severity, random, duration_s)),
        FaultName::LateObstacle => Box::new(decisions::Obstacle::new(severity, random, duration_s)),
    }
}

/// Sets the random numbers of faults apart from those of sensors, nozzles, ...
const FAULTS: u64 = 0x4641_554c_5453;

impl Faults {
    /// At most one kind of fault in a flight of this length.
    pub fn new(choice: Option<FaultChoice>, seed: u64, duration_s: f64) -> Self {
        Self::mixed(choice.as_slice(), seed, duration_s)
    }

    /// Several at once, in this order; each begins when it does alone.
    pub fn mixed(choices: &[FaultChoice], seed: u64, duration_s: f64) -> Self {
        Self::of(choices.iter().map(|choice| fault(*choice, seed, duration_s)).collect())
    }

    /// Faults of any kind.
    pub fn of(faults: Vec<Box<dyn Fault>>) -> Self {
        Self { faults, time_ns: 0, heard: Vec::new(), newest: None }
    }

    /// With the limits that saturation makes smaller; without this those of RATTLE's controllers.
    #[must_use]
    pub fn limited_to(mut self, limits: WrenchBox) -> Self {
        for fault in &mut self.faults {
            fault.limited_to(&limits);
        }
        self
    }

    /// For a robot on a table: jumps and drifts stay in the plane.
    #[must_use]
    pub fn in_plane(mut self) -> Self {
        for fault in &mut self.faults {
            fault.in_plane();
        }
        self
    }

    /// What the estimator hears of what arrived in the control period that ends at `time_ns`: `out` is emptied first.
    pub fn measurements(
        &mut self,
        time_ns: i64,
        arrived: &[LocalizationEstimate],
        out: &mut Vec<LocalizationEstimate>,
    ) {
        self.time_ns = self.time_ns.max(time_ns);
        out.clear();
        out.extend_from_slice(arrived);
        for fault in &mut self.faults {
            fault.pass(time_ns, out);
        }
    }

    /// What reaches the plant in the control period that begins at `time_ns`.
    pub fn before_step(&mut self, time_ns: i64, wanted: &Wrench<f64>) -> PlantChange {
        self.time_ns = self.time_ns.max(time_ns);
        let mut change = PlantChange::asking(*wanted);
        for fault in &mut self.faults {
            fault.act(time_ns, &mut change);
        }
        change
    }

    /// What becomes of a planner's request, at the latest time heard of; requests are numbered in the order they are made.
    pub fn planner(&mut self, request: u64) -> PlannerFault {
        let time_ns = self.time_ns;
        self.faults.iter_mut().fold(PlannerFault::None, |worst, fault| match fault.planner(time_ns, request) {
            PlannerFault::None => worst,
            found => found,
        })
    }

    /// Whether the computer starts anew now: once for each time it does.
    pub fn restart_due(&mut self, time_ns: i64) -> bool {
        // every fault is asked, whatever another said
        self.faults.iter_mut().map(|fault| fault.restart_due(time_ns)).filter(|due| *due).count() > 0
    }

    /// What is done to the estimator now: once.
    pub fn sabotage(&mut self, time_ns: i64) -> Option<Sabotage> {
        self.faults.iter_mut().fold(None, |found, fault| fault.sabotage(time_ns).or(found))
    }

    /// The obstacle that shows up late.
    pub fn late_obstacle(&self) -> Option<LateObstacle> {
        self.faults.iter().find_map(|fault| fault.late_obstacle())
    }

    /// What went wrong so far, and how often; nothing that did not.
    pub fn counts(&self) -> Counts {
        let mut counts = Counts::new();
        for fault in &self.faults {
            fault.count(&mut counts);
        }
        counts.retain(|_, count| *count > 0);
        counts
    }
}
