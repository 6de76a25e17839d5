//! Noise levels: first guesses from high differences, refinement by restricted likelihood.

use super::elimination::Evidence;
use super::record::{Record, median};
use super::sample::Sample;
use super::segment::{ACCELERATION, ATTITUDE, MEASUREMENTS, POSITION, RATE, Tally, VELOCITY};
use crate::Noise;
use crate::lie::LieGroup;
use nalgebra::{Vector3, Vector6};

/// Standard deviation over median absolute deviation of a normal variable.
const NORMAL_PER_MEDIAN: f64 = 1.4826;
/// Noise below this fraction of the signal is not visible in differences.
const INVISIBLE: f64 = 1e-6;
/// First guess of noise of the wrench that cannot be seen, as a fraction of the wrench.
const GUESS: f64 = 1e-3;
/// Weight of the visible noise of the wrench against what the likelihood makes of it, in degrees of freedom: poses say
/// little about it, and nothing keeps a bare likelihood from zero.
const PRIOR_FREEDOM: f64 = 10.0;
/// Bounds on the change of a variance in one refinement.
const CHANGE: (f64, f64) = (0.05, 20.0);
/// A level that changes by less than this fraction has settled.
const SETTLED: f64 = 0.01;

/// Standard deviations of one sample and axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Levels {
    /// By measurement group; one for groups not measured.
    pub(super) measurements: [f64; MEASUREMENTS],
    /// Torque and force.
    pub(super) wrench: [f64; 2],
}

/// What differences say about the wrench, and how much it counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct WrenchPrior {
    level: [f64; 2],
    freedom: [f64; 2],
}

impl WrenchPrior {
    /// Noise that the logged wrenches show by themselves; infinite where they show none.
    pub(super) fn visible(&self) -> [f64; 2] {
        core::array::from_fn(|i| if self.freedom[i] > 0.0 { self.level[i] } else { f64::INFINITY })
    }
}

impl Levels {
    pub(super) fn of(noise: &Noise) -> Self {
        let or_one = |x: f64| if x > 0.0 { x } else { 1.0 };
        let mut measurements = [1.0; MEASUREMENTS];
        measurements[POSITION] = or_one(noise.position_m);
        measurements[ATTITUDE] = or_one(noise.attitude_rad);
        measurements[VELOCITY] = or_one(noise.velocity_m_s);
        measurements[RATE] = or_one(noise.rate_rad_s);
        measurements[ACCELERATION] = or_one(noise.acceleration_m_s2);
        Self { measurements, wrench: [or_one(noise.torque_n_m), or_one(noise.force_n)] }
    }

    /// In words of the public interface; zero for what was not measured.
    pub(super) fn noise(&self, groups: &[usize]) -> Noise {
        let level = |group: usize| if groups.contains(&group) { self.measurements[group] } else { 0.0 };
        Noise {
            torque_n_m: self.wrench[0],
            force_n: self.wrench[1],
            position_m: level(POSITION),
            attitude_rad: level(ATTITUDE),
            velocity_m_s: level(VELOCITY),
            rate_rad_s: level(RATE),
            acceleration_m_s2: level(ACCELERATION),
        }
    }

    /// From differences so high that no motion is left in them; valid while noise is white and the wrench smooth.
    pub(super) fn from_differences(record: &Record) -> (Self, WrenchPrior) {
        let samples = &record.samples;
        let posed: Vec<&Sample> = samples.iter().filter(|sample| sample.posed).collect();
        let positions: Vec<Vector3<f64>> = posed.iter().map(|s| s.position).collect();
        let turn = |pair: &[&Sample]| LieGroup::log(&(pair[0].world_from_body.conjugate() * pair[1].world_from_body));
        let turns: Vec<Vector3<f64>> = posed.windows(2).map(turn).collect();
        let column = |of: fn(&Sample) -> Option<Vector3<f64>>| samples.iter().filter_map(of).collect::<Vec<_>>();
        let mut measurements = [1.0; MEASUREMENTS];
        // Fourth differences of poses (the turns are first ones already): squares of the coefficients add up to 70.
        measurements[POSITION] = visible(&positions, 4, 70.0);
        measurements[ATTITUDE] = visible(&turns, 3, 70.0);
        for (group, of) in [
            (VELOCITY, (|s| s.velocity) as fn(&Sample) -> Option<Vector3<f64>>),
            (RATE, |s| s.rate),
            (ACCELERATION, |s| s.acceleration),
        ] {
            measurements[group] = visible(&column(of), 3, 20.0);
        }
        let (torques, forces): (Vec<_>, Vec<_>) = record.wrenches.iter().map(halves).unzip();
        let (mut level, mut freedom) = ([0.0; 2], [PRIOR_FREEDOM; 2]);
        let sizes = [size(&torques), size(&forces)];
        for (i, values) in [torques, forces].iter().enumerate() {
            level[i] = difference_level(values, 3, 20.0);
            if level[i] <= INVISIBLE * sizes[i] {
                freedom[i] = 0.0;
                // A wrench that is zero throughout is unknown on the scale of the other half.
                level[i] = GUESS * if sizes[i] > 0.0 { sizes[i] } else { [0.1, 10.0][i] * sizes[1 - i] };
                level[i] = level[i].max(f64::MIN_POSITIVE.sqrt());
            }
        }
        (Self { measurements, wrench: level }, WrenchPrior { level, freedom })
    }

    /// One step of restricted likelihood; gives the largest change of a level, as a fraction.
    pub(super) fn refine(&mut self, evidence: &Evidence, tally: &Tally, consistency: f64, prior: &WrenchPrior) -> f64 {
        let mut largest: f64 = 0.0;
        let mut scale = |level: &mut f64, squares: f64, freedom: f64| {
            let ratio = (squares / freedom).clamp(CHANGE.0, CHANGE.1);
            if ratio.is_finite() {
                *level *= ratio.sqrt();
                largest = largest.max((0.5 * ratio.ln()).abs());
            }
        };
        for group in (0..MEASUREMENTS).filter(|&group| tally.counted[group] > 0) {
            let counted = consistency * 3.0 * tally.counted[group] as f64;
            let freedom = (counted - evidence.absorbed[group]).max(0.5);
            scale(&mut self.measurements[group], evidence.squares[group], freedom);
        }
        for i in 0..2 {
            let (nu, seen) = (prior.freedom[i], prior.level[i] / self.wrench[i]);
            let freedom = (evidence.wrench_counted - evidence.wrench_absorbed[i]).max(0.5);
            scale(&mut self.wrench[i], evidence.wrench_squares[i] + nu * seen * seen, freedom + nu);
        }
        largest
    }

    /// The factor that makes the noise of the wrench as large as the wrench.
    pub(super) fn largest_doubt(&self, record: &Record) -> f64 {
        let (torques, forces): (Vec<_>, Vec<_>) = record.wrenches.iter().map(halves).unzip();
        (size(&torques) / self.wrench[0]).max(size(&forces) / self.wrench[1])
    }

    pub(super) fn with_doubt(&self, factor: f64) -> Self {
        Self { wrench: self.wrench.map(|level| level * factor), ..*self }
    }

    pub(super) fn settled(change: f64) -> bool {
        change < SETTLED
    }
}

/// Torque and force.
fn halves(wrench: &Vector6<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (wrench.fixed_rows::<3>(0).into_owned(), wrench.fixed_rows::<3>(3).into_owned())
}

fn size(values: &[Vector3<f64>]) -> f64 {
    (values.iter().map(|v| v.dot(v)).sum::<f64>() / (3 * values.len().max(1)) as f64).sqrt()
}

/// Level from differences, no lower than rounding.
fn visible(values: &[Vector3<f64>], order: usize, squares: f64) -> f64 {
    let level = difference_level(values, order, squares).max(1e-12 * size(values));
    if level > 0.0 { level } else { 1.0 }
}

/// Robust standard deviation of repeated differences over the root of the sum of their squared coefficients.
fn difference_level(values: &[Vector3<f64>], order: usize, squares: f64) -> f64 {
    let mut differences = values.to_vec();
    for _ in 0..order.min(differences.len().saturating_sub(1)) {
        differences = differences.windows(2).map(|pair| pair[1] - pair[0]).collect();
    }
    let mut away = Vec::with_capacity(3 * differences.len());
    for axis in 0..3 {
        let center = median(&mut differences.iter().map(|v| v[axis]).collect::<Vec<_>>());
        away.extend(differences.iter().map(|v| (v[axis] - center).abs()));
    }
    NORMAL_PER_MEDIAN * median(&mut away) / squares.sqrt()
}
