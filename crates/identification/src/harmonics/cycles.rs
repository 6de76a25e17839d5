//! From a record of several cycles to one averaged period.

use super::fit::Circle;
use super::periodic_record::PeriodicRecord;
use super::settings::HarmonicSettings;
use crate::error::{Column, IdentificationError};
use crate::fourier::AttitudeChart;
use crate::motion::MotionSample;
use crate::{Noise, WrenchTiming};
use nalgebra::{DMatrix, SVector, Vector4};
use num_traits::AsPrimitive;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// Largest relative difference between steps.
const UNEQUAL: f64 = 0.01;
/// Largest drift between period and samples over all cycles, in steps: what clocks that pass for equal steps can add up to.
const DRIFT: f64 = 0.05;
/// Cycles without which there is no scatter.
const FEWEST_CYCLES: usize = 2;
/// Harmonics beyond those of the reference at which cycles are compared.
const BAND_BEYOND: usize = 7;
/// Chance that a cycle like the others passes for a transient, or white noise for leakage.
const FALSE_ALARM: f64 = 1e-4;
/// Differences below this share of a channel's size are rounding.
const ROUNDING: f64 = 1e-9;

/// One period averaged over cycles, and what the cycles say about each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Cycles {
    /// The averaged period.
    pub record: PeriodicRecord,
    /// Cycles averaged.
    pub used: usize,
    /// Leading cycles left out: those that differ from the later ones, or as many as were asked for.
    pub dropped: usize,
    /// Whether even the first of the last three cycles differs from the last two, so that the transient may go on.
    pub transient_remains: bool,
    /// Samples after the last whole cycle, left out.
    pub remainder: usize,
    /// Noise of one sample, found from the scatter between cycles, or given.
    pub noise: Noise,
    /// Largest ratio, over poses and wrench components, of the scatter between cycles at the harmonics to that elsewhere, where
    /// chance does not explain it: cycles differ by more than white noise (a motion that is not quite periodic, a wandering
    /// localisation).
    pub leakage: Option<f64>,
}

/// Averages the cycles of a record.
///
/// Attitudes become coordinates of the chart, continuous from sample to sample, in the frame of `world_from_start`. Leading
/// cycles are dropped while one differs from the mean of the later ones at low harmonics by more than they do among themselves
/// (an F test, one in ten thousand false alarms); two are always kept. Where cycles differ at the harmonics by more than white
/// noise does, the standard deviations are those at the harmonics, which is where the estimate feels them.
///
/// # Errors
/// [`IdentificationError::UnequalSteps`], [`IdentificationError::PeriodNotWhole`], [`IdentificationError::TooFewCycles`],
/// [`IdentificationError::MissingColumn`], [`IdentificationError::WrenchMissing`] and [`IdentificationError::WrenchBeside`],
/// [`IdentificationError::NotPeriodic`],
/// [`IdentificationError::InvalidPeriod`], [`IdentificationError::InvalidStart`],
/// [`IdentificationError::TimesNotIncreasing`], [`IdentificationError::NotFinite`]; [`IdentificationError::NotPositive`] for
/// noise that was given.
/// # Source
/// Thesis 4.3, noise filtering; there the first cycle is dropped unseen.
pub fn average_cycles(samples: &[MotionSample], settings: &HarmonicSettings) -> Result<Cycles, IdentificationError> {
    let Span { first, period_samples, cycles, remainder } = Span::of(samples, settings)?;
    let forced = settings.dropped_cycles;
    let kept = cycles.saturating_sub(forced.unwrap_or(0));
    if kept < FEWEST_CYCLES {
        let whole = (samples.len() - first) as f64 / period_samples as f64;
        let dropped = forced.unwrap_or(0);
        let needed = dropped.saturating_add(FEWEST_CYCLES).saturating_mul(period_samples);
        return Err(IdentificationError::TooFewCycles {
            cycles: whole,
            dropped,
            samples: samples.len() - first,
            needed,
        });
    }
    let rows = &samples[first..first + cycles * period_samples];
    let series = Series::of(rows, period_samples, settings)?;
    let harmonics = (settings.reference_harmonics + BAND_BEYOND).min((period_samples - 1) / 4);
    let bands: Vec<Band> = series.columns.iter().map(|column| Band::of(column, period_samples, harmonics)).collect();
    let differs = |cycle: usize| {
        let chance = FALSE_ALARM / bands.len() as f64;
        bands.iter().any(|band| {
            band.difference_ratio(cycle) > exceeded_by_chance(band.coefficients, cycles - cycle - 2, chance)
        })
    };
    let detected = (0..cycles - FEWEST_CYCLES).take_while(|&cycle| differs(cycle)).count();
    let dropped = forced.unwrap_or(detected);
    let used = cycles - dropped;
    let (mut leakage, mut sample_std) = (None::<f64>, Vec::new());
    for (column, band) in series.columns.iter().zip(&bands) {
        let scatter = Scatter::of(&column[dropped * period_samples..], band, dropped, period_samples);
        let ratio = scatter.leakage(used, period_samples, band.coefficients, FALSE_ALARM / bands.len() as f64);
        leakage = leakage.into_iter().chain(ratio).reduce(f64::max);
        let variance = if ratio.is_some() { scatter.at_harmonics } else { scatter.total };
        sample_std.push(variance.max(band.rounding).sqrt());
    }
    let pose_channels = series.columns.len() - 6;
    if settings.chart == AttitudeChart::Quaternion {
        // Three turns move four components: each by itself would count its part of them again in the likelihood's residuals.
        let turning = &mut sample_std[3..pose_channels];
        turning.fill(rms_by_axis(turning));
    }
    let noise = match settings.noise {
        Some(noise) => {
            let given = [noise.position_m, noise.attitude_rad, noise.torque_n_m, noise.force_n];
            if let Some(index) = given.iter().position(|std| !(std.is_finite() && *std > 0.0)) {
                return Err(IdentificationError::NotPositive { index, value: given[index] });
            }
            sample_std = stated(&noise, settings.chart);
            noise
        }
        None => found(&sample_std, settings.chart),
    };
    let averaged_std: Vec<f64> = sample_std.iter().map(|std| std / (used as f64).sqrt()).collect();
    let average = |column: &Vec<f64>, i: usize| -> f64 {
        column.iter().skip(dropped * period_samples + i).step_by(period_samples).sum::<f64>() / used as f64
    };
    let matrix = |columns: &[Vec<f64>]| DMatrix::from_fn(period_samples, columns.len(), |i, j| average(&columns[j], i));
    let step_s = settings.period_s / period_samples as f64;
    let record = PeriodicRecord {
        period_s: settings.period_s,
        chart: settings.chart,
        channels: matrix(&series.columns[..pose_channels]),
        wrenches: matrix(&series.columns[pose_channels..]),
        gravity: settings.world_from_start.rotation.inverse_transform_vector(&settings.gravity_world),
        wrench_offset_s: match settings.wrench_timing {
            WrenchTiming::Held => 0.5 * step_s,
            WrenchTiming::Sampled => 0.0,
        },
        channel_std: averaged_std[..pose_channels].to_vec(),
        wrench_std: SVector::from_column_slice(&averaged_std[pose_channels..]),
    };
    let transient_remains = forced.is_none() && cycles > FEWEST_CYCLES && detected == cycles - FEWEST_CYCLES;
    Ok(Cycles { record, used, dropped, transient_remains, remainder, noise, leakage })
}

/// Which samples the cycles are.
struct Span {
    first: usize,
    period_samples: usize,
    cycles: usize,
    remainder: usize,
}

impl Span {
    fn of(samples: &[MotionSample], settings: &HarmonicSettings) -> Result<Self, IdentificationError> {
        let period_s = settings.period_s;
        if !(period_s.is_finite() && period_s > 0.0) {
            return Err(IdentificationError::InvalidPeriod { period_s });
        }
        let seconds = |from: &MotionSample, to: &MotionSample| (to.time_ns - from.time_ns) as f64 * 1e-9;
        let mut steps_s: Vec<f64> = samples.windows(2).map(|pair| seconds(&pair[0], &pair[1])).collect();
        if let Some(before) = steps_s.iter().position(|step_s| *step_s <= 0.0) {
            return Err(IdentificationError::TimesNotIncreasing { index: before + 1 });
        }
        if samples.len() < 3 {
            return Err(IdentificationError::TooFewSamples { samples: samples.len(), needed: 3 });
        }
        let middle = steps_s.len() / 2;
        let typical_s = *steps_s.select_nth_unstable_by(middle, f64::total_cmp).1;
        let start_s = settings.start_s;
        let first = samples.iter().position(|row| seconds(&samples[0], row) > start_s - 0.5 * typical_s);
        let Some(first) = first.filter(|_| start_s >= 0.0) else {
            return Err(IdentificationError::InvalidStart { start_s });
        };
        let rows = &samples[first..];
        let unequal = |pair: &[MotionSample]| (seconds(&pair[0], &pair[1]) - typical_s).abs() > UNEQUAL * typical_s;
        if let Some(before) = rows.windows(2).position(unequal) {
            let index = first + before + 1;
            let step_s = seconds(&samples[index - 1], &samples[index]);
            return Err(IdentificationError::UnequalSteps { index, step_s, typical_s });
        }
        let step_s = seconds(&rows[0], &rows[rows.len() - 1]) / (rows.len() - 1).max(1) as f64;
        let whole = rows.len() as f64 * step_s / period_s;
        if rows.len() < 3 || whole < 1.0 {
            let needed = FEWEST_CYCLES.saturating_mul((period_s / typical_s).round().as_());
            return Err(IdentificationError::TooFewCycles { cycles: whole, dropped: 0, samples: rows.len(), needed });
        }
        let period_samples = (period_s / step_s).round().max(1.0);
        if (period_samples * step_s - period_s).abs() * whole.floor() > DRIFT * step_s {
            return Err(IdentificationError::PeriodNotWhole {
                period_s,
                step_s,
                nearest_period_s: period_samples * step_s,
                nearest_step_s: period_s / period_samples,
            });
        }
        let period_samples: usize = period_samples.as_();
        Ok(Self { first, period_samples, cycles: rows.len() / period_samples, remainder: rows.len() % period_samples })
    }
}

/// Coordinates of the poses, then components of the wrenches, one column each.
struct Series {
    columns: Vec<Vec<f64>>,
}

impl Series {
    fn of(
        rows: &[MotionSample],
        period_samples: usize,
        settings: &HarmonicSettings,
    ) -> Result<Self, IdentificationError> {
        if rows.iter().all(|row| row.wrench_body.is_none()) {
            return Err(IdentificationError::MissingColumn(Column::Wrench));
        }
        if rows.iter().any(MotionSample::has_more_than_logged) {
            return Err(IdentificationError::WrenchBeside);
        }
        let chart = settings.chart;
        let coordinates = chart.channels();
        let mut columns = vec![Vec::with_capacity(rows.len()); 3 + coordinates + 6];
        let start_from_world = settings.world_from_start.inverse();
        let mut attitude = match chart {
            AttitudeChart::EulerZyx => Vector4::zeros(),
            AttitudeChart::Quaternion => Vector4::w(),
        };
        for (index, row) in rows.iter().enumerate() {
            let pose =
                start_from_world * row.world_from_body.ok_or(IdentificationError::MissingColumn(Column::Pose))?;
            attitude = chart.coordinates(&pose.rotation, &attitude);
            let wrench = row.wrench_body.ok_or(IdentificationError::WrenchMissing { index })?.to_vector();
            let position = pose.translation.vector;
            let values = position.iter().chain(attitude.iter().take(coordinates)).chain(wrench.iter());
            for (column, value) in columns.iter_mut().zip(values) {
                if !value.is_finite() {
                    return Err(IdentificationError::NotFinite { row: index });
                }
                column.push(*value);
            }
        }
        // Noise never changes the mean of a cycle by half a turn; turning on does.
        let half_turn = match chart {
            AttitudeChart::EulerZyx => core::f64::consts::PI,
            AttitudeChart::Quaternion => 1.0,
        };
        for coordinate in 0..coordinates {
            let column = &columns[3 + coordinate];
            let change = (0..period_samples).map(|i| column[period_samples + i] - column[i]).sum::<f64>();
            let change = change / period_samples as f64;
            if change.abs() > half_turn {
                return Err(IdentificationError::NotPeriodic { coordinate, change });
            }
        }
        Ok(Self { columns })
    }
}

/// One channel at low harmonics: the coefficients of each cycle, scaled so that white noise has in each the variance it has in
/// a sample.
struct Band {
    coefficients: usize,
    cycles: Vec<Vec<f64>>,
    /// Variance that is rounding.
    rounding: f64,
}

impl Band {
    fn of(column: &[f64], period_samples: usize, harmonics: usize) -> Self {
        let circle = Circle::new(period_samples);
        let (whole, half) = ((period_samples as f64).sqrt(), (0.5 * period_samples as f64).sqrt());
        let of_cycle = |cycle: &[f64]| {
            let mut coefficients = vec![whole * circle.amplitudes(cycle, 0).0];
            for harmonic in 1..=harmonics {
                let (cosine, sine) = circle.amplitudes(cycle, harmonic);
                coefficients.extend([half * cosine, half * sine]);
            }
            coefficients
        };
        let mean_square = column.iter().map(|value| value * value).sum::<f64>() / column.len() as f64;
        let rounding = (ROUNDING * ROUNDING * mean_square).max(f64::MIN_POSITIVE.sqrt());
        Self {
            coefficients: 2 * harmonics + 1,
            cycles: column.chunks_exact(period_samples).map(of_cycle).collect(),
            rounding,
        }
    }

    /// Mean coefficients of the cycles from `first` on, and the variance of one about them.
    fn mean_and_variance(&self, first: usize) -> (Vec<f64>, f64) {
        let cycles = &self.cycles[first..];
        let count = cycles.len() as f64;
        let mean: Vec<f64> =
            (0..self.coefficients).map(|i| cycles.iter().map(|cycle| cycle[i]).sum::<f64>() / count).collect();
        let squares: f64 =
            cycles.iter().map(|cycle| cycle.iter().zip(&mean).map(|(x, m)| (x - m).powi(2)).sum::<f64>()).sum();
        (mean, squares / ((count - 1.0) * self.coefficients as f64))
    }

    /// Variance of a cycle about the mean of all later ones by the variance among these; an F variable where all are alike.
    fn difference_ratio(&self, cycle: usize) -> f64 {
        let (mean, variance) = self.mean_and_variance(cycle + 1);
        let later = (self.cycles.len() - cycle - 1) as f64;
        let squares: f64 = self.cycles[cycle].iter().zip(&mean).map(|(x, m)| (x - m).powi(2)).sum();
        squares / (self.coefficients as f64 * (1.0 + 1.0 / later) * variance.max(self.rounding))
    }
}

/// Variances of one sample between the cycles averaged.
struct Scatter {
    total: f64,
    at_harmonics: f64,
    elsewhere: f64,
    rounding: f64,
}

impl Scatter {
    fn of(column: &[f64], band: &Band, dropped: usize, period_samples: usize) -> Self {
        let cycles = (column.len() / period_samples) as f64;
        let mut squares = 0.0;
        for i in 0..period_samples {
            let values = || column.iter().skip(i).step_by(period_samples);
            let mean = values().sum::<f64>() / cycles;
            squares += values().map(|value| (value - mean).powi(2)).sum::<f64>();
        }
        let at_harmonics = band.mean_and_variance(dropped).1;
        let (samples, low) = (period_samples as f64, band.coefficients as f64);
        let total = squares / (cycles - 1.0);
        Self {
            total: total / samples,
            at_harmonics,
            elsewhere: ((total - at_harmonics * low) / (samples - low)).max(0.0),
            rounding: band.rounding,
        }
    }

    /// Ratio of the standard deviation at the harmonics to that elsewhere, where chance does not explain it.
    fn leakage(&self, cycles: usize, period_samples: usize, coefficients: usize, chance: f64) -> Option<f64> {
        let (low, high) = ((cycles - 1) * coefficients, (cycles - 1) * (period_samples - coefficients));
        let ratio = self.at_harmonics / self.elsewhere.max(self.rounding);
        let limit =
            FisherSnedecor::new(low as f64, high as f64).map_or(f64::INFINITY, |law| law.inverse_cdf(1.0 - chance));
        (self.at_harmonics > self.rounding && ratio > limit).then(|| ratio.sqrt())
    }
}

/// The ratio of the mean square of `coefficients` numbers to that of `others` times as many which chance exceeds this often.
fn exceeded_by_chance(coefficients: usize, others: usize, chance: f64) -> f64 {
    FisherSnedecor::new(coefficients as f64, (coefficients * others) as f64)
        .map_or(f64::INFINITY, |law| law.inverse_cdf(1.0 - chance))
}

/// Turn of the body per change of a coordinate.
fn turn_by_coordinate(chart: AttitudeChart) -> f64 {
    match chart {
        AttitudeChart::EulerZyx => 1.0,
        AttitudeChart::Quaternion => 2.0,
    }
}

/// Noise of each channel, and of each component of the wrench.
fn stated(noise: &Noise, chart: AttitudeChart) -> Vec<f64> {
    let attitude = vec![noise.attitude_rad / turn_by_coordinate(chart); chart.channels()];
    let mut std = vec![noise.position_m; 3];
    std.extend(attitude);
    std.extend([noise.torque_n_m; 3].into_iter().chain([noise.force_n; 3]));
    std
}

/// Root mean square over the three axes behind three components, or four of a quaternion.
fn rms_by_axis(std: &[f64]) -> f64 {
    (std.iter().map(|std| std * std).sum::<f64>() / 3.0).sqrt()
}

/// Noise by axis.
fn found(std: &[f64], chart: AttitudeChart) -> Noise {
    let wrench = 3 + chart.channels();
    Noise {
        position_m: rms_by_axis(&std[..3]),
        attitude_rad: turn_by_coordinate(chart) * rms_by_axis(&std[3..6]),
        torque_n_m: rms_by_axis(&std[wrench..wrench + 3]),
        force_n: rms_by_axis(&std[wrench + 3..]),
        ..Noise::default()
    }
}
