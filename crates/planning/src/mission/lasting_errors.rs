//! What of a belief no motion improves, because thrusters and gyroscope err by what nobody can tell.

use crate::belief::ModelBelief;
use crate::error::{PlanningError, indefinite};
use crate::local::{body_by_mass_center_and_inertia, covariance_about_com, sizes_about_com, whitened};
use nalgebra::{SMatrix, SVector, Vector6};
use tumble_dynamics::{InertialParameters, PARAMETERS};
use tumble_identification::recursive::{AxisErrors, ErringThruster, THRUSTERS};

/// Of any direction, so much of the variance is taken to be beyond learning at most: what is believed is not held against an estimator that
/// knows better.
const MOST_LASTING: f64 = 0.9;
/// How well a stretch shows what an axis answers to a wrench, as a share of that wrench: where thrusters err by more, they give themselves away by answers
/// that fit no body.
const SHOWN: f64 = 8e-3;

type Matrix10 = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// Constant errors that a motion shows as a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LastingErrors {
    pub(super) thrusters: [ErringThruster; THRUSTERS],
    pub(super) rate_axes: AxisErrors,
}

/// Covariance of mass, centre of mass and inertia about it of a body whose motion is known, and whose thrusters are not: one that is heavier by a
/// hundredth moves as one does that is pushed by a hundredth less.
///
/// At rest, each axis that thrusters reach is pushed or turned both ways. What moves so is `Y(w) b = w + E(w) e + n` with the errors `e` of the
/// thrusters, of deviation one, and what is seen wrong of each answer, `n`, of deviation [`SHOWN`]. Body and errors are found together; what is known of the
/// body is less than with exact thrusters, and that is what lasts. Axes of the gyroscope add what they make of an inertia.
fn lasting(
    errors: &LastingErrors,
    body: &InertialParameters<f64>,
    pushed_axes: usize,
) -> Result<Matrix10, PlanningError> {
    let sizes = sizes_about_com(body);
    let by_quantities = body_by_mass_center_and_inertia(body) * Matrix10::from_diagonal(&sizes.into());
    let [_, radius_m, ..] = sizes;
    let inertia = body.spatial_inertia();
    let what = "the least eigenvalue of the inertia";
    let mobility = inertia.try_inverse().ok_or_else(|| indefinite(what, &inertia))?;
    let (axes, is_told): (&[usize], [bool; PARAMETERS]) = if pushed_axes < 3 {
        (&[2, 3, 4], core::array::from_fn(|quantity| matches!(quantity, 0..=2 | 9)))
    } else {
        (&[0, 1, 2, 3, 4, 5], [true; PARAMETERS])
    };
    let untold = is_told.map(|is_told| if is_told { 0.0 } else { 1.0 });
    let mut normal = Matrix10::from_diagonal(&untold.into());
    let mut erring = SMatrix::<f64, PARAMETERS, THRUSTERS>::zeros();
    let mut of_thrusters = SMatrix::<f64, THRUSTERS, THRUSTERS>::from_diagonal_element(SHOWN * SHOWN);
    for (axis, sense) in axes.iter().flat_map(|axis| [(*axis, 1.0), (*axis, -1.0)]) {
        // a torque counts as the force at that distance
        let row_size = |row: usize| if row < 3 { radius_m } else { 1.0 };
        let wrench = Vector6::ith(axis, sense * row_size(axis));
        let acceleration = mobility * wrench;
        let by_parameters = SMatrix::<f64, 6, PARAMETERS>::from_fn(|row, column| {
            let one = InertialParameters::from_vector(&SVector::ith(column, 1.0));
            (one.spatial_inertia() * acceleration)[row]
        });
        let by_quantities = by_parameters * by_quantities;
        let needed = SMatrix::<f64, 6, PARAMETERS>::from_fn(|row, quantity| {
            if is_told[quantity] { by_quantities[(row, quantity)] / row_size(row) } else { 0.0 }
        });
        let of_each = ErringThruster::errors_of(&errors.thrusters, &wrench);
        let of_each = SMatrix::<f64, 6, THRUSTERS>::from_fn(|row, thruster| of_each[(row, thruster)] / row_size(row));
        normal += needed.transpose() * needed;
        erring += needed.transpose() * of_each;
        of_thrusters += of_each.transpose() * of_each;
    }
    let what = "the least eigenvalue of what thrusters tell of a body";
    let inverse = |information: Matrix10| {
        information.cholesky().map(|factor| factor.inverse()).ok_or_else(|| indefinite(what, &information))
    };
    // Schur complement of the errors; with exact ones it is `normal`
    let solved = of_thrusters.cholesky().ok_or_else(|| indefinite(what, &normal))?.solve(&erring.transpose());
    let left = inverse(normal - erring * solved)? - inverse(normal)?;
    let mut covariance = Matrix10::from_fn(|i, j| left[(i, j)] * sizes[i] * sizes[j] * SHOWN * SHOWN);
    let of_axes = errors.rate_axes.of_inertia(&body.inertia_about_com());
    let is_told = SVector::<bool, PARAMETERS>::from(is_told);
    let mut of_inertia = covariance.fixed_view_mut::<6, 6>(4, 4);
    of_inertia += of_axes.map_with_location(|i, j, value| if is_told[4 + i] && is_told[4 + j] { value } else { 0.0 });
    Ok(covariance)
}

/// The belief with the covariance of what motion can still teach, pushed along so many axes: along each direction less what lasts.
///
/// # Errors
/// A belief whose body does not exist, whose covariance is none.
pub(super) fn learnable(
    errors: &LastingErrors,
    belief: &ModelBelief,
    pushed_axes: usize,
) -> Result<ModelBelief, PlanningError> {
    let mut learnable = belief.clone();
    if errors.thrusters.iter().all(|thruster| thruster.relative == 0.0) && errors.rate_axes == AxisErrors::NONE {
        return Ok(learnable);
    }
    let body = belief.parameters();
    let covariance = covariance_about_com(belief)?;
    let (sigma, information) =
        whitened(&covariance, &sizes_about_com(body), &["a variance of the belief"; PARAMETERS])?;
    let what = "the least eigenvalue of the belief's information";
    let factor = information.cholesky().ok_or_else(|| indefinite(what, &information))?.l();
    let inverse = factor.try_inverse().ok_or_else(|| indefinite(what, &information))?;
    // white for the belief
    let lasting = lasting(errors, body, pushed_axes)?;
    let scaled = Matrix10::from_fn(|i, j| lasting[(i, j)] / (sigma[i] * sigma[j]));
    let white = factor.transpose() * scaled * factor;
    let eigen = ((white + white.transpose()) * 0.5).symmetric_eigen();
    let left = Matrix10::from_diagonal(&eigen.eigenvalues.map(|share| 1.0 - share.clamp(0.0, MOST_LASTING)));
    let left = eigen.eigenvectors * left * eigen.eigenvectors.transpose();
    let left = inverse.transpose() * left * inverse;
    let left = Matrix10::from_fn(|i, j| left[(i, j)] * sigma[i] * sigma[j]);
    let by_quantities = body_by_mass_center_and_inertia(body);
    let left = by_quantities * left * by_quantities.transpose();
    learnable.estimate.covariance = (left + left.transpose()) * 0.5;
    Ok(learnable)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    fn body() -> InertialParameters<f64> {
        let inertia = Matrix3::new(0.15, 0.01, -0.02, 0.01, 0.14, 0.005, -0.02, 0.005, 0.16);
        InertialParameters::about_com(9.5, Vector3::new(0.05, -0.1, 0.07), inertia)
    }

    fn of_thrusters(thrusters: &[ErringThruster; THRUSTERS]) -> LastingErrors {
        LastingErrors { thrusters: *thrusters, rate_axes: AxisErrors::NONE }
    }

    fn sigma_about_com(belief: &ModelBelief) -> SMatrix<f64, PARAMETERS, 1> {
        covariance_about_com(belief).unwrap().diagonal().map(f64::sqrt)
    }

    /// By hand, of a body about its centre of mass that each axis moves by itself: the mass is told by three forces, each moment by one torque.
    #[test]
    fn what_lasts_of_a_body_is_what_its_thrusters_err_by() {
        let inertia = Matrix3::from_diagonal(&Vector3::new(0.15, 0.14, 0.16));
        let body = InertialParameters::about_com(9.5, Vector3::zeros(), inertia);
        let sigma = |thrusters: [ErringThruster; THRUSTERS], axes| {
            lasting(&of_thrusters(&thrusters), &body, axes).unwrap().diagonal().map(f64::sqrt)
        };
        let each = sigma(ErringThruster::along_axes(0.01), 3);
        assert!((each[0] / (9.5 * 0.01 / f64::sqrt(3.0)) - 1.0).abs() < 0.02, "{each}");
        assert!((each[4] / (0.01 * 0.15) - 1.0).abs() < 0.02, "{each}");
        assert!(each[1] < 1e-3 * 0.15, "{each}");
        let planar = sigma(ErringThruster::along_axes(0.01), 2);
        assert!((planar[0] / (9.5 * 0.01 / f64::sqrt(2.0)) - 1.0).abs() < 0.02, "{planar}");
        assert!((planar[9] / (0.01 * 0.16) - 1.0).abs() < 0.02 && planar[4] == 0.0, "{planar}");
        // twelve that err by themselves: the mean of all
        let pairs = sigma(ErringThruster::in_pairs(0.01, 0.1), 3);
        assert!((pairs[0] / (9.5 * 0.01 / f64::sqrt(12.0)) - 1.0).abs() < 0.05, "{pairs}");
    }

    /// Thrusters in pairs that err by little move their robot as another body would; those that err by much more than is seen wrong do not.
    #[test]
    fn errors_that_fit_no_body_give_themselves_away() {
        let sigma = |relative: f64| {
            let errors = of_thrusters(&ErringThruster::in_pairs(relative, 0.1));
            lasting(&errors, &body(), 3).unwrap().diagonal().map(|variance| variance.sqrt() / relative)
        };
        let (hidden, shown) = (sigma(1e-4), sigma(0.1));
        let share = shown.component_div(&hidden);
        // the mean of all thrust is a mass whatever is seen
        assert!(share[0] > 0.9 && share.iter().all(|share| *share < 1.0), "{share}");
        assert!((1..4).all(|axis| share[axis] < 0.5), "{share}");
        // hidden ones are what least squares takes them for: twice as much of twice the error
        assert!((sigma(2e-4).component_div(&hidden) - SVector::repeat(1.0)).amax() < 0.01, "{hidden}");
    }

    #[test]
    fn of_a_vague_body_nearly_all_can_be_learned_and_of_one_that_is_known_next_to_nothing() {
        let errors = of_thrusters(&ErringThruster::along_axes(0.01));
        let lasts = lasting(&errors, &body(), 3).unwrap().diagonal().map(f64::sqrt);
        let vague = ModelBelief::vague(3, body(), [0.3, 0.05, 0.3]);
        let left = learnable(&errors, &vague, 3).unwrap();
        assert_eq!(left.revision, 3);
        let (all, left) = (sigma_about_com(&vague), sigma_about_com(&left));
        // What is left and what lasts are the whole.
        for i in [0, 1, 4] {
            let found = f64::sqrt(all[i] * all[i] - left[i] * left[i]);
            assert!((found / lasts[i] - 1.0).abs() < 1e-3, "{i} {found} {}", lasts[i]);
        }
        // About its centre of mass the mass and each moment have an error of their own, the rest has none.
        let inertia = Matrix3::from_diagonal(&Vector3::new(0.15, 0.14, 0.16));
        let known = InertialParameters::about_com(9.5, Vector3::zeros(), inertia);
        let known = ModelBelief::vague(4, known, [1e-4, 1e-5, 1e-4]);
        let shares = sigma_about_com(&learnable(&errors, &known, 3).unwrap()).component_div(&sigma_about_com(&known));
        for (i, share) in shares.iter().enumerate() {
            let expected = if [0, 4, 7, 9].contains(&i) { f64::sqrt(1.0 - MOST_LASTING) } else { 1.0 };
            assert!((share - expected).abs() < 1e-6, "{i} {share}");
        }
    }

    /// By hand: of a product of two equal moments half of either axis's error.
    #[test]
    fn axes_of_a_gyroscope_leave_products_of_inertia_untold() {
        let body = InertialParameters::about_com(9.5, Vector3::zeros(), Matrix3::from_diagonal_element(0.15));
        let errors = LastingErrors {
            thrusters: [ErringThruster::NONE; THRUSTERS],
            rate_axes: AxisErrors { scale: 0.0, misalignment: 2e-3 },
        };
        let of = |axes| lasting(&errors, &body, axes).unwrap().diagonal().map(f64::sqrt);
        let (space, table) = (of(3), of(2));
        for (i, sigma) in space.iter().enumerate() {
            let expected = if [5, 6, 8].contains(&i) { 0.15 * 2e-3 / 2_f64.sqrt() } else { 0.0 };
            assert!((sigma - expected).abs() < 1e-12, "{i} {sigma}");
        }
        assert!(table.iter().all(|x| *x == 0.0));
        let vague = ModelBelief::vague(1, body, [0.3, 0.05, 0.3]);
        let (all, left) = (sigma_about_com(&vague), sigma_about_com(&learnable(&errors, &vague, 3).unwrap()));
        assert!((f64::sqrt(all[6] * all[6] - left[6] * left[6]) / space[6] - 1.0).abs() < 1e-3, "{all} {left}");
    }

    #[test]
    fn with_exact_thrusters_a_belief_stays_as_it_is() {
        let belief = ModelBelief::vague(1, body(), [0.3, 0.05, 0.3]);
        assert_eq!(learnable(&of_thrusters(&[ErringThruster::NONE; THRUSTERS]), &belief, 3).unwrap(), belief);
    }
}
