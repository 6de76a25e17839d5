//! More acts on the tug than its jets: a wind, and a wheel that spins. Told to the loop once, estimator, planners, controller and stops
//! reckon with it.

use super::{
    FORCE_N, PLANNED_N, estimator, flown_among, has_arrived, planners, room, simulated, truth, tube, tug_told,
};
use tumble_planning::dynamics::{ConstantWorldWrench, Environment};
use tumble_planning::global::{Obstruction, Status};
use tumble_planning::identification::estimator::Acted;
use tumble_planning::lie::Wrench;
use tumble_planning::mission::{Found, NoObserver, serve};
use tumble_planning::nalgebra::Vector3;

/// Pushes by this share of what the jets can, along its strongest axis, and turns a little.
fn wind(share: f64) -> Environment {
    let force = Vector3::new(0.75, -1.0, 0.6) * (share * FORCE_N);
    let wrench_world = Wrench::new(Vector3::new(0.004, -0.006, 0.005), force);
    Environment::default().with(ConstantWorldWrench { wrench_world })
}

/// N m s: in a turn as fast as a way may ask for, a third of the torque of the jets.
const STORED: Vector3<f64> = Vector3::new(0.12, -0.08, 0.14);

/// Whether it arrives, by how many sigmas and kilograms the mass is off in the end, and whether jets are doubted then.
fn flown(told: Environment) -> (bool, f64, f64, bool) {
    let mut flying = tug_told(told, tube, estimator(), &room());
    let last = flown_among(&wind(0.25), STORED, &mut flying, &mut simulated(planners()), &mut NoObserver);
    let arrived = has_arrived(&flying, &last);
    let estimate = flying.estimator().estimate();
    let off_kg = (estimate.parameters.mass - truth().mass).abs();
    let are_jets_doubted = flying.estimator().compensated(&Wrench::zero()).is_some();
    (arrived, off_kg / estimate.std.mass_kg, off_kg, are_jets_doubted)
}

#[test]
fn what_it_is_told_of_costs_it_nothing() {
    let (arrived, sigmas, off_kg, are_jets_doubted) = flown(wind(0.25));
    assert!(
        arrived && !are_jets_doubted && sigmas < 3.0 && off_kg < 0.03 * truth().mass,
        "{sigmas} sigmas, {off_kg} kg"
    );
    // what it is not told of it takes for jets that do not do what they are told, and says so
    let (_, sigmas, off_kg, are_jets_doubted) = flown(Environment::default());
    assert!(are_jets_doubted && sigmas < 4.0, "{are_jets_doubted} {sigmas} sigmas, {off_kg} kg");
}

/// The limits of a way are what is left; where nothing is, the answer says so.
#[test]
fn ways_have_what_is_left() {
    let found = |share: f64| {
        let mut flying = tug_told(wind(share), tube, estimator(), &room());
        let acted = Acted { from_ns: 0, until_ns: 0, wrench_body: Wrench::zero(), stored_body: Vector3::zeros() };
        flying.step(&acted, &[], &mut NoObserver).unwrap();
        let answer = serve(&mut planners(), &flying.next_request().unwrap());
        let Found::Way(way) = answer.found else { panic!("{:?}", answer.found) };
        way
    };
    let [still, blown] = [0.0, 0.5].map(|share| found(share).plan.unwrap().trajectory);
    let most =
        |way: &tumble_planning::ArcPath| way.arcs().iter().map(|arc| arc.translation(0.0).1.amax()).fold(0.0, f64::max);
    assert!(most(&blown) <= 0.5 * PLANNED_N / 16.0, "{} of {} m/s^2", most(&blown), most(&still));
    assert!(blown.duration_s() > 1.1 * still.duration_s());
    let storm = found(1.5);
    assert!(matches!(storm.status, Status::Infeasible(Obstruction::LimitTooSmall { .. })), "{:?}", storm.status);
}
