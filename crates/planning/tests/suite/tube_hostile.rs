//! The tube controller under users who mean it no good: wide ranges of settings, beliefs and numbers that should not be.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::branches_sharing_code,
    clippy::if_same_then_else,
    clippy::same_functions_in_if_condition
)]

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_identification::noise::between;
use tumble_planning::ModelBelief;
use tumble_planning::Plan;
use tumble_planning::control::{
    AttitudeController, AttitudeGains, AttitudeLaw, AttitudeSpan, AxisGain, ControlCommand, ControlRequest, Controller,
    Fallback, FallbackReason, MassInterval, ReferenceMotion, Terminal, TrackedPoint, TubeController, TubeDisturbance,
    TubeSettings, TubeWeights,
};
use tumble_planning::dynamics::{BodyAcceleration, InertialParameters, PoseReference, RigidBodyState};
use tumble_planning::lie::{Pose, Twist};
use tumble_planning::nalgebra::{Matrix3, UnitQuaternion, Vector3};

struct Draw(ChaCha8Rng);

impl Draw {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn between(&mut self, least: f64, largest: f64) -> f64 {
        between(&mut self.0, least, largest)
    }

    fn log(&mut self, least: f64, largest: f64) -> f64 {
        f64::exp(self.between(least.ln(), largest.ln()))
    }

    fn chance(&mut self, share: f64) -> bool {
        self.between(0.0, 1.0) < share
    }

    fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    fn signs(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.sign())
    }

    fn unit(&mut self) -> Vector3<f64> {
        let v = Vector3::from_fn(|_, _| self.between(-1.0, 1.0));
        v / v.norm()
    }

    fn turn(&mut self, angle: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::new(self.unit() * angle)
    }
}

fn body(mass: f64, com: Vector3<f64>) -> InertialParameters<f64> {
    InertialParameters::about_com(mass, com, Matrix3::identity() * 0.15 * mass / 10.0)
}

fn belief(revision: u64, body: InertialParameters<f64>, sigma_kg: f64) -> ModelBelief {
    let mut belief = ModelBelief::certain(revision, body);
    belief.estimate.covariance[(0, 0)] = sigma_kg * sigma_kg;
    belief
}

fn attitude(body: InertialParameters<f64>) -> AttitudeController {
    AttitudeController {
        law: AttitudeLaw::Geometric,
        gains: AttitudeGains { stiffness_n_m: 0.3, damping_n_m_s: 0.3 },
        body,
        torque_limit_n_m: 0.05,
    }
}

fn reference(position: Vector3<f64>, velocity: Vector3<f64>) -> PoseReference {
    PoseReference {
        state: RigidBodyState {
            world_from_body: Pose::from_parts(position.into(), UnitQuaternion::identity()),
            twist_body: Twist::new(Vector3::zeros(), velocity),
        },
        acceleration: BodyAcceleration {
            angular_acceleration_body: Vector3::zeros(),
            acceleration_origin_body: Vector3::zeros(),
        },
    }
}

/// A random tube and a random world inside of what it assumes.
struct Mission {
    settings: TubeSettings,
    mass: f64,
    com: Vector3<f64>,
    rate: Vector3<f64>,
    measured_by: f64,
    within_span: f64,
}

fn mission(draw: &mut Draw) -> Mission {
    let poles = [draw.log(0.1, 2.0), draw.log(0.1, 2.0)];
    let step_s = draw.log(0.05, 1.0);
    let gain = AxisGain { stiffness: poles[0] * poles[1], damping: poles[0] + poles[1], step_s };
    let least = draw.log(1.0, 20.0);
    let largest = least * draw.between(1.0, 3.0);
    let force = draw.log(0.05, 3.0);
    let weak = force / largest;
    let measured_by = draw.between(0.0, 0.02);
    let spins = draw.chance(0.4);
    let rate = if spins { draw.unit() * draw.between(0.0, 0.2) } else { Vector3::zeros() };
    let com = if spins { draw.unit() * draw.between(0.0, 0.04) } else { Vector3::zeros() };
    let within_span = draw.between(0.0, 0.2);
    let world_from_axes = draw.turn(2.0);
    let axes_from_body = draw.turn(3.0);
    let attitudes = if spins {
        AttitudeSpan::Any
    } else {
        AttitudeSpan::Near { axes_from_body, angle_rad: within_span + measured_by }
    };
    let wall = |draw: &mut Draw| if draw.chance(0.3) { f64::INFINITY } else { draw.log(0.1, 3.0) };
    let walls_m = core::array::from_fn(|_| [-wall(draw), wall(draw)]);
    let quiet = draw.log(1e-3, 1.0);
    let disturbance = TubeDisturbance {
        position_m: draw.between(0.0, 0.01) * quiet,
        velocity_m_s: draw.between(0.0, 0.1) * weak * quiet,
        force_n: draw.between(0.0, 0.1) * force * quiet,
        acceleration_m_s2: draw.between(0.0, 0.05) * weak * quiet + com.norm() * rate.norm_squared(),
    };
    let settings = TubeSettings {
        gain,
        steps: 2 + (draw.between(0.0, 1.0).powi(2) * 38.0) as usize,
        weights: TubeWeights { scale: draw.log(1e-3, 10.0), ..TubeWeights::DEFAULT },
        terminal: if draw.chance(0.5) { Terminal::Rest } else { Terminal::StopSet },
        speed_m_s: draw.log(0.03, 1.0),
        walls_m,
        force_limit_n: Vector3::from_fn(|_, _| force * draw.between(0.7, 1.5)),
        attitudes,
        turned_by_rad: measured_by + rate.norm() * step_s,
        disturbance,
        corrections: None,
        mass: MassInterval::between(least, largest).unwrap(),
        sigmas: 3.0,
        world_from_axes,
        point: TrackedPoint::Origin,
    };
    let mass = if draw.chance(0.5) {
        least
    } else if draw.chance(0.5) {
        largest
    } else {
        draw.between(least, largest)
    };
    Mission { settings, mass, com, rate, measured_by, within_span }
}

#[derive(Debug, Default)]
struct Seen {
    flown: bool,
    fallbacks: Vec<(usize, Fallback)>,
    /// Share of a limit.
    worst: f64,
    leans: bool,
}

const SUB: usize = 8;

fn fly(seed: u64) -> Option<Seen> {
    let mut draw = Draw::new(seed);
    let Mission { settings, mass, com, rate, measured_by, within_span } = mission(&mut draw);
    let mut controller = TubeController::try_new(settings, None, attitude(body(10.0, com)), &body(10.0, com)).ok()?;
    let own = settings.disturbance.acceleration_m_s2 - com.norm() * rate.norm_squared();
    let axes = settings.world_from_axes;
    let still = match settings.attitudes {
        AttitudeSpan::Near { axes_from_body, .. } => axes * draw.turn(draw_angle(seed) * within_span) * axes_from_body,
        _ => draw.turn(3.0),
    };
    let spin = |t: f64| UnitQuaternion::new(rate * t) * still;
    // the centre of mass, world axes
    let mut p = spin(0.0) * com;
    let mut v = rate.cross(&p);
    let step_s = settings.gain.step_s;
    let dt = step_s / SUB as f64;
    let mut seen = Seen::default();
    let (mut goal, mut gust, mut push) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
    let steady = draw.chance(0.5);
    for decision in 0..150_usize {
        let t0 = decision as f64 * step_s;
        if decision % 50 == 0 {
            goal = axes * draw.signs().map(|s| s * 4.0);
        }
        let r = spin(t0);
        let arm = r * com;
        let error = |draw: &mut Draw, by: f64| axes * (draw.signs() * by);
        let x = p - arm + error(&mut draw, settings.disturbance.position_m);
        let w = v - rate.cross(&arm) + error(&mut draw, settings.disturbance.velocity_m_s);
        let r_seen = draw.turn(measured_by) * r;
        let state = RigidBodyState {
            world_from_body: Pose::from_parts(x.into(), r_seen),
            twist_body: Twist::new(r_seen.inverse() * rate, r_seen.inverse() * w),
        };
        let at = |_: f64| reference(goal, Vector3::zeros());
        let plan: Plan<&dyn ReferenceMotion> = Plan { trajectory: &at, model_revision: 0 };
        let command = controller.command(&ControlRequest { time_s: t0, state: &state, plan: &plan }).unwrap();
        if let Some(fallback) = command.fallback {
            if decision == 0 {
                return Some(seen);
            }
            seen.fallbacks.push((decision, fallback));
            return Some(seen);
        }
        seen.flown = true;
        let force = command.wrench_body.force;
        seen.worst = seen.worst.max(force.abs().component_div(&settings.force_limit_n).max());
        if decision % 20 == 0 || !steady {
            gust = axes * (draw.signs() * settings.disturbance.force_n);
            push = axes * (draw.signs() * own);
        }
        for sub in 0..SUB {
            if !steady && draw.chance(0.3) {
                gust = axes * (draw.signs() * settings.disturbance.force_n);
            }
            let held = spin(t0 + (sub as f64 + 0.5) * dt);
            let a = (held * force + gust) / mass + push;
            p += v * dt + a * (0.5 * dt * dt);
            v += a * dt;
            let arm = spin(t0 + (sub + 1) as f64 * dt) * com;
            let x = axes.inverse() * (p - arm);
            let w = axes.inverse() * (v - rate.cross(&arm));
            for i in 0..3 {
                seen.worst = seen.worst.max(w[i].abs() / settings.speed_m_s);
                let [lower, upper] = settings.walls_m[i];
                seen.worst = seen.worst.max(x[i] / upper).max(x[i] / lower);
            }
        }
    }
    seen.leans = seen.worst > 0.8;
    Some(seen)
}

fn draw_angle(seed: u64) -> f64 {
    Draw::new(seed ^ 0x55).between(0.0, 1.0)
}

#[test]
fn no_limit_is_broken_whatever_the_settings() {
    let count = 150;
    let (mut flown, mut leans, mut built) = (0, 0, 0);
    for seed in 0..count {
        let Some(seen) = fly(seed) else { continue };
        built += 1;
        flown += usize::from(seen.flown);
        leans += usize::from(seen.leans);
        assert!(seen.worst <= 1.0 + 1e-9 && seen.fallbacks.is_empty(), "seed {seed}: {seen:?}");
    }
    assert!(built > 60 && flown > 60 && leans > 30, "{built} {flown} {leans}");
}

fn plain() -> TubeSettings {
    TubeSettings {
        gain: AxisGain { stiffness: 0.25, damping: 2.0, step_s: 0.2 },
        steps: 15,
        weights: TubeWeights::DEFAULT,
        terminal: Terminal::StopSet,
        speed_m_s: 0.2,
        walls_m: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
        force_limit_n: Vector3::repeat(0.4),
        attitudes: AttitudeSpan::Any,
        turned_by_rad: 0.0,
        disturbance: TubeDisturbance { position_m: 0.0, velocity_m_s: 0.0, force_n: 0.002, acceleration_m_s2: 0.0 },
        corrections: None,
        mass: MassInterval::between(5.0, 20.0).unwrap(),
        sigmas: 3.0,
        world_from_axes: UnitQuaternion::identity(),
        point: TrackedPoint::Origin,
    }
}

fn here(x: f64) -> RigidBodyState<f64> {
    RigidBodyState { world_from_body: Pose::translation(x, 0.0, 0.0), ..RigidBodyState::at_rest() }
}

fn ask(controller: &mut TubeController, time_s: f64, state: &RigidBodyState<f64>, goal: f64) -> ControlCommand {
    let at = move |_: f64| reference(Vector3::new(goal, 0.0, 0.0), Vector3::zeros());
    let plan: Plan<&dyn ReferenceMotion> = Plan { trajectory: &at, model_revision: 0 };
    controller.command(&ControlRequest { time_s, state, plan: &plan }).unwrap()
}

/// After a jump the widest tube waits; it must be judged by the motion now, not by one of long ago.
#[test]
fn the_tube_that_waits_after_a_jump_sees_the_motion_of_now() {
    let settings = TubeSettings { walls_m: [[-1.0, 3.0]; 3], ..plain() };
    let mut controller =
        TubeController::try_new(settings, None, attitude(body(10.0, Vector3::zeros())), &body(10.0, Vector3::zeros()))
            .unwrap();
    controller.adopt(&belief(1, body(10.0, Vector3::zeros()), 0.1)).unwrap();
    for k in 0..10 {
        let command = ask(&mut controller, 0.2 * f64::from(k), &here(2.0), 2.0);
        assert_eq!(command.fallback, None);
    }
    // beyond the wall, then back
    for k in 10..20 {
        let is_beyond = k < 15;
        let command = ask(&mut controller, 0.2 * f64::from(k), &here(if is_beyond { 3.5 } else { 2.0 }), 2.0);
        let braking = Some(Fallback::Braking(FallbackReason::Infeasible));
        assert_eq!(command.fallback, if is_beyond { braking } else { None }, "{k}");
    }
    assert!((controller.tube().plan(0).start.x - 2.0).abs() < 1e-6);
    assert_eq!(controller.tube().mass(), settings.mass);
}

/// A belief of another centre of mass waits when the body begins to brake: the tube and the motion shown to it stay of one point.
#[test]
fn a_belief_that_waits_while_braking_begins_confuses_no_points() {
    let com = Vector3::new(0.3, 0.0, 0.0);
    let settings = TubeSettings { walls_m: [[-1.0, 3.0]; 3], point: TrackedPoint::BelievedCenterOfMass, ..plain() };
    let origin = body(10.0, Vector3::zeros());
    let mut controller = TubeController::try_new(settings, None, attitude(origin), &origin).unwrap();
    controller.adopt(&belief(1, origin, 1.0)).unwrap();
    for k in 0..5 {
        ask(&mut controller, 0.2 * f64::from(k), &here(2.0), 2.0);
    }
    controller.adopt(&belief(2, body(10.0, com), 0.1)).unwrap();
    for k in 5..30 {
        let is_beyond = k < 10;
        let command = ask(&mut controller, 0.2 * f64::from(k), &here(if is_beyond { 3.5 } else { 2.0 }), 2.0);
        assert_eq!(command.fallback.is_some(), is_beyond, "{k}: {:?}", command.fallback);
    }
}

/// A second belief of the revision in use.
#[test]
fn equal_revisions_do_not_tear_tube_and_attitude_apart() {
    let settings = TubeSettings { walls_m: [[-1.0, 3.0]; 3], point: TrackedPoint::BelievedCenterOfMass, ..plain() };
    let origin = body(10.0, Vector3::zeros());
    let mut controller = TubeController::try_new(settings, None, attitude(origin), &origin).unwrap();
    controller.adopt(&belief(1, origin, 1.0)).unwrap();
    for k in 0..5 {
        ask(&mut controller, 0.2 * f64::from(k), &here(2.5), 2.5);
    }
    // its point is beyond the wall: it can not be taken over
    controller.adopt(&belief(1, body(10.0, Vector3::new(0.8, 0.0, 0.0)), 0.1)).unwrap();
    for k in 5..10 {
        let command = ask(&mut controller, 0.2 * f64::from(k), &here(2.5), 2.5);
        assert_eq!(command.fallback, None, "{k}");
    }
    assert_eq!(controller.counts().postponed, 5);
}

#[test]
fn settings_that_should_not_be_are_refused() {
    let origin = body(10.0, Vector3::zeros());
    let p = plain();
    let refused = |settings: TubeSettings| TubeController::try_new(settings, None, attitude(origin), &origin).is_err();
    assert!(!refused(p));
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let gains = [
            AxisGain { step_s: bad, ..p.gain },
            AxisGain { stiffness: bad, ..p.gain },
            AxisGain { damping: bad, ..p.gain },
        ];
        assert!(gains.into_iter().all(|gain| refused(TubeSettings { gain, ..p })), "{bad}");
        assert!(refused(TubeSettings { speed_m_s: bad, ..p }), "{bad}");
    }
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(refused(TubeSettings { turned_by_rad: bad, ..p }), "{bad}");
        for field in 0..4 {
            let (mut d, mut w) = (p.disturbance, p.weights);
            *[&mut d.position_m, &mut d.velocity_m_s, &mut d.force_n, &mut d.acceleration_m_s2][field] = bad;
            assert!(refused(TubeSettings { disturbance: d, ..p }), "{field} {bad}");
            *[&mut w.position, &mut w.velocity, &mut w.acceleration, &mut w.scale][field] = bad;
            assert!(refused(TubeSettings { weights: w, ..p }), "{field} {bad}");
        }
    }
    assert!(refused(TubeSettings { steps: 0, ..p }));
    for bad in [-0.05, f64::NAN, f64::INFINITY] {
        let attitudes = AttitudeSpan::Near { axes_from_body: UnitQuaternion::identity(), angle_rad: bad };
        assert!(refused(TubeSettings { attitudes, ..p }), "{bad}");
        assert!(refused(TubeSettings { sigmas: bad, ..p }), "{bad}");
        assert!(refused(TubeSettings { force_limit_n: Vector3::new(bad, 0.4, 0.4), ..p }), "{bad}");
        let world_from_axes = UnitQuaternion::new_unchecked(UnitQuaternion::identity().into_inner() * bad);
        assert!(refused(TubeSettings { world_from_axes, ..p }), "{bad}");
    }
}

/// Positions, times and masses in other units, with limits and prices in them too.
#[test]
fn other_units_give_the_same_motion() {
    let mut answers = Vec::new();
    for (l, t, m) in
        [(0, 0, 0), (3, 0, 0), (-3, 0, 0), (-6, 0, 0), (0, 3, 0), (0, -3, 0), (0, 0, 6), (0, 0, -6), (5, 4, 3)]
    {
        let (l, t, m) = (10_f64.powi(l), 10_f64.powi(t), 10_f64.powi(m));
        let (v, a) = (l / t, l / (t * t));
        let w = TubeWeights::DEFAULT;
        let p = plain();
        let settings = TubeSettings {
            gain: AxisGain { stiffness: 0.25 / (t * t), damping: 2.0 / t, step_s: 0.2 * t },
            weights: TubeWeights {
                position: w.position / (l * l),
                velocity: w.velocity / (v * v),
                acceleration: w.acceleration / (a * a),
                scale: w.scale,
            },
            speed_m_s: 0.1 * v,
            walls_m: [[-0.5 * l, 0.8 * l]; 3],
            force_limit_n: p.force_limit_n * m * a,
            disturbance: TubeDisturbance {
                position_m: 1e-4 * l,
                velocity_m_s: 1e-4 * v,
                force_n: 0.002 * m * a,
                acceleration_m_s2: 0.0,
            },
            mass: MassInterval::between(5.0 * m, 20.0 * m).unwrap(),
            ..p
        };
        let origin = body(10.0 * m, Vector3::zeros());
        let mut controller = TubeController::try_new(settings, None, attitude(origin), &origin).unwrap();
        let (mut x, mut s) = (0.0_f64, 0.0_f64);
        let mut bytes = Vec::new();
        for k in 0..120 {
            let mut state = here(x * l);
            state.twist_body.linear.x = s * v;
            let command =
                ask(&mut controller, settings.gain.step_s * f64::from(k), &state, if k < 60 { 2.0 } else { -2.0 } * l);
            let force = command.wrench_body.force.x / (m * a);
            bytes.push(force);
            x += 0.2 * s + 0.02 * force / 10.0;
            s += 0.2 * force / 10.0;
        }
        answers.push((l, t, m, bytes, controller.counts()));
    }
    let base = answers[0].3.clone();
    for (l, t, m, bytes, counts) in answers {
        let off = bytes.iter().zip(&base).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-10, "{l:e} {t:e} {m:e}: {off:e}");
        assert_eq!(counts.decisions, 120);
        assert_eq!((counts.shifted, counts.restarted, counts.braking), (0, 0, 0));
    }
}
