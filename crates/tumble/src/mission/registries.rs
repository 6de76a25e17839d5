//! The layers of a mission by name: one list each for the command line, scenario files, JSON and documents.

use super::layer_names::{CONTROLLER, ESTIMATOR, LOCAL_PLANNER, LayerNames, PLANNER, WrittenNames};
use super::layers::{TRACKER_RAD_S, attitude_gains, estimator, estimator_settings, stretch_planner, tube_controllers};
use super::weighting::WeightingChoice;
use crate::added::Added;
use crate::scenario::{FLOWN, MissionProblem, PlanningProblem, TRACKER};
use serde::{Deserialize, Deserializer, de};
use tumble_astrobee::control_presets::{self, ControlLimits};
use tumble_astrobee::flight_controller::FlightController;
use tumble_astrobee::flight_modes::ControlGains;
use tumble_astrobee::planning_presets::{PrimitiveRules, rattle_rrt};
use tumble_astrobee::simulator::FlownController;
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{FreeFlyer, InertialParameters, PoseTracker, RigidBodyState, WrenchBox};
use tumble_identification::estimator::{Finding, StateEstimator};
use tumble_identification::recursive::{FlightEstimatorSettings, TwoStageEstimator};
use tumble_identification::{BodyScale, Registry, UnknownName};
use tumble_planning::collision::EllipsoidWorld;
use tumble_planning::control::{
    AttitudeController, AttitudeLaw, Controller, LqrController, OriginalTube, OriginalTubeController,
    PlainMpcController, PoseTracking, TranslationWeights,
};
use tumble_planning::global::{FlightPlanner, GlobalPlanner};
use tumble_planning::mission::{AlongWay, StretchPlanner};
use tumble_planning::{ModelBelief, PlanningError};

/// Makes controllers: at first, and anew when the body may be anything.
pub type NewController = dyn FnMut(&ModelBelief) -> Result<Box<dyn Controller + Send>, PlanningError> + Send;

/// Makes a planner of stretches for a mission.
pub type NewStretchPlanner = dyn Fn(&MissionProblem) -> Result<Box<dyn StretchPlanner>, PlanningError>;

/// Estimators in flight of a program's own.
pub static ADDED_ESTIMATORS: Added<MissionProblem, dyn StateEstimator, PlanningError> = Added::none();
/// Global planners of a program's own.
pub static ADDED_PLANNERS: Added<PlanningProblem, dyn GlobalPlanner<EllipsoidWorld>, PlanningError> = Added::none();
/// Local planners of a program's own.
pub static ADDED_LOCAL_PLANNERS: Added<WeightingChoice, NewStretchPlanner, PlanningError> = Added::none();
/// Controllers of a program's own, for missions and for `simulate`.
pub static ADDED_CONTROLLERS: Added<ControlledBody, dyn Controller + Send, PlanningError> = Added::none();

/// Estimators in flight, told of the mission.
pub fn estimators() -> Registry<MissionProblem, dyn StateEstimator, PlanningError> {
    let shipped = Registry::<_, dyn StateEstimator, _>::new("estimator")
        .with(
            ESTIMATOR,
            "motion and body in one filter, from measurements late and out of order",
            |problem: &MissionProblem| Ok(Box::new(estimator(problem)?)),
        )
        .with(
            "two-stage-rls",
            "the thesis's architecture: innovations of a filter of the motion feed least squares on the body",
            |problem: &MissionProblem| {
                let (settings, start, start_ns, prior) = in_flight(problem)?;
                Ok(Box::new(TwoStageEstimator::least_squares(settings, start, start_ns, &prior)?))
            },
        )
        .with(
            "two-stage-sdp",
            "the same with least squares among the bodies that can be",
            |problem: &MissionProblem| {
                let (settings, start, start_ns, prior) = in_flight(problem)?;
                Ok(Box::new(TwoStageEstimator::sdp(settings, start, start_ns, &prior)?))
            },
        );
    ADDED_ESTIMATORS.to(shipped)
}

/// What an estimator begins with.
fn in_flight(
    problem: &MissionProblem,
) -> Result<(FlightEstimatorSettings, RigidBodyState<f64>, i64, Finding), PlanningError> {
    let scale = BodyScale::of(&problem.prior.parameters.to_vector())?;
    let simulator = &problem.flight.simulator;
    let prior = problem.prior.to_finding(scale)?;
    Ok((estimator_settings(problem), *simulator.state(), simulator.time_ns(), prior))
}

/// Planners of ways, told of what is to be planned.
pub fn planners() -> Registry<PlanningProblem, dyn GlobalPlanner<EllipsoidWorld>, PlanningError> {
    let shipped = Registry::<_, dyn GlobalPlanner<EllipsoidWorld>, _>::new("planner")
        .with(PLANNER, "exact edges, better plans for as long as the budget lasts, a bound", |_: &PlanningProblem| {
            Ok(FlightPlanner::default().among_ellipsoids())
        })
        .with(
            "thesis-rrt",
            "the thesis's: motion primitives, the first plan; every edge checked all along",
            |problem: &PlanningProblem| {
                // those of the station where RATTLE was not flown
                let planner = rattle_rrt(problem.place, PrimitiveRules::Continuous)
                    .or_else(|| rattle_rrt(WorldPreset::Iss, PrimitiveRules::Continuous))
                    .unwrap_or(Err(PlanningError::Unsupported { query: "be planned in by the thesis's planner" }))?;
                Ok(Box::new(planner))
            },
        );
    ADDED_PLANNERS.to(shipped)
}

/// Planners of stretches, told what information is worth.
pub fn local_planners() -> Registry<WeightingChoice, NewStretchPlanner, PlanningError> {
    let shipped = Registry::<_, NewStretchPlanner, _>::new("local planner")
        .with(LOCAL_PLANNER, "progress and information at once", |weighting: &WeightingChoice| {
            let weighting = *weighting;
            Ok(Box::new(move |problem: &MissionProblem| stretch_planner(problem, weighting)))
        })
        .with("along-way", "the way as it is", |_: &WeightingChoice| {
            Ok(Box::new(|problem: &MissionProblem| {
                Ok(Box::new(AlongWay { horizon_s: problem.stretch_s }) as Box<dyn StretchPlanner>)
            }))
        });
    ADDED_LOCAL_PLANNERS.to(shipped)
}

/// What controllers that need to know no more than this are told.
#[derive(Clone, Copy, Debug)]
pub struct ControlledBody {
    /// What the body is taken for.
    pub body: InertialParameters<f64>,
    /// Where.
    pub place: WorldPreset,
    /// Most force and torque.
    pub limits: ControlLimits,
    /// Whether it is told of the body on the way.
    pub is_told: bool,
    /// Natural frequencies of a tracker: rotation and position, rad/s.
    pub tracker_rad_s: [f64; 2],
}

impl ControlledBody {
    /// What Astrobee flies, which knows no limits but its own.
    pub fn flown(&self) -> FlownController {
        FlownController::new(FlightController::new(self.body, ControlGains::of(self.place.site())))
    }

    fn tracker(&self) -> Result<PoseTracking, PlanningError> {
        let [rotation, position] = self.tracker_rad_s;
        let tracker = PoseTracker::critically_damped(FreeFlyer::new(self.body), rotation, position);
        let torque_limit = Vector3::repeat(self.limits.torque_n_m);
        PoseTracking::try_new(tracker, WrenchBox { torque_limit, force_limit: self.limits.force_n })
    }

    fn attitude(&self, law: AttitudeLaw) -> AttitudeController {
        AttitudeController {
            law,
            gains: attitude_gains(self.place, &self.body),
            body: self.body,
            torque_limit_n_m: self.limits.torque_n_m,
        }
    }
}

/// Controllers that missions and `simulate` make alike; a tube needs to know more, see [`controllers`].
pub fn laws() -> Registry<ControlledBody, dyn Controller + Send, PlanningError> {
    let shipped = Registry::<_, dyn Controller + Send, _>::new("controller")
        .with("lqr", "linear-quadratic feedback, which knows of no limit and no doubt", |told: &ControlledBody| {
            let (step_s, weights) = (control_presets::decision_on_grid_s(), TranslationWeights::default());
            let attitude = told.attitude(AttitudeLaw::Geometric);
            Ok(Box::new(LqrController::lqr(step_s, &weights, attitude, told.limits.force_n)?))
        })
        .with("mpc", "model-predictive control without a tube", |told: &ControlledBody| {
            let (settings, attitude) = (control_presets::mpc_settings(), told.attitude(AttitudeLaw::Geometric));
            Ok(Box::new(PlainMpcController::plain_mpc(&settings, attitude, told.limits.force_n)?))
        })
        .with("original-tube", "RATTLE's own tube", |told: &ControlledBody| {
            let settings = control_presets::original_settings(told.limits.force_n.min(), told.is_told);
            let attitude = told.attitude(AttitudeLaw::Feedback);
            let law = OriginalTube::try_new(&settings)?;
            Ok(Box::new(OriginalTubeController::try_new(law, attitude, told.limits.force_n)?))
        })
        .with(TRACKER, "computed torque with the believed body", |told: &ControlledBody| Ok(Box::new(told.tracker()?)))
        .with(FLOWN, "the cascade that Astrobee flies", |told: &ControlledBody| Ok(Box::new(told.flown())));
    ADDED_CONTROLLERS.to(shipped)
}

/// Controllers, told of the mission.
pub fn controllers() -> Registry<MissionProblem, NewController, PlanningError> {
    let tube = Registry::<MissionProblem, NewController, PlanningError>::new("controller").with(
        CONTROLLER,
        "robust model-predictive control: limits are kept for every mass that is possible",
        |problem| {
            let mut new = tube_controllers(problem);
            Ok(Box::new(move |belief: &ModelBelief| Ok(Box::new(new(belief)?) as Box<dyn Controller + Send>)))
        },
    );
    laws().entries().fold(tube, |all, (name, sentence)| {
        all.with(name, sentence, move |problem: &MissionProblem| {
            let limits = ControlLimits { force_n: problem.force_limit_n, torque_n_m: problem.torque_limit_n_m.min() };
            let place = problem.place;
            Ok(Box::new(move |belief: &ModelBelief| {
                let (body, tracker_rad_s) = (*belief.parameters(), TRACKER_RAD_S);
                laws().make(name, &ControlledBody { body, place, limits, is_told: true, tracker_rad_s })
            }))
        })
    })
}

/// The name as its registry has it.
fn known<C, T: ?Sized, S: AsRef<str>>(
    registry: &Registry<C, T, PlanningError>,
    asked: Option<&S>,
) -> Result<Option<&'static str>, UnknownName> {
    let Some(asked) = asked.map(AsRef::as_ref) else { return Ok(None) };
    registry.check(asked)?;
    Ok(registry.entries().map(|(name, _)| name).find(|name| *name == asked))
}

impl LayerNames {
    /// Names that the registries have.
    ///
    /// # Errors
    /// A name that its registry has not, with those that it has.
    pub fn of<S: AsRef<str>>(written: &WrittenNames<S>) -> Result<Self, UnknownName> {
        Ok(Self {
            estimator: known(&estimators(), written.estimator.as_ref())?,
            planner: known(&planners(), written.planner.as_ref())?,
            local_planner: known(&local_planners(), written.local_planner.as_ref())?,
            controller: known(&controllers(), written.controller.as_ref())?,
        })
    }
}

impl<'de> Deserialize<'de> for LayerNames {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::of(&WrittenNames::<String>::deserialize(deserializer)?).map_err(de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_name_lists_the_known() {
        let asked = WrittenNames { controller: Some("pid"), ..WrittenNames::default() };
        let text = LayerNames::of(&asked).unwrap_err().to_string();
        assert!(text.contains("no controller is called `pid`; known: tube, lqr, mpc, original-tube"), "{text}");
        let read: Result<LayerNames, _> = toml::from_str("estimator = \"oracle\"");
        let text = read.unwrap_err().to_string();
        assert!(text.contains("no estimator is called `oracle`; known: joint, two-stage-rls, two-stage-sdp"), "{text}");
        assert!(toml::from_str::<LayerNames>("engine = \"warp\"").is_err());
        let read: LayerNames = toml::from_str("local_planner = \"along-way\"").unwrap();
        assert_eq!((read.local_planner(), read.planner()), ("along-way", PLANNER));
        assert_eq!(toml::to_string(&read).unwrap(), "local_planner = \"along-way\"\n");
    }
}
