//! What poses and wrenches of one period tell about the coefficients of a motion and the ten parameters of a body together:
//! one triangle, whose lower right corner is what they tell about the body alone.

use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::fourier::{AttitudeChart, FourierBasis, MotionInstant};
use crate::lie::skew;
use crate::regressors::Regressor;
use crate::square_root_information::SquareRootInformation;
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};

/// Samples folded into the triangle at once: a block of so many times six rows stays in the nearest cache.
const SAMPLES: usize = 4;
const ROWS: usize = 6 * SAMPLES;
/// Motion terms on which a wrench depends: angular velocity, angular acceleration, acceleration of the origin.
const WRENCH_TERMS: usize = 9;

/// The basis functions at the times of the wrenches: values, first and second derivatives.
pub(super) struct BasisTable {
    functions: Vec<[Vec<f64>; 3]>,
    gravity: Vector3<f64>,
}

impl BasisTable {
    pub(super) fn new(basis: &FourierBasis, times_s: impl Iterator<Item = f64>, gravity: Vector3<f64>) -> Self {
        Self { functions: times_s.map(|time_s| basis.at(time_s)).collect(), gravity }
    }

    /// Instants of the motion with these coefficients, one column per channel, accelerations less gravity: what a wrench
    /// without gravity has to explain. None where a quaternion is zero.
    pub(super) fn instants<'a>(
        &'a self,
        chart: AttitudeChart,
        coefficients: &'a DMatrix<f64>,
    ) -> impl Iterator<Item = (Option<MotionInstant>, &'a [Vec<f64>; 3])> {
        self.functions.iter().map(move |functions| {
            let [value, rate, acceleration] = functions.each_ref().map(|functions| {
                let mut channels = [0.0; 7];
                for (channel, column) in channels.iter_mut().zip(coefficients.column_iter()) {
                    *channel = functions.iter().zip(column.iter()).map(|(f, c)| f * c).sum();
                }
                channels
            });
            let mut instant = MotionInstant::from_channels(chart, &value, &rate, &acceleration);
            if let Some(instant) = &mut instant {
                instant.acceleration_origin_world -= self.gravity;
            }
            (instant, functions)
        })
    }
}

/// Six equations of one instant: derivatives of the whitened wrench by channels, by their rates and second derivatives.
pub(super) struct WrenchRows {
    pub(super) regressor: Regressor<f64>,
    pub(super) by_channel: [SMatrix<f64, 6, 7>; 3],
}

impl WrenchRows {
    /// Rows divided by the standard deviations of the wrench.
    pub(super) fn new(instant: &MotionInstant, parameters: &SVector<f64, 10>, wrench_std: &SVector<f64, 6>) -> Self {
        let by_terms = wrench_by_terms(instant, parameters);
        let mut regressor = instant.regressor();
        let mut by_channel = instant.sensitivities().map(|terms| by_terms * terms.fixed_rows::<WRENCH_TERMS>(0));
        for (i, std) in wrench_std.iter().enumerate() {
            regressor.row_mut(i).unscale_mut(*std);
            for block in &mut by_channel {
                block.row_mut(i).unscale_mut(*std);
            }
        }
        Self { regressor, by_channel }
    }

    /// Derivative of the whitened wrench by coefficient `index` of `channel`.
    pub(super) fn by_coefficient(&self, channel: usize, index: usize, functions: &[Vec<f64>; 3]) -> SVector<f64, 6> {
        let [value, rate, acceleration] = &self.by_channel;
        value.column(channel) * functions[0][index]
            + rate.column(channel) * functions[1][index]
            + acceleration.column(channel) * functions[2][index]
    }
}

/// Derivative of a body's wrench `[torque; force]` by `[angular velocity; angular acceleration; acceleration of the origin]`.
///
/// # Source
/// Thesis (4.8): `tau = J w' + w x J w + h x a`, `f = m a + w' x h + w x (w x h)`.
fn wrench_by_terms(instant: &MotionInstant, parameters: &SVector<f64, 10>) -> SMatrix<f64, 6, WRENCH_TERMS> {
    let body = InertialParameters::from_vector(parameters);
    let (w, h, j) = (instant.angular_velocity_body, body.first_moment, body.inertia_about_origin);
    let centripetal = Matrix3::from_diagonal_element(w.dot(&h)) + w * h.transpose() - h * w.transpose() * 2.0;
    let mut by_terms = SMatrix::<f64, 6, WRENCH_TERMS>::zeros();
    by_terms.fixed_view_mut::<3, 3>(0, 0).copy_from(&(skew(&w) * j - skew(&(j * w))));
    by_terms.fixed_view_mut::<3, 3>(0, 3).copy_from(&j);
    by_terms.fixed_view_mut::<3, 3>(0, 6).copy_from(&skew(&h));
    by_terms.fixed_view_mut::<3, 3>(3, 0).copy_from(&centripetal);
    by_terms.fixed_view_mut::<3, 3>(3, 3).copy_from(&-skew(&h));
    by_terms.fixed_view_mut::<3, 3>(3, 6).copy_from(&Matrix3::from_diagonal_element(body.mass));
    by_terms
}

/// Whitened equations `[coefficients, parameters | right-hand side]` as an upper triangle, folded in block by block.
///
/// Nothing is squared: directions that a motion does not show stay exactly zero, and exact poses or wrenches do no harm.
pub(super) struct JointInformation {
    /// Coefficients of one channel, and of all.
    per_channel: usize,
    coefficients: usize,
    /// Rows of the triangle one after another, each `coefficients + 11` long.
    triangle: Vec<f64>,
    block: Vec<[f64; ROWS]>,
    /// Samples in the block.
    waiting: usize,
}

impl JointInformation {
    /// What the poses say: each coefficient of `std` (one column per channel) and how far the expected value is away.
    pub(super) fn of_poses(std: &DMatrix<f64>, away: &DMatrix<f64>) -> Self {
        let coefficients = std.len();
        let columns = coefficients + 11;
        let mut triangle = vec![0.0; (coefficients + 10) * columns];
        for (i, (std, away)) in std.iter().zip(away.iter()).enumerate() {
            triangle[i * columns + i] = 1.0 / std;
            triangle[i * columns + columns - 1] = away / std;
        }
        Self { per_channel: std.nrows(), coefficients, triangle, block: vec![[0.0; ROWS]; columns], waiting: 0 }
    }

    /// Adds the wrench of one instant, whitened; the unknowns are changes of the coefficients, and the ten parameters.
    pub(super) fn add(&mut self, rows: &WrenchRows, functions: &[Vec<f64>; 3], wrench: &SVector<f64, 6>) {
        let first = 6 * self.waiting;
        let (by_coefficient, by_parameter) = self.block.split_at_mut(self.coefficients);
        for (i, column) in by_coefficient.iter_mut().enumerate() {
            let derivative = rows.by_coefficient(i / self.per_channel, i % self.per_channel, functions);
            column[first..first + 6].copy_from_slice(derivative.as_slice());
        }
        for (column, parameter) in by_parameter.iter_mut().zip(rows.regressor.column_iter()) {
            column[first..first + 6].copy_from_slice(parameter.as_slice());
        }
        by_parameter[10][first..first + 6].copy_from_slice(wrench.as_slice());
        self.waiting += 1;
        if self.waiting == SAMPLES {
            self.fold();
        }
    }

    /// Reflects the block into the triangle, column by column, and empties it.
    fn fold(&mut self) {
        let columns = self.coefficients + 11;
        for (j, row) in self.triangle.chunks_exact_mut(columns).enumerate() {
            let (head, tail) = self.block.split_at_mut(j + 1);
            let column = &head[j];
            let squares = dot(column, column);
            if squares == 0.0 {
                continue;
            }
            let diagonal = row[j];
            let norm = (diagonal * diagonal + squares).sqrt();
            row[j] = norm;
            for (pivot, other) in row[j + 1..].iter_mut().zip(tail) {
                let image = (diagonal * *pivot + dot(column, other)) / norm;
                let step = (*pivot + image) / (diagonal + norm);
                *pivot = image;
                for (x, c) in other.iter_mut().zip(column) {
                    *x -= c * step;
                }
            }
        }
        self.block.fill([0.0; ROWS]);
        self.waiting = 0;
    }

    /// What is known of the ten parameters, the coefficients being unknown too.
    pub(super) fn of_body(&mut self) -> Result<SquareRootInformation<10>, IdentificationError> {
        self.fold();
        let columns = self.coefficients + 11;
        let at = |i: usize, j: usize| self.triangle[(self.coefficients + i) * columns + self.coefficients + j];
        SquareRootInformation::from_square_root(&SMatrix::from_fn(at), &SVector::from_fn(|i, _| at(i, 10)))
    }

    /// The changes of the coefficients that go with these parameters; none still waiting in the block.
    pub(super) fn coefficients(&self, parameters: &SVector<f64, 10>) -> DMatrix<f64> {
        let count = self.coefficients;
        let mut change = DMatrix::zeros(self.per_channel, count / self.per_channel);
        for (i, row) in self.triangle.chunks_exact(count + 11).take(count).enumerate().rev() {
            let known = row[i + 1..count].iter().zip(&change.as_slice()[i + 1..]);
            let known: f64 = known.chain(row[count..].iter().zip(parameters.iter())).map(|(r, x)| r * x).sum();
            change[i] = (row[count + 10] - known) / row[i];
        }
        change
    }

    /// Squared error of a whitened wrench that the uncertainty of the coefficients makes, the body being known.
    pub(super) fn scatter(&self, rows: &WrenchRows, functions: &[Vec<f64>; 3]) -> f64 {
        let count = self.coefficients;
        let by_coefficient = |i| rows.by_coefficient(i / self.per_channel, i % self.per_channel, functions);
        let mut derivatives: Vec<SVector<f64, 6>> = (0..count).map(by_coefficient).collect();
        let mut squares = 0.0;
        for (i, row) in self.triangle.chunks_exact(count + 11).take(count).enumerate() {
            let unit = derivatives[i] / row[i];
            squares += unit.norm_squared();
            for (derivative, r) in derivatives[i + 1..].iter_mut().zip(&row[i + 1..]) {
                *derivative -= unit * *r;
            }
        }
        squares
    }

    /// Squared length of a step of coefficients and parameters, in standard deviations.
    pub(super) fn squared_length(&self, coefficients: &DMatrix<f64>, parameters: &SVector<f64, 10>) -> f64 {
        let step: Vec<f64> = coefficients.iter().chain(parameters.iter()).copied().collect();
        let rows = self.triangle.chunks_exact(self.coefficients + 11).enumerate();
        rows.map(|(i, row)| row[i..].iter().zip(&step[i..]).map(|(r, x)| r * x).sum::<f64>().powi(2)).sum()
    }
}

/// Inner product in four lanes, so that the compiler may use them.
#[inline(always)]
fn dot(a: &[f64; ROWS], b: &[f64; ROWS]) -> f64 {
    let mut lanes = [0.0; 4];
    for (a, b) in a.chunks_exact(4).zip(b.chunks_exact(4)) {
        for ((lane, a), b) in lanes.iter_mut().zip(a).zip(b) {
            *lane += a * b;
        }
    }
    (lanes[0] + lanes[2]) + (lanes[1] + lanes[3])
}

/// Standard deviations of the coefficients that averaged channels give, one column per channel.
///
/// # Source
/// The columns of the basis are orthogonal over equal steps of one period: the fit by discrete Fourier transform is a
/// sufficient statistic of the poses.
pub(super) fn coefficient_std(basis: &FourierBasis, samples: usize, channel_std: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(basis.coefficients(), channel_std.len(), |j, channel| {
        channel_std[channel] / squared_norm(basis, samples, j).sqrt()
    })
}

/// Squared norm of basis function j over equal steps of one period.
fn squared_norm(basis: &FourierBasis, samples: usize, j: usize) -> f64 {
    match j {
        0 => samples as f64,
        _ => 0.5 * samples as f64 / basis.frequency_rad_s(1 + (j - 1) % basis.harmonics()).powi(2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::strategies::body_d;

    /// Against central differences of the regressor times the parameters.
    #[test]
    fn wrench_derivatives_are_central_differences() {
        let parameters = body_d().to_vector();
        let std = SVector::from([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
        for chart in [AttitudeChart::EulerZyx, AttitudeChart::Quaternion] {
            let basis = FourierBasis::try_new(4.0, 3).unwrap();
            let mut coefficients =
                DMatrix::from_fn(7, 3 + chart.channels(), |j, c| 0.3 * (1.0 + 3.7 * j as f64 + 1.3 * c as f64).sin());
            coefficients[(0, 5)] += 1.0;
            let table = BasisTable::new(&basis, core::iter::once(1.3), Vector3::new(0.5, -1.0, 2.0));
            let rows = |coefficients: &DMatrix<f64>| {
                let instant = table.instants(chart, coefficients).next().unwrap().0.unwrap();
                WrenchRows::new(&instant, &parameters, &std)
            };
            let (found, functions) = (rows(&coefficients), &table.functions[0]);
            for channel in 0..coefficients.ncols() {
                for index in 0..7 {
                    let wrench = |by: f64| {
                        let mut moved = coefficients.clone();
                        moved[(index, channel)] += by;
                        rows(&moved).regressor * parameters
                    };
                    let expected = (wrench(1e-5) - wrench(-1e-5)) / 2e-5;
                    let error = (found.by_coefficient(channel, index, functions) - expected).amax();
                    assert!(error < 1e-6 * (1.0 + expected.amax()), "{chart:?} {channel} {index}: {error:e}");
                }
            }
        }
    }
}
