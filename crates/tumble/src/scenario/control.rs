//! Controllers that decide every so often, and what they are told of the body on the way.

use super::{BeliefTable, FLOWN, LONGEST_S, NONE, ScenarioSource, Steering, TRACKER};
use crate::TumbleError;
use crate::flight_log::nanoseconds;
use crate::mission::{ControlledBody, laws};
use std::error::Error as _;
use tumble_astrobee::control_presets::{self, ControlLimits, MASS_KNOWN_SHARE};
use tumble_astrobee::simulator::{Follower, Following, Reference};
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::nalgebra::{UnitQuaternion, Vector3};
use tumble_dynamics::{AlignedBox, InertialParameters};
use tumble_lie::LieGroup;
use tumble_planning::control::{
    AttitudeController, AttitudeLaw, AttitudeSpan, Controller, MassInterval, TubeController, TubeDisturbance,
    TubeSettings,
};
use tumble_planning::{ModelBelief, PlanningError};

/// Name of the tube.
const TUBE: &str = "tube";
/// Natural frequencies of the tracker unless given: rotation and position, rad/s.
const TRACKER_RAD_S: [f64; 2] = [1.0, 0.5];
/// Most beliefs on the way.
const MOST_BELIEFS: usize = 1000;
/// Masses that can be believed, kg.
const MASSES_KG: [f64; 2] = [1e-3, 1e6];
/// Forces, torques and speeds that make sense as limits.
const LIMITS: [f64; 2] = [1e-9, 1e6];
/// Largest errors of measurement, m and m/s, and forces from outside, N, that a tube can be asked to hold.
const LARGEST_ERROR: f64 = 1.0;
/// How far the attitude is from its reference at most, rad: ten degrees.
const ATTITUDE_MARGIN_RAD: f64 = 0.175;
/// Volumes that touch within this are one, m.
const TOUCHING_M: f64 = 1e-6;

impl ScenarioSource {
    /// The controller of `[drive]`, and what is known of it.
    pub(super) fn controller(
        &self,
        place: WorldPreset,
        belief: &InertialParameters<f64>,
        reference: &Reference,
    ) -> Result<(Option<Box<dyn Follower>>, Steering), TumbleError> {
        let drive = &self.scenario.drive;
        let name = drive.steering();
        if ![NONE, TRACKER, FLOWN].contains(&name) {
            let (controller, steering) = self.deciding(name, place, belief, reference)?;
            return Ok((Some(Box::new(Following { controller, carries: true })), steering));
        }
        if drive.control.is_some() {
            let message = format!(
                "`{name}` takes none: only with `controller = \"tube\"`, \"lqr\", \"mpc\" or \"original-tube\""
            );
            return Err(self.bad("drive.control", &message));
        }
        let limits = ControlLimits { force_n: Vector3::repeat(f64::INFINITY), torque_n_m: f64::INFINITY };
        let mut told = ControlledBody { body: *belief, place, limits, is_told: true, tracker_rad_s: TRACKER_RAD_S };
        let follower: Option<Box<dyn Follower>> = match name {
            NONE => None,
            FLOWN => Some(Box::new(told.flown())),
            _ => {
                told.tracker_rad_s = self.tracker_rad_s()?;
                let controller = laws().make(name, &told).map_err(|error| self.refused("drive", error, ""))?;
                Some(Box::new(Following { controller, carries: false }))
            }
        };
        let steering = Steering { controller: name.to_owned(), limits: None, decision_s: None, planned_m_s2: None };
        Ok((follower, steering))
    }

    /// Natural frequencies of the tracker: rotation and position.
    pub(super) fn tracker_rad_s(&self) -> Result<[f64; 2], TumbleError> {
        let table = &self.scenario.drive;
        let [rotation, position] = TRACKER_RAD_S;
        Ok([
            self.positive("drive.tracker_rotation_rad_s", table.tracker_rotation_rad_s, rotation)?,
            self.positive("drive.tracker_position_rad_s", table.tracker_position_rad_s, position)?,
        ])
    }

    /// A controller that decides every so often.
    fn deciding(
        &self,
        name: &str,
        place: WorldPreset,
        belief: &InertialParameters<f64>,
        reference: &Reference,
    ) -> Result<(Box<dyn Controller + Send>, Steering), TumbleError> {
        let table = self.scenario.drive.control.unwrap_or_default();
        if place.is_planar() {
            let message = format!("`{name}` flies in three dimensions: not on the table");
            return Err(self.bad("drive.controller", &message));
        }
        let tube_only = [
            ("speed_limit_m_s", table.speed_limit_m_s.is_some()),
            ("mass_interval_share", table.mass_interval_share.is_some()),
            ("walls", table.walls.is_some()),
            ("position_error_m", table.position_error_m.is_some()),
            ("velocity_error_m_s", table.velocity_error_m_s.is_some()),
            ("force_error_n", table.force_error_n.is_some()),
        ];
        if let Some((key, _)) = tube_only.into_iter().find(|(_, given)| *given && name != TUBE) {
            return Err(self.bad(&format!("drive.control.{key}"), "only with `controller = \"tube\"`"));
        }
        let preset = match name {
            "original-tube" => control_presets::rattle_limits(),
            _ => control_presets::thesis_limits(),
        };
        let limits = ControlLimits {
            force_n: self.each_positive("drive.control.force_limit_n", table.force_limit_n, preset.force_n)?,
            torque_n_m: self.bounded("torque_limit_n_m", table.torque_limit_n_m, preset.torque_n_m, LIMITS)?,
        };
        let attitude = AttitudeController {
            law: AttitudeLaw::Geometric,
            gains: control_presets::rattle_attitude_gains(place),
            body: *belief,
            torque_limit_n_m: limits.torque_n_m,
        };
        let mut steering =
            Steering { controller: name.to_owned(), limits: Some(limits), decision_s: None, planned_m_s2: None };
        let is_told = !self.scenario.drive.beliefs.is_empty();
        let told = ControlledBody { body: *belief, place, limits, is_told, tracker_rad_s: TRACKER_RAD_S };
        let controller: Result<Box<dyn Controller + Send>, PlanningError> = match name {
            TUBE => {
                let settings = self.tube(place, belief, reference, &limits)?;
                steering.decision_s = Some(settings.gain.step_s);
                TubeController::try_new(settings, None, attitude, belief).map(|controller| {
                    let left = |axis: usize| {
                        let problem = controller.tube().problem(axis);
                        problem.scaled_acceleration - problem.held_acceleration
                    };
                    steering.planned_m_s2 = Some(Vector3::from_fn(|axis, _| left(axis)));
                    boxed(controller)
                })
            }
            _ => laws().make(name, &told),
        };
        let hint = match name {
            TUBE => {
                "; what is not known takes more than there is: a narrower `mass_interval_share`, smaller errors, or other limits \
                 of force and speed"
            }
            _ => "",
        };
        let controller = controller.map_err(|error| self.refused("drive.control", error, hint))?;
        Ok((controller, steering))
    }

    /// What our controllers refuse is a number of the scenario; an error with a source is somebody else's, and keeps it.
    fn refused(&self, key: &str, error: PlanningError, hint: &str) -> TumbleError {
        if error.source().is_some() { TumbleError::Control(error) } else { self.bad(key, &format!("{error}{hint}")) }
    }

    /// The tube that `[drive.control]` describes.
    fn tube(
        &self,
        place: WorldPreset,
        belief: &InertialParameters<f64>,
        reference: &Reference,
        limits: &ControlLimits,
    ) -> Result<TubeSettings, TumbleError> {
        let table = self.scenario.drive.control.unwrap_or_default();
        let mass = self.mass_interval(belief, table.mass_interval_share)?;
        let preset = control_presets::tube_settings(mass, limits, span(reference, &limits.force_n));
        let TubeDisturbance { position_m, velocity_m_s, force_n, .. } = preset.disturbance;
        let errors = [0.0, LARGEST_ERROR];
        let walls =
            if table.walls == Some(true) { Some(self.walls(place, reference, self.robot_radius_m()?)?) } else { None };
        Ok(TubeSettings {
            speed_m_s: self.bounded("speed_limit_m_s", table.speed_limit_m_s, preset.speed_m_s, LIMITS)?,
            walls_m: walls.map_or(preset.walls_m, |walls| {
                std::array::from_fn(|axis| [walls.lower_world[axis], walls.upper_world[axis]])
            }),
            disturbance: TubeDisturbance {
                position_m: self.bounded("position_error_m", table.position_error_m, position_m, errors)?,
                velocity_m_s: self.bounded("velocity_error_m_s", table.velocity_error_m_s, velocity_m_s, errors)?,
                force_n: self.bounded("force_error_n", table.force_error_n, force_n, errors)?,
                ..preset.disturbance
            },
            ..preset
        })
    }

    /// Three limits.
    fn each_positive(
        &self,
        key: &str,
        given: Option<[f64; 3]>,
        otherwise: Vector3<f64>,
    ) -> Result<Vector3<f64>, TumbleError> {
        let Some(given) = given else { return Ok(otherwise) };
        let [least, largest] = LIMITS;
        match given.into_iter().find(|limit| !(least..=largest).contains(limit)) {
            None => Ok(given.into()),
            Some(limit) => Err(self.bad(key, &format!("{limit}: each between {least:e} and {largest:e}"))),
        }
    }

    /// A number of `[drive.control]` within bounds.
    fn bounded(
        &self,
        key: &str,
        given: Option<f64>,
        otherwise: f64,
        [least, largest]: [f64; 2],
    ) -> Result<f64, TumbleError> {
        match given {
            None => Ok(otherwise),
            Some(value) if (least..=largest).contains(&value) => Ok(value),
            Some(value) => {
                Err(self.bad(&format!("drive.control.{key}"), &format!("{value}: between {least:e} and {largest:e}")))
            }
        }
    }

    /// Where the mass certainly is.
    fn mass_interval(
        &self,
        belief: &InertialParameters<f64>,
        share: Option<[f64; 2]>,
    ) -> Result<MassInterval, TumbleError> {
        let key = "drive.control.mass_interval_share";
        let share @ [least, largest] = share.unwrap_or(MASS_KNOWN_SHARE);
        let holds_belief = least > 0.0 && least <= 1.0 && (1.0..=1e3).contains(&largest);
        if !holds_belief {
            let message =
                format!("{least} to {largest}: from above 0 to at most 1000 with 1, the believed mass, between them");
            return Err(self.bad(key, &message));
        }
        control_presets::mass_interval(belief.mass, share).map_err(|error| self.bad(key, &error.to_string()))
    }

    /// What the controller is told, the first at the start; none where it is told nothing.
    pub(super) fn beliefs(
        &self,
        steering: &Steering,
        belief: &InertialParameters<f64>,
    ) -> Result<Vec<(i64, ModelBelief)>, TumbleError> {
        let tables = &self.scenario.drive.beliefs;
        if steering.controller == NONE && !tables.is_empty() {
            return Err(self.bad("drive.beliefs", "beliefs need a controller that is told"));
        }
        if !steering.is_accounted() && tables.is_empty() {
            return Ok(Vec::new());
        }
        if tables.len() > MOST_BELIEFS {
            return Err(self.bad("drive.beliefs", &format!("{}: at most {MOST_BELIEFS}", tables.len())));
        }
        // known no better than to itself: what is certain beside it stays so
        let mut beliefs = vec![(0, believed(1, belief, belief.mass, belief.mass))];
        let mut last_s = 0.0;
        for (index, (table, revision)) in tables.iter().zip(2..).enumerate() {
            let BeliefTable { time_s, mass_kg, sigma_kg } = *table;
            let bad = |key: &str, message: &str| Err(self.bad_in("drive.beliefs", index, key, message));
            // those after the end are never told
            if !(time_s > last_s && time_s <= LONGEST_S) {
                let message = format!("{time_s}: times begin after 0, increase and are at most {LONGEST_S} s");
                return bad("time_s", &message);
            }
            last_s = time_s;
            let [least, largest] = MASSES_KG;
            if !(least..=largest).contains(&mass_kg) {
                return bad("mass_kg", &format!("{mass_kg}: between {least:e} and {largest:e}"));
            }
            if !(0.0..=largest).contains(&sigma_kg) {
                return bad("sigma_kg", &format!("{sigma_kg}: between 0 and {largest:e}"));
            }
            beliefs.push((nanoseconds(time_s), believed(revision, belief, mass_kg, sigma_kg)));
        }
        Ok(beliefs)
    }

    /// The walls around a way: the largest box of keep-in boxes that hang together along an axis and hold it all.
    fn walls(&self, place: WorldPreset, reference: &Reference, radius_m: f64) -> Result<AlignedBox, TumbleError> {
        let key = "drive.control.walls";
        let points: Vec<Vector3<f64>> = match reference {
            Reference::Hold(pose) | Reference::Periodic { world_from_start: pose, .. } => vec![pose.translation.vector],
            Reference::Path(waypoints) => {
                waypoints.iter().map(|waypoint| waypoint.world_from_body.translation.vector).collect()
            }
            _ => return Err(self.bad(key, "walls are found around poses, ways and periodic motions")),
        };
        let boxes: Vec<AlignedBox> = place.volumes().keep_in;
        if boxes.is_empty() {
            return Err(self.bad(key, &format!("the world `{}` has no walls", place.name())));
        }
        let inner = holding(&boxes, &points).map(|found| AlignedBox {
            lower_world: found.lower_world.add_scalar(radius_m),
            upper_world: found.upper_world.add_scalar(-radius_m),
        });
        let holds =
            |inner: &AlignedBox| points.iter().all(|point| point >= &inner.lower_world && point <= &inner.upper_world);
        inner.filter(holds).ok_or_else(|| {
            self.bad(key, "no box of the place holds the whole way with the robot's radius around it; `walls = false` flies without")
        })
    }
}

fn boxed<C: Controller + Send + 'static>(controller: C) -> Box<dyn Controller + Send> {
    Box::new(controller)
}

/// Attitudes at which forces will be asked for: near those of the way, or any, whichever leaves more of the force.
fn span(reference: &Reference, force_limit: &Vector3<f64>) -> AttitudeSpan {
    let attitudes: Vec<UnitQuaternion<f64>> = match reference {
        Reference::Hold(pose) => vec![pose.rotation],
        Reference::Path(waypoints) => waypoints.iter().map(|waypoint| waypoint.world_from_body.rotation).collect(),
        _ => Vec::new(),
    };
    let near = attitudes.first().map(|first| {
        // each leg turns about one axis on the shorter way, so that its ends are farthest from a middle that is near
        let turns = attitudes.iter().map(|attitude| LieGroup::log(&(first.inverse() * attitude)));
        let (low, high) = turns.fold((Vector3::zeros(), Vector3::zeros()), |(low, high), turn: Vector3<f64>| {
            (turn.inf(&low), turn.sup(&high))
        });
        let middle: UnitQuaternion<f64> = LieGroup::exp(&((low + high) * 0.5));
        let axes_from_body = first * middle;
        let farthest = attitudes.iter().map(|attitude| attitude.angle_to(&axes_from_body)).fold(0.0, f64::max);
        AttitudeSpan::Near { axes_from_body, angle_rad: farthest + ATTITUDE_MARGIN_RAD }
    });
    let left = |span: &AttitudeSpan| span.inner_box(force_limit).min();
    near.filter(|near| left(near) > left(&AttitudeSpan::Any)).unwrap_or(AttitudeSpan::Any)
}

/// A belief in another mass.
fn believed(revision: u64, body: &InertialParameters<f64>, mass_kg: f64, sigma_kg: f64) -> ModelBelief {
    let parameters = InertialParameters::about_com(mass_kg, body.center_of_mass(), body.inertia_about_com());
    let mut belief = ModelBelief::certain(revision, parameters);
    belief.estimate.covariance[(0, 0)] = sigma_kg * sigma_kg;
    belief.estimate.std.mass_kg = sigma_kg;
    belief
}

/// The box with the largest volume among those that hold all points and lie within boxes that touch along one axis.
fn holding(boxes: &[AlignedBox], points: &[Vector3<f64>]) -> Option<AlignedBox> {
    let first = *points.first()?;
    let (low, high) = points.iter().fold((first, first), |(low, high), point| (low.inf(point), high.sup(point)));
    let candidates = (0..3).filter_map(|along| {
        // those that hold the way's shadow across the axis
        let mut holding: Vec<&AlignedBox> = boxes
            .iter()
            .filter(|b| (0..3).all(|i| i == along || (b.lower_world[i] <= low[i] && b.upper_world[i] >= high[i])))
            .collect();
        holding.sort_by(|a, b| a.lower_world[along].total_cmp(&b.lower_world[along]));
        let mut chain: Option<AlignedBox> = None;
        for next in holding {
            let (from, to) = (next.lower_world[along], next.upper_world[along]);
            chain = match chain {
                // before the way begins, or after it has ended, a box only narrows it
                None if to < low[along] => None,
                None if from > low[along] => return None,
                None => Some(*next),
                Some(found) if found.upper_world[along] >= high[along] => Some(found),
                Some(found) if from <= found.upper_world[along] + TOUCHING_M => {
                    let mut both = AlignedBox {
                        lower_world: found.lower_world.sup(&next.lower_world),
                        upper_world: found.upper_world.inf(&next.upper_world),
                    };
                    both.lower_world[along] = found.lower_world[along];
                    both.upper_world[along] = to.max(found.upper_world[along]);
                    Some(both)
                }
                Some(_) => return None,
            };
        }
        chain.filter(|found| found.upper_world[along] >= high[along])
    });
    let volume = |b: &AlignedBox| (b.upper_world - b.lower_world).product();
    candidates.max_by(|a, b| volume(a).total_cmp(&volume(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuboid(lower: [f64; 3], upper: [f64; 3]) -> AlignedBox {
        AlignedBox::between(lower.into(), upper.into())
    }

    #[test]
    fn a_way_through_two_boxes_has_their_common_cross_section_for_walls() {
        let boxes = [
            cuboid([0.0, 0.0, 0.0], [2.0, 4.0, 2.0]),
            cuboid([0.5, 4.0, -1.0], [3.0, 9.0, 1.5]),
            cuboid([10.0, 10.0, 10.0], [11.0, 11.0, 11.0]),
        ];
        let point = |x: f64, y: f64, z: f64| Vector3::new(x, y, z);
        let found = holding(&boxes, &[point(1.0, 1.0, 1.0), point(1.5, 8.0, 0.5)]).unwrap();
        assert_eq!(found, cuboid([0.5, 0.0, 0.0], [2.0, 9.0, 1.5]));
        // a way within one box has that box
        let found = holding(&boxes, &[point(1.0, 1.0, 1.0), point(1.5, 3.0, 0.5)]).unwrap();
        assert_eq!(found, boxes[0]);
        // round a corner, into a gap, out of everything
        assert!(holding(&boxes, &[point(0.1, 1.0, 1.0), point(1.5, 8.0, 0.5)]).is_none());
        assert!(holding(&boxes, &[point(1.0, 1.0, 1.0), point(10.5, 10.5, 10.5)]).is_none());
        assert!(holding(&boxes, &[point(-1.0, 1.0, 1.0)]).is_none() && holding(&boxes, &[]).is_none());
    }

    /// The way of the slalom on the station leads through two volumes.
    #[test]
    fn the_japanese_module_and_its_end_are_one_room() {
        let boxes = WorldPreset::Iss.volumes().keep_in;
        let way = [[10.8, -9.6, 4.8], [10.44, -9.0, 4.8], [11.06, -8.5, 5.0], [10.8, -7.75, 5.2]].map(Vector3::from);
        let walls = holding(&boxes, &way).unwrap();
        let sizes = walls.upper_world - walls.lower_world;
        assert!((walls.lower_world.y + 11.636_469_8).abs() < 1e-9 && (walls.upper_world.y + 2.753_199_8).abs() < 1e-9);
        assert!((sizes.x - 2.135_52).abs() < 1e-6 && (sizes.z - 2.134_92).abs() < 1e-6, "{sizes}");
    }
}
