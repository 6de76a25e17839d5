//! Arms from TOML and URDF: trees that are what the files say, errors that name the place.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::float_cmp,
    clippy::format_push_string,
    clippy::approx_constant
)]

use proptest::prelude::*;
use std::path::Path;
use std::process::Command;
use tumble::robots::shipped;
use tumble_astrobee::bodies::BodyConfiguration;
use tumble_dynamics::nalgebra::{Matrix3, Matrix4, Rotation3, Vector3};
use tumble_dynamics::{InertialParameters, Joint, JointAxis, Link, Multibody, strategies};
use tumble_formats::FormatsError;
use tumble_formats::arm::{ArmFrame, ArmJoint, ArmModel, BaseKind, DriveGain, JointLimits};
use tumble_formats::testing::scratch_file;
use tumble_lie::Pose;

fn arm(text: &str) -> Result<ArmModel, FormatsError> {
    ArmModel::parse(Path::new("arm.file"), text, &shipped())
}

/// Where the tool is in the base frame, at these joint positions.
fn tool(arm: &ArmModel, positions: &[f64]) -> Pose<f64> {
    let tool = arm.tool.as_ref().unwrap();
    arm.tree.placements(positions).unwrap().base_from_body(tool.body).unwrap() * tool.body_from_frame
}

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= tolerance, "{found} {expected}");
    }
}

#[test]
fn ur10e_reaches_where_the_table_says() {
    let arm = ArmModel::find("ur10e", &shipped()).unwrap();
    assert_eq!((arm.base_kind, arm.joints.len()), (BaseKind::Fixed, 6));
    assert_eq!(arm.gravity_world_m_s2, Vector3::new(0.0, 0.0, -9.81));
    assert!(!arm.base_known && arm.joints.iter().all(|joint| !joint.body_known) && arm.tree.mass() == 0.0);
    let gains: Vec<f64> = arm.joints.iter().map(|joint| joint.drive_gain.unwrap().gain_n_m_per_a).collect();
    assert_eq!(gains, [10.0, 10.696, 8.457, 9.003, 9.48, 10.123]);
    // summed by hand: straight out, and upright after a quarter turn
    close(tool(&arm, &[0.0; 6]).translation.vector.as_slice(), &[1.184, 0.291, 0.061], 1e-12);
    let quarter = std::f64::consts::FRAC_PI_2;
    let upright = tool(&arm, &[quarter, -quarter, 0.0, 0.0, 0.0, 0.0]);
    close(upright.translation.vector.as_slice(), &[-0.291, 0.12, 1.365], 1e-12);
    // products of matrices from the table of frames
    let table = [
        (false, [0.0, 0.0, 0.181], 'z'),
        (true, [0.0, 0.176, 0.0], 'y'),
        (false, [0.0, -0.137, 0.613], 'y'),
        (true, [0.0, 0.0, 0.571], 'y'),
        (false, [0.0, 0.135, 0.0], 'z'),
        (false, [0.0, 0.0, 0.12], 'y'),
    ];
    let positions = [0.3, -1.1, 0.7, 2.4, -0.6, 1.9];
    let mut product = Matrix4::<f64>::identity();
    for ((turned, offset, axis), q) in table.into_iter().zip(positions) {
        let about_y = |angle: f64| Rotation3::from_axis_angle(&Vector3::y_axis(), angle).to_homogeneous();
        let turn = if turned { about_y(quarter) } else { Matrix4::identity() };
        let joint =
            if axis == 'y' { about_y(q) } else { Rotation3::from_axis_angle(&Vector3::z_axis(), q).to_homogeneous() };
        product *= Matrix4::new_translation(&Vector3::from(offset)) * turn * joint;
    }
    product *= Matrix4::new_translation(&Vector3::new(0.0, 0.117, 0.0));
    close(tool(&arm, &positions).to_homogeneous().as_slice(), product.as_slice(), 1e-12);
}

#[test]
fn the_perching_arm_weighs_what_its_parts_do() {
    let arm = ArmModel::find("astrobee-arm", &shipped()).unwrap();
    let robot = BodyConfiguration::Iss.parameters();
    assert!((arm.tree.mass() - robot.mass - 0.687_852_6).abs() < 5e-8, "{}", arm.tree.mass());
    assert_eq!((arm.base_kind, arm.gravity_world_m_s2), (BaseKind::Free, Vector3::zeros()));
    // the arm's base is part of the robot, half a turn about y: isotropic, so that the turn does not show
    let base = arm.tree.base();
    let mount = Vector3::new(-0.01, 0.0, -0.065);
    assert!((base.mass - robot.mass - 0.3078).abs() < 1e-12);
    assert!((base.first_moment - robot.first_moment - mount * 0.3078).norm() < 1e-12);
    let added = base.inertia_about_origin - robot.inertia_about_origin;
    let expected = Matrix3::identity() * (0.02705 + 0.3078 * mount.norm_squared()) - mount * mount.transpose() * 0.3078;
    assert!((added - expected).amax() < 1e-12, "{added}");
    let joint = &arm.tree.links()[0].joint;
    close(joint.parent_from_link().translation.vector.as_slice(), &[-0.12945, 0.0, -0.13], 1e-12);
    assert_eq!(*joint.axis(), -Vector3::y());
    // distal link and gripper: first moment summed by hand
    let distal = arm.tree.links()[1].body;
    assert!((distal.mass - 0.217_752_639_689_617_8).abs() < 1e-12);
    let fingers = [(0.04, -0.039, -0.010_002), (0.04, -0.039, 0.010_002)];
    let tips = [(0.011_602_639_689_617_8, -0.089, -0.010_002), (0.022_85, -0.089, 0.010_002)];
    let moment: Vector3<f64> =
        fingers.into_iter().chain(tips).map(|(mass, x, y)| Vector3::new(x, y, -0.0497) * mass).sum();
    assert!((distal.first_moment - moment).norm() < 1e-12);
    let limits = arm.joints[0].limits;
    assert_eq!(
        (limits.lower, limits.upper, limits.rate, limits.effort),
        (Some(-2.0944), Some(1.57079), Some(0.12), Some(1.0))
    );
    assert!(arm.frames.len() == 5 && arm.frame("gripper_left_distal_link").unwrap().body == 2);
}

/// Six axes, the joints in a mixed order, a tool and a box on fixed joints.
fn six_axes() -> String {
    let mut text =
        "<?xml version=\"1.0\"?>\n<robot name=\"six\">\n<material name=\"grey\"/>\n<link name=\"world\"/>\n".to_owned();
    for i in 0..=6 {
        text += &format!(
            "<link name=\"l{i}\"><visual/><inertial><origin xyz=\"0.0{i} 0 0.1\" rpy=\"0.3 -0.2 {i}\"/><mass value=\"{}\"/>\
             <inertia ixx=\"0.02\" ixy=\"0.001\" ixz=\"0\" iyy=\"0.03\" iyz=\"-0.002\" izz=\"0.025\"/></inertial></link>\n",
            3 - i / 3
        );
    }
    text += "<link name=\"tool0\"/>\n<link name=\"box\"><inertial><mass value=\"0.5\"/>\
             <inertia ixx=\"0.001\" ixy=\"0\" ixz=\"0\" iyy=\"0.001\" iyz=\"0\" izz=\"0.001\"/></inertial></link>\n";
    for i in [4, 2, 6, 1, 5, 3] {
        let (kind, axis) = [("revolute", "0 0 1"), ("continuous", "0 2 0"), ("prismatic", "1 0 0")][i % 3];
        text += &format!(
            "<joint name=\"j{i}\" type=\"{kind}\"><parent link=\"l{}\"/><child link=\"l{i}\"/>\
             <origin xyz=\"0.{i} 0 0.2\" rpy=\"0.1 {i} -0.4\"/><axis xyz=\"{axis}\"/>\
             <dynamics damping=\"0.{i}\" friction=\"0.0{i}\"/><limit lower=\"-1\" upper=\"{i}\" velocity=\"2\" effort=\"30\"/></joint>\n",
            i - 1
        );
    }
    text + "<joint name=\"ground\" type=\"fixed\"><parent link=\"world\"/><child link=\"l0\"/><origin xyz=\"0 0 1\"/></joint>\n\
            <joint name=\"flange\" type=\"fixed\"><parent link=\"l6\"/><child link=\"tool0\"/><origin xyz=\"0 0 0.1\" rpy=\"0 0 1.5\"/></joint>\n\
            <joint name=\"grasp\" type=\"fixed\"><parent link=\"tool0\"/><child link=\"box\"/><origin xyz=\"0.2 0 0\"/></joint>\n</robot>\n"
}

#[test]
fn a_urdf_becomes_the_tree_it_describes() {
    let arm = arm(&six_axes()).unwrap();
    assert_eq!((arm.name.as_str(), arm.base_name.as_str(), arm.base_kind), ("six", "world", BaseKind::Fixed));
    let names: Vec<&str> = arm.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["j1", "j2", "j3", "j4", "j5", "j6"]);
    let parents: Vec<_> = arm.tree.links().iter().map(|link| link.parent).collect();
    assert_eq!(parents, [None, Some(0), Some(1), Some(2), Some(3), Some(4)]);
    assert_eq!(arm.warnings, ["links without `<inertial>`, taken to have no mass: tool0"]);
    // l0 is on the ground, tool0 and the box are part of l6
    assert!(arm.base_known && (arm.tree.mass() - (3.0 + 3.0 + 3.0 + 2.0 + 2.0 + 2.0 + 1.0 + 0.5)).abs() < 1e-12);
    let joint = arm.tree.links()[0].joint;
    close(joint.parent_from_link().translation.vector.as_slice(), &[0.1, 0.0, 1.2], 1e-15);
    assert_eq!((joint.kind(), *joint.axis(), joint.damping), (JointAxis::Revolute, Vector3::y(), 0.1));
    assert_eq!(arm.tree.links()[1].joint.kind(), JointAxis::Prismatic);
    assert_eq!((arm.joints[0].limits.upper, arm.joints[1].limits.upper), (None, Some(2.0)));
    assert_eq!((arm.joints[4].limits.effort, arm.joints[4].coulomb_friction), (Some(30.0), Some(0.05)));
    // inertia of l3: axes turned by fixed roll, pitch, yaw, then moved
    let turn = |axis: &tumble_dynamics::nalgebra::UnitVector3<f64>, angle| Rotation3::from_axis_angle(axis, angle);
    let rotation = |r, p, y| turn(&Vector3::z_axis(), y) * turn(&Vector3::y_axis(), p) * turn(&Vector3::x_axis(), r);
    let axes = rotation(0.3, -0.2, 3.0).into_inner();
    let about_com = axes * Matrix3::new(0.02, 0.001, 0.0, 0.001, 0.03, -0.002, 0.0, -0.002, 0.025) * axes.transpose();
    let expected = InertialParameters::about_com(2.0, Vector3::new(0.03, 0.0, 0.1), about_com);
    assert!((arm.tree.links()[2].body.to_vector() - expected.to_vector()).amax() < 1e-14);
    // the box, two fixed joints from l6
    let at = Vector3::new(0.2 * 1.5f64.cos(), 0.2 * 1.5f64.sin(), 0.1);
    let expected = Vector3::new(0.06, 0.0, 0.1) + at * 0.5;
    assert!((arm.tree.links()[5].body.first_moment - expected).norm() < 1e-14);
    // an independent product of the origins
    let positions = [0.3, -0.2, 1.4, 0.5, 0.1, -0.8];
    let mut product = Matrix4::new_translation(&Vector3::new(0.0, 0.0, 1.0));
    for (i, q) in (1..).zip(positions) {
        let number = f64::from(i);
        let origin = Matrix4::new_translation(&Vector3::new(number / 10.0, 0.0, 0.2));
        let moved = match i % 3 {
            0 => Rotation3::from_axis_angle(&Vector3::z_axis(), q).to_homogeneous(),
            1 => Rotation3::from_axis_angle(&Vector3::y_axis(), q).to_homogeneous(),
            _ => Matrix4::new_translation(&Vector3::new(q, 0.0, 0.0)),
        };
        product *= origin * rotation(0.1, number, -0.4).to_homogeneous() * moved;
    }
    let last = arm.tree.placements(&positions).unwrap().base_from_body(6).unwrap();
    close(last.to_homogeneous().as_slice(), product.as_slice(), 1e-13);
    let tool0 = arm.frame("tool0").unwrap();
    assert_eq!(tool0.body, 6);
    close(tool0.body_from_frame.translation.vector.as_slice(), &[0.0, 0.0, 0.1], 1e-15);
    // a root with a body floats
    let floating =
        six_axes().replace("<link name=\"world\"/>\n", "").replace("<parent link=\"world\"/>", "<parent link=\"l0\"/>");
    let (start, end) =
        (floating.find("<joint name=\"ground\"").unwrap(), floating.find("<joint name=\"flange\"").unwrap());
    let floating = without(&floating, start, end);
    let arm = self::arm(&floating).unwrap();
    assert_eq!(
        (arm.base_name.as_str(), arm.base_kind, arm.gravity_world_m_s2),
        ("l0", BaseKind::Free, Vector3::zeros())
    );
}

fn without(text: &str, start: usize, end: usize) -> String {
    [&text[..start], &text[end..]].concat()
}

const SMALL: &str = r#"format = 1
name = "small"
base_kind = "free"
[base]
body = { mass_kg = 9, com_m = [0, 0, 0], inertia_about_com_kg_m2 = [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }
[[joint]]
name = "elbow"
parent = "shoulder"
kind = "prismatic"
axis = [1, 0, 0]
[[joint]]
name = "shoulder"
link = "upper"
parent = "base"
kind = "revolute"
axis = [0, 0, 2]
position_m = [0.5, 0, 0]
quaternion_xyzw = [0, 0, 1, 0]
stiffness = 3
rest_position = 0.1
damping = 0.2
rotor_inertia = 0.01
coulomb_friction = 0.04
drive_gain_n_m_per_a = 8
drive_gain_std_n_m_per_a = 0.1
limits = { lower = -1, upper = 2 }
body = { mass_kg = 2, com_m = [0.1, 0, 0], inertia_about_com_kg_m2 = [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]] }
"#;

#[test]
fn every_key_lands_where_it_says() {
    let arm = arm(SMALL).unwrap();
    let [upper, elbow] = arm.tree.links() else { panic!() };
    assert_eq!((upper.parent, elbow.parent, elbow.joint.kind()), (None, Some(0), JointAxis::Prismatic));
    let joint = upper.joint;
    assert_eq!([joint.stiffness, joint.rest_position, joint.damping, joint.rotor_inertia], [3.0, 0.1, 0.2, 0.01]);
    assert_eq!((*joint.axis(), joint.kind()), (Vector3::z(), JointAxis::Revolute));
    assert_eq!(joint.parent_from_link().translation.vector, Vector3::new(0.5, 0.0, 0.0));
    assert!((joint.parent_from_link().rotation * Vector3::x() + Vector3::x()).norm() < 1e-15);
    assert!(
        (upper.body.to_vector()
            - InertialParameters::about_com(2.0, Vector3::new(0.1, 0.0, 0.0), Matrix3::identity() * 0.1).to_vector())
        .amax()
            < 1e-15
    );
    let described = &arm.joints[0];
    assert_eq!((described.name.as_str(), described.link.as_str(), described.body_known), ("shoulder", "upper", true));
    assert_eq!(described.limits, JointLimits { lower: Some(-1.0), upper: Some(2.0), rate: None, effort: None });
    assert_eq!(described.drive_gain, Some(DriveGain { gain_n_m_per_a: 8.0, std_n_m_per_a: Some(0.1) }));
    assert_eq!(described.coulomb_friction, Some(0.04));
    assert!(!arm.joints[1].body_known && arm.joints[1].link == "elbow" && arm.tool.is_none());
}

#[test]
fn a_file_in_order_keeps_its_order() {
    let joint = |name: &str, parent: &str| {
        format!("[[joint]]\nname = \"{name}\"\nparent = \"{parent}\"\nkind = \"revolute\"\naxis = [0, 0, 1]\n")
    };
    let text = |joints: [(&str, &str); 4]| {
        let joints = joints.map(|(name, parent)| joint(name, parent)).concat();
        let arm = arm(&format!("format = 1\nname = \"tree\"\nbase_kind = \"fixed\"\n{joints}")).unwrap();
        let parents: Vec<_> = arm.tree.links().iter().map(|link| link.parent).collect();
        (arm.joints.into_iter().map(|joint| joint.name).collect::<Vec<_>>().concat(), parents)
    };
    assert_eq!(
        text([("a", "base"), ("b", "a"), ("c", "base"), ("d", "b")]),
        ("abcd".into(), vec![None, Some(0), None, Some(1)])
    );
    assert_eq!(
        text([("d", "b"), ("c", "base"), ("b", "a"), ("a", "base")]),
        ("cabd".into(), vec![None, None, Some(1), Some(2)])
    );
}

#[test]
fn the_example_of_the_page_is_an_arm() {
    // The published package comes without the documents of the repository.
    let page = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/arms.md");
    let Ok(page) = std::fs::read_to_string(page) else { return };
    let example = page.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    let arm = arm(example).unwrap();
    assert_eq!((arm.tree.joints(), arm.tool.unwrap().body, arm.tree.links()[1].parent), (2, 2, Some(0)));
    assert_eq!(arm.tree.mass(), BodyConfiguration::Iss.parameters().mass + 1.5);
}

/// What is wrong with a text: code, line and message.
fn refusal(text: &str) -> (&'static str, String) {
    let error = arm(text).expect_err(text);
    assert!(error.to_string().starts_with("arm.file, line "), "{error}");
    assert!(!error.remedy().is_empty());
    (error.code(), error.to_string())
}

#[test]
fn what_is_wrong_with_a_toml_file_is_named() {
    for (original, replacement, code, place, says) in [
        ("format = 1", "format = 2", "T050", 1, "`format` is 2"),
        ("damping = 0.2", "dampping = 0.2", "T050", 21, "did you mean `damping`?"),
        ("kind = \"revolute\"", "kind = \"planar\"", "T050", 15, "unknown variant `planar`"),
        ("name = \"small\"", "name = \"\"", "T051", 1, "no name"),
        ("name = \"shoulder\"", "name = \"should\\u0007er\"", "T051", 12, "no name"),
        ("axis = [0, 0, 2]\n", "", "T050", 12, "joint `shoulder`: `axis` is missing"),
        ("axis = [0, 0, 2]", "axis = [0, 0, 0]", "T050", 12, "no direction"),
        ("axis = [0, 0, 2]", "axis = [0, 0, nan]", "T050", 12, "`axis` must be finite"),
        ("position_m = [0.5, 0, 0]", "position_m = [inf, 0, 0]", "T050", 12, "must be finite"),
        ("quaternion_xyzw = [0, 0, 1, 0]", "quaternion_xyzw = [0, 0, 2, 0]", "T050", 12, "norm 1"),
        ("stiffness = 3", "rpy_rad = [0, 0, 0]", "T050", 12, "one of them"),
        ("stiffness = 3", "stiffness = -3", "T050", 12, "stiffness is -3, too small"),
        ("rest_position = 0.1", "rest_position = nan", "T050", 12, "rest_position is NaN"),
        ("drive_gain_n_m_per_a = 8\n", "", "T050", 12, "without `drive_gain_n_m_per_a`"),
        ("drive_gain_n_m_per_a = 8\n", "drive_gain_n_m_per_a = 0\n", "T050", 12, "drive gain is 0"),
        ("lower = -1, upper = 2", "lower = 3, upper = 2", "T050", 12, "above the upper one"),
        ("lower = -1, upper = 2", "lower = -1, uper = 2", "T050", 26, "did you mean `upper`?"),
        ("parent = \"base\"", "parent = \"elbow\"", "T051", 7, "`elbow` hangs on itself"),
        ("parent = \"base\"", "parent = \"bass\"", "T051", 12, "did you mean `base`?"),
        ("name = \"elbow\"", "name = \"shoulder\"", "T051", 12, "two joints are called `shoulder`"),
        ("link = \"upper\"", "link = \"elbow\"", "T051", 12, "two links are called `elbow`"),
        ("mass_kg = 2", "mass_kg = -2", "T053", 12, "link `upper`: no body has these"),
        ("mass_kg = 2", "mass_kg = nan", "T053", 12, "link `upper`: value is not finite"),
        ("[0, 0, 0.1]] }", "[0, 0, 0.3]] }", "T053", 12, "link `upper`: no body has these"),
        ("[0, 0.1, 0], [0, 0, 0.1]] }", "[0.1, 0.1, 0], [0, 0, 0.1]] }", "T053", 12, "not symmetric"),
        ("mass_kg = 9", "mass_kg = -9", "T053", 4, "link `base`"),
        ("body = { mass_kg = 9", "preset = \"iss\"\nbody = { mass_kg = 9", "T050", 4, "one of them"),
        ("[base]\n", "[tool]\nlink = \"uper\"\n[base]\n", "T051", 4, "did you mean `upper`?"),
        ("[base]\n", "[base]\npreset = \"is\"\n#", "T050", 4, "did you mean `iss`?"),
        ("name = \"small\"\n", "", "T050", 1, "missing field `name`"),
    ] {
        assert_eq!(SMALL.matches(original).count(), 1, "{original}");
        let (found, message) = refusal(&SMALL.replace(original, replacement));
        assert_eq!(found, code, "{message}");
        assert!(message.contains(says) && message.contains(&format!("line {place},")), "{replacement}: {message}");
    }
    assert_eq!(
        refusal("format = 1\nname = \"a\"\nbase_kind = \"free\"\n").1,
        "arm.file, line 1, column 1: no joint that moves"
    );
    assert_eq!(refusal("").0, "T050");
    let missing = ArmModel::find("ur10", &shipped()).unwrap_err();
    assert!(missing.code() == "T050" && missing.to_string().contains("did you mean `ur10e`?"), "{missing}");
}

#[test]
fn what_is_wrong_with_a_urdf_is_named() {
    let whole = six_axes();
    for (original, replacement, code, says) in [
        ("<robot name=\"six\">", "<robot name=\"six\"", "T050", ""),
        ("<robot name=\"six\">", "<robot name=\"six\"><xacro:macro name=\"a\"/>", "T050", "`xacro` first"),
        ("<robot name=\"six\">", "<!DOCTYPE robot><robot name=\"six\">", "T050", "DTD"),
        (
            "<material name=\"grey\"/>",
            "<x:macro xmlns:x=\"http://www.ros.org/wiki/xacro\" name=\"a\"/>",
            "T050",
            "`xacro` first",
        ),
        ("name=\"j3\" type=\"revolute\"", "name=\"j3\" type=\"floating\"", "T052", "joint `j3` is floating"),
        ("name=\"j3\" type=\"revolute\"", "name=\"j3\" type=\"planar\"", "T052", "joint `j3` is planar"),
        (
            "name=\"j3\" type=\"revolute\">",
            "name=\"j3\" type=\"revolute\"><mimic joint=\"j1\"/>",
            "T052",
            "joint `j3` is mimic",
        ),
        ("name=\"j3\" type=\"revolute\"", "name=\"j3\"", "T050", "joint `j3`: `<joint>` has no attribute `type`"),
        ("<joint name=\"j3\"", "<joint name=\"j2\"", "T051", "two joints are called `j2`"),
        ("<link name=\"tool0\"/>", "<link name=\"l1\"/>", "T051", "two links are called `l1`"),
        ("<child link=\"box\"/>", "<child link=\"l3\"/>", "T051", "link `l3` is on two joints"),
        ("<parent link=\"tool0\"/>", "<parent link=\"toll0\"/>", "T051", "no link `toll0`; did you mean `tool0`?"),
        ("<parent link=\"world\"/>", "<parent link=\"l4\"/>", "T051", "hangs on itself"),
        ("<child link=\"l0\"/>", "<child link=\"world\"/>", "T051", "`ground` hangs on itself"),
        (
            "<link name=\"tool0\"/>",
            "<link name=\"tool0\"/><link name=\"lost\"/>",
            "T051",
            "`world` and `lost` are on no joint",
        ),
        ("<mass value=\"0.5\"/>", "<mass value=\"-0.5\"/>", "T053", "link `box`"),
        ("<mass value=\"0.5\"/>", "", "T050", "link `box`: `<mass>` is missing"),
        ("<mass value=\"0.5\"/>", "<mass value=\"nan\"/>", "T050", "`value` of `<mass>` is `nan`"),
        ("<mass value=\"0.5\"/>", "<mass value=\"${m}\"/>", "T050", "expand the file with `xacro` first"),
        ("izz=\"0.001\"", "izz=\"0.01\"", "T053", "link `box`: no body has these"),
        ("xyz=\"0.2 0 0\"", "xyz=\"0.2 0\"", "T050", "`xyz` of `<origin>` is `0.2 0`"),
        ("xyz=\"0.2 0 0\"", "xyz=\"0.2 0 0 0\"", "T050", "joint `grasp`"),
        ("xyz=\"0.2 0 0\"", "xyz=\"1e300 0 0\"", "T053", "link `box`: value is not finite"),
    ] {
        assert_eq!(whole.matches(original).count(), 1, "{original}");
        let (found, message) = refusal(&whole.replace(original, replacement));
        assert!(found == code && message.contains(says), "{replacement}: {found} {message}");
    }
    assert!(refusal("<model/>").1.contains("begins with `<robot>`"));
    assert!(refusal("<robot name=\"a\"/>").1.contains("no links"));
    let ring = "<robot name=\"ring\"><link name=\"a\"/><link name=\"b\"/>\
        <joint name=\"x\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>\
        <joint name=\"y\" type=\"fixed\"><parent link=\"b\"/><child link=\"a\"/></joint></robot>";
    assert!(refusal(ring).1.contains("none is the base"));
    // a ring beside a base
    let beside = ring.replace("<link name=\"a\"/>", "<link name=\"root\"/><link name=\"a\"/>");
    assert!(refusal(&beside).1.contains("hangs on itself"));
    // a joint is named where it stands, not where its link does
    let axis = "<robot name=\"a\">\n<link name=\"a\"/>\n<link name=\"b\"/>\n<joint name=\"x\" type=\"revolute\">\
        <parent link=\"a\"/><child link=\"b\"/><axis xyz=\"0 0 0\"/></joint></robot>";
    assert!(refusal(axis).1.starts_with("arm.file, line 4, column 1: joint `x`: the axis"), "{}", refusal(axis).1);
}

#[test]
fn deep_and_wide_files_end() {
    let deep = format!("<robot name=\"a\">{}", "<a>".repeat(100_000));
    assert_eq!(refusal(&deep).0, "T050");
    let mut chain = "<robot name=\"chain\"><link name=\"l0\"/>".to_owned();
    for i in 1..4000 {
        chain += &format!(
            "<link name=\"l{i}\"/><joint name=\"j{i}\" type=\"continuous\"><parent link=\"l{}\"/><child link=\"l{i}\"/></joint>",
            i - 1
        );
    }
    assert_eq!(arm(&format!("{chain}</robot>")).unwrap().tree.joints(), 3999);
}

/// Arms with anything that a file can hold.
fn arms() -> impl Strategy<Value = ArmModel> {
    let number = || proptest::option::of(0.1..9.0f64);
    let described = (number(), number(), number(), number(), number(), number());
    let springs = (0.0..3.0f64, -1.0..1.0f64, 0.0..1.0f64, 0.0..0.1f64);
    let link = (any::<bool>(), any::<usize>(), strategies::vectors(1.0), strategies::poses(1.0), springs);
    let link = (link, proptest::option::of(strategies::bodies()), described);
    let frame = (any::<usize>(), strategies::poses(1.0));
    let base = (proptest::option::of(strategies::bodies()), any::<bool>(), strategies::vectors(9.81));
    let parts = (base, proptest::collection::vec(link, 1..6), proptest::collection::vec(frame, 0..3), any::<bool>());
    parts.prop_map(|((base, free, gravity), parts, frames, tool)| {
        let (mut links, mut joints) = (Vec::new(), Vec::new());
        let nothing = InertialParameters::about_com(0.0, Vector3::zeros(), Matrix3::zeros());
        for (i, ((slide, parent, axis, pose, springs), body, described)) in parts.into_iter().enumerate() {
            let axis = axis + Vector3::new(2.0, 0.0, 0.0);
            let joint = if slide { Joint::prismatic(axis, pose) } else { Joint::revolute(axis, pose) };
            let mut joint = joint.unwrap().with_spring(springs.0, springs.1, springs.2);
            joint.rotor_inertia = springs.3;
            links.push(Link { parent: (parent % (i + 1)).checked_sub(1), joint, body: body.unwrap_or(nothing) });
            let (lower, range, rate, effort, coulomb_friction, gain) = described;
            let upper = range.map(|range| lower.unwrap_or(0.0) + range);
            joints.push(ArmJoint {
                name: format!("joint {i} <&\">"),
                link: if i == 1 { "joint 1 <&\">".to_owned() } else { format!("link{i}") },
                body_known: body.is_some(),
                limits: JointLimits { lower, upper, rate, effort },
                coulomb_friction,
                drive_gain: gain.map(|gain| DriveGain { gain_n_m_per_a: gain, std_n_m_per_a: rate }),
            });
        }
        let bodies = links.len() + 1;
        let frame = |(i, (on, pose)): (usize, (usize, Pose<f64>))| ArmFrame {
            name: format!("frame{i}"),
            body: on % bodies,
            body_from_frame: pose,
        };
        let frames: Vec<ArmFrame> = frames.into_iter().enumerate().map(frame).collect();
        ArmModel {
            name: "drawn".to_owned(),
            description: Some("what \"this\" is".to_owned()),
            tree: Multibody::try_new(base.unwrap_or(nothing), links).unwrap(),
            base_kind: if free { BaseKind::Free } else { BaseKind::Fixed },
            base_name: "trunk".to_owned(),
            base_known: base.is_some(),
            gravity_world_m_s2: gravity,
            joints,
            tool: frames.first().filter(|_| tool).cloned(),
            frames,
            warnings: Vec::new(),
        }
    })
}

fn same_pose(a: &Pose<f64>, b: &Pose<f64>) {
    close(a.to_homogeneous().as_slice(), b.to_homogeneous().as_slice(), 1e-14);
}

/// Bodies, joints and frames of two arms are the same but for rounding.
fn same_tree(a: &ArmModel, b: &ArmModel) {
    assert_eq!((a.tree.joints(), &a.base_name, a.base_known), (b.tree.joints(), &b.base_name, b.base_known));
    for index in 0..a.tree.bodies() {
        let [a, b] = [a, b].map(|arm| *arm.tree.body(index).unwrap());
        assert!((a.to_vector() - b.to_vector()).amax() <= 1e-13 * a.to_vector().amax(), "{index}");
    }
    for (a, b) in a.tree.links().iter().zip(b.tree.links()) {
        assert_eq!((a.parent, a.joint.kind(), a.joint.damping), (b.parent, b.joint.kind(), b.joint.damping));
        assert!((a.joint.axis() - b.joint.axis()).amax() < 1e-15);
        same_pose(a.joint.parent_from_link(), b.joint.parent_from_link());
    }
    assert_eq!(a.frames.len(), b.frames.len());
    for (a, b) in a.frames.iter().zip(&b.frames) {
        assert_eq!((&a.name, a.body), (&b.name, b.body));
        same_pose(&a.body_from_frame, &b.body_from_frame);
    }
}

proptest! {
    #[test]
    fn an_arm_is_read_as_it_was_written(arm in arms()) {
        let again = self::arm(&arm.to_toml().unwrap()).unwrap();
        same_tree(&arm, &again);
        assert_eq!((&arm.joints, arm.base_kind, &arm.description), (&again.joints, again.base_kind, &again.description));
        assert_eq!(arm.gravity_world_m_s2, again.gravity_world_m_s2);
        for (a, b) in arm.tree.links().iter().zip(again.tree.links()) {
            let springs = |joint: &Joint<f64>| [joint.stiffness, joint.rest_position, joint.rotor_inertia];
            assert_eq!(springs(&a.joint), springs(&b.joint));
        }
        match (&arm.tool, &again.tool) {
            (Some(a), Some(b)) => {
                assert_eq!(a.body, b.body);
                same_pose(&a.body_from_frame, &b.body_from_frame);
            }
            (a, b) => assert!(a.is_none() && b.is_none()),
        }
    }

    #[test]
    fn a_urdf_is_read_as_it_was_written(arm in arms()) {
        let again = self::arm(&arm.to_urdf()).unwrap();
        same_tree(&arm, &again);
        for (a, b) in arm.joints.iter().zip(&again.joints) {
            assert_eq!((&a.name, &a.link, a.body_known), (&b.name, &b.link, b.body_known));
            assert_eq!((a.limits, a.coulomb_friction), (b.limits, b.coulomb_friction));
        }
    }
}

fn tumble(arguments: &[&str]) -> (i32, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_tumble")).args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

#[test]
fn the_command_lists_and_shows() {
    let (code, listed, _) = tumble(&["arm", "list"]);
    assert!(code == 0 && listed.contains("astrobee-arm ") && listed.contains("ur10e "), "{listed}");
    let (code, table, warnings) = tumble(&["arm", "show", "astrobee-arm"]);
    assert!(code == 0 && warnings.is_empty(), "{warnings}");
    assert!(
        table.contains("total mass of the bodies known: 10.2716413 kg") && table.contains("arm_distal_joint"),
        "{table}"
    );
    assert_eq!(table.matches("a body, margin 0.").count(), 3, "{table}");
    let (_, table, _) = tumble(&["arm", "show", "ur10e"]);
    assert_eq!(table.matches("not known").count(), 8, "{table}");
    let path = scratch_file("arm.urdf", six_axes());
    let name = path.to_str().unwrap();
    let (code, text, warnings) = tumble(&["arm", "show", name, "--as", "toml"]);
    assert!(code == 0 && warnings.contains("tool0"), "{warnings}");
    same_tree(&arm(&text).unwrap(), &arm(&six_axes()).unwrap());
    let (_, text, _) = tumble(&["arm", "show", name, "--as", "urdf"]);
    same_tree(&arm(&text).unwrap(), &arm(&six_axes()).unwrap());
    std::fs::remove_file(&path).unwrap();
    let (code, _, error) = tumble(&["arm", "show", "nowhere"]);
    assert!(code == 2 && error.contains("error[T050]") && error.contains("remedy: "), "{error}");
}
