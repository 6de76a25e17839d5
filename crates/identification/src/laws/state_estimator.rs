//! Laws of estimators in flight.

use super::broken_unless;
use crate::dynamics::{
    FreeFlyer, FreeFlyerIn, InertialParameters, Integrator, MuntheKaas4, RigidBodyState, StoredMomentum,
};
use crate::estimator::{Acted, Doubt, EstimatorError, Finding, Gauss, Measurement, StateEstimator};
use crate::lie::{LieGroup, Pose, Twist, Wrench};
use crate::recursive::{Reception, grasp_or_release};
use nalgebra::{SMatrix, SVector, Vector3};
use std::boxed::Box;
use std::vec::Vec;
use tumble_lie::laws::{LawViolation, require};

/// A flight that the laws make up: a known body under wrenches that the estimator is told, looked at once in every period.
#[derive(Clone, Debug)]
pub struct StateTrial {
    /// The true body.
    pub body: InertialParameters<f64>,
    /// What the estimator begins with: another body, as uncertain as it is off.
    pub prior: Finding,
    /// Period of control and of measurements, ns.
    pub period_ns: i64,
    /// Periods flown; half a minute or so.
    pub periods: usize,
    /// Measurements that come later than this many periods are not used.
    pub lateness: usize,
    /// Largest torque and force, N m and N.
    pub wrench: [f64; 2],
    /// Momentum stored where it matters: its gyroscopic torque is to be of the size of the torques.
    pub stored_body: Vector3<f64>,
    /// Stated deviations of attitude, position, rate and velocity, rad, m, rad/s, m/s; what is measured is exact.
    pub deviation: [f64; 4],
    /// By how much exact data may leave a parameter off, as a share of the magnitudes of the prior.
    pub within: f64,
}

/// Makes the estimator under trial, from a motion at time zero.
pub type BeginFlight<'a> =
    &'a dyn Fn(&RigidBodyState<f64>, &Finding) -> Result<Box<dyn StateEstimator>, EstimatorError>;

/// What happened: the motion at the end of every period, and what acted in it.
pub(super) struct Flown {
    pub(super) states: Vec<RigidBodyState<f64>>,
    pub(super) acted: Vec<Acted>,
}

/// Steps of the truth in a period.
const SUBSTEPS: usize = 4;

impl Flown {
    pub(super) fn new(trial: &StateTrial, stored_body: Vector3<f64>) -> Result<Self, LawViolation> {
        let environment = StoredMomentum { momentum_body: stored_body };
        let system = FreeFlyerIn { body: FreeFlyer::new(trial.body), environment };
        let pose = Pose::exp(&nalgebra::Vector6::new(0.2, -0.3, 0.5, 1.0, -2.0, 0.5));
        let twist = Twist::new(Vector3::new(0.03, -0.02, 0.04), Vector3::new(0.02, 0.01, -0.03));
        let mut state = RigidBodyState { world_from_body: pose, twist_body: twist };
        let (mut states, mut acted) = (std::vec![state], Vec::new());
        let [torque, force] = trial.wrench;
        let step_s = trial.period_ns as f64 * 1e-9 / SUBSTEPS as f64;
        for k in 0..trial.periods {
            let t = k as f64 * trial.period_ns as f64 * 1e-9;
            // Back and forth about every axis, each in its own time.
            let wave = |i: usize| (t * (0.7 + 0.23 * i as f64) + 0.9 * i as f64).sin();
            let wrench =
                Wrench::new(Vector3::from_fn(|i, _| torque * wave(i)), Vector3::from_fn(|i, _| force * wave(i + 3)));
            for _ in 0..SUBSTEPS {
                let next = MuntheKaas4.step(&system, &state, &wrench, 0.0, step_s);
                state = done("the trial can be flown", next)?;
            }
            let from_ns = trial.at_ns(k);
            acted.push(Acted { from_ns, until_ns: trial.at_ns(k + 1), wrench_body: wrench, stored_body });
            states.push(state);
        }
        Ok(Self { states, acted })
    }
}

impl StateTrial {
    #[allow(clippy::cast_possible_wrap)] // periods of minutes
    fn at_ns(&self, period: usize) -> i64 {
        self.period_ns * period as i64
    }

    /// All that there is to see at the end of a period.
    pub(super) fn seen(&self, period: usize, state: &RigidBodyState<f64>) -> Measurement {
        let [attitude, position, rate, velocity] = self.deviation;
        let (pose, twist) = (&state.world_from_body, &state.twist_body);
        Measurement {
            stamp_ns: self.at_ns(period),
            attitude: Some(Gauss::isotropic(pose.rotation, attitude)),
            position_world: Some(Gauss::isotropic(pose.translation.vector, position)),
            rate_body: Some(Gauss::isotropic(twist.angular, rate)),
            velocity_world: Some(Gauss::isotropic(pose.rotation * twist.linear, velocity)),
            ..Measurement::default()
        }
    }

    pub(super) fn end_ns(&self) -> i64 {
        self.at_ns(self.periods)
    }
}

pub(super) fn done<T, E: std::fmt::Display>(law: &'static str, found: Result<T, E>) -> Result<T, LawViolation> {
    match found {
        Ok(found) => Ok(found),
        Err(error) => Err(LawViolation {
            law,
            inputs: std::string::String::new(),
            expected: "success".into(),
            found: error.to_string(),
            error: f64::INFINITY,
            tolerance: 0.0,
        }),
    }
}

/// A flight as it is told: which period's measurement arrives when, and what it shows.
pub(super) fn told(
    estimator: &mut dyn StateEstimator,
    flown: &Flown,
    arrives: &dyn Fn(usize) -> usize,
    seen: &dyn Fn(usize, &RigidBodyState<f64>) -> Option<Measurement>,
) -> Vec<Reception> {
    let mut underway: Vec<(usize, usize)> = (1..flown.states.len()).map(|period| (arrives(period), period)).collect();
    underway.sort_unstable();
    let (mut receptions, mut next) = (Vec::new(), 0);
    for (k, acted) in flown.acted.iter().enumerate() {
        estimator.acted(acted);
        while let Some((_, period)) = underway.get(next).filter(|(when, _)| *when <= k + 1) {
            let state = flown.states.get(*period);
            if let Some(measurement) = state.and_then(|state| seen(*period, state)) {
                receptions.push(estimator.measured(&measurement));
            }
            next += 1;
        }
    }
    receptions
}

/// What is known: the point and the covariance.
type Known = (SVector<f64, 10>, SMatrix<f64, 10, 10>);

pub(super) fn known(estimator: &dyn StateEstimator) -> Result<Known, LawViolation> {
    let law = "everything is finite";
    let found = done(law, estimator.finding())?;
    let covariance = done(law, found.covariance())?;
    let Some(point) = found.point().copied() else {
        return done(law, Err("a finding without a point"));
    };
    let usable = point.iter().chain(&covariance).all(|x| x.is_finite()) && covariance.diagonal().min() >= 0.0;
    require(law, &"finding", &"finite", &point, broken_unless(usable), 0.0)?;
    let health = estimator.health();
    let usable = health.mean_nis.is_finite() && !health.alarm_above.is_nan();
    require(law, &"health", &"finite", &health, broken_unless(usable), 0.0)?;
    Ok((point, covariance))
}

pub(super) fn motion(estimator: &dyn StateEstimator, time_ns: i64) -> Result<RigidBodyState<f64>, LawViolation> {
    let state = estimator.state_at(time_ns);
    let (pose, twist) = (&state.world_from_body, state.twist_body.to_vector());
    let numbers = pose.translation.vector.iter().chain(pose.rotation.coords.iter()).chain(&twist);
    let usable = numbers.into_iter().all(|x| x.is_finite());
    require("everything is finite", &"motion", &"finite", &state, broken_unless(usable), 0.0)?;
    Ok(state)
}

/// Largest distance, in standard deviations of the one.
fn apart(one: &Known, other: &Known) -> f64 {
    (0..10)
        .map(|i| {
            let deviation = one.1[(i, i)].sqrt();
            ((one.0[i] - other.0[i]).abs() / deviation).max((other.1[(i, i)].sqrt() / deviation - 1.0).abs())
        })
        .fold(0.0, f64::max)
}

/// What an order of arrival may change, in standard deviations: rounding.
const SAME: f64 = 1e-3;

/// Laws of a [`StateEstimator`], tried on flights that are made up of `trial`: what is measured is exact, `begin` makes the estimator anew
/// for every law.
///
/// # Errors
/// The first broken law: `everything is finite`, `exact data lead to the truth`, `stored momentum is accounted for`,
/// `the order of arrival is no matter`, `duplicates change nothing`, `what is no measurement changes nothing`,
/// `a rate without a pose is used`, `a doubt widens`, `a restart forgets`, `a restart keeps the motion`.
pub fn check_state_estimator(begin: BeginFlight<'_>, trial: &StateTrial) -> Result<(), LawViolation> {
    let flown = Flown::new(trial, Vector3::zeros())?;
    let start = flown.states.first().copied().unwrap_or_else(RigidBodyState::at_rest);
    let new = || done("an estimator begins", begin(&start, &trial.prior));
    let all = |period: usize, state: &RigidBodyState<f64>| Some(trial.seen(period, state));
    let punctual = |period: usize| period + 2;

    let mut ordered = new()?;
    told(&mut *ordered, &flown, &punctual, &all);
    let whole = known(&*ordered)?;
    leads_to_the_truth("exact data lead to the truth", &*ordered, trial, &flown)?;

    let storing = Flown::new(trial, trial.stored_body)?;
    let mut estimator = new()?;
    told(&mut *estimator, &storing, &punctual, &all);
    leads_to_the_truth("stored momentum is accounted for", &*estimator, trial, &storing)?;

    // The last ones are in time, so that both have seen the same.
    let mixed = |period: usize| {
        let late = if period + trial.lateness < trial.periods { (period * 37) % trial.lateness.max(3) } else { 0 };
        period + late.max(2)
    };
    let law = "the order of arrival is no matter";
    let mut estimator = new()?;
    told(&mut *estimator, &flown, &mixed, &all);
    require(law, &"knowledge", &whole, &known(&*estimator)?, apart(&whole, &known(&*estimator)?), SAME)?;
    let (expected, found) = (ordered.counts().used, estimator.counts().used);
    require(law, &"measurements used", &expected, &found, broken_unless(expected == found), 0.0)?;

    let law = "duplicates change nothing";
    let mut estimator = new()?;
    let mut twice = Vec::new();
    for (k, acted) in flown.acted.iter().enumerate() {
        estimator.acted(acted);
        let seen = |period: usize| flown.states.get(period).map(|state| trial.seen(period, state));
        let (Some(measurement), true) = (k.checked_sub(1).and_then(seen), k > 1) else { continue };
        estimator.measured(&measurement);
        twice.push(estimator.measured(&measurement));
    }
    let taken = twice.iter().filter(|reception| matches!(reception, Reception::Used { .. })).count();
    require(law, &"said again", &0, &taken, broken_unless(taken == 0), 0.0)?;
    let found = known(&*estimator)?;
    require(law, &"knowledge", &whole, &found, apart(&whole, &found), SAME)?;

    refuses_nonsense(&mut *estimator, trial, &flown)?;
    uses_rates(begin, trial, &flown, &start)?;

    let law = "a doubt widens";
    let before = known(&*ordered)?;
    ordered.doubt(&Doubt::Body(grasp_or_release()));
    let after = known(&*ordered)?;
    let narrowed = (0..10).map(|i| 1.0 - after.1[(i, i)] / before.1[(i, i)]).fold(f64::NEG_INFINITY, f64::max);
    require(law, &"a jump of the body", &before.1.diagonal(), &after.1.diagonal(), narrowed, 1e-6)?;
    let widened = after.1[(0, 0)] > 1.1 * before.1[(0, 0)];
    require(law, &"mass", &before.1[(0, 0)], &after.1[(0, 0)], broken_unless(widened), 0.0)?;
    // It may take back that of the body, and makes nothing surer than it was before.
    ordered.doubt(&Doubt::Wrench);
    let doubted = known(&*ordered)?;
    let narrowed = (0..10).map(|i| 1.0 - doubted.1[(i, i)] / before.1[(i, i)]).fold(f64::NEG_INFINITY, f64::max);
    require(law, &"a doubt of the wrench", &before.1.diagonal(), &doubted.1.diagonal(), narrowed, 1e-6)?;

    restarts(begin, trial, &flown, &start)
}

fn leads_to_the_truth(
    law: &'static str,
    estimator: &dyn StateEstimator,
    trial: &StateTrial,
    flown: &Flown,
) -> Result<(), LawViolation> {
    let (found, _) = known(estimator)?;
    let truth = trial.body.to_vector();
    let off = (found - truth).component_div(trial.prior.magnitudes()).amax();
    require(law, &"body", &truth, &found, off, trial.within)?;
    let (now, expected) = (motion(estimator, trial.end_ns())?, flown.states.last().copied());
    let Some(expected) = expected else { return Ok(()) };
    let (pose, twist) = (expected.world_from_body.between(&now.world_from_body), expected.twist_body);
    let off = LieGroup::log(&pose);
    let [attitude, position, rate, velocity] = trial.deviation;
    let worst = [
        off.fixed_rows::<3>(0).norm() / attitude,
        off.fixed_rows::<3>(3).norm() / position,
        (twist.angular - now.twist_body.angular).norm() / rate,
        (twist.linear - now.twist_body.linear).norm() / velocity,
    ];
    let worst = worst.into_iter().fold(0.0, f64::max);
    require(law, &"motion, in deviations of the measurements", &expected, &now, worst, 3.0)
}

fn refuses_nonsense(estimator: &mut dyn StateEstimator, trial: &StateTrial, flown: &Flown) -> Result<(), LawViolation> {
    let law = "what is no measurement changes nothing";
    let (before, there) = (known(estimator)?, motion(estimator, trial.end_ns())?);
    let Some(last) = flown.states.last() else { return Ok(()) };
    let good = trial.seen(trial.periods, last);
    let mut absurd = good.clone();
    absurd.position_world = absurd.position_world.map(|seen| Gauss { value: Vector3::repeat(f64::NAN), ..seen });
    let mut sure = good.clone();
    sure.rate_body = sure.rate_body.map(|seen| Gauss { covariance: -seen.covariance, ..seen });
    let old = Measurement { stamp_ns: i64::MIN, ..good.clone() };
    let future = Measurement { stamp_ns: i64::MAX, ..good };
    for measurement in [absurd, sure, old, future] {
        let reception = estimator.measured(&measurement);
        let used = matches!(reception, Reception::Used { .. } | Reception::Relocalised);
        require(law, &measurement, &"not used", &reception, broken_unless(!used), 0.0)?;
    }
    let end_ns = trial.end_ns();
    let wrench_body = Wrench::new(Vector3::repeat(f64::NAN), Vector3::zeros());
    estimator.acted(&Acted {
        from_ns: end_ns,
        until_ns: end_ns + trial.period_ns,
        wrench_body,
        stored_body: Vector3::zeros(),
    });
    let (after, here) = (known(estimator)?, motion(estimator, trial.end_ns())?);
    require(law, &"knowledge", &before, &after, apart(&before, &after), SAME)?;
    require(law, &"motion", &there, &here, broken_unless(there == here), 0.0)
}

/// Rates alone: they are used, the inertia is learned by them and the rate is right.
fn uses_rates(
    begin: BeginFlight<'_>,
    trial: &StateTrial,
    flown: &Flown,
    start: &RigidBodyState<f64>,
) -> Result<(), LawViolation> {
    let law = "a rate without a pose is used";
    let mut estimator = done("an estimator begins", begin(start, &trial.prior))?;
    let before = known(&*estimator)?;
    let rate = |period: usize, state: &RigidBodyState<f64>| {
        let rate_body = trial.seen(period, state).rate_body;
        Some(Measurement { stamp_ns: trial.at_ns(period), rate_body, ..Measurement::default() })
    };
    let receptions = told(&mut *estimator, flown, &|period| period + 2, &rate);
    let used = receptions.iter().filter(|reception| matches!(reception, Reception::Used { .. })).count();
    let share = used as f64 / receptions.len() as f64;
    require(law, &"share of rates used", &1.0, &share, 1.0 - share, 0.1)?;
    let after = known(&*estimator)?;
    for i in [4, 7, 9] {
        let ratio = (after.1[(i, i)] / before.1[(i, i)]).sqrt();
        require(law, &("narrower moment of inertia", i), &"below 0.5", &ratio, ratio, 0.5)?;
    }
    let now = motion(&*estimator, trial.end_ns())?.twist_body.angular;
    let expected = flown.states.last().map_or(now, |state| state.twist_body.angular);
    require(law, &"rate now", &expected, &now, (now - expected).norm() / trial.deviation[2], 3.0)
}

fn restarts(
    begin: BeginFlight<'_>,
    trial: &StateTrial,
    flown: &Flown,
    start: &RigidBodyState<f64>,
) -> Result<(), LawViolation> {
    let law = "a restart forgets";
    let fresh = known(&*done("an estimator begins", begin(start, &trial.prior))?)?;
    let mut estimator = done("an estimator begins", begin(start, &trial.prior))?;
    let all = |period: usize, state: &RigidBodyState<f64>| Some(trial.seen(period, state));
    told(&mut *estimator, flown, &|period| period + 2, &all);
    let newest_ns = estimator.newest_stamp_ns();
    let there = motion(&*estimator, newest_ns)?;
    done(law, estimator.restart(&trial.prior))?;
    let found = known(&*estimator)?;
    require(law, &"knowledge", &fresh, &found, apart(&fresh, &found), 1e-3)?;
    let here = motion(&*estimator, newest_ns)?;
    let moved = LieGroup::log(&there.world_from_body.between(&here.world_from_body)).amax();
    let moved = moved.max((there.twist_body.to_vector() - here.twist_body.to_vector()).amax());
    require("a restart keeps the motion", &"motion", &there, &here, moved, 1e-6)
}
