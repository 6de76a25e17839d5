//! The laws of integrators hold for ours, on random bodies, states, wrenches and steps.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use proptest::prelude::*;
use tumble_dynamics::laws::*;
use tumble_dynamics::lie::{LieGroup, Pose};
use tumble_dynamics::nalgebra::Vector6;
use tumble_dynamics::*;

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
