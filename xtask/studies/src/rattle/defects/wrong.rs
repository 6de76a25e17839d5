//! Layers that do what the research code did, around ours.

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Vector3;
use tumble_dynamics::InertialParameters;
use tumble_identification::Estimate;
use tumble_lie::Pose;
use tumble_planning::collision::{BodyShape, Clearance, CollisionWorld, Contact, EllipsoidWorld};
use tumble_planning::control::{
    Adoption, ControlCommand, ControlRequest, Controller, OriginalTubeController, TubeController,
};
use tumble_planning::global::{FlightPlanner, GlobalAnswer, GlobalPlanner, GlobalRequest};
use tumble_planning::local::Surroundings;
use tumble_planning::mission::{StretchOutcome, StretchPlanner, StretchTask};
use tumble_planning::{BodyArc, Budget, ModelBelief, PlanningError};

use super::Defect;

/// When the parameters are set back, s.
pub const RESET_S: f64 = 40.0;

/// Who is told of a belief.
#[derive(Clone, Copy, PartialEq)]
pub enum Who {
    Way,
    Stretch,
    Controller,
}

/// What stands between the belief and those who use it.
pub struct Teller {
    pub defect: Defect,
    pub prior: Estimate,
    pub time_s: Mutex<f64>,
    /// What another filter says.
    pub filtered: Mutex<Option<Estimate>>,
}

/// What is in a cell that the loop and its layers share.
pub fn read<T: Copy>(cell: &Mutex<T>) -> T {
    *cell.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Puts something else into it.
pub fn write<T>(cell: &Mutex<T>, value: T) {
    *cell.lock().unwrap_or_else(PoisonError::into_inner) = value;
}

impl Teller {
    /// The belief as it arrives.
    pub fn told(&self, who: Who, belief: &ModelBelief) -> ModelBelief {
        let Estimate { parameters, .. } = belief.estimate;
        let (center, inertia) = (parameters.center_of_mass(), parameters.inertia_about_com());
        let with = |parameters: InertialParameters<f64>| Estimate { parameters, ..belief.estimate };
        let estimate = match self.defect {
            Defect::NothingAccumulated if who == Who::Stretch => Estimate { parameters, ..self.prior },
            Defect::CenterLeftOut => {
                let center: Vector3<f64> = self.prior.parameters.center_of_mass();
                with(InertialParameters::about_com(parameters.mass, center, inertia))
            }
            Defect::FirstBodyKept if who == Who::Controller => self.prior,
            Defect::IxxForIzz if who == Who::Stretch => {
                let mut copied = inertia;
                copied[(2, 2)] = inertia[(0, 0)];
                with(InertialParameters::about_com(parameters.mass, center, copied))
            }
            Defect::Reset | Defect::ResetAnew if read(&self.time_s) >= RESET_S => self.prior,
            _ => read(&self.filtered).unwrap_or(belief.estimate),
        };
        ModelBelief { revision: belief.revision, estimate }
    }
}

/// A world in which plans may be checked, or not.
pub struct SeenWorld {
    pub world: EllipsoidWorld,
    pub is_checked: bool,
}

impl CollisionWorld for SeenWorld {
    type Body = BodyShape;

    fn clearance(&self, body: &BodyShape, pose: &Pose<f64>, time_s: f64) -> Result<Clearance, PlanningError> {
        self.world.clearance(body, pose, time_s)
    }

    fn first_contact(
        &self,
        body: &BodyShape,
        arc: &BodyArc,
        start_s: f64,
        margin_m: f64,
    ) -> Result<Option<Contact>, PlanningError> {
        if self.is_checked { self.world.first_contact(body, arc, start_s, margin_m) } else { Ok(None) }
    }

    fn is_still_from(&self, time_s: f64) -> bool {
        self.world.is_still_from(time_s)
    }

    fn is_round(&self, body: &BodyShape) -> bool {
        self.world.is_round(body)
    }

    fn lasting_clearance(&self, body: &BodyShape, pose: &Pose<f64>, from_s: f64) -> Result<Clearance, PlanningError> {
        self.world.lasting_clearance(body, pose, from_s)
    }

    fn reach_m(&self, body: &BodyShape) -> f64 {
        self.world.reach_m(body)
    }
}

/// Ways, which always see the world as it is.
pub struct WrongWays {
    pub planner: FlightPlanner,
    pub teller: Arc<Teller>,
}

impl GlobalPlanner<SeenWorld> for WrongWays {
    fn plan(
        &mut self,
        request: &GlobalRequest<'_, SeenWorld>,
        budget: &mut dyn Budget,
    ) -> Result<GlobalAnswer, PlanningError> {
        let belief = self.teller.told(Who::Way, request.belief);
        let asked = GlobalRequest {
            world: &request.world.world,
            body: request.body,
            start: request.start,
            attitude: request.attitude,
            start_s: request.start_s,
            goal: request.goal,
            limits: request.limits,
            belief: &belief,
            objective: request.objective,
            margin_m: request.margin_m,
            until: request.until,
            seed: request.seed,
        };
        self.planner.plan(&asked, budget)
    }
}

/// Stretches.
pub struct WrongStretches {
    pub planner: Box<dyn StretchPlanner>,
    pub teller: Arc<Teller>,
    pub nothing: Surroundings,
}

impl StretchPlanner for WrongStretches {
    fn horizon_s(&self) -> f64 {
        self.planner.horizon_s()
    }

    fn plan(&mut self, task: &StretchTask<'_>, budget: &mut dyn Budget) -> Result<StretchOutcome, PlanningError> {
        let belief = self.teller.told(Who::Stretch, task.belief);
        let is_blind = matches!(self.teller.defect, Defect::NoObstacles | Defect::NoObstaclesUnchecked);
        let asked = StretchTask {
            start: task.start,
            start_s: task.start_s,
            asked_s: task.asked_s,
            way: task.way,
            way_start_s: task.way_start_s,
            belief: &belief,
            environment: task.environment,
            surroundings: if is_blind { &self.nothing } else { task.surroundings },
            is_informative: task.is_informative,
            elapsed_s: task.elapsed_s,
        };
        self.planner.plan(&asked, budget)
    }
}

/// Ours, or the original.
pub enum Flies {
    Ours(Box<TubeController>),
    Original(Box<OriginalTubeController>),
}

/// A controller that hears what it is told.
pub struct WrongController {
    pub flies: Flies,
    /// What takes over at [`RESET_S`].
    pub anew: Option<Flies>,
    pub teller: Arc<Teller>,
}

impl Controller for WrongController {
    fn acceleration_m_s2(&self) -> [f64; 3] {
        match &self.flies {
            Flies::Ours(tube) => tube.acceleration_m_s2(),
            Flies::Original(tube) => tube.acceleration_m_s2(),
        }
    }

    fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        let belief = self.teller.told(Who::Controller, belief);
        match &mut self.flies {
            Flies::Ours(tube) => tube.adopt(&belief),
            Flies::Original(tube) => tube.adopt(&belief),
        }
    }

    fn command(&mut self, request: &ControlRequest<'_>) -> Result<ControlCommand, PlanningError> {
        if request.time_s >= RESET_S
            && let Some(anew) = self.anew.take()
        {
            self.flies = anew;
        }
        match &mut self.flies {
            Flies::Ours(tube) => tube.command(request),
            Flies::Original(tube) => tube.command(request),
        }
    }
}
