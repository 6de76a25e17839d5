//! Whole missions, drawn: whether what the estimator says of the body is true, and what asking for information buys.

use super::{Interval, each_seed, median};
use crate::Failure;
use crate::targets::Report;
use nalgebra::{Matrix3, Quaternion, SMatrix, SVector, UnitQuaternion, Vector3};
use serde_json::json;
use tumble::TumbleError;
use tumble::mission::{
    FlownPeriod, FlyOptions, LayerNames, MissionHooks, MissionRecord, ModelChoice, WeightingChoice, fly,
};
use tumble::scenario::{ScenarioSource, draw_mission};
use tumble_astrobee::simulator::CONTROL_PERIOD_S;
use tumble_dynamics::InertialParameters;
use tumble_identification::Estimate;
use tumble_identification::statistics::{chi_square_quantile, clopper_pearson, normalized_squared_error};
use tumble_lie::Wrench;
use tumble_planning::mission::StretchSettings;

/// Where missions are flown, and what is claimed there.
struct Place {
    scenario: &'static str,
    /// The parameters that can be seen, in the order of the summary.
    seen: &'static [usize],
    /// The moments claimed, and by how much their variance is to be lower.
    moments: &'static [usize],
    lower: f64,
}

/// What information is worth: claims are made of what scenarios say, what RATTLE's own planners ask for is shown.
const WEIGHTS: [Option<f64>; 2] = [None, Some(100.0)];

const PLACES: [Place; 2] = [
    Place { scenario: "iss-cargo", seen: &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9], moments: &[4, 5], lower: 0.75 },
    Place { scenario: "granite-cargo", seen: &[0, 1, 2, 6], moments: &[6], lower: 0.5 },
];
/// Control periods between two copies of the estimate.
const BETWEEN_COPIES: u64 = 125;
/// The final turn has begun when this share of the way to the attitude of the goal is left for the last time.
const TURN_BEGUN: f64 = 0.9;
/// Most effort that asking may take, as a share of that of who does not ask.
const MOST_EFFORT: f64 = 1.05;

/// Distance of the nozzles from the axes that they turn the robot about, m: what a torque takes of their thrust.
const NOZZLE_ARM_M: f64 = 0.1;

/// Keeps the estimate, and what the wrench that acted took.
#[derive(Default)]
struct Copies {
    periods: u64,
    effort: Effort,
    kept: Vec<(f64, Estimate)>,
    last: Option<(f64, Estimate)>,
}

/// What a mission took.
#[derive(Clone, Copy, Debug, Default)]
struct Effort {
    /// The effort of the planner's objective, of the wrench that acted.
    cost: f64,
    /// Thrust of the nozzles, forces and torques together, N s.
    thrust_n_s: f64,
}

impl MissionHooks for Copies {
    fn period(&mut self, period: &FlownPeriod<'_>) -> Result<(), TumbleError> {
        let time_s = self.periods as f64 * CONTROL_PERIOD_S;
        if self.periods.is_multiple_of(BETWEEN_COPIES) {
            self.kept.push((time_s, *period.belief));
        }
        self.last = Some((time_s, *period.belief));
        let Wrench { torque, force } = &period.measured.realized_wrench_body;
        let [by_torque, by_force] = StretchSettings::default().effort;
        self.effort.cost += (by_torque * torque.norm_squared() + by_force * force.norm_squared()) * CONTROL_PERIOD_S;
        self.effort.thrust_n_s += (force.abs().sum() + torque.abs().sum() / NOZZLE_ARM_M) * CONTROL_PERIOD_S;
        self.periods += 1;
        Ok(())
    }
}

/// A mission and what was known when its excitation ended.
struct Flown {
    record: MissionRecord,
    effort: Effort,
    /// When the last weight went to zero, else the end of the mission, s.
    ended_s: f64,
    is_shut_off: bool,
    /// Normalised squared error of what can be seen.
    nees: f64,
    /// Errors and standard deviations of the ten.
    errors: [f64; 10],
    sigma: [f64; 10],
    truth: [f64; 10],
}

/// Flies a mission drawn; information is worth `weight`, or what the scenario says.
fn fly_drawn(place: &Place, seed: u64, weighting: WeightingChoice, weight: Option<f64>) -> Result<Flown, TumbleError> {
    let mut source = ScenarioSource::find(place.scenario)?;
    if let Some(weight) = weight {
        let table = source.scenario.fly.get_or_insert_default().information.get_or_insert_default();
        table.weight = Some(weight);
    }
    let source = draw_mission(&source, seed, 0.0)?;
    let options = FlyOptions {
        seed,
        weighting,
        feedback: true,
        model: ModelChoice::Scenario,
        fault: None,
        layers: LayerNames::default(),
    };
    let mut copies = Copies::default();
    let record = fly(&source, &options, &mut copies)?;
    let shut_off = &record.summary.information_shut_off_s;
    let asked = record.stretches.first().map_or(0, |stretch| stretch.quantities.len());
    let is_shut_off = asked > 0 && shut_off.len() == asked;
    let ended_s = if is_shut_off { shut_off.values().copied().fold(0.0, f64::max) } else { record.summary.mission_s };
    let after = copies.kept.iter().find(|(time_s, _)| *time_s >= ended_s).or(copies.last.as_ref());
    let estimate = after.map(|(_, estimate)| *estimate);
    let truth: [f64; 10] = std::array::from_fn(|i| record.summary.parameters.get(i).map_or(f64::NAN, |row| row.truth));
    let [m, x, y, z, xx, yy, zz, xy, xz, yz] = truth;
    let body =
        InertialParameters::about_com(m, Vector3::new(x, y, z), Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz));
    let (mut nees, mut errors, mut sigma) = (f64::NAN, [f64::NAN; 10], [f64::NAN; 10]);
    if let Some(estimate) = &estimate {
        nees = squared_error(estimate, &body, place.seen.len() == 10);
        let found = &estimate.parameters;
        let (com, inertia, std) = (found.center_of_mass(), found.inertia_about_com(), &estimate.std);
        let entries = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
        (errors[0], sigma[0]) = (found.mass - m, std.mass_kg);
        for i in 0..3 {
            (errors[1 + i], sigma[1 + i]) = (com[i] - truth[1 + i], std.center_of_mass_m[i]);
        }
        for (k, entry) in entries.into_iter().enumerate() {
            (errors[4 + k], sigma[4 + k]) = (inertia[entry] - truth[4 + k], std.inertia_about_com_kg_m2[entry]);
        }
    }
    Ok(Flown { record, effort: copies.effort, ended_s, is_shut_off, nees, errors, sigma, truth })
}

/// Of all ten parameters in space, of mass, first moments in the plane and the moment about z on a table.
fn squared_error(estimate: &Estimate, body: &InertialParameters<f64>, is_space: bool) -> f64 {
    let error = estimate.parameters.to_vector() - body.to_vector();
    let found = if is_space {
        normalized_squared_error(&error, &estimate.covariance)
    } else {
        let rows = [0, 1, 2, 9];
        let error = SVector::<f64, 4>::from_fn(|i, _| error[rows[i]]);
        let covariance = SMatrix::<f64, 4, 4>::from_fn(|i, j| estimate.covariance[(rows[i], rows[j])]);
        normalized_squared_error(&error, &covariance)
    };
    found.unwrap_or(f64::INFINITY)
}

fn all(place: &Place, seeds: usize, weighting: WeightingChoice) -> Result<Vec<Flown>, Failure> {
    let flown = each_seed(seeds, |seed| fly_drawn(place, seed, weighting, None));
    flown.into_iter().collect::<Result<_, _>>().map_err(|error| Failure::BadInput(error.to_string()))
}

/// Coverage over drawn missions.
pub fn coverage(report: &mut Report, seeds: usize) -> Result<(), Failure> {
    for place in &PLACES {
        let flown = all(place, seeds, WeightingChoice::Covariance)?;
        judge_coverage(report, place, &flown);
    }
    Ok(())
}

fn judge_coverage(report: &mut Report, place: &Place, flown: &[Flown]) {
    let n = flown.len();
    let count = |is: &dyn Fn(&Flown) -> bool| flown.iter().filter(|one| is(one)).count();
    let arrived = count(&|one| one.record.summary.arrived);
    let collided = count(&|one| one.record.summary.min_clearance_m.is_some_and(|clearance| clearance < 0.0));
    let violating = count(&|one| one.record.summary.limit_violations > 0);
    let fallen_back = count(&|one| !one.record.summary.fallbacks.is_empty());
    let shut_off = count(&|one| one.is_shut_off);
    let name = place.scenario;
    report.table.push(format!(
        "\ncoverage, {name}, seeds 0..{n}: arrived {arrived} {}, collisions {collided}, missions with violations {violating}, with fallback {fallen_back}; excitation ended before the end in {shut_off}, at {:.0} s (median)",
        clopper_pearson(arrived, n, 0.95),
        median(flown.iter().map(|one| one.ended_s)),
    ));
    let mut rows = Vec::new();
    for &i in place.seen {
        let label = flown.first().and_then(|one| one.record.summary.parameters.get(i)).map_or("?", |row| &row.name);
        let within = count(&|one| one.errors[i].abs() <= 2.0 * one.sigma[i]);
        // moments and products as a share of the moments of their axes
        let unit = |one: &Flown| match i {
            0 => one.truth[0],
            1..=3 => 1.0,
            4..=6 => one.truth[i],
            7 => (one.truth[4] * one.truth[5]).sqrt(),
            8 => (one.truth[4] * one.truth[6]).sqrt(),
            _ => (one.truth[5] * one.truth[6]).sqrt(),
        };
        let error = median(flown.iter().map(|one| one.errors[i].abs() / unit(one)));
        let sigma = median(flown.iter().map(|one| one.sigma[i] / unit(one)));
        let share = within as f64 / n as f64;
        report.table.push(format!(
            "  {label:11} within 2 sigma {share:.3} {}; median error {error:.5}, median sigma {sigma:.5}",
            clopper_pearson(within, n, 0.95)
        ));
        rows.push(json!({"parameter": label, "within": within, "median_error": error, "median_sigma": sigma}));
        let claim = format!("{name} {label}: within 2 sigma >= 0.93");
        report.target(claim, share >= 0.93, format!("{share:.3} {}", clopper_pearson(within, n, 0.95)));
        let most = match i {
            0 if place.seen.len() == 10 => 0.01,
            0 => 0.02,
            1..=3 => 0.003,
            4..=6 => 0.03,
            _ => continue,
        };
        report.at_most(&format!("{name} {label}: median error"), error, most);
    }
    let limit = chi_square_quantile(place.seen.len() as f64, 0.99);
    let inside = count(&|one| one.nees <= limit);
    let band = clopper_pearson(inside, n, 0.95);
    let share = inside as f64 / n as f64;
    report.table.push(format!(
        "  in the 99 % set {share:.3} {band}; median normalised squared error {:.2} of {} parameters",
        median(flown.iter().map(|one| one.nees)),
        place.seen.len()
    ));
    report.target(format!("{name}: truth in the 99 % set >= 0.98"), share >= 0.98, format!("{share:.3} {band}"));
    report.target(format!("{name}: all arrive"), arrived == n, format!("{arrived} of {n}"));
    report.none(&format!("{name}: collisions"), collided as f64);
    report.none(&format!("{name}: missions with limit violations"), violating as f64);
    println!(
        "{}",
        json!({"block": "model-knowledge", "part": "coverage", "scenario": name, "n": n, "arrived": arrived,
            "collisions": collided, "violations": violating, "fallback": fallen_back, "shut_off": shut_off,
            "in_99_percent_set": inside, "parameters": rows})
    );
}

fn attitude([x, y, z, w]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// When the final turn begins: the last time at which most of the way to the goal's attitude is left, s.
pub fn turn_begins_s(record: &MissionRecord) -> f64 {
    let wanted: Vec<_> = record.series.wanted_quaternion_xyzw.iter().map(|one| attitude(*one)).collect();
    let (Some(first), Some(last)) = (wanted.first(), wanted.last()) else { return 0.0 };
    let whole = first.angle_to(last);
    let times = record.series.t_s.iter().zip(&wanted);
    times.filter(|(_, at)| at.angle_to(last) >= TURN_BEGUN * whole).map(|(t, _)| *t).fold(0.0, f64::max)
}

/// Variance of a parameter, by its place in the summary, at a mission time.
pub fn variance_at(record: &MissionRecord, time_s: f64, i: usize) -> f64 {
    let row = record.series.t_s.partition_point(|t| *t <= time_s).saturating_sub(1);
    record.series.sigma.get(row).map_or(f64::NAN, |sigma| sigma[i] * sigma[i])
}

/// A pair of missions of one seed: plain, informative.
#[derive(Clone)]
struct Pair {
    /// Ratios of the variance of each moment claimed: each before its own final turn, then both at the earlier one.
    own: Vec<f64>,
    same: Vec<f64>,
    mass: f64,
    impulse: [f64; 2],
    angular_impulse: [f64; 2],
    effort: [Effort; 2],
    arrived: [bool; 2],
    mission_s: [f64; 2],
    turns_s: [f64; 2],
}

impl Pair {
    fn of(place: &Place, [plain, asking]: [&Flown; 2]) -> Self {
        let effort = [plain.effort, asking.effort];
        let [plain, asking] = [&plain.record, &asking.record];
        let turns_s = [turn_begins_s(plain), turn_begins_s(asking)];
        let earlier = turns_s[0].min(turns_s[1]);
        let ratio = |i: usize, at: [f64; 2]| variance_at(asking, at[1], i) / variance_at(plain, at[0], i);
        Self {
            own: place.moments.iter().map(|i| ratio(*i, turns_s)).collect(),
            same: place.moments.iter().map(|i| ratio(*i, [earlier; 2])).collect(),
            mass: ratio(0, turns_s),
            impulse: [plain.summary.impulse_n_s, asking.summary.impulse_n_s],
            angular_impulse: [plain.summary.angular_impulse_n_m_s, asking.summary.angular_impulse_n_m_s],
            effort,
            arrived: [plain.summary.arrived, asking.summary.arrived],
            mission_s: [plain.summary.mission_s, asking.summary.mission_s],
            turns_s,
        }
    }
}

/// Informative against plain: claims are made of the first of [`WEIGHTS`].
pub fn informative(report: &mut Report, seeds: usize) -> Result<(), Failure> {
    for place in &PLACES {
        let flown = each_seed(seeds, |seed| {
            let plain = fly_drawn(place, seed, WeightingChoice::None, None)?;
            let asking = |weight: &Option<f64>| fly_drawn(place, seed, WeightingChoice::Covariance, *weight);
            WEIGHTS.iter().map(|weight| Ok(Pair::of(place, [&plain, &asking(weight)?]))).collect()
        });
        let flown = flown.into_iter().collect::<Result<Vec<Vec<Pair>>, TumbleError>>();
        let flown = flown.map_err(|error| Failure::BadInput(error.to_string()))?;
        for (which, weight) in WEIGHTS.into_iter().enumerate() {
            let pairs: Vec<Pair> = flown.iter().map(|sides| sides[which].clone()).collect();
            judge_pairs(report, place, (weight, which == 0), &pairs);
        }
    }
    Ok(())
}

fn judge_pairs(report: &mut Report, place: &Place, (weight, is_claimed): (Option<f64>, bool), pairs: &[Pair]) {
    let (name, n) = (place.scenario, pairs.len());
    let worth = weight.map_or_else(|| "the scenario's weight".to_owned(), |weight| format!("weight {weight}"));
    let arrived = [0, 1].map(|which: usize| pairs.iter().filter(|pair| pair.arrived[which]).count());
    report.table.push(format!(
        "\ninformative against plain, {name}, {worth}, seeds 0..{n}: arrived {} against {}; final turn begins at {:.0} s, {:.0} s (medians)",
        arrived[1],
        arrived[0],
        median(pairs.iter().map(|pair| pair.turns_s[0])),
        median(pairs.iter().map(|pair| pair.turns_s[1])),
    ));
    let mut rows = Vec::new();
    for (k, i) in place.moments.iter().enumerate() {
        let axis = ["xx", "yy", "zz"][i - 4];
        let own = Interval::of(pairs, |pairs| 1.0 - median(pairs.iter().map(|pair| pair.own[k])));
        let same = Interval::of(pairs, |pairs| 1.0 - median(pairs.iter().map(|pair| pair.same[k])));
        report.table.push(format!(
            "  I{axis}: variance before the final turn lower by {own} (each its own turn), {same} (same mission time), medians"
        ));
        if is_claimed {
            let claim = format!("{name}: variance of I{axis} before the final turn lower by >= {}", place.lower);
            report.target(claim, own.value >= place.lower, own.to_string());
        }
        rows.push(
            json!({"moment": axis, "own": [own.value, own.low, own.high], "same": [same.value, same.low, same.high]}),
        );
    }
    let ratio = |of: fn(&Pair) -> [f64; 2]| {
        Interval::of(pairs, |pairs| {
            let [plain, asking] = pairs.iter().map(of).fold([0.0; 2], |sum, one| [sum[0] + one[0], sum[1] + one[1]]);
            asking / plain
        })
    };
    let (impulse, angular) = (ratio(|pair| pair.impulse), ratio(|pair| pair.angular_impulse));
    let thrust = ratio(|pair| pair.effort.map(|effort| effort.thrust_n_s));
    let cost = ratio(|pair| pair.effort.map(|effort| effort.cost));
    let time = ratio(|pair| pair.mission_s);
    let mass = Interval::of(pairs, |pairs| median(pairs.iter().map(|pair| pair.mass)));
    report.table.push(format!(
        "  ratios: force impulse {impulse}, torque impulse {angular}, thrust of the nozzles {thrust}, effort in the objective {cost}, time {time}; variance of the mass, median {mass}"
    ));
    if is_claimed {
        for (what, found) in [("thrust of the nozzles", thrust), ("effort in the objective", cost), ("time", time)] {
            report.target(format!("{name}: {what} at most 5 % more"), found.value <= MOST_EFFORT, found.to_string());
        }
        report.target(format!("{name}: variance of the mass not shown larger"), mass.low <= 1.0, mass.to_string());
    }
    println!(
        "{}",
        json!({"block": "model-knowledge", "part": "informative", "scenario": name, "weight": weight, "n": n, "moments": rows,
            "arrived": arrived,
            "impulse_ratio": [impulse.value, impulse.low, impulse.high],
            "angular_impulse_ratio": [angular.value, angular.low, angular.high],
            "thrust_ratio": [thrust.value, thrust.low, thrust.high],
            "objective_effort_ratio": [cost.value, cost.low, cost.high],
            "time_ratio": [time.value, time.low, time.high],
            "mass_variance_ratio": [mass.value, mass.low, mass.high]})
    );
}
