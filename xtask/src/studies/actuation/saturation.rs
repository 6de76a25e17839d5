//! Figure 6.23: torque about z as commanded and after saturation, and what taking one for the other costs the estimates.

use nalgebra::Vector3;
use tumble_astrobee::sensing::LocalizationSettings;
use tumble_lie::Wrench;

use super::flight::{
    self, Flown, Plan, STEP_S, Source, TABLE_6_7, body, delay_behind, delayed, differentiated, measured,
};
use super::{Section, Size, Spread, csv, curve};
use crate::Failure;
use crate::chapter4::in_parallel;

const SECONDS: f64 = 60.0;
const PARAMETERS: [&str; 4] = ["m", "Ixx", "Iyy", "Izz"];
/// Share of table 6.7 that hardly saturates.
const SHRUNK: f64 = 0.5;

/// What is known of the motion: acceleration (of whichever point) and angular acceleration, and the signals by which each is timed.
struct Motion {
    acceleration: Vec<Vector3<f64>>,
    rate: Vec<Vector3<f64>>,
    angular_acceleration: Vec<Vector3<f64>>,
}

/// The true motion of the centre of mass.
fn exact(flown: &Flown) -> Motion {
    let com = body().center_of_mass();
    let of_com = |p: &flight::Period| {
        let (rate, alpha) = (p.truth.state.twist_body.angular, p.truth.angular_acceleration_body);
        p.truth.acceleration_origin_body + alpha.cross(&com) + rate.cross(&rate.cross(&com))
    };
    Motion {
        acceleration: flown.periods.iter().map(of_com).collect(),
        rate: flown.periods.iter().map(|p| p.truth.state.twist_body.angular).collect(),
        angular_acceleration: flown.periods.iter().map(|p| p.truth.angular_acceleration_body).collect(),
    }
}

/// As the thesis: what is published, the rate differentiated.
fn published(flown: &Flown) -> Motion {
    let measured = measured(flown);
    let angular_acceleration = differentiated(&measured.rate);
    Motion { acceleration: measured.acceleration, rate: measured.rate, angular_acceleration }
}

/// Errors of mass and moments by (6.23)-(6.25), %: acceleration regressed on force, angular acceleration on torque, each after the
/// delay found for it.
fn errors(wrenches: &[Wrench<f64>], motion: &Motion) -> Result<[f64; 4], Failure> {
    let split = |of: fn(&Wrench<f64>) -> Vector3<f64>| wrenches.iter().map(of).collect::<Vec<_>>();
    let [linear_s, _] = delay_behind(wrenches, &motion.acceleration)?;
    // The rate is the wrench integrated: the delay of its derivative is the same and told by it as well, less noisily smoothed.
    let [angular_s, _] = delay_behind(wrenches, &motion.angular_acceleration)?;
    let forces = delayed(&split(|w| w.force), linear_s);
    let torques = delayed(&split(|w| w.torque), angular_s);
    let body = body();
    let inner = |a: &[Vector3<f64>], b: &[Vector3<f64>], axis: Option<usize>| -> f64 {
        a.iter().zip(b).map(|(a, b)| axis.map_or_else(|| a.dot(b), |i| a[i] * b[i])).sum()
    };
    let mass = inner(&forces, &forces, None) / inner(&forces, &motion.acceleration, None);
    let moments = body.inertia_about_com();
    let moment = |i: usize| inner(&torques, &torques, Some(i)) / inner(&torques, &motion.angular_acceleration, Some(i));
    Ok([
        100.0 * (mass / body.mass - 1.0),
        100.0 * (moment(0) / moments[(0, 0)] - 1.0),
        100.0 * (moment(1) / moments[(1, 1)] - 1.0),
        100.0 * (moment(2) / moments[(2, 2)] - 1.0),
    ])
}

/// What one flight shows.
struct Found {
    saturated: f64,
    /// Root mean square of commanded less realised torque about z over that of the commanded one.
    missed_z: f64,
    /// With exact and with published motion, by source.
    errors: [[[f64; 4]; 4]; 2],
    fastest_rad_s: f64,
}

fn found(plan: &Plan, seed: u64) -> Result<Found, Failure> {
    let flown = flight::fly(plan, seed)?;
    let [commanded, _, realised, _] = Source::ALL.map(|source| source.wrenches(&flown));
    let square = |of: &dyn Fn(usize) -> f64| (0..commanded.len()).map(|k| of(k) * of(k)).sum::<f64>().sqrt();
    let mut errors_of = [[[0.0; 4]; 4]; 2];
    for (errors_of, motion) in errors_of.iter_mut().zip([exact(&flown), published(&flown)]) {
        for (errors_of, source) in errors_of.iter_mut().zip(Source::ALL) {
            *errors_of = errors(&source.wrenches(&flown), &motion)?;
        }
    }
    Ok(Found {
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
        ("first session: planner limits only", "first", plan.clone()),
        ("within table 6.7", "limited", plan.clone().within_table_6_7()),
        (
            "within half of table 6.7",
            "half",
            Plan { limits: Some(TABLE_6_7.map(|limit| SHRUNK * limit)), ..plan },
        ),
    ];
    section.line(format!(
        "Informative wrench up to 0.1 N and 0.05 N m on every axis at once (planner limits of table 6.7), {SECONDS} s, healthy sensors, mode 2."
    ));
    section.columns(&["session", "periods saturated", "torque about z missed, rms", "fastest rate, rad/s"]);
    let mut all = Vec::new();
    for (name, _, plan) in &sessions {
        let found =
            in_parallel(size.flights, |seed| found(plan, seed as u64)).into_iter().collect::<Result<Vec<_>, Failure>>()?;
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
            "\nErrors of (6.23)-(6.25), %, bias ± spread over {} flights; {about}; each wrench shifted by its own delay:",
            size.flights
        ));
        section.columns(&["session", "wrench", PARAMETERS[0], PARAMETERS[1], PARAMETERS[2], PARAMETERS[3]]);
        for ((name, ..), found) in sessions.iter().zip(&all) {
            for (s, source) in Source::ALL.iter().enumerate() {
                let cells = [0, 1, 2, 3].map(|p| {
                    let spread = Spread::of(found.iter().map(|f| f.errors[m][s][p]));
                    format!("{:+.2} ± {:.2}", spread.mean, spread.sigma)
                });
                section.row(&[vec![(*name).to_owned(), source.name().to_owned()], cells.to_vec()].concat());
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
            .map(|(s, (name, ..))| format!("{name} {}", [0, 1, 2, 3].map(|source| format!("{:.2} %", rms(s, 0, source))).join(" / ")))
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
    section.must(
        rms(0, 0, 3) < 0.3,
        &format!("first session: with the servos replayed {:.2} % are left", rms(0, 0, 3)),
    );
    section.must(
        rms(0, 0, 2) < rms(0, 0, 1),
        &format!("first session: the full inverse is better than the thesis's ({:.2} % against {:.2} %)", rms(0, 0, 2), rms(0, 0, 1)),
    );
    let share = |session: usize| Spread::of(all[session].iter().map(|f| f.saturated)).mean;
    section.printed(
        if share(1) < 0.5 * share(0) { "reproduced" } else { "reproduced in part" },
        &format!(
            "tight limits mitigate saturation (figure 6.23, right): {:.0} % of the periods become {:.0} %, and {:.0} % within half of the limits; \
             they do not end it",
            100.0 * share(0),
            100.0 * share(1),
            100.0 * share(2)
        ),
    );

    for (i, (_, name, plan)) in sessions.iter().enumerate().take(2) {
        let flown = flight::fly(plan, 0)?;
        let [commanded, thesis, full, _] = Source::ALL.map(|source| source.wrenches(&flown));
        let shown = 1250..2187;
        let line = |w: &[Wrench<f64>]| shown.clone().map(|k| (k as f64 * STEP_S, 1e3 * w[k].torque.z)).collect::<Vec<_>>();
        let rows = shown.clone().map(|k| {
            vec![k as f64 * STEP_S, commanded[k].torque.z, thesis[k].torque.z, full[k].torque.z, f64::from(u8::from(flown.periods[k].saturated))]
        });
        let files = [("figure_6_23_left.csv", "figure_6_23_left.svg"), ("figure_6_23_right.csv", "figure_6_23_right.svg")];
        let titles = ["Torque about z, first session (flight 0)", "Torque about z within table 6.7 (flight 0)"];
        section.tables.push((files[i].0, csv("time_s,commanded_n_m,thesis_inverse_n_m,full_inverse_n_m,saturated", rows)));
        section.draw(
            files[i].1,
            titles[i],
            ["time, s", "torque, mN m"],
            vec![curve("commanded", line(&commanded)), curve("after saturation, full inverse", line(&full)), curve("after saturation, thesis's inverse", line(&thesis))],
        );
        let _ = name;
    }
    let header = "session,motion,wrench,error_m_percent,error_ixx_percent,error_iyy_percent,error_izz_percent";
    let rows = all.iter().enumerate().flat_map(|(s, found)| {
        found.iter().flat_map(move |f| {
            f.errors.iter().enumerate().flat_map(move |(m, by_source)| {
                by_source.iter().enumerate().map(move |(w, e)| vec![s as f64, m as f64, w as f64, e[0], e[1], e[2], e[3]])
            })
        })
    });
    section.tables.push(("figure_6_23_errors.csv", csv(header, rows)));
    Ok(section)
}
