//! The recursive estimators over a whole record.

use super::fit::Fit;
use super::likelihood::{estimator, is_known};
use super::noise::SampleNoise;
use super::plan::{Plan, Way};
use super::rows::Scheme;
use super::settings::Settings;
use super::solution::weak_prior;
use super::timeline::Timeline;
use super::verdict::Beside;
use crate::WrenchTiming;
use crate::beside::{environment, stored_momenta};
use crate::body_scale::BodyScale;
use crate::consistency::PseudoInertiaCone;
use crate::dynamics::{LogCholesky, RigidBodyState};
use crate::error::IdentificationError;
use crate::estimator::Finding;
use crate::lie::{LieGroup, Twist, Wrench};
use crate::motion::MotionSample;
use crate::motion::Noise;
use crate::recursive::{
    ChiSquareGate, ExtendedKalmanFilter, FilterModel, JointMotion, JointObservation, JointState, LinearObservation,
    MotionNoise, RecursiveLeastSquares, RecursiveSdp, RowsOutcome, UnscentedKalmanFilter,
};
use crate::units::Units;
use crate::weighted_least_squares::{WeightedLeastSquares, WrenchRow};
use nalgebra::{SMatrix, SVector, Vector3, Vector6};

/// Standard deviations of the vague start, in units of the body's own scale.
const VAGUE: f64 = 30.0;
/// The covariance form resolves no noise below this fraction of the wrench.
const RESOLUTION: f64 = 1e-5;
/// Noise of a measured pose is not believed below this fraction of the body's length (or of a radian).
const POSE_FLOOR: f64 = 1e-7;
/// Length of the first rows that a filter begins with, s, and the fraction of the body's scale to which they must know it.
const FIRST_SPAN_S: f64 = 3.0;
const BEGUN: f64 = 0.1;
/// Where a filter begun so flies off it begins later, by what longer stretches know so much better each.
const LATER: [f64; 2] = [0.3, 0.1];
/// Squared distances per parameter from another finding of the same record, in units of the filter's covariance: from the first on it is
/// visible, for both have seen the same noise; beyond the second it is for the judge to say that they disagree.
const VISIBLE_PER_PARAMETER: f64 = 0.5;
const DISAGREEING_PER_PARAMETER: f64 = 8.0;
/// Rejects only what is beyond doubt.
const GATE: f64 = 0.9999;
/// Wrench noise tried, as fractions of the residual of the rows, which noise in the poses may have inflated.
const WRENCH_NOISE: [f64; 9] = [1.0, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4];
/// Then steps of these factors, together and apart, each with a pass linearised about the last one.
const REFINEMENTS: [f64; 5] = [3.0, 3.0, 2.0, 1.5, 1.25];

/// What took the place of the batch solution of a fit, or did not.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Replaced {
    /// Where a filter lost its way; the batch solution stays.
    pub(super) diverged_ns: Option<i64>,
    /// For the judge.
    pub(super) beside: Beside,
}

/// Puts the end of a recursion over the record in the place of the batch solution; where that does not exist, the rows do
/// not determine ten parameters and a recursion would only repeat its prior. `other` is what a judge holds it against.
pub(super) fn run(
    fit: &mut Fit,
    record: &[MotionSample],
    plan: &Plan<'_>,
    noise: &SampleNoise,
    other: Option<&Finding>,
) -> Result<Replaced, IdentificationError> {
    let mut beside = Beside { surprise: None, other: other.copied() };
    match plan.way {
        Way::Rls => rls(fit)?,
        Way::RecursiveSdp => recursive_sdp(fit)?,
        Way::Ekf | Way::Ukf => match filtered(fit, record, plan.settings, noise, plan.way == Way::Ukf) {
            Ok(surprise) => {
                beside.surprise = surprise;
                widen_by_linearisation(fit, other);
            }
            Err(Flown::Off { time_ns }) => return Ok(Replaced { diverged_ns: Some(time_ns), ..Replaced::default() }),
            Err(Flown::Into(error)) => return Err(error),
        },
        _ => {}
    }
    Ok(Replaced { diverged_ns: None, beside })
}

/// A filter is linearised where it happens to be, and its covariance does not hold what that costs: where it is visibly elsewhere than a
/// finding that was iterated, the way between them is an error of its own.
pub(super) fn widen_by_linearisation(fit: &mut Fit, other: Option<&Finding>) {
    let (Some(found), Some(there)) = (&mut fit.least_squares, other.and_then(Finding::point)) else { return };
    let apart = found.parameters - there;
    let unit = found.covariance.diagonal().map(f64::sqrt);
    let correlation = SMatrix::<f64, 10, 10>::from_fn(|i, j| found.covariance[(i, j)] / (unit[i] * unit[j]));
    let scaled = apart.component_div(&unit);
    let squared = correlation.cholesky().map_or(f64::INFINITY, |factor| scaled.dot(&factor.solve(&scaled)));
    let per_parameter = squared / apart.len() as f64;
    if (VISIBLE_PER_PARAMETER..DISAGREEING_PER_PARAMETER).contains(&per_parameter) {
        found.covariance += apart * apart.transpose();
    }
}

/// Recursive least squares over the rows of a fit.
pub(super) fn rls(fit: &mut Fit) -> Result<(), IdentificationError> {
    let scale = fit.scale();
    let Some(found) = &mut fit.least_squares else { return Ok(()) };
    let prior = weak_prior(scale);
    let deviation = scale.parameter_magnitudes() * VAGUE;
    let covariance = SMatrix::from_diagonal(&deviation.map(|s| s * s));
    let mut filter = RecursiveLeastSquares::new(prior.mean.to_vector(), covariance);
    for observation in &observations(&fit.rows.all, found, RESOLUTION) {
        filter.update_rows(observation)?;
    }
    // The covariance stays that of the batch, which knows how neighbouring rows are correlated.
    found.parameters = filter.parameters();
    widen_by_noise_in_rows(found, &fit.scheme, scale);
    Ok(())
}

/// The same, every answer a body.
fn recursive_sdp(fit: &mut Fit) -> Result<(), IdentificationError> {
    let scale = fit.scale();
    let Some(found) = &mut fit.least_squares else { return Ok(()) };
    let mut filter = RecursiveSdp::try_new(PseudoInertiaCone::new(scale), VAGUE)?;
    for observation in &observations(&fit.rows.all, found, 0.0) {
        filter.update_rows(observation)?;
    }
    found.parameters = filter.parameters();
    widen_by_noise_in_rows(found, &fit.scheme, scale);
    Ok(())
}

/// The rows of a fit in the order of time, with the noise that they show; with that of the covariance form's resolution where they show
/// none or determine too little.
pub(super) fn observations_of(fit: &Fit) -> Vec<LinearObservation<6, 10>> {
    let levels = fit.least_squares.as_ref().map_or((0.0, 0.0), |l| (l.torque_residual, l.force_residual));
    deviating(&fit.rows.all, levels, RESOLUTION)
}

/// A finding of somebody else's in the place of the batch solution.
pub(super) fn replaced_by(fit: &mut Fit, found: &Finding) -> Result<Option<(f64, usize)>, IdentificationError> {
    fit.discretisation = SVector::zeros();
    match (found.point(), &mut fit.least_squares) {
        (Some(point), Some(batch)) => {
            batch.parameters = *point;
            batch.covariance = found.covariance()?;
        }
        // It leaves directions free, whatever the rows say.
        (None, _) => fit.least_squares = None,
        (Some(_), None) => {}
    }
    Ok(found.surprises())
}

/// The end of a filter that did not reach the end of the record.
pub(super) enum Flown {
    /// The state or its covariance was lost at this sample.
    Off {
        time_ns: i64,
    },
    Into(IdentificationError),
}

impl From<IdentificationError> for Flown {
    fn from(error: IdentificationError) -> Self {
        Self::Into(error)
    }
}

/// The joint filter of motion and parameters in the place of the batch solution; what its observations surprised it by.
///
/// It works in units in which the body is about as heavy, as large and as often sampled as the levels of this file expect.
pub(super) fn filtered(
    fit: &mut Fit,
    record: &[MotionSample],
    settings: &Settings,
    noise: &SampleNoise,
    unscented: bool,
) -> Result<Option<(f64, usize)>, Flown> {
    let (scale, step_s) = (fit.scale(), Timeline::try_new(record)?.median_step_s());
    let gain = fit.scheme.wrench_gain().sqrt();
    let Some(found) = &mut fit.least_squares else { return Ok(None) };
    let units = Units::of(scale, step_s);
    let scaled = units.record(record);
    let rows = scaled.as_deref().unwrap_or(record);
    let settings = &Settings { gravity_world: units.gravity(&settings.gravity_world), ..*settings };
    let about = About {
        noise: units.noise(&noise.with_wrench(found.torque_residual / gain, found.force_residual / gain)),
        scale: units.scale(scale)?,
    };
    let end = filtered_in_units(rows, settings, &about, unscented).map_err(|flown| match flown {
        Flown::Off { time_ns } if scaled.is_some() => Flown::Off { time_ns: units.time_ns(time_ns, record) },
        flown => flown,
    })?;
    let factors = units.back().parameter_factors();
    found.parameters = end.parameters.component_mul(&factors);
    found.covariance = SMatrix::from_fn(|i, j| end.covariance[(i, j)] * factors[i] * factors[j]);
    // The filter works with true steps and with noise in the poses.
    fit.discretisation = SVector::zeros();
    (fit.poses_noisy, fit.rates_noisy) = (false, false);
    Ok(Some(end.surprise))
}

/// What is known of a record before a filter goes over it.
struct About {
    /// Of one sample.
    noise: Noise,
    scale: BodyScale,
}

/// Where a filter came to.
struct End {
    parameters: SVector<f64, 10>,
    covariance: SMatrix<f64, 10, 10>,
    surprise: (f64, usize),
}

fn filtered_in_units(
    record: &[MotionSample],
    settings: &Settings,
    about: &About,
    unscented: bool,
) -> Result<End, Flown> {
    let first = begin(record, settings, BEGUN);
    let shares: &[f64] = if first.is_some() { &LATER } else { &[] };
    let found = filtered_from(first.as_ref(), record, settings, about, unscented);
    if !matches!(found, Err(Flown::Off { .. })) {
        return found;
    }
    for share in shares {
        let Some(later) = begin(record, settings, BEGUN * share) else { break };
        if let Ok(end) = filtered_from(Some(&later), record, settings, about, unscented) {
            return Ok(end);
        }
    }
    found
}

fn filtered_from(
    begun: Option<&Begun>,
    record: &[MotionSample],
    settings: &Settings,
    about: &About,
    unscented: bool,
) -> Result<End, Flown> {
    let scale = about.scale;
    let begun_at = begun.map_or(0, |begun| begun.rows);
    let rest = &record[begun_at..];
    let times = Timeline::try_new(rest)?;
    let mut joint = Joint::new(rest, &times, settings, about);
    let (mut known, mut surprise) = if let Some(Begun { noise, known, .. }) = begun {
        joint.noise = MotionNoise { drift: joint.noise.drift, ..*noise };
        let pass = joint.extended(known)?;
        (pass.known, pass.surprise)
    } else {
        let vague = Knowledge {
            chart: LogCholesky::try_from_parameters(&weak_prior(scale).mean).map_err(IdentificationError::from)?,
            covariance: SMatrix::from_diagonal(&chart_deviation(scale.length_m()).map(|s| s * s)),
        };
        joint.find_wrench_noise(&vague, &WRENCH_NOISE.map(|share| [share; 2]));
        let pass = joint.extended(&vague)?;
        (pass.known, pass.surprise)
    };
    for factor in REFINEMENTS {
        let (up, down) = (factor, 1.0 / factor);
        let around = [[up, up], [down, down], [up, 1.0], [down, 1.0], [1.0, up], [1.0, down]];
        joint.find_wrench_noise(&known.opened(), &around);
        let pass = joint.extended(&known.opened())?;
        (known, surprise) = (pass.known.without(&known.opened()), pass.surprise);
    }
    if unscented {
        let pass = joint.unscented(&known.opened())?;
        (known, surprise) = (pass.known.without(&known.opened()), pass.surprise);
    }
    let model = joint.model();
    let state = JointState { motion: joint.start, body: known.chart };
    let jacobian = model.parameter_jacobian(&state).fixed_view::<10, 10>(0, 12).into_owned();
    let covariance = jacobian * known.covariance * jacobian.transpose();
    Ok(End { parameters: model.parameters(&state), covariance, surprise })
}

/// What the first rows say, told by the likelihood: a filter that begins with less is linearised too far off.
struct Begun {
    rows: usize,
    noise: MotionNoise,
    known: Knowledge,
}

/// The first seconds as a batch, longer and longer until they know the body to this share; `None` where half the record does not.
fn begin(record: &[MotionSample], settings: &Settings, share: f64) -> Option<Begun> {
    let mut span_s = FIRST_SPAN_S;
    loop {
        #[allow(clippy::cast_possible_truncation)] // saturates
        let until_ns = record.first()?.time_ns.saturating_add((span_s * 1e9) as i64);
        let rows = record.partition_point(|sample| sample.time_ns < until_ns);
        if 2 * rows > record.len() {
            return None;
        }
        if let Ok((found, _)) = estimator(settings).partial(&record[..rows])
            && is_known(&found, share)
        {
            let Noise { torque_n_m, force_n, attitude_rad, position_m, .. } = found.noise;
            let floor = |level: f64, other: f64| if level > 0.0 { level } else { other };
            let noise = MotionNoise {
                attitude_rad,
                position_m,
                rate_rad_s: floor(found.noise.rate_rad_s, attitude_rad),
                velocity_m_s: floor(found.noise.velocity_m_s, position_m),
                acceleration_m_s2: floor(found.noise.acceleration_m_s2, position_m),
                torque_n_m,
                force_n,
                drift: SVector::zeros(),
            };
            let model = JointMotion { noise, gravity_world: settings.gravity_world };
            let chart = LogCholesky::try_from_parameters(&found.parameters).ok()?;
            let state = JointState { motion: RigidBodyState::at_rest(), body: chart };
            let by_chart = model.parameter_jacobian(&state).fixed_view::<10, 10>(0, 12).into_owned().try_inverse()?;
            let covariance = by_chart * found.covariance * by_chart.transpose();
            return Some(Begun { rows, noise, known: Knowledge { chart, covariance } });
        }
        span_s *= 2.0;
    }
}

/// The rows in the order of time, each with the noise that the batch fit found in its kind.
fn observations(rows: &[WrenchRow], found: &WeightedLeastSquares, resolution: f64) -> Vec<LinearObservation<6, 10>> {
    deviating(rows, (found.torque_residual, found.force_residual), resolution)
}

fn deviating(rows: &[WrenchRow], levels: (f64, f64), resolution: f64) -> Vec<LinearObservation<6, 10>> {
    let rms = |first: usize| {
        let sum: f64 = rows.iter().map(|row| row.wrench.fixed_rows::<3>(first).norm_squared()).sum();
        (sum / (3 * rows.len().max(1)) as f64).sqrt()
    };
    let torque = levels.0.max(resolution * rms(0)).max(f64::MIN_POSITIVE.sqrt());
    let force = levels.1.max(resolution * rms(3)).max(f64::MIN_POSITIVE.sqrt());
    let standard_deviation = Vector6::new(torque, torque, torque, force, force, force);
    rows.iter()
        .map(|row| LinearObservation { regressor: row.regressor, output: row.wrench, standard_deviation })
        .collect()
}

/// A recursion has no instruments: where the batch had, the bias of plain least squares is to be expected.
fn widen_by_noise_in_rows(found: &mut WeightedLeastSquares, scheme: &Scheme, scale: BodyScale) {
    if scheme.lag > 1 {
        let bias = found.attenuation(scale);
        found.covariance += bias * bias.transpose();
    }
}

/// Vague knowledge in the chart: a factor of e in mass and extents, the body's length in everything else.
fn chart_deviation(length_m: f64) -> SVector<f64, 10> {
    SVector::from_fn(|i, _| if matches!(i, 0 | 4..=6) { 1.0 } else { length_m })
}

/// A record as the joint filter takes it.
struct Joint {
    observations: Vec<JointObservation>,
    times_ns: Vec<i64>,
    start: RigidBodyState<f64>,
    start_deviation: SVector<f64, 12>,
    noise: MotionNoise,
    gravity_world: Vector3<f64>,
}

impl Joint {
    fn new(record: &[MotionSample], timeline: &Timeline, settings: &Settings, about: &About) -> Self {
        let step_s = timeline.median_step_s();
        let (noise, length_m) = (&about.noise, about.scale.length_m());
        let attitude_rad = noise.attitude_rad.max(POSE_FLOOR);
        let position_m = noise.position_m.max(POSE_FLOOR * length_m);
        let noise = MotionNoise {
            attitude_rad,
            position_m,
            rate_rad_s: noise.rate_rad_s.max(attitude_rad),
            velocity_m_s: noise.velocity_m_s.max(position_m),
            acceleration_m_s2: acceleration_noise(record).max(position_m),
            torque_n_m: about.noise.torque_n_m,
            force_n: about.noise.force_n,
            drift: SVector::zeros(),
        };
        // From the first pose on. Where none was seen the world is where the body is at first, moving along with it.
        let mut seen = (0..record.len()).filter_map(|i| Some((i, record[i].world_from_body?)));
        let (begin, world_from_body) = seen.next().unwrap_or_default();
        let second = seen.next();
        let poseless = record.iter().all(|sample| sample.world_from_body.is_none());
        let velocity = |sample: &MotionSample| sample.velocity_origin_world.filter(|_| !poseless);
        let first = &record[begin];
        let seen = match second {
            Some((end, pose)) => {
                Twist::from(LieGroup::log(&world_from_body.between(&pose)) / timeline.relative_s(end, begin))
            }
            None => Twist::new(first.rate_body.unwrap_or_default(), Vector3::zeros()),
        };
        let twist_body = Twist::new(
            first.rate_body.unwrap_or(seen.angular),
            velocity(first).map_or(seen.linear, |v| world_from_body.rotation.inverse() * v),
        );
        // Half the change over the first step is still to come; noise in both poses.
        let turning = 2.0 * attitude_rad / step_s + (seen.angular - twist_body.angular).norm() + seen.angular.norm();
        let moving = 2.0 * position_m / step_s + (seen.linear - twist_body.linear).norm() + seen.linear.norm();
        let start_deviation = SVector::from_fn(|i, _| [attitude_rad, position_m, turning, moving][i / 3]);
        let (unlogged, stored) = (environment(record), stored_momenta(record));
        let unlogged_at = |i: usize| unlogged.as_ref().map(|unlogged| unlogged[i]);
        let logged = record[..=begin].iter().rev().find_map(|sample| sample.wrench_body);
        let mut held = logged.unwrap_or_else(Wrench::zero);
        let observations = (begin + 1..record.len())
            .map(|i| {
                let (before, now) = (&record[i - 1], &record[i]);
                held = before.wrench_body.unwrap_or(held);
                let next = now.wrench_body.unwrap_or(held);
                let mut wrench_body = match settings.wrench_timing {
                    WrenchTiming::Held => held,
                    WrenchTiming::Sampled => (held + next) * 0.5,
                };
                if let Some(unlogged) = unlogged_at(i - 1) {
                    wrench_body += unlogged.mean;
                }
                let next = unlogged_at(i).map_or(next, |unlogged| next + unlogged.here);
                JointObservation {
                    step_s: timeline.relative_s(i, i - 1),
                    wrench_body,
                    stored_body: stored
                        .as_ref()
                        .map_or_else(Vector3::zeros, |stored| (stored[i - 1] + stored[i]) * 0.5),
                    world_from_body: now.world_from_body,
                    rate_body: now.rate_body,
                    velocity_origin_world: velocity(now),
                    acceleration_origin_body: now.acceleration_origin_body.map(|a| (a, next)),
                }
            })
            .collect();
        let start = RigidBodyState { world_from_body, twist_body };
        let times_ns = record[begin + 1..].iter().map(|sample| sample.time_ns).collect();
        Self { observations, times_ns, start, start_deviation, noise, gravity_world: settings.gravity_world }
    }

    fn model(&self) -> JointMotion {
        JointMotion { noise: self.noise, gravity_world: self.gravity_world }
    }

    /// First state and its covariance.
    fn beginning(&self, known: &Knowledge) -> (JointState, SMatrix<f64, 22, 22>) {
        let mut covariance = SMatrix::<f64, 22, 22>::zeros();
        for i in 0..12 {
            covariance[(i, i)] = self.start_deviation[i] * self.start_deviation[i];
        }
        covariance.fixed_view_mut::<10, 10>(12, 12).copy_from(&known.covariance);
        (JointState { motion: self.start, body: known.chart }, covariance)
    }

    /// Once over the record.
    fn extended(&self, known: &Knowledge) -> Result<Pass, Flown> {
        let (state, covariance) = self.beginning(known);
        let gate = ChiSquareGate::try_new(GATE)?;
        let mut filter = ExtendedKalmanFilter::new(self.model(), state, covariance).with_gate(gate);
        let mut pass = Pass { known: *known, likelihood: 0.0, surprise: (0.0, 0) };
        for (observation, time_ns) in self.observations.iter().zip(&self.times_ns) {
            let update = filter.update_rows(observation).map_err(|error| flown(error, *time_ns))?;
            pass.count(&update);
        }
        pass.known = Knowledge::of(&filter.state(), filter.state_covariance());
        Ok(pass)
    }

    fn unscented(&self, known: &Knowledge) -> Result<Pass, Flown> {
        let (state, covariance) = self.beginning(known);
        let gate = ChiSquareGate::try_new(GATE)?;
        let mut filter = UnscentedKalmanFilter::new(self.model(), state, covariance).with_gate(gate);
        let mut pass = Pass { known: *known, likelihood: 0.0, surprise: (0.0, 0) };
        for (observation, time_ns) in self.observations.iter().zip(&self.times_ns) {
            let update = filter.update_rows(observation).map_err(|error| flown(error, *time_ns))?;
            pass.count(&update);
        }
        pass.known = Knowledge::of(&filter.state(), filter.state_covariance());
        Ok(pass)
    }

    /// Multiplies the noise of torque and force by the most likely of `factors`, or leaves it.
    fn find_wrench_noise(&mut self, known: &Knowledge, factors: &[[f64; 2]]) {
        let (torque_n_m, force_n) = (self.noise.torque_n_m, self.noise.force_n);
        let (mut likeliest, mut most) = (self.noise, f64::NEG_INFINITY);
        for [torque, force] in core::iter::once(&[1.0, 1.0]).chain(factors) {
            self.noise = MotionNoise { torque_n_m: torque_n_m * torque, force_n: force_n * force, ..self.noise };
            // A trial from which the filter flies off is not the likeliest.
            let likelihood = self.extended(known).map_or(f64::NEG_INFINITY, |pass| pass.likelihood);
            if likelihood > most {
                (likeliest, most) = (self.noise, likelihood);
            }
        }
        self.noise = likeliest;
    }
}

/// A record is finite and a filter begins with a covariance: what is neither, a filter made so.
fn flown(error: IdentificationError, time_ns: i64) -> Flown {
    match error {
        IdentificationError::NotFinite { .. }
        | IdentificationError::NotPositive { .. }
        | IdentificationError::Dynamics(_)
        | IdentificationError::Lie(_) => Flown::Off { time_ns },
        error => Flown::Into(error),
    }
}

/// What a filter says at the end of a record.
struct Pass {
    known: Knowledge,
    /// Logarithm, of all innovations.
    likelihood: f64,
    /// Sums of normalised innovations squared and of their degrees of freedom.
    surprise: (f64, usize),
}

impl Pass {
    fn count<const ROWS: usize>(&mut self, update: &RowsOutcome<ROWS>) {
        self.likelihood += update.innovation.log_likelihood();
        if update.is_accepted() {
            self.surprise.0 += update.innovation.nis;
            self.surprise.1 += update.innovation.degrees_of_freedom;
        }
    }
}

/// A body in the chart of the filter.
#[derive(Clone, Copy)]
struct Knowledge {
    chart: LogCholesky<f64>,
    covariance: SMatrix<f64, 10, 10>,
}

impl Knowledge {
    fn of(state: &JointState, covariance: &SMatrix<f64, 22, 22>) -> Self {
        Self { chart: state.body, covariance: covariance.fixed_view::<10, 10>(12, 12).into_owned() }
    }

    /// The same body, ten times less sure: a place to linearise about.
    fn opened(&self) -> Self {
        Self { covariance: self.covariance * 100.0, ..*self }
    }

    /// Takes the knowledge a pass started from out of what it ended with, so that nothing counts twice.
    fn without(&self, start: &Self) -> Self {
        // In units of the start, which is the wider.
        let unit = start.covariance.diagonal().map(|v| v.sqrt().max(f64::MIN_POSITIVE));
        let scaled = |m: &SMatrix<f64, 10, 10>| SMatrix::<f64, 10, 10>::from_fn(|i, j| m[(i, j)] / (unit[i] * unit[j]));
        let inverse = |m: SMatrix<f64, 10, 10>| m.cholesky().map(|c| c.inverse());
        let (Some(all), Some(prior)) = (inverse(scaled(&self.covariance)), inverse(scaled(&start.covariance))) else {
            return *self;
        };
        let Some(covariance) = inverse(all - prior) else { return *self };
        let moved = (self.chart.to_vector() - start.chart.to_vector()).component_div(&unit);
        let chart = start.chart.to_vector() + (covariance * all * moved).component_mul(&unit);
        Self {
            chart: LogCholesky::from_vector(&chart),
            covariance: SMatrix::from_fn(|i, j| covariance[(i, j)] * unit[i] * unit[j]),
        }
    }
}

/// From third differences, whose squared coefficients add up to 20; steps of a held wrench count as noise.
fn acceleration_noise(record: &[MotionSample]) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for window in record.windows(4) {
        if let [Some(a), Some(b), Some(c), Some(d)] = [0, 1, 2, 3].map(|i| window[i].acceleration_origin_body) {
            sum += (d - (c - b) * 3.0 - a).norm_squared();
            count += 3;
        }
    }
    if count == 0 { 0.0 } else { (sum / (20.0 * f64::from(count))).sqrt() }
}
