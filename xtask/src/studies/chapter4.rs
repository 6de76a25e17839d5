//! probe
mod flown;
mod loads;
mod statistics;
use crate::Failure;
use crate::arguments::Arguments;
use flown::*;
use std::time::Instant;
use tumble_astrobee::space_cobot::wrench_box;
use tumble_identification::WrenchTiming;

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let n = arguments.number("--runs")?.unwrap_or(3);
    let t = Instant::now();
    let loads = loads::draw(10, 2024);
    println!("{:?} physical {} {}", t.elapsed(), loads.physical, loads.physical_about_origin);
    for l in &loads.bodies { println!("m {:.2} c {:.3?} J {:?}", l.mass, l.center_of_mass().as_slice(), l.inertia_about_com().symmetric_eigenvalues().as_slice()); }
    for crit in [Criterion::V1, Criterion::V2] {
        for s in 0..2 {
            let t = Instant::now();
            let motion = design(crit, 10.0, &channel_limits(None), s).unwrap();
            let td = t.elapsed();
            for load in loads.bodies.iter().take(n) {
                let t = Instant::now();
                let f = fly(&motion, load, unlimited(), 10).unwrap();
                let tf = t.elapsed();
                let mut peak = [0.0f64; 2];
                for x in &f.samples { peak[0] = peak[0].max(x.wanted_wrench_body.torque.amax()); peak[1] = peak[1].max(x.wanted_wrench_body.force.amax()); }
                let t = Instant::now();
                let b = Beside { coefficients: true, trajectory: true };
                let o = process(&motion, load, &f, WrenchTiming::Held, b, 1).unwrap();
                println!("{crit:?} {s} design {td:?} fly {tf:?} process {:?} peak {peak:.2?} dev {:.3?} chosen {:?} best {:?}\n   ls {:?} coef {:?} traj {:?}", t.elapsed(), o.deviation, o.chosen, o.best(), o.errors(), o.by_coefficients, o.by_trajectory);
                let e = follow_exactly(&motion, load, 10).unwrap();
                let o = process(&motion, load, &e, WrenchTiming::Sampled, Beside { coefficients: true, trajectory: false }, 1).unwrap();
                println!("   perfect chosen {:?} ls {:?} coef {:?}", o.chosen, o.errors(), o.by_coefficients);
                for (ff, tt) in [(15.0, 1.5), (10.0, 1.0), (8.0, 0.8), (4.0, 0.3)] {
                    let f = fly(&motion, load, wrench_box(ff, tt), 10).unwrap();
                    let o = process(&motion, load, &f, WrenchTiming::Held, Beside { coefficients: false, trajectory: true }, 1).unwrap();
                    println!("      box {ff} sat {:.3} by {:.2?} dev {:.3?} chosen {:?} ls {:?} traj {:?}", f.saturation.any, f.saturation.by_component, o.deviation, o.chosen, o.errors(), o.by_trajectory);
                }
            }
        }
    }
    Ok(())
}
