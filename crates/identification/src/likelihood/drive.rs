//! The wrench that acts over each row's step: the logged one after a first-order lag, at the times the rows describe.

use super::flow::Input;
use super::sample::Sample;
use nalgebra::Vector6;

/// Below this ratio of step and lag the response is summed as a series.
const SHORT_STEP: f64 = 1.0;
/// Times within this fraction of a step are the same.
const SAME_TIME: f64 = 1e-3;

/// What acts while a row's state becomes the next one's.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Drive {
    /// Mean and slope over the step.
    pub(crate) input: Input,
    /// Derivative of `input` by the lag.
    pub(crate) by_lag: Input,
    /// Value just after the row's time, and its difference quotient to the row before.
    pub(crate) start: Input,
    /// Derivative of `start` by the lag.
    pub(crate) start_by_lag: Input,
}

/// How the logged wrench becomes the one that acts.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub(crate) struct Passage {
    /// First-order lag, s.
    pub(crate) lag_s: Option<f64>,
    /// Rows describe times this much before their stamps, s.
    pub(crate) shift_s: f64,
    /// Whole steps by which accelerations are late.
    pub(crate) acceleration_rows: isize,
    /// Time after the first command in which the lag forgets what was before it, s.
    pub(crate) settling_s: f64,
}

/// Drives of all rows.
pub(crate) fn drives(samples: &[Sample], median_step_s: f64, passage: &Passage) -> Vec<Drive> {
    let Passage { lag_s, shift_s, acceleration_rows, .. } = *passage;
    let pieces = responses(samples, lag_s);
    let last = samples.len().saturating_sub(1);
    let felt = |row: usize| &pieces[row.saturating_add_signed(-acceleration_rows).min(last)].parts;
    let mut from = 0;
    let drive = |(row, sample): (usize, &Sample)| {
        let start_s = sample.time_s - shift_s;
        while from < last && samples[from + 1].time_s <= start_s + SAME_TIME * median_step_s {
            from += 1;
        }
        let [value, by_lag] = if shift_s == 0.0 {
            pieces[row].parts
        } else {
            over(samples, &pieces, from, start_s, sample.step_s, SAME_TIME * median_step_s).parts
        };
        let before = row.saturating_sub(1);
        let passed_s = (sample.time_s - samples[before].time_s).max(f64::MIN_POSITIVE);
        let start = |part: usize| {
            let now = felt(row)[part].start;
            input(&now, &((now - felt(before)[part].start) / passed_s))
        };
        // What wheels hold changes little within a shift; no lag is between it and the body.
        let stored = samples[if shift_s == 0.0 { row } else { from }].input.stored;
        Drive {
            input: Input { stored, ..input(&value.mean, &value.slope) },
            by_lag: input(&by_lag.mean, &by_lag.slope),
            start: Input { stored, ..start(0) },
            start_by_lag: start(1),
        }
    };
    samples.iter().enumerate().map(drive).collect()
}

fn input(value: &Vector6<f64>, slope: &Vector6<f64>) -> Input {
    let half = |v: &Vector6<f64>, first: usize| v.fixed_rows::<3>(first).into_owned();
    Input {
        torque: half(value, 0),
        force: half(value, 3),
        torque_slope: half(slope, 0),
        force_slope: half(slope, 3),
        ..Input::default()
    }
}

/// A wrench over one step as far as the motion notices: mean, first moment as a slope, value at the start.
#[derive(Clone, Copy, Default)]
struct Course {
    mean: Vector6<f64>,
    slope: Vector6<f64>,
    start: Vector6<f64>,
}

/// A course and its derivative by the lag.
#[derive(Clone, Copy, Default)]
struct Piece {
    parts: [Course; 2],
}

/// The logged wrench through a lag that starts settled at the first command.
///
/// Below zero the lag is a lead, the linear continuation of what a short lag does, so that an estimate may scatter about
/// zero.
fn responses(samples: &[Sample], lag_s: Option<f64>) -> Vec<Piece> {
    let six = |torque: &nalgebra::Vector3<f64>, force: &nalgebra::Vector3<f64>| {
        Vector6::new(torque.x, torque.y, torque.z, force.x, force.y, force.z)
    };
    let mut state: Option<(Vector6<f64>, Vector6<f64>)> = None;
    let mut pieces = Vec::with_capacity(samples.len());
    for sample in samples {
        let h = sample.step_s;
        let mean = six(&sample.input.torque, &sample.input.force);
        let slope = six(&sample.input.torque_slope, &sample.input.force_slope);
        let first = mean - slope * (0.5 * h);
        let Some(lag_s) = lag_s else {
            pieces.push(Piece { parts: [Course { mean, slope, start: first }, Course::default()] });
            continue;
        };
        let lag = lag_s.max(0.0);
        let (x, dx) = state.unwrap_or((first, Vector6::zeros()));
        if h <= 0.0 {
            let end = Course { mean: x, slope: Vector6::zeros(), start: x };
            let by_lag = Course { mean: dx, slope: Vector6::zeros(), start: dx };
            pieces.push(Piece { parts: [end, by_lag] });
            continue;
        }
        let Decay { end, mean: part, tilt, d_end, d_mean, d_tilt } = Decay::new(lag, h);
        // w(t) = first - slope lag + slope t + away exp(-t / lag)
        let away = x - first + slope * lag;
        let d_away = dx + slope;
        let mut value =
            Course { mean: mean - slope * lag + away * part, slope: slope + away * (12.0 / h * tilt), start: x };
        let by_lag = Course {
            mean: d_away * part + away * d_mean - slope,
            slope: (d_away * tilt + away * d_tilt) * (12.0 / h),
            start: dx,
        };
        state = Some((first - slope * lag + slope * h + away * end, d_away * end + away * d_end - slope));
        if lag_s < 0.0 {
            value.mean += by_lag.mean * lag_s;
            value.slope += by_lag.slope * lag_s;
            value.start += by_lag.start * lag_s;
        }
        pieces.push(Piece { parts: [value, by_lag] });
    }
    pieces
}

/// `exp(-t / lag)` over one step: value at the end, mean, first moment about the middle, and their derivatives by the lag.
///
/// # Shape
/// The moment is that over the unit interval, `int (y - 1/2) exp(-q y) dy` with `q = h / lag`.
struct Decay {
    end: f64,
    mean: f64,
    tilt: f64,
    d_end: f64,
    d_mean: f64,
    d_tilt: f64,
}

impl Decay {
    fn new(lag: f64, h: f64) -> Self {
        let q = h / lag;
        if !q.is_finite() {
            return Self { end: 0.0, mean: 0.0, tilt: 0.0, d_end: 0.0, d_mean: 1.0 / h, d_tilt: -0.5 / h };
        }
        let end = (-q).exp();
        let (gone, spent) = (-(-q).exp_m1(), 1.0 - end * (1.0 + q));
        let (tilt, d_tilt) = if q < SHORT_STEP {
            let (mut term, mut tilt, mut d_tilt) = (1.0, 0.0, 0.0);
            for n in 0..20 {
                let n = f64::from(n);
                tilt += term * n / (2.0 * (n + 1.0) * (n + 2.0));
                d_tilt += term * (1.0 / (n + 3.0) - 0.5 / (n + 2.0));
                term *= -q / (n + 1.0);
            }
            (tilt, d_tilt * q * q / h)
        } else {
            let tilt = spent / (q * q) - gone / (2.0 * q);
            (tilt, ((2.0 - end * (2.0 + 2.0 * q + q * q)) / q - 0.5 * spent) / h)
        };
        let d_end = if end > 0.0 { end * q * q / h } else { 0.0 };
        Self { end, mean: gone / q, tilt, d_end, d_mean: spent / h, d_tilt }
    }
}

/// The course over `[start_s, start_s + step_s]`, put together from the pieces from `from` on.
fn over(samples: &[Sample], pieces: &[Piece], from: usize, start_s: f64, step_s: f64, same_s: f64) -> Piece {
    let aligned = (samples[from].time_s - start_s).abs() <= same_s;
    if aligned && (samples[from].step_s - step_s).abs() <= same_s {
        return pieces[from];
    }
    let last = samples.len() - 1;
    let middle_s = start_s + 0.5 * step_s;
    let mut result = Piece::default();
    for (part, found) in result.parts.iter_mut().enumerate() {
        let value = |j: usize, at_s: f64| {
            let course = &pieces[j].parts[part];
            course.mean + course.slope * (at_s - samples[j].time_s - 0.5 * samples[j].step_s)
        };
        found.start = if aligned || start_s < samples[from].time_s {
            pieces[from].parts[part].start
        } else {
            value(from, start_s.min(samples[last].time_s))
        };
        if step_s <= 0.0 {
            found.mean = found.start;
            continue;
        }
        for j in from..=last {
            // The first and last pieces reach beyond the record.
            let begin = if j == 0 { start_s } else { samples[j].time_s.max(start_s) };
            let end = if j == last { start_s + step_s } else { samples[j + 1].time_s.min(start_s + step_s) };
            let length = end - begin;
            if length <= 0.0 {
                break;
            }
            let center = 0.5 * (begin + end);
            let (at, slope) = if center < samples[j].time_s || j == last {
                (pieces[j].parts[part].start, Vector6::zeros())
            } else {
                (value(j, center), pieces[j].parts[part].slope)
            };
            found.mean += at * (length / step_s);
            let moment = at * ((center - middle_s) * length) + slope * (length.powi(3) / 12.0);
            found.slope += moment * (12.0 / step_s.powi(3));
        }
    }
    result
}
