//! Poses against the integrated rate: age, bias, scale, alignment.

use super::found::Found;
use super::regression::{Rows, spans};
use super::turned::Turned;
use crate::lie::LieGroup;
use nalgebra::{Matrix4, Quaternion, UnitQuaternion, Vector3};

/// Ages that are looked at, s, and in steps of this.
const REACH_S: f64 = 0.6;
const STEP_S: f64 = 0.02;
/// Parameters: age, bias, scale, alignment.
const PARAMETERS: usize = 10;
const PRIORS: [f64; PARAMETERS] = [1.0, 1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 0.5, 0.5, 0.5];
/// Standard deviation of a parameter that is not free.
const FIXED: f64 = 1e-9;
/// Error of scale of a usual gyroscope, one standard deviation.
const USUAL_SCALE: f64 = 1e-3;
/// Standard deviations by which a scale must be off to be no usual one.
const UNUSUAL: f64 = 4.0;
/// A parameter that is known no better than this share of its prior is not known.
const KNOWN: f64 = 0.3;
/// Rounds of Gauss and Newton.
const ROUNDS: usize = 5;
/// Difference of the misfit, in variances, by which an age must stand out from those far away.
const SEEN: f64 = 30.0;
/// Axes that turn by less than this share of the others are not measured.
const EXACT: f64 = 1e-9;
/// How far away these are, s.
const FAR_S: f64 = 0.3;
/// The identity fits as well as any alignment where its misfit is larger by no more than this share.
const AS_WELL: f64 = 0.1;

/// What poses and rate say of each other.
#[derive(Clone)]
pub(super) struct Attitude {
    /// Age of the poses by the clock of the rate.
    pub(super) age: Option<Found>,
    pub(super) bias: [Option<Found>; 3],
    pub(super) scale: [Option<Found>; 3],
    /// From axes of the rate to axes of the pose.
    pub(super) pose_from_rate: UnitQuaternion<f64>,
    pub(super) misalignment: [Option<Found>; 3],
    /// What was fitted, for what is computed from it.
    state: State,
}

#[derive(Clone, Copy)]
struct State {
    age: f64,
    bias: Vector3<f64>,
    scale: Vector3<f64>,
    alignment: UnitQuaternion<f64>,
}

/// Poses of a record, as they were seen.
pub(super) struct Poses<'a> {
    pub(super) times: &'a [f64],
    pub(super) attitudes: &'a [UnitQuaternion<f64>],
}

impl Poses<'_> {
    fn turn(&self, i: usize, j: usize) -> UnitQuaternion<f64> {
        self.attitudes[i].conjugate() * self.attitudes[j]
    }

    /// Age and alignment from which the increments differ least, by the clock of the rate.
    fn start(&self, turned: &Turned, pairs: &[(usize, usize)]) -> Option<State> {
        let mut best: Option<(f64, f64, UnitQuaternion<f64>)> = None;
        let steps: i32 = 30;
        for step in -steps..=steps {
            let age = f64::from(step) * STEP_S;
            let both: Vec<(Vector3<f64>, Vector3<f64>)> = pairs
                .iter()
                .filter_map(|&(i, j)| {
                    let (a, b) = turned.between(self.times[i] - age, self.times[j] - age)?;
                    Some((LieGroup::log(&self.turn(i, j)), LieGroup::log(&(a.attitude.conjugate() * b.attitude))))
                })
                .collect();
            if both.len() < 2 * PARAMETERS {
                continue;
            }
            let n = both.len() as f64;
            let mean = both.iter().fold((Vector3::zeros(), Vector3::zeros()), |(a, b), (x, y)| (a + x / n, b + y / n));
            let apart: Vec<_> = both.iter().map(|(x, y)| (x - mean.0, y - mean.1)).collect();
            let (misfit, alignment) = aligned(&apart);
            if best.is_none_or(|(least, ..)| misfit / n < least) {
                best = Some((misfit / n, age, alignment));
            }
        }
        let (_, age, alignment) = best.filter(|(_, age, _)| age.abs() <= REACH_S)?;
        Some(State { age, bias: Vector3::zeros(), scale: Vector3::zeros(), alignment })
    }

    /// One for axes about which the poses turn; zero for those that are exact or padded, which measure nothing.
    fn measured(&self, pairs: &[(usize, usize)]) -> Vector3<f64> {
        let most = pairs.iter().fold(Vector3::zeros(), |most: Vector3<f64>, &(i, j)| {
            let turn: Vector3<f64> = LieGroup::log(&self.turn(i, j));
            most.sup(&turn.abs())
        });
        most.map(|m| if m > EXACT * most.max() { 1.0 } else { 0.0 })
    }

    fn rows(&self, turned: &Turned, pairs: &[(usize, usize)], at: &State) -> Rows {
        let mut rows = Rows::new(PARAMETERS);
        let measured = self.measured(pairs);
        let into = at.alignment.to_rotation_matrix().into_inner();
        for &(i, j) in pairs {
            let Some((a, b)) = turned.between(self.times[i] - at.age, self.times[j] - at.age) else { continue };
            let turn = a.attitude.conjugate() * b.attitude;
            let back = b.attitude.conjugate().to_rotation_matrix().into_inner();
            let by_bias = back * (b.integrals[0] - a.integrals[0]);
            let by_scale = back * (b.integrals[1] - a.integrals[1]);
            let corrected = turn * UnitQuaternion::from_scaled_axis(-(by_bias * at.bias + by_scale * at.scale));
            let predicted = at.alignment * corrected * at.alignment.conjugate();
            let residual: Vector3<f64> = LieGroup::log(&(predicted.conjugate() * self.turn(i, j)));
            let returned = turn.conjugate();
            let by_age = into * (returned * a.rate - b.rate);
            let by_turn = into * (returned.to_rotation_matrix().into_inner() - nalgebra::Matrix3::identity());
            let changes: [Vector3<f64>; PARAMETERS] = core::array::from_fn(|p| match p {
                0 => by_age,
                1..=3 => -(into * by_bias.column(p - 1)),
                4..=6 => -(into * by_scale.column(p - 4)),
                _ => by_turn.column(p - 7).into_owned(),
            });
            let changes = changes.map(|change| change.component_mul(&measured));
            rows.push(self.times[i], LieGroup::log(&self.turn(i, j)), residual.component_mul(&measured), &changes);
        }
        rows
    }

    /// From increments over `span_s`; one standard deviation of the error of scale.
    fn fit(&self, turned: &Turned, span_s: f64, start: &State, scale: f64) -> Option<Attitude> {
        let pairs = spans(self.times, span_s);
        let block_s = (2.0 * span_s).max(1.0);
        let mut priors = PRIORS;
        priors[4..7].fill(scale);
        let mut at = *start;
        let seen = self.measured(&pairs);
        let flat = seen.sum() < 2.5;
        if flat {
            // Turning in a plane does not tell the axes apart: they are taken to be the same, and nothing is known of those that do not turn.
            at.alignment = UnitQuaternion::identity();
            priors[7..].fill(FIXED);
            for axis in (0..3).filter(|axis| seen[*axis] < 0.5) {
                (priors[1 + axis], priors[4 + axis]) = (FIXED, FIXED);
            }
        }
        let mut solution = None;
        for _ in 0..ROUNDS {
            let found = self.rows(turned, &pairs, &at).solve(&priors, block_s)?;
            let s = &found.step;
            at.age += s[0].clamp(-0.1, 0.1);
            at.bias += Vector3::new(s[1], s[2], s[3]);
            at.scale += Vector3::new(s[4], s[5], s[6]);
            at.alignment *= UnitQuaternion::from_scaled_axis(Vector3::new(s[7], s[8], s[9]));
            solution = Some(found);
        }
        let found = solution?;
        let misfit = |age: f64| self.rows(turned, &pairs, &State { age, ..at }).misfit(&found.scale);
        let here = misfit(at.age);
        let rows = self.rows(turned, &pairs, &at).len() as f64;
        let unit = found.widening.powi(2);
        let stands_out = found.explains
            && [-FAR_S, FAR_S].iter().all(|away| {
                let far = self.rows(turned, &pairs, &State { age: at.age + away, ..at });
                far.misfit(&found.scale) * rows / (far.len() as f64).max(1.0) - here > SEEN * unit
            });
        let value = |i: usize, value: f64| {
            (stands_out && found.sigma[i] < KNOWN * PRIORS[i]).then_some(Found { value, sigma: found.sigma[i] })
        };
        let bias = |i: usize| {
            let told = seen[i] > 0.5 && found.sigma[1 + i] < KNOWN;
            told.then_some(Found { value: at.bias[i], sigma: found.sigma[1 + i] })
        };
        Some(Attitude {
            age: value(0, at.age),
            bias: core::array::from_fn(bias),
            scale: core::array::from_fn(|i| value(4 + i, at.scale[i]).filter(|_| seen[i] > 0.5)),
            pose_from_rate: at.alignment,
            misalignment: core::array::from_fn(|i| value(7 + i, 0.0).filter(|_| !flat)),
            state: at,
        })
    }
}

impl Attitude {
    /// Of increments over several spans, each number from where it is known best.
    pub(super) fn of(poses: &Poses<'_>, turned: &Turned, candidates: &[f64]) -> Option<Self> {
        let middle = candidates.get(candidates.len() / 2)?;
        let start = poses.start(turned, &spans(poses.times, *middle))?;
        let fits = |scale: f64| -> Vec<Self> {
            candidates.iter().filter_map(|&span| poses.fit(turned, span, &start, scale)).collect()
        };
        // A constant rate shows bias and scale as one: a usual scale is believed in where the log does not show another one.
        let mut best = Self::best(&fits(PRIORS[4]))?;
        let scale = best.scale;
        if scale.iter().flatten().all(|k| k.value.abs() < UNUSUAL * k.sigma.hypot(USUAL_SCALE)) {
            best = Self::best(&fits(USUAL_SCALE))?;
        } else {
            best.state.scale = Vector3::from(scale.map(|k| k.map_or(0.0, |k| k.value)));
        }
        best.scale = scale;
        best.state.bias = Vector3::from(best.bias.map(|b| b.map_or(0.0, |b| b.value)));
        Some(best)
    }

    /// The fit that knows the age best, biases and scales from where they are known best.
    fn best(fits: &[Self]) -> Option<Self> {
        let sigma = |found: &Option<Found>| found.map_or(f64::INFINITY, |f| f.sigma);
        let mut best = fits.iter().min_by(|a, b| sigma(&a.age).total_cmp(&sigma(&b.age)))?.clone();
        for fit in fits {
            for i in 0..3 {
                if sigma(&fit.bias[i]) < sigma(&best.bias[i]) {
                    best.bias[i] = fit.bias[i];
                }
                if sigma(&fit.scale[i]) < sigma(&best.scale[i]) {
                    best.scale[i] = fit.scale[i];
                }
            }
        }
        Some(best)
    }

    /// Where the axes of the rate stand at a time of the poses' clock, by the attitude nearest to it.
    pub(super) fn world_from_rate(
        &self,
        poses: &Poses<'_>,
        turned: &Turned,
        time_s: f64,
    ) -> Option<(UnitQuaternion<f64>, Vector3<f64>, Vector3<f64>)> {
        let after = poses.times.partition_point(|t| *t <= time_s);
        let near = after.saturating_sub(1);
        let now = turned.at(time_s - self.state.age)?;
        let then = turned.at(poses.times.get(near)? - self.state.age)?;
        let since = then.attitude.conjugate() * now.attitude;
        let acceleration = turned.acceleration(time_s - self.state.age)?;
        Some((poses.attitudes[near] * self.state.alignment * since, now.rate, acceleration))
    }

    /// The rate without what was found of its errors.
    pub(super) fn corrected(&self, rate: &Vector3<f64>) -> Vector3<f64> {
        rate - self.state.bias - rate.component_mul(&self.state.scale)
    }

    /// The error of each attitude against the corrected rate, integrated; world axes, from wherever it stood at the first.
    pub(super) fn drift(&self, poses: &Poses<'_>, turned: &Turned) -> (Vec<f64>, Vec<Vector3<f64>>) {
        let mut first = None;
        let (mut times, mut errors) = (Vec::new(), Vec::new());
        for (time, attitude) in poses.times.iter().zip(poses.attitudes) {
            let Some(now) = turned.at(time - self.state.age) else { continue };
            let predicted = now.attitude * self.state.alignment.conjugate();
            let world = *first.get_or_insert(*attitude * predicted.conjugate());
            times.push(*time);
            errors.push(LieGroup::log(&(*attitude * (world * predicted).conjugate())));
        }
        (times, errors)
    }
}

/// The rotation that brings the second of each pair nearest to the first, and the sum of squares it leaves; none where none is as good.
///
/// # Source
/// Davenport's method: the largest eigenvalue of a symmetric matrix of four.
fn aligned(pairs: &[(Vector3<f64>, Vector3<f64>)]) -> (f64, UnitQuaternion<f64>) {
    let mut b = nalgebra::Matrix3::zeros();
    let (mut squares, mut left) = (0.0, 0.0);
    for (x, y) in pairs {
        b += x * y.transpose();
        squares += x.norm_squared() + y.norm_squared();
        left += (x - y).norm_squared();
    }
    let z = Vector3::new(b[(2, 1)] - b[(1, 2)], b[(0, 2)] - b[(2, 0)], b[(1, 0)] - b[(0, 1)]);
    let s = b + b.transpose() - nalgebra::Matrix3::identity() * b.trace();
    let mut k = Matrix4::zeros();
    k[(0, 0)] = b.trace();
    k.fixed_view_mut::<3, 1>(1, 0).copy_from(&z);
    k.fixed_view_mut::<1, 3>(0, 1).copy_from(&z.transpose());
    k.fixed_view_mut::<3, 3>(1, 1).copy_from(&s);
    let eigen = k.symmetric_eigen();
    let largest = eigen.eigenvalues.imax();
    let misfit = (squares - 2.0 * eigen.eigenvalues[largest]).max(0.0);
    if left <= misfit * (1.0 + AS_WELL) + 1e-12 * squares {
        return (left, UnitQuaternion::identity());
    }
    let v = eigen.eigenvectors.column(largest);
    (misfit, UnitQuaternion::from_quaternion(Quaternion::new(v[0], v[1], v[2], v[3])))
}
