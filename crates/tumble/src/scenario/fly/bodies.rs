//! What the robot is, what it is taken for, how well it is known, and the limits that follow.

use super::numbers::{FlyNumbers, PRIOR, RELATIVE};
use crate::TumbleError;
use crate::mission::ModelChoice;
use crate::scenario::{BodyTable, DriveTable, LimitsTable, NONE, PlanningProblem, ScenarioSource};
use tumble_astrobee::simulator::planar_part;
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_identification::{Estimate, StandardDeviations};
use tumble_planning::{ModelBelief, inertia_sizes};

/// Mass, moment of inertia about each axis: the original's light guess.
///
/// Provenance: rattle-iros-2022 (93d2f99), its model 2.
const LOW: (f64, f64) = (5.0, 0.075);
/// Its heavy guess.
///
/// Provenance: as [`LOW`], its model 3.
const HIGH: (f64, f64) = (20.0, 0.3);
/// Robot, arm and carriage with the payload: mass, y of the centre of mass, moments about it.
///
/// Provenance: thesis, table 6.2, which has Izz only. About x the two parts lie as far apart as about z; about y, along which they
/// lie, they add: 0.25 and 0.015. The table's 305 for the payload's place is taken for millimetres, which gives 0.117 m and Izz 0.94.
const PAYLOAD: (f64, f64, [f64; 3]) = (30.8, -0.12, [0.94, 0.265, 0.94]);

impl ScenarioSource {
    /// What the robot is taken for at the start.
    pub(super) fn mission_belief(
        &self,
        place: WorldPreset,
        model: ModelChoice,
    ) -> Result<InertialParameters<f64>, TumbleError> {
        let like = |(mass, moment): (f64, f64)| {
            InertialParameters::about_com(mass, Vector3::zeros(), Matrix3::from_diagonal_element(moment))
        };
        let belief = match model {
            ModelChoice::Scenario => self.bodies(place)?.1,
            ModelChoice::True => {
                let is_held = self.scenario.payload.as_ref().is_some_and(|payload| payload.attach_s <= 0.0);
                self.true_body(place, is_held)?
            }
            ModelChoice::Low => like(LOW),
            ModelChoice::High => like(HIGH),
            ModelChoice::Payload => {
                let (mass, y, moments) = PAYLOAD;
                let inertia = Matrix3::from_diagonal(&Vector3::from(moments));
                InertialParameters::about_com(mass, Vector3::new(0.0, y, 0.0), inertia)
            }
        };
        Ok(if place.is_planar() { planar_part(&belief) } else { belief })
    }

    /// What the robot is, with or without what it takes hold of.
    pub(super) fn true_body(
        &self,
        place: WorldPreset,
        with_payload: bool,
    ) -> Result<InertialParameters<f64>, TumbleError> {
        let (body, _) = self.bodies(place)?;
        let grasp = self.grasp()?.filter(|_| with_payload);
        Ok(grasp.map_or(body, |grasp| body.with_payload(&grasp.payload, &grasp.robot_from_payload)))
    }

    /// Whether the robot holds something in the end.
    pub(super) fn payload_in_the_end(&self) -> bool {
        self.scenario.payload.as_ref().is_some_and(|payload| payload.release_s.is_none())
    }

    /// The believed body with how well it is known.
    pub(super) fn mission_prior(&self, belief: &InertialParameters<f64>) -> Result<Estimate, TumbleError> {
        let table = self.scenario.fly.as_ref().and_then(|fly| fly.prior).unwrap_or_default();
        let [mass_share, com_m, inertia_share] = PRIOR;
        let number = |key: &str, value: Option<f64>, otherwise: f64| {
            self.fly(&format!("prior.{key}"), value, otherwise, &RELATIVE)
        };
        for (key, both) in [
            ("mass_sigma_share", table.mass_sigma_kg.is_some() && table.mass_sigma_share.is_some()),
            ("inertia_sigma_share", table.inertia_sigma_kg_m2.is_some() && table.inertia_sigma_share.is_some()),
        ] {
            if both {
                return Err(self.bad(&format!("fly.prior.{key}"), "as a number or as a share, not both"));
            }
        }
        let mass_kg = match table.mass_sigma_kg {
            Some(sigma) => number("mass_sigma_kg", Some(sigma), sigma)?,
            None => belief.mass * number("mass_sigma_share", table.mass_sigma_share, mass_share)?,
        };
        let share = number("inertia_sigma_share", table.inertia_sigma_share, inertia_share)?;
        let std = StandardDeviations {
            mass_kg,
            center_of_mass_m: Vector3::repeat(number("com_sigma_m", table.com_sigma_m, com_m)?),
            inertia_about_com_kg_m2: match table.inertia_sigma_kg_m2 {
                Some(sigma) => Matrix3::repeat(number("inertia_sigma_kg_m2", Some(sigma), sigma)?),
                None => share * inertia_sizes(belief),
            },
        };
        Ok(ModelBelief::independent(0, *belief, std).estimate)
    }

    /// The scenario with nobody at the controls, this seed and this belief.
    pub(super) fn as_flown(&self, seed: u64, belief: &InertialParameters<f64>, numbers: &FlyNumbers) -> Self {
        let mut flown = self.clone();
        flown.scenario.seed = seed;
        flown.scenario.belief = Some(BodyTable::of(belief));
        flown.scenario.drive = DriveTable { controller: Some(NONE.to_owned()), ..DriveTable::default() };
        flown.scenario.limits =
            Some(LimitsTable { speed_m_s: Some(numbers.speed_limit_m_s), rate_rad_s: Some(numbers.rate_limit_rad_s) });
        flown
    }

    /// Planners get their shares of what the controller has, whatever the attitude, unless `[plan]` says what they get.
    pub(super) fn share_limits(&self, planning: &mut PlanningProblem, numbers: &FlyNumbers) {
        let written = self.scenario.plan.as_ref();
        let limits = &mut planning.limits;
        if written.is_none_or(|plan| plan.force_limit_n.is_none()) {
            // A cube of world axes within the ball within the box of body axes.
            limits.force_n = if planning.place.is_planar() {
                let each = numbers.plan_force_share * numbers.force_limit_n.xy().min() / std::f64::consts::SQRT_2;
                Vector3::new(each, each, 0.0)
            } else {
                Vector3::repeat(numbers.plan_force_share * numbers.force_limit_n.min() / libm::sqrt(3.0))
            };
        }
        if written.is_none_or(|plan| plan.torque_limit_n_m.is_none()) {
            limits.torque_n_m = numbers.torque_limit_n_m * numbers.plan_torque_share;
        }
        // A stretch has to be able to follow the way.
        let (motion, planar) = (numbers.planned_motion(), planning.place.is_planar());
        limits.rate_rad_s = limits.rate_rad_s.min(WAY_SHARE * motion.rate_of_an_axis_rad_s(planar));
        let mass_kg = planning.belief.estimate.parameters.mass;
        limits.force_n = limits.force_n.map(|force| force.min(motion.force_of_an_axis_n(mass_kg, planar)));
    }

    /// When the robot learns of each obstacle: of those of the set before it starts.
    pub(in crate::scenario) fn seen_from_s(&self, place: WorldPreset) -> Result<Vec<f64>, TumbleError> {
        let of_set = self.world(place)?.0.obstacles.len() - self.scenario.obstacles.len();
        let mut seen_from_s = vec![0.0; of_set];
        for (index, table) in self.scenario.obstacles.iter().enumerate() {
            let seen_s = table.seen_s.or(table.appear_s).unwrap_or(0.0);
            if !(seen_s >= 0.0 && seen_s.is_finite()) {
                return Err(self.bad_in("obstacles", index, "seen_s", &format!("{seen_s}: 0 or later")));
            }
            seen_from_s.push(seen_s);
        }
        Ok(seen_from_s)
    }
}

/// Of the rate of stretches, so much is asked for by the way that they follow.
const WAY_SHARE: f64 = 0.8;

impl BodyTable {
    /// The numbers of a body.
    pub fn of(body: &InertialParameters<f64>) -> Self {
        let inertia = body.inertia_about_com();
        Self {
            mass_kg: Some(body.mass),
            com_m: Some(body.center_of_mass().into()),
            inertia_about_com_kg_m2: Some(std::array::from_fn(|row| {
                std::array::from_fn(|column| inertia[(row, column)])
            })),
            ..Self::default()
        }
    }
}
