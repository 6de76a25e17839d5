//! Predictive control of a body known exactly: the baseline with limits in its mind, and without a tube.

use super::believed_body::{sound_reference, translation};
use super::cascade::{Cascade, TranslationDecision, TranslationLaw, TranslationRequest};
use super::feedback::{TranslationWeights, axis_lqr, axis_model};
use super::{AttitudeController, Fallback, FallbackReason, GramProgram, GramSettings, GramStatus, GramWorkspace};
use crate::error::PlanningError;
use nalgebra::{Matrix2, Vector2, Vector3};

/// Most steps of a prediction.
const MOST_STEPS: usize = 1000;

/// How far a [`LinearMpc`] looks, and what errors weigh in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearMpcSettings {
    /// Time between decisions and between the nodes of a prediction, s.
    pub step_s: f64,
    /// Steps of a prediction.
    pub steps: usize,
    /// Of errors from the reference; what comes after the last step weighs what [`LinearFeedback`](super::LinearFeedback) would pay.
    pub weights: TranslationWeights,
}

impl Default for LinearMpcSettings {
    fn default() -> Self {
        Self { step_s: 0.2, steps: 25, weights: TranslationWeights::default() }
    }
}

/// One axis of a prediction, and what errors of position and velocity cost in it.
#[derive(Clone, Copy, Debug)]
struct AxisCost {
    motion: Matrix2<f64>,
    input: Vector2<f64>,
    node: Matrix2<f64>,
    last: Matrix2<f64>,
}

impl AxisCost {
    /// Slope along the acceleration in each step of half the weighed squares of these errors at the nodes.
    fn slope(&self, errors: &[Vector2<f64>], slope: &mut [f64]) {
        let mut pull = Vector2::zeros();
        let mut weight = &self.last;
        // from the end: what all later nodes pull
        for (slope, error) in slope.iter_mut().rev().zip(errors.iter().rev()) {
            pull = self.motion.transpose() * pull + weight * error;
            *slope = self.input.dot(&pull);
            weight = &self.node;
        }
    }
}

/// Least cost of the errors over the next steps, the force inside its limits: a quadratic program along each body axis.
///
/// Plans along the body axes as they are at the decision, where the limits are those of each axis alone.
#[derive(Clone, Debug)]
pub struct LinearMpc {
    settings: LinearMpcSettings,
    cost: AxisCost,
    program: GramProgram,
    axes: [AxisPlan; 3],
    /// The last prediction begins here with its second step, world axes, m/s^2.
    next_world: Vector3<f64>,
    /// The activity of a step belongs to the one before it at the next decision.
    earlier: Vec<Option<usize>>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

/// The prediction of one axis.
#[derive(Clone, Debug)]
struct AxisPlan {
    workspace: GramWorkspace,
    /// Error at each node if nothing were done.
    free_errors: Vec<Vector2<f64>>,
    /// Mean acceleration of the reference in each step, m/s^2.
    wanted: Vec<f64>,
    linear: Vec<f64>,
}

impl LinearMpc {
    /// With these settings.
    ///
    /// # Errors
    /// A step or a weight that is not positive; no steps, or more than a thousand.
    pub fn try_new(settings: &LinearMpcSettings) -> Result<Self, PlanningError> {
        let LinearMpcSettings { step_s, steps, weights } = *settings;
        if !(1..=MOST_STEPS).contains(&steps) {
            let (what, value, upper) = ("the steps of a prediction", steps as f64, MOST_STEPS as f64);
            return Err(PlanningError::OutOfRange { what, value, lower: 1.0, upper });
        }
        let (_, last) = axis_lqr(step_s, &weights)?;
        let (motion, input) = axis_model(step_s);
        let node = Matrix2::from_diagonal(&Vector2::new(weights.position, weights.velocity));
        let cost = AxisCost { motion, input, node, last };
        let at_rest = vec![Vector2::zeros(); steps + 1];
        let mut hessian = vec![0.0; steps * steps];
        let mut rows = vec![0.0; steps * steps];
        for (step, (column, row)) in hessian.chunks_exact_mut(steps).zip(rows.chunks_exact_mut(steps)).enumerate() {
            // errors at the nodes that an acceleration in this step alone leaves
            let mut errors = at_rest.clone();
            let mut reached = input;
            for error in errors.iter_mut().skip(step + 1) {
                *error = reached;
                reached = motion * reached;
            }
            cost.slope(&errors, column);
            if let (Some(curvature), Some(entry)) = (column.get_mut(step), row.get_mut(step)) {
                *curvature += weights.acceleration;
                *entry = 1.0;
            }
        }
        let program = GramProgram::try_new(&hessian, &rows, &vec![false; steps])?;
        let axis = AxisPlan {
            workspace: GramWorkspace::new(&program),
            free_errors: at_rest,
            wanted: vec![0.0; steps],
            linear: vec![0.0; steps],
        };
        Ok(Self {
            settings: *settings,
            cost,
            axes: [axis.clone(), axis.clone(), axis],
            next_world: Vector3::zeros(),
            earlier: (0..steps).map(|step| step.checked_sub(1)).collect(),
            lower: vec![0.0; steps],
            upper: vec![0.0; steps],
            program,
        })
    }

    /// The errors and accelerations of the next steps if nothing were done.
    fn look_ahead(&mut self, request: &TranslationRequest<'_>) -> Result<(), PlanningError> {
        let TranslationRequest { time_s, plan, attitude, state, .. } = request;
        let body_from_world = attitude.inverse();
        let step_s = self.settings.step_s;
        let velocity = body_from_world * state.velocity;
        let mut before: Option<Vector3<f64>> = None;
        for node in 0..=self.settings.steps {
            let after_s = node as f64 * step_s;
            let reference = translation(&sound_reference(plan, time_s + after_s)?.state);
            let position = body_from_world * (reference.position - state.position) - velocity * after_s;
            let wanted = body_from_world * reference.velocity;
            for (axis, plan) in self.axes.iter_mut().enumerate() {
                if let Some(error) = plan.free_errors.get_mut(node) {
                    *error = Vector2::new(-position[axis], velocity[axis] - wanted[axis]);
                }
                if let (Some(before), Some(step)) = (&before, node.checked_sub(1))
                    && let Some(acceleration) = plan.wanted.get_mut(step)
                {
                    *acceleration = (wanted[axis] - before[axis]) / step_s;
                }
            }
            before = Some(wanted);
        }
        Ok(())
    }
}

impl TranslationLaw for LinearMpc {
    fn step_s(&self) -> f64 {
        self.settings.step_s
    }

    fn decide(&mut self, request: &TranslationRequest<'_>) -> Result<TranslationDecision, PlanningError> {
        self.look_ahead(request)?;
        let mass_kg = request.body.parameters().mass;
        let (mut now, mut next) = (Vector3::zeros(), Vector3::zeros());
        let mut reason = None;
        for (axis, plan) in self.axes.iter_mut().enumerate() {
            let AxisPlan { workspace, free_errors, wanted, linear } = plan;
            self.cost.slope(free_errors, linear);
            for (slope, wanted) in linear.iter_mut().zip(wanted) {
                *slope -= self.settings.weights.acceleration * *wanted;
            }
            let most = request.force_limit[axis] / mass_kg;
            self.lower.fill(-most);
            self.upper.fill(most);
            workspace.shift(&self.earlier);
            let status = self.program.solve(linear, &self.lower, &self.upper, &GramSettings::default(), workspace);
            match status {
                GramStatus::Solved => {}
                GramStatus::Capped => reason = Some(FallbackReason::IterationCap),
                GramStatus::Infeasible | GramStatus::Numerical => reason = Some(FallbackReason::Numerical),
            }
            if status != GramStatus::Solved {
                workspace.forget();
                continue;
            }
            let mut inputs = workspace.solution().iter();
            now[axis] = inputs.next().copied().unwrap_or(0.0);
            next[axis] = inputs.next().copied().unwrap_or(0.0);
        }
        let acceleration = if reason.is_none() { request.attitude * now } else { self.next_world };
        self.next_world = if reason.is_none() { request.attitude * next } else { Vector3::zeros() };
        Ok(TranslationDecision { force_world: acceleration * mass_kg, fallback: reason.map(Fallback::Shifted) })
    }
}

/// The predictive baseline: [`LinearMpc`] around the attitude's law.
pub type PlainMpcController = Cascade<LinearMpc>;

impl PlainMpcController {
    /// With these settings and at most this force along each body axis (N), around this law of the attitude.
    ///
    /// # Errors
    /// A body that cannot be, a weight, step or limit that is not positive, a gain that is negative.
    pub fn plain_mpc(
        settings: &LinearMpcSettings,
        attitude: AttitudeController,
        force_limit: Vector3<f64>,
    ) -> Result<Self, PlanningError> {
        Self::try_new(LinearMpc::try_new(settings)?, attitude, force_limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::Plan;
    use crate::control::{LinearFeedback, ReferenceMotion};
    use crate::motion::TranslationState;
    use nalgebra::{Matrix3, UnitQuaternion};
    use tumble_dynamics::{BodyAcceleration, FreeFlyer, InertialParameters, PoseReference, RigidBodyState};
    use tumble_lie::{Pose, Twist};

    /// Along a parabola, so that the mean acceleration of a step is the acceleration.
    fn parabola(time_s: f64) -> PoseReference {
        let acceleration = Vector3::new(0.004, -0.002, 0.001);
        let (velocity, position) = (acceleration * time_s, acceleration * (0.5 * time_s * time_s));
        let pose = Pose::from_parts(position.into(), UnitQuaternion::identity());
        PoseReference {
            state: RigidBodyState { world_from_body: pose, twist_body: Twist::new(Vector3::zeros(), velocity) },
            acceleration: BodyAcceleration {
                angular_acceleration_body: Vector3::zeros(),
                acceleration_origin_body: acceleration,
            },
        }
    }

    fn decide(law: &mut dyn TranslationLaw, state: TranslationState, force_limit: f64) -> Vector3<f64> {
        let trajectory: &dyn ReferenceMotion = &parabola;
        let body = InertialParameters::about_origin(8.0, Vector3::zeros(), Matrix3::identity());
        let decision = law.decide(&TranslationRequest {
            time_s: 3.0,
            state,
            attitude: UnitQuaternion::new(Vector3::new(0.4, -0.7, 1.1)),
            plan: &Plan { trajectory, model_revision: 0 },
            body: &FreeFlyer::new(body),
            force_limit: Vector3::repeat(force_limit),
        });
        let decision = decision.unwrap();
        assert_eq!(decision.fallback, None);
        decision.force_world
    }

    #[test]
    fn without_limits_it_is_the_linear_feedback() {
        let weights = TranslationWeights::default();
        let state =
            TranslationState { position: Vector3::new(0.3, -0.2, 0.1), velocity: Vector3::new(-0.05, 0.02, 0.04) };
        let settings = LinearMpcSettings { steps: 7, ..LinearMpcSettings::default() };
        let predicted = decide(&mut LinearMpc::try_new(&settings).unwrap(), state, 1e3);
        let fed_back = decide(&mut LinearFeedback::try_new(0.2, &weights).unwrap(), state, 1e3);
        assert!((predicted - fed_back).amax() < 1e-10 && fed_back.amax() > 0.1, "{predicted} {fed_back}");
    }

    #[test]
    fn no_other_inputs_inside_the_limits_cost_less() {
        let settings = LinearMpcSettings::default();
        let mut law = LinearMpc::try_new(&settings).unwrap();
        let state =
            TranslationState { position: Vector3::new(0.9, -0.2, 0.1), velocity: Vector3::new(0.05, 0.02, 0.04) };
        let limit = 0.12;
        decide(&mut law, state, limit);
        let most = limit / 8.0;
        for plan in &law.axes {
            // flown anew, step by step, by the definition of the cost
            let cost = |inputs: &[f64]| {
                let (mut added, mut sum) = (Vector2::zeros(), 0.0);
                for (step, input) in inputs.iter().enumerate() {
                    let missed = input - plan.wanted[step];
                    sum += settings.weights.acceleration * missed * missed;
                    added = Vector2::new(added.x + 0.2 * added.y + 0.02 * input, added.y + 0.2 * input);
                    let error: Vector2<f64> = plan.free_errors[step + 1] + added;
                    let is_last = step + 1 == inputs.len();
                    sum +=
                        if is_last { error.dot(&(law.cost.last * error)) } else { error.dot(&(law.cost.node * error)) };
                }
                sum
            };
            let best = plan.workspace.solution().to_vec();
            let least = cost(&best);
            for step in 0..best.len() {
                for change in [1e-4, -1e-4] {
                    let mut other = best.clone();
                    other[step] = (other[step] + change).clamp(-most, most);
                    assert!(cost(&other) >= least * (1.0 - 1e-12), "{step} {change}");
                }
            }
            assert!(best.iter().all(|input| input.abs() <= most * (1.0 + 1e-9)));
        }
        assert!(law.axes.iter().any(|plan| plan.workspace.solution().iter().any(|input| input.abs() > 0.999 * most)));
    }

    #[test]
    fn settings_that_cannot_be_are_refused() {
        let settings = LinearMpcSettings::default();
        assert!(LinearMpc::try_new(&LinearMpcSettings { steps: 0, ..settings }).is_err());
        assert!(LinearMpc::try_new(&LinearMpcSettings { steps: usize::MAX, ..settings }).is_err());
        for step_s in [0.0, -0.2, f64::NAN, f64::INFINITY] {
            assert!(LinearMpc::try_new(&LinearMpcSettings { step_s, ..settings }).is_err(), "{step_s}");
        }
        for value in [0.0, -1.0, f64::NAN] {
            let weights = TranslationWeights { position: value, ..settings.weights };
            assert!(LinearMpc::try_new(&LinearMpcSettings { weights, ..settings }).is_err(), "{value}");
        }
    }
}
