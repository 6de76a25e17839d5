//! What acts on a body beside the logged wrench: gravity gradient, drag, the momentum of wheels.

use super::{Identification, Settings, identify};
use crate::WrenchTiming;
use crate::dynamics::{InertialParameters, RigidBodyState, WrenchModel};
use crate::error::IdentificationError;
use crate::lie::{LieGroup, Twist, Wrench};
use crate::motion::MotionSample;
use nalgebra::Vector3;
use std::borrow::Cow;

/// Times that a body is looked for in the wrenches on the last one found.
const MOST_PASSES: u32 = 8;
/// Sigmas by which the last pass may still move the body.
const AT_REST: f64 = 0.01;

/// [`identify`] where more acts than the log says.
///
/// What the models do may depend on the body that is looked for ([`WrenchModel::wrench_on`]): it is identified again under
/// the wrenches on the last body found until it rests, first on the body of the prior, or on that which the models know.
/// Where the data determine no body, the models' own stays.
///
/// # Errors
/// Those of [`identify`]; [`IdentificationError::EnvironmentUnsettled`] where the wrenches depend too strongly on the body, as those of uniform
/// gravity do, which belongs into [`Settings::gravity_world`].
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
    in_environment(record, settings, environment, |record| identify(record, settings))
}

/// The same for any way to identify a record.
pub(super) fn in_environment<E: From<IdentificationError>>(
    record: &[MotionSample],
    settings: &Settings,
    environment: &dyn WrenchModel<f64>,
    identified: impl Fn(&[MotionSample]) -> Result<Identification, E>,
) -> Result<Identification, E> {
    let acting =
        |body: Option<&InertialParameters<f64>>| with_all_that_acts(record, settings.wrench_timing, environment, body);
    let mut body = settings.prior.map(|prior| prior.mean);
    let mut acted = acting(body.as_ref());
    let mut moved = f64::INFINITY;
    for _ in 0..MOST_PASSES {
        let found = identified(&acted)?;
        let Some(estimate) = found.estimate else { return Ok(found) };
        let next = acting(Some(&estimate.parameters));
        if let Some(before) = body {
            let step = estimate.parameters.to_vector() - before.to_vector();
            let sigma = estimate.covariance.diagonal().map(f64::sqrt);
            moved = step.component_div(&sigma).amax();
        }
        if moved < AT_REST || next == acted {
            return Ok(found);
        }
        (body, acted) = (Some(estimate.parameters), next);
    }
    Err(IdentificationError::EnvironmentUnsettled { passes: MOST_PASSES, sigmas: moved }.into())
}

/// A record in which the wrench is all that acts: with what the environment does to `body` (to the body that its models
/// know where it is `None`), and with the torque of turning stored momentum, which is then no longer listed.
///
/// Motion between poses fills in for rates and velocities that were not measured. Over a held wrench the mean of both ends
/// counts. The time of the models is that of the stamps, s.
pub fn with_all_that_acts<'a>(
    record: &'a [MotionSample],
    timing: WrenchTiming,
    environment: &dyn WrenchModel<f64>,
    body: Option<&InertialParameters<f64>>,
) -> Cow<'a, [MotionSample]> {
    let besides: Vec<Wrench<f64>> = (0..record.len())
        .map(|i| {
            let (sample, state) = (&record[i], state_at(record, i));
            let time_s = sample.time_ns as f64 * 1e-9;
            let wrench = match body {
                Some(body) => environment.wrench_on(body, time_s, &state),
                None => environment.wrench_body(time_s, &state),
            };
            let stored = sample.stored_momentum_body.unwrap_or_default();
            Wrench::new(wrench.torque + stored.cross(&state.twist_body.angular), wrench.force)
        })
        .collect();
    if record.iter().all(|sample| sample.stored_momentum_body.is_none())
        && besides.iter().all(|wrench| *wrench == Wrench::zero())
    {
        return Cow::Borrowed(record);
    }
    let acting = |i: usize| match timing {
        WrenchTiming::Held => (besides[i] + besides[(i + 1).min(record.len() - 1)]) * 0.5,
        WrenchTiming::Sampled => besides[i],
    };
    let added = |(i, sample): (usize, &MotionSample)| MotionSample {
        wrench_body: sample.wrench_body.map(|wrench| wrench + acting(i)),
        stored_momentum_body: None,
        ..*sample
    };
    Cow::Owned(record.iter().enumerate().map(added).collect())
}

/// The same for stored momentum alone.
pub(crate) fn with_stored_momentum(record: &[MotionSample], timing: WrenchTiming) -> Cow<'_, [MotionSample]> {
    if record.iter().all(|sample| sample.stored_momentum_body.is_none()) {
        return Cow::Borrowed(record);
    }
    with_all_that_acts(record, timing, &(), None)
}

/// Pose, and twist measured or from the poses beside.
fn state_at(record: &[MotionSample], i: usize) -> RigidBodyState<f64> {
    let sample = &record[i];
    let (before, after) = (&record[i.saturating_sub(1)], &record[(i + 1).min(record.len() - 1)]);
    let step_s = (after.time_ns - before.time_ns) as f64 * 1e-9;
    let per_second = if step_s > 0.0 { 1.0 / step_s } else { 0.0 };
    let rotation = sample.world_from_body.rotation;
    let (from, to) = (&before.world_from_body, &after.world_from_body);
    let angular = sample.rate_body.unwrap_or_else(|| {
        let turn: Vector3<f64> = LieGroup::log(&from.rotation.between(&to.rotation));
        turn * per_second
    });
    let velocity_world =
        sample.velocity_origin_world.unwrap_or_else(|| (to.translation.vector - from.translation.vector) * per_second);
    RigidBodyState {
        world_from_body: sample.world_from_body,
        twist_body: Twist::new(angular, rotation.inverse() * velocity_world),
    }
}
