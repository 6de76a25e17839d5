//! Pose and twist in, wrench out: the tube for the translation, the attitude law for the turn, one belief for both.

use super::believed_body::{BelievedBody, sound_reference, sound_state};
use super::{
    Adoption, AttitudeController, ControlCommand, ControlRequest, Controller, TrackedMotion, TranslationTube,
    TubeCounts, TubeObstacles, TubeSettings,
};
use crate::belief::ModelBelief;
use crate::error::PlanningError;
use nalgebra::{Vector2, Vector3};
use tumble_dynamics::{InertialParameters, RigidBodyState};
use tumble_lie::Wrench;

/// Share of a step by which a decision may come early.
const EARLY: f64 = 1e-6;

/// Robust tube MPC for the translation, an attitude law for the turn.
///
/// Decides on the force every step of the gain and holds it in the axes of the tube; turns it with the body, and computes the torque,
/// at every call. The guarantee asks for decisions in equal steps: let the step be a multiple of the time between calls.
#[derive(Clone, Debug)]
pub struct TubeController {
    tube: TranslationTube,
    attitude: AttitudeController,
    current: BelievedBody,
    offered: Option<BelievedBody>,
    decided_s: Option<f64>,
    motion: TrackedMotion,
    next: TrackedMotion,
}

impl TubeController {
    /// Before the first belief: `prior` is what is fed forward until then.
    ///
    /// # Errors
    /// Those of [`TranslationTube::try_new`]; a body that cannot be.
    pub fn try_new(
        settings: TubeSettings,
        obstacles: Option<TubeObstacles>,
        attitude: AttitudeController,
        prior: &InertialParameters<f64>,
    ) -> Result<Self, PlanningError> {
        Ok(Self {
            tube: TranslationTube::try_new(settings, obstacles, prior)?,
            attitude,
            current: BelievedBody::nominal(prior)?,
            offered: None,
            decided_s: None,
            motion: TrackedMotion::default(),
            next: TrackedMotion::default(),
        })
    }

    /// The tube.
    pub fn tube(&self) -> &TranslationTube {
        &self.tube
    }

    /// How often what happened.
    pub fn counts(&self) -> TubeCounts {
        self.tube.counts()
    }

    fn is_due(&self, time_s: f64) -> bool {
        let step_s = self.tube.settings().gain.step_s;
        // a clock that was set back begins anew
        self.decided_s.is_none_or(|last| time_s - last >= step_s * (1.0 - EARLY) || time_s < last - step_s)
    }

    fn decide(&mut self, request: &ControlRequest<'_>) -> Option<super::Fallback> {
        let settings = *self.tube.settings();
        let step_s = settings.gain.step_s;
        let view = View { settings: &settings, request };
        view.fill(&self.current, &mut self.motion);
        // where no belief waits, the widest tube may, of the body in use
        view.fill(self.offered.as_ref().unwrap_or(&self.current), &mut self.next);
        let (was_braking, adopted) = (self.tube.is_braking(), self.tube.counts().adopted);
        let fallback = self.tube.decide(&self.motion, &self.next);
        if self.tube.counts().adopted > adopted {
            self.current = self.offered.take().unwrap_or(self.current);
        } else if self.tube.is_braking() && !was_braking {
            // the tube waits for nothing but its widest self now
            self.offered = None;
        }
        // a decision a little late does not shift those to come
        let on_time = self.decided_s.map(|last| last + step_s).filter(|due| (request.time_s - due).abs() < step_s);
        self.decided_s = Some(on_time.unwrap_or(request.time_s));
        fallback
    }
}

/// How a body's motion looks from the axes of the tube.
struct View<'a> {
    settings: &'a TubeSettings,
    request: &'a ControlRequest<'a>,
}

impl View<'_> {
    fn fill(&self, believed: &BelievedBody, motion: &mut TrackedMotion) {
        let center_body = self.settings.point.of(believed.body.parameters());
        motion.start_s = self.request.time_s;
        motion.attitudes.clear();
        motion.states = self.tracked(self.request.state, &center_body);
        for reference in &mut motion.references {
            reference.clear();
        }
        for node in 0..=self.settings.steps {
            let time_s = self.request.time_s + node as f64 * self.settings.gain.step_s;
            let wanted = self.request.plan.trajectory.at(time_s);
            motion.attitudes.push(wanted.state.world_from_body.rotation);
            for (to, from) in motion.references.iter_mut().zip(self.tracked(&wanted.state, &center_body)) {
                to.push(from);
            }
        }
    }

    /// Position and velocity of a point of the body on each axis.
    fn tracked(&self, state: &RigidBodyState<f64>, point_body: &Vector3<f64>) -> [Vector2<f64>; 3] {
        let pose = &state.world_from_body;
        let axes_from_world = self.settings.world_from_axes.inverse();
        let velocity_body = state.twist_body.linear + state.twist_body.angular.cross(point_body);
        let position = axes_from_world * (pose.translation.vector + pose.rotation * point_body);
        let velocity = axes_from_world * (pose.rotation * velocity_body);
        core::array::from_fn(|i| Vector2::new(position[i], velocity[i]))
    }
}

impl Controller for TubeController {
    fn tube_m(&self) -> [f64; 3] {
        core::array::from_fn(|axis| self.tube.position_half_width_m(axis))
    }

    /// That of the interval of the mass in use; in turned axes the box of world axes within theirs.
    fn acceleration_m_s2(&self) -> [f64; 3] {
        let left = Vector3::from_fn(|axis, _| self.tube.problem(axis).acceleration_m_s2);
        let turned = self.tube.settings().world_from_axes.to_rotation_matrix().into_inner().abs();
        let seen = turned * left;
        let share = left.component_div(&(turned.transpose() * seen)).min();
        (seen * share).into()
    }

    fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        let body = self.offered.as_ref().unwrap_or(&self.current).after(belief)?;
        let adoption = self.tube.offer(belief)?;
        match adoption {
            Adoption::Adopted => self.current = body,
            Adoption::Postponed { .. } => self.offered = Some(body),
            Adoption::Contradicts { .. } => {}
        }
        Ok(adoption)
    }

    fn command(&mut self, request: &ControlRequest<'_>) -> Result<ControlCommand, PlanningError> {
        sound_state(request)?;
        let wanted = sound_reference(request.plan, request.time_s)?;
        let fallback = if self.is_due(request.time_s) { self.decide(request) } else { None };
        let settings = self.tube.settings();
        let world_from_body = request.state.world_from_body.rotation;
        let force = world_from_body.inverse() * (settings.world_from_axes * self.tube.force_axes());
        // inside the span of attitudes this takes nothing away
        let share = force.abs().component_div(&settings.force_limit_n).max();
        let force = if share > 1.0 { force / share } else { force };
        let attitude = AttitudeController { body: *self.current.body.parameters(), ..self.attitude };
        let torque = attitude.torque_body(request.state, &wanted, &force).torque_n_m;
        Ok(ControlCommand {
            wrench_body: Wrench::new(torque, force),
            model_revision: self.current.revision,
            fallback,
            mass: Some(self.tube.mass()),
        })
    }
}
