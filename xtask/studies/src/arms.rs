//! `study arms`: a payload on the arm of a free-floating robot from momentum alone, and what integrators keep.

use nalgebra::{Matrix3, Translation, Vector3, Vector6};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble::robots::shipped;
use tumble_dynamics::{
    Fixed, FreeInput, FreeMultibody, GroupState, InertialParameters, Integrator, Multibody, MuntheKaas4, RungeKutta4,
    Variational,
};
use tumble_formats::arm::{ArmJoint, ArmModel};
use tumble_identification::multibody::{
    ExcitedBase, JointExcitation, JointMotion, MomentumForm, TreeEstimator, TreePart, TreeRecord, TreeSample,
    VelocityNoise,
};
use tumble_identification::statistics::coverage_band;
use tumble_lie::{Pose, Product, Stacked, Twist, Wrench};

use crate::Failure;
use crate::arguments::Arguments;
use crate::targets::Report;
use tumble_identification::noise::signed_unit;

/// Noise of the issue: 1e-3 rad/s; a velocity good to a millimetre a second, joints to a tenth of the gyroscope.
const NOISE: VelocityNoise = VelocityNoise { base_rate_rad_s: 1e-3, base_velocity_m_s: 1e-3, joint_rate: 1e-4 };
const STEP_S: f64 = 0.008;
/// Five minutes.
const STEPS: usize = 37_500;
/// Of the steps of the motion one in this many is logged: 62.5 Hz.
const EVERY: usize = 2;
/// Two-sided 95 % of a normal variable.
const NARROW: f64 = 1.959_96;

fn failed(error: impl std::fmt::Display) -> Failure {
    Failure::BadInput(error.to_string())
}

fn payload() -> InertialParameters<f64> {
    let inertia = Matrix3::new(0.020, 0.002, -0.001, 0.002, 0.030, 0.0015, -0.001, 0.0015, 0.025);
    InertialParameters::about_com(2.0, Vector3::new(-0.12, 0.03, 0.05), inertia)
}

/// Swings that anyone would try, and the motion designed from rest; both within the perching arm's 0.12 rad/s.
fn motions(arm: &ArmModel, payload: &TreePart) -> Result<[JointMotion; 2], Failure> {
    let swings = JointMotion {
        period_s: 300.0,
        middles: vec![0.0; 2],
        coefficients: [[(5_usize, 0.70), (18, 0.10)], [(6, 0.60), (20, 0.10)]]
            .map(|tones| {
                let mut series = vec![[0.0; 2]; 20];
                for (k, amplitude) in tones {
                    series[k - 1] = [0.8 * amplitude, 0.6 * amplitude];
                }
                series
            })
            .to_vec(),
    };
    let limits = |joint: &ArmJoint| {
        joint.limits.range().ok_or_else(|| failed(format!("joint `{}` has no limit of its rate", joint.name)))
    };
    let problem = JointExcitation {
        tree: arm.tree.clone(),
        parts: vec![payload.clone()],
        ranges: arm.joints.iter().map(limits).collect::<Result<_, _>>()?,
        base: ExcitedBase::Floating(Wrench::zero(), NOISE),
        period_s: 100.0,
        harmonics: 10,
    };
    Ok([swings, problem.design(3000, 1).map_err(failed)?.motion])
}

/// The base of a free-floating tree follows from its momentum; second-order steps on the group.
fn float(tree: &Multibody<f64>, motion: &JointMotion, momentum: &Wrench<f64>) -> Result<Vec<TreeSample>, Failure> {
    let joints = |time_s: f64| {
        let [[a, da, _], [b, db, _]] = [motion.at(0, time_s), motion.at(1, time_s)];
        ([a, b], [da, db])
    };
    let twist = |pose: &Pose<f64>, time_s: f64| -> Result<Twist<f64>, Failure> {
        let (positions, rates) = joints(time_s);
        let momentum_base = momentum.transformed_by(&pose.inverse());
        tree.floating_base_twist(&positions, &rates, &momentum_base).map_err(failed)
    };
    let moved = |pose: &Pose<f64>, twist: &Twist<f64>, step_s: f64| -> Pose<f64> {
        tumble_lie::Manifold::oplus(pose, &(twist.to_vector() * step_s))
    };
    let mut pose = Pose::identity();
    let mut samples = Vec::new();
    for step in 0..=STEPS {
        let time_s = step as f64 * STEP_S;
        let now = twist(&pose, time_s)?;
        if step % EVERY == 0 {
            let (positions, rates) = joints(time_s);
            samples.push(TreeSample {
                time_s,
                world_from_base: pose,
                base_twist: now,
                positions: positions.to_vec(),
                rates: rates.to_vec(),
                accelerations: None,
                motors: None,
                base_wrench: None,
            });
        }
        let half = moved(&pose, &now, 0.5 * STEP_S);
        pose = moved(&pose, &twist(&half, time_s + 0.5 * STEP_S)?, STEP_S);
    }
    Ok(samples)
}

fn gaussian(generator: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * (0.5 * (1.0 - signed_unit(generator))).max(f64::MIN_POSITIVE).ln()).sqrt();
    radius * (std::f64::consts::PI * signed_unit(generator)).cos()
}

fn noisy(clean: &[TreeSample], seed: u64) -> Vec<TreeSample> {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    let mut disturbed = clean.to_vec();
    for sample in &mut disturbed {
        let mut draw = |sigma: f64| Vector3::from_fn(|_, _| sigma * gaussian(&mut generator));
        let (gyro, velocity) = (draw(NOISE.base_rate_rad_s), draw(NOISE.base_velocity_m_s));
        sample.base_twist += Twist::new(gyro, velocity);
        sample.rates.iter_mut().for_each(|rate| *rate += NOISE.joint_rate * gaussian(&mut generator));
    }
    disturbed
}

/// The figures of one body that the claim is about.
fn figures(body: &InertialParameters<f64>) -> [f64; 7] {
    let (c, j) = (body.center_of_mass(), body.inertia_about_com());
    [body.mass, c.x, c.y, c.z, j.m11, j.m22, j.m33]
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let seeds = arguments.number("--runs")?.unwrap_or(100);
    let steps = arguments.number("--steps")?.unwrap_or(100_000);
    let mut report = Report::default();
    grasped_payload(seeds, &mut report)?;
    kept_momentum(steps, &mut report)?;
    report.finish()
}

fn grasped_payload(seeds: usize, report: &mut Report) -> Result<(), Failure> {
    let arm = ArmModel::find("astrobee-arm", &shipped()).map_err(failed)?;
    let tool = arm.tool.clone().ok_or_else(|| failed("the arm has no tool"))?;
    let guess = InertialParameters::about_com(1.0, Vector3::zeros(), Matrix3::identity() * 0.01);
    let part = TreePart::payload("payload", tool.body, tool.body_from_frame, guess);
    let on_body = arm.tree.body(tool.body).ok_or_else(|| failed("the tool sits on no body"))?;
    let carrying = arm.tree.clone().with_body(tool.body, *on_body + payload().transformed_by(&tool.body_from_frame));
    let slow_tumble = Wrench::new(Vector3::new(0.02, -0.015, 0.02), Vector3::new(0.2, -0.1, 0.15));
    let [swings, designed] = motions(&arm, &part)?;
    for (name, motion, momentum, judged) in [
        ("swings from rest", &swings, Wrench::zero(), false),
        ("designed motion from rest", &designed, Wrench::zero(), true),
        ("swings, tumbling slowly", &swings, slow_tumble, true),
    ] {
        let estimator = TreeEstimator {
            tree: arm.tree.clone(),
            parts: vec![part.clone()],
            momentum: Some(MomentumForm { noise: NOISE, known: Some(momentum) }),
            torque: None,
            dependence_s: 0.0,
        };
        let clean = float(&carrying, motion, &momentum)?;
        let truth = figures(&payload());
        // a figure is judged against its own size; a lever and a moment against the largest of the three
        let sizes = [2.0, 0.12, 0.12, 0.12, 0.03, 0.03, 0.03];
        let (mut worst, mut covered) = ([0.0_f64; 7], [0_usize; 7]);
        for seed in 0..seeds {
            let records = [TreeRecord { samples: noisy(&clean, seed as u64), grasped: true }];
            let estimate = estimator.identify(&records).map_err(failed)?;
            let body = estimate.body(0).ok_or_else(|| failed("no payload"))?;
            let std = estimate.body_std(0).map_err(failed)?.ok_or_else(|| failed("the payload is not determined"))?;
            let (c, j) = (std.center_of_mass_m, std.inertia_about_com_kg_m2);
            let std = [std.mass_kg, c.x, c.y, c.z, j.m11, j.m22, j.m33];
            for (k, found) in figures(&body).iter().enumerate() {
                let error = (found - truth[k]).abs();
                worst[k] = worst[k].max(error / sizes[k]);
                covered[k] += usize::from(error <= NARROW * std[k]);
            }
        }
        report.table.push(format!("{name}: largest error of {seeds} runs, per cent: {:.3?}", worst.map(|e| 100.0 * e)));
        if judged {
            let largest = worst.iter().fold(0.0, |a: f64, b| a.max(*b));
            report.at_most(&format!("{name}: largest relative error of mass, CoM, inertia"), largest, 0.02);
        }
        let shares = covered.map(|covered| covered as f64 / seeds as f64);
        let band = coverage_band(0.95, seeds, 0.999);
        let found = format!("mass, CoM, inertia: {shares:.2?}, band {:.3} to {:.3}", band.low, band.high);
        report.target(format!("{name}: 95 % intervals cover"), shares.iter().all(|share| band.contains(*share)), found);
    }
    Ok(())
}

/// The embedded arm with its two joints in the type.
fn two_joints() -> Result<Multibody<f64, Fixed<2>>, Failure> {
    let arm = ArmModel::find("astrobee-arm", &shipped()).map_err(failed)?;
    let links = arm.tree.links().to_vec().try_into().map_err(|_| failed("the arm has not two joints"))?;
    Multibody::try_new(*arm.tree.base(), links).map_err(failed)
}

fn kept_momentum(steps: usize, report: &mut Report) -> Result<(), Failure> {
    let system = FreeMultibody { tree: two_joints()?, gravity_world: Vector3::zeros() };
    let variational = drift(&Variational, &system, steps)?;
    let name = format!("variational, {steps} steps of 10 ms: relative change of momentum <= 1e-10");
    report.target(name, variational <= 1e-10, format!("{variational:.2e}"));
    for (name, found) in [
        ("Runge-Kutta 4", drift(&RungeKutta4, &system, steps)?),
        ("Munthe-Kaas 4", drift(&MuntheKaas4, &system, steps)?),
    ] {
        report.table.push(format!("{name}, {steps} steps of 10 ms: relative change of momentum {found:.2e}"));
    }
    Ok(())
}

fn drift<I: Integrator<FreeMultibody<f64, 2>>>(
    integrator: &I,
    system: &FreeMultibody<f64, 2>,
    steps: usize,
) -> Result<f64, Failure> {
    let velocity =
        Stacked::new(Vector6::new(0.05, -0.03, 0.04, 0.02, -0.01, 0.015), nalgebra::Vector2::new(0.10, -0.08));
    let mut state =
        GroupState { configuration: Product::new(Pose::identity(), Translation::from([0.3, -0.2])), velocity };
    let still = FreeInput { first: Vector6::zeros(), second: nalgebra::Vector2::zeros() };
    let momentum = |state: &GroupState<Product<Pose<f64>, Translation<f64, 2>>>| {
        let (pose, joints) = (&state.configuration.first, &state.configuration.second.vector);
        let twist = Twist::from(state.velocity.first);
        let spatial = system.tree.spatial_momentum(pose, &twist, joints.as_slice(), state.velocity.second.as_slice());
        spatial.map(|momentum| momentum.to_vector()).map_err(failed)
    };
    let start = momentum(&state)?;
    let mut worst = 0.0_f64;
    for step in 1..=steps {
        state = integrator.step(system, &state, &still, 0.0, 0.01).map_err(failed)?;
        if step % 100 == 0 || step == steps {
            worst = worst.max((momentum(&state)? - start).norm() / start.norm());
        }
    }
    Ok(worst)
}
