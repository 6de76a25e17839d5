//! Prints a hash of every byte of a simulated flight: flown controller, propulsion hardware, air drag, sensors as on the thesis's
//! flights, a payload taken hold of on the way.
//!
//! The output must not depend on the optimisation level or the processor: `cargo xtask ci --only determinism` runs this program
//! as tests are built and compares with what it printed as users build it.

use tumble_astrobee::air_drag::air_drag;
use tumble_astrobee::flight_controller::FlightController;
use tumble_astrobee::flight_modes::{ControlGains, FlightSite};
use tumble_astrobee::propulsion::{ImpellerMode, PropulsionSettings};
use tumble_astrobee::sensing::{Localization, SensingPreset};
use tumble_astrobee::simulator::{
    Actuators, AddedWrench, AstrobeeSimulator, CONTROL_PERIOD_S, Drive, FlownController, Grasp, Multisine,
    PayloadMotion, Reference, SimulatorSettings,
};
use tumble_astrobee::worlds::WorldPreset;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{InertialParameters, Plant as _, RigidBodyState};
use tumble_lie::{Pose, Twist, Wrench};

const PERIODS: u32 = 10_000;

/// FNV-1a, 64 bits.
fn absorb(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

fn numbers_of(pose: &Pose<f64>) -> impl Iterator<Item = f64> {
    pose.rotation.coords.iter().chain(pose.translation.vector.iter()).copied()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let start = RigidBodyState {
        world_from_body: WorldPreset::Iss.pose("A").unwrap_or_default(),
        twist_body: Twist::new(Vector3::new(0.02, -0.03, 0.01), Vector3::new(0.01, 0.0, -0.02)),
    };
    let mode = ImpellerMode::Nominal;
    let ideal = SimulatorSettings::ideal(WorldPreset::Iss, start);
    let body = ideal.body;
    let mut robot = AstrobeeSimulator::try_new(SimulatorSettings {
        drag: Some(air_drag()),
        actuators: Actuators::hardware(mode, body.center_of_mass(), PropulsionSettings::PHYSICAL),
        sensors: Some(Localization::new(&SensingPreset::ThesisFlight.settings(), 7, mode)?),
        ..ideal
    })?;
    let controller = FlightController::new(body, ControlGains::of(FlightSite::Iss));
    let peak = Wrench::new(Vector3::new(0.02, 0.02, 0.02), Vector3::new(0.2, 0.1, 0.1));
    let mut drive = Drive {
        tracking: Some((Box::new(FlownController::new(controller)), Reference::Hold(start.world_from_body))),
        added: AddedWrench::Multisine(Multisine::new(&peak, 3, 0.04, 0.35, 7)),
        ..Drive::default()
    };
    let (mut hash, mut estimate, mut estimates) = (0xcbf2_9ce4_8422_2325, None, 0);
    for period in 0..PERIODS {
        if period == PERIODS / 2 {
            let payload = InertialParameters::solid_box(3.2, [0.3, 0.2, 0.1]);
            robot.attach(
                Grasp { payload, robot_from_payload: Pose::translation(-0.25, 0.0, 0.05) },
                PayloadMotion::AtRest,
            )?;
        }
        let wanted = drive.wanted(robot.time_ns(), estimate.as_ref())?;
        let measured = robot.advance(&wanted, CONTROL_PERIOD_S)?;
        estimate = measured.estimate;
        let state = robot.state();
        let truth =
            numbers_of(&state.world_from_body).chain(state.twist_body.to_vector().iter().copied().collect::<Vec<_>>());
        hash = truth.fold(hash, |hash, number| absorb(hash, &number.to_le_bytes()));
        for estimate in robot.estimates() {
            hash = absorb(hash, &estimate.stamp_ns.to_le_bytes());
            hash = absorb(hash, &estimate.arrival_ns.to_le_bytes());
            let vectors = [estimate.velocity_origin_world, estimate.rate_body, estimate.acceleration_origin_body];
            let numbers = numbers_of(&estimate.world_from_body).chain(vectors.iter().flatten().copied());
            hash = numbers.fold(hash, |hash, number| absorb(hash, &number.to_le_bytes()));
            estimates += 1;
        }
        hash = absorb(hash, &measured.command.nozzles);
        let wrenches = [measured.realized_wrench_body, measured.believed_wrench_body];
        for number in wrenches.iter().flat_map(|wrench| wrench.force.iter().chain(&wrench.torque)) {
            hash = absorb(hash, &number.to_le_bytes());
        }
    }
    println!("flight {hash:016x}, {estimates} estimates");
    Ok(())
}
