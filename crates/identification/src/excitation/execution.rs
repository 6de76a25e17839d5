//! Flying a periodic motion with a tracker: what happened, and how much of it at the limits of the actuators.

use crate::dynamics::{Plant, PoseTracker, RigidBodyState, SimulatedMeasurement};
use crate::error::IdentificationError;
use crate::fourier::FourierMotion;
use crate::lie::{Pose, Wrench};
use num_traits::AsPrimitive;

/// A wanted and a realised wrench that differ by less than this share of the wanted torque or force are the same: allocation
/// to nozzles rounds.
const ROUNDING: f64 = 1e-6;
/// The period may miss a whole number of steps by this share of a step.
const STEP_MISFIT: f64 = 1e-6;

/// One control step of an [`Execution`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExecutionSample {
    /// Time since the start, s.
    pub time_s: f64,
    /// True state at that time.
    pub state: RigidBodyState<f64>,
    /// Wrench the tracker asked for, body axes.
    pub wanted_wrench_body: Wrench<f64>,
    /// Wrench that acted from this time to the next, held in body axes: the wanted one after saturation.
    pub realized_wrench_body: Wrench<f64>,
}

impl ExecutionSample {
    /// Which components `[torque; force]` were at a limit: realised otherwise than wanted.
    pub fn saturated(&self) -> [bool; 6] {
        let lost = (self.wanted_wrench_body - self.realized_wrench_body).to_vector();
        let [torque, force] = [self.wanted_wrench_body.torque.amax(), self.wanted_wrench_body.force.amax()];
        core::array::from_fn(|i| lost[i].abs() > ROUNDING * if i < 3 { torque } else { force })
    }
}

/// How much of the time inputs were at their limits.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Saturation {
    /// Share of the time with any component at its limit.
    pub any: f64,
    /// Share of the time with each component `[torque; force]` at its limit.
    pub by_component: [f64; 6],
}

impl Saturation {
    /// Of control steps of equal length; nothing at all is not saturated.
    pub fn of(samples: &[ExecutionSample]) -> Self {
        let (mut any, mut by_component) = (0_usize, [0_usize; 6]);
        for saturated in samples.iter().map(ExecutionSample::saturated) {
            any += usize::from(saturated.contains(&true));
            for (count, at_limit) in by_component.iter_mut().zip(saturated) {
                *count += usize::from(at_limit);
            }
        }
        let share = |count: usize| count as f64 / samples.len().max(1) as f64;
        Self { any: share(any), by_component: by_component.map(share) }
    }
}

/// Some cycles of a motion as they were flown.
#[derive(Clone, Debug, PartialEq)]
pub struct Execution {
    /// The control steps of all cycles; the end of the last is not among them.
    pub samples: Vec<ExecutionSample>,
    /// Control steps in one cycle.
    pub samples_per_cycle: usize,
    /// Time at the limits, over all cycles.
    pub saturation: Saturation,
}

/// Flies `cycles` cycles of a motion that starts at `world_from_start`, a control step every `step_s`.
///
/// The plant is taken to be where the motion starts, with its velocity: a designed motion starts at rest. The tracker sees the
/// true state, as if a state estimator stood before it; noise belongs to the log made of the result.
///
/// # Frame
/// World: that of `world_from_start`, in which the motion's coordinates start.
/// # Errors
/// [`IdentificationError::PeriodNotWhole`] for a period that is no whole number of steps;
/// [`IdentificationError::AttitudeUndefined`]; the plant's own.
/// # Source
/// Thesis 4.3.
pub fn execute<P>(
    motion: &FourierMotion,
    tracker: &PoseTracker,
    plant: &mut P,
    world_from_start: &Pose<f64>,
    cycles: usize,
    step_s: f64,
) -> Result<Execution, IdentificationError>
where
    P: Plant<Input = Wrench<f64>, Measurement = SimulatedMeasurement>,
    IdentificationError: From<P::Error>,
{
    let period_s = motion.basis().period_s();
    let samples_per_cycle = samples_per_period(period_s, step_s)?;
    let references = (0..samples_per_cycle)
        .map(|i| {
            let time_s = period_s * i as f64 / samples_per_cycle as f64;
            let instant = motion.at(time_s).ok_or(IdentificationError::AttitudeUndefined { time_s })?;
            Ok(instant.reference(world_from_start))
        })
        .collect::<Result<Vec<_>, IdentificationError>>()?;
    let mut samples = Vec::with_capacity(cycles * samples_per_cycle);
    let mut state = references.first().map_or_else(RigidBodyState::at_rest, |reference| reference.state);
    for cycle in 0..cycles {
        for (i, reference) in references.iter().enumerate() {
            let wanted_wrench_body = tracker.wrench_body(&state, reference);
            let measured = plant.advance(&wanted_wrench_body, step_s)?;
            samples.push(ExecutionSample {
                time_s: period_s * (cycle as f64 + i as f64 / samples_per_cycle as f64),
                state,
                wanted_wrench_body,
                realized_wrench_body: measured.realized_wrench_body,
            });
            state = measured.state;
        }
    }
    let saturation = Saturation::of(&samples);
    Ok(Execution { samples, samples_per_cycle, saturation })
}

/// Most samples in a period: a minute at more than 10 kHz.
const MOST_SAMPLES: usize = 1_000_000;

/// Samples in a period that starts anew on a sample.
///
/// # Errors
/// [`IdentificationError::PeriodNotWhole`]; [`IdentificationError::TooManySamples`] above a million.
pub fn samples_per_period(period_s: f64, step_s: f64) -> Result<usize, IdentificationError> {
    let steps = period_s / step_s;
    let whole = steps.round();
    let most = MOST_SAMPLES as f64;
    if whole.is_finite() && whole > most {
        return Err(IdentificationError::TooManySamples { period_s, step_s, samples: whole, largest: MOST_SAMPLES });
    }
    if !(1.0..=most).contains(&whole) || (steps - whole).abs() > STEP_MISFIT {
        let nearest = whole.max(1.0);
        return Err(IdentificationError::PeriodNotWhole {
            period_s,
            step_s,
            nearest_period_s: nearest * step_s,
            nearest_step_s: period_s / nearest,
        });
    }
    Ok(whole.as_())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::{FreeFlyer, InertialParameters, MuntheKaas4, SimulatedBody, WrenchBox};
    use crate::fourier::{AttitudeChart, FourierBasis};
    use crate::lie::{LieGroup, Manifold};
    use nalgebra::{DMatrix, Matrix3, Translation3, UnitQuaternion, Vector3};
    use std::f64::consts::TAU;

    fn body() -> InertialParameters<f64> {
        let inertia = Matrix3::from_diagonal(&Vector3::new(0.05, 0.04, 0.06));
        InertialParameters::about_com(6.0, Vector3::zeros(), inertia)
    }

    fn laden() -> InertialParameters<f64> {
        let payload = InertialParameters::solid_box(1.0, [0.1, 0.15, 0.2]);
        let place = Pose::from_parts(Translation3::new(0.1, -0.05, 0.08), UnitQuaternion::identity());
        body().with_payload(&payload, &place)
    }

    fn limits(torque: f64, force: f64) -> WrenchBox {
        WrenchBox { torque_limit: Vector3::repeat(torque), force_limit: Vector3::repeat(force) }
    }

    /// Rest to rest in all six channels.
    fn motion() -> FourierMotion {
        let basis = FourierBasis::try_new(10.0, 3).unwrap();
        let free = DMatrix::from_fn(4, 6, |row, column| 0.12 * (1.0 + 3.0 * row as f64 + 2.0 * column as f64).sin());
        FourierMotion::try_new(basis, AttitudeChart::EulerZyx, basis.rest_to_rest() * free).unwrap()
    }

    fn start() -> Pose<f64> {
        Pose::from_parts(Translation3::new(1.0, -2.0, 0.5), UnitQuaternion::new(Vector3::new(0.4, -0.9, 1.3)))
    }

    fn fly(truth: InertialParameters<f64>, limits: WrenchBox, cycles: usize, step_s: f64) -> Execution {
        let at_start = RigidBodyState { world_from_body: start(), ..RigidBodyState::at_rest() };
        let mut plant = SimulatedBody::try_new(FreeFlyer::new(truth), MuntheKaas4, limits, at_start, 0.02).unwrap();
        let tracker = PoseTracker::critically_damped(FreeFlyer::new(body()), 2.0, 2.0);
        execute(&motion(), &tracker, &mut plant, &start(), cycles, step_s).unwrap()
    }

    /// Largest pose error (rad, m) against the motion.
    fn largest_error(flown: &Execution) -> f64 {
        let error = |sample: &ExecutionSample| {
            let wanted = start() * motion().at(sample.time_s).unwrap().world_from_body;
            LieGroup::log(&wanted.between(&sample.state.world_from_body)).amax()
        };
        flown.samples.iter().map(error).fold(0.0, f64::max)
    }

    #[test]
    fn the_nominal_body_follows_up_to_the_error_of_holding() {
        let (coarse, fine) = (fly(body(), limits(9.0, 9.0), 2, 0.02), fly(body(), limits(9.0, 9.0), 2, 0.01));
        assert_eq!((fine.samples.len(), fine.samples_per_cycle), (2000, 1000));
        assert_eq!(fine.saturation, Saturation::default());
        let (coarse, fine) = (largest_error(&coarse), largest_error(&fine));
        assert!(fine < 3e-3 && (1.7..2.3).contains(&(coarse / fine)), "{coarse} {fine}");
    }

    #[test]
    fn a_laden_body_repeats_itself_after_the_first_cycle() {
        let flown = fly(laden(), limits(9.0, 9.0), 4, 0.02);
        let apart = |cycle: usize| {
            let cycle_of = |c: usize| flown.samples.iter().skip(c * flown.samples_per_cycle);
            cycle_of(cycle)
                .zip(cycle_of(cycle + 1))
                .take(flown.samples_per_cycle)
                .map(|(a, b)| LieGroup::log(&a.state.world_from_body.between(&b.state.world_from_body)).amax())
                .fold(0.0, f64::max)
        };
        let (first, later) = (apart(0), apart(2));
        assert!(first > 1e-3 && later < 1e-6, "{first:e} {later:e}");
        assert!(largest_error(&flown) > 1e-2, "the payload is unknown to the tracker");
    }

    #[test]
    fn every_sample_is_where_the_wrenches_before_it_lead() {
        let flown = fly(laden(), limits(0.02, 0.3), 1, 0.02);
        assert!(flown.saturation.any > 0.2, "{:?}", flown.saturation);
        let at_start = RigidBodyState { world_from_body: start(), ..RigidBodyState::at_rest() };
        let unlimited = limits(9.0, 9.0);
        let mut again =
            SimulatedBody::try_new(FreeFlyer::new(laden()), MuntheKaas4, unlimited, at_start, 0.02).unwrap();
        for sample in &flown.samples {
            assert!(again.state().ominus(&sample.state).amax() < 1e-12);
            again.advance(&sample.realized_wrench_body, 0.02).unwrap();
        }
    }

    /// Without feedback the wrench along x is a cosine: with limits at half its peak it is cut two thirds of the time.
    #[test]
    fn saturation_of_a_cosine_cut_at_half_its_peak() {
        let basis = FourierBasis::try_new(7.2, 1).unwrap();
        let mut coefficients = DMatrix::zeros(3, 6);
        coefficients[(2, 0)] = 0.3;
        let motion = FourierMotion::try_new(basis, AttitudeChart::EulerZyx, coefficients).unwrap();
        let tracker = PoseTracker::critically_damped(FreeFlyer::new(body()), 0.0, 0.0);
        let peak = body().mass * 0.3 * TAU / 7.2;
        let mut plant = SimulatedBody::try_new(
            FreeFlyer::new(body()),
            MuntheKaas4,
            limits(1.0, 0.5 * peak),
            RigidBodyState::at_rest(),
            0.1,
        )
        .unwrap();
        let flown = execute(&motion, &tracker, &mut plant, &Pose::identity(), 3, 7.2 / 719.0).unwrap();
        let expected = 2.0 / 3.0;
        assert!((flown.saturation.any - expected).abs() < 2.0 / 719.0, "{:?}", flown.saturation);
        let along_x =
            Saturation { any: flown.saturation.any, by_component: [0.0, 0.0, 0.0, flown.saturation.any, 0.0, 0.0] };
        assert_eq!(flown.saturation, along_x);
    }

    #[test]
    fn a_period_between_steps_is_refused() {
        for step_s in [0.03, 3.0, 0.0, -0.1, f64::NAN, f64::INFINITY] {
            let outcome = samples_per_period(10.0, step_s);
            assert!(matches!(outcome, Err(IdentificationError::PeriodNotWhole { .. })), "{step_s}");
        }
        let outcome = samples_per_period(10.0, 1e-12);
        assert!(matches!(outcome, Err(IdentificationError::TooManySamples { .. })), "{outcome:?}");
        assert_eq!(samples_per_period(10.0, 0.01), Ok(1000));
        assert_eq!(samples_per_period(10.0, 1.0 / 3.0), Ok(30));
    }

    #[test]
    fn an_undefined_attitude_is_refused() {
        let basis = FourierBasis::try_new(10.0, 1).unwrap();
        let still = FourierMotion::try_new(basis, AttitudeChart::Quaternion, DMatrix::zeros(3, 7)).unwrap();
        let tracker = PoseTracker::critically_damped(FreeFlyer::new(body()), 1.0, 1.0);
        let mut plant = SimulatedBody::try_new(
            FreeFlyer::new(body()),
            MuntheKaas4,
            limits(1.0, 1.0),
            RigidBodyState::at_rest(),
            0.1,
        )
        .unwrap();
        let outcome = execute(&still, &tracker, &mut plant, &Pose::identity(), 1, 0.1);
        assert!(matches!(outcome, Err(IdentificationError::AttitudeUndefined { .. })));
    }
}
