//! A belief together with what is expected to be learned before it is used.

use crate::belief::ModelBelief;
use crate::error::PlanningError;
use crate::local::{LocalTrajectory, QUANTITIES, body_by_mass_center_and_inertia, covariance_about_com};
use nalgebra::SMatrix;
use tumble_dynamics::PARAMETERS;

/// Information about its quantities that a plan expects of what is flown of it between two times; nothing where it is not what is flown then.
pub(super) fn information_between<S, const U: usize, const P: usize>(
    plan: &LocalTrajectory<S, U, P>,
    from_s: f64,
    until_s: f64,
) -> SMatrix<f64, P, P> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
    let node = |time_s: f64| libm::round(((time_s - plan.start_s) / plan.step_s).max(0.0)) as usize;
    let information = |time_s: f64| plan.covariances.get(node(time_s))?.cholesky().map(|factor| factor.inverse());
    match (information(from_s), information(until_s)) {
        (Some(before), Some(after)) if until_s > from_s => after - before,
        _ => SMatrix::zeros(),
    }
}

/// The belief as it is expected to be when so much more is known of the quantities of these names: the same body, with another covariance.
///
/// Quantities that are none of a body are left out, and what is known of them with it.
///
/// # Errors
/// A belief whose body does not exist.
pub(super) fn foreseen<const P: usize>(
    belief: &ModelBelief,
    names: &[&'static str; P],
    information: &SMatrix<f64, P, P>,
) -> Result<ModelBelief, PlanningError> {
    let places: Vec<(usize, usize)> = names
        .iter()
        .enumerate()
        .filter_map(|(index, name)| Some((index, QUANTITIES.iter().position(|(known, _)| known == name)?)))
        .collect();
    let mut gained = SMatrix::<f64, PARAMETERS, PARAMETERS>::zeros();
    for (a, i) in &places {
        for (b, j) in &places {
            gained[(*i, *j)] = 0.5 * (information[(*a, *b)] + information[(*b, *a)]);
        }
    }
    let mut foreseen = belief.clone();
    if gained.amax() == 0.0 {
        return Ok(foreseen);
    }
    let covariance = covariance_about_com(belief)?;
    // (C^-1 + I)^-1, of a covariance that may have no inverse
    let Some(inverse) = (SMatrix::identity() + covariance * gained).try_inverse() else { return Ok(foreseen) };
    let by_quantities = body_by_mass_center_and_inertia(belief.parameters());
    let left = by_quantities * (inverse * covariance) * by_quantities.transpose();
    if left.diagonal().iter().all(|variance| *variance >= 0.0) {
        foreseen.estimate.covariance = (left + left.transpose()) * 0.5;
    }
    Ok(foreseen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Matrix3, Vector3};
    use tumble_dynamics::InertialParameters;

    fn belief() -> ModelBelief {
        let inertia = Matrix3::from_diagonal(&Vector3::new(0.15, 0.14, 0.16));
        ModelBelief::vague(
            2,
            InertialParameters::about_com(10.0, Vector3::new(0.05, -0.1, 0.07), inertia),
            [0.1, 0.05, 0.2],
        )
    }

    #[test]
    fn information_adds_to_what_is_known() {
        let names = ["inertia_zz", "drag", "mass"];
        // Of the mass, known to 1 kg, as much again; of drag, which is none of a body, whatever there is.
        let information = Matrix3::from_diagonal(&Vector3::new(0.0, 1e9, 1.0));
        let known = covariance_about_com(&foreseen(&belief(), &names, &information).unwrap()).unwrap();
        let before = covariance_about_com(&belief()).unwrap();
        assert!((known[(0, 0)] - 0.5).abs() < 1e-9, "{known}");
        assert!((known.diagonal() - before.diagonal()).rows(1, 9).amax() < 1e-12);
        assert_eq!(foreseen(&belief(), &names, &Matrix3::zeros()).unwrap(), belief());
    }

    #[test]
    fn what_a_plan_expects_between_two_times() {
        let plan = LocalTrajectory::<(), 1, 2> {
            start_s: 10.0,
            step_s: 0.5,
            states: vec![(); 3],
            inputs: vec![[0.0]; 2],
            covariances: vec![Matrix2::identity(), Matrix2::identity() * 0.5, Matrix2::identity() * 0.25],
            gathered: Matrix2::identity() * 3.0,
        };
        assert!((information_between(&plan, 10.5, 11.0) - Matrix2::identity() * 2.0).amax() < 1e-12);
        assert!((information_between(&plan, 3.0, 11.0) - Matrix2::identity() * 3.0).amax() < 1e-12);
        for (from_s, until_s) in [(10.5, 12.0), (11.0, 10.5), (12.0, 14.0)] {
            assert_eq!(
                information_between(&plan, from_s, until_s),
                Matrix2::zeros(),
                "{from_s} to {until_s} is not flown"
            );
        }
    }
}
