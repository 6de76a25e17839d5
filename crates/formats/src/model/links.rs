//! What a model says of its links.

use super::solid::PlacedSolid;
use std::ops::Range;
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_lie::Pose;

/// The language of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ModelKind {
    /// `<robot>`: ROS, Gazebo, most arms.
    Urdf,
    /// `<mujoco>`.
    Mjcf,
}

impl ModelKind {
    /// Its name, in small letters.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Urdf => "urdf",
            Self::Mjcf => "mjcf",
        }
    }
}

/// How a file writes an inertia tensor.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Written {
    /// Six attributes of `<inertia>`, with the bytes of their values in the order xx, xy, xz, yy, yz, zz.
    Named([Range<usize>; 6]),
    /// `fullinertia` with the bytes of its value: xx, yy, zz, xy, xz, yz.
    Full(Range<usize>),
    /// `diaginertia` with the bytes of its value.
    Diagonal(Range<usize>),
}

/// What a file says of the mass of a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Inertial {
    /// Mass, kg.
    pub mass: f64,
    /// The frame in which the tensor is written, its origin in the centre of mass.
    pub link_from_inertial: Pose<f64>,
    /// About the centre of mass, axes of that frame, kg m^2.
    pub inertia: Matrix3<f64>,
    /// Half a unit of the last digit written, over all entries (Frobenius norm), kg m^2.
    pub rounding: f64,
    pub(super) written: Written,
    /// Bytes of the element.
    pub(super) range: Range<usize>,
    /// Another reading of the turn of the frame, and what it is called.
    pub(super) other_turn: Option<(UnitQuaternion<f64>, &'static str)>,
}

impl Inertial {
    /// The ten numbers, link frame; whether such a body can be is another question.
    pub fn body(&self) -> InertialParameters<f64> {
        InertialParameters::about_com(self.mass, Vector3::zeros(), self.inertia)
            .transformed_by(&self.link_from_inertial)
    }

    /// Centre of mass, link frame, m.
    pub fn center_of_mass(&self) -> Vector3<f64> {
        self.link_from_inertial.translation.vector
    }

    /// A tensor written in the axes of the inertial frame, in those of the link.
    pub fn in_link_axes(&self, inertia: &Matrix3<f64>) -> Matrix3<f64> {
        let rotation = self.link_from_inertial.rotation.to_rotation_matrix();
        rotation * inertia * rotation.transpose()
    }
}

/// One link (URDF) or body (MJCF).
#[derive(Clone, Debug, PartialEq)]
pub struct ModelLink {
    /// Its name, or where it stands if it has none.
    pub name: String,
    /// Line of its first character, from one.
    pub line: usize,
    /// The link that it is on; `None` for a root, or what is fixed to the world.
    pub parent: Option<usize>,
    /// Whether it can move against what it is on.
    pub moves: bool,
    /// Where it is on the other, m: how far apart their origins are.
    pub offset_m: f64,
    /// What is said of its mass.
    pub inertial: Option<Inertial>,
    /// What it collides with; `None` where something of it (a mesh) is not known.
    pub collision: Option<Vec<PlacedSolid>>,
    /// What is seen of it; as above.
    pub visual: Option<Vec<PlacedSolid>>,
    /// Bytes of the element.
    pub(super) range: Range<usize>,
    /// Bytes of the name of its element.
    pub(super) tag: Range<usize>,
}

/// A model: every link with what the file says of its mass and its shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Its language.
    pub kind: ModelKind,
    /// Its name.
    pub name: String,
    /// In the order of the file.
    pub links: Vec<ModelLink>,
    /// What holds for the whole file, and what of it is not read.
    pub notes: Vec<String>,
    /// Whether what `<inertial>` says is overridden by what follows from the shapes (`inertiafromgeom="true"`).
    pub from_shapes: bool,
    /// Whether the simulator itself replaces an inertia that cannot be (`balanceinertia="true"`).
    pub balanced: bool,
    pub(super) text: String,
}
