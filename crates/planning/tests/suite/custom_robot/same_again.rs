//! What is flown depends on nothing but what went in, and what the coordinator says on nothing but what it hears.

use super::{fly, tube, tug};
use tumble_planning::identification::Estimate;
use tumble_planning::mission::{Action, Coordinator, Event, LoopObserver, PlannerFault, Schedule, TimedEvent};

/// Writes down what is heard and said. Not all goes well: the first stretch is refused, so that a plain one is asked for.
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
    fn planner_fault(&mut self, request: u64) -> PlannerFault {
        if request == REFUSED { PlannerFault::Refused } else { PlannerFault::None }
    }
}

#[test]
fn the_same_flight_is_flown_again_to_the_bit_and_its_log_decides_the_same() {
    let flight = || {
        let (mut flying, mut account) = (tug(tube), Account::default());
        assert!(fly(&mut flying, &mut account), "{:?}", account.actions);
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
