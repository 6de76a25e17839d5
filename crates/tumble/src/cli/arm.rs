//! `tumble arm`: the arms that come with the program, and those of files.

use super::arm_excite::{self, ExciteOptions};
use super::{Outcome, print};
use crate::TumbleError;
use clap::{Args, Subcommand, ValueEnum};
use std::fmt::Write as _;
use tumble_dynamics::{InertialParameters, JointAxis};
use tumble_formats::Robots;
use tumble_formats::arm::{ArmFrame, ArmModel};
use tumble_formats::log::{joint_template, shortened};

/// Options of `tumble arm`.
#[derive(Args)]
pub struct ArmArgs {
    #[command(subcommand)]
    command: ArmCommand,
}

#[derive(Subcommand)]
enum ArmCommand {
    /// Prints the names of the embedded arms.
    List,
    /// Prints joints and bodies of an arm, whether each body can be, and the total mass.
    Show {
        /// Name of an embedded arm, or a TOML or URDF file.
        name: String,
        /// What to print.
        #[arg(long = "as", value_enum, default_value_t = Form::Table)]
        form: Form,
    },
    /// Designs a periodic motion of the joints that shows the arm's bodies, or what it grasps.
    Excite(ExciteOptions),
}

#[derive(Clone, Copy, ValueEnum)]
enum Form {
    /// For people.
    Table,
    /// A file to run or to start from.
    Toml,
    /// For other programs; springs, rotors, drives and gravity have no place there.
    Urdf,
    /// The columns of a log of its joints, with two valid rows.
    LogTemplate,
}

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for an arm that is none.
pub fn run(args: &ArmArgs, robots: &Robots) -> Result<Outcome, TumbleError> {
    match &args.command {
        ArmCommand::List => {
            let mut text = String::new();
            for embedded in robots.arms() {
                let arm = ArmModel::find(embedded.name, robots)?;
                let _ = writeln!(text, "{:<20}{}", embedded.name, arm.description.unwrap_or_default());
            }
            print(&text)?;
            tell_line!("next: tumble arm show NAME, or tumble arm show NAME --as toml > my.toml");
        }
        ArmCommand::Show { name, form } => {
            let arm = ArmModel::find(name, robots)?;
            for warning in &arm.warnings {
                tell_line!("warning: {warning}");
            }
            print(&match form {
                Form::Table => table(&arm),
                Form::Toml => arm.to_toml()?,
                Form::Urdf => arm.to_urdf(),
                Form::LogTemplate => joint_template(&arm),
            })?;
        }
        ArmCommand::Excite(options) => return arm_excite::run(options, robots),
    }
    Ok(Outcome::Achieved)
}

fn table(arm: &ArmModel) -> String {
    let mut text = String::new();
    let description = arm.description.as_ref().map_or_else(String::new, |words| format!(": {}", shortened_line(words)));
    let [x, y, z]: [f64; 3] = arm.gravity_world_m_s2.into();
    let _ = writeln!(text, "{}{description}", shortened(&arm.name));
    let _ =
        writeln!(text, "{} base, gravity ({x}, {y}, {z}) m/s^2, {} joints\n", arm.base_kind.name(), arm.joints.len());
    let _ = writeln!(
        text,
        "{:>3} {:<24} {:<24} {:<9} {:<25} {:<32} {:>17} {:>7} {:>7} {:>9}",
        "",
        "joint",
        "on",
        "kind",
        "axis, link axes",
        "origin in parent, m",
        "range, rad or m",
        "rate",
        "effort",
        "N m/A"
    );
    for (number, (joint, link)) in (1..).zip(arm.joints.iter().zip(arm.tree.links())) {
        let kind = match link.joint.kind() {
            JointAxis::Revolute => "revolute",
            JointAxis::Prismatic => "prismatic",
        };
        let on = arm.body_name(link.parent.map_or(0, |parent| parent + 1)).unwrap_or_default();
        let range = match (joint.limits.lower, joint.limits.upper) {
            (None, None) => "-".to_owned(),
            (lower, upper) => format!("{}..{}", number_or_dash(lower), number_or_dash(upper)),
        };
        let _ = writeln!(
            text,
            "{number:>3} {:<24} {:<24} {kind:<9} {:<25} {:<32} {range:>17} {:>7} {:>7} {:>9}",
            shortened(&joint.name),
            shortened(on),
            vector(link.joint.axis().as_slice(), 4),
            vector(link.joint.parent_from_link().translation.vector.as_slice(), 5),
            number_or_dash(joint.limits.rate),
            number_or_dash(joint.limits.effort),
            number_or_dash(joint.drive_gain.map(|drive| drive.gain_n_m_per_a)),
        );
    }
    let _ = writeln!(
        text,
        "\n{:>3} {:<24} {:>12}  {:<34} {:<34} verdict",
        "", "body", "mass, kg", "centre of mass, m", "principal inertias, kg m^2"
    );
    for index in 0..arm.tree.bodies() {
        let name = shortened(arm.body_name(index).unwrap_or_default());
        let body = arm.tree.body(index).filter(|_| arm.body_known(index));
        let _ = match body {
            None => writeln!(text, "{index:>3} {name:<24} {:>12}  {:<34} {:<34} not known", "-", "-", "-"),
            Some(body) => writeln!(text, "{index:>3} {name:<24} {}", numbers_of(body)),
        };
    }
    let _ = writeln!(text, "\ntotal mass of the bodies known: {:.7} kg", arm.tree.mass());
    let place = |frame: &ArmFrame| {
        let on = shortened(arm.body_name(frame.body).unwrap_or_default());
        format!("{} in `{on}`", vector(frame.body_from_frame.translation.vector.as_slice(), 6))
    };
    for frame in &arm.frames {
        let _ = writeln!(text, "`{}` is fixed at {}", shortened(&frame.name), place(frame));
    }
    let tool = arm.tool.as_ref().map_or_else(|| "none given".to_owned(), |tool| format!("at {}", place(tool)));
    let _ = writeln!(text, "tool: {tool}");
    text
}

/// Mass, centre of mass, inertia and whether there can be such a body.
fn numbers_of(body: &InertialParameters<f64>) -> String {
    let margin = body.consistency_margin();
    let verdict = match margin {
        margin if margin > 0.0 => format!("a body, margin {margin:.3}"),
        margin if margin >= 0.0 => "on the edge: a plate, a rod, a point or nothing".to_owned(),
        _ => format!("no body, margin {margin:.3}"),
    };
    let (com, inertia) = if body.mass == 0.0 {
        ("-".to_owned(), body.inertia_about_origin)
    } else {
        (vector(body.center_of_mass().as_slice(), 6), body.inertia_about_com())
    };
    let mut principal: Vec<f64> = inertia.symmetric_eigenvalues().iter().copied().collect();
    principal.sort_by(f64::total_cmp);
    format!("{:>12.7}  {com:<34} {:<34} {verdict}", body.mass, vector(&principal, 7))
}

fn vector(numbers: &[f64], digits: usize) -> String {
    let rounded = |number: &f64| {
        let text = format!("{number:.digits$}");
        // no zero with a sign
        match text.strip_prefix('-') {
            Some(zero) if !zero.contains(|c: char| ('1'..='9').contains(&c)) => zero.to_owned(),
            _ => text,
        }
    };
    format!("({})", numbers.iter().map(rounded).collect::<Vec<_>>().join(", "))
}

fn number_or_dash(number: Option<f64>) -> String {
    number.map_or_else(|| "-".to_owned(), |number| number.to_string())
}

/// A description as one line of it may stand before a table.
fn shortened_line(words: &str) -> String {
    tumble_formats::text_file::printable(words).replace('\n', " ")
}
