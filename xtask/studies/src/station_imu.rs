//! `real-data`, set `astrobee_iss_imu_poses`: what the log of a robot on the station shows of its own sensors.
//!
//! Raw rates and accelerations in axes of the unit beside poses of a camera, 5 a second: age of the poses, bias of the gyroscope, levels of
//! the poses, by [`check`], which is told neither of the axes nor of the lever arm. The unit's filtered topic against the raw one: delays.

use std::path::Path;

use nalgebra::{Quaternion, SVector, Translation3, UnitQuaternion, Vector3};
use tumble_identification::sensing::{Found, SensingCheck, StreamName, check};
use tumble_identification::synchronize::{Signals, delay};
use tumble_identification::{MotionSample, WrenchTiming};
use tumble_lie::Pose;

use crate::Failure;
use crate::measured::{Measured, columns};

/// Name of the set and of its folder.
pub const SET: &str = "astrobee_iss_imu_poses";
const POSES: &str = "poses_first_50s.csv";
const RAW: &str = "imu_raw_first_50s.csv";
const FILTERED: &str = "imu_filtered_first_50s.csv";
const UNIT: [&str; 7] = ["t_s", "wx", "wy", "wz", "ax", "ay", "az"];
/// Interval of the unit's topic, s.
const INTERVAL_S: f64 = 0.016;
/// Age of the poses, s, and how far from it the answer may be.
const AGE_S: (f64, f64) = (0.062, 0.003);
/// Bias of the gyroscope over the whole flight, axes of the unit, rad/s, and how far from it. About y these 50 s show another one, and their
/// halves differ from each other by 0.8 mrad/s: the slow error of the poses looks like a bias. There the standard deviation must cover it.
const BIAS: [(f64, f64); 3] = [(-0.0001, 3e-4), (0.0021, 0.0), (0.0003, 3e-4)];
/// Delay of the filtered topic behind the raw one, s, and how far from it: rate, acceleration.
const FILTER_S: [(&str, f64, f64); 2] = [("filter_rate_s", 0.110, 0.008), ("filter_acceleration_s", 0.245, 0.015)];
/// Levels of the poses: the least and the most that was measured; within a factor.
const LEVELS: [(&str, f64, f64); 3] = [
    ("position_white_m", 0.75e-3, 1.5e-3),
    ("attitude_white_rad", 0.4e-3, 0.6e-3),
    ("attitude_wander_rad", 9e-3, 14e-3),
];
const FACTOR: f64 = 1.5;

type Unit = Vec<[f64; 7]>;

/// Processes the set in `folder`; the targets missed, in words.
pub fn run(folder: &Path, json: bool) -> Result<Vec<String>, Failure> {
    let raw: Unit = columns(&folder.join(RAW), &UNIT)?;
    let filtered: Unit = columns(&folder.join(FILTERED), &UNIT)?;
    let poses = columns(&folder.join(POSES), &["t_s", "px_m", "py_m", "pz_m", "qx", "qy", "qz", "qw"])?;
    let found = match check(&log(&raw, &poses), WrenchTiming::Held) {
        Ok(found) => found,
        Err(error) => return Ok(vec![format!("{SET}: {error}")]),
    };
    let mut missed = Vec::new();
    let mut tell = |quantity: &str, found: Option<Found>, reference: f64, within: &dyn Fn(&Found) -> bool| {
        let Some(found) = found else {
            missed.push(format!("{SET}: {quantity} is not told"));
            return;
        };
        let Found { value, sigma } = found;
        Measured { dataset: SET, file: RAW, quantity, estimate: value, sigma: Some(sigma), reference: Some(reference) }
            .print(json);
        if !within(&found) {
            missed.push(format!("{SET}: {quantity} {value:.5} +- {sigma:.5}, reference {reference}"));
        }
    };
    let age = found.stream(StreamName::Pose).and_then(|s| s.offset_s);
    tell("age_of_poses_s", age, AGE_S.0, &|f| {
        (f.value - AGE_S.0).abs() <= AGE_S.1.min(2.0 * f.sigma.max(0.5e-3).hypot(0.6e-3))
    });
    let bias = found.stream(StreamName::Rate).and_then(|s| s.bias).unwrap_or_default();
    for ((quantity, bias), (reference, far)) in
        ["bias_x_rad_s", "bias_y_rad_s", "bias_z_rad_s"].into_iter().zip(bias).zip(BIAS)
    {
        let within = |f: &Found| (f.value - reference).abs() <= if far > 0.0 { far } else { 2.0 * f.sigma };
        tell(quantity, bias, reference, &within);
    }
    for ((quantity, least, most), level) in LEVELS.into_iter().zip(levels(&found)) {
        let middle = (least * most).sqrt();
        tell(quantity, level, middle, &|f| (least / FACTOR..=most * FACTOR).contains(&f.value));
    }
    for ((quantity, reference, far), first) in FILTER_S.into_iter().zip([1, 4]) {
        tell(quantity, filter(&raw, &filtered, first), reference, &|f| (f.value - reference).abs() <= far);
    }
    Ok(missed)
}

fn levels(found: &SensingCheck) -> [Option<Found>; 3] {
    let pose = found.pose.unwrap_or_default();
    [pose.position_white_m, pose.attitude_white_rad, pose.attitude_wander_rad]
}

#[allow(clippy::cast_possible_truncation, reason = "stamps of a minute")]
fn nanoseconds(t_s: f64) -> i64 {
    (t_s * 1e9).round() as i64
}

/// Rows of the unit and rows of the poses, in order of time.
fn log(unit: &Unit, poses: &[[f64; 8]]) -> Vec<MotionSample> {
    let measured = unit.iter().map(|[t, wx, wy, wz, ax, ay, az]| MotionSample {
        time_ns: nanoseconds(*t),
        rate_body: Some(Vector3::new(*wx, *wy, *wz)),
        acceleration_origin_body: Some(Vector3::new(*ax, *ay, *az)),
        ..MotionSample::default()
    });
    let seen = poses.iter().map(|[t, px, py, pz, qx, qy, qz, qw]| MotionSample {
        time_ns: nanoseconds(*t),
        world_from_body: Some(Pose::from_parts(
            Translation3::new(*px, *py, *pz),
            UnitQuaternion::from_quaternion(Quaternion::new(*qw, *qx, *qy, *qz)),
        )),
        ..MotionSample::default()
    });
    let mut rows: Vec<MotionSample> = measured.chain(seen).collect();
    rows.sort_by_key(|row| row.time_ns);
    rows
}

/// Three columns from `first` on, every [`INTERVAL_S`] from `start_s` on, straight between rows.
fn evenly(rows: &Unit, first: usize, start_s: f64, count: usize) -> Vec<SVector<f64, 3>> {
    (0..count)
        .filter_map(|k| {
            let t = start_s + INTERVAL_S * k as f64;
            let after = rows.partition_point(|row| row[0] <= t);
            let (a, b) = (rows.get(after.checked_sub(1)?)?, rows.get(after)?);
            let share = (t - a[0]) / (b[0] - a[0]);
            Some(SVector::from_fn(|i, _| a[first + i] + (b[first + i] - a[first + i]) * share))
        })
        .collect()
}

/// Delay of the filtered columns behind the raw ones; their axes differ by what a linear map makes good.
fn filter(raw: &Unit, filtered: &Unit, first: usize) -> Option<Found> {
    let (start, end) = (filtered.first()?[0].max(raw.first()?[0]), filtered.last()?[0].min(raw.last()?[0]));
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a minute")]
    let count = ((end - start) / INTERVAL_S).max(0.0) as usize;
    let signals = Signals {
        step_s: INTERVAL_S,
        input: evenly(raw, first, start, count),
        input_offset_s: 0.0,
        output: evenly(filtered, first, start, count),
        covariates: vec![SVector::<f64, 0>::zeros(); count],
        correlation_length: 30,
    };
    let found = delay(&signals, 0.5).ok()?;
    Some(Found { value: found.delay_s, sigma: found.sigma_s })
}
