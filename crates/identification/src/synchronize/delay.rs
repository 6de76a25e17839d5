//! The delay between wrench and measured motion, below the sample time.

use super::sum_over_distances;
use crate::error::{Column, IdentificationError};
use crate::likelihood::identifiability::{Quantity, Verdict};
use crate::motion::MotionSample;
use crate::savitzky_golay::SavitzkyGolay;
use crate::wrench_timing::WrenchTiming;
use nalgebra::{DMatrix, SMatrix, SVector, Vector3};
use num_traits::AsPrimitive;

/// Two equally sampled signals, the second a linear response to the first some time before.
#[derive(Clone, Debug, PartialEq)]
pub struct Signals<const INPUTS: usize, const OUTPUTS: usize, const COVARIATES: usize> {
    /// Sample time of both, s.
    pub step_s: f64,
    /// What acts.
    pub input: Vec<SVector<f64, INPUTS>>,
    /// Time of the first input after the first output, s.
    pub input_offset_s: f64,
    /// What is seen of it.
    pub output: Vec<SVector<f64, OUTPUTS>>,
    /// What else the output depends on linearly, without delay.
    pub covariates: Vec<SVector<f64, COVARIATES>>,
    /// Noise of the output further apart than this many samples is independent.
    pub correlation_length: usize,
}

/// A delay and how well it is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Delay {
    /// The output describes what the input did this long before, s.
    pub delay_s: f64,
    /// Its standard deviation, s.
    pub sigma_s: f64,
    /// Share of what the outputs vary by, counted by their noise, that no input explains.
    pub left: f64,
    /// Whether the signals were enough to tell.
    pub verdict: Verdict,
}

/// Half the window in which motion is differentiated, s.
const DIFFERENTIATION_S: f64 = 0.2;
/// Order of the polynomial there.
const DIFFERENTIATION_ORDER: usize = 4;

impl Signals<6, 6, 6> {
    /// Wrench, the angular and linear acceleration in body axes that answers it, and the products of rates through which a
    /// turning body adds to both: for a rigid body the relation is exactly linear.
    ///
    /// Angular acceleration comes from rates, else from poses. Linear acceleration comes from velocities, else from poses; of a
    /// sampled wrench from the accelerations, where there are some (of a held one an acceleration answers in steps, which tell
    /// whole samples only). Differentiation is symmetric and delays nothing. Equal steps are needed: the longest run whose
    /// steps agree to one percent is used.
    ///
    /// # Frame
    /// Body axes, about the body origin. `gravity_world` in inertial axes.
    /// # Errors
    /// [`IdentificationError::TooFewSamples`] where no run is long enough; [`IdentificationError::MissingColumn`] where poses must
    /// stand in for rates, velocities or accelerations and are not all there.
    pub fn from_record(
        record: &[MotionSample],
        timing: WrenchTiming,
        gravity_world: &Vector3<f64>,
    ) -> Result<Self, IdentificationError> {
        let (run, step_s) = longest_equal_run(record);
        let half = whole(DIFFERENTIATION_S / step_s).max(DIFFERENTIATION_ORDER / 2 + 1);
        let needed = 2 * half + 2;
        if run.len() < needed || !step_s.is_finite() {
            return Err(IdentificationError::TooFewSamples { samples: run.len(), needed });
        }
        let filter = SavitzkyGolay::try_new(half, DIFFERENTIATION_ORDER)?;
        let inner = &run[half..run.len() - half];
        let column = |of: fn(&MotionSample) -> Option<Vector3<f64>>| run.iter().map(of).collect::<Option<Vec<_>>>();
        let derivative = |samples: Vec<Vector3<f64>>| {
            filter.smooth_vectors(&samples, step_s).into_iter().map(|[_, first, _]| first).collect::<Vec<_>>()
        };
        let missing = || IdentificationError::MissingColumn(Column::Pose);
        let pose = |sample: &MotionSample| sample.world_from_body.ok_or_else(missing);
        let (rates, velocities) = (column(|s| s.rate_body), column(|s| s.velocity_origin_world));
        let held = timing == WrenchTiming::Held;
        let measured: Option<Vec<_>> =
            inner.iter().map(|sample| sample.acceleration_origin_body.filter(|_| !held)).collect();
        let products =
            |w: &Vector3<f64>| SVector::from([w.x * w.x, w.y * w.y, w.z * w.z, w.x * w.y, w.x * w.z, w.y * w.z]);
        let smoothed = if rates.is_none() || (velocities.is_none() && measured.is_none()) {
            filter.smooth_poses(&run.iter().map(pose).collect::<Result<Vec<_>, _>>()?, step_s)
        } else {
            Vec::new()
        };
        let covariates = rates.as_ref().map_or_else(
            || smoothed.iter().map(|m| products(&m.rate_body)).collect(),
            |rates| rates[half..].iter().take(inner.len()).map(products).collect(),
        );
        let angular = rates.map_or_else(|| smoothed.iter().map(|m| m.rate_derivative_body).collect(), derivative);
        let in_body = |k: usize, world: &Vector3<f64>| {
            Ok(pose(&inner[k])?.rotation.inverse_transform_vector(&(world - gravity_world)))
        };
        let linear: Vec<Vector3<f64>> = if let Some(measured) = measured {
            measured
        } else {
            let seen = || smoothed.iter().map(|m| m.acceleration_origin_world).collect();
            let world: Vec<_> = velocities.map_or_else(seen, derivative);
            world.iter().enumerate().map(|(k, a)| in_body(k, a)).collect::<Result<_, IdentificationError>>()?
        };
        let stack = |a: &Vector3<f64>, b: &Vector3<f64>| SVector::from([a.x, a.y, a.z, b.x, b.y, b.z]);
        Ok(Self {
            step_s,
            input: inner.iter().filter_map(|s| s.wrench_body).map(|w| stack(&w.torque, &w.force)).collect(),
            // A held wrench acts on average half a step after its row.
            input_offset_s: if held { 0.5 * step_s } else { 0.0 },
            output: angular.iter().zip(&linear).map(|(a, b)| stack(a, b)).collect(),
            covariates,
            correlation_length: 2 * half + 6,
        })
    }
}

/// The next whole number of a size; zero below zero.
fn whole(size: f64) -> usize {
    size.max(0.0).ceil().as_()
}

/// The longest run of samples with a wrench whose steps agree with the median to one percent, and that step, s.
fn longest_equal_run(record: &[MotionSample]) -> (&[MotionSample], f64) {
    let step_ns = |pair: &[MotionSample]| pair[1].time_ns.saturating_sub(pair[0].time_ns);
    let mut steps: Vec<i64> = record.windows(2).map(step_ns).collect();
    steps.sort_unstable();
    let Some(&median) = steps.get(steps.len() / 2).filter(|&&step| step > 0) else { return (&[], f64::NAN) };
    let joined = |a: &MotionSample, b: &MotionSample| {
        let step = b.time_ns.saturating_sub(a.time_ns);
        100 * step.saturating_sub(median).saturating_abs() <= median
            && a.wrench_body.is_some()
            && b.wrench_body.is_some()
    };
    let run = record.chunk_by(joined).max_by_key(|run| run.len()).unwrap_or_default();
    (run, median as f64 * 1e-9)
}

/// Width of the smoothing kernel, s: half its support is three times that. Motion is slow against it.
const KERNEL_S: f64 = 0.06;
/// Half the support in widths.
const KERNEL_REACH: f64 = 3.0;

/// Quintic B-spline and its derivative.
///
/// Both signals pass through it, so their relation stays what it is; and the noise it lets through does not depend on where
/// between samples it is evaluated, as that of an interpolation does, which would draw the delay towards half samples.
fn kernel(x: f64) -> (f64, f64) {
    const BINOMIALS: [f64; 7] = [1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0];
    // Evaluated from the side of its nearer end: no cancellation.
    let (sign, from_end) = if x > 0.0 { (-1.0, KERNEL_REACH - x) } else { (1.0, KERNEL_REACH + x) };
    let (mut value, mut slope) = (0.0, 0.0);
    for (j, binomial) in BINOMIALS.iter().enumerate() {
        let u = from_end - j as f64;
        if u > 0.0 {
            let fourth = binomial * u * u * u * u;
            value += fourth * u / 120.0;
            slope += fourth / 24.0;
        }
    }
    (value, sign * slope)
}

/// A smoothed signal and its derivative (per sample) at `position`, in samples; `width` of the kernel in samples.
fn smoothed<const N: usize>(
    samples: &[SVector<f64, N>],
    position: f64,
    width: f64,
) -> (SVector<f64, N>, SVector<f64, N>) {
    let (first, last) = (position - KERNEL_REACH * width, position + KERNEL_REACH * width);
    let (mut value, mut slope) = (SVector::zeros(), SVector::zeros());
    for (k, sample) in samples.iter().enumerate().take(whole(last + 1.0)).skip(whole(first)) {
        let (w, d) = kernel((position - k as f64) / width);
        value += sample * (w / width);
        slope += sample * (d / (width * width));
    }
    (value, slope)
}

/// What fits best at one delay.
struct Fit<const OUTPUTS: usize> {
    /// Residual sums of squares of each output.
    misfit: SVector<f64, OUTPUTS>,
    /// Residuals, one row for each sample.
    residuals: Vec<SVector<f64, OUTPUTS>>,
    /// Change of the prediction with the delay (per sample) that no change of the gains imitates.
    sensitivity: Vec<SVector<f64, OUTPUTS>>,
    /// Share of the whole change that this is.
    own_share: f64,
    /// Orthonormal functions of time that the gains fit, one row each.
    fitted: DMatrix<f64>,
}

impl<const INPUTS: usize, const OUTPUTS: usize, const COVARIATES: usize> Signals<INPUTS, OUTPUTS, COVARIATES> {
    /// Width of the smoothing kernel: whole samples, for which it reproduces polynomials.
    fn width(&self) -> f64 {
        (KERNEL_S / self.step_s).round().max(1.0)
    }

    /// Half its support, samples.
    fn kernel_reach(&self) -> usize {
        whole(KERNEL_REACH * self.width())
    }

    /// Fits gains and constants at a delay in samples, over the outputs `first..last`.
    fn fit(&self, range: (usize, usize), delay: f64) -> Option<Fit<OUTPUTS>> {
        let offset = self.input_offset_s / self.step_s;
        let columns = INPUTS + COVARIATES + 1;
        let rows = range.1 - range.0;
        let mut regressor = DMatrix::zeros(rows, columns);
        let mut slopes = Vec::with_capacity(rows);
        let mut outputs = DMatrix::zeros(rows, OUTPUTS);
        for row in 0..rows {
            let k = (range.0 + row) as f64;
            let (value, slope) = smoothed(&self.input, k - offset - delay, self.width());
            for i in 0..INPUTS {
                regressor[(row, i)] = value[i];
            }
            let (value, _) = smoothed(&self.covariates, k, self.width());
            for i in 0..COVARIATES {
                regressor[(row, INPUTS + i)] = value[i];
            }
            regressor[(row, columns - 1)] = 1.0;
            slopes.push(slope);
            let (value, _) = smoothed(&self.output, k, self.width());
            for i in 0..OUTPUTS {
                outputs[(row, i)] = value[i];
            }
        }
        // Inputs in like units; an idle one keeps a gain of zero through the last term.
        let sizes: Vec<f64> = (0..columns).map(|c| regressor.column(c).norm().max(f64::MIN_POSITIVE.sqrt())).collect();
        for (c, size) in sizes.iter().enumerate() {
            regressor.column_mut(c).unscale_mut(*size);
        }
        let normal = regressor.tr_mul(&regressor) + DMatrix::identity(columns, columns) * 1e-12;
        let solver = normal.cholesky()?;
        let gains = solver.solve(&regressor.tr_mul(&outputs));
        let residuals = &outputs - &regressor * &gains;
        let change = DMatrix::from_fn(rows, OUTPUTS, |row, o| {
            -(0..INPUTS).map(|i| slopes[row][i] * gains[(i, o)] / sizes[i]).sum::<f64>()
        });
        let own = &change - &regressor * solver.solve(&regressor.tr_mul(&change));
        let fitted = solver.l().solve_lower_triangular(&regressor.transpose())?;
        let to_rows = |m: &DMatrix<f64>| (0..rows).map(|r| SVector::from_fn(|o, _| m[(r, o)])).collect::<Vec<_>>();
        let share = |o: usize| own.column(o).norm_squared() / change.column(o).norm_squared().max(f64::MIN_POSITIVE);
        Some(Fit {
            misfit: SVector::from_fn(|o, _| residuals.column(o).norm_squared()),
            own_share: (0..OUTPUTS).map(share).fold(0.0, f64::max),
            residuals: to_rows(&residuals),
            sensitivity: to_rows(&own),
            fitted,
        })
    }
}

/// Estimates the delay of the output behind the input, within `largest_s` on either side.
///
/// Every output is a combination of all inputs and covariates with unknown gains and a constant, so neither the mass nor the inertia nor a
/// scale need be known. The whole-sample shift that correlates best starts a Gauss-Newton iteration between samples. The
/// standard deviation allows for residuals correlated in time and between outputs.
///
/// # Errors
/// [`IdentificationError::TooFewSamples`] where the overlap is too short; [`IdentificationError::NotFinite`].
/// # Source
/// Thesis 6.5.2.
/// # Deviation
/// The print takes the whole-sample maximum of a correlation on one axis; between samples, over all axes, it is fifty times
/// finer (test `a_delay_is_found_to_a_fraction_of_a_sample`).
pub fn delay<const INPUTS: usize, const OUTPUTS: usize, const COVARIATES: usize>(
    signals: &Signals<INPUTS, OUTPUTS, COVARIATES>,
    largest_s: f64,
) -> Result<Delay, IdentificationError> {
    let samples = signals.input.len().min(signals.output.len()).min(signals.covariates.len());
    let most = whole((largest_s / signals.step_s).abs());
    let largest = most as f64;
    let reach = most + whole((signals.input_offset_s / signals.step_s).abs());
    let margin = reach + signals.kernel_reach() + 1;
    let needed = 2 * margin + 20 * (INPUTS + COVARIATES + 2);
    if samples < needed {
        return Err(IdentificationError::TooFewSamples { samples, needed });
    }
    let finite = |k: &usize| {
        let all = signals.input[*k].iter().chain(&signals.output[*k]).chain(&signals.covariates[*k]);
        all.into_iter().all(|x| x.is_finite())
    };
    if let Some(row) = (0..samples).find(|k| !finite(k)) {
        return Err(IdentificationError::NotFinite { row });
    }
    let range = (margin, samples - margin);
    let not_seen = |shift: f64| Delay {
        delay_s: shift * signals.step_s,
        sigma_s: f64::INFINITY,
        left: 1.0,
        verdict: Verdict::NotIdentifiable,
    };

    // Whole samples: the misfit summed over outputs, each in units of its own largest.
    let shifts: Vec<f64> = (0..=2 * most).map(|shift| shift as f64 - largest).collect();
    let misfits: Vec<SVector<f64, OUTPUTS>> = shifts
        .iter()
        .map(|&shift| signals.fit(range, shift).map_or_else(|| SVector::repeat(f64::INFINITY), |fit| fit.misfit))
        .collect();
    let worst = misfits.iter().fold(SVector::<f64, OUTPUTS>::zeros(), |worst, misfit| worst.sup(misfit));
    let total = |misfit: &SVector<f64, OUTPUTS>| {
        misfit
            .iter()
            .zip(&worst)
            .filter(|(_, w)| **w > 0.0)
            .map(|(m, w)| (m / w).max(f64::MIN_POSITIVE).ln())
            .sum::<f64>()
    };
    let Some(best) = (0..shifts.len()).min_by(|&a, &b| total(&misfits[a]).total_cmp(&total(&misfits[b]))) else {
        return Ok(not_seen(0.0));
    };
    let mut shift = shifts[best];

    // Between samples.
    let reach = signals.correlation_length + 2 * signals.kernel_reach();
    let Some(mut fit) = signals.fit(range, shift) else { return Ok(not_seen(shift)) };
    for _ in 0..MOST_STEPS {
        let step = gauss_newton(&fit, &noise_density(&fit.residuals, reach));
        shift += step.clamp(-1.0, 1.0);
        match signals.fit(range, shift) {
            Some(next) if shift.abs() <= largest => fit = next,
            _ => return Ok(not_seen(shift.clamp(-largest, largest))),
        }
        if step.abs() < CONVERGED {
            break;
        }
    }
    let density = noise_density(&fit.residuals, reach);
    let sigma_s = deviation(&fit, &density, reach) * signals.step_s;
    // The best shift must stand out from the ends of the range by more than the gains' freedom explains, at whatever frequency they are excited.
    let loudest = loudest(&fit.residuals, reach);
    let gain = |misfit: &SVector<f64, OUTPUTS>| {
        (0..OUTPUTS).filter(|&o| loudest[o] > 0.0).map(|o| (misfit[o] - fit.misfit[o]) / loudest[o]).sum::<f64>()
    };
    let chance = 10.0 + 5.0 * (2.0 * (INPUTS * OUTPUTS) as f64).sqrt();
    let seen = misfits.first().into_iter().chain(misfits.last()).all(|end| gain(end) > chance);
    let verdict = if fit.own_share < LEAST_OWN_SHARE {
        Verdict::NotSeparableFrom(vec![Quantity::Gains])
    } else if seen {
        Verdict::Identifiable
    } else {
        Verdict::NotIdentifiable
    };
    let loud = weights(&loudest);
    let left = fit.misfit.dot(&loud) / variation(&signals.output[range.0..range.1], &loud).max(f64::MIN_POSITIVE);
    Ok(Delay { delay_s: shift * signals.step_s, sigma_s, left, verdict })
}

/// Sum of the weighted squares of what outputs vary by.
fn variation<const N: usize>(output: &[SVector<f64, N>], weights: &SVector<f64, N>) -> f64 {
    let mean = output.iter().sum::<SVector<f64, N>>() / output.len().max(1) as f64;
    output.iter().map(|o| (o - mean).component_mul(&(o - mean)).dot(weights)).sum()
}

/// Most Gauss-Newton steps; three serve.
const MOST_STEPS: usize = 12;
/// A step below this many samples is the last.
const CONVERGED: f64 = 1e-6;
/// Below this share of its effect the delay looks like a change of gains: a single tone on every axis, for one.
const LEAST_OWN_SHARE: f64 = 1e-6;

/// Sum of the autocovariance over all distances, tapered (Bartlett): the noise power at low frequency, where motion is.
fn noise_density<const N: usize>(residuals: &[SVector<f64, N>], reach: usize) -> SVector<f64, N> {
    let n = residuals.len();
    let mut density = SVector::zeros();
    for lag in 0..=reach.min(n - 1) {
        let weight = if lag == 0 { 1.0 } else { 2.0 * (1.0 - lag as f64 / (reach + 1) as f64) };
        for (a, b) in residuals.iter().zip(&residuals[lag..]) {
            density += a.component_mul(b) * (weight / n as f64);
        }
    }
    density
}

/// Sum of the sizes of the autocovariance, tapered likewise: no frequency has more noise power.
fn loudest<const N: usize>(residuals: &[SVector<f64, N>], reach: usize) -> SVector<f64, N> {
    let n = residuals.len();
    let mut loudest = SVector::zeros();
    for lag in 0..=reach.min(n - 1) {
        let weight = if lag == 0 { 1.0 } else { 2.0 * (1.0 - lag as f64 / (reach + 1) as f64) };
        let mut sum = SVector::<f64, N>::zeros();
        for (a, b) in residuals.iter().zip(&residuals[lag..]) {
            sum += a.component_mul(b);
        }
        loudest += sum.abs() * (weight / n as f64);
    }
    loudest
}

/// Weights of the outputs: one over their noise.
fn weights<const N: usize>(density: &SVector<f64, N>) -> SVector<f64, N> {
    density.map(|d| if d > 0.0 { 1.0 / d } else { 0.0 })
}

fn curvature<const N: usize>(fit: &Fit<N>, weights: &SVector<f64, N>) -> f64 {
    fit.sensitivity.iter().map(|s| s.component_mul(weights).dot(s)).sum()
}

/// The step towards the least misfit, samples.
fn gauss_newton<const N: usize>(fit: &Fit<N>, density: &SVector<f64, N>) -> f64 {
    let weights = weights(density);
    let slope: f64 = fit.sensitivity.iter().zip(&fit.residuals).map(|(s, r)| s.component_mul(&weights).dot(r)).sum();
    let step = slope / curvature(fit, &weights);
    if step.is_finite() { step } else { 0.0 }
}

/// Standard deviation of the delay, samples.
fn deviation<const N: usize>(fit: &Fit<N>, density: &SVector<f64, N>, reach: usize) -> f64 {
    let weights = weights(density);
    let curvature = curvature(fit, &weights);
    let n = fit.residuals.len();
    // For each distance: the autocovariance of the residual against that of the weighted sensitivity, between all outputs; and
    // the share of it that the fit has taken away, as slow as it is: noise of the same frequencies is fitted with it.
    let (kept, lost): (Vec<f64>, Vec<f64>) = (0..=(2 * reach).min(n - 1))
        .map(|lag| {
            let (mut covariance, mut sensitivity) = (SMatrix::<f64, N, N>::zeros(), SMatrix::<f64, N, N>::zeros());
            let mut own = 0.0;
            for k in 0..n - lag {
                let (now, later) = (fit.sensitivity[k].component_mul(&weights), fit.sensitivity[k + lag]);
                covariance += fit.residuals[k] * fit.residuals[k + lag].transpose();
                sensitivity += now * later.component_mul(&weights).transpose();
                own += now.dot(&later);
            }
            let own = own / curvature;
            let gains = fit.fitted.columns(0, n - lag).dot(&fit.fitted.columns(lag, n - lag));
            (covariance.dot(&sensitivity) / n as f64, (gains + own / N as f64) * own / n as f64)
        })
        .unzip();
    let left = 1.0 - sum_over_distances(&lost, reach);
    // Less than a tenth left says that the record is too short for any number of it.
    if left < 0.1 { f64::INFINITY } else { (sum_over_distances(&kept, reach) / left).sqrt() / curvature }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Gaussian;

    struct Noise(Gaussian);
    impl Noise {
        fn vector(&mut self, sigma: f64) -> SVector<f64, 2> {
            SVector::from([self.0.normal(), self.0.normal()]) * sigma
        }
    }

    const STEP_S: f64 = 0.016;

    fn tones(t: f64) -> SVector<f64, 2> {
        SVector::from([
            (0.9 * t).sin() + 0.6 * (2.3 * t + 1.0).sin(),
            (1.3 * t + 0.4).sin() + 0.6 * (2.9 * t + 2.0).cos(),
        ])
    }

    /// Two inputs, two outputs with cross-talk and constants.
    fn signals(delay_s: f64, input_sigma: f64, output_sigma: f64, seed: u64) -> Signals<2, 2, 0> {
        let mut noise = Noise(Gaussian::from_seed(2 * seed + 1));
        let gains = nalgebra::Matrix2::new(0.2, 0.03, -0.05, 0.5);
        let times = (0..1875).map(|k| f64::from(k) * STEP_S);
        Signals {
            step_s: STEP_S,
            input: times.clone().map(|t| tones(t) + noise.vector(input_sigma)).collect(),
            input_offset_s: 0.0,
            output: times
                .map(|t| gains * tones(t - delay_s) + SVector::from([0.01, -0.3]) + noise.vector(output_sigma))
                .collect(),
            covariates: vec![SVector::zeros(); 1875],
            correlation_length: 2,
        }
    }

    #[test]
    fn the_kernel_is_a_spline_whose_noise_does_not_depend_on_the_place() {
        // Nodal values of the quintic B-spline: 66, 26, 1 over 120.
        for (x, expected) in [(0.0, 66.0), (1.0, 26.0), (-1.0, 26.0), (2.0, 1.0), (-2.0, 1.0), (3.0, 0.0), (-3.0, 0.0)]
        {
            assert!((kernel(x).0 - expected / 120.0).abs() < 1e-14, "{x}");
        }
        // Weights of the samples about a place: their sum, that of the slopes, the power of white noise they let through.
        let width = 4.0;
        let at = |x: f64| {
            (-13..=13)
                .map(|k| kernel((x - f64::from(k)) / width))
                .fold([0.0; 3], |[one, slope, power], (w, d)| [one + w / width, slope + d, power + w * w])
        };
        for i in 0..20 {
            let x = f64::from(i) / 20.0;
            let [one, slope, power] = at(x);
            assert!((one - 1.0).abs() < 1e-14 && slope.abs() < 1e-13);
            // That of a linear interpolation changes by a factor of two.
            assert!((power / at(0.0)[2] - 1.0).abs() < 1e-6, "{x} {power}");
            let quotient = (kernel(x + 1e-6).0 - kernel(x - 1e-6).0) / 2e-6;
            assert!((kernel(x).1 - quotient).abs() < 1e-9);
        }
    }

    #[test]
    fn a_delay_is_found_to_a_fraction_of_a_sample() {
        for delay_s in [0.0, 0.003, 0.008, 0.024, 0.16, -0.05] {
            let found = delay(&signals(delay_s, 0.0, 0.0, 1), 0.3).unwrap();
            assert!((found.delay_s - delay_s).abs() < 1e-8, "{delay_s} {found:?}");
            assert_eq!(found.verdict, Verdict::Identifiable);
        }
        // An input that belongs half a step later moves the answer by that.
        let mut shifted = signals(0.024, 0.0, 0.0, 1);
        shifted.input_offset_s = 0.5 * STEP_S;
        assert!((delay(&shifted, 0.3).unwrap().delay_s - (0.024 - 0.5 * STEP_S)).abs() < 1e-8);
    }

    #[test]
    fn sigma_is_honest_with_noise_on_both_sides() {
        let runs = 120_u32;
        for (input_sigma, output_sigma) in [(0.0, 0.1), (0.05, 0.01)] {
            let (mut mean, mut normalized, mut sigma) = (0.0, 0.0, 0.0);
            for seed in 0..runs {
                // A quarter of a sample: where an interpolation's own noise draws the delay most.
                let found = delay(&signals(0.004, input_sigma, output_sigma, u64::from(1000 + seed)), 0.1).unwrap();
                assert_eq!(found.verdict, Verdict::Identifiable);
                mean += (found.delay_s - 0.004) / f64::from(runs);
                normalized += ((found.delay_s - 0.004) / found.sigma_s).powi(2) / f64::from(runs);
                sigma += found.sigma_s / f64::from(runs);
            }
            // 99.9 % of the mean of as many squares of normal numbers; and no bias beyond what such a mean scatters.
            let band = crate::statistics::mean_square_band(1.0, runs as usize, 0.999);
            assert!(band.contains(normalized), "{input_sigma} {output_sigma}: {normalized} {band:?}");
            assert!(mean.abs() < 3.3 * sigma / f64::from(runs).sqrt(), "{mean:e} {sigma:e}");
        }
    }

    #[test]
    fn what_cannot_be_told_is_said() {
        // No relation at all.
        let unrelated = (0..40)
            .filter(|&seed| {
                let mut random = signals(0.0, 0.0, 0.0, 0);
                let mut noise = Noise(Gaussian::from_seed(2 * seed + 1));
                random.output.iter_mut().for_each(|y| *y = noise.vector(1.0));
                delay(&random, 0.3).unwrap().verdict == Verdict::Identifiable
            })
            .count();
        assert_eq!(unrelated, 0);
        // One tone in quadrature on two inputs: a turn of the gains is a delay.
        let mut circle = signals(0.0, 0.0, 0.0, 0);
        let tone = |k: usize| {
            let (s, c) = (1.1 * k as f64 * STEP_S).sin_cos();
            SVector::from([s, c])
        };
        circle.input = (0..1875).map(tone).collect();
        circle.output = circle.input.clone();
        assert!(matches!(delay(&circle, 0.3).unwrap().verdict, Verdict::NotSeparableFrom(_)));
        // Further away than was looked.
        assert_eq!(delay(&signals(0.5, 0.0, 0.01, 1), 0.1).unwrap().verdict, Verdict::NotIdentifiable);
        let mut short = signals(0.0, 0.0, 0.0, 0);
        short.input.truncate(50);
        assert!(matches!(delay(&short, 0.1), Err(IdentificationError::TooFewSamples { .. })));
    }
}
