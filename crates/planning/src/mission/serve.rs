//! Answers to what a loop asks to be planned, wherever this is done.

use super::beside::{as_fast_as_may_be, most_beside};
use super::event::{Ambition, FoundStretch};
use super::loop_settings::LoopSettings;
use super::motion::MissionMotion;
use super::plan_request::{Asked, Found, Layer, PlanAnswer, PlanRequest, nanoseconds, seconds};
use super::retreat::{held_m, retreat};
use super::stretch::{StretchAnswer, StretchOutcome, StretchPlanner, StretchTask};
use crate::budget::{Budget, Units};
use crate::collision::CollisionWorld;
use crate::error::PlanningError;
use crate::global::{GlobalAnswer, GlobalPlanner, GlobalRequest, MotionLimits, Obstruction, Status, Until};
use crate::motion::{ArcPath, BodyArc, TranslationState};
use nalgebra::Vector3;
use tumble_dynamics::RigidBodyState;
use tumble_lie::Pose;

/// A way to the goal ends no farther from its region than this, m.
const AT_GOAL_M: f64 = 0.01;

/// How often it is looked whether a motion has left what it began in contact with, s.
const CONTACT_STEP_S: f64 = 0.1;

/// Answers a request with a planner of ways and one of stretches: nothing else than they and the request decides what comes out.
///
/// What was flown may end nearer to something, farther out or faster than a way should be planned: limits and margin are widened
/// as far as the start asks for. That no way exists is said only where none exists with the margin that is kept in flight; a stretch
/// comes with the stop after it and with the check of both.
pub fn serve<W, G, L>(planners: &mut (G, L), request: &PlanRequest<W>) -> PlanAnswer
where
    W: CollisionWorld,
    W::Body: Sized,
    G: GlobalPlanner<W>,
    L: StretchPlanner,
{
    let (ways, stretches) = planners;
    let (found, units) = match &request.asked {
        Asked::Stay => (Ok(stay(stretches.horizon_s(), request)), 0),
        Asked::Way { known, margin_m } => match way(ways, request, known.as_deref(), *margin_m) {
            Ok(answer) => {
                let units = answer.units;
                (way_or_retreat(request, answer), units)
            }
            Err(error) => (Err(error), 0),
        },
        Asked::Stretch { .. } => {
            let mut budget = Units::new(request.settings.stretch_units);
            let found = stretch(stretches, request, &mut budget);
            (found, budget.spent())
        }
    };
    let is_stretch = request.is_stretch();
    PlanAnswer {
        request: request.request,
        world_revision: request.world_revision,
        units,
        found: found.unwrap_or_else(|error| Found::Failed { is_stretch, error }),
    }
}

/// So long that no mission comes to its end.
fn stay<W>(horizon_s: f64, request: &PlanRequest<W>) -> Found
where
    W: CollisionWorld,
    W::Body: Sized,
{
    let pose = request.start.world_from_body;
    let here = TranslationState::at_rest(pose.translation.vector);
    let resting = BodyArc::accelerated(horizon_s * 1e3, &here, Vector3::zeros(), pose.rotation);
    Found::Stay(ArcPath::new([resting]), request.belief.revision)
}

/// Whoever finds no way stands where its last stop ended, which may be nearer to something than one may stay.
fn way_or_retreat<W>(request: &PlanRequest<W>, answer: GlobalAnswer) -> Result<Found, PlanningError>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    if answer.plan.is_none()
        && let Some(path) = retreat(request)?
    {
        return Ok(Found::Retreat(Box::new(answer), path, request.belief.revision));
    }
    Ok(Found::Way(Box::new(answer)))
}

fn way<W, G>(
    planner: &mut G,
    asked: &PlanRequest<W>,
    known: Option<&ArcPath>,
    margin_m: f64,
) -> Result<GlobalAnswer, PlanningError>
where
    W: CollisionWorld,
    W::Body: Sized,
    G: GlobalPlanner<W>,
{
    let PlanRequest { settings, scene, start, .. } = asked;
    let (pose, start_s) = (start.world_from_body, seconds(asked.start_ns));
    let clearance = scene.world.clearance(&settings.body, &pose, start_s)?;
    let held_m = |margin_m: f64| held_m(margin_m, clearance.distance_m);
    let mut limits =
        MotionLimits { position: asked.position_limits(), force_n: asked.force_limit_n(), ..settings.limits };
    let velocity = pose.rotation * start.twist_body.linear;
    limits.speed_m_s = limits.speed_m_s.sup(&velocity.abs());
    if !asked.environment.is_empty() {
        let [force, torque] = shares_left(asked);
        limits.force_n *= force;
        limits.torque_n_m *= torque;
    }
    let mut plan = |margin_m: f64, known: Option<&ArcPath>, units: u64| {
        let request = GlobalRequest {
            world: &scene.world,
            body: &settings.body,
            start: TranslationState { position: pose.translation.vector, velocity },
            attitude: pose.rotation,
            start_s,
            goal: settings.goal,
            limits,
            belief: &asked.belief,
            objective: settings.objective,
            margin_m,
            until: Until::BudgetSpent,
            seed: draw(settings.seed, asked.request),
        };
        let mut budget = Units::new(units);
        match known {
            Some(known) => planner.plan_anew(&request, known, &mut budget),
            None => planner.plan(&request, &mut budget),
        }
    };
    let first_units = if asked.layer() == Some(Layer::NewWay) { settings.new_way_units } else { settings.way_units };
    let answer = plan(held_m(margin_m), known, first_units)?;
    let takes_longer =
        |known: &&ArcPath| answer.plan.as_ref().is_some_and(|plan| plan.trajectory.duration_s() > known.duration_s());
    if let Some(known) = known.filter(takes_longer)
        && first_units < settings.way_units
    {
        // what is left of the known way is less than all of it: so much longer is worth a search as long as the first
        let again = plan(held_m(margin_m), Some(known), settings.way_units)?;
        let units = answer.units + again.units;
        let better = if again.cost < answer.cost { again } else { answer };
        return Ok(GlobalAnswer { units, ..better });
    }
    let least_m = held_m(settings.check_margin_m);
    if proof(&answer).is_none() || least_m >= held_m(margin_m) {
        return Ok(answer);
    }
    // a way as near as may be flown is better than none
    let nearer = plan(least_m, known, first_units)?;
    Ok(GlobalAnswer { units: answer.units + nearer.units, ..nearer })
}

/// Shares of force and torque that what else acts leaves to a way: at its start and at its goal, as it moves there, at rest, and as
/// fast as may be.
fn shares_left<W>(asked: &PlanRequest<W>) -> [f64; 2]
where
    W: CollisionWorld,
    W::Body: Sized,
{
    let PlanRequest { settings, start, belief, .. } = asked;
    let rotation = settings.goal.attitude.unwrap_or(start.world_from_body.rotation);
    let goal = Pose::from_parts(settings.goal.position.into(), rotation);
    let start_s = seconds(asked.start_ns);
    let MotionLimits { speed_m_s, rate_rad_s, .. } = &settings.limits;
    let at_rest = [start.world_from_body, goal]
        .map(|world_from_body| RigidBodyState { world_from_body, ..RigidBodyState::at_rest() });
    let fast = at_rest.into_iter().flat_map(|state| as_fast_as_may_be(state, speed_m_s, *rate_rad_s));
    let states = std::iter::once(*start).chain(fast).map(|state| (start_s, state));
    settings.brake.shares_left(&most_beside(&asked.environment, belief.parameters(), states))
}

/// Why there is no way and never will be one in this world, whatever the start: what is said of a start or of a limit, another
/// start may be free of.
pub(super) fn proof(answer: &GlobalAnswer) -> Option<&Obstruction> {
    match &answer.status {
        Status::Infeasible(why @ (Obstruction::Enclosed { .. } | Obstruction::GoalBlocked { .. })) => Some(why),
        _ => None,
    }
}

fn stretch<W, L>(planner: &mut L, asked: &PlanRequest<W>, budget: &mut dyn Budget) -> Result<Found, PlanningError>
where
    W: CollisionWorld,
    W::Body: Sized,
    L: StretchPlanner,
{
    let Asked::Stretch { way, way_start_ns, ambition, elapsed_s } = &asked.asked else {
        return Ok(Found::NoStretch(None));
    };
    let PlanRequest { settings, scene, belief, start, .. } = asked;
    let (start_s, way_start_s) = (seconds(asked.start_ns), seconds(*way_start_ns));
    let mut answer = if *ambition == Ambition::AlongWay {
        let until_s = (start_s + planner.horizon_s()).min(way_start_s + way.duration_s());
        StretchAnswer::along_way(way, way_start_s, start_s, until_s)
    } else {
        let task = StretchTask {
            start: *start,
            start_s,
            asked_s: seconds(asked.asked_ns),
            way,
            way_start_s,
            belief,
            surroundings: &scene.surroundings,
            environment: &asked.environment,
            is_informative: *ambition == Ambition::Informative,
            elapsed_s: *elapsed_s,
        };
        match planner.plan(&task, budget)? {
            StretchOutcome::Planned(answer) => *answer,
            StretchOutcome::Refused(refusal) => return Ok(Found::NoStretch(Some(refusal))),
        }
    };
    answer.motion = answer.motion.with_stop(&asked.stop);
    let is_apart = match leaves_contact(asked, &answer.motion)? {
        Some((from_s, distance_m)) => {
            let margin_m = held_m(settings.check_margin_m, distance_m);
            answer.motion.first_contact(&scene.world, &settings.body, from_s, margin_m)?.is_none()
        }
        None => false,
    };
    let position = &settings.limits.position;
    let slack = Vector3::repeat(settings.margin_m - settings.check_margin_m);
    let (lower, upper) = (position.lower_world - slack, position.upper_world + slack);
    let is_inside = |point: &Vector3<f64>| point.sup(&lower) == *point && point.inf(&upper) == *point;
    let found = FoundStretch {
        start_ns: asked.start_ns,
        // the last one is over when it has arrived
        end_ns: nanoseconds(answer.arrival_s.unwrap_or(answer.motion.end_s())),
        model_revision: belief.revision,
        world_revision: asked.world_revision,
        is_last: answer.is_last,
        is_to_goal: leads_to_goal(way, settings),
        is_clear: is_apart && answer.motion.points(1.0).iter().all(is_inside),
    };
    Ok(Found::Stretch(found, Box::new(answer)))
}

/// Whether a way ends at the goal; one that only stays has none to lead to.
fn leads_to_goal<B>(way: &ArcPath, settings: &LoopSettings<B>) -> bool {
    let Some((arc, within_s)) = way.at(way.duration_s()) else { return true };
    let apart = arc.pose(within_s).translation.vector - settings.goal.position;
    settings.schedule.stretches.is_some() || apart.norm_squared() <= (settings.goal.radius_m + AT_GOAL_M).powi(2)
}

/// From when on a motion touches nothing, s, and how far it is from everything then, m: from its start, where that is not in contact. None where
/// it never is apart, or first goes deeper or into something else.
fn leaves_contact<W>(asked: &PlanRequest<W>, motion: &MissionMotion) -> Result<Option<(f64, f64)>, PlanningError>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    let mut at_s = seconds(asked.start_ns);
    let clearance = |pose: &Pose<f64>, at_s| asked.scene.world.clearance(&asked.settings.body, pose, at_s);
    let mut here = clearance(&asked.start.world_from_body, at_s)?;
    while here.distance_m <= 0.0 {
        at_s += CONTACT_STEP_S;
        let next = clearance(&motion.state_at(at_s).world_from_body, at_s)?;
        let is_into_another = next.distance_m <= 0.0 && next.nearest != here.nearest;
        if next.distance_m < here.distance_m || is_into_another || at_s > motion.rest_s() + CONTACT_STEP_S {
            return Ok(None);
        }
        here = next;
    }
    Ok(Some((at_s, here.distance_m)))
}

/// A number that follows from two, and looks like chance.
pub(super) fn draw(seed: u64, number: u64) -> u64 {
    let mut mixed = seed.wrapping_add(number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}
