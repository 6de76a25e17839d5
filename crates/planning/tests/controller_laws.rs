//! The laws of controllers for the controllers of this crate.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod control_cases;

use control_cases::{body, cases, limits, small};
use tumble_planning::control::{Controller, LqrController, PoseTracking, RotationGains, TranslationWeights};
use tumble_planning::dynamics::{FreeFlyer, PoseTracker};
use tumble_planning::laws::{ControllerPromise, check_controller, other_worlds};

fn judged<C: Controller>(new: &dyn Fn() -> C, settling_s: f64, overshoot: f64) {
    let worlds = other_worlds();
    let promise = ControllerPromise {
        limits: limits(),
        tube: None,
        small: small(),
        settling_s,
        overshoot,
        other_worlds: &worlds,
        tolerance: 1e-9,
    };
    cases(&mut |cases| check_controller(new, cases, &promise).unwrap_or_else(|violation| panic!("{violation}")));
}

#[test]
fn pose_tracking() {
    let tracker = PoseTracker::critically_damped(FreeFlyer::new(body()), 1.0, 0.6);
    judged(&|| PoseTracking::try_new(tracker, limits()).unwrap(), 12.0, 1.01);
}

#[test]
fn linear_quadratic() {
    let gains = RotationGains { stiffness_n_m: 0.3, damping_n_m_s: 0.3, feed_forward: true };
    let weights = TranslationWeights::default();
    let nominal = FreeFlyer::new(body());
    judged(&|| LqrController::lqr(0.2, &weights, gains, nominal, limits()).unwrap(), 15.0, 1.01);
}
