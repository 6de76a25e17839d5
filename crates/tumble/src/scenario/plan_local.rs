//! From a scenario to the settings of a local plan.

use super::plan::{FORCE, LENGTH, RATE, Range, SPEED, TORQUE};
use super::plan_local_table::{
    CriterionName, EffortTable, LocalTable, MeasurementTable, PriorTable, TrackingTable, UnknownsName, WeightingName,
};
use super::{PlanningProblem, ScenarioSource};
use crate::TumbleError;
use crate::scenario::PropulsionName;
use tumble_astrobee::propulsion::nozzle_wrench_set;
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_identification::StandardDeviations;
use tumble_planning::local::{Criterion, SpeedLimits, WrenchSet};
use tumble_planning::{ModelBelief, inertia_sizes};

/// Steps of a horizon, RATTLE's.
const STEPS: usize = 40;
/// Most steps.
const MOST_STEPS: usize = 400;
/// Length of a step, s, RATTLE's.
const STEP_S: f64 = 0.3;
/// Weights of RATTLE's local planner for position, velocity, attitude and rate.
const TRACKING: [f64; 4] = [10.0, 5.0, 1.0, 1.0];
/// The same at the end.
const TERMINAL: [f64; 4] = [100.0; 4];
/// Standard deviations of position, velocity, attitude and rate as they are measured: m, m/s, rad, rad/s.
const MEASUREMENT: [f64; 4] = [0.01, 0.005, 0.01, 0.005];
/// What is not known of the mass and of the moments of inertia, as a share.
const MASS_SHARE: f64 = 0.05;
const INERTIA_SHARE: f64 = 0.33;
/// What is not known of the centre of mass, m.
const COM_M: f64 = 0.01;
/// Unknown nuisances beside the parameters: room is made for so many unknowns in all.
const MOST_UNKNOWNS: usize = 16;

const STEP: Range = Range { least: 1e-3, most: 60.0, unit: "s" };
const WEIGHT: Range = Range { least: 1e-12, most: 1e12, unit: "" };
const SIGMA: Range = Range { least: 1e-9, most: 1e9, unit: "" };
const SHARE: Range = Range { least: 1e-9, most: 10.0, unit: "" };

/// Everything about a local plan that the scenario says.
#[derive(Clone, Debug)]
pub struct LocalProblem {
    /// Steps of the horizon.
    pub steps: usize,
    /// Length of a step, s.
    pub step_s: f64,
    /// What is not known of the body.
    pub unknowns: UnknownsName,
    /// Prior standard deviations of force and torque scale, force (N) and torque (N m) bias, alike for the three axes; none for
    /// what is known.
    pub nuisances: [Option<f64>; 4],
    /// What is to be small.
    pub criterion: Criterion,
    /// How much information weighs.
    pub weighting: WeightingName,
    /// Weight of the variance of each quantity, if written.
    pub weights: Option<Vec<f64>>,
    /// Standard deviation at which each is known well enough, if written.
    pub target_sigmas: Option<Vec<f64>>,
    /// How much of the mission has passed.
    pub elapsed_share: f64,
    /// Weights of the errors of position, velocity, attitude and rate.
    pub tracking: [f64; 4],
    /// The same at the end.
    pub terminal: [f64; 4],
    /// Weights of torque and force.
    pub effort: [f64; 2],
    /// Weights of acceleration and angular acceleration.
    pub acceleration: [f64; 2],
    /// Torque and force that are admitted.
    pub wrench: WrenchSet<6>,
    /// Speed and rate that are admitted.
    pub speed: SpeedLimits,
    /// Standard deviations of position, velocity, attitude and rate.
    pub measurement: [f64; 4],
    /// Independent measurements per step.
    pub samples_per_step: f64,
    /// Distance kept, m.
    pub margin_m: f64,
    /// Whether obstacles are kept off all along.
    pub on_segments: bool,
    /// Natural frequencies of rotation and position of the feedback that flies what is planned, rad/s.
    pub tracker_rad_s: [f64; 2],
    /// Largest distance of the end from the reference, m, and speed there, m/s, if any.
    pub terminal_region: Option<(f64, f64)>,
    /// What the robot is taken for, and how well it is known.
    pub belief: ModelBelief,
}

impl LocalProblem {
    /// Length of the horizon, s.
    pub fn horizon_s(&self) -> f64 {
        self.step_s * self.steps as f64
    }
}

impl ScenarioSource {
    /// What `[plan.local]` says of a plan for this problem.
    ///
    /// # Errors
    /// [`TumbleError::BadScenario`] with the key and its place.
    pub fn local_problem(&self, problem: &PlanningProblem) -> Result<LocalProblem, TumbleError> {
        let nothing = LocalTable::default();
        let table = self.scenario.plan.as_ref().and_then(|plan| plan.local.as_ref()).unwrap_or(&nothing);
        let is_planar = problem.place.is_planar();
        let unknowns = table.unknowns.unwrap_or(if is_planar { UnknownsName::Planar } else { UnknownsName::Principal });
        if unknowns.is_planar() != is_planar {
            let these = if is_planar { "`planar` or `planar-com`" } else { "`principal` or `full`" };
            return Err(self.bad("plan.local.unknowns", &format!("{these} in the world `{}`", problem.place.name())));
        }
        let steps = table.steps.unwrap_or(STEPS);
        if !(1..=MOST_STEPS).contains(&steps) {
            return Err(self.bad("plan.local.steps", &format!("{steps}: 1 to {MOST_STEPS}")));
        }
        let elapsed_share = table.elapsed_share.unwrap_or(0.0);
        if !(0.0..=1.0).contains(&elapsed_share) {
            return Err(self.bad("plan.local.elapsed_share", &format!("{elapsed_share}: 0 to 1")));
        }
        Ok(LocalProblem {
            steps,
            step_s: self.local_number("step_s", table.step_s, STEP_S, &STEP)?,
            unknowns,
            nuisances: self.nuisances(table, unknowns)?,
            criterion: match table.criterion {
                None | Some(CriterionName::A) => Criterion::A,
                Some(CriterionName::D) => Criterion::D,
                Some(CriterionName::E) => Criterion::E,
            },
            weighting: table.weighting.unwrap_or(WeightingName::Fixed),
            weights: self.per_quantity("weights", table.weights.as_ref(), unknowns, &Range { least: 0.0, ..WEIGHT })?,
            target_sigmas: self.per_quantity("target_sigmas", table.target_sigmas.as_ref(), unknowns, &SIGMA)?,
            elapsed_share,
            tracking: self.tracking("tracking", table.tracking, TRACKING)?,
            terminal: self.tracking("terminal", table.terminal, TERMINAL)?,
            effort: self.effort(table.effort.unwrap_or_default())?,
            acceleration: self.acceleration(table.effort.unwrap_or_default())?,
            wrench: self.wrench_set(table, problem)?,
            speed: self.speed_limits(table, problem)?,
            measurement: self.measurement(table.measurement.unwrap_or_default())?,
            samples_per_step: {
                let samples = table.measurement.and_then(|measurement| measurement.samples_per_step);
                self.local_number("measurement.samples_per_step", samples, 1.0, &WEIGHT)?
            },
            margin_m: self.local_zero_or("margin_m", table.margin_m.unwrap_or(problem.margin_m), &LENGTH)?,
            on_segments: table.on_segments.unwrap_or(true),
            tracker_rad_s: self.tracker_rad_s()?,
            terminal_region: self.terminal_region(table)?,
            belief: self.prior(table.prior.unwrap_or_default(), problem.belief.parameters())?,
        })
    }

    /// A positive number of `[plan.local]`.
    fn local_number(&self, key: &str, value: Option<f64>, otherwise: f64, range: &Range) -> Result<f64, TumbleError> {
        let Range { least, most, unit } = range;
        let value = value.unwrap_or(otherwise);
        if (*least..=*most).contains(&value) {
            return Ok(value);
        }
        Err(self.bad(&format!("plan.local.{key}"), format!("{value:?}: {least:e} to {most:e} {unit}").trim_end()))
    }

    /// The same, or zero.
    fn local_zero_or(&self, key: &str, value: f64, range: &Range) -> Result<f64, TumbleError> {
        if value == 0.0 { Ok(value) } else { self.local_number(key, Some(value), value, range) }
    }

    /// One number for each quantity.
    fn per_quantity(
        &self,
        key: &str,
        values: Option<&Vec<f64>>,
        unknowns: UnknownsName,
        range: &Range,
    ) -> Result<Option<Vec<f64>>, TumbleError> {
        let Some(values) = values else { return Ok(None) };
        let place = format!("plan.local.{key}");
        if values.len() != unknowns.count() {
            let message = format!("{} numbers for {} quantities", values.len(), unknowns.count());
            return Err(self.bad(&place, &message));
        }
        for value in values {
            self.local_number(key, Some(*value), *value, range)?;
        }
        Ok(Some(values.clone()))
    }

    fn tracking(
        &self,
        table: &str,
        written: Option<TrackingTable>,
        otherwise: [f64; 4],
    ) -> Result<[f64; 4], TumbleError> {
        let written = written.unwrap_or_default();
        let keys = ["position", "velocity", "attitude", "rate"];
        let values = [written.position, written.velocity, written.attitude, written.rate];
        let mut weights = otherwise;
        for ((weight, key), value) in weights.iter_mut().zip(keys).zip(values) {
            *weight = self.local_zero_or(&format!("{table}.{key}"), value.unwrap_or(*weight), &WEIGHT)?;
        }
        Ok(weights)
    }

    fn effort(&self, table: EffortTable) -> Result<[f64; 2], TumbleError> {
        Ok([
            self.local_number("effort.torque", table.torque, 1.0, &WEIGHT)?,
            self.local_number("effort.force", table.force, 1.0, &WEIGHT)?,
        ])
    }

    fn acceleration(&self, table: EffortTable) -> Result<[f64; 2], TumbleError> {
        let angular = table.angular_acceleration.unwrap_or(0.0);
        Ok([
            self.local_zero_or("effort.acceleration", table.acceleration.unwrap_or(0.0), &WEIGHT)?,
            self.local_zero_or("effort.angular_acceleration", angular, &WEIGHT)?,
        ])
    }

    fn measurement(&self, table: MeasurementTable) -> Result<[f64; 4], TumbleError> {
        let keys = ["position_sigma_m", "velocity_sigma_m_s", "attitude_sigma_rad", "rate_sigma_rad_s"];
        let values =
            [table.position_sigma_m, table.velocity_sigma_m_s, table.attitude_sigma_rad, table.rate_sigma_rad_s];
        let mut sigmas = MEASUREMENT;
        for ((sigma, key), value) in sigmas.iter_mut().zip(keys).zip(values) {
            let value = value.unwrap_or(*sigma);
            if value != f64::INFINITY {
                self.local_number(&format!("measurement.{key}"), Some(value), value, &SIGMA)?;
            }
            *sigma = value;
        }
        Ok(sigmas)
    }

    fn nuisances(&self, table: &LocalTable, unknowns: UnknownsName) -> Result<[Option<f64>; 4], TumbleError> {
        let Some(written) = table.nuisances else { return Ok([None; 4]) };
        let keys = ["force_scale_sigma", "torque_scale_sigma", "force_bias_sigma_n", "torque_bias_sigma_n_m"];
        let sigmas = [
            written.force_scale_sigma,
            written.torque_scale_sigma,
            written.force_bias_sigma_n,
            written.torque_bias_sigma_n_m,
        ];
        for (key, sigma) in keys.into_iter().zip(sigmas) {
            if let Some(sigma) = sigma {
                self.local_number(&format!("nuisances.{key}"), Some(sigma), sigma, &SIGMA)?;
            }
        }
        let count = unknowns.count() + 3 * sigmas.iter().flatten().count();
        if unknowns.is_planar() {
            return Err(self.bad("plan.local.nuisances", "not on the table"));
        }
        if count > MOST_UNKNOWNS {
            let message = format!("{count} unknowns with those of the body, at most {MOST_UNKNOWNS}");
            return Err(self.bad("plan.local.nuisances", &message));
        }
        Ok(sigmas)
    }

    fn wrench_set(&self, table: &LocalTable, problem: &PlanningProblem) -> Result<WrenchSet<6>, TumbleError> {
        let limit = |key: &str, written: Option<[f64; 3]>, otherwise: &Vector3<f64>, range: &Range| {
            let values = written.unwrap_or((*otherwise).into());
            // On the table nothing pushes along the vertical.
            let values = if problem.place.is_planar() && key == "force_limit_n" {
                [values[0], values[1], f64::max(values[2], range.least)]
            } else {
                values
            };
            self.each_limit(key, written.is_some(), values, range)?;
            Ok::<_, TumbleError>(values)
        };
        let [tx, ty, tz] = limit("torque_limit_n_m", table.torque_limit_n_m, &problem.limits.torque_n_m, &TORQUE)?;
        let [fx, fy, fz] = limit("force_limit_n", table.force_limit_n, &problem.limits.force_n, &FORCE)?;
        let mut set = WrenchSet { limit: [tx, ty, tz, fx, fy, fz], half_spaces: Vec::new() };
        if table.nozzles == Some(true) {
            if self.scenario.propulsion.kind != PropulsionName::Plant {
                return Err(self.bad("plan.local.nozzles", "only with `propulsion.kind = \"plant\"`"));
            }
            let nozzles = nozzle_wrench_set(self.flight_mode()?.impellers())
                .ok_or_else(|| self.bad("plan.local.nozzles", "with the flight mode `off` there is no thrust"))?;
            for (limit, most) in set.limit.iter_mut().zip(nozzles.limit) {
                *limit = limit.min(most);
            }
            set.half_spaces = nozzles.half_spaces;
        }
        Ok(set)
    }

    /// The limits of a key, written in `[plan.local]` or else those of `[plan]`, which may be zero there.
    fn each_limit(&self, key: &str, is_written: bool, values: [f64; 3], range: &Range) -> Result<(), TumbleError> {
        let is_speed = key.starts_with("speed") || key.starts_with("rate");
        for value in values.into_iter().filter(|value| !(is_speed && *value == f64::INFINITY)) {
            if !is_written && value < range.least {
                let Range { least, unit, .. } = range;
                let message = format!("{value:?}: with `--local` at least {least:e} {unit}, here or in `[plan.local]`");
                return Err(self.bad(&format!("plan.{key}"), &message));
            }
            self.local_number(key, Some(value), value, range)?;
        }
        Ok(())
    }

    fn speed_limits(&self, table: &LocalTable, problem: &PlanningProblem) -> Result<SpeedLimits, TumbleError> {
        let speed = table.speed_limit_m_s.unwrap_or(problem.limits.speed_m_s.into());
        let rate = table.rate_limit_rad_s.unwrap_or([problem.limits.rate_rad_s; 3]);
        self.each_limit("speed_limit_m_s", table.speed_limit_m_s.is_some(), speed, &SPEED)?;
        self.each_limit("rate_limit_rad_s", table.rate_limit_rad_s.is_some(), rate, &RATE)?;
        Ok(SpeedLimits { speed_m_s: speed.into(), rate_rad_s: rate.into() })
    }

    fn terminal_region(&self, table: &LocalTable) -> Result<Option<(f64, f64)>, TumbleError> {
        let (radius_m, speed_m_s) = (table.terminal_radius_m, table.terminal_speed_m_s);
        match (radius_m, speed_m_s) {
            (None, None) => Ok(None),
            (Some(_), None) => Err(self.bad("plan.local.terminal_radius_m", "`terminal_speed_m_s` is needed as well")),
            (None, Some(_)) => Err(self.bad("plan.local.terminal_speed_m_s", "`terminal_radius_m` is needed as well")),
            (Some(radius_m), Some(speed_m_s)) => {
                let length = Range { least: 1e-6, ..LENGTH };
                self.local_number("terminal_radius_m", Some(radius_m), radius_m, &length)?;
                self.local_number("terminal_speed_m_s", Some(speed_m_s), speed_m_s, &SPEED)?;
                Ok(Some((radius_m, speed_m_s)))
            }
        }
    }

    /// The body with how well it is known: mass, centre of mass and inertia about it, independent of one another.
    fn prior(&self, table: PriorTable, body: &InertialParameters<f64>) -> Result<ModelBelief, TumbleError> {
        let number = |key: &str, value: Option<f64>, otherwise: f64, range: &Range| {
            self.local_number(&format!("prior.{key}"), value, otherwise, range)
        };
        let one_of = |first: Option<f64>, second: Option<f64>, key: &str| match (first, second) {
            (Some(_), Some(_)) => {
                Err(self.bad(&format!("plan.local.prior.{key}"), "as a number or as a share, not both"))
            }
            _ => Ok(()),
        };
        one_of(table.mass_sigma_kg, table.mass_sigma_share, "mass_sigma_share")?;
        one_of(table.inertia_sigma_kg_m2, table.inertia_sigma_share, "inertia_sigma_share")?;
        let mass_kg = match table.mass_sigma_kg {
            Some(sigma) => number("mass_sigma_kg", Some(sigma), sigma, &SIGMA)?,
            None => body.mass * number("mass_sigma_share", table.mass_sigma_share, MASS_SHARE, &SHARE)?,
        };
        let com_m = number("com_sigma_m", table.com_sigma_m, COM_M, &SIGMA)?;
        let share = number("inertia_sigma_share", table.inertia_sigma_share, INERTIA_SHARE, &SHARE)?;
        let inertia = match table.inertia_sigma_kg_m2 {
            Some(sigma) => Matrix3::repeat(number("inertia_sigma_kg_m2", Some(sigma), sigma, &SIGMA)?),
            None => share * inertia_sizes(body),
        };
        let std =
            StandardDeviations { mass_kg, center_of_mass_m: Vector3::repeat(com_m), inertia_about_com_kg_m2: inertia };
        Ok(ModelBelief::independent(0, *body, std))
    }
}
