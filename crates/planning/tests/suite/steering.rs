//! Laws of exact steering.
#![allow(clippy::float_cmp)]

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use tumble_dynamics::AlignedBox;
use tumble_identification::noise::between;
use tumble_planning::global::{GoalRegion, MotionLimits};
use tumble_planning::nalgebra::Vector3;
use tumble_planning::steering::{
    Steering, TranslationLimits, least_time_s, least_time_to_goal_s, least_velocity_change_m_s, steer, steer_in,
    steer_to_goal,
};
use tumble_planning::{PlanningError, TranslationState};

fn limits() -> TranslationLimits {
    TranslationLimits {
        position: AlignedBox::between(Vector3::repeat(-1e3), Vector3::repeat(1e3)),
        speed_m_s: Vector3::new(0.1, 0.2, 0.1),
        acceleration_m_s2: Vector3::new(0.02, 0.01, 0.05),
    }
}

/// A coordinate that is often one of few, so that degenerate problems come up.
fn coordinate(random: &mut ChaCha8Rng, limit: f64) -> f64 {
    match random.next_u32() % 8 {
        0 => 0.0,
        1 => limit,
        2 => -limit,
        3 => 0.5 * limit,
        _ => between(random, -limit, limit),
    }
}

fn state(random: &mut ChaCha8Rng, reach_m: f64, limits: &TranslationLimits) -> TranslationState {
    TranslationState {
        position: Vector3::from_fn(|_, _| coordinate(random, reach_m)),
        velocity: limits.speed_m_s.map(|speed| coordinate(random, speed)),
    }
}

/// Continuity, limits and both ends of a motion, by its pieces alone.
fn check(steering: &Steering, from: &TranslationState, to: &TranslationState, limits: &TranslationLimits) {
    let scale = 1.0 + from.position.amax() + to.position.amax() + steering.duration_s() * limits.speed_m_s.max();
    let mut state = *from;
    let mut elapsed_s = 0.0;
    for piece in steering.pieces() {
        assert!(piece.duration_s > 0.0);
        assert!((piece.start.position - state.position).amax() <= 1e-14 * scale, "{from:?} {to:?} {steering:?}");
        assert!((piece.start.velocity - state.velocity).amax() <= 1e-14 * scale);
        let t = piece.duration_s;
        state.position = piece.start.position + (piece.start.velocity + piece.acceleration_m_s2 * (0.5 * t)) * t;
        state.velocity = piece.start.velocity + piece.acceleration_m_s2 * t;
        for axis in 0..3 {
            assert!(piece.acceleration_m_s2[axis].abs() <= limits.acceleration_m_s2[axis]);
            assert!(state.velocity[axis].abs() <= limits.speed_m_s[axis] * (1.0 + 1e-12));
        }
        elapsed_s += t;
    }
    assert!((to.position - state.position).amax() <= 1e-14 * scale, "{from:?} {to:?} {steering:?}");
    assert!((to.velocity - state.velocity).amax() <= 1e-14 * scale);
    assert!((elapsed_s - steering.duration_s()).abs() <= 1e-14 * (1.0 + elapsed_s));
}

#[test]
fn motions_are_continuous_within_limits_and_arrive() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let limits = limits();
    for _ in 0..100_000 {
        let (from, to) = (state(&mut random, 1.0, &limits), state(&mut random, 1.0, &limits));
        let steering = steer(&from, &to, &limits).unwrap();
        check(&steering, &from, &to, &limits);
        assert_eq!(steering.duration_s(), least_time_s(&from, &to, &limits));
        let duration_s = steering.duration_s() * between(&mut random, 1.0, 3.0);
        if let Some(slower) = steer_in(&from, &to, &limits, duration_s) {
            check(&slower, &from, &to, &limits);
        }
    }
}

/// Integral of the least of three lines over `[0, length]`, by the trapezoids between all their crossings.
fn integral_of_least(lines: [(f64, f64); 3], length: f64) -> f64 {
    let mut knots = vec![0.0, length];
    for (index, one) in lines.iter().enumerate() {
        for other in &lines[..index] {
            let crossing = (other.0 - one.0) / (one.1 - other.1);
            if crossing > 0.0 && crossing < length {
                knots.push(crossing);
            }
        }
    }
    knots.sort_by(f64::total_cmp);
    let least = |t: f64| lines.iter().map(|line| line.0 + line.1 * t).fold(f64::INFINITY, f64::min);
    knots.windows(2).map(|knot| 0.5 * (least(knot[0]) + least(knot[1])) * (knot[1] - knot[0])).sum()
}

/// Whether some motion along an axis takes exactly this time, by the displacement between the lowest and the highest speed
/// profile. Knows nothing of the closed forms.
fn exists(d: f64, [v0, v1]: [f64; 2], speed: f64, rate: f64, time_s: f64, slack: f64) -> bool {
    let most = integral_of_least([(v0, rate), (speed, 0.0), (v1 + rate * time_s, -rate)], time_s);
    let least = -integral_of_least([(-v0, rate), (speed, 0.0), (-v1 + rate * time_s, -rate)], time_s);
    (v1 - v0).abs() <= rate * time_s + slack && d >= least - slack && d <= most + slack
}

/// Along one axis the others rest at the origin.
fn along_x(position: f64, velocity: f64) -> TranslationState {
    TranslationState { position: Vector3::new(position, 0.0, 0.0), velocity: Vector3::new(velocity, 0.0, 0.0) }
}

#[test]
fn durations_are_those_of_the_speed_profiles() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let limits = limits();
    let (speed, rate) = (limits.speed_m_s.x, limits.acceleration_m_s2.x);
    let (mut gaps, mut isolated) = (0, 0);
    for _ in 0..100_000 {
        let reach = [0.02, 0.3, 3.0][random.next_u32() as usize % 3];
        let (v0, v1) = (coordinate(&mut random, speed), coordinate(&mut random, speed));
        let d = match random.next_u32() % 8 {
            0 => 0.5 * (v0 + v1) * (v1 - v0).abs() / rate,
            _ => coordinate(&mut random, reach),
        };
        let (from, to) = (along_x(0.0, v0), along_x(d, v1));
        let least_s = least_time_s(&from, &to, &limits);
        let exists_in = |time_s: f64, slack: f64| exists(d, [v0, v1], speed, rate, time_s, slack);
        assert!(exists_in(least_s, 1e-13), "{d} {v0} {v1} {least_s}");
        for _ in 0..8 {
            let time_s = least_s * between(&mut random, 0.0, 1.0);
            let is_less = time_s < least_s;
            assert!(!is_less || !exists_in(time_s, -1e-12) && steer_in(&from, &to, &limits, time_s).is_none());
            let time_s = least_s + between(&mut random, 0.0, 30.0);
            let motion = steer_in(&from, &to, &limits, time_s);
            if motion.is_some() {
                assert!(exists_in(time_s, 1e-12), "{d} {v0} {v1} {time_s}");
            } else {
                gaps += 1;
                assert!(!exists_in(time_s, -1e-12), "{d} {v0} {v1} {time_s}");
            }
        }
        isolated += usize::from(steer_in(&from, &to, &limits, least_s * (1.0 + 1e-9) + 1e-9).is_none());
    }
    assert!(gaps > 10_000 && isolated > 1_000, "{gaps} {isolated}");
}

/// A random motion within the limits of speed and acceleration: its states and times.
fn wander(random: &mut ChaCha8Rng, limits: &TranslationLimits) -> Vec<(f64, TranslationState, f64)> {
    let mut state = state(random, 1.0, limits);
    let (mut time_s, mut change) = (0.0, 0.0);
    let mut states = vec![(time_s, state, change)];
    for _ in 0..=random.next_u32() % 5 {
        let step_s = between(random, 0.0, 8.0);
        let wanted = Vector3::from_fn(|axis, _| coordinate(random, limits.acceleration_m_s2[axis]));
        let next = (state.velocity + wanted * step_s).zip_map(&limits.speed_m_s, |v, limit| v.clamp(-limit, limit));
        let rate = (next - state.velocity) / step_s;
        state.position += (state.velocity + next) * (0.5 * step_s);
        change += rate.abs().sum() * step_s;
        state.velocity = next;
        time_s += step_s;
        states.push((time_s, state, change));
    }
    states
}

/// The least motions are never beaten by chance; what chance does in a time can be done in just that time, with no more
/// peak and no more impulse; a region that chance ends in is not farther than it took.
#[test]
fn no_admissible_motion_is_faster_or_spares_more() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let limits = limits();
    for _ in 0..50_000 {
        let states = wander(&mut random, &limits);
        let (from, (time_s, to, change)) = (states[0].1, states[states.len() - 1]);
        assert!(least_time_s(&from, &to, &limits) <= time_s * (1.0 + 1e-12), "{time_s} {states:?}");
        // Chance likes the limits: just this time may be an isolated one, which rounding hides.
        let mut nearby = (0..64).map(f64::from).flat_map(|step| [step, -step]);
        let steering = nearby
            .find_map(|step| steer_in(&from, &to, &limits, time_s * (1.0 + step * f64::EPSILON)))
            .unwrap_or_else(|| panic!("{states:?}"));
        assert!(steering.velocity_change_m_s() <= change + 1e-9, "{change} {time_s} {states:?} {steering:?}");
        let bound = least_velocity_change_m_s(&from, &to, &limits, time_s * (1.0 + 1e-12));
        assert!(bound <= change * (1.0 + 1e-9) + 1e-9, "{bound} {change} {states:?}");
        let goal = GoalRegion {
            position: to.position + Vector3::from_fn(|_, _| coordinate(&mut random, 0.1)),
            radius_m: 0.0,
            speed_m_s: to.velocity.norm() * (1.0 + 1e-12),
            attitude: None,
        };
        let goal = GoalRegion { radius_m: (goal.position - to.position).norm() * (1.0 + 1e-12), ..goal };
        let bound_s = least_time_to_goal_s(&from, &goal, &limits);
        assert!(bound_s <= time_s * (1.0 + 1e-12), "{bound_s} {time_s}");
    }
}

/// The least duration of three axes is the least that each has, by search.
#[test]
fn three_axes_meet_in_their_first_common_duration() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let limits = limits();
    for _ in 0..2_000 {
        let (from, to) = (state(&mut random, 0.5, &limits), state(&mut random, 0.5, &limits));
        let least_s = least_time_s(&from, &to, &limits);
        for step in 0..400 {
            let time_s = least_s * f64::from(step) / 400.0;
            let is_common = (0..3).all(|axis| {
                let d = to.position[axis] - from.position[axis];
                let velocities = [from.velocity[axis], to.velocity[axis]];
                exists(d, velocities, limits.speed_m_s[axis], limits.acceleration_m_s2[axis], time_s, -1e-12)
            });
            assert!(!is_common, "{time_s} {least_s}");
        }
    }
}

#[test]
fn regions_are_reached_near_the_bound() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let limits = limits();
    let mut excess = Vec::new();
    for _ in 0..5_000 {
        let from = state(&mut random, 1.0, &limits);
        let goal = GoalRegion {
            position: Vector3::from_fn(|_, _| coordinate(&mut random, 1.0)),
            radius_m: coordinate(&mut random, 0.3).max(0.0),
            speed_m_s: coordinate(&mut random, 0.1).max(0.0),
            attitude: None,
        };
        let bound_s = least_time_to_goal_s(&from, &goal, &limits);
        let steering = steer_to_goal(&from, &goal, &limits).unwrap();
        let end = steering.pieces().last().map_or(from, |piece| {
            let t = piece.duration_s;
            let velocity = piece.start.velocity + piece.acceleration_m_s2 * t;
            let position = piece.start.position + (piece.start.velocity + velocity) * (0.5 * t);
            TranslationState { position, velocity }
        });
        check(&steering, &from, &end, &limits);
        assert!((end.position - goal.position).norm() <= goal.radius_m + 1e-13);
        assert!(end.velocity.norm() <= goal.speed_m_s + 1e-13);
        assert!(bound_s <= steering.duration_s() * (1.0 + 1e-12), "{from:?} {goal:?} {bound_s}");
        let at_center = TranslationState::at_rest(goal.position);
        assert!(steering.duration_s() <= least_time_s(&from, &at_center, &limits));
        if goal.radius_m == 0.0 && goal.speed_m_s == 0.0 {
            assert!((bound_s - steering.duration_s()).abs() <= 1e-12 * bound_s);
        } else {
            excess.push(steering.duration_s() / bound_s.max(0.1));
        }
    }
    excess.sort_by(f64::total_cmp);
    let (median, most) = (excess[excess.len() / 2], excess[excess.len() * 99 / 100]);
    println!("duration over bound: median {median}, 99 % {most}, worst {}", excess[excess.len() - 1]);
    assert!(median < 1.05, "{median}");
}

/// The bound on the change of velocity along one axis is attained, by search over all durations.
#[test]
fn the_least_change_of_velocity_is_attained() {
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let limits = limits();
    for _ in 0..1_000 {
        let (v0, v1) = (coordinate(&mut random, 0.1), coordinate(&mut random, 0.1));
        let (from, to) = (along_x(0.0, v0), along_x(coordinate(&mut random, 0.6), v1));
        let latest_s = between(&mut random, 0.5, 2.0) * least_time_s(&from, &to, &limits);
        let bound = least_velocity_change_m_s(&from, &to, &limits, latest_s);
        let tried = (0..=2000).map(|step| latest_s * f64::from(step) / 2000.0);
        let motions = tried.filter_map(|time_s| steer_in(&from, &to, &limits, time_s));
        let best = motions.map(|motion| motion.velocity_change_m_s()).fold(f64::INFINITY, f64::min);
        assert!(bound <= best + 1e-15);
        assert!(best <= bound + 2e-3 || best.is_infinite(), "{bound} {best} {from:?} {to:?} {latest_s}");
        let ever = least_velocity_change_m_s(&from, &to, &limits, f64::INFINITY);
        let late = least_velocity_change_m_s(&from, &to, &limits, 1e9);
        assert!(ever <= late && late <= ever + 1e-8, "{ever} {late}");
    }
}

fn reversed(state: &TranslationState) -> TranslationState {
    TranslationState { position: state.position, velocity: -state.velocity }
}

#[test]
fn reversing_time_scaling_and_widening_do_what_they_must() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let limits = limits();
    let same = |one: f64, other: f64| (one - other).abs() <= 1e-12 * one.max(other);
    for _ in 0..20_000 {
        let (from, to) = (state(&mut random, 1.0, &limits), state(&mut random, 1.0, &limits));
        let least_s = least_time_s(&from, &to, &limits);
        assert!(same(least_time_s(&reversed(&to), &reversed(&from), &limits), least_s), "{from:?} {to:?}");
        let [length, time] = [0, 1].map(|_| [1.0, 1e1, 1e2, 1e3, 1e5, 1e7, 1e9, 1e-6][random.next_u32() as usize % 8]);
        let scaled = |state: &TranslationState| TranslationState {
            position: state.position * length,
            velocity: state.velocity * (length / time),
        };
        let scaled_limits = TranslationLimits {
            position: AlignedBox::between(limits.position.lower_world * length, limits.position.upper_world * length),
            speed_m_s: limits.speed_m_s * (length / time),
            acceleration_m_s2: limits.acceleration_m_s2 * (length / (time * time)),
        };
        let scaled_s = least_time_s(&scaled(&from), &scaled(&to), &scaled_limits);
        assert!(same(scaled_s / time, least_s), "{scaled_s} {least_s} {length} {time} {from:?} {to:?}");
        let mut wider = limits;
        wider.speed_m_s *= between(&mut random, 1.0, 2.0);
        wider.acceleration_m_s2 *= between(&mut random, 1.0, 2.0);
        // More force never takes more time on one axis; on three a gap may open, so each is asked alone.
        for axis in 0..3 {
            let alone = |state: &TranslationState| {
                let (mut position, mut velocity) = (Vector3::zeros(), Vector3::zeros());
                (position[axis], velocity[axis]) = (state.position[axis], state.velocity[axis]);
                TranslationState { position, velocity }
            };
            let (from, to) = (alone(&from), alone(&to));
            let narrow_s = least_time_s(&from, &to, &limits);
            assert!(least_time_s(&from, &to, &wider) <= narrow_s * (1.0 + 1e-12));
        }
        // On the way the rest of the least time is least, and a way through anywhere else takes no less.
        let steering = steer(&from, &to, &limits).unwrap();
        if let Some(piece) = steering.pieces().get(1) {
            let passed_s = steering.pieces()[0].duration_s;
            let left_s = least_time_s(&piece.start, &to, &limits);
            assert!(left_s <= (least_s - passed_s) * (1.0 + 1e-12) + 1e-12, "{left_s} {least_s} {passed_s}");
        }
        let through = state(&mut random, 1.0, &limits);
        let detour_s = least_time_s(&from, &through, &limits) + least_time_s(&through, &to, &limits);
        assert!(detour_s >= least_s * (1.0 - 1e-12), "{detour_s} {least_s}");
    }
}

/// Who leaves the box in the least time leaves it in any.
#[test]
fn the_box_is_kept_or_there_is_no_motion_at_all() {
    let mut random = ChaCha8Rng::seed_from_u64(8);
    let mut limits = limits();
    limits.position = AlignedBox::between(Vector3::repeat(-0.3), Vector3::repeat(0.3));
    let (mut kept, mut left) = (0, 0);
    for _ in 0..20_000 {
        let (from, to) = (state(&mut random, 0.3, &limits), state(&mut random, 0.3, &limits));
        if let Some(steering) = steer(&from, &to, &limits) {
            kept += 1;
            check(&steering, &from, &to, &limits);
            for piece in steering.pieces() {
                for step in 0..=20 {
                    let t = piece.duration_s * f64::from(step) / 20.0;
                    let position =
                        piece.start.position + (piece.start.velocity + piece.acceleration_m_s2 * (0.5 * t)) * t;
                    assert!(position.amax() <= 0.3 + 1e-14);
                }
            }
        } else {
            left += 1;
            let least_s = least_time_s(&from, &to, &limits);
            for _ in 0..20 {
                assert!(steer_in(&from, &to, &limits, least_s * between(&mut random, 1.0, 4.0)).is_none());
            }
            // Some axis cannot stop in time, forwards or backwards.
            let cannot_stop = (0..3).any(|axis| {
                let stop = |state: &TranslationState, sign: f64| {
                    let velocity = state.velocity[axis] * sign;
                    let turn = state.position[axis] + 0.5 * velocity * velocity.abs() / limits.acceleration_m_s2[axis];
                    turn.abs() > 0.3
                };
                stop(&from, 1.0) || stop(&to, -1.0)
            });
            assert!(cannot_stop, "{from:?} {to:?}");
        }
    }
    assert!(kept > 500 && left > 500, "{kept} {left}");
}

#[test]
fn a_table_needs_no_force_and_no_height() {
    let mut limits = limits();
    limits.position = AlignedBox::between(Vector3::new(-1.0, -1.0, -0.67), Vector3::new(1.0, 1.0, -0.67));
    (limits.acceleration_m_s2.z, limits.speed_m_s.z) = (0.0, 0.0);
    let from = TranslationState::at_rest(Vector3::new(0.0, 0.0, -0.67));
    let to = TranslationState::at_rest(Vector3::new(0.5, 0.2, -0.67));
    let steering = steer(&from, &to, &limits).unwrap();
    check(&steering, &from, &to, &limits);
    assert!((steering.duration_s() - 10.0).abs() < 1e-13, "5 s to 0.1 m/s and back make 0.5 m");
    let slower = steer_in(&from, &to, &limits, 25.0).unwrap();
    check(&slower, &from, &to, &limits);
    let above = TranslationState::at_rest(Vector3::new(0.5, 0.2, -0.66));
    assert!(steer(&from, &above, &limits).is_none() && least_time_s(&from, &above, &limits).is_infinite());
    let rising = TranslationState { velocity: Vector3::new(0.0, 0.0, 0.01), ..to };
    assert!(least_time_s(&from, &rising, &limits).is_infinite());
    let region = |position| GoalRegion { position, radius_m: 0.1, speed_m_s: 0.0, attitude: None };
    assert!(steer_to_goal(&from, &region(to.position), &limits).unwrap().duration_s() < 9.5);
    assert!(least_time_to_goal_s(&from, &region(Vector3::new(0.5, 0.2, -0.5)), &limits).is_infinite());
    assert_eq!(steer(&from, &from, &limits).unwrap().pieces().len(), 0);
}

fn motion_limits() -> MotionLimits {
    MotionLimits {
        position: AlignedBox::between(Vector3::repeat(-1.0), Vector3::repeat(1.0)),
        speed_m_s: Vector3::repeat(0.1),
        force_n: Vector3::new(0.4, 0.2, 0.1),
        torque_n_m: Vector3::new(0.01, 0.02, 0.03),
        rate_rad_s: 0.3,
    }
}

#[test]
fn limits_that_make_no_sense_are_named() {
    let sound = motion_limits();
    assert_eq!(sound.translation(2.0).unwrap().acceleration_m_s2, Vector3::new(0.2, 0.1, 0.05));
    assert!(matches!(sound.translation(0.0), Err(PlanningError::NotPositive { .. })));
    assert!(matches!(sound.translation(f64::NAN), Err(PlanningError::NotFinite { .. })));
    let with = |change: fn(&mut MotionLimits)| {
        let mut limits = sound;
        change(&mut limits);
        limits.translation(2.0).unwrap_err()
    };
    assert!(matches!(with(|l| l.speed_m_s.y = -0.1), PlanningError::Negative { .. }));
    assert!(matches!(with(|l| l.force_n.z = f64::INFINITY), PlanningError::NotFinite { .. }));
    assert!(matches!(with(|l| l.position.lower_world.x = f64::NAN), PlanningError::NotFinite { .. }));
    assert!(matches!(with(|l| l.position.lower_world.x = 2.0), PlanningError::EmptyBox { axis: 0, .. }));
}

/// Whatever the numbers, there is an answer, and a finite one where there is a motion.
#[test]
fn no_number_panics() {
    let special =
        [0.0, -0.0, 1.0, -1.0, 0.1, f64::MIN_POSITIVE, 5e-324, 1e-160, 1e160, f64::MAX, f64::INFINITY, f64::NAN];
    let mut random = ChaCha8Rng::seed_from_u64(10);
    let mut draw = || match random.next_u32() as usize % 64 {
        index if index < special.len() => special[index],
        index if index % 2 == 0 => 1.0,
        _ => 0.1,
    };
    let mut found = 0;
    for _ in 0..200_000 {
        let mut vector = || Vector3::from_fn(|_, _| draw());
        let from = TranslationState { position: vector(), velocity: vector() };
        let to = TranslationState { position: vector(), velocity: vector() };
        let position = AlignedBox { lower_world: -vector() * 2.0, upper_world: vector() * 2.0 };
        let limits = TranslationLimits { position, speed_m_s: vector(), acceleration_m_s2: vector() };
        let goal = GoalRegion { position: vector(), radius_m: draw(), speed_m_s: draw(), attitude: None };
        let least_s = least_time_s(&from, &to, &limits);
        assert!(least_s >= 0.0);
        assert!(least_time_to_goal_s(&from, &goal, &limits) >= 0.0);
        let motions =
            [steer(&from, &to, &limits), steer_in(&from, &to, &limits, draw()), steer_to_goal(&from, &goal, &limits)];
        for motion in motions.iter().flatten() {
            found += 1;
            assert!(motion.duration_s().is_finite() && motion.pieces().iter().all(|piece| piece.duration_s > 0.0));
        }
        let _ = least_velocity_change_m_s(&from, &to, &limits, draw());
        let _ = motion_limits().translation(draw());
    }
    assert!(found > 1_000, "{found}");
}

/// Along one axis the bound to a region is the least over the states of the region, by a grid of them.
#[test]
fn along_one_axis_the_bound_to_a_region_is_attained() {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let limits = limits();
    for _ in 0..300 {
        let from = along_x(coordinate(&mut random, 1.0), coordinate(&mut random, 0.1));
        let (radius_m, speed_m_s) = (coordinate(&mut random, 0.3).abs(), coordinate(&mut random, 0.1).abs());
        let goal = GoalRegion { position: Vector3::zeros(), radius_m, speed_m_s, attitude: None };
        let bound_s = least_time_to_goal_s(&from, &goal, &limits);
        let is_inside = from.position.norm() <= radius_m && from.velocity.norm() <= speed_m_s;
        let mut least_s = if is_inside { 0.0 } else { f64::INFINITY };
        for place in -100..=100 {
            for pace in -50..=50 {
                let to = along_x(radius_m * f64::from(place) / 100.0, speed_m_s * f64::from(pace) / 50.0);
                least_s = least_s.min(least_time_s(&from, &to, &limits));
            }
        }
        assert!(bound_s <= least_s * (1.0 + 1e-12), "{bound_s} {least_s} {from:?} {goal:?}");
        // One step of the grid: a hundredth of the radius at some speed, or a fiftieth of the speed.
        let step_s = f64::sqrt(4.0 * radius_m / 100.0 / limits.acceleration_m_s2.x)
            + speed_m_s / 50.0 / limits.acceleration_m_s2.x;
        assert!(least_s <= bound_s + step_s + 1e-12, "{bound_s} {least_s} {from:?} {goal:?}");
        let steering = steer_to_goal(&from, &goal, &limits).unwrap();
        assert!(steering.duration_s() <= bound_s * (1.0 + 2e-4) + 1e-9, "{} {bound_s}", steering.duration_s());
    }
}
