//! Tutorial: bring your own Lagrangian and get its variational integrator.
//!
//! Say what the configuration group is, how a configuration is lifted to another scalar, and what the Lagrangian is;
//! the discrete Lagrangian defaults to the midpoint of the geodesic, derivatives are taken for you. The system's
//! `vector_field` stays what it always is: the law of the order compares both.

use tumble_dynamics::laws::{check_order, check_symplectic_lagrangian};
use tumble_dynamics::lie::{Scalar, real};
use tumble_dynamics::nalgebra::{ComplexField, Matrix2, Translation2, Vector2};
use tumble_dynamics::{DiscreteLagrangian, DynamicsError, GroupState, GroupTangent, MechanicalSystem, Variational};

/// Two links of unit mass and length, swinging in a plane; angles from the vertical. The mass matrix depends on them.
struct DoublePendulum;

const GRAVITY: f64 = 9.81;

impl MechanicalSystem for DoublePendulum {
    type State = GroupState<Translation2<f64>>;
    /// Torques on the two angles, N m.
    type Input = Vector2<f64>;
    fn vector_field(
        &self,
        _time_s: f64,
        state: &Self::State,
        torque: &Vector2<f64>,
    ) -> Result<GroupTangent<Translation2<f64>>, DynamicsError> {
        let (angle, rate) = (state.configuration.vector, state.velocity);
        let (sin, cos) = ComplexField::sin_cos(angle.x - angle.y);
        let mass_matrix = Matrix2::new(2.0, cos, cos, 1.0);
        let right = Vector2::new(
            torque.x - sin * rate.y * rate.y - 2.0 * GRAVITY * ComplexField::sin(angle.x),
            torque.y + sin * rate.x * rate.x - GRAVITY * ComplexField::sin(angle.y),
        );
        let acceleration = mass_matrix.try_inverse().ok_or(DynamicsError::NotFinite)? * right;
        Ok(GroupTangent { configuration: rate, velocity: acceleration })
    }
}

impl DiscreteLagrangian for DoublePendulum {
    type Group<T: Scalar> = Translation2<T>;
    fn lift<T: Scalar>(angles: &Translation2<f64>) -> Translation2<T> {
        Translation2::from(angles.vector.map(real))
    }
    fn lagrangian<T: Scalar>(&self, angles: &Translation2<T>, rates: &Vector2<T>) -> T {
        let (a, w) = (angles.vector, rates);
        let kinetic = w.x * w.x + w.x * w.y * (a.x - a.y).cos() + w.y * w.y * real(0.5);
        kinetic + (a.x.cos() * real(2.0) + a.y.cos()) * real(GRAVITY)
    }
    fn force(&self, _: f64, _: &Translation2<f64>, _: &Vector2<f64>, torque: &Vector2<f64>) -> Vector2<f64> {
        *torque
    }
}

fn start() -> GroupState<Translation2<f64>> {
    GroupState { configuration: Translation2::new(0.8, -0.4), velocity: Vector2::new(0.3, 0.7) }
}

#[test]
fn the_step_is_of_order_two_and_symplectic() {
    check_order(&Variational, &DoublePendulum, &start(), &Vector2::new(0.5, -0.3), 0.05, 20, 0.2).unwrap();
    check_symplectic_lagrangian(&Variational, &DoublePendulum, &start(), &Vector2::zeros(), 0.05, 1e-7).unwrap();
}

/// A Lagrangian that is not that of the differential equations: its potential has the wrong sign.
struct Upside(DoublePendulum);
impl MechanicalSystem for Upside {
    type State = GroupState<Translation2<f64>>;
    type Input = Vector2<f64>;
    fn vector_field(
        &self,
        time_s: f64,
        state: &Self::State,
        torque: &Vector2<f64>,
    ) -> Result<GroupTangent<Translation2<f64>>, DynamicsError> {
        self.0.vector_field(time_s, state, torque)
    }
}
impl DiscreteLagrangian for Upside {
    type Group<T: Scalar> = Translation2<T>;
    fn lift<T: Scalar>(angles: &Translation2<f64>) -> Translation2<T> {
        DoublePendulum::lift(angles)
    }
    fn lagrangian<T: Scalar>(&self, angles: &Translation2<T>, rates: &Vector2<T>) -> T {
        let potential = self.0.lagrangian(angles, &Vector2::zeros());
        self.0.lagrangian(angles, rates) - potential * real(2.0)
    }
    fn force(&self, _: f64, _: &Translation2<f64>, _: &Vector2<f64>, torque: &Vector2<f64>) -> Vector2<f64> {
        *torque
    }
}

#[test]
fn a_wrong_sign_of_the_potential_is_another_motion() {
    let violation = check_order(&Variational, &Upside(DoublePendulum), &start(), &Vector2::zeros(), 0.05, 20, 0.2);
    assert_eq!(violation.unwrap_err().law, "observed order");
}
