//! Prints a hash of every byte of three local plans (four and ten unknown parameters past an obstacle, and a long way) and of the
//! commands of a tube controller past the same obstacle, beliefs taken over on the way.
//!
//! The output must not depend on the optimisation level or the processor: `cargo xtask ci --only determinism` runs this program
//! as tests are built and compares with what it printed as users build it.

use tumble_planning::collision::{BodyShape, MovingObstacle};
use tumble_planning::control::{
    AttitudeController, AttitudeGains, AttitudeLaw, AttitudeSpan, AxisGain, ControlRequest, Controller, EndAttitude,
    MassInterval, ReferenceMotion, Terminal, TrackedPoint, TubeController, TubeDisturbance, TubeObstacles,
    TubeSettings, TubeWeights,
};
use tumble_planning::dynamics::{
    BodyAcceleration, FreeFlyer, InertialParameters, Integrator, MuntheKaas4, ObstacleEllipsoid, PoseReference,
    RigidBodyState,
};
use tumble_planning::lie::{Pose, Twist};
use tumble_planning::local::{
    Barrier, Criterion, Guess, InformativeModel, InformativePlanner, Kinematics, LocalPlanner, LocalRequest,
    LocalSettings, Reference, RigidBodyModel, SpeedLimits, Surroundings, WrenchSet,
};
use tumble_planning::nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};
use tumble_planning::{ModelBelief, Plan, PlanningError, Units};

/// FNV-1a, 64 bits.
fn absorb(hash: u64, number: f64) -> u64 {
    number.to_le_bytes().iter().fold(hash, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

fn settings(steps: usize, step_s: f64) -> LocalSettings<12, 6> {
    let tracking = [1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.25, 0.25, 0.25, 0.5, 0.5, 0.5];
    let measured = [0.0, 0.0, 0.0, 4e4, 4e4, 4e4, 0.0, 0.0, 0.0, 4e4, 4e4, 4e4];
    LocalSettings {
        steps,
        step_s,
        tracking,
        terminal: tracking,
        effort: [10.0, 10.0, 10.0, 1.0, 1.0, 1.0],
        acceleration: [0.0; 2],
        wrench: WrenchSet { limit: [0.045, 0.022, 0.026, 0.452, 0.216, 0.257], half_spaces: Vec::new() },
        speed: SpeedLimits { speed_m_s: Vector3::repeat(0.2), rate_rad_s: Vector3::repeat(0.3) },
        measurement: SMatrix::from_diagonal(&SVector::from(measured)),
        retained: [1.0; 12],
        criterion: Criterion::A,
        margin_m: 0.0,
        length_scale_m: 0.2,
        on_segments: true,
        tolerance: 1e-6,
        iterations: 200,
    }
}

/// A cube of 10 kg with cargo, each parameter uncertain by a twentieth of its natural size.
fn belief() -> ModelBelief {
    let inertia = Matrix3::new(0.1534, 0.004, -0.006, 0.004, 0.1427, 0.003, -0.006, 0.003, 0.1623);
    let body = InertialParameters::about_com(9.5838, Vector3::new(0.02, -0.01, 0.015), inertia);
    let mut belief = ModelBelief::certain(1, body);
    for (place, sigma) in [1.0, 0.2, 0.2, 0.2, 0.05, 0.01, 0.01, 0.05, 0.01, 0.05].into_iter().enumerate() {
        belief.estimate.covariance[(place, place)] = sigma * sigma;
    }
    belief
}

fn plan<M: InformativeModel<12, 6, P, State = Kinematics>, const P: usize>(
    name: &str,
    model: M,
    settings: LocalSettings<12, 6>,
) -> Result<(), PlanningError> {
    let obstacle = ObstacleEllipsoid {
        world_from_ellipsoid: Pose::translation(0.45, 0.12, 0.10),
        semi_axes: Vector3::new(0.25, 0.20, 0.20),
    };
    let surroundings = Surroundings::none().with_moving([MovingObstacle::at_rest(obstacle)])?;
    let (start, goal) = (Kinematics::at_rest(Pose::identity()), Kinematics::at_rest(Pose::translation(0.9, 0.4, 0.2)));
    let mut planner = InformativePlanner::try_new(model, settings)?;
    let request = LocalRequest {
        start: &start,
        start_s: 0.0,
        reference: Reference::Hold(&goal),
        terminal: None,
        belief: &belief(),
        information: [1.0; P],
        reserved: [0.0; 6],
        surroundings: &surroundings,
        guess: Guess::Excited,
    };
    let answer = planner.plan(&request, &mut Units::new(1 << 40))?;
    let mut hash = absorb(0xcbf2_9ce4_8422_2325, answer.optimality);
    if let Some(plan) = &answer.plan {
        let motion = &plan.trajectory;
        hash = motion.inputs.iter().flatten().copied().fold(hash, absorb);
        hash = motion.covariances.iter().flat_map(SMatrix::iter).copied().fold(hash, absorb);
        for state in &motion.states {
            let pose = &state.world_from_body;
            let numbers = pose.rotation.coords.iter().chain(pose.translation.vector.iter());
            let moving = state.velocity_world.iter().chain(state.rate_body.iter());
            hash = numbers.chain(moving).copied().fold(hash, absorb);
        }
    }
    println!("{name:4} {:?} after {} iterations {hash:016x}", answer.status, answer.iterations);
    Ok(())
}

/// Turns on the way, pushed by nothing but its own commands.
fn follow() -> Result<(), PlanningError> {
    let settings = TubeSettings {
        gain: AxisGain { stiffness: 0.25, damping: 2.0, step_s: 0.2 },
        steps: 25,
        weights: TubeWeights::DEFAULT,
        terminal: Terminal::Rest,
        speed_m_s: 0.2,
        walls_m: [[-2.0, 2.0]; 3],
        force_limit_n: Vector3::new(0.452, 0.216, 0.257),
        attitudes: AttitudeSpan::Any,
        turned_by_rad: 0.01,
        disturbance: TubeDisturbance { position_m: 1e-4, velocity_m_s: 1e-4, force_n: 1e-3, acceleration_m_s2: 0.0 },
        corrections: None,
        mass: MassInterval::between(6.0, 15.0)?,
        sigmas: 3.0,
        world_from_axes: UnitQuaternion::identity(),
        point: TrackedPoint::BelievedCenterOfMass,
    };
    let obstacle = ObstacleEllipsoid {
        world_from_ellipsoid: Pose::translation(0.45, 0.12, 0.10),
        semi_axes: Vector3::new(0.15, 0.10, 0.10),
    };
    let obstacles = TubeObstacles {
        body: BodyShape::sphere(0.05)?,
        barriers: vec![Barrier::Ellipsoid(MovingObstacle::at_rest(obstacle))],
        turn_rad_s: 0.05,
        end: EndAttitude::Any,
        attitude_error_rad: 0.05,
    };
    let belief = belief();
    let gains = AttitudeGains { stiffness_n_m: 0.1, damping_n_m_s: 0.2 };
    let body = *belief.parameters();
    let attitude = AttitudeController { law: AttitudeLaw::Geometric, gains, body, torque_limit_n_m: 0.02 };
    let mut controller = TubeController::try_new(settings, Some(obstacles), attitude, &body)?;
    let wanted = |time_s: f64| PoseReference {
        state: RigidBodyState {
            world_from_body: Pose::new(Vector3::new(0.9, 0.4, 0.2), Vector3::new(0.0, 0.0, 0.02 * time_s)),
            twist_body: Twist::new(Vector3::new(0.0, 0.0, 0.02), Vector3::zeros()),
        },
        acceleration: BodyAcceleration {
            angular_acceleration_body: Vector3::zeros(),
            acceleration_origin_body: Vector3::zeros(),
        },
    };
    let plan: Plan<&dyn ReferenceMotion> = Plan { trajectory: &wanted, model_revision: 1 };
    let (flyer, mut state) = (FreeFlyer::new(body), RigidBodyState::at_rest());
    let (mut hash, step_s) = (0xcbf2_9ce4_8422_2325, 0.05);
    for output in 0..1200_u32 {
        if output % 400 == 300 {
            let mut newer = belief.clone();
            newer.revision = u64::from(output);
            newer.estimate.covariance *= 1.0 / f64::from(output);
            controller.adopt(&newer)?;
        }
        let time_s = f64::from(output) * step_s;
        let command = controller.command(&ControlRequest { time_s, state: &state, plan: &plan })?;
        hash = command.wrench_body.to_vector().iter().copied().fold(hash, absorb);
        state = MuntheKaas4.step(&flyer, &state, &command.wrench_body, time_s, step_s)?;
    }
    let counts = controller.counts();
    println!(
        "tube {} decisions, {} beliefs, {} fallbacks {hash:016x}",
        counts.decisions,
        counts.adopted,
        counts.shifted + counts.restarted + counts.braking
    );
    Ok(())
}

fn main() -> Result<(), PlanningError> {
    follow()?;
    plan("four", RigidBodyModel::<4>::principal(), settings(24, 0.5))?;
    plan("ten", RigidBodyModel::<10>::full(), settings(24, 0.5))?;
    plan("long", RigidBodyModel::<4>::principal(), settings(80, 0.25))
}
