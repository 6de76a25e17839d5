//! The estimator in the loop of a flight: motion now and ten parameters from late, unordered, doubtful measurements.

mod axis_errors;
mod body_score;
mod doubted;
mod erring_thrusters;
mod filtered;
mod first_lessons;
mod flight_motion;
mod health;
mod moved_map;
mod reception;
mod separate_bias;
mod settings;
mod slow_errors;
mod suspects;
mod two_stage;
mod wrench_history;

#[cfg(test)]
mod tests;

pub use axis_errors::AxisErrors;
pub use erring_thrusters::{ErringThruster, Suspect, THRUSTERS};
pub use health::FlightHealth;
pub use reception::{FlightMeasurement, Reception, ReceptionCounts};
pub use settings::{FlightEstimatorSettings, LearningTargets, WrenchErrors, grasp_or_release};
pub use slow_errors::{FilterMemory, GaussMarkov, SlowErrors};
pub use two_stage::{BeginStage, BodyStage, TwoStageEstimator, WindowRows};

use crate::dynamics::{InertialParameters, LogCholesky, RigidBodyState};
use crate::error::IdentificationError;
use crate::estimator::standard_deviations;
use crate::estimator::{Acted, Doubt, EstimatorError, Finding, Measurement, StateEstimator};
use crate::lie::Wrench;
use crate::recursive::belief::symmetric;
use crate::recursive::joint_motion::{JointState, parameters_by_chart};
use crate::{BodyScale, Estimate};
use body_score::ScoreLimits;
use filtered::{Filtered, Rules, in_chart};
use first_lessons::{FirstLessons, WORK};
use flight_motion::{BODY, FlightMotion, FlightState};
use health::Thresholds;
use nalgebra::{SMatrix, SVector, Vector3};
use reception::{checked, kinds};
use std::collections::VecDeque;
use suspects::Suspects;
use wrench_history::WrenchHistory;

/// Moments kept: more than a second of measurements at 62.5 Hz.
const MOMENTS: usize = 128;
/// Most parts of one measurement that come from different moments.
const PARTS: usize = 4;
/// Without measurements the filter follows at this distance behind the oldest one that may still come.
const COAST_NS: i64 = 64_000_000;

/// What happened at a moment of the stream.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // nothing is allocated in flight
enum Event {
    Start,
    Coasted,
    Measured(Measurement),
    Changed(SVector<f64, 10>),
    WrenchDoubted,
    Restarted(LogCholesky<f64>, SMatrix<f64, 10, 10>),
    Revised(LogCholesky<f64>, SMatrix<f64, 10, 10>),
}

/// Motion and body of a free flyer, filtered at the stamps of its measurements.
///
/// An extended Kalman filter on motion, the [`LogCholesky`] coordinates of the body, and slow errors of the believed wrench:
/// an additive one that drifts, and a constant relative one of each component. The filter after every measurement of the last
/// second is kept; a measurement that comes late is put in its place and those after it are filtered again, so that the result
/// is that of the measurements in order.
///
/// Time passes by [`acted`](Self::acted): where nothing has been acted, no wrench is believed. Nothing here panics, and
/// nothing allocates after [`try_new`](Self::try_new).
///
/// # Source
/// Thesis table A.2, (6.10), (6.11), (6.31).
#[derive(Clone, Debug)]
pub struct FlightEstimator {
    rules: Rules,
    history: WrenchHistory,
    events: VecDeque<Event>,
    /// The filter after each event; large, so that those behind one that comes late do not move.
    moments: VecDeque<Box<Filtered>>,
    /// Room for those that come.
    spare: Vec<Box<Filtered>>,
    /// Events up to this place, itself included, are in `lessons`.
    settled: usize,
    /// Events that were kept once.
    dropped: u64,
    /// Large, as all filters are: an estimator that is handed about fits the stack of any thread.
    lessons: Box<FirstLessons>,
    suspects: Box<Suspects>,
    /// Of those that never entered the stream.
    apart: ReceptionCounts,
    known: bool,
    scale: BodyScale,
}

impl FlightEstimator {
    /// Begins at `start` with the knowledge of a body; the covariance is that of
    /// [`InertialParameters::to_vector`](crate::dynamics::InertialParameters::to_vector).
    ///
    /// # Errors
    /// [`IdentificationError::NotPositive`] and [`NotAProbability`](IdentificationError::NotAProbability) for the settings, a
    /// prior that is no body or whose covariance is none.
    pub fn try_new(
        settings: FlightEstimatorSettings,
        start: RigidBodyState<f64>,
        start_ns: i64,
        prior: &Estimate,
    ) -> Result<Self, IdentificationError> {
        settings.check()?;
        let (body, covariance) = in_chart(prior)?;
        let scale = BodyScale::of(&prior.parameters.to_vector())?;
        let finite = |x: &f64| x.is_finite();
        let pose = &start.world_from_body;
        let twist = start.twist_body.to_vector();
        if !(pose.rotation.coords.iter().all(finite) && pose.translation.vector.iter().chain(&twist).all(finite)) {
            return Err(IdentificationError::NotFinite { row: 0 });
        }
        #[allow(clippy::cast_possible_truncation)] // saturates
        let ns = |seconds: f64| (seconds * 1e9) as i64;
        let rules = Rules {
            settings,
            model: FlightMotion::new(&settings),
            doubting: FlightMotion::new(&settings).doubting(),
            thresholds: Thresholds::try_new(&settings)?,
            score_limits: ScoreLimits::try_new()?,
            first_body: body,
            relocalise_after_ns: ns(settings.relocalise_after_s),
            lateness_ns: ns(settings.lateness_s),
            lead_ns: ns(settings.lead_s),
            considers_body: false,
        };
        let state = FlightState::of(JointState { motion: start, body });
        let most = MOMENTS + PARTS;
        let (mut events, mut moments) = (VecDeque::with_capacity(most), VecDeque::with_capacity(most));
        events.push_back(Event::Start);
        let first = Filtered::new(&rules, &state, &covariance, start_ns);
        moments.push_back(Box::new(first));
        let lessons = Box::new(FirstLessons::new(&first));
        let history = WrenchHistory::new(start_ns);
        Ok(Self {
            rules,
            history,
            events,
            moments,
            spare: vec![Box::new(first); most - 1],
            settled: 0,
            dropped: 0,
            lessons,
            suspects: Box::new(Suspects::NONE),
            apart: ReceptionCounts::default(),
            known: false,
            scale,
        })
    }

    /// The believed wrench of a control period, after saturation; body axes, torque about the origin, without gravity.
    ///
    /// Said again of the same time, or of a time already filtered, it replaces what was believed. Spans that are empty and
    /// wrenches that are not finite are passed over.
    pub fn acted(&mut self, from_ns: i64, until_ns: i64, wrench_body: &Wrench<f64>) {
        self.hold(&Acted { from_ns, until_ns, wrench_body: *wrench_body, stored_body: Vector3::zeros() });
    }

    fn hold(&mut self, acted: &Acted) {
        let Acted { from_ns, until_ns, wrench_body, stored_body } = acted;
        let (from_ns, until_ns) = (*from_ns, *until_ns);
        let finite = |x: &f64| x.is_finite();
        if until_ns <= from_ns || !wrench_body.to_vector().iter().chain(stored_body).all(finite) {
            return;
        }
        self.history.hold(from_ns, until_ns, wrench_body, stored_body);
        let first = self.moments.partition_point(|moment| moment.stamp_ns <= from_ns);
        // What is settled stays.
        let first = first.max(self.settled + 1);
        self.filter_from(first, first);
        let horizon_ns = self.history.end_ns().saturating_sub(self.rules.lateness_ns);
        while self.newest().stamp_ns < horizon_ns.saturating_sub(COAST_NS) {
            // A pause of hours is one step of the ring.
            let behind_ns = horizon_ns - self.newest().stamp_ns;
            let stamp_ns = self.newest().stamp_ns.saturating_add(COAST_NS.max(behind_ns / 64));
            self.happen_at(stamp_ns, Event::Coasted);
        }
        self.settle(horizon_ns);
    }

    /// Hands on what nothing can come before any more, and goes on with what is to be learned again.
    fn settle(&mut self, horizon_ns: i64) {
        while let (Some(event), Some(moment)) = (self.events.get(self.settled + 1), self.moments.get(self.settled + 1))
        {
            if moment.stamp_ns >= horizon_ns {
                break;
            }
            match event {
                Event::Measured(measurement) => self.lessons.keep(measurement),
                Event::Changed(_) | Event::WrenchDoubted => {
                    // Who is named stays so.
                    if self.suspects.named.is_none()
                        && let Some(before) = self.moments.get(self.settled)
                    {
                        self.suspects.begin(before, moment);
                    }
                    self.lessons.begin_at(moment);
                }
                Event::Restarted(..) => {
                    self.suspects.end();
                    self.lessons.begin_at(moment);
                }
                Event::Start | Event::Coasted | Event::Revised(..) => {}
            }
            self.settled += 1;
        }
        if self.rules.considers_body {
            return;
        }
        let Some(settled) = self.moments.get_mut(self.settled) else { return };
        let mut work = WORK;
        let Some(learned) = self.lessons.learned(&self.rules, &self.history, settled, &mut work) else {
            let measured = self.lessons.measurements();
            self.suspects.go_on(&self.rules, &self.history, measured, &mut work, settled);
            return;
        };
        **settled = learned;
        self.filter_from(self.settled + 1, self.settled + 1);
    }

    /// Takes a measurement, which may be late, out of order, doubled or absurd.
    pub fn measured(&mut self, measurement: &FlightMeasurement) -> Reception {
        self.look_at(&measurement.with(&self.rules.settings.noise))
    }

    /// Takes each quantity at the time of its content, which may be older than the stamp by more for one than for another.
    fn look_at(&mut self, measurement: &Measurement) -> Reception {
        let [poses, velocities, rates, accelerations] = self.rules.settings.slow.age_ns;
        if [velocities, rates, accelerations] == [poses; 3] {
            return self.look_at_parts([(measurement.clone(), poses)]);
        }
        let nothing = Measurement { stamp_ns: measurement.stamp_ns, ..Measurement::default() };
        let of_pose =
            Measurement { rate_body: None, velocity_world: None, acceleration_body: None, ..measurement.clone() };
        let parts: [(Measurement, i64); PARTS] = [
            (Measurement { velocity_world: measurement.velocity_world, ..nothing.clone() }, velocities),
            (Measurement { rate_body: measurement.rate_body, ..nothing.clone() }, rates),
            (Measurement { acceleration_body: measurement.acceleration_body, ..nothing }, accelerations),
            (of_pose, poses),
        ];
        let says = |part: &Measurement| kinds(part).contains(&true);
        if parts.iter().any(|(part, _)| says(part)) {
            self.look_at_parts(parts.into_iter().filter(|(part, _)| says(part)))
        } else {
            self.look_at_parts([(measurement.clone(), 0)])
        }
    }

    /// Puts parts of a measurement in their places before the filter begins again at the first of them; what became of the last.
    fn look_at_parts(&mut self, parts: impl IntoIterator<Item = (Measurement, i64)>) -> Reception {
        let (mut first, mut last) = (None, Ok(0));
        for (mut part, age_ns) in parts {
            part.stamp_ns = part.stamp_ns.saturating_sub(age_ns);
            last = self.receive(&part);
            match last {
                Ok(place) => first = Some(first.map_or(place, |first: usize| first.min(place))),
                Err(Reception::TooOld) => self.apart.too_old += 1,
                Err(Reception::Duplicate) => self.apart.duplicate += 1,
                Err(Reception::FromTheFuture) => self.apart.from_the_future += 1,
                Err(_) => self.apart.malformed += 1,
            }
        }
        let filtered = first.map(|first| self.filter_from(first, last.unwrap_or(first)));
        match last {
            Ok(_) => filtered.unwrap_or(Reception::Frozen),
            Err(refused) => refused,
        }
    }

    /// Puts a measurement in its place, and says where that is, or why it has none.
    fn receive(&mut self, measurement: &Measurement) -> Result<usize, Reception> {
        let checked = match checked(measurement) {
            Ok(checked) => checked,
            Err(what) => return Err(Reception::Malformed { what }),
        };
        let (stamp_ns, clock_ns) = (checked.stamp_ns, self.history.end_ns());
        if stamp_ns > clock_ns.saturating_add(self.rules.lead_ns) {
            return Err(Reception::FromTheFuture);
        }
        let same = |event: &Event| matches!(event, Event::Measured(known) if known.stamp_ns == stamp_ns);
        let companion = self.events.iter().position(same);
        if let Some(Event::Measured(known)) = companion.and_then(|place| self.events.get(place))
            && kinds(known).iter().zip(kinds(&checked)).any(|(known, new)| *known && new)
        {
            return Err(Reception::Duplicate);
        }
        let oldest_ns = self.moments.front().map_or(i64::MAX, |moment| moment.stamp_ns);
        if stamp_ns < clock_ns.saturating_sub(self.rules.lateness_ns) || stamp_ns < oldest_ns {
            return Err(Reception::TooOld);
        }
        let place =
            companion.unwrap_or_else(|| self.moments.partition_point(|moment| moment.stamp_ns <= stamp_ns).max(1));
        let after = place + usize::from(companion.is_some());
        let later = self.events.iter().skip(after).any(|event| matches!(event, Event::Measured(_)));
        self.apart.replayed += u64::from(later);
        if let Some(Event::Measured(known)) = self.events.get_mut(place).filter(|_| companion.is_some()) {
            // Quantities of one moment are one measurement, in whatever order they came.
            known.attitude = known.attitude.or(checked.attitude);
            known.position_world = known.position_world.or(checked.position_world);
            known.rate_body = known.rate_body.or(checked.rate_body);
            known.velocity_world = known.velocity_world.or(checked.velocity_world);
            known.acceleration_body = known.acceleration_body.or(checked.acceleration_body);
            known.other = known.other.take().or(checked.other);
        } else {
            self.insert(place, stamp_ns, Event::Measured(checked));
        }
        Ok(place)
    }

    /// Puts an event in its place.
    fn insert(&mut self, place: usize, stamp_ns: i64, event: Event) {
        // All but the stamp is written by the filter.
        let mut moment = self.spare.pop().unwrap_or_else(|| Box::new(*self.newest()));
        moment.stamp_ns = stamp_ns;
        self.events.insert(place, event);
        self.moments.insert(place, moment);
    }

    /// Something happens after all that is known of until then.
    fn happen_at(&mut self, stamp_ns: i64, event: Event) {
        let place = self.moments.partition_point(|moment| moment.stamp_ns <= stamp_ns).max(1);
        self.insert(place, stamp_ns, event);
        self.filter_from(place, place);
    }

    /// Filters again from an event on, and forgets what is too long ago; what became of the event at `wanted`.
    fn filter_from(&mut self, first: usize, wanted: usize) -> Reception {
        let mut answer = Reception::Frozen;
        for k in first..self.moments.len() {
            let mut pair = self.moments.range_mut(k - 1..=k);
            let (Some(before), Some(filtered), Some(event)) = (pair.next(), pair.next(), self.events.get(k)) else {
                break;
            };
            let stamp_ns = filtered.stamp_ns;
            filtered.clone_from(before);
            filtered.advance(&self.rules, &self.history, stamp_ns);
            let reception = match event {
                Event::Measured(measurement) => filtered.take(&self.rules, &self.history, measurement),
                Event::Changed(deviation) => {
                    filtered.widen(&self.rules, deviation);
                    Reception::Frozen
                }
                Event::WrenchDoubted => {
                    filtered.doubt_wrench(&self.rules);
                    Reception::Frozen
                }
                Event::Restarted(body, covariance) => {
                    filtered.restart(&self.rules, body, covariance);
                    Reception::Frozen
                }
                Event::Revised(body, covariance) => {
                    filtered.revise(body, covariance);
                    Reception::Frozen
                }
                Event::Start | Event::Coasted => Reception::Frozen,
            };
            if k == wanted {
                answer = reception;
            }
        }
        while self.moments.len() > MOMENTS {
            self.events.pop_front();
            self.spare.extend(self.moments.pop_front());
            self.dropped += 1;
            self.settled = self.settled.saturating_sub(1);
        }
        answer
    }

    fn newest(&self) -> &Filtered {
        // The ring is never empty.
        &self.moments[self.moments.len() - 1]
    }

    /// The newest filtered motion, carried on to a time by the believed wrenches under the believed body; for times that are
    /// past, the motion filtered until then.
    pub fn state_at(&self, time_ns: i64) -> RigidBodyState<f64> {
        let until = self.moments.partition_point(|moment| moment.stamp_ns <= time_ns);
        let from = &self.moments[until.max(1) - 1];
        from.state_at(&self.rules, &self.history, time_ns).joint.motion
    }

    /// The ten parameters with their covariance; always a body that exists.
    pub fn estimate(&self) -> Estimate {
        let newest = self.newest();
        let parameters = newest.state.joint.body.to_parameters();
        let slopes = parameters_by_chart(newest.about.as_ref().unwrap_or(&newest.state.joint.body));
        let body = newest.covariance.fixed_view::<10, 10>(BODY, BODY);
        let covariance = self.stated(&parameters, &symmetric(&(slopes * body * slopes.transpose())));
        let std = standard_deviations(&parameters.to_vector(), &covariance);
        Estimate { parameters, covariance, std, lmi_active: false }
    }

    /// What is stated of a body: what the filter believes of it, and what the axes of the gyroscope are off by.
    fn stated(&self, body: &InertialParameters<f64>, believed: &SMatrix<f64, 10, 10>) -> SMatrix<f64, 10, 10> {
        let mut stated = *believed;
        let mut inertia = stated.fixed_view_mut::<6, 6>(4, 4);
        inertia += self.rules.settings.slow.rate_axes.of_inertia(&body.inertia_about_com());
        stated
    }

    /// Covariance of an increment of the newest filtered motion, as [`RigidBodyState`] moves: pose, then twist, each angular
    /// before linear.
    pub fn motion_covariance(&self) -> SMatrix<f64, 12, 12> {
        self.newest().covariance.fixed_view::<BODY, BODY>(0, 0).into_owned()
    }

    /// Stamp of the newest measurement that was looked at, ns; the start before the first.
    pub fn newest_stamp_ns(&self) -> i64 {
        self.newest().measured_ns
    }

    /// What became of the measurements.
    pub fn counts(&self) -> ReceptionCounts {
        let stream = &self.newest().counts;
        ReceptionCounts {
            used: stream.used,
            gated: stream.gated,
            relocalised: stream.relocalised,
            frozen: stream.frozen,
            ..self.apart
        }
    }

    /// Whether the filter's own account of its errors is still true.
    pub fn health(&self) -> FlightHealth {
        let newest = self.newest();
        FlightHealth {
            relearning: self.lessons.are_underway(newest),
            thrust_doubtful: self.suspects.is_thrust,
            thrust_acquitted: self.suspects.is_acquitted,
            suspect: self.suspects.named,
            ..newest.monitor.health()
        }
    }

    /// The body back to a prior from now on, the motion kept, the wander of the localisation as loud as the settings state. Called again and again for
    /// longer than six seconds, less than five apart, it also makes the motion less certain: no jump that comes back lasts so long.
    ///
    /// # Errors
    /// As [`try_new`](Self::try_new) for the prior; nothing is changed then.
    pub fn restart(&mut self, prior: &Estimate) -> Result<(), IdentificationError> {
        let (body, covariance) = in_chart(prior)?;
        self.happen_now(Event::Restarted(body, covariance));
        Ok(())
    }

    /// Less certainty of the body from now on, each of its ten coordinates by a jump of this standard deviation, the motion
    /// kept: something was grasped or released; see [`grasp_or_release`]. What is not finite widens nothing. Once, the wrench is
    /// allowed to be off as well, by what is [`WrenchErrors::doubted`].
    pub fn body_changed(&mut self, deviation: &SVector<f64, 10>) {
        self.happen_now(Event::Changed(deviation.map(|s| if s.is_finite() { s } else { 0.0 })));
    }

    /// Actuators do not do what they are told: from now on, for good, the wrench may be off by what is
    /// [`WrenchErrors::doubted`], and each thruster by half of what it gives, whatever was known before. The body is again what it was known to be five
    /// to ten seconds before it was first doubted, less certain by a third of the way to what it has been taken for since, and learned on only where its
    /// mass was not known to a tenth: no motion tells it from such thrust.
    /// Motion and slow errors of the sensors are less certain, too, once.
    pub fn wrench_doubtful(&mut self) {
        self.happen_now(Event::WrenchDoubted);
    }

    /// What to ask of doubted actuators for a wrench in body axes, by their errors as far as they are known; `None` where they are
    /// not in doubt, and may be asked for the wrench itself.
    pub fn compensated(&self, wrench_body: &Wrench<f64>) -> Option<Wrench<f64>> {
        self.newest().compensated(&self.rules, wrench_body)
    }

    fn happen_now(&mut self, event: Event) {
        self.known = false;
        let stamp_ns = self.history.end_ns().max(self.newest().stamp_ns);
        self.happen_at(stamp_ns, event);
    }

    /// Whether every reported interval is inside its target; once it was, each may be a quarter wider.
    pub fn is_known_well_enough(&mut self, targets: &LearningTargets) -> bool {
        self.known = targets.are_met(&self.estimate(), self.known);
        self.known
    }

    /// The settings.
    pub fn settings(&self) -> &FlightEstimatorSettings {
        &self.rules.settings
    }
}

impl StateEstimator for FlightEstimator {
    fn acted(&mut self, acted: &Acted) {
        self.hold(acted);
    }
    fn measured(&mut self, measurement: &Measurement) -> Reception {
        self.look_at(measurement)
    }
    fn state_at(&self, time_ns: i64) -> RigidBodyState<f64> {
        self.state_at(time_ns)
    }
    fn finding(&self) -> Result<Finding, EstimatorError> {
        self.estimate().to_finding(self.scale)
    }
    fn health(&self) -> FlightHealth {
        self.health()
    }
    fn newest_stamp_ns(&self) -> i64 {
        self.newest_stamp_ns()
    }
    fn doubt(&mut self, doubt: &Doubt) {
        match doubt {
            Doubt::Body(deviation) => self.body_changed(deviation),
            Doubt::Wrench => self.wrench_doubtful(),
        }
    }
    fn restart(&mut self, body: &Finding) -> Result<(), EstimatorError> {
        Ok(self.restart(&Estimate::try_from(body)?)?)
    }
    fn counts(&self) -> ReceptionCounts {
        self.counts()
    }
    fn compensated(&self, wrench_body: &Wrench<f64>) -> Option<Wrench<f64>> {
        self.compensated(wrench_body)
    }
}
