use super::*;
use crate::control::{
    AxisGain, AxisLimits, AxisTemplate, MassInterval, SymmetricBox, Terminal, TubeDisturbance, TubeWeights,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_identification::noise::between;

const NOTHING: TubeDisturbance =
    TubeDisturbance { position_m: 0.0, velocity_m_s: 0.0, force_n: 0.0, acceleration_m_s2: 0.0 };
const W: [f64; 2] = [1e-4, 2e-4];

struct Draw(ChaCha8Rng);

impl Draw {
    fn between(&mut self, least: f64, largest: f64) -> f64 {
        between(&mut self.0, least, largest)
    }

    fn sign(&mut self) -> f64 {
        if self.between(-1.0, 1.0) < 0.0 { -1.0 } else { 1.0 }
    }
}

/// A tube of random limits, the true mass, and the most the rows of the shifted plan are broken over a mission in which the
/// reference jumps, to either side of the walls; `None` where the tube cannot be.
fn worst_of_shifted(seed: u64, terminal: Terminal) -> Option<(f64, bool)> {
    let mut draw = Draw(ChaCha8Rng::seed_from_u64(seed));
    let gain = AxisGain { stiffness: 0.25, damping: 2.0, step_s: 0.2 };
    let template = AxisTemplate::try_new(gain, &SymmetricBox(W.into())).unwrap();
    let (least, largest) = (draw.between(4.0, 9.0), draw.between(9.0, 15.0));
    let wall = draw.between(0.2, 1.0);
    let request = AxisRequest {
        template: &template,
        mass: MassInterval::between(least, largest).unwrap(),
        limits: AxisLimits {
            force_n: draw.between(0.15, 0.4),
            speed_m_s: draw.between(0.05, 0.15),
            walls_m: [-wall, wall],
        },
        shortfall: 0.0,
        disturbance: NOTHING,
        // a dear tube coasts at its least scale
        weights: TubeWeights { scale: f64::powf(10.0, draw.between(-2.0, 2.0)), ..TubeWeights::DEFAULT },
        steps: 12,
        terminal,
    };
    let mut tube = AxisTube::try_new(&request).ok()?;
    let mass = [least, largest, draw.between(least, largest)][(seed % 3) as usize];
    let mut state = Vector2::new(draw.between(-0.5 * wall, 0.5 * wall), 0.0);
    let n = tube.problem.unknowns();
    let (mut worst, mut goal, mut reached) = (f64::NEG_INFINITY, 0.0, false);
    for step in 0..120 {
        if step % 50 == 0 {
            goal = draw.sign() * draw.between(0.0, 2.0 * wall);
        }
        if step > 0 {
            tube.advance();
            let x: Vec<f64> = [tube.plan.start.x, tube.plan.start.y]
                .into_iter()
                .chain(tube.plan.accelerations.iter().copied())
                .chain([tube.plan.scale])
                .collect();
            tube.problem.bounds(&state, &mut tube.lower, &mut tube.upper);
            let rows = tube.problem.rows.chunks(n).zip(tube.lower.iter().zip(&tube.upper));
            for (row, (lower, upper)) in rows {
                let value: f64 = row.iter().zip(&x).map(|(a, x)| a * x).sum();
                worst = worst.max(value - upper).max(lower - value);
            }
        }
        let status = tube.solve(&state, &[Vector2::new(goal, 0.0)]);
        if step == 0 && status != GramStatus::Solved {
            return None;
        }
        assert_eq!(status, GramStatus::Solved, "seed {seed}, step {step}, {worst:e}");
        reached |= state.x.abs() > 0.8 * wall;
        let acceleration = tube.force_n(&state) / mass;
        state = stepped(&state, acceleration, 0.2) + Vector2::new(W[0] * draw.sign(), W[1] * draw.sign());
    }
    Some((worst, reached))
}

/// The proof of recursive feasibility, executed: what the last plan becomes keeps every row at the next state.
#[test]
fn a_plan_shifted_by_a_step_is_a_plan() {
    for terminal in [Terminal::StopSet, Terminal::Rest] {
        let found: Vec<(f64, bool)> = (0..120).filter_map(|seed| worst_of_shifted(seed, terminal)).collect();
        assert!(found.len() > 60, "{}", found.len());
        assert!(found.iter().filter(|(_, reached)| *reached).count() > 20);
        let worst = found.iter().map(|(worst, _)| *worst).fold(f64::NEG_INFINITY, f64::max);
        assert!((-1e-3..1e-9).contains(&worst), "{terminal:?}: {worst}");
    }
}
