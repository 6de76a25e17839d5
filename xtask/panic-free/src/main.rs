//! Link-time proof that the hot paths cannot panic.
//!
//! Built with the feature `check` and the profile `panic-free` (fat LTO, one codegen unit, unwinding), every kernel below
//! that could panic leaves an undefined symbol and the link fails. With the feature `control` a kernel that can panic is
//! added, and the link must fail. `cargo xtask ci --only panic-free` does both.
//!
//! Exceptions, tried and refused by the link, each covered by property tests and by `tests/allocation_free.rs` instead:
//! - solutions (`SquareRootInformation::solve`, `InteriorPoint::solve`), because the optimiser does not prove the indices of
//!   the singular values that follow a failed test of rank;
//! - margins of consistency (`InertialParameters::consistency_margin`, `PseudoInertiaCone::margin`), because they call
//!   nalgebra's symmetric eigenvalue routine.
//!
//! Not tried: `EllipsoidWorld::clearance` and `first_contact`, whose obstacles are in lists of any length; tests on hostile
//! numbers cover them.
// The attribute expands to an extern block.
#![cfg_attr(feature = "check", allow(unsafe_code))]

use nalgebra::{Isometry3, SMatrix, SVector, UnitDualQuaternion, UnitQuaternion, Vector3, Vector6};
use std::hint::black_box;
use tumble_astrobee::bodies::BodyConfiguration;
use tumble_astrobee::flight_controller::{ControlOrder, FlightCommand, FlightController, Setpoint};
use tumble_astrobee::flight_modes::{ControlGains, FlightSite};
use tumble_astrobee::propulsion::{
    FlapCommand, ForceAllocation, ImpellerMode, PropulsionCommand, PropulsionPlant, PropulsionSettings, PropulsionStep,
    QuantizedAllocation,
};
use tumble_astrobee::sensing::{Confidence, LocalizationEstimate};
use tumble_dynamics::AlignedBox;
use tumble_dynamics::{
    Actuation as _, BodyAcceleration, DynamicsError, FreeFlyer, InertialParameters, Integrator as _, MuntheKaas4,
    RigidBodyState, VariationalFreeFlyer,
};
use tumble_identification::recursive::{
    AccelerationObservation, ChiSquareGate, ExtendedKalmanFilter, KalmanFilter, LinearObservation, LinearProcess,
    PrincipalBody, PrincipalMotion, RecursiveLeastSquares, RowsOutcome, SquareRootFilter,
};
use tumble_identification::regressors::{ObserverFrame, PoseTriple, newton_euler, variational};
use tumble_identification::{IdentificationError, SquareRootInformation};
use tumble_lie::{GroupAction as _, LieGroup, Twist, Wrench};
use tumble_planning::TranslationState;
use tumble_planning::collision::{
    Distance, Ellipsoid, HalfSpace, ScalingMargin, Separation, Sphere, distance, distance_from_hint, ellipsoid_to_box,
    ellipsoid_to_half_space, ellipsoid_to_sphere, scaling_margin, separation, sphere_to_box,
};
use tumble_planning::steering::{Steering, TranslationLimits, least_time_s, steer, steer_in};

macro_rules! proven {
    ($($(#[$meta:meta])* fn $name:ident($($argument:ident: $kind:ty),*) -> $result:ty $body:block)*) => {
        $(
            $(#[$meta])*
            #[cfg_attr(feature = "check", no_panic::no_panic)]
            #[inline(never)]
            fn $name($($argument: $kind),*) -> $result $body
        )*
    };
}

type Quaternion = UnitQuaternion<f64>;
type Pose = Isometry3<f64>;
type DualQuaternion = UnitDualQuaternion<f64>;

proven! {
    fn quaternion_exp(xi: &Vector3<f64>) -> Quaternion { <Quaternion as LieGroup>::exp(xi) }
    fn quaternion_log(q: &Quaternion) -> Vector3<f64> { LieGroup::log(q) }
    fn quaternion_compose(a: &Quaternion, b: &Quaternion) -> Quaternion { a.compose(b) }
    fn quaternion_act(q: &Quaternion, p: &Vector3<f64>) -> Vector3<f64> { q.act(p) }
    fn quaternion_jacobian(xi: &Vector3<f64>) -> SMatrix<f64, 3, 3> { Quaternion::right_jacobian(xi) }
    fn quaternion_jacobian_inverse(xi: &Vector3<f64>) -> SMatrix<f64, 3, 3> { Quaternion::right_jacobian_inverse(xi) }
    fn pose_exp(xi: &Vector6<f64>) -> Pose { <Pose as LieGroup>::exp(xi) }
    fn pose_log(g: &Pose) -> Vector6<f64> { LieGroup::log(g) }
    fn pose_compose(a: &Pose, b: &Pose) -> Pose { a.compose(b) }
    fn pose_inverse(g: &Pose) -> Pose { LieGroup::inverse(g) }
    fn pose_act(g: &Pose, p: &Vector3<f64>) -> Vector3<f64> { g.act(p) }
    fn pose_adjoint(g: &Pose) -> SMatrix<f64, 6, 6> { g.adjoint() }
    fn pose_jacobian(xi: &Vector6<f64>) -> SMatrix<f64, 6, 6> { Pose::right_jacobian(xi) }
    fn pose_jacobian_inverse(xi: &Vector6<f64>) -> SMatrix<f64, 6, 6> { Pose::right_jacobian_inverse(xi) }
    fn dual_quaternion_exp(xi: &Vector6<f64>) -> DualQuaternion { <DualQuaternion as LieGroup>::exp(xi) }
    fn dual_quaternion_log(g: &DualQuaternion) -> Vector6<f64> { LieGroup::log(g) }
    fn dual_quaternion_compose(a: &DualQuaternion, b: &DualQuaternion) -> DualQuaternion { a.compose(b) }
    fn inverse_dynamics(flyer: &FreeFlyer<f64>, twist: &Twist<f64>, acceleration: &BodyAcceleration<f64>) -> Wrench<f64> {
        flyer.inverse(twist, acceleration)
    }
    fn forward_dynamics(flyer: &FreeFlyer<f64>, twist: &Twist<f64>, wrench: &Wrench<f64>) -> BodyAcceleration<f64> {
        flyer.forward(twist, wrench)
    }
    fn variational_step(
        flyer: &FreeFlyer<f64>, state: &RigidBodyState<f64>, wrench: &Wrench<f64>, step_s: f64
    ) -> Result<RigidBodyState<f64>, DynamicsError> {
        VariationalFreeFlyer.step(flyer, state, wrench, 0.0, step_s)
    }
    fn munthe_kaas_step(
        flyer: &FreeFlyer<f64>, state: &RigidBodyState<f64>, wrench: &Wrench<f64>, step_s: f64
    ) -> Result<RigidBodyState<f64>, DynamicsError> {
        MuntheKaas4.step(flyer, state, wrench, 0.0, step_s)
    }
    fn allocate_flaps(allocation: &ForceAllocation, wrench: &Wrench<f64>) -> Result<FlapCommand, DynamicsError> {
        allocation.allocate(wrench)
    }
    fn realize_flaps(allocation: &ForceAllocation, command: &FlapCommand) -> Wrench<f64> { allocation.realize(command) }
    fn allocate_bytes(
        allocation: &QuantizedAllocation, wrench: &Wrench<f64>
    ) -> Result<PropulsionCommand, DynamicsError> {
        allocation.allocate(wrench)
    }
    fn realize_bytes(allocation: &QuantizedAllocation, command: &PropulsionCommand) -> Wrench<f64> {
        allocation.realize(command)
    }
    fn propulsion_step(plant: &mut PropulsionPlant, command: &PropulsionCommand, rate: &Vector3<f64>) -> PropulsionStep {
        plant.step(command, rate)
    }
    fn flight_controller(
        controller: &mut FlightController, estimate: &LocalizationEstimate, order: &ControlOrder
    ) -> FlightCommand {
        controller.step(estimate, order)
    }
    fn newton_euler_regressor(twist: &Twist<f64>, acceleration: &BodyAcceleration<f64>) -> SMatrix<f64, 6, 10> {
        newton_euler(&twist.angular, &acceleration.angular_acceleration_body, &acceleration.acceleration_origin_body)
    }
    fn variational_regressor(triple: &PoseTriple<f64>) -> SMatrix<f64, 6, 10> { variational(triple) }
    fn square_root_update(
        information: &mut SquareRootInformation<10>, block: &SMatrix<f64, 6, 10>, rhs: &SVector<f64, 6>
    ) -> Result<(), IdentificationError> {
        information.update(block, rhs)
    }
    fn recursive_least_squares(
        filter: &mut RecursiveLeastSquares<10, 6>, observation: &LinearObservation<6, 10>
    ) -> Result<RowsOutcome<6>, IdentificationError> {
        filter.update_rows(observation)
    }
    fn square_root_filter(
        filter: &mut SquareRootFilter<10, 6>, observation: &LinearObservation<6, 10>
    ) -> Result<RowsOutcome<6>, IdentificationError> {
        filter.update_rows(observation)
    }
    fn kalman_filter(
        filter: &mut KalmanFilter<10, 6>, observation: &LinearObservation<6, 10>
    ) -> Result<RowsOutcome<6>, IdentificationError> {
        filter.update_rows(observation)
    }
    fn extended_kalman_filter(
        filter: &mut ExtendedKalmanFilter<PrincipalMotion, PrincipalBody, 4, 6, 4>, observation: &AccelerationObservation
    ) -> Result<RowsOutcome<6>, IdentificationError> {
        filter.update_rows(observation)
    }
    fn ellipsoids_separation(a: &Ellipsoid, b: &Ellipsoid) -> Separation { separation(a, b) }
    fn ellipsoids_scaling_margin(a: &Ellipsoid, b: &Ellipsoid) -> ScalingMargin { scaling_margin(a, b) }
    fn ellipsoids_distance(a: &Ellipsoid, b: &Ellipsoid) -> Distance { distance(a, b) }
    fn ellipsoids_distance_from_hint(a: &Ellipsoid, b: &Ellipsoid, normal: &Vector3<f64>) -> Distance {
        distance_from_hint(a, b, normal)
    }
    fn sphere_distance(a: &Ellipsoid, b: &Sphere) -> Distance { ellipsoid_to_sphere(a, b) }
    fn box_distance(a: &Ellipsoid, b: &AlignedBox) -> Distance { ellipsoid_to_box(a, b) }
    fn sphere_box_distance(a: &Sphere, b: &AlignedBox) -> Distance { sphere_to_box(a, b) }
    fn half_space_distance(a: &Ellipsoid, b: &HalfSpace) -> Distance { ellipsoid_to_half_space(a, b) }
    fn least_time(from: &TranslationState, to: &TranslationState, limits: &TranslationLimits) -> f64 {
        least_time_s(from, to, limits)
    }
    fn steering(from: &TranslationState, to: &TranslationState, limits: &TranslationLimits) -> Option<Steering> {
        steer(from, to, limits)
    }
    fn steering_in(
        from: &TranslationState, to: &TranslationState, limits: &TranslationLimits, duration_s: f64
    ) -> Option<Steering> {
        steer_in(from, to, limits, duration_s)
    }
}

#[cfg(feature = "control")]
proven! {
    fn control(values: &[f64], index: usize) -> f64 { values[index] }
}

fn main() {
    // Arguments that the optimiser cannot see through.
    let xi = black_box(Vector6::new(0.1, -0.2, 0.3, 0.4, -0.5, 0.6));
    let phi = black_box(Vector3::new(0.1, -0.2, 0.3));
    let q = quaternion_exp(&phi);
    black_box((quaternion_log(&q), quaternion_compose(&q, &q), quaternion_act(&q, &phi)));
    black_box((quaternion_jacobian(&phi), quaternion_jacobian_inverse(&phi)));
    let g = pose_exp(&xi);
    black_box((pose_log(&g), pose_compose(&g, &g), pose_inverse(&g), pose_act(&g, &phi), pose_adjoint(&g)));
    black_box((pose_jacobian(&xi), pose_jacobian_inverse(&xi)));
    let d = dual_quaternion_exp(&xi);
    black_box((dual_quaternion_log(&d), dual_quaternion_compose(&d, &d)));

    let flyer = black_box(FreeFlyer::new(InertialParameters::solid_box(5.0, [0.3, 0.2, 0.1])));
    let mut state = RigidBodyState::at_rest();
    state.twist_body = black_box(Twist::new(phi, phi));
    let wrench = black_box(Wrench::new(phi, phi));
    let acceleration = forward_dynamics(&flyer, &state.twist_body, &wrench);
    black_box(inverse_dynamics(&flyer, &state.twist_body, &acceleration));
    let first = variational_step(&flyer, &state, &wrench, 0.01);
    let second = munthe_kaas_step(&flyer, &state, &wrench, 0.02);
    let allocation = black_box(ForceAllocation::new(ImpellerMode::Nominal, phi));
    let quantized = black_box(QuantizedAllocation(allocation));
    if let (Ok(flaps), Ok(bytes)) = (allocate_flaps(&allocation, &wrench), allocate_bytes(&quantized, &wrench)) {
        black_box((realize_flaps(&allocation, &flaps), realize_bytes(&quantized, &bytes)));
    }
    let mut plant = black_box(PropulsionPlant::spun_up(PropulsionSettings::PHYSICAL, ImpellerMode::Nominal));
    black_box(propulsion_step(&mut plant, &black_box(PropulsionCommand::default()), &phi));
    let mut controller =
        black_box(FlightController::new(BodyConfiguration::Iss.parameters(), ControlGains::of(FlightSite::Iss)));
    let estimate = black_box(LocalizationEstimate {
        stamp_ns: 0,
        arrival_ns: 0,
        world_from_body: g,
        velocity_origin_world: phi,
        rate_body: phi,
        acceleration_origin_body: phi,
        confidence: Confidence::Good,
    });
    let setpoint = Setpoint::at_rest(0, g);
    let order = black_box(ControlOrder::Follow { current: setpoint, next: setpoint });
    black_box(flight_controller(&mut controller, &estimate, &order));
    let block = newton_euler_regressor(&state.twist_body, &acceleration);
    let mut information = SquareRootInformation::<10>::new();
    let updated = square_root_update(&mut information, &block, &wrench.to_vector());
    let gate = ChiSquareGate::try_new(black_box(0.99)).ok();
    let observation = LinearObservation {
        regressor: block,
        output: wrench.to_vector(),
        standard_deviation: black_box(Vector6::repeat(0.1)),
    };
    let (mean, covariance) = black_box((SVector::<f64, 10>::zeros(), SMatrix::<f64, 10, 10>::identity()));
    if let (Some(gate), Ok(filter), Ok(body)) = (
        gate,
        SquareRootFilter::try_new(mean, covariance.diagonal()),
        PrincipalBody::try_new(black_box(5.0), Vector3::repeat(0.1)),
    ) {
        let mut least_squares = RecursiveLeastSquares::new(mean, covariance).with_gate(gate);
        let mut kalman = KalmanFilter::new(LinearProcess::random_walk(covariance), mean, covariance).with_gate(gate);
        let mut square_root = filter.with_gate(gate);
        let model = PrincipalMotion { drift: SVector::repeat(1e-6) };
        let mut extended = ExtendedKalmanFilter::new(model, body, SMatrix::identity()).with_gate(gate);
        let seen = AccelerationObservation {
            rate_body: phi,
            wrench_body: wrench,
            acceleration_body: xi,
            standard_deviation: Vector6::repeat(0.1),
        };
        let _ = black_box((
            recursive_least_squares(&mut least_squares, &observation),
            square_root_filter(&mut square_root, &observation),
            kalman_filter(&mut kalman, &observation),
            extended_kalman_filter(&mut extended, &seen),
        ));
    }
    if let (Ok(first), Ok(second)) = (first, second)
        && let Ok(triple) = PoseTriple::try_new(
            [&state.world_from_body, &first.world_from_body, &second.world_from_body],
            0.01,
            0.01,
            &ObserverFrame::inertial(),
        )
    {
        black_box(variational_regressor(&triple));
    }
    let (a_pose, b_pose) = black_box((Pose::identity(), g));
    if let (Ok(a), Ok(b)) = (
        Ellipsoid::try_new(&a_pose, &black_box(Vector3::new(0.3, 0.2, 0.1))),
        Ellipsoid::try_new(&b_pose, &black_box(Vector3::new(0.1, 0.2, 0.3))),
    ) {
        let sphere = black_box(Sphere { center: phi, radius_m: 0.1 });
        let aligned = black_box(AlignedBox::between(phi, phi * 2.0));
        let half_space = black_box(HalfSpace { inward: Vector3::z_axis(), offset_m: 0.1 });
        black_box((ellipsoids_separation(&a, &b), ellipsoids_scaling_margin(&a, &b), ellipsoids_distance(&a, &b)));
        black_box((ellipsoids_distance_from_hint(&a, &b, &phi), sphere_distance(&a, &sphere)));
        black_box((box_distance(&a, &aligned), sphere_box_distance(&sphere, &aligned)));
        black_box(half_space_distance(&a, &half_space));
    }
    let (from, to) = black_box((TranslationState::at_rest(phi), TranslationState { position: -phi, velocity: phi }));
    let limits = black_box(TranslationLimits {
        position: AlignedBox::between(Vector3::repeat(-9.0), Vector3::repeat(9.0)),
        speed_m_s: Vector3::repeat(0.5),
        acceleration_m_s2: Vector3::repeat(0.1),
    });
    black_box((least_time(&from, &to, &limits), steering(&from, &to, &limits), steering_in(&from, &to, &limits, 99.0)));
    println!("panic-free kernels ran: update {}", if updated.is_ok() { "accepted" } else { "refused" });
    #[cfg(feature = "control")]
    println!("{}", control(black_box(&[1.0, 2.0]), black_box(1)));
}
