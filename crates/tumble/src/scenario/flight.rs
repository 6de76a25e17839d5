//! A robot that flies a scenario.

use crate::TumbleError;
use tumble_astrobee::control_presets::ControlLimits;
use tumble_astrobee::sensing::LocalizationEstimate;
use tumble_astrobee::simulator::{
    AstrobeeSimulator, CONTROL_PERIOD_S, Drive, Grasp, PayloadMotion, SimulatorMeasurement,
};
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{Plant, World};
use tumble_lie::{Pose, Wrench};

/// Name of computed torque with the believed body, which steers where nothing else is asked for.
pub(crate) const TRACKER: &str = "tracker";
/// Name of the cascade that Astrobee flies.
pub(crate) const FLOWN: &str = "flown";
/// Name of no controller.
pub(super) const NONE: &str = "none";

/// Who steers, within which limits, and what becomes of it is judged by.
#[derive(Clone, Debug, PartialEq)]
pub struct Steering {
    /// Who.
    pub controller: String,
    /// What it keeps its wrench within; `None` for those that know no limits.
    pub limits: Option<ControlLimits>,
    /// Time between its decisions, s; `None` for those that decide at every output.
    pub decision_s: Option<f64>,
    /// Largest acceleration along each world axis that a tube leaves to its plans before the first belief, m/s^2.
    pub planned_m_s2: Option<Vector3<f64>>,
}

impl Steering {
    /// Whether the log and the summary tell what the controller says.
    pub fn is_accounted(&self) -> bool {
        self.limits.is_some()
    }
}

/// A payload is taken hold of or let go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PayloadChange {
    /// Taken hold of.
    Attach(Grasp, PayloadMotion),
    /// Let go.
    Release,
}

/// A robot that flies a scenario.
pub struct Flight {
    /// The robot and its world.
    pub simulator: AstrobeeSimulator,
    /// What asks for wrenches.
    pub drive: Drive,
    /// Who steers, and within which limits.
    pub steering: Steering,
    /// Where the robot is to be in the end.
    pub goal: Option<Pose<f64>>,
    /// Where it flies.
    pub place: WorldPreset,
    /// Volumes and obstacles, for pictures.
    pub world: World,
    /// Its length in whole control periods, ns.
    pub duration_ns: i64,
    pub(super) payload_changes: Vec<(i64, PayloadChange)>,
    pub(super) estimate: Option<LocalizationEstimate>,
}

impl Flight {
    /// One control period; `None` at the end.
    ///
    /// # Errors
    /// [`AstrobeeError::Simulator`](tumble_astrobee::AstrobeeError::Simulator).
    pub fn step(&mut self) -> Result<Option<SimulatorMeasurement>, TumbleError> {
        let time_ns = self.simulator.time_ns();
        if time_ns >= self.duration_ns {
            return Ok(None);
        }
        let wanted = self.drive.wanted(time_ns, self.estimate.as_ref()).map_err(TumbleError::Control)?;
        self.push(&wanted).map(Some)
    }

    /// One control period with a wrench from elsewhere, however late it is; payloads come and go at their times.
    ///
    /// # Errors
    /// [`AstrobeeError::Simulator`](tumble_astrobee::AstrobeeError::Simulator).
    pub fn push(&mut self, wanted: &Wrench<f64>) -> Result<SimulatorMeasurement, TumbleError> {
        let time_ns = self.simulator.time_ns();
        while let Some((_, change)) = self.payload_changes.first().filter(|(due_ns, _)| *due_ns <= time_ns) {
            match change {
                PayloadChange::Attach(grasp, motion) => self.simulator.attach(*grasp, *motion)?,
                PayloadChange::Release => drop(self.simulator.release()?),
            }
            self.payload_changes.remove(0);
        }
        let measured = self.simulator.advance(wanted, CONTROL_PERIOD_S)?;
        self.estimate = measured.estimate;
        Ok(measured)
    }
}
