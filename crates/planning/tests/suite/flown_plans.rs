//! Plans with long steps keep off obstacles when they are flown exactly, not only in the planner's own integration.
#![allow(clippy::unwrap_used)]

use tumble_planning::collision::MovingObstacle;
use tumble_planning::dynamics::{
    FreeFlyer, InertialParameters, Integrator, MuntheKaas4, ObstacleEllipsoid, RigidBodyState,
};
use tumble_planning::lie::{Pose, Wrench};
use tumble_planning::local::{
    Criterion, Guess, InformativePlanner, Kinematics, LocalPlanner, LocalRequest, LocalSettings, Reference,
    RigidBodyModel, SpeedLimits, Surroundings, WrenchSet,
};
use tumble_planning::nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};
use tumble_planning::{ModelBelief, Units};

const STEPS: usize = 14;
const STEP_S: f64 = 1.0;
const PIECES: u32 = 50;

fn settings() -> LocalSettings<12, 6> {
    let tracking = core::array::from_fn(|i| if i < 3 { 1.0 } else { 0.05 });
    LocalSettings {
        steps: STEPS,
        step_s: STEP_S,
        tracking,
        terminal: tracking,
        effort: [0.1, 0.1, 0.1, 1.0, 1.0, 1.0],
        acceleration: [0.0; 2],
        wrench: WrenchSet { limit: [0.045, 0.045, 0.045, 0.45, 0.3, 0.3], half_spaces: Vec::new() },
        speed: SpeedLimits { speed_m_s: Vector3::repeat(0.3), rate_rad_s: Vector3::repeat(1.2) },
        measurement: SMatrix::from_diagonal_element(2e4),
        retained: [1.0; 12],
        criterion: Criterion::A,
        margin_m: 0.0,
        length_scale_m: 0.1,
        on_segments: true,
        tolerance: 1e-5,
        iterations: 200,
    }
}

#[test]
fn what_is_flown_keeps_off_too() {
    let body = InertialParameters::solid_box(9.5, [0.3, 0.25, 0.35]);
    let mut belief = ModelBelief::certain(1, body);
    let variances = [1.0, 0.01, 0.01, 0.01, 2e-3, 1e-4, 1e-4, 2e-3, 1e-4, 2e-3];
    belief.estimate.covariance = SMatrix::from_diagonal(&variances.into());
    let semi_axes = Vector3::new(0.25, 0.2, 0.22);
    let center = Vector3::new(0.45, 0.05, 0.02);
    let obstacle =
        ObstacleEllipsoid { world_from_ellipsoid: Pose::translation(center.x, center.y, center.z), semi_axes };
    let surroundings = Surroundings::none().with_moving([MovingObstacle::at_rest(obstacle)]).unwrap();
    let goal = Kinematics::at_rest(Pose::translation(1.0, 0.1, 0.05));
    let mut planner = InformativePlanner::try_new(RigidBodyModel::<4>::principal(), settings()).unwrap();
    let (mut plans, mut farthest_m) = (0, 0.0_f64);
    for draw in 0..12 {
        let angle = 0.5 * f64::from(draw);
        let start = Kinematics {
            world_from_body: Pose::from_parts(
                Vector3::zeros().into(),
                UnitQuaternion::from_scaled_axis(Vector3::new(angle, 1.0 - angle, 0.3)),
            ),
            velocity_world: Vector3::zeros(),
            rate_body: Vector3::new(0.4, -0.3, 0.5) * (1.0 - 0.05 * f64::from(draw)),
        };
        let request = LocalRequest {
            start: &start,
            start_s: 0.0,
            reference: Reference::Hold(&goal),
            terminal: None,
            belief: &belief,
            information: [1.0, 3000.0, 3000.0, 3000.0],
            reserved: [0.0; 6],
            surroundings: &surroundings,
            guess: Guess::Excited,
        };
        let answer = planner.plan(&request, &mut Units::new(u64::MAX)).unwrap();
        let Some(plan) = answer.plan else { continue };
        plans += 1;
        // another integrator, another step
        let flyer = FreeFlyer::new(body);
        let mut state = RigidBodyState::from(&start);
        for (input, planned) in plan.trajectory.inputs.iter().zip(&plan.trajectory.states[1..]) {
            let wrench = Wrench::from(SVector::from(*input));
            for _ in 0..PIECES {
                state = MuntheKaas4.step(&flyer, &state, &wrench, 0.0, STEP_S / f64::from(PIECES)).unwrap();
                let away = state.world_from_body.translation.vector - center;
                let gauge = away.component_div(&semi_axes).norm_squared();
                assert!(gauge > 1.0 - 1e-6, "draw {draw}: {gauge}");
            }
            let apart = state.world_from_body.translation.vector - planned.position_world();
            farthest_m = farthest_m.max(apart.norm());
        }
    }
    // far apart enough to see
    assert!(plans == 12 && farthest_m > 1e-4, "{plans} {farthest_m}");
}
