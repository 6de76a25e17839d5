//! Laws of exact steering.

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use tumble_dynamics::AlignedBox;
use tumble_planning::TranslationState;
use tumble_planning::nalgebra::Vector3;
use tumble_planning::steering::{Steering, TranslationLimits, least_time_s, steer, steer_in};

/// Uniform in `[low, high)`.
fn uniform(random: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * (random.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

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
        _ => uniform(random, -limit, limit),
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
        let duration_s = steering.duration_s() * uniform(&mut random, 1.0, 3.0);
        if let Some(slower) = steer_in(&from, &to, &limits, duration_s) {
            check(&slower, &from, &to, &limits);
        }
    }
}
