//! The generic variational integrator on four configuration groups.

use tumble_dynamics::laws::{check_order, check_symplectic_lagrangian};
use tumble_dynamics::lie::{Pose, Twist, Wrench};
use tumble_dynamics::nalgebra::{
    Isometry2, Matrix3, Translation, Translation3, UnitQuaternion, Vector1, Vector2, Vector3,
};
use tumble_dynamics::*;

fn oscillator() -> (Oscillator<f64>, GroupState<Translation<f64, 1>>) {
    let start = GroupState { configuration: Translation::from(Vector1::new(1.0)), velocity: Vector1::new(0.3) };
    (Oscillator { mass_kg: 2.0, stiffness_n_per_m: 3.0 }, start)
}

fn planar() -> (PlanarBody<f64>, GroupState<Isometry2<f64>>) {
    let body = PlanarBody { mass: 9.5, center_of_mass: Vector2::new(0.02, -0.03), inertia_about_com: 0.16 };
    let configuration = Isometry2::new(Vector2::new(0.3, -0.2), 0.7);
    (body, GroupState { configuration, velocity: Vector3::new(0.8, 0.1, -0.2) })
}

fn top() -> (PivotedBody<f64>, GroupState<UnitQuaternion<f64>>) {
    let body = PivotedBody {
        inertia_about_pivot: Matrix3::new(1.5, 0.1, 0.2, 0.1, 2.0, 0.3, 0.2, 0.3, 3.0),
        first_moment: Vector3::new(0.25, 0.5, 0.25),
        gravity_world: Vector3::new(0.0, 0.0, -9.81),
    };
    let configuration = UnitQuaternion::from_scaled_axis(Vector3::new(0.5, -0.3, 0.2));
    (body, GroupState { configuration, velocity: Vector3::new(0.5, 0.8, -0.6) })
}

#[test]
fn the_order_is_two_on_every_group() {
    let (system, start) = oscillator();
    check_order(&Variational, &system, &start, &Vector1::new(0.5), 0.1, 30, 0.2).unwrap();
    let (system, start) = planar();
    check_order(
        &Variational,
        &system,
        &start,
        &PlanarWrench { torque: 0.02, force: Vector2::new(0.3, -0.25) },
        0.1,
        30,
        0.2,
    )
    .unwrap();
    let (system, start) = top();
    check_order(&Variational, &system, &start, &Vector3::new(0.3, -0.2, 0.5), 0.05, 30, 0.2).unwrap();
}

#[test]
fn the_step_is_symplectic_on_every_group() {
    for step_s in [0.02, 0.1, 0.2] {
        let (system, start) = oscillator();
        check_symplectic_lagrangian(&Variational, &system, &start, &Vector1::zeros(), step_s, 1e-8).unwrap();
        let (system, start) = planar();
        check_symplectic_lagrangian(
            &Variational,
            &system,
            &start,
            &PlanarWrench { torque: 0.0, force: Vector2::zeros() },
            step_s,
            1e-8,
        )
        .unwrap();
        let (system, start) = top();
        check_symplectic_lagrangian(&Variational, &system, &start, &Vector3::zeros(), step_s, 1e-8).unwrap();
        let body = InertialParameters::about_origin(5.0, Vector3::new(0.05, 0.1, 0.05), system.inertia_about_pivot);
        let start = RigidBodyState {
            world_from_body: Pose::from_parts(Translation3::new(1.0, 2.0, 3.0), start.configuration),
            twist_body: Twist::new(Vector3::new(0.5, 0.8, -0.6), Vector3::new(0.1, -0.2, 0.3)),
        };
        check_symplectic_lagrangian(&Variational, &FreeFlyer::new(body), &start, &Wrench::zero(), step_s, 1e-8)
            .unwrap();
    }
}

#[test]
fn a_turn_beyond_the_chart_is_an_error() {
    let body = InertialParameters::about_origin(5.0, Vector3::new(0.05, 0.1, 0.05), top().0.inertia_about_pivot);
    let start = RigidBodyState {
        twist_body: Twist::new(Vector3::new(30.0, 0.0, 5.0), Vector3::zeros()),
        ..RigidBodyState::at_rest()
    };
    let step = Variational.step(&FreeFlyer::new(body), &start, &Wrench::zero(), 0.0, 0.2);
    assert!(matches!(step, Err(DynamicsError::StepNotConverged { .. })), "{step:?}");
}

#[test]
fn explicit_methods_on_the_top_are_not_symplectic() {
    let (system, start) = top();
    for violation in [
        check_symplectic_lagrangian(&RungeKutta4, &system, &start, &Vector3::zeros(), 0.2, 1e-8),
        check_symplectic_lagrangian(&LieEuler, &system, &start, &Vector3::zeros(), 0.02, 1e-8),
    ] {
        assert_eq!(violation.unwrap_err().law, "symplectic");
    }
}

/// Range of the relative energy error over a run, early and late.
fn energy_ranges<S>(
    integrator: &impl Integrator<S>,
    system: &S,
    mut state: S::State,
    input: &S::Input,
    step_s: f64,
    energy_j: impl Fn(&S::State) -> f64,
) -> (f64, f64)
where
    S: MechanicalSystem<State: lie::Manifold<Scalar = f64>>,
{
    let initial_j = energy_j(&state);
    let mut largest = [0.0_f64; 2];
    for k in 0..20_000 {
        state = integrator.step(system, &state, input, 0.0, step_s).unwrap();
        let part = &mut largest[usize::from(k >= 10_000)];
        *part = part.max((energy_j(&state) / initial_j - 1.0).abs());
    }
    (largest[0], largest[1])
}

/// Figure 2.6: the energy of the oscillator.
#[test]
fn the_variational_oscillator_keeps_its_energy_and_the_explicit_one_gains() {
    let (system, start) = oscillator();
    let energy_j = |state: &GroupState<Translation<f64, 1>>| {
        system.kinetic_energy(state.velocity.x) + system.potential_energy(state.configuration.vector.x)
    };
    let (early, late) = energy_ranges(&Variational, &system, start, &Vector1::zeros(), 0.1, energy_j);
    // a quadratic energy is kept by the midpoint rule up to rounding
    assert!(early.max(late) < 1e-12, "{early:e} {late:e}");
    let (early, late) = energy_ranges(&LieEuler, &system, start, &Vector1::zeros(), 1e-3, energy_j);
    assert!(late > 2.0 * early, "{early:e} {late:e}");
}

#[test]
fn the_variational_top_keeps_its_energy_and_its_momentum_about_the_vertical() {
    let (system, start) = top();
    let energy_j = |state: &GroupState<UnitQuaternion<f64>>| {
        system.kinetic_energy(&state.velocity) + system.potential_energy(&state.configuration)
    };
    let vertical = |state: &GroupState<UnitQuaternion<f64>>| {
        (state.configuration * (system.inertia_about_pivot * state.velocity)).z
    };
    let mut state = start;
    let (mut early, mut late) = (0.0_f64, 0.0_f64);
    for k in 0..4000 {
        state = Variational.step(&system, &state, &Vector3::zeros(), 0.0, 0.02).unwrap();
        let error = (energy_j(&state) / energy_j(&start) - 1.0).abs();
        if k < 2000 {
            early = early.max(error);
        } else {
            late = late.max(error);
        }
        assert!((vertical(&state) - vertical(&start)).abs() < 1e-11);
    }
    assert!(late < 1.2 * early && early < 0.05, "{early:e} {late:e}");
}
