//! A world of balls for a ball: small enough to be right at a glance.

use tumble_planning::collision::{Blocker, Clearance, CollisionWorld, Contact};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::Vector3;
use tumble_planning::{BodyArc, PlanningError};

/// Balls: centre and radius, m.
#[derive(Clone, Debug, Default)]
pub struct RoundWorld {
    pub balls: Vec<(Vector3<f64>, f64)>,
}

impl CollisionWorld for RoundWorld {
    /// Radius of the body, m.
    type Body = f64;

    fn clearance(&self, body: &f64, world_from_body: &Pose<f64>, _time_s: f64) -> Result<Clearance, PlanningError> {
        let at = world_from_body.translation.vector;
        let mut nearest = Clearance { distance_m: f64::INFINITY, nearest: None };
        for (index, (center, radius)) in self.balls.iter().enumerate() {
            let distance_m = (at - center).norm() - radius - body;
            if distance_m < nearest.distance_m {
                nearest = Clearance { distance_m, nearest: Some(Blocker::Obstacle(index)) };
            }
        }
        Ok(nearest)
    }

    /// Steps that the fastest motion could not cross what is left with; a micrometre counts as contact.
    fn first_contact(
        &self,
        body: &f64,
        arc: &BodyArc,
        start_s: f64,
        margin_m: f64,
    ) -> Result<Option<Contact>, PlanningError> {
        let fastest = |time_s: f64| {
            let (state, acceleration) = arc.translation(time_s);
            // of constant accelerations
            state.velocity.norm() + acceleration.norm() * arc.duration_s
        };
        let speed_m_s = fastest(0.0) + 1e-9;
        let mut time_s = 0.0;
        loop {
            let clearance = self.clearance(body, &arc.pose(time_s), start_s + time_s)?;
            let room_m = clearance.distance_m - margin_m;
            match clearance.nearest {
                Some(blocker) if room_m < 1e-6 => return Ok(Some(Contact { time_s, blocker })),
                _ if time_s >= arc.duration_s => return Ok(None),
                _ => time_s = (time_s + room_m / speed_m_s).min(arc.duration_s),
            }
        }
    }

    fn reach_m(&self, body: &f64) -> f64 {
        *body
    }
}
