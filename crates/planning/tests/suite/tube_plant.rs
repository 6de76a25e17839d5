//! Judges the controller of one axis by the forces it sends and by what it promises.
//!
//! Shares no code with the controllers. A body of a certain mass is moved along the exact parabola of each step, pushed by what
//! is drawn here, and measured with an error that is drawn here; the tube is looked up in normals and distances, the nominal step
//! and the force of the plan are worked out anew.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use tumble_identification::noise::signed_unit;

/// Position and velocity, m, m/s.
pub type Moment = [f64; 2];

/// Input excess that rounding explains, N.
pub const FORCE_TOLERANCE_N: f64 = 1e-12;
/// Tube excess that the solver's tolerance explains, m or m/s.
pub const TUBE_TOLERANCE: f64 = 1e-9;
/// Steps after which a plan of disturbances against one quantity begins anew.
const CYCLE: usize = 100;

/// What a disturbance is chosen against.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    Input,
    Position,
    Velocity,
}

/// How disturbances are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Policy {
    /// Anywhere inside.
    Random,
    /// At a random corner each step.
    Vertex,
    /// At one corner.
    Constant,
    /// At the corner that makes an error larger that is there.
    Toward(Aim),
    /// At the corners that together make an error as large as linear feedback lets it become.
    Planned(Aim),
}

impl Policy {
    pub const ALL: [Self; 9] = [
        Self::Random,
        Self::Vertex,
        Self::Constant,
        Self::Toward(Aim::Input),
        Self::Toward(Aim::Position),
        Self::Toward(Aim::Velocity),
        Self::Planned(Aim::Input),
        Self::Planned(Aim::Position),
        Self::Planned(Aim::Velocity),
    ];
}

/// Largest disturbances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Disturbances {
    /// Jump of position and velocity at the end of a step.
    pub jump: Moment,
    /// Force that is constant over a step, N.
    pub force_n: f64,
    /// Error of measurement.
    pub measured: Moment,
}

/// What an axis must keep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    pub force_n: f64,
    pub speed_m_s: f64,
    pub walls_m: [f64; 2],
}

/// What a controller says about one decision.
#[derive(Clone, Copy, Debug)]
pub struct Decision<'a> {
    /// The force sent, N.
    pub force_n: f64,
    /// What it says the force is made of: the mass that turns accelerations into forces, stiffness and damping.
    pub center_kg: f64,
    pub gain: [f64; 2],
    /// Nominal state now, and the nominal acceleration.
    pub start: Moment,
    pub acceleration_m_s2: f64,
    /// Faces of the tube: unit normals and their distances from the nominal state, both ways.
    pub faces: &'a [(Moment, f64)],
}

/// The largest excess over each promise; negative where it was never reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Findings {
    pub steps: u64,
    /// Of the force that the plan asks for, before it is cut, N.
    pub force_excess_n: f64,
    /// Largest difference of the force sent and that of the plan, N.
    pub disagreement_n: f64,
    /// Of the measured error at the decision, m or m/s; a plan whose start is free may put it on a face.
    pub tube_excess: f64,
    /// Of the measured error after the step, about the nominal state then.
    pub tube_excess_after: f64,
    pub speed_excess_m_s: f64,
    /// At the decisions, m.
    pub wall_excess_m: f64,
    /// Between them, m.
    pub wall_excess_between_m: f64,
    /// Steps on which the error left the tube by more than [`TUBE_TOLERANCE`].
    pub exits: u64,
    /// Steps on which the input exceeded its limit by more than [`FORCE_TOLERANCE_N`], or speed or wall were exceeded.
    pub violations: u64,
}

impl Default for Findings {
    fn default() -> Self {
        let none = f64::NEG_INFINITY;
        Self {
            steps: 0,
            force_excess_n: none,
            disagreement_n: 0.0,
            tube_excess: none,
            tube_excess_after: none,
            speed_excess_m_s: none,
            wall_excess_m: none,
            wall_excess_between_m: none,
            exits: 0,
            violations: 0,
        }
    }
}

impl Findings {
    pub fn merge(&mut self, other: &Self) {
        self.steps += other.steps;
        self.exits += other.exits;
        self.violations += other.violations;
        for (mine, theirs) in [
            (&mut self.force_excess_n, other.force_excess_n),
            (&mut self.disagreement_n, other.disagreement_n),
            (&mut self.tube_excess, other.tube_excess),
            (&mut self.tube_excess_after, other.tube_excess_after),
            (&mut self.speed_excess_m_s, other.speed_excess_m_s),
            (&mut self.wall_excess_m, other.wall_excess_m),
            (&mut self.wall_excess_between_m, other.wall_excess_between_m),
        ] {
            *mine = worse(*mine, theirs);
        }
    }
}

/// The larger one; no number is the largest of all.
fn worse(one: f64, other: f64) -> f64 {
    if one.is_nan() || one > other { one } else { other }
}

fn side(chance: &mut ChaCha8Rng) -> f64 {
    if chance.next_u64() >> 63 == 0 { -1.0 } else { 1.0 }
}

/// A body on one axis, what disturbs it, and what was found of its controller.
#[derive(Clone, Debug)]
pub struct Plant {
    mass_kg: f64,
    step_s: f64,
    bounds: Bounds,
    disturbances: Disturbances,
    state: Moment,
    error: Moment,
    chance: ChaCha8Rng,
    policy: Policy,
    /// Signs of the present corner: jumps, force, errors of measurement.
    corner: [f64; 5],
    /// Which way a plan of disturbances pushes.
    way: f64,
    age: usize,
    pub findings: Findings,
}

impl Plant {
    pub fn new(
        mass_kg: f64,
        step_s: f64,
        position_m: f64,
        bounds: Bounds,
        disturbances: Disturbances,
        seed: u64,
    ) -> Self {
        Self {
            mass_kg,
            step_s,
            bounds,
            disturbances,
            state: [position_m, 0.0],
            error: [0.0; 2],
            chance: ChaCha8Rng::seed_from_u64(seed),
            policy: Policy::Random,
            corner: [1.0; 5],
            way: 1.0,
            age: 0,
            findings: Findings::default(),
        }
    }

    /// Draws the way in which disturbances are chosen from now on.
    pub fn draw_policy(&mut self) {
        const COUNT: u64 = Policy::ALL.len() as u64;
        #[allow(clippy::cast_possible_truncation, reason = "below the count")]
        let drawn = (self.chance.next_u64() % COUNT) as usize;
        self.set_policy(Policy::ALL.get(drawn).copied().unwrap_or(Policy::Random));
    }

    pub fn set_policy(&mut self, policy: Policy) {
        self.policy = policy;
        self.age = 0;
        self.corner = core::array::from_fn(|_| side(&mut self.chance));
    }

    /// The true state.
    pub fn state(&self) -> Moment {
        self.state
    }

    /// What is measured of it.
    pub fn measured(&self) -> Moment {
        [self.state[0] + self.error[0], self.state[1] + self.error[1]]
    }

    /// One step under a decision made for [`Self::measured`]: judged, then moved.
    pub fn step(&mut self, decision: &Decision<'_>) {
        let (h, measured) = (self.step_s, self.measured());
        let error = [measured[0] - decision.start[0], measured[1] - decision.start[1]];
        let wanted = decision.acceleration_m_s2 - decision.gain[0] * error[0] - decision.gain[1] * error[1];
        let wanted_n = decision.center_kg * wanted;
        let signs = self.signs(decision, &error);
        let Disturbances { jump, force_n, measured: unsure } = self.disturbances;
        let acceleration = (decision.force_n + signs[2] * force_n) / self.mass_kg;
        let [position, velocity] = self.state;
        let between = self.farthest_between(acceleration);
        let ended = [position + h * velocity + 0.5 * h * h * acceleration, velocity + h * acceleration];
        self.state = [ended[0] + signs[0] * jump[0], ended[1] + signs[1] * jump[1]];
        self.error = [signs[3] * unsure[0], signs[4] * unsure[1]];
        self.age += 1;
        let next = self.measured();
        let nominal = [
            decision.start[0] + h * decision.start[1] + 0.5 * h * h * decision.acceleration_m_s2,
            decision.start[1] + h * decision.acceleration_m_s2,
        ];
        let after = [next[0] - nominal[0], next[1] - nominal[1]];
        let (tube_excess, tube_excess_after) = (outside(decision.faces, &error), outside(decision.faces, &after));
        let Bounds { force_n: limit_n, speed_m_s, walls_m } = self.bounds;
        let past_walls = |place: f64| worse(place - walls_m[1], walls_m[0] - place);
        let force_excess_n = worse(wanted_n.abs(), decision.force_n.abs()) - limit_n;
        let speed_excess_m_s = worse(self.state[1].abs(), ended[1].abs()) - speed_m_s;
        let wall_excess_m = past_walls(self.state[0]);
        let wall_excess_between_m = worse(past_walls(between[0]), past_walls(between[1]));
        let is_inside = tube_excess <= TUBE_TOLERANCE && tube_excess_after <= TUBE_TOLERANCE;
        let is_broken = !(force_excess_n <= FORCE_TOLERANCE_N
            && speed_excess_m_s <= 0.0
            && wall_excess_m <= 0.0
            && wall_excess_between_m <= 0.0);
        self.findings.merge(&Findings {
            steps: 1,
            force_excess_n,
            disagreement_n: (decision.force_n - wanted_n).abs(),
            tube_excess,
            tube_excess_after,
            speed_excess_m_s,
            wall_excess_m,
            wall_excess_between_m,
            exits: u64::from(!is_inside),
            violations: u64::from(is_broken),
        });
    }

    /// Least and largest position during a step of constant acceleration, at its end too, before any jump.
    fn farthest_between(&self, acceleration: f64) -> Moment {
        let [position, velocity] = self.state;
        let at = |time: f64| position + time * (velocity + 0.5 * time * acceleration);
        let turn = -velocity / acceleration;
        let turn = if turn > 0.0 && turn < self.step_s { at(turn) } else { position };
        let finer = (1..=10).map(|i| at(self.step_s * f64::from(i) / 10.0));
        finer.chain([turn]).fold([f64::INFINITY, f64::NEG_INFINITY], |[least, largest], place| {
            [-worse(-least, -place), worse(largest, place)]
        })
    }

    /// Shares of the largest disturbances, from -1 to 1: jumps, force, errors of measurement.
    fn signs(&mut self, decision: &Decision<'_>, error: &Moment) -> [f64; 5] {
        let row = |aim| match aim {
            Aim::Input => [-decision.gain[0], -decision.gain[1]],
            Aim::Position => [1.0, 0.0],
            Aim::Velocity => [0.0, 1.0],
        };
        match self.policy {
            Policy::Random => core::array::from_fn(|_| signed_unit(&mut self.chance)),
            Policy::Vertex => core::array::from_fn(|_| side(&mut self.chance)),
            Policy::Constant => self.corner,
            Policy::Toward(aim) => {
                let row = row(aim);
                let way = if row[0] * error[0] + row[1] * error[1] > 0.0 { 1.0 } else { -1.0 };
                self.corner_along(&row, way)
            }
            Policy::Planned(aim) => {
                let place = self.age % CYCLE;
                if place == 0 {
                    self.way = side(&mut self.chance);
                }
                let row = self.carried(decision, row(aim), CYCLE - 1 - place);
                self.corner_along(&row, self.way)
            }
        }
    }

    /// The corner that is farthest along a row, or against it.
    fn corner_along(&self, row: &Moment, way: f64) -> [f64; 5] {
        let sign = |value: f64| if value < 0.0 { -way } else { way };
        let force = sign(0.5 * self.step_s * row[0] + row[1]);
        // an error of measurement that changes its side says the most
        let turned = if self.age.is_multiple_of(2) { 1.0 } else { -1.0 };
        [sign(row[0]), sign(row[1]), force, turned * sign(row[0]), turned * sign(row[1])]
    }

    /// A row, so many steps of the feedback on the true mass before it counts.
    fn carried(&self, decision: &Decision<'_>, mut row: Moment, steps: usize) -> Moment {
        let h = self.step_s;
        let share = decision.center_kg / self.mass_kg;
        for _ in 0..steps {
            let pushed = share * (0.5 * h * h * row[0] + h * row[1]);
            row = [row[0] - decision.gain[0] * pushed, h * row[0] + row[1] - decision.gain[1] * pushed];
        }
        row
    }
}

/// Largest excess of an error over the faces.
fn outside(faces: &[(Moment, f64)], error: &Moment) -> f64 {
    let excess = faces.iter().map(|(normal, distance)| (normal[0] * error[0] + normal[1] * error[1]).abs() - distance);
    excess.fold(f64::NEG_INFINITY, worse)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACES: [(Moment, f64); 2] = [([1.0, 0.0], 0.02), ([0.0, 1.0], 0.01)];

    fn decision(force_n: f64) -> Decision<'static> {
        let [start, gain] = [[0.0; 2], [0.25, 2.0]];
        Decision { force_n, center_kg: 10.0, gain, start, acceleration_m_s2: force_n / 10.0, faces: &FACES }
    }

    fn plant(position_m: f64) -> Plant {
        let bounds = Bounds { force_n: 0.15, speed_m_s: 0.05, walls_m: [-0.5, 0.5] };
        Plant::new(10.0, 0.2, position_m, bounds, Disturbances::default(), 1)
    }

    #[test]
    fn a_push_moves_as_newton_says_and_is_inside() {
        let mut plant = plant(0.0);
        plant.step(&decision(0.1));
        let [position, velocity] = plant.state();
        assert!((position - 0.5 * 0.2 * 0.2 * 0.01).abs() < 1e-18 && (velocity - 0.2 * 0.01).abs() < 1e-18);
        let found = plant.findings;
        assert_eq!((found.steps, found.exits, found.violations), (1, 0, 0));
        assert!((found.force_excess_n + 0.05).abs() < 1e-15 && (found.speed_excess_m_s + 0.048).abs() < 1e-15);
        assert!((found.wall_excess_m + 0.4998).abs() < 1e-15 && found.disagreement_n < 1e-15);
        assert!((found.tube_excess + 0.01).abs() < 1e-15, "the error is zero, the velocity's face the nearest");
        assert!((found.tube_excess_after + 0.01).abs() < 1e-15, "and stays zero");
    }

    #[test]
    fn every_promise_broken_is_seen() {
        let mut strong = plant(0.0);
        strong.step(&decision(0.151));
        assert!((strong.findings.force_excess_n - 0.001).abs() < 1e-15 && strong.findings.violations == 1);

        let mut other = plant(0.0);
        other.step(&Decision { force_n: 0.1, ..decision(0.05) });
        assert!((other.findings.disagreement_n - 0.05).abs() < 1e-15);

        let mut outside = plant(0.03);
        outside.step(&decision(0.0));
        assert!(outside.findings.exits == 1 && (outside.findings.tube_excess - 0.01).abs() < 1e-12);

        let mut past = plant(0.6);
        past.step(&decision(0.0));
        assert!(past.findings.violations == 1 && (past.findings.wall_excess_m - 0.1).abs() < 1e-12);

        let mut fast = plant(0.0);
        fast.state[1] = -0.06;
        fast.step(&decision(0.0));
        assert!(fast.findings.violations == 1 && (fast.findings.speed_excess_m_s - 0.01).abs() < 1e-12);

        let mut lost = plant(0.0);
        lost.step(&decision(f64::NAN));
        assert!(lost.findings.violations == 1 && lost.findings.exits == 1 && lost.findings.force_excess_n.is_nan());
    }

    #[test]
    fn a_turn_past_the_wall_between_two_decisions_is_seen() {
        let mut plant = plant(0.4999);
        plant.state[1] = 0.003;
        // turns after 0.1 s, 0.15 mm further on, and is back at the end
        plant.step(&decision(-0.3));
        assert!(plant.findings.wall_excess_m < 0.0);
        assert!((plant.findings.wall_excess_between_m - 0.5e-4).abs() < 1e-12);
    }

    #[test]
    fn disturbances_stay_inside_and_reach_their_corners() {
        let disturbances = Disturbances { jump: [1e-4, 2e-4], force_n: 0.01, measured: [1e-3, 2e-3] };
        let bounds = Bounds { force_n: 0.15, speed_m_s: 0.05, walls_m: [-0.5, 0.5] };
        for policy in Policy::ALL {
            let mut plant = Plant::new(10.0, 0.2, 0.0, bounds, disturbances, 2);
            plant.set_policy(policy);
            let mut reached = 0.0_f64;
            for _ in 0..300 {
                let before = plant.state();
                plant.state = [before[0].clamp(-0.01, 0.01), before[1].clamp(-0.01, 0.01)];
                let before = plant.state();
                plant.step(&decision(0.0));
                let [position, velocity] = plant.state();
                // force and jump together
                let gained = (velocity - before[1]).abs();
                assert!(gained <= 2e-4 + 0.2 * 0.001 + 1e-15, "{policy:?}");
                assert!((position - before[0] - 0.2 * before[1]).abs() <= 1e-4 + 0.02 * 0.001 + 1e-15, "{policy:?}");
                let measured = plant.measured();
                assert!((measured[0] - position).abs() <= 1e-3 + 1e-15, "{policy:?}");
                assert!((measured[1] - velocity).abs() <= 2e-3 + 1e-15, "{policy:?}");
                reached = reached.max(gained);
            }
            assert!(reached > 3.6e-4 || policy == Policy::Constant, "{policy:?} {reached}");
        }
    }

    /// Planned corners make the error as large as the sum of what each step can add, which no other corner does.
    #[test]
    fn planned_disturbances_reach_the_support() {
        let disturbances = Disturbances { jump: [1e-4, 2e-4], ..Disturbances::default() };
        let bounds = Bounds { force_n: 0.15, speed_m_s: 0.05, walls_m: [-0.5, 0.5] };
        let reach = |policy| {
            let mut plant = Plant::new(10.0, 0.2, 0.0, bounds, disturbances, 3);
            plant.set_policy(policy);
            let mut most = 0.0_f64;
            for _ in 0..CYCLE {
                let [position, velocity] = plant.state();
                let force_n = 10.0 * (-0.25 * position - 2.0 * velocity);
                plant.step(&Decision { force_n, ..decision(0.0) });
                most = most.max(plant.state()[0].abs());
            }
            most
        };
        // sum over the powers of the closed loop
        let (mut row, mut support) = ([1.0_f64, 0.0_f64], 0.0);
        for _ in 0..CYCLE {
            support += row[0].abs() * 1e-4 + row[1].abs() * 2e-4;
            let pushed = 0.02 * row[0] + 0.2 * row[1];
            row = [row[0] - 0.25 * pushed, 0.2 * row[0] + row[1] - 2.0 * pushed];
        }
        let planned = reach(Policy::Planned(Aim::Position));
        assert!((planned - support).abs() < 1e-12 * support.max(1.0), "{planned} {support}");
        assert!(reach(Policy::Random) < 0.8 * support);
    }
}
