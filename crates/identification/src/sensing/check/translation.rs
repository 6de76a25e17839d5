//! Positions against accelerations, integrated twice, and against velocities, integrated once.

use super::attitude::{Attitude, Poses};
use super::found::Found;
use super::levels::measured;
use super::regression::{Rows, Solution, spans};
use super::turned::{Turned, place, series};
use crate::motion::MotionSample;
use nalgebra::{UnitQuaternion, Vector3};

/// Parameters of an accelerometer: age, scale, bias, lever of the angular acceleration, lever of the centripetal one.
const PARAMETERS: usize = 13;
const PRIORS: [f64; PARAMETERS] = [1.0, 1.0, 1.0, 1.0, 10.0, 10.0, 10.0, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3];
/// A parameter that is known no better than this share of its prior is not known.
const KNOWN: f64 = 0.3;
/// Ages that are looked at, s, in steps of this.
const REACH: i32 = 12;
const STEP_S: f64 = 0.05;
/// Rounds of Gauss and Newton.
const ROUNDS: usize = 4;
/// Difference of the misfit, in variances, by which an age must stand out from those far away.
const SEEN: f64 = 30.0;
/// How far away these are, s.
const FAR_S: f64 = 0.3;

/// A series with its integrals, straight between samples.
struct Integrated {
    times: Vec<f64>,
    values: Vec<Vector3<f64>>,
    once: Vec<Vector3<f64>>,
    twice: Vec<Vector3<f64>>,
}

impl Integrated {
    fn new(times: &[f64], values: Vec<Vector3<f64>>) -> Self {
        let (mut once, mut twice) = (vec![Vector3::zeros()], vec![Vector3::zeros()]);
        for k in 1..times.len() {
            let h = times[k] - times[k - 1];
            twice.push(twice[k - 1] + once[k - 1] * h + (values[k - 1] * 2.0 + values[k]) * (h * h / 6.0));
            once.push(once[k - 1] + (values[k - 1] + values[k]) * (0.5 * h));
        }
        Self { times: times.to_vec(), values, once, twice }
    }

    /// Value and both integrals at a time.
    fn at(&self, t: f64) -> Option<[Vector3<f64>; 3]> {
        let k = place(&self.times, t)?;
        let (h, s) = (self.times[k + 1] - self.times[k], t - self.times[k]);
        let slope = (self.values[k + 1] - self.values[k]) / h.max(f64::MIN_POSITIVE);
        let value = self.values[k];
        Some([
            value + slope * s,
            self.once[k] + value * s + slope * (0.5 * s * s),
            self.twice[k] + self.once[k] * s + value * (0.5 * s * s) + slope * (s * s * s / 6.0),
        ])
    }
}

/// What positions and accelerations say of each other.
#[derive(Clone)]
pub(super) struct Acceleration {
    /// Age of the accelerations less that of the poses.
    pub(super) later: Option<Found>,
    pub(super) bias: [Option<Found>; 3],
    pub(super) scale: [Option<Found>; 3],
    /// Where the accelerometer sits, by what the angular acceleration makes there; axes of the rate.
    pub(super) lever: [Option<Found>; 3],
    state: [f64; PARAMETERS],
}

/// Where the motion is seen from.
pub(super) struct View<'a> {
    pub(super) poses: Poses<'a>,
    pub(super) positions: &'a [Vector3<f64>],
    /// With the rate, corrected.
    pub(super) turning: Option<(&'a Attitude, &'a Turned)>,
}

impl View<'_> {
    /// Attitude of the accelerometer's axes, their rate and angular acceleration, at a time of the poses.
    fn attitude(&self, t: f64) -> Option<(UnitQuaternion<f64>, Vector3<f64>, Vector3<f64>)> {
        if let Some((attitude, turned)) = self.turning {
            return attitude.world_from_rate(&self.poses, turned, t);
        }
        let k = place(self.poses.times, t)?;
        let share = (t - self.poses.times[k]) / (self.poses.times[k + 1] - self.poses.times[k]).max(f64::MIN_POSITIVE);
        let (from, to) = (self.poses.attitudes[k], self.poses.attitudes[k + 1]);
        let between = from.try_slerp(&to, share, 1e-9).unwrap_or(from);
        Some((between, Vector3::zeros(), Vector3::zeros()))
    }

    /// The acceleration in world axes and its changes with the parameters, at the accelerometer's samples, by the clock of the poses.
    fn functions(&self, times: &[f64], measured: &[Vector3<f64>], state: &[f64; PARAMETERS]) -> Vec<Integrated> {
        let mut at = Vec::with_capacity(times.len());
        let mut values: Vec<Vec<Vector3<f64>>> = vec![Vec::new(); PARAMETERS + 1];
        for (k, (time, a)) in times.iter().zip(measured).enumerate() {
            let t = time - state[0];
            let Some((world, w, alpha)) = self.attitude(t) else { continue };
            let (from, to) = (k.saturating_sub(1), (k + 1).min(times.len() - 1));
            let slope = (measured[to] - measured[from]) / (times[to] - times[from]).max(f64::MIN_POSITIVE);
            let change = |p: usize| -> Vector3<f64> {
                let axis = |i: usize| Vector3::from_fn(|k, _| f64::from(u8::from(k == i)));
                match p {
                    0 => slope,
                    1..=3 => -axis(p - 1) * a[p - 1],
                    4..=6 => -axis(p - 4),
                    7..=9 => -alpha.cross(&axis(p - 7)),
                    _ => -w.cross(&w.cross(&axis(p - 10))),
                }
            };
            let mut corrected = *a;
            for (p, value) in state.iter().enumerate().skip(1) {
                corrected += change(p) * *value;
            }
            at.push(t);
            values[0].push(world * corrected);
            for p in 0..PARAMETERS {
                values[p + 1].push(world * change(p));
            }
        }
        values.into_iter().map(|values| Integrated::new(&at, values)).collect()
    }

    /// Rows of second differences over `span_s`.
    fn rows(&self, functions: &[Integrated], span_s: f64) -> (Rows, Vector3<f64>) {
        let times = self.poses.times;
        let pairs = spans(times, span_s);
        let mut next = vec![None; times.len()];
        for &(i, j) in &pairs {
            next[i] = Some(j);
        }
        let mut rows = Rows::new(PARAMETERS);
        let mut power = Vector3::zeros();
        // Axes along which positions are exact or padded measure nothing.
        let axes = measured(self.positions);
        let seen = Vector3::from_fn(|axis, _| if axes.contains(&axis) { 1.0 } else { 0.0 });
        // Both integrals of every function at each pose.
        let integrals: Vec<Option<Vec<Vector3<f64>>>> =
            times.iter().map(|t| functions.iter().map(|f| f.at(*t).map(|[.., twice]| twice)).collect()).collect();
        for &(i, j) in &pairs {
            let Some(k) = next[j] else { continue };
            let (Some(a), Some(b), Some(c)) = (&integrals[i], &integrals[j], &integrals[k]) else { continue };
            let (first, second) = (times[j] - times[i], times[k] - times[j]);
            let difference = |a: &Vector3<f64>, b: &Vector3<f64>, c: &Vector3<f64>| {
                (((c - b) / second - (b - a) / first) * (2.0 / (first + second))).component_mul(&seen)
            };
            let moved = difference(&self.positions[i], &self.positions[j], &self.positions[k]);
            let all: Vec<Vector3<f64>> = (0..=PARAMETERS).map(|f| difference(&a[f], &b[f], &c[f])).collect();
            let back = self.poses.attitudes[j].conjugate();
            for p in 0..3 {
                power[p] += all[2 + p].norm_squared();
            }
            let turned: Vec<Vector3<f64>> = all.iter().skip(1).map(|x| back * x).collect();
            rows.push(times[j], back * moved, back * (moved - all[0]), &turned);
        }
        let n = rows.len() as f64;
        (rows, power / n.max(1.0))
    }

    fn solved(
        &self,
        times: &[f64],
        measured: &[Vector3<f64>],
        state: &[f64; PARAMETERS],
        span_s: f64,
    ) -> Option<(Rows, Solution, Vector3<f64>)> {
        let (rows, power) = self.rows(&self.functions(times, measured, state), span_s);
        let priors = if self.turning.is_some() {
            PRIORS
        } else {
            core::array::from_fn(|p| if p < 7 { PRIORS[p] } else { 1e-9 })
        };
        let solution = rows.solve(&priors, (4.0 * span_s).max(1.0))?;
        Some((rows, solution, power))
    }

    fn fit(&self, times: &[f64], measured: &[Vector3<f64>], span_s: f64, start: f64) -> Option<Acceleration> {
        let mut state = [0.0; PARAMETERS];
        state[0] = start;
        let mut last = None;
        for _ in 0..ROUNDS {
            let (rows, solution, power) = self.solved(times, measured, &state, span_s)?;
            for (p, value) in state.iter_mut().enumerate() {
                let step = solution.step[p];
                *value += if p == 0 { step.clamp(-0.1, 0.1) } else { step };
            }
            last = Some((rows, solution, power));
        }
        let (rows, found, power) = last?;
        let here = rows.misfit_after(&found.step, &found.scale) / rows.len() as f64;
        let stands_out = found.explains
            && [-FAR_S, FAR_S].iter().all(|away| {
                let far = core::array::from_fn(|p| if p == 0 { state[0] + away } else { state[p] });
                // The age is held there: the step of the others only.
                self.solved(times, measured, &far, span_s).is_none_or(|(rows, mut solution, _)| {
                    solution.step[0] = 0.0;
                    let misfit = rows.misfit_after(&solution.step, &found.scale) / rows.len() as f64;
                    (misfit - here) * rows.len() as f64 > SEEN * found.widening.powi(2)
                })
            });
        let known = |p: usize, sigma: f64, value: f64| {
            (stands_out && sigma < KNOWN * PRIORS[p].min(1.0)).then_some(Found { value, sigma })
        };
        // Noise of the accelerometer in its own scale pulls it towards zero, by this at most.
        let noise = found.scale.max().powi(2);
        let scale = |i: usize| {
            let pulled = noise / power[i].max(f64::MIN_POSITIVE);
            known(1 + i, found.sigma[1 + i].hypot(pulled), state[1 + i])
        };
        Some(Acceleration {
            later: known(0, found.sigma[0], state[0]),
            bias: core::array::from_fn(|i| {
                (found.sigma[4 + i] < KNOWN).then_some(Found { value: state[4 + i], sigma: found.sigma[4 + i] })
            }),
            scale: core::array::from_fn(scale),
            // Held to zero where no rate tells of it.
            lever: core::array::from_fn(|i| self.turning.and_then(|_| known(7 + i, found.sigma[7 + i], state[7 + i]))),
            state,
        })
    }

    /// Of second differences over several spans, each number from where it is known best.
    pub(super) fn acceleration(&self, record: &[MotionSample], candidates: &[f64]) -> Option<Acceleration> {
        let (times, measured) = series(record, |row| row.acceleration_origin_body);
        if times.len() < 2 * PARAMETERS {
            return None;
        }
        let middle = *candidates.get(candidates.len() / 2)?;
        let mut starts: Vec<(f64, f64)> = Vec::new();
        let mut scale = None;
        for step in -REACH..=REACH {
            let mut state = [0.0; PARAMETERS];
            state[0] = f64::from(step) * STEP_S;
            let Some((rows, solution, _)) = self.solved(&times, &measured, &state, middle) else { continue };
            let scale = *scale.get_or_insert(solution.scale);
            starts.push((rows.misfit_after(&solution.step, &scale) / rows.len() as f64, state[0]));
        }
        let start = starts.iter().min_by(|a, b| a.0.total_cmp(&b.0))?.1;
        let fits: Vec<Acceleration> =
            candidates.iter().filter_map(|span| self.fit(&times, &measured, *span, start)).collect();
        let sigma = |found: &Option<Found>| found.map_or(f64::INFINITY, |f| f.sigma);
        let mut best = fits.iter().min_by(|a, b| sigma(&a.later).total_cmp(&sigma(&b.later)))?.clone();
        let better = |of: fn(&Acceleration) -> &Option<Found>| {
            fits.iter().map(of).min_by(|a, b| sigma(a).total_cmp(&sigma(b))).copied().flatten()
        };
        best.bias = [better(|a| &a.bias[0]), better(|a| &a.bias[1]), better(|a| &a.bias[2])];
        best.scale = [better(|a| &a.scale[0]), better(|a| &a.scale[1]), better(|a| &a.scale[2])];
        best.lever = [better(|a| &a.lever[0]), better(|a| &a.lever[1]), better(|a| &a.lever[2])];
        Some(best)
    }

    /// What positions and velocities are beyond the accelerations, integrated: both series by the clock of the poses.
    pub(super) fn beyond(&self, record: &[MotionSample], found: &Acceleration, velocity_later_s: f64) -> Beyond {
        let (times, measured) = series(record, |row| row.acceleration_origin_body);
        let functions = self.functions(&times, &measured, &found.state);
        let mut beyond = Beyond::default();
        for (t, p) in self.poses.times.iter().zip(self.positions) {
            if let Some([.., twice]) = functions[0].at(*t) {
                beyond.positions.0.push(*t);
                beyond.positions.1.push(p - twice);
            }
        }
        let (times, velocities) = series(record, |row| row.velocity_origin_world);
        for (t, v) in times.iter().zip(velocities) {
            if let Some([_, once, _]) = functions[0].at(t - velocity_later_s) {
                beyond.velocities.0.push(t - velocity_later_s);
                beyond.velocities.1.push(v - once);
            }
        }
        beyond
    }

    /// Age of the velocities less that of the poses.
    pub(super) fn velocity(&self, record: &[MotionSample], candidates: &[f64]) -> Option<Found> {
        let (times, velocities) = series(record, |row| row.velocity_origin_world);
        if times.len() < 20 {
            return None;
        }
        let integrated = Integrated::new(&times, velocities);
        let rows = |later: f64, span_s: f64| {
            // Offsets between position and integrated velocity drift: one constant for each axis.
            let mut rows = Rows::new(4);
            for (i, j) in spans(self.poses.times, span_s) {
                let (from, to) = (self.poses.times[i] + later, self.poses.times[j] + later);
                let (Some(a), Some(b)) = (integrated.at(from), integrated.at(to)) else { continue };
                let span = to - from;
                let axis = |k: usize| Vector3::from_fn(|i, _| if i == k { span } else { 0.0 });
                let left = self.positions[j] - self.positions[i] - (b[1] - a[1]);
                rows.push(from, self.positions[j] - self.positions[i], left, &[b[0] - a[0], axis(0), axis(1), axis(2)]);
            }
            rows
        };
        let priors = [1.0, 1.0, 1.0, 1.0];
        let best = candidates.iter().filter_map(|span_s| {
            let block_s = (2.0 * span_s).max(1.0);
            let mut later = 0.0;
            let mut found = None;
            for _ in 0..6 {
                let all = rows(later, *span_s);
                let solution = all.solve(&priors, block_s)?;
                later += solution.step[0].clamp(-0.2, 0.2);
                found = Some((all, solution));
            }
            let (all, solution) = found?;
            let here = all.misfit_after(&solution.step, &solution.scale);
            let far = [-FAR_S, FAR_S].iter().all(|away| {
                let all = rows(later + away, *span_s);
                let mut step = solution.step.clone();
                step[0] = 0.0;
                all.misfit_after(&step, &solution.scale) - here > SEEN * solution.widening.powi(2)
            });
            (far && solution.explains && solution.sigma[0] < KNOWN)
                .then_some(Found { value: later, sigma: solution.sigma[0] })
        });
        best.min_by(|a, b| a.sigma.total_cmp(&b.sigma))
    }
}

/// Times and values.
type Series = (Vec<f64>, Vec<Vector3<f64>>);

/// Positions and velocities less what was integrated.
#[derive(Default)]
pub(super) struct Beyond {
    pub(super) positions: Series,
    pub(super) velocities: Series,
}
