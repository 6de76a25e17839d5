//! Which rows to fit: method and lag, chosen by predicted error.

use super::identification::Identification;
use super::likelihood::most_likely;
use super::noise::SampleNoise;
use super::plan::{Plan, Way};
use super::rows::{Regression, Rows, Scheme};
use super::timeline::Timeline;
use crate::BodyScale;
use crate::error::{Column, IdentificationError};
use crate::motion::MotionSample;
use crate::regressors::Regressor;
use crate::weighted_least_squares::{WeightedLeastSquares, WrenchRow, whitened};
use nalgebra::{ComplexField, SVector, Vector3, Vector6};

/// Lags tried where noise forbids the shortest.
/// Each but the last two has its double among them, which judges its discretisation.
pub(super) const LAGS: [usize; 15] = [2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256];
/// A bias below this fraction of the body's scale is rounding.
const NEGLIGIBLE_BIAS: f64 = 1e-6;
/// A bias above this fraction of the body's scale is never accepted without warning.
const LARGE_BIAS: f64 = 0.01;
/// A solution moved by other instruments is no chance above so many standard deviations, and of consequence above this
/// fraction of the body's scale.
const VISIBLE_SHIFT: (f64, f64) = (3.0, 0.02);
/// Sides of the search for a body's length, m.
const LENGTHS_M: (f64, f64) = (0.01, 10.0);

/// Rows of one scheme and what they say.
pub(super) struct Fit {
    pub(super) scheme: Scheme,
    pub(super) rows: Rows,
    /// Rough scale of the body, from the sizes of wrench and acceleration.
    pub(super) rough_scale: BodyScale,
    /// `None` where the rows do not determine ten parameters.
    pub(super) least_squares: Option<WeightedLeastSquares>,
    /// Error expected from discretisation, from the change with the lag.
    pub(super) discretisation: SVector<f64, 10>,
    /// Error expected from noise of the poses that is not white, in standard deviations of the parameter that it moves most;
    /// zero where it is chance or of no consequence.
    pub(super) coloured: f64,
    /// Plain pose-only least squares at the shortest lag would be visibly biased by noise in the poses.
    pub(super) poses_noisy: bool,
    /// The same of rates and velocities, where they were asked for.
    pub(super) rates_noisy: bool,
}

impl Fit {
    /// The fit of a scheme, with the error of discretisation that twice the lag shows.
    pub(super) fn with_bias_of_lag(
        scheme: Scheme,
        record: &[MotionSample],
        timeline: &Timeline,
        noise: &SampleNoise,
    ) -> Result<Self, IdentificationError> {
        let fit = |scheme| Self::new(scheme, record, timeline, noise);
        let longer = Scheme { lag: 2 * scheme.lag, ..scheme };
        fit(scheme).map(|found| found.with_bias(fit(longer).ok().as_ref()))
    }

    fn new(
        scheme: Scheme,
        record: &[MotionSample],
        timeline: &Timeline,
        noise: &SampleNoise,
    ) -> Result<Self, IdentificationError> {
        let rows = scheme.rows(record, timeline)?;
        let rough_scale = rough_scale(&rows.all)?;
        let row_noise = noise.of_rows(&scheme, timeline.median_step_s());
        let least_squares = match WeightedLeastSquares::fit(&rows.all, rough_scale, &row_noise, scheme.instruments()) {
            Ok(found) => Some(found),
            Err(IdentificationError::NotExcited { .. } | IdentificationError::Indefinite { .. }) => None,
            Err(error) => return Err(error),
        };
        Ok(Self {
            scheme,
            rows,
            rough_scale,
            least_squares,
            discretisation: SVector::zeros(),
            coloured: 0.0,
            poses_noisy: false,
            rates_noisy: false,
        })
    }

    /// Shares of the mean squares of torque and force that the solution explains.
    pub(super) fn explained(&self) -> Option<(f64, f64)> {
        let scale = self.rough_scale;
        let unweighted =
            || whitened(&self.rows.all, scale.length_m(), 1.0).ok()?.solve(&scale.parameter_magnitudes()).ok();
        let parameters = self.least_squares.as_ref().map(|found| found.parameters).or_else(unweighted)?;
        let mut sums = [0.0; 4];
        for row in &self.rows.all {
            let residual = row.regressor * parameters - row.wrench;
            let squares = |w: &Vector6<f64>| (w.fixed_rows::<3>(0).norm_squared(), w.fixed_rows::<3>(3).norm_squared());
            let ((torque, force), (torque_left, force_left)) = (squares(&row.wrench), squares(&residual));
            for (sum, term) in sums.iter_mut().zip([torque, force, torque_left, force_left]) {
                *sum += term;
            }
        }
        let share = |left: f64, all: f64| if all > 0.0 { 1.0 - left / all } else { 0.0 };
        Some((share(sums[2], sums[0]), share(sums[3], sums[1])))
    }

    /// Scale of the body found, or the rough one.
    pub(super) fn scale(&self) -> BodyScale {
        self.least_squares.as_ref().and_then(|found| BodyScale::of(&found.parameters).ok()).unwrap_or(self.rough_scale)
    }

    /// Bias that noise in the regressor gives plain least squares; none with instruments.
    fn attenuation(&self) -> SVector<f64, 10> {
        match &self.least_squares {
            Some(found) if self.scheme.lag == 1 => found.attenuation(self.scale()),
            _ => SVector::zeros(),
        }
    }

    fn is_noisy(&self) -> bool {
        let Some(found) = &self.least_squares else { return false };
        let (bias, magnitudes) = (self.attenuation(), self.scale().parameter_magnitudes());
        (0..10).any(|i| {
            let (bias, size) = (bias[i].abs(), magnitudes[i]);
            bias > LARGE_BIAS * size || bias > NEGLIGIBLE_BIAS * size && bias * bias > 0.25 * found.covariance[(i, i)]
        })
    }

    /// Carries the errors that are not noise into the covariance.
    fn with_bias(mut self, longer: Option<&Self>) -> Self {
        let attenuation = self.attenuation();
        if let (Some(found), Some(other)) =
            (&self.least_squares, longer.and_then(|longer| longer.least_squares.as_ref()))
        {
            self.discretisation = discretisation(&self.scheme, found, other);
        }
        let magnitudes = self.scale().parameter_magnitudes();
        if let Some(found) = &mut self.least_squares {
            let shift = found.instrument_shift;
            let visible = |i: &usize| shift[*i].abs() > VISIBLE_SHIFT.1 * magnitudes[*i];
            let most = (0..10).filter(visible).map(|i| shift[i].abs() / found.covariance[(i, i)].sqrt());
            self.coloured = Some(most.fold(0.0, f64::max)).filter(|most| *most > VISIBLE_SHIFT.0).unwrap_or(0.0);
            if self.coloured > 0.0 {
                found.covariance += shift * shift.transpose();
            }
            found.covariance +=
                attenuation * attenuation.transpose() + self.discretisation * self.discretisation.transpose();
        }
        self
    }
}

/// Error of discretisation, from the change that twice the lag makes.
fn discretisation(scheme: &Scheme, found: &WeightedLeastSquares, longer: &WeightedLeastSquares) -> SVector<f64, 10> {
    (longer.parameters - found.parameters) / (2.0_f64.powi(scheme.order()) - 1.0)
}

/// Sum of relative mean squared errors of the ten parameters.
fn predicted_error(found: &WeightedLeastSquares, bias: &SVector<f64, 10>) -> f64 {
    let Ok(scale) = BodyScale::of(&found.parameters) else { return f64::INFINITY };
    let magnitudes = scale.parameter_magnitudes();
    (0..10).map(|i| (found.covariance[(i, i)] + bias[i] * bias[i]) / (magnitudes[i] * magnitudes[i])).sum()
}

/// What [`best_fit`] chose.
pub(super) enum Best {
    Fit(Box<Fit>),
    Likelihood(Box<Identification>),
}

impl From<Fit> for Best {
    fn from(fit: Fit) -> Self {
        Self::Fit(Box::new(fit))
    }
}

/// The fit whose predicted error is least, among the methods and lags that the settings leave open.
///
/// The shortest lag is taken where noise in the poses does not matter there. Where it does, or the steps are too unequal for
/// most rows, and the method is open, the likelihood is asked first.
pub(super) fn best_fit(
    record: &[MotionSample],
    timeline: &Timeline,
    plan: &Plan<'_>,
    noise: &SampleNoise,
) -> Result<Best, IdentificationError> {
    let settings = plan.settings;
    let (automatic, method) = match plan.way {
        Way::Rows(regression) => (false, regression),
        _ => (true, Regression::Variational4),
    };
    let with_lag = |method, lag| Fit::with_bias_of_lag(Scheme::new(settings, method, lag), record, timeline, noise);
    let first = match with_lag(method, settings.lag.unwrap_or(1)) {
        // Too short for the higher order.
        Err(IdentificationError::TooFewSamples { .. }) if automatic => {
            with_lag(Regression::Variational, settings.lag.unwrap_or(1))
                .or_else(|error| with_lag(Regression::NewtonEuler, settings.lag.unwrap_or(1)).map_err(|_| error))
        }
        // Rates and accelerations need no poses, and know better what they miss.
        Err(IdentificationError::MissingColumn(Column::Pose)) if automatic => {
            with_lag(Regression::NewtonEuler, settings.lag.unwrap_or(1))
        }
        // Rates and velocities need no equal steps, rates and accelerations no poses.
        Ok(found)
            if automatic
                && (2 * found.rows.skipped_unequal > found.rows.windows
                    || 2 * found.rows.without_pose > found.rows.windows) =>
        {
            with_lag(Regression::NewtonEuler, settings.lag.unwrap_or(1)).or(Ok(found))
        }
        other => other,
    };
    let likelihood = || -> Result<Option<Best>, IdentificationError> {
        let open = plan.way == Way::Auto;
        let found = if open { most_likely(record, timeline, plan)? } else { None };
        Ok(found.map(|found| Best::Likelihood(Box::new(found))))
    };
    let first = match first {
        // Steps so unequal that no row is left.
        Err(error @ IdentificationError::TooFewSamples { .. }) => return likelihood()?.ok_or(error),
        first => first?,
    };
    let noisy = first.scheme.lag == 1 && first.is_noisy();
    let of_rates = first.scheme.regression == Regression::NewtonEuler;
    let flagged = |fit: Fit| Fit { poses_noisy: noisy && !of_rates, rates_noisy: noisy && of_rates, ..fit };
    let mostly_unused = 2 * first.rows.skipped_unequal > first.rows.windows;
    if settings.lag.is_some() || !noisy && !mostly_unused {
        return Ok(flagged(first).into());
    }
    if let Some(found) = likelihood()? {
        return Ok(found);
    }
    if !noisy {
        return Ok(flagged(first).into());
    }
    let mut methods = vec![first.scheme.regression];
    if automatic {
        methods.push(Regression::NewtonEuler);
    }
    let least = first.least_squares.as_ref().map_or(f64::INFINITY, |found| predicted_error(found, &SVector::zeros()));
    let mut best = (least, method, 1);
    for method in methods {
        let scheme = |lag| Scheme::new(settings, method, lag);
        let fits: Vec<(usize, WeightedLeastSquares)> = LAGS
            .into_iter()
            .take_while(|&lag| 4 * scheme(lag).reach() <= timeline.len())
            .map_while(|lag| Fit::new(scheme(lag), record, timeline, noise).ok().map(|fit| (lag, fit.least_squares)))
            .filter_map(|(lag, found)| Some((lag, found?)))
            .collect();
        for (lag, found) in &fits {
            let Some((_, longer)) = fits.iter().find(|(other, _)| *other == 2 * lag) else { continue };
            let error = predicted_error(found, &discretisation(&scheme(*lag), found, longer));
            if error < best.0 {
                best = (error, method, *lag);
            }
        }
    }
    let (_, method, lag) = best;
    if lag == 1 { Ok(flagged(first).into()) } else { with_lag(method, lag).map(|fit| flagged(fit).into()) }
}

/// Mass from force over acceleration, length from torque over force, or from accelerations where there is no torque.
pub(crate) fn rough_scale(rows: &[WrenchRow]) -> Result<BodyScale, IdentificationError> {
    let rms = |f: &dyn Fn(&WrenchRow) -> Vector3<f64>| {
        let sum: f64 = rows.iter().map(|row| f(row).norm_squared()).sum();
        ComplexField::sqrt(sum / rows.len().max(1) as f64)
    };
    let column = |h: &Regressor<f64>, j: usize| Vector3::new(h[(3, j)], h[(4, j)], h[(5, j)]);
    let force = rms(&|row| row.wrench.fixed_rows::<3>(3).into_owned());
    let torque = rms(&|row| row.wrench.fixed_rows::<3>(0).into_owned());
    let acceleration = rms(&|row| column(&row.regressor, 0));
    let angular = rms(&|row| column(&row.regressor, 1) + column(&row.regressor, 2));
    let ratio =
        |a: f64, b: f64, otherwise: f64| if a > 0.0 && b > 0.0 && (a / b).is_finite() { a / b } else { otherwise };
    let length = ratio(torque, force, ratio(acceleration, angular, 0.3)).clamp(LENGTHS_M.0, LENGTHS_M.1);
    BodyScale::try_new(ratio(force, acceleration, 1.0), length)
}
