//! Speed of the sensors.
//!
//! Budget: one control step of 16 ms with all noise, two samples of the inertial unit and one estimate, in at most 1 us.
//! `cargo bench --package benches --bench sensing`.
#![allow(clippy::unwrap_used, missing_docs)]

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use tumble_astrobee::propulsion::ImpellerMode;
use tumble_astrobee::sensing::{Localization, SensingPreset, TrueMotion};
use tumble_dynamics::RigidBodyState;
use tumble_dynamics::nalgebra::Vector3;

fn benches(c: &mut Criterion) {
    let presets = [
        ("perfect", SensingPreset::Perfect),
        ("nominal", SensingPreset::Nominal),
        ("thesis flight", SensingPreset::ThesisFlight),
    ];
    for (name, preset) in presets {
        for (per_step, step_ms) in [(1, 16), (2, 8)] {
            let mut localization = Localization::new(&preset.settings(), 1, ImpellerMode::Nominal).unwrap();
            let mut truth = TrueMotion {
                time_ns: 0,
                state: RigidBodyState::at_rest(),
                acceleration_origin_body: Vector3::new(0.01, -0.02, 0.03),
                angular_acceleration_body: Vector3::new(0.1, 0.2, -0.1),
            };
            truth.state.twist_body.angular = Vector3::new(0.2, -0.1, 0.3);
            c.bench_function(&format!("sensing/control step, {name}, observed every {step_ms} ms"), |b| {
                b.iter(|| {
                    for _ in 0..per_step {
                        truth.time_ns += step_ms * 1_000_000;
                        localization.observe(black_box(&truth));
                    }
                    while let Some(estimate) = localization.arrived(truth.time_ns) {
                        black_box(estimate);
                    }
                });
            });
        }
    }
}

criterion_group!(sensing, benches);
criterion_main!(sensing);
