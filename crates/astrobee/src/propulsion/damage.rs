//! What of the propulsion is broken.

use super::constants::FLAP_TRAVEL_RAD;
use super::nozzle::{PositivityShift, joined, thrusts_of_wrench, wrench_of_thrusts};
use super::{ImpellerMode, InverseAllocation, PropulsionCommand};
use tumble_lie::Wrench;

/// What of the propulsion is broken; nothing by default. The robot does not know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damage {
    /// Factor on every thrust.
    pub thrust_factor: f64,
    /// Nozzles that do not obey: the share of their travel at which they stand, 0 closed, 1 open; in the order of
    /// [`constants::NOZZLES`](super::constants::NOZZLES).
    pub stuck: [Option<f64>; 12],
    /// Modules whose impeller is told to stop, starboard first: it slows down by 200 rpm/s.
    pub impeller_off: [bool; 2],
    /// Factor on the voltage of the supply.
    pub supply_factor: f64,
}

impl Damage {
    /// All is well.
    pub const NONE: Self = Self { thrust_factor: 1.0, stuck: [None; 12], impeller_off: [false; 2], supply_factor: 1.0 };

    /// What the modules hear of a command.
    pub(super) fn heard(&self, command: &PropulsionCommand) -> PropulsionCommand {
        let mut heard = *command;
        for (speed, off) in heard.impeller_speeds.iter_mut().zip(self.impeller_off) {
            if off {
                *speed = 0;
            }
        }
        heard
    }

    /// Where flaps stand that would stand at these angles.
    pub(super) fn flaps_rad(&self, obeying_rad: [f64; 12]) -> [f64; 12] {
        let mut flaps_rad = obeying_rad;
        for (flap_rad, stuck) in flaps_rad.iter_mut().zip(self.stuck) {
            if let Some(share) = stuck {
                *flap_rad = share.clamp(0.0, 1.0) * FLAP_TRAVEL_RAD;
            }
        }
        flaps_rad
    }

    /// What becomes of a wrench where no modules are simulated: the nozzles share it as the flight software has it, and give what
    /// they still can. A nozzle that is stuck open gives what it does alone at nominal speed; an impeller stops at once.
    ///
    /// # Frame
    /// Body axes, torque about the body origin.
    pub fn of_wrench(&self, wrench_body: &Wrench<f64>) -> Wrench<f64> {
        let mut left = *wrench_body;
        if self.stuck != Self::NONE.stuck || self.impeller_off != Self::NONE.impeller_off {
            let speeds_rad_s = [ImpellerMode::Nominal.speed_rad_s(); 2];
            let mut thrusts_n = PositivityShift::AxisGroups.apply(&thrusts_of_wrench(wrench_body));
            for (nozzle, thrust_n) in thrusts_n.iter_mut().enumerate() {
                if let Some(Some(share)) = self.stuck.get(nozzle) {
                    let mut alone = Self::NONE;
                    if let Some(stuck) = alone.stuck.get_mut(nozzle) {
                        *stuck = Some(*share);
                    }
                    let flow = InverseAllocation::default().flow_of_openings(speeds_rad_s, &alone.flaps_rad([0.0; 12]));
                    *thrust_n = joined(flow.map(|flow| flow.thrusts_n)).get(nozzle).copied().unwrap_or(0.0);
                }
                if self.impeller_off.get(nozzle / 6).copied().unwrap_or(false) {
                    *thrust_n = 0.0;
                }
            }
            left = wrench_of_thrusts(&thrusts_n);
        }
        left * self.thrust_factor
    }
}

impl Default for Damage {
    fn default() -> Self {
        Self::NONE
    }
}

#[cfg(test)]
mod tests {
    use super::super::constants::NOZZLES;
    use super::super::{Module, PropulsionPlant, PropulsionSettings};
    use super::*;
    use tumble_dynamics::nalgebra::Vector3;

    fn stuck(nozzle: usize, share: f64) -> Damage {
        let mut damage = Damage::NONE;
        damage.stuck[nozzle] = Some(share);
        damage
    }

    fn wanted() -> Wrench<f64> {
        Wrench::new(Vector3::new(0.004, -0.003, 0.005), Vector3::new(0.09, -0.06, 0.04))
    }

    /// The wrench of one nozzle's thrust, from its place and the direction of its air alone.
    fn of_nozzle(nozzle: usize, thrust_n: f64) -> Wrench<f64> {
        let force = Vector3::from(NOZZLES[nozzle].outflow_body) * -thrust_n;
        Wrench::new(Vector3::from(NOZZLES[nozzle].position_body_m).cross(&force), force)
    }

    #[test]
    fn without_damage_nothing_changes_to_the_bit() {
        assert_eq!(Damage::default().of_wrench(&wanted()), wanted());
        let command = PropulsionCommand { impeller_speeds: [207; 2], nozzles: [90; 12] };
        assert_eq!(Damage::NONE.heard(&command), command);
        let mut plants = [PropulsionPlant::spun_up(PropulsionSettings::PHYSICAL, ImpellerMode::Nominal); 2];
        plants[1].set_damage(stuck(4, 1.0));
        plants[1].set_damage(Damage::NONE);
        for _ in 0..50 {
            let [a, b] = plants.each_mut().map(|plant| plant.step(&command, &Vector3::zeros()));
            assert_eq!(a, b);
        }
    }

    /// Each closed nozzle takes its own thrust out of the wrench, and no other's.
    #[test]
    fn a_dead_nozzle_takes_its_own_wrench_away() {
        let thrusts_n = PositivityShift::AxisGroups.apply(&thrusts_of_wrench(&wanted()));
        let mut share_of_all = 0.0;
        for (nozzle, thrust_n) in thrusts_n.into_iter().enumerate() {
            let missing = wanted() + stuck(nozzle, 0.0).of_wrench(&wanted()) * -1.0;
            // a closed flap leaves 1e-7 m^2 open
            let module = Module::ALL[nozzle / 6];
            let speed_rad_s = ImpellerMode::Nominal.speed_rad_s();
            let pressure_pa = InverseAllocation::default().module(module, speed_rad_s, &[0.0; 6]).pressure_pa;
            let leak_n = NOZZLES[nozzle].thrust_n(NOZZLES[nozzle].area_m2(0.0), pressure_pa);
            let gone = of_nozzle(nozzle, thrust_n - leak_n);
            assert!((missing + gone * -1.0).to_vector().amax() < 1e-12, "{nozzle}");
            assert!(leak_n < 1e-4);
            share_of_all += missing.force.norm();
        }
        assert!(share_of_all > 0.1, "{share_of_all}");
    }

    #[test]
    fn a_stuck_nozzle_of_the_plant_stands_where_it_is_and_the_others_obey() {
        let command = PropulsionCommand { impeller_speeds: [207; 2], nozzles: [60; 12] };
        for nozzle in 0..12 {
            for share in [0.0, 0.4, 1.0] {
                let mut well = PropulsionPlant::spun_up(PropulsionSettings::PHYSICAL, ImpellerMode::Nominal);
                let mut broken = well;
                broken.set_damage(stuck(nozzle, share));
                let mut steps = [well.step(&command, &Vector3::zeros()), broken.step(&command, &Vector3::zeros())];
                for _ in 0..200 {
                    steps = [well.step(&command, &Vector3::zeros()), broken.step(&command, &Vector3::zeros())];
                }
                let other = 1 - nozzle / 6;
                assert_eq!(steps[0].module_wrenches_body[other], steps[1].module_wrenches_body[other], "{nozzle}");
                // what flows where five flaps stand at their byte and one where it is stuck; the play of the gears is left
                let mut flaps_rad = [60.0 / 255.0 * FLAP_TRAVEL_RAD; 6];
                let module = Module::ALL[nozzle / 6];
                let speed_rad_s = broken.impellers()[nozzle / 6].speed_rad_s();
                let force = |flaps_rad: &[f64; 6]| {
                    let flow = InverseAllocation::default().module(module, speed_rad_s, flaps_rad);
                    module.wrench_of_thrusts(&flow.thrusts_n).force
                };
                let all_obey = force(&flaps_rad);
                flaps_rad[nozzle % 6] = share * FLAP_TRAVEL_RAD;
                let expected = force(&flaps_rad);
                let found = steps[1].module_wrenches_body[nozzle / 6].force;
                let change = (expected - all_obey).norm();
                assert!((found - expected).norm() < 0.02 * change, "{nozzle} {share}: {found} {expected}");
                assert!(change > 1e-3, "{change}");
            }
        }
    }

    #[test]
    fn an_impeller_that_is_off_slows_down_and_comes_back() {
        let command = PropulsionCommand { impeller_speeds: [207; 2], nozzles: [60; 12] };
        let mut plant = PropulsionPlant::spun_up(PropulsionSettings::PHYSICAL, ImpellerMode::Nominal);
        let before = plant.impellers().each_ref().map(super::super::Impeller::speed_rad_s);
        plant.set_damage(Damage { impeller_off: [false, true], ..Damage::NONE });
        for _ in 0..250 {
            plant.step(&command, &Vector3::zeros());
        }
        let after = plant.impellers().each_ref().map(super::super::Impeller::speed_rad_s);
        assert!((after[0] - before[0]).abs() < 0.1, "{after:?}");
        // 4 s at 200 rpm/s, and a little lag
        let fallen = before[1] - after[1];
        assert!((fallen - 4.0 * 20.944).abs() < 8.0, "{fallen}");
        plant.set_damage(Damage::NONE);
        for _ in 0..1_500 {
            plant.step(&command, &Vector3::zeros());
        }
        let again = plant.impellers()[1].speed_rad_s();
        assert!((again - before[1]).abs() < 0.1, "{again}");
    }

    /// The motors have voltage to spare: a supply that sags by 30 % is not felt, one that fails by 60 % is.
    #[test]
    fn a_sagging_supply_is_felt_where_the_motors_need_it() {
        let command = PropulsionCommand { impeller_speeds: [207; 2], nozzles: [60; 12] };
        let speed = |supply_factor: f64| {
            let mut plant = PropulsionPlant::spun_up(PropulsionSettings::PHYSICAL, ImpellerMode::Nominal);
            plant.set_damage(Damage { supply_factor, ..Damage::NONE });
            for _ in 0..1_000 {
                plant.step(&command, &Vector3::zeros());
            }
            plant.impellers()[0].speed_rad_s()
        };
        let well = speed(1.0);
        assert!((speed(0.9) - well).abs() < 1e-9 && (speed(0.7) - well).abs() < 1e-9);
        assert!(speed(0.4) < 0.9 * well, "{} {well}", speed(0.4));
    }

    #[test]
    fn thrust_is_scaled_in_the_plant_and_beside_it() {
        let damage = Damage { thrust_factor: 0.7, ..Damage::NONE };
        assert_eq!(damage.of_wrench(&wanted()), wanted() * 0.7);
        let command =
            PropulsionCommand { impeller_speeds: [207; 2], nozzles: [60, 0, 0, 9, 0, 80, 0, 0, 3, 0, 200, 0] };
        let mut well = PropulsionPlant::settled(PropulsionSettings::PHYSICAL, &command);
        let mut weak = well;
        weak.set_damage(damage);
        let speeds = [ImpellerMode::Nominal.speed_rad_s(); 2];
        let (full, part) = (well.step_at_speeds(&command, speeds), weak.step_at_speeds(&command, speeds));
        assert!((part + full * -0.7).to_vector().amax() < 1e-15 && full.force.norm() > 0.01);
    }
}
