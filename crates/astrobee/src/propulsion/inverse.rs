//! From nozzle openings back to the wrench they give.

use super::blower::{
    ALLOCATED_LEAK_AREA_M2, AREA_AT_LARGEST_THRUST_M2, pressure_coefficient_as_allocated, pressure_coefficient_of_area,
    pressure_pa,
};
use super::constants::{FLAP_TRAVEL_RAD, NOZZLE_COUNTS, speed_of_byte_rad_s};
use super::nozzle::{Module, joined, of_modules, wrench_of_thrusts};
use super::{ImpellerMode, PropulsionCommand};
use tumble_lie::Wrench;

/// How far each nozzle is open while the impellers turn as a mode says: a command before it becomes bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlapCommand {
    /// Impeller speed.
    pub mode: ImpellerMode,
    /// Angle of each nozzle's flaps from the closed stop, rad.
    pub openings_rad: [f64; 12],
}

/// Whose word is taken for what openings give.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Belief {
    /// The hardware: each module leaks by its own area, turns at the speed of its byte, and closed flaps pass a little air.
    #[default]
    Hardware,
    /// The allocation, exactly inverted: both modules leak as module 0, turn at their mode's speed, and closed flaps are shut.
    ///
    /// Module 1 really gives 5 % more.
    Allocation,
}

/// Where the table of pressure over area ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum AreaTable {
    /// Beyond six fully open nozzles.
    #[default]
    Full,
    /// At the largest thrust, as the thesis cuts it: past it, where opening further lowers the thrust, the pressure stays.
    Thesis,
}

/// From openings to thrusts and wrench.
///
/// # Source
/// (6.21), (6.22)
/// # Deviation
/// With [`AreaTable::Thesis`] a saturated command's force comes out up to 0.06 N too large; test
/// `the_thesis_table_overstates_saturated_thrust`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InverseAllocation {
    /// Whose word is taken.
    pub belief: Belief,
    /// Which table.
    pub table: AreaTable,
}

/// What one module does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModuleFlow {
    /// Leak area plus discharge coefficient times open area of each nozzle, m^2.
    pub effective_area_m2: f64,
    /// Pressure coefficient of the blower.
    pub pressure_coefficient: f64,
    /// Pressure in the plenum above ambient, Pa.
    pub pressure_pa: f64,
    /// Thrust of each nozzle, N.
    pub thrusts_n: [f64; 6],
}

impl ModuleFlow {
    /// Whether so much is open that opening further lowers the thrust: no command within the allocation's table.
    pub fn is_past_largest_thrust(&self) -> bool {
        self.effective_area_m2 > AREA_AT_LARGEST_THRUST_M2
    }
}

impl InverseAllocation {
    /// What the bytes of a command give, module by module.
    pub fn flow_of_bytes(&self, command: &PropulsionCommand) -> [ModuleFlow; 2] {
        let openings_rad = command.nozzles.map(opening_of_byte_rad);
        let speeds = command.impeller_speeds.map(|byte| self.speed_rad_s(byte));
        self.flow_of_openings(speeds, &openings_rad)
    }

    /// What flap angles from the closed stop, rad, give at impeller speeds, rad/s, module by module.
    ///
    /// An angle outside the travel is taken at the nearer stop.
    pub fn flow_of_openings(&self, speeds_rad_s: [f64; 2], openings_rad: &[f64; 12]) -> [ModuleFlow; 2] {
        let ([starboard_rad, port_rad], [starboard_speed, port_speed]) = (of_modules(*openings_rad), speeds_rad_s);
        [
            self.module(Module::Starboard, starboard_speed, &starboard_rad),
            self.module(Module::Port, port_speed, &port_rad),
        ]
    }

    /// One module alone.
    pub fn module(&self, module: Module, speed_rad_s: f64, openings_rad: &[f64; 6]) -> ModuleFlow {
        let nozzles = module.nozzles();
        let shut_when_closed = self.belief == Belief::Allocation;
        let mut areas_m2 = [0.0; 6];
        let mut effective_area_m2 = match self.belief {
            Belief::Hardware => module.leak_area_m2(),
            Belief::Allocation => ALLOCATED_LEAK_AREA_M2,
        };
        for ((area_m2, nozzle), opening_rad) in areas_m2.iter_mut().zip(nozzles).zip(openings_rad) {
            if !(shut_when_closed && *opening_rad <= 0.0) {
                *area_m2 = nozzle.area_m2(opening_rad.clamp(0.0, FLAP_TRAVEL_RAD));
            }
            effective_area_m2 += nozzle.discharge_coefficient * *area_m2;
        }
        let looked_up = match self.table {
            AreaTable::Full => effective_area_m2,
            AreaTable::Thesis => effective_area_m2.min(AREA_AT_LARGEST_THRUST_M2),
        };
        let pressure_coefficient = match self.belief {
            Belief::Hardware => pressure_coefficient_of_area(looked_up),
            Belief::Allocation => pressure_coefficient_as_allocated(looked_up),
        };
        let pressure_pa = pressure_pa(speed_rad_s, pressure_coefficient);
        let mut thrusts_n = areas_m2;
        for (thrust, nozzle) in thrusts_n.iter_mut().zip(nozzles) {
            *thrust = nozzle.thrust_n(*thrust, pressure_pa);
        }
        ModuleFlow { effective_area_m2, pressure_coefficient, pressure_pa, thrusts_n }
    }

    /// Impeller speed behind a byte, rad/s.
    fn speed_rad_s(self, byte: u8) -> f64 {
        let mode = ImpellerMode::ALL.into_iter().find(|mode| mode.speed_byte() == byte);
        match (self.belief, mode) {
            (Belief::Allocation, Some(mode)) => mode.speed_rad_s(),
            _ => speed_of_byte_rad_s(byte),
        }
    }
}

/// The wrench of both modules.
///
/// # Frame
/// Body axes, torque about the body origin.
pub fn wrench_of_flow(modules: &[ModuleFlow; 2]) -> Wrench<f64> {
    wrench_of_thrusts(&joined(modules.map(|module| module.thrusts_n)))
}

/// Flap angle from the closed stop that a nozzle byte asks for, rad.
pub fn opening_of_byte_rad(byte: u8) -> f64 {
    f64::from(byte) * (FLAP_TRAVEL_RAD / NOZZLE_COUNTS)
}
