//! `tumble plan --local` as a user meets it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::support::page_checks::findings_of_any;
use crate::support::{json, number, scratch, stderr, tumble_in};
use std::fs;
use std::path::Path;
use std::process::Output;
use tumble::scenario::ScenarioSource;
use tumble_dynamics::nalgebra::{Quaternion, UnitQuaternion, Vector3};
use tumble_dynamics::{FreeFlyer, Integrator as _, MuntheKaas4, RigidBodyState};
use tumble_lie::{Pose, Twist, Wrench};

/// Open space, a small robot at rest where it should be; `more` follows `[plan.local]`.
fn scenario(goal: [f64; 3], more: &str) -> String {
    let [x, y, z] = goal;
    format!(
        "format = 1\nname = \"small\"\nworld = \"open\"\nduration_s = 20.0\n[body]\nmass_kg = 9.5\n\
         inertia_about_com_kg_m2 = [[0.15,0.0,0.0],[0.0,0.14,0.0],[0.0,0.0,0.16]]\n[start]\nposition_m = [0.0,0.0,0.0]\n\
         [goal]\nposition_m = [{x:?},{y:?},{z:?}]\n[propulsion]\nkind = \"exact\"\n[plan]\nposition_lower_m = [-3.0,-3.0,-3.0]\n\
         position_upper_m = [3.0,3.0,3.0]\n[plan.local]\n{more}"
    )
}

fn plan_in(folder: &Path, scenario: &str, options: &[&str]) -> Output {
    let mut arguments = vec!["plan", scenario, "--local", "--json"];
    arguments.extend(options);
    tumble_in(folder, &arguments)
}

fn plan(folder: &Path, text: &str, options: &[&str]) -> Output {
    fs::write(folder.join("s.toml"), text).unwrap();
    plan_in(folder, "s.toml", options)
}

/// Columns of a table by name.
fn column(table: &str, name: &str) -> Vec<f64> {
    let mut lines = table.lines();
    let place = lines.next().unwrap().split(',').position(|found| found == name).unwrap_or_else(|| panic!("{name}"));
    lines.map(|line| line.split(',').nth(place).unwrap().parse().unwrap()).collect()
}

struct Row {
    time_s: f64,
    state: RigidBodyState<f64>,
    wrench: Wrench<f64>,
}

fn rows(folder: &Path) -> Vec<Row> {
    let table = fs::read_to_string(folder.join("local_plan.csv")).unwrap();
    let of = |group: &str| ["x", "y", "z"].map(|axis| column(&table, &format!("{group}_{axis}")));
    let (p, v, w, f, tau) = (of("p"), of("v"), of("w"), of("f"), of("tau"));
    let q = ["q_w", "q_x", "q_y", "q_z"].map(|name| column(&table, name));
    let at = |columns: &[Vec<f64>; 3], row: usize| Vector3::new(columns[0][row], columns[1][row], columns[2][row]);
    let row = |(row, time_s): (usize, &f64)| {
        let rotation = UnitQuaternion::new_normalize(Quaternion::new(q[0][row], q[1][row], q[2][row], q[3][row]));
        let twist_body = Twist::new(at(&w, row), rotation.inverse() * at(&v, row));
        Row {
            time_s: *time_s,
            state: RigidBodyState { world_from_body: Pose::from_parts(at(&p, row).into(), rotation), twist_body },
            wrench: Wrench::new(at(&tau, row), at(&f, row)),
        }
    };
    column(&table, "t_s").iter().enumerate().map(row).collect()
}

/// That the rows are one motion of the believed body, within the limits of inputs and speeds and out of every ellipsoid, looked
/// at twenty times as often.
fn check_motion(folder: &Path) {
    let source = ScenarioSource::find(folder.join("scenario.toml").to_str().unwrap()).unwrap();
    let problem = source.planning_problem().unwrap();
    let local = source.local_problem(&problem).unwrap();
    let body = FreeFlyer::new(*problem.belief.parameters());
    let rows = rows(folder);
    assert_eq!(rows.len(), local.steps + 1);
    for pair in rows.windows(2) {
        let (from, to) = (&pair[0], &pair[1]);
        let step_s = to.time_s - from.time_s;
        assert!((step_s - local.step_s).abs() < 1e-9);
        for (value, limit) in from.wrench.to_vector().iter().zip(local.wrench.limit) {
            assert!(value.abs() <= limit * (1.0 + 1e-9), "{value} of {limit}");
        }
        let mut state = from.state;
        for _ in 0..20 {
            state = MuntheKaas4.step(&body, &state, &from.wrench, 0.0, step_s / 20.0).unwrap();
            let position = state.world_from_body.translation.vector;
            for obstacle in &problem.world.obstacles {
                let offset = obstacle.world_from_ellipsoid.inverse_transform_point(&position.into());
                let inside = offset.coords.component_div(&obstacle.semi_axes).norm();
                assert!(inside >= 1.0 - 1e-5, "{} s: {inside}", from.time_s);
            }
            let velocity = state.world_from_body.rotation * state.twist_body.linear;
            for axis in 0..3 {
                assert!(velocity[axis].abs() <= local.speed.speed_m_s[axis] + 1e-6);
                assert!(state.twist_body.angular[axis].abs() <= local.speed.rate_rad_s[axis] + 1e-6);
            }
        }
        let apart = state.world_from_body.translation.vector - to.state.world_from_body.translation.vector;
        assert!(apart.norm() < 1e-4, "{} s: {apart}", from.time_s);
        assert!(state.world_from_body.rotation.angle_to(&to.state.world_from_body.rotation) < 1e-4);
    }
}

#[test]
fn the_frozen_problem_is_planned_as_it_should_be() {
    let folder = scratch("frozen");
    let output = plan_in(&folder, "infoplan", &["--out", "out"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let found = json(&output);
    assert_eq!(found["status"], "converged");
    let cost = number(&found["cost"]["total"]);
    // What other programs found of it, with a point for a body.
    assert!((cost - 10.7174).abs() < 5e-4, "{cost}");
    assert!(found["criterion"] == "a" && found["budget_ended"] == false);
    let names: Vec<&str> =
        found["quantities"].as_array().unwrap().iter().map(|q| q["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["mass", "inertia_xx", "inertia_yy", "inertia_zz"]);
    let parts: f64 = ["tracking", "effort", "information"].map(|part| number(&found["cost"][part])).iter().sum();
    assert!((parts - cost).abs() < 1e-9);
    assert!((number(&found["target_error_m"]) - 0.192).abs() < 0.01, "{found}");
    assert!(number(&found["nearest"]["distance_m"]) > -1e-5);
    for quantity in found["quantities"].as_array().unwrap() {
        let (before, after) = (number(&quantity["prior_sigma"]), number(&quantity["predicted_sigma"]));
        assert!(after < 0.2 * before, "{quantity}");
        let sigmas: Vec<f64> = quantity["sigmas"].as_array().unwrap().iter().map(number).collect();
        assert!(
            (sigmas[0] / before - 1.0).abs() < 1e-9 && sigmas.windows(2).all(|pair| pair[1] <= pair[0] * (1.0 + 1e-12))
        );
    }
    let out = folder.join("out");
    check_motion(&out);
    for picture in ["local_top.svg", "local_side.svg"] {
        let text = fs::read_to_string(out.join(picture)).unwrap();
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>") && !text.contains("NaN"), "{picture}");
    }
    let page = fs::read(out.join("report.html")).unwrap();
    assert_eq!(findings_of_any(&String::from_utf8_lossy(&page)), [""; 0]);
    for file in ["run.json", "timings.json", "scenario.toml", "local_plan.json"] {
        assert!(out.join(file).is_file(), "{file}");
    }
    // Again, into the same folder: the same bytes.
    let before = fs::read(out.join("local_plan.json")).unwrap();
    let table = fs::read(out.join("local_plan.csv")).unwrap();
    assert_eq!(plan_in(&folder, "infoplan", &["--out", "out", "--force"]).status.code(), Some(0));
    assert_eq!(fs::read(out.join("local_plan.json")).unwrap(), before);
    assert_eq!(fs::read(out.join("local_plan.csv")).unwrap(), table);
    assert!(fs::read(out.join("report.html")).unwrap() == page, "no wall time on a page");
    let _ = fs::remove_dir_all(folder);
}

/// At rest where it should be a plan moves to learn, and only if learning has a weight.
#[test]
fn a_robot_that_may_stay_moves_to_learn() {
    let folder = scratch("hold");
    let text = scenario([0.0; 3], "steps = 20\nstep_s = 0.5\nweights = [200.0, 4000.0, 4000.0, 4000.0]\n");
    let output = plan(&folder, &text, &["--out", "learns"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let found = json(&output);
    for quantity in found["quantities"].as_array().unwrap() {
        // The mass is known to 5 % before, and what it costs to shake it is displacement.
        let share = if quantity["name"] == "mass" { 0.7 } else { 0.2 };
        assert!(number(&quantity["predicted_relative"]) < share * number(&quantity["prior_relative"]), "{quantity}");
    }
    check_motion(&folder.join("learns"));
    let output = plan(&folder, &text, &["--weighting", "none", "--out", "stays"]);
    let stays = json(&output);
    assert!(number(&stays["cost"]["total"]) < 1e-6 && number(&stays["cost"]["information"]) == 0.0);
    for quantity in stays["quantities"].as_array().unwrap() {
        assert!(number(&quantity["predicted_relative"]) > 0.9 * number(&quantity["prior_relative"]), "{quantity}");
    }
    assert!(!stays["unobservable"].as_array().unwrap().is_empty());
    let _ = fs::remove_dir_all(folder);
}

#[test]
fn every_weighting_criterion_and_set_of_unknowns_plans() {
    let folder = scratch("options");
    let text = scenario([0.3, 0.1, 0.0], "steps = 8\nstep_s = 0.5\n");
    for weighting in ["covariance", "step", "exponential", "fixed", "mass", "inertia", "belief", "none"] {
        let found = json(&plan(&folder, &text, &["--weighting", weighting, "--force", "--out", "out"]));
        assert_eq!(found["status"], "converged", "{weighting}");
        let weights: Vec<f64> =
            found["quantities"].as_array().unwrap().iter().map(|quantity| number(&quantity["weight"])).collect();
        let expected = match weighting {
            "mass" => [true, false, false, false],
            "inertia" => [false, true, true, true],
            "none" => [false; 4],
            // No way is left after the segment, or what is: nothing is claimed.
            "belief" => continue,
            _ => [true; 4],
        };
        assert_eq!(weights.iter().map(|weight| *weight > 0.0).collect::<Vec<_>>(), expected, "{weighting}");
    }
    for criterion in ["a", "d", "e"] {
        let found = json(&plan(&folder, &text, &["--criterion", criterion, "--force", "--out", "out"]));
        assert_ne!(found["status"], "infeasible", "{criterion}");
    }
    for (options, more, count) in [
        (["--unknowns", "full"], "", 10),
        (["--unknowns", "principal"], "[plan.local.nuisances]\nforce_scale_sigma = 0.05\n", 7),
        (
            ["--unknowns", "principal"],
            "[plan.local.nuisances]\nforce_bias_sigma_n = 0.01\ntorque_bias_sigma_n_m = 0.001\n",
            10,
        ),
    ] {
        let mut arguments = options.to_vec();
        arguments.extend(["--force", "--out", "out"]);
        let output = plan(&folder, &format!("{text}{more}"), &arguments);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert_eq!(json(&output)["quantities"].as_array().unwrap().len(), count);
    }
    let _ = fs::remove_dir_all(folder);
}

#[test]
fn a_plan_within_what_the_nozzles_give() {
    let folder = scratch("nozzles");
    let text = scenario(
        [0.6, 0.3, 0.0],
        "steps = 10\nstep_s = 0.5\nnozzles = true\nforce_limit_n = [1.0,1.0,1.0]\ntorque_limit_n_m = [0.1,0.1,0.1]\n",
    )
    .replace("kind = \"exact\"", "kind = \"plant\"");
    let output = plan(&folder, &text, &["--out", "out"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(json(&output)["limits"]["half_spaces"].as_u64(), Some(164));
    let refused = plan(&folder, &text.replace("\"plant\"", "\"limited\""), &[]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("plan.local.nozzles"), "{}", stderr(&refused));
    let _ = fs::remove_dir_all(folder);
}

#[test]
fn segments_of_the_flown_places_are_planned() {
    let folder = scratch("places");
    for name in ["iss-slalom", "granite-room"] {
        let output = plan_in(&folder, name, &["--steps", "20", "--budget", "20000"]);
        assert_eq!(output.status.code(), Some(0), "{name}: {}", stderr(&output));
        let found = json(&output);
        assert_eq!(found["target"]["is_goal"], false, "{name}");
        assert!(number(&found["target_error_m"]) < 0.1, "{name} {}", found["target_error_m"]);
        assert!(folder.join(format!("tumble-out/local-plan-{name}-1/local_plan.csv")).is_file());
    }
    let _ = fs::remove_dir_all(folder);
}

#[test]
fn where_there_is_no_plan_the_blocker_is_named() {
    let folder = scratch("none");
    // The margin of the segment is wider than the way's: it begins too near.
    let wall = "[[obstacles]]\ncenter_m = [0.0,-0.6,0.0]\nsemi_axes_m = [0.3,0.3,0.3]\n";
    let text = scenario([0.3, 0.0, 0.0], &format!("steps = 6\nmargin_m = 0.3\n{wall}"));
    let output = plan(&folder, &text, &["--out", "near"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    let said = stderr(&output);
    assert!(
        said.contains("no plan: the segment begins") && said.contains("obstacle 0") && said.contains("remedy: "),
        "{said}"
    );
    let found = json(&output);
    assert!(found["status"] == "infeasible" && found["cost"].is_null() && found["blocker"].is_string());
    assert!(folder.join("near/local_top.svg").is_file() && !folder.join("near/local_plan.csv").exists());
    // The way is quick, the segment is allowed next to no force.
    let more = "steps = 4\nstep_s = 0.5\nterminal_radius_m = 0.01\nterminal_speed_m_s = 0.01\nforce_limit_n = [0.01,0.01,0.01]\n";
    let text = scenario([0.09, 0.0, 0.0], more);
    let text = text.replace("[plan]\n", "[plan]\nspeed_limit_m_s = [1.0,1.0,1.0]\nforce_limit_n = [5.0,5.0,5.0]\n");
    let output = plan(&folder, &text, &["--out", "far"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("terminal_radius_m"), "{}", stderr(&output));
    let _ = fs::remove_dir_all(folder);
}

#[test]
fn wrong_keys_and_values_are_named() {
    let folder = scratch("wrong");
    for (more, says) in [
        ("stepz = 3", "did you mean `steps`"),
        ("steps = 0", "plan.local.steps"),
        ("steps = 100000", "plan.local.steps"),
        ("step_s = 0.0", "plan.local.step_s"),
        ("step_s = nan", "plan.local.step_s"),
        ("weighting = \"covarianse\"", "did you mean `covariance`"),
        ("criterion = \"z\"", "unknown variant `z`"),
        ("unknowns = \"planar\"", "plan.local.unknowns"),
        ("weights = [1.0, 2.0]", "2 numbers for 4 quantities"),
        ("weights = [1.0, 2.0, 3.0, -4.0]", "plan.local.weights"),
        ("weights = [1e13, 1.0, 1.0, 1.0]", "plan.local.weights"),
        ("target_sigmas = [1.0, 2.0, 3.0, 0.0]", "plan.local.target_sigmas"),
        ("elapsed_share = 1.5", "plan.local.elapsed_share"),
        ("force_limit_n = [0.1, -0.1, 0.1]", "plan.local.force_limit_n"),
        ("speed_limit_m_s = [0.0, 1.0, 1.0]", "plan.local.speed_limit_m_s"),
        ("margin_m = -0.1", "plan.local.margin_m"),
        ("terminal_radius_m = 0.1", "terminal_speed_m_s"),
        ("[plan.local.tracking]\nposition = -1.0", "plan.local.tracking.position"),
        ("[plan.local.effort]\nforce = 0.0", "plan.local.effort.force"),
        ("[plan.local.measurement]\nrate_sigma_rad_s = 0.0", "plan.local.measurement.rate_sigma_rad_s"),
        ("[plan.local.prior]\nmass_sigma_kg = 1.0\nmass_sigma_share = 0.1", "not both"),
        ("[plan.local.prior]\ncom_sigma_m = inf", "plan.local.prior.com_sigma_m"),
        ("[plan.local.nuisances]\nforce_scale_sigm = 0.1", "did you mean `force_scale_sigma`"),
    ] {
        let output = plan(&folder, &scenario([0.3, 0.0, 0.0], more), &[]);
        assert_eq!(output.status.code(), Some(2), "{more}: {}", stderr(&output));
        assert!(stderr(&output).contains("T026") && stderr(&output).contains(says), "{more}: {}", stderr(&output));
    }
    // A limit of `[plan]` that the segment takes over is named where it is written.
    let text = scenario([0.3, 0.0, 0.0], "").replace("[plan]\n", "[plan]\nrate_limit_rad_s = 0.0\n");
    let output = plan(&folder, &text, &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("`plan.rate_limit_rad_s`"), "{}", stderr(&output));
    // A step in which the limit of speed is passed.
    let output = plan(&folder, &scenario([0.3, 0.0, 0.0], "steps = 3\nstep_s = 40.0"), &["--out", "long"]);
    assert!(stderr(&output).contains("T033") && stderr(&output).contains("plan.local.step_s"), "{}", stderr(&output));
    fs::write(folder.join("s.toml"), scenario([0.3, 0.0, 0.0], "")).unwrap();
    let output = tumble_in(&folder, &["plan", "s.toml", "--weighting", "fixed"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("`--weighting` goes with `--local` only"), "{}", stderr(&output));
    assert!(!folder.join("tumble-out").exists());
    let _ = fs::remove_dir_all(folder);
}
