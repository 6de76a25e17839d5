//! Stretches by the informative planner.

use super::beside::most_beside;
use super::expected_loss::ExpectedLoss;
use super::foreseen::{foreseen, information_between};
use super::lasting_errors::{LastingErrors, learnable};
use super::stretch::{StretchAnswer, StretchOutcome, StretchPlanner, StretchRefusal, StretchTask};
use super::stretch_model::StretchModel;
use super::stretch_settings::{Arrival, StretchSettings};
use super::way_nodes::motion_on;
use crate::budget::Budget;
use crate::error::{PlanningError, indefinite, positive};
use crate::local::{
    Array2, Guess, InformationWeighting, InformativePlanner, Kinematics, Knowledge, LocalAnswer, LocalPlanner,
    LocalRequest, LocalStatus, LocalTrajectory, Reference, TerminalRegion, WeightingContext, WrenchSet,
};
use core::f64::consts::TAU;
use nalgebra::{SMatrix, Vector3, Vector6};
use tumble_dynamics::{FreeFlyer, RigidBodyState};
use tumble_lie::{LieGroup, Twist, Wrench};

/// Plans stretches along a way, for any model, weighting and local planner `L`; the informative one unless
/// [another](Self::planned_by) is given.
///
/// Inputs begin as those of the last plan where it went on beyond the start of the new one, and elsewhere as those that follow
/// the way; where no plan is found from there, from nothing.
pub struct InformativeStretch<
    M: StretchModel<X, U, P>,
    const X: usize,
    const U: usize,
    const P: usize,
    L = InformativePlanner<M, X, U, P>,
> {
    planner: L,
    /// Asked what is known.
    model: M,
    weighting: Box<dyn InformationWeighting<P>>,
    expected_loss: Option<ExpectedLoss<P>>,
    arrival: Arrival,
    lasting: LastingErrors,
    /// Largest absolute value of each input.
    limit: [f64; U],
    step_s: f64,
    steps: usize,
    /// Covariance of the quantities that can be learned at first, and the length of the first way, s.
    first: Option<(SMatrix<f64, P, P>, f64)>,
    last: Option<LocalTrajectory<M::State, U, P>>,
    /// Of the last task, all tries together.
    iterations: usize,
}

/// Amplitude of the torques that a search begins with, in limits. Their cosines leave no rate and no angle at the end, and have
/// as many cycles as their axis says, so that the products of inertia are told apart too.
const SWING: f64 = 0.3;

impl<M: StretchModel<X, U, P> + Clone, const X: usize, const U: usize, const P: usize> InformativeStretch<M, X, U, P> {
    /// Stretches for a body like `model`, pushed by what is in `wrench`.
    ///
    /// # Errors
    /// Settings that are none.
    pub fn try_new(
        model: M,
        settings: &StretchSettings,
        wrench: WrenchSet<U>,
        weighting: Box<dyn InformationWeighting<P>>,
    ) -> Result<Self, PlanningError> {
        let Arrival { radius_m, speed_m_s, angle_rad, rate_rad_s } = settings.arrival;
        for limit in [radius_m, speed_m_s, angle_rad, rate_rad_s] {
            positive("a limit of arrival", limit)?;
        }
        let limit = wrench.limit;
        let local = settings.local(&M::GROUPS, &M::IS_TORQUE, wrench)?;
        Ok(Self {
            planner: InformativePlanner::try_new(model.clone(), local)?,
            model,
            weighting,
            expected_loss: None,
            arrival: settings.arrival,
            lasting: LastingErrors { thrusters: settings.thrusters, rate_axes: settings.rate_axes },
            limit,
            step_s: settings.step_s,
            steps: settings.steps,
            first: None,
            last: None,
            iterations: 0,
        })
    }
}

impl<M, const X: usize, const U: usize, const P: usize, L> InformativeStretch<M, X, U, P, L>
where
    M: StretchModel<X, U, P>,
{
    /// The same stretches from a local planner of somebody else; it is asked for inputs over the same steps.
    #[must_use]
    pub fn planned_by<N>(self, planner: N) -> InformativeStretch<M, X, U, P, N>
    where
        N: LocalPlanner<U, P, State = M::State>,
    {
        let Self {
            model,
            weighting,
            expected_loss,
            arrival,
            lasting,
            limit,
            step_s,
            steps,
            first,
            last,
            iterations,
            ..
        } = self;
        InformativeStretch {
            planner,
            model,
            weighting,
            expected_loss,
            arrival,
            lasting,
            limit,
            step_s,
            steps,
            first,
            last,
            iterations,
        }
    }

    /// The same with weights by what uncertainty is expected to cost on the rest of the way, whatever the weighting says.
    #[must_use]
    pub fn weighted_by_loss(self, expected_loss: ExpectedLoss<P>) -> Self {
        Self { expected_loss: Some(expected_loss), ..self }
    }

    /// The last plan there was.
    pub fn last_plan(&self) -> Option<&LocalTrajectory<M::State, U, P>> {
        self.last.as_ref()
    }

    /// The model, with the belief of the last task.
    pub fn model(&self) -> &M {
        &self.model
    }

    /// Iterations for the last task, those of all tries.
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    /// The weights for a task.
    fn weights(&mut self, task: &StretchTask<'_>, covariance: SMatrix<f64, P, P>) -> Result<[f64; P], PlanningError> {
        let (initial, duration_s) = *self.first.get_or_insert((covariance, task.way.duration_s().max(self.step_s)));
        // Where the way is over there is nothing left but to arrive: a quantity that nothing is learned about would hold the robot there.
        if !task.is_informative || task.start_s - task.way_start_s >= task.way.duration_s() {
            return Ok([0.0; P]);
        }
        if let Some(expected_loss) = &self.expected_loss {
            return expected_loss.weights(task, self.step_s * self.steps as f64, self.step_s);
        }
        let context = WeightingContext::try_new(covariance, initial, task.elapsed_s.max(0.0), duration_s)?;
        self.weighting.weights(&context)
    }

    /// How much of each input it takes at most to hold against what else acts along the stretch of the way.
    fn reserved(&self, task: &StretchTask<'_>) -> [f64; U] {
        if task.environment.is_empty() {
            return [0.0; U];
        }
        let flyer = FreeFlyer::new(*task.belief.parameters());
        let by_acceleration = input_by_acceleration(&self.model.acceleration_by_input());
        let on_way = (0..=self.steps).filter_map(|node| {
            let time_s = task.start_s + self.step_s * node as f64;
            motion_on(task.way, time_s - task.way_start_s).map(|(motion, ..)| (time_s, RigidBodyState::from(&motion)))
        });
        let most = most_beside(task.environment, flyer.parameters(), on_way.chain([(task.start_s, task.start)]));
        by_acceleration.map(|row| {
            let pushed = |axis| Wrench::from(Vector6::ith(axis, most.to_vector()[axis]));
            let needed = (0..6).map(|axis| {
                let change = flyer.forward(&Twist::zero(), &pushed(axis));
                let (linear, angular) = (change.acceleration_origin_body, change.angular_acceleration_body);
                let wanted = linear.iter().chain(angular.iter());
                row.iter().zip(wanted).map(|(entry, wanted)| entry * wanted).sum::<f64>().abs()
            });
            needed.sum()
        })
    }

    /// Inputs to begin with, and whether most are of the last plan: its own as far as it goes, then those that follow the way,
    /// with torques that swing where information matters.
    fn inputs(&self, task: &StretchTask<'_>, matters: bool) -> (Vec<[f64; U]>, bool) {
        let by_acceleration = input_by_acceleration(&self.model.acceleration_by_input());
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "not negative; `as` saturates")]
        let ahead = self.last.as_ref().and_then(|last| {
            let ahead = (task.start_s - last.start_s) / self.step_s;
            (ahead >= 0.0).then_some((ahead.round() as usize, &last.inputs))
        });
        let begin_s = task.start_s - task.way_start_s;
        let mut kept = 0;
        let inputs = (0..self.steps).map(|step| {
            if let Some(input) = ahead.and_then(|(ahead, inputs)| inputs.get(ahead.saturating_add(step))) {
                kept += 1;
                return *input;
            }
            let middle_s = begin_s + (step as f64 + 0.5) * self.step_s;
            let wanted = motion_on(task.way, middle_s).map_or([0.0; 6], |(motion, acceleration_world, angular)| {
                let linear = motion.world_from_body.rotation.inverse_transform_vector(&acceleration_world);
                [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
            });
            let mut input =
                by_acceleration.map(|row| row.iter().zip(wanted).map(|(entry, wanted)| entry * wanted).sum::<f64>());
            if matters {
                let share = (step as f64 + 0.5) / self.steps as f64;
                let torques = input.iter_mut().zip(self.limit).zip(M::IS_TORQUE).filter(|(_, is_torque)| *is_torque);
                for (cycles, ((value, limit), _)) in (1_u32..).zip(torques) {
                    *value += SWING * limit * libm::cos(TAU * f64::from(cycles) * share);
                }
            }
            input
        });
        let inputs = inputs.collect();
        (inputs, 2 * kept > self.steps)
    }

    fn answer(
        &mut self,
        task: &StretchTask<'_>,
        goal: &Kinematics,
        (names, weights, lasting): ([&'static str; P], &[f64; P], &[f64; P]),
        answer: LocalAnswer<M::State, U, P>,
    ) -> Result<StretchOutcome, PlanningError> {
        let Some(plan) = answer.plan else {
            let blocker = match answer.status {
                LocalStatus::Infeasible { blocker, .. } => blocker,
                _ => None,
            };
            return Ok(StretchOutcome::Refused(StretchRefusal { violation: answer.violation, blocker }));
        };
        let trajectory = plan.trajectory;
        let (given, expected) = (trajectory.states.len(), self.steps + 1);
        if given != expected {
            return Err(PlanningError::WrongCount { what: "states of a local plan", given, expected });
        }
        let at = |node: usize| {
            let learned = trajectory.sigma(node).unwrap_or([0.0; P]);
            core::array::from_fn::<f64, P, _>(|i| f64::sqrt(learned[i] * learned[i] + lasting[i]))
        };
        let (before, after) = (at(0), at(self.steps));
        let arrival_s = self.arrival_s(&trajectory, goal).filter(|_| self.way_ends(task));
        let motion = self.model.motion(&trajectory, task.belief);
        self.last = Some(trajectory);
        Ok(StretchOutcome::Planned(Box::new(StretchAnswer {
            motion,
            is_last: arrival_s.is_some(),
            arrival_s,
            status: answer.status,
            quantities: names.to_vec(),
            weights: weights.to_vec(),
            sigma: before.into_iter().zip(after).map(|(before, after)| [before, after]).collect(),
        })))
    }

    /// Whether the way ends within the stretch.
    fn way_ends(&self, task: &StretchTask<'_>) -> bool {
        let end_s = task.start_s - task.way_start_s + self.step_s * self.steps as f64;
        task.way.duration_s() <= end_s
    }

    /// Mission time of the node from which on the plan stays where it should arrive; none where it does not end there.
    fn arrival_s(&self, plan: &LocalTrajectory<M::State, U, P>, goal: &Kinematics) -> Option<f64> {
        let has_arrived = |state: &&M::State| self.has_arrived(&self.model.kinematics(state), goal);
        let there = plan.states.iter().rev().take_while(has_arrived).count();
        let first = plan.states.len().checked_sub(there)?;
        (there > 0).then_some(plan.start_s + plan.step_s * first as f64)
    }

    fn has_arrived(&self, end: &Kinematics, goal: &Kinematics) -> bool {
        let Arrival { radius_m, speed_m_s, angle_rad, rate_rad_s } = self.arrival;
        let norm = |vector: Vector3<f64>| f64::sqrt(vector.norm_squared());
        let turn = (goal.world_from_body.rotation.inverse() * end.world_from_body.rotation).log();
        norm(end.position_world() - goal.position_world()) <= radius_m
            && norm(end.velocity_world) <= speed_m_s
            && norm(turn) <= angle_rad
            && norm(end.rate_body) <= rate_rad_s
    }
}

/// The inputs that give a resting body accelerations, or come nearest to it.
fn input_by_acceleration<const U: usize>(by_input: &Array2<6, U>) -> Array2<U, 6> {
    let by_input = SMatrix::<f64, 6, U>::from_fn(|i, j| by_input[i][j]);
    let mut normal = by_input.transpose() * by_input;
    let small = normal.trace() * 1e-12 + f64::MIN_POSITIVE;
    normal += SMatrix::<f64, U, U>::identity() * small;
    let Some(factor) = normal.cholesky() else { return [[0.0; 6]; U] };
    let inputs = factor.solve(&by_input.transpose());
    core::array::from_fn(|input| core::array::from_fn(|row| inputs[(input, row)]))
}

/// Covariance of the quantities.
fn covariance_of<const P: usize>(knowledge: &Knowledge<P>) -> Result<SMatrix<f64, P, P>, PlanningError> {
    let what = "the least eigenvalue of the prior information";
    let factor = knowledge.information.cholesky().ok_or_else(|| indefinite(what, &knowledge.information))?;
    let covariance = knowledge.quantities * factor.inverse() * knowledge.quantities.transpose();
    Ok((covariance + covariance.transpose()) * 0.5)
}

impl<M, const X: usize, const U: usize, const P: usize, L> StretchPlanner for InformativeStretch<M, X, U, P, L>
where
    M: StretchModel<X, U, P>,
    L: LocalPlanner<U, P, State = M::State>,
{
    fn horizon_s(&self) -> f64 {
        self.step_s * self.steps as f64
    }

    fn plan(&mut self, task: &StretchTask<'_>, budget: &mut dyn Budget) -> Result<StretchOutcome, PlanningError> {
        let start = Kinematics::from(&task.start);
        let Some((goal, ..)) = motion_on(task.way, f64::INFINITY) else {
            return Err(PlanningError::WrongCount { what: "arcs of the way", given: 0, expected: 1 });
        };
        let known = covariance_of(&self.model.adopt(task.belief)?)?;
        let pushed_axes = M::IS_TORQUE.iter().filter(|is_torque| !**is_torque).count();
        let learnable = learnable(&self.lasting, task.belief, pushed_axes)?;
        let knowledge = self.model.adopt(&learnable)?;
        let left = covariance_of(&knowledge)?;
        let lasting = core::array::from_fn::<f64, P, _>(|i| f64::max(0.0, known[(i, i)] - left[(i, i)]));
        let on_the_way = self
            .last
            .as_ref()
            .map_or_else(SMatrix::zeros, |last| information_between(last, task.asked_s, task.start_s));
        let learnable = foreseen(&learnable, &knowledge.names, &on_the_way)?;
        let knowledge = self.model.adopt(&learnable)?;
        let left = covariance_of(&knowledge)?;
        let weights = self.weights(task, left)?;
        let begin_s = task.start_s - task.way_start_s;
        let nodes: Vec<_> = (0..=self.steps)
            .filter_map(|node| motion_on(task.way, begin_s + self.step_s * node as f64))
            .map(|(motion, ..)| self.model.state_of(&motion))
            .collect();
        let start = self.model.state_of(&start);
        let region = TerminalRegion {
            position_world: self.model.kinematics(&self.model.state_of(&goal)).position_world(),
            radius_m: self.arrival.radius_m,
            speed_m_s: self.arrival.speed_m_s,
        };
        let reserved = self.reserved(task);
        let (inputs, is_near) = self.inputs(task, weights.iter().any(|weight| *weight > 0.0));
        let begun = if is_near { Guess::Near(&inputs) } else { Guess::Inputs(&inputs) };
        self.iterations = 0;
        // What cannot arrive in time comes as near as it can, and the next stretch arrives; from nothing only where that fails.
        let region = self.way_ends(task).then_some(region);
        let nearer = (region.is_some() || is_near).then_some((Guess::Inputs(&inputs), None));
        let mut attempt = |(guess, terminal)| {
            let request = LocalRequest {
                start: &start,
                start_s: task.start_s,
                reference: Reference::Nodes(&nodes),
                terminal,
                belief: &learnable,
                information: weights,
                reserved,
                surroundings: task.surroundings,
                guess,
            };
            let found = self.planner.plan(&request, budget)?;
            self.iterations += found.iterations;
            self.answer(task, &goal, (knowledge.names, &weights, &lasting), found)
        };
        for each in [Some((begun, region)), nearer].into_iter().flatten() {
            if let planned @ StretchOutcome::Planned(_) = attempt(each)? {
                return Ok(planned);
            }
        }
        attempt((Guess::Excited, None))
    }
}
