use super::erring_thrusters::THRUSTERS;
use super::filtered::in_chart;
use super::flight_motion::{
    ACCELERATION_BIAS, ACCELERATION_SCALE, BIAS, BODY, COORDINATES, Covariance, DRIFT, FlightMotion, FlightState,
    Fresh, Shown, THRUST, Vector, WANDER,
};
use super::settings::FlightEstimatorSettings;
use super::slow_errors::{GaussMarkov, SlowErrors};
use super::wrench_history::Held;
use crate::Estimate;
use crate::dynamics::{InertialParameters, LogCholesky, RigidBodyState};
use crate::estimator::{Gauss, Measurement, standard_deviations};
use crate::lie::{LieGroup, Manifold, Pose, Twist, Wrench};
use crate::recursive::MotionNoise;
use crate::recursive::joint_motion::JointState;
use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3, Vector6};

fn model(planar: bool) -> FlightMotion {
    let noise = MotionNoise {
        attitude_rad: 1e-3,
        position_m: 1e-3,
        rate_rad_s: 1e-3,
        velocity_m_s: 1e-3,
        acceleration_m_s2: 1.0,
        torque_n_m: 0.0,
        force_n: 0.0,
        drift: SVector::zeros(),
    };
    let mut settings = FlightEstimatorSettings { planar, ..FlightEstimatorSettings::new(noise) };
    settings.wrench.drift = Vector6::zeros();
    let wander = |sigma| GaussMarkov { sigma, time_s: 0.5 };
    settings.slow = SlowErrors {
        attitude: wander(0.1),
        position: wander(0.2),
        velocity: wander(0.3),
        rate_bias_rad_s: 0.1,
        rate_bias_walk: 0.5,
        acceleration_bias_walk: 0.3,
        lever_arm_body_m: Vector3::new(0.1, -0.2, 0.3),
        gravity_added_world_m_s2: Vector3::new(0.0, 0.0, 9.8),
        ..SlowErrors::NONE
    };
    FlightMotion::new(&settings)
}

fn state(planar: bool) -> FlightState {
    let body = LogCholesky::from_vector(&SVector::from([1.8, 0.05, -0.03, 0.04, -2.0, -2.2, -2.1, 0.01, -0.02, 0.015]));
    let flat = if planar { 0.0 } else { 1.0 };
    let motion = RigidBodyState {
        world_from_body: Pose::exp(&Vector6::new(0.3 * flat, -0.4 * flat, 0.7, 0.1, 0.2, -0.3 * flat)),
        twist_body: Twist::new(Vector3::new(0.3 * flat, -0.2 * flat, 0.5), Vector3::new(0.1, -0.05, 0.2 * flat)),
    };
    let thrust = SVector::from([0.1, 0.2, -0.1, 0.05, 0.15, -0.2, 0.07, -0.12, 0.03, -0.08, 0.11, 0.09]);
    let drift = Vector6::repeat(0.02);
    let wander =
        [Vector3::new(0.02, -0.03, 0.01) * flat, Vector3::new(0.05, 0.02, -0.04), Vector3::new(-0.01, 0.03, 0.02)];
    let bias = Vector3::new(0.01, -0.02, 0.03);
    let (acceleration_bias, acceleration_scale) = (Vector3::new(0.02, 0.01, -0.03), Vector3::new(0.1, -0.2, 0.05));
    FlightState {
        joint: JointState { motion, body },
        drift,
        thrust,
        wander,
        bias,
        acceleration_bias,
        acceleration_scale,
    }
}

fn wrench() -> Held {
    let wrench = Wrench::new(Vector3::new(0.02, -0.03, 0.04), Vector3::new(0.5, -0.3, 0.4));
    Held { wrench, stored: Vector3::new(0.05, -0.2, 0.1) }
}

/// The covariance after a step against the spread of states moved along each coordinate.
#[test]
fn predicted_covariance_is_what_the_step_makes_of_a_spread() {
    for planar in [false, true] {
        let (model, start, step_s) = (model(planar), state(planar), 0.01);
        let end = model.propagate(&start, &wrench(), step_s).unwrap();
        let mut slopes = SMatrix::<f64, COORDINATES, COORDINATES>::zeros();
        for j in 0..COORDINATES {
            let moved =
                |size: f64| model.propagate(&start.moved_by(&(Vector::ith(j, size))), &wrench(), step_s).unwrap();
            let (up, down) = (moved(1e-5), moved(-1e-5));
            let mut slope = Vector::zeros();
            let joint = (up.joint.ominus(&end.joint) - down.joint.ominus(&end.joint)) / 2e-5;
            slope.fixed_rows_mut::<22>(0).copy_from(&joint);
            slope.fixed_rows_mut::<6>(DRIFT).copy_from(&((up.drift - down.drift) / 2e-5));
            slope.fixed_rows_mut::<THRUSTERS>(THRUST).copy_from(&((up.thrust - down.thrust) / 2e-5));
            for k in 0..3 {
                slope.fixed_rows_mut::<3>(WANDER + 3 * k).copy_from(&((up.wander[k] - down.wander[k]) / 2e-5));
            }
            slope.fixed_rows_mut::<3>(BIAS).copy_from(&((up.bias - down.bias) / 2e-5));
            let bias = (up.acceleration_bias - down.acceleration_bias) / 2e-5;
            slope.fixed_rows_mut::<3>(ACCELERATION_BIAS).copy_from(&bias);
            let scale = (up.acceleration_scale - down.acceleration_scale) / 2e-5;
            slope.fixed_rows_mut::<3>(ACCELERATION_SCALE).copy_from(&scale);
            slopes.set_column(j, &slope);
        }
        // Full, positive, and where the plane is all there is nothing out of it.
        let root = Covariance::from_fn(|i, j| if i == j { 1.0 } else { 0.1 * ((i * 7 + j * 3) as f64).sin() });
        let mut start_covariance = root * root.transpose();
        if planar {
            for i in [0, 1, 5, 6, 7, 11] {
                start_covariance.row_mut(i).fill(0.0);
                start_covariance.column_mut(i).fill(0.0);
            }
        }
        let mut expected = slopes * start_covariance * slopes.transpose();
        let louder = [2.0, 3.0, 0.5];
        for i in 0..9 {
            let sigma = [0.1, 0.2, 0.3][i / 3];
            expected[(WANDER + i, WANDER + i)] +=
                louder[i / 3] * sigma * sigma * (1.0 - (-2.0 * step_s / 0.5_f64).exp());
        }
        for i in 0..3 {
            expected[(BIAS + i, BIAS + i)] += 0.25 * step_s;
            expected[(ACCELERATION_BIAS + i, ACCELERATION_BIAS + i)] += 0.09 * step_s;
        }
        let (mut found_state, mut found) = (start, start_covariance);
        model.predict(&mut found_state, &mut found, &wrench(), step_s, None, &louder).unwrap();
        assert_eq!(found_state, end);
        assert!((found - expected).amax() < 1e-3, "{planar} {}", (found - expected).amax());
        assert!((found - start_covariance).amax() > 0.05);
        assert_eq!(found, found.transpose());
    }
}

/// Every column of the rows against differences of what is left, with a rate that is shown late.
#[test]
fn rows_are_the_derivatives_of_what_is_left() {
    for planar in [false, true] {
        let (model, at) = (model(planar), state(planar));
        let seen = |state: &FlightState| {
            let pose = &state.joint.motion.world_from_body;
            let off: UnitQuaternion<f64> = LieGroup::exp(&state.wander[0]);
            Measurement {
                attitude: Some(Gauss::isotropic(pose.rotation * off, 1.0)),
                position_world: Some(Gauss::isotropic(pose.translation.vector + state.wander[1], 1.0)),
                rate_body: Some(Gauss::isotropic(state.joint.motion.twist_body.angular + state.bias, 1.0)),
                velocity_world: Some(Gauss::isotropic(
                    pose.rotation * state.joint.motion.twist_body.linear + state.wander[2],
                    1.0,
                )),
                acceleration_body: Some(Gauss::isotropic(Vector3::new(0.3, -0.1, 9.9), 1.0)),
                ..Measurement::default()
            }
        };
        let all = Fresh { attitude: true, position: true, rate: true, velocity: true, acceleration: true };
        let held = wrench();
        let shown = Shown { owed: Some((held, 0.077)), acceleration: Some(held), samples: [1.0; 2], about: None };
        let rows = |state: &FlightState| model.rows::<15>(state, &seen(&at), all, &shown);
        let (here, mut differs) = (rows(&at), 0.0_f64);
        for j in 0..COORDINATES {
            if planar && (0..12).contains(&j) && [0, 1, 5, 6, 7, 11].contains(&j) {
                continue;
            }
            let moved = |size: f64| rows(&at.moved_by(&Vector::ith(j, size))).residual;
            let slope = (moved(-1e-6) - moved(1e-6)) / 2e-6;
            for i in (0..15).filter(|i| here.standard_deviation[*i].is_finite()) {
                differs = differs.max((slope[i] - here.sensitivity[(i, j)]).abs());
            }
        }
        assert!(differs < 2e-3, "{planar} {differs}");
        // What the filter has not shown is what the wrench changes the rate by: by a step of that wrench, to second order.
        let (later, now) = (model.propagate(&at, &held, 1e-4).unwrap(), at.joint.motion.twist_body.angular);
        let missing = (later.joint.motion.twist_body.angular - now) * (0.077 / 1e-4);
        let differs = here.residual.fixed_rows::<3>(6) - missing;
        assert!(differs.z.abs() < 1e-3 * missing.z.abs() && missing.z.abs() > 1e-3, "{planar} {differs}");
        assert!(planar || differs.amax() < 1e-3 * missing.amax(), "{differs}");
    }
}

/// At the body itself an anchor changes nothing; elsewhere the end is linear in the chart.
#[test]
fn an_anchor_makes_the_step_linear_in_the_body() {
    let (model, start) = (model(false), state(false));
    let anchor = start.joint.body;
    let end = |factor: f64| {
        let mut moved = start;
        let off = SVector::<f64, 10>::from_fn(|i, _| 0.1 * (i as f64 + 1.0).sin()) * factor;
        moved.joint.body = LogCholesky::from_vector(&(anchor.to_vector() + off));
        let body = moved.joint.body;
        let mut covariance = Covariance::identity();
        model.predict(&mut moved, &mut covariance, &wrench(), 0.01, Some(&anchor), &[1.0; 3]).unwrap();
        assert_eq!(moved.joint.body, body);
        (moved.joint.motion, covariance)
    };
    let (at, covariance) = end(0.0);
    assert_eq!(at, model.propagate(&start, &wrench(), 0.01).unwrap().joint.motion);
    let (one, two) = (end(1.0).0.ominus(&at), end(2.0).0.ominus(&at));
    assert!((one * 2.0 - two).amax() < 1e-12 && one.amax() > 1e-4);
    assert_eq!(end(2.0).1, covariance);
    assert!(covariance.fixed_view::<BODY, 10>(0, BODY).amax() > 1e-4);
}

/// A prior with a tenth of relative uncertainty, or with half of it, about this inertia.
fn prior(diagonal: Vector3<f64>, share: f64) -> Estimate {
    let parameters = InertialParameters::about_com(10.0, Vector3::zeros(), Matrix3::from_diagonal(&diagonal));
    let size = SVector::<f64, 10>::from([10.0, 0.5, 0.5, 0.5, 0.2, 0.1, 0.1, 0.2, 0.1, 0.2]);
    let covariance = SMatrix::from_diagonal(&size.map(|x| (share * x).powi(2)));
    let std = standard_deviations(&parameters.to_vector(), &covariance);
    Estimate { parameters, covariance, std, lmi_active: false }
}

/// Ixx + Iyy is Izz but for a millionth: an extent of a millimetre, known to a decimetre. As a logarithm it would be anything.
#[test]
fn a_prior_at_the_edge_of_what_can_be_is_taken_for_an_uncertain_one() {
    let (ordinary, _) = in_chart(&prior(Vector3::new(0.2, 0.18, 0.19), 0.1)).unwrap();
    let vector = prior(Vector3::new(0.2, 0.18, 0.19), 0.1).parameters.to_vector();
    assert!((ordinary.to_parameters().to_vector() - vector).amax() < 1e-12);

    let edge = prior(Vector3::new(0.15, 0.14, 0.29 - 1e-6), 0.5);
    let (body, covariance) = in_chart(&edge).unwrap();
    let log_extents = covariance.diagonal().fixed_rows::<3>(4).map(f64::sqrt);
    assert!(log_extents.max() < 0.6 && log_extents.min() > 0.1, "{log_extents}");
    // within the prior's own uncertainty, and a body by a margin
    let moved = body.to_parameters().to_vector() - edge.parameters.to_vector();
    let within = (0..10).all(|i| moved[i].abs() <= edge.covariance[(i, i)].sqrt());
    assert!(within && moved.amax() > 0.01, "{moved}");
}

/// By hand: two thrusters of an axis and a sense bear half of a force each, their difference turns by their arm.
#[test]
fn thrusters_share_their_errors() {
    let usual = FlightEstimatorSettings::of_poses(1e-3, 1e-3, 0.04).wrench;
    for (pushing, shared) in [(1, 0.02), (4, 0.01)] {
        let errors = usual.of_thrusters(0.02, pushing, 0.3);
        assert_eq!(errors.drift, usual.drift);
        let deviation = |wrench: Vector6<f64>| {
            let each = super::ErringThruster::errors_of(&errors.thrusters, &wrench);
            (each * each.transpose()).diagonal().map(f64::sqrt)
        };
        let (pushed, turned) = (deviation(Vector6::ith(3, 1.0)), deviation(Vector6::ith(2, 1.0)));
        let by_hand = Vector6::new(0.0, 0.0, 0.3 * shared, shared, 0.0, 0.0);
        assert!((pushed - by_hand).amax() < 1e-12, "{pushing} {pushed}");
        let by_hand = Vector6::new(0.0, 0.0, shared, shared / 0.3, 0.0, 0.0);
        assert!((turned - by_hand).amax() < 1e-12, "{pushing} {turned}");
    }
}

/// What has to be asked of thrusters that err so that a wrench comes.
#[test]
fn erring_thrusters_are_asked_for_what_makes_the_wrench() {
    for planar in [false, true] {
        let (model, state) = (model(planar), state(planar));
        let wanted = wrench().wrench;
        let held = Held { wrench: model.asked(&state, &wanted), stored: Vector3::zeros() };
        let mut off = (model.acting(&state, &held).to_vector() - wanted.to_vector()).abs();
        if planar {
            for i in [0, 1, 5] {
                off[i] = held.wrench.to_vector()[i];
            }
        }
        assert!(off.amax() < 1e-6, "{off}");
        assert!((held.wrench.to_vector() - wanted.to_vector()).amax() > 0.02);
    }
}

/// A robot that holds its place answers the noise of its gyroscope, and does not turn by that: this says nothing of its inertia. Where the
/// torque is ten times the wrench's noise and it still does not turn, its inertia must be larger than believed.
#[test]
fn a_body_at_rest_is_no_larger_for_not_obeying_noise() {
    let believed = prior(Vector3::new(0.2, 0.18, 0.19), 0.3);
    let after = |torque_n_m: f64| {
        let mut settings = FlightEstimatorSettings::of_poses(1e-3, 1e-3, 0.016);
        (settings.noise.rate_rad_s, settings.noise.torque_n_m) = (1e-5, 1e-4);
        let mut estimator = super::FlightEstimator::try_new(settings, RigidBodyState::at_rest(), 0, &believed).unwrap();
        for k in 1..190_i64 {
            let (from_ns, now_ns, wave) = ((k - 1) * 16_000_000, k * 16_000_000, (1.1 * k as f64).sin());
            let torque = Vector3::new(0.0, 0.0, torque_n_m * if k % 100 < 50 { 1.0 } else { -1.0 });
            estimator.acted(from_ns, now_ns, &Wrench::new(torque, Vector3::zeros()));
            estimator.measured(&super::FlightMeasurement {
                stamp_ns: now_ns,
                world_from_body: Pose::translation(1e-4 * wave, -1e-4 * wave, 1e-4 * wave),
                rate_body: Some(Vector3::new(1e-6 * wave, -1e-6 * wave, 1e-6 * wave)),
                velocity_origin_world: None,
            });
        }
        estimator.estimate().parameters.inertia_about_com()[(2, 2)] / 0.19
    };
    assert!((after(2e-4) - 1.0).abs() < 1e-3, "{}", after(2e-4));
    assert!(after(2e-3) > 1.3, "{}", after(2e-3));
}

/// A wrench that was in doubt still is, and the motion was that of other forces.
#[test]
fn a_filter_that_begins_anew_holds_a_doubted_wrench_for_as_doubtful() {
    let known = prior(Vector3::new(0.2, 0.18, 0.19), 0.05);
    let settings = FlightEstimatorSettings::of_poses(1e-4, 1e-4, 0.016);
    let mut estimator = super::FlightEstimator::try_new(settings, RigidBodyState::at_rest(), 0, &known).unwrap();
    let drift = |estimator: &super::FlightEstimator| estimator.newest().covariance[(DRIFT, DRIFT)].sqrt();
    for k in 1..400_i64 {
        estimator.acted((k - 1) * 16_000_000, k * 16_000_000, &Wrench::zero());
        let place = Pose::translation(1e-5 * (1.1 * k as f64).sin(), 0.0, 0.0);
        estimator.measured(&super::FlightMeasurement {
            stamp_ns: k * 16_000_000,
            world_from_body: place,
            rate_body: None,
            velocity_origin_world: None,
        });
    }
    let before = estimator.motion_covariance();
    estimator.restart(&known).unwrap();
    assert!((estimator.motion_covariance() - before).amax() < 1e-12);
    assert!(drift(&estimator) <= 1.01 * settings.wrench.drift[0], "{}", drift(&estimator));
    for _ in 0..2 {
        estimator.wrench_doubtful();
        estimator.restart(&known).unwrap();
        let after = estimator.motion_covariance();
        for (i, start) in settings.start_deviation.iter().flat_map(|s| [s; 3]).enumerate() {
            assert!(before[(i, i)] < 0.5 * start * start && after[(i, i)] >= start * start, "{i} {before} {after}");
        }
        assert!(drift(&estimator) >= settings.wrench.doubted().drift[0], "{}", drift(&estimator));
    }
}

/// Whatever the filter was led to: a closed loop has it begin anew.
#[test]
fn a_body_a_hundred_times_as_heavy_or_ten_times_as_long_is_no_body() {
    let unknown = prior(Vector3::new(0.2, 0.18, 0.19), 0.5);
    let settings = FlightEstimatorSettings::of_poses(1e-4, 1e-4, 0.016);
    let mut estimator = super::FlightEstimator::try_new(settings, RigidBodyState::at_rest(), 0, &unknown).unwrap();
    // mass, and square of the length
    let grown = |mass: f64, square: f64| {
        let mut grown = unknown;
        grown.parameters = InertialParameters::about_com(
            10.0 * mass,
            Vector3::zeros(),
            Matrix3::from_diagonal(&Vector3::new(0.2, 0.18, 0.19)) * (mass * square),
        );
        grown.covariance *= mass * mass;
        grown
    };
    for (mass, square, is_none) in [(50.0, 1.0, false), (200.0, 1.0, true), (1.0, 50.0, false), (1.0, 200.0, true)] {
        estimator.restart(&grown(mass, square)).unwrap();
        let begun_ns = estimator.newest().stamp_ns;
        for k in 1..20_i64 {
            let now_ns = begun_ns + k * 16_000_000;
            estimator.acted(now_ns - 16_000_000, now_ns, &Wrench::zero());
            estimator.measured(&super::FlightMeasurement {
                stamp_ns: now_ns,
                world_from_body: Pose::translation(1e-5 * (1.1 * k as f64).sin(), 0.0, 0.0),
                rate_body: None,
                velocity_origin_world: None,
            });
        }
        assert_eq!(estimator.health().diverged, is_none, "{mass} {square}");
    }
}

/// Pushes a body of ten kilograms and sees one of twenty.
fn push_twice_the_mass(estimator: &mut super::FlightEstimator, ticks: core::ops::Range<i64>) {
    for k in ticks {
        let (now_ns, t) = (k * 16_000_000, 0.016 * k as f64);
        estimator.acted(now_ns - 16_000_000, now_ns, &Wrench::new(Vector3::zeros(), Vector3::new(2.0, 0.0, 0.0)));
        estimator.measured(&super::FlightMeasurement {
            stamp_ns: now_ns,
            world_from_body: Pose::translation(t * t / 20.0, 1e-5 * (1.1 * k as f64).sin(), 0.0),
            rate_body: None,
            velocity_origin_world: None,
        });
    }
}

/// Thrusters in doubt may give half as much again, or half; the body is what was known of it before, and keeps to that where it was known.
#[test]
fn a_wrench_in_doubt_leaves_the_body_as_it_was() {
    let settings = FlightEstimatorSettings::of_poses(1e-4, 1e-4, 0.016);
    for (share, is_held) in [(0.05, true), (0.5, false)] {
        let known = prior(Vector3::new(0.2, 0.18, 0.19), share);
        let mut estimator = super::FlightEstimator::try_new(settings, RigidBodyState::at_rest(), 0, &known).unwrap();
        let deviation = |estimator: &super::FlightEstimator, i: usize| estimator.newest().covariance[(i, i)].sqrt();
        let known = estimator.estimate();
        estimator.body_changed(&super::grasp_or_release());
        assert!(deviation(&estimator, BODY) > 0.3, "{}", deviation(&estimator, BODY));
        estimator.wrench_doubtful();
        let before = estimator.estimate();
        assert!((before.parameters.to_vector() - known.parameters.to_vector()).amax() < 1e-9);
        assert!((deviation(&estimator, BODY) - share).abs() < 0.02 * share);
        assert!((deviation(&estimator, THRUST) - 0.5).abs() < 1e-12);
        push_twice_the_mass(&mut estimator, 1..200);
        let moved = (estimator.estimate().parameters.mass / known.parameters.mass).ln().abs();
        assert_eq!(moved < 1e-9, is_held, "{share}: {moved}");
        assert!(deviation(&estimator, THRUST) < 0.49, "{}", deviation(&estimator, THRUST));
    }
}

/// What was learned before the wrench was doubted may be right after all, by one chance in ten; also where the estimator begins anew at that moment.
#[test]
fn a_wrench_in_doubt_may_have_been_another_body() {
    let settings = FlightEstimatorSettings::of_poses(1e-4, 1e-4, 0.016);
    for begins_anew in [false, true] {
        let known = prior(Vector3::new(0.2, 0.18, 0.19), 0.05);
        let mut estimator = super::FlightEstimator::try_new(settings, RigidBodyState::at_rest(), 0, &known).unwrap();
        estimator.body_changed(&super::grasp_or_release());
        push_twice_the_mass(&mut estimator, 1..100);
        let moved = (estimator.estimate().parameters.mass / known.parameters.mass).ln();
        assert!(moved > 0.5, "{moved}");
        if begins_anew {
            estimator.restart(&known).unwrap();
        }
        estimator.wrench_doubtful();
        let variance = estimator.newest().covariance[(BODY, BODY)];
        let wanted = 0.05 * 0.05 + 0.1 * moved * moved;
        assert!((variance / wanted - 1.0).abs() < 0.05, "{variance} {wanted}");
        assert!((estimator.estimate().parameters.mass / known.parameters.mass - 1.0).abs() < 0.01);
        push_twice_the_mass(&mut estimator, 100..300);
        assert!((estimator.estimate().parameters.mass / known.parameters.mass - 1.0).abs() < 0.01);
    }
}
