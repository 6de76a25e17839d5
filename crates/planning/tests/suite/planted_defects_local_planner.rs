//! Every law of local planners holds for a sound planner and catches a deliberately broken one, by name.

use crate::cart;
use crate::cart::{Patient, Slide};
use core::cell::Cell;
use tumble_planning::dynamics::{AlignedBox, InertialParameters, World};
use tumble_planning::laws::{LawViolation, LocalCase, LocalChecks, LocalExpectation, check_local_planner};
use tumble_planning::local::{
    Criterion, Guess, Hull, LocalAnswer, LocalPlanner, LocalRequest, LocalSettings, LocalStatus, Reference,
    SpeedLimits, Surroundings, TerminalRegion, WrenchSet,
};
use tumble_planning::nalgebra::{Matrix3, SMatrix, Vector3};
use tumble_planning::{Budget, ModelBelief, PlanningError, Units};

const CHECKS: LocalChecks =
    LocalChecks { samples_per_step: 32, tolerance: 1e-9, relative_tolerance: 1e-9, cost_tolerance: 1e-7 };
const STEPS: usize = 5;

fn settings() -> LocalSettings<2, 1> {
    LocalSettings {
        steps: STEPS,
        step_s: 1.0,
        tracking: [20.0, 0.5],
        terminal: [20.0, 0.5],
        effort: [1.0],
        acceleration: [0.2, 0.0],
        wrench: WrenchSet { limit: [0.4], half_spaces: vec![([1.0], 0.36)] },
        speed: SpeedLimits { speed_m_s: Vector3::repeat(0.14), rate_rad_s: Vector3::repeat(f64::INFINITY) },
        measurement: SMatrix::from_diagonal_element(400.0),
        retained: [1.0; 2],
        criterion: Criterion::A,
        margin_m: 0.01,
        length_scale_m: 1.0,
        on_segments: true,
        tolerance: 1e-3,
        iterations: 200,
    }
}

/// A box on the rail from 0.6 m on.
fn stop() -> Surroundings {
    let solid = AlignedBox::between(Vector3::new(0.6, -1.0, -1.0), Vector3::new(2.0, 1.0, 1.0));
    let world = World { keep_out: vec![solid], ..World::default() };
    Surroundings::of_world(&world, Hull::Point).unwrap()
}

fn belief() -> ModelBelief {
    let parameters = InertialParameters::about_origin(3.0, Vector3::zeros(), Matrix3::identity() * 0.1);
    let mut belief = ModelBelief::certain(7, parameters);
    belief.estimate.covariance[(0, 0)] = 0.25;
    belief
}

fn region(x_m: f64) -> TerminalRegion {
    TerminalRegion { position_world: Vector3::new(x_m, 0.0, 0.0), radius_m: 0.3, speed_m_s: 0.05 }
}

type Case<'a> = LocalCase<'a, Slide, 2, 1, 1>;
const IMPOSSIBLE: [Slide; 2] = [Slide { x_m: f64::NAN, speed_m_s: 0.0 }, Slide { x_m: 0.0, speed_m_s: f64::INFINITY }];

fn case<'a>(start: &'a Slide, goal: &'a Slide, belief: &'a ModelBelief, surroundings: &'a Surroundings) -> Case<'a> {
    LocalCase {
        settings: settings(),
        request: LocalRequest {
            start,
            start_s: 5.0,
            reference: Reference::Hold(goal),
            terminal: None,
            belief,
            information: [10.0],
            reserved: [0.0],
            surroundings,
            guess: Guess::Excited,
        },
        expectation: LocalExpectation::Solvable,
        units: 40_000,
        impossible: &IMPOSSIBLE,
    }
}

/// From 0.25 m towards 0.7 m, where the box is; the same with a region to end in, and with one that cannot be reached; too fast;
/// and staying where it is.
fn judged<L: LocalPlanner<1, 1, State = Slide>>(
    planner: &dyn Fn(&LocalSettings<2, 1>) -> Result<L, PlanningError>,
) -> Result<(), LawViolation> {
    let (start, goal, belief, surroundings) = (Slide::at(0.25), Slide::at(0.7), belief(), stop());
    let plain = case(&start, &goal, &belief, &surroundings);
    let mut ending = plain.clone();
    ending.request.terminal = Some(region(0.2));
    ending.request.reserved = [0.05];
    let mut lost = plain.clone();
    lost.request.terminal = Some(region(1.3));
    lost.expectation = LocalExpectation::Unsolvable;
    // can stop before the next node, but not before the box
    let fast = Slide { x_m: 0.556, speed_m_s: 0.1 };
    let mut late = case(&fast, &goal, &belief, &surroundings);
    late.expectation = LocalExpectation::Unknown;
    let still = case(&start, &start, &belief, &surroundings);
    let cart = cart::Cart { mass_kg: 1.0 };
    check_local_planner(&cart, planner, &[plain, ending, lost, late, still], &CHECKS)
}

#[test]
fn a_sound_planner_keeps_every_law() {
    judged(&Patient::try_new).unwrap();
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Refuses,
    Overspends,
    AsksOn,
    Remembers,
    ClaimsOptimum,
    CostWithoutPlan,
    GivesUp,
    DropsRegion,
    SpoiltByWork,
    OldRevision,
    TooFewCovariances,
    StartsElsewhere,
    HeavierBody,
    TooStrong,
    TakesAll,
    NoHalfSpaces,
    TooFast,
    EndsElsewhere,
    Blind,
    BlindBetween,
    NoMargin,
    Optimistic,
    OptimisticOnTheWay,
    WrongInformationCost,
    WrongTracking,
    WorsensGuess,
    WeighsBackwards,
    TakesAnySettings,
    Careless,
}

/// A sound planner with a fault.
struct Faulty {
    sound: Patient,
    fault: Fault,
    asked: Cell<u32>,
}

impl Faulty {
    fn try_new(fault: Fault, settings: &LocalSettings<2, 1>) -> Result<Self, PlanningError> {
        let mut changed = settings.clone();
        match fault {
            Fault::TooStrong => changed.wrench = WrenchSet { limit: [0.6], half_spaces: Vec::new() },
            Fault::NoHalfSpaces => changed.wrench.half_spaces.clear(),
            Fault::TooFast => changed.speed.speed_m_s *= 1.05,
            Fault::BlindBetween => changed.on_segments = false,
            Fault::NoMargin => changed.margin_m = 0.0,
            _ => {}
        }
        let sound = if fault == Fault::TakesAnySettings {
            Patient { settings: changed, ..Patient::try_new(&self::settings())? }
        } else {
            Patient::try_new(settings)?;
            Patient::try_new(&changed)?
        };
        Ok(Self { sound: Patient { careless: fault == Fault::Careless, ..sound }, fault, asked: Cell::new(0) })
    }

    /// The plan of the sound planner for other inputs: as it would be if they were the best.
    fn instead(
        &self,
        request: &LocalRequest<'_, Slide, 1, 1>,
        inputs: &[[f64; 1]],
    ) -> Result<LocalAnswer<Slide, 1, 1>, PlanningError> {
        let request = LocalRequest { guess: Guess::Inputs(inputs), ..request.clone() };
        self.sound.clone().plan(&request, &mut Units::new(0))
    }
}

struct Generous<'a>(&'a mut dyn Budget);

impl Budget for Generous<'_> {
    fn spend(&mut self, units: u64) -> bool {
        for _ in 0..50 {
            if self.0.spend(units) {
                return true;
            }
        }
        false
    }
}

impl LocalPlanner<1, 1> for Faulty {
    type State = Slide;

    fn plan(
        &mut self,
        request: &LocalRequest<'_, Slide, 1, 1>,
        budget: &mut dyn Budget,
    ) -> Result<LocalAnswer<Slide, 1, 1>, PlanningError> {
        let fault = self.fault;
        let mut changed = request.clone();
        let mut other = request.belief.clone();
        let nothing = Surroundings::none();
        match fault {
            Fault::Refuses => return Err(PlanningError::Unsupported { query: "plan" }),
            Fault::DropsRegion if request.terminal == Some(region(1.3)) => changed.terminal = None,
            Fault::EndsElsewhere if request.terminal == Some(region(0.2)) => {
                changed.terminal = Some(TerminalRegion { radius_m: 0.35, ..region(0.2) });
            }
            Fault::TakesAll if (0.0..1.0).contains(&request.reserved[0]) => changed.reserved = [0.0],
            Fault::Blind => changed.surroundings = &nothing,
            Fault::HeavierBody => {
                other.estimate.parameters.mass *= 1.01;
                changed.belief = &other;
            }
            Fault::WeighsBackwards if request.information[0].is_finite() && request.information[0] >= 0.0 => {
                changed.information = [100.0 / request.information[0].max(0.1)];
            }
            _ => {}
        }
        let mut answer = match fault {
            Fault::AsksOn => self.sound.plan(&changed, &mut Generous(budget))?,
            _ => self.sound.plan(&changed, budget)?,
        };
        self.asked.set(self.asked.get() + 1);
        match fault {
            Fault::Overspends => answer.units += 1,
            Fault::Remembers if self.asked.get() > 2 => answer.optimality *= 0.5,
            Fault::ClaimsOptimum if answer.status == LocalStatus::Feasible => answer.status = LocalStatus::Converged,
            Fault::CostWithoutPlan => {
                answer.status = LocalStatus::Infeasible { violation: 1.0, blocker: None };
            }
            Fault::GivesUp => {
                (answer.plan, answer.cost) = (None, None);
                answer.status = LocalStatus::Infeasible { violation: 1.0, blocker: None };
            }
            Fault::SpoiltByWork if answer.units > 1000 => {
                let first = self.sound.plan(request, &mut Units::new(200))?;
                answer = LocalAnswer { units: answer.units, ..first };
            }
            Fault::WorsensGuess if matches!(request.guess, Guess::Near(_)) => {
                if let Some(plan) = &answer.plan {
                    let inputs: Vec<[f64; 1]> = plan.trajectory.inputs.iter().map(|u| [0.9 * u[0]]).collect();
                    answer = LocalAnswer { units: answer.units, ..self.instead(request, &inputs)? };
                }
            }
            _ => {}
        }
        if let (Some(plan), Some(cost)) = (&mut answer.plan, &mut answer.cost) {
            let trajectory = &mut plan.trajectory;
            match fault {
                Fault::OldRevision => plan.model_revision = 7,
                Fault::TooFewCovariances => _ = trajectory.covariances.pop(),
                Fault::StartsElsewhere => trajectory.states[0].x_m += 1e-6,
                Fault::Optimistic => trajectory.gathered *= 1.01,
                Fault::OptimisticOnTheWay => trajectory.covariances[STEPS / 2] *= 0.99,
                Fault::WrongInformationCost => cost.information *= 0.99,
                Fault::WrongTracking => cost.tracking *= 0.99,
                _ => {}
            }
        }
        Ok(answer)
    }
}

#[test]
fn every_fault_is_caught_by_its_law() {
    let faults = [
        (Fault::Refuses, "well-posed requests are answered"),
        (Fault::Overspends, "the budget is respected"),
        (Fault::AsksOn, "a refusal ends the work"),
        (Fault::Remembers, "the same request has the same answer"),
        (Fault::ClaimsOptimum, "a plan comes with its status"),
        (Fault::CostWithoutPlan, "a plan comes with its status"),
        (Fault::GivesUp, "a solvable problem is solved"),
        (Fault::DropsRegion, "an unsolvable problem is never solved"),
        (Fault::SpoiltByWork, "more work never costs more"),
        (Fault::OldRevision, "the plan names its belief"),
        (Fault::TooFewCovariances, "the plan has its shape"),
        (Fault::StartsElsewhere, "the plan starts at the start"),
        (Fault::HeavierBody, "states follow from the inputs"),
        (Fault::TooStrong, "inputs are inside the limits"),
        (Fault::TakesAll, "inputs are inside the limits"),
        (Fault::NoHalfSpaces, "inputs are inside the limits"),
        (Fault::TooFast, "speeds are inside the limits"),
        (Fault::EndsElsewhere, "the plan ends in its region"),
        (Fault::Blind, "the motion is free"),
        (Fault::BlindBetween, "the motion is free"),
        (Fault::NoMargin, "the motion is free"),
        (Fault::Optimistic, "information follows from the inputs"),
        (Fault::OptimisticOnTheWay, "covariances follow from the information"),
        (Fault::WrongInformationCost, "the cost is what the plan costs"),
        (Fault::WrongTracking, "the cost is what the plan costs"),
        (Fault::WorsensGuess, "a plan is no worse than its guess"),
        (Fault::WeighsBackwards, "more weight never tells less"),
        (Fault::TakesAnySettings, "absurd settings are refused"),
        (Fault::Careless, "absurd requests are refused"),
    ];
    let mut missed = Vec::new();
    for (fault, law) in faults {
        let outcome = judged(&|settings| Faulty::try_new(fault, settings));
        let caught = outcome.err().map(|violation| violation.to_string()).unwrap_or_default();
        if !caught.contains(&format!("'{law}'")) {
            missed.push(format!("{fault:?}, {law}: {caught}"));
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
}
