//! What is flown depends on nothing but what went in, and what the coordinator says on nothing but what it hears.

use super::{Stretches, estimator, fly, planners, room, simulated, tube, tug};
use tumble_planning::collision::EllipsoidWorld;
use tumble_planning::global::FlightPlanner;
use tumble_planning::identification::Estimate;
use tumble_planning::mission::{
    Action, Coordinator, Event, LoopObserver, Office, PlanAnswer, PlanRequest, PlannerFault, Schedule, Simulated,
    TimedEvent,
};

/// Writes down what is heard and said.
#[derive(Debug, Default, PartialEq)]
struct Account {
    events: Vec<TimedEvent>,
    actions: Vec<(i64, Action)>,
}

const REFUSED: u64 = 2;

impl LoopObserver for Account {
    fn heard(&mut self, event: &TimedEvent) {
        self.events.push(*event);
    }
    fn answered(&mut self, time_ns: i64, action: &Action) {
        self.actions.push((time_ns, *action));
    }
}

/// Not all goes well: the first stretch is refused, so that a plain one is asked for.
struct Refusing(Simulated<FlightPlanner, Stretches>);

impl Office<EllipsoidWorld> for Refusing {
    fn take(&mut self, now_ns: i64, request: PlanRequest<EllipsoidWorld>) {
        let fault = if request.request == REFUSED { PlannerFault::Refused } else { PlannerFault::None };
        let answer = self.0.serve(&request);
        self.0.post(now_ns, &request, answer, fault);
    }
    fn ready(&mut self, now_ns: i64) -> Option<PlanAnswer> {
        Office::<EllipsoidWorld>::ready(&mut self.0, now_ns)
    }
}

#[test]
fn the_same_flight_is_flown_again_to_the_bit_and_its_log_decides_the_same() {
    let flight = || {
        let (mut flying, mut account) = (tug(tube, estimator(), &room()), Account::default());
        let mut office = Refusing(simulated(planners()));
        assert!(fly(&mut flying, &mut office, &mut account), "{:?}", account.actions);
        // every wrench and every measurement is in the estimate
        let Estimate { parameters, covariance, .. } = flying.estimator().estimate();
        (account, parameters.to_vector().map(f64::to_bits), covariance.map(f64::to_bits))
    };
    let (flown, again) = (flight(), flight());
    assert!(flown == again);
    let Account { events, actions } = flown.0;

    let replay = |events: &[TimedEvent]| {
        let (mut coordinator, mut said) = (Coordinator::new(Schedule::default()), Vec::new());
        for event in events {
            let mut actions = Vec::new();
            coordinator.handle(event, &mut actions);
            said.extend(actions.into_iter().map(|action| (event.time_ns, action)));
        }
        said
    };
    assert_eq!(replay(&events), actions);
    // the refusal was heard of, and without it the log is another's
    let refusal = |timed: &TimedEvent| timed.event == Event::StretchRefused { request: REFUSED };
    let without: Vec<_> = events.iter().filter(|timed| !refusal(timed)).copied().collect();
    assert_eq!(without.len() + 1, events.len());
    assert_ne!(replay(&without), actions);
}
