//! What a fit says.

use super::super::coordinates::Coordinates;
use super::fit::{FEWEST_SEGMENTS, Fit, solved, without_state};
use super::grid::{ACCELERATION, RATE, STREAMS};
use super::layout::BODY;
use super::levels::FoundLevels;
use super::thrusters::{FoundFactor, FoundThrusters};
use super::{coherent, undescribed};
use crate::SquareRootInformation;
use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::statistics::{Whiteness, chi_square_exceedance};
use crate::units::Units;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

/// A quantity is determined where one sigma of it is below this share of the body's own scale.
const DETERMINED: f64 = 0.2;
/// Chi squared of three scales beyond which an accelerometer is not sane: chance does so once in a thousand.
const INSANE: f64 = 16.27;
/// Distances over which correlation of what is left of the inertial rows is looked at, in segments.
const DISTANCES: usize = 8;

/// Age of a stream at its stamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundDelay {
    /// Value, s; positive where it shows older motion.
    pub value_s: f64,
    /// One standard deviation, s; zero where it was told.
    pub std_s: f64,
}

/// The two halves of the record against each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Halves {
    /// Squared difference of what they say, in joint standard deviations.
    pub chi_square: f64,
    /// Its degrees of freedom: parameters of the body that were free.
    pub degrees_of_freedom: usize,
    /// Difference of the logarithms of the masses, second less first, and one standard deviation of it.
    pub log_mass: (f64, f64),
}

impl Halves {
    /// The chance of so large a difference where one body explains both.
    pub fn chance(&self) -> f64 {
        chi_square_exceedance(self.degrees_of_freedom as f64, self.chi_square)
    }
}

/// What [`FlightLikelihood::estimate`](super::FlightLikelihood::estimate) found.
#[derive(Clone, Debug, PartialEq)]
pub struct FlightEstimate {
    /// The most likely body; of a planar motion mass, centre of mass along x and y and the moment of inertia about z alone say something.
    pub parameters: InertialParameters<f64>,
    /// Covariance of `[ln m, c, J_C (11, 12, 13, 22, 23, 33)]`; zero rows where a parameter was not free.
    pub covariance: SMatrix<f64, 10, 10>,
    /// What the record alone says of [`InertialParameters::to_vector`], with everything else unknown; directions that it does not determine
    /// are left out.
    pub information: SquareRootInformation<10>,
    /// Whether each of `[ln m, c, J_C]` is determined.
    pub determined: [bool; 10],
    /// The motion was taken for one in the plane.
    pub planar: bool,
    /// Levels.
    pub levels: FoundLevels,
    /// Gain less one of the gyroscope, bias of the published rate (rad/s); zero where not free.
    pub rate_gain: Matrix3<f64>,
    /// Bias of the published rate, rad/s.
    pub rate_bias: Vector3<f64>,
    /// The same of the accelerometer.
    pub acceleration_gain: Matrix3<f64>,
    /// Bias of the published acceleration, m/s^2.
    pub acceleration_bias: Vector3<f64>,
    /// Chi squared of the accelerometer's scales against those of a sane one, three degrees of freedom.
    pub acceleration_gain_chi_square: f64,
    /// The scales of the accelerometer are those of a sane one, and were held to it.
    pub acceleration_gain_sane: bool,
    /// Ages of poses, velocities, rates, accelerations; none where a stream is missing.
    pub delays: [Option<FoundDelay>; 4],
    /// Scales of thrusters, where they were told.
    pub thrusters: Option<FoundThrusters>,
    /// The halves of the record against each other; none for a record too short.
    pub halves: Option<Halves>,
    /// Share of the wrench's mean square that the body explains, torque and force counted at the body's own length.
    pub explained: f64,
    /// Error of the wrench that the motion asks for, segment by segment: first sample of the record, torque, force.
    pub wrench_errors: Vec<(usize, Vector3<f64>, Vector3<f64>)>,
    /// Colour of what is left of rate and acceleration, segment by segment.
    pub whiteness: [Option<Whiteness>; 2],
    /// Segments left out as outliers, stream by stream.
    pub gated: [usize; 5],
    /// Samples in a segment.
    pub segment_samples: usize,
    /// Sweeps done.
    pub sweeps: usize,
}

impl FlightEstimate {
    /// Whether all ten parameters are determined.
    pub fn is_determined(&self) -> bool {
        self.determined.iter().all(|determined| *determined)
    }

    /// The same in other units.
    pub(super) fn in_units(mut self, units: &Units) -> Self {
        let (length, time) = (units.length(), units.time());
        let factors = units.parameter_factors();
        let inertia = factors[4];
        let body = self.parameters.to_vector().component_mul(&factors);
        self.parameters = InertialParameters::from_vector(&body);
        let eta = SVector::<f64, 10>::from_fn(|i, _| match i {
            0 => 1.0,
            1..=3 => length,
            _ => inertia,
        });
        self.covariance = SMatrix::from_fn(|i, j| self.covariance[(i, j)] * eta[i] * eta[j]);
        let factor = SMatrix::<f64, 10, 10>::from_fn(|i, j| self.information.factor()[(i, j)] / factors[j]);
        // Numbers that were finite stay so but for units nobody can mean.
        if let Ok(information) = SquareRootInformation::from_square_root(&factor, &self.information.rhs()) {
            self.information = information;
        }
        let sizes = [length, 1.0, length / time];
        let rate = 1.0 / time;
        let white = [sizes[0], sizes[1], sizes[2], rate, units.acceleration()];
        for (level, size) in self.levels.white.iter_mut().zip(white) {
            *level *= size;
        }
        for ((sigma, time_s), size) in self.levels.wander.iter_mut().zip(sizes) {
            (*sigma, *time_s) = (*sigma * size, *time_s * time);
        }
        let (torque, force) = (units.force() * length, units.force());
        self.levels.wrench = [self.levels.wrench[0] * torque, self.levels.wrench[1] * force];
        self.levels.lasting = [self.levels.lasting[0] * torque, self.levels.lasting[1] * force];
        self.rate_bias *= rate;
        self.acceleration_bias *= units.acceleration();
        for delay in self.delays.iter_mut().flatten() {
            (delay.value_s, delay.std_s) = (delay.value_s * time, delay.std_s * time);
        }
        for (_, of_torque, of_force) in &mut self.wrench_errors {
            *of_torque *= torque;
            *of_force *= force;
        }
        self
    }

    /// What was found less the truth: `[ln m, c, J_C (11, 12, 13, 22, 23, 33)]`, body axes, 1, m, kg m^2.
    pub fn error(&self, truth: &InertialParameters<f64>) -> SVector<f64, 10> {
        Coordinates::of(&self.parameters).difference(&Coordinates::of(truth))
    }

    /// That error squared, in units of its joint covariance (1), and over how many parameters: those that were free. Of many records the mean
    /// is one per parameter; infinite where the covariance is none.
    pub fn squared_error(&self, truth: &InertialParameters<f64>) -> (f64, usize) {
        let (error, std) = (self.error(truth), self.std());
        let free: Vec<usize> = (0..10).filter(|&i| std[i] > 0.0).collect();
        let n = free.len();
        let joint = DMatrix::from_fn(n, n, |i, j| self.covariance[(free[i], free[j])] / (std[free[i]] * std[free[j]]));
        let z = DVector::from_fn(n, |i, _| error[free[i]] / std[free[i]]);
        (joint.cholesky().map_or(f64::INFINITY, |factor| z.dot(&factor.solve(&z))), n)
    }

    /// One standard deviation of each of `[ln m, c, J_C (11, 12, 13, 22, 23, 33)]`.
    pub fn std(&self) -> SVector<f64, 10> {
        self.covariance.diagonal().map(|variance| variance.max(0.0).sqrt())
    }
}

impl FoundThrusters {
    /// Of a fit at rest; `None` where no thrusters were told.
    pub(super) fn of(fit: &Fit<'_>, covariance: &DMatrix<f64>, freed: &[usize]) -> Option<Self> {
        let told = fit.of.thrusters.as_ref()?;
        let n = told.len();
        let place = |parameter: usize| Some((fit.eta[BODY + parameter], fit.column_of(BODY + parameter)?));
        let shared = |parameter: Option<usize>, about: f64| {
            let (value, at) = place(parameter?)?;
            Some(FoundFactor { value: about + value, std: covariance[(at, at)].max(0.0).sqrt() })
        };
        let mut found = Self {
            scale: vec![1.0; n],
            std: vec![0.0; n],
            deviations: vec![0.0; n],
            suspects: freed.to_vec(),
            constant_n: vec![None; n],
            common: shared(told.common, 1.0),
            sag: shared(told.sag, 0.0),
        };
        for (parameter, thruster) in &told.constant {
            found.constant_n[*thruster] = shared(Some(*parameter), 0.0);
        }
        for i in 0..n {
            let Some((value, at)) = place(i) else { continue };
            let (variance, sigma) = (covariance[(at, at)], told.sigma[i]);
            found.scale[i] = 1.0 + value;
            found.std[i] = variance.max(0.0).sqrt();
            let own = 1.0 / variance - 1.0 / (sigma * sigma);
            if own > 0.0 {
                found.deviations[i] = value / (variance * own) / (1.0 / own + sigma * sigma).sqrt();
            }
        }
        Some(found)
    }
}

/// The gains of an accelerometer against a sane one: chi squared, and the precision that being sane adds.
struct Gains {
    chi_square: f64,
    sane: bool,
}

fn indefinite(fit: &Fit<'_>) -> IdentificationError {
    IdentificationError::Indefinite { parameters: fit.free.len() }
}

/// Covariance of all free parameters, as the last step had them.
pub(super) fn covariance(fit: &Fit<'_>) -> Option<DMatrix<f64>> {
    let p = fit.free.len();
    floored(fit, &fit.information).and_then(|information| solved(&information, &DMatrix::identity(p, p)))
}

pub(super) fn of(fit: &mut Fit<'_>, freed: &[usize]) -> Result<FlightEstimate, IdentificationError> {
    let mut covariance = self::covariance(fit).ok_or(indefinite(fit))?;
    let gains = judge_gains(fit, &covariance);
    if gains.sane {
        hold_gains(fit, &covariance);
        covariance = self::covariance(fit).ok_or(indefinite(fit))?;
    }
    let thrusters = FoundThrusters::of(fit, &covariance, freed);
    let coordinates = fit.coordinates();
    let (mut of_body, ten) = body_information(fit)?;
    let widened = coherent::widen(fit, &mut of_body)?;
    let widened = undescribed::widen(fit, &covariance, &mut of_body, widened);
    let halves = halves(fit, widened.as_ref());
    let (determined, information) = determined(fit, &coordinates, &of_body, &ten)?;
    let of_plane = [0, 1, 2, 9];
    if fit.drifts && (0..10).all(|i| determined[i] || fit.planar && !of_plane.contains(&i)) {
        return Err(fit.not_converged());
    }
    let mut body = SMatrix::<f64, 10, 10>::zeros();
    for (i, &a) in fit.free.iter().enumerate().filter(|(_, a)| **a < BODY) {
        for (j, &b) in fit.free.iter().enumerate().filter(|(_, b)| **b < BODY) {
            body[(a, b)] = covariance[(i, j)] + widened.as_ref().map_or(0.0, |more| more[(i, j)]);
        }
    }
    let has: [bool; STREAMS] = core::array::from_fn(|s| fit.grid.valid.iter().any(|valid| valid[s]));
    let variance = |column: usize| fit.column_of(column).map_or(0.0, |i| covariance[(i, i)].max(0.0));
    let layout = fit.layout;
    let delays = core::array::from_fn(|i| {
        let seen = [has[0] || has[1], has[2], has[RATE], has[ACCELERATION]][i];
        let of = if i == 1 && fit.of.sensing.velocity_delay.is_none() { 0 } else { i };
        seen.then(|| FoundDelay { value_s: fit.delay_s(i), std_s: variance(layout.delay() + of).sqrt() })
    });
    let gain = |from: usize| Matrix3::from_row_slice(&fit.eta[from..from + 9]);
    let bias = |from: usize| Vector3::new(fit.eta[from], fit.eta[from + 1], fit.eta[from + 2]);
    let mut levels = fit.levels;
    for (white, has) in levels.white.iter_mut().zip(has) {
        *white = if has { *white } else { 0.0 };
    }
    let wrench_errors: Vec<(usize, Vector3<f64>, Vector3<f64>)> = fit
        .all_wrench_errors()
        .enumerate()
        .map(|(j, e)| {
            let sample = fit.grid.source[j * fit.samples];
            (sample, Vector3::new(e[0], e[1], e[2]), Vector3::new(e[3], e[4], e[5]))
        })
        .collect();
    Ok(FlightEstimate {
        parameters: coordinates.parameters(),
        covariance: body,
        information,
        determined,
        planar: fit.planar,
        levels,
        rate_gain: gain(layout.rate_gain()),
        rate_bias: bias(layout.rate_bias()),
        acceleration_gain: gain(layout.acceleration_gain()),
        acceleration_bias: bias(layout.acceleration_bias()),
        acceleration_gain_chi_square: gains.chi_square,
        acceleration_gain_sane: gains.sane,
        delays,
        thrusters,
        halves,
        explained: explained(fit, &coordinates, &wrench_errors),
        whiteness: [RATE, ACCELERATION].map(|stream| whiteness(fit, stream)),
        wrench_errors,
        gated: fit.gated(),
        segment_samples: fit.samples,
        sweeps: fit.sweeps,
    })
}

/// The information with so much added about the body that what it leaves free can be inverted: a sigma of a thousand bodies.
fn floored(fit: &Fit<'_>, information: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let sizes = fit.coordinates().sizes();
    let mut out = information.clone();
    for (i, &column) in fit.free.iter().enumerate().filter(|(_, column)| **column < BODY) {
        out[(i, i)] += 1e-6 / (sizes[column] * sizes[column]);
    }
    out.iter().all(|x| x.is_finite()).then_some(out)
}

fn judge_gains(fit: &Fit<'_>, covariance: &DMatrix<f64>) -> Gains {
    let sane = fit.of.sensing.acceleration.scale_sigma;
    let diagonal: Vec<usize> = (0..3).filter_map(|i| fit.column_of(fit.layout.acceleration_gain() + 4 * i)).collect();
    let n = diagonal.len();
    let joint =
        DMatrix::from_fn(n, n, |i, j| covariance[(diagonal[i], diagonal[j])] + if i == j { sane * sane } else { 0.0 });
    let values = DMatrix::from_fn(n, 1, |i, _| fit.eta[fit.free[diagonal[i]]]);
    let chi_square = solved(&joint, &values).map_or(f64::INFINITY, |x| x.dot(&values));
    Gains { chi_square, sane: n == 0 || chi_square <= INSANE }
}

/// Imposes what a sane accelerometer is known to be, in place of the wide prior of its scales.
fn hold_gains(fit: &mut Fit<'_>, covariance: &DMatrix<f64>) {
    let sane = fit.of.sensing.acceleration.scale_sigma;
    let diagonal: Vec<usize> = (0..3).filter_map(|i| fit.column_of(fit.layout.acceleration_gain() + 4 * i)).collect();
    let p = fit.free.len();
    let mut pull = DVector::zeros(p);
    let mut added = Vec::new();
    for &i in &diagonal {
        let more = 1.0 / (sane * sane).max(1e-18) - fit.prior[i];
        if more > 0.0 {
            pull[i] -= more * fit.eta[fit.free[i]];
            fit.information[(i, i)] += more;
            fit.prior[i] += more;
            added.push(i);
        }
    }
    if added.is_empty() || covariance.nrows() != p {
        return;
    }
    let Some(step) = floored(fit, &fit.information)
        .and_then(|information| solved(&information, &DMatrix::from_column_slice(p, 1, pull.as_slice())))
    else {
        return;
    };
    for (&column, step) in fit.free.iter().zip(step.iter()) {
        fit.eta[column] += step;
    }
}

/// Information of the free parameters of the body, everything else eliminated, and which of the ten these are.
fn body_information(fit: &Fit<'_>) -> Result<(DMatrix<f64>, Vec<usize>), IdentificationError> {
    let ten: Vec<usize> = fit.free.iter().copied().filter(|column| *column < BODY).collect();
    let (n, p) = (ten.len(), fit.free.len());
    let all = &fit.information;
    let rest = all.view((n, n), (p - n, p - n)).into_owned();
    let cross = all.view((n, 0), (p - n, n)).into_owned();
    let body = all.view((0, 0), (n, n)).into_owned();
    if p == n {
        return Ok((body, ten));
    }
    let gone = solved(&rest, &cross).ok_or(indefinite(fit))?;
    let left = body - cross.transpose() * gone;
    Ok(((&left + left.transpose()) * 0.5, ten))
}

/// Which parameters are determined, and the information of the ten in the order of `to_vector`.
fn determined(
    fit: &Fit<'_>,
    coordinates: &Coordinates,
    information: &DMatrix<f64>,
    ten: &[usize],
) -> Result<([bool; 10], SquareRootInformation<10>), IdentificationError> {
    let sizes = coordinates.sizes();
    let n = ten.len();
    let scaled = DMatrix::from_fn(n, n, |i, j| information[(i, j)] * sizes[ten[i]] * sizes[ten[j]]);
    if scaled.iter().any(|x| !x.is_finite()) {
        return Err(indefinite(fit));
    }
    let eigen = scaled.symmetric_eigen();
    // Rows of a square root, in eta; directions that are not determined stay out of it.
    let mut root = SMatrix::<f64, 10, 10>::zeros();
    let mut free = SVector::<f64, 10>::zeros();
    let mut known = [false; 10];
    for &i in ten {
        known[i] = true;
    }
    for (k, (value, vector)) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()).enumerate() {
        if *value > DETERMINED.powi(-2) {
            for (i, &column) in ten.iter().enumerate() {
                root[(k, column)] = value.sqrt() * vector[i] / sizes[column];
            }
        } else {
            for (i, &column) in ten.iter().enumerate() {
                free[column] += vector[i] * vector[i];
            }
        }
    }
    for (known, free) in known.iter_mut().zip(free.iter()) {
        *known &= *free < 1e-3;
    }
    let to_eta = if fit.planar {
        planar_eta_by_parameters(coordinates)
    } else {
        coordinates.parameters_by_eta().try_inverse().ok_or(indefinite(fit))?
    };
    let factor = root * to_eta;
    let rhs = factor * coordinates.parameters().to_vector();
    Ok((known, SquareRootInformation::from_square_root(&factor, &rhs)?))
}

/// Derivative of ln m, c_x, c_y and J_C33 by mass, first moments and J_33 about the origin: all that a motion in the plane knows.
pub(super) fn planar_eta_by_parameters(at: &Coordinates) -> SMatrix<f64, 10, 10> {
    let (m, c) = (at.log_mass.exp(), at.center);
    let mut out = SMatrix::<f64, 10, 10>::zeros();
    out[(0, 0)] = 1.0 / m;
    for i in 0..2 {
        out[(1 + i, 0)] = -c[i] / m;
        out[(1 + i, 1 + i)] = 1.0 / m;
        // J_C = J_O - h^2/m.
        out[(9, 1 + i)] = -2.0 * c[i];
    }
    out[(9, 0)] = c.x * c.x + c.y * c.y;
    out[(9, 9)] = 1.0;
    out
}

/// The two halves of a record against each other; `hidden` is what errors of the wrench that move with it add to the covariance of the body, in each
/// half by other motion.
fn halves(fit: &mut Fit<'_>, hidden: Option<&DMatrix<f64>>) -> Option<Halves> {
    let middle = fit.segments / 2;
    if middle < FEWEST_SEGMENTS {
        return None;
    }
    let (shape, p) = (fit.chain.shape, fit.free.len());
    let prior = DMatrix::from_fn(p, p, |i, j| if i == j { fit.prior[i] } else { 0.0 });
    let mut steps = Vec::new();
    for (from, to) in [(0, middle), (middle, fit.segments)] {
        let form = fit.chain.eliminate(from, to, false);
        let (alone, gradient, _) = without_state(&form, shape)?;
        let with = floored(fit, &(&alone + &prior))?;
        let covariance = solved(&with, &DMatrix::identity(p, p))?;
        let pulled =
            DVector::from_fn(p, |i, _| gradient[i] + fit.prior[i] * (fit.eta[fit.free[i]] - fit.mean[fit.free[i]]));
        let step = -(&covariance * pulled);
        let spread = &covariance * alone * &covariance;
        steps.push((step, covariance, spread));
    }
    let (a, b) = (&steps[0], &steps[1]);
    let apart = &b.0 - &a.0;
    // What both halves take from one prior is common to them.
    let common = &b.1 - &a.1;
    let mut spread = &a.2 + &b.2 + &common * prior * &common;
    let of_body: Vec<usize> = (0..p).filter(|&i| fit.free[i] < BODY).collect();
    for (i, &row) in of_body.iter().enumerate() {
        for (j, &column) in of_body.iter().enumerate() {
            spread[(row, column)] += hidden.map_or(0.0, |hidden| 2.0 * hidden[(i, j)]);
        }
    }
    let sizes = fit.coordinates().sizes();
    // Where either half leaves a parameter free it says nothing against the other.
    let seen: Vec<usize> = (0..p)
        .filter(|&i| fit.free[i] < BODY && [a, b].iter().all(|h| h.1[(i, i)].sqrt() < DETERMINED * sizes[fit.free[i]]))
        .collect();
    let n = seen.len();
    if n == 0 {
        return None;
    }
    let joint = DMatrix::from_fn(n, n, |i, j| spread[(seen[i], seen[j])]);
    let difference = DMatrix::from_fn(n, 1, |i, _| apart[seen[i]]);
    let chi_square = solved(&joint, &difference)?.dot(&difference);
    let mass = fit.column_of(0)?;
    Some(Halves { chi_square, degrees_of_freedom: n, log_mass: (apart[mass], spread[(mass, mass)].max(0.0).sqrt()) })
}

fn explained(fit: &Fit<'_>, body: &Coordinates, errors: &[(usize, Vector3<f64>, Vector3<f64>)]) -> f64 {
    let length = (1.5 * body.inertia.trace() / 3.0 / body.log_mass.exp()).sqrt();
    let size =
        |torque: &Vector3<f64>, force: &Vector3<f64>| torque.norm_squared() / (length * length) + force.norm_squared();
    let used = fit.segments * fit.samples;
    let applied: f64 =
        fit.grid.torque.iter().zip(&fit.grid.force).take(used).map(|(torque, force)| size(torque, force)).sum();
    let left: f64 = errors.iter().map(|(_, torque, force)| fit.samples as f64 * size(torque, force)).sum();
    if applied > 0.0 { 1.0 - left / applied } else { 0.0 }
}

fn whiteness(fit: &Fit<'_>, stream: usize) -> Option<Whiteness> {
    let channels: Vec<Vec<f64>> = fit.axes[stream]
        .iter()
        .map(|axis| {
            let channel = 3 * stream + axis;
            (0..fit.segments)
                .filter(|&j| fit.chain.weights[j][channel] > 0.0)
                .map(|j| fit.left[j][channel] * fit.chain.weights[j][channel].sqrt())
                .collect()
        })
        .collect();
    let channels: Vec<&[f64]> = channels.iter().map(Vec::as_slice).collect();
    Whiteness::of(&channels, DISTANCES, 0).ok()
}
