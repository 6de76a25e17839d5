//! What information costs: `cargo xtask study information-bought [--way NAME] [--runs STARTS] [--json] [--out DIR]`.
//!
//! The same short way, limits, weights and first inputs for two criteria: the planner's accumulated one (variances that are left
//! at the end), and the one of the thesis's planner as its published code has it (`original_criterion`). Both by the same search,
//! the best of several starts; both judged by the same independent code, with finer steps.

use std::path::Path;

use serde_json::json;
use tumble_planning::Units;
use tumble_planning::local::{CondensedProblem, Guess, RigidBodyModel, SqpSettings, SqpStatus, SqpWorkspace, minimise};

use crate::Failure;
use crate::arguments::Arguments;
use crate::local_cases::{LocalCase, Xorshift, documented_start, failed};
use crate::local_checker::LocalFindings;
use crate::local_tasks::short_way;
use crate::original_criterion::OriginalCriterion;
use crate::plot::{Curve, Scale, draw};

const STEPS: usize = 40;
/// Along the diagonal of the box of forces there is no gain in turning; elsewhere there is, and a plan that does not care for
/// the inertia learns it all the same.
const WAYS: [(&str, [f64; 3]); 2] = [("diagonal", [0.236; 3]), ("side", [0.349, 0.155, 0.078])];
const SEED: u64 = 88_172_645_463_325_252;
/// Of the starts that are drawn, in limits.
const SHARE: f64 = 0.5;
/// Residual of both searches; at 1e-4 torques of the start that nothing asks for remain, for they hardly cost anything.
const TOLERANCE: f64 = 1e-6;
/// As many as the planner is given.
const ITERATIONS: usize = 200;
const PLENTY: u64 = 1 << 40;
const PRINCIPAL: [usize; 4] = [0, 4, 7, 9];
/// Weights of the relative variances of the inertia; of the mass a hundredth.
const GAMMAS: [f64; 14] = [0.0, 1e1, 3e1, 1e2, 3e2, 1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6, 3e6, 1e7];
/// Weights of mass and inertia in the original criterion. Released are 50 and 20.
const ORIGINAL: [(f64, &[f64]); 2] = [
    (0.0, &[0.0, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0, 3.0, 10.0]),
    (50.0, &[0.02, 0.06, 0.2, 0.6, 2.0, 6.0, 20.0, 60.0]),
];
/// Largest relative standard deviation of a moment of inertia that is to be had, for how much more cost.
const CLAIMED_SIGMA: f64 = 0.025;
const CLAIMED_EXCESS: f64 = 0.015;

/// The best plan of several starts.
struct Bought {
    /// Of mass and inertia.
    weights: [f64; 2],
    /// What was minimised.
    cost: f64,
    tracking_and_effort: f64,
    /// Relative standard deviations of mass and moments of inertia.
    relative: [f64; 4],
    goal_error_m: f64,
    /// Of the best start.
    iterations: usize,
    is_converged: bool,
    /// Starts that converged.
    converged: usize,
}

impl Bought {
    fn new(case: &LocalCase<4>, weights: [f64; 2], cost: f64, findings: &LocalFindings<4>) -> Self {
        let found = &findings.fine_cost;
        Self {
            weights,
            cost,
            tracking_and_effort: found.tracking_and_effort,
            relative: std::array::from_fn(|i| found.sigma[i] / case.task.parameters[PRINCIPAL[i]]),
            goal_error_m: findings.goal_error_m,
            iterations: 0,
            is_converged: false,
            converged: 0,
        }
    }

    fn inertia(&self) -> f64 {
        self.relative[1..].iter().sum::<f64>() / 3.0
    }

    fn worst_inertia(&self) -> f64 {
        self.relative[1..].iter().fold(0.0, |worst: f64, x| worst.max(*x))
    }
}

/// Keeps the best of several searches.
fn best_of(
    starts: &[Vec<[f64; 6]>],
    mut run: impl FnMut(&[[f64; 6]]) -> Result<Bought, Failure>,
) -> Result<Bought, Failure> {
    let all = starts.iter().map(|start| run(start)).collect::<Result<Vec<_>, _>>()?;
    let converged = all.iter().filter(|bought| bought.is_converged).count();
    let best = all.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
    let best = best.ok_or_else(|| Failure::BadInput("information-bought: no start".to_owned()))?;
    Ok(Bought { converged, ..best })
}

fn accumulated(gamma: f64, goal: [f64; 3], starts: &[Vec<[f64; 6]>]) -> Result<Bought, Failure> {
    let mut task = short_way(goal);
    let weights = [0.01 * gamma, gamma];
    task.information_weights =
        std::array::from_fn(|i| weights[usize::from(i > 0)] / task.parameters[PRINCIPAL[i]].powi(2));
    let case = LocalCase::new(task, STEPS, false)?;
    let mut planner = case.planner(RigidBodyModel::principal(), TOLERANCE)?;
    best_of(starts, |start| {
        let run = case.run(&mut planner, Guess::Inputs(start))?;
        let findings = run.findings.as_ref().ok_or_else(|| Failure::BadInput("there is no plan".to_owned()))?;
        let bought = Bought::new(&case, weights, findings.cost.total(), findings);
        Ok(Bought { iterations: run.iterations, is_converged: run.is_converged, ..bought })
    })
}

fn original(weights: [f64; 2], goal: [f64; 3], starts: &[Vec<[f64; 6]>]) -> Result<Bought, Failure> {
    let case = LocalCase::new(short_way(goal), STEPS, false)?;
    let [mass, inertia] = weights;
    let mut problem = OriginalCriterion::new(&case, [mass, inertia, inertia, inertia]).map_err(failed)?;
    let settings = SqpSettings { tolerance: TOLERANCE, iterations: ITERATIONS, ..SqpSettings::COLD };
    let mut workspace = SqpWorkspace::new(problem.unknowns(), problem.rows());
    best_of(starts, |start| {
        let wrench = &case.task.wrench;
        let mut z: Vec<f64> = start.iter().flat_map(|input| (0..6).map(|i| input[i] / wrench[i])).collect();
        workspace.forget();
        let outcome = minimise(&mut problem, &mut z, &settings, &mut workspace, &mut Units::new(PLENTY), 1);
        let findings = case.task.judge(&problem.inputs(&z));
        let bought = Bought::new(&case, weights, outcome.cost, &findings);
        let is_converged = outcome.status == SqpStatus::Converged;
        Ok(Bought { iterations: outcome.iterations, is_converged, ..bought })
    })
}

/// What this mean relative standard deviation of the inertia costs over the uninformed optimum, between the nearest plans of a
/// sweep (straight in both logarithms); nothing outside of it.
fn excess_at(sweep: &[Bought], uninformed: f64, inertia: f64) -> Option<f64> {
    let mut points: Vec<(f64, f64)> = sweep
        .iter()
        .map(|bought| (bought.inertia(), bought.tracking_and_effort - uninformed))
        .filter(|(_, excess)| *excess > 0.0)
        .map(|(sigma, excess)| (sigma.ln(), excess.ln()))
        .collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let x = inertia.ln();
    let pair = points.windows(2).find(|pair| pair[0].0 <= x && x <= pair[1].0)?;
    let part = (x - pair[0].0) / (pair[1].0 - pair[0].0);
    Some((pair[0].1 + part * (pair[1].1 - pair[0].1)).exp())
}

/// One criterion's sweep, as printed.
fn print(sweep: &[Bought], uninformed: f64, starts: usize, ours: Option<&[Bought]>) {
    let head = "| weights of m, I | tracking + effort | more, % | relative sigma of m, Ixx, Iyy, Izz, % | goal error, mm | iterations | converged";
    let (more, rule) =
        if ours.is_some() { (" | ours at this sigma of I, more, % | ours / this |", "|---|---|") } else { (" |", "|") };
    println!("{head}{more}\n|---|---|---|---|---|---|---{rule}");
    for row in sweep {
        let [mass, xx, yy, zz] = row.relative.map(|sigma| 100.0 * sigma);
        let excess = row.tracking_and_effort - uninformed;
        let more = 100.0 * excess / uninformed;
        print!(
            "| {}, {} | {:.3} | {:.2} | {mass:.2}, {xx:.2}, {yy:.2}, {zz:.2} | {:.1} | {}{} | {} of {starts} |",
            row.weights[0],
            row.weights[1],
            row.tracking_and_effort,
            if more.abs() < 5e-3 { 0.0 } else { more },
            1e3 * row.goal_error_m,
            row.iterations,
            if row.is_converged { "" } else { ", not converged" },
            row.converged,
        );
        if let Some(ours) = ours {
            match excess_at(ours, uninformed, row.inertia()) {
                Some(other) => print!(" {:.2} | {:.3} |", 100.0 * other / uninformed, other / excess),
                None => print!(" | |"),
            }
        }
        println!();
    }
    println!();
}

fn line(criterion: &str, row: &Bought, uninformed: f64, ours: Option<&[Bought]>) -> serde_json::Value {
    let excess = row.tracking_and_effort - uninformed;
    let other = ours.and_then(|ours| excess_at(ours, uninformed, row.inertia()));
    json!({
        "block": "information-bought", "criterion": criterion, "weights": row.weights,
        "tracking_and_effort": row.tracking_and_effort, "excess": excess, "relative_sigma": row.relative,
        "goal_error_m": row.goal_error_m, "iterations": row.iterations, "is_converged": row.is_converged,
        "converged": row.converged, "accumulated_excess_at_this_sigma": other,
    })
}

fn picture(folder: &Path, uninformed: f64, sweeps: &[(String, &[Bought])]) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|error| Failure::file(folder, error))?;
    let curve = |(name, sweep): &(String, &[Bought])| {
        let points =
            sweep.iter().map(|row| (row.inertia().log10(), 100.0 * (row.tracking_and_effort / uninformed - 1.0)));
        let mut points: Vec<(f64, f64)> = points.filter(|(_, more)| *more > 1e-2).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Curve { name: name.clone(), points }
    };
    let curves: Vec<Curve> = sweeps.iter().map(curve).collect();
    let labels = ["log10 of the mean relative sigma of Ixx, Iyy, Izz", "more tracking + effort, %"];
    draw(&folder.join("information_bought.svg"), "What information costs", labels, Scale::Logarithmic, &curves)
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let runs = arguments.number("--runs")?.unwrap_or(5).max(1);
    let way = arguments.value("--way").unwrap_or("diagonal");
    let goal = WAYS.iter().find(|(name, _)| *name == way).map(|(_, goal)| *goal);
    let goal = goal.ok_or_else(|| Failure::BadInput(format!("--way wants `diagonal` or `side`, not `{way}`")))?;
    let task = short_way(goal);
    let mut chance = Xorshift(SEED);
    let mut starts = vec![documented_start(&task.wrench, STEPS)];
    starts.extend((1..runs).map(|_| chance.inputs(&task.wrench, STEPS, SHARE)));

    let ours = GAMMAS.iter().map(|gamma| accumulated(*gamma, goal, &starts)).collect::<Result<Vec<_>, _>>()?;
    let uninformed = ours[0].tracking_and_effort;
    println!("Accumulated: gamma on relative variances\n");
    print(&ours, uninformed, runs, None);
    let mut originals = Vec::new();
    for (mass, inertias) in ORIGINAL {
        let sweep =
            inertias.iter().map(|inertia| original([mass, *inertia], goal, &starts)).collect::<Result<Vec<_>, _>>()?;
        println!("Original criterion, weight of the mass {mass}\n");
        print(&sweep, uninformed, runs, Some(&ours));
        originals.push((format!("original, weight of the mass {mass}"), sweep));
    }
    if arguments.has("--json") {
        for row in &ours {
            println!("{}", line("accumulated", row, uninformed, None));
        }
        for (name, sweep) in &originals {
            for row in sweep {
                println!("{}", line(name, row, uninformed, Some(&ours)));
            }
        }
    }
    if let Some(folder) = arguments.value("--out") {
        let mut sweeps = vec![("accumulated".to_owned(), ours.as_slice())];
        sweeps.extend(originals.iter().map(|(name, sweep)| (name.clone(), sweep.as_slice())));
        picture(Path::new(folder), uninformed, &sweeps)?;
    }
    claims(&ours, &originals[0].1[0])
}

fn claims(ours: &[Bought], other_uninformed: &Bought) -> Result<(), Failure> {
    let uninformed = ours[0].tracking_and_effort;
    let least = ours[0].relative[1..].iter().fold(f64::INFINITY, |least: f64, x| least.min(*x));
    let known = ours.iter().filter(|row| row.worst_inertia() <= CLAIMED_SIGMA);
    let excess = known.map(|row| row.tracking_and_effort / uninformed - 1.0).fold(f64::INFINITY, f64::min);
    let apart = (other_uninformed.tracking_and_effort / uninformed - 1.0).abs();
    let claims = [
        (
            format!("uninformed, least relative sigma of a moment of inertia {:.1} % (>= 43 %)", 100.0 * least),
            least >= 0.43,
        ),
        (
            format!(
                "every relative sigma of the inertia <= {:.1} % for {:.2} % more tracking + effort (<= {:.1} %)",
                100.0 * CLAIMED_SIGMA,
                100.0 * excess,
                100.0 * CLAIMED_EXCESS
            ),
            excess <= CLAIMED_EXCESS,
        ),
        (format!("both problems' uninformed optimum is the same: {apart:.1e} apart (<= 1e-6)"), apart <= 1e-6),
    ];
    for (claim, is_met) in &claims {
        println!("{} {claim}", if *is_met { "PASS" } else { "MISS" });
    }
    let missed: Vec<&str> = claims.iter().filter(|(_, is_met)| !is_met).map(|(claim, _)| claim.as_str()).collect();
    if missed.is_empty() { Ok(()) } else { Err(Failure::TargetMissed(missed.join("; "))) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bought(inertia: f64, tracking_and_effort: f64) -> Bought {
        let relative = [0.0, 0.9 * inertia, inertia, 1.1 * inertia];
        Bought {
            weights: [0.0, 1.0],
            cost: tracking_and_effort,
            tracking_and_effort,
            relative,
            goal_error_m: 0.0,
            iterations: 1,
            is_converged: true,
            converged: 1,
        }
    }

    #[test]
    fn costs_between_plans_are_powers_of_the_accuracy() {
        let sweep: Vec<Bought> = [0.4, 0.1, 0.01].map(|sigma: f64| bought(sigma, 20.0 + sigma.powi(-2))).into();
        let found = excess_at(&sweep, 20.0, 0.03).unwrap();
        assert!((found * 0.03 * 0.03 - 1.0).abs() < 1e-12, "{found}");
        assert_eq!(excess_at(&sweep, 20.0, 0.5), None);
        assert_eq!(excess_at(&sweep, 20.0, 0.009), None);
        // what costs nothing more is no point of the curve
        assert_eq!(excess_at(&sweep, 50.0, 0.2), None);
    }
}
