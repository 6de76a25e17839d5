//! What may look on while a mission is flown.

use crate::TumbleError;
use tumble_astrobee::sensing::LocalizationEstimate;
use tumble_astrobee::simulator::SimulatorMeasurement;
use tumble_identification::Estimate;
use tumble_planning::mission::{Action, Layer, TimedEvent};

/// What looks on while a mission is flown, and may measure what it costs; nothing that happens depends on it.
///
/// # Example
/// ```
/// use tumble::TumbleError;
/// use tumble::mission::{FlownPeriod, FlyOptions, LayerNames, MissionHooks, ModelChoice, WeightingChoice, fly};
/// use tumble::scenario::ScenarioSource;
///
/// /// The believed mass in every control period.
/// #[derive(Default)]
/// struct Masses(Vec<f64>);
/// impl MissionHooks for Masses {
///     fn period(&mut self, period: &FlownPeriod<'_>) -> Result<(), TumbleError> {
///         self.0.push(period.belief.parameters.mass);
///         Ok(())
///     }
/// }
/// let mut source = ScenarioSource::find("granite-cargo")?;
/// source.scenario.duration_s = 1.0;
/// let options = FlyOptions {
///     seed: 3,
///     weighting: WeightingChoice::Covariance,
///     feedback: true,
///     model: ModelChoice::Scenario,
///     fault: None,
///     layers: LayerNames::default(),
/// };
/// let mut masses = Masses::default();
/// fly(&source, &options, &mut masses)?;
/// assert!(masses.0.len() > 50 && masses.0.iter().all(|mass_kg| *mass_kg > 0.0));
/// # Ok::<(), TumbleError>(())
/// ```
/// Tutorial: [a mission written down as it is flown](https://github.com/tumble-robotics/tumble/blob/main/crates/tumble/examples/same_missions.rs).
pub trait MissionHooks {
    /// So far, of so long at most, s.
    fn progress(&mut self, _time_s: f64, _longest_s: f64) {}
    /// A layer begins to work.
    fn begins(&mut self, _layer: Layer) {}
    /// It is done.
    fn ends(&mut self, _layer: Layer) {}
    /// A control period: what was measured and published, and who believes what.
    ///
    /// # Errors
    /// What stops the mission.
    fn period(&mut self, _period: &FlownPeriod<'_>) -> Result<(), TumbleError> {
        Ok(())
    }
    /// The coordinator heard of something.
    fn heard(&mut self, _event: &TimedEvent) {}
    /// It answered.
    fn answered(&mut self, _time_ns: i64, _action: &Action) {}
}

/// Looks at nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoHooks;

impl MissionHooks for NoHooks {}

/// A control period of a mission.
pub struct FlownPeriod<'a> {
    /// What the simulator says of it.
    pub measured: &'a SimulatorMeasurement,
    /// What arrived in it.
    pub estimates: &'a [LocalizationEstimate],
    /// What the estimator takes the body for, in the order of the summary, with standard deviations.
    pub estimate: ([f64; 10], [f64; 10]),
    /// The same with its whole covariance.
    pub belief: &'a Estimate,
    /// Number of the stretch that is flown.
    pub plan_revision: u64,
    /// Revision of the belief that the controller uses.
    pub belief_revision: u64,
}
