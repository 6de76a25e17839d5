//! The dual-quaternion variational integrator of a free rigid body, specialised: no dual numbers, no allocation.

use crate::convergence::Rest;
use crate::error::DynamicsError;
use crate::free_flyer::{FreeFlyer, FreeFlyerIn, inverse_of_symmetric};
use crate::inertia::InertialParameters;
use crate::state::RigidBodyState;
use crate::system::{Integrator, WrenchModel};
use tumble_lie::nalgebra::{Matrix3, Translation3, UnitQuaternion, Vector3};
use tumble_lie::{Increment, Pose, Scalar, Twist, Wrench, real, skew, value};

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
    let half_impulse = *wrench_body * (step_s * real(0.5));
    let body = AboutCom::new(body);
    Ok(body.carried(state, &half_impulse, step_s)?.kicked(&body, &half_impulse))
}

/// Mass properties split at the centre of mass.
struct AboutCom<T: Scalar> {
    mass: T,
    com: Vector3<T>,
    inertia: Matrix3<T>,
    inertia_inverse: Matrix3<T>,
}

/// Pose at the end of a step and momenta about the centre of mass, body axes, before the impulse there.
struct Carried<T: Scalar> {
    world_from_body: Pose<T>,
    angular_momentum: Vector3<T>,
    momentum: Vector3<T>,
}

impl<T: Scalar> AboutCom<T> {
    #[inline(always)]
    fn new(body: &InertialParameters<T>) -> Self {
        let inertia = body.inertia_about_com();
        Self { mass: body.mass, com: body.center_of_mass(), inertia, inertia_inverse: inverse_of_symmetric(&inertia) }
    }

    /// The motion after `impulse` (about the body origin) at the start.
    #[inline(always)]
    fn carried(&self, state: &RigidBodyState<T>, impulse: &Wrench<T>, step_s: T) -> Result<Carried<T>, DynamicsError> {
        let com = &self.com;
        let Twist { angular: rate, linear: velocity } = &state.twist_body;
        let momentum = (velocity + rate.cross(com)) * self.mass + impulse.force;
        let angular_momentum = self.inertia * rate + impulse.torque - com.cross(&impulse.force);

        let displacement = self.solve_increment(&momentum, &angular_momentum, step_s)?.to_displacement();
        let (turn, travel) = (displacement.rotation, displacement.translation.vector);
        let attitude = state.world_from_body.rotation;
        let product = attitude.into_inner() * turn.into_inner();
        // The norm is one up to rounding, where one Newton step of the inverse square root is exact.
        let attitude_after = product * (real::<T>(1.5) - product.norm_squared() * real(0.5));
        // The origin travels with the centre of mass and around it.
        let position = state.world_from_body.translation.vector + attitude * (travel + (com - turn * com));
        Ok(Carried {
            world_from_body: Pose::from_parts(
                Translation3::from(position),
                UnitQuaternion::new_unchecked(attitude_after),
            ),
            angular_momentum: turn.inverse_transform_vector(&(angular_momentum - travel.cross(&momentum))),
            momentum: turn.inverse_transform_vector(&momentum),
        })
    }

    /// Solves `-D1 L_d = momenta` for the increment, about the centre of mass.
    ///
    /// With `a = sqrt(1 - Phi^2)` and `P = h p / (2 m)` the force equation `a Psi + Phi x Psi = P` gives
    /// `Psi = a P - Phi x P + Phi (Phi.P) / a`, hence `f_b0 = -(Phi.P) / a^2`, and the torque equation becomes
    /// `a J Phi + Phi x J Phi + f_b0 m Psi = (h/2) angular momentum`.
    #[inline(always)]
    fn solve_increment(
        &self,
        momentum: &Vector3<T>,
        angular_momentum: &Vector3<T>,
        step_s: T,
    ) -> Result<Increment<T>, DynamicsError> {
        let Self { mass, inertia, inertia_inverse, .. } = *self;
        let half_step_s = step_s * real(0.5);
        let p = momentum * (half_step_s / mass);
        let target = angular_momentum * half_step_s;
        // Squared relative size of an update after which the next one is below rounding.
        let negligible = T::default_epsilon() * real(1.0 / 256.0);

        let too_far =
            || DynamicsError::TravelTooLong { step_s: value(step_s), travel_m: value(p.norm() * real::<T>(2.0)) };
        // Travel takes `m P P^T` off the inertia that resists the turn; what remains must be positive definite.
        if p.dot(&(inertia_inverse * p)) * mass >= T::one() {
            return Err(too_far());
        }
        // Start: the increment at constant rate, then one explicit correction by the gyroscopic and the coupling torque.
        let first = inertia_inverse * target;
        let mut phi = inertia_inverse
            * (target - first.cross(&target)
                + p * (first.dot(&p) * mass)
                + target * (first.norm_squared() * real(0.5)));
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
                    return Err(too_far());
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
}

impl<T: Scalar> Carried<T> {
    /// The state after `impulse` (about the body origin) at the end.
    #[inline(always)]
    fn kicked(&self, body: &AboutCom<T>, impulse: &Wrench<T>) -> RigidBodyState<T> {
        let angular_momentum = self.angular_momentum + impulse.torque - body.com.cross(&impulse.force);
        let rate = body.inertia_inverse * angular_momentum;
        let velocity = (self.momentum + impulse.force) / body.mass - rate.cross(&body.com);
        RigidBodyState { world_from_body: self.world_from_body, twist_body: Twist::new(rate, velocity) }
    }
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

/// The environment's wrench is taken at both ends, half of the impulse each; where it depends on the velocity the end
/// is implicit.
impl<T: Scalar, E: WrenchModel<T>> Integrator<FreeFlyerIn<T, E>> for VariationalFreeFlyer {
    fn order(&self) -> u32 {
        2
    }
    fn step(
        &self,
        system: &FreeFlyerIn<T, E>,
        state: &RigidBodyState<T>,
        wrench_body: &Wrench<T>,
        time_s: T,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        let half_impulse = |time_s, state: &RigidBodyState<T>| {
            (*wrench_body + system.environment.wrench_body(time_s, state)) * (step_s * real(0.5))
        };
        let body = AboutCom::new(system.body.parameters());
        let impulse = half_impulse(time_s, state);
        let carried = body.carried(state, &impulse, step_s)?;
        let mut after = carried.kicked(&body, &impulse);
        let mut rest = Rest::new();
        for _ in 0..MAX_ITERATIONS {
            let next = carried.kicked(&body, &half_impulse(time_s + step_s, &after));
            let rested = rest.reached(&after.twist_body.to_vector(), &next.twist_body.to_vector());
            after = next;
            if rested {
                return Ok(after);
            }
        }
        Err(DynamicsError::StepNotConverged {
            step_s: value(step_s),
            residual: value(rest.last_change()),
            iterations: MAX_ITERATIONS,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::momentum::{body_momentum, momentum_at_end, momentum_at_start};
    use crate::strategies::body_d;
    use tumble_lie::nalgebra::SVector;

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

    fn step(rate: Vector3<f64>, velocity: Vector3<f64>, step_s: f64) -> Result<RigidBodyState<f64>, DynamicsError> {
        let state = RigidBodyState { twist_body: Twist::new(rate, velocity), ..RigidBodyState::at_rest() };
        variational_step(&body_d(), &state, &Wrench::zero(), step_s)
    }

    #[test]
    fn a_step_solves_the_printed_equations_about_the_origin() {
        let (rate, velocity) = (Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.1, -0.05, 0.2));
        for step_s in [1e-3, 0.05, 0.4, -0.3] {
            let body = body_d();
            let after = step(rate, velocity, step_s).unwrap();
            let increment = Increment::between(&Pose::identity(), &after.world_from_body).unwrap();
            let start =
                momentum_at_start(&body, &increment, step_s) - body_momentum(&body, &Twist::new(rate, velocity));
            let end = momentum_at_end(&body, &increment, step_s) - body_momentum(&body, &after.twist_body);
            // the increment carries rounding of the pose, the momentum divides it by the step
            assert!(start.to_vector().amax() < 1e-14 / step_s.abs(), "{start:?}");
            assert!(end.to_vector().amax() < 1e-14 / step_s.abs(), "{end:?}");
        }
    }

    #[test]
    fn a_resting_body_rests() {
        let after = step(Vector3::zeros(), Vector3::zeros(), 0.1).unwrap();
        assert_eq!(after, RigidBodyState::at_rest());
        assert_eq!(step(Vector3::new(0.1, 0.2, 0.3), Vector3::zeros(), 0.0).unwrap().world_from_body, Pose::identity());
    }

    #[test]
    fn turns_of_a_quarter_and_more_are_too_large() {
        let spin = |rate| {
            let rate = Vector3::new(0.0, 0.0, rate);
            step(rate, -rate.cross(&body_d().center_of_mass()), 0.1)
        };
        assert!(spin(9.0).is_ok());
        for rate in [20.0, 50.0, 1e3, 1e9] {
            assert!(matches!(
                spin(rate),
                Err(DynamicsError::StepTooLarge { .. } | DynamicsError::StepNotConverged { .. })
            ));
        }
    }

    #[test]
    fn travel_beyond_the_radius_of_gyration_is_too_long() {
        let fly = |velocity| step(Vector3::new(0.1, 0.2, 0.3), Vector3::new(velocity, 0.0, 0.0), 0.1);
        assert!(fly(5.0).is_ok());
        for velocity in [20.0, 1e3, 1e6] {
            assert!(matches!(fly(velocity), Err(DynamicsError::TravelTooLong { .. })), "{:?}", fly(velocity));
        }
    }

    #[test]
    fn what_is_not_finite_is_an_error() {
        let spin = Vector3::new(0.1, f64::NAN, 0.0);
        assert_eq!(step(spin, Vector3::zeros(), 0.1), Err(DynamicsError::NotFinite));
        assert_eq!(step(Vector3::zeros(), spin, 0.1), Err(DynamicsError::NotFinite));
        assert_eq!(step(Vector3::zeros(), Vector3::zeros(), f64::INFINITY), Err(DynamicsError::NotFinite));
        let point = InertialParameters::about_com(1.0, Vector3::zeros(), Matrix3::zeros());
        let state = RigidBodyState::at_rest();
        assert_eq!(variational_step(&point, &state, &Wrench::zero(), 0.1), Err(DynamicsError::NotFinite));
    }
}
