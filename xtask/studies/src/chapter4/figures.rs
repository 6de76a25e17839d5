//! Tables and pictures of the figures.

use std::fmt::Write as _;

use tumble::output::OutputFolder;

use super::statistics::normalized;
use super::{Case, Study};
use crate::Failure;
use crate::plot::{self, Curve, Marks, Panel, Point, Scale};

/// Pictures as the page shows them.
pub const LINKS: &str = "\n![](figure_4_4.svg)\n![](figure_4_5.svg)\n![](figure_4_6.svg)\n![](figure_4_7.svg)\n\
                         ![](figure_4_8.svg)\n![](figure_4_9.svg)\n![](figure_4_10.svg)\n";

/// Column of [`GroupErrors`](super::flown::GroupErrors), its label, and the factor to the label's unit, in the thesis's order.
const GROUPS: [(usize, &str, f64); 3] =
    [(2, "mass error, %", 100.0), (1, "centre of mass error, mm", 1e3), (0, "inertia error, %", 100.0)];
const CRITERIA: [&str; 2] = ["V1", "V2"];

pub fn write(folder: &OutputFolder, study: &Study) -> Result<(), Failure> {
    figure_4_4(folder, study)?;
    figure_4_5(folder, study)?;
    boxes(folder, "4_6", ["V1", "V2"], [&study.free[0], &study.free[1]])?;
    boxes(folder, "4_7", ["no limits", "limits"], [&study.free[0], &study.boxed[0]])?;
    figure_4_8(folder, study)?;
    figures_4_9_and_4_10(folder, study)
}

fn put(folder: &OutputFolder, name: &str, text: &str) -> Result<(), Failure> {
    folder.write(name, text).map_err(super::study)
}

/// Errors in the units of the labels, in the thesis's order.
fn in_units(errors: super::flown::GroupErrors) -> [f64; 3] {
    GROUPS.map(|(group, _, factor)| factor * errors[group])
}

fn row(numbers: &[f64]) -> String {
    numbers.iter().map(|x| format!("{x:.6e}")).collect::<Vec<_>>().join(",")
}

/// One load, motion of V1, the robot's limits.
fn figure_4_4(folder: &OutputFolder, study: &Study) -> Result<(), Failure> {
    let Some(case) = study.boxed[0].first() else { return Ok(()) };
    let mut text = String::from("harmonics,mass_percent,com_mm,inertia_percent,residual_normalised,power_residual_w\n");
    let mut curves: [Vec<(f64, f64)>; 4] = Default::default();
    for candidate in &case.outcome.candidates {
        let errors = in_units(case.outcome.with_harmonics(candidate.harmonics));
        let residuals = [candidate.normalised_residual, candidate.power_residual_w];
        let _ = writeln!(text, "{},{},{}", candidate.harmonics, row(&errors), row(&residuals));
        let values = [errors[0], errors[1], errors[2], residuals[0]];
        for (curve, value) in curves.iter_mut().zip(values) {
            curve.push((candidate.harmonics as f64, value));
        }
    }
    put(folder, "figure_4_4.csv", &text)?;
    let labels = [GROUPS[0].1, GROUPS[1].1, GROUPS[2].1, "residual, in standard deviations"];
    let panels = labels.iter().zip(curves).map(|(label, points)| Panel {
        labels: ["harmonics", label],
        scale: Scale::Logarithmic,
        marks: Marks::Curves(vec![Curve { name: String::new(), points }]),
    });
    plot::panels(
        &folder.file("figure_4_4.svg"),
        "Errors and residual by the number of harmonics",
        &panels.collect::<Vec<_>>(),
    )
}

fn figure_4_5(folder: &OutputFolder, study: &Study) -> Result<(), Failure> {
    let mut text = String::from(
        "criterion,motion,load,saturation,n_filt,n_filt_by_energy,n_min_mass,n_min_com,n_min_inertia,mass_percent,com_mm,inertia_percent\n",
    );
    let mut points: [Vec<Point>; 3] = Default::default();
    for (criterion, cases) in CRITERIA.iter().zip(&study.boxed) {
        for case in cases {
            let outcome = &case.outcome;
            let (errors, best, [chosen, by_energy]) = (in_units(outcome.errors()), outcome.best(), outcome.chosen);
            let _ = writeln!(
                text,
                "{criterion},{},{},{:.4},{chosen},{by_energy},{},{},{},{}",
                case.motion,
                case.load,
                outcome.saturation,
                best[2],
                best[1],
                best[0],
                row(&errors)
            );
            // Beside each other where they would lie on each other.
            let place = chosen as f64 + 0.06 * (case.motion as f64 - 2.0) + 0.02 * (case.load as f64 - 5.0);
            for ((points, error), (group, ..)) in points.iter_mut().zip(errors).zip(GROUPS) {
                points.push(Point { x: place, y: error, heat: chosen.abs_diff(best[group]) as f64 });
            }
        }
    }
    put(folder, "figure_4_5.csv", &text)?;
    let panels = GROUPS.iter().zip(points).map(|((_, label, _), points)| Panel {
        labels: ["chosen number of harmonics", label],
        scale: Scale::Logarithmic,
        marks: Marks::Points { heat: "|n_filt - n_min|", points },
    });
    plot::panels(
        &folder.file("figure_4_5.svg"),
        "Errors by the chosen number of harmonics",
        &panels.collect::<Vec<_>>(),
    )
}

fn boxes(folder: &OutputFolder, number: &str, names: [&str; 2], cases: [&Vec<Case>; 2]) -> Result<(), Failure> {
    let estimators = ["least squares", "coefficient likelihood", "trajectory likelihood"];
    let mut text = String::from("condition,motion,load,saturation,estimator,mass_percent,com_mm,inertia_percent\n");
    for (name, cases) in names.iter().zip(cases) {
        for case in cases {
            let outcome = &case.outcome;
            let answers = [Some(outcome.errors()), outcome.by_coefficients, outcome.by_trajectory];
            for (estimator, errors) in estimators.iter().zip(answers) {
                if let Some(errors) = errors {
                    let place = format!("{name},{},{},{:.4}", case.motion, case.load, outcome.saturation);
                    let _ = writeln!(text, "{place},{estimator},{}", row(&in_units(errors)));
                }
            }
        }
    }
    put(folder, &format!("figure_{number}.csv"), &text)?;
    let panels = GROUPS.iter().enumerate().map(|(index, (_, label, _))| {
        let of = |cases: &Vec<Case>| cases.iter().map(|case| in_units(case.outcome.errors())[index]).collect();
        let boxes = names.iter().zip(cases).map(|(name, cases)| ((*name).to_owned(), of(cases)));
        Panel { labels: ["", label], scale: Scale::Logarithmic, marks: Marks::Boxes(boxes.collect()) }
    });
    let title = format!("Least squares: {} and {}", names[0], names[1]);
    plot::panels(&folder.file(&format!("figure_{number}.svg")), &title, &panels.collect::<Vec<_>>())
}

fn figure_4_8(folder: &OutputFolder, study: &Study) -> Result<(), Failure> {
    let levels = study.shares.iter().chain(&study.torque_shares);
    let wanted = levels.flat_map(|(share, cases)| cases.iter().map(|case| (Some(*share), case)));
    let all: Vec<(Option<f64>, &Case)> = study.free[0].iter().map(|case| (None, case)).chain(wanted).collect();
    let answered: Vec<_> = all.iter().filter(|(_, case)| case.outcome.errors()[0].is_finite()).collect();
    let mut text = String::from(
        "wanted_share,saturation,force_limit_n,torque_limit_n_m,motion,load,mass_percent,com_mm,inertia_percent,mass_normalised,com_normalised,\
         inertia_normalised,trajectory_mass_percent,trajectory_com_mm,trajectory_inertia_percent\n",
    );
    let scaled: Vec<Vec<f64>> = (0..3)
        .map(|i| normalized(&answered.iter().map(|(_, case)| in_units(case.outcome.errors())[i]).collect::<Vec<_>>()))
        .collect();
    for (k, (share, case)) in answered.iter().enumerate() {
        let outcome = &case.outcome;
        let _ = writeln!(
            text,
            "{},{:.4},{:.4},{:.4},{},{},{},{},{}",
            share.unwrap_or(0.0),
            outcome.saturation,
            case.limits.force_limit.x,
            case.limits.torque_limit.x,
            case.motion,
            case.load,
            row(&in_units(outcome.errors())),
            row(&[scaled[0][k], scaled[1][k], scaled[2][k]]),
            row(&outcome.by_trajectory.map_or([f64::NAN; 3], in_units))
        );
    }
    put(folder, "figure_4_8.csv", &text)?;
    let panels = ["mass", "centre of mass", "inertia"].iter().zip(&scaled).map(|(label, values)| {
        let points = answered.iter().zip(values).map(|((share, case), value)| Point {
            x: 100.0 * case.outcome.saturation,
            y: *value,
            heat: 100.0 * share.unwrap_or(0.0),
        });
        Panel {
            labels: ["saturated, % of the time", label],
            scale: Scale::Linear,
            marks: Marks::Points { heat: "wanted, %", points: points.collect() },
        }
    });
    plot::panels(
        &folder.file("figure_4_8.svg"),
        "Normalised errors (4.21) of least squares",
        &panels.collect::<Vec<_>>(),
    )
}

const PARAMETERS: [&str; 10] = ["m", "c_x", "c_y", "c_z", "J_xx", "J_xy", "J_xz", "J_yy", "J_yz", "J_zz"];

/// Mass, centre of mass, inertia about the origin.
fn with_center(p: &nalgebra::SVector<f64, 10>) -> [f64; 10] {
    std::array::from_fn(|i| if (1..4).contains(&i) { p[i] / p[0] } else { p[i] })
}

fn figures_4_9_and_4_10(folder: &OutputFolder, study: &Study) -> Result<(), Failure> {
    let mut text = String::from("motion,load,parameter,truth,error,relative_percent\n");
    let (mut relative, mut absolute): ([Vec<f64>; 10], [Vec<f64>; 10]) = Default::default();
    for case in &study.long {
        let Some(found) = &case.outcome.least_squares else { continue };
        let (found, truth) = (with_center(found), with_center(&case.outcome.truth));
        for (i, name) in PARAMETERS.iter().enumerate() {
            let error = found[i] - truth[i];
            let percent = 100.0 * error / truth[i];
            let _ = writeln!(text, "{},{},{name},{}", case.motion, case.load, row(&[truth[i], error, percent]));
            relative[i].push(percent);
            absolute[i].push(percent.abs());
        }
    }
    put(folder, "figure_4_9.csv", &text)?;
    for (number, label, scale, values) in [
        ("4_9", "relative error, %", Scale::Linear, relative),
        ("4_10", "size of the relative error, %", Scale::Logarithmic, absolute),
    ] {
        let boxes = PARAMETERS.iter().zip(values).map(|(name, values)| ((*name).to_owned(), values)).collect();
        let marks = Marks::Boxes(boxes);
        let panel = Panel { labels: ["", label], scale, marks };
        plot::panels(&folder.file(&format!("figure_{number}.svg")), "Least squares, period 60 s", &[panel])?;
    }
    Ok(())
}
