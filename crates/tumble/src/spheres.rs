//! A satellite like SPHERES, the robot before Astrobee: twelve cold-gas thrusters that are open or closed.
//!
//! Thesis appendix B describes it without numbers. Mass, thrust and lever are those of its flight software (the constants
//! of `spheres_physical_ISS.c`, published with the smartphone variant); there the rotational acceleration of one thruster
//! gives the inertia. The layout is ours: pairs with the public number of thrusters and the flown lever.

use tumble_dynamics::nalgebra::{Matrix3, UnitVector3, Vector3};
use tumble_dynamics::{DynamicsError, InertialParameters, PulseTiming, PulsedThrusters, Thruster, ThrusterSet};
use tumble_identification::recursive::{ErringThruster, THRUSTERS};

/// Mass of the satellite with half its propellant, without smartphone and its batteries, kg.
pub const MASS_KG: f64 = 4.3;
/// Thrust of an open thruster, N.
pub const THRUST_N: f64 = 0.112;
/// Distance of each line of thrust from the centre, m.
pub const LEVER_M: f64 = 0.0965;
/// Angular acceleration that one thruster gives, rad/s^2.
pub const ANGULAR_ACCELERATION_RAD_S2: f64 = 0.48;
/// How the valves are timed here: 1 ms ticks, pulses of 10 ms at least, a control period of 0.2 s. These are assumed.
pub const TIMING: PulseTiming = PulseTiming { ticks_per_period: 200, shortest_ticks: 10 };
/// Control period that [`TIMING`] divides, s.
pub const CONTROL_PERIOD_S: f64 = 0.2;

/// Ticks of the valves in a control period of 0.016 s of the simulator.
pub const TICKS_PER_FLIGHT_STEP: u32 = 16;

/// The satellite: the same moment of inertia about all axes, thrust times lever over angular acceleration.
pub fn body() -> InertialParameters<f64> {
    let inertia = THRUST_N * LEVER_M / ANGULAR_ACCELERATION_RAD_S2;
    InertialParameters::about_com(MASS_KG, Vector3::zeros(), Matrix3::from_diagonal_element(inertia))
}

/// Four thrusters for each axis: two push along it and two against it, one of each at either end of a lever.
///
/// Both of a pair push, one turns as well: x and torque about y, y and torque about z, z and torque about x.
/// # Errors
/// None with these numbers.
pub fn thrusters() -> Result<PulsedThrusters<12>, DynamicsError> {
    let thrusters = core::array::from_fn(|i| {
        let (axis, end, sense) = (i / 4, if i % 2 == 0 { 1.0 } else { -1.0 }, if i % 4 < 2 { 1.0 } else { -1.0 });
        let along = |axis: usize, size: f64| Vector3::from_fn(|row, _| if row == axis % 3 { size } else { 0.0 });
        Thruster {
            // the lever on the axis before: z for x, so that x pushed at +z turns about +y
            position_body: along(axis + 2, end * LEVER_M),
            direction_body: UnitVector3::new_unchecked(along(axis, sense)),
            largest_thrust_n: THRUST_N,
        }
    });
    Ok(PulsedThrusters { thrusters: ThrusterSet::try_new(thrusters)?, timing: TIMING })
}

/// What the thrust of an open thruster is off by, one standard deviation, as a share; assumed.
pub const THRUST_SIGMA: f64 = 0.01;

/// What an estimator in flight is told of the thrusters, in their order: those of one end of a lever cancel.
///
/// # Errors
/// None with these numbers.
pub fn erring_thrusters() -> Result<[ErringThruster; THRUSTERS], DynamicsError> {
    let set = thrusters()?.thrusters;
    Ok(core::array::from_fn(|i| {
        let thruster = &set.thrusters()[i];
        let push = thruster.wrench_body().to_vector() / thruster.largest_thrust_n;
        ErringThruster { push_body: push.into(), relative: THRUST_SIGMA, group: 2 * (i / 4) + i % 2, supply: 0 }
    }))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use tumble_dynamics::Actuation;
    use tumble_dynamics::laws::check_actuation;
    use tumble_dynamics::lie::Wrench;
    use tumble_dynamics::nalgebra::Vector6;
    use tumble_dynamics::strategies::{draws, wrenches};

    #[test]
    fn one_thruster_accelerates_as_flown() {
        // spheres_physical_ISS.c: 0.026 m/s^2 and 0.48 rad/s^2
        let one = thrusters().unwrap().thrusters.thrusters()[0].wrench_body();
        assert!((one.force - Vector3::new(0.112, 0.0, 0.0)).amax() < 1e-15);
        assert!((one.torque - Vector3::new(0.0, 0.010_808, 0.0)).amax() < 1e-15);
        assert!((one.force.x / body().mass - 0.026).abs() < 5e-4);
        assert!((one.torque.y / body().inertia_about_com()[(1, 1)] - 0.48).abs() < 1e-12);
    }

    #[test]
    fn each_pair_shares_push_and_turn_with_least_gas() {
        // by hand: thrusters at +z and -z give (f + m) / 2 and (f - m) / 2, m = torque over lever; the other sense rests
        let set = thrusters().unwrap().thrusters;
        for wrench in draws(&wrenches(0.01, 0.1), 1, 300) {
            let thrusts = set.allocate(&wrench).unwrap();
            let turn = [wrench.torque.y, wrench.torque.z, wrench.torque.x].map(|torque| torque / LEVER_M);
            for axis in 0..3 {
                let shares = [1.0, -1.0].map(|end| f64::midpoint(wrench.force[axis], end * turn[axis]));
                for (end, share) in shares.into_iter().enumerate() {
                    assert!((thrusts[4 * axis + end] - share.max(0.0)).abs() < 1e-14, "{wrench:?}: {thrusts}");
                    assert!((thrusts[4 * axis + 2 + end] - (-share).max(0.0)).abs() < 1e-14, "{wrench:?}: {thrusts}");
                }
            }
        }
    }

    #[test]
    fn those_that_err_push_as_the_thrusters_do_and_cancel_within_a_group() {
        let erring = erring_thrusters().unwrap();
        let one = thrusters().unwrap().thrusters.thrusters()[6].wrench_body();
        assert!((erring[6].push_body.force * THRUST_N - one.force).amax() < 1e-15);
        assert!((erring[6].push_body.torque * THRUST_N - one.torque).amax() < 1e-15);
        for group in 0..6 {
            let pushes = erring.iter().filter(|thruster| thruster.group == group);
            assert_eq!(pushes.clone().count(), 2);
            assert!(pushes.map(|thruster| thruster.push_body.to_vector()).sum::<Vector6<f64>>().amax() < 1e-15);
        }
    }

    #[test]
    fn its_pulses_obey_the_laws_within_a_tick() {
        let valves = thrusters().unwrap();
        // two thrusters share a component, each off by half the shortest pulse at most
        let quantum = THRUST_N * f64::from(TIMING.shortest_ticks) / f64::from(TIMING.ticks_per_period);
        let excess = |command: &[u32; 12], realized: &Wrench<f64>| {
            let pulses = command.iter().all(|&ticks| ticks == 0 || (10..=200).contains(&ticks));
            let over = (realized.force.amax() - 2.0 * THRUST_N).max(realized.torque.amax() - 2.0 * THRUST_N * LEVER_M);
            if pulses { over } else { f64::INFINITY }
        };
        let inside = draws(&wrenches(0.01, 0.1), 2, 200);
        let wanted = draws(&wrenches(0.1, 1.0), 3, 200);
        let commands = [[0; 12], [1; 12], [7; 12], [u32::MAX; 12], [200, 0, 3, 0, 9, 0, 0, 50, 60, 70, 80, 90]];
        check_actuation(&valves, &inside, &wanted, &commands, &excess, quantum).unwrap();
        // whole ticks of at least the shortest pulse come back exactly
        let command = [20, 0, 0, 33, 0, 47, 199, 0, 200, 10, 0, 0];
        assert_eq!(valves.allocate(&valves.realize(&command)).unwrap(), command);
    }
}
