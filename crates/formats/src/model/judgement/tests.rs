use super::*;
use crate::FormatsError;
use proptest::prelude::*;
use std::fmt::Write as _;
use std::path::Path;
use tumble_dynamics::nalgebra::UnitQuaternion;
use tumble_lie::{EulerZyx, Pose};

use super::super::{PlacedSolid, Solid};

type Body = InertialParameters<f64>;

fn verdicts(text: &str) -> Vec<Verdict> {
    judge(&Model::parse(Path::new("robot.xml"), text).unwrap())
}

fn read(text: &str) -> Result<Model, FormatsError> {
    Model::parse(Path::new("robot.xml"), text)
}

/// Origin and geometry of a solid as URDF.
fn urdf_solid(tag: &str, placed: &PlacedSolid) -> String {
    let shape = match placed.solid {
        Solid::Box([x, y, z]) => format!("<box size=\"{} {} {}\"/>", 2.0 * x, 2.0 * y, 2.0 * z),
        Solid::Ellipsoid([radius, ..]) => format!("<sphere radius=\"{radius}\"/>"),
        Solid::Cylinder(radius, half) => format!("<cylinder radius=\"{radius}\" length=\"{}\"/>", 2.0 * half),
        Solid::Capsule(radius, half) => format!("<capsule radius=\"{radius}\" length=\"{}\"/>", 2.0 * half),
    };
    format!("<{tag}>{}<geometry>{shape}</geometry></{tag}>\n", origin(&placed.link_from_solid))
}

fn origin(pose: &Pose<f64>) -> String {
    let [x, y, z]: [f64; 3] = pose.translation.vector.into();
    let EulerZyx { roll, pitch, yaw } = EulerZyx::from_rotation(&pose.rotation);
    format!("<origin xyz=\"{x} {y} {z}\" rpy=\"{roll} {pitch} {yaw}\"/>")
}

/// A robot of one link with this inertia about its centre of mass.
fn urdf(mass: f64, com: Vector3<f64>, j: &Matrix3<f64>, solids: &[PlacedSolid]) -> String {
    let mut text = "<robot name=\"r\">\n<link name=\"l\">\n".to_owned();
    for placed in solids {
        text += &urdf_solid("collision", placed);
    }
    let _ = writeln!(
        text,
        "<inertial>{}<mass value=\"{mass}\"/><inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/></inertial>",
        origin(&Pose::translation(com.x, com.y, com.z)),
        j.m11,
        j.m12,
        j.m13,
        j.m22,
        j.m23,
        j.m33
    );
    text + "</link>\n</robot>\n"
}

fn at_origin(solid: Solid) -> PlacedSolid {
    PlacedSolid { solid, link_from_solid: Pose::identity() }
}

/// Mass of one density in solids: mass, centre, inertia about it.
fn filled(solids: &[PlacedSolid], density: f64) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let filled = Filled::of(solids).unwrap();
    let mass = filled.volume * density;
    let inertia = (Matrix3::identity() * filled.spread.trace() - filled.spread) * mass;
    (mass, filled.centre, inertia)
}

fn kinds(verdict: &Verdict) -> Vec<FindingKind> {
    let told = verdict.findings.iter().filter(|finding| finding.severity > Severity::Note);
    told.map(|finding| finding.kind).collect()
}

fn solid() -> impl Strategy<Value = Solid> {
    let size = || 0.02..0.4_f64;
    prop_oneof![
        (size(), size(), size()).prop_map(|(x, y, z)| Solid::Box([x, y, z])),
        size().prop_map(|radius| Solid::Ellipsoid([radius; 3])),
        (size(), size()).prop_map(|(radius, half)| Solid::Cylinder(radius, half)),
        (size(), size()).prop_map(|(radius, half)| Solid::Capsule(radius, half)),
    ]
}

fn pose() -> impl Strategy<Value = Pose<f64>> {
    (prop::array::uniform3(-0.3..0.3), prop::array::uniform3(-3.0..3.0_f64))
        .prop_map(|(at, turn)| Pose::from_parts(Vector3::from(at).into(), UnitQuaternion::new(Vector3::from(turn))))
}

fn placed() -> impl Strategy<Value = PlacedSolid> {
    (solid(), pose()).prop_map(|(solid, link_from_solid)| PlacedSolid { solid, link_from_solid })
}

/// A point inside a solid: in the largest octahedron of its half-lengths.
fn inside(placed: &PlacedSolid, [x, y, z]: [f64; 3]) -> Vector3<f64> {
    let half = match placed.solid {
        Solid::Box(half) | Solid::Ellipsoid(half) => half,
        Solid::Cylinder(radius, half) => [radius, radius, half],
        Solid::Capsule(radius, half) => [radius, radius, half + radius],
    };
    let size = (x.abs() + y.abs() + z.abs()).max(1.0);
    let point = Vector3::new(x * half[0], y * half[1], z * half[2]) / size;
    placed.link_from_solid.transform_point(&point.into()).coords
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, ..ProptestConfig::default() })]

    #[test]
    fn mass_inside_its_shapes_is_never_accused(
        solids in prop::collection::vec(placed(), 1..4),
        points in prop::collection::vec((0.1..1.0_f64, 0..4_usize, prop::array::uniform3(-1.0..1.0)), 6..20),
        density in 50.0..12_000.0,
    ) {
        let points: Vec<(f64, Vector3<f64>)> =
            points.iter().map(|(weight, k, place)| (*weight, inside(&solids[k % solids.len()], *place))).collect();
        let volume: f64 = solids.iter().map(|placed| placed.solid.volume()).sum();
        let whole = Body::from_points(&points);
        let body = whole * (density * volume / whole.mass);
        let found = &verdicts(&urdf(body.mass, body.center_of_mass(), &body.inertia_about_com(), &solids))[0];
        prop_assert!(found.physical == Some(true) && found.findings.is_empty(), "{found:?}");
    }

    #[test]
    fn bodies_without_shapes_are_never_accused(
        points in prop::collection::vec((0.1..9.0_f64, prop::array::uniform3(-2.0..2.0)), 1..9),
    ) {
        let points: Vec<_> = points.into_iter().map(|(mass, place)| (mass, Vector3::from(place))).collect();
        let body = Body::from_points(&points);
        let found = &verdicts(&urdf(body.mass, body.center_of_mass(), &body.inertia_about_com(), &[]))[0];
        prop_assert!(found.physical == Some(true) && found.findings.is_empty(), "{found:?}");
    }

    #[test]
    fn what_no_body_has_is_named_and_its_nearest_is_the_nearest(
        principal in prop::array::uniform3(-0.2..2.0_f64),
        turn in prop::array::uniform3(-3.0..3.0_f64),
        mass in 0.1..10.0_f64,
    ) {
        let turn = UnitQuaternion::new(Vector3::from(turn)).to_rotation_matrix();
        let j = turn * Matrix3::from_diagonal(&principal.into()) * turn.transpose();
        let [a, b, c] = { let mut p = principal; p.sort_by(f64::total_cmp); p };
        let text = urdf(mass, Vector3::new(0.1, 0.2, 0.3), &j, &[]);
        let model = read(&text).unwrap();
        let found = judge(&model);
        let is_body = a >= 0.0 && c <= a + b;
        prop_assume!((c - a - b).abs() > 1e-6 && a.abs() > 1e-6);
        prop_assert_eq!(found[0].physical, Some(is_body));
        prop_assert_eq!(kinds(&found[0]), if is_body { vec![] } else { vec![FindingKind::Impossible] });
        if is_body {
            prop_assert_eq!(model.repaired(&found).text, text);
            return Ok(());
        }
        let nearest = found[0].nearest.as_ref().unwrap();
        let distance = (nearest.inertia - j).norm();
        // no body of a grid around it is nearer
        let [x, y, z]: [f64; 3] = nearest.inertia.symmetric_eigenvalues().into();
        for k in 0..27_i32 {
            let step = |n: i32| f64::from(n % 3 - 1) * 0.02;
            let mut other = [x + step(k), y + step(k / 3), z + step(k / 9)];
            other.sort_by(f64::total_cmp);
            let [p, q, r] = other;
            if p >= 0.0 && r <= p + q {
                let far = (p - a).powi(2) + (q - b).powi(2) + (r - c).powi(2);
                prop_assert!(far.sqrt() >= distance - 1e-5, "{other:?} {distance}");
            }
        }
        let repaired = model.repaired(&found).text;
        prop_assert_eq!(judge(&read(&repaired).unwrap())[0].physical, Some(true));
        let around = |text: &str| {
            let start = text.find("ixx").unwrap();
            (text[..start].to_owned(), text[start + text[start..].find("/>").unwrap()..].to_owned())
        };
        prop_assert_eq!(around(&repaired), around(&text));
    }

    #[test]
    fn exchanged_axes_of_a_filled_shape_are_named(
        lengths in (0.02..0.05_f64, 0.1..0.15_f64, 0.3..0.5_f64), axes in 0..5_usize, density in 100.0..8000.0,
        at in prop::array::uniform3(-0.3..0.3),
    ) {
        let solid = Solid::Box([lengths.0, lengths.1, lengths.2]);
        let placed = [PlacedSolid { solid, link_from_solid: Pose::translation(at[0], at[1], at[2]) }];
        let (mass, com, j) = filled(&placed, density);
        let order = [[1, 0, 2], [0, 2, 1], [2, 1, 0], [2, 0, 1], [1, 2, 0]][axes];
        let wrong = Matrix3::from_fn(|row, column| j[(order[row], order[column])]);
        let found = verdicts(&urdf(mass, com, &wrong, &placed));
        prop_assert_eq!(kinds(&found[0]), vec![FindingKind::Swapped], "{:?}", found);
        prop_assert!(verdicts(&urdf(mass, com, &j, &placed))[0].findings.is_empty());
    }

    #[test]
    fn mirrored_products_of_a_turned_rod_are_named(
        turn in 0.4..1.1_f64, about in 0..3_usize, radius in 0.01..0.04_f64, half in 0.2..0.5_f64,
    ) {
        // across the axis about which it is turned
        let along = [Vector3::y(), Vector3::z(), Vector3::x()][about];
        let axis = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()][about];
        let rod = UnitQuaternion::rotation_between(&Vector3::z(), &along).unwrap_or_default();
        let pose = Pose::from_parts(Vector3::zeros().into(), UnitQuaternion::from_axis_angle(&axis, turn) * rod);
        let placed = [PlacedSolid { solid: Solid::Capsule(radius, half), link_from_solid: pose }];
        let (mass, com, j) = filled(&placed, 2000.0);
        let wrong = Matrix3::from_diagonal(&j.diagonal()) * 2.0 - j;
        let found = verdicts(&urdf(mass, com, &wrong, &placed));
        let named = kinds(&found[0]);
        // a rod at half a right angle is mirrored by exchanged axes too
        prop_assert!(named == [FindingKind::Mirrored] || named == [FindingKind::Swapped], "{found:?}");
        prop_assert!(verdicts(&urdf(mass, com, &j, &placed))[0].findings.is_empty());
    }

    #[test]
    fn other_units_are_named(solid in solid(), density in 300.0..5000.0, unit in 0..6_usize) {
        let placed = [at_origin(solid)];
        let (mass, com, j) = filled(&placed, density);
        let text = match unit {
            0 => urdf(mass, com, &(j * 1e9), &placed),
            1 => urdf(mass, com, &(j * 1e7), &placed),
            2 => urdf(mass, com, &(j * 1e6), &placed),
            3 => urdf(mass * 1e3, com, &(j * 1e9), &placed),
            4 => urdf(mass, com + Vector3::new(400.0, 0.0, 0.0), &j, &[at_origin(Solid::Box([0.4, 0.1, 0.1]))]),
            _ => urdf(mass * 1e3, com, &(j * 1e3), &placed),
        };
        // a body of 300 kg/m^3 with its mass in g is as dense as nothing, but three times only
        prop_assume!(unit != 5 || density > 100.0 * 1.01);
        let found = verdicts(&text);
        prop_assert_eq!(kinds(&found[0]), vec![FindingKind::Units], "{:?}", found);
    }
}

#[test]
fn a_cylinder_along_the_wrong_axis_is_named_although_any_mass_could_be_so() {
    let placed = [at_origin(Solid::Cylinder(0.05, 0.07))];
    let (mass, com, j) = filled(&placed, 1000.0);
    let wrong = Matrix3::from_diagonal(&Vector3::new(j.m33, j.m22, j.m11));
    let found = verdicts(&urdf(mass, com, &wrong, &placed));
    assert_eq!(kinds(&found[0]), [FindingKind::Swapped]);
    assert!(found[0].findings[0].message.contains("x and z exchanged"), "{found:?}");
    // as an engineer would have it who knows that the mass is not spread evenly
    let uneven = Matrix3::from_diagonal(&Vector3::new(j.m11 * 0.7, j.m22 * 1.1, j.m33 * 0.9));
    assert!(verdicts(&urdf(mass, com, &uneven, &placed))[0].findings.is_empty());
}

#[test]
fn a_tensor_about_the_origin_is_named() {
    let pose = Pose::translation(0.0, 0.0, 0.4);
    let placed = [PlacedSolid { solid: Solid::Box([0.05, 0.05, 0.2]), link_from_solid: pose }];
    let (mass, com, j) = filled(&placed, 1000.0);
    let about_origin = Body::about_com(mass, com, j).inertia_about_origin;
    assert_eq!(kinds(&verdicts(&urdf(mass, com, &about_origin, &placed))[0]), [FindingKind::AboutOrigin]);
}

#[test]
fn shapes_that_leave_out_a_part_of_the_link_accuse_nobody() {
    // a leg of 0.4 m of which the foot alone collides, and a head whose shape is a little too small
    let leg = Body::thin_rod(2.0, 0.4);
    let foot = PlacedSolid { solid: Solid::Ellipsoid([0.02; 3]), link_from_solid: Pose::translation(0.0, 0.0, -0.2) };
    let found = &verdicts(&urdf(2.0, Vector3::zeros(), &leg.inertia_about_com(), &[foot]))[0];
    assert!(!found.is_wrong(), "{found:?}");
    let head = Body::hollow_sphere(1.0, 0.1, 0.11);
    let found =
        &verdicts(&urdf(1.0, Vector3::zeros(), &head.inertia_about_com(), &[at_origin(Solid::Ellipsoid([0.09; 3]))]))
            [0];
    assert!(!found.is_wrong(), "{found:?}");
    // a sheet drawn without thickness, its products small: of the other sign they would be nearer to the drawing
    let sheet = Body::solid_box(3.0, [0.4, 0.3, 0.03]).inertia_about_com();
    let tilted = sheet + Matrix3::new(0.0, 0.001, 0.0, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0);
    let drawn = PlacedSolid {
        solid: Solid::Box([0.2, 0.15, 1e-5]),
        link_from_solid: Pose::new(Vector3::zeros(), Vector3::z() * 0.05),
    };
    let found = &verdicts(&urdf(3.0, Vector3::zeros(), &tilted, &[drawn]))[0];
    assert!(!found.is_wrong(), "{found:?}");
    // half a rod drawn: a note, for nothing explains it
    let half = PlacedSolid { solid: Solid::Cylinder(0.02, 0.1), link_from_solid: Pose::identity() };
    let found = &verdicts(&urdf(2.0, Vector3::zeros(), &(leg.inertia_about_com() * 4.0), &[half]))[0];
    assert!(!found.is_wrong() && found.findings[0].kind == FindingKind::OutsideShapes, "{found:?}");
}

#[test]
fn rounded_plates_are_told_to_be_rounded() {
    let plate = |izz: &str| {
        verdicts(&format!(
            "<robot name='r'><link name='l'><inertial><mass value='0.1'/><inertia ixx='0.00002' ixy='0' ixz='0' iyy='0.00002' iyz='0' izz='{izz}'/></inertial></link></robot>"
        ))
        .remove(0)
    };
    assert_eq!(plate("0.00004").physical, Some(true));
    let found = plate("0.00005");
    assert!(found.findings[0].message.ends_with("which the rounding of its digits may have done"), "{found:?}");
    let found = plate("0.00009");
    assert!(found.physical == Some(false) && !found.findings[0].message.contains("rounding"), "{found:?}");
}

#[test]
fn placeholders_are_named_where_shapes_or_other_links_tell() {
    let of = |mass: f64, value: f64, solids: &[PlacedSolid]| {
        kinds(&verdicts(&urdf(mass, Vector3::zeros(), &(Matrix3::identity() * value), solids))[0])
    };
    let small = [at_origin(Solid::Box([0.05, 0.05, 0.05]))];
    assert_eq!(of(1.0, 1.0, &[]), [FindingKind::Placeholder]);
    assert_eq!(of(0.3, 1e-2, &small), [FindingKind::Placeholder]);
    // a cube of 0.6 kg and 0.1 m has 0.001 kg m^2
    assert!(of(0.6, 1e-3, &small).is_empty() && of(3.0, 1e-2, &[]).is_empty());
    let link = |name: &str, mass: f64| {
        format!(
            "<link name='{name}'><inertial><mass value='{mass}'/><inertia ixx='0.001' ixy='0' ixz='0' iyy='0.001' iyz='0' izz='0.001'/></inertial></link>"
        )
    };
    let joint = "<joint name='j' type='revolute'><parent link='a'/><child link='b'/></joint>";
    let found = verdicts(&format!("<robot name='r'>{}{}{joint}</robot>", link("a", 1.0), link("b", 20.0)));
    assert!(found.iter().all(|verdict| kinds(verdict) == [FindingKind::Placeholder]), "{found:?}");
}

#[test]
fn who_moves_without_mass_is_named_once() {
    let body =
        "<inertial><mass value='1'/><inertia ixx='0.01' ixy='0' ixz='0' iyy='0.012' iyz='0' izz='0.013'/></inertial>";
    let joint = |parent: &str, child: &str, kind: &str| {
        format!("<joint name='{child}_joint' type='{kind}'><parent link='{parent}'/><child link='{child}'/></joint>")
    };
    let text = |kind: &str| {
        format!(
            "<robot name='r'><link name='a'>{body}</link><link name='b'/><link name='c'/><link name='d'>{body}</link>\
             <link name='camera'/>{}{}{}{}</robot>",
            joint("a", "b", kind),
            joint("b", "c", "revolute"),
            joint("a", "d", "revolute"),
            joint("d", "camera", "fixed")
        )
    };
    let found = verdicts(&text("revolute"));
    let named: Vec<bool> = found.iter().map(Verdict::is_wrong).collect();
    assert_eq!(named, [false, true, false, false, false], "{found:?}");
    // two joints with nothing between them make a planar one
    let between = format!(
        "<robot name='r'><link name='a'>{body}</link><link name='b'/><link name='c'>{body}</link>{}{}</robot>",
        joint("a", "b", "prismatic"),
        joint("b", "c", "prismatic")
    );
    assert!(verdicts(&between).iter().all(|verdict| !verdict.is_wrong()));
    // a model of shapes and joints alone
    let kinematic = format!("<robot name='r'><link name='a'/><link name='b'/>{}</robot>", joint("a", "b", "revolute"));
    assert!(verdicts(&kinematic).iter().all(|verdict| !verdict.is_wrong()));
}

/// One body of MuJoCo with this `<inertial>` and these geoms.
fn mjcf(compiler: &str, inertial: &str, geoms: &str) -> String {
    format!(
        "<mujoco model='m'><compiler {compiler}/><default><geom density='500'/><default class='seen'><geom contype='0' conaffinity='0'/></default></default>\n\
         <worldbody><body name='b' pos='0 0 1'><freejoint/>{inertial}{geoms}</body></worldbody></mujoco>"
    )
}

#[test]
fn mjcf_slips_are_named() {
    let geom = "<geom type='box' size='0.3 0.1 0.04' euler='20 30 40'/>";
    let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 20_f64.to_radians())
        * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 30_f64.to_radians())
        * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 40_f64.to_radians());
    let solid = Solid::Box([0.3, 0.1, 0.04]);
    let placed = PlacedSolid { solid, link_from_solid: Pose::from_parts(Vector3::zeros().into(), turn) };
    let (mass, _, j) = filled(&[placed], 1000.0);
    let full = |entries: [f64; 6]| {
        let words = entries.map(|entry| entry.to_string()).join(" ");
        format!("<inertial pos='0 0 0' mass='{mass}' fullinertia='{words}'/>")
    };
    let sound = [j.m11, j.m22, j.m33, j.m12, j.m13, j.m23];
    let found = verdicts(&mjcf("", &full(sound), geom));
    assert!(found[0].findings.is_empty(), "{found:?}");
    // as an URDF has them
    let found = verdicts(&mjcf("", &full([j.m11, j.m12, j.m13, j.m22, j.m23, j.m33]), geom));
    assert!(found[0].physical == Some(false), "{found:?}");
    assert!(found[0].findings[0].message.contains("in the order xx xy xz yy yz zz it could be"), "{found:?}");
    let found = verdicts(&mjcf("", &full([j.m11, j.m22, j.m33, j.m12, j.m23, j.m13]), geom));
    assert_eq!(kinds(&found[0]), [FindingKind::Order], "{found:?}");
    // angles meant in rad
    let geom_rad =
        "<geom type='box' size='0.3 0.1 0.04' euler='0.349065850398866 0.523598775598299 0.698131700797732'/>";
    let found = verdicts(&mjcf("angle='radian'", &full(sound), geom_rad));
    assert!(found[0].findings.is_empty(), "{found:?}");
    // the quaternion of a principal frame with its scalar last
    let (_, _, diagonal) = filled(&[at_origin(solid)], 1000.0);
    let [x, y, z, w]: [f64; 4] = turn.coords.into();
    let turned = |quat: String| {
        format!(
            "<inertial pos='0 0 0' quat='{quat}' mass='{mass}' diaginertia='{} {} {}'/>",
            diagonal.m11, diagonal.m22, diagonal.m33
        )
    };
    assert!(verdicts(&mjcf("", &turned(format!("{w} {x} {y} {z}")), geom))[0].findings.is_empty());
    let found = verdicts(&mjcf("", &turned(format!("{x} {y} {z} {w}")), geom));
    assert!(kinds(&found[0]) == [FindingKind::Axes], "{found:?}");
}

#[test]
fn mjcf_without_inertial_is_told_and_what_the_compiler_overrides_accuses_nobody() {
    let found = verdicts(&mjcf("", "", "<geom type='sphere' size='0.1'/>"));
    assert!(!found[0].is_wrong() && found[0].findings[0].kind == FindingKind::NotStated, "{found:?}");
    let found = verdicts(&mjcf("", "", ""));
    assert!(!found[0].is_wrong(), "a model without any mass is one of joints: {found:?}");
    let impossible = "<inertial pos='0 0 0' mass='1' diaginertia='1 1 9'/>";
    let found = verdicts(&mjcf("inertiafromgeom='true'", impossible, "<geom size='0.1'/>"));
    assert!(found[0].physical == Some(false) && !found[0].is_wrong(), "{found:?}");
    let found = verdicts(&mjcf("balanceinertia='true'", impossible, "<geom size='0.1'/>"));
    assert!(found[0].is_wrong() && found[0].findings[0].message.ends_with("makes all three equal"), "{found:?}");
    // seen, not hit: a mesh beside a box that is
    let geoms = "<geom type='box' size='0.1 0.1 0.4'/><geom class='seen' type='mesh' mesh='m'/>";
    let model = read(&mjcf("", "", geoms)).unwrap();
    assert!(model.links[0].visual.is_none() && model.links[0].collision.as_ref().is_some_and(|set| set.len() == 1));
}

#[test]
fn bad_models_say_where() {
    let place = |text: &str| read(text).unwrap_err().to_string();
    assert!(
        place("<robot name='a'>\n <link/></robot>").contains("line 2, column 2"),
        "{}",
        place("<robot name='a'>\n <link/></robot>")
    );
    for (text, word) in [
        ("<sdf/>", "`<robot>`"),
        ("<robot name='a'><link name='a'><inertial><mass value='nan'/></inertial></link></robot>", "finite"),
        ("<robot name='a'><link name='a'><inertial><mass value='1e999'/></inertial></link></robot>", "finite"),
        ("<robot name='a'><link name='a'><inertial/></link></robot>", "`<mass>` is missing"),
        ("<robot name='a'><link name='a'/><link name='a'/></robot>", "two links"),
        (
            "<robot name='a'><link name='a'/><joint name='j' type='fixed'><parent link='a'/><child link='b'/></joint></robot>",
            "no link `b`",
        ),
        ("<mujoco><worldbody><body><inertial mass='1'/></body></worldbody></mujoco>", "neither"),
        ("<mujoco><worldbody><body><geom size='1' class='big'/></body></worldbody></mujoco>", "`big`"),
        ("<mujoco/>", "no bodies"),
    ] {
        assert!(place(text).contains(word), "{}", place(text));
    }
    let deep = format!("<mujoco><worldbody>{}", "<body>".repeat(100_000))
        + &"</body>".repeat(100_000)
        + "</worldbody></mujoco>";
    assert!(place(&deep).contains("deep"));
    // a ring of joints is no tree, and no reason to hang
    let ring = "<robot name='a'><link name='a'/><link name='b'/><joint name='j' type='fixed'><parent link='a'/><child link='b'/></joint><joint name='k' type='fixed'><parent link='b'/><child link='a'/></joint></robot>";
    assert_eq!(verdicts(ring).len(), 2);
}
