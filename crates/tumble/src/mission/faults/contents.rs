//! Messages that come as they should and say what is not so.

use super::fault::{Counts, Fault, add};
use super::window::{Window, nanoseconds};
use tumble_astrobee::sensing::{Confidence, LocalizationEstimate};
use tumble_dynamics::nalgebra::{Quaternion, UnitQuaternion, Vector3};
use tumble_identification::noise::Gaussian;
use tumble_lie::LieGroup;

/// Of any length but zero, in the plane where asked for.
fn direction(random: &mut Gaussian) -> Vector3<f64> {
    let drawn = random.vector(1.0);
    drawn / drawn.norm().max(f64::MIN_POSITIVE)
}

/// Turned into the table, of the same length; `axis` for a vector of rotation.
fn flat(vector: &Vector3<f64>, is_rotation: bool) -> Vector3<f64> {
    let length = vector.norm();
    if is_rotation {
        return Vector3::new(0.0, 0.0, length.copysign(vector.z));
    }
    let across = libm::hypot(vector.x, vector.y);
    if across > 0.0 {
        Vector3::new(vector.x, vector.y, 0.0) * (length / across)
    } else {
        Vector3::new(length, 0.0, 0.0)
    }
}

/// The clock that stamps messages is set wrong, and back.
pub(super) struct Clock {
    spell: Window,
    /// Offsets in turn, each for the same time, s.
    offsets_s: Vec<f64>,
    each_s: f64,
    stamped: u64,
}

impl Clock {
    /// By 0.1 s either way for 5 s; by 10 s; to and fro, ten times.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let spell = Window::draw(&mut random, duration_s, 5.0);
        let sign = if random.uniform() < 0.5 { -1.0 } else { 1.0 };
        let (offsets_s, each_s) = match severity {
            1 => (vec![0.1 * sign], f64::INFINITY),
            2 => (vec![10.0 * sign], f64::INFINITY),
            _ => (vec![-10.0, 0.1, -0.1, 10.0, 0.0, -0.1, 0.1, -10.0, 10.0, -0.1], 0.5),
        };
        Self { spell, offsets_s, each_s, stamped: 0 }
    }
}

impl Fault for Clock {
    fn pass(&mut self, time_ns: i64, stream: &mut Vec<LocalizationEstimate>) {
        if !self.spell.contains(time_ns) {
            return;
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative, at most ten
        let turn = (self.spell.since_s(time_ns) / self.each_s) as usize;
        let offset_ns = nanoseconds(self.offsets_s.get(turn).copied().unwrap_or(0.0));
        for message in stream {
            message.stamp_ns = message.stamp_ns.saturating_add(offset_ns);
            self.stamped += u64::from(offset_ns != 0);
        }
    }

    fn count(&self, counts: &mut Counts) {
        add(counts, "stamps-wrong", self.stamped);
    }
}

/// Numbers that are none.
#[allow(clippy::struct_field_names)] // the field's word
pub(super) struct Malformed {
    spells: Vec<Window>,
    probability: f64,
    random: Gaussian,
    malformed: u64,
}

/// Ways in which a message can be malformed.
const DEFORMATIONS: [fn(&mut LocalizationEstimate); 9] = [
    |message| message.world_from_body.translation.vector.x = f64::NAN,
    |message| message.velocity_origin_world.y = f64::INFINITY,
    |message| message.rate_body.z = f64::NEG_INFINITY,
    |message| message.acceleration_origin_body = Vector3::repeat(f64::NAN),
    // the norm underflows to zero
    |message| scale_quaternion(message, 1e-310),
    |message| message.velocity_origin_world = Vector3::repeat(1e308),
    |message| scale_quaternion(message, 1.5),
    |message| scale_quaternion(message, f64::NAN),
    // the same attitude: harmless, and must be
    |message| scale_quaternion(message, -1.0),
];

fn scale_quaternion(message: &mut LocalizationEstimate, factor: f64) {
    let scaled: Quaternion<f64> = message.world_from_body.rotation.into_inner() * factor;
    message.world_from_body.rotation = UnitQuaternion::new_unchecked(scaled);
}

impl Malformed {
    /// Single messages (2 %), every fifth for 5 s, all of them for three times one second.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let (length_s, probability) = match severity {
            1 => (10.0, 0.02),
            2 => (5.0, 0.2),
            _ => (5.0, 1.0),
        };
        let whole = Window::draw(&mut random, duration_s, length_s);
        let later = |by_s: f64| {
            let from_ns = whole.from_ns.saturating_add(nanoseconds(by_s));
            Window { from_ns, ..whole }.first_s(1.0)
        };
        let spells = if severity < 3 { vec![whole] } else { [0.0, 2.0, 4.0].map(later).to_vec() };
        Self { spells, probability, random, malformed: 0 }
    }
}

impl Fault for Malformed {
    fn pass(&mut self, time_ns: i64, stream: &mut Vec<LocalizationEstimate>) {
        if !self.spells.iter().any(|spell| spell.contains(time_ns)) {
            return;
        }
        for message in stream {
            let (whether, which) = (self.random.uniform(), self.random.uniform());
            if whether < self.probability {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // below their number
                let which = (which * DEFORMATIONS.len() as f64) as usize;
                if let Some(deform) = DEFORMATIONS.get(which) {
                    deform(message);
                    self.malformed += 1;
                }
            }
        }
    }

    fn count(&self, counts: &mut Counts) {
        add(counts, "estimates-malformed", self.malformed);
    }
}

/// What a sensor that is stuck says.
enum Stuck {
    /// What it said last, with new stamps.
    Frozen(Option<LocalizationEstimate>),
    /// The truth and an error that grows: rates of position (m/s, world axes) and attitude (rad/s, world axes).
    Ramp([Vector3<f64>; 2]),
    /// Velocities, rates and accelerations too large by a factor.
    Scaled(f64),
}

/// The localisation stands still, drifts away, or exaggerates.
pub(super) struct Frozen {
    spell: Window,
    stuck: Stuck,
    wrong: u64,
}

impl Frozen {
    /// For 1, 3, 10 s; what of the three, the seed decides.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let length_s = match severity {
            1 => 1.0,
            2 => 3.0,
            _ => 10.0,
        };
        let spell = Window::draw(&mut random, duration_s, length_s);
        let stuck = match random.uniform() {
            kind if kind < 0.4 => Stuck::Frozen(None),
            kind if kind < 0.7 => Stuck::Ramp([direction(&mut random) * 0.02, direction(&mut random) * 0.02]),
            _ => Stuck::Scaled(1.35),
        };
        Self { spell, stuck, wrong: 0 }
    }
}

impl Fault for Frozen {
    fn in_plane(&mut self) {
        if let Stuck::Ramp([position, attitude]) = &mut self.stuck {
            (*position, *attitude) = (flat(position, false), flat(attitude, true));
        }
    }

    fn pass(&mut self, time_ns: i64, stream: &mut Vec<LocalizationEstimate>) {
        let since_s = self.spell.since_s(time_ns);
        let is_wrong = self.spell.contains(time_ns);
        for message in stream {
            match &mut self.stuck {
                Stuck::Frozen(last) if is_wrong => {
                    let said = *last.get_or_insert(*message);
                    let (stamp_ns, arrival_ns) = (message.stamp_ns, message.arrival_ns);
                    *message = LocalizationEstimate { stamp_ns, arrival_ns, ..said };
                }
                Stuck::Frozen(last) => *last = Some(*message),
                Stuck::Ramp([position, attitude]) if is_wrong => {
                    displace(message, &(*position * since_s), &(*attitude * since_s));
                }
                Stuck::Scaled(factor) if is_wrong => {
                    message.velocity_origin_world *= *factor;
                    message.rate_body *= *factor;
                    message.acceleration_origin_body *= *factor;
                }
                Stuck::Ramp(_) | Stuck::Scaled(_) => {}
            }
            self.wrong += u64::from(is_wrong);
        }
    }

    fn count(&self, counts: &mut Counts) {
        let name = match self.stuck {
            Stuck::Frozen(_) => "estimates-frozen",
            Stuck::Ramp(_) => "estimates-drifting",
            Stuck::Scaled(_) => "estimates-scaled",
        };
        add(counts, name, self.wrong);
    }
}

/// Moves and turns a pose, both in world axes.
fn displace(message: &mut LocalizationEstimate, position_world: &Vector3<f64>, turn_world: &Vector3<f64>) {
    let turn: UnitQuaternion<f64> = LieGroup::exp(turn_world);
    let pose = &mut message.world_from_body;
    pose.translation.vector += position_world;
    pose.rotation = turn * pose.rotation;
}

/// The localisation is somewhere else at once, and comes back.
pub(super) struct Jump {
    spell: Window,
    position_world: Vector3<f64>,
    turn_world: Vector3<f64>,
    is_honest: bool,
    wrong: u64,
}

impl Jump {
    /// Time it stays away, and time in which it then comes back, s.
    pub const SPELL_S: [f64; 2] = [3.0, 2.0];

    /// 5 cm and 5 degrees, 20 cm and 15 degrees, 50 cm and 30 degrees; whether the message says so, the seed decides.
    pub fn new(severity: u8, mut random: Gaussian, duration_s: f64) -> Self {
        let (away_m, turned_degrees) = match severity {
            1 => (0.05, 5.0_f64),
            2 => (0.2, 15.0),
            _ => (0.5, 30.0),
        };
        let [away_s, back_s] = Self::SPELL_S;
        Self {
            spell: Window::draw(&mut random, duration_s, away_s + back_s),
            position_world: direction(&mut random) * away_m,
            turn_world: direction(&mut random) * turned_degrees.to_radians(),
            is_honest: random.uniform() < 0.5,
            wrong: 0,
        }
    }
}

impl Fault for Jump {
    fn in_plane(&mut self) {
        self.position_world = flat(&self.position_world, false);
        self.turn_world = flat(&self.turn_world, true);
    }

    fn pass(&mut self, time_ns: i64, stream: &mut Vec<LocalizationEstimate>) {
        if !self.spell.contains(time_ns) {
            return;
        }
        let [away_s, back_s] = Self::SPELL_S;
        let share = ((away_s + back_s - self.spell.since_s(time_ns)) / back_s).clamp(0.0, 1.0);
        for message in stream {
            displace(message, &(self.position_world * share), &(self.turn_world * share));
            if self.is_honest {
                message.confidence = if share < 1.0 { Confidence::Poor } else { Confidence::Lost };
            }
            self.wrong += 1;
        }
    }

    fn count(&self, counts: &mut Counts) {
        add(counts, "estimates-displaced", self.wrong);
    }
}
