//! The propulsion hardware: commands go in, the wrench on the body comes out, 0.016 s at a time.

use super::damage::Damage;
use super::impeller::Impeller;
use super::nozzle::{joined, wrench_of_thrusts};
use super::servo::Servo;
use super::{ImpellerMode, InverseAllocation, PropulsionCommand};
use tumble_dynamics::nalgebra::Vector3;
use tumble_lie::Wrench;

/// How a spinning impeller acts on a body that turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GyroscopicSign {
    /// `-omega x h`: what a rotor of momentum `h` does to the body that carries it.
    #[default]
    Physical,
    /// `+omega x h`: as NASA's simulation has it. Impellers of equal speed cancel either way.
    AsSimulatedUpstream,
}

/// What of the hardware can be chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PropulsionSettings {
    /// Factor on every nozzle's thrust.
    pub thrust_factor: f64,
    /// Factor on each nozzle's thrust on top, in the order of [`constants::NOZZLES`](super::constants::NOZZLES).
    pub nozzle_factors: [f64; 12],
    /// Supply of the impeller motors, V.
    pub supply_v: f64,
    /// Sign of the coupling of impellers and body rate.
    pub gyroscopic_sign: GyroscopicSign,
}

impl PropulsionSettings {
    /// Thrust as the pressure makes it, 14 V, the physical reaction of the impellers.
    pub const PHYSICAL: Self = Self {
        thrust_factor: 1.0,
        nozzle_factors: [1.0; 12],
        supply_v: 14.0,
        gyroscopic_sign: GyroscopicSign::Physical,
    };
    /// As NASA's simulation: thrust tuned by 1.25, and its sign of the gyroscopic term.
    pub const AS_SIMULATED_UPSTREAM: Self =
        Self { thrust_factor: 1.25, gyroscopic_sign: GyroscopicSign::AsSimulatedUpstream, ..Self::PHYSICAL };
}

impl Default for PropulsionSettings {
    fn default() -> Self {
        Self::PHYSICAL
    }
}

/// What the propulsion did during one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PropulsionStep {
    /// Wrench of both modules on the body, torque about the body origin.
    pub wrench_body: Wrench<f64>,
    /// Wrench of each module, body axes, torque about the body origin.
    pub module_wrenches_body: [Wrench<f64>; 2],
    /// Thrust of each nozzle, N.
    pub thrusts_n: [f64; 12],
}

/// The propulsion hardware: twelve servos, two impellers, two plenums.
///
/// # Frame
/// Body axes, torque about the body origin (not the centre of mass).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PropulsionPlant {
    settings: PropulsionSettings,
    damage: Damage,
    servos: [Servo; 12],
    impellers: [Impeller; 2],
}

/// Periods after which the flaps stand where a command wants them, up to the play of the gears.
const SETTLING_STEPS: usize = 300;
/// Axis of each impeller, body y: they turn against each other.
const IMPELLER_AXES_Y: [f64; 2] = [1.0, -1.0];

impl PropulsionPlant {
    /// Everything at rest, nozzles closed.
    pub fn new(settings: PropulsionSettings) -> Self {
        Self { settings, damage: Damage::NONE, servos: Default::default(), impellers: Default::default() }
    }

    /// Nozzles closed, impellers turning steadily at the speed of a mode's byte: nobody waits for the spin-up of 13 to 17 s.
    pub fn spun_up(settings: PropulsionSettings, mode: ImpellerMode) -> Self {
        Self { impellers: [Impeller::spun_up(mode.speed_byte()); 2], ..Self::new(settings) }
    }

    /// As a command has left it after a while: impellers turning steadily at its speeds, flaps where it wants them.
    pub fn settled(settings: PropulsionSettings, command: &PropulsionCommand) -> Self {
        let impellers = command.impeller_speeds.map(Impeller::spun_up);
        let mut plant = Self { impellers, ..Self::new(settings) };
        for (servo, byte) in plant.servos.iter_mut().zip(command.nozzles) {
            for _ in 0..SETTLING_STEPS {
                servo.step(byte);
            }
        }
        plant
    }

    /// One period of 0.016 s under a command while the impellers turn at speeds that were measured, rad/s; the wrench of the
    /// nozzles on the body, torque about the body origin.
    pub fn step_at_speeds(&mut self, command: &PropulsionCommand, speeds_rad_s: [f64; 2]) -> Wrench<f64> {
        let flaps_rad = self.step_servos(command);
        wrench_of_thrusts(&self.thrusts_n(speeds_rad_s, &flaps_rad))
    }

    fn step_servos(&mut self, command: &PropulsionCommand) -> [f64; 12] {
        let mut flaps_rad = [0.0; 12];
        for ((flap_rad, servo), byte) in flaps_rad.iter_mut().zip(&mut self.servos).zip(command.nozzles) {
            *flap_rad = servo.step(byte);
        }
        self.damage.flaps_rad(flaps_rad)
    }

    /// Thrust of each nozzle.
    fn thrusts_n(&self, speeds_rad_s: [f64; 2], flaps_rad: &[f64; 12]) -> [f64; 12] {
        let flows = InverseAllocation::default().flow_of_openings(speeds_rad_s, flaps_rad);
        let mut thrusts_n = joined(flows.map(|flow| flow.thrusts_n));
        for (thrust_n, factor) in thrusts_n.iter_mut().zip(self.settings.nozzle_factors) {
            *thrust_n *= self.settings.thrust_factor * factor * self.damage.thrust_factor;
        }
        thrusts_n
    }

    /// One period of 0.016 s under a command, the body turning at `rate_body` (rad/s).
    pub fn step(&mut self, command: &PropulsionCommand, rate_body: &Vector3<f64>) -> PropulsionStep {
        let command = &self.damage.heard(command);
        let flaps_rad = self.step_servos(command);
        for (impeller, byte) in self.impellers.iter_mut().zip(command.impeller_speeds) {
            impeller.step(byte, self.settings.supply_v * self.damage.supply_factor);
        }
        let speeds_rad_s = self.impellers.each_ref().map(Impeller::speed_rad_s);
        let thrusts_n = self.thrusts_n(speeds_rad_s, &flaps_rad);
        let [s0, s1, s2, s3, s4, s5, p0, p1, p2, p3, p4, p5] = thrusts_n;
        let mut module_wrenches_body = [
            wrench_of_thrusts(&[s0, s1, s2, s3, s4, s5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            wrench_of_thrusts(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, p0, p1, p2, p3, p4, p5]),
        ];
        for ((wrench, impeller), axis_y) in module_wrenches_body.iter_mut().zip(&self.impellers).zip(IMPELLER_AXES_Y) {
            wrench.torque += self.impeller_torque_body(impeller, axis_y, rate_body);
        }
        let [starboard, port] = module_wrenches_body;
        PropulsionStep { wrench_body: starboard + port, module_wrenches_body, thrusts_n }
    }

    /// Torque of one impeller on the body: the reaction to its motor, and that of its momentum on a body that turns.
    fn impeller_torque_body(&self, impeller: &Impeller, axis_y: f64, rate_body: &Vector3<f64>) -> Vector3<f64> {
        let axis = Vector3::new(0.0, axis_y, 0.0);
        let coupling = rate_body.cross(&axis) * impeller.momentum_n_m_s();
        let reaction = axis * -impeller.torque_n_m();
        match self.settings.gyroscopic_sign {
            GyroscopicSign::Physical => reaction - coupling,
            GyroscopicSign::AsSimulatedUpstream => reaction + coupling,
        }
    }

    /// Settings; the supply voltage may change in flight.
    pub fn settings_mut(&mut self) -> &mut PropulsionSettings {
        &mut self.settings
    }

    /// Breaks something, or mends it with [`Damage::NONE`]. A servo whose nozzle is stuck goes on turning beside it.
    pub fn set_damage(&mut self, damage: Damage) {
        self.damage = damage;
    }

    /// The impellers, starboard first.
    pub fn impellers(&self) -> &[Impeller; 2] {
        &self.impellers
    }

    /// The servos, in the order of [`constants::NOZZLES`](super::constants::NOZZLES).
    pub fn servos(&self) -> &[Servo; 12] {
        &self.servos
    }

    /// Flap angles from the closed stop in the last step, rad, of servos that are obeyed.
    pub fn flaps_rad(&self) -> [f64; 12] {
        self.servos.each_ref().map(Servo::flap_rad)
    }
}
