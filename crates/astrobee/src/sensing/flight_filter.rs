//! The low-pass and notch filters of the flight software, as it runs them.

use crate::propulsion::ImpellerMode;
use tumble_dynamics::nalgebra::Vector3;

/// Numerator of a filter: overall divisor and the inner pairs of its symmetric taps (the outer pair is one).
struct Numerator {
    divisor: f64,
    second: f64,
    third: f64,
}

/// Poles of the accelerometer's filter.
const ACCELEROMETER_FEEDBACK: [f64; 3] = [2.698_687_669_5, -2.441_079_708_5, 0.739_426_572_0];
/// Pole of the gyroscope's filter.
const GYRO_FEEDBACK: f64 = 0.859_528_560_4;

fn accelerometer_numerator(mode: ImpellerMode) -> Option<Numerator> {
    let numerator = |divisor, second, third| Some(Numerator { divisor, second, third });
    match mode {
        ImpellerMode::Off => None,
        ImpellerMode::Quiet => numerator(5_957.169_629, 3.208_223_739_5, 4.624_671_218_5),
        ImpellerMode::Nominal => numerator(8_092.181_701, 3.999_637_218_2, 6.998_911_654_6),
        ImpellerMode::Aggressive => numerator(9_170.351_272, 4.399_296_753_0, 8.197_890_258_9),
    }
}

fn gyro_numerator(mode: ImpellerMode) -> Option<(f64, f64)> {
    match mode {
        ImpellerMode::Off => None,
        ImpellerMode::Quiet => Some((31.440_180_95, 1.208_223_739_5)),
        ImpellerMode::Nominal => Some((42.708_143_76, 1.999_637_218_2)),
        ImpellerMode::Aggressive => Some((48.398_404_15, 2.399_296_753_0)),
    }
}

/// The accelerometer's filter as numerator and denominator of a discrete system, newest sample first; none where all passes.
pub(super) fn accelerometer_coefficients(mode: ImpellerMode) -> Option<(Vec<f64>, Vec<f64>)> {
    let Numerator { divisor, second, third } = accelerometer_numerator(mode)?;
    let [a1, a2, a3] = ACCELEROMETER_FEEDBACK;
    let taps = [1.0, second, third, third, second, 1.0];
    Some((taps.iter().map(|tap| tap / divisor).collect(), vec![1.0, -a1, -a2, -a3]))
}

/// The gyroscope's filter in the same way.
pub(super) fn gyro_coefficients(mode: ImpellerMode) -> Option<(Vec<f64>, Vec<f64>)> {
    let (divisor, inner) = gyro_numerator(mode)?;
    let taps = [1.0, inner, inner, 1.0];
    Some((taps.iter().map(|tap| tap / divisor).collect(), vec![1.0, -GYRO_FEEDBACK]))
}

/// Third-order low pass at 3 Hz with a notch at the impeller's frequency, on the three axes of the accelerometer.
///
/// Coefficients belong to 125 samples per second; at 62.5 every frequency halves and every delay doubles, as in NASA's
/// simulation. The first sample is taken to have lasted for ever.
pub struct AccelerometerFilter {
    numerator: Option<Numerator>,
    inputs: [Vector3<f64>; 5],
    outputs: [Vector3<f64>; 3],
    started: bool,
}

impl AccelerometerFilter {
    /// The filter of a mode; that of [`ImpellerMode::Off`] passes everything.
    pub fn new(mode: ImpellerMode) -> Self {
        let numerator = accelerometer_numerator(mode);
        Self { numerator, inputs: [Vector3::zeros(); 5], outputs: [Vector3::zeros(); 3], started: false }
    }

    /// The next output.
    pub fn update(&mut self, input: Vector3<f64>) -> Vector3<f64> {
        let Some(Numerator { divisor, second, third }) = self.numerator else { return input };
        if !self.started {
            (self.inputs, self.outputs, self.started) = ([input; 5], [input; 3], true);
        }
        let [u1, u2, u3, u4, u5] = self.inputs;
        let [y1, y2, y3] = self.outputs;
        let [a1, a2, a3] = ACCELEROMETER_FEEDBACK;
        let forward = (input + u5 + (u1 + u4) * second + (u2 + u3) * third) / divisor;
        let output = forward + y1 * a1 + y2 * a2 + y3 * a3;
        self.inputs = [input, u1, u2, u3, u4];
        self.outputs = [output, y1, y2];
        output
    }
}

/// First-order low pass at 3 Hz with a notch at the impeller's frequency, on the three axes of the gyroscope.
///
/// Rates and start-up as for [`AccelerometerFilter`].
pub struct GyroFilter {
    /// Divisor and inner taps.
    numerator: Option<(f64, f64)>,
    inputs: [Vector3<f64>; 3],
    output: Vector3<f64>,
    started: bool,
}

impl GyroFilter {
    /// The filter of a mode; that of [`ImpellerMode::Off`] passes everything.
    pub fn new(mode: ImpellerMode) -> Self {
        let numerator = gyro_numerator(mode);
        Self { numerator, inputs: [Vector3::zeros(); 3], output: Vector3::zeros(), started: false }
    }

    /// The next output.
    pub fn update(&mut self, input: Vector3<f64>) -> Vector3<f64> {
        let Some((divisor, inner)) = self.numerator else { return input };
        if !self.started {
            (self.inputs, self.output, self.started) = ([input; 3], input, true);
        }
        let [u1, u2, u3] = self.inputs;
        self.output = (input + u3 + (u1 + u2) * inner) / divisor + self.output * GYRO_FEEDBACK;
        self.inputs = [input, u1, u2];
        self.output
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_1_SQRT_2, PI, TAU};
    use tumble_dynamics::nalgebra::Complex;

    const MODES: [(ImpellerMode, f64); 3] =
        [(ImpellerMode::Quiet, 33.33), (ImpellerMode::Nominal, 41.66), (ImpellerMode::Aggressive, 46.66)];
    const RATE_HZ: f64 = 125.0;
    const LOW_HZ: f64 = 0.01;

    /// Gain and phase of the running code at a frequency, from its steady answer to a sine.
    fn answer(update: &mut dyn FnMut(Vector3<f64>) -> Vector3<f64>, frequency_hz: f64) -> Complex<f64> {
        let omega = TAU * frequency_hz / RATE_HZ;
        let settle = 500;
        // Whole periods, so that sine and cosine are orthogonal.
        let cycles_per_sample = omega / TAU;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "little more than 20 000")]
        let samples = ((20_000.0 * cycles_per_sample).ceil() / cycles_per_sample).round() as u32;
        let mut sum = Complex::new(0.0, 0.0);
        for k in 0..settle + samples {
            let y = update(Vector3::repeat((omega * f64::from(k)).sin())).y;
            if k >= settle {
                sum += Complex::from_polar(2.0 * y / f64::from(samples), -omega * f64::from(k));
            }
        }
        sum * Complex::new(0.0, 1.0)
    }

    fn accelerometer(mode: ImpellerMode, frequency_hz: f64) -> Complex<f64> {
        let mut filter = AccelerometerFilter::new(mode);
        answer(&mut |u| filter.update(u), frequency_hz)
    }

    fn gyro(mode: ImpellerMode, frequency_hz: f64) -> Complex<f64> {
        let mut filter = GyroFilter::new(mode);
        answer(&mut |u| filter.update(u), frequency_hz)
    }

    /// A Butterworth low pass at 3 Hz by the bilinear transform, times a pair of zeros on the unit circle; gain one at rest.
    /// From the design alone: no coefficient of the print enters.
    fn designed(order: u32, notch_hz: f64, frequency_hz: f64) -> Complex<f64> {
        let corner = (PI * 3.0 / RATE_HZ).tan();
        let unnormalised = |frequency_hz: f64| {
            let z = Complex::from_polar(1.0, TAU * frequency_hz / RATE_HZ);
            let s = (z - 1.0) / (z + 1.0) / corner;
            let butterworth = if order == 1 { 1.0 / (s + 1.0) } else { 1.0 / ((s + 1.0) * (s * s + s + 1.0)) };
            let inverse = 1.0 / z;
            let notch = 1.0 - inverse * (2.0 * (TAU * notch_hz / RATE_HZ).cos()) + inverse * inverse;
            butterworth * notch
        };
        unnormalised(frequency_hz) / unnormalised(0.0)
    }

    type Response<'a> = &'a dyn Fn(f64) -> Complex<f64>;

    /// `-d(phase)/d(omega)`, s.
    fn group_delay_s(response: Response, frequency_hz: f64) -> f64 {
        let half = 1e-3 * frequency_hz.max(0.1);
        -(response(frequency_hz + half) / response(frequency_hz - half)).arg() / (TAU * 2.0 * half)
    }

    #[test]
    fn the_running_filters_are_the_designed_ones() {
        for (mode, notch_hz) in MODES {
            for frequency_hz in [0.1, 0.5, 1.0, 2.0, 3.0, 5.0, 12.5, 25.0, 31.25] {
                let difference = (accelerometer(mode, frequency_hz) - designed(3, notch_hz, frequency_hz)).norm();
                assert!(difference < 1e-4, "accelerometer {mode:?} {frequency_hz} Hz: {difference:e}");
                let difference = (gyro(mode, frequency_hz) - designed(1, notch_hz, frequency_hz)).norm();
                assert!(difference < 1e-4, "gyro {mode:?} {frequency_hz} Hz: {difference:e}");
            }
        }
    }

    /// Every printed coefficient at once: at the impeller's frequency nothing may pass, a percent beside it something must.
    #[test]
    fn the_impeller_is_notched_out() {
        for (mode, notch_hz) in MODES {
            for response in [accelerometer as fn(ImpellerMode, f64) -> Complex<f64>, gyro] {
                let beside = response(mode, notch_hz * 0.9).norm().max(response(mode, notch_hz * 1.1).norm());
                let at = response(mode, notch_hz).norm();
                assert!(at < 0.005 * beside, "{mode:?}: {at:e} beside {beside:e}");
            }
        }
    }

    #[test]
    fn half_the_power_passes_near_3_hz() {
        for (mode, _) in MODES {
            for response in [accelerometer as fn(ImpellerMode, f64) -> Complex<f64>, gyro] {
                assert!(response(mode, 2.9).norm() > FRAC_1_SQRT_2, "{mode:?}");
                assert!(response(mode, 3.05).norm() < FRAC_1_SQRT_2, "{mode:?}");
            }
        }
    }

    #[test]
    fn golden_delays_at_rest_and_at_1_hz() {
        for (mode, notch_hz) in MODES {
            let cases: [(Response, Response, f64, f64); 2] = [
                (&|f| accelerometer(mode, f), &|f| designed(3, notch_hz, f), 0.1139, 0.121),
                (&|f| gyro(mode, f), &|f| designed(1, notch_hz, f), 0.0610, 0.056),
            ];
            for (running, designed, low_s, one_hz_s) in cases {
                assert!(
                    (group_delay_s(running, 1.0) - one_hz_s).abs() < 1e-3,
                    "{mode:?}: {}",
                    group_delay_s(running, 1.0)
                );
                assert!((group_delay_s(designed, 1.0) - one_hz_s).abs() < 1e-3);
                assert!((group_delay_s(designed, LOW_HZ) - low_s).abs() < 1e-4, "{}", group_delay_s(designed, LOW_HZ));
            }
        }
    }

    /// A ramp comes out late by the delay at rest; its height, so that the gain at rest is one.
    #[test]
    fn a_ramp_is_late_by_the_delay_at_rest() {
        for interval_s in [0.008, 0.016] {
            let stretch = interval_s / 0.008;
            for (mode, _) in MODES {
                let (mut accelerometer, mut gyro) = (AccelerometerFilter::new(mode), GyroFilter::new(mode));
                let (mut a, mut g) = (Vector3::zeros(), Vector3::zeros());
                let samples = 2000;
                for k in 0..=samples {
                    let u = Vector3::repeat(f64::from(k) * interval_s);
                    (a, g) = (accelerometer.update(u), gyro.update(u));
                }
                let end = f64::from(samples) * interval_s;
                assert!((end - a.x - 0.1139 * stretch).abs() < 1e-4 * stretch, "{mode:?}: {}", end - a.x);
                assert!((end - g.x - 0.0610 * stretch).abs() < 1e-4 * stretch, "{mode:?}: {}", end - g.x);
            }
        }
    }

    #[test]
    fn a_constant_passes_from_the_first_sample_on() {
        let constant = Vector3::new(0.3, -2.0, 9.8);
        for mode in ImpellerMode::ALL {
            let (mut accelerometer, mut gyro) = (AccelerometerFilter::new(mode), GyroFilter::new(mode));
            for _ in 0..3000 {
                // The print's divisors have ten digits.
                assert!((accelerometer.update(constant) - constant).norm() < 2e-6);
                assert!((gyro.update(constant) - constant).norm() < 1e-7);
            }
        }
    }

    #[test]
    fn impellers_at_rest_need_no_filter() {
        let mut filter = AccelerometerFilter::new(ImpellerMode::Off);
        let inputs = [1.0, -3.0, 0.5].map(Vector3::repeat);
        assert_eq!(inputs.map(|u| filter.update(u)), inputs);
        let mut filter = GyroFilter::new(ImpellerMode::Off);
        assert_eq!(inputs.map(|u| filter.update(u)), inputs);
    }
}
