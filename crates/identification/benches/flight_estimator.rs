//! The estimator in the loop of a flight: what a control period costs it, measurements that come late included.
#![allow(clippy::unwrap_used, missing_docs)]

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use tumble_identification::recursive::FlightMeasurement;

#[path = "../tests/suite/flight_scenario/mod.rs"]
mod flight_scenario;
use flight_scenario::{Conditions, Flight, STEP_NS};

/// Into the flight, s: long after what was learned first was last learned again.
const INTO_S: f64 = 60.0;

fn benches(criterion: &mut Criterion) {
    let mut flight = Flight::new(1, Conditions::usual());
    flight.fly_until(INTO_S);
    let now_ns = flight.now_ns();
    let wrench = *flight.acted.last().unwrap();
    let newest_ns = flight.estimator.newest_stamp_ns();
    let of = |stamp_ns: i64| FlightMeasurement {
        stamp_ns,
        // of that moment but one, and not to the bit
        ..flight.measured[usize::try_from(stamp_ns / STEP_NS).unwrap() - 1]
    };
    let mut period = |name: &str, stamp_ns: i64| {
        let measurement = of(stamp_ns);
        criterion.bench_function(name, |bencher| {
            bencher.iter_batched_ref(
                || flight.estimator.clone(),
                |estimator| {
                    estimator.acted(now_ns, now_ns + STEP_NS, &wrench);
                    black_box(estimator.measured(black_box(&measurement)))
                },
                BatchSize::LargeInput,
            );
        });
    };
    period("flight estimator, a period with the newest measurement", newest_ns + STEP_NS / 2);
    period("flight estimator, a period with one that is 0.1 s older", newest_ns - 100_000_000 + STEP_NS / 2);
}

criterion_group!(group, benches);
criterion_main!(group);
