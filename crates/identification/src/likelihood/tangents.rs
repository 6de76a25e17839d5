//! Tangents of a segment against central differences, all nuisances at values that are not zero.

use super::calibration::{Calibration, Nuisance};
use super::coordinates::Coordinates;
use super::drive::drives;
use super::flow::{Input, State};
use super::lanes::{NOISE, PARAMETERS};
use super::sample::Sample;
use super::segment::{ACCELERATION, MEASUREMENTS, Model, RATE, Rows, VELOCITY};
use crate::lie::LieGroup;
use nalgebra::{DVector, Matrix3, UnitQuaternion, Vector3};

const STEP_S: f64 = 0.02;
const ROWS: usize = 5;
const SHIFT: usize = 2;

fn all() -> Vec<Nuisance> {
    let mut all = vec![Nuisance::AccelerationDelay];
    let names = ["delay", "force-scale", "torque-scale", "accelerometer-bias", "accelerometer-scale"];
    let more = ["accelerometer-position", "bias-wrench", "table-slope", "actuator-lag"];
    for name in names.into_iter().chain(more) {
        all.extend(Nuisance::named(name).unwrap());
    }
    all.push(Nuisance::TableSlope(2));
    all
}

fn samples() -> Vec<Sample> {
    (0..ROWS + SHIFT + 2)
        .map(|k| {
            let wave = |i: usize| (0.1 * k as f64 + 1.3 * i as f64).sin();
            let three = |i: usize| Vector3::new(wave(i), wave(i + 1), wave(i + 2));
            let input = Input {
                torque: three(0) * 0.04,
                force: three(3) * 0.5,
                torque_slope: three(6) * 0.02,
                force_slope: three(9) * 0.2,
                stored: three(18) * 0.05,
            };
            Sample {
                time_s: k as f64 * STEP_S,
                step_s: STEP_S,
                posed: true,
                input,
                position: three(12) * 0.1,
                world_from_body: <UnitQuaternion<f64> as LieGroup>::exp(&(three(15) * 0.1)),
                velocity: Some(three(18)),
                rate: Some(three(21)),
                acceleration: Some(three(24)),
            }
        })
        .collect()
}

/// State, wrench noise, body and nuisances: all that a segment depends on.
#[derive(Clone)]
struct Point {
    state: State,
    noise: [f64; 6],
    eta: Coordinates,
    calibration: Calibration,
}

impl Point {
    fn new() -> Self {
        let inertia = Matrix3::new(0.160, 0.004, -0.003, 0.004, 0.142, 0.006, -0.003, 0.006, 0.170);
        let eta = Coordinates { log_mass: 9.41_f64.ln(), center: Vector3::new(0.031, -0.017, 0.052), inertia };
        let state = State {
            world_from_body: <UnitQuaternion<f64> as LieGroup>::exp(&Vector3::new(0.2, -0.4, 0.3)),
            rate: Vector3::new(0.3, -0.2, 0.5),
            center: Vector3::new(0.1, 0.2, -0.1),
            velocity: Vector3::new(0.1, -0.05, 0.2),
        };
        let mut calibration = Calibration::new(&all(), &[]);
        let mut step = vec![0.0; calibration.columns()];
        for (i, value) in step[10..].iter_mut().enumerate() {
            *value = 0.05 + 0.01 * i as f64;
        }
        step[10] = 1.3 * STEP_S;
        step[11] = (SHIFT as f64 - 0.4) * STEP_S;
        *step.last_mut().unwrap() = 0.1;
        let lag = calibration.nuisances().iter().position(|n| *n == Nuisance::ActuatorLag).unwrap();
        step[10 + lag] = 0.03;
        calibration.advance(&step);
        assert!(calibration.shift(STEP_S, 1.0));
        step.fill(0.0);
        step[11] = 1e-4;
        calibration.advance(&step);
        Self { state, noise: [1e-3, -2e-3, 5e-4, 2e-2, 1e-2, -3e-2], eta, calibration }
    }

    fn moved(&self, lane: usize, by: f64) -> Self {
        let mut point = self.clone();
        if lane < NOISE {
            let mut step = [0.0; 12];
            step[lane] = by;
            point.state = self.state.retracted(&step);
        } else if lane < PARAMETERS {
            point.noise[lane - NOISE] += by;
        } else {
            let mut step = DVector::zeros(self.calibration.columns());
            step[lane - PARAMETERS] = by;
            point.eta = self.eta.advanced(&step);
            point.calibration.advance(step.as_slice());
        }
        point
    }

    fn roll(&self) -> (Rows<56>, [[[f64; 56]; 3]; 4], State) {
        let samples = samples();
        let model = Model {
            samples: &samples,
            drives: &drives(&samples, STEP_S, &self.calibration.passage()),
            gravity: Vector3::new(0.1, -0.2, 0.3) + self.calibration.slope(),
            body: self.eta.body(),
            calibration: &self.calibration,
            sigma: [1.0; MEASUREMENTS],
            robust: None,
        };
        let (mut rows, mut tangent) = (Rows::new(), [[[0.0; 56]; 3]; 4]);
        let range = SHIFT..SHIFT + ROWS;
        let end = model.roll(&self.state, &self.noise, range, false, &mut rows, &mut tangent);
        (rows, tangent, end)
    }
}

#[test]
fn columns_are_central_differences() {
    let point = Point::new();
    let (rows, tangent, _) = point.roll();
    let last = PARAMETERS + point.calibration.columns();
    assert_eq!(last, 55);
    let mut wrong = Vec::new();
    for lane in 0..last {
        // What forces do through the turning of the body within a step is left out of the columns of noise and centre.
        let absolute = if (NOISE..PARAMETERS + 4).contains(&lane) { 1e-4 } else { 4e-6 };
        let by = 1e-5;
        let (up_rows, _, up) = point.moved(lane, by).roll();
        let (down_rows, _, down) = point.moved(lane, -by).roll();
        let ends: Vec<f64> = up.difference(&down).iter().map(|x| x / (2.0 * by)).collect();
        let name = point.calibration.nuisances().get(lane.wrapping_sub(PARAMETERS + 10));
        let mut compare = |what: &str, found: &[f64], expected: &[f64], bound: f64| {
            let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
            let worst = found.iter().zip(expected).fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs()));
            if worst > bound * size + absolute {
                wrong.push(format!("lane {lane} {name:?} {what}: {worst:e} of {size:e}"));
            }
        };
        // Blocks differ by powers of the step; attitude is linearised about the middle of two ends.
        for block in 0..4 {
            let found: Vec<f64> = (0..3).map(|i| tangent[block][i][lane]).collect();
            compare("end", &found, &ends[3 * block..][..3], 3e-3);
        }
        for group in 0..MEASUREMENTS {
            let found: Vec<f64> = rows.groups[group].iter().map(|row| row[lane]).collect();
            let expected: Vec<f64> = up_rows.groups[group]
                .iter()
                .zip(&down_rows.groups[group])
                .map(|(up, down)| (up[last] - down[last]) / (2.0 * by))
                .collect();
            // What is left of the delay is carried to first order.
            let bound = if group == ACCELERATION {
                3e-3
            } else if group == RATE || group == VELOCITY {
                2e-2
            } else {
                1e-2
            };
            compare(["position", "attitude", "velocity", "rate", "acceleration"][group], &found, &expected, bound);
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
