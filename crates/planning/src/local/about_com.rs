//! A body by mass, centre of mass and inertia about it, and by its ten parameters: how the ones change with the others.

use nalgebra::{Matrix3, SMatrix, SVector};
use tumble_dynamics::{InertialParameters, PARAMETERS};

/// Change of [`InertialParameters::to_vector`] by the mass and the moments of inertia about the centre of mass `Ixx, Iyy, Izz`,
/// the centre of mass held.
pub fn body_by_principal(body: &InertialParameters<f64>) -> SMatrix<f64, PARAMETERS, 4> {
    let all = body_by_mass_center_and_inertia(body);
    SMatrix::from_columns(&[all.column(0), all.column(4), all.column(7), all.column(9)])
}

/// Change of [`InertialParameters::to_vector`] by the mass, the centre of mass and the inertia about it
/// `Ixx, Ixy, Ixz, Iyy, Iyz, Izz`.
pub fn body_by_mass_center_and_inertia(body: &InertialParameters<f64>) -> SMatrix<f64, PARAMETERS, PARAMETERS> {
    let c = body.center_of_mass();
    let mut by_about_com = SMatrix::<f64, PARAMETERS, PARAMETERS>::zeros();
    for j in 0..PARAMETERS {
        let change = InertialParameters::from_vector(&SVector::<f64, PARAMETERS>::ith(j, 1.0));
        let moved = change.first_moment;
        let h = moved * body.mass + c * change.mass;
        // J = J_C + m (c.c I - c c^T)
        let inertia = change.inertia_about_origin
            + (Matrix3::identity() * (2.0 * c.dot(&moved)) - moved * c.transpose() - c * moved.transpose()) * body.mass
            + (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * change.mass;
        let column = InertialParameters { mass: change.mass, first_moment: h, inertia_about_origin: inertia };
        by_about_com.set_column(j, &column.to_vector());
    }
    by_about_com
}

/// Change of mass, centre of mass and inertia about it by the parameters of [`InertialParameters::to_vector`].
pub(super) fn about_com_by_parameters(body: &InertialParameters<f64>) -> SMatrix<f64, PARAMETERS, PARAMETERS> {
    let c = body.center_of_mass();
    let mut by_parameters = SMatrix::<f64, PARAMETERS, PARAMETERS>::zeros();
    for j in 0..PARAMETERS {
        let change = InertialParameters::from_vector(&SVector::<f64, PARAMETERS>::ith(j, 1.0));
        let moved = (change.first_moment - c * change.mass) / body.mass;
        // J_C = J - (h.h I - h h^T) / m with h = m c
        let h = change.first_moment;
        let inertia = change.inertia_about_origin - Matrix3::identity() * (2.0 * c.dot(&h))
            + h * c.transpose()
            + c * h.transpose()
            + (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * change.mass;
        let column = InertialParameters { mass: change.mass, first_moment: moved, inertia_about_origin: inertia };
        by_parameters.set_column(j, &column.to_vector());
    }
    by_parameters
}

/// Sizes of mass, centre of mass and inertia about it: the radius of gyration for the centre of mass, the mean moment of inertia
/// for inertias.
pub(crate) fn sizes_about_com(body: &InertialParameters<f64>) -> [f64; PARAMETERS] {
    let inertia = body.inertia_about_com().trace() / 3.0;
    let radius = f64::sqrt(1.5 * inertia / body.mass);
    core::array::from_fn(|i| [body.mass, radius, inertia][usize::from(i > 0) + usize::from(i > 3)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn body() -> InertialParameters<f64> {
        let inertia = Matrix3::new(0.15, 0.01, -0.02, 0.01, 0.14, 0.005, -0.02, 0.005, 0.16);
        InertialParameters::about_com(9.5, Vector3::new(0.05, -0.1, 0.07), inertia)
    }

    fn about_com(parameters: &SVector<f64, 10>) -> SVector<f64, 10> {
        let body = InertialParameters::from_vector(parameters);
        let (first_moment, inertia_about_origin) = (body.center_of_mass(), body.inertia_about_com());
        InertialParameters { mass: body.mass, first_moment, inertia_about_origin }.to_vector()
    }

    #[test]
    fn the_change_of_the_body_about_its_centre_of_mass() {
        let (p, by_parameters) = (body().to_vector(), about_com_by_parameters(&body()));
        for j in 0..10 {
            let step = SVector::<f64, 10>::ith(j, 1e-4);
            let quotient = (about_com(&(p + step)) - about_com(&(p - step))) / 2e-4;
            assert!((quotient - by_parameters.column(j)).amax() < 1e-8, "{j} {quotient}");
        }
        let both = body_by_mass_center_and_inertia(&body()) * by_parameters;
        assert!((both - SMatrix::identity()).amax() < 1e-13, "{both}");
    }

    #[test]
    fn the_body_changes_with_its_quantities_as_said() {
        let inertia = Matrix3::new(1.5, 0.1, 0.2, 0.1, 2.0, 0.3, 0.2, 0.3, 3.0);
        let body = |q: &SVector<f64, 10>| {
            let inertia = Matrix3::new(q[4], q[5], q[6], q[5], q[7], q[8], q[6], q[8], q[9]);
            InertialParameters::about_com(q[0], Vector3::new(q[1], q[2], q[3]), inertia).to_vector()
        };
        let at = SVector::from([5.0, 0.05, 0.1, -0.07, 1.5, 0.1, 0.2, 2.0, 0.3, 3.0]);
        let believed = InertialParameters::about_com(5.0, Vector3::new(0.05, 0.1, -0.07), inertia);
        let by_quantity = body_by_mass_center_and_inertia(&believed);
        for quantity in 0..10 {
            let change = SVector::from_fn(|i, _| if i == quantity { 1e-4 } else { 0.0 });
            // quadratic in the centre of mass: central differences are exact but for rounding
            let difference = (body(&(at + change)) - body(&(at - change))) / 2e-4;
            assert!((difference - by_quantity.column(quantity)).amax() < 1e-11, "{quantity}");
        }
        let principal = body_by_principal(&believed);
        assert_eq!(principal, by_quantity.select_columns(&[0, 4, 7, 9]).fixed_columns::<4>(0).into_owned());
    }
}
