//! How much sooner a leg may end when the mass is known: by the acceleration that the tube leaves to plans.

use super::certificate::{certified, failed, wide};
use super::scenario_one::{Knowledge, PLACES, Seen, Sensing, drawn, fly};
use super::{Interval, each_seed, median};
use crate::Failure;
use crate::targets::Report;
use nalgebra::Vector3;
use serde_json::json;
use tumble_astrobee::control_presets::{THESIS_FORCE_N, THESIS_TORQUE_N_M, TUBE_SIGMAS, TUBE_SPEED_M_S};
use tumble_dynamics::InertialParameters;
use tumble_planning::ModelBelief;
use tumble_planning::control::MassInterval;

const SENSING: Sensing = [2e-3, 1e-3, 4e-3, 1e-3];

/// Least time over a distance from rest to rest, s.
fn leg_s(distance_m: f64, acceleration: f64, speed: f64) -> f64 {
    if acceleration * distance_m <= speed * speed {
        2.0 * (distance_m / acceleration).sqrt()
    } else {
        distance_m / speed + speed / acceleration
    }
}

/// The sum of the legs, each as long as its longest axis takes, s.
fn all_legs_s(acceleration: f64, speed: f64) -> f64 {
    let legs = PLACES.windows(2);
    legs.map(|leg| leg_s((Vector3::from(leg[1]) - Vector3::from(leg[0])).amax(), acceleration, speed)).sum()
}

/// By how much the legs are shorter, as a share: with the tube's speed limit, and without any.
pub fn run(report: &mut Report, seeds: usize) -> Result<(), Failure> {
    let wide = wide()?;
    let before = certified(wide)?;
    let limits = [THESIS_FORCE_N.into(), THESIS_TORQUE_N_M.into()];
    let learned = each_seed(seeds, |seed| {
        let flown = fly(seed, &SENSING, Knowledge::Learned, Seen::Filtered, &limits)?;
        let [share, mass_kg] = flown.mass;
        let mut belief = ModelBelief::certain(1, drawn(seed).0);
        belief.estimate.parameters = InertialParameters { mass: mass_kg, ..belief.estimate.parameters };
        belief.estimate.covariance[(0, 0)] = (share * mass_kg).powi(2);
        let truth_kg = drawn(seed).0.mass;
        let known = MassInterval::believed(&belief, TUBE_SIGMAS, &wide).map_err(failed)?;
        let held = known.is_some_and(|known| (known.least_kg()..=known.largest_kg()).contains(&truth_kg));
        let after = certified(known.unwrap_or(wide))?;
        let shorter = |speed: f64| 1.0 - all_legs_s(after, speed) / all_legs_s(before, speed);
        Ok((truth_kg, shorter(TUBE_SPEED_M_S), shorter(f64::INFINITY), held))
    });
    let mut learned = learned.into_iter().collect::<Result<Vec<_>, Failure>>()?;
    learned.sort_by(|one, other| one.0.total_cmp(&other.0));
    let n = learned.len();
    let limited = Interval::of(&learned, |rows| median(rows.iter().map(|row| row.1)));
    let free = Interval::of(&learned, |rows| median(rows.iter().map(|row| row.2)));
    let least = learned.iter().map(|row| row.1).fold(f64::INFINITY, f64::min);
    let held = learned.iter().filter(|row| row.3).count();
    report.table.push(format!(
        "\nleg time, seeds 0..{n}: certified acceleration before {before:.5} m/s^2, legs {:.1} s; the true mass is in the learned interval in {held}",
        all_legs_s(before, TUBE_SPEED_M_S)
    ));
    report.table.push(format!(
        "  shorter by (median) {limited} at {TUBE_SPEED_M_S} m/s, {free} without a speed limit; least {least:.3}; at the median mass {:.2} kg {:.3}",
        learned[n / 2].0,
        learned[n / 2].1
    ));
    println!(
        "{}",
        json!({"block": "model-knowledge", "part": "leg-time", "n": n, "before_m_s2": before,
            "shorter": [limited.value, limited.low, limited.high], "shorter_without_speed_limit": [free.value, free.low, free.high],
            "least": least, "at_median_mass": [learned[n / 2].0, learned[n / 2].1], "in_interval": held})
    );
    report.at_least("leg time: shorter at the median mass", learned[n / 2].1, 0.30);
    report.at_least("leg time: never longer, least gain", least, 0.0);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the area under the speed, which is a trapezium or a triangle.
    #[test]
    fn the_least_time_covers_the_distance() {
        for (distance, acceleration, speed) in [(0.75, 0.005, 0.1), (0.75, 0.03, 0.1), (0.2, 0.01, 0.02)] {
            let time = leg_s(distance, acceleration, speed);
            let peak = speed.min(acceleration * 0.5 * time);
            let covered = peak * (time - peak / acceleration);
            assert!((covered - distance).abs() < 1e-12, "{covered}");
        }
    }
}
