//! Pulses that outlast the period in which they were asked for.

use super::{Actuation, ActuatorDrive, Driven, PulsedThrusters};
use crate::error::DynamicsError;
use tumble_lie::Wrench;
use tumble_lie::nalgebra::SVector;

/// Thrusters whose pulses all begin with the valves' own period, which need not be the simulator's; a pulse is drawn out
/// over as many control periods as it lasts, and each has the mean of its part.
#[derive(Clone, Debug)]
pub struct PulseTrain<const N: usize> {
    thrusters: PulsedThrusters<N>,
    ticks_per_step: u32,
    /// Within the valves' period.
    tick: u32,
    pulses: [u32; N],
}

impl<const N: usize> PulseTrain<N> {
    /// Closed valves at the beginning of their period; their clock ticks `ticks_per_step` times in a control period.
    pub fn new(thrusters: PulsedThrusters<N>, ticks_per_step: u32) -> Self {
        Self { thrusters, ticks_per_step, tick: 0, pulses: [0; N] }
    }
}

/// Each call is a control period, whatever `hold_s` is; at a limit is a valve that is open throughout its own period.
impl<const N: usize> ActuatorDrive for PulseTrain<N> {
    fn drive(&mut self, wanted_body: &Wrench<f64>, _hold_s: f64) -> Result<Driven, DynamicsError> {
        if !wanted_body.to_vector().iter().all(|number| number.is_finite()) {
            return Err(DynamicsError::NotFinite);
        }
        let mut open = [0_u32; N];
        for _ in 0..self.ticks_per_step {
            if self.tick == 0 {
                self.pulses = self.thrusters.allocate(wanted_body)?;
            }
            for (open, pulse) in open.iter_mut().zip(&self.pulses) {
                *open += u32::from(self.tick < *pulse);
            }
            self.tick = (self.tick + 1) % self.thrusters.timing.ticks_per_period.max(1);
        }
        let set = &self.thrusters.thrusters;
        let share = |i: usize| f64::from(open[i]) / f64::from(self.ticks_per_step.max(1));
        let thrusts = SVector::from_fn(|i, _| set.thrusters()[i].largest_thrust_n * share(i));
        let is_at_limit = self.pulses.iter().any(|pulse| *pulse >= self.thrusters.timing.ticks_per_period);
        Ok(Driven { wrench_body: set.realize(&thrusts), is_at_limit })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{PulseTiming, Thruster, ThrusterSet};
    use tumble_lie::nalgebra::{UnitVector3, Vector3};

    const THRUST_N: f64 = 0.112;
    const TICKS_PER_STEP: u32 = 16;

    /// Two valves push along each axis and two against it, one at either end of a lever.
    fn valves() -> PulsedThrusters<12> {
        let along = |axis: usize, size: f64| Vector3::from_fn(|row, _| if row == axis % 3 { size } else { 0.0 });
        let set = std::array::from_fn(|i| Thruster {
            position_body: along(i / 4 + 2, if i % 2 == 0 { 0.0965 } else { -0.0965 }),
            direction_body: UnitVector3::new_unchecked(along(i / 4, if i % 4 < 2 { 1.0 } else { -1.0 })),
            largest_thrust_n: THRUST_N,
        });
        let timing = PulseTiming { ticks_per_period: 200, shortest_ticks: 10 };
        PulsedThrusters { thrusters: ThrusterSet::try_new(set).unwrap(), timing }
    }

    /// Pulses of 20 of 24 ticks, in steps of 16: open for 16, then 4 and 8 of the next, then its other 12.
    #[test]
    fn a_pulse_is_drawn_out_over_the_steps_it_lasts() {
        let timing = PulseTiming { ticks_per_period: 24, shortest_ticks: 2 };
        let valves = valves();
        let set: [Thruster; 12] = *valves.thrusters.thrusters();
        let mut train = PulseTrain::new(PulsedThrusters { thrusters: ThrusterSet::try_new(set).unwrap(), timing }, 16);
        let thrust = 20.0 / 24.0 * 2.0 * THRUST_N;
        let wanted = Wrench::new(Vector3::zeros(), Vector3::new(thrust, 0.0, 0.0));
        for open in [16.0, 12.0, 12.0, 16.0, 12.0, 12.0] {
            let Driven { wrench_body: given, is_at_limit } = train.drive(&wanted, 0.016).unwrap();
            assert!((given.force.x - 2.0 * THRUST_N * open / 16.0).abs() < 1e-15, "{given:?}");
            assert!(!is_at_limit && given.torque.amax() < 1e-15 && given.force.yz().amax() < 1e-15);
        }
    }

    /// Two periods of the valves are 25 steps: their impulse is that of the pulses, whatever is wanted in between.
    #[test]
    fn no_impulse_is_lost_where_periods_do_not_divide() {
        let valves = valves();
        let mut train = PulseTrain::new(valves, TICKS_PER_STEP);
        let wanted = |k: i32| {
            let phase = f64::from(k);
            Wrench::new(Vector3::new(0.003, -0.002, 0.001) * phase.cos(), Vector3::new(0.05, 0.03, -0.07) * phase.sin())
        };
        let total = (0..25).fold(Wrench::zero(), |sum, k| sum + train.drive(&wanted(k), 0.016).unwrap().wrench_body);
        // The second period begins within step 12.
        let pulses = [0, 12].map(|k| valves.realize(&valves.allocate(&wanted(k)).unwrap()));
        let expected = (pulses[0] + pulses[1]) * 12.5;
        assert!((total + expected * -1.0).to_vector().amax() < 1e-12, "{total:?} {expected:?}");
        assert!(expected.force.norm() > 0.1);
    }
}
