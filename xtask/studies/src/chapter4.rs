//! `reproduce chapter4`: figures 4.4 to 4.10 of the thesis, with what the thesis leaves open stated, and what this library makes of
//! the same flights.

mod figures;
mod flown;
mod loads;
mod page;
mod statistics;

use std::panic::resume_unwind;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use serde_json::json;
use tumble::output::OutputFolder;
use tumble::space_cobot::wrench_box;
use tumble_dynamics::{InertialParameters, WrenchBox};
use tumble_identification::excitation::Execution;
use tumble_identification::fourier::FourierMotion;
use tumble_identification::{IdentificationError, WrenchTiming};

use crate::Failure;
use crate::arguments::Arguments;
use flown::{Beside, CYCLES, Criterion, Outcome};
use loads::Loads;

/// Loads where `--runs` says nothing, and designs of each criterion at most.
const LOADS: usize = 10;
const MOTIONS: usize = 5;
/// Periods, s.
const PERIOD_S: f64 = 10.0;
const LONG_PERIOD_S: f64 = 60.0;
/// Acceleration limits of the long motions: m/s^2 and rad/s^2.
const TIGHT: [f64; 2] = [0.03, 0.03];
const LONG_MOTIONS: usize = 2;
/// The robot's limits in figures 4.5 and 4.7.
const FORCE_LIMIT_N: f64 = 10.0;
const TORQUE_LIMIT_N_M: f64 = 1.0;
/// Wanted shares of saturation in figure 4.8.
const SHARES: [f64; 5] = [0.1, 0.3, 0.4775, 0.6, 0.9];
/// The same where the torque alone is limited: rotations are what the inertia is seen by.
const TORQUE_SHARES: [f64; 2] = [0.3, 0.6];
/// Loads whose tracked flights go to the likelihood in coefficient space: with many harmonics it takes seconds.
pub const COEFFICIENT_LOADS: usize = 3;
const LOAD_SEED: u64 = 2024;

/// One flight and what was made of it.
pub struct Case {
    pub motion: usize,
    pub load: usize,
    pub limits: WrenchBox,
    pub outcome: Outcome,
}

/// Everything that was flown; pairs are V1 and V2.
pub struct Study {
    pub loads: Loads,
    /// The motion itself.
    pub perfect: [Vec<Case>; 2],
    /// Tracked without limits.
    pub free: [Vec<Case>; 2],
    /// Tracked with the robot's limits.
    pub boxed: [Vec<Case>; 2],
    /// V1 with limits that give the wanted share of saturation.
    pub shares: Vec<(f64, Vec<Case>)>,
    /// The same with limits of the torque alone.
    pub torque_shares: Vec<(f64, Vec<Case>)>,
    /// V1 with the long period, without limits.
    pub long: Vec<Case>,
    /// The first motions of V1, flown for as long a time as those.
    pub repeated: Vec<Case>,
}

/// How a batch of flights is made.
struct Flights<'a> {
    loads: &'a Loads,
    about: &'static str,
    beside: Beside,
    cycles: usize,
    /// Motion and load are added to it for the seed of the noise.
    seed: u64,
}

impl Flights<'_> {
    /// All motions with all loads, each with its limits.
    fn fly(
        &self,
        motions: &[FourierMotion],
        limits: impl Fn(&FourierMotion, usize) -> Result<WrenchBox, IdentificationError> + Sync,
    ) -> Result<Vec<Case>, Failure> {
        self.each(motions, |motion, load| {
            let limits = limits(motion, load)?;
            Ok((limits, flown::fly(motion, &self.loads.bodies[load], limits, self.cycles)?, WrenchTiming::Held))
        })
    }

    fn each(
        &self,
        motions: &[FourierMotion],
        flight: impl Fn(&FourierMotion, usize) -> Result<(WrenchBox, Execution, WrenchTiming), IdentificationError> + Sync,
    ) -> Result<Vec<Case>, Failure> {
        let start = Instant::now();
        let count = self.loads.bodies.len();
        let cases = in_parallel(motions.len() * count, |index| {
            let (motion, load) = (index / count, index % count);
            let (limits, flight, timing) = flight(&motions[motion], load)?;
            let seed = self.seed + 1000 * motion as u64 + load as u64;
            let body = &self.loads.bodies[load];
            let tracked = timing == WrenchTiming::Held;
            let beside = self.beside.only_if(!tracked || load < COEFFICIENT_LOADS);
            let outcome = flown::process(&motions[motion], body, &flight, timing, beside, seed);
            Ok(Case { motion, load, limits, outcome })
        });
        eprintln!("chapter 4: {}: {} flights, {:.1} s", self.about, cases.len(), start.elapsed().as_secs_f64());
        cases.into_iter().collect::<Result<_, IdentificationError>>().map_err(study)
    }
}

/// The robot's limits, larger or smaller.
fn robot(scale: f64) -> WrenchBox {
    wrench_box(scale * FORCE_LIMIT_N, scale * TORQUE_LIMIT_N_M)
}

/// The same of the torque alone.
fn torque_only(scale: f64) -> WrenchBox {
    wrench_box(f64::INFINITY, scale * TORQUE_LIMIT_N_M)
}

/// `work(0 .. count)` on all cores, in order.
pub fn in_parallel<T: Send>(count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let next = AtomicUsize::new(0);
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let mut done: Vec<(usize, T)> = std::thread::scope(|scope| {
        let one = || {
            let mut done = Vec::new();
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                if index >= count {
                    return done;
                }
                done.push((index, work(index)));
            }
        };
        let handles: Vec<_> = (0..workers).map(|_| scope.spawn(one)).collect();
        // A worker that panics is not a shorter result.
        let finished = handles.into_iter().map(|handle| handle.join().unwrap_or_else(|panic| resume_unwind(panic)));
        finished.flatten().collect()
    });
    done.sort_by_key(|(index, _)| *index);
    done.into_iter().map(|(_, result)| result).collect()
}

/// The limits at which the share of saturation comes nearest to the wanted one; it falls as they widen, not always without jumps.
fn limits_for(
    motion: &FourierMotion,
    load: &InertialParameters<f64>,
    limits: fn(f64) -> WrenchBox,
    share: f64,
) -> Result<WrenchBox, IdentificationError> {
    let (mut low, mut high) = (0.02_f64, 10.0);
    let mut nearest = (f64::INFINITY, limits(high));
    for _ in 0..14 {
        let middle = (low * high).sqrt();
        let reached = flown::fly(motion, load, limits(middle), CYCLES)?.saturation.any;
        if (reached - share).abs() < nearest.0 {
            nearest = ((reached - share).abs(), limits(middle));
        }
        if reached > share { low = middle } else { high = middle }
    }
    Ok(nearest.1)
}

fn study(error: impl std::fmt::Display) -> Failure {
    Failure::BadInput(error.to_string())
}

fn designs(criterion: Criterion, count: usize, long: bool) -> Result<Vec<FourierMotion>, Failure> {
    let (period_s, acceleration) = if long { (LONG_PERIOD_S, Some(TIGHT)) } else { (PERIOD_S, None) };
    let limits = flown::channel_limits(acceleration);
    (0..count as u64).map(|start| flown::design(criterion, period_s, &limits, start).map_err(study)).collect()
}

fn fly_everything(loads: Loads) -> Result<Study, Failure> {
    let motions = MOTIONS.min(loads.bodies.len());
    let short = [designs(Criterion::V1, motions, false)?, designs(Criterion::V2, motions, false)?];
    let long = designs(Criterion::V1, motions.min(LONG_MOTIONS), true)?;
    let unlimited = |_: &FourierMotion, _| Ok(flown::unlimited());
    let plain = Flights { loads: &loads, about: "", beside: Beside::default(), cycles: CYCLES, seed: 0 };
    // What the tracker makes of V2 has more harmonics.
    let [few, many] = [&[20, 40][..], &[40]];
    let trajectory = Beside { trajectory: true, ..Beside::default() };

    let beside = Beside { coefficients: &[flown::REFERENCE_HARMONICS], ..Beside::default() };
    let perfect = |motions: &[FourierMotion], about, seed| {
        Flights { about, beside, seed, ..plain }.each(motions, |motion, load| {
            let flight = flown::follow_exactly(motion, &loads.bodies[load], CYCLES)?;
            Ok((flown::unlimited(), flight, WrenchTiming::Sampled))
        })
    };
    let perfect = [perfect(&short[0], "V1, perfect", 100_000)?, perfect(&short[1], "V2, perfect", 200_000)?];
    let all = Beside { coefficients: few, coefficients_as_chosen: true, trajectory: true };
    let likelihoods = Beside { coefficients: many, ..trajectory };
    let free = [
        Flights { about: "V1, no limits", beside: all, seed: 300_000, ..plain }.fly(&short[0], unlimited)?,
        Flights { about: "V2, no limits", beside: likelihoods, seed: 400_000, ..plain }.fly(&short[1], unlimited)?,
    ];
    let boxed = |_: &FourierMotion, _| Ok(robot(1.0));
    let boxed = [
        Flights { about: "V1, limits", beside: trajectory, seed: 500_000, ..plain }.fly(&short[0], boxed)?,
        Flights { about: "V2, limits", beside: trajectory, seed: 600_000, ..plain }.fly(&short[1], boxed)?,
    ];
    let chosen = |limits: fn(f64) -> WrenchBox, about, seed, shares: &[f64]| -> Result<Vec<_>, Failure> {
        let at = |(index, share): (usize, &f64)| {
            let flights = Flights { about, beside: trajectory, seed: seed + 10_000 * index as u64, ..plain };
            let cases =
                flights.fly(&short[0], |motion, load| limits_for(motion, &loads.bodies[load], limits, *share))?;
            Ok((*share, cases))
        };
        shares.iter().enumerate().map(at).collect()
    };
    let shares = chosen(robot, "V1, chosen saturation", 700_000, &SHARES)?;
    let torque_shares = chosen(torque_only, "V1, chosen saturation of the torque", 1_000_000, &TORQUE_SHARES)?;
    let coefficients = Beside { coefficients: &[12, 20], ..Beside::default() };
    let long = Flights { about: "V1, 60 s", beside: coefficients, seed: 800_000, ..plain }.fly(&long, unlimited)?;
    let first = &short[0][..motions.min(LONG_MOTIONS)];
    let cycles = 6 * CYCLES;
    let repeated = Flights { about: "V1, 10 s, as long", cycles, seed: 900_000, ..plain }.fly(first, unlimited)?;
    Ok(Study { loads, perfect, free, boxed, shares, torque_shares, long, repeated })
}

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let start = Instant::now();
    let runs = arguments.number("--runs")?.unwrap_or(LOADS).max(1);
    let out = arguments.value("--out").map(Path::new);
    if let Some(out) = out {
        OutputFolder::check_place(out, false).map_err(study)?;
    }
    let study_of_all = fly_everything(loads::draw(runs, LOAD_SEED))?;
    let page::Page { text, missed } = page::page(&study_of_all)?;
    print!("{text}");
    eprintln!("chapter 4: {:.0} s", start.elapsed().as_secs_f64());
    if let Some(out) = out {
        let folder = OutputFolder::create(out, false).map_err(study)?;
        folder.write("report.md", &format!("{text}{}", figures::LINKS)).map_err(study)?;
        figures::write(&folder, &study_of_all)?;
        let configuration = json!({
            "loads": runs, "load_seed": LOAD_SEED, "motions_per_criterion": MOTIONS.min(runs), "cycles": CYCLES,
            "seconds": start.elapsed().as_secs_f64().round(),
        });
        folder.write("run.json", &crate::run_record("reproduce chapter4", &configuration)).map_err(study)?;
        eprintln!("written: {}", folder.finish().map_err(study)?.display());
    }
    if missed.is_empty() { Ok(()) } else { Err(Failure::TargetMissed(missed.join("\n"))) }
}
