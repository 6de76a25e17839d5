//! Tangents of rows and of a segment's end against central differences, for every column and every nuisance.

use super::calibration::{Calibration, Nuisance};
use super::coordinates::Coordinates;
use super::flow::{Input, State};
use super::segment::{MEASUREMENTS, Model, PARAMETERS, Rows, Sample, Tangent};
use crate::lie::LieGroup;
use nalgebra::{DVector, Matrix3, UnitQuaternion, Vector3};

const W: usize = 48;
const SAMPLES: usize = 16;

fn nuisances() -> Vec<Nuisance> {
    let mut all = vec![Nuisance::Delay];
    for axis in 0..3 {
        all.extend([
            Nuisance::ForceScale(axis),
            Nuisance::TorqueScale(axis),
            Nuisance::AccelerometerBias(axis),
            Nuisance::AccelerometerScale(axis),
        ]);
    }
    all
}

/// Everything that has a column.
#[derive(Clone)]
struct Point {
    start: State,
    noise: [f64; 6],
    eta: Coordinates,
    calibration: Calibration,
}

impl Point {
    fn new() -> Self {
        let inertia = Matrix3::new(0.160, 0.004, -0.003, 0.004, 0.142, 0.006, -0.003, 0.006, 0.170);
        let mut calibration = Calibration::new(&nuisances());
        let mut step = vec![0.0; calibration.columns()];
        for (i, value) in step.iter_mut().enumerate().skip(11) {
            *value = 0.02 * (i as f64).sin();
        }
        calibration.advance(&step);
        Self {
            start: State {
                world_from_body: <UnitQuaternion<f64> as LieGroup>::exp(&Vector3::new(0.4, -1.1, 0.8)),
                rate: Vector3::new(0.3, -0.2, 0.5),
                center: Vector3::new(1.0, -2.0, 0.5),
                velocity: Vector3::new(0.1, -0.05, 0.2),
            },
            noise: [1e-3, -2e-3, 5e-4, 1e-2, -2e-2, 3e-2],
            eta: Coordinates { log_mass: 9.41_f64.ln(), center: Vector3::new(0.031, -0.017, 0.052), inertia },
            calibration,
        }
    }

    fn moved(&self, lane: usize, by: f64) -> Self {
        let mut moved = self.clone();
        match lane {
            0..12 => moved.start = self.start.retracted(&core::array::from_fn(|i| if i == lane { by } else { 0.0 })),
            12..18 => moved.noise[lane - 12] += by,
            _ => {
                let mut step = DVector::zeros(self.calibration.columns());
                step[lane - PARAMETERS] = by;
                moved.eta = self.eta.advanced(&step);
                moved.calibration.advance(step.as_slice());
            }
        }
        moved
    }

    fn roll(&self, samples: &[Sample]) -> (State, Rows<W>, Tangent<W>) {
        let (mut rows, mut tangent) = (Rows::new(), [[[0.0; W]; 3]; 4]);
        let model = Model {
            samples,
            gravity: Vector3::new(0.1, -0.3, 0.2),
            body: self.eta.body(),
            calibration: &self.calibration,
            sigma: [1.0; MEASUREMENTS],
            robust: None,
        };
        let end = model.roll(&self.start, &self.noise, 0..samples.len(), false, &mut rows, &mut tangent);
        (end, rows, tangent)
    }
}

fn samples(slope: f64) -> Vec<Sample> {
    (0..SAMPLES)
        .map(|k| {
            let s = |a: f64| (a + 0.37 * k as f64).sin();
            Sample {
                time_s: 0.016 * k as f64,
                step_s: 0.016,
                input: Input {
                    torque: Vector3::new(s(0.0), s(1.0), s(2.0)) * 0.04,
                    force: Vector3::new(s(3.0), s(4.0), s(5.0)) * 0.4,
                    torque_slope: Vector3::new(s(1.5), s(2.5), s(3.5)) * (0.04 * slope),
                    force_slope: Vector3::new(s(4.5), s(5.5), s(6.5)) * (0.4 * slope),
                    ..Input::default()
                },
                position: Vector3::new(1.0, -2.0, 0.5),
                world_from_body: <UnitQuaternion<f64> as LieGroup>::exp(&Vector3::new(0.4, -1.1, 0.85)),
                velocity: Some(Vector3::new(0.1, 0.0, 0.2)),
                rate: Some(Vector3::new(0.3, -0.2, 0.4)),
                acceleration: Some(Vector3::new(0.01, 0.02, -0.01)),
            }
        })
        .collect()
}

#[test]
fn every_column_is_a_derivative() {
    let samples = samples(1.0);
    let point = Point::new();
    let (_, rows, tangent) = point.roll(&samples);
    let columns = PARAMETERS + point.calibration.columns();
    let last = columns;
    for lane in 0..columns {
        let small = 1e-5;
        let ((up, above, _), (down, below, _)) =
            (point.moved(lane, small).roll(&samples), point.moved(lane, -small).roll(&samples));
        let slope = up.difference(&down).map(|x| x / (2.0 * small));
        let stated: [f64; 12] = core::array::from_fn(|i| tangent[i / 3][i % 3][lane]);
        let (mut worst, mut size): (f64, f64) = (0.0, 0.0);
        for (a, b) in slope.iter().zip(&stated) {
            worst = worst.max((a - b).abs());
            size = size.max(a.abs());
        }
        // The direction of a force is kept through a step: columns of forces are right to the turn of one step.
        assert!(worst < 5e-3 * size + 1e-9, "end, lane {lane}: off by {worst} of {size}");
        for group in 0..MEASUREMENTS {
            let (mut worst, mut size): (f64, f64) = (0.0, 0.0);
            let values = above.groups[group].iter().zip(&below.groups[group]).zip(&rows.groups[group]);
            for ((a, b), row) in values {
                let slope = (a[last] - b[last]) / (2.0 * small);
                worst = worst.max((slope - row[lane]).abs());
                size = size.max(slope.abs());
            }
            assert!(worst < 5e-3 * size + 1e-8, "group {group}, lane {lane}: off by {worst} of {size}");
        }
    }
}
