//! Tutorial: tell `identify` what acts on your satellite beside its thrusters. Three steps: say what acts, check its laws, identify
//! with it.

use crate::exact_motion::Multisine;
use crate::random::Random;
use tumble_identification::dynamics::laws::{WrenchNature, check_wrench_model};
use tumble_identification::dynamics::{
    FreeFlyer, FreeFlyerIn, InertialParameters, Integrator, MuntheKaas4, RigidBodyState, WrenchModel,
};
use tumble_identification::lie::{Pose, Wrench};
use tumble_identification::nalgebra::{Matrix3, Vector3};
use tumble_identification::{MotionSample, Settings, identify, identify_in};

// Step 1: what acts. Sunlight presses on a panel; the wrench is in body axes, its torque about the body's origin.
struct Sunlight {
    /// Away from the sun, inertial axes.
    direction_world: Vector3<f64>,
    /// Force on the panel when it faces the sun, N.
    largest_force_n: f64,
    /// Where the panel is, and where it faces, body axes.
    panel: (Vector3<f64>, Vector3<f64>),
}

impl WrenchModel<f64> for Sunlight {
    fn wrench_body(&self, _time_s: f64, state: &RigidBodyState<f64>) -> Wrench<f64> {
        let light = state.world_from_body.rotation.inverse() * self.direction_world;
        let (place, normal) = self.panel;
        let force = light * (self.largest_force_n * light.dot(&normal).abs());
        Wrench::new(place.cross(&force), force)
    }
    // What depends on the body that is looked for (gravity gradient) belongs into `wrench_on`; sunlight does not.
}

fn sunlight() -> Sunlight {
    Sunlight {
        direction_world: Vector3::new(0.6, 0.0, 0.8),
        largest_force_n: 0.05,
        panel: (Vector3::new(1.5, 0.2, 0.0), Vector3::z()),
    }
}

// Step 2: the laws. The sun turns with the world, and neither gives nor takes energy by rule.
#[test]
fn it_keeps_the_laws() {
    let turned = |world: &Pose<f64>| -> Box<dyn WrenchModel<f64>> {
        let sunlight = sunlight();
        Box::new(Sunlight { direction_world: world.rotation * sunlight.direction_world, ..sunlight })
    };
    let states = [0.3, -0.8, 1.9].map(|turn| RigidBodyState {
        world_from_body: Pose::new(Vector3::new(turn, 2.0, -1.0), Vector3::new(0.4, turn, -0.2)),
        ..RigidBodyState::at_rest()
    });
    check_wrench_model(&turned, WrenchNature::Any, &states, 1e-12).unwrap();
}

// Step 3: identify. The record is that of a satellite under its thrusters and the sun; the log knows of the thrusters.
#[test]
fn a_satellite_is_identified_under_the_sun() {
    let inertia = Matrix3::new(10.0, 0.5, 0.0, 0.5, 25.0, 1.0, 0.0, 1.0, 20.0);
    let truth = InertialParameters::about_com(60.0, Vector3::new(0.04, -0.02, 0.01), inertia);
    let push = Multisine::random(&mut Random::new(1), 0.02, 0.1, (0.02, 0.1), 4);
    let system = FreeFlyerIn { body: FreeFlyer::new(truth), environment: sunlight() };
    let mut state = RigidBodyState::at_rest();
    let mut record = Vec::new();
    for k in 0..800_u32 {
        let time_s = f64::from(k) * 0.5;
        let wrench = push.at(time_s);
        record.push(MotionSample {
            time_ns: i64::from(k) * 500_000_000,
            world_from_body: Some(state.world_from_body),
            wrench_body: Some(wrench),
            ..MotionSample::default()
        });
        state = MuntheKaas4.step(&system, &state, &wrench, time_s, 0.5).unwrap();
    }
    let settings = Settings::default();
    let error = |found: InertialParameters<f64>| {
        (found.mass / truth.mass - 1.0).abs() + (found.center_of_mass() - truth.center_of_mass()).norm()
    };
    let found = identify_in(&record, &settings, &sunlight()).unwrap().estimate.unwrap();
    assert!(error(found.parameters) < 1e-4, "{:?}", found.parameters);
    let unaware = identify(&record, &settings).unwrap();
    assert!(unaware.estimate.is_none_or(|found| error(found.parameters) > 1e-2));
}
