//! Energy and momentum maps of a free body, continuous and discrete.

use crate::inertia::InertialParameters;
use crate::state::RigidBodyState;
use tumble_lie::nalgebra::Vector3;
use tumble_lie::{Increment, Pose, Scalar, Twist, Wrench, real};

/// Kinetic energy, J.
///
/// # Source
/// Thesis (5.9), without the padding to eight rows.
#[inline]
pub fn kinetic_energy<T: Scalar>(body: &InertialParameters<T>, twist_body: &Twist<T>) -> T {
    twist_body.power(&body_momentum(body, twist_body)) * real(0.5)
}

/// Angular momentum about the body origin and linear momentum, `[J w + m c x v; m v + w x m c]`.
///
/// A momentum transforms as a wrench, whose type it shares.
/// # Frame
/// Body axes.
/// # Units
/// N m s, N s.
#[inline]
pub fn body_momentum<T: Scalar>(body: &InertialParameters<T>, twist_body: &Twist<T>) -> Wrench<T> {
    let Twist { angular, linear } = twist_body;
    let first_moment = &body.first_moment;
    Wrench::new(
        body.inertia_about_origin * angular + first_moment.cross(linear),
        linear * body.mass + angular.cross(first_moment),
    )
}

/// The twist of a body that has this momentum; not finite for a body without inertia.
///
/// # Frame
/// Body axes, about the body origin.
#[inline]
pub fn twist_of_momentum<T: Scalar>(body: &InertialParameters<T>, momentum_body: &Wrench<T>) -> Twist<T> {
    let com = body.center_of_mass();
    let about_com = momentum_body.torque - com.cross(&momentum_body.force);
    let angular = crate::free_flyer::inverse_of_symmetric(&body.inertia_about_com()) * about_com;
    Twist::new(angular, momentum_body.force / body.mass - angular.cross(&com))
}

/// Momentum about the inertial origin: constant while no wrench acts.
///
/// # Frame
/// Inertial axes, angular momentum about the inertial origin.
#[inline]
pub fn spatial_momentum<T: Scalar>(body: &InertialParameters<T>, state: &RigidBodyState<T>) -> Wrench<T> {
    body_momentum(body, &state.twist_body).transformed_by(&state.world_from_body)
}

/// The discrete Lagrangian of a free body, `(2/h) [Phi; Psi]^T M [Phi; Psi]`, J s.
///
/// # Source
/// Thesis (5.14).
pub fn discrete_lagrangian<T: Scalar>(body: &InertialParameters<T>, increment: &Increment<T>, step_s: T) -> T {
    let rate = Twist::new(increment.phi(), increment.psi());
    kinetic_energy(body, &rate) * (real::<T>(4.0) / step_s)
}

/// Discrete momentum at the start of an increment, `(2/h) [f_a0 Y + Phi x Y + f_b0 X + Psi x X; f_a0 X + Phi x X]`.
///
/// # Frame
/// Axes of the body at the start, about its origin.
/// # Source
/// Thesis (5.17), (5.19).
pub fn momentum_at_start<T: Scalar>(body: &InertialParameters<T>, increment: &Increment<T>, step_s: T) -> Wrench<T> {
    let (phi, psi) = (increment.phi(), increment.psi());
    let Wrench { torque: y, force: x } = body_momentum(body, &Twist::new(phi, psi));
    let angular: Vector3<T> = y * increment.f_a0() + phi.cross(&y) + x * increment.f_b0() + psi.cross(&x);
    Wrench::new(angular, x * increment.f_a0() + phi.cross(&x)) * (real::<T>(2.0) / step_s)
}

/// Discrete momentum at the end of an increment, `(2/h) [f_a0 Y - Phi x Y + f_b0 X - Psi x X; f_a0 X - Phi x X]`.
///
/// # Frame
/// Axes of the body at the end, about its origin.
/// # Source
/// Thesis (5.18), (5.20).
/// # Deviation
/// `f_b0 = -Phi.Psi / sqrt(1 - Phi^2)` with one and the same index; (5.18) prints `Phi_k` under the root.
pub fn momentum_at_end<T: Scalar>(body: &InertialParameters<T>, increment: &Increment<T>, step_s: T) -> Wrench<T> {
    momentum_at_start(body, &increment.reversed(), -step_s)
}

/// Conserved spatial momentum of a discrete motion: that of the increment from `world_from_start`.
///
/// # Frame
/// Inertial axes, about the inertial origin.
pub fn discrete_spatial_momentum<T: Scalar>(
    body: &InertialParameters<T>,
    world_from_start: &Pose<T>,
    increment: &Increment<T>,
    step_s: T,
) -> Wrench<T> {
    momentum_at_start(body, increment, step_s).transformed_by(world_from_start)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategies::body_d;
    use tumble_lie::nalgebra::{SVector, Translation3, UnitQuaternion};

    #[test]
    fn golden_discrete_impulse_of_body_d() {
        let pose = |position: [f64; 3], turn: [f64; 3]| {
            Pose::from_parts(Translation3::from(position), UnitQuaternion::from_scaled_axis(Vector3::from(turn)))
        };
        let poses = [
            pose([0.0; 3], [0.0; 3]),
            pose([0.01, -0.02, 0.015], [0.02, -0.01, 0.03]),
            pose([0.022, -0.037, 0.034], [0.045, -0.012, 0.065]),
        ];
        let [before, after] = [(0, 1), (1, 2)].map(|(from, to)| Increment::between(&poses[from], &poses[to]).unwrap());
        let (body, step_s) = (body_d(), 0.05);
        let impulse = momentum_at_start(&body, &after, step_s) - momentum_at_end(&body, &before, step_s);
        let golden = SVector::from([
            4.040_765_412_799_70,
            6.597_377_976_030_21,
            7.206_264_355_677_76,
            4.012_162_262_552_47,
            5.660_215_866_213_14,
            8.044_867_294_849_80,
        ]);
        assert!((impulse.to_vector() / step_s - golden).amax() < 1e-11, "{:?}", impulse.to_vector() / step_s);
    }

    #[test]
    fn discrete_momenta_are_one_spatial_momentum() {
        let body = body_d();
        let start = Pose::from_parts(
            Translation3::new(3.0, -2.0, 1.0),
            UnitQuaternion::from_scaled_axis(Vector3::new(0.4, -0.7, 0.2)),
        );
        let increment = Increment::try_new(Vector3::new(0.1, -0.2, 0.15), Vector3::new(0.05, 0.2, -0.1)).unwrap();
        let at_start = discrete_spatial_momentum(&body, &start, &increment, 0.1).to_vector();
        let at_end = momentum_at_end(&body, &increment, 0.1).transformed_by(&increment.step(&start)).to_vector();
        assert!((at_start - at_end).amax() < 1e-13 * at_start.amax(), "{at_start:?} {at_end:?}");
    }

    #[test]
    fn energy_momentum_and_spatial_inertia_agree() {
        let body = body_d();
        let twist = Twist::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.7, -0.3, 0.2));
        let momentum = body_momentum(&body, &twist);
        let by_matrix = body.spatial_inertia() * twist.to_vector();
        assert!((momentum.to_vector() - by_matrix).amax() < 1e-15);
        assert!((kinetic_energy(&body, &twist) - 0.5 * twist.to_vector().dot(&by_matrix)).abs() < 1e-15);
        assert!((twist_of_momentum(&body, &momentum).to_vector() - twist.to_vector()).amax() < 1e-15);
        // half the squared speed of every particle: the centre of mass and the turn about it
        let velocity_com = twist.linear + twist.angular.cross(&body.center_of_mass());
        let turning = twist.angular.dot(&(body.inertia_about_com() * twist.angular));
        let expected = 0.5 * (body.mass * velocity_com.norm_squared() + turning);
        assert!((kinetic_energy(&body, &twist) - expected).abs() < 1e-15);
    }
}
