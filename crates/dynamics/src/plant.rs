//! A simulated body behind the [`Plant`] interface (`f64`: it decides when to stop).

use crate::actuation::{Actuation, StatefulActuation};
use crate::error::DynamicsError;
use crate::gyrostat::{Gyrostat, GyrostatInput};
use crate::state::RigidBodyState;
use crate::system::{Integrator, MechanicalSystem, Plant};
use tumble_lie::Wrench;
use tumble_lie::nalgebra::{ComplexField, Vector3};

/// What [`SimulatedBody`] and [`SimulatedGyrostat`] report after each advance, without noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedMeasurement {
    /// Time since the start, ns.
    pub time_ns: u64,
    /// State at that time.
    pub state: RigidBodyState<f64>,
    /// The wrench that acted since the last report, after saturation, body axes.
    pub realized_wrench_body: Wrench<f64>,
    /// Momentum of wheels relative to the body at that time, body axes, N m s; zero without any.
    pub stored_momentum_body: Vector3<f64>,
}

/// A body, an integrator and actuators: wanted wrenches go in, motion comes out.
///
/// The wanted wrench is allocated once per advance, and what saturation lets through is held in body axes. Time is
/// kept in whole nanoseconds. Actuators with a state of their own belong into a [`SimulatedGyrostat`].
#[derive(Clone, Copy, Debug)]
pub struct SimulatedBody<S, I, A> {
    system: S,
    integrator: I,
    actuation: A,
    largest_step_ns: u64,
    time_ns: u64,
    state: RigidBodyState<f64>,
}

/// Seconds in a nanosecond.
const NANOSECOND_S: f64 = 1e-9;

/// Whole nanoseconds of a positive duration.
fn nanoseconds(duration_s: f64) -> Result<u64, DynamicsError> {
    let count = ComplexField::round(duration_s / NANOSECOND_S);
    // up to 2^63 ns every value of the cast below is exact or rounded to an integer
    if !(1.0..9.2e18).contains(&count) {
        return Err(DynamicsError::NotPositive { duration_s });
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // range tested above
    Ok(count as u64)
}

impl<S, I, A> SimulatedBody<S, I, A>
where
    S: MechanicalSystem<State = RigidBodyState<f64>, Input = Wrench<f64>>,
    I: Integrator<S>,
    A: Actuation,
{
    /// At `state`, integrated in equal steps no longer than `largest_step_s`.
    ///
    /// # Errors
    /// [`DynamicsError::NotPositive`] for a step that is not at least a nanosecond.
    pub fn try_new(
        system: S,
        integrator: I,
        actuation: A,
        state: RigidBodyState<f64>,
        largest_step_s: f64,
    ) -> Result<Self, DynamicsError> {
        let largest_step_ns = nanoseconds(largest_step_s)?;
        Ok(Self { system, integrator, actuation, largest_step_ns, time_ns: 0, state })
    }

    /// The true state.
    pub fn state(&self) -> &RigidBodyState<f64> {
        &self.state
    }

    /// Time since the start, s.
    pub fn time_s(&self) -> f64 {
        self.time_ns as f64 * NANOSECOND_S
    }
}

impl<S, I, A> Plant for SimulatedBody<S, I, A>
where
    S: MechanicalSystem<State = RigidBodyState<f64>, Input = Wrench<f64>>,
    I: Integrator<S>,
    A: Actuation,
{
    /// Wanted wrench, body axes, torque about the body origin.
    type Input = Wrench<f64>;
    type Measurement = SimulatedMeasurement;
    type Error = DynamicsError;

    /// Leaves everything as it was where it fails.
    fn advance(&mut self, wanted: &Wrench<f64>, duration_s: f64) -> Result<SimulatedMeasurement, DynamicsError> {
        let duration_ns = nanoseconds(duration_s)?;
        let realized_wrench_body = self.actuation.realize(&self.actuation.allocate(wanted)?);
        let span = Span { start_s: self.time_s(), duration_ns, largest_step_ns: self.largest_step_ns };
        self.state = span.crossed(&self.system, &self.integrator, self.state, &realized_wrench_body)?;
        self.time_ns += duration_ns;
        let (time_ns, state) = (self.time_ns, self.state);
        Ok(SimulatedMeasurement { time_ns, state, realized_wrench_body, stored_momentum_body: Vector3::zeros() })
    }
}

/// A stretch of time in equal steps.
struct Span {
    start_s: f64,
    duration_ns: u64,
    largest_step_ns: u64,
}

impl Span {
    /// The state at its end.
    fn crossed<S: MechanicalSystem<State = RigidBodyState<f64>>>(
        &self,
        system: &S,
        integrator: &impl Integrator<S>,
        mut state: RigidBodyState<f64>,
        input: &S::Input,
    ) -> Result<RigidBodyState<f64>, DynamicsError> {
        let steps = self.duration_ns.div_ceil(self.largest_step_ns);
        let step_s = self.duration_ns as f64 * NANOSECOND_S / steps as f64;
        for step in 0..steps {
            let time_s = self.start_s + step as f64 * step_s;
            state = integrator.step(system, &state, input, time_s, step_s)?;
        }
        Ok(state)
    }
}

/// A [`SimulatedBody`] whose actuators have a state of their own: wheels saturate, and the body precesses with what they
/// hold.
///
/// ```
/// use tumble_dynamics::lie::Wrench;
/// use tumble_dynamics::nalgebra::Vector3;
/// use tumble_dynamics::{
///     FreeFlyer, InertialParameters, MuntheKaas4, Plant, ReactionWheel, ReactionWheels, RigidBodyState,
///     SimulatedGyrostat,
/// };
/// let wheel = |axis_body| ReactionWheel { axis_body, largest_torque_n_m: 0.2, largest_momentum_n_m_s: 2.3 };
/// let wheels = ReactionWheels::try_new([Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()].map(wheel))?;
/// let servicer = FreeFlyer::new(InertialParameters::solid_box(300.0, [1.5, 1.2, 1.0]));
/// let state = RigidBodyState::at_rest();
/// let mut plant = SimulatedGyrostat::try_new(servicer, MuntheKaas4, (wheels, Vector3::zeros()), state, 0.1)?;
/// let turn = Wrench::new(Vector3::x() * 0.2, Vector3::zeros());
/// for _ in 0..100 {
///     plant.advance(&turn, 1.0)?;
/// }
/// assert!((plant.stored_momentum_body().x + 2.3).abs() < 1e-12); // after 12 s the wheel gives no more
/// # Ok::<(), tumble_dynamics::DynamicsError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SimulatedGyrostat<S, I, A: StatefulActuation> {
    system: Gyrostat<S>,
    integrator: I,
    actuation: A,
    inner: A::Inner,
    largest_step_ns: u64,
    time_ns: u64,
    state: RigidBodyState<f64>,
}

impl<S, I, A> SimulatedGyrostat<S, I, A>
where
    S: MechanicalSystem<State = RigidBodyState<f64>, Input = Wrench<f64>>,
    I: Integrator<Gyrostat<S>>,
    A: StatefulActuation,
{
    /// At `state`, the actuators at theirs, integrated in equal steps no longer than `largest_step_s`.
    ///
    /// # Errors
    /// [`DynamicsError::NotPositive`] for a step that is not at least a nanosecond.
    pub fn try_new(
        system: S,
        integrator: I,
        actuation: (A, A::Inner),
        state: RigidBodyState<f64>,
        largest_step_s: f64,
    ) -> Result<Self, DynamicsError> {
        let largest_step_ns = nanoseconds(largest_step_s)?;
        let (actuation, inner) = actuation;
        Ok(Self { system: Gyrostat(system), integrator, actuation, inner, largest_step_ns, time_ns: 0, state })
    }

    /// The true state of the body.
    pub fn state(&self) -> &RigidBodyState<f64> {
        &self.state
    }

    /// The true state of the actuators.
    pub fn inner(&self) -> &A::Inner {
        &self.inner
    }

    /// Momentum of wheels relative to the body, body axes, N m s.
    pub fn stored_momentum_body(&self) -> Vector3<f64> {
        self.actuation.stored_momentum_body(&self.inner).unwrap_or_default()
    }

    /// Time since the start, s.
    pub fn time_s(&self) -> f64 {
        self.time_ns as f64 * NANOSECOND_S
    }
}

impl<S, I, A> Plant for SimulatedGyrostat<S, I, A>
where
    S: MechanicalSystem<State = RigidBodyState<f64>, Input = Wrench<f64>>,
    I: Integrator<Gyrostat<S>>,
    A: StatefulActuation,
{
    /// Wanted wrench, body axes, torque about the body origin.
    type Input = Wrench<f64>;
    type Measurement = SimulatedMeasurement;
    type Error = DynamicsError;

    /// Leaves everything as it was where it fails.
    fn advance(&mut self, wanted: &Wrench<f64>, duration_s: f64) -> Result<SimulatedMeasurement, DynamicsError> {
        let duration_ns = nanoseconds(duration_s)?;
        let hold_s = duration_ns as f64 * NANOSECOND_S;
        let command = self.actuation.allocate_over(&self.inner, wanted, hold_s)?;
        let realized_wrench_body = self.actuation.realize_over(&self.inner, &command, hold_s);
        let inner = self.actuation.advanced(&self.inner, &command, hold_s);
        let (stored_body, start_s) = (self.stored_momentum_body(), self.time_s());
        let stored_momentum_body = self.actuation.stored_momentum_body(&inner).unwrap_or_default();
        let input = GyrostatInput {
            wrench_body: realized_wrench_body,
            stored_body,
            stored_rate_body: (stored_momentum_body - stored_body) / hold_s,
            since_s: start_s,
        };
        let span = Span { start_s, duration_ns, largest_step_ns: self.largest_step_ns };
        self.state = span.crossed(&self.system, &self.integrator, self.state, &input)?;
        self.inner = inner;
        self.time_ns += duration_ns;
        let (time_ns, state) = (self.time_ns, self.state);
        Ok(SimulatedMeasurement { time_ns, state, realized_wrench_body, stored_momentum_body })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FreeFlyer, InertialParameters, MuntheKaas4, WrenchBox};
    use tumble_lie::nalgebra::Vector3;

    fn plant(largest_step_s: f64) -> Result<SimulatedBody<FreeFlyer<f64>, MuntheKaas4, WrenchBox>, DynamicsError> {
        let body = FreeFlyer::new(InertialParameters::solid_box(5.0, [0.3, 0.2, 0.1]));
        let limits = WrenchBox { torque_limit: Vector3::repeat(0.1), force_limit: Vector3::repeat(0.5) };
        let mut start = RigidBodyState::at_rest();
        start.twist_body.angular = Vector3::new(0.3, -0.8, 0.5);
        SimulatedBody::try_new(body, MuntheKaas4, limits, start, largest_step_s)
    }

    #[test]
    fn saturates_and_keeps_time_in_whole_nanoseconds() {
        let mut plant = plant(0.01).unwrap();
        let wanted = Wrench::new(Vector3::new(0.05, -3.0, 0.0), Vector3::new(2.0, 0.1, -0.6));
        let mut measured = plant.advance(&wanted, 0.1).unwrap();
        assert_eq!(measured.realized_wrench_body.torque, Vector3::new(0.05, -0.1, 0.0));
        assert_eq!(measured.realized_wrench_body.force, Vector3::new(0.5, 0.1, -0.5));
        for _ in 1..1000 {
            measured = plant.advance(&wanted, 0.1).unwrap();
        }
        assert_eq!(measured.time_ns, 100_000_000_000);
        assert!((plant.time_s() - 100.0).abs() < 1e-12);
        assert_eq!(plant.state(), &measured.state);
    }

    #[test]
    fn the_largest_step_only_changes_the_accuracy() {
        let wanted = Wrench::new(Vector3::new(0.05, -0.02, 0.03), Vector3::new(0.2, 0.1, -0.3));
        // 0.25 s in three and in 250 steps
        let coarse = plant(0.1).unwrap().advance(&wanted, 0.25).unwrap();
        let fine = plant(0.001).unwrap().advance(&wanted, 0.25).unwrap();
        let difference = (coarse.state.twist_body - fine.state.twist_body).to_vector().amax();
        assert!(difference < 1e-6 && difference > 0.0, "{difference:e}");
    }

    #[test]
    fn bad_input_is_an_error_and_changes_nothing() {
        assert!(matches!(plant(0.0), Err(DynamicsError::NotPositive { .. })));
        let mut plant = plant(0.01).unwrap();
        let before = *plant.state();
        for duration_s in [0.0, -1.0, 1e-12, f64::NAN, f64::INFINITY] {
            let outcome = plant.advance(&Wrench::zero(), duration_s);
            assert!(matches!(outcome, Err(DynamicsError::NotPositive { .. })), "{duration_s}");
        }
        let broken = Wrench::new(Vector3::repeat(f64::NAN), Vector3::zeros());
        assert_eq!(plant.advance(&broken, 0.1), Err(DynamicsError::NotFinite));
        assert_eq!((plant.state(), plant.time_s()), (&before, 0.0));
    }
}
