//! Models of filters against their derivatives, and defects that the laws must name.

use tumble_identification::IdentificationError;
use tumble_identification::dynamics::strategies::{draws, states, vectors, wrenches};
use tumble_identification::dynamics::{FreeFlyerStep, InertialParameters, LogCholesky, MuntheKaas4, RigidBodyState};
use tumble_identification::laws::{check_differentiable_model, check_filter_model};
use tumble_identification::lie::laws::LawViolation;
use tumble_identification::lie::{Scalar, Wrench};
use tumble_identification::nalgebra::{Matrix3, SMatrix, SVector, Vector3, Vector4, Vector6};
use tumble_identification::recursive::{
    AccelerationObservation, DifferentiableModel, Differentiated, FilterModel, JointMotion, JointObservation,
    JointState, MotionNoise, PrincipalBody, PrincipalMotion, Shown, StepObservation, WithParameters,
};

fn body() -> InertialParameters<f64> {
    let inertia = Matrix3::new(0.15, 0.01, -0.02, 0.01, 0.14, 0.005, -0.02, 0.005, 0.16);
    InertialParameters::about_com(9.6, Vector3::new(0.02, -0.05, 0.03), inertia)
}

/// Gyroscope and velocity in body axes.
#[derive(Clone, Copy)]
struct Twist;
impl Shown<FreeFlyerStep<MuntheKaas4>, 6> for Twist {
    fn shown<T: Scalar>(&self, state: &RigidBodyState<T>) -> Vector6<T> {
        state.twist_body.to_vector()
    }
}

type Body = Differentiated<FreeFlyerStep<MuntheKaas4>, Twist, 22>;
type BodySample = (WithParameters<RigidBodyState<f64>, 22, 10>, StepObservation<Vector6<f64>, 6>);

fn differentiated() -> Body {
    Differentiated { model: FreeFlyerStep(MuntheKaas4), sensors: Twist, noise_rate: SVector::repeat(1e-6) }
}

fn body_samples() -> Vec<BodySample> {
    let drawn = draws(&(states(), wrenches(0.1, 0.5)), 1, 10);
    let sample = |(state, wrench): (RigidBodyState<f64>, Wrench<f64>)| {
        let observation = StepObservation {
            step_s: 0.1,
            input: wrench.to_vector(),
            measured: state.twist_body.to_vector(),
            standard_deviation: Vector6::new(1e-3, 1e-3, 1e-3, 1e-2, 1e-2, f64::INFINITY),
        };
        (WithParameters { state, parameters: body().to_vector() }, observation)
    };
    drawn.into_iter().map(sample).collect()
}

fn body_sizes() -> SVector<f64, 22> {
    SVector::from_fn(|i, _| {
        [1.0, 1.0, 1.0, 1.0, 1.0, 0.02, 0.001][if i < 12 {
            i / 3
        } else if i < 13 {
            4
        } else {
            5 + usize::from(i > 15)
        }]
    })
}

#[test]
fn any_parametric_step_is_a_model_with_exact_jacobians() {
    check_differentiable_model(&differentiated(), &body_samples(), &body_sizes(), 1e-8).unwrap();
}

#[test]
fn the_principal_body_obeys_the_laws() {
    let samples: Vec<_> = draws(&(vectors(0.5), wrenches(0.1, 1.0)), 2, 20)
        .into_iter()
        .map(|(rate_body, wrench_body)| {
            let observation = AccelerationObservation {
                rate_body,
                wrench_body,
                acceleration_body: Vector6::repeat(0.01),
                standard_deviation: Vector6::repeat(0.01),
            };
            (PrincipalBody::try_new(9.6, Vector3::new(0.25, 0.3, 0.35)).unwrap(), observation)
        })
        .collect();
    let model = PrincipalMotion { drift: Vector4::repeat(1e-6) };
    check_differentiable_model(&model, &samples, &Vector4::repeat(1.0), 1e-8).unwrap();
}

fn joint() -> JointMotion {
    let noise = MotionNoise {
        attitude_rad: 1e-3,
        position_m: 1e-3,
        rate_rad_s: 1e-3,
        velocity_m_s: 1e-3,
        acceleration_m_s2: 1e-2,
        torque_n_m: 1e-3,
        force_n: 1e-2,
        drift: SVector::repeat(1e-4),
    };
    JointMotion { noise, gravity_world: Vector3::new(0.1, -0.2, 0.3) }
}

fn joint_samples() -> Vec<(JointState, JointObservation)> {
    let chart = LogCholesky::try_from_parameters(&body()).unwrap();
    let sample = |(motion, wrench_body): (RigidBodyState<f64>, Wrench<f64>)| {
        let observation = JointObservation {
            step_s: 0.01,
            wrench_body,
            stored_body: Vector3::zeros(),
            world_from_body: Some(motion.world_from_body),
            rate_body: Some(motion.twist_body.angular),
            velocity_origin_world: Some(motion.world_from_body.rotation * motion.twist_body.linear),
            acceleration_origin_body: Some((Vector3::zeros(), wrench_body)),
        };
        (JointState { motion, body: chart }, observation)
    };
    draws(&(states(), wrenches(0.1, 0.5)), 3, 10).into_iter().map(sample).collect()
}

fn joint_sizes() -> SVector<f64, 22> {
    SVector::from_fn(|i, _| if i < 12 { 1.0 } else { 0.1 })
}

#[test]
fn the_joint_model_obeys_the_laws_to_the_order_of_its_step() {
    // linearised at the middle of the step, to second order: (0.02 rad)^2 is left out, and the third order of the step
    check_differentiable_model(&joint(), &joint_samples(), &joint_sizes(), 1e-3).unwrap();
}

/// A model with one part exchanged.
#[derive(Clone, Copy)]
struct Broken {
    predicted: fn(&SMatrix<f64, 22, 22>, &SMatrix<f64, 22, 22>) -> SMatrix<f64, 22, 22>,
    sensitivity: fn(SMatrix<f64, 6, 22>) -> SMatrix<f64, 6, 22>,
    jacobian: fn(SMatrix<f64, 10, 22>) -> SMatrix<f64, 10, 22>,
    noise: fn(SMatrix<f64, 22, 22>) -> SMatrix<f64, 22, 22>,
    fails: bool,
}

impl Default for Broken {
    fn default() -> Self {
        Self { predicted: |found, _| *found, sensitivity: |m| m, jacobian: |m| m, noise: |m| m, fails: false }
    }
}

impl FilterModel<22, 6, 10> for Broken {
    type State = WithParameters<RigidBodyState<f64>, 22, 10>;
    type Observation = StepObservation<Vector6<f64>, 6>;
    fn propagate(&self, at: &Self::State, o: &Self::Observation) -> Result<Self::State, IdentificationError> {
        if self.fails { Err(IdentificationError::NotFinite { row: 0 }) } else { differentiated().propagate(at, o) }
    }
    fn process_noise(&self, at: &Self::State, o: &Self::Observation) -> SMatrix<f64, 22, 22> {
        (self.noise)(differentiated().process_noise(at, o))
    }
    fn residual(&self, at: &Self::State, o: &Self::Observation) -> Vector6<f64> {
        differentiated().residual(at, o)
    }
    fn standard_deviation(&self, o: &Self::Observation) -> Vector6<f64> {
        o.standard_deviation
    }
    fn parameters(&self, at: &Self::State) -> SVector<f64, 10> {
        at.parameters
    }
    fn parameter_jacobian(&self, at: &Self::State) -> SMatrix<f64, 10, 22> {
        (self.jacobian)(FilterModel::<22, 6, 10>::parameter_jacobian(&differentiated(), at))
    }
}

impl DifferentiableModel<22, 6, 10> for Broken {
    fn predicted_covariance(
        &self,
        at: &Self::State,
        o: &Self::Observation,
        covariance: &SMatrix<f64, 22, 22>,
    ) -> SMatrix<f64, 22, 22> {
        (self.predicted)(&differentiated().predicted_covariance(at, o, covariance), covariance)
    }
    fn sensitivity(&self, at: &Self::State, o: &Self::Observation) -> SMatrix<f64, 6, 22> {
        (self.sensitivity)(differentiated().sensitivity(at, o))
    }
}

#[test]
fn wrong_jacobians_are_caught_by_name() {
    let law = |broken: Broken| -> &'static str {
        let outcome: Result<(), LawViolation> =
            check_differentiable_model(&broken, &body_samples(), &body_sizes(), 1e-8);
        outcome.expect_err("the defect goes unnoticed").law
    };
    check_filter_model(&Broken::default(), &body_samples(), &body_sizes(), 1e-8).unwrap();
    let predicted = "the predicted covariance is that of the step";
    let sensitivity = "the sensitivity is the derivative of the residual";
    assert_eq!(law(Broken { fails: true, ..Broken::default() }), "the step has a value");
    // the step forgotten; correlation of motion and parameters forgotten; Q forgotten
    assert_eq!(law(Broken { predicted: |_, before| *before, ..Broken::default() }), predicted);
    let uncorrelated = |found: &SMatrix<f64, 22, 22>, _: &SMatrix<f64, 22, 22>| {
        let mut found = *found;
        found.fixed_view_mut::<12, 10>(0, 12).fill(0.0);
        found.fixed_view_mut::<10, 12>(12, 0).fill(0.0);
        found
    };
    assert_eq!(law(Broken { predicted: uncorrelated, ..Broken::default() }), predicted);
    let certain = |found: &SMatrix<f64, 22, 22>, _: &SMatrix<f64, 22, 22>| found - SMatrix::identity() * 1e-7;
    assert_eq!(law(Broken { predicted: certain, ..Broken::default() }), predicted);
    // the derivative of the residual in place of that of the prediction; a column too far
    assert_eq!(law(Broken { sensitivity: |m| -m, ..Broken::default() }), sensitivity);
    let shifted = |m: SMatrix<f64, 6, 22>| SMatrix::from_fn(|i, j| if j > 0 { m[(i, j - 1)] } else { 0.0 });
    assert_eq!(law(Broken { sensitivity: shifted, ..Broken::default() }), sensitivity);
    let doubled = |m: SMatrix<f64, 10, 22>| m * 2.0;
    assert_eq!(law(Broken { jacobian: doubled, ..Broken::default() }), "the parameter Jacobian is the derivative");
    let negative = |m: SMatrix<f64, 22, 22>| -m;
    assert_eq!(law(Broken { noise: negative, ..Broken::default() }), "process noise is a covariance");
}
