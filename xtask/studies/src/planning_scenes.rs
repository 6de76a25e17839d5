//! The problems that planners are judged on: the runs of RATTLE, problem 7, and a slit that a long body must turn to pass.

use nalgebra::{Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};
use tumble::scenario::ScenarioSource;
use tumble_astrobee::planning_presets::{rattle_goal, rattle_limits, rattle_shape};
use tumble_astrobee::worlds::{OBSTACLE_SETS, WorldPreset};
use tumble_dynamics::{AlignedBox, InertialParameters, ObstacleEllipsoid, World};
use tumble_planning::collision::{BodyShape, EllipsoidWorld};
use tumble_planning::global::{GlobalRequest, GoalRegion, MotionLimits, Objective, Until};
use tumble_planning::lie::Pose;
use tumble_planning::{ModelBelief, PlanningError, TranslationState};

use crate::Failure;
use crate::path_checker::{PathChecker, Rules};

#[path = "../../benches/scenes/jem.rs"]
mod frozen;

/// A problem to plan.
pub struct Scene {
    pub name: String,
    /// Of the runs of RATTLE, where they were flown.
    pub place: Option<WorldPreset>,
    pub world: World,
    pub queries: EllipsoidWorld,
    pub shape: BodyShape,
    pub belief: ModelBelief,
    pub start: TranslationState,
    pub attitude: UnitQuaternion<f64>,
    pub goal: GoalRegion,
    pub limits: MotionLimits,
}

/// Problem 7: its scenes, what OMPL's `control::RRT` takes for a first plan, ms, and the shortest median duration of the
/// first plans of OMPL's RRT, SST and KPIECE1, s.
pub const PEERS: [(&str, f64, f64); 3] = [("jem2", 4.8, 50.2), ("jem5", 13.1, 59.2), ("jem10", 15.5, 56.1)];

impl Scene {
    pub fn request(&self, seed: u64, until: Until) -> GlobalRequest<'_, EllipsoidWorld> {
        GlobalRequest {
            world: &self.queries,
            body: &self.shape,
            start: self.start,
            attitude: self.attitude,
            start_s: 0.0,
            goal: self.goal,
            limits: self.limits,
            belief: &self.belief,
            objective: Objective::Duration,
            margin_m: 0.0,
            until,
            seed,
        }
    }

    pub fn checker(&self) -> PathChecker<'_> {
        PathChecker::new(Rules {
            world: &self.world,
            body: &self.shape,
            parameters: self.belief.parameters(),
            limits: &self.limits,
            start: self.start,
            attitude: self.attitude,
            goal: &self.goal,
            margin_m: 0.0,
        })
    }

    /// The same for a ball that the body fits into.
    pub fn within_bounding_sphere(mut self) -> Result<Self, Failure> {
        self.shape = BodyShape::sphere(self.shape.bounding_radius_m()).map_err(failed)?;
        self.goal.attitude = None;
        self.name.push_str("-sphere");
        Ok(self)
    }
}

#[allow(clippy::needless_pass_by_value)] // given to `map_err`
pub fn failed(error: PlanningError) -> Failure {
    Failure::TargetMissed(format!("planning: {error}"))
}

/// The five obstacle sets of both places, from A to the goal region around B.
pub fn rattle_scenes() -> Result<Vec<Scene>, Failure> {
    let places = [WorldPreset::Granite, WorldPreset::Iss];
    let sets = places.into_iter().flat_map(|place| (0..OBSTACLE_SETS).map(move |set| (place, set)));
    sets.map(|(place, set)| rattle_scene(place, set)).collect()
}

pub fn rattle_scene(place: WorldPreset, set: u8) -> Result<Scene, Failure> {
    let missing = || Failure::BadInput(format!("{} has no runs", place.name()));
    let (a, b) = (place.pose("A").ok_or_else(missing)?, place.pose("B").ok_or_else(missing)?);
    let obstacles = place.obstacles(set).ok_or_else(missing)?;
    let world = World { obstacles, ..place.volumes() };
    Ok(Scene {
        name: format!("{}_{set}", place.name()),
        place: Some(place),
        queries: EllipsoidWorld::new(&world).map_err(failed)?,
        world,
        shape: rattle_shape().map_err(failed)?,
        belief: ModelBelief::certain(1, place.body()),
        start: TranslationState::at_rest(a.translation.vector),
        attitude: a.rotation,
        goal: rattle_goal(place, &b.translation.vector).ok_or_else(missing)?,
        limits: rattle_limits(place, &a.translation.vector).ok_or_else(missing)?,
    })
}

/// Problem 7: a point among ellipsoids that were grown by the robot's radius.
pub fn frozen_scenes() -> Result<Vec<Scene>, Failure> {
    const POINT_RADIUS_M: f64 = 1e-6;
    const MASS_KG: f64 = 9.58;
    let corner = Vector3::new(0.59, 3.04, 0.69);
    let body = InertialParameters::about_origin(MASS_KG, Vector3::zeros(), Matrix3::identity() * 0.15);
    let scene = |(name, rows): (&str, &[frozen::Row])| {
        let obstacle = |(center, [w, x, y, z], semi_axes): &frozen::Row| {
            let rotation = UnitQuaternion::new_normalize(Quaternion::new(*w, *x, *y, *z));
            let world_from_ellipsoid = Pose::from_parts(Translation3::from(*center), rotation);
            ObstacleEllipsoid { world_from_ellipsoid, semi_axes: (*semi_axes).into() }
        };
        let world = World { obstacles: rows.iter().map(obstacle).collect(), ..World::default() };
        Ok(Scene {
            name: name.to_owned(),
            place: None,
            queries: EllipsoidWorld::new(&world).map_err(failed)?,
            world,
            shape: BodyShape::sphere(POINT_RADIUS_M).map_err(failed)?,
            belief: ModelBelief::certain(1, body),
            start: TranslationState::at_rest(Vector3::new(0.0, -2.8, 0.0)),
            attitude: UnitQuaternion::identity(),
            goal: GoalRegion { position: Vector3::new(0.0, 2.8, 0.0), radius_m: 0.25, speed_m_s: 0.1, attitude: None },
            limits: MotionLimits {
                position: AlignedBox::between(-corner, corner),
                speed_m_s: Vector3::repeat(0.2),
                force_n: Vector3::repeat(0.45),
                torque_n_m: Vector3::repeat(0.045),
                rate_rad_s: 0.1,
            },
        })
    };
    [("jem2", frozen::JEM2), ("jem5", frozen::JEM5), ("jem10", frozen::JEM10)].into_iter().map(scene).collect()
}

/// The scenario `iss-gap`: a payload of 0.30 m x 0.15 m x 0.15 m (semi-axes) across a slit 0.4 m wide.
pub fn gap_scene() -> Result<Scene, Failure> {
    let bad = |error: tumble::TumbleError| Failure::BadInput(error.to_string());
    let problem = ScenarioSource::find("iss-gap").and_then(|source| source.planning_problem()).map_err(bad)?;
    Ok(Scene {
        name: "iss-gap".to_owned(),
        place: None,
        queries: EllipsoidWorld::new(&problem.world).map_err(failed)?,
        world: problem.world,
        shape: problem.body,
        belief: problem.belief,
        start: problem.start,
        attitude: problem.attitude,
        goal: problem.goal,
        limits: problem.limits,
    })
}

/// The table's point C itself, at rest, where obstacle 1 of set 2 and obstacle 4 of set 4 cover it.
pub fn exactly_c_scene(set: u8) -> Result<Scene, Failure> {
    let mut scene = rattle_scene(WorldPreset::Granite, set)?;
    let c = WorldPreset::Granite.pose("C").ok_or_else(|| Failure::BadInput("there is no C".to_owned()))?;
    scene.name = format!("granite_{set}-exactly-c");
    scene.goal = GoalRegion { position: c.translation.vector, radius_m: 0.0, speed_m_s: 0.0, attitude: None };
    Ok(scene)
}
