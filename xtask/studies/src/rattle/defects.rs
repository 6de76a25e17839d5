//! The defects of the research code, each switched on alone in a mission that is otherwise ours, against the healthy mission of the
//! same seed. None of them is an option of the libraries: they are layers of this study.

mod filter;
mod flight;
mod wrong;

use std::fmt::Write as _;

use serde_json::json;
use tumble::mission::tube_controllers;
use tumble_planning::ModelBelief;
use tumble_planning::control::Controller;
use tumble_planning::mission::{Action, Coordinator, Event, Note, Schedule, TimedEvent};

use super::flown::{Condition, band};
use super::{bad, claim};
use crate::Failure;
use crate::actuation::Section;
use crate::model_knowledge::{each_seed, median};
use flight::{Outcome, fly};

const SCENARIOS: [&str; 2] = ["iss-cargo", "granite-cargo"];
const TABLE: usize = 1;

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Defect {
    None,
    NothingAccumulated,
    NoObstacles,
    NoObstaclesUnchecked,
    CenterLeftOut,
    IzzNeverWeighted,
    TwoTerms,
    StoredSet,
    FirstBodyKept,
    EveryTenth,
    FromMeasurement,
    WithoutTransport,
    AsPublished,
    IxxForIzz,
    FiveNozzles,
    Reset,
    ResetAnew,
}

/// Of each: a name, and what is done here.
const DEFECTS: [(Defect, &str, &str); 17] = [
    (Defect::None, "none", "the loop of `tumble fly`"),
    (
        Defect::NothingAccumulated,
        "information of a stretch forgotten",
        "every stretch is planned with the covariance at first",
    ),
    (
        Defect::NoObstacles,
        "no obstacles in local plans",
        "stretches see nothing; the way does, and they are checked before they are flown",
    ),
    (Defect::NoObstaclesUnchecked, "the same, and flown unchecked", "no stretch and no stop is checked"),
    (
        Defect::CenterLeftOut,
        "centre of mass left out",
        "planners and controller get mass and inertia about the centre believed at first",
    ),
    (
        Defect::IzzNeverWeighted,
        "covariance read in another order",
        "Izz, compared with an entry that is zero, has no weight",
    ),
    (
        Defect::TwoTerms,
        "tube of two terms",
        "the original's controller: two-term set of the belief, gain of 1 s used each 0.2 s, mass of the first belief",
    ),
    (Defect::StoredSet, "tube stored with the code", "the same with the set that it falls back on"),
    (
        Defect::FirstBodyKept,
        "mass never refreshed in the controller",
        "the controller is told the first body with each new number",
    ),
    (Defect::EveryTenth, "every tenth measurement", "the estimator gets one of ten"),
    (
        Defect::FromMeasurement,
        "errors in variables",
        "beliefs are those of a parameter filter that predicts from the measurement before",
    ),
    (Defect::WithoutTransport, "and no transport term", "the same, its velocity in body axes does not turn"),
    (Defect::AsPublished, "and every tenth row", "the same with one measurement of ten: the filter as published"),
    (Defect::IxxForIzz, "Ixx copied into Izz", "planners of stretches are told Ixx for Izz"),
    (
        Defect::FiveNozzles,
        "five of six nozzles in the sum",
        "the wrench believed to act has the pressure of five nozzles; the sixth pushes along z, which no robot on the table does",
    ),
    (
        Defect::Reset,
        "parameters reset on orbit (6.5.5)",
        "from 40 s on all are told the first belief, with numbers that go on; the tube only ever narrows its interval of the mass",
    ),
    (Defect::ResetAnew, "and of the controller", "the same, and at 40 s the controller begins anew with that belief"),
];

/// Defects that cannot be switched on, and why.
const IMPOSSIBLE: [(&str, &str); 8] = [
    (
        "force not rotated in the local plan",
        "a plan is its inputs: what is flown is integrated from them by the one rigid-body model",
    ),
    (
        "criterion of one instant with a fixed 1, only its diagonal inverted",
        "the planner takes an information matrix and factorises it; the other criterion is a planner of its own, compared in `study information-bought`",
    ),
    ("planner and filter begin with different bodies", "the loop takes the first belief from its estimator"),
    ("parameters in different orders", "bodies have named fields; only the ten-vector of the library has an order"),
    ("estimate that is no body, and its reset", "the estimator's coordinates (log-Cholesky) are bodies only"),
    ("ungated jumps", "a gate has a probability below one; there is no estimator without"),
    (
        "plans that begin where the last was planned to end",
        "a stretch begins where what is flown will be: the loop gives its start, no planner does",
    ),
    ("belief of an older number", "refused by coordinator and controller, below"),
];

/// A flight that ended with an error has none.
type Flown = Option<Outcome>;

/// What the loop of this study is flown with, whatever the other parts fly: without a defect it is that of `tumble fly`, to the bit, where
/// noise is white, and not where sensors have filters and wander.
const SENSING: &str = "ideal";

pub fn section(_: &'static str, seeds: usize) -> Result<Section, Failure> {
    let cases: Vec<(usize, Defect)> = (0..SCENARIOS.len())
        .flat_map(|place| DEFECTS.map(|(defect, ..)| (place, defect)))
        .filter(|(place, defect)| *place == TABLE || *defect != Defect::IzzNeverWeighted)
        .collect();
    let flown = each_seed(cases.len() * seeds, |k| {
        let (place, defect) = cases[k as usize / seeds];
        fly(Condition::rattle(SCENARIOS[place], SENSING), 1 + k % seeds as u64, defect)
            .map_err(|error| error.to_string())
    });
    let mut section = Section::default();
    section.line("Flown with the sensors `ideal`.");
    let mut table = String::from(
        "scenario,defect,seed,arrived,time_s,clearance_m,tracking_m,tracking_last_m,mass_error,com_error_m,moment_error,mass_score,contradictions,refused\n",
    );
    for (place, scenario) in SCENARIOS.iter().enumerate() {
        section.line(format!("\n{scenario}, seeds 1 to {seeds}; tracking of the last quarter against the healthy flight of the same seed:"));
        section.columns(&[
            "defect",
            "arrives",
            "time, s",
            "clearance, m",
            "tracking, mm",
            "times",
            "m, %",
            "in sigmas",
            "centre, mm",
            "moments, %",
            "beliefs contradicted",
            "plans refused",
        ]);
        let of = |wanted: Defect| -> Vec<Flown> {
            let index = cases.iter().position(|case| *case == (place, wanted));
            let range = index.map_or(0..0, |index| index * seeds..(index + 1) * seeds);
            flown[range].iter().map(|one| one.as_ref().ok().copied()).collect()
        };
        let healthy = of(Defect::None);
        for (defect, name, _) in DEFECTS {
            let with = of(defect);
            if with.is_empty() {
                continue;
            }
            row(&mut section, scenario, name, &healthy, &with);
            for (seed, one) in with.iter().enumerate() {
                let Some(one) = one else { continue };
                let [mass, center, moment] = one.errors;
                let [whole, last] = one.tracking_m;
                let numbers = [one.mission_s, one.clearance_m, whole, last, mass, center, moment, one.mass_score];
                let numbers = numbers.map(|number| format!("{number:.6}")).join(",");
                let (seed, arrived) = (1 + seed, one.arrived);
                let _ = writeln!(
                    table,
                    "{scenario},{name},{seed},{arrived},{numbers},{},{}",
                    one.contradictions, one.refused
                );
            }
        }
        let is_safe = healthy.iter().all(|one| one.is_some_and(|one| one.arrived && one.clearance_m >= 0.0));
        section.must(is_safe, &format!("{scenario}: the healthy flights arrive and touch nothing"));
        reset(&mut section, scenario, &healthy, &of(Defect::ResetAnew));
    }
    section.tables.push(("defects.csv", table));
    section.line("\nWhat each is here:");
    section.columns(&["defect", "switched on by"]);
    for (_, name, what) in DEFECTS {
        section.row(&[name.to_owned(), what.to_owned()]);
    }
    section.line("\nWhat cannot be switched on:");
    section.columns(&["defect", "because"]);
    for (name, why) in IMPOSSIBLE {
        section.row(&[name.to_owned(), why.to_owned()]);
    }
    refused(&mut section)?;
    for ((place, defect), failed) in cases.iter().zip(flown.chunks(seeds)) {
        if let Some(Err(error)) = failed.iter().find(|one| one.is_err()) {
            section.line(format!("- {} with {defect:?} ended: {error}", SCENARIOS[*place]));
        }
    }
    Ok(section)
}

fn row(section: &mut Section, scenario: &str, name: &str, healthy: &[Flown], with: &[Flown]) {
    let n = with.len();
    let arrived = with.iter().flatten().filter(|one| one.arrived).count();
    let of = |figure: fn(&Outcome) -> f64| with.iter().flatten().map(figure).collect::<Vec<f64>>();
    let ratios: Vec<f64> = healthy
        .iter()
        .zip(with)
        .filter_map(|(healthy, with)| Some(with.as_ref()?.tracking_m[1] / healthy.as_ref()?.tracking_m[1]))
        .collect();
    let figures: [fn(&Outcome) -> f64; 8] = [
        |one| one.mission_s,
        |one| one.clearance_m,
        |one| 1e3 * one.tracking_m[1],
        |one| 100.0 * one.errors[0],
        |one| one.mass_score,
        |one| 1e3 * one.errors[1],
        |one| 100.0 * one.errors[2],
        |one| f64::from(one.contradictions),
    ];
    let [time, clearance, tracking, mass, score, center, moments, contradictions] =
        figures.map(|figure| band(of(figure)));
    let refused = band(of(|one| f64::from(one.refused)));
    println!(
        "{}",
        json!({"block": "defect", "scenario": scenario, "defect": name, "n": n, "arrived": arrived,
            "least_clearance_m": of(|one| one.clearance_m).into_iter().fold(f64::INFINITY, f64::min),
            "tracking_ratio": median(ratios.iter().copied()), "mass_error": median(of(|one| one.errors[0])),
            "center_error_m": median(of(|one| one.errors[1])), "moment_error": median(of(|one| one.errors[2]))})
    );
    section.row(&[
        name.to_owned(),
        format!("{arrived} of {n}"),
        time,
        clearance,
        tracking,
        band(ratios),
        mass,
        score,
        center,
        moments,
        contradictions,
        refused,
    ]);
}

/// What a reset on orbit does, where it gets through.
fn reset(section: &mut Section, scenario: &str, healthy: &[Flown], reset: &[Flown]) {
    let pairs: Vec<(Outcome, Outcome)> =
        healthy.iter().zip(reset).filter_map(|(healthy, reset)| Some(((*healthy)?, (*reset)?))).collect();
    let tracking: Vec<f64> = pairs.iter().map(|(healthy, reset)| reset.tracking_m[1] / healthy.tracking_m[1]).collect();
    let arrived = pairs.iter().filter(|(_, reset)| reset.arrived).count();
    claim(
        section,
        "6.5.5",
        &format!(
            "parameters and controller set back to their first values make the robot drift off course, {scenario}"
        ),
        !tracking.is_empty() && tracking.iter().all(|ratio| *ratio > 1.0),
        &format!(
            "last quarter {} times the healthy error, {arrived} of {} arrive; mass wrong by {} %",
            band(tracking),
            reset.len(),
            band(pairs.iter().map(|(_, reset)| 100.0 * reset.errors[0]))
        ),
    );
}

/// That no belief of an older or equal number gets through, whoever sends it.
fn refused(section: &mut Section) -> Result<(), Failure> {
    let mut coordinator = Coordinator::new(Schedule::default());
    let mut actions = Vec::new();
    coordinator.handle(&TimedEvent { time_ns: 0, event: Event::Begun }, &mut actions);
    let mut answers = Vec::new();
    for (time_ns, revision) in [(1, 7), (2, 7), (3, 6), (4, 0)] {
        actions.clear();
        let event = Event::Belief { revision, is_material: false };
        coordinator.handle(&TimedEvent { time_ns, event }, &mut actions);
        answers.push(actions.clone());
    }
    let offered = matches!(answers[0][..], [Action::Offer { revision: 7 }]);
    let stale = answers[1..].iter().all(|answer| answer[..] == [Action::Note(Note::Stale)]);
    let is_kept = offered && stale && coordinator.newest_revision() == 7;
    section.line("\nThe reset, sent as it would have to be, with a number that is not newer:");
    section.must(
        is_kept,
        "the coordinator offers revision 7, answers 7, 6 and 0 after it with a note that they are stale, and keeps 7",
    );
    let condition = Condition::rattle(SCENARIOS[0], SENSING);
    let problem = condition.source().and_then(|source| source.mission(&condition.options(1))).map_err(bad)?;
    let belief = |revision: u64| ModelBelief { revision, estimate: problem.prior };
    let mut controller = tube_controllers(&problem)(&belief(0)).map_err(bad)?;
    controller.adopt(&belief(7)).map_err(bad)?;
    let older = [6, 0].map(|revision| controller.adopt(&belief(revision)).is_err());
    section.must(older == [true; 2], "the controller that uses revision 7 refuses 6 and 0 with an error");
    section.line(
        "By type: a belief is its estimate and its number in one, plans and commands carry the number that they were made with, and nothing \
         outside the loop can write the belief it uses; the reset above had to be put between the loop and each of its layers, under new numbers.",
    );
    Ok(())
}
