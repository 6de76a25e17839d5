#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#[path = "golden/problem4_hard.rs"]
mod problem4_hard;
use tumble_identification::*;
#[test]
fn p4() {
    let s = InteriorPoint::new(problem4_hard::cone());
    let b = problem4_hard::cone();
    let b = BarrierNewton::new(&b);
    let mut sum = 0.0;
    let mut its = 0;
    let mut hist = vec![];
    for p in problem4_hard::problems() {
        let e = s.solve(&p).unwrap();
        let eb = b.solve(&p).unwrap();
        assert!((e.objective - eb.objective).abs() < 1e-6, "{} {}", e.objective, eb.objective);
        sum += 2.0 * e.objective;
        its += e.iterations;
        hist.push(e.iterations);
        assert!(e.margin > 0.0);
    }
    println!("{sum} {} {hist:?}", its as f64 / 49.0);
    assert!((sum - 143.336).abs() < 0.01, "{sum}");
}
