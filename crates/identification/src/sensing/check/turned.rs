//! The rate of a record, integrated: how the body has turned between two times.

use crate::lie::LieGroup;
use crate::motion::MotionSample;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Rates further apart than this do not say how the body turned in between, s.
const LONGEST_GAP_S: f64 = 0.5;

/// Times in seconds since the first row, and what was seen then.
pub(super) fn series<T>(record: &[MotionSample], of: impl Fn(&MotionSample) -> Option<T>) -> (Vec<f64>, Vec<T>) {
    let start = record.first().map_or(0, |row| row.time_ns);
    let seconds = |row: &MotionSample| row.time_ns.saturating_sub(start) as f64 * 1e-9;
    record.iter().filter_map(|row| of(row).map(|seen| (seconds(row), seen))).unzip()
}

/// The index of the last time not after `t`; `None` outside the series and within a gap.
pub(super) fn place(times: &[f64], t: f64) -> Option<usize> {
    let after = times.partition_point(|time| *time <= t);
    let (first, last) = (*times.first()?, *times.last()?);
    if t < first || t > last || times.len() < 2 {
        return None;
    }
    let k = after.saturating_sub(1).min(times.len() - 2);
    (times[k + 1] - times[k] <= LONGEST_GAP_S).then_some(k)
}

/// Where the axes of the rate stand at its samples, from where they stood at the first, with integrals on the way.
pub(super) struct Turned {
    times: Vec<f64>,
    rates: Vec<Vector3<f64>>,
    attitudes: Vec<UnitQuaternion<f64>>,
    /// Integral of the attitude matrix, and of it times the diagonal matrix of the rate.
    integrals: Vec<[Matrix3<f64>; 2]>,
    /// Number of gaps before each sample.
    gaps: Vec<usize>,
}

/// The state at one time.
pub(super) struct Turn {
    pub(super) attitude: UnitQuaternion<f64>,
    pub(super) rate: Vector3<f64>,
    pub(super) integrals: [Matrix3<f64>; 2],
    gaps: usize,
}

impl Turned {
    /// Of the rates of a record, each corrected; between samples they run straight. `None` for fewer than two.
    pub(super) fn new(record: &[MotionSample], corrected: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Option<Self> {
        let (times, rates) = series(record, |row| row.rate_body.as_ref().map(&corrected));
        if times.len() < 2 {
            return None;
        }
        let mut turned = Self {
            attitudes: vec![UnitQuaternion::identity()],
            integrals: vec![[Matrix3::zeros(); 2]],
            gaps: vec![0],
            times,
            rates,
        };
        for k in 0..turned.times.len() - 1 {
            let next = turned.after(k, turned.times[k + 1] - turned.times[k]);
            let gap = usize::from(turned.times[k + 1] - turned.times[k] > LONGEST_GAP_S);
            turned.attitudes.push(next.attitude);
            turned.integrals.push(next.integrals);
            turned.gaps.push(turned.gaps[k] + gap);
        }
        Some(turned)
    }

    /// So long after sample `k`, before the next.
    fn after(&self, k: usize, span_s: f64) -> Turn {
        let step = (self.times[k + 1] - self.times[k]).max(f64::MIN_POSITIVE);
        let rate = self.rates[k] + (self.rates[k + 1] - self.rates[k]) * (span_s / step);
        let by: UnitQuaternion<f64> = LieGroup::exp(&((self.rates[k] + rate) * (0.5 * span_s)));
        let half: UnitQuaternion<f64> = LieGroup::exp(&((self.rates[k] * 0.75 + rate * 0.25) * (0.5 * span_s)));
        let attitude = self.attitudes[k] * by;
        let middle = (self.attitudes[k] * half).to_rotation_matrix().into_inner() * span_s;
        let [whole, by_rate] = self.integrals[k];
        let mean = (self.rates[k] + rate) * 0.5;
        let integrals = [whole + middle, by_rate + middle * Matrix3::from_diagonal(&mean)];
        Turn { attitude, rate, integrals, gaps: self.gaps[k] }
    }

    /// At a time; `None` where no rate was measured.
    pub(super) fn at(&self, t: f64) -> Option<Turn> {
        place(&self.times, t).map(|k| self.after(k, t - self.times[k]))
    }

    /// Both ends of a span without a gap.
    pub(super) fn between(&self, from: f64, to: f64) -> Option<(Turn, Turn)> {
        let (start, end) = (self.at(from)?, self.at(to)?);
        (start.gaps == end.gaps).then_some((start, end))
    }

    /// Angular acceleration from the neighbours of a time.
    pub(super) fn acceleration(&self, t: f64) -> Option<Vector3<f64>> {
        let k = place(&self.times, t)?;
        let (from, to) = (k.saturating_sub(1), (k + 2).min(self.times.len() - 1));
        Some((self.rates[to] - self.rates[from]) / (self.times[to] - self.times[from]))
    }
}
