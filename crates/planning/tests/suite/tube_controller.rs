//! The tube controller as a controller: its laws, new beliefs in flight, and what it does where its assumptions are broken.

use crate::control_cases;
use crate::control_cases::{body, cases, limits, small};
use tumble_planning::control::{
    Adoption, AttitudeController, AttitudeGains, AttitudeLaw, AttitudeSpan, AxisGain, Controller, EndAttitude,
    Fallback, FallbackReason, MassInterval, ReferenceMotion, Terminal, TrackedPoint, TubeController, TubeDisturbance,
    TubeObstacles, TubeSettings, TubeWeights,
};
use tumble_planning::dynamics::{InertialParameters, PoseReference, RigidBodyState, WrenchModel};
use tumble_planning::laws::{
    ControllerCase, ControllerPromise, ControllerStep, LawViolation, check_controller, fly_controller,
};
use tumble_planning::lie::{Pose, Twist, Wrench};
use tumble_planning::nalgebra::{UnitQuaternion, Vector3};
use tumble_planning::{ModelBelief, Plan};

const STEP_S: f64 = 0.2;
const OUTPUT_S: f64 = 0.05;

fn settings(mass: [f64; 2]) -> TubeSettings {
    TubeSettings {
        gain: AxisGain { stiffness: 0.25, damping: 2.0, step_s: STEP_S },
        steps: 25,
        weights: TubeWeights::DEFAULT,
        terminal: Terminal::StopSet,
        speed_m_s: 0.2,
        walls_m: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
        force_limit_n: limits().force_limit,
        attitudes: AttitudeSpan::Any,
        turned_by_rad: 0.01,
        disturbance: TubeDisturbance { position_m: 0.0, velocity_m_s: 0.0, force_n: 0.002, acceleration_m_s2: 0.0 },
        corrections: None,
        mass: MassInterval::between(mass[0], mass[1]).unwrap(),
        sigmas: 3.0,
        world_from_axes: UnitQuaternion::identity(),
        point: TrackedPoint::BelievedCenterOfMass,
    }
}

fn attitude() -> AttitudeController {
    AttitudeController {
        law: AttitudeLaw::Geometric,
        gains: AttitudeGains { stiffness_n_m: 0.3, damping_n_m_s: 0.3 },
        body: body(),
        torque_limit_n_m: 0.05,
    }
}

#[allow(clippy::large_types_passed_by_value, reason = "one per flight")]
fn controller(settings: TubeSettings) -> TubeController {
    TubeController::try_new(settings, None, attitude(), &body()).unwrap()
}

#[test]
fn keeps_the_laws_of_controllers() {
    let mass = body().mass;
    let promise = ControllerPromise {
        limits: limits(),
        tube: None,
        small: small(),
        settling_s: 30.0,
        overshoot: 1.05,
        other_worlds: &[Pose::translation(3.0, -2.0, 1.0)],
        tolerance: 1e-9,
    };
    cases(100.0, &mut |cases| {
        check_controller(&|| controller(settings([0.4 * mass, 3.0 * mass])), cases, &promise)
            .unwrap_or_else(|violation| panic!("{violation}"));
    });
}

fn hold(pose: Pose<f64>) -> impl Fn(f64) -> PoseReference {
    control_cases::held(pose)
}

/// A flight of a controller that holds a place, outputs of 50 ms, watched.
fn flight<'a>(
    trajectory: &'a dyn ReferenceMotion,
    beliefs: &'a [(f64, ModelBelief)],
    outputs: usize,
) -> ControllerCase<'a> {
    ControllerCase { beliefs, outputs, step_s: OUTPUT_S, ..control_cases::case("flight", trajectory) }
}

fn belief(revision: u64, mass_kg: f64, sigma_kg: f64) -> ModelBelief {
    control_cases::belief(revision, control_cases::heavier(mass_kg / body().mass), sigma_kg)
}

/// Nested intervals are taken over one after the other while the body moves; each tube lies inside the one before.
#[test]
fn beliefs_that_narrow_are_taken_over_in_flight() {
    let mass = body().mass;
    let to = hold(Pose::translation(1.0, -0.5, 0.3));
    let beliefs: Vec<(f64, ModelBelief)> =
        (1..8).map(|i| (2.0 * i as f64, belief(i, mass * (1.0 + 0.1 / i as f64), 1.5 / i as f64))).collect();
    let mut case = flight(&to, &beliefs, 1200);
    case.start = control_cases::at(Pose::identity());
    let mut controller = controller(settings([0.5 * mass, 2.0 * mass]));
    let mut widths = vec![controller.tube().mass()];
    fly_controller(&mut controller, &case, &mut |controller: &TubeController, step: &ControllerStep<'_>| {
        for (revision, adoption) in step.offers {
            assert_eq!(*adoption, Adoption::Postponed { kept: revision - 1 });
        }
        let now = controller.tube().mass();
        if Some(&now) != widths.last() {
            widths.push(now);
        }
        assert!(step.command.fallback.is_none(), "{:?}", step.command.fallback);
        Ok::<(), LawViolation>(())
    })
    .unwrap();
    assert_eq!(widths.len(), 8);
    assert!(widths.windows(2).all(|pair| pair[0].contains(&pair[1])));
    let counts = controller.counts();
    assert_eq!((counts.adopted, counts.postponed, counts.contradictions), (7, 0, 0));
    let last = controller.tube().plan(0).start;
    assert!((last.x - 1.0).abs() < 0.03, "{last}");
}

/// What cannot be true together with what was certain is the estimator's fault; nothing changes.
#[test]
fn a_belief_outside_of_what_is_certain_is_told() {
    let mass = body().mass;
    let here = hold(Pose::identity());
    let beliefs = [(0.0, belief(3, mass, 0.1)), (2.0, belief(4, 1.5 * mass, 0.1)), (4.0, belief(5, mass, 0.05))];
    let mut controller = controller(settings([0.5 * mass, 2.0 * mass]));
    let mut told = Vec::new();
    fly_controller(&mut controller, &flight(&here, &beliefs, 200), &mut |_, step| {
        told.extend_from_slice(step.offers);
        let newest = if step.output < 80 { 3 } else { step.command.model_revision };
        assert_eq!(step.command.model_revision, newest);
        Ok::<(), LawViolation>(())
    })
    .unwrap();
    let kept = 3;
    assert_eq!(told, [(3, Adoption::Adopted), (4, Adoption::Contradicts { kept }), (5, Adoption::Postponed { kept })]);
    assert_eq!(controller.tube().model_revision(), 5);
    assert_eq!(controller.counts().contradictions, 1);
}

/// The localisation jumps: the tube says so, begins anew, and where there is no plan the body brakes, stops and comes back.
#[test]
fn a_jump_is_told_and_survived() {
    let mass = body().mass;
    let here = hold(Pose::identity());
    let walled = TubeSettings { walls_m: [[-1.0, 1.0]; 3], ..settings([0.8 * mass, 1.25 * mass]) };
    for (jump_m, far) in [(0.4, false), (1.5, true)] {
        let sensor = |output: usize, state: &RigidBodyState<f64>| {
            let mut seen = *state;
            seen.world_from_body.translation.vector.x += if (100..140).contains(&output) { jump_m } else { 0.0 };
            seen
        };
        let mut case = flight(&here, &[], 1600);
        case.sensor = Some(&sensor);
        let mut controller = controller(walled);
        let (mut restarted, mut braking, mut end_m) = (0, 0, 1.0);
        fly_controller(&mut controller, &case, &mut |_, step| {
            match step.command.fallback {
                None => {}
                Some(Fallback::Restarted(FallbackReason::OutsideTube { excess })) => {
                    assert!(excess > 0.0);
                    restarted += 1;
                }
                Some(Fallback::Braking(reason)) => {
                    assert_eq!(reason, FallbackReason::Infeasible);
                    braking += 1;
                }
                other => panic!("{other:?}"),
            }
            end_m = step.error.position_m;
            Ok::<(), LawViolation>(())
        })
        .unwrap();
        assert_eq!(far, braking > 0, "{jump_m}: {braking}");
        assert_eq!(!far, restarted > 0, "{jump_m}: {restarted}");
        assert!(end_m < 0.01, "{jump_m}: {end_m}");
        assert_eq!(controller.counts().braking, braking);
    }
}

/// Calls that come late shift no later decision; a state or reference that is no number is refused, and the next call is answered.
#[test]
fn numbers_that_are_none_are_refused_and_flown_past() {
    use tumble_planning::control::{ControlRequest, Controller};
    let here = hold(Pose::identity());
    let plan: Plan<&dyn ReferenceMotion> = Plan { trajectory: &here, model_revision: 0 };
    let mut controller = controller(settings([5.0, 20.0]));
    let state = control_cases::at(Pose::identity());
    let mut broken = state;
    broken.twist_body = Twist::new(Vector3::new(f64::NAN, 0.0, 0.0), Vector3::zeros());
    assert!(controller.command(&ControlRequest { time_s: 0.0, state: &broken, plan: &plan }).is_err());
    assert!(controller.command(&ControlRequest { time_s: f64::NAN, state: &state, plan: &plan }).is_err());
    for time_s in [0.0, 0.19, 0.21, 0.39, 0.41, 5.0, 5.1] {
        let command = controller.command(&ControlRequest { time_s, state: &state, plan: &plan }).unwrap();
        assert!(command.wrench_body.to_vector().amax() < 1e-12);
    }
    assert_eq!(controller.counts().decisions, 4);
    // the clock is set back: decided anew
    for time_s in [-100.0, -99.9, 5.0] {
        controller.command(&ControlRequest { time_s, state: &state, plan: &plan }).unwrap();
    }
    assert_eq!(controller.counts().decisions, 6);
    // a reference that is a number now and none later leaves the last plan, shifted
    let later = |time_s: f64| {
        let mut reference = here(time_s);
        if time_s > 5.5 {
            reference.state.world_from_body.translation.vector.x = f64::NAN;
        }
        reference
    };
    let plan: Plan<&dyn ReferenceMotion> = Plan { trajectory: &later, model_revision: 0 };
    let command = controller.command(&ControlRequest { time_s: 5.2, state: &state, plan: &plan }).unwrap();
    assert_eq!(command.fallback, Some(Fallback::Shifted(FallbackReason::NoReference)));
    assert!(command.wrench_body.to_vector().amax() < 1e-12);
}

/// A push along every axis.
struct Gust(f64);

impl WrenchModel<f64> for Gust {
    fn wrench_body(&self, time_s: f64, state: &RigidBodyState<f64>) -> Wrench<f64> {
        let sign = if (time_s * 0.37).sin() > 0.0 { 1.0 } else { -1.0 };
        Wrench::new(Vector3::zeros(), state.world_from_body.rotation.inverse() * Vector3::repeat(self.0 * sign))
    }
}

/// Whatever the mass in the interval and the push within the bound, the true motion stays in the tube at every decision.
#[test]
fn the_true_motion_stays_in_the_tube() {
    let mass = body().mass;
    let to = control_cases::quintic(Vector3::zeros(), Vector3::new(0.8, -0.4, 0.3), 0.0, 25.0);
    let gust = Gust(0.002);
    for factor in [0.5, 1.0, 1.5] {
        let mut case = flight(&to, &[], 700);
        let flown = InertialParameters {
            first_moment: Vector3::zeros(),
            ..InertialParameters::about_com(factor * mass, Vector3::zeros(), body().inertia_about_origin)
        };
        (case.body, case.disturbance) = (flown, &gust);
        let span = AttitudeSpan::Near { axes_from_body: UnitQuaternion::identity(), angle_rad: 0.02 };
        let settings =
            TubeSettings { attitudes: span, point: TrackedPoint::Origin, ..settings([0.5 * mass, 1.5 * mass]) };
        let mut controller = TubeController::try_new(settings, None, attitude(), &body()).unwrap();
        let mut nearest = f64::NEG_INFINITY;
        fly_controller(&mut controller, &case, &mut |controller, step| {
            assert!(step.command.fallback.is_none(), "{factor}: {:?}", step.command.fallback);
            if step.output % 4 == 0 {
                let pose = step.state.world_from_body;
                let velocity = pose.rotation * step.state.twist_body.linear;
                let tube = controller.tube();
                for i in 0..3 {
                    let here = tumble_planning::nalgebra::Vector2::new(pose.translation.vector[i], velocity[i]);
                    nearest = nearest.max(tube.problem(i).outside(&(here - tube.plan(i).start), tube.plan(i).scale));
                }
            }
            Ok::<(), LawViolation>(())
        })
        .unwrap();
        assert!(nearest <= 1e-9, "{factor}: {nearest}");
    }
}

/// A reference that leads through an obstacle, turning, to a goal behind it: the body keeps off it, or stops before it, whatever
/// its mass and the push.
#[test]
fn keeps_off_obstacles_that_the_reference_does_not() {
    use tumble_planning::collision::{BodyShape, CollisionWorld, EllipsoidWorld, MovingObstacle};
    use tumble_planning::dynamics::{ObstacleEllipsoid, World};
    use tumble_planning::local::Barrier;
    let mass = body().mass;
    let to = control_cases::quintic(Vector3::zeros(), Vector3::new(1.2, 0.1, 0.0), 1.0, 40.0);
    let shape = BodyShape::sphere(0.15).unwrap();
    let ellipsoid = ObstacleEllipsoid {
        world_from_ellipsoid: Pose::translation(0.6, -0.12, 0.05),
        semi_axes: Vector3::new(0.15, 0.2, 0.3),
    };
    let world = EllipsoidWorld::new(&World { obstacles: vec![ellipsoid], ..World::default() }).unwrap();
    for (factor, push_n) in [(0.6, 0.002), (1.0, -0.002), (1.5, 0.001)] {
        let gust = Gust(push_n);
        let mut case = flight(&to, &[], 1400);
        (case.body, case.disturbance) = (control_cases::heavier(factor), &gust);
        let mut settings = TubeSettings {
            terminal: Terminal::Rest,
            point: TrackedPoint::Origin,
            ..settings([0.5 * mass, 1.6 * mass])
        };
        // the centre of mass swings about the origin
        settings.disturbance.acceleration_m_s2 = 0.002;
        let obstacles = TubeObstacles {
            body: shape.clone(),
            barriers: vec![Barrier::Ellipsoid(MovingObstacle::at_rest(ellipsoid))],
            turn_rad_s: 0.1,
            end: EndAttitude::Any,
            attitude_error_rad: 0.05,
        };
        let mut controller = TubeController::try_new(settings, Some(obstacles), attitude(), &body()).unwrap();
        let (mut nearest_m, mut led_m) = (f64::INFINITY, f64::INFINITY);
        fly_controller(&mut controller, &case, &mut |_, step| {
            assert!(step.command.fallback.is_none(), "{factor}: {:?}", step.command.fallback);
            let clearance = |pose: &Pose<f64>| world.clearance(&shape, pose, step.request.time_s).unwrap().distance_m;
            nearest_m = nearest_m.min(clearance(&step.state.world_from_body));
            led_m = led_m.min(clearance(&step.reference.state.world_from_body));
            Ok::<(), LawViolation>(())
        })
        .unwrap();
        assert!(led_m < 0.0, "the reference must be worth keeping off: {led_m}");
        assert!((0.0..0.1).contains(&nearest_m), "{factor}: {nearest_m}");
    }
}

/// A body known exactly that nothing disturbs: the tube has no size, and rounding is not an excess.
#[test]
fn a_tube_without_size_is_flown() {
    let mass = body().mass;
    let to = hold(Pose::translation(0.4, 0.0, 0.0));
    let mut case = flight(&to, &[], 800);
    case.body = InertialParameters::about_com(mass, Vector3::zeros(), body().inertia_about_origin);
    case.start = control_cases::at(Pose::identity());
    let mut sure = TubeSettings { turned_by_rad: 0.0, point: TrackedPoint::Origin, ..settings([mass, mass]) };
    sure.disturbance.force_n = 0.0;
    let mut controller = controller(sure);
    let mut end_m = 1.0;
    fly_controller(&mut controller, &case, &mut |_, step| {
        end_m = step.error.position_m;
        Ok::<(), LawViolation>(())
    })
    .unwrap();
    assert!(end_m < 1e-3, "{end_m}");
    assert_eq!(controller.counts().restarted, 0);
}

/// Too fast for any plan: whatever the mass, no axis is driven faster, and all come to rest.
#[test]
fn braking_only_brakes() {
    let mass = body().mass;
    let here = hold(Pose::identity());
    for (factor, speed) in [(0.5, 0.3), (1.0, 2.0), (1.9, 0.4)] {
        let mut case = flight(&here, &[], 4000);
        case.body = InertialParameters::about_com(factor * mass, Vector3::zeros(), body().inertia_about_origin);
        case.start.twist_body = Twist::new(Vector3::zeros(), Vector3::new(speed, -0.5 * speed, 0.1 * speed));
        let walled = TubeSettings {
            walls_m: [[-1.0, 1.0]; 3],
            point: TrackedPoint::Origin,
            ..settings([0.5 * mass, 2.0 * mass])
        };
        let mut controller = controller(walled);
        let (mut before, mut braked) = (Vector3::repeat(f64::INFINITY), 0);
        fly_controller(&mut controller, &case, &mut |_, step| {
            let velocity = step.state.world_from_body.rotation * step.state.twist_body.linear;
            if step.command.fallback == Some(Fallback::Braking(FallbackReason::Infeasible)) {
                let faster = velocity.abs() - before;
                assert!(faster.max() < 2e-3, "{factor}: {velocity} after {before}");
                (before, braked) = (velocity.abs(), braked + 1);
            }
            Ok::<(), LawViolation>(())
        })
        .unwrap();
        assert!(braked > 10 && before.max() < 0.01, "{factor}: {braked}, {before}");
    }
}

/// Every acceleration in the promised box of world axes is one that the axes of the tube leave to plans, and one corner of it uses all of an axis.
#[test]
fn what_it_promises_to_follow_is_what_the_axes_leave() {
    let mass = body().mass;
    let upright = settings([0.8 * mass, 1.25 * mass]);
    let left = |controller: &TubeController| [0, 1, 2].map(|axis| controller.tube().problem(axis).acceleration_m_s2);
    let aligned = controller(upright);
    for (promised, left) in aligned.acceleration_m_s2().into_iter().zip(left(&aligned)) {
        assert!((promised / left - 1.0).abs() < 1e-12);
    }
    let world_from_axes = UnitQuaternion::new(Vector3::new(0.4, -0.7, 0.3));
    let turned = controller(TubeSettings { world_from_axes, force_limit_n: Vector3::new(0.5, 0.4, 0.3), ..upright });
    let (promised, left) = (turned.acceleration_m_s2(), left(&turned));
    let mut most = 0.0_f64;
    for corner in 0..8 {
        let world = Vector3::from_fn(|i, _| if corner >> i & 1 == 0 { promised[i] } else { -promised[i] });
        let in_axes: Vector3<f64> = world_from_axes.inverse() * world;
        let share = in_axes.abs().component_div(&Vector3::from(left)).max();
        most = most.max(share);
    }
    assert!((most - 1.0).abs() < 1e-12, "{most}");
}
