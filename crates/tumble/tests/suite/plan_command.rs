//! `tumble plan` as a user meets it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::support::page_checks::findings_of_any;
use crate::support::{json, number, scratch, stderr, tumble_in};
use serde_json::Value;
use std::fs;
use std::path::Path;
use tumble::scenario::{EMBEDDED, PlanningProblem, ScenarioSource};
use tumble_dynamics::World;
use tumble_dynamics::nalgebra::{Point3, Quaternion, UnitQuaternion, Vector3};
use tumble_lie::Pose;

/// The rows of a plan: time, position, attitude, velocity, rate, acceleration, force, torque.
struct Row {
    time_s: f64,
    world_from_body: Pose<f64>,
    velocity: Vector3<f64>,
    rate_body: Vector3<f64>,
    acceleration_world: Vector3<f64>,
    force_world: Vector3<f64>,
}

fn rows(path: &Path) -> Vec<Row> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let cell = |name: &str| cells[names.iter().position(|n| *n == name).unwrap()];
        let three = |group: &str| Vector3::from(["x", "y", "z"].map(|axis| cell(&format!("{group}_{axis}"))));
        let rotation = Quaternion::new(cell("q_w"), cell("q_x"), cell("q_y"), cell("q_z"));
        let rotation = UnitQuaternion::new_normalize(rotation);
        Row {
            time_s: cell("t_s"),
            world_from_body: Pose::from_parts(three("p").into(), rotation),
            velocity: three("v"),
            rate_body: three("w"),
            acceleration_world: rotation * three("a"),
            force_world: rotation * three("f"),
        }
    };
    lines.map(row).collect()
}

/// Points on the surfaces of the body's ellipsoids, body axes.
fn surface(problem: &PlanningProblem) -> Vec<Point3<f64>> {
    let mut points = Vec::new();
    for part in problem.body.parts() {
        for i in 0..=12 {
            for j in 0..24 {
                let (a, b) = (f64::from(i) * std::f64::consts::PI / 12.0, f64::from(j) * std::f64::consts::PI / 12.0);
                let unit = Vector3::new(a.sin() * b.cos(), a.sin() * b.sin(), a.cos());
                points.push(part.body_from_ellipsoid * Point3::from(unit.component_mul(&part.semi_axes)));
            }
        }
    }
    points
}

/// What a point is in, by no formula of the planner; a hair is forgiven, since plans touch what they go around.
fn hit(world: &World, problem: &PlanningProblem, point: &Vector3<f64>, time_s: f64) -> Option<String> {
    const HAIR_M: f64 = 1e-6;
    for (index, obstacle) in world.obstacles.iter().enumerate() {
        let mut center = obstacle.world_from_ellipsoid.translation.vector;
        if let Some(motion) = problem.obstacle_motions.iter().find(|motion| motion.obstacle == index) {
            if !(motion.appear_s..=motion.vanish_s).contains(&time_s) {
                continue;
            }
            center += motion.velocity_world * time_s;
        }
        let local = obstacle.world_from_ellipsoid.rotation.inverse() * (point - center);
        if local.component_div(&obstacle.semi_axes.add_scalar(-HAIR_M)).norm() < 1.0 {
            return Some(format!("obstacle {index}"));
        }
    }
    let inside = |lower: &Vector3<f64>, upper: &Vector3<f64>, by: f64| {
        (0..3).all(|axis| point[axis] > lower[axis] + by && point[axis] < upper[axis] - by)
    };
    if let Some(index) = world.keep_out.iter().position(|b| inside(&b.lower_world, &b.upper_world, HAIR_M)) {
        return Some(format!("keep-out box {index}"));
    }
    let is_kept_in =
        world.keep_in.is_empty() || world.keep_in.iter().any(|b| inside(&b.lower_world, &b.upper_world, -HAIR_M));
    (!is_kept_in).then(|| "the hull".to_owned())
}

/// That a plan's rows are one motion, within its limits, clear of everything, from the start to the goal.
fn check_plan(name: &str, folder: &Path) -> Vec<Row> {
    let source = ScenarioSource::find(folder.join("scenario.toml").to_str().unwrap()).unwrap();
    let problem = source.planning_problem().unwrap();
    let rows = rows(&folder.join("plan.csv"));
    let mass = problem.belief.parameters().mass;
    let points = surface(&problem);
    let first = &rows[0];
    assert!((first.world_from_body.translation.vector - problem.start.position).norm() < 1e-12, "{name}");
    for pair in rows.windows(2) {
        let (from, to) = (&pair[0], &pair[1]);
        let step_s = to.time_s - from.time_s;
        assert!(step_s > 0.0 && step_s < 0.1 + 1e-6, "{name}: {} to {}", from.time_s, to.time_s);
        // Constant acceleration from row to row.
        let velocity = from.velocity + from.acceleration_world * step_s;
        let position = from.world_from_body.translation.vector
            + from.velocity * step_s
            + from.acceleration_world * (0.5 * step_s * step_s);
        assert!((to.velocity - velocity).norm() < 1e-9, "{name} at {}", from.time_s);
        assert!((to.world_from_body.translation.vector - position).norm() < 1e-9, "{name} at {}", from.time_s);
        let turned = from.world_from_body.rotation.angle_to(&to.world_from_body.rotation);
        let most = problem.limits.rate_rad_s * step_s;
        assert!(turned <= most + 1e-7, "{name} at {}: turns by {turned}", from.time_s);
    }
    for row in &rows {
        let position = row.world_from_body.translation.vector;
        for axis in 0..3 {
            let box_m = &problem.limits.position;
            assert!(
                position[axis] >= box_m.lower_world[axis] - 1e-9 && position[axis] <= box_m.upper_world[axis] + 1e-9
            );
            assert!(row.velocity[axis].abs() <= problem.limits.speed_m_s[axis] + 1e-9, "{name} at {}", row.time_s);
            let force = mass * row.acceleration_world[axis].abs();
            assert!(force <= problem.limits.force_n[axis] * (1.0 + 1e-9), "{name} at {}: {force} N", row.time_s);
        }
        if row.rate_body == Vector3::zeros() && problem.goal.attitude.is_none() {
            assert!((row.force_world - row.acceleration_world * mass).norm() < 1e-9, "{name} at {}", row.time_s);
        }
        for point in &points {
            let at = row.world_from_body * point;
            let hit = hit(&problem.world, &problem, &at.coords, row.time_s);
            assert!(hit.is_none(), "{name} at {} s: {hit:?}", row.time_s);
        }
    }
    let last = rows.last().unwrap();
    let away = (last.world_from_body.translation.vector - problem.goal.position).norm();
    assert!(away <= problem.goal.radius_m + 1e-9, "{name}: ends {away} m away");
    assert!(last.velocity.norm() <= problem.goal.speed_m_s + 1e-9, "{name}: ends at {} m/s", last.velocity.norm());
    if let Some(attitude) = problem.goal.attitude {
        assert!(last.world_from_body.rotation.angle_to(&attitude) < 1e-6, "{name}");
    }
    rows
}

#[test]
fn plans_of_embedded_scenarios_hold_and_know_their_gap() {
    let folder = scratch("embedded");
    for (name, set) in [("iss-slalom", None), ("iss-slalom", Some("2")), ("granite-room", None), ("jem10", None)] {
        let mut arguments = vec!["plan", name, "--budget", "3000", "--json"];
        arguments.extend(set.iter().flat_map(|set| ["--obstacle-set", set]));
        let output = tumble_in(&folder, &arguments);
        assert_eq!(output.status.code(), Some(0), "{name}: {}", stderr(&output));
        let found = json(&output);
        let place = folder.join(found["folder"].as_str().unwrap());
        let rows = check_plan(name, &place);
        let (cost, bound) = (number(&found["cost"]), number(&found["lower_bound"]));
        assert!((rows.last().unwrap().time_s - cost).abs() < 1e-6, "{name}");
        assert!(bound > 0.0 && bound <= cost, "{name}: {bound} {cost}");
        assert!((number(&found["gap"]) - (cost - bound) / cost).abs() < 1e-12);
        assert_eq!(
            found["obstacle_set"].as_u64(),
            set.or(if name == "jem10" { None } else { Some("1") }).map(|s| s.parse().unwrap())
        );
        let costs: Vec<f64> = found["history"].as_array().unwrap().iter().map(|step| number(&step["cost"])).collect();
        assert!(
            costs.windows(2).all(|pair| pair[1] < pair[0]) && (costs.last().unwrap() - cost).abs() < 1e-9,
            "{name}"
        );
        for picture in ["plan_top.svg", "plan_side.svg"] {
            let text = fs::read_to_string(place.join(picture)).unwrap();
            let obstacles = ScenarioSource::find(place.join("scenario.toml").to_str().unwrap()).unwrap();
            let obstacles = obstacles.planning_problem().unwrap().world.obstacles.len();
            assert_eq!(text.matches("class=\"obstacle\"").count(), obstacles, "{name} {picture}");
            assert!(!text.contains("NaN") && !text.contains("inf") && text.trim_end().ends_with("</svg>"));
            assert_eq!(text.matches("class=\"path\"").count(), 1);
        }
    }
}

#[test]
fn a_payload_that_must_turn_passes_the_gap_and_its_sphere_does_not() {
    let folder = scratch("gap");
    let output = tumble_in(&folder, &["plan", "iss-gap", "--first", "--json", "--out", "gap"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let rows = check_plan("iss-gap", &folder.join("gap"));
    // Where the middle is in the slit, 0.2 m on either side, the long semi-axis of 0.3 m cannot lie across.
    for row in rows.iter().filter(|row| (row.world_from_body.translation.vector.y + 8.6).abs() < 0.05) {
        let across = (row.world_from_body.rotation * Vector3::x()).x;
        assert!(across.abs() < 0.51, "{} s: {across}", row.time_s);
    }
    let text = String::from_utf8(tumble_in(&folder, &["scenario", "show", "iss-gap"]).stdout).unwrap();
    let sphere = text.replace("semi_axes_m = [0.30, 0.15, 0.15]", "semi_axes_m = [0.30, 0.30, 0.30]");
    assert_ne!(text, sphere);
    fs::write(folder.join("sphere.toml"), sphere).unwrap();
    let output = tumble_in(&folder, &["plan", "sphere.toml", "--budget", "20000", "--json"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    let found = json(&output);
    // Proven, or ended by the budget with what blocks.
    assert!(found["status"] == "infeasible" || found["status"] == "budget-spent", "{found}");
    assert!(found["blockers"][0].as_str().unwrap().contains("keep-out box"), "{found}");
}

#[test]
fn the_same_seed_gives_the_same_files() {
    let folder = scratch("seed");
    let plan = |seed: &str| {
        let output = tumble_in(&folder, &["plan", "iss-slalom", "--budget", "2000", "--seed", seed, "--json"]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        folder.join(json(&output)["folder"].as_str().unwrap())
    };
    let (first, second, other) = (plan("5"), plan("5"), plan("6"));
    assert!(first.ends_with("tumble-out/plan-iss-slalom-5") && second.ends_with("plan-iss-slalom-5-2"));
    for name in ["plan.csv", "plan.json", "plan_top.svg", "plan_side.svg", "report.html", "scenario.toml", "run.json"] {
        assert_eq!(fs::read(first.join(name)).unwrap(), fs::read(second.join(name)).unwrap(), "{name}");
    }
    assert_eq!(findings_of_any(&fs::read_to_string(first.join("report.html")).unwrap()), [""; 0]);
    assert_ne!(fs::read(first.join("plan.csv")).unwrap(), fs::read(other.join("plan.csv")).unwrap());
    let timings: Value = serde_json::from_str(&fs::read_to_string(first.join("timings.json")).unwrap()).unwrap();
    assert!(number(&timings["first_plan_wall_s"]) <= number(&timings["wall_s"]));
    assert!(!fs::read_to_string(first.join("plan.json")).unwrap().contains("wall"));
    // What was written can be planned again.
    let again = tumble_in(
        &folder,
        &["plan", "tumble-out/plan-iss-slalom-5/scenario.toml", "--budget", "2000", "--out", "again"],
    );
    assert_eq!(again.status.code(), Some(0), "{}", stderr(&again));
    assert_eq!(fs::read(first.join("plan.json")).unwrap(), fs::read(folder.join("again/plan.json")).unwrap());
}

/// The wrenches of a plan, applied by the simulator, which knows nothing of planning.
#[test]
fn the_simulator_flies_the_wrenches_of_a_plan() {
    let folder = scratch("fly");
    let text = String::from_utf8(tumble_in(&folder, &["scenario", "show", "iss-slalom"]).stdout).unwrap();
    fs::write(folder.join("plan.toml"), format!("{text}margin_m = 0.03\n")).unwrap();
    let output = tumble_in(&folder, &["plan", "plan.toml", "--budget", "3000", "--out", "plan"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let rows = check_plan("plan.toml", &folder.join("plan"));
    let last = rows.last().unwrap();
    let head = text.split("[drive]").next().unwrap();
    let drive = "[drive]\ncontroller = \"none\"\nwrenches = \"plan/plan.csv\"\n[propulsion]\nkind = \"exact\"\n";
    fs::write(folder.join("fly.toml"), format!("{head}{drive}")).unwrap();
    let duration = format!("{}", last.time_s);
    let output = tumble_in(&folder, &["simulate", "fly.toml", "--duration", &duration, "--out", "flight", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let found = json(&output);
    assert_eq!(found["events"].as_array().unwrap().len(), 0);
    assert!(number(&found["to_goal"]["distance_m"]) < 0.22, "{found}");
    assert!(
        (number(&found["top_speed_m_s"]) - rows.iter().map(|row| row.velocity.norm()).fold(0.0, f64::max)).abs() < 1e-3
    );
}

#[test]
fn what_cannot_be_planned_is_said_with_what_blocks() {
    let folder = scratch("blocked");
    let shown = |name: &str| String::from_utf8(tumble_in(&folder, &["scenario", "show", name]).stdout).unwrap();
    let (slalom, granite) = (shown("iss-slalom"), shown("granite-room"));
    let obstacle = |center: &str, more: &str| {
        format!("\n[[obstacles]]\ncenter_m = {center}\nsemi_axes_m = [0.3, 0.3, 0.3]\n{more}")
    };
    let wall = "\n[[keep_out]]\nlower_m = [9.0, -8.8, 3.0]\nupper_m = [13.0, -8.7, 7.0]\n";
    for (text, status, says) in [
        (
            slalom.clone() + &obstacle("[10.8, -9.6, 4.8]", ""),
            "infeasible",
            "starts in obstacle 2 at (10.80, -9.60, 4.80) m",
        ),
        (slalom.clone() + &obstacle("[10.8, -7.75, 5.2]", ""), "infeasible", "the goal lies in obstacle 2"),
        (slalom.clone() + wall, "", "keep-out box 4"),
        (
            slalom.replace("[start]\npoint = \"A\"", "[start]\npoint = \"A\"\nvelocity_m_s = [0.0, 0.06, 0.0]"),
            "infeasible",
            "0.06",
        ),
        (slalom.replace("[goal]\npoint = \"B\"", "[goal]\nposition_m = [10.8, -6.0, 4.8]"), "infeasible", "-6"),
        (slalom.replace("force_limit_n = [0.1, 0.1, 0.1]", "force_limit_n = [0.1, 0.0, 0.1]"), "infeasible", "along y"),
        (
            slalom.replace("speed_limit_m_s = [0.05, 0.05, 0.05]", "speed_limit_m_s = [0.05, 0.0, 0.05]"),
            "infeasible",
            "along y",
        ),
        (
            granite
                .replace("obstacle_set = 1", "obstacle_set = 2")
                .replace("[goal]\npoint = \"B\"", "[goal]\nposition_m = [0.4, -0.4, -0.76]")
                .replace("goal_radius_m = 0.167", "goal_radius_m = 0.0"),
            "infeasible",
            "the goal lies in obstacle 1",
        ),
        (
            granite
                .replace("obstacle_set = 1", "obstacle_set = 4")
                .replace("[goal]\npoint = \"B\"", "[goal]\nposition_m = [0.4, -0.4, -0.76]")
                .replace("goal_radius_m = 0.167", "goal_radius_m = 0.0"),
            "infeasible",
            "the goal lies in obstacle 4",
        ),
    ] {
        fs::write(folder.join("blocked.toml"), &text).unwrap();
        let output = tumble_in(&folder, &["plan", "blocked.toml", "--budget", "5000", "--json"]);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(3), "{says}: {said}");
        let found = json(&output);
        // A wall may be proven to be one, or end the search by its budget.
        let is_as_said = if status.is_empty() { found["status"] != "feasible" } else { found["status"] == status };
        assert!(is_as_said, "{says}: {said}");
        assert!(said.contains("no plan: ") && said.contains("remedy: ") && said.contains(says), "{says}: {said}");
        assert!(found["cost"].is_null() && found["arcs"].is_null(), "{says}");
        let place = folder.join(found["folder"].as_str().unwrap());
        assert!(!place.join("plan.csv").exists() && place.join("plan_top.svg").exists());
    }
}

#[test]
fn what_is_wrong_is_named_with_its_line() {
    let good = "format = 1\nname = \"x\"\nworld = \"iss\"\nduration_s = 10.0\n[start]\npoint = \"A\"\n[goal]\npoint = \"B\"\n\
                [plan]\nforce_limit_n = [0.1, 0.1, 0.1]\nspeed_limit_m_s = [0.05, 0.05, 0.05]\ngoal_radius_m = 0.1\nmargin_m = 0.0\n\
                position_lower_m = [10.3, -9.8, 4.2]\nposition_upper_m = [11.2, -7.5, 5.3]\n\
                [[plan.body]]\nsemi_axes_m = [0.2, 0.1, 0.1]\n[[keep_out]]\nlower_m = [0, 0, 0]\nupper_m = [1, 1, 1]\n\
                [[obstacles]]\ncenter_m = [0, 0, 0]\nsemi_axes_m = [1, 1, 1]\nappear_s = 3.0\n";
    ScenarioSource::parse(Path::new("good.toml"), good).unwrap().planning_problem().unwrap();
    for (from, to, place, expected) in [
        ("force_limit_n", "force_limits_n", "line 10, column 1", "did you mean `force_limit_n`?"),
        ("[0.1, 0.1, 0.1]\nspeed", "[0.1, -0.1, 0.1]\nspeed", "line 10", "-0.1: zero or more"),
        ("[0.1, 0.1, 0.1]\nspeed", "[0.1, nan, 0.1]\nspeed", "line 10", "NaN"),
        ("[0.05, 0.05, 0.05]", "[0.05, inf, 0.05]", "line 11", "finite"),
        ("goal_radius_m = 0.1", "goal_radius_m = -0.1", "line 12", "zero or more"),
        ("margin_m = 0.0", "margin_m = nan", "line 13", "zero or more"),
        ("position_upper_m = [11.2,", "position_upper_m = [10.2,", "line 15", "position_lower_m"),
        ("position_upper_m = [11.2, -7.5, 5.3]\n", "", "line 14", "`position_upper_m` is needed"),
        ("[0.2, 0.1, 0.1]", "[0.2, -0.1, 0.1]", "line 17", "positive"),
        ("[0.2, 0.1, 0.1]", "[0.2, nan, 0.1]", "line 17", "finite"),
        ("[[plan.body]]\nsemi_axes_m", "[[plan.body]]\nsemi_axis_m", "line 17", "did you mean `semi_axes_m`?"),
        ("upper_m = [1, 1, 1]", "upper_m = [1, 0, 1]", "line 20", "larger"),
        ("appear_s = 3.0", "appear_s = -3.0", "line 24", "0 or later"),
        ("appear_s = 3.0", "appear_s = 3.0\nvanish_s = 2.0", "line 25", "after `appear_s`"),
        ("[start]\npoint = \"A\"", "[start]\npoint = \"A\"\nrate_rad_s = [0, 0, 1]", "line 7", "without a turn"),
        ("[goal]\npoint = \"B\"\n", "", "line 1", "needs a `[goal]`"),
        ("world = \"iss\"", "world = \"isss\"", "line 3", "did you mean `iss`?"),
    ] {
        assert!(good.contains(from), "{from}");
        let text = good.replacen(from, to, 1);
        let outcome = ScenarioSource::parse(Path::new("bad.toml"), &text)
            .and_then(|source| source.planning_problem().map(|_| ()));
        let message = outcome.err().unwrap_or_else(|| panic!("accepted: {to}")).to_string();
        assert!(message.contains(place) && message.contains(expected), "{to}: {message}");
    }
    let open = "format = 1\nname = \"x\"\nworld = \"open\"\nduration_s = 1\n[start]\nposition_m = [0, 0, 0]\n[goal]\nposition_m = [1, 0, 0]\n";
    let open = ScenarioSource::parse(Path::new("open.toml"), open).unwrap();
    open.flight().unwrap();
    assert!(
        open.planning_problem().unwrap_err().to_string().contains("give `position_lower_m` and `position_upper_m`")
    );
    // Simulate checks the plan's table too.
    let bad = good.replacen("margin_m = 0.0", "margin_m = -1.0", 1);
    assert!(ScenarioSource::parse(Path::new("bad.toml"), &bad).unwrap().flight().is_err());
}

#[test]
fn on_the_table_height_and_tilt_stay() {
    let base = "format = 1\nname = \"x\"\nworld = \"granite\"\nduration_s = 1\n[start]\npoint = \"A\"\n[goal]\npoint = \"B\"\n";
    let problem = ScenarioSource::parse(Path::new("x"), base).unwrap().planning_problem().unwrap();
    let limits = problem.limits.position;
    assert_eq!(
        (limits.lower_world.z.to_bits(), limits.upper_world.z.to_bits()),
        ((-0.76_f64).to_bits(), (-0.76_f64).to_bits())
    );
    assert_eq!(
        (limits.lower_world.x.to_bits(), limits.upper_world.y.to_bits()),
        ((-0.75_f64).to_bits(), 0.75_f64.to_bits())
    );
    for (from, to, says) in [
        ("point = \"B\"", "position_m = [0, 0, -0.7]", "height"),
        ("point = \"B\"", "point = \"B\"\nquaternion_xyzw = [1, 0, 0, 0]", "upright"),
        ("point = \"A\"", "point = \"A\"\nvelocity_m_s = [0, 0, 0.01]", "along z"),
    ] {
        let text = base.replacen(from, to, 1);
        let error = ScenarioSource::parse(Path::new("x"), &text).unwrap().planning_problem().unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn options_that_make_no_sense_are_refused_before_anything_is_written() {
    let folder = scratch("options");
    for (options, code) in [
        (&["--budget", "0"][..], "T014"),
        (&["--time-limit", "0"], "T014"),
        (&["--time-limit", "nan"], "T014"),
        (&["--time-limit", "-1"], "T014"),
        (&["--time-limit", "1e9"], "T014"),
        (&["--budget", "10", "--time-limit", "1"], "cannot be used with"),
        (&["--objective", "beauty"], "possible values"),
        (&["--obstacle-set", "7"], "T026"),
    ] {
        let output = tumble_in(&folder, &[&["plan", "iss-slalom"], options].concat());
        assert_eq!(output.status.code(), Some(2), "{options:?}");
        assert!(stderr(&output).contains(code), "{options:?}: {}", stderr(&output));
    }
    let output = tumble_in(&folder, &["plan", "iss-salom"]);
    assert!(stderr(&output).contains("did you mean `iss-slalom`?"));
    fs::write(folder.join("noise.toml"), "wheel throws are no scenario").unwrap();
    let output = tumble_in(&folder, &["plan", "noise.toml"]);
    assert!(output.status.code() == Some(2) && stderr(&output).contains("T026"), "{}", stderr(&output));
    fs::remove_file(folder.join("noise.toml")).unwrap();
    fs::create_dir(folder.join("full")).unwrap();
    fs::write(folder.join("full/thesis.tex"), "years of work").unwrap();
    for (options, code) in [
        (&["--out", "full"][..], "T010"),
        (&["--out", "full", "--force"], "T020"),
        (&["--out", "full/thesis.tex/x"], "T011"),
    ] {
        let output = tumble_in(&folder, &[&["plan", "iss-slalom", "--first"], options].concat());
        assert_eq!(output.status.code(), Some(2), "{options:?}");
        assert!(stderr(&output).contains(code), "{options:?}: {}", stderr(&output));
    }
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
    assert_eq!(fs::read_to_string(folder.join("full/thesis.tex")).unwrap(), "years of work");
}

#[test]
fn obstacles_appear_in_plans_as_they_do_in_flight() {
    let folder = scratch("moving");
    let base = "format = 1\nname = \"gate\"\nworld = \"open\"\nduration_s = 30.0\n[start]\nposition_m = [0, 0, 0]\n[goal]\nposition_m = [2, 0, 0]\n\
                [plan]\nposition_lower_m = [-0.5, -1, -1]\nposition_upper_m = [2.5, 1, 1]\nspeed_limit_m_s = [0.2, 0.2, 0.2]\nforce_limit_n = [0.4, 0.4, 0.4]\n";
    let gate = "[[obstacles]]\ncenter_m = [1, 0, 0]\nsemi_axes_m = [0.2, 0.6, 0.6]\n";
    let plan = |name: &str, text: String| {
        fs::write(folder.join(name), text).unwrap();
        let output = tumble_in(&folder, &["plan", name, "--budget", "4000", "--json"]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let found = json(&output);
        check_plan(name, &folder.join(found["folder"].as_str().unwrap()));
        (number(&found["cost"]), number(&found["length_m"]))
    };
    let cost = |name: &str, text: String| plan(name, text).0;
    let (clear, straight_m) = plan("clear.toml", base.to_owned());
    // The way round is longer, though no slower: there is time to go sideways while x moves at full speed.
    let (blocked, round_m) = plan("blocked.toml", format!("{base}{gate}"));
    assert!(blocked >= clear - 1e-9 && round_m > 1.02 * straight_m, "{blocked} {clear} {round_m} {straight_m}");
    // Gone before the robot comes, there after it has passed, away before it comes: no detour.
    let vanished = cost("vanished.toml", format!("{base}{gate}vanish_s = 1.0\n"));
    let late = cost("late.toml", format!("{base}{gate}appear_s = 60.0\n"));
    let moved = cost("moved.toml", format!("{base}{gate}velocity_m_s = [0, 0.5, 0]\n"));
    for found in [vanished, late, moved] {
        assert!((found - clear).abs() < 1e-3 * clear, "{found} {clear}");
    }
    // The simulator sees the same: a robot that drifts through where the gate was, or is.
    let drift = base.replacen("[goal]", "velocity_m_s = [0.2, 0, 0]\n[goal]", 1)
        + "[drive]\ncontroller = \"none\"\n[propulsion]\nkind = \"exact\"\n";
    for (gate, code) in [
        (gate.to_owned(), 3),
        (format!("{gate}vanish_s = 1.0\n"), 0),
        (format!("{gate}appear_s = 8.0\n"), 0),
        (format!("{gate}appear_s = 4.0\n"), 3),
        (format!("{gate}velocity_m_s = [0, 0.5, 0]\n"), 0),
    ] {
        fs::write(folder.join("drift.toml"), format!("{drift}{gate}")).unwrap();
        let output = tumble_in(&folder, &["simulate", "drift.toml", "--duration", "10"]);
        assert_eq!(output.status.code(), Some(code), "{gate}: {}", stderr(&output));
    }
}

#[test]
fn the_thesis_planner_plans_by_its_own_rules() {
    let folder = scratch("thesis");
    let output = tumble_in(&folder, &["plan", "iss-slalom", "--planner", "thesis-rrt", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let found = json(&output);
    check_plan("thesis-rrt", &folder.join(found["folder"].as_str().unwrap()));
    for arc in found["arcs"].as_array().unwrap() {
        assert!((number(&arc["duration_s"]) - 2.0).abs() < 1e-12);
    }
    assert_eq!(found["planner"], "thesis-rrt");
}

/// A sphere of 0.1 m and 10 kg in the open, 2 m to go.
const BASE: &str = "format = 1\nname = \"b\"\nworld = \"open\"\nduration_s = 10.0\nrobot_radius_m = 0.1\n\
    [body]\nmass_kg = 10.0\ncom_m = [0.0, 0.0, 0.0]\n\
    inertia_about_com_kg_m2 = [[0.2,0.0,0.0],[0.0,0.2,0.0],[0.0,0.0,0.2]]\n\
    [start]\nposition_m = [0.0,-1.0,0.0]\n[goal]\nposition_m = [0.0,1.0,0.0]\n\
    [plan]\nposition_lower_m = [-2.0,-2.0,-2.0]\nposition_upper_m = [2.0,2.0,2.0]\n";

#[test]
fn numbers_without_a_sensible_size_are_refused() {
    let parse = |text: &str| ScenarioSource::parse(Path::new("b.toml"), text).and_then(|s| s.planning_problem());
    parse(BASE).unwrap();
    for (from, to, says) in [
        ("mass_kg = 10.0", "mass_kg = 1e9", "body.mass_kg"),
        ("duration_s = 10.0", "duration_s = nan", "duration_s"),
        ("duration_s = 10.0", "duration_s = -1.0", "duration_s"),
        ("robot_radius_m = 0.1", "robot_radius_m = nan", "robot_radius_m"),
        ("robot_radius_m = 0.1", "obstacle_set = 1", "has no sets"),
        ("[2.0,2.0,2.0]", "[1e300,2.0,2.0]", "plan.position_upper_m"),
        ("[plan]", "[plan]\nforce_limit_n = [1e12,1.0,1.0]", "1e-6 to 1e6 N"),
        ("[plan]", "[plan]\nforce_limit_n = [1e-300,1.0,1.0]", "1e-6 to 1e6 N"),
        ("[plan]", "[plan]\nspeed_limit_m_s = [1e9,1.0,1.0]", "1e-4 to 1e3 m/s"),
        ("[plan]", "[plan]\ntorque_limit_n_m = [1e-30,1.0,1.0]", "plan.torque_limit_n_m"),
    ] {
        assert!(BASE.contains(from), "{from}");
        let message = parse(&BASE.replacen(from, to, 1)).err().unwrap_or_else(|| panic!("accepted: {to}")).to_string();
        assert!(message.contains(says), "{to}: {message}");
    }
}

#[test]
fn a_plan_to_where_one_is_is_one_row_without_cost() {
    let folder = scratch("same");
    fs::write(folder.join("b.toml"), BASE.replace("[0.0,1.0,0.0]", "[0.0,-1.0,0.0]")).unwrap();
    let output = tumble_in(&folder, &["plan", "b.toml", "--budget", "300", "--json", "--out", "o"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let found = json(&output);
    for key in ["cost", "gap", "duration_s"] {
        assert_eq!(number(&found[key]).to_bits(), 0.0_f64.to_bits(), "{key}: {}", found[key]);
    }
    assert_eq!(rows(&folder.join("o/plan.csv")).len(), 1);
}

#[test]
fn a_torque_beyond_its_limit_is_told() {
    let folder = scratch("torque");
    for (com, is_told) in [("[0.2, 0.0, 0.0]", true), ("[0.0, 0.0, 0.0]", false)] {
        fs::write(folder.join("b.toml"), BASE.replace("com_m = [0.0, 0.0, 0.0]", &format!("com_m = {com}"))).unwrap();
        let output = tumble_in(&folder, &["plan", "b.toml", "--budget", "300", "--json"]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let torque = number(&json(&output)["largest_torque_n_m"][2]);
        assert_eq!(torque > 0.015, is_told, "{torque}");
        assert_eq!(stderr(&output).contains("the torque about z reaches"), is_told, "{}", stderr(&output));
    }
}

#[test]
fn every_embedded_scenario_with_a_goal_can_be_asked_for_a_plan() {
    let mut asked = 0;
    for embedded in EMBEDDED {
        let source = ScenarioSource::parse(Path::new(embedded.name), embedded.text).unwrap();
        if source.scenario.plan.is_some() {
            source.planning_problem().unwrap();
            asked += 1;
        }
    }
    assert!(asked >= 4, "{asked}");
}
