//! The log of a simulated flight: the same seed gives the same bytes.

use tumble::flight_log::Recorder;
use tumble_astrobee::propulsion::{ImpellerMode, PropulsionSettings};
use tumble_astrobee::sensing::{Localization, SensingPreset};
use tumble_astrobee::simulator::{Actuators, AstrobeeSimulator, CONTROL_PERIOD_S, SimulatorSettings};
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{Plant as _, RigidBodyState};
use tumble_lie::Wrench;

/// The robot with hardware, drag and nominal sensors.
fn complete(seed: u64) -> AstrobeeSimulator {
    let start = RigidBodyState { world_from_body: WorldPreset::Iss.pose("A").unwrap(), ..RigidBodyState::at_rest() };
    let mut settings = SimulatorSettings::ideal(WorldPreset::Iss, start);
    let mode = ImpellerMode::Nominal;
    settings.drag = Some(tumble_astrobee::air_drag::air_drag());
    settings.actuators = Actuators::hardware(mode, settings.body.center_of_mass(), PropulsionSettings::PHYSICAL);
    settings.sensors = Some(Localization::new(&SensingPreset::Nominal.settings(), seed, mode).unwrap());
    AstrobeeSimulator::try_new(settings).unwrap()
}

fn log(seed: u64) -> Vec<u8> {
    let (mut robot, mut log) = (complete(seed), Vec::new());
    let mut recorder = Recorder::new(&mut log).unwrap();
    for k in 0..500 {
        let phase = 0.01 * f64::from(k);
        let push = Wrench::new(Vector3::new(0.01 * phase.sin(), 0.0, 0.01), Vector3::new(0.2 * phase.cos(), 0.1, 0.0));
        let measured = robot.advance(&push, CONTROL_PERIOD_S).unwrap();
        recorder.record(&measured, robot.estimates()).unwrap();
    }
    let (rows, left_out) = recorder.finish().unwrap();
    // What was sampled last is still on its way.
    assert!(rows >= 499 && left_out == 0, "{rows} {left_out}");
    log
}

#[test]
fn one_seed_gives_one_log_byte_for_byte() {
    let first = log(7);
    assert_eq!(first, log(7));
    assert_ne!(first, log(8));
}
