//! Solves of three axes coupled by ten planes at 25 nodes, warm in closed loop: 60 missions of 150 decisions.
//!
//! Build with `RUSTFLAGS="-C target-cpu=native"`. Each decision is timed as the best of a few, each from the same state before it.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../tests/fixed_planes/mod.rs"]
mod fixed_planes;

use std::time::Instant;

const REPEATS: usize = 5;

fn quantile(sorted: &[f64], share: f64) -> f64 {
    let below = |index: &usize| *index as f64 <= (sorted.len() - 1) as f64 * share;
    sorted[(0..sorted.len()).take_while(below).last().unwrap()]
}

fn main() {
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
    for (name, mut times_us) in [("warm", warm_us), ("first", first_us), ("new planes", set_us)] {
        times_us.sort_by(f64::total_cmp);
        let [median, p99, worst] = [0.5, 0.99, 1.0].map(|share| quantile(&times_us, share));
        println!("{name}: median {median:.1} us, p99 {p99:.1} us, worst {worst:.1} us");
    }
    let mut iterations: Vec<f64> = flown.iterations.iter().map(|count| *count as f64).collect();
    iterations.sort_by(f64::total_cmp);
    println!("iterations: {:?}", [0.5, 0.99, 1.0].map(|share| quantile(&iterations, share)));
}
