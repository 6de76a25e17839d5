//! A mission with one defect: the loop of `tumble fly` with other layers.

use std::sync::{Arc, Mutex};

use nalgebra::Vector3;
use tumble::TumbleError;
use tumble::mission::{
    computing_time, estimator, loop_settings, measurement, scene, stretch_planner, tube_controllers,
};
use tumble::scenario::MissionProblem;
use tumble_astrobee::propulsion::inverse::wrench_of_flow;
use tumble_astrobee::propulsion::{InverseAllocation, PropulsionCommand};
use tumble_identification::estimator::Acted;
use tumble_identification::recursive::FlightEstimator;
use tumble_lie::Wrench;
use tumble_planning::collision::CollisionWorld;
use tumble_planning::control::{OriginalDisturbance, OriginalSettings, OriginalTubeController, OriginalWeights};
use tumble_planning::global::FlightPlanner;
use tumble_planning::local::Surroundings;
use tumble_planning::mission::{Action, ClosedLoop, End, LoopObserver, Note, Scene, Simulated};
use tumble_planning::{ModelBelief, PlanningError};

use super::super::flown::Condition;
use super::Defect;
use super::filter::{FilterKind, OriginalFilter};
use super::wrong::{Flies, RESET_S, SeenWorld, Teller, Who, WrongController, WrongStretches, WrongWays, read, write};

/// Last nozzle of each module: the one that the sum leaves out.
const LEFT_OUT: [usize; 2] = [5, 11];
/// Of so many measurements one is used.
const STRIDE: usize = 10;

/// What became of it.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    pub arrived: bool,
    pub mission_s: f64,
    pub clearance_m: f64,
    /// True distance from what was to be flown, root mean square: of all, and of the last quarter, m.
    pub tracking_m: [f64; 2],
    /// Of what the planner of stretches was told last: mass, centre of mass (m), largest of the moments, relative but for the
    /// centre.
    pub errors: [f64; 3],
    /// Error of its mass in its own standard deviations.
    pub mass_score: f64,
    pub contradictions: u32,
    pub refused: u32,
}

#[derive(Default)]
struct Counts {
    contradictions: u32,
    refused: u32,
}

impl LoopObserver for Counts {
    fn answered(&mut self, _time_ns: i64, action: &Action) {
        match action {
            Action::Note(Note::Contradiction { .. }) => self.contradictions += 1,
            Action::Note(Note::Refused { .. } | Note::Unsafe { .. }) => self.refused += 1,
            _ => {}
        }
    }
}

type WrongLoop = ClosedLoop<SeenWorld, WrongController, FlightEstimator>;
type WrongPlanners = Simulated<WrongWays, WrongStretches>;

fn wrong_loop(
    problem: &MissionProblem,
    condition: Condition,
    seed: u64,
    teller: &Arc<Teller>,
) -> Result<(WrongLoop, WrongPlanners), PlanningError> {
    let defect = teller.defect;
    let seen = scene(problem, 0.0, &[])?;
    let world = SeenWorld { world: seen.world, is_checked: defect != Defect::NoObstaclesUnchecked };
    let stretches = WrongStretches {
        planner: stretch_planner(problem, condition.weighting)?,
        teller: Arc::clone(teller),
        nothing: Surroundings::none(),
    };
    let ways = WrongWays { planner: FlightPlanner::default(), teller: Arc::clone(teller) };
    let mut ours = tube_controllers(problem);
    let teller = Arc::clone(teller);
    let disturbance = match defect {
        Defect::TwoTerms => Some(OriginalDisturbance::OfBelief),
        Defect::StoredSet => Some(OriginalDisturbance::Stored),
        _ => None,
    };
    let controller = move |belief: &ModelBelief| {
        let belief = teller.told(Who::Controller, belief);
        let flies = match disturbance {
            None => Flies::Ours(Box::new(ours(&belief)?)),
            Some(disturbance) => {
                let mass_kg = teller.prior.parameters.mass;
                let settings = OriginalSettings {
                    weights: OriginalWeights::PERMISSIVE,
                    disturbance,
                    mass_kg,
                    ..OriginalSettings::default()
                };
                Flies::Original(Box::new(OriginalTubeController::original(&settings, *belief.parameters())?))
            }
        };
        let first = ModelBelief { revision: belief.revision, estimate: teller.prior };
        let is_set_back = defect == Defect::ResetAnew && read(&teller.time_s) < RESET_S;
        let anew = if is_set_back { Some(Flies::Ours(Box::new(ours(&first)?))) } else { None };
        Ok(WrongController { flies, anew, teller: Arc::clone(&teller) })
    };
    let flying = ClosedLoop::try_new(
        loop_settings(problem, condition.feedback, seed),
        Scene { world, surroundings: seen.surroundings },
        controller,
        estimator(problem)?,
        problem.flight.simulator.time_ns(),
    )?;
    Ok((flying, Simulated::new((ways, stretches), computing_time(problem))))
}

/// What the inverse of the allocation makes of a command less what it should: the pressure of five nozzles, thrust of six.
fn five_nozzles(command: &PropulsionCommand) -> Wrench<f64> {
    let inverse = InverseAllocation::default();
    let mut closed = *command;
    for nozzle in LEFT_OUT {
        closed.nozzles[nozzle] = 0;
    }
    let (full, five) = (inverse.flow_of_bytes(command), inverse.flow_of_bytes(&closed));
    let mut wrong = full;
    for (module, five) in wrong.iter_mut().zip(&five) {
        let share = if module.pressure_pa > 0.0 { five.pressure_pa / module.pressure_pa } else { 1.0 };
        module.thrusts_n = module.thrusts_n.map(|thrust| thrust * share);
    }
    let [wrong, full] = [wrench_of_flow(&wrong), wrench_of_flow(&full)];
    Wrench::new(wrong.torque - full.torque, wrong.force - full.force)
}

/// Flies it.
pub fn fly(condition: Condition, seed: u64, defect: Defect) -> Result<Outcome, TumbleError> {
    let mut problem = condition.source()?.mission(&condition.options(seed))?;
    if defect == Defect::IzzNeverWeighted
        && let Some(weight) = problem.weighting.gamma0.get_mut(1)
    {
        *weight = 0.0;
    }
    let kind = match defect {
        Defect::FromMeasurement => Some(FilterKind { has_transport: true, stride: 1 }),
        Defect::WithoutTransport => Some(FilterKind { has_transport: false, stride: 1 }),
        Defect::AsPublished => Some(FilterKind { has_transport: false, stride: STRIDE }),
        _ => None,
    };
    let mut filter = kind.map(|kind| OriginalFilter::new(kind, &problem.prior));
    let teller = Arc::new(Teller { defect, prior: problem.prior, time_s: Mutex::new(0.0), filtered: Mutex::new(None) });
    let (mut flying, mut planners) = wrong_loop(&problem, condition, seed, &teller).map_err(TumbleError::Planning)?;
    let judge = scene(&problem, f64::INFINITY, &[]).map_err(TumbleError::Planning)?.world;
    let (mut counts, mut squares, mut clearance_m) = (Counts::default(), Vec::new(), f64::INFINITY);
    let (mut acted, mut arrived, mut count) = (Wrench::zero(), Vec::new(), 0);
    let mut from_ns = problem.flight.simulator.time_ns();
    while flying.end().is_none() {
        let time_ns = problem.flight.simulator.time_ns();
        let time_s = time_ns as f64 * 1e-9;
        write(&teller.time_s, time_s);
        let acting = Acted { from_ns, until_ns: time_ns, wrench_body: acted, stored_body: Vector3::zeros() };
        let command = flying.step_with(&mut planners, &acting, &arrived, &mut counts);
        let command = command.map_err(TumbleError::Planning)?;
        from_ns = time_ns;
        let pose = problem.flight.simulator.state().world_from_body;
        let near = judge.clearance(&problem.planning.body, &pose, time_s).map_err(TumbleError::Planning)?;
        clearance_m = clearance_m.min(near.distance_m);
        let wanted = flying.reference(time_s).state.world_from_body;
        squares.push((time_s, (pose.translation.vector - wanted.translation.vector).norm_squared()));
        let measured = problem.flight.push(&command.wrench_body)?;
        acted = measured.believed_wrench_body;
        if defect == Defect::FiveNozzles {
            let off = five_nozzles(&measured.command);
            acted = Wrench::new(acted.torque + off.torque, acted.force + off.force);
        }
        arrived.clear();
        if let Some(filter) = &mut filter {
            filter.acted(time_ns, &acted);
        }
        for estimate in problem.flight.simulator.estimates() {
            count += 1;
            if defect != Defect::EveryTenth || (count - 1) % STRIDE == 0 {
                arrived.push(measurement(estimate, &problem.noise));
            }
            if let Some(filter) = &mut filter {
                filter.measured(estimate);
            }
        }
        write(&teller.filtered, filter.as_ref().map(OriginalFilter::estimate));
    }
    let mission_s = problem.flight.simulator.time_ns() as f64 * 1e-9;
    let rms = |from_s: f64| {
        let since = squares.iter().filter(|(time_s, _)| *time_s >= from_s);
        let (count, sum) = since.fold((0.0, 0.0), |(count, sum), (_, square)| (count + 1.0, sum + square));
        f64::sqrt(sum / count)
    };
    let latest = ModelBelief { estimate: flying.estimator().estimate(), ..flying.belief().clone() };
    let told = teller.told(Who::Stretch, &latest);
    let (errors, mass_score) = errors(&problem, &told);
    Ok(Outcome {
        arrived: flying.end() == Some(&End::Arrived),
        mission_s,
        clearance_m,
        tracking_m: [rms(0.0), rms(0.75 * mission_s)],
        errors,
        mass_score,
        contradictions: counts.contradictions,
        refused: counts.refused,
    })
}

fn errors(problem: &MissionProblem, told: &ModelBelief) -> ([f64; 3], f64) {
    let (truth, found) = (&problem.truth, told.parameters());
    let [is, should] = [found, truth].map(|body| body.inertia_about_com().diagonal());
    let axes = if problem.planar { 2..3 } else { 0..3 };
    let moments = axes.map(|axis| (is[axis] / should[axis] - 1.0).abs()).fold(0.0, f64::max);
    let mut off: Vector3<f64> = found.center_of_mass() - truth.center_of_mass();
    if problem.planar {
        off.z = 0.0;
    }
    let mass = found.mass - truth.mass;
    ([(mass / truth.mass).abs(), off.norm(), moments], (mass / told.estimate.std.mass_kg).abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble::mission::{NoHooks, fly as fly_mission};

    /// Without a defect the loop here is that of `tumble fly`, to the last bit of what both add up.
    #[test]
    #[allow(clippy::float_cmp, reason = "the same operations give the same bits")]
    fn a_flight_without_defect_is_the_mission() {
        let condition = Condition::rattle("iss-station", "ideal");
        let found = fly(condition, 3, Defect::None).unwrap();
        let source = condition.source().unwrap();
        let summary = fly_mission(&source, &condition.options(3), &mut NoHooks).unwrap().summary;
        assert_eq!(found.mission_s, summary.mission_s);
        assert_eq!(Some(found.clearance_m), summary.min_clearance_m);
        assert!((found.tracking_m[0] - summary.rms_tracking_m.all).abs() < 1e-12);
        let mass = &summary.parameters[0];
        assert!((found.errors[0] - (mass.estimate / mass.truth - 1.0).abs()).abs() < 1e-9);
        assert!(found.arrived && summary.arrived);
    }

    /// Leaving an open nozzle out of the sum makes the pressure too high, and nothing else.
    #[test]
    fn five_of_six_nozzles_overstate_the_wrench() {
        let mut command = PropulsionCommand { impeller_speeds: [200, 200], nozzles: [0; 12] };
        command.nozzles[0] = 120;
        let none = five_nozzles(&command);
        assert!(none.force.norm() < 1e-12 && none.torque.norm() < 1e-12);
        command.nozzles[LEFT_OUT[0]] = 200;
        assert!(five_nozzles(&command).force.norm() > 1e-4);
    }
}
