//! Turns from rest to rest, judged by inverse dynamics.
#![allow(clippy::float_cmp)]

use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;
use tumble_dynamics::lie::Twist;
use tumble_dynamics::{AlignedBox, BodyAcceleration, FreeFlyer, InertialParameters};
use tumble_identification::noise::between;
use tumble_planning::global::MotionLimits;
use tumble_planning::nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_planning::steering::{slew, steer_in};
use tumble_planning::{BodyArc, TranslationState};

fn motion_limits() -> MotionLimits {
    MotionLimits {
        position: AlignedBox::between(Vector3::repeat(-1.0), Vector3::repeat(1.0)),
        speed_m_s: Vector3::repeat(0.1),
        force_n: Vector3::new(0.4, 0.2, 0.1),
        torque_n_m: Vector3::new(0.01, 0.02, 0.03),
        rate_rad_s: 0.3,
    }
}

/// Largest ratio of a torque component to its limit, by inverse dynamics.
fn load(body: &FreeFlyer<f64>, axis: &Vector3<f64>, rate: f64, acceleration: f64, limit: &Vector3<f64>) -> f64 {
    let twist = Twist::new(axis * rate, Vector3::zeros());
    let acceleration =
        BodyAcceleration { angular_acceleration_body: axis * acceleration, acceleration_origin_body: Vector3::zeros() };
    body.inverse(&twist, &acceleration).torque.component_div(limit).amax()
}

fn attitude(random: &mut ChaCha8Rng) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| between(random, -3.0, 3.0)))
}

#[test]
fn turns_use_the_torque_there_is_and_no_more() {
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let mut bound_by_rate = 0;
    for _ in 0..300 {
        let root = Matrix3::from_fn(|_, _| between(&mut random, -0.3, 0.3));
        let inertia = (root * root.transpose() + Matrix3::identity() * 0.01) * between(&mut random, 0.1, 3.0);
        let body = FreeFlyer::new(InertialParameters::about_com(2.0, Vector3::zeros(), inertia));
        let limits = MotionLimits {
            torque_n_m: Vector3::from_fn(|_, _| between(&mut random, 0.001, 0.03)),
            rate_rad_s: between(&mut random, 0.05, 2.0),
            ..motion_limits()
        };
        let (from, to) = (attitude(&mut random), attitude(&mut random));
        let turn = slew(&from, &to, &inertia, &limits).unwrap().unwrap();
        let (axis, peak) = (turn.axis_body().into_inner(), turn.rate_rad_s());
        assert!(turn.attitude_at(turn.duration_s()).angle_to(&to) < 1e-14);
        bound_by_rate += usize::from(peak == limits.rate_rad_s);

        let slower = turn.stretched(turn.duration_s() * between(&mut random, 1.0, 3.0)).unwrap();
        assert!(turn.stretched(turn.duration_s() * 0.999).is_none());
        let flight_limits = limits.translation(2.0).unwrap();
        let start = TranslationState::at_rest(Vector3::new(0.1, 0.2, 0.3));
        let end = TranslationState::at_rest(Vector3::new(0.11, 0.18, 0.3));
        for turn in [turn, slower] {
            let Some(flight) = steer_in(&start, &end, &flight_limits, turn.duration_s()) else { continue };
            let arcs: Vec<BodyArc> = turn.along(&flight).unwrap().collect();
            let (mut elapsed_s, mut attitude, mut rate, mut state) = (0.0, from, 0.0, start);
            for arc in &arcs {
                assert!(arc.attitude.angle_to(&attitude) < 1e-14 && (arc.turn(0.0).1 - rate).abs() < 1e-13);
                assert!((arc.translation(0.0).0.position - state.position).amax() < 1e-14);
                assert!((arc.translation(0.0).0.velocity - state.velocity).amax() < 1e-14);
                for step in 0..=4 {
                    let (_, rate, acceleration) = arc.turn(arc.duration_s * f64::from(step) / 4.0);
                    assert!(load(&body, &axis, rate, acceleration, &limits.torque_n_m) <= 1.0 + 1e-12);
                    assert!(rate <= limits.rate_rad_s * (1.0 + 1e-12));
                }
                attitude = arc.attitude_at(arc.duration_s);
                rate = arc.turn(arc.duration_s).1;
                state = arc.translation(arc.duration_s).0;
                elapsed_s += arc.duration_s;
            }
            assert!((elapsed_s - turn.duration_s()).abs() < 1e-12 * elapsed_s && rate.abs() < 1e-13);
            assert!(attitude.angle_to(&to) < 1e-14 && (state.position - end.position).amax() < 1e-14);
        }

        // No other trapezoid about the axis is faster.
        for step in 1..=400 {
            let rate = limits.rate_rad_s * f64::from(step) / 400.0;
            let (mut low, mut high) = (0.0, 1e3);
            for _ in 0..60 {
                let acceleration = 0.5 * (low + high);
                let most = load(&body, &axis, rate, acceleration, &limits.torque_n_m);
                let most = most.max(load(&body, &axis, rate, -acceleration, &limits.torque_n_m));
                if most <= 1.0 { low = acceleration } else { high = acceleration }
            }
            if rate * rate <= low * turn.angle_rad() {
                let duration_s = turn.angle_rad() / rate + rate / low;
                assert!(duration_s >= turn.duration_s() * (1.0 - 1e-12), "{duration_s} {turn:?}");
            }
        }
    }
    assert!((10..290).contains(&bound_by_rate), "{bound_by_rate}");
}

#[test]
fn a_turn_without_torque_or_without_an_angle() {
    let inertia = Matrix3::from_diagonal(&Vector3::new(0.1, 0.2, 0.3));
    let (from, to) = (UnitQuaternion::identity(), UnitQuaternion::from_scaled_axis(Vector3::x() * 0.7));
    let powerless = MotionLimits { torque_n_m: Vector3::new(0.0, 1.0, 1.0), ..motion_limits() };
    assert!(slew(&from, &to, &inertia, &powerless).unwrap().is_none());
    assert_eq!(slew(&from, &from, &inertia, &powerless).unwrap().unwrap().duration_s(), 0.0);
    // About a principal axis of a table nothing else is needed: 0.01 N m on 0.1 kg m^2, 0.3 rad/s at most.
    let turn = slew(&from, &to, &inertia, &motion_limits()).unwrap().unwrap();
    assert!((turn.duration_s() - 2.0 * f64::sqrt(0.7 / 0.1)).abs() < 1e-13);
    assert!(slew(&from, &to, &inertia, &MotionLimits { rate_rad_s: f64::NAN, ..powerless }).is_err());
    assert!(slew(&from, &to, &-inertia, &powerless).is_err());
}
