//! `tumble identify --model`: logs of an arm's joints.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::support::{scratch, tumble};
use std::fmt::Write as _;

use nalgebra::{Matrix3, Vector3};
use tumble::demo;
use tumble::robots::shipped;
use tumble_dynamics::{InertialParameters, Multibody};
use tumble_formats::arm::ArmModel;
use tumble_identification::noise::Gaussian;
use tumble_lie::Wrench;

fn payload() -> InertialParameters<f64> {
    let inertia = Matrix3::new(0.020, 0.002, -0.001, 0.002, 0.030, 0.0015, -0.001, 0.0015, 0.025);
    InertialParameters::about_com(2.0, Vector3::new(-0.12, 0.03, 0.05), inertia)
}

fn log(tree: &Multibody<f64>, momentum: &Wrench<f64>, amplitude: f64) -> String {
    demo::arm::log(tree, momentum, amplitude, &mut Gaussian::from_seed(11)).unwrap()
}

fn carrying() -> Multibody<f64> {
    demo::arm::holding(&ArmModel::find("astrobee-arm", &shipped()).unwrap(), &payload())
}

fn tumbling() -> Wrench<f64> {
    Wrench::new(Vector3::new(0.02, -0.015, 0.02), Vector3::new(0.2, -0.1, 0.15))
}

#[test]
fn a_payload_from_the_momentum_of_a_floating_robot() {
    let folder = scratch("payload");
    let path = folder.join("grasped.csv");
    std::fs::write(&path, log(&carrying(), &tumbling(), 1.0)).unwrap();
    let out = folder.join("result");
    let log = path.to_str().unwrap();
    let options = ["--velocity-noise", "1e-4,1e-4,1e-5", "--momentum", "0.02,-0.015,0.02,0.2,-0.1,0.15"];
    let found = tumble(
        &[
            &["identify", log, "--model", "astrobee-arm", "--payload", "--json", "--out", out.to_str().unwrap()][..],
            &options,
        ]
        .concat(),
    );
    assert_eq!(found.status.code(), Some(0), "{}", String::from_utf8_lossy(&found.stderr));
    let object: serde_json::Value = serde_json::from_slice(&found.stdout).unwrap();
    assert_eq!((object["format"].as_u64(), object["rank"].as_u64()), (Some(1), Some(10)));
    let body = &object["bodies"][0];
    let (truth, mass, std) = (payload(), body["mass_kg"].as_f64().unwrap(), body["std"]["mass_kg"].as_f64().unwrap());
    assert!((mass / truth.mass - 1.0).abs() < 0.02 && (mass - truth.mass).abs() < 4.0 * std, "{mass} +- {std}");
    for k in 0..3 {
        let found = body["inertia_about_com_kg_m2"][k][k].as_f64().unwrap();
        assert!((found - truth.inertia_about_com()[(k, k)]).abs() < 0.02 * 0.03, "{body}");
    }
    for file in ["run.json", "result.json"] {
        assert!(out.join(file).is_file(), "{file}");
    }
    // the same for people
    let table = tumble(&[&["identify", log, "--model", "astrobee-arm", "--payload"][..], &options].concat());
    let text = String::from_utf8(table.stdout).unwrap();
    assert!(text.contains("10 of 10 unknowns determined") && text.contains("mass "), "{text}");
    assert!(text.contains("verdict: all ten parameters of the payload identified"), "{text}");
    // rates that the log states too large by a twentieth are no rates of this noise
    let mut rows = std::fs::read_to_string(&path).unwrap();
    let columns: Vec<&str> = rows.lines().next().unwrap().split(',').collect();
    let rates: Vec<usize> = (0..columns.len()).filter(|k| columns[*k].starts_with("qd")).collect();
    let scaled = |line: &str| {
        let cells = line.split(',').enumerate().map(|(k, cell)| match cell.parse::<f64>() {
            Ok(rate) if rates.contains(&k) => (1.05 * rate).to_string(),
            _ => cell.to_owned(),
        });
        cells.collect::<Vec<_>>().join(",")
    };
    rows = rows.lines().map(scaled).collect::<Vec<_>>().join("\n");
    std::fs::write(&path, rows).unwrap();
    let doubted =
        tumble(&[&["identify", log, "--model", "astrobee-arm", "--payload", "--json"][..], &options].concat());
    assert_eq!(doubted.status.code(), Some(3));
    let object: serde_json::Value = serde_json::from_slice(&doubted.stdout).unwrap();
    assert!(object["identified"] == false && object["doubt"].as_str().unwrap().contains("noise allows"), "{object}");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn joints_at_rest_do_not_tell_a_payload_from_the_robot() {
    let folder = scratch("still");
    let path = folder.join("still.csv");
    std::fs::write(&path, log(&carrying(), &Wrench::zero(), 0.0)).unwrap();
    let found = tumble(&[
        "identify",
        path.to_str().unwrap(),
        "--model",
        "astrobee-arm",
        "--payload",
        "--momentum",
        "zero",
        "--json",
    ]);
    assert_eq!(found.status.code(), Some(3), "{}", String::from_utf8_lossy(&found.stderr));
    let object: serde_json::Value = serde_json::from_slice(&found.stdout).unwrap();
    assert!(object["bodies"][0]["mass_kg"].is_null() && object["bodies"][0]["std"].is_null());
    assert!(object["identified"] == false && object["doubt"].is_null(), "{object}");
    assert!(!object["null_directions"].as_array().unwrap().is_empty());
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn what_does_not_fit_is_refused_with_its_reason() {
    let folder = scratch("refused");
    let path = folder.join("log.csv");
    std::fs::write(&path, "t_s,q1_rad,q2_rad\n0,0,0\n0.1,0,0\n").unwrap();
    let log = path.to_str().unwrap();
    let cases: [(&[&str], &str); 8] = [
        (&["identify", "--model", "astrobee-arm"], "needs a log"),
        (&["identify", log, "--model", "nobody"], "nobody"),
        (&["identify", log, "--model", "astrobee-arm"], "knows all bodies"),
        (&["identify", log, "--model", "astrobee-arm", "--payload"], "`p_x` is missing"),
        (&["identify", log, "--model", "ur10e"], "missing"),
        (&["identify", log, "--model", "astrobee-arm", "--payload", "--method", "rls"], "of an arm"),
        (&["identify", log, "--model", "astrobee-arm", "--unknown", "elbow"], "the arm has the bodies"),
        (&["identify", log, "--payload"], "--model"),
    ];
    for (arguments, reason) in cases {
        let found = tumble(arguments);
        let message = String::from_utf8(found.stderr).unwrap();
        assert_eq!(found.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(reason) && !message.contains("panicked"), "{arguments:?}: {message}");
        assert!(found.stdout.is_empty());
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_held_arm_that_stands_still_or_moves_for_a_moment_says_what_is_missing() {
    let folder = scratch("held");
    let model = folder.join("arm.toml");
    let joint = "kind = \"revolute\"\naxis = [0, 1, 0]\nposition_m = [0.3, 0, 0]\n\
        body = { mass_kg = 1, com_m = [0.1, 0, 0], inertia_about_com_kg_m2 = [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.01]] }\n";
    let text = format!(
        "format = 1\nname = \"held\"\nbase_kind = \"fixed\"\n[tool]\nlink = \"b\"\n[[joint]]\nname = \"a\"\nparent = \"base\"\n{joint}\
         [[joint]]\nname = \"b\"\nparent = \"a\"\n{joint}"
    );
    std::fs::write(&model, text).unwrap();
    let path = folder.join("log.csv");
    let identify = |rows: usize, more: &[&str]| {
        let mut text = "t_s,q1_rad,q2_rad,tau1_N_m,tau2_N_m\n".to_owned();
        for row in 0..rows {
            let _ = writeln!(text, "{:.2},0.1,0.2,-11,-3", 0.01 * row as f64);
        }
        std::fs::write(&path, text).unwrap();
        let arguments = ["identify", path.to_str().unwrap(), "--model", model.to_str().unwrap(), "--payload"];
        let found = tumble(&[&arguments[..], more].concat());
        (found.status.code(), String::from_utf8(found.stdout).unwrap() + &String::from_utf8_lossy(&found.stderr))
    };
    let (code, still) = identify(1000, &["--json"]);
    assert_eq!(code, Some(3), "{still}");
    let object: serde_json::Value = serde_json::from_str(still.trim()).unwrap();
    assert!(object["bodies"][0]["mass_kg"].is_null() && !object["null_directions"].as_array().unwrap().is_empty());
    let (code, brief) = identify(10, &[]);
    assert!(code == Some(2) && brief.contains("2 rows leave no residual") && brief.contains("more samples"), "{brief}");
    let (code, unused) = identify(1000, &["--momentum", "zero"]);
    assert!(code == Some(2) && unused.contains("momentum form only"), "{unused}");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_designed_motion_keeps_the_limits_of_the_model() {
    let folder = scratch("excite");
    let path = folder.join("motion.csv");
    let arguments =
        ["arm", "excite", "astrobee-arm", "--duration", "120", "--trials", "60", "--export", path.to_str().unwrap()];
    let found = tumble(&arguments);
    assert_eq!(found.status.code(), Some(0), "{}", String::from_utf8_lossy(&found.stderr));
    let text = String::from_utf8(found.stdout).unwrap();
    assert!(text.contains("base parameters shown        10"), "{text}");
    let table = std::fs::read_to_string(&path).unwrap();
    let mut lines = table.lines();
    assert_eq!(lines.next().unwrap(), "t_s,q1,q2,qd1,qd2,qdd1,qdd2");
    let mut fastest = 0.0_f64;
    for line in lines {
        let row: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        assert!((-2.0944..=1.571).contains(&row[1]) && row[2].abs() <= 1.571, "{line}");
        fastest = fastest.max(row[3].abs()).max(row[4].abs());
    }
    assert!(fastest <= 0.12 && fastest > 0.11, "{fastest}");
    assert_eq!(tumble(&arguments).status.code(), Some(2), "an existing file is kept");
    let embedded = tumble(&["arm", "excite", "ur10e", "--trials", "20"]);
    assert_eq!(embedded.status.code(), Some(0), "{}", String::from_utf8_lossy(&embedded.stderr));
    let unlimited = folder.join("unlimited.toml");
    let shown = String::from_utf8(tumble(&["arm", "show", "ur10e", "--as", "toml"]).stdout).unwrap();
    let without: Vec<&str> = shown.lines().filter(|line| !line.starts_with("rate = ")).collect();
    std::fs::write(&unlimited, without.join("\n")).unwrap();
    let found = tumble(&["arm", "excite", unlimited.to_str().unwrap()]);
    assert_eq!(found.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&found.stderr).contains("no limit of its rate"));
    std::fs::remove_dir_all(folder).unwrap();
}
