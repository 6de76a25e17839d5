//! `reproduce chapter5`: figures 5.2 to 5.4 and table 5.1 of the thesis, with the definitions the thesis leaves open stated, all
//! finite-difference baselines, and what this library makes of the same data.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Matrix3, SVector, Vector6};
use serde_json::json;
use tumble::output::OutputFolder;
use tumble_identification::noise::Gaussian;
use tumble_identification::regressors::{
    FiniteDifference, ObserverFrame, PoseTriple, Regressor, StateSample, newton_euler, variational,
    variational_extrapolated,
};
use tumble_identification::{
    BodyScale, ConstrainedLeastSquares, FeasibleSet, FisherInformation, InteriorPoint, PseudoInertiaCone,
    SquareRootInformation, WrenchTiming,
};
use tumble_lie::{Increment, Pose, skew};

use crate::Failure;
use crate::arguments::Arguments;
use crate::flights::{Body, Errors, Flight, GROUPS, GroupCovariances, Multisine, Noise, chapter5_bodies, fly};
use crate::plot::{self, Curve, Scale};

/// Samples of the estimation; as many again validate.
const SAMPLES: usize = 601;
/// Density of the wrench noise, per root hertz; of the noise on velocities.
const WRENCH_DENSITY: f64 = 1e-3;
const VELOCITY_DENSITY: f64 = 1e-5;
/// Seeds where `--runs` says nothing.
const SEEDS: usize = 20;
/// Times at which violations of the LMI are counted, s.
const LOOKS_S: [f64; 5] = [0.5, 1.0, 2.0, 5.0, 30.0];

/// How accelerations are had from the record.
#[derive(Clone, Copy, PartialEq)]
pub enum Method {
    Difference(FiniteDifference),
    /// The thesis's regressor, corrected; extrapolated to order 4 and 6; with its `B_k` as printed.
    Order2,
    Order4,
    Order6,
    Printed,
}

const METHODS: [(&str, Method); 9] = [
    ("forward", Method::Difference(FiniteDifference::Forward)),
    ("forward-body", Method::Difference(FiniteDifference::ForwardBody)),
    ("midpoint", Method::Difference(FiniteDifference::Midpoint)),
    ("central", Method::Difference(FiniteDifference::Central)),
    ("five-point", Method::Difference(FiniteDifference::FivePoint)),
    ("variational", Method::Order2),
    ("variational4", Method::Order4),
    ("variational6", Method::Order6),
    ("printed B_k", Method::Printed),
];
const FORWARD_BODY: usize = 1;
const VARIATIONAL: usize = 5;
const ORDER4: usize = 6;
const ORDER6: usize = 7;
const PRINTED: usize = 8;

/// What is disturbed.
#[derive(Clone, Copy, PartialEq)]
enum Disturbance {
    None,
    /// Wrench, and velocities in the plant.
    Process,
    /// Wrench, and velocities as measured.
    Measured,
}

impl Disturbance {
    const ALL: [Self; 3] = [Self::None, Self::Process, Self::Measured];

    fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Process => "process",
            Self::Measured => "meas",
        }
    }

    /// Standard deviations per sample.
    fn noise(self, step_s: f64) -> Noise {
        let per_sample = 1.0 / step_s.sqrt();
        let wrench = if self == Self::None { 0.0 } else { WRENCH_DENSITY * per_sample };
        let velocity = if self == Self::Measured { VELOCITY_DENSITY * per_sample } else { 0.0 };
        Noise {
            torque: wrench,
            force: wrench,
            velocity: Some(velocity),
            rate: Some(velocity),
            process: if self == Self::Process { VELOCITY_DENSITY } else { 0.0 },
            ..Noise::default()
        }
    }
}

/// A flight of the study: the phases of the wrench and the noise follow from the seed.
fn flight(body: &Body, disturbance: Disturbance, samples: usize, seed: u64) -> Flight {
    let mut random = Gaussian::from_seed(seed);
    let excitation = Multisine::chapter5(body, &mut random);
    fly(body, &excitation, WrenchTiming::Sampled, &disturbance.noise(body.step_s), samples, &mut random)
}

/// A flight of the thesis's noise, for other studies.
pub fn thesis_flight(body: &Body, seed: u64) -> Flight {
    flight(body, Disturbance::Process, SAMPLES, seed)
}

/// The regressor and the wrench at node `k`, where the record reaches far enough on both sides.
pub fn row(flight: &Flight, method: Method, k: usize) -> Option<(Regressor<f64>, Vector6<f64>)> {
    let record = &flight.record;
    let poses = |lag: usize| -> Option<PoseTriple<f64>> {
        let at = |k: usize| record.get(k).and_then(|sample| sample.world_from_body.as_ref());
        let triple: [&Pose<f64>; 3] = [at(k.checked_sub(lag)?)?, at(k)?, at(k + lag)?];
        let step_s = flight.step_s * lag as f64;
        PoseTriple::try_new(triple, step_s, step_s, &ObserverFrame::inertial()).ok()
    };
    let regressor = match method {
        Method::Difference(scheme) => {
            let (before, after) = ((scheme.samples() - 1) / 2, scheme.samples() / 2);
            let window: Option<Vec<StateSample>> = record
                .get(k.checked_sub(before)?..=k + after)?
                .iter()
                .map(|sample| {
                    Some(StateSample {
                        world_from_body: sample.world_from_body?,
                        velocity_origin_world: sample.velocity_origin_world?,
                        rate_body: sample.rate_body?,
                        wrench_body: sample.wrench_body?,
                    })
                })
                .collect();
            let (regressor, wrench) = scheme.regressor(&window?, flight.step_s)?;
            return Some((regressor, wrench.to_vector()));
        }
        Method::Order2 => variational(&poses(1)?),
        Method::Order4 => variational_extrapolated(&[poses(1)?, poses(2)?]),
        Method::Order6 => variational_extrapolated(&[poses(1)?, poses(2)?, poses(3)?]),
        Method::Printed => printed(&poses(1)?),
    };
    Some((regressor, record[k].wrench_body?.to_vector()))
}

/// (5.24) as printed: the first-moment columns of the torque rows multiply Phi twice.
fn printed(triple: &PoseTriple<f64>) -> Regressor<f64> {
    let mut regressor = variational(triple);
    let block = |x: &Increment<f64>, sign: f64| {
        let turn = Matrix3::identity() * x.f_a0() + skew(&x.phi()) * sign;
        let travel = Matrix3::identity() * x.f_b0() + skew(&x.psi()) * sign;
        (travel - turn) * skew(&x.phi())
    };
    let scale = 2.0 / (triple.step_after_s * triple.step_after_s);
    let wrong = (block(&triple.after, 1.0) - block(&triple.before, -1.0)) * scale;
    regressor.fixed_view_mut::<3, 3>(0, 1).copy_from(&wrong);
    regressor
}

/// Plain least squares over the rows of the first `samples` samples: the QR recursion of the thesis, all rows alike.
pub fn fit(flight: &Flight, method: Method, samples: usize) -> Result<SVector<f64, 10>, Failure> {
    let mut information = SquareRootInformation::<10>::new();
    for (regressor, wrench) in (0..samples).filter_map(|k| row(flight, method, k)) {
        information.update(&regressor, &wrench).map_err(study)?;
    }
    let scale = BodyScale::of(&flight.truth.to_vector()).map_err(study)?;
    information.solve(&scale.parameter_magnitudes()).map_err(study)
}

/// The Cramer-Rao bound of the wrench noise alone: exact motion, as no estimator has it.
pub fn bound(flight: &Flight, samples: usize) -> Result<GroupCovariances, Failure> {
    let sigma = WRENCH_DENSITY / flight.step_s.sqrt();
    let mut fisher = FisherInformation::<10>::new();
    for x in flight.instants.iter().take(samples) {
        fisher.add(&(newton_euler(&x.rate_body, &x.rate_derivative_body, &x.acceleration_origin_body) / sigma));
    }
    let scale = BodyScale::of(&flight.truth.to_vector()).map_err(study)?;
    let covariance = fisher.cramer_rao_bound(&scale.parameter_magnitudes()).map_err(study)?;
    Ok(GroupCovariances::of(&covariance, &flight.truth))
}

fn study(error: impl std::fmt::Display) -> Failure {
    Failure::BadInput(error.to_string())
}

/// Root-mean-square errors over the seeds of one body under one disturbance.
struct Cell {
    /// Method, then group.
    rms: [[f64; 3]; METHODS.len()],
    bound: [f64; 3],
    /// Rms residual of torque and force over the validation, method by method.
    validation: [[f64; 2]; METHODS.len()],
}

fn cell(body: &Body, disturbance: Disturbance, seeds: usize) -> Result<Cell, Failure> {
    let mut cell = Cell { rms: [[0.0; 3]; METHODS.len()], bound: [0.0; 3], validation: [[0.0; 2]; METHODS.len()] };
    let n = seeds as f64;
    for seed in 0..seeds as u64 {
        let flight = flight(body, disturbance, 2 * SAMPLES - 1, seed);
        let traces = bound(&flight, SAMPLES)?.traces();
        for (sum, trace) in cell.bound.iter_mut().zip(traces) {
            *sum += trace / n;
        }
        for (index, (_, method)) in METHODS.iter().enumerate() {
            let found = fit(&first_half(&flight), *method, SAMPLES)?;
            for (sum, norm) in cell.rms[index].iter_mut().zip(Errors::of(&found, &flight.truth).norms()) {
                *sum += norm * norm / n;
            }
            let rows = || (SAMPLES..2 * SAMPLES - 1).filter_map(|k| row(&flight, *method, k));
            let count = rows().count() as f64;
            for (regressor, wrench) in rows() {
                let residual = regressor * found - wrench;
                cell.validation[index][0] += residual.fixed_rows::<3>(0).norm_squared() / (3.0 * count * n);
                cell.validation[index][1] += residual.fixed_rows::<3>(3).norm_squared() / (3.0 * count * n);
            }
        }
    }
    for value in cell.rms.iter_mut().flatten().chain(&mut cell.bound).chain(cell.validation.iter_mut().flatten()) {
        *value = value.sqrt();
    }
    Ok(cell)
}

/// Nothing after the estimation may reach into its rows.
fn first_half(flight: &Flight) -> Flight {
    Flight {
        truth: flight.truth,
        step_s: flight.step_s,
        instants: flight.instants[..SAMPLES].to_vec(),
        record: flight.record[..SAMPLES].to_vec(),
    }
}

/// Recursive estimates over time, with and without the LMI.
struct Recursion {
    /// At each sample: rms over the seeds of the relative error of each group, unconstrained and constrained; not a number
    /// before ten directions are determined in every seed.
    relative: Vec<[[f64; 3]; 2]>,
    /// At each sample: share of seeds whose unconstrained estimate is no body; not yet determined counts as none.
    violations: Vec<f64>,
}

fn recursion(body: &Body, disturbance: Disturbance, method: Method, seeds: usize) -> Result<Recursion, Failure> {
    let truth = body.parameters;
    let scale = BodyScale::of(&truth.to_vector()).map_err(study)?;
    let cone = PseudoInertiaCone::new(scale);
    let solver = InteriorPoint::new(cone);
    let sizes =
        [truth.to_vector().fixed_rows::<6>(4).norm(), truth.center_of_mass().norm().max(f64::MIN_POSITIVE), truth.mass];
    let mut relative = vec![[[0.0; 3]; 2]; SAMPLES];
    let mut violations = vec![0.0; SAMPLES];
    for seed in 0..seeds as u64 {
        let flight = flight(body, disturbance, SAMPLES, seed);
        let mut information = SquareRootInformation::<10>::new();
        for k in 0..SAMPLES {
            if let Some((regressor, wrench)) = row(&flight, method, k) {
                information.update(&regressor, &wrench).map_err(study)?;
            }
            let free = information.solve(&scale.parameter_magnitudes()).ok();
            let inside = free.and_then(|_| solver.solve(&information).ok()).map(|estimate| estimate.parameters);
            violations[k] += f64::from(u8::from(free.is_some_and(|p| cone.margin(&p) <= 0.0))) / seeds as f64;
            for (sums, estimate) in relative[k].iter_mut().zip([free, inside]) {
                let norms = estimate.map_or([f64::NAN; 3], |p| Errors::of(&p, &truth).norms());
                for (sum, (norm, size)) in sums.iter_mut().zip(norms.iter().zip(sizes)) {
                    *sum += (norm / size).powi(2) / seeds as f64;
                }
            }
        }
    }
    for value in relative.iter_mut().flatten().flatten() {
        *value = value.sqrt();
    }
    Ok(Recursion { relative, violations })
}

/// Runs the study.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let seeds = arguments.number("--runs")?.unwrap_or(SEEDS).max(2);
    let out = arguments.value("--out").map(Path::new);
    if let Some(out) = out {
        OutputFolder::check_place(out, false).map_err(study)?;
    }
    let bodies = chapter5_bodies();
    let mut cells = Vec::new();
    for body in &bodies {
        for disturbance in Disturbance::ALL {
            eprintln!("chapter 5: body {}, noise {}, {seeds} seeds", body.name, disturbance.name());
            cells.push((body.name, disturbance, cell(body, disturbance, seeds)?));
        }
    }
    eprintln!("chapter 5: recursive estimates");
    let mut violations = Vec::new();
    for body in &bodies {
        violations.push((body.name, recursion(body, Disturbance::Process, Method::Order2, seeds)?.violations));
    }
    let mut figures = Vec::new();
    for disturbance in [Disturbance::None, Disturbance::Process] {
        for index in [FORWARD_BODY, VARIATIONAL, ORDER4] {
            let (name, method) = METHODS[index];
            figures.push((disturbance, name, recursion(&bodies[0], disturbance, method, seeds)?));
        }
    }
    let page = page(seeds, &cells, &violations, &figures)?;
    print!("{page}");
    if let Some(out) = out {
        write(out, &page, seeds, &cells, &violations, &figures, &bodies[0])?;
    }
    Ok(())
}

type Cells<'a> = [(&'a str, Disturbance, Cell)];
type Figures<'a> = [(Disturbance, &'a str, Recursion)];

fn find<'a>(cells: &'a Cells, body: &str, disturbance: Disturbance) -> Option<&'a Cell> {
    cells.iter().find(|(name, found, _)| *name == body && *found == disturbance).map(|(.., cell)| cell)
}

/// Two significant digits, without an exponent where that is readable.
fn short(value: f64) -> String {
    if value >= 1e4 || (value < 1e-2 && value > 0.0) {
        format!("{value:.1e}")
    } else if value >= 10.0 {
        format!("{value:.0}")
    } else {
        format!("{value:.2}")
    }
}

fn ratios(above: &[f64; 3], below: &[f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|group| above[group] / below[group])
}

fn triple(values: &[f64; 3]) -> String {
    values.map(short).join(", ")
}

fn index_of(time_s: f64) -> usize {
    (0..SAMPLES).find(|&k| k as f64 * 0.05 >= time_s - 1e-9).unwrap_or(SAMPLES - 1)
}

/// Table 5.1 as printed.
const TABLE_5_1: [(&str, [f64; 3]); 3] =
    [("1", [20.9, 12.0, 218.0]), ("2", [1.92, 3.05, 20.1]), ("3", [1.06, 2.42, 9.12])];

fn page(seeds: usize, cells: &Cells, violations: &[(&str, Vec<f64>)], figures: &Figures) -> Result<String, Failure> {
    let mut page = String::new();
    write_page(&mut page, seeds, cells, violations, figures).map_err(study)?;
    Ok(page)
}

fn write_page(
    page: &mut String,
    seeds: usize,
    cells: &Cells,
    violations: &[(&str, Vec<f64>)],
    figures: &Figures,
) -> std::fmt::Result {
    writeln!(
        page,
        "# Chapter 5, reproduced\n\n\
         Four bodies, 0.05 s, 30 s of estimation and 30 s of validation, start at rest, one sine on each axis (torque \
         0.25 tr J / 3, force 0.25 m), random phases, {seeds} seeds, sampled wrench. `process`: wrench noise of density 1e-3, \
         velocities disturbed in the plant with 1e-5; `meas`: the latter on measured velocities; `none`: neither. \
         Poses exact. Errors: 2-norm of the inertia about the origin (six numbers), of the centre of mass, of the mass; root mean \
         square over the seeds. Plain least squares throughout. The thesis states neither amplitudes nor phases nor its \
         finite difference: the ratios depend on all three.\n"
    )?;
    writeln!(page, "## Error of each method over that of the variational regressor (inertia, centre of mass, mass)\n")?;
    writeln!(page, "| body | noise | {} |", METHODS.map(|(name, _)| name).join(" | "))?;
    writeln!(page, "|---|---|{}", "---|".repeat(METHODS.len()))?;
    for (body, disturbance, cell) in cells {
        let columns: Vec<String> = cell.rms.iter().map(|rms| triple(&ratios(rms, &cell.rms[VARIATIONAL]))).collect();
        writeln!(page, "| {body} | {} | {} |", disturbance.name(), columns.join(" | "))?;
    }
    writeln!(page, "\n## Errors against the Cramer-Rao bound of the wrench noise, and without noise\n")?;
    writeln!(
        page,
        "| body | none: order 2 | none: order 4 | none: order 6 | process: order 2 / bound | order 4 / bound | order 6 / bound | five-point / bound |"
    )?;
    writeln!(page, "|---|---|---|---|---|---|---|---|")?;
    for (name, ..) in cells.iter().filter(|(_, disturbance, _)| *disturbance == Disturbance::None) {
        let (Some(exact), Some(noisy)) =
            (find(cells, name, Disturbance::None), find(cells, name, Disturbance::Process))
        else {
            continue;
        };
        let over = |index: usize| triple(&ratios(&noisy.rms[index], &noisy.bound));
        let absolute = |index: usize| exact.rms[index].map(|e| format!("{e:.1e}")).join(", ");
        writeln!(
            page,
            "| {name} | {} | {} | {} | {} | {} | {} | {} |",
            absolute(VARIATIONAL),
            absolute(ORDER4),
            absolute(ORDER6),
            over(VARIATIONAL),
            over(ORDER4),
            over(ORDER6),
            over(4)
        )?;
    }
    writeln!(
        page,
        "\n## Table 5.1\n\n| body | printed FD / V | forward / V here | forward-body / V here | forward-body / order 4 here |"
    )?;
    writeln!(page, "|---|---|---|---|---|")?;
    for (name, printed) in TABLE_5_1 {
        if let Some(cell) = find(cells, name, Disturbance::Process) {
            let over = |above: usize, below: usize| triple(&ratios(&cell.rms[above], &cell.rms[below]));
            writeln!(
                page,
                "| {name} | {} | {} | {} | {} |",
                triple(&printed),
                over(0, VARIATIONAL),
                over(FORWARD_BODY, VARIATIONAL),
                over(FORWARD_BODY, ORDER4)
            )?;
        }
    }
    writeln!(page, "\n## Share of unconstrained variational estimates that are no body (process noise)\n")?;
    writeln!(page, "| body | {} |", LOOKS_S.map(|t| format!("{t} s")).join(" | "))?;
    writeln!(page, "|---|{}", "---|".repeat(LOOKS_S.len()))?;
    for (name, shares) in violations {
        let row: Vec<String> = LOOKS_S.iter().map(|&t| format!("{:.0} %", 100.0 * shares[index_of(t)])).collect();
        writeln!(page, "| {name} | {} |", row.join(" | "))?;
    }
    claims(page, cells, violations, figures)
}

/// What the thesis says, and whether it is so here.
fn claims(page: &mut String, cells: &Cells, violations: &[(&str, Vec<f64>)], figures: &Figures) -> std::fmt::Result {
    let verdict = |holds: bool| if holds { "holds" } else { "does not hold" };
    let ten_times = |disturbance: Disturbance, index: usize| {
        let worst = find(cells, "D", disturbance).map_or([f64::NAN; 3], |c| ratios(&c.rms[index], &c.rms[VARIATIONAL]));
        (worst.iter().all(|&r| r >= 10.0), worst)
    };
    writeln!(page, "\n## Claims\n")?;
    for (disturbance, figure) in [(Disturbance::None, "5.2, no noise"), (Disturbance::Process, "5.3, noise")] {
        writeln!(page, "- Figure {figure}: ten times more accurate than finite differences in every group (body D).")?;
        for (index, (name, _)) in METHODS.iter().enumerate().take(VARIATIONAL) {
            let (holds, ratio) = ten_times(disturbance, index);
            let groups: Vec<String> = GROUPS.iter().zip(ratio).map(|(g, r)| format!("{g} {}", short(r))).collect();
            writeln!(page, "  - against {name}: {} ({}).", verdict(holds), groups.join(", "))?;
        }
    }
    let series = |name: &str| {
        figures.iter().find(|(d, n, _)| *d == Disturbance::Process && *n == name).map(|(.., recursion)| recursion)
    };
    if let (Some(fd), Some(v)) = (series("forward-body"), series("variational")) {
        let from: Vec<String> = GROUPS
            .iter()
            .enumerate()
            .map(|(group, name)| {
                let better = |k: &usize| v.relative[*k][1][group] < fd.relative[*k][1][group];
                let last_worse = (0..SAMPLES).rev().find(|k| !better(k));
                match last_worse {
                    Some(k) if k + 1 < SAMPLES => format!("{name} from {:.2} s on", (k + 1) as f64 * 0.05),
                    Some(_) => format!("{name} never for good"),
                    None => format!("{name} always"),
                }
            })
            .collect();
        writeln!(
            page,
            "- Figure 5.3: better than forward-body differences after a few samples. With the LMI, rms over the seeds: {}.",
            from.join(", ")
        )?;
    }
    if let Some(cell) = find(cells, "D", Disturbance::Process) {
        let noise = WRENCH_DENSITY / 0.05_f64.sqrt();
        let all: Vec<String> = METHODS
            .iter()
            .zip(&cell.validation)
            .map(|((name, _), [torque, force])| {
                format!("{name} {} and {}", short(torque / noise), short(force / noise))
            })
            .collect();
        writeln!(
            page,
            "- Figure 5.4: residuals of torque and force over the next 30 s, in units of the wrench noise (1 is perfect; midpoint averages two wrenches): {}.",
            all.join("; ")
        )?;
    }
    for (name, printed) in TABLE_5_1 {
        if let Some(cell) = find(cells, name, Disturbance::Process) {
            let here = ratios(&cell.rms[FORWARD_BODY], &cell.rms[VARIATIONAL]);
            let near = here.iter().zip(printed).all(|(h, p)| (h / p).ln().abs() < std::f64::consts::LN_2);
            let holds = here.iter().all(|&r| r > 1.0);
            writeln!(
                page,
                "- Table 5.1, body {name}: the variational estimate is better in every group: {}; the printed ratios within a \
                 factor of two: {} ({} against {}).",
                verdict(holds),
                verdict(near),
                triple(&here),
                triple(&printed)
            )?;
        }
    }
    let exact = |index: usize| find(cells, "D", Disturbance::None).map_or([f64::NAN; 3], |cell| cell.rms[index]);
    writeln!(
        page,
        "- (5.24) with `B_k` as printed does not converge: without noise its errors are {} times those of the corrected regressor \
         (body D).",
        triple(&ratios(&exact(PRINTED), &exact(VARIATIONAL)))
    )?;
    let second_order: Vec<String> = cells
        .iter()
        .filter(|(_, disturbance, _)| *disturbance == Disturbance::Process)
        .map(|(name, _, cell)| format!("{name}: {}", triple(&ratios(&cell.rms[2], &cell.rms[VARIATIONAL]))))
        .collect();
    writeln!(
        page,
        "- Against a second-order baseline the advantage is gone: midpoint differences over variational, {}.",
        second_order.join("; ")
    )?;
    let late = violations.iter().map(|(_, shares)| shares[SAMPLES - 1]).fold(0.0, f64::max);
    let early = violations.iter().map(|(_, shares)| shares[index_of(0.5)]).fold(0.0, f64::max);
    writeln!(
        page,
        "- The LMI matters in the first seconds: up to {:.0} % of unconstrained estimates are no body at 0.5 s, {:.0} % at 30 s.",
        100.0 * early,
        100.0 * late
    )
}

#[allow(clippy::too_many_arguments, reason = "everything that is written")]
fn write(
    out: &Path,
    page: &str,
    seeds: usize,
    cells: &Cells,
    violations: &[(&str, Vec<f64>)],
    figures: &Figures,
    body: &Body,
) -> Result<(), Failure> {
    let folder = OutputFolder::create(out, false).map_err(study)?;
    let pictures = "\n![](figure_5_2.svg)\n![](figure_5_3.svg)\n![](figure_5_4.svg)\n![](violations.svg)\n";
    let put = |name: &str, text: &str| folder.write(name, text).map_err(study);
    put("chapter5.md", &format!("{page}{pictures}"))?;
    let mut table = String::from(
        "body,noise,method,inertia_kg_m2,com_m,mass_kg,bound_inertia_kg_m2,bound_com_m,bound_mass_kg,residual_torque_n_m,residual_force_n\n",
    );
    for (name, disturbance, cell) in cells {
        for ((method, _), (rms, residual)) in METHODS.iter().zip(cell.rms.iter().zip(&cell.validation)) {
            let numbers: Vec<String> =
                rms.iter().chain(&cell.bound).chain(residual).map(|x| format!("{x:.6e}")).collect();
            let _ = writeln!(table, "{name},{},{method},{}", disturbance.name(), numbers.join(","));
        }
    }
    put("table_5_1.csv", &table)?;
    for (number, disturbance) in [("5_2", Disturbance::None), ("5_3", Disturbance::Process)] {
        let mut text = String::from("t_s,method,lmi,inertia_relative,com_relative,mass_relative\n");
        let mut curves = Vec::new();
        for (_, name, recursion) in figures.iter().filter(|(found, ..)| *found == disturbance) {
            for (k, pair) in recursion.relative.iter().enumerate() {
                for (lmi, values) in [("no", pair[0]), ("yes", pair[1])] {
                    let _ = writeln!(
                        text,
                        "{:.2},{name},{lmi},{:.6e},{:.6e},{:.6e}",
                        k as f64 * 0.05,
                        values[0],
                        values[1],
                        values[2]
                    );
                }
            }
            for (group, label) in [(0, "inertia"), (2, "mass")] {
                let points =
                    recursion.relative.iter().enumerate().map(|(k, v)| (k as f64 * 0.05, v[1][group])).collect();
                curves.push(Curve { name: format!("{name}, {label}"), points });
            }
        }
        put(&format!("figure_{number}.csv"), &text)?;
        plot::draw(
            &folder.file(&format!("figure_{number}.svg")),
            &format!("Relative error, body D, noise {}, with the LMI", disturbance.name()),
            ["time, s", "relative error, rms over seeds"],
            Scale::Logarithmic,
            &curves,
        )?;
    }
    // One seed's residuals over the validation.
    let flight = flight(body, Disturbance::Process, 2 * SAMPLES - 1, 0);
    let mut text = String::from("t_s,method,tau_x,tau_y,tau_z,f_x,f_y,f_z\n");
    let mut curves = Vec::new();
    for index in [FORWARD_BODY, VARIATIONAL, ORDER4] {
        let (name, method) = METHODS[index];
        let found = fit(&first_half(&flight), method, SAMPLES)?;
        let mut points = Vec::new();
        for k in SAMPLES..2 * SAMPLES - 1 {
            if let Some((regressor, wrench)) = row(&flight, method, k) {
                let residual = regressor * found - wrench;
                let numbers: Vec<String> = residual.iter().map(|x| format!("{x:.6e}")).collect();
                let _ = writeln!(text, "{:.2},{name},{}", k as f64 * 0.05, numbers.join(","));
                points.push((k as f64 * 0.05, residual[0]));
            }
        }
        curves.push(Curve { name: name.to_owned(), points });
    }
    put("figure_5_4.csv", &text)?;
    plot::draw(
        &folder.file("figure_5_4.svg"),
        "Residual torque about x over the validation, body D, seed 0",
        ["time, s", "predicted less measured, N m"],
        Scale::Linear,
        &curves,
    )?;
    let mut text = String::from("t_s,body,share\n");
    let mut curves = Vec::new();
    for (name, shares) in violations {
        for (k, share) in shares.iter().enumerate() {
            let _ = writeln!(text, "{:.2},{name},{share}", k as f64 * 0.05);
        }
        let points = shares.iter().enumerate().take(200).map(|(k, share)| (k as f64 * 0.05, *share)).collect();
        curves.push(Curve { name: format!("body {name}"), points });
    }
    put("violations.csv", &text)?;
    plot::draw(
        &folder.file("violations.svg"),
        "Unconstrained estimates that are no body",
        ["time, s", "share of seeds"],
        Scale::Linear,
        &curves,
    )?;
    put("run.json", &crate::run_record("reproduce chapter5", &json!({ "seeds": seeds, "first_seed": 0 })))?;
    eprintln!("written: {}", folder.finish().map_err(study)?.display());
    Ok(())
}
