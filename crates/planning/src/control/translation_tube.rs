//! Three axes, one belief: which plan is flown, which revision it stands on, and what happens where there is none.

use super::force_box::across;
use super::tracked_motion::TrackedMotion;
use super::tube_axes::{TubeAxes, TubeObstacles};
use super::{
    Adoption, AttitudeCertificate, AttitudeSpan, AxisGain, AxisLimits, AxisPlan, AxisProblem, AxisRequest,
    AxisTemplate, Corrections, Fallback, FallbackReason, GramStatus, MassInterval, ReferenceTurning, SymmetricBox,
    Terminal, TubeDisturbance, TubeWeights,
};
use crate::belief::ModelBelief;
use crate::error::{self, PlanningError, not_negative, positive};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use tumble_dynamics::InertialParameters;

/// What a tube is built for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TubeSettings {
    /// Feedback around the nominal motion, and the time between decisions.
    pub gain: AxisGain,
    /// Decisions planned.
    pub steps: usize,
    /// What is judged.
    pub weights: TubeWeights,
    /// Where plans may end.
    pub terminal: Terminal,
    /// Largest speed along each axis, m/s.
    pub speed_m_s: f64,
    /// Least and largest position of the tracked point on each axis, m; infinite where there is no wall.
    pub walls_m: [[f64; 2]; 3],
    /// Largest force along each body axis, N.
    pub force_limit_n: Vector3<f64>,
    /// Attitudes at which forces are asked for.
    pub attitudes: AttitudeSpan,
    /// Error of the attitude by which forces are turned into body axes, rad: of the measurement, and what the body turns until
    /// the next time.
    pub turned_by_rad: f64,
    /// What else disturbs.
    pub disturbance: TubeDisturbance,
    /// What the loop sees of an estimator's errors: where it is given, the errors of measurement are kept off walls and limits only.
    pub corrections: Option<Corrections>,
    /// Where the mass certainly is.
    pub mass: MassInterval,
    /// How many standard deviations of `1 / m` are certain.
    pub sigmas: f64,
    /// The axes.
    pub world_from_axes: UnitQuaternion<f64>,
    /// What is kept on its way.
    pub point: TrackedPoint,
}

/// Which point of the body is kept on its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum TrackedPoint {
    /// The body origin: right as long as nothing is known of the centre of mass.
    Origin,
    /// The centre of mass of the belief in use.
    BelievedCenterOfMass,
}

impl TrackedPoint {
    /// From the body origin, body axes, m.
    pub fn of(self, body: &InertialParameters<f64>) -> Vector3<f64> {
        match self {
            Self::Origin => Vector3::zeros(),
            Self::BelievedCenterOfMass => body.center_of_mass(),
        }
    }
}

impl TubeSettings {
    /// A tube for a mass in an interval, thrusters that push by so much along each body axis, and any attitude, in world axes, without
    /// walls: decisions every 0.2 s, twenty-five of them planned, three standard deviations of `1 / m` taken for certain.
    ///
    /// What disturbs, 0.3 mm, 0.15 mm/s and no force, is what a filter leaves of poses that are off by millimetres.
    pub fn new(mass: MassInterval, force_limit_n: Vector3<f64>) -> Self {
        Self {
            gain: AxisGain { stiffness: 0.25, damping: 2.0, step_s: 0.2 },
            steps: 25,
            weights: TubeWeights::DEFAULT,
            terminal: Terminal::StopSet,
            speed_m_s: 0.1,
            walls_m: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
            force_limit_n,
            attitudes: AttitudeSpan::Any,
            turned_by_rad: 0.01,
            disturbance: TubeDisturbance {
                position_m: 3e-4,
                velocity_m_s: 1.5e-4,
                force_n: 0.0,
                acceleration_m_s2: 0.0,
            },
            corrections: None,
            mass,
            sigmas: 3.0,
            world_from_axes: UnitQuaternion::identity(),
            point: TrackedPoint::BelievedCenterOfMass,
        }
    }

    /// The same, with what the error of the attitude does to the translation: forces are asked for at attitudes as far off as the
    /// certificate says, and a centre of mass believed wrongly by at most this is swung about by the turning.
    ///
    /// # Source
    /// The tracked point `p` and the true centre of mass, `offset` apart: `p'' = f / m - a x offset - w x (w x offset)`, with the angular
    /// velocity and acceleration of the reference and of the error.
    #[must_use]
    pub fn with_attitude(
        mut self,
        certificate: &AttitudeCertificate,
        turning: &ReferenceTurning,
        center_of_mass_error_m: f64,
    ) -> Self {
        if let AttitudeSpan::Near { angle_rad, .. } = &mut self.attitudes {
            *angle_rad += certificate.angle_rad;
        }
        let rate = turning.rate_rad_s + certificate.rate_rad_s;
        let swinging = turning.acceleration_rad_s2 + certificate.acceleration_rad_s2 + rate * rate;
        self.disturbance.acceleration_m_s2 += center_of_mass_error_m * swinging;
        self
    }

    /// The same, with no force that the attitude is not certified for: `allowed_n` bounds the norm of every force asked for, as
    /// [`AttitudeLoop::force_allowed_n`](super::AttitudeLoop::force_allowed_n) finds it. Planners are to be given
    /// [`Self::force_limit_n`] then.
    #[must_use]
    pub fn with_force_allowed(mut self, allowed_n: f64) -> Self {
        let share = allowed_n / f64::sqrt(self.force_limit_n.norm_squared());
        if share >= 1.0 {
            return self;
        }
        // no number leaves none, which is refused
        self.force_limit_n *= share;
        self
    }
}

/// How often what happened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TubeCounts {
    /// Decisions taken.
    pub decisions: u64,
    /// Revisions taken over.
    pub adopted: u64,
    /// Decisions at which a revision waiting could not be taken over.
    pub postponed: u64,
    /// Beliefs that contradicted what was certain.
    pub contradictions: u64,
    /// Decisions flown on the last plan, shifted.
    pub shifted: u64,
    /// Decisions that began anew because the state was outside of the tube.
    pub restarted: u64,
    /// Decisions spent braking.
    pub braking: u64,
    /// Decisions at which an obstacle had moved into what the last plan kept free: only then can it leave no plan.
    pub cut: u64,
}

/// The tubes of one revision.
#[derive(Clone, Debug)]
struct Revision {
    number: u64,
    mass: MassInterval,
    tracked_body: Vector3<f64>,
    axes: TubeAxes,
}

/// Where the motion stands.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// Before the first decision.
    Waiting,
    /// A plan is in force.
    Planned,
    /// There is none: braking, and where each axis came to rest.
    Braking([Option<f64>; 3]),
}

/// What revisions are made from.
#[derive(Clone, Debug)]
struct Setup {
    settings: TubeSettings,
    template: AxisTemplate,
    obstacles: Option<TubeObstacles>,
}

/// Share of the speed that full force takes in a step below which an axis counts as at rest.
const SLOW: f64 = 0.5;

/// Robust tube MPC of the translation.
///
/// The nominal motion is planned in accelerations and knows no mass; the mass interval sets the size of the tube around it. A new
/// revision is taken over at the first decision at which a plan exists for it from the measured state, else the old one stays:
/// both are valid, so that the guarantee never lapses.
///
/// # Source
/// Thesis 2.4.2, 6.2.3; there with an additive tube and a fixed mass.
#[derive(Clone, Debug)]
pub struct TranslationTube {
    setup: Setup,
    current: Revision,
    pending: Option<Revision>,
    phase: Phase,
    force_axes: Vector3<f64>,
    counts: TubeCounts,
}

/// Excess over the tube that rounding explains, as a share of its size.
const ROUNDING: f64 = 1e-9;

impl TranslationTube {
    /// A tube for the interval that is certain at the start; `prior` is the body taken for granted until the first belief.
    ///
    /// # Errors
    /// Numbers out of range; [`PlanningError::NotPositive`] for "the acceleration left" where the tube takes all the force there is;
    /// with obstacles, plans that need not end at rest.
    pub fn try_new(
        settings: TubeSettings,
        obstacles: Option<TubeObstacles>,
        prior: &InertialParameters<f64>,
    ) -> Result<Self, PlanningError> {
        for limit in &settings.force_limit_n {
            positive("a limit of the force", *limit)?;
        }
        if let AttitudeSpan::Near { axes_from_body, angle_rad } = &settings.attitudes {
            error::attitude(axes_from_body)?;
            not_negative("the angle of the span", *angle_rad)?;
        }
        error::attitude(&settings.world_from_axes)?;
        positive("the standard deviations taken", settings.sigmas)?;
        let measured = SymmetricBox(settings.disturbance.of_measurement(settings.gain.step_s));
        let template = match &settings.corrections {
            Some(corrections) => AxisTemplate::with_corrections(settings.gain, corrections)?,
            None => AxisTemplate::try_new(settings.gain, &measured)?,
        };
        let setup = Setup { settings, template, obstacles };
        let current = setup.revision(0, settings.mass, settings.point.of(prior))?;
        Ok(Self {
            setup,
            current,
            pending: None,
            phase: Phase::Waiting,
            force_axes: Vector3::zeros(),
            counts: TubeCounts::default(),
        })
    }

    /// What it was built for.
    pub fn settings(&self) -> &TubeSettings {
        &self.setup.settings
    }

    /// Revision in use; zero before the first.
    pub fn model_revision(&self) -> u64 {
        self.current.number
    }

    /// Where the mass is taken to be.
    pub fn mass(&self) -> MassInterval {
        self.current.mass
    }

    /// The program in use on an axis of the tube, 0 to 2.
    pub fn problem(&self, axis: usize) -> &AxisProblem {
        self.current.axes.problem(axis)
    }

    /// The plan in use on an axis of the tube, 0 to 2.
    pub fn plan(&self, axis: usize) -> &AxisPlan {
        self.current.axes.plan(axis)
    }

    /// How far the tracked point may be from the plan along an axis of the tube, 0 to 2, m.
    pub fn position_half_width_m(&self, axis: usize) -> f64 {
        let problem = self.problem(axis);
        self.plan(axis).scale * problem.scaled[2] + problem.held[2]
    }

    /// How often what happened.
    pub fn counts(&self) -> TubeCounts {
        self.counts
    }

    /// Whether there is no plan.
    pub(super) fn is_braking(&self) -> bool {
        matches!(self.phase, Phase::Braking(_))
    }

    /// The force of the last decision, axes of the tube, N; to be held until the next, turned with the body.
    pub fn force_axes(&self) -> Vector3<f64> {
        self.force_axes
    }

    /// Offers a belief. Once a plan is in force it waits for a decision.
    ///
    /// # Errors
    /// A mass or a variance that cannot be.
    pub fn offer(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        let kept = self.current.number;
        // what waits is newer knowledge than what is in use
        let certain = self.pending.as_ref().map_or(self.current.mass, |pending| pending.mass);
        let Some(mass) = MassInterval::believed(belief, self.setup.settings.sigmas, &certain)? else {
            self.counts.contradictions += 1;
            return Ok(Adoption::Contradicts { kept });
        };
        let tracked_body = self.setup.settings.point.of(belief.parameters());
        let next = self.setup.revision(belief.revision, mass, tracked_body)?;
        if self.phase == Phase::Waiting {
            self.current = next;
            self.counts.adopted += 1;
            return Ok(Adoption::Adopted);
        }
        self.pending = Some(next);
        Ok(Adoption::Postponed { kept })
    }

    /// Decides on the force until the next decision. The revision that waits may track another point of the body: `next` is the
    /// motion of that one.
    pub fn decide(&mut self, motion: &TrackedMotion, next: &TrackedMotion) -> Option<Fallback> {
        self.counts.decisions += 1;
        let mut excess = f64::NEG_INFINITY;
        if self.phase == Phase::Planned {
            self.current.axes.advance();
            for (axis, state) in motion.states.iter().enumerate() {
                let plan = self.current.axes.plan(axis);
                excess = excess.max(self.current.axes.problem(axis).outside(&(state - plan.start), plan.scale));
            }
        } else {
            self.current.axes.begin(&motion.states);
        }
        let is_inside = self.phase == Phase::Planned && excess <= ROUNDING;
        let takes_over = self.takes_over(next);
        let motion = if takes_over { next } else { motion };
        let fallback = if takes_over {
            None
        } else {
            let reason = match self.current.axes.solve(motion, None) {
                GramStatus::Solved => None,
                GramStatus::Infeasible => Some(FallbackReason::Infeasible),
                GramStatus::Capped => Some(FallbackReason::IterationCap),
                GramStatus::Numerical if !motion.is_finite() => Some(FallbackReason::NoReference),
                GramStatus::Numerical => Some(FallbackReason::Numerical),
            };
            reason.map(if is_inside { Fallback::Shifted } else { Fallback::Braking })
        };
        let fallback = match fallback {
            None if self.phase == Phase::Planned && !is_inside => {
                Some(Fallback::Restarted(FallbackReason::OutsideTube { excess }))
            }
            other => other,
        };
        self.counts.cut += u64::from(self.phase == Phase::Planned && !takes_over && self.current.axes.cut() > 0);
        if let Some(Fallback::Braking(_)) = fallback {
            self.brake(&motion.states);
        } else {
            self.phase = Phase::Planned;
            let axes = &self.current.axes;
            self.force_axes =
                Vector3::from_fn(|axis, _| axes.problem(axis).force_n(axes.plan(axis), &motion.states[axis]));
        }
        match fallback {
            None => {}
            Some(Fallback::Shifted(_)) => self.counts.shifted += 1,
            Some(Fallback::Restarted(_)) => self.counts.restarted += 1,
            Some(Fallback::Braking(_)) => self.counts.braking += 1,
        }
        fallback
    }

    /// Whether a revision that waits has a plan from here, and so is in use now.
    fn takes_over(&mut self, motion: &TrackedMotion) -> bool {
        let Some(mut pending) = self.pending.take() else { return false };
        pending.axes.begin(&motion.states);
        let guess = (self.phase == Phase::Planned).then_some(&self.current.axes);
        if pending.axes.solve(motion, guess) == GramStatus::Solved {
            self.current = pending;
            self.counts.adopted += 1;
            return true;
        }
        self.counts.postponed += 1;
        self.pending = Some(pending);
        false
    }

    /// Against the velocity with all there is, no mass being turned back by it; each axis holds where it came to rest. What was
    /// believed of the mass is no longer certain.
    fn brake(&mut self, states: &[Vector2<f64>; 3]) {
        let mut hold = if let Phase::Braking(hold) = self.phase {
            hold
        } else {
            // the widest tube is one more revision that waits; it was built once, so it can be built
            let Revision { number, tracked_body, .. } = self.current;
            let prior = self.setup.revision(number, self.setup.settings.mass, tracked_body);
            self.pending = prior.ok().filter(|prior| prior.mass != self.current.mass);
            [None; 3]
        };
        let mass = self.setup.settings.mass;
        for (i, (hold, state)) in hold.iter_mut().zip(states).enumerate() {
            let problem = self.current.axes.problem(i);
            let is_slow = state.y.abs() <= SLOW * problem.step_s * problem.force_n / mass.largest_kg();
            if hold.is_none() && is_slow {
                *hold = Some(state.x);
            }
            let force = match hold {
                Some(place) => problem.center_kg * problem.feedback.dot(&(state - Vector2::new(*place, 0.0))),
                None => -mass.least_kg() * state.y / problem.step_s,
            };
            self.force_axes[i] = force.clamp(-problem.force_n, problem.force_n);
        }
        self.phase = Phase::Braking(hold);
    }
}

impl Setup {
    fn revision(&self, number: u64, mass: MassInterval, tracked_body: Vector3<f64>) -> Result<Revision, PlanningError> {
        let Self { settings, template, obstacles } = self;
        let turned_by = not_negative("the error of the attitude", settings.turned_by_rad)?;
        let force = settings.attitudes.inner_box(&settings.force_limit_n);
        let aside = across(&force) * libm::sin(turned_by.min(core::f64::consts::FRAC_PI_2));
        let problem = |i: usize| {
            AxisProblem::try_new(&AxisRequest {
                template,
                mass,
                limits: AxisLimits { force_n: force[i], speed_m_s: settings.speed_m_s, walls_m: settings.walls_m[i] },
                shortfall: 1.0 - libm::cos(turned_by),
                disturbance: TubeDisturbance {
                    force_n: settings.disturbance.force_n + aside[i],
                    ..settings.disturbance
                },
                weights: settings.weights,
                steps: settings.steps,
                terminal: settings.terminal,
            })
        };
        let problems = [problem(0)?, problem(1)?, problem(2)?];
        let axes = TubeAxes::try_new(problems, obstacles.as_ref(), &tracked_body, settings.world_from_axes)?;
        Ok(Revision { number, mass, tracked_body, axes })
    }
}
