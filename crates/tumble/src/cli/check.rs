//! `tumble check`: what a model says of the masses of its links, and whether that can be.

use super::{Outcome, print};
use crate::TumbleError;
use crate::output::write_file;
use clap::Args;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use tumble_dynamics::InertialParameters;
use tumble_formats::log::shortened;
use tumble_formats::model::{Model, ModelLink, Verdict, judge};
use tumble_formats::text_file::printable;
use tumble_formats::{FormatsError, body_file, text_file};

/// Options of `tumble check`.
#[derive(Args)]
pub struct CheckArgs {
    /// A URDF or an MJCF (MuJoCo) file.
    model: PathBuf,
    /// Write the same file with each impossible inertia replaced by the nearest one of a body; what is only suspected stays.
    #[arg(long, value_name = "FILE")]
    repair: Option<PathBuf>,
    /// Print one JSON object and nothing else on stdout.
    #[arg(long)]
    json: bool,
    /// Replace an output that exists.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for a file that is no model; that something is wrong in it is [`Outcome::NotAchieved`].
pub fn run(args: &CheckArgs) -> Result<Outcome, TumbleError> {
    if let Some(path) = args.repair.as_ref().filter(|path| path.exists() && !args.force) {
        return Err(TumbleError::OutputExists { path: path.clone() });
    }
    let model = read(&args.model)?;
    let verdicts = judge(&model);
    let wrong = verdicts.iter().filter(|verdict| verdict.is_wrong()).count();
    print(&if args.json {
        format!("{}\n", as_json(&args.model, &model, &verdicts))
    } else {
        table(&args.model, &model, &verdicts, wrong)
    })?;
    if let Some(path) = &args.repair {
        let repaired = model.repaired(&verdicts);
        write_file(path, repaired.text.as_bytes(), args.force)?;
        for name in &repaired.left {
            tell_line!("warning: `{}` is left as it was: no inertia mends its mass", shortened(name));
        }
        let done: Vec<String> = repaired.links.iter().map(|name| format!("`{}`", shortened(name))).collect();
        let done =
            if done.is_empty() { "nothing is changed".to_owned() } else { format!("repaired: {}", done.join(", ")) };
        tell_line!("wrote {}; {done}", path.display());
    }
    Ok(if wrong == 0 { Outcome::Achieved } else { Outcome::NotAchieved })
}

/// Reads a model of at most 1 MiB.
pub(super) fn read(path: &Path) -> Result<Model, TumbleError> {
    let unreadable = |source| FormatsError::Unreadable { path: path.into(), source };
    Ok(Model::parse(path, &text_file::read(path).map_err(unreadable)?)?)
}

fn table(path: &Path, model: &Model, verdicts: &[Verdict], wrong: usize) -> String {
    let kind = model.kind.name().to_uppercase();
    let mut text = format!("{}: `{}`, {kind}, {} links\n", path.display(), shortened(&model.name), model.links.len());
    for note in &model.notes {
        let _ = writeln!(text, "note: {note}");
    }
    let _ = writeln!(
        text,
        "\n{:>6}  {:<26} {:>12}  {:<30} {:<34} can it be",
        "line", "link", "mass, kg", "centre of mass, m", "principal inertias, kg m^2"
    );
    for (link, verdict) in model.links.iter().zip(verdicts) {
        let name = shortened(&link.name);
        let _ = match &link.inertial {
            None => writeln!(text, "{:>6}  {name:<26} {:>12}  {:<30} {:<34} not stated", link.line, "-", "-", "-"),
            Some(inertial) => writeln!(
                text,
                "{:>6}  {name:<26} {:>12}  {:<30} {:<34} {}",
                link.line,
                inertial.mass,
                numbers(inertial.center_of_mass().as_slice()),
                numbers(&principal(link)),
                if verdict.physical == Some(false) { "no" } else { "yes" }
            ),
        };
        // that nothing is stated stands in the row
        for finding in verdict.findings.iter().filter(|finding| finding.message != "not stated") {
            let (severity, kind) = (finding.severity.name(), finding.kind.name());
            let _ = writeln!(text, "{:8}{severity}, {kind}: {}", "", printable(&finding.message));
        }
        if let Some(nearest) = &verdict.nearest {
            let _ = writeln!(
                text,
                "{:8}nearest: principal inertias {}, the tensor changed by {:.2} %",
                "",
                numbers(&sorted(nearest.inertia.symmetric_eigenvalues().into())),
                100.0 * nearest.change
            );
        }
    }
    let _ = match wrong {
        0 => writeln!(text, "\nnothing is wrong that could be told from this file"),
        1 => writeln!(text, "\n1 link of {} has something wrong", model.links.len()),
        _ => writeln!(text, "\n{wrong} links of {} have something wrong", model.links.len()),
    };
    text
}

fn principal(link: &ModelLink) -> [f64; 3] {
    link.inertial.as_ref().map_or([0.0; 3], |inertial| sorted(inertial.inertia.symmetric_eigenvalues().into()))
}

fn sorted(mut values: [f64; 3]) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    values
}

/// Four significant digits each.
fn numbers(values: &[f64]) -> String {
    let digits = |value: &f64| match value.abs() {
        0.0 => "0".to_owned(),
        size if (1e-3..1e4).contains(&size) => {
            let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(*value);
            rounded.to_string()
        }
        _ => format!("{value:.3e}"),
    };
    format!("({})", values.iter().map(digits).collect::<Vec<_>>().join(", "))
}

fn as_json(path: &Path, model: &Model, verdicts: &[Verdict]) -> Value {
    let link = |(link, verdict): (&ModelLink, &Verdict)| {
        let findings: Vec<Value> = verdict
            .findings
            .iter()
            .map(|finding| {
                json!({ "severity": finding.severity.name(), "kind": finding.kind.name(), "message": finding.message })
            })
            .collect();
        let nearest = link.inertial.as_ref().zip(verdict.nearest.as_ref()).map(|(inertial, nearest)| {
            json!({
                "inertia_about_com_kg_m2": body_file::rows(&inertial.in_link_axes(&nearest.inertia)),
                "relative_change": nearest.change,
            })
        });
        let inertial = link.inertial.as_ref();
        json!({
            "link": link.name,
            "line": link.line,
            "mass_kg": inertial.map(|inertial| inertial.mass),
            "com_m": inertial.map(|inertial| <[f64; 3]>::from(inertial.center_of_mass())),
            "inertia_about_com_kg_m2": inertial.map(|i| body_file::rows(&i.in_link_axes(&i.inertia))),
            "principal_inertias_kg_m2": inertial.map(|_| principal(link)),
            "physical": verdict.physical,
            "findings": findings,
            "nearest": nearest,
        })
    };
    json!({
        "format": 1,
        "model": model.name,
        "file": path.display().to_string(),
        "kind": model.kind.name(),
        "wrong": verdicts.iter().filter(|verdict| verdict.is_wrong()).count(),
        "notes": model.notes,
        "links": model.links.iter().zip(verdicts).map(link).collect::<Vec<_>>(),
    })
}

/// What `--export` writes: the body by itself, or with `--patch` that model with the body in one of its links.
///
/// # Errors
/// Those of [`body_file::export`], of reading the model, and of a link that is not there.
pub(super) fn exported(
    export: &Path,
    patch: Option<&Path>,
    link: Option<&str>,
    body: &InertialParameters<f64>,
) -> Result<String, TumbleError> {
    let Some(path) = patch else { return Ok(body_file::export(export, body)?) };
    let (model, text, name) = patched(path, link, body)?;
    if model.from_shapes {
        tell_line!(
            "warning: {}: `inertiafromgeom=\"true\"` overrides every `<inertial>`, the new one too",
            path.display()
        );
    }
    let (name, path) = (shortened(&name), path.display());
    tell_line!("link `{name}` of {path} gets the body, whose axes and origin are taken to be those of the link");
    Ok(text)
}

/// A model, its text with another body in one of its links, and the name of that link.
pub(super) fn patched(
    path: &Path,
    link: Option<&str>,
    body: &InertialParameters<f64>,
) -> Result<(Model, String, String), TumbleError> {
    let model = read(path)?;
    let (text, name) = model.with_body(path, link, body)?;
    Ok((model, text, name))
}
