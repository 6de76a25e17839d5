//! The tube controller in closed loop, against a judge that shares no code with it: no promise is broken whatever the mass, the
//! disturbances and the beliefs that come on the way; and the judge sees what is wrong on purpose. `cargo xtask study
//! tube-missions` flies more.

use crate::tube_flights::{Defect, Flown, Series, fly};
use crate::tube_plant::{Aim, Disturbances, FORCE_TOLERANCE_N, Policy, TUBE_TOLERANCE};
use tumble_planning::control::Terminal;

const MASS_KG: f64 = 9.58;

#[track_caller]
fn keeps_everything(series: &Series, missions: usize) -> Flown {
    let flown = fly(series, missions, |_| ()).unwrap();
    assert_eq!((flown.infeasible, flown.failed, flown.postponed, flown.never_adopted), (0, 0, 0, 0));
    let found = flown.findings;
    assert_eq!(found.steps, 1200 * missions as u64);
    assert_eq!((found.violations, found.exits), (0, 0), "{found:?}");
    let tube_excess = found.tube_excess.max(found.tube_excess_after);
    assert!(found.force_excess_n <= FORCE_TOLERANCE_N && tube_excess <= TUBE_TOLERANCE, "{found:?}");
    assert!(found.disagreement_n <= FORCE_TOLERANCE_N, "{found:?}");
    flown
}

#[test]
fn half_the_mass_or_half_as_much_again() {
    let flown = keeps_everything(&Series::usual(MASS_KG), 12);
    assert!(flown.adopted > 10);
    // it goes as far as it may
    assert!(flown.findings.force_excess_n > -1e-6, "{:?}", flown.findings);
}

#[test]
fn pushed_against_the_walls_on_purpose() {
    let policy = Some(Policy::Toward(Aim::Input));
    let flown = keeps_everything(&Series { behind_walls: 1.0, policy, ..Series::usual(MASS_KG) }, 6);
    assert!(flown.nearest_wall_m < 1e-6, "{}", flown.nearest_wall_m);
}

#[test]
fn to_rest_and_faster() {
    let usual = Series::usual(MASS_KG);
    keeps_everything(&Series { name: "rest", terminal: Terminal::Rest, ..usual.clone() }, 4);
    let force_n = [0.452, 0.216, 0.257];
    keeps_everything(&Series { name: "actuators", speed_m_s: 0.1, force_n, ..usual.clone() }, 4);
    keeps_everything(&Series { name: "0.5 to 2", mass_kg: [0.5 * MASS_KG, 2.0 * MASS_KG], ..usual }, 4);
}

#[test]
fn measured_and_pushed() {
    let usual = Series::usual(MASS_KG);
    let none = Disturbances::default();
    let disturbances = Disturbances { measured: [1e-4, 2e-4], ..none };
    keeps_everything(&Series { name: "measured", disturbances, ..usual.clone() }, 4);
    let disturbances = Disturbances { force_n: 2e-3, ..none };
    keeps_everything(&Series { name: "pushed", disturbances, ..usual }, 4);
}

#[test]
fn kicked_beyond_the_walls_between_two_decisions() {
    let disturbances = Disturbances { jump: [0.0, 2e-4], ..Disturbances::default() };
    let policy = Some(Policy::Toward(Aim::Input));
    let series = Series { behind_walls: 1.0, policy, disturbances, ..Series::usual(MASS_KG) };
    let found = keeps_everything(&series, 4).findings;
    // only there, and by less than was kept for it
    assert!(found.wall_excess_between_m > found.wall_excess_m);
}

#[test]
fn the_judge_sees_what_is_wrong_on_purpose() {
    let usual = Series::usual(MASS_KG);
    let middle = fly(&Series { defect: Defect::MiddleOfMasses, ..usual.clone() }, 4, |_| ()).unwrap();
    let no_mass = fly(&Series { defect: Defect::NoMass, ..usual }, 4, |_| ()).unwrap();
    assert!(middle.findings.violations > 0 && middle.findings.force_excess_n > 0.02);
    assert!(no_mass.findings.exits > 0 && no_mass.findings.tube_excess > 1e-3);
}
