//! How long a way is searched for, where one is known: little in flight, as long as for the first one from rest, and again as long
//! where what was found takes longer than all of the known way.

use super::{estimator, planners, room, tube, tug};
use std::cell::RefCell;
use tumble_planning::collision::EllipsoidWorld;
use tumble_planning::global::{GlobalAnswer, GlobalPlanner, GlobalRequest, Status};
use tumble_planning::identification::estimator::Acted;
use tumble_planning::lie::Wrench;
use tumble_planning::mission::{Asked, Found, Layer, NoObserver, serve};
use tumble_planning::nalgebra::{UnitQuaternion, Vector3};
use tumble_planning::{ArcPath, BodyArc, Budget, Plan, PlanningError, TranslationState};

fn lasting(duration_s: f64) -> ArcPath {
    let here = TranslationState::at_rest(Vector3::zeros());
    ArcPath::new([BodyArc::accelerated(duration_s, &here, Vector3::zeros(), UnitQuaternion::identity())])
}

/// Spends all that it gets, and finds a way of 160 s with little of it, of 50 s with much.
#[derive(Default)]
struct Thorough(RefCell<Vec<u64>>);

const MUCH: u64 = 20_000;

impl GlobalPlanner<EllipsoidWorld> for Thorough {
    fn plan(
        &mut self,
        request: &GlobalRequest<'_, EllipsoidWorld>,
        budget: &mut dyn Budget,
    ) -> Result<GlobalAnswer, PlanningError> {
        let mut units = 0;
        while budget.spend(100) {
            units += 100;
        }
        self.0.borrow_mut().push(units);
        let duration_s = if units < MUCH { 160.0 } else { 50.0 };
        Ok(GlobalAnswer {
            status: Status::Feasible,
            plan: Some(Plan { trajectory: lasting(duration_s), model_revision: request.belief.revision }),
            cost: duration_s,
            lower_bound: 0.0,
            units,
            history: Vec::new(),
            tree: Vec::new(),
        })
    }
}

/// Units of each search, those that the answer says, and how long what was found takes, where a way of `known_s` is known.
fn searched(known_s: f64, speed_m_s: f64) -> (Vec<u64>, u64, f64, Option<Layer>) {
    let mut flying = tug(tube, estimator(), &room());
    let acted = Acted { from_ns: 0, until_ns: 0, wrench_body: Wrench::zero(), stored_body: Vector3::zeros() };
    flying.step(&acted, &[], &mut NoObserver).unwrap();
    let mut request = flying.next_request().unwrap();
    request.asked = Asked::Way { known: Some(lasting(known_s).into()), margin_m: request.settings.margin_m };
    request.start.twist_body.linear.x = speed_m_s;
    let mut planners = (Thorough::default(), planners().1);
    let answer = serve(&mut planners, &request);
    let Found::Way(way) = answer.found else { panic!("{:?}", answer.found) };
    (planners.0.0.take(), answer.units, way.plan.unwrap().trajectory.duration_s(), request.layer())
}

#[test]
fn a_new_way_is_searched_for_as_long_as_it_is_worth() {
    assert_eq!(searched(200.0, 0.02), (vec![1_200], 1_200, 160.0, Some(Layer::NewWay)));
    assert_eq!(searched(60.0, 0.02), (vec![1_200, MUCH], 1_200 + MUCH, 50.0, Some(Layer::NewWay)));
    assert_eq!(searched(60.0, 0.0), (vec![MUCH], MUCH, 50.0, Some(Layer::Way)));
}
