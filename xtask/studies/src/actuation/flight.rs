//! Flights of the study: informative wrenches, the propulsion hardware, the simulator and its sensors.

use nalgebra::{SVector, Vector3};
use tumble_astrobee::air_drag::air_drag;
use tumble_astrobee::bodies::BodyConfiguration;
use tumble_astrobee::propulsion::inverse::wrench_of_flow;
use tumble_astrobee::propulsion::{
    AreaTable, Belief, ForceAllocation, ImpellerMode, InverseAllocation, PropulsionCommand, PropulsionPlant,
    PropulsionSettings,
};
use tumble_astrobee::sensing::{
    FaultSettings, Localization, LocalizationEstimate, LocalizationSettings, SensorErrors, TimingSettings, TrueMotion,
};
use tumble_astrobee::simulator::{AstrobeeSimulator, Multisine, SimulatorSettings};
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::{
    Actuation, BodyAcceleration, FreeFlyer, InertialParameters, Plant, PoseReference, PoseTracker, RigidBodyState,
};
use tumble_identification::synchronize::{Signals, delay};
use tumble_lie::{Pose, Twist, Wrench};

use super::study;
use crate::Failure;

/// Period of commands and estimates.
pub const STEP_S: f64 = 0.016;
pub const STEP_NS: i64 = 16_000_000;
/// The impellers of the thesis's flights.
pub const MODE: ImpellerMode = ImpellerMode::Nominal;
/// Frequencies of the informative wrench, Hz: eighteen sines, three per axis.
const BAND_HZ: [f64; 2] = [0.08, 0.5];
/// Critically damped return to the start, rotation and position, rad/s: slow, so that most of the wrench is the sines.
const RETURN_RAD_S: [f64; 2] = [0.15, 0.1];
/// Limits of the thesis's controller, table 6.7: torque, force.
pub const TABLE_6_7: [f64; 6] = [0.045, 0.022, 0.026, 0.452, 0.216, 0.257];
/// Limits of its planner, the same table, to which the informative wrench reaches.
pub const PLANNER: [f64; 6] = [0.05, 0.05, 0.05, 0.1, 0.1, 0.1];

/// Limits of the local planner in its public code: they differ from the printed ones.
pub const PLANNER_CODE: [f64; 6] = [0.015, 0.015, 0.015, 0.15, 0.15, 0.15];
/// Peaks that saturate nothing: a third of those.
pub const QUIET: [f64; 6] = [0.005, 0.005, 0.005, 0.05, 0.05, 0.05];

/// The robot as the flights have it.
pub fn body() -> InertialParameters<f64> {
    BodyConfiguration::Iss.parameters()
}

/// What makes the wrench.
#[derive(Clone, Copy, PartialEq)]
pub enum Hardware {
    /// What is asked for.
    Exact,
    /// Flap angles at once and unrounded.
    Flaps(Belief),
    /// Bytes, at once.
    Bytes(Belief),
    /// Servos, impellers and plenums.
    Plant(PropulsionSettings),
}

/// One flight; the seed draws phases and sensor errors.
#[derive(Clone)]
pub struct Plan {
    pub hardware: Hardware,
    pub sensors: LocalizationSettings,
    /// Peaks of the informative wrench `[torque; force]`.
    pub peak: [f64; 6],
    /// Limits of the command about the centre of mass.
    pub limits: Option<[f64; 6]>,
    pub seconds: f64,
}

impl Plan {
    /// Peaks of the planner, propulsion as built, these sensors.
    pub fn new(sensors: LocalizationSettings, seconds: f64) -> Self {
        Self { hardware: Hardware::Plant(PropulsionSettings::PHYSICAL), sensors, peak: PLANNER, limits: None, seconds }
    }

    pub fn within_table_6_7(self) -> Self {
        Self { limits: Some(TABLE_6_7), ..self }
    }

    pub fn with_peak(self, peak: [f64; 6]) -> Self {
        Self { peak, ..self }
    }
}

/// One control period.
#[derive(Clone, Copy)]
pub struct Period {
    pub time_ns: i64,
    /// Commanded, torque about the body origin.
    pub wanted: Wrench<f64>,
    pub command: PropulsionCommand,
    /// A flap at its stop or a module past its table.
    pub saturated: bool,
    /// At its start, the new wrench acting.
    pub truth: TrueMotion,
}

pub struct Flown {
    pub periods: Vec<Period>,
    /// In order of arrival.
    pub estimates: Vec<LocalizationEstimate>,
}

/// Makes the wrench of a period: as the simulator's own hardware does, or a part of it alone.
struct Maker {
    allocation: ForceAllocation,
    hardware: Hardware,
    plant: Option<PropulsionPlant>,
}

impl Maker {
    fn new(hardware: Hardware) -> Self {
        let allocation = ForceAllocation::new(MODE, body().center_of_mass());
        let plant = match hardware {
            Hardware::Plant(settings) => Some(PropulsionPlant::spun_up(settings, MODE)),
            _ => None,
        };
        Self { allocation, hardware, plant }
    }

    /// Command, whether it saturates, and the wrench that acts.
    fn step(
        &mut self,
        wanted: &Wrench<f64>,
        rate_body: &Vector3<f64>,
    ) -> Result<(PropulsionCommand, bool, Wrench<f64>), Failure> {
        let steps = self.allocation.allocate_steps(wanted).map_err(study)?;
        let inverse = |belief| InverseAllocation { belief, table: AreaTable::Full };
        let acting = match (&mut self.plant, self.hardware) {
            (Some(plant), _) => plant.step(&steps.bytes, rate_body).wrench_body,
            (None, Hardware::Flaps(belief)) => {
                ForceAllocation { inverse: inverse(belief), ..self.allocation }.realize(&steps.flaps)
            }
            (None, Hardware::Bytes(belief)) => wrench_of_flow(&inverse(belief).flow_of_bytes(&steps.bytes)),
            (None, _) => *wanted,
        };
        Ok((steps.bytes, steps.limits.is_saturated(), acting))
    }
}

/// Sines about a pose to which a slow tracker, which knows the true state, keeps coming back.
pub fn fly(plan: &Plan, seed: u64) -> Result<Flown, Failure> {
    let start = WorldPreset::Iss.pose("A").unwrap_or_default();
    let state = RigidBodyState { world_from_body: start, twist_body: Twist::zero() };
    let zero = Vector3::zeros();
    let home = PoseReference {
        state,
        acceleration: BodyAcceleration { angular_acceleration_body: zero, acceleration_origin_body: zero },
    };
    let sensors = Localization::new(&plan.sensors, seed, MODE).map_err(study)?;
    let mut robot = AstrobeeSimulator::try_new(SimulatorSettings {
        drag: Some(air_drag()),
        sensors: Some(sensors),
        ..SimulatorSettings::ideal(WorldPreset::Iss, state)
    })
    .map_err(study)?;
    let tracker = PoseTracker::critically_damped(FreeFlyer::new(body()), RETURN_RAD_S[0], RETURN_RAD_S[1]);
    let sines = Multisine::new(&wrench_of(&plan.peak), 3, BAND_HZ[0], BAND_HZ[1], seed);
    let mut maker = Maker::new(plan.hardware);
    let mut flown = Flown { periods: Vec::new(), estimates: Vec::new() };
    let mut time_ns = 0;
    while time_ns as f64 * 1e-9 < plan.seconds {
        let about_com = maker.allocation.about_center_of_mass(&tracker.wrench_body(robot.state(), &home))
            + sines.wrench(time_ns as f64 * 1e-9);
        let wanted = maker.allocation.about_origin(&limited(&about_com, plan.limits));
        let rate = robot.state().twist_body.angular;
        let (command, saturated, acting) = maker.step(&wanted, &rate)?;
        let truth = robot.advance(&acting, STEP_S).map_err(study)?.start;
        flown.estimates.extend_from_slice(robot.estimates());
        flown.periods.push(Period { time_ns, wanted, command, saturated, truth });
        time_ns += STEP_NS;
    }
    Ok(flown)
}

fn wrench_of([tx, ty, tz, fx, fy, fz]: &[f64; 6]) -> Wrench<f64> {
    Wrench::new(Vector3::new(*tx, *ty, *tz), Vector3::new(*fx, *fy, *fz))
}

fn limited(wrench: &Wrench<f64>, limits: Option<[f64; 6]>) -> Wrench<f64> {
    let Some(limits) = limits else { return *wrench };
    let values = wrench.to_vector();
    wrench_of(&std::array::from_fn(|i| values[i].clamp(-limits[i], limits[i])))
}

/// Where an analysis takes its wrench from.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Source {
    Commanded,
    /// The thesis's inverse: one leak area, its table cut at the largest thrust.
    ThesisInverse,
    /// Inverse with each module's leak and the whole table.
    FullInverse,
    /// The bytes replayed through servos and impellers.
    Replayed,
}

impl Source {
    pub const ALL: [Self; 4] = [Self::Commanded, Self::ThesisInverse, Self::FullInverse, Self::Replayed];

    pub fn name(self) -> &'static str {
        match self {
            Self::Commanded => "commanded",
            Self::ThesisInverse => "inverse of the thesis",
            Self::FullInverse => "full inverse",
            Self::Replayed => "full inverse, servos replayed",
        }
    }

    /// Wrench of every period, torque about the centre of mass.
    pub fn wrenches(self, flown: &Flown) -> Vec<Wrench<f64>> {
        let com = body().center_of_mass();
        let about_com = |w: Wrench<f64>| Wrench::new(w.torque - com.cross(&w.force), w.force);
        let mut plant = PropulsionPlant::spun_up(PropulsionSettings::PHYSICAL, MODE);
        let inverse = |belief, table, command: &PropulsionCommand| {
            wrench_of_flow(&InverseAllocation { belief, table }.flow_of_bytes(command))
        };
        let one = |period: &Period| match self {
            Self::Commanded => period.wanted,
            Self::ThesisInverse => inverse(Belief::Allocation, AreaTable::Thesis, &period.command),
            Self::FullInverse => inverse(Belief::Hardware, AreaTable::Full, &period.command),
            Self::Replayed => plant.step(&period.command, &Vector3::zeros()).wrench_body,
        };
        flown.periods.iter().map(one).map(about_com).collect()
    }
}

/// Wrenches about the centre of mass as they show in what the sensors would publish without errors of theirs: the accelerations of a
/// body that answers them, averaged, filtered and differentiated, times mass and moments.
pub fn through_the_chain(
    wrenches: &[Wrench<f64>],
    sensors: &LocalizationSettings,
) -> Result<Vec<Wrench<f64>>, Failure> {
    let mut chain = Localization::new(&without_errors(sensors), 0, MODE).map_err(study)?;
    let body = body();
    let com = body.center_of_mass();
    let moments = body.inertia_about_com().diagonal();
    let mut rate = Vector3::zeros();
    let (mut forces, mut rates) = (Vec::with_capacity(wrenches.len()), Vec::with_capacity(wrenches.len()));
    let mut time_ns = 0;
    for wrench in wrenches {
        let angular = wrench.torque.component_div(&moments);
        for _ in 0..2 {
            chain.observe(&TrueMotion {
                time_ns,
                state: RigidBodyState {
                    world_from_body: Pose::identity(),
                    twist_body: Twist::new(rate, Vector3::zeros()),
                },
                acceleration_origin_body: wrench.force / body.mass
                    - angular.cross(&com)
                    - rate.cross(&rate.cross(&com)),
                angular_acceleration_body: angular,
            });
            time_ns += STEP_NS / 2;
            rate += angular * (0.5 * STEP_S);
        }
        while let Some(estimate) = chain.arrived(i64::MAX) {
            forces.push(estimate.acceleration_origin_body * body.mass);
            rates.push(estimate.rate_body);
        }
    }
    let torques = differentiated(&rates).into_iter().map(|alpha| alpha.component_mul(&moments));
    Ok(torques.zip(forces).map(|(torque, force)| Wrench::new(torque, force)).collect())
}

/// The delays and filters of sensors, nothing random, no factor.
pub fn without_errors(sensors: &LocalizationSettings) -> LocalizationSettings {
    let mut quiet = sensors.clone();
    quiet.acceleration_factor = [1.0; 3];
    quiet.imu.accelerometer = SensorErrors::none();
    quiet.imu.gyro = SensorErrors::none();
    quiet.imu.bias_following_time_s = 0.0;
    quiet.pose = LocalizationSettings::perfect().pose;
    quiet.timing = TimingSettings { latency_ms: 0.0, arrival_jitter_ms: 0.0, stamp_jitter_ms: 0.0, ..quiet.timing };
    quiet.faults = FaultSettings::default();
    quiet
}

/// Acceleration and rate at the time of every period, straight between neighbouring estimates by stamp.
pub struct Measured {
    pub acceleration: Vec<Vector3<f64>>,
    pub rate: Vec<Vector3<f64>>,
    /// Whether an estimate speaks of this very time.
    pub known: Vec<bool>,
}

pub fn measured(flown: &Flown) -> Measured {
    let mut sorted: Vec<&LocalizationEstimate> = flown.estimates.iter().collect();
    sorted.sort_by_key(|estimate| estimate.stamp_ns);
    sorted.dedup_by_key(|estimate| estimate.stamp_ns);
    let at = |time_ns: i64, of: fn(&LocalizationEstimate) -> Vector3<f64>| {
        let after = sorted.partition_point(|estimate| estimate.stamp_ns <= time_ns).clamp(1, sorted.len() - 1);
        let (before, after) = (sorted[after - 1], sorted[after]);
        let share = (time_ns - before.stamp_ns) as f64 / (after.stamp_ns - before.stamp_ns) as f64;
        of(before).lerp(&of(after), share.clamp(0.0, 1.0))
    };
    let all = |of| flown.periods.iter().map(|period| at(period.time_ns, of)).collect();
    let known = |period: &Period| sorted.binary_search_by_key(&period.time_ns, |estimate| estimate.stamp_ns).is_ok();
    Measured {
        acceleration: all(|e| e.acceleration_origin_body),
        rate: all(|e| e.rate_body),
        known: flown.periods.iter().map(known).collect(),
    }
}

/// Noise of the filtered sensors further apart than this is independent, samples.
pub const CORRELATION_LENGTH: usize = 60;
/// Delays are sought up to here, s.
pub const LARGEST_DELAY_S: f64 = 0.35;

/// The delay of a measured vector behind wrenches, over all axes, s: estimate and its standard deviation.
pub fn delay_behind(wrenches: &[Wrench<f64>], output: &[Vector3<f64>]) -> Result<[f64; 2], Failure> {
    let signals = Signals::<6, 3, 0> {
        step_s: STEP_S,
        input: wrenches.iter().map(Wrench::to_vector).collect(),
        input_offset_s: 0.0,
        output: output.to_vec(),
        covariates: vec![SVector::zeros(); output.len()],
        correlation_length: CORRELATION_LENGTH,
    };
    let found = delay(&signals, LARGEST_DELAY_S).map_err(study)?;
    Ok([found.delay_s, found.sigma_s])
}

/// What is known of a motion: acceleration, of whichever point, and angular acceleration, by period.
pub struct Motion {
    pub acceleration: Vec<Vector3<f64>>,
    pub angular_acceleration: Vec<Vector3<f64>>,
}

/// As the thesis: what is published, the rate differentiated.
pub fn published(flown: &Flown) -> Motion {
    let measured = measured(flown);
    Motion { angular_acceleration: differentiated(&measured.rate), acceleration: measured.acceleration }
}

/// Seed of the flight on which delays are found for all others.
const CALIBRATION: u64 = 9_000;

/// Delays of `[angular, linear]` acceleration behind wrenches of a source, s, found once on a flight that saturates nothing.
pub fn calibrated(
    sensors: &LocalizationSettings,
    source: Source,
    motion: fn(&Flown) -> Motion,
) -> Result<[f64; 2], Failure> {
    let flown = fly(&Plan::new(sensors.clone(), 60.0).with_peak(QUIET), CALIBRATION)?;
    let (wrenches, motion) = (source.wrenches(&flown), motion(&flown));
    Ok([delay_behind(&wrenches, &motion.angular_acceleration)?[0], delay_behind(&wrenches, &motion.acceleration)?[0]])
}

/// Central differences, zero at the ends.
pub fn differentiated(values: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let last = values.len() - 1;
    (0..=last)
        .map(|k| if k == 0 || k == last { Vector3::zeros() } else { (values[k + 1] - values[k - 1]) / (2.0 * STEP_S) })
        .collect()
}

/// The values a time later, straight in between; the first stands for what came before.
pub fn delayed(values: &[Vector3<f64>], delay_s: f64) -> Vec<Vector3<f64>> {
    let shift = delay_s / STEP_S;
    (0..values.len())
        .map(|k| {
            let place = (k as f64 - shift).clamp(0.0, (values.len() - 1) as f64);
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "between zero and the last index"
            )]
            let below = place.floor() as usize;
            let above = (below + 1).min(values.len() - 1);
            values[below].lerp(&values[above], place - place.floor())
        })
        .collect()
}
