//! Planes along a plan in closed loop: what was feasible stays so, and the body touches nothing, whatever its mass.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod obstacle_loop;

use obstacle_loop::{Outcome, Planes, mission};

fn flown(seeds: core::ops::Range<u64>, planes: Planes) -> Vec<Outcome> {
    let outcomes = seeds.map(|seed| obstacle_loop::Mission { planes, ..mission(seed) }.fly());
    outcomes.filter(|outcome| outcome.started).collect()
}

#[test]
fn what_is_feasible_at_the_start_stays_so_and_touches_nothing() {
    let outcomes = flown(0..360, Planes::Kept);
    assert!(outcomes.len() >= 200, "{}", outcomes.len());
    let least = outcomes.iter().map(|o| o.clearance_m).fold(f64::INFINITY, f64::min);
    let failed: usize = outcomes.iter().map(|o| o.failed).sum();
    let cut: usize = outcomes.iter().map(|o| o.cut).sum();
    let flown: f64 = outcomes.iter().map(|o| o.flown_m).sum();
    let kept: usize = outcomes.iter().map(|o| o.kept).sum();
    let replaced: usize = outcomes.iter().map(|o| o.replaced).sum();
    println!(
        "{} missions, least clearance {least}, failed {failed}, cut {cut}, flown {flown}, kept {kept}, replaced {replaced}",
        outcomes.len()
    );
    println!("rows {:?}", outcomes.iter().map(|o| o.rows).max());
    println!("iterations {:?}", outcomes.iter().map(|o| o.iterations).max());
    println!("near {:?}", outcomes.iter().filter(|o| o.clearance_m < 0.02).count());
    for planes in [Planes::WithoutTube, Planes::AlwaysReplaced, Planes::OneEnd, Planes::WithoutTurn] {
        let outcomes = self::flown(0..360, planes);
        let least = outcomes.iter().map(|o| o.clearance_m).fold(f64::INFINITY, f64::min);
        let failed: usize = outcomes.iter().map(|o| o.failed).sum();
        let hits = outcomes.iter().filter(|o| o.clearance_m < 0.0).count();
        println!("{planes:?}: {} missions, least {least}, hits {hits} failed {failed}", outcomes.len());
    }
    assert!(failed == 0 && cut == 0 && least > 0.0);
}
