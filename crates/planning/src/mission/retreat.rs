//! A way out for whoever stands nearer to something than it may stay.

use super::plan_request::{PlanRequest, seconds};
use crate::collision::CollisionWorld;
use crate::error::PlanningError;
use crate::motion::{ArcPath, BodyArc, TranslationState};
use nalgebra::Vector3;
use tumble_lie::Pose;

/// Share of the clearance at its start that a way may keep.
const START_SHARE: f64 = 0.95;
/// Length of a step along a line, m.
const STEP_M: f64 = 0.01;

/// Steps of the longest line.
const STEPS: u32 = 50;

/// What a place must be farther from everything than the start is, m, to be worth going there.
const GAIN_M: f64 = 0.005;

/// Share of the force limits that is flown with: nothing presses.
const FORCE_SHARE: f64 = 0.5;

/// From rest along a straight line to the nearest place that keeps the margin of a plan from everything, or to the one that keeps most of it.
/// None where the start keeps the margin that is checked in flight, moves, or where no line leads farther away.
///
/// A robot that stopped for what showed up before it stands where its stop ended. Where no way leads on it waits there, and
/// its localisation wanders meanwhile by more than is left.
pub(super) fn retreat<W>(asked: &PlanRequest<W>) -> Result<Option<ArcPath>, PlanningError>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    let PlanRequest { settings, scene, start, .. } = asked;
    let (pose, start_s) = (start.world_from_body, seconds(asked.start_ns));
    let clearance_m = |pose: &Pose<f64>, time_s| {
        scene.world.clearance(&settings.body, pose, time_s).map(|clearance| clearance.distance_m)
    };
    let here_m = clearance_m(&pose, start_s)?;
    if here_m >= settings.check_margin_m || !asked.starts_at_rest() {
        return Ok(None);
    }
    let (margin_m, box_world) = (held_m(settings.margin_m, here_m), asked.position_limits());
    let mut best: Option<(f64, u32, ArcPath)> = None;
    for direction in directions() {
        let mut before_m = here_m;
        for k in 1..=STEPS {
            let apart = direction * (STEP_M * f64::from(k));
            let there = pose.translation.vector + apart;
            let is_inside = there.sup(&box_world.lower_world) == there && there.inf(&box_world.upper_world) == there;
            let path = line(asked, apart);
            let end = Pose::from_parts(there.into(), pose.rotation);
            let there_m = clearance_m(&end, start_s + path.duration_s())?;
            if !is_inside || path.arcs().is_empty() || there_m < margin_m.min(before_m) {
                break;
            }
            before_m = there_m;
            let kept_m = there_m.min(settings.margin_m);
            let is_better =
                best.as_ref().is_none_or(|(most_m, steps, _)| kept_m.total_cmp(most_m).then(steps.cmp(&k)).is_gt());
            let gains = kept_m >= here_m + GAIN_M && kept_m > 0.0;
            if gains && is_better && (here_m <= 0.0 || is_clear(asked, &path, margin_m)?) {
                best = Some((kept_m, k, path));
            }
            if kept_m >= settings.margin_m {
                break;
            }
        }
    }
    Ok(best.map(|(_, _, path)| path))
}

/// Along the axes of the world and between them.
fn directions() -> impl Iterator<Item = Vector3<f64>> {
    let sides = [0.0, 1.0, -1.0];
    let all =
        sides.into_iter().flat_map(move |x| sides.into_iter().flat_map(move |y| sides.map(|z| Vector3::new(x, y, z))));
    all.filter_map(|direction| direction.try_normalize(0.5))
}

/// From rest to rest along a line, half of it faster and faster, half slower and slower; no arcs where the limits allow no such motion.
fn line<W>(asked: &PlanRequest<W>, apart: Vector3<f64>) -> ArcPath
where
    W: CollisionWorld,
    W::Body: Sized,
{
    let PlanRequest { settings, start, belief, .. } = asked;
    let (distance_m, limits) = (f64::sqrt(apart.norm_squared()), &settings.limits);
    let along = |limit: &Vector3<f64>| {
        let shares = limit.iter().zip(&apart).filter(|(_, share)| **share != 0.0);
        shares.map(|(limit, share)| limit * distance_m / share.abs()).fold(f64::INFINITY, f64::min)
    };
    let pushed_m_s2 = FORCE_SHARE * along(&asked.force_limit_n()) / belief.parameters().mass;
    let acceleration_m_s2 = pushed_m_s2.min(along(&limits.speed_m_s).powi(2) / distance_m);
    if acceleration_m_s2.is_nan() || acceleration_m_s2 <= 0.0 {
        return ArcPath::default();
    }
    let half_s = f64::sqrt(distance_m / acceleration_m_s2);
    let acceleration = apart * (acceleration_m_s2 / distance_m);
    let pose = start.world_from_body;
    let faster =
        BodyArc::accelerated(half_s, &TranslationState::at_rest(pose.translation.vector), acceleration, pose.rotation);
    let slower = BodyArc::accelerated(half_s, &faster.translation(half_s).0, -acceleration, pose.rotation);
    ArcPath::new([faster, slower])
}

fn is_clear<W>(asked: &PlanRequest<W>, path: &ArcPath, margin_m: f64) -> Result<bool, PlanningError>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    let mut begin_s = seconds(asked.start_ns);
    for arc in path.arcs() {
        if asked.scene.world.first_contact(&asked.settings.body, arc, begin_s, margin_m)?.is_some() {
            return Ok(false);
        }
        begin_s += arc.duration_s;
    }
    Ok(true)
}

/// The margin that a plan keeps which begins so far from the nearest thing, m: whoever stands nearer than the margin must be able to leave.
pub(super) fn held_m(margin_m: f64, distance_m: f64) -> f64 {
    margin_m.min(START_SHARE * distance_m).max(0.0)
}
