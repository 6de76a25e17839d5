//! From named parts in any order to a tree, whatever file they stood in.

use super::model::{ArmFrame, ArmJoint, ArmModel, BASE, BaseKind, DriveGain, JointLimits};
use crate::FormatsError;
use crate::log::shortened;
use crate::place::{self, suggestion};
use crate::text_file::printable;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::Path;
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_dynamics::{DynamicsError, InertialParameters, Joint, JointAxis, Link, Multibody};
use tumble_lie::Pose;

/// A file whose errors name line and column.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub path: &'a Path,
    pub text: &'a str,
}

impl Source<'_> {
    /// That a file does not parse, or says something impossible at this byte.
    pub fn bad(&self, offset: usize, message: &str) -> FormatsError {
        let (line, column) = place::of_offset(self.text, offset);
        FormatsError::BadArm { path: self.path.into(), line, column, message: one_line(message) }
    }

    /// That links and joints make no tree.
    pub fn structure(&self, offset: usize, message: &str) -> FormatsError {
        let (line, column) = place::of_offset(self.text, offset);
        FormatsError::ArmStructure { path: self.path.into(), line, column, message: one_line(message) }
    }

    /// That no body is as a link is said to be.
    fn body(&self, offset: usize, link: &str, source: DynamicsError) -> FormatsError {
        let (line, column) = place::of_offset(self.text, offset);
        FormatsError::ArmBody { path: self.path.into(), line, column, link: shortened(link), source }
    }
}

fn one_line(message: &str) -> String {
    printable(message).replace('\n', " ")
}

/// The base, or the link that a joint carries.
pub(super) struct Part {
    /// Where it stands in the text, bytes.
    pub offset: usize,
    /// Name of the link.
    pub link: String,
    /// Its body, link frame; `None` where the file says nothing of it.
    pub body: Option<InertialParameters<f64>>,
}

/// A joint, and the link that it carries.
pub(super) struct JointPart {
    /// Where it stands in the text, bytes.
    pub offset: usize,
    pub name: String,
    /// Name of a link or joint.
    pub parent: String,
    /// Fixed where it is `None`.
    pub kind: Option<JointAxis>,
    /// Link axes.
    pub axis: Vector3<f64>,
    pub parent_from_link: Pose<f64>,
    pub stiffness: f64,
    pub rest_position: f64,
    pub damping: f64,
    pub rotor_inertia: f64,
    pub coulomb_friction: Option<f64>,
    pub limits: JointLimits,
    pub drive_gain: Option<DriveGain>,
    pub carried: Part,
}

/// What a file says, in the order in which it says it.
pub(super) struct Assembly<'a> {
    pub source: Source<'a>,
    pub name: String,
    pub description: Option<String>,
    pub base_kind: BaseKind,
    pub gravity_world_m_s2: Vector3<f64>,
    pub base: Part,
    pub joints: Vec<JointPart>,
    /// Where it stands, the link it is on and where it is there.
    pub tool: Option<(usize, String, Pose<f64>)>,
    pub warnings: Vec<String>,
}

/// The body of the tree that a link belongs to, and where the link is in it.
#[derive(Clone, Copy)]
struct Host {
    body: usize,
    body_from_link: Pose<f64>,
}

impl Assembly<'_> {
    /// The model.
    ///
    /// # Errors
    /// Those of [`ArmModel::parse`].
    pub fn build(self) -> Result<ArmModel, FormatsError> {
        let source = self.source;
        self.check_names()?;
        let parents = self.parents()?;
        let mut bodies = vec![self.checked(&self.base)?];
        let mut hosts: Vec<Option<Host>> = vec![None; self.joints.len()];
        let (mut joints, mut frames, mut links) = (Vec::new(), Vec::new(), Vec::new());
        let on_base = Host { body: 0, body_from_link: Pose::identity() };
        for (index, parent) in self.parents_first(&parents)? {
            let Some(part) = self.joints.get(index) else { continue };
            let parent = parent.map_or(Some(on_base), |parent| hosts.get(parent).copied().flatten()).unwrap_or(on_base);
            let origin = parent.body_from_link * part.parent_from_link;
            if !is_finite(&origin) {
                let message = format!("joint `{}`: its origin is not finite", shortened(&part.name));
                return Err(source.bad(part.offset, &message));
            }
            let body = self.checked(&part.carried)?;
            let host = if let Some(kind) = part.kind {
                bodies.push(body);
                links.push((parent.body, part.joint(&source, kind, origin)?));
                joints.push(part.described());
                Host { body: links.len(), body_from_link: Pose::identity() }
            } else {
                let host = Host { body: parent.body, body_from_link: origin };
                let name = part.carried.link.clone();
                frames.push(ArmFrame { name, body: host.body, body_from_frame: origin });
                if let (Some(of_host), Some(body)) = (bodies.get_mut(host.body), body) {
                    let sum = of_host.unwrap_or_else(massless) + body.transformed_by(&origin);
                    if !sum.to_vector().iter().all(|number| number.is_finite()) {
                        return Err(source.body(part.carried.offset, &part.carried.link, DynamicsError::NotFinite));
                    }
                    *of_host = Some(sum);
                }
                host
            };
            if let Some(slot) = hosts.get_mut(index) {
                *slot = Some(host);
            }
        }
        if links.is_empty() {
            return Err(source.structure(self.base.offset, "no joint that moves"));
        }
        let base_known = bodies.first().is_some_and(Option::is_some);
        for (joint, body) in joints.iter_mut().zip(bodies.iter().skip(1)) {
            joint.body_known = body.is_some();
        }
        let mut bodies = bodies.into_iter().map(|body| body.unwrap_or_else(massless));
        let base = bodies.next().unwrap_or_else(massless);
        let links = links
            .into_iter()
            .zip(bodies)
            .map(|((parent, joint), body)| Link { parent: parent.checked_sub(1), joint, body })
            .collect();
        let tree = Multibody::try_new(base, links).map_err(|error| source.structure(0, &error.to_string()))?;
        let mut model = ArmModel {
            name: self.name,
            description: self.description,
            tree,
            base_kind: self.base_kind,
            base_name: self.base.link,
            base_known,
            gravity_world_m_s2: self.gravity_world_m_s2,
            joints,
            tool: None,
            frames,
            warnings: self.warnings,
        };
        if let Some((offset, link, link_from_tool)) = self.tool {
            let on = model.frame(&link).ok_or_else(|| {
                let names = (0..model.tree.bodies()).filter_map(|body| model.body_name(body));
                let near = suggestion(&link, names.chain(model.frames.iter().map(|frame| frame.name.as_str())));
                source.structure(offset, &format!("the tool is on `{}`, which is no link{near}", shortened(&link)))
            })?;
            let body_from_frame = on.body_from_frame * link_from_tool;
            if !is_finite(&body_from_frame) {
                return Err(source.bad(offset, "tool: it is too far away"));
            }
            model.tool = Some(ArmFrame { body_from_frame, ..on });
        }
        Ok(model)
    }

    /// The body of a link, if there can be one.
    fn checked(&self, part: &Part) -> Result<Option<InertialParameters<f64>>, FormatsError> {
        let checked = part.body.map(InertialParameters::validated).transpose();
        checked.map_err(|source| self.source.body(part.offset, &part.link, source))
    }

    /// An error unless every name can be printed.
    fn check_names(&self) -> Result<(), FormatsError> {
        let of_joints = self
            .joints
            .iter()
            .flat_map(|part| [&part.name, &part.carried.link].map(|name| (name, part.carried.offset)));
        let mut names = [(&self.name, 0), (&self.base.link, self.base.offset)].into_iter().chain(of_joints);
        match names.find(|(name, _)| name.trim().is_empty() || name.chars().any(char::is_control)) {
            Some((name, offset)) => Err(self.source.structure(offset, &format!("`{}` is no name", shortened(name)))),
            None => Ok(()),
        }
    }

    /// What each joint is on: another joint's link, or the base.
    fn parents(&self) -> Result<Vec<Option<usize>>, FormatsError> {
        let mut links = HashMap::from([(self.base.link.as_str(), None)]);
        for (index, part) in self.joints.iter().enumerate() {
            if links.insert(part.carried.link.as_str(), Some(index)).is_some() {
                let message = format!("two links are called `{}`", shortened(&part.carried.link));
                return Err(self.source.structure(part.carried.offset, &message));
            }
        }
        let mut joints = HashMap::new();
        for (index, part) in self.joints.iter().enumerate() {
            if joints.insert(part.name.as_str(), Some(index)).is_some() {
                let message = format!("two joints are called `{}`", shortened(&part.name));
                return Err(self.source.structure(part.offset, &message));
            }
        }
        let parent = |part: &JointPart| {
            let name = part.parent.as_str();
            let found = links.get(name).or_else(|| joints.get(name)).copied();
            found.or_else(|| (name == BASE).then_some(None)).ok_or_else(|| {
                let names = self.joints.iter().flat_map(|part| [part.carried.link.as_str(), part.name.as_str()]);
                let near = suggestion(name, names.chain([self.base.link.as_str(), BASE]));
                let (joint, name) = (shortened(&part.name), shortened(name));
                self.source.structure(part.offset, &format!("joint `{joint}` is on `{name}`, which is not there{near}"))
            })
        };
        self.joints.iter().map(parent).collect()
    }

    /// Joints and what they are on, parents first, else in the order of the file.
    fn parents_first(&self, parents: &[Option<usize>]) -> Result<Vec<(usize, Option<usize>)>, FormatsError> {
        let mut children = vec![Vec::new(); parents.len()];
        let mut ready = BTreeSet::new();
        for (index, parent) in parents.iter().enumerate() {
            match parent {
                Some(parent) => children.get_mut(*parent).into_iter().for_each(|list| list.push(index)),
                None => drop(ready.insert(index)),
            }
        }
        let mut order = Vec::with_capacity(parents.len());
        while let Some(index) = ready.pop_first() {
            order.push((index, parents.get(index).copied().flatten()));
            ready.extend(children.get(index).into_iter().flatten());
        }
        if order.len() < parents.len() {
            return Err(self.hangs_on_itself(parents, &order));
        }
        Ok(order)
    }

    /// The error that joints are in a ring, which all those lead to that are not in `order`.
    fn hangs_on_itself(&self, parents: &[Option<usize>], order: &[(usize, Option<usize>)]) -> FormatsError {
        let placed: HashSet<usize> = order.iter().map(|(index, _)| *index).collect();
        let mut passed = HashSet::new();
        let mut at = (0..parents.len()).find(|index| !placed.contains(index)).unwrap_or(0);
        while passed.insert(at) {
            at = parents.get(at).copied().flatten().unwrap_or(at);
        }
        let (name, offset) = self.joints.get(at).map_or(("", 0), |part| (part.name.as_str(), part.offset));
        self.source.structure(offset, &format!("joint `{}` hangs on itself", shortened(name)))
    }
}

fn is_finite(pose: &Pose<f64>) -> bool {
    pose.to_homogeneous().iter().all(|number| number.is_finite())
}

fn massless() -> InertialParameters<f64> {
    InertialParameters { mass: 0.0, first_moment: Vector3::zeros(), inertia_about_origin: Matrix3::zeros() }
}

impl JointPart {
    /// The joint of the tree, its numbers checked.
    fn joint(&self, source: &Source, kind: JointAxis, parent_from_link: Pose<f64>) -> Result<Joint<f64>, FormatsError> {
        let name = shortened(&self.name);
        let bad = |what: &str| source.bad(self.offset, &format!("joint `{name}`: {what}"));
        let gain = self.drive_gain.map(|drive| drive.gain_n_m_per_a);
        let gain_std = self.drive_gain.and_then(|drive| drive.std_n_m_per_a);
        let JointLimits { lower, upper, rate, effort } = self.limits;
        for (key, value, least) in [
            ("stiffness", Some(self.stiffness), Some(0.0)),
            ("rest_position", Some(self.rest_position), None),
            ("damping", Some(self.damping), Some(0.0)),
            ("rotor_inertia", Some(self.rotor_inertia), Some(0.0)),
            ("friction", self.coulomb_friction, Some(0.0)),
            ("lower limit", lower, None),
            ("upper limit", upper, None),
            ("limit of the rate", rate, Some(0.0)),
            ("limit of the effort", effort, Some(0.0)),
            ("drive gain", gain, Some(f64::MIN_POSITIVE)),
            ("standard deviation of the drive gain", gain_std, Some(f64::MIN_POSITIVE)),
        ] {
            let Some(value) = value else { continue };
            if !value.is_finite() {
                return Err(bad(&format!("{key} is {value}, no finite number")));
            }
            if least.is_some_and(|least| value < least) {
                return Err(bad(&format!("{key} is {value}, too small")));
            }
        }
        if let (Some(lower), Some(upper)) = (lower, upper)
            && lower > upper
        {
            return Err(bad(&format!("lower limit {lower} is above the upper one, {upper}")));
        }
        if !self.axis.iter().all(|x| x.is_finite()) {
            return Err(bad("`axis` must be finite"));
        }
        let joint = match kind {
            JointAxis::Revolute => Joint::revolute(self.axis, parent_from_link),
            JointAxis::Prismatic => Joint::prismatic(self.axis, parent_from_link),
        };
        let mut joint = joint.map_err(|error| bad(&error.to_string()))?.with_spring(
            self.stiffness,
            self.rest_position,
            self.damping,
        );
        joint.rotor_inertia = self.rotor_inertia;
        Ok(joint)
    }

    /// What the tree has no place for.
    fn described(&self) -> ArmJoint {
        ArmJoint {
            name: self.name.clone(),
            link: self.carried.link.clone(),
            body_known: self.carried.body.is_some(),
            limits: self.limits,
            coulomb_friction: self.coulomb_friction,
            drive_gain: self.drive_gain,
        }
    }
}
