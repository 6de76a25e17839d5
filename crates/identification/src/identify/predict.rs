//! What a motion can answer before any wrench is believed.

use super::fit::{LAGS, rough_scale};
use super::noise::SampleNoise;
use super::plan::Way;
use super::plane::is_in_xy_plane;
use super::rows::{Regression, Scheme};
use super::settings::Settings;
use super::timeline::Timeline;
use crate::error::IdentificationError;
use crate::estimator::{StandardDeviations, standard_deviations};
use crate::jacobi::singular_values;
use crate::motion::{MotionSample, Noise};
use crate::weighted_least_squares::{RowNoise, noise_information, weights, whitened};
use crate::{BodyScale, NullDirection, Observability, RANK_TOLERANCE};
use nalgebra::SMatrix;

/// A direction of which more than this share is noise in the motion is not seen.
const LARGEST_NOISE_SHARE: f64 = 0.5;
/// Noise that makes less than this share of every direction may be left out.
const NEGLIGIBLE_NOISE_SHARE: f64 = 0.01;

/// Parameters that a motion in the plane shows.
const IN_PLANE: usize = 4;

/// What a record can answer, before any wrench is believed.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Number of parameter directions the motion determines.
    pub rank: usize,
    /// Condition number of the regressor, its columns in like units.
    pub condition_number: f64,
    /// Directions left free; displayed, they say so in words.
    pub null_directions: Vec<NullDirection>,
    /// Predicted covariance of the ten parameters for the given wrench noise; `None` below rank ten.
    pub covariance: Option<SMatrix<f64, 10, 10>>,
    /// Standard deviations derived from it; `None` too where neither wrenches nor a prior say what body it is.
    pub std: Option<StandardDeviations>,
    /// The motion stays in the xy plane, as that of a body on a table does: of the ten parameters it shows four at most.
    pub planar: bool,
    /// Rows the record gives.
    pub rows: usize,
    /// Samples between the poses of one row.
    pub lag: usize,
    /// Noise of the motion that was found in it, and that of the wrench that was given.
    pub noise: Noise,
    /// Largest share of noise in what any direction shows.
    pub noise_share: f64,
}

/// What the motion of a record can answer, given the noise of its wrench (torque, force; one standard deviation of one
/// sample). The record need not hold any wrench.
///
/// White noise in the motion is no motion: it is found by high differences, where it makes much of what the rows show longer rows are
/// taken, and a direction of which it makes more than half is not seen. Slow errors cannot be told from motion without a
/// wrench; where there is one, the standard deviations of [`identify`](super::identify) are the better promise.
///
/// # Errors
/// As [`identify`](super::identify).
pub fn predict(
    record: &[MotionSample],
    settings: &Settings,
    wrench_noise: (f64, f64),
) -> Result<Prediction, IdentificationError> {
    let timeline = Timeline::try_new(record)?;
    let regression = Way::named(settings.method)?.regression();
    let noise = SampleNoise::estimate(record, &timeline, settings);
    let of =
        Motion { record, timeline: &timeline, settings, wrench_noise, noise: &noise, planar: is_in_xy_plane(record) };
    let mut best = of.seen(regression, settings.lag.unwrap_or(1))?;
    if settings.lag.is_none() && best.noise_share > NEGLIGIBLE_NOISE_SHARE {
        let regressions =
            if settings.method == super::AUTO { vec![regression, Regression::NewtonEuler] } else { vec![regression] };
        for regression in regressions {
            // The shortest rows of which noise makes next to nothing, or else those that see most.
            for other in LAGS.into_iter().map_while(|lag| of.seen(regression, lag).ok()) {
                let (shorter, longer) = (best.noise_share, other.noise_share);
                if other.rank > best.rank
                    || other.rank == best.rank && longer < shorter && shorter > NEGLIGIBLE_NOISE_SHARE
                {
                    best = other;
                }
            }
        }
    }
    Ok(best)
}

/// A record, and what it is looked at with.
struct Motion<'a> {
    record: &'a [MotionSample],
    timeline: &'a Timeline,
    settings: &'a Settings,
    wrench_noise: (f64, f64),
    noise: &'a SampleNoise,
    planar: bool,
}

impl Motion<'_> {
    fn seen(&self, regression: Regression, lag: usize) -> Result<Prediction, IdentificationError> {
        let mut scheme = Scheme::new(self.settings, regression, lag);
        scheme.wrench_optional = true;
        let rows = scheme.rows(self.record, self.timeline)?;
        let prior = self.settings.prior.as_ref().map(|prior| prior.mean.to_vector());
        let scale = match &prior {
            Some(body) => BodyScale::of(body)?,
            None => rough_scale(&rows.all)?,
        };
        let magnitudes = scale.parameter_magnitudes();
        // Overlapping averages of white noise keep its density at low frequency, which is what a fit sees; where only a pair
        // of rows in every stride is formed, each stands for more.
        let share = (2.0 / scheme.stride() as f64).min(1.0).sqrt();
        let row_noise = self.noise.of_rows(&scheme, self.timeline.median_step_s());
        let (torque, force) = (self.wrench_noise.0 * share, self.wrench_noise.1 * share);
        let (torque, force) = of_rows(torque, force, &row_noise, scale);
        let information = whitened(&rows.all, torque, force)?;
        // Shares of noise, direction by direction.
        let to_scaled = SMatrix::<f64, 10, 10>::from_diagonal(&magnitudes);
        let noise =
            to_scaled * noise_information(&weights(torque, force), &row_noise) * to_scaled * rows.all.len() as f64;
        let (values, right) = singular_values(information.factor() * to_scaled);
        let shares: Vec<f64> = right
            .column_iter()
            .zip(values.iter())
            .map(|(v, value)| (v.transpose() * noise * v).x / (value * value + f64::MIN_POSITIVE))
            .collect();
        let seen = shares.iter().take_while(|share| **share < LARGEST_NOISE_SHARE).count();
        let tolerance =
            if seen < 10 && values[0] > 0.0 { (values[seen] / values[0]).max(RANK_TOLERANCE) } else { RANK_TOLERANCE };
        let observability = Observability::with_tolerance(&information, scale, tolerance);
        let rank = observability.rank().min(seen).min(if self.planar { IN_PLANE } else { 10 });
        let covariance = information.covariance(&magnitudes).ok().filter(|_| rank == 10);
        let body = prior.or_else(|| information.solve(&magnitudes).ok());
        let std = covariance
            .zip(body.filter(|body| body[0] > 0.0))
            .map(|(covariance, body)| standard_deviations(&body, &covariance));
        Ok(Prediction {
            rank,
            condition_number: observability.condition_number(),
            null_directions: observability.null_directions().to_vec(),
            covariance,
            std,
            planar: self.planar,
            rows: 6 * rows.all.len(),
            lag,
            noise: self.noise.with_wrench(self.wrench_noise.0, self.wrench_noise.1),
            noise_share: shares.iter().fold(0.0, |most: f64, share| most.max(share.min(1.0))),
        })
    }
}

/// One standard deviation of the torque and force of a row: of the wrench, and of the noise of accelerations on a body of this size.
fn of_rows(torque: f64, force: f64, noise: &RowNoise, scale: BodyScale) -> (f64, f64) {
    let (mass, length) = (scale.mass_kg(), scale.length_m());
    let inertia = mass * length * length;
    (
        torque.hypot(inertia * noise.angular_acceleration_variance.sqrt()),
        force.hypot(mass * noise.acceleration_variance.sqrt()),
    )
}
