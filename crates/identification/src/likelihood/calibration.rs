//! What else a log may get wrong, and the columns of the tangent that estimate it.

use super::drive::Passage;
use super::flow::Input;
use super::lanes::PARAMETERS;
use core::fmt;
use nalgebra::Vector3;

/// A quantity that may be estimated beside the ten parameters.
///
/// # Units
/// s, m, m/s^2, N m, N; scales are ratios, one where nothing is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Nuisance {
    /// Delay of everything measured against the wrench: row `k` describes time `t_k - delay`.
    Delay,
    /// The same of the accelerations. Estimated along with [`Delay`](Self::Delay) where they are measured: under a held
    /// wrench they are delayed by whole steps.
    AccelerationDelay,
    /// True over logged force along one body axis. All six scales together are never identifiable.
    ForceScale(usize),
    /// True over logged torque about one body axis.
    TorqueScale(usize),
    /// Constant error of the measured acceleration along one body axis.
    AccelerometerBias(usize),
    /// Measured over true acceleration along one body axis.
    AccelerometerScale(usize),
    /// Place of the accelerometer against the body origin, body axes.
    AccelerometerPosition(usize),
    /// Constant torque on the body that is not logged, body axes.
    BiasTorque(usize),
    /// Constant force on the body that is not logged, body axes.
    BiasForce(usize),
    /// Constant acceleration along one inertial axis: what a table out of level does.
    TableSlope(usize),
    /// Time constant of the first-order lag from logged to acting wrench.
    ActuatorLag,
}

/// Number of distinct nuisances.
const COUNT: usize = 27;
/// First places of those that have axes.
const FORCE_SCALE: usize = 2;
const TORQUE_SCALE: usize = 5;
const ACCELEROMETER_BIAS: usize = 8;
const ACCELEROMETER_SCALE: usize = 11;
const ACCELEROMETER_POSITION: usize = 14;
const BIAS_TORQUE: usize = 17;
const BIAS_FORCE: usize = 20;
const TABLE_SLOPE: usize = 23;
const ACTUATOR_LAG: usize = 26;
/// Delay, in steps, beyond which the inputs are shifted by all of it: what is left is expanded to second order only.
const LARGEST_DELAY: f64 = 0.05;
/// Where delay and lag are both estimated, what tells them apart is the square of the lag: it must not change sign. Its
/// start, the least it keeps in one iteration, and the length in steps below which it is given up.
const LAG_START_S: f64 = 0.05;
const SMALLEST_LAG_RATIO: f64 = 0.25;
const SHORTEST_LAG: f64 = 0.5;
/// Precision, 1/s^2, that leaves a lag where it is.
const HELD: f64 = 1e12;
/// Lags after which nothing is left of the state in which the log found the actuator.
const SETTLING: f64 = 7.0;
/// Steps between the delay of accelerations and its whole steps beyond which others are taken: not to go back and forth.
const FAR_FROM_ROW: f64 = 0.6;
/// Largest step of a delay or lag in one iteration, s.
const LARGEST_TIME_STEP_S: f64 = 0.2;

impl Nuisance {
    /// Whether it moves the logged wrench in time.
    pub(crate) fn is_a_time(self) -> bool {
        matches!(self, Self::Delay | Self::AccelerationDelay | Self::ActuatorLag)
    }

    /// The nuisances that go by one name: `delay`, `force-scale`, `torque-scale`, `accelerometer-bias`,
    /// `accelerometer-scale`, `accelerometer-position`, `bias-wrench`, `table-slope` (horizontal axes), `actuator-lag`.
    pub fn named(name: &str) -> Option<&'static [Self]> {
        use Nuisance::{
            AccelerometerBias, AccelerometerPosition, AccelerometerScale, ActuatorLag, BiasForce, BiasTorque, Delay,
            ForceScale, TableSlope, TorqueScale,
        };
        Some(match name {
            "delay" => &[Delay],
            "force-scale" => &[ForceScale(0), ForceScale(1), ForceScale(2)],
            "torque-scale" => &[TorqueScale(0), TorqueScale(1), TorqueScale(2)],
            "accelerometer-bias" => &[AccelerometerBias(0), AccelerometerBias(1), AccelerometerBias(2)],
            "accelerometer-scale" => &[AccelerometerScale(0), AccelerometerScale(1), AccelerometerScale(2)],
            "accelerometer-position" => &[AccelerometerPosition(0), AccelerometerPosition(1), AccelerometerPosition(2)],
            "bias-wrench" => &[BiasTorque(0), BiasTorque(1), BiasTorque(2), BiasForce(0), BiasForce(1), BiasForce(2)],
            "table-slope" => &[TableSlope(0), TableSlope(1)],
            "actuator-lag" => &[ActuatorLag],
            _ => return None,
        })
    }

    /// Its name without the axis.
    pub fn name(self) -> &'static str {
        match self {
            Self::Delay => "delay",
            Self::AccelerationDelay => "acceleration-delay",
            Self::ForceScale(_) => "force-scale",
            Self::TorqueScale(_) => "torque-scale",
            Self::AccelerometerBias(_) => "accelerometer-bias",
            Self::AccelerometerScale(_) => "accelerometer-scale",
            Self::AccelerometerPosition(_) => "accelerometer-position",
            Self::BiasTorque(_) => "bias-torque",
            Self::BiasForce(_) => "bias-force",
            Self::TableSlope(_) => "table-slope",
            Self::ActuatorLag => "actuator-lag",
        }
    }

    /// Its axis, 0 to 2, where it has one; inertial for the slope of a table, body for the others.
    pub fn axis(self) -> Option<usize> {
        match self {
            Self::Delay | Self::AccelerationDelay | Self::ActuatorLag => None,
            Self::ForceScale(axis)
            | Self::TorqueScale(axis)
            | Self::AccelerometerBias(axis)
            | Self::AccelerometerScale(axis)
            | Self::AccelerometerPosition(axis)
            | Self::BiasTorque(axis)
            | Self::BiasForce(axis)
            | Self::TableSlope(axis) => Some(axis),
        }
    }

    /// Unit of its value.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Delay | Self::AccelerationDelay | Self::ActuatorLag => "s",
            Self::ForceScale(_) | Self::TorqueScale(_) | Self::AccelerometerScale(_) => "1",
            Self::AccelerometerBias(_) | Self::TableSlope(_) => "m/s^2",
            Self::AccelerometerPosition(_) => "m",
            Self::BiasTorque(_) => "N m",
            Self::BiasForce(_) => "N",
        }
    }

    /// Standard deviation that a data sheet would beat: what counts as not known at all.
    pub fn unknown_std(self) -> f64 {
        match self {
            Self::Delay
            | Self::AccelerationDelay
            | Self::ActuatorLag
            | Self::ForceScale(_)
            | Self::TorqueScale(_)
            | Self::AccelerometerScale(_)
            | Self::TableSlope(_) => 0.1,
            Self::AccelerometerBias(_) | Self::AccelerometerPosition(_) | Self::BiasForce(_) => 0.5,
            Self::BiasTorque(_) => 0.05,
        }
    }

    /// Position among all nuisances; `None` for an axis that does not exist.
    fn slot(self) -> Option<usize> {
        let first = match self {
            Self::Delay => 0,
            Self::AccelerationDelay => 1,
            Self::ForceScale(_) => FORCE_SCALE,
            Self::TorqueScale(_) => TORQUE_SCALE,
            Self::AccelerometerBias(_) => ACCELEROMETER_BIAS,
            Self::AccelerometerScale(_) => ACCELEROMETER_SCALE,
            Self::AccelerometerPosition(_) => ACCELEROMETER_POSITION,
            Self::BiasTorque(_) => BIAS_TORQUE,
            Self::BiasForce(_) => BIAS_FORCE,
            Self::TableSlope(_) => TABLE_SLOPE,
            Self::ActuatorLag => ACTUATOR_LAG,
        };
        let axis = self.axis().unwrap_or(0);
        (axis < 3).then_some(first + axis)
    }

    /// The value as its documentation has it, and one standard deviation, from the coordinate that is estimated.
    fn reported(self, coordinate: f64, std: f64) -> (f64, f64) {
        match self {
            Self::ForceScale(_) | Self::TorqueScale(_) => (coordinate.exp(), coordinate.exp() * std),
            Self::AccelerometerScale(_) => (1.0 + coordinate, std),
            _ => (coordinate, std),
        }
    }

    fn coordinate(self, value: f64) -> f64 {
        match self {
            Self::ForceScale(_) | Self::TorqueScale(_) => value.ln(),
            Self::AccelerometerScale(_) => value - 1.0,
            _ => value,
        }
    }
}

impl fmt::Display for Nuisance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        match self.axis() {
            Some(axis) => write!(f, " {}", ["x", "y", "z"].get(axis).unwrap_or(&"?")),
            None => Ok(()),
        }
    }
}

/// A set of nuisances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Nuisances(u32);

impl Nuisances {
    /// These; axes that do not exist are left out.
    pub fn of(nuisances: &[Nuisance]) -> Self {
        Self(nuisances.iter().filter_map(|nuisance| nuisance.slot()).fold(0, |bits, slot| bits | 1 << slot))
    }

    /// Those of either set.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Its members.
    pub fn iter(self) -> impl Iterator<Item = Nuisance> {
        let axes = |of: fn(usize) -> Nuisance| (0..3).map(of);
        [Nuisance::Delay, Nuisance::AccelerationDelay, Nuisance::ActuatorLag]
            .into_iter()
            .chain(axes(Nuisance::ForceScale))
            .chain(axes(Nuisance::TorqueScale))
            .chain(axes(Nuisance::AccelerometerBias))
            .chain(axes(Nuisance::AccelerometerScale))
            .chain(axes(Nuisance::AccelerometerPosition))
            .chain(axes(Nuisance::BiasTorque))
            .chain(axes(Nuisance::BiasForce))
            .chain(axes(Nuisance::TableSlope))
            .filter(move |nuisance| nuisance.slot().is_some_and(|slot| self.0 >> slot & 1 == 1))
    }
}

/// What is known of a nuisance before the data; also where its estimation starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NuisancePrior {
    /// Which.
    pub nuisance: Nuisance,
    /// Expected value.
    pub mean: f64,
    /// One standard deviation; infinite for a start that does not count as knowledge.
    pub std: f64,
}

/// Values of all nuisances, and which of them have columns.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Calibration {
    values: [f64; COUNT],
    lanes: [Option<usize>; COUNT],
    /// In the order of their columns.
    nuisances: Vec<Nuisance>,
    /// Mean and precision, in that order.
    priors: Vec<(f64, f64)>,
    /// The part of the delay that the inputs are shifted by.
    shift_s: f64,
    /// Whole steps of the delay of accelerations.
    acceleration_rows: isize,
    settling_s: f64,
    step_s: f64,
    /// The lag was given up beside the delay.
    without_lag: bool,
}

impl Calibration {
    /// Columns for these nuisances, in their order after the ten parameters; repeated or impossible ones are left out.
    pub(crate) fn new(nuisances: &[Nuisance], priors: &[NuisancePrior]) -> Self {
        let mut calibration = Self {
            values: [0.0; COUNT],
            lanes: [None; COUNT],
            nuisances: Vec::new(),
            priors: Vec::new(),
            shift_s: 0.0,
            acceleration_rows: 0,
            settling_s: 0.0,
            step_s: 0.0,
            without_lag: false,
        };
        for &nuisance in nuisances {
            let Some(slot) = nuisance.slot().filter(|&slot| calibration.lanes[slot].is_none()) else { continue };
            let prior = priors.iter().find(|prior| prior.nuisance == nuisance);
            let both = nuisance == Nuisance::ActuatorLag && nuisances.contains(&Nuisance::Delay);
            let start = if both { LAG_START_S } else { 0.0 };
            let mean = prior.map_or(start, |prior| nuisance.coordinate(prior.mean));
            calibration.values[slot] = mean;
            calibration.lanes[slot] = Some(PARAMETERS + calibration.columns());
            calibration.nuisances.push(nuisance);
            let (_, derivative) = nuisance.reported(mean, 1.0);
            calibration.priors.push((mean, prior.map_or(0.0, |prior| (prior.std / derivative).powi(-2))));
        }
        calibration
    }

    /// Starts delays where wrench and motion correlate best; a lag has its part in that.
    pub(crate) fn start_late(&mut self, late_s: f64) {
        if self.lanes[0].is_some() && late_s != 0.0 {
            self.values[0] = late_s - self.values[ACTUATOR_LAG];
            self.values[1] = self.values[0];
        }
    }

    /// Number of parameters, the ten of the body included.
    pub(crate) fn columns(&self) -> usize {
        10 + self.nuisances.len()
    }

    /// In the order of their columns.
    pub(crate) fn nuisances(&self) -> &[Nuisance] {
        &self.nuisances
    }

    pub(crate) fn lane(&self, nuisance: Nuisance) -> Option<usize> {
        self.lanes[nuisance.slot()?]
    }

    /// Value and standard deviation in the units of the nuisance.
    pub(crate) fn reported(&self, index: usize, std: f64) -> (f64, f64) {
        let nuisance = self.nuisances[index];
        let coordinate = nuisance.slot().map_or(0.0, |slot| self.values[slot]);
        nuisance.reported(coordinate, std)
    }

    /// What pulls nuisance `index` towards its prior: gradient and precision.
    pub(crate) fn pull(&self, index: usize, hold: bool) -> (f64, f64) {
        let (mean, mut precision) = self.priors[index];
        let nuisance = self.nuisances[index];
        if hold {
            precision += nuisance.unknown_std().powi(-2);
        }
        let value = nuisance.slot().map_or(0.0, |slot| self.values[slot]);
        if nuisance == Nuisance::ActuatorLag && self.without_lag {
            precision += HELD;
            return (0.0, precision);
        }
        (precision * (mean - value), precision)
    }

    /// Adds a step of all parameters to the nuisances among them.
    pub(crate) fn advance(&mut self, step: &[f64]) {
        let delayed = self.lanes[0].is_some();
        for (slot, (value, lane)) in self.values.iter_mut().zip(self.lanes).enumerate() {
            if let Some(lane) = lane {
                let is_time = [0, 1, ACTUATOR_LAG].contains(&slot);
                let largest = if is_time { LARGEST_TIME_STEP_S } else { f64::INFINITY };
                let moved = *value + step[lane - PARAMETERS].clamp(-largest, largest);
                *value = if slot == ACTUATOR_LAG && delayed { moved.max(SMALLEST_LAG_RATIO * *value) } else { moved };
            }
        }
        self.without_lag |= delayed && self.passage().lag_s.is_some_and(|lag_s| lag_s < SHORTEST_LAG * self.step_s);
    }

    /// Delay and lag are both estimated, and the lag is too short to tell from a delay.
    pub(crate) fn is_without_lag(&self) -> bool {
        self.without_lag
    }

    /// Moves the delay into the shift of the inputs where it is not small any more, and leaves out rows in which the lag
    /// has not settled; whether the rows may have changed.
    pub(crate) fn shift(&mut self, step_s: f64, longest_s: f64) -> bool {
        self.step_s = step_s;
        let late = self.values[1].clamp(-longest_s, longest_s) / step_s;
        if (late - self.acceleration_rows as f64).abs() > FAR_FROM_ROW {
            self.acceleration_rows = super::rounding::whole_signed(late.round());
        }
        let settling_s = SETTLING * self.values[ACTUATOR_LAG].clamp(0.0, longest_s / SETTLING);
        let unsettled = settling_s > self.settling_s + step_s || settling_s < 0.5 * self.settling_s - step_s;
        if unsettled {
            self.settling_s = 1.1 * settling_s;
        }
        let limit_s = LARGEST_DELAY * step_s;
        let back = self.shift_s != 0.0 && self.values[0].abs() < 0.5 * limit_s;
        if self.lanes[0].is_none() || !back && (self.values[0] - self.shift_s).abs() <= limit_s {
            return unsettled;
        }
        self.values[0] = self.values[0].clamp(-longest_s, longest_s);
        // An unshifted record loses no row.
        self.shift_s = if self.values[0].abs() < limit_s { 0.0 } else { self.values[0] };
        true
    }

    /// What the shift leaves of the delay.
    pub(crate) fn delay_s(&self) -> f64 {
        self.values[0] - self.shift_s
    }

    /// What the logged wrench goes through.
    pub(crate) fn passage(&self) -> Passage {
        let lag_s = self.lanes[ACTUATOR_LAG].map(|_| self.values[ACTUATOR_LAG]);
        Passage { lag_s, shift_s: self.shift_s, acceleration_rows: self.acceleration_rows, settling_s: self.settling_s }
    }

    fn vector(&self, first: usize) -> Vector3<f64> {
        Vector3::new(self.values[first], self.values[first + 1], self.values[first + 2])
    }

    /// True over logged torque and force.
    pub(crate) fn wrench_scale(&self) -> (Vector3<f64>, Vector3<f64>) {
        (self.vector(TORQUE_SCALE).map(f64::exp), self.vector(FORCE_SCALE).map(f64::exp))
    }

    /// The wrench that acts: logged wrench and its noise (torque, force) by their scale, plus the bias.
    ///
    /// The noise is one of the log, so that scaling wrench, mass and inertia together changes nothing.
    pub(crate) fn input(&self, logged: &Input, noise: &[f64; 6]) -> Input {
        let mut input = *logged;
        input.torque += Vector3::new(noise[0], noise[1], noise[2]);
        input.force += Vector3::new(noise[3], noise[4], noise[5]);
        if self.nuisances.is_empty() {
            return input;
        }
        let (torque, force) = self.wrench_scale();
        Input {
            torque: input.torque.component_mul(&torque) + self.vector(BIAS_TORQUE),
            force: input.force.component_mul(&force) + self.vector(BIAS_FORCE),
            torque_slope: input.torque_slope.component_mul(&torque),
            force_slope: input.force_slope.component_mul(&force),
            ..input
        }
    }

    /// Derivatives of the wrench that acts, by lane; `by_lag` is that of the logged one by the lag.
    pub(crate) fn input_columns(&self, acting: &Input, by_lag: &Input, mut visit: impl FnMut(usize, Input)) {
        if self.nuisances.is_empty() {
            return;
        }
        let on = |v: &Vector3<f64>, axis: usize| {
            let mut part = Vector3::zeros();
            part[axis] = v[axis];
            part
        };
        for axis in 0..3 {
            if let Some(lane) = self.lanes[FORCE_SCALE + axis] {
                let force = on(&(acting.force - self.vector(BIAS_FORCE)), axis);
                visit(lane, Input { force, force_slope: on(&acting.force_slope, axis), ..Input::default() });
            }
            if let Some(lane) = self.lanes[TORQUE_SCALE + axis] {
                let torque = on(&(acting.torque - self.vector(BIAS_TORQUE)), axis);
                visit(lane, Input { torque, torque_slope: on(&acting.torque_slope, axis), ..Input::default() });
            }
            if let Some(lane) = self.lanes[BIAS_FORCE + axis] {
                visit(lane, Input { force: Vector3::ith(axis, 1.0), ..Input::default() });
            }
            if let Some(lane) = self.lanes[BIAS_TORQUE + axis] {
                visit(lane, Input { torque: Vector3::ith(axis, 1.0), ..Input::default() });
            }
        }
        if let Some(lane) = self.lanes[ACTUATOR_LAG] {
            let (torque, force) = self.wrench_scale();
            visit(
                lane,
                Input {
                    torque: by_lag.torque.component_mul(&torque),
                    force: by_lag.force.component_mul(&force),
                    torque_slope: by_lag.torque_slope.component_mul(&torque),
                    force_slope: by_lag.force_slope.component_mul(&force),
                    ..Input::default()
                },
            );
        }
    }

    /// The logged wrench of which the acceleration of a row is the effect, from the one just after the row's time and its
    /// difference quotient.
    pub(crate) fn felt(&self, start: &Input) -> Input {
        let delay = self.values[1] - self.acceleration_rows as f64 * self.step_s;
        Input {
            torque: start.torque - start.torque_slope * delay,
            force: start.force - start.force_slope * delay,
            stored: start.stored,
            ..Input::default()
        }
    }

    /// Acceleration along the inertial axes that is neither logged nor gravity.
    pub(crate) fn slope(&self) -> Vector3<f64> {
        self.vector(TABLE_SLOPE)
    }

    /// Scale, bias and position of the accelerometer.
    pub(crate) fn accelerometer(&self) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
        let scale = self.vector(ACCELEROMETER_SCALE).map(|error| 1.0 + error);
        (scale, self.vector(ACCELEROMETER_BIAS), self.vector(ACCELEROMETER_POSITION))
    }
}
