//! Programs of tubes, three axes: the frozen nominal ones, warm and cold, and the coupled one.
//!
//! Build with `RUSTFLAGS="-C target-cpu=native"`. Before the measurements it prints what single solves took in closed loop, the best
//! of some: median, 99th percentile and worst, in microseconds.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../../crates/planning/tests/suite/tube_problems/mod.rs"]
mod tube_problems;

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::Instant;
use tube_problems::NominalLoop;
use tube_problems::coupled::CoupledLoop;
use tumble_planning::control::{GramStatus, GramWorkspace};

const STEPS: usize = 150;
const MISSIONS: usize = 60;
const REPETITIONS: usize = 5;

fn print(name: &str, microseconds: &mut [f64], iterations: &mut [usize]) {
    microseconds.sort_by(f64::total_cmp);
    iterations.sort_unstable();
    let at = |percent: usize| (microseconds.len() - 1) * percent / 100;
    let time = [50, 99, 100].map(|percent| microseconds[at(percent)]);
    let count = [50, 99, 100].map(|percent| iterations[at(percent)]);
    println!("{name}: median, 99 %, worst: {time:.2?} us, {count:?} iterations");
}

/// Least time of some runs of the same, of which each begins with `prepare`.
fn least_us<T>(state: &mut T, mut prepare: impl FnMut(&mut T), mut run: impl FnMut(&mut T)) -> f64 {
    (0..REPETITIONS).fold(f64::INFINITY, |least, _| {
        prepare(state);
        let start = Instant::now();
        run(state);
        f64::min(least, start.elapsed().as_secs_f64() * 1e6)
    })
}

fn nominal_times(is_warm: bool) {
    let mut run = NominalLoop::new();
    let (mut times, mut iterations) = (Vec::new(), Vec::new());
    for _ in 0..STEPS {
        let before = run.workspaces.clone();
        let prepare = |run: &mut NominalLoop| run.workspaces.clone_from(&before);
        times.push(least_us(&mut run, prepare, |run| run.solve(is_warm)));
        iterations.push(run.workspaces.iter().map(GramWorkspace::iterations).sum());
        run.advance();
    }
    print(if is_warm { "nominal, warm" } else { "nominal, cold" }, &mut times, &mut iterations);
}

fn coupled_times() {
    let mut run = CoupledLoop::new();
    let (mut times, mut iterations, mut worst) = (Vec::new(), Vec::new(), [f64::NEG_INFINITY; 2]);
    let (mut cold_times, mut cold_iterations) = (Vec::new(), Vec::new());
    for _ in 0..MISSIONS {
        run.restart();
        for step in 0..STEPS {
            run.write();
            let before = run.workspace.clone();
            let mut status = GramStatus::Solved;
            let time = least_us(&mut run, |run| run.workspace.clone_from(&before), |run| status = run.solve());
            if status != GramStatus::Solved {
                println!("{status:?} at step {step} with {} iterations", run.workspace.iterations());
                break;
            }
            times.push(time);
            iterations.push(run.workspace.iterations());
            if step == 0 {
                cold_times.push(time);
                cold_iterations.push(run.workspace.iterations());
            }
            worst.iter_mut().zip(run.advance()).for_each(|(worst, one)| *worst = f64::max(*worst, one));
        }
    }
    print("coupled", &mut times, &mut iterations);
    print("coupled, first steps", &mut cold_times, &mut cold_iterations);
    println!("beyond the force {:e} N, beyond a half-space {:e} m", worst[0], worst[1]);
}

fn gram_program(criterion: &mut Criterion) {
    nominal_times(true);
    nominal_times(false);
    coupled_times();
    let mut group = criterion.benchmark_group("gram_program");
    for (name, is_warm) in [("nominal warm", true), ("nominal cold", false)] {
        let mut run = NominalLoop::new();
        group.bench_function(name, |bencher| {
            let mut step = 0;
            bencher.iter(|| {
                if step % STEPS == 0 {
                    run.restart();
                }
                step += 1;
                run.solve(is_warm);
                run.advance();
                black_box(run.states)
            });
        });
    }
    let mut run = CoupledLoop::new();
    group.bench_function("coupled warm", |bencher| {
        let mut step = 0;
        bencher.iter(|| {
            if step % STEPS == 0 {
                run.restart();
            }
            step += 1;
            run.write();
            assert_eq!(run.solve(), GramStatus::Solved);
            run.advance()
        });
    });
    group.finish();
}

criterion_group!(benches, gram_program);
criterion_main!(benches);
