//! A robot that does not do what it is told, or is not what it was.

use super::fault::{Counts, Fault, PlantChange, add};
use super::window::Window;
use tumble_astrobee::control_presets::rattle_limits;
use tumble_astrobee::propulsion::Damage;
use tumble_astrobee::simulator::BodyStep;
use tumble_dynamics::nalgebra::Vector3;
use tumble_dynamics::{Actuation, WrenchBox};
use tumble_identification::noise::Gaussian;

/// Less force and torque than there should be; the robot knows what it asks for in the end.
pub(super) struct Saturation {
    spell: Window,
    factor: f64,
    limits: WrenchBox,
    cut: u64,
}

impl Saturation {
    /// Half the limits for 10 s, a tenth, nothing at all for 5 s.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let (factor, length_s) = match severity {
            1 => (0.5, 10.0),
            2 => (0.1, 10.0),
            _ => (0.0, 5.0),
        };
        let limits = rattle_limits();
        let limits = WrenchBox { torque_limit: Vector3::repeat(limits.torque_n_m), force_limit: limits.force_n };
        Self { spell: Window::draw(&mut random, duration_s, length_s), factor, limits, cut: 0 }
    }
}

impl Fault for Saturation {
    fn limited_to(&mut self, limits: &WrenchBox) {
        self.limits = *limits;
    }

    fn act(&mut self, time_ns: i64, change: &mut PlantChange) {
        if self.spell.contains(time_ns) {
            let left = WrenchBox {
                torque_limit: self.limits.torque_limit * self.factor,
                force_limit: self.limits.force_limit * self.factor,
            };
            let given = left.realize(&change.wanted);
            self.cut += u64::from(given != change.wanted);
            change.wanted = given;
        }
    }

    fn count(&self, counts: &mut Counts) {
        add(counts, "wrenches-cut", self.cut);
    }
}

/// Thrust that is not what it should be.
pub(super) struct Nozzle {
    spell: Window,
    damage: Damage,
    name: &'static str,
    periods: u64,
}

impl Nozzle {
    /// All thrust times 0.7 or 1.25 for good; one nozzle dead, or stuck partly open, for good; one impeller off for 4 s.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let (which, how) = (random.uniform(), random.uniform());
        let mut damage = Damage::NONE;
        let stays = Window::for_good(&mut random, duration_s);
        let (spell, name) = match severity {
            1 => {
                damage.thrust_factor = if how < 0.5 { 0.7 } else { 1.25 };
                (stays, "periods-thrust-scaled")
            }
            2 => {
                // closed in half of the cases
                let share = if how < 0.5 { 0.0 } else { 0.1 + how - 0.5 };
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 11
                if let Some(stuck) = damage.stuck.get_mut((which * 12.0) as usize) {
                    *stuck = Some(share);
                }
                (stays, "periods-nozzle-stuck")
            }
            _ => {
                damage.impeller_off = [which < 0.5, which >= 0.5];
                (Window::draw(&mut random, duration_s, 4.0), "periods-impeller-off")
            }
        };
        Self { spell, damage, name, periods: 0 }
    }
}

impl Fault for Nozzle {
    fn act(&mut self, time_ns: i64, change: &mut PlantChange) {
        if self.spell.contains(time_ns) {
            change.damage = Damage { supply_factor: change.damage.supply_factor, ..self.damage };
            self.periods += 1;
        }
    }

    fn count(&self, counts: &mut Counts) {
        add(counts, self.name, self.periods);
    }
}

/// The supply sags, and the computer starts anew.
pub(super) struct Power {
    spell: Window,
    supply_factor: f64,
    /// Times of restarts that are still to come, the last first, ns.
    restarts_ns: Vec<i64>,
    periods: u64,
    restarted: u64,
}

impl Power {
    /// 10 % for 10 s; 30 % and a restart; 30 % and three.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let (supply_factor, restarts) = match severity {
            1 => (0.9, 0),
            2 => (0.7, 1),
            _ => (0.7, 3),
        };
        let spell = Window::draw(&mut random, duration_s, 10.0);
        let mut restarts_ns: Vec<i64> = (0..restarts).map(|_| spell.part(&mut random, 0.0).from_ns).collect();
        restarts_ns.sort_unstable_by(|a, b| b.cmp(a));
        Self { spell, supply_factor, restarts_ns, periods: 0, restarted: 0 }
    }
}

impl Fault for Power {
    fn act(&mut self, time_ns: i64, change: &mut PlantChange) {
        if self.spell.contains(time_ns) {
            change.damage.supply_factor = self.supply_factor;
            self.periods += 1;
        }
    }

    fn restart_due(&mut self, time_ns: i64) -> bool {
        let before = self.restarts_ns.len();
        while self.restarts_ns.last().is_some_and(|due_ns| *due_ns <= time_ns) {
            self.restarts_ns.pop();
        }
        let is_due = self.restarts_ns.len() < before;
        self.restarted += u64::from(is_due);
        is_due
    }

    fn count(&self, counts: &mut Counts) {
        add(counts, "periods-supply-low", self.periods);
        add(counts, "restarts", self.restarted);
    }
}

/// The body changes and nobody says so.
pub(super) struct MassStep {
    at_ns: i64,
    step: BodyStep,
    is_done: bool,
}

impl MassStep {
    /// Distance of a lump from the robot's centre, and its radius, m.
    pub const LUMP_M: [f64; 2] = [0.15, 0.08];

    /// 10 % more or less of the same; 50 %; a ball of half the mass on one side.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let at_ns = Window::for_good(&mut random, duration_s).from_ns;
        let sign = if random.uniform() < 0.5 { -1.0 } else { 1.0 };
        let drawn = random.vector(1.0);
        let [away_m, radius_m] = Self::LUMP_M;
        let step = match severity {
            1 => BodyStep::Scaled(1.0 + 0.1 * sign),
            2 => BodyStep::Scaled(1.0 + 0.5 * sign),
            _ => {
                let center_body = drawn * (away_m / drawn.norm().max(f64::MIN_POSITIVE));
                BodyStep::Lump { mass_share: 0.5, center_body, radius_m }
            }
        };
        Self { at_ns, step, is_done: false }
    }
}

impl Fault for MassStep {
    fn act(&mut self, time_ns: i64, change: &mut PlantChange) {
        if !self.is_done && time_ns >= self.at_ns {
            self.is_done = true;
            change.body = Some(self.step);
        }
    }

    fn count(&self, counts: &mut Counts) {
        add(counts, "mass-steps", u64::from(self.is_done));
    }
}
