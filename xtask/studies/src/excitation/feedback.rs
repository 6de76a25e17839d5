//! Whether the stated sigmas hold for motions flown with feedback: whole error and 95 % intervals, by period and chart.

use std::io::Write as _;

use nalgebra::Vector3;
use tumble_dynamics::WrenchBox;
use tumble_identification::fourier::AttitudeChart;
use tumble_identification::harmonics::{HarmonicEstimator, HarmonicSettings, identify_periodic};
use tumble_identification::lie::Pose;
use tumble_identification::statistics::{clopper_pearson, mean_square_band, normal_quantile, normalized_squared_error};

use super::periodic_log::{flown, noise, noisy};
use super::{BANDWIDTH_RAD_S, CYCLES, HARMONICS, SEED, median};
use crate::random::Random;

const CELLS: [(f64, AttitudeChart); 4] = [
    (10.0, AttitudeChart::EulerZyx),
    (10.0, AttitudeChart::Quaternion),
    (60.0, AttitudeChart::EulerZyx),
    (60.0, AttitudeChart::Quaternion),
];
const RATE_HZ: usize = 100;
/// Chance that a consistent estimator misses the band of its mean squared error.
const FALSE_ALARM: f64 = 1e-3;

/// One estimator's errors in one cell.
#[derive(Default)]
struct Account {
    squared_errors: Vec<f64>,
    inside: usize,
}

/// `flights` motions within the bounds, each with its own load, in every cell; the transient is found, not told.
pub(super) fn run(flights: usize) -> Vec<String> {
    println!(
        "\n{flights} random motions flown with feedback of {BANDWIDTH_RAD_S} rad/s by a robot that does not know its load, {RATE_HZ} Hz, \
         {CYCLES} cycles\n\
         period  chart       answered by             flights  NEES median, mean (band of ten)      95 % intervals that hold"
    );
    let mut missed = Vec::new();
    let unlimited = WrenchBox { torque_limit: Vector3::repeat(1e3), force_limit: Vector3::repeat(1e3) };
    let half_width = normal_quantile(0.95);
    for (period_s, chart) in CELLS {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole seconds
        let samples = period_s as usize * RATE_HZ;
        let mut accounts: [Account; 3] = Default::default();
        let mut refused = 0;
        for flight in 0..flights {
            eprint!("\rfeedback, {period_s} s, {chart:?}: {} of {flights} ", flight + 1);
            let _ = std::io::stderr().flush();
            let seed = SEED + 2000 + flight as u64;
            let mut random = Random::new(seed);
            let (motion, load) = (random.motion(period_s, HARMONICS), random.load());
            let start = Pose::identity();
            let (rows, _) = flown(&motion, &load, &unlimited, &start, BANDWIDTH_RAD_S, (CYCLES, samples));
            let rows = noisy(rows, &start, &noise(), seed);
            for estimator in [HarmonicEstimator::LeastSquares, HarmonicEstimator::Likelihood] {
                let settings = HarmonicSettings { chart, estimator, ..HarmonicSettings::new(period_s, HARMONICS) };
                let Ok(found) = identify_periodic(&rows, &settings) else {
                    refused += 1;
                    continue;
                };
                let covariance = found.estimate.covariance;
                let error = found.estimate.parameters.to_vector() - load.to_vector();
                let account = &mut accounts[found.estimator as usize];
                account.squared_errors.push(normalized_squared_error(&error, &covariance).unwrap_or(f64::INFINITY));
                account.inside += (0..10).filter(|&i| error[i].abs() < half_width * covariance[(i, i)].sqrt()).count();
            }
        }
        eprintln!();
        for (account, name) in accounts.iter().zip(["least squares", "likelihood", "trajectory likelihood"]) {
            let count = account.squared_errors.len();
            if count == 0 {
                continue;
            }
            let mean = account.squared_errors.iter().sum::<f64>() / count as f64;
            let (median, ..) = median(account.squared_errors.clone());
            let band = mean_square_band(10.0, count, 1.0 - FALSE_ALARM);
            // The ten of one flight are not independent: the interval is narrower than it should be.
            let interval = clopper_pearson(account.inside, 10 * count, 0.95);
            let share = account.inside as f64 / (10 * count) as f64;
            println!(
                "{period_s:>4} s  {:<10}  {name:<22}  {count:>7}  {median:>8.1} {mean:>8.1}  ({band})  {:>8.1} %  ({interval})",
                format!("{chart:?}"),
                100.0 * share
            );
            // Least squares knows nothing of the harmonics that it leaves out: shown, not judged.
            if name == "likelihood" && mean > band.high {
                missed.push(format!("{name} at {period_s} s, {chart:?}: NEES {mean:.1} above {:.1}", band.high));
            }
        }
        if refused > 0 {
            println!("{period_s:>4} s  {chart:?}: {refused} refused");
        }
    }
    missed
}
