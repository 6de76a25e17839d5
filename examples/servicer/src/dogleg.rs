//! A planner of ways that knows straight lines, and one corner.

use tumble_planning::collision::{Blocker, CollisionWorld};
use tumble_planning::global::{GlobalAnswer, GlobalPlanner, GlobalRequest, Improvement, Status};
use tumble_planning::nalgebra::Vector3;
use tumble_planning::{ArcPath, BodyArc, Budget, Plan, PlanningError, TranslationState};

/// From rest to rest straight ahead, or around one of some corners beside the way; the first arc brakes what still moves.
#[derive(Clone, Copy, Debug, Default)]
pub struct Dogleg;

/// How far beside the way the corners lie, m, and how many there are at each distance.
const BESIDE_M: [f64; 4] = [1.0, 1.5, 2.0, 2.5];
const AROUND: u32 = 8;

fn accelerated<W: CollisionWorld + ?Sized>(
    request: &GlobalRequest<'_, W>,
    start: &TranslationState,
    acceleration: Vector3<f64>,
    duration_s: f64,
) -> (BodyArc, TranslationState) {
    let arc = BodyArc::accelerated(duration_s, start, acceleration, request.attitude);
    let (end, _) = arc.translation(duration_s);
    (arc, end)
}

/// Faster, steadily and slower along a line, within every limit.
fn leg<W: CollisionWorld + ?Sized>(
    request: &GlobalRequest<'_, W>,
    from: &TranslationState,
    to: Vector3<f64>,
) -> Vec<BodyArc> {
    let along = to - from.position;
    let length = along.norm();
    if length == 0.0 {
        return Vec::new();
    }
    let (direction, mass) = (along / length, request.belief.parameters().mass);
    let least = |limit: &Vector3<f64>| limit.component_div(&direction.abs()).min();
    let (a, v) = (least(&request.limits.force_n) / mass, least(&request.limits.speed_m_s));
    let gaining_s = (v / a).min((length / a).sqrt());
    let steady_s = length / (a * gaining_s) - gaining_s;
    let (first, state) = accelerated(request, from, direction * a, gaining_s);
    let (second, state) = accelerated(request, &state, Vector3::zeros(), steady_s.max(0.0));
    let (third, _) = accelerated(request, &state, -direction * a, gaining_s);
    vec![first, second, third]
}

impl<W: CollisionWorld + ?Sized> GlobalPlanner<W> for Dogleg {
    fn plan(&mut self, request: &GlobalRequest<'_, W>, budget: &mut dyn Budget) -> Result<GlobalAnswer, PlanningError> {
        let (limits, goal) = (&request.limits, request.goal.position);
        let most = limits.force_n / request.belief.parameters().mass;
        let braking_s = request.start.velocity.abs().zip_map(&most, |v, a| if v > 0.0 { v / a } else { 0.0 }).max();
        let slower = if braking_s > 0.0 { -request.start.velocity / braking_s } else { Vector3::zeros() };
        let (brake, stopped) = accelerated(request, &request.start, slower, braking_s);
        let rest = TranslationState::at_rest(stopped.position);
        // Straight ahead first; then around the corners, whose plane is across the way.
        let ahead = (goal - rest.position).try_normalize(0.0).unwrap_or_else(Vector3::x);
        let beside = ahead.cross(&if ahead.x.abs() < 0.8 { Vector3::x() } else { Vector3::y() }).normalize();
        let corner = |distance_m: f64, turn: u32| {
            let angle = std::f64::consts::TAU * f64::from(turn) / f64::from(AROUND);
            let side = beside * angle.cos() + ahead.cross(&beside) * angle.sin();
            Some((rest.position + goal) * 0.5 + side * distance_m)
        };
        let corners = BESIDE_M.iter().flat_map(|beside| (0..AROUND).map(move |turn| corner(*beside, turn)));
        let (mut units, mut in_the_way, mut history) = (0, Vec::<Blocker>::new(), Vec::new());
        let mut best: Option<ArcPath> = None;
        'ways: for corner in std::iter::once(None).chain(corners) {
            let inside = |point: &Vector3<f64>| {
                point.sup(&limits.position.lower_world) == *point && point.inf(&limits.position.upper_world) == *point
            };
            if !corner.iter().chain([&stopped.position, &goal]).all(inside) {
                continue;
            }
            let turning = corner.map_or(rest, TranslationState::at_rest);
            let to_corner = corner.map_or_else(Vec::new, |corner| leg(request, &rest, corner));
            let path = ArcPath::new(std::iter::once(brake).chain(to_corner).chain(leg(request, &turning, goal)));
            if best.as_ref().is_some_and(|best| best.duration_s() <= path.duration_s()) {
                continue;
            }
            let mut start_s = request.start_s;
            for arc in path.arcs() {
                if !budget.spend(1) {
                    break 'ways;
                }
                units += 1;
                if let Some(contact) = request.world.first_contact(request.body, arc, start_s, request.margin_m)? {
                    in_the_way.extend((!in_the_way.contains(&contact.blocker)).then_some(contact.blocker));
                    continue 'ways;
                }
                start_s += arc.duration_s;
            }
            history.push(Improvement { units, cost: path.duration_s() });
            best = Some(path);
        }
        let model_revision = request.belief.revision;
        Ok(GlobalAnswer {
            status: if best.is_some() { Status::Feasible } else { Status::BudgetSpent(in_the_way) },
            cost: best.as_ref().map_or(f64::INFINITY, ArcPath::duration_s),
            plan: best.map(|trajectory| Plan { trajectory, model_revision }),
            lower_bound: 0.0,
            units,
            history,
            tree: Vec::new(),
        })
    }
}
