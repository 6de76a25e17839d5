//! Space CoBot, the free-flyer of thesis chapter 4: the robot that is meant where none is named.

use tumble_dynamics::nalgebra::{Matrix3, UnitVector3, Vector3};
use tumble_dynamics::{DynamicsError, InertialParameters, Rotor, RotorSet, WrenchBox};
use tumble_identification::recursive::{ErringThruster, THRUSTERS};

/// Its body without payload.
///
/// # Source
/// Thesis 4.5.
pub fn body() -> InertialParameters<f64> {
    let inertia = Matrix3::from_diagonal(&Vector3::new(0.0453, 0.0417, 0.0519));
    InertialParameters::about_com(6.047, Vector3::zeros(), inertia)
}

/// The largest force along each axis that is assumed of it, N.
///
/// # Deviation
/// Thesis 4.5 has limits and does not state them. These let a laden robot follow motions of 0.4 m/s^2 along all axes.
pub const FORCE_LIMIT_N: f64 = 6.0;
/// The largest torque about each axis that is assumed of it, N m; not the thesis's either.
pub const TORQUE_LIMIT_N_M: f64 = 0.5;

/// The same limits on all axes.
pub fn wrench_box(force_limit_n: f64, torque_limit_n_m: f64) -> WrenchBox {
    WrenchBox { torque_limit: Vector3::repeat(torque_limit_n_m), force_limit: Vector3::repeat(force_limit_n) }
}

/// Distance of each rotor from the centre, m.
///
/// # Deviation
/// The published design (Roque and Ventura 2016, arXiv:1602.03573) has six tilted rotors around the body; arm, thrust, drag
/// and speed here are ours, large enough for [`FORCE_LIMIT_N`] or [`TORQUE_LIMIT_N_M`] about any one axis.
pub const ROTOR_ARM_M: f64 = 0.2;
/// Largest thrust of a rotor, N; ours.
pub const ROTOR_THRUST_N: f64 = 2.5;
/// Speed at that thrust, rad/s; ours.
pub const ROTOR_SPEED_RAD_S: f64 = 1500.0;
/// Drag torque of a rotor over its thrust, m; ours.
pub const ROTOR_DRAG_M: f64 = 0.01;

/// What the thrust of a rotor is off by, one standard deviation, as a share; assumed.
pub const THRUST_SIGMA: f64 = 0.01;

/// Six rotors, 60 degrees apart, tilted about their arms to alternate sides and turning alternate ways.
///
/// The tilt of `atan(sqrt 2)`, 54.7 degrees, makes the sum of squared efforts for a force the same in all directions.
/// # Frame
/// Body axes, rotors in the x-y plane.
/// # Errors
/// None with these numbers.
pub fn rotors() -> Result<RotorSet<6>, DynamicsError> {
    let third = libm::sqrt(1.0 / 3.0);
    let thrust_coefficient = ROTOR_THRUST_N / (ROTOR_SPEED_RAD_S * ROTOR_SPEED_RAD_S);
    // cosine and sine of the arms, whole turns of 60 degrees
    let half_root = libm::sqrt(3.0) / 2.0;
    let arms = [(1.0, 0.0), (0.5, half_root), (-0.5, half_root), (-1.0, 0.0), (-0.5, -half_root), (0.5, -half_root)];
    RotorSet::try_new(core::array::from_fn(|i| {
        let ((x, y), side) = (arms[i], if i % 2 == 0 { 1.0 } else { -1.0 });
        let tilt = libm::sqrt(2.0) * third * side;
        Rotor {
            position_body: Vector3::new(x, y, 0.0) * ROTOR_ARM_M,
            axis_body: UnitVector3::new_normalize(Vector3::new(-y * tilt, x * tilt, third)),
            thrust_coefficient,
            drag_coefficient: side * ROTOR_DRAG_M * thrust_coefficient,
            largest_speed_rad_s: ROTOR_SPEED_RAD_S,
        }
    }))
}

/// What an estimator in flight is told of the rotors: each turns either way, and its thrust is a hundredth off.
///
/// # Errors
/// None with these numbers.
pub fn erring_rotors() -> Result<[ErringThruster; THRUSTERS], DynamicsError> {
    let mut erring = [ErringThruster::NONE; THRUSTERS];
    for (group, (erring, rotor)) in erring.iter_mut().zip(rotors()?.rotors()).enumerate() {
        let push = rotor.wrench_body().to_vector() / ROTOR_THRUST_N;
        *erring = ErringThruster { push_body: push.into(), relative: THRUST_SIGMA, group, supply: group };
    }
    Ok(erring)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use tumble_dynamics::Actuation;
    use tumble_dynamics::lie::Wrench;
    use tumble_dynamics::nalgebra::Vector6;

    fn efforts(wrench: Vector6<f64>) -> Vector6<f64> {
        rotors().unwrap().allocate(&Wrench::from(wrench)).unwrap().map(|speed| {
            let part = speed / ROTOR_SPEED_RAD_S;
            part * part.abs()
        })
    }

    #[test]
    fn force_costs_the_same_in_all_directions() {
        // by hand: efforts of f / (6 F cos tilt) along z, six of them; sum of squares f^2 / (6 F^2 cos^2), cos^2 = 1/3
        let expected = 9.0 / (2.0 * ROTOR_THRUST_N * ROTOR_THRUST_N);
        for force in [Vector3::x(), Vector3::y(), Vector3::z(), Vector3::new(0.48, -0.6, 0.64)] {
            let wrench = Wrench::new(Vector3::zeros(), force * 3.0);
            let cost = efforts(wrench.to_vector()).norm_squared();
            assert!((cost - expected).abs() < 1e-12, "{force}: {cost}");
        }
    }

    #[test]
    fn rotors_that_err_make_what_the_rotors_make() {
        let (set, erring) = (rotors().unwrap(), erring_rotors().unwrap());
        let speeds = Vector6::from_fn(|i, _| ROTOR_SPEED_RAD_S * [1.0, -0.5, 0.2, -0.9, 0.4, 0.7][i]);
        let of_each = erring.iter().zip(speeds.iter()).map(|(rotor, speed)| {
            let part = speed / ROTOR_SPEED_RAD_S;
            rotor.push_body.to_vector() * (ROTOR_THRUST_N * part * part.abs())
        });
        assert!((of_each.sum::<Vector6<f64>>() - set.realize(&speeds).to_vector()).amax() < 1e-12);
    }

    #[test]
    fn each_assumed_limit_is_within_reach() {
        for axis in 0..6 {
            let size = if axis < 3 { TORQUE_LIMIT_N_M } else { FORCE_LIMIT_N };
            let wanted = Vector6::from_fn(|row, _| if row == axis { size } else { 0.0 });
            let rotors = rotors().unwrap();
            let given = rotors.realize(&rotors.allocate(&Wrench::from(wanted)).unwrap()).to_vector();
            assert!((given - wanted).amax() < 1e-12, "{given}");
        }
    }
}
