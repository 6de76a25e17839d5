//! What goes wrong in a mission, on purpose: one seed decides when and how.
//!
//! A [`Fault`] is a small type that does one thing wrong. [`Faults`] holds those of a mission; between localisation and estimator
//! it changes what arrives, before each step it changes the wrench and the plant, and it is asked whether a planner answers. All
//! begin after the first ten to fifteen seconds (a quarter of a short flight) and are over by 60 % of the flight, but for damage that
//! stays: nozzles and the body.

mod choice;
mod contents;
mod decisions;
mod fault;
mod losses;
mod machine;
mod plant;
mod replay;
#[cfg(test)]
mod tests;
mod window;

pub use choice::FaultChoiceError;
pub use fault::{Counts, Fault, LateObstacle, PlannerFault, PlantChange, Sabotage};
pub use replay::replay_line;
pub use tumble_astrobee::simulator::BodyStep;

use super::options::{FaultChoice, FaultName};
use tumble_astrobee::sensing::LocalizationEstimate;
use tumble_dynamics::WrenchBox;
use tumble_identification::noise::{Gaussian, spread};
use tumble_lie::Wrench;

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
