//! How far a motion goes, how fast, and what it asks of the actuators: at all times, not only at samples.

use super::attitude::AttitudeChart;
use super::motion::FourierMotion;
use crate::dynamics::InertialParameters;
use nalgebra::{Complex, SVector};

/// Length of the last intervals searched, as a share of the shortest harmonic's period: two to the power of minus this.
const SERIES_RESOLUTION: i32 = 21;
/// The same for wrenches, which cost more.
const WRENCH_RESOLUTION: i32 = 13;

/// Extremes of one channel over all times.
///
/// Outer bounds: never inside the truth, and outside by less than 1e-11 of the sum of the harmonics' amplitudes.
///
/// # Units
/// Those of the channel, and per second and per second squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelExtremes {
    /// Least value.
    pub least: f64,
    /// Largest value.
    pub largest: f64,
    /// Largest absolute rate.
    pub largest_rate: f64,
    /// Largest absolute second derivative.
    pub largest_acceleration: f64,
}

impl FourierMotion {
    /// Extremes of the channels, in the order of the columns of the coefficients.
    pub fn extremes(&self) -> Vec<ChannelExtremes> {
        let largest_size = |series: &Series| self.supremum(|t| series.at(t).abs(), series.bend(), SERIES_RESOLUTION);
        let extremes = |value: Series| {
            let rate = value.derivative();
            ChannelExtremes {
                least: -self.supremum(|t| -value.at(t), value.bend(), SERIES_RESOLUTION),
                largest: self.supremum(|t| value.at(t), value.bend(), SERIES_RESOLUTION),
                largest_rate: largest_size(&rate),
                largest_acceleration: largest_size(&rate.derivative()),
            }
        };
        self.channels().map(extremes).collect()
    }

    /// Largest absolute components `[torque; force]` over all times of the wrench that moves a body without gravity;
    /// `None` where the quaternion comes to zero.
    ///
    /// Outer bounds: never less than the truth, and more by at most what the wrench can bend within 2^-13 of the shortest
    /// harmonic's period, in practice less than 1e-4 of the largest torque or force.
    ///
    /// # Frame
    /// Body axes, torque about the body origin.
    /// # Units
    /// N m and N.
    /// # Source
    /// Thesis (4.1).
    pub fn wrench_extremes(&self, parameters: &InertialParameters<f64>) -> Option<SVector<f64, 6>> {
        let packed = parameters.to_vector();
        let [torque_bend, force_bend] = self.wrench_bends(parameters)?;
        Some(SVector::from_fn(|component, _| {
            let bend = if component < 3 { torque_bend } else { force_bend };
            let size = |time_s: f64| {
                let wrench = self.at(time_s).map(|instant| instant.regressor() * packed);
                wrench.map_or(f64::INFINITY, |wrench| wrench[component].abs())
            };
            self.supremum(size, bend, WRENCH_RESOLUTION)
        }))
    }

    /// Largest value of `normal . [torque; force]`, an outer bound as of [`wrench_extremes`](Self::wrench_extremes).
    pub(crate) fn largest_wrench_along(
        &self,
        normal: &SVector<f64, 6>,
        parameters: &InertialParameters<f64>,
    ) -> Option<f64> {
        let packed = parameters.to_vector();
        let [torque_bend, force_bend] = self.wrench_bends(parameters)?;
        let [torque, force] = [normal.fixed_rows::<3>(0).norm(), normal.fixed_rows::<3>(3).norm()];
        let along = |time_s: f64| {
            let wrench = self.at(time_s).map(|instant| instant.regressor() * packed);
            wrench.map_or(f64::INFINITY, |wrench| normal.dot(&wrench))
        };
        Some(self.supremum(along, torque * torque_bend + force * force_bend, WRENCH_RESOLUTION))
    }

    /// Bounds on the second derivatives by time of torque and of force.
    fn wrench_bends(&self, parameters: &InertialParameters<f64>) -> Option<[f64; 2]> {
        let channels: Vec<Series> = self.channels().collect();
        let (position, attitude) = channels.split_at(3);
        let [_, _, acceleration @ ..] = norm::<5>(position);
        let w = if let (AttitudeChart::EulerZyx, [roll, pitch, yaw]) = (self.chart(), attitude) {
            let [roll, pitch, yaw] = [roll, pitch, yaw].map(|angle| angle.derivative().bounds::<4>());
            // Body axes turn with roll, and the axis of yaw in them also with pitch.
            let yawing = product(&turning(&pitch), &yaw);
            let turned = product(&turning(&roll), &core::array::from_fn(|j| pitch[j] + yawing[j]));
            core::array::from_fn(|j| roll[j] + turned[j])
        } else {
            let q = norm::<4>(attitude);
            let rates: Vec<Series> = attitude.iter().map(Series::derivative).collect();
            let square = product(&q, &q);
            let minus_square = |t: f64| -attitude.iter().map(|component| component.at(t).powi(2)).sum::<f64>();
            let least = -self.supremum(minus_square, square[2], WRENCH_RESOLUTION);
            // Twice the vector part of conj(q) o dq, over the squared length.
            product(&product(&q, &norm(&rates)), &reciprocal(&square, least)?).map(|bound| 2.0 * bound)
        };
        let [w0, w1, w2, w3] = w;
        let [.., a] = product(&turning(&[w0, w1, w2]), &acceleration);
        let [.., centripetal] = product(&[w0, w1, w2], &[w0, w1, w2]);
        let (mass, first_moment) = (parameters.mass, parameters.first_moment.norm());
        let inertia = parameters.inertia_about_origin.norm();
        let turning = w3 + centripetal;
        Some([inertia * turning + first_moment * a, mass.abs() * a + first_moment * turning])
    }

    /// At least the supremum over all times of a function with the period of the motion, and at most what the function can
    /// bend within the last intervals more; `bend` bounds the absolute second derivative of the function, or of functions
    /// whose pointwise maximum it is.
    ///
    /// Branch and bound: on an interval `h` the function is at most `bend h^2 / 8` above its larger end.
    fn supremum(&self, function: impl Fn(f64) -> f64, bend: f64, resolution: i32) -> f64 {
        const FIRST: i32 = 3;
        let count = self.basis().harmonics() << FIRST;
        let mut length_s = self.basis().period_s() / count as f64;
        let gap = |length_s: f64| bend * length_s * length_s / 8.0;
        let last_gap = gap(length_s * 2.0_f64.powi(FIRST - resolution));

        let values: Vec<f64> = (0..count).map(|i| function(i as f64 * length_s)).collect();
        let mut best = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let next = values.iter().cycle().skip(1);
        let ends = values.iter().zip(next).enumerate().map(|(i, (&left, &right))| (i as f64 * length_s, left, right));
        let mut intervals: Vec<(f64, f64, f64)> = ends.collect();
        while !intervals.is_empty() {
            let threshold = best + last_gap - gap(length_s);
            length_s *= 0.5;
            let mut halves = Vec::with_capacity(intervals.len());
            for (start_s, left, right) in intervals {
                if left.max(right) > threshold {
                    let middle = function(start_s + length_s);
                    best = best.max(middle);
                    halves.extend([(start_s, left, middle), (start_s + length_s, middle, right)]);
                }
            }
            intervals = halves;
        }
        best + last_gap
    }

    fn channels(&self) -> impl Iterator<Item = Series> + '_ {
        let n = self.basis().harmonics();
        self.coefficients().column_iter().map(move |column| {
            let term = |k: usize| Complex::new(-column[n + k], -column[k]) / self.basis().frequency_rad_s(k);
            Series {
                frequency_rad_s: self.basis().frequency_rad_s(1),
                mean: column[0],
                terms: (1..=n).map(term).collect(),
            }
        })
    }
}

/// One channel: the mean and the real part of `sum_k terms[k-1] exp(i k w t)`.
#[derive(Clone, Debug)]
struct Series {
    frequency_rad_s: f64,
    mean: f64,
    terms: Vec<Complex<f64>>,
}

impl Series {
    fn at(&self, time_s: f64) -> f64 {
        let turn = Complex::cis(self.frequency_rad_s * time_s);
        self.mean + self.terms.iter().rev().fold(Complex::default(), |sum: Complex<f64>, term| (sum + term) * turn).re
    }

    fn derivative(&self) -> Self {
        let by_time =
            |(i, term): (usize, &Complex<f64>)| term * Complex::new(0.0, self.frequency_rad_s * (i + 1) as f64);
        Self { mean: 0.0, terms: self.terms.iter().enumerate().map(by_time).collect(), ..*self }
    }

    /// Bounds on the absolute value and its derivatives.
    fn bounds<const N: usize>(&self) -> [f64; N] {
        let mut series = self.clone();
        core::array::from_fn(|_| {
            let bound = series.mean.abs() + series.terms.iter().map(|term| term.norm()).sum::<f64>();
            series = series.derivative();
            bound
        })
    }

    fn bend(&self) -> f64 {
        let [.., bend] = self.bounds::<3>();
        bend
    }
}

/// Bounds on the length of a vector of channels and of its derivatives.
fn norm<const N: usize>(channels: &[Series]) -> [f64; N] {
    channels.iter().map(Series::bounds::<N>).fold([0.0; N], |a, b| core::array::from_fn(|j| f64::hypot(a[j], b[j])))
}

/// Sum over `j` from `first` to `n` of `binomial(n, j) a[j] b[n - j]`.
fn leibniz(n: usize, first: usize, a: &[f64], b: &[f64]) -> f64 {
    let mut binomial = 1.0;
    let mut sum = 0.0;
    for j in 0..=n {
        if j >= first {
            sum += binomial * a[j] * b[n - j];
        }
        binomial *= (n - j) as f64 / (j + 1) as f64;
    }
    sum
}

/// Bounds on a product and its derivatives from those of the factors.
fn product<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    core::array::from_fn(|n| leibniz(n, 0, a, b))
}

/// Bounds on one over a positive function that is nowhere less than `least`; `None` unless that is positive.
fn reciprocal<const N: usize>(function: &[f64; N], least: f64) -> Option<[f64; N]> {
    let mut bounds = [0.0; N];
    for n in 0..N {
        // The derivatives of function times reciprocal vanish.
        bounds[n] = if n == 0 { 1.0 } else { leibniz(n, 1, function, &bounds) } / least;
    }
    (least > 0.0).then_some(bounds)
}

/// Bounds on a rotation and its derivatives, as matrices, from those of its angular velocity.
fn turning<const N: usize>(rate: &[f64; N]) -> [f64; N] {
    let mut bounds = [0.0; N];
    for n in 0..N {
        // R' = R S(w).
        bounds[n] = if n == 0 { 1.0 } else { leibniz(n - 1, 0, rate, &bounds) };
    }
    bounds
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fourier::FourierBasis;
    use crate::noise::signed_unit;
    use core::f64::consts::TAU;
    use nalgebra::{DMatrix, Matrix3, Vector3};
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    fn random_motion(seed: u64, harmonics: usize, chart: AttitudeChart) -> FourierMotion {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut uniform = || signed_unit(&mut rng);
        let basis = FourierBasis::try_new(3.0 + uniform(), harmonics).unwrap();
        let mut coefficients =
            DMatrix::from_fn(basis.coefficients(), 3 + chart.channels(), |_, _| uniform() / harmonics as f64);
        if chart == AttitudeChart::Quaternion {
            coefficients[(0, 6)] = 2.0;
        }
        FourierMotion::try_new(basis, chart, coefficients).unwrap()
    }

    fn motions() -> impl Iterator<Item = FourierMotion> {
        (0..24).map(|seed| {
            let chart = if seed % 2 == 0 { AttitudeChart::EulerZyx } else { AttitudeChart::Quaternion };
            random_motion(seed, [1, 2, 3, 5, 12][usize::try_from(seed % 5).unwrap()], chart)
        })
    }

    fn body() -> InertialParameters<f64> {
        let inertia = Matrix3::new(0.5, 0.03, -0.02, 0.03, 0.4, 0.01, -0.02, 0.01, 0.6);
        InertialParameters::about_com(6.0, Vector3::new(0.05, -0.03, 0.08), inertia)
    }

    /// `sin t - sin(2 t) / 2`: extremes at a third of a turn, rate at half a turn, second derivative where
    /// `-sin t + 2 sin 2t` is extreme, at `cos t = (1 - sqrt 129) / 16`.
    #[test]
    fn known_extremes() {
        let basis = FourierBasis::try_new(TAU, 2).unwrap();
        let mut coefficients = DMatrix::zeros(5, 6);
        coefficients[(0, 1)] = 10.0;
        (coefficients[(1, 1)], coefficients[(2, 1)]) = (1.0, -1.0);
        coefficients[(0, 2)] = -3.0;
        let motion = FourierMotion::try_new(basis, AttitudeChart::EulerZyx, coefficients).unwrap();
        let cosine: f64 = (1.0 - 129.0_f64.sqrt()) / 16.0;
        let sine = (1.0 - cosine * cosine).sqrt();
        let peak = 0.75 * 3.0_f64.sqrt();
        let [still, moving, resting, ..] = motion.extremes()[..] else { panic!("six channels") };
        let expected = [10.0 - peak, 10.0 + peak, 2.0, (-sine + 4.0 * sine * cosine).abs()];
        let found = [moving.least, moving.largest, moving.largest_rate, moving.largest_acceleration];
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() < 2e-11, "{found} {expected}");
        }
        let constant =
            |value: f64| ChannelExtremes { least: value, largest: value, largest_rate: 0.0, largest_acceleration: 0.0 };
        assert_eq!((still, resting), (constant(0.0), constant(-3.0)));
    }

    #[test]
    fn no_time_on_a_fine_grid_is_outside_and_bounds_are_attained() {
        for motion in motions() {
            let count = 3000 * motion.basis().harmonics();
            let times: Vec<f64> = (0..count).map(|i| motion.basis().period_s() * i as f64 / count as f64).collect();
            let tables = motion.basis().table(&times).map(|table| table * motion.coefficients());
            for (channel, found) in motion.extremes().iter().enumerate() {
                let [value, rate, acceleration] = [0, 1, 2].map(|order: usize| tables[order].column(channel));
                let pairs = [
                    (-found.least, (-value).max()),
                    (found.largest, value.max()),
                    (found.largest_rate, rate.amax()),
                    (found.largest_acceleration, acceleration.amax()),
                ];
                for (found, sampled) in pairs {
                    // Between samples a harmonic rises by (pi / 3000)^2 / 2 of its amplitude.
                    let excess = (found - sampled) / (value.amax() + rate.amax() + acceleration.amax());
                    assert!((0.0..3e-6).contains(&excess), "{excess:e}");
                }
            }
        }
    }

    /// Of a body that only turns, so that no acceleration of the origin hides what turning bends.
    #[test]
    fn wrenches_bend_no_more_than_their_bounds() {
        let packed = body().to_vector();
        for motion in motions() {
            let mut coefficients = motion.coefficients().clone();
            coefficients.columns_mut(0, 3).fill(0.0);
            let motion = FourierMotion::try_new(*motion.basis(), motion.chart(), coefficients).unwrap();
            let bounds = motion.wrench_bends(&body()).unwrap();
            let (count, step_s) = (100 * motion.basis().harmonics(), 1e-4 * motion.basis().period_s());
            let wrench = |time_s: f64| motion.at(time_s).unwrap().regressor() * packed;
            let bend = |i: usize| {
                let time_s = motion.basis().period_s() * i as f64 / count as f64;
                (wrench(time_s + step_s) - wrench(time_s) * 2.0 + wrench(time_s - step_s)) / (step_s * step_s)
            };
            let found = (0..count).map(bend).fold([0.0_f64; 2], |most, bend| {
                [most[0].max(bend.fixed_rows::<3>(0).norm()), most[1].max(bend.fixed_rows::<3>(3).norm())]
            });
            assert!(found[0] < bounds[0] && found[1] < bounds[1], "{found:?} {bounds:?}");
        }
    }

    #[test]
    fn wrenches_stay_inside_their_bounds_and_reach_them() {
        let packed = body().to_vector();
        for motion in motions() {
            let found = motion.wrench_extremes(&body()).unwrap();
            let count = 2000 * motion.basis().harmonics();
            let step_s = motion.basis().period_s() / count as f64;
            let wrench = |i: usize| motion.at(i as f64 * step_s).unwrap().regressor() * packed;
            let sampled = (0..count).map(wrench).fold(SVector::<f64, 6>::zeros(), |most, w| most.sup(&w.abs()));
            for (part, found) in [(0, found.fixed_rows::<3>(0)), (3, found.fixed_rows::<3>(3))] {
                let sampled = sampled.fixed_rows::<3>(part);
                let excess = (found - sampled) / sampled.amax();
                assert!(excess.min() >= 0.0 && excess.max() < 1e-4, "{excess}");
            }
        }
    }

    /// What the search between samples stands on.
    #[test]
    fn wrenches_bend_no_more_than_bounded() {
        let packed = body().to_vector();
        for motion in motions() {
            let bends = motion.wrench_bends(&body()).unwrap();
            let count = 200 * motion.basis().harmonics();
            let step_s = motion.basis().period_s() / count as f64;
            let wrench = |time_s: f64| motion.at(time_s).unwrap().regressor() * packed;
            let mut steepest = [0.0_f64; 2];
            for time_s in (0..count).map(|i| i as f64 * step_s) {
                let h = 1e-3 * motion.basis().period_s() / motion.basis().harmonics() as f64;
                let bend = (wrench(time_s + h) + wrench(time_s - h) - wrench(time_s) * 2.0) / (h * h);
                for (steepest, part) in steepest.iter_mut().zip([0, 3]) {
                    *steepest = steepest.max(bend.fixed_rows::<3>(part).norm());
                }
            }
            for (steepest, bend) in steepest.into_iter().zip(bends) {
                assert!(steepest <= bend, "{steepest} {bend}");
            }
        }
    }

    #[test]
    fn a_quaternion_through_zero_is_refused() {
        let basis = FourierBasis::try_new(TAU, 1).unwrap();
        let mut coefficients = DMatrix::zeros(3, 7);
        coefficients[(1, 6)] = 1.0;
        let motion = FourierMotion::try_new(basis, AttitudeChart::Quaternion, coefficients).unwrap();
        assert_eq!(motion.wrench_extremes(&body()), None);
    }
}
