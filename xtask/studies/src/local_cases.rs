//! Tasks handed to the local planner: each in the planner's terms, with the judge's beside it.

use std::time::Duration;

use nalgebra::{Isometry3, Quaternion, SMatrix, SVector, UnitQuaternion, Vector3};
use tumble_dynamics::{InertialParameters, ObstacleEllipsoid};
use tumble_planning::collision::MovingObstacle;
use tumble_planning::local::{
    Criterion, Guess, InformativePlanner, Kinematics, LocalAnswer, LocalPlanner, LocalRequest, LocalSettings,
    LocalStatus, Reference, RigidBodyModel, SpeedLimits, Surroundings, WrenchSet,
};
use tumble_planning::{ModelBelief, PlanningError, Units};

use crate::Failure;
use crate::core_clock::CoreClock;
use crate::local_checker::{LocalFindings, LocalTask, Moment};

pub type Planner<const P: usize> = InformativePlanner<RigidBodyModel<P>, 12, 6, P>;

/// More than any plan here takes.
const PLENTY: u64 = 1 << 40;
/// What rounding and the planner's own tolerance may leave of a limit.
pub const SLACK: f64 = 2e-6;
/// The same of an obstacle at a node, as a gauge: the judge's attitude between the stages of a step is not normalised, which
/// moves nodes by 1e-5 m where motions are violent; twice that over a semi-axis of 0.2 m, and half as much again.
const NODE_SLACK: f64 = 1.5e-4;

/// A task as the planner takes it.
pub struct LocalCase<const P: usize> {
    pub task: LocalTask<P>,
    pub belief: ModelBelief,
    surroundings: Surroundings,
    settings: LocalSettings<12, 6>,
}

/// What came of one call of the planner.
pub struct LocalRun<const P: usize> {
    pub elapsed: Duration,
    pub is_converged: bool,
    pub optimality: f64,
    pub iterations: usize,
    pub inputs: Vec<[f64; 6]>,
    /// Standard deviations that the planner predicts for the end.
    pub sigma: Option<[f64; P]>,
    /// What the judge says; nothing without a plan.
    pub findings: Option<LocalFindings<P>>,
    /// Largest difference between the planner's and the judge's positions, velocities and rates at the nodes.
    pub apart: f64,
    /// The planner's own; nothing without a plan.
    pub planned_cost: Option<f64>,
    /// Difference of the planner's and the judge's cost, with one step per input.
    pub cost_error: f64,
}

impl<const P: usize> LocalRun<P> {
    pub fn elapsed_ms(&self) -> f64 {
        1e3 * self.elapsed.as_secs_f64()
    }

    /// By the finer motion; infinite without a plan.
    pub fn cost(&self) -> f64 {
        self.findings.as_ref().map_or(f64::INFINITY, |findings| findings.fine_cost.total())
    }

    /// Whether the judge finds every limit and obstacle kept: on the finer grid, or at the nodes only.
    pub fn is_kept(&self, on_segments: bool) -> bool {
        self.findings.as_ref().is_some_and(|findings| {
            let is_clear = if on_segments { findings.inside == 0 } else { findings.node_margin > -NODE_SLACK };
            is_clear && findings.keeps_limits(SLACK)
        })
    }

    /// Whether a plan was handed out that does not keep them.
    pub fn is_broken(&self, on_segments: bool) -> bool {
        self.findings.is_some() && !self.is_kept(on_segments)
    }
}

#[allow(clippy::needless_pass_by_value)] // given to `map_err`
pub fn failed(error: PlanningError) -> Failure {
    Failure::BadInput(format!("local planner: {error}"))
}

/// Weights of the squares of position, quaternion, velocity and rate by the planner's coordinates of a change.
pub fn by_coordinate(weights: &[f64; 4]) -> [f64; 12] {
    let [position, attitude, velocity, rate] = *weights;
    // a change of attitude is twice that of the quaternion
    let weights = [position, velocity, 0.25 * attitude, rate];
    std::array::from_fn(|i| weights[i / 3])
}

/// A state of the judge as the planner's.
pub fn state(moment: &Moment) -> Kinematics {
    let [x, y, z, qw, qx, qy, qz, vx, vy, vz, wx, wy, wz] = *moment;
    Kinematics {
        world_from_body: Isometry3::from_parts(
            (Vector3::new(x, y, z)).into(),
            UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz)),
        ),
        velocity_world: Vector3::new(vx, vy, vz),
        rate_body: Vector3::new(wx, wy, wz),
    }
}

impl<const P: usize> LocalCase<P> {
    pub fn new(task: LocalTask<P>, steps: usize, on_segments: bool) -> Result<Self, Failure> {
        let told = by_coordinate(&task.measured.map(|sd| 1.0 / (sd * sd)));
        let measurement = SVector::<f64, 12>::from(told);
        let settings = LocalSettings {
            steps,
            step_s: task.step_s,
            tracking: by_coordinate(&task.tracking),
            terminal: by_coordinate(&task.terminal),
            effort: std::array::from_fn(|i| task.effort[i / 3]),
            acceleration: [0.0; 2],
            wrench: WrenchSet { limit: task.wrench, half_spaces: Vec::new() },
            speed: SpeedLimits {
                speed_m_s: Vector3::repeat(task.speed_m_s),
                rate_rad_s: Vector3::repeat(task.rate_rad_s),
            },
            measurement: SMatrix::from_diagonal(&measurement),
            retained: [1.0; 12],
            criterion: Criterion::A,
            margin_m: 0.0,
            length_scale_m: 0.2,
            on_segments,
            tolerance: 1e-6,
            iterations: 200,
        };
        let parameters = InertialParameters::from_vector(&SVector::from(task.parameters));
        let mut belief = ModelBelief::certain(1, parameters);
        belief.estimate.covariance = covariance_of(&task);
        let obstacles = task.obstacles.iter().map(|(center, semi_axes)| {
            let world_from_ellipsoid = Isometry3::translation(center[0], center[1], center[2]);
            MovingObstacle::at_rest(ObstacleEllipsoid { world_from_ellipsoid, semi_axes: Vector3::from(*semi_axes) })
        });
        let surroundings = Surroundings::none().with_moving(obstacles).map_err(failed)?;
        Ok(Self { task, belief, surroundings, settings })
    }

    /// The same from elsewhere to elsewhere.
    pub fn moved(&self, start: Moment, goal: [f64; 3]) -> Self {
        let task = LocalTask { start, goal, ..self.task.clone() };
        Self {
            task,
            belief: self.belief.clone(),
            surroundings: self.surroundings.clone(),
            settings: self.settings.clone(),
        }
    }

    /// The same with all information weights times a factor.
    pub fn weighted(mut self, factor: f64) -> Self {
        self.task.information_weights = self.task.information_weights.map(|weight| weight * factor);
        self
    }

    pub fn planner(&self, model: RigidBodyModel<P>, tolerance: f64) -> Result<Planner<P>, Failure> {
        InformativePlanner::try_new(model, LocalSettings { tolerance, ..self.settings.clone() }).map_err(failed)
    }

    pub fn on_segments(&self) -> bool {
        self.settings.on_segments
    }

    pub fn steps(&self) -> usize {
        self.settings.steps
    }

    /// Plans, timed, and has the plan judged.
    pub fn run(&self, planner: &mut Planner<P>, guess: Guess<'_, 6>) -> Result<LocalRun<P>, Failure> {
        let start = state(&self.task.start);
        let [x, y, z] = self.task.goal;
        let goal = Kinematics::at_rest(Isometry3::translation(x, y, z));
        let request = LocalRequest {
            start: &start,
            start_s: 0.0,
            reference: Reference::Hold(&goal),
            terminal: None,
            belief: &self.belief,
            information: self.task.information_weights,
            reserved: [0.0; 6],
            surroundings: &self.surroundings,
            guess,
        };
        let mut budget = Units::new(PLENTY);
        let clock = CoreClock::start();
        let answer = planner.plan(&request, &mut budget).map_err(failed)?;
        let elapsed = clock.elapsed();
        Ok(self.judged(elapsed, answer))
    }

    fn judged(&self, elapsed: Duration, answer: LocalAnswer<Kinematics, 6, P>) -> LocalRun<P> {
        let mut run = LocalRun {
            elapsed,
            is_converged: answer.status == LocalStatus::Converged,
            optimality: answer.optimality,
            iterations: answer.iterations,
            inputs: Vec::new(),
            sigma: None,
            findings: None,
            apart: 0.0,
            planned_cost: None,
            cost_error: 0.0,
        };
        if let (Some(plan), Some(cost)) = (answer.plan, answer.cost) {
            let findings = self.task.judge(&plan.trajectory.inputs);
            for (planned, found) in plan.trajectory.states.iter().zip(&findings.nodes) {
                let found = state(found);
                let apart = (planned.position_world() - found.position_world())
                    .amax()
                    .max((planned.velocity_world - found.velocity_world).amax())
                    .max((planned.rate_body - found.rate_body).amax());
                run.apart = run.apart.max(apart);
            }
            run.planned_cost = Some(cost.total());
            run.cost_error = (cost.total() - findings.cost.total()).abs();
            run.sigma = plan.trajectory.sigma(self.steps());
            run.inputs = plan.trajectory.inputs;
            run.findings = Some(findings);
        }
        run
    }
}

/// The covariance of the ten parameters that the quantities' prior gives.
fn covariance_of<const P: usize>(task: &LocalTask<P>) -> SMatrix<f64, 10, 10> {
    let information = SMatrix::<f64, P, P>::from_fn(|i, j| task.prior_information[i][j]);
    let of_quantities = information.try_inverse().unwrap_or_else(|| SMatrix::repeat(f64::NAN));
    let by_quantity = SMatrix::<f64, 10, P>::from_fn(|i, c| task.quantities[c][i]);
    by_quantity * of_quantities * by_quantity.transpose()
}

/// The start that the recipe documents: no structure, all inputs, torques of all steps first.
pub fn documented_start(wrench: &[f64; 6], steps: usize) -> Vec<[f64; 6]> {
    let input = |k: usize| {
        std::array::from_fn(|i| {
            let place = if i < 3 { 3 * k + i } else { 3 * steps + 3 * k + i - 3 };
            0.3 * wrench[i] * (1.0 + 1.7 * place as f64).sin()
        })
    };
    (0..steps).map(input).collect()
}

/// The prototype's random numbers in [-1, 1), so that its draws can be repeated.
pub struct Xorshift(pub u64);

impl Xorshift {
    pub fn next(&mut self) -> f64 {
        const UNIT: f64 = 1.0 / (1_u64 << 53) as f64;
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        2.0 * (self.0 >> 11) as f64 * UNIT - 1.0
    }

    /// Inputs up to a share of the limits, drawn in the prototype's order: torques of all steps first.
    pub fn inputs(&mut self, wrench: &[f64; 6], steps: usize, share: f64) -> Vec<[f64; 6]> {
        let mut inputs = vec![[0.0; 6]; steps];
        for half in 0..2 {
            for input in &mut inputs {
                for (value, limit) in input.iter_mut().zip(wrench).skip(3 * half).take(3) {
                    *value = share * limit * self.next();
                }
            }
        }
        inputs
    }
}
