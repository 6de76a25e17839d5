//! What goes wrong in a mission, on purpose: one seed decides when and how.
//!
//! A [`Fault`] is a small type that does one thing wrong. [`Faults`] holds those of a mission; between localisation and estimator
//! it changes what arrives, before each step it changes the wrench and the plant, and it is asked whether a planner answers. All
//! begin after the first ten to fifteen seconds (a quarter of a short flight) and are over by 60 % of the flight, but for damage that
//! stays: nozzles and the body.

mod choice;
mod replay;

pub use crate::simulator::BodyStep;
pub use choice::FaultChoiceError;
pub use replay::replay_line;

use super::options::FaultChoice;
use crate::AstrobeeError;
use crate::propulsion::Damage;
use crate::sensing::LocalizationEstimate;
use crate::simulator::AstrobeeSimulator;
use std::collections::BTreeMap;
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

/// Something that goes wrong. By default nothing does.
pub trait Fault {
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
pub struct Faults {
    faults: Vec<Box<dyn Fault>>,
    time_ns: i64,
}

impl Faults {
    /// At most one kind of fault in a flight of this length.
    pub fn new(choice: Option<FaultChoice>, seed: u64, duration_s: f64) -> Self {
        Self::mixed(choice.as_slice(), seed, duration_s)
    }

    /// Several at once; each does what it does alone.
    pub fn mixed(choices: &[FaultChoice], seed: u64, duration_s: f64) -> Self {
        let _ = (choices, seed, duration_s);
        Self { faults: Vec::new(), time_ns: 0 }
    }

    /// With the limits that saturation makes smaller; without this those of RATTLE's controllers.
    #[must_use]
    pub fn limited_to(self, limits: WrenchBox) -> Self {
        let _ = limits;
        self
    }

    /// For a robot on a table: jumps and drifts stay in the plane.
    #[must_use]
    pub fn in_plane(self) -> Self {
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
        self.faults.iter_mut().fold(false, |due, fault| fault.restart_due(time_ns) || due)
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
