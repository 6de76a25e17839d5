//! Every law of integrators catches, by name, an integrator that breaks it.

use tumble_dynamics::laws::*;
use tumble_dynamics::lie::{Increment, LieGroup, Manifold, Pose, Scalar, Twist, Wrench, from_xyzw, real, value};
use tumble_dynamics::nalgebra::{Isometry3, Quaternion, SVector, Translation3, UnitQuaternion, Vector3, Vector6};
use tumble_dynamics::strategies::body_d;
use tumble_dynamics::*;

fn sample() -> StepSample {
    StepSample {
        body: body_d(),
        state: RigidBodyState {
            world_from_body: Pose::from_parts(
                Translation3::new(0.3, -1.0, 2.0),
                from_xyzw(0.2, -0.4, 0.4, 0.8, 1e-12).unwrap(),
            ),
            twist_body: Twist::new(Vector3::new(1.5, 0.8, -0.6), Vector3::new(0.3, -0.2, 0.4)),
        },
        wrench_body: Wrench::new(Vector3::new(0.4, -0.3, 0.5), Vector3::new(1.0, 0.6, -0.8)),
        step_s: 0.1,
    }
}

#[track_caller]
fn assert_breaks(law: &str, result: Result<(), LawViolation>) {
    assert_eq!(result.expect_err("the defect went unnoticed").law, law);
}

fn order(integrator: &impl Integrator<FreeFlyer<f64>>) -> Result<(), LawViolation> {
    let StepSample { body, state, wrench_body, .. } = sample();
    check_order(integrator, &FreeFlyer::new(body), &state, &wrench_body, 0.05, 32, 0.2)
}

/// An integrator of a free body, written once for every scalar.
trait Planted {
    const ORDER: u32 = 2;
    fn step<T: Scalar>(
        body: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench: &Wrench<T>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError>;
}
struct Defect<D>(D);
impl<T: Scalar, D: Planted> Integrator<FreeFlyer<T>> for Defect<D> {
    fn order(&self) -> u32 {
        D::ORDER
    }
    fn step(
        &self,
        body: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench: &Wrench<T>,
        _time_s: T,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        D::step(body, state, wrench, step_s)
    }
}

fn twist_rate<T: Scalar>(body: &FreeFlyer<T>, state: &RigidBodyState<T>, wrench: &Wrench<T>) -> Twist<T> {
    body.forward(&state.twist_body, wrench).twist_rate_body(&state.twist_body)
}

/// New velocity first, then the pose with it: symplectic for constant mass matrices in vector spaces, not here.
struct SemiImplicitEuler;
impl Planted for SemiImplicitEuler {
    const ORDER: u32 = 1;
    fn step<T: Scalar>(
        body: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench: &Wrench<T>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        let twist_body = state.twist_body + twist_rate(body, state, wrench) * step_s;
        Ok(RigidBodyState {
            world_from_body: state.world_from_body.oplus(&(twist_body * step_s).to_vector()),
            twist_body,
        })
    }
}

/// The increment with this momentum at its start.
fn increment_from<T: Scalar>(
    body: &InertialParameters<T>,
    momentum: impl Fn(&Increment<T>) -> Wrench<T>,
    wanted: &dyn Fn(&Increment<T>) -> Wrench<T>,
    step_s: T,
) -> Result<Increment<T>, DynamicsError> {
    let mut increment = Increment::try_from_vector(&Vector6::zeros())?;
    for _ in 0..60 {
        let correction = twist_of_momentum(body, &(wanted(&increment) - momentum(&increment)));
        let coordinates = increment.to_vector() + (correction * (step_s * real(0.5))).to_vector();
        increment = Increment::try_from_vector(&coordinates)?;
    }
    Ok(increment)
}

/// The integrator with (5.18) as printed: the root under `Psi_{k-1}.Phi_{k-1}` carries the index k.
struct PrintedSecondRoot;
impl Planted for PrintedSecondRoot {
    fn step<T: Scalar>(
        flyer: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        _wrench: &Wrench<T>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        let body = flyer.parameters();
        let momentum = body_momentum(body, &state.twist_body);
        let before = increment_from(body, |f| momentum_at_end(body, f, step_s), &|_| momentum, step_s)?;
        let scalar = before.phi().dot(&before.psi());
        let x = body_momentum(body, &Twist::from(before.to_vector())).force;
        let printed = |f: &Increment<T>| {
            // f_b0 of k-1 over the root of k instead of its own
            let misprint = x * ((scalar / before.f_a0() - scalar / f.f_a0()) * real::<T>(2.0) / step_s);
            momentum + Wrench::new(misprint, Vector3::zeros())
        };
        let increment = increment_from(body, |f| momentum_at_start(body, f, step_s), &printed, step_s)?;
        Ok(RigidBodyState {
            world_from_body: increment.step(&state.world_from_body),
            twist_body: twist_of_momentum(body, &momentum_at_end(body, &increment, step_s)),
        })
    }
}

#[test]
fn runge_kutta_is_not_symplectic() {
    assert_breaks("symplectic", check_symplectic(&RungeKutta4, &[sample()], 1e-10));
    assert_breaks("momentum map", check_momentum_map(&RungeKutta4, &[sample()], 1000, 1e-10));
    assert_breaks("energy without trend", check_energy(&RungeKutta4, &[sample()], 10_000, 1e-12));
}

#[test]
fn semi_implicit_euler_is_not_symplectic() {
    assert_breaks("symplectic", check_symplectic(&Defect(SemiImplicitEuler), &[sample()], 1e-10));
    assert_breaks("momentum map", check_momentum_map(&Defect(SemiImplicitEuler), &[sample()], 10, 1e-10));
    let short = StepSample { step_s: 1e-3, ..sample() };
    assert_breaks("energy without trend", check_energy(&Defect(SemiImplicitEuler), &[short], 10_000, 1e-12));
}

#[test]
fn the_printed_root_is_not_symplectic() {
    assert_breaks("symplectic", check_symplectic(&Defect(PrintedSecondRoot), &[sample()], 1e-10));
    assert_breaks("momentum map", check_momentum_map(&Defect(PrintedSecondRoot), &[sample()], 10, 1e-10));
}

/// Exponential of the mean of the velocities at both ends, momentum carried over exactly: symmetric, of order two, keeps
/// the momentum, and yet no discrete Lagrangian stands behind it.
struct MeanVelocity;
impl Planted for MeanVelocity {
    fn step<T: Scalar>(
        flyer: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench: &Wrench<T>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        let body = flyer.parameters();
        let half_impulse = *wrench * (step_s * real(0.5));
        let momentum = body_momentum(body, &state.twist_body) + half_impulse;
        let before = twist_of_momentum(body, &momentum);
        let (mut after, mut increment) = (before, Pose::identity());
        for _ in 0..60 {
            increment = <Pose<T> as LieGroup>::exp(&((before + after) * (step_s * real(0.5))).to_vector());
            after = twist_of_momentum(body, &momentum.transformed_by(&increment.inverse()));
        }
        Ok(RigidBodyState {
            world_from_body: state.world_from_body * increment,
            twist_body: after + twist_of_momentum(body, &half_impulse),
        })
    }
}

#[test]
fn a_symmetric_step_that_keeps_the_momentum_is_unmasked_by_symplecticity_alone() {
    let (defect, samples) = (Defect(MeanVelocity), [sample()]);
    let displacement = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.3, 0.2, -0.4));
    check_momentum_map(&defect, &samples, 100, 1e-12).unwrap();
    check_reversible(&defect, &samples, 1e-11).unwrap();
    check_equivariance(&defect, &[(sample(), displacement)], 1e-12).unwrap();
    check_stays_on_group(&defect, &samples, 100, 1e-12).unwrap();
    check_units(&defect, &samples, 1e-10).unwrap();
    order(&defect).unwrap();
    assert_breaks("symplectic", check_symplectic(&defect, &samples, 1e-10));
}

/// The increment multiplies the pose from the left.
struct LeftForRight;
impl Planted for LeftForRight {
    fn step<T: Scalar>(
        body: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench: &Wrench<T>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        let end = VariationalFreeFlyer.step(body, state, wrench, T::zero(), step_s)?;
        let increment = state.world_from_body.between(&end.world_from_body);
        Ok(RigidBodyState { world_from_body: increment * state.world_from_body, ..end })
    }
}

#[test]
fn an_increment_on_the_wrong_side_depends_on_the_frame() {
    let displacement = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.3, 0.2, -0.4));
    assert_breaks("left equivariance", check_equivariance(&Defect(LeftForRight), &[(sample(), displacement)], 1e-10));
}

/// The whole impulse at the start of the step.
struct ImpulseFirst;
impl Planted for ImpulseFirst {
    fn step<T: Scalar>(
        flyer: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench: &Wrench<T>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        let body = flyer.parameters();
        let kicked = state.twist_body + twist_of_momentum(body, &(*wrench * step_s));
        variational_step(body, &RigidBodyState { twist_body: kicked, ..*state }, &Wrench::zero(), step_s)
    }
}

#[test]
fn an_impulse_at_one_end_is_of_first_order_and_not_symmetric() {
    assert_breaks("observed order", order(&Defect(ImpulseFirst)));
    assert_breaks("time reversal", check_reversible(&Defect(ImpulseFirst), &[sample()], 1e-10));
}

/// The gyroscopic torque with the wrong sign: converges, to another motion.
struct WrongGyroscopicSign;
impl Planted for WrongGyroscopicSign {
    const ORDER: u32 = 4;
    fn step<T: Scalar>(
        flyer: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench: &Wrench<T>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        let momentum = body_momentum(flyer.parameters(), &state.twist_body).torque;
        let twice = state.twist_body.angular.cross(&momentum) * real::<T>(2.0);
        RungeKutta4.step(flyer, state, &Wrench::new(wrench.torque + twice, wrench.force), T::zero(), step_s)
    }
}

/// The classical method with one exponential of the mean slope, without the correction for the group.
struct MeanSlope;
impl Planted for MeanSlope {
    const ORDER: u32 = 4;
    fn step<T: Scalar>(
        body: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench: &Wrench<T>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        let field = |x: &RigidBodyState<T>| body.vector_field(T::zero(), x, wrench);
        let half: T = real(0.5);
        let k1 = field(state)?;
        let k2 = field(&state.oplus(&(k1 * (step_s * half))))?;
        let k3 = field(&state.oplus(&(k2 * (step_s * half))))?;
        let k4 = field(&state.oplus(&(k3 * step_s)))?;
        Ok(state.oplus(&((k1 + (k2 + k3) * real::<T>(2.0) + k4) * (step_s / real(6.0)))))
    }
}

/// A method that claims more than it reaches.
struct Boasting;
impl Planted for Boasting {
    const ORDER: u32 = 3;
    fn step<T: Scalar>(
        body: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench: &Wrench<T>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        VariationalFreeFlyer.step(body, state, wrench, T::zero(), step_s)
    }
}

#[test]
fn wrong_motions_and_wrong_orders_do_not_converge_as_claimed() {
    assert_breaks("observed order", order(&Defect(WrongGyroscopicSign)));
    assert_breaks("observed order", order(&Defect(MeanSlope)));
    assert_breaks("observed order", order(&Defect(Boasting)));
}

/// Adds the rate of the quaternion and never normalises.
struct UnnormalisedQuaternion;
impl Planted for UnnormalisedQuaternion {
    const ORDER: u32 = 1;
    fn step<T: Scalar>(
        body: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench: &Wrench<T>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        let mut end = LieEuler.step(body, state, wrench, T::zero(), step_s)?;
        let q = state.world_from_body.rotation.into_inner();
        let rate = q * Quaternion::from_imag(state.twist_body.angular) * real::<T>(0.5);
        end.world_from_body.rotation = UnitQuaternion::new_unchecked(q + rate * step_s);
        Ok(end)
    }
}

#[test]
fn an_attitude_without_normalisation_leaves_the_group() {
    assert_breaks("stays on the group", check_stays_on_group(&Defect(UnnormalisedQuaternion), &[sample()], 100, 1e-12));
}

/// The implicit midpoint rule, solved to an absolute tolerance.
struct AbsoluteTolerance;
impl Planted for AbsoluteTolerance {
    fn step<T: Scalar>(
        body: &FreeFlyer<T>,
        state: &RigidBodyState<T>,
        wrench: &Wrench<T>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        let mut slope = body.vector_field(T::zero(), state, wrench)?;
        for _ in 0..100 {
            let next = body.vector_field(T::zero(), &state.oplus(&(slope * (step_s * real(0.5)))), wrench)?;
            let change = (next - slope).norm();
            slope = next;
            if change < real(1e-13) {
                break;
            }
        }
        Ok(state.oplus(&(slope * step_s)))
    }
}

#[test]
fn an_absolute_tolerance_is_found_by_a_change_of_units() {
    check_reversible(&Defect(AbsoluteTolerance), &[sample()], 1e-10).unwrap();
    assert_breaks("units", check_units(&Defect(AbsoluteTolerance), &[sample()], 1e-10));
}

/// A step that cuts the derivatives of some of its arguments.
#[derive(Debug)]
struct Cut {
    state: bool,
    input: bool,
    parameters: bool,
}
impl ParametricModel for Cut {
    type State<T: Scalar> = RigidBodyState<T>;
    type Input<T: Scalar> = Vector6<T>;
    type Parameters<T: Scalar> = SVector<T, PARAMETERS>;
    fn lift<T: Scalar>(state: &RigidBodyState<f64>) -> RigidBodyState<T> {
        state.lifted()
    }
    fn step<T: Scalar>(
        &self,
        state: &RigidBodyState<T>,
        wrench: &Vector6<T>,
        parameters: &SVector<T, PARAMETERS>,
        step_s: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        let cut = |x: T| real::<T>(value(x));
        let twist = state.twist_body.to_vector();
        let state = RigidBodyState { twist_body: if self.state { twist.map(cut) } else { twist }.into(), ..*state };
        let wrench = if self.input { wrench.map(cut) } else { *wrench };
        let parameters = if self.parameters { parameters.map(cut) } else { *parameters };
        FreeFlyerStep(VariationalFreeFlyer).step(&state, &wrench, &parameters, step_s)
    }
}

#[test]
fn lost_derivatives_differ_from_difference_quotients() {
    let check = |state, input, parameters| {
        check_parametric_model(&Cut { state, input, parameters }, &sample().to_model_sample(), 1e-8)
    };
    check(false, false, false).unwrap();
    assert_breaks("linearisation by state", check(true, false, false));
    assert_breaks("linearisation by input", check(false, true, false));
    assert_breaks("linearisation by parameters", check(false, false, true));
}

/// Gives up.
struct NoValue;
impl Planted for NoValue {
    fn step<T: Scalar>(
        _: &FreeFlyer<T>,
        _: &RigidBodyState<T>,
        _: &Wrench<T>,
        _: T,
    ) -> Result<RigidBodyState<T>, DynamicsError> {
        Err(DynamicsError::NotFinite)
    }
}

#[test]
fn a_step_without_value_is_a_violation() {
    assert_breaks("the step has a value", check_reversible(&Defect(NoValue), &[sample()], 1e-10));
}
