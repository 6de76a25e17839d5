//! Beliefs in bodies whose quantities about the centre of mass are known independently.

use tumble_planning::ModelBelief;
use tumble_planning::dynamics::InertialParameters;
use tumble_planning::nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// The body of mass, centre of mass and inertia about it (xx, xy, xz, yy, yz, zz).
pub fn body_of(q: &[f64; 10]) -> InertialParameters<f64> {
    let inertia = Matrix3::new(q[4], q[5], q[6], q[5], q[7], q[8], q[6], q[8], q[9]);
    InertialParameters::about_com(q[0], Vector3::new(q[1], q[2], q[3]), inertia)
}

/// A belief in that body whose quantities have these standard deviations and are independent, to first order.
pub fn belief_about_com(q: &[f64; 10], sigma: &[f64; 10]) -> ModelBelief {
    let mut factor = SMatrix::<f64, 10, 10>::zeros();
    for (j, sigma) in sigma.iter().enumerate() {
        let at = |amount: f64| {
            let mut moved = *q;
            moved[j] += amount;
            body_of(&moved).to_vector()
        };
        // the parameters are polynomials of the quantities, of third degree at most
        let width = 0.1 * sigma;
        let change: SVector<f64, 10> = (at(width) - at(-width)) * 8.0 - (at(2.0 * width) - at(-2.0 * width));
        factor.set_column(j, &(change * (sigma / (12.0 * width))));
    }
    let mut belief = ModelBelief::certain(1, body_of(q));
    let covariance = factor * factor.transpose();
    belief.estimate.covariance = (covariance + covariance.transpose()) * 0.5;
    belief
}

/// A number between -1 and 1.
pub fn wave(i: usize) -> f64 {
    (1.0 + 1.7 * i as f64).sin()
}
