//! What the two-stage estimator states of its errors is true, over flights that nothing was tuned on.

use crate::flight_scenario::{Conditions, Flight, STEP_NS, noise, prior, settings};
use tumble_identification::estimator::{Acted, Gauss, Measurement, StateEstimator};
use tumble_identification::nalgebra::Vector3;
use tumble_identification::recursive::TwoStageEstimator;
use tumble_identification::statistics::coverage_band;
use tumble_identification::{BodyScale, Estimate};

/// Flights of another estimator's control, told to two stages: bodies off by up to a factor of two, late measurements, thrust that errs.
#[test]
fn intervals_of_two_stages_hold_the_truth() {
    const FLIGHTS: u64 = 10;
    let (mut inside, mut masses, mut lean) = (0, Vec::new(), 0.0);
    for seed in 0..FLIGHTS {
        let mut flight = Flight::new(7000 + seed, Conditions { ticks_per_measurement: 2, ..Conditions::usual() });
        flight.fly_until(40.0);
        let known = prior().to_finding(BodyScale::of(&prior().parameters.to_vector()).unwrap()).unwrap();
        let mut estimator = TwoStageEstimator::least_squares(settings(), flight.truth[0], 0, &known).unwrap();
        for (tick, wrench) in (0_i64..).zip(&flight.acted) {
            let (from_ns, until_ns) = (tick * STEP_NS, (tick + 1) * STEP_NS);
            estimator.acted(&Acted { from_ns, until_ns, wrench_body: *wrench, stored_body: Vector3::zeros() });
            let late_ns = from_ns - 9 * STEP_NS;
            for seen in flight.measured.iter().filter(|seen| seen.stamp_ns == late_ns) {
                let noise = noise();
                let pose = Measurement::of_pose(late_ns, &seen.world_from_body, noise.attitude_rad, noise.position_m);
                estimator.measured(&Measurement {
                    rate_body: seen.rate_body.map(|rate| Gauss::isotropic(rate, noise.rate_rad_s)),
                    velocity_world: seen
                        .velocity_origin_world
                        .map(|velocity| Gauss::isotropic(velocity, noise.velocity_m_s)),
                    ..pose
                });
            }
        }
        let account = flight.account_of(&Estimate::try_from(&estimator.finding().unwrap()).unwrap());
        let scores: Vec<f64> = account.errors.iter().zip(&account.deviations).map(|(e, d)| e / d).collect();
        println!("{seed}: mass {:+.4} ({:.4}), in deviations {scores:.1?}", account.errors[0], account.deviations[0]);
        inside += scores.iter().filter(|score| score.abs() <= 2.0).count();
        masses.push(account.errors[0].abs());
        lean += account.errors[0] / FLIGHTS as f64;
    }
    let numbers = 10 * usize::try_from(FLIGHTS).unwrap();
    let coverage = inside as f64 / numbers as f64;
    // Ten numbers of one flight depend on each other: as if there were half as many.
    let band = coverage_band(0.9545, numbers / 2, 0.999);
    assert!(coverage >= band.low, "{coverage} {band}");
    masses.sort_by(f64::total_cmp);
    let median = masses[masses.len() / 2];
    // Filtered rows without an account of their noise are ten percent light.
    assert!(median < 0.02 && lean.abs() < 0.02, "median {median}, lean {lean}");
}
