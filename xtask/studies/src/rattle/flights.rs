//! Flights compared, seed by seed: informative against plain, with updates and without.

use tumble::mission::MissionRecord;

use super::claim;
use super::flown::{
    Condition, FOUR, IXX, IYY, IZZ, MASS, band, error_at, extremes, fly_all, information, information_at, may_arrive,
    must_arrive,
};
use super::pictures::{outlines, path};
use crate::Failure;
use crate::actuation::{Section, csv, curve};
use crate::model_knowledge::{median, turn_begins_s, variance_at};

/// Change that counts as comparable.
const COMPARABLE: f64 = 0.2;

/// The categories of the thesis, and plain flights with updates, which it did not fly.
struct Flights {
    plain: Vec<MissionRecord>,
    plain_updated: Vec<MissionRecord>,
    informed: Vec<MissionRecord>,
    updated: Vec<MissionRecord>,
}

pub fn section(sensing: &'static str, seeds: usize) -> Result<Section, Failure> {
    let rattle = Condition::rattle("iss-cargo", sensing);
    let conditions = [rattle.plain().without_updates(), rattle.plain(), rattle.without_updates(), rattle];
    let [plain, plain_updated, informed, updated] = fly_all(conditions, seeds)?;
    let flights = Flights { plain, plain_updated, informed, updated };
    let mut section = Section::default();
    must_arrive(&mut section, "plain, updates on", &flights.plain_updated);
    must_arrive(&mut section, "informative, updates on", &flights.updated);
    section.line("Without updates the tube holds a mass that is not the true one, and nothing is promised:");
    may_arrive(&mut section, "plain, updates off", &flights.plain);
    may_arrive(&mut section, "informative, updates off", &flights.informed);
    gathered(&mut section, &flights);
    estimates(&mut section, &flights);
    categories(&mut section, &flights);
    tracking(&mut section, &flights);
    tube(&mut section, &flights.updated);
    Ok(section)
}

/// Of each pair of flights with updates: a figure of the informative one over that of the plain one.
fn ratios(flights: &Flights, figure: impl Fn(&MissionRecord) -> f64) -> Vec<f64> {
    let pairs = flights.plain_updated.iter().zip(&flights.updated);
    pairs.map(|(plain, asking)| figure(asking) / figure(plain)).collect()
}

fn gathered(section: &mut Section, flights: &Flights) {
    section.line("\nFigures 6.13 and 6.15 compare flights with updates: without them the weights would never learn that they may go.");
    let before_turn = |i: usize| move |one: &MissionRecord| information_at(one, i, turn_begins_s(one));
    let mass = ratios(flights, |one| information_at(one, MASS, f64::INFINITY));
    claim(
        section,
        "Figure 6.13",
        "the information about the mass is comparable",
        (median(mass.iter().copied()) - 1.0).abs() <= COMPARABLE,
        &format!("informative over plain at the end: {}", band(mass)),
    );
    for (i, name) in [(IXX, "Ixx"), (IYY, "Iyy")] {
        let ratio = ratios(flights, before_turn(i));
        claim(
            section,
            "Figure 6.13",
            &format!("weights add information about {name}"),
            ratio.iter().all(|ratio| *ratio > 1.0),
            &format!("informative over plain before the final turn: {}", band(ratio)),
        );
    }
    let boost = |records: &[MissionRecord], i: usize| {
        let of = |one: &MissionRecord| {
            let turn = turn_begins_s(one);
            1.0 - information_at(one, i, turn) / information_at(one, i, f64::INFINITY)
        };
        records.iter().map(of).collect::<Vec<_>>()
    };
    let both = [&flights.plain_updated, &flights.updated].map(|records| boost(records, IZZ));
    claim(
        section,
        "Figure 6.13",
        "Izz gets a boost at the end by the yaw of the global plan, in both",
        both.iter().flatten().all(|share| *share > 0.25),
        &format!(
            "share of its information from the final turn on: plain {}, informative {}",
            band(both[0].iter().copied()),
            band(both[1].iter().copied())
        ),
    );
    let mut rows = Vec::new();
    for (file, title, i) in [
        ("figure_6_13_mass.svg", "Cumulative information about m, seed 1", MASS),
        ("figure_6_13_ixx.svg", "Cumulative information about Ixx, seed 1", IXX),
        ("figure_6_13_iyy.svg", "Cumulative information about Iyy, seed 1", IYY),
        ("figure_6_13_izz.svg", "Cumulative information about Izz, seed 1", IZZ),
    ] {
        let mut curves = Vec::new();
        for (k, (records, kind)) in
            [(&flights.plain_updated, "plain"), (&flights.updated, "informative")].into_iter().enumerate()
        {
            let Some(one) = records.first() else { continue };
            curves.push(curve(kind, information(one, i)));
            rows.extend(information(one, i).into_iter().map(|(t, x)| vec![k as f64, i as f64, t, x]));
        }
        section.draw(file, title, ["time, s", "1/variance, less that at first"], curves);
    }
    section.tables.push(("figure_6_13.csv", csv("informative,parameter,t_s,information", rows)));
}

fn estimates(section: &mut Section, flights: &Flights) {
    section.columns(&[
        "before the final turn",
        "variance, informative / plain",
        "error plain, %",
        "error informative, %",
    ]);
    for (i, name) in FOUR {
        let variance = ratios(flights, |one| variance_at(one, turn_begins_s(one), i));
        let error =
            |records: &[MissionRecord]| band(records.iter().map(|one| 100.0 * error_at(one, i, turn_begins_s(one))));
        section.row(&[name.to_owned(), band(variance), error(&flights.plain_updated), error(&flights.updated)]);
    }
    for (i, name) in [(IXX, "Ixx"), (IYY, "Iyy")] {
        let variance = ratios(flights, |one| variance_at(one, turn_begins_s(one), i));
        claim(
            section,
            "Figure 6.15",
            &format!("{name} is known more precisely with information weighting"),
            variance.iter().all(|ratio| *ratio < 1.0),
            &format!("variance before the final turn, informative over plain: {}", band(variance)),
        );
        let error = |records: &[MissionRecord]| median(records.iter().map(|one| error_at(one, i, turn_begins_s(one))));
        let [plain, asking] = [&flights.plain_updated, &flights.updated].map(|records| 100.0 * error(records));
        claim(
            section,
            "Figure 6.15",
            &format!("{name} is known more accurately with information weighting"),
            asking < plain,
            &format!("median error before the final turn {asking:.2} %, plain {plain:.2} %"),
        );
    }
    let mass = |records: &[MissionRecord]| median(records.iter().map(|one| 100.0 * error_at(one, MASS, f64::INFINITY)));
    let [plain, asking] = [mass(&flights.plain_updated), mass(&flights.updated)];
    claim(
        section,
        "Figure 6.15",
        "the mass comes out about as accurate (both within 3 %)",
        plain <= 3.0 && asking <= 3.0,
        &format!("median error in the end: plain {plain:.2} %, informative {asking:.2} %"),
    );
    let mut rows = Vec::new();
    for (file, title, i) in [
        ("figure_6_15_mass.svg", "m over its truth, seed 1", MASS),
        ("figure_6_15_ixx.svg", "Ixx over its truth, seed 1", IXX),
        ("figure_6_15_iyy.svg", "Iyy over its truth, seed 1", IYY),
        ("figure_6_15_izz.svg", "Izz over its truth, seed 1", IZZ),
    ] {
        let mut curves = Vec::new();
        for (k, (records, kind)) in
            [(&flights.plain_updated, "plain"), (&flights.updated, "informative")].into_iter().enumerate()
        {
            let Some(one) = records.first() else { continue };
            let (truth, series) = (one.summary.parameters[i].truth, &one.series);
            let at = |factor: f64| {
                let values = series.t_s.iter().zip(&series.estimate).zip(&series.sigma);
                values
                    .map(move |((t, ten), sigma)| (*t, (ten[i] + factor * sigma[i]) / truth))
                    .filter(|(t, _)| *t >= 4.0)
            };
            curves.push(curve(kind, at(0.0)));
            curves.push(curve(&format!("{kind} ± sigma"), at(1.0).chain([(f64::NAN, f64::NAN)]).chain(at(-1.0))));
            let values = series.t_s.iter().zip(&series.estimate).zip(&series.sigma);
            rows.extend(values.map(|((t, ten), sigma)| vec![k as f64, i as f64, *t, ten[i], sigma[i], truth]));
        }
        section.draw(file, title, ["time, s", "estimate / truth"], curves);
    }
    section.tables.push(("figure_6_15.csv", csv("informative,parameter,t_s,estimate,sigma,truth", rows)));
}

fn categories(section: &mut Section, flights: &Flights) {
    let all = [
        ("without information gain", &flights.plain),
        ("with", &flights.informed),
        ("with, and updates", &flights.updated),
    ];
    let reduced =
        |one: &MissionRecord, i: usize| 100.0 * (1.0 - variance_at(one, f64::INFINITY, i) / variance_at(one, 0.0, i));
    section.line("\nFigures 6.25 and 6.26, in the end:");
    section.columns(&[
        "category",
        "parameter",
        "error at first, %",
        "error, %",
        "variance less by, %",
        "variance less by before the final turn, %",
    ]);
    let mut rows = Vec::new();
    for (k, (name, records)) in all.into_iter().enumerate() {
        for (i, parameter) in FOUR {
            let turn = |one: &MissionRecord| {
                100.0 * (1.0 - variance_at(one, turn_begins_s(one), i) / variance_at(one, 0.0, i))
            };
            section.row(&[
                name.to_owned(),
                parameter.to_owned(),
                band(records.iter().map(|one| 100.0 * error_at(one, i, 0.0))),
                band(records.iter().map(|one| 100.0 * error_at(one, i, f64::INFINITY))),
                band(records.iter().map(|one| reduced(one, i))),
                band(records.iter().map(turn)),
            ]);
            rows.extend(records.iter().map(|one| {
                vec![
                    k as f64,
                    one.summary.seed as f64,
                    i as f64,
                    error_at(one, i, 0.0),
                    error_at(one, i, f64::INFINITY),
                    reduced(one, i),
                ]
            }));
        }
    }
    section.tables.push((
        "figure_6_26.csv",
        csv("category,seed,parameter,error_first,error_end,variance_reduction_percent", rows),
    ));
    let plain_mass: Vec<f64> = flights.plain.iter().map(|one| 100.0 * error_at(one, MASS, f64::INFINITY)).collect();
    claim(
        section,
        "Figure 6.25",
        "trajectories without information gain get the mass close to its value (within 5 %)",
        plain_mass.iter().all(|error| *error < 5.0),
        &format!("error {} %", band(plain_mass)),
    );
    let mass = all.map(|(_, records)| records.iter().map(|one| reduced(one, MASS)).collect::<Vec<_>>());
    claim(
        section,
        "Figure 6.26",
        "the variance of the mass falls a lot in all categories (by 90 % or more)",
        mass.iter().flatten().all(|less| *less >= 90.0),
        &mass.map(|values| format!("{} %", band(values))).join(", "),
    );
    for (i, name) in [(IXX, "Ixx"), (IYY, "Iyy"), (IZZ, "Izz")] {
        let pairs = || flights.plain.iter().zip(&flights.informed);
        let variance: Vec<f64> = pairs()
            .map(|(plain, asking)| variance_at(asking, f64::INFINITY, i) / variance_at(plain, f64::INFINITY, i))
            .collect();
        let error =
            |records: &[MissionRecord]| median(records.iter().map(|one| 100.0 * error_at(one, i, f64::INFINITY)));
        let [plain, asking] = [error(&flights.plain), error(&flights.informed)];
        claim(
            section,
            "Figure 6.26",
            &format!("less error and less final variance of {name} with information gain"),
            asking < plain && variance.iter().all(|ratio| *ratio < 1.0),
            &format!("variance {} of that without, median error {asking:.2} % against {plain:.2} %", band(variance)),
        );
    }
    let gain = |i: usize| {
        let pairs = flights.plain.iter().zip(&flights.informed);
        median(
            pairs.map(|(plain, asking)| variance_at(asking, f64::INFINITY, i) / variance_at(plain, f64::INFINITY, i)),
        )
    };
    claim(
        section,
        "Figure 6.26",
        "less of an effect on Izz, which the final yaw excites anyway",
        gain(IZZ) > gain(IXX).max(gain(IYY)),
        &format!("median variance with over without: Ixx {:.3}, Iyy {:.3}, Izz {:.3}", gain(IXX), gain(IYY), gain(IZZ)),
    );
    for (file, title, i) in [
        ("figure_6_25_mass.svg", "m over its truth, all seeds", MASS),
        ("figure_6_25_ixx.svg", "Ixx over its truth, all seeds", IXX),
        ("figure_6_25_iyy.svg", "Iyy over its truth, all seeds", IYY),
        ("figure_6_25_izz.svg", "Izz over its truth, all seeds", IZZ),
    ] {
        let curves = all.into_iter().map(|(name, records)| {
            let line = |one: &MissionRecord| {
                let truth = one.summary.parameters[i].truth;
                let points = one.series.t_s.iter().zip(&one.series.estimate).map(|(t, ten)| (*t, ten[i] / truth));
                points.chain([(f64::NAN, f64::NAN)]).collect::<Vec<_>>()
            };
            curve(name, records.iter().flat_map(line))
        });
        section.draw(file, title, ["time, s", "estimate / truth"], curves.collect());
    }
}

fn tracking(section: &mut Section, flights: &Flights) {
    let of = |records: &[MissionRecord]| {
        records.iter().map(|one| 1e3 * one.summary.rms_tracking_m.last_leg).collect::<Vec<f64>>()
    };
    let whole = |records: &[MissionRecord]| {
        records.iter().map(|one| 1e3 * one.summary.rms_tracking_m.all).collect::<Vec<f64>>()
    };
    let clear = |records: &[MissionRecord]| band(records.iter().filter_map(|one| one.summary.min_clearance_m));
    section.line("\nFigure 6.27:");
    section.columns(&[
        "flights",
        "tracking, mm RMS",
        "last quarter, mm RMS",
        "attitude, last quarter, deg RMS",
        "least clearance, m",
    ]);
    let attitude = |one: &MissionRecord| attitude_of(one).to_degrees();
    for (name, records) in [
        ("plain, updates off", &flights.plain),
        ("plain, updates on", &flights.plain_updated),
        ("informative, updates off", &flights.informed),
        ("informative, updates on", &flights.updated),
    ] {
        let cells = [band(whole(records)), band(of(records)), band(records.iter().map(attitude)), clear(records)];
        section.row(&[&[name.to_owned()][..], &cells].concat());
    }
    let [plain, asking] = [whole(&flights.plain_updated), whole(&flights.updated)];
    claim(
        section,
        "Figure 6.27",
        "the information-aware flights track worse than the regular ones (there because the turning cost the localisation, which here \
         it does not)",
        median(asking.iter().copied()) > median(plain.iter().copied()),
        &format!("{} mm against {} mm", band(asking), band(plain)),
    );
    for (kind, off, on) in
        [("plain", &flights.plain, &flights.plain_updated), ("informative", &flights.informed, &flights.updated)]
    {
        let position: fn(&MissionRecord) -> f64 = |one| one.summary.rms_tracking_m.last_leg;
        let figures = [("position", position), ("attitude", attitude_of)];
        for (what, figure) in figures {
            let change: Vec<f64> =
                off.iter().zip(on).map(|(off, on)| 100.0 * (figure(on) / figure(off) - 1.0)).collect();
            claim(
                section,
                "6.1, 6.6.3 (what the thesis could not show)",
                &format!("updates of the model lower the tracking error in the last quarter, {what}, {kind} flights"),
                median(change.iter().copied()) < 0.0,
                &format!("{} %", band(change)),
            );
        }
    }
    let mut curves = Vec::new();
    if let (Some(plain), Some(asking)) = (flights.plain_updated.first(), flights.updated.first()) {
        curves.push(outlines(asking));
        if let (Some(first), Some(second)) = (plain.ways.last(), asking.ways.last()) {
            curves.extend([
                path("global plan, plain", &first.points_m),
                path("global plan, informative", &second.points_m),
            ]);
        }
        curves.push(path("flown, plain", &plain.series.position_m));
        curves.push(path("flown, informative", &asking.series.position_m));
        let rows = [plain, asking].into_iter().enumerate().flat_map(|(k, one)| {
            let series = &one.series;
            let points = series.t_s.iter().zip(&series.position_m).zip(&series.wanted_position_m);
            points.map(move |((t, [x, y, z]), [a, b, c])| vec![k as f64, *t, *x, *y, *z, *a, *b, *c])
        });
        section
            .tables
            .push(("figure_6_27.csv", csv("informative,t_s,x_m,y_m,z_m,wanted_x_m,wanted_y_m,wanted_z_m", rows)));
    }
    section.draw("figure_6_27.svg", "Planned and flown, from above, seed 1", ["x, m", "y, m"], curves);
}

/// Root mean square angle from what was wanted in the last quarter, rad.
fn attitude_of(one: &MissionRecord) -> f64 {
    let from_s = 0.75 * one.summary.mission_s;
    let late = one.series.t_s.iter().zip(&one.series.attitude_error_rad).filter(|(t, _)| **t >= from_s);
    let (count, sum) = late.fold((0.0, 0.0), |(count, sum), (_, angle)| (count + 1.0, sum + angle * angle));
    f64::sqrt(sum / count)
}

fn tube(section: &mut Section, records: &[MissionRecord]) {
    let width = |tube: &[f64; 3]| tube.iter().copied().fold(0.0, f64::max);
    let ends = |one: &MissionRecord| {
        let first = one.series.tube_m.first().map_or(f64::NAN, width);
        one.series.tube_m.last().map_or(f64::NAN, width) / first
    };
    let ratios: Vec<f64> = records.iter().map(ends).collect();
    let [_, most] = extremes(&ratios);
    claim(
        section,
        "6.2.3",
        "the tube shrinks as the body becomes known",
        most < 1.0,
        &format!("largest half-width in the end over that at first {}", band(ratios)),
    );
    let lines = |one: &MissionRecord| {
        let points = one.series.t_s.iter().zip(&one.series.tube_m).map(|(t, tube)| (*t, 1e3 * width(tube)));
        points.chain([(f64::NAN, f64::NAN)]).collect::<Vec<_>>()
    };
    section.draw(
        "tube.svg",
        "Largest half-width of the tube, all seeds",
        ["time, s", "half-width, mm"],
        vec![curve("half-width", records.iter().flat_map(lines))],
    );
}
