//! Problem 3: a million steps of a torque-free tumble, h = 0.01 s.

use std::time::Instant;

use nalgebra::{Matrix3, Vector3};
use tumble_dynamics::{
    FreeFlyer, GaussLegendre4, Integrator, LieEuler, MuntheKaas4, RigidBodyState, RungeKutta4, VariationalFreeFlyer,
};
use tumble_lie::{Twist, Wrench};

use crate::Failure;
use crate::bench::{Bench, Goal, Row, quantile};
use crate::dynamics::{ch5_body, ch5_mass_matrix};

const PROBLEM: &str = "integrator";
const STEP_S: f64 = 0.01;
/// Steps between two looks at the invariants; the clock runs between looks only.
const BETWEEN_LOOKS: usize = 1000;
const LOOKS: usize = 1000;

pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    let peer = Goal::shown("mujoco-c RK4", 2390.0);
    tumble(bench, "variational", &VariationalFreeFlyer, Goal { target_ns: Some(800.0), ..peer })?;
    tumble(bench, "runge_kutta_4", &RungeKutta4, peer)?;
    tumble(bench, "munthe_kaas_4", &MuntheKaas4, peer)?;
    tumble(bench, "gauss_legendre_4", &GaussLegendre4, peer)?;
    tumble(bench, "lie_euler", &LieEuler, Goal::shown("mujoco-c Euler", 575.0))
}

fn tumble(
    bench: &Bench,
    item: &'static str,
    integrator: &impl Integrator<FreeFlyer<f64>>,
    goal: Goal,
) -> Result<(), Failure> {
    if !bench.wants(PROBLEM, item) {
        return Ok(());
    }
    let calibration_ns = bench.calibrate();
    let flyer = FreeFlyer::new(ch5_body());
    let mut state = RigidBodyState {
        twist_body: Twist::new(Vector3::new(0.5, 0.8, -0.6), Vector3::zeros()),
        ..RigidBodyState::at_rest()
    };
    let start = Invariants::of(&state);
    let (mut worst, mut diverged) = ([0.0_f64; 4], false);
    let mut times = Vec::with_capacity(LOOKS);
    for _ in 0..bench.sweeps.min(LOOKS) {
        let clock = Instant::now();
        for _ in 0..BETWEEN_LOOKS {
            state = integrator
                .step(&flyer, &state, &Wrench::zero(), 0.0, STEP_S)
                .map_err(|error| Failure::TargetMissed(format!("{PROBLEM} {item}: {error}")))?;
        }
        times.push(clock.elapsed().as_nanos() as f64 / BETWEEN_LOOKS as f64);
        let now = Invariants::of(&state);
        for (worst, drift) in worst.iter_mut().zip(now.drift_from(&start)) {
            *worst = worst.max(drift);
        }
        diverged = !now.energy.is_finite() || now.energy > 100.0 * start.energy;
        if diverged {
            break;
        }
    }
    let n = times.len() * BETWEEN_LOOKS;
    times.sort_by(f64::total_cmp);
    let [energy, angular, linear, norm] = worst;
    bench.report(&Row {
        problem: PROBLEM,
        item,
        median_ns: quantile(&times, 0.5),
        p99_ns: quantile(&times, 0.99),
        n,
        quality: vec![
            ("energy_drift", energy),
            ("spatial_angular_momentum_drift", angular),
            ("linear_momentum_drift", linear),
            ("unit_norm_drift", norm),
            ("diverged", f64::from(u8::from(diverged))),
        ],
        goal,
        calibration_ns,
    });
    Ok(())
}

/// What a free body keeps, computed from the four numbers of the quaternion and the mass matrix of this program.
struct Invariants {
    energy: f64,
    /// About the inertial origin.
    angular_momentum: Vector3<f64>,
    linear_momentum: Vector3<f64>,
    quaternion_norm: f64,
}

impl Invariants {
    fn of(state: &RigidBodyState<f64>) -> Self {
        let twist = state.twist_body.to_vector();
        let momentum = ch5_mass_matrix() * twist;
        let [x, y, z, w] = state.world_from_body.rotation.coords.into();
        let rotation = Matrix3::new(
            w * w + x * x - y * y - z * z,
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
            2.0 * (x * y + w * z),
            w * w - x * x + y * y - z * z,
            2.0 * (y * z - w * x),
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            w * w - x * x - y * y + z * z,
        );
        let linear_momentum = rotation * momentum.fixed_rows::<3>(3);
        let about_body_origin = rotation * momentum.fixed_rows::<3>(0);
        Self {
            energy: 0.5 * twist.dot(&momentum),
            angular_momentum: about_body_origin + state.world_from_body.translation.vector.cross(&linear_momentum),
            linear_momentum,
            quaternion_norm: (w * w + x * x + y * y + z * z).sqrt(),
        }
    }

    fn drift_from(&self, start: &Self) -> [f64; 4] {
        [
            (self.energy / start.energy - 1.0).abs(),
            (self.angular_momentum - start.angular_momentum).norm() / start.angular_momentum.norm(),
            (self.linear_momentum - start.linear_momentum).norm() / start.linear_momentum.norm(),
            (self.quaternion_norm - 1.0).abs(),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, UnitQuaternion};

    #[test]
    fn invariants_see_a_turned_and_moved_body() {
        let spin = Twist::new(Vector3::new(0.5, 0.8, -0.6), Vector3::zeros());
        let at_origin = Invariants::of(&RigidBodyState { twist_body: spin, ..RigidBodyState::at_rest() });
        let turn = UnitQuaternion::from_euler_angles(0.3, -0.7, 1.1);
        let moved = Isometry3::from_parts(Vector3::new(1.0, -2.0, 3.0).into(), turn);
        let elsewhere = Invariants::of(&RigidBodyState { world_from_body: moved, twist_body: spin });
        let linear = turn * at_origin.linear_momentum;
        let angular = turn * at_origin.angular_momentum + moved.translation.vector.cross(&linear);
        assert!((elsewhere.energy - at_origin.energy).abs() < 1e-15);
        assert!((elsewhere.linear_momentum - linear).amax() < 1e-14);
        assert!((elsewhere.angular_momentum - angular).amax() < 1e-13);
        assert!(elsewhere.drift_from(&at_origin)[1] > 0.1);
    }
}
