//! Laws of planners of long motions. Everything is computed from the plan anew: nothing here asks the planner's own checks.

use super::account::Account;
use super::{LawViolation, broken_unless, require};
use crate::collision::CollisionWorld;
use crate::error::PlanningError;
use crate::global::{GlobalAnswer, GlobalPlanner, GlobalRequest, Objective, Status};
use crate::motion::{ArcPath, BodyArc};
use nalgebra::{UnitQuaternion, Vector3};

/// What is known of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expectation {
    /// A plan exists.
    Solvable,
    /// No plan exists.
    Unsolvable,
    /// Nothing.
    Unknown,
}

/// A request, what is known of it, and the units of work allowed.
pub struct PlannerCase<'a, W: CollisionWorld + ?Sized> {
    /// The problem.
    pub request: GlobalRequest<'a, W>,
    /// Whether it has a solution.
    pub expectation: Expectation,
    /// The budget.
    pub units: u64,
}

/// How closely a plan is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannerChecks {
    /// Times at which each arc is looked at.
    pub samples_per_arc: u32,
    /// Largest error of lengths, speeds, angles and rates; m, m/s, rad, rad/s.
    pub tolerance: f64,
    /// Largest error of forces, torques, costs and bounds, relative to their limit or size.
    pub relative_tolerance: f64,
}

/// The laws of planners, each case answered by a planner freshly made.
///
/// Of the answer: "well-posed requests are answered", "the budget is respected", "a refusal ends the work" (a planner may ask
/// on from a few nested places, not from each piece of work), "the same request has the same answer", "a plan comes with its
/// status", "an enclosed goal is never solved", "a solvable problem is never called infeasible", "costs fall from plan to
/// plan", "the bound is never above the cost", "what is optimal meets its bound", "more work never costs more".
/// Of the plan: "the plan names its belief", "the plan starts at the start", "the plan ends in the goal region", "the motion
/// is continuous" (position, velocity and attitude), "the motion is inside the limits" (position, speed, force of the believed
/// mass, and of turns rate and torque), "the motion is free" (by sampling the clearance), "the cost is what the plan costs".
///
/// # Errors
/// The first broken law.
pub fn check_global_planner<W, P>(
    planner: &dyn Fn() -> P,
    cases: &[PlannerCase<'_, W>],
    checks: &PlannerChecks,
) -> Result<(), LawViolation>
where
    W: CollisionWorld + ?Sized,
    P: GlobalPlanner<W>,
{
    for (index, case) in cases.iter().enumerate() {
        let name = format!("case {index}, seed {}, {} units", case.request.seed, case.units);
        let judge = Judge { name: &name, case, checks };
        let answer = judge.answered(planner, case.units)?;
        let again = judge.answered(planner, case.units)?;
        let (one, two) = (format!("{answer:?}"), format!("{again:?}"));
        judge.holds("the same request has the same answer", &answer.cost, &again.cost, one == two)?;
        judge.answer(&answer)?;
        if let Some(plan) = &answer.plan {
            let (belief, found) = (case.request.belief.revision, plan.model_revision);
            judge.holds("the plan names its belief", &belief, &found, belief == found)?;
            judge.path(&plan.trajectory, answer.cost)?;
        }
        let half = judge.answered(planner, case.units / 2)?;
        let excess = answer.cost - half.cost * (1.0 + checks.relative_tolerance);
        let excess = if half.cost.is_infinite() { 0.0 } else { excess };
        judge.within("more work never costs more", &half.cost, &answer.cost, excess, 0.0)?;
    }
    Ok(())
}

struct Judge<'a, 'w, W: CollisionWorld + ?Sized> {
    name: &'a str,
    case: &'a PlannerCase<'w, W>,
    checks: &'a PlannerChecks,
}

impl<W: CollisionWorld + ?Sized> Judge<'_, '_, W> {
    fn within(
        &self,
        law: &'static str,
        expected: &dyn core::fmt::Debug,
        found: &dyn core::fmt::Debug,
        error: f64,
        tolerance: f64,
    ) -> Result<(), LawViolation> {
        require(law, &self.name, expected, found, error, tolerance)
    }

    fn holds(
        &self,
        law: &'static str,
        expected: &dyn core::fmt::Debug,
        found: &dyn core::fmt::Debug,
        holds: bool,
    ) -> Result<(), LawViolation> {
        self.within(law, expected, found, broken_unless(holds), 0.0)
    }

    fn answered<P: GlobalPlanner<W>>(&self, planner: &dyn Fn() -> P, units: u64) -> Result<GlobalAnswer, LawViolation> {
        const NESTED_PLACES: u64 = 16;
        let mut account = Account::of(units);
        let outcome = planner().plan(&self.case.request, &mut account);
        let (granted, asks_on) = (account.granted, account.asks_on);
        match outcome {
            Ok(answer) => {
                let law = "the budget is respected";
                self.holds(law, &granted, &answer.units, answer.units == granted && granted <= units)?;
                self.holds("a refusal ends the work", &NESTED_PLACES, &asks_on, asks_on <= NESTED_PLACES)?;
                Ok(answer)
            }
            Err(error) => Err(self.refused(&error)),
        }
    }

    fn refused(&self, error: &PlanningError) -> LawViolation {
        LawViolation {
            law: "well-posed requests are answered",
            inputs: self.name.to_owned(),
            expected: "an answer".to_owned(),
            found: error.to_string(),
            error: f64::INFINITY,
            tolerance: 0.0,
        }
    }

    fn answer(&self, answer: &GlobalAnswer) -> Result<(), LawViolation> {
        let GlobalAnswer { status, plan, cost, lower_bound, history, .. } = answer;
        let is_solved = matches!(status, Status::Optimal | Status::Feasible);
        let fits = plan.is_some() == is_solved && cost.is_finite() == is_solved;
        self.holds("a plan comes with its status", status, &(plan.is_some(), cost), fits)?;
        let is_refuted = matches!(status, Status::Infeasible(_));
        let solved_anyway = self.case.expectation == Expectation::Unsolvable && is_solved;
        self.holds("an enclosed goal is never solved", &"no plan", status, !solved_anyway)?;
        let refuted_anyway = self.case.expectation == Expectation::Solvable && is_refuted;
        self.holds("a solvable problem is never called infeasible", &"a plan or none yet", status, !refuted_anyway)?;

        let falls = history.windows(2).all(|pair| pair[1].cost < pair[0].cost && pair[0].units <= pair[1].units);
        let last = history.last().map_or(f64::INFINITY, |improvement| improvement.cost);
        let ends = last.total_cmp(cost).is_eq() && history.last().is_none_or(|last| last.units <= answer.units);
        self.holds("costs fall from plan to plan", &cost, history, falls && ends)?;

        let slack = self.checks.relative_tolerance * cost.abs();
        let is_bound = *lower_bound >= 0.0 && (is_refuted == (*lower_bound == f64::INFINITY) || is_solved);
        self.holds("the bound is never above the cost", &"a bound", lower_bound, is_bound)?;
        if is_solved {
            self.within("the bound is never above the cost", cost, lower_bound, lower_bound - cost, slack)?;
        }
        if *status == Status::Optimal {
            const OPTIMAL: f64 = 0.01;
            self.within("what is optimal meets its bound", lower_bound, cost, cost - lower_bound, OPTIMAL * cost)?;
        }
        Ok(())
    }

    fn path(&self, path: &ArcPath, cost: f64) -> Result<(), LawViolation> {
        let request = &self.case.request;
        let tolerance = self.checks.tolerance;
        let mut at = (request.start.position, request.start.velocity, request.attitude);
        let mut elapsed_s = 0.0;
        let mut spent = 0.0;
        for (index, arc) in path.arcs().iter().enumerate() {
            let law = if index == 0 { "the plan starts at the start" } else { "the motion is continuous" };
            let begins = state_of(arc, 0.0);
            self.within(law, &at, &begins, difference(&at, &begins), tolerance)?;
            for sample in 0..=self.checks.samples_per_arc {
                let share = f64::from(sample) / f64::from(self.checks.samples_per_arc.max(1));
                self.limits(arc, share * arc.duration_s)?;
                self.free(arc, share * arc.duration_s, elapsed_s)?;
            }
            at = state_of(arc, arc.duration_s);
            elapsed_s += arc.duration_s;
            spent += match request.objective {
                Objective::Duration => arc.duration_s,
                Objective::Impulse => request.belief.parameters().mass * impulse_per_mass(arc),
            };
        }
        let goal = &request.goal;
        let away = (at.0 - goal.position).norm() - goal.radius_m;
        let fast = at.1.norm() - goal.speed_m_s;
        let turned = goal.attitude.map_or(0.0, |attitude| angle_between(&attitude, &at.2));
        let error = away.max(fast).max(turned);
        self.within("the plan ends in the goal region", goal, &at, error, tolerance)?;
        let error = (spent - cost).abs();
        let scale = self.checks.relative_tolerance * spent.max(1.0);
        self.within("the cost is what the plan costs", &spent, &cost, error, scale)
    }

    fn limits(&self, arc: &BodyArc, time_s: f64) -> Result<(), LawViolation> {
        let law = "the motion is inside the limits";
        let limits = &self.case.request.limits;
        let relative = self.checks.relative_tolerance;
        let body = self.case.request.belief.parameters();
        let (state, acceleration) = arc.translation(time_s);
        for axis in 0..3 {
            let coordinate = state.position[axis];
            let outside =
                (limits.position.lower_world[axis] - coordinate).max(coordinate - limits.position.upper_world[axis]);
            self.within(law, &(axis, limits.position), &(time_s, state.position), outside, self.checks.tolerance)?;
            let (limit, speed) = (limits.speed_m_s[axis], state.velocity[axis].abs());
            self.within(law, &(axis, "speed", limit), &(time_s, speed), speed - limit, self.checks.tolerance)?;
            let (limit, force) = (limits.force_n[axis], body.mass * acceleration[axis].abs());
            self.within(law, &(axis, "force", limit), &(time_s, force), force - limit, relative * limit.max(1e-9))?;
        }
        if arc.is_level() {
            return Ok(());
        }
        let (_, rate, rate_of_rate) = arc.turn(time_s);
        let (limit, axis_body) = (limits.rate_rad_s, arc.axis_body.into_inner());
        self.within(law, &("rate", limit), &(time_s, rate), rate.abs() - limit, self.checks.tolerance)?;
        let (w, inertia) = (axis_body * rate, body.inertia_about_com());
        let torque = inertia * axis_body * rate_of_rate + w.cross(&(inertia * w));
        for axis in 0..3 {
            let (limit, torque) = (limits.torque_n_m[axis], torque[axis].abs());
            self.within(law, &(axis, "torque", limit), &(time_s, torque), torque - limit, relative * limit.max(1e-9))?;
        }
        Ok(())
    }

    fn free(&self, arc: &BodyArc, time_s: f64, elapsed_s: f64) -> Result<(), LawViolation> {
        let request = &self.case.request;
        let mission_s = request.start_s + elapsed_s + time_s;
        let clearance = request.world.clearance(request.body, &arc.pose(time_s), mission_s);
        let clearance = clearance.map_err(|error| self.refused(&error))?;
        let error = request.margin_m - clearance.distance_m;
        self.within("the motion is free", &request.margin_m, &(mission_s, clearance), error, self.checks.tolerance)
    }
}

type Moment = (Vector3<f64>, Vector3<f64>, UnitQuaternion<f64>);

fn state_of(arc: &BodyArc, time_s: f64) -> Moment {
    let state = arc.translation(time_s).0;
    (state.position, state.velocity, arc.attitude_at(time_s))
}

fn angle_between(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    // twice the chord: accurate for small angles, unlike the arc cosine
    let chord = (a.coords - b.coords).norm().min((a.coords + b.coords).norm());
    2.0 * chord
}

fn difference(a: &Moment, b: &Moment) -> f64 {
    (a.0 - b.0).amax().max((a.1 - b.1).amax()).max(angle_between(&a.2, &b.2))
}

/// The integral of the sum of the absolute accelerations, by Simpson's rule on 512 parts; exact where they are constant.
fn impulse_per_mass(arc: &BodyArc) -> f64 {
    const PARTS: u32 = 512;
    let size = |step: u32| arc.translation(arc.duration_s * f64::from(step) / f64::from(PARTS)).1.abs().sum();
    let weight = |step: u32| match step {
        0 | PARTS => 1.0,
        odd if odd % 2 == 1 => 4.0,
        _ => 2.0,
    };
    (0..=PARTS).map(|step| weight(step) * size(step)).sum::<f64>() * arc.duration_s / (3.0 * f64::from(PARTS))
}
