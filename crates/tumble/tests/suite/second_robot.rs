//! A robot that this program never heard of: registered, it identifies from its own commands, is simulated, flies, and has its campaign
//! and its report.

#[path = "../../examples/own_robot.rs"]
mod own_robot;

use crate::support::ros1::{Payload, bag_time};
use crate::support::scratch;
use own_robot::{Kite, OtherJets};
use serde_json::Value;
use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::ExitCode;
use tumble::cli::captured;
use tumble::mission::{FlyOptions, LayerNames, ModelChoice, WeightingChoice};
use tumble::robots::shipped;
use tumble::scenario::ScenarioSource;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{ActuatorDrive, Driven, DynamicsError, FreeFlyer, Integrator as _, MuntheKaas4, RigidBodyState};
use tumble_formats::testing::bag_writer::{BagWriter, Compression};
use tumble_formats::{ActuatorPreset, Robot, Robots};
use tumble_identification::recursive::ErringThruster;
use tumble_lie::Wrench;

const STEP_NS: i64 = 20_000_000;
const STEPS: i64 = 1500;

/// A mission in open space with a payload that it does not know of.
const MISSION: &str = r#"format = 1
name = "kite-hop"
world = "open"
duration_s = 90.0
robot_radius_m = 0.2

[body]
preset = "kite"

[payload]
mass_kg = 2.0
inertia_about_com_kg_m2 = [[0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]]
grasp_position_m = [0.05, -0.03, 0.02]

[start]
position_m = [0.0, 0.0, 0.0]

[goal]
position_m = [0.6, 0.2, -0.1]

[plan]
position_lower_m = [-1.0, -1.0, -1.0]
position_upper_m = [1.6, 1.2, 1.0]
speed_limit_m_s = [0.05, 0.05, 0.05]
margin_m = 0.03

[propulsion]
kind = "kite-jets"

[fly]
mass_interval_share = [0.5, 2.0]

[sensing.settings.pose]
position_noise_m = 0.002
attitude_noise_rad = 0.004
velocity_noise_m_s = 0.001
position_drift_m = 0.0
attitude_drift_rad = 0.0
velocity_drift_m_s = 0.0

[sensing.settings.imu]
moving_average = false
flight_filter = false
bias_following_time_s = 0.0
lever_arm_body_m = [0.0, 0.0, 0.0]

[sensing.settings.imu.accelerometer]
noise_density = 1e-3

[sensing.settings.imu.gyro]
noise_density = 1.25e-4
"#;

/// Sines on all axes and perfect sensors, to be identified.
fn excited() -> String {
    let drive = "[drive.multisine]\nforce_n = [0.3, 0.3, 0.3]\ntorque_n_m = [0.03, 0.03, 0.03]\ntones = 3\nlowest_hz = 0.03\n\
                 highest_hz = 0.2\n\n[propulsion]";
    let (before_sensing, _) = MISSION.split_once("[fly]").unwrap();
    format!("{}[sensing]\npreset = \"perfect\"\n", before_sensing.replace("[propulsion]", drive))
}

fn kites() -> Robots {
    shipped().with(Kite)
}

/// Runs the command line with the satellite among its robots.
fn own(arguments: &[&str]) -> ExitCode {
    let arguments = std::iter::once("kite").chain(arguments.iter().copied()).map(Into::into);
    tumble::run(arguments, &kites())
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// A recording of poses, on 0, and of what its jets are told, on 1.
fn bag_of_jets() -> BagWriter {
    let mut bag = BagWriter::new(Compression::Lz4, 20_000);
    bag.connection(0, "/kite/pose", "geometry_msgs/PoseStamped", "d3812c3cbc69362b77dc0b19b345f8f5");
    bag.connection(1, "/kite/jets", "kite_msgs/Jets", "00000000000000000000000000000000");
    bag
}

#[test]
fn its_recorded_commands_give_its_body() {
    let body = kites().body("kite").unwrap();
    let (flyer, mut state) = (FreeFlyer::new(body), RigidBodyState::at_rest());
    let mut bag = bag_of_jets();
    for k in 0..STEPS {
        let time_ns = k * STEP_NS;
        let phase = 0.02 * f64::from(i32::try_from(k).unwrap());
        let share: [i8; 6] = std::array::from_fn(|axis| {
            let rate = 0.3 + 0.17 * f64::from(u8::try_from(axis).unwrap());
            #[allow(clippy::cast_possible_truncation)] // at most 100
            let share = (100.0 * (rate * phase).sin()).round() as i8;
            share
        });
        let commands = share.map(|share| share.to_le_bytes()[0]);
        let (pose, time) = (state.world_from_body, bag_time(time_ns));
        bag.message(0, time, &Payload::header(time_ns.max(1), "world").pose(&pose).0);
        bag.message(1, time, &commands);
        let part = |axis: usize| f64::from(share[axis]) / 127.0;
        let force = Vector3::new(part(0), part(1), part(2)) * 0.5;
        let wrench = Wrench::new(Vector3::new(part(3), part(4), part(5)) * 0.06, force);
        for _ in 0..4 {
            state = MuntheKaas4.step(&flyer, &state, &wrench, 0.0, 0.005).unwrap();
        }
    }
    let folder = scratch("jets");
    let (path, out) = (folder.join("flight.bag"), folder.join("report"));
    fs::write(&path, bag.finish()).unwrap();
    let arguments = ["identify", path.to_str().unwrap(), "--out", out.to_str().unwrap()];
    assert_eq!(own(&arguments), ExitCode::SUCCESS);
    let found = json(&out.join("result.json"));
    let mass = found["mass_kg"].as_f64().unwrap();
    assert!((mass / body.mass - 1.0).abs() < 0.01, "{mass}");
    // without the robot nobody knows what its commands did
    let stranger = tumble::run(["tumble", arguments[0], arguments[1]].map(Into::into), &shipped());
    assert_eq!(stranger, ExitCode::from(2));
}

/// A valve that sticks.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error("valve {valve} does not open")]
struct Stuck {
    valve: u8,
}

/// Jets that cannot even be made, and jets that refuse in flight.
struct Broken;

impl Robot for Broken {
    fn name(&self) -> &'static str {
        "broken"
    }
    fn sentence(&self) -> &'static str {
        "jets whose valves stick"
    }
    fn actuators(&self) -> Vec<ActuatorPreset> {
        let (sentence, thrusters) = (self.sentence(), || Ok(ErringThruster::along_axes(0.01)));
        vec![
            ActuatorPreset {
                name: "none-made",
                sentence,
                make: || Err(DynamicsError::foreign("none-made", Stuck { valve: 1 })),
                thrusters,
            },
            ActuatorPreset { name: "none-opens", sentence, make: || Ok(Box::new(Refusing)), thrusters },
        ]
    }
}

struct Refusing;

impl ActuatorDrive for Refusing {
    fn drive(&mut self, _: &Wrench<f64>, _: f64) -> Result<Driven, DynamicsError> {
        Err(DynamicsError::foreign("none-opens", Stuck { valve: 2 }))
    }
}

#[test]
fn what_it_refuses_keeps_its_text_and_its_source() {
    let folder = scratch("refusals");
    let mut bag = bag_of_jets();
    for time_ns in (1..100).map(|k| k * STEP_NS) {
        bag.message(
            0,
            bag_time(time_ns),
            &Payload::header(time_ns, "world").pose(&RigidBodyState::at_rest().world_from_body).0,
        );
        bag.message(1, bag_time(time_ns), &[0; 5]);
    }
    let recording = folder.join("flight.bag");
    fs::write(&recording, bag.finish()).unwrap();
    let scenario = |kind: &str, text: &str| {
        let path = folder.join(format!("{kind}.toml"));
        fs::write(&path, text.replace("kite-jets", kind)).unwrap();
        path
    };
    let excited = excited();
    let commands = [
        ("identify", recording, "kite-jets: a command of 5 jets, six are known"),
        ("simulate", scenario("none-made", &excited), "none-made: valve 1 does not open"),
        ("simulate", scenario("none-opens", &excited), "none-opens: valve 2 does not open"),
        (
            "fly",
            scenario("none-opens-flown", &MISSION.replace("kite-jets", "none-opens")),
            "none-opens: valve 2 does not open",
        ),
    ];
    let robots = kites().with(Broken);
    for (command, file, text) in commands {
        let out = folder.join("out");
        let words = || ["kite", command, file.to_str().unwrap(), "--out", out.to_str().unwrap()].map(Into::into);
        let error = tumble::answer(words(), &robots).unwrap_err();
        assert_eq!((error.code(), error.to_string()), ("T037", text.to_owned()), "{command}");
        let source = error.source().unwrap();
        match source.downcast_ref::<OtherJets>() {
            Some(other) => assert_eq!(other.jets, 5),
            None => assert!(text.contains(&source.downcast_ref::<Stuck>().unwrap().to_string()), "{source}"),
        }
        let (ended, said) = captured(|| tumble::run(words(), &robots));
        assert_eq!(ended, ExitCode::from(2));
        assert!(said.stderr.contains(&format!("error[T037]: {text}\n  remedy: the ")), "{}", said.stderr);
    }
}

#[test]
fn it_is_simulated_and_identified_from_that_log() {
    let folder = scratch("kite");
    let (scenario, flown, report) = (folder.join("kite.toml"), folder.join("flown"), folder.join("report"));
    fs::write(&scenario, excited()).unwrap();
    assert_eq!(own(&["simulate", scenario.to_str().unwrap(), "--out", flown.to_str().unwrap()]), ExitCode::SUCCESS);
    let (log, truth) = (flown.join("log.csv"), flown.join("truth.toml"));
    let arguments = ["identify", log.to_str().unwrap(), "--reference", truth.to_str().unwrap(), "--out"];
    assert_eq!(own(&[&arguments[..], &[report.to_str().unwrap()]].concat()), ExitCode::SUCCESS);
    let mass = json(&report.join("result.json"))["mass_kg"].as_f64().unwrap();
    assert!((mass / 14.0 - 1.0).abs() < 0.01, "{mass}");
    let stranger = ScenarioSource::parse(&scenario, &excited()).unwrap();
    let refused = stranger.flight().map(|_| ()).unwrap_err().to_string();
    assert!(refused.contains("`kite` is none of iss, granite"), "{refused}");
    let jets = excited().replace("preset = \"kite\"", "preset = \"spheres\"");
    let refused = ScenarioSource::parse(&scenario, &jets).unwrap().flight().map(|_| ()).unwrap_err().to_string();
    assert!(refused.contains("`kite-jets` is none of plant, limited, exact, space-cobot, spheres"), "{refused}");
}

/// An estimator in flight is told of the jets of this robot, and of nozzles only where there are some.
#[test]
fn its_estimator_learns_its_own_thrusters() {
    let thrusters = |mission: &str| {
        let source = ScenarioSource::parse(Path::new("kite.toml"), mission).unwrap().among(&kites());
        let options = FlyOptions {
            seed: 1,
            weighting: WeightingChoice::Covariance,
            feedback: true,
            model: ModelChoice::Scenario,
            fault: None,
            layers: LayerNames::default(),
        };
        source.mission(&options).unwrap().thrusters
    };
    assert_eq!(thrusters(MISSION), ErringThruster::along_axes(0.01));
    let rotors = thrusters(&MISSION.replace("kite-jets", "space-cobot"));
    assert_eq!(rotors.iter().filter(|rotor| rotor.relative > 0.0).count(), 6);
    assert_eq!(thrusters(&MISSION.replace("kite-jets", "exact")), [ErringThruster::NONE; 12]);
}

/// A body of another size, how far its forces act, and what they are: mass (kg), moment of inertia (kg m^2), radius (m), force (N), torque (N m).
fn mission_of([mass, moment, radius_m, force, torque]: [f64; 5]) -> String {
    let tensor = |moment: f64| format!("[[{moment}, 0.0, 0.0], [0.0, {moment}, 0.0], [0.0, 0.0, {moment}]]");
    let (payload, arm_m) = (0.1 * mass, 0.3 * radius_m);
    format!(
        r#"format = 1
name = "any-size"
world = "open"
duration_s = 150.0
robot_radius_m = {radius_m}

[body]
mass_kg = {mass}
inertia_about_com_kg_m2 = {}

[payload]
mass_kg = {payload}
inertia_about_com_kg_m2 = {}
grasp_position_m = [{arm_m}, {}, 0.0]

[start]
position_m = [0.0, 0.0, 0.0]

[goal]
position_m = [2.0, 0.5, -0.3]

[plan]
position_lower_m = [-3.0, -3.0, -3.0]
position_upper_m = [5.0, 4.0, 3.0]
speed_limit_m_s = [0.05, 0.05, 0.05]
margin_m = 0.03

[propulsion]
kind = "exact"

[sensing]
preset = "ideal"

[fly]
mass_interval_share = [0.5, 2.0]
force_limit_n = [{force}, {force}, {force}]
torque_limit_n_m = [{torque}, {torque}, {torque}]
"#,
        tensor(moment),
        tensor(0.02 * moment),
        -0.6 * arm_m,
    )
}

/// A satellite thirty times as heavy as Astrobee, and one a tenth of it: their plans and controllers are of their size.
#[test]
fn robots_of_other_sizes_arrive() {
    let folder = scratch("sizes");
    for (size, slowest_s) in [([300.0, 70.0, 0.8, 5.0, 1.0], 75.0), ([1.0, 0.0018, 0.06, 0.05, 0.002], 60.0)] {
        let scenario = folder.join(format!("{}.toml", size[0]));
        fs::write(&scenario, mission_of(size)).unwrap();
        for controller in ["tube", "lqr"] {
            let out = folder.join(format!("{controller}-{}", size[0]));
            let arguments = ["fly", scenario.to_str().unwrap(), "--controller", controller, "--out"];
            assert_eq!(own(&[&arguments[..], &[out.to_str().unwrap()]].concat()), ExitCode::SUCCESS, "{size:?}");
            let summary = json(&out.join("summary.json"));
            let after_s = summary["mission_s"].as_f64().unwrap();
            assert!(after_s < slowest_s, "{size:?}, {controller}: {after_s} s");
            assert_eq!(summary["doubts"].as_array().map(Vec::len), Some(0), "{summary}");
        }
    }
}

#[test]
fn it_flies_missions_and_has_its_campaign_and_report() {
    let folder = scratch("hops");
    let (scenario, flown, campaign) = (folder.join("hop.toml"), folder.join("flown"), folder.join("campaign"));
    fs::write(&scenario, MISSION).unwrap();
    assert_eq!(own(&["fly", scenario.to_str().unwrap(), "--out", flown.to_str().unwrap()]), ExitCode::SUCCESS);
    for estimator in ["two-stage-rls", "two-stage-sdp"] {
        let out = folder.join(estimator);
        let arguments = ["fly", scenario.to_str().unwrap(), "--estimator", estimator, "--out", out.to_str().unwrap()];
        assert_eq!(own(&arguments), ExitCode::SUCCESS, "{estimator}");
    }
    let page = fs::read_to_string(flown.join("report.html")).unwrap();
    assert!(page.contains("kite-hop"), "the report tells of its mission");
    let arguments = ["campaign", scenario.to_str().unwrap(), "--missions", "2", "--out", campaign.to_str().unwrap()];
    assert_eq!(own(&arguments), ExitCode::SUCCESS);
    assert_eq!(
        fs::read_to_string(campaign.join("rows.csv")).unwrap().lines().filter(|row| !row.starts_with('#')).count(),
        3
    );
}
