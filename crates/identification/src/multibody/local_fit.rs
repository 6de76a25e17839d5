//! Signals and their derivatives by local polynomials at the times at which they were logged.

use crate::error::IdentificationError;
use crate::savitzky_golay::polynomial_weights;
use core::ops::Range;

/// Order of the polynomials: first and second derivatives are off in fourth order of the window.
const ORDER: usize = 4;
/// Half windows to choose from; the shortest still fits the order that shows what `ORDER` leaves out.
const HALF_WINDOWS: [usize; 15] = [4, 5, 6, 7, 8, 10, 12, 14, 17, 20, 24, 28, 34, 40, 48];
/// Windows that the choice looks at.
const LOOKED_AT: usize = 2000;
/// A step so many times the median one is a gap: no window reaches across.
const GAP: f64 = 2.5;

/// A moving window over logged times.
pub(super) struct LocalFit<'a> {
    times_s: &'a [f64],
    step_s: f64,
    stretches: Vec<Range<usize>>,
    half: usize,
}

impl<'a> LocalFit<'a> {
    /// The window in which the parameters suffer least from this derivative of the signals.
    ///
    /// What the window flattens is the same at every sample and goes right into the parameters; noise that passes is averaged, and
    /// its square draws them to zero. What is flattened is the difference to polynomials of higher order, seen where it is
    /// larger than noise and continued with the fourth power of the window to where it is not.
    ///
    /// # Errors
    /// [`IdentificationError::NotFinite`] for a time that does not grow; [`IdentificationError::TooFewSamples`] where no
    /// stretch without a gap holds the shortest window.
    pub fn choose(times_s: &'a [f64], signals: &[&[f64]], derivative: usize) -> Result<Self, IdentificationError> {
        if let Some(row) = times_s.windows(2).position(|pair| pair[1] <= pair[0] || pair[1].is_nan()) {
            return Err(IdentificationError::NotFinite { row });
        }
        let mut steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        let step_s = steps.get(steps.len() / 2).copied().unwrap_or(1.0);
        let mut stretches = Vec::new();
        let mut start = 0;
        for row in 1..=times_s.len() {
            if row == times_s.len() || times_s[row] - times_s[row - 1] > GAP * step_s {
                stretches.push(start..row);
                start = row;
            }
        }
        let longest = stretches.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
        let needed = 2 * HALF_WINDOWS[0] + 1;
        if longest < needed {
            return Err(IdentificationError::TooFewSamples { samples: longest, needed });
        }
        let mut fit = Self { times_s, step_s, stretches, half: HALF_WINDOWS[0] };
        let noise: Vec<f64> = signals.iter().map(|signal| fit.noise_variance(signal)).collect();
        let mut views = Vec::new();
        for half in HALF_WINDOWS.into_iter().filter(|half| 2 * half < longest) {
            fit.half = half;
            views.push((half, fit.view(signals, derivative)));
        }
        let mut best = (f64::INFINITY, HALF_WINDOWS[0]);
        for (half, view) in &views {
            let loss = (0..signals.len()).map(|k| {
                let flattened = view[k].flattened_of(k, *half, &views, &noise);
                view[k].loss(flattened, noise[k], times_s.len() as f64 / (2 * half + 1) as f64)
            });
            let loss = loss.sum::<f64>();
            if loss < best.0 {
                best = (loss, *half);
            }
        }
        fit.half = best.1;
        Ok(fit)
    }

    /// Rows at whose centre a full window lies.
    pub fn centres(&self) -> impl Iterator<Item = usize> + '_ {
        let half = self.half;
        self.stretches.iter().flat_map(move |stretch| stretch.start + half..stretch.end.saturating_sub(half))
    }

    /// Weights of the window at this centre for a derivative, per second to its power.
    pub fn weights(&self, centre: usize, derivative: usize) -> Vec<f64> {
        let scale: f64 = (0..derivative).map(|_| self.step_s.recip()).product();
        self.unit_weights(centre, derivative, ORDER).into_iter().map(|weight| weight * scale).collect()
    }

    /// The sum of a window with these weights.
    pub fn sum(&self, centre: usize, weights: &[f64], signal: &[f64]) -> f64 {
        signal[centre - self.half..=centre + self.half].iter().zip(weights).map(|(x, w)| x * w).sum()
    }

    fn unit_weights(&self, centre: usize, derivative: usize, order: usize) -> Vec<f64> {
        let times = &self.times_s[centre - self.half..=centre + self.half];
        let nodes: Vec<f64> = times.iter().map(|time_s| (time_s - self.times_s[centre]) / self.step_s).collect();
        polynomial_weights(&nodes, order, derivative, 0.0)
    }

    /// Some of the centres.
    fn looked_at(&self) -> impl Iterator<Item = usize> + '_ {
        let every = (self.times_s.len() / LOOKED_AT).max(1);
        self.centres().step_by(every)
    }

    /// Variance of white noise on a signal: what the shortest window leaves at its centre.
    fn noise_variance(&self, signal: &[f64]) -> f64 {
        let mut squares = (0.0, 0.0);
        for centre in self.looked_at() {
            let weights = self.unit_weights(centre, 0, ORDER);
            let left = signal[centre] - self.sum(centre, &weights, signal);
            squares.0 += left * left;
            squares.1 += 1.0 - weights[self.half];
        }
        squares.0 / squares.1
    }

    fn view(&self, signals: &[&[f64]], derivative: usize) -> Vec<View> {
        let mut views = vec![View::default(); signals.len()];
        let mut count = 0.0;
        for centre in self.looked_at() {
            let weights = self.unit_weights(centre, derivative, ORDER);
            let finer = self.unit_weights(centre, derivative, ORDER + 2);
            let differences: Vec<f64> = weights.iter().zip(&finer).map(|(a, b)| a - b).collect();
            count += 1.0;
            for (view, signal) in views.iter_mut().zip(signals) {
                view.signal += self.sum(centre, &weights, signal).powi(2);
                view.difference += self.sum(centre, &differences, signal).powi(2);
                view.passed += weights.iter().map(|w| w * w).sum::<f64>();
                view.differing += differences.iter().map(|w| w * w).sum::<f64>();
            }
        }
        for view in &mut views {
            let View { signal, difference, passed, differing } = *view;
            *view = View {
                signal: signal / count,
                difference: difference / count,
                passed: passed / count,
                differing: differing / count,
            };
        }
        views
    }
}

/// Mean squares of one signal in windows of one length, per step of the log.
#[derive(Clone, Copy, Default)]
struct View {
    /// The derivative.
    signal: f64,
    /// Its difference to polynomials of higher order.
    difference: f64,
    /// What passes of noise of variance one.
    passed: f64,
    /// What of it the difference shows.
    differing: f64,
}

impl View {
    /// Square of what a window flattens, from the shortest window that shows it.
    fn flattened_of(&self, signal: usize, half: usize, views: &[(usize, Vec<Self>)], noise: &[f64]) -> f64 {
        let shown = |view: &Self| (view.difference - view.differing * noise[signal]).max(0.0);
        let clear = |view: &Self| view.difference > 4.0 * view.differing * noise[signal];
        let seen = views.iter().find(|(_, views)| clear(&views[signal])).or(views.last());
        match seen {
            Some((seen, views)) if *seen > half => shown(&views[signal]) * (half as f64 / *seen as f64).powi(8),
            _ => shown(self),
        }
    }

    /// Square of the relative error of the parameters from so many windows that share nothing; none of a signal that stands still.
    fn loss(&self, flattened: f64, noise: f64, windows: f64) -> f64 {
        let passed = self.passed * noise;
        let power = self.signal - passed;
        if power <= passed.max(0.0) {
            return 0.0;
        }
        (flattened + passed / windows + passed * passed / power) / power
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::signed_unit;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    /// Steps of 10 ms, each row off by a third of one, and half a second missing.
    fn jittered(generator: &mut ChaCha8Rng) -> Vec<f64> {
        let row = |k: usize| 0.01 * (k as f64 + 0.33 * signed_unit(generator)) + if k > 1000 { 0.5 } else { 0.0 };
        (0..3000).map(row).collect()
    }

    #[test]
    fn a_polynomial_is_its_own_fit_at_any_times() {
        let times = jittered(&mut ChaCha8Rng::seed_from_u64(1));
        let quartic = |t: f64| 1.0 - t + 0.5 * t.powi(2) - 0.2 * t.powi(3) + 0.01 * t.powi(4);
        let signal: Vec<f64> = times.iter().map(|t| quartic(*t)).collect();
        let fit = LocalFit::choose(&times, &[&signal], 2).unwrap();
        for centre in fit.centres().step_by(97) {
            let t = times[centre];
            let exact = [quartic(t), -1.0 + t - 0.6 * t * t + 0.04 * t.powi(3), 1.0 - 1.2 * t + 0.12 * t * t];
            for (derivative, exact) in exact.into_iter().enumerate() {
                let found = fit.sum(centre, &fit.weights(centre, derivative), &signal);
                assert!((found - exact).abs() < 1e-6 * (1.0 + exact.abs()), "{derivative} {found} {exact}");
            }
        }
    }

    #[test]
    fn accelerations_are_not_flattened_and_no_window_reaches_across_a_gap() {
        for (seed, noise) in [(2, 1e-6), (3, 1e-4), (4, 1e-3)] {
            let mut generator = ChaCha8Rng::seed_from_u64(seed);
            let times = jittered(&mut generator);
            let angle = |t: f64| (3.0 * t).sin() + 0.2 * (8.0 * t + 1.0).sin();
            let signal: Vec<f64> = times.iter().map(|t| angle(*t) + noise * signed_unit(&mut generator)).collect();
            let fit = LocalFit::choose(&times, &[&signal], 2).unwrap();
            // slope of what is found over the truth, and what is left of it
            let (mut both, mut truth, mut left) = (0.0, 0.0, 0.0);
            for centre in fit.centres() {
                let t = times[centre];
                let exact = -9.0 * (3.0 * t).sin() - 12.8 * (8.0 * t + 1.0).sin();
                let found = fit.sum(centre, &fit.weights(centre, 2), &signal);
                both += found * exact;
                truth += exact * exact;
                left += (found - exact).powi(2);
            }
            assert!((both / truth - 1.0).abs() < 3e-3, "noise {noise}: slope {}", both / truth);
            assert!((left / truth).sqrt() < 0.05, "noise {noise}: {}", (left / truth).sqrt());
        }
    }

    #[test]
    fn what_cannot_be_fitted_is_refused() {
        let times = [0.0, 0.1, 0.2, 0.3, 0.4, 5.0, 5.1, 5.2, 5.3, 5.4];
        assert_eq!(
            LocalFit::choose(&times, &[&[0.0; 10]], 1).err(),
            Some(IdentificationError::TooFewSamples { samples: 5, needed: 9 })
        );
        assert_eq!(
            LocalFit::choose(&[0.0, 0.1, 0.1], &[&[0.0; 3]], 1).err(),
            Some(IdentificationError::NotFinite { row: 1 })
        );
        assert!(LocalFit::choose(&[], &[], 1).is_err());
    }
}
