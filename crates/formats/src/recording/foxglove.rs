//! What our MCAP files say: the published `foxglove.*` JSON messages, and flat ones of our own whose every number is a
//! curve.
//!
//! The schemas hold the names and fields that are published for each type; the text is written here.

use serde_json::{Value, json};
use std::fmt::Write as _;
use tumble_dynamics::{AlignedBox, World};
use tumble_lie::Pose;
use tumble_lie::nalgebra::{UnitQuaternion, Vector3};

/// The frame in which everything is measured.
pub const WORLD_FRAME: &str = "world";
/// The frame of the robot.
pub const BODY_FRAME: &str = "body";

/// A type of message: its name and its JSON schema.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    /// `package.Name`.
    pub name: &'static str,
    /// The JSON schema.
    pub text: String,
}

impl Schema {
    fn new(name: &'static str, mut schema: Value) -> Self {
        if let Some(object) = schema.as_object_mut() {
            object.insert("title".into(), name.into());
        }
        Self { name, text: schema.to_string() }
    }

    /// `foxglove.PoseInFrame`: a pose, stamped.
    pub fn pose_in_frame() -> Self {
        let fields = json!({"timestamp": time(), "frame_id": text(), "pose": pose()});
        Self::new("foxglove.PoseInFrame", object(fields))
    }

    /// `foxglove.FrameTransforms`: where frames are.
    pub fn frame_transforms() -> Self {
        let transform = object(json!({
            "timestamp": time(), "parent_frame_id": text(), "child_frame_id": text(),
            "translation": vector(), "rotation": quaternion(),
        }));
        Self::new("foxglove.FrameTransforms", object(json!({"transforms": array(transform)})))
    }

    /// `foxglove.SceneUpdate`: bodies to draw.
    pub fn scene_update() -> Self {
        let number = || json!({"type": "number"});
        let flag = || json!({"type": "boolean"});
        let count = || json!({"type": "integer", "minimum": 0});
        let arrow = json!({"pose": pose(), "shaft_length": number(), "shaft_diameter": number(),
            "head_length": number(), "head_diameter": number(), "color": color()});
        let solid = || json!({"pose": pose(), "size": vector(), "color": color()});
        let cylinder = json!({"pose": pose(), "size": vector(), "bottom_scale": number(), "top_scale": number(),
            "color": color()});
        let line = json!({"type": kind(&["LINE_STRIP", "LINE_LOOP", "LINE_LIST"]), "pose": pose(),
            "thickness": number(), "scale_invariant": flag(), "points": array(vector()), "color": color(),
            "colors": array(color()), "indices": array(count())});
        let triangles = json!({"pose": pose(), "points": array(vector()), "color": color(),
            "colors": array(color()), "indices": array(count())});
        let label = json!({"pose": pose(), "billboard": flag(), "font_size": number(), "scale_invariant": flag(),
            "color": color(), "text": text()});
        let model = json!({"pose": pose(), "scale": vector(), "color": color(), "override_color": flag(),
            "url": text(), "media_type": text(), "data": {"type": "string", "contentEncoding": "base64"}});
        let entity = json!({"timestamp": time(), "frame_id": text(), "id": text(), "lifetime": duration(),
            "frame_locked": flag(), "metadata": array(object(json!({"key": text(), "value": text()}))),
            "arrows": array(object(arrow)), "cubes": array(object(solid())), "spheres": array(object(solid())),
            "cylinders": array(object(cylinder)), "lines": array(object(line)),
            "triangles": array(object(triangles)), "texts": array(object(label)), "models": array(object(model))});
        let deletion = json!({"timestamp": time(), "type": kind(&["MATCHING_ID", "ALL"]), "id": text()});
        let fields = json!({"deletions": array(object(deletion)), "entities": array(object(entity))});
        Self::new("foxglove.SceneUpdate", object(fields))
    }

    /// `tumble.Wrench`: force, N, and torque about the body origin, N m, body axes.
    pub fn wrench() -> Self {
        let axis =
            |what: &str, unit: &str| json!({"type": "number", "description": format!("{what}, body axes, {unit}")});
        let (force, torque) = (|| axis("force", "N"), || axis("torque about the body origin", "N m"));
        let fields = json!({"f_x": force(), "f_y": force(), "f_z": force(),
            "tau_x": torque(), "tau_y": torque(), "tau_z": torque()});
        Self::new("tumble.Wrench", object(fields))
    }

    /// `std_msgs/String`: a text.
    pub fn string() -> Self {
        Self::new("std_msgs/String", object(json!({"data": text()})))
    }

    /// `tumble.Columns`: numbers (or texts) under the names they have as columns of a log.
    pub fn columns() -> Self {
        Self::new("tumble.Columns", json!({"type": "object", "additionalProperties": {"type": ["number", "string"]}}))
    }
}

fn object(properties: impl Into<Value>) -> Value {
    let properties = properties.into();
    json!({"type": "object", "properties": properties})
}
fn array(items: impl Into<Value>) -> Value {
    let items = items.into();
    json!({"type": "array", "items": items})
}
fn text() -> Value {
    json!({"type": "string"})
}
fn numbers(names: &[&str]) -> Value {
    object(names.iter().map(|name| ((*name).to_owned(), json!({"type": "number"}))).collect::<Value>())
}
fn vector() -> Value {
    numbers(&["x", "y", "z"])
}
fn quaternion() -> Value {
    numbers(&["x", "y", "z", "w"])
}
fn color() -> Value {
    numbers(&["r", "g", "b", "a"])
}
fn pose() -> Value {
    object(json!({"position": vector(), "orientation": quaternion()}))
}
fn kind(names: &[&str]) -> Value {
    let choices: Vec<Value> = names.iter().zip(0..).map(|(name, n)| json!({"title": name, "const": n})).collect();
    json!({"oneOf": choices})
}
fn time() -> Value {
    stamp("time", &json!({"type": "integer", "minimum": 0}))
}
fn duration() -> Value {
    stamp("duration", &json!({"type": "integer"}))
}
fn stamp(title: &str, seconds: &Value) -> Value {
    let nanoseconds = json!({"type": "integer", "minimum": 0, "maximum": 999_999_999});
    json!({"type": "object", "title": title, "properties": {"sec": seconds, "nsec": nanoseconds}})
}

/// `{"sec":..,"nsec":..}`.
fn stamped(time_ns: i64) -> String {
    format!("{{\"sec\":{},\"nsec\":{}}}", time_ns.div_euclid(1_000_000_000), time_ns.rem_euclid(1_000_000_000))
}

/// Numbers under their names, `{"x":..,..}`; they read back to the same bits.
pub fn flat<'a>(names: &[&str], numbers: impl IntoIterator<Item = &'a f64>) -> String {
    let mut text = String::from("{");
    for (name, number) in names.iter().zip(numbers) {
        let comma = if text.len() > 1 { "," } else { "" };
        let _ = write!(text, "{comma}\"{name}\":{number:?}");
    }
    text + "}"
}

const XYZ: [&str; 3] = ["x", "y", "z"];
const XYZW: [&str; 4] = ["x", "y", "z", "w"];

/// Position and quaternion (x, y, z, w) as a `foxglove.PoseInFrame`.
pub fn pose_in_frame(time_ns: i64, position: &[f64; 3], xyzw: &[f64; 4]) -> String {
    format!(
        "{{\"timestamp\":{},\"frame_id\":\"{WORLD_FRAME}\",\"pose\":{}}}",
        stamped(time_ns),
        pose_text(position, xyzw)
    )
}

fn pose_text(position: &[f64; 3], xyzw: &[f64; 4]) -> String {
    format!("{{\"position\":{},\"orientation\":{}}}", flat(&XYZ, position), flat(&XYZW, xyzw))
}

/// The body in the world as `foxglove.FrameTransforms`.
pub fn body_transform(time_ns: i64, position: &[f64; 3], xyzw: &[f64; 4]) -> String {
    format!(
        "{{\"transforms\":[{{\"timestamp\":{},\"parent_frame_id\":\"{WORLD_FRAME}\",\"child_frame_id\":\"{BODY_FRAME}\",\
         \"translation\":{},\"rotation\":{}}}]}}",
        stamped(time_ns),
        flat(&XYZ, position),
        flat(&XYZW, xyzw)
    )
}

/// Keep-in boxes, keep-out boxes and obstacles as a `foxglove.SceneUpdate`, to stay until replaced.
pub fn world_scene(time_ns: i64, world: &World) -> String {
    const KEEP_IN_COLOR: [f64; 4] = [0.2, 0.6, 1.0, 0.08];
    const KEEP_OUT_COLOR: [f64; 4] = [1.0, 0.6, 0.1, 0.25];
    const OBSTACLE_COLOR: [f64; 4] = [0.9, 0.3, 0.2, 0.7];
    let solid = |pose: &Pose<f64>, size: &Vector3<f64>, color: &[f64; 4]| {
        let (position, xyzw) = (pose.translation.vector.into(), pose.rotation.coords.into());
        let (pose, size) = (pose_text(&position, &xyzw), flat(&XYZ, size));
        format!("{{\"pose\":{pose},\"size\":{size},\"color\":{}}}", flat(&["r", "g", "b", "a"], color))
    };
    let boxes = |boxes: &[AlignedBox], color: &[f64; 4]| {
        let cube = |volume: &AlignedBox| {
            let center = (volume.lower_world + volume.upper_world) * 0.5;
            let pose = Pose::from_parts(center.into(), UnitQuaternion::identity());
            solid(&pose, &(volume.upper_world - volume.lower_world), color)
        };
        boxes.iter().map(cube).collect::<Vec<_>>().join(",")
    };
    let obstacles: Vec<String> = world
        .obstacles
        .iter()
        .map(|obstacle| solid(&obstacle.world_from_ellipsoid, &(obstacle.semi_axes * 2.0), &OBSTACLE_COLOR))
        .collect();
    let entity = |id: &str, cubes: &str, spheres: &str| {
        format!(
            "{{\"timestamp\":{},\"frame_id\":\"{WORLD_FRAME}\",\"id\":\"{id}\",\"lifetime\":{{\"sec\":0,\"nsec\":0}},\
             \"frame_locked\":false,\"metadata\":[],\"arrows\":[],\"cubes\":[{cubes}],\"spheres\":[{spheres}],\
             \"cylinders\":[],\"lines\":[],\"triangles\":[],\"texts\":[],\"models\":[]}}",
            stamped(time_ns)
        )
    };
    format!(
        "{{\"deletions\":[],\"entities\":[{},{},{}]}}",
        entity("keep_in", &boxes(&world.keep_in, &KEEP_IN_COLOR), ""),
        entity("keep_out", &boxes(&world.keep_out, &KEEP_OUT_COLOR), ""),
        entity("obstacles", "", &obstacles.join(","))
    )
}

/// Position and quaternion (x, y, z, w) of a `foxglove.PoseInFrame`.
pub fn read_pose(payload: &[u8]) -> Option<([f64; 3], [f64; 4])> {
    let message: Value = serde_json::from_slice(payload).ok()?;
    let pose = message.get("pose")?;
    Some((read(pose.get("position")?, &XYZ)?, read(pose.get("orientation")?, &XYZW)?))
}

/// Numbers of a flat message by their names.
pub fn read_flat<const N: usize>(payload: &[u8], names: &[&str; N]) -> Option<[f64; N]> {
    read(&serde_json::from_slice(payload).ok()?, names)
}

fn read<const N: usize>(object: &Value, names: &[&str; N]) -> Option<[f64; N]> {
    let mut numbers = [0.0; N];
    for (number, name) in numbers.iter_mut().zip(names) {
        *number = object.get(*name)?.as_f64()?;
    }
    Some(numbers)
}
