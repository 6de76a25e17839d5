//! The nozzles as an estimator is told of them: where they are, which way they push, and how hard.

use super::constants::{FLAP_TRAVEL_RAD, NOZZLES};
use super::nozzle::Module;
use super::{ImpellerMode, InverseAllocation, PropulsionCommand};
use tumble_identification::actuators::{Actuator, Actuators, CommonErrors};

/// Thrust of each nozzle at a command of one, N: wide open under the pressure of a plenum whose nozzles are shut, which is more than any
/// opening gives.
pub fn largest_thrusts_n(mode: ImpellerMode) -> [f64; 12] {
    let shut = PropulsionCommand { impeller_speeds: [mode.speed_byte(); 2], nozzles: [0; 12] };
    let [starboard, port] = InverseAllocation::default().flow_of_bytes(&shut).map(|flow| flow.pressure_pa);
    let of_module = |module: Module, pressure_pa: f64| {
        module.nozzles().each_ref().map(|nozzle| nozzle.thrust_n(nozzle.area_m2(FLAP_TRAVEL_RAD), pressure_pa))
    };
    super::nozzle::joined([of_module(Module::Starboard, starboard), of_module(Module::Port, port)])
}

/// The nozzles under thrusts as the flight software knows them, shares of [`largest_thrusts_n`]; `None` with the impellers at rest. Each
/// may be off by a share of `thrust_sigma`, all together by one of `scale_sigma`.
///
/// Nothing is late and nothing sags: servos, impellers and plenums are in the thrust that is known.
pub fn commanded_nozzles(mode: ImpellerMode, thrust_sigma: f64, scale_sigma: f64) -> Option<Actuators> {
    if mode == ImpellerMode::Off {
        return None;
    }
    let actuator = |(nozzle, thrust_n): (&super::constants::Nozzle, f64)| Actuator {
        position_m: nozzle.position_body_m,
        direction: nozzle.outflow_body.map(|component| 0.0 - component),
        thrust_n,
        thrust_sigma,
    };
    let actuators = NOZZLES.iter().zip(largest_thrusts_n(mode)).map(actuator).collect();
    Some(Actuators { actuators, common: CommonErrors { scale_sigma, ..CommonErrors::default() } })
}

#[cfg(test)]
mod tests {
    use super::super::{PropulsionPlant, PropulsionSettings};
    use super::*;
    use tumble_dynamics::nalgebra::Vector3;
    use tumble_identification::noise::Gaussian;

    #[test]
    fn no_command_gives_more_than_the_largest_thrust() {
        let mut random = Gaussian::from_seed(4);
        for mode in [ImpellerMode::Quiet, ImpellerMode::Nominal, ImpellerMode::Aggressive] {
            let largest_n = largest_thrusts_n(mode);
            let mut plant = PropulsionPlant::spun_up(PropulsionSettings::PHYSICAL, mode);
            let mut most = 0.0_f64;
            for k in 0..4000 {
                // every so often one nozzle alone, or none, wide open at once: the impellers then swing most
                let wide = (0..12).map(|i| if k / 100 % 13 == i || random.uniform() < 0.01 { 255 } else { 0 });
                let mut command = PropulsionCommand { impeller_speeds: [mode.speed_byte(); 2], nozzles: [0; 12] };
                command.nozzles.iter_mut().zip(wide).for_each(|(byte, wide)| *byte = wide);
                let thrusts_n = plant.step(&command, &Vector3::zeros()).thrusts_n;
                for (thrust_n, largest_n) in thrusts_n.into_iter().zip(largest_n) {
                    assert!(thrust_n > 0.0 && thrust_n < largest_n, "{thrust_n} of {largest_n}");
                    most = most.max(thrust_n / largest_n);
                }
            }
            assert!((0.6..0.97).contains(&most), "{most}");
        }
        assert!(commanded_nozzles(ImpellerMode::Off, 0.0, 0.0).is_none());
    }
}
