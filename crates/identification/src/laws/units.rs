//! The law that no unit decides: of a whole identification, and of a flight.

use super::broken_unless;
use super::estimator::ANSWERED;
use super::recursive_estimator::{Short, violation};
use super::state_estimator::{Flown, StateTrial, done, known, motion, told};
use crate::dynamics::{InertialParameters, RigidBodyState};
use crate::estimator::{Acted, EstimatorError, Finding, StateEstimator};
use crate::lie::{LieGroup, Pose, Twist, Wrench};
use crate::motion::MotionSample;
use crate::{Identification, Settings};
use nalgebra::{SMatrix, SVector};
use std::boxed::Box;
use tumble_lie::laws::{LawViolation, require};

/// Units of mass, length and time, each by how many of them make a kilogram, a metre, a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// Units of mass in a kilogram.
    pub mass: f64,
    /// Units of length in a metre.
    pub length: f64,
    /// Units of time in a second.
    pub time: f64,
}

impl Units {
    fn force(&self) -> f64 {
        self.mass * self.length / (self.time * self.time)
    }

    fn wrench(&self, wrench: Wrench<f64>) -> Wrench<f64> {
        Wrench::new(wrench.torque * (self.force() * self.length), wrench.force * self.force())
    }

    fn pose(&self, pose: &Pose<f64>) -> Pose<f64> {
        Pose::from_parts((pose.translation.vector * self.length).into(), pose.rotation)
    }

    #[allow(clippy::cast_possible_truncation)] // saturates
    fn time_ns(&self, time_ns: i64) -> i64 {
        (time_ns as f64 * self.time).round() as i64
    }

    fn state(&self, state: &RigidBodyState<f64>) -> RigidBodyState<f64> {
        let Twist { angular, linear } = state.twist_body;
        let twist_body = Twist::new(angular / self.time, linear * (self.length / self.time));
        RigidBodyState { world_from_body: self.pose(&state.world_from_body), twist_body }
    }

    fn finding(&self, finding: &Finding) -> Result<Finding, EstimatorError> {
        let map = self.parameters();
        let point = finding.point().copied().unwrap_or_else(SVector::zeros);
        Finding::of_covariance(map * point, &(map * finding.covariance()? * map), map * finding.magnitudes())
    }

    fn trial(&self, trial: &StateTrial) -> Result<StateTrial, EstimatorError> {
        let ([torque, force], [attitude, position, rate, velocity]) = (trial.wrench, trial.deviation);
        Ok(StateTrial {
            body: InertialParameters::from_vector(&(self.parameters() * trial.body.to_vector())),
            prior: self.finding(&trial.prior)?,
            period_ns: self.time_ns(trial.period_ns),
            wrench: [torque * self.force() * self.length, force * self.force()],
            stored_body: trial.stored_body * (self.force() * self.length * self.time),
            deviation: [attitude, position * self.length, rate / self.time, velocity * self.length / self.time],
            ..*trial
        })
    }

    fn flown(&self, flown: &Flown) -> Flown {
        let acted = |acted: &Acted| Acted {
            from_ns: self.time_ns(acted.from_ns),
            until_ns: self.time_ns(acted.until_ns),
            wrench_body: self.wrench(acted.wrench_body),
            stored_body: acted.stored_body * (self.force() * self.length * self.time),
        };
        Flown {
            states: flown.states.iter().map(|state| self.state(state)).collect(),
            acted: flown.acted.iter().map(acted).collect(),
        }
    }

    /// A record as told in these units. Times are whole nanoseconds: a step must stay many of them.
    #[must_use]
    pub fn record(&self, record: &[MotionSample]) -> Vec<MotionSample> {
        let (force, speed) = (self.force(), self.length / self.time);
        let wrench = |w: Wrench<f64>| self.wrench(w);
        let told = |sample: &MotionSample| MotionSample {
            time_ns: self.time_ns(sample.time_ns),
            world_from_body: sample.world_from_body.map(|pose| self.pose(&pose)),
            velocity_origin_world: sample.velocity_origin_world.map(|v| v * speed),
            rate_body: sample.rate_body.map(|w| w / self.time),
            acceleration_origin_body: sample.acceleration_origin_body.map(|a| a * (speed / self.time)),
            wrench_body: sample.wrench_body.map(wrench),
            besides_body: sample.besides_body.map(wrench),
            stored_momentum_body: sample.stored_momentum_body.map(|h| h * (force * self.length * self.time)),
        };
        record.iter().map(told).collect()
    }

    /// From the ten parameters in SI units to those in these.
    #[must_use]
    pub fn parameters(&self) -> SMatrix<f64, 10, 10> {
        SMatrix::from_diagonal(&SVector::from_fn(|i, _| match i {
            0 => self.mass,
            1..=3 => self.mass * self.length,
            _ => self.mass * self.length * self.length,
        }))
    }
}

/// What the law asks to identify a record with given settings.
pub type Identifies<'a> = dyn Fn(&[MotionSample], &Settings) -> Result<Identification, EstimatorError> + 'a;

/// The law of an identification that no unit decides: told in each of `units`, the record gives the same method, rows and rank, the same
/// verdict, and the same body.
///
/// `identify` is given the settings of each telling, gravity in its units; a prior has no place in this law. `tolerance` is the largest
/// difference of a parameter that is still rounding, in standard deviations; of a standard deviation a hundredth may change.
///
/// # Errors
/// The first broken law: `a good record is answered`, `units do not decide`, `units do not matter`.
pub fn check_identification_units(
    identify: &Identifies<'_>,
    record: &[MotionSample],
    settings: &Settings,
    units: &[Units],
    tolerance: f64,
) -> Result<(), LawViolation> {
    let found = |record: &[MotionSample], settings: &Settings, of: &dyn core::fmt::Debug| {
        identify(record, settings).map_err(|error| violation(ANSWERED, std::format!("{of:?}"), &error))
    };
    let one = found(record, settings, &"SI units")?;
    for units in units {
        let gravity_world = settings.gravity_world * (units.length / (units.time * units.time));
        let other = found(&units.record(record), &Settings { gravity_world, ..*settings }, units)?;
        let law = "units do not decide";
        let decided = |found: &Identification| {
            let verdict = core::mem::discriminant(&found.verdict);
            (found.method, found.lag, found.rank, found.samples_used, found.silence, verdict, found.determined())
        };
        let (expected, answer) = (decided(&one), decided(&other));
        require(law, units, &expected, &answer, broken_unless(expected == answer), 0.0)?;
        let law = "units do not matter";
        let both = [one.estimate.or(one.regularised), other.estimate.or(other.regularised)];
        let [Some(here), Some(there)] = both else { continue };
        let map = units.parameters();
        let expected = map * here.parameters.to_vector();
        let deviation = (map * here.covariance * map.transpose()).diagonal().map(f64::sqrt);
        let body = there.parameters.to_vector();
        let apart = (body - expected).component_div(&deviation).amax();
        require(law, units, &Short(&expected), &Short(&body), apart, tolerance)?;
        let said = there.covariance.diagonal().map(f64::sqrt);
        let ratio = said.component_div(&deviation).map(|ratio| (ratio - 1.0).abs()).amax();
        require(law, &(units, "sigmas"), &Short(&deviation), &Short(&said), ratio, tolerance.max(0.01))?;
    }
    Ok(())
}

/// Makes the estimator under trial, told all that it is told in these units, from a motion at time zero.
pub type BeginFlightIn<'a> =
    &'a dyn Fn(&Units, &RigidBodyState<f64>, &Finding) -> Result<Box<dyn StateEstimator>, EstimatorError>;

/// The law of an estimator in flight that no unit decides: told in each of `units`, a flight made up of `trial` is received alike, and gives the
/// same body and the same motion. Only an estimator without steps and patience of its own, in seconds, keeps it in other units of time.
///
/// `tolerance` is the largest difference that is still rounding: of a parameter in its standard deviations, of the motion at the end in those of the
/// measurements; of a standard deviation a hundredth may change.
///
/// # Errors
/// The first broken law: `units do not decide`, `units do not matter`, or one of
/// [`check_state_estimator`](super::check_state_estimator).
pub fn check_flight_units(
    begin: BeginFlightIn<'_>,
    trial: &StateTrial,
    units: &[Units],
    tolerance: f64,
) -> Result<(), LawViolation> {
    let flown = Flown::new(trial, trial.stored_body)?;
    let fly = |units: &Units, trial: &StateTrial, flown: &Flown| {
        let start = flown.states.first().copied().unwrap_or_else(RigidBodyState::at_rest);
        let mut estimator = done("an estimator begins", begin(units, &start, &trial.prior))?;
        let seen = |period: usize, state: &RigidBodyState<f64>| Some(trial.seen(period, state));
        let receptions = told(&mut *estimator, flown, &|period| period + 2, &seen);
        let received = receptions.iter().map(core::mem::discriminant).collect::<std::vec::Vec<_>>();
        Ok::<_, LawViolation>((received, known(&*estimator)?, motion(&*estimator, trial.end_ns())?))
    };
    let (expected, (body, covariance), here) = fly(&Units { mass: 1.0, length: 1.0, time: 1.0 }, trial, &flown)?;
    for units in units {
        let trial = done("the trial can be told", units.trial(trial))?;
        let (received, (point, spread), there) = fly(units, &trial, &units.flown(&flown))?;
        let apart = received.iter().zip(&expected).filter(|(one, other)| one != other).count();
        require("units do not decide", units, &"received alike", &apart, broken_unless(apart == 0), 0.0)?;
        let (law, map) = ("units do not matter", units.parameters());
        let expected = map * body;
        let deviation = (map * covariance * map).diagonal().map(f64::sqrt);
        let apart = (point - expected).component_div(&deviation).amax();
        require(law, units, &Short(&expected), &Short(&point), apart, tolerance)?;
        let said = spread.diagonal().map(f64::sqrt);
        let ratio = said.component_div(&deviation).map(|ratio| (ratio - 1.0).abs()).amax();
        require(law, &(units, "sigmas"), &Short(&deviation), &Short(&said), ratio, tolerance.max(0.01))?;
        let expected = units.state(&here);
        let [attitude, position, rate, velocity] = trial.deviation;
        let off = LieGroup::log(&expected.world_from_body.between(&there.world_from_body));
        let twist = (expected.twist_body.to_vector(), there.twist_body.to_vector());
        let faster = twist.1 - twist.0;
        let worst = [
            off.fixed_rows::<3>(0).norm() / attitude,
            off.fixed_rows::<3>(3).norm() / position,
            faster.fixed_rows::<3>(0).norm() / rate,
            faster.fixed_rows::<3>(3).norm() / velocity,
        ];
        let worst = worst.into_iter().fold(0.0, f64::max);
        require(law, &(units, "motion"), &expected, &there, worst, tolerance)?;
    }
    Ok(())
}
