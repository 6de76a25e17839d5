//! Solves of three axes coupled by ten planes at 25 nodes, warm in closed loop: 60 missions of 150 decisions; and whole decisions
//! among eight obstacles, with planes chosen anew each time.
//!
//! Build with `RUSTFLAGS="-C target-cpu=native"`. Each decision is timed as the best of a few, each from the same state before it.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../../crates/planning/tests/suite/fixed_planes/mod.rs"]
mod fixed_planes;

use std::time::Instant;
use tumble_planning::collision::{BodyShape, MovingObstacle};
use tumble_planning::control::{CoupledAxes, EndAttitude, GramStatus, NominalPath, ObstaclePlanes};
use tumble_planning::dynamics::ObstacleEllipsoid;
use tumble_planning::lie::Pose;
use tumble_planning::local::Barrier;
use tumble_planning::nalgebra::{UnitQuaternion, Vector2, Vector3};

const REPEATS: usize = 5;

fn quantile(sorted: &[f64], share: f64) -> f64 {
    let below = |index: &usize| *index as f64 <= (sorted.len() - 1) as f64 * share;
    sorted[(0..sorted.len()).take_while(below).last().unwrap()]
}

fn print_times(name: &str, mut times_us: Vec<f64>) {
    times_us.sort_by(f64::total_cmp);
    let [median, p99, worst] = [0.5, 0.99, 1.0].map(|share| quantile(&times_us, share));
    println!("{name}: median {median:.1} us, p99 {p99:.1} us, worst {worst:.1} us");
}

fn main() {
    fixed();
    among_obstacles();
}

fn fixed() {
    let planes = fixed_planes::planes(3);
    let (mut warm_us, mut first_us, mut set_us) = (Vec::new(), Vec::new(), Vec::new());
    let flown = fixed_planes::fly(60, 150, &planes, |coupled, states, references, is_first| {
        let mut best_us = f64::INFINITY;
        for _ in 0..REPEATS {
            let mut copy = coupled.clone();
            let before = Instant::now();
            let status = copy.solve(states, [&references[0], &references[1], &references[2]]);
            best_us = best_us.min(before.elapsed().as_secs_f64() * 1e6);
            std::hint::black_box(status);
        }
        if is_first {
            first_us.push(best_us);
        } else {
            warm_us.push(best_us);
        }
        let mut copy = coupled.clone();
        let mut moved = planes.clone();
        for plane in &mut moved {
            plane.offset_m += 1e-3;
        }
        let before = Instant::now();
        copy.set_planes(&moved);
        set_us.push(before.elapsed().as_secs_f64() * 1e6);
    });
    let unknowns = fixed_planes::problems().iter().map(tumble_planning::control::AxisProblem::unknowns).sum::<usize>();
    let rows = fixed_planes::problems().iter().map(|p| p.equality.len()).sum::<usize>() + planes.len();
    println!("{unknowns} unknowns, {rows} rows, {} decisions, {} failed", flown.steps, flown.failed);
    println!("largest excess {:.2e} m, speed {:.2e} m/s", flown.excess_m, flown.speed_excess_m_s);
    for (name, times_us) in [("warm", warm_us), ("first", first_us), ("new offsets", set_us)] {
        print_times(name, times_us);
    }
    let mut iterations: Vec<f64> = flown.iterations.iter().map(|count| *count as f64).collect();
    iterations.sort_by(f64::total_cmp);
    println!("iterations: {:?}", [0.5, 0.99, 1.0].map(|share| quantile(&iterations, share)));
}

/// To and fro between eight balls, nominally.
fn among_obstacles() {
    let problems = fixed_planes::problems();
    let steps = fixed_planes::STEPS;
    let corner = |i: u32| Vector3::from_fn(|axis, _| if i >> axis & 1 == 1 { 0.3 } else { -0.3 });
    let barrier = |i: u32| {
        let pose = Pose::from_parts(corner(i).into(), UnitQuaternion::identity());
        let solid = ObstacleEllipsoid { world_from_ellipsoid: pose, semi_axes: Vector3::new(0.06, 0.08, 0.1) };
        Barrier::Ellipsoid(MovingObstacle::at_rest(solid))
    };
    let barriers: Vec<Barrier> = (0..8).map(barrier).collect();
    let body = BodyShape::sphere(0.1).unwrap();
    let mut axes = CoupledAxes::try_new(problems).unwrap();
    let mut planes = ObstaclePlanes::try_new(&body, &Vector3::zeros(), &barriers, steps).unwrap();
    let attitudes = vec![UnitQuaternion::identity(); steps + 1];
    let mut states = [Vector2::zeros(); 3];
    axes.begin(&states);
    let (mut positions, mut rows) = (Vec::new(), Vec::new());
    let (mut choose_us, mut set_us, mut solve_us, mut most_rows, mut failed) =
        (Vec::new(), Vec::new(), Vec::new(), 0, 0);
    for call in 0..3000 {
        let goal = corner(call / 150 % 8) * 1.2;
        let references = [0, 1, 2].map(|i: usize| [Vector2::new(goal[i], 0.0)]);
        axes.positions(&mut positions);
        let path = NominalPath {
            start_s: 0.2 * f64::from(call),
            step_s: 0.2,
            positions: &positions,
            tube_m: axes.tube_m(),
            world_from_axes: UnitQuaternion::identity(),
            attitudes: &attitudes,
            turn_rad_s: 0.01,
            end: EndAttitude::Any,
            attitude_error_rad: 0.02,
        };
        let reach = axes.reach(&states);
        let before = Instant::now();
        planes.update(&path, &reach).unwrap();
        planes.rows(&path, &reach, &mut rows);
        let chosen = Instant::now();
        axes.set_planes(&rows);
        let set = Instant::now();
        let [x, y, z] = &references;
        let status = axes.solve(&states, [x, y, z]);
        solve_us.push(set.elapsed().as_secs_f64() * 1e6);
        choose_us.push((chosen - before).as_secs_f64() * 1e6);
        set_us.push((set - chosen).as_secs_f64() * 1e6);
        most_rows = most_rows.max(rows.len());
        failed += usize::from(status != GramStatus::Solved);
        axes.advance();
        planes.advance();
        for (state, plan) in states.iter_mut().zip(axes.plans()) {
            *state = plan.start;
        }
    }
    println!("among obstacles, once each: at most {most_rows} rows of planes, {failed} failed");
    for (name, times_us) in [("choose planes", choose_us), ("set planes", set_us), ("solve", solve_us)] {
        print_times(name, times_us);
    }
}
