//! Prints a hash of every byte of three local plans: four and ten unknown parameters past an obstacle, and a long way.
//!
//! The output must not depend on the optimisation level or the processor: `cargo xtask ci --only determinism` runs this program
//! built in three ways and compares.

use tumble_planning::collision::MovingObstacle;
use tumble_planning::dynamics::{InertialParameters, ObstacleEllipsoid};
use tumble_planning::lie::Pose;
use tumble_planning::local::{
    Criterion, Guess, InformativeModel, InformativePlanner, Kinematics, LocalPlanner, LocalRequest, LocalSettings,
    Reference, RigidBodyModel, SpeedLimits, Surroundings, WrenchSet,
};
use tumble_planning::nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use tumble_planning::{ModelBelief, PlanningError, Units};

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

fn main() -> Result<(), PlanningError> {
    plan("four", RigidBodyModel::<4>::principal(), settings(24, 0.5))?;
    plan("ten", RigidBodyModel::<10>::full(), settings(24, 0.5))?;
    plan("long", RigidBodyModel::<4>::principal(), settings(80, 0.25))
}
