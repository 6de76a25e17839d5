//! A plan as a table: the columns of a log.

use crate::flight_log::{nanoseconds, push_numbers, push_pose, push_wrench, time_cell};
use tumble_dynamics::{BodyAcceleration, FreeFlyer, InertialParameters};
use tumble_lie::Twist;
use tumble_planning::{ArcPath, BodyArc};

/// Time between two rows, s; a row stands at the end of each arc besides.
pub(super) const STEP_S: f64 = 0.1;

const HEADER: &str =
    "t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,v_x,v_y,v_z,w_x,w_y,w_z,a_x,a_y,a_z,f_x,f_y,f_z,tau_x,tau_y,tau_z";

/// A row at every multiple of [`STEP_S`], at the begin of every arc and at the end. Accelerations and wrenches are those
/// just after the row's time, in the last row those just before.
pub(super) fn csv(path: &ArcPath, body: &InertialParameters<f64>) -> String {
    let flyer = FreeFlyer::new(*body);
    let mut text = format!("{HEADER}\n");
    let mut begin_s = 0.0;
    let mut last_ns = -1;
    for arc in path.arcs() {
        let end_s = begin_s + arc.duration_s;
        let mut time_s = begin_s;
        // In nanoseconds: a step and an arc's end that rounding sets apart are one time, and the next arc's.
        while nanoseconds(time_s) < nanoseconds(end_s) {
            push_row(&mut text, &flyer, arc, time_s - begin_s, nanoseconds(time_s), &mut last_ns);
            time_s = ((time_s / STEP_S + 1e-6).floor() + 1.0) * STEP_S;
        }
        begin_s = end_s;
    }
    if let Some(arc) = path.arcs().last() {
        push_row(&mut text, &flyer, arc, arc.duration_s, nanoseconds(begin_s), &mut last_ns);
    }
    text
}

/// One row, unless there is one at this time.
fn push_row(text: &mut String, flyer: &FreeFlyer<f64>, arc: &BodyArc, within_s: f64, time_ns: i64, last_ns: &mut i64) {
    if time_ns <= *last_ns {
        return;
    }
    *last_ns = time_ns;
    let pose = arc.pose(within_s);
    let (state, acceleration_world) = arc.translation(within_s);
    let (_, rate, rate_change) = arc.turn(within_s);
    let into_body = pose.rotation.inverse();
    let twist_body = Twist::new(arc.axis_body.into_inner() * rate, into_body * state.velocity);
    let acceleration = BodyAcceleration {
        angular_acceleration_body: arc.axis_body.into_inner() * rate_change,
        acceleration_origin_body: into_body * acceleration_world,
    };
    text.push_str(&time_cell(time_ns));
    push_pose(text, &pose);
    push_numbers(text, state.velocity.iter().chain(&twist_body.angular));
    push_numbers(text, &acceleration.acceleration_origin_body);
    push_wrench(text, &flyer.inverse(&twist_body, &acceleration));
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_dynamics::nalgebra::{Matrix3, UnitQuaternion, Vector3};
    use tumble_planning::TranslationState;

    #[test]
    fn rows_stand_at_steps_and_at_the_ends_of_arcs() {
        let start = TranslationState::at_rest(Vector3::new(1.0, 2.0, 3.0));
        let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, 0.5);
        let push = Vector3::new(0.02, -0.01, 0.0);
        let first = BodyArc::accelerated(0.25, &start, push, turned);
        let second = BodyArc::accelerated(0.3, &first.translation(0.25).0, -push, turned);
        let body = InertialParameters::about_com(8.0, Vector3::zeros(), Matrix3::identity());
        let text = csv(&ArcPath::new([first, second]), &body);
        let rows: Vec<Vec<f64>> =
            text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
        let times: Vec<f64> = rows.iter().map(|row| row[0]).collect();
        assert_eq!(times, [0.0, 0.1, 0.2, 0.25, 0.3, 0.4, 0.5, 0.55]);
        assert!(rows.iter().all(|row| row.len() == HEADER.split(',').count()));
        // The force turned back into the world is mass times acceleration, after the begin of each arc its own.
        for (row, sign) in rows.iter().zip([1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0, -1.0]) {
            let force = turned * Vector3::new(row[17], row[18], row[19]);
            assert!((force - push * (8.0 * sign)).norm() < 1e-14, "{row:?}");
        }
        let end = &rows[7];
        assert!((end[1] - 1.0 - 0.02 * (0.03125 + 0.25 * 0.3 - 0.045)).abs() < 1e-12, "{end:?}");
    }
}
