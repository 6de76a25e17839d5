//! `tumble identify` as a user meets it: exit codes, places, remedies, files.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::support::page_checks::findings_of_any;
use crate::support::{columns_of, json, number, scratch, stderr, tumble};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::LazyLock;
use tumble::demo;

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

const HEADER: &str = "t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,f_x,f_y,f_z,tau_x,tau_y,tau_z";

/// The demo flight as a log file, with a hook for each row's cells.
fn write_log(path: &Path, rows: usize, start_s: i64, mut edit: impl FnMut(usize, &mut Vec<String>)) {
    static FLIGHT: LazyLock<demo::Demo> = LazyLock::new(|| demo::simulate(7).unwrap());
    let flight = &*FLIGHT;
    let mut text = format!("{HEADER}\n");
    for (k, sample) in flight.record.iter().take(rows).enumerate() {
        let pose = sample.world_from_body.unwrap();
        let (p, q) = (pose.translation.vector, pose.rotation);
        let wrench = sample.wrench_body.unwrap();
        let time_s = format!("{}.{:09}", start_s + sample.time_ns / 1_000_000_000, sample.time_ns % 1_000_000_000);
        let mut cells = vec![time_s];
        let numbers = [p.x, p.y, p.z, q.i, q.j, q.k, q.w];
        cells.extend(numbers.iter().chain(wrench.force.iter()).chain(wrench.torque.iter()).map(f64::to_string));
        edit(k, &mut cells);
        writeln!(text, "{}", cells.join(",")).unwrap();
    }
    fs::write(path, text).unwrap();
}

/// Runs on the demo log with one row edited; the run must fail with this code and name this place.
fn assert_refused(name: &str, code: &str, place: &str, edit: impl FnMut(usize, &mut Vec<String>)) {
    let path = scratch(name).join("log.csv");
    write_log(&path, 40, 0, edit);
    assert_file_refused(&path, code, place);
}

fn assert_file_refused(path: &Path, code: &str, place: &str) {
    let output = tumble(&["identify", path.to_str().unwrap()]);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains(&format!("error[{code}]")), "{message}");
    assert!(message.contains(place), "`{place}` not in: {message}");
    assert!(message.contains("remedy:"), "{message}");
    assert!(output.stdout.is_empty(), "nothing on stdout");
}

#[test]
fn the_demo_compares_with_its_truth_and_follows_its_seed() {
    let (first, again, other) = (
        tumble(&["identify", "--demo", "--json"]),
        tumble(&["identify", "--demo", "--json"]),
        tumble(&["identify", "--demo", "--seed", "2", "--json"]),
    );
    assert_eq!(first.status.code(), Some(0), "{}", stderr(&first));
    assert_eq!(first.stdout, again.stdout, "one seed, one answer");
    assert_ne!(json(&first)["mass_kg"], json(&other)["mass_kg"]);
    for output in [&first, &other] {
        let object = json(output);
        assert_eq!(object["format"], 1);
        assert_eq!(object["rank"], 10);
        assert!(object["pseudo_inertia_min_eigenvalue"].as_f64().unwrap() > 0.0);
        let errors = object["reference"]["error_over_sigma"].as_array().unwrap();
        assert_eq!(errors.len(), 10);
        // Ten errors of one draw: 4.5 sigma is passed by chance once in 15 000 such draws.
        assert!(errors.iter().all(|e| e.as_f64().unwrap().abs() < 4.5), "{errors:?}");
    }
    let table = stdout(&tumble(&["identify", "--demo"]));
    for word in ["mass", "centre of mass x", "inertia yz", "truth", "error/sigma", "verdict"] {
        assert!(table.contains(word), "{table}");
    }
}

#[test]
fn the_template_is_a_valid_log() {
    let path = scratch("template").join("log.csv");
    let output = tumble(&["identify", "--template"]);
    assert_eq!(output.status.code(), Some(0));
    fs::write(&path, &output.stdout).unwrap();
    // Two rows are valid but too few to say anything.
    let message = stderr(&tumble(&["identify", path.to_str().unwrap()]));
    assert!(message.contains("error[T015]") && message.contains("2 samples"), "{message}");
}

#[test]
fn a_log_gives_the_same_digits_today_and_at_unix_time() {
    let folder = scratch("epoch");
    let mass = |start_s| {
        let path = folder.join(format!("log-{start_s}.csv"));
        write_log(&path, usize::MAX, start_s, |_, _| {});
        let output = tumble(&["identify", path.to_str().unwrap(), "--json"]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        json(&output)["mass_kg"].as_f64().unwrap()
    };
    assert_eq!(mass(0).to_bits(), mass(1_700_000_000).to_bits());
}

#[test]
fn outputs_are_complete_offline_and_never_overwritten_unasked() {
    let folder = scratch("out");
    let (out, body) = (folder.join("run"), folder.join("body.toml"));
    let arguments = ["identify", "--demo", "--out", out.to_str().unwrap(), "--export", body.to_str().unwrap()];
    let output = tumble(&arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert_eq!(findings_of_any(&page), [""; 0]);
    for part in [
        "Trained on a part",
        "id=\"fit_force_x\"",
        "id=\"autocorrelation_torque\"",
        "class=\"heat\"",
        "class=\"interval\"",
    ] {
        assert!(page.contains(part), "{part}");
    }
    for name in ["residual_force.svg", "residual_torque.svg", "result.json", "body.toml", "run.json"] {
        assert!(out.join(name).metadata().unwrap().len() > 0, "{name}");
    }
    let run: serde_json::Value = serde_json::from_str(&fs::read_to_string(out.join("run.json")).unwrap()).unwrap();
    assert_eq!(run["seed"], 1);

    let refused = tumble(&arguments);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("error[T010]"));
    let forced = tumble(&[&arguments[..], &["--force"]].concat());
    assert_eq!(forced.status.code(), Some(0), "{}", stderr(&forced));
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 2, "no partial file is left");

    // The exported body is a reference for the next run.
    let log = folder.join("log.csv");
    write_log(&log, usize::MAX, 0, |_, _| {});
    let compared = tumble(&["identify", log.to_str().unwrap(), "--reference", body.to_str().unwrap()]);
    assert!(stdout(&compared).contains("reference"), "{}", stderr(&compared));
}

#[test]
fn an_unwritable_place_is_an_error_before_anything_is_lost() {
    let folder = scratch("unwritable");
    let file = folder.join("file");
    fs::write(&file, "x").unwrap();
    let output = tumble(&["identify", "--demo", "--out", file.join("run").to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("error[T011]"), "{}", stderr(&output));
    assert_eq!(fs::read_to_string(&file).unwrap(), "x");
}

#[test]
fn holdout_dry_run_and_exports_answer() {
    let folder = scratch("modes");
    let log = folder.join("log.csv");
    write_log(&log, usize::MAX, 0, |_, _| {});
    let log = log.to_str().unwrap();
    let held = tumble(&["identify", log, "--holdout", "--json"]);
    let ratio = json(&held)["holdout"]["normalised_rms"].as_f64().unwrap();
    assert!((0.5..2.0).contains(&ratio), "held-out residual against prediction: {ratio}");
    let dry = tumble(&["identify", log, "--dry-run", "--json"]);
    assert_eq!(dry.status.code(), Some(0), "{}", stderr(&dry));
    assert_eq!(json(&dry)["rank"], 10);
    assert!(json(&dry)["std"]["mass_kg"].as_f64().unwrap() > 0.0);
    // What is promised is what is stated, and of the body nothing is told.
    let stated = json(&tumble(&["identify", log, "--json"]));
    assert_eq!(json(&dry)["std"], stated["std"]);
    assert!(json(&dry).get("mass_kg").is_none());
    // The motion alone, under a wrench that is told; a robot at rest whose poses are noisy shows nothing.
    let alone = tumble(&["identify", log, "--dry-run", "--wrench-noise", "1e-3,1e-3", "--json"]);
    assert_eq!(json(&alone)["assumed_noise"]["force_n"], 1e-3, "{}", stderr(&alone));
    let at_rest = folder.join("rest.csv");
    let mut text = "t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w\n".to_owned();
    let mut bits = 1_u32;
    let mut noise = || {
        bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        1e-3 * (f64::from(bits >> 8) / f64::from(1 << 24) - 0.5)
    };
    for k in 0..1000 {
        let [x, y, z, a, b, c] = std::array::from_fn(|_| noise());
        writeln!(text, "{:.2},{x},{y},{z},{a},{b},{c},1", 0.02 * f64::from(k)).unwrap();
    }
    fs::write(&at_rest, text).unwrap();
    let at_rest = tumble(&["identify", at_rest.to_str().unwrap(), "--dry-run"]);
    assert_eq!(at_rest.status.code(), Some(3), "{}", stderr(&at_rest));
    assert!(stdout(&at_rest).contains("rank 0 of 10"), "{}", stdout(&at_rest));
    for (name, word) in [("b.json", "mass_kg"), ("b.urdf", "<inertial>"), ("b.xml", "fullinertia")] {
        let path = folder.join(name);
        let output = tumble(&["identify", log, "--export", path.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert!(fs::read_to_string(&path).unwrap().contains(word));
    }
    let unknown = tumble(&["identify", log, "--export", folder.join("b.step").to_str().unwrap()]);
    assert!(stderr(&unknown).contains("error[T018]"));
}

#[test]
fn files_that_are_no_logs() {
    let folder = scratch("no-log");
    assert_file_refused(&folder.join("absent.csv"), "T001", "absent.csv");
    assert_file_refused(&folder, "T001", "no-log");
    let file = |name: &str, text: &str| {
        let path = folder.join(name);
        fs::write(&path, text).unwrap();
        path
    };
    assert_file_refused(&file("empty.csv", ""), "T002", "header");
    assert_file_refused(&file("header.csv", &format!("{HEADER}\n")), "T002", "data rows");
    assert_file_refused(&file("missing.csv", &format!("{}\n", HEADER.replace("q_w,", ""))), "T003", "`q_w`");
    assert_file_refused(&file("group.csv", &format!("{}\n", HEADER.replace(",tau_z", ""))), "T003", "`tau_z`");
    assert_file_refused(&file("twice.csv", &format!("{HEADER},p_x\n")), "T004", "`p_x`");
    assert_file_refused(&file("binary.csv", "\u{0}\u{1}\u{2}\n\u{3}"), "T003", "`t_s`");
    // One endless line, as large as a disk image: refused after one bounded read.
    let endless = folder.join("endless.csv");
    fs::File::create(&endless).unwrap().set_len(1 << 30).unwrap();
    assert_file_refused(&endless, "T009", "65536");
    fs::remove_file(&endless).unwrap();
}

#[test]
fn cells_that_are_no_numbers() {
    for (name, text) in [("text", "fast"), ("nan", "NaN"), ("inf", "-inf")] {
        assert_refused(name, "T005", "line 12, column `p_y`", |k, cells| {
            if k == 10 {
                text.clone_into(&mut cells[2]);
            }
        });
    }
    assert_refused("time-text", "T005", "column `t_s`", |k, cells| {
        if k == 10 {
            cells[0] = "noon".into();
        }
    });
    assert_refused("torn", "T006", "line 41: ", |k, cells| {
        if k == 39 {
            cells.truncate(5);
        }
    });
}

#[test]
fn quaternions_and_times_that_cannot_be() {
    assert_refused("quaternion", "T007", "line 7", |k, cells| {
        if k == 5 {
            cells[7] = "0.5".into();
        }
    });
    assert_refused("zero-quaternion", "T007", "norm 0", |k, cells| {
        if k == 5 {
            cells[4..8].fill("0".into());
        }
    });
    assert_refused("time-back", "T008", "line 22", |k, cells| {
        if k == 20 {
            cells[0] = "0.001".into();
        }
    });
    assert_refused("time-repeats", "T008", "line 22", |k, cells| {
        if k == 20 {
            cells[0] = "0.304".into();
        }
    });
}

#[test]
fn reorder_puts_late_rows_in_order() {
    let folder = scratch("reorder");
    let (clean, shuffled) = (folder.join("clean.csv"), folder.join("shuffled.csv"));
    write_log(&clean, usize::MAX, 0, |_, _| {});
    let text = fs::read_to_string(&clean).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    for k in (10..3000).step_by(37) {
        lines.swap(k, k + 3);
    }
    lines.insert(500, lines[499]);
    fs::write(&shuffled, lines.join("\n")).unwrap();
    assert_file_refused(&shuffled, "T008", "line");
    let ordered = tumble(&["identify", shuffled.to_str().unwrap(), "--reorder", "--json"]);
    let reference = tumble(&["identify", clean.to_str().unwrap(), "--json"]);
    assert_eq!(json(&ordered)["mass_kg"], json(&reference)["mass_kg"]);
    assert!(json(&ordered)["warnings"][0].as_str().unwrap().contains("1 repeated"));
}

#[test]
fn gaps_and_unknown_columns_are_named_not_hidden() {
    let path = scratch("gaps").join("log.csv");
    write_log(&path, usize::MAX, 0, |_, _| {});
    let text = fs::read_to_string(&path).unwrap();
    let kept: Vec<String> = text
        .lines()
        .enumerate()
        .filter(|(k, _)| !(1000..1200).contains(k))
        .map(|(k, line)| format!("{line},{}", if k == 0 { "battery" } else { "14.1" }))
        .collect();
    fs::write(&path, kept.join("\n")).unwrap();
    let output = tumble(&["identify", path.to_str().unwrap(), "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let warnings = json(&output)["warnings"].to_string();
    assert!(warnings.contains("battery") && warnings.contains("1 gap"), "{warnings}");
    // The last line was written without its end.
    assert!(warnings.contains(&format!("line {} has no line end", kept.len())), "{warnings}");
}

#[test]
fn logs_that_cannot_answer_exit_with_three_and_invent_nothing() {
    let folder = scratch("silent");
    let case = |name: &str, edit: &mut dyn FnMut(usize, &mut Vec<String>)| {
        let path = folder.join(name);
        write_log(&path, 600, 0, edit);
        let output = tumble(&["identify", path.to_str().unwrap(), "--json"]);
        assert_eq!(output.status.code(), Some(3), "{name}: {}", stderr(&output));
        let object = json(&output);
        assert!(object["rank"].as_u64().unwrap() < 10, "{name}");
        assert!(object["mass_kg"].is_null() && object["std"]["mass_kg"].is_null(), "{name}: {object}");
        assert!(!object["null_directions"].as_array().unwrap().is_empty(), "{name}");
        object
    };
    let zero_wrench = case("zero-wrench.csv", &mut |_, cells| cells[8..].fill("0".into()));
    assert!(zero_wrench["warnings"].to_string().contains("zero"), "{zero_wrench}");
    case("still.csv", &mut |_, cells| {
        cells[1..8].clone_from_slice(&["0", "0", "0", "0", "0", "0", "1"].map(String::from));
        cells[8..].fill("0".into());
    });
}

#[test]
fn a_log_that_means_something_else_is_not_believed() {
    let folder = scratch("misfit");
    let case = |name: &str, edit: &mut dyn FnMut(usize, &mut Vec<String>), options: &[&str]| {
        let path = folder.join(name);
        write_log(&path, usize::MAX, 0, edit);
        let output = tumble(&[&["identify", path.to_str().unwrap(), "--json"], options].concat());
        assert_eq!(output.status.code(), Some(3), "{name}: {}{}", stdout(&output), stderr(&output));
        json(&output)
    };
    let negated = |text: &String| (-text.parse::<f64>().unwrap()).to_string();
    let sign = case("sign.csv", &mut |_, cells| cells[8..].iter_mut().for_each(|c| *c = negated(c)), &[]);
    assert!(sign["warnings"].to_string().contains("explains"), "{sign}");
    case("scalar-first.csv", &mut |_, cells| cells[4..8].rotate_right(1), &[]);
    case("conjugated.csv", &mut |_, cells| cells[4..7].iter_mut().for_each(|c| *c = negated(c)), &[]);
    case("gravity.csv", &mut |_, _| {}, &["--gravity=0,0,-1"]);
}

#[test]
fn force_replaces_results_and_nothing_else() {
    let folder = scratch("force");
    let log = folder.join("log.csv");
    write_log(&log, usize::MAX, 0, |_, _| {});
    let before = fs::read(&log).unwrap();
    for option in ["--out", "--export"] {
        let output = tumble(&["identify", log.to_str().unwrap(), option, log.to_str().unwrap(), "--force"]);
        assert_eq!(output.status.code(), Some(2), "{option}: {}", stderr(&output));
        assert_eq!(fs::read(&log).unwrap(), before, "{option}");
    }
    let notes = folder.join("notes");
    fs::create_dir(&notes).unwrap();
    fs::write(notes.join("thesis.tex"), "years of work").unwrap();
    let output = tumble(&["identify", "--demo", "--out", notes.to_str().unwrap(), "--force"]);
    assert!(stderr(&output).contains("error[T020]"), "{}", stderr(&output));
    assert!(notes.join("thesis.tex").exists());
}

#[test]
fn too_few_samples_are_refused_with_the_number_needed() {
    let path = scratch("few").join("log.csv");
    write_log(&path, 2, 0, |_, _| {});
    assert_file_refused(&path, "T015", "2 samples");
}

#[test]
fn options_that_do_not_fit() {
    for arguments in [
        vec!["identify"],
        vec!["identify", "--demo", "--holdout", "1.5"],
        vec!["identify", "--demo", "--gravity", "0,0"],
        vec!["identify", "--demo", "--method", "magic"],
        vec!["identify", "--seed", "3"],
        vec!["identify", "log.csv", "--seed", "3"],
        vec!["identify", "log.csv", "--calibration", "cal.toml"],
        vec!["identify", "--demo", "--dry-run", "--out", "x"],
        vec!["identify", "--wheel", "throw.csv", "--calibration", "cal.toml", "--out", "x"],
        vec!["identify", "--wheel", "throw.csv"],
    ] {
        let output = tumble(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(output.stdout.is_empty());
    }
    let nothing = tumble(&[]);
    assert_eq!(nothing.status.code(), Some(0));
    assert!(stdout(&nothing).contains("tumble identify --demo"));
}

#[test]
fn a_log_longer_than_the_memory_share_is_taken_part_by_part() {
    // Translation only, so that the rows can be written in closed form: p = sin, f = m a.
    let path = scratch("long").join("log.csv");
    let rows: u32 = 200_600;
    let mut text = format!("{HEADER}\n");
    for k in 0..rows {
        let t = 0.016 * f64::from(k);
        let p = [(0.5 * t).sin(), 0.7 * (0.6 * t + 1.0).sin(), 0.4 * (0.7 * t).cos()];
        let f = [-0.25 * p[0] * 5.0, -0.36 * p[1] * 5.0, -0.49 * p[2] * 5.0];
        writeln!(text, "{t:.3},{},{},{},0,0,0,1,{},{},{},0,0,0", p[0], p[1], p[2], f[0], f[1], f[2]).unwrap();
    }
    fs::write(&path, text).unwrap();
    let output = tumble(&["identify", path.to_str().unwrap(), "--wrench", "sampled", "--json"]);
    fs::remove_file(&path).unwrap();
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    let object = json(&output);
    assert_eq!(object["samples_used"], rows);
    assert_eq!(object["rank"], 4);
    // What no part shows is said once.
    assert_eq!(object["warnings"].as_array().unwrap().len(), 6, "{}", object["warnings"]);
    assert!((object["mass_kg"].as_f64().unwrap() / 5.0 - 1.0).abs() < 1e-3, "{}", object["mass_kg"]);
    assert!(object["com_m"][0].as_f64().unwrap().abs() < 1e-3);
    assert!(object["inertia_about_com_kg_m2"][0][0].is_null());
}

#[test]
fn throws_and_calibrations_that_are_none() {
    let folder = scratch("throws");
    let file = |name: &str, text: &str| {
        let path = folder.join(name);
        fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (stranger, empty) = (file("throw.csv", "t_s\n"), file("cal_device_1.csv", "t_s,wx_rad_s\n0,1\n"));
    let calibration = file("cal.toml", "format = 1\n");
    let out = folder.join("new.toml").to_str().unwrap().to_owned();
    for arguments in [
        vec!["calibrate-wheel", &stranger, "--out", &out],
        vec!["calibrate-wheel", &empty, "--out", &out],
        vec!["identify", "--wheel", &stranger, "--calibration", &calibration],
    ] {
        let output = tumble(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(stderr(&output).contains("error[T019]"), "{}", stderr(&output));
    }
    assert!(!Path::new(&out).exists());
}

#[test]
fn calibration_beside_the_body() {
    let found = json(&tumble(&["identify", "--demo", "--estimate", "delay,accelerometer-bias", "--json"]));
    let rows = found["calibration"].as_array().unwrap();
    let row = |quantity: &str| rows.iter().find(|row| row["quantity"] == quantity).unwrap();
    assert_eq!(row("delay")["value"], found["delay_s"]);
    assert_eq!((&row("delay")["unit"], &row("delay")["verdict"]), (&"s".into(), &"identifiable".into()));
    let bias = row("accelerometer-bias");
    assert!(bias["value"].is_null() && bias["sigma"].is_null());
    assert_eq!((&bias["axis"], &bias["verdict"]), (&"x".into(), &"not identifiable".into()));

    let found = json(&tumble(&["identify", "--demo", "--estimate", "force-scale,torque-scale", "--json"]));
    assert!(found["mass_kg"].is_null() && found["com_m"][0].is_number() && found["delay_s"].is_null());
    let words = found["warnings"].to_string();
    assert!(words.contains("the absolute wrench scale can never be known from motion alone"), "{words}");
    assert_eq!(tumble(&["identify", "--demo", "--estimate", "charm"]).status.code(), Some(2));
}

#[test]
fn station_keeping_is_doubted_for_its_feedback() {
    let flown = scratch("feedback").join("flight");
    let out = flown.to_str().unwrap();
    let simulated = tumble(&["simulate", "iss-cargo", "--seed", "31", "--sensing", "ideal", "--out", out]);
    assert_eq!(simulated.status.code(), Some(0), "{}", stderr(&simulated));
    let output = tumble(&["identify", flown.join("log.csv").to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(3), "{}", stdout(&output));
    assert!(stderr(&output).contains("the controller's answer to the noise"), "{}", stderr(&output));
    assert!(stdout(&output).contains("of the wrench answers to the noise of the measurements"), "{}", stdout(&output));
}

/// Ten kilograms: the robot with them hardly moves, and noise hides the motion from every regression.
#[test]
fn heavy_cargo_is_weighed_too() {
    let folder = scratch("heavy-cargo");
    let scenario = folder.join("heavy.toml");
    let embedded = tumble(&["scenario", "show", "iss-catch"]);
    let (light, heavy) = ("mass_kg = 2.0", "mass_kg = 10.0");
    let text = stdout(&embedded);
    assert!(text.contains(light), "{text}");
    let as_large = text.replace(light, heavy).replace("0.01", "0.2");
    fs::write(&scenario, as_large).unwrap();
    let flown = folder.join("flight");
    let simulated = tumble(&["simulate", scenario.to_str().unwrap(), "--seed", "3", "--out", flown.to_str().unwrap()]);
    assert_eq!(simulated.status.code(), Some(0), "{}", stderr(&simulated));
    let output = tumble(&["identify", flown.join("log.csv").to_str().unwrap(), "--split", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let found = json(&output);
    for (change, part) in found["changes"].as_array().unwrap().iter().zip(found["parts"].as_array().unwrap()) {
        assert_eq!(part["result"]["identified"], true);
        let payload = &change["payload"];
        let (mass, sigma) = (payload["mass_kg"].as_f64().unwrap(), payload["std"]["mass_kg"].as_f64().unwrap());
        assert!((mass - 10.0).abs() < 3.0 * sigma && sigma < 0.5, "{mass} +- {sigma}");
    }
    assert_eq!(found["changes"].as_array().unwrap().len(), 2);
}

/// A filter takes the errors of an inertial unit for white: its standard deviations are then too small, and the answer is held against the one
/// that `identify` gives without being told a method.
#[test]
fn a_filter_that_believes_too_much_is_doubted() {
    let flown = scratch("believing").join("flight");
    let simulated = tumble(&["simulate", "iss-excite", "--seed", "34", "--out", flown.to_str().unwrap()]);
    assert_eq!(simulated.status.code(), Some(0), "{}", stderr(&simulated));
    let (log, truth) = (flown.join("log.csv"), flown.join("truth.toml"));
    let worst = |more: &[&str], code: i32| {
        let known = ["identify", log.to_str().unwrap(), "--reference", truth.to_str().unwrap(), "--json"];
        let output = tumble(&[&known[..], more].concat());
        assert_eq!(output.status.code(), Some(code), "{more:?}: {}", stderr(&output));
        let errors = &json(&output)["reference"]["error_over_sigma"];
        errors.as_array().unwrap().iter().map(|error| error.as_f64().unwrap().abs()).fold(0.0, f64::max)
    };
    assert!(worst(&["--method", "ekf"], 3) > 5.0);
    assert!(worst(&[], 0) < 4.0);
}

/// Real sensors; two kilograms taken after twenty seconds, let go after sixty.
#[test]
fn cargo_that_is_taken_and_let_go_is_weighed() {
    for seed in ["33", "34"] {
        cargo_is_weighed(seed);
    }
}

fn cargo_is_weighed(seed: &str) {
    let flown = scratch("cargo").join("flight");
    let simulated = tumble(&["simulate", "iss-catch", "--seed", seed, "--out", flown.to_str().unwrap()]);
    assert_eq!(simulated.status.code(), Some(0), "{}", stderr(&simulated));
    let log = flown.join("log.csv");
    let output = tumble(&["identify", log.to_str().unwrap(), "--split", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let found: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(found["parts"].as_array().unwrap().len(), 3);
    let changes = found["changes"].as_array().unwrap();
    assert_eq!(changes.len(), 2);
    for (change, (time_s, taken)) in changes.iter().zip([(20.0, true), (60.0, false)]) {
        let [likeliest, earliest, latest] =
            ["time_s", "earliest_s", "latest_s"].map(|name| change[name].as_f64().unwrap());
        assert!((likeliest - time_s).abs() < 0.2 && earliest < time_s && time_s < latest, "{change}");
        let payload = &change["payload"];
        assert_eq!(payload["taken"], taken);
        let (mass, sigma) = (payload["mass_kg"].as_f64().unwrap(), payload["std"]["mass_kg"].as_f64().unwrap());
        assert!((mass - 2.0).abs() < 3.0 * sigma && sigma < 0.25, "{mass} +- {sigma}");
        let (forward, of_forward) =
            (payload["com_m"][0].as_f64().unwrap(), payload["std"]["com_m"][0].as_f64().unwrap());
        assert!((forward - 0.3).abs() < 3.0 * of_forward && of_forward < 0.05, "{forward} +- {of_forward}");
    }
    let table = stdout(&tumble(&["identify", log.to_str().unwrap(), "--split"]));
    assert!(table.contains("what the robot took") && table.contains("what the robot let go"), "{table}");
    // What is stated of the sensors and is not so is said beside the answer.
    let stated = flown.join("stated.toml");
    fs::write(&stated, "format = 1\n[position]\nwhite = { known = 0.02 }\n").unwrap();
    let output = tumble(&["identify", log.to_str().unwrap(), "--sensing", stated.to_str().unwrap()]);
    let said = "the log contradicts what `--sensing` states: `position.white`";
    assert!(stderr(&output).contains(said), "{}", stderr(&output));
}

#[test]
fn a_log_of_the_table_answers_what_a_table_shows() {
    let folder = scratch("granite");
    let flown = folder.join("flight");
    let simulated = tumble(&["simulate", "granite-excite", "--seed", "31", "--out", flown.to_str().unwrap()]);
    assert_eq!(simulated.status.code(), Some(0), "{}", stderr(&simulated));
    let (full, body) = (flown.join("log.csv"), flown.join("truth.toml"));
    let truth: toml::Table = fs::read_to_string(&body).unwrap().parse().unwrap();
    let true_mass = truth["mass_kg"].as_float().unwrap();

    // The same motion in the columns of a planar log.
    // (Not the accelerations: they hold gravity by an attitude that such a log has not.)
    let names = ["t_s", "p_x", "p_y", "q_z", "q_w", "f_x", "f_y", "tau_z", "v_x", "v_y", "w_z"];
    let mut text = "t_s,p_x,p_y,yaw_rad,f_x,f_y,tau_z,v_x,v_y,w_z\n".to_owned();
    for (row, cells) in columns_of(&full, &names).into_iter().enumerate() {
        if row == 100 {
            // the localisation was silent for once
            writeln!(text, "{},,,,{}", cells[0], cells[5..].join(",")).unwrap();
            continue;
        }
        let number = |at: usize| cells[at].parse::<f64>().unwrap();
        let yaw_rad = 2.0 * number(3).atan2(number(4));
        writeln!(text, "{},{},{},{yaw_rad},{}", cells[0], cells[1], cells[2], cells[5..].join(",")).unwrap();
    }
    let planar = folder.join("planar.csv");
    fs::write(&planar, text).unwrap();

    for log in [&full, &planar] {
        let (log_name, body) = (log.to_str().unwrap(), body.to_str().unwrap());
        let output = tumble(&["identify", log_name, "--reference", body, "--json"]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let found = json(&output);
        let errors = found["reference"]["error_over_sigma"].as_array().unwrap();
        let compared: Vec<usize> = (0..errors.len()).filter(|&i| errors[i].is_f64()).collect();
        assert_eq!(compared, [0, 1, 2, 6], "{errors:?}");
        assert_eq!((&found["planar"], &found["method"]), (&true.into(), &"flight-likelihood".into()));
        let (mass, sigma) = (found["mass_kg"].as_f64().unwrap(), found["std"]["mass_kg"].as_f64().unwrap());
        assert!((mass - true_mass).abs() < 4.0 * sigma && sigma < 0.05 * true_mass, "{mass} +- {sigma}: {true_mass}");
        assert!(found["com_m"][0].is_f64() && found["com_m"][1].is_f64() && found["com_m"][2].is_null(), "{found}");
        let inertia = &found["inertia_about_com_kg_m2"];
        for (row, column) in [(0, 0), (1, 1), (0, 1), (0, 2), (1, 2)] {
            assert!(inertia[row][column].is_null(), "{inertia}");
        }
        assert!(inertia[2][2].is_f64());
        let table = stdout(&tumble(&["identify", log.to_str().unwrap()]));
        assert!(table.contains("a table shows no more"), "{table}");
    }
    let free = json(&tumble(&["identify", planar.to_str().unwrap(), "--no-planar", "--json"]));
    assert!(free["planar"].is_null(), "{free}");
    for asked in [&["--method", "ekf"][..], &["--method", "variational"], &["--estimate", "delay"]] {
        let refused = tumble(&[&["identify", planar.to_str().unwrap()], asked].concat());
        assert_eq!(refused.status.code(), Some(2), "{asked:?}: {}", stderr(&refused));
        assert!(stderr(&refused).contains("knows free bodies only"), "{asked:?}: {}", stderr(&refused));
    }
}

#[test]
fn impossible_sensors_are_refused_with_the_key() {
    let folder = scratch("sensing");
    let (log, file) = (folder.join("log.csv"), folder.join("sensing.toml"));
    write_log(&log, 40, 0, |_, _| {});
    for (text, place) in [
        ("format = 1\n[pose_delay]\nexpected_s = 0.0\nsigma_s = -1.0\n", "delay"),
        ("format = 1\nlever_arm = [0.0, 0.0, 0.0]\n", "lever_arm"),
        ("format = 2\n", "format"),
    ] {
        fs::write(&file, text).unwrap();
        let output = tumble(&["identify", log.to_str().unwrap(), "--sensing", file.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains(place) && stderr(&output).contains("sensing.toml"), "{}", stderr(&output));
    }
}

/// A log of a body on an uneven table under eight valves that answer late, 96 s of it, and what the valves are.
fn valves(folder: &Path) -> (PathBuf, PathBuf) {
    const PLACE: [(f64, f64); 8] = [
        (0.15, 0.07),
        (0.15, -0.07),
        (0.07, -0.15),
        (-0.07, -0.15),
        (-0.15, -0.07),
        (-0.15, 0.07),
        (-0.07, 0.15),
        (0.07, 0.15),
    ];
    const ALONG: [(f64, f64); 8] =
        [(-1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, 1.0), (1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, -1.0)];
    let mut bits = 7_u64;
    let mut chance = move || {
        bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (bits >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (mut place, mut speed, mut yaw, mut rate) = ((0.3, -0.2), (0.0, 0.0), 0.4_f64, 0.0);
    let (mut told, mut history, mut drift) = ([0.0; 8], Vec::<[f64; 8]>::new(), (0.0, 0.0));
    let mut log = "t_s,p_x,p_y,yaw_rad,u_1,u_2,u_3,u_4,u_5,u_6,u_7,u_8\n".to_owned();
    for k in 0..1600 {
        if k % 10 == 0 {
            let (sin, cos) = yaw.sin_cos();
            let back = (-0.01 * place.0 - 0.1 * speed.0, -0.01 * place.1 - 0.1 * speed.1);
            let back = (cos * back.0 + sin * back.1, cos * back.1 - sin * back.0);
            for (i, told) in told.iter_mut().enumerate() {
                let arm = PLACE[i].0 * ALONG[i].1 - PLACE[i].1 * ALONG[i].0;
                let wish = 20.0 * (back.0 * ALONG[i].0 + back.1 * ALONG[i].1) - 1.2 * rate * arm;
                *told = f64::from(wish + 3.0 * (chance() - 0.5) > 0.6);
            }
        }
        history.push(told);
        let cells: Vec<String> = told.iter().map(ToString::to_string).collect();
        let mut seen = |value: f64| value + 6e-4 * (chance() + chance() - 1.0);
        let (x, y, angle) = (seen(place.0), seen(place.1), seen(yaw));
        writeln!(log, "{:.3},{x:.6},{y:.6},{angle:.6},{}", 0.06 * f64::from(k), cells.join(",")).unwrap();
        // What opens now opens two rows later.
        let open = history[history.len().saturating_sub(3)];
        drift = (0.95 * drift.0 + 2e-3 * (chance() - 0.5), 0.95 * drift.1 + 2e-3 * (chance() - 0.5));
        for _ in 0..6 {
            let (sin, cos) = yaw.sin_cos();
            let (mut force, mut torque) = ((0.0, 0.0), 0.0);
            for i in 0..8 {
                let thrust = 0.45 * open[i];
                force = (force.0 + ALONG[i].0 * thrust, force.1 + ALONG[i].1 * thrust);
                torque += (PLACE[i].0 * ALONG[i].1 - PLACE[i].1 * ALONG[i].0) * thrust;
            }
            let world = (cos * force.0 - sin * force.1, sin * force.0 + cos * force.1);
            speed.0 += 0.01 * (world.0 / 18.0 - 8e-4 * place.0 + drift.0);
            speed.1 += 0.01 * (world.1 / 18.0 + 1e-3 + drift.1);
            rate += 0.01 * (torque / 0.25 + drift.0);
            place = (place.0 + 0.01 * speed.0, place.1 + 0.01 * speed.1);
            yaw += 0.01 * rate;
        }
    }
    let mut file = "format = 1\n".to_owned();
    for i in 0..8 {
        writeln!(
            file,
            "[[thruster]]\ncolumn = \"u_{}\"\nposition_m = [{}, {}, 0.0]\ndirection = [{:.1}, {:.1}, 0.0]\nthrust_n = 0.45",
            i + 1,
            PLACE[i].0,
            PLACE[i].1,
            ALONG[i].0,
            ALONG[i].1
        )
        .unwrap();
    }
    file += "[common]\nsag_sigma = 0.1\ndelay_sigma_s = 0.2\n";
    let paths = (folder.join("log.csv"), folder.join("actuators.toml"));
    fs::write(&paths.0, log).unwrap();
    fs::write(&paths.1, file).unwrap();
    paths
}

/// Commands in the place of a wrench: mass, delay and sag of the valves, and what cannot be is refused by place.
#[test]
fn valves_by_their_commands() {
    let folder = scratch("actuators");
    let (log, file) = valves(&folder);
    let (log, file) = (log.to_str().unwrap(), file.to_str().unwrap());
    let output = tumble(&["identify", log, "--actuators", file, "--json"]);
    let found = json(&output);
    println!("{} {} +- {} {}", found["method"], found["mass_kg"], found["std"]["mass_kg"], found["actuators"]);
    assert_eq!(output.status.code(), Some(0));
    let near = |value: &serde_json::Value, std: &serde_json::Value, truth: f64| {
        (number(value) - truth).abs() < 4.0 * number(std)
    };
    assert!(near(&found["mass_kg"], &found["std"]["mass_kg"], 18.0) && number(&found["std"]["mass_kg"]) < 1.0);
    let actuators = &found["actuators"];
    assert_eq!(actuators["thrusters"].as_array().unwrap().len(), 8);
    assert!((number(&actuators["delay_s"]["value"]) - 0.12).abs() < 0.02);
    assert!(near(&actuators["sag"]["value"], &actuators["sag"]["std"], 0.0));
    assert!(stdout(&tumble(&["identify", log, "--actuators", file])).contains("sag per further"));

    // A ninth that no row opens is named; no more is said of it than the file says, and the rest stays.
    let (more_log, more_file) = (folder.join("nine.csv"), folder.join("nine.toml"));
    let ninth = fs::read_to_string(log).unwrap().replace('\n', ",0\n").replacen("u_8,0", "u_8,u_9", 1);
    fs::write(&more_log, ninth).unwrap();
    let thruster =
        "[[thruster]]\ncolumn = \"u_9\"\nposition_m = [0.1, 0.1, 0.0]\ndirection = [1.0, 0.0, 0.0]\nthrust_n = 0.45\n";
    fs::write(&more_file, fs::read_to_string(file).unwrap().replace("[common]", &format!("{thruster}[common]")))
        .unwrap();
    let nine = ["identify", more_log.to_str().unwrap(), "--actuators", more_file.to_str().unwrap(), "--json"];
    let output = tumble(&nine);
    assert!(stderr(&output).contains("never commanded, so that nothing is said of them: u_9"), "{}", stderr(&output));
    let without_ninth = json(&output);
    let unheard = &without_ninth["actuators"]["thrusters"][8];
    let as_told =
        [("scale", 1.0), ("std", 0.01)].iter().all(|(key, told)| (number(&unheard[*key]) - told).abs() < 1e-9);
    assert!(as_told, "{unheard}");
    assert!((number(&without_ninth["mass_kg"]) / number(&found["mass_kg"]) - 1.0).abs() < 1e-3, "{without_ninth}");

    let refused = |change: &dyn Fn(String) -> String, of_log: bool, said: &str| {
        let (bad_log, bad_file) = (folder.join("bad.csv"), folder.join("bad.toml"));
        let text = |path: &str, changed: bool| {
            let text = fs::read_to_string(path).unwrap();
            if changed { change(text) } else { text }
        };
        fs::write(&bad_log, text(log, of_log)).unwrap();
        fs::write(&bad_file, text(file, !of_log)).unwrap();
        let output = tumble(&["identify", bad_log.to_str().unwrap(), "--actuators", bad_file.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains(said), "{}", stderr(&output));
    };
    refused(&|text| text.replacen("u_3", "v_3", 1), true, "`u_3` is missing; the actuator file names it");
    refused(&|text| text.replacen(",0,", ",1.5,", 1), true, "a command lies between 0 and 1");
    refused(&|text| text.replace("thrust_n = 0.45", "thrust_n = 0.0"), false, "thrust");
    refused(&|text| text.replace("sag_sigma", "sag"), false, "sag");
    let output = tumble(&["identify", log, "--actuators", file, "--split"]);
    assert!(output.status.code() == Some(2) && stderr(&output).contains("--split"));
}

/// One flight in every way in which it may come: the answer is the same to the last digit.
#[test]
fn a_log_is_read_however_it_comes() {
    let folder = scratch("as-it-comes");
    let plain = folder.join("plain.csv");
    write_log(&plain, 600, 0, |_, _| {});
    let text = fs::read_to_string(&plain).unwrap();
    let answer = |output: &Output| {
        let mut found = json(output);
        assert!(found["mass_kg"].is_number(), "{}", stderr(output));
        for key in ["source", "log"] {
            found.as_object_mut().unwrap().remove(key);
        }
        found
    };
    let wanted = answer(&tumble(&["identify", plain.to_str().unwrap(), "--json"]));
    let quoted: String = text
        .lines()
        .map(|line| line.split(',').map(|cell| format!("\"{cell}\"")).collect::<Vec<_>>().join(",") + "\r\n")
        .collect();
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, text.as_bytes()).unwrap();
    for (name, bytes) in [
        ("quoted.csv", format!("\u{feff}{quoted}").into_bytes()),
        ("german.csv", text.replace(',', ";").replace('.', ",").into_bytes()),
        ("tabs.csv", text.replace(',', "\t").into_bytes()),
        ("packed.csv.gz", packed.finish().unwrap()),
    ] {
        let path = folder.join(name);
        fs::write(&path, bytes).unwrap();
        let output = tumble(&["identify", path.to_str().unwrap(), "--json"]);
        assert_eq!(answer(&output), wanted, "{name}");
        let back = folder.join(format!("{name}.back.csv"));
        let output = tumble(&["convert", path.to_str().unwrap(), back.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(0), "{name}: {}", stderr(&output));
        assert_eq!(fs::read_to_string(&back).unwrap().lines().count(), text.lines().count(), "{name}");
    }
    // A packed log is an input by its own name, not by that of its copy.
    let packed = folder.join("body.toml");
    fs::copy(folder.join("packed.csv.gz"), &packed).unwrap();
    let packed = packed.to_str().unwrap();
    let output = tumble(&["identify", packed, "--export", packed, "--force"]);
    assert!(output.status.code() == Some(2) && stderr(&output).contains("an input of this run"), "{}", stderr(&output));
    let piped = |named: &str, bytes: &[u8]| {
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_tumble"))
            .args(["identify", named, "--json"])
            .stdin(std::process::Stdio::piped())
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        std::io::Write::write_all(&mut child.stdin.take().unwrap(), bytes).unwrap();
        child.wait_with_output().unwrap()
    };
    assert_eq!(answer(&piped("-", text.as_bytes())), wanted);
    assert_eq!(answer(&piped("-", &fs::read(folder.join("packed.csv.gz")).unwrap())), wanted);
    #[cfg(target_os = "linux")]
    assert_eq!(answer(&piped("/dev/stdin", text.as_bytes())), wanted);

    // What is wrong with a packed or piped log is said of it, not of a copy.
    let wrong =
        text.lines().map(|line| if line.starts_with("0.1") { "0.1,?" } else { line }).collect::<Vec<_>>().join("\n");
    assert_ne!(wrong, text.trim_end());
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packed, wrong.as_bytes()).unwrap();
    let path = folder.join("wrong.csv.gz");
    fs::write(&path, packed.finish().unwrap()).unwrap();
    for command in [&["identify"][..], &["sensing", "check"], &["convert"]] {
        let out = folder.join("wrong.tum");
        let arguments =
            [command, &[path.to_str().unwrap()], &[out.to_str().unwrap()][..usize::from(command[0] == "convert")]];
        let output = tumble(&arguments.concat());
        assert!(stderr(&output).contains("wrong.csv.gz, line "), "{command:?}: {}", stderr(&output));
    }
    assert!(
        stderr(&piped("-", wrong.as_bytes())).contains(": standard-input, line "),
        "{}",
        stderr(&piped("-", wrong.as_bytes()))
    );

    let wide = folder.join("wide.csv");
    fs::write(&wide, text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>()).unwrap();
    fs::write(&wide, [&[0xff, 0xfe][..], &fs::read(&wide).unwrap()].concat()).unwrap();
    assert_file_refused(&wide, "T001", "UTF-16");
}

/// Nothing is read without end, and a report flies again by what stands in it alone.
#[test]
#[cfg(target_os = "linux")]
fn what_has_no_end_is_refused() {
    use std::os::unix::fs::symlink;
    let folder = scratch("endless");
    let pipe = folder.join("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let pipe = pipe.to_str().unwrap();
    let part = folder.join("part");
    fs::create_dir(&part).unwrap();
    symlink("/dev/zero", part.join("run.json")).unwrap();
    let part = part.to_str().unwrap();
    let out = folder.join("out.tum");
    let out = out.to_str().unwrap();
    for arguments in [
        &["replay", "/dev/zero"][..],
        &["replay", pipe],
        &["convert", "/dev/zero", out],
        &["identify", "/dev/zero"],
        &["identify", "/dev/random"],
        &["sensing", "check", "/dev/zero"],
        &["plan", "/dev/zero"],
        &["fly", "/dev/zero"],
        &["arm", "show", "/dev/zero"],
        &["allocate", "/dev/zero"],
        &["campaign", "merge", part, "--out", out],
    ] {
        let output = tumble(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains("remedy:"), "{arguments:?}: {}", stderr(&output));
    }
    assert!(fs::read_dir(&folder).unwrap().count() == 2, "nothing was written");
}
