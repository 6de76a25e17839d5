//! Laws of free bodies.

use crate::error::DynamicsError;
use crate::free_flyer::BodyAcceleration;
use crate::gyrostat::GyrostatInput;
use crate::inertia::InertialParameters;
use crate::laws::{LawViolation, require};
use crate::state::RigidBodyState;
use crate::system::{MechanicalSystem, RigidBody};
use tumble_lie::nalgebra::{SVector, Vector3, Vector6};
use tumble_lie::{Twist, Wrench};

type State = RigidBodyState<f64>;

/// Largest absolute entry, at least one.
pub(super) fn scale(vectors: &[Vector6<f64>]) -> f64 {
    vectors.iter().map(Vector6::amax).fold(1.0, f64::max)
}

/// Momentum about the body origin, body axes, written out.
fn momentum(body: &InertialParameters<f64>, twist: &Twist<f64>) -> Wrench<f64> {
    let InertialParameters { mass, first_moment, inertia_about_origin } = body;
    Wrench::new(
        inertia_about_origin * twist.angular + first_moment.cross(&twist.linear),
        twist.linear * *mass + twist.angular.cross(first_moment),
    )
}

/// The laws of a free rigid body moved by a wrench about its origin.
///
/// "the pose moves with the twist"; "power balance": the kinetic energy changes by the power of the wrench;
/// "momentum balance": the rate of the momentum is the wrench (this is Newton-Euler, with the parameters the body
/// claims). `tolerance` is relative to the wrench and the momentum rates.
/// # Errors
/// The first broken law.
pub fn check_system<S>(system: &S, samples: &[(State, Wrench<f64>)], tolerance: f64) -> Result<(), LawViolation>
where
    S: MechanicalSystem<State = State, Input = Wrench<f64>> + RigidBody<Scalar = f64>,
    S::State: tumble_lie::Manifold<Scalar = f64, Tangent = SVector<f64, 12>>,
{
    let body = system.inertial_parameters();
    for sample @ (state, wrench) in samples {
        let rate = system.vector_field(0.0, state, wrench);
        let balance = Balance { body: &body, twist: &state.twist_body, wrench, stored: &Vector3::zeros() };
        balance.check(sample, rate, tolerance)?;
    }
    Ok(())
}

/// The laws of a body with momentum that turns within it: those of [`check_system`], where
///
/// "power balance" says that stored momentum does no work, "momentum balance" that the momentum of body and
/// wheels together changes by the torque from outside.
/// # Errors
/// The first broken law.
pub fn check_gyrostat<S>(
    system: &S,
    samples: &[(State, GyrostatInput<f64>)],
    tolerance: f64,
) -> Result<(), LawViolation>
where
    S: MechanicalSystem<State = State, Input = GyrostatInput<f64>> + RigidBody<Scalar = f64>,
    S::State: tumble_lie::Manifold<Scalar = f64, Tangent = SVector<f64, 12>>,
{
    let body = system.inertial_parameters();
    for (i, sample @ (state, input)) in samples.iter().enumerate() {
        let time_s = input.since_s + i as f64 * 0.01;
        let rate = system.vector_field(time_s, state, input);
        let stored = input.stored_body + input.stored_rate_body * (time_s - input.since_s);
        let balance = Balance { body: &body, twist: &state.twist_body, wrench: &input.wrench_body, stored: &stored };
        balance.check(sample, rate, tolerance)?;
    }
    Ok(())
}

/// What a rate of a body's state must balance.
struct Balance<'a> {
    body: &'a InertialParameters<f64>,
    twist: &'a Twist<f64>,
    wrench: &'a Wrench<f64>,
    stored: &'a Vector3<f64>,
}

impl Balance<'_> {
    fn check(
        &self,
        sample: &dyn core::fmt::Debug,
        rate: Result<SVector<f64, 12>, DynamicsError>,
        tolerance: f64,
    ) -> Result<(), LawViolation> {
        let Self { body, twist, wrench, stored } = self;
        let rate = match rate {
            Ok(rate) => rate,
            Err(error) => {
                return require("the field has a value", sample, &"a rate", &error, f64::INFINITY, tolerance);
            }
        };
        let pose_rate = rate.fixed_rows::<6>(0).into_owned();
        let error = (pose_rate - twist.to_vector()).amax();
        let size = scale(&[twist.to_vector()]);
        require("the pose moves with the twist", sample, twist, &pose_rate, error / size, tolerance)?;

        let twist_rate = Twist::from(rate.fixed_rows::<6>(6).into_owned());
        let (momentum, momentum_rate) = (momentum(body, twist), momentum(body, &twist_rate));
        let (w, v) = (&twist.angular, &twist.linear);
        let transport =
            Wrench::new(w.cross(&(momentum.torque + *stored)) + v.cross(&momentum.force), w.cross(&momentum.force));
        let size = scale(&[wrench.to_vector(), transport.to_vector(), momentum_rate.to_vector()]);
        // M is symmetric: d/dt (1/2 xi M xi) = xi M xi'
        let (power, energy_rate) = (twist.power(wrench), twist.power(&momentum_rate));
        let error = (power - energy_rate).abs() / (size * scale(&[twist.to_vector()]));
        require("power balance", sample, &power, &energy_rate, error, tolerance)?;
        let found = momentum_rate + transport;
        let error = (found - **wrench).to_vector().amax() / size;
        require("momentum balance", sample, wrench, &found, error, tolerance)
    }
}

/// "forward(inverse(a)) = a" and "inverse(forward(w)) = w" for a pair of functions of the twist.
///
/// # Errors
/// The first broken law.
pub fn check_inverse_dynamics(
    forward: impl Fn(&Twist<f64>, &Wrench<f64>) -> BodyAcceleration<f64>,
    inverse: impl Fn(&Twist<f64>, &BodyAcceleration<f64>) -> Wrench<f64>,
    samples: &[(Twist<f64>, Wrench<f64>)],
    tolerance: f64,
) -> Result<(), LawViolation> {
    let flat =
        |a: &BodyAcceleration<f64>| Twist::new(a.angular_acceleration_body, a.acceleration_origin_body).to_vector();
    for sample @ (twist, numbers) in samples {
        let acceleration =
            BodyAcceleration { angular_acceleration_body: numbers.torque, acceleration_origin_body: numbers.force };
        let back = forward(twist, &inverse(twist, &acceleration));
        let turning = twist.to_vector().norm_squared();
        let error = (flat(&back) - flat(&acceleration)).amax() / (scale(&[flat(&acceleration)]) + turning);
        require("forward(inverse(a)) = a", sample, &acceleration, &back, error, tolerance)?;
        let wrench = inverse(twist, &forward(twist, numbers));
        let error = (wrench - *numbers).to_vector().amax() / (scale(&[numbers.to_vector()]) + turning);
        require("inverse(forward(w)) = w", sample, numbers, &wrench, error, tolerance)?;
    }
    Ok(())
}
