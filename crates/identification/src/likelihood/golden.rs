//! The estimator against a log made of formulas alone.
//!
//! Provenance: design/maximum-likelihood.md, section 8 (prototypes/python/ml_golden.py); no random numbers.

use super::*;
use crate::lie::{LieGroup, Pose, Wrench};
use nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector4};

const STEP_S: f64 = 0.016;
const SAMPLES: usize = 1500;

/// Position, attitude, rate, velocity of the origin.
type TrueState = (Vector3<f64>, UnitQuaternion<f64>, Vector3<f64>, Vector3<f64>);

struct Truth {
    body: InertialParameters<f64>,
    record: Vec<MotionSample>,
    /// Poses, rates and origin velocities without noise.
    states: Vec<TrueState>,
}

fn golden_body() -> InertialParameters<f64> {
    let inertia = Matrix3::new(0.160, 0.004, -0.003, 0.004, 0.142, 0.006, -0.003, 0.006, 0.170);
    InertialParameters::about_com(9.41, Vector3::new(0.031, -0.017, 0.052), inertia)
}

fn wrench(k: usize) -> [f64; 6] {
    let t = k as f64 * STEP_S;
    let amplitude = [0.03, 0.03, 0.03, 0.3, 0.3, 0.3];
    let frequency = [0.11, 0.23, 0.17, 0.13, 0.29, 0.19];
    core::array::from_fn(|i| {
        let (a, f, p) = (amplitude[i], core::f64::consts::TAU * frequency[i], i as f64);
        a * (f * t + p).sin() + 0.3 * a * (1.7 * f * t + 2.0 * p).sin()
    })
}

fn noise(i: usize, k: usize) -> f64 {
    let (i, k) = (i as f64, k as f64);
    let angle = k * (1.0 + 0.618_033_988_75 * (i + 1.0)) * 2.399_963_229_728_653 + 0.7 * i * i + 1e-3 * k * k;
    2.0_f64.sqrt() * angle.sin()
}

/// Runge-Kutta about the centre of mass, sixteen parts a step: shares nothing with the flow.
fn log() -> Truth {
    let body = golden_body();
    let (m, c, j) = (body.mass, body.center_of_mass(), body.inertia_about_com());
    let inverse = j.try_inverse().unwrap();
    let field = |x: &[f64; 13], torque: &Vector3<f64>, force: &Vector3<f64>| -> [f64; 13] {
        let (q, w) = (Vector3::new(x[0], x[1], x[2]), Vector3::new(x[4], x[5], x[6]));
        let turn = (w * x[3] + q.cross(&w)) * 0.5;
        let alpha = inverse * (torque - w.cross(&(j * w)));
        // Not normalised in between, as the formula has it.
        let (a, b, d, s) = (x[0], x[1], x[2], x[3]);
        let r = Matrix3::new(
            1.0 - 2.0 * (b * b + d * d),
            2.0 * (a * b - s * d),
            2.0 * (a * d + s * b),
            2.0 * (a * b + s * d),
            1.0 - 2.0 * (a * a + d * d),
            2.0 * (b * d - s * a),
            2.0 * (a * d - s * b),
            2.0 * (b * d + s * a),
            1.0 - 2.0 * (a * a + b * b),
        );
        let f = r * force / m;
        [turn.x, turn.y, turn.z, -0.5 * q.dot(&w), alpha.x, alpha.y, alpha.z, x[10], x[11], x[12], f.x, f.y, f.z]
    };
    let mut x = [0.0; 13];
    x[3] = 1.0;
    x[7..10].copy_from_slice(c.as_slice());
    let (mut record, mut states) = (Vec::new(), Vec::new());
    for k in 0..SAMPLES {
        let u = wrench(k);
        let (tau, f) = (Vector3::new(u[0], u[1], u[2]), Vector3::new(u[3], u[4], u[5]));
        let torque = tau - c.cross(&f);
        let q = UnitQuaternion::new_unchecked(Quaternion::from_vector(Vector4::new(x[0], x[1], x[2], x[3])));
        let part = |i: usize| Vector3::new(x[i], x[i + 1], x[i + 2]);
        let position = part(7) - q * c;
        states.push((position, q, part(4), part(10) - q * part(4).cross(&c)));
        let n = |first: usize, sigma: f64| Vector3::from_fn(|i, _| sigma * noise(first + i, k));
        let turned = q * <UnitQuaternion<f64> as LieGroup>::exp(&n(3, 1e-3));
        record.push(MotionSample {
            time_ns: 16_000_000 * i64::try_from(k).unwrap(),
            world_from_body: Some(Pose::from_parts(Translation3::from(position + n(0, 1e-3)), turned)),
            velocity_origin_world: None,
            rate_body: None,
            acceleration_origin_body: None,
            wrench_body: Some(Wrench::new(tau + n(6, 1e-4), f + n(9, 1e-3))),
            ..MotionSample::default()
        });
        let d = STEP_S / 16.0;
        for _ in 0..16 {
            let add = |x: &[f64; 13], k: &[f64; 13], h: f64| -> [f64; 13] { core::array::from_fn(|i| x[i] + h * k[i]) };
            let k1 = field(&x, &torque, &f);
            let k2 = field(&add(&x, &k1, d / 2.0), &torque, &f);
            let k3 = field(&add(&x, &k2, d / 2.0), &torque, &f);
            let k4 = field(&add(&x, &k3, d), &torque, &f);
            for i in 0..13 {
                x[i] += d / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
            let norm = x[..4].iter().map(|v| v * v).sum::<f64>().sqrt();
            for value in &mut x[..4] {
                *value /= norm;
            }
        }
    }
    Truth { body, record, states }
}

fn known_noise() -> Noise {
    Noise { position_m: 1e-3, attitude_rad: 1e-3, torque_n_m: 1e-4, force_n: 1e-3, ..Noise::default() }
}

fn estimator(samples: usize) -> MaximumLikelihood {
    MaximumLikelihood {
        noise: Some(known_noise()),
        robust: false,
        segment_samples: Some(samples),
        ..MaximumLikelihood::default()
    }
}

fn golden_record(log: &Truth) -> Record {
    Record::try_new(&log.record, WrenchTiming::Held, false).unwrap()
}

fn close(found: &[f64], golden: &[f64], tolerance: f64) {
    assert_eq!(found.len(), golden.len());
    for (f, g) in found.iter().zip(golden) {
        assert!((f - g).abs() <= tolerance * g.abs().max(1e-300), "{found:?} is not {golden:?}");
    }
}

#[test]
fn the_log_is_the_one_meant() {
    let log = log();
    let golden = [
        0.035_388_622_779,
        -0.008_200_357_183,
        -0.010_878_969_423,
        -0.191_690_798_287,
        0.211_480_169_186,
        0.232_637_758_224,
    ];
    close(&wrench(100), &golden, 1e-10);
    close(log.states[1499].0.as_slice(), &[-1.424_682_623_998, 0.421_438_055_338, 0.071_778_349_084], 1e-10);
    close(&[0, 1, 2].map(|i| noise(i, 7)), &[1.221_608_780_7, 0.816_236_665_4, 0.717_000_468_8], 1e-9);
    let found = log.record[700].world_from_body.unwrap().translation.vector;
    close(found.as_slice(), &[-0.444_810_967_324, -0.007_613_412_947, 0.156_608_184_518], 1e-10);
}

#[test]
fn nodes_from_poses() {
    let samples = golden_record(&log());
    let starts: Vec<usize> = (0..SAMPLES).step_by(8).collect();
    let node = nodes::from_poses(&samples, &starts, 0.6, &Vector3::zeros())[10];
    close(node.rate.as_slice(), &[0.013_438_906_055, 0.166_393_045_258, 0.101_998_626_181], 1e-9);
    close(node.center.as_slice(), &[-0.010_297_124_773, -0.025_974_959_065, -0.019_554_381_742], 1e-9);
    close(node.velocity.as_slice(), &[-0.017_299_257_223, -0.035_771_974_897, -0.020_196_166_881], 1e-9);
}

#[test]
fn information_at_the_truth() {
    let log = log();
    let samples = golden_record(&log);
    let c = log.body.center_of_mass();
    let starts: Vec<usize> = (0..SAMPLES).step_by(8).collect();
    let state = |&k: &usize| {
        let (position, q, rate, velocity) = log.states[k];
        flow::State { world_from_body: q, rate, center: position + q * c, velocity: velocity + q * rate.cross(&c) }
    };
    let nodes = starts.iter().map(state).collect();
    let calibration = Calibration::new(&[], &[]);
    let mut chain = Chain::<32>::new(samples, Vector3::zeros(), starts, nodes, &calibration);
    let levels = Levels::of(&known_noise());
    let sweep = chain.sweep(&Coordinates::of(&log.body), &calibration, &levels, None);
    let schur = chain.eliminate(&levels).unwrap();
    close(&[cost(&sweep, &levels)], &[9_003.206_152], 1e-10);
    close(&[sweep.largest_defect], &[1.474_06e-4], 1e-5);
    let golden = [
        5.171_542_587e6,
        1.528_331_646e9,
        4.174_617_562e9,
        3.592_444_431e9,
        1.797_898_567e9,
        3.325_908_335e9,
        3.853_471_979e9,
        1.386_563_171e9,
        1.883_668_450e9,
        4.880_836_067e8,
    ];
    close(schur.information.diagonal().as_slice(), &golden, 1e-9);
    close(&[schur.log_determinant], &[20_858.160_095], 1e-10);
}

#[test]
fn iterations_and_result_with_segments_of_eight() {
    let found = estimator(8).estimate(&log().record).unwrap();
    assert_eq!(found.iterations.len(), 4);
    let costs: Vec<f64> = found.iterations.iter().map(|i| i.cost).collect();
    close(&costs, &[8893.03, 40_480.4, 9000.80, 8994.09], 1e-6);
    let decrements: Vec<f64> = found.iterations.iter().map(|i| i.decrement).collect();
    close(&decrements[..3], &[1.5941e7, 59_479.9, 7.936_39], 1e-5);
    close(&decrements[3..], &[8.3e-7], 1e-2);
    close(&[found.cost], &[8_994.092_759], 1e-10);
    let body = found.parameters;
    close(&[body.mass], &[9.411_068_729_139], 1e-10);
    let center = [0.031_012_247_574, -0.016_995_156_22, 0.051_979_758_999];
    close(body.center_of_mass().as_slice(), &center, 1e-8);
    let j = body.inertia_about_com();
    let found_j = [j[(0, 0)], j[(0, 1)], j[(0, 2)], j[(1, 1)], j[(1, 2)], j[(2, 2)]];
    let golden_j = [
        0.159_993_721_602,
        0.003_992_816_031,
        -0.002_988_900_161,
        0.141_981_159_308,
        0.005_992_483_507,
        0.170_010_087_671,
    ];
    close(&found_j, &golden_j, 1e-8);
    let sigma = [
        4.419_621_865e-4,
        2.775_051e-5,
        1.675_904e-5,
        1.942_048e-5,
        2.629_838e-5,
        1.906_804e-5,
        1.916_806e-5,
        3.589_691e-5,
        2.883_673e-5,
        4.646_846e-5,
    ];
    close(found.std.as_slice(), &sigma, 3e-7);
    close(&[found.std[0]], &sigma[..1], 1e-9);
}

#[test]
fn the_length_of_segments_does_not_matter() {
    let record = log().record;
    let one = estimator(1).estimate(&record).unwrap();
    close(&[one.cost, one.parameters.mass], &[8_994.080_123, 9.411_068_713_043], 1e-10);
    close(&[one.std[0]], &[4.419_897_520e-4], 1e-9);
    let sixteen = estimator(16).estimate(&record).unwrap();
    close(&[sixteen.cost, sixteen.parameters.mass], &[8_994.128_286, 9.411_068_726_086], 1e-10);
}

#[test]
fn the_delay_can_be_estimated_too() {
    let with_delay = MaximumLikelihood { nuisances: vec![Nuisance::Delay], ..estimator(8) };
    let found = with_delay.estimate(&log().record).unwrap();
    // Its first steps take a larger delay out of the inputs: another way to the same optimum.
    close(&[found.parameters.mass], &[9.411_030_737_884], 1e-9);
    let delay = &found.nuisances[0];
    close(&[delay.value.unwrap(), delay.std.unwrap()], &[5.89e-5, 1.32e-4], 5e-3);
}

#[test]
fn evidence_is_the_derivative_of_determinant_and_minimum() {
    let log = log();
    let record = golden_record(&log);
    let starts = record.segments(8, &drive::Passage::default());
    let eta = Coordinates::of(&log.body);
    let nodes = nodes::from_poses(&record, &starts, 0.6, &eta.center);
    let calibration = Calibration::new(&[Nuisance::Delay], &[]);
    let mut chain = Chain::<32>::new(record, Vector3::zeros(), starts, nodes, &calibration);
    let levels = Levels::of(&known_noise());
    for _ in 0..2 {
        chain.sweep(&eta, &calibration, &levels, None);
        let schur = chain.eliminate(&levels).unwrap();
        let step = eta.step(&schur.information, &schur.gradient).unwrap();
        chain.follow(&step);
    }
    chain.sweep(&eta, &calibration, &levels, None);
    let schur = chain.eliminate(&levels).unwrap();
    let found = chain.evidence(&schur, &levels).unwrap();
    println!("{found:?}");
    let mut total = |levels: &Levels| {
        let schur = chain.eliminate(levels).unwrap();
        let diagonal = schur.information.clone().cholesky().unwrap().l().diagonal();
        schur.log_determinant + 2.0 * diagonal.iter().map(|x| x.ln()).sum::<f64>()
    };
    // Derivative by the logarithm of the weight, that is by -2 ln sigma.
    let small: f64 = 1e-4;
    let mut derivative = |change: &dyn Fn(&mut Levels, f64)| {
        let (mut up, mut down) = (levels, levels);
        change(&mut up, small.exp());
        change(&mut down, (-small).exp());
        (total(&down) - total(&up)) / (4.0 * small)
    };
    for group in [0, 1] {
        close(&[derivative(&|levels, factor| levels.measurements[group] *= factor)], &[found.absorbed[group]], 1e-6);
    }
    for i in 0..2 {
        close(&[derivative(&|levels, factor| levels.wrench[i] *= factor)], &[found.wrench_absorbed[i]], 1e-6);
    }
}

#[test]
fn what_is_summed_up_says_the_same_as_what_is_kept() {
    let mut log = log();
    // A gap that is bridged and one that is not.
    log.record.retain(|row| row.time_ns != 16_000_000 * 333 && !(600..650).contains(&(row.time_ns / 16_000_000)));
    let record = golden_record(&log);
    let starts = record.segments(16, &drive::Passage::default());
    let eta = Coordinates::of(&log.body);
    let nodes = nodes::from_poses(&record, &starts, 0.6, &eta.center);
    let calibration = Calibration::new(&[Nuisance::Delay], &[]);
    let mut chain = Chain::<32>::new(record, Vector3::zeros(), starts, nodes, &calibration);
    assert_eq!(chain.record.breaks.len(), 1);
    let levels = Levels::of(&known_noise());
    chain.sweep(&eta, &calibration, &levels, None);
    let kept = chain.eliminate(&levels).unwrap();
    for segments in [1, 25, 40] {
        chain.marginalize(segments, &levels).unwrap();
        let summed = chain.eliminate(&levels).unwrap();
        let scale = kept.information.diagonal().map(|x| 1.0 / x.sqrt());
        let change = (&summed.information - &kept.information).component_mul(&(&scale * scale.transpose()));
        assert!(change.amax() < 1e-7, "{segments}: {change}");
        let pull = |schur: &elimination::Schur| schur.information.clone().cholesky().unwrap().solve(&schur.gradient);
        let moved = (pull(&summed) - pull(&kept)).component_mul(&scale.map(|x| 1.0 / x));
        assert!(moved.amax() < 1e-6 * pull(&kept).component_mul(&scale.map(|x| 1.0 / x)).amax(), "{segments}: {moved}");
        close(&[summed.least().unwrap()], &[kept.least().unwrap()], 1e-7);
    }
}
