//! `study real-sensors`: simulated flights as their sensors show them, identified without any option, against the truth:
//! `cargo xtask study real-sensors [--seeds N] [--first SEED] [--only SCENARIO]`.
//!
//! Seeds begin at 901, none of which anything was tuned on. An answer that is wrong beyond five of its own standard deviations and does not say so
//! ends the study with exit code 3, and so does a scenario of which too few are answered.

mod drawn;

use std::time::Instant;

use nalgebra::{DMatrix, DVector};
use serde_json::json;
use tumble::TumbleError;
use tumble::flight_log::Recorder;
use tumble::mission::{FlownPeriod, FlyOptions, LayerNames, MissionHooks, ModelChoice, WeightingChoice, fly};
use tumble::robots::shipped;
use tumble::scenario::ScenarioSource;
use tumble_dynamics::InertialParameters;
use tumble_formats::FormatsError;
use tumble_formats::log::LogReader;
use tumble_identification::{Identification, MotionSample, Pipeline, Settings};

use crate::Failure;
use crate::arguments::Arguments;
use crate::targets::Report;

const FIRST_SEED: u64 = 901;
const SEEDS: usize = 24;
/// A scenario, and the share of its logs that must be answered: station keeping by itself excites nothing but noise.
const SCENARIOS: [(&str, f64); 15] = [
    ("iss-excite", 0.98),
    (THESIS_FLIGHT, 0.98),
    ("iss-payload", 0.98),
    ("iss-hold", 0.98),
    ("iss-hold/bumble", 0.98),
    ("iss-thesis-sensors", 0.98),
    ("granite-excite", 0.98),
    ("iss-cargo", 0.0),
    ("iss-station", 0.0),
    ("tube-hold", 0.0),
    ("fly/iss-cargo", 0.9),
    ("fly/iss-cargo/plain", 0.9),
    ("fly/granite-cargo", 0.0),
    ("fly/granite-cargo/plain", 0.0),
    (DRAWN, 0.75),
];
/// A mission in closed loop, whose body is held to a way by a controller; as `plain` without information weights, so that next to nothing turns it.
const FLY: &str = "fly/";
const PLAIN: &str = "/plain";
/// Of these sensors: stamps that jitter, late and lost estimates, jumps, an accelerometer with scales.
const THESIS_FLIGHT: &str = "iss-excite/thesis-flight";
/// Other robots: their bodies, sensors, filters, rates and delays are drawn. Filters that are long beside a segment colour what is left, and are
/// doubted.
const DRAWN: &str = "drawn-sensors";
/// Beyond this many standard deviations an answer that is not doubted is a lie.
const LIE: f64 = 5.0;
/// Half of a normal variable's 95 % interval.
const COVERED: f64 = 1.96;

fn bad(error: impl std::fmt::Display) -> Failure {
    Failure::BadInput(format!("real-sensors: {error}"))
}

/// Writes the log of a mission.
struct Written<'a>(Recorder<&'a mut Vec<u8>>);

impl MissionHooks for Written<'_> {
    fn period(&mut self, period: &FlownPeriod<'_>) -> Result<(), TumbleError> {
        let written = self.0.record(period.measured, period.estimates);
        Ok(written.map_err(|source| FormatsError::Unwritable { path: "log".into(), source })?)
    }
}

/// The log of a mission, and the body that flew.
fn mission(name: &str, seed: u64) -> Result<(Vec<u8>, InertialParameters<f64>), Failure> {
    let plain = name.strip_suffix(PLAIN);
    let source = ScenarioSource::find(plain.unwrap_or(name)).map_err(bad)?.among(&shipped());
    let options = FlyOptions {
        seed,
        weighting: if plain.is_some() { WeightingChoice::None } else { WeightingChoice::Covariance },
        feedback: true,
        model: ModelChoice::Scenario,
        fault: None,
        layers: LayerNames::default(),
    };
    let mut text = Vec::new();
    let mut written = Written(Recorder::new(&mut text).map_err(bad)?);
    let record = fly(&source, &options, &mut written).map_err(bad)?;
    written.0.finish().map_err(bad)?;
    Ok((text, record.summary.body_at_end()))
}

/// What a log says.
fn read(text: &[u8], name: &str) -> Result<Vec<MotionSample>, Failure> {
    let mut reader = LogReader::from_reader(text, name.as_ref(), false).map_err(bad)?;
    let mut record = Vec::new();
    while let Some(sample) = reader.next_sample().map_err(bad)? {
        record.push(sample);
    }
    Ok(record)
}

/// The log of a flight, and the body that flew.
fn flown(name: &str, seed: u64) -> Result<(Vec<MotionSample>, InertialParameters<f64>), Failure> {
    if name == DRAWN {
        return drawn::flown(seed).map_err(bad);
    }
    if let Some(name) = name.strip_prefix(FLY) {
        let (text, body) = mission(name, seed)?;
        return Ok((read(&text, name)?, body));
    }
    let (scenario, sensing) = name.split_once('/').unzip();
    let mut source = ScenarioSource::find(scenario.unwrap_or(name)).map_err(bad)?.among(&shipped());
    if let Some(sensing) = sensing {
        source = source.sensed_by(sensing).map_err(bad)?;
    }
    source.scenario.seed = seed;
    let mut flight = source.flight().map_err(bad)?;
    let mut text = Vec::new();
    let mut recorder = Recorder::new(&mut text).map_err(bad)?;
    while let Some(measured) = flight.step().map_err(bad)? {
        recorder.record(&measured, flight.simulator.estimates()).map_err(bad)?;
    }
    recorder.finish().map_err(bad)?;
    Ok((read(&text, name)?, flight.simulator.body()))
}

/// An answer against the truth, in standard deviations: mass, then centre of mass and inertia as far as they are determined.
struct Answer {
    mass_error: f64,
    z: Vec<f64>,
    /// Squared error of all that is determined in units of its joint covariance, per parameter; all ten only.
    nees: Option<f64>,
    mass_sigma: f64,
    identified: bool,
}

fn answer(found: &Identification, truth: &InertialParameters<f64>) -> Option<Answer> {
    let body = found.estimate.as_ref().or(found.regularised.as_ref())?;
    let determined = found.determined();
    let (a, b, std) = (&body.parameters, truth, &body.std);
    let center = a.center_of_mass() - b.center_of_mass();
    let inertia = a.inertia_about_com() - b.inertia_about_com();
    let entries = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
    let of_center = (0..3).map(|i| center[i] / std.center_of_mass_m[i]);
    let of_inertia = entries.iter().map(|&entry| inertia[entry] / std.inertia_about_com_kg_m2[entry]);
    let all = core::iter::once((a.mass - b.mass) / std.mass_kg).chain(of_center).chain(of_inertia);
    let z: Vec<f64> = all.zip(determined).filter(|(_, determined)| *determined).map(|(z, _)| z).collect();
    let nees = determined.iter().all(|determined| *determined).then(|| {
        let error = DVector::from_column_slice((a.to_vector() - b.to_vector()).as_slice());
        let size = DVector::from_fn(10, |i, _| body.covariance[(i, i)].sqrt());
        let joint = DMatrix::from_fn(10, 10, |i, j| body.covariance[(i, j)] / (size[i] * size[j]));
        let error = error.component_div(&size);
        joint.cholesky().map_or(f64::INFINITY, |factor| error.dot(&factor.solve(&error)) / 10.0)
    });
    determined[0].then(|| Answer {
        mass_error: a.mass / b.mass - 1.0,
        z,
        nees,
        mass_sigma: std.mass_kg / b.mass,
        identified: found.verdict.is_identified(),
    })
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0_f64), |(sum, count), x| (sum + x * x, count + 1.0));
    (sum / count).sqrt()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0_f64), |(sum, count), x| (sum + x, count + 1.0));
    sum / count
}

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let seeds = arguments.number("--seeds")?.unwrap_or(SEEDS) as u64;
    let first = arguments.number("--first")?.map_or(FIRST_SEED, |seed| seed as u64);
    let only = arguments.value("--only");
    let known = || SCENARIOS.iter().map(|(name, _)| *name);
    if let Some(name) = only.filter(|only| !known().any(|name| name == *only)) {
        return Err(bad(format!("`--only {name}`: {}", known().collect::<Vec<_>>().join(", "))));
    }
    let mut report = Report::default();
    report.table.push(format!(
        "{:<20}{:>9}{:>9}{:>10}{:>10}{:>8}{:>8}{:>10}{:>8}{:>9}{:>8}",
        "scenario",
        "answered",
        "doubted",
        "mass rms",
        "bound",
        "mean z",
        "rms z",
        "covered",
        "NEES",
        "worst z",
        "s/log"
    ));
    for (name, least_answered) in SCENARIOS.into_iter().filter(|(name, _)| only.is_none_or(|only| only == *name)) {
        let (mut answers, mut busy_s) = (Vec::new(), 0.0);
        for seed in first..first + seeds {
            eprintln!("{name}, seed {seed} ...");
            let (record, truth) = flown(name, seed)?;
            let clock = Instant::now();
            let found = Pipeline::new().identify(&record, &Settings::default()).map_err(bad)?;
            busy_s += clock.elapsed().as_secs_f64();
            let answer = answer(&found, &truth);
            if let Some(answer) = &answer {
                println!(
                    "{}",
                    json!({"block": "log", "scenario": name, "seed": seed, "method": found.method,
                        "identified": answer.identified, "mass_error": answer.mass_error, "z": answer.z, "nees": answer.nees})
                );
            }
            answers.extend(answer);
        }
        let stated: Vec<&Answer> = answers.iter().filter(|answer| answer.identified).collect();
        let worst = stated.iter().flat_map(|answer| &answer.z).fold(0.0, |worst: f64, z| worst.max(z.abs()));
        let of_mass = || stated.iter().map(|answer| answer.z[0]);
        let all_z = || stated.iter().flat_map(|answer| answer.z.iter().copied());
        let covered = mean(all_z().map(|z| if z.abs() < COVERED { 1.0 } else { 0.0 }));
        report.table.push(format!(
            "{name:<20}{:>8.0}%{:>8.0}%{:>9.3}%{:>9.3}%{:>8.2}{:>8.2}{:>9.1}%{:>8.2}{worst:>9.2}{:>8.2}",
            100.0 * stated.len() as f64 / seeds as f64,
            100.0 * (answers.len() - stated.len()) as f64 / seeds as f64,
            100.0 * root_mean_square(stated.iter().map(|answer| answer.mass_error)),
            100.0 * root_mean_square(stated.iter().map(|answer| answer.mass_sigma)),
            mean(of_mass()),
            root_mean_square(of_mass()),
            100.0 * covered,
            mean(stated.iter().filter_map(|answer| answer.nees)),
            busy_s / seeds as f64,
        ));
        report.at_most(
            &format!("{name}: worst error of an answer that is not doubted, standard deviations"),
            worst,
            LIE,
        );
        if least_answered > 0.0 {
            let share = stated.len() as f64 / seeds as f64;
            report.at_least(&format!("{name}: share answered"), share, least_answered);
        }
    }
    report.table.push(
        "of answers that are not doubted; bound: root mean square of the stated standard deviation of the mass"
            .to_owned(),
    );
    report.finish()
}
