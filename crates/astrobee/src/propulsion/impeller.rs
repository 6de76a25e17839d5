//! The motor that turns an impeller.

use super::constants::{CONTROL_PERIOD_S, speed_of_byte_rad_s};
use super::pid::{Pid, PidGains};
use core::f64::consts::TAU;

const GAINS: PidGains = PidGains { proportional: 0.2, integral: 0.1, derivative: 0.05, limit_v: 16.6 };
/// Largest change of the commanded speed, rad/s^2 (200 rpm/s).
pub const SPEED_COMMAND_RATE_RAD_S2: f64 = 200.0 * TAU / 60.0;
/// Speed per voltage without load, rad/s/V (374 rpm/V).
const SPEED_CONSTANT_RAD_S_V: f64 = 374.0 * TAU / 60.0;
const RESISTANCE_OHM: f64 = 1.2;
const TORQUE_CONSTANT_N_M_A: f64 = 0.0255;
/// From the no-load point of the motor: 0.144 A at 4380 rpm.
const VISCOUS_FRICTION_N_M_S: f64 = 0.144 * TORQUE_CONSTANT_N_M_A / (4380.0 * TAU / 60.0);
/// Inertia of impeller and rotor about their axis, kg m^2.
pub const IMPELLER_INERTIA_KG_M2: f64 = 0.001;

/// One impeller and its speed loop. The air is no load to it.
///
/// # Source
/// Propulsion simulation of nasa/astrobee 0.19.1 (`gnc/pmc`), the same difference equations.
///
/// # Deviation
/// Double precision: upstream computes in 32 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Impeller {
    pid: Pid,
    speed_rad_s: f64,
    speed_command_rad_s: f64,
    current_a: f64,
    torque_n_m: f64,
}

impl Impeller {
    /// Turning steadily at the speed of a byte.
    pub fn spun_up(byte: u8) -> Self {
        let speed_rad_s = speed_of_byte_rad_s(byte);
        let current_a = VISCOUS_FRICTION_N_M_S * speed_rad_s / TORQUE_CONSTANT_N_M_A;
        let voltage = RESISTANCE_OHM * current_a + speed_rad_s / SPEED_CONSTANT_RAD_S_V;
        let pid = Pid { integral: voltage / GAINS.integral, high_pass: 0.0 };
        Self { pid, speed_rad_s, speed_command_rad_s: speed_rad_s, current_a, torque_n_m: 0.0 }
    }

    /// One period of 0.016 s under a speed byte.
    pub fn step(&mut self, byte: u8, supply_v: f64) {
        let change = SPEED_COMMAND_RATE_RAD_S2 * CONTROL_PERIOD_S;
        self.speed_command_rad_s += (speed_of_byte_rad_s(byte) - self.speed_command_rad_s).clamp(-change, change);
        let voltage = self.pid.step(&GAINS, self.speed_command_rad_s - self.speed_rad_s).min(supply_v).max(-supply_v);
        self.current_a = (voltage - self.speed_rad_s / SPEED_CONSTANT_RAD_S_V) / RESISTANCE_OHM;
        self.torque_n_m = TORQUE_CONSTANT_N_M_A * self.current_a - VISCOUS_FRICTION_N_M_S * self.speed_rad_s;
        self.speed_rad_s += CONTROL_PERIOD_S * self.torque_n_m / IMPELLER_INERTIA_KG_M2;
    }

    /// Speed, rad/s.
    pub fn speed_rad_s(&self) -> f64 {
        self.speed_rad_s
    }

    /// The command after its rate limit, rad/s.
    pub fn speed_command_rad_s(&self) -> f64 {
        self.speed_command_rad_s
    }

    /// Motor current in the last period, A.
    pub fn current_a(&self) -> f64 {
        self.current_a
    }

    /// Torque on the impeller in the last period, N m; its reaction turns the body.
    pub fn torque_n_m(&self) -> f64 {
        self.torque_n_m
    }

    /// Spin momentum, kg m^2/s.
    pub fn momentum_n_m_s(&self) -> f64 {
        IMPELLER_INERTIA_KG_M2 * self.speed_rad_s
    }
}

#[cfg(test)]
mod tests {
    use super::super::ImpellerMode;
    use super::*;

    const SUPPLY_V: f64 = 14.0;

    #[test]
    fn spin_up_takes_13_to_17_seconds_and_a_tenth_of_an_ampere_afterwards() {
        let modes = [ImpellerMode::Quiet, ImpellerMode::Nominal, ImpellerMode::Aggressive];
        let stated = [(12.7, 0.066, 209.5708), (15.1, 0.082, 261.3323), (16.6, 0.092, 292.8942)];
        for (mode, (stated_s, stated_a, stated_rad_s)) in modes.into_iter().zip(stated) {
            let mut impeller = Impeller::default();
            let mut last_outside = 0;
            for step in 1..=10_000 {
                let before = impeller.speed_command_rad_s();
                impeller.step(mode.speed_byte(), SUPPLY_V);
                let change = impeller.speed_command_rad_s() - before;
                assert!(change <= 0.335_103_23, "rate limit: {change}");
                if (impeller.speed_rad_s() - stated_rad_s).abs() > 0.1 {
                    last_outside = step;
                }
            }
            let settled_s = f64::from(last_outside) * CONTROL_PERIOD_S;
            assert!((impeller.speed_rad_s() - stated_rad_s).abs() < 1e-4, "{mode:?}");
            assert!((impeller.current_a() - stated_a).abs() < 5e-4, "{mode:?}: {}", impeller.current_a());
            assert!((settled_s - stated_s).abs() < 0.1, "{mode:?}: {settled_s}");
            let spun_up = Impeller::spun_up(mode.speed_byte());
            assert!((spun_up.speed_rad_s() - impeller.speed_rad_s()).abs() < 1e-6, "{mode:?}");
            assert!((spun_up.pid.integral - impeller.pid.integral).abs() < 1e-3, "{mode:?}");
        }
    }

    #[test]
    fn a_weak_supply_limits_the_speed() {
        let mut impeller = Impeller::default();
        for _ in 0..10_000 {
            impeller.step(232, 5.0);
        }
        // 5 V = n / ks + R c n / kt
        let expected =
            5.0 / (1.0 / SPEED_CONSTANT_RAD_S_V + RESISTANCE_OHM * VISCOUS_FRICTION_N_M_S / TORQUE_CONSTANT_N_M_A);
        assert!((impeller.speed_rad_s() - expected).abs() < 1e-6, "{}", impeller.speed_rad_s());
    }
}
