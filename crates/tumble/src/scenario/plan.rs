//! From a scenario to a planning problem.

use super::{PlanBodyTable, PlanTable, PlanningProblem, ScenarioSource};
use crate::TumbleError;
use tumble_astrobee::planning_presets::{FORCE_N, SPEED_M_S, TORQUE_N_M};
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::nalgebra::{UnitQuaternion, Vector3};
use tumble_dynamics::{AlignedBox, RigidBodyState};
use tumble_lie::Pose;
use tumble_planning::collision::{BodyEllipsoid, BodyShape};
use tumble_planning::global::{GoalRegion, MotionLimits};
use tumble_planning::{ModelBelief, TranslationState};

/// Most ellipsoids of a body.
const MOST_PARTS: usize = 100;
/// Farthest coordinate and largest length, m.
const FARTHEST_M: f64 = 1e5;
/// Least and largest mass, kg.
const MASS_KG: (f64, f64) = (1e-3, 1e6);

/// What a number of `[plan]` may be besides zero.
pub(super) struct Range {
    pub least: f64,
    pub most: f64,
    pub unit: &'static str,
}

pub(super) const FORCE: Range = Range { least: 1e-6, most: 1e6, unit: "N" };
/// The slowest way through the largest box is still a number of nanoseconds.
pub(super) const SPEED: Range = Range { least: 1e-4, most: 1e3, unit: "m/s" };
pub(super) const TORQUE: Range = Range { least: 1e-9, most: 1e6, unit: "N m" };
pub(super) const RATE: Range = Range { least: 1e-6, most: 1e3, unit: "rad/s" };
pub(super) const LENGTH: Range = Range { least: 0.0, most: FARTHEST_M, unit: "m" };
const GOAL_SPEED: Range = Range { least: 0.0, most: 1e3, unit: "m/s" };

/// What `[plan]` says, with what holds where it says nothing.
pub(super) struct PlanLimits {
    force_n: Vector3<f64>,
    speed_m_s: Vector3<f64>,
    torque_n_m: Vector3<f64>,
    rate_rad_s: f64,
    position: Option<AlignedBox>,
    goal_radius_m: f64,
    goal_speed_m_s: f64,
    goal_attitude: bool,
    margin_m: f64,
    body: BodyShape,
}

impl ScenarioSource {
    /// What a planner is asked. Obstacles in the way are its affair.
    ///
    /// # Errors
    /// [`TumbleError::BadScenario`] with the key and its place; the errors of files that it names.
    pub fn planning_problem(&self) -> Result<PlanningProblem, TumbleError> {
        let place = self.place()?;
        self.check_duration()?;
        // No plan knows of a payload, but a file that says what cannot be is wrong for every command.
        self.grasp()?;
        self.length("robot_radius_m", self.robot_radius_m()?)?;
        let (_, belief) = self.bodies(place)?;
        let (mass_kg, (least, most)) = (belief.mass, MASS_KG);
        if !(least..=most).contains(&mass_kg) {
            let key = if self.scenario.belief.is_some() { "belief.mass_kg" } else { "body.mass_kg" };
            return Err(self.bad(key, &format!("{mass_kg:e}: a plan is for {least:e} to {most:e} kg")));
        }
        let (world, obstacle_motions) = self.world(place)?;
        let state = self.start(place)?;
        let asked = self.plan_limits(place, &state)?;
        if state.twist_body.angular != Vector3::zeros() {
            return Err(self.bad("start.rate_rad_s", "a plan begins without a turn"));
        }
        let start = TranslationState {
            position: state.world_from_body.translation.vector,
            velocity: state.world_from_body.rotation * state.twist_body.linear,
        };
        let goal = self.goal(place, &state)?.ok_or_else(|| self.bad("goal", "a plan needs a `[goal]`"))?;
        let mut limits = MotionLimits {
            position: asked.position.ok_or_else(|| {
                self.bad(
                    "plan",
                    &format!(
                        "in the world `{}` nothing bounds the way: give `position_lower_m` and `position_upper_m`",
                        place.name()
                    ),
                )
            })?,
            speed_m_s: asked.speed_m_s,
            force_n: asked.force_n,
            torque_n_m: asked.torque_n_m,
            rate_rad_s: asked.rate_rad_s,
        };
        if place.is_planar() {
            self.check_level(&state, &goal)?;
            limits.position.lower_world.z = start.position.z;
            limits.position.upper_world.z = start.position.z;
            limits.force_n.z = 0.0;
        }
        Ok(PlanningProblem {
            place,
            world,
            obstacle_motions,
            body: asked.body,
            start,
            attitude: state.world_from_body.rotation,
            goal: GoalRegion {
                position: goal.translation.vector,
                radius_m: asked.goal_radius_m,
                speed_m_s: asked.goal_speed_m_s,
                attitude: asked.goal_attitude.then_some(goal.rotation),
            },
            limits,
            belief: ModelBelief::certain(0, belief),
            margin_m: asked.margin_m,
        })
    }

    /// On a table start and goal have one height, no vertical velocity, and stand upright.
    fn check_level(&self, start: &RigidBodyState<f64>, goal: &Pose<f64>) -> Result<(), TumbleError> {
        let (from, to) = (start.world_from_body.translation.vector, goal.translation.vector);
        if (to.z - from.z).abs() > 0.0 {
            return Err(self.bad("goal", &format!("on the table the goal has the height of the start, {} m", from.z)));
        }
        for (key, rotation) in [("start", &start.world_from_body.rotation), ("goal", &goal.rotation)] {
            if rotation.i != 0.0 || rotation.j != 0.0 {
                return Err(self.bad(key, "on the table the robot stands upright: x and y of its quaternion are zero"));
            }
        }
        if start.twist_body.linear.z != 0.0 {
            return Err(self.bad("start.velocity_m_s", "on the table the robot has no velocity along z"));
        }
        Ok(())
    }

    /// `[plan]`, checked.
    pub(super) fn plan_limits(
        &self,
        place: WorldPreset,
        start: &RigidBodyState<f64>,
    ) -> Result<PlanLimits, TumbleError> {
        let nothing = PlanTable::default();
        let table = self.scenario.plan.as_ref().unwrap_or(&nothing);
        let within = |key: &str, value: f64, range: &Range| {
            let Range { least, most, unit } = range;
            if value == 0.0 || (*least..=*most).contains(&value) {
                return Ok(value);
            }
            let message = format!("{value:?}: zero or more, and finite: 0, or {least:e} to {most:e} {unit}");
            Err(self.bad(&format!("plan.{key}"), &message))
        };
        let each = |key: &str, values: Option<[f64; 3]>, otherwise: f64, range: &Range| {
            let values = values.unwrap_or([otherwise; 3]);
            values.into_iter().try_for_each(|value| within(key, value, range).map(drop))?;
            Ok::<_, TumbleError>(Vector3::from(values))
        };
        let rate_rad_s = self.flight_mode()?.limits(place.site()).rate_rad_s;
        Ok(PlanLimits {
            force_n: each("force_limit_n", table.force_limit_n, FORCE_N, &FORCE)?,
            speed_m_s: each("speed_limit_m_s", table.speed_limit_m_s, SPEED_M_S, &SPEED)?,
            torque_n_m: each("torque_limit_n_m", table.torque_limit_n_m, TORQUE_N_M, &TORQUE)?,
            rate_rad_s: within("rate_limit_rad_s", table.rate_limit_rad_s.unwrap_or(rate_rad_s), &RATE)?,
            position: self.position_box(place, start, table)?,
            goal_radius_m: within("goal_radius_m", table.goal_radius_m.unwrap_or(0.0), &LENGTH)?,
            goal_speed_m_s: within("goal_speed_m_s", table.goal_speed_m_s.unwrap_or(0.0), &GOAL_SPEED)?,
            goal_attitude: table.goal_attitude.unwrap_or(true),
            margin_m: within("margin_m", table.margin_m.unwrap_or(0.0), &LENGTH)?,
            body: self.body_shape(&table.body)?,
        })
    }

    /// That a length or a coordinate, m, is one to plan with.
    fn length(&self, key: &str, value: f64) -> Result<(), TumbleError> {
        if value <= FARTHEST_M {
            return Ok(());
        }
        Err(self.bad(key, &format!("{value:e}: at most {FARTHEST_M:e} m from zero")))
    }

    /// Where the body origin may be: what is written, else the table, else all keep-in boxes.
    fn position_box(
        &self,
        place: WorldPreset,
        start: &RigidBodyState<f64>,
        table: &PlanTable,
    ) -> Result<Option<AlignedBox>, TumbleError> {
        let whole = match place.table_half_width_m() {
            Some(half) => {
                let height = start.world_from_body.translation.vector.z;
                Some(AlignedBox::between(Vector3::new(-half, -half, height), Vector3::new(half, half, height)))
            }
            None => place.volumes().keep_in.into_iter().reduce(|whole, next| AlignedBox {
                lower_world: whole.lower_world.inf(&next.lower_world),
                upper_world: whole.upper_world.sup(&next.upper_world),
            }),
        };
        let (lower, upper) = match (table.position_lower_m, table.position_upper_m) {
            (None, None) => return Ok(whole),
            (Some(lower), Some(upper)) => (lower, upper),
            (Some(_), None) => return Err(self.bad("plan.position_lower_m", "`position_upper_m` is needed as well")),
            (None, Some(_)) => return Err(self.bad("plan.position_upper_m", "`position_lower_m` is needed as well")),
        };
        let lower_world = self.finite("plan.position_lower_m", lower)?;
        let upper_world = self.finite("plan.position_upper_m", upper)?;
        for (key, corner) in [("plan.position_lower_m", lower_world), ("plan.position_upper_m", upper_world)] {
            self.length(key, corner.amax())?;
        }
        if (upper_world - lower_world).min() < 0.0 {
            return Err(self.bad("plan.position_upper_m", "no coordinate may be less than that of `position_lower_m`"));
        }
        Ok(Some(AlignedBox { lower_world, upper_world }))
    }

    /// The ellipsoids of the body; the sphere of the robot where none are written.
    fn body_shape(&self, tables: &[PlanBodyTable]) -> Result<BodyShape, TumbleError> {
        if tables.is_empty() {
            return Ok(BodyShape::sphere(self.robot_radius_m()?)?);
        }
        if tables.len() > MOST_PARTS {
            return Err(self.bad("plan.body", &format!("{}: at most {MOST_PARTS}", tables.len())));
        }
        let mut parts = Vec::with_capacity(tables.len());
        for table in tables {
            let semi_axes = self.finite("plan.body.semi_axes_m", table.semi_axes_m)?;
            if semi_axes.min() <= 0.0 {
                return Err(self.bad("plan.body.semi_axes_m", "every semi-axis must be positive"));
            }
            let center = self.finite("plan.body.center_m", table.center_m.unwrap_or_default())?;
            self.length("plan.body.semi_axes_m", semi_axes.amax())?;
            self.length("plan.body.center_m", center.amax())?;
            let rotation = match table.quaternion_xyzw {
                Some(quaternion) => self.rotation("plan.body.quaternion_xyzw", quaternion)?,
                None => UnitQuaternion::identity(),
            };
            parts.push(BodyEllipsoid { body_from_ellipsoid: Pose::from_parts(center.into(), rotation), semi_axes });
        }
        BodyShape::try_new(parts).map_err(|error| self.bad("plan.body", &error.to_string()))
    }
}
