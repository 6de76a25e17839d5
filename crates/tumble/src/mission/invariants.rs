//! What must hold in every control period, held against what is flown.

use super::assembly::AstrobeeLoop;
use super::record::BROKEN_INVARIANT;
use crate::scenario::MissionProblem;
use tumble_identification::Estimate;
use tumble_lie::Wrench;
use tumble_planning::control::ControlCommand;
use tumble_planning::mission::{Invariant, InvariantWatch, WatchLimits, WatchedStep};

/// Age of the newest measurement beyond which the robot is blind, ns.
const BLIND_NS: i64 = 1_000_000_000;

/// A watch over a mission.
pub(super) fn watch(problem: &MissionProblem) -> InvariantWatch {
    InvariantWatch::new(WatchLimits::new(problem.force_limit_n, problem.torque_limit_n_m.min()))
}

/// Looks at a control period; whether force or torque were beyond their limits.
pub(super) fn look(
    watch: &mut InvariantWatch,
    problem: &MissionProblem,
    flying: &AstrobeeLoop,
    command: &ControlCommand,
    estimate: &Estimate,
    clearance_m: Option<f64>,
) -> bool {
    let before = limits_passed(watch);
    let state = problem.flight.simulator.state();
    let estimator = flying.estimator();
    let time_ns = problem.flight.simulator.time_ns();
    let believed = flying.state().world_from_body.rotation;
    let wanted = flying.reference(time_ns as f64 * 1e-9).state.world_from_body.rotation;
    let quaternions_xyzw = [believed, wanted].map(|rotation| [rotation.i, rotation.j, rotation.k, rotation.w]);
    let since = |since_ns: i64, patience_ns: i64| (time_ns - since_ns > patience_ns).then_some(since_ns);
    let wrench_body: Wrench<f64> = command.wrench_body;
    watch.see(&WatchedStep {
        time_ns,
        clearance_m,
        wrench_body,
        command_ns: flying.time_ns(),
        command_revision: command.model_revision,
        offered_revision: flying.newest_revision(),
        body: &estimate.parameters,
        covariance: Some(&estimate.covariance),
        quaternions_xyzw: &quaternions_xyzw,
        speed_m_s: state.twist_body.linear.norm(),
        rate_rad_s: state.twist_body.angular.norm(),
        blind_since_ns: since(estimator.newest_stamp_ns(), BLIND_NS),
        planless_since_ns: since(flying.rests_from_ns(), 0),
    });
    limits_passed(watch) > before
}

fn limits_passed(watch: &InvariantWatch) -> u64 {
    watch.count(Invariant::Force) + watch.count(Invariant::Torque)
}

/// What did not hold, beside clearance and limits, which the summary has numbers for: of each invariant the first time, and how
/// often.
pub(super) fn warnings(watch: &InvariantWatch) -> Vec<String> {
    let told_elsewhere = [Invariant::Clearance, Invariant::Force, Invariant::Torque];
    let broken = Invariant::ALL.into_iter().filter(|invariant| !told_elsewhere.contains(invariant));
    let first = |invariant| watch.violations().iter().find(|violation| violation.invariant == invariant);
    broken
        .filter_map(|invariant| Some((first(invariant)?, watch.count(invariant))))
        .map(|(violation, count)| format!("{BROKEN_INVARIANT}{violation} ({count} control periods)"))
        .collect()
}
