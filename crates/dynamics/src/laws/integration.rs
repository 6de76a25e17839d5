//! Laws of integrators and of models with parameters.

use crate::differentiate::{ParametricModel, StateTangent, linearize};
use crate::discrete_lagrangian::{DiscreteLagrangian, GroupOf, VelocityOf};
use crate::error::DynamicsError;
use crate::free_flyer::FreeFlyer;
use crate::inertia::InertialParameters;
use crate::integrators::GaussLegendre4;
use crate::laws::{LawViolation, require};
use crate::momentum::{body_momentum, kinetic_energy, spatial_momentum};
use crate::parameter_vector::PARAMETERS;
use crate::state::{LagrangianState, RigidBodyState};
use crate::system::{Integrator, MechanicalSystem};
use num_dual::{DualSVec64, HyperDual64};
use proptest::prelude::Strategy;
use std::fmt::Debug;
use tumble_lie::nalgebra::{
    Const, DMatrix, Matrix3, Quaternion, SMatrix, SVector, Translation3, U1, UnitQuaternion, Vector3, Vector6,
};
use tumble_lie::{Coordinates, LieGroup, Manifold, Pose, Twist, Wrench, real};

/// A number with derivatives along the twelve coordinates of a rigid-body state.
pub type StateJet = DualSVec64<12>;

/// One step of a free body: what the laws of integrators are tested on.
#[derive(Clone, Copy, Debug)]
pub struct StepSample {
    /// The body.
    pub body: InertialParameters<f64>,
    /// Start of the step.
    pub state: RigidBodyState<f64>,
    /// Held wrench, body axes.
    pub wrench_body: Wrench<f64>,
    /// Length of the step, s.
    pub step_s: f64,
}

/// Steps of 1 ms to 0.1 s of bodies of 0.1 to 500 kg and 0.05 to 1 m at any attitude, up to 2 rad/s and one body size per
/// second, under wrenches that change these within seconds.
pub fn step_samples() -> impl Strategy<Value = StepSample> + Clone {
    let unit = || -1.0..1.0_f64;
    let vector = move || [unit(), unit(), unit()].prop_map(Vector3::from);
    let body = (-1.0..2.7_f64, -1.3..0.0_f64, [0.05..1.0, 0.05..1.0, 0.05..1.0], vector(), vector());
    let motion = (vector(), vector(), vector(), vector(), vector(), vector(), -3.0..-1.0_f64);
    (body, motion).prop_map(
        |((mass, size, moments, com, axes), (turn, position, rate, velocity, torque, force, step))| {
            let (mass, size) = (10_f64.powf(mass), 10_f64.powf(size));
            let moments = Vector3::from(moments);
            let principal = Matrix3::from_diagonal(&moments.map(|own| moments.sum() - own)) * (mass * size * size);
            let axes = <UnitQuaternion<f64> as LieGroup>::exp(&(axes * 3.0)).to_rotation_matrix().into_inner();
            StepSample {
                body: InertialParameters::about_com(mass, com * size, axes * principal * axes.transpose()),
                state: RigidBodyState {
                    world_from_body: Pose::from_parts(Translation3::from(position * 3.0), LieGroup::exp(&(turn * 3.0))),
                    twist_body: Twist::new(rate * 2.0, velocity * size),
                },
                wrench_body: Wrench::new(torque * (mass * size * size), force * (mass * size)),
                step_s: 10_f64.powf(step),
            }
        },
    )
}

/// The value, or the violation that there is none.
fn valued<T>(inputs: &dyn Debug, result: Result<T, DynamicsError>) -> Result<T, LawViolation> {
    result.map_err(|error| LawViolation {
        law: "the step has a value",
        inputs: format!("{inputs:?}"),
        expected: String::from("a state"),
        found: error.to_string(),
        error: f64::INFINITY,
        tolerance: 0.0,
    })
}

/// Sizes against which differences of states are judged: angle, position, rate, velocity.
///
/// Lengths and rates of the sample itself, so that the laws mean the same in every unit of measurement.
fn relative_difference(found: &RigidBodyState<f64>, expected: &RigidBodyState<f64>, sample: &StepSample) -> f64 {
    let difference = found.ominus(expected);
    let block = |i: usize| difference.fixed_rows::<3>(i).norm();
    let body = &sample.body;
    let size_m = (body.inertia_about_origin.trace() / body.mass).sqrt();
    let step_s = sample.step_s.abs();
    let twist = &sample.state.twist_body;
    let kick = crate::momentum::twist_of_momentum(body, &(sample.wrench_body * step_s));
    let rate = twist.angular.norm() + kick.angular.norm() + twist.linear.norm() / size_m;
    let velocity = twist.linear.norm() + kick.linear.norm() + rate * size_m;
    let position = expected.world_from_body.translation.vector.norm() + size_m + velocity * step_s;
    let ratio = |part: f64, whole: f64| if part == 0.0 { 0.0 } else { part / whole };
    [block(0), ratio(block(3), position), ratio(block(6), rate), ratio(block(9), velocity)]
        .into_iter()
        .fold(0.0, f64::max)
}

/// "symplectic": the step preserves the canonical two-form of the free body.
///
/// With `D` the derivative of a wrench-free step in left-trivialised increments and momenta `(xi, mu)`,
/// `D' Om(mu_1) D = Om(mu_0)`, where `Om((x1, n1), (x2, n2)) = n2.x1 - n1.x2 + mu.[x1, x2]`. `D` is exact (dual
/// numbers). Each entry is judged relative to the sum of the magnitudes of its terms, so that units do not matter.
/// # Errors
/// The first broken law.
pub fn check_symplectic<I>(integrator: &I, samples: &[StepSample], tolerance: f64) -> Result<(), LawViolation>
where
    I: Integrator<FreeFlyer<StateJet>>,
{
    for sample in samples {
        let body = InertialParameters::<StateJet>::from_vector(&sample.body.to_vector().map(real));
        let seed = SVector::<StateJet, 12>::from_fn(|i, _| StateJet::from_re(0.0).derivative_along(i));
        let start = sample.state.lifted::<StateJet>().oplus(&seed);
        let step = integrator.step(&FreeFlyer::new(body), &start, &Wrench::zero(), real(0.0), real(sample.step_s));
        let end = valued(sample, step)?;
        let value = RigidBodyState::<f64> {
            world_from_body: Pose::from_parts(
                Translation3::from(end.world_from_body.translation.vector.map(|x| x.re)),
                UnitQuaternion::new_unchecked(Quaternion::from(end.world_from_body.rotation.coords.map(|x| x.re))),
            ),
            twist_body: Twist::from(end.twist_body.to_vector().map(|x| x.re)),
        };
        let moved = end.ominus(&value.lifted());
        let derivative = SMatrix::<f64, 12, 12>::from_fn(|i, j| moved[i].eps.unwrap_generic(Const::<12>, U1)[j]);
        let before = two_form(&sample.body, &sample.state.twist_body);
        let after = two_form(&sample.body, &value.twist_body);
        let found = derivative.transpose() * after * derivative;
        let size = derivative.abs().transpose() * after.abs() * derivative.abs() + before.abs();
        let error = (found - before).zip_map(&size, |e, s| if e == 0.0 { 0.0 } else { e.abs() / s }).amax();
        require("symplectic", sample, &before, &found, error, tolerance)?;
    }
    Ok(())
}

/// Seeds the derivative of one coordinate.
trait DerivativeAlong {
    fn derivative_along(self, i: usize) -> Self;
}
impl DerivativeAlong for StateJet {
    fn derivative_along(mut self, i: usize) -> Self {
        self.eps = num_dual::Derivative::some(SVector::<f64, 12>::from_fn(|k, _| if k == i { 1.0 } else { 0.0 }));
        self
    }
}

/// `Om` in the coordinates `(xi, twist)`: the momentum part pulled back by the mass matrix.
fn two_form(body: &InertialParameters<f64>, twist_body: &Twist<f64>) -> SMatrix<f64, 12, 12> {
    let momentum = body_momentum(body, twist_body).to_vector();
    let mass = body.spatial_inertia();
    let mut form = SMatrix::<f64, 12, 12>::zeros();
    form.fixed_view_mut::<6, 6>(0, 6).copy_from(&mass);
    form.fixed_view_mut::<6, 6>(6, 0).copy_from(&-mass);
    let unit = |i: usize| Vector6::from_fn(|k, _| if k == i { 1.0 } else { 0.0 });
    for i in 0..6 {
        for j in 0..6 {
            form[(i, j)] = momentum.dot(&<Pose<f64> as LieGroup>::bracket(&unit(i), &unit(j)));
        }
    }
    form
}

/// "symplectic" for the system of any [`DiscreteLagrangian`]; the derivative of the step is a fourth-order difference
/// quotient, so `tolerance` cannot be below about 1e-9 of the largest entry.
///
/// The force must vanish for `input` (a force that is not a potential's is not symplectic).
/// # Errors
/// The first broken law.
pub fn check_symplectic_lagrangian<S, I>(
    integrator: &I,
    system: &S,
    state: &S::State,
    input: &S::Input,
    step_s: f64,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    S: DiscreteLagrangian,
    S: MechanicalSystem<State: LagrangianState<Group = GroupOf<S, f64>, Scalar = f64>>,
    I: Integrator<S>,
{
    let n = <VelocityOf<S, f64> as Coordinates<f64>>::DIM;
    let inputs = (state, step_s);
    let end = valued(&inputs, integrator.step(system, state, input, 0.0, step_s))?;
    let moved = |j: usize, amount: f64| -> Result<Vec<f64>, LawViolation> {
        let unit = |offset: usize| VelocityOf::<S, f64>::from_fn(|i| if i + offset == j { amount } else { 0.0 });
        let configuration = state.configuration().compose(&<GroupOf<S, f64> as LieGroup>::exp(&unit(0)));
        let start = S::State::from_parts(configuration, state.velocity() + unit(n));
        let moved_end = valued(&inputs, integrator.step(system, &start, input, 0.0, step_s))?;
        let xi = LieGroup::log(&end.configuration().between(&moved_end.configuration()));
        let velocity = moved_end.velocity() - end.velocity();
        Ok((0..2 * n).map(|i| if i < n { xi[i] } else { velocity[i - n] }).collect())
    };
    let width = 1e-3;
    let mut derivative = DMatrix::zeros(2 * n, 2 * n);
    for j in 0..2 * n {
        let [a, b, c, d] = [moved(j, -2.0 * width)?, moved(j, -width)?, moved(j, width)?, moved(j, 2.0 * width)?];
        for i in 0..2 * n {
            derivative[(i, j)] = (a[i] - 8.0 * b[i] + 8.0 * c[i] - d[i]) / (12.0 * width);
        }
    }
    let before = lagrangian_two_form(system, &state.configuration(), &state.velocity());
    let after = lagrangian_two_form(system, &end.configuration(), &end.velocity());
    let found = derivative.transpose() * after * &derivative;
    let error = (&found - &before).amax() / before.amax();
    require("symplectic", &inputs, &before, &found, error, tolerance)
}

/// The Lagrangian two-form in the coordinates `(xi, velocity)`.
fn lagrangian_two_form<S: DiscreteLagrangian>(
    system: &S,
    g: &GroupOf<S, f64>,
    velocity: &VelocityOf<S, f64>,
) -> DMatrix<f64> {
    let n = <VelocityOf<S, f64> as Coordinates<f64>>::DIM;
    let jet = |eps1: bool, eps2: bool| HyperDual64::new(0.0, f64::from(u8::from(eps1)), f64::from(u8::from(eps2)), 0.0);
    // d mu_i / d z_j, z = (xi, velocity)
    let rate = |i: usize, j: usize| {
        let xi = VelocityOf::<S, HyperDual64>::from_fn(|k| jet(false, k == j));
        let configuration = S::lift::<HyperDual64>(g).compose(&LieGroup::exp(&xi));
        let v = VelocityOf::<S, HyperDual64>::from_fn(|k| real::<HyperDual64>(velocity[k]) + jet(k == i, k + n == j));
        system.lagrangian(&configuration, &v)
    };
    let momentum: Vec<f64> = (0..n).map(|i| rate(i, 0).eps1).collect();
    let unit = |i: usize| VelocityOf::<S, f64>::from_fn(|k| if k == i { 1.0 } else { 0.0 });
    DMatrix::from_fn(2 * n, 2 * n, |a, b| {
        // n2.x1 - n1.x2 + mu.[x1, x2] with n = (d mu) z
        let first = if a < n { rate(a, b).eps1eps2 } else { 0.0 };
        let second = if b < n { rate(b, a).eps1eps2 } else { 0.0 };
        let bracket = if a < n && b < n {
            let c = <GroupOf<S, f64> as LieGroup>::bracket(&unit(a), &unit(b));
            (0..n).map(|k| momentum[k] * c[k]).sum()
        } else {
            0.0
        };
        first - second + bracket
    })
}

/// "momentum map": `steps` wrench-free steps keep the spatial momentum about the inertial origin.
///
/// Relative to the momentum, the angular one including its moment arm.
/// # Errors
/// The first broken law.
pub fn check_momentum_map<I>(
    integrator: &I,
    samples: &[StepSample],
    steps: u32,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    I: Integrator<FreeFlyer<f64>>,
{
    for sample in samples {
        let expected = spatial_momentum(&sample.body, &sample.state);
        let end = travelled(integrator, sample, &Wrench::zero(), steps)?;
        let found = spatial_momentum(&sample.body, &end);
        let (force, angular) = (expected.force.norm(), expected.torque.norm());
        let arm_m = end.world_from_body.translation.vector.norm();
        let difference = found - expected;
        let error = (difference.torque.norm() / (angular + arm_m * force).max(f64::MIN_POSITIVE))
            .max(difference.force.norm() / force.max(f64::MIN_POSITIVE));
        require("momentum map", sample, &expected, &found, error, tolerance)?;
    }
    Ok(())
}

/// The state after `steps` steps of a sample with another wrench.
fn travelled<I: Integrator<FreeFlyer<f64>>>(
    integrator: &I,
    sample: &StepSample,
    wrench_body: &Wrench<f64>,
    steps: u32,
) -> Result<RigidBodyState<f64>, LawViolation> {
    let system = FreeFlyer::new(sample.body);
    let mut state = sample.state;
    for k in 0..steps {
        let time_s = f64::from(k) * sample.step_s;
        state = valued(sample, integrator.step(&system, &state, wrench_body, time_s, sample.step_s))?;
    }
    Ok(state)
}

/// "left equivariance": nothing depends on where the inertial frame stands, `step(g x) = g step(x)`.
///
/// # Errors
/// The first broken law.
pub fn check_equivariance<I>(
    integrator: &I,
    samples: &[(StepSample, Pose<f64>)],
    tolerance: f64,
) -> Result<(), LawViolation>
where
    I: Integrator<FreeFlyer<f64>>,
{
    for (sample, displacement) in samples {
        let displaced = |state: &RigidBodyState<f64>| RigidBodyState {
            world_from_body: displacement * state.world_from_body,
            ..*state
        };
        let end = travelled(integrator, sample, &sample.wrench_body, 1)?;
        let elsewhere = StepSample { state: displaced(&sample.state), ..*sample };
        let found = travelled(integrator, &elsewhere, &sample.wrench_body, 1)?;
        let expected = displaced(&end);
        let error = relative_difference(&found, &expected, sample);
        require("left equivariance", &(sample, displacement), &expected, &found, error, tolerance)?;
    }
    Ok(())
}

/// "time reversal": a step of `-h` undoes a step of `h` under the same held wrench.
///
/// # Errors
/// The first broken law.
pub fn check_reversible<I>(integrator: &I, samples: &[StepSample], tolerance: f64) -> Result<(), LawViolation>
where
    I: Integrator<FreeFlyer<f64>>,
{
    for sample in samples {
        let end = travelled(integrator, sample, &sample.wrench_body, 1)?;
        let back = StepSample { state: end, step_s: -sample.step_s, ..*sample };
        let found = travelled(integrator, &back, &sample.wrench_body, 1)?;
        let error = relative_difference(&found, &sample.state, sample);
        require("time reversal", sample, &sample.state, &found, error, tolerance)?;
    }
    Ok(())
}

/// "stays on the group": the attitude is a unit quaternion after `steps` wrench-free steps.
///
/// # Errors
/// The first broken law.
pub fn check_stays_on_group<I>(
    integrator: &I,
    samples: &[StepSample],
    steps: u32,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    I: Integrator<FreeFlyer<f64>>,
{
    for sample in samples {
        let end = travelled(integrator, sample, &Wrench::zero(), steps)?;
        let norm = end.world_from_body.rotation.into_inner().norm();
        require("stays on the group", sample, &1.0, &norm, (norm - 1.0).abs(), tolerance)?;
    }
    Ok(())
}

/// "energy without trend": over `steps` wrench-free steps the energy error oscillates and does not grow.
///
/// The trend is the slope of the least-squares line through the relative energy errors, times the whole duration. It
/// must stay below a quarter of the range of the errors in the first tenth of the run plus `rounding` (a secular
/// growth shows ten times more over the run than in its first tenth; an oscillation of many periods
/// has next to no slope). Choose a run of many turns.
/// # Errors
/// The first broken law.
pub fn check_energy<I>(integrator: &I, samples: &[StepSample], steps: u32, rounding: f64) -> Result<(), LawViolation>
where
    I: Integrator<FreeFlyer<f64>>,
{
    for sample in samples {
        let system = FreeFlyer::new(sample.body);
        let energy_j = |state: &RigidBodyState<f64>| kinetic_energy(&sample.body, &state.twist_body);
        let initial_j = energy_j(&sample.state);
        let mut state = sample.state;
        let (mut first_moment, mut lowest, mut highest) = (0.0, 0.0_f64, 0.0_f64);
        let middle = 0.5 * f64::from(steps - 1);
        for k in 0..steps {
            let step = integrator.step(&system, &state, &Wrench::zero(), f64::from(k) * sample.step_s, sample.step_s);
            state = valued(sample, step)?;
            let error = energy_j(&state) / initial_j - 1.0;
            first_moment += (f64::from(k) - middle) * error;
            if k < steps / 10 {
                (lowest, highest) = (lowest.min(error), highest.max(error));
            }
        }
        let n = f64::from(steps);
        let trend = 12.0 * first_moment / (n * n);
        let bound = 0.25 * (highest - lowest) + rounding;
        require("energy without trend", sample, &"no trend", &trend, trend.abs(), bound)?;
    }
    Ok(())
}

/// "observed order": the error after `steps` steps falls with the claimed order when the step is halved.
///
/// Errors are taken against a sixteen times finer run of [`GaussLegendre4`], so an integrator that converges to something else
/// than the motion of the system fails too. The order is that between half and a quarter of the step; it may be
/// higher than claimed. The steps must be long enough for the errors to stand clear of rounding.
/// # Errors
/// The first broken law.
pub fn check_order<S, I>(
    integrator: &I,
    system: &S,
    state: &S::State,
    input: &S::Input,
    step_s: f64,
    steps: u32,
    tolerance: f64,
) -> Result<(), LawViolation>
where
    S: MechanicalSystem<State: Manifold<Scalar = f64>>,
    I: Integrator<S>,
{
    let inputs = (state, step_s, steps);
    let end = |integrator: &dyn Integrator<S>, refinement: u32| -> Result<S::State, LawViolation> {
        let short_s = step_s / f64::from(refinement);
        let mut x = state.clone();
        for k in 0..steps * refinement {
            x = valued(&inputs, integrator.step(system, &x, input, f64::from(k) * short_s, short_s))?;
        }
        Ok(x)
    };
    let exact = end(&GaussLegendre4, 16)?;
    let error = |refinement| Ok::<f64, LawViolation>(end(integrator, refinement)?.ominus(&exact).euclidean_norm());
    let observed = (error(2)? / error(4)?).log2();
    let claimed = f64::from(integrator.order());
    require("observed order", &inputs, &claimed, &observed, claimed - observed, tolerance)
}

/// "units": scaling mass, length and time by powers of ten scales the answer and nothing else.
///
/// Finds absolute tolerances hidden in iterations.
/// # Errors
/// The first broken law.
pub fn check_units<I>(integrator: &I, samples: &[StepSample], tolerance: f64) -> Result<(), LawViolation>
where
    I: Integrator<FreeFlyer<f64>>,
{
    for sample in samples {
        let end = travelled(integrator, sample, &sample.wrench_body, 3)?;
        for (mass, length, time) in [
            (1e6, 1.0, 1.0),
            (1e-6, 1.0, 1.0),
            (1.0, 1e6, 1.0),
            (1.0, 1e-6, 1.0),
            (1.0, 1.0, 1e6),
            (1.0, 1.0, 1e-6),
            (1e-3, 1e-3, 1e-3),
        ] {
            let scaled = StepSample {
                body: InertialParameters {
                    mass: sample.body.mass * mass,
                    first_moment: sample.body.first_moment * (mass * length),
                    inertia_about_origin: sample.body.inertia_about_origin * (mass * length * length),
                },
                state: in_units(&sample.state, length, time),
                wrench_body: Wrench::new(
                    sample.wrench_body.torque * (mass * length * length / (time * time)),
                    sample.wrench_body.force * (mass * length / (time * time)),
                ),
                step_s: sample.step_s * time,
            };
            let found = travelled(integrator, &scaled, &scaled.wrench_body, 3)?;
            let expected = in_units(&end, length, time);
            let error = relative_difference(&found, &expected, &scaled);
            require("units", &(sample, mass, length, time), &expected, &found, error, tolerance)?;
        }
    }
    Ok(())
}

fn in_units(state: &RigidBodyState<f64>, length: f64, time: f64) -> RigidBodyState<f64> {
    RigidBodyState {
        world_from_body: Pose::from_parts(
            Translation3::from(state.world_from_body.translation.vector * length),
            state.world_from_body.rotation,
        ),
        twist_body: Twist::new(state.twist_body.angular / time, state.twist_body.linear * (length / time)),
    }
}

/// One step of a [`ParametricModel`].
#[derive(Clone, Debug)]
pub struct ModelSample<M: ParametricModel> {
    /// Start of the step.
    pub state: M::State<f64>,
    /// Held input.
    pub input: M::Input<f64>,
    /// Change of each input that moves the end of the step noticeably; sizes the difference quotients.
    pub input_size: M::Input<f64>,
    /// Parameters.
    pub parameters: M::Parameters<f64>,
    /// Change of each parameter that moves the end of the step noticeably.
    pub parameter_size: M::Parameters<f64>,
    /// Length of the step, s.
    pub step_s: f64,
}

/// "linearisation by state", "by input", "by parameters": [`linearize`] equals the central difference quotient (of
/// fourth order, over a thousandth of each size) of the model's own step.
///
/// `tolerance` is relative to the column, or to one where a change by one size moves the end by less than one.
/// # Errors
/// The first broken law.
pub fn check_parametric_model<M: ParametricModel>(
    model: &M,
    sample: &ModelSample<M>,
    tolerance: f64,
) -> Result<(), LawViolation> {
    fn unit<V: Coordinates<f64>>(j: usize, amount: f64) -> V {
        V::from_fn(|i| if i == j { amount } else { 0.0 })
    }
    let ModelSample { state, input, input_size, parameters, parameter_size, step_s } = sample;
    let state = M::lift::<f64>(state);
    let inputs = (&state, input, parameters, step_s);
    let exact = valued(&inputs, linearize(model, &state, input, parameters, *step_s))?;
    let compare =
        |law, column: &StateTangent<M>, size: f64, end: &dyn Fn(f64) -> Result<M::State<f64>, DynamicsError>| {
            let width = 1e-3 * size;
            let at = |amount: f64| Ok::<_, LawViolation>(valued(&inputs, end(amount))?.ominus(&exact.end));
            let (far, near) = (at(2.0 * width)? - at(-2.0 * width)?, at(width)? - at(-width)?);
            let quotient = (near * 8.0 - far) * (size / (12.0 * width));
            let found = *column * size;
            let error = (found - quotient).euclidean_norm() / found.euclidean_norm().max(1.0);
            require(law, &inputs, &quotient, &found, error, tolerance)
        };
    for (j, column) in exact.by_state.iter().enumerate() {
        let end = |amount| model.step(&state.oplus(&unit(j, amount)), input, parameters, *step_s);
        compare("linearisation by state", column, 1.0, &end)?;
    }
    for (j, column) in exact.by_input.iter().enumerate() {
        let end = |amount| model.step(&state, &(*input + unit(j, amount)), parameters, *step_s);
        compare("linearisation by input", column, input_size[j], &end)?;
    }
    for (j, column) in exact.by_parameters.iter().enumerate() {
        let end = |amount| model.step(&state, input, &(*parameters + unit(j, amount)), *step_s);
        compare("linearisation by parameters", column, parameter_size[j], &end)?;
    }
    Ok(())
}

impl StepSample {
    /// The sample for a model whose state, input and parameters are those of [`crate::FreeFlyerStep`].
    pub fn to_model_sample<M>(&self) -> ModelSample<M>
    where
        M: ParametricModel<
                State<f64> = RigidBodyState<f64>,
                Input<f64> = Vector6<f64>,
                Parameters<f64> = SVector<f64, PARAMETERS>,
            >,
    {
        let mass = self.body.mass;
        let inertia = self.body.inertia_about_com().trace();
        let length = (inertia / mass).sqrt();
        let (torque, force) = (inertia, mass * length);
        ModelSample {
            state: self.state,
            input: self.wrench_body.to_vector(),
            input_size: Vector6::new(torque, torque, torque, force, force, force),
            parameters: self.body.to_vector(),
            parameter_size: SVector::from_fn(|i, _| {
                0.1 * [mass, force, inertia][usize::from(i > 0) + usize::from(i > 3)]
            }),
            step_s: self.step_s,
        }
    }
}
