//! Three axes between walls and ten fixed planes, flown to and fro with the lightest and the heaviest body.
#![allow(dead_code, reason = "one module for several tests")]

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_planning::control::{
    AxisGain, AxisLimits, AxisPlane, AxisProblem, AxisRequest, AxisTemplate, CoupledAxes, GramStatus, MassInterval,
    SymmetricBox, Terminal, TubeDisturbance, TubeWeights,
};
use tumble_planning::nalgebra::{Vector2, Vector3};
use tumble_planning::unit_interval;

pub const STEPS: usize = 25;
const STEP_S: f64 = 0.2;
const MASS_KG: f64 = 9.58;
const FORCE_N: f64 = 0.15;
const SPEED_M_S: f64 = 0.05;
const WALLS_M: [f64; 3] = [0.45, 1.15, 0.55];
/// What a step adds to position and velocity at worst.
const ADDED: [f64; 2] = [1e-4, 2e-4];

fn between(random: &mut ChaCha8Rng, lower: f64, upper: f64) -> f64 {
    lower + (upper - lower) * unit_interval(random)
}

fn direction(random: &mut ChaCha8Rng) -> Vector3<f64> {
    loop {
        let v = Vector3::from_fn(|_, _| between(random, -1.0, 1.0));
        if v.norm_squared() > 0.01 && v.norm_squared() < 1.0 {
            return v.normalize();
        }
    }
}

pub fn problems() -> [AxisProblem; 3] {
    let template = AxisTemplate::try_new(AxisGain::default(), &SymmetricBox(Vector2::from(ADDED))).unwrap();
    WALLS_M.map(|wall| {
        AxisProblem::try_new(&AxisRequest {
            template: &template,
            mass: MassInterval::between(0.5 * MASS_KG, 1.5 * MASS_KG).unwrap(),
            limits: AxisLimits { force_n: FORCE_N, speed_m_s: SPEED_M_S, walls_m: [-wall, wall] },
            shortfall: 0.0,
            disturbance: TubeDisturbance { position_m: 0.0, velocity_m_s: 0.0, force_n: 0.0, acceleration_m_s2: 0.0 },
            weights: TubeWeights::DEFAULT,
            steps: STEPS,
            terminal: Terminal::Rest,
        })
        .unwrap()
    })
}

/// Ten half-spaces about the origin, each at all nodes.
pub fn planes(seed: u64) -> Vec<AxisPlane> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut planes = Vec::new();
    for obstacle in 0..10 {
        let (normal, offset_m) = (direction(&mut random), between(&mut random, 0.25, 0.4));
        planes.extend((1..=STEPS).map(|node| AxisPlane { obstacle, step: node, node, normal, offset_m }));
    }
    planes
}

/// What came of the missions.
#[derive(Clone, Debug, Default)]
pub struct Flown {
    pub steps: usize,
    pub failed: usize,
    /// Largest excess of the true position over a plane or a wall, m.
    pub excess_m: f64,
    pub speed_excess_m_s: f64,
    pub iterations: Vec<usize>,
}

/// Flies missions; `observe` sees the program before each solve with its states and references.
pub fn fly(
    missions: u64,
    steps: usize,
    planes: &[AxisPlane],
    mut observe: impl FnMut(&CoupledAxes, &[Vector2<f64>; 3], &[Vec<Vector2<f64>>; 3], bool),
) -> Flown {
    let problems = problems();
    let mut coupled = CoupledAxes::try_new(problems).unwrap();
    let mut flown = Flown { excess_m: f64::NEG_INFINITY, speed_excess_m_s: f64::NEG_INFINITY, ..Flown::default() };
    for mission in 0..missions {
        let mut random = ChaCha8Rng::seed_from_u64(1000 + mission);
        let spread = Vector3::new(0.35, 1.0, 0.45);
        let mut anywhere = || Vector3::from_fn(|i, _| spread[i] * between(&mut random, -1.0, 1.0));
        let start = loop {
            let start = anywhere();
            if planes.iter().all(|plane| plane.normal.dot(&start) < plane.offset_m - 0.06) {
                break start;
            }
        };
        let goal = anywhere();
        let references: [Vec<Vector2<f64>>; 3] = [0, 1, 2].map(|i| vec![Vector2::new(goal[i], 0.0)]);
        let mut states: [Vector2<f64>; 3] = [0, 1, 2].map(|i| Vector2::new(start[i], 0.0));
        let mass_kg = MASS_KG * if unit_interval(&mut random) < 0.5 { 0.5 } else { 1.5 };
        coupled.begin(&states);
        coupled.set_planes(planes);
        for step in 0..steps {
            observe(&coupled, &states, &references, step == 0);
            let status = coupled.solve(&states, [&references[0], &references[1], &references[2]]);
            flown.iterations.push(coupled.iterations());
            flown.steps += 1;
            if status != GramStatus::Solved {
                flown.failed += 1;
                break;
            }
            for (i, state) in states.iter_mut().enumerate() {
                let input = coupled.problems()[i].force_n(&coupled.plans()[i], state) / mass_kg;
                let mut sign = || if unit_interval(&mut random) < 0.5 { -1.0 } else { 1.0 };
                state.x += STEP_S * (state.y + 0.5 * STEP_S * input) + ADDED[0] * sign();
                state.y += STEP_S * input + ADDED[1] * sign();
                flown.speed_excess_m_s = flown.speed_excess_m_s.max(state.y.abs() - SPEED_M_S);
                flown.excess_m = flown.excess_m.max(state.x.abs() - WALLS_M[i]);
            }
            let position = Vector3::from_fn(|i, _| states[i].x);
            for plane in planes {
                flown.excess_m = flown.excess_m.max(plane.normal.dot(&position) - plane.offset_m);
            }
            coupled.advance();
        }
    }
    flown
}
