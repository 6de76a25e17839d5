//! What is flown: a plan, then the stop after it, then rest.

mod arcs;
mod contact;
mod held;
#[cfg(test)]
mod tests;

pub use arcs::StopLimits;

use crate::control::ReferenceMotion;
use crate::local::{Kinematics, LocalTrajectory, PlanarState};
use crate::motion::ArcPath;
use held::HeldInputs;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_dynamics::{InertialParameters, PoseReference, RigidBodyState};
use tumble_lie::{LieGroup, Pose, Wrench};

/// Most points for drawing.
const MOST_POINTS: f64 = 100_000.0;

/// What was planned.
#[derive(Clone, Debug)]
enum Planned {
    Nothing,
    Held(Box<HeldInputs>),
    Arcs(ArcPath),
}

/// A motion over all times: rest before its start, what was planned, the stop after it, rest.
///
/// Pose, twist and acceleration are continuous and those of one motion at every time, with these exceptions: the acceleration
/// jumps where an input, an arc or the stop begins; twists jump where a plan begins in motion, and where one that ends in
/// motion has no stop. At such a time, that of the plan counts. A time that is no number is one of rest after the end.
#[derive(Clone, Debug)]
pub struct MissionMotion {
    start_s: f64,
    end_s: f64,
    rest_s: f64,
    before: Pose<f64>,
    planned: Planned,
    /// From the end of what was planned.
    stop: ArcPath,
    after: Pose<f64>,
}

impl MissionMotion {
    /// Rest at a pose.
    pub fn resting(world_from_body: Pose<f64>, from_s: f64) -> Self {
        Self {
            start_s: from_s,
            end_s: from_s,
            rest_s: from_s,
            before: world_from_body,
            planned: Planned::Nothing,
            stop: ArcPath::default(),
            after: world_from_body,
        }
    }

    /// What the inputs of a plan, each held for its step, make of its start and of the believed body; no stop after it yet.
    ///
    /// The inputs are flown in pieces of a tenth of a second or less, each one step of [`tumble_dynamics::MuntheKaas4`], and at a
    /// time within a piece a shorter step. So there are no seams at the nodes; from the plan's own states, which are its
    /// longer steps, the motion differs by their error, which is of fourth order: some micrometres at the end of a dozen
    /// seconds. A plan without states is rest at the origin.
    pub fn planned<const P: usize>(plan: &LocalTrajectory<Kinematics, 6, P>, body: &InertialParameters<f64>) -> Self {
        let start = plan.states.first().copied().unwrap_or_else(|| Kinematics::at_rest(Pose::identity()));
        let inputs = plan
            .inputs
            .iter()
            .map(|[t0, t1, t2, f0, f1, f2]| Wrench::new(Vector3::new(*t0, *t1, *t2), Vector3::new(*f0, *f1, *f2)));
        Self::held(HeldInputs::new((&start).into(), inputs, plan.step_s, body), &start.world_from_body, plan.start_s)
    }

    /// The same in the plane of this height, about axes along world z. What of the body would tip it, the table bears.
    pub fn planned_in_plane<const P: usize>(
        plan: &LocalTrajectory<PlanarState, 3, P>,
        height_m: f64,
        body: &InertialParameters<f64>,
    ) -> Self {
        let start = plan.states.first().map_or_else(
            || Kinematics::at_rest(Pose::identity()),
            |start| Kinematics {
                world_from_body: Pose::from_parts(
                    start.position_world.push(height_m).into(),
                    <UnitQuaternion<f64> as LieGroup>::exp(&Vector3::new(0.0, 0.0, start.heading_rad)),
                ),
                velocity_world: start.velocity_world.push(0.0),
                rate_body: Vector3::new(0.0, 0.0, start.rate_rad_s),
            },
        );
        let inputs = plan
            .inputs
            .iter()
            .map(|[torque, fx, fy]| Wrench::new(Vector3::new(0.0, 0.0, *torque), Vector3::new(*fx, *fy, 0.0)));
        // a body without anything that tips it moves in the plane as this one does
        let (com, inertia) = (body.center_of_mass(), body.inertia_about_com().m33);
        let flat = InertialParameters::about_com(
            body.mass,
            Vector3::new(com.x, com.y, 0.0),
            Matrix3::from_diagonal_element(inertia),
        );
        Self::held(HeldInputs::new((&start).into(), inputs, plan.step_s, &flat), &start.world_from_body, plan.start_s)
    }

    fn held(held: HeldInputs, before: &Pose<f64>, start_s: f64) -> Self {
        let end_s = start_s + held.duration_s();
        let after = held.end().world_from_body;
        let planned = Planned::Held(Box::new(held));
        Self { end_s, rest_s: end_s, after, planned, ..Self::resting(*before, start_s) }
    }

    /// A part of a way that begins at the mission time `way_start_s`, flown as it is between two mission times, as far as it
    /// lies between them; no stop after it yet. A way without arcs is rest at the origin.
    pub fn along(way: &ArcPath, way_start_s: f64, from_s: f64, until_s: f64) -> Self {
        let begin_s = (from_s - way_start_s).clamp(0.0, way.duration_s());
        let path = arcs::between(way, begin_s, until_s - way_start_s);
        let pose_at = |since_s| way.at(since_s).map_or_else(Pose::identity, |(arc, within_s)| arc.pose(within_s));
        let start_s = f64::max(from_s, way_start_s);
        let end_s = start_s + path.duration_s();
        let after = pose_at(begin_s + path.duration_s());
        let planned = if path.arcs().is_empty() { Planned::Nothing } else { Planned::Arcs(path) };
        Self { end_s, rest_s: end_s, after, planned, ..Self::resting(pose_at(begin_s), start_s) }
    }

    /// A stop from a state, at once.
    pub fn stopping_from(state: &RigidBodyState<f64>, from_s: f64, limits: &StopLimits) -> Self {
        Self::resting(state.world_from_body, from_s).stopped_from(state, limits)
    }

    /// The same with a stop after what was planned, none where that ends at rest: a constant deceleration along the velocity of
    /// the body origin, and of the rate about its axis. Limits that are not positive make none.
    ///
    /// It is a motion of the origin. That of a body whose centre of mass is elsewhere also needs a force that holds the centre of
    /// mass on its circle as long as the body turns, and the torque of that force: the controller gives it, the limits must leave
    /// room for it.
    #[must_use]
    pub fn with_stop(self, limits: &StopLimits) -> Self {
        let end = match &self.planned {
            Planned::Nothing => return self,
            Planned::Held(held) => *held.end(),
            Planned::Arcs(path) => match path.arcs().last() {
                Some(last) => arcs::reference(last, last.duration_s).state,
                None => return self,
            },
        };
        self.stopped_from(&end, limits)
    }

    fn stopped_from(self, state: &RigidBodyState<f64>, limits: &StopLimits) -> Self {
        let stop = arcs::stop(state, limits);
        let after = stop.arcs().last().map_or(state.world_from_body, |last| last.pose(last.duration_s));
        Self { rest_s: self.end_s + stop.duration_s(), stop, after, ..self }
    }

    /// When it begins, s.
    pub fn start_s(&self) -> f64 {
        self.start_s
    }

    /// When what was planned ends, and the stop begins, s.
    pub fn end_s(&self) -> f64 {
        self.end_s
    }

    /// When it comes to rest, s.
    pub fn rest_s(&self) -> f64 {
        self.rest_s
    }

    /// Where it rests in the end.
    pub fn resting_pose(&self) -> &Pose<f64> {
        &self.after
    }

    /// State at a mission time.
    pub fn state_at(&self, time_s: f64) -> RigidBodyState<f64> {
        self.at(time_s).state
    }

    /// Positions of the origin from its start to its rest, each a step after the last one, and the last one at rest; world axes,
    /// m. For drawing: of too many, fewer.
    pub fn points(&self, step_s: f64) -> Vec<Vector3<f64>> {
        let length_s = self.rest_s - self.start_s;
        let count = libm::ceil(length_s / step_s);
        let count = if count >= 0.0 { count.min(MOST_POINTS) } else { 1.0 };
        let step_s = if count * step_s >= length_s { step_s } else { length_s / count };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and the most points")]
        let whole = count as u32;
        let mut points: Vec<_> = (0..whole)
            .map(|k| self.at(self.start_s + f64::from(k) * step_s).state.world_from_body.translation.vector)
            .collect();
        points.push(self.after.translation.vector);
        points
    }
}

impl ReferenceMotion for MissionMotion {
    fn at(&self, time_s: f64) -> PoseReference {
        if time_s < self.start_s {
            return arcs::at_rest(self.before);
        }
        let moving = if time_s <= self.end_s {
            let within_s = time_s - self.start_s;
            match &self.planned {
                Planned::Nothing => None,
                Planned::Held(held) => held.at(within_s),
                Planned::Arcs(path) => path.at(within_s).map(|(arc, within_s)| arcs::reference(arc, within_s)),
            }
        } else {
            None
        };
        moving.or_else(|| self.stopping(time_s)).unwrap_or_else(|| arcs::at_rest(self.after))
    }
}

impl MissionMotion {
    /// What the stop is at a time; none where it is over.
    fn stopping(&self, time_s: f64) -> Option<PoseReference> {
        let is_stopping = time_s >= self.end_s && time_s < self.rest_s;
        let (arc, within_s) = if is_stopping { self.stop.at(time_s - self.end_s)? } else { return None };
        Some(arcs::reference(arc, within_s))
    }
}
