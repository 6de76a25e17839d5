//! In the module: the tree, replanning around an astronaut, learning until the weights are off, excitation on the spot.

use std::fmt::Write as _;

use tumble::mission::{MissionRecord, WayRow};
use tumble_astrobee::worlds::WorldPreset;

use super::flown::{
    Condition, FOUR, IXX, IYY, IZZ, MASS, band, error_at, extremes, fly_all, information, information_at, must_arrive,
    name_of, score, torque_rms, weight, weights_over_time,
};
use super::pictures::{outlines, path, segments};
use super::{bad, claim};
use crate::Failure;
use crate::actuation::{Section, csv, curve};
use crate::model_knowledge::turn_begins_s;

/// Table 6.4; its last column is headed Iyy once more.
const TABLE_6_4: [f64; 4] = [9.5838, 0.1534, 0.1427, 0.1623];
/// Standard deviations within which an estimate is near its truth.
const NEAR: f64 = 3.0;

pub fn section(sensing: &'static str, seeds: usize) -> Result<Section, Failure> {
    let conditions = ["iss-cargo", "iss-astronaut", "iss-station"].map(|scenario| Condition::rattle(scenario, sensing));
    let [learning, astronaut, station] = fly_all(conditions, seeds)?;
    let mut section = Section::default();
    tables(&mut section);
    tree(&mut section, &learning);
    replanning(&mut section, &astronaut)?;
    evolution(&mut section, conditions[0], &learning)?;
    standing(&mut section, &station);
    Ok(section)
}

fn tables(section: &mut Section) {
    section.line("Table 6.1. The thesis has a simulator of three and six degrees of freedom, a granite table of three, and the station of six; here:");
    section.columns(&["place", "degrees of freedom"]);
    for (place, name) in [(WorldPreset::Granite, "granite"), (WorldPreset::Iss, "iss")] {
        section.row(&[name.to_owned(), if place.is_planar() { "3" } else { "6" }.to_owned()]);
    }
    let both = WorldPreset::Granite.is_planar() && !WorldPreset::Iss.is_planar();
    claim(section, "Table 6.1", "both kinds are flown", both, "3 and 6");
    let body = WorldPreset::Iss.body();
    let inertia = body.inertia_about_com();
    let ours = [body.mass, inertia[(0, 0)], inertia[(1, 1)], inertia[(2, 2)]];
    let same = ours.iter().zip(TABLE_6_4).all(|(ours, printed)| (ours - printed).abs() < 6e-5);
    let found = ours.map(|x| format!("{x:.4}")).join(", ");
    claim(section, "Table 6.4", "m, Ixx, Iyy, Izz of the robot, to the digits printed", same, &found);
}

fn tree(section: &mut Section, records: &[MissionRecord]) {
    must_arrive(section, "iss-cargo", records);
    let Some(record) = records.first() else { return };
    let Some(way) = record.ways.first() else { return };
    let edges: Vec<_> = records.iter().filter_map(|one| Some(one.ways.first()?.tree_m.len() as f64)).collect();
    let found = records.iter().filter(|one| !one.ways.is_empty()).count();
    claim(
        section,
        "Figure 6.8",
        "the tree reaches the goal between the obstacles",
        found == records.len(),
        &format!("ways for {found} of {} seeds; edges kept for the picture {}", records.len(), band(edges)),
    );
    let mut table = String::from("edge,x0_m,y0_m,z0_m,x1_m,y1_m,z1_m\n");
    for (index, [[a, b, c], [d, e, f]]) in way.tree_m.iter().enumerate() {
        let _ = writeln!(table, "{index},{a:.5},{b:.5},{c:.5},{d:.5},{e:.5},{f:.5}");
    }
    section.tables.push(("figure_6_8.csv", table));
    let curves = vec![
        segments("tree", way.tree_m.iter().map(<[[f64; 3]; 2]>::as_slice)),
        outlines(record),
        path("way", &way.points_m),
        path("flown", &record.series.position_m),
    ];
    section.draw("figure_6_8.svg", "Tree and way, from above, seed 1", ["x, m", "y, m"], curves);
}

/// Whether a way leads through an obstacle, both taken as grown by the robot's radius: not exact, and enough for a way through the
/// middle of one.
fn hits(way: &WayRow, from_s: f64, record: &MissionRecord, obstacle: usize) -> bool {
    let Some(solid) = record.obstacles.get(obstacle) else { return false };
    let inside = |point: &[f64; 3]| {
        let share =
            |axis: usize| (point[axis] - solid.center_m[axis]) / (solid.semi_axes_m[axis] + record.robot_radius_m);
        (0..3).map(|axis| share(axis).powi(2)).sum::<f64>() < 1.0
    };
    way.t_s >= from_s && way.points_m.iter().any(inside)
}

fn replanning(section: &mut Section, records: &[MissionRecord]) -> Result<(), Failure> {
    must_arrive(section, "iss-astronaut", records);
    let first = records.first().ok_or_else(|| bad("no mission"))?;
    let astronaut = first.obstacles.iter().position(|one| one.seen_s[0] > 0.0).ok_or_else(|| bad("no astronaut"))?;
    let seen_s = first.obstacles[astronaut].seen_s[0];
    let n = records.len();
    let before = |one: &MissionRecord| {
        one.ways.iter().rfind(|way| way.t_s < seen_s).is_some_and(|way| hits(way, 0.0, one, astronaut))
    };
    let in_the_way = records.iter().filter(|one| before(one)).count();
    let replanned: Vec<_> = records.iter().filter(|one| one.ways.iter().any(|way| way.t_s >= seen_s)).collect();
    let still = replanned.iter().filter(|one| one.ways.iter().any(|way| hits(way, seen_s, one, astronaut))).count();
    let delay = replanned.iter().filter_map(|one| Some(one.ways.iter().find(|way| way.t_s >= seen_s)?.t_s - seen_s));
    claim(
        section,
        "Figure 6.9",
        "a global replan around the astronaut, and the robot makes it to the goal",
        still == 0 && replanned.len() >= in_the_way && records.iter().all(|one| one.summary.arrived),
        &format!(
            "the way before led through the astronaut with {in_the_way} of {n} seeds; {} planned another, {still} of these led through it; \
             asked for {} s after it was seen (the robot stops first)",
            replanned.len(),
            band(delay)
        ),
    );
    let informative =
        |one: &&MissionRecord| one.stretches.iter().any(|stretch| stretch.weights.iter().any(|w| *w > 0.0));
    let local = records.iter().filter(informative).count();
    claim(
        section,
        "Figure 6.9",
        "local plans add information between nodes of the global plan",
        local == n,
        &format!("informative stretches were flown with {local} of {n} seeds"),
    );
    let mut curves = vec![outlines(first), path("flown", &first.series.position_m)];
    if let (Some(old), Some(new)) = (first.ways.iter().rfind(|way| way.t_s < seen_s), first.ways.last()) {
        curves.extend([path("way before", &old.points_m), path("way after", &new.points_m)]);
    }
    let excited = first.stretches.iter().filter(|stretch| stretch.weights.iter().any(|w| *w > 0.0));
    curves.push(segments("informative stretches", excited.map(|stretch| stretch.points_m.as_slice())));
    section.draw("figure_6_9.svg", "Around the astronaut, from above, seed 1", ["x, m", "y, m"], curves);
    let series = &first.series;
    let rows = series.t_s.iter().zip(&series.position_m).zip(&series.wanted_position_m);
    let rows = rows.map(|((t, [x, y, z]), [a, b, c])| vec![*t, *x, *y, *z, *a, *b, *c]);
    section.tables.push(("figure_6_9.csv", csv("t_s,x_m,y_m,z_m,wanted_x_m,wanted_y_m,wanted_z_m", rows)));
    Ok(())
}

/// When the weight of a parameter was gone for good, s.
fn shut_off_s(record: &MissionRecord, parameter: usize) -> Option<f64> {
    record.summary.information_shut_off_s.get(name_of(record, parameter)).copied()
}

fn evolution(section: &mut Section, condition: Condition, records: &[MissionRecord]) -> Result<(), Failure> {
    let n = records.len();
    section.columns(&["parameter", "error at first, %", "at the end, %", "in sigmas", "weight off at, s"]);
    for (parameter, name) in FOUR {
        let percent = |time_s: f64| band(records.iter().map(|one| 100.0 * error_at(one, parameter, time_s)));
        section.row(&[
            name.to_owned(),
            percent(0.0),
            percent(f64::INFINITY),
            band(records.iter().map(|one| score(one, parameter))),
            band(records.iter().filter_map(|one| shut_off_s(one, parameter))),
        ]);
    }
    let scores = || records.iter().flat_map(|one| FOUR.map(|(parameter, _)| score(one, parameter)));
    let (near, all) = (scores().filter(|score| *score <= NEAR).count(), 4 * n);
    let better =
        |one: &MissionRecord| FOUR.iter().all(|(i, _)| error_at(one, *i, f64::INFINITY) < error_at(one, *i, 0.0));
    let nearer = records.iter().filter(|one| better(one)).count();
    claim(
        section,
        "Figure 6.10",
        "estimates converge to the truth, within their bounds",
        near == all && nearer == n,
        &format!("{near} of {all} within {NEAR} sigma, all four nearer than at first with {nearer} of {n} seeds"),
    );
    shut_off(section, condition, records)?;
    let ratios = |of: &dyn Fn(&MissionRecord) -> Option<f64>| records.iter().filter_map(of).collect::<Vec<_>>();
    for (parameter, name) in [(IXX, "Ixx"), (IYY, "Iyy")] {
        let shares = ratios(&|one| {
            let turn = turn_begins_s(one);
            let until = one.stretches.iter().find(|stretch| weight(stretch, name_of(one, parameter)) == 0.0)?.start_s;
            let at = |time_s: f64| information_at(one, parameter, time_s);
            (until < turn).then(|| at(until) / at(turn))
        });
        claim(
            section,
            "Figure 6.10",
            &format!(
                "information about {name} grows while its weight is on: most of what there is before the final turn"
            ),
            !shares.is_empty() && shares.iter().all(|share| *share > 0.5),
            &format!(
                "share {}; above one where the drift that the estimator allows for has taken some back",
                band(shares)
            ),
        );
    }
    let free = ratios(&|one| {
        let off = shut_off_s(one, MASS)?;
        Some(information_at(one, MASS, f64::INFINITY) / information_at(one, MASS, off))
    });
    claim(
        section,
        "Figure 6.10",
        "information about the mass keeps growing after its weight is off",
        !free.is_empty() && free.iter().all(|ratio| *ratio > 1.0),
        &if free.is_empty() {
            "no weight of the mass went off".to_owned()
        } else {
            format!("at the end {} times that at the shut-off", band(free))
        },
    );
    let turned = ratios(&|one| {
        let turn = turn_begins_s(one);
        let gained =
            |parameter| information_at(one, parameter, f64::INFINITY) / information_at(one, parameter, turn) - 1.0;
        Some(gained(IZZ) / gained(IXX).max(gained(IYY)))
    });
    claim(
        section,
        "Figure 6.10",
        "the final yaw gives information about Izz for nothing: its share grows more than those of Ixx and Iyy",
        turned.iter().all(|ratio| *ratio > 1.0),
        &format!("relative growth during the final turn {} times that of the other two", band(turned)),
    );
    let quiet = ratios(&|one| {
        let end = one.stretches.iter().find(|stretch| weight(stretch, name_of(one, IXX)) == 0.0)?.start_s;
        let turn = turn_begins_s(one);
        (end < turn).then(|| torque_rms(one, one.stretches[0].start_s, end) / torque_rms(one, end, turn))
    });
    claim(
        section,
        "Figure 6.10",
        "after the shut-off the robot only goes to its goal: less torque",
        !quiet.is_empty() && quiet.iter().all(|ratio| *ratio > 1.0),
        &format!("with weights {} times as much (RMS, before the final turn)", band(quiet)),
    );
    if let Some(record) = records.first() {
        draw_evolution(section, record);
    }
    Ok(())
}

/// A weight is off at the first stretch that begins with its variance below the threshold, and not before.
fn shut_off(section: &mut Section, condition: Condition, records: &[MissionRecord]) -> Result<(), Failure> {
    let options = condition.options(1);
    let problem = condition.source().and_then(|source| source.mission(&options)).map_err(bad)?;
    let law = &problem.weighting;
    let (mut off, mut last_on, mut kept, mut all) = (Vec::new(), Vec::new(), 0, 0);
    for record in records {
        for (index, target) in law.target_variance.iter().enumerate() {
            all += 1;
            let over = |row: &[[f64; 2]]| {
                row.get(index).map_or(f64::NAN, |[before, _]| before * before / (law.alpha * target))
            };
            let on = |weights: &[f64]| weights.get(index).is_some_and(|weight| *weight > 0.0);
            let first_off = record.stretches.iter().position(|stretch| !on(&stretch.weights));
            let stays =
                first_off.is_some_and(|first| record.stretches[first..].iter().all(|stretch| !on(&stretch.weights)));
            kept += usize::from(stays);
            off.extend(first_off.map(|first| over(&record.stretches[first].sigma)));
            last_on.extend(
                first_off.and_then(|first| first.checked_sub(1)).map(|last| over(&record.stretches[last].sigma)),
            );
        }
    }
    let right = off.iter().all(|share| *share <= 1.0) && last_on.iter().all(|share| *share > 1.0);
    claim(
        section,
        "Figure 6.10",
        "weights shut off as the variance comes to alpha times its target, and stay off",
        right && kept == all,
        &format!(
            "{kept} of {all} weights off for good; variance over the threshold at the last stretch with weight {}, at the first without {}",
            band(last_on),
            band(off)
        ),
    );
    Ok(())
}

/// Pictures of each parameter: its estimate; its information and weight.
const EVOLUTION: [[&str; 4]; 4] = [
    [
        "figure_6_10_mass.svg",
        "m over its truth, seed 1",
        "figure_6_10_mass_information.svg",
        "Information about m, seed 1",
    ],
    [
        "figure_6_10_ixx.svg",
        "Ixx over its truth, seed 1",
        "figure_6_10_ixx_information.svg",
        "Information about Ixx, seed 1",
    ],
    [
        "figure_6_10_iyy.svg",
        "Iyy over its truth, seed 1",
        "figure_6_10_iyy_information.svg",
        "Information about Iyy, seed 1",
    ],
    [
        "figure_6_10_izz.svg",
        "Izz over its truth, seed 1",
        "figure_6_10_izz_information.svg",
        "Information about Izz, seed 1",
    ],
];
/// The first seconds are wider than the page.
const DRAWN_FROM_S: f64 = 5.0;

fn draw_evolution(section: &mut Section, record: &MissionRecord) {
    let series = &record.series;
    let mut header = String::from("t_s");
    let mut rows: Vec<Vec<f64>> = series.t_s.iter().map(|t| vec![*t]).collect();
    for ((parameter, name), [file, title, information_file, information_title]) in FOUR.into_iter().zip(EVOLUTION) {
        let truth = record.summary.parameters[parameter].truth;
        let _ = write!(header, ",{name},{name}_sigma,{name}_information,{name}_weight");
        let steps = weights_over_time(record, name_of(record, parameter));
        for (index, (row, (_, gained))) in rows.iter_mut().zip(information(record, parameter)).enumerate() {
            let weight = steps.iter().rev().find(|(t, _)| *t <= row[0]).map_or(0.0, |(_, weight)| *weight);
            row.extend([series.estimate[index][parameter], series.sigma[index][parameter], gained, weight]);
        }
        let at = |k: f64| {
            let value = move |i: usize| (series.estimate[i][parameter] + k * series.sigma[i][parameter]) / truth;
            let points = series.t_s.iter().enumerate().map(move |(i, t)| (*t, value(i)));
            points.filter(|(t, _)| *t >= DRAWN_FROM_S)
        };
        let mut curves =
            vec![curve(name, at(0.0)), curve("± sigma", at(1.0).chain([(f64::NAN, f64::NAN)]).chain(at(-1.0)))];
        if let Some(off_s) = shut_off_s(record, parameter) {
            let drawn: Vec<f64> = at(1.0).chain(at(-1.0)).map(|(_, y)| y).collect();
            curves.push(curve("weight off", extremes(&drawn).map(|y| (off_s, y))));
        }
        section.draw(file, title, ["time, s", "estimate / truth"], curves);
        let gained = information(record, parameter);
        let most = gained.iter().map(|(_, x)| *x).fold(0.0, f64::max);
        let gathered = vec![
            curve("information over its largest", gained.into_iter().map(|(t, x)| (t, x / most))),
            curve("weight over its largest", steps),
        ];
        section.draw(information_file, information_title, ["time, s", "share"], gathered);
    }
    section.tables.push(("figure_6_10.csv", csv(&header, rows)));
}

fn standing(section: &mut Section, records: &[MissionRecord]) {
    must_arrive(section, "iss-station", records);
    let drift = |one: &MissionRecord| {
        let Some(first) = one.series.position_m.first() else { return f64::NAN };
        let away = |at: &[f64; 3]| f64::sqrt((0..3).map(|i| (at[i] - first[i]).powi(2)).sum());
        one.series.position_m.iter().map(away).fold(0.0, f64::max)
    };
    let sigma = |one: &MissionRecord, i: usize| {
        let [first, last] =
            [one.series.sigma.first(), one.series.sigma.last()].map(|row| row.map_or(f64::NAN, |ten| ten[i]));
        last / first
    };
    let worst: Vec<f64> =
        records.iter().map(|one| FOUR.iter().map(|(i, _)| sigma(one, *i)).fold(0.0, f64::max)).collect();
    claim(
        section,
        "Station keeping (the flight tests 21 and 22; figure 6.14 is a photograph)",
        "three stretches of excitation on the spot teach mass and moments",
        worst.iter().all(|ratio| *ratio < 0.5),
        &format!(
            "largest of the four standard deviations {} of that at first; at most {} m from where it began",
            band(worst.iter().copied()),
            band(records.iter().map(drift))
        ),
    );
}
