//! Logs of arms: every cell lands where its column says, and what is wrong is named with its line and column.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::float_cmp)]

use std::path::Path;
use tumble_dynamics::nalgebra::{UnitQuaternion, Vector3};
use tumble_formats::arm::{ArmModel, EMBEDDED};
use tumble_formats::log::{JointLog, joint_template};
use tumble_formats::{FormatsError, Robots};

const SLIDE: &str = r#"format = 1
name = "slide"
base_kind = "free"
[[joint]]
name = "turn"
parent = "base"
kind = "revolute"
axis = [0, 0, 1]
[[joint]]
name = "slide"
parent = "turn"
kind = "prismatic"
axis = [1, 0, 0]
"#;

fn slide() -> ArmModel {
    ArmModel::parse(Path::new("slide.toml"), SLIDE, &Robots::none()).unwrap()
}

fn read(text: &str, reorder: bool) -> Result<JointLog, FormatsError> {
    JointLog::from_reader(text.as_bytes(), Path::new("log.csv"), &slide(), reorder)
}

#[test]
fn every_cell_lands_where_its_column_says() {
    let text = "i2_A,i1_A,q2_m,q1_rad,qd1_rad_s,qd2_m_s,qdd1_rad_s2,qdd2_m_s2,tau1_N_m,tau2_N,note,t_s,\
                q_x,q_y,q_z,q_w,p_x,p_y,p_z,v_x,v_y,v_z,w_x,w_y,w_z,a_x,a_y,a_z,f_x,f_y,f_z,tau_x,tau_y,tau_z\n\
                2,1,4,3,5,6,7,8,9,10,x,1700000000.000000001,0,0,0.6,0.8,11,12,13,14,15,16,17,18,19,20,21,22,23,24,25,26,27,28\n\
                2,1,4,3,,6,7,8,9,10,x,1700000000.01,0,0,,0.8,11,12,13,14,15,16,,18,19,20,21,22,23,24,25,26,27,28\n";
    let log = read(text, false).unwrap();
    assert_eq!(log.warnings, ["columns ignored: note"]);
    let [first, second] = log.rows.as_slice() else { panic!() };
    assert_eq!(first.time_ns, 1_700_000_000_000_000_001);
    assert_eq!(first.positions, [3.0, 4.0]);
    let lists = [&first.rates, &first.accelerations, &first.torques, &first.currents].map(|list| list.clone().unwrap());
    assert_eq!(lists, [[5.0, 6.0], [7.0, 8.0], [9.0, 10.0], [1.0, 2.0]]);
    let pose = first.world_from_base.unwrap();
    assert_eq!(pose.translation.vector, Vector3::new(11.0, 12.0, 13.0));
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.0 * 0.6f64.asin());
    assert!((pose.rotation.coords - turn.coords).amax() < 1e-15);
    // the velocity turned back into base axes: cos = 0.28, sin = 0.96
    let twist = first.base_twist().unwrap();
    assert_eq!(twist.angular, Vector3::new(17.0, 18.0, 19.0));
    let expected = Vector3::new(0.28 * 14.0 + 0.96 * 15.0, -0.96 * 14.0 + 0.28 * 15.0, 16.0);
    assert!((twist.linear - expected).amax() < 1e-13, "{}", twist.linear);
    assert_eq!(first.base_acceleration, Some(Vector3::new(20.0, 21.0, 22.0)));
    let wrench = first.base_wrench.unwrap();
    assert_eq!((wrench.force, wrench.torque), (Vector3::new(23.0, 24.0, 25.0), Vector3::new(26.0, 27.0, 28.0)));
    // an empty cell takes its group with it, and nothing else
    assert!(second.rates.is_none() && second.world_from_base.is_none() && second.base_rate.is_none());
    assert!(second.base_twist().is_none() && second.currents.is_some() && second.base_velocity_world.is_some());
}

#[test]
fn units_may_be_left_out_of_names() {
    let log = read("t_s,q1,q2_m,i1,i2\n0,1,2,3,4\n1,1,2,3,4", false).unwrap();
    assert_eq!(
        (log.rows[0].positions.as_slice(), log.rows[1].currents.as_deref()),
        ([1.0, 2.0].as_slice(), Some([3.0, 4.0].as_slice()))
    );
    assert!(log.warnings.len() == 1 && log.warnings[0].contains("line 3 has no line end"), "{:?}", log.warnings);
}

#[test]
fn late_rows_are_put_in_order_if_asked() {
    let text = "t_s,q1,q2\n0,1,1\n2,3,3\n1,2,2\n2,4,4\n";
    assert!(matches!(read(text, false), Err(FormatsError::TimeNotIncreasing { line: 4, .. })));
    let log = read(text, true).unwrap();
    let positions: Vec<f64> = log.rows.iter().map(|row| row.positions[0]).collect();
    assert_eq!(positions, [1.0, 2.0, 3.0]);
    assert!(log.warnings[0].contains("1 repeated"), "{:?}", log.warnings);
}

#[test]
fn what_is_wrong_is_named() {
    for (text, code, says) in [
        ("", "T002", "no header"),
        ("t_s,q1,q2\n", "T002", "no data rows"),
        ("t_s,q1_rad\n0,1\n", "T003", "column `q2_m` is missing"),
        ("t_s,q1_rad,q2_rad\n0,1,1\n", "T003", "column `q2_m` is missing"),
        ("q1,q2\n0,1\n", "T003", "column `t_s` is missing"),
        ("t_s,q1,q2,qd2\n0,1,1,1\n", "T003", "column `qd1_rad_s` is missing, but others"),
        ("t_s,q1,q2,w_x,w_y\n0,1,1,1,1\n", "T003", "column `w_z` is missing, but others"),
        ("t_s,q1,q2,q_w\n0,1,1,1\n", "T003", "column `p_x` is missing, but others"),
        ("t_s,q1,q1,q2\n0,1,1,1\n", "T004", "column `q1` stands twice"),
        ("t_s,q1,q1_rad,q2\n0,1,1,1\n", "T004", "column `q1` stands twice"),
        ("t_s,q1,q2,q3_rad\n0,1,1,1\n", "T054", "column `q3_rad`, but `slide` has joints 1 to 2"),
        ("t_s,q1,q2,tau0\n0,1,1,1\n", "T054", "column `tau0`"),
        ("t_s,q1,q2\n0,1,1\n1,nan,1\n", "T005", "line 3, column `q1`: `nan`"),
        ("t_s,q1,q2\n0,1,\n", "T005", "line 2, column `q2`"),
        ("t_s,q1,q2\n0,1,1e999\n", "T005", "line 2, column `q2`"),
        ("t_s,q1,q2\nnow,1,1\n", "T005", "line 2, column `t_s`"),
        ("t_s,q1,q2,i1,i2\n0,1,1,1,x\n", "T005", "line 2, column `i2`: `x`"),
        ("t_s,q1,q2\n0,1\n", "T006", "line 2: 2 cells, the header has 3"),
        ("t_s,q1,q2\n0,1,1\n0,1,1\n", "T008", "line 3"),
        ("t_s,q1,q2,p_x,p_y,p_z,q_x,q_y,q_z,q_w\n0,1,1,0,0,0,0,0,0,2\n", "T007", "line 2"),
    ] {
        let error = read(text, false).expect_err(text);
        let message = error.to_string();
        assert!(error.code() == code && message.starts_with("log.csv") && message.contains(says), "{text}: {message}");
        assert!(!error.remedy().is_empty());
    }
    let long = format!("t_s,q1,q2\n0,1,{}\n", "1".repeat(70_000));
    assert!(matches!(read(&long, false), Err(FormatsError::RowTooLong { line: 2, .. })));
    assert!(matches!(
        JointLog::read(Path::new("/no/such/log.csv"), &slide(), false),
        Err(FormatsError::Unreadable { .. })
    ));
}

#[test]
fn a_template_is_a_log_of_its_arm() {
    let embedded = EMBEDDED.map(|embedded| ArmModel::find(embedded.name, &Robots::none()).unwrap());
    for arm in embedded.into_iter().chain([slide()]) {
        let text = joint_template(&arm);
        let log = JointLog::from_reader(text.as_bytes(), Path::new("template.csv"), &arm, false).unwrap();
        assert_eq!((log.rows.len(), log.warnings.len()), (2, 0));
        for row in &log.rows {
            assert_eq!(row.positions.len(), arm.tree.joints());
            assert!(
                row.rates.is_some() && row.accelerations.is_some() && row.torques.is_some() && row.currents.is_some()
            );
            let free = arm.base_kind == tumble_formats::arm::BaseKind::Free;
            assert!(row.base_twist().is_some() == free && row.base_wrench.is_some() == free);
        }
    }
}
