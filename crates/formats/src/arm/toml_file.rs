//! The TOML format of arms.

use super::assembly::{Assembly, JointPart, Part, Source};
use super::model::{ArmFrame, ArmModel, BASE, BaseKind, DriveGain, JointLimits, written};
use crate::FormatsError;
use crate::Robots;
use crate::body_file::BodyFile;
use crate::log::{QUATERNION_NORM_TOLERANCE, shortened};
use crate::place;
use crate::toml_text;
use serde::{Deserialize, Serialize};
use std::path::Path;
use toml::Spanned;
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_dynamics::{InertialParameters, JointAxis};
use tumble_lie::{EulerZyx, Pose, from_xyzw};

/// The only version of the format.
const FORMAT: u32 = 1;

/// An arm as it is written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ArmFile {
    /// Version of the format: 1.
    format: Spanned<u32>,
    name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    description: Option<String>,
    base_kind: BaseKind,
    /// World axes, which are those of a fixed base.
    #[serde(skip_serializing_if = "Option::is_none")]
    gravity_m_s2: Option<Spanned<[f64; 3]>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    base: Option<Spanned<BaseTable>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tool: Option<Spanned<ToolTable>>,
    #[serde(default)]
    joint: Vec<JointTable>,
}

#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BaseTable {
    /// `base` unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    /// As in scenarios.
    #[serde(skip_serializing_if = "Option::is_none")]
    preset: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    body: Option<BodyFile>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ToolTable {
    link: String,
    #[serde(default)]
    position_m: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    rpy_rad: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    quaternion_xyzw: Option<[f64; 4]>,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum KindName {
    Revolute,
    Prismatic,
    Fixed,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct JointTable {
    name: Spanned<String>,
    /// That of the joint unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    link: Option<String>,
    parent: String,
    kind: KindName,
    #[serde(skip_serializing_if = "Option::is_none")]
    axis: Option<[f64; 3]>,
    #[serde(default)]
    position_m: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    rpy_rad: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    quaternion_xyzw: Option<[f64; 4]>,
    #[serde(default, skip_serializing_if = "is_zero")]
    stiffness: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    rest_position: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    damping: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    rotor_inertia: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    coulomb_friction: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    drive_gain_n_m_per_a: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    drive_gain_std_n_m_per_a: Option<f64>,
    #[serde(default, skip_serializing_if = "is_default")]
    limits: JointLimits,
    #[serde(skip_serializing_if = "Option::is_none")]
    body: Option<BodyFile>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn is_default(limits: &JointLimits) -> bool {
    *limits == JointLimits::default()
}

fn parameters(body: &BodyFile) -> InertialParameters<f64> {
    let inertia = Matrix3::from(body.inertia_about_com_kg_m2).transpose();
    InertialParameters::about_com(body.mass_kg, body.com_m.into(), inertia)
}

/// A pose in either way of writing its attitude.
fn pose(position_m: [f64; 3], rpy_rad: Option<[f64; 3]>, quaternion: Option<[f64; 4]>) -> Result<Pose<f64>, String> {
    if !position_m.iter().chain(rpy_rad.iter().flatten()).all(|number| number.is_finite()) {
        return Err("`position_m` and `rpy_rad` must be finite".to_owned());
    }
    let rotation = match (rpy_rad, quaternion) {
        (None, None) => return Ok(Pose::translation(position_m[0], position_m[1], position_m[2])),
        (Some([roll, pitch, yaw]), None) => EulerZyx::new(roll, pitch, yaw).to_rotation(),
        (None, Some([x, y, z, w])) => from_xyzw(x, y, z, w, QUATERNION_NORM_TOLERANCE)
            .map_err(|_| "`quaternion_xyzw` must be x, y, z, w of norm 1".to_owned())?,
        (Some(_), Some(_)) => {
            return Err("`rpy_rad` and `quaternion_xyzw` both are an attitude: one of them".to_owned());
        }
    };
    Ok(Pose::from_parts(Vector3::from(position_m).into(), rotation))
}

/// Reads an arm.
///
/// # Errors
/// Those of [`ArmModel::parse`].
pub(super) fn parse(path: &Path, text: &str, robots: &Robots) -> Result<ArmModel, FormatsError> {
    let source = Source { path, text };
    let file: ArmFile =
        toml_text::read(text).map_err(|error| source.bad(error.offset(), &place::with_suggestion(&error.message())))?;
    if *file.format.get_ref() != FORMAT {
        let message = format!("`format` is {}, this program reads {FORMAT}", file.format.get_ref());
        return Err(source.bad(file.format.span().start, &message));
    }
    let gravity_world_m_s2 = match &file.gravity_m_s2 {
        None => file.base_kind.usual_gravity(),
        Some(gravity) if gravity.get_ref().iter().all(|number| number.is_finite()) => Vector3::from(*gravity.get_ref()),
        Some(gravity) => return Err(source.bad(gravity.span().start, "`gravity_m_s2` is not finite")),
    };
    let base = base(&source, file.base, robots)?;
    let tool = file.tool.map(|table| tool(&source, table)).transpose()?;
    let joints = file.joint.into_iter().map(|table| joint(&source, table)).collect::<Result<_, _>>()?;
    let ArmFile { name, description, base_kind, .. } = file;
    let warnings = Vec::new();
    Assembly { source, name, description, base_kind, gravity_world_m_s2, base, joints, tool, warnings }.build()
}

fn base(source: &Source, table: Option<Spanned<BaseTable>>, robots: &Robots) -> Result<Part, FormatsError> {
    let offset = table.as_ref().map_or(0, |table| table.span().start);
    let BaseTable { name, preset, body } = table.map(Spanned::into_inner).unwrap_or_default();
    let body = match (preset, body) {
        (None, body) => body.as_ref().map(parameters),
        (Some(_), Some(_)) => return Err(source.bad(offset, "base: `preset` and `body` both are a body: one of them")),
        (Some(preset), None) => Some(
            robots
                .body(&preset)
                .map_err(|unknown| source.bad(offset, &format!("base: `preset` {}", unknown.none_of())))?,
        ),
    };
    Ok(Part { offset, link: name.unwrap_or_else(|| BASE.to_owned()), body })
}

/// Where the tool's table stands, the link it is on and where it is there.
fn tool(source: &Source, table: Spanned<ToolTable>) -> Result<(usize, String, Pose<f64>), FormatsError> {
    let offset = table.span().start;
    let ToolTable { link, position_m, rpy_rad, quaternion_xyzw } = table.into_inner();
    let pose = pose(position_m, rpy_rad, quaternion_xyzw);
    let link_from_tool = pose.map_err(|message| source.bad(offset, &format!("tool: {message}")))?;
    Ok((offset, link, link_from_tool))
}

fn joint(source: &Source, table: JointTable) -> Result<JointPart, FormatsError> {
    let offset = table.name.span().start;
    let name = table.name.into_inner();
    let bad = |message: &str| source.bad(offset, &format!("joint `{}`: {message}", shortened(&name)));
    let (kind, axis) = match (table.kind, table.axis) {
        (KindName::Revolute, Some(axis)) => (Some(JointAxis::Revolute), axis),
        (KindName::Prismatic, Some(axis)) => (Some(JointAxis::Prismatic), axis),
        (KindName::Fixed, None) => (None, [0.0; 3]),
        (KindName::Fixed, Some(_)) => return Err(bad("a fixed joint has no `axis`")),
        (_, None) => return Err(bad("`axis` is missing")),
    };
    let drive_gain = match (table.drive_gain_n_m_per_a, table.drive_gain_std_n_m_per_a) {
        (None, None) => None,
        (Some(gain_n_m_per_a), std_n_m_per_a) => Some(DriveGain { gain_n_m_per_a, std_n_m_per_a }),
        (None, Some(_)) => return Err(bad("`drive_gain_std_n_m_per_a` without `drive_gain_n_m_per_a`")),
    };
    let parent_from_link =
        pose(table.position_m, table.rpy_rad, table.quaternion_xyzw).map_err(|message| bad(&message))?;
    let body = table.body.as_ref().map(parameters);
    Ok(JointPart {
        offset,
        parent: table.parent,
        kind,
        axis: axis.into(),
        parent_from_link,
        stiffness: table.stiffness,
        rest_position: table.rest_position,
        damping: table.damping,
        rotor_inertia: table.rotor_inertia,
        coulomb_friction: table.coulomb_friction,
        limits: table.limits,
        drive_gain,
        carried: Part { offset, link: table.link.unwrap_or_else(|| name.clone()), body },
        name,
    })
}

/// Position and attitude as the file has them; no attitude where there is no turn.
fn written_pose(pose: &Pose<f64>) -> ([f64; 3], Option<[f64; 4]>) {
    let turned = pose.rotation != tumble_dynamics::nalgebra::UnitQuaternion::identity();
    (pose.translation.vector.into(), turned.then(|| pose.rotation.coords.into()))
}

fn spanned<T>(value: T) -> Spanned<T> {
    Spanned::new(0..0, value)
}

/// The text of an arm.
///
/// # Errors
/// [`FormatsError::BadToml`].
pub(super) fn write(arm: &ArmModel) -> Result<String, FormatsError> {
    let moving = arm.joints.iter().zip(arm.tree.links()).map(|(described, link)| {
        let (position_m, quaternion_xyzw) = written_pose(link.joint.parent_from_link());
        JointTable {
            name: spanned(described.name.clone()),
            link: (described.link != described.name).then(|| described.link.clone()),
            parent: arm.body_name(link.parent.map_or(0, |parent| parent + 1)).unwrap_or(BASE).to_owned(),
            kind: match link.joint.kind() {
                JointAxis::Revolute => KindName::Revolute,
                JointAxis::Prismatic => KindName::Prismatic,
            },
            axis: Some((*link.joint.axis()).into()),
            position_m,
            rpy_rad: None,
            quaternion_xyzw,
            stiffness: link.joint.stiffness,
            rest_position: link.joint.rest_position,
            damping: link.joint.damping,
            rotor_inertia: link.joint.rotor_inertia,
            coulomb_friction: described.coulomb_friction,
            drive_gain_n_m_per_a: described.drive_gain.map(|drive| drive.gain_n_m_per_a),
            drive_gain_std_n_m_per_a: described.drive_gain.and_then(|drive| drive.std_n_m_per_a),
            limits: described.limits,
            body: described.body_known.then(|| written(&link.body)),
        }
    });
    let fixed = arm.frames.iter().map(|frame| fixed_joint(arm, frame));
    let file = ArmFile {
        format: spanned(FORMAT),
        name: arm.name.clone(),
        description: arm.description.clone(),
        base_kind: arm.base_kind,
        gravity_m_s2: Some(spanned(arm.gravity_world_m_s2.into())),
        base: Some(spanned(BaseTable {
            name: Some(arm.base_name.clone()),
            preset: None,
            body: arm.base_known.then(|| written(arm.tree.base())),
        })),
        tool: arm.tool.as_ref().map(|tool| {
            let (position_m, quaternion_xyzw) = written_pose(&tool.body_from_frame);
            let link = arm.body_name(tool.body).unwrap_or(BASE).to_owned();
            spanned(ToolTable { link, position_m, rpy_rad: None, quaternion_xyzw })
        }),
        joint: moving.chain(fixed).collect(),
    };
    toml::to_string(&file)
        .map_err(|error| FormatsError::BadToml { path: arm.name.clone().into(), message: error.to_string() })
}

/// A frame as a joint that carries nothing; its name need only differ from those of the joints.
fn fixed_joint(arm: &ArmModel, frame: &ArmFrame) -> JointTable {
    let (position_m, quaternion_xyzw) = written_pose(&frame.body_from_frame);
    JointTable {
        name: spanned(arm.name_of_fixed_joint(frame)),
        link: Some(frame.name.clone()),
        parent: arm.body_name(frame.body).unwrap_or(BASE).to_owned(),
        kind: KindName::Fixed,
        axis: None,
        position_m,
        rpy_rad: None,
        quaternion_xyzw,
        stiffness: 0.0,
        rest_position: 0.0,
        damping: 0.0,
        rotor_inertia: 0.0,
        coulomb_friction: None,
        drive_gain_n_m_per_a: None,
        drive_gain_std_n_m_per_a: None,
        limits: JointLimits::default(),
        body: None,
    }
}
