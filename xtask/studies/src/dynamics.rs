//! Problem 2: regressor, inverse and forward dynamics of one body on 64 states.

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_dynamics::{BodyAcceleration, FreeFlyer, InertialParameters};
use tumble_identification::regressors::newton_euler;
use tumble_lie::{Twist, Wrench};

use crate::Failure;
use crate::bench::{Bench, Goal, numbers};
use tumble_identification::noise::signed_unit;

const PROBLEM: &str = "dynamics";

/// One motion and one wrench of the file; both are only inputs and do not belong together.
struct Case {
    twist: Twist<f64>,
    /// Derivative of the components of the twist.
    twist_rate: Twist<f64>,
    wrench: Wrench<f64>,
}

/// The body of thesis chapter 5, about the body origin.
pub fn ch5_body() -> InertialParameters<f64> {
    InertialParameters::about_origin(CH5_MASS, ch5_center(), ch5_inertia())
}

const CH5_MASS: f64 = 5.0;

fn ch5_center() -> Vector3<f64> {
    Vector3::new(0.05, 0.1, 0.05)
}

fn ch5_inertia() -> Matrix3<f64> {
    Matrix3::new(1.5, 0.1, 0.2, 0.1, 2.0, 0.3, 0.2, 0.3, 3.0)
}

/// `[angular; linear]` momentum about the body origin is this times the twist; assembled here, not by the library.
pub fn ch5_mass_matrix() -> Matrix6<f64> {
    let (mass, lever) = (CH5_MASS, ch5_center().cross_matrix() * CH5_MASS);
    let mut matrix = Matrix6::zeros();
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&ch5_inertia());
    matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&lever);
    matrix.fixed_view_mut::<3, 3>(3, 0).copy_from(&lever.transpose());
    matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&(Matrix3::identity() * mass));
    matrix
}

/// The wrench that the balance of momentum asks for: `M rate + ad* momentum`.
fn balance(twist: &Twist<f64>, twist_rate: &Twist<f64>) -> Vector6<f64> {
    let matrix = ch5_mass_matrix();
    let momentum = matrix * twist.to_vector();
    let (angular, linear) = (momentum.fixed_rows::<3>(0).into_owned(), momentum.fixed_rows::<3>(3).into_owned());
    let torque = twist.angular.cross(&angular) + twist.linear.cross(&linear);
    let force = twist.angular.cross(&linear);
    matrix * twist_rate.to_vector() + Vector6::new(torque.x, torque.y, torque.z, force.x, force.y, force.z)
}

pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    let cases = cases(bench)?;
    let count = cases.len();
    let body = ch5_body();
    let flyer = FreeFlyer::new(body);
    let accelerations: Vec<BodyAcceleration<f64>> =
        cases.iter().map(|case| BodyAcceleration::from_twist_rate_body(&case.twist, &case.twist_rate)).collect();
    let worst = |error: &dyn Fn(usize) -> f64| [("max_error", (0..count).map(error).fold(0.0, f64::max))];

    let regressor = |i: usize| -> SMatrix<f64, 6, 10> {
        let acceleration = &accelerations[i];
        newton_euler(
            &cases[i].twist.angular,
            &acceleration.angular_acceleration_body,
            &acceleration.acceleration_origin_body,
        )
    };
    let quality = worst(&|i| (regressor(i) * body.to_vector() - balance(&cases[i].twist, &cases[i].twist_rate)).amax());
    let goal = Goal::at(15.0, "pinocchio-cpp", 14.4);
    bench.sweep(PROBLEM, "single_regressor_6x10", goal, count, &quality, regressor);

    let inverse = |i: usize| flyer.inverse(&cases[i].twist, &accelerations[i]);
    let quality = worst(&|i| (inverse(i).to_vector() - balance(&cases[i].twist, &cases[i].twist_rate)).amax());
    let goal = Goal::at(38.0, "pinocchio-cpp", 37.9);
    bench.sweep(PROBLEM, "single_inverse_dynamics", goal, count, &quality, inverse);

    let forward = |i: usize| flyer.forward(&cases[i].twist, &cases[i].wrench);
    let quality = worst(&|i| {
        let rate = forward(i).twist_rate_body(&cases[i].twist);
        (balance(&cases[i].twist, &rate) - cases[i].wrench.to_vector()).amax()
    });
    let goal = Goal::shown("pinocchio-cpp aba", 216.0);
    bench.sweep(PROBLEM, "single_forward_dynamics", goal, count, &quality, forward);
    Ok(())
}

/// The frozen states, or others of the same kind.
fn cases(bench: &Bench) -> Result<Vec<Case>, Failure> {
    let Some(folder) = &bench.data else {
        eprintln!("skipped: the frozen inputs of problem 2 (--data DIR); states are drawn from seed 2");
        let mut generator = ChaCha8Rng::seed_from_u64(2);
        let mut draw = || Vector3::from_fn(|_, _| signed_unit(&mut generator));
        return Ok((0..64)
            .map(|_| Case {
                twist: Twist::new(draw(), draw()),
                twist_rate: Twist::new(draw(), draw()),
                wrench: Wrench::new(draw(), draw()),
            })
            .collect());
    };
    let path = folder.join("mb_states.csv");
    numbers(&path)?
        .iter()
        .map(|row| {
            let vector = |start: usize| row.get(start..start + 3).map(Vector3::from_column_slice);
            // Position 3, quaternion 4, joints 7, then linear 3, angular 3, joints 7 of twist, acceleration and wrench.
            match [14, 17, 27, 30, 40, 43].map(vector) {
                [Some(v), Some(w), Some(v_rate), Some(w_rate), Some(force), Some(torque)] => Ok(Case {
                    twist: Twist::new(w, v),
                    twist_rate: Twist::new(w_rate, v_rate),
                    wrench: Wrench::new(torque, force),
                }),
                _ => Err(Failure::file(&path, "a row has fewer than 46 numbers")),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_balance_knows_a_point_mass_on_a_circle() {
        // Steady turn about z: the centre of mass circles the origin and is pulled inwards, m w^2 r.
        let spin = Twist::new(Vector3::new(0.0, 0.0, 2.0), Vector3::zeros());
        let force = balance(&spin, &Twist::zero()).fixed_rows::<3>(3).into_owned();
        assert!((force - Vector3::new(-1.0, -2.0, 0.0)).amax() < 1e-15);
    }
}
