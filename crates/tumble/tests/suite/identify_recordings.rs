//! From a recorded flight to the body: a simulated robot, pushed by what its servos make of its nozzle bytes, recorded as a bag.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]
#![allow(clippy::cast_possible_wrap, clippy::needless_range_loop)]

use crate::support::{scratch, tumble};
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use tumble::robots::shipped;
use tumble_astrobee::propulsion::{
    ForceAllocation, ImpellerMode, PropulsionCommand, PropulsionPlant, PropulsionSettings,
    constants::speed_of_byte_rad_s,
};
use tumble_dynamics::nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};
use tumble_dynamics::{FreeFlyer, InertialParameters, Integrator as _, MuntheKaas4, RigidBodyState};
use tumble_formats::FormatsError;
use tumble_formats::recording::flight::FlightReader;
use tumble_identification::MotionSample;
use tumble_identification::noise::Gaussian;
use tumble_lie::{LieGroup, Wrench};

use crate::support::ros1::{self, State};
use tumble_formats::testing::bag_writer::{BagWriter, Compression};

const STEP_NS: i64 = 16_000_000;
/// Commands come this long after the states that they answer.
const COMMAND_DELAY_NS: i64 = 5_000_000;
const START_NS: i64 = 1_600_000_000_000_000_000;
const SAMPLES: usize = 2500;

/// A flight as it was.
struct Flight {
    body: InertialParameters<f64>,
    states: Vec<State>,
    commands: Vec<PropulsionCommand>,
    /// What acted from each command on.
    realized: Vec<Wrench<f64>>,
    wanted: Vec<Wrench<f64>>,
}

/// Sines of distinct frequencies on all six axes, at times beyond what the nozzles give.
fn wanted(time_s: f64) -> Wrench<f64> {
    let axis = |i: usize, size: f64| {
        let hz = 0.06 + 0.023 * i as f64;
        size * ((TAU * hz * time_s).sin() + 0.7 * (TAU * (hz + 0.2) * time_s + i as f64).sin())
    };
    Wrench::new(
        Vector3::new(axis(0, 0.03), axis(1, 0.02), axis(2, 0.02)),
        Vector3::new(axis(3, 0.3), axis(4, 0.15), axis(5, 0.15)),
    )
}

fn fly() -> Flight {
    let robot = InertialParameters::about_com(
        9.5838,
        Vector3::zeros(),
        Matrix3::from_diagonal(&Vector3::new(0.1534, 0.1427, 0.1623)),
    );
    let cargo = InertialParameters::solid_box(3.0, [0.2, 0.15, 0.12]);
    let body = robot.with_payload(&cargo, &Isometry3::translation(-0.1, -0.25, 0.05));
    let flyer = FreeFlyer::new(body);
    let allocation = ForceAllocation::new(ImpellerMode::Nominal, Vector3::zeros());
    let mut noise = Gaussian::from_seed(11);
    let mut state = RigidBodyState::at_rest();
    let (mut states, mut commands, mut asked) = (Vec::new(), Vec::new(), Vec::new());
    let (mut plant, mut realized) = (None, Vec::new());
    let mut acting = Wrench::zero();
    let step = |state: &mut RigidBodyState<f64>, wrench: &Wrench<f64>, ns: i64| {
        for _ in 0..2 {
            *state = MuntheKaas4.step(&flyer, state, wrench, 0.0, ns as f64 * 0.5e-9).unwrap();
        }
    };
    for k in 0..SAMPLES {
        let time_ns = STEP_NS * k as i64;
        let turn = <UnitQuaternion<f64> as LieGroup>::exp(&noise.vector(5e-4));
        let truth = &state.world_from_body;
        let acceleration = flyer.forward(&state.twist_body, &acting);
        states.push(State {
            time_ns: START_NS + time_ns,
            pose: Isometry3::from_parts((truth.translation.vector + noise.vector(5e-4)).into(), truth.rotation * turn),
            velocity_world: truth.rotation * state.twist_body.linear + noise.vector(2e-3),
            rate_body: state.twist_body.angular + noise.vector(1e-3),
            acceleration_body: acceleration.acceleration_origin_body + noise.vector(3e-3),
        });
        let wrench = wanted(time_ns as f64 * 1e-9);
        let command = allocation.allocate_steps(&wrench).unwrap().bytes;
        step(&mut state, &acting, COMMAND_DELAY_NS);
        let plant = plant.get_or_insert_with(|| PropulsionPlant::settled(PropulsionSettings::PHYSICAL, &command));
        acting = plant.step_at_speeds(&command, command.impeller_speeds.map(speed_of_byte_rad_s));
        realized.push(acting);
        step(&mut state, &acting, STEP_NS - COMMAND_DELAY_NS);
        commands.push(command);
        asked.push(wrench);
    }
    Flight { body, states, commands, realized, wanted: asked }
}

/// Messages of a flight with their stamps: connection, stamp, payload.
type Messages = Vec<(u32, i64, Vec<u8>)>;

const EKF: (&str, &str) = ("ff_msgs/EkfState", "543b97822b033d7199b506ad4005f134");
const FAM: (&str, &str) = ("ff_msgs/FamCommand", "baf174131dee1a8b03d9d5feac8aa809");
const PMC: (&str, &str) = ("ff_hw_msgs/PmcCommand", "8083cc589ac2164cf53110420a56afbd");
const TELEMETRY: (&str, &str) = ("ff_hw_msgs/PmcTelemetry", "a2c2effcfbf47c9a5536cf2c22e8acb6");
const INERTIA: (&str, &str) = ("geometry_msgs/InertiaStamped", "ddee48caeab5a966c5e8d166654a9ac7");
const ODOMETRY: (&str, &str) = ("nav_msgs/Odometry", "cd5e73d190d741a2f92e81eda573aca7");
const WRENCH: (&str, &str) = ("geometry_msgs/WrenchStamped", "d78d3cb249ce23087ade7e7d0c40cfa7");

fn bag(connections: &[(&str, (&str, &str))], messages: &Messages) -> Vec<u8> {
    let mut writer = BagWriter::new(Compression::Lz4, 100_000);
    writer.bag_header(&[]);
    for (number, (topic, (type_name, md5))) in connections.iter().enumerate() {
        writer.connection(u32::try_from(number).unwrap(), topic, type_name, md5);
    }
    for (number, stamp_ns, payload) in messages {
        writer.message(*number, ros1::bag_time(*stamp_ns), payload);
    }
    writer.finish()
}

/// A flight as Astrobee records it: 0 states, 1 bytes, 2 telemetry.
fn astrobee(flight: &Flight) -> Messages {
    let mut messages = Vec::new();
    for (state, command) in flight.states.iter().zip(&flight.commands) {
        let time_ns = state.time_ns;
        messages.push((0, time_ns, ros1::ekf_state(state, 0)));
        messages.push((1, time_ns + COMMAND_DELAY_NS, ros1::pmc_command(time_ns + COMMAND_DELAY_NS, command)));
        messages.push((2, time_ns + 1_000_000, ros1::pmc_telemetry(time_ns + 1_000_000, command.impeller_speeds)));
    }
    messages
}

fn astrobee_topics(namespace: &str) -> [String; 3] {
    ["gnc/ekf", "hw/pmc/command", "hw/pmc/telemetry"].map(|topic| format!("{namespace}/{topic}"))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn read(path: &Path, robot: Option<&str>) -> Result<(Vec<MotionSample>, Vec<String>), FormatsError> {
    let mut reader = FlightReader::open(path, robot, &shipped())?;
    let mut samples = Vec::new();
    while let Some(sample) = reader.next_sample()? {
        samples.push(sample);
    }
    let warnings = reader.tally().unwrap().warnings(&reader.plan, &reader.topics);
    Ok((samples, warnings))
}

#[test]
fn a_recorded_flight_gives_the_body() {
    let flight = fly();
    let [a, b, c] = astrobee_topics("/bumble");
    let path = scratch("body").join("flight.bag");
    fs::write(&path, bag(&[(&a, EKF), (&b, PMC), (&c, TELEMETRY)], &astrobee(&flight))).unwrap();
    let output = tumble(&["identify", path.to_str().unwrap(), "--json"]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    for part in ["/bumble/gnc/ekf", "62.5 Hz  motion", "62.5 Hz  wrench", "62.5 Hz  impeller speed"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let mass = found["mass_kg"].as_f64().unwrap();
    let sigma = found["std"]["mass_kg"].as_f64().unwrap();
    let error = mass - flight.body.mass;
    assert!(sigma < 0.02 * flight.body.mass, "sigma {sigma}");
    assert!(error.abs() < 4.0 * sigma, "{mass} for {}: {error} of sigma {sigma}", flight.body.mass);
    // By byte as good as by name.
    let renamed = path.with_extension("csv");
    fs::copy(&path, &renamed).unwrap();
    assert_eq!(tumble(&["identify", renamed.to_str().unwrap(), "--json"]).stdout, output.stdout.clone());
}

/// The wrench of an interval is the mean of what acted in it: the old command until the new one came.
#[test]
fn the_wrench_of_an_interval_is_its_impulse() {
    let flight = fly();
    let [a, b, c] = astrobee_topics("");
    let path = scratch("impulse").join("flight.bag");
    fs::write(&path, bag(&[(&a, EKF), (&b, PMC), (&c, TELEMETRY)], &astrobee(&flight))).unwrap();
    let (samples, warnings) = read(&path, None).unwrap();
    assert_eq!(samples.len(), SAMPLES);
    // Before the first command nothing is known.
    assert_eq!(samples[0].wrench_body, None);
    assert_eq!(warnings, ["1 samples have no command of their interval, and no wrench"]);
    for k in 1..SAMPLES - 1 {
        let (before, after) = (flight.realized[k - 1], flight.realized[k]);
        let share = COMMAND_DELAY_NS as f64 / STEP_NS as f64;
        let found = samples[k].wrench_body.unwrap();
        let force = before.force * share + after.force * (1.0 - share);
        let torque = before.torque * share + after.torque * (1.0 - share);
        assert!((found.force - force).norm() < 1e-14 && (found.torque - torque).norm() < 1e-14, "sample {k}");
        let state = &flight.states[k];
        assert_eq!(samples[k].time_ns, state.time_ns);
        assert_eq!(samples[k].rate_body, Some(state.rate_body));
        assert_eq!(samples[k].velocity_origin_world, Some(state.velocity_world));
        assert_eq!(samples[k].acceleration_origin_body, Some(state.acceleration_body));
        assert!((samples[k].world_from_body.unwrap().inverse() * state.pose).translation.vector.norm() < 1e-12);
    }
}

/// Late, repeated and lost poses, garbage and foreign topics change nothing but the counts.
#[test]
fn disorder_is_put_right_and_said() {
    let flight = fly();
    let [a, b, c] = astrobee_topics("/bumble");
    let connections = [(&*a, EKF), (&*b, PMC), (&*c, TELEMETRY), ("/rosout", ("rosgraph_msgs/Log", "x"))];
    let folder = scratch("disorder");
    let messages = astrobee(&flight);
    let clean = folder.join("clean.bag");
    fs::write(&clean, bag(&connections, &messages)).unwrap();
    let mut disordered = messages.clone();
    for block in disordered.chunks_mut(60).step_by(5) {
        block.reverse();
    }
    let lost = ros1::ekf_state(&State { time_ns: START_NS + 7, ..copy(&flight.states[3]) }, 2);
    let mut skewed = copy(&flight.states[3]);
    skewed.time_ns = START_NS + 8;
    skewed.velocity_world.x = f64::NAN;
    disordered.insert(400, (0, START_NS, lost));
    disordered.insert(500, (0, START_NS, ros1::ekf_state(&skewed, 0)));
    disordered.insert(600, (0, START_NS, vec![1, 2, 3]));
    disordered.insert(700, (1, START_NS, pmc_of_one_module()));
    disordered.insert(800, (3, START_NS, b"hello".to_vec()));
    // A repeat of a pose that came just before.
    let repeated = disordered[1500].clone();
    let repeated =
        if repeated.0 == 0 { repeated } else { disordered.iter().skip(1500).find(|m| m.0 == 0).unwrap().clone() };
    disordered.push(messages.last().unwrap().clone());
    disordered.insert(1500, repeated);
    let path = folder.join("disordered.bag");
    fs::write(&path, bag(&connections, &disordered)).unwrap();
    let (expected, _) = read(&clean, None).unwrap();
    let (found, warnings) = read(&path, None).unwrap();
    assert_eq!(found.len(), expected.len());
    assert_eq!(found, expected);
    let warnings = warnings.join("\n");
    for said in [
        "came late and were put in order",
        "1 poses repeated a time",
        "1 poses are marked lost or invalid",
        "1 poses are not finite",
        "1 messages do not hold their fields",
        "1 commands are not for two modules",
    ] {
        assert!(warnings.contains(said), "{said}: {warnings}");
    }
}

fn copy(state: &State) -> State {
    State { ..*state }
}

fn pmc_of_one_module() -> Vec<u8> {
    ros1::Payload::header(START_NS + 9, "body").bytes(&1_u32.to_le_bytes()).bytes(&[0; 7]).0
}

#[test]
fn without_bytes_the_commanded_wrench_serves_about_the_reported_centre_of_mass() {
    let flight = fly();
    let folder = scratch("commanded");
    let center = Vector3::new(0.02, -0.03, 0.01);
    let mut messages = vec![(2, START_NS - 1_000_000, ros1::inertia(START_NS - 1_000_000, 9.0, &center))];
    for (state, wanted) in flight.states.iter().zip(&flight.wanted) {
        messages.push((0, state.time_ns, ros1::ekf_state(state, 0)));
        messages.push((1, state.time_ns, ros1::fam_command(state.time_ns, wanted)));
    }
    let connections = [("/gnc/ekf", EKF), ("/gnc/ctl/command", FAM), ("/mob/inertia", INERTIA)];
    let path = folder.join("flight.bag");
    fs::write(&path, bag(&connections, &messages)).unwrap();
    let (samples, warnings) = read(&path, None).unwrap();
    for (sample, wanted) in samples.iter().zip(&flight.wanted) {
        let wrench = sample.wrench_body.unwrap();
        assert!((wrench.force - wanted.force).norm() < 1e-15);
        assert!((wrench.torque - (wanted.torque + center.cross(&wanted.force))).norm() < 1e-15);
    }
    assert!(warnings[0].contains("commanded") && warnings[0].contains("saturation"), "{warnings:?}");
    // Without the report the torque is taken as it is, and that is said.
    fs::write(&path, bag(&connections[..2], &messages[1..].to_vec())).unwrap();
    let (samples, warnings) = read(&path, None).unwrap();
    assert!((samples[5].wrench_body.unwrap().torque - flight.wanted[5].torque).norm() < 1e-15);
    assert!(warnings[0].contains("for want of mob/inertia"), "{warnings:?}");
}

#[test]
fn measured_impeller_speeds_count_and_silent_ones_do_not() {
    let flight = fly();
    let [a, b, c] = astrobee_topics("");
    let path = scratch("speeds").join("flight.bag");
    let force = |speed: u8| {
        let mut messages = astrobee(&flight);
        for (number, stamp_ns, payload) in &mut messages {
            if *number == 2 {
                *payload = ros1::pmc_telemetry(*stamp_ns, [speed; 2]);
            }
        }
        fs::write(&path, bag(&[(&a, EKF), (&b, PMC), (&c, TELEMETRY)], &messages)).unwrap();
        let (samples, warnings) = read(&path, None).unwrap();
        (samples[100].wrench_body.unwrap().force.norm(), warnings.join("\n"))
    };
    let full = force(ImpellerMode::Nominal.speed_byte()).0;
    let (silent, said) = force(0);
    assert!((silent - full).abs() < 1e-15 && said.contains("no impeller speed is measured"), "{said}");
    // Thrust goes with the square of the speed.
    let (slow, said) = force(100);
    let ratio = (100.0 / f64::from(ImpellerMode::Nominal.speed_byte())).powi(2);
    assert!((slow - ratio * full).abs() < 1e-12 && !said.contains("impeller"), "{slow} {full}");
}

#[test]
fn commands_that_stop_leave_no_wrench() {
    let flight = fly();
    let [a, b, c] = astrobee_topics("");
    let path = scratch("stop").join("flight.bag");
    let end_ns = START_NS + 100 * STEP_NS;
    let messages = astrobee(&flight).into_iter().filter(|(number, stamp, _)| *number != 1 || *stamp < end_ns).collect();
    fs::write(&path, bag(&[(&a, EKF), (&b, PMC), (&c, TELEMETRY)], &messages)).unwrap();
    let (samples, _) = read(&path, None).unwrap();
    // Half a second after the last command.
    let first = 1 + samples.iter().skip(1).position(|s| s.wrench_body.is_none()).unwrap();
    let age_ns = samples[first].time_ns - (end_ns - STEP_NS + COMMAND_DELAY_NS);
    assert!((484_000_000..=500_000_000).contains(&age_ns), "{age_ns}");
    assert!(samples[first..].iter().all(|s| s.wrench_body.is_none()));
}

#[test]
fn another_robot_is_read_from_odometry_and_a_measured_wrench() {
    let flight = fly();
    let folder = scratch("odometry");
    let path = folder.join("flight.bag");
    let record = |frame: &str| {
        let mut messages = Vec::new();
        for (state, wanted) in flight.states.iter().zip(&flight.wanted) {
            messages.push((0, state.time_ns, ros1::odometry(state)));
            messages.push((1, state.time_ns, ros1::wrench_stamped(state.time_ns, frame, wanted)));
        }
        fs::write(&path, bag(&[("/odom", ODOMETRY), ("/wrench", WRENCH)], &messages)).unwrap();
    };
    record("body");
    let (samples, warnings) = read(&path, None).unwrap();
    assert_eq!((samples.len(), warnings.len()), (SAMPLES, 0), "{warnings:?}");
    for ((sample, state), wanted) in samples.iter().zip(&flight.states).zip(&flight.wanted) {
        assert!((sample.velocity_origin_world.unwrap() - state.velocity_world).norm() < 1e-12);
        assert_eq!(sample.rate_body, Some(state.rate_body));
        assert_eq!(sample.acceleration_origin_body, None);
        assert!((sample.wrench_body.unwrap().force - wanted.force).norm() < 1e-15);
    }
    record("world");
    let error = read(&path, None).unwrap_err();
    assert!(error.code() == "T030" && error.to_string().contains("frame `world`"), "{error}");
}

#[test]
fn what_cannot_be_used_is_refused_by_name() {
    let folder = scratch("refused");
    let path = folder.join("log.bin");
    let flight = fly();
    let state = ros1::ekf_state(&flight.states[0], 0);
    let refused = |bytes: &[u8], arguments: &[&str], code: &str, says: &[&str]| {
        fs::write(&path, bytes).unwrap();
        let output = tumble(&[&["identify", path.to_str().unwrap()], arguments].concat());
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        for say in says.iter().chain([&code]) {
            assert!(said.contains(say), "{say}: {said}");
        }
    };
    refused(b"#ROSBAG V1.2\n", &[], "T028", &["version 1.2"]);
    refused(b"SQLite format 3\0and more", &[], "T032", &["ros2 bag convert"]);
    let two = bag(
        &[("/bumble/gnc/ekf", EKF), ("/honey/gnc/ekf", EKF)],
        &vec![(0, START_NS, state.clone()), (1, START_NS, state.clone())],
    );
    refused(&two, &[], "T030", &["/bumble/gnc/ekf (bumble)", "/honey/gnc/ekf (honey)", "--robot"]);
    refused(&two, &["--robot", "queen"], "T030", &["robot `queen`"]);
    let other = bag(&[("/gnc/ekf", (EKF.0, "0123456789abcdef0123456789abcdef"))], &vec![(0, START_NS, state)]);
    refused(&other, &[], "T029", &["0123456789abcdef0123456789abcdef", EKF.1, "ff_msgs/EkfState"]);
    refused(&bag(&[("/x", ("a/B", "c"))], &vec![(0, START_NS, vec![])]), &[], "T030", &["no topic"]);
    let alone =
        bag(&[("/gnc/ekf", EKF)], &(0..50).map(|n| (0, START_NS, ros1::ekf_state(&flight.states[n], 0))).collect());
    refused(&alone, &[], "T030", &["no wrench", "PmcCommand", "FamCommand", "WrenchStamped"]);
    let mut undecodable = ros1::ekf_state(&flight.states[0], 0);
    undecodable[12..16].fill(0xff);
    let undecodable = bag(&[("/gnc/ekf", EKF)], &(0..1000).map(|n| (0, START_NS + n, undecodable.clone())).collect());
    refused(&undecodable, &[], "T030", &["1000 messages do not hold their fields"]);
    refused(b"t_s\n", &["--robot", "bumble"], "T014", &["--robot"]);
    // With a robot named, its streams are read and no other's.
    fs::write(&path, &two).unwrap();
    assert_eq!(read(&path, Some("/honey/")).unwrap().0.len(), 1);
}

#[test]
fn of_a_damaged_recording_without_a_flight_every_loss_is_said() {
    let folder = scratch("damaged");
    let whole = bag(&[("/gnc/ekf", EKF)], &vec![(0, START_NS, ros1::ekf_state(&fly().states[0], 0))]);
    let begin = |rest: &[u8]| [&whole[..13], rest].concat();
    let mut connections = BagWriter::new(Compression::None, 1 << 20);
    for number in 0..65_540 {
        connections.connection(number, &format!("/topic/{number}"), "a/B", "0123456789abcdef0123456789abcdef");
    }
    // Bytes after the magic; what the losses say, first and by their count.
    let cases = [
        ("zeros", begin(&[0; 500]), "damaged in 2 places, the first: byte 13: a record header"),
        ("random", begin(&[0x5b; 500]), "damaged in one place: byte 13: the file ends"),
        ("length", begin(&[&[0xff; 4][..], &[1; 99]].concat()), "damaged in one place: byte 13: the file ends"),
        ("connections", connections.finish(), "damaged in 4 places, the first: byte "),
    ];
    for (name, bytes, says) in cases {
        let path = folder.join(name);
        fs::write(&path, bytes).unwrap();
        for line in
            [vec!["identify", path.to_str().unwrap()], vec!["convert", path.to_str().unwrap(), "-", "--to", "csv"]]
        {
            let output = tumble(&line);
            let said = text(&output.stderr);
            assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{said}");
            let error = said.lines().position(|line| line.contains("error[T030]") && line.contains(says));
            let warning = said.lines().position(|line| line.starts_with("warning: ") && line.contains("byte "));
            assert!(error.is_some() && warning.is_some() && warning < error, "{name}: {said}");
        }
    }
}

#[test]
fn a_torn_recording_gives_its_beginning_and_says_so() {
    let flight = fly();
    let [a, b, c] = astrobee_topics("");
    let bytes = bag(&[(&a, EKF), (&b, PMC), (&c, TELEMETRY)], &astrobee(&flight));
    let path = scratch("torn").join("flight.bag");
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let (samples, warnings) = read(&path, None).unwrap();
    assert!(samples.len() > SAMPLES / 3 && samples.len() < 2 * SAMPLES / 3, "{}", samples.len());
    assert!(warnings.iter().any(|w| w.contains("damaged") && w.contains("everything behind is lost")), "{warnings:?}");
}

#[test]
fn several_files_are_one_recording() {
    let flight = fly();
    let [a, b, c] = astrobee_topics("/bumble");
    let connections = [(&*a, EKF), (&*b, PMC), (&*c, TELEMETRY)];
    let folder = scratch("several");
    let messages = astrobee(&flight);
    let at = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    // What is sent at once, and what comes later; a hundred messages stand in both.
    let of = |keep: &dyn Fn(usize, u32) -> bool| -> Messages {
        let kept = messages.iter().enumerate().filter(|(k, (number, ..))| keep(*k, *number));
        kept.map(|(_, message)| message.clone()).collect()
    };
    let whole = bag(&connections, &messages);
    fs::write(at("whole.bag"), &whole).unwrap();
    fs::write(at("flight_immediate.bag"), bag(&connections, &of(&|k, number| number == 0 || (300..400).contains(&k))))
        .unwrap();
    fs::write(at("flight_delayed.bag"), bag(&connections, &of(&|k, number| number != 0 || (300..400).contains(&k))))
        .unwrap();
    fs::write(at("other.mcap"), tumble_formats::testing::ROS2_LZ4).unwrap();
    let alone = tumble(&["identify", &at("whole.bag"), "--json"]);
    let both = ["flight_immediate.bag", "flight_delayed.bag", "other.mcap"].map(at);
    for order in [[0, 1, 2], [2, 1, 0]] {
        let [x, y, z] = order.map(|k| both[k].as_str());
        let found = tumble(&["identify", x, y, z, "--json"]);
        let said = text(&found.stderr);
        assert!(said.contains("100 messages stand in two files and were taken once"), "{said}");
        assert!(said.contains("62.5 Hz  motion") || said.contains("motion"), "{said}");
        let body = |output: &std::process::Output| {
            let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
            (value["mass_kg"].clone(), value["inertia_about_com_kg_m2"].clone(), value["samples_used"].clone())
        };
        assert_eq!(body(&found), body(&alone));
    }
    // As rows, the output last.
    let rows = |inputs: &[&str]| {
        let output = tumble(&[&["convert"], inputs, &["-", "--to", "csv"]].concat());
        (text(&output.stdout), text(&output.stderr), output.status.code())
    };
    assert_eq!(rows(&[&both[0], &both[1]]).0, rows(&[&at("whole.bag")]).0);
    // A damaged part is named and the rest read.
    let delayed = fs::read(&both[1]).unwrap();
    fs::write(at("cut.bag"), &delayed[..delayed.len() / 2]).unwrap();
    let (cut, said, code) = rows(&[&both[0], &at("cut.bag")]);
    assert!(code == Some(0) && said.contains("cut.bag: the file is damaged"), "{said}");
    assert_eq!(cut.lines().count(), SAMPLES + 1);
    // What is no part of a recording.
    fs::write(at("log.csv"), "t_s\n0\n").unwrap();
    let (_, said, code) = rows(&[&both[0], &at("log.csv")]);
    assert!(code == Some(2) && said.contains("T014") && said.contains("log.csv is neither"), "{said}");
    let (_, said, code) = rows(&[&both[0], &at("absent.bag")]);
    assert!(code == Some(2) && said.contains("T001"), "{said}");
    let many: Vec<&str> = vec![&both[0]; 17];
    let (_, said, code) = rows(&many);
    assert!(code == Some(2) && said.contains("at most 16"), "{said}");
}

/// Pairs of thrusters along each axis, off the axes, so that they also turn.
fn thrusters() -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let mut all = Vec::new();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            for arm in [-0.15, 0.15] {
                let (mut position, mut direction) = (Vector3::zeros(), Vector3::zeros());
                direction[axis] = sign;
                position[(axis + 1) % 3] = arm;
                position[axis] = -0.1 * sign;
                all.push((position, direction));
            }
        }
    }
    all
}

/// Twelve thrusters of 0.2 N, on and off by chance, as PX4 logs them: positions at 50 Hz, attitude and rate at 100 Hz, commands at 10 Hz.
fn px4_flight(body: &InertialParameters<f64>) -> (Vec<u8>, String) {
    use tumble_formats::testing::ulog_writer::{UlogWriter, floats};
    const MILLISECOND_NS: u64 = 1_000_000;
    let mut file = UlogWriter::new();
    file.format("vehicle_local_position:uint64_t timestamp;uint64_t timestamp_sample;float x;float y;float z;float vx;float vy;float vz;");
    file.format("vehicle_attitude:uint64_t timestamp;uint64_t timestamp_sample;float[4] q;");
    file.format("vehicle_angular_velocity:uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz;");
    file.format("actuator_motors:uint64_t timestamp;float[12] control;");
    let names = ["vehicle_local_position", "vehicle_attitude", "vehicle_angular_velocity", "actuator_motors"];
    for (number, name) in (0..).zip(names) {
        file.subscribe(number, 0, name);
    }
    let thrusters = thrusters();
    let flyer = FreeFlyer::new(*body);
    let (mut state, mut noise) = (RigidBodyState::at_rest(), Gaussian::from_seed(5));
    let mut acting = Wrench::zero();
    for step in 0..4000_u64 {
        let time_us = 1_000_000 + step * 10_000;
        if step % 10 == 0 {
            let on: Vec<f64> = thrusters.iter().map(|_| if noise.vector(1.0).x > 0.5 { 1.0 } else { 0.0 }).collect();
            acting = thrusters.iter().zip(&on).fold(Wrench::zero(), |sum, ((position, direction), on)| {
                let force = direction * (0.2 * on);
                Wrench::new(sum.torque + position.cross(&force), sum.force + force)
            });
            file.data(3, time_us, &floats(&on));
        }
        let sampled = |numbers: &[f64]| [&time_us.to_le_bytes()[..], &floats(numbers)].concat();
        let pose = &state.world_from_body;
        let turn = pose.rotation * <UnitQuaternion<f64> as LieGroup>::exp(&noise.vector(5e-4));
        let rate = state.twist_body.angular + noise.vector(1e-3);
        file.data(1, time_us + 500, &sampled(&[turn.w, turn.i, turn.j, turn.k]));
        file.data(2, time_us + 500, &sampled(rate.as_slice()));
        if step % 2 == 0 {
            let (at, moves) = (
                pose.translation.vector + noise.vector(5e-4),
                pose.rotation * state.twist_body.linear + noise.vector(2e-3),
            );
            file.data(0, time_us + 700, &sampled(&[at.as_slice(), moves.as_slice()].concat()));
        }
        for _ in 0..2 {
            state = MuntheKaas4.step(&flyer, &state, &acting, 0.0, 5e-9 * MILLISECOND_NS as f64).unwrap();
        }
    }
    let mut told = "format = 1\n".to_owned();
    for (k, (position, direction)) in thrusters.iter().enumerate() {
        let (position, direction) = (position.as_slice(), direction.as_slice());
        let _ = writeln!(told, "[[thruster]]\ncolumn = \"actuator_motors.control[{k}]\"\nthrust_n = 0.2");
        let _ = writeln!(told, "position_m = {position:?}\ndirection = {direction:?}");
    }
    (file.finish(), told)
}

#[test]
fn a_ulog_and_its_actuators_give_the_body() {
    let folder = scratch("px4");
    let inertia = Matrix3::from_diagonal(&Vector3::new(0.05, 0.06, 0.07));
    let body = InertialParameters::about_com(4.0, Vector3::new(0.01, -0.02, 0.005), inertia);
    let (file, told) = px4_flight(&body);
    let at = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    fs::write(at("flight.ulg"), file).unwrap();
    fs::write(at("actuators.toml"), told).unwrap();
    let (log, actuators) = (at("flight.ulg"), at("actuators.toml"));
    let output = tumble(&["identify", &log, "--actuators", &actuators, "--json"]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("vehicle_attitude") && said.contains("100.0 Hz  attitude"), "{said}");
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let (mass, sigma) = (number(&found["mass_kg"]), number(&found["std"]["mass_kg"]));
    println!("mass {mass} +- {sigma}, centre of mass {}", found["com_m"]);
    assert!((mass - body.mass).abs() < 4.0 * sigma && sigma < 0.1, "{mass} +- {sigma}");
    for (k, truth) in [0.01, -0.02, 0.005].into_iter().enumerate() {
        let (center, sigma) = (number(&found["com_m"][k]), number(&found["std"]["com_m"][k]));
        assert!((center - truth).abs() < 4.0 * sigma && sigma < 0.005, "{k}: {center} +- {sigma}");
    }
    // The same from the table that it is converted to.
    let converted = tumble(&["convert", &log, &at("flight.csv")]);
    assert_eq!(converted.status.code(), Some(0), "{}", text(&converted.stderr));
    let again = tumble(&["identify", &at("flight.csv"), "--actuators", &actuators, "--json"]);
    let again: serde_json::Value = serde_json::from_slice(&again.stdout).unwrap();
    // A quaternion of the table is normalised once more: the last bit may differ, and with it whether a step of less than 0.03 sigma is the last.
    assert!((number(&again["mass_kg"]) - mass).abs() < 1e-2 * sigma, "{} {mass}", again["mass_kg"]);
    assert_eq!(tumble(&["convert", &log, &at("flight.mcap")]).status.code(), Some(0));
    assert_eq!(tumble(&["convert", &log, &at("flight.tum")]).status.code(), Some(0));
    // Without what the commands give there is no wrench, and of the motion alone something can be said.
    let alone = tumble(&["identify", &log]);
    let said = text(&alone.stderr);
    assert!(alone.status.code() == Some(2) && said.contains("T030") && said.contains("--actuators FILE"), "{said}");
    assert_ne!(tumble(&["identify", &log, "--dry-run"]).status.code(), Some(2));
    let twice = tumble(&["identify", &log, &log]);
    let said = text(&twice.stderr);
    assert!(twice.status.code() == Some(2) && said.contains("is a ULog, which is a recording of its own"), "{said}");
    let named = tumble(&["identify", &log, "--robot", "a"]);
    assert!(named.status.code() == Some(2) && text(&named.stderr).contains("T014"));
}
