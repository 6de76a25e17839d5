//! What acts on a body beside the logged wrench: gravity gradient, drag.

use super::identification::Identification;
use super::identify;
use super::settings::Settings;
use crate::beside::listed_beside;
use crate::dynamics::{InertialParameters, RigidBodyState, WrenchModel};
use crate::error::{Column, IdentificationError};
use crate::estimator::{Finding, Judge, Verdict, standard_deviations};
use crate::lie::{LieGroup, Pose, Twist, Wrench};
use crate::motion::{MotionSample, filled_poses};
use crate::{BodyScale, SquareRootInformation};
use nalgebra::{SMatrix, SVector, Vector3};

/// Times that a body is looked for in the wrenches on the last one found.
const MOST_PASSES: u32 = 12;
/// Sigmas by which the last pass may still move the body.
const AT_REST: f64 = 0.05;
/// A step larger than this share of the last one is that of a slope taken too far away.
const SHRINKS: f64 = 0.2;
/// Change of a parameter, in sigmas, from which its effect on the answer is taken: far more than rounding, and so little that weights
/// of rows and limits of bodies stay what they are.
const TRIED: f64 = 3.0;

/// [`identify`] where more acts than the log says.
///
/// What the models do may depend on the body that is looked for ([`WrenchModel::wrench_on`]): it is identified again under
/// the wrenches on the last body found until it rests, first on the body of the prior, or on that which the models know.
/// Where the data determine no body, the models' own stays. A body on whose parameters its own wrench depends is the less
/// certain; standard deviations count that, at the cost of one more identification for each parameter that matters.
///
/// Every method takes it, and [`MotionSample::stored_momentum_body`] too, but the sliding window ([`LongRecord`](crate::LongRecord) hands
/// such records over) and periodic identification, which refuses it ([`IdentificationError::WrenchBeside`]).
///
/// # Errors
/// Those of [`identify`]; [`IdentificationError::EnvironmentUnsettled`] where no body agrees with the wrenches on it, as under
/// gravity that the motion does not show; what is uniform belongs into [`Settings::gravity_world`].
///
/// # Example
/// ```
/// use tumble_identification::dynamics::{Environment, LinearDrag};
/// use tumble_identification::nalgebra::Vector3;
/// use tumble_identification::{Settings, identify_in};
/// let air = LinearDrag {
///     center_of_pressure: Vector3::zeros(),
///     force_coefficient: 0.1,
///     torque_coefficient: 0.01,
///     medium_velocity_world: Vector3::zeros(),
/// };
/// assert!(identify_in(&[], &Settings::default(), &Environment::default().with(air)).is_err()); // no record
/// ```
pub fn identify_in(
    record: &[MotionSample],
    settings: &Settings,
    environment: &dyn WrenchModel<f64>,
) -> Result<Identification, IdentificationError> {
    let levels = Judge::new(BodyScale::try_new(1.0, 1.0)?);
    in_environment(record, settings, environment, levels, identify)
}

/// The same for any way to identify a record, judged by these levels.
pub(super) fn in_environment<E: From<IdentificationError>>(
    record: &[MotionSample],
    settings: &Settings,
    environment: &dyn WrenchModel<f64>,
    levels: Judge,
    identified: impl Fn(&[MotionSample], &Settings) -> Result<Identification, E>,
) -> Result<Identification, E> {
    let acting = |body: Option<&InertialParameters<f64>>| with_all_that_acts(record, environment, body);
    let mut body = settings.prior.map(|prior| prior.mean);
    let mut acted = acting(body.as_ref())?;
    // Wrenches on a wrong body look like noise in the poses, so that method and lag are chosen again with every slope, and kept between.
    let mut chosen = *settings;
    let (mut moved, mut feedback): (_, Option<Feedback>) = (f64::INFINITY, None);
    for _ in 0..MOST_PASSES {
        let found = identified(&acted, &chosen)?;
        let Some(estimate) = found.estimate else {
            return if moved.is_finite() { Err(unsettled(moved).into()) } else { Ok(found) };
        };
        let mut next = estimate.parameters;
        if acting(Some(&next))? == acted {
            return Ok(found);
        }
        if let Some(before) = body.map(|body| body.to_vector()) {
            if feedback.is_none() {
                chosen = Settings { method: found.method, lag: found.lag_of_rows().or(settings.lag), ..*settings };
                feedback = Feedback::of(&acting, &found, before, &Settings { prior: None, ..chosen }, &identified)?;
            }
            let Some(known) = &feedback else { return Ok(found) };
            let step = known.amplified * (next.to_vector() - before);
            let sigma = (known.amplified * estimate.covariance * known.amplified.transpose()).diagonal();
            let last = core::mem::replace(&mut moved, step.component_div(&sigma.map(f64::sqrt)).amax());
            if moved < AT_REST {
                return Ok(known.counted_in(found, &before, settings, levels)?);
            }
            next = InertialParameters::from_vector(&(before + step));
            // Far from the body that agrees the weights of rows are others.
            feedback = feedback.filter(|_| moved < SHRINKS * last);
            if feedback.is_none() {
                chosen = *settings;
            }
        }
        (body, acted) = (Some(next), acting(Some(&next))?);
    }
    Err(unsettled(moved).into())
}

impl Identification {
    /// `None` where the answer is not by rows.
    fn lag_of_rows(&self) -> Option<usize> {
        (self.method != super::MAXIMUM_LIKELIHOOD).then_some(self.lag)
    }
}

/// How much the body found follows the body on which the wrenches were taken.
struct Feedback {
    /// Change of the one per change of the other, `K`.
    followed: SMatrix<f64, 10, 10>,
    /// `(1 - K)^-1`: what noise does to a body that agrees with its wrenches, per what it does to one under given wrenches.
    amplified: SMatrix<f64, 10, 10>,
}

impl Feedback {
    /// By trying each parameter, without a prior. `None` where the data alone determine no body, so that nothing can be tried.
    fn of<E: From<IdentificationError>>(
        acting: &impl Fn(Option<&InertialParameters<f64>>) -> Result<Vec<MotionSample>, IdentificationError>,
        found: &Identification,
        at: SVector<f64, 10>,
        settings: &Settings,
        identified: &impl Fn(&[MotionSample], &Settings) -> Result<Identification, E>,
    ) -> Result<Option<Self>, E> {
        let answer = |ten: &SVector<f64, 10>| -> Result<Option<SVector<f64, 10>>, E> {
            let acted = acting(Some(&InertialParameters::from_vector(ten)))?;
            Ok(identified(&acted, settings)?.estimate.map(|estimate| estimate.parameters.to_vector()))
        };
        let here = acting(Some(&InertialParameters::from_vector(&at)))?;
        let (Some(middle), Some(estimate)) = (answer(&at)?, &found.estimate) else { return Ok(None) };
        let changes = estimate.covariance.diagonal().map(|variance| TRIED * variance.sqrt());
        let mut followed = SMatrix::<f64, 10, 10>::zeros();
        for i in 0..10 {
            let tried = at + SVector::<f64, 10>::ith(i, changes[i]);
            if acting(Some(&InertialParameters::from_vector(&tried)))? == here {
                continue;
            }
            let Some(found) = answer(&tried)? else { return Ok(None) };
            followed.set_column(i, &((found - middle) / changes[i]));
        }
        let amplified = (SMatrix::<f64, 10, 10>::identity() - followed).try_inverse();
        Ok(amplified.map(|amplified| Self { followed, amplified }))
    }

    /// The answer under the wrenches on `body`, with what is known of it when the wrenches are its own.
    fn counted_in(
        &self,
        mut found: Identification,
        body: &SVector<f64, 10>,
        settings: &Settings,
        levels: Judge,
    ) -> Result<Identification, IdentificationError> {
        let (factor, sizes) = (found.information.factor(), found.scale.parameter_magnitudes());
        let rhs = found.information.rhs() - factor * self.followed * body;
        found.information = SquareRootInformation::from_square_root(&(factor - factor * self.followed), &rhs)?;
        let (mut all, mut prior) = (found.information, SquareRootInformation::new());
        if let Some(known) = &settings.prior {
            prior.add_prior(&known.mean.to_vector(), &known.standard_deviation)?;
            all.merge(&prior);
        }
        let Some(estimate) = &mut found.estimate else { return Ok(found) };
        let (point, data_alone) = (estimate.parameters.to_vector(), settings.prior.is_none());
        estimate.covariance = if data_alone {
            self.amplified * estimate.covariance * self.amplified.transpose()
        } else {
            all.covariance(&sizes)?
        };
        estimate.std = standard_deviations(&point, &estimate.covariance);
        let finding = Finding::of_information(all, sizes).with_prior(prior).at(point);
        let again = Judge { scale: found.scale, ..levels }.judge(&finding, &found.evidence, None)?;
        if again != Verdict::Identified {
            found.verdict = again;
        }
        Ok(found)
    }
}

fn unsettled(sigmas: f64) -> IdentificationError {
    IdentificationError::EnvironmentUnsettled { passes: MOST_PASSES, sigmas }
}

/// A record that lists what the environment does to `body`, to the body that its models know where it is `None`, as
/// [`MotionSample::besides_body`], in addition to what stands there.
///
/// Motion between poses fills in for rates, velocities and poses that were not measured. The time of the models is that of
/// the stamps, s.
///
/// # Errors
/// [`IdentificationError::MissingColumn`] for a record without any pose.
pub fn with_all_that_acts(
    record: &[MotionSample],
    environment: &dyn WrenchModel<f64>,
    body: Option<&InertialParameters<f64>>,
) -> Result<Vec<MotionSample>, IdentificationError> {
    let poses = filled_poses(record).ok_or(IdentificationError::MissingColumn(Column::Pose))?;
    let listed = listed_beside(record);
    let acting = |i: usize| {
        let sample = &record[i];
        let (time_s, state) = (sample.time_ns as f64 * 1e-9, state_at(record, &poses, i));
        let wrench = match body {
            Some(body) => environment.wrench_on(body, time_s, &state),
            None => environment.wrench_body(time_s, &state),
        };
        let besides_body = Some(listed.as_ref().map_or_else(Wrench::zero, |listed| listed[i]) + wrench);
        MotionSample { besides_body, ..*sample }
    };
    Ok((0..record.len()).map(acting).collect())
}

/// Pose, and twist measured or from the poses beside.
fn state_at(record: &[MotionSample], poses: &[Pose<f64>], i: usize) -> RigidBodyState<f64> {
    let sample = &record[i];
    let (before, after) = (i.saturating_sub(1), (i + 1).min(record.len() - 1));
    let step_s = (record[after].time_ns - record[before].time_ns) as f64 * 1e-9;
    let per_second = if step_s > 0.0 { 1.0 / step_s } else { 0.0 };
    let (from, to) = (&poses[before], &poses[after]);
    let angular = sample.rate_body.unwrap_or_else(|| {
        let turn: Vector3<f64> = LieGroup::log(&from.rotation.between(&to.rotation));
        turn * per_second
    });
    let velocity_world =
        sample.velocity_origin_world.unwrap_or_else(|| (to.translation.vector - from.translation.vector) * per_second);
    let linear = poses[i].rotation.inverse() * velocity_world;
    RigidBodyState { world_from_body: poses[i], twist_body: Twist::new(angular, linear) }
}
