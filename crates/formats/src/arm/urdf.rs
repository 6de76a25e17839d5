//! URDF in and out.
//!
//! Read from the document tree, not through a deserialiser, so that every error names line and column and a link
//! without `<inertial>` differs from one of no mass.

use super::assembly::{Assembly, JointPart, Part, Source};
use super::model::{ArmModel, BaseKind, JointLimits, written};
use crate::FormatsError;
use crate::body_file;
use crate::log::shortened;
use roxmltree::{Document, Node};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_dynamics::{InertialParameters, JointAxis};
use tumble_lie::{EulerZyx, Pose};

/// A root link of this name is the ground.
const WORLD: &str = "world";

/// An element of the file.
#[derive(Clone, Copy)]
struct Element<'a> {
    source: Source<'a>,
    node: Node<'a, 'a>,
}

impl<'a> Element<'a> {
    fn offset(self) -> usize {
        self.node.range().start
    }

    /// An error at this element, of the named link or joint.
    fn bad(self, of: &str, message: &str) -> FormatsError {
        self.source.bad(self.offset(), &format!("{of}: {message}"))
    }

    fn children(self, tag: &'static str) -> impl Iterator<Item = Self> {
        let of_tag = self.node.children().filter(move |node| node.has_tag_name(tag));
        of_tag.map(move |node| Self { source: self.source, node })
    }

    /// The one child of this tag, if there is one.
    fn child(self, of: &str, tag: &'static str) -> Result<Option<Self>, FormatsError> {
        let mut found = self.children(tag);
        let first = found.next();
        match found.next() {
            Some(second) => Err(second.bad(of, &format!("a second `<{tag}>`"))),
            None => Ok(first),
        }
    }

    fn needed_child(self, of: &str, tag: &'static str) -> Result<Self, FormatsError> {
        self.child(of, tag)?.ok_or_else(|| self.bad(of, &format!("`<{tag}>` is missing")))
    }

    fn text(self, of: &str, attribute: &str) -> Result<&'a str, FormatsError> {
        let tag = self.node.tag_name().name();
        let found = self.node.attribute(attribute).filter(|text| !text.is_empty());
        found.ok_or_else(|| self.bad(of, &format!("`<{tag}>` has no attribute `{attribute}`")))
    }

    fn number(self, of: &str, attribute: &str) -> Result<Option<f64>, FormatsError> {
        let Some(text) = self.node.attribute(attribute) else { return Ok(None) };
        let number = text.trim().parse().ok().filter(|number: &f64| number.is_finite());
        number.map(Some).ok_or_else(|| self.no_number(of, attribute, text))
    }

    fn needed_number(self, of: &str, attribute: &str) -> Result<f64, FormatsError> {
        let text = self.text(of, attribute)?;
        self.number(of, attribute)?.ok_or_else(|| self.no_number(of, attribute, text))
    }

    fn vector(self, of: &str, attribute: &str) -> Result<Option<[f64; 3]>, FormatsError> {
        let Some(text) = self.node.attribute(attribute) else { return Ok(None) };
        let mut vector = [f64::NAN; 3];
        let mut words = text.split_whitespace();
        for (slot, word) in vector.iter_mut().zip(&mut words) {
            *slot = word.parse().unwrap_or(f64::NAN);
        }
        if words.next().is_some() || !vector.iter().all(|number| number.is_finite()) {
            return Err(self.no_number(of, attribute, text));
        }
        Ok(Some(vector))
    }

    fn no_number(self, of: &str, attribute: &str, text: &str) -> FormatsError {
        let tag = self.node.tag_name().name();
        let remedy = if text.contains("${") { "; expand the file with `xacro` first" } else { "" };
        self.bad(
            of,
            &format!("`{attribute}` of `<{tag}>` is `{}`, no finite number or vector{remedy}", shortened(text)),
        )
    }

    /// The pose in the `<origin>` of this element.
    fn origin(self, of: &str) -> Result<Pose<f64>, FormatsError> {
        let Some(origin) = self.child(of, "origin")? else { return Ok(Pose::identity()) };
        let position = Vector3::from(origin.vector(of, "xyz")?.unwrap_or_default());
        let [roll, pitch, yaw] = origin.vector(of, "rpy")?.unwrap_or_default();
        Ok(Pose::from_parts(position.into(), EulerZyx::new(roll, pitch, yaw).to_rotation()))
    }
}

/// Reads an arm.
///
/// # Errors
/// Those of [`ArmModel::parse`].
pub(super) fn parse(path: &Path, text: &str) -> Result<ArmModel, FormatsError> {
    let source = Source { path, text };
    let document = Document::parse(text).map_err(|error| {
        let remedy = match &error {
            roxmltree::Error::UnknownNamespace(prefix, _) if prefix == "xacro" => {
                "; expand the file with `xacro` first"
            }
            roxmltree::Error::DtdDetected => "; a URDF needs none",
            _ => "",
        };
        FormatsError::BadArm {
            path: path.into(),
            line: error.pos().row as usize,
            column: error.pos().col as usize,
            message: crate::text_file::printable(&error.to_string()).replace('\n', " ") + remedy,
        }
    })?;
    let robot = Element { source, node: document.root_element() };
    if !robot.node.has_tag_name("robot") {
        let tag = shortened(robot.node.tag_name().name());
        return Err(source.bad(robot.offset(), &format!("`<{tag}>`: a URDF begins with `<robot>`")));
    }
    let macros = |node: &Node| node.tag_name().namespace().is_some_and(|namespace| namespace.ends_with("xacro"));
    if let Some(node) = robot.node.children().find(macros) {
        return Err(source.bad(node.range().start, "macros: expand the file with `xacro` first"));
    }
    let mut links = BTreeMap::new();
    let mut in_order = Vec::new();
    let mut without_body = Vec::new();
    for element in robot.children("link") {
        let name = element.text("link", "name")?;
        let body = body(element, name)?;
        if body.is_none() && name != WORLD {
            without_body.push(shortened(name));
        }
        if links.insert(name, (element, body)).is_some() {
            return Err(structure(element, &format!("two links are called `{}`", shortened(name))));
        }
        in_order.push((name, element));
    }
    let mut carried = BTreeMap::new();
    let mut joints = Vec::new();
    for element in robot.children("joint") {
        let joint = joint(element, &links)?;
        if let Some(other) = carried.insert(joint.carried.link.clone(), joint.name.clone()) {
            let [link, other, joint] = [&joint.carried.link, &other, &joint.name].map(|name| shortened(name));
            return Err(structure(element, &format!("link `{link}` is on two joints, `{other}` and `{joint}`")));
        }
        joints.push(joint);
    }
    let mut roots = in_order.iter().filter(|(name, _)| !carried.contains_key(*name));
    let (base, element) = match (roots.next(), roots.next()) {
        (Some(root), None) => *root,
        (None, _) if in_order.is_empty() => return Err(structure(robot, "no links")),
        (None, _) => return Err(structure(robot, "every link is on a joint: none is the base")),
        (Some((first, _)), Some((second, element))) => {
            let [first, second] = [first, second].map(|name| shortened(name));
            return Err(structure(
                *element,
                &format!("links `{first}` and `{second}` are on no joint: one base is needed"),
            ));
        }
    };
    let body = links.get(base).and_then(|(_, body)| *body);
    let base_kind = if base == WORLD || body.is_none() { BaseKind::Fixed } else { BaseKind::Free };
    let mut warnings = Vec::new();
    if !without_body.is_empty() {
        warnings.push(format!("links without `<inertial>`, taken to have no mass: {}", without_body.join(", ")));
    }
    Assembly {
        source,
        name: robot.node.attribute("name").unwrap_or("arm").to_owned(),
        description: None,
        base_kind,
        gravity_world_m_s2: base_kind.usual_gravity(),
        base: Part { offset: element.offset(), link: base.to_owned(), body },
        joints,
        tool: None,
        warnings,
    }
    .build()
}

fn structure(element: Element, message: &str) -> FormatsError {
    element.source.structure(element.offset(), message)
}

/// The body of a link, link frame.
fn body(link: Element, name: &str) -> Result<Option<InertialParameters<f64>>, FormatsError> {
    let of = format!("link `{}`", shortened(name));
    let Some(inertial) = link.child(&of, "inertial")? else { return Ok(None) };
    let link_from_body = inertial.origin(&of)?;
    let mass = inertial.needed_child(&of, "mass")?.needed_number(&of, "value")?;
    let inertia = inertial.needed_child(&of, "inertia")?;
    let entry = |attribute| inertia.needed_number(&of, attribute);
    let (xx, xy, xz) = (entry("ixx")?, entry("ixy")?, entry("ixz")?);
    let (yy, yz, zz) = (entry("iyy")?, entry("iyz")?, entry("izz")?);
    let about_com = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    Ok(Some(InertialParameters::about_com(mass, Vector3::zeros(), about_com).transformed_by(&link_from_body)))
}

type Links<'a> = BTreeMap<&'a str, (Element<'a>, Option<InertialParameters<f64>>)>;

fn joint(element: Element, links: &Links) -> Result<JointPart, FormatsError> {
    let name = element.text("joint", "name")?;
    let of = format!("joint `{}`", shortened(name));
    let end = |tag| element.needed_child(&of, tag)?.text(&of, "link");
    let (parent, child) = (end("parent")?, end("child")?);
    let there = |link: &str| {
        links.get(link).ok_or_else(|| {
            let near = crate::place::suggestion(link, links.keys().copied());
            structure(element, &format!("{of}: there is no link `{}`{near}", shortened(link)))
        })
    };
    there(parent)?;
    let (link, body) = *there(child)?;
    let refused = |kind: &str| {
        let (line, column) = crate::place::of_offset(element.source.text, element.offset());
        let (joint, kind) = (shortened(name), shortened(kind));
        FormatsError::ArmJointKind { path: element.source.path.into(), line, column, joint, kind }
    };
    if element.child(&of, "mimic")?.is_some() {
        return Err(refused("mimic"));
    }
    let kind = match element.text(&of, "type")? {
        "revolute" | "continuous" => Some(JointAxis::Revolute),
        "prismatic" => Some(JointAxis::Prismatic),
        "fixed" => None,
        other => return Err(refused(other)),
    };
    let axis = match element.child(&of, "axis")? {
        Some(axis) => axis.vector(&of, "xyz")?.unwrap_or([1.0, 0.0, 0.0]),
        None => [1.0, 0.0, 0.0],
    };
    let (mut damping, mut coulomb_friction) = (0.0, None);
    if let Some(dynamics) = element.child(&of, "dynamics")? {
        damping = dynamics.number(&of, "damping")?.unwrap_or(0.0);
        coulomb_friction = dynamics.number(&of, "friction")?;
    }
    let mut limits = JointLimits::default();
    if let Some(limit) = element.child(&of, "limit")? {
        let number = |attribute| limit.number(&of, attribute);
        limits = JointLimits { rate: number("velocity")?, effort: number("effort")?, ..limits };
        if element.node.attribute("type") != Some("continuous") {
            (limits.lower, limits.upper) = (number("lower")?, number("upper")?);
        }
    }
    Ok(JointPart {
        offset: element.offset(),
        name: name.to_owned(),
        parent: parent.to_owned(),
        kind,
        axis: axis.into(),
        parent_from_link: element.origin(&of)?,
        stiffness: 0.0,
        rest_position: 0.0,
        damping,
        rotor_inertia: 0.0,
        coulomb_friction,
        limits,
        drive_gain: None,
        carried: Part { offset: link.offset(), link: child.to_owned(), body },
    })
}

/// The text of an arm.
pub(super) fn write(arm: &ArmModel) -> String {
    let mut text = format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", escaped(&arm.name));
    for index in 0..arm.tree.bodies() {
        let _ = writeln!(text, "<link name=\"{}\">", escaped(arm.body_name(index).unwrap_or_default()));
        if let Some(body) = arm.tree.body(index).filter(|_| arm.body_known(index)) {
            text.push_str(&body_file::urdf(&written(body)));
        }
        text.push_str("</link>\n");
    }
    for (described, link) in arm.joints.iter().zip(arm.tree.links()) {
        let JointLimits { lower, upper, rate, effort } = described.limits;
        let kind = match (link.joint.kind(), lower, upper) {
            (JointAxis::Revolute, None, None) => "continuous",
            (JointAxis::Revolute, ..) => "revolute",
            (JointAxis::Prismatic, ..) => "prismatic",
        };
        let parent = arm.body_name(link.parent.map_or(0, |parent| parent + 1)).unwrap_or_default();
        begin_joint(&mut text, (&described.name, kind), parent, &described.link, link.joint.parent_from_link());
        let [x, y, z]: [f64; 3] = (*link.joint.axis()).into();
        let _ = writeln!(text, "  <axis xyz=\"{x} {y} {z}\"/>");
        let friction = attribute("friction", described.coulomb_friction);
        let _ = writeln!(text, "  <dynamics damping=\"{}\"{friction}/>", link.joint.damping);
        let limits = [("lower", lower), ("upper", upper), ("velocity", rate), ("effort", effort)];
        let limits = limits.map(|(name, value)| attribute(name, value)).concat();
        if !limits.is_empty() {
            let _ = writeln!(text, "  <limit{limits}/>");
        }
        text.push_str("</joint>\n");
    }
    for frame in &arm.frames {
        let name = escaped(&frame.name);
        let _ = writeln!(text, "<link name=\"{name}\"/>");
        let joint = arm.name_of_fixed_joint(frame);
        let parent = arm.body_name(frame.body).unwrap_or_default();
        begin_joint(&mut text, (&joint, "fixed"), parent, &frame.name, &frame.body_from_frame);
        text.push_str("</joint>\n");
    }
    text.push_str("</robot>\n");
    text
}

fn begin_joint(text: &mut String, (name, kind): (&str, &str), parent: &str, child: &str, pose: &Pose<f64>) {
    let [name, parent, child] = [name, parent, child].map(escaped);
    let [x, y, z]: [f64; 3] = pose.translation.vector.into();
    let EulerZyx { roll, pitch, yaw } = EulerZyx::from_rotation(&pose.rotation);
    let _ = writeln!(
        text,
        "<joint name=\"{name}\" type=\"{kind}\">\n  <parent link=\"{parent}\"/>\n  <child link=\"{child}\"/>\n  \
         <origin xyz=\"{x} {y} {z}\" rpy=\"{roll} {pitch} {yaw}\"/>"
    );
}

fn attribute(name: &str, value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| format!(" {name}=\"{value}\""))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
