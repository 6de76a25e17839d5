//! Logs of a satellite: wheels that hold momentum, and a drag that the operator's model knows, in columns of their own.

use crate::support::{json, number, scratch, stderr, tumble};
use serde_json::Value;
use std::path::{Path, PathBuf};
use tumble_dynamics::{
    FreeFlyer, FreeFlyerIn, InertialParameters, Integrator, LinearDrag, MuntheKaas4, RigidBodyState, StoredMomentum,
    WrenchModel,
};
use tumble_identification::noise::Gaussian;
use tumble_lie::nalgebra::{UnitQuaternion, Vector3};
use tumble_lie::{LieGroup, Wrench};

const STEP_S: f64 = 0.05;
const ROWS: usize = 800;

fn body() -> InertialParameters<f64> {
    let cube = InertialParameters::solid_box(60.0, [0.6, 0.5, 0.7]);
    InertialParameters::about_com(60.0, Vector3::new(0.03, -0.02, 0.04), cube.inertia_about_com())
}

/// Columns: time, pose, force, torque, momentum of the wheels, what the environment does.
fn log() -> Vec<[f64; 23]> {
    let mut random = Gaussian::from_seed(2471);
    let drag = LinearDrag {
        force_coefficient: 3.0,
        torque_coefficient: 0.05,
        center_of_pressure: Vector3::zeros(),
        medium_velocity_world: Vector3::zeros(),
    };
    let mut stored_body = Vector3::new(1.0, -0.6, 0.8);
    let mut state = RigidBodyState::at_rest();
    let row = |row: usize| {
        let time_s = row as f64 * STEP_S;
        let wave = |i: f64| libm::sin((0.35 + 0.11 * i) * time_s + i);
        let motors = Vector3::new(0.06 * wave(0.0), 0.05 * wave(1.0), 0.07 * wave(2.0));
        let force = Vector3::new(0.8 * wave(3.0), 0.7 * wave(4.0), 0.9 * wave(5.0));
        let nozzles = Vector3::new(0.02 * wave(2.5), -0.02 * wave(3.5), 0.03 * wave(1.5));
        let wrench = Wrench::new(motors + nozzles, force);
        let acting = drag.wrench_body(time_s, &state);
        let turn: UnitQuaternion<f64> = LieGroup::exp(&random.vector(2e-4));
        let place = state.world_from_body.translation.vector + random.vector(5e-4);
        let seen = state.world_from_body.rotation * turn;
        let cells = [
            time_s,
            place.x,
            place.y,
            place.z,
            seen.i,
            seen.j,
            seen.k,
            seen.w,
            force.x,
            force.y,
            force.z,
            wrench.torque.x,
            wrench.torque.y,
            wrench.torque.z,
            stored_body.x,
            stored_body.y,
            stored_body.z,
            acting.force.x,
            acting.force.y,
            acting.force.z,
            acting.torque.x,
            acting.torque.y,
            acting.torque.z,
        ];
        for _ in 0..4 {
            let momentum_body = stored_body - motors * (STEP_S / 8.0);
            let environment = (drag, StoredMomentum { momentum_body });
            let system = FreeFlyerIn { body: FreeFlyer::new(body()), environment };
            state = MuntheKaas4.step(&system, &state, &wrench, time_s, STEP_S / 4.0).unwrap();
            stored_body -= motors * (STEP_S / 4.0);
        }
        cells
    };
    (0..ROWS).map(row).collect()
}

const HEADER: &str = "t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,f_x,f_y,f_z,tau_x,tau_y,tau_z,stored_x,stored_y,stored_z,\
                      env_f_x,env_f_y,env_f_z,env_tau_x,env_tau_y,env_tau_z";

/// The log with so many of its columns.
fn written(folder: &Path, columns: usize) -> PathBuf {
    let path = folder.join(format!("{columns}.csv"));
    let lines = log().into_iter().map(|row| row.iter().take(columns).map(f64::to_string).collect::<Vec<_>>().join(","));
    let header = HEADER.split(',').take(columns).collect::<Vec<_>>().join(",");
    std::fs::write(&path, std::iter::once(header).chain(lines).collect::<Vec<_>>().join("\n") + "\n").unwrap();
    path
}

/// The same log, in which wheels and environment are sampled more seldom than the pose.
fn listed_in_every_fourth_row(csv: &Path) -> PathBuf {
    let text = std::fs::read_to_string(csv).unwrap();
    let line = |(k, line): (usize, &str)| match k % 4 {
        // the header, and every fourth row after it
        0 => line.to_owned(),
        _ => line.split(',').take(14).chain([""; 9]).collect::<Vec<_>>().join(","),
    };
    let path = csv.with_file_name("seldom.csv");
    std::fs::write(&path, text.lines().enumerate().map(|row| line(row) + "\n").collect::<String>()).unwrap();
    path
}

fn identified(path: &Path) -> (Option<i32>, Value) {
    let output = tumble(&["identify", path.to_str().unwrap(), "--json"]);
    assert!(!stderr(&output).contains("ignored"), "{}", stderr(&output));
    (output.status.code(), json(&output))
}

#[test]
fn columns_of_wheels_and_environment_are_reckoned_with() {
    let folder = scratch("beside");
    let csv = written(&folder, 23);
    let mcap = folder.join("log.mcap");
    let converted = tumble(&["convert", csv.to_str().unwrap(), mcap.to_str().unwrap()]);
    assert!(converted.status.success(), "{}", stderr(&converted));
    let sigmas = |path: &Path| {
        let (code, found) = identified(path);
        assert_eq!(code, Some(0), "{found:#}");
        let (mass, sigma) = (number(&found["mass_kg"]), number(&found["std"]["mass_kg"]));
        println!("{} {mass} +- {sigma} kg", found["method"]);
        assert!((mass - 60.0).abs() < 3.5 * sigma, "{mass} +- {sigma}");
        for axis in 0..3 {
            let at = |matrix: &Value| number(&matrix["inertia_about_com_kg_m2"][axis][axis]);
            let (moment, sigma) = (at(&found), at(&found["std"]));
            let off = moment - body().inertia_about_com()[(axis, axis)];
            assert!(off.abs() < 3.5 * sigma, "{moment} +- {sigma} about axis {axis}");
        }
        sigma
    };
    let [from_csv, from_mcap] = [&csv, &mcap].map(|path| sigmas(path));
    let seldom = sigmas(&listed_in_every_fourth_row(&csv));
    assert!(seldom < 2.0 * from_csv, "{seldom} {from_csv}");
    assert!((from_csv / from_mcap - 1.0).abs() < 1e-9, "{from_csv} {from_mcap}");
    // without its columns it is what errs of the wrench, or no body explains it
    let (code, untold) = identified(&written(&folder, 14));
    assert!(code == Some(3) || number(&untold["std"]["mass_kg"]) > 5.0 * from_csv, "{untold:#}");
}
