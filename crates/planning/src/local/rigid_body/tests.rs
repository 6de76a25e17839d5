//! The step against other algorithms, other arithmetic and numbers from elsewhere.
#![allow(clippy::needless_range_loop)]

use super::super::model::{InformativeModel, StepDerivatives};
use super::parameters::Believed;
use super::{BodyParameters, Kinematics, Nuisance, RigidBodyModel};
use crate::belief::ModelBelief;
use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};
use num_dual::HyperDual64;
use tumble_dynamics::{
    FreeFlyer, InertialParameters, Integrator, LogCholesky, MuntheKaas4, RigidBodyState, RungeKutta4,
};
use tumble_lie::{Pose, Scalar, Twist, Wrench, real};

#[path = "../../../tests/suite/uniform/mod.rs"]
mod uniform;

/// Uniform in -1..1, a fixed sequence.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        uniform::uniform(&mut self.0)
    }

    fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| size * self.uniform())
    }

    fn array<const N: usize>(&mut self, size: f64) -> [f64; N] {
        core::array::from_fn(|_| size * self.uniform())
    }

    /// Some body, its centre of mass this far from the origin, known to some ten percent.
    fn belief(&mut self, offset_m: f64) -> ModelBelief {
        let chart = LogCholesky {
            log_mass: 2.0 + 0.5 * self.uniform(),
            center_of_mass: self.vector(offset_m),
            log_extents: self.vector(0.3) - Vector3::repeat(2.0),
            shears: self.vector(0.03),
        };
        let mut belief = ModelBelief::certain(1, chart.to_parameters());
        let size = belief.estimate.parameters.to_vector().map(|x| 0.1 * x.abs() + 0.002);
        let root = SMatrix::<f64, 10, 10>::from_fn(|i, _| size[i] * self.uniform());
        belief.estimate.covariance = root * root.transpose();
        belief
    }

    fn state(&mut self) -> Kinematics {
        Kinematics {
            world_from_body: Pose::from_parts(
                (self.vector(1.0)).into(),
                UnitQuaternion::from_scaled_axis(self.vector(2.0)),
            ),
            velocity_world: self.vector(0.3),
            rate_body: self.vector(0.7),
        }
    }
}

type Quaternion4<T> = [T; 4];

fn product<T: Scalar>(a: &Quaternion4<T>, b: &Quaternion4<T>) -> Quaternion4<T> {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3],
        a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1],
    ]
}

fn conjugate<T: Scalar>(q: &Quaternion4<T>) -> Quaternion4<T> {
    [q[0], -q[1], -q[2], -q[3]]
}

fn rotated<T: Scalar>(q: &Quaternion4<T>, v: &Vector3<T>) -> Vector3<T> {
    let turned = product(&product(q, &[T::zero(), v.x, v.y, v.z]), &conjugate(q));
    let square = product(q, &conjugate(q))[0];
    Vector3::new(turned[1], turned[2], turned[3]) / square
}

#[derive(Clone, Copy)]
struct Motion<T: Scalar> {
    position: Vector3<T>,
    velocity: Vector3<T>,
    attitude: Quaternion4<T>,
    rate: Vector3<T>,
}

impl<T: Scalar> Motion<T> {
    fn of(state: &Kinematics) -> Self {
        let q = state.world_from_body.rotation;
        Self {
            position: state.position_world().map(real),
            velocity: state.velocity_world.map(real),
            attitude: [q.w, q.i, q.j, q.k].map(real),
            rate: state.rate_body.map(real),
        }
    }

    /// Moved by an increment so small that its square does not count.
    fn moved(&self, x: &[T; 12]) -> Self {
        let half = real::<T>(0.5);
        let turn = [T::one(), x[6] * half, x[7] * half, x[8] * half];
        Self {
            position: self.position + Vector3::new(x[0], x[1], x[2]),
            velocity: self.velocity + Vector3::new(x[3], x[4], x[5]),
            attitude: product(&self.attitude, &turn),
            rate: self.rate + Vector3::new(x[9], x[10], x[11]),
        }
    }

    /// The increment from another motion so close that its square does not count.
    fn increment_from(&self, from: &Self) -> [T; 12] {
        let turn = product(&conjugate(&from.attitude), &self.attitude);
        let (p, v, w) = (self.position - from.position, self.velocity - from.velocity, self.rate - from.rate);
        let a = Vector3::new(turn[1], turn[2], turn[3]) * real::<T>(2.0);
        [p.x, p.y, p.z, v.x, v.y, v.z, a.x, a.y, a.z, w.x, w.y, w.z]
    }

    /// The classical Runge-Kutta method in world axes on the centre of mass, with the accelerations of [`FreeFlyer`].
    fn step(&self, body: &InertialParameters<T>, torque: &Vector3<T>, force: &Vector3<T>, step_s: T) -> Self {
        let (flyer, c) = (FreeFlyer::new(*body), body.center_of_mass());
        let slope = |motion: &Self| {
            let (w, twist) = (&motion.rate, Twist::new(motion.rate, Vector3::zeros()));
            let acceleration = flyer.forward(&twist, &Wrench::new(*torque, *force));
            let spin = acceleration.angular_acceleration_body;
            let of_center = acceleration.acceleration_origin_body + spin.cross(&c) + w.cross(&w.cross(&c));
            let turn = product(&motion.attitude, &[T::zero(), w.x, w.y, w.z]);
            Self {
                position: motion.velocity,
                velocity: rotated(&motion.attitude, &of_center),
                attitude: turn.map(|x| x * real::<T>(0.5)),
                rate: spin,
            }
        };
        let plus = |slope: &Self, factor: T, to: &Self| Self {
            position: to.position + slope.position * factor,
            velocity: to.velocity + slope.velocity * factor,
            attitude: core::array::from_fn(|i| to.attitude[i] + slope.attitude[i] * factor),
            rate: to.rate + slope.rate * factor,
        };
        let mut start = *self;
        start.position += rotated(&self.attitude, &c);
        start.velocity += rotated(&self.attitude, &self.rate.cross(&c));
        let half = step_s * real(0.5);
        let k1 = slope(&start);
        let k2 = slope(&plus(&k1, half, &start));
        let k3 = slope(&plus(&k2, half, &start));
        let k4 = slope(&plus(&k3, step_s, &start));
        let (third, sixth) = (step_s / real(3.0), step_s / real(6.0));
        let mut end = plus(&k4, sixth, &plus(&k3, third, &plus(&k2, third, &plus(&k1, sixth, &start))));
        let mut square = T::zero();
        for x in end.attitude {
            square += x * x;
        }
        end.attitude = end.attitude.map(|x| x / square.sqrt());
        end.position -= rotated(&end.attitude, &c);
        end.velocity -= rotated(&end.attitude, &end.rate.cross(&c));
        end
    }
}

/// The step of a model's reference at some coordinates, from the definition of the coordinates.
fn reference_step<T: Scalar, const P: usize>(
    model: &RigidBodyModel<P>,
    believed: &Believed<P>,
    belief: &ModelBelief,
    start: &Motion<T>,
    eta: &[T; P],
    input: &[T; 6],
    step_s: f64,
) -> Motion<T> {
    let moved = |i: usize| eta[i] * real(believed.sigma[i]);
    let parameters = belief.parameters();
    let body = match model.parameters {
        BodyParameters::Full => {
            let chart = LogCholesky::try_from_parameters(parameters).unwrap().to_vector();
            LogCholesky::from_vector(&SVector::from_fn(|i, _| real::<T>(chart[i]) + moved(i))).to_parameters()
        }
        BodyParameters::Principal => {
            let mut inertia = parameters.inertia_about_com().map(real::<T>);
            for axis in 0..3 {
                inertia[(axis, axis)] += moved(1 + axis);
            }
            let center = parameters.center_of_mass().map(real);
            InertialParameters::about_com(real::<T>(parameters.mass) + moved(0), center, inertia)
        }
    };
    let mut torque = Vector3::new(input[0], input[1], input[2]);
    let mut force = Vector3::new(input[3], input[4], input[5]);
    for (place, (nuisance, _)) in model.nuisances.iter().enumerate() {
        let unknown = moved(model.parameters.count() + place);
        match *nuisance {
            Nuisance::ForceScale(axis) => force[axis] += input[3 + axis] * unknown,
            Nuisance::TorqueScale(axis) => torque[axis] += input[axis] * unknown,
            Nuisance::ForceBias(axis) => force[axis] += unknown,
            Nuisance::TorqueBias(axis) => torque[axis] += unknown,
        }
    }
    start.step(&body, &torque, &force, real(step_s))
}

/// Largest difference of the step and all its derivatives from hyper-dual numbers, over the size of the derivatives.
fn error_of_derivatives<const P: usize>(model: &mut RigidBodyModel<P>, random: &mut Random, offset_m: f64) -> f64 {
    let belief = random.belief(offset_m);
    model.adopt(&belief).unwrap();
    let (state, input, step_s) = (random.state(), random.array::<6>(0.2), 0.5);
    let sensitivity: [[f64; 12]; P] = core::array::from_fn(|_| random.array(1.0));
    let mut derivatives = StepDerivatives::<12, 6, P>::zeros();
    // nothing that was there before may stay
    derivatives.by_state = [[f64::NAN; 12]; 12];
    derivatives.by_input = [[f64::NAN; 6]; 12];
    derivatives.sensitivity_by_state = [[[f64::NAN; 12]; 12]; P];
    derivatives.sensitivity_by_input = [[[f64::NAN; 6]; 12]; P];
    let (end, moved) = model.differentiate(&state, &sensitivity, &input, step_s, &mut derivatives).unwrap();
    assert_eq!(model.step(&state, &sensitivity, &input, step_s), Some((end, moved)));

    let believed = model.believed.as_ref().unwrap();
    let (mut error, mut size) = (0.0f64, 0.0f64);
    let mut compare = |found: f64, expected: f64| {
        assert!(found.is_finite());
        error = error.max((found - expected).abs());
        size = size.max(expected.abs());
    };
    let plain = reference_step(model, believed, &belief, &Motion::of(&state), &[0.0; P], &input, step_s);
    for difference in Motion::of(&end).increment_from(&plain) {
        compare(difference, 0.0);
    }
    let (one, zero) = (HyperDual64::new(0.0, 1.0, 0.0, 0.0), HyperDual64::new(0.0, 0.0, 0.0, 0.0));
    let lane = HyperDual64::new(0.0, 0.0, 1.0, 0.0);
    for c in 0..P {
        for d in 0..18 {
            let seed: [HyperDual64; 12] = core::array::from_fn(|i| if i == d { lane } else { zero });
            let start = Motion::of(&state).moved(&seed);
            let along = start.moved(&core::array::from_fn(|i| one * sensitivity[c][i]));
            let eta: [HyperDual64; P] = core::array::from_fn(|i| if i == c { one } else { zero });
            let input: [HyperDual64; 6] =
                core::array::from_fn(|i| real::<HyperDual64>(input[i]) + if 12 + i == d { lane } else { zero });
            let before = reference_step(model, believed, &belief, &start, &[zero; P], &input, step_s);
            let after = reference_step(model, believed, &belief, &along, &eta, &input, step_s);
            let first = before.increment_from(&Motion::of(&end));
            let second = after.increment_from(&before);
            for i in 0..12 {
                let (by, sensitivity_by) = if d < 12 {
                    (derivatives.by_state[i][d], derivatives.sensitivity_by_state[c][i][d])
                } else {
                    (derivatives.by_input[i][d - 12], derivatives.sensitivity_by_input[c][i][d - 12])
                };
                compare(by, first[i].eps2);
                compare(moved[c][i], second[i].eps1);
                compare(sensitivity_by, second[i].eps1eps2);
            }
        }
    }
    error / size
}

#[test]
fn derivatives_are_those_of_hyper_dual_numbers() {
    let nuisances = [
        (Nuisance::ForceScale(0), 0.1),
        (Nuisance::ForceScale(2), 0.2),
        (Nuisance::TorqueScale(1), 0.1),
        (Nuisance::TorqueScale(2), 0.05),
        (Nuisance::ForceBias(1), 0.02),
        (Nuisance::TorqueBias(0), 0.01),
        (Nuisance::TorqueBias(2), 0.01),
    ];
    let mut random = Random(7);
    for offset_m in [0.0, 0.2] {
        for _ in 0..4 {
            let error = error_of_derivatives(&mut RigidBodyModel::principal(), &mut random, offset_m);
            assert!(error < 1e-13, "{error}");
            let error = error_of_derivatives(&mut RigidBodyModel::full(), &mut random, offset_m);
            assert!(error < 1e-13, "{error}");
            let mut model = RigidBodyModel::<11>::with_nuisances(BodyParameters::Principal, &nuisances).unwrap();
            let error = error_of_derivatives(&mut model, &mut random, offset_m);
            assert!(error < 1e-13, "{error}");
            let mut model = RigidBodyModel::<13>::with_nuisances(BodyParameters::Full, &nuisances[2..5]).unwrap();
            let error = error_of_derivatives(&mut model, &mut random, offset_m);
            assert!(error < 1e-13, "{error}");
        }
    }
}

/// Problem 8: the body, its prior, and the excited start of the design's section 8, one input per step.
fn problem_8() -> (ModelBelief, Vec<[f64; 6]>) {
    let inertia = Matrix3::from_diagonal(&Vector3::new(0.1534, 0.1427, 0.1623));
    let body = InertialParameters::about_com(9.5838, Vector3::zeros(), inertia);
    let mut belief = ModelBelief::certain(1, body);
    for (place, sigma) in [(0, 1.0), (4, 0.05), (7, 0.05), (9, 0.05)] {
        belief.estimate.covariance[(place, place)] = sigma * sigma;
    }
    let limit = [0.045, 0.022, 0.026, 0.452, 0.216, 0.257];
    let z = |i: usize| 0.6 * libm::sin(1.0 + 1.7 * i as f64);
    let input =
        |k: usize| core::array::from_fn(|i| limit[i] * if i < 3 { z(3 * k + i) } else { z(72 + 3 * k + i - 3) });
    (belief, (0..24).map(input).collect())
}

/// A step of problem 8 as it is frozen: the quaternion is never normalised, and turns forces by
/// `f + 2 q0 (qv x f) + 2 qv x (qv x f)` whatever its length.
fn frozen_step<T: Scalar>(motion: &Motion<T>, moments: &Vector3<T>, mass: T, input: &[f64; 6]) -> Motion<T> {
    let u: [T; 6] = input.map(real);
    let (torque, force) = (Vector3::new(u[0], u[1], u[2]), Vector3::new(u[3], u[4], u[5]));
    let (half, two) = (real::<T>(0.5), real::<T>(2.0));
    let slope = |at: &Motion<T>| {
        let q = Vector3::new(at.attitude[1], at.attitude[2], at.attitude[3]);
        let twice = q.cross(&force) * two;
        let momentum = at.rate.component_mul(moments);
        Motion {
            position: at.velocity,
            velocity: (force + twice * at.attitude[0] + q.cross(&twice)) / mass,
            attitude: product(&at.attitude, &[T::zero(), at.rate.x, at.rate.y, at.rate.z]).map(|x| x * half),
            rate: (torque - at.rate.cross(&momentum)).component_div(moments),
        }
    };
    let plus = |slope: &Motion<T>, factor: f64, to: &Motion<T>| Motion {
        position: to.position + slope.position * real::<T>(factor),
        velocity: to.velocity + slope.velocity * real::<T>(factor),
        attitude: core::array::from_fn(|i| to.attitude[i] + slope.attitude[i] * real(factor)),
        rate: to.rate + slope.rate * real::<T>(factor),
    };
    let k1 = slope(motion);
    let k2 = slope(&plus(&k1, 0.25, motion));
    let k3 = slope(&plus(&k2, 0.25, motion));
    let k4 = slope(&plus(&k3, 0.5, motion));
    let (third, sixth) = (0.5 / 3.0, 0.5 / 6.0);
    plus(&k4, sixth, &plus(&k3, third, &plus(&k2, third, &plus(&k1, sixth, motion))))
}

/// End of problem 8's start, and its sensitivity to the first moment of inertia, each step cut into so many.
fn rolled_out(model: &RigidBodyModel<4>, inputs: &[[f64; 6]], parts: u32) -> (Kinematics, [[f64; 12]; 4]) {
    let (mut state, mut sensitivity) = (Kinematics::at_rest(Pose::identity()), [[0.0; 12]; 4]);
    for input in inputs {
        for _ in 0..parts {
            (state, sensitivity) = model.step(&state, &sensitivity, input, 0.5 / f64::from(parts)).unwrap();
        }
    }
    (state, sensitivity)
}

#[test]
fn checkpoints_of_problem_8() {
    let (belief, inputs) = problem_8();
    let mut model = RigidBodyModel::principal();
    let knowledge = model.adopt(&belief).unwrap();
    assert!(knowledge.information.is_identity(1e-15));
    let (state, sensitivity) = rolled_out(&model, &inputs, 1);
    let (fine, fine_sensitivity) = rolled_out(&model, &inputs, 50);

    // the checkpoints are those of the frozen step
    let moved = HyperDual64::new(0.1534, 0.05, 0.0, 0.0);
    let moments = Vector3::new(moved, real(0.1427), real(0.1623));
    let mut frozen = Motion::of(&Kinematics::at_rest(Pose::identity()));
    for input in &inputs {
        frozen = frozen_step(&frozen, &moments, real(9.5838), input);
    }
    let close = |found: &[f64], expected: &[f64], tolerance: f64| {
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < tolerance, "{found} {expected}");
        }
    };
    let position = frozen.position.map(|x| x.re);
    let velocity = frozen.velocity.map(|x| x.re);
    let velocity_by_xx = frozen.velocity.map(|x| x.eps1);
    let q = [0.966_391_280_262, 0.042_730_835_312_6, 0.239_746_000_184, -0.082_363_102_529_3];
    close(position.as_slice(), &[0.007_632_991_857_64, -0.072_232_711_652_6, 0.019_901_878_172_1], 1e-13);
    close(velocity.as_slice(), &[0.002_955_751_321_97, -0.012_286_277_186_1, -4.773_716_417_63e-5], 1e-13);
    close(&frozen.attitude.map(|x| x.re), &q, 1e-12);
    close(velocity_by_xx.as_slice(), &[-0.000_118_645_814_192, -0.000_877_946_245_878, 4.422_044_053_44e-5], 1e-15);

    // ours turns alike, the length of the quaternion apart
    let norm = f64::sqrt(q.iter().map(|x| x * x).sum());
    assert!((norm - 1.0).abs() > 5e-8, "{norm}");
    let found = state.world_from_body.rotation;
    close(&[found.w, found.i, found.j, found.k], &q.map(|x| x / norm), 2e-12);
    close(state.rate_body.as_slice(), &[-0.005_308_120_268_76, 0.081_415_053_869_8, -0.018_521_934_705_3], 2e-13);
    close(&sensitivity[1][9..], &[0.001_781_658_045_12, 0.006_164_508_395_22, 0.000_424_734_216_121], 1e-13);

    // the frozen step turns forces by quaternions that are not of unit length, within a step too: a difference below its own
    // error against steps a fiftieth as long
    let within = |ours: &Vector3<f64>, frozen: &Vector3<f64>, fine: &Vector3<f64>| {
        let (difference, error) = ((ours - frozen).amax(), (frozen - fine).amax());
        assert!(difference < error && difference < 5e-8, "{difference} {error}");
    };
    within(&state.position_world(), &position, &fine.position_world());
    within(&state.velocity_world, &velocity, &fine.velocity_world);
    let of_velocity = |sensitivity: &[[f64; 12]; 4]| Vector3::from_column_slice(&sensitivity[1][3..6]);
    within(&of_velocity(&sensitivity), &velocity_by_xx, &of_velocity(&fine_sensitivity));
}

#[test]
fn short_steps_are_those_of_the_integrators_on_the_group() {
    let mut random = Random(3);
    let mut model = RigidBodyModel::principal();
    for _ in 0..10 {
        let belief = random.belief(0.2);
        model.adopt(&belief).unwrap();
        let (state, input) = (random.state(), random.array::<6>(0.3));
        let (system, start) = (FreeFlyer::new(*belief.parameters()), RigidBodyState::from(&state));
        let wrench = Wrench::from(SVector::from(input));
        let error = |step_s: f64| {
            let end = model.step(&state, &[[0.0; 12]; 4], &input, step_s).unwrap().0;
            let others = [
                RungeKutta4.step(&system, &start, &wrench, 0.0, step_s).unwrap(),
                MuntheKaas4.step(&system, &start, &wrench, 0.0, step_s).unwrap(),
            ];
            others.map(|other| SVector::from(model.difference(&end, &Kinematics::from(&other))).amax())
        };
        for (long, short) in error(0.1).into_iter().zip(error(0.05)) {
            // fifth order in one step
            assert!(long < 2e-6 && short < long / 20.0, "{long} {short}");
        }
    }
}

#[test]
fn without_forces_the_centre_of_mass_moves_straight_on() {
    let mut random = Random(5);
    let mut model = RigidBodyModel::full();
    let belief = random.belief(0.3);
    model.adopt(&belief).unwrap();
    let mut state = random.state();
    let c = belief.parameters().center_of_mass();
    let velocity =
        |state: &Kinematics| state.velocity_world + state.world_from_body.rotation * state.rate_body.cross(&c);
    let (from, before) = (state.position_world() + state.world_from_body.rotation * c, velocity(&state));
    for _ in 0..20 {
        state = model.step(&state, &[[0.0; 12]; 10], &[0.0; 6], 0.5).unwrap().0;
    }
    assert!((velocity(&state) - before).amax() < 1e-14);
    assert!((state.position_world() + state.world_from_body.rotation * c - from - before * 10.0).amax() < 1e-13);
}

#[test]
fn acceleration_of_the_resting_body() {
    let mut random = Random(11);
    let mut model = RigidBodyModel::principal();
    assert_eq!(model.acceleration_by_input(), [[0.0; 6]; 6]);
    let belief = random.belief(0.3);
    model.adopt(&belief).unwrap();
    let found = model.acceleration_by_input();
    for j in 0..6 {
        let wrench = Wrench::from(SVector::<f64, 6>::ith(j, 1.0));
        let expected = FreeFlyer::new(*belief.parameters()).forward(&Twist::zero(), &wrench);
        for i in 0..3 {
            assert!((found[i][j] - expected.acceleration_origin_body[i]).abs() < 1e-13);
            assert!((found[3 + i][j] - expected.angular_acceleration_body[i]).abs() < 1e-12);
        }
    }
}

#[test]
fn the_residual_and_its_change() {
    let mut random = Random(13);
    let model = RigidBodyModel::principal();
    let reference = random.state();
    assert!(SVector::from(model.residual(&reference, &reference).0).amax() < 1e-15);
    for turn in [0.1, 1.5, 3.0, 4.5, 6.0] {
        let axis = nalgebra::Unit::new_normalize(random.vector(1.0));
        let mut state = random.state();
        state.world_from_body = reference.world_from_body * UnitQuaternion::from_axis_angle(&axis, turn);
        for sign in [1.0, -1.0] {
            state.world_from_body.rotation =
                UnitQuaternion::new_unchecked(state.world_from_body.rotation.into_inner() * sign);
            let (residual, by_state) = model.residual(&state, &reference);
            // the short way round
            let shorter = if turn < core::f64::consts::PI { turn } else { turn - core::f64::consts::TAU };
            let attitude = axis.into_inner() * (2.0 * libm::sin(0.5 * shorter));
            assert!((Vector3::from_column_slice(&residual[6..9]) - attitude).amax() < 1e-14);
            for j in 0..12 {
                let at = |x: f64| {
                    let change = core::array::from_fn(|i| if i == j { x } else { 0.0 });
                    SVector::from(model.residual(&model.retract(&state, &change), &reference).0)
                };
                let quotient = (at(1e-5) - at(-1e-5)) / 2e-5;
                for i in 0..12 {
                    assert!((by_state[i][j] - quotient[i]).abs() < 1e-9, "{i} {j}");
                }
            }
        }
    }
}

#[test]
fn steps_that_lead_nowhere_are_none() {
    let mut random = Random(17);
    let mut model = RigidBodyModel::principal();
    let (state, rest) = (random.state(), [[0.0; 12]; 4]);
    assert_eq!(model.step(&state, &rest, &[0.0; 6], 0.5), None);
    assert!(model.body_at(&[0.0; 4]).is_err());
    model.adopt(&random.belief(0.1)).unwrap();
    assert!(model.step(&state, &rest, &[0.0; 6], 0.5).is_some());
    let mut derivatives = StepDerivatives::zeros();
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        assert_eq!(model.step(&state, &rest, &[0.0, bad, 0.0, 0.0, 0.0, 0.0], 0.5), None);
        let faster = Kinematics { rate_body: Vector3::new(bad, bad, 0.0), ..state };
        assert_eq!(model.differentiate(&faster, &rest, &[0.0; 6], 0.5, &mut derivatives), None);
    }
    assert_eq!(model.step(&state, &rest, &[0.0; 6], f64::NAN), None);
}
