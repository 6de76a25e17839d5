//! A base with the golden arm floats freely; the gyroscope and the joint rates are noisy.

use super::tree_part::completed;
use super::{
    BaseParameters, Drive, GainRegression, JointNuisance, JointTrack, LinkInformation, MomentumForm, ParameterLayout,
    TorqueForm, TreeEstimator, TreePart, TreeRecord, TreeSample, UnknownBody, VelocityNoise, with_accelerations,
};
use crate::BodyScale;
use crate::dynamics::{BodyAcceleration, GeneralizedMotion, InertialParameters, Joint, Link, Multibody};
use crate::estimator::Verdict;
use crate::lie::{LieGroup, Pose, Twist, Wrench};
use crate::noise::Gaussian;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

fn tree() -> Multibody<f64> {
    tree_in(1.0, 1.0)
}

/// The tree in units of which so many make a kilogram and a metre.
fn tree_in(mass: f64, length: f64) -> Multibody<f64> {
    let body = |kg: f64, com: [f64; 3], size: f64| {
        let (kg, com, size) = (kg * mass, Vector3::from(com) * length, size * length);
        let shape = Matrix3::from_diagonal(&Vector3::new(1.0, 1.2, 0.9));
        InertialParameters::about_com(kg, com, shape * (kg * size * size))
    };
    let base = InertialParameters::about_com(
        9.58 * mass,
        Vector3::zeros(),
        Matrix3::from_diagonal(&Vector3::new(0.153, 0.143, 0.162)) * (mass * length * length),
    );
    let shoulder = Pose::translation(-0.13 * length, 0.0, -0.13 * length);
    let shoulder = Joint::revolute(-Vector3::y(), shoulder).unwrap();
    let wrist = Joint::revolute(Vector3::z(), Pose::translation(-0.1 * length, 0.0, 0.0)).unwrap();
    Multibody::try_new(
        base,
        vec![
            Link { parent: None, joint: shoulder, body: body(0.3, [-0.05, 0.0, 0.0], 0.05) },
            Link { parent: Some(0), joint: wrist, body: body(0.2, [-0.02, 0.0, 0.0], 0.04) },
        ],
    )
    .unwrap()
}

/// Joint motions given; the base follows from momentum, by small steps of the velocity.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of steps")]
fn float(tree: &Multibody<f64>, momentum: &Wrench<f64>, seconds: f64, step_s: f64, every: usize) -> Vec<TreeSample> {
    let joints = |t: f64| {
        let p =
            [0.8 * (0.9 * t).sin() + 0.3 * (2.1 * t + 0.4).sin(), 0.9 * (1.3 * t + 1.0).sin() + 0.2 * (2.9 * t).sin()];
        let r = [
            0.72 * (0.9 * t).cos() + 0.63 * (2.1 * t + 0.4).cos(),
            1.17 * (1.3 * t + 1.0).cos() + 0.58 * (2.9 * t).cos(),
        ];
        (p.to_vec(), r.to_vec())
    };
    let twist = |pose: &Pose<f64>, t: f64| {
        let (p, r) = joints(t);
        tree.floating_base_twist(&p, &r, &momentum.transformed_by(&LieGroup::inverse(pose))).unwrap()
    };
    let mut pose = Pose::identity();
    let mut samples = Vec::new();
    let count = (seconds / step_s).round() as usize;
    for k in 0..=count {
        let t = k as f64 * step_s;
        if k % every == 0 {
            let (positions, rates) = joints(t);
            samples.push(TreeSample {
                time_s: t,
                world_from_base: pose,
                base_twist: twist(&pose, t),
                positions,
                rates,
                accelerations: None,
                motors: None,
                base_wrench: None,
            });
        }
        // midpoint rule on the group
        let half = pose * Pose::exp(&(twist(&pose, t).to_vector() * (0.5 * step_s)));
        pose *= Pose::exp(&(twist(&half, t + 0.5 * step_s).to_vector() * step_s));
    }
    samples
}

const NOISE: VelocityNoise = VelocityNoise { base_rate_rad_s: 1e-3, base_velocity_m_s: 1e-3, joint_rate: 1e-3 };

fn momentum() -> Wrench<f64> {
    Wrench::new(Vector3::new(0.05, -0.04, 0.06), Vector3::new(0.3, -0.2, 0.25))
}

fn noisy(clean: &[TreeSample], noise: &VelocityNoise, seed: u64) -> Vec<TreeSample> {
    let mut dice = Gaussian::from_seed(seed);
    let disturbed = |sample: &TreeSample| {
        let mut draw = |sigma: f64| sigma * dice.normal();
        let mut sample = sample.clone();
        let angular = Vector3::from_fn(|_, _| draw(noise.base_rate_rad_s));
        sample.base_twist += Twist::new(angular, Vector3::from_fn(|_, _| draw(noise.base_velocity_m_s)));
        sample.rates.iter_mut().for_each(|rate| *rate += draw(noise.joint_rate));
        sample
    };
    clean.iter().map(disturbed).collect()
}

fn payload() -> InertialParameters<f64> {
    let inertia = Matrix3::new(0.02, 0.002, -0.001, 0.002, 0.03, 0.0015, -0.001, 0.0015, 0.025);
    InertialParameters::about_com(2.0, Vector3::new(-0.15, 0.03, 0.05), inertia)
}

fn guess() -> InertialParameters<f64> {
    InertialParameters::about_com(1.0, Vector3::zeros(), Matrix3::identity() * 0.01)
}

fn grasped() -> TreePart {
    TreePart::payload("payload", 2, Pose::translation(-0.05, 0.0, 0.0), guess())
}

fn estimator(parts: Vec<TreePart>, known: Option<Wrench<f64>>) -> TreeEstimator {
    let momentum = Some(MomentumForm { noise: NOISE, known });
    TreeEstimator { tree: tree(), parts, momentum, torque: None, dependence_s: 0.0 }
}

fn carrying() -> Multibody<f64> {
    completed(&tree(), &[grasped()], payload().to_vector().as_slice(), true)
}

/// Squares of the errors of the ten numbers over so many seeds, in terms of their covariance; what judges each estimate.
fn squared_errors(noise: VelocityNoise, seeds: u64, mut judge: impl FnMut(&InertialParameters<f64>)) -> f64 {
    let clean = float(&carrying(), &momentum(), 30.0, 0.005, 4);
    let truth = payload().to_vector();
    let mut estimator = estimator(vec![grasped()], None);
    estimator.momentum = Some(MomentumForm { noise, known: Some(momentum()) });
    let mut squares = 0.0;
    for seed in 0..seeds {
        let records = [TreeRecord { samples: noisy(&clean, &noise, seed), grasped: true }];
        let estimate = estimator.identify(&records).unwrap();
        assert_eq!(estimate.base.rank(), 10);
        let found = estimate.body(0).unwrap();
        judge(&found);
        let error = DVector::from_column_slice((found.to_vector() - truth).as_slice());
        let covariance = estimate.covariance_of(&DMatrix::identity(10, 10)).unwrap().unwrap();
        squares += error.dot(&covariance.lu().solve(&error).unwrap());
    }
    squares
}

#[test]
fn a_payload_from_momentum_has_honest_intervals() {
    let squares = squared_errors(NOISE, 12, |found| {
        assert!((found.mass / payload().mass - 1.0).abs() < 0.02, "{found:?}");
        assert!((found.inertia_about_com() - payload().inertia_about_com()).amax() < 0.02 * 0.02, "{found:?}");
    });
    // chi-square of 120 degrees of freedom: its mean and four of its deviations
    assert!((squares - 120.0).abs() < 4.0 * 240.0_f64.sqrt(), "{squares}");
}

#[test]
fn noise_in_the_regressor_does_not_bias_the_answer() {
    // forty times the noise: a regressor of the measured velocities would draw the body to zero by several deviations
    let loud = VelocityNoise { base_rate_rad_s: 0.04, base_velocity_m_s: 0.04, joint_rate: 0.04 };
    let squares = squared_errors(loud, 12, |_| ());
    assert!((squares - 120.0).abs() < 4.0 * 240.0_f64.sqrt(), "{squares}");
}

/// Base parameters of a fixed arm: the rank of its joints' torques over irregular motions.
fn base_parameters_of_fixed(tree: &Multibody<f64>, gravity: &Vector3<f64>) -> usize {
    let joints = tree.joints();
    let body =
        |link: usize| UnknownBody { name: format!("link{}", link + 1), scale: BodyScale::try_new(1.0, 0.3).unwrap() };
    let layout = ParameterLayout::try_new((0..joints).map(body).collect(), vec![]).unwrap();
    let mut information = LinkInformation::new(layout.unknowns());
    let mut noise = Gaussian::from_seed(7);
    for _ in 0..200 {
        let mut list = || (0..joints).map(|_| noise.normal()).collect::<Vec<f64>>();
        let (positions, rates, accelerations) = (list(), list(), list());
        let motion = GeneralizedMotion {
            base_twist: Twist::zero(),
            base_acceleration: BodyAcceleration {
                angular_acceleration_body: Vector3::zeros(),
                acceleration_origin_body: -gravity,
            },
            positions: &positions,
            rates: &rates,
            accelerations: &accelerations,
        };
        let regressor = tree.torque_regressor(&motion).unwrap();
        for joint in 0..joints {
            let row: Vec<f64> = (1..=joints).flat_map(|body| regressor.block(6 + joint, body).unwrap()).collect();
            information.add_rows(&row, &[0.0]).unwrap();
        }
    }
    BaseParameters::new(&information, &layout).unwrap().rank()
}

fn fixed_chain(joints: &[(Vector3<f64>, Pose<f64>)]) -> Multibody<f64> {
    let link = |(i, (axis, place)): (usize, &(Vector3<f64>, Pose<f64>))| Link {
        parent: i.checked_sub(1),
        joint: Joint::revolute(*axis, *place).unwrap(),
        body: guess(),
    };
    Multibody::try_new(guess(), joints.iter().enumerate().map(link).collect()).unwrap()
}

/// Textbook counts: six for two parallel hinges in a vertical plane, four in a horizontal one, 36 for six axes of which the
/// first is vertical and the second and third are parallel.
#[test]
fn known_counts_of_base_parameters() {
    let (y, z) = (Vector3::y(), Vector3::z());
    let planar = fixed_chain(&[(z, Pose::identity()), (z, Pose::translation(0.4, 0.0, 0.0))]);
    assert_eq!(base_parameters_of_fixed(&planar, &Vector3::new(0.0, -9.81, 0.0)), 6);
    assert_eq!(base_parameters_of_fixed(&planar, &Vector3::new(0.0, 0.0, -9.81)), 4);
    let turned = |x: f64, y: f64, z: f64| Pose::new(Vector3::new(x, y, z), Vector3::y() * std::f64::consts::FRAC_PI_2);
    let six = fixed_chain(&[
        (z, Pose::translation(0.0, 0.0, 0.181)),
        (y, turned(0.0, 0.176, 0.0)),
        (y, Pose::translation(0.0, -0.137, 0.613)),
        (y, turned(0.0, 0.0, 0.571)),
        (z, Pose::translation(0.0, 0.135, 0.0)),
        (y, Pose::translation(0.0, 0.0, 0.12)),
    ]);
    assert_eq!(base_parameters_of_fixed(&six, &Vector3::new(0.0, 0.0, -9.81)), 36);
}

#[test]
fn a_base_and_two_hinges_have_24_base_parameters_with_a_known_momentum_and_23_without() {
    let tree = tree();
    let parts = || {
        let whole = |index: usize| TreePart::whole(format!("body{index}"), index, *tree.body(index).unwrap());
        (0..3).map(whole).collect::<Vec<_>>()
    };
    let records =
        |momentum: &Wrench<f64>| [TreeRecord { samples: float(&tree, momentum, 30.0, 0.005, 10), grasped: false }];
    let rank = |known: Option<Wrench<f64>>, true_momentum: &Wrench<f64>| {
        let estimate = estimator(parts(), known).identify(&records(true_momentum)).unwrap();
        let momenta = if known.is_none() { 6 } else { 0 };
        (estimate.base.rank(), estimate.base.layout().unknowns() - momenta)
    };
    assert_eq!(rank(Some(momentum()), &momentum()), (24, 30));
    // asked for as well, the six momenta are determined up to the lost scale
    let (with_momenta, _) = rank(None, &momentum());
    assert_eq!(with_momenta - 6, 23);
    let (at_rest, _) = rank(Some(Wrench::zero()), &Wrench::zero());
    assert_eq!(at_rest, 23);
}

/// The floating robot with motors that are logged too: accelerations by smoothing, torques with noise and friction.
fn driven(seed: u64) -> Vec<TreeSample> {
    let clean = float(&carrying(), &momentum(), 30.0, 0.01, 1);
    let mut samples = with_accelerations(&clean, &Vector3::zeros()).unwrap();
    let mut noise = Gaussian::from_seed(seed);
    for sample in &mut samples {
        let force = carrying().inverse_dynamics(&sample.motion().unwrap()).unwrap();
        let friction = |rate: f64| 0.02 * rate + 0.01 * rate.signum() + 0.003;
        let motor = |(force, rate): (&f64, &f64)| force + friction(*rate);
        let motors: Vec<f64> = force.joints.iter().zip(&sample.rates).map(motor).collect();
        sample.motors = Some(motors.iter().map(|motor| motor + 2e-3 * noise.normal()).collect());
    }
    samples
}

#[test]
fn a_payload_from_torques_and_from_both() {
    let torque = TorqueForm {
        drive: Drive::Force,
        nuisances: vec![JointNuisance::ViscousFriction, JointNuisance::CoulombFriction, JointNuisance::Offset],
        std: None,
        base_wrench_std: None,
        gain_regression: GainRegression::default(),
    };
    let truth = payload().to_vector();
    let judged = |with_momentum: bool, seed: u64| {
        let mut samples = driven(seed);
        if with_momentum {
            samples = noisy(&samples, &NOISE, seed + 100);
        }
        let mut estimator = estimator(vec![grasped()], Some(momentum()));
        estimator.torque = Some(torque.clone());
        estimator.momentum = estimator.momentum.filter(|_| with_momentum);
        let estimate = estimator.identify(&[TreeRecord { samples, grasped: true }]).unwrap();
        let std = estimate.body_std(0).unwrap().unwrap();
        let found = estimate.body(0).unwrap();
        assert!((found.mass - truth[0]).abs() < 4.0 * std.mass_kg, "{found:?} {std:?}");
        for (name, value) in [("viscous friction", 0.02), ("Coulomb friction", 0.01), ("offset", 0.003)] {
            let (found, std) = estimate.nuisance(&format!("{name} of joint 2")).unwrap();
            assert!((found - value).abs() < 4.0 * std + 1e-4, "{name} {found} +- {std}");
        }
        // the noise of the motors is found
        assert!(estimate.motor_std.iter().all(|std| (std / 2e-3 - 1.0).abs() < 0.15), "{:?}", estimate.motor_std);
        std.mass_kg
    };
    let (alone, both) = (judged(false, 1), judged(true, 2));
    assert!(both < alone, "{both} {alone}");
}

/// A held arm that swings a payload: exact torques with noise, positions alone, rows late and missing.
fn swung(seed: u64) -> Vec<TreeSample> {
    swung_by(&carrying(), seed)
}

fn swung_by(tree: &Multibody<f64>, seed: u64) -> Vec<TreeSample> {
    let mut noise = Gaussian::from_seed(seed);
    let mut track = JointTrack { positions: vec![vec![]; 2], motors: vec![vec![]; 2], ..JointTrack::default() };
    for row in 0..3000 {
        let late = if row > 1200 { 1.7 } else { 0.0 };
        let t = 0.01 * (f64::from(row) + 0.2 * noise.normal().clamp(-2.0, 2.0)) + late;
        let tones = [[(0.8, 0.9, 0.0), (0.3, 2.9, 0.4)], [(0.9, 1.3, 1.0), (0.2, 4.1, 0.0)]];
        let of = |f: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
            tones.iter().map(|tones| tones.iter().map(|(a, w, p)| a * f(*w, w * t + p)).sum()).collect()
        };
        let (positions, rates) = (of(&|_, angle| angle.sin()), of(&|w, angle| w * angle.cos()));
        let accelerations = of(&|w, angle| -w * w * angle.sin());
        let motion = GeneralizedMotion {
            base_twist: Twist::zero(),
            base_acceleration: BodyAcceleration {
                angular_acceleration_body: Vector3::zeros(),
                acceleration_origin_body: Vector3::z() * 9.81,
            },
            positions: &positions,
            rates: &rates,
            accelerations: &accelerations,
        };
        let force = tree.inverse_dynamics(&motion).unwrap();
        track.times_s.push(t);
        for (list, exact) in track.positions.iter_mut().zip(&positions) {
            list.push(exact + 1e-5 * noise.normal());
        }
        for (list, exact) in track.motors.iter_mut().zip(&force.joints) {
            list.push(exact + 0.01 * noise.normal());
        }
    }
    track.on_fixed_base(&(Vector3::z() * -9.81)).unwrap()
}

#[test]
fn a_payload_from_a_held_arm_has_honest_intervals() {
    let torque = TorqueForm {
        drive: Drive::Force,
        nuisances: vec![],
        std: None,
        base_wrench_std: None,
        gain_regression: GainRegression::default(),
    };
    let mut squares = 0.0;
    for seed in 0..12 {
        let mut estimator = estimator(vec![grasped()], None);
        (estimator.momentum, estimator.torque) = (None, Some(torque.clone()));
        let estimate = estimator.identify(&[TreeRecord { samples: swung(seed), grasped: true }]).unwrap();
        let found = estimate.body(0).unwrap();
        let com = found.center_of_mass() - payload().center_of_mass();
        assert!((found.mass - 2.0).abs() < 0.02 && com.amax() < 2e-3, "{found:?}");
        let base = estimate.base.layout();
        assert_eq!(base.unknowns(), 10);
        let error = DVector::from_column_slice((found.to_vector() - payload().to_vector()).as_slice());
        let covariance = estimate.covariance_of(&DMatrix::identity(10, 10)).unwrap().unwrap();
        squares += error.dot(&covariance.lu().solve(&error).unwrap());
    }
    assert!((squares - 120.0).abs() < 4.0 * 240.0_f64.sqrt(), "{squares}");
}

/// A known gain takes the place of torques, an unknown one is found from a weighed payload.
#[test]
fn gains_from_a_weighed_payload() {
    let current = |samples: &mut Vec<TreeSample>| {
        for motors in samples.iter_mut().filter_map(|sample| sample.motors.as_mut()) {
            for (motor, gain) in motors.iter_mut().zip([0.5, 0.8]) {
                *motor /= gain;
            }
        }
    };
    let mut samples = driven(3);
    current(&mut samples);
    let mut part = grasped();
    part.weighed_kg = Some((payload().mass, 1e-3));
    let mut estimator = estimator(vec![part], None);
    estimator.momentum = None;
    estimator.torque = Some(TorqueForm {
        drive: Drive::Current { gain: vec![1.0, 1.0], std: vec![f64::INFINITY; 2] },
        nuisances: vec![JointNuisance::ViscousFriction, JointNuisance::CoulombFriction, JointNuisance::Offset],
        std: None,
        base_wrench_std: None,
        gain_regression: GainRegression::default(),
    });
    let estimate = estimator.identify(&[TreeRecord { samples, grasped: true }]).unwrap();
    for (joint, gain) in [(1, 0.5), (2, 0.8)] {
        let (found, std) = estimate.nuisance(&format!("drive gain of joint {joint}")).unwrap();
        assert!((found - gain).abs() < 4.0 * std && std < 0.05 * gain, "{joint}: {found} +- {std}");
    }
}

/// What an estimator is told and its records: both change with the units.
#[cfg(feature = "testing")]
type OfTree = (TreeEstimator, Vec<TreeRecord>);

#[cfg(feature = "testing")]
struct Told;

#[cfg(feature = "testing")]
impl super::DynEstimator for Told {
    type Record = OfTree;

    fn estimate(&self, (estimator, records): &OfTree) -> Result<super::DynFinding, crate::estimator::EstimatorError> {
        super::DynEstimator::estimate(estimator, records)
    }
}

/// In other units, seen from another inertial frame.
#[cfg(feature = "testing")]
fn told_otherwise(of: &OfTree, units: [f64; 3], world: &Pose<f64>) -> OfTree {
    let [mass, length, time] = units;
    let place = |pose: &Pose<f64>| Pose::from_parts((pose.translation.vector * length).into(), pose.rotation);
    let mut estimator = of.0.clone();
    estimator.tree = tree_in(mass, length);
    for part in &mut estimator.parts {
        part.body_from_part = place(&part.body_from_part);
        let InertialParameters { mass: kg, first_moment, inertia_about_origin } = part.nominal;
        let inertia = inertia_about_origin * (mass * length * length);
        part.nominal = InertialParameters {
            mass: kg * mass,
            first_moment: first_moment * (mass * length),
            inertia_about_origin: inertia,
        };
    }
    let form = estimator.momentum.as_mut().unwrap();
    let VelocityNoise { base_rate_rad_s, base_velocity_m_s, joint_rate } = form.noise;
    form.noise = VelocityNoise {
        base_rate_rad_s: base_rate_rad_s / time,
        base_velocity_m_s: base_velocity_m_s * length / time,
        joint_rate: joint_rate / time,
    };
    let linear = mass * length / time;
    form.known = form.known.map(|p| {
        let seen = p.transformed_by(world);
        Wrench::new(seen.torque * (linear * length), seen.force * linear)
    });
    let sample = |sample: &TreeSample| TreeSample {
        time_s: sample.time_s * time,
        world_from_base: place(&(world * sample.world_from_base)),
        base_twist: Twist::new(sample.base_twist.angular / time, sample.base_twist.linear * (length / time)),
        rates: sample.rates.iter().map(|rate| rate / time).collect(),
        ..sample.clone()
    };
    let record = |record: &TreeRecord| TreeRecord { samples: record.samples.iter().map(sample).collect(), ..*record };
    (estimator, of.1.iter().map(record).collect())
}

#[cfg(feature = "testing")]
#[test]
fn a_payload_on_a_tree_holds_the_laws_of_estimators() {
    use crate::estimator::{Estimator, EstimatorError};
    use crate::laws::{Case, Determined, Retold, check_coverage, check_estimator};
    use nalgebra::{SMatrix, SVector};
    let clean = float(&carrying(), &momentum(), 30.0, 0.005, 4);
    let estimator = estimator(vec![grasped()], Some(momentum()));
    let middle = clean.len() / 2;
    let runs = |samples: &[TreeSample]| {
        let run = |samples: &[TreeSample]| TreeRecord { samples: samples.to_vec(), grasped: true };
        vec![run(&samples[..middle]), run(&samples[middle..])]
    };
    let of = |seed: u64| (estimator.clone(), runs(&noisy(&clean, &NOISE, seed)));
    let whole = of(3);
    let [first, second] = [0, 1].map(|half| (estimator.clone(), vec![whole.1[half].clone()]));
    let exact = (estimator.clone(), runs(&clean));
    let world = Pose::new(Vector3::new(3.0, -2.0, 1.0), Vector3::new(0.4, -0.9, 1.7));
    let units = [[1e3, 1.0, 1.0], [1.0, 1e-2, 1.0], [1.0, 1.0, 1e2]];
    let mut told = vec![("the inertial frame", told_otherwise(&whole, [1.0; 3], &world), [1.0; 3])];
    for (what, units) in ["the unit of mass", "the unit of length", "the unit of time"].into_iter().zip(units) {
        told.push((what, told_otherwise(&whole, units, &Pose::identity()), units));
    }
    let map = |[mass, length, _]: [f64; 3]| {
        let sizes = [mass, mass * length, mass * length * length];
        SMatrix::<f64, 10, 10>::from_diagonal(&SVector::from_fn(|i, _| sizes[[0, 1, 1, 1, 2, 2, 2, 2, 2, 2][i]]))
    };
    let retold: Vec<Retold<'_, OfTree, 10>> =
        told.iter().map(|(what, record, units)| Retold { what, record, map: map(*units), tolerance: 0.02 }).collect();
    let truth = payload().to_vector();
    let case = Case {
        record: &whole,
        halves: Some([&first, &second]),
        exact: Some((&exact, 1e-3)),
        truth,
        magnitudes: BodyScale::of(&truth).unwrap().parameter_magnitudes(),
        sigmas: 4.5,
        retold: &retold,
    };
    let make = |_: &OfTree| -> Result<Box<dyn Estimator<10, Record = OfTree> + Send + Sync>, EstimatorError> {
        Ok(Box::new(Determined(Told)))
    };
    check_estimator(&make, &case).unwrap();
    check_coverage(&make, &mut (4..10).map(|seed| (Box::new(of(seed)), truth)), (0.5, 1.6)).unwrap();
    // One of two unknowns that no momentum tells apart.
    let mut blind = whole.clone();
    blind.0.parts.push(TreePart { name: "again".into(), ..grasped() });
    let broken = check_estimator(&make, &Case { record: &blind, retold: &[], ..case }).unwrap_err();
    assert_eq!(broken.law, "a good record is answered");
}

/// Verdict, and by how many standard deviations the mass is off.
fn judged_payload(estimator: &TreeEstimator, records: &[TreeRecord]) -> (Verdict, f64) {
    let found = estimator.identify(records).unwrap();
    let verdict = estimator.verdict(records, &found).unwrap();
    let apart = found.body_std(0).unwrap().map(|std| (found.body(0).unwrap().mass - payload().mass) / std.mass_kg);
    (verdict, apart.unwrap_or_default())
}

fn carried(samples: Vec<TreeSample>) -> Vec<TreeRecord> {
    vec![TreeRecord { samples, grasped: true }]
}

fn by_torques(nuisances: Vec<JointNuisance>) -> TreeEstimator {
    let torque = TorqueForm {
        drive: Drive::Force,
        nuisances,
        std: None,
        base_wrench_std: None,
        gain_regression: GainRegression::default(),
    };
    let mut estimator = estimator(vec![grasped()], None);
    (estimator.momentum, estimator.torque) = (None, Some(torque));
    estimator
}

/// Motors of a joint number and time, s, otherwise.
fn with_motors(mut records: Vec<TreeRecord>, change: impl Fn(f64, usize, f64) -> f64) -> Vec<TreeRecord> {
    for sample in records.iter_mut().flat_map(|record| &mut record.samples) {
        let time_s = sample.time_s;
        for (joint, motor) in sample.motors.iter_mut().flatten().enumerate() {
            *motor = change(*motor, joint, time_s);
        }
    }
    records
}

const FRICTION: [JointNuisance; 3] =
    [JointNuisance::ViscousFriction, JointNuisance::CoulombFriction, JointNuisance::Offset];

#[test]
fn healthy_records_of_trees_are_identified() {
    let clean = float(&carrying(), &momentum(), 30.0, 0.005, 4);
    for seed in 0..2 {
        let both =
            vec![TreeRecord { samples: swung_by(&tree(), seed + 9), grasped: false }, carried(swung(seed)).remove(0)];
        for (name, estimator, records) in [
            ("momentum", estimator(vec![grasped()], Some(momentum())), carried(noisy(&clean, &NOISE, seed))),
            ("held", by_torques(vec![]), carried(swung(seed))),
            ("held, empty and loaded", by_torques(vec![]), both),
            ("driven", by_torques(FRICTION.to_vec()), carried(driven(seed))),
        ] {
            let (verdict, apart) = judged_payload(&estimator, &records);
            println!("{name} {seed}: {verdict:?}, mass {apart:.1} sigma off");
            assert!(verdict.is_identified() && apart.abs() < 4.0, "{name} {seed}: {verdict:?}, {apart}");
        }
    }
}

/// Each before was an answer with a small sigma.
#[test]
fn planted_trouble_of_trees_is_not_identified() {
    let clean = float(&carrying(), &momentum(), 30.0, 0.005, 4);
    let mut faster = noisy(&clean, &NOISE, 1);
    faster.iter_mut().flat_map(|sample| &mut sample.rates).for_each(|rate| *rate *= 1.05);
    let loaded = swung(1);
    let half_s = 0.5 * loaded.last().unwrap().time_s;
    let both = vec![
        TreeRecord { samples: swung_by(&tree(), 2), grasped: false },
        TreeRecord { samples: loaded.clone(), grasped: true },
    ];
    let cases = [
        ("torques scaled", by_torques(vec![]), with_motors(both.clone(), |motor, _, _| 1.1 * motor)),
        (
            "one joint's torque scaled",
            by_torques(FRICTION.to_vec()),
            with_motors(both, |m, j, _| if j == 0 { 1.05 * m } else { m }),
        ),
        ("friction untold", by_torques(vec![]), carried(driven(1))),
        ("torques reversed", by_torques(vec![]), with_motors(carried(loaded.clone()), |motor, _, _| -motor)),
        ("rates read too fast", estimator(vec![grasped()], Some(momentum())), carried(faster)),
        (
            "torques that sink",
            by_torques(FRICTION.to_vec()),
            with_motors(carried(loaded), |motor, _, time_s| if time_s > half_s { 0.95 * motor } else { motor }),
        ),
    ];
    let mut missed = Vec::new();
    for (name, estimator, records) in cases {
        let (verdict, apart) = judged_payload(&estimator, &records);
        println!("{name}: {verdict:?}, mass {apart:.1} sigma off");
        if verdict.is_identified() {
            missed.push(name);
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}
