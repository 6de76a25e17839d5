//! A plant in which things go wrong: for tests of whatever flies it.

use tumble_dynamics::Plant;

/// What goes wrong with a plant. Both methods change nothing by default.
///
/// # Example
/// ```
/// use tumble_planning::dynamics::{DynamicsError, Plant};
/// use tumble_planning::mission::{FaultPlant, PlantFault};
///
/// /// Counts what it is told.
/// struct Counter(f64);
/// impl Plant for Counter {
///     type Input = f64;
///     type Measurement = f64;
///     type Error = DynamicsError;
///     fn advance(&mut self, input: &f64, _duration_s: f64) -> Result<f64, DynamicsError> {
///         self.0 += input;
///         Ok(self.0)
///     }
/// }
/// /// Half of every input is lost.
/// struct Leak;
/// impl PlantFault<Counter> for Leak {
///     fn before(&mut self, _plant: &mut Counter, input: f64) -> Result<f64, DynamicsError> {
///         Ok(0.5 * input)
///     }
/// }
/// assert_eq!(FaultPlant::new(Counter(0.0), Leak).advance(&4.0, 1.0)?, 2.0);
/// # Ok::<(), DynamicsError>(())
/// ```
/// Tutorial: [faults of a mission, for any plant](https://github.com/tumble-robotics/tumble/blob/main/crates/tumble/src/mission/faults/plant.rs).
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    /// Integrates its input.
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Cart {
        position_m: f64,
        gain: f64,
    }

    impl Plant for Cart {
        type Input = f64;
        type Measurement = f64;
        type Error = Infallible;

        fn advance(&mut self, input: &f64, duration_s: f64) -> Result<f64, Infallible> {
            self.position_m += self.gain * input * duration_s;
            Ok(self.position_m)
        }
    }

    /// Half of the input is lost, the gain changes in the second step, and what is measured is off.
    struct Rough {
        steps: u32,
    }

    impl PlantFault<Cart> for Rough {
        fn before(&mut self, plant: &mut Cart, input: f64) -> Result<f64, Infallible> {
            self.steps += 1;
            if self.steps == 2 {
                plant.gain = 3.0;
            }
            Ok(0.5 * input)
        }

        fn after(&mut self, plant: &Cart, measurement: f64) -> f64 {
            measurement + plant.gain
        }
    }

    /// Any plant, through the trait alone.
    fn fly<P: Plant<Input = f64, Measurement = f64, Error = Infallible>>(plant: &mut P) -> [f64; 3] {
        [1.0, -0.3, 2.0].map(|input| plant.advance(&input, 0.7).unwrap())
    }

    #[test]
    fn without_faults_a_plant_is_itself_to_the_bit() {
        let cart = Cart { position_m: 0.1, gain: 1.1 };
        let (mut bare, mut decorated) = (cart, FaultPlant::new(cart, NoFault));
        assert_eq!(fly(&mut bare).map(f64::to_bits), fly(&mut decorated).map(f64::to_bits));
        assert_eq!(decorated.plant, bare);
    }

    #[test]
    fn faults_reach_input_plant_and_measurement() {
        let mut decorated = FaultPlant::new(Cart { position_m: 0.0, gain: 1.0 }, Rough { steps: 0 });
        let measured = fly(&mut decorated);
        let positions = [0.35, 0.35 - 3.0 * 0.105, 0.035 + 3.0 * 0.7];
        for ((measured, position), gain) in measured.into_iter().zip(positions).zip([1.0, 3.0, 3.0]) {
            assert!((measured - position - gain).abs() < 1e-12, "{measured} {position}");
        }
        assert_eq!(decorated.fault.steps, 3);
    }
}
