//! The recursive estimators over a whole record.

use super::fit::Fit;
use super::likelihood::{estimator, is_known};
use super::noise::SampleNoise;
use super::rows::Scheme;
use super::solution::weak_prior;
use super::timeline::Timeline;
use super::{Method, Noise, Settings};
use crate::WrenchTiming;
use crate::body_scale::BodyScale;
use crate::consistency::PseudoInertiaCone;
use crate::dynamics::{LogCholesky, RigidBodyState};
use crate::error::IdentificationError;
use crate::lie::{LieGroup, Twist, Wrench};
use crate::motion::MotionSample;
use crate::recursive::{
    ChiSquareGate, ExtendedKalmanFilter, FilterModel, JointMotion, JointObservation, JointState, LinearObservation,
    MotionNoise, RecursiveLeastSquares, RecursiveSdp, UnscentedKalmanFilter,
};
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
/// Rejects only what is beyond doubt.
const GATE: f64 = 0.9999;
/// Wrench noise tried, as fractions of the residual of the rows, which noise in the poses may have inflated.
const WRENCH_NOISE: [f64; 9] = [1.0, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4];
/// Then steps of these factors, together and apart, each with a pass linearised about the last one.
const REFINEMENTS: [f64; 5] = [3.0, 3.0, 2.0, 1.5, 1.25];

impl Method {
    pub(super) fn is_recursive(self) -> bool {
        matches!(self, Self::Rls | Self::RecursiveSdp | Self::Ekf | Self::Ukf)
    }
}

/// Puts the end of a recursion over the record in the place of the batch solution; where that does not exist, the rows do
/// not determine ten parameters and a recursion would only repeat its prior. Where a filter flies off the batch solution stays,
/// and the time of the sample is returned.
pub(super) fn run(
    fit: &mut Fit,
    record: &[MotionSample],
    settings: &Settings,
    noise: &SampleNoise,
) -> Result<Option<i64>, IdentificationError> {
    let scale = fit.scale();
    let Some(found) = &mut fit.least_squares else { return Ok(None) };
    match settings.method {
        Method::Rls => {
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
        }
        Method::RecursiveSdp => {
            let mut filter = RecursiveSdp::try_new(PseudoInertiaCone::new(scale), VAGUE)?;
            for observation in &observations(&fit.rows.all, found, 0.0) {
                filter.update_rows(observation)?;
            }
            found.parameters = filter.parameters();
            widen_by_noise_in_rows(found, &fit.scheme, scale);
        }
        Method::Ekf | Method::Ukf => match filtered(fit, record, settings, noise) {
            Ok(()) => {}
            Err(Flown::Off { time_ns }) => return Ok(Some(time_ns)),
            Err(Flown::Into(error)) => return Err(error),
        },
        _ => {}
    }
    Ok(None)
}

/// The end of a filter that did not reach the end of the record.
enum Flown {
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

/// The joint filter of motion and parameters in the place of the batch solution.
fn filtered(fit: &mut Fit, record: &[MotionSample], settings: &Settings, noise: &SampleNoise) -> Result<(), Flown> {
    let scale = fit.scale();
    let Some(found) = &mut fit.least_squares else { return Ok(()) };
    let begun = begin(record, settings);
    let begun_at = begun.as_ref().map_or(0, |begun| begun.rows);
    let rest = &record[begun_at..];
    let times = Timeline::try_new(rest)?;
    let mut joint = Joint::new(rest, &times, settings, noise, &fit.scheme, found, scale.length_m());
    let mut known = if let Some(Begun { noise, known, .. }) = begun {
        joint.noise = MotionNoise { drift: joint.noise.drift, ..noise };
        joint.extended(&known)?.0
    } else {
        let vague = Knowledge {
            chart: LogCholesky::try_from_parameters(&weak_prior(scale).mean).map_err(IdentificationError::from)?,
            covariance: SMatrix::from_diagonal(&chart_deviation(scale.length_m()).map(|s| s * s)),
        };
        joint.find_wrench_noise(&vague, &WRENCH_NOISE.map(|share| [share; 2]));
        joint.extended(&vague)?.0
    };
    for factor in REFINEMENTS {
        let (up, down) = (factor, 1.0 / factor);
        let around = [[up, up], [down, down], [up, 1.0], [down, 1.0], [1.0, up], [1.0, down]];
        joint.find_wrench_noise(&known.opened(), &around);
        known = joint.extended(&known.opened())?.0.without(&known.opened());
    }
    if settings.method == Method::Ukf {
        known = joint.unscented(&known.opened())?.without(&known.opened());
    }
    let model = joint.model();
    let state = JointState { motion: joint.start, body: known.chart };
    let jacobian = model.parameter_jacobian(&state).fixed_view::<10, 10>(0, 12).into_owned();
    found.parameters = model.parameters(&state);
    found.covariance = jacobian * known.covariance * jacobian.transpose();
    // The filter works with true steps and with noise in the poses.
    fit.discretisation = SVector::zeros();
    (fit.poses_noisy, fit.rates_noisy) = (false, false);
    Ok(())
}

/// What the first rows say, told by the likelihood: a filter that begins with less is linearised too far off.
struct Begun {
    rows: usize,
    noise: MotionNoise,
    known: Knowledge,
}

/// The first seconds as a batch, longer and longer until they know the body to a tenth; `None` where half the record does not.
fn begin(record: &[MotionSample], settings: &Settings) -> Option<Begun> {
    let mut span_s = FIRST_SPAN_S;
    loop {
        #[allow(clippy::cast_possible_truncation)] // saturates
        let until_ns = record.first()?.time_ns.saturating_add((span_s * 1e9) as i64);
        let rows = record.partition_point(|sample| sample.time_ns < until_ns);
        if 2 * rows > record.len() {
            return None;
        }
        if let Ok((found, _)) = estimator(settings).partial(&record[..rows])
            && is_known(&found, BEGUN)
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
    let rms = |first: usize| {
        let sum: f64 = rows.iter().map(|row| row.wrench.fixed_rows::<3>(first).norm_squared()).sum();
        (sum / (3 * rows.len().max(1)) as f64).sqrt()
    };
    let torque = found.torque_residual.max(resolution * rms(0)).max(f64::MIN_POSITIVE.sqrt());
    let force = found.force_residual.max(resolution * rms(3)).max(f64::MIN_POSITIVE.sqrt());
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
    fn new(
        record: &[MotionSample],
        timeline: &Timeline,
        settings: &Settings,
        noise: &SampleNoise,
        scheme: &Scheme,
        found: &WeightedLeastSquares,
        length_m: f64,
    ) -> Self {
        let step_s = timeline.median_step_s();
        let gain = scheme.wrench_gain().sqrt();
        let attitude_rad = noise.attitude_rad.max(POSE_FLOOR);
        let position_m = noise.position_m.max(POSE_FLOOR * length_m);
        let noise = MotionNoise {
            attitude_rad,
            position_m,
            rate_rad_s: noise.rate_rad_s.max(attitude_rad),
            velocity_m_s: noise.velocity_m_s.max(position_m),
            acceleration_m_s2: acceleration_noise(record).max(position_m),
            torque_n_m: found.torque_residual / gain,
            force_n: found.force_residual / gain,
            drift: SVector::zeros(),
        };
        let (first, second) = (&record[0], &record[1]);
        let body_from_world = first.world_from_body.rotation.inverse();
        let apart = first.world_from_body.between(&second.world_from_body);
        let seen = Twist::from(LieGroup::log(&apart) / timeline.relative_s(1, 0));
        let twist_body = Twist::new(
            first.rate_body.unwrap_or(seen.angular),
            first.velocity_origin_world.map_or(seen.linear, |v| body_from_world * v),
        );
        // Half the change over the first step is still to come; noise in both poses.
        let turning = 2.0 * attitude_rad / step_s + (seen.angular - twist_body.angular).norm() + seen.angular.norm();
        let moving = 2.0 * position_m / step_s + (seen.linear - twist_body.linear).norm() + seen.linear.norm();
        let start_deviation = SVector::from_fn(|i, _| [attitude_rad, position_m, turning, moving][i / 3]);
        let mut held = Wrench::zero();
        let observations = (1..record.len())
            .map(|i| {
                let (before, now) = (&record[i - 1], &record[i]);
                held = before.wrench_body.unwrap_or(held);
                let next = now.wrench_body.unwrap_or(held);
                let wrench_body = match settings.wrench_timing {
                    WrenchTiming::Held => held,
                    WrenchTiming::Sampled => (held + next) * 0.5,
                };
                JointObservation {
                    step_s: timeline.relative_s(i, i - 1),
                    wrench_body,
                    world_from_body: Some(now.world_from_body),
                    rate_body: now.rate_body,
                    velocity_origin_world: now.velocity_origin_world,
                    acceleration_origin_body: now.acceleration_origin_body.map(|a| (a, next)),
                }
            })
            .collect();
        let start = RigidBodyState { world_from_body: first.world_from_body, twist_body };
        let times_ns = record[1..].iter().map(|sample| sample.time_ns).collect();
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

    /// What is known of the body at the end of the record, and the likelihood of all innovations.
    fn extended(&self, known: &Knowledge) -> Result<(Knowledge, f64), Flown> {
        let (state, covariance) = self.beginning(known);
        let gate = ChiSquareGate::try_new(GATE)?;
        let mut filter = ExtendedKalmanFilter::new(self.model(), state, covariance).with_gate(gate);
        let mut likelihood = 0.0;
        for (observation, time_ns) in self.observations.iter().zip(&self.times_ns) {
            let update = filter.update_rows(observation).map_err(|error| flown(error, *time_ns))?;
            likelihood += update.innovation.log_likelihood();
        }
        Ok((Knowledge::of(&filter.state(), filter.state_covariance()), likelihood))
    }

    fn unscented(&self, known: &Knowledge) -> Result<Knowledge, Flown> {
        let (state, covariance) = self.beginning(known);
        let gate = ChiSquareGate::try_new(GATE)?;
        let mut filter = UnscentedKalmanFilter::new(self.model(), state, covariance).with_gate(gate);
        for (observation, time_ns) in self.observations.iter().zip(&self.times_ns) {
            filter.update_rows(observation).map_err(|error| flown(error, *time_ns))?;
        }
        Ok(Knowledge::of(&filter.state(), filter.state_covariance()))
    }

    /// Multiplies the noise of torque and force by the most likely of `factors`, or leaves it.
    fn find_wrench_noise(&mut self, known: &Knowledge, factors: &[[f64; 2]]) {
        let (torque_n_m, force_n) = (self.noise.torque_n_m, self.noise.force_n);
        let (mut likeliest, mut most) = (self.noise, f64::NEG_INFINITY);
        for [torque, force] in core::iter::once(&[1.0, 1.0]).chain(factors) {
            self.noise = MotionNoise { torque_n_m: torque_n_m * torque, force_n: force_n * force, ..self.noise };
            // A trial from which the filter flies off is not the likeliest.
            let likelihood = self.extended(known).map_or(f64::NEG_INFINITY, |(_, likelihood)| likelihood);
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
        IdentificationError::NotFinite { .. } | IdentificationError::NotPositive { .. } => Flown::Off { time_ns },
        error => Flown::Into(error),
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
