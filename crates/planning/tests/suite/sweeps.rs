//! The continuous test against dense sampling by an independent distance.

use crate::sweep_oracle::Draws;

#[test]
fn random_edges_have_no_violation_and_every_contact_is_one() {
    let mut draws = Draws::new(1);
    let (mut free, mut hit) = (0, 0);
    for index in 0..4000 {
        let case = draws.case();
        let verdict = case.judge(1000);
        assert_eq!(verdict.violation_s, None, "edge {index} passes through something: {verdict:?} {case:?}");
        assert!(verdict.contact_error_m < 1e-9, "edge {index}: a contact that is none: {verdict:?} {case:?}");
        if verdict.contact_s.is_some() { hit += 1 } else { free += 1 }
    }
    assert!(free > 500 && hit > 500, "{free} {hit}");
}
