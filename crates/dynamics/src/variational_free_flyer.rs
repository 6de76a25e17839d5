//! The dual-quaternion variational integrator of a free rigid body, specialised: no dual numbers, no allocation.

use crate::error::DynamicsError;
use crate::free_flyer::{FreeFlyer, inverse_of_symmetric};
use crate::inertia::InertialParameters;
use crate::state::RigidBodyState;
use crate::system::Integrator;
use tumble_lie::nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use tumble_lie::{Increment, Scalar, Twist, Wrench, real, skew, value};

/// Newton iterations after which a step counts as too long; two or three are usual.
const MAX_ITERATIONS: u32 = 30;

/// One step of the dual-quaternion variational integrator; `wrench_body` is held, half of its impulse acts at each end.
///
/// The discrete Lagrangian `(2/h) [Phi; Psi]^T M [Phi; Psi]` does not change when the body origin does: `[Phi; Psi]`
/// transforms as a twist. About the centre of mass `M` is block diagonal, the force equation is linear in `Psi` with
/// the closed solution used here, and what remains is three equations for `Phi`.
/// The new momentum is the old one carried over by the coadjoint action of the step, so the spatial momentum is kept
/// to rounding whatever the residual of the torque equation.
/// # Frame
/// Twist and wrench in body axes about the body origin; a held wrench turns with the body.
/// # Errors
/// [`DynamicsError::StepTooLarge`] where the body would turn 90 degrees or more;
/// [`DynamicsError::TravelTooLong`] where the centre of mass would travel about twice the radius of gyration or more
/// (the discrete Lagrangian is not invariant under a change to a moving inertial frame: choose a frame in which the
/// body is slow, or a shorter step); [`DynamicsError::NotFinite`] for a body without inertia or a state that is not
/// finite.
/// # Source
/// Thesis (5.13)-(5.20).
/// # Deviation
/// The second denominator of (5.18) carries index k-1. The recursion in increments is written with the discrete
/// Legendre momenta between the steps, which makes pose and twist the whole state.
#[inline]
pub fn variational_step<T: Scalar>(
    body: &InertialParameters<T>,
    state: &RigidBodyState<T>,
    wrench_body: &Wrench<T>,
    step_s: T,
) -> Result<RigidBodyState<T>, DynamicsError> {
    let half = real::<T>(0.5);
    let half_step_s = step_s * half;
    let mass = body.mass;
    let com = body.center_of_mass();
    let inertia = body.inertia_about_com();
    let inertia_inverse = inverse_of_symmetric(&inertia);
    let half_impulse = wrench_body.force * half_step_s;
    let half_angular_impulse = (wrench_body.torque - com.cross(&wrench_body.force)) * half_step_s;

    // Momenta about the centre of mass, body axes, just after the first half of the impulse.
    let Twist { angular: rate, linear: velocity } = state.twist_body;
    let momentum = (velocity + rate.cross(&com)) * mass + half_impulse;
    let angular_momentum = inertia * rate + half_angular_impulse;

    let displacement =
        solve_increment(&inertia, &inertia_inverse, mass, &momentum, &angular_momentum, step_s)?.to_displacement();
    let (turn, travel) = (displacement.rotation, displacement.translation.vector);

    // Coadjoint action: the momenta as seen from the new frame.
    let momentum_after = turn.inverse_transform_vector(&momentum) + half_impulse;
    let angular_momentum_after =
        turn.inverse_transform_vector(&(angular_momentum - travel.cross(&momentum))) + half_angular_impulse;
    let rate_after = inertia_inverse * angular_momentum_after;
    let velocity_after = momentum_after / mass - rate_after.cross(&com);

    let attitude = state.world_from_body.rotation;
    let product = attitude.into_inner() * turn.into_inner();
    // The norm is one up to rounding, where the first Newton step of the inverse square root is exact.
    let attitude_after = product * (real::<T>(1.5) - half * product.norm_squared());
    // The origin travels with the centre of mass, and around it.
    let com_turned = com - turn * com;
    let position = state.world_from_body.translation.vector + attitude * (travel + com_turned);
    Ok(RigidBodyState {
        world_from_body: Isometry3::from_parts(
            Translation3::from(position),
            UnitQuaternion::new_unchecked(attitude_after),
        ),
        twist_body: Twist::new(rate_after, velocity_after),
    })
}

/// Solves `-D1 L_d = momenta` for the increment, about the centre of mass.
///
/// With `a = sqrt(1 - Phi^2)` and `P = h p / (2 m)` the force equation `a Psi + Phi x Psi = P` gives
/// `Psi = a P - Phi x P + Phi (Phi.P) / a`, hence `f_b0 = -(Phi.P) / a^2`, and the torque equation becomes
/// `a J Phi + Phi x J Phi + f_b0 m Psi = (h/2) angular momentum`.
#[inline(always)]
fn solve_increment<T: Scalar>(
    inertia: &Matrix3<T>,
    inertia_inverse: &Matrix3<T>,
    mass: T,
    momentum: &Vector3<T>,
    angular_momentum: &Vector3<T>,
    step_s: T,
) -> Result<Increment<T>, DynamicsError> {
    let half_step_s = step_s * real(0.5);
    let p = momentum * (half_step_s / mass);
    let target = angular_momentum * half_step_s;
    // Squared relative size of an update after which the next one is below rounding.
    let negligible = T::default_epsilon() * real(1.0 / 256.0);

    // Start: the increment at constant rate, then one explicit correction by the gyroscopic and the coupling torque.
    let first = inertia_inverse * target;
    let mut phi = inertia_inverse
        * (target - first.cross(&target) + p * (first.dot(&p) * mass) + target * (first.norm_squared() * real(0.5)));
    let mut last_update = T::zero();
    for _ in 0..MAX_ITERATIONS {
        let square = phi.norm_squared();
        if !square.is_finite() {
            return Err(DynamicsError::NotFinite);
        }
        if square >= T::one() {
            return Err(DynamicsError::StepTooLarge { step_s: value(step_s), norm: value(square.sqrt()) });
        }
        let a = (T::one() - square).sqrt();
        let per_a = T::one() / a;
        let j_phi = inertia * phi;
        let along = phi.dot(&p) * per_a;
        let f_b0 = -along * per_a;
        let m_psi = (p * a - phi.cross(&p) + phi * along) * mass;
        let residual = j_phi * a + phi.cross(&j_phi) + m_psi * f_b0 - target;

        // Rates along Phi: a' = -Phi / a, along' = P / a + Phi along / a^2.
        let a_rate = -phi * per_a;
        let along_rate = (p - a_rate * along) * per_a;
        let f_b0_rate = (a_rate * (along * per_a) - along_rate) * per_a;
        let mut jacobian = j_phi * a_rate.transpose() - skew(&j_phi) + skew(&phi) * inertia + inertia * a;
        jacobian += m_psi * f_b0_rate.transpose()
            + (skew(&p) + p * a_rate.transpose() + phi * along_rate.transpose()) * (f_b0 * mass)
            + Matrix3::from_diagonal_element(along * f_b0 * mass);
        let (update, determinant) = solve(&jacobian, &residual);
        phi -= update;
        last_update = update.norm_squared();
        if last_update <= phi.norm_squared() * negligible {
            if determinant <= T::zero() {
                return Err(DynamicsError::TravelTooLong {
                    step_s: value(step_s),
                    travel_m: value(p.norm() * real::<T>(2.0)),
                });
            }
            return increment(phi, &p, step_s);
        }
    }
    Err(DynamicsError::StepNotConverged {
        step_s: value(step_s),
        residual: value(last_update.sqrt()),
        iterations: MAX_ITERATIONS,
    })
}

/// The increment that belongs to a solution `Phi`.
#[inline(always)]
fn increment<T: Scalar>(phi: Vector3<T>, p: &Vector3<T>, step_s: T) -> Result<Increment<T>, DynamicsError> {
    let square = phi.norm_squared();
    if square > real(0.5) {
        // Beyond a quarter turn the equations have a second, unphysical solution.
        return Err(DynamicsError::StepTooLarge { step_s: value(step_s), norm: value(square.sqrt()) });
    }
    let a = (T::one() - square).sqrt();
    Ok(Increment::try_new(phi, p * a - phi.cross(p) + phi * (phi.dot(p) / a))?)
}

/// Solution of `matrix x = right` by Cramer's rule, and the determinant; not finite where it is zero.
#[inline(always)]
fn solve<T: Scalar>(matrix: &Matrix3<T>, right: &Vector3<T>) -> (Vector3<T>, T) {
    let (c0, c1, c2) = (matrix.column(0), matrix.column(1), matrix.column(2));
    let normal = c1.cross(&c2);
    let determinant = c0.dot(&normal);
    let turned = c0.cross(right);
    (Vector3::new(right.dot(&normal), c2.dot(&turned), -c1.dot(&turned)) / determinant, determinant)
}

/// The dual-quaternion variational integrator as an [`Integrator`]: see [`variational_step`].
#[derive(Clone, Copy, Debug, Default)]
pub struct VariationalFreeFlyer;

impl<T: Scalar> Integrator<FreeFlyer<T>> for VariationalFreeFlyer {
    fn order(&self) -> u32 {
        2
    }
    #[inline]
    fn step(
        &self,
        system: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench_body: &Wrench<T>,
        _time_s: T,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        variational_step(system.parameters(), state, wrench_body, step_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_lie::Pose;
    use tumble_lie::nalgebra::SVector;

    fn body_d() -> InertialParameters<f64> {
        InertialParameters::about_origin(
            5.0,
            Vector3::new(0.05, 0.1, 0.05),
            Matrix3::new(1.5, 0.1, 0.2, 0.1, 2.0, 0.3, 0.2, 0.3, 3.0),
        )
    }

    #[test]
    fn golden_step_of_body_d() {
        let state = RigidBodyState {
            world_from_body: Pose::identity(),
            twist_body: Twist::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.1, -0.05, 0.2)),
        };
        let wrench = Wrench::new(
            Vector3::new(0.0, 0.4 * 0.5_f64.sin(), 0.6),
            Vector3::new(1.0, 0.8 * 0.2_f64.sin(), 1.2 * 1.0_f64.sin()),
        );
        let after = variational_step(&body_d(), &state, &wrench, 0.05).unwrap().world_from_body;
        let position = Vector3::new(0.005_283_125_378_2, -0.002_418_866_920_8, 0.010_271_726_217_7);
        let attitude =
            SVector::from([0.007_519_424_067_6, -0.004_903_047_954_1, 0.012_627_953_504_2, 0.999_879_969_382_7]);
        assert!((after.translation.vector - position).amax() < 1e-13, "{after:?}");
        assert!((after.rotation.coords - attitude).amax() < 1e-13, "{after:?}");
    }
}
