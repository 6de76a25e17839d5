#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    clippy::items_after_statements,
    reason = "a test: small counts, and numbers that are set, not computed"
)]
use super::*;
use tumble_astrobee::propulsion::Damage;
use tumble_astrobee::sensing::Confidence;
use tumble_astrobee::simulator::{AstrobeeSimulator, CONTROL_PERIOD_NS, SimulatorSettings};
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::nalgebra::{UnitQuaternion, Vector3};
use tumble_dynamics::{Plant, RigidBodyState};
use tumble_identification::noise::Gaussian;
use tumble_lie::{LieGroup, Pose, Twist};
use tumble_planning::mission::FaultPlant;

const DURATION_S: f64 = 100.0;

fn choice(name: FaultName, severity: u8) -> FaultChoice {
    FaultChoice { name, severity }
}

/// A message of every control period, 0.1 s old, all different.
fn message(k: i64) -> LocalizationEstimate {
    let arrival_ns = k * CONTROL_PERIOD_NS;
    let t = arrival_ns as f64 * 1e-9;
    let turn: UnitQuaternion<f64> = LieGroup::exp(&Vector3::new(0.1 * t, -0.02 * t, 0.5));
    LocalizationEstimate {
        stamp_ns: arrival_ns - 100_000_000,
        arrival_ns,
        world_from_body: Pose::from_parts(Vector3::new(0.05 * t, 1.0, -0.01 * t).into(), turn),
        velocity_origin_world: Vector3::new(0.05, 1e-3 * t, -0.01),
        rate_body: Vector3::new(0.1, -0.02, 1e-4 * t),
        acceleration_origin_body: Vector3::new(1e-3, 1e-5 * t, 0.0),
        confidence: Confidence::Good,
    }
}

/// Messages of a flight of 100 s.
const MESSAGES: i64 = 6250;

/// What is heard in each control period of the flight.
fn heard(faults: &mut Faults) -> Vec<Vec<LocalizationEstimate>> {
    let mut out = Vec::new();
    (0..MESSAGES)
        .map(|k| {
            faults.measurements(k * CONTROL_PERIOD_NS, &[message(k)], &mut out);
            out.clone()
        })
        .collect()
}

fn stream(name: FaultName, severity: u8, seed: u64) -> (Vec<LocalizationEstimate>, Counts) {
    let mut faults = Faults::new(Some(choice(name, severity)), seed, DURATION_S);
    let stream = heard(&mut faults).concat();
    (stream, faults.counts())
}

/// All bits of a stream, NaN included.
fn bits(stream: &[LocalizationEstimate]) -> Vec<u64> {
    stream
        .iter()
        .flat_map(|message| {
            let pose = &message.world_from_body;
            let numbers = [
                pose.translation.vector,
                message.velocity_origin_world,
                message.rate_body,
                message.acceleration_origin_body,
            ];
            let times =
                [message.stamp_ns.cast_unsigned(), message.arrival_ns.cast_unsigned(), message.confidence as u64];
            let all = numbers.iter().flat_map(|v| v.iter()).chain(pose.rotation.coords.iter());
            all.map(|x| x.to_bits()).chain(times).collect::<Vec<_>>()
        })
        .collect()
}

fn index_of(message: &LocalizationEstimate) -> i64 {
    (message.stamp_ns + 100_000_000) / CONTROL_PERIOD_NS
}

const STREAM_FAULTS: [FaultName; 7] = [
    FaultName::Drop,
    FaultName::Delay,
    FaultName::Duplicate,
    FaultName::Clock,
    FaultName::Malformed,
    FaultName::Frozen,
    FaultName::Jump,
];

#[test]
fn names_and_severities_are_read_and_written_alike() {
    for name in FaultName::ALL {
        for severity in 1..=3 {
            let text = choice(name, severity).to_string();
            assert_eq!(text.parse(), Ok(choice(name, severity)));
            assert_eq!(text, format!("{name}:{severity}"));
        }
        assert_eq!(name.to_string().parse(), Ok(choice(name, 1)));
    }
    assert_eq!("late-obstacle:2".parse(), Ok(choice(FaultName::LateObstacle, 2)));
    let error = "mas-step:2".parse::<FaultChoice>().unwrap_err().to_string();
    assert!(error.contains("did you mean `mass-step`?") && error.contains("drop, delay, duplicate"), "{error}");
    for bad in ["drop:0", "drop:4", "drop:", "drop:01", "drop:2:1", "drop: 2"] {
        let error = bad.parse::<FaultChoice>().unwrap_err();
        assert!(matches!(error, FaultChoiceError::Severity { .. }), "{bad}");
        assert!(error.to_string().contains("write `drop:2`"), "{error}");
    }
    for bad in ["", ":1", "Drop", "drop ", "3"] {
        assert!(matches!(bad.parse::<FaultChoice>(), Err(FaultChoiceError::Unknown { .. })), "{bad}");
    }
}

/// Without faults, and with those that are no faults of messages, everything passes to the bit.
#[test]
fn a_clean_stream_stays_as_it_is() {
    let clean: Vec<LocalizationEstimate> = (0..MESSAGES).map(message).collect();
    let others =
        FaultName::ALL.into_iter().filter(|name| !STREAM_FAULTS.contains(name)).map(|name| Some(choice(name, 3)));
    for choice in others.chain([None]) {
        let mut faults = Faults::new(choice, 3, DURATION_S);
        assert_eq!(bits(&heard(&mut faults).concat()), bits(&clean), "{choice:?}");
    }
    let mut none = Faults::new(None, 3, DURATION_S);
    for k in 0..1000 {
        let wanted = Wrench::new(Vector3::repeat(0.3), Vector3::new(-9.0, 0.0, 1e-3 * k as f64));
        assert_eq!(none.before_step(k * 100_000_000, &wanted), PlantChange::asking(wanted));
        assert!(!none.restart_due(k * 100_000_000) && none.sabotage(k * 100_000_000).is_none());
        assert_eq!(none.planner(k.unsigned_abs()), PlannerFault::None);
    }
    assert!(none.late_obstacle().is_none() && none.counts().is_empty());
}

#[test]
fn one_seed_decides_everything() {
    for name in STREAM_FAULTS {
        for severity in 1..=3 {
            let [first, again, other] = [5, 5, 6].map(|seed| stream(name, severity, seed));
            assert_eq!(bits(&first.0), bits(&again.0), "{name}:{severity}");
            assert_eq!(first.1, again.1);
            assert_ne!(bits(&first.0), bits(&other.0), "{name}:{severity}");
        }
    }
}

/// Nothing is wrong in the first ten seconds or from 60 % of the flight on, when all that was late has come.
#[test]
fn the_stream_is_clean_before_and_after() {
    for name in STREAM_FAULTS {
        for severity in 1..=3 {
            for seed in 0..5 {
                let (stream, counts) = stream(name, severity, seed);
                let clean = |from_s: f64, to_s: f64| {
                    let within = |arrival_ns: i64| (from_s..to_s).contains(&(arrival_ns as f64 * 1e-9));
                    let expected: Vec<_> = (0..MESSAGES).map(message).filter(|m| within(m.arrival_ns)).collect();
                    let found: Vec<_> = stream.iter().copied().filter(|m| within(m.arrival_ns)).collect();
                    assert_eq!(bits(&found), bits(&expected), "{name}:{severity} {from_s} {to_s}");
                };
                clean(0.0, 10.0);
                clean(61.1, 100.0);
                assert!(counts.values().sum::<u64>() > 0, "{name}:{severity} {seed}");
            }
        }
    }
}

/// Four standard deviations of a binomial count around its mean.
fn is_binomial(count: u64, of: u64, probability: f64) -> bool {
    let (count, of) = (count as f64, of as f64);
    (count - of * probability).abs() <= 4.0 * (of * probability * (1.0 - probability)).sqrt()
}

#[test]
fn losses_have_their_rates_and_a_burst() {
    for (severity, probability, burst_s) in [(1, 0.01, 0.5), (2, 0.1, 2.0), (3, 0.5, 10.0)] {
        let (mut lost_beside, mut beside) = (0, 0);
        for seed in 0..20 {
            let (stream, counts) = stream(FaultName::Drop, severity, seed);
            let kept: Vec<i64> = stream.iter().map(index_of).collect();
            assert_eq!(counts["estimates-lost"], (MESSAGES as u64) - kept.len() as u64);
            // the longest gap is the burst, a little longer where its neighbours are lost too
            let gap = kept.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap();
            let burst = burst_s / 0.016;
            assert!((burst - 1.0..burst + 20.0).contains(&(gap as f64)), "{severity} {seed}: {gap}");
            lost_beside += MESSAGES - kept.len() as i64 - gap + 1;
            beside += 1250 - gap + 1;
        }
        assert!(is_binomial(lost_beside.unsigned_abs(), beside.unsigned_abs(), probability), "{lost_beside} {beside}");
    }
}

/// Each comes once, at a time that lies by the delay and the jitter after its own; contents and stamps are left alone.
#[test]
fn late_messages_come_later_by_what_is_said() {
    for (severity, delay_s) in [(1, 0.05), (2, 0.2), (3, 1.0)] {
        let mut faults = Faults::new(Some(choice(FaultName::Delay, severity)), 4, DURATION_S);
        let mut seen = vec![0; MESSAGES as usize];
        let (mut late, mut sum_s, mut extremes_s) = (0, 0.0, [f64::INFINITY, 0.0_f64]);
        for (k, heard) in (0..).zip(heard(&mut faults)) {
            for found in heard {
                let original = message(index_of(&found));
                seen[index_of(&found) as usize] += 1;
                assert_eq!(
                    bits(&[LocalizationEstimate { arrival_ns: original.arrival_ns, ..found }]),
                    bits(&[original])
                );
                assert!(found.arrival_ns <= k * CONTROL_PERIOD_NS && found.arrival_ns > (k - 1) * CONTROL_PERIOD_NS);
                if found.arrival_ns != original.arrival_ns {
                    let late_s = (found.arrival_ns - original.arrival_ns) as f64 * 1e-9;
                    (late, sum_s) = (late + 1, sum_s + late_s);
                    extremes_s = [extremes_s[0].min(late_s), extremes_s[1].max(late_s)];
                }
            }
        }
        assert!(seen.iter().all(|times| *times == 1));
        assert_eq!(late, 1250);
        // uniform on 0.1 s: standard deviation 0.1 / sqrt 12 of one, four of those of the mean
        let mean_s = sum_s / f64::from(late);
        assert!((mean_s - delay_s).abs() < 4.0 * 0.1 / 12.0_f64.sqrt() / f64::from(late).sqrt(), "{mean_s}");
        assert!(extremes_s[0] >= delay_s - 0.05 && extremes_s[0] < delay_s - 0.049, "{extremes_s:?}");
        assert!(extremes_s[1] <= delay_s + 0.05 && extremes_s[1] > delay_s + 0.049, "{extremes_s:?}");
    }
}

/// Once those that come again are left out and the rest is put in order, the stream is the clean one.
#[test]
fn doubled_and_held_back_messages_are_those_that_were_sent() {
    for (severity, probability) in [(1, 0.01), (2, 0.1), (3, 0.3)] {
        let (mut doubled, mut held_back) = (0, 0);
        for seed in 0..5 {
            let (mut stream, counts) = stream(FaultName::Duplicate, severity, seed);
            let most_ns = losses::Duplicate::MOST_PERIODS as i64 * CONTROL_PERIOD_NS;
            let mut backwards = 0;
            for pair in stream.windows(2) {
                assert!(pair[0].arrival_ns <= pair[1].arrival_ns);
                backwards += u64::from(pair[1].stamp_ns < pair[0].stamp_ns);
            }
            assert!(backwards > 0);
            for found in &mut stream {
                let original = message(index_of(found));
                assert!((0..=most_ns).contains(&(found.arrival_ns - original.arrival_ns)));
                found.arrival_ns = original.arrival_ns;
            }
            assert_eq!(stream.len() as u64, MESSAGES as u64 + counts["estimates-twice"]);
            stream.sort_by_key(|found| found.stamp_ns);
            stream.dedup_by_key(|found| found.stamp_ns);
            assert_eq!(bits(&stream), bits(&(0..MESSAGES).map(message).collect::<Vec<_>>()));
            doubled += counts["estimates-twice"];
            held_back += counts["estimates-out-of-order"];
        }
        assert!(is_binomial(doubled, 5 * 1250, probability) && is_binomial(held_back, 5 * 1250, probability));
    }
}

#[test]
fn clocks_step_and_step_back() {
    for (severity, largest_s, steps) in [(1, 0.1, 2), (2, 10.0, 2), (3, 10.0, 11)] {
        for seed in 0..6 {
            let (stream, counts) = stream(FaultName::Clock, severity, seed);
            assert_eq!(stream.len() as i64, MESSAGES);
            let offsets: Vec<i64> = (0..).zip(&stream).map(|(k, found)| found.stamp_ns - message(k).stamp_ns).collect();
            for (k, found) in (0..).zip(&stream) {
                let original = message(k);
                assert_eq!(bits(&[LocalizationEstimate { stamp_ns: original.stamp_ns, ..*found }]), bits(&[original]));
            }
            let largest_ns = offsets.iter().map(|offset| offset.abs()).max().unwrap();
            assert!((largest_ns as f64 * 1e-9 - largest_s).abs() < 1e-9, "{severity}");
            assert_eq!(offsets.windows(2).filter(|pair| pair[0] != pair[1]).count(), steps, "{severity} {seed}");
            let wrong = offsets.iter().filter(|offset| **offset != 0).count() as u64;
            assert_eq!(counts["stamps-wrong"], wrong);
            assert!(wrong > 250 && wrong < 320, "{wrong}");
        }
    }
    let signs = |severity| (0..20).map(|seed| stream(FaultName::Clock, severity, seed).0).collect::<Vec<_>>();
    for streams in [signs(1), signs(2)] {
        let is_ahead =
            |stream: &Vec<LocalizationEstimate>| (0..).zip(stream).any(|(k, m)| m.stamp_ns > message(k).stamp_ns);
        let ahead = streams.iter().filter(|stream| is_ahead(stream)).count();
        assert!((2..=18).contains(&ahead), "{ahead}");
    }
}

#[test]
fn malformed_messages_are_as_many_as_said_and_of_every_kind() {
    for (severity, messages, probability) in [(1, 625, 0.02), (2, 313, 0.2), (3, 188, 1.0)] {
        let (mut nan, mut infinite, mut long, mut flipped, mut not_unit, mut malformed) = (0, 0, 0, 0, 0, 0);
        for seed in 0..10 {
            let (stream, counts) = stream(FaultName::Malformed, severity, seed);
            let mut differ = 0;
            for (k, found) in (0..).zip(&stream) {
                let original = message(k);
                if bits(&[*found]) == bits(&[original]) {
                    continue;
                }
                differ += 1;
                let (pose, velocity) = (&found.world_from_body, &found.velocity_origin_world);
                let quaternion = pose.rotation.coords;
                nan += u64::from(pose.translation.vector.x.is_nan() || quaternion.x.is_nan());
                infinite += u64::from(velocity.amax().is_infinite() || found.rate_body.amax().is_infinite());
                long += u64::from(velocity.x.is_finite() && velocity.x > 1e300);
                flipped += u64::from(quaternion == -original.world_from_body.rotation.coords);
                not_unit += u64::from((quaternion.norm() - 1.0).abs() > 0.1);
            }
            assert_eq!(counts["estimates-malformed"], differ, "{severity} {seed}");
            malformed += differ;
        }
        if severity < 3 {
            assert!(is_binomial(malformed, 10 * messages, probability), "{malformed}");
        } else {
            // three times a second, to the message at either end
            assert!(malformed.abs_diff(10 * messages) <= 30, "{malformed}");
        }
        assert!([nan, infinite, long, flipped, not_unit].iter().all(|kind| *kind > 0), "{severity}");
    }
}

/// How a stream differs from the clean one, message by message: from when on, how long, and how.
fn is_stuck(seed: u64, severity: u8) -> (&'static str, f64) {
    let (stream, counts) = stream(FaultName::Frozen, severity, seed);
    let wrong: Vec<(i64, LocalizationEstimate)> =
        (0..).zip(stream).filter(|(k, found)| bits(&[*found]) != bits(&[message(*k)])).collect();
    let (first, last) = (wrong[0].0, wrong[wrong.len() - 1].0);
    assert_eq!(last - first + 1, wrong.len() as i64, "all between are wrong");
    let length_s = wrong.len() as f64 * 0.016;
    let before = message(first - 1);
    let kind = if counts.contains_key("estimates-frozen") {
        for (k, found) in &wrong {
            let (stamp_ns, arrival_ns) = (message(*k).stamp_ns, message(*k).arrival_ns);
            assert_eq!(bits(&[*found]), bits(&[LocalizationEstimate { stamp_ns, arrival_ns, ..before }]));
        }
        "frozen"
    } else if counts.contains_key("estimates-drifting") {
        for (k, found) in &wrong {
            let original = message(*k);
            let away = found.world_from_body.translation.vector - original.world_from_body.translation.vector;
            let since_s = (k - first) as f64 * 0.016;
            assert!((away.norm() - 0.02 * since_s).abs() < 0.02 * 0.017, "{away}");
            let turned = found.world_from_body.rotation.angle_to(&original.world_from_body.rotation);
            assert!((turned - 0.02 * since_s).abs() < 0.02 * 0.017, "{turned}");
            assert_eq!(found.velocity_origin_world, original.velocity_origin_world);
        }
        "ramp"
    } else {
        for (k, found) in &wrong {
            let original = message(*k);
            assert_eq!(found.world_from_body, original.world_from_body);
            assert_eq!(found.velocity_origin_world, original.velocity_origin_world * 1.35);
            assert_eq!(found.rate_body, original.rate_body * 1.35);
        }
        "scaled"
    };
    (kind, length_s)
}

#[test]
fn sensors_freeze_drift_or_exaggerate() {
    for (severity, stated_s) in [(1, 1.0), (2, 3.0), (3, 10.0)] {
        let mut kinds = std::collections::BTreeSet::new();
        for seed in 0..15 {
            let (kind, length_s) = is_stuck(seed, severity);
            assert!((length_s - stated_s).abs() < 0.04, "{kind} {length_s}");
            kinds.insert(kind);
        }
        assert_eq!(kinds.len(), 3, "{kinds:?}");
    }
}

#[test]
fn the_localisation_jumps_and_comes_back() {
    for (severity, away_m, turned_rad) in [(1, 0.05, 0.0873), (2, 0.2, 0.2618), (3, 0.5, std::f64::consts::FRAC_PI_6)] {
        for (seed, planar) in [(1, false), (2, false), (1, true), (2, true)] {
            let mut faults = Faults::new(Some(choice(FaultName::Jump, severity)), seed, DURATION_S);
            if planar {
                faults = faults.in_plane();
            }
            let stream = heard(&mut faults).concat();
            let away: Vec<(f64, f64)> = (0..)
                .zip(&stream)
                .map(|(k, found)| {
                    let (is, was) = (&found.world_from_body, message(k).world_from_body);
                    let away = is.translation.vector - was.translation.vector;
                    let turn: Vector3<f64> = LieGroup::log(&(is.rotation * was.rotation.inverse()));
                    assert!(!planar || (away.z == 0.0 && turn.xy().amax() < 1e-12));
                    assert_eq!(found.velocity_origin_world, message(k).velocity_origin_world);
                    (away.norm(), turn.norm())
                })
                .collect();
            let first = away.iter().position(|(away, _)| *away > 1e-9).unwrap();
            assert!((away[first].0 - away_m).abs() < 1e-9 && (away[first].1 - turned_rad).abs() < 1e-4);
            // 3 s later still there, 4 s later half of it, after 5 s nothing
            assert!((away[first + 186].0 - away_m).abs() < 1e-9);
            assert!((away[first + 250].0 - 0.5 * away_m).abs() < 0.01 * away_m, "{}", away[first + 250].0);
            assert!(away[first + 314..].iter().all(|(away, _)| *away == 0.0));
        }
    }
    let honest = (0..20)
        .filter(|seed| stream(FaultName::Jump, 1, *seed).0.iter().any(|found| found.confidence == Confidence::Lost));
    assert!((3..=17).contains(&honest.count()));
}

/// A fault of the machine over the flight, one look each control period.
fn changes(name: FaultName, severity: u8, seed: u64, wanted: &Wrench<f64>) -> (Vec<PlantChange>, Faults) {
    let mut faults = Faults::new(Some(choice(name, severity)), seed, DURATION_S);
    let changes = (0..MESSAGES).map(|k| faults.before_step(k * CONTROL_PERIOD_NS, wanted)).collect();
    (changes, faults)
}

#[test]
fn wrenches_are_cut_for_a_while_at_the_limits_told() {
    let wanted = Wrench::new(Vector3::new(0.014, -0.001, 0.0), Vector3::new(0.15, -0.05, 0.001));
    let limits = WrenchBox { torque_limit: Vector3::repeat(0.02), force_limit: Vector3::new(0.2, 0.4, 0.4) };
    for (severity, factor, length_s) in [(1, 0.5, 10.0), (2, 0.1, 10.0), (3, 0.0, 5.0)] {
        let mut faults = Faults::new(Some(choice(FaultName::Saturation, severity)), 2, DURATION_S).limited_to(limits);
        let (mut cut, mut whole) = (0, 0);
        for k in 0..MESSAGES {
            let change = faults.before_step(k * CONTROL_PERIOD_NS, &wanted);
            assert_eq!(PlantChange { wanted, ..change }, PlantChange::asking(wanted));
            if change.wanted == wanted {
                whole += 1;
                continue;
            }
            cut += 1;
            for (given, (asked, limit)) in [
                (change.wanted.force.x, (0.15, 0.2)),
                (change.wanted.force.y, (-0.05, 0.4)),
                (change.wanted.force.z, (0.001, 0.4)),
                (change.wanted.torque.x, (0.014, 0.02)),
            ] {
                let expected: f64 = f64::min(f64::abs(asked), limit * factor) * f64::signum(asked);
                assert!((given - expected).abs() < 1e-15, "{severity}: {given} {expected}");
            }
        }
        assert!((f64::from(cut) * 0.016 - length_s).abs() < 0.04 && whole > 5000, "{cut}");
        assert_eq!(faults.counts()["wrenches-cut"], cut as u64);
    }
}

#[test]
fn nozzles_fail_one_by_one_for_good_and_impellers_for_a_while() {
    let wanted = Wrench::zero();
    let (mut factors, mut nozzles, mut closed, mut modules) = ([0; 2], [0; 12], 0, [0; 2]);
    for seed in 0..80 {
        let [thrust, stuck, off] = [1, 2, 3].map(|severity| changes(FaultName::Nozzle, severity, seed, &wanted));
        let last = |changes: &Vec<PlantChange>| changes[changes.len() - 1].damage;
        assert!(
            [&thrust, &stuck, &off].iter().all(|(changes, _)| changes[..625].iter().all(|c| c.damage == Damage::NONE))
        );
        let factor = last(&thrust.0).thrust_factor;
        assert_eq!(last(&thrust.0), Damage { thrust_factor: factor, ..Damage::NONE });
        assert!(factor == 0.7 || factor == 1.25);
        factors[usize::from(factor > 1.0)] += 1;
        let damage = last(&stuck.0);
        let broken: Vec<usize> = (0..12).filter(|nozzle| damage.stuck[*nozzle].is_some()).collect();
        assert_eq!(broken.len(), 1);
        let share = damage.stuck[broken[0]].unwrap();
        assert!(share == 0.0 || (0.1..0.6).contains(&share), "{share}");
        nozzles[broken[0]] += 1;
        closed += i32::from(share == 0.0);
        assert_eq!(last(&off.0), Damage::NONE);
        let while_off: Vec<Damage> = off.0.iter().map(|c| c.damage).filter(|d| *d != Damage::NONE).collect();
        assert!((while_off.len() as f64 * 0.016 - 4.0).abs() < 0.04);
        let [starboard, port] = while_off[0].impeller_off;
        assert!(starboard != port && while_off.iter().all(|damage| *damage == while_off[0]));
        modules[usize::from(port)] += 1;
        assert_eq!(off.1.counts()["periods-impeller-off"], while_off.len() as u64);
    }
    // every nozzle has its turn: a sixth of the seeds at most
    assert!(nozzles.iter().all(|times| (1..=20).contains(times)), "{nozzles:?}");
    assert!([factors[0], modules[0], closed].iter().all(|times| (22..=58).contains(times)), "{factors:?}");
}

#[test]
fn the_supply_sags_and_the_computer_starts_anew_meanwhile() {
    for (severity, factor, restarts) in [(1, 0.9, 0), (2, 0.7, 1), (3, 0.7, 3)] {
        for seed in 0..10 {
            let mut faults = Faults::new(Some(choice(FaultName::Power, severity)), seed, DURATION_S);
            let (mut low, mut restarted) = (0, 0);
            for k in 0..MESSAGES {
                let is_due = faults.restart_due(k * CONTROL_PERIOD_NS);
                assert!(!(is_due && faults.restart_due(k * CONTROL_PERIOD_NS)), "once each time");
                let supply_factor = faults.before_step(k * CONTROL_PERIOD_NS, &Wrench::zero()).damage.supply_factor;
                assert!(supply_factor == 1.0 || supply_factor == factor);
                low += u64::from(supply_factor < 1.0);
                restarted += u64::from(is_due);
                assert!(!is_due || supply_factor < 1.0 || low > 620);
            }
            assert!((low as f64 * 0.016 - 10.0).abs() < 0.04, "{low}");
            assert_eq!(restarted, restarts);
            assert_eq!(faults.counts().get("restarts").copied().unwrap_or(0), restarts);
        }
    }
}

#[test]
fn the_body_changes_once() {
    let mut grown = 0;
    for seed in 0..30 {
        for (severity, share) in [(1, 0.1), (2, 0.5)] {
            let (changes, faults) = changes(FaultName::MassStep, severity, seed, &Wrench::zero());
            let steps: Vec<BodyStep> = changes.iter().filter_map(|change| change.body).collect();
            let [BodyStep::Scaled(factor)] = steps[..] else { panic!("{steps:?}") };
            assert!(((factor - 1.0).abs() - share).abs() < 1e-12);
            assert!(changes[..625].iter().all(|change| change.body.is_none()));
            assert_eq!(faults.counts()["mass-steps"], 1);
            grown += i32::from(factor > 1.0);
        }
        let (changes, _) = changes(FaultName::MassStep, 3, seed, &Wrench::zero());
        let steps: Vec<BodyStep> = changes.iter().filter_map(|change| change.body).collect();
        let [BodyStep::Lump { mass_share, center_body, radius_m }] = steps[..] else { panic!("{steps:?}") };
        assert!(mass_share == 0.5 && (center_body.norm() - 0.15).abs() < 1e-12 && radius_m > 0.0);
    }
    assert!((15..=45).contains(&grown), "{grown}");
}

#[test]
fn estimators_are_misled_once() {
    for (severity, factor, covariance) in [(1, 10.0, 1.0), (2, 2.0, 1e-6), (3, 10.0, 1e-6)] {
        let mut faults = Faults::new(Some(choice(FaultName::Divergence, severity)), 1, DURATION_S);
        let found: Vec<(i64, Sabotage)> =
            (0..MESSAGES).filter_map(|k| Some((k, faults.sabotage(k * CONTROL_PERIOD_NS)?))).collect();
        let expected = Sabotage { mass_factor: factor, inertia_factor: factor, covariance_factor: covariance };
        let [(k, sabotage)] = found[..] else { panic!("{found:?}") };
        assert_eq!(sabotage, expected);
        assert!((625..940).contains(&k));
        assert_eq!(faults.counts()["sabotages"], 1);
    }
}

#[test]
fn planners_fail_several_times_in_a_row() {
    let mut kinds = [0; 4];
    for seed in 0..30 {
        for (severity, row) in [(1, 1), (2, 3), (3, 10)] {
            let mut faults = Faults::new(Some(choice(FaultName::Planner, severity)), seed, DURATION_S);
            // a request every second
            let answers: Vec<PlannerFault> = (0..100_u32)
                .map(|k| {
                    faults.before_step(i64::from(k) * 1_000_000_000, &Wrench::zero());
                    let fault = faults.planner(u64::from(k));
                    assert_eq!(fault, faults.planner(u64::from(k)), "asked again");
                    fault
                })
                .collect();
            let wrong: Vec<usize> = (0..100).filter(|k| answers[*k] != PlannerFault::None).collect();
            assert_eq!(wrong.len(), row);
            assert!(wrong[0] >= 10 && wrong[0] <= 15 && wrong[row - 1] == wrong[0] + row - 1, "{wrong:?}");
            for answer in &answers {
                match answer {
                    PlannerFault::None => {}
                    PlannerFault::Late { factor } => {
                        assert!((2.0..20.0).contains(factor));
                        kinds[0] += 1;
                    }
                    PlannerFault::NoAnswer => kinds[1] += 1,
                    PlannerFault::Refused => kinds[2] += 1,
                    PlannerFault::Panicked => kinds[3] += 1,
                }
            }
            assert_eq!(faults.counts().values().sum::<u64>(), row as u64);
        }
    }
    assert!(kinds.iter().all(|kind| is_binomial(*kind, 30 * 14, 0.25)), "{kinds:?}");
    use tumble_planning::mission::PlannerFault as Seen;
    assert_eq!(Seen::from(PlannerFault::Late { factor: 3.0 }), Seen::Late(3.0));
    assert_eq!(Seen::from(PlannerFault::Panicked), Seen::NoAnswer);
}

#[test]
fn obstacles_give_the_notice_stated() {
    for (severity, notice_s) in [(1, 3.0), (2, 1.0), (3, 0.5)] {
        let mut faults = Faults::new(Some(choice(FaultName::LateObstacle, severity)), 8, DURATION_S);
        let late = faults.late_obstacle().unwrap();
        assert!(late.notice_s == notice_s && (10.0..=15.0).contains(&late.appears_s));
        assert!(faults.counts().is_empty());
        faults.before_step(15_000_000_000, &Wrench::zero());
        assert_eq!(faults.counts()["late-obstacles"], 1);
    }
}

/// Two at once do to messages and wrenches what each does alone.
#[test]
fn faults_compose() {
    let both = [choice(FaultName::Clock, 2), choice(FaultName::Drop, 2)];
    let mut faults = Faults::mixed(&both, 9, DURATION_S);
    let mixed = heard(&mut faults).concat();
    let [clock, drop] = [FaultName::Clock, FaultName::Drop].map(|name| stream(name, 2, 9));
    let kept: std::collections::BTreeSet<i64> = drop.0.iter().map(index_of).collect();
    let expected: Vec<_> = (0..).zip(clock.0).filter(|(k, _)| kept.contains(k)).map(|(_, found)| found).collect();
    assert_eq!(bits(&mixed), bits(&expected));
    assert_eq!(faults.counts()["estimates-lost"], drop.1["estimates-lost"]);
}

/// The robot flown through the decorator: bare, with no faults, with each.
fn flown(choice: Option<FaultChoice>, decorated: bool) -> Vec<Vector3<f64>> {
    let start = RigidBodyState {
        world_from_body: WorldPreset::Iss.pose("A").unwrap(),
        twist_body: Twist::new(Vector3::new(0.01, 0.0, 0.02), Vector3::zeros()),
    };
    let settings = SimulatorSettings::ideal(WorldPreset::Iss, start);
    let mut bare = AstrobeeSimulator::try_new(settings).unwrap();
    let mut noise = Gaussian::from_seed(5);
    let mut wanted = move || Wrench::new(noise.vector(0.002), noise.vector(0.05));
    if !decorated {
        return (0..300)
            .map(|_| bare.advance(&wanted(), 0.16).unwrap().end.state.world_from_body.translation.vector)
            .collect();
    }
    let mut plant = FaultPlant::new(bare, Faults::new(choice, 3, 48.0));
    (0..300)
        .map(|_| {
            let measured = plant.advance(&wanted(), 0.16).unwrap();
            assert!(measured.believed_wrench_body == measured.wanted_wrench_body, "what is broken is not known");
            measured.end.state.world_from_body.translation.vector
        })
        .collect()
}

#[test]
fn the_decorated_simulator_is_itself_until_something_breaks() {
    let clean = flown(None, false);
    assert_eq!(flown(None, true), clean);
    for (name, severity) in [
        (FaultName::Nozzle, 1),
        (FaultName::Nozzle, 2),
        (FaultName::Nozzle, 3),
        (FaultName::MassStep, 2),
        (FaultName::Saturation, 3),
    ] {
        let broken = flown(Some(choice(name, severity)), true);
        // flights of 48 s: from 8 s on at the earliest, 12 s at the latest
        let first = clean.iter().zip(&broken).position(|(a, b)| a != b).unwrap();
        assert!((50..=77).contains(&first), "{name}:{severity}: {first}");
    }
    assert_eq!(flown(Some(choice(FaultName::Power, 2)), true), clean, "no motors without modules");
}
