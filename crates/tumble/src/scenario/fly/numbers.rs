//! The numbers of `[fly]`, checked, with what holds where nothing is written.

use super::FlyTable;
use crate::TumbleError;
use crate::scenario::mission_problem::{ArrivalTolerance, ComputingSettings, PlannedMotion, WeightingSettings};
use crate::scenario::plan::{FORCE, Range, TORQUE};
use crate::scenario::{ScenarioSource, UnknownsName};
use tumble_astrobee::control_presets::{MASS_UNKNOWN_SHARE, THESIS_FORCE_N, THESIS_TORQUE_N_M};
use tumble_astrobee::planning_presets::COVARIANCE_WEIGHTING;
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::{SVector, Vector3};
use tumble_identification::recursive::MotionNoise;
use tumble_identification::sensing::Sensing;
use tumble_planning::mission::StopLimits;

/// Steps of a stretch and their length, s: RATTLE's.
const STRETCH: (usize, f64) = (40, 0.3);
/// Most steps of a stretch.
const MOST_STEPS: usize = 200;
/// Time between beliefs, s.
const BELIEF_PERIOD_S: f64 = 2.0;
/// How long before they are flown stretches and ways are planned, s.
const LEAD_S: (f64, f64) = (3.0, 4.0);
/// Share of force and torque that plans use: half, since the mass may be twice what it is taken for, less what corrects errors.
const PLAN_SHARE: (f64, f64) = (0.35, 0.35);
/// Distance kept from everything unless `[plan]` says otherwise, m.
const MARGIN_M: f64 = 0.03;
/// Weight of a variance, over the square of the quantity's size: moments of inertia are known to half of what plain flights know, for a few
/// hundredths more thrust and no more time. RATTLE's own planners ask for more.
const RELATIVE_WEIGHT: f64 = 3.0;
/// Standard deviations at which mass (kg), centre of mass (m) and inertia (kg m^2) are known well enough.
const TARGETS: [f64; 3] = [0.1, 0.003, 0.004];
/// What is not known of mass, centre of mass (m) and inertia: a factor between a half and two has this deviation of its logarithm.
pub(super) const PRIOR: [f64; 3] = [0.4, 0.08, 0.4];
/// Most stretches of station keeping.
const MOST_STATION_STRETCHES: u32 = 100;

/// What counts as having arrived unless it is written.
const ARRIVAL: ArrivalTolerance =
    ArrivalTolerance { position_m: 0.02, attitude_rad: 0.05, speed_m_s: 0.005, rate_rad_s: 0.01, for_s: 2.0 };
/// What the estimator takes for noise where neither it is written nor the sensors state it: a pose, velocity, rate and acceleration at 62.5 Hz
/// that are white.
const NOISE: [f64; 5] = [4e-3, 2e-3, 1e-3, 1e-3, 1e-2];
/// The same of the wrench, N m and N: what is left of it from one period to the next beside errors that stay. With more, a body on the station is
/// stated up to three times less certain than it is; with so little on the table, a body that changed by a tenth is doubted twice.
const WRENCH_NOISE: [f64; 2] = [3e-5, 3e-4];
const WRENCH_NOISE_ON_TABLE: [f64; 2] = [2e-4, 2e-3];
/// What mass and lengths of a body change by in a second, as a share.
const DRIFT_SHARE: f64 = 1e-4;
/// Units for the first way, for a new one and for a stretch, simulated time of a unit of each, ns, and by what share it may be longer.
const COMPUTING: ComputingSettings = ComputingSettings {
    global_units: 20_000,
    replan_units: 1_200,
    local_units: 25_600,
    global_unit_ns: 50_000,
    local_unit_ns: 50_000,
    jitter_share: 0.3,
};
/// Most units of a computation, and longest time of one, ns.
const MOST_UNITS: u64 = 1_000_000_000;
const LONGEST_UNIT_NS: u64 = 1_000_000_000;
/// Share of the least force and torque that stops use, with as much mass and inertia as may be.
const STOP_SHARE: f64 = 0.6;

const SHARE: Range = Range { least: 1e-3, most: 1.0, unit: "" };
const SECONDS: Range = Range { least: 0.016, most: 600.0, unit: "s" };
const STEP: Range = Range { least: 0.016, most: 10.0, unit: "s" };
const DISTANCE: Range = Range { least: 1e-6, most: 1e3, unit: "m" };
const ANGLE: Range = Range { least: 1e-6, most: 4.0, unit: "rad" };
const SIGMA: Range = Range { least: 1e-9, most: 1e9, unit: "" };
const WEIGHT: Range = Range { least: 1e-12, most: 1e12, unit: "" };
pub(super) const RELATIVE: Range = Range { least: 1e-6, most: 100.0, unit: "" };
const FACTOR: Range = Range { least: 1e-3, most: 1e3, unit: "" };
const SLOW: Range = Range { least: 1e-6, most: 1e3, unit: "m/s" };
const TURN: Range = Range { least: 1e-6, most: 1e3, unit: "rad/s" };
const ACCELERATION: Range = Range { least: 1e-6, most: 1e3, unit: "m/s^2" };
const ANGULAR_ACCELERATION: Range = Range { least: 1e-6, most: 1e3, unit: "rad/s^2" };

/// Everything that `[fly]` says, and what it leaves out.
pub(in crate::scenario) struct FlyNumbers {
    pub unknowns: UnknownsName,
    pub mass_interval_share: [f64; 2],
    pub force_limit_n: Vector3<f64>,
    pub torque_limit_n_m: Vector3<f64>,
    pub plan_force_share: f64,
    pub plan_torque_share: f64,
    pub speed_limit_m_s: f64,
    pub rate_limit_rad_s: f64,
    pub stretch_steps: usize,
    pub step_s: f64,
    pub belief_period_s: f64,
    pub stretch_lead_s: f64,
    pub way_lead_s: f64,
    pub margin_m: f64,
    pub station_stretches: u32,
    pub computing: ComputingSettings,
    pub arrival: ArrivalTolerance,
    pub noise: MotionNoise,
    pub drift_share: f64,
    /// The robot's sensors as it is told of them.
    pub sensing: Sensing,
    /// Along the way, m/s^2, and of the turn, rad/s^2; by the body where they are not written.
    stop: (Option<f64>, Option<f64>),
    /// Weight, targets of mass, centre of mass, inertia.
    information: [f64; 4],
    /// Alpha and beta.
    shut_off: [f64; 2],
}

impl ScenarioSource {
    /// `[fly]`, checked.
    pub(in crate::scenario) fn fly_numbers(&self, place: WorldPreset) -> Result<FlyNumbers, TumbleError> {
        let nothing = FlyTable::default();
        let table = self.scenario.fly.as_ref().unwrap_or(&nothing);
        let limits = self.flight_mode()?.limits(place.site());
        let [speed, rate] =
            [self.scenario.limits.and_then(|l| l.speed_m_s), self.scenario.limits.and_then(|l| l.rate_rad_s)];
        let arrival = table.arrival.unwrap_or_default();
        let information = table.information.unwrap_or_default();
        let [alpha, beta] = COVARIANCE_WEIGHTING;
        let sensing = self.stated_sensing(place)?;
        let [mass, com, inertia] = TARGETS;
        Ok(FlyNumbers {
            unknowns: self.fly_unknowns(place, table.unknowns)?,
            mass_interval_share: self.fly_interval(table.mass_interval_share)?,
            force_limit_n: self.fly_limits("force_limit_n", table.force_limit_n, THESIS_FORCE_N, &FORCE)?,
            torque_limit_n_m: self.fly_limits(
                "torque_limit_n_m",
                table.torque_limit_n_m,
                THESIS_TORQUE_N_M,
                &TORQUE,
            )?,
            plan_force_share: self.fly("plan_force_share", table.plan_force_share, PLAN_SHARE.0, &SHARE)?,
            plan_torque_share: self.fly("plan_torque_share", table.plan_torque_share, PLAN_SHARE.1, &SHARE)?,
            speed_limit_m_s: self.positive("limits.speed_m_s", speed, limits.speed_m_s)?,
            rate_limit_rad_s: self.positive("limits.rate_rad_s", rate, limits.rate_rad_s)?,
            stretch_steps: self.fly_steps(table.stretch_steps)?,
            step_s: self.fly("step_s", table.step_s, STRETCH.1, &STEP)?,
            belief_period_s: self.fly("belief_period_s", table.belief_period_s, BELIEF_PERIOD_S, &SECONDS)?,
            stretch_lead_s: self.fly("stretch_lead_s", table.stretch_lead_s, LEAD_S.0, &SECONDS)?,
            way_lead_s: self.fly("way_lead_s", table.way_lead_s, LEAD_S.1, &SECONDS)?,
            margin_m: self.scenario.plan.as_ref().and_then(|plan| plan.margin_m).unwrap_or(MARGIN_M),
            station_stretches: self.fly_stretches(table.station_stretches)?,
            computing: self.fly_computing(table)?,
            arrival: ArrivalTolerance {
                position_m: self.fly("arrival.position_m", arrival.position_m, ARRIVAL.position_m, &DISTANCE)?,
                attitude_rad: self.fly("arrival.attitude_rad", arrival.attitude_rad, ARRIVAL.attitude_rad, &ANGLE)?,
                speed_m_s: self.fly("arrival.speed_m_s", arrival.speed_m_s, ARRIVAL.speed_m_s, &SLOW)?,
                rate_rad_s: self.fly("arrival.rate_rad_s", arrival.rate_rad_s, ARRIVAL.rate_rad_s, &TURN)?,
                for_s: self.fly("arrival.for_s", arrival.for_s, ARRIVAL.for_s, &SECONDS)?,
            },
            noise: self.fly_noise(place, table, &sensing)?,
            drift_share: self.fly_or_zero(
                "estimator.drift",
                table.estimator.and_then(|written| written.drift),
                DRIFT_SHARE,
                &SIGMA,
            )?,
            sensing,
            stop: (
                self.fly_some("stop_acceleration_m_s2", table.stop_acceleration_m_s2, &ACCELERATION)?,
                self.fly_some(
                    "stop_angular_acceleration_rad_s2",
                    table.stop_angular_acceleration_rad_s2,
                    &ANGULAR_ACCELERATION,
                )?,
            ),
            information: [
                self.fly_or_zero("information.weight", information.weight, RELATIVE_WEIGHT, &WEIGHT)?,
                self.fly("information.target_mass_kg", information.target_mass_kg, mass, &SIGMA)?,
                self.fly("information.target_com_m", information.target_com_m, com, &SIGMA)?,
                self.fly("information.target_inertia_kg_m2", information.target_inertia_kg_m2, inertia, &SIGMA)?,
            ],
            shut_off: [
                self.fly("information.alpha", information.alpha, alpha, &FACTOR)?,
                self.fly("information.beta", information.beta, beta, &FACTOR)?,
            ],
        })
    }
}

/// Helpers of [`ScenarioSource::fly_numbers`]: each names its key in `[fly]`.
impl ScenarioSource {
    /// A number within a range.
    pub(super) fn fly(&self, key: &str, value: Option<f64>, otherwise: f64, range: &Range) -> Result<f64, TumbleError> {
        let Range { least, most, unit } = range;
        let value = value.unwrap_or(otherwise);
        if (*least..=*most).contains(&value) {
            return Ok(value);
        }
        Err(self.bad(&format!("fly.{key}"), format!("{value:?}: {least:e} to {most:e} {unit}").trim_end()))
    }

    /// The same, or zero.
    fn fly_or_zero(&self, key: &str, value: Option<f64>, otherwise: f64, range: &Range) -> Result<f64, TumbleError> {
        if value == Some(0.0) { Ok(0.0) } else { self.fly(key, value, otherwise, range) }
    }

    /// The same where it is written.
    fn fly_some(&self, key: &str, value: Option<f64>, range: &Range) -> Result<Option<f64>, TumbleError> {
        value.map(|value| self.fly(key, Some(value), value, range)).transpose()
    }

    fn fly_limits(
        &self,
        key: &str,
        written: Option<[f64; 3]>,
        otherwise: [f64; 3],
        range: &Range,
    ) -> Result<Vector3<f64>, TumbleError> {
        let values = written.unwrap_or(otherwise);
        for value in values {
            self.fly(key, Some(value), value, range)?;
        }
        Ok(values.into())
    }

    fn fly_units(&self, key: &str, value: Option<u64>, otherwise: u64, most: u64) -> Result<u64, TumbleError> {
        let value = value.unwrap_or(otherwise);
        if (1..=most).contains(&value) {
            return Ok(value);
        }
        Err(self.bad(&format!("fly.computing.{key}"), &format!("{value}: 1 to {most}")))
    }

    fn fly_steps(&self, written: Option<usize>) -> Result<usize, TumbleError> {
        let steps = written.unwrap_or(STRETCH.0);
        if (2..=MOST_STEPS).contains(&steps) {
            return Ok(steps);
        }
        Err(self.bad("fly.stretch_steps", &format!("{steps}: 2 to {MOST_STEPS}")))
    }

    fn fly_stretches(&self, written: Option<u32>) -> Result<u32, TumbleError> {
        let stretches = written.unwrap_or(0);
        if stretches <= MOST_STATION_STRETCHES {
            return Ok(stretches);
        }
        Err(self.bad("fly.station_stretches", &format!("{stretches}: 0 to {MOST_STATION_STRETCHES}")))
    }

    fn fly_unknowns(&self, place: WorldPreset, written: Option<UnknownsName>) -> Result<UnknownsName, TumbleError> {
        let is_planar = place.is_planar();
        let unknowns = written.unwrap_or(if is_planar { UnknownsName::PlanarCom } else { UnknownsName::Full });
        if unknowns.is_planar() == is_planar {
            return Ok(unknowns);
        }
        let these = if is_planar { "`planar` or `planar-com`" } else { "`principal` or `full`" };
        Err(self.bad("fly.unknowns", &format!("{these} in the world `{}`", place.name())))
    }

    fn fly_interval(&self, written: Option<[f64; 2]>) -> Result<[f64; 2], TumbleError> {
        let share @ [least, largest] = written.unwrap_or(MASS_UNKNOWN_SHARE);
        if least > 0.0 && least <= 1.0 && (1.0..=1e3).contains(&largest) {
            return Ok(share);
        }
        let message =
            format!("{least} to {largest}: from above 0 to at most 1000 with 1, the believed mass, between them");
        Err(self.bad("fly.mass_interval_share", &message))
    }

    fn fly_noise(&self, place: WorldPreset, table: &FlyTable, sensing: &Sensing) -> Result<MotionNoise, TumbleError> {
        let written = table.estimator.unwrap_or_default();
        let [attitude, position, rate, velocity, acceleration] = NOISE;
        let [torque, force] = if place.is_planar() { WRENCH_NOISE_ON_TABLE } else { WRENCH_NOISE };
        let [attitude, position, velocity] =
            [(sensing.attitude, attitude), (sensing.position, position), (sensing.velocity, velocity)]
                .map(|(errors, otherwise)| errors.white.or(otherwise));
        let [rate, acceleration] = [(sensing.rate.white, rate), (sensing.acceleration.white, acceleration)]
            .map(|(white, otherwise)| white.or(otherwise));
        let number = |key: &str, value, otherwise| self.fly(&format!("estimator.{key}"), value, otherwise, &SIGMA);
        Ok(MotionNoise {
            attitude_rad: number("attitude_rad", written.attitude_rad, attitude)?,
            position_m: number("position_m", written.position_m, position)?,
            rate_rad_s: number("rate_rad_s", written.rate_rad_s, rate)?,
            velocity_m_s: number("velocity_m_s", written.velocity_m_s, velocity)?,
            acceleration_m_s2: number("acceleration_m_s2", written.acceleration_m_s2, acceleration)?,
            torque_n_m: number("torque_n_m", written.torque_n_m, torque)?,
            force_n: number("force_n", written.force_n, force)?,
            drift: SVector::zeros(),
        })
    }

    fn fly_computing(&self, table: &FlyTable) -> Result<ComputingSettings, TumbleError> {
        let written = table.computing.unwrap_or_default();
        let ComputingSettings { global_units, replan_units, local_units, global_unit_ns, local_unit_ns, jitter_share } =
            COMPUTING;
        Ok(ComputingSettings {
            global_units: self.fly_units("global_units", written.global_units, global_units, MOST_UNITS)?,
            replan_units: self.fly_units("replan_units", written.replan_units, replan_units, MOST_UNITS)?,
            local_units: self.fly_units("local_units", written.local_units, local_units, MOST_UNITS)?,
            global_unit_ns: self.fly_units(
                "global_unit_ns",
                written.global_unit_ns,
                global_unit_ns,
                LONGEST_UNIT_NS,
            )?,
            local_unit_ns: self.fly_units("local_unit_ns", written.local_unit_ns, local_unit_ns, LONGEST_UNIT_NS)?,
            jitter_share: self.fly_or_zero("computing.jitter_share", written.jitter_share, jitter_share, &FACTOR)?,
        })
    }
}

/// Places of the quantities among mass, centre of mass and inertia about it.
fn places(unknowns: UnknownsName) -> &'static [usize] {
    match unknowns {
        UnknownsName::Principal => &[0, 4, 7, 9],
        UnknownsName::Full => &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9],
        UnknownsName::Planar => &[0, 9],
        UnknownsName::PlanarCom => &[0, 9, 1, 2],
    }
}

/// The size against which a deviation of a quantity is large or small: mass, radius of gyration, mean of two moments.
fn size(body: &InertialParameters<f64>, place: usize) -> f64 {
    let inertia = body.inertia_about_com();
    let mean = |row: usize, column: usize| libm::sqrt(inertia[(row, row)] * inertia[(column, column)]);
    match place {
        0 => body.mass,
        1..=3 => libm::sqrt(0.5 * inertia.trace() / body.mass),
        4 => mean(0, 0),
        5 => mean(0, 1),
        6 => mean(0, 2),
        7 => mean(1, 1),
        8 => mean(1, 2),
        _ => mean(2, 2),
    }
}

impl FlyNumbers {
    /// How fast planners may move the robot without losing its localisation.
    pub(super) fn planned_motion(&self) -> PlannedMotion {
        PlannedMotion::of(self.sensing.localization_limits)
    }

    /// What information about a body is worth.
    pub(super) fn weighting(&self, body: &InertialParameters<f64>) -> WeightingSettings {
        let [weight, mass, com, inertia] = self.information;
        let [alpha, beta] = self.shut_off;
        let (mut gamma0, mut target_variance) = (Vec::new(), Vec::new());
        for place in places(self.unknowns).iter().copied() {
            let size = size(body, place);
            gamma0.push(weight / (size * size));
            let target = match place {
                0 => mass,
                1..=3 => com,
                _ => inertia,
            };
            target_variance.push(target * target);
        }
        WeightingSettings { gamma0, target_variance, alpha, beta }
    }

    /// How hard stops brake: so that the heaviest body that may be can.
    pub(super) fn stop(&self, body: &InertialParameters<f64>, is_planar: bool) -> StopLimits {
        let [_, heaviest] = self.mass_interval_share;
        let (force, torque, moment) = if is_planar {
            let force = self.force_limit_n.xy().min();
            (force, self.torque_limit_n_m.z, body.inertia_about_com()[(2, 2)])
        } else {
            let moments = body.inertia_about_com().diagonal();
            (self.force_limit_n.min(), self.torque_limit_n_m.min(), moments.max())
        };
        let (along, turn) = self.stop;
        StopLimits {
            acceleration_m_s2: along.unwrap_or(STOP_SHARE * force / (heaviest * body.mass)),
            angular_acceleration_rad_s2: turn.unwrap_or(STOP_SHARE * torque / (heaviest * moment)),
        }
    }
}
