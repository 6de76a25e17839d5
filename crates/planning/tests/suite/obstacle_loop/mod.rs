//! A body with an unknown mass among obstacles, flown by the coupled program and judged by the collision world.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_identification::noise::between;
use tumble_planning::collision::{BodyEllipsoid, BodyShape, CollisionWorld as _, EllipsoidWorld, MovingObstacle};
use tumble_planning::control::{
    AxisGain, AxisLimits, AxisPlane, AxisProblem, AxisRequest, AxisTemplate, CoupledAxes, EndAttitude, GramStatus,
    MassInterval, NominalPath, ObstaclePlanes, PlaneUpdate, SymmetricBox, Terminal, TubeDisturbance, TubeWeights,
};
use tumble_planning::dynamics::{ObstacleEllipsoid, World};
use tumble_planning::lie::Pose;
use tumble_planning::local::Barrier;
use tumble_planning::nalgebra::{Translation3, Unit, UnitQuaternion, Vector2, Vector3};
use tumble_planning::unit_interval;

pub const STEP_S: f64 = 0.2;
pub const STEPS: usize = 25;
pub const MASS_KG: f64 = 9.58;
pub const DISTURBANCE: TubeDisturbance =
    TubeDisturbance { position_m: 2e-4, velocity_m_s: 2e-4, force_n: 2e-3, acceleration_m_s2: 0.0 };

/// Uniform numbers of a mission.
pub struct Random(ChaCha8Rng);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn between(&mut self, lower: f64, upper: f64) -> f64 {
        between(&mut self.0, lower, upper)
    }

    pub fn sign(&mut self) -> f64 {
        if unit_interval(&mut self.0) < 0.5 { -1.0 } else { 1.0 }
    }

    pub fn vector(&mut self, bound: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.between(-bound, bound))
    }

    pub fn direction(&mut self) -> Unit<Vector3<f64>> {
        loop {
            let v = self.vector(1.0);
            if v.norm_squared() > 0.01 && v.norm_squared() < 1.0 {
                return Unit::new_normalize(v);
            }
        }
    }

    pub fn attitude(&mut self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&self.direction(), self.between(0.0, 3.0))
    }
}

/// The axes of a mass interval `MASS_KG (1 +- share)`.
pub fn problems(share: f64, force_n: f64, speed_m_s: f64, walls_m: [[f64; 2]; 3]) -> [AxisProblem; 3] {
    let template =
        AxisTemplate::try_new(AxisGain::default(), &SymmetricBox(DISTURBANCE.of_measurement(STEP_S))).unwrap();
    walls_m.map(|walls_m| {
        AxisProblem::try_new(&AxisRequest {
            template: &template,
            mass: MassInterval::between(MASS_KG * (1.0 - share), MASS_KG * (1.0 + share)).unwrap(),
            limits: AxisLimits { force_n, speed_m_s, walls_m },
            shortfall: 0.0,
            disturbance: DISTURBANCE,
            weights: TubeWeights::DEFAULT,
            steps: STEPS,
            terminal: Terminal::Rest,
        })
        .unwrap()
    })
}

/// How the planes of a mission are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Planes {
    /// As they should be.
    Kept,
    /// Without the tube.
    WithoutTube,
    /// About the straight way to the goal: not asked whether the shifted plan keeps them.
    AlwaysReplaced,
    /// As if the body had no attitude error and did not turn.
    WithoutTurn,
}

/// One mission.
#[derive(Clone, Debug)]
pub struct Mission {
    pub seed: u64,
    pub share: f64,
    pub true_mass_kg: f64,
    pub force_n: f64,
    pub world_from_axes: UnitQuaternion<f64>,
    pub obstacles: Vec<MovingObstacle>,
    pub start_world: Vector3<f64>,
    pub goal_world: Vector3<f64>,
    /// Body rate of the reference, and until when it turns.
    pub rate_world: Vector3<f64>,
    pub turns_until_s: f64,
    pub end: EndAttitude,
    pub attitude_error_rad: f64,
    pub decisions: usize,
    pub planes: Planes,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Outcome {
    pub started: bool,
    /// Decisions without a plan.
    pub failed: usize,
    pub first_failure: Option<GramStatus>,
    /// First decision without a plan.
    pub failed_at: Option<usize>,
    /// Planes that the shifted plan did not keep, and the first decision with one.
    pub cut: usize,
    pub cut_at: Option<usize>,
    pub replaced: usize,
    pub kept: usize,
    /// Least distance of the true body from an obstacle, also between decisions, m.
    pub clearance_m: f64,
    pub flown_m: f64,
    pub decisions: usize,
    pub to_goal_m: f64,
    pub rows: usize,
    pub iterations: usize,
}

/// An ellipsoid and a ball beside it.
pub fn body() -> BodyShape {
    let part = |x: f64, y: f64, semi_axes: Vector3<f64>| BodyEllipsoid {
        body_from_ellipsoid: Pose::from_parts(Translation3::new(x, y, 0.0), UnitQuaternion::identity()),
        semi_axes,
    };
    BodyShape::try_new(vec![
        part(0.02, 0.0, Vector3::new(0.2, 0.12, 0.15)),
        part(-0.05, 0.18, Vector3::new(0.08, 0.08, 0.08)),
    ])
    .unwrap()
}

/// The point of the body that is planned for.
pub fn tracked_body() -> Vector3<f64> {
    Vector3::new(0.01, 0.03, -0.01)
}

impl Mission {
    fn reference_at(&self, time_s: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(self.rate_world * time_s.min(self.turns_until_s))
    }

    /// Flies it.
    pub fn fly(&self) -> Outcome {
        let mut random = Random::new(self.seed ^ 0x5eed);
        let world = EllipsoidWorld::new(&World::default()).unwrap().with_obstacles(self.obstacles.clone()).unwrap();
        let barriers: Vec<Barrier> = self.obstacles.iter().map(|obstacle| Barrier::Ellipsoid(*obstacle)).collect();
        let walls = [[f64::NEG_INFINITY, f64::INFINITY]; 3];
        let mut problems = problems(self.share, self.force_n, 0.1, walls);
        if self.planes == Planes::WithoutTube {
            for problem in &mut problems {
                (problem.scaled[2], problem.held[2], problem.slack[0]) = (0.0, 0.0, 0.0);
            }
        }
        let mut coupled = CoupledAxes::try_new(problems).unwrap();
        let body = body();
        let mut planes = ObstaclePlanes::try_new(&body, &tracked_body(), &barriers, STEPS).unwrap();
        let axes_from_world = self.world_from_axes.inverse();
        let goal = axes_from_world * self.goal_world;
        let references: [Vec<Vector2<f64>>; 3] = core::array::from_fn(|i| vec![Vector2::new(goal[i], 0.0)]);
        let start = axes_from_world * self.start_world;
        let mut states: [Vector2<f64>; 3] = core::array::from_fn(|i| Vector2::new(start[i], 0.0));
        let mut outcome = Outcome {
            started: false,
            failed: 0,
            first_failure: None,
            failed_at: None,
            cut: 0,
            cut_at: None,
            replaced: 0,
            kept: 0,
            clearance_m: f64::INFINITY,
            flown_m: 0.0,
            decisions: self.decisions,
            to_goal_m: 0.0,
            rows: 0,
            iterations: 0,
        };
        let (mut positions, mut rows) = (Vec::new(), Vec::<AxisPlane>::new());
        let mut last_end = None;
        for decision in 0..self.decisions {
            let now_s = STEP_S * decision as f64;
            let mut measured = states;
            for state in &mut measured {
                state.x += DISTURBANCE.position_m * random.sign();
                state.y += DISTURBANCE.velocity_m_s * random.sign();
            }
            if decision == 0 {
                coupled.begin(&measured);
            }
            coupled.positions(&mut positions);
            if self.planes == Planes::AlwaysReplaced {
                let here = Vector3::from_fn(|i, _| measured[i].x);
                for (k, position) in positions.iter_mut().enumerate() {
                    let ahead_m = 0.08 * STEP_S * k as f64;
                    *position = here + (goal - here) * (ahead_m / (goal - here).norm()).min(1.0);
                }
                planes.forget();
            }
            let attitudes: Vec<_> = (0..=STEPS).map(|k| self.reference_at(now_s + STEP_S * k as f64)).collect();
            // once it holds it holds
            let last_s = now_s + STEP_S * STEPS as f64;
            let end = if self.end == EndAttitude::Held && last_s >= self.turns_until_s + STEP_S {
                EndAttitude::Held
            } else {
                EndAttitude::Any
            };
            if last_end == Some(EndAttitude::Held) {
                assert_eq!(end, EndAttitude::Held);
            }
            last_end = Some(end);
            let without_turn = self.planes == Planes::WithoutTurn;
            let path = NominalPath {
                start_s: now_s,
                step_s: STEP_S,
                positions: &positions,
                tube_m: coupled.tube_m(),
                world_from_axes: self.world_from_axes,
                attitudes: if without_turn { &[UnitQuaternion::identity(); STEPS + 1] } else { &attitudes },
                turn_rad_s: if without_turn { 0.0 } else { self.rate_world.norm() },
                end: if without_turn { EndAttitude::Held } else { end },
                attitude_error_rad: if without_turn { 0.0 } else { self.attitude_error_rad },
            };
            let reach = coupled.reach(&measured);
            let update: PlaneUpdate = planes.update(&path, &reach).unwrap();
            planes.rows(&path, &reach, &mut rows);
            outcome.rows = outcome.rows.max(rows.len());
            coupled.set_planes(&rows);
            let status = coupled.solve(&measured, [&references[0], &references[1], &references[2]]);
            outcome.iterations = outcome.iterations.max(coupled.iterations());
            if decision == 0 {
                outcome.started = status == GramStatus::Solved && update.cut == 0;
                if !outcome.started {
                    return outcome;
                }
            } else {
                outcome.cut += update.cut;
                if update.cut > 0 {
                    outcome.cut_at.get_or_insert(decision);
                }
                outcome.replaced += update.replaced;
                outcome.kept += update.kept;
                if status != GramStatus::Solved {
                    outcome.failed += 1;
                    outcome.first_failure.get_or_insert(status);
                    outcome.failed_at.get_or_insert(decision);
                }
            }
            let before = states;
            let mut inputs = [0.0; 3];
            for i in 0..3 {
                let force = coupled.problems()[i].force_n(&coupled.plans()[i], &measured[i]);
                let pushed = DISTURBANCE.force_n * random.sign();
                inputs[i] = (force + pushed) / self.true_mass_kg;
                states[i].x += STEP_S * (states[i].y + 0.5 * STEP_S * inputs[i]);
                states[i].y += STEP_S * inputs[i];
            }
            // an attitude error of the largest angle allowed, about an axis of its own in each step
            let error = UnitQuaternion::from_axis_angle(&random.direction(), self.attitude_error_rad);
            for part in 0..=4 {
                let since_s = STEP_S * f64::from(part) / 4.0;
                let position =
                    Vector3::from_fn(|i, _| before[i].x + since_s * (before[i].y + 0.5 * since_s * inputs[i]));
                let attitude = error * self.reference_at(now_s + since_s);
                let origin = self.world_from_axes * position - attitude * tracked_body();
                let pose = Pose::from_parts(origin.into(), attitude);
                let clearance = world.clearance(&body, &pose, now_s + since_s).unwrap();
                outcome.clearance_m = outcome.clearance_m.min(clearance.distance_m);
            }
            outcome.flown_m += (0..3).map(|i| (states[i].x - before[i].x).abs()).fold(0.0, f64::max);
            coupled.advance();
            planes.advance();
        }
        outcome.to_goal_m = (0..3).map(|i| (states[i].x - goal[i]).abs()).fold(0.0, f64::max);
        outcome
    }
}

/// A random mission among obstacles at rest.
pub fn mission(seed: u64) -> Mission {
    let mut random = Random::new(seed);
    let share = [0.5, 0.3, 0.1][(seed % 3) as usize];
    let wanted = random.between(2.0, 6.0);
    let obstacles = (1..6)
        .filter(|count| f64::from(*count) <= wanted)
        .map(|_| {
            let pose = Pose::from_parts(random.vector(0.8).into(), random.attitude());
            let semi_axes = Vector3::from_fn(|_, _| random.between(0.08, 0.3));
            MovingObstacle::at_rest(ObstacleEllipsoid { world_from_ellipsoid: pose, semi_axes })
        })
        .collect();
    Mission {
        seed,
        share,
        true_mass_kg: MASS_KG * (1.0 + share * if seed.is_multiple_of(2) { 1.0 } else { -1.0 }),
        force_n: 0.4,
        world_from_axes: if seed.is_multiple_of(4) { UnitQuaternion::identity() } else { random.attitude() },
        obstacles,
        start_world: random.vector(1.0),
        goal_world: random.vector(1.2),
        rate_world: random.direction().into_inner() * random.between(0.0, 0.15),
        turns_until_s: random.between(3.0, 30.0),
        end: if seed.is_multiple_of(5) { EndAttitude::Any } else { EndAttitude::Held },
        attitude_error_rad: random.between(0.0, 0.1),
        decisions: 45,
        planes: Planes::Kept,
    }
}
