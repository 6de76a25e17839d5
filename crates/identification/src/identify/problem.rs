//! What an identification is about beside its record, its rows, and the library's own estimators of such a record.

use super::fit::{Best, Fit, best_fit};
use super::identification::Identification;
use super::judgement::judge;
use super::noise::SampleNoise;
use super::plan::{Plan, Way};
use super::recursion::{self, Flown};
use super::rows::{Regression, Scheme};
use super::settings::Settings;
use super::timeline::Timeline;
use super::{identify, second, silence_of};
use crate::dynamics::InertialParameters;
use crate::error::IdentificationError;
use crate::estimator::{Estimator, EstimatorError, Finding, Observe};
use crate::likelihood::{MaximumLikelihood, Nuisances};
use crate::motion::MotionSample;
use crate::motion::Noise;
use crate::recursive::LinearObservation;
use crate::weighted_least_squares::WrenchRow;
use crate::{BodyScale, WrenchTiming};
use nalgebra::{SMatrix, Vector3};

/// What an identification is about, beside its record: what constructors of estimators are told.
///
/// Rows are formed here and nowhere else, the same for every estimator and for the judge: [`rows`](Self::rows), and as observations of a
/// filter through [`Observe`].
///
/// # Frame
/// As in [`MotionSample`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Problem {
    /// When the logged wrench acts.
    pub wrench_timing: WrenchTiming,
    /// Gravitational acceleration, inertial axes, m/s^2. What else acts stands in
    /// [`MotionSample::besides_body`](crate::MotionSample::besides_body); [`with_all_that_acts`](crate::with_all_that_acts) fills that in.
    pub gravity_world: Vector3<f64>,
    /// What the likelihood estimates beside the ten parameters.
    pub estimate: Nuisances,
    /// Which equations the rows are.
    pub regression: Regression,
    /// Samples between the poses of one row.
    pub lag: usize,
    /// Size of the body, in whose units parameters are compared.
    pub scale: BodyScale,
    /// Noise of one sample, as far as the record shows it; zero where it shows none.
    pub noise: Noise,
}

impl Problem {
    /// The problem that a record poses: rows, lag, noise and scale as [`identify`](crate::identify) would choose them for a method without
    /// rows of its own.
    ///
    /// # Errors
    /// As [`identify`](crate::identify).
    ///
    /// # Example
    /// ```
    /// use tumble_identification::estimator::Estimator;
    /// use tumble_identification::{MotionSample, Problem, Regressed, Settings};
    ///
    /// fn mass_kg(record: &[MotionSample]) -> Option<f64> {
    ///     let problem = Problem::of(record, &Settings::default()).ok()?;
    ///     let found = Regressed::new(problem).estimate(record).ok()?;
    ///     found.point().map(|ten| ten[0])
    /// }
    /// assert_eq!(mass_kg(&[]), None);
    /// ```
    pub fn of(record: &[MotionSample], settings: &Settings) -> Result<Self, IdentificationError> {
        let timeline = Timeline::try_new(record)?;
        let noise = SampleNoise::estimate(record, &timeline, settings);
        let known = Settings { method: super::AUTO, ..*settings };
        let plan = Plan { way: Way::Other, ..Plan::usual(&known)? };
        match best_fit(record, &timeline, &plan, &noise)? {
            Best::Fit(fit) => Ok(Self::of_fit(&fit, settings, &noise)),
            Best::Likelihood(_) => Err(IdentificationError::Indefinite { parameters: 10 }),
        }
    }

    pub(super) fn of_fit(fit: &Fit, settings: &Settings, noise: &SampleNoise) -> Self {
        let gain = fit.scheme.wrench_gain().sqrt();
        let (torque, force) = fit.least_squares.as_ref().map_or((0.0, 0.0), |l| (l.torque_residual, l.force_residual));
        Self {
            wrench_timing: settings.wrench_timing,
            gravity_world: settings.gravity_world,
            estimate: settings.estimate,
            regression: fit.scheme.regression,
            lag: fit.scheme.lag,
            scale: fit.scale(),
            noise: noise.with_wrench(torque / gain, force / gain),
        }
    }

    fn settings(&self) -> Settings {
        Settings {
            wrench_timing: self.wrench_timing,
            gravity_world: self.gravity_world,
            lag: Some(self.lag),
            estimate: self.estimate,
            ..Settings::default()
        }
    }

    fn scheme(&self) -> Scheme {
        Scheme::new(&self.settings(), self.regression, self.lag)
    }

    fn sample_noise(&self) -> SampleNoise {
        let Noise { attitude_rad, position_m, rate_rad_s, velocity_m_s, acceleration_m_s2, .. } = self.noise;
        SampleNoise { attitude_rad, position_m, rate_rad_s, velocity_m_s, acceleration_m_s2 }
    }

    /// The rows `regressor * parameters = wrench` of a record, in the order of time.
    ///
    /// # Shape
    /// Six equations each, torque above force, N m and N, body axes about the origin.
    ///
    /// # Errors
    /// Where the record gives not one row: [`IdentificationError::TooFewSamples`], [`IdentificationError::MissingColumn`],
    /// [`IdentificationError::HalfTurns`], [`IdentificationError::TimesNotIncreasing`].
    pub fn rows(&self, record: &[MotionSample]) -> Result<Vec<WrenchRow>, IdentificationError> {
        Ok(self.scheme().rows(record, &Timeline::try_new(record)?)?.all)
    }

    /// How many rows share the samples of one: neighbours are not independent.
    pub fn rows_alike(&self) -> f64 {
        let scheme = self.scheme();
        (2.0 * scheme.reach() as f64 * (2.0 / scheme.stride() as f64).min(1.0)).max(1.0)
    }

    fn fit(&self, record: &[MotionSample]) -> Result<Fit, IdentificationError> {
        Fit::with_bias_of_lag(self.scheme(), record, &Timeline::try_new(record)?, &self.sample_noise())
    }

    /// What a fit says, directions left free where it leaves them free.
    fn finding_of(record: &[MotionSample], fit: &Fit) -> Result<Finding, EstimatorError> {
        let judgement = judge(fit, silence_of(record, fit), None)?;
        let magnitudes = judgement.scale.parameter_magnitudes();
        match &fit.least_squares {
            Some(found) if judgement.observability.rank() == 10 => {
                Finding::of_covariance(found.parameters, &found.covariance, magnitudes)
            }
            _ => Ok(Finding::of_information(judgement.projected, magnitudes)),
        }
    }
}

/// Rows as filters take them: since neighbours share samples each is as much less sure as there are of them in a window.
impl Observe<[MotionSample]> for Problem {
    type Observation = LinearObservation<6, 10>;

    fn each(
        &self,
        record: &[MotionSample],
        take: &mut dyn FnMut(&LinearObservation<6, 10>) -> Result<(), EstimatorError>,
    ) -> Result<(), EstimatorError> {
        let fit = self.fit(record)?;
        let alike = self.rows_alike().sqrt();
        for mut observation in recursion::observations_of(&fit) {
            observation.standard_deviation *= alike;
            take(&observation)?;
        }
        Ok(())
    }

    fn noise(&self, record: &[MotionSample]) -> Result<SMatrix<f64, 10, 10>, EstimatorError> {
        let fit = self.fit(record)?;
        Ok(fit.least_squares.map_or_else(SMatrix::zeros, |found| found.noise_information / self.rows_alike()))
    }
}

/// Weighted least squares over the rows of a problem: with instruments where the poses are noisy, its covariance that of correlated rows and
/// of the errors that are not noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regressed(Problem);

impl Regressed {
    /// Over the rows of this problem.
    pub fn new(problem: Problem) -> Self {
        Self(problem)
    }
}

impl Estimator for Regressed {
    type Record = [MotionSample];

    fn estimate(&self, record: &[MotionSample]) -> Result<Finding, EstimatorError> {
        Problem::finding_of(record, &self.0.fit(record)?)
    }
}

/// The joint filter of motion and parameters over a whole record, several times, each about the end of the last; it finds the noise of the
/// wrench itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointFilter {
    problem: Problem,
    unscented: bool,
}

impl JointFilter {
    /// The extended Kalman filter.
    pub fn extended(problem: Problem) -> Self {
        Self { problem, unscented: false }
    }

    /// The unscented one.
    pub fn unscented(problem: Problem) -> Self {
        Self { problem, unscented: true }
    }
}

impl Estimator for JointFilter {
    type Record = [MotionSample];

    /// # Errors
    /// Also [`IdentificationError::FilterDiverged`].
    fn estimate(&self, record: &[MotionSample]) -> Result<Finding, EstimatorError> {
        let problem = &self.problem;
        let mut fit = problem.fit(record)?;
        let before = Problem::finding_of(record, &fit)?;
        if before.point().is_none() {
            return Ok(before);
        }
        let noise = problem.sample_noise();
        // A lag above one was chosen because the poses are noisy; what a problem keeps is the lag.
        fit.poses_noisy = fit.scheme.lag > 1;
        let other = second(&fit, record, &problem.settings())?;
        match recursion::filtered(&mut fit, record, &problem.settings(), &noise, self.unscented) {
            Ok(surprise) => {
                recursion::widen_by_linearisation(&mut fit, other.as_ref());
                let found = Problem::finding_of(record, &fit)?;
                Ok(surprise.map_or(found, |(nis, freedom)| found.with_surprise(nis, freedom)))
            }
            Err(Flown::Off { time_ns }) => Err(IdentificationError::FilterDiverged { time_ns }.into()),
            Err(Flown::Into(error)) => Err(error.into()),
        }
    }
}

/// The most likely body; standard deviations widened where parts of the record contradict each other.
impl Estimator for MaximumLikelihood {
    type Record = [MotionSample];

    fn estimate(&self, record: &[MotionSample]) -> Result<Finding, EstimatorError> {
        let found = MaximumLikelihood::estimate(self, record)?;
        let magnitudes = BodyScale::of(&found.parameters.to_vector())?.parameter_magnitudes();
        let covariance = found.covariance * (found.scatter * found.scatter);
        let known = Finding::of_covariance(found.unconstrained, &covariance, magnitudes)?;
        Ok(known.at(found.parameters.to_vector()))
    }
}

/// [`identify`](crate::identify) as an estimator.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chosen(pub(super) Problem);

impl Estimator for Chosen {
    type Record = [MotionSample];

    fn estimate(&self, record: &[MotionSample]) -> Result<Finding, EstimatorError> {
        Ok(identify(record, &Settings { lag: None, ..self.0.settings() })?.finding())
    }
}

impl Identification {
    /// What the record says, without any prior; the estimate is its point.
    pub fn finding(&self) -> Finding {
        let found = Finding::of_information(self.information, self.scale.parameter_magnitudes());
        let body = self.estimate.as_ref().map(|estimate| &estimate.parameters);
        body.map(InertialParameters::to_vector).map_or(found, |point| found.at(point))
    }
}
