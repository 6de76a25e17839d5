//! Where plans are made: beside the loop and simulated in time, or in threads of the user's.

use super::plan_request::{Found, PlanAnswer, PlanRequest};
use super::serve::{draw, serve};
use super::stretch::StretchPlanner;
use crate::collision::CollisionWorld;
use crate::global::{GlobalPlanner, Status};
use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};

/// Takes what a loop asks to be planned, and answers when it is done.
///
/// # Example
/// ```
/// use tumble_planning::collision::EllipsoidWorld;
/// use tumble_planning::mission::{Office, PlanAnswer, PlanRequest};
///
/// /// Takes everything and answers nothing: the loop then rests where it is.
/// #[derive(Default)]
/// struct Closed(usize);
/// impl Office<EllipsoidWorld> for Closed {
///     fn take(&mut self, _now_ns: i64, _request: PlanRequest<EllipsoidWorld>) {
///         self.0 += 1;
///     }
///     fn ready(&mut self, _now_ns: i64) -> Option<PlanAnswer> {
///         None
///     }
/// }
/// assert!(Closed::default().ready(0).is_none());
/// ```
/// Tutorial: [planners in a thread](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/custom_robot/own_layers.rs).
pub trait Office<W>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    /// Takes a request at a mission time, ns.
    fn take(&mut self, now_ns: i64, request: PlanRequest<W>);

    /// An answer that is there by then; to be asked until there is none.
    fn ready(&mut self, now_ns: i64) -> Option<PlanAnswer>;
}

/// How long planning takes: a function of the work done and of chance, not of the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComputingTime {
    /// Of a unit of a way's budget, ns.
    pub way_unit_ns: i64,
    /// Of a unit of a stretch's budget, ns.
    pub stretch_unit_ns: i64,
    /// Every time is up to this share longer.
    pub jitter: f64,
}

impl Default for ComputingTime {
    /// Of a small computer: a second for twenty thousand units.
    fn default() -> Self {
        Self { way_unit_ns: 50_000, stretch_unit_ns: 50_000, jitter: 0.3 }
    }
}

/// What happens to a plan between asking and answering.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum PlannerFault {
    /// Nothing.
    #[default]
    None,
    /// It takes so many times as long.
    Late(f64),
    /// It never comes.
    NoAnswer,
    /// It says that there is none.
    Refused,
}

/// Plans at once and answers when a computer that takes so long would have: the same flight is the same to the bit.
pub struct Simulated<G, L> {
    planners: (G, L),
    computing: ComputingTime,
    due: VecDeque<(i64, PlanAnswer)>,
}

impl<G, L: StretchPlanner> Simulated<G, L> {
    /// A planner of ways, one of stretches, and how long they take.
    pub fn new(planners: (G, L), computing: ComputingTime) -> Self {
        Self { planners, computing, due: VecDeque::new() }
    }

    /// The answer to a request, for who wants to look at it or to measure it before it is [posted](Self::post).
    pub fn serve<W>(&mut self, request: &PlanRequest<W>) -> PlanAnswer
    where
        W: CollisionWorld,
        W::Body: Sized,
        G: GlobalPlanner<W>,
    {
        serve(&mut self.planners, request)
    }

    /// Sends an answer on its way at a mission time, ns.
    pub fn post<W>(&mut self, now_ns: i64, request: &PlanRequest<W>, mut answer: PlanAnswer, fault: PlannerFault)
    where
        W: CollisionWorld,
        W::Body: Sized,
    {
        match fault {
            PlannerFault::NoAnswer => return,
            PlannerFault::Refused => refuse(&mut answer.found),
            PlannerFault::None | PlannerFault::Late(_) => {}
        }
        let took_ns = self.took(request, answer.units, fault);
        self.due.push_back((now_ns + took_ns, answer));
    }

    fn took<W>(&self, request: &PlanRequest<W>, units: u64, fault: PlannerFault) -> i64
    where
        W: CollisionWorld,
        W::Body: Sized,
    {
        let ComputingTime { way_unit_ns, stretch_unit_ns, jitter } = self.computing;
        let unit_ns = if request.is_stretch() { stretch_unit_ns } else { way_unit_ns };
        let chance = (draw(request.settings.seed ^ 0x7469_6d65, request.request) >> 11) as f64 / (1_u64 << 53) as f64;
        let longer = 1.0 + jitter * chance;
        let factor = if let PlannerFault::Late(factor) = fault { factor } else { 1.0 };
        #[allow(clippy::cast_possible_truncation)] // saturates
        let took_ns = (units as f64 * unit_ns as f64 * longer * factor) as i64;
        took_ns.max(0)
    }
}

/// Turns an answer into one that says nothing.
fn refuse(found: &mut Found) {
    match found {
        Found::Way(answer) => {
            answer.plan = None;
            answer.status = Status::BudgetSpent(Vec::new());
        }
        Found::Retreat(answer, ..) => *found = Found::Way(answer.clone()),
        Found::Stretch(..) => *found = Found::NoStretch(None),
        Found::Stay(..) | Found::NoStretch(_) | Found::Failed { .. } => {}
    }
}

impl<W, G, L> Office<W> for Simulated<G, L>
where
    W: CollisionWorld,
    W::Body: Sized,
    G: GlobalPlanner<W>,
    L: StretchPlanner,
{
    fn take(&mut self, now_ns: i64, request: PlanRequest<W>) {
        let answer = self.serve(&request);
        self.post(now_ns, &request, answer, PlannerFault::None);
    }

    fn ready(&mut self, now_ns: i64) -> Option<PlanAnswer> {
        let first = self.due.iter().position(|(due_ns, _)| *due_ns <= now_ns)?;
        self.due.remove(first).map(|(_, answer)| answer)
    }
}

/// The loop's end of planners in a thread of the user's; see [`Thread::new`].
pub struct Thread<W>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    requests: Sender<PlanRequest<W>>,
    answers: Receiver<PlanAnswer>,
}

/// The planners' end, to be moved into their thread.
pub struct PlannerThread<W>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    requests: Receiver<PlanRequest<W>>,
    answers: Sender<PlanAnswer>,
}

impl<W> Thread<W>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    /// Both ends. Whose thread it is, and what it is called, is the user's affair: `spawn(move || planners.run(make()))`.
    ///
    /// A planner that panics takes its thread along; the coordinator asks again in vain, and the robot stays where it stopped.
    pub fn new() -> (Self, PlannerThread<W>) {
        let (ask, requests) = channel();
        let (reply, answers) = channel();
        (Self { requests: ask, answers }, PlannerThread { requests, answers: reply })
    }
}

impl<W> PlannerThread<W>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    /// Serves until the loop's end is gone. The planners are made in this thread, and need not be `Send`.
    pub fn run<G: GlobalPlanner<W>, L: StretchPlanner>(self, mut planners: (G, L)) {
        for request in self.requests {
            if self.answers.send(serve(&mut planners, &request)).is_err() {
                return;
            }
        }
    }
}

impl<W> Office<W> for Thread<W>
where
    W: CollisionWorld,
    W::Body: Sized,
{
    fn take(&mut self, _now_ns: i64, request: PlanRequest<W>) {
        // a thread that is gone answers nothing, which the coordinator knows how to take
        let _ = self.requests.send(request);
    }

    fn ready(&mut self, _now_ns: i64) -> Option<PlanAnswer> {
        self.answers.try_recv().ok()
    }
}
