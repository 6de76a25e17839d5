//! The servo motor of one nozzle: a loop, a gearbox with play, two stops.

use super::constants::{CONTROL_PERIOD_S, FLAP_TRAVEL_RAD, NOZZLE_COUNTS};
use super::pid::{Pid, PidGains};

const GAINS: PidGains = PidGains { proportional: 5.0, integral: 1.5, derivative: 0.8, limit_v: 6.0 };
/// Torque per current, N m/A, and voltage per rate, V s/rad.
const MOTOR_CONSTANT: f64 = 0.2893 * 0.01 / 1.5;
const RESISTANCE_OHM: f64 = 6.0 / 1.5;
const VISCOUS_FRICTION_N_M_S: f64 = 3e-7;
const INERTIA_KG_M2: f64 = 2.5e-8;
/// Servo angle per angle of the motor shaft.
const GEAR_RATIO: f64 = 0.01;
/// Servo angle per flap angle.
const SERVO_PER_FLAP: f64 = 0.5;
/// Servo angle from the closed to the open stop, rad.
const SERVO_RANGE_RAD: f64 = SERVO_PER_FLAP * FLAP_TRAVEL_RAD;
/// Half of the play, on the motor shaft, rad (0.5 degrees).
const HALF_BACKLASH_RAD: f64 = 0.5 * core::f64::consts::PI / 180.0;

/// One servo, between the byte that commands a nozzle and the angle of its flaps.
///
/// # Source
/// Propulsion simulation of nasa/astrobee 0.19.1 (`gnc/pmc`), the same difference equations.
///
/// # Deviation
/// Double precision: upstream computes in 32 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Servo {
    pid: Pid,
    shaft_rad: f64,
    shaft_rate_rad_s: f64,
    /// Shaft angle on the far side of the play.
    geared_rad: f64,
    current_a: f64,
}

impl Servo {
    /// One period of 0.016 s under a nozzle byte; returns the flap angle from the closed stop in this period, rad.
    pub fn step(&mut self, byte: u8) -> f64 {
        // the play follows the shaft before the shaft moves: one of the two periods of dead time
        self.geared_rad = self.geared_rad.clamp(self.shaft_rad - HALF_BACKLASH_RAD, self.shaft_rad + HALF_BACKLASH_RAD);
        let wanted_rad = f64::from(byte) * (SERVO_RANGE_RAD / NOZZLE_COUNTS);
        let voltage = self.pid.step(&GAINS, wanted_rad - GEAR_RATIO * self.geared_rad);
        self.current_a = (voltage - MOTOR_CONSTANT * self.shaft_rate_rad_s) / RESISTANCE_OHM;
        // the stops hold the angle and leave the rate alone, as upstream
        self.shaft_rad =
            (self.shaft_rad + CONTROL_PERIOD_S * self.shaft_rate_rad_s).clamp(0.0, SERVO_RANGE_RAD / GEAR_RATIO);
        let torque = MOTOR_CONSTANT * self.current_a - VISCOUS_FRICTION_N_M_S * self.shaft_rate_rad_s;
        self.shaft_rate_rad_s += CONTROL_PERIOD_S / INERTIA_KG_M2 * torque;
        self.flap_rad()
    }

    /// Angle of the flaps from the closed stop, rad; the play leaves up to 1.7e-4 rad at either stop.
    pub fn flap_rad(&self) -> f64 {
        self.geared_rad * (GEAR_RATIO / SERVO_PER_FLAP)
    }

    /// Angle of the motor shaft, rad.
    pub fn shaft_rad(&self) -> f64 {
        self.shaft_rad
    }

    /// Motor current in the last period, A.
    pub fn current_a(&self) -> f64 {
        self.current_a
    }
}
