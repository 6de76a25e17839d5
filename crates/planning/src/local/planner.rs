//! The planner of one stretch.

use super::answer::{LocalAnswer, LocalStatus, LocalTrajectory};
use super::bends::{bends, own_turning};
use super::curvature::Factorisation;
use super::flown::{Flight, keep_off_when_flown};
use super::information::{InformationCost, gather, unobservable};
use super::model::{Array2, InformativeModel, Kinematics, Knowledge};
use super::passing::{Crossing, PassingWay, PassingWays, passing_ways};
use super::problem::CondensedProblem;
use super::request::{Guess, LocalPlanner, LocalRequest, LocalSettings, Reference};
use super::shooting::{Shooting, Task, Workspace};
use super::sqp::{SqpWorkspace, minimise};
use super::sqp_settings::{FEASIBLE, SqpOutcome, SqpSettings, SqpStatus};
use super::surroundings::{MotionBounds, RowSettings};
use crate::belief::Plan;
use crate::budget::Budget;
use crate::error::{PlanningError, finite, length, moderate, not_negative, pose, positive};
use nalgebra::{SMatrix, Vector3};

/// Residual at which the search from one start is broken off to be compared with the others.
const ROUGH: f64 = 3e-2;
/// Amplitude of the stirred inputs, in limits.
const STIRRED: f64 = 0.3;
/// An input below this all along, in limits, is zero.
const STILL: f64 = 1e-3;
/// Ratio of predicted to prior standard deviation above which a direction counts as unobservable.
const UNOBSERVABLE: f64 = 0.99;
/// Longest horizon, in steps.
const MOST_STEPS: usize = 10_000;
/// Budget units of one iteration, per step of the horizon.
const UNITS_PER_STEP: u64 = 16;

/// Plans a stretch by minimising tracking error, effort and the weighted variances of what is not known, over the inputs.
///
/// # Source
/// Thesis (6.4)-(6.9).
/// # Deviation
/// The prior information is added, without which (6.9) has no value for parameters not yet excited, and `Gamma' diag(F^-1)` counts
/// once per horizon.
#[derive(Clone, Debug)]
pub struct InformativePlanner<M: InformativeModel<X, U, P>, const X: usize, const U: usize, const P: usize> {
    model: M,
    settings: LocalSettings<X, U>,
    workspace: Workspace<M::State, X, U, P>,
    sqp: SqpWorkspace,
    z: Vec<f64>,
    best: Vec<f64>,
    flight: Flight,
}

impl<M: InformativeModel<X, U, P>, const X: usize, const U: usize, const P: usize> InformativePlanner<M, X, U, P> {
    /// A planner with its memory.
    ///
    /// # Errors
    /// Settings that are none: lengths, weights, limits.
    pub fn try_new(model: M, settings: LocalSettings<X, U>) -> Result<Self, PlanningError> {
        validate(&settings)?;
        let unknowns = settings.steps * U;
        let workspace = Workspace::new(settings.steps, Factorisation::default());
        let sqp = SqpWorkspace::new(unknowns, 0);
        Ok(Self {
            model,
            settings,
            workspace,
            sqp,
            z: vec![0.0; unknowns],
            best: vec![0.0; unknowns],
            flight: Flight::default(),
        })
    }

    /// The same with another factorisation of the curvature.
    pub fn factorised_by(mut self, factorisation: Factorisation) -> Self {
        self.workspace = Workspace::new(self.settings.steps, factorisation);
        self
    }

    /// The settings.
    pub fn settings(&self) -> &LocalSettings<X, U> {
        &self.settings
    }

    /// The model.
    pub fn model(&self) -> &M {
        &self.model
    }

    /// # Errors
    /// A request that cannot be: numbers that are none, lists of other lengths than the horizon's.
    fn check(&self, request: &LocalRequest<'_, M::State, U, P>) -> Result<(), PlanningError> {
        let steps = self.settings.steps;
        finite("the time of the start", request.start_s)?;
        let check_state = |state: &M::State| -> Result<(), PlanningError> {
            let motion = self.model.kinematics(state);
            pose(&motion.world_from_body)?;
            for entry in motion.velocity_world.iter().chain(&motion.rate_body) {
                moderate("a velocity or rate of a state", *entry)?;
            }
            Ok(())
        };
        let count = |what: &'static str, given: usize, expected: usize| {
            let is_right = given == expected;
            if is_right { Ok(()) } else { Err(PlanningError::WrongCount { what, given, expected }) }
        };
        check_state(request.start)?;
        match request.reference {
            Reference::Hold(state) => check_state(state)?,
            Reference::Nodes(states) => {
                count("states of the reference", states.len(), steps + 1)?;
                states.iter().try_for_each(check_state)?;
            }
        }
        if let Some(region) = &request.terminal {
            length("the radius of the terminal region", region.radius_m)?;
            length("the largest speed in the terminal region", region.speed_m_s)?;
            for entry in &region.position_world {
                moderate("a coordinate of the terminal region", *entry)?;
            }
        }
        if let Guess::Inputs(inputs) | Guess::Near(inputs) = request.guess {
            count("inputs of the guess", inputs.len(), steps)?;
            for input in inputs.iter().flatten() {
                finite("an input of the guess", *input)?;
            }
        }
        Ok(())
    }

    /// The effort and acceleration as one square form.
    fn effort(&self) -> Array2<U, U> {
        let by_input = self.model.acceleration_by_input();
        let [linear, angular] = self.settings.acceleration;
        let weights = [linear, linear, linear, angular, angular, angular];
        core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                let acceleration: f64 =
                    by_input.iter().zip(weights).map(|(row, weight)| weight * row[i] * row[j]).sum();
                acceleration + if i == j { self.settings.effort[i] } else { 0.0 }
            })
        })
    }

    /// How fast the motion can change, from a start with this rate on.
    ///
    /// A force accelerates the origin of a body at least as much as its centre of mass, so that the bound for the one holds for
    /// the other. Without torques the energy stays, so that the rate grows by no more than the root of the ratio of the largest to
    /// the smallest moment of inertia; torques add to the root of the energy at most in that ratio.
    fn bounds(&self, start_rate: f64) -> MotionBounds {
        let by_input = self.model.acceleration_by_input();
        let limit = &self.settings.wrench.limit;
        let most = |rows: &[[f64; U]]| {
            let axes = rows.iter().map(|row| row.iter().zip(limit).map(|(a, l)| (a * l).abs()).sum::<f64>());
            f64::sqrt(axes.map(|a| a * a).sum())
        };
        let (linear, angular) = (most(&by_input[..3]), most(&by_input[3..]));
        let duration_s = self.settings.step_s * self.settings.steps as f64;
        let limit = f64::sqrt(self.settings.speed.rate_rad_s.norm_squared()).max(start_rate);
        let growth = self.model.principal_moments().map_or(1.0, |moments| f64::sqrt(moments.max() / moments.min()));
        let rate = limit.min(growth * (start_rate + angular * duration_s));
        MotionBounds {
            acceleration_m_s2: linear,
            rate_rad_s: rate,
            angular_acceleration_rad_s2: angular,
            center_of_mass_m: self.model.center_of_mass_m(),
        }
    }

    /// Coordinates of the kinematics with a limit, and the limit at the nodes.
    ///
    /// So much less than between the nodes that no velocity or rate bends beyond the limit: see [`bends`].
    fn speed_limits(&self, bounds: &MotionBounds) -> Result<Vec<(usize, f64)>, PlanningError> {
        let speed = &self.settings.speed;
        let own = self.model.principal_moments().map_or(0.0, |moments| own_turning(&moments));
        let [speed_m_s, rate_rad_s] = bends(self.settings.step_s, bounds, own);
        let mut limits = Vec::new();
        for axis in 0..3 {
            let both = [
                (
                    3 + axis,
                    speed.speed_m_s[axis] - speed_m_s,
                    "the largest speed that is left between the nodes of so long a step",
                ),
                (
                    9 + axis,
                    speed.rate_rad_s[axis] - rate_rad_s,
                    "the largest rate that is left between the nodes of so long a step",
                ),
            ];
            for (coordinate, limit, what) in both {
                if limit.is_finite() {
                    limits.push((coordinate, positive(what, limit)?));
                }
            }
        }
        limits.sort_by_key(|(coordinate, _)| *coordinate);
        Ok(limits)
    }

    /// The inputs that give a resting body an acceleration of its origin, body axes, and turn it least.
    fn input_by_acceleration(&self) -> Array2<U, 3> {
        let by_input = self.model.acceleration_by_input();
        let limit = &self.settings.wrench.limit;
        let scaled = SMatrix::<f64, 6, U>::from_fn(|i, j| by_input[i][j] * limit[j]);
        let mut normal = scaled.transpose() * scaled;
        let small = normal.trace() * 1e-9 + f64::MIN_POSITIVE;
        normal += SMatrix::<f64, U, U>::identity() * small;
        let Some(factor) = normal.cholesky() else { return [[0.0; 3]; U] };
        let inputs = factor.solve(&scaled.transpose());
        core::array::from_fn(|input| core::array::from_fn(|axis| inputs[(input, axis)] * limit[input]))
    }

    /// Ways past what blocks the straight one.
    fn ways(
        &self,
        request: &LocalRequest<'_, M::State, U, P>,
        start: &Kinematics,
        bounds: &MotionBounds,
    ) -> PassingWays {
        let goal = match request.reference {
            Reference::Hold(state) => Some(state),
            Reference::Nodes(states) => states.last(),
        };
        let goal_world = goal.map_or(start.world_from_body.translation.vector, |state| {
            self.model.kinematics(state).world_from_body.translation.vector
        });
        // an axis along which nothing pushes is the normal of a plane
        let by_input = self.model.acceleration_by_input();
        let still = (0..3).find(|axis| by_input[*axis].iter().all(|entry| *entry == 0.0));
        let plane_normal = still.map(|axis| start.world_from_body.rotation * Vector3::ith_axis(axis));
        let crossing = Crossing {
            start,
            start_s: request.start_s,
            goal_world,
            horizon_s: self.settings.step_s * self.settings.steps as f64,
            acceleration_m_s2: bounds.acceleration_m_s2,
            margin_m: self.settings.margin_m,
            plane_normal,
        };
        passing_ways(&crossing, request.surroundings)
    }

    /// Inputs without structure in units of their limits: torques first, so that neighbouring channels differ.
    fn stir(&self, channel: usize, step: usize) -> f64 {
        let (group, within) = (channel / 3, channel % 3);
        let index = 3 * self.settings.steps * group + 3 * step + within;
        STIRRED * libm::sin(1.0 + 1.7 * index as f64)
    }

    fn fill_stirred(&mut self) {
        for step in 0..self.settings.steps {
            for channel in 0..U {
                self.z[step * U + channel] = self.stir(channel, step);
            }
        }
    }

    /// Fills in a guess; inputs that are zero all along are stirred where information matters.
    fn fill(&mut self, inputs: &[[f64; U]], matters: bool, is_near: bool) {
        let limit = self.settings.wrench.limit;
        for (place, value) in self.z.iter_mut().zip(inputs.iter().flat_map(|input| input.iter().zip(limit))) {
            *place = (value.0 / value.1).clamp(-1.0, 1.0);
        }
        let largest =
            |z: &[f64], channel: usize| z.iter().skip(channel).step_by(U).fold(0.0, |a: f64, b| a.max(b.abs()));
        let is_still: [bool; U] = core::array::from_fn(|channel| largest(&self.z, channel) < STILL);
        if matters && (!is_near || is_still.iter().all(|still| *still)) {
            for channel in (0..U).filter(|channel| is_still[*channel]) {
                for step in 0..self.settings.steps {
                    self.z[step * U + channel] = self.stir(channel, step);
                }
            }
        }
    }
}

/// Whether one search ended better than another: within every limit, then at less cost.
fn is_better(one: &SqpOutcome, other: &SqpOutcome) -> bool {
    match (one.violation <= FEASIBLE, other.violation <= FEASIBLE) {
        (true, true) => one.cost < other.cost,
        (false, false) => one.violation < other.violation,
        (is_feasible, _) => is_feasible,
    }
}

/// Adds to inputs what pushes a body that keeps its attitude along a way.
fn follow<const X: usize, const U: usize>(
    way: &PassingWay,
    start: &Kinematics,
    by_acceleration: &Array2<U, 3>,
    settings: &LocalSettings<X, U>,
    z: &mut [f64],
) {
    for (step, inputs) in z.chunks_exact_mut(U).enumerate() {
        let (_, acceleration_world) = way.at((step as f64 + 0.5) * settings.step_s);
        let acceleration = start.world_from_body.rotation.inverse_transform_vector(&acceleration_world);
        for ((input, row), limit) in inputs.iter_mut().zip(by_acceleration).zip(&settings.wrench.limit) {
            let push: f64 = row.iter().zip(&acceleration).map(|(a, b)| a * b).sum();
            *input = (*input + push / limit).clamp(-1.0, 1.0);
        }
    }
}

/// Counts what is spent.
struct Meter<'a> {
    budget: &'a mut dyn Budget,
    units: u64,
}

impl Budget for Meter<'_> {
    fn spend(&mut self, units: u64) -> bool {
        let is_granted = self.budget.spend(units);
        if is_granted {
            self.units += units;
        }
        is_granted
    }
}

fn validate<const X: usize, const U: usize>(settings: &LocalSettings<X, U>) -> Result<(), PlanningError> {
    let steps = settings.steps as f64;
    if settings.steps == 0 || settings.steps > MOST_STEPS {
        let (lower, upper) = (1.0, MOST_STEPS as f64);
        return Err(PlanningError::OutOfRange { what: "the number of steps", value: steps, lower, upper });
    }
    positive("the length of a step", settings.step_s)?;
    for weight in settings.tracking.iter().chain(&settings.terminal) {
        not_negative("a tracking weight", *weight)?;
    }
    for weight in &settings.effort {
        positive("an effort weight", *weight)?;
    }
    for weight in &settings.acceleration {
        not_negative("an acceleration weight", *weight)?;
    }
    for limit in &settings.wrench.limit {
        positive("an input limit", *limit)?;
    }
    for (normal, offset) in &settings.wrench.half_spaces {
        positive("the offset of a half-space of the inputs", *offset)?;
        for entry in normal {
            finite("the normal of a half-space of the inputs", *entry)?;
        }
    }
    for limit in settings.speed.speed_m_s.iter().chain(&settings.speed.rate_rad_s) {
        if *limit != f64::INFINITY {
            positive("a speed limit", *limit)?;
        }
    }
    for i in 0..X {
        not_negative("the information of a measurement", settings.measurement[(i, i)])?;
        for j in 0..X {
            finite("the information of a measurement", settings.measurement[(i, j)])?;
        }
    }
    if (settings.measurement - settings.measurement.transpose()).amax() > 0.0 {
        return Err(PlanningError::Asymmetric { what: "the information of a measurement" });
    }
    let rounding = 1e-12 * settings.measurement.trace() + f64::MIN_POSITIVE;
    if (settings.measurement + SMatrix::<f64, X, X>::identity() * rounding).cholesky().is_none() {
        return Err(PlanningError::NotPositive { what: "the information of a measurement", value: -rounding });
    }
    for share in settings.retained {
        let (lower, upper) = (0.0, 1.0);
        if !(lower..=upper).contains(&share) {
            return Err(PlanningError::OutOfRange {
                what: "the share that a measurement leaves",
                value: share,
                lower,
                upper,
            });
        }
    }
    not_negative("the margin", settings.margin_m)?;
    length("the length over which distances are measured", settings.length_scale_m)?;
    positive("the tolerance", settings.tolerance)?;
    positive("the number of iterations", settings.iterations as f64)?;
    Ok(())
}

/// Puts the answer together from the best inputs found.
fn answer<M: InformativeModel<X, U, P>, const X: usize, const U: usize, const P: usize>(
    problem: &mut Shooting<'_, M, X, U, P>,
    z: &[f64],
    request: &LocalRequest<'_, M::State, U, P>,
    knowledge: &Knowledge<P>,
    outcome: &SqpOutcome,
    (flown_violation, units): (f64, u64),
) -> LocalAnswer<M::State, U, P> {
    let settings = problem.task.settings;
    let is_motion = problem.linearize(z);
    let violation = problem.row_values().iter().fold(flown_violation, |worst: f64, value| worst.max(-value));
    let is_plan = is_motion && violation <= FEASIBLE;
    let status = match outcome.status {
        _ if !is_plan => {
            let worst = problem.row_values().iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)).map(|(row, _)| row);
            let row = worst.and_then(|row| problem.barrier_row(row));
            let surroundings = request.surroundings;
            let blocker = row.and_then(|row| surroundings.blocker(row, settings.steps, &problem.task.row_settings));
            LocalStatus::Infeasible { violation: if is_motion { violation } else { f64::INFINITY }, blocker }
        }
        SqpStatus::Converged => LocalStatus::Converged,
        _ => LocalStatus::Feasible,
    };
    let mut information = knowledge.information;
    let mut covariances = Vec::with_capacity(settings.steps + 1);
    for (node, sensitivity) in problem.sensitivities().iter().enumerate() {
        if node > 0 {
            gather(&mut information, problem.measurement(), sensitivity);
        }
        let covariance = information.cholesky().map_or_else(SMatrix::zeros, |factor| factor.inverse());
        covariances.push(knowledge.quantities * covariance * knowledge.quantities.transpose());
    }
    let gathered = information - knowledge.information;
    let unobservable = unobservable(knowledge, &gathered, UNOBSERVABLE);
    let trajectory = is_plan.then(|| LocalTrajectory {
        start_s: request.start_s,
        step_s: settings.step_s,
        states: problem.states().to_vec(),
        inputs: (0..settings.steps).map(|step| problem.input(z, step)).collect(),
        covariances,
        gathered,
    });
    LocalAnswer {
        status,
        plan: trajectory.map(|trajectory| Plan { trajectory, model_revision: request.belief.revision }),
        cost: is_plan.then(|| problem.parts()),
        optimality: outcome.optimality,
        violation: if is_motion { violation } else { f64::INFINITY },
        iterations: outcome.iterations,
        units,
        unobservable,
    }
}

impl<M, const X: usize, const U: usize, const P: usize> LocalPlanner<U, P> for InformativePlanner<M, X, U, P>
where
    M: InformativeModel<X, U, P>,
{
    type State = M::State;

    fn plan(
        &mut self,
        request: &LocalRequest<'_, M::State, U, P>,
        budget: &mut dyn Budget,
    ) -> Result<LocalAnswer<M::State, U, P>, PlanningError> {
        let left = self.settings.wrench.without(&request.reserved)?;
        let all = core::mem::replace(&mut self.settings.wrench, left);
        let answer = self.plan_within(request, budget);
        self.settings.wrench = all;
        answer
    }
}

impl<M: InformativeModel<X, U, P>, const X: usize, const U: usize, const P: usize> InformativePlanner<M, X, U, P> {
    /// The plan within the limits as they are.
    fn plan_within(
        &mut self,
        request: &LocalRequest<'_, M::State, U, P>,
        budget: &mut dyn Budget,
    ) -> Result<LocalAnswer<M::State, U, P>, PlanningError> {
        let knowledge = self.model.adopt(request.belief)?;
        self.check(request)?;
        let settings = self.settings.clone();
        let information = InformationCost::try_new(settings.criterion, &request.information, &knowledge)?;
        let matters = information.matters();
        let start = self.model.kinematics(request.start);
        let bounds = self.bounds(f64::sqrt(start.rate_body.norm_squared()));
        let task = Task {
            settings: &settings,
            start: request.start,
            reference: request.reference,
            terminal: request.terminal,
            surroundings: request.surroundings,
            row_settings: RowSettings {
                start_s: request.start_s,
                step_s: settings.step_s,
                margin_m: settings.margin_m,
                interpolation_error_m: request.surroundings.interpolation_error_m(settings.step_s, &bounds),
                length_scale_m: settings.length_scale_m,
                on_segments: settings.on_segments,
            },
            information,
            effort: self.effort(),
            speed_limits: self.speed_limits(&bounds)?,
        };

        let cold = SqpSettings { tolerance: settings.tolerance, iterations: settings.iterations, ..SqpSettings::COLD };
        let near = SqpSettings { damping: SqpSettings::WARM.damping, ..cold };
        let (ways, search) = match request.guess {
            Guess::Excited => {
                self.fill_stirred();
                (Some(self.ways(request, &start, &bounds)), cold)
            }
            Guess::Inputs(inputs) => {
                self.fill(inputs, matters, false);
                (None, cold)
            }
            Guess::Near(inputs) => {
                self.fill(inputs, matters, true);
                (None, near)
            }
        };
        let ways = ways.as_ref().map_or(&[][..], PassingWays::as_slice);
        let by_acceleration = self.input_by_acceleration();
        let Self { model, workspace, sqp, z, best, flight, .. } = self;
        let mut problem = Shooting::new(&*model, task, workspace);
        sqp.prepare(problem.unknowns(), problem.rows());
        let mut meter = Meter { budget, units: 0 };
        let units = UNITS_PER_STEP * settings.steps as u64;
        let outcome = if ways.is_empty() {
            minimise(&mut problem, z, &search, sqp, &mut meter, units)
        } else {
            let rough = SqpSettings { tolerance: ROUGH.max(settings.tolerance), ..cold };
            let stirred = z.clone();
            let mut least = minimise(&mut problem, z, &rough, sqp, &mut meter, units);
            best.copy_from_slice(z);
            let mut iterations = least.iterations;
            for way in ways {
                z.copy_from_slice(&stirred);
                follow(way, &start, &by_acceleration, &settings, z);
                sqp.forget();
                let outcome = minimise(&mut problem, z, &rough, sqp, &mut meter, units);
                iterations += outcome.iterations;
                if is_better(&outcome, &least) {
                    least = outcome;
                    best.copy_from_slice(z);
                }
            }
            z.copy_from_slice(best);
            sqp.forget();
            let outcome = minimise(&mut problem, z, &near, sqp, &mut meter, units);
            SqpOutcome { iterations: iterations + outcome.iterations, ..outcome }
        };
        let (outcome, flown_violation) = if settings.on_segments {
            keep_off_when_flown(&mut problem, z, outcome, flight, |problem, z| {
                sqp.forget();
                minimise(problem, z, &near, sqp, &mut meter, units)
            })
        } else {
            (outcome, 0.0)
        };
        Ok(answer(&mut problem, z, request, &knowledge, &outcome, (flown_violation, meter.units)))
    }
}
