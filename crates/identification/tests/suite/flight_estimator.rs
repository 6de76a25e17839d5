//! The estimator in the loop: what it learns, what it survives, and that the order of arrival does not matter.
#![allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)] // ticks of a minute

use crate::flight_scenario::{Conditions, Flight, STEP_NS, noise, prior, settings};
use tumble_identification::dynamics::{InertialParameters, LogCholesky, RigidBodyState};
use tumble_identification::lie::{Manifold, Pose, Wrench};
use tumble_identification::nalgebra::{Matrix3, Quaternion, SVector, Translation3, Unit, UnitQuaternion, Vector3};
use tumble_identification::recursive::{
    FlightEstimator, FlightMeasurement, LearningTargets, Reception, Suspect, grasp_or_release,
};
use tumble_identification::statistics::{chi_square_quantile, coverage_band};

/// A flight's measurements and wrenches, to be told to other estimators.
fn recorded(seconds: f64) -> Flight {
    let mut flight = Flight::new(3, Conditions::usual());
    flight.fly_until(seconds);
    flight
}

fn fresh(flight: &Flight) -> FlightEstimator {
    FlightEstimator::try_new(settings(), flight.truth[0], 0, &prior()).unwrap()
}

/// Tells a record; `delay` is that of each measurement in ticks.
fn told(
    flight: &Flight,
    delay: impl Fn(usize) -> usize,
    change: impl Fn(FlightMeasurement) -> FlightMeasurement,
) -> FlightEstimator {
    let mut estimator = fresh(flight);
    for tick in 0..flight.acted.len() + 60 {
        let wrench = flight.acted.get(tick).copied().unwrap_or(Wrench::zero());
        let from_ns = tick as i64 * STEP_NS;
        estimator.acted(from_ns, from_ns + STEP_NS, &wrench);
        for (i, measurement) in flight.measured.iter().enumerate() {
            if i + delay(i) == tick {
                estimator.measured(&change(*measurement));
            }
        }
    }
    estimator
}

fn bits(estimator: &FlightEstimator) -> Vec<u64> {
    let (state, estimate) = (estimator.state_at(estimator.newest_stamp_ns()), estimator.estimate());
    let pose = state.world_from_body;
    pose.translation
        .vector
        .iter()
        .chain(pose.rotation.coords.iter())
        .chain(&state.twist_body.to_vector())
        .chain(&estimate.parameters.to_vector())
        .chain(&estimate.covariance)
        .map(|x| x.to_bits())
        .collect()
}

#[test]
fn the_order_of_arrival_leaves_no_trace() {
    let flight = recorded(6.0);
    let ordered = told(&flight, |_| 8, |m| m);
    // Up to 0.9 s late, thoroughly mixed.
    let mixed = told(&flight, |i| (i * 37) % 56, |m| m);
    assert_eq!(bits(&ordered), bits(&mixed));
    let (a, b) = (ordered.counts(), mixed.counts());
    assert_eq!((a.used, a.gated, a.relocalised), (b.used, b.gated, b.relocalised));
    assert!(a.replayed == 0 && b.replayed > 200, "{a:?} {b:?}");
    assert_eq!(a.used + a.gated, flight.measured.len() as u64);
    // And an order that is too late does: what comes after a second is not used.
    assert!(told(&flight, |i| if i == 100 { 70 } else { 8 }, |m| m).counts().too_old == 1);
}

#[test]
fn both_signs_of_a_quaternion_give_the_same_bits() {
    let flight = recorded(2.0);
    let negative = |m: FlightMeasurement| {
        let mut m = m;
        m.world_from_body.rotation = Unit::new_unchecked(-m.world_from_body.rotation.into_inner());
        m
    };
    assert_eq!(bits(&told(&flight, |_| 8, |m| m)), bits(&told(&flight, |_| 8, negative)));
}

#[test]
fn what_is_no_measurement_is_refused_and_changes_nothing() {
    let flight = recorded(2.0);
    let mut estimator = told(&flight, |_| 8, |m| m);
    let before = bits(&estimator);
    let good = FlightMeasurement { stamp_ns: estimator.newest_stamp_ns() + STEP_NS, ..flight.measured[100] };
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-310, 1e300] {
        let mut place = good;
        place.world_from_body.translation.vector.y = bad;
        let turned = FlightMeasurement {
            world_from_body: Pose::from_parts(
                Translation3::identity(),
                Unit::new_unchecked(Quaternion::new(1.0, bad, 0.0, 0.0)),
            ),
            ..good
        };
        let rate = FlightMeasurement { rate_body: Some(Vector3::new(0.0, bad, 0.0)), ..good };
        let velocity = FlightMeasurement { velocity_origin_world: Some(Vector3::new(0.0, 0.0, bad)), ..good };
        for measurement in [place, turned, rate, velocity] {
            assert!(matches!(estimator.measured(&measurement), Reception::Malformed { .. }), "{bad}");
        }
    }
    let mut long = good;
    long.world_from_body.rotation = Unit::new_unchecked(Quaternion::new(1.1, 0.0, 0.0, 0.0));
    assert_eq!(estimator.measured(&long), Reception::Malformed { what: "quaternion is not of unit length" });
    let at = |stamp_ns| FlightMeasurement { stamp_ns, ..good };
    assert_eq!(estimator.measured(&at(i64::MAX)), Reception::FromTheFuture);
    assert_eq!(estimator.measured(&at(i64::MIN)), Reception::TooOld);
    assert_eq!(estimator.measured(&at(estimator.newest_stamp_ns())), Reception::Duplicate);
    estimator.acted(5, 5, &Wrench::zero());
    estimator.acted(0, i64::MAX, &Wrench::new(Vector3::repeat(f64::NAN), Vector3::zeros()));
    assert_eq!(bits(&estimator), before);
    let counts = estimator.counts();
    assert_eq!((counts.malformed, counts.from_the_future, counts.too_old, counts.duplicate), (21, 1, 1, 1));
}

/// Pose moved as a map moves.
fn jumped(measurement: &FlightMeasurement, jump: &Pose<f64>) -> FlightMeasurement {
    let mut moved = *measurement;
    moved.world_from_body = jump.compose(&measurement.world_from_body);
    moved.velocity_origin_world = measurement.velocity_origin_world.map(|v| jump.rotation * v);
    moved
}

trait Compose {
    fn compose(&self, other: &Self) -> Self;
}

impl Compose for Pose<f64> {
    fn compose(&self, other: &Self) -> Self {
        self * other
    }
}

#[test]
fn one_jump_is_gated_and_a_lasting_one_is_a_new_place() {
    let jump = Pose::from_parts(Vector3::new(0.4, -0.2, 0.1).into(), UnitQuaternion::from_euler_angles(0.0, 0.0, 0.1));
    let mut flight = recorded(12.0);
    let (mut once, mut lasting) = (0, 0);
    let body = flight.estimator.estimate().parameters;
    for tick in 0..125 {
        // What is under way arrives moved: one alone, then all.
        for underway in &mut flight.underway {
            let all = tick >= 40;
            if (tick == 10 || all)
                && underway.measurement.stamp_ns == flight.measured[flight.measured.len() - 1].stamp_ns
            {
                underway.measurement = jumped(&underway.measurement, &jump);
            }
        }
        let before = flight.estimator.counts();
        flight.step();
        let gated = flight.estimator.counts().gated - before.gated;
        if tick < 30 { once += gated } else { lasting += gated }
    }
    let counts = flight.estimator.counts();
    assert!(once == 1 && lasting > 20 && counts.relocalised == 1, "{once} {lasting} {counts:?}");
    // Half a second, at the new place, with the body as it was.
    let stamp_ns = flight.estimator.newest_stamp_ns();
    let truth = jump.compose(&flight.truth[(stamp_ns / STEP_NS) as usize].world_from_body);
    let found = flight.estimator.state_at(stamp_ns).world_from_body;
    assert!((found.translation.vector - truth.translation.vector).norm() < 5e-3);
    assert!(found.rotation.angle_to(&truth.rotation) < 5e-3);
    let moved = flight.estimator.estimate().parameters.mass / body.mass - 1.0;
    assert!(moved.abs() < 0.05 && !flight.estimator.health().body_doubtful, "{moved}");
}

#[test]
fn a_frozen_sensor_makes_nothing_certain() {
    let flight = recorded(4.0);
    let mut estimator = told(&flight, |_| 8, |m| m);
    let (last, mut silent) = (flight.measured[flight.measured.len() - 1], estimator.clone());
    let before = estimator.motion_covariance();
    let first = flight.acted.len() as i64 + 60;
    for tick in first..first + 300 {
        estimator.acted(tick * STEP_NS, (tick + 1) * STEP_NS, &Wrench::zero());
        silent.acted(tick * STEP_NS, (tick + 1) * STEP_NS, &Wrench::zero());
        let reception = estimator.measured(&FlightMeasurement { stamp_ns: tick * STEP_NS, ..last });
        assert_eq!(reception, Reception::Frozen);
    }
    let after = (estimator.motion_covariance(), estimator.estimate());
    for i in 0..12 {
        assert!(after.0[(i, i)] > before[(i, i)]);
    }
    // Nothing is learned that silence does not teach.
    let share = after.1.std.mass_kg / silent.estimate().std.mass_kg;
    assert!(share > 0.999 && share < 1.001, "{share}");
    assert_eq!(estimator.counts().frozen, 300);
}

#[test]
fn a_gap_is_coasted_on_the_believed_wrenches() {
    let mut flight = recorded(30.0);
    let tick = flight.tick;
    for _ in 0..250 {
        flight.underway.clear();
        flight.step();
    }
    let found = flight.estimator.state_at(flight.now_ns());
    let off = found.world_from_body.translation.vector - flight.state.world_from_body.translation.vector;
    let moved = flight.state.world_from_body.translation.vector
        - flight.truth[tick as usize].world_from_body.translation.vector;
    // Four seconds: thrust that is 2 mN off moves 9.6 kg by 1.7 mm, the speed at the start by a millimetre more.
    assert!(off.norm() < 0.02 && moved.norm() > 0.05, "{} {}", off.norm(), moved.norm());
    let deviation = flight.estimator.motion_covariance();
    assert!(deviation[(3, 3)].sqrt() > 2e-4);
    // And it comes back.
    let gated = flight.estimator.counts().gated;
    for _ in 0..60 {
        flight.step();
    }
    assert!(flight.estimator.counts().gated - gated < 3);
}

/// Fewer flights than `cargo xtask study flight-estimator`, of the first leg only.
#[test]
fn a_start_off_by_a_factor_of_two_is_mended_and_the_intervals_are_true() {
    const FLIGHTS: usize = 12;
    let limit = chi_square_quantile(10.0, 0.999);
    let (mut inside, mut beyond, mut squares, mut sizes) = (0, 0, 0.0, [vec![], vec![], vec![]]);
    let (mut filtered, mut raw) = ([0.0; 2], 0.0);
    for seed in 0..FLIGHTS as u64 {
        let mut flight = Flight::new(900 + seed, Conditions { ticks_per_measurement: 2, ..Conditions::usual() });
        while flight.tick < 1500 {
            flight.step();
            if flight.tick > 1000 {
                let stamp_ns = flight.estimator.newest_stamp_ns();
                let (truth, found) = (flight.truth[(stamp_ns / STEP_NS) as usize], flight.estimator.state_at(stamp_ns));
                let place = |s: &RigidBodyState<f64>| s.world_from_body.translation.vector;
                let velocity = |s: &RigidBodyState<f64>| s.world_from_body.rotation * s.twist_body.linear;
                filtered[0] += (place(&found) - place(&truth)).norm_squared() / 3.0;
                filtered[1] += (velocity(&found) - velocity(&truth)).norm_squared() / 3.0;
                raw += 1.0;
            }
        }
        let account = flight.account();
        assert!(account.estimate.parameters.is_strictly_consistent());
        beyond += u32::from(account.nees >= limit);
        for i in 0..10 {
            inside += usize::from(account.errors[i].abs() <= 2.0 * account.deviations[i]);
        }
        squares += account.nees;
        sizes[0].push(account.errors[0].abs());
        sizes[1].push(account.errors[1..4].iter().fold(0.0_f64, |m, e| m.max(e.abs())));
        sizes[2].push(account.errors[4..7].iter().fold(0.0_f64, |m, e| m.max(e.abs())));
    }
    // One of twelve beyond what one in a thousand is happens in one run out of eighty, two in one of fifteen thousand.
    assert!(beyond <= 1, "{beyond}");
    let coverage = inside as f64 / (10 * FLIGHTS) as f64;
    // Ten numbers of one flight depend on each other: as if there were half as many.
    let band = coverage_band(0.9545, 5 * FLIGHTS, 0.999);
    assert!(coverage >= band.low, "{coverage} {band}");
    assert!(squares / (FLIGHTS as f64) < chi_square_quantile(10.0 * FLIGHTS as f64, 0.999) / FLIGHTS as f64);
    let median = |sizes: &mut Vec<f64>| {
        sizes.sort_by(f64::total_cmp);
        sizes[FLIGHTS / 2]
    };
    let [mass, center, inertia] = sizes.each_mut().map(median);
    assert!(mass < 0.01 && center < 3e-3 && inertia < 0.03, "{mass} {center} {inertia}");
    let [position, velocity] = filtered.map(|sum| (sum / raw).sqrt());
    assert!(position < 4e-4 && velocity < 3e-4, "{position} {velocity}, raw {:?}", noise());
}

#[test]
fn in_the_plane_the_rest_stays_at_its_prior() {
    let mut flight = Flight::new(5, Conditions { planar: true, ..Conditions::usual() });
    flight.fly_until(16.0);
    let (found, start) = (flight.estimator.estimate().parameters, prior().parameters);
    let (a, b) = (LogCholesky::try_from_parameters(&found).unwrap(), LogCholesky::try_from_parameters(&start).unwrap());
    assert!((a.center_of_mass.z - b.center_of_mass.z).abs() < 1e-9);
    assert!((a.shears - b.shears).yz().norm() < 1e-9);
    let state = flight.estimator.state_at(flight.now_ns());
    assert!(state.world_from_body.translation.z == 0.0 && state.twist_body.linear.z == 0.0);
    assert!(state.twist_body.angular.xy().norm() == 0.0);
    let account = flight.account();
    for i in [0, 1, 2, 6] {
        assert!(account.errors[i].abs() < 4.0 * account.deviations[i], "{i} {account:?}");
    }
    assert!(account.deviations[0] < 0.03 && account.deviations[6] < 0.03);
    assert!(account.deviations[3] > 0.02);
}

/// In a flight of half a minute lessons begin eight times, and again where the body has moved far from what they were about; each comes to its end long
/// before the next one.
#[test]
fn what_is_being_learned_again_is_said() {
    let mut flight = Flight::new(8, Conditions::usual());
    let (mut begun, mut underway, mut was) = (0, 0, false);
    while flight.now_ns() < 38_000_000_000 {
        flight.step();
        let health = flight.estimator.health();
        begun += u32::from(health.relearning && !was);
        underway += u32::from(health.relearning);
        was = health.relearning;
    }
    let share = f64::from(underway) / f64::from(flight.tick);
    assert!((6..=24).contains(&begun) && share > 0.02 && share < 0.5, "{begun} {share}");
}

#[test]
fn a_body_that_is_another_is_doubted_and_learned_anew() {
    let mut flight = Flight::new(8, Conditions::usual());
    flight.fly_until(28.0);
    assert!(!flight.estimator.health().body_doubtful && !flight.estimator.health().diverged);
    // Grasped in the acceleration of the second leg.
    let before = flight.state;
    flight.body = flight.body.transformed_by(&Pose::identity());
    let (mass, center, inertia) = (flight.body.mass, flight.body.center_of_mass(), flight.body.inertia_about_com());
    flight.body = InertialParameters::about_com(1.6 * mass, center, inertia * 1.6);
    let found = (1..=160).find(|_| {
        flight.step();
        flight.estimator.health().body_doubtful
    });
    // 2 s, and the latency of 0.15 s.
    assert!(found.is_some_and(|ticks| f64::from(ticks) * 0.016 <= 2.2), "{found:?} {before:?}");
    let certain = flight.estimator.estimate().std.mass_kg;
    let motion = flight.estimator.state_at(flight.now_ns());
    flight.estimator.body_changed(&grasp_or_release());
    assert!(flight.estimator.estimate().std.mass_kg > 10.0 * certain);
    // Between two passes the filter is linear about the body of the last one: to second order.
    let kept = flight.estimator.state_at(flight.now_ns()).ominus(&motion);
    assert!(kept.amax() < 1e-5, "{kept}");
    flight.fly_until(52.0);
    let account = flight.account();
    assert!(account.errors[0].abs() < 0.03 && account.errors[0].abs() < 3.5 * account.deviations[0], "{account:?}");
    // And back to the prior, the motion kept.
    let motion = flight.estimator.state_at(flight.now_ns());
    flight.estimator.restart(&prior()).unwrap();
    assert!(flight.estimator.state_at(flight.now_ns()).ominus(&motion).fixed_rows::<6>(0).amax() < 1e-6);
    let (found, start) = (flight.estimator.estimate(), fresh(&flight).estimate());
    assert!((found.parameters.to_vector() - start.parameters.to_vector()).amax() < 1e-12);
    assert!((found.std.mass_kg / start.std.mass_kg - 1.0).abs() < 1e-9);
}

/// A tenth more of everything: no single innovation is unlikely, and under a wrench that changes its sign none is one-sided for long.
#[test]
fn a_body_that_is_a_tenth_another_is_not_believed_to_be_the_same() {
    const FLIGHTS: u64 = 10;
    let mut accounts = vec![];
    for seed in 51..51 + FLIGHTS {
        let mut flight = Flight::new(seed, Conditions::usual());
        flight.fly_until(28.0);
        let (mass, center, inertia) = (flight.body.mass, flight.body.center_of_mass(), flight.body.inertia_about_com());
        flight.body = InertialParameters::about_com(1.1 * mass, center, inertia * 1.1);
        let doubts = flown_to_the_end(&mut flight, |_, estimator| estimator.body_changed(&grasp_or_release()));
        let account = flight.account();
        let beyond = account.errors.iter().zip(&account.deviations).map(|(error, s)| error.abs() / s);
        accounts.push((seed, doubts, beyond.fold(0.0, f64::max)));
    }
    let misled = accounts.iter().filter(|(_, _, beyond)| *beyond > 4.0).count();
    assert!(misled <= 1, "{accounts:?}");
}

#[test]
fn a_grasp_at_arms_length_is_learned_although_noticed_late() {
    const FLIGHTS: u64 = 20;
    let (mut learned, mut acquitted) = (0, 0);
    let mut accounts = vec![];
    for seed in 31..31 + FLIGHTS {
        let mut flight = Flight::new(seed, Conditions::usual());
        flight.fly_until(28.0);
        let (mass, center, inertia) = (flight.body.mass, flight.body.center_of_mass(), flight.body.inertia_about_com());
        let center = center + Vector3::new(0.0, -0.1, 0.0);
        let stretched = inertia + Matrix3::from_diagonal(&Vector3::new(3.0, 0.1, 3.0)) * inertia[(1, 1)];
        flight.body = InertialParameters::about_com(1.6 * mass, center, stretched);
        let doubts = flown_to_the_end(&mut flight, |_, estimator| estimator.body_changed(&grasp_or_release()));
        let account = flight.account();
        let is_within = account.errors.iter().zip(&account.deviations).all(|(error, s)| error.abs() < 4.0 * s);
        learned += u64::from(doubts.len() == 1 && is_within);
        let health = flight.estimator.health();
        assert!(!health.thrust_doubtful, "{seed}: a body was taken for a thruster");
        acquitted += u64::from(health.thrust_acquitted);
        accounts.push((seed, doubts, account));
    }
    // Of ninety flights 80 learned it, the others were doubted again: what is learned in the first seconds is learned about a body that is
    // far off. None was off by four sigma without a doubt.
    assert!(learned >= 16, "{accounts:?}");
    assert!(acquitted >= 16, "{acquitted}");
}

/// Flies on: when the body is doubted, s. `answer` says what is done about the so many-th doubt.
fn flown_to_the_end(flight: &mut Flight, answer: impl Fn(usize, &mut FlightEstimator)) -> Vec<f64> {
    let (mut doubts, mut was_doubtful) = (vec![], false);
    while flight.now_ns() < 70 * 1_000_000_000 {
        flight.step();
        let is_doubtful = flight.estimator.health().body_doubtful;
        if is_doubtful && !was_doubtful {
            doubts.push(flight.now_ns() as f64 * 1e-9);
            answer(doubts.len(), &mut flight.estimator);
        }
        was_doubtful = is_doubtful;
    }
    doubts
}

/// A nozzle is lost in flight: how often the body is doubted, and what becomes of it.
fn doubts_of_a_lost_nozzle(seed: u64, answer: impl Fn(usize, &mut FlightEstimator)) -> (Vec<f64>, Flight) {
    let mut flight = Flight::new(seed, Conditions::usual());
    flight.fly_until(28.0);
    flight.lose_a_nozzle();
    let doubts = flown_to_the_end(&mut flight, answer);
    (doubts, flight)
}

#[test]
fn a_lost_nozzle_is_the_wrenchs_fault_and_not_the_bodys() {
    let wanted = Wrench::new(Vector3::zeros(), Vector3::new(0.0, 0.1, 0.0));
    for seed in 8..16 {
        let (doubts, flight) = doubts_of_a_lost_nozzle(seed, |doubt, estimator| match doubt {
            1 => estimator.body_changed(&grasp_or_release()),
            2 => estimator.wrench_doubtful(),
            _ => {}
        });
        assert!((1..=4).contains(&doubts.len()), "{seed} {doubts:?}");
        // what to ask for instead of a wrench: more of what is lost
        let asked = flight.estimator.compensated(&wanted);
        assert!(asked.is_some_and(|asked| (asked.force - wanted.force).norm() > 1e-3), "{seed}");
        // what was known before the loss is what is known of the body, which is as wrong as it was said to be then
        let account = flight.account();
        let is_within = account.errors.iter().zip(&account.deviations).all(|(error, s)| error.abs() < 4.0 * s);
        assert!(is_within && account.errors[0].abs() < 0.05, "{seed} {account:?}");
    }
    assert!(Flight::new(8, Conditions::usual()).estimator.compensated(&wanted).is_none());
}

/// Of eight flights that lose a nozzle thrust is blamed in all; where one is named it is the right one, the first along y.
#[test]
fn a_lost_nozzle_is_found_by_what_was_seen_since_the_body_was_doubted() {
    let mut named = vec![];
    for seed in 8..16 {
        let (_, flight) = doubts_of_a_lost_nozzle(seed, |doubt, estimator| {
            if doubt == 1 {
                estimator.body_changed(&grasp_or_release());
            }
        });
        let health = flight.estimator.health();
        assert!(health.thrust_doubtful && !health.thrust_acquitted, "{seed}");
        named.push(health.suspect);
    }
    let right = named.iter().filter(|suspect| **suspect == Some(Suspect::Thruster(4))).count();
    assert!(right >= 3 && named.iter().flatten().count() == right, "{named:?}");
}

/// What an estimator remembers is large; whoever hands one about, or flies it in a thread of a fourth of the usual stack, does not have to know.
#[test]
fn an_estimator_is_small_and_flies_in_a_small_thread() {
    assert!(size_of::<FlightEstimator>() < 16 << 10, "{}", size_of::<FlightEstimator>());
    let fly = || {
        let (_, flight) = doubts_of_a_lost_nozzle(8, |doubt, estimator| {
            if doubt == 1 {
                estimator.body_changed(&grasp_or_release());
            }
        });
        flight.estimator.health().thrust_doubtful
    };
    let thread = std::thread::Builder::new().stack_size(512 << 10).spawn(fly).unwrap();
    assert!(thread.join().unwrap());
}

/// Moves the map for 3 s, and then lets it glide back within 2 s.
fn away_and_back(measurement: &FlightMeasurement, since_s: f64) -> FlightMeasurement {
    let share = ((5.0 - since_s) / 2.0).clamp(0.0, 1.0);
    let turn = UnitQuaternion::new(Vector3::new(0.0, 0.3, 0.4) * share);
    let mut moved = *measurement;
    moved.world_from_body.translation.vector += Vector3::new(0.3, -0.4, 0.1) * share;
    moved.world_from_body.rotation = turn * measurement.world_from_body.rotation;
    moved
}

#[test]
fn a_map_that_moves_and_glides_back_says_nothing_of_the_body() {
    let mut worst = vec![];
    for seed in 21..33 {
        let mut flight = Flight::new(seed, Conditions::usual());
        flight.fly_until(20.0);
        let from_ns = flight.now_ns();
        let (mut doubts, mut moves) = (0, flight.estimator.counts().relocalised);
        while flight.now_ns() < from_ns + 25_000_000_000 {
            let newest_ns = flight.measured[flight.measured.len() - 1].stamp_ns;
            for underway in &mut flight.underway {
                let measurement = &mut underway.measurement;
                if measurement.stamp_ns == newest_ns && measurement.stamp_ns > from_ns {
                    *measurement = away_and_back(measurement, (newest_ns - from_ns) as f64 * 1e-9);
                }
            }
            flight.step();
            doubts += u32::from(flight.estimator.health().body_doubtful);
        }
        moves = flight.estimator.counts().relocalised - moves;
        let account = flight.account();
        assert!(moves >= 2, "{moves} moves");
        let beyond = account.errors.iter().zip(&account.deviations).map(|(error, deviation)| error.abs() / deviation);
        worst.push((beyond.fold(0.0, f64::max), doubts));
    }
    // Of 72 such flights (seeds 21 to 32, 100 to 159) two took some of the gliding for motion: one is off by 6 sigma, the other by 13 and doubted.
    let silent = worst.iter().filter(|(beyond, doubts)| *beyond > 4.0 && *doubts == 0).count();
    let doubted = worst.iter().filter(|(_, doubts)| *doubts > 0).count();
    assert!(silent <= 1 && doubted <= 1, "{worst:?}");
}

#[test]
fn learning_ends_when_the_intervals_say_so() {
    let mut flight = Flight::new(11, Conditions::usual());
    let targets = LearningTargets { mass: 0.02, center_of_mass_m: 3e-3, inertia: 0.03, planar: false };
    assert!(!flight.estimator.is_known_well_enough(&targets));
    while !flight.estimator.is_known_well_enough(&targets) && flight.tick < 2000 {
        flight.step();
    }
    assert!(flight.tick < 2000);
    let std = flight.estimator.estimate();
    let relative = std.std.mass_kg / std.parameters.mass;
    assert!(relative <= 0.02);
    // A target a little narrower is still met, by hysteresis; a much narrower one is not.
    let narrower = |factor: f64| LearningTargets { mass: relative / factor, ..targets };
    assert!(flight.estimator.is_known_well_enough(&narrower(1.2)));
    assert!(!flight.estimator.is_known_well_enough(&narrower(1.3)));
    assert!(!flight.estimator.is_known_well_enough(&narrower(1.2)));
    flight.estimator.body_changed(&SVector::from_element(0.5));
    assert!(!flight.estimator.is_known_well_enough(&targets));
}
