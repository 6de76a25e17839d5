//! From a wanted wrench to nozzle openings and bytes, as the flight software does it.

use super::blower::{LARGEST_THRUST_RATIO, pressure_coefficient_of_thrust, pressure_pa};
use super::constants::{FLAP_TRAVEL_RAD, NOZZLE_COUNTS, Nozzle};
use super::inverse::{Belief, FlapCommand, InverseAllocation, wrench_of_flow};
use super::nozzle::{Module, PositivityShift, joined, of_modules, thrusts_of_wrench};
use super::{ImpellerMode, PropulsionCommand};
use nalgebra::Vector3;
use tumble_dynamics::{Actuation, DynamicsError};
use tumble_lie::Wrench;

/// What a fully open nozzle counts before truncation: 255 in 32-bit arithmetic, so that its byte is 254.
///
/// The flight software of 2021 sent 255. The flap stands 0.0044 rad before its stop.
pub const FULLY_OPEN_COUNTS: f64 = 254.999_985;

/// Allocation of a wrench to the twelve nozzles at one impeller mode.
///
/// Its [`Actuation`] is the one before quantisation: commands are flap angles. What an opening gives is what `inverse` says.
/// Where a wrench saturates ([`Limits::is_saturated`]), each flap is cut by itself: what is given is not the nearest wrench,
/// and wanted again it may saturate again, into another (test `what_saturation_gave_need_not_be_given_again`).
/// # Frame
/// Body axes. [`Actuation`] and every wrench here have their torque about the body origin; the flight software's commands have it
/// about the centre of mass: [`ForceAllocation::about_origin`], [`ForceAllocation::about_center_of_mass`]. The allocation itself does
/// not depend on the centre of mass ([`thrusts_of_wrench`]).
/// # Example
/// ```
/// use tumble_astrobee::propulsion::{ForceAllocation, ImpellerMode};
/// use tumble_dynamics::{Actuation as _, nalgebra::Vector3};
/// use tumble_lie::Wrench;
///
/// let allocation = ForceAllocation::new(ImpellerMode::Nominal, Vector3::new(0.004, 0.0, -0.003));
/// let wanted = allocation.about_origin(&Wrench::new(Vector3::zeros(), Vector3::new(0.1, 0.0, 0.0)));
/// let steps = allocation.allocate_steps(&wanted)?;
/// assert!(steps.limits.is_exact());
/// assert!((allocation.realize(&steps.flaps) - wanted).to_vector().amax() < 1e-9);
/// # Ok::<(), tumble_dynamics::DynamicsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceAllocation {
    /// Impeller speed of both modules.
    pub mode: ImpellerMode,
    /// Centre of mass, body axes, m: the reference point of the flight software's torques.
    pub center_of_mass_body: Vector3<f64>,
    /// What makes thrusts positive.
    pub shift: PositivityShift,
    /// What commands give back.
    pub inverse: InverseAllocation,
}

/// Every step from a wrench to bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allocation {
    /// Thrust asked of each nozzle, N.
    pub thrusts_n: [f64; 12],
    /// Sum of thrust over discharge coefficient of each module, N.
    pub thrust_totals_n: [f64; 2],
    /// Pressure coefficient from the table, of each module; zero with impellers off.
    pub pressure_coefficients: [f64; 2],
    /// Pressure above ambient, Pa, of each module.
    pub pressures_pa: [f64; 2],
    /// Flap angles, and the mode.
    pub flaps: FlapCommand,
    /// Flap angles in counts, before truncation: 0 to [`FULLY_OPEN_COUNTS`].
    pub counts: [f64; 12],
    /// What is sent.
    pub bytes: PropulsionCommand,
    /// Where the machine cannot do what is asked.
    pub limits: Limits,
}

/// Where an allocation meets the limits of the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Limits {
    /// Nozzles at their open stop.
    pub fully_open: [bool; 12],
    /// Nozzles whose thrust is not zero but smaller than the smallest opening gives, 2e-5 N, or negative: they stay closed.
    pub held_closed: [bool; 12],
    /// Modules asked for more than the table of thrusts holds.
    pub past_table: [bool; 2],
}

impl Limits {
    /// Whether a flap stands at its open stop or a module is asked for more than it can give: the wrench is missed widely.
    pub fn is_saturated(&self) -> bool {
        self.fully_open.contains(&true) || self.past_table.contains(&true)
    }

    /// Whether every thrust asked for is given, up to rounding.
    pub fn is_exact(&self) -> bool {
        !self.is_saturated() && !self.held_closed.contains(&true)
    }
}

impl ForceAllocation {
    /// As flown, believing what the allocation believes.
    pub fn new(mode: ImpellerMode, center_of_mass_body: Vector3<f64>) -> Self {
        let inverse = InverseAllocation { belief: Belief::Allocation, ..InverseAllocation::default() };
        Self { mode, center_of_mass_body, shift: PositivityShift::default(), inverse }
    }

    /// A wrench with its torque about the centre of mass, taken about the body origin.
    pub fn about_origin(&self, wrench_about_com: &Wrench<f64>) -> Wrench<f64> {
        let Wrench { torque, force } = *wrench_about_com;
        Wrench::new(torque + self.center_of_mass_body.cross(&force), force)
    }

    /// A wrench with its torque about the body origin, taken about the centre of mass.
    pub fn about_center_of_mass(&self, wrench_body: &Wrench<f64>) -> Wrench<f64> {
        let Wrench { torque, force } = *wrench_body;
        Wrench::new(torque - self.center_of_mass_body.cross(&force), force)
    }

    /// All steps from a wrench about the body origin to bytes.
    ///
    /// With impellers off every nozzle opens fully, as flown, and nothing flows.
    /// # Errors
    /// [`DynamicsError::NotFinite`] for a wrench that is not finite or whose thrusts are not.
    /// # Source
    /// (6.14)-(6.18)
    pub fn allocate_steps(&self, wrench_body: &Wrench<f64>) -> Result<Allocation, DynamicsError> {
        let thrusts_n = self.shift.apply(&thrusts_of_wrench(wrench_body));
        let [starboard_n, port_n] = of_modules(thrusts_n);
        let modules = [self.module(Module::Starboard, &starboard_n)?, self.module(Module::Port, &port_n)?];
        let openings_rad = joined(modules.map(|module| module.openings_rad));
        let counts =
            openings_rad.map(|opening_rad| (opening_rad * (NOZZLE_COUNTS / FLAP_TRAVEL_RAD)).min(FULLY_OPEN_COUNTS));
        let mut held_closed = thrusts_n.map(|thrust| thrust != 0.0);
        for (held, opening_rad) in held_closed.iter_mut().zip(openings_rad) {
            *held &= opening_rad <= 0.0;
        }
        // truncated towards zero as sent; never above 254
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let nozzles = counts.map(|counts| counts as u8);
        Ok(Allocation {
            thrusts_n,
            thrust_totals_n: modules.map(|module| module.thrust_total_n),
            pressure_coefficients: modules.map(|module| module.pressure_coefficient),
            pressures_pa: modules.map(|module| module.pressure_pa),
            flaps: FlapCommand { mode: self.mode, openings_rad },
            counts,
            bytes: PropulsionCommand { impeller_speeds: [self.mode.speed_byte(); 2], nozzles },
            limits: Limits {
                fully_open: openings_rad.map(|opening_rad| opening_rad >= FLAP_TRAVEL_RAD),
                held_closed,
                past_table: modules.map(|module| module.is_past_table),
            },
        })
    }

    /// The share of one module.
    fn module(&self, module: Module, thrusts_n: &[f64; 6]) -> Result<ModuleAllocation, DynamicsError> {
        let nozzles = module.nozzles();
        let over_coefficient = |(thrust, nozzle): (&f64, &Nozzle)| thrust / nozzle.discharge_coefficient;
        let thrust_total_n: f64 = thrusts_n.iter().zip(nozzles).map(over_coefficient).sum();
        if !thrust_total_n.is_finite() {
            return Err(DynamicsError::NotFinite);
        }
        let mut share = ModuleAllocation {
            thrust_total_n,
            pressure_coefficient: 0.0,
            pressure_pa: 0.0,
            openings_rad: [FLAP_TRAVEL_RAD; 6],
            is_past_table: false,
        };
        if self.mode == ImpellerMode::Off {
            return Ok(share);
        }
        let speed_rad_s = self.mode.speed_rad_s();
        let ratio = thrust_total_n / (speed_rad_s * speed_rad_s);
        share.pressure_coefficient = pressure_coefficient_of_thrust(ratio);
        share.pressure_pa = pressure_pa(speed_rad_s, share.pressure_coefficient);
        share.is_past_table = ratio > LARGEST_THRUST_RATIO;
        for ((opening_rad, nozzle), thrust_n) in share.openings_rad.iter_mut().zip(nozzles).zip(thrusts_n) {
            *opening_rad = nozzle.opening_rad(nozzle.area_of_thrust_m2(*thrust_n, share.pressure_pa));
        }
        Ok(share)
    }
}

/// One module's share of an allocation.
#[derive(Clone, Copy)]
struct ModuleAllocation {
    thrust_total_n: f64,
    pressure_coefficient: f64,
    pressure_pa: f64,
    openings_rad: [f64; 6],
    is_past_table: bool,
}

impl Actuation for ForceAllocation {
    type Command = FlapCommand;

    fn allocate(&self, wrench_body: &Wrench<f64>) -> Result<FlapCommand, DynamicsError> {
        Ok(self.allocate_steps(wrench_body)?.flaps)
    }

    fn realize(&self, command: &FlapCommand) -> Wrench<f64> {
        let speeds = [command.mode.speed_rad_s(); 2];
        wrench_of_flow(&self.inverse.flow_of_openings(speeds, &command.openings_rad))
    }
}

/// The same allocation with bytes for commands: what the robot is really told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuantizedAllocation(
    /// Before quantisation.
    pub ForceAllocation,
);

impl Actuation for QuantizedAllocation {
    type Command = PropulsionCommand;

    fn allocate(&self, wrench_body: &Wrench<f64>) -> Result<PropulsionCommand, DynamicsError> {
        Ok(self.0.allocate_steps(wrench_body)?.bytes)
    }

    fn realize(&self, command: &PropulsionCommand) -> Wrench<f64> {
        wrench_of_flow(&self.0.inverse.flow_of_bytes(command))
    }
}
