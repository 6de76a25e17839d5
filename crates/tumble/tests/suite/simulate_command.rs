//! `tumble simulate` and `tumble scenario` as a user meets them.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::support::page_checks::findings_of_any;
use crate::support::{json, scratch, stderr, tumble, tumble_in};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;
use tumble::TumbleError;
use tumble::scenario::{EMBEDDED, ScenarioSource};

fn shown(folder: &Path, name: &str) -> String {
    let output = tumble_in(folder, &["scenario", "show", name]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_flight_is_identified_by_the_step_that_is_named_next() {
    let folder = scratch("end-to-end");
    let output = tumble_in(&folder, &["simulate", "iss-excite", "--duration", "60"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let said = stderr(&output);
    let next = said.split("next: tumble ").nth(1).unwrap().trim();
    let words: Vec<&str> = next.split(' ').chain(["--json"]).collect();
    let found = json(&tumble_in(&folder, &words));
    assert_eq!(found["rank"], 10);
    let mass = found["mass_kg"].as_f64().unwrap();
    assert!((mass / 9.5838 - 1.0).abs() < 0.002, "{mass}");
    let inertia = found["inertia_about_com_kg_m2"][2][2].as_f64().unwrap();
    assert!((inertia / 0.1623 - 1.0).abs() < 0.005, "{inertia}");
    // The stated sigma is true: ten errors in units of it. Their mean square is outside this band for one seed in a thousand.
    let errors: Vec<f64> =
        found["reference"]["error_over_sigma"].as_array().unwrap().iter().map(|z| z.as_f64().unwrap()).collect();
    assert!(errors.len() == 10 && errors.iter().all(|z| z.abs() < 3.5), "{errors:?}");
    let mean_square = errors.iter().map(|z| z * z).sum::<f64>() / 10.0;
    assert!((0.1..3.2).contains(&mean_square), "{mean_square}");
    // What is kept back is judged by the model of these sensors, too: of ten numbers chance makes 0.46 to 1.59 in 99 of 100 cases.
    let held = json(&tumble_in(&folder, &[&words[..], &["--holdout"]].concat()));
    let apart = held["holdout"]["normalised_rms"].as_f64().unwrap();
    assert!((0.3..2.0).contains(&apart) && held["holdout"]["explained"].is_null(), "{held}");
    let paged = tumble_in(&folder, &[&words[..], &["--out", "report"]].concat());
    assert_eq!(paged.status.code(), Some(0), "{}", stderr(&paged));
    let page = fs::read_to_string(folder.join("report/report.html")).unwrap();
    assert!(page.contains("times as far apart as their σ predict"), "the page compares the two parts");
}

/// Rates that are averaged and filtered to a quarter of a second, which nobody tells: held in its place a robot moves so fast that their gain matters.
#[test]
fn a_filter_that_nobody_describes_is_in_the_sigma_of_the_inertia() {
    let folder = scratch("undescribed");
    let output =
        tumble_in(&folder, &["simulate", "iss-hold", "--sensing", "bumble", "--seed", "78001", "--out", "held"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let found = json(&tumble_in(&folder, &["identify", "held/log.csv", "--reference", "held/truth.toml", "--json"]));
    let errors = found["reference"]["error_over_sigma"].as_array().unwrap();
    let errors: Vec<f64> = errors.iter().map(|z| z.as_f64().unwrap().abs()).collect();
    assert!(errors[4..7].iter().all(|z| *z < 3.0) && errors.iter().all(|z| *z < 5.0), "{errors:?}");
    let relative = |value: &Value| value[0][0].as_f64().unwrap();
    assert!(relative(&found["std"]["inertia_about_com_kg_m2"]) < 0.02 * relative(&found["inertia_about_com_kg_m2"]));
}

/// Thrusts that are off by a percent look like another centre of mass where a mission pushes one way only: what is stated allows for it.
#[test]
fn a_mission_on_a_table_states_what_its_thrusts_may_hide() {
    let folder = scratch("hidden-thrusts");
    for seed in ["1", "6"] {
        let output = tumble_in(&folder, &["simulate", "granite-cargo", "--seed", seed, "--out", seed]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let found = json(&tumble_in(&folder, &["identify", &format!("{seed}/log.csv"), "--json"]));
        assert_eq!(found["planar"], true);
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
        let of =
            |value: &serde_json::Value, sigma: &serde_json::Value, truth: f64| (number(value) - truth) / number(sigma);
        let (center, std) = (&found["com_m"], &found["std"]);
        for (what, errors) in [
            ("mass", of(&found["mass_kg"], &std["mass_kg"], 24.97)),
            ("x", of(&center[0], &std["com_m"][0], 0.024_027)),
            ("y", of(&center[1], &std["com_m"][1], -0.024_027)),
        ] {
            println!("seed {seed}, {what}: {errors:.2} sigma");
            assert!(errors.abs() < 3.0, "seed {seed}, {what}: {errors}");
        }
        assert!(number(&std["com_m"][1]) < 2e-3, "{found}");
    }
}

/// A robot that hardly moves tells little of how late its poses are: the search must neither swing nor take its rates for noise (seeds that did).
#[test]
fn a_mission_on_the_station_is_identified_from_its_slow_motion() {
    let folder = scratch("slow-motion");
    for seed in ["4", "16"] {
        let output = tumble_in(&folder, &["simulate", "iss-cargo", "--seed", seed, "--out", seed]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let output = tumble_in(&folder, &["identify", &format!("{seed}/log.csv"), "--json"]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let found = json(&output);
        let (mass, sigma) = (found["mass_kg"].as_f64().unwrap(), found["std"]["mass_kg"].as_f64().unwrap());
        println!("seed {seed}: {mass} +- {sigma} kg");
        assert!((mass - 12.584).abs() < 3.0 * sigma && sigma < 0.05 * mass, "seed {seed}: {mass} +- {sigma}");
    }
    // Of seed 16 a fifth of the wrench answers to noise, of this one a third.
    let output = tumble_in(&folder, &["simulate", "tube-hold", "--seed", "4", "--out", "held"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let output = tumble_in(&folder, &["identify", "held/log.csv"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("the controller's answer to the noise"), "{}", stderr(&output));
}

/// A controller is told velocities that a log of poses and rates leaves out. What is left moves as little as the poses wander: masses are up to half too
/// small beside a sigma of a seventh.
#[test]
fn a_body_that_is_held_still_is_not_weighed_by_its_poses() {
    let folder = scratch("held-still");
    let flight = ["simulate", "tube-hold", "--sensing", "nominal", "--seed", "7201", "--out", "flight"];
    let output = tumble_in(&folder, &flight);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = fs::read_to_string(folder.join("flight/log.csv")).unwrap();
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let left_out = |names_from: &[&str]| {
        let kept: Vec<usize> =
            (0..names.len()).filter(|&at| !names_from.iter().any(|from| names[at].starts_with(from))).collect();
        let rows = text.lines().map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            kept.iter().map(|&at| cells[at]).collect::<Vec<_>>().join(",")
        });
        fs::write(folder.join("less.csv"), rows.collect::<Vec<_>>().join("\n")).unwrap();
        tumble_in(&folder, &["identify", "less.csv"])
    };
    let poses = left_out(&["v_", "a_"]);
    assert_eq!(poses.status.code(), Some(3), "{}", stderr(&poses));
    let said = String::from_utf8(poses.stdout).unwrap();
    assert!(said.contains("a controller holds the body so still"), "{said}");
    // What the controller is told makes up for it.
    let velocities = left_out(&["a_"]);
    assert_eq!(velocities.status.code(), Some(0), "{}", stderr(&velocities));
}

#[test]
fn an_ideal_flight_is_identified_exactly() {
    let folder = scratch("ideal");
    let text = shown(&folder, "iss-excite");
    let text = text.split("[sensing").next().unwrap().to_owned()
        + "[propulsion]\nkind = \"exact\"\n\n[sensing]\npreset = \"perfect\"\n";
    fs::write(folder.join("ideal.toml"), text).unwrap();
    let output = tumble_in(&folder, &["simulate", "ideal.toml", "--duration", "40", "--out", "flight"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let words = ["identify", "flight/log.csv", "--reference", "flight/truth.toml", "--json"];
    let found = json(&tumble_in(&folder, &words));
    assert!((found["mass_kg"].as_f64().unwrap() / 9.583_788_668 - 1.0).abs() < 1e-6, "{found}");
    for (axis, expected) in [0.003_713_818, -0.000_326_347, -0.002_532_192].into_iter().enumerate() {
        assert!((found["com_m"][axis].as_f64().unwrap() - expected).abs() < 1e-7, "{found}");
    }
}

#[test]
fn the_same_seed_gives_the_same_files_and_a_folder_is_not_replaced_unasked() {
    let folder = scratch("seed");
    let fly = |seed: &str| {
        let output = tumble_in(&folder, &["simulate", "iss-slalom", "--duration", "4", "--seed", seed, "--json"]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        folder.join(json(&output)["folder"].as_str().unwrap())
    };
    let (first, second, other) = (fly("5"), fly("5"), fly("6"));
    assert!(first.ends_with("tumble-out/simulate-iss-slalom-5") && second.ends_with("simulate-iss-slalom-5-2"));
    for name in [
        "log.csv",
        "scenario.toml",
        "truth.toml",
        "summary.json",
        "run.json",
        "path_xy.svg",
        "force_x.svg",
        "report.html",
    ] {
        let bytes = fs::read(first.join(name)).unwrap();
        assert_eq!(bytes, fs::read(second.join(name)).unwrap(), "{name}");
    }
    assert_ne!(fs::read(first.join("log.csv")).unwrap(), fs::read(other.join("log.csv")).unwrap());
    assert!(first.join("timings.json").exists());
    assert_eq!(findings_of_any(&fs::read_to_string(first.join("report.html")).unwrap()), [""; 0]);
    // What was written can be flown again.
    let again = ["simulate", "tumble-out/simulate-iss-slalom-5/scenario.toml", "--out", "again"];
    assert_eq!(tumble_in(&folder, &again).status.code(), Some(0));
    assert_eq!(fs::read(first.join("log.csv")).unwrap(), fs::read(folder.join("again/log.csv")).unwrap());
    let refused = tumble_in(&folder, &again);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("T010"));
    assert_eq!(tumble_in(&folder, &[again.as_slice(), &["--force"]].concat()).status.code(), Some(0));
}

#[test]
fn embedded_scenarios_are_listed_and_shown() {
    let folder = scratch("list");
    let listed = String::from_utf8(tumble_in(&folder, &["scenario", "list"]).stdout).unwrap();
    assert!(listed.lines().count() >= 8);
    for line in listed.lines() {
        let name = line.split_whitespace().next().unwrap();
        assert!(shown(&folder, name).contains(&format!("name = \"{name}\"")));
    }
    let unknown = tumble_in(&folder, &["scenario", "show", "iss-hodl"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(stderr(&unknown).contains("did you mean `iss-hold`?"), "{}", stderr(&unknown));
}

#[test]
fn events_of_a_flight_through_an_obstacle_are_reported() {
    let folder = scratch("events");
    let text = "format = 1\nname = \"crash\"\nworld = \"granite\"\nduration_s = 8\n[start]\npoint = \"start\"\nvelocity_m_s = [0.2, 0, 0]\n\
                [drive]\ncontroller = \"none\"\n[[obstacles]]\ncenter_m = [0.5, 0, -0.7]\nsemi_axes_m = [0.1, 0.1, 0.1]\n";
    fs::write(folder.join("crash.toml"), text).unwrap();
    let output = tumble_in(&folder, &["simulate", "crash.toml", "--json"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("not as it should be: hit obstacle 0 at 1.264 s (3 such events)"));
    let found = json(&output);
    let events: Vec<&str> =
        found["events"].as_array().unwrap().iter().map(|event| event["event"].as_str().unwrap()).collect();
    let expected = ["hit obstacle 0", "left the table", "clear of obstacles", "left the keep-in volume"];
    assert_eq!(events, expected);
    assert_eq!(found["degrees_of_freedom"], 3);
    // The same flight ends in time.
    let output = tumble_in(&folder, &["simulate", "crash.toml", "--duration", "1"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

#[test]
fn a_duration_that_cannot_be_flown_is_refused_before_anything_is_written() {
    let folder = scratch("duration");
    for duration in ["0", "-1", "0.01", "86400.1", "1e300", "nan", "inf"] {
        let output = tumble_in(&folder, &["simulate", "iss-hold", "--duration", duration]);
        assert_eq!(output.status.code(), Some(2), "{duration}");
        let said = stderr(&output);
        assert!(said.contains("error[T014]: `--duration ") && said.contains("at most 86400 s"), "{said}");
    }
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 0);
}

const STILL: &str = "format = 1\nname = \"still\"\nworld = \"iss\"\nduration_s = 1.0\n[start]\npoint = \"A\"\n";

#[test]
fn a_log_without_rows_is_not_achieved() {
    let folder = scratch("no-rows");
    fs::write(folder.join("lost.toml"), format!("{STILL}[sensing.settings.faults]\ndrop_probability = 1.0\n")).unwrap();
    let output = tumble_in(&folder, &["simulate", "lost.toml", "--out", "lost/"]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("the log holds no row") && !said.contains("next:") && !said.contains("//"), "{said}");
}

#[test]
fn a_rounded_duration_is_said() {
    let folder = scratch("rounded");
    fs::write(folder.join("still.toml"), STILL).unwrap();
    fs::create_dir(folder.join("x")).unwrap();
    let output = tumble_in(&folder, &["simulate", "still.toml", "--out", "x/", "--force"]);
    let (out, said) = (String::from_utf8_lossy(&output.stdout), stderr(&output));
    assert!(output.status.success(), "{said}");
    assert!(out.contains("1.008 s") && out.contains("asked for 1 s"), "{out}");
    assert!(said.contains("wrote x; next: tumble identify x/log.csv"), "{said}");
    let summary: Value = serde_json::from_str(&fs::read_to_string(folder.join("x/summary.json")).unwrap()).unwrap();
    assert_eq!(
        (summary["duration_s"].to_string(), summary["duration_asked_s"].to_string()),
        ("1.008".into(), "1.0".into())
    );
}

#[test]
fn what_cannot_be_computed_names_the_keys() {
    let folder = scratch("absurd");
    let body = |mass: &str, inertia: &str| {
        format!(
            "{STILL}[body]\nmass_kg = {mass}\ninertia_about_com_kg_m2 = [[{inertia}, 0, 0], [0, {inertia}, 0], [0, 0, {inertia}]]\n"
        )
    };
    let strong =
        "[drive]\ncontroller = \"none\"\n[drive.constant]\ntorque_n_m = [1e3, 0, 0]\n[propulsion]\nkind = \"exact\"\n";
    for (text, code) in [
        (format!("{}{strong}", body("9.0", "0.1")), "T027"),
        (body("1e-300", "1e-300"), "T02"),
        (body("1e300", "1e300"), "T02"),
    ] {
        fs::write(folder.join("bad.toml"), &text).unwrap();
        let output = tumble_in(&folder, &["simulate", "bad.toml", "--out", "x"]);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{text}: {said}");
        assert!(said.contains(&format!("error[{code}")) && said.contains("body"), "{text}: {said}");
    }
}

#[test]
fn endless_scenarios_and_crowds_are_refused() {
    let folder = scratch("endless");
    for command in [&["simulate", "/dev/zero"][..], &["scenario", "show", "/dev/zero"]] {
        let output = tumble_in(&folder, command);
        assert_eq!(output.status.code(), Some(2), "{command:?}: {}", stderr(&output));
    }
    let crowd = "[[obstacles]]\ncenter_m = [0, 0, 0]\nsemi_axes_m = [1, 1, 1]\n".repeat(1001);
    let way = "[[drive.waypoints]]\ntime_s = 1\npoint = \"A\"\n".repeat(10_001);
    for (text, says) in [
        (format!("{STILL}{crowd}"), "`obstacles`: 1001: at most 1000"),
        (format!("{STILL}{}", way.repeat(3)), "longer than 1048576 bytes"),
    ] {
        fs::write(folder.join("many.toml"), text).unwrap();
        let said = stderr(&tumble_in(&folder, &["simulate", "many.toml"]));
        assert!(said.contains(says), "{said}");
    }
}

/// A row of an MCAP file: topic, time, content.
fn messages(path: &Path) -> Vec<(String, u64, Vec<u8>)> {
    let bytes = tumble_formats::testing::unpacked_mcap(&fs::read(path).unwrap());
    let message = |message: Result<mcap::Message<'_>, mcap::McapError>| {
        let message = message.unwrap();
        (message.channel.topic.clone(), message.log_time, message.data.into_owned())
    };
    mcap::MessageStream::new(&bytes).unwrap().map(message).collect()
}

#[test]
fn the_mcap_log_is_the_converted_csv_and_the_world() {
    let folder = scratch("mcap");
    let output = tumble_in(&folder, &["simulate", "iss-slalom", "--duration", "3", "--mcap", "--out", "flight"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(tumble_in(&folder, &["convert", "flight/log.csv", "again.mcap"]).status.success());
    let mut written = messages(&folder.join("flight/log.mcap"));
    let (topic, time, scene) = written.remove(0);
    let (described, ..) = written.remove(0);
    assert_eq!(described, "/robot_description");
    assert_eq!(written, messages(&folder.join("again.mcap")));
    assert!(written.len() > 1000 && written.iter().all(|(topic, ..)| topic != "/world"));

    assert_eq!((topic.as_str(), time), ("/world", 0));
    let scene: Value = serde_json::from_slice(&scene).unwrap();
    let world = ScenarioSource::find("iss-slalom").unwrap().flight().unwrap().world;
    let part = |entity: usize, solids: &str| scene["entities"][entity][solids].as_array().unwrap().clone();
    let vector = |value: &Value| ["x", "y", "z"].map(|axis| value[axis].as_f64().unwrap());
    for (boxes, drawn) in [(&world.keep_in, part(0, "cubes")), (&world.keep_out, part(1, "cubes"))] {
        assert!(!boxes.is_empty() && boxes.len() == drawn.len());
        for (volume, cube) in boxes.iter().zip(drawn) {
            let (center, size) = (vector(&cube["pose"]["position"]), vector(&cube["size"]));
            for axis in 0..3 {
                assert!((center[axis] - 0.5 * size[axis] - volume.lower_world[axis]).abs() < 1e-12);
                assert!((center[axis] + 0.5 * size[axis] - volume.upper_world[axis]).abs() < 1e-12);
            }
        }
    }
    let drawn = part(2, "spheres");
    assert!(!drawn.is_empty() && drawn.len() == world.obstacles.len());
    for (obstacle, sphere) in world.obstacles.iter().zip(drawn) {
        let (center, size) = (vector(&sphere["pose"]["position"]), vector(&sphere["size"]));
        let expected = obstacle.world_from_ellipsoid.translation.vector;
        assert!((0..3).all(|axis| center[axis].to_bits() == expected[axis].to_bits()));
        assert!((0..3).all(|axis| size[axis].to_bits() == (2.0 * obstacle.semi_axes[axis]).to_bits()));
    }
}

/// The URDF in the log is of a robot that can be, and weighs what the simulated one and its payload do.
#[test]
fn the_mcap_log_describes_the_robot_and_what_it_holds() {
    let folder = scratch("described");
    let output = tumble_in(&folder, &["simulate", "iss-cargo", "--duration", "1", "--mcap", "--out", "flight"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let messages = messages(&folder.join("flight/log.mcap"));
    let described: Vec<_> = messages.iter().filter(|(topic, ..)| topic == "/robot_description").collect();
    let [(_, 0, message)] = described[..] else { panic!("{} descriptions", described.len()) };
    let message: Value = serde_json::from_slice(message).unwrap();
    let urdf = message["data"].as_str().unwrap();
    fs::write(folder.join("robot.urdf"), urdf).unwrap();
    assert_eq!(tumble_in(&folder, &["check", "robot.urdf"]).status.code(), Some(0), "{urdf}");
    let mut flight = ScenarioSource::find("iss-cargo").unwrap().flight().unwrap();
    flight.step().unwrap();
    let masses =
        urdf.split("<mass value=\"").skip(1).map(|rest| rest.split('"').next().unwrap().parse::<f64>().unwrap());
    assert!((masses.sum::<f64>() - flight.simulator.body().mass).abs() < 1e-12, "{urdf}");
    assert!(urdf.contains("<joint name=\"grasp\" type=\"fixed\">") && urdf.matches("<box size=").count() == 2);
}

#[test]
fn flights_of_other_robots_are_identified_from_either_log() {
    let folder = scratch("robots");
    for (scenario, mass_kg, inertia_xx) in
        [("spheres-excite", 4.3, 0.112 * 0.0965 / 0.48), ("space-cobot-excite", 8.047, 0.062_814_6)]
    {
        let output = tumble_in(&folder, &["simulate", scenario, "--duration", "60", "--mcap", "--out", scenario]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let identified = |log: &str| json(&tumble_in(&folder, &["identify", &format!("{scenario}/{log}"), "--json"]));
        let (from_csv, from_mcap) = (identified("log.csv"), identified("log.mcap"));
        assert_eq!(from_csv["rank"], 10);
        for (pointer, truth) in [("/mass_kg", mass_kg), ("/inertia_about_com_kg_m2/0/0", inertia_xx)] {
            let number = |found: &Value, at: &str| found.pointer(at).and_then(Value::as_f64).unwrap();
            let (estimate, sigma) = (number(&from_csv, pointer), number(&from_csv, &format!("/std{pointer}")));
            assert!((estimate - truth).abs() < 4.0 * sigma, "{scenario}{pointer}: {estimate} +- {sigma}, not {truth}");
            assert!(sigma < 0.003 * truth, "{scenario}{pointer}: {sigma}");
            assert!((number(&from_mcap, pointer) / estimate - 1.0).abs() < 1e-9, "{scenario}{pointer}");
        }
    }
}

#[test]
fn what_is_wrong_is_named_with_its_line() {
    let good = "format = 1\nname = \"x\"\nworld = \"iss\"\nduration_s = 10.0\n\n[body]\nmass_kg = 9.0\n\
                inertia_about_com_kg_m2 = [[0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]\n\n[start]\nposition_m = [10.9, -6.65, 4.9]\n\
                quaternion_xyzw = [0, 0, 0, 1]\n\n[drive]\ncontroller = \"flown\"\n";
    ScenarioSource::parse(Path::new("good.toml"), good).unwrap().flight().unwrap();
    for (from, to, place, expected) in [
        ("duration_s", "durration_s", "line 4, column 1", "did you mean `duration_s`?"),
        ("format = 1", "format = 2", "line 1, column 1", "2"),
        ("10.0", "-1.0", "line 4", "-1"),
        ("10.0", "1e9", "line 4", "at most 86400"),
        ("10.0", "nan", "line 4", "duration_s"),
        ("mass_kg = 9.0", "mass_kg = -9.0", "line 7", "no body has these parameters"),
        ("mass_kg = 9.0", "masss_kg = 9.0", "line 7", "did you mean `mass_kg`?"),
        ("-6.65", "-20.0", "line 10", "keep-in"),
        ("-6.65, 4.9", "-6.65, inf", "line 11", "finite"),
        ("[0, 0, 0, 1]", "[0, 0, 0.5, 1]", "line 12", "norm 1.118034"),
        ("\"flown\"", "\"flow\"", "line 15, column 14", "did you mean `flown`?"),
        ("\"iss\"", "\"isss\"", "line 3", "did you mean `iss`?"),
        ("\"x\"", "\"../x\"", "line 2", "folder"),
        ("world = \"iss\"", "world = \"iss\"\nobstacle_set = 9", "line 4", "sets 0 to 4"),
        ("\"iss\"", "\"i\\u001b[31ms\\ns\"", "line 3", "`i\u{fffd}[31ms s` is none of"),
        ("\"flown\"", "\"flown\"\n[sensing.settings.imu]\nsample_interval_ms = 9", "line 17, column 1", "it must be 8"),
        (
            "\"flown\"",
            "\"tracker\"\n[propulsion]\nkind = \"spheres\"\nsupply_v = 12",
            "line 18",
            "only with `kind = \"plant\"`",
        ),
    ] {
        assert!(good.contains(from), "{from}");
        let text = good.replacen(from, to, 1);
        let outcome =
            ScenarioSource::parse(Path::new("bad.toml"), &text).and_then(|source| source.flight().map(|_| ()));
        let message = outcome.err().unwrap_or_else(|| panic!("accepted: {to}")).to_string();
        assert!(message.contains(place) && message.contains(expected), "{to}: {message}");
    }
    let inside = good.replacen("duration_s = 10.0\n", "duration_s = 10.0\nobstacle_set = 1\n", 1).replacen(
        "[10.9, -6.65, 4.9]",
        "[10.3, -8.4, 4.9]",
        1,
    );
    let outcome = ScenarioSource::parse(Path::new("bad.toml"), &inside).and_then(|source| source.flight().map(|_| ()));
    assert!(outcome.unwrap_err().to_string().contains("inside obstacle 0"));
}

/// The table names in the text and the fields that the parser lists for each.
#[test]
fn every_key_is_documented() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scenarios.md");
    // The published package comes without the documents of the repository.
    let Ok(documented) = fs::read_to_string(path) else { return };
    let head = "format = 1\nname = \"x\"\nworld = \"open\"\nduration_s = 1\n";
    let start = "[start]\nposition_m = [0, 0, 0]\n";
    let mut keys = 0;
    for text in [
        format!("{head}zzz = 1\n{start}"),
        format!("{head}{start}zzz = 1\n"),
        format!("{head}{start}[body]\nzzz = 1\n"),
        format!("{head}{start}[payload]\nzzz = 1\n"),
        format!("{head}{start}[goal]\nzzz = 1\n"),
        format!("{head}{start}[drive]\nzzz = 1\n"),
        format!("{head}{start}[drive.constant]\nzzz = 1\n"),
        format!("{head}{start}[drive.multisine]\nzzz = 1\n"),
        format!("{head}{start}[[drive.waypoints]]\nzzz = 1\n"),
        format!("{head}{start}[drive.control]\nzzz = 1\n"),
        format!("{head}{start}[[drive.beliefs]]\nzzz = 1\n"),
        format!("{head}{start}[propulsion]\nzzz = 1\n"),
        format!("{head}{start}[sensing]\nzzz = 1\n"),
        format!("{head}{start}[limits]\nzzz = 1\n"),
        format!("{head}{start}[[obstacles]]\nzzz = 1\n"),
        format!("{head}{start}[[keep_out]]\nzzz = 1\n"),
        format!("{head}{start}[plan]\nzzz = 1\n"),
        format!("{head}{start}[[plan.body]]\nzzz = 1\n"),
    ] {
        let message = ScenarioSource::parse(Path::new("x"), &text).unwrap_err().to_string();
        let (_, listed) = message.split_once("expected ").expect(&message);
        for key in listed.split('`').skip(1).step_by(2) {
            let named = [format!("`{key}`"), format!("[{key}]"), format!(".{key}]"), format!("`{key} ")];
            assert!(named.iter().any(|name| documented.contains(name.as_str())), "{key} is not in docs/scenarios.md");
            keys += 1;
        }
    }
    assert!(keys > 50, "{keys}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_an_error_and_a_closed_pipe_is_none() {
    for arguments in [&[][..], &["--help"], &["--version"], &["help", "convert"], &["scenario", "list"]] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_tumble")).args(arguments).stdout(full).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(stderr(&output).contains("error[T011]: cannot write standard output"), "{}", stderr(&output));
        let mut child = Command::new(env!("CARGO_BIN_EXE_tumble"))
            .args(arguments)
            .stdout(closed_pipe())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = String::new();
        std::io::Read::read_to_string(child.stderr.as_mut().unwrap(), &mut said).unwrap();
        assert!(
            child.wait().unwrap().success() && !said.contains("error") && !said.contains("panic"),
            "{arguments:?}: {said}"
        );
    }
    let output = tumble_in(Path::new("."), &["--nonsense"]);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{}", stderr(&output));
}

/// The writing end of a pipe that nobody reads.
fn closed_pipe() -> std::io::PipeWriter {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer
}

#[test]
#[cfg(target_os = "linux")]
fn work_goes_on_where_nobody_hears_of_it() {
    let folder = scratch("unheard");
    let template = tumble(&["identify", "--template"]);
    std::fs::write(folder.join("short.csv"), &template.stdout).unwrap();
    std::fs::write(folder.join("wrenches.csv"), "force_x,force_y,force_z,torque_x,torque_y,torque_z\n").unwrap();
    for (k, arguments) in [
        &["identify", "--demo", "--json", "--out", "report"][..],
        &["identify", "short.csv"],
        &["identify", "missing.csv"],
        &["convert", "short.csv", "short.tum"],
        &["convert", "short.csv", "short.tum"],
        &["arm", "show", "nobody"],
        &["allocate", "wrenches.csv"],
        &["campaign", "iss-cargo", "--missions", "0"],
    ]
    .into_iter()
    .enumerate()
    {
        let said = |name: &str, error: std::process::Stdio| {
            let place = folder.join(format!("{name}-{}", k.min(4)));
            std::fs::create_dir_all(&place).unwrap();
            for file in ["short.csv", "wrenches.csv"] {
                std::fs::copy(folder.join(file), place.join(file)).unwrap();
            }
            let program = Command::new(env!("CARGO_BIN_EXE_tumble"))
                .args(arguments)
                .current_dir(&place)
                .stdout(std::process::Stdio::piped())
                .stderr(error)
                .spawn();
            let output = program.unwrap().wait_with_output().unwrap();
            (output.status.code(), output.stdout)
        };
        let heard = said("heard", std::process::Stdio::null());
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        assert_eq!(said("full", full.into()), heard, "{arguments:?}");
        assert_eq!(said("closed", closed_pipe().into()), heard, "{arguments:?}");
    }
    assert!(folder.join("closed-0").join("report").join("result.json").exists());
}

/// Every array of numbers of every scenario, one number or row longer; weights are as many as one likes.
#[test]
fn arrays_that_are_too_long_are_refused_where_they_stand() {
    let mut refused = 0;
    for scenario in EMBEDDED {
        let lines: Vec<&str> = scenario.text.lines().collect();
        for (number, line) in lines.iter().enumerate() {
            let Some((key, array)) = line.split_once(" = [").filter(|(key, _)| !key.contains('#') && *key != "weights")
            else {
                continue;
            };
            let is_of_numbers =
                array.split(['[', ']', ',']).all(|cell| cell.trim().parse::<f64>().is_ok() || cell.trim().is_empty());
            if !is_of_numbers {
                continue;
            }
            let longer = match array.strip_prefix('[') {
                None => format!("{key} = [1.0, {array}"),
                Some(rows) if number % 2 == 0 => format!("{key} = [[1.0, {rows}"),
                Some(rows) => format!("{key} = [[1.0, 0.0, 0.0], [{rows}"),
            };
            let text = [&lines[..number], &[longer.as_str()], &lines[number + 1..]].concat().join("\n");
            let Err(TumbleError::BadScenario { line, message, .. }) = ScenarioSource::parse(Path::new("x"), &text)
            else {
                panic!("{}: {longer}", scenario.name);
            };
            assert_eq!(line, number + 1, "{}: {message}", scenario.name);
            assert!(message.contains(key.trim()) && message.contains("would be read"), "{message}");
            refused += 1;
        }
    }
    assert!(refused > 100, "{refused}");
}

#[test]
fn no_command_takes_a_payload_that_cannot_be() {
    let folder = scratch("no-payload");
    let inertia = "[[0.015, 0.0, 0.0], [0.0, 0.012, 0.0], [0.0, 0.0, 0.018]]";
    for (sound, impossible, named) in [
        ("mass_kg = 3.0", "mass_kg = -3.0", "mass"),
        ("mass_kg = 3.0", "mass_kg = nan", "mass"),
        (inertia, "[[0.1, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]]", "inertia"),
    ] {
        let text = shown(&folder, "iss-cargo");
        assert!(text.contains(sound));
        fs::write(folder.join("a.toml"), text.replace(sound, impossible)).unwrap();
        for command in ["plan", "simulate", "fly"] {
            let output = tumble_in(&folder, &[command, "a.toml"]);
            assert_eq!(output.status.code(), Some(2), "{command} {impossible}: {}", stderr(&output));
            assert!(stderr(&output).contains(named), "{command} {impossible}: {}", stderr(&output));
        }
    }
}
