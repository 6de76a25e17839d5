//! Tutorial: bring your own integrator and find out what it keeps.
//!
//! Implement [`Integrator`] for the system you step, generic over the scalar if you can: then the law of symplecticity
//! differentiates your step exactly. Run the laws of `tumble_dynamics::laws` that your method claims to obey; a
//! violation names the law, the inputs and the size of the error.

use proptest::prelude::*;
use tumble_dynamics::laws::{
    check_equivariance, check_order, check_parametric_model, check_reversible, check_symplectic, check_units,
    step_samples,
};
use tumble_dynamics::lie::{Manifold, Pose, Scalar, Wrench, real};
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{
    DynamicsError, FreeFlyer, FreeFlyerIntegrator, FreeFlyerStep, Integrator, MechanicalSystem, RigidBodyState,
};

/// Half a step with the slope at the start, a full step with the slope there.
struct ExplicitMidpoint;

impl<T: Scalar> Integrator<FreeFlyer<T>> for ExplicitMidpoint {
    fn order(&self) -> u32 {
        2
    }
    fn step(
        &self,
        system: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench_body: &Wrench<T>,
        time_s: T,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        let half_s = step_s * real(0.5);
        let slope = system.vector_field(time_s, state, wrench_body)?;
        let middle = state.oplus(&(slope * half_s));
        Ok(state.oplus(&(system.vector_field(time_s + half_s, &middle, wrench_body)? * step_s)))
    }
}

// One line more, and filters and local planners step and differentiate with it.
impl FreeFlyerIntegrator for ExplicitMidpoint {
    fn step_free<T: Scalar>(
        &self,
        body: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench_body: &Wrench<T>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        self.step(body, state, wrench_body, T::zero(), step_s)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn it_converges_and_does_not_depend_on_frame_or_units(sample in step_samples()) {
        let system = FreeFlyer::new(sample.body);
        check_order(&ExplicitMidpoint, &system, &sample.state, &sample.wrench_body, 0.02, 32, 0.2).unwrap();
        let displacement = Pose::new(Vector3::new(1.0, -2.0, 3.0), Vector3::new(0.4, 0.2, -0.9));
        check_equivariance(&ExplicitMidpoint, &[(sample, displacement)], 1e-12).unwrap();
        check_units(&ExplicitMidpoint, &[sample], 1e-10).unwrap();
        check_parametric_model(&FreeFlyerStep(ExplicitMidpoint), &sample.to_model_sample(), 1e-9).unwrap();
    }

    #[test]
    fn it_is_neither_symplectic_nor_symmetric(sample in step_samples()) {
        // long steps: the defect of a second-order method falls with the cube of the step
        let sample = tumble_dynamics::laws::StepSample { step_s: 0.1, ..sample };
        prop_assert_eq!(check_symplectic(&ExplicitMidpoint, &[sample], 1e-10).unwrap_err().law, "symplectic");
        prop_assert_eq!(check_reversible(&ExplicitMidpoint, &[sample], 1e-11).unwrap_err().law, "time reversal");
    }
}
