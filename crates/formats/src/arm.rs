//! Arms: trees of bodies and joints with the names, limits and drives that files give them.
//!
//! `docs/arms.md` describes the files.

mod assembly;
mod embedded;
mod toml_file;
mod urdf;

pub use embedded::EMBEDDED;

use crate::FormatsError;
use crate::body_file::{BodyFile, rows};
use crate::log::shortened;
use crate::place::suggestion;
use crate::{Robots, text_file};
use serde::{Deserialize, Serialize};
use std::path::Path;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{InertialParameters, Multibody};
use tumble_identification::multibody::JointRange;
use tumble_lie::Pose;

/// Whether the base is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BaseKind {
    /// It moves as the joints and a wrench on it make it.
    Free,
    /// It stands still.
    Fixed,
}

impl BaseKind {
    /// As files write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Free => "free",
            Self::Fixed => "fixed",
        }
    }

    /// What pulls where a file does not say: nothing on a free base, standard gravity along -z on a fixed one, m/s^2.
    pub fn usual_gravity(self) -> Vector3<f64> {
        match self {
            Self::Free => Vector3::zeros(),
            Self::Fixed => Vector3::new(0.0, 0.0, -9.80665),
        }
    }
}

/// What a joint keeps within; `None` where nothing is known. For information: nothing here holds a joint back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointLimits {
    /// Least position, rad or m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lower: Option<f64>,
    /// Largest position, rad or m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upper: Option<f64>,
    /// Largest rate either way, rad/s or m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
    /// Largest torque or force either way, N m or N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub effort: Option<f64>,
}

/// Torque of a joint per motor current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveGain {
    /// N m/A, or N/A for a slide.
    pub gain_n_m_per_a: f64,
    /// Its standard deviation, where it is known.
    pub std_n_m_per_a: Option<f64>,
}

/// What files say of a joint and its link beside the numbers in the tree.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmJoint {
    /// Name of the joint.
    pub name: String,
    /// Name of the link that it carries.
    pub link: String,
    /// Whether the file gives the link a body; where not, its ten parameters are zero.
    pub body_known: bool,
    /// What it keeps within.
    pub limits: JointLimits,
    /// Coulomb friction, N m or N. For information: the tree has none.
    pub coulomb_friction: Option<f64>,
    /// Torque per current.
    pub drive_gain: Option<DriveGain>,
}

impl JointLimits {
    /// What a motion may use: half a turn either way (or that many metres) where no position is limited; `None` without a limit of
    /// the rate.
    pub fn range(&self) -> Option<JointRange> {
        let half_turn = std::f64::consts::PI;
        let (lower, upper) = (self.lower.unwrap_or(-half_turn), self.upper.unwrap_or(half_turn));
        self.rate.map(|rate| JointRange { lower, upper, rate, acceleration: f64::INFINITY })
    }
}

/// A frame fixed to a body of the tree.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmFrame {
    /// Its name.
    pub name: String,
    /// The body it is fixed to; 0 is the base, `i + 1` link `i`.
    pub body: usize,
    /// Where it is there.
    pub body_from_frame: Pose<f64>,
}

/// An arm on a base.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmModel {
    /// Its name.
    pub name: String,
    /// One line for people.
    pub description: Option<String>,
    /// Bodies and joints.
    pub tree: Multibody<f64>,
    /// Whether the base is held.
    pub base_kind: BaseKind,
    /// Name of the base.
    pub base_name: String,
    /// Whether the file gives the base a body; where not, its ten parameters are zero.
    pub base_known: bool,
    /// World axes, which are those of a fixed base, m/s^2.
    pub gravity_world_m_s2: Vector3<f64>,
    /// One for each joint of the tree.
    pub joints: Vec<ArmJoint>,
    /// Where a payload is grasped.
    pub tool: Option<ArmFrame>,
    /// Links on fixed joints: their bodies are part of the body that they are fixed to.
    pub frames: Vec<ArmFrame>,
    /// What a user should know about the file.
    pub warnings: Vec<String>,
}

impl ArmModel {
    /// A file of this name, TOML or URDF, or else an arm that comes with one of the robots or with none.
    ///
    /// # Errors
    /// [`FormatsError::NoSuchArm`], [`FormatsError::Unreadable`], and as [`ArmModel::parse`].
    pub fn find(name: &str, robots: &Robots) -> Result<Self, FormatsError> {
        let path = Path::new(name);
        let arms = robots.arms();
        let embedded = arms.iter().find(|embedded| embedded.name == name);
        // a folder of that name hides nothing
        if !path.exists() || (path.is_dir() && embedded.is_some()) {
            return match embedded {
                Some(embedded) => Self::parse(path, embedded.text, robots),
                None => Err(FormatsError::NoSuchArm {
                    name: shortened(name),
                    nearest: suggestion(name, arms.iter().map(|embedded| embedded.name)),
                }),
            };
        }
        let text = text_file::read(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?;
        Self::parse(path, &text, robots)
    }

    /// From text: URDF where it begins with `<`, else TOML; `path` is its name in errors, and its base may be a body of one of the robots.
    ///
    /// # Errors
    /// [`FormatsError::BadArm`], [`FormatsError::ArmStructure`], [`FormatsError::ArmJointKind`],
    /// [`FormatsError::ArmBody`], each with line and column.
    pub fn parse(path: &Path, text: &str, robots: &Robots) -> Result<Self, FormatsError> {
        let text = text.trim_start_matches('\u{feff}');
        if text.trim_start().starts_with('<') { urdf::parse(path, text) } else { toml_file::parse(path, text, robots) }
    }

    /// The model as a TOML file that gives it again.
    ///
    /// # Errors
    /// [`FormatsError::BadToml`].
    pub fn to_toml(&self) -> Result<String, FormatsError> {
        toml_file::write(self)
    }

    /// The model as URDF. Springs, rotors, drives, gravity and the kind of base have no place there.
    pub fn to_urdf(&self) -> String {
        urdf::write(self)
    }

    /// Name of body `index`: 0 is the base, `i + 1` link `i`.
    pub fn body_name(&self, index: usize) -> Option<&str> {
        match index.checked_sub(1) {
            None => Some(&self.base_name),
            Some(link) => self.joints.get(link).map(|joint| joint.link.as_str()),
        }
    }

    /// Whether the file says anything of body `index`.
    pub fn body_known(&self, index: usize) -> bool {
        match index.checked_sub(1) {
            None => self.base_known,
            Some(link) => self.joints.get(link).is_some_and(|joint| joint.body_known),
        }
    }

    /// The frame of a link of this name, one on a fixed joint included; `base` is the base.
    pub fn frame(&self, name: &str) -> Option<ArmFrame> {
        let of_body = |body| ArmFrame { name: name.to_owned(), body, body_from_frame: Pose::identity() };
        let body = (0..self.tree.bodies()).find(|body| self.body_name(*body) == Some(name));
        let fixed = || self.frames.iter().find(|frame| frame.name == name).cloned();
        body.map(of_body).or_else(fixed).or_else(|| (name == BASE).then(|| of_body(0)))
    }

    /// A name for the joint of a frame that no joint that moves has.
    fn name_of_fixed_joint(&self, frame: &ArmFrame) -> String {
        let mut name = format!("{}_fixed", frame.name);
        while self.joints.iter().any(|joint| joint.name == name) {
            name.push('_');
        }
        name
    }
}

/// What files may call the base, whatever its name.
const BASE: &str = "base";

/// A body as files write it; a massless one has its centre of mass in the origin.
fn written(body: &InertialParameters<f64>) -> BodyFile {
    if body.mass == 0.0 {
        return BodyFile { mass_kg: 0.0, com_m: [0.0; 3], inertia_about_com_kg_m2: rows(&body.inertia_about_origin) };
    }
    BodyFile::from(body)
}
