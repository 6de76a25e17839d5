//! The claims of the integrators: golden convergence, observed orders, long runs; the laws on random bodies.

use proptest::prelude::*;
use tumble_dynamics::laws::*;
use tumble_dynamics::lie::{LieGroup, Manifold, Pose, Twist, Wrench};
use tumble_dynamics::nalgebra::{Translation3, UnitQuaternion, Vector3, Vector6};
use tumble_dynamics::strategies::body_d;
use tumble_dynamics::*;

/// Smooth wrench of the golden run.
struct Smooth;
impl WrenchModel<f64> for Smooth {
    fn wrench_body(&self, t: f64, _: &RigidBodyState<f64>) -> Wrench<f64> {
        Wrench::new(
            Vector3::new(0.5 * (1.1 * t).sin(), 0.4 * (0.7 * t + 0.5).sin(), 0.6 * (0.9 * t).cos()),
            Vector3::new((0.8 * t).cos(), 0.8 * (1.3 * t + 0.2).sin(), 1.2 * (0.5 * t + 1.0).sin()),
        )
    }
}

/// State of a body whose centre of mass has the given motion.
fn state_of_com(
    position: Vector3<f64>,
    turn: Vector3<f64>,
    velocity: Vector3<f64>,
    rate: Vector3<f64>,
) -> RigidBodyState<f64> {
    let (attitude, com) = (UnitQuaternion::from_scaled_axis(turn), body_d().center_of_mass());
    RigidBodyState {
        world_from_body: Pose::from_parts(Translation3::from(position - attitude * com), attitude),
        twist_body: Twist::new(rate, attitude.inverse() * velocity - rate.cross(&com)),
    }
}

fn run<S: MechanicalSystem<State = RigidBodyState<f64>, Input = Wrench<f64>>>(
    integrator: &impl Integrator<S>,
    system: &S,
    mut state: RigidBodyState<f64>,
    wrench: &Wrench<f64>,
    step_s: f64,
    steps: u32,
) -> RigidBodyState<f64> {
    for k in 0..steps {
        state = integrator.step(system, &state, wrench, f64::from(k) * step_s, step_s).unwrap();
    }
    state
}

#[test]
fn golden_convergence_of_the_variational_integrator() {
    let start = state_of_com(
        Vector3::new(0.1, 0.2, 0.3),
        Vector3::new(0.3, -0.2, 0.5),
        Vector3::new(0.1, -0.2, 0.05),
        Vector3::new(0.2, -0.3, 0.4),
    );
    let system = FreeFlyerIn { body: FreeFlyer::new(body_d()), environment: Smooth };
    let exact = run(&GaussLegendre4, &system, start, &Wrench::zero(), 0.0025, 2000);
    for (step_s, steps, golden) in
        [(0.1, 50, 8.69e-3), (0.05, 100, 2.155e-3), (0.025, 200, 5.376e-4), (0.0125, 400, 1.343e-4)]
    {
        let end = run(&VariationalFreeFlyer, &system, start, &Wrench::zero(), step_s, steps);
        let error = (end.world_from_body.translation.vector - exact.world_from_body.translation.vector).norm();
        assert!((error / golden - 1.0).abs() < 1e-3, "h = {step_s}: {error:e}, golden {golden:e}");
    }
}

fn observed_order(integrator: &impl Integrator<FreeFlyer<f64>>) -> f64 {
    let system = FreeFlyer::new(body_d());
    let start =
        state_of_com(Vector3::zeros(), Vector3::zeros(), Vector3::new(0.3, -0.2, 0.1), Vector3::new(0.5, 0.8, -0.6));
    let wrench = Wrench::new(Vector3::new(0.4, -0.3, 0.5), Vector3::new(1.0, 0.6, -0.8));
    let ends: Vec<_> = [80_u32, 160, 320]
        .iter()
        .map(|&steps| run(integrator, &system, start, &wrench, 4.0 / f64::from(steps), steps))
        .collect();
    (ends[0].ominus(&ends[1]).norm() / ends[1].ominus(&ends[2]).norm()).log2()
}

#[test]
fn every_integrator_has_its_order() {
    fn check(name: &str, integrator: &impl Integrator<FreeFlyer<f64>>) {
        let (observed, claimed) = (observed_order(integrator), f64::from(integrator.order()));
        assert!((observed - claimed).abs() < 0.2, "{name}: order {observed}, claimed {claimed}");
    }
    check("Lie-Euler", &LieEuler);
    check("Runge-Kutta", &RungeKutta4);
    check("Munthe-Kaas", &MuntheKaas4);
    check("Gauss-Legendre", &GaussLegendre4);
    check("variational, dual quaternions", &VariationalFreeFlyer);
    check("variational, generic", &Variational);
}

/// Drag: the end of the step depends on the velocity there.
#[test]
fn the_variational_step_in_an_environment_is_of_order_two_and_symmetric() {
    let drag = LinearDrag {
        center_of_pressure: Vector3::new(0.1, -0.2, 0.3),
        force_coefficient: 0.8,
        torque_coefficient: 0.3,
        medium_velocity_world: Vector3::new(0.2, 0.1, -0.3),
    };
    let system = FreeFlyerIn { body: FreeFlyer::new(body_d()), environment: drag };
    let start = state_of_com(
        Vector3::zeros(),
        Vector3::new(0.3, -0.2, 0.5),
        Vector3::new(0.3, -0.2, 0.1),
        Vector3::new(0.5, 0.8, -0.6),
    );
    let wrench = Wrench::new(Vector3::new(0.4, -0.3, 0.5), Vector3::new(1.0, 0.6, -0.8));
    check_order(&VariationalFreeFlyer, &system, &start, &wrench, 0.05, 40, 0.2).unwrap();
    let end = VariationalFreeFlyer.step(&system, &start, &wrench, 0.0, 0.05).unwrap();
    let back = VariationalFreeFlyer.step(&system, &end, &wrench, 0.05, -0.05).unwrap();
    assert!(back.ominus(&start).amax() < 1e-14, "{}", back.ominus(&start));
}

#[test]
fn single_precision_converges_too() {
    let parameters = InertialParameters::<f32>::from_vector(&body_d().to_vector().cast());
    let start = RigidBodyState::<f32> {
        twist_body: Twist::new(Vector3::new(0.5, 0.8, -0.6), Vector3::new(0.1, 0.2, 0.3)),
        ..RigidBodyState::at_rest()
    };
    let double = RigidBodyState::<f64> {
        twist_body: Twist::from(start.twist_body.to_vector().map(f64::from)),
        ..RigidBodyState::at_rest()
    };
    let end = variational_step(&parameters, &start, &Wrench::zero(), 0.05).unwrap();
    let exact = variational_step(&body_d(), &double, &Wrench::zero(), 0.05).unwrap();
    let found = end.world_from_body.translation.vector.map(f64::from);
    assert!((found - exact.world_from_body.translation.vector).amax() < 1e-7);
    assert!((end.twist_body.to_vector().map(f64::from) - exact.twist_body.to_vector()).amax() < 1e-6);
    let implicit = GaussLegendre4.step(&FreeFlyer::new(parameters), &start, &Wrench::zero(), 0.0, 0.05).unwrap();
    assert!((implicit.twist_body - end.twist_body).to_vector().amax() < 1e-3);
}

#[test]
fn all_integrators_converge_to_the_same_motion() {
    let system = FreeFlyer::new(body_d());
    let start =
        state_of_com(Vector3::zeros(), Vector3::zeros(), Vector3::new(0.3, -0.2, 0.1), Vector3::new(0.5, 0.8, -0.6));
    let wrench = Wrench::new(Vector3::new(0.4, -0.3, 0.5), Vector3::new(1.0, 0.6, -0.8));
    let reference = run(&GaussLegendre4, &system, start, &wrench, 0.005, 800);
    for end in
        [run(&RungeKutta4, &system, start, &wrench, 0.005, 800), run(&MuntheKaas4, &system, start, &wrench, 0.005, 800)]
    {
        assert!(end.ominus(&reference).norm() < 1e-8, "{}", end.ominus(&reference).norm());
    }
}

#[test]
fn the_fast_step_equals_the_generic_one() {
    let system = FreeFlyer::new(body_d());
    let wrench = Wrench::new(Vector3::new(0.4, -0.3, 0.5), Vector3::new(1.0, 0.6, -0.8));
    for step_s in [1e-3, 0.01, 0.05, 0.1, 0.4, -0.1] {
        let mut fast = state_of_com(
            Vector3::new(3.0, -2.0, 1.0),
            Vector3::new(0.3, -0.2, 0.5),
            Vector3::new(0.3, -0.2, 0.1),
            Vector3::new(0.5, 0.8, -0.6),
        );
        for _ in 0..5 {
            let generic = Variational.step(&system, &fast, &wrench, 0.0, step_s).unwrap();
            fast = VariationalFreeFlyer.step(&system, &fast, &wrench, 0.0, step_s).unwrap();
            let difference = fast.ominus(&generic).amax();
            assert!(difference < 1e-12, "h = {step_s}: {difference:e}");
        }
    }
}

/// Problem 3 of the frozen benchmarks.
#[test]
fn a_million_steps_keep_momentum_energy_and_norm() {
    let body = body_d();
    let mut state = RigidBodyState {
        twist_body: Twist::new(Vector3::new(0.5, 0.8, -0.6), Vector3::zeros()),
        ..RigidBodyState::at_rest()
    };
    let initial = spatial_momentum(&body, &state);
    let initial_energy_j = kinetic_energy(&body, &state.twist_body);
    let (mut angular_drift, mut linear_drift, mut norm_drift) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mut energy_errors = Vec::new();
    for _ in 0..1000 {
        for _ in 0..1000 {
            state = variational_step(&body, &state, &Wrench::zero(), 0.01).unwrap();
        }
        let now = spatial_momentum(&body, &state);
        angular_drift = angular_drift.max((now.torque - initial.torque).norm() / initial.torque.norm());
        linear_drift = linear_drift.max((now.force - initial.force).norm() / initial.force.norm());
        norm_drift = norm_drift.max((state.world_from_body.rotation.norm() - 1.0).abs());
        energy_errors.push(kinetic_energy(&body, &state.twist_body) / initial_energy_j - 1.0);
    }
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let amplitude = energy_errors.iter().fold(0.0_f64, |a, e| a.max(e.abs()));
    let trend = mean(&energy_errors[500..]) - mean(&energy_errors[..500]);
    println!(
        "angular {angular_drift:e}, linear {linear_drift:e}, norm {norm_drift:e}, energy {amplitude:e}, trend {trend:e}"
    );
    assert!(angular_drift < 1e-9, "{angular_drift:e}");
    assert!(linear_drift < 1e-9, "{linear_drift:e}");
    assert!(norm_drift < 1e-12, "{norm_drift:e}");
    assert!(amplitude < 1e-4, "{amplitude:e}");
    assert!(trend.abs() < 0.1 * amplitude, "{trend:e} of {amplitude:e}");
}

fn poses() -> impl Strategy<Value = Pose<f64>> {
    [-2.0..2.0, -2.0..2.0, -2.0..2.0, -50.0..50.0, -50.0..50.0, -50.0..50.0]
        .prop_map(|xi| <Pose<f64> as LieGroup>::exp(&Vector6::from(xi)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn the_variational_step_is_symplectic(sample in step_samples()) {
        check_symplectic(&VariationalFreeFlyer, &[sample], 1e-10).unwrap();
    }

    #[test]
    fn the_variational_step_keeps_the_spatial_momentum(sample in step_samples()) {
        check_momentum_map(&VariationalFreeFlyer, &[sample], 100, 1e-12).unwrap();
    }

    #[test]
    fn no_step_depends_on_the_inertial_frame(sample in step_samples(), displacement in poses()) {
        let samples = [(sample, displacement)];
        check_equivariance(&VariationalFreeFlyer, &samples, 1e-12).unwrap();
        check_equivariance(&GaussLegendre4, &samples, 1e-12).unwrap();
        check_equivariance(&MuntheKaas4, &samples, 1e-12).unwrap();
        check_equivariance(&RungeKutta4, &samples, 1e-12).unwrap();
        check_equivariance(&LieEuler, &samples, 1e-12).unwrap();
    }

    #[test]
    fn symmetric_steps_are_undone_by_the_step_back(sample in step_samples()) {
        check_reversible(&VariationalFreeFlyer, &[sample], 1e-11).unwrap();
        check_reversible(&GaussLegendre4, &[sample], 1e-11).unwrap();
    }

    #[test]
    fn attitudes_stay_unit(sample in step_samples()) {
        check_stays_on_group(&VariationalFreeFlyer, &[sample], 1000, 1e-12).unwrap();
        check_stays_on_group(&GaussLegendre4, &[sample], 100, 1e-12).unwrap();
        check_stays_on_group(&MuntheKaas4, &[sample], 100, 1e-12).unwrap();
        check_stays_on_group(&RungeKutta4, &[sample], 100, 1e-12).unwrap();
        check_stays_on_group(&LieEuler, &[sample], 100, 1e-12).unwrap();
    }

    #[test]
    fn units_of_measurement_do_not_matter(sample in step_samples()) {
        check_units(&VariationalFreeFlyer, &[sample], 1e-10).unwrap();
        check_units(&GaussLegendre4, &[sample], 1e-10).unwrap();
        check_units(&MuntheKaas4, &[sample], 1e-10).unwrap();
        check_units(&RungeKutta4, &[sample], 1e-10).unwrap();
        check_units(&LieEuler, &[sample], 1e-10).unwrap();
    }

    #[test]
    fn linearisations_equal_difference_quotients(sample in step_samples()) {
        check_parametric_model(&FreeFlyerStep(VariationalFreeFlyer), &sample.to_model_sample(), 1e-9).unwrap();
        check_parametric_model(&FreeFlyerStep(RungeKutta4), &sample.to_model_sample(), 1e-9).unwrap();
        check_parametric_model(&FreeFlyerStep(MuntheKaas4), &sample.to_model_sample(), 1e-9).unwrap();
        check_parametric_model(&FreeFlyerStep(GaussLegendre4), &sample.to_model_sample(), 1e-9).unwrap();
        check_parametric_model(&FreeFlyerStep(LieEuler), &sample.to_model_sample(), 1e-9).unwrap();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn energy_has_no_trend(sample in step_samples()) {
        // many turns: 1e4 steps of 0.05 s
        check_energy(&VariationalFreeFlyer, &[StepSample { step_s: 0.05, ..sample }], 10_000, 1e-12).unwrap();
    }

    #[test]
    fn orders_are_as_claimed(sample in step_samples()) {
        let system = FreeFlyer::new(sample.body);
        let (state, wrench) = (&sample.state, &sample.wrench_body);
        check_order(&LieEuler, &system, state, wrench, 0.01, 32, 0.2).unwrap();
        check_order(&VariationalFreeFlyer, &system, state, wrench, 0.05, 32, 0.2).unwrap();
        check_order(&RungeKutta4, &system, state, wrench, 0.05, 32, 0.2).unwrap();
        check_order(&MuntheKaas4, &system, state, wrench, 0.05, 32, 0.2).unwrap();
        check_order(&GaussLegendre4, &system, state, wrench, 0.05, 32, 0.2).unwrap();
    }
}
