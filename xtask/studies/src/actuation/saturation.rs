//! Figure 6.23: torque about z as commanded and after saturation, and what taking one for the other costs the estimates.

use nalgebra::Vector3;
use tumble_astrobee::sensing::LocalizationSettings;
use tumble_lie::Wrench;

use super::flight::{
    self, Flown, Motion, PLANNER_CODE, Plan, STEP_S, Source, body, calibrated, delayed, measured, published,
    through_the_chain,
};
use super::{Section, Size, Spread, csv, curve};
use crate::Failure;
use crate::chapter4::in_parallel;

const SECONDS: f64 = 60.0;
const PARAMETERS: [&str; 4] = ["m", "Ixx", "Iyy", "Izz"];

/// What is known of the motion, in the order of results.
const MOTIONS: [fn(&Flown) -> Motion; 2] = [exact, published];

/// The true motion of the centre of mass.
fn exact(flown: &Flown) -> Motion {
    let com = body().center_of_mass();
    let of_com = |p: &flight::Period| {
        let (rate, alpha) = (p.truth.state.twist_body.angular, p.truth.angular_acceleration_body);
        p.truth.acceleration_origin_body + alpha.cross(&com) + rate.cross(&rate.cross(&com))
    };
    Motion {
        acceleration: flown.periods.iter().map(of_com).collect(),
        angular_acceleration: flown.periods.iter().map(|p| p.truth.angular_acceleration_body).collect(),
    }
}

/// Errors of mass and moments by (6.23)-(6.25), %: acceleration regressed on force, angular acceleration on torque, each after its
/// delay.
fn errors(wrenches: &[Wrench<f64>], motion: &Motion, [angular_s, linear_s]: [f64; 2]) -> [f64; 4] {
    let split = |of: fn(&Wrench<f64>) -> Vector3<f64>| wrenches.iter().map(of).collect::<Vec<_>>();
    let forces = delayed(&split(|w| w.force), linear_s);
    let torques = delayed(&split(|w| w.torque), angular_s);
    let body = body();
    let inner = |a: &[Vector3<f64>], b: &[Vector3<f64>], axis: Option<usize>| -> f64 {
        a.iter().zip(b).map(|(a, b)| axis.map_or_else(|| a.dot(b), |i| a[i] * b[i])).sum()
    };
    let mass = inner(&forces, &forces, None) / inner(&forces, &motion.acceleration, None);
    let moments = body.inertia_about_com();
    let moment = |i: usize| inner(&torques, &torques, Some(i)) / inner(&torques, &motion.angular_acceleration, Some(i));
    [
        100.0 * (mass / body.mass - 1.0),
        100.0 * (moment(0) / moments[(0, 0)] - 1.0),
        100.0 * (moment(1) / moments[(1, 1)] - 1.0),
        100.0 * (moment(2) / moments[(2, 2)] - 1.0),
    ]
}

/// What one flight shows.
struct Found {
    saturated: f64,
    /// Root mean square of commanded less realised torque about z over that of the commanded one.
    missed_z: f64,
    /// With exact and with published motion, by source.
    errors: [[[f64; 4]; 4]; 2],
    /// With published motion and the replayed wrench filtered as the sensors are.
    filtered: [f64; 4],
    fastest_rad_s: f64,
}

/// Delays of `[angular, linear]` acceleration, with exact and with published motion, by source.
type Delays = [[[f64; 2]; 4]; 2];

fn delays(sensors: &LocalizationSettings) -> Result<Delays, Failure> {
    let mut all = [[[0.0; 2]; 4]; 2];
    for (by_source, motion) in all.iter_mut().zip(MOTIONS) {
        for (found, source) in by_source.iter_mut().zip(Source::ALL) {
            *found = calibrated(sensors, source, motion)?;
        }
    }
    Ok(all)
}

fn found(plan: &Plan, delays: &Delays, seed: u64) -> Result<Found, Failure> {
    let flown = flight::fly(plan, seed)?;
    let [commanded, _, realised, replayed] = Source::ALL.map(|source| source.wrenches(&flown));
    let square = |of: &dyn Fn(usize) -> f64| (0..commanded.len()).map(|k| of(k) * of(k)).sum::<f64>().sqrt();
    let mut errors_of = [[[0.0; 4]; 4]; 2];
    for ((errors_of, motion), delays) in errors_of.iter_mut().zip(MOTIONS).zip(delays) {
        let motion = motion(&flown);
        for ((errors_of, source), delay) in errors_of.iter_mut().zip(Source::ALL).zip(delays) {
            *errors_of = errors(&source.wrenches(&flown), &motion, *delay);
        }
    }
    let filtered = through_the_chain(&replayed, &plan.sensors)?;
    Ok(Found {
        filtered: errors(&filtered, &published(&flown), [0.0; 2]),
        saturated: flown.periods.iter().filter(|p| p.saturated).count() as f64 / flown.periods.len() as f64,
        missed_z: square(&|k| commanded[k].torque.z - realised[k].torque.z) / square(&|k| commanded[k].torque.z),
        errors: errors_of,
        fastest_rad_s: measured(&flown).rate.iter().map(Vector3::norm).fold(0.0, f64::max),
    })
}

pub fn section(size: Size) -> Result<Section, Failure> {
    let mut section = Section::default();
    let plan = Plan::new(LocalizationSettings::nominal(), SECONDS);
    let sessions = [
        ("first session: planner limits of table 6.7", plan.clone()),
        ("the same within the controller limits of table 6.7", plan.clone().within_table_6_7()),
        ("planner limits of the public code", plan.clone().with_peak(PLANNER_CODE)),
    ];
    section.line(format!(
        "Informative wrench on every axis at once, {SECONDS} s, healthy sensors, mode 2. Planner limits of table 6.7: 0.1 N and 0.05 N m; of the \
         public code: 0.15 N and 0.015 N m."
    ));
    section.columns(&["session", "periods saturated", "torque about z missed, rms", "fastest rate, rad/s"]);
    let delays = delays(&plan.sensors)?;
    let mut all = Vec::new();
    for (name, plan) in &sessions {
        let found = in_parallel(size.flights, |seed| found(plan, &delays, seed as u64))
            .into_iter()
            .collect::<Result<Vec<_>, Failure>>()?;
        section.row(&[
            (*name).to_owned(),
            format!("{:.1} %", Spread::of(found.iter().map(|f| f.saturated)).times(100.0)),
            format!("{:.1} %", Spread::of(found.iter().map(|f| f.missed_z)).times(100.0)),
            format!("{:.2}", found.iter().map(|f| f.fastest_rad_s).fold(0.0, f64::max)),
        ]);
        all.push(found);
    }
    for (m, about) in [
        (0, "true motion of the centre of mass: what the wrench alone costs"),
        (1, "published acceleration and differentiated rate, as the thesis"),
    ] {
        section.line(format!(
            "\nErrors of (6.23)-(6.25), %, bias ± spread over {} flights; {about}; each wrench shifted by its delay, found once on a flight without saturation:",
            size.flights
        ));
        section.columns(&["session", "wrench", PARAMETERS[0], PARAMETERS[1], PARAMETERS[2], PARAMETERS[3]]);
        for ((name, _), found) in sessions.iter().zip(&all) {
            for (s, source) in Source::ALL.iter().enumerate() {
                let cells = [0, 1, 2, 3].map(|p| {
                    let spread = Spread::of(found.iter().map(|f| f.errors[m][s][p]));
                    format!("{:+.2} ± {:.2}", spread.mean, spread.sigma)
                });
                section.row(&[vec![(*name).to_owned(), source.name().to_owned()], cells.to_vec()].concat());
            }
            if m == 1 {
                let cells = [0, 1, 2, 3].map(|p| {
                    let spread = Spread::of(found.iter().map(|f| f.filtered[p]));
                    format!("{:+.2} ± {:.2}", spread.mean, spread.sigma)
                });
                let name = (*name).to_owned();
                section.row(&[vec![name, "servos and sensors' filters replayed".to_owned()], cells.to_vec()].concat());
            }
        }
    }
    section.line("");
    let rms = |session: usize, motion: usize, source: usize| -> f64 {
        let squares = all[session].iter().flat_map(|f| f.errors[motion][source]).map(|e| e * e);
        (squares.sum::<f64>() / (4 * all[session].len()) as f64).sqrt()
    };
    section.line(format!(
        "Root mean square over flights and the four parameters, true motion, {}: {}.",
        Source::ALL.map(Source::name).join(" / "),
        sessions
            .iter()
            .enumerate()
            .map(|(s, (name, _))| format!(
                "{name} {}",
                [0, 1, 2, 3].map(|source| format!("{:.2} %", rms(s, 0, source))).join(" / ")
            ))
            .collect::<Vec<_>>()
            .join("; ")
    ));
    section.line("");
    section.must(
        rms(0, 0, 2) < 0.2 * rms(0, 0, 0),
        &format!(
            "first session: the full inverse takes at least four fifths of the commanded wrench's error away ({:.1} % to {:.2} %)",
            rms(0, 0, 0),
            rms(0, 0, 2)
        ),
    );
    section
        .must(rms(0, 0, 3) < 0.3, &format!("first session: with the servos replayed {:.2} % are left", rms(0, 0, 3)));
    section.must(
        rms(0, 0, 2) < rms(0, 0, 1),
        &format!(
            "first session: the full inverse is better than the thesis's ({:.2} % against {:.2} %)",
            rms(0, 0, 2),
            rms(0, 0, 1)
        ),
    );
    let moments = |of: &dyn Fn(&Found) -> [f64; 4]| {
        let bias = |p: usize| Spread::of(all[0].iter().map(|f| of(f)[p])).mean.abs();
        (1..4).map(bias).fold(0.0, f64::max)
    };
    let (shifted, filtered) = (moments(&|f| f.errors[1][3]), moments(&|f| f.filtered));
    section.must(
        filtered < 0.4 && filtered < shifted,
        &format!(
            "first session, published motion: a wrench that is shifted leaves a bias of up to {shifted:.2} % in the moments, one filtered as the sensors are \
             {filtered:.2} %"
        ),
    );
    let share = |session: usize| 100.0 * Spread::of(all[session].iter().map(|f| f.saturated)).mean;
    let missed = |session: usize| 100.0 * Spread::of(all[session].iter().map(|f| f.missed_z)).mean;
    section.printed(
        if missed(1) < 0.8 * missed(0) { "reproduced" } else { "not reproduced" },
        &format!(
            "tight limits mitigate saturation (figure 6.23, right): the controller's limits lower the missed torque about z from {:.0} % to {:.0} %. They do not \
             end it: {:.0} % of the periods still saturate ({:.0} % before), because limits by component do not bound what all components ask of the nozzles \
             together. Small torques do: {:.0} % with the limits of the public code.",
            missed(0),
            missed(1),
            share(1),
            share(0),
            share(2)
        ),
    );

    for (i, (_, plan)) in sessions.iter().enumerate().take(2) {
        let flown = flight::fly(plan, 0)?;
        let [commanded, thesis, full, _] = Source::ALL.map(|source| source.wrenches(&flown));
        let shown = 1250..2187;
        let line =
            |w: &[Wrench<f64>]| shown.clone().map(|k| (k as f64 * STEP_S, 1e3 * w[k].torque.z)).collect::<Vec<_>>();
        let rows = shown.clone().map(|k| {
            vec![
                k as f64 * STEP_S,
                commanded[k].torque.z,
                thesis[k].torque.z,
                full[k].torque.z,
                f64::from(u8::from(flown.periods[k].saturated)),
            ]
        });
        let files =
            [("figure_6_23_left.csv", "figure_6_23_left.svg"), ("figure_6_23_right.csv", "figure_6_23_right.svg")];
        let titles = ["Torque about z, first session (flight 0)", "Torque about z within table 6.7 (flight 0)"];
        section
            .tables
            .push((files[i].0, csv("time_s,commanded_n_m,thesis_inverse_n_m,full_inverse_n_m,saturated", rows)));
        section.draw(
            files[i].1,
            titles[i],
            ["time, s", "torque, mN m"],
            vec![
                curve("commanded", line(&commanded)),
                curve("after saturation, full inverse", line(&full)),
                curve("after saturation, thesis's inverse", line(&thesis)),
            ],
        );
    }
    let header = "session,motion,wrench,error_m_percent,error_ixx_percent,error_iyy_percent,error_izz_percent";
    let rows = all.iter().enumerate().flat_map(|(s, found)| {
        found.iter().flat_map(move |f| {
            f.errors.iter().enumerate().flat_map(move |(m, by_source)| {
                by_source
                    .iter()
                    .enumerate()
                    .map(move |(w, e)| vec![s as f64, m as f64, w as f64, e[0], e[1], e[2], e[3]])
            })
        })
    });
    section.tables.push(("figure_6_23_errors.csv", csv(header, rows)));
    Ok(section)
}
