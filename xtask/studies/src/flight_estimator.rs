//! `cargo xtask study flight-estimator`: whether the estimator in the loop finds the body from a start that is off by a factor
//! of two, and knows how well it did.

// The flights of `tests/suite/flight_estimator.rs`.
#[path = "../../../crates/identification/tests/suite/flight_scenario/mod.rs"]
#[allow(clippy::unwrap_used, reason = "a scenario with fixed numbers")]
pub mod flight_scenario;

use std::sync::atomic::{AtomicUsize, Ordering};

use flight_scenario::{Account, Conditions, Flight, STEP_NS};
use tumble_identification::statistics::{chi_square_quantile, clopper_pearson};

use crate::Failure;
use crate::arguments::Arguments;
use crate::planning_runs::cores;
use crate::targets::Report;

const NAMES: [&str; 10] = ["mass", "c_x", "c_y", "c_z", "J_xx", "J_yy", "J_zz", "J_xy", "J_xz", "J_yz"];
const LOOKS_S: [f64; 2] = [24.0, 60.0];

/// Errors of the motion, root of the mean square over a flight and its axes.
#[derive(Clone, Copy, Default)]
struct MotionErrors {
    /// Filtered position, velocity (inertial axes), attitude, rate.
    filtered: [f64; 4],
    now: [f64; 2],
    count: f64,
}

struct Flown {
    accounts: Vec<Account>,
    motion: MotionErrors,
    diverged: bool,
    doubtful: f64,
    worst_gated: u64,
}

fn fly(seed: u64, conditions: Conditions, until: f64) -> Flown {
    let mut flight = Flight::new(seed, conditions);
    let (mut accounts, mut motion) = (Vec::new(), MotionErrors::default());
    let (mut diverged, mut doubtful) = (false, 0.0);
    for look in LOOKS_S.iter().chain([&until]) {
        while (flight.now_ns() as f64) * 1e-9 < *look {
            flight.step();
            let health = flight.estimator.health();
            diverged |= health.diverged;
            doubtful += f64::from(u8::from(health.body_doubtful));
            if flight.tick > 1250 {
                motion.watch(&flight);
            }
        }
        accounts.push(flight.account());
    }
    Flown { accounts, motion, diverged, doubtful, worst_gated: flight.estimator.counts().gated }
}

impl MotionErrors {
    fn watch(&mut self, flight: &Flight) {
        let stamp_ns = flight.estimator.newest_stamp_ns();
        let Some(truth) = flight.truth.get(usize::try_from(stamp_ns / STEP_NS).unwrap_or(usize::MAX)) else { return };
        let found = flight.estimator.state_at(stamp_ns);
        let world_from_body = truth.world_from_body.rotation;
        let velocity =
            found.world_from_body.rotation * found.twist_body.linear - world_from_body * truth.twist_body.linear;
        let position = found.world_from_body.translation.vector - truth.world_from_body.translation.vector;
        let attitude = (world_from_body.inverse() * found.world_from_body.rotation).scaled_axis();
        let rate = found.twist_body.angular - truth.twist_body.angular;
        for (sum, error) in self.filtered.iter_mut().zip([position, velocity, attitude, rate]) {
            *sum += error.norm_squared() / 3.0;
        }
        let now = flight.estimator.state_at(flight.now_ns());
        let position = now.world_from_body.translation.vector - flight.state.world_from_body.translation.vector;
        let velocity = now.world_from_body.rotation * now.twist_body.linear
            - flight.state.world_from_body.rotation * flight.state.twist_body.linear;
        for (sum, error) in self.now.iter_mut().zip([position, velocity]) {
            *sum += error.norm_squared() / 3.0;
        }
        self.count += 1.0;
    }
}

/// Flies `--runs` flights in each series.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let runs = arguments.number("--runs")?.unwrap_or(200);
    let mut report = Report::default();
    let usual = Conditions::usual();
    let series = [
        ("62.5 Hz", usual),
        ("5 Hz", Conditions { ticks_per_measurement: 12, ..usual }),
        ("62.5 Hz, drift 10 s", Conditions { drift_time_s: 10.0, ..usual }),
        ("62.5 Hz, drift 100 s", Conditions { drift_time_s: 100.0, ..usual }),
        ("62.5 Hz, no wiggle", Conditions { wiggle_rad: 0.0, ..usual }),
        ("62.5 Hz, planar", Conditions { planar: true, ..usual }),
    ];
    for (name, conditions) in series {
        if arguments.value("--only").is_some_and(|only| only != name) {
            continue;
        }
        judge(&mut report, name, conditions, runs);
    }
    report.finish()
}

fn judge(report: &mut Report, name: &str, conditions: Conditions, runs: usize) {
    let next = AtomicUsize::new(0);
    let mut flown: Vec<(usize, Flown)> = std::thread::scope(|scope| {
        let work = || {
            let mut done = Vec::new();
            loop {
                let k = next.fetch_add(1, Ordering::Relaxed);
                if k >= runs {
                    return done;
                }
                done.push((k, fly(k as u64, conditions, 72.0)));
            }
        };
        let workers: Vec<_> = (0..cores()).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap_or_default()).collect()
    });
    flown.sort_by_key(|(k, _)| *k);
    let (count, limit) = (flown.len() as f64, chi_square_quantile(10.0, 0.99));
    report.table.push(format!("\n{name}, {runs} flights"));
    for (look, seconds) in LOOKS_S.iter().enumerate() {
        let accounts: Vec<&Account> = flown.iter().filter_map(|(_, flown)| flown.accounts.get(look)).collect();
        report.table.push(format!("after {seconds} s:  median |e|   rms e    bias     median sigma   within 2 sigma"));
        for (i, parameter) in NAMES.iter().enumerate() {
            let mut sizes: Vec<f64> = accounts.iter().map(|account| account.errors[i].abs()).collect();
            sizes.sort_by(f64::total_cmp);
            let mut sigmas: Vec<f64> = accounts.iter().map(|account| account.deviations[i]).collect();
            sigmas.sort_by(f64::total_cmp);
            let within =
                accounts.iter().filter(|account| account.errors[i].abs() <= 2.0 * account.deviations[i]).count();
            let rms = (sizes.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
            let bias = accounts.iter().map(|account| account.errors[i]).sum::<f64>() / count;
            let (median, sigma) = (crate::bench::quantile(&sizes, 0.5), crate::bench::quantile(&sigmas, 0.5));
            report.table.push(format!(
                "  {parameter:5} {median:12.5} {rms:9.5} {bias:9.5} {sigma:12.5}  {:9.3} {}",
                within as f64 / count,
                clopper_pearson(within, accounts.len(), 0.95),
            ));
            let target = match i {
                0 => 0.01,
                1..=3 => 3e-3,
                _ => 0.03,
            };
            report.at_least(&format!("{name} {seconds} s {parameter} within 2 sigma"), within as f64 / count, 0.93);
            report.at_most(&format!("{name} {seconds} s {parameter} median error"), median, target);
        }
        let inside = accounts.iter().filter(|account| account.nees <= limit).count();
        let nees = crate::planning_runs::sorted(accounts.iter().map(|account| account.nees));
        report.table.push(format!(
            "  in the 99 % set {:.3} {}, median NEES {:.2}",
            inside as f64 / count,
            clopper_pearson(inside, accounts.len(), 0.95),
            crate::bench::quantile(&nees, 0.5)
        ));
        report.at_least(&format!("{name} {seconds} s truth in the 99 % set"), inside as f64 / count, 0.98);
    }
    let mut all = MotionErrors::default();
    for (_, flown) in &flown {
        for (sum, part) in all.filtered.iter_mut().zip(flown.motion.filtered) {
            *sum += part;
        }
        for (sum, part) in all.now.iter_mut().zip(flown.motion.now) {
            *sum += part;
        }
        all.count += flown.motion.count;
    }
    let root = |sum: f64| 1e3 * (sum / all.count).sqrt();
    let [position, velocity, attitude, rate] = all.filtered.map(root);
    report.table.push(format!(
        "  filtered: {position:.3} mm, {velocity:.3} mm/s, {attitude:.3} mrad, {rate:.3} mrad/s; now: {:.3} mm, {:.3} mm/s",
        root(all.now[0]),
        root(all.now[1])
    ));
    let diverged = flown.iter().filter(|(_, flown)| flown.diverged).count();
    let doubtful = flown.iter().filter(|(_, flown)| flown.doubtful > 0.0).count();
    let gated: u64 = flown.iter().map(|(_, flown)| flown.worst_gated).sum();
    report.table.push(format!(
        "  alarms: {diverged} flights diverged, {doubtful} with the body in doubt; {gated} measurements gated"
    ));
}
