//! The laws of local planners for the informative planner, with a body in space and one in the plane.

use tumble_planning::ModelBelief;
use tumble_planning::collision::{BodyEllipsoid, BodyShape, MovingObstacle};
use tumble_planning::dynamics::{AlignedBox, InertialParameters, ObstacleEllipsoid, World};
use tumble_planning::laws::{LocalCase, LocalChecks, LocalExpectation, check_local_planner};
use tumble_planning::lie::Pose;
use tumble_planning::local::{
    Criterion, Guess, Hull, InformativePlanner, Kinematics, LocalRequest, LocalSettings, PlanarBodyModel, PlanarState,
    Reference, RigidBodyModel, SpeedLimits, Surroundings, TerminalRegion, WrenchSet,
};
use tumble_planning::nalgebra::{Matrix3, SMatrix, Vector2, Vector3};

/// Bodies with an offset centre of mass; plans are looked at between the nodes.
const CHECKS: LocalChecks =
    LocalChecks { samples_per_step: 16, tolerance: 1e-7, relative_tolerance: 1e-6, cost_tolerance: 1e-4 };
const UNITS: u64 = 1_000_000;

fn belief() -> ModelBelief {
    let inertia = Matrix3::new(0.15, 0.01, 0.0, 0.01, 0.12, 0.005, 0.0, 0.005, 0.17);
    let body = InertialParameters::about_com(9.5, Vector3::new(0.05, -0.06, 0.03), inertia);
    let mut belief = ModelBelief::certain(3, body);
    let variances = [1.0, 0.01, 0.01, 0.01, 2e-3, 1e-4, 1e-4, 2e-3, 1e-4, 2e-3];
    belief.estimate.covariance = SMatrix::from_diagonal(&variances.into());
    belief
}

fn diagonal<const X: usize>(of: [f64; X]) -> SMatrix<f64, X, X> {
    SMatrix::from_diagonal(&of.into())
}

/// A box on the way and an ellipsoid that drifts into it.
fn surroundings() -> Surroundings {
    let keep_out = AlignedBox::between(Vector3::new(0.25, -0.1, -0.2), Vector3::new(0.3, 0.02, 0.2));
    let keep_in = AlignedBox::between(Vector3::repeat(-0.6), Vector3::repeat(0.9));
    let world = World { keep_in: vec![keep_in], keep_out: vec![keep_out], obstacles: Vec::new() };
    let solid =
        ObstacleEllipsoid { world_from_ellipsoid: Pose::translation(0.45, 0.5, 0.0), semi_axes: Vector3::repeat(0.1) };
    let moving = MovingObstacle::at_rest(solid).drifting(Vector3::new(0.0, -0.01, 0.0), 0.0);
    let part = |x: f64| BodyEllipsoid {
        body_from_ellipsoid: Pose::translation(x, 0.0, 0.0),
        semi_axes: Vector3::new(0.08, 0.05, 0.06),
    };
    let shape = BodyShape::try_new(vec![part(0.04), part(-0.04)]).unwrap();
    Surroundings::of_world(&world, Hull::Shape(shape)).unwrap().with_moving([moving]).unwrap()
}

fn in_space() -> LocalSettings<12, 6> {
    LocalSettings {
        steps: 10,
        step_s: 0.5,
        tracking: [1.0, 1.0, 1.0, 0.5, 0.5, 0.5, 0.3, 0.3, 0.3, 0.5, 0.5, 0.5],
        terminal: [5.0, 5.0, 5.0, 2.0, 2.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
        effort: [10.0, 10.0, 10.0, 1.0, 1.0, 1.0],
        acceleration: [0.5, 0.1],
        wrench: WrenchSet {
            limit: [0.03, 0.03, 0.03, 0.8, 0.4, 0.4],
            half_spaces: vec![([0.0, 0.0, 0.0, 1.0, 1.0, 0.5], 0.7)],
        },
        speed: SpeedLimits { speed_m_s: Vector3::repeat(0.12), rate_rad_s: Vector3::repeat(0.25) },
        measurement: diagonal([1e4, 1e4, 1e4, 4e4, 4e4, 4e4, 1e4, 1e4, 1e4, 4e4, 4e4, 4e4]),
        retained: [0.9, 1.0, 0.8, 0.3, 0.5, 0.2, 1.0, 0.9, 0.8, 0.4, 0.6, 0.1],
        criterion: Criterion::A,
        margin_m: 0.02,
        length_scale_m: 0.1,
        on_segments: true,
        tolerance: 1e-4,
        iterations: 200,
    }
}

#[test]
fn a_body_in_space() {
    let start = Kinematics {
        rate_body: Vector3::new(0.05, -0.1, 0.08),
        ..Kinematics::at_rest(Pose::new(Vector3::zeros(), Vector3::new(0.3, 0.2, -0.4)))
    };
    let goal = Kinematics::at_rest(Pose::translation(0.5, 0.1, 0.05));
    let lost = Kinematics::at_rest(Pose::translation(f64::NAN, 0.1, 0.05));
    let (belief, around, nothing) = (belief(), surroundings(), Surroundings::none());
    let case = LocalCase {
        settings: in_space(),
        request: LocalRequest {
            start: &start,
            start_s: 2.0,
            reference: Reference::Hold(&goal),
            terminal: None,
            belief: &belief,
            information: [0.05, 300.0, 300.0, 300.0],
            reserved: [0.0; 6],
            surroundings: &around,
            guess: Guess::Excited,
        },
        expectation: LocalExpectation::Solvable,
        units: UNITS,
        impossible: &[lost],
    };
    let mut beyond = case.clone();
    let position_world = Vector3::new(5.0, 0.0, 0.0);
    beyond.request.terminal = Some(TerminalRegion { position_world, radius_m: 0.3, speed_m_s: 0.05 });
    beyond.expectation = LocalExpectation::Unsolvable;
    let mut free = case.clone();
    free.request.surroundings = &nothing;
    free.settings.criterion = Criterion::D;
    free.request.information = [1.0, 20.0, 20.0, 20.0];
    let make = |settings: &LocalSettings<12, 6>| {
        InformativePlanner::<_, 12, 6, 4>::try_new(RigidBodyModel::<4>::principal(), settings.clone())
    };
    check_local_planner(&RigidBodyModel::<4>::principal(), &make, &[case, beyond, free], &CHECKS).unwrap();
}

#[test]
fn a_body_in_the_plane() {
    let settings = LocalSettings::<6, 3> {
        steps: 12,
        step_s: 0.5,
        tracking: [1.0, 1.0, 0.5, 0.5, 0.3, 0.5],
        terminal: [5.0, 5.0, 2.0, 2.0, 1.0, 1.0],
        effort: [10.0, 1.0, 1.0],
        acceleration: [0.0, 0.0],
        wrench: WrenchSet { limit: [0.04, 0.8, 0.4], half_spaces: vec![([0.0, 1.0, 1.0], 0.7)] },
        speed: SpeedLimits { speed_m_s: Vector3::repeat(0.12), rate_rad_s: Vector3::repeat(0.3) },
        measurement: diagonal([1e4, 1e4, 4e4, 4e4, 1e4, 4e4]),
        retained: [1.0, 0.9, 0.3, 0.5, 0.8, 0.2],
        criterion: Criterion::A,
        margin_m: 0.02,
        length_scale_m: 0.1,
        on_segments: true,
        tolerance: 1e-4,
        iterations: 200,
    };
    let start = PlanarState::at_rest(Vector2::new(0.0, 0.0), 0.4);
    let goal = PlanarState::at_rest(Vector2::new(0.5, 0.1), 0.0);
    let lost = PlanarState { heading_rad: f64::NAN, ..goal };
    let (belief, around) = (belief(), surroundings());
    let case = LocalCase {
        settings,
        request: LocalRequest {
            start: &start,
            start_s: 0.0,
            reference: Reference::Hold(&goal),
            terminal: Some(TerminalRegion {
                position_world: Vector3::new(0.5, 0.1, 0.0),
                radius_m: 0.4,
                speed_m_s: 0.15,
            }),
            belief: &belief,
            information: [0.05, 300.0, 100.0, 100.0],
            reserved: [0.002, 0.05, 0.0],
            surroundings: &around,
            guess: Guess::Excited,
        },
        expectation: LocalExpectation::Solvable,
        units: UNITS,
        impossible: &[lost],
    };
    let make = |settings: &LocalSettings<6, 3>| {
        InformativePlanner::<_, 6, 3, 4>::try_new(PlanarBodyModel::<4>::full(), settings.clone())
    };
    check_local_planner(&PlanarBodyModel::<4>::full(), &make, &[case], &CHECKS).unwrap();
}
