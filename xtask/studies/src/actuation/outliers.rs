//! Figure 6.24: jumps of the localisation in the differentiated rate, and the chi-square gate of (6.31).

use nalgebra::{SVector, Vector3, Vector4, Vector6};
use tumble_astrobee::sensing::{FaultSettings, JumpSettings, LocalizationSettings};
use tumble_identification::LinearModel;
use tumble_identification::recursive::{
    ChiSquareGate, InverseInertia, InverseInertiaSample, LinearObservation, SquareRootFilter,
};
use tumble_identification::statistics::{Band, clopper_pearson, coverage_band};
use tumble_lie::Wrench;

use super::flight::{
    self, Flown, Plan, STEP_S, Source, body, calibrated, delayed, differentiated, measured, published,
    through_the_chain,
};
use super::{Section, Size, Spread, csv, curve, study};
use crate::Failure;
use crate::chapter4::in_parallel;

const SECONDS: f64 = 60.0;
/// Probability of the thesis's gate.
const PROBABILITY: f64 = 0.99;
/// Sizes of the jumps in rate, rad/s; the preset has the fourth.
const SIZES_RAD_S: [f64; 5] = [0.002, 0.01, 0.02, 0.05, 0.1];
const PRESET: usize = 3;
/// A change of the differentiated rate above this share of the jump (per s) is its edge; its slow return is below.
const EDGE_PER_S: f64 = 5.0;
/// Samples at the start and end that the filters and shifts need.
const MARGIN: usize = 100;
/// Prior of the estimator, as that of the thesis's code: mass and moments, and relative uncertainty of their inverses.
const PRIOR: [f64; 4] = [15.0, 0.1, 0.1, 0.1];
const PRIOR_RELATIVE: f64 = 1.0;

/// What is known besides the messages.
#[derive(Clone, Copy)]
struct Condition {
    name: &'static str,
    source: Source,
    losses: bool,
    /// Whether the wrench goes through filters like the sensors', where it is only shifted otherwise.
    filtered: bool,
    /// Rejections in a row before the gate doubts its estimate; the thesis's never does.
    patience: u32,
}

const THESIS: Condition = Condition {
    name: "as the thesis: losses, full inverse",
    source: Source::FullInverse,
    losses: true,
    filtered: false,
    patience: u32::MAX,
};

const CONDITIONS: [Condition; 5] = [
    THESIS,
    Condition { name: "gate that doubts itself after 5 rejections in a row", patience: 5, ..THESIS },
    Condition { name: "no losses", losses: false, ..THESIS },
    Condition { name: "no losses, servos replayed", losses: false, source: Source::Replayed, ..THESIS },
    Condition {
        name: "no losses, servos replayed, wrench filtered as the sensors are",
        losses: false,
        source: Source::Replayed,
        filtered: true,
        ..THESIS
    },
];

fn sensors(size_rad_s: Option<f64>, losses: bool) -> LocalizationSettings {
    let thesis = LocalizationSettings { acceleration_factor: [1.0; 3], ..LocalizationSettings::thesis_flight() };
    let faults = if losses { thesis.faults.clone() } else { FaultSettings::default() };
    let jumps = thesis.faults.random_jumps;
    let random_jumps = size_rad_s.map_or_else(JumpSettings::default, |rate_rad_s| JumpSettings { rate_rad_s, ..jumps });
    LocalizationSettings { faults: FaultSettings { random_jumps, ..faults }, ..thesis }
}

/// Rows of one flight, shifted by their delays.
struct Rows {
    wrenches: Vec<Wrench<f64>>,
    /// `[angular; linear]`.
    accelerations: Vec<Vector6<f64>>,
}

fn rows(flown: &Flown, condition: &Condition, [angular_s, linear_s]: [f64; 2]) -> Result<Rows, Failure> {
    let wrenches = condition.source.wrenches(flown);
    let wrenches = if condition.filtered {
        through_the_chain(&wrenches, &sensors(None, false))?
    } else {
        let torques = delayed(&wrenches.iter().map(|w| w.torque).collect::<Vec<_>>(), angular_s);
        let forces = delayed(&wrenches.iter().map(|w| w.force).collect::<Vec<_>>(), linear_s);
        torques.into_iter().zip(forces).map(|(t, f)| Wrench::new(t, f)).collect()
    };
    let motion = published(flown);
    let join = |(a, l): (&Vector3<f64>, &Vector3<f64>)| Vector6::new(a.x, a.y, a.z, l.x, l.y, l.z);
    Ok(Rows {
        wrenches,
        accelerations: motion.angular_acceleration.iter().zip(&motion.acceleration).map(join).collect(),
    })
}

/// What the gate did with one flight.
struct Judged {
    rejected: Vec<bool>,
    /// Relative errors of mass and moments at the end, %.
    errors: [f64; 4],
}

fn estimate(rows: &Rows, deviation: &Vector6<f64>, gate: Option<ChiSquareGate>) -> Result<Judged, Failure> {
    let mean = Vector4::from(PRIOR.map(|p| 1.0 / p));
    let mut filter = SquareRootFilter::<4, 6>::try_new(mean, mean * PRIOR_RELATIVE).map_err(study)?;
    if let Some(gate) = gate {
        filter = filter.with_gate(gate);
    }
    let mut rejected = vec![false; rows.wrenches.len()];
    let last = rows.wrenches.len() - MARGIN;
    for (k, rejected) in rejected.iter_mut().enumerate().take(last).skip(MARGIN) {
        let sample = InverseInertiaSample { wrench: rows.wrenches[k], acceleration: rows.accelerations[k] };
        let observation = LinearObservation {
            regressor: InverseInertia.regressor(&sample),
            output: InverseInertia.output(&sample),
            standard_deviation: *deviation,
        };
        *rejected = !filter.update_rows(&observation).map_err(study)?.is_accepted();
    }
    let found: SVector<f64, 4> = filter.parameters();
    let body = body();
    let inertia = body.inertia_about_com();
    let truth = [body.mass, inertia[(0, 0)], inertia[(1, 1)], inertia[(2, 2)]];
    Ok(Judged { rejected, errors: std::array::from_fn(|i| 100.0 * (1.0 / found[i] / truth[i] - 1.0)) })
}

/// Standard deviation of the residual of every row, the body known: what a flight without jumps shows.
fn deviation(rows: &Rows) -> Vector6<f64> {
    let body = body();
    let moments = body.inertia_about_com().diagonal();
    let used = MARGIN..rows.wrenches.len() - MARGIN;
    Vector6::from_fn(|i, _| {
        let expected = |w: &Wrench<f64>| if i < 3 { w.torque[i] / moments[i] } else { w.force[i - 3] / body.mass };
        let residual = |k: usize| rows.accelerations[k][i] - expected(&rows.wrenches[k]);
        (used.clone().map(|k| residual(k).powi(2)).sum::<f64>() / used.len() as f64).sqrt()
    })
}

/// Counts of one size of jump in one flight.
#[derive(Clone, Copy, Default)]
struct Counts {
    edges: [usize; 2],
    clean: [usize; 2],
    slow: [usize; 2],
    /// With gate, without, and of the flight without jumps.
    errors: [[f64; 4]; 3],
}

/// One condition, one flight, every size.
fn flight(condition: &Condition, sizes: &[f64], delays_s: [f64; 2], seed: u64) -> Result<Vec<Counts>, Failure> {
    let plan = |size| Plan::new(sensors(size, condition.losses), SECONDS).within_table_6_7();
    // Sources of noise have their own streams: without jumps the flight is the same one.
    let clean = rows(&flight::fly(&plan(None), seed)?, condition, delays_s)?;
    let sigma = deviation(&clean);
    let gate = ChiSquareGate::try_new(PROBABILITY).map_err(study)?.with_patience(condition.patience);
    let without_jumps = estimate(&clean, &sigma, Some(gate))?.errors;
    let one = |size: &f64| {
        let mut counts = Counts::default();
        let jumping = rows(&flight::fly(&plan(Some(*size)), seed)?, condition, delays_s)?;
        let judged = estimate(&jumping, &sigma, Some(gate))?;
        let ungated = estimate(&jumping, &sigma, None)?;
        for k in MARGIN..judged.rejected.len() - MARGIN {
            let change = (jumping.accelerations[k] - clean.accelerations[k]).fixed_rows::<3>(0).norm();
            let class = if change > EDGE_PER_S * size {
                &mut counts.edges
            } else if change > 1e-9 {
                &mut counts.slow
            } else {
                &mut counts.clean
            };
            class[0] += usize::from(judged.rejected[k]);
            class[1] += 1;
        }
        counts.errors = [judged.errors, ungated.errors, without_jumps];
        Ok(counts)
    };
    sizes.iter().map(one).collect()
}

/// Rejected of all, and the 99 % band of their share.
fn share(hits: [usize; 2]) -> (f64, Band) {
    (hits[0] as f64 / hits[1].max(1) as f64, clopper_pearson(hits[0], hits[1].max(1), 0.99))
}

fn written(hits: [usize; 2]) -> String {
    let (share, band) = share(hits);
    format!("{:.2} % ({:.2} to {:.2}), {} of {}", 100.0 * share, 100.0 * band.low, 100.0 * band.high, hits[0], hits[1])
}

pub fn section(size: Size) -> Result<Section, Failure> {
    let mut section = Section::default();
    let fly_all = |condition: &Condition, sizes: &[f64]| -> Result<Vec<Vec<Counts>>, Failure> {
        let delays_s = calibrated(&sensors(None, false), condition.source, published)?;
        in_parallel(size.flights, |seed| flight(condition, sizes, delays_s, seed as u64)).into_iter().collect()
    };
    section.line(format!(
        "{SECONDS} s within table 6.7, `thesis-flight` without its factors; while the robot turns faster than 0.15 rad/s or accelerates beyond \
         0.03 m/s^2 the estimate jumps once in 5 s, stays off for 0.2 s and returns within 0.5 s. Rate differentiated by central differences; recursive least \
         squares of (6.23) to (6.28) behind a gate at {PROBABILITY} with 6 degrees of freedom (threshold {:.4}); noise from the residuals of the flight \
         without jumps. Shares of rejected rows with their 99 % band, as if rows were independent.",
        ChiSquareGate::try_new(PROBABILITY).map_err(study)?.threshold(6),
    ));
    let sum = |found: &[Vec<Counts>], i: usize, of: fn(&Counts) -> [usize; 2]| {
        found.iter().map(|f| of(&f[i])).fold([0, 0], |a, b| [a[0] + b[0], a[1] + b[1]])
    };
    let classes: [fn(&Counts) -> [usize; 2]; 3] = [|c| c.edges, |c| c.slow, |c| c.clean];
    let names = ["edges rejected (detection)", "plateau and return rejected", "clean rows rejected (false alarm)"];
    section.columns(&[&["jump of the rate, rad/s"], &names[..]].concat());
    let found = fly_all(&THESIS, &SIZES_RAD_S)?;
    for (i, size) in SIZES_RAD_S.iter().enumerate() {
        let cells = classes.map(|of| written(sum(&found, i, of)));
        section.row(&[vec![size.to_string()], cells.to_vec()].concat());
    }
    section.line(format!("\nWhat the rates depend on, jumps of {} rad/s:", SIZES_RAD_S[PRESET]));
    section.columns(&[&["condition"], &names[..]].concat());
    let mut filtered = f64::NAN;
    for condition in &CONDITIONS {
        let other = fly_all(condition, &SIZES_RAD_S[PRESET..=PRESET])?;
        let cells = classes.map(|of| written(sum(&other, 0, of)));
        section.row(&[vec![condition.name.to_owned()], cells.to_vec()].concat());
        if condition.filtered {
            filtered = share(sum(&other, 0, |c| c.clean)).0;
        }
    }
    section.line("\nErrors of the estimate at the end, %, jumps of 0.05 rad/s:");
    section.columns(&["", "m", "Ixx", "Iyy", "Izz"]);
    let errors = |kind: usize, i: usize| {
        [0, 1, 2, 3].map(|p| {
            let spread = Spread::of(found.iter().map(|f| f[i].errors[kind][p]));
            format!("{:+.2} ± {:.2}", spread.mean, spread.sigma)
        })
    };
    for (kind, name) in [(2, "no jumps, gate"), (0, "jumps, gate"), (1, "jumps, no gate")] {
        section.row(&[vec![name.to_owned()], errors(kind, PRESET).to_vec()].concat());
    }
    section.line("");
    let (detected, _) = share(sum(&found, PRESET, |c| c.edges));
    let alarms = sum(&found, PRESET, |c| c.clean);
    let (alarm, _) = share(alarms);
    section.must(detected > 0.99, &format!("edges of jumps of 0.05 rad/s are rejected: {:.2} %", 100.0 * detected));
    section.must(alarm < 0.05, &format!("clean rows are kept: {:.2} % rejected", 100.0 * alarm));
    section.must(
        filtered < 0.015,
        &format!(
            "with the wrench filtered as the sensors are the gate keeps its word: {:.2} % of clean rows rejected",
            100.0 * filtered
        ),
    );
    let band = coverage_band(1.0 - PROBABILITY, alarms[1], 0.99);
    section.printed(
        if band.contains(alarm) { "holds" } else { "holds in part" },
        &format!(
            "the gate rejects one clean row in a hundred where noise is white and normal ({:.2} to {:.2} % of as many rows). Here {:.2} %: a filter is not a \
             delay, and what it does to a wrench that jumps enters as noise that is neither. With the wrench filtered as the sensors are {:.2} % are \
             rejected.",
            100.0 * band.low,
            100.0 * band.high,
            100.0 * alarm,
            100.0 * filtered
        ),
    );
    let small = share(sum(&found, 0, |c| c.edges)).0;
    let slow = share(sum(&found, PRESET, |c| c.slow)).0;
    section.printed(
        "holds where jumps stand above the noise",
        &format!(
            "the gate removes localisation outliers: of a jump of 0.05 rad/s {:.1} % of the edges and {:.1} % of plateau and \
             return; of one of {} rad/s {:.0} % of the edges and {:.0} % of the rest",
            100.0 * detected,
            100.0 * slow,
            SIZES_RAD_S[0],
            100.0 * small,
            100.0 * share(sum(&found, 0, |c| c.slow)).0
        ),
    );

    // The picture: the flight with most jumps.
    let busiest = (0..found.len()).max_by_key(|&i| found[i][PRESET].edges[1]).unwrap_or(0) as u64;
    let shown = flight::fly(&Plan::new(sensors(Some(SIZES_RAD_S[PRESET]), true), SECONDS).within_table_6_7(), busiest)?;
    let angular = differentiated(&measured(&shown).rate);
    let healthy = flight::fly(&Plan::new(sensors(None, true), SECONDS).within_table_6_7(), busiest)?;
    let quiet = differentiated(&measured(&healthy).rate);
    let line =
        |values: &[Vector3<f64>]| values.iter().enumerate().map(|(k, a)| (k as f64 * STEP_S, a.z)).collect::<Vec<_>>();
    section.tables.push((
        "figure_6_24.csv",
        csv(
            "time_s,alpha_x_rad_s2,alpha_y_rad_s2,alpha_z_rad_s2,without_jumps_z_rad_s2",
            angular.iter().zip(&quiet).enumerate().map(|(k, (a, b))| vec![k as f64 * STEP_S, a.x, a.y, a.z, b.z]),
        ),
    ));
    section.draw(
        "figure_6_24.svg",
        "Angular acceleration about z from differentiated rate, with jumps",
        ["time, s", "rad/s^2"],
        vec![curve("with jumps", line(&angular)), curve("the same flight without", line(&quiet))],
    );
    Ok(section)
}
