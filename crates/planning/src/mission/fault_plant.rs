//! A plant in which things go wrong: for tests of whatever flies it.

use tumble_dynamics::Plant;

/// What goes wrong with a plant. Both methods change nothing by default.
pub trait PlantFault<P: Plant> {
    /// Before a step: the input that really reaches the plant, which may be changed itself: something breaks, something is added.
    ///
    /// # Errors
    /// A change that the plant refuses.
    fn before(&mut self, plant: &mut P, input: P::Input) -> Result<P::Input, P::Error> {
        let _ = plant;
        Ok(input)
    }

    /// After a step: what is told instead of what was measured.
    fn after(&mut self, plant: &P, measurement: P::Measurement) -> P::Measurement {
        let _ = plant;
        measurement
    }
}

/// Nothing goes wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoFault;

impl<P: Plant> PlantFault<P> for NoFault {}

/// A plant and what goes wrong with it; itself a [`Plant`], so that nobody who flies it need know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultPlant<P, F> {
    /// The plant.
    pub plant: P,
    /// What goes wrong.
    pub fault: F,
}

impl<P, F> FaultPlant<P, F> {
    /// The plant with its faults.
    pub fn new(plant: P, fault: F) -> Self {
        Self { plant, fault }
    }
}

impl<P, F> Plant for FaultPlant<P, F>
where
    P: Plant<Input: Clone>,
    F: PlantFault<P>,
{
    type Input = P::Input;
    type Measurement = P::Measurement;
    type Error = P::Error;

    fn advance(&mut self, input: &P::Input, duration_s: f64) -> Result<P::Measurement, P::Error> {
        let given = self.fault.before(&mut self.plant, input.clone())?;
        let measured = self.plant.advance(&given, duration_s)?;
        Ok(self.fault.after(&self.plant, measured))
    }
}
