//! What acts beside the actuators: flown, told to the robot, and told to `identify`.

use crate::support::{json, number, scratch, stderr, tumble_in};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tumble::robots::shipped;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{InertialParameters, ReactionWheel, ReactionWheels, StatefulDrive, WrenchBox};
use tumble_formats::{ActuatorPreset, BodyPreset, Robot, Robots};
use tumble_identification::recursive::ErringThruster;

/// Pushed and turned by sines, in open space with white noise.
const EXCITED: &str = r#"format = 1
name = "excited"
world = "open"
duration_s = 40.0

[body]
preset = "iss"

[start]
position_m = [0.5, -0.3, 0.2]
rate_rad_s = [0.05, -0.1, 0.08]

[drive]
controller = "none"

[drive.multisine]
force_n = [0.3, 0.3, 0.3]
torque_n_m = [0.03, 0.03, 0.03]
tones = 3
lowest_hz = 0.03
highest_hz = 0.2

[propulsion]
kind = "exact"

[sensing]
preset = "ideal"
"#;

/// A fifth of the force, and of the torque, of the sines.
const DRAG: &str = "
[environment.linear_drag]
force_n_s_m = 0.3
torque_n_m_s_rad = 0.01
center_of_pressure_m = [0.05, 0.0, -0.03]
wind_m_s = [0.2, -0.1, 0.0]
";

const GRADIENT: &str = "
[environment.gravity_gradient]
rate_rad_s = 0.05
orbit_normal = [0.0, -1.0, 0.0]
";

/// A mission in open space with a payload that the robot does not know of.
const MISSION: &str = r#"format = 1
name = "hop"
world = "open"
duration_s = 120.0
robot_radius_m = 0.2

[body]
preset = "iss"

[payload]
mass_kg = 2.0
inertia_about_com_kg_m2 = [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]]
grasp_position_m = [0.05, -0.03, 0.02]

[start]
position_m = [0.0, 0.0, 0.0]

[goal]
position_m = [0.8, 0.2, -0.1]

[plan]
position_lower_m = [-1.0, -1.0, -1.0]
position_upper_m = [1.8, 1.2, 1.0]
speed_limit_m_s = [0.05, 0.05, 0.05]
margin_m = 0.03

[propulsion]
kind = "exact"

[sensing]
preset = "ideal"

[fly]
mass_interval_share = [0.5, 2.0]
"#;

/// Runs the program with these arguments, which must have no word to be quoted.
fn said(folder: &Path, arguments: &str) -> std::process::Output {
    tumble_in(folder, &arguments.split(' ').collect::<Vec<_>>())
}

/// Flies a scenario with a seed; its folder.
fn simulated(folder: &Path, name: &str, scenario: &str, seed: u64) -> PathBuf {
    let file = folder.join(format!("{name}.toml"));
    fs::write(&file, scenario).unwrap();
    let output = said(folder, &format!("simulate {name}.toml --seed {seed} --out {name}-{seed}"));
    assert!(output.status.success(), "{}", stderr(&output));
    let is_told = stderr(&output).contains(&format!(" --environment {name}-{seed}/environment.toml"));
    let flown = folder.join(format!("{name}-{seed}"));
    assert_eq!(is_told, flown.join("environment.toml").is_file(), "{}", stderr(&output));
    flown
}

/// What `identify` says, and by how many standard deviations each of mass and moments of inertia is off.
fn identified(flown: &Path, options: &str) -> (Option<i32>, Value, Option<f64>) {
    let output = said(flown, format!("identify log.csv --json {options}").trim_end());
    let found = json(&output);
    let summary: Value = serde_json::from_str(&fs::read_to_string(flown.join("summary.json")).unwrap()).unwrap();
    let off = sigmas(&found, &summary["truth"]);
    (output.status.code(), found, off)
}

/// Largest error of mass and moments, in standard deviations; `None` where there is no body.
fn sigmas(found: &Value, truth: &Value) -> Option<f64> {
    let four = |of: &Value| -> Option<[f64; 4]> {
        let moment = |axis: usize| of["inertia_about_com_kg_m2"][axis][axis].as_f64();
        Some([of["mass_kg"].as_f64()?, moment(0)?, moment(1)?, moment(2)?])
    };
    let [found, sigma, truth] = [four(found)?, four(&found["std"])?, four(truth)?];
    Some((0..4).map(|k| (found[k] - truth[k]).abs() / sigma[k]).fold(0.0, f64::max))
}

/// Told, mass and moments are within their sigmas; untold, the answer is refused or next to nothing is known.
#[test]
fn identify_is_told_of_what_else_acts() {
    let folder = scratch("told");
    for (name, acting) in [("drag", DRAG), ("gradient", GRADIENT)] {
        for seed in 1..=3 {
            let flown = simulated(&folder, name, &format!("{EXCITED}{acting}"), seed);
            let (code, found, off) = identified(&flown, "--environment environment.toml");
            let off = off.unwrap_or(f64::INFINITY);
            println!("{name} {seed}: told {code:?} {off}, {} {}", found["mass_kg"], found["std"]["mass_kg"]);
            assert!(code == Some(0) && off < 3.5, "{name} {seed}: {off} sigmas of {found:#}");
            let sigma = number(&found["std"]["mass_kg"]);
            if seed > 1 {
                continue;
            }
            let (code, found, off) = identified(&flown, "");
            let is_off = off.is_some_and(|off| off > 5.0);
            let is_vague = found["std"]["mass_kg"].as_f64().is_none_or(|untold| untold > 100.0 * sigma);
            println!("{name} {seed}: untold {code:?} {off:?}, {} {}", found["mass_kg"], found["std"]["mass_kg"]);
            assert!(is_vague || (code == Some(3) && is_off), "{name} {seed}: {code:?} {off:?} {found:#}");
        }
    }
}

/// What a part of the log says of the body explains the rest where validation is told what acted there, too.
#[test]
fn what_is_held_out_is_judged_among_what_else_acts() {
    let flown = simulated(&scratch("held-out"), "drag", &format!("{EXCITED}{DRAG}"), 4);
    let (code, found, _) =
        identified(&flown, "--environment environment.toml --method maximum-likelihood --holdout 0.3");
    let rms = number(&found["holdout"]["normalised_rms"]);
    assert!(code == Some(0) && rms < 2.0, "{found:#}");
}

/// A flight in which nothing else acts has no new file or column; an empty table changes no byte of its log.
#[test]
fn without_the_table_nothing_changes() {
    let folder = scratch("still");
    let still = simulated(&folder, "still", EXCITED, 1);
    assert!(!still.join("environment.toml").exists());
    let log = fs::read_to_string(still.join("log.csv")).unwrap();
    assert!(!log.lines().next().unwrap().contains("stored"), "no wheels, no columns of wheels");
    let empty = simulated(&folder, "empty", &format!("{EXCITED}\n[environment]\n"), 1);
    assert_eq!(fs::read_to_string(empty.join("log.csv")).unwrap(), log);
    let windless = simulated(&folder, "windless", &format!("{EXCITED}\n[environment.constant_world]\n"), 1);
    assert_eq!(fs::read_to_string(windless.join("log.csv")).unwrap(), log);
}

#[test]
fn impossible_environments_are_refused() {
    let folder = scratch("impossible");
    let refused = |arguments: &str, words: &[&str]| {
        let output = said(&folder, arguments);
        let text = stderr(&output);
        assert!(output.status.code() == Some(2) && words.iter().all(|word| text.contains(word)), "{arguments}: {text}");
    };
    fs::write(folder.join("fast.toml"), format!("{EXCITED}{}", GRADIENT.replace("0.05", "5"))).unwrap();
    let words = ["fast.toml, line 30, column 1", "`environment.gravity_gradient.rate_rad_s`: 5:", "at most 1 rad/s"];
    refused("simulate fast.toml", &words);
    refused("fly fast.toml", &words);
    fs::write(folder.join("typed.toml"), format!("{EXCITED}{}", DRAG.replace("wind_m_s", "wind_m"))).unwrap();
    refused("simulate typed.toml", &["typed.toml, line 33", "did you mean `wind_m_s`"]);
    fs::write(folder.join("log.csv"), tumble_formats::log::TEMPLATE).unwrap();
    fs::write(folder.join("air.toml"), "format = 1\n[linear_drag]\nforce_n_s_m = -1\n").unwrap();
    refused("identify log.csv --environment air.toml", &["T012", "air.toml", "line 3", "`linear_drag.force_n_s_m`"]);
    refused("identify log.csv --environment none.toml", &["T001", "none.toml"]);
    fs::write(folder.join("air.toml"), "format = 1\n[linear_drag]\nforce_n_s_m = 1\n").unwrap();
    refused("identify log.csv --environment air.toml --period 3", &["T014", "`--environment`", "`--period`"]);
    refused("identify --demo --environment air.toml", &["T014", "`--demo`"]);
}

/// What a mission came to: whether it arrived, errors of the mass and its sigma, kg, and what was doubted.
fn flown(folder: &Path, name: &str, scenario: &str, seed: u64) -> (bool, f64, f64, Value) {
    fs::write(folder.join(format!("{name}.toml")), scenario).unwrap();
    own(folder, "fly", name, seed);
    let text = fs::read_to_string(folder.join(format!("{name}-{seed}/summary.json"))).unwrap();
    let summary: Value = serde_json::from_str(&text).unwrap();
    let mass = summary["parameters"].as_array().unwrap().iter().find(|row| row["name"] == "mass").unwrap();
    let of = |key: &str| number(&mass[key]);
    (summary["arrived"] == true, of("estimate") - of("truth"), of("sigma"), summary["doubts"].clone())
}

/// Simulates or flies a scenario of a folder with a seed, the turner among the robots; its result is in NAME-SEED.
fn own(folder: &Path, command: &str, name: &str, seed: u64) -> ExitCode {
    let (scenario, out) = (folder.join(format!("{name}.toml")), folder.join(format!("{name}-{seed}")));
    let (seed, [scenario, out]) = (seed.to_string(), [&scenario, &out].map(|path| path.to_str().unwrap()));
    tumble::run(["turner", command, scenario, "--seed", &seed, "--out", out].map(Into::into), &turners())
}

/// Among a wind that blows with a third of the force that plans have, and a gradient. Told, the robot arrives and learns its mass; untold,
/// it doubts its actuators.
#[test]
fn missions_arrive_among_what_they_are_told_of() {
    let folder = scratch("missions");
    let acting = "\n[environment.linear_drag]\nforce_n_s_m = 0.15\nwind_m_s = [0.15, -0.1, 0.05]\n\
                  [environment.gravity_gradient]\nrate_rad_s = 0.02\norbit_normal = [0.0, -1.0, 0.0]\n";
    for seed in 1..=2 {
        let (arrived, off_kg, sigma_kg, doubts) = flown(&folder, "told", &format!("{MISSION}{acting}"), seed);
        println!("told {seed}: {arrived} {off_kg} +- {sigma_kg} {doubts}");
        assert!(arrived && off_kg.abs() < 3.0 * sigma_kg && sigma_kg < 0.3, "{seed}: {off_kg} +- {sigma_kg}");
        assert_eq!(doubts.as_array().map(Vec::len), Some(0), "{doubts}");
    }
    let untold = format!("{MISSION}knows_environment = false\n{acting}");
    let (.., doubts) = flown(&folder, "untold", &untold, 1);
    println!("untold: {doubts}");
    assert!(doubts.as_array().is_some_and(|doubts| !doubts.is_empty()), "{doubts}");
}

/// A cube that turns by wheels which spin from the start, and is pushed by jets, which turn it as well where the wheels are full.
struct Turner;

impl Robot for Turner {
    fn name(&self) -> &'static str {
        "turner"
    }
    fn sentence(&self) -> &'static str {
        "a satellite of 12 kg that turns by wheels"
    }
    fn bodies(&self) -> Vec<BodyPreset> {
        vec![BodyPreset { name: "turner", body: InertialParameters::solid_box(12.0, [0.3, 0.4, 0.5]) }]
    }
    fn actuators(&self) -> Vec<ActuatorPreset> {
        vec![ActuatorPreset {
            name: "turner-wheels",
            sentence: "three wheels, and jets",
            make: || {
                let wheel =
                    |axis_body| ReactionWheel { axis_body, largest_torque_n_m: 0.05, largest_momentum_n_m_s: 0.6 };
                let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
                let wheels = ReactionWheels::try_new(axes.map(wheel))?;
                let jets = WrenchBox { torque_limit: Vector3::repeat(0.06), force_limit: Vector3::repeat(0.5) };
                Ok(Box::new(StatefulDrive::new((wheels, jets), (Vector3::new(0.08, -0.05, 0.1), ()))))
            },
            thrusters: || Ok([ErringThruster::NONE; 12]),
        }]
    }
}

fn turners() -> Robots {
    shipped().with(Turner)
}

/// A scenario with that robot.
fn turning(scenario: &str) -> String {
    scenario.replace("preset = \"iss\"", "preset = \"turner\"").replace("kind = \"exact\"", "kind = \"turner-wheels\"")
}

#[test]
fn wheels_reach_the_log_and_identification() {
    let folder = scratch("wheels");
    fs::write(folder.join("turning.toml"), turning(EXCITED)).unwrap();
    for seed in 1..=3 {
        let out = folder.join(format!("turning-{seed}"));
        assert_eq!(own(&folder, "simulate", "turning", seed), ExitCode::SUCCESS);
        let (code, found, off) = identified(&out, "");
        println!("wheels {seed}: {off:?} {} {}", found["mass_kg"], found["std"]["mass_kg"]);
        assert!(code == Some(0) && off.is_some_and(|off| off < 3.5), "{seed}: {off:?} {found:#}");
        let sigma = number(&found["std"]["inertia_about_com_kg_m2"][0][0]);
        if seed > 1 {
            continue;
        }
        // the same log without its columns of the wheels
        let log = fs::read_to_string(out.join("log.csv")).unwrap();
        fs::write(out.join("log.csv"), log.replacen("stored_", "true_stored_", 3)).unwrap();
        let (code, untold, off) = identified(&out, "");
        println!("wheels {seed}, untold: {code:?} {off:?}");
        let untold_sigma = untold["std"]["inertia_about_com_kg_m2"][0][0].as_f64();
        let is_vague = untold_sigma.is_none_or(|untold| untold > 20.0 * sigma);
        let is_off = off.is_some_and(|off| off > 5.0);
        assert!(is_vague || (code == Some(3) && is_off), "{seed}: {code:?} {off:?} {untold:#}");
    }
}

#[test]
fn a_mission_turns_by_wheels() {
    let folder = scratch("turns");
    let mission = turning(MISSION).replace("[plan]", "quaternion_xyzw = [0.0, 0.0, 0.5, 0.8660254037844387]\n\n[plan]");
    for seed in 1..=2 {
        let (arrived, off_kg, sigma_kg, doubts) = flown(&folder, "turns", &mission, seed);
        println!("wheels {seed}: {arrived} {off_kg} +- {sigma_kg} {doubts}");
        assert!(arrived && off_kg.abs() < 3.0 * sigma_kg, "{off_kg} +- {sigma_kg}");
        assert_eq!(doubts.as_array().map(Vec::len), Some(0), "{doubts}");
        let log = fs::read_to_string(folder.join(format!("turns-{seed}/log.csv"))).unwrap();
        assert!(log.lines().next().unwrap().contains(",stored_x,stored_y,stored_z,"));
    }
}
