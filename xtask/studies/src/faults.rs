//! The closed loop when things go wrong: `cargo xtask study faults [--missions N] [--seeds N] [--only FAULT] [--sensing NAME]`.
//!
//! Every fault in every severity with every seed on two missions; with `--missions` the first so many, those of severity 2 and 3 with
//! the first seeds first. What can be prevented and was not is one line that flies it again, and exit code 3. The sensors are `nominal`
//! unless told otherwise.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::json;
use tumble::mission::{
    FlyOptions, LayerNames, MissionSummary, ModelChoice, NoHooks, WeightingChoice, fly, replay_line,
};
use tumble::scenario::ScenarioSource;

use crate::Failure;
use crate::arguments::Arguments;
use crate::targets::Report;

/// The missions.
const SCENARIOS: [&str; 2] = ["iss-cargo", "granite-cargo"];
const SENSING: &str = "nominal";
/// The box that holds all ten parameters of an honest belief in at least 99 % of the cases, however they go together: 0.001 for each, both sides.
const BOX_SIGMAS: f64 = 3.2905;
/// The mildest last: it shows least.
const SEVERITIES: [u8; 3] = [3, 2, 1];

const FAULTS: [&str; 14] = [
    "drop",
    "delay",
    "duplicate",
    "clock",
    "malformed",
    "frozen",
    "jump",
    "saturation",
    "nozzle",
    "power",
    "mass-step",
    "divergence",
    "planner",
    "late-obstacle",
];

struct Case {
    scenario: &'static str,
    sensing: String,
    fault: &'static str,
    options: FlyOptions,
}

/// What became of all missions with one fault in one place.
#[derive(Default)]
struct Tally {
    flown: u32,
    arrived: u32,
    held: u32,
    doubted: u32,
    /// Neither held nor doubted.
    misled: u32,
}

impl Tally {
    fn count(&mut self, summary: &MissionSummary) {
        let holds = summary
            .parameters
            .iter()
            .all(|row| (row.estimate - row.truth).abs() <= BOX_SIGMAS * row.sigma + f64::EPSILON * row.truth.abs());
        let is_doubted = !summary.standing_doubts().is_empty();
        self.flown += 1;
        self.arrived += u32::from(summary.arrived);
        self.held += u32::from(holds);
        self.doubted += u32::from(is_doubted);
        self.misled += u32::from(!holds && !is_doubted);
    }
}

/// What became of a case.
enum Flown {
    Over(Box<MissionSummary>),
    Failed(String),
}

impl Case {
    fn line(&self) -> String {
        format!("{} --sensing {}", replay_line(self.scenario, &self.options), self.sensing)
    }

    fn fly(&self) -> Flown {
        let mission = || {
            let source = ScenarioSource::find(self.scenario)?.sensed_by(&self.sensing)?;
            fly(&source, &self.options, &mut NoHooks)
        };
        match catch_unwind(AssertUnwindSafe(mission)) {
            Ok(Ok(record)) => Flown::Over(Box::new(record.summary)),
            Ok(Err(error)) => Flown::Failed(error.to_string()),
            Err(_) => Flown::Failed("panicked".to_owned()),
        }
    }
}

fn bad(error: impl std::fmt::Display) -> Failure {
    Failure::BadInput(format!("faults: {error}"))
}

fn cases(seeds: u64, sensing: &str) -> Result<Vec<Case>, Failure> {
    let mut cases = Vec::new();
    for seed in 1..=seeds {
        for severity in SEVERITIES {
            for scenario in SCENARIOS {
                for name in FAULTS {
                    let options = FlyOptions {
                        seed,
                        weighting: WeightingChoice::default(),
                        feedback: true,
                        model: ModelChoice::default(),
                        fault: Some(format!("{name}:{severity}").parse().map_err(bad)?),
                        layers: LayerNames::default(),
                    };
                    cases.push(Case { scenario, sensing: sensing.to_owned(), fault: name, options });
                }
            }
        }
    }
    Ok(cases)
}

/// In the order of the cases, whoever flies which.
fn fly_all(cases: &[Case]) -> Vec<Option<Flown>> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let next = AtomicUsize::new(0);
    let flown = Mutex::new((0..cases.len()).map(|_| None).collect::<Vec<_>>());
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(case) = cases.get(index) else { break };
                    let result = case.fly();
                    eprint!("\r{} of {} missions ", index + 1, cases.len());
                    if let Ok(mut flown) = flown.lock()
                        && let Some(place) = flown.get_mut(index)
                    {
                        *place = Some(result);
                    }
                }
            });
        }
    });
    eprintln!();
    flown.into_inner().unwrap_or_default()
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let seeds = arguments.number("--seeds")?.unwrap_or(24).max(1) as u64;
    let only = arguments.value("--only").unwrap_or_default();
    let mut cases = cases(seeds, arguments.value("--sensing").unwrap_or(SENSING))?;
    cases.retain(|case| case.line().contains(only));
    cases.truncate(arguments.number("--missions")?.unwrap_or(usize::MAX).max(1));
    let mut report = Report::default();
    report.table.push(format!("{:<70} {:>7} {:>7} {:>9}", "mission", "arrived", "s", "clear m"));
    let mut tallies: BTreeMap<(&str, &str), Tally> = BTreeMap::new();
    let (mut contacts, mut violations, mut errors, mut lost, mut unavoidable) = (0, 0, 0, 0, 0);
    for (case, flown) in cases.iter().zip(fly_all(&cases)) {
        let line = case.line();
        let summary = match flown {
            Some(Flown::Over(summary)) => summary,
            Some(Flown::Failed(reason)) => {
                errors += 1;
                println!("{}", json!({"block": "failure", "replay": line, "reason": reason}));
                continue;
            }
            None => {
                errors += 1;
                continue;
            }
        };
        let excuse = summary.unavoidable();
        let is_contact = summary.min_clearance_m.is_some_and(|clearance_m| clearance_m < 0.0);
        if let Some(reason) = summary.unsafe_because() {
            let is_excused = is_contact && excuse.is_some() && summary.limit_violations == 0;
            unavoidable += u64::from(is_excused);
            contacts += u64::from(is_contact && !is_excused);
            violations += u64::from(!is_contact);
            let block = if is_excused { "unavoidable" } else { "failure" };
            println!("{}", json!({"block": block, "replay": line, "reason": reason, "excuse": excuse}));
        }
        lost += u64::from(!summary.arrived);
        tallies.entry((case.fault, case.scenario)).or_default().count(&summary);
        let clearance_m = summary.min_clearance_m.unwrap_or(f64::INFINITY);
        let arrived = if summary.arrived { "yes" } else { "no" };
        report.table.push(format!("{line:<70} {arrived:>7} {:>7.1} {clearance_m:>9.3}", summary.mission_s));
    }
    report.table.push(String::new());
    report.table.push(format!(
        "{:<14} {:<14} {:>6} {:>8} {:>9} {:>8} {:>7}",
        "fault", "mission", "flown", "arrived", "belief ok", "doubted", "misled"
    ));
    for ((fault, scenario), tally) in &tallies {
        let Tally { flown, arrived, held, doubted, misled } = tally;
        println!(
            "{}",
            json!({"block": "fault", "fault": fault, "scenario": scenario, "flown": flown, "arrived": arrived, "held": held,
                "doubted": doubted, "misled": misled})
        );
        report
            .table
            .push(format!("{fault:<14} {scenario:<14} {flown:>6} {arrived:>8} {held:>9} {doubted:>8} {misled:>7}"));
    }
    let [flown, held, misled] = [|t: &Tally| t.flown, |t: &Tally| t.held, |t: &Tally| t.misled]
        .map(|of| f64::from(tallies.values().map(of).sum::<u32>()));
    report.table.push(format!(
        "belief ok: all ten parameters within {BOX_SIGMAS} of their sigmas at the end; misled: not so, and nothing is doubted: {misled}; \
         belief ok in {:.2} % of all",
        100.0 * held / flown.max(1.0)
    ));
    let n = cases.len().max(1) as f64;
    report.table.push(format!(
        "{n} missions, {lost} did not arrive, {unavoidable} contacts that no force within the limits would have prevented; with no \
         failure in {n} missions the rate of failures is below {:.4} at 95 %",
        3.0 / n
    ));
    report.none("contacts that could have been prevented", contacts as f64);
    report.none("missions in which a limit or an invariant did not hold", violations as f64);
    report.none("missions that ended with an error or a panic", f64::from(errors));
    report.finish()
}
