//! What was put into simulated streams is found again, and what they do not tell is not told.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "times of a minute")]

use super::{Found, SensingCheck, StreamName, check};
use crate::WrenchTiming;
use crate::lie::{LieGroup, Pose};
use crate::motion::MotionSample;
use crate::noise::Gaussian;
use crate::sensing::{Delay, Level, Sensing};
use core::f64::consts::{FRAC_PI_2, TAU};
use nalgebra::{Translation3, UnitQuaternion, Vector3};

const INTERVAL_S: f64 = 0.016;
const BIAS: [f64; 3] = [2e-3, -1e-3, 1.4e-3];
const WHITE: [f64; 4] = [1e-3, 5e-4, 1e-3, 5e-3];
const LEVER_M: Vector3<f64> = Vector3::new(0.04, 0.02, -0.01);

/// Streams: poses every tenth of a second, the unit and the velocity at 62.5 Hz.
#[derive(Clone, Copy)]
struct Streams {
    duration_s: f64,
    age_s: f64,
    gain: f64,
    /// Position, m, and attitude, rad.
    wander: [f64; 2],
    wander_time_s: f64,
    moving: bool,
    planar: bool,
    uneven: bool,
}

const STREAMS: Streams = Streams {
    duration_s: 40.0,
    age_s: 0.062,
    gain: 1.0,
    wander: [0.0; 2],
    wander_time_s: 3.0,
    moving: true,
    planar: false,
    uneven: false,
};

impl Streams {
    fn record(&self, seed: u64) -> Vec<MotionSample> {
        let mut dice = Gaussian::from_seed(seed);
        let size = if self.moving { 1.0 } else { 0.0 };
        let waves: Vec<[f64; 3]> = (0..12)
            .map(|_| [size * (0.05 + 0.2 * dice.uniform()), 0.3 + 1.5 * dice.uniform(), TAU * dice.uniform()])
            .collect();
        let wave = |i: usize, t: f64| waves[i][0] * (waves[i][1] * t + waves[i][2]).sin();
        let slope = |i: usize, t: f64, order: i32| {
            waves[i][0] * waves[i][1].powi(order) * (waves[i][1] * t + waves[i][2] + f64::from(order) * FRAC_PI_2).sin()
        };
        let (flat, about) = if self.planar { ([1.0, 1.0, 0.0], [0.0, 0.0, 1.0]) } else { ([1.0; 3], [1.0; 3]) };
        let (flat, about) = (Vector3::from(flat), Vector3::from(about));
        let rate = |t: f64| Vector3::from_fn(|i, _| about[i] * (wave(2 * i, t) + wave(2 * i + 1, t)));
        let turning = |t: f64| Vector3::from_fn(|i, _| about[i] * (slope(2 * i, t, 1) + slope(2 * i + 1, t, 1)));
        let moved = |t: f64, order: i32| Vector3::from_fn(|i, _| flat[i] * 2.0 * slope(6 + 2 * i, t, order));
        let fine_s = 0.002;
        let mut attitudes = vec![UnitQuaternion::identity()];
        for k in 0..((self.duration_s + 1.0) / fine_s) as usize {
            let by: UnitQuaternion<f64> = LieGroup::exp(&(rate(fine_s * (k as f64 + 0.5)) * fine_s));
            attitudes.push(attitudes[k] * by);
        }
        let attitude = |t: f64| {
            let k = (t / fine_s) as usize;
            let by: UnitQuaternion<f64> = LieGroup::exp(&(rate(t) * (t - fine_s * k as f64)));
            attitudes[k] * by
        };
        let mut noise = |sigma: f64| Vector3::from_fn(|_, _| sigma * dice.normal());
        let mut slow = self.wander.map(&mut noise);
        let (mut t, mut last, mut next_pose) = (0.5, 0.5, 0.5);
        let mut record = Vec::new();
        let mut places = Gaussian::from_seed(seed);
        while t < self.duration_s {
            let mut row = MotionSample { time_ns: (t * 1e9) as i64, ..MotionSample::default() };
            if t >= next_pose {
                next_pose = t + 0.095;
                let stays = (-(t - last) / self.wander_time_s).exp();
                last = t;
                for (slow, sigma) in slow.iter_mut().zip(self.wander) {
                    *slow = *slow * stays + noise(sigma * (1.0 - stays * stays).sqrt());
                }
                let position = moved(t - self.age_s, 0) + (slow[0] + noise(WHITE[0])).component_mul(&flat);
                let error: UnitQuaternion<f64> = LieGroup::exp(&(slow[1] + noise(WHITE[1])).component_mul(&about));
                let seen = attitude(t - self.age_s) * error;
                row.world_from_body = Some(Pose::from_parts(Translation3::from(position), seen));
            }
            row.velocity_origin_world = Some(moved(t - self.age_s, 1) + noise(2e-3).component_mul(&flat));
            let biased = Vector3::from(BIAS) + noise(WHITE[2]);
            row.rate_body = Some(rate(t) * self.gain + biased.component_mul(&about));
            let felt = attitude(t).conjugate() * moved(t, 2) + turning(t).cross(&LEVER_M);
            row.acceleration_origin_body =
                Some((felt + Vector3::from(BIAS) * 5.0 + noise(WHITE[3])).component_mul(&flat));
            record.push(row);
            t += INTERVAL_S * if self.uneven { 0.75 + 0.5 * places.uniform() } else { 1.0 };
        }
        record
    }

    fn found(&self, seed: u64) -> SensingCheck {
        check(&self.record(seed), WrenchTiming::Held).unwrap()
    }
}

fn age(found: &SensingCheck, name: StreamName) -> Found {
    found.stream(name).and_then(|s| s.offset_s).unwrap()
}

/// Share of numbers within two standard deviations, mean of the square of error over standard deviation, largest of them.
fn coverage(name: &str, numbers: &[(Found, f64)]) {
    let z: Vec<f64> = numbers.iter().map(|(found, truth)| ((found.value - truth) / found.sigma).abs()).collect();
    let n = z.len() as f64;
    let share = z.iter().filter(|z| **z < 2.0).count() as f64 / n;
    let worst = z.iter().fold(0.0_f64, |most, z| most.max(*z));
    assert!(
        numbers.len() >= 40 && share >= 0.85 && worst < 5.0,
        "{name}: {share} of {n} within 2 sigma, worst {worst}"
    );
    let mean_square = z.iter().map(|z| z * z).sum::<f64>() / n;
    assert!(mean_square > 0.1, "{name}: standard deviations too wide, {mean_square}");
}

#[test]
fn standard_deviations_hold_over_fresh_seeds() {
    let all: Vec<SensingCheck> = (0..40).map(|seed| STREAMS.found(5000 + seed)).collect();
    let each = |of: &dyn Fn(&SensingCheck) -> Option<Found>, truth: f64| {
        all.iter().filter_map(|c| of(c).map(|f| (f, truth))).collect::<Vec<_>>()
    };
    coverage("age of the poses", &each(&|c| c.stream(StreamName::Pose)?.offset_s, 0.062));
    coverage("age of the velocities", &each(&|c| c.stream(StreamName::Velocity)?.offset_s, 0.062));
    coverage("age of the accelerations", &each(&|c| c.stream(StreamName::Acceleration)?.offset_s, 0.0));
    for axis in 0..3 {
        coverage("bias", &each(&|c| c.stream(StreamName::Rate)?.bias?[axis], BIAS[axis]));
        coverage("gain", &each(&|c| c.stream(StreamName::Rate)?.gain?[axis], 1.0));
        coverage(
            "bias of accelerations",
            &each(&|c| c.stream(StreamName::Acceleration)?.bias?[axis], 5.0 * BIAS[axis]),
        );
        coverage("gain of accelerations", &each(&|c| c.stream(StreamName::Acceleration)?.gain?[axis], 1.0));
        coverage("lever arm", &each(&|c| Some(c.lever_arm_m?[axis]), LEVER_M[axis]));
    }
    coverage("white position", &each(&|c| c.pose?.position_white_m, WHITE[0]));
    coverage("white attitude", &each(&|c| c.pose?.attitude_white_rad, WHITE[1]));
    coverage("white rate", &each(&|c| c.stream(StreamName::Rate)?.white, WHITE[2]));
    coverage("white acceleration", &each(&|c| c.stream(StreamName::Acceleration)?.white, WHITE[3]));
}

#[test]
fn slow_errors_are_found_and_none_where_there_are_none() {
    let wandering = Streams { wander: [0.01, 0.005], duration_s: 60.0, ..STREAMS };
    let mut told = 0;
    for seed in 0..10 {
        let pose = wandering.found(6000 + seed).pose.unwrap();
        for (found, truth) in [(pose.position_wander_m, 0.01), (pose.attitude_wander_rad, 0.005)] {
            let Some(found) = found else { continue };
            told += 1;
            assert!((found.value - truth).abs() < 4.0 * found.sigma, "{found:?} of {truth}");
            assert!(found.value > 0.4 * truth && found.value < 3.0 * truth, "{found:?} of {truth}");
        }
        let white = STREAMS.found(7000 + seed).pose.unwrap().attitude_wander_rad.unwrap();
        assert!(white.value == 0.0 && white.sigma < 1e-3, "{white:?}");
    }
    assert!(told >= 16, "{told} of 20");
}

#[test]
fn planted_errors_are_found() {
    let found = Streams { age_s: -0.03, gain: 1.03, uneven: true, ..STREAMS }.found(8000);
    let late = age(&found, StreamName::Pose);
    assert!((late.value + 0.03).abs() < 4.0 * late.sigma && late.sigma < 1e-3, "{late:?}");
    for gain in found.stream(StreamName::Rate).and_then(|s| s.gain).unwrap() {
        let gain = gain.unwrap();
        assert!((gain.value - 1.03).abs() < 4.0 * gain.sigma && gain.sigma < 3e-3, "{gain:?}");
    }
}

#[test]
fn a_log_at_rest_tells_levels_and_no_ages() {
    let found = Streams { moving: false, ..STREAMS }.found(8100);
    for stream in &found.streams {
        assert!(Some(stream.stream) == found.reference || stream.offset_s.is_none(), "{stream:?}");
        assert_eq!(stream.gain.iter().flatten().flatten().count(), 0, "{stream:?}");
    }
    let white = found.pose.unwrap().position_white_m.unwrap();
    assert!((white.value - WHITE[0]).abs() < 4.0 * white.sigma, "{white:?}");
    assert!(found.tells());
}

#[test]
fn missing_streams_are_not_needed() {
    let record = STREAMS.record(8200);
    let without = |change: fn(&mut MotionSample)| {
        let mut record = record.clone();
        record.iter_mut().for_each(change);
        check(&record, WrenchTiming::Held).unwrap()
    };
    let poses_and_rates = without(|row| (row.velocity_origin_world, row.acceleration_origin_body) = (None, None));
    assert_eq!(poses_and_rates.streams.len(), 2);
    assert!((age(&poses_and_rates, StreamName::Pose).value - 0.062).abs() < 1e-3);
    let no_rates = without(|row| row.rate_body = None);
    assert_eq!(no_rates.reference, None);
    assert!(no_rates.streams.iter().all(|s| s.offset_s.is_none()));
    assert!(no_rates.pose.unwrap().position_white_m.is_some());
    let no_poses = without(|row| row.world_from_body = None);
    assert!(no_poses.pose.is_none() && no_poses.stream(StreamName::Rate).unwrap().white.is_some());
    assert!(check(&record[..1], WrenchTiming::Held).is_err());
    let nothing = vec![MotionSample::default(); 3];
    assert!(!check(&nothing, WrenchTiming::Held).unwrap().tells());
}

#[test]
fn motion_in_a_plane_tells_what_it_can() {
    let found = Streams { planar: true, ..STREAMS }.found(8300);
    let late = age(&found, StreamName::Pose);
    assert!((late.value - 0.062).abs() < 4.0 * late.sigma && late.sigma < 3e-3, "{late:?}");
    let rate = found.stream(StreamName::Rate).unwrap();
    let bias = rate.bias.unwrap()[2].unwrap();
    assert!((bias.value - BIAS[2]).abs() < 4.0 * bias.sigma, "{bias:?}");
    // Axes that are exact in the poses and noisy in the rates measure nothing.
    let mut record = Streams { planar: true, ..STREAMS }.record(8301);
    let mut dice = Gaussian::from_seed(5);
    for rate in record.iter_mut().filter_map(|row| row.rate_body.as_mut()) {
        (rate.x, rate.y) = (1e-3 * dice.normal(), 1e-3 * dice.normal());
    }
    for acceleration in record.iter_mut().filter_map(|row| row.acceleration_origin_body.as_mut()) {
        acceleration.z = 5e-3 * dice.normal();
    }
    let found = check(&record, WrenchTiming::Held).unwrap();
    let late = age(&found, StreamName::Pose);
    assert!((late.value - 0.062).abs() < 4.0 * late.sigma && late.sigma > 1e-5, "{late:?}");
    let rate = found.stream(StreamName::Rate).unwrap();
    let bias = rate.bias.unwrap();
    assert!(rate.gain.unwrap()[0].is_none() && bias[0].is_none() && found.alignment.is_none(), "{rate:?}");
    let bias = bias[2].unwrap();
    assert!((bias.value - BIAS[2]).abs() < 4.0 * bias.sigma && bias.sigma < 1e-3, "{bias:?}");
    assert!(found.stream(StreamName::Acceleration).unwrap().gain.unwrap()[2].is_none());
    let late = age(&found, StreamName::Acceleration);
    assert!(late.value.abs() < 4.0 * late.sigma && late.sigma > 1e-5, "{late:?}");
}

#[test]
fn what_is_stated_and_not_so_is_contradicted() {
    let found = STREAMS.found(8400);
    let mut stated = Sensing::default();
    assert_eq!(found.contradictions(Some(&stated)), []);
    assert_eq!(found.contradictions(None), []);
    (stated.pose_delay, stated.rate.delay) = (Delay::NONE, Delay::NONE);
    stated.position.white = Level::Known(0.02);
    stated.acceleration.bias_sigma = 1e-4;
    let said = found.contradictions(Some(&stated));
    for key in ["pose_delay", "position.white", "acceleration.bias_sigma"] {
        let one = said.iter().find(|c| c.key == key).unwrap();
        assert!(one.to_string().contains(key) && one.found.sigma > 0.0, "{one}");
    }
}

/// Whoever takes gravity out by an attitude that wanders leaves what the wander makes of it, on a table and in free flight; at rest, where accelerations
/// are those of the wander.
#[test]
fn gravity_that_the_publisher_added_is_told_from_what_its_attitude_makes_of_it() {
    for (planar, seed) in [(false, 8500), (false, 8501), (true, 8502), (true, 8503)] {
        let (clean, mut dice) = (Streams { planar, moving: false, ..STREAMS }.record(seed), Gaussian::from_seed(seed));
        let mut slow = dice.vector(0.01);
        let errors: Vec<Vector3<f64>> = clean
            .iter()
            .map(|_| {
                let stays = (-INTERVAL_S / 5.0).exp();
                slow = slow * stays + dice.vector(0.01 * (1.0 - stays * stays).sqrt());
                slow
            })
            .collect();
        let published = |gravity_m_s2: f64| {
            let mut record = clean.clone();
            for (row, error) in record.iter_mut().zip(&errors) {
                let (Some(pose), Some(felt)) = (&mut row.world_from_body, &mut row.acceleration_origin_body) else {
                    continue;
                };
                let up = pose.rotation.inverse_transform_vector(&Vector3::z());
                pose.rotation *= <UnitQuaternion<f64> as LieGroup>::exp(error);
                *felt += (pose.rotation.inverse_transform_vector(&Vector3::z()) - up) * gravity_m_s2;
            }
            check(&record, WrenchTiming::Held).unwrap()
        };
        for gravity_m_s2 in [0.0, 9.8, -1.6] {
            let found = published(gravity_m_s2);
            let told = found.gravity_added_m_s2.unwrap();
            assert!((told.value - gravity_m_s2).abs() < 4.0 * told.sigma && told.sigma < 0.3, "{seed}: {told:?}");
            let key = "gravity_added_world_m_s2";
            let contradicts = |stated_m_s2: f64| {
                let gravity_added_world_m_s2 = Some([0.0, 0.0, stated_m_s2]);
                let said = found.contradictions(Some(&Sensing { gravity_added_world_m_s2, ..Sensing::default() }));
                said.iter().any(|c| c.key == key)
            };
            assert!(!contradicts(gravity_m_s2) && contradicts(gravity_m_s2 + 5.0), "{seed}: {told:?}");
        }
    }
}
