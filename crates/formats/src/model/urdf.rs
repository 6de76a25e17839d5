//! A URDF as a model.

use super::links::{Inertial, Model, ModelKind, ModelLink, Written};
use super::solid::{PlacedSolid, Solid};
use super::xml::{Element, half_digit};
use crate::FormatsError;
use crate::log::shortened;
use std::collections::BTreeMap;
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_lie::{EulerZyx, Pose};

/// The links below `<robot>`.
pub(super) fn read(robot: Element) -> Result<Model, FormatsError> {
    if let Some(element) = robot.children().find(|element| element.is_macro()) {
        return Err(element.bad("macros: expand the file with `xacro` first"));
    }
    let mut links = Vec::new();
    let mut places = BTreeMap::new();
    for element in robot.of_tag("link") {
        let name = element.needed_text("name")?;
        if places.insert(name, links.len()).is_some() {
            return Err(element.bad(&format!("two links are called `{}`", shortened(name))));
        }
        links.push(ModelLink {
            name: name.to_owned(),
            line: element.line(),
            parent: None,
            moves: false,
            offset_m: 0.0,
            inertial: inertial(element)?,
            collision: solids(element, "collision")?,
            visual: solids(element, "visual")?,
            range: element.range(),
            tag: element.tag_range(),
        });
    }
    if links.is_empty() {
        return Err(robot.bad("no links"));
    }
    for joint in robot.of_tag("joint") {
        let end = |tag| {
            let element = joint.needed_child(tag)?;
            let link = element.needed_text("link")?;
            let found = places.get(link).copied();
            found.ok_or_else(|| {
                let near = crate::place::suggestion(link, places.keys().copied());
                element.bad(&format!("there is no link `{}`{near}", shortened(link)))
            })
        };
        let (parent, child) = (end("parent")?, end("child")?);
        let Some(link) = links.get_mut(child) else { continue };
        if link.parent.is_some() {
            return Err(joint.bad(&format!("link `{}` is on two joints", shortened(&link.name))));
        }
        link.parent = Some(parent);
        link.moves = joint.text("type") != Some("fixed");
        link.offset_m = origin(joint)?.translation.vector.norm();
    }
    Ok(Model {
        kind: ModelKind::Urdf,
        name: robot.text("name").unwrap_or("robot").to_owned(),
        links,
        notes: Vec::new(),
        from_shapes: false,
        balanced: false,
        text: robot.source.text.to_owned(),
    })
}

/// The pose in the `<origin>` of an element.
fn origin(element: Element) -> Result<Pose<f64>, FormatsError> {
    let Some(origin) = element.child("origin")? else { return Ok(Pose::identity()) };
    let position = Vector3::from(origin.vector::<3>("xyz")?.unwrap_or_default());
    let [roll, pitch, yaw] = origin.vector::<3>("rpy")?.unwrap_or_default();
    Ok(Pose::from_parts(position.into(), EulerZyx::new(roll, pitch, yaw).to_rotation()))
}

const ENTRIES: [&str; 6] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];

fn inertial(link: Element) -> Result<Option<Inertial>, FormatsError> {
    let Some(element) = link.child("inertial")? else { return Ok(None) };
    let mass = element.needed_child("mass")?.number("value")?;
    let tensor = element.needed_child("inertia")?;
    let mut entries = [0.0; 6];
    let mut squares = 0.0;
    for (entry, name) in entries.iter_mut().zip(ENTRIES) {
        *entry = tensor.number(name)?;
        // the products stand on both sides of the diagonal
        let sides = if matches!(name, "ixy" | "ixz" | "iyz") { 2.0 } else { 1.0 };
        squares += sides * half_digit(tensor.text(name).unwrap_or_default().trim()).powi(2);
    }
    let [xx, xy, xz, yy, yz, zz] = entries;
    Ok(Some(Inertial {
        mass,
        link_from_inertial: origin(element)?,
        inertia: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
        rounding: squares.sqrt(),
        written: Written::Named(ENTRIES.map(|name| tensor.value_range(name))),
        range: element.range(),
        other_turn: None,
    }))
}

/// The solids of the elements of this tag; `None` where one is a mesh.
fn solids(link: Element, tag: &'static str) -> Result<Option<Vec<PlacedSolid>>, FormatsError> {
    let mut solids = Some(Vec::new());
    for element in link.of_tag(tag) {
        let link_from_solid = origin(element)?;
        let shape = element.child("geometry")?.and_then(|geometry| geometry.children().next());
        let solid = match shape {
            Some(shape) => solid(shape)?,
            None => None,
        };
        match (solid, &mut solids) {
            (Some(solid), Some(known)) => known.push(PlacedSolid { solid, link_from_solid }),
            _ => solids = None,
        }
    }
    Ok(solids)
}

fn solid(shape: Element) -> Result<Option<Solid>, FormatsError> {
    let solid = match shape.tag() {
        "box" => shape.vector::<3>("size")?.map(|edges| Solid::Box(edges.map(|edge| 0.5 * edge))),
        "sphere" => Some(Solid::Ellipsoid([shape.number("radius")?; 3])),
        "cylinder" => Some(Solid::Cylinder(shape.number("radius")?, 0.5 * shape.number("length")?)),
        "capsule" => Some(Solid::Capsule(shape.number("radius")?, 0.5 * shape.number("length")?)),
        _ => None,
    };
    Ok(solid)
}
