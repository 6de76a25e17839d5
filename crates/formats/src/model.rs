//! Models of robots as simulators read them, URDF and MJCF: what they say of the mass of every link, whether that can be, and the same
//! file with another body in one of its links.
//!
//! `docs/models.md` says what is looked at and what is not.

mod judgement;
mod mjcf;
mod patch;
mod solid;
mod urdf;
mod xml;

pub use judgement::{Finding, FindingKind, NearestBody, Severity, Verdict, judge};
pub use patch::Repaired;
pub use solid::{PlacedSolid, Solid};

use crate::FormatsError;
use crate::log::shortened;
use std::ops::Range;
use std::path::Path;
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
    text: String,
}

impl Model {
    /// From text: URDF where the root element is `<robot>`, MJCF where it is `<mujoco>`; `path` is its name in errors.
    ///
    /// ```
    /// use std::path::Path;
    /// use tumble_formats::model::{Model, judge};
    ///
    /// let text = r#"<robot name="one"><link name="plate"><inertial><mass value="2"/>
    ///   <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.3"/></inertial></link></robot>"#;
    /// let model = Model::parse(Path::new("one.urdf"), text)?;
    /// let verdicts = judge(&model);
    /// assert_eq!(verdicts[0].physical, Some(false));
    /// let repaired = model.repaired(&verdicts);
    /// assert_eq!(judge(&Model::parse(Path::new("one.urdf"), &repaired.text)?)[0].physical, Some(true));
    /// # Ok::<(), tumble_formats::FormatsError>(())
    /// ```
    /// # Errors
    /// [`FormatsError::BadModel`] with line and column.
    pub fn parse(path: &Path, text: &str) -> Result<Self, FormatsError> {
        xml::with_root(path, text, |root| match root.tag() {
            "robot" => urdf::read(root),
            "mujoco" => mjcf::read(root),
            other => {
                let message =
                    format!("`<{}>`: a URDF begins with `<robot>`, an MJCF with `<mujoco>`", shortened(other));
                Err(root.bad(&message))
            }
        })
    }

    /// The links that are on no other.
    fn roots(&self) -> impl Iterator<Item = usize> {
        self.links.iter().enumerate().filter(|(_, link)| link.parent.is_none()).map(|(index, _)| index)
    }

    /// Every link after the one it is on; links in a ring are left out.
    fn roots_first(&self) -> Vec<usize> {
        let mut children = vec![Vec::new(); self.links.len()];
        for (index, link) in self.links.iter().enumerate() {
            if let Some(list) = link.parent.and_then(|parent| children.get_mut(parent)) {
                list.push(index);
            }
        }
        let mut order: Vec<usize> = self.roots().collect();
        let mut next = 0;
        while let Some(&index) = order.get(next) {
            next += 1;
            order.append(&mut children[index]);
        }
        order
    }
}
