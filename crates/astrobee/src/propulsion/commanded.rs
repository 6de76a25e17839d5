//! The nozzles as an estimator is told of them: where they are, which way they push, and how hard.

use super::constants::{AXIS_GROUPS, FLAP_TRAVEL_RAD, NOZZLES};
use super::nozzle::Module;
use super::{ImpellerMode, InverseAllocation, PropulsionCommand};
use tumble_dynamics::nalgebra::Vector6;
use tumble_identification::actuators::{Actuator, Actuators, CommonErrors};
use tumble_identification::recursive::ErringThruster;

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

/// The nozzles as an estimator in flight is told of them, in the order of [`NOZZLES`], each off by a share of `thrust_sigma`; body axes, torque about
/// the origin. Those of an axis cancel.
pub fn erring_nozzles(thrust_sigma: f64) -> [ErringThruster; 12] {
    let group = |nozzle: usize| AXIS_GROUPS.iter().position(|group| group.contains(&nozzle)).unwrap_or_default();
    core::array::from_fn(|nozzle| ErringThruster {
        push_body: Vector6::from(NOZZLES[nozzle].wrench_per_thrust()).into(),
        relative: thrust_sigma,
        group: group(nozzle),
        supply: nozzle / 6,
    })
}

#[cfg(test)]
mod tests {
    use super::super::nozzle::thrusts_of_wrench;
    use super::super::{ForceAllocation, PositivityShift, PropulsionPlant, PropulsionSettings};
    use super::*;
    use tumble_dynamics::nalgebra::Vector3;
    use tumble_identification::noise::Gaussian;
    use tumble_lie::Wrench;

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

    /// What nozzles that are off make of a wrench is what an estimator is told that they do: so much more of what each contributes.
    #[test]
    fn nozzles_that_err_do_what_is_told_of_them() {
        let mut random = Gaussian::from_seed(7);
        let mode = ImpellerMode::Nominal;
        let allocation = ForceAllocation::new(mode, Vector3::zeros());
        let told = erring_nozzles(0.01);
        for _ in 0..20 {
            let wrench = Wrench::new(
                Vector3::from_fn(|_, _| 0.003 * random.normal()),
                Vector3::from_fn(|_, _| 0.05 * random.normal()),
            );
            let factors: [f64; 12] = core::array::from_fn(|_| 1.0 + 0.1 * random.normal());
            let bytes = allocation.allocate_steps(&wrench).unwrap().bytes;
            let settled = |nozzle_factors: [f64; 12]| {
                let settings = PropulsionSettings { nozzle_factors, ..PropulsionSettings::PHYSICAL };
                let mut plant = PropulsionPlant::spun_up(settings, mode);
                (0..300).map(|_| plant.step(&bytes, &Vector3::zeros())).last().unwrap()
            };
            let (erring, known) = (settled(factors), settled([1.0; 12]));
            let thrusts_n = PositivityShift::default().apply(&thrusts_of_wrench(&wrench));
            let mut more = Vector6::zeros();
            for ((nozzle, factor), thrust_n) in told.iter().zip(factors).zip(thrusts_n) {
                more += nozzle.push_body.to_vector() * (thrust_n * (factor - 1.0));
            }
            let off = (erring.wrench_body - known.wrench_body).to_vector();
            assert!((off - more).norm() < 0.1 * more.norm() + 1e-4, "{off} {more}");
        }
    }
}
