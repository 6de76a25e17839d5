//! `cargo xtask study change-detection`: how soon a tenth more or less mass is found, and how often one is imagined.
//!
//! A body of 9.4 kg under 0.1 N, poses of 1 mm and 1 mrad, rates of 1e-3 rad/s, accelerations of 1e-2 m/s^2, at 62.5 Hz.

// The flights of `tests/suite/recursive_changes.rs`.
#[path = "../../../crates/identification/tests/suite/change_scenario/mod.rs"]
#[allow(clippy::unwrap_used, reason = "a scenario with fixed numbers")]
mod change_scenario;

use change_scenario::{Flight, STEP_S};
use tumble_identification::recursive::Watch;

use crate::Failure;
use crate::arguments::Arguments;

const FORCE_N: f64 = 0.1;
/// A change is to be found within this time.
const LIMIT_S: f64 = 2.0;

/// Share of all flights in which it must be.
const FOUND: f64 = 0.99;

/// Runs `--grasps` grasps and releases and `--hours` hours without any; `--seed` is that of the first flight.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let grasps = arguments.number("--grasps")?.unwrap_or(200) as u64;
    let hours = arguments.number("--hours")?.unwrap_or(4) as u64;
    let first = arguments.number("--seed")?.unwrap_or(0) as u64;
    let (mut delays_s, mut early) = (Vec::new(), 0);
    for seed in first..first + grasps {
        let mut flight = Flight::new(seed, FORCE_N);
        // Not always at the same phase of the candidates.
        let settled = 375 + seed % 97;
        early += u64::from((0..settled).any(|_| matches!(flight.step(), Watch::Changed(_))));
        flight.grasp(if seed.is_multiple_of(2) { 1.1 } else { 0.9 });
        let delay = (1..=625).find(|_| matches!(flight.step(), Watch::Changed(_)));
        delays_s.push(delay.map_or(f64::INFINITY, |updates| f64::from(updates) * STEP_S));
    }
    delays_s.sort_by(f64::total_cmp);
    let at = |share: f64| crate::bench::quantile(&delays_s, share);
    let in_time = delays_s.iter().filter(|delay| **delay <= LIMIT_S).count();
    println!(
        "{grasps} steps of 10 % in mass under {FORCE_N} N: median {:.2} s, 95 % {:.2} s, worst {:.2} s; {in_time} within {LIMIT_S} s; \
         {early} alarms before",
        at(0.5),
        at(0.95),
        at(1.0)
    );
    // In pieces of a quarter of an hour, each with a start of its own.
    let (pieces, updates) = (4 * hours, 56_250);
    let mut alarms = 0;
    for piece in 0..pieces {
        let mut flight = Flight::new(1_000_000 + first + piece, FORCE_N);
        alarms += (0..updates).filter(|_| matches!(flight.step(), Watch::Changed(_))).count();
        eprintln!("{} of {pieces} quarters of an hour, {alarms} false alarms", piece + 1);
    }
    println!("{hours} h without a change: {alarms} false alarms");
    if alarms as u64 >= hours.max(1) && hours > 0 || (in_time as f64) < FOUND * delays_s.len() as f64 {
        return Err(Failure::TargetMissed("99 % within 2 s and fewer than one false alarm an hour".to_owned()));
    }
    Ok(())
}
