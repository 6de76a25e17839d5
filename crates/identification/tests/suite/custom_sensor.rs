//! Tutorial: bring your own sensor. Two steps: say what it shows of a motion, hand its numbers to an estimator in flight.
//!
//! The one here measures how far the body is from three beacons. Nothing else tells where it is.

use std::sync::Arc;
use tumble_identification::dynamics::{InertialParameters, RigidBodyState};
use tumble_identification::estimator::{Acted, Gauss, Measurement, Sensor, StateEstimator};
use tumble_identification::lie::Wrench;
use tumble_identification::nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};
use tumble_identification::noise::Gaussian;
use tumble_identification::recursive::{FlightEstimator, FlightEstimatorSettings, Reception};
use tumble_identification::{Estimate, StandardDeviations};

// Step 1: what it shows. Angles would wrap in `residual`; derivatives are taken by differences unless `sensitivity` gives them.
#[derive(Debug)]
struct Ranges {
    beacons_world: [Vector3<f64>; 3],
}

impl Sensor for Ranges {
    fn predicted(&self, state: &RigidBodyState<f64>) -> Vector3<f64> {
        let position = state.world_from_body.translation.vector;
        Vector3::from(self.beacons_world.map(|beacon| (position - beacon).norm()))
    }
}

const RANGE_M: f64 = 0.005;
const ATTITUDE_RAD: f64 = 1e-3;
const PERIOD_NS: i64 = 100_000_000;
const PERIODS: i64 = 200;
const MASS_KG: f64 = 10.0;
const FORCE_N: f64 = 0.1;

/// Of a body that is believed a fifth too heavy.
fn estimator() -> FlightEstimator {
    let parameters = InertialParameters::solid_box(1.2 * MASS_KG, [0.3, 0.3, 0.3]);
    let deviations = parameters.to_vector().map(|x: f64| 0.2 * x.abs() + 0.01);
    let covariance = SMatrix::from_diagonal(&deviations.map(|deviation| deviation * deviation));
    let std = StandardDeviations {
        mass_kg: deviations[0],
        center_of_mass_m: Vector3::repeat(0.01),
        inertia_about_com_kg_m2: Matrix3::repeat(0.02),
    };
    let prior = Estimate { parameters, covariance, std, lmi_active: false };
    let settings = FlightEstimatorSettings::of_poses(ATTITUDE_RAD, RANGE_M, 0.1);
    FlightEstimator::try_new(settings, RigidBodyState::at_rest(), 0, &prior).unwrap()
}

// Step 2: fly. What the sensor is stands beside what it showed, so that an estimator knows of neither beforehand.
#[test]
fn ranges_alone_tell_where_the_body_is_and_what_it_weighs() {
    let at = |x: f64, y: f64, z: f64| Vector3::new(x, y, z);
    let ranges = Arc::new(Ranges { beacons_world: [at(4.0, 1.0, 0.0), at(-1.0, 3.0, 1.0), at(1.0, -2.0, 3.0)] });
    let (mut told, mut blind) = (estimator(), estimator());
    let mut random = Gaussian::from_seed(1);
    let push = Wrench::new(Vector3::zeros(), Vector3::x() * FORCE_N);
    let mut truth = RigidBodyState::at_rest();
    for k in 1..=PERIODS {
        let stamp_ns = k * PERIOD_NS;
        let time_s = stamp_ns as f64 * 1e-9;
        truth.world_from_body.translation.vector.x = 0.5 * FORCE_N / MASS_KG * time_s * time_s;
        let attitude = UnitQuaternion::from_scaled_axis(random.vector(ATTITUDE_RAD));
        let seen = Measurement {
            stamp_ns,
            attitude: Some(Gauss::isotropic(attitude, ATTITUDE_RAD)),
            ..Measurement::default()
        };
        let shown = Gauss::isotropic(ranges.predicted(&truth) + random.vector(RANGE_M), RANGE_M);
        let acted = Acted {
            from_ns: stamp_ns - PERIOD_NS,
            until_ns: stamp_ns,
            wrench_body: push,
            stored_body: Vector3::zeros(),
        };
        let ranged = Measurement { other: Some((ranges.clone(), shown)), ..seen.clone() };
        for (estimator, measurement) in [(&mut told, ranged), (&mut blind, seen)] {
            StateEstimator::acted(estimator, &acted);
            let reception = StateEstimator::measured(estimator, &measurement);
            assert!(matches!(reception, Reception::Used { .. }), "{reception:?}");
        }
    }
    let error_m = |estimator: &FlightEstimator| {
        let found = estimator.state_at(PERIODS * PERIOD_NS).world_from_body;
        (found.translation.vector - truth.world_from_body.translation.vector).norm()
    };
    assert!(error_m(&told) < 2.0 * RANGE_M, "{} m", error_m(&told));
    assert!(error_m(&blind) > 0.2, "{} m", error_m(&blind));
    let (found, unseen) = (told.estimate(), blind.estimate());
    let (mass_kg, sigma_kg) = (found.parameters.mass, found.std.mass_kg);
    assert!((mass_kg - MASS_KG).abs() < f64::min(0.2, 3.0 * sigma_kg), "{mass_kg} +- {sigma_kg} kg");
    assert!(sigma_kg < 0.1 * unseen.std.mass_kg, "{sigma_kg} kg, {} without ranges", unseen.std.mass_kg);
}
