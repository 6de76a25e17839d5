//! Reaction wheels: torque without force, as long as they can spin faster.

use super::StatefulActuation;
use super::effectiveness::{finite, limited, right_inverse};
use crate::error::DynamicsError;
use tumble_lie::Wrench;
use tumble_lie::nalgebra::{SMatrix, SVector, UnitVector3, Vector3};

/// A flywheel and its motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReactionWheel {
    /// Spin axis, body axes.
    pub axis_body: UnitVector3<f64>,
    /// Largest motor torque either way, N m; positive.
    pub largest_torque_n_m: f64,
    /// Largest momentum either way relative to the body, that is inertia times largest speed, N m s; positive.
    pub largest_momentum_n_m_s: f64,
}

/// `N` wheels; what they hold is the state of [`StatefulActuation`]: the momentum of each about its axis, relative to the
/// body, N m s.
///
/// The command is the torque of each motor on its wheel, N m, held; the body gets the opposite. A motor gives no more
/// than its limit, nor what would spin its wheel beyond its largest momentum while the command is held.
/// Wheels cannot push: the force of a wanted wrench is left to other actuators, and the law "what lies inside the limits
/// is realised" speaks of wrenches without force. The inertia of the body is that with the wheels held fast.
/// # Frame
/// Body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReactionWheels<const N: usize> {
    wheels: [ReactionWheel; N],
    /// Body torque per motor torque.
    effectiveness: SMatrix<f64, 3, N>,
    /// Motor torques of least norm, each over its limit, per body torque.
    sharing: SMatrix<f64, N, 3>,
}

impl<const N: usize> ReactionWheels<N> {
    /// Wheels that together turn the body any way.
    ///
    /// # Errors
    /// [`DynamicsError::InvalidActuator`] for a wheel whose limits are not positive and finite,
    /// [`DynamicsError::OutOfReach`] if the axes do not span all directions.
    pub fn try_new(wheels: [ReactionWheel; N]) -> Result<Self, DynamicsError> {
        let valid = |limit: f64| limit > 0.0 && limit.is_finite();
        let fits = |wheel: &ReactionWheel| valid(wheel.largest_torque_n_m) && valid(wheel.largest_momentum_n_m_s);
        if let Some(index) = wheels.iter().position(|wheel| !fits(wheel)) {
            return Err(DynamicsError::InvalidActuator { index });
        }
        let effectiveness = SMatrix::from_fn(|row, i| -wheels[i].axis_body[row]);
        let at_limit = SMatrix::from_fn(|row, i| effectiveness[(row, i)] * wheels[i].largest_torque_n_m);
        let efforts: SMatrix<f64, N, 3> = right_inverse(&at_limit)?;
        let sharing = SMatrix::from_fn(|i, column| efforts[(i, column)] * wheels[i].largest_torque_n_m);
        Ok(Self { wheels, effectiveness, sharing })
    }

    /// The wheels.
    pub fn wheels(&self) -> &[ReactionWheel; N] {
        &self.wheels
    }

    /// The least and the largest torque that a motor can hold.
    fn torque_bounds(&self, i: usize, momentum: &SVector<f64, N>, hold_s: f64) -> (f64, f64) {
        let ReactionWheel { largest_torque_n_m: torque, largest_momentum_n_m_s: largest, .. } = self.wheels[i];
        let to_reach = |bound: f64| (bound - momentum[i]) / hold_s;
        (to_reach(-largest).max(-torque).min(0.0), to_reach(largest).min(torque).max(0.0))
    }

    /// What the motors give of a command.
    fn motor_torques(&self, momentum: &SVector<f64, N>, command: &SVector<f64, N>, hold_s: f64) -> SVector<f64, N> {
        SVector::from_fn(|i, _| {
            let (least, largest) = self.torque_bounds(i, momentum, hold_s);
            limited(command[i], least, largest)
        })
    }
}

impl<const N: usize> StatefulActuation for ReactionWheels<N> {
    type Inner = SVector<f64, N>;
    type Command = SVector<f64, N>;

    fn allocate_over(
        &self,
        momentum: &SVector<f64, N>,
        wrench_body: &Wrench<f64>,
        hold_s: f64,
    ) -> Result<SVector<f64, N>, DynamicsError> {
        finite(wrench_body.to_vector())?;
        let torques = finite(self.sharing * wrench_body.torque)?;
        let part = |i: usize| {
            let (least, largest) = self.torque_bounds(i, momentum, hold_s);
            let bound = if torques[i] > 0.0 { largest } else { least };
            if torques[i].abs() > bound.abs() { bound / torques[i] } else { 1.0 }
        };
        Ok(torques * (0..N).map(part).fold(1.0, f64::min))
    }

    fn realize_over(&self, momentum: &SVector<f64, N>, command: &SVector<f64, N>, hold_s: f64) -> Wrench<f64> {
        Wrench::new(self.effectiveness * self.motor_torques(momentum, command, hold_s), Vector3::zeros())
    }

    /// Momentum moves from the body into the wheels.
    fn advanced(&self, momentum: &SVector<f64, N>, command: &SVector<f64, N>, hold_s: f64) -> SVector<f64, N> {
        momentum + self.motor_torques(momentum, command, hold_s) * hold_s
    }

    fn stored_momentum_body(&self, momentum: &SVector<f64, N>) -> Option<Vector3<f64>> {
        Some(-(self.effectiveness * momentum))
    }
}
