//! What else a log may get wrong, and the columns of the tangent that estimate it.

use super::flow::Input;
use super::segment::PARAMETERS;
use nalgebra::Vector3;

/// A quantity that may be estimated beside the ten parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Nuisance {
    /// Delay of everything measured against the wrench, s: row `k` describes time `t_k - delay`.
    Delay,
    /// Logarithm of true over logged force along one body axis. All six scales together are never identifiable.
    ForceScale(usize),
    /// Logarithm of true over logged torque about one body axis.
    TorqueScale(usize),
    /// Constant error of the measured acceleration along one body axis, m/s^2.
    AccelerometerBias(usize),
    /// Relative error of the scale of the measured acceleration along one body axis.
    AccelerometerScale(usize),
}

/// Number of distinct nuisances.
const COUNT: usize = 13;

impl Nuisance {
    /// Position among all nuisances; `None` for an axis that does not exist.
    fn slot(self) -> Option<usize> {
        let on = |first: usize, axis: usize| (axis < 3).then_some(first + axis);
        match self {
            Self::Delay => Some(0),
            Self::ForceScale(axis) => on(1, axis),
            Self::TorqueScale(axis) => on(4, axis),
            Self::AccelerometerBias(axis) => on(7, axis),
            Self::AccelerometerScale(axis) => on(10, axis),
        }
    }
}

/// Values of all nuisances, and which of them have columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Calibration {
    values: [f64; COUNT],
    lanes: [Option<usize>; COUNT],
    columns: usize,
}

impl Calibration {
    /// Columns for these nuisances, in their order after the ten parameters; repeated or impossible ones are left out.
    pub(crate) fn new(nuisances: &[Nuisance]) -> Self {
        let mut calibration = Self { values: [0.0; COUNT], lanes: [None; COUNT], columns: 10 };
        for slot in nuisances.iter().filter_map(|nuisance| nuisance.slot()) {
            if calibration.lanes[slot].is_none() {
                calibration.lanes[slot] = Some(PARAMETERS + calibration.columns);
                calibration.columns += 1;
            }
        }
        calibration
    }

    /// Number of parameters, the ten of the body included.
    pub(crate) fn columns(&self) -> usize {
        self.columns
    }

    pub(crate) fn lane(&self, nuisance: Nuisance) -> Option<usize> {
        self.lanes[nuisance.slot()?]
    }

    pub(crate) fn value(&self, nuisance: Nuisance) -> f64 {
        nuisance.slot().map_or(0.0, |slot| self.values[slot])
    }

    /// Adds a step of all parameters to the nuisances among them.
    pub(crate) fn advance(&mut self, step: &[f64]) {
        for (value, lane) in self.values.iter_mut().zip(self.lanes) {
            if let Some(lane) = lane {
                *value += step[lane - PARAMETERS];
            }
        }
    }

    pub(crate) fn delay_s(&self) -> f64 {
        self.values[0]
    }

    /// The wrench that acts: logged wrench by its scale, plus noise (torque, force).
    pub(crate) fn input(&self, logged: &Input, noise: &[f64; 6]) -> Input {
        let v = &self.values;
        let torque_noise = Vector3::new(noise[0], noise[1], noise[2]);
        let force_noise = Vector3::new(noise[3], noise[4], noise[5]);
        let mut input = Input { torque_noise, force_noise, ..*logged };
        if v[1..7].iter().any(|&scale| scale != 0.0) {
            let force = Vector3::new(v[1].exp(), v[2].exp(), v[3].exp());
            let torque = Vector3::new(v[4].exp(), v[5].exp(), v[6].exp());
            input.torque.component_mul_assign(&torque);
            input.force.component_mul_assign(&force);
            input.torque_slope.component_mul_assign(&torque);
            input.force_slope.component_mul_assign(&force);
        }
        input.torque += torque_noise;
        input.force += force_noise;
        input
    }

    /// Scale and bias of the measured acceleration.
    pub(crate) fn accelerometer(&self) -> (Vector3<f64>, Vector3<f64>) {
        let v = &self.values;
        (Vector3::new(1.0 + v[10], 1.0 + v[11], 1.0 + v[12]), Vector3::new(v[7], v[8], v[9]))
    }
}
