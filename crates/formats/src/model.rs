//! Models of robots as simulators read them, URDF and MJCF: what they say of the mass of every link, whether that can be, and the same
//! file with another body in one of its links.
//!
//! `docs/models.md` says what is looked at and what is not.

mod judgement;
mod links;
mod mjcf;
mod patch;
mod solid;
mod urdf;
mod xml;

pub use judgement::{Finding, FindingKind, NearestBody, Severity, Verdict, judge};
pub use links::{Inertial, Model, ModelKind, ModelLink};
pub use patch::Repaired;
pub use solid::{PlacedSolid, Solid};

use crate::FormatsError;
use crate::log::shortened;
use std::path::Path;

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
