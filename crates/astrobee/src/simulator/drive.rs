//! What asks for wrenches: a controller that follows a reference, and wrenches added to it.

use super::control_account::ControlAccount;
use crate::sensing::LocalizationEstimate;
use std::f64::consts::TAU;
use tumble_dynamics::nalgebra::{UnitQuaternion, Vector3};
use tumble_dynamics::{BodyAcceleration, PoseReference, RigidBodyState};
use tumble_identification::fourier::FourierMotion;
use tumble_identification::noise::Gaussian;
use tumble_lie::{LieGroup, Pose, Twist, Wrench};
use tumble_planning::control::{Adoption, ControlCommand, ControlRequest, Controller, ReferenceMotion};
use tumble_planning::{ModelBelief, Plan, PlanningError};

/// Where the robot should be at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// Time since the start, s.
    pub time_s: f64,
    /// Pose at that time, at rest.
    pub world_from_body: Pose<f64>,
}

/// Where the robot should be.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Reference {
    /// Always here.
    Hold(Pose<f64>),
    /// From rest to rest along straight lines, turning about one axis per leg; before the first waypoint at it, after the
    /// last at that. Times increase.
    Path(Vec<Waypoint>),
    /// A designed periodic motion that starts here.
    Periodic {
        /// The motion.
        motion: Box<FourierMotion>,
        /// Where it starts.
        world_from_start: Pose<f64>,
    },
}

/// Progress along a leg, `10 s^3 - 15 s^4 + 6 s^5`: value, first and second derivative.
fn smooth(s: f64) -> [f64; 3] {
    let square = s * s;
    [
        square * s * (10.0 + s * (6.0 * s - 15.0)),
        square * (30.0 + s * (30.0 * s - 60.0)),
        s * (60.0 + s * (120.0 * s - 180.0)),
    ]
}

fn at_rest(world_from_body: Pose<f64>) -> PoseReference {
    PoseReference {
        state: RigidBodyState { world_from_body, twist_body: Twist::zero() },
        acceleration: BodyAcceleration {
            angular_acceleration_body: Vector3::zeros(),
            acceleration_origin_body: Vector3::zeros(),
        },
    }
}

/// On the way from one waypoint to the next.
fn between(from: &Waypoint, to: &Waypoint, time_s: f64) -> PoseReference {
    let duration_s = to.time_s - from.time_s;
    let [progress, slope, bend] = smooth((time_s - from.time_s) / duration_s);
    let (rate, rate_change) = (slope / duration_s, bend / (duration_s * duration_s));
    let (start, end) = (&from.world_from_body, &to.world_from_body);
    let travel_world = end.translation.vector - start.translation.vector;
    let turn: Vector3<f64> = LieGroup::log(&(start.rotation.inverse() * end.rotation));
    let rotation = start.rotation * <UnitQuaternion<f64> as LieGroup>::exp(&(turn * progress));
    let position = start.translation.vector + travel_world * progress;
    let travel_body = rotation.inverse() * travel_world;
    PoseReference {
        state: RigidBodyState {
            world_from_body: Pose::from_parts(position.into(), rotation),
            twist_body: Twist::new(turn * rate, travel_body * rate),
        },
        acceleration: BodyAcceleration {
            angular_acceleration_body: turn * rate_change,
            acceleration_origin_body: travel_body * rate_change,
        },
    }
}

impl Reference {
    /// The reference at a time; `None` where a periodic motion has no attitude, or a path no waypoint.
    pub fn at(&self, time_s: f64) -> Option<PoseReference> {
        match self {
            Self::Hold(pose) => Some(at_rest(*pose)),
            Self::Path(waypoints) => {
                let next = waypoints.partition_point(|waypoint| waypoint.time_s <= time_s);
                match (next.checked_sub(1).and_then(|last| waypoints.get(last)), waypoints.get(next)) {
                    (Some(from), Some(to)) => Some(between(from, to, time_s)),
                    (Some(only), None) | (None, Some(only)) => Some(at_rest(only.world_from_body)),
                    (None, None) => None,
                }
            }
            Self::Periodic { motion, world_from_start } => Some(motion.at(time_s)?.reference(world_from_start)),
        }
    }
}

/// A sum of sines on every axis, all of different frequencies, with random phases.
#[derive(Clone, Debug, PartialEq)]
pub struct Multisine {
    /// `[torque; force]`: amplitude of each sine.
    amplitudes: [f64; 6],
    /// Angular frequency and phase of each sine of each axis.
    sines: Vec<[(f64, f64); 6]>,
}

impl Multisine {
    /// `tones` sines per axis whose amplitudes add up to `peak` (`[torque; force]`), the lowest at `lowest_hz`, the others of
    /// all axes evenly spaced above it up to `highest_hz`.
    pub fn new(peak: &Wrench<f64>, tones: usize, lowest_hz: f64, highest_hz: f64, seed: u64) -> Self {
        let mut random = Gaussian::from_seed(seed);
        let last = (6 * tones).saturating_sub(1).max(1) as f64;
        let spacing_hz = (highest_hz - lowest_hz) / last;
        let sine = |tone: usize, axis: usize, random: &mut Gaussian| {
            let hz = lowest_hz + spacing_hz * (6 * tone + axis) as f64;
            (TAU * hz, TAU * random.uniform())
        };
        let sines = (0..tones).map(|tone| std::array::from_fn(|axis| sine(tone, axis, &mut random))).collect();
        let peak = peak.to_vector();
        Self { amplitudes: std::array::from_fn(|axis| peak[axis] / tones.max(1) as f64), sines }
    }

    /// The wrench at a time, body axes.
    pub fn wrench(&self, time_s: f64) -> Wrench<f64> {
        let mut sum = [0.0; 6];
        for tone in &self.sines {
            for (axis, (omega, phase)) in tone.iter().enumerate() {
                sum[axis] += self.amplitudes[axis] * libm::sin(omega * time_s + phase);
            }
        }
        Wrench::new(Vector3::new(sum[0], sum[1], sum[2]), Vector3::new(sum[3], sum[4], sum[5]))
    }
}

/// A wrench that no controller asks for, body axes, torque about the body origin.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub enum AddedWrench {
    /// None.
    #[default]
    Nothing,
    /// Always the same.
    Constant(Wrench<f64>),
    /// Each from its time (ns, increasing) to the next; nothing before the first and, where the last time is the
    /// end, zero from there on.
    Sequence(Vec<(i64, Wrench<f64>)>),
    /// Sines.
    Multisine(Multisine),
}

impl AddedWrench {
    /// The wrench at a time.
    pub fn at(&self, time_ns: i64) -> Wrench<f64> {
        match self {
            Self::Nothing => Wrench::zero(),
            Self::Constant(wrench) => *wrench,
            Self::Sequence(rows) => {
                let next = rows.partition_point(|(from_ns, _)| *from_ns <= time_ns);
                next.checked_sub(1).and_then(|last| rows.get(last)).map_or_else(Wrench::zero, |(_, wrench)| *wrench)
            }
            Self::Multisine(sines) => sines.wrench(time_ns as f64 * 1e-9),
        }
    }
}

/// A path that leads nowhere is no number: who follows it says so.
impl ReferenceMotion for Reference {
    fn at(&self, time_s: f64) -> PoseReference {
        let nowhere = Pose::from_parts(Vector3::repeat(f64::NAN).into(), UnitQuaternion::identity());
        Self::at(self, time_s).unwrap_or_else(|| at_rest(nowhere))
    }
}

/// Follows a reference by estimates that come late: what a [`Drive`] asks.
///
/// Every [`Controller`] is one as a [`Following`]; one that must know how old and how good an estimate is implements this
/// itself, as the flown one does.
///
/// # Example
/// ```
/// use tumble_astrobee::sensing::{Confidence, LocalizationEstimate};
/// use tumble_astrobee::simulator::{Follower, Reference};
/// use tumble_dynamics::nalgebra::Vector3;
/// use tumble_dynamics::lie::{Pose, Wrench};
/// use tumble_planning::control::{Adoption, ControlCommand, ReferenceMotion};
/// use tumble_planning::{ModelBelief, Plan, PlanningError};
///
/// /// Damps the motion, and asks for nothing where it does not know it: the estimate is old, or not trusted.
/// struct Careful {
///     revision: u64,
/// }
/// impl Follower for Careful {
///     fn offer(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
///         self.revision = belief.revision;
///         Ok(Adoption::Adopted)
///     }
///     fn steer(
///         &mut self,
///         time_ns: i64,
///         estimate: &LocalizationEstimate,
///         _plan: &Plan<&dyn ReferenceMotion>,
///     ) -> Result<ControlCommand, PlanningError> {
///         let is_known = estimate.confidence == Confidence::Good && time_ns - estimate.stamp_ns < 500_000_000;
///         let velocity_body = estimate.world_from_body.rotation.inverse() * estimate.velocity_origin_world;
///         let damping = Wrench::new(estimate.rate_body * -0.1, velocity_body * -2.0);
///         let wrench_body = if is_known { damping } else { Wrench::zero() };
///         Ok(ControlCommand { wrench_body, model_revision: self.revision, fallback: None, mass: None })
///     }
/// }
/// let estimate = LocalizationEstimate {
///     stamp_ns: 0,
///     arrival_ns: 100_000_000,
///     world_from_body: Pose::identity(),
///     velocity_origin_world: Vector3::x() * 0.1,
///     rate_body: Vector3::zeros(),
///     acceleration_origin_body: Vector3::zeros(),
///     confidence: Confidence::Good,
/// };
/// let motion = Reference::Hold(Pose::identity());
/// let plan: Plan<&dyn ReferenceMotion> = Plan { trajectory: &motion, model_revision: 1 };
/// let mut follower: Box<dyn Follower> = Box::new(Careful { revision: 1 });
/// assert!(follower.steer(200_000_000, &estimate, &plan)?.wrench_body.force.x < 0.0);
/// assert_eq!(follower.steer(900_000_000, &estimate, &plan)?.wrench_body, Wrench::zero());
/// # Ok::<(), PlanningError>(())
/// ```
/// Tutorial: [a controller of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/planning/tests/suite/custom_controller.rs).
pub trait Follower: Send {
    /// Offers a belief, as [`Controller::adopt`] does.
    ///
    /// # Errors
    /// A body that cannot be.
    fn offer(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError>;

    /// The wrench to ask for now (ns since the start), body axes, torque about the body origin, from the newest estimate.
    ///
    /// # Errors
    /// Numbers that are none.
    fn steer(
        &mut self,
        time_ns: i64,
        estimate: &LocalizationEstimate,
        plan: &Plan<&dyn ReferenceMotion>,
    ) -> Result<ControlCommand, PlanningError>;
}

/// A controller that takes the state it is told for the present one.
pub struct Following {
    /// The controller.
    pub controller: Box<dyn Controller + Send>,
    /// Whether estimates are carried to the present; else they are told as they come, however old.
    pub carries: bool,
}

impl Follower for Following {
    fn offer(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
        self.controller.adopt(belief)
    }

    fn steer(
        &mut self,
        time_ns: i64,
        estimate: &LocalizationEstimate,
        plan: &Plan<&dyn ReferenceMotion>,
    ) -> Result<ControlCommand, PlanningError> {
        let state = if self.carries { carried_state(estimate, time_ns) } else { believed_state(estimate) };
        self.controller.command(&ControlRequest { time_s: time_ns as f64 * 1e-9, state: &state, plan })
    }
}

/// What drives the robot: the controller's wrench and the added one.
#[derive(Default)]
pub struct Drive {
    /// A controller and what it follows.
    pub tracking: Option<(Box<dyn Follower>, Reference)>,
    /// Added to that.
    pub added: AddedWrench,
    /// Beliefs that the controller will be offered, each at its time, ns; times grow.
    pub beliefs: Vec<(i64, ModelBelief)>,
    /// What the controller has said.
    pub account: ControlAccount,
}

impl Drive {
    /// The wrench to ask for at a time, from the newest estimate; without one the controller waits.
    ///
    /// # Errors
    /// What the controller refuses: a body that cannot be, numbers that are none.
    pub fn wanted(
        &mut self,
        time_ns: i64,
        estimate: Option<&LocalizationEstimate>,
    ) -> Result<Wrench<f64>, PlanningError> {
        let time_s = time_ns as f64 * 1e-9;
        let mut wanted = self.added.at(time_ns);
        let Some((follower, motion)) = &mut self.tracking else { return Ok(wanted) };
        while let Some((_, belief)) = self.beliefs.get(self.account.offered()).filter(|(due_ns, _)| *due_ns <= time_ns)
        {
            let answer = follower.offer(belief)?;
            self.account.answered(time_ns, belief.revision, answer);
        }
        if let Some(estimate) = estimate
            && motion.at(time_s).is_some()
        {
            let plan: Plan<&dyn ReferenceMotion> =
                Plan { trajectory: motion, model_revision: self.account.plan_belief() };
            let command = follower.steer(time_ns, estimate, &plan)?;
            self.account.commanded(time_ns, &command);
            wanted += command.wrench_body;
        }
        Ok(wanted)
    }
}

/// The state that an estimate describes.
fn believed_state(estimate: &LocalizationEstimate) -> RigidBodyState<f64> {
    let world_from_body = estimate.world_from_body;
    let linear = world_from_body.rotation.inverse() * estimate.velocity_origin_world;
    RigidBodyState { world_from_body, twist_body: Twist::new(estimate.rate_body, linear) }
}

/// The state at a time if velocity (inertial axes) and rate (body axes) stay as they were estimated.
fn carried_state(estimate: &LocalizationEstimate, time_ns: i64) -> RigidBodyState<f64> {
    let age_s = time_ns.saturating_sub(estimate.stamp_ns) as f64 * 1e-9;
    let turned: UnitQuaternion<f64> = LieGroup::exp(&(estimate.rate_body * age_s));
    let rotation = estimate.world_from_body.rotation * turned;
    let position = estimate.world_from_body.translation.vector + estimate.velocity_origin_world * age_s;
    RigidBodyState {
        world_from_body: Pose::from_parts(position.into(), rotation),
        twist_body: Twist::new(estimate.rate_body, rotation.inverse() * estimate.velocity_origin_world),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};
    use tumble_dynamics::{FreeFlyer, PoseTracker};
    use tumble_planning::control::PoseTracking;

    fn path() -> Reference {
        let pose = |x: f64, y: f64, turn: Vector3<f64>| {
            Pose::from_parts(Vector3::new(x, y, 0.3).into(), <UnitQuaternion<f64> as LieGroup>::exp(&turn))
        };
        Reference::Path(vec![
            Waypoint { time_s: 1.0, world_from_body: pose(0.0, 0.0, Vector3::zeros()) },
            Waypoint { time_s: 5.0, world_from_body: pose(1.0, -0.5, Vector3::new(0.2, -0.8, 0.4)) },
            Waypoint { time_s: 9.0, world_from_body: pose(1.5, 0.5, Vector3::new(-0.9, 0.1, 0.3)) },
        ])
    }

    #[test]
    fn twist_and_acceleration_are_the_derivatives_of_the_path() {
        let path = path();
        for time_s in [0.5, 1.7, 3.0, 4.9, 5.0, 6.2, 8.8, 9.5] {
            let h = 1e-5;
            let [before, now, after] = [-h, 0.0, h].map(|d| path.at(time_s + d).unwrap());
            let pose = |r: &PoseReference| r.state.world_from_body;
            // Central difference in the axes of the middle pose.
            let ahead: Twist<f64> = LieGroup::log(&pose(&now).inv_mul(&pose(&after))).into();
            let behind: Twist<f64> = LieGroup::log(&pose(&now).inv_mul(&pose(&before))).into();
            let twist = (ahead - behind) * (0.5 / h);
            assert!((twist - now.state.twist_body).to_vector().amax() < 1e-8, "{time_s}");
            let rate = (after.state.twist_body - before.state.twist_body) * (0.5 / h);
            let found = BodyAcceleration::from_twist_rate_body(&now.state.twist_body, &rate);
            let expected = &now.acceleration;
            assert!((found.acceleration_origin_body - expected.acceleration_origin_body).amax() < 1e-5, "{time_s}");
            assert!((found.angular_acceleration_body - expected.angular_acceleration_body).amax() < 1e-5, "{time_s}");
        }
        let end = path.at(20.0).unwrap();
        assert!((end.state.world_from_body.translation.vector - Vector3::new(1.5, 0.5, 0.3)).amax() < 1e-15);
    }

    #[test]
    fn a_sequence_holds_each_wrench_until_the_next() {
        let push = |x: f64| Wrench::new(Vector3::zeros(), Vector3::new(x, 0.0, 0.0));
        let sequence = AddedWrench::Sequence(vec![(100, push(1.0)), (200, push(2.0))]);
        let found = [0, 99, 100, 199, 200, 10_000].map(|t| sequence.at(t).force.x);
        assert!(found.iter().zip([0.0, 0.0, 1.0, 1.0, 2.0, 2.0]).all(|(a, b)| (a - b).abs() < 1e-15));
    }

    #[test]
    fn a_multisine_stays_below_its_peak_and_reaches_into_it() {
        let peak = Wrench::new(Vector3::new(0.01, 0.02, 0.03), Vector3::new(0.4, 0.2, 0.1));
        let sines = Multisine::new(&peak, 3, 0.05, 0.4, 9);
        let mut largest = [0.0_f64; 6];
        for i in 0..20_000 {
            let wrench = sines.wrench(f64::from(i) * 0.05).to_vector();
            for (axis, largest) in largest.iter_mut().enumerate() {
                *largest = largest.max(wrench[axis].abs());
            }
        }
        for (axis, largest) in largest.into_iter().enumerate() {
            let share = largest / peak.to_vector()[axis];
            // The worst phases of three evenly spaced sines leave sqrt(5)/3 of the sum of their amplitudes.
            assert!((0.745..=1.0).contains(&share), "{axis}: {share}");
        }
        assert_ne!(sines, Multisine::new(&peak, 3, 0.05, 0.4, 10));
    }

    /// Notes what it was asked and answers with its newest belief.
    struct Recording(Arc<Mutex<Vec<Heard>>>, u64);

    /// Time, state and revision of the plan.
    type Heard = (f64, RigidBodyState<f64>, u64);

    impl Controller for Recording {
        fn adopt(&mut self, belief: &ModelBelief) -> Result<Adoption, PlanningError> {
            self.1 = belief.revision;
            Ok(Adoption::Adopted)
        }

        fn command(&mut self, request: &ControlRequest<'_>) -> Result<ControlCommand, PlanningError> {
            let wanted = request.plan.trajectory.at(request.time_s).state.world_from_body.translation.vector;
            self.0.lock().unwrap().push((request.time_s, *request.state, request.plan.model_revision));
            let wrench_body = Wrench::new(Vector3::zeros(), wanted);
            Ok(ControlCommand { wrench_body, model_revision: self.1, fallback: None, mass: None })
        }
    }

    #[test]
    fn any_controller_steers_with_the_present_state_and_beliefs_in_time() {
        let heard = Arc::default();
        let controller = Box::new(Recording(Arc::clone(&heard), 0));
        let body = crate::worlds::WorldPreset::Iss.body();
        let belief = |revision| ModelBelief::certain(revision, body);
        let push = Wrench::new(Vector3::new(0.1, 0.0, 0.0), Vector3::zeros());
        let mut drive = Drive {
            tracking: Some((Box::new(Following { controller, carries: true }), path())),
            added: AddedWrench::Constant(push),
            beliefs: vec![(0, belief(1)), (2_000_000_000, belief(2)), (2_000_000_001, belief(3))],
            ..Drive::default()
        };
        // nothing to go by yet
        assert_eq!(drive.wanted(0, None).unwrap(), push);
        assert_eq!((heard.lock().unwrap().len(), drive.account.offered()), (0, 1));
        let rotation = UnitQuaternion::new(Vector3::new(0.0, 0.0, 1.0));
        let estimate = LocalizationEstimate {
            stamp_ns: 1_500_000_000,
            arrival_ns: 1_600_000_000,
            world_from_body: Pose::from_parts(Vector3::new(1.0, 2.0, 3.0).into(), rotation),
            velocity_origin_world: Vector3::new(0.1, 0.0, -0.2),
            rate_body: Vector3::new(0.0, 0.0, 0.4),
            acceleration_origin_body: Vector3::zeros(),
            confidence: crate::sensing::Confidence::Good,
        };
        let wanted = drive.wanted(2_000_000_000, Some(&estimate)).unwrap();
        let reference = path().at(2.0).unwrap().state.world_from_body.translation.vector;
        assert!((wanted.force - reference).amax() < 1e-15 && wanted.torque == push.torque);
        assert_eq!((drive.account.model_revision(), drive.account.offered()), (2, 2));
        let (time_s, state, plan) = heard.lock().unwrap()[0];
        assert_eq!((time_s.to_bits(), plan), (2.0_f64.to_bits(), 1));
        // half a second later: 0.2 rad further about z, and the same velocity in turned axes
        let expected = UnitQuaternion::new(Vector3::new(0.0, 0.0, 1.2));
        assert!(state.world_from_body.rotation.angle_to(&expected) < 1e-12);
        let moved = state.world_from_body.translation.vector - Vector3::new(1.05, 2.0, 2.9);
        assert!(moved.amax() < 1e-12, "{moved}");
        assert!((expected * state.twist_body.linear - Vector3::new(0.1, 0.0, -0.2)).amax() < 1e-12);
        drive.wanted(3_000_000_000, Some(&estimate)).unwrap();
        assert_eq!(drive.account.model_revision(), 3);
    }

    #[test]
    fn a_tracker_is_told_what_to_believe() {
        let body = crate::worlds::WorldPreset::Iss.body();
        let twice = tumble_dynamics::InertialParameters::about_com(
            2.0 * body.mass,
            body.center_of_mass(),
            body.inertia_about_com(),
        );
        let tracker = PoseTracker::critically_damped(FreeFlyer::new(body), 1.0, 0.5);
        let controller = Box::new(PoseTracking::unlimited(tracker).unwrap());
        let tracking = Following { controller, carries: false };
        let mut drive = Drive {
            tracking: Some((Box::new(tracking), Reference::Hold(Pose::translation(1.0, 0.0, 0.0)))),
            beliefs: vec![(10, ModelBelief::certain(4, twice))],
            ..Drive::default()
        };
        let estimate = LocalizationEstimate {
            stamp_ns: 0,
            arrival_ns: 0,
            world_from_body: Pose::identity(),
            velocity_origin_world: Vector3::zeros(),
            rate_body: Vector3::zeros(),
            acceleration_origin_body: Vector3::zeros(),
            confidence: crate::sensing::Confidence::Good,
        };
        let before = drive.wanted(0, Some(&estimate)).unwrap();
        let after = drive.wanted(10, Some(&estimate)).unwrap();
        assert!((after.force - before.force * 2.0).amax() < 1e-12 && before.force.x > 1.0);
        assert_eq!((drive.account.beliefs()[0].used_from_ns, drive.account.model_revision()), (Some(10), 4));
        let mut impossible = twice;
        impossible.mass = f64::NAN;
        drive.beliefs.push((20, ModelBelief::certain(5, impossible)));
        assert!(drive.wanted(20, Some(&estimate)).is_err());
    }
}
