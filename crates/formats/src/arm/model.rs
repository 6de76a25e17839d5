//! What files say of an arm.

use crate::body_file::{BodyFile, rows};
use serde::{Deserialize, Serialize};
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{InertialParameters, Multibody};
use tumble_identification::multibody::JointRange;
use tumble_lie::Pose;

/// What files may call the base, whatever its name.
pub(super) const BASE: &str = "base";

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

impl JointLimits {
    /// What a motion may use: half a turn either way (or that many metres) where no position is limited; `None` without a limit of
    /// the rate.
    pub fn range(&self) -> Option<JointRange> {
        let half_turn = std::f64::consts::PI;
        let (lower, upper) = (self.lower.unwrap_or(-half_turn), self.upper.unwrap_or(half_turn));
        self.rate.map(|rate| JointRange { lower, upper, rate, acceleration: f64::INFINITY })
    }
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
    pub(super) fn name_of_fixed_joint(&self, frame: &ArmFrame) -> String {
        let mut name = format!("{}_fixed", frame.name);
        while self.joints.iter().any(|joint| joint.name == name) {
            name.push('_');
        }
        name
    }
}

/// A body as files write it; a massless one has its centre of mass in the origin.
pub(super) fn written(body: &InertialParameters<f64>) -> BodyFile {
    if body.mass == 0.0 {
        return BodyFile { mass_kg: 0.0, com_m: [0.0; 3], inertia_about_com_kg_m2: rows(&body.inertia_about_origin) };
    }
    BodyFile::from(body)
}
