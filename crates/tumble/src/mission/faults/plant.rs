//! Faults as a decoration of the simulator.

use super::Faults;
use tumble_astrobee::AstrobeeError;
use tumble_astrobee::sensing::LocalizationEstimate;
use tumble_astrobee::simulator::{AstrobeeSimulator, SimulatorMeasurement};
use tumble_lie::Wrench;
use tumble_planning::mission::PlantFault;

/// Changes wrench, hardware and body before a step, and the estimates after it; all of them are in [`Faults::heard`].
///
/// A step of several control periods has one wrench, and its estimates are changed as if all had arrived at its end.
impl PlantFault<AstrobeeSimulator> for Faults {
    fn before(&mut self, plant: &mut AstrobeeSimulator, input: Wrench<f64>) -> Result<Wrench<f64>, AstrobeeError> {
        let change = self.before_step(plant.time_ns(), &input);
        change.apply(plant)?;
        Ok(change.wanted)
    }

    fn after(&mut self, plant: &AstrobeeSimulator, measurement: SimulatorMeasurement) -> SimulatorMeasurement {
        let mut heard = std::mem::take(&mut self.heard);
        self.measurements(plant.time_ns(), plant.estimates(), &mut heard);
        for estimate in &heard {
            if self.newest.is_none_or(|newest| newest.stamp_ns < estimate.stamp_ns) {
                self.newest = Some(*estimate);
            }
        }
        self.heard = heard;
        SimulatorMeasurement { estimate: self.newest, ..measurement }
    }
}

impl Faults {
    /// What was heard after the last step as a [`PlantFault`], in order of arrival.
    pub fn heard(&self) -> &[LocalizationEstimate] {
        &self.heard
    }
}
