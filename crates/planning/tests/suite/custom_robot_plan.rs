//! Tutorial: plan for a robot of your own. Three steps: say how it moves, check the laws, plan among obstacles.
//!
//! The robot here is a puck on an air table. Four jets push along its diagonals, one at a time, and it must not be faster
//! than 0.1 m/s in any direction: a round limit, where the double integrator of this crate has a box.
#![allow(clippy::unwrap_used)]

use tumble_planning::collision::{BodyShape, EllipsoidWorld};
use tumble_planning::dynamics::{AlignedBox, InertialParameters, ObstacleEllipsoid, World};
use tumble_planning::global::{
    EdgeCheck, GlobalPlanner, GlobalRequest, GoalRegion, MotionLimits, Objective, PrimitiveRrt, PrimitiveRrtSettings,
    Status, Until,
};
use tumble_planning::kinodynamic::stays_in_box;
use tumble_planning::laws::{
    Expectation, PlannerCase, PlannerChecks, check_body_motion, check_global_planner, check_kinodynamic_model,
    check_state_space,
};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3, Vector4};
use tumble_planning::rand_core::Rng;
use tumble_planning::{
    BodyArc, BodyMotion, KinodynamicModel, ModelBelief, PlanningError, Primitive, StateSpace, TranslationState, Units,
    unit_interval,
};

const FASTEST_M_S: f64 = 0.1;
const JET_N: f64 = 0.12;

/// Its state: x, y, and their rates.
type State = Vector4<f64>;

fn rates(state: &State) -> Vector2<f64> {
    Vector2::new(state.z, state.w)
}

#[derive(Clone)]
struct Puck {
    table: AlignedBox,
    jets: Vec<Primitive<Vector3<f64>>>,
}

impl Puck {
    fn new() -> Self {
        let half = JET_N * std::f64::consts::FRAC_1_SQRT_2;
        let forces = [(half, half), (half, -half), (-half, half), (-half, -half), (0.0, 0.0)];
        let jets = forces.map(|(x, y)| Primitive { input: Vector3::new(x, y, 0.0), duration_s: 1.0 }).to_vec();
        Self { table: AlignedBox::between(Vector3::new(-1.0, -1.0, 0.0), Vector3::new(1.0, 1.0, 0.0)), jets }
    }
}

// Step 1a: its states.
impl StateSpace for Puck {
    type State = State;
    fn distance(&self, from: &State, to: &State) -> f64 {
        (to - from).norm()
    }
    fn interpolate(&self, from: &State, to: &State, fraction: f64) -> State {
        from.lerp(to, fraction)
    }
    fn contains(&self, state: &State) -> bool {
        let is_slow = rates(state).norm() <= FASTEST_M_S * (1.0 + 1e-12);
        is_slow && state.x.abs() <= self.table.upper_world.x && state.y.abs() <= self.table.upper_world.y
    }
    fn sample(&self, rng: &mut dyn Rng) -> State {
        // of the square around the round limit, what lies inside it
        loop {
            let mut draw = |size: f64| size * (2.0 * unit_interval(rng) - 1.0);
            let size = self.table.upper_world;
            let state = State::new(draw(size.x), draw(size.y), draw(FASTEST_M_S), draw(FASTEST_M_S));
            if self.contains(&state) {
                return state;
            }
        }
    }
}

// Step 1b: what its jets do.
impl KinodynamicModel for Puck {
    type Input = Vector3<f64>;
    type Parameters = InertialParameters<f64>;
    fn propagate(&self, state: &State, force: &Vector3<f64>, body: &InertialParameters<f64>, duration_s: f64) -> State {
        let acceleration = force.xy() / body.mass;
        let position = state.xy() + rates(state) * duration_s + acceleration * (0.5 * duration_s * duration_s);
        let velocity = rates(state) + acceleration * duration_s;
        State::new(position.x, position.y, velocity.x, velocity.y)
    }
    fn primitives(&self) -> &[Primitive<Vector3<f64>>] {
        &self.jets
    }
}

// Step 1c: the same as motions, which collision checks follow.
impl BodyMotion for Puck {
    fn within(&self, limits: &MotionLimits, _: &UnitQuaternion<f64>) -> Result<Self, PlanningError> {
        let table = AlignedBox {
            lower_world: self.table.lower_world.sup(&limits.position.lower_world),
            upper_world: self.table.upper_world.inf(&limits.position.upper_world),
        };
        Ok(Self { table, ..self.clone() })
    }
    fn state_at(&self, at: &TranslationState) -> State {
        State::new(at.position.x, at.position.y, at.velocity.x, at.velocity.y)
    }
    fn translation(&self, state: &State) -> TranslationState {
        let flat = |x, y| Vector3::new(x, y, 0.0);
        TranslationState { position: flat(state.x, state.y), velocity: flat(state.z, state.w) }
    }
    fn arc(&self, state: &State, force: &Vector3<f64>, body: &InertialParameters<f64>, duration_s: f64) -> BodyArc {
        let start = self.translation(state);
        BodyArc::accelerated(duration_s, &start, force / body.mass, UnitQuaternion::identity())
    }
    fn contains_arc(&self, arc: &BodyArc) -> bool {
        // the speed of a motion with constant acceleration is largest at an end
        let is_slow = [0.0, arc.duration_s].iter().all(|t| arc.translation(*t).0.velocity.norm() <= FASTEST_M_S);
        is_slow && stays_in_box(arc, &self.table)
    }
}

fn body() -> InertialParameters<f64> {
    InertialParameters::about_origin(6.0, Vector3::zeros(), Matrix3::identity() * 0.05)
}

// Step 2: the laws, of the states, of the model and of its motions.
#[test]
fn the_puck_keeps_the_laws() {
    let puck = Puck::new();
    check_state_space(&puck, 1, 200, 1e-12).unwrap();
    check_kinodynamic_model(&puck, &body(), &|force| force.norm() - JET_N * (1.0 + 1e-12), (2, 50), 7, 1e-13).unwrap();
    check_body_motion(&puck, &body(), (3, 50), 5, 1e-13).unwrap();
}

// Step 3: plan. Two posts and a wall stand on the table.
#[test]
fn the_puck_finds_its_way() {
    let post = |x, y, a, b| ObstacleEllipsoid {
        world_from_ellipsoid: Pose::translation(x, y, 0.0),
        semi_axes: Vector3::new(a, b, 0.5),
    };
    let obstacles = vec![post(-0.3, 0.3, 0.15, 0.15), post(0.4, -0.5, 0.15, 0.15), post(0.1, 0.2, 0.08, 0.5)];
    let world = EllipsoidWorld::new(&World { obstacles, ..World::default() }).unwrap();
    let shape = BodyShape::sphere(0.1).unwrap();
    let belief = ModelBelief::certain(4, body());
    let table = AlignedBox::between(Vector3::new(-0.9, -0.9, 0.0), Vector3::new(0.9, 0.9, 0.0));
    let request = |seed: u64| GlobalRequest {
        world: &world,
        body: &shape,
        start: TranslationState::at_rest(Vector3::new(-0.7, 0.0, 0.0)),
        attitude: UnitQuaternion::identity(),
        start_s: 0.0,
        goal: GoalRegion { position: Vector3::new(0.7, 0.0, 0.0), radius_m: 0.1, speed_m_s: 0.1, attitude: None },
        limits: MotionLimits {
            position: table,
            speed_m_s: Vector3::new(FASTEST_M_S, FASTEST_M_S, 0.0),
            force_n: Vector3::new(JET_N, JET_N, 0.0),
            torque_n_m: Vector3::zeros(),
            rate_rad_s: 0.0,
        },
        belief: &belief,
        objective: Objective::Duration,
        margin_m: 0.02,
        until: Until::FirstPlan,
        seed,
    };
    let settings = PrimitiveRrtSettings {
        goal_bias: 0.05,
        iterations: 20_000,
        position_weight: 1.0,
        velocity_weight: 1.0,
        goal_tolerance: f64::INFINITY,
        edge_check: EdgeCheck::Continuous,
    };
    let planner = || PrimitiveRrt::try_new(Puck::new(), settings).unwrap();
    let answer = planner().plan(&request(1), &mut Units::new(100_000)).unwrap();
    assert_eq!(answer.status, Status::Feasible);
    let path = answer.plan.unwrap().trajectory;
    assert!((path.duration_s() - answer.cost).abs() < 1e-9);

    // and whatever the planner, its answers keep the laws of planners
    let cases: Vec<_> = (1..=3)
        .map(|seed| PlannerCase { request: request(seed), expectation: Expectation::Solvable, units: 100_000 })
        .collect();
    let checks = PlannerChecks { samples_per_arc: 100, tolerance: 1e-9, relative_tolerance: 1e-9 };
    check_global_planner(&planner, &cases, &checks).unwrap();
}
