//! An MJCF as a model: bodies, the defaults of their geoms, the settings of the compiler that decide what is meant.

use super::links::{Inertial, Model, ModelKind, ModelLink, Written};
use super::solid::{PlacedSolid, Solid};
use super::xml::{DEEPEST, Element, half_digit};
use crate::FormatsError;
use crate::log::shortened;
use std::collections::BTreeMap;
use tumble_dynamics::nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use tumble_lie::Pose;

/// Defaults of geoms by class; of one class the attributes by name, each as its element and that of the nearest class that has it.
type Defaults<'a> = BTreeMap<&'a str, Vec<Element<'a>>>;

/// The class of what names none.
const MAIN: &str = "main";

/// What turns an element.
const TURNS: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];

/// What the compiler is told.
struct Compiler<'a> {
    /// Radians in the unit of angles.
    angle: f64,
    euler_order: &'a str,
    from_shapes: bool,
    balanced: bool,
}

struct Reader<'a> {
    compiler: Compiler<'a>,
    defaults: Defaults<'a>,
    links: Vec<ModelLink>,
    left_out: Vec<&'static str>,
}

/// The bodies below `<mujoco>`.
pub(super) fn read(root: Element) -> Result<Model, FormatsError> {
    let mut compiler = Compiler { angle: 1_f64.to_radians(), euler_order: "xyz", from_shapes: false, balanced: false };
    for element in root.of_tag("compiler") {
        match element.text("angle") {
            Some("radian") => compiler.angle = 1.0,
            Some("degree") => compiler.angle = 1_f64.to_radians(),
            Some(other) => {
                return Err(element.bad(&format!("`angle` is `{}`, not `degree` or `radian`", shortened(other))));
            }
            None => {}
        }
        if let Some(order) = element.text("eulerseq") {
            if order.len() != 3 || !order.chars().all(|axis| "xyzXYZ".contains(axis)) {
                return Err(element.bad(&format!("`eulerseq` is `{}`, no order of three axes", shortened(order))));
            }
            compiler.euler_order = order;
        }
        compiler.from_shapes |= element.text("inertiafromgeom") == Some("true");
        compiler.balanced |= element.text("balanceinertia") == Some("true");
    }
    let mut reader = Reader { compiler, defaults: Defaults::new(), links: Vec::new(), left_out: Vec::new() };
    reader.defaults.insert(MAIN, Vec::new());
    for element in root.of_tag("default") {
        reader.read_defaults(element, &[], true, 0)?;
    }
    if root.of_tag("include").next().is_some() {
        reader.leave_out("include");
    }
    for world in root.of_tag("worldbody") {
        let class = world.text("childclass").unwrap_or(MAIN);
        reader.read_bodies(world, &Around { parent: None, class, parent_from_here: Pose::identity() }, 0)?;
    }
    if reader.links.is_empty() {
        return Err(root.bad("no bodies"));
    }
    let Reader { compiler, links, left_out, .. } = reader;
    let mut notes = Vec::new();
    if compiler.from_shapes {
        notes.push(
            "`inertiafromgeom=\"true\"`: the simulator takes every inertia from the geoms, whatever `<inertial>` says"
                .to_owned(),
        );
    }
    if compiler.balanced {
        notes.push("`balanceinertia=\"true\"`: the simulator replaces an inertia that cannot be by equal ones, and says nothing".to_owned());
    }
    if !left_out.is_empty() {
        let tags: Vec<String> = left_out.iter().map(|tag| format!("`<{tag}>`")).collect();
        notes.push(format!("not read: what {} would add", tags.join(", ")));
    }
    Ok(Model {
        kind: ModelKind::Mjcf,
        name: root.text("model").unwrap_or("model").to_owned(),
        links,
        notes,
        from_shapes: compiler.from_shapes,
        balanced: compiler.balanced,
        text: root.source.text.to_owned(),
    })
}

/// Where in the tree an element stands.
struct Around<'a> {
    /// The body around it.
    parent: Option<usize>,
    /// The class of what names none.
    class: &'a str,
    /// Frames between that body and here.
    parent_from_here: Pose<f64>,
}

impl<'a> Reader<'a> {
    fn leave_out(&mut self, tag: &'static str) {
        if !self.left_out.contains(&tag) {
            self.left_out.push(tag);
        }
    }

    fn read_defaults(
        &mut self,
        element: Element<'a>,
        inherited: &[Element<'a>],
        is_main: bool,
        depth: usize,
    ) -> Result<(), FormatsError> {
        if depth > DEEPEST {
            return Err(too_deep(element));
        }
        let geoms = element.child("geom")?.into_iter().chain(inherited.iter().copied()).collect::<Vec<_>>();
        let class = if is_main { element.text("class").unwrap_or(MAIN) } else { element.needed_text("class")? };
        if is_main {
            self.defaults.insert(MAIN, geoms.clone());
        }
        for inner in element.of_tag("default") {
            self.read_defaults(inner, &geoms, false, depth + 1)?;
        }
        self.defaults.insert(class, geoms);
        Ok(())
    }

    fn read_bodies(&mut self, element: Element<'a>, around: &Around<'a>, depth: usize) -> Result<(), FormatsError> {
        if depth > DEEPEST {
            return Err(too_deep(element));
        }
        for child in element.children() {
            match child.tag() {
                "body" => self.read_body(child, around, depth)?,
                "frame" => {
                    let parent_from_here = around.parent_from_here * self.pose(child)?;
                    let class = child.text("childclass").unwrap_or(around.class);
                    self.read_bodies(child, &Around { parent: around.parent, class, parent_from_here }, depth + 1)?;
                }
                "include" => self.leave_out("include"),
                "replicate" => self.leave_out("replicate"),
                "composite" => self.leave_out("composite"),
                "flexcomp" => self.leave_out("flexcomp"),
                "attach" => self.leave_out("attach"),
                "joint" | "freejoint" => {
                    if let Some(link) = around.parent.and_then(|parent| self.links.get_mut(parent)) {
                        link.moves = true;
                    }
                }
                "geom" => self.read_geom(child, around)?,
                "inertial" => {
                    let inertial = self.inertial(child)?;
                    if let Some(link) = around.parent.and_then(|parent| self.links.get_mut(parent))
                        && link.inertial.replace(inertial).is_some()
                    {
                        return Err(child.bad("a second `<inertial>` in `<body>`"));
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn read_body(&mut self, element: Element<'a>, around: &Around<'a>, depth: usize) -> Result<(), FormatsError> {
        let line = element.line();
        let name = element.text("name").filter(|name| !name.is_empty());
        let name = name.map_or_else(|| format!("body of line {line}"), str::to_owned);
        let pose = around.parent_from_here * self.pose(element)?;
        let index = self.links.len();
        self.links.push(ModelLink {
            name,
            line,
            parent: around.parent,
            moves: false,
            offset_m: pose.translation.vector.norm(),
            inertial: None,
            collision: Some(Vec::new()),
            visual: Some(Vec::new()),
            range: element.range(),
            tag: element.tag_range(),
        });
        let class = element.text("childclass").unwrap_or(around.class);
        self.read_bodies(element, &Around { parent: Some(index), class, parent_from_here: Pose::identity() }, depth + 1)
    }

    fn read_geom(&mut self, geom: Element<'a>, around: &Around<'a>) -> Result<(), FormatsError> {
        let Some(link) = around.parent else { return Ok(()) };
        let class = geom.text("class").unwrap_or(around.class);
        let Some(defaults) = self.defaults.get(class) else {
            let near = crate::place::suggestion(class, self.defaults.keys().copied());
            return Err(geom.bad(&format!("there is no default class `{}`{near}", shortened(class))));
        };
        // the geom itself, then the nearest of its classes
        let chain: Vec<Element> = std::iter::once(geom).chain(defaults.iter().copied()).collect();
        let holder = |attribute: &str| chain.iter().find(|element| element.text(attribute).is_some()).copied();
        let is_zero = |attribute: &str| holder(attribute).and_then(|element| element.text(attribute)) == Some("0");
        let is_seen_only = is_zero("contype") && is_zero("conaffinity");
        let kind = holder("type").and_then(|element| element.text("type"));
        // with a mesh the sizes of a solid are fitted to it
        let kind = if holder("mesh").is_some() { "mesh" } else { kind.unwrap_or("sphere") };
        let size = match holder("size") {
            Some(element) => element.numbers::<3>("size")?,
            None => None,
        };
        let ends = match holder("fromto") {
            Some(element) => element.vector::<6>("fromto")?,
            None => None,
        };
        let mut pose = self.pose_of(&chain)?;
        let mut half_length = None;
        if let Some([ax, ay, az, bx, by, bz]) = ends {
            let (a, b) = (Vector3::new(ax, ay, az), Vector3::new(bx, by, bz));
            half_length = Some(0.5 * (b - a).norm());
            pose = Pose::from_parts((0.5 * (a + b)).into(), from_z_to(&(b - a)));
        }
        let solid = solid(kind, size, half_length);
        let link_from_solid = around.parent_from_here * pose;
        let Some(link) = self.links.get_mut(link) else { return Ok(()) };
        let solids = if is_seen_only { &mut link.visual } else { &mut link.collision };
        match (solid, solids.as_mut()) {
            (Some(solid), Some(known)) => known.push(PlacedSolid { solid, link_from_solid }),
            _ => *solids = None,
        }
        Ok(())
    }

    fn inertial(&self, element: Element<'a>) -> Result<Inertial, FormatsError> {
        let mass = element.number("mass")?;
        let full = element.vector::<6>("fullinertia")?;
        let diagonal = element.vector::<3>("diaginertia")?;
        let rounding = |attribute: &str, sides: [f64; 6]| {
            let words = element.text(attribute).unwrap_or_default().split_whitespace();
            words.zip(sides).map(|(word, sides)| sides * half_digit(word).powi(2)).sum::<f64>().sqrt()
        };
        let mut pose = self.pose(element)?;
        let (inertia, rounding, written) = match (full, diagonal) {
            (Some(_), Some(_)) => return Err(element.bad("both `fullinertia` and `diaginertia`: one is needed")),
            (None, None) => return Err(element.bad("`<inertial>` has neither `fullinertia` nor `diaginertia`")),
            (Some([xx, yy, zz, xy, xz, yz]), None) => {
                // turned axes beside a full tensor are refused by the simulator
                pose.rotation = UnitQuaternion::identity();
                (
                    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
                    rounding("fullinertia", [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]),
                    Written::Full(element.value_range("fullinertia")),
                )
            }
            (None, Some(diagonal)) => (
                Matrix3::from_diagonal(&diagonal.into()),
                rounding("diaginertia", [1.0; 6]),
                Written::Diagonal(element.value_range("diaginertia")),
            ),
        };
        let other_turn = element.vector::<4>("quat")?.filter(|_| full.is_none()).map(|[x, y, z, w]| {
            (UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)), "`quat` read with its scalar last")
        });
        Ok(Inertial { mass, link_from_inertial: pose, inertia, rounding, written, range: element.range(), other_turn })
    }

    fn pose(&self, element: Element<'a>) -> Result<Pose<f64>, FormatsError> {
        self.pose_of(&[element])
    }

    /// The pose that the first of these says that says one, place and turn each by itself.
    fn pose_of(&self, chain: &[Element<'a>]) -> Result<Pose<f64>, FormatsError> {
        let holder = |attributes: &[&str]| {
            chain.iter().find(|element| attributes.iter().any(|attribute| element.text(attribute).is_some())).copied()
        };
        let position = match holder(&["pos"]) {
            Some(element) => element.vector::<3>("pos")?.unwrap_or_default(),
            None => [0.0; 3],
        };
        let rotation = holder(&TURNS).map_or(Ok(UnitQuaternion::identity()), |element| self.turn(element))?;
        Ok(Pose::from_parts(Vector3::from(position).into(), rotation))
    }

    /// The turn that one element says.
    fn turn(&self, element: Element<'a>) -> Result<UnitQuaternion<f64>, FormatsError> {
        let unit = |vector: Vector3<f64>, attribute: &str| {
            vector.try_normalize(1e-12).ok_or_else(|| element.bad(&format!("`{attribute}` has no direction")))
        };
        if let Some([w, x, y, z]) = element.vector::<4>("quat")? {
            let quaternion = Quaternion::new(w, x, y, z);
            if quaternion.norm() < 1e-12 {
                return Err(element.bad("`quat` is zero"));
            }
            return Ok(UnitQuaternion::new_normalize(quaternion));
        }
        if let Some([x, y, z, angle]) = element.vector::<4>("axisangle")? {
            let axis = unit(Vector3::new(x, y, z), "axisangle")?;
            return Ok(UnitQuaternion::new(axis * (angle * self.compiler.angle)));
        }
        if let Some(angles) = element.vector::<3>("euler")? {
            return Ok(self.euler(angles));
        }
        if let Some([a, b, c, d, e, f]) = element.vector::<6>("xyaxes")? {
            let x = unit(Vector3::new(a, b, c), "xyaxes")?;
            let y = Vector3::new(d, e, f);
            let y = unit(y - x * x.dot(&y), "xyaxes")?;
            let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
            return Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes)));
        }
        let axis = unit(element.vector::<3>("zaxis")?.unwrap_or([0.0, 0.0, 1.0]).into(), "zaxis")?;
        Ok(from_z_to(&axis))
    }

    /// Lower-case axes turn with the body, upper-case ones stay.
    fn euler(&self, angles: [f64; 3]) -> UnitQuaternion<f64> {
        let mut rotation = UnitQuaternion::identity();
        for (axis, angle) in self.compiler.euler_order.chars().zip(angles) {
            let direction = match axis.to_ascii_lowercase() {
                'x' => Vector3::x(),
                'y' => Vector3::y(),
                _ => Vector3::z(),
            };
            let turn = UnitQuaternion::new(direction * (angle * self.compiler.angle));
            rotation = if axis.is_ascii_lowercase() { rotation * turn } else { turn * rotation };
        }
        rotation
    }
}

/// The shortest turn of the z axis to a direction.
fn from_z_to(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(&Vector3::z(), direction)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI))
}

/// `None` for what is no such solid, or lacks a size.
fn solid(kind: &str, size: Option<([f64; 3], usize)>, half_length: Option<f64>) -> Option<Solid> {
    let (size, count) = size?;
    let [first, second, _] = size;
    match kind {
        "sphere" if count >= 1 => Some(Solid::Ellipsoid([first; 3])),
        "ellipsoid" if count == 3 => Some(Solid::Ellipsoid(size)),
        "box" if count == 3 => Some(Solid::Box(size)),
        "cylinder" | "capsule" => {
            let half = half_length.or((count >= 2).then_some(second))?;
            Some(if kind == "cylinder" { Solid::Cylinder(first, half) } else { Solid::Capsule(first, half) })
        }
        _ => None,
    }
}

fn too_deep(element: Element) -> FormatsError {
    element.bad(&format!("elements inside one another more than {DEEPEST} deep"))
}
