//! Calibration inside the likelihood: values, verdicts, statistics.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::neg_cmp_op_on_partial_ord)]

mod faulty_log;

use faulty_log::{Faulty, judged};
use tumble_identification::nalgebra::Vector3;
use tumble_identification::{LikelihoodEstimate, MaximumLikelihood, Nuisance, Verdict};

fn estimated(faulty: &Faulty, names: &[&str], seed: u64) -> LikelihoodEstimate {
    let nuisances = names.iter().flat_map(|name| Nuisance::named(name).unwrap()).copied().collect();
    let noise = Some(faulty.noise_levels());
    MaximumLikelihood { nuisances, noise, robust: false, ..MaximumLikelihood::default() }
        .estimate(&faulty.record(seed))
        .unwrap()
}

fn show(label: &str, faulty: &Faulty, found: &LikelihoodEstimate) {
    println!("{label}: {} iterations, exchanges {:?}", found.iterations.len(), found.exchanges.iter().map(ToString::to_string).collect::<Vec<_>>());
    println!("   mass {} sigma {}", found.parameters.mass, found.std[0]);
    for estimate in &found.nuisances {
        let (error, std) = judged(found, estimate.nuisance, faulty.truth(estimate.nuisance));
        println!(
            "   {} {:?} error {error:.2e} sigma {std:.2e} ({:.2}) {} x{:.2?}",
            estimate.nuisance, estimate.value, error / std, estimate.verdict, estimate.inflation
        );
    }
}

#[test]
fn explore() {
    for delay_s in [0.0, 0.003, 0.024, 0.1] {
        let faulty = Faulty { delay_s, ..Faulty::sound(30.0) };
        show("delay", &faulty, &estimated(&faulty, &["delay"], 1));
        let faulty = Faulty { all_columns: true, ..faulty };
        show("delay pvwa", &faulty, &estimated(&faulty, &["delay"], 1));
    }
    for lag_s in [0.0, 0.005, 0.1] {
        let faulty = Faulty { lag_s, band_hz: 1.6, ..Faulty::sound(30.0) };
        show("lag", &faulty, &estimated(&faulty, &["actuator-lag"], 1));
        show("lag+delay", &faulty, &estimated(&faulty, &["actuator-lag", "delay"], 1));
        let faulty = Faulty { delay_s: 0.03, all_columns: true, ..faulty };
        show("lag+delay pvwa", &faulty, &estimated(&faulty, &["actuator-lag", "delay"], 1));
    }
    let faulty = Faulty {
        force_scale: Vector3::new(1.0, 1.08, 0.95),
        torque_scale: Vector3::new(1.03, 0.97, 1.02),
        accelerometer_bias: Vector3::new(0.02, -0.01, 0.03),
        accelerometer_scale: Vector3::new(1.05, 1.0, 0.97),
        accelerometer_position: Vector3::new(0.1, -0.05, 0.07),
        all_columns: true,
        ..Faulty::sound(120.0)
    };
    let accelerometer = ["accelerometer-bias", "accelerometer-scale", "accelerometer-position"];
    let plain = Faulty { force_scale: Vector3::repeat(1.0), torque_scale: Vector3::repeat(1.0), ..faulty.clone() };
    show("accelerometer", &plain, &estimated(&plain, &accelerometer, 1));
    show("torque scale+acc", &Faulty { force_scale: Vector3::repeat(1.0), ..faulty.clone() }, &estimated(&Faulty { force_scale: Vector3::repeat(1.0), ..faulty.clone() }, &["torque-scale", accelerometer[0], accelerometer[1], accelerometer[2]], 1));
    show("all six", &faulty, &estimated(&faulty, &["force-scale", "torque-scale"], 1));
    let biased = Faulty {
        bias_torque: Vector3::new(1e-3, -2e-3, 1e-3),
        bias_force: Vector3::new(0.01, 0.02, -0.01),
        table_slope: Vector3::new(2e-3, -1e-3, 0.0),
        ..Faulty::sound(30.0)
    };
    show("bias, slope", &biased, &estimated(&biased, &["bias-wrench", "table-slope"], 1));
    show("no accelerations", &biased, &estimated(&biased, &["bias-wrench", "table-slope", "accelerometer-bias"], 1));
    let everything = Faulty { delay_s: 0.024, lag_s: 0.05, band_hz: 1.6, all_columns: true, force_scale: faulty.force_scale, bias_force: biased.bias_force, bias_torque: biased.bias_torque, table_slope: biased.table_slope, ..plain };
    show("everything", &everything, &estimated(&everything, &["delay", "actuator-lag", "force-scale", "bias-wrench", "table-slope", accelerometer[0], accelerometer[1], accelerometer[2]], 1));
    let _ = Verdict::Identifiable;
}
