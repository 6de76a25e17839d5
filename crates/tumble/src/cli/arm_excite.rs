//! `tumble arm excite`: a motion of an arm's joints that shows its bodies or its payload.

use super::{Outcome, print};
use crate::TumbleError;
use crate::output::write_file;
use clap::Args;
use std::fmt::Write as _;
use std::path::PathBuf;
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_formats::Robots;
use tumble_formats::arm::{ArmModel, BaseKind};
use tumble_identification::multibody::{ExcitedBase, JointExcitation, JointMotion, TreePart, VelocityNoise};
use tumble_lie::Wrench;

/// Rows of the table of the motion, per second.
const ROWS_PER_SECOND: f64 = 50.0;

/// Options of `tumble arm excite`.
#[derive(Args)]
pub struct ExciteOptions {
    /// Name of an embedded arm, or a TOML or URDF file; its limits are kept.
    name: String,
    /// Length of a period, s.
    #[arg(long, value_name = "S", default_value_t = 60.0)]
    duration: f64,
    /// Harmonics of the period.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=20))]
    harmonics: u16,
    /// Seed of the search.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Motions tried.
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(..=100_000))]
    trials: u32,
    /// Write the motion as CSV: t_s, positions, rates and accelerations of the joints.
    #[arg(long, value_name = "FILE")]
    export: Option<PathBuf>,
    /// Replace a file that exists.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for an arm that is none, or one without the limits that a motion needs.
pub fn run(options: &ExciteOptions, robots: &Robots) -> Result<Outcome, TumbleError> {
    let refused = |message: String| TumbleError::BadOption { message };
    if !(options.duration > 0.0 && options.duration <= 3600.0) {
        return Err(refused(format!("`--duration {}`: a period lies between 0 and 3600 s", options.duration)));
    }
    if let Some(path) = options.export.as_ref().filter(|path| path.exists() && !options.force) {
        return Err(TumbleError::OutputExists { path: path.clone() });
    }
    let arm = ArmModel::find(&options.name, robots)?;
    let range = |joint: &tumble_formats::arm::ArmJoint| {
        joint.limits.range().ok_or_else(|| {
            refused(format!("joint `{}` of `{}` has no limit of its rate: state `limits.rate`", joint.name, arm.name))
        })
    };
    let ranges = arm.joints.iter().map(range).collect::<Result<Vec<_>, TumbleError>>()?;
    let rough = |kg: f64, size_m: f64| {
        InertialParameters::about_com(kg, Vector3::zeros(), Matrix3::identity() * (kg * size_m * size_m))
    };
    let unknown = (1..arm.tree.bodies()).filter(|body| !arm.body_known(*body));
    let mut parts: Vec<TreePart> =
        unknown.map(|body| TreePart::whole(arm.body_name(body).unwrap_or_default(), body, rough(3.0, 0.2))).collect();
    if parts.is_empty() {
        let tool = arm.tool.clone().ok_or_else(|| {
            refused(format!(
                "the model of `{}` knows all bodies and has no tool for a payload: nothing to show",
                arm.name
            ))
        })?;
        parts.push(TreePart::payload("payload", tool.body, tool.body_from_frame, rough(1.0, 0.1)));
    }
    let shown = parts.iter().map(|part| part.name.as_str()).collect::<Vec<_>>().join(", ");
    let (base, equations) = match arm.base_kind {
        BaseKind::Fixed => (ExcitedBase::Fixed(arm.gravity_world_m_s2), "torques"),
        BaseKind::Free => {
            let noise = VelocityNoise { base_rate_rad_s: 1e-3, base_velocity_m_s: 1e-3, joint_rate: 1e-4 };
            (ExcitedBase::Floating(Wrench::zero(), noise), "momentum, floating from rest")
        }
    };
    let problem = JointExcitation {
        tree: arm.tree.clone(),
        parts,
        ranges,
        base,
        period_s: options.duration,
        harmonics: usize::from(options.harmonics),
    };
    let design = problem.design(options.trials as usize, options.seed)?;
    let mut text = String::new();
    let random = &design.condition_of_random;
    let best = random.iter().copied().fold(f64::INFINITY, f64::min);
    let _ =
        writeln!(text, "{}: {shown} by {equations}, {} s, {} harmonics", arm.name, options.duration, options.harmonics);
    let _ = writeln!(text, "base parameters shown        {}", design.rank);
    let _ = writeln!(
        text,
        "condition number             {:.1} (best of {} random motions {best:.1})",
        design.condition_number,
        random.len()
    );
    let _ =
        writeln!(text, "standard deviations          {:.2} times smaller than of the best random motion", design.gain);
    for (joint, range) in arm.joints.iter().zip(&problem.ranges) {
        let index = arm.joints.iter().position(|other| other.name == joint.name).unwrap_or(0);
        let (lower, upper, rate) = extremes(&design.motion, index);
        let _ = writeln!(
            text,
            "{:<28} {lower:.3} to {upper:.3} of {:.3} to {:.3}, rate {rate:.3} of {:.3}",
            joint.name, range.lower, range.upper, range.rate
        );
    }
    print(&text)?;
    if let Some(path) = &options.export {
        write_file(path, table(&design.motion, arm.joints.len()).as_bytes(), options.force)?;
        tell_line!("written: {}", path.display());
    }
    Ok(Outcome::Achieved)
}

/// Smallest and largest position and the largest rate of a period, at a thousand instants.
fn extremes(motion: &JointMotion, joint: usize) -> (f64, f64, f64) {
    let at = |k: u32| motion.at(joint, motion.period_s * f64::from(k) / 1000.0);
    (0..1000).map(at).fold((f64::INFINITY, f64::NEG_INFINITY, 0.0), |(low, high, rate), [q, w, _]| {
        (low.min(q), high.max(q), f64::max(rate, w.abs()))
    })
}

fn table(motion: &JointMotion, joints: usize) -> String {
    let mut text = "t_s".to_owned();
    for name in ["q", "qd", "qdd"] {
        (1..=joints).for_each(|joint| {
            let _ = write!(text, ",{name}{joint}");
        });
    }
    text.push('\n');
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 180 000 rows")]
    let rows = (motion.period_s * ROWS_PER_SECOND).ceil() as u32;
    for row in 0..=rows {
        let time_s = motion.period_s * f64::from(row) / f64::from(rows);
        let _ = write!(text, "{time_s:.6}");
        for k in 0..3 {
            for joint in 0..joints {
                let _ = write!(text, ",{}", motion.at(joint, time_s)[k]);
            }
        }
        text.push('\n');
    }
    text
}
