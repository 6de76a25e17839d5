//! A planar plan: what the problem says of itself against differences.

use super::*;
use crate::belief::ModelBelief;
use crate::local::{Criterion, PlanarBodyModel, PlanarState, SpeedLimits, WrenchSet};
use nalgebra::{Matrix3, Vector2, Vector3};
use tumble_dynamics::{InertialParameters, ObstacleEllipsoid};
use tumble_lie::Pose;

const STEPS: usize = 9;
const P: usize = 4;

fn settings() -> LocalSettings<6, 3> {
    let mut measurement = SMatrix::from_diagonal(&[1e4, 1e4, 4e4, 4e4, 1e4, 4e4].into());
    (measurement[(2, 3)], measurement[(3, 2)]) = (1e4, 1e4);
    LocalSettings {
        steps: STEPS,
        step_s: 0.6,
        tracking: [1.0, 2.0, 0.5, 0.5, 0.3, 0.7],
        terminal: [10.0, 9.0, 5.0, 4.0, 3.0, 2.0],
        effort: [10.0, 1.0, 1.5],
        acceleration: [3.0, 0.4],
        wrench: WrenchSet {
            limit: [0.03, 0.4, 0.3],
            half_spaces: vec![([1.0, 0.3, 0.2], 0.1), ([-2.0, 0.1, -0.3], 0.08)],
        },
        speed: SpeedLimits {
            speed_m_s: Vector3::new(0.2, 0.15, f64::INFINITY),
            rate_rad_s: Vector3::new(f64::INFINITY, f64::INFINITY, 0.3),
        },
        measurement,
        retained: [0.9, 1.0, 0.4, 0.0, 0.8, 0.3],
        criterion: Criterion::A,
        margin_m: 0.02,
        length_scale_m: 0.1,
        on_segments: true,
        tolerance: 1e-6,
        iterations: 100,
    }
}

fn belief() -> ModelBelief {
    let inertia = Matrix3::from_diagonal(&Vector3::new(0.15, 0.14, 0.16));
    let mut belief =
        ModelBelief::certain(1, InertialParameters::about_com(9.5, Vector3::new(0.02, -0.03, 0.0), inertia));
    let variances = [1.0, 0.05, 0.05, 0.05, 2e-3, 1e-3, 1e-3, 2e-3, 1e-3, 2e-3];
    belief.estimate.covariance = SMatrix::from_diagonal(&variances.into());
    belief
}

fn surroundings() -> Surroundings {
    let ellipsoid = |x: f64, y: f64| ObstacleEllipsoid {
        world_from_ellipsoid: Pose::translation(x, y, 0.05),
        semi_axes: Vector3::new(0.2, 0.15, 0.3),
    };
    let moving = [ellipsoid(0.25, 0.0), ellipsoid(0.4, 0.4)].map(crate::collision::MovingObstacle::at_rest);
    Surroundings::none().with_moving(moving).unwrap()
}

fn with_problem(criterion: Criterion, body: impl FnOnce(&mut Shooting<'_, PlanarBodyModel<P>, 6, 3, P>)) {
    with_terminal_radius(0.3, criterion, body);
}

/// The terminal region is out of reach with a radius of 0.3, within reach with one of 0.8.
pub(in crate::local) fn with_terminal_radius(
    radius_m: f64,
    criterion: Criterion,
    body: impl FnOnce(&mut Shooting<'_, PlanarBodyModel<P>, 6, 3, P>),
) {
    let (mut model, settings, surroundings) =
        (PlanarBodyModel::<P>::full(), LocalSettings { criterion, ..settings() }, surroundings());
    let knowledge = model.adopt(&belief()).unwrap();
    let start = PlanarState { rate_rad_s: 0.1, ..PlanarState::at_rest(Vector2::new(-0.3, 0.05), 0.4) };
    let goal = PlanarState::at_rest(Vector2::new(0.8, 0.1), -0.3);
    let information = InformationCost::try_new(criterion, &[0.5, 800.0, 900.0, 0.0], &knowledge).unwrap();
    let task = Task {
        settings: &settings,
        start: &start,
        reference: Reference::Hold(&goal),
        terminal: Some(TerminalRegion { position_world: Vector3::new(0.7, 0.0, 0.0), radius_m, speed_m_s: 0.1 }),
        surroundings: &surroundings,
        row_settings: RowSettings {
            start_s: 0.0,
            step_s: settings.step_s,
            margin_m: settings.margin_m,
            interpolation_error_m: 1e-4,
            length_scale_m: 0.1,
            on_segments: true,
        },
        information,
        effort: [[10.0, 0.1, 0.0], [0.1, 1.0, 0.2], [0.0, 0.2, 2.0]],
        speed_limits: vec![(3, 0.2), (4, 0.15), (11, 0.3)],
    };
    let mut workspace = Workspace::new(STEPS, Factorisation::Riccati);
    body(&mut Shooting::new(&model, task, &mut workspace));
}

pub(in crate::local) fn inputs(seed: f64) -> Vec<f64> {
    (0..STEPS * 3).map(|i| 0.7 * libm::sin(seed + 1.7 * i as f64)).collect()
}

/// Differences of fourth order along a direction.
fn slope(mut value: impl FnMut(f64) -> f64) -> f64 {
    let h = 1e-3;
    (8.0 * (value(h) - value(-h)) - (value(2.0 * h) - value(-2.0 * h))) / (12.0 * h)
}

#[test]
fn gradient_and_rows_are_those_of_the_values() {
    for criterion in [Criterion::A, Criterion::D, Criterion::E] {
        with_problem(criterion, |problem| {
            let (z, x) = (inputs(1.0), inputs(5.0));
            assert!(problem.linearize(&z));
            let rows = problem.rows();
            let mut values = vec![0.0; rows];
            let cost = problem.evaluate(&z, &mut values);
            assert!((cost - problem.cost()).abs() < 1e-12 * cost.abs());
            for (value, at_point) in values.iter().zip(problem.row_values()) {
                assert!((value - at_point).abs() < 1e-12);
            }
            let along: f64 = problem.gradient().iter().zip(&x).map(|(a, b)| a * b).sum();
            let moved = |step: f64| -> Vec<f64> { z.iter().zip(&x).map(|(z, x)| z + step * x).collect() };
            let difference = slope(|step| problem.evaluate(&moved(step), &mut values));
            assert!((along - difference).abs() < 1e-9 * (1.0 + along.abs()), "{criterion:?}: {along} {difference}");

            let mut changes = vec![0.0; rows];
            problem.rows_along(&x, &mut changes);
            for (row, change) in changes.iter().enumerate() {
                let difference = slope(|step| {
                    problem.evaluate(&moved(step), &mut values);
                    values[row]
                });
                assert!((change - difference).abs() < 1e-6 * (1.0 + change.abs()), "row {row}: {change} {difference}");
                let mut gradient = vec![0.0; x.len()];
                problem.add_row(row, 2.0, &mut gradient);
                let along: f64 = gradient.iter().zip(&x).map(|(a, b)| a * b).sum();
                assert!((along - 2.0 * change).abs() < 1e-11 * (1.0 + change.abs()), "row {row}");
            }
            let factors: Vec<f64> = (0..rows).map(|row| libm::sin(row as f64).max(0.0)).collect();
            let mut gradient = vec![0.0; x.len()];
            problem.add_rows(&factors, &mut gradient);
            let along: f64 = gradient.iter().zip(&x).map(|(a, b)| a * b).sum();
            let expected: f64 = factors.iter().zip(&changes).map(|(a, b)| a * b).sum();
            assert!((along - expected).abs() < 1e-10 * (1.0 + expected.abs()));
        });
    }
}

/// Where no information has a price and no row a multiplier, the model of the curvature is the Gauss-Newton matrix, and
/// what it solves it multiplies back.
#[test]
fn curvature_solves_what_it_multiplies() {
    with_problem(Criterion::A, |problem| {
        assert!(problem.linearize(&inputs(2.0)));
        let multipliers: Vec<f64> = (0..problem.rows()).map(|row| f64::from(u8::from(row % 7 == 0))).collect();
        assert!(problem.factorise(&multipliers, 0.03));
        let x = inputs(3.0);
        let mut product = vec![0.0; x.len()];
        problem.curvature_times(&x, &mut product);
        assert!(product.iter().zip(&x).map(|(a, b)| a * b).sum::<f64>() > 0.0);
        problem.solve(&mut product);
        for (solved, x) in product.iter().zip(&x) {
            assert!((solved - x).abs() < 1e-9);
        }
    });
}
