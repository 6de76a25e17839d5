//! A plan as a table: the columns of a log.

use crate::flight_log::{nanoseconds, push_numbers, push_pose, push_wrench, time_cell};
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{BodyAcceleration, FreeFlyer, InertialParameters};
use tumble_lie::Twist;
use tumble_planning::{ArcPath, BodyArc};

/// Time between two rows of a short plan, s; a row stands at the end of each arc besides.
const STEP_S: f64 = 0.1;
/// About as many rows at most: beyond, the step is doubled.
const MOST_ROWS: f64 = 100_000.0;

/// A plan as a table, and what its rows need at most.
pub(super) struct Rows {
    /// The table.
    pub text: String,
    /// Time between two rows, s.
    pub step_s: f64,
    /// Largest absolute force along each body axis, N.
    pub largest_force_n: Vector3<f64>,
    /// Largest absolute torque about the origin, about each body axis, N m.
    pub largest_torque_n_m: Vector3<f64>,
}

const HEADER: &str =
    "t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,v_x,v_y,v_z,w_x,w_y,w_z,a_x,a_y,a_z,f_x,f_y,f_z,tau_x,tau_y,tau_z";

/// The least step of 0.1 s, 0.2 s, 0.4 s, ... that gives no more than [`MOST_ROWS`].
fn step_s(duration_s: f64) -> f64 {
    let mut step_s = STEP_S;
    while duration_s > MOST_ROWS * step_s {
        step_s *= 2.0;
    }
    step_s
}

/// A row at every multiple of the step, at the begin of every arc and at the end; where there are no arcs, the start.
/// Accelerations and wrenches are those just after the row's time, in the last row those just before.
pub(super) fn rows(path: &ArcPath, start: &BodyArc, body: &InertialParameters<f64>) -> Rows {
    let flyer = FreeFlyer::new(*body);
    let step_s = step_s(path.duration_s());
    let zero = Vector3::zeros();
    let mut rows = Rows { text: format!("{HEADER}\n"), step_s, largest_force_n: zero, largest_torque_n_m: zero };
    let mut begin_s = 0.0;
    let mut last_ns = -1;
    for arc in path.arcs() {
        let end_s = begin_s + arc.duration_s;
        let mut time_s = begin_s;
        // In nanoseconds: a step and an arc's end that rounding sets apart are one time, and the next arc's.
        while nanoseconds(time_s) < nanoseconds(end_s) {
            push_row(&mut rows, &flyer, arc, time_s - begin_s, nanoseconds(time_s), &mut last_ns);
            time_s = ((time_s / step_s + 1e-6).floor() + 1.0) * step_s;
        }
        begin_s = end_s;
    }
    let last = path.arcs().last().unwrap_or(start);
    push_row(&mut rows, &flyer, last, last.duration_s, nanoseconds(begin_s), &mut last_ns);
    rows
}

/// One row, unless there is one at this time.
fn push_row(rows: &mut Rows, flyer: &FreeFlyer<f64>, arc: &BodyArc, within_s: f64, time_ns: i64, last_ns: &mut i64) {
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
    let wrench = flyer.inverse(&twist_body, &acceleration);
    rows.largest_force_n = rows.largest_force_n.sup(&wrench.force.abs());
    rows.largest_torque_n_m = rows.largest_torque_n_m.sup(&wrench.torque.abs());
    let text = &mut rows.text;
    text.push_str(&time_cell(time_ns));
    push_pose(text, &pose);
    push_numbers(text, state.velocity.iter().chain(&twist_body.angular));
    push_numbers(text, &acceleration.acceleration_origin_body);
    push_wrench(text, &wrench);
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_dynamics::nalgebra::{Matrix3, UnitQuaternion};
    use tumble_planning::TranslationState;

    #[test]
    fn long_plans_have_longer_steps_and_no_more_rows() {
        let body = InertialParameters::about_com(8.0, Vector3::zeros(), Matrix3::identity());
        let start = TranslationState { position: Vector3::zeros(), velocity: Vector3::x() };
        let arc =
            |duration_s: f64| BodyArc::accelerated(duration_s, &start, Vector3::zeros(), UnitQuaternion::identity());
        for (duration_s, step_s) in [(9_999.0, 0.1), (10_001.0, 0.2), (224_567.0, 3.2), (22e6, 409.6)] {
            // An arc's begin between two steps keeps its row.
            let found = rows(&ArcPath::new([arc(0.05), arc(duration_s)]), &arc(0.0), &body);
            assert!((found.step_s - step_s).abs() < 1e-9 * step_s, "{duration_s}: {}", found.step_s);
            let count = found.text.lines().count();
            assert!((50_000..=100_004).contains(&count), "{duration_s}: {count}");
            assert!(found.text.lines().nth(2).unwrap().starts_with("0.05"), "{duration_s}");
        }
        let still = rows(&ArcPath::new([]), &arc(0.0), &body);
        assert_eq!(still.text.lines().count(), 2, "{}", still.text);
    }

    #[test]
    fn rows_stand_at_steps_and_at_the_ends_of_arcs() {
        let start = TranslationState::at_rest(Vector3::new(1.0, 2.0, 3.0));
        let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, 0.5);
        let push = Vector3::new(0.02, -0.01, 0.0);
        let first = BodyArc::accelerated(0.25, &start, push, turned);
        let second = BodyArc::accelerated(0.3, &first.translation(0.25).0, -push, turned);
        let body = InertialParameters::about_com(8.0, Vector3::zeros(), Matrix3::identity());
        let text = rows(&ArcPath::new([first, second]), &first, &body).text;
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
