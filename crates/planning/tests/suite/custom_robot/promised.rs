//! What the controller promises to follow decides how ways are asked for while it learns.

use super::{Stretches, estimator, fly, planners, room, simulated, tube, tug};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use tumble_planning::collision::EllipsoidWorld;
use tumble_planning::control::{Adoption, ControlCommand, ControlRequest, Controller, TubeController};
use tumble_planning::global::FlightPlanner;
use tumble_planning::mission::{
    Asked, Event, LoopObserver, Office, PlanAnswer, PlanRequest, PlannerFault, Simulated, TimedEvent,
};
use tumble_planning::{ModelBelief, PlanningError};

/// A tube that promises what it is told to, whatever it could follow, micrometres per square second.
struct Promising(TubeController, Arc<AtomicU32>);

impl Controller for Promising {
    fn tube_m(&self) -> [f64; 3] {
        self.0.tube_m()
    }
    fn acceleration_m_s2(&self) -> [f64; 3] {
        [f64::from(self.1.load(Ordering::Relaxed)) * 1e-6; 3]
    }
    fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        self.0.adopt(belief)
    }
    fn command(&mut self, request: &ControlRequest<'_>) -> Result<ControlCommand, PlanningError> {
        self.0.command(request)
    }
}

/// A request for a way: when, what was promised along the first axis, and whether a known way came with it.
#[derive(Debug)]
struct AskedWay {
    at_ns: i64,
    followed_m_s2: f64,
    has_known: bool,
}

/// Promises more, or less, from a decision on, and keeps what is asked for.
struct Promises {
    planners: Simulated<FlightPlanner, Stretches>,
    promised: Arc<AtomicU32>,
    changes: Vec<(i64, u32)>,
    /// When no stretch is found, ns.
    lost: Range<i64>,
    asked: Vec<AskedWay>,
}

impl Office<EllipsoidWorld> for Promises {
    fn take(&mut self, now_ns: i64, request: PlanRequest<EllipsoidWorld>) {
        if let Asked::Way { known, .. } = &request.asked {
            let [followed_m_s2, ..] = request.followed_m_s2;
            self.asked.push(AskedWay { at_ns: now_ns, followed_m_s2, has_known: known.is_some() });
        }
        let is_lost = request.is_stretch() && self.lost.contains(&now_ns);
        let answer = self.planners.serve(&request);
        self.planners.post(now_ns, &request, answer, if is_lost { PlannerFault::Refused } else { PlannerFault::None });
    }
    fn ready(&mut self, now_ns: i64) -> Option<PlanAnswer> {
        while self.changes.first().is_some_and(|(from_ns, _)| *from_ns <= now_ns) {
            self.promised.store(self.changes.remove(0).1, Ordering::Relaxed);
        }
        Office::<EllipsoidWorld>::ready(&mut self.planners, now_ns)
    }
}

/// Beliefs that ask for another way.
#[derive(Default)]
struct Material(Vec<i64>);

impl LoopObserver for Material {
    fn heard(&mut self, timed: &TimedEvent) {
        if matches!(timed.event, Event::Belief { is_material: true, .. }) {
            self.0.push(timed.time_ns);
        }
    }
}

/// A flight with these promises at these times, and no stretches found for so long; what was asked for, and when a belief asked for another way.
fn flown_with(changes: &[(i64, u32)], lost: Range<i64>) -> (Vec<AskedWay>, Vec<i64>) {
    let promised = Arc::new(AtomicU32::new(3000));
    let shared = Arc::clone(&promised);
    let new = move |belief: &ModelBelief| Ok(Promising(tube(belief)?, Arc::clone(&shared)));
    let planners = simulated(planners());
    let mut office = Promises { planners, promised, changes: changes.to_vec(), lost, asked: Vec::new() };
    let mut material = Material::default();
    assert!(fly(&mut tug(new, estimator(), &room()), &mut office, &mut material), "{:?}", office.asked);
    (office.asked, material.0)
}

const SECOND: i64 = 1_000_000_000;

#[test]
fn a_robot_that_may_go_faster_asks_for_another_way() {
    // by then the mass is known, and asks for no other way
    let slow = flown_with(&[(12 * SECOND, 3200)], 0..0);
    let fast = flown_with(&[(12 * SECOND, 9000)], 0..0);
    assert!(slow.1.iter().all(|at_ns| *at_ns < 12 * SECOND), "{:?}", slow.1);
    assert!(fast.1.iter().any(|at_ns| *at_ns >= 12 * SECOND), "{:?}", fast.1);
    let (slow, fast) = (slow.0.last().unwrap(), fast.0.last().unwrap());
    let [slow, fast] = [slow, fast].map(|asked| asked.followed_m_s2);
    assert!((slow - 0.0032).abs() < 1e-9 && (fast - 0.009).abs() < 1e-9, "{slow} {fast}");
}

/// What is asked for from rest, after a way that a robot was promised to follow so fast.
#[test]
fn a_way_that_is_faster_than_promised_does_not_do_any_more() {
    let lost = 16 * SECOND..26 * SECOND;
    for (then, is_known) in [(9000, true), (2000, false)] {
        let (asked, _) = flown_with(&[(12 * SECOND, 9000), (18 * SECOND, then)], lost.clone());
        let after = asked.iter().find(|asked| asked.at_ns > 18 * SECOND).unwrap();
        assert_eq!(after.has_known, is_known, "{asked:?}");
    }
}
