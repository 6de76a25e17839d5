//! Hot paths allocate nothing: every one of them is called a hundred thousand times under an allocator that counts.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]
#![allow(
    unsafe_code,
    reason = "an allocator that counts has to implement `GlobalAlloc`; it hands everything to the system's"
)]

use nalgebra::Vector3;
use tumble_astrobee::bodies::BodyConfiguration;
use tumble_astrobee::flight_controller::{ControlOrder, FlightController, Setpoint};
use tumble_astrobee::flight_modes::{ControlGains, FlightSite};
use tumble_astrobee::propulsion::{
    ForceAllocation, ImpellerMode, PositivityShift, PropulsionCommand, PropulsionPlant, PropulsionSettings,
    QuantizedAllocation,
};
use tumble_astrobee::sensing::{Confidence, Jump, Localization, LocalizationEstimate, SensingPreset, TrueMotion};
use tumble_dynamics::strategies::{draws, poses, tree_motions, trees, wrenches};
use tumble_dynamics::{Actuation as _, Fixed, Multibody, RigidBodyState};
use tumble_lie::Twist;

tumble_lie::counting_allocator!();

const CALLS: usize = 100_000;
const INPUTS: usize = 64;

/// How often the calls after the first round allocate.
fn allocations<T>(call: impl FnMut(usize) -> T) -> usize {
    counting::allocations(INPUTS, CALLS, call)
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|i| vec![i]), CALLS);
}

#[test]
fn trees_of_rigid_bodies() {
    let motions = draws(&tree_motions::<7>(), 1, INPUTS);
    let trees: Vec<Multibody<f64, Fixed<7>>> = draws(&trees::<7>(), 2, INPUTS);
    let inverse = |i: usize| trees[i].inverse_dynamics(&motions[i].generalized());
    assert_eq!(allocations(inverse), 0);
    let force = inverse(0).unwrap();
    let forward = |i: usize| {
        let motion = &motions[i];
        trees[i].forward_dynamics(&motion.base_twist, &motion.positions, &motion.rates, &force)
    };
    assert_eq!(allocations(forward), 0);
    assert_eq!(allocations(|i| trees[i].mass_matrix(&motions[i].positions)), 0);
    assert_eq!(allocations(|i| trees[i].torque_regressor(&motions[i].generalized())), 0);
}

#[test]
fn force_allocation_and_its_inverse() {
    let wanted = draws(&wrenches(0.1, 1.0), 1, INPUTS);
    for mode in ImpellerMode::ALL {
        for shift in [PositivityShift::AxisGroups, PositivityShift::Thesis] {
            let allocation = ForceAllocation { shift, ..ForceAllocation::new(mode, Vector3::new(0.01, 0.02, 0.03)) };
            let quantized = QuantizedAllocation(allocation);
            assert_eq!(allocations(|i| allocation.realize(&allocation.allocate(&wanted[i]).unwrap())), 0);
            assert_eq!(allocations(|i| quantized.realize(&quantized.allocate(&wanted[i]).unwrap())), 0);
        }
    }
}

#[test]
fn propulsion_plant() {
    let mut plant = PropulsionPlant::new(PropulsionSettings::PHYSICAL);
    let rate_body = Vector3::new(0.1, -0.2, 0.3);
    let command = |i: usize| PropulsionCommand {
        impeller_speeds: [207; 2],
        nozzles: std::array::from_fn(|nozzle| u8::try_from((40 * i + 23 * nozzle) % 256).unwrap()),
    };
    assert_eq!(allocations(|i| plant.step(&command(i), &rate_body)), 0);
    assert!(plant.impellers().iter().all(|impeller| impeller.speed_rad_s() > 200.0), "it ran");
}

#[test]
fn flight_controller() {
    let gains = ControlGains::of(FlightSite::Iss);
    let mut controller = FlightController::new(BodyConfiguration::Iss.parameters(), gains);
    let poses = draws(&poses(1.0), 2, INPUTS);
    let mut time_ns = 0;
    let mut asked_n = 0.0;
    let call = |i: usize| {
        time_ns += 16_000_000;
        let estimate = LocalizationEstimate {
            stamp_ns: time_ns,
            arrival_ns: time_ns,
            world_from_body: poses[i],
            velocity_origin_world: Vector3::new(0.1, 0.0, -0.1),
            rate_body: Vector3::new(0.0, 0.1, -0.1),
            acceleration_origin_body: Vector3::zeros(),
            confidence: Confidence::Good,
        };
        let setpoint = Setpoint::at_rest(time_ns, poses[0]);
        let order = match i % 4 {
            0 => ControlOrder::Idle,
            1 => ControlOrder::Stop,
            _ => ControlOrder::Follow { current: setpoint, next: setpoint },
        };
        asked_n += controller.step(&estimate, &order).wrench_about_com.force.norm();
    };
    assert_eq!(allocations(call), 0);
    assert!(asked_n > 0.0, "it ran");
}

#[test]
fn sensors_from_the_first_observation_on() {
    let mut settings = SensingPreset::ThesisFlight.settings();
    settings.timing.hidden_latency_ms = 200;
    settings.timing.latency_ms = 2000.0;
    settings.faults.duplicate_probability = 0.5;
    settings.faults.jumps.push(Jump { start_s: 1.0, duration_s: 1.0, ..Jump::default() });
    let mut localization = Localization::new(&settings, 1, ImpellerMode::Nominal).unwrap();
    let truth = |k: i64| TrueMotion {
        time_ns: 16_000_000 * k,
        state: RigidBodyState { twist_body: Twist::new(Vector3::x(), Vector3::y()), ..RigidBodyState::at_rest() },
        acceleration_origin_body: Vector3::x(),
        angular_acceleration_body: Vector3::zeros(),
    };
    let before = counting::ALLOCATIONS.get();
    let mut read = 0;
    for k in 0..20_000 {
        localization.observe(&truth(k));
        while localization.arrived(16_000_000 * k).is_some() {
            read += 1;
        }
    }
    // The second half is read by nobody.
    (20_000..40_000).for_each(|k| localization.observe(&truth(k)));
    assert_eq!(counting::ALLOCATIONS.get() - before, 0);
    assert!(read > 20_000 && localization.unread() > 0);
}
