//! The coordinator against what it promises, whatever it hears.

use proptest::prelude::*;
use tumble_planning::control::Adoption;
use tumble_planning::mission::{
    Action, Ambition, Coordinator, Event, FoundStretch, Note, Schedule, Standing, StartFrom, TimedEvent,
};

const SECOND: i64 = 1_000_000_000;

/// A coordinator, the time, and everything it said.
struct Told {
    coordinator: Coordinator,
    now_ns: i64,
    said: Vec<(i64, Action)>,
}

impl Told {
    fn new(schedule: Schedule) -> Self {
        Self { coordinator: Coordinator::new(schedule), now_ns: 0, said: Vec::new() }
    }

    fn hear(&mut self, event: Event) -> Vec<Action> {
        let mut actions = Vec::new();
        self.coordinator.handle(&TimedEvent { time_ns: self.now_ns, event }, &mut actions);
        self.said.extend(actions.iter().map(|action| (self.now_ns, *action)));
        actions
    }

    fn tick(&mut self, seconds: f64, standing: Standing) -> Vec<Action> {
        #[allow(clippy::cast_possible_truncation)]
        let step_ns = (seconds * 1e9) as i64;
        self.now_ns += step_ns;
        self.hear(Event::Tick(standing))
    }

    /// From the beginning to the first stretch, which begins 3 s after the first tick.
    fn flying() -> (Self, FoundStretch) {
        Self::following(|start_ns| found(start_ns, false))
    }

    fn following(stretch: impl Fn(i64) -> FoundStretch) -> (Self, FoundStretch) {
        let mut told = Self::new(Schedule::default());
        let asked = told.hear(Event::Begun);
        let Some(Action::PlanWay { request, from: StartFrom::Reference, .. }) = asked.first() else {
            panic!("{asked:?}")
        };
        told.now_ns += SECOND;
        let asked = told.hear(Event::WayFound { request: *request, model_revision: 0, world_revision: 0 });
        let (request, start_ns) = stretch_asked(&asked).unwrap();
        let stretch = stretch(start_ns);
        assert_eq!(told.hear(Event::StretchFound { request, stretch }), [Action::Follow { request }]);
        (told, stretch)
    }
}

fn found(start_ns: i64, is_last: bool) -> FoundStretch {
    FoundStretch {
        start_ns,
        end_ns: start_ns + 12 * SECOND,
        model_revision: 0,
        world_revision: 0,
        is_last,
        is_to_goal: true,
        is_clear: true,
    }
}

/// Where a way to the goal ended the robot may still come to it; where a retreat ended it never does.
#[test]
fn after_a_retreat_a_way_is_asked_for_without_waiting() {
    let waits_s = |is_to_goal: bool| {
        let (mut told, stretch) = Told::following(|start_ns| FoundStretch { is_to_goal, ..found(start_ns, true) });
        for seconds in 1..60 {
            let actions = told.tick(1.0, well());
            if actions.iter().any(|action| matches!(action, Action::PlanWay { .. })) {
                return seconds - (stretch.end_ns - SECOND) / SECOND;
            }
        }
        panic!("no way is asked for")
    };
    assert!(waits_s(true) > 10 && waits_s(false) <= 2, "{} {}", waits_s(true), waits_s(false));
}

fn well() -> Standing {
    Standing {
        state_age_ns: 0,
        motion_age_ns: 0,
        deviation_m: 0.001,
        deviation_rad: 0.001,
        rest_ns: 0,
        is_at_goal: false,
        used_revision: 0,
    }
}

fn stretch_asked(actions: &[Action]) -> Option<(u64, i64)> {
    actions.iter().find_map(|action| match action {
        Action::PlanStretch { request, start_ns, .. } => Some((*request, *start_ns)),
        _ => None,
    })
}

fn asks_for_way(actions: &[Action]) -> bool {
    actions.iter().any(|action| matches!(action, Action::PlanWay { .. }))
}

#[test]
fn one_stretch_is_planned_while_the_last_is_flown_until_the_goal() {
    let (mut told, mut stretch) = Told::flying();
    let mut is_last = false;
    for number in 1..4 {
        let mut asked = None;
        while asked.is_none() {
            asked = stretch_asked(&told.tick(0.2, well()));
            assert!(told.now_ns < stretch.end_ns);
        }
        let (request, start_ns) = asked.unwrap();
        // early enough for a controller that looks ahead, and from where the last one ends
        assert_eq!(start_ns, stretch.end_ns);
        assert!(stretch.end_ns - told.now_ns >= 6 * SECOND);
        is_last = number == 3;
        stretch = found(start_ns, is_last);
        assert_eq!(told.hear(Event::StretchFound { request, stretch }), [Action::Follow { request }]);
    }
    assert!(is_last);
    let there = Standing { is_at_goal: true, ..well() };
    let mut done = Vec::new();
    while done.is_empty() {
        done = told.tick(0.2, there);
    }
    assert_eq!(done, [Action::Finish { has_arrived: true }]);
    // not before the end of the stretch and the dwell after it
    assert!(told.now_ns >= stretch.end_ns + 2 * SECOND && told.now_ns < stretch.end_ns + 3 * SECOND);
    assert!(told.coordinator.is_done() && told.tick(1.0, there).is_empty());
}

#[test]
fn what_comes_after_its_start_is_not_flown() {
    let (mut told, stretch) = Told::flying();
    let (mut request, mut start_ns) = (0, 0);
    while request == 0 {
        (request, start_ns) = stretch_asked(&told.tick(0.2, well())).unwrap_or((0, 0));
    }
    told.now_ns = start_ns + 1;
    let said = told.hear(Event::StretchFound { request, stretch: found(start_ns, false) });
    assert_eq!(said, [Action::Note(Note::TooLate { request })]);
    // the stop after the last stretch is being flown; from where it ends there is another way
    let moving = Standing { rest_ns: stretch.end_ns + 4 * SECOND, ..well() };
    assert_eq!(told.tick(0.2, moving), [Action::Note(Note::RanOut)]);
    assert!(told.tick(2.0, moving).is_empty());
    assert!(asks_for_way(&told.tick(2.0, moving)));
}

#[test]
fn ambition_falls_before_the_robot_stops() {
    let mut told = Told::new(Schedule::default());
    let Some(Action::PlanWay { request, .. }) = told.hear(Event::Begun).first().copied() else { panic!() };
    let mut said = told.hear(Event::WayFound { request, model_revision: 0, world_revision: 0 });
    for expected in [Ambition::Informative, Ambition::Plain, Ambition::AlongWay] {
        let asked = said.iter().find_map(|action| match action {
            Action::PlanStretch { request, ambition, start_ns, way_start_ns, .. } => {
                assert_eq!(start_ns, way_start_ns);
                Some((*request, *ambition))
            }
            _ => None,
        });
        let (request, ambition) = asked.unwrap();
        assert_eq!(ambition, expected);
        told.now_ns += SECOND;
        said = told.hear(Event::StretchRefused { request });
    }
    assert!(stretch_asked(&said).is_none());
    assert!(asks_for_way(&told.tick(2.5, well())));
}

#[test]
fn an_obstacle_stops_the_robot_and_plans_made_without_it_are_void() {
    let (mut told, stretch) = Told::flying();
    let (mut request, mut start_ns) = (0, 0);
    while request == 0 {
        (request, start_ns) = stretch_asked(&told.tick(0.2, well())).unwrap_or((0, 0));
    }
    let said = told.hear(Event::World { revision: 1, contact_ns: Some(stretch.end_ns) });
    assert!(said.contains(&Action::Stop));
    let late = told.hear(Event::StretchFound { request, stretch: found(start_ns, false) });
    assert_eq!(late, [Action::Note(Note::Unasked { request })]);
    let said = told.tick(0.2, well());
    assert!(asks_for_way(&said));
    let Some(Action::PlanWay { request, .. }) = said.first().copied() else { panic!() };
    // one made in the old world does not count, one in the new one does
    let old = told.hear(Event::WayFound { request, model_revision: 0, world_revision: 0 });
    assert_eq!(old, [Action::Note(Note::Unsafe { request })]);
    let said = told.tick(0.2, well());
    let Some(Action::PlanWay { request, .. }) = said.first().copied() else { panic!("{said:?}") };
    let new = told.hear(Event::WayFound { request, model_revision: 0, world_revision: 1 });
    assert!(stretch_asked(&new).is_some());
}

#[test]
fn an_obstacle_elsewhere_lets_the_robot_fly_on_to_another_way() {
    let (mut told, stretch) = Told::flying();
    assert!(told.hear(Event::World { revision: 1, contact_ns: None }).is_empty());
    // once the stretch has begun
    let mut said = Vec::new();
    while said.is_empty() {
        said = told.tick(0.2, well());
        assert!(told.now_ns < stretch.start_ns + SECOND);
    }
    let Some(Action::PlanWay { request, start_ns, from: StartFrom::Reference }) = said.first().copied() else {
        panic!("{said:?}")
    };
    assert_eq!(start_ns, stretch.end_ns);
    let mut said = told.hear(Event::WayFound { request, model_revision: 0, world_revision: 1 });
    while stretch_asked(&said).is_none() {
        said = told.tick(0.2, well());
        assert!(told.now_ns < stretch.end_ns);
    }
    assert_eq!(stretch_asked(&said).map(|(_, start_ns)| start_ns), Some(stretch.end_ns));
    assert!(said.iter().any(|action| matches!(action, Action::PlanStretch { way, .. } if *way == request)), "{said:?}");
}

#[test]
fn a_belief_is_offered_until_it_or_a_newer_one_is_used() {
    let (mut told, _) = Told::flying();
    assert_eq!(told.hear(Event::Belief { revision: 1, is_material: false }), [Action::Offer { revision: 1 }]);
    told.hear(Event::Offered { revision: 1, adoption: Adoption::Postponed { kept: 0 } });
    // an old one changes nothing, wherever it comes from
    for old in [1, 0] {
        assert_eq!(told.hear(Event::Belief { revision: old, is_material: true }), [Action::Note(Note::Stale)]);
    }
    assert_eq!(told.coordinator.newest_revision(), 1);
    assert!(told.tick(1.0, well()).is_empty());
    let mut again = 0;
    for _ in 0..20 {
        again += told.tick(0.5, well()).iter().filter(|a| **a == Action::Offer { revision: 1 }).count();
    }
    assert!((2..=3).contains(&again), "{again}");
    let used = Standing { used_revision: 1, ..well() };
    for _ in 0..20 {
        let said = told.tick(0.1, used);
        assert!(!said.iter().any(|action| matches!(action, Action::Offer { .. })));
    }
    // after the computer was off the newest is offered to the new controller
    told.hear(Event::Restarted);
    let mut said = Vec::new();
    while !asks_for_way(&said) {
        said = told.tick(0.5, used);
    }
    assert!(said.contains(&Action::RenewController) && said.contains(&Action::Offer { revision: 1 }), "{said:?}");
}

#[test]
fn blind_astray_and_contradicted_robots_stop() {
    let (mut told, _) = Told::flying();
    let blind = Standing { state_age_ns: 2 * SECOND, ..well() };
    assert!(told.tick(0.2, blind).contains(&Action::Stop));
    assert!(!asks_for_way(&told.tick(5.0, blind)));
    let said = told.tick(0.2, well());
    assert!(said.contains(&Action::Note(Note::Seeing)) && asks_for_way(&said), "{said:?}");

    for astray in [Standing { deviation_m: 0.3, ..well() }, Standing { deviation_rad: f64::NAN, ..well() }] {
        let (mut told, _) = Told::flying();
        assert!(told.tick(0.2, astray).contains(&Action::HoldHere));
        let said = told.tick(3.0, well());
        assert!(said.iter().any(|a| matches!(a, Action::PlanWay { from: StartFrom::Estimate, .. })), "{said:?}");
    }

    let (mut told, _) = Told::flying();
    for revision in 1..=3 {
        told.hear(Event::Belief { revision, is_material: false });
        let said = told.hear(Event::Offered { revision, adoption: Adoption::Contradicts { kept: 0 } });
        assert_eq!(said.contains(&Action::Stop), revision == 3);
    }
    assert!(told.tick(0.2, well()).contains(&Action::RenewController));
}

/// A robot stops where its estimator tells no motion, as where it sees nothing; it goes on where there is one again in time, and else is given up
/// once it rests.
#[test]
fn a_robot_whose_motion_nobody_tells_is_stopped_and_given_up_at_rest() {
    let untold = |age_s: i64| Standing { motion_age_ns: age_s * SECOND, ..well() };
    let (mut told, _) = Told::flying();
    assert_eq!(told.tick(0.2, untold(1)), []);
    assert_eq!(told.tick(1.0, untold(2)), [Action::Note(Note::NoMotion), Action::Stop]);
    assert_eq!(told.tick(4.0, untold(6)), []);
    let said = told.tick(0.2, well());
    assert!(said.contains(&Action::Note(Note::Seeing)) && asks_for_way(&said), "{said:?}");

    let (mut told, _) = Told::flying();
    let rest_ns = told.now_ns + 8 * SECOND;
    assert!(told.tick(2.0, Standing { rest_ns, ..untold(2) }).contains(&Action::Stop));
    assert_eq!(told.tick(5.0, Standing { rest_ns, ..untold(7) }), [], "not before it rests");
    assert_eq!(told.tick(1.0, Standing { rest_ns, ..untold(8) }), [Action::Abandon]);
    assert!(told.coordinator.is_done());
}

#[test]
fn a_body_that_is_doubted_again_at_once_is_not_what_is_wrong() {
    let (mut told, _) = Told::flying();
    let said = told.hear(Event::BodyDoubtful);
    assert_eq!(said, [Action::Note(Note::BodyDoubtful), Action::WidenBelief, Action::Stop]);
    told.now_ns += 2 * SECOND;
    let again = Action::Note(Note::ActuatorsDisagree);
    assert_eq!(told.hear(Event::BodyDoubtful), [again, Action::DoubtWrench]);
    // The stop was that of a body which is none: with the next belief there is another one, once.
    let believed = |revision| Event::Belief { revision, is_material: false };
    assert_eq!(told.hear(believed(7)), [Action::Stop, Action::Offer { revision: 7 }]);
    assert_eq!(told.hear(believed(8)), [Action::Offer { revision: 8 }]);
    // and that is known from then on
    told.now_ns += 2 * SECOND;
    assert_eq!(told.hear(Event::BodyDoubtful), [again]);
    // much later it may be another body
    told.now_ns += Schedule::default().doubt_ns;
    assert!(told.hear(Event::BodyDoubtful).contains(&Action::WidenBelief));
}

#[test]
fn what_thrust_explains_better_is_blamed_on_thrust() {
    let (mut told, _) = Told::flying();
    told.hear(Event::BodyDoubtful);
    told.now_ns += 8 * SECOND;
    let note = Action::Note(Note::ActuatorsDisagree);
    assert_eq!(told.hear(Event::ThrustDoubtful), [note, Action::DoubtWrench]);
    // once and for good
    assert_eq!(told.hear(Event::ThrustDoubtful), [note]);
}

#[test]
fn where_no_thrust_explains_what_was_seen_the_body_is_learned_again() {
    for again in [Event::BodyDoubtful, Event::Diverged] {
        let (mut told, _) = Told::flying();
        told.hear(Event::BodyDoubtful);
        told.now_ns += 6 * SECOND;
        assert_eq!(told.hear(Event::ThrustAcquitted(true)), []);
        told.now_ns += 2 * SECOND;
        let said = told.hear(again);
        assert!(said.contains(&Action::WidenBelief) && !said.contains(&Action::DoubtWrench), "{said:?}");
        // Once: what is seen from then on is acquitted anew or not.
        told.now_ns += 8 * SECOND;
        assert!(told.hear(again).contains(&Action::DoubtWrench));
        // Thrust that is doubted stays so.
        told.hear(Event::ThrustAcquitted(true));
        told.now_ns += SECOND;
        assert!(!told.hear(again).contains(&Action::WidenBelief));
    }
}

#[test]
fn a_body_that_was_doubted_and_that_no_other_one_explains_is_pushed_by_another_thrust() {
    let (mut told, _) = Told::flying();
    told.hear(Event::BodyDoubtful);
    told.now_ns += 8 * SECOND;
    let said = told.hear(Event::Diverged);
    assert!(said.contains(&Action::ResetEstimator) && said.contains(&Action::DoubtWrench), "{said:?}");
    // nobody knows where the robot is: as hard as can be
    assert!(said.contains(&Action::Brake) && !said.contains(&Action::Stop), "{said:?}");
    // once and for good
    told.now_ns += SECOND;
    assert!(!told.hear(Event::Diverged).contains(&Action::DoubtWrench));
    // An estimator that loses its way over a body that was never doubted says nothing of the thrust.
    let (mut told, _) = Told::flying();
    for _ in 0..3 {
        told.now_ns += SECOND;
        assert!(!told.hear(Event::Diverged).contains(&Action::DoubtWrench));
    }
}

#[test]
fn an_obstacle_in_the_way_of_a_stop_is_another_stop() {
    let (mut told, stretch) = Told::flying();
    assert!(told.hear(Event::World { revision: 1, contact_ns: Some(stretch.end_ns) }).contains(&Action::Stop));
    let again = told.hear(Event::World { revision: 2, contact_ns: Some(stretch.end_ns) });
    assert!(again.contains(&Action::Stop), "{again:?}");
}

#[test]
fn planners_that_never_answer_are_asked_again() {
    let mut told = Told::new(Schedule::default());
    let asked = told.hear(Event::Begun);
    assert!(asks_for_way(&asked));
    let patience_s = Schedule::default().patience_ns as f64 * 1e-9;
    assert!(told.tick(patience_s, well()).is_empty(), "not before the way's start and the patience are over");
    let lost = told.tick(1.1, well());
    assert!(matches!(lost[..], [Action::Note(Note::Unanswered { .. })]), "{lost:?}");
    let again = told.tick(0.1, well());
    let [Action::PlanWay { request, .. }] = again[..] else { panic!("{again:?}") };
    // the same of the first stretch
    let asked = told.hear(Event::WayFound { request, model_revision: 0, world_revision: 0 });
    assert!(stretch_asked(&asked).is_some());
    let lost = told.tick(patience_s + 2.1, well());
    assert!(matches!(lost[..], [Action::Note(Note::Unanswered { .. })]), "{lost:?}");
    assert!(asks_for_way(&told.tick(0.1, well())));
}

#[test]
fn what_is_known_is_not_excited_for() {
    let (mut told, _) = Told::flying();
    told.hear(Event::Known(true));
    let mut said = Vec::new();
    while stretch_asked(&said).is_none() {
        said = told.tick(0.2, well());
    }
    assert!(matches!(said[0], Action::PlanStretch { ambition: Ambition::Plain, .. }), "{said:?}");
}

#[test]
fn a_mission_that_takes_too_long_is_given_up() {
    let (mut told, _) = Told::flying();
    let said = told.tick(301.0, well());
    assert_eq!(said.last(), Some(&Action::Finish { has_arrived: false }));
    assert!(said.contains(&Action::Stop));
}

/// Where no way exists nobody asks again; a proof that nobody waits for, or of a world that is no more, is none.
#[test]
fn a_proof_that_no_way_exists_ends_the_mission_that_asked_for_it() {
    let mut told = Told::new(Schedule::default());
    let asked = told.hear(Event::Begun);
    let [Action::PlanWay { request, .. }] = asked[..] else { panic!("{asked:?}") };
    let unasked = told.hear(Event::WayImpossible { request: request + 7, world_revision: 0 });
    assert_eq!(unasked, [Action::Note(Note::Unasked { request: request + 7 })]);
    let of_another_world = told.hear(Event::WayImpossible { request, world_revision: 1 });
    assert_eq!(of_another_world, [Action::Note(Note::Refused { request })]);
    let mut said = Vec::new();
    while !asks_for_way(&said) {
        said = told.tick(0.2, well());
    }
    let [Action::PlanWay { request, .. }] = said[..] else { panic!("{said:?}") };
    let proved = told.hear(Event::WayImpossible { request, world_revision: 0 });
    assert_eq!(proved, [Action::GiveUp { request }]);
    assert!(told.coordinator.is_done() && told.tick(10.0, well()).is_empty());
    // in flight the robot stops
    let (mut told, stretch) = Told::flying();
    told.now_ns = stretch.start_ns;
    told.hear(Event::Belief { revision: 1, is_material: true });
    let said = told.tick(0.2, well());
    let [Action::PlanWay { request, .. }] = said[..] else { panic!("{said:?}") };
    let proved = told.hear(Event::WayImpossible { request, world_revision: 0 });
    assert_eq!(proved, [Action::Stop, Action::GiveUp { request }]);
}

/// What is learned until then is planned with.
#[test]
fn the_first_stretch_of_a_way_found_in_flight_is_asked_for_when_it_is_due() {
    let (mut told, stretch) = Told::flying();
    told.now_ns = stretch.start_ns;
    told.hear(Event::Belief { revision: 1, is_material: true });
    let said = told.tick(0.2, well());
    let [Action::PlanWay { request, start_ns, .. }] = said[..] else { panic!("{said:?}") };
    assert_eq!(start_ns, stretch.end_ns);
    assert_eq!(told.hear(Event::WayFound { request, model_revision: 1, world_revision: 0 }), []);
    let due_ns = stretch.end_ns - Schedule::default().stretch_lead_ns;
    while told.now_ns + SECOND / 2 < due_ns {
        assert_eq!(stretch_asked(&told.tick(0.5, well())), None);
    }
    let said = told.tick(0.5, well());
    assert_eq!(stretch_asked(&said).map(|(_, start_ns)| start_ns), Some(stretch.end_ns));
    assert!(said.iter().any(|action| matches!(action, Action::PlanStretch { way, .. } if *way == request)), "{said:?}");
}

fn events() -> impl Strategy<Value = Vec<(i64, Event)>> {
    let number = 0_u64..40;
    let adoption = prop_oneof![
        Just(Adoption::Adopted),
        Just(Adoption::Postponed { kept: 0 }),
        Just(Adoption::Contradicts { kept: 0 })
    ];
    let ages = (0..3 * SECOND, prop_oneof![4 => Just(0), 1 => 0..8 * SECOND]);
    let standing = (ages, 0.0..0.2, 0.0..0.4, 0..100 * SECOND, any::<bool>(), 0_u64..20).prop_map(
        |((state_age_ns, motion_age_ns), deviation_m, deviation_rad, rest_ns, is_at_goal, used_revision)| {
            Event::Tick(Standing {
                state_age_ns,
                motion_age_ns,
                deviation_m,
                deviation_rad,
                rest_ns,
                is_at_goal,
                used_revision,
            })
        },
    );
    let stretch = (number.clone(), 0..120_i64, 1..20_i64, 0_u64..4, any::<bool>(), any::<bool>()).prop_map(
        |(request, start, length, world_revision, is_last, is_clear)| Event::StretchFound {
            request,
            stretch: FoundStretch {
                start_ns: start * SECOND,
                end_ns: (start + length) * SECOND,
                model_revision: 0,
                world_revision,
                is_last,
                is_to_goal: is_clear || is_last,
                is_clear,
            },
        },
    );
    let event = prop_oneof![
        6 => standing,
        1 => Just(Event::Begun),
        2 => (0_u64..20, any::<bool>()).prop_map(|(revision, is_material)| Event::Belief { revision, is_material }),
        1 => (0_u64..20, adoption).prop_map(|(revision, adoption)| Event::Offered { revision, adoption }),
        2 => (number.clone(), 0_u64..4)
            .prop_map(|(request, world_revision)| Event::WayFound { request, model_revision: 0, world_revision }),
        1 => number.clone().prop_map(|request| Event::WayRefused { request }),
        1 => (number.clone(), 0_u64..4)
            .prop_map(|(request, world_revision)| Event::WayImpossible { request, world_revision }),
        4 => stretch,
        1 => number.prop_map(|request| Event::StretchRefused { request }),
        1 => (0_u64..4, prop::option::of(0..100 * SECOND))
            .prop_map(|(revision, contact_ns)| Event::World { revision, contact_ns }),
        1 => prop_oneof![
            Just(Event::Relocalised), Just(Event::Diverged), Just(Event::BodyDoubtful), Just(Event::ThrustDoubtful), any::<bool>().prop_map(Event::ThrustAcquitted), Just(Event::Braking),
            Just(Event::Restarted), any::<bool>().prop_map(Event::Known)
        ],
    ];
    // the honest answer to the newest request, now and then, so that storms get somewhere
    prop::collection::vec((-SECOND..4 * SECOND, event), 0..120)
}

/// Feeds a storm, with honest answers in between, and checks what must hold of every answer.
fn weather(storm: &[(i64, Event)], honest: &[bool]) -> Vec<(i64, Action)> {
    let mut told = Told::new(Schedule::default());
    told.hear(Event::Begun);
    let mut newest = 0;
    let mut world = 0;
    let mut is_done = false;
    for ((step_ns, event), honest) in storm.iter().zip(honest.iter().cycle()) {
        let asked =
            told.said.iter().rev().find(|(_, a)| matches!(a, Action::PlanWay { .. } | Action::PlanStretch { .. }));
        let answer = match asked {
            Some((_, Action::PlanWay { request, .. })) => {
                Some(Event::WayFound { request: *request, model_revision: newest, world_revision: world })
            }
            Some((_, Action::PlanStretch { request, start_ns, .. })) => {
                let stretch = FoundStretch { world_revision: world, ..found(*start_ns, false) };
                Some(Event::StretchFound { request: *request, stretch })
            }
            _ => None,
        };
        for event in [answer.filter(|_| *honest), Some(*event)].into_iter().flatten() {
            let said = told.hear(event);
            assert!(!is_done || said.iter().all(|a| matches!(a, Action::Note(_))), "{said:?} after the end");
            let is_from_the_past = said.first() == Some(&Action::Note(Note::Stale));
            if let (Event::Belief { revision, .. }, false) = (event, is_done) {
                newest = newest.max(revision);
            }
            if let (Event::World { revision, .. }, false, false) = (event, is_done, is_from_the_past) {
                world = world.max(revision);
            }
            for action in &said {
                match *action {
                    Action::Follow { request } => {
                        let Event::StretchFound { stretch, request: of } = event else { panic!("{event:?}") };
                        assert!(of == request && stretch.is_clear && stretch.start_ns >= told.now_ns);
                        assert_eq!(stretch.world_revision, world);
                        let asked = |(_, a): &(i64, Action)| {
                            matches!(a, Action::PlanStretch { request: r, start_ns, .. }
                                if *r == request && *start_ns == stretch.start_ns)
                        };
                        assert!(told.said.iter().any(asked));
                    }
                    Action::Offer { revision } => assert_eq!(revision, newest),
                    Action::Finish { .. } | Action::Abandon => is_done = true,
                    Action::GiveUp { request } => {
                        assert_eq!(event, Event::WayImpossible { request, world_revision: world });
                        is_done = true;
                    }
                    _ => {}
                }
            }
            assert_eq!(told.coordinator.newest_revision(), newest);
        }
        told.now_ns = (told.now_ns + step_ns).max(0);
    }
    let mut requests: Vec<u64> = told.said.iter().filter_map(|(_, action)| number(action)).collect();
    let in_order = requests.clone();
    requests.sort_unstable();
    requests.dedup();
    assert_eq!(requests, in_order, "every request has its own number");
    told.said
}

fn number(action: &Action) -> Option<u64> {
    match action {
        Action::PlanWay { request, .. } | Action::PlanStretch { request, .. } => Some(*request),
        _ => None,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn keeps_its_promises_in_any_weather(storm in events(), honest in prop::collection::vec(any::<bool>(), 1..8)) {
        let said = weather(&storm, &honest);
        prop_assert_eq!(said, weather(&storm, &honest));
    }
}
