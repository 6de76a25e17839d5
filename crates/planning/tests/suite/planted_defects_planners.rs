//! Every law of state spaces, models and planners catches a deliberately broken implementation, by name.

use crate::round_world::RoundWorld;
use core::cell::Cell;
use tumble_planning::collision::Blocker;
use tumble_planning::dynamics::{AlignedBox, InertialParameters};
use tumble_planning::global::{
    EdgeCheck, GlobalAnswer, GlobalPlanner, GlobalRequest, GoalRegion, MotionLimits, Objective, Obstruction,
    PrimitiveRrt, PrimitiveRrtSettings, Status, Until,
};
use tumble_planning::laws::{
    Expectation, LawViolation, PlannerCase, PlannerChecks, check_body_motion, check_global_planner,
    check_kinodynamic_model, check_state_space,
};
use tumble_planning::nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_planning::rand_core::Rng;
use tumble_planning::{
    ArcPath, BodyArc, BodyMotion, Budget, DoubleIntegrator, KinodynamicModel, ModelBelief, PlanningError, Primitive,
    Propagation, StateSpace, TranslationState,
};

fn law_of(outcome: Result<(), LawViolation>) -> &'static str {
    outcome.expect_err("the planted defect was not caught").law
}

fn body(mass_kg: f64) -> InertialParameters<f64> {
    InertialParameters::about_origin(mass_kg, Vector3::zeros(), Matrix3::identity() * 0.1)
}

fn cube() -> AlignedBox {
    AlignedBox::between(Vector3::repeat(-1.0), Vector3::repeat(1.0))
}

fn integrator() -> DoubleIntegrator {
    DoubleIntegrator::try_new(cube(), Vector3::repeat(0.1), Vector3::repeat(0.2), 2.0, Propagation::Exact).unwrap()
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    SampleOutside,
    SampleByItself,
    SampleConstant,
    DistanceSquared,
    DistanceOneWay,
    DistanceNegative,
    DistanceToItself,
    InterpolationStops,
    InterpolationDetours,
    DriftAtRest,
    ForgetsVelocity,
    TooStrong,
    NoTime,
    NoPrimitives,
    ArcElsewhere,
    ArcBegins,
    ContainsAllArcs,
    StateElsewhere,
}

/// The double integrator with a fault.
#[derive(Clone, Debug)]
struct Faulty {
    sound: DoubleIntegrator,
    fault: Fault,
    primitives: Vec<Primitive<Vector3<f64>>>,
    drawn: Cell<u32>,
}

impl Faulty {
    fn new(fault: Fault) -> Self {
        let sound = integrator();
        let mut primitives = sound.primitives().to_vec();
        match fault {
            Fault::TooStrong => primitives[0].input *= 1.001,
            Fault::NoTime => primitives[0].duration_s = 0.0,
            Fault::NoPrimitives => primitives.clear(),
            _ => {}
        }
        Self { sound, fault, primitives, drawn: Cell::new(0) }
    }
}

impl StateSpace for Faulty {
    type State = TranslationState;
    fn distance(&self, from: &TranslationState, to: &TranslationState) -> f64 {
        let distance = self.sound.distance(from, to);
        match self.fault {
            Fault::DistanceSquared => distance * distance,
            Fault::DistanceOneWay => distance * if from.position.x < to.position.x { 1.01 } else { 1.0 },
            Fault::DistanceNegative => -distance,
            Fault::DistanceToItself => distance + 1e-3,
            _ => distance,
        }
    }
    fn interpolate(&self, from: &TranslationState, to: &TranslationState, fraction: f64) -> TranslationState {
        let fraction = match self.fault {
            Fault::InterpolationStops => fraction * 0.999,
            Fault::InterpolationDetours => fraction * fraction,
            _ => fraction,
        };
        self.sound.interpolate(from, to, fraction)
    }
    fn contains(&self, state: &TranslationState) -> bool {
        self.sound.contains(state)
    }
    fn sample(&self, rng: &mut dyn Rng) -> TranslationState {
        let mut state = self.sound.sample(rng);
        match self.fault {
            Fault::SampleOutside => state.velocity *= 1.5,
            Fault::SampleByItself => {
                self.drawn.set(self.drawn.get() + 1);
                state.position.x *= 1.0 / (1.0 + f64::from(self.drawn.get()));
            }
            Fault::SampleConstant => state = TranslationState::at_rest(Vector3::zeros()),
            _ => {}
        }
        state
    }
}

impl KinodynamicModel for Faulty {
    type Input = Vector3<f64>;
    type Parameters = InertialParameters<f64>;
    fn propagate(
        &self,
        state: &TranslationState,
        input: &Vector3<f64>,
        parameters: &InertialParameters<f64>,
        duration_s: f64,
    ) -> TranslationState {
        let mut end = self.sound.propagate(state, input, parameters, duration_s);
        match self.fault {
            Fault::ForgetsVelocity => end.position -= state.velocity * (0.01 * duration_s * duration_s),
            Fault::DriftAtRest => end.position.x += 1e-6,
            _ => {}
        }
        end
    }
    fn primitives(&self) -> &[Primitive<Vector3<f64>>] {
        &self.primitives
    }
}

impl BodyMotion for Faulty {
    fn within(&self, _: &MotionLimits, _: &UnitQuaternion<f64>) -> Result<Self, PlanningError> {
        Ok(self.clone())
    }
    fn state_at(&self, translation: &TranslationState) -> TranslationState {
        let mut state = *translation;
        if self.fault == Fault::StateElsewhere {
            state.velocity *= 0.5;
        }
        state
    }
    fn translation(&self, state: &TranslationState) -> TranslationState {
        *state
    }
    fn arc(
        &self,
        state: &TranslationState,
        input: &Vector3<f64>,
        parameters: &InertialParameters<f64>,
        duration_s: f64,
    ) -> BodyArc {
        let mut arc = self.sound.arc(state, input, parameters, duration_s);
        match self.fault {
            Fault::ArcElsewhere => arc.position[2] *= 1.001,
            Fault::ArcBegins => arc.position[0].z += 1e-3,
            _ => {}
        }
        arc
    }
    fn contains_arc(&self, arc: &BodyArc) -> bool {
        self.fault == Fault::ContainsAllArcs || self.sound.contains_arc(arc)
    }
}

#[test]
fn sound_models_keep_the_laws() {
    let limit = |force: &Vector3<f64>| force.amax() - 0.2;
    let euler = Propagation::Euler { step_s: 0.05 };
    let euler = DoubleIntegrator::try_new(cube(), Vector3::repeat(0.1), Vector3::repeat(0.2), 2.0, euler).unwrap();
    check_state_space(&integrator(), 1, 200, 1e-12).unwrap();
    for model in [&integrator(), &euler] {
        check_kinodynamic_model(model, &body(9.0), &limit, (1, 50), 4, 1e-13).unwrap();
    }
    check_body_motion(&integrator(), &body(9.0), (1, 50), 8, 1e-13).unwrap();
    // of Euler's motion the velocity is his only to within a step
    let violation = check_body_motion(&euler, &body(9.0), (1, 50), 8, 1e-13);
    assert_eq!(law_of(violation), "the motion goes where the model goes");
    // they can be used as objects
    let object: &dyn KinodynamicModel<State = TranslationState, Input = Vector3<f64>, Parameters = InertialParameters<f64>> =
        &integrator();
    check_kinodynamic_model(object, &body(9.0), &limit, (2, 10), 4, 1e-13).unwrap();
    check_state_space(object, 2, 10, 1e-12).unwrap();
}

#[test]
fn defects_of_state_spaces_are_caught_by_name() {
    for (fault, law) in [
        (Fault::SampleOutside, "samples are contained"),
        (Fault::SampleByItself, "the same chance gives the same sample"),
        (Fault::SampleConstant, "samples differ"),
        (Fault::DistanceSquared, "the triangle inequality"),
        (Fault::DistanceOneWay, "distances are symmetric"),
        (Fault::DistanceNegative, "distances are not negative"),
        (Fault::DistanceToItself, "a state is at no distance from itself"),
        (Fault::InterpolationStops, "interpolation has its ends"),
        (Fault::InterpolationDetours, "interpolation goes from one to the other"),
    ] {
        let outcome = check_state_space(&Faulty::new(fault), 1, 100, 1e-12);
        assert_eq!(law_of(outcome), law, "{fault:?}");
    }
}

#[test]
fn defects_of_models_are_caught_by_name() {
    let limit = |force: &Vector3<f64>| force.amax() - 0.2;
    for (fault, law) in [
        (Fault::NoPrimitives, "there are primitives"),
        (Fault::NoTime, "primitives take time"),
        (Fault::TooStrong, "primitives are inside the limits"),
        (Fault::DriftAtRest, "no time changes nothing"),
        (Fault::ForgetsVelocity, "propagation composes in time"),
    ] {
        let outcome = check_kinodynamic_model(&Faulty::new(fault), &body(9.0), &limit, (1, 20), 4, 1e-9);
        assert_eq!(law_of(outcome), law, "{fault:?}");
    }
    for (fault, law) in [
        (Fault::StateElsewhere, "a state is its translation"),
        (Fault::ArcBegins, "the motion begins at the state"),
        (Fault::ArcElsewhere, "the motion goes where the model goes"),
        (Fault::ContainsAllArcs, "a motion inside has its states inside"),
    ] {
        let outcome = check_body_motion(&Faulty::new(fault), &body(9.0), (1, 50), 4, 1e-9);
        assert_eq!(law_of(outcome), law, "{fault:?}");
    }
}

fn settings(edge_check: EdgeCheck) -> PrimitiveRrtSettings {
    PrimitiveRrtSettings {
        goal_bias: 0.05,
        iterations: 10_000,
        position_weight: 1.0,
        velocity_weight: 0.01,
        goal_tolerance: 0.2,
        edge_check,
    }
}

/// A ball between start and goal; with `enclosed` a shell of balls around the goal.
fn world(enclosed: bool) -> RoundWorld {
    let mut balls = vec![(Vector3::new(0.0, 0.0, 0.1), 0.3)];
    if enclosed {
        let goal = Vector3::new(0.7, 0.0, 0.0);
        for (x, y, z) in [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)] {
            balls.push((goal + Vector3::new(f64::from(x), f64::from(y), f64::from(z)) * 0.45, 0.42));
        }
    }
    RoundWorld { balls }
}

fn request<'a>(world: &'a RoundWorld, belief: &'a ModelBelief, objective: Objective) -> GlobalRequest<'a, RoundWorld> {
    GlobalRequest {
        world,
        body: &0.1,
        start: TranslationState::at_rest(Vector3::new(-0.7, 0.0, 0.0)),
        attitude: UnitQuaternion::from_euler_angles(0.1, -0.2, 0.3),
        start_s: 5.0,
        goal: GoalRegion { position: Vector3::new(0.7, 0.0, 0.0), radius_m: 0.2, speed_m_s: 0.2, attitude: None },
        limits: MotionLimits {
            position: cube(),
            speed_m_s: Vector3::repeat(0.1),
            force_n: Vector3::repeat(0.2),
            torque_n_m: Vector3::repeat(0.01),
            rate_rad_s: 0.1,
        },
        belief,
        objective,
        margin_m: 0.01,
        until: Until::FirstPlan,
        seed: 7,
    }
}

const SEEDS: u64 = 12;
const CHECKS: PlannerChecks = PlannerChecks { samples_per_arc: 40, tolerance: 1e-9, relative_tolerance: 1e-9 };

/// What is done to a sound planner's answer.
type Tamper = fn(&GlobalRequest<'_, RoundWorld>, &mut GlobalAnswer, &mut dyn Budget);

struct Tampered {
    edge_check: EdgeCheck,
    tamper: Tamper,
}

impl GlobalPlanner<RoundWorld> for Tampered {
    fn plan(
        &mut self,
        request: &GlobalRequest<'_, RoundWorld>,
        budget: &mut dyn Budget,
    ) -> Result<GlobalAnswer, PlanningError> {
        let mut answer = PrimitiveRrt::try_new(integrator(), settings(self.edge_check))?.plan(request, budget)?;
        (self.tamper)(request, &mut answer, budget);
        Ok(answer)
    }
}

fn check(edge_check: EdgeCheck, tamper: Tamper, objective: Objective, enclosed: bool) -> Result<(), LawViolation> {
    let world = world(enclosed);
    let belief = ModelBelief::certain(3, body(9.0));
    let expectation = if enclosed { Expectation::Unsolvable } else { Expectation::Solvable };
    let units = if enclosed { 3_000 } else { 100_000 };
    let cases = (0..SEEDS).map(|seed| {
        let request = GlobalRequest { seed, ..request(&world, &belief, objective) };
        PlannerCase { request, expectation, units }
    });
    check_global_planner(&|| Tampered { edge_check, tamper }, &cases.collect::<Vec<_>>(), &CHECKS)
}

/// Replaces the arcs of the plan, if there is one.
fn change(answer: &mut GlobalAnswer, change: impl FnOnce(&mut Vec<BodyArc>)) {
    if let Some(plan) = &mut answer.plan {
        let mut arcs = plan.trajectory.arcs().to_vec();
        change(&mut arcs);
        plan.trajectory = ArcPath::new(arcs);
    }
}

#[test]
fn the_planner_of_primitives_keeps_the_laws() {
    for objective in [Objective::Duration, Objective::Impulse] {
        check(EdgeCheck::Continuous, |_, _, _| {}, objective, false).unwrap();
        check(EdgeCheck::Continuous, |_, _, _| {}, objective, true).unwrap();
    }
}

#[test]
fn edges_checked_at_their_ends_only_are_caught() {
    let law = law_of(check(EdgeCheck::EndState, |_, _, _| {}, Objective::Duration, false));
    assert!(["the motion is free", "the motion is inside the limits"].contains(&law), "{law}");
}

thread_local! {
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

#[test]
fn defects_of_answers_are_caught_by_name() {
    let defects: [(&str, Tamper); 20] = [
        ("the budget is respected", |_, answer, _| answer.units -= 1),
        ("a refusal ends the work", |_, answer, budget| {
            while budget.spend(1) {
                answer.units += 1;
            }
            for _ in 0..100 {
                budget.spend(1);
            }
        }),
        ("the same request has the same answer", |_, answer, _| {
            CALLS.set(CALLS.get() + 1);
            if let Some(edge) = answer.tree.first_mut() {
                edge[0].x = CALLS.get() as f64;
            }
        }),
        ("a plan comes with its status", |_, answer, _| answer.status = Status::BudgetSpent(vec![])),
        ("a plan comes with its status", |_, answer, _| answer.plan = None),
        ("a solvable problem is never called infeasible", |_, answer, _| {
            let blockers = vec![Blocker::Obstacle(0)];
            *answer = GlobalAnswer {
                status: Status::Infeasible(Obstruction::Enclosed { blockers }),
                plan: None,
                cost: f64::INFINITY,
                lower_bound: f64::INFINITY,
                history: vec![],
                ..answer.clone()
            };
        }),
        ("costs fall from plan to plan", |_, answer, _| answer.history.insert(0, answer.history[0])),
        ("costs fall from plan to plan", |_, answer, _| answer.history.clear()),
        ("the bound is never above the cost", |_, answer, _| answer.lower_bound = answer.cost * 1.001),
        ("the bound is never above the cost", |_, answer, _| answer.lower_bound = f64::NAN),
        ("what is optimal meets its bound", |_, answer, _| answer.status = Status::Optimal),
        ("the plan names its belief", |_, answer, _| {
            answer.plan.iter_mut().for_each(|plan| plan.model_revision = 2);
        }),
        ("the plan starts at the start", |_, answer, _| {
            change(answer, |arcs| {
                arcs.remove(0);
            });
        }),
        ("the plan starts at the start", |_, answer, _| {
            change(answer, |arcs| arcs.iter_mut().for_each(|arc| arc.attitude = UnitQuaternion::identity()));
        }),
        ("the plan ends in the goal region", |_, answer, _| {
            change(answer, |arcs| {
                arcs.pop();
            });
        }),
        ("the motion is continuous", |_, answer, _| {
            change(answer, |arcs| {
                arcs.remove(3);
            });
        }),
        ("the motion is inside the limits", |_, answer, _| {
            // the same path, faster
            change(answer, |arcs| {
                for arc in arcs {
                    arc.duration_s /= 1.5;
                    arc.position[1] *= 1.5;
                    arc.position[2] *= 1.5 * 1.5;
                }
            });
        }),
        ("the motion is inside the limits", |_, answer, _| {
            let spin = [0.0, 0.2, 0.0, 0.0, 0.0, 0.0];
            change(answer, |arcs| arcs[0] = arcs[0].turning(Vector3::z_axis(), spin));
        }),
        ("the motion is inside the limits", |_, answer, _| {
            let jerk = [0.0, 0.0, 0.09, 0.0, 0.0, 0.0];
            change(answer, |arcs| arcs[0] = arcs[0].turning(Vector3::z_axis(), jerk));
        }),
        ("the cost is what the plan costs", |_, answer, _| {
            answer.cost *= 0.999;
            answer.history[0].cost = answer.cost;
        }),
    ];
    for (index, (law, tamper)) in defects.into_iter().enumerate() {
        let found = law_of(check(EdgeCheck::Continuous, tamper, Objective::Duration, false));
        assert_eq!(found, law, "defect {index}");
    }
    // a plan for the duration, passed off as one for the impulse
    let swapped: Tamper = |_, answer, _| {
        let duration_s = answer.plan.as_ref().map_or(0.0, |plan| plan.trajectory.duration_s());
        answer.cost = duration_s;
        answer.history[0].cost = duration_s;
    };
    let found = law_of(check(EdgeCheck::Continuous, swapped, Objective::Impulse, false));
    assert_eq!(found, "the cost is what the plan costs");
}

/// A planner that sees no obstacles.
#[test]
fn flying_through_is_caught() {
    struct Blind;
    impl GlobalPlanner<RoundWorld> for Blind {
        fn plan(
            &mut self,
            request: &GlobalRequest<'_, RoundWorld>,
            budget: &mut dyn Budget,
        ) -> Result<GlobalAnswer, PlanningError> {
            let empty = RoundWorld::default();
            let blind = GlobalRequest { world: &empty, ..*request };
            PrimitiveRrt::try_new(integrator(), settings(EdgeCheck::Continuous))?.plan(&blind, budget)
        }
    }
    let belief = ModelBelief::certain(3, body(9.0));
    for (enclosed, law) in [(false, "the motion is free"), (true, "an enclosed goal is never solved")] {
        let world = world(enclosed);
        let expectation = if enclosed { Expectation::Unsolvable } else { Expectation::Solvable };
        let cases = (0..SEEDS).map(|seed| {
            let request = GlobalRequest { seed, ..request(&world, &belief, Objective::Duration) };
            PlannerCase { request, expectation, units: 100_000 }
        });
        assert_eq!(law_of(check_global_planner(&|| Blind, &cases.collect::<Vec<_>>(), &CHECKS)), law);
    }
}

/// A planner that remembers the mass it was made with.
#[test]
fn a_forgotten_belief_is_caught() {
    struct Stale;
    impl GlobalPlanner<RoundWorld> for Stale {
        fn plan(
            &mut self,
            request: &GlobalRequest<'_, RoundWorld>,
            budget: &mut dyn Budget,
        ) -> Result<GlobalAnswer, PlanningError> {
            let stale = ModelBelief::certain(request.belief.revision, body(8.0));
            let request = GlobalRequest { belief: &stale, ..*request };
            PrimitiveRrt::try_new(integrator(), settings(EdgeCheck::Continuous))?.plan(&request, budget)
        }
    }
    let (world, belief) = (world(false), ModelBelief::certain(3, body(9.0)));
    let case = PlannerCase {
        request: request(&world, &belief, Objective::Duration),
        expectation: Expectation::Solvable,
        units: 100_000,
    };
    assert_eq!(law_of(check_global_planner(&|| Stale, &[case], &CHECKS)), "the motion is inside the limits");
}

/// A planner whose plans get worse when it may work longer.
#[test]
fn a_planner_spoilt_by_work_is_caught() {
    struct Spoilt;
    impl GlobalPlanner<RoundWorld> for Spoilt {
        fn plan(
            &mut self,
            request: &GlobalRequest<'_, RoundWorld>,
            budget: &mut dyn Budget,
        ) -> Result<GlobalAnswer, PlanningError> {
            let mut answer =
                PrimitiveRrt::try_new(integrator(), settings(EdgeCheck::Continuous))?.plan(request, budget)?;
            // loiters at the goal as long as it is allowed to
            let rest_s = if budget.spend(60_000) { 10.0 } else { 0.0 };
            answer.units += if rest_s > 0.0 { 60_000 } else { 0 };
            change(&mut answer, |arcs| {
                let start = TranslationState::at_rest(request.start.position);
                arcs.insert(0, BodyArc::accelerated(rest_s, &start, Vector3::zeros(), request.attitude));
            });
            answer.cost += rest_s;
            answer.history.iter_mut().for_each(|improvement| improvement.cost += rest_s);
            Ok(answer)
        }
    }
    let (world, belief) = (world(false), ModelBelief::certain(3, body(9.0)));
    let case = PlannerCase {
        request: request(&world, &belief, Objective::Duration),
        expectation: Expectation::Solvable,
        units: 100_000,
    };
    assert_eq!(law_of(check_global_planner(&|| Spoilt, &[case], &CHECKS)), "more work never costs more");
}

/// An ill-posed request is an error; a planner that errs on a good one is not.
#[test]
fn refusing_a_good_request_is_caught() {
    struct Refuses;
    impl GlobalPlanner<RoundWorld> for Refuses {
        fn plan(
            &mut self,
            _: &GlobalRequest<'_, RoundWorld>,
            _: &mut dyn Budget,
        ) -> Result<GlobalAnswer, PlanningError> {
            Err(PlanningError::Unsupported { query: "plan" })
        }
    }
    let (world, belief) = (world(false), ModelBelief::certain(3, body(9.0)));
    let case = PlannerCase {
        request: request(&world, &belief, Objective::Duration),
        expectation: Expectation::Unknown,
        units: 10,
    };
    assert_eq!(law_of(check_global_planner(&|| Refuses, &[case], &CHECKS)), "well-posed requests are answered");
}
