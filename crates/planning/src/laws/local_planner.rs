//! Laws of local planners. Everything is computed from the plan's inputs and the model's steps anew: nothing here asks the
//! planner's own checks.

use super::account::Account;
use super::local_requests::{absurd_beliefs, absurd_settings};
use super::{LawViolation, broken_unless, require};
use crate::belief::ModelBelief;
use crate::collision::{Ellipsoid, Sphere, distance, ellipsoid_to_box, ellipsoid_to_point, sphere_to_box};
use crate::error::PlanningError;
use crate::local::{
    Array2, Barrier, Criterion, Guess, Hull, InformativeModel, Kinematics, Knowledge, LocalAnswer, LocalPlanner,
    LocalRequest, LocalSettings, LocalStatus, LocalTrajectory, Reference, Surroundings, TerminalRegion,
};
use core::fmt::Debug;
use nalgebra::{SMatrix, Vector3};
use tumble_lie::Pose;

/// What is known of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LocalExpectation {
    /// A plan is found within the budget.
    Solvable,
    /// No plan keeps every limit.
    Unsolvable,
    /// Nothing.
    Unknown,
}

/// A request, what is known of it, and the units of work allowed.
#[derive(Clone, Debug)]
pub struct LocalCase<'a, S, const X: usize, const U: usize, const P: usize> {
    /// What stays the same from plan to plan.
    pub settings: LocalSettings<X, U>,
    /// The problem.
    pub request: LocalRequest<'a, S, U, P>,
    /// Whether it has a solution.
    pub expectation: LocalExpectation,
    /// The budget.
    pub units: u64,
    /// States that cannot be, not-a-number for instance: a request that holds one must be refused.
    pub impossible: &'a [S],
}

/// How closely a plan is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalChecks {
    /// Times at which each step is looked at for collisions.
    pub samples_per_step: u32,
    /// Largest error of states, and deepest intrusion; m, m/s, rad, rad/s.
    pub tolerance: f64,
    /// Largest excess over a limit and largest error of costs and covariances, relative.
    pub relative_tolerance: f64,
    /// By how much a plan may cost more than a local optimum, relative: what converging to the settings' tolerance leaves.
    pub cost_tolerance: f64,
}

/// The laws of local planners. `planner` makes one afresh; `model` is what it plans for.
///
/// Of the answer: "well-posed requests are answered", "the budget is respected", "a refusal ends the work", "the same request
/// has the same answer" (asked of a fresh planner and of one that has planned something else), "a plan comes with its status",
/// "a solvable problem is solved", "an unsolvable problem is never solved", "more work never costs more", "a plan is no worse
/// than its guess", "more weight never tells less" (a sweep of weights; plans that stay in a worse valley than their neighbour
/// begin again from it).
/// Of the plan: "the plan names its belief", "the plan has its shape", "the plan starts at the start", "states follow from the
/// inputs", "inputs are inside the limits", "speeds are inside the limits", "the plan ends in its region", "the motion is free"
/// (between the nodes where the settings say so), "information follows from the inputs", "covariances follow from the
/// information", "the cost is what the plan costs".
/// Of what cannot be: "absurd settings are refused", "absurd requests are refused".
///
/// # Errors
/// The first broken law.
pub fn check_local_planner<M, L, const X: usize, const U: usize, const P: usize>(
    model: &M,
    planner: &dyn Fn(&LocalSettings<X, U>) -> Result<L, PlanningError>,
    cases: &[LocalCase<'_, M::State, X, U, P>],
    checks: &LocalChecks,
) -> Result<(), LawViolation>
where
    M: InformativeModel<X, U, P> + Clone,
    L: LocalPlanner<U, P, State = M::State>,
{
    for (index, case) in cases.iter().enumerate() {
        let name = format!("case {index}, {} units", case.units);
        let mut model = model.clone();
        let knowledge = model.adopt(case.request.belief);
        let knowledge = knowledge.map_err(|error| refusal("well-posed requests are answered", &name, &error))?;
        let judge = Judge { name, case, checks, model, knowledge, planner };
        let answer = judge.answers()?;
        if answer.plan.is_some() {
            judge.improves(&answer)?;
            judge.weighs(&answer)?;
        }
        judge.refuses()?;
    }
    Ok(())
}

fn refusal(law: &'static str, name: &str, error: &PlanningError) -> LawViolation {
    LawViolation {
        law,
        inputs: name.to_owned(),
        expected: "an answer".to_owned(),
        found: error.to_string(),
        error: f64::INFINITY,
        tolerance: 0.0,
    }
}

type Maker<'a, L, const X: usize, const U: usize> = &'a dyn Fn(&LocalSettings<X, U>) -> Result<L, PlanningError>;

struct Judge<'a, M: InformativeModel<X, U, P>, L, const X: usize, const U: usize, const P: usize> {
    name: String,
    case: &'a LocalCase<'a, M::State, X, U, P>,
    checks: &'a LocalChecks,
    model: M,
    knowledge: Knowledge<P>,
    planner: Maker<'a, L, X, U>,
}

/// A plan as the judge counts it.
struct Counted<const P: usize> {
    tracking: f64,
    effort: f64,
    /// Of the quantities, at every node.
    covariances: Vec<SMatrix<f64, P, P>>,
    gathered: SMatrix<f64, P, P>,
}

impl<M, L, const X: usize, const U: usize, const P: usize> Judge<'_, M, L, X, U, P>
where
    M: InformativeModel<X, U, P>,
    L: LocalPlanner<U, P, State = M::State>,
{
    fn within(
        &self,
        law: &'static str,
        expected: &dyn Debug,
        found: &dyn Debug,
        error: f64,
        tolerance: f64,
    ) -> Result<(), LawViolation> {
        require(law, &self.name, expected, found, error, tolerance)
    }

    fn holds(
        &self,
        law: &'static str,
        expected: &dyn Debug,
        found: &dyn Debug,
        holds: bool,
    ) -> Result<(), LawViolation> {
        self.within(law, expected, found, broken_unless(holds), 0.0)
    }

    fn made(&self) -> Result<L, LawViolation> {
        (self.planner)(&self.case.settings)
            .map_err(|error| refusal("well-posed requests are answered", &self.name, &error))
    }

    fn answered(
        &self,
        planner: &mut L,
        request: &LocalRequest<'_, M::State, U, P>,
        units: u64,
    ) -> Result<LocalAnswer<M::State, U, P>, LawViolation> {
        const NESTED_PLACES: u64 = 16;
        let mut account = Account::of(units);
        let outcome = planner.plan(request, &mut account);
        let (granted, asks_on) = (account.granted, account.asks_on);
        let answer = outcome.map_err(|error| refusal("well-posed requests are answered", &self.name, &error))?;
        let law = "the budget is respected";
        self.holds(law, &granted, &answer.units, answer.units == granted && granted <= units)?;
        self.holds("a refusal ends the work", &NESTED_PLACES, &asks_on, asks_on <= NESTED_PLACES)?;
        Ok(answer)
    }

    /// The answer to the case's request, after all that is said of answers and plans.
    fn answers(&self) -> Result<LocalAnswer<M::State, U, P>, LawViolation> {
        let case = self.case;
        let request = &case.request;
        let mut planner = self.made()?;
        let answer = self.answered(&mut planner, request, case.units)?;
        // something else in between
        let reversed: Vec<[f64; U]> = vec![case.settings.wrench.limit.map(|limit| -0.3 * limit); case.settings.steps];
        let other = LocalRequest { guess: Guess::Inputs(&reversed), information: [0.0; P], ..request.clone() };
        self.answered(&mut planner, &other, case.units / 2)?;
        let again = self.answered(&mut planner, request, case.units)?;
        let afresh = self.answered(&mut self.made()?, request, case.units)?;
        let one = format!("{answer:?}");
        for second in [again, afresh] {
            let is_same = one == format!("{second:?}");
            self.holds("the same request has the same answer", &answer.cost, &second.cost, is_same)?;
        }
        let is_solved = answer.plan.is_some();
        let law = "a solvable problem is solved";
        self.holds(law, &"a plan", &answer.status, is_solved || case.expectation != LocalExpectation::Solvable)?;
        let law = "an unsolvable problem is never solved";
        self.holds(law, &"no plan", &answer.status, !is_solved || case.expectation != LocalExpectation::Unsolvable)?;

        let mut least = f64::INFINITY;
        for share in [0, 64, 16, 4, 2, 1] {
            let units = case.units.checked_div(share).unwrap_or(0);
            let partial = self.answered(&mut self.made()?, request, units)?;
            self.whole(&partial, request)?;
            let cost = partial.cost.map_or(f64::INFINITY, |cost| cost.total());
            let excess = if least.is_infinite() { 0.0 } else { cost - least };
            let slack = self.checks.relative_tolerance * least.abs();
            self.within("more work never costs more", &least, &(units, cost), excess, slack)?;
            least = least.min(cost);
        }
        let next = ModelBelief { revision: request.belief.revision + 1, estimate: request.belief.estimate };
        let renewed = LocalRequest { belief: &next, ..request.clone() };
        let renewed = self.answered(&mut planner, &renewed, case.units)?;
        if let Some(plan) = &renewed.plan {
            self.holds(
                "the plan names its belief",
                &next.revision,
                &plan.model_revision,
                plan.model_revision == next.revision,
            )?;
        }
        Ok(answer)
    }

    /// Status, cost and plan of an answer.
    fn whole(
        &self,
        answer: &LocalAnswer<M::State, U, P>,
        request: &LocalRequest<'_, M::State, U, P>,
    ) -> Result<(), LawViolation> {
        let LocalAnswer { status, plan, cost, optimality, .. } = answer;
        let is_solved = !matches!(status, LocalStatus::Infeasible { .. });
        let is_optimal = *status != LocalStatus::Converged || *optimality <= self.case.settings.tolerance;
        let fits = plan.is_some() == is_solved && cost.is_some() == is_solved && is_optimal;
        let found = (plan.is_some(), cost, optimality);
        self.holds("a plan comes with its status", status, &found, fits)?;
        let (Some(plan), Some(cost)) = (plan, cost) else { return Ok(()) };
        let (belief, named) = (request.belief.revision, plan.model_revision);
        self.holds("the plan names its belief", &belief, &named, belief == named)?;

        let trajectory = &plan.trajectory;
        self.shape(trajectory, request)?;
        self.limits(trajectory, request)?;
        self.free(trajectory, request)?;
        let counted = self.count(trajectory, request)?;
        self.information(trajectory, &counted)?;
        let relative = self.checks.relative_tolerance;
        let law = "the cost is what the plan costs";
        let size = relative * (counted.tracking + counted.effort + cost.total().abs());
        self.within(law, &counted.tracking, &cost.tracking, (counted.tracking - cost.tracking).abs(), size)?;
        self.within(law, &counted.effort, &cost.effort, (counted.effort - cost.effort).abs(), size)?;
        if self.case.settings.criterion == Criterion::A {
            let information = counted.information(&request.information);
            self.within(law, &information, &cost.information, (information - cost.information).abs(), size)?;
        }
        Ok(())
    }

    fn shape(
        &self,
        trajectory: &LocalTrajectory<M::State, U, P>,
        request: &LocalRequest<'_, M::State, U, P>,
    ) -> Result<(), LawViolation> {
        let settings = &self.case.settings;
        let lengths = [trajectory.inputs.len() + 1, trajectory.states.len(), trajectory.covariances.len()];
        let expected = (settings.steps + 1, settings.step_s, request.start_s);
        let fits = lengths.iter().all(|length| *length == settings.steps + 1)
            && trajectory.step_s.total_cmp(&settings.step_s).is_eq()
            && trajectory.start_s.total_cmp(&request.start_s).is_eq();
        let found = (lengths, trajectory.step_s, trajectory.start_s);
        self.holds("the plan has its shape", &expected, &found, fits)?;
        let begins = trajectory.states.first().map_or(f64::NAN, |state| self.apart(state, request.start));
        let law = "the plan starts at the start";
        self.within(law, &request.start, &trajectory.states.first(), begins, self.checks.tolerance)
    }

    fn apart(&self, a: &M::State, b: &M::State) -> f64 {
        self.model.difference(a, b).iter().fold(0.0, |largest, x| if x.abs() <= largest { largest } else { x.abs() })
    }

    fn limits(
        &self,
        trajectory: &LocalTrajectory<M::State, U, P>,
        request: &LocalRequest<'_, M::State, U, P>,
    ) -> Result<(), LawViolation> {
        let LocalSettings { wrench, speed, .. } = &self.case.settings;
        let left = wrench.without(&request.reserved);
        let wrench = left.map_err(|error| refusal("what is reserved leaves something", &self.name, &error))?;
        let relative = self.checks.relative_tolerance;
        let law = "inputs are inside the limits";
        for (step, input) in trajectory.inputs.iter().enumerate() {
            for (axis, (value, limit)) in input.iter().zip(&wrench.limit).enumerate() {
                self.within(law, &(axis, limit), &(step, value), value.abs() - limit, relative * limit)?;
            }
            for (normal, offset) in &wrench.half_spaces {
                let reached: f64 = normal.iter().zip(input).map(|(a, b)| a * b).sum();
                self.within(law, &(normal, offset), &(step, reached), reached - offset, relative * offset)?;
            }
        }
        let law = "speeds are inside the limits";
        for (node, state) in trajectory.states.iter().enumerate().skip(1) {
            let motion = self.model.kinematics(state);
            let pairs = [(motion.velocity_world, speed.speed_m_s), (motion.rate_body, speed.rate_rad_s)];
            for (value, limit) in pairs {
                for axis in 0..3 {
                    let (value, limit) = (value[axis].abs(), limit[axis]);
                    let excess = if limit.is_infinite() { 0.0 } else { value - limit };
                    let allowed = if limit.is_infinite() { 0.0 } else { relative * limit };
                    self.within(law, &(axis, limit), &(node, value), excess, allowed)?;
                }
            }
        }
        if let (Some(region), Some(last)) = (&request.terminal, trajectory.states.last()) {
            let motion = self.model.kinematics(last);
            let away = f64::sqrt((motion.world_from_body.translation.vector - region.position_world).norm_squared());
            let fast = f64::sqrt(motion.velocity_world.norm_squared());
            let excess = (away / region.radius_m).max(fast / region.speed_m_s) - 1.0;
            self.within("the plan ends in its region", region, &(away, fast), excess, relative)?;
        }
        Ok(())
    }

    fn free(
        &self,
        trajectory: &LocalTrajectory<M::State, U, P>,
        request: &LocalRequest<'_, M::State, U, P>,
    ) -> Result<(), LawViolation> {
        let settings = &self.case.settings;
        let samples = if settings.on_segments { self.checks.samples_per_step.max(1) } else { 1 };
        let still = [[0.0; X]; P];
        for (step, (state, input)) in trajectory.states.iter().zip(&trajectory.inputs).enumerate() {
            for sample in 1..=samples {
                let since_s = settings.step_s * f64::from(sample) / f64::from(samples);
                let time_s = request.start_s + settings.step_s * step as f64 + since_s;
                let moved = self.model.step(state, &still, input, since_s);
                let motion = moved.map(|(state, _)| self.model.kinematics(&state));
                let clearance_m = motion.map_or(f64::NAN, |motion| clearance_m(request.surroundings, &motion, time_s));
                let lacking = settings.margin_m - clearance_m;
                let found = (time_s, motion, clearance_m);
                self.within("the motion is free", &settings.margin_m, &found, lacking, self.checks.tolerance)?;
            }
        }
        Ok(())
    }

    /// Steps through the inputs.
    fn count(
        &self,
        trajectory: &LocalTrajectory<M::State, U, P>,
        request: &LocalRequest<'_, M::State, U, P>,
    ) -> Result<Counted<P>, LawViolation> {
        let settings = &self.case.settings;
        let by_input = self.model.acceleration_by_input();
        let mut counted = Counted { tracking: 0.0, effort: 0.0, covariances: Vec::new(), gathered: SMatrix::zeros() };
        let mut state = request.start.clone();
        let mut sensitivity: Array2<P, X> = [[0.0; X]; P];
        for (node, planned) in trajectory.states.iter().enumerate() {
            let law = "states follow from the inputs";
            self.within(law, &(node, &state), planned, self.apart(planned, &state), self.checks.tolerance)?;
            let reference = match request.reference {
                Reference::Hold(state) => Some(state),
                Reference::Nodes(states) => states.get(node),
            };
            let is_last = node == trajectory.inputs.len();
            let weights = if is_last { &settings.terminal } else { &settings.tracking };
            let residual = reference.map_or([f64::NAN; X], |reference| self.model.residual(&state, reference).0);
            counted.tracking += residual.iter().zip(weights).map(|(r, weight)| weight * r * r).sum::<f64>();
            counted.covariances.push(self.covariance(&counted.gathered));
            let Some(input) = trajectory.inputs.get(node) else { break };
            counted.effort += input.iter().zip(&settings.effort).map(|(u, weight)| weight * u * u).sum::<f64>();
            for (row, by_input) in by_input.iter().enumerate() {
                let acceleration: f64 = by_input.iter().zip(input).map(|(a, b)| a * b).sum();
                counted.effort += settings.acceleration[usize::from(row >= 3)] * acceleration * acceleration;
            }
            let left: Array2<P, X> = sensitivity.map(|row| core::array::from_fn(|i| settings.retained[i] * row[i]));
            let next = self.model.step(&state, &left, input, settings.step_s);
            self.holds(law, &"a next state", &(node, &state, input), next.is_some())?;
            let Some((next_state, next_sensitivity)) = next else { break };
            (state, sensitivity) = (next_state, next_sensitivity);
            let phi = SMatrix::<f64, X, P>::from_fn(|i, c| sensitivity[c][i]);
            counted.gathered += phi.transpose() * settings.measurement * phi;
        }
        Ok(counted)
    }

    fn covariance(&self, gathered: &SMatrix<f64, P, P>) -> SMatrix<f64, P, P> {
        let nothing = SMatrix::repeat(f64::NAN);
        // scaled to ones on the diagonal, so that units do not matter
        let total = self.knowledge.information + gathered;
        let scale = SMatrix::<f64, P, P>::from_diagonal(&total.diagonal().map(|x| 1.0 / f64::sqrt(x)));
        let inverse = (scale * total * scale).cholesky().map_or(nothing, |factor| scale * factor.inverse() * scale);
        self.knowledge.quantities * inverse * self.knowledge.quantities.transpose()
    }

    fn information(
        &self,
        trajectory: &LocalTrajectory<M::State, U, P>,
        counted: &Counted<P>,
    ) -> Result<(), LawViolation> {
        let relative = self.checks.relative_tolerance;
        let law = "information follows from the inputs";
        let total = self.knowledge.information + counted.gathered;
        let error = relative_difference(&counted.gathered, &trajectory.gathered, &total);
        self.within(law, &counted.gathered, &trajectory.gathered, error, relative)?;
        for (node, (expected, found)) in counted.covariances.iter().zip(&trajectory.covariances).enumerate() {
            let error = relative_difference(expected, found, expected);
            self.within("covariances follow from the information", &(node, expected), found, error, relative)?;
        }
        Ok(())
    }

    /// From its own plan a planner finds nothing worse.
    fn improves(&self, answer: &LocalAnswer<M::State, U, P>) -> Result<(), LawViolation> {
        let (Some(plan), Some(cost)) = (&answer.plan, answer.cost) else { return Ok(()) };
        let request = LocalRequest { guess: Guess::Near(&plan.trajectory.inputs), ..self.case.request.clone() };
        let after = self.answered(&mut self.made()?, &request, self.case.units)?;
        self.whole(&after, &request)?;
        let found = after.cost.map_or(f64::INFINITY, |cost| cost.total());
        let slack = self.checks.relative_tolerance * cost.total().abs();
        self.within("a plan is no worse than its guess", &cost.total(), &found, found - cost.total(), slack)
    }

    /// Plans with more and more weight on the same variances.
    ///
    /// Where each of two plans is at least as good as the other under its own weights, the one with more weight predicts no
    /// larger variance: `T1 + w1 V1 <= T2 + w1 V2` and `T2 + w2 V2 <= T1 + w2 V1` give `(w2 - w1)(V2 - V1) <= 0`.
    fn weighs(&self, answer: &LocalAnswer<M::State, U, P>) -> Result<(), LawViolation> {
        const FACTORS: [f64; 4] = [0.0, 0.1, 1.0, 10.0];
        const ROUNDS: usize = 8;
        let base = &self.case.request.information;
        let is_weighed = base.iter().any(|weight| *weight > 0.0);
        if self.case.settings.criterion != Criterion::A || !is_weighed {
            return Ok(());
        }
        let Some(first) = &answer.plan else { return Ok(()) };
        let start = self.weighed(&first.trajectory.inputs, 1.0)?;
        let mut plans = vec![start; FACTORS.len()];
        for round in 0..ROUNDS {
            let mut is_settled = true;
            for (index, factor) in FACTORS.into_iter().enumerate() {
                let own = plans[index].total(factor);
                let best = (0..plans.len()).min_by(|a, b| plans[*a].total(factor).total_cmp(&plans[*b].total(factor)));
                let best = best.unwrap_or(index);
                let is_behind = own - plans[best].total(factor) > self.checks.cost_tolerance * own.abs();
                if round == 0 || is_behind {
                    is_settled = false;
                    plans[index] = self.weighed(&plans[best].inputs.clone(), factor)?;
                }
            }
            if is_settled {
                break;
            }
        }
        for (pair, factors) in plans.windows(2).zip(FACTORS.windows(2)) {
            let ([less, more], [from, to]) = (pair, factors) else { continue };
            let slack = self.checks.cost_tolerance * (less.total(*from).abs() + more.total(*to).abs());
            let error = (to - from) * (more.variance - less.variance);
            let law = "more weight never tells less";
            self.within(law, &(from, less.variance), &(to, more.variance), error, slack)?;
        }
        Ok(())
    }

    /// The plan from these inputs with the case's weights times a factor.
    fn weighed(&self, inputs: &[[f64; U]], factor: f64) -> Result<Weighed<U>, LawViolation> {
        let base = &self.case.request.information;
        let information = base.map(|weight| weight * factor);
        let request = LocalRequest { guess: Guess::Near(inputs), information, ..self.case.request.clone() };
        let answer = self.answered(&mut self.made()?, &request, self.case.units)?;
        let law = "a plan is no worse than its guess";
        self.holds(law, &"a plan", &answer.status, answer.plan.is_some())?;
        let Some(plan) = &answer.plan else { return Ok(Weighed { inputs: Vec::new(), spent: 0.0, variance: 0.0 }) };
        let counted = self.count(&plan.trajectory, &request)?;
        Ok(Weighed {
            inputs: plan.trajectory.inputs.clone(),
            spent: counted.tracking + counted.effort,
            variance: counted.information(base),
        })
    }

    fn refuses(&self) -> Result<(), LawViolation> {
        for (what, settings) in absurd_settings(&self.case.settings) {
            let refused = (self.planner)(&settings).is_err();
            self.holds("absurd settings are refused", &"an error", &what, refused)?;
        }
        let request = &self.case.request;
        let refused = |what: &dyn Debug, request: &LocalRequest<'_, M::State, U, P>| {
            let mut account = Account::of(self.case.units);
            let outcome = self.made()?.plan(request, &mut account);
            self.holds("absurd requests are refused", &"an error", what, outcome.is_err())
        };
        for state in self.case.impossible {
            refused(&("start", state), &LocalRequest { start: state, ..request.clone() })?;
            refused(&("reference", state), &LocalRequest { reference: Reference::Hold(state), ..request.clone() })?;
        }
        for start_s in [f64::NAN, f64::INFINITY] {
            refused(&("start_s", start_s), &LocalRequest { start_s, ..request.clone() })?;
        }
        for weight in [f64::NAN, f64::INFINITY, -1.0] {
            let mut information = request.information;
            if let Some(last) = information.last_mut() {
                *last = weight;
            }
            refused(&("information", information), &LocalRequest { information, ..request.clone() })?;
        }
        for reserved in [f64::NAN, f64::INFINITY, -1.0] {
            let reserved = [reserved; U];
            refused(&("reserved", reserved), &LocalRequest { reserved, ..request.clone() })?;
        }
        for (position, radius_m, speed_m_s) in
            [(f64::NAN, 1.0, 1.0), (0.0, f64::NAN, 1.0), (0.0, 1.0, f64::NAN), (0.0, -1.0, 1.0), (0.0, 1.0, -1.0)]
        {
            let region = TerminalRegion { position_world: Vector3::repeat(position), radius_m, speed_m_s };
            refused(&region, &LocalRequest { terminal: Some(region), ..request.clone() })?;
        }
        refused(&"no reference", &LocalRequest { reference: Reference::Nodes(&[]), ..request.clone() })?;
        let steps = self.case.settings.steps;
        let mut broken = vec![[0.0; U]; steps];
        if let Some(entry) = broken.last_mut().and_then(|input| input.last_mut()) {
            *entry = f64::NAN;
        }
        refused(&"a guess of NaN", &LocalRequest { guess: Guess::Inputs(&broken), ..request.clone() })?;
        let longer = vec![[0.0; U]; steps + 1];
        refused(&"a guess too long", &LocalRequest { guess: Guess::Inputs(&longer), ..request.clone() })?;
        let shorter = &longer[..steps.saturating_sub(1)];
        refused(&"a guess too short", &LocalRequest { guess: Guess::Inputs(shorter), ..request.clone() })?;
        for (what, belief) in absurd_beliefs(request.belief) {
            refused(&what, &LocalRequest { belief: &belief, ..request.clone() })?;
        }
        Ok(())
    }
}

/// A plan of the sweep of weights.
#[derive(Clone)]
struct Weighed<const U: usize> {
    inputs: Vec<[f64; U]>,
    /// Tracking and effort.
    spent: f64,
    /// The predicted variances under the case's weights.
    variance: f64,
}

impl<const U: usize> Weighed<U> {
    fn total(&self, factor: f64) -> f64 {
        self.spent + factor * self.variance
    }
}

impl<const P: usize> Counted<P> {
    fn information(&self, weights: &[f64; P]) -> f64 {
        let Some(covariance) = self.covariances.last() else { return f64::NAN };
        weights.iter().enumerate().map(|(i, weight)| weight * covariance[(i, i)]).sum()
    }
}

/// Largest entry of the difference, in units of the roots of the diagonal of `scale`.
fn relative_difference<const P: usize>(
    a: &SMatrix<f64, P, P>,
    b: &SMatrix<f64, P, P>,
    scale: &SMatrix<f64, P, P>,
) -> f64 {
    let mut largest = 0.0;
    for i in 0..P {
        for j in 0..P {
            let error = (a[(i, j)] - b[(i, j)]).abs() / f64::sqrt(scale[(i, i)] * scale[(j, j)]);
            // a NaN is kept
            largest = if error <= largest { largest } else { error };
        }
    }
    largest
}

/// Distance of the body from the nearest thing, m; negative inside, infinite where there is nothing.
fn clearance_m(surroundings: &Surroundings, motion: &Kinematics, time_s: f64) -> f64 {
    let pose = &motion.world_from_body;
    let barriers = surroundings.barriers().iter().map(|(_, barrier)| match surroundings.hull() {
        Hull::Point => from_point(&pose.translation.vector, barrier, time_s),
        Hull::Shape(shape) => {
            let parts = shape.parts().iter().map(|part| Ellipsoid::of_body(part, pose));
            parts.map(|part| from_ellipsoid(&part, barrier, time_s)).fold(f64::INFINITY, least)
        }
    });
    barriers.fold(f64::INFINITY, least)
}

/// NaN where there is one.
fn least(a: f64, b: f64) -> f64 {
    if b < a || b.is_nan() { b } else { a }
}

/// The ellipsoid that stands there at this time.
fn standing(barrier: &Barrier, time_s: f64) -> Option<Ellipsoid> {
    let Barrier::Ellipsoid(obstacle) = barrier else { return None };
    if time_s < obstacle.appear_s || time_s > obstacle.vanish_s {
        return None;
    }
    let since_s = time_s - obstacle.since_s;
    let mut displacement = Vector3::zeros();
    let mut power = 1.0;
    for coefficient in &obstacle.displacement {
        displacement += coefficient * power;
        power *= since_s;
    }
    let at = &obstacle.ellipsoid.world_from_ellipsoid;
    let pose = Pose::from_parts((at.translation.vector + displacement).into(), at.rotation);
    Ellipsoid::try_new(&pose, &obstacle.ellipsoid.semi_axes).ok()
}

fn from_point(point: &Vector3<f64>, barrier: &Barrier, time_s: f64) -> f64 {
    match barrier {
        Barrier::Box(solid) => sphere_to_box(&Sphere { center: *point, radius_m: 0.0 }, solid).distance_m,
        Barrier::Ellipsoid(_) => {
            standing(barrier, time_s).map_or(f64::INFINITY, |solid| ellipsoid_to_point(&solid, point).distance_m)
        }
    }
}

fn from_ellipsoid(body: &Ellipsoid, barrier: &Barrier, time_s: f64) -> f64 {
    match barrier {
        Barrier::Box(solid) => ellipsoid_to_box(body, solid).distance_m,
        Barrier::Ellipsoid(_) => {
            standing(barrier, time_s).map_or(f64::INFINITY, |solid| distance(body, &solid).distance_m)
        }
    }
}
