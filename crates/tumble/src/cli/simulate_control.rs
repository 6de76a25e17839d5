//! What a flight says of its controller: how well it followed, what it was told, where it left its main road.

use crate::page::chart::{Axis, Chart};
use crate::scenario::{Flight, Steering};
use serde_json::{Value, json};
use std::fmt::Write as _;
use tumble_astrobee::sensing::TrueMotion;
use tumble_astrobee::simulator::{ControlAccount, FallbackSpell, OfferedBelief, Reference};
use tumble_dynamics::nalgebra::Vector3;
use tumble_lie::LieGroup;
use tumble_planning::control::{Adoption, Fallback, FallbackReason};

/// A part of the way: from one waypoint to the next, or after the last.
struct Leg {
    from_s: f64,
    until_s: f64,
    looks: u64,
    squares_m2: f64,
    worst_m: f64,
    worst_rad: f64,
}

/// A moment of the flight, for pictures.
struct Moment {
    time_s: f64,
    error_world: Vector3<f64>,
    mass_kg: Option<[f64; 2]>,
    true_mass_kg: f64,
}

/// How well a flight followed its reference: the true pose of the body origin against the wanted one.
pub(super) struct Tracked {
    legs: Vec<Leg>,
    moments: Vec<Moment>,
}

impl Tracked {
    /// Before the flight.
    pub fn new(flight: &Flight) -> Self {
        let end_s = seconds(flight.duration_ns);
        let mut times = match &flight.drive.tracking {
            Some((_, Reference::Path(waypoints))) => waypoints.iter().map(|waypoint| waypoint.time_s).collect(),
            _ => vec![0.0],
        };
        times.retain(|time_s| *time_s < end_s);
        let ends = times.iter().skip(1).copied().chain([end_s]);
        let leg = |(from_s, until_s): (&f64, f64)| Leg {
            from_s: *from_s,
            until_s,
            looks: 0,
            squares_m2: 0.0,
            worst_m: 0.0,
            worst_rad: 0.0,
        };
        let legs = times.iter().zip(ends).map(leg).collect();
        Self { legs, moments: Vec::new() }
    }

    /// Looks at the truth at the start of a control period.
    pub fn see(&mut self, flight: &Flight, truth: &TrueMotion, is_drawn: bool) {
        let time_s = truth.time_ns as f64 * 1e-9;
        let Some(wanted) = flight.drive.tracking.as_ref().and_then(|(_, reference)| reference.at(time_s)) else {
            return;
        };
        let (wanted, found) = (wanted.state.world_from_body, truth.state.world_from_body);
        let error_world = found.translation.vector - wanted.translation.vector;
        let turn: Vector3<f64> = LieGroup::log(&(wanted.rotation.inverse() * found.rotation));
        let at = self.legs.partition_point(|leg| leg.from_s <= time_s).saturating_sub(1);
        if let Some(leg) = self.legs.get_mut(at) {
            leg.looks += 1;
            leg.squares_m2 += error_world.norm_squared();
            leg.worst_m = leg.worst_m.max(error_world.norm());
            leg.worst_rad = leg.worst_rad.max(turn.norm());
        }
        if is_drawn && flight.steering.is_accounted() {
            self.moments.push(Moment {
                time_s,
                error_world,
                mass_kg: flight.drive.account.mass().map(|mass| [mass.least_kg(), mass.largest_kg()]),
                true_mass_kg: flight.simulator.body().mass,
            });
        }
    }

    fn seen(&self) -> impl Iterator<Item = &Leg> {
        self.legs.iter().filter(|leg| leg.looks > 0)
    }

    /// For `summary.json`; `null` where there was no reference.
    pub fn summary(&self) -> Value {
        let legs: Vec<Value> = self
            .seen()
            .map(|leg| {
                json!({
                    "from_s": leg.from_s,
                    "until_s": leg.until_s,
                    "rms_m": leg.rms_m(),
                    "worst_m": leg.worst_m,
                    "worst_rad": leg.worst_rad,
                })
            })
            .collect();
        if legs.is_empty() { Value::Null } else { legs.into() }
    }

    /// For people.
    pub fn describe(&self, text: &mut String) {
        for (number, leg) in (1..).zip(self.seen()) {
            let what = format!("leg {number}, {:.0} to {:.0} s", leg.from_s, leg.until_s);
            let (rms, worst) = (1e3 * leg.rms_m(), 1e3 * leg.worst_m);
            let _ = writeln!(
                text,
                "  {what:<28}{rms:.1} mm RMS from the reference, {worst:.1} mm and {:.2} deg at most",
                leg.worst_rad.to_degrees()
            );
        }
    }

    /// The error, and the interval that the mass was taken to be in.
    pub fn charts(&self) -> Vec<Chart> {
        let mut charts = Vec::new();
        if self.moments.is_empty() {
            return charts;
        }
        let error = |name: &'static str, axis: usize| -> (_, Vec<[f64; 2]>) {
            (name, self.moments.iter().map(|moment| [moment.time_s, 1e3 * moment.error_world[axis]]).collect())
        };
        charts.push(Chart::of_curves(
            "tracking",
            "Position less reference, world axes",
            "mm",
            Axis::seconds(),
            [error("x", 0), error("y", 1), error("z", 2)],
        ));
        let mass = |name: &'static str, end: usize| -> (_, Vec<[f64; 2]>) {
            (name, self.moments.iter().filter_map(|m| Some([m.time_s, m.mass_kg?[end]])).collect())
        };
        let interval = [mass("least", 0), mass("largest", 1)];
        if interval.iter().any(|(_, points)| !points.is_empty()) {
            let truth = self.moments.iter().map(|moment| [moment.time_s, moment.true_mass_kg]).collect();
            let curves = interval.into_iter().chain([("truth", truth)]);
            let title = "Mass: the interval that the controller counts on";
            charts.push(Chart::of_curves("mass", title, "kg", Axis::seconds(), curves));
        }
        charts
    }
}

impl Leg {
    fn rms_m(&self) -> f64 {
        f64::sqrt(self.squares_m2 / self.looks as f64)
    }
}

/// What the controller did with a belief.
fn outcome(steering: &Steering, account: &ControlAccount, belief: &OfferedBelief) -> &'static str {
    let is_later = |other: &&OfferedBelief| other.revision > belief.revision;
    let mut later = account.beliefs().iter().filter(is_later);
    let decision_ns = steering.decision_s.unwrap_or(0.0) * 1e9;
    match (belief.answer, belief.used_from_ns) {
        (Adoption::Contradicts { .. }, _) => "contradicts",
        (Adoption::Adopted, _) => "adopted",
        // one that came before it was used has taken its place
        (Adoption::Postponed { .. }, None)
            if later.any(|other| !matches!(other.answer, Adoption::Contradicts { .. })) =>
        {
            "superseded"
        }
        (Adoption::Postponed { .. }, None) => "waiting",
        // the next decision is the first that can use it
        (Adoption::Postponed { .. }, Some(used_ns)) => {
            if (used_ns - belief.time_ns) as f64 > decision_ns * (1.0 + 1e-6) { "postponed" } else { "adopted" }
        }
        _ => "other",
    }
}

fn way(fallback: &Fallback) -> &'static str {
    match fallback {
        Fallback::Shifted(_) => "shifted",
        Fallback::Restarted(_) => "restarted",
        Fallback::Braking(_) => "braking",
        _ => "other",
    }
}

fn because(fallback: &Fallback) -> (&'static str, Option<f64>) {
    match fallback.reason() {
        FallbackReason::IterationCap => ("iteration-cap", None),
        FallbackReason::Numerical => ("numerical", None),
        FallbackReason::OutsideTube { excess } => ("outside-tube", Some(excess)),
        FallbackReason::Infeasible => ("infeasible", None),
        FallbackReason::NoReference => ("no-reference", None),
        _ => ("other", None),
    }
}

fn seconds(time_ns: i64) -> f64 {
    time_ns as f64 / 1e9
}

/// For `summary.json`; `null` for controllers that say nothing and are told nothing.
pub(super) fn summary(flight: &Flight) -> Value {
    let (steering, account) = (&flight.steering, &flight.drive.account);
    if !is_told(flight) {
        return Value::Null;
    }
    let belief = |belief: &OfferedBelief| {
        json!({
            "t_s": seconds(belief.time_ns),
            "revision": belief.revision,
            "outcome": outcome(steering, account, belief),
            "used_from_s": belief.used_from_ns.map(seconds),
        })
    };
    let spell = |spell: &FallbackSpell| {
        let (reason, excess) = because(&spell.fallback);
        json!({
            "from_s": seconds(spell.from_ns),
            "until_s": seconds(spell.until_ns),
            "fallback": way(&spell.fallback),
            "reason": reason,
            "excess": excess,
        })
    };
    json!({
        "controller": steering.controller,
        "model_revision": account.model_revision(),
        "mass_interval_kg": account.mass().map(|mass| [mass.least_kg(), mass.largest_kg()]),
        "beliefs": account.beliefs().iter().map(belief).collect::<Vec<_>>(),
        "fallbacks": account.fallbacks().iter().map(spell).collect::<Vec<_>>(),
        "fallbacks_not_listed": account.fallbacks_not_listed(),
        "fallback_s": seconds(account.fallback_ns()),
        "largest_force_n": <[f64; 3]>::from(*account.largest_force_n()),
        "largest_torque_n_m": account.largest_torque_n_m(),
        "force_limit_n": steering.limits.map(|limits| <[f64; 3]>::from(limits.force_n)),
        "planned_acceleration_m_s2": steering.planned_m_s2.map(<[f64; 3]>::from),
        "torque_limit_n_m": steering.limits.map(|limits| limits.torque_n_m),
    })
}

/// Whether there is something to say.
pub(super) fn is_told(flight: &Flight) -> bool {
    flight.steering.is_accounted() || !flight.drive.beliefs.is_empty()
}

/// For people.
pub(super) fn describe(flight: &Flight, text: &mut String) {
    let (steering, account) = (&flight.steering, &flight.drive.account);
    if !is_told(flight) {
        return;
    }
    let mut line = |what: &str, value: String| {
        let _ = writeln!(text, "  {what:<28}{value}");
    };
    let mass = account
        .mass()
        .map_or_else(String::new, |mass| format!(", mass {:.3} to {:.3} kg", mass.least_kg(), mass.largest_kg()));
    line("controller", format!("{}, belief {}{mass}", steering.controller, account.model_revision()));
    if let Some(limits) = &steering.limits {
        let share = account.largest_force_n().component_div(&limits.force_n) * 100.0;
        line("force limits used", format!("{:.0}, {:.0}, {:.0} % at most along x, y, z", share.x, share.y, share.z));
        let torque = account.largest_torque_n_m();
        line("torque limit used", format!("{:.0} % at most", 100.0 * torque / limits.torque_n_m));
    }
    if let Some(left) = steering.planned_m_s2 {
        let text =
            format!("{:.4}, {:.4}, {:.4} m/s^2 at first, all else lost to what is not known", left.x, left.y, left.z);
        line("acceleration planned with", text);
    }
    line("beliefs", counted(steering, account));
    for belief in account.beliefs().iter().skip(1).take(SHOWN) {
        let used = match belief.used_from_ns {
            Some(used_ns) => format!(", used from {:.3} s", seconds(used_ns)),
            None => String::new(),
        };
        let what = outcome(steering, account, belief);
        let _ = writeln!(text, "    {:>9.3} s  belief {} {what}{used}", seconds(belief.time_ns), belief.revision);
    }
    let more = account.beliefs().len().saturating_sub(1 + SHOWN);
    if more > 0 {
        let _ = writeln!(text, "    and {more} more (summary.json has all)");
    }
    let fallbacks = account.fallbacks();
    let counts = match fallbacks.len() as u64 + account.fallbacks_not_listed() {
        0 => "none".to_owned(),
        count => format!("{count}, {:.3} s in all", seconds(account.fallback_ns())),
    };
    let _ = writeln!(text, "  {:<28}{counts}", "fallbacks");
    for spell in fallbacks.iter().take(SHOWN) {
        let (reason, excess) = because(&spell.fallback);
        let excess = excess.map_or_else(String::new, |excess| format!(" by {:.0} %", 100.0 * excess));
        let (from_s, until_s) = (seconds(spell.from_ns), seconds(spell.until_ns));
        let _ = writeln!(text, "    {from_s:>9.3} s  {} to {until_s:.3} s: {reason}{excess}", way(&spell.fallback));
    }
    let more = (fallbacks.len().saturating_sub(SHOWN)) as u64 + account.fallbacks_not_listed();
    if more > 0 {
        let _ = writeln!(text, "    and {more} more (summary.json has the first of them)");
    }
}

/// Where a controller spent much of the flight off its main road: what to look at.
pub(super) fn advice(flight: &Flight) -> Option<String> {
    let share = seconds(flight.drive.account.fallback_ns()) / seconds(flight.duration_ns);
    (share > MUCH).then(|| {
        format!(
            "note: {:.0} % of the flight passed in fallbacks, where nothing is promised: sensing errs, or something pushes, more than \
             `position_error_m`, `velocity_error_m_s` and `force_error_n` of `[drive.control]` say",
            100.0 * share
        )
    })
}

/// Share of a flight in fallbacks that is worth a word.
const MUCH: f64 = 0.05;

/// Most beliefs and most fallbacks listed for people.
const SHOWN: usize = 10;

fn counted(steering: &Steering, account: &ControlAccount) -> String {
    let count =
        |what: &str| account.beliefs().iter().filter(|belief| outcome(steering, account, belief) == what).count();
    let counts = ["adopted", "postponed", "waiting", "superseded", "contradicts"].map(|what| (what, count(what)));
    let said: Vec<String> =
        counts.iter().filter(|(_, count)| *count > 0).map(|(what, count)| format!("{count} {what}")).collect();
    if said.is_empty() { "none".to_owned() } else { said.join(", ") }
}
