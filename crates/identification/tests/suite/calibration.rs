//! Calibration inside the likelihood: values, verdicts, statistics.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::neg_cmp_op_on_partial_ord)]

use crate::faulty_log::{Faulty, judged};
use tumble_identification::nalgebra::Vector3;
use tumble_identification::{LikelihoodEstimate, MaximumLikelihood, Nuisance, Quantity, Verdict};

fn estimated(faulty: &Faulty, names: &[&str], seed: u64) -> LikelihoodEstimate {
    let nuisances = names.iter().flat_map(|name| Nuisance::named(name).unwrap()).copied().collect();
    let noise = Some(faulty.noise_levels());
    MaximumLikelihood { nuisances, noise, robust: false, ..MaximumLikelihood::default() }
        .estimate(&faulty.record(seed))
        .unwrap()
}

/// Runs on fresh seeds: mean squares of normalised errors of the nuisances and of the mass in their bands.
fn statistics(faulty: &Faulty, names: &[&str], runs: u64) -> f64 {
    let (mut squares, mut count, mut largest, mut mass) = (0.0, 0.0, 0.0_f64, 0.0);
    for seed in 0..runs {
        let found = estimated(faulty, names, 1000 + seed);
        for estimate in found.nuisances.iter().filter(|found| found.nuisance != Nuisance::AccelerationDelay) {
            assert_eq!(estimate.verdict, Verdict::Identifiable, "{}", estimate.nuisance);
            let (error, std) = judged(&found, estimate.nuisance, faulty.truth(estimate.nuisance));
            squares += (error / std).powi(2);
            count += 1.0;
            largest = largest.max(error.abs());
        }
        mass += ((found.parameters.mass / faulty.body.mass).ln() / found.std[0]).powi(2) / runs as f64;
    }
    // Chi-square by Wilson and Hilferty, both ends of 99.9 %. Axes of one kind count as one: three scales against the other
    // half of the wrench have most of their error in common.
    let independent = runs as f64 * names.len() as f64;
    let bound = |n: f64, z: f64| (1.0 - 2.0 / (9.0 * n) + z * (2.0 / (9.0 * n)).sqrt()).powi(3);
    let mean = squares / count;
    println!("{names:?}: mean square {mean:.3} of {count}, mass {mass:.3}, largest error {largest:.2e}");
    assert!(mean > bound(independent, -3.29).max(0.0) && mean < bound(independent, 3.29), "{names:?}: {mean}");
    assert!(mass < bound(runs as f64, 3.29), "{names:?}: mass {mass}");
    largest
}

#[test]
fn delays_of_any_length() {
    for delay_s in [0.003, 0.024, 0.1] {
        let largest = statistics(&Faulty { delay_s, ..Faulty::sound(30.0) }, &["delay"], 12);
        // 0.18 ms is one standard deviation.
        assert!(largest < 0.8e-3, "{largest}");
    }
}

#[test]
fn delays_of_many_samples() {
    for (all_columns, delay_s) in [(false, 0.3), (true, 0.3), (false, 0.5)] {
        let largest = statistics(&Faulty { all_columns, delay_s, ..Faulty::sound(30.0) }, &["delay"], 6);
        assert!(largest < 0.8e-3, "{delay_s}: {largest}");
    }
}

#[test]
fn delay_with_all_columns() {
    let faulty = Faulty { delay_s: 0.024, all_columns: true, ..Faulty::sound(30.0) };
    assert!(statistics(&faulty, &["delay"], 12) < 0.5e-3);
}

#[test]
fn lag_alone_and_beside_a_delay() {
    let faulty = Faulty { lag_s: 0.1, band_hz: 1.6, ..Faulty::sound(30.0) };
    assert!(statistics(&faulty, &["actuator-lag"], 10) < 2e-3);
    let late = Faulty { delay_s: 0.03, all_columns: true, ..faulty };
    assert!(statistics(&late, &["actuator-lag", "delay"], 10) < 2e-3);
    // No lag at all: a short lead is as likely as a short lag.
    statistics(&Faulty { band_hz: 1.6, ..Faulty::sound(30.0) }, &["actuator-lag"], 6);
}

#[test]
fn a_lag_that_is_not_there_is_not_told_from_a_delay() {
    for all_columns in [false, true] {
        let faulty = Faulty { delay_s: 0.03, all_columns, band_hz: 1.6, ..Faulty::sound(30.0) };
        let found = estimated(&faulty, &["actuator-lag", "delay"], 1);
        let verdict = |nuisance: Nuisance| found.nuisances.iter().find(|found| found.nuisance == nuisance).unwrap();
        let delay = verdict(Nuisance::Delay);
        assert_eq!(delay.verdict, Verdict::NotSeparableFrom(vec![Quantity::Nuisance(Nuisance::ActuatorLag)]));
        assert_eq!((delay.value, verdict(Nuisance::ActuatorLag).value), (None, None));
        assert!((found.parameters.mass / faulty.body.mass).ln().abs() < 4.0 * found.std[0]);
    }
}

#[test]
fn relative_scales() {
    let faulty = Faulty { torque_scale: Vector3::new(1.03, 0.97, 1.02), ..Faulty::sound(30.0) };
    statistics(&faulty, &["torque-scale"], 8);
    let faulty = Faulty { force_scale: Vector3::new(1.0, 1.08, 0.95), ..Faulty::sound(30.0) };
    statistics(&faulty, &["force-scale"], 8);
}

#[test]
fn bias_wrench_and_table_slope() {
    let faulty = Faulty {
        bias_torque: Vector3::new(1e-3, -2e-3, 1e-3),
        bias_force: Vector3::new(0.01, 0.02, -0.01),
        table_slope: Vector3::new(2e-3, -1e-3, 0.0),
        ..Faulty::sound(30.0)
    };
    statistics(&faulty, &["bias-wrench", "table-slope"], 8);
}

#[test]
fn accelerometer() {
    let faulty = Faulty {
        accelerometer_bias: Vector3::new(0.02, -0.01, 0.03),
        accelerometer_scale: Vector3::new(1.05, 1.0, 0.97),
        accelerometer_position: Vector3::new(0.1, -0.05, 0.07),
        all_columns: true,
        ..Faulty::sound(60.0)
    };
    statistics(&faulty, &["accelerometer-bias", "accelerometer-scale", "accelerometer-position"], 8);
}

#[test]
fn everything_at_once() {
    let faulty = Faulty {
        delay_s: 0.024,
        lag_s: 0.05,
        band_hz: 1.6,
        force_scale: Vector3::new(1.0, 1.08, 0.95),
        bias_torque: Vector3::new(1e-3, -2e-3, 1e-3),
        bias_force: Vector3::new(0.01, 0.02, -0.01),
        table_slope: Vector3::new(2e-3, -1e-3, 0.0),
        accelerometer_bias: Vector3::new(0.02, -0.01, 0.03),
        accelerometer_scale: Vector3::new(1.05, 1.0, 0.97),
        accelerometer_position: Vector3::new(0.1, -0.05, 0.07),
        all_columns: true,
        ..Faulty::sound(30.0)
    };
    let accelerometer = ["accelerometer-bias", "accelerometer-scale", "accelerometer-position"];
    let mut names = vec!["delay", "actuator-lag", "force-scale", "bias-wrench", "table-slope"];
    names.extend(accelerometer);
    statistics(&faulty, &names, 6);
}

#[test]
fn the_absolute_scale_is_never_known() {
    let faulty = Faulty {
        force_scale: Vector3::new(1.0, 1.08, 0.95),
        torque_scale: Vector3::new(1.03, 0.97, 1.02),
        all_columns: true,
        ..Faulty::sound(30.0)
    };
    let found = estimated(&faulty, &["force-scale", "torque-scale"], 1);
    assert_eq!(found.exchanges.len(), 1);
    let words = found.exchanges[0].to_string();
    assert_eq!(
        words,
        "mass, inertia, force-scale and torque-scale are exchangeable: \
         the absolute wrench scale can never be known from motion alone"
    );
    for estimate in &found.nuisances {
        assert_eq!((estimate.value, estimate.std), (None, None));
        assert!(matches!(&estimate.verdict, Verdict::NotSeparableFrom(others) if others.contains(&Quantity::Mass)));
    }
    // Held near one, and the mass says how little that is worth; what does not depend on it is as good as ever.
    assert!((found.parameters.mass / faulty.body.mass).ln().abs() < 0.2 && found.std[0] > 0.03);
    assert!((found.parameters.center_of_mass() - faulty.body.center_of_mass()).norm() < 1e-3);
}

#[test]
fn what_nothing_measures_is_not_identifiable() {
    let found = estimated(&Faulty::sound(30.0), &["accelerometer-bias", "accelerometer-position", "delay"], 1);
    for estimate in &found.nuisances {
        let measured = estimate.nuisance == Nuisance::Delay;
        assert_eq!(estimate.verdict == Verdict::Identifiable, measured, "{}", estimate.nuisance);
        assert_eq!(estimate.value.is_some(), measured);
    }
}
