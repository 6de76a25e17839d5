//! Messages that do not come, come late, twice or out of order: their contents are left alone.

use super::fault::{Counts, Fault, add};
use super::window::{Window, nanoseconds};
use tumble_astrobee::sensing::LocalizationEstimate;
use tumble_identification::noise::Gaussian;

/// One control period, ns.
const PERIOD_NS: i64 = tumble_astrobee::simulator::CONTROL_PERIOD_NS;
/// Time in which single messages are lost, late or doubled, s.
const SPELL_S: f64 = 20.0;

/// Some messages are lost, and for a time all of them.
pub(super) struct Drop {
    spell: Window,
    probability: f64,
    burst: Window,
    random: Gaussian,
    lost: u64,
}

impl Drop {
    /// 1, 10, 50 %, and a burst of 0.5, 2, 10 s.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let (probability, burst_s) = match severity {
            1 => (0.01, 0.5),
            2 => (0.1, 2.0),
            _ => (0.5, 10.0),
        };
        let spell = Window::draw(&mut random, duration_s, SPELL_S);
        let burst = spell.part(&mut random, burst_s);
        Self { spell, probability, burst, random, lost: 0 }
    }
}

impl Fault for Drop {
    fn pass(&mut self, time_ns: i64, stream: &mut Vec<LocalizationEstimate>) {
        let before = stream.len();
        if self.spell.contains(time_ns) {
            let in_burst = self.burst.contains(time_ns);
            stream.retain(|_| self.random.uniform() >= self.probability && !in_burst);
        }
        self.lost += (before - stream.len()) as u64;
    }

    fn count(&self, counts: &mut Counts) {
        add(counts, "estimates-lost", self.lost);
    }
}

/// Messages on their way, each with the time at which it comes.
#[derive(Default)]
struct Waiting {
    messages: Vec<(i64, LocalizationEstimate)>,
}

impl Waiting {
    fn push(&mut self, due_ns: i64, message: LocalizationEstimate) {
        self.messages.push((due_ns, message));
    }

    /// Moves what has come by now to the end of a stream, in the order in which it came.
    fn deliver(&mut self, time_ns: i64, stream: &mut Vec<LocalizationEstimate>) {
        self.messages.sort_by_key(|(due_ns, _)| *due_ns);
        let ready = self.messages.partition_point(|(due_ns, _)| *due_ns <= time_ns);
        stream.extend(
            self.messages
                .drain(..ready)
                .map(|(due_ns, message)| LocalizationEstimate { arrival_ns: due_ns, ..message }),
        );
    }
}

/// Messages come late, each by another time: they may overtake each other.
#[allow(clippy::struct_field_names)] // the field's word
pub(super) struct Delay {
    spell: Window,
    delay_s: f64,
    jitter_s: f64,
    random: Gaussian,
    waiting: Waiting,
    late: u64,
}

impl Delay {
    /// By 0.05, 0.2, 1 s, plus or minus 50 ms.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let delay_s = match severity {
            1 => 0.05,
            2 => 0.2,
            _ => 1.0,
        };
        let spell = Window::draw(&mut random, duration_s, SPELL_S);
        Self { spell, delay_s, jitter_s: 0.05, random, waiting: Waiting::default(), late: 0 }
    }
}

impl Fault for Delay {
    fn pass(&mut self, time_ns: i64, stream: &mut Vec<LocalizationEstimate>) {
        if self.spell.contains(time_ns) {
            for message in stream.drain(..) {
                let late_s = self.delay_s + self.jitter_s * (2.0 * self.random.uniform() - 1.0);
                self.waiting.push(message.arrival_ns.saturating_add(nanoseconds(late_s)), message);
                self.late += 1;
            }
        }
        self.waiting.deliver(time_ns, stream);
    }

    fn count(&self, counts: &mut Counts) {
        add(counts, "estimates-late", self.late);
    }
}

/// Messages come twice, and some after newer ones.
pub(super) struct Duplicate {
    spell: Window,
    probability: f64,
    random: Gaussian,
    waiting: Waiting,
    doubled: u64,
    held_back: u64,
}

impl Duplicate {
    /// Longest time between a message and its copy, and that a message is held back, control periods.
    pub const MOST_PERIODS: f64 = 25.0;

    /// 1, 10, 30 %; both independently.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let probability = match severity {
            1 => 0.01,
            2 => 0.1,
            _ => 0.3,
        };
        let spell = Window::draw(&mut random, duration_s, SPELL_S);
        Self { spell, probability, random, waiting: Waiting::default(), doubled: 0, held_back: 0 }
    }

    /// Up to [`Self::MOST_PERIODS`] after now.
    fn later_ns(&mut self, time_ns: i64) -> i64 {
        let periods = libm::floor(self.random.uniform() * Self::MOST_PERIODS) + 1.0;
        time_ns.saturating_add(nanoseconds(periods * PERIOD_NS as f64 * 1e-9))
    }
}

impl Fault for Duplicate {
    fn pass(&mut self, time_ns: i64, stream: &mut Vec<LocalizationEstimate>) {
        if self.spell.contains(time_ns) {
            for message in std::mem::take(stream) {
                if self.random.uniform() < self.probability {
                    let due_ns = self.later_ns(time_ns);
                    self.waiting.push(due_ns, message);
                    self.doubled += 1;
                }
                if self.random.uniform() < self.probability {
                    let due_ns = self.later_ns(time_ns);
                    self.waiting.push(due_ns, message);
                    self.held_back += 1;
                } else {
                    stream.push(message);
                }
            }
        }
        self.waiting.deliver(time_ns, stream);
    }

    fn count(&self, counts: &mut Counts) {
        add(counts, "estimates-twice", self.doubled);
        add(counts, "estimates-out-of-order", self.held_back);
    }
}
