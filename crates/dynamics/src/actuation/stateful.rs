//! Actuators with a state of their own.

use super::Actuation;
use crate::error::DynamicsError;
use tumble_lie::Wrench;
use tumble_lie::nalgebra::Vector3;

/// Actuators with a state of their own, which whoever simulates them must carry on: the momentum of wheels, the filling
/// of a tank.
///
/// Every [`Actuation`] is one whose state is `()`. A pair is one, too: the second actuator is asked for what the first
/// leaves, as nozzles are beside wheels. [`SimulatedGyrostat`](crate::SimulatedGyrostat) advances the state;
/// [`SimulatedBody`](crate::SimulatedBody) takes only what has none, as the second of these examples shows, which does not compile.
///
/// # Example
/// ```
/// use tumble_dynamics::lie::Wrench;
/// use tumble_dynamics::nalgebra::Vector3;
/// use tumble_dynamics::{DynamicsError, StatefulActuation};
///
/// /// A spring that was wound up once: it turns the body about x until its momentum is spent.
/// struct Spring {
///     torque_n_m: f64,
///     momentum_n_m_s: f64,
/// }
/// impl StatefulActuation for Spring {
///     /// Momentum given so far, N m s.
///     type Inner = f64;
///     /// Share of the torque.
///     type Command = f64;
///     fn allocate_over(&self, _inner: &f64, wrench_body: &Wrench<f64>, _hold_s: f64) -> Result<f64, DynamicsError> {
///         let share = wrench_body.torque.x / self.torque_n_m;
///         if share.is_finite() { Ok(share.clamp(0.0, 1.0)) } else { Err(DynamicsError::NotFinite) }
///     }
///     fn realize_over(&self, inner: &f64, command: &f64, hold_s: f64) -> Wrench<f64> {
///         let left = (self.momentum_n_m_s - inner) / hold_s;
///         Wrench::new(Vector3::x() * (command * self.torque_n_m).min(left), Vector3::zeros())
///     }
///     fn advanced(&self, inner: &f64, command: &f64, hold_s: f64) -> f64 {
///         inner + self.realize_over(inner, command, hold_s).torque.x * hold_s
///     }
/// }
/// let (spring, wanted) = (Spring { torque_n_m: 0.1, momentum_n_m_s: 0.15 }, Wrench::new(Vector3::x(), Vector3::zeros()));
/// let command = spring.allocate_over(&0.0, &wanted, 1.0)?;
/// let after_one = spring.advanced(&0.0, &command, 1.0);
/// assert!((spring.realize_over(&after_one, &command, 1.0).torque.x - 0.05).abs() < 1e-12);
/// # Ok::<(), DynamicsError>(())
/// ```
/// ```compile_fail
/// use tumble_dynamics::{FreeFlyer, MuntheKaas4, ReactionWheels, RigidBodyState, SimulatedBody};
/// fn wheels_that_never_saturate(body: FreeFlyer<f64>, wheels: ReactionWheels<3>) {
///     SimulatedBody::try_new(body, MuntheKaas4, wheels, RigidBodyState::at_rest(), 0.01);
/// }
/// ```
///
/// Laws (feature `testing`): [`check_stateful_actuation`](crate::laws::check_stateful_actuation), and for wheels
/// [`check_momentum_storage`](crate::laws::check_momentum_storage). Tutorial: [an actuator of your
/// own](https://github.com/tumble-robotics/tumble/blob/main/crates/dynamics/tests/suite/custom_actuator.rs).
/// # Frame
/// Body axes, torque about the body origin.
pub trait StatefulActuation {
    /// What goes on from one command to the next.
    type Inner: Clone + core::fmt::Debug;
    /// What the machine is told.
    type Command: Clone + core::fmt::Debug;

    /// The command whose wrench, held for `hold_s`, is the wanted one, or the closest the machine can give.
    ///
    /// # Errors
    /// [`DynamicsError::NotFinite`] for a wrench that is not; the machine's own otherwise.
    fn allocate_over(
        &self,
        inner: &Self::Inner,
        wrench_body: &Wrench<f64>,
        hold_s: f64,
    ) -> Result<Self::Command, DynamicsError>;

    /// The mean wrench on the body while the command is held, without [`gyroscopic_torque`](Self::gyroscopic_torque).
    fn realize_over(&self, inner: &Self::Inner, command: &Self::Command, hold_s: f64) -> Wrench<f64>;

    /// The state after the command was held.
    fn advanced(&self, inner: &Self::Inner, command: &Self::Command, hold_s: f64) -> Self::Inner;

    /// Angular momentum that turns within the body, relative to it, N m s; `None` of actuators that never hold any.
    fn stored_momentum_body(&self, _inner: &Self::Inner) -> Option<Vector3<f64>> {
        None
    }

    /// Torque on a body that turns what is stored along with it, `h x w`, N m. It does no work.
    fn gyroscopic_torque(&self, inner: &Self::Inner, angular_velocity_body: &Vector3<f64>) -> Vector3<f64> {
        self.stored_momentum_body(inner).unwrap_or_default().cross(angular_velocity_body)
    }
}

impl<A: Actuation> StatefulActuation for A {
    type Inner = ();
    type Command = <A as Actuation>::Command;
    fn allocate_over(&self, (): &(), wrench_body: &Wrench<f64>, _hold_s: f64) -> Result<Self::Command, DynamicsError> {
        self.allocate(wrench_body)
    }
    fn realize_over(&self, (): &(), command: &Self::Command, _hold_s: f64) -> Wrench<f64> {
        self.realize(command)
    }
    fn advanced(&self, (): &(), _command: &Self::Command, _hold_s: f64) {}
}

/// The second gives what the first leaves.
impl<A: StatefulActuation, B: StatefulActuation> StatefulActuation for (A, B) {
    type Inner = (A::Inner, B::Inner);
    type Command = (A::Command, B::Command);
    fn allocate_over(
        &self,
        inner: &Self::Inner,
        wrench_body: &Wrench<f64>,
        hold_s: f64,
    ) -> Result<Self::Command, DynamicsError> {
        let first = self.0.allocate_over(&inner.0, wrench_body, hold_s)?;
        let rest = *wrench_body - self.0.realize_over(&inner.0, &first, hold_s);
        Ok((first, self.1.allocate_over(&inner.1, &rest, hold_s)?))
    }
    fn realize_over(&self, inner: &Self::Inner, command: &Self::Command, hold_s: f64) -> Wrench<f64> {
        self.0.realize_over(&inner.0, &command.0, hold_s) + self.1.realize_over(&inner.1, &command.1, hold_s)
    }
    fn advanced(&self, inner: &Self::Inner, command: &Self::Command, hold_s: f64) -> Self::Inner {
        (self.0.advanced(&inner.0, &command.0, hold_s), self.1.advanced(&inner.1, &command.1, hold_s))
    }
    fn stored_momentum_body(&self, inner: &Self::Inner) -> Option<Vector3<f64>> {
        let both = [self.0.stored_momentum_body(&inner.0), self.1.stored_momentum_body(&inner.1)];
        both.into_iter().flatten().reduce(|first, second| first + second)
    }
}
