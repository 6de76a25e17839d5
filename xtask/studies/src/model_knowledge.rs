//! `cargo xtask study model-knowledge`: what knowing the body buys in closed loop, and what the estimator's account is worth.
//!
//! Parts: `tracking` (updates on against off on one reference), `impulse` (each side on its own plan), `coverage` and `informative`
//! (whole missions), `leg-time`.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap)] // counts and steps of a minute

mod certificate;
mod impulse;
mod leg_time;
mod missions;
mod scenario_one;
mod tracking;

pub use missions::{turn_begins_s, variance_at};

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::Failure;
use crate::arguments::Arguments;
use crate::planning_runs::cores;
use crate::random::Random;
use crate::targets::Report;

/// Samples of a bootstrap.
const RESAMPLES: usize = 4000;

/// A part: it adds to the report what it found over so many seeds.
type Part = fn(&mut Report, usize) -> Result<(), Failure>;

/// Runs the part after `--only`, else all.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let seeds = arguments.number("--seeds")?.unwrap_or(80);
    let only = arguments.value("--only");
    let mut report = Report::default();
    let parts: [(&str, Part); 5] = [
        ("tracking", tracking::run),
        ("impulse", impulse::run),
        ("coverage", missions::coverage),
        ("informative", missions::informative),
        ("leg-time", leg_time::run),
    ];
    if let Some(unknown) = only.filter(|only| parts.iter().all(|(name, _)| name != only)) {
        return Err(Failure::BadInput(format!("no part is called `{unknown}`")));
    }
    for (_, part) in parts.iter().filter(|(name, _)| only.is_none_or(|only| only == *name)) {
        part(&mut report, seeds)?;
    }
    report.finish()
}

/// The answer for each of `count` seeds, in their order, worked out on all cores.
pub fn each_seed<T: Send>(count: usize, work: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let next = AtomicUsize::new(0);
    let mut done: Vec<(usize, T)> = std::thread::scope(|scope| {
        let work = || {
            let mut done = Vec::new();
            loop {
                let k = next.fetch_add(1, Ordering::Relaxed);
                if k >= count {
                    return done;
                }
                done.push((k, work(k as u64)));
            }
        };
        let workers: Vec<_> = (0..cores()).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap_or_default()).collect()
    });
    done.sort_by_key(|(k, _)| *k);
    done.into_iter().map(|(_, answer)| answer).collect()
}

/// A figure of pairs and the middle 95 % of the same figure of pairs drawn again.
#[derive(Clone, Copy, Debug)]
struct Interval {
    value: f64,
    low: f64,
    high: f64,
}

impl Interval {
    fn of<T: Clone>(rows: &[T], figure: impl Fn(&[T]) -> f64) -> Self {
        let mut random = Random::new(0x626f_6f74);
        let mut drawn = rows.to_vec();
        let mut found: Vec<f64> = (0..RESAMPLES)
            .map(|_| {
                for slot in &mut drawn {
                    let k = (random.uniform(0.0, 1.0) * rows.len() as f64) as usize;
                    *slot = rows[k.min(rows.len() - 1)].clone();
                }
                figure(&drawn)
            })
            .collect();
        found.sort_by(f64::total_cmp);
        let at = |share: f64| crate::bench::quantile(&found, share);
        Self { value: figure(rows), low: at(0.025), high: at(0.975) }
    }
}

impl std::fmt::Display for Interval {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{:.3} [{:.3}, {:.3}]", self.value, self.low, self.high)
    }
}

/// The middle one of unsorted figures.
pub fn median(figures: impl IntoIterator<Item = f64>) -> f64 {
    crate::bench::quantile(&crate::planning_runs::sorted(figures.into_iter()), 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a mean, the interval is that of the normal distribution: 1.96 standard errors either way.
    #[test]
    fn the_interval_of_a_mean_is_the_textbook_one() {
        let mut random = Random::new(7);
        let rows: Vec<f64> = (0..400).map(|_| 3.0 + random.normal()).collect();
        let mean = |rows: &[f64]| rows.iter().sum::<f64>() / rows.len() as f64;
        let found = Interval::of(&rows, mean);
        let spread = (rows.iter().map(|x| (x - found.value).powi(2)).sum::<f64>() / 400.0).sqrt() / 20.0;
        for (reach, limit) in [(found.value - found.low, spread), (found.high - found.value, spread)] {
            assert!((reach / (1.96 * limit) - 1.0).abs() < 0.1, "{found} {spread}");
        }
    }

    #[test]
    fn seeds_come_back_in_their_order() {
        assert_eq!(each_seed(17, |seed| seed * seed), (0..17).map(|k| k * k).collect::<Vec<u64>>());
    }
}
