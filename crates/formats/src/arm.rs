//! Arms: trees of bodies and joints with the names, limits and drives that files give them.
//!
//! `docs/arms.md` describes the files.

mod assembly;
mod embedded;
mod model;
mod toml_file;
mod urdf;

pub use embedded::EMBEDDED;
pub use model::{ArmFrame, ArmJoint, ArmModel, BaseKind, DriveGain, JointLimits};

use crate::FormatsError;
use crate::log::shortened;
use crate::place::suggestion;
use crate::{Robots, text_file};
use std::path::Path;

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
}
