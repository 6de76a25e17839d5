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
        let numerator = |divisor, second, third| Some(Numerator { divisor, second, third });
        let numerator = match mode {
            ImpellerMode::Off => None,
            ImpellerMode::Quiet => numerator(5957.169629, 3.208_223_739_5, 4.624_671_218_5),
            ImpellerMode::Nominal => numerator(8092.181701, 3.999_637_218_2, 6.998_911_654_6),
            ImpellerMode::Aggressive => numerator(9170.351272, 4.399_296_753_0, 8.197_890_258_9),
        };
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
        let numerator = match mode {
            ImpellerMode::Off => None,
            ImpellerMode::Quiet => Some((31.440_180_95, 1.208_223_739_5)),
            ImpellerMode::Nominal => Some((42.708_143_76, 1.999_637_218_2)),
            ImpellerMode::Aggressive => Some((48.398_404_15, 2.399_296_753_0)),
        };
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
