//! The frozen benchmark problem 8: cost, information and gradient of its plan against hyper-dual numbers through a rollout
//! written here.

use super::Criterion;
use super::answer::CostParts;
use super::curvature::Factorisation;
use super::information::InformationCost;
use super::model::{InformativeModel, Kinematics};
use super::problem::CondensedProblem;
use super::request::{LocalSettings, Reference, SpeedLimits, WrenchSet};
use super::rigid_body::RigidBodyModel;
use super::shooting::{Shooting, Task, Workspace};
use super::surroundings::{RowSettings, Surroundings};
use crate::belief::ModelBelief;
use nalgebra::{Matrix3, Matrix4, SMatrix, Vector3};
use num_dual::{DualNum, HyperDual64};
use tumble_dynamics::InertialParameters;
use tumble_lie::Pose;

const STEPS: usize = 24;
const STEP_S: f64 = 0.5;
const MASS_KG: f64 = 9.5838;
const INERTIA: [f64; 3] = [0.1534, 0.1427, 0.1623];
const LIMIT: [f64; 6] = [0.045, 0.022, 0.026, 0.452, 0.216, 0.257];
/// Prior standard deviations of mass and inertia.
const SIGMA: [f64; 4] = [1.0, 0.05, 0.05, 0.05];
const GAMMA: [f64; 4] = [1.0, 1000.0, 1000.0, 1000.0];
const GOAL: [f64; 3] = [0.9, 0.4, 0.2];
/// Standard deviation of measured velocities and rates.
const MEASURED: f64 = 0.005;

/// Unknowns from the order `[torque of all steps | force of all steps]` to ours, step after step.
fn step_by_step(other: &[f64]) -> Vec<f64> {
    let place = |i: usize, k: usize| if i < 3 { 3 * k + i } else { 3 * STEPS + 3 * k + i - 3 };
    (0..6 * STEPS).map(|n| other[place(n % 6, n / 6)]).collect()
}

/// Inputs without structure.
fn unstructured(size: f64, seed: f64) -> Vec<f64> {
    step_by_step(&(0..6 * STEPS).map(|i| size * libm::sin(seed + 1.7 * i as f64)).collect::<Vec<_>>())
}

fn settings() -> LocalSettings<12, 6> {
    let tracking = core::array::from_fn(|i| [1.0, 0.5, 0.25, 0.5][i / 3]);
    let mut measurement = SMatrix::zeros();
    for i in [3, 4, 5, 9, 10, 11] {
        measurement[(i, i)] = 1.0 / (MEASURED * MEASURED);
    }
    LocalSettings {
        steps: STEPS,
        step_s: STEP_S,
        tracking,
        terminal: tracking,
        effort: core::array::from_fn(|i| [10.0, 1.0][i / 3]),
        acceleration: [0.0; 2],
        wrench: WrenchSet { limit: LIMIT, half_spaces: Vec::new() },
        speed: SpeedLimits { speed_m_s: Vector3::repeat(0.2), rate_rad_s: Vector3::repeat(0.3) },
        measurement,
        retained: [1.0; 12],
        criterion: Criterion::A,
        margin_m: 0.0,
        length_scale_m: 0.2,
        on_segments: false,
        tolerance: 1e-4,
        iterations: 200,
    }
}

fn at([x, y, z]: [f64; 3]) -> Kinematics {
    Kinematics::at_rest(Pose::translation(x, y, z))
}

/// Cost, its gradient, and the information about quantities in prior standard deviations: the prior's, and all.
fn planned(z: &[f64]) -> (CostParts, Vec<f64>, [Matrix4<f64>; 2]) {
    let inertia = Matrix3::from_diagonal(&INERTIA.into());
    let mut belief = ModelBelief::certain(1, InertialParameters::about_com(MASS_KG, Vector3::zeros(), inertia));
    for (place, sigma) in [0, 4, 7, 9].into_iter().zip(SIGMA) {
        belief.estimate.covariance[(place, place)] = sigma * sigma;
    }
    let mut model = RigidBodyModel::<4>::principal();
    let knowledge = model.adopt(&belief).unwrap();
    let (settings, surroundings, start, goal) = (settings(), Surroundings::none(), at([0.0; 3]), at(GOAL));
    let row_settings = RowSettings {
        start_s: 0.0,
        step_s: STEP_S,
        margin_m: 0.0,
        interpolation_error_m: 0.0,
        length_scale_m: 0.2,
        on_segments: false,
    };
    let task = Task {
        settings: &settings,
        start: &start,
        reference: Reference::Hold(&goal),
        terminal: None,
        surroundings: &surroundings,
        row_settings,
        information: InformationCost::try_new(Criterion::A, &GAMMA, &knowledge).unwrap(),
        effort: core::array::from_fn(|i| core::array::from_fn(|j| if i == j { settings.effort[i] } else { 0.0 })),
        speed_limits: Vec::new(),
    };
    let mut workspace = Workspace::new(STEPS, Factorisation::Riccati);
    let mut problem = Shooting::new(&model, task, &mut workspace);
    assert!(problem.linearize(z));
    // from the model's coordinates to quantities over their prior standard deviations
    let scaled = SMatrix::<f64, 4, 4>::from_fn(|i, j| knowledge.quantities[(i, j)] / SIGMA[i]);
    let back = scaled.try_inverse().unwrap();
    let information = [&knowledge.information, problem.information()].map(|matrix| back.transpose() * matrix * back);
    (problem.parts(), problem.gradient().to_vec(), information)
}

/// A number with its changes by a parameter, by an unknown, and by both.
type T = HyperDual64;
type Moment = [T; 13];

/// Position, velocity (world), quaternion (scalar first) and rate (body), with the parameters `[m, Ixx, Iyy, Izz]`.
fn field(x: &Moment, u: &[T; 6], parameters: &[T; 4]) -> Moment {
    let [_, _, _, vx, vy, vz, a, b, c, d, p, q, r] = *x;
    let [tx, ty, tz, fx, fy, fz] = *u;
    let [m, ix, iy, iz] = *parameters;
    // the rotation of a quaternion of any length
    let two = T::from_re(2.0) / (a * a + b * b + c * c + d * d);
    let ax = fx + ((b * d + a * c) * fz + (b * c - a * d) * fy - (c * c + d * d) * fx) * two;
    let ay = fy + ((b * c + a * d) * fx + (c * d - a * b) * fz - (b * b + d * d) * fy) * two;
    let az = fz + ((c * d + a * b) * fy + (b * d - a * c) * fx - (b * b + c * c) * fz) * two;
    let half = 0.5;
    [
        vx,
        vy,
        vz,
        ax / m,
        ay / m,
        az / m,
        -(b * p + c * q + d * r) * half,
        (a * p + c * r - d * q) * half,
        (a * q + d * p - b * r) * half,
        (a * r + b * q - c * p) * half,
        (tx - (iz - iy) * q * r) / ix,
        (ty - (ix - iz) * r * p) / iy,
        (tz - (iy - ix) * p * q) / iz,
    ]
}

fn step(x: &Moment, u: &[T; 6], parameters: &[T; 4]) -> Moment {
    let along = |slope: &Moment, part: f64| core::array::from_fn(|i| x[i] + slope[i] * (part * STEP_S));
    let k1 = field(x, u, parameters);
    let k2 = field(&along(&k1, 0.5), u, parameters);
    let k3 = field(&along(&k2, 0.5), u, parameters);
    let k4 = field(&along(&k3, 1.0), u, parameters);
    let mut next: Moment =
        core::array::from_fn(|i| x[i] + (k1[i] + k2[i] * 2.0 + k3[i] * 2.0 + k4[i]) * (STEP_S / 6.0));
    let length = (next[6] * next[6] + next[7] * next[7] + next[8] * next[8] + next[9] * next[9]).sqrt();
    next[6..10].iter_mut().for_each(|x| *x /= length);
    next
}

/// Tracking and effort, and velocity and rate at every node, with one parameter and one input varied.
fn rolled_out(z: &[f64], parameter: usize, unknown: usize) -> (HyperDual64, Vec<HyperDual64>) {
    let number = |value: f64| HyperDual64::new(value, 0.0, 0.0, 0.0);
    let mut parameters = [MASS_KG, INERTIA[0], INERTIA[1], INERTIA[2]].map(number);
    parameters[parameter].eps1 = SIGMA[parameter];
    let mut x = [0.0; 13].map(number);
    x[6] = number(1.0);
    let mut spent = number(0.0);
    let mut measured = Vec::new();
    let squared = |values: &[HyperDual64]| values.iter().fold(number(0.0), |sum, x| sum + *x * *x);
    let deviation = |x: &Moment| {
        let away: [HyperDual64; 3] = core::array::from_fn(|i| x[i] - GOAL[i]);
        squared(&away) + squared(&x[7..10]) + (squared(&x[3..6]) + squared(&x[10..13])) * 0.5
    };
    for k in 0..STEPS {
        let input: [HyperDual64; 6] = core::array::from_fn(|i| {
            let n = 6 * k + i;
            HyperDual64::new(z[n] * LIMIT[i], 0.0, if n == unknown { LIMIT[i] } else { 0.0 }, 0.0)
        });
        spent = spent + deviation(&x) + squared(&input[..3]) * 10.0 + squared(&input[3..]);
        x = step(&x, &input, &parameters);
        measured.extend_from_slice(&x[3..6]);
        measured.extend_from_slice(&x[10..13]);
    }
    (spent + deviation(&x), measured)
}

/// Cost, change of the cost by one unknown, and the information in prior standard deviations.
fn by_unknown(z: &[f64], prior: &Matrix4<f64>, unknown: usize) -> (f64, f64, Matrix4<f64>) {
    let rolled: Vec<_> = (0..4).map(|parameter| rolled_out(z, parameter, unknown)).collect();
    let (mut information, mut change) = (*prior, Matrix4::zeros());
    for i in 0..4 {
        for j in 0..4 {
            for (a, b) in rolled[i].1.iter().zip(&rolled[j].1) {
                information[(i, j)] += a.eps1 * b.eps1 / (MEASURED * MEASURED);
                change[(i, j)] += (a.eps1eps2 * b.eps1 + a.eps1 * b.eps1eps2) / (MEASURED * MEASURED);
            }
        }
    }
    let covariance = information.try_inverse().unwrap();
    let weights = Matrix4::from_diagonal(&core::array::from_fn::<f64, 4, _>(|i| GAMMA[i] * SIGMA[i] * SIGMA[i]).into());
    let cost = rolled[0].0.re + (weights * covariance).trace();
    (cost, rolled[0].0.eps2 - (weights * covariance * change * covariance).trace(), information)
}

#[test]
fn the_gradient_is_that_of_hyper_dual_numbers() {
    for (size, seed) in [(0.6, 1.0), (1.0, 4.0), (0.2, 2.5)] {
        let z = unstructured(size, seed);
        let (parts, gradient, [prior, information]) = planned(&z);
        // every belief is taken to have at least a millionth of the parameter for its standard deviation
        assert!((prior - Matrix4::identity()).amax() < 2e-10);
        let scale = gradient.iter().fold(0.0, |scale: f64, x| scale.max(x.abs()));
        for (unknown, found) in gradient.iter().enumerate() {
            let (cost, expected, expected_information) = by_unknown(&z, &prior, unknown);
            assert!((parts.total() - cost).abs() <= 1e-12 * cost, "{} {cost}", parts.total());
            assert!((found - expected).abs() <= 1e-12 * scale, "{unknown}: {found} {expected}, scale {scale}");
            let error = (information - expected_information).amax() / expected_information.amax();
            assert!(error <= 1e-12, "{error}");
        }
    }
}
