//! `ur10e_payload`: drive gains and a grasped payload from the currents of a six-axis arm, empty and loaded.
//!
//! Currents times gains are torques, and a known mass calibrates the gains. Where the noise is decides the answer: the
//! residual (friction no model knows) is in the currents, and least squares that takes the noisy current as a regressor
//! pulls the gains towards zero, and every payload found with them. Errors in variables take it out; the check is a
//! payload identified in the half of the runs that the calibration did not see.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use tumble::robots::shipped;
use tumble_dynamics::InertialParameters;
use tumble_formats::arm::ArmModel;
use tumble_identification::multibody::{
    Drive, GainRegression, JointNuisance, JointTrack, TorqueForm, TreeEstimate, TreeEstimator, TreePart, TreeRecord,
    TreeSample,
};

use crate::Failure;
use crate::measured::{Measured, columns};

pub const SET: &str = "ur10e_payload";
const JOINTS: usize = 6;
const PAYLOAD_KG: f64 = 2.805;
/// What a bathroom scale is off by.
const WEIGHED_TO_KG: f64 = 0.005;
/// Gains that the source of the data found, joint 1 at its bound, N m/A.
const SOURCE: [f64; JOINTS] = [10.0, 10.696, 8.457, 9.003, 9.480, 10.123];
/// Every second sample: what is left out says nothing new of errors that last for seconds.
const EVERY: usize = 2;
/// Residuals are dependent over about this long, s.
const DEPENDENCE_S: f64 = 1.0;

fn samples(path: &Path, smooth_motors: bool) -> Result<Vec<TreeSample>, Failure> {
    let names = [
        "t_s",
        "q1_rad",
        "q2_rad",
        "q3_rad",
        "q4_rad",
        "q5_rad",
        "q6_rad",
        "qd1_rad_s",
        "qd2_rad_s",
        "qd3_rad_s",
        "qd4_rad_s",
        "qd5_rad_s",
        "qd6_rad_s",
        "i1_A",
        "i2_A",
        "i3_A",
        "i4_A",
        "i5_A",
        "i6_A",
    ];
    let rows = columns(path, &names)?;
    let list = |column: usize| rows.iter().map(|row| row[column]).collect::<Vec<f64>>();
    let lists = |first: usize| (first..first + JOINTS).map(list).collect::<Vec<_>>();
    let track =
        JointTrack { times_s: list(0), positions: lists(1), rates: Some(lists(7)), motors: lists(13), smooth_motors };
    let samples = track.on_fixed_base(&Vector3::new(0.0, 0.0, -9.81));
    Ok(samples.map_err(|error| Failure::file(path, error))?.into_iter().step_by(EVERY).collect())
}

/// The arm with every link unknown and a payload on the flange.
fn estimator(arm: &ArmModel, drive: Drive, gain_regression: GainRegression, weighed: bool) -> TreeEstimator {
    let rough = |kg: f64, size_m: f64| {
        InertialParameters::about_com(kg, Vector3::zeros(), Matrix3::identity() * (kg * size_m * size_m))
    };
    let mut parts: Vec<TreePart> =
        (1..=JOINTS).map(|link| TreePart::whole(format!("link{link}"), link, rough(4.0, 0.2))).collect();
    let flange = arm.tool.as_ref().map_or_else(nalgebra::Isometry3::identity, |tool| tool.body_from_frame);
    let mut payload = TreePart::payload("payload", JOINTS, flange, rough(2.0, 0.1));
    payload.weighed_kg = weighed.then_some((PAYLOAD_KG, WEIGHED_TO_KG));
    parts.push(payload);
    let nuisances = JointNuisance::ALL.to_vec();
    let torque = TorqueForm { drive, nuisances, std: None, base_wrench_std: None, gain_regression };
    TreeEstimator { tree: arm.tree.clone(), parts, momentum: None, torque: Some(torque), dependence_s: DEPENDENCE_S }
}

fn identify(
    estimator: &TreeEstimator,
    unloaded: &[TreeSample],
    loaded: &[TreeSample],
) -> Result<TreeEstimate, Failure> {
    let records = [
        TreeRecord { samples: unloaded.to_vec(), grasped: false },
        TreeRecord { samples: loaded.to_vec(), grasped: true },
    ];
    estimator.identify(&records).map_err(|error| Failure::BadInput(format!("{SET}: {error}")))
}

fn gains(estimate: &TreeEstimate) -> [(f64, f64); JOINTS] {
    std::array::from_fn(|joint| {
        estimate.nuisance(&format!("drive gain of joint {}", joint + 1)).unwrap_or((f64::NAN, f64::NAN))
    })
}

/// The same by least squares alone, before bodies are made to exist.
fn unconstrained_gains(estimate: &TreeEstimate) -> [(f64, f64); JOINTS] {
    let layout = estimate.base.layout();
    let with_std = gains(estimate);
    std::array::from_fn(|joint| {
        let name = format!("drive gain of joint {}", joint + 1);
        let index = layout.nuisances().iter().position(|nuisance| nuisance.name == name);
        let column = index.map(|index| layout.nuisance_column(index));
        let functional: Vec<f64> = (0..layout.unknowns()).map(|k| f64::from(u8::from(Some(k) == column))).collect();
        let value = estimate.base.linear_value(&functional).ok().flatten().map_or(f64::NAN, |value| value.value);
        (value, with_std[joint].1)
    })
}

fn payload(estimate: &TreeEstimate) -> (f64, f64) {
    let mass = estimate.body(JOINTS).map_or(f64::NAN, |body| body.mass);
    let std = estimate.body_std(JOINTS).ok().flatten().map_or(f64::NAN, |std| std.mass_kg);
    (mass, std)
}

fn unknown_gains() -> Drive {
    Drive::Current { gain: SOURCE.to_vec(), std: vec![f64::INFINITY; JOINTS] }
}

fn known_gains(gains: &[(f64, f64); JOINTS]) -> Drive {
    let (gain, std) = gains.iter().copied().unzip();
    Drive::Current { gain, std }
}

/// Identifies both; the list names the targets missed.
pub fn run(folder: &Path, json: bool) -> Result<Vec<String>, Failure> {
    let arm = ArmModel::find("ur10e", &shipped()).map_err(|error| Failure::BadInput(error.to_string()))?;
    let [empty_log, full_log] = ["fourier14_unloaded.csv", "fourier14_loaded.csv"].map(|file| folder.join(file));
    let (unloaded, loaded) = (samples(&empty_log, false)?, samples(&full_log, false)?);
    let mut missed = Vec::new();
    let print = |quantity: &str, (estimate, std): (f64, f64), reference: Option<f64>| {
        let sigma = std.is_finite().then_some(std);
        Measured { dataset: SET, file: "both runs", quantity, estimate, sigma, reference }.print(json);
    };
    let mut demand = |holds: bool, what: String| {
        if !holds {
            missed.push(format!("{SET}: {what}"));
        }
    };

    // the source's direction: measured currents as regressors, through the same window as the motion
    let plain = identify(
        &estimator(&arm, unknown_gains(), GainRegression::CurrentAsRegressor, true),
        &samples(&empty_log, true)?,
        &samples(&full_log, true)?,
    )?;
    let plain_gains = unconstrained_gains(&plain);
    for (joint, gain) in plain_gains.iter().enumerate().skip(1) {
        print(&format!("gain {}, current as regressor, N m/A", joint + 1), *gain, Some(SOURCE[joint]));
        let error = gain.0 / SOURCE[joint] - 1.0;
        demand(error.abs() <= 0.04, format!("gain {} is {:.1} % from the source's", joint + 1, 100.0 * error));
    }
    let as_given = plain_gains.map(|(gain, _)| (gain, 0.0));
    let with_plain =
        identify(&estimator(&arm, known_gains(&as_given), GainRegression::default(), false), &unloaded, &loaded)?;
    print("payload with those gains, kg", payload(&with_plain), Some(PAYLOAD_KG));
    let source = SOURCE.map(|gain| (gain, 0.0));
    let with_source =
        identify(&estimator(&arm, known_gains(&source), GainRegression::default(), false), &unloaded, &loaded)?;
    print("payload with the source's gains, kg", payload(&with_source), Some(PAYLOAD_KG));

    // noise where it is
    let fitted =
        identify(&estimator(&arm, unknown_gains(), GainRegression::ErrorsInVariables, true), &unloaded, &loaded)?;
    for (joint, gain) in gains(&fitted).iter().enumerate() {
        print(&format!("gain {}, errors in variables, N m/A", joint + 1), *gain, Some(SOURCE[joint]));
    }
    let halves = |samples: &[TreeSample]| {
        let (first, second) = samples.split_at(samples.len() / 2);
        [first.to_vec(), second.to_vec()]
    };
    let (empty, full) = (halves(&unloaded), halves(&loaded));
    for (seen, other, words) in [(0, 1, "second half"), (1, 0, "first half")] {
        let calibration = identify(
            &estimator(&arm, unknown_gains(), GainRegression::ErrorsInVariables, true),
            &empty[seen],
            &full[seen],
        )?;
        let drive = known_gains(&gains(&calibration));
        let found =
            identify(&estimator(&arm, drive, GainRegression::ErrorsInVariables, false), &empty[other], &full[other])?;
        let (mass, std) = payload(&found);
        print(&format!("payload in the {words}, kg"), (mass, std), Some(PAYLOAD_KG));
        let error = mass - PAYLOAD_KG;
        demand(error.abs() <= 0.05 * PAYLOAD_KG, format!("payload in the {words} is {mass:.3} kg"));
        demand(error.abs() <= 2.0 * std, format!("payload in the {words}: {mass:.3} +- {std:.3} kg does not cover"));
    }
    Ok(missed)
}
