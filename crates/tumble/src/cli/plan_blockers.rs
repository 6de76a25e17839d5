//! What can be in the way of a plan, for planners and for people.

use crate::scenario::PlanningProblem;
use tumble_dynamics::World;
use tumble_dynamics::nalgebra::Vector3;
use tumble_planning::PlanningError;
use tumble_planning::collision::{Blocker, EllipsoidWorld, MovingObstacle};

/// The obstacles of a problem in the order in which the collision world numbers them: those at rest, then the others.
fn numbered(problem: &PlanningProblem) -> Vec<usize> {
    let moving = problem.obstacle_motions.iter().map(|motion| motion.obstacle);
    let is_moving = |index: &usize| problem.obstacle_motions.iter().any(|motion| motion.obstacle == *index);
    (0..problem.world.obstacles.len()).filter(|index| !is_moving(index)).chain(moving).collect()
}

/// The world without the obstacles that move, appear or vanish.
pub(super) fn world_at_rest(problem: &PlanningProblem) -> World {
    let still = numbered(problem);
    let still = still.iter().take(still.len() - problem.obstacle_motions.len());
    World {
        obstacles: still.filter_map(|index| problem.world.obstacles.get(*index).copied()).collect(),
        ..problem.world.clone()
    }
}

/// The obstacles that move, appear or vanish.
pub(super) fn moving_obstacles(problem: &PlanningProblem) -> Vec<MovingObstacle> {
    let moving = problem.obstacle_motions.iter().filter_map(|motion| {
        let ellipsoid = *problem.world.obstacles.get(motion.obstacle)?;
        let obstacle = MovingObstacle::at_rest(ellipsoid).drifting(motion.velocity_world, 0.0);
        Some(obstacle.present(motion.appear_s, motion.vanish_s))
    });
    moving.collect()
}

/// Everything that is kept off, exactly.
///
/// # Errors
/// Those of the planner: a world that cannot be.
pub(super) fn collision_world(problem: &PlanningProblem) -> Result<EllipsoidWorld, PlanningError> {
    EllipsoidWorld::new(&world_at_rest(problem))?.with_obstacles(moving_obstacles(problem))
}

fn metres(vector: &Vector3<f64>) -> String {
    format!("({:.2}, {:.2}, {:.2})", vector.x, vector.y, vector.z)
}

/// What a blocker is, for people.
pub(super) fn named(problem: &PlanningProblem, blocker: Blocker) -> String {
    match blocker {
        Blocker::Obstacle(number) => {
            let index = numbered(problem).get(number).copied().unwrap_or(number);
            let center = problem.world.obstacles.get(index).map(|o| metres(&o.world_from_ellipsoid.translation.vector));
            format!("obstacle {index} at {} m", center.unwrap_or_default())
        }
        Blocker::KeepOut(index) => {
            let corners = problem.world.keep_out.get(index);
            let corners = corners.map(|b| format!("{} to {}", metres(&b.lower_world), metres(&b.upper_world)));
            format!("keep-out box {index} from {} m", corners.unwrap_or_default())
        }
        Blocker::KeepIn => "the end of the keep-in volume".to_owned(),
        _ => "something".to_owned(),
    }
}

pub(super) fn listed(problem: &PlanningProblem, blockers: &[Blocker]) -> String {
    let names: Vec<String> = blockers.iter().map(|blocker| named(problem, *blocker)).collect();
    if names.is_empty() { "nothing in particular".to_owned() } else { names.join("; ") }
}
