//! `tumble check`, and `tumble identify --export` into a model.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::support::{json, number, scratch, stderr, tumble, tumble_in};
use std::fs;
use std::path::Path;
use tumble::robots::shipped;
use tumble_formats::arm::ArmModel;
use tumble_formats::body_file;
use tumble_formats::model::{Model, judge};

const SAMPLE: &str = include_str!("../../src/cli/sample_model.urdf");

/// Lines by number that differ.
fn changed_lines(before: &str, after: &str) -> Vec<usize> {
    assert_eq!(before.lines().count(), after.lines().count());
    (1..).zip(before.lines().zip(after.lines())).filter(|(_, (a, b))| a != b).map(|(line, _)| line).collect()
}

#[test]
fn the_slips_of_the_sample_are_named_and_what_cannot_be_is_repaired() {
    let folder = scratch("check");
    assert!(tumble_in(&folder, &["sample", "model"]).status.success());
    let output = tumble_in(&folder, &["check", "model.urdf", "--json", "--repair", "fixed.urdf"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    let found = json(&output);
    let of = |index: usize| {
        let link = &found["links"][index];
        let kinds: Vec<&str> =
            link["findings"].as_array().unwrap().iter().map(|finding| finding["kind"].as_str().unwrap()).collect();
        (link["link"].as_str().unwrap(), link["physical"].as_bool(), kinds)
    };
    assert_eq!(of(0), ("base", Some(true), vec![]));
    assert_eq!(of(1), ("upper_arm", Some(true), vec!["swapped"]));
    assert_eq!(of(2), ("forearm", Some(false), vec!["impossible"]));
    assert_eq!(of(3), ("wrist", Some(true), vec!["units"]));
    assert_eq!(of(4), ("camera", None, vec!["not-stated"]));
    assert_eq!(found["wrong"], 3);
    let change = number(&found["links"][2]["nearest"]["relative_change"]);
    assert!((0.01..0.2).contains(&change), "{change}");

    // the forearm alone is another, in the line of its inertia
    let fixed = fs::read_to_string(folder.join("fixed.urdf")).unwrap();
    let at = SAMPLE.lines().position(|line| line.contains("0.0306")).unwrap() + 1;
    assert_eq!(changed_lines(SAMPLE, &fixed), [at]);
    let output = tumble_in(&folder, &["check", "fixed.urdf"]);
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(table.contains("2 links of 5 have something wrong") && !table.contains("impossible"), "{table}");
    // nothing is lost
    let again = tumble_in(&folder, &["check", "model.urdf", "--repair", "fixed.urdf"]);
    assert!(again.status.code() == Some(2) && stderr(&again).contains("T010"), "{}", stderr(&again));
    assert_eq!(fs::read_to_string(folder.join("fixed.urdf")).unwrap(), fixed);
}

#[test]
fn the_arms_that_come_with_the_program_are_not_accused() {
    for arm in shipped().arms() {
        let model = ArmModel::find(arm.name, &shipped()).unwrap();
        let read = Model::parse(Path::new(arm.name), &model.to_urdf()).unwrap();
        for (link, verdict) in read.links.iter().zip(judge(&read)) {
            assert!(!verdict.is_wrong(), "{} {}: {verdict:?}", arm.name, link.name);
        }
    }
}

/// Links as people draw them: the numbers rounded, the shapes simple.
const SOUND: &str = include_str!("../sound_models/quadruped.urdf");
const SOUND_MJCF: &str = include_str!("../sound_models/hopper.xml");

#[test]
fn sound_models_are_not_accused() {
    let folder = scratch("sound");
    for (name, text) in [("quadruped.urdf", SOUND), ("hopper.xml", SOUND_MJCF)] {
        let path = folder.join(name);
        fs::write(&path, text).unwrap();
        let output = tumble(&["check", path.to_str().unwrap()]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    }
}

#[test]
fn what_is_no_model_is_an_error_with_its_place() {
    let folder = scratch("no-model");
    let path = folder.join("bad.urdf");
    fs::write(&path, "<robot name='a'>\n  <link name='b'><inertial><mass value='nan'/></inertial></link></robot>")
        .unwrap();
    let output = tumble(&["check", path.to_str().unwrap(), "--repair", folder.join("out.urdf").to_str().unwrap()]);
    let said = stderr(&output);
    assert!(output.status.code() == Some(2) && said.contains("T055") && said.contains("line 2, column 28"), "{said}");
    assert!(!folder.join("out.urdf").exists());
}

#[test]
fn a_body_goes_into_one_link_of_a_model_and_nothing_else_changes() {
    let folder = scratch("patch");
    fs::write(folder.join("arm.urdf"), SAMPLE).unwrap();
    fs::write(folder.join("one.urdf"), "<robot name=\"r\">\r\n\t<link name=\"cargo\"/>\r\n</robot>\r\n").unwrap();
    fs::write(
        folder.join("scene.xml"),
        "<mujoco>\n  <worldbody>\n    <body name=\"cargo\">\n      <geom size=\"0.1\"/>\n    </body>\n  </worldbody>\n</mujoco>\n",
    )
    .unwrap();
    assert!(tumble_in(&folder, &["sample", "log"]).status.success());
    let export = |out: &str, rest: &[&str]| {
        let arguments = [&["identify", "flight.csv", "--method", "variational4", "--export", out], rest].concat();
        tumble_in(&folder, &arguments)
    };
    let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap();
    assert!(export("body.toml", &[]).status.success());
    let body = body_file::read(&folder.join("body.toml")).unwrap();
    for (out, model, link) in
        [("a.urdf", "arm.urdf", Some("wrist")), ("b.urdf", "one.urdf", None), ("c.xml", "scene.xml", Some("cargo"))]
    {
        let mut rest = vec!["--patch", model];
        rest.extend(link.iter().flat_map(|link| ["--link", link]));
        let output = export(out, &rest);
        assert!(output.status.success(), "{}", stderr(&output));
        let patched = Model::parse(Path::new(out), &read(out)).unwrap();
        let name = link.unwrap_or("cargo");
        let found = patched.links.iter().find(|link| link.name == name).and_then(|link| link.inertial.clone()).unwrap();
        assert!((found.body().to_vector() - body.to_vector()).amax() < 1e-12);
        // what is in front of the element and behind it
        let (before, after) = (read(model), read(out));
        let start = after.find("<inertial").filter(|_| model != "arm.urdf").unwrap_or_else(|| {
            let link = after.find("\"wrist\"").unwrap();
            link + after[link..].find("<inertial").unwrap()
        });
        assert!(before.starts_with(after[..start].trim_end().trim_end_matches('>')), "{after}");
        let tail = if model == "one.urdf" { "\r\n</robot>\r\n" } else { &before[before.len() - 60..] };
        assert!(after.ends_with(tail), "{after}");
    }
    assert!(read("b.urdf").contains("<link name=\"cargo\">\r\n\t  <inertial>\r\n\t    <origin"), "{}", read("b.urdf"));
    for (rest, word) in [
        (&["--patch", "arm.urdf", "--link", "wrst"] as &[&str], "did you mean `wrist`?"),
        (&["--link", "wrist"], "belongs to `--patch`"),
    ] {
        let output = export("d.urdf", rest);
        assert!(output.status.code() == Some(2) && stderr(&output).contains(word), "{}", stderr(&output));
    }
    assert!(!folder.join("d.urdf").exists());
}

#[test]
fn a_payload_is_written_as_robots_take_it() {
    let folder = scratch("payload");
    let body = tumble_dynamics::InertialParameters::about_com(
        2.0,
        [0.1, -0.2, 0.3].into(),
        tumble_dynamics::nalgebra::Matrix3::new(0.2, 0.01, 0.02, 0.01, 0.25, 0.03, 0.02, 0.03, 0.3),
    );
    let lines = |name: &str| body_file::export(&folder.join(name), &body).unwrap();
    let line = lines("tool.script");
    let numbers: Vec<f64> = line
        .trim_start_matches("set_target_payload(")
        .split([',', '[', ']', ')'])
        .filter_map(|word| word.trim().parse().ok())
        .collect();
    for (found, expected) in numbers.iter().zip([2.0, 0.1, -0.2, 0.3, 0.2, 0.25, 0.3, 0.01, 0.02, 0.03]) {
        assert!((found - expected).abs() < 1e-12, "{line}");
    }
    assert!(numbers.len() == 10 && line.ends_with("])\n"), "{line}");
    let message = lines("inertia.yaml");
    let value = |key: &str| -> f64 {
        let line = message.lines().find(|line| line.trim_start().starts_with(&format!("{key}: "))).unwrap();
        line.split(": ").nth(1).unwrap().parse().unwrap()
    };
    assert!(
        (value("m") - 2.0).abs() < 1e-12 && (value("ixy") - 0.01).abs() < 1e-12 && (value("iyz") - 0.03).abs() < 1e-12,
        "{message}"
    );
    assert!(message.contains("com:\n  x: 0.1\n  y: -0.2\n  z: 0.3\n"), "{message}");
}

#[test]
fn every_line_of_the_page_about_models_ends_as_it_says() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/models.md");
    // a published package has no pages
    let Ok(page) = fs::read_to_string(page) else { return };
    let folder = scratch("models-page");
    let blocks = page.split("```console\n").skip(1).map(|block| block.split("```").next().unwrap());
    let mut ran = 0;
    for line in blocks.flat_map(str::lines).filter_map(|line| line.strip_prefix("tumble ")) {
        let (words, comment) = line.split_once('#').unwrap_or((line, ""));
        let expected = if comment.contains("exit code 3") { 3 } else { 0 };
        let output = tumble_in(&folder, &words.split_whitespace().collect::<Vec<_>>());
        assert_eq!(output.status.code(), Some(expected), "tumble {line}: {}", stderr(&output));
        ran += 1;
    }
    assert!(ran >= 8, "{ran}");
}
