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
        // (not `clamp`, which panics where the ends of the play are no numbers)
        self.geared_rad = self.geared_rad.max(self.shaft_rad - HALF_BACKLASH_RAD);
        self.geared_rad = self.geared_rad.min(self.shaft_rad + HALF_BACKLASH_RAD);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Flap angles of a closed servo under one byte, as a share of what the byte asks for.
    fn response(byte: u8, steps: usize) -> Vec<f64> {
        let mut servo = Servo::default();
        let wanted = f64::from(byte) * FLAP_TRAVEL_RAD / NOZZLE_COUNTS;
        (0..steps).map(|_| servo.step(byte) / wanted).collect()
    }

    #[test]
    #[allow(clippy::float_cmp)] // exactly at rest
    fn a_step_has_two_samples_of_dead_time_and_overshoots_by_a_seventh() {
        let shares = response(128, 300);
        assert!(shares[..2].iter().all(|share| *share == 0.0), "{:?}", &shares[..4]);
        let reached = |share: f64| shares.iter().position(|reached| *reached >= share).unwrap() + 1;
        assert_eq!([reached(0.10), reached(0.63), reached(0.90)], [3, 4, 5]);
        let overshoot = shares.iter().fold(0.0, |most: f64, share| most.max(*share)) - 1.0;
        assert!((overshoot - 0.14).abs() < 0.01, "{overshoot}");
        assert!((shares[299] - 1.0).abs() < 0.02, "{}", shares[299]);
    }

    #[test]
    fn a_full_range_step_peaks_at_24_rad_s_and_stays_within_the_stops() {
        let angles: Vec<f64> = response(255, 300).iter().map(|share| share * FLAP_TRAVEL_RAD).collect();
        let peak = angles.windows(2).map(|pair| (pair[1] - pair[0]) / CONTROL_PERIOD_S).fold(0.0, f64::max);
        assert!((peak - 24.0).abs() < 0.5, "{peak}");
        assert!(angles.iter().all(|angle| (0.0..=FLAP_TRAVEL_RAD).contains(angle)));
    }

    #[test]
    #[allow(clippy::float_cmp)] // copied or clamped, never computed
    fn play_holds_the_flap_while_the_shaft_turns_back() {
        let mut servo = Servo { shaft_rad: 20.0, geared_rad: 20.0 + HALF_BACKLASH_RAD, ..Servo::default() };
        servo.shaft_rad -= HALF_BACKLASH_RAD;
        servo.step(0);
        assert_eq!(servo.geared_rad, 20.0, "pulled along at the end of the play");
        let mut servo = Servo { shaft_rad: 20.0, geared_rad: 20.0 - HALF_BACKLASH_RAD, ..Servo::default() };
        servo.shaft_rad -= HALF_BACKLASH_RAD;
        servo.step(0);
        assert_eq!(servo.geared_rad, 20.0 - HALF_BACKLASH_RAD, "left alone within it");
    }
}
