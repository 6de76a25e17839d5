//! Numbers of RATTLE's controllers, and what the robot's limits are taken to be.
//!
//! Provenance: rattle-iros-2022 (93d2f99), tube controller and its configuration; thesis 6.2.3 and table 6.7. Where the two disagree,
//! both stand here.

use crate::simulator::CONTROL_PERIOD_S;
use crate::worlds::WorldPreset;
use tumble_dynamics::nalgebra::{UnitQuaternion, Vector3};
use tumble_planning::PlanningError;
use tumble_planning::control::{
    AttitudeGains, AttitudeSpan, AxisGain, LinearMpcSettings, MassInterval, OriginalDisturbance, OriginalSettings,
    OriginalWeights, Terminal, TrackedPoint, TranslationWeights, TubeDisturbance, TubeSettings, TubeWeights,
};

/// Largest force along each axis in the code, N.
pub const RATTLE_FORCE_N: f64 = 0.15;
/// Largest norm of the torque in the code, N m.
pub const RATTLE_TORQUE_NORM_N_M: f64 = 0.015;
/// Largest force of the controller along each body axis, N (thesis, table 6.7). The first is more than the nozzles give in any mode.
pub const THESIS_FORCE_N: [f64; 3] = [0.452, 0.216, 0.257];
/// Largest torque of the controller about each body axis, N m (thesis, table 6.7).
pub const THESIS_TORQUE_N_M: [f64; 3] = [0.045, 0.022, 0.026];

/// Time between the decisions of the tube controller, s.
pub const DECISION_S: f64 = 0.2;
/// Outputs between decisions that lie on the grid of the outputs: 0.2 s are twelve and a half.
pub const OUTPUTS_PER_DECISION: u32 = 12;
/// Rate of the outputs, 1/s.
pub const OUTPUT_HZ: f64 = 62.5;
/// Mass of the original's nominal motion on the station, kg: loaded once, whatever is believed.
pub const ORIGINAL_MASS_KG: f64 = 9.5;

/// Feedback around the nominal motion, acceleration per error of position (1/s^2) and of velocity (1/s): real eigenvalues, little
/// noise passed on.
pub const TUBE_FEEDBACK: [f64; 2] = [0.25, 2.0];

/// Shares of the believed mass between which it certainly is, where it is thought to be known.
pub const MASS_KNOWN_SHARE: [f64; 2] = [0.5, 1.5];
/// The same with a payload that may be anything.
pub const MASS_UNKNOWN_SHARE: [f64; 2] = [0.5, 2.0];

/// Steps that the tube plans ahead.
pub const TUBE_STEPS: usize = 25;
/// Largest speed along each axis that a tube is built for, m/s.
pub const TUBE_SPEED_M_S: f64 = 0.1;
/// Largest errors of measured position (m) and velocity (m/s) along each axis that it holds: of what an estimator has filtered.
pub const TUBE_ERRORS: [f64; 2] = [1e-4, 1e-4];
/// Attitude by which forces are turned into body axes: error of the estimate, and what the robot turns between outputs, rad.
pub const TUBE_TURNED_BY_RAD: f64 = 0.013;
/// Standard deviations of `1 / m` that count as certain.
pub const TUBE_SIGMAS: f64 = 3.0;

/// Gains of the original's attitude controller at a place; those without configuration where it was not flown.
///
/// # Deviation
/// There the damping multiplies the sum of the rate error and of a proportional gain (0.5, 0.5, 0.2) times the attitude error; here
/// both have their own torque.
pub fn rattle_attitude_gains(place: WorldPreset) -> AttitudeGains {
    let (proportional, damping_n_m_s) = match place {
        WorldPreset::Granite => (0.5, 0.3),
        WorldPreset::Iss => (0.5, 0.2),
        WorldPreset::Mgtf | WorldPreset::Open => (0.2, 0.2),
    };
    AttitudeGains { stiffness_n_m: proportional * damping_n_m_s, damping_n_m_s }
}

/// The tube's feedback, for decisions that fall on outputs.
pub fn tube_gain() -> AxisGain {
    let [stiffness, damping] = TUBE_FEEDBACK;
    AxisGain { stiffness, damping, step_s: decision_on_grid_s() }
}

/// A tube for a mass in an interval and a reference that is seen at these attitudes, in world axes, without walls.
pub fn tube_settings(mass: MassInterval, limits: &ControlLimits, attitudes: AttitudeSpan) -> TubeSettings {
    let [position_m, velocity_m_s] = TUBE_ERRORS;
    TubeSettings {
        gain: tube_gain(),
        steps: TUBE_STEPS,
        weights: TubeWeights::DEFAULT,
        terminal: Terminal::StopSet,
        speed_m_s: TUBE_SPEED_M_S,
        walls_m: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
        force_limit_n: limits.force_n,
        attitudes,
        turned_by_rad: TUBE_TURNED_BY_RAD,
        disturbance: TubeDisturbance { position_m, velocity_m_s, force_n: 0.0, acceleration_m_s2: 0.0 },
        corrections: None,
        mass,
        sigmas: TUBE_SIGMAS,
        world_from_axes: UnitQuaternion::identity(),
        point: TrackedPoint::Origin,
    }
}

/// What a controller keeps its wrench within.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlLimits {
    /// Largest force along each body axis, N.
    pub force_n: Vector3<f64>,
    /// Largest norm of the torque, N m.
    pub torque_n_m: f64,
}

/// Limits of RATTLE's controllers as the code has them.
pub fn rattle_limits() -> ControlLimits {
    ControlLimits { force_n: Vector3::repeat(RATTLE_FORCE_N), torque_n_m: RATTLE_TORQUE_NORM_N_M }
}

/// Limits of the controller in the thesis; of the torques the least, since a norm is limited.
pub fn thesis_limits() -> ControlLimits {
    ControlLimits { force_n: THESIS_FORCE_N.into(), torque_n_m: Vector3::from(THESIS_TORQUE_N_M).min() }
}

/// What predictive control without a tube is set to, its decisions on the grid of the outputs.
pub fn mpc_settings() -> LinearMpcSettings {
    LinearMpcSettings { step_s: decision_on_grid_s(), steps: TUBE_STEPS, weights: TranslationWeights::default() }
}

/// The original's tube as flown in its full runs; its set follows the beliefs where it is told any, as with its parameter feedback.
pub fn original_settings(force_limit_n: f64, is_told: bool) -> OriginalSettings {
    OriginalSettings {
        weights: OriginalWeights::PERMISSIVE,
        disturbance: if is_told { OriginalDisturbance::OfBelief } else { OriginalDisturbance::Stored },
        mass_kg: ORIGINAL_MASS_KG,
        force_limit_n,
    }
}

/// Time between decisions that is a whole number of outputs, s: near [`DECISION_S`].
pub fn decision_on_grid_s() -> f64 {
    f64::from(OUTPUTS_PER_DECISION) * CONTROL_PERIOD_S
}

/// Between which masses the true one is certain to be, given the believed one and shares of it.
///
/// # Errors
/// A mass or a share that is not positive; shares the wrong way round.
pub fn mass_interval(believed_kg: f64, [least, largest]: [f64; 2]) -> Result<MassInterval, PlanningError> {
    MassInterval::between(least * believed_kg, largest * believed_kg)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_planning::control::TranslationTube;

    #[test]
    fn the_cascade_of_the_original_has_the_stiffness_of_the_product() {
        // k_p, k_d and what they come to, as printed in the analysis of the code
        for (place, stiffness, damping) in
            [(WorldPreset::Granite, 0.15, 0.3), (WorldPreset::Iss, 0.10, 0.2), (WorldPreset::Open, 0.04, 0.2)]
        {
            let gains = rattle_attitude_gains(place);
            assert!((gains.stiffness_n_m - stiffness).abs() < 1e-15 && (gains.damping_n_m_s - damping).abs() < 1e-15);
        }
    }

    /// What the gains of this feedback leave, by hand: the matched part costs 1.1235 of the uncertainty of the mass (five faces), each mm of
    /// box disturbance 0.0011 m/s^2 and each mm/s 0.0054 m/s^2, at 0.2 s; the box has twice the errors of measurement, and that of
    /// the velocity for a step in the position. That is 0.74 of what the force gives the heaviest body.
    #[test]
    fn a_mass_known_to_a_half_leaves_most_of_the_acceleration() {
        let believed = WorldPreset::Iss.body().mass;
        let mass = mass_interval(believed, MASS_KNOWN_SHARE).unwrap();
        let near = AttitudeSpan::Near { axes_from_body: UnitQuaternion::identity(), angle_rad: 0.0 };
        let settings = TubeSettings { turned_by_rad: 0.0, ..tube_settings(mass, &rattle_limits(), near) };
        let tube = TranslationTube::try_new(settings, None, &WorldPreset::Iss.body()).unwrap();
        let by_hand =
            RATTLE_FORCE_N / mass.center_kg() * (1.0 - 1.1235 * mass.uncertainty()) - 0.22 * 0.0011 - 0.2 * 0.0054;
        for problem in (0..3).map(|axis| tube.problem(axis)) {
            let left = problem.scaled_acceleration - problem.held_acceleration;
            assert!((left / by_hand - 1.0).abs() < 0.03, "{left}, not {by_hand}");
        }
        assert!(
            TranslationTube::try_new(TubeSettings { speed_m_s: 0.0, ..settings }, None, &WorldPreset::Iss.body())
                .is_err()
        );
    }

    /// A mass of which half more and half less are possible leaves half of the command uncertain, twice and half three fifths.
    #[test]
    fn the_intervals_of_the_mass_are_as_uncertain_as_they_should_be() {
        let believed = WorldPreset::Iss.body().mass;
        let known = mass_interval(believed, MASS_KNOWN_SHARE).unwrap();
        let unknown = mass_interval(believed, MASS_UNKNOWN_SHARE).unwrap();
        assert!((known.uncertainty() - 0.5).abs() < 1e-15 && (unknown.uncertainty() - 0.6).abs() < 1e-15);
        assert!((known.center_kg() - 0.75 * believed).abs() < 1e-12 && unknown.contains(&known));
        assert!(mass_interval(believed, [1.5, 0.5]).is_err() && mass_interval(f64::NAN, [0.5, 1.5]).is_err());
    }

    #[test]
    fn decisions_fall_on_outputs_and_the_feedback_is_well_damped() {
        assert!((OUTPUT_HZ * CONTROL_PERIOD_S - 1.0).abs() < 1e-15);
        assert!((decision_on_grid_s() / DECISION_S - 1.0).abs() < 0.05);
        let [stiffness, damping] = TUBE_FEEDBACK;
        assert!(damping * damping > 4.0 * stiffness);
        assert_eq!(mpc_settings().step_s.to_bits(), tube_gain().step_s.to_bits());
    }
}
