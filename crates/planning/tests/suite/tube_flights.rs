//! Missions of the tube controller, flown axis by axis against the judge in `tube_plant`.
//!
//! A mission: three axes, each from rest to a goal that may lie behind a wall; a true mass at the end of the interval or inside;
//! beliefs that narrow the interval on the way; disturbances chosen anew for each segment.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use tumble_planning::PlanningError;
use tumble_planning::control::{
    AxisGain, AxisLimits, AxisRequest, AxisTemplate, AxisTube, GramStatus, MassInterval, SymmetricBox, Terminal,
    TubeDisturbance, TubeWeights,
};
use tumble_planning::nalgebra::Vector2;

use crate::tube_plant::{Bounds, Decision, Disturbances, Findings, Moment, Plant, Policy};
use tumble_identification::noise::{between, unit_interval};

/// Steps of a mission: 80 s at 5 Hz.
pub const STEPS: usize = 400;
/// Steps flown with one way of choosing disturbances.
const SEGMENT: usize = 100;
/// When the first belief comes and how long after it the next, steps.
const REVISIONS: [usize; 2] = [60, 160];
/// Half of the room on each axis, m.
pub const HALF_ROOM_M: [f64; 3] = [0.45, 1.15, 0.55];
/// Distance of starts and goals inside from the walls, m.
const FROM_WALL_M: f64 = 0.06;

/// What is wrong with a controller on purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Defect {
    Nothing,
    /// Accelerations are turned into forces by the middle of the masses instead of the middle of their inverses.
    MiddleOfMasses,
    /// The tube holds everything but the uncertain mass.
    NoMass,
}

/// What all missions of a series have in common.
#[derive(Clone, Debug)]
pub struct Series {
    pub name: &'static str,
    pub terminal: Terminal,
    pub speed_m_s: f64,
    pub force_n: [f64; 3],
    /// Least and largest possible mass, kg.
    pub mass_kg: [f64; 2],
    pub disturbances: Disturbances,
    pub steps: usize,
    /// Share of goals behind a wall.
    pub behind_walls: f64,
    /// How disturbances are chosen, if not anew for each segment.
    pub policy: Option<Policy>,
    pub defect: Defect,
}

impl Series {
    /// The series all others differ from: mass known to half of it either way, the small actuator limit, a stop set.
    pub fn usual(mass_kg: f64) -> Self {
        Self {
            name: "stop set",
            terminal: Terminal::StopSet,
            speed_m_s: 0.05,
            force_n: [0.15; 3],
            mass_kg: [0.5 * mass_kg, 1.5 * mass_kg],
            disturbances: Disturbances { jump: [1e-4, 2e-4], ..Disturbances::default() },
            steps: 25,
            behind_walls: 0.3,
            policy: None,
            defect: Defect::Nothing,
        }
    }

    /// Gain and unit tubes for everything but force and mass.
    pub fn template(&self) -> Result<AxisTemplate, PlanningError> {
        let gain = AxisGain::default();
        let errors = self.outside().of_measurement(gain.step_s);
        AxisTemplate::try_new(gain, &SymmetricBox(Vector2::from(self.disturbances.jump) + errors))
    }

    fn outside(&self) -> TubeDisturbance {
        let Disturbances { force_n, measured, .. } = self.disturbances;
        TubeDisturbance { position_m: measured[0], velocity_m_s: measured[1], force_n, acceleration_m_s2: 0.0 }
    }

    fn bounds(&self, axis: usize) -> Bounds {
        let half = HALF_ROOM_M[axis];
        Bounds { force_n: self.force_n[axis], speed_m_s: self.speed_m_s, walls_m: [-half, half] }
    }

    /// The controller of an axis for an interval of masses, kg.
    pub fn axis(&self, template: &AxisTemplate, axis: usize, mass_kg: [f64; 2]) -> Result<AxisTube, PlanningError> {
        let mut mass = MassInterval::between(mass_kg[0], mass_kg[1])?;
        if self.defect == Defect::NoMass {
            mass = MassInterval::between(mass.center_kg(), mass.center_kg())?;
        }
        let Bounds { force_n, speed_m_s, walls_m } = self.bounds(axis);
        AxisTube::try_new(&AxisRequest {
            template,
            mass,
            limits: AxisLimits { force_n, speed_m_s, walls_m },
            shortfall: 0.0,
            disturbance: self.outside(),
            weights: TubeWeights::DEFAULT,
            steps: self.steps,
            terminal: self.terminal,
        })
    }
}

/// What came of a series.
#[derive(Clone, Debug, Default)]
pub struct Flown {
    pub missions: usize,
    /// Missions in which an axis had no plan at its start.
    pub infeasible: usize,
    /// Steps at which no plan was found, so that the last one was flown on.
    pub failed: u64,
    pub adopted: u64,
    /// Steps that a belief waited.
    pub postponed: u64,
    /// Beliefs not taken over to the end.
    pub never_adopted: u64,
    pub findings: Findings,
    /// Distance of each axis from its goal, or from the wall before it, at the end, m.
    pub ends_m: Vec<f64>,
    pub iterations: u64,
    pub most_iterations: usize,
    /// Nominal acceleration on each axis with the first interval, m/s^2, and rows of the program.
    pub acceleration_m_s2: [f64; 3],
    pub rows: [usize; 3],
    /// What the controller keeps from the wall beside the tube, m.
    pub wall_slack_m: [f64; 3],
    /// Smallest distance of a decision's position from the wall less what is kept from it then, m.
    pub nearest_wall_m: f64,
}

/// What is drawn for a mission.
struct Mission {
    true_kg: f64,
    /// When, and which interval.
    beliefs: Vec<(usize, [f64; 2])>,
}

fn drawn(index: usize, [least, largest]: [f64; 2], chance: &mut ChaCha8Rng) -> Mission {
    let true_kg = match index % 4 {
        0 => least,
        1 => largest,
        _ => between(chance, least, largest),
    };
    let count = (chance.next_u64() % 3) as usize;
    let mut interval = [least, largest];
    let narrow = |start: usize| {
        interval = [between(chance, interval[0], true_kg), between(chance, true_kg, interval[1])];
        (start, interval)
    };
    Mission { true_kg, beliefs: REVISIONS.into_iter().take(count).map(narrow).collect() }
}

/// Flies missions; `progress` hears of each that is done.
pub fn fly(series: &Series, missions: usize, mut progress: impl FnMut(usize)) -> Result<Flown, PlanningError> {
    let template = series.template()?;
    let mut flown = Flown { missions, nearest_wall_m: f64::INFINITY, ..Flown::default() };
    let mut first = Vec::new();
    for axis in 0..3 {
        let tube = series.axis(&template, axis, series.mass_kg)?;
        flown.acceleration_m_s2[axis] = tube.problem().acceleration_m_s2;
        flown.rows[axis] = tube.problem().equality.len();
        flown.wall_slack_m[axis] = tube.problem().slack[0];
        first.push(tube);
    }
    for index in 0..missions {
        let mut chance = ChaCha8Rng::seed_from_u64(index as u64);
        let mission = drawn(index, series.mass_kg, &mut chance);
        let mut is_feasible = true;
        for (axis, tube) in first.iter().enumerate() {
            let reach = HALF_ROOM_M[axis] - FROM_WALL_M;
            let [start, inside] = [0, 1].map(|_| between(&mut chance, -reach, reach));
            let is_inside = unit_interval(&mut chance) >= series.behind_walls;
            let goal = if is_inside { inside } else { 1.2 * HALF_ROOM_M[axis].copysign(inside) };
            let seed = chance.next_u64();
            let mut flight = Flight {
                series,
                template: &template,
                axis,
                goal: Vector2::new(goal, 0.0),
                tube: tube.clone(),
                plant: Plant::new(
                    mission.true_kg,
                    template.gain.step_s,
                    start,
                    series.bounds(axis),
                    series.disturbances,
                    seed,
                ),
            };
            is_feasible &= flight.fly(&mission, &mut flown)?;
        }
        flown.infeasible += usize::from(!is_feasible);
        progress(index + 1);
    }
    flown.ends_m.sort_by(f64::total_cmp);
    Ok(flown)
}

/// One axis of one mission.
struct Flight<'a> {
    series: &'a Series,
    template: &'a AxisTemplate,
    axis: usize,
    /// Position and velocity.
    goal: Vector2<f64>,
    tube: AxisTube,
    plant: Plant,
}

impl Flight<'_> {
    /// Whether there was a plan at the start.
    fn fly(&mut self, mission: &Mission, flown: &mut Flown) -> Result<bool, PlanningError> {
        let mut coming = mission.beliefs.iter().peekable();
        let mut waiting: Option<AxisTube> = None;
        let mut interval = self.series.mass_kg;
        let mut waiting_interval = interval;
        let goal = [self.goal];
        for step in 0..STEPS {
            if step % SEGMENT == 0 {
                self.disturb_anew();
            }
            if let Some((_, narrower)) = coming.next_if(|(when, _)| *when == step) {
                waiting = Some(self.series.axis(self.template, self.axis, *narrower)?);
                waiting_interval = *narrower;
                self.disturb_anew();
            }
            let measured = Vector2::from(self.plant.measured());
            let mut is_planned = false;
            if let Some(next) = &mut waiting {
                is_planned = next.solve(&measured, &goal) == GramStatus::Solved;
                flown.adopted += u64::from(is_planned);
                flown.postponed += u64::from(!is_planned);
            }
            if is_planned {
                self.tube = waiting.take().unwrap_or_else(|| self.tube.clone());
                interval = waiting_interval;
            } else {
                is_planned = self.tube.solve(&measured, &goal) == GramStatus::Solved;
                if !is_planned && step == 0 {
                    return Ok(false);
                }
            }
            flown.failed += u64::from(!is_planned);
            flown.iterations += self.tube.iterations() as u64;
            flown.most_iterations = flown.most_iterations.max(self.tube.iterations());
            self.step(&measured, interval);
            let kept = self.tube.problem().slack[0];
            let near = HALF_ROOM_M[self.axis] - self.plant.state()[0].abs() - kept;
            flown.nearest_wall_m = flown.nearest_wall_m.min(near);
            self.tube.advance();
        }
        flown.never_adopted += u64::from(waiting.is_some());
        let half = HALF_ROOM_M[self.axis];
        flown.ends_m.push((self.plant.state()[0] - self.goal.x.clamp(-half, half)).abs());
        flown.findings.merge(&self.plant.findings);
        Ok(true)
    }

    fn disturb_anew(&mut self) {
        match self.series.policy {
            Some(policy) => self.plant.set_policy(policy),
            None => self.plant.draw_policy(),
        }
    }

    /// Sends the force and lets the judge look at it.
    fn step(&mut self, measured: &Vector2<f64>, interval: [f64; 2]) {
        let (problem, plan) = (self.tube.problem(), self.tube.plan());
        let faces: [(Moment, f64); 5] = core::array::from_fn(|i| {
            let normal = problem.normals[i];
            ([normal.x, normal.y], plan.scale * problem.scaled[i] + problem.held[i])
        });
        let mut decision = Decision {
            force_n: self.tube.force_n(measured),
            center_kg: problem.center_kg,
            gain: [self.template.gain.stiffness, self.template.gain.damping],
            start: [plan.start.x, plan.start.y],
            acceleration_m_s2: plan.accelerations.first().copied().unwrap_or(0.0),
            faces: &faces,
        };
        if self.series.defect == Defect::MiddleOfMasses {
            let center_kg = 0.5 * (interval[0] + interval[1]);
            decision.force_n *= center_kg / decision.center_kg;
            decision.center_kg = center_kg;
        }
        self.plant.step(&decision);
    }
}
