//! On the table: excitation that ends, and what asking for information does to variances with and without the payload.

use tumble::mission::{MissionRecord, ModelChoice, StretchRow};
use tumble::scenario::ScenarioSource;

use super::flown::{
    Condition, IZZ, Load, MASS, band, error_at, fly_all, must_arrive, name_of, score, torque_rms, weight,
};
use super::pictures::{outlines, path, segments};
use super::{bad, claim};
use crate::Failure;
use crate::actuation::{Section, csv, curve};
use crate::model_knowledge::{median, turn_begins_s, variance_at};

/// Table 6.2: masses (kg) and moments about z (kg m^2) of the robot, the payload, and both; distance of the payload and offset of
/// both along y, m: the 305 as millimetres.
const TABLE_6_2: ([f64; 3], [f64; 3], f64, f64) = ([19.0, 11.8, 30.8], [0.25, 0.015, 0.94], 0.305, -0.12);
/// Table 6.3: change of the variance of Izz and of the mass, %, without and with the payload.
const TABLE_6_3: [[f64; 2]; 2] = [[-25.01, 2.47], [-38.05, -3.71]];

pub fn section(sensing: &'static str, seeds: usize) -> Result<Section, Failure> {
    let rattle = Condition { model: ModelChoice::High, ..Condition::rattle("granite-cargo", sensing) };
    let (alone, loaded) = (Condition { load: Load::Nothing, ..rattle }, Condition { load: Load::Table62, ..rattle });
    let conditions = [
        Condition::rattle("granite-cargo", sensing),
        alone.plain(),
        alone,
        loaded.plain(),
        loaded,
        Condition::rattle("granite-grasp", sensing),
    ];
    let [cargo, alone_plain, alone, loaded_plain, loaded, grasped] = fly_all(conditions, seeds)?;
    let mut section = Section::default();
    demonstration(&mut section, &cargo);
    hardware(&mut section)?;
    grasp(&mut section, &grasped);
    variances(&mut section, [[&alone_plain, &alone], [&loaded_plain, &loaded]]);
    Ok(section)
}

fn demonstration(section: &mut Section, records: &[MissionRecord]) {
    must_arrive(section, "granite-cargo", records);
    let name = |one: &MissionRecord| name_of(one, IZZ).to_owned();
    // over that of the first stretch
    let shares = |place: fn(&[StretchRow]) -> Option<&StretchRow>| {
        let at = |one: &MissionRecord, stretch: Option<&StretchRow>| {
            stretch.map_or(f64::NAN, |stretch| weight(stretch, &name(one)))
        };
        records.iter().map(|one| at(one, place(&one.stretches)) / at(one, one.stretches.first())).collect::<Vec<f64>>()
    };
    let (half, last) = (shares(|stretches| stretches.get(stretches.len() / 2)), shares(<[StretchRow]>::last));
    let torque: Vec<f64> = records
        .iter()
        .filter_map(|one| {
            let end = one.stretches.iter().find(|stretch| weight(stretch, &name(one)) == 0.0)?.start_s;
            let turn = turn_begins_s(one);
            (end < turn).then(|| torque_rms(one, one.stretches[0].start_s, end) / torque_rms(one, end, turn))
        })
        .collect();
    claim(
        section,
        "Figure 6.7",
        "excitation in local plans goes down towards the end of the trajectory",
        last.iter().all(|share| *share < 1.0) && !torque.is_empty() && torque.iter().all(|ratio| *ratio > 1.0),
        &format!(
            "weight of Izz over that at first: half-way {}, at the end {}; torque while it has weight {} times that after, before the \
             final turn (RMS)",
            band(half),
            band(last),
            band(torque)
        ),
    );
    let Some(record) = records.first() else { return };
    let is_informative = |stretch: &&StretchRow| weight(stretch, name_of(record, IZZ)) > 0.0;
    let of = |informative: bool| {
        record
            .stretches
            .iter()
            .filter(move |stretch| is_informative(stretch) == informative)
            .map(|stretch| stretch.points_m.as_slice())
    };
    let curves = vec![
        outlines(record),
        path("flown", &record.series.position_m),
        segments("stretches that ask for information about Izz", of(true)),
        segments("the others", of(false)),
    ];
    section.draw("figure_6_7.svg", "The table from above, seed 1", ["x, m", "y, m"], curves);
    let series = &record.series;
    let rows = series.t_s.iter().zip(&series.position_m).zip(&series.torque_n_m);
    let rows = rows.map(|((t, [x, y, _]), [.., z])| vec![*t, *x, *y, *z]);
    section.tables.push(("figure_6_7.csv", csv("t_s,x_m,y_m,torque_z_n_m", rows)));
}

/// Table 6.2: that its columns belong together, and what we fly.
fn hardware(section: &mut Section) -> Result<(), Failure> {
    let ([robot, payload, both], [robot_izz, payload_izz, both_izz], distance_m, offset_m) = TABLE_6_2;
    let options = Condition::rattle("granite-grasp", "nominal").options(1);
    let truth = ScenarioSource::find("granite-grasp").and_then(|source| source.mission(&options)).map_err(bad)?.truth;
    let (com, inertia) = (truth.center_of_mass(), truth.inertia_about_com()[(2, 2)]);
    let composed = robot_izz + payload_izz + robot * payload / both * distance_m * distance_m;
    section.line(format!(
        "\nTable 6.2: the printed parts compose to {:.1} kg, {composed:.3} kg m^2 about the common centre, which is {:.3} m off; printed {both}, \
         {both_izz}, {offset_m}.",
        robot + payload,
        payload / both * distance_m
    ));
    let near = |found: f64, printed: f64, share: f64| (found - printed).abs() <= share * printed.abs();
    let holds = near(truth.mass, both, 0.005) && near(inertia, both_izz, 0.02) && near(com.y, offset_m, 0.05);
    let found = format!("m {:.2} kg, Izz {inertia:.3} kg m^2, cx {:.3} m, cy {:.3} m", truth.mass, com.x, com.y);
    claim(section, "Table 6.2", "the combined system, from its parts, the payload 305 mm away", holds, &found);
    Ok(())
}

fn grasp(section: &mut Section, records: &[MissionRecord]) {
    must_arrive(section, "granite-grasp", records);
    let mass = records.iter().map(|one| 100.0 * error_at(one, MASS, f64::INFINITY)).collect::<Vec<_>>();
    let moment = records.iter().map(|one| 100.0 * error_at(one, IZZ, f64::INFINITY)).collect::<Vec<_>>();
    claim(
        section,
        "Figure 6.11 (a photograph of the payload held)",
        "a payload of table 6.2 taken hold of on the way is learned",
        mass.iter().all(|error| *error < 5.0) && moment.iter().all(|error| *error < 10.0),
        &format!("error in the end: m {} %, Izz {} %", band(mass), band(moment)),
    );
}

/// Pairs of plain and informative flights, without payload and with.
fn variances(section: &mut Section, [alone, loaded]: [[&[MissionRecord]; 2]; 2]) {
    let change = |[plain, asking]: [&[MissionRecord]; 2], i: usize, at: fn(&MissionRecord) -> f64| {
        let pairs = plain.iter().zip(asking);
        pairs
            .map(|(plain, asking)| {
                100.0 * (variance_at(asking, at(asking), i) / variance_at(plain, at(plain), i) - 1.0)
            })
            .collect::<Vec<f64>>()
    };
    let end: fn(&MissionRecord) -> f64 = |_| f64::INFINITY;
    let turn: fn(&MissionRecord) -> f64 = turn_begins_s;
    for (pair, what, [printed, printed_mass]) in
        [(alone, "without payload", TABLE_6_3[0]), (loaded, "with payload", TABLE_6_3[1])]
    {
        for (records, kind) in pair.iter().zip(["plain", "informative"]) {
            must_arrive(section, &format!("granite, {what}, {kind}"), records);
        }
        let at_end = change(pair, IZZ, end);
        claim(
            section,
            "Table 6.3",
            &format!("informative plans leave less variance of Izz, {what}"),
            at_end.iter().all(|change| *change < 0.0),
            &format!(
                "{} % at the end, {} % before the final turn; printed {printed} %",
                band(at_end.iter().copied()),
                band(change(pair, IZZ, turn))
            ),
        );
        let mass = change(pair, MASS, end);
        claim(
            section,
            "Table 6.3",
            &format!("and about as much of the mass (within 10 %), {what}"),
            median(mass.iter().copied()).abs() <= 10.0,
            &format!("{} % at the end; printed {printed_mass} %", band(mass)),
        );
        let near = |records: &[MissionRecord]| {
            let scores = records.iter().flat_map(|one| [score(one, MASS), score(one, IZZ)]);
            scores.filter(|score| *score <= 3.0).count()
        };
        let n = 2 * pair[1].len();
        claim(
            section,
            "Figure 6.12",
            &format!("in simulation m and Izz converge to their values, {what} (on the hardware they did not)"),
            near(pair[1]) == n,
            &format!(
                "{} of {n} within 3 sigma; error in the end: m {} %, Izz {} %",
                near(pair[1]),
                band(pair[1].iter().map(|one| 100.0 * error_at(one, MASS, f64::INFINITY))),
                band(pair[1].iter().map(|one| 100.0 * error_at(one, IZZ, f64::INFINITY)))
            ),
        );
    }
    let mut rows = Vec::new();
    for (i, file, title) in [
        (MASS, "figure_6_12_mass.svg", "Mass over its truth, seed 1"),
        (IZZ, "figure_6_12_izz.svg", "Izz over its truth, seed 1"),
    ] {
        let mut curves = Vec::new();
        let named = [
            (alone[0], "plain"),
            (alone[1], "informative"),
            (loaded[0], "plain, payload"),
            (loaded[1], "informative, payload"),
        ];
        for (k, (records, name)) in named.into_iter().enumerate() {
            let Some(one) = records.first() else { continue };
            let truth = one.summary.parameters[i].truth;
            let points = one.series.t_s.iter().zip(&one.series.estimate).map(|(t, ten)| (*t, ten[i] / truth));
            curves.push(curve(name, points));
            let values = one.series.t_s.iter().zip(&one.series.estimate).zip(&one.series.sigma);
            rows.extend(values.map(|((t, ten), sigma)| vec![k as f64, i as f64, *t, ten[i], sigma[i], truth]));
        }
        section.draw(file, title, ["time, s", "estimate / truth"], curves);
    }
    section.tables.push(("figure_6_12.csv", csv("case,parameter,t_s,estimate,sigma,truth", rows)));
}
