use super::*;
use crate::control::{AxisGain, SymmetricBox};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_identification::noise::signed_unit;

const GAIN: AxisGain = AxisGain { stiffness: 0.25, damping: 2.0, step_s: 0.2 };
const NOTHING: TubeDisturbance =
    TubeDisturbance { position_m: 0.0, velocity_m_s: 0.0, force_n: 0.0, acceleration_m_s2: 0.0 };

fn template() -> AxisTemplate {
    AxisTemplate::try_new(GAIN, &SymmetricBox(Vector2::new(1e-4, 2e-4))).unwrap()
}

fn request(template: &AxisTemplate, share: f64) -> AxisRequest<'_> {
    AxisRequest {
        template,
        mass: MassInterval::between(9.58 * (1.0 - share), 9.58 * (1.0 + share)).unwrap(),
        limits: AxisLimits { force_n: 0.15, speed_m_s: 0.05, walls_m: [-0.45, 0.45] },
        shortfall: 0.0,
        disturbance: NOTHING,
        weights: TubeWeights::DEFAULT,
        steps: 25,
        terminal: Terminal::StopSet,
    }
}

fn random(seed: u64, count: usize) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| signed_unit(&mut random)).collect()
}

/// What errors of measurement make the feedback ask for at most is what plans leave it in full, and else the share that is reserved.
#[test]
fn plans_leave_the_feedback_what_is_reserved() {
    let left = |reserved: f64| {
        let template = AxisTemplate { reserved, ..template() };
        AxisProblem::try_new(&request(&template, 0.5)).unwrap().acceleration_m_s2
    };
    let template = template();
    let most = (0..10_000).map(|i| {
        let (sine, cosine) = f64::sin_cos(f64::from(i) * 1e-4 * core::f64::consts::TAU);
        let towards = Vector2::new(cosine, sine);
        let faces = template.normals.iter().zip(template.unmatched);
        let length = faces.map(|(normal, bound)| bound / normal.dot(&towards).abs()).fold(f64::INFINITY, f64::min);
        GAIN.feedback().dot(&(towards * length))
    });
    let most = most.fold(0.0, f64::max);
    for reserved in [0.05, 0.5, 1.0] {
        let taken = left(0.0) - left(reserved);
        assert!((taken / (reserved * most) - 1.0).abs() < 1e-3, "{taken} of {most}");
    }
}

/// Nominal states, step by step.
fn simulated(problem: &AxisProblem, x: &[f64]) -> Vec<Vector2<f64>> {
    let h = problem.step_s;
    let mut states = vec![Vector2::new(x[0], x[1])];
    for k in 0..problem.steps {
        let (state, a) = (states[k], x[2 + k]);
        states.push(Vector2::new(state.x + h * state.y + 0.5 * h * h * a, state.y + h * a));
    }
    states
}

#[test]
fn the_quadratic_form_is_the_sum_over_the_steps() {
    let template = template();
    let problem = AxisProblem::try_new(&request(&template, 0.5)).unwrap();
    let n = problem.unknowns();
    let mut linear = vec![0.0; n];
    let terminal = problem.terminal_cost;
    for seed in 0..20 {
        let x = random(seed, n);
        let reference: Vec<Vector2<f64>> =
            random(seed + 100, 2 * (problem.steps + 1)).chunks(2).map(|pair| Vector2::new(pair[0], pair[1])).collect();
        problem.linear(&reference, &mut linear);
        let quadratic: f64 = (0..n)
            .flat_map(|i| (0..n).map(move |j| (i, j)))
            .map(|(i, j)| x[i] * problem.hessian[i * n + j] * x[j])
            .sum();
        let found = 0.5 * quadratic + linear.iter().zip(&x).map(|(f, x)| f * x).sum::<f64>();
        let mut expected = 0.5 * 0.01 * x[n - 1] * x[n - 1];
        for (k, (state, wanted)) in simulated(&problem, &x).iter().zip(&reference).enumerate() {
            let cost = if k < problem.steps { Matrix2::new(10.0, 0.0, 0.0, 30.0) } else { terminal };
            expected += 0.5 * (state - wanted).dot(&(cost * (state - wanted))) - 0.5 * wanted.dot(&(cost * wanted));
            if let Some(next) = reference.get(k + 1) {
                let (beyond, with) = (x[2 + k], (next.y - wanted.y) / 0.2);
                expected += 50.0 * ((beyond - with) * (beyond - with) - with * with);
            }
        }
        assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "{found} {expected}");
    }
}

/// Each row against what it says, from the simulated motion.
#[test]
fn rows_say_what_they_should() {
    let template = template();
    let noisy = TubeDisturbance { position_m: 1e-4, velocity_m_s: 2e-4, force_n: 1e-3, acceleration_m_s2: 1e-4 };
    for terminal in [Terminal::StopSet, Terminal::Rest] {
        let problem =
            AxisProblem::try_new(&AxisRequest { terminal, disturbance: noisy, ..request(&template, 0.3) }).unwrap();
        let (n, steps, h) = (problem.unknowns(), problem.steps, problem.step_s);
        let (mut lower, mut upper) = (vec![0.0; problem.equality.len()], vec![0.0; problem.equality.len()]);
        for seed in 0..20 {
            let x: Vec<f64> = random(seed, n).iter().map(|x| 0.1 * x).collect();
            let (scale, measured) = (0.7, Vector2::new(0.1 * x[3], -0.2 * x[4]));
            let x: Vec<f64> = x[..n - 1].iter().copied().chain([scale]).collect();
            let states = simulated(&problem, &x);
            problem.bounds(&measured, &mut lower, &mut upper);
            let slack: Vec<f64> = problem
                .rows
                .chunks(n)
                .zip(&upper)
                .map(|(row, upper)| upper - row.iter().zip(&x).map(|(a, x)| a * x).sum::<f64>())
                .collect();
            let face = |i: usize| scale * problem.scaled[i] + problem.held[i];
            let mut expected = Vec::new();
            for i in 0..5 {
                let off = problem.normals[i].dot(&(measured - states[0]));
                expected.extend([face(i) - off, face(i) + off]);
            }
            let left = scale * problem.scaled_acceleration - problem.held_acceleration;
            expected.extend((0..steps).flat_map(|k| [left - x[2 + k], left + x[2 + k]]));
            let room = |limit: f64, i: usize| limit - face(2 + i) - problem.slack[i];
            for state in &states[1..] {
                expected.extend([room(0.05, 1) - state.y, room(0.05, 1) + state.y]);
                expected.extend([room(0.45, 0) - state.x, room(0.45, 0) + state.x]);
            }
            expected.push(1.0 - scale);
            let end = states[steps];
            if terminal == Terminal::Rest {
                expected.push(-end.y);
            } else {
                // flown on from the end with full braking against either wall
                let coming = (slack.len() - expected.len()) / 2 - 1;
                for j in 1..=coming {
                    let later = j as f64 * h;
                    let (free, gained) = (end.x + later * end.y, 0.5 * later * later * left);
                    expected.extend([room(0.45, 0) - free + gained, room(0.45, 0) + free + gained]);
                }
                let stopped = coming as f64 * h * left;
                expected.extend([stopped - end.y, stopped + end.y]);
            }
            assert_eq!(slack.len(), expected.len());
            for (row, (found, expected)) in slack.iter().zip(&expected).enumerate() {
                assert!((found - expected).abs() < 1e-12, "row {row}: {found} {expected}");
            }
        }
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let template = template();
    let good = request(&template, 0.5);
    let refused = |request: AxisRequest<'_>| AxisProblem::try_new(&request).unwrap_err().to_string();
    let limits = good.limits;
    assert!(
        refused(AxisRequest { mass: MassInterval::between(0.1, 100.0).unwrap(), ..good }).contains("acceleration left")
    );
    assert!(refused(AxisRequest { limits: AxisLimits { speed_m_s: 1e-3, ..limits }, ..good }).contains("speed left"));
    assert!(
        refused(AxisRequest { limits: AxisLimits { walls_m: [-0.01, 0.01], ..limits }, ..good }).contains("room left")
    );
    assert!(
        refused(AxisRequest { limits: AxisLimits { walls_m: [f64::NAN, 0.01], ..limits }, ..good }).contains("NaN")
    );
    assert!(refused(AxisRequest { steps: 0, ..good }).contains("decisions"));
    assert!(refused(AxisRequest { steps: usize::MAX, ..good }).contains("decisions"));
    assert!(refused(AxisRequest { shortfall: -0.1, ..good }).contains("shortfall"));
    assert!(
        AxisProblem::try_new(&AxisRequest {
            limits: AxisLimits { walls_m: [f64::NEG_INFINITY, f64::INFINITY], ..limits },
            ..good
        })
        .is_ok()
    );
}
