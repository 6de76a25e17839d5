//! What the tube leaves to plans: the certified acceleration of a mass in an interval.

use super::scenario_one::MASS_KG;
use crate::Failure;
use nalgebra::UnitQuaternion;
use tumble_astrobee::control_presets::{MASS_UNKNOWN_SHARE, rattle_limits, tube_settings};
use tumble_planning::PlanningError;
use tumble_planning::control::{AttitudeSpan, AxisGain, MassInterval, TrackedPoint, TranslationTube, TubeSettings};

use super::scenario_one::prior;

#[allow(clippy::needless_pass_by_value)] // given to `map_err`
pub fn failed(error: PlanningError) -> Failure {
    Failure::BadInput(error.to_string())
}

/// Where the mass certainly is before anything was learned.
pub fn wide() -> Result<MassInterval, Failure> {
    let [least, largest] = MASS_UNKNOWN_SHARE;
    MassInterval::between(least * MASS_KG, largest * MASS_KG).map_err(failed)
}

/// The tube of the controllers here: RATTLE's 0.15 N along each axis, decisions every 0.2 s, no error of the attitude.
pub fn settings(mass: MassInterval) -> TubeSettings {
    let along_axes = AttitudeSpan::Near { axes_from_body: UnitQuaternion::identity(), angle_rad: 0.0 };
    TubeSettings {
        gain: AxisGain::default(),
        turned_by_rad: 0.0,
        point: TrackedPoint::BelievedCenterOfMass,
        ..tube_settings(mass, &rattle_limits(), along_axes)
    }
}

/// Acceleration that is left to plans along an axis, m/s^2.
pub fn certified(mass: MassInterval) -> Result<f64, Failure> {
    let tube = TranslationTube::try_new(settings(mass), None, &prior().parameters).map_err(failed)?;
    Ok(tube.problem(0).acceleration_m_s2)
}
