//! What a controller said while it flew.

use tumble_dynamics::nalgebra::Vector3;
use tumble_planning::control::{Adoption, ControlCommand, Fallback, FallbackReason, MassInterval};

/// Room for each list; what comes after is only counted.
const ROOM: usize = 256;

/// A belief that a controller was offered, and what became of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OfferedBelief {
    /// When, ns.
    pub time_ns: i64,
    /// Its revision.
    pub revision: u64,
    /// What the controller answered.
    pub answer: Adoption,
    /// When the first command that used it was given, ns; `None` where none was.
    pub used_from_ns: Option<i64>,
}

/// A time for which a controller left its main road in the same way for the same reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FallbackSpell {
    /// Time of the first command that said so, ns.
    pub from_ns: i64,
    /// When the last command that said so was followed by one that might not have, ns.
    pub until_ns: i64,
    /// How and why; of [`FallbackReason::OutsideTube`] the largest excess.
    pub fallback: Fallback,
}

/// What a controller said while it flew.
#[derive(Clone, Debug, PartialEq)]
pub struct ControlAccount {
    beliefs: Vec<OfferedBelief>,
    spells: Vec<FallbackSpell>,
    /// The one going on, or the last one.
    spell: Option<FallbackSpell>,
    spells_lost: u64,
    /// For how long a command that names a fallback stands, ns.
    holds_ns: i64,
    fallback_ns: i64,
    largest_force_n: Vector3<f64>,
    largest_torque_n_m: f64,
    last: Option<ControlCommand>,
}

impl Default for ControlAccount {
    fn default() -> Self {
        Self {
            beliefs: Vec::with_capacity(ROOM),
            spells: Vec::with_capacity(ROOM),
            spell: None,
            spells_lost: 0,
            holds_ns: super::CONTROL_PERIOD_NS,
            fallback_ns: 0,
            largest_force_n: Vector3::zeros(),
            largest_torque_n_m: 0.0,
            last: None,
        }
    }
}

impl ControlAccount {
    /// Of a controller that names a fallback once per decision, when it takes it.
    pub fn with_decisions(decision_ns: i64) -> Self {
        Self { holds_ns: decision_ns, ..Self::default() }
    }

    /// The beliefs that were offered, in order.
    pub fn beliefs(&self) -> &[OfferedBelief] {
        &self.beliefs
    }

    /// When the controller left its main road: the first times.
    pub fn fallbacks(&self) -> &[FallbackSpell] {
        &self.spells
    }

    /// How many times came after those.
    pub fn fallbacks_not_listed(&self) -> u64 {
        self.spells_lost
    }

    /// For how long in all, ns.
    pub fn fallback_ns(&self) -> i64 {
        self.fallback_ns
    }

    /// The last command.
    pub fn command(&self) -> Option<&ControlCommand> {
        self.last.as_ref()
    }

    /// [`ControlCommand::model_revision`] of the last command; zero before the first.
    pub fn model_revision(&self) -> u64 {
        self.command().map_or(0, |command| command.model_revision)
    }

    /// Where the controller took the mass to be at last.
    pub fn mass(&self) -> Option<MassInterval> {
        self.command().and_then(|command| command.mass)
    }

    /// Largest magnitude of each component of the force that was asked for, body axes, N.
    pub fn largest_force_n(&self) -> &Vector3<f64> {
        &self.largest_force_n
    }

    /// Largest norm of the torque that was asked for, N m.
    pub fn largest_torque_n_m(&self) -> f64 {
        self.largest_torque_n_m
    }

    /// How many beliefs were offered.
    pub(super) fn offered(&self) -> usize {
        self.beliefs.len()
    }

    /// Revision of the belief that the way was laid out with: the first.
    pub(super) fn plan_belief(&self) -> u64 {
        self.beliefs.first().map_or(0, |belief| belief.revision)
    }

    pub(super) fn answered(&mut self, time_ns: i64, revision: u64, answer: Adoption) {
        self.beliefs.push(OfferedBelief { time_ns, revision, answer, used_from_ns: None });
    }

    /// Takes a command.
    pub fn commanded(&mut self, time_ns: i64, command: &ControlCommand) {
        self.largest_force_n = self.largest_force_n.sup(&command.wrench_body.force.abs());
        self.largest_torque_n_m = self.largest_torque_n_m.max(command.wrench_body.torque.norm());
        if self.last.as_ref().is_none_or(|last| last.model_revision != command.model_revision) {
            let first = |belief: &&mut OfferedBelief| belief.revision == command.model_revision;
            if let Some(belief) = self.beliefs.iter_mut().find(first) {
                belief.used_from_ns.get_or_insert(time_ns);
            }
        }
        if let Some(fallback) = command.fallback {
            self.left_road(time_ns, fallback);
        }
        self.last = Some(*command);
    }

    /// The flight is over: what stood until later has lasted until now.
    pub fn end(&mut self, time_ns: i64) {
        if let Some(spell) = self.spell.as_mut().filter(|spell| spell.until_ns > time_ns) {
            self.fallback_ns -= spell.until_ns - time_ns;
            spell.until_ns = time_ns;
        }
        if let Some(listed) = self.spells.last_mut().filter(|listed| listed.until_ns > time_ns) {
            listed.until_ns = time_ns;
        }
    }

    fn left_road(&mut self, time_ns: i64, fallback: Fallback) {
        let until_ns = time_ns.saturating_add(self.holds_ns);
        if let Some(spell) = &mut self.spell
            && spell.until_ns >= time_ns
            && alike(&spell.fallback, &fallback)
        {
            self.fallback_ns += until_ns - spell.until_ns;
            spell.until_ns = until_ns;
            spell.fallback = worse(spell.fallback, fallback);
            if let Some(listed) = self.spells.last_mut().filter(|listed| listed.from_ns == spell.from_ns) {
                *listed = *spell;
            }
            return;
        }
        let spell = FallbackSpell { from_ns: time_ns, until_ns, fallback };
        // one that another cuts short has lasted until now
        let unspent_ns = self.spell.map_or(0, |before| (before.until_ns - time_ns).max(0));
        self.fallback_ns += self.holds_ns - unspent_ns;
        if let Some(listed) = self.spells.last_mut().filter(|listed| listed.until_ns > time_ns) {
            listed.until_ns = time_ns;
        }
        self.spell = Some(spell);
        if self.spells.len() < ROOM {
            self.spells.push(spell);
        } else {
            self.spells_lost += 1;
        }
    }
}

/// The same way and reason, whatever the excess.
fn alike(one: &Fallback, other: &Fallback) -> bool {
    use std::mem::discriminant;
    discriminant(one) == discriminant(other) && discriminant(&one.reason()) == discriminant(&other.reason())
}

/// Of two alike the one with the larger excess.
fn worse(one: Fallback, other: Fallback) -> Fallback {
    match (one.reason(), other.reason()) {
        (FallbackReason::OutsideTube { excess: a }, FallbackReason::OutsideTube { excess: b }) if b > a => other,
        _ => one,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_lie::Wrench;

    fn command(model_revision: u64, fallback: Option<Fallback>) -> ControlCommand {
        ControlCommand { wrench_body: Wrench::zero(), model_revision, fallback, mass: None }
    }

    fn outside(excess: f64) -> Fallback {
        Fallback::Restarted(FallbackReason::OutsideTube { excess })
    }

    #[test]
    fn commands_in_a_row_off_the_road_for_one_reason_are_one_spell() {
        let mut account = ControlAccount::with_decisions(10);
        let shifted = Fallback::Shifted(FallbackReason::IterationCap);
        // decisions every ten, outputs every five; only decisions name a fallback
        let said = [
            None,
            Some(outside(0.1)),
            Some(outside(0.3)),
            Some(outside(0.2)),
            Some(shifted),
            None,
            Some(shifted),
            Some(shifted),
        ];
        for (decision, fallback) in (0..).zip(said) {
            account.commanded(10 * decision, &command(1, fallback));
            account.commanded(10 * decision + 5, &command(1, None));
        }
        let found: Vec<_> = account.fallbacks().iter().map(|s| (s.from_ns, s.until_ns, s.fallback)).collect();
        assert_eq!(found, [(10, 40, outside(0.3)), (40, 50, shifted), (60, 80, shifted)]);
        assert_eq!((account.fallback_ns(), account.fallbacks_not_listed()), (60, 0));
        // another reason before the time is over
        account.commanded(74, &command(1, Some(outside(0.5))));
        let last: Vec<_> = account.fallbacks().iter().skip(2).map(|s| (s.from_ns, s.until_ns)).collect();
        assert_eq!((last, account.fallback_ns()), (vec![(60, 74), (74, 84)], 64));
        // the flight ends before that
        account.end(80);
        account.end(90);
        let last: Vec<_> = account.fallbacks().iter().skip(2).map(|s| (s.from_ns, s.until_ns)).collect();
        assert_eq!((last, account.fallback_ns()), (vec![(60, 74), (74, 80)], 60));

        let push = |x: f64| ControlCommand {
            wrench_body: Wrench::new(Vector3::new(0.0, -0.1 * x, 0.0), Vector3::new(x, 0.0, 0.0)),
            ..command(1, None)
        };
        for x in [0.5, -2.0, 1.0] {
            account.commanded(99, &push(x));
        }
        assert!((account.largest_force_n() - Vector3::new(2.0, 0.0, 0.0)).amax() < 1e-15);
        assert!((account.largest_torque_n_m() - 0.2).abs() < 1e-15);
    }

    #[test]
    fn a_full_list_keeps_the_first_spells_and_counts_the_others() {
        let mut account = ControlAccount::with_decisions(1);
        for k in 0..2_000_i64 {
            let fallback = if k % 2 == 0 { outside(0.5) } else { Fallback::Braking(FallbackReason::Infeasible) };
            account.commanded(2 * k, &command(1, Some(fallback)));
            account.commanded(2 * k + 1, &command(1, Some(fallback)));
        }
        assert_eq!((account.fallbacks().len(), account.fallbacks_not_listed()), (ROOM, 2_000 - ROOM as u64));
        assert!(account.fallbacks().iter().all(|spell| spell.until_ns == spell.from_ns + 2));
        assert_eq!(account.fallback_ns(), 4_000);
    }

    #[test]
    fn a_postponed_belief_is_used_from_the_first_command_that_names_it() {
        let mut account = ControlAccount::default();
        account.answered(0, 1, Adoption::Adopted);
        account.commanded(0, &command(1, None));
        account.answered(10, 2, Adoption::Postponed { kept: 1 });
        account.commanded(10, &command(1, None));
        assert_eq!((account.offered(), account.beliefs()[1].revision, account.plan_belief()), (2, 2, 1));
        assert_eq!(account.model_revision(), 1);
        account.commanded(20, &command(2, None));
        account.commanded(30, &command(2, None));
        let used: Vec<_> = account.beliefs().iter().map(|belief| belief.used_from_ns).collect();
        assert_eq!(used, [Some(0), Some(20)]);
    }
}
