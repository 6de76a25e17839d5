//! The estimator in the loop of a flight: what a control period costs it, measurements that come late included.
#![allow(clippy::unwrap_used, missing_docs)]

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::Instant;
use tumble_identification::BodyScale;
use tumble_identification::estimator::{Acted, Gauss, Measurement, StateEstimator};
use tumble_identification::nalgebra::Vector3;
use tumble_identification::recursive::{FlightEstimator, FlightMeasurement, TwoStageEstimator};

#[path = "../../crates/identification/tests/suite/flight_scenario/mod.rs"]
mod flight_scenario;
#[path = "../../crates/identification/tests/suite/random.rs"]
mod random;
use flight_scenario::{Conditions, Flight, STEP_NS, noise, prior, settings};

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

/// What every control period of a flight costs, first lessons included: a mean hides the one that comes too late.
fn longest(_: &mut Criterion) {
    let mut flight = Flight::new(1, Conditions::usual());
    flight.fly_until(INTO_S);
    let known = prior();
    let scale = BodyScale::of(&known.parameters.to_vector()).unwrap();
    let (start, found) = (flight.truth[0], known.to_finding(scale).unwrap());
    let estimators: [(&str, Box<dyn StateEstimator>); 3] = [
        ("joint", Box::new(FlightEstimator::try_new(settings(), start, 0, &known).unwrap())),
        ("two stages, rls", Box::new(TwoStageEstimator::least_squares(settings(), start, 0, &found).unwrap())),
        ("two stages, sdp", Box::new(TwoStageEstimator::sdp(settings(), start, 0, &found).unwrap())),
    ];
    for (name, mut estimator) in estimators {
        let mut took_us: Vec<f64> = Vec::new();
        for (tick, wrench) in (0_i64..).zip(&flight.acted) {
            let acted = Acted {
                from_ns: tick * STEP_NS,
                until_ns: (tick + 1) * STEP_NS,
                wrench_body: *wrench,
                stored_body: Vector3::zeros(),
            };
            let late = usize::try_from(tick).ok().and_then(|tick| tick.checked_sub(9));
            let measured = late.and_then(|late| flight.measured.get(late)).map(of_levels);
            let begun = Instant::now();
            estimator.acted(&acted);
            if let Some(measured) = &measured {
                estimator.measured(measured);
            }
            took_us.push(begun.elapsed().as_secs_f64() * 1e6);
        }
        took_us.sort_by(f64::total_cmp);
        let at = |share: usize| took_us[(took_us.len() - 1) * share / 1000];
        let (median, most, longest) = (at(500), at(990), at(1000));
        println!("{name}: period median {median:.0} us, p99 {most:.0} us, longest {longest:.0} us");
    }
}

fn of_levels(seen: &FlightMeasurement) -> Measurement {
    let noise = noise();
    let of_pose = Measurement::of_pose(seen.stamp_ns, &seen.world_from_body, noise.attitude_rad, noise.position_m);
    Measurement {
        rate_body: seen.rate_body.map(|rate| Gauss::isotropic(rate, noise.rate_rad_s)),
        velocity_world: seen.velocity_origin_world.map(|velocity| Gauss::isotropic(velocity, noise.velocity_m_s)),
        ..of_pose
    }
}

criterion_group!(group, longest, benches);
criterion_main!(group);
