//! `cargo xtask bench`: timing and its output, one JSON object or one row of a table per item.

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::json;
use tumble_identification::noise::signed_unit;

use crate::arguments::Arguments;
use crate::{Failure, Problem};

/// What the calibration takes on the idle machine on which the targets were measured.
const IDLE_CALIBRATION_NS: f64 = 11.6;

/// One line of output.
pub struct Row {
    pub problem: &'static str,
    pub item: &'static str,
    pub median_ns: f64,
    pub p99_ns: f64,
    /// How many calls were timed.
    pub n: usize,
    /// Named figures of the answers, found by code that shares nothing with what was timed.
    pub quality: Vec<(&'static str, f64)>,
    pub goal: Goal,
    /// nalgebra's SO(3) exponential, measured just before: shows a loaded machine.
    pub calibration_ns: f64,
}

/// What a time is compared with.
#[derive(Clone, Copy, Default)]
pub struct Goal {
    pub target_ns: Option<f64>,
    /// The fastest peer of the same representation in `benchmarks/RESULTS.md`, and its time there.
    pub peer: Option<(&'static str, f64)>,
}

impl Goal {
    /// A peer's time and an allowance for what moves between runs.
    pub fn beside(peer: &'static str, peer_ns: f64, allowance: f64) -> Self {
        Self { target_ns: Some(peer_ns * allowance), peer: Some((peer, peer_ns)) }
    }

    /// A target of its own; the peer is shown beside it.
    pub fn at(target_ns: f64, peer: &'static str, peer_ns: f64) -> Self {
        Self { target_ns: Some(target_ns), peer: Some((peer, peer_ns)) }
    }

    /// No target; the peer is shown.
    pub fn shown(peer: &'static str, peer_ns: f64) -> Self {
        Self { target_ns: None, peer: Some((peer, peer_ns)) }
    }
}

/// The settings of a run and the place where rows go.
pub struct Bench {
    as_json: bool,
    only: String,
    /// How often each set of inputs is gone through.
    pub sweeps: usize,
    /// How many seeds each random algorithm gets.
    pub runs: usize,
    /// The folder of the frozen inputs, where there is one.
    pub data: Option<PathBuf>,
    calibration: Calibration,
}

/// nalgebra's SO(3) exponential of frozen inputs: shows a slower or busy machine.
pub struct Calibration(Vec<Vector3<f64>>);

impl Default for Calibration {
    fn default() -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(0);
        Self((0..1024).map(|_| Vector3::from_fn(|_, _| 1.8 * signed_unit(&mut generator))).collect())
    }
}

impl Calibration {
    /// How long one takes now, ns.
    ///
    /// Written out with the platform's sine and cosine, as nalgebra has it unless `libm-force` is on: this workspace turns that on,
    /// while the targets were measured without.
    fn measure_ns(&self) -> f64 {
        let exponential = |phi: &Vector3<f64>| {
            let half = phi * 0.5;
            let norm = half.norm();
            if norm <= f64::EPSILON {
                return UnitQuaternion::identity();
            }
            let (sin, cos) = norm.sin_cos();
            UnitQuaternion::new_unchecked(Quaternion::from_parts(cos, half * (sin / norm)))
        };
        quantile(&sweeps(101, self.0.len(), |i| exponential(&self.0[i])), 0.5)
    }

    /// The same as a multiple of what it takes on the idle machine on which the targets were measured.
    pub fn load(&self) -> f64 {
        self.measure_ns() / IDLE_CALIBRATION_NS
    }
}

/// Runs every problem, or those whose name or item holds `--only`.
pub fn run(arguments: &Arguments, problems: &[Problem]) -> Result<(), Failure> {
    let mut bench = Bench {
        as_json: arguments.has("--json"),
        only: arguments.value("--only").unwrap_or_default().to_owned(),
        sweeps: arguments.number("--sweeps")?.unwrap_or(1001).max(1),
        runs: arguments.number("--runs")?.unwrap_or(100).max(1),
        data: arguments.folder("--data", &["../shared/benchmarks/data"])?,
        calibration: Calibration::default(),
    };
    if !bench.as_json {
        println!(
            "{:<12} {:<28} {:>11} {:>11} {:>10} {:>6} {:>5}  {:<22} quality",
            "problem", "item", "median ns", "p99 ns", "target ns", "ratio", "load", "peer"
        );
    }
    for (_, problem) in problems {
        problem(&mut bench)?;
    }
    if !bench.as_json {
        println!(
            "\nload: calibration / {IDLE_CALIBRATION_NS} ns, above 1 on a slower or busy machine; ratio: median / load / target; \
             peer: its time on the idle machine"
        );
    }
    Ok(())
}

/// The numbers of a CSV file of the frozen inputs, one row per line.
pub fn numbers(path: &std::path::Path) -> Result<Vec<Vec<f64>>, Failure> {
    let text = std::fs::read_to_string(path).map_err(|error| Failure::file(path, error))?;
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    let rows: Result<Vec<Vec<f64>>, _> = lines.map(|line| line.split(',').map(str::parse).collect()).collect();
    rows.map_err(|error| Failure::file(path, error))
}

impl Bench {
    /// Whether this item was asked for.
    pub fn wants(&self, problem: &str, item: &str) -> bool {
        problem.contains(&self.only) || item.contains(&self.only)
    }

    /// Times `call` on inputs 0..count, one clock reading per sweep; median and 99th percentile are over the sweeps' means.
    pub fn sweep<T>(
        &self,
        problem: &'static str,
        item: &'static str,
        goal: Goal,
        count: usize,
        quality: &[(&'static str, f64)],
        call: impl FnMut(usize) -> T,
    ) {
        if self.wants(problem, item) {
            let calibration_ns = self.calibrate();
            let times = sweeps(self.sweeps, count, call);
            let (median_ns, p99_ns) = (quantile(&times, 0.5), quantile(&times, 0.99));
            let n = count * self.sweeps;
            self.report(&Row { problem, item, median_ns, p99_ns, n, quality: quality.to_vec(), goal, calibration_ns });
        }
    }

    /// Times every call by itself: median and 99th percentile are over the calls, and hold one clock reading each.
    pub fn each<T>(
        &self,
        problem: &'static str,
        item: &'static str,
        goal: Goal,
        count: usize,
        quality: &[(&'static str, f64)],
        mut call: impl FnMut(usize) -> T,
    ) {
        if self.wants(problem, item) {
            let calibration_ns = self.calibrate();
            let sweeps = self.sweeps.div_ceil(10);
            let mut times = Vec::with_capacity(count * sweeps);
            for _ in 0..sweeps {
                for i in 0..count {
                    let start = Instant::now();
                    black_box(call(black_box(i)));
                    times.push(start.elapsed().as_nanos() as f64);
                }
            }
            times.sort_by(f64::total_cmp);
            let (median_ns, p99_ns) = (quantile(&times, 0.5), quantile(&times, 0.99));
            let n = times.len();
            self.report(&Row { problem, item, median_ns, p99_ns, n, quality: quality.to_vec(), goal, calibration_ns });
        }
    }

    /// How long nalgebra's SO(3) exponential takes now, ns.
    pub fn calibrate(&self) -> f64 {
        self.calibration.measure_ns()
    }

    /// Prints a row, for a problem that times itself.
    pub fn report(&self, row: &Row) {
        let load = row.calibration_ns / IDLE_CALIBRATION_NS;
        if self.as_json {
            let quality: serde_json::Map<_, _> =
                row.quality.iter().map(|(name, value)| ((*name).to_owned(), json!(value))).collect();
            println!(
                "{}",
                json!({
                    "problem": row.problem, "item": row.item, "median_ns": row.median_ns, "p99_ns": row.p99_ns, "n": row.n,
                    "quality": quality, "target_ns": row.goal.target_ns, "calibration_ns": row.calibration_ns,
                })
            );
        } else {
            let target = row.goal.target_ns.map_or_else(String::new, |target| format!("{target:.1}"));
            let ratio =
                row.goal.target_ns.map_or_else(String::new, |target| format!("{:.2}", row.median_ns / load / target));
            let peer = row.goal.peer.map_or_else(String::new, |(name, ns)| format!("{name} {ns}"));
            let quality: Vec<String> = row.quality.iter().map(|(name, value)| format!("{name} {value:.6e}")).collect();
            println!(
                "{:<12} {:<28} {:>11.2} {:>11.2} {target:>10} {ratio:>6} {load:>5.2}  {peer:<22} {}",
                row.problem,
                row.item,
                row.median_ns,
                row.p99_ns,
                quality.join(", ")
            );
        }
    }
}

/// Mean nanoseconds per call of each sweep, sorted; the first sweeps only warm up. Answers go to slots that exist before.
fn sweeps<T>(count: usize, inputs: usize, mut call: impl FnMut(usize) -> T) -> Vec<f64> {
    const WARM_UP: usize = 5;
    let mut answers: Vec<T> = (0..inputs).map(&mut call).collect();
    let mut times = Vec::with_capacity(count);
    for sweep in 1..count + WARM_UP {
        // Hidden once per sweep, not once per call, which would cost a nanosecond each.
        let call = black_box(&mut call);
        let start = Instant::now();
        for (i, answer) in answers.iter_mut().enumerate() {
            *answer = call(i);
        }
        black_box(&mut answers);
        let elapsed = start.elapsed().as_nanos() as f64 / inputs as f64;
        if sweep >= WARM_UP {
            times.push(elapsed);
        }
    }
    times.sort_by(f64::total_cmp);
    times
}

/// The value below which this share of sorted values lies.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1) as f64;
    // Between zero and the last index, so the cast is exact.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let index = (share * last).round() as usize;
    sorted.get(index).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_a_ramp() {
        let ramp: Vec<f64> = (0..=100).map(f64::from).collect();
        assert_eq!((quantile(&ramp, 0.5), quantile(&ramp, 0.99), quantile(&ramp, 1.0)), (50.0, 99.0, 100.0));
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn every_sweep_is_timed_once() {
        let mut calls = 0;
        let times = sweeps(10, 3, |i| {
            calls += 1;
            i
        });
        assert_eq!((times.len(), calls), (10, 45));
        assert!(times.iter().all(|time| *time >= 0.0));
    }
}
