//! What the robot doubts, from what it knows itself: its estimator's health, what the loop decided, and its own earlier beliefs.

use super::record::{DoubtOf, DoubtRow};
use std::collections::VecDeque;
use tumble_identification::recursive::{FlightHealth, ReceptionCounts, Suspect};
use tumble_planning::mission::{Action, Event};

/// A doubt is lifted when nothing has given cause for it for so long, s: as long as an estimator takes to get acquainted with a body that was
/// just made uncertain. What comes again before is the same doubt.
const LIFTED_AFTER_S: f64 = 8.0;
/// For so long after that, s, moments of inertia are believed so many times less surely than is stated: ways are gentle until the mass is known, moments show
/// later than it, and what was learned about a body far off is too sure of itself until it is learned again.
const MOMENTS_LATER_S: f64 = 4.0;
const MOMENTS_WIDER: f64 = 2.0;
/// So often a belief is compared with all before, s.
const COMPARED_EVERY_S: f64 = 1.0;
/// A rigid body stays what it is: a belief so many standard deviations of both from an earlier one contradicts it.
/// Beliefs of one flight are compared hundreds of times, so that five would be seen where nothing is wrong.
const CONTRADICTS: f64 = 6.0;
/// Mass and moments of inertia, which another body and another thrust change alike, among the ten of the summary.
const COMPARED: [usize; 4] = [0, 4, 5, 6];
/// Refused measurements are counted over so long, s.
const REFUSED_WITHIN_S: f64 = 30.0;
/// So many times the share that gates are to refuse, and at least so many, are too many.
const REFUSED_TOO_OFTEN: f64 = 100.0;
const REFUSED_AT_LEAST: u64 = 10;
/// Names and units of [`COMPARED`].
const NAMES: [(&str, &str); 4] =
    [("mass", "kg"), ("inertia_xx", "kg m^2"), ("inertia_yy", "kg m^2"), ("inertia_zz", "kg m^2")];

/// A belief as it was: when, values and standard deviations of [`COMPARED`].
#[derive(Clone, Copy, Debug, PartialEq)]
struct Believed {
    t_s: f64,
    value: [f64; 4],
    sigma: [f64; 4],
    /// How many times wider the deviations of moments are taken to be.
    wider: f64,
}

impl Believed {
    fn deviation(&self, index: usize) -> f64 {
        if index == 0 { self.sigma[0] } else { self.wider * self.sigma[index] }
    }
}

/// Two beliefs that cannot both be right.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Contradiction {
    index: usize,
    then: Believed,
    now: Believed,
    /// Standard deviations of both between them.
    apart: f64,
}

/// Why the body is doubted.
#[derive(Clone, Debug, Default, PartialEq)]
struct BodyCauses {
    /// How often it moved as another one would.
    changed: u32,
    /// How often the estimator contradicted its measurements.
    diverged: u32,
    /// Measurements that did not fit, at most, of so many.
    refused: Option<(u64, u64)>,
    /// The newest.
    contradiction: Option<Contradiction>,
}

/// A spell of doubt.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spell {
    since_s: f64,
    /// When there was last cause for it.
    cause_s: f64,
}

/// Looks at what the robot knows of itself, control period by control period, and says what it doubts and since when.
#[derive(Clone, Debug)]
pub(super) struct DoubtWatch {
    /// Share of good measurements that gates refuse.
    refused_share: f64,
    body: Option<Spell>,
    causes: BodyCauses,
    map: Option<Spell>,
    moves: u32,
    actuators_since_s: Option<f64>,
    /// What of them failed alone.
    suspect: Option<Suspect>,
    /// Before this the body is not known well enough to compare beliefs, s.
    acquainted_s: f64,
    compared_s: f64,
    beliefs: Vec<Believed>,
    /// Measurements looked at and refused so far, second by second.
    counted: VecDeque<(f64, u64, u64)>,
    rows: Vec<DoubtRow>,
}

impl DoubtWatch {
    /// Begins at the start of a mission; `gate_probability` is that with which a good measurement passes the gates.
    pub fn new(start_s: f64, gate_probability: f64) -> Self {
        Self {
            refused_share: 1.0 - gate_probability,
            body: None,
            causes: BodyCauses::default(),
            map: None,
            moves: 0,
            actuators_since_s: None,
            suspect: None,
            acquainted_s: start_s + LIFTED_AFTER_S,
            compared_s: f64::NEG_INFINITY,
            beliefs: Vec::new(),
            counted: VecDeque::new(),
            rows: Vec::new(),
        }
    }

    /// The coordinator heard of something.
    pub fn heard(&mut self, time_s: f64, event: &Event) {
        if matches!(event, Event::Relocalised) {
            cause(&mut self.map, time_s);
            self.moves += 1;
            // What was refused until now belonged to another map.
            self.counted.clear();
        }
    }

    /// It answered.
    pub fn answered(&mut self, time_s: f64, action: &Action) {
        match action {
            Action::WidenBelief => self.causes.changed += 1,
            Action::ResetEstimator => self.causes.diverged += 1,
            Action::DoubtWrench => {
                self.actuators_since_s.get_or_insert(time_s);
                return;
            }
            _ => return,
        }
        cause(&mut self.body, time_s);
        self.acquainted_s = time_s + LIFTED_AFTER_S;
        self.counted.clear();
    }

    /// A control period: the estimator's health, what became of measurements, and what it takes the body for, with standard deviations.
    pub fn see(
        &mut self,
        time_s: f64,
        health: &FlightHealth,
        counts: &ReceptionCounts,
        (value, sigma): &([f64; 10], [f64; 10]),
    ) {
        self.suspect = health.suspect;
        // From when actuators are in doubt, a motion that is none of this body is theirs.
        let is_doubtful = health.body_doubtful && self.actuators_since_s.is_none();
        if self.body.is_some() && (is_doubtful || health.diverged) {
            cause(&mut self.body, time_s);
        }
        if time_s - self.compared_s >= COMPARED_EVERY_S {
            self.compared_s = time_s;
            self.count(time_s, counts);
            // What is just being learned again is no belief to be held to.
            if time_s >= self.acquainted_s && !health.relearning {
                self.compare(&Believed {
                    t_s: time_s,
                    value: COMPARED.map(|index| value.get(index).copied().unwrap_or(0.0)),
                    sigma: COMPARED.map(|index| sigma.get(index).copied().unwrap_or(0.0)),
                    wider: if time_s < self.acquainted_s + MOMENTS_LATER_S { MOMENTS_WIDER } else { 1.0 },
                });
            }
        }
        self.lift(time_s);
    }

    fn count(&mut self, time_s: f64, counts: &ReceptionCounts) {
        let seen = counts.used + counts.gated;
        if time_s < self.acquainted_s {
            self.counted.clear();
        }
        self.counted.push_back((time_s, seen, counts.gated));
        while self.counted.front().is_some_and(|(t_s, ..)| time_s - t_s > REFUSED_WITHIN_S) {
            self.counted.pop_front();
        }
        let Some((_, seen_before, refused_before)) = self.counted.front() else { return };
        let (seen, refused) = (seen.saturating_sub(*seen_before), counts.gated.saturating_sub(*refused_before));
        if refused >= REFUSED_AT_LEAST && refused as f64 > REFUSED_TOO_OFTEN * self.refused_share * seen as f64 {
            cause(&mut self.body, time_s);
            if self.causes.refused.is_none_or(|(most, _)| most < refused) {
                self.causes.refused = Some((refused, seen));
            }
        }
    }

    /// Compares a belief with all before.
    fn compare(&mut self, now: &Believed) {
        let mut worst: Option<Contradiction> = None;
        for then in &self.beliefs {
            for index in 0..COMPARED.len() {
                let both = libm::hypot(then.deviation(index), now.deviation(index));
                let apart = if both > 0.0 { (now.value[index] - then.value[index]).abs() / both } else { 0.0 };
                if apart > CONTRADICTS && worst.is_none_or(|worst| apart > worst.apart) {
                    worst = Some(Contradiction { index, then: *then, now: *now, apart });
                }
            }
        }
        if worst.is_some() {
            cause(&mut self.body, now.t_s);
            self.causes.contradiction = worst;
        }
        self.beliefs.push(*now);
    }

    fn lift(&mut self, time_s: f64) {
        let is_over = |spell: &Spell| time_s - spell.cause_s > LIFTED_AFTER_S;
        if self.body.is_some_and(|spell| is_over(&spell)) {
            self.write_body(Some(time_s));
        }
        if self.map.is_some_and(|spell| is_over(&spell)) {
            self.write_map(Some(time_s));
        }
    }

    fn write_body(&mut self, until_s: Option<f64>) {
        if let Some(spell) = self.body.take() {
            let text = std::mem::take(&mut self.causes).text();
            self.rows.push(DoubtRow { what: DoubtOf::Body, since_s: spell.since_s, until_s, text });
        }
    }

    fn write_map(&mut self, until_s: Option<f64>) {
        if let Some(spell) = self.map.take() {
            let times = times(std::mem::take(&mut self.moves));
            let text = format!("the localisation moved for good {times}: where it says the robot is may be off");
            self.rows.push(DoubtRow { what: DoubtOf::Map, since_s: spell.since_s, until_s, text });
        }
    }

    /// All doubts in the order in which they began; those that still stand have no end.
    pub fn finish(mut self) -> Vec<DoubtRow> {
        self.write_body(None);
        self.write_map(None);
        if let Some(since_s) = self.actuators_since_s {
            // counted from one, as in the columns of a log
            let text = match self.suspect {
                Some(Suspect::Thruster(place)) => {
                    format!("thruster {} does not give what it is told", place + 1)
                }
                Some(Suspect::Supply(supply)) => {
                    format!("the thrusters of supply {} do not give what they are told", supply + 1)
                }
                None | Some(_) => {
                    "the motion fits neither the body as it was nor another one: thrust is not what is asked for"
                        .to_owned()
                }
            };
            self.rows.push(DoubtRow { what: DoubtOf::Actuators, since_s, until_s: None, text });
        }
        self.rows.sort_by(|a, b| a.since_s.total_cmp(&b.since_s));
        self.rows
    }
}

impl BodyCauses {
    fn text(&self) -> String {
        let mut said = Vec::new();
        if self.changed > 0 {
            said.push(format!("the robot moved as another body would {}", times(self.changed)));
        }
        if self.diverged > 0 {
            said.push(format!("the estimator contradicted its measurements and began anew {}", times(self.diverged)));
        }
        if let Some((refused, seen)) = self.refused {
            said.push(format!("{refused} of {seen} measurements did not fit what this body would do"));
        }
        if let Some(Contradiction { index, then, now, apart }) = self.contradiction {
            let (name, unit) = NAMES[index];
            let shown = |believed: &Believed| format!("{:.4} ± {:.4}", believed.value[index], believed.sigma[index]);
            said.push(format!(
                "{name} was {} at {:.0} s and is {} {unit} at {:.0} s, {apart:.0} standard deviations away: either the body \
                 changed or the thrust did, which motion does not tell apart",
                shown(&then),
                then.t_s,
                shown(&now),
                now.t_s
            ));
        }
        said.join("; ")
    }
}

fn times(count: u32) -> String {
    if count == 1 { "once".to_owned() } else { format!("{count} times") }
}

/// Cause for doubt, for a new one or for one that stands.
fn cause(spell: &mut Option<Spell>, time_s: f64) {
    spell.get_or_insert(Spell { since_s: time_s, cause_s: time_s }).cause_s = time_s;
}

#[cfg(test)]
mod tests;
