//! Settings and beliefs that cannot be.

use crate::belief::ModelBelief;
use crate::local::LocalSettings;
use nalgebra::{SMatrix, Vector3};
use tumble_dynamics::InertialParameters;

/// Settings each of which is wrong in one number.
pub(super) fn absurd_settings<const X: usize, const U: usize>(
    sound: &LocalSettings<X, U>,
) -> Vec<(String, LocalSettings<X, U>)> {
    let mut all: Vec<(String, LocalSettings<X, U>)> = Vec::new();
    let mut with = |what: &str, value: f64, change: &dyn Fn(&mut LocalSettings<X, U>, f64)| {
        let mut settings = sound.clone();
        change(&mut settings, value);
        all.push((format!("{what} {value}"), settings));
    };
    let infinity = f64::INFINITY;
    with("steps", 0.0, &|settings, _| settings.steps = 0);
    for value in [f64::NAN, 0.0, -1.0, infinity] {
        with("step_s", value, &|settings, value| settings.step_s = value);
        with("effort", value, &|settings, value| settings.effort.fill(value));
        with("limit", value, &|settings, value| settings.wrench.limit.fill(value));
        with("length_scale_m", value, &|settings, value| settings.length_scale_m = value);
        with("tolerance", value, &|settings, value| settings.tolerance = value);
    }
    for value in [f64::NAN, -1.0, infinity] {
        with("tracking", value, &|settings, value| settings.tracking.fill(value));
        with("terminal", value, &|settings, value| settings.terminal.fill(value));
        with("acceleration", value, &|settings, value| settings.acceleration[1] = value);
        with("margin_m", value, &|settings, value| settings.margin_m = value);
        with("half-space", value, &|settings, value| settings.wrench.half_spaces.push(([1.0; U], value)));
        with("measurement", value, &|settings, value| {
            settings.measurement = SMatrix::from_diagonal_element(value);
        });
    }
    with("half-space", f64::NAN, &|settings, value| settings.wrench.half_spaces.push(([value; U], 1.0)));
    for value in [f64::NAN, 0.0, -1.0] {
        with("speed", value, &|settings, value| settings.speed.speed_m_s.y = value);
        with("rate", value, &|settings, value| settings.speed.rate_rad_s.z = value);
    }
    if X > 1 {
        // symmetric, and a variance would be negative
        with("measurement", 2.0, &|settings, value| {
            settings.measurement = SMatrix::identity();
            settings.measurement[(0, 1)] = value;
            settings.measurement[(1, 0)] = value;
        });
        with("a lopsided measurement", 0.5, &|settings, value| {
            settings.measurement = SMatrix::identity();
            settings.measurement[(0, 1)] = value;
        });
    }
    all
}

/// Beliefs in something that is no body, or whose covariance is none.
pub(super) fn absurd_beliefs(sound: &ModelBelief) -> Vec<(&'static str, ModelBelief)> {
    let body = |parameters: InertialParameters<f64>| {
        let mut belief = sound.clone();
        belief.estimate.parameters = parameters;
        belief
    };
    let sure = |change: &dyn Fn(&mut SMatrix<f64, 10, 10>)| {
        let mut belief = sound.clone();
        change(&mut belief.estimate.covariance);
        belief
    };
    let parameters = *sound.parameters();
    vec![
        ("a mass of NaN", body(InertialParameters { mass: f64::NAN, ..parameters })),
        ("a negative mass", body(InertialParameters { mass: -parameters.mass, ..parameters })),
        ("no mass", body(InertialParameters { mass: 0.0, ..parameters })),
        ("a moment of NaN", body(InertialParameters { first_moment: Vector3::repeat(f64::NAN), ..parameters })),
        (
            "a negative inertia",
            body(InertialParameters { inertia_about_origin: -parameters.inertia_about_origin, ..parameters }),
        ),
        ("a covariance of NaN", sure(&|covariance| covariance.fill(f64::NAN))),
        ("a negative covariance", sure(&|covariance| covariance.neg_mut())),
    ]
}
