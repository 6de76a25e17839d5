//! What the coordinator hears and what it answers.

use crate::control::Adoption;
use core::fmt;

/// What happened, at a time of the mission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedEvent {
    /// Mission time, ns.
    pub time_ns: i64,
    /// What.
    pub event: Event,
}

/// What can happen.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// The mission begins; the robot is at rest where it is.
    Begun,
    /// A decision is due: how things stand.
    Tick(Standing),
    /// The estimator has a new belief.
    Belief {
        /// Its number.
        revision: u64,
        /// Whether it differs so much from the one the way was planned with, or the controller promises to follow so much more by now, that
        /// another way would be better.
        is_material: bool,
    },
    /// What the controller made of a belief.
    Offered {
        /// The belief.
        revision: u64,
        /// The answer.
        adoption: Adoption,
    },
    /// The parameters are known as well as asked for, or no longer.
    Known(bool),
    /// A way to the goal.
    WayFound {
        /// The request.
        request: u64,
        /// The belief it was planned with.
        model_revision: u64,
        /// The world it was planned in.
        world_revision: u64,
    },
    /// No way was found.
    WayRefused {
        /// The request.
        request: u64,
    },
    /// A proof that no way exists in a world.
    WayImpossible {
        /// The request.
        request: u64,
        /// The world.
        world_revision: u64,
    },
    /// A stretch of the way.
    StretchFound {
        /// The request.
        request: u64,
        /// What it is.
        stretch: FoundStretch,
    },
    /// No stretch was found.
    StretchRefused {
        /// The request.
        request: u64,
    },
    /// The world is another than it was.
    World {
        /// Its number.
        revision: u64,
        /// When what is being flown, the stop after it included, would hit something, ns.
        contact_ns: Option<i64>,
    },
    /// The robot is somewhere else than it was taken to be.
    Relocalised,
    /// The estimator contradicts itself: its belief is worth nothing.
    Diverged,
    /// The body is no longer what it was: something was grasped, lost, or slipped; or actuators do not do what they are told.
    BodyDoubtful,
    /// What was seen since the body was doubted is explained by actuators better than by another body.
    ThrustDoubtful,
    /// Whether what was seen since the body was doubted is explained by no one actuator nearly as well as by another body.
    ThrustAcquitted(bool),
    /// The controller brakes, for its own reasons, and needs a new plan.
    Braking,
    /// The computer started anew: what was on its way is lost.
    Restarted,
}

/// How things stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// Age of the newest measurement used, ns.
    pub state_age_ns: i64,
    /// Time since the estimator told a motion that is one, ns; 0 where it does.
    pub motion_age_ns: i64,
    /// Distance of the robot from what is being flown, m.
    pub deviation_m: f64,
    /// Angle from it, rad.
    pub deviation_rad: f64,
    /// When what is being flown comes to rest, ns; in the past at rest.
    pub rest_ns: i64,
    /// Whether the robot is at its goal, and slow.
    pub is_at_goal: bool,
    /// Belief that the controller uses.
    pub used_revision: u64,
}

/// A stretch as the coordinator sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FoundStretch {
    /// When it begins, ns.
    pub start_ns: i64,
    /// When it ends, and the stop after it begins, ns.
    pub end_ns: i64,
    /// The belief it was planned with.
    pub model_revision: u64,
    /// The world it was checked in.
    pub world_revision: u64,
    /// Whether its way ends with it.
    pub is_last: bool,
    /// Whether its way leads to the goal, and not only to where more room is left.
    pub is_to_goal: bool,
    /// Whether it and the stop after it keep clear of everything, from where it has left what it begins in contact with.
    pub is_clear: bool,
}

/// Where a plan is to begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StartFrom {
    /// Where what is being flown will be then: the robot follows it.
    Reference,
    /// Where the robot will be then, by what is measured: it is not where it should be.
    Estimate,
}

/// How a stretch is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Ambition {
    /// Progress and information.
    Informative,
    /// Progress.
    Plain,
    /// The way as it is, which was found free of obstacles as a whole.
    AlongWay,
}

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Action {
    /// Plan a way from where the robot will be at a time.
    PlanWay {
        /// Number of the request.
        request: u64,
        /// When it begins, ns.
        start_ns: i64,
        /// From where.
        from: StartFrom,
    },
    /// Plan a stretch of the newest way.
    PlanStretch {
        /// Number of the request.
        request: u64,
        /// When it begins, ns.
        start_ns: i64,
        /// The way that it is a part of, by its request.
        way: u64,
        /// When that way begins, ns.
        way_start_ns: i64,
        /// How.
        ambition: Ambition,
    },
    /// Fly a stretch from its start on.
    Follow {
        /// The request that asked for it.
        request: u64,
    },
    /// Stop at once: from the state that is being flown.
    Stop,
    /// Stop as hard as there is force, from where the robot is by what is measured: what is around it is not known.
    Brake,
    /// Be at rest where the robot is by what is measured.
    HoldHere,
    /// Offer the newest belief to the controller.
    Offer {
        /// Its number.
        revision: u64,
    },
    /// Begin anew with a controller that takes the body for anything it can be.
    RenewController,
    /// Begin anew with the body that was believed at first; the motion stays as it is known.
    ResetEstimator,
    /// Believe less in the body.
    WidenBelief,
    /// Believe less in the wrench that acts.
    DoubtWrench,
    /// The mission is over.
    Finish {
        /// Whether the robot is where it was to be.
        has_arrived: bool,
    },
    /// The mission is over: there is no way.
    GiveUp {
        /// The request whose answer proves it.
        request: u64,
    },
    /// The mission is over: the estimator tells no motion any more, and the robot rests by what it was told to do since.
    Abandon,
    /// For the log.
    Note(Note),
}

/// What the coordinator noticed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Note {
    /// An event from the past, or one that says what is known already.
    Stale,
    /// An answer to what was not asked, or is no longer wanted.
    Unasked {
        /// Its request.
        request: u64,
    },
    /// An answer came when it should have been flown already.
    TooLate {
        /// Its request.
        request: u64,
    },
    /// A stretch that hits something, or was checked in a world that is no more.
    Unsafe {
        /// Its request.
        request: u64,
    },
    /// A planner had no answer.
    Refused {
        /// The request.
        request: u64,
    },
    /// A planner did not answer at all.
    Unanswered {
        /// The request.
        request: u64,
    },
    /// There was no next stretch in time: the robot stops.
    RanOut,
    /// Measurements are missing for too long: the robot stops.
    Blind,
    /// The estimator tells no motion for too long: the robot stops.
    NoMotion,
    /// There are measurements again, and a motion.
    Seeing,
    /// The robot is too far from what is being flown.
    Astray,
    /// Something is in the way.
    Obstacle,
    /// The controller holds a belief for impossible.
    Contradiction {
        /// The belief.
        revision: u64,
    },
    /// The estimator is begun anew.
    Diverged,
    /// The body is another.
    BodyDoubtful,
    /// The body is not what is wrong: actuators disagree with what they are told.
    ActuatorsDisagree,
    /// The computer was off.
    Restarted,
    /// The time is up.
    OutOfTime,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stale => "an event from the past, or what is known already",
            Self::Unasked { request } => {
                return write!(f, "request {request}: an answer that is not wanted, or no longer");
            }
            Self::TooLate { request } => {
                return write!(f, "request {request}: the answer came when it should have been flown already");
            }
            Self::Unsafe { request } => {
                return write!(
                    f,
                    "request {request}: the plan hits something, or was checked in a world that is no more"
                );
            }
            Self::Refused { request } => return write!(f, "request {request}: the planner found nothing"),
            Self::Unanswered { request } => return write!(f, "request {request}: the planner did not answer"),
            Self::RanOut => "no next stretch came in time: the robot stops",
            Self::Blind => "measurements are missing for too long: the robot stops",
            Self::NoMotion => "the estimator tells no motion for too long: the robot stops",
            Self::Seeing => "there are measurements again",
            Self::Astray => "the robot is too far from what is flown",
            Self::Obstacle => "something is in the way",
            Self::Contradiction { revision } => {
                return write!(f, "belief {revision} cannot be, says the controller");
            }
            Self::Diverged => "the estimator has lost its way",
            Self::BodyDoubtful => "another body moves here",
            Self::ActuatorsDisagree => "the actuators do not do what they are told",
            Self::Restarted => "the computer was off",
            Self::OutOfTime => "the time is up",
        })
    }
}
