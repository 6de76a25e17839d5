//! The cost of a motion and its gradient, as the solver sees them.

use super::criterion::ExcitationCriterion;
use super::problem::ExcitationProblem;
use crate::fourier::{AttitudeChart, FourierBasis, MotionInstant};
use crate::regressors::Regressor;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3, Vector6};

/// One number for each of the six channels; those that do not move stay zero.
pub(super) type Channels = [f64; 6];

/// The basis functions from rest to rest at equal steps of a period: value, rate and acceleration.
pub(super) struct RestTable {
    free: usize,
    /// Free numbers after free numbers of one sample.
    functions: Vec<[f64; 3]>,
}

impl RestTable {
    pub fn new(basis: &FourierBasis, samples: usize) -> Self {
        Self::from_sample(0, basis, samples)
    }

    /// Without the first sample, at which nothing moves.
    pub fn after_zero(basis: &FourierBasis, samples: usize) -> Self {
        Self::from_sample(1, basis, samples)
    }

    fn from_sample(first: usize, basis: &FourierBasis, samples: usize) -> Self {
        let rest = basis.rest_to_rest();
        let times: Vec<f64> = (first..samples).map(|i| basis.period_s() * i as f64 / samples as f64).collect();
        let [value, rate, acceleration] = basis.table(&times).map(|table| table * &rest);
        let free = rest.ncols();
        let functions = (0..times.len())
            .flat_map(|row| (0..free).map(move |column| (row, column)))
            .map(|at| [value[at], rate[at], acceleration[at]])
            .collect();
        Self { free, functions }
    }

    /// The functions of each sample, one triple for each free number.
    pub fn samples(&self) -> impl ExactSizeIterator<Item = &[[f64; 3]]> {
        self.functions.chunks_exact(self.free)
    }
}

/// Values, rates and accelerations of the channels.
pub(super) fn channels(functions: &[[f64; 3]], free: &[Channels]) -> [Channels; 3] {
    let mut channels = [[0.0; 6]; 3];
    for (function, numbers) in functions.iter().zip(free) {
        for (channels, function) in channels.iter_mut().zip(function) {
            for (channel, number) in channels.iter_mut().zip(numbers) {
                *channel += function * number;
            }
        }
    }
    channels
}

/// The motion at channels of Euler angles, which exists everywhere.
pub(super) fn instant([value, rate, acceleration]: &[Channels; 3]) -> Option<MotionInstant> {
    MotionInstant::from_channels(AttitudeChart::EulerZyx, value, rate, acceleration)
}

/// Cost as a function of the free numbers, with its memory.
pub(super) struct Objective<'a, C, const P: usize> {
    criterion: &'a C,
    parameters: [usize; P],
    weight: Vector6<f64>,
    table: RestTable,
    values: Vec<Channels>,
    instants: Vec<MotionInstant>,
}

impl<'a, C: ExcitationCriterion<P>, const P: usize> Objective<'a, C, P> {
    pub fn new(problem: &ExcitationProblem<P>, criterion: &'a C) -> Self {
        Self {
            criterion,
            parameters: problem.parameters,
            weight: problem.standard_deviation.map(|sigma| 1.0 / (sigma * sigma)),
            table: RestTable::new(&problem.basis, problem.samples),
            values: Vec::with_capacity(problem.samples),
            instants: Vec::with_capacity(problem.samples),
        }
    }

    /// Information of one period and root mean squares of the channels; `None` where the motion is not finite.
    pub fn information(&mut self, free: &[Channels]) -> Option<(SMatrix<f64, P, P>, Channels)> {
        self.values.clear();
        self.instants.clear();
        // About [m, h] from the force, about [h, J] from the torque: the rest of the regressor is zero.
        let mut by_force = SMatrix::<f64, 4, 4>::zeros();
        let mut by_torque = SMatrix::<f64, 9, 9>::zeros();
        let mut squares = [0.0; 6];
        let [torque_weight, force_weight] = self.weights();
        for functions in self.table.samples() {
            let channels = channels(functions, free);
            let instant = instant(&channels)?;
            let regressor = instant.regressor();
            let torque = regressor.fixed_view::<3, 9>(0, 1);
            let force = regressor.fixed_view::<3, 4>(3, 0);
            for row in 0..3 {
                add_outer(&mut by_torque, &torque.row(row).transpose(), torque_weight[row]);
                add_outer(&mut by_force, &force.row(row).transpose(), force_weight[row]);
            }
            for (square, value) in squares.iter_mut().zip(&channels[0]) {
                *square += value * value;
            }
            self.values.push(channels[0]);
            self.instants.push(instant);
        }
        let mut all = SMatrix::<f64, 10, 10>::zeros();
        all.fixed_view_mut::<9, 9>(1, 1).copy_from(&by_torque);
        let mut first = all.fixed_view_mut::<4, 4>(0, 0);
        first += by_force;
        let samples = self.instants.len() as f64;
        let rms = squares.map(|square| (square / samples).sqrt());
        Some((SMatrix::from_fn(|i, j| all[(self.parameters[i], self.parameters[j])]), rms))
    }

    fn weights(&self) -> [Vector3<f64>; 2] {
        [self.weight.fixed_rows::<3>(0).into_owned(), self.weight.fixed_rows::<3>(3).into_owned()]
    }

    /// The cost; `None` where the criterion cannot judge.
    pub fn cost(&mut self, free: &[Channels]) -> Option<f64> {
        let (information, rms) = self.information(free)?;
        Some(self.criterion.gradient(&information, &rms)?.cost).filter(|cost| cost.is_finite())
    }

    /// The cost, and its derivatives by the free numbers by going backwards through the same steps.
    pub fn gradient(&mut self, free: &[Channels], gradient: &mut [Channels]) -> Option<f64> {
        let (information, rms) = self.information(free)?;
        let found = self.criterion.gradient(&information, &rms).filter(|found| found.cost.is_finite())?;
        let mut by_information = SMatrix::<f64, 10, 10>::zeros();
        for (i, &row) in self.parameters.iter().enumerate() {
            for (j, &column) in self.parameters.iter().enumerate() {
                by_information[(row, column)] = found.by_information[(i, j)];
            }
        }
        let [torque_weight, force_weight] = self.weights();
        let by_torque = by_information.fixed_view::<9, 9>(1, 1) * 2.0;
        let by_force = by_information.fixed_view::<4, 4>(0, 0) * 2.0;
        // Per value of a channel; nothing where the channel does not move.
        let samples = self.instants.len() as f64;
        let mut by_value = found.by_rms;
        for (by_value, rms) in by_value.iter_mut().zip(rms) {
            *by_value = if rms > 0.0 { *by_value / (samples * rms) } else { 0.0 };
        }
        gradient.fill([0.0; 6]);
        for ((functions, value), instant) in self.table.samples().zip(&self.values).zip(&self.instants) {
            let regressor = instant.regressor();
            // One row at a time: row weight, times row, times the derivative by the information.
            let mut torque = regressor.fixed_view::<3, 9>(0, 1) * by_torque;
            let mut force = regressor.fixed_view::<3, 4>(3, 0) * by_force;
            for row in 0..3 {
                torque.row_mut(row).scale_mut(torque_weight[row]);
                force.row_mut(row).scale_mut(force_weight[row]);
            }
            let mut by_regressor = Regressor::zeros();
            by_regressor.fixed_view_mut::<3, 9>(0, 1).copy_from(&torque);
            by_regressor.fixed_view_mut::<3, 4>(3, 0).copy_from(&force);
            let [w, turning, acceleration] = by_motion(&instant.angular_velocity_body, &by_regressor);
            let mut adjoint = instant.pull_back(&w, &turning, &acceleration);
            for ((adjoint, by_value), value) in adjoint[0].iter_mut().zip(&by_value).zip(value) {
                *adjoint += by_value * value;
            }
            for (function, gradient) in functions.iter().zip(gradient.iter_mut()) {
                for (function, adjoint) in function.iter().zip(&adjoint) {
                    for (gradient, adjoint) in gradient.iter_mut().zip(adjoint) {
                        *gradient += function * adjoint;
                    }
                }
            }
        }
        Some(found.cost)
    }
}

fn add_outer<const N: usize>(sum: &mut SMatrix<f64, N, N>, row: &SVector<f64, N>, weight: f64) {
    for (mut column, scale) in sum.column_iter_mut().zip(row.iter()) {
        column.axpy(weight * scale, row, 1.0);
    }
}

/// Derivatives by angular velocity, angular acceleration and acceleration of the origin, from those by the entries of
/// the [`newton_euler`](crate::regressors::newton_euler) regressor.
fn by_motion(rate: &Vector3<f64>, by: &Regressor<f64>) -> [Vector3<f64>; 3] {
    let at = |row: usize, column: usize| by[(row, column)];
    let acceleration =
        Vector3::new(at(3, 0) - at(2, 2) + at(1, 3), at(4, 0) + at(2, 1) - at(0, 3), at(5, 0) - at(1, 1) + at(0, 2));
    let turning = Vector3::new(
        at(5, 2) - at(4, 3) + at(0, 4) + at(1, 5) + at(2, 6),
        at(3, 3) - at(5, 1) + at(0, 5) + at(1, 7) + at(2, 8),
        at(4, 1) - at(3, 2) + at(0, 6) + at(1, 8) + at(2, 9),
    );
    // Of the products of the rate with itself.
    let (xx, yy, zz) = (
        at(2, 5) - at(4, 2) - at(5, 3) - at(1, 6),
        at(0, 8) - at(3, 1) - at(5, 3) - at(2, 5),
        at(1, 6) - at(3, 1) - at(4, 2) - at(0, 8),
    );
    let (xy, xz, yz) = (
        at(4, 1) + at(3, 2) - at(2, 4) + at(0, 6) + at(2, 7) - at(1, 8),
        at(5, 1) + at(3, 3) + at(1, 4) - at(0, 5) + at(2, 8) - at(1, 9),
        at(5, 2) + at(4, 3) + at(1, 5) - at(2, 6) - at(0, 7) + at(0, 9),
    );
    let products = Matrix3::new(2.0 * xx, xy, xz, xy, 2.0 * yy, yz, xz, yz, 2.0 * zz);
    [products * rate, turning, acceleration]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excitation::{ChannelLimits, NormalizedCondition, PlanarExcitation, SpaceExcitation};
    use crate::{AOptimality, ConditionNumber, DOptimality, EOptimality};

    /// Some motion of the channels that move.
    fn free<const P: usize>(problem: &ExcitationProblem<P>) -> Vec<Channels> {
        let mut free = vec![[0.0; 6]; problem.basis.coefficients() - 3];
        for (row, free) in free.iter_mut().enumerate() {
            for (channel, _) in &problem.channels {
                free[*channel as usize] = 0.3 * (1.9 * row as f64 + 2.3 * f64::from(*channel as u8)).sin();
            }
        }
        free
    }

    fn gradient_is_central_differences<const P: usize>(
        problem: &ExcitationProblem<P>,
        criterion: &impl ExcitationCriterion<P>,
    ) {
        let free = free(problem);
        let mut objective = Objective::new(problem, criterion);
        let mut gradient = vec![[0.0; 6]; free.len()];
        let cost = objective.gradient(&free, &mut gradient).unwrap();
        assert_eq!(objective.cost(&free), Some(cost));
        let scale = gradient.iter().flatten().fold(0.0_f64, |most, entry| most.max(entry.abs()));
        for row in 0..free.len() {
            for (channel, _) in &problem.channels {
                let channel = *channel as usize;
                let mut cost = |by: f64| {
                    let mut free = free.clone();
                    free[row][channel] += by;
                    objective.cost(&free).unwrap()
                };
                let expected = (cost(1e-5) - cost(-1e-5)) / 2e-5;
                let error = (gradient[row][channel] - expected).abs();
                assert!(error < 1e-6 * scale, "row {row} channel {channel}: {} {expected}", gradient[row][channel]);
            }
        }
    }

    #[test]
    fn gradients_are_central_differences() {
        let sigmas = Vector6::new(0.02, 0.03, 0.05, 0.4, 0.3, 0.2);
        let reward = NormalizedCondition { rms_weights: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0] };
        let basis = FourierBasis::try_new(7.0, 3).unwrap();
        let limits = [ChannelLimits::within(1.0); 6];
        let space = SpaceExcitation::try_new(basis, &limits, 15).unwrap().with_wrench_noise(sigmas).unwrap();
        gradient_is_central_differences(&space, &DOptimality);
        gradient_is_central_differences(&space, &AOptimality);
        gradient_is_central_differences(&space, &EOptimality);
        gradient_is_central_differences(&space, &ConditionNumber);
        gradient_is_central_differences(&space, &reward);
        let limits = [ChannelLimits::within(1.0); 3];
        let plane = PlanarExcitation::try_new(basis, &limits, 15).unwrap().with_wrench_noise(sigmas).unwrap();
        gradient_is_central_differences(&plane, &DOptimality);
        gradient_is_central_differences(&plane, &AOptimality);
        gradient_is_central_differences(&plane, &EOptimality);
        gradient_is_central_differences(&plane, &ConditionNumber);
        gradient_is_central_differences(&plane, &reward);
    }

    /// The information is that of the stacked regressor.
    #[test]
    fn information_is_the_sum_over_samples() {
        let basis = FourierBasis::try_new(7.0, 3).unwrap();
        let sigmas = Vector6::new(0.02, 0.03, 0.05, 0.4, 0.3, 0.2);
        let limits = [ChannelLimits::within(1.0); 6];
        let problem = SpaceExcitation::try_new(basis, &limits, 15).unwrap().with_wrench_noise(sigmas).unwrap();
        let free = free(&problem);
        let (found, rms) = Objective::new(&problem, &DOptimality).information(&free).unwrap();
        let numbers = nalgebra::DMatrix::from_fn(free.len(), 6, |row, column| free[row][column]);
        let coefficients = basis.rest_to_rest() * numbers;
        let motion = crate::fourier::FourierMotion::try_new(basis, AttitudeChart::EulerZyx, coefficients).unwrap();
        let mut expected = SMatrix::<f64, 10, 10>::zeros();
        let mut square = 0.0;
        for sample in 0..15 {
            let instant = motion.at(7.0 * f64::from(sample) / 15.0).unwrap();
            let whitened = SMatrix::from_diagonal(&sigmas.map(|sigma| 1.0 / sigma)) * instant.regressor();
            expected += whitened.transpose() * whitened;
            square += instant.world_from_body.translation.y.powi(2) / 15.0;
        }
        assert!((found - expected).amax() < 1e-12 * expected.amax());
        assert!((rms[1] - square.sqrt()).abs() < 1e-14);
    }
}
