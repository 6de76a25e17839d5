//! Estimators that are sure of what is wrong, planners that do not answer, obstacles that nobody announced.

use super::fault::{Counts, Fault, LateObstacle, PlannerFault, PlantChange, Sabotage, add};
use super::window::Window;
use tumble_identification::noise::Gaussian;

/// The estimator is made sure of what is wrong.
pub(super) struct Divergence {
    at_ns: i64,
    sabotage: Sabotage,
    is_done: bool,
}

impl Divergence {
    /// A body ten times as heavy, as certain as before; twice as heavy and certain; ten times and certain.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let at_ns = Window::for_good(&mut random, duration_s).from_ns;
        let (factor, covariance_factor) = match severity {
            1 => (10.0, 1.0),
            2 => (2.0, 1e-6),
            _ => (10.0, 1e-6),
        };
        Self {
            at_ns,
            sabotage: Sabotage { mass_factor: factor, inertia_factor: factor, covariance_factor },
            is_done: false,
        }
    }
}

impl Fault for Divergence {
    fn sabotage(&mut self, time_ns: i64) -> Option<Sabotage> {
        if self.is_done || time_ns < self.at_ns {
            return None;
        }
        self.is_done = true;
        Some(self.sabotage)
    }

    fn count(&self, counts: &mut Counts) {
        add(counts, "sabotages", u64::from(self.is_done));
    }
}

/// Planners are late, silent, without an answer, or die.
pub(super) struct Planner {
    from_ns: i64,
    left: u32,
    random: Gaussian,
    /// The request decided last, so that asking twice is no other request.
    decided: Option<(u64, PlannerFault)>,
    counts: [u64; 4],
}

impl Planner {
    /// 1, 3, 10 requests in a row.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let left = match severity {
            1 => 1,
            2 => 3,
            _ => 10,
        };
        let from_ns = Window::for_good(&mut random, duration_s).from_ns;
        Self { from_ns, left, random, decided: None, counts: [0; 4] }
    }

    fn draw(&mut self) -> PlannerFault {
        let (kind, how) = (self.random.uniform(), self.random.uniform());
        let (index, fault) = match kind {
            kind if kind < 0.25 => (0, PlannerFault::Late { factor: 2.0 + 18.0 * how }),
            kind if kind < 0.5 => (1, PlannerFault::NoAnswer),
            kind if kind < 0.75 => (2, PlannerFault::Refused),
            _ => (3, PlannerFault::Panicked),
        };
        if let Some(count) = self.counts.get_mut(index) {
            *count += 1;
        }
        fault
    }
}

impl Fault for Planner {
    fn planner(&mut self, time_ns: i64, request: u64) -> PlannerFault {
        if let Some((_, fault)) = self.decided.filter(|(decided, _)| *decided == request) {
            return fault;
        }
        let fault = if time_ns >= self.from_ns && self.left > 0 {
            self.left -= 1;
            self.draw()
        } else {
            PlannerFault::None
        };
        self.decided = Some((request, fault));
        fault
    }

    fn count(&self, counts: &mut Counts) {
        let names = ["planner-late", "planner-silent", "planner-refused", "planner-died"];
        for (name, count) in names.into_iter().zip(self.counts) {
            add(counts, name, count);
        }
    }
}

/// An obstacle that shows up on the path.
pub(super) struct Obstacle {
    late: LateObstacle,
    from_ns: i64,
    is_there: bool,
}

impl Obstacle {
    /// 3, 1, 0.5 s before the robot would touch it.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let notice_s = match severity {
            1 => 3.0,
            2 => 1.0,
            _ => 0.5,
        };
        let window = Window::for_good(&mut random, duration_s);
        let late = LateObstacle { appears_s: window.begin_s(), notice_s };
        Self { late, from_ns: window.from_ns, is_there: false }
    }
}

impl Fault for Obstacle {
    fn act(&mut self, time_ns: i64, _change: &mut PlantChange) {
        self.is_there |= time_ns >= self.from_ns;
    }

    fn late_obstacle(&self) -> Option<LateObstacle> {
        Some(self.late)
    }

    fn count(&self, counts: &mut Counts) {
        add(counts, "late-obstacles", u64::from(self.is_there));
    }
}
