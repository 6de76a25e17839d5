//! The laws of controllers for the controllers of this crate.

use crate::control_cases::{body, cases, limits, small};
use tumble_planning::control::{
    AttitudeController, AttitudeGains, AttitudeLaw, Controller, LinearMpcSettings, LqrController, OriginalDisturbance,
    OriginalSettings, OriginalTubeController, OriginalWeights, PlainMpcController, PoseTracking, TranslationWeights,
};
use tumble_planning::dynamics::{FreeFlyer, PoseTracker, WrenchBox};
use tumble_planning::laws::{ControllerPromise, check_controller, other_worlds};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::Vector3;

fn judged<C: Controller>(new: &dyn Fn() -> C, settling_s: f64, overshoot: f64) {
    held_against(new, limits(), 1.0, &other_worlds(), settling_s, overshoot);
}

/// Errors may be so many times those of controllers that know what they push.
fn held_against<C: Controller>(
    new: &dyn Fn() -> C,
    limits: WrenchBox,
    slack: f64,
    worlds: &[Pose<f64>],
    settling_s: f64,
    overshoot: f64,
) {
    let promise = ControllerPromise {
        limits,
        tube: None,
        small: small(),
        settling_s,
        overshoot,
        other_worlds: worlds,
        tolerance: 1e-9,
    };
    cases(slack, &mut |cases| check_controller(new, cases, &promise).unwrap_or_else(|violation| panic!("{violation}")));
}

#[test]
fn pose_tracking() {
    let tracker = PoseTracker::critically_damped(FreeFlyer::new(body()), 1.0, 0.6);
    judged(&|| PoseTracking::try_new(tracker, limits()).unwrap(), 12.0, 1.01);
}

fn attitude() -> AttitudeController {
    AttitudeController {
        law: AttitudeLaw::Geometric,
        gains: AttitudeGains { stiffness_n_m: 0.3, damping_n_m_s: 0.3 },
        body: body(),
        torque_limit_n_m: 0.05,
    }
}

#[test]
fn linear_quadratic() {
    let weights = TranslationWeights::default();
    judged(&|| LqrController::lqr(0.2, &weights, attitude(), limits().force_limit).unwrap(), 15.0, 1.01);
}

#[test]
fn plain_predictive() {
    let settings = LinearMpcSettings::default();
    judged(&|| PlainMpcController::plain_mpc(&settings, attitude(), limits().force_limit).unwrap(), 15.0, 1.01);
}

/// Its set of errors lies along the axes of the world: a quarter turn is all the world may turn.
#[test]
fn the_original() {
    let quarter = Pose::new(Vector3::new(-1.0, 0.5, 2.0), Vector3::new(0.0, 0.0, core::f64::consts::FRAC_PI_2));
    let limits = WrenchBox { torque_limit: Vector3::repeat(0.015), force_limit: Vector3::repeat(0.15) };
    for weights in [OriginalWeights::DEFAULT, OriginalWeights::PERMISSIVE] {
        for disturbance in [OriginalDisturbance::Stored, OriginalDisturbance::fixed(), OriginalDisturbance::OfBelief] {
            let settings = OriginalSettings { weights, disturbance, ..OriginalSettings::default() };
            let new = || OriginalTubeController::original(&settings, body()).unwrap();
            held_against(&new, limits, 30.0, &[Pose::translation(3.0, -2.0, 1.0), quarter], 25.0, 1.1);
        }
    }
}
